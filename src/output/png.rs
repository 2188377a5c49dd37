//! PNG: 8-bit sRGB of images and bytes, and reading of PNG, JPEG and WebP. [`super::picture`] has
//! other bits, encodings and alpha.
//!
//! Channels `R`, `G` and `B` give a colour image; `Y`, or `R` alone, a grey one.

use std::io::{Cursor, Write};
use std::path::Path;

use rayon::prelude::*;

use super::decode::{MaxSize, decode};
use super::picture::Picture;
use super::settings::PngEncoding;
use super::{Channel, Image, ImageFormat, Samples, check_size};
use crate::colour::{srgb_byte, srgb_decode};
use crate::error::{Error, Result};
use crate::files;
use crate::memory::Budget;

/// Metadata of images that were not read as linear values: how they were encoded.
pub const ENCODING: &str = "encoding";

/// Colour type of pixels. Alpha is not premultiplied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Colour {
    Grey,
    GreyAlpha,
    Rgb,
    Rgba,
}

impl Colour {
    pub fn channels(self) -> usize {
        match self {
            Self::Grey => 1,
            Self::GreyAlpha => 2,
            Self::Rgb => 3,
            Self::Rgba => 4,
        }
    }

    /// The same colours with alpha.
    pub fn with_alpha(self) -> Self {
        match self {
            Self::Grey | Self::GreyAlpha => Self::GreyAlpha,
            Self::Rgb | Self::Rgba => Self::Rgba,
        }
    }

    pub fn has_alpha(self) -> bool {
        matches!(self, Self::GreyAlpha | Self::Rgba)
    }

    /// The colour type of PNG files.
    pub(super) fn png(self) -> ::png::ColorType {
        match self {
            Self::Grey => ::png::ColorType::Grayscale,
            Self::GreyAlpha => ::png::ColorType::GrayscaleAlpha,
            Self::Rgb => ::png::ColorType::Rgb,
            Self::Rgba => ::png::ColorType::Rgba,
        }
    }
}

/// Primaries and white of sRGB, times 100000: white, red, green, blue.
const CHROMATICITIES: [(u32, u32); 4] = [(31270, 32900), (64000, 33000), (30000, 60000), (15000, 6000)];

/// Names transfer function and primaries: chunks sRGB, gAMA and cHRM, linear values without sRGB.
pub(super) fn set_encoding<W: Write>(encoder: &mut ::png::Encoder<W>, encoding: PngEncoding) {
    let [white, red, green, blue] =
        CHROMATICITIES.map(|(x, y)| (::png::ScaledFloat::from_scaled(x), ::png::ScaledFloat::from_scaled(y)));
    encoder.set_source_chromaticities(::png::SourceChromaticities { white, red, green, blue });
    match encoding {
        PngEncoding::Srgb => {
            encoder.set_source_gamma(::png::ScaledFloat::from_scaled(45455));
            encoder.set_source_srgb(::png::SrgbRenderingIntent::Perceptual);
        }
        PngEncoding::Linear => encoder.set_source_gamma(::png::ScaledFloat::from_scaled(100_000)),
    }
}

/// The error that an image has no colour.
pub(super) fn no_colour(path: &Path) -> Error {
    Error::Usage(format!(
        "{}: the image has no colour to show as PNG (channels R, G, B or Y); write it as .exr",
        path.display()
    ))
}

/// The colour channels as 8-bit sRGB, brightened by `exposure` stops. Errors name `path`.
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
        Err(no_colour(path))
    }
}

/// Writes the colour channels of an image; `exposure` as in [`bytes_of`].
pub fn write(image: &Image, path: &Path, exposure: f32) -> Result<()> {
    let (bytes, colour) = bytes_of(image, exposure, path)?;
    write_bytes(path, bytes, image.width, image.height, colour)
}

/// Writes 8-bit sRGB values as they are, three for each of `width * height` pixels.
pub fn write_rgb(path: &Path, rgb: &[u8], width: u32, height: u32) -> Result<()> {
    write_bytes(path, rgb.to_vec(), width, height, Colour::Rgb)
}

fn write_bytes(path: &Path, bytes: Vec<u8>, width: u32, height: u32, colour: Colour) -> Result<()> {
    Picture::of_bytes(bytes, [width, height], colour)?.save_png(path)
}

/// The 1-ray depth image: distances as linear grey from white (nearest) to black (farthest and
/// background); a single distance is white. There is no transfer function: grey is a number here.
pub fn depth_to_unit(depth: &[f32]) -> Vec<f32> {
    let seen = |d: &f32| d.is_finite() && *d > 0.0;
    let (near, far) = depth
        .par_iter()
        .copied()
        .filter(seen)
        .fold(|| (f32::INFINITY, 0f32), |(n, f), d| (n.min(d), f.max(d)))
        .reduce(|| (f32::INFINITY, 0f32), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    let range = far - near;
    let grey = |d: f32| if range > 0.0 { (far - d) / range } else { 1.0 };
    depth.par_iter().map(|d| if seen(d) { grey(*d) } else { 0.0 }).collect()
}

/// Does the header of a PNG name no transfer function but 1? False for other bytes.
pub fn is_linear(bytes: &[u8]) -> bool {
    let reader = ::png::Decoder::new(Cursor::new(bytes)).read_info();
    reader.is_ok_and(|r| r.info().gamma().is_some_and(|gamma| gamma.into_scaled().abs_diff(100_000) < 100))
}

/// Reads a PNG, JPEG or WebP file as linear light: `R`, `G`, `B` of a colour image, `Y` of a grey
/// one. Values have sRGB's transfer function, but those of a PNG of gAMA 1. Alpha becomes `A`, and
/// colours are premultiplied with it, as in EXR files.
///
/// # Errors
/// [`Error::Input`], [`Error::Usage`] for the name of another kind of file, [`Error::OutOfMemory`].
pub fn read(path: &Path, budget: &Budget) -> Result<Image> {
    let (name, format) = match ImageFormat::from_path(path)? {
        ImageFormat::Png => ("PNG", image::ImageFormat::Png),
        ImageFormat::Jpeg => ("JPEG", image::ImageFormat::Jpeg),
        ImageFormat::WebP => ("WebP", image::ImageFormat::WebP),
        ImageFormat::Exr => return Err(Error::Usage(format!("{}: not a picture", path.display()))),
    };
    let bytes = files::read(path)?;
    budget.read(bytes.len());
    // channels; and before them pixels as decoded and as floats
    let pixel_bytes = |c: image::ColorType| {
        let channels = 4 * u64::from(c.channel_count());
        [channels, u64::from(c.bytes_per_pixel()) + channels]
    };
    let max = MaxSize { side: 1 << 20, pixels_per_byte: None, budget, pixel_bytes };
    let decoded = decode(&bytes, format, max);
    budget.check().map_err(|e| e.in_file(path))?;
    let decoded = decoded.map_err(|e| Error::input(path, format!("not a readable {name}: {e}")))?;

    // What the file says of its values.
    let is_linear = format == image::ImageFormat::Png && is_linear(&bytes);
    let (width, height) = (decoded.width(), decoded.height());
    check_size(width, height).map_err(|e| Error::input(path, e.to_string()))?;
    let bits = 8 * usize::from(decoded.color().bytes_per_pixel()) / usize::from(decoded.color().channel_count());
    let encoding = if is_linear { "linear" } else { "sRGB" };
    let metadata = vec![(ENCODING.to_owned(), format!("{bits}-bit {encoding}"))];

    // Decodes the colours, and premultiplies them with alpha.
    let linear = |coded: f32| if is_linear { coded } else { srgb_decode(coded) };
    let alpha: Option<Vec<f32>> =
        decoded.color().has_alpha().then(|| decoded.to_rgba32f().pixels().map(|p| p.0[3]).collect());
    let channel = |name: &str, mut samples: Vec<f32>| {
        if let Some(alpha) = &alpha {
            samples.par_iter_mut().zip(alpha).for_each(|(v, a)| *v *= *a);
        }
        Channel { name: name.to_owned(), samples: Samples::F32(samples) }
    };
    let mut channels = if decoded.color().has_color() {
        let pixels = decoded.into_rgb32f().into_raw();
        let plane = |k: usize| pixels.par_chunks(3).map(|p| linear(p[k])).collect::<Vec<_>>();
        vec![channel("R", plane(0)), channel("G", plane(1)), channel("B", plane(2))]
    } else {
        // not into_luma32f(): it may weight what is grey already
        let pixels = decoded.into_luma16().into_raw();
        vec![channel("Y", pixels.par_iter().map(|&v| linear(f32::from(v) / 65535.0)).collect())]
    };
    channels.extend(alpha.map(|alpha| Channel { name: "A".into(), samples: Samples::F32(alpha) }));
    Ok(Image { width, height, channels, metadata })
}
