//! Image files: EXR with named float channels, pictures (PNG, JPEG, WebP, APNG), Radiance HDR, and frame numbers in file names.

pub mod apng;
pub mod decode;
pub mod exr;
pub mod frames;
pub mod palette;
pub mod picture;
pub mod png;
pub mod png_text;
pub mod radiance;
pub mod settings;
pub mod tone_map;

use std::path::Path;

use crate::error::{Error, Result};
use crate::memory::Budget;
use crate::settings::parse::Parsed;
pub use picture::Picture;
pub use settings::FileSettings;

/// Maximum number of pixels of an image: 16384 x 16384. More would overflow the 32-bit indices of the tracers.
pub const MAX_PIXELS: u64 = 1 << 28;

/// Samples of one channel, rows from the top, `width * height` of them.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// 32-bit floats.
    F32(Vec<f32>),
    /// 32-bit unsigned integers (ids).
    U32(Vec<u32>),
}

impl Samples {
    /// Number of samples.
    pub fn len(&self) -> usize {
        match self {
            Samples::F32(s) => s.len(),
            Samples::U32(s) => s.len(),
        }
    }

    /// Is it empty?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A named channel of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name as EXR has it: `R`, `A`, `variance`, `depth.Z`, `position.X`, ...
    pub name: String,
    /// Its samples.
    pub samples: Samples,
}

/// An image with named channels, linear values, and text metadata on how it was rendered.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Channels; the names are distinct.
    pub channels: Vec<Channel>,
    /// Key and value of each metadata entry (scene, camera, spp, tracer, device, version, ...).
    pub metadata: Vec<(String, String)>,
}

impl Image {
    /// The float samples of the channel called `name`.
    pub fn f32(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|c| c.name == name).and_then(|c| match &c.samples {
            Samples::F32(s) => Some(s.as_slice()),
            Samples::U32(_) => None,
        })
    }

    /// `width * height`.
    pub fn pixel_count(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The value of a metadata entry.
    pub fn metadata(&self, key: &str) -> Option<&str> {
        self.metadata.iter().find(|(k, _)| k == key).map(|(_, v)| v.as_str())
    }

    /// Does every channel have as many samples as there are pixels, and each a name of its own? Writers rely on it.
    fn check(&self) -> Result<()> {
        let bad = |what: String| Err(Error::Usage(what));
        if self.pixel_count() == 0 || self.channels.is_empty() {
            return bad(format!("an image of {} x {} pixels and {} channels", self.width, self.height, self.channels.len()));
        }
        for (i, c) in self.channels.iter().enumerate() {
            if c.samples.len() != self.pixel_count() {
                return bad(format!("channel {:?} has {} samples for {} pixels", c.name, c.samples.len(), self.pixel_count()));
            }
            // 255 is the limit of the EXR format
            if c.name.is_empty() || c.name.len() > 255 || self.channels[..i].iter().any(|d| d.name == c.name) {
                return bad(format!("channel name {:?} is empty, too long or used twice", c.name));
            }
        }
        Ok(())
    }
}

/// A kind of image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    /// OpenEXR: every channel, metadata.
    Exr,
    /// PNG: the colour channels, 8 or 16 bits.
    Png,
    /// JPEG: the colour channels, 8-bit sRGB, lossy.
    Jpeg,
    /// WebP: the colour channels, 8-bit sRGB, lossless.
    WebP,
}

impl ImageFormat {
    /// The kind that the extension of `path` names.
    ///
    /// # Errors
    /// [`Error::Usage`] for an extension of another kind.
    pub fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("exr") => Ok(Self::Exr),
            Some("png") => Ok(Self::Png),
            Some("jpg" | "jpeg") => Ok(Self::Jpeg),
            Some("webp") => Ok(Self::WebP),
            _ => Err(Error::Usage(format!(
                "{}: unknown kind of image: the name must end in .exr, .png, .jpg or .webp",
                path.display()
            ))),
        }
    }

    /// Does it hold integers of what a display shows, and nothing else?
    pub fn is_picture(self) -> bool {
        self != Self::Exr
    }
}

/// Writes an image, as the extension of the path says: `.exr` (everything), or a picture of the colour channels on black, 8-bit sRGB. On failure
/// nothing is left behind, and a file that was there before is unchanged.
///
/// # Errors
/// [`Error::Usage`] for an unknown extension or an image that the format cannot have, [`Error::Output`].
pub fn save(image: &Image, path: &Path) -> Result<()> {
    let settings = FileSettings::default();
    match ImageFormat::of(path)? {
        ImageFormat::Exr => exr::write(image, path),
        _ => Picture::new(image, None, &settings, path)?.save(path, settings.jpeg_quality()),
    }
}

/// Reads an image that [`save`] or another program wrote. Values of pictures become linear.
///
/// # Errors
/// [`Error::Usage`] for an unknown extension, [`Error::Input`].
pub fn load(path: &Path) -> Result<Image> {
    load_within(path, &Budget::default())
}

/// As [`load`], with memory of a budget that images which are read together share.
///
/// # Errors
/// Those of [`load`], and [`Error::OutOfMemory`] for more than the budget has.
pub fn load_within(path: &Path, budget: &Budget) -> Result<Image> {
    match ImageFormat::of(path)? {
        ImageFormat::Exr => exr::read_within(path, budget),
        _ => png::read(path, budget),
    }
}

/// Parses an image size `WxH` in pixels.
pub fn parse_size(text: &str) -> Parsed<[u32; 2]> {
    let side = |s: &str| s.trim().parse::<u32>().map_err(|_| "expected WIDTHxHEIGHT in pixels, like 1280x720".to_owned());
    let (w, h) = text.split_once(['x', 'X']).ok_or("expected WIDTHxHEIGHT in pixels, like 1280x720")?;
    let size = [side(w)?, side(h)?];
    check_size(size[0], size[1]).map_err(|e| e.to_string())?;
    Ok(size)
}

/// Refuses image sizes of zero or more than [`MAX_PIXELS`] pixels.
pub fn check_size(width: u32, height: u32) -> Result<()> {
    if width == 0 || height == 0 {
        return Err(Error::Usage(format!("image size {width}x{height}: both sides must be at least 1")));
    }
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(Error::Usage(format!(
            "image size {width}x{height}: more than {MAX_PIXELS} pixels (16384x16384 is the most)"
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(parse_size("1x1"), Ok([1, 1]));
        assert_eq!(parse_size("16384x16384"), Ok([16384, 16384]));
        for bad in ["0x5", "5x0", "16385x16384", "5", "x", "-1x5", "1x2x3", "4294967296x1", ""] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
    }
}
