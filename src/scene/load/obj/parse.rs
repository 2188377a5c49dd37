//! The statements of an OBJ file.

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::str::SplitAsciiWhitespace;

use glam::{Vec2, Vec3, Vec4};

use super::polygon::PolygonTriangulator;
use crate::error::{Error, Result};

/// No such index.
pub(super) const NONE: u32 = u32::MAX;

/// A corner of a face: indices into the arrays of the file. Positions always exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Corner {
    pub position: u32,
    pub texcoord: u32,
    pub normal: u32,
}

/// Consecutive faces with one name and one material.
#[derive(Debug)]
pub(super) struct Group {
    pub name: String,
    pub material: Option<String>,
    pub triangles: Vec<[Corner; 3]>,
}

/// A whole file.
#[derive(Debug, Default)]
pub(super) struct ObjFile {
    pub positions: Vec<Vec3>,
    /// Empty, or as long as `positions` from the last coloured vertex back.
    pub colors: Vec<Vec4>,
    /// glTF convention: v down.
    pub texcoords: Vec<Vec2>,
    pub normals: Vec<Vec3>,
    pub libraries: Vec<String>,
    pub groups: Vec<Group>,
    /// Faces of fewer than three corners, which are left out.
    pub open_faces: usize,
}

/// Parses a file; errors name the line.
pub(super) fn parse(path: &Path) -> Result<ObjFile> {
    let file = File::open(path).map_err(|e| Error::read(path, &e))?;
    let mut lines = Lines { reader: BufReader::with_capacity(1 << 18, file), number: 0, buffer: Vec::new() };
    let mut parser = Parser::default();
    while lines.next().map_err(|e| Error::read(path, &e))? {
        if lines.number == 1 && matches!(lines.buffer.get(..2), Some([0xfe, 0xff] | [0xff, 0xfe])) {
            return Err(Error::input(path, "is UTF-16 text; save it as UTF-8"));
        }
        // other encodings occur in names only, and there they do not matter
        let line = String::from_utf8_lossy(&lines.buffer);
        parser.line(&line).map_err(|e| Error::input(path, format!("line {}: {e}", lines.number)))?;
    }
    Ok(parser.file)
}

/// Lines, with those that end in a backslash joined.
struct Lines<R> {
    reader: R,
    number: usize,
    buffer: Vec<u8>,
}

impl<R: BufRead> Lines<R> {
    fn next(&mut self) -> std::io::Result<bool> {
        self.buffer.clear();
        loop {
            if self.reader.read_until(b'\n', &mut self.buffer)? == 0 {
                return Ok(!self.buffer.is_empty());
            }
            self.number += 1;
            let end = self.buffer.trim_ascii_end().len();
            if self.buffer[..end].last() != Some(&b'\\') {
                return Ok(true);
            }
            self.buffer.truncate(end - 1);
            self.buffer.push(b' ');
        }
    }
}

#[derive(Default)]
struct Parser {
    file: ObjFile,
    name: String,
    material: Option<String>,
    /// Whether name or material changed since the last face.
    changed: bool,
    polygon: Vec<Corner>,
    cutter: PolygonTriangulator,
}

impl Parser {
    fn line(&mut self, line: &str) -> Result<(), String> {
        let line = line.trim();
        let (key, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
        let rest = rest.trim();
        match key {
            "v" => self.vertex(rest),
            "vt" => {
                // v is often left out by one-dimensional textures
                let [u, v, _] = floats(&mut words(rest), 1)?;
                self.file.texcoords.push(Vec2::new(u, 1.0 - v));
                Ok(())
            }
            "vn" => {
                self.file.normals.push(floats(&mut words(rest), 3)?.into());
                Ok(())
            }
            "f" => self.face(rest),
            "o" | "g" => {
                self.name = rest.to_owned();
                self.changed = true;
                Ok(())
            }
            "usemtl" => {
                self.material = Some(strip_comment(rest).to_owned());
                self.changed = true;
                Ok(())
            }
            "mtllib" => {
                self.file.libraries.push(strip_comment(rest).to_owned());
                Ok(())
            }
            // points, lines, smoothing groups, curves, comments: nothing to show
            _ => Ok(()),
        }
    }

    fn vertex(&mut self, rest: &str) -> Result<(), String> {
        let mut words = words(rest);
        let p = Vec3::from(floats(&mut words, 3)?);
        if !p.is_finite() {
            return Err(format!("the vertex position `{rest}` is not finite: repair the model and export it again"));
        }
        self.file.positions.push(p);
        // x y z w has a weight for curves, which says nothing here; x y z r g b has a colour
        let more = words.clone().take_while(|w| !w.starts_with('#')).count();
        if more == 3 {
            let c = Vec3::from(floats(&mut words, 3)?);
            self.file.colors.resize(self.file.positions.len() - 1, Vec4::ONE);
            self.file.colors.push(c.extend(1.0));
        }
        Ok(())
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
            let (name, material) = (self.name.clone(), self.material.clone());
            if self.file.groups.last().is_none_or(|g| g.name != name || g.material != material) {
                self.file.groups.push(Group { name, material, triangles: Vec::new() });
            }
        }
        if let Some(group) = self.file.groups.last_mut() {
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
            if part.is_empty() {
                return Ok(NONE);
            }
            let i: i64 = part.parse().map_err(|_| format!("`{word}` is not a corner of a face"))?;
            let count = count as i64;
            let resolved = if i < 0 { i.checked_add(count) } else { i.checked_sub(1) };
            match resolved.filter(|r| (0..count).contains(r)).and_then(|r| u32::try_from(r).ok()).filter(|&r| r != NONE) {
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

/// Names may hold spaces, so that only ` #` ends them.
fn strip_comment(text: &str) -> &str {
    text.split(" #").next().unwrap_or("").trim()
}

/// Up to three numbers, of which the first `needed` must be there; the others are zero if missing.
fn floats(words: &mut SplitAsciiWhitespace, needed: usize) -> Result<[f32; 3], String> {
    let mut out = [0.0; 3];
    for (i, value) in out.iter_mut().enumerate() {
        match words.clone().next() {
            Some(word) if i < needed || !word.starts_with('#') => {
                words.next();
                *value = word.parse().map_err(|_| format!("`{word}` is not a number"))?;
            }
            _ if i < needed => return Err(format!("{needed} numbers are needed, {i} found")),
            _ => break,
        }
    }
    Ok(out)
}
