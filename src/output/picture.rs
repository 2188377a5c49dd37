//! Pictures: PNG, JPEG and WebP files of the colour channels, with integers of 8 or 16 bits.
//!
//! Colours of an [`Image`] are premultiplied with its alpha; those of PNG and WebP are not.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::codecs::webp::WebPEncoder;
use image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;

use super::png::{self, Colour};
use super::settings::{Background, FileSettings, PngBits, PngEncoding};
use super::{Channel, Image, ImageFormat, Samples, check_size};
use crate::colour::{srgb_byte, srgb_decode, srgb_encode};
use crate::error::{Error, Result};
use crate::files::write_atomically;

const COLOUR: [&str; 4] = ["R", "G", "B", "Y"];

/// Integers of a picture, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    pub width: u32,
    pub height: u32,
    /// Channels of a pixel; alpha is not premultiplied.
    pub colour: Colour,
    pub bits: PngBits,
    /// Transfer function of the colours; alpha has none.
    pub encoding: PngEncoding,
    /// Values, channel by channel and pixel by pixel; those of 16 bits with the high byte first.
    pub bytes: Vec<u8>,
}

/// The colour channels of an image divided by its alpha, 0 where alpha is 0; others stay.
pub fn unassociated(image: &Image) -> Image {
    let mut out = image.clone();
    let Some(alpha) = image.f32("A") else { return out };
    for channel in out.channels.iter_mut().filter(|c| COLOUR.contains(&c.name.as_str())) {
        if let Samples::F32(values) = &mut channel.samples {
            values.par_iter_mut().zip(alpha).for_each(|(v, a)| *v = if *a > 0.0 { *v / *a } else { 0.0 });
        }
    }
    out
}

/// A value between 0 and 1. NaN is black, so that it can be seen on a bright image.
fn clamped(value: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) }
}

impl Picture {
    /// A picture of an image's colours (not premultiplied, clamped to 0 to 1) on a background or
    /// with alpha. Without a `background` alpha is ignored. `path` is what an error names.
    ///
    /// # Errors
    /// [`Error::Usage`] for an image without colour.
    pub fn new(image: &Image, background: Option<Background>, settings: &FileSettings, path: &Path) -> Result<Self> {
        image.check()?;
        check_size(image.width, image.height)?;
        let (bits, encoding) = (settings.png_bits.unwrap_or_default(), settings.png_encoding.unwrap_or_default());
        let mut planes: Vec<&[f32]> = match (image.f32("R"), image.f32("G"), image.f32("B")) {
            (Some(r), Some(g), Some(b)) => vec![r, g, b],
            _ => vec![image.f32("Y").or_else(|| image.f32("R")).ok_or_else(|| png::no_colour(path))?],
        };
        let opaque = vec![1.0; if background.is_some() && image.f32("A").is_none() { image.pixel_count() } else { 0 }];
        let alpha = image.f32("A").unwrap_or(&opaque);
        let colour = match (background, planes.len()) {
            (Some(Background::Transparent), 1) => Colour::GreyAlpha,
            (Some(Background::Transparent), _) => Colour::Rgba,
            (Some(Background::Colour([r, g, b])), 1) if r != g || g != b => {
                planes = vec![planes[0]; 3];
                Colour::Rgb
            }
            (_, 1) => Colour::Grey,
            _ => Colour::Rgb,
        };

        // Composites and encodes the value of a channel of a pixel.
        let value = |c: usize, p: usize| -> f32 {
            let linear = || clamped(planes[c][p]);
            let coded = |v: f32| if encoding == PngEncoding::Srgb { srgb_encode(v) } else { v };
            match background {
                _ if c == planes.len() => clamped(alpha[p]),
                Some(Background::Colour(behind)) => {
                    let a = clamped(alpha[p]);
                    coded(clamped(linear() * a + behind[c] * (1.0 - a)))
                }
                Some(Background::Transparent) | None => coded(linear()),
            }
        };

        // Quantizes.
        let (channels, size) = (colour.channels(), bits.bytes());
        let mut bytes = vec![0; image.pixel_count() * channels * size];
        bytes.par_chunks_mut(channels * size).enumerate().with_min_len(1024).for_each(|(p, pixel)| {
            for (c, out) in pixel.chunks_mut(size).enumerate() {
                match bits {
                    PngBits::Eight => out[0] = (value(c, p) * 255.0).round() as u8,
                    PngBits::Sixteen => out.copy_from_slice(&((value(c, p) * 65535.0).round() as u16).to_be_bytes()),
                }
            }
        });
        Ok(Self { width: image.width, height: image.height, colour, bits, encoding, bytes })
    }

    /// A picture of 8-bit sRGB values as they are, `colour.channels()` a pixel.
    ///
    /// # Errors
    /// [`Error::Usage`] for another number of values than `width * height` pixels have.
    pub fn of_bytes(bytes: Vec<u8>, [width, height]: [u32; 2], colour: Colour) -> Result<Self> {
        check_size(width, height)?;
        if bytes.len() as u64 != u64::from(width) * u64::from(height) * colour.channels() as u64 {
            return Err(Error::Usage(format!("{} values for {width}x{height} {colour:?} pixels", bytes.len())));
        }
        Ok(Self { width, height, colour, bits: PngBits::Eight, encoding: PngEncoding::Srgb, bytes })
    }

    /// This opaque picture of a scene on black, on a background, by the scene's `coverage` of
    /// pixels.
    ///
    /// # Errors
    /// [`Error::Usage`] for coverage of another number of pixels.
    pub fn on(self, background: Background, coverage: &[f32]) -> Result<Self> {
        let pixels = self.width as usize * self.height as usize;
        if coverage.len() != pixels || self.bits != PngBits::Eight || self.encoding != PngEncoding::Srgb {
            return Err(Error::Usage(format!("coverage of {} pixels for a picture of {pixels}", coverage.len())));
        }

        // Chooses the channels that the background needs.
        let own = self.colour.channels();
        let behind = match background {
            Background::Transparent => [0.0; 3],
            Background::Colour(colour) => colour,
        };
        let is_grey = own == 1 && behind[0] == behind[1] && behind[1] == behind[2];
        let is_transparent = background == Background::Transparent;
        let colour = match (is_grey, is_transparent) {
            (true, true) => Colour::GreyAlpha,
            (true, false) => Colour::Grey,
            (false, true) => Colour::Rgba,
            (false, false) => Colour::Rgb,
        };

        // Composites in linear light, pixel by pixel.
        let mut bytes = Vec::with_capacity(pixels * colour.channels());
        for (pixel, &covered) in self.bytes.chunks_exact(own).zip(coverage) {
            let covered = clamped(covered);
            let value = |c: usize| -> u8 {
                let byte = pixel[c.min(own - 1)];
                // as it is: decoding could round it to another one
                if covered >= 1.0 {
                    return byte;
                }
                let on_black = srgb_decode(f32::from(byte) / 255.0);
                if !is_transparent {
                    srgb_byte(on_black.min(covered) + behind[c] * (1.0 - covered))
                } else if covered > 0.0 {
                    srgb_byte((on_black / covered).min(1.0))
                } else {
                    0
                }
            };
            bytes.extend((0..if is_grey { 1 } else { 3 }).map(value));
            bytes.extend(is_transparent.then_some((255.0 * covered).round() as u8));
        }
        Ok(Self { colour, bytes, ..self })
    }

    /// Writes the file in the format of its extension. JPEG and WebP have 8-bit sRGB.
    ///
    /// # Errors
    /// [`Error::Usage`] for a format that is unfit for these values; [`Error::Output`].
    pub fn save(&self, path: &Path, jpeg_quality: u8) -> Result<()> {
        let format = ImageFormat::from_path(path)?;
        let wrong = |what: &str| Err(Error::Usage(format!("{}: {what}", path.display())));
        if format == ImageFormat::Png {
            return self.save_png(path);
        }
        if self.bits != PngBits::Eight || self.encoding != PngEncoding::Srgb {
            return wrong("this format has 8-bit sRGB only; write a .png");
        }

        // Refuses what the format cannot have.
        let colour = match self.colour {
            Colour::Grey => ExtendedColorType::L8,
            Colour::GreyAlpha => ExtendedColorType::La8,
            Colour::Rgb => ExtendedColorType::Rgb8,
            Colour::Rgba => ExtendedColorType::Rgba8,
        };
        match format {
            ImageFormat::Exr | ImageFormat::Png => {
                return wrong("not a picture: the name must end in .png, .jpg or .webp");
            }
            ImageFormat::Jpeg if self.colour.has_alpha() => return wrong("JPEG has no alpha; write a .png or .webp"),
            ImageFormat::Jpeg if self.width > u16::MAX.into() || self.height > u16::MAX.into() => {
                return wrong("JPEG has sides of up to 65535 pixels; write a .png");
            }
            ImageFormat::WebP if self.width > WEBP_SIDE || self.height > WEBP_SIDE => {
                return wrong("WebP has sides of up to 16384 pixels; write a .png");
            }
            ImageFormat::Jpeg | ImageFormat::WebP => {}
        }
        write_atomically(path, |file| {
            let mut out = BufWriter::with_capacity(1 << 16, file);

            // Encodes, and passes errors of the file on as they are.
            let written = match format {
                ImageFormat::Jpeg => JpegEncoder::new_with_quality(&mut out, jpeg_quality).write_image(
                    &self.bytes,
                    self.width,
                    self.height,
                    colour,
                ),
                ImageFormat::WebP => {
                    WebPEncoder::new_lossless(&mut out).write_image(&self.bytes, self.width, self.height, colour)
                }
                ImageFormat::Exr | ImageFormat::Png => unreachable!("they were written or refused above"),
            };
            written.map_err(|e| match e {
                image::ImageError::IoError(e) => e,
                e => io::Error::other(e.to_string()),
            })?;
            out.flush()
        })
    }

    /// Writes a PNG that names its transfer function and primaries.
    pub(super) fn save_png(&self, path: &Path) -> Result<()> {
        write_atomically(path, |file| {
            let mut out = BufWriter::with_capacity(1 << 16, file);
            let mut encoder = ::png::Encoder::new(&mut out, self.width, self.height);
            encoder.set_color(self.colour.png());
            encoder.set_depth(match self.bits {
                PngBits::Eight => ::png::BitDepth::Eight,
                PngBits::Sixteen => ::png::BitDepth::Sixteen,
            });
            png::set_encoding(&mut encoder, self.encoding);
            encoder.set_compression(::png::Compression::Fast);
            let mut writer = encoder.write_header().map_err(super::apng::reason)?;
            writer.write_image_data(&self.bytes).map_err(super::apng::reason)?;
            writer.finish().map_err(super::apng::reason)?;
            out.flush()
        })
    }
}

/// Longest side of a WebP file, pixels.
const WEBP_SIDE: u32 = 16384;

impl PngBits {
    pub fn bytes(self) -> usize {
        match self {
            Self::Eight => 1,
            Self::Sixteen => 2,
        }
    }
}

/// A grey image of these values, for [`Picture::new`].
pub fn grey_image(values: Vec<f32>, [width, height]: [u32; 2]) -> Image {
    let channels = vec![Channel { name: "Y".into(), samples: Samples::F32(values) }];
    Image { width, height, channels, metadata: Vec::new() }
}
