//! Baked maps as image files: linear values, since a texture of data is no colour; light alone is,
//! and has the values of sRGB in files of integers.

use std::io::Cursor;
use std::path::Path;

use glam::Vec3;
use image::{ExtendedColorType, ImageFormat as Format};

use super::map::BakedMap;
use super::{BakeSettings, Map};
use crate::colour::srgb_encode;
use crate::error::{Error, Result};
use crate::files;
use crate::output::{self, Channel, Image};

/// Bits of a channel of a PNG file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bits {
    /// Eight.
    #[default]
    Eight,
    /// Sixteen.
    Sixteen,
}

/// Values of a map from 0 to 1, as integers hold them: directions by (d + 1) / 2, positions within
/// their bounds, light as sRGB up to 1.
fn unit_values(map: &BakedMap, settings: &BakeSettings) -> Vec<Vec3> {
    let (low, high) = map.bounds;
    let unit = |value: &Vec3| match settings.map {
        Map::BentNormal | Map::Normal => 0.5 * *value + 0.5,
        Map::Light => value.map(srgb_encode),
        Map::Position => (*value - low) / (high - low).max(Vec3::splat(f32::MIN_POSITIVE)),
        _ => *value,
    };
    map.values.iter().map(|value| unit(value).clamp(Vec3::ZERO, Vec3::ONE)).collect()
}

/// A map as a PNG file: grey, or RGB for vectors.
///
/// # Errors
/// [`Error::Usage`] with the encoder's message.
pub fn png(map: &BakedMap, settings: &BakeSettings, bits: Bits) -> Result<Vec<u8>> {
    let channels = if settings.map.is_rgb() { 3 } else { 1 };
    let values = unit_values(map, settings);
    let components = values.iter().flat_map(|v| v.to_array().into_iter().take(channels));
    let (bytes, colour): (Vec<u8>, _) = match (bits, channels) {
        (Bits::Eight, 1) => (components.map(eight).collect(), ExtendedColorType::L8),
        (Bits::Eight, _) => (components.map(eight).collect(), ExtendedColorType::Rgb8),
        (Bits::Sixteen, 1) => (components.flat_map(|v| sixteen(v).to_ne_bytes()).collect(), ExtendedColorType::L16),
        (Bits::Sixteen, _) => (components.flat_map(|v| sixteen(v).to_ne_bytes()).collect(), ExtendedColorType::Rgb16),
    };
    encode(&bytes, map.size, colour)
}

/// Components of pixels as a PNG file.
///
/// # Errors
/// [`Error::Usage`] with the encoder's message.
pub(super) fn encode(bytes: &[u8], [width, height]: [u32; 2], colour: ExtendedColorType) -> Result<Vec<u8>> {
    let mut png = Vec::new();
    image::write_buffer_with_format(&mut Cursor::new(&mut png), bytes, width, height, colour, Format::Png)
        .map_err(|e| Error::Usage(format!("the map cannot be written as PNG: {e}")))?;
    Ok(png)
}

fn eight(value: f32) -> u8 {
    (value * 255.0).round() as u8
}

fn sixteen(value: f32) -> u16 {
    (value * 65535.0).round() as u16
}

/// Writes a map as a file: EXR has the values as they are, PNG from 0 to 1.
///
/// # Errors
/// [`Error::Output`], also for another extension.
pub fn save(map: &BakedMap, settings: &BakeSettings, bits: Bits, path: &Path) -> Result<()> {
    if !files::has_extension(path, "exr") {
        let png = png(map, settings, bits)?;
        return files::write_atomically(path, |file| std::io::Write::write_all(file, &png));
    }
    output::exr::write(&image(map, settings), path)
}

/// A map with its values as they are: grey, or RGB.
pub fn image(map: &BakedMap, settings: &BakeSettings) -> Image {
    let plane = |k: usize| map.values.iter().map(|v| v[k]).collect();
    let channels = if settings.map.is_rgb() {
        ["R", "G", "B"].iter().enumerate().map(|(k, name)| Channel::from_floats(*name, plane(k))).collect()
    } else {
        vec![Channel::from_floats("Y", plane(0))]
    };
    let metadata = vec![("bake.map".to_owned(), settings.map.name().to_owned())];
    Image { width: map.size[0], height: map.size[1], channels, metadata }
}
