//! Whether an image shows anything: its mean over surfaces, and a remedy if all is black or white.

use crate::film::Film;
use crate::film::accumulate::Accumulated;
use crate::settings::Capability;

/// Images whose mean is outside of this range are warned about.
const RANGE: [f64; 2] = [0.02, 0.98];
/// Share of a pixel that surfaces must cover to count.
const COVERED: f32 = 0.99;
/// Luminance of middle grey.
const MIDDLE_GREY: f64 = 0.18;
/// Exposures of fewer stops are not chosen: such an image shows what it has.
const FAR: f64 = 3.0;
/// Values count as this share of the mean at least.
const DARK: f64 = 1e-2;
/// Where the logarithms ask for more light, this share of the surfaces stays below white.
const KEPT: f64 = 0.95;
/// Luminance of linear sRGB.
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Mean of the pixels that show surfaces alone, luminance for colours; `None` without any.
pub fn surface_mean(image: &Accumulated, channels: usize) -> Option<f64> {
    let film = &image.film;
    let weights: &[f64] = if channels == 3 { &LUMINANCE } else { &[1.0] };
    let count = film.coverage.iter().filter(|a| **a >= COVERED).count();
    let sum = |c: usize| -> f64 {
        film.plane(c).iter().zip(&film.coverage).filter(|(_, a)| **a >= COVERED).map(|(v, _)| f64::from(*v)).sum()
    };
    (count > 0).then(|| weights.iter().enumerate().map(|(c, w)| w * sum(c)).sum::<f64>() / count as f64)
}

/// [`exposure`] of a film of three channels.
pub fn film_exposure(film: &Film) -> Option<f64> {
    exposure(&film.mean, &film.coverage)
}

/// Exposure, in whole stops, at which surfaces are middle grey on average of their logarithms, or
/// at which the brightest twentieth becomes white if that is less; `None` where that is near to
/// what is shown anyway, and where no surface has light. Reinhard, Stark, Shirley, Ferwerda,
/// "Photographic Tone Reproduction for Digital Images", SIGGRAPH 2002.
///
/// `rgb` has three values a pixel, linear; `coverage` is the share of a pixel that surfaces cover.
pub fn exposure(rgb: &[f32], coverage: &[f32]) -> Option<f64> {
    let shown = rgb.chunks_exact(3).zip(coverage).filter(|(_, a)| **a >= COVERED);
    let luminance = |(rgb, _): (&[f32], _)| -> f64 { LUMINANCE.iter().zip(rgb).map(|(w, v)| w * f64::from(*v)).sum() };
    let mut values: Vec<f64> = shown.map(luminance).collect();
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    if mean <= 0.0 || !mean.is_finite() {
        return None;
    }

    // what light hardly reaches must not decide
    let logarithms = values.iter().map(|v| v.max(DARK * mean).ln()).sum::<f64>();
    let average = (logarithms / values.len() as f64).exp();
    let grey = (MIDDLE_GREY / average).log2();

    // of much darkness and some light, the light is what is looked at
    let bright = (KEPT * (values.len() - 1) as f64) as usize;
    let (_, bright, _) = values.select_nth_unstable_by(bright, f64::total_cmp);
    let stops = if grey > 0.0 { grey.min((-bright.log2()).max(0.0)) } else { grey };
    (stops.abs() >= FAR).then(|| stops.round())
}

/// A warning about an image of this mean, with a remedy; `None` if it is fine. `exposure` in stops.
pub fn warning(mean: f64, capabilities: &[Capability], exposure: f64) -> Option<String> {
    use Capability::{AmbientOcclusion, SceneLights, WhiteSky};
    let [least, most] = RANGE;
    let can = |c| capabilities.contains(&c);
    if can(SceneLights) {
        let shown = mean * exposure.exp2();
        // a surface of middle grey
        let stops = (0.2 / mean.max(1e-30)).log2().round();
        return match shown {
            // nothing makes it brighter
            _ if mean <= 0.0 => None,
            v if v < least => Some(format!(
                "the image is all but black: surfaces have a mean radiance of {mean:.2e}; --exposure {stops} shows them"
            )),
            v if v > most => Some(format!(
                "the image is all but white: surfaces have a mean radiance of {mean:.3}; \
                 --exposure {stops} or --tone-map agx shows them"
            )),
            _ => None,
        };
    }

    // visibility, which exposure does not help
    if !can(AmbientOcclusion) && !can(WhiteSky) {
        return None;
    }
    let darker = if can(AmbientOcclusion) {
        "in a closed room every ray hits something: --ao-radius auto (or a number, or 5%) limits how far occluders reach"
    } else {
        "the sky does not reach what the camera sees; --view chooses another camera"
    };
    match mean {
        v if v < least => {
            Some(format!("the image is all but black: surfaces in view are {:.1} % open; {darker}", 100.0 * v))
        }
        v if v > most => Some(format!(
            "the image is all but white: surfaces in view are {:.1} % open; \
             --view inside, --eye and --target look at another place{}",
            100.0 * v,
            if can(AmbientOcclusion) { ", a larger --ao-radius finds occluders farther away" } else { "" }
        )),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposures_follow_surfaces() {
        let image = |values: &[(f32, f32)]| {
            let rgb: Vec<f32> = values.iter().flat_map(|(value, _)| [*value; 3]).collect();
            let coverage: Vec<f32> = values.iter().map(|(_, coverage)| *coverage).collect();
            exposure(&rgb, &coverage)
        };
        assert_eq!(image(&[(0.18, 1.0), (0.36, 1.0)]), None);
        // the average of logarithms, of surfaces alone
        assert_eq!(image(&[(180.0, 1.0), (1.8, 1.0), (1e9, 0.5)]), Some(-7.0));
        assert_eq!(image(&[(0.18 / 16.0, 1.0)]), Some(4.0));
        assert_eq!(image(&[(0.18 / 6.0, 1.0)]), None);
        // one pixel without light changes little, and none has no exposure
        assert_eq!(image(&[(0.0, 1.0), (18.0, 1.0), (18.0, 1.0), (18.0, 1.0)]), Some(-5.0));
        // most of it dark, and a fifth lit: as bright as what is lit allows
        let lit = |value: f32| {
            let mut pixels = vec![(0.0, 1.0); 80];
            pixels.extend([(value, 1.0); 20]);
            image(&pixels)
        };
        assert_eq!(lit(0.5), None);
        assert_eq!(lit(1.0 / 32.0), Some(5.0));
        assert_eq!(image(&[(0.0, 1.0)]), None);
        assert_eq!(image(&[]), None);
    }

    #[test]
    fn what_shows_nothing_is_warned_about() {
        use Capability::{AmbientLight, AmbientOcclusion, SceneLights, WhiteSky};
        let of = |mean: f64, capabilities: &[Capability]| warning(mean, capabilities, 0.0).unwrap_or_default();
        assert!(of(0.001, &[AmbientOcclusion]).contains("--ao-radius auto"));
        assert!(of(0.999, &[AmbientOcclusion]).contains("--view inside"));
        assert!(of(0.001, &[WhiteSky]).contains("--view"));
        assert!(of(0.002, &[SceneLights]).contains("--exposure 7 "));
        assert!(of(3.2, &[SceneLights, AmbientOcclusion, AmbientLight]).contains("--exposure -4 "));
        for fine in [of(0.5, &[AmbientOcclusion]), of(0.0, &[SceneLights]), of(0.0, &[]), of(0.3, &[SceneLights])] {
            assert_eq!(fine, "");
        }
        assert!(warning(0.002, &[SceneLights], 7.0).is_none());
    }
}
