//! Plain lines, tokenised by several threads: positions, texture coordinates, normals and faces in
//! the form that nearly all programs write them. Whatever else a line is, it is left to the parser
//! of lines, which also says what is wrong with a face; so both read the same of a file.

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

/// Bytes of text that a thread tokenises at a time.
const CHUNK: usize = 1 << 18;

/// A corner of a face as the file has it: indices of a position, texture coordinates and a normal,
/// from 1 or from -1 backwards; 0 for none.
pub(super) type RawCorner = [i32; 3];

/// Consecutive lines of one kind, whose values follow one another in the chunk's arrays.
pub(super) enum Run {
    /// This number of lines `v`.
    Positions(usize),
    /// This number of lines `vt`.
    Texcoords(usize),
    /// This number of lines `vn`.
    Normals(usize),
    /// This number of lines `f`.
    Faces(usize),
    /// A line for the parser of lines.
    Other,
}

/// Values of some consecutive lines.
#[derive(Default)]
pub(super) struct Chunk<'a> {
    /// The lines, each with its end.
    pub text: &'a [u8],
    pub runs: Vec<Run>,
    pub positions: Vec<DVec3>,
    /// glTF convention: v down.
    pub texcoords: Vec<Vec2>,
    pub normals: Vec<Vec3>,
    /// Corners of all faces, and their number for each.
    pub corners: Vec<RawCorner>,
    pub sizes: Vec<u32>,
    /// Lines for the parser of lines, as bytes of `text`.
    pub others: Vec<(usize, usize)>,
}

/// Tokenises lines that each end with LF or CR LF, without a backslash or a zero.
pub(super) fn tokenise(text: &[u8]) -> Vec<Chunk<'_>> {
    // chunks of whole lines
    let mut chunks = Vec::new();
    let mut rest = text;
    while !rest.is_empty() {
        let from = CHUNK.min(rest.len() - 1);
        let end = memchr::memchr(b'\n', &rest[from..]).map_or(rest.len(), |at| from + at + 1);
        let (chunk, after) = rest.split_at(end);
        chunks.push(chunk);
        rest = after;
    }
    chunks.into_par_iter().map(Chunk::new).collect()
}

impl<'a> Chunk<'a> {
    fn new(text: &'a [u8]) -> Self {
        let mut chunk = Self { text, ..Self::default() };
        let mut start = 0;
        for end in memchr::memchr_iter(b'\n', text) {
            chunk.line(start, end);
            start = end + 1;
        }
        if start < text.len() {
            chunk.line(start, text.len());
        }
        chunk
    }

    fn line(&mut self, start: usize, end: usize) {
        if self.plain(self.text[start..end].trim_ascii()).is_none() {
            self.others.push((start, end));
            self.runs.push(Run::Other);
        }
    }

    /// Takes a line; `None` for one that is not plain.
    fn plain(&mut self, line: &[u8]) -> Option<()> {
        let key = line.iter().position(u8::is_ascii_whitespace)?;
        let mut words = line[key..].split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());

        // by the first word
        match &line[..key] {
            b"v" => {
                let p = DVec3::from(three::<f64>(&mut words)?);
                // what is beyond is an error, which the parser of lines has words for
                let is_good = p.is_finite() && p.abs().max_element() <= f64::from(f32::MAX);
                (is_good && words.next().is_none()).then(|| self.positions.push(p))?;
                extend(&mut self.runs, |run| if let Run::Positions(n) = run { Some(n) } else { None }, Run::Positions)
            }
            b"vn" => {
                let normal = Vec3::from(three::<f32>(&mut words)?);
                words.next().is_none().then(|| self.normals.push(normal))?;
                extend(&mut self.runs, |run| if let Run::Normals(n) = run { Some(n) } else { None }, Run::Normals)
            }
            b"vt" => {
                let [u, v]: [f32; 2] = [number(words.next()?)?, number(words.next()?)?];
                // a third, which is not used, has to be a number all the same
                let third = words.next().map(number::<f32>);
                let is_good = third.is_none_or(|w| w.is_some()) && words.next().is_none();
                is_good.then(|| self.texcoords.push(Vec2::new(u, 1.0 - v)))?;
                extend(&mut self.runs, |run| if let Run::Texcoords(n) = run { Some(n) } else { None }, Run::Texcoords)
            }
            b"f" => {
                let before = self.corners.len();
                for word in words {
                    match corner(word) {
                        Some(corner) => self.corners.push(corner),
                        None => {
                            self.corners.truncate(before);
                            return None;
                        }
                    }
                }
                let size = self.corners.len() - before;
                if size < 3 {
                    self.corners.truncate(before);
                    return None;
                }
                self.sizes.push(size as u32);
                extend(&mut self.runs, |run| if let Run::Faces(n) = run { Some(n) } else { None }, Run::Faces)
            }
            _ => return None,
        }
        Some(())
    }
}

/// Adds a line to the last run, if that is of its kind, or else begins one.
fn extend(runs: &mut Vec<Run>, count: impl Fn(&mut Run) -> Option<&mut usize>, begin: impl Fn(usize) -> Run) {
    match runs.last_mut().and_then(count) {
        Some(count) => *count += 1,
        None => runs.push(begin(1)),
    }
}

fn number<T: std::str::FromStr>(word: &[u8]) -> Option<T> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

fn three<'a, T: std::str::FromStr>(words: &mut impl Iterator<Item = &'a [u8]>) -> Option<[T; 3]> {
    Some([number(words.next()?)?, number(words.next()?)?, number(words.next()?)?])
}

/// `position[/[texcoord][/normal]]`.
fn corner(word: &[u8]) -> Option<RawCorner> {
    let mut out = [0; 3];
    let mut parts = word.split(|&b| b == b'/');
    for (k, value) in out.iter_mut().enumerate() {
        let Some(part) = parts.next() else { break };
        *value = if part.is_empty() { 0 } else { index(part)? };
        if k == 0 && *value == 0 {
            return None;
        }
    }
    parts.next().is_none().then_some(out)
}

/// An integer of few digits, with a minus sign or none; no other zero than `0`.
fn index(part: &[u8]) -> Option<i32> {
    let (digits, sign) = part.strip_prefix(b"-").map_or((part, 1), |digits| (digits, -1));
    let is_number =
        (1..10).contains(&digits.len()) && digits.iter().all(u8::is_ascii_digit) && (digits[0] != b'0' || part == b"0");
    is_number.then(|| sign * digits.iter().fold(0, |sum, d| 10 * sum + i32::from(d - b'0')))
}
