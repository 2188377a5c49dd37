//! The colour spaces of FLIP: linear sRGB to opponent colours, in which the eye's blur is applied,
//! and to CIE L\*a\*b\* with Hunt's adjustment, in which colours are told apart.

use glam::{DMat3, Mat3, Vec3};

/// Linear sRGB to CIE XYZ (D65), as the authors have it, row by row.
const RGB_TO_XYZ: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// Luminance (CIE Y) of linear sRGB.
pub fn luminance(red: f32, green: f32, blue: f32) -> f32 {
    let [r, g, b] = RGB_TO_XYZ[1].map(|w| w as f32);
    r * red + g * green + b * blue
}

/// The way between linear sRGB and XYZ over the white of the display, there and back.
#[derive(Clone, Copy, Debug)]
pub struct Space {
    to_xyz: Mat3,
    to_rgb: Mat3,
}

impl Space {
    /// White is (1, 1, 1) in both.
    pub fn new() -> Self {
        let rows = RGB_TO_XYZ.map(|row| {
            let white: f64 = row.iter().sum();
            row.map(|v| v / white)
        });
        let to_xyz = DMat3::from_cols_array_2d(&rows).transpose();
        Self { to_xyz: to_xyz.as_mat3(), to_rgb: to_xyz.inverse().as_mat3() }
    }

    /// Luminance, red against green, yellow against blue: (y, x - y, y - z).
    ///
    /// The paper's YCxCz is (116 y - 16, 500 (x - y), 200 (y - z)). Filters whose weights add up to
    /// one commute with that scaling, so it is left out; and this y is what the paper normalises Y
    /// to before it looks for edges.
    pub fn opponent(&self, rgb: Vec3) -> Vec3 {
        let v = self.to_xyz * rgb;
        Vec3::new(v.y, v.x - v.y, v.y - v.z)
    }

    /// Opponent colours to L\*a\*b\* with Hunt's adjustment, by way of what the display can show.
    pub fn lab_of_opponent(&self, c: Vec3) -> Vec3 {
        self.lab((self.to_rgb * Vec3::new(c.x + c.y, c.x, c.x - c.z)).clamp(Vec3::ZERO, Vec3::ONE))
    }

    /// Linear sRGB to CIE L\*a\*b\*, a\* and b\* scaled by L\* / 100: differences in hue count less
    /// where it is dark (Hunt 1952).
    pub fn lab(&self, rgb: Vec3) -> Vec3 {
        let v = self.to_xyz * rgb;
        let (x, y, z) = (response(v.x), response(v.y), response(v.z));
        let l = 116.0 * y - 16.0;
        Vec3::new(l, 0.01 * l * 500.0 * (x - y), 0.01 * l * 200.0 * (y - z))
    }
}

/// L\* of a luminance in [0, 1]; in [0, 100].
pub fn lightness(y: f32) -> f32 {
    116.0 * response(y) - 16.0
}

/// HyAB distance of two L\*a\*b\* colours (Abasi et al. 2020): city block in lightness, Euclidean
/// in colour.
pub fn hyab(a: Vec3, b: Vec3) -> f32 {
    let d = a - b;
    d.x.abs() + d.y.hypot(d.z)
}

/// The compressive function of CIE L\*a\*b\*.
fn response(v: f32) -> f32 {
    const DELTA: f32 = 6.0 / 29.0;
    if v > DELTA * DELTA * DELTA { v.cbrt() } else { v / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
}
