//! How image files are written: bits, transfer function, compression; the background of pictures.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::{AnimationFormat, ImageFormat};
use crate::error::{Error, Result};
use crate::settings::{AppliesTo, choices, settings};

choices! {
    /// Bits per channel of PNG files.
    pub enum PngBits {
        /// 8 bits
        Eight = "8",
        /// 16 bits
        Sixteen = "16",
    }
}

choices! {
    /// Transfer function of PNG files.
    pub enum PngEncoding {
        /// That of sRGB (chunks sRGB and gAMA 1/2.2)
        Srgb = "srgb",
        /// None: values are proportional to light (chunk gAMA 1)
        Linear = "linear",
    }
}

choices! {
    /// Compression of OpenEXR files.
    pub enum ExrCompression (default Zip) {
        /// No compression
        None = "none",
        /// Run lengths: fast
        Rle = "rle",
        /// Deflate, each row by itself
        Zips = "zips",
        /// Deflate, 16 rows at a time
        Zip = "zip",
        /// Wavelets and Huffman codes: small where images are noisy
        Piz = "piz",
        /// Deflate; 32-bit floats are rounded to 24 bits (lossy), half floats and ids are kept
        Pxr24 = "pxr24",
        /// Blocks of 4x4 half floats at a fixed rate (lossy); other channels are kept
        B44 = "b44",
        /// As b44, with smaller blocks where an image is uniform (lossy)
        B44a = "b44a",
    }
}

/// The background of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Background {
    /// Nothing: the file keeps alpha.
    Transparent,
    /// A linear colour, sRGB primaries, each channel 0 to 1.
    Colour([f32; 3]),
}

impl FromStr for Background {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        const EXPECTED: &str = "expected `transparent`, or a linear colour R,G,B of numbers from 0 to 1";
        if ["transparent", "hidden"].contains(&text.trim()) {
            return Ok(Self::Transparent);
        }
        let values = text.split(',').map(|v| v.trim().parse::<f32>().ok().filter(|v| (0.0..=1.0).contains(v)));
        match values.collect::<Option<Vec<_>>>().as_deref() {
            Some(&[r, g, b]) => Ok(Self::Colour([r, g, b])),
            _ => Err(EXPECTED.into()),
        }
    }
}

impl fmt::Display for Background {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Transparent => f.write_str("transparent"),
            Self::Colour([r, g, b]) => write!(f, "{r},{g},{b}"),
        }
    }
}

impl serde::Serialize for Background {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> serde::Deserialize<'de> for Background {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

settings! {
    /// How image files are written.
    "Files"
    pub struct FileSettings {
        /// Bits per channel of .png outputs [default: 8]
        ///
        /// Of frames in real time, 16 are for --show result.
        png_bits: Option<PngBits>, option(value_enum), applies(AppliesTo::ALL);
        /// Transfer function of .png outputs [default: srgb]
        ///
        /// Linear values need --png-bits 16, or there will be bands. Of frames in real time, linear
        /// is for --show result.
        png_encoding: Option<PngEncoding>, option(value_enum), applies(AppliesTo::ALL);
        /// Quality of .jpg outputs, 1 to 100 [default: 90]
        jpeg_quality: Option<u32>, option(value_name = "Q", value_parser = clap::value_parser!(u32).range(1..=100)), applies(AppliesTo::ALL);
        /// Store colours, alpha, normals and albedo of .exr outputs as 16-bit floats (half)
        ///
        /// Depths, positions, ids, samples and variances keep 32 bits.
        exr_half: bool, option(), applies(AppliesTo::ALL);
        /// Compression of .exr outputs; lossless but for pxr24, b44 and b44a [default: zip]
        exr_compression: Option<ExrCompression>, option(value_enum), applies(AppliesTo::ALL);
    }
}

impl FileSettings {
    /// Quality of JPEG files, 1 to 100.
    pub fn jpeg_quality(&self) -> u8 {
        self.jpeg_quality.unwrap_or(90).clamp(1, 100) as u8
    }

    /// Do they ask for PNG files of other values than 8-bit sRGB?
    pub fn has_deep_png(&self) -> bool {
        self.png_bits.unwrap_or_default() != PngBits::Eight
            || self.png_encoding.unwrap_or_default() != PngEncoding::Srgb
    }

    /// Checks that each setting has an effect on one of these files and fits them all.
    /// `depth_image`: the file of a depth image besides.
    ///
    /// # Errors
    /// [`Error::Usage`], naming the option and what to do about it.
    pub fn check(&self, outputs: &[PathBuf], depth_image: Option<&Path>) -> Result<()> {
        let is = |path: &Path, format: ImageFormat| ImageFormat::from_path(path).is_ok_and(|f| f == format);
        let has = |format: ImageFormat| outputs.iter().any(|p| is(p, format));
        let has_png = has(ImageFormat::Png);
        let has_deep_depth = depth_image.is_some_and(|p| is(p, ImageFormat::Png));

        // each setting has a file that has it
        let given = [
            ("--png-bits", self.png_bits.is_some(), has_png || has_deep_depth, ".png"),
            ("--png-encoding", self.png_encoding.is_some(), has_png, ".png"),
            ("--jpeg-quality", self.jpeg_quality.is_some(), has(ImageFormat::Jpeg), ".jpg"),
            ("--exr-half", self.exr_half, has(ImageFormat::Exr), ".exr"),
            ("--exr-compression", self.exr_compression.is_some(), has(ImageFormat::Exr), ".exr"),
        ];
        if let Some((option, _, _, kind)) = given.iter().find(|(_, is_given, has_effect, _)| *is_given && !has_effect) {
            return Err(Error::Usage(format!(
                "{option} has no effect without a {kind} output: leave it out, or add such an output"
            )));
        }

        // what a format cannot have
        match self.exr_compression {
            Some(compression @ (ExrCompression::B44 | ExrCompression::B44a)) if !self.exr_half => {
                Err(Error::Usage(format!(
                    "--exr-compression {compression} compresses 16-bit floats only: add --exr-half, or choose zip or piz"
                )))
            }
            _ => Ok(()),
        }
    }
}

/// Checks that files can have the background of pictures: JPEG files and some videos lack alpha.
///
/// # Errors
/// [`Error::Usage`], naming the file and what to do about it.
pub fn check_alpha(background: Option<Background>, outputs: &[PathBuf]) -> Result<()> {
    if background != Some(Background::Transparent) {
        return Ok(());
    }
    let is_jpeg = |p: &&PathBuf| ImageFormat::from_path(p).is_ok_and(|f| f == ImageFormat::Jpeg);
    if let Some(jpeg) = outputs.iter().find(is_jpeg) {
        return Err(Error::Usage(format!(
            "--background transparent: {} cannot have alpha; write .png or .webp, or give a colour R,G,B",
            jpeg.display()
        )));
    }
    if let Some(video) = outputs.iter().find(|p| AnimationFormat::from_path(p) == Some(AnimationFormat::Mp4)) {
        return Err(Error::Usage(format!(
            "--background transparent: {} cannot have alpha; write .webm, .apng or .gif, or give a colour R,G,B",
            video.display()
        )));
    }
    Ok(())
}
