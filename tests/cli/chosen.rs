//! Camera, AO radius and light that options leave open: chosen once, and printed as options that choose the same.

use std::path::Path;

use skylit::output::{self, Image};
use skylit::scene::export::export_gltf;
use skylit::scene::{Environment, Scene, builtin};

use crate::common::command::{device, json, place, run, stderr};

/// Writes a scene without cameras and lights.
fn bare(dir: &tempfile::TempDir, name: &str) -> String {
    let scene = builtin::by_name(name).unwrap();
    let path = place(dir, "bare.glb");
    let bare = Scene { cameras: Vec::new(), lights: Vec::new(), environment: Environment::Black, ..scene };
    export_gltf(&bare, path.as_ref()).unwrap();
    path
}

fn words(text: &str) -> Vec<String> {
    shlex::split(text).unwrap()
}

fn load(path: &str) -> Image {
    output::load(Path::new(path)).unwrap()
}

#[test]
fn gpu_printed_options_choose_the_same() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let scene = bare(&dir, "stairs");
    let [a, b] = ["a.exr", "b.exr"].map(|n| place(&dir, n));
    let cases = [
        ("--integrator path --spp 2 --max-depth 2", "--light"),
        ("--ao-radius 7% --spp 2 --view iso", "--ao-radius"),
        ("--ao-radius 7% --spp 2 --view top --orthographic fit", "--orthographic"),
        ("--preset fast --frames 0..2 --ao-radius auto", "--ao-radius"),
    ];
    for (options, says) in cases {
        let options = words(options);
        let render = |output: &str, chosen: &[String]| {
            let first = ["render", &scene, "-o", output, "--size", "48x24", "--json"].map(str::to_owned);
            // what chose the camera
            let replaced = ["--view", "iso", "top", "--orthographic", "fit"];
            let kept = options.iter().filter(|w| chosen.is_empty() || !replaced.contains(&w.as_str()));
            let all: Vec<&str> = first.iter().chain(kept).chain(chosen).map(String::as_str).collect();
            json(&run(&all))
        };
        let pattern = |path: &str| {
            if options.contains(&"--frames".to_owned()) { path.replace(".exr", ".#.exr") } else { path.to_owned() }
        };
        let record = render(&pattern(&a), &[]);
        let chosen = record["chosen"].as_str().unwrap().to_owned();
        assert!(chosen.contains("--eye") && chosen.contains(says), "{record}");
        // numbers that a person can read, and each in a sentence, too
        assert!(chosen.split([' ', ',', '=']).all(|word| word.len() <= 14), "{chosen}");
        let choices = record["choices"].to_string();
        assert!(words(&chosen).iter().all(|w| choices.contains(w.as_str())), "{chosen}: {choices}");
        let again = render(&pattern(&b), &words(&chosen));
        assert!(again["chosen"].is_null() && again["choices"].as_array().unwrap().is_empty(), "{again}");
        let file = |path: &str| load(&pattern(path).replace('#', "1"));
        let (first, second) = (file(&a), file(&b));
        assert_eq!(first.metadata("chosen"), Some(chosen.as_str()));
        let bits = |image: &Image| {
            let colours = ["R", "G", "B", "Y", "A"].into_iter().filter_map(|n| image.f32(n));
            colours.flatten().map(|v| v.to_bits()).collect::<Vec<_>>()
        };
        // in numbers: a view that was asked for has its name in words, too
        let poses = [&first, &second].map(|image| image.metadata("camera_pose").unwrap().to_owned());
        assert!(bits(&first) == bits(&second) && poses[0] == poses[1], "{chosen}: {poses:?}");
    }

    // `info` says the same for the size that is asked about
    let info = json(&run(&["info", &scene, "--size", "48x24", "--json"]));
    let suggested = |key: &str| words(info["suggestions"][key].as_str().unwrap());
    let text =
        run(&["render", &scene, "-o", &a, "--size", "48x24", "--integrator", "path", "--spp", "1", "--max-depth", "1"]);
    let text = String::from_utf8(text.stdout).unwrap();
    for word in suggested("camera").iter().chain(&suggested("light")) {
        assert!(text.contains(word.as_str()), "{word}: {text}");
    }
    // another shape of the image has another camera
    let wide = json(&run(&["info", &scene, "--size", "24x48", "--json"]));
    assert_ne!(wide["suggestions"]["camera"], info["suggestions"]["camera"]);
}

/// Root mean square of the difference over the pixels that show surfaces.
fn rmse(a: &Image, b: &Image) -> f64 {
    let alpha = a.f32("A").unwrap();
    let covered = || alpha.iter().enumerate().filter(|(_, a)| **a > 0.999).map(|(p, _)| p);
    let square = |c: &str| -> f64 {
        let (a, b) = (a.f32(c).unwrap(), b.f32(c).unwrap());
        covered().map(|p| f64::from(a[p] - b[p]).powi(2)).sum()
    };
    (["R", "G", "B"].map(square).iter().sum::<f64>() / (3.0 * covered().count() as f64)).sqrt()
}

#[test]
fn gpu_commands_of_ao_vs_path_have_the_error_that_it_finds() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let scene = bare(&dir, "stairs");
    let small = ["--size", "64x36", "--spp", "64", "--ao-samples", "64", "--max-depth", "4"];
    let out = run(&[&["compare", "ao-vs-path", &scene, "--json"], &small[..]].concat());
    let record = json(&out);
    let fit = &record["path"][0];
    let promised = fit["best"]["rmse"].as_f64().unwrap();
    // the light that `render` takes by itself
    let by_itself = place(&dir, "by-itself.exr");
    let path = [
        "render",
        &scene,
        "-o",
        &by_itself,
        "--integrator",
        "path",
        "--size",
        "64x36",
        "--spp",
        "64",
        "--max-depth",
        "4",
    ];
    let rendered = json(&run(&[&path[..], &["--json"]].concat()));
    assert_eq!(rendered["chosen"], record["chosen"]);

    // as printed, but for the folder
    let images: Vec<Image> = ["lit", "path"]
        .iter()
        .zip(record["commands"].as_array().unwrap())
        .map(|(name, command)| {
            let mut words = words(command.as_str().unwrap());
            assert_eq!(words.remove(0), "skylit");
            assert_eq!(words.last().unwrap(), &format!("{name}.exr"));
            let path = place(&dir, &format!("{name}.exr"));
            *words.last_mut().unwrap() = path.clone();
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            let out = run(&words);
            assert!(out.status.success(), "{command}: {}", stderr(&out));
            load(&path)
        })
        .collect();
    let found = rmse(&images[0], &images[1]);
    assert!((found / promised - 1.0).abs() < 0.25, "{found}, promised is {promised}: {record}");
    // the last of options that are given twice counts
    let text = run(&[&path[..], &["--spp", "1", "--max-depth", "1", "-v"]].concat());
    let text = String::from_utf8_lossy(&text.stdout).into_owned();
    assert!(text.contains("1 spp, path") && text.contains("(limit 1)"), "{text}");
}

/// Options that decide what is made of the scene's file are in the record and in the metadata of images, and make the same image again.
#[test]
fn gpu_options_of_the_scene_are_noted() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let scene = bare(&dir, "stairs");
    let [exr, frames, again, plain] = ["a.exr", "f.#.exr", "b.exr", "c.exr"].map(|name| place(&dir, name));
    let render = |output: &str, options: &[&str]| {
        let first = ["render", &scene, "-o", output, "--size", "32x24", "--spp", "2", "--json"];
        json(&run(&first.into_iter().chain(options.iter().copied()).collect::<Vec<_>>()))
    };
    let noted = "--gltf-scene 0 --normals 30 --uv box --mtl-dissolve glass";
    let options: Vec<&str> = noted.split(' ').collect();
    let record = render(&exr, &options);
    assert_eq!(record["scene_options"], noted);
    assert_eq!(load(&exr).metadata("scene.options"), Some(noted));
    let realtime = json(&run(&[
        &["render", scene.as_str(), "-o", &frames, "--size", "32x24", "--frames", "0..1", "--json"],
        &options[..],
    ]
    .concat()));
    assert_eq!(realtime["scene_options"], noted);
    assert_eq!(load(&frames.replace('#', "0")).metadata("scene.options"), Some(noted));

    // what is noted makes the image again, and nothing is noted of defaults
    let words = words(load(&exr).metadata("scene.options").unwrap());
    render(&again, &words.iter().map(String::as_str).collect::<Vec<_>>());
    let bits = |path: &str| load(path).f32("Y").unwrap().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&exr), bits(&again));
    assert!(render(&plain, &["--normals", "file"])["scene_options"].is_null());
    assert_eq!(load(&plain).metadata("scene.options"), None);
}
