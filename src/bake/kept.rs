//! Finished parts of a bake in a file beside its output, from which an interrupted one goes on.
//!
//! The file has a header with the fingerprint of the bake, and a record for each batch of rows in
//! the order in which they are sampled. Records hold the exact sums, so that a bake that goes on
//! has the bits of one that was never interrupted.

use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use xxhash_rust::xxh3::xxh3_64;

use super::map::TexelSums;
use crate::error::{Error, Result};

/// First bytes of the file, with the version of its form.
const MAGIC: &[u8; 16] = b"skylit parts  1\n";
/// Bytes of the fingerprint, hexadecimal digits.
const FINGERPRINT: usize = 32;
/// Numbers at the beginning of a record: rows, hidden texels, rays, texels and the hash of it all.
const NUMBERS: usize = 6;
/// Words of a texel's sums, and further words where noise is filtered.
const SUMS: usize = 9;
const SURFACE: usize = 9;

/// The sums of a batch of rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part {
    /// The texels that have samples, by their index in the texture.
    pub texels: Vec<(usize, TexelSums)>,
    /// Texels inside of other geometry.
    pub hidden: usize,
    /// Rays that were traced for it.
    pub rays: u64,
}

/// The file of finished parts, which is read until it ends and then continued.
pub struct KeptParts {
    path: PathBuf,
    file: File,
    /// Noise is filtered, so that texels have a position and a normal.
    has_surfaces: bool,
    /// Where the next record begins; `None` once all records have been read.
    next: Option<u64>,
    /// Parts that were read or added.
    count: usize,
}

impl KeptParts {
    /// Opens the file of a bake, or makes one. `fingerprint`: 32 characters that stand for all that
    /// values depend on; `has_surfaces`: whether noise is filtered.
    ///
    /// # Errors
    /// [`Error::Input`] for a damaged file, [`Error::Usage`] for one of another bake, and
    /// [`Error::Output`].
    pub fn open(path: &Path, fingerprint: &str, has_surfaces: bool) -> Result<Self> {
        let failed = |e: std::io::Error| Error::Output { path: path.to_owned(), message: e.to_string() };
        let options = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
        let mut file = options.map_err(failed)?;
        let mut header = Vec::new();
        let length = (MAGIC.len() + FINGERPRINT) as u64;
        (&mut file).take(length).read_to_end(&mut header).map_err(failed)?;
        let whole = [&MAGIC[..], fingerprint.as_bytes()].concat();

        // a file that was just made
        if header.is_empty() {
            file.write_all(&whole).map_err(failed)?;
            return Ok(Self { path: path.to_owned(), file, has_surfaces, next: None, count: 0 });
        }

        // one that is there must be of this bake
        if !header.starts_with(MAGIC) || header.len() != whole.len() {
            return Err(Error::input(path, "is no file of a bake under way: delete it, or choose another output"));
        }
        if header != whole {
            return Err(Error::Usage(format!(
                "--resumable: {} is of another bake, whose scene, options, device or version differ: delete it to \
                 begin anew, or give what it was begun with",
                path.display()
            )));
        }
        Ok(Self { path: path.to_owned(), file, has_surfaces, next: Some(length), count: 0 })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns true if the file had parts when it was opened, not all of which have been read.
    pub fn is_continued(&self) -> bool {
        self.next.is_some()
    }

    /// The next part, which must be of these texels; `None` once all have been read.
    ///
    /// # Errors
    /// [`Error::Input`] where the file is damaged.
    pub fn next(&mut self, rows: &Range<usize>) -> Result<Option<Part>> {
        let Some(at) = self.next else { return Ok(None) };
        match self.read(rows)? {
            Some((part, length)) => {
                self.next = Some(at + length);
                self.count += 1;
                Ok(Some(part))
            }
            // what an interruption left of the last record is written again
            None => {
                let cut = self.file.set_len(at).and_then(|()| self.file.seek(SeekFrom::Start(at)));
                cut.map_err(|e| Error::Output { path: self.path.clone(), message: e.to_string() })?;
                self.next = None;
                Ok(None)
            }
        }
    }

    /// Reads a record and its length, bytes; `None` where the file ends before it does.
    fn read(&mut self, rows: &Range<usize>) -> Result<Option<(Part, u64)>> {
        let path = self.path.clone();
        let damaged = || Error::input(&path, "is damaged: delete it to begin anew");
        let file = &self.file;
        let bytes = |count: usize| -> Result<Option<Vec<u8>>> {
            let mut bytes = Vec::new();
            file.take(count as u64).read_to_end(&mut bytes).map_err(|e| Error::read(&path, &e))?;
            Ok((bytes.len() == count).then_some(bytes))
        };

        // as many texels as there are, with their hash
        let Some(head) = bytes(8 * NUMBERS)? else { return Ok(None) };
        let numbers: Vec<u64> = head.as_chunks().0.iter().map(|b| u64::from_le_bytes(*b)).collect();
        let &[start, end, hidden, rays, count, hash] = &numbers[..] else { return Err(damaged()) };
        if (start, end) != (rows.start as u64, rows.end as u64) || count > rows.len() as u64 {
            return Err(damaged());
        }
        let words = self.words_of_texel();
        let Some(body) = bytes(4 * words * count as usize)? else { return Ok(None) };
        if hash_of(&head[..8 * (NUMBERS - 1)], &body) != hash {
            return Err(damaged());
        }

        // the texels
        let all: Vec<u32> = body.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
        let texels: Vec<(usize, TexelSums)> = all.chunks_exact(words).map(texel_of_words).collect();
        if !texels.iter().all(|(at, _)| rows.contains(at)) {
            return Err(damaged());
        }
        let length = (head.len() + body.len()) as u64;
        Ok(Some((Part { texels, hidden: hidden as usize, rays }, length)))
    }

    /// Appends a part.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn add(&mut self, rows: &Range<usize>, part: &Part) -> Result<()> {
        let words = self.words_of_texel();
        let mut body = Vec::with_capacity(4 * words * part.texels.len());
        for (at, sums) in &part.texels {
            let all = words_of_texel(*at, sums);
            body.extend(all[..words].iter().flat_map(|word| word.to_le_bytes()));
        }
        let numbers = [rows.start as u64, rows.end as u64, part.hidden as u64, part.rays, part.texels.len() as u64];
        let mut record: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
        let hash = hash_of(&record, &body);
        record.extend(hash.to_le_bytes());
        record.append(&mut body);
        let failed = |e| Error::Output { path: self.path.clone(), message: format!("no part can be kept: {e}") };
        self.file.write_all(&record).map_err(failed)?;
        self.count += 1;
        Ok(())
    }

    /// The error of the bake, which says after an interruption that the same command goes on.
    pub fn explain(&self, error: Error) -> Error {
        let parts = match (error, self.count) {
            (Error::Interrupted, 1) => "the finished part".to_owned(),
            (Error::Interrupted, count @ 2..) => format!("the {count} finished parts"),
            (error, _) => return error,
        };
        Error::Paused(format!("the same command goes on with {parts} in {}", self.path.display()))
    }

    /// Removes the file, once the output is written.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn remove(self) -> Result<()> {
        drop(self.file);
        std::fs::remove_file(&self.path).map_err(|e| Error::Output { path: self.path, message: e.to_string() })
    }

    fn words_of_texel(&self) -> usize {
        if self.has_surfaces { SUMS + SURFACE } else { SUMS }
    }
}

/// The hash of a record's numbers and texels.
fn hash_of(numbers: &[u8], body: &[u8]) -> u64 {
    xxh3_64(body) ^ xxh3_64(numbers).rotate_left(1)
}

/// Words of a texel: its index, the sums, and its position and normal.
fn words_of_texel(at: usize, sums: &TexelSums) -> [u32; SUMS + SURFACE] {
    let halves = |value: f64| [value.to_bits() as u32, (value.to_bits() >> 32) as u32];
    let [x, y, z] = sums.value.to_array().map(f32::to_bits);
    let [[s0, s1], [q0, q1]] = [sums.scalar, sums.squares].map(halves);
    let [[px0, px1], [py0, py1], [pz0, pz1]] = sums.position.to_array().map(halves);
    let [nx, ny, nz] = sums.normal.to_array().map(f32::to_bits);
    [at as u32, x, y, z, s0, s1, q0, q1, sums.samples, px0, px1, py0, py1, pz0, pz1, nx, ny, nz]
}

/// The texel of [`words_of_texel`]; no position and normal where those are left out.
fn texel_of_words(words: &[u32]) -> (usize, TexelSums) {
    let word = |k: usize| words.get(k).copied().unwrap_or_default();
    let double = |k: usize| f64::from_bits(u64::from(word(k)) | u64::from(word(k + 1)) << 32);
    let vector = |k: usize| Vec3::from([0, 1, 2].map(|i| f32::from_bits(word(k + i))));
    let sums = TexelSums {
        value: vector(1),
        scalar: double(4),
        squares: double(6),
        samples: word(8),
        position: DVec3::from([0, 2, 4].map(|i| double(SUMS + i))),
        normal: vector(SUMS + 6),
    };
    (word(0) as usize, sums)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FINGERPRINTS: [&str; 2] = ["0123456789abcdef0123456789abcdef", "1123456789abcdef0123456789abcdef"];

    fn part(first: usize, count: usize) -> Part {
        let sums = |at: usize| TexelSums {
            value: Vec3::new(at as f32, 0.1, -0.2),
            scalar: 0.1 * at as f64,
            squares: 1e-300,
            samples: 64,
            position: DVec3::new(1e9 + 0.1, 2.0, -3.0),
            normal: Vec3::Y,
        };
        Part { texels: (first..first + count).map(|at| (at, sums(at))).collect(), hidden: count, rays: 1 << 40 }
    }

    #[test]
    fn parts_come_back_and_an_unfinished_one_is_made_again() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.parts");
        let parts = [(0..100, part(3, 7)), (100..200, part(100, 100)), (200..210, part(200, 0))];
        let mut kept = KeptParts::open(&path, FINGERPRINTS[0], true).unwrap();
        assert!(!kept.is_continued());
        for (rows, part) in &parts[..2] {
            assert_eq!(kept.next(rows).unwrap(), None);
            kept.add(rows, part).unwrap();
        }
        drop(kept);

        // the last byte is missing: that part is none, and follows again
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
        let mut kept = KeptParts::open(&path, FINGERPRINTS[0], true).unwrap();
        assert!(kept.is_continued());
        assert_eq!(kept.next(&parts[0].0).unwrap().as_ref(), Some(&parts[0].1));
        assert_eq!(kept.next(&parts[1].0).unwrap(), None);
        parts[1..].iter().for_each(|(rows, part)| kept.add(rows, part).unwrap());
        drop(kept);
        let mut kept = KeptParts::open(&path, FINGERPRINTS[0], true).unwrap();
        for (rows, part) in &parts {
            assert_eq!(kept.next(rows).unwrap().as_ref(), Some(part));
        }
        assert_eq!(kept.next(&(0..1)).unwrap(), None);
        kept.remove().unwrap();
        assert!(!path.exists());
    }

    #[test]
    fn damaged_and_foreign_files_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.parts");
        let mut kept = KeptParts::open(&path, FINGERPRINTS[0], false).unwrap();
        kept.add(&(0..9), &part(0, 9)).unwrap();
        drop(kept);
        let open = |fingerprint: &str| KeptParts::open(&path, fingerprint, false);
        let text = |e: Error| e.to_string();
        assert!(text(open(FINGERPRINTS[1]).err().unwrap()).contains("is of another bake"));

        // each byte counts, and so do the rows and what lies in them
        let bytes = std::fs::read(&path).unwrap();
        let whole = open(FINGERPRINTS[0]).unwrap().next(&(0..9)).unwrap().unwrap();
        assert_eq!((whole.texels.len(), whole.texels[8].1.normal), (9, Vec3::ZERO));
        assert!(text(open(FINGERPRINTS[0]).unwrap().next(&(0..10)).unwrap_err()).contains("is damaged"));
        for at in (48..bytes.len()).step_by(5) {
            let mut changed = bytes.clone();
            changed[at] ^= 0x10;
            std::fs::write(&path, changed).unwrap();
            let error = open(FINGERPRINTS[0]).unwrap().next(&(0..9)).unwrap_err();
            assert!(text(error).contains("is damaged: delete it"), "{at}");
        }
        std::fs::write(&path, &bytes[..48]).unwrap();
        let mut kept = open(FINGERPRINTS[0]).unwrap();
        assert_eq!(kept.next(&(0..9)).unwrap(), None);
        kept.add(&(0..9), &part(7, 9)).unwrap();
        drop(kept);
        assert!(text(open(FINGERPRINTS[0]).unwrap().next(&(0..9)).unwrap_err()).contains("is damaged"));
        std::fs::write(&path, "something else").unwrap();
        assert!(text(open(FINGERPRINTS[0]).err().unwrap()).contains("is no file of a bake under way"));
    }
}
