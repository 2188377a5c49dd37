//! DDS images: BC1 to BC7, and plain numbers.
//!
//! Only the largest level is read: levels are computed where a scene needs them. Whether numbers
//! are sRGB is a matter of the slot that a texture is in, whatever the file says.
//!
//! <https://learn.microsoft.com/en-us/windows/win32/direct3ddds/dx-graphics-dds-pguide>

use super::picture::{DecodedImage, MAX_SIDE};
use super::texels::{Block, floats, half, single, unorm8, unorm16};
use crate::memory::Budget;
use crate::scene::TexelData;

/// First bytes of a file.
const MAGIC: &[u8] = b"DDS ";
/// Bytes before those of the image: the header, and what follows it in files of Direct3D 10.
const HEADER: usize = 128;
const HEADER_10: usize = 20;

/// Flags of a pixel format, and capabilities of a surface.
const ALPHA_PIXELS: u32 = 0x1;
const ALPHA: u32 = 0x2;
const FOUR_CC: u32 = 0x4;
const RGB: u32 = 0x40;
const LUMINANCE: u32 = 0x2_0000;
const CUBE_MAP: u32 = 0x200;
const VOLUME: u32 = 0x20_0000;

/// How the pixels of an image are stored.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Layout {
    Blocks(Block),
    /// Channels of 8 bits.
    Unorm8(usize),
    /// Channels of 16 bits.
    Unorm16(usize),
    /// Half-precision channels.
    Half(usize),
    /// Single-precision channels.
    Single(usize),
    /// A number of so many bytes a pixel, with the bits of red, green, blue and alpha.
    Masks {
        bytes: usize,
        masks: [u32; 4],
    },
}

/// Returns true if the bytes are those of a DDS file.
pub(super) fn is_dds(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// Decodes a DDS file.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn decode(bytes: &[u8], budget: &Budget) -> Result<DecodedImage, String> {
    // decoders may panic at files that are damaged
    std::panic::catch_unwind(|| decode_file(bytes, budget))
        .unwrap_or_else(|_| Err("cannot be decoded: it is damaged".to_owned()))
}

fn decode_file(bytes: &[u8], budget: &Budget) -> Result<DecodedImage, String> {
    let (height, width) = (word(bytes, 12)?, word(bytes, 16)?);
    if word(bytes, 4)? != 124 || width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
        return Err(format!("cannot be decoded: {width}x{height} pixels"));
    }
    if word(bytes, 112)? & (CUBE_MAP | VOLUME) != 0 {
        return Err("is a cube map or a volume, not an image".to_owned());
    }
    let (layout, start) = layout(bytes)?;
    let data = bytes.get(start..).unwrap_or_default();

    // a file that is too short is known before anything is allocated
    let pixels = width as usize * height as usize;
    let (columns, rows) = (width.div_ceil(4) as usize, height.div_ceil(4) as usize);
    let length = match layout {
        Layout::Blocks(block) => columns * rows * block.bytes(),
        Layout::Unorm8(channels) => pixels * channels,
        Layout::Unorm16(channels) | Layout::Half(channels) => pixels * 2 * channels,
        Layout::Single(channels) => pixels * 4 * channels,
        Layout::Masks { bytes, .. } => pixels * bytes,
    };
    let data = data.get(..length).ok_or("ends early: it was cut off")?;
    let most = 16 * pixels as u64;
    budget.take_for_now(most, most, || format!("an image of {width}x{height} pixels"))?;

    let texels = match layout {
        Layout::Blocks(Block::Bc5) => with_third(Block::Bc5.texels(data, [width as usize, height as usize])?),
        Layout::Blocks(block) => block.texels(data, [width as usize, height as usize])?,
        Layout::Unorm8(channels) => unorm8(data, channels),
        Layout::Unorm16(channels) => unorm16(data, channels),
        Layout::Half(channels) => floats(data, 2, channels, half),
        Layout::Single(channels) => floats(data, 4, channels, single),
        Layout::Masks { bytes, masks } => masked(data, bytes, masks),
    };
    Ok(DecodedImage { width, height, texels })
}

/// The number at an offset of the header.
fn word(bytes: &[u8], at: usize) -> Result<u32, String> {
    let word = bytes.get(at..at + 4).and_then(|w| w.try_into().ok()).map(u32::from_le_bytes);
    word.ok_or_else(|| "ends early: it was cut off".to_owned())
}

/// How the image is stored, and where it begins.
fn layout(bytes: &[u8]) -> Result<(Layout, usize), String> {
    let (flags, four_cc, bits) = (word(bytes, 80)?, word(bytes, 84)?, word(bytes, 88)?);
    let [r, g, b, a] = [word(bytes, 92)?, word(bytes, 96)?, word(bytes, 100)?, word(bytes, 104)?];
    if flags & FOUR_CC != 0 {
        let code = four_cc.to_le_bytes();
        if &code == b"DX10" {
            return Ok((layout_10(bytes)?, HEADER + HEADER_10));
        }
        return match known_four_cc(code) {
            Some(layout) => Ok((layout, HEADER)),
            None if code.iter().all(u8::is_ascii_graphic) => {
                Err(format!("has a format that skylit does not read ({})", String::from_utf8_lossy(&code)))
            }
            None => Err(format!("has a format that skylit does not read (number {four_cc} of Direct3D 9's)")),
        };
    }
    let alpha = if flags & ALPHA_PIXELS != 0 { a } else { 0 };
    let masks = match flags & (RGB | LUMINANCE | ALPHA) {
        RGB => [r, g, b, alpha],
        LUMINANCE => [r, r, r, alpha],
        ALPHA => [0, 0, 0, a],
        _ => return Err(format!("has a format that skylit does not read (flags {flags:#x})")),
    };
    match bits {
        8 | 16 | 24 | 32 => Ok((Layout::Masks { bytes: bits as usize / 8, masks }, HEADER)),
        _ => Err(format!("has a format that skylit does not read ({bits} bits a pixel)")),
    }
}

/// Layout of a format of Direct3D 9, by its letters or number.
fn known_four_cc(code: [u8; 4]) -> Option<Layout> {
    match &code {
        b"DXT1" => Some(Layout::Blocks(Block::Bc1)),
        b"DXT3" => Some(Layout::Blocks(Block::Bc2)),
        b"DXT5" => Some(Layout::Blocks(Block::Bc3)),
        b"ATI1" | b"BC4U" => Some(Layout::Blocks(Block::Bc4)),
        b"ATI2" | b"BC5U" => Some(Layout::Blocks(Block::Bc5)),
        _ => match u32::from_le_bytes(code) {
            36 => Some(Layout::Unorm16(4)),
            111 => Some(Layout::Half(1)),
            112 => Some(Layout::Half(2)),
            113 => Some(Layout::Half(4)),
            114 => Some(Layout::Single(1)),
            115 => Some(Layout::Single(2)),
            116 => Some(Layout::Single(4)),
            _ => None,
        },
    }
}

/// Layout by the header of Direct3D 10, whose formats are those of DXGI.
fn layout_10(bytes: &[u8]) -> Result<Layout, String> {
    const TEXTURE_2D: u32 = 3;
    const CUBE: u32 = 4;
    let (format, dimension) = (word(bytes, HEADER)?, word(bytes, HEADER + 4)?);
    let (kind, layers) = (word(bytes, HEADER + 8)?, word(bytes, HEADER + 12)?);
    word(bytes, HEADER + 16)?;
    if dimension != TEXTURE_2D || kind & CUBE != 0 || layers > 1 {
        return Err("is a cube map, an array or a volume, not an image".to_owned());
    }
    let bgra = |alpha| Layout::Masks { bytes: 4, masks: [0xff_0000, 0xff00, 0xff, alpha] };
    Ok(match format {
        1..=2 => Layout::Single(4),
        5..=6 => Layout::Single(3),
        9..=10 => Layout::Half(4),
        11 => Layout::Unorm16(4),
        15..=16 => Layout::Single(2),
        27..=29 => Layout::Unorm8(4),
        33..=34 => Layout::Half(2),
        35 => Layout::Unorm16(2),
        39 | 41 => Layout::Single(1),
        48..=49 => Layout::Unorm8(2),
        53..=54 => Layout::Half(1),
        56 => Layout::Unorm16(1),
        60..=61 => Layout::Unorm8(1),
        65 => Layout::Masks { bytes: 1, masks: [0, 0, 0, 0xff] },
        70..=72 => Layout::Blocks(Block::Bc1),
        73..=75 => Layout::Blocks(Block::Bc2),
        76..=78 => Layout::Blocks(Block::Bc3),
        79..=80 => Layout::Blocks(Block::Bc4),
        82..=83 => Layout::Blocks(Block::Bc5),
        87 | 90..=91 => bgra(0xff00_0000),
        88 | 92..=93 => bgra(0),
        94..=95 => Layout::Blocks(Block::Bc6h { signed: false }),
        96 => Layout::Blocks(Block::Bc6h { signed: true }),
        97..=99 => Layout::Blocks(Block::Bc7),
        other => return Err(format!("has a format that skylit does not read (number {other} of DXGI's)")),
    })
}

/// Texels of pixels whose channels are bits of a number. A channel without bits is 0, and 1 for
/// alpha.
fn masked(data: &[u8], bytes: usize, masks: [u32; 4]) -> TexelData {
    let channel = |pixel: u32, mask: u32| {
        let most = u64::from(mask >> mask.trailing_zeros().min(31));
        let value = u64::from((pixel & mask) >> mask.trailing_zeros().min(31));
        (value * 255 + most / 2).checked_div(most).map(|v| v as u8)
    };
    let texel = |pixel: &[u8]| {
        let mut word = [0; 4];
        word[..bytes].copy_from_slice(pixel);
        let pixel = u32::from_le_bytes(word);
        let [r, g, b, a] = masks.map(|mask| channel(pixel, mask));
        [r.unwrap_or(0), g.unwrap_or(0), b.unwrap_or(0), a.unwrap_or(u8::MAX)]
    };
    data.chunks_exact(bytes).flat_map(texel).collect::<Vec<u8>>().into()
}

/// Texels with the third channel of a normal map, which is stored as two: of unit length, outwards.
fn with_third(texels: TexelData) -> TexelData {
    let texel = |[r, g, _, a]: [f32; 4]| {
        let [x, y] = [r, g].map(|v| 2.0 * v - 1.0);
        let z = (1.0 - x * x - y * y).max(0.0).sqrt();
        [r, g, 0.5 + 0.5 * z, a].map(|v| (255.0 * v).round() as u8)
    };
    texels.iter().flat_map(texel).collect::<Vec<u8>>().into()
}
