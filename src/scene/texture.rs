//! Decoded images with their samplers.

use std::sync::{Arc, LazyLock};

use glam::{DVec2, Vec2, Vec4};

use crate::colour::srgb_decode;
pub use crate::interface::Wrap;

/// How texels are interpolated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// The texel that holds the point.
    Nearest,
    /// Bilinear.
    #[default]
    Linear,
}

/// RGBA of all texels of an image, rows from the top. Shared: two textures may sample one image
/// differently.
#[derive(Clone, Debug, PartialEq)]
pub enum TexelData {
    /// 8-bit unsigned normalized channels.
    Unorm8(Arc<[u8]>),
    /// 16-bit unsigned normalized channels.
    Unorm16(Arc<[u16]>),
    /// Non-negative floats: always linear, also for uses in which integers are sRGB.
    Float(Arc<[f32]>),
}

impl TexelData {
    /// Number of texels.
    pub fn len(&self) -> usize {
        match self {
            Self::Unorm8(v) => v.len() / 4,
            Self::Unorm16(v) => v.len() / 4,
            Self::Float(v) => v.len() / 4,
        }
    }

    /// Whether there are no texels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Texel `i` as it is stored: sRGB is not decoded. `texel` of shaders/scene/texture.glsl.
    ///
    /// # Panics
    /// When there is no such texel.
    pub fn get(&self, i: usize) -> [f32; 4] {
        let channels = 4 * i..4 * i + 4;
        let mut texel = [0.0; 4];
        match self {
            Self::Unorm8(v) => texel.iter_mut().zip(&v[channels]).for_each(|(t, &c)| *t = f32::from(c) / 255.0),
            Self::Unorm16(v) => texel.iter_mut().zip(&v[channels]).for_each(|(t, &c)| *t = f32::from(c) / 65535.0),
            Self::Float(v) => texel.copy_from_slice(&v[channels]),
        }
        texel
    }

    /// Texel `i` with linear colours, of a texture that is used as sRGB: `decoded_texel` of
    /// shaders/scene/texture.glsl.
    ///
    /// # Panics
    /// When there is no such texel.
    pub fn decode_srgb(&self, i: usize) -> [f32; 4] {
        static EIGHT_BITS: LazyLock<[f32; 256]> =
            LazyLock::new(|| std::array::from_fn(|v| srgb_decode(v as f32 / 255.0)));
        let [r, g, b, a] = self.get(i);
        match self {
            Self::Unorm8(v) => {
                let [r, g, b] = [0, 1, 2].map(|c| EIGHT_BITS[usize::from(v[4 * i + c])]);
                [r, g, b, a]
            }
            Self::Unorm16(_) => [srgb_decode(r), srgb_decode(g), srgb_decode(b), a],
            Self::Float(_) => [r, g, b, a],
        }
    }

    /// All texels, one after the other, as they are stored.
    pub fn iter(&self) -> impl Iterator<Item = [f32; 4]> {
        (0..self.len()).map(|i| self.get(i))
    }

    /// The texels as bytes in memory.
    pub fn as_bytes(&self) -> &[u8] {
        match self {
            Self::Unorm8(v) => v,
            Self::Unorm16(v) => bytemuck::cast_slice(v),
            Self::Float(v) => bytemuck::cast_slice(v),
        }
    }

    /// Whether both are the same memory.
    pub fn is_shared_with(&self, other: &Self) -> bool {
        std::ptr::eq(self.as_bytes(), other.as_bytes())
    }
}

impl From<Vec<u8>> for TexelData {
    fn from(rgba: Vec<u8>) -> Self {
        Self::Unorm8(rgba.into())
    }
}

impl From<Vec<u16>> for TexelData {
    fn from(rgba: Vec<u16>) -> Self {
        Self::Unorm16(rgba.into())
    }
}

impl From<Vec<f32>> for TexelData {
    fn from(rgba: Vec<f32>) -> Self {
        Self::Float(rgba.into())
    }
}

/// An RGBA image with its sampler. The use decides whether integer RGB is sRGB or linear: base
/// colour, emission, sheen colour and specular colour are sRGB, everything else is linear; alpha is
/// always linear.
#[derive(Clone, Debug)]
pub struct Texture {
    /// File name or image name; may be empty.
    pub name: String,
    /// Pixels in x.
    pub width: u32,
    /// Pixels in y.
    pub height: u32,
    /// `width * height` texels.
    pub texels: TexelData,
    /// Wrapping in u and v.
    pub wrap: [Wrap; 2],
    /// Interpolation.
    pub filter: Filter,
}

impl Texture {
    /// Linear colour and alpha at a point, interpolated by the texture's filter; its texels must
    /// not be empty. `uv`: any texture coordinates, v down. The texels are sRGB.
    pub fn look_up_srgb(&self, uv: Vec2) -> Vec4 {
        self.interpolate(uv, |index| self.texels.decode_srgb(index))
    }

    /// As [`Texture::look_up_srgb`], of texels that are linear as they are stored.
    pub fn look_up(&self, uv: Vec2) -> Vec4 {
        self.interpolate(uv, |index| self.texels.get(index))
    }

    fn interpolate(&self, uv: Vec2, value: impl Fn(usize) -> [f32; 4]) -> Vec4 {
        let texel = |i: i64, j: i64| Vec4::from_array(value(self.texel_index(i, j)));
        // the casts saturate; NaN becomes 0
        let point = uv.as_dvec2() * DVec2::new(f64::from(self.width), f64::from(self.height));
        if self.filter == Filter::Nearest || !point.is_finite() {
            return texel(point.x.floor() as i64, point.y.floor() as i64);
        }

        // the four texels whose centres are around the point
        let corner = (point - 0.5).floor();
        let t = (point - 0.5 - corner).as_vec2();
        let (i, j) = (corner.x as i64, corner.y as i64);
        let (next_i, next_j) = (i.saturating_add(1), j.saturating_add(1));
        let row = |j: i64| texel(i, j).lerp(texel(next_i, j), t.x);
        row(j).lerp(row(next_j), t.y)
    }

    /// Index of the texel in column `i` and row `j`, which may lie outside the image: they are
    /// wrapped.
    fn texel_index(&self, i: i64, j: i64) -> usize {
        let inside = |i: i64, size: u32, wrap: Wrap| {
            let n = i64::from(size.max(1));
            let inside = match wrap {
                Wrap::Repeat => i.rem_euclid(n),
                Wrap::Clamp => i.clamp(0, n - 1),
                Wrap::Mirror => {
                    let m = i.rem_euclid(2 * n);
                    m.min(2 * n - 1 - m)
                }
            };
            inside as usize
        };
        inside(j, self.height, self.wrap[1]) * self.width as usize + inside(i, self.width, self.wrap[0])
    }
}
