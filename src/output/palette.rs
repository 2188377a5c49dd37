//! Palettes of images that show numbers: errors from 0 to 1, and signed differences.

/// Colours of errors from 0 to 1, evenly spaced, 8-bit sRGB: those of matplotlib's magma.
pub const HEAT: [[u8; 3]; 9] = [
    [0, 0, 4],
    [28, 16, 68],
    [79, 18, 123],
    [129, 37, 129],
    [181, 54, 122],
    [229, 80, 100],
    [251, 135, 97],
    [254, 194, 135],
    [252, 253, 191],
];

/// Colours of numbers from -1 (blue) to 1 (red): ColorBrewer's RdBu, for the colour-blind, too.
pub const SIGNED: [[u8; 3]; 11] = [
    [5, 48, 97],
    [33, 102, 172],
    [67, 147, 195],
    [146, 197, 222],
    [209, 229, 240],
    [247, 247, 247],
    [253, 219, 199],
    [244, 165, 130],
    [214, 96, 77],
    [178, 24, 43],
    [103, 0, 31],
];

/// The colour of an error from 0 to 1; white for one that is not a number.
pub fn heat(error: f32) -> [u8; 3] {
    if error.is_nan() { [255; 3] } else { mix(&HEAT, error) }
}

/// The colour of a signed number from -1 to 1; magenta for one that is not a number.
pub fn signed(value: f32) -> [u8; 3] {
    if value.is_nan() { [255, 0, 255] } else { mix(&SIGNED, 0.5 + 0.5 * value) }
}

/// The colour at `at`, 0 to 1, between the colours of a palette.
fn mix(colors: &[[u8; 3]], at: f32) -> [u8; 3] {
    let at = at.clamp(0.0, 1.0) * (colors.len() - 1) as f32;
    let k = (at as usize).min(colors.len() - 2);
    let [a, b] = [k, k + 1].map(|k| colors[k].map(f32::from));
    [0, 1, 2].map(|c| (a[c] + (b[c] - a[c]) * (at - k as f32)).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_and_middles() {
        assert_eq!([heat(0.0), heat(2.0), heat(f32::NAN)], [[0, 0, 4], [252, 253, 191], [255; 3]]);
        assert_eq!([signed(-1.0), signed(0.0), signed(9.0)], [[5, 48, 97], [247; 3], [103, 0, 31]]);
        assert_eq!(signed(f32::NAN), [255, 0, 255]);
    }
}
