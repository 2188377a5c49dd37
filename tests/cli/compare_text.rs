//! Comparisons as text, CSV and JSON.

use skylit::compare::{Entry, ImageSet};
use skylit::measure::comparison::CompareOptions;
use skylit::output::{Channel, Image, Samples};

#[test]
fn a_column_for_each_image_but_the_reference() {
    let entry = |name: &str, value: f32| {
        let channels = vec![Channel { name: "Y".into(), samples: Samples::F32(vec![value; 4]) }];
        let image = Image { width: 2, height: 2, channels, metadata: Vec::new() };
        Entry { name: name.into(), description: "d".into(), image, ..Entry::default() }
    };
    let entries = vec![entry("a.exr", 0.5), entry("b.exr", 0.25), entry("c.exr", 0.0)];
    let set = ImageSet::new(entries, 1, &CompareOptions::default()).unwrap();
    let lines = set.lines();
    assert_eq!(
        lines[..4],
        ["A: a.exr, d", "B (reference): b.exr, d", "C: c.exr, d", "channels Y of 2x2 pixels, over all pixels"]
    );
    assert_eq!(lines[4].split_whitespace().collect::<Vec<_>>(), ["A", "C"]);
    let rmse: Vec<_> = lines.iter().find(|l| l.starts_with("RMSE")).unwrap().split_whitespace().collect();
    assert_eq!(rmse, ["RMSE", "0.2500", "0.2500"]);
    // images without variances have no outliers
    assert!(!lines.iter().any(|l| l.starts_with("Outliers") || l.starts_with("Error of the reference")));
    let csv = String::from_utf8(set.csv().unwrap()).unwrap();
    let table: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let column = table[0].iter().position(|name| *name == "rmse").unwrap();
    assert_eq!((table.len(), table[1][column], table[2][0], table[2][column]), (3, "0.25", "C", "0.25"), "{csv}");
    let record = set.record();
    assert_eq!(record["images"][2]["metrics"]["rmse"], 0.25);
    assert!(record["images"][1]["metrics"].is_null() && record["images"][0]["metrics"]["maps"].is_null());
    assert_eq!((record["reference"].as_str(), record["size"][0].as_u64()), (Some("B"), Some(2)));
}
