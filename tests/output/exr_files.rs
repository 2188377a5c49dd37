//! EXR files for other programs: read with the crate exr itself, not with our reader.

use std::path::Path;

use exr::math::Vec2;
use exr::meta::attribute::IntegerBounds;
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Layer, LayerAttributes, LineOrder,
    ReadChannels, ReadLayers, WritableImage, f16,
};
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
                    let of_half =
                        |v: f32| if v.is_finite() { f16::from_f32(v.clamp(-65504.0, 65504.0)).to_f32() } else { v };
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
    assert!(
        size(ExrCompression::Zip) < size(ExrCompression::None)
            && size(ExrCompression::Pxr24) < size(ExrCompression::Zip)
    );
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

/// A window: left, top, width, height.
type Window = (i32, i32, usize, usize);

/// Writes an image whose parts have data windows of their own; a pixel's value is its number, which counts from 1.
fn write_windows(path: &Path, display: Window, parts: &[(&str, Window)], blocks: Blocks) {
    let part = |(name, (x, y, width, height)): &(&str, Window)| {
        let samples = (1..=width * height).map(|k| k as f32).collect();
        let mut attributes = LayerAttributes::named(*name);
        attributes.layer_position = Vec2(*x, *y);
        let encoding = Encoding { compression: Compression::ZIP1, blocks, line_order: LineOrder::Increasing };
        let channels = AnyChannels::sort([AnyChannel::new("Y", FlatSamples::F32(samples))].into_iter().collect());
        Layer::new((*width, *height), attributes, encoding, channels)
    };
    let mut attributes = exr::meta::header::ImageAttributes::with_size((display.2, display.3));
    attributes.display_window = IntegerBounds::new((display.0, display.1), (display.2, display.3));
    let layers: exr::prelude::SmallVec<_> = parts.iter().map(part).collect();
    exr::image::Image::from_layers(attributes, layers).write().to_file(path).unwrap();
}

#[test]
fn pixels_are_where_the_windows_put_them() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let tiles = Blocks::Tiles(Vec2(2, 2));
    for blocks in [Blocks::ScanLines, tiles] {
        let read = |display: Window, data: Window| {
            write_windows(&path, display, &[("a", data)], blocks);
            let image = output::load(&path).unwrap();
            assert_eq!((image.width as usize, image.height as usize), (display.2, display.3));
            image.f32("Y").unwrap().to_vec()
        };
        // the upper half, a crop with display and data windows that begin elsewhere, overscan
        assert_eq!(read((0, 0, 3, 2), (0, 0, 3, 1)), [1.0, 2.0, 3.0, 0.0, 0.0, 0.0]);
        assert_eq!(read((0, 0, 3, 2), (1, 1, 1, 1)), [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        assert_eq!(read((-3, -2, 3, 2), (-2, -1, 2, 1)), [0.0, 0.0, 0.0, 0.0, 1.0, 2.0]);
        assert_eq!(read((0, 0, 3, 2), (-1, -1, 5, 4)), [7.0, 8.0, 9.0, 12.0, 13.0, 14.0]);
    }
    // parts with data windows of their own
    write_windows(&path, (0, 0, 2, 2), &[("left", (0, 0, 1, 2)), ("right", (1, 0, 1, 2))], Blocks::ScanLines);
    let image = output::load(&path).unwrap();
    assert_eq!(image.f32("left.Y").unwrap(), [1.0, 0.0, 2.0, 0.0]);
    assert_eq!(image.f32("right.Y").unwrap(), [0.0, 1.0, 0.0, 2.0]);
    // images of other places are not equal, whatever their pixels
    let place = |x: i32| {
        write_windows(&path, (x, 0, 2, 2), &[("a", (x, 0, 2, 2))], Blocks::ScanLines);
        output::load(&path).unwrap()
    };
    let [a, b] = [0, 7].map(place);
    let error = skylit::measure::comparison::check_size(&a, &b).unwrap_err().to_string();
    assert!(error.contains("begin at 0,0 and 7,0"), "{error}");
    assert!(skylit::measure::comparison::check_size(&b, &b).is_ok());
}

#[test]
fn windows_that_no_image_has_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let refuses = |display: Window, data: Window, says: &str| {
        write_windows(&path, display, &[("a", data)], Blocks::ScanLines);
        let error = output::load(&path).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    };
    refuses((0, 0, 4, 4), (4, 0, 2, 2), "shows nothing: its display window of 4x4 pixels at 0,0");
    refuses((0, 0, 1 << 20, 1 << 20), (0, 0, 2, 2), "1048576 x 1048576 pixels (display window)");
    // a few hundred bytes do not take gigabytes
    let many: Vec<_> = (0..5).map(|k| format!("part {k}")).collect();
    let parts: Vec<(&str, Window)> = many.iter().map(|name| (name.as_str(), (0, 0, 2, 2))).collect();
    write_windows(&path, (0, 0, 1 << 14, 1 << 14), &parts, Blocks::ScanLines);
    let error = output::load(&path).unwrap_err().to_string();
    assert!(error.contains("16384x16384 pixels at 0,0, of which it holds 2x2 pixels"), "{error}");
}

#[test]
fn files_that_end_early_say_so() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["a.exr", "a.png", "a.jpg", "a.webp"] {
        let path = dir.path().join(name);
        let image = sample();
        output::save(&Image { channels: vec![f32s("Y", image.f32("albedo.R").unwrap().to_vec())], ..image }, &path)
            .unwrap();
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        let error = output::load(&path).unwrap_err().to_string();
        assert!(error.contains("ends early"), "{error}");
        std::fs::write(&path, b"version https://git-lfs.github.com/spec/v1\noid sha256:4d\nsize 1\n").unwrap();
        let error = output::load(&path).unwrap_err().to_string();
        assert!(error.contains("is a Git LFS pointer"), "{error}");
        std::fs::write(&path, "").unwrap();
        assert!(output::load(&path).unwrap_err().to_string().contains("is empty"));
    }
}
