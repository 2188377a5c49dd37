//! Decoding of image files.

use std::io::Cursor;

use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use crate::scene::TexelData;

/// Largest width and height.
const MAX_SIDE: u32 = 16384;

/// A decoded image: rows from the top, RGBA.
#[derive(Clone, Debug)]
pub(super) struct DecodedImage {
    pub width: u32,
    pub height: u32,
    pub texels: TexelData,
}

/// Decodes an image of the format that its first bytes show or, for formats without a signature (TGA), that `name` ends in.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn decode(bytes: &[u8], name: &str) -> Result<DecodedImage, String> {
    let format = image::guess_format(bytes)
        .or_else(|_| ImageFormat::from_path(name))
        .map_err(|_| "is of a format that skylit does not read (PNG, JPEG, TGA and BMP are)".to_owned())?;
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE), Some(MAX_SIDE));
    limits.max_alloc = Some(2 << 30);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|e| format!("cannot be decoded: {e}"))?;
    let (width, height) = decoder.dimensions();
    // A one-bit PNG packs at most 8 * 1032 pixels into a byte, every other format fewer: a file that promises more is
    // broken, and believing it would only cost the memory.
    if u64::from(width) * u64::from(height) > 10_000 * bytes.len() as u64 || width == 0 || height == 0 {
        return Err(format!("cannot be decoded: {width}x{height} pixels from {} bytes", bytes.len()));
    }
    let pixels = DynamicImage::from_decoder(decoder).map_err(|e| format!("cannot be decoded: {e}"))?;
    let texels = match pixels.color() {
        ColorType::Rgb32F | ColorType::Rgba32F => {
            let mut rgba = pixels.into_rgba32f().into_raw();
            // a texel that is not finite or negative would spoil every filtered value that includes it
            rgba.iter_mut().filter(|v| !(v.is_finite() && **v >= 0.0)).for_each(|v| *v = 0.0);
            rgba.into()
        }
        ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => {
            let rgba = pixels.into_rgba16().into_raw();
            // 8-bit values that were widened to 16 bits are stored in 8 bits again, without loss
            match rgba.iter().all(|v| v % 257 == 0) {
                true => rgba.iter().map(|v| (v / 257) as u8).collect::<Vec<u8>>().into(),
                false => rgba.into(),
            }
        }
        _ => pixels.into_rgba8().into_raw().into(),
    };
    Ok(DecodedImage { width, height, texels })
}
