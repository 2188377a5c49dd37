//! Animations and numbered frames: what is written comes back, and what is broken off leaves nothing.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use skylit::Error;
use skylit::output::apng::{Animation, ApngWriter, Delay, is_apng};
use skylit::output::frames::{FramePattern, is_pattern, numbered};
use skylit::output::png::Colour;
use skylit::output::{self, Channel, Image, Samples};

const DELAY: Delay = Delay { numerator: 1, denominator: 25 };

fn bytes(count: usize, frame: usize) -> Vec<u8> {
    (0..count).map(|i| ((i * (frame + 3)) % 251 + frame) as u8).collect()
}

#[test]
fn every_frame_comes_back() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.apng");
    for (colour, size, frames) in [(Colour::Grey, [31, 17], 5), (Colour::Rgb, [64, 48], 3), (Colour::Rgb, [1, 1], 1)] {
        let count = (size[0] * size[1]) as usize * colour.channels();
        let mut writer = ApngWriter::create(&path, Animation { size, colour, frames, delay: DELAY }).unwrap();
        for frame in 0..frames as usize {
            writer.add_bytes(&bytes(count, frame)).unwrap();
        }
        assert_eq!(writer.added(), frames);
        writer.finish().unwrap();

        let mut reader = png::Decoder::new(BufReader::new(File::open(&path).unwrap())).read_info().unwrap();
        let info = reader.info();
        let control = info.animation_control.unwrap();
        assert_eq!((control.num_frames, control.num_plays), (frames, 0));
        assert_eq!(([info.width, info.height], info.bit_depth), (size, png::BitDepth::Eight));
        assert_eq!(info.srgb, Some(png::SrgbRenderingIntent::Perceptual));
        assert_eq!(info.color_type.samples(), colour.channels());
        for frame in 0..frames as usize {
            let mut decoded = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut decoded).unwrap();
            assert_eq!(decoded, bytes(count, frame), "{colour:?}, frame {frame}");
            let shown = reader.info().frame_control.unwrap();
            assert_eq!((shown.delay_num, shown.delay_den), (1, 25));
        }
        assert!(reader.next_frame(&mut vec![0; count]).is_err(), "there are no more");
    }
    assert_eq!(crate::files_in(dir.path()), 1);
    // a program that knows no animations reads the first frame
    let still = dir.path().join("a.png");
    std::fs::rename(&path, &still).unwrap();
    assert_eq!(output::load(&still).unwrap().pixel_count(), 1);
}

#[test]
fn images_become_frames() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.apng");
    let image = |name: &str, value: f32| Image {
        width: 2,
        height: 1,
        channels: vec![Channel { name: name.into(), samples: Samples::F32(vec![value, 1.0]) }],
        metadata: vec![],
    };
    let animation = Animation { size: [2, 1], colour: Colour::Grey, frames: 2, delay: DELAY };
    let mut writer = ApngWriter::create(&path, animation).unwrap();
    writer.add(&image("Y", 0.5), 0.0).unwrap();
    assert!(matches!(writer.add(&image("depth.Z", 0.5), 0.0), Err(Error::Usage(_))));
    assert!(matches!(writer.add(&Image { width: 1, height: 2, ..image("Y", 0.5) }, 0.0), Err(Error::Usage(_))));
    writer.add(&image("R", 0.25), 1.0).unwrap();
    writer.finish().unwrap();
    let mut reader = png::Decoder::new(BufReader::new(File::open(&path).unwrap())).read_info().unwrap();
    for _ in 0..2 {
        let mut decoded = [0; 2];
        reader.next_frame(&mut decoded).unwrap();
        assert_eq!(decoded, [188, 255]);
    }
}

#[test]
fn what_is_broken_off_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.apng");
    let animation = Animation { size: [4, 4], colour: Colour::Grey, frames: 2, delay: DELAY };
    std::fs::write(&path, "old").unwrap();
    let mut dropped = ApngWriter::create(&path, animation).unwrap();
    dropped.add_bytes(&[1; 16]).unwrap();
    // the new one has no name, or another one, until it is whole
    assert_eq!(std::fs::read(&path).unwrap(), b"old");
    drop(dropped);
    let mut short = ApngWriter::create(&path, animation).unwrap();
    short.add_bytes(&[1; 16]).unwrap();
    assert!(short.finish().unwrap_err().to_string().contains("1 of 2 frames"));
    assert_eq!((crate::files_in(dir.path()), std::fs::read(&path).unwrap()), (1, b"old".to_vec()));

    let mut long = ApngWriter::create(&path, animation).unwrap();
    assert!(matches!(long.add_bytes(&[1; 15]), Err(Error::Usage(_))));
    long.add_bytes(&[1; 16]).unwrap();
    long.add_bytes(&[2; 16]).unwrap();
    assert!(matches!(long.add_bytes(&[3; 16]), Err(Error::Usage(_))));
    long.finish().unwrap();
    assert!(std::fs::read(&path).unwrap().starts_with(b"\x89PNG"));

    for bad in [
        Animation { frames: 0, ..animation },
        Animation { size: [0, 4], ..animation },
        Animation { delay: Delay { numerator: 1, denominator: 0 }, ..animation },
    ] {
        assert!(matches!(ApngWriter::create(&path, bad), Err(Error::Usage(_))), "{bad:?}");
    }
    let nowhere = dir.path().join("none/a.apng");
    assert!(matches!(ApngWriter::create(&nowhere, animation), Err(Error::Output { .. })));
    assert_eq!(crate::files_in(dir.path()), 1);
}

#[cfg(target_os = "linux")]
#[test]
fn a_device_that_is_full() {
    let full = Path::new("/dev/full");
    if full.exists() {
        let animation = Animation { size: [4, 4], colour: Colour::Grey, frames: 1, delay: DELAY };
        let mut writer = ApngWriter::create(full, animation).unwrap();
        writer.add_bytes(&[1; 16]).unwrap();
        assert!(writer.finish().unwrap_err().to_string().contains("the disk is full"));
    }
}

#[test]
fn delays_are_simple_fractions() {
    for (rate, want) in
        [(30.0, (1, 30)), (29.97, (100, 2997)), (23.976, (125, 2997)), (0.5, (2, 1)), (1000.0, (1, 1000))]
    {
        let delay = Delay::of_rate(rate).unwrap();
        assert_eq!((delay.numerator, delay.denominator), want, "{rate}");
    }
    for rate in [0.001, 0.001_37, std::f64::consts::PI, 59.940_059, 997.123] {
        let delay = Delay::of_rate(rate).unwrap();
        let made = f64::from(delay.denominator) / f64::from(delay.numerator);
        assert!((made / rate - 1.0).abs() < 2e-5, "{rate}: {delay:?}");
    }
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 1001.0] {
        assert!(Delay::of_rate(bad).is_err(), "{bad}");
    }
}

#[test]
fn names_of_animations() {
    assert!(is_apng(Path::new("a.apng")) && is_apng(Path::new("x/a.b.APNG")));
    assert!(!is_apng(Path::new("a.png")) && !is_apng(Path::new("apng")));
}

#[test]
fn frame_numbers() {
    let of = |path: &str, frame: u64| numbered(Path::new(path), frame).unwrap().to_str().unwrap().to_owned();
    assert_eq!(of("out.####.exr", 7), "out.0007.exr");
    assert_eq!(of("out.####.exr", 123_456), "out.123456.exr");
    assert_eq!(of("a/b#/c#.png", 0), "a/b#/c0.png");
    assert_eq!(of("##", 3), "03");
    assert_eq!(of("Zürich-###-塔.png", 12), "Zürich-012-塔.png");
    assert_eq!(of("plain.exr", 5), "plain.exr");
    assert_eq!(of("a#/plain.exr", 5), "a#/plain.exr");
    let has = |path: &str| is_pattern(Path::new(path));
    assert!(has("out.#.exr").unwrap() && !has("out.exr").unwrap() && !has("#/out.exr").unwrap() && !has("..").unwrap());
    let error = has("a.##.b.#.exr").unwrap_err();
    assert!(matches!(&error, Error::Usage(m) if m.contains("a.##.b.#.exr") && m.contains("one run of #")), "{error}");
    assert_eq!(error.exit_code(), 64);
    let pattern = FramePattern::from_path(Path::new("x.###.png")).unwrap().unwrap();
    assert_eq!(
        [8, 9, 10].map(|k| pattern.path(k)),
        ["x.008.png", "x.009.png", "x.010.png"].map(std::path::PathBuf::from)
    );
}

#[cfg(unix)]
#[test]
fn frame_numbers_in_names_that_are_no_text() {
    use std::os::unix::ffi::OsStrExt;
    let path = |bytes: &'static [u8]| Path::new(std::ffi::OsStr::from_bytes(bytes));
    assert!(is_pattern(path(b"a\xff##.png")).is_err());
    assert_eq!(numbered(path(b"a\xff.png"), 3).unwrap(), path(b"a\xff.png"));
    assert_eq!(numbered(path(b"\xff/a#.png"), 3).unwrap(), path(b"\xff/a3.png"));
}
