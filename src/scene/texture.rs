//! Decoded images with their samplers.

use std::sync::Arc;

/// What happens outside [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// Tile (glTF's default).
    #[default]
    Repeat,
    /// Tile, every second tile mirrored.
    Mirror,
    /// Extend the border.
    Clamp,
}

/// How texels are interpolated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// The texel that holds the point.
    Nearest,
    /// Bilinear.
    #[default]
    Linear,
}

/// An 8-bit RGBA image and how to sample it. Whether RGB is sRGB or linear is said by the use: base colour, emissive and the
/// like are sRGB, everything else linear; alpha is always linear.
#[derive(Clone, Debug)]
pub struct Texture {
    /// File name or image name; may be empty.
    pub name: String,
    /// Pixels in x.
    pub width: u32,
    /// Pixels in y.
    pub height: u32,
    /// Rows from the top, RGBA, `4 * width * height` bytes. Shared: two textures may sample one image differently.
    pub rgba8: Arc<[u8]>,
    /// Wrapping in u and v.
    pub wrap: [Wrap; 2],
    /// Interpolation.
    pub filter: Filter,
}
