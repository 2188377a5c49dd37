//! The statements of an MTL file.

use std::collections::BTreeMap;

use glam::{Affine2, Mat2, Vec2, Vec3};

/// A texture map with its options.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map {
    /// As written.
    pub file: String,
    /// `-clamp on`.
    pub clamp: bool,
    /// `-s` and `-o`, turned into glTF's convention (v down).
    pub transform: Affine2,
    /// `-bm`.
    pub multiplier: f32,
}

/// A material as written; what is absent is `None`.
#[derive(Clone, Debug, Default)]
pub(super) struct MtlMaterial {
    pub name: String,
    pub diffuse: Option<Vec3>,
    pub specular: Option<Vec3>,
    pub emissive: Option<Vec3>,
    pub transmission_filter: Option<Vec3>,
    pub shininess: Option<f32>,
    pub ior: Option<f32>,
    pub dissolve: Option<f32>,
    pub transparency: Option<f32>,
    pub illum: Option<u32>,
    pub roughness: Option<f32>,
    pub metallic: Option<f32>,
    pub map_diffuse: Option<Map>,
    pub map_emissive: Option<Map>,
    pub map_dissolve: Option<Map>,
    pub map_normal: Option<Map>,
    /// Numbers of statements that are not the format's.
    pub parameters: BTreeMap<String, f32>,
}

/// Parses a library. Lines that make no sense are noted with their number and skipped: a broken material must not hide
/// the model.
pub(super) fn parse(text: &str, warn: &mut dyn FnMut(String)) -> Vec<MtlMaterial> {
    let mut materials: Vec<MtlMaterial> = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        let (key, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
        let rest = rest.split(" #").next().unwrap_or("").trim();
        if key == "newmtl" {
            materials.push(MtlMaterial { name: rest.to_owned(), ..Default::default() });
        } else if let Some(material) = materials.last_mut()
            && let Err(e) = statement(material, key, rest)
        {
            warn(format!("line {}: {e}: ignored", number + 1));
        }
    }
    materials
}

fn statement(material: &mut MtlMaterial, key: &str, rest: &str) -> Result<(), String> {
    match key {
        "Kd" => material.diffuse = Some(color(rest)?),
        "Ks" => material.specular = Some(color(rest)?),
        "Ke" => material.emissive = Some(color(rest)?),
        "Tf" => material.transmission_filter = Some(color(rest)?),
        "Ns" => material.shininess = Some(number(rest)?),
        "Ni" => material.ior = Some(number(rest)?),
        // `d -halo x` fades towards the silhouette: x is the middle
        "d" => material.dissolve = Some(number(rest.strip_prefix("-halo").unwrap_or(rest))?),
        "Tr" => material.transparency = Some(number(rest)?),
        "illum" => material.illum = Some(number(rest)? as u32),
        "Pr" => material.roughness = Some(number(rest)?),
        "Pm" => material.metallic = Some(number(rest)?),
        "map_Kd" => material.map_diffuse = Some(map(rest)?),
        "map_Ke" => material.map_emissive = Some(map(rest)?),
        "map_d" => material.map_dissolve = Some(map(rest)?),
        // `bump` holds heights, not normals
        "norm" => material.map_normal = Some(map(rest)?),
        _ => {
            if let Ok(value) = number(rest) {
                material.parameters.insert(key.to_owned(), value);
            }
        }
    }
    Ok(())
}

fn number(text: &str) -> Result<f32, String> {
    let word = text.split_ascii_whitespace().next().unwrap_or("");
    match word.parse::<f32>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err(format!("`{text}` is not a number")),
    }
}

/// One or three numbers; one stands for grey.
fn color(text: &str) -> Result<Vec3, String> {
    let all: Option<Vec<f32>> = text.split_ascii_whitespace().take(3).map(|w| w.parse().ok()).collect();
    match all.as_deref() {
        Some([r, g, b]) if Vec3::new(*r, *g, *b).is_finite() => Ok(Vec3::new(*r, *g, *b)),
        Some([y]) if y.is_finite() => Ok(Vec3::splat(*y)),
        _ => Err(format!("`{text}` is not a colour (three numbers)")),
    }
}

/// `[-option values]... file name`, where the file name may hold spaces.
fn map(text: &str) -> Result<Map, String> {
    let mut map = Map { file: String::new(), clamp: false, transform: Affine2::IDENTITY, multiplier: 1.0 };
    let (mut scale, mut offset) = (Vec2::ONE, Vec2::ZERO);
    let mut rest = text;
    while rest.starts_with('-') {
        let (option, after) = word(rest);
        let (value, after_value) = word(after);
        rest = after_value;
        match option {
            "-clamp" => map.clamp = value == "on",
            "-bm" => map.multiplier = number(value)?,
            "-s" | "-o" | "-t" => {
                let mut values = [number(value)?; 3];
                if option == "-o" {
                    values[1] = 0.0;
                }
                for slot in &mut values[1..] {
                    let (next, after) = word(rest);
                    let Ok(value) = number(next) else { break };
                    (*slot, rest) = (value, after);
                }
                match option {
                    "-s" => scale = Vec2::new(values[0], values[1]),
                    "-o" => offset = Vec2::new(values[0], values[1]),
                    _ => {}
                }
            }
            "-mm" => rest = word(rest).1,
            // -blendu, -blendv, -boost, -cc, -imfchan, -texres, -type: one value each
            _ => {}
        }
    }
    if rest.is_empty() {
        return Err(format!("`{text}` names no file"));
    }
    rest.clone_into(&mut map.file);
    // (u, v) -> scale * (u, v) + offset with v up; ours has v down on both sides: v' = 1 - (s (1 - v) + o)
    map.transform = Affine2::from_mat2_translation(Mat2::from_diagonal(scale), Vec2::new(offset.x, 1.0 - scale.y - offset.y));
    Ok(map)
}

/// The first word and what follows it.
fn word(text: &str) -> (&str, &str) {
    let (first, rest) = text.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((text, ""));
    (first, rest.trim_start())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_with_options() {
        let m = map("-s 2 3 -o 0.25 -clamp on a folder\\wood bark.png").unwrap();
        assert_eq!((m.file.as_str(), m.clamp), ("a folder\\wood bark.png", true));
        // v up: (0.5, 0.5) -> (1.25, 1.5), so v down: 1 - 1.5
        assert!(m.transform.transform_point2(Vec2::splat(0.5)).abs_diff_eq(Vec2::new(1.25, -0.5), 1e-6));
        assert!(map("-s 1 1 1").is_err());
    }

    #[test]
    fn broken_lines_are_noted() {
        let mut warnings = Vec::new();
        let m = parse("newmtl a\nKd 1 2\nKs 0.5\nd nan\nillum x", &mut |w| warnings.push(w));
        assert_eq!((m.len(), warnings.len(), m[0].specular), (1, 3, Some(Vec3::splat(0.5))), "{warnings:?}");
    }
}
