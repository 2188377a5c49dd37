//! PNG: 8-bit sRGB, for previews.
//!
//! Channels `R`, `G` and `B` give a colour image; `Y`, or `R` alone, a grey one. Other channels (alpha, depth, ids)
//! and the metadata are left out: EXR keeps them.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Write};
use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;

use super::{Channel, Image, Samples, check_size};
use crate::colour::{srgb_byte, srgb_decode};
use crate::error::{Error, Result};
use crate::files::write_atomically;

/// Metadata of images that were not read as linear values: how they were encoded.
pub const ENCODING: &str = "encoding";

/// Colour type of 8-bit pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colour {
    /// One byte a pixel.
    Grey,
    /// Red, green and blue.
    Rgb,
}

impl Colour {
    /// Bytes a pixel.
    pub fn channels(self) -> usize {
        match self {
            Self::Grey => 1,
            Self::Rgb => 3,
        }
    }
}

/// The colour channels of an image as 8-bit sRGB, brightened by `exposure` stops (0 = as they are, 1 = twice as bright).
/// `path` is what an error names.
pub fn bytes_of(image: &Image, exposure: f32, path: &Path) -> Result<(Vec<u8>, Colour)> {
    image.check()?;
    check_size(image.width, image.height)?;
    let gain = exposure.exp2();
    if let (Some(r), Some(g), Some(b)) = (image.f32("R"), image.f32("G"), image.f32("B")) {
        let mut bytes = vec![0; image.pixel_count() * 3];
        bytes.par_chunks_mut(3).enumerate().with_min_len(1024).for_each(|(i, p)| {
            p[0] = srgb_byte(r[i] * gain);
            p[1] = srgb_byte(g[i] * gain);
            p[2] = srgb_byte(b[i] * gain);
        });
        Ok((bytes, Colour::Rgb))
    } else if let Some(y) = image.f32("Y").or_else(|| image.f32("R")) {
        Ok((y.par_iter().with_min_len(1024).map(|v| srgb_byte(v * gain)).collect(), Colour::Grey))
    } else {
        Err(Error::Usage(format!(
            "{}: the image has no colour to show as PNG (channels R, G, B or Y); write it as .exr",
            path.display()
        )))
    }
}

/// Writes the colour channels of an image; `exposure` as in [`bytes_of`].
pub fn write(image: &Image, path: &Path, exposure: f32) -> Result<()> {
    let (bytes, colour) = bytes_of(image, exposure, path)?;
    write_bytes(path, &bytes, image.width, image.height, colour)
}

/// Writes 8-bit grey values as they are, `width * height` of them.
pub fn write_grey(path: &Path, grey: &[u8], width: u32, height: u32) -> Result<()> {
    check_size(width, height)?;
    if grey.len() as u64 != u64::from(width) * u64::from(height) {
        return Err(Error::Usage(format!("{} grey values for {width}x{height} pixels", grey.len())));
    }
    write_bytes(path, grey, width, height, Colour::Grey)
}

/// Writes 8-bit sRGB values as they are, three for each of `width * height` pixels.
pub fn write_rgb(path: &Path, rgb: &[u8], width: u32, height: u32) -> Result<()> {
    check_size(width, height)?;
    if rgb.len() as u64 != 3 * u64::from(width) * u64::from(height) {
        return Err(Error::Usage(format!("{} colour values for {width}x{height} pixels", rgb.len())));
    }
    write_bytes(path, rgb, width, height, Colour::Rgb)
}

fn write_bytes(path: &Path, bytes: &[u8], width: u32, height: u32, colour: Colour) -> Result<()> {
    let colour = match colour {
        Colour::Grey => ExtendedColorType::L8,
        Colour::Rgb => ExtendedColorType::Rgb8,
    };
    write_atomically(path, |file| {
        let mut out = BufWriter::with_capacity(1 << 16, file);
        PngEncoder::new_with_quality(&mut out, CompressionType::Fast, FilterType::Adaptive)
            .write_image(bytes, width, height, colour)
            .map_err(|e| match e {
                image::ImageError::IoError(e) => e,
                e => io::Error::other(e.to_string()),
            })?;
        out.flush()
    })
}

/// The 1-ray depth image: distances along the view to 8-bit grey, nearest = white, farthest = black, linear in between over
/// the range that occurs. Background (a distance that is not finite, or not above 0) is black. A single distance
/// everywhere is white. No transfer function: the grey is a number to read off, not light.
pub fn depth_to_grey(depth: &[f32]) -> Vec<u8> {
    let seen = |d: &f32| d.is_finite() && *d > 0.0;
    let (near, far) = depth
        .par_iter()
        .copied()
        .filter(seen)
        .fold(|| (f32::INFINITY, 0f32), |(n, f), d| (n.min(d), f.max(d)))
        .reduce(|| (f32::INFINITY, 0f32), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    let range = far - near;
    let grey = |d: f32| if range > 0.0 { ((far - d) / range * 255.0).round() as u8 } else { 255 };
    depth.par_iter().map(|d| if seen(d) { grey(*d) } else { 0 }).collect()
}

/// Reads a PNG as linear light: channels `R`, `G`, `B` of a colour image, `Y` of a grey one; alpha is dropped.
pub fn read(path: &Path) -> Result<Image> {
    let file = File::open(path).map_err(|e| Error::read(path, &e))?;
    let broken = |e: image::ImageError| match e {
        image::ImageError::IoError(e) => Error::read(path, &e),
        e => Error::input(path, format!("not a readable PNG: {e}")),
    };
    let mut reader = image::ImageReader::with_format(BufReader::new(file), image::ImageFormat::Png);
    let mut limits = image::Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(1 << 20), Some(1 << 20));
    limits.max_alloc = Some(super::MAX_PIXELS * 8);
    reader.limits(limits);
    let decoded = reader.decode().map_err(broken)?;
    let (width, height) = (decoded.width(), decoded.height());
    check_size(width, height).map_err(|e| Error::input(path, e.to_string()))?;
    let channel = |name: &str, samples: Vec<f32>| Channel { name: name.to_owned(), samples: Samples::F32(samples) };
    let channels = if decoded.color().has_color() {
        let pixels = decoded.into_rgb32f().into_raw();
        let plane = |k: usize| pixels.par_chunks(3).map(|p| srgb_decode(p[k])).collect::<Vec<_>>();
        vec![channel("R", plane(0)), channel("G", plane(1)), channel("B", plane(2))]
    } else {
        // not into_luma32f(): it may weight what is grey already
        let pixels = decoded.into_luma16().into_raw();
        vec![channel("Y", pixels.par_iter().map(|&v| srgb_decode(f32::from(v) / 65535.0)).collect())]
    };
    let metadata = vec![(ENCODING.to_owned(), "8-bit sRGB".to_owned())];
    Ok(Image { width, height, channels, metadata })
}
