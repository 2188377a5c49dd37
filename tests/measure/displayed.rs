//! Errors of images as a display shows them.

use skylit::colour::srgb_encode;
use skylit::measure::displayed::{Displayed, Flicker, FlickerMeter, FrameReference, ImageErrors, without_reference};
use skylit::measure::flip::flip;

#[test]
fn lamps_are_as_bright_as_the_display() {
    let lamp = Displayed::new(&[0.0, 0.5, 50.0], 3);
    assert_eq!(lamp.linear, [0.0, 0.5, 1.0]);
    assert!((lamp.coded[1] - 0.7354).abs() < 1e-4 && (lamp.coded[2] - 1.0).abs() < 1e-6);
    assert_eq!(Displayed::new(&[1.5, 0.25], 1).coded, [1.0, 0.25]);
    assert!(Displayed::new(&[0.0, f32::NAN, 1.0], 3).coded.iter().all(|v| v.is_nan()));
}

#[test]
fn errors_of_displayed_images() {
    let (a, b) = ([0.25f32; 48], [0.75f32; 48]);
    let reference = FrameReference::new([&a, &b], 3, 4, None).unwrap();
    let expected = 0.5 * f64::from(srgb_encode(0.75) - srgb_encode(0.25));
    assert!((reference.rmse - expected).abs() < 1e-6);
    // what is right is better than the reference knows
    let exact = reference.errors_of(&[0.5; 48]).unwrap();
    assert_eq!((exact.rmse, exact.corrected, exact.flip, exact.bias), (0.0, 0.0, 0.0, 0.0));
    let bright = reference.errors_of(&[1.0; 48]).unwrap();
    assert!((bright.bias - 1.0).abs() < 1e-6 && bright.flip > 0.1);
    assert!((bright.rel_mse - 0.25 / 0.26).abs() < 1e-6);
    let rmse = f64::from(1.0 - srgb_encode(0.5));
    assert!((bright.rmse - rmse).abs() < 1e-6 && bright.corrected < bright.rmse);
}

#[test]
fn errors_of_visibility_are_over_what_shows_something() {
    let mask = Some(vec![1.0, 0.0, 1.0, 0.0]);
    let reference = FrameReference::new([&[0.5; 4], &[0.5; 4]], 1, 4, mask).unwrap();
    let errors = reference.errors_of(&[0.75, 0.0, 0.75, 0.0]).unwrap();
    assert_eq!((errors.rmse, errors.bias), (0.25, 0.25));
    let [tanimoto, ratio] = errors.similarity.unwrap();
    assert!(tanimoto > 0.8 && tanimoto < 1.0 && (ratio - 2.0 / 3.0).abs() < 1e-6, "{tanimoto} {ratio}");
    let mean = ImageErrors::mean(&[errors, ImageErrors { similarity: Some([1.0, 1.0]), ..errors }]).unwrap();
    assert!((mean.similarity.unwrap()[0] - 0.5 * (1.0 + tanimoto)).abs() < 1e-12);
    assert_eq!((errors.over(&errors), errors.over(&ImageErrors::default())), (Some(1.0), None));
}

#[test]
fn flicker_is_between_late_frames() {
    let frame = |v: f32| Displayed { linear: vec![v; 4], coded: vec![v; 4] };
    let mut meter = FlickerMeter::new(6);
    // the first three do not count
    for v in [0.0, 1.0, 0.0, 0.5, 0.6, 0.6] {
        meter.add(&frame(v)).unwrap();
    }
    let flicker = meter.result().unwrap();
    assert_eq!(flicker.after, 4);
    assert!((flicker.greatest - 0.1).abs() < 1e-6 && (flicker.rms - 0.1 / 2f64.sqrt()).abs() < 1e-6);
    // too soon to tell
    assert_eq!(flicker.is_invisible(), None);
    assert_eq!(Flicker { after: 64, ..flicker }.is_invisible(), Some(false));
    assert!(FlickerMeter::new(96).result().is_none());
    assert_eq!(FlickerMeter::new(96).after, 64);
}

#[test]
fn the_references_own_error_is_taken_off() {
    assert!((without_reference(0.5, 0.3) - 0.4).abs() < 1e-12);
    assert_eq!(without_reference(0.1, 0.2), 0.0);
    assert!(without_reference(f64::NAN, 0.1).is_nan());
}
