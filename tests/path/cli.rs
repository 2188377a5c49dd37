//! `skylit render` where it goes on with films, saves them on their way, and stops where they are good enough.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use skylit::output::{self, Samples};

use crate::common::command::{json, place, refuses, run, skylit};

const BASE: [&str; 8] = ["render", "builtin:cornell-box", "--integrator", "path", "--size", "40x24", "--seed", "5"];

/// Runs `render` of the scene that all tests share, with more options; returns its record.
pub fn render(more: &[&str]) -> Value {
    let args = [&BASE[..], more, &["--json", "--validation"]].concat();
    json(&run(&args))
}

pub fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().file_name().to_str().unwrap().to_owned()).collect();
    names.sort();
    names
}

pub fn bytes(path: &str) -> Vec<u8> {
    std::fs::read(path).unwrap()
}

#[test]
fn gpu_an_image_that_goes_on_has_the_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| place(&dir, name);
    let (whole, begun, png) = (at("whole.exr"), at("begun.exr"), at("a.png"));
    for integrator in ["path", "direct", "ao-sky", "ao"] {
        let options = |more: &[&'static str]| [&["--integrator", integrator][..], more].concat();
        // the last one counts
        let render = |more: &[&str]| {
            let args: Vec<&str> = BASE
                .iter()
                .copied()
                .filter(|a| !["--integrator", "path"].contains(a))
                .chain(more.iter().copied())
                .collect();
            // what is resumed is the same for all of them
            let validation: &[&str] = if integrator == "path" { &["--validation"] } else { &[] };
            let out = run(&[&args[..], &["--json"], validation].concat());
            assert!(out.status.success(), "{args:?}: {}", String::from_utf8_lossy(&out.stderr));
            serde_json::from_slice::<Value>(&out.stdout).unwrap()
        };
        render(&[&options(&["--spp", "16", "--resumable", "--aov", "depth", "-o"])[..], &[&whole]].concat());
        render(&[&options(&["--spp", "3", "--resumable", "-o"])[..], &[&begun]].concat());
        // in its own place, twice, and with a picture beside it
        render(&[&options(&["--spp", "7", "--resume"])[..], &[&begun, "-o", &begun]].concat());
        let record = render(
            &[&options(&["--spp", "16", "--aov", "depth", "--resume"])[..], &[&begun, "-o", &begun, "-o", &png]]
                .concat(),
        );
        assert_eq!(
            (record["spp"].as_u64(), record["film"]["samples_before"].as_u64()),
            (Some(16), Some(7)),
            "{record}"
        );
        assert_eq!(
            record["rays"]["primary"].as_u64().unwrap() + record["rays"]["skipped_primary"].as_u64().unwrap(),
            9 * 40 * 24
        );
        assert!(record["warnings"].as_array().unwrap().is_empty(), "{record}");
        assert!(bytes(&whole) == bytes(&begun), "{integrator}: other bytes");
        // as many samples as there are: nothing is traced, and the picture is made
        let first = bytes(&png);
        std::fs::remove_file(&png).unwrap();
        let record = render(&[&options(&["--spp", "16", "--resume"])[..], &[&begun, "-o", &png]].concat());
        assert_eq!(record["rays"]["primary"], 0);
        assert!(first == bytes(&png), "{integrator}: another picture");
    }
    assert_eq!(names(dir.path()), ["a.png", "begun.exr", "whole.exr"]);
    // what is no image is not compared
    let out = run(&["diff", &whole, &begun, "--json"]);
    let difference: Value = serde_json::from_slice(&out.stdout).unwrap();
    let channels: Vec<_> =
        difference["channels"].as_array().unwrap().iter().map(|c| c["channel"].as_str().unwrap()).collect();
    assert!(channels.contains(&"Y") && !channels.iter().any(|c| c.starts_with("state")), "{channels:?}");
}

#[test]
fn gpu_a_film_goes_on_only_as_it_was_begun() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| place(&dir, name);
    let (film, plain, out) = (at("film.exr"), at("plain.exr"), at("out.exr"));
    render(&["--spp", "4", "--resumable", "-o", &film]);
    render(&["--spp", "4", "-o", &plain]);
    let go_on = |more: &[&'static str]| -> Vec<String> {
        let mut args: Vec<String> = BASE.iter().map(|a| (*a).to_owned()).collect();
        for pair in more.chunks(2) {
            // in place of what the base says
            match args.iter().position(|a| a == pair[0]) {
                Some(k) => args[k + 1] = pair[1].to_owned(),
                None if pair[0] == "SCENE" => args[1] = pair[1].to_owned(),
                None => args.extend(pair.iter().map(|a| (*a).to_owned())),
            }
        }
        args.extend(["--spp", "8", "--resume", &film, "-o", &out].map(str::to_owned));
        args
    };
    let differs = |more: &[&'static str], says: &str| {
        let args = go_on(more);
        refuses(&args.iter().map(String::as_str).collect::<Vec<_>>(), 64, says);
    };
    differs(&["--seed", "6"], "its seed is 5, this run's is 6");
    differs(&["--size", "24x40"], "its size is 40x24, this run's is 24x40");
    differs(&["--integrator", "direct"], "its integrator is path, this run's is direct");
    differs(&["--max-depth", "3"], "its max depth is");
    differs(&["--rr-depth", "2"], "its rr depth is 5, this run's is 2");
    differs(&["--sampling", "bsdf"], "its sampling is mis, this run's is bsdf");
    differs(&["--firefly-clamp", "2"], "its firefly clamp is none, this run's is 2");
    differs(&["--pixel-filter", "tent"], "its pixel filter is box, this run's is tent");
    differs(&["--f-number", "8", "--focus-distance", "3"], "its lens is none, this run's is radius");
    differs(&["--eye", "0,1,5", "--target", "0,1,0"], "its camera is");
    differs(&["--fov-y", "33"], "its camera is");
    differs(&["--environment", "1,1,1"], "its environment is black (contents");
    differs(&["SCENE", "builtin:cornell-mirror"], "scene is builtin:cornell-box (contents");
    // what changes no sample may differ
    let args = go_on(&["--tone-map", "agx"]);
    assert!(run(&args.iter().map(String::as_str).collect::<Vec<_>>()).status.success());
    std::fs::remove_file(&out).unwrap();

    let with = |spp: &'static str, film: &'static str| {
        let film = at(film);
        let args = [&BASE[..], &["--spp", spp, "--resume", &film, "-o", &out]].concat();
        args.iter().map(|a| (*a).to_owned()).collect::<Vec<_>>()
    };
    let fails = |args: Vec<String>, code: i32, says: &str| {
        refuses(&args.iter().map(String::as_str).collect::<Vec<_>>(), code, says)
    };
    fails(with("3", "film.exr"), 64, "has 4 samples per pixel already");
    fails(with("8", "plain.exr"), 3, "plain.exr: it has no film state to resume; render it with --resumable");
    fails(with("8", "none.exr"), 3, "no such file");
    // a film that no run leaves: pixels of one tile with different samples, a channel that is not there, one of another kind
    let image = output::load(film.as_ref()).unwrap();
    let damage = |change: &dyn Fn(&mut output::Image)| {
        let mut image = image.clone();
        change(&mut image);
        output::save(&image, at("damaged.exr").as_ref()).unwrap();
        fails(with("8", "damaged.exr"), 3, "damaged.exr: its film state is damaged");
    };
    let find = |image: &output::Image, name: &str| image.channels.iter().position(|c| c.name == name).unwrap();
    damage(&|image| {
        let k = find(image, "state.samples");
        if let Samples::U32(samples) = &mut image.channels[k].samples {
            samples[9] = 5;
        }
    });
    damage(&|image| image.channels.retain(|c| c.name != "state.excess.G"));
    damage(&|image| {
        let k = find(image, "state.covered");
        image.channels[k].samples = Samples::F32(vec![0.0; 40 * 24]);
    });
    assert_eq!(names(dir.path()), ["damaged.exr", "film.exr", "plain.exr"]);

    // begun by another tracer: as right as any, and said
    let mut other = image.clone();
    other.metadata.iter_mut().filter(|(key, _)| key == "tracer").for_each(|(_, tracer)| *tracer = "another".into());
    output::save(&other, film.as_ref()).unwrap();
    let record = render(&["--spp", "8", "--resume", &film, "-o", &out]);
    assert!(record["warnings"][0].as_str().unwrap().contains("was started with tracer another"), "{record}");
}

#[test]
fn gpu_intervals_are_the_files_of_shorter_runs() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| place(&dir, name);
    let (exr, png) = (at("x.exr"), at("x.png"));
    render(&["--spp", "10", "--intervals", "--aov", "ng", "-o", &exr, "-o", &png]);
    let intervals = ["0001", "0002", "0004", "0008"];
    let mut all: Vec<String> = intervals.iter().flat_map(|n| [format!("x.{n}.exr"), format!("x.{n}.png")]).collect();
    all.extend(["x.exr".to_owned(), "x.png".to_owned()]);
    assert_eq!(names(dir.path()), all);
    let (alone, picture) = (at("alone.exr"), at("alone.png"));
    let files: Vec<(&str, String)> =
        intervals.iter().map(|n| (*n, format!("x.{n}"))).chain([("10", "x".to_owned())]).collect();
    for (samples, name) in &files {
        let spp = samples.trim_start_matches('0');
        render(&["--spp", spp, "--resumable", "--aov", "ng", "-o", &alone, "-o", &picture]);
        assert!(bytes(&alone) == bytes(&at(&format!("{name}.exr"))), "{name}.exr: other bytes");
        assert!(bytes(&picture) == bytes(&at(&format!("{name}.png"))), "{name}.png: other bytes");
    }
    // from any of them the last one comes out
    render(&["--spp", "10", "--aov", "ng", "--resume", &at("x.0004.exr"), "-o", &alone]);
    assert!(bytes(&alone) == bytes(&exr), "from x.0004.exr: other bytes");
}

#[test]
fn gpu_a_target_is_told_of() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| place(&dir, name);
    let (exr, begun) = (at("x.exr"), at("begun.exr"));
    let target = ["--target-rmse", "0.05"];
    let record = render(&[&["--spp", "4096", "--resumable", "-o", &exr][..], &target].concat());
    let film = &record["film"];
    let number = |name: &str| film["samples"][name].as_f64().unwrap();
    assert!(film["estimated_rmse"].as_f64().unwrap() <= 0.05 && film["target_rmse"] == 0.05, "{film}");
    assert_eq!((film["tiles"]["all"].as_u64(), film["tiles"]["done"].as_u64()), (Some(15), Some(15)), "{film}");
    assert!(64.0 <= number("min") && number("min") <= number("mean") && number("mean") <= number("max"), "{film}");
    assert!(number("max") < 4096.0 && record["stopped_early"] == false, "{record}");
    // samples of each pixel are in the file
    let image = output::load(exr.as_ref()).unwrap();
    let samples = image.f32("samples").unwrap();
    let extreme = |of: fn(f32, f32) -> f32| f64::from(samples.iter().copied().reduce(of).unwrap());
    assert_eq!((extreme(f32::min), extreme(f32::max)), (number("min"), number("max")));
    // in two runs
    render(&[&["--spp", "100", "--resumable", "-o", &begun][..], &target].concat());
    render(&[&["--spp", "4096", "--resume", &begun, "-o", &begun][..], &target].concat());
    assert!(bytes(&exr) == bytes(&begun), "other bytes");
    // people are told as well
    let out = run(&[&BASE[..], &["--spp", "64", "-o", &begun], &target].concat());
    let text = String::from_utf8(out.stdout).unwrap();
    assert!(
        text.contains("estimated rmse") && text.contains("of 15 tiles done") && text.contains("64 to 64 samples"),
        "{text}"
    );
}

/// A run that is broken off leaves images that are whole, or none.
#[cfg(unix)]
#[test]
fn gpu_a_run_that_is_broken_off_leaves_whole_files() {
    for (signal, keep) in [("-INT", false), ("-INT", true), ("-KILL", false)] {
        let dir = tempfile::tempdir().unwrap();
        let exr = place(&dir, "x.exr");
        let mut args = [&BASE[..], &["--spp", "1000000", "--intervals", "-o", &exr]].concat();
        if keep {
            args.push("--keep-partial");
        }
        let mut child = skylit(&args).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let start = Instant::now();
        while !dir.path().join("x.0008.exr").exists() {
            assert!(start.elapsed() < Duration::from_secs(120), "there is no image of 8 samples");
            std::thread::sleep(Duration::from_millis(5));
        }
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        let status = child.wait().unwrap();
        assert_eq!(status.code(), (signal == "-INT").then_some(130), "{signal}");
        let mut there = names(dir.path());
        if signal == "-KILL" {
            // nobody was left to remove it
            there.retain(|name| !name.ends_with(".tmp"));
        }
        assert_eq!(there.contains(&"x.exr".to_owned()), keep, "{there:?}");
        assert!(there.len() >= 4 && there.iter().all(|name| name.starts_with("x.")), "{there:?}");
        for name in &there {
            let image = output::load(&dir.path().join(name)).unwrap();
            let spp: u32 = image.metadata("spp").unwrap().parse().unwrap();
            assert!(keep && name == "x.exr" || *name == format!("x.{spp:04}.exr"), "{name} has {spp} samples");
        }
        if keep {
            // it goes on from there
            let had: u32 = output::load(exr.as_ref()).unwrap().metadata("spp").unwrap().parse().unwrap();
            let more = (had + 3).to_string();
            let record = render(&["--spp", &more, "--resume", &exr, "-o", &exr]);
            assert_eq!(record["film"]["samples_before"].as_u64(), Some(had.into()));
            let whole = place(&dir, "whole.exr");
            render(&["--spp", &more, "--resumable", "-o", &whole]);
            assert!(bytes(&exr) == bytes(&whole), "other bytes");
        }
    }
    // a name on the way that cannot be written is known before anything is done
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("x.0008.exr")).unwrap();
    refuses(&[&BASE[..], &["--spp", "16", "--intervals", "-o", &place(&dir, "x.exr")]].concat(), 4, "x.0008.exr");
    assert_eq!(names(dir.path()), ["x.0008.exr"]);
}

/// Options that an integrator has no use for are refused by their own names, and no other option is named.
#[test]
fn options_of_frames_are_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let image = place(&dir, "a.exr");
    for (option, value) in [("--preset", "fast"), ("--history", "8"), ("--antialias", "on"), ("--at-rest", "hold")] {
        let says = format!(
            "{option} has no effect on --integrator normals: leave it out, or use --integrator ao, path, direct, lit, whitted or ao-sky"
        );
        refuses(&["render", BASE[1], "--integrator", "normals", "-o", &image, option, value], 64, &says);
    }
    for (option, value) in [("--ao-radius", "1"), ("--ao-falloff", "2"), ("--dump-rays", "x")] {
        let says = format!("{option} has no effect on --integrator path: leave it out, or use --integrator ao");
        refuses(&[&BASE[..], &["-o", &image, option, value]].concat(), 64, &says);
    }
    let sky =
        ["render", BASE[1], "-o", &image, "--integrator", "ao-sky", "--light", "point position=0,1,0 intensity=1"];
    refuses(
        &sky,
        64,
        "--light has no effect on --integrator ao-sky: leave it out, or use --integrator path, direct, lit or whitted",
    );
}

/// Features that are not required are specialized out, and --explain reports it.
#[test]
fn gpu_what_is_compiled_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let told = |args: &[&str]| {
        render(&[&["-o", &place(&dir, "a.exr"), "--spp", "1", "--explain"], args].concat())["explain"].to_string()
    };
    let plain = told(&[]);
    let lights = "require emissive rectangles, surfaces that light samples find, light samples, multiple importance sampling; \
        specialized out: emissive triangles, emissive spheres";
    assert!(plain.contains(lights), "{plain}");
    assert!(plain.contains("textures beside base colours: nothing; specialized out: metallic-roughness"), "{plain}");
    let light = "spot position=0.1,1,0.1 direction=0,-1,0 outer=40 intensity=3";
    let spot = told(&["--sampling", "light", "--light", light]);
    assert!(
        spot.contains("require emissive rectangles, spot lights, light tree, surfaces that light samples find, light samples; specialized out"),
        "{spot}"
    );
    let bsdf = told(&["--sampling", "bsdf", "--light", light, "--firefly-clamp", "9"]);
    assert!(
        bsdf.contains("require radiance clamp; specialized out: emissive rectangles, emissive triangles"),
        "{bsdf}"
    );
    let image = place(&dir, "b.exr");
    let out = run(&[
        "render",
        BASE[1],
        "-o",
        &image,
        "--integrator",
        "normals",
        "--size",
        "40x24",
        "--spp",
        "1",
        "--explain",
        "--json",
    ]);
    let view = String::from_utf8(out.stdout).unwrap();
    assert!(view.contains("lights and options require auxiliary view; specialized out"), "{view}");
}

/// It changes the image: it has to be as it was, and it is said.
#[test]
fn gpu_texture_filters_are_told_and_kept() {
    let dir = tempfile::tempdir().unwrap();
    let film = place(&dir, "a.exr");
    let told = render(&["-o", &film, "--spp", "2", "--texture-filter", "ray-cone", "--resumable", "--explain"]);
    assert_eq!((&told["texture_filter"], &told["mip_bytes"]), (&"ray-cone".into(), &0.into()), "{told}");
    assert!(told["explain"].to_string().contains("mip levels: none, no surface has a texture"), "{told}");
    let plain = render(&["-o", &place(&dir, "b.exr"), "--spp", "1", "--explain"]);
    assert_eq!(plain["texture_filter"], "bilinear");
    assert!(plain["explain"].to_string().contains("mip levels: unused"), "{plain}");
    let [on, never] = ["c.exr", "d.exr"].map(|name| place(&dir, name));
    refuses(&[&BASE[..], &["-o", &on, "--spp", "4", "--resume", &film]].concat(), 64, "texture filter");
    for integrator in ["ao", "depth", "ao-sky"] {
        let says = &format!("--texture-filter has no effect on --integrator {integrator}");
        let args = ["render", BASE[1], "-o", &never, "--integrator", integrator, "--texture-filter", "ray-cone"];
        refuses(&args, 64, says);
    }
}
