//! Environments from images of others.

use std::path::Path;

use glam::Vec3;
use skylit::output::{self, Channel, Image, Samples};
use skylit::scene::EnvironmentMap;
use skylit::scene::load::load_environment_with;
use skylit::{Error, Result};

use crate::build::Folder;

/// The map, and what was said of it.
fn load(path: &Path) -> Result<(EnvironmentMap, Vec<String>)> {
    let mut warnings = Vec::new();
    let map = load_environment_with(path, &mut |w| warnings.push(w))?;
    Ok((map, warnings))
}

/// Writes an EXR of 2 x 1 pixels.
fn exr(folder: &Folder, channels: &[(&str, [f32; 2])]) -> std::path::PathBuf {
    let channels = channels.iter().map(|(name, v)| Channel { name: (*name).into(), samples: Samples::F32(v.to_vec()) });
    let path = folder.path("sky.exr");
    output::save(&Image { width: 2, height: 1, channels: channels.collect(), metadata: Vec::new() }, &path).unwrap();
    path
}

#[test]
fn values_that_no_light_has_are_replaced_and_counted() {
    let folder = Folder::new();
    let (infinity, nan) = (f32::INFINITY, f32::NAN);
    let path = exr(&folder, &[("R", [infinity, 0.5]), ("G", [1.0, nan]), ("B", [-1.0, 0.25])]);
    let (map, warnings) = load(&path).unwrap();
    assert_eq!(map.radiance[..], [Vec3::new(65504.0, 1.0, 0.0), Vec3::new(0.5, 0.0, 0.25)]);
    assert_eq!(warnings, ["sky.exr: 1 pixel is infinite and counts as 65504, 1 pixel is not a number and counts as 0"]);
    // negative values alone are what filters of images leave
    let (map, warnings) = load(&exr(&folder, &[("Y", [-0.5, 2.0])])).unwrap();
    assert_eq!((map.radiance[..].to_vec(), warnings.len()), (vec![Vec3::ZERO, Vec3::splat(2.0)], 0));
}

#[test]
fn channels_have_the_names_that_programs_give_them() {
    let folder = Folder::new();
    let [r, g, b] = [[1.0, 4.0], [2.0, 5.0], [3.0, 6.0]];
    let expected = [Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)];
    for layer in ["", "Combined.", "ViewLayer.Combined.", "rgba."] {
        let name = |c: &str| format!("{layer}{c}");
        let path = exr(&folder, &[(&name("R"), r), (&name("G"), g), (&name("B"), b)]);
        assert_eq!(load(&path).unwrap().0.radiance[..], expected, "{layer}");
    }
    assert_eq!(load(&exr(&folder, &[("r", r), ("g", g), ("b", b)])).unwrap().0.radiance[..], expected);
    for channels in [&[("RY", r), ("BY", b), ("Y", g)][..], &[("Z", r)]] {
        let error = load(&exr(&folder, channels)).unwrap_err();
        assert!(matches!(&error, Error::Input { message, .. } if message.contains("has no colour")), "{error}");
    }
}

/// Whatever the file is called.
#[test]
fn pictures_are_decoded() {
    let folder = Folder::new();
    for (format, tolerance) in
        [(image::ImageFormat::Png, 0.0), (image::ImageFormat::WebP, 0.0), (image::ImageFormat::Jpeg, 0.02)]
    {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image::RgbImage::from_pixel(16, 8, image::Rgb([255, 188, 0])).write_to(&mut bytes, format).unwrap();
        for name in ["sky.hdr", "sky.any"] {
            let (map, _) = load(&folder.write(name, bytes.get_ref())).unwrap();
            assert_eq!((map.width, map.height), (16, 8));
            let expected = Vec3::new(1.0, 0.5029, 0.0);
            assert!((map.radiance[5] - expected).abs().max_element() <= tolerance + 1e-4, "{}", map.radiance[5]);
        }
        let cut = &bytes.get_ref()[..bytes.get_ref().len() * 3 / 4];
        assert!(load(&folder.write("cut.hdr", cut)).unwrap_err().to_string().contains("ends early"), "{format:?}");
    }
}

#[test]
fn radiance_files_of_other_programs() {
    let folder = Folder::new();
    let mut file = b"#?RGBE\n# made by hand\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n+Y 2 +X 1\n".to_vec();
    file.extend([128, 64, 0, 130, 255, 0, 0, 128]);
    let (map, warnings) = load(&folder.write("sky.pic", &file)).unwrap();
    assert_eq!((map.width, map.height, warnings.len()), (1, 2, 0));
    assert_eq!(map.radiance[..], [Vec3::new(255.0 / 1024.0, 0.0, 0.0), Vec3::new(0.5, 0.25, 0.0)]);
    assert!(load(&folder.write("cut.hdr", &file[..file.len() - 1])).unwrap_err().to_string().contains("ends early"));
}

#[test]
fn what_lies_in_the_place_of_an_image() {
    let folder = Folder::new();
    for name in ["sky.hdr", "sky.exr", "sky.png"] {
        for (bytes, says) in [
            (&b""[..], "is empty"),
            (b"version https://git-lfs.github.com/spec/v1\noid sha256:4d\nsize 1\n", "is a Git LFS pointer"),
            (b"<!DOCTYPE html><html>", "is an HTML page"),
        ] {
            assert!(load(&folder.write(name, bytes)).unwrap_err().to_string().contains(says), "{name}, {says}");
        }
    }
}
