//! The colour of what glows: Planck's law seen by the CIE 1931 observer, in linear sRGB.

use glam::{DMat3, DVec3, Vec3};

/// Linear sRGB of a black body of a temperature in kelvin, of luminance 1. Primaries that sRGB cannot show are cut off at 0: below about 1900 K
/// blue is. CIE matching functions by the fits of Wyman, Sloan, Shirley, "Simple Analytic Approximations to the CIE XYZ Color Matching Functions",
/// JCGT 2013.
pub fn blackbody(kelvin: f64) -> Vec3 {
    let xyz = blackbody_xyz(kelvin);
    // IEC 61966-2-1
    let to_srgb = DMat3::from_cols(
        DVec3::new(3.240_969_9, -0.969_243_6, 0.055_630_1),
        DVec3::new(-1.537_383_2, 1.875_967_5, -0.203_977),
        DVec3::new(-0.498_610_8, 0.041_555_1, 1.056_971_5),
    );
    let rgb = (to_srgb * (xyz / xyz.y)).max(DVec3::ZERO);
    (rgb / rgb.dot(DVec3::new(0.2126, 0.7152, 0.0722))).as_vec3()
}

/// CIE XYZ of a black body, of no particular scale.
fn blackbody_xyz(kelvin: f64) -> DVec3 {
    // nanometres
    (0..=94).map(|k| 360.0 + 5.0 * f64::from(k)).map(|l| matching(l) * planck(l, kelvin)).sum()
}

/// Spectral radiance at a wavelength in nanometres, of no particular scale.
fn planck(nanometres: f64, kelvin: f64) -> f64 {
    /// h c / k in nanometre kelvin (CODATA 2018).
    const C2: f64 = 1.438_776_877e7;
    (nanometres / 560.0).powi(-5) / (C2 / (nanometres * kelvin)).exp_m1()
}

/// Matching functions at a wavelength in nanometres.
fn matching(l: f64) -> DVec3 {
    let lobe = |height: f64, peak: f64, below: f64, above: f64| {
        let t = (l - peak) / if l < peak { below } else { above };
        height * (-0.5 * t * t).exp()
    };
    DVec3::new(
        lobe(1.056, 599.8, 37.9, 31.0) + lobe(0.362, 442.0, 16.0, 26.7) + lobe(-0.065, 501.1, 20.4, 26.2),
        lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1),
        lobe(1.217, 437.0, 11.8, 36.0) + lobe(0.681, 459.0, 26.0, 13.8),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chromaticities of CIE 15: illuminant A, and the Planckian locus at 6500 K.
    #[test]
    fn known_chromaticities() {
        for (kelvin, x, y) in [(2855.54, 0.44757, 0.40745), (6500.0, 0.31352, 0.32363), (10000.0, 0.28063, 0.28828)] {
            let xyz = blackbody_xyz(kelvin);
            let sum = xyz.element_sum();
            assert!((xyz.x / sum - x).abs() < 4e-3 && (xyz.y / sum - y).abs() < 4e-3, "{kelvin}: {:?}", xyz / sum);
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
