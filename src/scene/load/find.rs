//! Search for files that are referenced by other files, possibly with paths of another machine.

use std::borrow::Cow;
use std::collections::HashMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use super::options::LoadOptions;
use super::{confine, text};
use crate::error::{Error, Result as LoadResult};

/// Number of parent folders to search above the referencing file's folder.
const ANCESTORS: usize = 3;

/// Parts at the end of a path of another machine that are looked for: `t.png`, `maps/t.png`, ...
const MAX_PARTS: usize = 4;

/// Searches folders, which it lists once each.
pub(super) struct Finder {
    /// The folder without links that files have to lie below.
    confine: Option<PathBuf>,
    /// The first name that leads out of it.
    refused: Option<String>,
    /// Entries of each folder that was listed, by their names in lower case, sorted.
    listings: HashMap<PathBuf, HashMap<String, Vec<OsString>>>,
}

impl Finder {
    /// Nothing listed yet.
    pub(super) fn new(options: &LoadOptions) -> Self {
        Self { confine: options.confine.folder().map(Path::to_owned), refused: None, listings: HashMap::new() }
    }

    /// Fails if a name leads out of the folder that files have to lie below.
    ///
    /// # Errors
    /// [`Error::Input`] about `file`, which has the name.
    pub(super) fn check(&self, file: &Path) -> LoadResult<()> {
        self.refused.as_ref().map_or(Ok(()), |name| Err(Error::input(file, confine::refusal(&text::shown(name)))))
    }

    /// The path to open of a file that was found; none of one that lies elsewhere.
    fn admit(&self, path: PathBuf) -> Option<PathBuf> {
        match &self.confine {
            Some(folder) => confine::below(folder, &path),
            None => Some(path),
        }
    }

    /// Whether a name that nothing was found for means a file elsewhere.
    fn is_outside(&self, spellings: &[Vec<u8>], own: &[PathBuf]) -> bool {
        let Some(confine) = &self.confine else { return false };
        let leaves =
            |folder: &PathBuf| spellings.iter().any(|name| confine::leaves(confine, folder, &text::path(name)));
        own.iter().any(leaves)
    }

    /// Looks for a file that is referred to as one of `names` (texts of [`text`]), by the files in
    /// `beside`. The first that exists wins, of these:
    ///
    /// 1. The name as it is written, in the folders of `beside` and up to three above each, with
    ///    and without a leading `models/`; then with backslashes as slashes, without
    ///    percent-encoding, and from Latin-1.
    /// 2. The same in another case of letters.
    /// 3. The end of the name, `maps/t.png` of `C:\me\maps\t.png`; its last part alone beside the
    ///    files only.
    ///
    /// # Errors
    /// The folders that were searched, each once, for the message.
    pub(super) fn find(&mut self, names: &[&str], beside: &[&Path]) -> Result<PathBuf, Vec<PathBuf>> {
        let spellings = spellings(names);

        // folders beside the files, and those above them
        let (mut folders, mut own) = (Vec::new(), Vec::new());
        for file in beside {
            // absolute, because "scene.obj" has no ancestors to climb to
            let mut file = std::path::absolute(file).unwrap_or_else(|_| file.to_path_buf());
            if self.confine.is_some() {
                let folder = std::fs::canonicalize(crate::files::folder_of(&file)).unwrap_or_default();
                file = folder.join(file.file_name().unwrap_or_default());
            }
            let may = |folder: &Path| self.confine.as_ref().is_none_or(|confine| folder.starts_with(confine));
            let above = file.ancestors().skip(1).take(1 + ANCESTORS).enumerate();
            for (above, folder) in above.filter(|(_, folder)| may(folder)) {
                if !folders.iter().any(|f| f == folder) {
                    folders.push(folder.to_owned());
                }
                if above == 0 && !own.iter().any(|f| f == folder) {
                    own.push(folder.to_owned());
                }
            }
        }

        // the name as it is written, with and without the folder `models`
        let mut models: Vec<PathBuf> = Vec::new();
        for spelling in spellings.iter().map(|s| text::path(s)) {
            let other =
                spelling.strip_prefix("models").map_or_else(|_| Path::new("models").join(&spelling), Path::to_owned);
            models.extend([spelling, other]);
        }
        let exact = folders.iter().flat_map(|folder| models.iter().map(move |name| folder.join(name)));
        if let Some(found) = exact.filter(|p| p.is_file()).find_map(|p| self.admit(p)) {
            return Ok(found);
        }

        // the same in any case of letters
        for folder in &folders {
            if let Some(found) = models.iter().find_map(|name| self.in_any_case(folder, name)) {
                return Ok(found);
            }
        }

        // an absolute path of another machine: by its last parts
        for spelling in &spellings {
            let parts: Vec<&[u8]> = spelling.split(|b| *b == b'/').filter(|p| !p.is_empty() && *p != b".").collect();
            let longest = parts.len().saturating_sub(1).min(MAX_PARTS);
            for count in (1..=longest).rev() {
                let end = text::path(&parts[parts.len() - count..].join(&b"/"[..]));
                let searched = if count == 1 { &own } else { &folders };
                if let Some(found) = searched.iter().find_map(|folder| self.in_any_case(folder, &end)) {
                    return Ok(found);
                }
            }
        }

        if self.is_outside(&spellings, &own) {
            self.refused.get_or_insert_with(|| names.first().copied().unwrap_or_default().to_owned());
        }
        Err(folders)
    }

    /// A file below a folder, whatever the case of the letters of its name; the exact name comes
    /// first.
    fn in_any_case(&mut self, folder: &Path, name: &Path) -> Option<PathBuf> {
        use std::path::Component;
        let exact = folder.join(name);
        if exact.is_file() {
            return self.admit(exact);
        }
        let mut path = folder.to_owned();
        for component in name.components() {
            match component {
                Component::CurDir => {}
                Component::ParentDir => path.push(".."),
                Component::Normal(part) if path.join(part).exists() => path.push(part),
                // folders elsewhere are not listed
                Component::Normal(part) => {
                    path = self.admit(path)?;
                    let entry = self.listing(&path).get(&lower_case(part))?.first()?;
                    path.push(entry);
                }
                Component::RootDir | Component::Prefix(_) => return None,
            }
        }
        if path.is_file() { self.admit(path) } else { None }
    }

    fn listing(&mut self, folder: &Path) -> &HashMap<String, Vec<OsString>> {
        self.listings.entry(folder.to_owned()).or_insert_with(|| {
            let mut names: Vec<OsString> =
                std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.file_name()).collect();
            names.sort();
            let mut listing: HashMap<String, Vec<OsString>> = HashMap::new();
            for name in names {
                listing.entry(lower_case(&name)).or_default().push(name);
            }
            listing
        })
    }
}

fn lower_case(name: &std::ffi::OsStr) -> String {
    text::from_bytes(name.as_encoded_bytes()).to_lowercase()
}

/// The ways in which names may be spelled on disk, the likeliest first, each once.
fn spellings(names: &[&str]) -> Vec<Vec<u8>> {
    let mut all: Vec<Vec<u8>> = Vec::new();
    let mut add = |spelling: Vec<u8>| {
        if !spelling.is_empty() && !all.contains(&spelling) {
            all.push(spelling);
        }
    };
    for name in names {
        add(text::bytes_of(name).into_owned());
        let slashes = name.replace('\\', "/");
        add(text::bytes_of(&slashes).into_owned());
        add(percent_decoded(&text::bytes_of(&slashes)).into_owned());
        if text::is_foreign(name) {
            add(text::shown(&slashes).into_bytes());
        }
    }
    all
}

/// `%41` to `A`; what is no valid escape stays as it is, since some exporters do not escape at all.
pub(super) fn percent_decoded(bytes: &[u8]) -> Cow<'_, [u8]> {
    if !bytes.contains(&b'%') {
        return bytes.into();
    }
    let mut out = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        let digits = bytes.get(i + 1..i + 3).filter(|d| bytes[i] == b'%' && d.iter().all(u8::is_ascii_hexdigit));
        let byte = digits.and_then(|d| std::str::from_utf8(d).ok()).and_then(|d| u8::from_str_radix(d, 16).ok());
        out.push(byte.unwrap_or(bytes[i]));
        i += if byte.is_some() { 3 } else { 1 };
    }
    out.into()
}

/// The folders of a failed [`Finder::find`] as words.
pub(super) fn list(searched: &[PathBuf]) -> String {
    searched.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ")
}
