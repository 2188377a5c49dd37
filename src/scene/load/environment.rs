//! Environments from images: Radiance HDR and OpenEXR in equirectangular projection, or the six faces of a cube.

mod cube;

use std::path::Path;
use std::sync::Arc;

use glam::{DMat3, Vec3};
use image::{ImageFormat, ImageReader, Limits};

use crate::error::{Error, Result};
use crate::output::exr;
use crate::scene::EnvironmentMap;

/// Largest width and height.
const MAX_SIDE: u32 = 16384;

/// Rows from the top, linear.
struct Pixels {
    width: u32,
    height: u32,
    /// What a map keeps, so that nothing is copied: a map of 16384x8192 has 1.6 GB.
    radiance: Arc<[Vec3]>,
}

/// Reads an environment: an equirectangular image, or a folder that holds the faces of a cube as `px`, `nx`, `py`, `ny`, `pz`, `nz` (.hdr, .exr, .png, .jpg). Colours
/// are linear with sRGB primaries (those of .png and .jpg are decoded); values that are negative count as 0.
///
/// # Errors
/// [`Error::Input`] naming the file when it cannot be read or decoded, or holds values that are not finite.
pub fn load_environment(path: &Path) -> Result<EnvironmentMap> {
    let Pixels { width, height, radiance } = if path.is_dir() { cube::read(path)? } else { read(path)? };
    Ok(EnvironmentMap {
        name: path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default(),
        width,
        height,
        radiance,
        factor: Vec3::ONE,
        to_map: DMat3::IDENTITY,
    })
}

/// One image.
fn read(path: &Path) -> Result<Pixels> {
    let is = |extension: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
    let mut pixels = if is("exr") { read_exr(path)? } else { read_hdr(path)? };
    if let Some(k) = pixels.radiance.iter().position(|c| !c.is_finite()) {
        let (x, y) = (k as u32 % pixels.width, k as u32 / pixels.width);
        return Err(Error::input(path, format!("pixel {x}, {y} is not finite: an environment must be")));
    }
    if pixels.radiance.iter().any(|c| c.min_element() < 0.0) {
        pixels.radiance = pixels.radiance.iter().map(|c| c.max(Vec3::ZERO)).collect();
    }
    Ok(pixels)
}

fn read_hdr(path: &Path) -> Result<Pixels> {
    let bytes = std::fs::read(path).map_err(|e| Error::read(path, &e))?;
    let bad =
        |e: image::ImageError| Error::input(path, format!("cannot be decoded as Radiance HDR (.exr and .hdr are read): {e}"));
    let mut reader = ImageReader::with_format(std::io::Cursor::new(bytes), ImageFormat::Hdr);
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE), Some(MAX_SIDE));
    limits.max_alloc = Some(4 << 30);
    reader.limits(limits);
    let image = reader.decode().map_err(bad)?.into_rgb32f();
    let (width, height) = image.dimensions();
    let radiance = image.into_raw().chunks_exact(3).map(Vec3::from_slice).collect();
    Ok(Pixels { width, height, radiance })
}

fn read_exr(path: &Path) -> Result<Pixels> {
    let image = exr::read(path)?;
    if image.width > MAX_SIDE || image.height > MAX_SIDE {
        return Err(Error::input(path, format!("is larger than {MAX_SIDE} pixels")));
    }
    let plane = |name: &str| {
        image.f32(name).ok_or_else(|| Error::input(path, format!("has no channel {name} of floats: R, G and B are needed")))
    };
    let [r, g, b] = [plane("R")?, plane("G")?, plane("B")?];
    let radiance = (0..r.len()).map(|k| Vec3::new(r[k], g[k], b[k])).collect();
    Ok(Pixels { width: image.width, height: image.height, radiance })
}
