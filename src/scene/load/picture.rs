//! Decoding of image files.

use std::path::Path;

use image::{ColorType, ImageFormat};

use crate::error::{Error, Result};
use crate::files::{self, placeholder};
use crate::memory::Budget;
use crate::output::decode::{self, MaxSize};
use crate::output::radiance::{self, RadianceImage};
#[cfg(feature = "dds")]
use crate::scene::load::dds;
#[cfg(feature = "ktx2")]
use crate::scene::load::ktx2;
use crate::scene::texture::{Filter, Wrap};
use crate::scene::{TexelData, Texture};

/// Largest width and height.
pub(super) const MAX_SIDE: u32 = 16384;

/// A decoded image: rows from the top, RGBA.
#[derive(Clone, Debug)]
pub(super) struct DecodedImage {
    pub width: u32,
    pub height: u32,
    pub texels: TexelData,
}

/// Reads an image of a format that textures of scenes have, with values as they are stored.
///
/// # Errors
/// [`Error::Input`] and [`Error::OutOfMemory`].
pub fn load_texture(path: &Path) -> Result<Texture> {
    let (bytes, budget) = (files::read(path)?, Budget::default());
    budget.read(bytes.len());
    let decoded = decode(&bytes, &path.to_string_lossy(), &budget);
    budget.check().map_err(|e| e.in_file(path))?;
    let DecodedImage { width, height, texels } = decoded.map_err(|e| Error::input(path, e))?;
    let name = path.to_string_lossy().into_owned();
    Ok(Texture { name, width, height, texels, wrap: [Wrap::Repeat; 2], filter: Filter::Linear })
}

/// Bytes of a texel of this kind, and of what it is made of: the decoder's pixel, and four channels
/// before they are shared.
fn texel_bytes(color: ColorType) -> [u64; 2] {
    let pixel = u64::from(color.bytes_per_pixel());
    let texel = 4 * pixel / u64::from(color.channel_count().max(1));
    [texel, pixel + texel]
}

/// Decodes an image of the format that its first bytes show or, for formats without a signature
/// (TGA), that `name` ends in.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn decode(bytes: &[u8], name: &str, budget: &Budget) -> Result<DecodedImage, String> {
    if let Some(message) = placeholder(bytes) {
        return Err(message.to_owned());
    }

    // formats that the crate image does not have
    #[cfg(feature = "ktx2")]
    if ktx2::is_ktx2(bytes) {
        return ktx2::decode(bytes, budget);
    }
    #[cfg(feature = "dds")]
    if dds::is_dds(bytes) {
        return dds::decode(bytes, budget);
    }
    if radiance::is_radiance(bytes) {
        let RadianceImage { width, height, rgb } = radiance::decode(bytes.to_vec(), MAX_SIDE, budget)?;
        let finite = |v: f32| if v.is_finite() { v } else { 0.0 };
        let texels =
            rgb.into_iter().flat_map(|[r, g, b]| [finite(r), finite(g), finite(b), 1.0]).collect::<Vec<f32>>().into();
        return Ok(DecodedImage { width, height, texels });
    }

    // the others, whose size is checked before they are decoded
    let format = image::guess_format(bytes).or_else(|_| ImageFormat::from_path(name)).map_err(|_| {
        "is of a format that skylit does not read (PNG, JPEG, WebP, KTX2, DDS, TGA and BMP are)".to_owned()
    })?;
    // a one-bit PNG packs at most 8 * 1032 pixels into a byte, every other format fewer
    let max = MaxSize { side: MAX_SIDE, pixels_per_byte: Some(10_000), budget, pixel_bytes: texel_bytes };
    let pixels = decode::decode(bytes, format, max)?;
    let (width, height) = (pixels.width(), pixels.height());

    // four channels of what the file has
    let texels = match pixels.color() {
        ColorType::Rgb32F | ColorType::Rgba32F => {
            let mut rgba = pixels.into_rgba32f().into_raw();
            // a texel that is not finite or negative would spoil every filtered value that includes
            // it
            rgba.iter_mut().filter(|v| !(v.is_finite() && **v >= 0.0)).for_each(|v| *v = 0.0);
            rgba.into()
        }
        ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => {
            let rgba = pixels.into_rgba16().into_raw();
            // 8-bit values that were widened to 16 bits are stored in 8 bits again, without loss
            if rgba.iter().all(|v| v % 257 == 0) {
                rgba.iter().map(|v| (v / 257) as u8).collect::<Vec<u8>>().into()
            } else {
                rgba.into()
            }
        }
        _ => pixels.into_rgba8().into_raw().into(),
    };
    Ok(DecodedImage { width, height, texels })
}
