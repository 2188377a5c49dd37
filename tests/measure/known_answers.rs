//! Metrics against other people's implementations: NumPy, scikit-image and the authors' FLIP (tests/measure/known_answers.py).

use serde_json::Value;
use skylit::measure::flip::{PIXELS_PER_DEGREE, flip, flip_hdr};
use skylit::measure::metrics::ImagePair;
use skylit::measure::ssim::ssim;

const WIDTH: usize = 60;
const HEIGHT: usize = 48;

/// Squares of two brightnesses and noise, as known_answers.py makes them.
fn image(channels: usize, seed: u32, peak: f32, shift: usize) -> Vec<f32> {
    let mut state = seed;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    (0..WIDTH * HEIGHT * channels)
        .map(|k| {
            let (x, y) = (k / channels % WIDTH, k / channels / WIDTH);
            let square = (((x + shift) / 8 + y / 8) % 2) as f32;
            (0.25 * noise() + 0.5 * square) * peak
        })
        .collect()
}

#[test]
fn metrics_agree_with_other_implementations() {
    let answers: Value = serde_json::from_str(include_str!("known_answers.json")).unwrap();
    let answers = answers.as_array().unwrap();
    assert_eq!(answers.len(), 4);
    for answer in answers {
        let (channels, peak) = (answer["channels"].as_u64().unwrap() as usize, answer["peak"].as_f64().unwrap() as f32);
        let (a, b) = (image(channels, 1, peak, 1), image(channels, 2, peak, 0));
        let pair = ImagePair::new(&a, &b, channels, None).unwrap();
        let close = |name: &str, found: f64, expected: &Value| {
            let expected = expected.as_f64().unwrap();
            let apart = (found - expected).abs() / expected.abs().max(1.0);
            assert!(apart <= 1e-4, "{name} of {channels} channels up to {peak}: {found}, elsewhere {expected}");
        };
        for (name, found) in [
            ("rmse", pair.rmse()),
            ("mae", pair.mae()),
            ("rel_mse", pair.rel_mse()),
            ("psnr", pair.psnr()),
            ("ssim", ssim(&pair, WIDTH).unwrap().unwrap()),
            ("bias", pair.bias()),
            ("bias_standard_error", pair.bias_standard_error()),
            ("max", pair.max_abs_difference()),
            ("tanimoto", pair.tanimoto()),
            ("minimum_ratio", pair.minimum_ratio()),
        ] {
            close(name, found, &answer[name]);
        }
        for (found, expected) in
            pair.percentiles([0.5, 0.95, 0.99]).iter().zip(answer["percentiles"].as_array().unwrap())
        {
            close("percentile", *found, expected);
        }
        if let Some(expected) = answer.get("flip") {
            close("flip", flip(&pair, WIDTH, PIXELS_PER_DEGREE).unwrap().mean, expected);
        }
        let hdr = flip_hdr(&pair, WIDTH, PIXELS_PER_DEGREE).unwrap().unwrap();
        close("flip over exposures", hdr.mean, &answer["flip_hdr"]);
        assert_eq!(Some(u64::from(hdr.exposures)), answer["exposures"].as_u64());
        hdr.stops.iter().zip(answer["stops"].as_array().unwrap()).for_each(|(s, e)| close("exposure", *s, e));
    }
}

#[test]
fn ssim_of_small_and_masked_images() {
    let image = image(1, 1, 1.0, 0);
    let of = |a: &[f32], b: &[f32], coverage: Option<&[f32]>, width| {
        ssim(&ImagePair::new(a, b, 1, coverage).unwrap(), width).unwrap()
    };
    assert_eq!(of(&image, &image, None, WIDTH), Some(1.0));
    // smaller than the window, and no pixel whose window is inside the image
    assert_eq!(of(&image[..600], &image[..600], None, WIDTH), None);
    let mut mask = vec![0.0; image.len()];
    mask[WIDTH * 4 + 30] = 1.0;
    assert_eq!(of(&image, &image, Some(&mask), WIDTH), None);
    // a difference beyond the window of the one pixel that counts is not seen
    mask[WIDTH * 20 + 30] = 1.0;
    let mut other = image.clone();
    (other[WIDTH * 20 + 36], other[WIDTH * 26 + 30]) = (9.0, f32::NAN);
    assert_eq!(of(&image, &other, Some(&mask), WIDTH), Some(1.0));
    other[WIDTH * 20 + 35] = 9.0;
    assert!(of(&image, &other, Some(&mask), WIDTH).unwrap() < 0.999);
    assert!(ssim(&ImagePair::new(&image, &image, 1, None).unwrap(), 7).is_err());
}

#[test]
fn exposures_follow_the_reference() {
    let black = vec![0.0; 40 * 40];
    let of = |a: &[f32], b: &[f32]| flip_hdr(&ImagePair::new(a, b, 1, None).unwrap(), 40, PIXELS_PER_DEGREE).unwrap();
    assert_eq!(of(&black, &black), None, "nothing to expose for");
    // a light that is seen a thousand times too bright looks the same on a display, and not at an exposure for it
    let mut light = vec![0.2; 40 * 40];
    light[820..840].fill(10.0);
    let mut brighter = light.clone();
    brighter[820..840].fill(10_000.0);
    let pair = ImagePair::new(&brighter, &light, 1, None).unwrap();
    assert_eq!(flip(&pair, 40, PIXELS_PER_DEGREE).unwrap().mean, 0.0);
    let hdr = of(&brighter, &light).unwrap();
    assert!(hdr.mean > 0.0 && hdr.exposures >= 5, "{hdr:?}");
    assert!((hdr.stops[1] - hdr.stops[0] - 50f64.log2()).abs() < 1e-4);
    // mostly black
    let mut spark = black.clone();
    spark[0] = 1.0;
    // as if the median were 2^-23
    assert!(of(&spark, &spark).is_some_and(|h| h.mean == 0.0 && h.exposures == 23));
    spark[5] = f32::NAN;
    assert!(of(&spark, &spark).unwrap().mean.is_nan());
}
