//! Environments from images: Radiance HDR and OpenEXR, in equirectangular projection.

use std::path::Path;

use glam::{DMat3, Vec3};
use image::{ImageFormat, ImageReader, Limits};

use crate::error::{Error, Result};
use crate::output::exr;
use crate::scene::EnvironmentMap;

/// Largest width and height.
const MAX_SIDE: u32 = 16384;

/// Reads an environment. Colours are linear with sRGB primaries; values that are negative count as 0.
///
/// # Errors
/// [`Error::Input`] naming the file when it cannot be read or decoded, or holds values that are not finite.
pub fn load_environment(path: &Path) -> Result<EnvironmentMap> {
    let bad = |what: String| Error::input(path, what);
    let exr = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
    let (width, height, radiance) = if exr { read_exr(path)? } else { read_hdr(path)? };
    if let Some(k) = radiance.iter().position(|c| !c.is_finite()) {
        let (x, y) = (k as u32 % width, k as u32 / width);
        return Err(bad(format!("pixel {x}, {y} is not finite: an environment must be")));
    }
    Ok(EnvironmentMap {
        name: path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
        width,
        height,
        radiance: radiance.into_iter().map(|c| c.max(Vec3::ZERO)).collect(),
        factor: Vec3::ONE,
        to_map: DMat3::IDENTITY,
    })
}

fn read_hdr(path: &Path) -> Result<(u32, u32, Vec<Vec3>)> {
    let bytes = std::fs::read(path).map_err(|e| Error::read(path, &e))?;
    let bad =
        |e: image::ImageError| Error::input(path, format!("cannot be decoded as Radiance HDR (.exr and .hdr are read): {e}"));
    let mut reader = ImageReader::with_format(std::io::Cursor::new(bytes), ImageFormat::Hdr);
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE), Some(MAX_SIDE));
    limits.max_alloc = Some(4 << 30);
    reader.limits(limits);
    let image = reader.decode().map_err(bad)?.into_rgb32f();
    Ok((image.width(), image.height(), image.pixels().map(|p| Vec3::from_array(p.0)).collect()))
}

fn read_exr(path: &Path) -> Result<(u32, u32, Vec<Vec3>)> {
    let image = exr::read(path)?;
    if image.width > MAX_SIDE || image.height > MAX_SIDE {
        return Err(Error::input(path, format!("is larger than {MAX_SIDE} pixels")));
    }
    let plane = |name: &str| {
        image.f32(name).ok_or_else(|| Error::input(path, format!("has no channel {name} of floats: R, G and B are needed")))
    };
    let [r, g, b] = [plane("R")?, plane("G")?, plane("B")?];
    Ok((image.width, image.height, (0..r.len()).map(|k| Vec3::new(r[k], g[k], b[k])).collect()))
}
