//! Texels of the numbers and blocks that containers of textures hold (KTX2, DDS).

use exr::prelude::f16;

use crate::scene::TexelData;

/// A block of 4x4 compressed pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Block {
    Bc1,
    Bc2,
    Bc3,
    /// One channel.
    Bc4,
    /// Two channels.
    Bc5,
    /// Half-precision numbers of three channels.
    Bc6h {
        signed: bool,
    },
    Bc7,
}

impl Block {
    /// Bytes of a block.
    pub fn bytes(self) -> usize {
        if matches!(self, Self::Bc1 | Self::Bc4) { 8 } else { 16 }
    }

    /// The texels of an image, whose missing channels are 0, and 1 for alpha.
    ///
    /// # Errors
    /// Data that end before the last block.
    pub fn texels(self, data: &[u8], size: [usize; 2]) -> Result<TexelData, String> {
        let unsigned = |decode: fn(&[u8], &mut [u8], usize, bool)| {
            move |block: &[u8], out: &mut [u8], pitch: usize| decode(block, out, pitch, false)
        };
        match self {
            Self::Bc1 => Ok(unorm8(&self.pixels(data, size, 4, bcdec_rs::bc1)?, 4)),
            Self::Bc2 => Ok(unorm8(&self.pixels(data, size, 4, bcdec_rs::bc2)?, 4)),
            Self::Bc3 => Ok(unorm8(&self.pixels(data, size, 4, bcdec_rs::bc3)?, 4)),
            Self::Bc4 => Ok(unorm8(&self.pixels(data, size, 1, unsigned(bcdec_rs::bc4))?, 1)),
            Self::Bc5 => Ok(unorm8(&self.pixels(data, size, 2, unsigned(bcdec_rs::bc5))?, 2)),
            Self::Bc6h { signed } => {
                let decode =
                    |block: &[u8], out: &mut [f32], pitch: usize| bcdec_rs::bc6h_float(block, out, pitch, signed);
                let pixels = self.pixels(data, size, 3, decode)?;
                let texels = pixels.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 1.0]);
                Ok(texels.map(positive).collect::<Vec<f32>>().into())
            }
            Self::Bc7 => Ok(unorm8(&self.pixels(data, size, 4, bcdec_rs::bc7)?, 4)),
        }
    }

    /// The numbers of an image; `decode` writes those of a block, `channels` a pixel, and takes how
    /// many are in a row.
    fn pixels<T: Copy + Default>(
        self,
        data: &[u8],
        [width, height]: [usize; 2],
        channels: usize,
        decode: impl Fn(&[u8], &mut [T], usize),
    ) -> Result<Vec<T>, String> {
        let (columns, rows) = (width.div_ceil(4), height.div_ceil(4));
        if data.len() < columns * rows * self.bytes() {
            return Err("ends early: it was cut off".to_owned());
        }
        let pitch = 4 * channels;
        let mut pixels = vec![T::default(); width * height * channels];
        let mut block = [T::default(); 64];
        for (at, encoded) in data.chunks_exact(self.bytes()).take(columns * rows).enumerate() {
            decode(encoded, &mut block[..4 * pitch], pitch);

            // blocks at the right and lower edge have pixels outside of the image
            let (x, y) = (4 * (at % columns), 4 * (at / columns));
            let numbers = channels * (width - x).min(4);
            for row in 0..(height - y).min(4) {
                let start = channels * ((y + row) * width + x);
                pixels[start..start + numbers].copy_from_slice(&block[row * pitch..row * pitch + numbers]);
            }
        }
        Ok(pixels)
    }
}

/// A number that filters may see: what is not finite or negative would spoil every filtered value
/// that includes it.
fn positive(value: f32) -> f32 {
    if value.is_finite() { value.max(0.0) } else { 0.0 }
}

/// Texels with 8-bit channels, of which a pixel has 1 to 4.
pub(super) fn unorm8(data: &[u8], channels: usize) -> TexelData {
    let texel = |pixel: &[u8]| {
        let mut texel = [0, 0, 0, u8::MAX];
        texel[..channels].copy_from_slice(pixel);
        texel
    };
    data.chunks_exact(channels).flat_map(texel).collect::<Vec<u8>>().into()
}

/// Texels with 16-bit channels.
pub(super) fn unorm16(data: &[u8], channels: usize) -> TexelData {
    let texel = |pixel: &[u8]| {
        let mut texel = [0, 0, 0, u16::MAX];
        for (channel, bytes) in texel.iter_mut().zip(pixel.as_chunks().0) {
            *channel = u16::from_le_bytes(*bytes);
        }
        texel
    };
    data.chunks_exact(2 * channels).flat_map(texel).collect::<Vec<u16>>().into()
}

/// Texels with channels of `size` bytes, which `number` reads.
pub(super) fn floats(data: &[u8], size: usize, channels: usize, number: fn(&[u8]) -> f32) -> TexelData {
    let texel = |pixel: &[u8]| {
        let mut texel = [0.0, 0.0, 0.0, 1.0];
        for (channel, bytes) in texel.iter_mut().zip(pixel.chunks_exact(size)) {
            *channel = positive(number(bytes));
        }
        texel
    };
    data.chunks_exact(size * channels).flat_map(texel).collect::<Vec<f32>>().into()
}

/// A half-precision number.
pub(super) fn half(bytes: &[u8]) -> f32 {
    f16::from_le_bytes([bytes[0], bytes[1]]).to_f32()
}

/// A single-precision number.
pub(super) fn single(bytes: &[u8]) -> f32 {
    f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
}
