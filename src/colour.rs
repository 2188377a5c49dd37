//! The transfer function of sRGB. Shaders have theirs in shaders/common/srgb.glsl.

/// The sRGB transfer function (IEC 61966-2-1): a linear value in [0, 1] to a coded one in [0, 1].
pub fn srgb_encode(linear: f32) -> f32 {
    if linear <= 0.0031308 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The inverse of [`srgb_encode`].
pub fn srgb_decode(coded: f32) -> f32 {
    if coded <= 0.04045 { coded / 12.92 } else { ((coded + 0.055) / 1.055).powf(2.4) }
}

/// A linear value to 8-bit sRGB, rounded to nearest. NaN is black, so that it can be seen on a
/// bright image.
pub fn srgb_byte(linear: f32) -> u8 {
    // a cast from NaN gives 0
    (srgb_encode(linear.clamp(0.0, 1.0)) * 255.0).round() as u8
}
