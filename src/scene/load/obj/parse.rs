//! The statements of an OBJ file.

use std::collections::BTreeMap;
use std::path::Path;
use std::str::SplitAsciiWhitespace;

use glam::{DVec3, Vec2, Vec3, Vec4};

use super::polygon::{self, PolygonTriangulator};
use crate::error::{Error, Result};
use crate::memory::Budget;
use crate::scene::load::text::{self, Lines, trim};

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
    budget.read(usize::try_from(file.metadata().map_err(unread)?.len()).unwrap_or(usize::MAX));
    let mut lines = Lines::new(file).map_err(unread)?;
    let mut parser = Parser::default();
    loop {
        let failed = match lines.next().map_err(unread)? {
            Some(line) => parser.line(&line).err(),
            None => return Ok(parser.file),
        };
        if let Some(word) = parser.unknown.take() {
            parser.file.unknown.0.push((word, lines.number));
        }
        if let Some(e) = failed {
            return Err(Error::input(path, format!("line {}: {}", lines.number, text::shown(&e))));
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
        let [first, _, _, ..] = self.polygon[..] else {
            // lines and points that a converter left over: they have no area
            self.file.open_faces += 1;
            return Ok(());
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
            self.file.large_polygons += usize::from(self.polygon.len() > polygon::MAX_CORNERS);
            let (polygon, positions) = (&self.polygon, &self.file.positions);
            match self.cutter.cut(polygon.iter().map(|c| positions[c.position as usize])) {
                Some(triangles) => group.triangles.extend(triangles.map(|t| t.map(|i| polygon[i]))),
                None => group.triangles.extend(polygon[1..].windows(2).map(|w| [first, w[0], w[1]])),
            }
        }
        Ok(())
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
