//! Sets of images against a reference.

use skylit::compare::{Entry, ImageSet, parse_letter, short_names};
use skylit::measure::comparison::CompareOptions;
use skylit::output::{Channel, Image, Samples};

fn entry(name: &str, width: u32, value: f32) -> Entry {
    let samples = Samples::F32(vec![value; 2 * width as usize]);
    let image = Image { width, height: 2, channels: vec![Channel { name: "Y".into(), samples }], metadata: Vec::new() };
    Entry { name: name.into(), image, ..Entry::default() }
}

#[test]
fn all_are_compared_with_the_reference() {
    let entries = || vec![entry("a", 2, 0.5), entry("b", 2, 0.25), entry("c", 2, 0.75)];
    let biases = |reference| -> Vec<Option<f64>> {
        let set = ImageSet::new(entries(), reference, &CompareOptions::default()).unwrap();
        set.comparisons.iter().map(|c| c.as_ref().map(|c| c.bias)).collect()
    };
    assert_eq!(biases(1), [Some(0.25), None, Some(0.5)]);
    assert_eq!(biases(2), [Some(-0.25), Some(-0.5), None]);
}

#[test]
fn errors_name_the_images() {
    let error = |entries: Vec<Entry>, reference| {
        ImageSet::new(entries, reference, &CompareOptions::default()).map(|_| ()).unwrap_err().to_string()
    };
    let text = error(vec![entry("a.exr", 2, 0.5), entry("b.exr", 3, 0.5)], 1);
    assert!(text.contains("A (a.exr) against B (b.exr)") && text.contains("2x2 and 3x2"), "{text}");
    assert!(error(vec![entry("a", 2, 0.5)], 0).contains("two images"));
    assert!(
        error(vec![entry("a", 2, 0.5), entry("b", 2, 0.5)], 2).contains("--reference C: there are 2 images, A to B")
    );
}

#[test]
fn names_are_short_but_different() {
    assert_eq!(short_names(&["x/a.exr", "x/b.exr"]), ["a.exr", "b.exr"]);
    assert_eq!(short_names(&["x/a.exr", "y/a.exr", "b.exr"]), ["x/a.exr", "y/a.exr", "b.exr"]);
    assert_eq!([parse_letter("A"), parse_letter("c")], [Ok(0), Ok(2)]);
    assert!(["", "1", "AB", "é"].iter().all(|t| parse_letter(t).is_err()));
}
