//! Metadata of images about how they were made, where they do not agree.

use super::{ImageSet, letter};
use crate::output::Image;

/// A metadata entry in which images differ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DifferingEntry {
    pub key: String,
    /// The value in each image; `None` where an image does not have it.
    pub values: Vec<Option<String>>,
}

/// The metadata entries that not all images have with the same value, by key.
pub fn differing_metadata(set: &ImageSet) -> Vec<DifferingEntry> {
    let images = || set.entries.iter().map(|e| &e.image);
    let mut keys: Vec<&str> = images().flat_map(|i| i.metadata.iter().map(|(k, _)| k.as_str())).collect();
    keys.sort_unstable();
    keys.dedup();
    let values = |key: &str| images().map(|i| i.metadata(key).map(str::to_owned)).collect::<Vec<_>>();
    let entries = keys.into_iter().map(|key| DifferingEntry { key: key.to_owned(), values: values(key) });
    entries.filter(|e| e.values.iter().any(|v| *v != e.values[0])).collect()
}

/// Entries that images of one view have in common, their names, and help where they differ.
const VIEW: [(&str, &str, &str); 3] = [
    ("scene", "scene", "the difference is that of two scenes"),
    ("camera", "camera", "pixels do not show the same points; render both with one camera"),
    (
        "pixel_filter",
        "pixel filter",
        "edges differ by the filter alone; frames have box with --antialias on and centre with --antialias off, stills what --pixel-filter says",
    ),
];

/// A warning for each entry of the view in which an image and the reference differ.
pub(super) fn warnings(set: &ImageSet) -> Vec<String> {
    let reference = set.reference;
    // earlier versions wrote absolute paths
    let of = |image: &Image, key: &str| image.metadata(key).map(crate::files::portable_name);
    let mut warnings = Vec::new();
    for (key, name, remedy) in VIEW {
        let Some(its) = of(&set.entries[reference].image, key) else { continue };
        for (k, entry, _) in set.judged() {
            if let Some(ours) = of(&entry.image, key).filter(|v| *v != its) {
                let letters = [letter(k), letter(reference)];
                let values = match [readable(&ours), readable(&its)] {
                    [a, b] if a == b => format!("{ours}; {its}"),
                    [a, b] => format!("{a}; {b}"),
                };
                warnings.push(format!("{} and {} differ in their {name} ({values}): {remedy}", letters[0], letters[1]));
            }
        }
    }
    warnings
}

/// The text with its numbers rounded to four digits: cameras have all seventeen.
fn readable(text: &str) -> String {
    let is_number = |c: char| c.is_ascii_digit() || "+-.e".contains(c);
    let (mut out, mut rest) = (String::new(), text);
    while let Some(first) = rest.chars().next() {
        let length = rest.find(|c| is_number(c) != is_number(first)).unwrap_or(rest.len());
        let (word, after) = rest.split_at(length);
        out += &match word.parse::<f64>() {
            Ok(number) if word.len() > 6 && word.contains('.') => {
                format!("{}", format!("{number:.3e}").parse().unwrap_or(number))
            }
            _ => word.to_owned(),
        };
        rest = after;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::Entry;
    use super::*;
    use crate::measure::comparison::CompareOptions;
    use crate::output::{Channel, Samples};

    #[test]
    fn numbers_of_cameras_are_readable() {
        let camera = "\"main\" eye [2.7800000000000002, 2.73, -8], forward [0.9737024961747475, -0, 1]; fov_y 59.99999999999999 degrees";
        assert_eq!(readable(camera), "\"main\" eye [2.78, 2.73, -8], forward [0.9737, -0, 1]; fov_y 60 degrees");
        assert_eq!(readable("scene.glb; builtin:grid:1000000"), "scene.glb; builtin:grid:1000000");
    }

    #[test]
    fn what_differs_is_named() {
        let entry = |metadata: &[(&str, &str)]| {
            let metadata = metadata.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
            let channels = vec![Channel { name: "Y".into(), samples: Samples::F32(vec![0.5]) }];
            Entry { image: Image { width: 1, height: 1, channels, metadata }, ..Entry::default() }
        };
        let a = entry(&[("scene", "x"), ("pixel_filter", "centre"), ("spp", "4")]);
        let b = entry(&[("scene", "x"), ("pixel_filter", "box"), ("tracer", "query")]);
        let set = ImageSet::new(vec![a, b, entry(&[])], 1, &CompareOptions::default()).unwrap();
        assert_eq!(set.warnings.len(), 1);
        assert!(
            set.warnings[0].starts_with("A and B differ in their pixel filter (centre; box): "),
            "{}",
            set.warnings[0]
        );
        let differing: Vec<_> = differing_metadata(&set).into_iter().map(|e| e.key).collect();
        // the third image has none of them
        assert_eq!(differing, ["pixel_filter", "scene", "spp", "tracer"]);
    }
}
