//! The statements of an OBJ file.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;
use std::str::SplitAsciiWhitespace;

use glam::{DVec3, Vec2, Vec3, Vec4};

use super::plain::{self, Chunk, RawCorner, Run};
use super::polygon::{self, PolygonTriangulator};
use crate::error::{Error, Result};
use crate::memory::Budget;
use crate::scene::load::text::{self, Lines, PlainLines, trim};
use crate::stage;

/// Statements of the format about what is not shown: points, lines, free-form curves and surfaces,
/// and how others display the file.
const UNUSED: [&str; 35] = [
    "bevel",
    "bmat",
    "bsp",
    "bzp",
    "c_interp",
    "call",
    "cdc",
    "cdp",
    "con",
    "csh",
    "cstype",
    "ctech",
    "curv",
    "curv2",
    "d_interp",
    "deg",
    "end",
    "hole",
    "l",
    "lod",
    "maplib",
    "mg",
    "p",
    "parm",
    "res",
    "scrv",
    "shadow_obj",
    "sp",
    "stech",
    "step",
    "surf",
    "trace_obj",
    "trim",
    "usemap",
    "vp",
];

/// Distinct unknown words that are kept for a warning; a file of another kind has any number.
const MAX_UNKNOWN: usize = 4;

/// Bytes of text that threads share.
const BLOCK: usize = 1 << 24;

/// No such index.
pub(super) const NONE: u32 = u32::MAX;

/// A corner of a face: indices into the arrays of the file. Positions always exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Corner {
    pub position: u32,
    pub texcoord: u32,
    pub normal: u32,
}

/// Consecutive faces with one name, one object and one material. Names are texts of [`text`].
#[derive(Debug)]
pub(super) struct Group {
    /// Name by `o` or `g`, whichever came last.
    pub name: String,
    /// Name by the last `o`; empty without one.
    pub object: String,
    pub material: Option<String>,
    pub triangles: Vec<[Corner; 3]>,
    /// Where a smoothing group begins: index of a triangle, and the group's number; 0 for none, and
    /// before the first.
    pub smoothing: Vec<(u32, u32)>,
}

/// A whole file.
#[derive(Debug, Default)]
pub(super) struct ObjFile {
    /// In double precision: how far the model is from its origin is not known yet.
    pub positions: Vec<DVec3>,
    /// Empty, or as long as `positions` from the last coloured vertex back.
    pub colors: Vec<Vec4>,
    /// glTF convention: v down.
    pub texcoords: Vec<Vec2>,
    pub normals: Vec<Vec3>,
    pub libraries: Vec<String>,
    pub groups: Vec<Group>,
    /// Faces of fewer than three corners, which are left out.
    pub open_faces: usize,
    /// Number of polygons of more corners than are cut.
    pub large_polygons: usize,
    /// Numbers with a decimal comma.
    pub decimal_commas: usize,
    /// How often the file has each of the [`UNUSED`] statements that it has.
    pub unused: BTreeMap<&'static str, usize>,
    /// Words that are no statement of the format, each with the number of its first line, and how
    /// many lines begin with such a word.
    pub unknown: (Vec<(String, usize)>, usize),
}

/// Parses a file; errors name the line.
pub(super) fn parse(path: &Path, budget: &Budget) -> Result<ObjFile> {
    let unread = |e: std::io::Error| Error::read(path, &e);
    let file = crate::files::open_regular(path).map_err(unread)?;
    let bytes = file.metadata().map_err(unread)?.len();
    budget.read(usize::try_from(bytes).unwrap_or(usize::MAX));
    let _stage = stage::begin_counted("reading the file", bytes);
    let mut lines = Lines::new(file).map_err(unread)?;
    parse_lines(&mut lines, Some(BLOCK)).map_err(|failed| match failed {
        Failure::Read(e) => unread(e),
        Failure::Line(number, e) => Error::input(path, format!("line {number}: {}", text::shown(&e))),
    })
}

/// Why a file is not parsed.
#[derive(Debug)]
enum Failure {
    Read(std::io::Error),
    /// Number of the line, and what is wrong with it.
    Line(usize, String),
}

impl From<std::io::Error> for Failure {
    fn from(e: std::io::Error) -> Self {
        Self::Read(e)
    }
}

/// Parses lines. `block`: bytes of text that threads share; `None`: one line after the other.
fn parse_lines<R: Read>(lines: &mut Lines<R>, block: Option<usize>) -> Result<ObjFile, Failure> {
    let mut parser = Parser::default();
    loop {
        while let Some(size) = block
            && let Some(PlainLines { text, before }) = lines.plain(size)?
        {
            stage::advance(text.len() as u64);
            parser.block(text, before).map_err(|(number, e)| Failure::Line(number, e))?;
        }
        let failed = match lines.next()? {
            Some(line) => parser.line(&line).err(),
            None => return Ok(parser.file),
        };
        if let Some(word) = parser.unknown.take() {
            parser.file.unknown.0.push((word, lines.number));
        }
        if let Some(e) = failed {
            return Err(Failure::Line(lines.number, e));
        }
    }
}

#[derive(Default)]
struct Parser {
    file: ObjFile,
    name: String,
    object: String,
    material: Option<String>,
    /// Whether name or material changed since the last face.
    changed: bool,
    /// A word of the last line that is no statement, to be kept with the line's number.
    unknown: Option<String>,
    /// Number of the smoothing group; 0: flat.
    smoothing: u32,
    polygon: Vec<Corner>,
    cutter: PolygonTriangulator,
}

impl Parser {
    fn line(&mut self, line: &str) -> Result<(), String> {
        let line = trim(line);
        let (key, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
        let rest = trim(rest);

        // by the first word
        match key {
            "v" => self.vertex(rest),
            "vt" => {
                // v is often left out by one-dimensional textures
                let [u, v, _]: [f32; 3] = self.floats(&mut words(rest), 1)?;
                self.file.texcoords.push(Vec2::new(u, 1.0 - v));
                Ok(())
            }
            "vn" => {
                let normal: [f32; 3] = self.floats(&mut words(rest), 3)?;
                self.file.normals.push(normal.into());
                Ok(())
            }
            "f" | "fo" => self.face(rest),
            "o" | "g" => {
                rest.clone_into(&mut self.name);
                if key == "o" {
                    rest.clone_into(&mut self.object);
                }
                self.changed = true;
                Ok(())
            }
            "s" => {
                self.smoothing = smoothing_group(rest);
                Ok(())
            }
            "usemtl" => {
                self.material = (!rest.is_empty()).then(|| rest.to_owned());
                self.changed = true;
                Ok(())
            }
            "mtllib" => {
                self.file.libraries.push(rest.to_owned());
                Ok(())
            }
            _ => {
                self.skip(key);
                Ok(())
            }
        }
    }

    /// Parses plain lines; `before`: number of the last line before them. An error has the number
    /// of its line.
    fn block(&mut self, text: &[u8], before: usize) -> Result<(), (usize, String)> {
        let mut number = before;
        for chunk in plain::tokenise(text) {
            self.chunk(&chunk, &mut number)?;
        }
        Ok(())
    }

    /// Takes what a chunk of lines says; `number`: of the last line before it, and then of its own
    /// last.
    fn chunk(&mut self, chunk: &Chunk, number: &mut usize) -> Result<(), (usize, String)> {
        // what of each array is left
        let before = *number;
        let (mut positions, mut texcoords, mut normals) =
            (&chunk.positions[..], &chunk.texcoords[..], &chunk.normals[..]);
        let (mut corners, mut sizes, mut others) = (&chunk.corners[..], chunk.sizes.iter(), chunk.others.iter());

        // runs in the order of the file
        for run in &chunk.runs {
            match *run {
                Run::Positions(count) => take(&mut self.file.positions, &mut positions, count, number),
                Run::Texcoords(count) => take(&mut self.file.texcoords, &mut texcoords, count, number),
                Run::Normals(count) => take(&mut self.file.normals, &mut normals, count, number),
                Run::Faces(count) => {
                    for size in sizes.by_ref().take(count) {
                        *number += 1;
                        let (face, rest) = corners.split_at(*size as usize);
                        corners = rest;
                        if self.resolve(face) {
                            self.add_polygon();
                        } else {
                            // the line says what is wrong
                            let line = chunk.text.split(|&b| b == b'\n').nth(*number - before - 1);
                            let line = text::from_bytes(line.unwrap_or_default());
                            self.line(&line).map_err(|e| (*number, e))?;
                        }
                    }
                }
                Run::Other => {
                    *number += 1;
                    let Some(&(start, end)) = others.next() else { continue };
                    let outcome = self.line(&text::from_bytes(&chunk.text[start..end]));
                    if let Some(word) = self.unknown.take() {
                        self.file.unknown.0.push((word, *number));
                    }
                    outcome.map_err(|e| (*number, e))?;
                }
            }
        }
        Ok(())
    }

    /// Makes the polygon of a face's corners; false if one of them does not exist.
    fn resolve(&mut self, face: &[RawCorner]) -> bool {
        self.polygon.clear();
        for corner in face {
            let Some(corner) = self.resolved(*corner) else { return false };
            self.polygon.push(corner);
        }
        true
    }

    /// A corner as an index into the arrays so far; `None` if there is no such element.
    fn resolved(&self, [position, texcoord, normal]: RawCorner) -> Option<Corner> {
        let index = |i: i32, count: usize| {
            let resolved = if i < 0 { i64::from(i) + count as i64 } else { i64::from(i) - 1 };
            (0..count as i64).contains(&resolved).then_some(resolved as u32)
        };
        let or_none = |i: i32, count: usize| if i == 0 { Some(NONE) } else { index(i, count) };
        Some(Corner {
            position: index(position, self.file.positions.len())?,
            texcoord: or_none(texcoord, self.file.texcoords.len())?,
            normal: or_none(normal, self.file.normals.len())?,
        })
    }

    /// Notes a statement that is not used.
    fn skip(&mut self, key: &str) {
        if key.is_empty() || key.starts_with('#') {
            return;
        }
        if let Some(known) = UNUSED.iter().find(|k| **k == key) {
            *self.file.unused.entry(known).or_default() += 1;
            return;
        }
        let (words, count) = &mut self.file.unknown;
        *count += 1;
        if words.len() < MAX_UNKNOWN && words.iter().all(|(word, _)| word != key) {
            self.unknown = Some(key.chars().take(40).collect());
        }
    }

    fn vertex(&mut self, rest: &str) -> Result<(), String> {
        let mut words = words(rest);
        let p: [f64; 3] = self.floats(&mut words, 3)?;
        let p = DVec3::from(p);
        // false for NaN, too
        if !(p.abs().max_element() <= f64::from(f32::MAX) && p.is_finite()) {
            return Err(format!("the vertex position `{rest}` is not finite: repair the model and export it again"));
        }
        self.file.positions.push(p);
        // x y z w has a weight for curves, which says nothing here; x y z r g b has a colour
        let more = words.clone().take_while(|w| !w.starts_with('#')).count();
        if more == 3 {
            let c: [f32; 3] = self.floats(&mut words, 3)?;
            self.file.colors.resize(self.file.positions.len() - 1, Vec4::ONE);
            self.file.colors.push(Vec3::from(c).extend(1.0));
        }
        Ok(())
    }

    /// Up to three numbers, of which the first `needed` must be there; the others are zero if
    /// missing.
    fn floats<T: Number>(&mut self, words: &mut SplitAsciiWhitespace, needed: usize) -> Result<[T; 3], String> {
        let mut out = [T::default(); 3];
        for (i, value) in out.iter_mut().enumerate() {
            match words.clone().next() {
                Some(word) if i < needed || !word.starts_with('#') => {
                    words.next();
                    *value = match word.parse() {
                        Ok(value) => value,
                        Err(_) => {
                            let value = float(word).ok_or_else(|| format!("`{word}` is not a number"))?;
                            self.file.decimal_commas += usize::from(word.contains(','));
                            T::rounded(value)
                        }
                    };
                }
                _ if i < needed => return Err(format!("{needed} numbers are needed, {i} found")),
                _ => break,
            }
        }
        Ok(out)
    }

    fn face(&mut self, rest: &str) -> Result<(), String> {
        self.polygon.clear();
        for word in words(rest).take_while(|w| !w.starts_with('#')) {
            let corner = self.corner(word)?;
            self.polygon.push(corner);
        }
        self.add_polygon();
        Ok(())
    }

    /// Adds the triangles of the polygon to the group that it belongs to.
    fn add_polygon(&mut self) {
        let [first, _, _, ..] = self.polygon[..] else {
            // lines and points that a converter left over: they have no area
            self.file.open_faces += 1;
            return;
        };
        if self.changed || self.file.groups.is_empty() {
            self.changed = false;
            let [name, object] = [&self.name, &self.object];
            let is_same = |g: &Group| g.name == *name && g.object == *object && g.material == self.material;
            if !self.file.groups.last().is_some_and(is_same) {
                let (name, object, material) = (name.clone(), object.clone(), self.material.clone());
                self.file.groups.push(Group { name, object, material, triangles: Vec::new(), smoothing: Vec::new() });
            }
        }
        if let Some(group) = self.file.groups.last_mut() {
            if group.smoothing.last().map_or(0, |s| s.1) != self.smoothing {
                group.smoothing.push((group.triangles.len() as u32, self.smoothing));
            }
            if let [a, b, c] = self.polygon[..] {
                group.triangles.push([a, b, c]);
                return;
            }
            self.file.large_polygons += usize::from(self.polygon.len() > polygon::MAX_CORNERS);
            let (polygon, positions) = (&self.polygon, &self.file.positions);
            match self.cutter.cut(polygon.iter().map(|c| positions[c.position as usize])) {
                Some(triangles) => group.triangles.extend(triangles.map(|t| t.map(|i| polygon[i]))),
                None => group.triangles.extend(polygon[1..].windows(2).map(|w| [first, w[0], w[1]])),
            }
        }
    }

    /// `position[/[texcoord][/normal]]`: from 1, or from -1 backwards.
    fn corner(&self, word: &str) -> Result<Corner, String> {
        let mut parts = word.split('/');
        let mut index = |what: &str, count: usize| -> Result<u32, String> {
            let part = parts.next().unwrap_or("");
            // 0 is how some write that there is none
            if part.is_empty() || part == "0" && what != "vertex" {
                return Ok(NONE);
            }
            let i: i64 = part.parse().map_err(|_| format!("`{word}` is not a corner of a face"))?;
            let count = count as i64;
            let resolved = if i < 0 { i.checked_add(count) } else { i.checked_sub(1) };
            match resolved.filter(|r| (0..count).contains(r)).and_then(|r| u32::try_from(r).ok()).filter(|&r| r != NONE)
            {
                Some(r) => Ok(r),
                None => Err(format!("the face refers to {what} {i}, but there are {count} so far")),
            }
        };
        let corner = Corner {
            position: index("vertex", self.file.positions.len())?,
            texcoord: index("texture coordinate", self.file.texcoords.len())?,
            normal: index("normal", self.file.normals.len())?,
        };
        if corner.position == NONE {
            return Err(format!("`{word}` is not a corner of a face"));
        }
        Ok(corner)
    }
}

/// Moves the first of some values to the end of a list, a line each.
fn take<T: Copy>(list: &mut Vec<T>, values: &mut &[T], count: usize, number: &mut usize) {
    let (first, rest) = values.split_at(count);
    list.extend_from_slice(first);
    *values = rest;
    *number += count;
}

fn words(text: &str) -> SplitAsciiWhitespace<'_> {
    text.split_ascii_whitespace()
}

/// A number of the file's arrays.
trait Number: Default + Copy + std::str::FromStr {
    /// The nearest one.
    fn rounded(value: f64) -> Self;
}

impl Number for f32 {
    fn rounded(value: f64) -> Self {
        value as f32
    }
}

impl Number for f64 {
    fn rounded(value: f64) -> Self {
        value
    }
}

/// A number as programs write it: with a decimal comma, with Fortran's exponent, or as Windows
/// writes what is none.
pub(super) fn float(word: &str) -> Option<f64> {
    word.parse().ok().or_else(|| {
        let number = word.replacen(',', ".", 1).replacen(['d', 'D'], "e", 1);
        let is_none = ["#IND", "#QNAN", "#SNAN", "#INF", "nan("].iter().any(|mark| word.contains(mark));
        if is_none { Some(f64::NAN) } else { number.parse().ok() }
    })
}

/// The number of a smoothing group; 0 for `off`. Numbers are names: those that do not fit into 32
/// bits are told apart as far as they can be.
fn smoothing_group(rest: &str) -> u32 {
    let word = words(rest).next().unwrap_or("off");
    match word.parse::<f64>() {
        // what is no number is `off` or `on`
        Err(_) => u32::from(!word.eq_ignore_ascii_case("off")),
        Ok(number) => number as u32,
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    /// The file that a text is read as, or why it is not.
    fn read(text: &str, block: Option<usize>) -> String {
        match parse_lines(&mut Lines::new(Cursor::new(text.as_bytes().to_vec())).unwrap(), block) {
            Ok(file) => format!("{file:?}"),
            Err(Failure::Line(number, e)) => format!("line {number}: {e}"),
            Err(Failure::Read(e)) => panic!("{e}"),
        }
    }

    const START: &str = "v 0 0 0\nv 1 0 0\r\nv 1 1 0\nv 0 1 -1e-3\nvt 0 0.5\nvt 1 1 0\nvn 0 0 1\n";

    #[test]
    fn blocks_are_read_as_lines_are() {
        let good = [
            "f 1 2 3\nf 1/1 2/2 3/1\nf -1//1 -2//-1 -3//1\nf 1/1/1 2/1/1 3/2/1 4/2/1 # a quad\nf 1/ 2// 3/0/0\n",
            "o a\nf 1 2 3\n\n# c\ns 1\nf 1 2 3\ns off\nusemtl m\nf 1 2 3\ng b\n\nusemtl m\nf 1 3 4",
            "v 1 2 3 1\nv 1 2 3 0.5 0.5 1\nv 1,5 2 3\nv\t1 1D2 +3\nf 5 6 7 8 1 2 3\n",
            "vt 1\nvt 0.5 1 2 3\nvn 1 2 3 4\nvn nan 0 1\nfo 1 2 3\nf 1 2\nf 1/1/1/1 2 3\n",
            "l 1 2\nwibble\nwibble 1\nf 1 2 3 \\\n 4\nf 1 2 3\nwobble\r\n",
            "usemtl \u{e9}\nf 1 2 3\n  f 1 2 3  \n\tv 7 7 7\nf +1 2 5\nf 1 2 000003\n",
        ];
        let bad = [
            "f 1 2 9\n",
            "\n\nf 1 2 -9\n",
            "f 1/3 2 3\n",
            "f 1//2 2 3\n",
            "f 0 1 2\n",
            "f 1/-0 2 3\n",
            "f 1/00 2 3\n",
            "f a b c\n",
            "v 1 2\n",
            "v 1 2 inf\n",
            "v 1e39 0 0\n",
            "v 1 2 x\n",
            "vt\n",
            "vn 1 2\n",
            "vt 0 x\n",
            "f 1 2 3\nf 1 2 99999999999\n",
            "f 1 2 4294967297\n",
        ];
        for text in good.iter().chain(&bad) {
            let text = format!("{START}{text}");
            let expected = read(&text, None);
            assert_eq!(bad.iter().any(|b| text.ends_with(b)), expected.starts_with("line "), "{text}: {expected}");
            // blocks of all sizes, so that lines of each kind are the last of one
            for size in [1, 9, 20, 50, 1 << 20] {
                assert_eq!(read(&text, Some(size)), expected, "{text} in blocks of {size}");
            }
        }
    }

    /// Many chunks, with an error in the last.
    #[test]
    fn lines_of_chunks_have_their_numbers() {
        let many = START.repeat(5_000) + "usemtl a\n" + &"f 1 2 3\nf -1 -2 -3 -4\n\n".repeat(20_000);
        assert!(many.len() > 1 << 19);
        assert_eq!(read(&many, Some(BLOCK)), read(&many, None));
        let line = 7 * 5_000 + 1 + 3 * 20_000 + 1;
        let error = read(&(many + "f 1 2 200000\n"), Some(BLOCK));
        assert_eq!(error, format!("line {line}: the face refers to vertex 200000, but there are 20000 so far"));
    }
}
