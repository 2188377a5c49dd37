//! The program from outside: what it prints, where, and how it ends.

use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;
use skylit::output::picture::Picture;
use skylit::output::png::Colour;

use crate::common::command::{assert_refusal, json, refuses, run, skylit};

fn path(p: &Path) -> &str {
    p.to_str().unwrap()
}

#[test]
fn help_and_version() {
    for args in
        [&["--help"][..], &["-h"], &["--version"], &["render", "--help"], &["doctor", "-h"], &["diff", "--help"]]
    {
        let out = run(args);
        assert!(out.status.success() && out.stderr.is_empty() && !out.stdout.is_empty(), "{args:?}");
    }
    let help = String::from_utf8(run(&["--help"]).stdout).unwrap();
    assert!(help.contains("Exit codes") && help.contains("130"));
}

#[test]
fn usage_errors() {
    let out = "/nonexistent/a.exr";
    let render = |extra: &[&'static str]| [&["render", "builtin:plane", "-o", out], extra].concat();
    refuses(&[], 64, "no command");
    refuses(&["fly"], 64, "fly");
    refuses(&["render", "builtin:plane"], 64, "--output");
    refuses(&["render", "builtin:plane", "-o", "a.bmp"], 64, ".exr, .png, .jpg or .webp");
    refuses(&["render", "builtin:plane", "-o", "a.png", "--aov", "depth"], 64, "--aov needs an .exr");
    refuses(&render(&["--aov", "bent"]), 64, "--aov bent is for frames in real time");
    refuses(&render(&["--preset", "fast", "--show", "normal"]), 64, "--show is for pictures");
    refuses(
        &["render", "builtin:plane", "-o", "a.png", "--preset", "larsen", "--show", "samples"],
        64,
        "counts no samples",
    );
    refuses(
        &["render", "builtin:plane", "-o", "a.png", "--technique", "gtao", "--show", "bent"],
        64,
        "technique traced",
    );
    refuses(&render(&["--preset", "larsen", "--history", "8"]), 64, "--history has no effect on --preset larsen");
    refuses(&render(&["--tracer", "magic"]), 64, "pipeline, query, compute");
    refuses(&render(&["--size", "0x5"]), 64, "at least 1");
    refuses(&render(&["--size", "20000x20000"]), 64, "16384x16384 is the most");
    refuses(&render(&["--size", "5"]), 64, "WIDTHxHEIGHT");
    refuses(&render(&["--spp", "0"]), 64, "--spp");
    refuses(&render(&["--fov-y", "nan"]), 64, "--fov-y");
    refuses(&render(&["--ao-falloff", "0.5"]), 64, "at least 1");
    refuses(&render(&["--ao-rays", "3"]), 64, "power of two from 1 to 16");
    refuses(&render(&["--ao-rays", "4", "--preset", "fast"]), 64, "--ao-rays is for stills");
    refuses(&render(&["--ao-radius", "-1"]), 64, "above 0");
    refuses(&render(&["--time-limit", "-3"]), 64, "above 0");
    refuses(&render(&["--eye", "1,2,3"]), 64, "--target");
    refuses(&render(&["--eye", "1,2", "--target", "0,0,0"]), 64, "X,Y,Z");
    refuses(&render(&["--eye", "1,2,3", "--target", "1,2,3"]), 64, "same point");
    refuses(&render(&["--aov", "depth,smell"]), 64, "smell");
    refuses(&render(&["--traversal", "backwards"]), 64, "auto, wide, packet, nearest, direction, brute");
    refuses(&render(&["--triangle-test", "none"]), 64, "watertight, moller-trumbore");
    refuses(&render(&["--tracer", "pipeline", "--build", "best"]), 64, "--tracer compute");
    refuses(&render(&["--traversal", "brute", "--build", "best"]), 64, "has no BVH");
    refuses(
        &render(&["--resumable", "--preset", "fast"]),
        64,
        "--resumable is for stills, and --preset selects frames",
    );
    refuses(&render(&["--resume", "a.exr", "--dump-rays", "r"]), 64, "leave --dump-rays out");
    refuses(&render(&["--integrator", "path", "--target-rmse", "0"]), 64, "above 0");
    refuses(&render(&["--quality", "best"]), 64, "draft, good, final");
    refuses(&render(&["--quality", "good", "--spp", "4"]), 64, "--quality and --spp both say how many samples");
    refuses(&render(&["--quality", "good", "--target-rmse", "1"]), 64, "--quality and --target-rmse are two bounds");
    for option in [&["--resumable"][..], &["--intervals"], &["--resume", "a.exr"]] {
        let says = format!("--quality and {} do not go together", option[0]);
        refuses(&render(&[&["--quality", "good"], option].concat()), 64, &says);
    }
    refuses(
        &render(&["--quality", "good", "--preset", "fast"]),
        64,
        "--quality is for stills, and --preset selects frames",
    );
    refuses(
        &render(&["--quality", "good", "--integrator", "depth"]),
        64,
        "--quality has no effect on --integrator depth",
    );
    refuses(&render(&["--integrator", "path", "--resume", "a.png"]), 64, "--resume a.png: only an .exr");
    refuses(
        &["render", "builtin:plane", "-o", "a.png", "--integrator", "path", "--resumable"],
        64,
        "--resumable needs an .exr",
    );
    refuses(
        &["rays", "--mesh", "a.bin", "--rays", "r.bin", "--traversal", "nearest", "--bvh-cache", "d"],
        64,
        "does not cache its BVH",
    );
    refuses(&["diff", "a.exr"], 64, "<B>");
    refuses(&["export", "builtin:plane", "a.txt"], 64, ".bin, .glb or .gltf");
}

#[test]
fn missing_inputs_and_unwritable_outputs() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| path(&dir.path().join(name)).to_owned();
    // before any work is done, so no device is needed
    refuses(&["render", "builtin:plane", "-o", &at("no/such/folder.exr")], 4, "folder does not exist");
    std::fs::create_dir(dir.path().join("folder.exr")).unwrap();
    refuses(&["render", "builtin:plane", "-o", &at("folder.exr")], 4, "is a folder");
    refuses(&["rays", "--mesh", "builtin:plane", "--rays", &at("none.bin")], 3, "no such file");
    std::fs::write(dir.path().join("odd.bin"), [0; 33]).unwrap();
    refuses(&["rays", "--mesh", "builtin:plane", "--rays", &at("odd.bin")], 3, "32 bytes");
    refuses(&["diff", &at("none.exr"), &at("none.exr")], 3, "no such file");
    std::fs::write(dir.path().join("text.exr"), "not an image").unwrap();
    refuses(&["diff", &at("text.exr"), &at("text.exr")], 3, "text.exr");
    std::fs::write(dir.path().join("text.png"), "not an image").unwrap();
    refuses(&["diff", &at("text.png"), &at("text.png")], 3, "text.png");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 4);
}

#[test]
fn failures_as_json() {
    let args = ["render", "builtin:plane", "-o", "a.bmp", "--json"];
    let out = run(&args);
    assert_refusal(&out, 64, ".exr", &args);
    let record: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(record["exit_code"], 64);
    assert!(record["error"].as_str().unwrap().contains(".png"));
}

#[test]
fn scenes_are_listed() {
    let out = run(&["scenes"]);
    let text = String::from_utf8(out.stdout).unwrap();
    assert!(text.lines().any(|l| l.starts_with("builtin:cornell-box ")));
    let list = json(&run(&["scenes", "--json"]));
    assert_eq!(list.as_array().unwrap().len(), text.lines().count());
}

#[cfg(unix)]
#[test]
fn a_reader_that_goes_away_is_no_error() {
    let mut child = skylit(&["scenes"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let out = child.wait_with_output().unwrap();
    assert!(out.status.success() && out.stderr.is_empty(), "{}", String::from_utf8_lossy(&out.stderr));
    if let Ok(full) = std::fs::OpenOptions::new().write(true).open("/dev/full") {
        let out = skylit(&["scenes"]).stdout(full).output().unwrap();
        assert_refusal(&out, 4, "the disk is full", &["scenes"]);
    }
}

#[test]
fn no_driver_is_exit_code_2() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("a.png");
    for args in [&["doctor"][..], &["render", "builtin:plane", "-o", path(&file)]] {
        let out = skylit(args)
            .env("VK_DRIVER_FILES", "/nonexistent")
            .env("VK_ICD_FILENAMES", "/nonexistent")
            .output()
            .unwrap();
        assert_refusal(&out, 2, "Vulkan", args);
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}

/// A kept hierarchy gives the same image, a damaged one is mended with a warning, and a folder that cannot be is a warning.
#[test]
fn gpu_kept_hierarchies() {
    let dir = tempfile::tempdir().unwrap();
    let cache = dir.path().join("kept");
    let render = |name: &str, cache: &Path| {
        let image = dir.path().join(name);
        let args = [
            "render",
            "builtin:cornell-box",
            "--tracer",
            "compute",
            "--size",
            "64x48",
            "--spp",
            "1",
            "--build",
            "best",
        ];
        let out = skylit(&args).args(["-o", path(&image), "--bvh-cache", path(cache)]).output().unwrap();
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(out.status.success(), "{said}");
        (std::fs::read(image).unwrap(), said)
    };
    let files = || std::fs::read_dir(&cache).unwrap().map(|f| f.unwrap().path()).collect::<Vec<_>>();
    let (built, _) = render("a.png", &cache);
    let [file] = &files()[..] else { panic!("{:?}", files()) };
    let whole = std::fs::read(file).unwrap();
    assert_eq!(render("b.png", &cache).0, built);
    std::fs::write(file, &whole[..whole.len() / 2]).unwrap();
    let (mended, said) = render("c.png", &cache);
    assert_eq!(mended, built);
    assert!(said.contains("damaged"), "{said}");
    assert_eq!(std::fs::read(file).unwrap(), whole);
    let (unkept, said) = render("d.png", &file.join("below-a-file"));
    assert_eq!(unkept, built);
    assert!(said.contains("not cached"), "{said}");
    let image = dir.path().join("e.png");
    let args = ["render", "builtin:cornell-box", "--size", "64x48", "--spp", "1", "--json", "--bvh-cache"];
    let record = json(&skylit(&args).args([path(&file.join("below-a-file")), "-o", path(&image)]).output().unwrap());
    assert!(record["warnings"].to_string().contains("not cached"), "{record}");
}

/// A command that has a result though it fails prints one record, with both.
#[test]
fn one_record_for_a_check_that_fails() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, grey: u8| {
        let file = dir.path().join(name);
        let picture = Picture::of_bytes(vec![grey; 16], [4, 4], Colour::Grey).unwrap();
        picture.save(&file, 90).unwrap();
        file
    };
    let (a, b) = (write("a.png", 10), write("b.png", 200));
    let args = ["diff", path(&a), path(&b), "--max-rmse", "0.1", "--json"];
    let out = run(&args);
    assert_refusal(&out, 1, "RMSE", &args);
    let record: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!((record["exit_code"].as_u64(), record["channels"].as_array().map(Vec::len)), (Some(1), Some(1)));
    assert!(record["error"].as_str().unwrap().contains("RMSE"));
    assert!(record["flip"]["mean"].as_f64().is_some_and(|v| (0.5..1.0).contains(&v)), "{record}");
    assert!(json(&run(&["diff", path(&a), path(&a), "--max-rmse", "0.1", "--json"]))["error"].is_null());
}

/// `diff` judges colour, or the channels that are named, and refuses images without any in common.
#[test]
fn diff_judges_colour() {
    use skylit::output::{Channel, Image, Samples, save};
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, height: u32, channels: &[(&str, f32)]| {
        let plane = |v: f32| Samples::F32(vec![v; 16 * height as usize]);
        let channels = channels.iter().map(|(name, v)| Channel { name: (*name).into(), samples: plane(*v) }).collect();
        let file = dir.path().join(name);
        save(&Image { width: 16, height, channels, metadata: Vec::new() }, &file).unwrap();
        path(&file).to_owned()
    };
    let short = write("short.exr", 16, &[("Y", 0.5), ("A", 1.0), ("samples", 8.0)]);
    let long = write("long.exr", 16, &[("Y", 0.51), ("A", 1.0), ("samples", 64.0)]);
    let colour = write("colour.exr", 16, &[("R", 0.5), ("G", 0.6), ("B", 0.5), ("A", 1.0)]);
    let depth = write("depth.exr", 16, &[("depth.Z", 0.5)]);
    let flat = write("flat.exr", 8, &[("Y", 0.5)]);
    // histories of different length
    assert!(run(&["diff", &short, &long, "--max-rmse", "0.05"]).status.success());
    refuses(&["diff", &short, &long, "--max-rmse", "0.001", "--quiet"], 1, "RMSE of 1.000e-2");
    refuses(&["diff", &short, &long, "--channels", "samples", "--max-rmse", "1", "--quiet"], 1, "RMSE of 5.600e1");
    // grey against colour: more than coverage in common
    refuses(&["diff", &short, &colour, "--max-rmse", "0.0001", "--quiet"], 1, "RMSE of 1.000e-1");
    refuses(&["diff", &short, &depth], 64, "no colour");
    assert!(run(&["diff", &depth, &depth, "--channels", "depth.Z", "--max-rmse", "0"]).status.success());
    refuses(&["diff", &short, &flat], 1, "16x16 and 16x8");
    let record = json(&run(&["diff", &short, &long, "--json"]));
    assert!(
        (record["compared"]["bias"].as_f64().unwrap() + 0.01).abs() < 1e-6 && record["covered_pixels_only"] == true
    );
}

/// A comparison of nothing fails, with or without a limit, in `diff` and `compare`; the mask is named.
#[test]
fn a_comparison_of_nothing_fails() {
    use skylit::output::{Channel, Image, Samples, save};
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, grey: f32, alpha: f32| {
        let plane = |name: &str, v: f32| Channel { name: name.into(), samples: Samples::F32(vec![v; 256]) };
        let channels = vec![plane("A", alpha), plane("B", grey), plane("G", grey), plane("R", 0.5 * grey)];
        let file = dir.path().join(name);
        save(&Image { width: 16, height: 16, channels, metadata: Vec::new() }, &file).unwrap();
        path(&file).to_owned()
    };
    let [sky, night, black] =
        [("sky.exr", 1.0), ("night.exr", 0.25), ("black.exr", 0.0)].map(|(n, v)| write(n, v, 0.0));
    let nan = write("nan.exr", f32::NAN, 1.0);
    refuses(&["diff", &sky, &night, "--max-rmse", "0.1", "--quiet"], 1, "RMSE of 7.500e-1");
    let record = json(&run(&["diff", &sky, &night, "--json"]));
    assert_eq!(
        (record["mask"].as_str(), record["compared"]["pixels"].as_u64()),
        (Some("covered pixels and background that is not black"), Some(256))
    );
    let text = String::from_utf8(run(&["diff", &sky, &night]).stdout).unwrap();
    assert!(text.contains("over covered pixels and background that is not black"), "{text}");
    for limit in [&["--max-rmse", "10"][..], &[]] {
        refuses(
            &[&["diff", &black, &black, "--quiet"], limit].concat(),
            1,
            "have no pixel of the mask (covered pixels)",
        );
        refuses(&[&["diff", &nan, &nan, "--quiet"], limit].concat(), 1, "256 pixels are not a number (NaN) in both");
        refuses(&[&["diff", &nan, &sky, "--quiet"], limit].concat(), 1, "not a number (NaN) in one of them only");
    }
    assert!(run(&["diff", &black, &black, "--all-pixels"]).status.success());
    refuses(&["compare", &black, &black, "--quiet"], 1, "A and B: nothing was compared");
    refuses(&["compare", &sky, &nan, &sky, "--reference", "a", "--quiet"], 1, "B and A: the images differ: 256 pixels");
}

/// What people are warned of is in the record for programs.
#[test]
fn warnings_are_in_the_record() {
    let dir = tempfile::tempdir().unwrap();
    for (name, format) in [("a.bin", "MESH.bin"), ("a.glb", "glTF")] {
        let file = dir.path().join(name);
        let args = ["export", "builtin:spheres:10", path(&file)];
        let record = json(&run(&[&args[..], &["--json"]].concat()));
        let warning = record["warnings"][0].as_str().unwrap();
        assert!(
            warning.starts_with("10 spheres become ") && warning.ends_with(&format!("{format} has no spheres")),
            "{warning}"
        );
        assert!(record["triangles_written"].as_u64() > record["triangles"].as_u64(), "{record}");
        let said = String::from_utf8(run(&args).stderr).unwrap();
        assert_eq!(said, format!("skylit: warning: {warning}\n"));
    }
}

/// What is left out of an export leaves nothing behind, and is not counted.
#[test]
fn objects_that_are_left_out_are_not_exported() {
    let dir = tempfile::tempdir().unwrap();
    let (all, part) = (dir.path().join("all.glb"), dir.path().join("part.glb"));
    let whole = json(&run(&["export", "scenes/courtyard.gltf", path(&all), "--json"]));
    let beam = json(&run(&["export", "scenes/courtyard.gltf", path(&part), "--only", "beam left", "--json"]));
    let count = |record: &Value, key: &str| record[key].as_u64().unwrap();
    assert_eq!(count(&beam, "triangles"), count(&beam, "triangles_written"));
    assert!(count(&whole, "triangles") > 5 * count(&beam, "triangles"), "{whole} {beam}");
    let size = |file: &std::path::Path| std::fs::metadata(file).unwrap().len();
    assert!(size(&all) > 2 * size(&part), "{} {}", size(&all), size(&part));
}

/// An edit that the image does not show is said to have no effect.
#[test]
fn gpu_edits_that_are_not_shown() {
    if !run(&["doctor"]).status.success() {
        assert!(std::env::var_os("SKYLIT_EXPECT_TRACERS").is_none(), "no usable Vulkan device");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let image = dir.path().join("a.exr");
    let args = ["render", "scenes/courtyard.gltf", "-o", path(&image), "--size", "16x9", "--spp", "1", "--json"];
    let warned = |more: &[&str]| {
        let record = json(&run(&[&args[..], &["--material", "plaster roughness=0.1"], more].concat()));
        record["warnings"].to_string().contains("--material changes nothing that --integrator ao shows")
    };
    assert!(warned(&[]) && !warned(&["--integrator", "albedo"]) && !warned(&["--aov", "albedo"]));
}

/// What pictures of frames show, and what is beside it in .exr files.
#[test]
fn gpu_frames_as_pictures() {
    if !run(&["doctor"]).status.success() {
        assert!(std::env::var_os("SKYLIT_EXPECT_TRACERS").is_none(), "no usable Vulkan device");
        println!("skipped: no usable Vulkan device");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| path(&dir.path().join(name)).to_owned();
    let base = [
        "render",
        "builtin:stairs",
        "--size",
        "64x48",
        "--preset",
        "fast",
        "--frames",
        "2..4",
        "--validation",
        "--json",
    ];
    let (exr, png, apng) = (at("a.##.exr"), at("a.##.png"), at("a.apng"));
    let record = json(&run(&[&base[..], &["--aov", "bent", "-o", &exr, "-o", &png, "-o", &apng]].concat()));
    assert!(record["passes"]["display"].is_object() && record["mean"].as_f64().unwrap() > 0.1);
    for frame in ["02", "03"] {
        let numbers = skylit::output::load(at(&format!("a.{frame}.exr")).as_ref()).unwrap();
        assert!(["Y", "A", "samples", "bent.X", "bent.Y", "bent.Z"].iter().all(|name| numbers.f32(name).is_some()));
        assert!(numbers.f32("depth.Z").is_none());
        // the same picture as from the numbers
        let again = at("again.png");
        skylit::output::save(&numbers, again.as_ref()).unwrap();
        assert_eq!(std::fs::read(again).unwrap(), std::fs::read(at(&format!("a.{frame}.png"))).unwrap());
    }
    json(&run(&[&base[..], &["--show", "normal", "-o", &png, "-o", &apng]].concat()));
    let picture = skylit::output::load(at("a.03.png").as_ref()).unwrap();
    assert!(["R", "G", "B"].iter().all(|name| picture.f32(name).is_some()));
    // numbers alone: nothing is shown
    let record = json(&run(&[&base[..], &["-o", &exr]].concat()));
    assert!(record["passes"]["display"].is_null());
}

/// From a scene to files and back to numbers, on whatever device there is.
#[test]
fn gpu_render_end_to_end() {
    if !run(&["doctor"]).status.success() {
        assert!(std::env::var_os("SKYLIT_EXPECT_TRACERS").is_none(), "no usable Vulkan device");
        println!("skipped: no usable Vulkan device");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| path(&dir.path().join(name)).to_owned();
    let (exr, png, depth, rays) = (at("a.exr"), at("a.png"), at("d.png"), at("r"));
    let base = ["render", "builtin:cornell-box", "--size", "64x48", "--spp", "4", "--validation", "-o"];
    let extra = ["--aov", "all", "--depth-image", &depth, "--dump-rays", &rays, "--explain", "--json"];
    let record = json(&run(&[&base[..], &[&exr], &extra].concat()));
    assert_eq!((record["spp"].as_u64(), record["width"].as_u64()), (Some(4), Some(64)));
    assert!(record["explain"].as_array().is_some_and(|a| !a.is_empty()));
    let mean = record["mean"].as_f64().unwrap();
    assert!(mean > 0.0 && mean < 1.0);

    // the file says the same
    let image = skylit::output::load(exr.as_ref()).unwrap();
    let y = image.f32("Y").unwrap();
    assert!((y.iter().map(|&v| f64::from(v)).sum::<f64>() / y.len() as f64 - mean).abs() < 1e-6);
    for name in ["A", "variance", "depth.Z", "position.Y", "Ng.Z", "Ns.X", "albedo.G"] {
        assert!(image.f32(name).is_some(), "{name}");
    }
    for key in ["scene", "camera", "spp", "tracer", "device", "version"] {
        assert!(image.metadata(key).is_some(), "{key}");
    }

    // the same command gives the same bytes
    json(&run(&[&base[..], &[&at("b.exr")], &["--aov", "all", "--json"]].concat()));
    assert_eq!(std::fs::read(&exr).unwrap(), std::fs::read(at("b.exr")).unwrap());

    // PNG, and the difference between the two is what 8 bits lose
    let quiet = run(&[&base[..], &[&png], &["--quiet"]].concat());
    assert!(quiet.status.success() && quiet.stdout.is_empty());
    let difference = json(&run(&["diff", &png, &exr, "--json"]));
    let channel = &difference["channels"][0];
    assert!(channel["max"].as_f64().unwrap() < 0.005, "{channel}");
    refuses(&["diff", &png, &exr, "--max-rmse", "0", "--quiet"], 1, "RMSE");

    // the rays that were dumped, traced again
    let mesh = at("mesh.bin");
    assert!(run(&["export", "builtin:cornell-box", &mesh]).status.success());
    let traced = json(&run(&[
        "rays",
        "--mesh",
        &mesh,
        "--rays",
        &format!("{rays}.primary.bin"),
        "--hits",
        &at("h.bin"),
        "--repeats",
        "1",
        "--json",
    ]));
    assert_eq!(traced["rays"].as_u64(), Some(64 * 48));
    assert_eq!(std::fs::metadata(at("h.bin")).unwrap().len(), 64 * 48 * 20);
    // each hit of a camera ray started one occlusion ray
    let occlusion = std::fs::metadata(format!("{rays}.ao.bin")).unwrap().len() / 32;
    assert_eq!(traced["hits"].as_u64(), Some(occlusion));

    // every traversal gives the same image, and the record says which it was
    for traversal in ["auto", "wide", "packet", "nearest", "direction", "brute"] {
        let again = at("t.exr");
        let record = json(&run(&[&base[..], &[&again], &["--traversal", traversal, "--explain", "--json"]].concat()));
        assert_eq!((record["tracer"].as_str(), record["traversal"].as_str()), (Some("compute"), Some(traversal)));
        assert_eq!(record["triangle_test"], "watertight");
        let told = record["explain"].as_array().unwrap().iter().any(|l| l.as_str().unwrap().contains(traversal));
        assert!(told, "{}", record["explain"]);
        assert!(
            (record["mean"].as_f64().unwrap() - mean).abs() < 1e-4,
            "{traversal}: {} is not {mean}",
            record["mean"]
        );
    }
    // and so does a hierarchy that the device built
    let terrain = |build: &str| {
        let again = at("b.exr");
        let args = ["render", "builtin:terrain:20000", "--size", "32x24", "--spp", "1", "-o", &again];
        json(&run(&[&args[..], &["--tracer", "compute", "--build", build, "--explain", "--json"]].concat()))
    };
    let records = ["fast", "device"].map(terrain);
    assert_eq!(records[0]["mean"], records[1]["mean"]);
    let trees = records.each_ref().map(|r| r["build"]["on_device"]["trees"].as_u64());
    assert_eq!(trees, [Some(0), Some(1)]);
    assert!(records[1]["explain"].to_string().contains("BVHs built on the device: 1"), "{}", records[1]["explain"]);
    refuses(&["bvh", "builtin:plane", "--build", "device"], 64, "--build device makes wide nodes");
    let other = ["--tracer", "pipeline", "--traversal", "nearest"];
    refuses(&[&base[..], &[&png], &other].concat(), 64, "--tracer compute");
    let many = ["render", "builtin:spheres:50000", "--size", "8x8", "--traversal", "brute", "-o", &png];
    refuses(&many, 3, "use another --traversal");

    let missing = ["--camera", "nobody"];
    refuses(&[&base[..], &[&png], &missing].concat(), 64, "no such camera");
    refuses(&[&base[..], &[&png], &["--device", "no such device"]].concat(), 2, "no such device");
    refuses(&["render", "builtin:no-such-scene", "-o", &png], 64, "no-such-scene");
}

/// A time limit writes what there is; Ctrl-C does only when asked.
#[cfg(unix)]
#[test]
fn gpu_stopping_early() {
    if !run(&["doctor"]).status.success() {
        println!("skipped: no usable Vulkan device");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("a.exr");
    let base = ["render", "builtin:stairs", "--size", "320x200", "--spp", "100000", "-o", path(&out)];
    let record = json(&run(&[&base[..], &["--time-limit", "0.5", "--json"]].concat()));
    assert_eq!(record["stopped_early"], true);
    assert!(out.exists());
    std::fs::remove_file(&out).unwrap();
    for keep in [false, true] {
        let kept = ["--keep-partial", "--intervals", "--json"];
        let args = if keep { [&base[..], &kept].concat() } else { base.to_vec() };
        let cache = tempfile::tempdir().unwrap();
        let mut command = skylit(&args);
        command.args(["--build", "best", "--bvh-cache", path(cache.path())]);
        let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let start = std::time::Instant::now();

        // a partial image needs a sample, after which there is an intermediate image; without one,
        // the end of building is waited for
        let has_file = |folder: &Path| {
            std::fs::read_dir(folder).unwrap().any(|f| f.unwrap().path().extension().is_some_and(|e| e != "tmp"))
        };
        while !has_file(if keep { dir.path() } else { cache.path() }) {
            assert!(start.elapsed().as_secs() < 120, "rendering has not begun");
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
        let done = child.wait_with_output().unwrap();
        assert_eq!(done.status.code(), Some(130), "{}", String::from_utf8_lossy(&done.stderr));
        assert!(String::from_utf8_lossy(&done.stderr).contains("skylit: error: interrupted"));
        assert_eq!(out.exists(), keep);
        if keep {
            let record: Value = serde_json::from_slice(&done.stdout).unwrap();
            assert_eq!((record["exit_code"].as_u64(), record["error"].as_str()), (Some(130), Some("interrupted")));
            assert!(record["spp"].as_u64() > Some(0));
        } else {
            assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
        }
    }
}
