//! Image files: EXR, pictures (PNG, JPEG, WebP, APNG), Radiance HDR, and frame numbers in names.

pub mod animation;
pub mod apng;
pub mod decode;
pub mod exr;
mod format;
pub mod frames;
mod image;
pub mod layers;
pub mod palette;
pub mod picture;
pub mod png;
pub mod png_text;
pub mod radiance;
pub mod settings;
mod size;
pub mod tone_map;
pub mod video;

use std::path::Path;

pub use self::image::{Channel, Image, Samples};
pub use format::{AnimationFormat, ImageFormat, is_animation};
pub use picture::Picture;
pub use settings::FileSettings;
pub use size::{MAX_PIXELS, check_size, parse_size};

use crate::error::Result;
use crate::files;
use crate::memory::Budget;

/// Writes an image as the extension of the path says: `.exr` (everything), or a picture of the
/// colour channels on black, 8-bit sRGB. On failure a file that was there before is unchanged.
///
/// # Errors
/// [`Error::Usage`] for an unknown extension or an image unfit for the format, [`Error::Output`].
pub fn save(image: &Image, path: &Path) -> Result<()> {
    let settings = FileSettings::default();
    match ImageFormat::from_path(path)? {
        ImageFormat::Exr => exr::write(image, path),
        _ => Picture::new(image, None, &settings, path)?.save(path, settings.jpeg_quality()),
    }
}

/// Reads an image that [`save`] or another program wrote: one of [`ImageFormat`], or a Radiance
/// file (.hdr). Values of pictures become linear.
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
    if files::has_extension(path, "hdr") {
        return radiance::read(path, budget);
    }
    match ImageFormat::from_path(path)? {
        ImageFormat::Exr => exr::read_within(path, budget),
        _ => png::read(path, budget),
    }
}
