//! The statements of an MTL file.

use std::collections::BTreeMap;

use glam::{Affine2, Mat2, Vec2, Vec3};

use super::parse::float;
use crate::scene::load::text::{self, trim, unquoted, without_comment};

/// A texture map with its options.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Map {
    /// Name of the file as written, a comment included: a name may hold ` #`.
    pub file: String,
    /// Options that are written and not used.
    pub unused: Vec<&'static str>,
    /// `-clamp on`.
    pub clamp: bool,
    /// `-s` and `-o`, turned into glTF's convention (v down).
    pub transform: Affine2,
    /// `-bm`.
    pub multiplier: f32,
    /// `-mm`: base and gain of texels.
    pub range: [f32; 2],
    /// `-imfchan`: the channel that a map of numbers is read from.
    pub channel: Option<MapChannel>,
}

/// A channel of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum MapChannel {
    Red,
    Green,
    Blue,
    Alpha,
    Luminance,
}

impl MapChannel {
    /// The channel that `-imfchan` calls so; `z`, of depth, is in no picture that is read.
    fn from_letter(letter: &str) -> Option<Self> {
        match letter {
            "r" => Some(Self::Red),
            "g" => Some(Self::Green),
            "b" => Some(Self::Blue),
            "m" => Some(Self::Alpha),
            "l" => Some(Self::Luminance),
            _ => None,
        }
    }

    /// The value of this channel in a texel.
    pub fn value(self, [r, g, b, a]: [f32; 4]) -> f32 {
        match self {
            Self::Red => r,
            Self::Green => g,
            Self::Blue => b,
            Self::Alpha => a,
            Self::Luminance => 0.2126 * r + 0.7152 * g + 0.0722 * b,
        }
    }
}

impl Map {
    /// Returns the names that the file may have.
    pub(super) fn names(&self) -> Vec<&str> {
        text::uncommented(&self.file).map(unquoted).collect()
    }
}

/// A material as written; what is absent is `None`.
#[derive(Clone, Debug, Default)]
pub(super) struct MtlMaterial {
    /// A text of [`text`].
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
    pub map_ambient: Option<Map>,
    pub map_diffuse: Option<Map>,
    pub map_emissive: Option<Map>,
    pub map_dissolve: Option<Map>,
    pub map_normal: Option<Map>,
    /// Heights by the format; exporters write normal maps, too.
    pub map_bump: Option<Map>,
    pub map_roughness: Option<Map>,
    pub map_metallic: Option<Map>,
    pub map_shininess: Option<Map>,
    pub map_specular: Option<Map>,
    pub map_sheen: Option<Map>,
    pub map_clearcoat: Option<Map>,
    pub map_clearcoat_roughness: Option<Map>,
    pub map_anisotropy: Option<Map>,
    /// Numbers of statements that are not the format's.
    pub parameters: BTreeMap<String, f32>,
}

impl MtlMaterial {
    /// The maps that every material shows, whatever else it has.
    pub(super) fn colour_and_surface_maps(&self) -> impl Iterator<Item = &Map> {
        let normal = self.map_normal.as_ref().or(self.map_bump.as_ref());
        let surface = [&self.map_roughness, &self.map_metallic];
        let colours = [&self.map_diffuse, &self.map_dissolve, &self.map_emissive];
        colours.into_iter().chain(surface).flatten().chain(normal)
    }
}

/// Numbers of [`MtlMaterial::parameters`] that have a meaning here: layers, and the roughness of
/// Oren-Nayar's model.
const PARAMETERS: [&str; 6] = ["Pc", "Pcr", "Ps", "aniso", "anisor", "sigma"];

/// Parses a library. Lines that make no sense are noted with their number and skipped: a broken
/// material must not hide the model.
pub(super) fn parse(source: &str, warn: &mut dyn FnMut(String)) -> Vec<MtlMaterial> {
    let mut materials: Vec<MtlMaterial> = Vec::new();
    for (number, line) in text::lines(source).enumerate() {
        let line = trim(line);
        let (key, rest) = line.split_once(|c: char| c.is_ascii_whitespace()).unwrap_or((line, ""));
        let rest = trim(rest);
        if key == "newmtl" {
            materials.push(MtlMaterial { name: rest.to_owned(), ..Default::default() });
        } else if let Some(material) = materials.last_mut()
            && !key.starts_with('#')
        {
            let mut notes = Vec::new();
            let failed = statement(material, key, rest, &mut notes).err();
            notes.into_iter().chain(failed).for_each(|note| warn(format!("line {}: {note}", number + 1)));
        }
    }
    materials
}

/// Reads a statement. `notes`: options of maps that are not used.
fn statement(material: &mut MtlMaterial, key: &str, rest: &str, notes: &mut Vec<String>) -> Result<(), String> {
    let values = without_comment(rest);
    let mut map = |text: &str| {
        let map = map(text)?;
        notes.extend(map.unused.iter().map(|option| format!("{option} of {} is not used", plain(key))));
        Ok::<_, String>(map)
    };

    // exporters write keys in any case
    match key.to_ascii_lowercase().as_str() {
        "kd" => material.diffuse = Some(color(values)?),
        "ks" => material.specular = Some(color(values)?),
        "ke" => material.emissive = Some(color(values)?),
        "tf" => material.transmission_filter = Some(color(values)?),
        "ns" => material.shininess = Some(number(values)?),
        "ni" => material.ior = Some(number(values)?),
        "d" => match values.strip_prefix("-halo") {
            Some(middle) => {
                material.dissolve = Some(number(middle)?);
                return Err("`d -halo` is opaque at the silhouette: it is read as `d`, the same everywhere".into());
            }
            None => material.dissolve = Some(number(values)?),
        },
        "tr" => material.transparency = Some(number(values)?),
        "illum" => material.illum = Some(model(number(values)?)?),
        "pr" => material.roughness = Some(number(values)?),
        "pm" => material.metallic = Some(number(values)?),
        "map_ka" => material.map_ambient = Some(map(rest)?),
        "map_kd" => material.map_diffuse = Some(map(rest)?),
        "map_ke" => material.map_emissive = Some(map(rest)?),
        "map_d" => material.map_dissolve = Some(map(rest)?),
        "map_pr" => material.map_roughness = Some(map(rest)?),
        "map_pm" => material.map_metallic = Some(map(rest)?),
        "map_ns" => material.map_shininess = Some(map(rest)?),
        "map_ks" => material.map_specular = Some(map(rest)?),
        "map_ps" => material.map_sheen = Some(map(rest)?),
        "map_pc" => material.map_clearcoat = Some(map(rest)?),
        "map_pcr" => material.map_clearcoat_roughness = Some(map(rest)?),
        "map_aniso" => material.map_anisotropy = Some(map(rest)?),
        "norm" | "map_norm" | "map_kn" => material.map_normal = Some(map(rest)?),
        "bump" | "map_bump" => material.map_bump = Some(map(rest)?),
        // whether textures are smoothed
        "map_aat" => {}
        // light from nowhere, which path tracing has no use for; most files say something of it
        "ka" => drop(color(values)?),
        "refl" | "disp" | "decal" => return Err(unused(key)),
        other if other.starts_with("map_") => return Err(unused(key)),
        "" => {}
        _ => {
            let known = PARAMETERS.iter().find(|name| name.eq_ignore_ascii_case(key));
            // a number that nothing here uses is kept under its name all the same
            let value = if known.is_some() { Some(number(values)?) } else { number(values).ok() };
            let name = known.copied().unwrap_or(key);
            material.parameters.extend(value.map(|value| (name.to_owned(), value)));
            if known.is_none() {
                return Err(format!("`{}` is no statement that is used", text::shown(key)));
            }
        }
    }
    Ok(())
}

/// Says that a map has no effect. The key is outside of quotation marks, so that each kind is said
/// once.
pub(super) fn unused(key: &str) -> String {
    format!("{} is not used", plain(key))
}

/// The letters, digits and underscores of a word.
fn plain(key: &str) -> String {
    key.chars().filter(|c| c.is_ascii_alphanumeric() || *c == '_').collect()
}

fn number(text: &str) -> Result<f32, String> {
    let word = text.split_ascii_whitespace().next().unwrap_or("");
    match float(word) {
        Some(x) if x.is_finite() => Ok(x as f32),
        _ => Err(format!("`{}` is not a number: ignored", text::shown(text))),
    }
}

/// The number of an illumination model: MTL has those from 0 to 10.
fn model(number: f32) -> Result<u32, String> {
    if number.fract() == 0.0 && (0.0..=10.0).contains(&number) {
        Ok(number as u32)
    } else {
        Err(format!("`{number}` is no illumination model (0 to 10): ignored"))
    }
}

/// One or three numbers; one stands for grey.
fn color(text: &str) -> Result<Vec3, String> {
    let all: Option<Vec<f32>> = text.split_ascii_whitespace().take(3).map(|w| float(w).map(|x| x as f32)).collect();
    match all.as_deref() {
        Some([r, g, b]) if Vec3::new(*r, *g, *b).is_finite() => Ok(Vec3::new(*r, *g, *b)),
        Some([y]) if y.is_finite() => Ok(Vec3::splat(*y)),
        _ => Err(format!("`{}` is not a colour (three numbers): ignored", text::shown(text))),
    }
}

/// Options of maps and how many values each has at most.
const OPTIONS: [(&str, usize); 13] = [
    ("-blendu", 1),
    ("-blendv", 1),
    ("-bm", 1),
    ("-boost", 1),
    ("-cc", 1),
    ("-clamp", 1),
    ("-imfchan", 1),
    ("-mm", 2),
    ("-o", 3),
    ("-s", 3),
    ("-t", 3),
    ("-texres", 1),
    ("-type", 1),
];

/// `[-option values]... file name`, where the file name may hold spaces; some put options behind
/// it.
fn map(text: &str) -> Result<Map, String> {
    let transform = Affine2::IDENTITY;
    let mut map = Map {
        file: String::new(),
        unused: Vec::new(),
        clamp: false,
        transform,
        multiplier: 1.0,
        range: [0.0, 1.0],
        channel: None,
    };

    // options stand before the name and behind it, which thus ends where one begins
    let (mut scale, mut offset) = (Vec2::ONE, Vec2::ZERO);
    let mut rest = text;
    let mut name_end = None;
    while !rest.is_empty() {
        let (option, after) = word(rest);
        let Some((count, values, after_values)) = option_values(option, after) else {
            if name_end.is_none() && map.file.is_empty() {
                map.file = rest.to_owned();
                name_end = Some(rest);
            }
            // options behind the name, if that is what follows
            match rest.find(" -") {
                Some(at) => rest = &rest[at + 1..],
                None => break,
            }
            continue;
        };
        if let Some(name) = name_end.take() {
            map.file = trim(&name[..name.len() - rest.len()]).to_owned();
        }
        rest = after_values;
        let text = word(after).0;
        match option {
            "-clamp" => map.clamp = text == "on",
            "-imfchan" if MapChannel::from_letter(text).is_some() => map.channel = MapChannel::from_letter(text),
            "-bm" => map.multiplier = values[0],
            "-mm" => map.range = [values[0], if count > 1 { values[1] } else { 1.0 }],
            "-s" => scale = Vec2::new(values[0], if count > 1 { values[1] } else { 1.0 }),
            "-o" => offset = Vec2::new(values[0], if count > 1 { values[1] } else { 0.0 }),
            // as they are without the option
            "-blendu" | "-blendv" if text == "on" => {}
            "-cc" if text == "off" => {}
            "-boost" | "-t" if values == [0.0; 3] => {}
            _ => map.unused.extend(OPTIONS.iter().map(|(name, _)| *name).find(|name| *name == option)),
        }
    }

    if map.file.is_empty() {
        return Err(format!("`{}` names no file: ignored", text::shown(text)));
    }
    // (u, v) -> scale * (u, v) + offset with v up; ours has v down on both sides:
    // v' = 1 - (s (1 - v) + o)
    map.transform =
        Affine2::from_mat2_translation(Mat2::from_diagonal(scale), Vec2::new(offset.x, 1.0 - scale.y - offset.y));
    Ok(map)
}

/// The values of an option and what follows them, if it is one: how many numbers there are, and the
/// numbers. `None` for part of a name.
fn option_values<'a>(option: &str, after: &'a str) -> Option<(usize, [f32; 3], &'a str)> {
    let (_, most) = OPTIONS.iter().find(|(name, _)| *name == option)?;
    let mut values = [0.0; 3];
    if !matches!(option, "-bm" | "-boost" | "-mm" | "-o" | "-s" | "-t" | "-texres") {
        let (value, rest) = word(after);
        return (!value.is_empty()).then_some((1, values, rest));
    }
    let (mut count, mut rest) = (0, after);
    while count < *most {
        let (value, next) = word(rest);
        let Ok(value) = number(value) else { break };
        values[count] = value;
        (count, rest) = (count + 1, next);
    }
    (count > 0).then_some((count, values, rest))
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
        let m = map("-bm 0.5 -o 0 0 0 -mm 0.1 0.9 -imfchan l name with spaces.png").unwrap();
        assert_eq!((m.file.as_str(), m.multiplier, m.range), ("name with spaces.png", 0.5, [0.1, 0.9]));
    }

    #[test]
    fn names_that_look_like_options() {
        let file = |text: &str| map(text).unwrap().file;
        assert_eq!(file("-wood.png"), "-wood.png");
        assert_eq!(file("wood -s 2.png"), "wood -s 2.png");
        assert_eq!(file("-s 1 1 1 2 planks - old.png"), "2 planks - old.png");
        // options behind the name
        let m = map("wood bark.png -clamp on -bm 2").unwrap();
        assert_eq!((m.file.as_str(), m.clamp, m.multiplier), ("wood bark.png", true, 2.0));
        assert_eq!(map("\"a b.png\" # comment").unwrap().names()[1], "a b.png");
    }

    #[test]
    fn broken_lines_are_noted() {
        let mut warnings = Vec::new();
        let m = parse("newmtl a\nKd 1 2\nKs 0.5\nd nan\nillum x", &mut |w| warnings.push(w));
        assert_eq!((m.len(), warnings.len(), m[0].specular), (1, 3, Some(Vec3::splat(0.5))), "{warnings:?}");
        let mut warnings = Vec::new();
        let text = "newmtl a\rKD 1 0,5 0 # red\rmap_Xs s.png\rdisp h.png\rmap_aat on\r#map_Xs\rKa 1 0 0\rPC 0.5\r\
                    map_anisor a.png\rDecal d.png\ranisor 0.25";
        let m = parse(text, &mut |w| warnings.push(w));
        assert_eq!(m[0].diffuse, Some(Vec3::new(1.0, 0.5, 0.0)));
        assert_eq!(m[0].parameters.get("Pc"), Some(&0.5));
        // of anisotropy the angle is read, and not from a map
        assert_eq!(m[0].parameters.get("anisor"), Some(&0.25));
        let unused = [(3, "map_Xs"), (4, "disp"), (9, "map_anisor"), (10, "Decal")]
            .map(|(n, key)| format!("line {n}: {key} is not used"));
        assert_eq!(warnings, unused);
    }

    /// Statements and options without an effect are named, unless they say what is so anyway.
    #[test]
    fn what_is_not_used_is_named() {
        let mut warnings = Vec::new();
        let text = "newmtl a\nsharpness 60\nxyzzy on\nmap_Pr -cc on -boost 2 -t 0 0 0 -imfchan g r.png\n\
                    map_Pm -imfchan z -blendu on -blendv off m.png\nsigma 0.5\nPs x";
        let m = parse(text, &mut |w| warnings.push(w));
        assert_eq!(m[0].parameters.get("sharpness"), Some(&60.0));
        assert_eq!(m[0].map_roughness.as_ref().unwrap().channel, Some(MapChannel::Green));
        let expected = [
            "line 2: `sharpness` is no statement that is used",
            "line 3: `xyzzy` is no statement that is used",
            "line 4: -cc of map_Pr is not used",
            "line 4: -boost of map_Pr is not used",
            "line 5: -imfchan of map_Pm is not used",
            "line 5: -blendv of map_Pm is not used",
            "line 7: `x` is not a number: ignored",
        ];
        assert_eq!(warnings, expected);
        // colour is weighed as the eye does, and alpha is a channel
        assert_eq!([MapChannel::Green, MapChannel::Alpha].map(|c| c.value([0.1, 0.2, 0.3, 0.4])), [0.2, 0.4]);
        assert!((MapChannel::Luminance.value([1.0; 4]) - 1.0).abs() < 1e-6);
    }
}
