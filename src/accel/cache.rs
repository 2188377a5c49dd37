//! On-disk cache of built hierarchies: named byte arrays under a 128-bit hash of everything they
//! were built from.
//!
//! The cache never fails a command. A damaged file (its header has its length and a checksum) is
//! ignored with a warning and rewritten; a file that cannot be written (a full disk, a folder that
//! may not be written) is a warning. Files are written beside and renamed, so several writers may
//! race: each file is complete, and all files of one key are identical.
//!
//! XXH3 (`xxhash-rust`) makes keys and checksums: some ten GB a second, where a cryptographic hash
//! would take as long as the build that it saves. A checksum tells damage, not malice: files of
//! other users are not read, and whoever loads a hierarchy checks it against the geometry that it
//! is for (`tracer::wide`).

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use xxhash_rust::xxh3::{Xxh3, xxh3_128};

use crate::error::Result;
use crate::files;

/// First bytes of every file; the last is the version of the container.
const MAGIC: [u8; 8] = *b"skyhier\x01";
/// Magic, length of the file, checksum of what follows the head.
const HEAD: usize = 8 + 8 + 16;
/// Maximum length of an array's name, bytes.
const MAX_NAME: usize = 255;

/// Builds the key of a hierarchy. Add everything that the result depends on, the version of the
/// layout included.
#[derive(Clone, Default)]
pub struct KeyBuilder(Xxh3);

/// Key of a cached hierarchy; see [`KeyBuilder`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Key(u128);

impl KeyBuilder {
    /// Adds bytes and their length, so that consecutive additions cannot be confused.
    pub fn with(mut self, bytes: &[u8]) -> Self {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
        self
    }

    /// The key of all that was added.
    pub fn finish(self) -> Key {
        Key(self.0.digest128())
    }
}

/// Arrays read from a file.
#[derive(Debug, Default)]
pub struct Entries {
    bytes: Vec<u8>,
    /// Name and byte range of each array.
    ranges: Vec<(String, std::ops::Range<usize>)>,
}

impl Entries {
    /// The array of a name as values of type `T`. `None` if it does not exist, or if its length is
    /// not a multiple of the size of `T`.
    pub fn get<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(&self, name: &str) -> Option<Vec<T>> {
        let (_, range) = self.ranges.iter().find(|(n, _)| n == name)?;
        let bytes = &self.bytes[range.clone()];
        let mut out = vec![T::zeroed(); bytes.len() / size_of::<T>()];
        (bytes.len().is_multiple_of(size_of::<T>())).then(|| {
            bytemuck::cast_slice_mut(&mut out).copy_from_slice(bytes);
            out
        })
    }
}

/// A folder of built hierarchies.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: PathBuf,
    /// Warnings not yet taken.
    warnings: Arc<Mutex<Vec<String>>>,
}

impl Cache {
    /// The cache in a folder, which need not exist yet.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into(), warnings: Default::default() }
    }

    /// Takes the warnings since the last call, one line each.
    pub fn take_warnings(&self) -> Vec<String> {
        std::mem::take(&mut self.warnings.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn warn(&self, text: String) {
        self.warnings.lock().unwrap_or_else(PoisonError::into_inner).push(text);
    }

    /// The file of a key.
    pub fn path(&self, key: Key) -> PathBuf {
        self.folder.join(format!("{:032x}.skyhier", key.0))
    }

    /// Loads the arrays of a key; `None` if it is not cached or the file is damaged.
    pub fn load(&self, key: Key) -> Option<Entries> {
        let path = self.path(key);
        let bytes = match read_own(&path) {
            Ok(Some(b)) => b,
            Ok(None) => {
                self.warn(format!("{}: not a file of this user; rebuilding the hierarchy", path.display()));
                return None;
            }
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return None,
            Err(e) => {
                self.warn(format!("{}: cannot read ({e}); rebuilding the hierarchy", path.display()));
                return None;
            }
        };
        let entries = parse(bytes);
        if entries.is_none() {
            self.warn(format!("{}: damaged or of another version; rebuilding the hierarchy", path.display()));
        }
        entries
    }

    /// Says that what was loaded for a key is not what it should be, and what is wrong with it.
    pub fn reject(&self, key: Key, defect: &str) {
        self.warn(format!(
            "{}: not the hierarchy of this geometry ({defect}); rebuilding it",
            self.path(key).display()
        ));
    }

    /// Stores arrays under a key, replacing an existing file. A failure becomes a warning.
    pub fn store(&self, key: Key, arrays: &[(&str, &[u8])]) {
        let path = self.path(key);
        if let Err(e) = self.try_store(&path, arrays) {
            self.warn(format!("the hierarchy was not cached: {e}"));
        }
    }

    fn try_store(&self, path: &Path, arrays: &[(&str, &[u8])]) -> Result<()> {
        let failed = |e: std::io::Error| crate::Error::write(&self.folder, &e);
        std::fs::create_dir_all(&self.folder).map_err(failed)?;
        let mut table = (arrays.len() as u64).to_le_bytes().to_vec();
        for (name, bytes) in arrays {
            assert!(name.len() <= MAX_NAME, "{name} is too long a name");
            table.push(name.len() as u8);
            table.extend(name.as_bytes());
            table.extend((bytes.len() as u64).to_le_bytes());
        }
        let mut hash = Xxh3::new();
        let parts = || std::iter::once(table.as_slice()).chain(arrays.iter().map(|a| a.1));
        parts().for_each(|p| hash.update(p));
        let length = HEAD + parts().map(<[u8]>::len).sum::<usize>();
        files::write_atomically(path, |file| {
            file.write_all(&MAGIC)?;
            file.write_all(&(length as u64).to_le_bytes())?;
            file.write_all(&hash.digest128().to_le_bytes())?;
            parts().try_for_each(|p| file.write_all(p))
        })
    }
}

/// Bytes of a regular file that belongs to this process's user or to root; `None` for another.
fn read_own(path: &Path) -> std::io::Result<Option<Vec<u8>>> {
    let mut file = files::open_regular(path)?;
    if !files::is_owned(&file.metadata()?) {
        return Ok(None);
    }
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    Ok(Some(bytes))
}

/// Parses a cache file; `None` if it is damaged.
fn parse(bytes: Vec<u8>) -> Option<Entries> {
    let (head, body) = bytes.split_at_checked(HEAD)?;
    let word = |at: usize| u64::from_le_bytes(head[at..at + 8].try_into().expect("eight bytes"));
    let sum = u128::from_le_bytes(head[16..32].try_into().expect("sixteen bytes"));
    if head[..8] != MAGIC || word(8) != bytes.len() as u64 || sum != xxh3_128(body) {
        return None;
    }
    // the checksum holds; what follows still trusts no number in it
    let mut rest = body;
    let mut take = |n: usize| {
        let (taken, left) = rest.split_at_checked(n)?;
        rest = left;
        Some(taken)
    };
    let number = |b: &[u8]| Some(u64::from_le_bytes(b.try_into().ok()?));
    let count = number(take(8)?)?;
    let mut table = Vec::new();
    let mut used = 8;
    for _ in 0..count {
        let length = take(1)?[0] as usize;
        let name = String::from_utf8(take(length)?.to_vec()).ok()?;
        let size = usize::try_from(number(take(8)?)?).ok()?;
        used += 1 + length + 8;
        table.push((name, size));
    }
    let mut at = HEAD + used;
    let mut ranges = Vec::new();
    for (name, size) in table {
        let end = at.checked_add(size).filter(|&e| e <= bytes.len())?;
        ranges.push((name, at..end));
        at = end;
    }
    (at == bytes.len()).then_some(Entries { bytes, ranges })
}

#[cfg(test)]
mod tests {
    use super::*;

    const NODES: [[u32; 3]; 3] = [[1, 2, 3], [4, 5, 6], [7, 8, u32::MAX]];

    fn stored(cache: &Cache, key: Key) {
        cache.store(key, &[("nodes", bytemuck::cast_slice(&NODES)), ("empty", &[]), ("odd", &[9, 8, 7])]);
    }

    fn key(text: &str) -> Key {
        KeyBuilder::default().with(text.as_bytes()).finish()
    }

    #[test]
    fn what_is_stored_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(folder.path().join("not/there/yet"));
        assert!(cache.load(key("a")).is_none());
        stored(&cache, key("a"));
        let entries = cache.load(key("a")).unwrap();
        assert_eq!(entries.get::<[u32; 3]>("nodes").unwrap(), NODES);
        assert_eq!(entries.get::<u32>("empty").unwrap(), Vec::<u32>::new());
        assert_eq!(entries.get::<u8>("odd").unwrap(), [9, 8, 7]);
        assert_eq!(entries.get::<u16>("odd"), None);
        assert_eq!(entries.get::<u8>("other"), None);
        assert!(cache.load(key("b")).is_none());
    }

    #[test]
    fn parts_of_a_key_do_not_run_together() {
        let key = |parts: &[&str]| parts.iter().fold(KeyBuilder::default(), |k, p| k.with(p.as_bytes())).finish();
        assert_ne!(key(&["ab", "c"]), key(&["a", "bc"]));
        assert_ne!(key(&["ab"]), key(&["ab", ""]));
        assert_eq!(key(&["ab", "c"]), key(&["ab", "c"]));
    }

    /// Cut short at any length, or with any one bit turned, a file is not read; and it is replaced
    /// by the next to store.
    #[test]
    fn damage_is_seen_and_mended() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(folder.path());
        stored(&cache, key("a"));
        let path = cache.path(key("a"));
        let good = std::fs::read(&path).unwrap();
        for length in 0..good.len() {
            std::fs::write(&path, &good[..length]).unwrap();
            assert!(cache.load(key("a")).is_none(), "cut to {length}");
        }
        for bit in 0..good.len() * 8 {
            let mut bad = good.clone();
            bad[bit / 8] ^= 1 << (bit % 8);
            assert!(parse(bad).is_none(), "bit {bit}");
        }
        let longer = [good.clone(), vec![0]].concat();
        assert!(parse(longer).is_none());
        stored(&cache, key("a"));
        assert!(cache.load(key("a")).is_some());
    }

    /// A head that fits a body full of nonsense numbers.
    #[test]
    fn a_well_signed_table_is_not_trusted() {
        for body in [
            vec![0xff; 8],
            [1u64.to_le_bytes().to_vec(), vec![1, b'x'], u64::MAX.to_le_bytes().to_vec()].concat(),
            vec![],
        ] {
            let length = (HEAD + body.len()) as u64;
            let sum = xxh3_128(&body).to_le_bytes();
            assert!(parse([&MAGIC[..], &length.to_le_bytes(), &sum, &body].concat()).is_none(), "{body:?}");
        }
    }

    #[test]
    fn writers_may_race_with_readers() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(folder.path());
        stored(&cache, key("a"));
        std::thread::scope(|s| {
            for _ in 0..4 {
                s.spawn(|| (0..50).for_each(|_| stored(&cache, key("a"))));
            }
            for _ in 0..200 {
                assert_eq!(cache.load(key("a")).unwrap().get::<[u32; 3]>("nodes").unwrap(), NODES);
            }
        });
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside");
    }

    /// Where no file can be written (here the folder is a file) there is a warning, and nothing
    /// else.
    #[test]
    fn a_folder_that_cannot_be_is_no_error() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, b"x").unwrap();
        let cache = Cache::new(&file);
        stored(&cache, key("a"));
        assert!(matches!(&cache.take_warnings()[..], [one] if one.contains("not cached")));
        assert!(cache.load(key("a")).is_none());
        assert_eq!(std::fs::read(&file).unwrap(), b"x");
    }
}
