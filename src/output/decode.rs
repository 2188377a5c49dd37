//! Decoding with the crate image, and detection of files that end early, which it takes for whole.

use std::io::{Cursor, ErrorKind};

use image::{ColorType, DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use crate::memory::Budget;

/// The message for a file that ends before its image does.
pub(super) const ENDS_EARLY: &str = "ends early: it was cut off";

#[derive(Clone, Copy, Debug)]
pub struct MaxSize<'a> {
    pub side: u32,
    /// Pixels for each byte of the file at most, or any number; more are in broken files.
    pub pixels_per_byte: Option<u64>,
    pub budget: &'a Budget,
    /// Bytes of a pixel of this kind: those kept, and those needed besides while decoding.
    pub pixel_bytes: fn(ColorType) -> [u64; 2],
}

/// Decodes the bytes of an image file.
///
/// # Errors
/// What is wrong with the file, as the end of a sentence.
pub fn decode(bytes: &[u8], format: ImageFormat, max: MaxSize) -> Result<DynamicImage, String> {
    if format == ImageFormat::WebP && is_webp_cut_off(bytes) {
        return Err(ENDS_EARLY.to_owned());
    }
    // decoders say many things of a file that ends in its header
    let image = decode_as_is(bytes, format, max)
        .map_err(|e| if lacks_end(bytes, format) { ENDS_EARLY.to_owned() } else { e })?;
    let again = |bytes: &[u8]| decode_as_is(bytes, format, max).ok();
    if format == ImageFormat::Jpeg && is_jpeg_cut_off(bytes, again) {
        return Err(ENDS_EARLY.to_owned());
    }
    Ok(image)
}

fn decode_as_is(bytes: &[u8], format: ImageFormat, max: MaxSize) -> Result<DynamicImage, String> {
    let wrong = |e: ImageError| match e {
        ImageError::IoError(e) if e.kind() == ErrorKind::UnexpectedEof => ENDS_EARLY.to_owned(),
        e => format!("cannot be decoded: {e}"),
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(max.side), Some(max.side));
    // the budget says it better
    limits.max_alloc = None;
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(wrong)?;
    let (width, height) = decoder.dimensions();
    let pixels = u64::from(width) * u64::from(height);
    if pixels == 0 || max.pixels_per_byte.is_some_and(|most| pixels > most * bytes.len() as u64) {
        return Err(format!("cannot be decoded: {width}x{height} pixels from {} bytes", bytes.len()));
    }
    let [kept, besides] = (max.pixel_bytes)(decoder.color_type()).map(|bytes| pixels * bytes);
    max.budget.take_for_now(kept, besides, || format!("an image of {width}x{height} pixels"))?;
    DynamicImage::from_decoder(decoder).map_err(wrong)
}

/// Whether a file lacks what ends all files of its format.
fn lacks_end(bytes: &[u8], format: ImageFormat) -> bool {
    match format {
        ImageFormat::Jpeg => JpegEnd::from_bytes(bytes) != JpegEnd::Marked,
        ImageFormat::Png => !bytes.windows(4).any(|chunk| chunk == b"IEND"),
        _ => false,
    }
}

/// Has a WebP fewer bytes than its header says? The byte that makes its length even may be missing.
fn is_webp_cut_off(bytes: &[u8]) -> bool {
    let size = bytes.get(4..8).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes);
    bytes.starts_with(b"RIFF") && (bytes.len() as u64) + 1 < u64::from(size) + 8
}

/// Do the pixels of a JPEG end before the image does? The decoder invents the others silently.
///
/// A file that lacks its end marker alone is whole. Otherwise pixels change with what is put in
/// place of the missing bytes. `decode` decodes such bytes.
fn is_jpeg_cut_off(bytes: &[u8], decode: impl Fn(&[u8]) -> Option<DynamicImage>) -> bool {
    const END: [u8; 2] = [0xff, 0xd9];
    match JpegEnd::from_bytes(bytes) {
        JpegEnd::Marked => false,
        // refinements may follow, whose number the file does not say
        JpegEnd::Missing { is_progressive: true } => true,
        JpegEnd::Missing { is_progressive: false } => {
            // downloads that failed may be filled up with zeros
            let length = bytes.iter().rposition(|b| *b != 0).map_or(0, |last| last + 1);
            let [a, b] = [0x00, 0x55].map(|byte| decode(&[&bytes[..length], &[byte; 64], &END].concat()));
            a.is_none() || a != b
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum JpegEnd {
    /// With the marker of the end of the image.
    Marked,
    Missing {
        is_progressive: bool,
    },
}

impl JpegEnd {
    /// Follows the segments of a file (ITU T.81, B.1).
    fn from_bytes(bytes: &[u8]) -> Self {
        const END_OF_IMAGE: u8 = 0xd9;
        const PROGRESSIVE: [u8; 4] = [0xc2, 0xc6, 0xca, 0xce];
        if bytes.ends_with(&[0xff, END_OF_IMAGE]) {
            return Self::Marked;
        }
        let (mut rest, mut is_progressive) = (bytes, false);
        // neither stuffed bytes, fill bytes, restarts nor markers without a segment
        let is_segment = |w: &[u8]| w[0] == 0xff && !matches!(w[1], 0x00 | 0x01 | 0xd0..=0xd8 | 0xff);
        while let Some(at) = rest.windows(2).position(is_segment) {
            let marker = rest[at + 1];
            if marker == END_OF_IMAGE {
                return Self::Marked;
            }
            is_progressive |= PROGRESSIVE.contains(&marker);
            rest = &rest[at + 2..];
            let length = rest.get(..2).map_or(0, |b| usize::from(u16::from_be_bytes([b[0], b[1]])));
            rest = rest.get(length..).unwrap_or_default();
        }
        Self::Missing { is_progressive }
    }
}

#[cfg(test)]
mod tests {
    use super::{ENDS_EARLY, JpegEnd, MaxSize};
    use crate::memory::Budget;
    use image::{DynamicImage, ImageFormat};
    use std::io::Cursor;

    fn decode(bytes: &[u8], format: ImageFormat) -> Result<DynamicImage, String> {
        decode_within(bytes, format, &Budget::default(), |max| max)
    }

    fn decode_within(
        bytes: &[u8],
        format: ImageFormat,
        budget: &Budget,
        change: impl FnOnce(MaxSize<'_>) -> MaxSize<'_>,
    ) -> Result<DynamicImage, String> {
        let max = MaxSize { side: 1 << 14, pixels_per_byte: None, budget, pixel_bytes: |_| [4, 4] };
        super::decode(bytes, format, change(max))
    }

    fn encoded(format: ImageFormat) -> Vec<u8> {
        let image =
            image::RgbImage::from_fn(61, 43, |x, y| image::Rgb([(x * y) as u8, (x * 4) as u8, (y * 37 % 256) as u8]));
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn files_that_end_early() {
        for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::WebP, ImageFormat::Tga, ImageFormat::Bmp] {
            let bytes = encoded(format);
            assert!(decode(&bytes, format).is_ok_and(|image| image.width() == 61), "{format:?}");
            for part in [0.1, 0.5, 0.9, 0.97] {
                let cut = &bytes[..(bytes.len() as f64 * part) as usize];
                assert_eq!(decode(cut, format).err().as_deref(), Some(ENDS_EARLY), "{format:?}, {part}");
            }
        }
    }

    #[test]
    fn a_jpeg_without_its_last_marker_is_whole() {
        let whole = encoded(ImageFormat::Jpeg);
        let image = decode(&whole, ImageFormat::Jpeg).unwrap();
        assert_eq!(JpegEnd::from_bytes(&whole), JpegEnd::Marked);
        // what others append to a file
        assert_eq!(JpegEnd::from_bytes(&[&whole[..], b"\0\0 and more"].concat()), JpegEnd::Marked);
        let without = &whole[..whole.len() - 2];
        assert_eq!(JpegEnd::from_bytes(without), JpegEnd::Missing { is_progressive: false });
        assert_eq!(decode(without, ImageFormat::Jpeg).unwrap(), image);
        // zeros in place of what is missing
        let mut zeros = whole.clone();
        zeros[whole.len() / 2..].fill(0);
        assert_eq!(decode(&zeros, ImageFormat::Jpeg).err().as_deref(), Some(ENDS_EARLY));
    }

    #[test]
    fn promises_of_a_header_are_not_believed() {
        let bytes = encoded(ImageFormat::Png);
        let of = |budget: &Budget, change: fn(MaxSize<'_>) -> MaxSize<'_>| {
            decode_within(&bytes, ImageFormat::Png, budget, change).unwrap_err()
        };
        let few = of(&Budget::default(), |max| MaxSize { pixels_per_byte: Some(0), ..max });
        assert!(few.contains("61x43 pixels"), "{few}");
        of(&Budget::default(), |max| MaxSize { side: 60, ..max });
        // before anything is decoded
        let budget = Budget::with_limit(61 * 43 * 8 - 1);
        of(&budget, |max| max);
        assert!(budget.check().unwrap_err().to_string().contains("an image of 61x43 pixels takes"));
    }
}
