//! Temporal metrics: known answers, with noise where it matters.

use skylit::measure::temporal::{Drift, Ghosting, LagCurve, Residual, recovery, residual};

/// Standard normal numbers that repeat.
fn normal(count: usize, seed: u64) -> Vec<f64> {
    let mut state = seed;
    let mut uniform = || {
        // splitmix64
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut box_muller = || (-2.0 * (1.0 - uniform()).ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos();
    (0..count).map(|_| box_muller()).collect()
}

/// A truth, and a history that differs from it in half of the pixels, by either sign.
fn change(count: usize) -> (Vec<f32>, Vec<f32>) {
    let truth: Vec<f32> = (0..count).map(|i| 0.3 + 0.4 * ((i * 7 % 101) as f32 / 101.0)).collect();
    let wrong = truth.iter().enumerate().map(|(i, t)| [*t, t + 0.25, *t, t - 0.125][i % 4]).collect();
    (truth, wrong)
}

fn blend(truth: &[f32], wrong: &[f32], share: f64) -> Vec<f32> {
    truth.iter().zip(wrong).map(|(&t, &w)| (f64::from(t) + share * f64::from(w - t)) as f32).collect()
}

#[track_caller]
fn close(a: f64, b: f64, within: f64) {
    assert!((a - b).abs() <= within, "{a} is not {b}");
}

#[test]
fn residual_is_the_share_of_the_old() {
    let (truth, wrong) = change(1000);
    for share in [0.0, 0.1, 0.5, 1.0, -0.25, 1.5] {
        close(residual(&blend(&truth, &wrong, share), &truth, &wrong, None), share, 1e-6);
    }
    // by hand: d = 1, 2; errors 0.5, 0.5: g = (0.5 + 1) / 5
    let found = Residual::from_images(&[0.5, 0.5], &[0.0, 0.0], &[1.0, 2.0], None).unwrap();
    close(found.share, 0.3, 1e-12);
    // left over 0.2 and -0.1: sqrt(2 (0.2^2 + 0.2^2)) / 5
    close(found.standard_error, 0.16f64.sqrt() / 5.0, 1e-12);
    assert_eq!((found.pixels, found.contrast), (2, 2.5));
}

#[test]
fn residual_is_blind_to_what_the_mask_leaves_out() {
    let masked = |mask: &[f32]| residual(&[0.5, 9.0, f32::NAN], &[0.0; 3], &[1.0; 3], Some(mask));
    close(masked(&[1.0, 0.0, 0.0]), 0.5, 1e-12);
    assert!(masked(&[1.0, 0.0, 1.0]).is_nan(), "a broken pixel is not averaged away");
    assert!(masked(&[0.0; 3]).is_nan());
    assert_eq!(Residual::from_images(&[0.5], &[0.25], &[0.25], None), None);
    assert_eq!(Residual::from_images(&[0.5], &[0.25; 2], &[0.5], None), None);
    assert!(residual(&[], &[], &[], None).is_nan());
    assert_eq!(Residual::from_images(&[0.5], &[0.0], &[1.0], None).unwrap().standard_error, f64::INFINITY);
}

/// Noise of mean 0, stronger where it is brighter, moves the residual by no more than its standard error says.
#[test]
fn residual_under_noise() {
    let (truth, wrong) = change(4000);
    let mut squares = 0.0;
    let runs = 200;
    for seed in 0..runs {
        let noise = normal(truth.len(), seed + 1);
        let result: Vec<f32> = blend(&truth, &wrong, 0.2)
            .iter()
            .zip(&truth)
            .zip(&noise)
            .map(|((v, t), n)| v + 0.3 * t * *n as f32)
            .collect();
        let found = Residual::from_images(&result, &truth, &wrong, None).unwrap();
        assert!((found.share - 0.2).abs() < 5.0 * found.standard_error);
        squares += ((found.share - 0.2) / found.standard_error).powi(2);
    }
    // chi-squared: 1 on average, give or take a tenth
    close(squares / runs as f64, 1.0, 0.4);
}

#[test]
fn half_lives() {
    let of = |residuals: &[f64]| LagCurve::new(residuals.to_vec());
    // a blend of a half
    let (truth, wrong) = change(400);
    let mut history = wrong.clone();
    let residuals: Vec<f64> = (0..8)
        .map(|_| {
            history = blend(&truth, &history, 0.5);
            residual(&history, &truth, &wrong, None)
        })
        .collect();
    for (t, g) in residuals.iter().enumerate() {
        close(*g, 0.5f64.powi(t as i32 + 1), 1e-6);
    }
    let half = LagCurve::new(residuals);
    close(half.half_life(), 1.0, 1e-5);
    close(half.fitted_half_life(), 1.0, 1e-5);
    // 1/2, 1/4, 1/8, 1/16, 1/32
    assert_eq!(half.gone(), Some(4));
    // well defined below a frame and above many
    close(of(&[0.25]).half_life(), 0.5, 1e-12);
    close(of(&[2f64.powf(-1.0 / 32.0)]).half_life(), 32.0, 1e-9);
    assert_eq!((of(&[0.0]).half_life(), of(&[-0.01, 0.01]).half_life()), (0.0, 0.0));
    assert_eq!((of(&[1.0, 0.5]).half_life(), of(&[1.1]).half_life()), (f64::INFINITY, f64::INFINITY));
    assert!(of(&[]).half_life().is_nan() && of(&[f64::NAN]).half_life().is_nan());
    // one frame late, then at once: -ln(1) 1 - ln(0.1) 2 over 5
    close(of(&[1.0, 0.1, 0.01]).fitted_half_life(), 2f64.ln() / (2.0 * 10f64.ln() / 5.0), 1e-12);
    assert_eq!(of(&[1.0, 1.0]).fitted_half_life(), f64::INFINITY);
    assert_eq!(of(&[0.01]).fitted_half_life(), of(&[0.01]).half_life());
    assert!(of(&[]).fitted_half_life().is_nan() && of(&[0.5, f64::NAN]).fitted_half_life().is_nan());
    // never gone; gone at once; overshoot is not gone
    assert_eq!((of(&[0.5, 0.4]).gone(), of(&[0.0]).gone(), of(&[-0.5, 0.0]).gone()), (None, Some(0), Some(1)));
}

#[test]
fn ghosting_energy_of_a_sequence() {
    let (truth, wrong) = change(400);
    let mut ghosting = Ghosting::default();
    assert!(ghosting.energy().is_nan());
    // mean of d^2: (1/16 + 1/64) / 4
    let contrast = (0.0625 + 0.015_625) / 4.0;
    let first = ghosting.add(&blend(&truth, &wrong, 0.5), &truth, &wrong, None).unwrap();
    close(first.share, 0.5, 1e-6);
    close(first.contrast, contrast, 1e-7);
    close(ghosting.energy(), 0.25 * contrast, 1e-7);
    ghosting.add(&blend(&truth, &wrong, 0.25), &truth, &wrong, None);
    close(ghosting.energy(), (0.25 + 0.0625) / 2.0 * contrast, 1e-7);
    // a frame with nothing to forget has no ghost, but pixels
    let before = ghosting.energy();
    assert_eq!(ghosting.add(&truth, &truth, &truth, None), None);
    close(ghosting.energy(), before * 2.0 / 3.0, 1e-9);
    ghosting.add(&truth, &truth[1..], &truth, None);
    assert!(ghosting.energy().is_nan());
}

#[test]
fn recovery_is_when_it_stays() {
    let errors = [0.5, 0.2, 0.1, 0.14, 0.105, 0.1];
    assert_eq!(recovery(&errors, 0.1, 1.1), Some(4));
    assert_eq!(recovery(&errors, 0.1, 1.5), Some(2));
    assert_eq!(recovery(&errors, 1.0, 1.0), Some(0));
    assert_eq!(recovery(&errors, 0.05, 1.5), None);
    assert_eq!(recovery(&[], 0.1, 1.1), None);
    assert_eq!(recovery(&[0.1, f64::NAN], 0.1, 1.1), None);
    assert_eq!(recovery(&[f64::NAN, 0.1], 0.1, 1.1), Some(1));
}

#[test]
fn drift_by_hand() {
    assert_eq!(Drift::from_values(&[1.0, 2.0]), None);
    let still = Drift::from_values(&[0.5; 10]).unwrap();
    assert!(still.slope == 0.0 && still.standard_error == 0.0 && still.is_level());
    let line: Vec<f64> = (0..10).map(|t| 0.25 * f64::from(t)).collect();
    let line = Drift::from_values(&line).unwrap();
    assert!(line.slope == 0.25 && !line.is_level());
    // 0, 1, 0: no slope; left over -1/3, 2/3, -1/3; neighbours against each other widen nothing
    let bump = Drift::from_values(&[0.0, 1.0, 0.0]).unwrap();
    close(bump.slope, 0.0, 1e-15);
    close(bump.standard_error, (2.0f64 / 3.0 / 2.0).sqrt(), 1e-12);
    assert!(bump.correlation < 0.0 && bump.is_level());
    assert!(!Drift::from_values(&[0.0, f64::NAN, 0.0]).unwrap().is_level(), "what is broken does not pass");
}

/// Noise alone is level, also noise that a history hands from frame to frame; a drift far below the noise of a frame is not.
#[test]
fn drift_under_noise() {
    let frames = 2000;
    let (mut passed, mut passed_smooth, mut found) = (0, 0, 0);
    for seed in 0..100 {
        let noise = normal(frames, 1000 + seed);
        let smooth: Vec<f64> = noise
            .iter()
            .scan(0.0, |state, n| {
                *state = 0.9 * *state + 0.1 * n;
                Some(*state)
            })
            .collect();
        passed += usize::from(Drift::from_values(&noise).unwrap().is_level());
        passed_smooth += usize::from(Drift::from_values(&smooth).unwrap().is_level());
        // over the run 0.6 of the deviation of one frame: nearly eight standard errors
        let drifting: Vec<f64> = noise.iter().enumerate().map(|(t, n)| 0.6 * t as f64 / frames as f64 + n).collect();
        found += usize::from(!Drift::from_values(&drifting).unwrap().is_level());
    }
    println!("level: {passed} of noise, {passed_smooth} of smooth noise; drift found in {found}");
    assert!(passed >= 97 && passed_smooth >= 96 && found >= 97, "{passed} {passed_smooth} {found}");
}

#[test]
fn a_lasting_error_is_no_ghost() {
    let (old, new) = ([0.0, 1.0], [1.0, 0.0]);
    // it ends a tenth too bright, and a quarter of the old is left
    let settled = [1.1, 0.1];
    let image = [0.85, 0.35];
    let mut ghosting = Ghosting::default();
    let left = ghosting.add_beside((&image, &settled), (&new, &old), None).unwrap();
    assert!((left.share - 0.25).abs() < 1e-6 && (ghosting.energy() - 0.0625).abs() < 1e-6);
}

/// Two pixels of three channels, of which the second counts.
#[test]
fn a_pixel_counts_with_all_channels() {
    let (old, new) = ([0.0; 6], [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    let image = [9.0, 9.0, 9.0, 0.5, 0.5, 0.5];
    let left = Ghosting::default().add_beside((&image, &new), (&new, &old), Some(&[0.0, 1.0])).unwrap();
    assert!(left.pixels == 3 && (left.share - 0.5).abs() < 1e-6, "{left:?}");
}
