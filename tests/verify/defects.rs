//! Planted defects are found; other seeds, tracers and vector widths are not taken for defects.

use std::path::Path;

use skylit::output::{Image, Samples};
use skylit::scene::export::export_gltf;
use skylit::scene::{Geometry, Scene};
use skylit::verify::Options;
use skylit::verify::golden::{Golden, shown_image};
use skylit::verify::judge::judge;
use skylit::verify::manifest::{Manifest, Tracers};

use crate::common::{self, command, device, tracers};
use crate::{bless, differing, run, verify};

const FRAMES: &str = r#"
[[frame]]
name = "ao"
scene = "box.glb"
render = "ao --size 48x48 --spp 512"
tolerance = { z_test = { bias = 0.005 } }

[[frame]]
name = "path"
scene = "box.glb"
render = "path --size 32x32 --spp 64 --max-depth 3 --environment 0.5,0.5,0.5"
tolerance = "z_test"

[[frame]]
name = "picture"
scene = "box.glb"
render = "path --size 32x32 --spp 64 --max-depth 3 --environment 0.5,0.5,0.5 --tone-map agx --exposure 1"
golden = "png"
tolerance = { flip = { percentile = 99, max = 0.1 } }

[[frame]]
name = "preset"
scene = "box.glb"
render = "balanced --size 48x48 --frames 0..4"
golden = "png"
tolerance = { flip = { percentile = 98, max = 0.1 }, bad_pixels = 4 }
"#;

fn cornell() -> Scene {
    common::scene("cornell-box")
}

fn export(scene: &Scene, folder: &Path) {
    export_gltf(scene, &folder.join("box.glb")).unwrap();
}

/// A folder with frames of the Cornell box and their golden images.
fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    export(&cornell(), dir.path());
    std::fs::write(dir.path().join("frames.toml"), FRAMES).unwrap();
    bless(dir.path());
    assert_eq!(differing(&verify(dir.path())), [""; 0]);
    dir
}

fn names(lines: &[String]) -> Vec<&str> {
    lines.iter().map(|l| l.split(':').next().unwrap()).collect()
}

/// Rewrites a golden image: what is planted there is missing from the image.
fn plant(folder: &Path, frame: &str, change: impl FnOnce(&mut Image)) {
    let manifest = Manifest::load(folder).unwrap();
    let frame = manifest.frames.iter().find(|f| f.name == frame).unwrap();
    let mut golden = Golden::load(&manifest.golden(frame)).unwrap();
    change(&mut golden.image);
    golden.save().unwrap();
}

/// Applies `change` to the colours of an image: of each channel, its samples and the image's width.
fn colours(image: &mut Image, change: impl Fn(&mut Vec<f32>, usize)) {
    let width = image.width as usize;
    for channel in image.channels.iter_mut().filter(|c| ["R", "G", "B", "Y"].contains(&c.name.as_str())) {
        if let Samples::F32(samples) = &mut channel.samples {
            change(samples, width);
        }
    }
}

/// One folder for all: making golden images is most of what these tests cost.
#[test]
fn gpu_planted_defects_are_found_and_noise_is_not() {
    let dir = folder();
    let folder = dir.path();

    // other seeds
    for seed in [1, 123_456_789] {
        let summary = run(folder, &Options { seed: Some(seed), ..Default::default() });
        assert_eq!(differing(&summary), [""; 0], "seed {seed}");
    }
    // other tracers
    assert!(!tracers(&device()).is_empty());
    let all = run(folder, &Options { tracers: Some(Tracers::All), ..Default::default() });
    assert_eq!(all.frames.len(), 4 * tracers(&device()).len());
    assert_eq!(differing(&all), [""; 0]);

    // a mesh that is missing
    let mut scene = cornell();
    let short =
        scene.instances.iter().position(|i| scene.meshes[i.mesh].name.contains("short")).expect("the short block");
    scene.instances.remove(short);
    export(&scene, folder);
    let found = differing(&verify(folder));
    assert_eq!(names(&found), ["ao", "path", "picture", "preset"], "{found:#?}");

    // a leak: the left wall stands 4 mm off, and light comes through the slit
    let mut scene = cornell();
    let wall = scene.instances.iter().position(|i| scene.meshes[i.mesh].name.contains("left")).expect("the left wall");
    if let Geometry::Triangles(mesh) = &mut scene.meshes[scene.instances[wall].mesh].geometry {
        for p in &mut mesh.positions {
            p.y = 0.04 + p.y * 0.99;
        }
    }
    export(&scene, folder);
    let found = differing(&verify(folder));
    assert!(names(&found).starts_with(&["ao", "path"]), "{found:#?}");
    export(&cornell(), folder);

    // half a percent of the mean
    let original = std::fs::read(folder.join("ao.exr")).unwrap();
    for factor in [1.005, 1.0 / 1.005] {
        plant(folder, "ao", |image| colours(image, |samples, _| samples.iter_mut().for_each(|v| *v *= factor)));
        let found = differing(&verify(folder));
        assert!(names(&found) == ["ao"] && found[0].contains("the image's mean"), "{found:#?}");
        std::fs::write(folder.join("ao.exr"), &original).unwrap();
    }

    // a column to the right
    let shift = |samples: &mut Vec<f32>, width: usize| samples.chunks_mut(width).for_each(|row| row.rotate_right(1));
    ["ao", "path", "picture", "preset"].iter().for_each(|frame| plant(folder, frame, |image| colours(image, shift)));
    let found = differing(&verify(folder));
    assert_eq!(names(&found), ["ao", "path", "picture", "preset"], "{found:#?}");
    ["ao", "path", "picture", "preset"].iter().for_each(|frame| {
        plant(folder, frame, |image| colours(image, |s, w| s.chunks_mut(w).for_each(|row| row.rotate_left(1))))
    });
    assert_eq!(differing(&verify(folder)), [""; 0]);

    // one value that is no number
    plant(folder, "path", |image| {
        let red = image.channels.iter_mut().find(|c| c.name == "R").unwrap();
        let Samples::F32(samples) = &mut red.samples else { panic!("floats") };
        samples[333] = f32::NAN;
    });
    let found = differing(&verify(folder));
    assert!(names(&found) == ["path"] && found[0].contains("1 pixel with values that are not finite"), "{found:#?}");

    // ... and in a frame that allows some bad pixels
    let manifest = Manifest::load(folder).unwrap();
    let frame = manifest.frames.iter().find(|f| f.name == "preset").unwrap();
    let mut renderer = skylit::Renderer::new(device(), cornell(), &Default::default()).unwrap();
    let mut image = renderer.image(&frame.settings, &mut skylit::film::NoControl).unwrap();
    let golden = Golden::load(&manifest.golden(frame)).unwrap();
    assert!(judge(frame, &image, &golden).unwrap().holds());
    colours(&mut image, |samples, _| samples[333] = f32::NAN);
    let judgement = judge(frame, &image, &golden).unwrap();
    assert!(
        !judgement.holds() && judgement.text().contains("1 pixel with values that are not finite"),
        "{judgement:?}"
    );

    // the tone map of another curve
    let frame = manifest.frames.iter().find(|f| f.name == "picture").unwrap();
    let mut other = frame.clone();
    other.settings.picture.tone_map = None;
    let image = renderer.image(&frame.settings, &mut skylit::film::NoControl).unwrap();
    plant(folder, "picture", |golden| golden.channels = shown_image(&other, &image).channels);
    let found = differing(&verify(folder));
    assert_eq!(names(&found), ["path", "picture"], "{found:#?}");
}

/// Mesa's CPU driver reads the width of its vectors when it is loaded: each needs a process.
#[test]
fn gpu_other_vector_widths_hold() {
    let device = device();
    if !device.info.name.starts_with("llvmpipe") {
        return println!("skipped: {} has no vector width to choose", device.info.name);
    }
    let dir = folder();
    // the widest is that of this device, if its processor has such vectors
    for width in if common::is_full() { &["128", "256", "512"][..] } else { &["128", "256"] } {
        let out = command::skylit(&["verify", dir.path().to_str().unwrap(), "--json"])
            .env("LP_NATIVE_VECTOR_WIDTH", width)
            .output()
            .unwrap();
        let record = command::json(&out);
        println!("{width} bits: {}", record["device"]);
        assert_eq!(record["frames"].as_array().unwrap().len(), 4);
    }
}
