//! Images against a reference: files, or a scene rendered on the spot. [`ImageSet`] has the
//! numbers, [`page`] makes a report of them, [`picture`] pictures of the differences.

mod agreement;
pub mod ao_versus_path;
pub mod page;
pub mod picture;
pub mod render;
pub mod text;

use std::path::Path;

use crate::error::{Error, Result};
use crate::measure::comparison::{self, CompareOptions, Comparison};
use crate::output::Image;

pub use agreement::{DifferingEntry, differing_metadata};

/// Most images that are compared at once: as many as there are letters.
pub const MAX_IMAGES: usize = 26;

/// An image that takes part in a comparison.
#[derive(Clone, Debug, Default)]
pub struct Entry {
    /// A short name: of the file, or of the settings.
    pub name: String,
    /// More about it, a line: the path of its file, or the scene.
    pub description: String,
    /// A sentence for each setting that was left open and the scene decided.
    pub choices: Vec<String>,
    pub image: Image,
    /// The linear colour that pages show it on, where its settings have one.
    pub background: Option<[f32; 3]>,
}

/// Images, and how each of them differs from the one that is the reference.
#[derive(Clone, Debug)]
pub struct ImageSet {
    /// The images: A, B, C, ...
    pub entries: Vec<Entry>,
    pub reference: usize,
    /// How each differs from the reference; `None` for the reference itself.
    pub comparisons: Vec<Option<Comparison>>,
    /// A sentence for each reason why images that are otherwise alike differ.
    pub warnings: Vec<String>,
}

/// A, B, C, ...
pub fn letter(index: usize) -> char {
    // more than 26 are refused
    char::from(b'A' + index.min(MAX_IMAGES - 1) as u8)
}

/// Index of an image by its letter.
///
/// # Errors
/// What is expected instead.
pub fn parse_letter(text: &str) -> Result<usize, String> {
    match text.as_bytes() {
        [letter] if letter.is_ascii_alphabetic() => Ok(usize::from(letter.to_ascii_uppercase() - b'A')),
        _ => Err("expected the letter of an image: A is the first, B the second".into()),
    }
}

impl ImageSet {
    /// Compares all images with number `reference` of them.
    pub fn new(entries: Vec<Entry>, reference: usize, options: &CompareOptions) -> Result<Self> {
        check_count(entries.len(), reference)?;
        let comparisons = entries.iter().enumerate().map(|(k, entry)| match k {
            k if k == reference => Ok(None),
            _ => comparison::compare(&entry.image, &entries[reference].image, options)
                .map(Some)
                .map_err(|e| name_images(e, &title(&entries, k), &title(&entries, reference))),
        });
        let comparisons = comparisons.collect::<Result<Vec<_>>>()?;
        let mut set = Self { entries, reference, comparisons, warnings: Vec::new() };
        set.warnings = agreement::warnings(&set);
        Ok(set)
    }

    /// Letter and name of an image: `A (ao.exr)`.
    pub fn title(&self, index: usize) -> String {
        title(&self.entries, index)
    }

    /// The images that were compared with the reference, and how they differ from it.
    pub fn judged(&self) -> impl Iterator<Item = (usize, &Entry, &Comparison)> {
        let pairs = self.entries.iter().zip(&self.comparisons).enumerate();
        pairs.filter_map(|(k, (entry, comparison))| Some((k, entry, comparison.as_ref()?)))
    }
}

/// Checks, before anything is loaded or rendered, that there are images to compare.
///
/// # Errors
/// [`Error::Usage`] for fewer than two images, more than [`MAX_IMAGES`], or no such reference.
pub fn check_count(count: usize, reference: usize) -> Result<()> {
    let wrong = |text: String| Err(Error::Usage(text));
    match count {
        0 | 1 => wrong("two images are needed: name two files, or a --scene with --a and --b, which render it".into()),
        n if n > MAX_IMAGES => wrong(format!("{n} images are too many: up to {MAX_IMAGES} can be compared at once")),
        n if reference >= n => {
            wrong(format!("--reference {}: there are {n} images, A to {}", letter(reference), letter(n - 1)))
        }
        _ => Ok(()),
    }
}

fn title(entries: &[Entry], index: usize) -> String {
    format!("{} ({})", letter(index), entries[index].name)
}

/// The same error, with the images that it is about.
fn name_images(error: Error, image: &str, reference: &str) -> Error {
    let names = format!("{image} against {reference}");
    match error {
        Error::Usage(text) => Error::Usage(format!("{names}: {text}")),
        Error::CheckFailed(text) => Error::CheckFailed(format!("{names}: {text}")),
        other => other,
    }
}

/// Names of files, short but different: the file's name where no other file has it, else the path.
pub fn short_names(paths: &[impl AsRef<Path>]) -> Vec<String> {
    let name = |p: &Path| p.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let names: Vec<String> = paths.iter().map(|p| name(p.as_ref())).collect();
    let is_unique = |k: usize| names.iter().filter(|n| **n == names[k]).count() == 1;
    let short = |(k, p): (usize, &Path)| if is_unique(k) { names[k].clone() } else { p.display().to_string() };
    paths.iter().map(AsRef::as_ref).enumerate().map(short).collect()
}
