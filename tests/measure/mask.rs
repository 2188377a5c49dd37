//! Pixels that a comparison counts.

use skylit::measure::mask::MaskOptions;
use skylit::output::{Channel, Image, Samples};

fn image(channels: Vec<(&str, Samples)>) -> Image {
    let channels = channels.into_iter().map(|(name, samples)| Channel { name: name.into(), samples }).collect();
    Image { width: 3, height: 2, channels, metadata: Vec::new() }
}

#[test]
fn every_condition_holds() {
    let a = image(vec![("A", Samples::F32(vec![0.0, 0.5, 1.0, 1.0, 0.0, 0.0]))]);
    let b = image(vec![
        ("A", Samples::F32(vec![0.0, 0.0, 1.0, 1.0, 1.0, 0.0])),
        ("id.instance", Samples::U32(vec![9, 7, 7, 8, 7, 9])),
    ]);
    let selected = |covered, rectangle, instance| {
        let mask = MaskOptions { covered, rectangle, instance };
        mask.select(&a, &b, &[]).unwrap().counted.iter().map(|c| *c as u8).collect::<Vec<_>>()
    };
    assert_eq!(selected(false, None, None), [1; 6]);
    assert_eq!(selected(true, None, None), [0, 1, 1, 1, 1, 0]);
    assert_eq!(selected(false, Some([1, 0, 2, 2]), None), [0, 1, 1, 0, 1, 1]);
    assert_eq!(selected(false, None, Some(7)), [0, 1, 1, 0, 1, 0]);
    assert_eq!(selected(true, Some([0, 1, 3, 1]), Some(7)), [0, 0, 0, 0, 1, 0]);
    for rectangle in [[0, 0, 0, 1], [2, 0, 2, 1], [0, 1, 1, 2], [u32::MAX, 0, u32::MAX, 1]] {
        assert!(MaskOptions { rectangle: Some(rectangle), ..Default::default() }.select(&a, &b, &[]).is_err());
    }
    assert!(MaskOptions { instance: Some(7), ..Default::default() }.select(&a, &a, &[]).is_err());
    let all = MaskOptions { covered: true, rectangle: Some([0, 1, 3, 1]), instance: Some(7) };
    let name = |mask: MaskOptions, colours: &[&[f32]]| mask.select(&a, &b, colours).unwrap().name;
    assert_eq!(name(all, &[]), "covered pixels and the 3x1 pixels at 0,1 and pixels of instance 7");
    assert_eq!(name(MaskOptions { covered: false, ..Default::default() }, &[]), "all pixels");
    assert_eq!(name(MaskOptions::default(), &[&[0.0; 6]]), "covered pixels");
}

/// An environment is no surface, but it is seen.
#[test]
fn a_background_that_is_not_black_counts() {
    let coverage = Samples::F32(vec![0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    let a = image(vec![("A", coverage.clone())]);
    let sky = [0.0, 0.5, 0.0, f32::NAN, -5e-6, f32::INFINITY];
    let mask = MaskOptions::default().select(&a, &a, &[&[0.0; 6], &sky]).unwrap();
    assert_eq!(mask.counted, [0.0, 1.0, 1.0, 1.0, 0.0, 1.0]);
    assert_eq!(mask.name, "covered pixels and background that is not black");
    // an image without alpha covers everything
    let opaque = image(vec![("Y", coverage)]);
    let mask = MaskOptions::default().select(&a, &opaque, &[]).unwrap();
    assert_eq!((mask.counted, mask.name.as_str()), (vec![1.0; 6], "all pixels"));
}
