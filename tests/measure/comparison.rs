//! Which channels and pixels of two images are compared, and what is refused.

use skylit::measure::comparison::{CompareOptions, compare};
use skylit::measure::mask::MaskOptions;
use skylit::output::{Channel, Image, Samples};
use skylit::{Error, Result};

const SIZE: usize = 16;

fn image(channels: Vec<(&str, Vec<f32>)>) -> Image {
    let channels =
        channels.into_iter().map(|(name, v)| Channel { name: name.into(), samples: Samples::F32(v) }).collect();
    Image { width: SIZE as u32, height: SIZE as u32, channels, metadata: Vec::new() }
}

fn filled(value: f32) -> Vec<f32> {
    vec![value; SIZE * SIZE]
}

fn grey(value: f32) -> Image {
    image(vec![("Y", filled(value))])
}

fn of(a: &Image, b: &Image) -> Result<skylit::measure::comparison::Comparison> {
    compare(a, b, &CompareOptions::default())
}

#[test]
fn colour_is_compared_and_nothing_else() {
    // histories of different length are no difference
    let mut a = image(vec![("Y", filled(0.5)), ("samples", filled(8.0)), ("depth.Z", filled(1.0))]);
    let b = image(vec![("Y", filled(0.25)), ("samples", filled(64.0)), ("depth.Z", filled(3.0))]);
    let c = of(&a, &b).unwrap();
    assert_eq!((&c.channels[..], c.pixels, c.rmse, c.bias, c.max), (&["Y".to_owned()][..], 256, 0.25, 0.25, 0.25));
    assert!(c.flip.unwrap() > 0.1 && c.flip_hdr.is_none() && c.ssim.is_some());
    // ... unless they are asked for
    let named = CompareOptions { channels: vec!["depth.Z".into(), "samples".into()], ..Default::default() };
    let c = compare(&a, &b, &named).unwrap();
    assert_eq!((&c.channel_rmse[..], c.flip, c.ssim), (&[2.0, 56.0][..], None, None));
    // a grey image against a coloured one: three equal channels
    let colour = image(vec![("R", filled(0.5)), ("G", filled(0.5)), ("B", filled(1.5))]);
    let c = of(&grey(0.5), &colour).unwrap();
    assert_eq!((c.channels.len(), &c.channel_rmse[..]), (3, &[0.0, 0.0, 1.0][..]));
    assert!(c.flip_hdr.is_some(), "a value exceeds 1");
    assert_eq!(of(&colour, &grey(0.5)).unwrap().bias, 1.0 / 3.0);
    a.channels.remove(0);
    let error = of(&a, &b).unwrap_err().to_string();
    assert!(error.contains("the image has no colour") && error.contains("depth.Z"), "{error}");
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let mut wide = grey(0.5);
    (wide.width, wide.height) = (32, 8);
    assert!(matches!(of(&wide, &grey(0.5)), Err(Error::CheckFailed(e)) if e.contains("32x8 and 16x16")));
    let named = |name: &str| {
        compare(&grey(0.5), &grey(0.5), &CompareOptions { channels: vec![name.into()], ..Default::default() })
            .unwrap_err()
    };
    assert!(named("Z").to_string().contains("no channel Z of numbers; it has Y"));
    let mut bytes = grey(0.5);
    bytes.metadata.push(("encoding".into(), "8-bit sRGB".into()));
    assert!(of(&bytes, &grey(0.9)).is_ok());
    assert!(
        of(&bytes, &grey(2.0))
            .unwrap_err()
            .to_string()
            .contains("the image is 8-bit sRGB, and the reference has linear values up to 2")
    );
    assert!(of(&grey(2.0), &bytes).unwrap_err().to_string().contains("the reference is 8-bit sRGB"));
}

#[test]
fn bad_pixels_are_counted_apart() {
    let mut values = filled(0.5);
    (values[0], values[1], values[2], values[3]) = (f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::NAN);
    let mut reference = filled(0.5);
    (reference[2], reference[3]) = (f32::INFINITY, f32::NAN);
    let c = of(&image(vec![("Y", values)]), &image(vec![("Y", reference)])).unwrap();
    assert_eq!((c.bad.nan, c.bad.infinite, c.bad.not_finite(), c.pixels, c.rmse), (1, 2, 3, 252, 0.0));
    assert!(c.bad.outliers.is_none() && c.maps.difference[0].is_nan() && c.maps.compared[0] == 0.0);
}

#[test]
fn outliers_are_what_noise_does_not_explain() {
    // a standard error of 0.1 / sqrt(25) = 0.02 in each image: six of the difference are 0.17
    let of_samples =
        |values: Vec<f32>| image(vec![("Y", values), ("variance", filled(0.01)), ("samples", filled(25.0))]);
    let mut values = filled(0.5);
    (values[7], values[9], values[11]) = (0.66, 0.34, 0.69);
    let c = of(&of_samples(values.clone()), &of_samples(filled(0.5))).unwrap();
    assert_eq!(c.bad.outliers, Some(1));
    assert!((c.reference_standard_error.unwrap() - 0.02).abs() < 1e-7);
    // against a reference alone the image has no error of its own
    assert_eq!(of(&image(vec![("Y", values.clone())]), &of_samples(filled(0.5))).unwrap().bad.outliers, Some(3));
    let exact = image(vec![("Y", filled(0.5)), ("variance", filled(0.0)), ("samples", filled(25.0))]);
    values[5] += 0.001;
    assert_eq!(of(&image(vec![("Y", values)]), &exact).unwrap().bad.outliers, Some(3), "less than 8 bits show is none");
}

/// A comparison of nothing is no agreement.
#[test]
fn comparisons_that_say_nothing_fail() {
    let check = |a: &Image, b: &Image, mask: MaskOptions| {
        let c = compare(a, b, &CompareOptions { mask, ..Default::default() }).unwrap();
        match c.check() {
            Ok(()) => format!("{} pixels: {}", c.pixels, c.mask),
            Err(Error::CheckFailed(text)) => text,
            Err(e) => panic!("{e}"),
        }
    };
    let any = MaskOptions::default;
    let seen = |value: f32, alpha: f32| image(vec![("Y", filled(value)), ("A", filled(alpha))]);
    // the sky alone is seen: it is compared
    let skies = "256 pixels: covered pixels and background that is not black";
    assert_eq!(check(&seen(1.0, 0.0), &seen(0.5, 0.0), any()), skies);
    assert_eq!(check(&seen(0.0, 0.0), &seen(0.5, 0.0), any()), skies);
    // an image with alpha and one without
    assert_eq!(check(&seen(0.0, 0.0), &grey(0.0), any()), "256 pixels: all pixels");
    let nothing = check(&seen(0.0, 0.0), &seen(0.0, 0.0), any());
    assert_eq!(nothing, "nothing was compared: the images have no pixel of the mask (covered pixels)");
    let all = MaskOptions { covered: false, ..any() };
    assert_eq!(check(&seen(0.0, 0.0), &seen(0.0, 0.0), all), "256 pixels: all pixels");
    // values that are not finite, also where no surface is
    let infinite = check(&grey(f32::INFINITY), &grey(f32::INFINITY), any());
    assert_eq!(infinite, "nothing was compared: no pixel of the mask (all pixels) is finite");
    let mut values = filled(0.0);
    values[7] = f32::NAN;
    let broken = image(vec![("Y", values), ("A", filled(0.0))]);
    assert!(check(&broken, &seen(0.5, 0.0), any()).contains("1 pixel is not a number (NaN) in one of them only"));
    assert!(check(&broken, &broken, any()).contains("1 pixel is not a number (NaN) in both"));
    assert!(check(&grey(f32::INFINITY), &grey(1.0), any()).contains("256 pixels are infinite in one of them only"));
    let none = of(&grey(f32::NAN), &grey(f32::NAN)).unwrap();
    for metric in [none.rmse, none.max, none.tanimoto, none.minimum_ratio, none.psnr, none.flip.unwrap()] {
        assert!(metric.is_nan(), "{none:?}");
    }
    // a single pixel
    let one = |value: f32| Image {
        width: 1,
        height: 1,
        channels: vec![Channel { name: "Y".into(), samples: Samples::F32(vec![value]) }],
        metadata: Vec::new(),
    };
    assert_eq!(check(&one(0.0), &one(1.0), any()), "1 pixels: all pixels");
}

/// All metrics are over one mask: differences beyond it do not reach into the windows of SSIM and FLIP.
#[test]
fn what_is_not_compared_has_no_influence() {
    let half = MaskOptions { rectangle: Some([0, 0, 8, 16]), ..Default::default() };
    let options = CompareOptions { mask: half, ..Default::default() };
    let values = |right: f32| (0..SIZE * SIZE).map(|k| if k % SIZE < 8 { 0.5 } else { right }).collect::<Vec<f32>>();
    for right in [0.0, 9.0, f32::NAN, f32::INFINITY] {
        let c = compare(&image(vec![("Y", values(right))]), &grey(0.5), &options).unwrap();
        assert_eq!((c.rmse, c.flip, c.ssim, c.pixels, c.differing), (0.0, Some(0.0), Some(1.0), 128, 0), "{right}");
        assert!(c.check().is_ok());
    }
}

#[test]
fn masks_leave_out_pixels() {
    let mut values = filled(0.5);
    values[0] = 1.0;
    let (a, b) = (image(vec![("Y", values), ("A", filled(1.0))]), image(vec![("Y", filled(0.5)), ("A", filled(1.0))]));
    let with = |mask: MaskOptions| compare(&a, &b, &CompareOptions { mask, ..Default::default() }).unwrap();
    let all = with(MaskOptions::default());
    assert_eq!((all.pixels, all.differing, all.mask.as_str()), (256, 1, "covered pixels"));
    let part = with(MaskOptions { rectangle: Some([1, 0, 15, 16]), ..Default::default() });
    assert_eq!((part.pixels, part.differing, part.rmse), (240, 0, 0.0));
}
