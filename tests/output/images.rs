//! Image files: what is written comes back, and a failed write leaves nothing behind.

use std::path::Path;
use std::process::Command;

use skylit::Error;
use skylit::colour::{srgb_byte, srgb_decode};
use skylit::files;
use skylit::output::{self, Channel, Image, ImageFormat, Samples, exr, png};

fn f32s(name: &str, samples: Vec<f32>) -> Channel {
    Channel { name: name.into(), samples: Samples::F32(samples) }
}

/// A small image with all that a render has: colour, layers, ids, awkward values, metadata.
fn sample(width: u32, height: u32) -> Image {
    let n = (width * height) as usize;
    let wave = |k: usize| (0..n).map(|i| ((i * (k + 3)) as f32 * 0.01).sin().abs()).collect::<Vec<_>>();
    let mut depth = wave(9);
    depth[0] = f32::INFINITY;
    depth[n - 1] = f32::NEG_INFINITY;
    Image {
        width,
        height,
        channels: vec![
            f32s("B", wave(2)),
            f32s("G", wave(1)),
            f32s("R", wave(0)),
            f32s("depth.Z", depth),
            Channel {
                name: "id.instance".into(),
                samples: Samples::U32((0..n as u32).map(|i| u32::MAX - i).collect()),
            },
        ],
        metadata: vec![
            ("device".into(), "llvmpipe (LLVM 15.0.6, 256 bits)".into()),
            ("scene".into(), "Zürich/塔.glb".into()),
            ("spp".into(), "16".into()),
            ("text".into(), "x".repeat(5000)),
        ],
    }
}

#[test]
fn exr_round_trip_keeps_everything() {
    let dir = tempfile::tempdir().unwrap();
    for (w, h) in [(1, 1), (7, 5), (64, 33), (1, 40)] {
        let (image, path) = (sample(w, h), dir.path().join("a.exr"));
        output::save(&image, &path).unwrap();
        assert_eq!(output::load(&path).unwrap(), image, "{w}x{h}");
    }
    assert_eq!(crate::files_in(dir.path()), 1);
}

#[test]
fn exr_keeps_nan_bits() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("nan.EXR");
    let nan = f32::from_bits(0x7fc0_1234);
    let image = Image { width: 2, height: 1, channels: vec![f32s("Y", vec![nan, -0.0])], metadata: vec![] };
    output::save(&image, &path).unwrap();
    let bits: Vec<u32> = output::load(&path).unwrap().f32("Y").unwrap().iter().map(|v| v.to_bits()).collect();
    assert_eq!(bits, [0x7fc0_1234, 0x8000_0000]);
}

#[test]
fn same_image_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let image = sample(300, 200);
    let bytes: Vec<_> = (0..3)
        .map(|i| {
            let path = dir.path().join(format!("{i}.exr"));
            exr::write(&image, &path).unwrap();
            std::fs::read(path).unwrap()
        })
        .collect();
    assert!(bytes.windows(2).all(|b| b[0] == b[1]));
}

#[test]
fn broken_exr_is_an_error_not_a_panic() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    exr::write(&sample(64, 64), &path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    for cut in [0, 3, 8, 40, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(&path, &bytes[..cut]).unwrap();
        assert!(matches!(exr::read(&path), Err(Error::Input { .. })), "cut at {cut}");
    }
    assert!(matches!(exr::read(&dir.path().join("none.exr")), Err(Error::Input { .. })));
}

#[test]
fn images_that_contradict_themselves_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let short = Image { width: 2, height: 2, channels: vec![f32s("Y", vec![0.0; 3])], metadata: vec![] };
    assert!(output::save(&short, &path).is_err());
    let twice =
        Image { width: 1, height: 1, channels: vec![f32s("Y", vec![0.0]), f32s("Y", vec![0.0])], metadata: vec![] };
    assert!(output::save(&twice, &path).is_err());
    assert!(output::save(&Image::default(), &path).is_err());
    assert_eq!(crate::files_in(dir.path()), 0);
}

#[test]
fn srgb_known_answers() {
    // IEC 61966-2-1: the 18 % grey card is 118 (117.6), half is 188 (187.5)
    for (linear, byte) in [(0.0, 0), (1.0, 255), (0.5, 188), (0.18, 118), (0.0031308, 10), (-1.0, 0), (7.0, 255)] {
        assert_eq!(srgb_byte(linear), byte, "{linear}");
    }
    assert_eq!(srgb_byte(f32::NAN), 0);
    assert_eq!(srgb_byte(f32::INFINITY), 255);
    for byte in 0..=255u8 {
        assert_eq!(srgb_byte(srgb_decode(f32::from(byte) / 255.0)), byte);
    }
}

#[test]
fn png_round_trip() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.png");
    let grey = Image {
        width: 256,
        height: 1,
        channels: vec![f32s("Y", (0..256).map(|i| i as f32 / 255.0).collect())],
        metadata: vec![],
    };
    output::save(&grey, &path).unwrap();
    let back = output::load(&path).unwrap();
    let bytes = |v: &[f32]| v.iter().map(|&v| srgb_byte(v)).collect::<Vec<_>>();
    assert_eq!(bytes(back.f32("Y").unwrap()), bytes(grey.f32("Y").unwrap()));

    let colour = sample(31, 17);
    output::save(&colour, &path).unwrap();
    let back = output::load(&path).unwrap();
    for c in ["R", "G", "B"] {
        assert_eq!(bytes(back.f32(c).unwrap()), bytes(colour.f32(c).unwrap()));
    }
    // one stop up
    png::write(&grey, &path, 1.0).unwrap();
    assert_eq!(srgb_byte(output::load(&path).unwrap().f32("Y").unwrap()[64]), srgb_byte(128.0 / 255.0));
    // nothing to show
    let ids = Image { width: 1, height: 1, channels: vec![f32s("depth.Z", vec![1.0])], metadata: vec![] };
    assert!(matches!(output::save(&ids, &path), Err(Error::Usage(_))));
}

#[test]
fn depth_grey() {
    let inf = f32::INFINITY;
    assert_eq!(png::depth_to_unit(&[2.0, 4.0, 3.0, inf, 0.0, f32::NAN, -1.0]), [1.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(png::depth_to_unit(&[5.0, inf]), [1.0, 0.0]);
    assert_eq!(png::depth_to_unit(&[inf, inf]), [0.0, 0.0]);
}

#[test]
fn unknown_extension_names_all() {
    let message = ImageFormat::from_path(Path::new("a.bmp")).unwrap_err().to_string();
    assert!([".exr", ".png", ".jpg", ".webp"].iter().all(|e| message.contains(e)), "{message}");
    assert!(output::save(&sample(2, 2), Path::new("noextension")).is_err());
}

#[test]
fn check_writable_says_why_not() {
    let dir = tempfile::tempdir().unwrap();
    let reason = |p: &Path| files::check_writable(p).unwrap_err().to_string();
    assert!(reason(&dir.path().join("none/a.exr")).contains("folder does not exist"));
    assert!(reason(dir.path()).contains("is a folder"));
    std::fs::write(dir.path().join("file"), "x").unwrap();
    assert!(files::check_writable(&dir.path().join("file/a.exr")).is_err());
    assert!(files::check_writable(Path::new("")).is_err());
    assert!(files::check_writable(Path::new("/")).is_err());
    files::check_writable(&dir.path().join("new.exr")).unwrap();
    files::check_writable(&dir.path().join("file")).unwrap();
    assert_eq!(crate::files_in(dir.path()), 1);
    assert_eq!(std::fs::read(dir.path().join("file")).unwrap(), b"x");
}

#[test]
fn failed_write_leaves_the_old_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a");
    std::fs::write(&path, "old").unwrap();
    let failed = files::write_atomically(&path, |f| {
        std::io::Write::write_all(f, b"half")?;
        Err(std::io::Error::from_raw_os_error(28)) // ENOSPC
    });
    assert!(failed.unwrap_err().to_string().contains("the disk is full"));
    assert_eq!(std::fs::read(&path).unwrap(), b"old");
    assert_eq!(crate::files_in(dir.path()), 1);
}

#[cfg(unix)]
#[test]
fn permissions_links_and_devices() {
    use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
    let dir = tempfile::tempdir().unwrap();
    let (path, link) = (dir.path().join("a"), dir.path().join("link"));
    let fill = |p: &Path, text: &str| files::write_atomically(p, |f| std::io::Write::write_all(f, text.as_bytes()));
    // a new file has the mode that the umask leaves
    fill(&path, "1").unwrap();
    std::fs::write(dir.path().join("plain"), "").unwrap();
    let mode = |p: &Path| std::fs::metadata(p).unwrap().permissions().mode();
    assert_eq!(mode(&path), mode(&dir.path().join("plain")));
    // an existing one keeps its own, a link stays a link
    std::fs::set_permissions(&path, PermissionsExt::from_mode(0o640)).unwrap();
    symlink(&path, &link).unwrap();
    fill(&link, "2").unwrap();
    assert_eq!(mode(&path) & 0o777, 0o640);
    assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(std::fs::read(&path).unwrap(), b"2");
    // devices are written to, not replaced
    fill(Path::new("/dev/null"), "3").unwrap();
    assert!(std::fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    files::check_writable(Path::new("/dev/null")).unwrap();
    if Path::new("/dev/full").exists() {
        assert!(fill(Path::new("/dev/full"), "4").unwrap_err().to_string().contains("the disk is full"));
    }
}

/// A FIFO gets the bytes of the whole image.
#[cfg(unix)]
#[test]
fn fifo() {
    let dir = tempfile::tempdir().unwrap();
    let (pipe, image) = (dir.path().join("pipe.exr"), sample(20, 20));
    if !Command::new("mkfifo").arg(&pipe).status().is_ok_and(|s| s.success()) {
        println!("skipped: no mkfifo");
        return;
    }
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || std::fs::read(pipe).unwrap()
    });
    output::save(&image, &pipe).unwrap();
    let copy = dir.path().join("copy.exr");
    std::fs::write(&copy, reader.join().unwrap()).unwrap();
    assert_eq!(output::load(&copy).unwrap(), image);
}

/// A file system that really fills up: needs the right to mount.
#[cfg(target_os = "linux")]
#[test]
fn full_disk() {
    let dir = tempfile::tempdir().unwrap();
    let mount =
        |args: &[&str]| Command::new("mount").args(args).arg(dir.path()).output().is_ok_and(|o| o.status.success());
    if !mount(&["-t", "tmpfs", "-o", "size=64k", "skylit-test"]) {
        println!("skipped: may not mount a tmpfs");
        return;
    }
    let noise: Vec<f32> = (0..65536u32).map(|i| f32::from_bits(i.wrapping_mul(2_654_435_761) >> 2)).collect();
    let image = Image { width: 256, height: 256, channels: vec![f32s("Y", noise)], metadata: vec![] };
    let results =
        ["a.exr", "a.png"].map(|name| output::save(&image, &dir.path().join(name)).map_err(|e| e.to_string()));
    let left = crate::files_in(dir.path());
    let read_only = mount(&["-o", "remount,ro"])
        .then(|| files::check_writable(&dir.path().join("b.exr")).map_err(|e| e.to_string()));
    Command::new("umount").arg(dir.path()).status().unwrap();
    assert!(results[0].as_ref().is_err_and(|e| e.ends_with("cannot write: the disk is full")), "{results:?}");
    assert_eq!(left, usize::from(results[1].is_ok()));
    if let Some(result) = read_only {
        assert!(result.as_ref().is_err_and(|e| e.contains("read-only")), "{result:?}");
    }
}
