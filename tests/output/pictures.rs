//! Pictures: alpha, backgrounds, bits, transfer functions; read back with the decoders of the crates png and image, and compared with formulas written down here in double precision.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use skylit::Error;
use skylit::output::picture::unassociated;
use skylit::output::png::Colour;
use skylit::output::settings::{Background, PngBits, PngEncoding};
use skylit::output::{self, Channel, FileSettings, Image, Picture, Samples};

fn f32s(name: &str, samples: Vec<f32>) -> Channel {
    Channel { name: name.into(), samples: Samples::F32(samples) }
}

/// 64 x 32 pixels with every share of alpha from 0 to 1, colours associated with it as renders have them.
fn sample(names: &[&str]) -> Image {
    let (width, height) = (64u32, 32u32);
    let n = (width * height) as usize;
    let alpha: Vec<f32> = (0..n).map(|i| (i % 17) as f32 / 16.0).collect();
    let colour = |k: usize| (0..n).map(|i| alpha[i] * ((i * (k + 3)) as f32 * 0.013).sin().abs()).collect();
    let mut channels: Vec<_> = names.iter().enumerate().map(|(k, name)| f32s(name, colour(k))).collect();
    channels.push(f32s("A", alpha));
    Image { width, height, channels, metadata: vec![] }
}

fn settings(bits: PngBits, encoding: PngEncoding) -> FileSettings {
    FileSettings { png_bits: Some(bits), png_encoding: Some(encoding), ..Default::default() }
}

/// The integers of a PNG, of 8 or 16 bits, and what its header says.
fn decode(path: &Path) -> (Vec<u16>, png::Info<'static>) {
    let mut reader = png::Decoder::new(BufReader::new(File::open(path).unwrap())).read_info().unwrap();
    let info = reader.info().clone();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    let values = match info.bit_depth {
        png::BitDepth::Sixteen => bytes.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect(),
        _ => bytes.iter().map(|b| u16::from(*b)).collect(),
    };
    (values, info)
}

/// The contents of the first chunk of this type.
fn chunk(path: &Path, kind: &[u8; 4]) -> Option<Vec<u8>> {
    let file = std::fs::read(path).unwrap();
    let mut at = 8;
    while at < file.len() {
        let length = u32::from_be_bytes(file[at..at + 4].try_into().unwrap()) as usize;
        if &file[at + 4..at + 8] == kind {
            return Some(file[at + 8..at + 8 + length].to_vec());
        }
        at += 12 + length;
    }
    None
}

fn srgb(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

#[test]
fn alpha_is_straight_and_every_bit_is_right() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.png");
    for names in [&["Y"][..], &["R", "G", "B"]] {
        let image = sample(names);
        let alpha = image.f32("A").unwrap();
        let n = image.pixel_count();
        for (bits, most) in [(PngBits::Eight, 255.0), (PngBits::Sixteen, 65535.0)] {
            for encoding in [PngEncoding::Srgb, PngEncoding::Linear] {
                let settings = settings(bits, encoding);
                let picture =
                    Picture::new(&unassociated(&image), Some(Background::Transparent), &settings, &path).unwrap();
                picture.save(&path, 90).unwrap();
                let (values, info) = decode(&path);
                assert_eq!(info.color_type.samples(), names.len() + 1);
                assert_eq!(info.bit_depth as usize, 8 * bits.bytes());
                for (c, name) in names.iter().enumerate() {
                    let plane = image.f32(name).unwrap();
                    for i in 0..n {
                        let straight = if alpha[i] > 0.0 { f64::from(plane[i]) / f64::from(alpha[i]) } else { 0.0 };
                        let coded = if encoding == PngEncoding::Srgb { srgb(straight) } else { straight };
                        let value = f64::from(values[(names.len() + 1) * i + c]);
                        // half a step, and what single precision is off where it falls between two steps
                        assert!(
                            (value - coded * most).abs() < 0.5 + 2e-7 * most,
                            "{bits:?} {encoding:?} {name} {i}: {value}"
                        );
                    }
                }
                let of_alpha: Vec<_> = (0..n).map(|i| values[(names.len() + 1) * i + names.len()]).collect();
                let expected: Vec<_> = alpha.iter().map(|a| (f64::from(*a) * most).round() as u16).collect();
                assert_eq!(of_alpha, expected, "{bits:?}");
                // as an image it is associated again
                let back = output::load(&path).unwrap();
                let a = back.f32("A").unwrap();
                assert!((0..n).all(|i| (a[i] - alpha[i]).abs() <= 0.5 / most as f32 + 1e-7));
                for name in names {
                    let (ours, theirs) = (image.f32(name).unwrap(), back.f32(name).unwrap());
                    let off = ours.iter().zip(theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                    assert!(off < 2.5 / most as f32, "{bits:?} {encoding:?} {name}: {off}");
                }
            }
        }
    }
}

#[test]
fn chunks_name_transfer_function_and_primaries() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.png");
    let image = sample(&["R", "G", "B"]);
    let red = [64000u32, 33000].map(u32::to_be_bytes).concat();
    for (encoding, gamma, intent, text) in [
        (PngEncoding::Srgb, 45455, Some(png::SrgbRenderingIntent::Perceptual), "16-bit sRGB"),
        (PngEncoding::Linear, 100_000, None, "16-bit linear"),
    ] {
        let picture = Picture::new(&image, None, &settings(PngBits::Sixteen, encoding), &path).unwrap();
        picture.save(&path, 90).unwrap();
        let (_, info) = decode(&path);
        // the decoder leaves gAMA out beside sRGB
        assert_eq!(chunk(&path, b"gAMA"), Some(u32::to_be_bytes(gamma).into()), "{encoding}");
        assert_eq!(info.srgb, intent);
        assert_eq!(chunk(&path, b"cHRM").unwrap()[8..16], red);
        assert_eq!(info.color_type, png::ColorType::Rgb, "without a background alpha is ignored");
        let back = output::load(&path).unwrap();
        assert_eq!(back.metadata("encoding"), Some(text));
        let off = |name: &str| {
            let pairs = image.f32(name).unwrap().iter().zip(back.f32(name).unwrap());
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        };
        assert!(["R", "G", "B"].iter().all(|name| off(name) < 3e-5), "{encoding}: {}", off("G"));
    }
}

#[test]
fn backgrounds_are_composited_in_linear_light() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.png");
    let image = sample(&["Y"]);
    let (y, alpha) = (image.f32("Y").unwrap(), image.f32("A").unwrap());
    let settings = settings(PngBits::Sixteen, PngEncoding::Linear);
    for (behind, channels) in [([0.0, 0.0, 0.0], 1), ([0.25, 0.25, 0.25], 1), ([1.0, 0.5, 0.0], 3)] {
        let background = Background::Colour(behind);
        Picture::new(&unassociated(&image), Some(background), &settings, &path).unwrap().save(&path, 90).unwrap();
        let (values, info) = decode(&path);
        assert_eq!(info.color_type.samples(), channels);
        for (i, value) in values.iter().enumerate() {
            let (p, c) = (i / channels, i % channels);
            let expected = (f64::from(y[p]) + f64::from(behind[c]) * (1.0 - f64::from(alpha[p]))) * 65535.0;
            assert!((f64::from(*value) - expected).abs() < 0.52, "{p} {c}: {value} {expected}");
        }
    }
    // on black it is what it is without alpha
    let black = Picture::new(&unassociated(&image), Some(Background::Colour([0.0; 3])), &settings, &path).unwrap();
    let plain = Picture::new(&image, None, &settings, &path).unwrap();
    let words =
        |p: &Picture| p.bytes.chunks_exact(2).map(|b| i32::from(u16::from_be_bytes([b[0], b[1]]))).collect::<Vec<_>>();
    assert!(words(&black).iter().zip(words(&plain)).all(|(a, b)| (a - b).abs() <= 1));
}

#[test]
fn awkward_values() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.png");
    let values = vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 2.0, 1.0];
    let image = Image { width: 6, height: 1, channels: vec![f32s("Y", values)], metadata: vec![] };
    let deep = settings(PngBits::Sixteen, PngEncoding::Srgb);
    for background in [None, Some(Background::Colour([0.5; 3])), Some(Background::Transparent)] {
        Picture::new(&image, background, &deep, &path).unwrap().save(&path, 90).unwrap();
        let (values, info) = decode(&path);
        // an image without alpha is opaque
        let grey: Vec<_> = values.chunks_exact(info.color_type.samples()).map(|p| p[0]).collect();
        assert_eq!(grey, [0, 65535, 0, 0, 65535, 65535], "{background:?}");
        assert!(background != Some(Background::Transparent) || values.chunks_exact(2).all(|p| p[1] == 65535));
    }
    let ids = Image { width: 1, height: 1, channels: vec![f32s("depth.Z", vec![1.0])], metadata: vec![] };
    assert!(matches!(Picture::new(&ids, None, &deep, &path), Err(Error::Usage(_))));
}

#[test]
fn jpeg_and_webp() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    for names in [&["Y"][..], &["R", "G", "B"]] {
        let (width, height) = (96, 64);
        let n = width as usize * height as usize;
        let smooth = |k: usize| (0..n).map(|i| 0.5 + 0.4 * ((i % 96 + k * 20) as f32 * 0.05).sin()).collect();
        let channels: Vec<_> = names.iter().enumerate().map(|(k, name)| f32s(name, smooth(k))).collect();
        let image = Image { width, height, channels, metadata: vec![] };
        let plain = FileSettings::default();
        let picture = Picture::new(&image, None, &plain, &at("a.jpg")).unwrap();
        let size = |quality: u8| {
            picture.save(&at("a.jpg"), quality).unwrap();
            let decoded = image::ImageReader::open(at("a.jpg")).unwrap().decode().unwrap();
            assert_eq!([decoded.width(), decoded.height()], [width, height]);
            assert_eq!(usize::from(decoded.color().channel_count()), names.len());
            let pairs = decoded.as_bytes().iter().zip(&picture.bytes);
            let off = pairs.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / picture.bytes.len() as f64;
            assert!(off < if quality > 90 { 1.5 } else { 12.0 }, "quality {quality}: off by {off}");
            std::fs::metadata(at("a.jpg")).unwrap().len()
        };
        assert!(size(20) < size(95));
        let back = output::load(&at("a.jpg")).unwrap();
        assert_eq!(back.metadata("encoding"), Some("8-bit sRGB"));
        assert_eq!(back.channels.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), names);
        // WebP loses nothing; grey becomes colour
        picture.save(&at("a.WebP"), 90).unwrap();
        let decoded = image::load_from_memory(&std::fs::read(at("a.WebP")).unwrap()).unwrap().into_rgb8().into_raw();
        let expected: Vec<u8> =
            picture.bytes.chunks_exact(names.len()).flat_map(|p| [p[0], p[p.len() / 2], p[p.len() - 1]]).collect();
        assert_eq!(decoded, expected);
    }
    // with alpha
    let image = sample(&["R", "G", "B"]);
    let transparent =
        Picture::new(&unassociated(&image), Some(Background::Transparent), &FileSettings::default(), &at("t.webp"))
            .unwrap();
    transparent.save(&at("t.webp"), 90).unwrap();
    let decoded = image::load_from_memory(&std::fs::read(at("t.webp")).unwrap()).unwrap();
    assert_eq!((decoded.color(), decoded.as_bytes()), (image::ColorType::Rgba8, transparent.bytes.as_slice()));
    assert!(output::load(&at("t.webp")).unwrap().f32("A").is_some());
    // what the formats cannot have
    let refused = |picture: &Picture, name: &str| picture.save(&at(name), 90).unwrap_err().to_string();
    assert!(refused(&transparent, "t.jpg").contains("JPEG has no alpha"));
    let deep = Picture::new(&image, None, &settings(PngBits::Sixteen, PngEncoding::Srgb), &at("d.webp")).unwrap();
    assert!(refused(&deep, "d.webp").contains("8-bit sRGB only"));
    assert!(
        refused(&deep, "d.exr").contains("8-bit sRGB only") && refused(&transparent, "d.exr").contains("not a picture")
    );
    let wide = Picture::of_bytes(vec![0; 70_000], [70_000, 1], Colour::Grey).unwrap();
    assert!(refused(&wide, "w.jpg").contains("65535 pixels") && refused(&wide, "w.webp").contains("16384 pixels"));
    std::fs::write(at("broken.jpg"), b"\xff\xd8no").unwrap();
    assert!(output::load(&at("broken.jpg")).unwrap_err().to_string().contains("not a readable JPEG"));
}

#[test]
fn bytes_on_a_background() {
    let of = |bytes: &[u8], colour| Picture::of_bytes(bytes.to_vec(), [2, 1], colour).unwrap();
    let on = |bytes: &[u8], colour, background| {
        let picture = of(bytes, colour).on(background, &[1.0, 0.0]).unwrap();
        (picture.colour, picture.bytes)
    };
    // one half of the light is 188 of 255
    let half = Background::Colour([0.5; 3]);
    assert_eq!(on(&[10, 20], Colour::Grey, half), (Colour::Grey, vec![10, 188]));
    assert_eq!(on(&[10, 20], Colour::Grey, Background::Transparent), (Colour::GreyAlpha, vec![10, 255, 0, 0]));
    let red = Background::Colour([1.0, 0.0, 0.0]);
    assert_eq!(on(&[10, 20], Colour::Grey, red), (Colour::Rgb, vec![10, 10, 10, 255, 0, 0]));
    let rgb = [1, 2, 3, 4, 5, 6];
    assert_eq!(on(&rgb, Colour::Rgb, red), (Colour::Rgb, vec![1, 2, 3, 255, 0, 0]));
    assert_eq!(on(&rgb, Colour::Rgb, half), (Colour::Rgb, vec![1, 2, 3, 188, 188, 188]));
    assert_eq!(on(&rgb, Colour::Rgb, Background::Transparent), (Colour::Rgba, vec![1, 2, 3, 255, 0, 0, 0, 0]));
    assert!(of(&[1, 2], Colour::Grey).on(half, &[1.0]).is_err());
    // edges: white that covers half of a pixel is 188 on black
    let edge = |background| {
        let picture = of(&[188, 0], Colour::Grey).on(background, &[0.5, 0.25]).unwrap();
        picture.bytes
    };
    assert_eq!(edge(Background::Transparent), [255, 128, 0, 64]);
    assert_eq!(edge(Background::Colour([1.0; 3])), [255, 225]);
    assert_eq!(edge(Background::Colour([0.0; 3])), [188, 0]);
    assert!(Picture::of_bytes(vec![0; 3], [2, 1], Colour::Grey).is_err());
}
