//! EXR files for other programs: read with the crate exr itself, not with our reader.

use std::path::Path;

use exr::prelude::{FlatSamples, ReadChannels, ReadLayers, f16};
use skylit::output::exr::{ExrOptions, WORLD_TO_CAMERA, WORLD_TO_NDC, is_half, write, write_with};
use skylit::output::settings::ExrCompression;
use skylit::output::{self, Channel, Image, Samples};

fn f32s(name: &str, samples: Vec<f32>) -> Channel {
    Channel { name: name.into(), samples: Samples::F32(samples) }
}

/// An image with channels of every kind that renders have.
fn sample() -> Image {
    let (width, height) = (61u32, 37u32);
    let n = (width * height) as usize;
    let noise = |k: usize| (0..n).map(|i| (((i + 1) * (2 * k + 3)) as f32 * 0.137).sin().abs()).collect::<Vec<_>>();
    let mut y = noise(0);
    (y[0], y[1], y[2], y[3]) = (1e6, -1e6, f32::INFINITY, 65504.0);
    let mut depth = noise(1);
    depth[0] = f32::INFINITY;
    depth[1] = 16_777_217.5;
    let ids = (0..n as u32).map(|i| u32::MAX - i * 7919).collect();
    let matrix = |k: f32| (0..16).map(|i| (k + i as f32 / 3.0).to_string()).collect::<Vec<_>>().join(",");
    Image {
        width,
        height,
        channels: vec![
            f32s("A", noise(2)),
            f32s("Ng.X", noise(3)),
            f32s("Y", y),
            f32s("albedo.R", noise(4)),
            f32s("depth.Z", depth),
            Channel { name: "id.instance".into(), samples: Samples::U32(ids) },
            f32s("position.X", noise(5)),
            f32s("samples", (0..n).map(|i| i as f32 / 16.0).collect()),
            f32s("state.sum.Y", noise(6)),
            f32s("variance", noise(7)),
        ],
        metadata: vec![
            ("scene".into(), "Zürich.glb".into()),
            (WORLD_TO_CAMERA.into(), matrix(1.0)),
            (WORLD_TO_NDC.into(), matrix(-0.7)),
        ],
    }
}

fn decode(path: &Path) -> exr::prelude::Image<exr::prelude::Layer<exr::prelude::AnyChannels<FlatSamples>>> {
    let reader = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
    reader.all_attributes().from_file(path).unwrap()
}

#[test]
fn half_floats_where_they_suffice() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let image = sample();
    write_with(&image, &path, &ExrOptions { half: true, ..Default::default() }).unwrap();
    let file = decode(&path);
    let stored = |name: &str| {
        let channels = &file.layer_data.channel_data.list;
        &channels.iter().find(|c| c.name == *name).unwrap_or_else(|| panic!("{name}")).sample_data
    };
    let mut seen = 0;
    for channel in &image.channels {
        match (stored(&channel.name), &channel.samples) {
            (FlatSamples::F16(values), Samples::F32(exact)) => {
                assert!(is_half(&channel.name), "{}", channel.name);
                for (value, exact) in values.iter().zip(exact) {
                    // the largest half float instead of infinity
                    let expected = if exact.is_finite() { exact.clamp(-65504.0, 65504.0) } else { *exact };
                    assert_eq!(value.to_bits(), f16::from_f32(expected).to_bits(), "{}: {exact}", channel.name);
                    assert!(exact.is_infinite() || value.is_finite());
                }
            }
            (FlatSamples::F32(values), Samples::F32(exact)) => {
                assert!(!is_half(&channel.name), "{}", channel.name);
                assert!(values.iter().zip(exact).all(|(a, b)| a.to_bits() == b.to_bits()), "{}", channel.name);
            }
            (FlatSamples::U32(values), Samples::U32(exact)) => assert_eq!(values, exact),
            (stored, _) => panic!("{}: {stored:?}", channel.name),
        }
        seen += 1;
    }
    assert_eq!((seen, file.layer_data.channel_data.list.len()), (10, 13));
    // they are read as floats
    let back = output::load(&path).unwrap();
    let off = |name: &str| {
        let pairs = image.f32(name).unwrap()[4..].iter().zip(&back.f32(name).unwrap()[4..]);
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    };
    assert!(off("Y") > 0.0 && off("Y") < 2.5e-4 && off("depth.Z") == 0.0 && off("samples") == 0.0);
    let names = |image: &Image| image.channels.iter().map(|c| c.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&back), names(&image));
}

#[test]
fn compression_is_lossless_unless_it_says_otherwise() {
    let dir = tempfile::tempdir().unwrap();
    let image = sample();
    let sizes: Vec<u64> = ExrCompression::ALL
        .into_iter()
        .map(|compression| {
            for half in [false, true] {
                let path = dir.path().join(format!("{compression}.{half}.exr"));
                write_with(&image, &path, &ExrOptions { half, compression, ..Default::default() }).unwrap();
                let back = output::load(&path).unwrap();
                for (a, b) in image.channels.iter().zip(&back.channels) {
                    assert_eq!(a.name, b.name);
                    let (Samples::F32(exact), Samples::F32(values)) = (&a.samples, &b.samples) else {
                        assert_eq!(a.samples, b.samples, "{compression} {}", a.name);
                        continue;
                    };
                    let is_half = half && is_half(&a.name);
                    let of_half = |v: f32| if v.is_finite() { f16::from_f32(v.clamp(-65504.0, 65504.0)).to_f32() } else { v };
                    for (exact, value) in exact.iter().map(|v| if is_half { of_half(*v) } else { *v }).zip(values) {
                        let same = exact.to_bits() == value.to_bits();
                        let within = |relative: f32| (exact - value).abs() <= relative * exact.abs();
                        let fits = match compression {
                            ExrCompression::Pxr24 => same || !is_half && within(2f32.powi(-15)),
                            // blocks with values of very different sizes lose the small ones
                            ExrCompression::B44 | ExrCompression::B44a => same || is_half,
                            _ => same,
                        };
                        assert!(fits, "{compression} {half} {}: {exact} {value}", a.name);
                    }
                }
                assert_eq!(back.metadata("scene"), Some("Zürich.glb"));
            }
            std::fs::metadata(dir.path().join(format!("{compression}.false.exr"))).unwrap().len()
        })
        .collect();
    let size = |c: ExrCompression| sizes[ExrCompression::ALL.iter().position(|x| *x == c).unwrap()];
    assert!(size(ExrCompression::Zip) < size(ExrCompression::None) && size(ExrCompression::Pxr24) < size(ExrCompression::Zip));
}

#[test]
fn grey_images_open_where_only_colour_is_known() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let image = sample();
    write(&image, &path).unwrap();
    let file = decode(&path);
    let list = &file.layer_data.channel_data.list;
    let plane = |name: &str| match &list.iter().find(|c| c.name == *name).unwrap().sample_data {
        FlatSamples::F32(values) => values.iter().map(|v| v.to_bits()).collect::<Vec<_>>(),
        other => panic!("{name}: {other:?}"),
    };
    assert!(["R", "G", "B"].iter().all(|name| plane(name) == plane("Y")));
    // for ourselves it is grey
    let back = output::load(&path).unwrap();
    assert!(back.f32("Y").is_some() && back.f32("R").is_none());
    write_with(&image, &path, &ExrOptions { grey_as_rgb: false, ..Default::default() }).unwrap();
    assert_eq!(decode(&path).layer_data.channel_data.list.len(), image.channels.len());
    // what has colour of its own keeps it
    let mut colour = image;
    let n = colour.pixel_count();
    colour.channels.insert(0, f32s("R", vec![0.5; n]));
    write(&colour, &path).unwrap();
    let back = output::load(&path).unwrap();
    assert!(back.f32("R") == Some(&vec![0.5; n]) && back.f32("G").is_none() && back.f32("Y").is_some());
}

#[test]
fn cameras_and_primaries_are_attributes_of_the_standard() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let image = sample();
    write(&image, &path).unwrap();
    let file = decode(&path);
    let attributes = &file.layer_data.attributes;
    let expected = |k: f32| std::array::from_fn::<f32, 16, _>(|i| k + i as f32 / 3.0);
    assert_eq!(attributes.world_to_camera, Some(expected(1.0)));
    assert_eq!(attributes.world_to_normalized_device, Some(expected(-0.7)));
    let chromaticities = file.attributes.chromaticities.unwrap();
    assert_eq!((chromaticities.red.0, chromaticities.white.1), (0.64, 0.329));
    assert!(!attributes.other.keys().any(|k| k.to_string().contains("world")));
    let mut metadata = image.metadata;
    metadata.sort();
    assert_eq!(output::load(&path).unwrap().metadata, metadata);
}

/// Files of earlier versions: counts of samples as unsigned integers, grey without copies.
#[test]
fn earlier_files_are_read() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let mut image = sample();
    let counts = Channel { name: "samples".into(), samples: Samples::U32((0..image.pixel_count() as u32).collect()) };
    image.channels.retain(|c| c.name != "samples");
    image.channels.push(counts);
    write_with(&image, &path, &ExrOptions { grey_as_rgb: false, ..Default::default() }).unwrap();
    let back = output::load(&path).unwrap();
    assert!(back.f32("samples").unwrap().iter().enumerate().all(|(i, n)| *n == i as f32));
    let goldens = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/frames");
    let mut read = 0;
    for entry in std::fs::read_dir(goldens).unwrap().map(|e| e.unwrap().path()) {
        if entry.extension().is_some_and(|e| e == "exr") {
            let image = output::load(&entry).unwrap();
            assert!(image.metadata("verify.tracer").is_some() || !image.metadata.is_empty(), "{}", entry.display());
            let samples = image.channels.iter().find(|c| c.name == "samples");
            assert!(samples.is_none_or(|c| matches!(c.samples, Samples::F32(_))), "{}", entry.display());
            read += 1;
        }
    }
    assert!(read > 20, "{read}");
}
