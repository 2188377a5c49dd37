//! KTX2 images: Basis Universal (ETC1S, UASTC and their kin), ASTC, BC1 to BC7 and plain numbers,
//! as they are or packed by Zstandard.
//!
//! Only the largest level is read: levels are computed where a scene needs them.
//!
//! <https://github.khronos.org/KTX-Specification/ktxspec.v2.html>

use std::io::Read;

use basisu::{DecodeFlags, SourceFormat, TargetFormat, Transcoder};
use ktx2::{Format, Reader, SupercompressionScheme};

use super::picture::{DecodedImage, MAX_SIDE};
use super::texels::{Block, floats, half, single, unorm8, unorm16};
use crate::memory::Budget;
use crate::scene::TexelData;

/// Returns true if the bytes are those of a KTX2 file.
pub(super) fn is_ktx2(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\xabKTX 20\xbb\r\n\x1a\n")
}

/// Decodes a KTX2 file.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn decode(bytes: &[u8], budget: &Budget) -> Result<DecodedImage, String> {
    // decoders may panic at files that are damaged
    std::panic::catch_unwind(|| decode_file(bytes, budget))
        .unwrap_or_else(|_| Err("cannot be decoded: it is damaged".to_owned()))
}

fn decode_file(bytes: &[u8], budget: &Budget) -> Result<DecodedImage, String> {
    let reader = Reader::new(bytes).map_err(|e| format!("cannot be decoded: {e}"))?;
    let header = reader.header();
    let (width, height) = (header.pixel_width, header.pixel_height.max(1));
    if width == 0 || width > MAX_SIDE || height > MAX_SIDE {
        return Err(format!("cannot be decoded: {width}x{height} pixels"));
    }
    if header.pixel_depth > 1 || header.layer_count > 1 || header.face_count > 1 {
        return Err("is a cube map, an array or a volume, not an image".to_owned());
    }
    let level = reader.levels().next().ok_or("has no image")?;

    // 16 bytes a texel are the most, and a packed level is unpacked besides
    let pixels = u64::from(width) * u64::from(height);
    let besides = level.uncompressed_byte_length.max(level.data.len() as u64).saturating_add(16 * pixels);
    budget.take_for_now(16 * pixels, besides, || format!("an image of {width}x{height} pixels"))?;

    let image = Stored { width: width as usize, height: height as usize };
    let texels = match header.format {
        None => transcode(bytes)?,
        Some(format) if is_astc(format) => transcode(bytes)?,
        Some(format) => {
            let data = unpack(level.data, level.uncompressed_byte_length, header.supercompression_scheme)?;
            image.texels(format, &data)?
        }
    };
    if texels.len() as u64 != pixels {
        return Err("cannot be decoded: it has another number of texels".to_owned());
    }
    Ok(DecodedImage { width, height, texels })
}

/// ASTC of 8 bits: formats 157 to 184 of Vulkan.
fn is_astc(format: Format) -> bool {
    (157..=184).contains(&format.value())
}

/// Decodes what Basis Universal's decoder reads.
fn transcode(bytes: &[u8]) -> Result<TexelData, String> {
    let wrong = |e: basisu::Error| format!("cannot be decoded: {e:?}");
    let file = Transcoder::new(bytes).map_err(wrong)?;
    let high_dynamic_range = matches!(
        file.source_format(),
        SourceFormat::UastcHdr4x4 | SourceFormat::AstcHdr6x6 | SourceFormat::UastcHdr6x6
    );
    if high_dynamic_range {
        let halves = file.transcode(0, TargetFormat::RgbaHalf, DecodeFlags::NONE).map_err(wrong)?;
        Ok(floats(&halves, 2, 4, half))
    } else {
        Ok(file.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).map_err(wrong)?.into())
    }
}

/// The bytes of a level.
fn unpack(data: &[u8], size: u64, scheme: Option<SupercompressionScheme>) -> Result<Vec<u8>, String> {
    match scheme {
        None => Ok(data.to_vec()),
        Some(SupercompressionScheme::Zstandard) => {
            let wrong = |e: &dyn std::fmt::Display| format!("cannot be decoded: {e}");
            let stream = ruzstd::StreamingDecoder::new(data).map_err(|e| wrong(&e))?;
            let mut bytes = Vec::new();
            stream.take(size).read_to_end(&mut bytes).map_err(|e| wrong(&e))?;
            Ok(bytes)
        }
        Some(other) => Err(format!("is packed in a way that skylit does not read ({other:?})")),
    }
}

/// Size of a stored level, in pixels.
struct Stored {
    width: usize,
    height: usize,
}

impl Stored {
    /// Texels of a level in one of Vulkan's formats. Missing channels are those of Vulkan: 0, and 1
    /// for alpha.
    fn texels(&self, format: Format, data: &[u8]) -> Result<TexelData, String> {
        let bytes = |channels| Ok(unorm8(data, channels));
        match format {
            Format::R8_UNORM | Format::R8_SRGB => bytes(1),
            Format::R8G8_UNORM | Format::R8G8_SRGB => bytes(2),
            Format::R8G8B8_UNORM | Format::R8G8B8_SRGB => bytes(3),
            Format::R8G8B8A8_UNORM | Format::R8G8B8A8_SRGB => bytes(4),
            Format::B8G8R8A8_UNORM | Format::B8G8R8A8_SRGB => {
                let mut swapped = data.to_vec();
                swapped.as_chunks_mut().0.iter_mut().for_each(|[b, _, r, _]: &mut [u8; 4]| std::mem::swap(b, r));
                Ok(unorm8(&swapped, 4))
            }
            Format::R16_UNORM => Ok(unorm16(data, 1)),
            Format::R16G16_UNORM => Ok(unorm16(data, 2)),
            Format::R16G16B16_UNORM => Ok(unorm16(data, 3)),
            Format::R16G16B16A16_UNORM => Ok(unorm16(data, 4)),
            Format::R16_SFLOAT => Ok(floats(data, 2, 1, half)),
            Format::R16G16_SFLOAT => Ok(floats(data, 2, 2, half)),
            Format::R16G16B16_SFLOAT => Ok(floats(data, 2, 3, half)),
            Format::R16G16B16A16_SFLOAT => Ok(floats(data, 2, 4, half)),
            Format::R32_SFLOAT => Ok(floats(data, 4, 1, single)),
            Format::R32G32_SFLOAT => Ok(floats(data, 4, 2, single)),
            Format::R32G32B32_SFLOAT => Ok(floats(data, 4, 3, single)),
            Format::R32G32B32A32_SFLOAT => Ok(floats(data, 4, 4, single)),
            Format::BC1_RGB_UNORM_BLOCK
            | Format::BC1_RGB_SRGB_BLOCK
            | Format::BC1_RGBA_UNORM_BLOCK
            | Format::BC1_RGBA_SRGB_BLOCK => self.blocks(Block::Bc1, data),
            Format::BC2_UNORM_BLOCK | Format::BC2_SRGB_BLOCK => self.blocks(Block::Bc2, data),
            Format::BC3_UNORM_BLOCK | Format::BC3_SRGB_BLOCK => self.blocks(Block::Bc3, data),
            Format::BC4_UNORM_BLOCK => self.blocks(Block::Bc4, data),
            Format::BC5_UNORM_BLOCK => self.blocks(Block::Bc5, data),
            Format::BC6H_UFLOAT_BLOCK => self.blocks(Block::Bc6h { signed: false }, data),
            Format::BC6H_SFLOAT_BLOCK => self.blocks(Block::Bc6h { signed: true }, data),
            Format::BC7_UNORM_BLOCK | Format::BC7_SRGB_BLOCK => self.blocks(Block::Bc7, data),
            other => Err(format!("has a format that skylit does not read (number {} of Vulkan's)", other.value())),
        }
    }

    fn blocks(&self, block: Block, data: &[u8]) -> Result<TexelData, String> {
        block.texels(data, [self.width, self.height])
    }
}
