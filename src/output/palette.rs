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

/// Coefficients of viridis by rising power, as shaders/common/viridis.glsl has them.
const VIRIDIS: [[f32; 3]; 7] = [
    [0.277_727_3, 0.005_407_3, 0.334_099_8],
    [0.105_093, 1.404_613_5, 1.384_590_2],
    [-0.330_861_8, 0.214_847_6, 0.095_095_2],
    [-4.634_230_5, -5.799_101, -19.332_441],
    [6.228_27, 14.179_934, 56.690_55],
    [4.776_385, -13.745_146, -65.353_035],
    [-5.435_456, 4.645_852_6, 26.312_435],
];

/// The colour of an error from 0 to 1; white for one that is not a number.
pub fn heat(error: f32) -> [u8; 3] {
    if error.is_nan() { [255; 3] } else { mix(&HEAT, error) }
}

/// The colour of a signed number from -1 to 1; magenta for one that is not a number.
pub fn signed(value: f32) -> [u8; 3] {
    if value.is_nan() { [255, 0, 255] } else { mix(&SIGNED, 0.5 + 0.5 * value) }
}

/// The colour of a share from 0 to 1 in heat maps of the real-time pipeline: viridis, by the
/// polynomial of shaders/common/viridis.glsl.
pub fn viridis(share: f32) -> [u8; 3] {
    let t = share.clamp(0.0, 1.0);
    let value = |c: usize| VIRIDIS.iter().rev().fold(0.0, |sum, row| sum * t + row[c]);
    [0, 1, 2].map(|c| (255.0 * value(c).clamp(0.0, 1.0)).round() as u8)
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

    /// Legends have the colours of the shader.
    #[test]
    fn viridis_is_that_of_the_shaders() {
        let shader = include_str!("../../shaders/common/viridis.glsl");
        for (k, row) in VIRIDIS.iter().enumerate() {
            let start = shader.find(&format!("c{k} = vec3(")).unwrap() + format!("c{k} = vec3(").len();
            let end = start + shader[start..].find(')').unwrap();
            let numbers: Vec<f32> = shader[start..end].split(',').map(|n| n.trim().parse().unwrap()).collect();
            assert!(numbers.iter().zip(row).all(|(a, b)| (a - b).abs() <= 1e-6 * b.abs()), "c{k}: {numbers:?} {row:?}");
        }
        // dark violet, green, yellow
        let [a, b, c] = [viridis(-1.0), viridis(0.5), viridis(1.0)];
        assert!(a[2] > a[1] && b[1] > b[0] && c[0] > 240 && c[1] > 220 && c[2] < 90, "{a:?} {b:?} {c:?}");
    }
}
