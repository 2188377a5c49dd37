//! Colours of black-body emitters: Planck's law with the CIE 1931 observer, in linear sRGB.

use glam::{DMat3, DVec3, Vec3};

/// Linear sRGB of a black body of a temperature in kelvin, of luminance 1. Primaries that sRGB
/// cannot show are cut off at 0: below about 1900 K blue is.
pub fn blackbody(kelvin: f64) -> Vec3 {
    let xyz = blackbody_xyz(kelvin);
    let rgb = (TO_SRGB * (xyz / xyz.y)).max(DVec3::ZERO);
    (rgb / rgb.dot(DVec3::new(0.2126, 0.7152, 0.0722))).as_vec3()
}

/// From CIE XYZ to linear sRGB (IEC 61966-2-1).
pub(super) const TO_SRGB: DMat3 = DMat3::from_cols(
    DVec3::new(3.240_969_9, -0.969_243_6, 0.055_630_1),
    DVec3::new(-1.537_383_2, 1.875_967_5, -0.203_977),
    DVec3::new(-0.498_610_8, 0.041_555_1, 1.056_971_5),
);

/// Colour matching functions x, y and z at 380 + 5 `step` nanometres, up to a step of 80.
pub(super) fn observer(step: usize) -> DVec3 {
    DVec3::from_array(MATCHING[step])
}

/// CIE XYZ of a black body, of no particular scale.
fn blackbody_xyz(kelvin: f64) -> DVec3 {
    (0..).zip(MATCHING).map(|(k, xyz)| DVec3::from_array(xyz) * planck(380.0 + 5.0 * f64::from(k), kelvin)).sum()
}

/// Spectral radiance at a wavelength in nanometres, of no particular scale.
pub(super) fn planck(nanometres: f64, kelvin: f64) -> f64 {
    /// h c / k in nanometre kelvin (CODATA 2018).
    const C2: f64 = 1.438_776_877e7;
    (nanometres / 560.0).powi(-5) / (C2 / (nanometres * kelvin)).exp_m1()
}

/// Colour matching functions of the CIE 1931 standard observer (2 degrees), x, y and z, every 5 nm
/// from 380 nm to 780 nm (CIE 15:2004, table T.4).
#[rustfmt::skip]
const MATCHING: [[f64; 3]; 81] = [
    [0.001368, 0.000039, 0.00645],
    [0.002236, 0.000064, 0.01055],
    [0.004243, 0.00012, 0.02005],
    [0.00765, 0.000217, 0.03621],
    [0.01431, 0.000396, 0.06785],
    [0.02319, 0.00064, 0.1102],
    [0.04351, 0.00121, 0.2074],
    [0.07763, 0.00218, 0.3713],
    [0.13438, 0.004, 0.6456],
    [0.21477, 0.0073, 1.03905],
    [0.2839, 0.0116, 1.3856],
    [0.3285, 0.01684, 1.62296],
    [0.34828, 0.023, 1.74706],
    [0.34806, 0.0298, 1.7826],
    [0.3362, 0.038, 1.77211],
    [0.3187, 0.048, 1.7441],
    [0.2908, 0.06, 1.6692],
    [0.2511, 0.0739, 1.5281],
    [0.19536, 0.09098, 1.28764],
    [0.1421, 0.1126, 1.0419],
    [0.09564, 0.13902, 0.81295],
    [0.05795, 0.1693, 0.6162],
    [0.03201, 0.20802, 0.46518],
    [0.0147, 0.2586, 0.3533],
    [0.0049, 0.323, 0.272],
    [0.0024, 0.4073, 0.2123],
    [0.0093, 0.503, 0.1582],
    [0.0291, 0.6082, 0.1117],
    [0.06327, 0.71, 0.07825],
    [0.1096, 0.7932, 0.05725],
    [0.1655, 0.862, 0.04216],
    [0.22575, 0.91485, 0.02984],
    [0.2904, 0.954, 0.0203],
    [0.3597, 0.9803, 0.0134],
    [0.43345, 0.99495, 0.00875],
    [0.51205, 1.0, 0.00575],
    [0.5945, 0.995, 0.0039],
    [0.6784, 0.9786, 0.00275],
    [0.7621, 0.952, 0.0021],
    [0.8425, 0.9154, 0.0018],
    [0.9163, 0.87, 0.00165],
    [0.9786, 0.8163, 0.0014],
    [1.0263, 0.757, 0.0011],
    [1.0567, 0.6949, 0.001],
    [1.0622, 0.631, 0.0008],
    [1.0456, 0.5668, 0.0006],
    [1.0026, 0.503, 0.00034],
    [0.9384, 0.4412, 0.00024],
    [0.85445, 0.381, 0.00019],
    [0.7514, 0.321, 0.0001],
    [0.6424, 0.265, 0.00005],
    [0.5419, 0.217, 0.00003],
    [0.4479, 0.175, 0.00002],
    [0.3608, 0.1382, 0.00001],
    [0.2835, 0.107, 0.0],
    [0.2187, 0.0816, 0.0],
    [0.1649, 0.061, 0.0],
    [0.1212, 0.04458, 0.0],
    [0.0874, 0.032, 0.0],
    [0.0636, 0.0232, 0.0],
    [0.04677, 0.017, 0.0],
    [0.0329, 0.01192, 0.0],
    [0.0227, 0.00821, 0.0],
    [0.01584, 0.005723, 0.0],
    [0.011359, 0.004102, 0.0],
    [0.008111, 0.002929, 0.0],
    [0.00579, 0.002091, 0.0],
    [0.004109, 0.001484, 0.0],
    [0.002899, 0.001047, 0.0],
    [0.002049, 0.00074, 0.0],
    [0.00144, 0.00052, 0.0],
    [0.001, 0.000361, 0.0],
    [0.00069, 0.000249, 0.0],
    [0.000476, 0.000172, 0.0],
    [0.000332, 0.00012, 0.0],
    [0.000235, 0.000085, 0.0],
    [0.000166, 0.00006, 0.0],
    [0.000117, 0.000042, 0.0],
    [0.000083, 0.00003, 0.0],
    [0.000059, 0.000021, 0.0],
    [0.000042, 0.000015, 0.0],
];

#[cfg(test)]
mod tests {
    use super::*;

    /// The table's sums, as CIE 15 prints them below it.
    #[test]
    fn matching_functions_have_equal_sums() {
        let sums: DVec3 = MATCHING.into_iter().map(DVec3::from_array).sum();
        assert!((sums - DVec3::new(21.371524, 21.371327, 21.371540)).length() < 1e-9, "{sums}");
    }

    /// Chromaticities of CIE 15: illuminant A, and the Planckian locus.
    #[test]
    fn known_chromaticities() {
        let known = [
            (2855.54, 0.44757, 0.40745),
            (1000.0, 0.6528, 0.3444),
            (2000.0, 0.5267, 0.4133),
            (6500.0, 0.31352, 0.32363),
            (10000.0, 0.28063, 0.28828),
        ];
        for (kelvin, x, y) in known {
            let xyz = blackbody_xyz(kelvin);
            let (found_x, found_y) = (xyz.x / xyz.element_sum(), xyz.y / xyz.element_sum());
            println!("{kelvin} K: x {found_x:.5} ({x}), y {found_y:.5} ({y}), RGB {}", blackbody(kelvin));
            assert!((found_x - x).abs() < 1.5e-4 && (found_y - y).abs() < 1.5e-4, "{kelvin}: {found_x} {found_y}");
        }
    }

    #[test]
    fn hotter_is_bluer_and_luminance_stays() {
        let all: Vec<_> = [1000.0, 2000.0, 4000.0, 8000.0, 40000.0].map(blackbody).to_vec();
        for c in &all {
            assert!((c.dot(Vec3::new(0.2126, 0.7152, 0.0722)) - 1.0).abs() < 1e-5, "{c}");
            assert!(c.min_element() >= 0.0 && c.is_finite());
        }
        assert!(all.windows(2).all(|w| w[1].z >= w[0].z && w[1].x < w[0].x), "{all:?}");
    }
}
