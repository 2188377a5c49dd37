//! Frames of light in real time, and stills of a time line, from the command line.

use crate::common::command::{count, device, fails, json, place, refuses, run, skylit, stderr};

#[test]
fn gpu_frames_of_light_have_colours() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| place(&dir, name);
    let (exr, apng) = (at("a.##.exr"), at("a.apng"));
    let base =
        ["render", "builtin:cornell-box", "--integrator", "path", "--size", "64x48", "--frames", "0..2", "--json"];
    let extra = ["--preset", "fast", "--tone-map", "agx", "--validation", "--no-config", "-o", &exr, "-o", &apng];
    let record = json(&run(&[&base[..], &extra].concat()));
    assert_eq!(record["integrator"], "path");
    assert!(record["passes"]["antialias"].is_object() && record["mean"].as_f64().unwrap() > 0.01, "{record}");
    let image = skylit::output::load(at("a.01.exr").as_ref()).unwrap();
    assert!(["R", "G", "B", "A", "samples"].iter().all(|name| image.f32(name).is_some()) && image.f32("Y").is_none());
    let of = |key: &str| image.metadata.iter().find(|(k, _)| k == key).map(|(_, v)| v.as_str());
    assert_eq!([of("integrator"), of("pixel_filter"), of("max_depth")], [Some("path"), Some("box"), Some("unlimited")]);
    // one red wall and one green one
    let [red, green] = ["R", "G"].map(|c| image.f32(c).unwrap().iter().sum::<f32>());
    assert!(red > 0.0 && green > 0.0 && red != green);
}

#[test]
fn gpu_stills_of_a_time_line_go_on_after_an_end() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| place(&dir, name);
    let (exr, png) = (at("a.#.exr"), at("a.#.png"));
    let base =
        ["render", "builtin:parade", "--integrator", "direct", "--size", "48x27", "--frames", "3..6", "--animate"];
    let extra = ["--fps", "10", "--spp", "2", "--json", "--no-config", "-o", &exr, "-o", &png];
    let args = [&base[..], &extra].concat();
    let numbers = |record: &serde_json::Value| -> Vec<u64> {
        record["stills"].as_array().unwrap().iter().map(|s| s["frame"].as_u64().unwrap()).collect()
    };
    assert_eq!(numbers(&json(&run(&args))), [3, 4, 5]);
    let bytes = |k: u32| std::fs::read(at(&format!("a.{k}.exr"))).unwrap();
    let first = [3, 4, 5].map(bytes);
    assert!(first[0] != first[1] && first[1] != first[2], "nothing moves");
    std::fs::remove_file(at("a.4.png")).unwrap();
    let record = json(&run(&[&args[..], &["--continue"]].concat()));
    assert_eq!((numbers(&record), record["finished_before"].as_u64()), (vec![4], Some(2)));
    assert!([3, 4, 5].map(bytes) == first, "the frame that was rendered again differs");
    // other settings make other frames
    let record = json(&run(&[&args[..], &["--continue", "--seed", "1"]].concat()));
    assert_eq!(numbers(&record), [3, 4, 5]);
}

#[test]
fn frames_that_cannot_be_are_refused() {
    let base = ["render", "builtin:parade", "-o", "a.#.png", "--frames", "0..2"];
    let refused = |args: &[&str], says: &str| refuses(&[&base[..], args].concat(), 64, says);
    refused(&["--integrator", "normals"], "--integrator normals has no frames in real time: add --spp N");
    refused(&["--integrator", "path", "--technique", "gtao"], "--technique gtao is for ambient occlusion");
    refused(&["--integrator", "path", "--preset", "larsen"], "--preset larsen is for ambient occlusion");
    refused(&["--integrator", "path", "--show", "rays"], "--show rays is for ambient occlusion");
    refused(&["--continue"], "--continue is for stills of several frames");
    refused(&["--spp", "2", "-o", "a.apng"], "stills need numbered files");
    refused(&["--spp", "2", "--resumable"], "--resumable");
}

/// Videos are encoded by ffmpeg: what it is given, what it says, and that it may be missing.
#[cfg(unix)]
#[test]
fn gpu_videos_are_encoded_by_ffmpeg() {
    use std::os::unix::fs::PermissionsExt;

    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let tools = dir.path().join("tools");
    std::fs::create_dir(&tools).unwrap();
    let ffmpeg = tools.join("ffmpeg");
    let is = |script: &str| {
        std::fs::write(&ffmpeg, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&ffmpeg, std::fs::Permissions::from_mode(0o755)).unwrap();
    };
    let render = |output: &str, path: &str, options: &[&str]| {
        let fixed =
            ["render", "builtin:stairs", "--preset", "fast", "--size", "31x20", "--frames", "0..3", "-o", output];
        skylit(&[&fixed, options].concat()).env("PATH", path).output().unwrap()
    };
    let path = format!("{}:/usr/bin:/bin", tools.display());
    let [mp4, webm, gif] = ["a.mp4", "a.webm", "a.gif"].map(|n| place(&dir, n));

    // its output is the file: here what it was told, and the bytes that it got
    is("echo $@; wc -c");
    for (output, options, expected, bytes) in [
        (&mp4, &["--fps", "12.5"][..], "gray -video_size 31x20 -framerate 12.5", 3 * 31 * 20),
        (&webm, &["--background", "transparent"], "ya8 -video_size 31x20 -framerate 30", 3 * 31 * 20 * 2),
        (&gif, &["--background", "1,0,0"], "rgb24", 3 * 31 * 20 * 3),
    ] {
        let out = render(output, &path, options);
        assert!(out.status.success(), "{}", stderr(&out));
        let text = std::fs::read_to_string(output).unwrap();
        assert!(text.contains(expected) && text.trim_end().ends_with(&format!("\n{bytes}")), "{text}");
    }
    assert!(std::fs::read_to_string(&webm).unwrap().contains("yuva420p"));

    // what it says is passed on, and what was there before stays
    let before = std::fs::read(&mp4).unwrap();
    for script in
        ["echo \"Unknown encoder 'libx264'\" >&2; exit 1", "cat > /dev/null; echo 'Unknown encoder' >&2; exit 1"]
    {
        is(script);
        fails(&render(&mp4, &path, &[]), 4, &["a.mp4", "ffmpeg: Unknown encoder"]);
        assert_eq!(std::fs::read(&mp4).unwrap(), before);
    }
    std::fs::remove_file(&ffmpeg).unwrap();
    let missing = place(&dir, "b.mp4");
    fails(&render(&missing, &tools.to_string_lossy(), &[]), 4, &["b.mp4", "ffmpeg", "not installed"]);
    fails(&render(&missing, &path, &["--background", "transparent"]), 64, &["b.mp4", "cannot have alpha", ".webm"]);
    assert!(!std::fs::exists(&missing).unwrap());
    // two files in all beside the one folder
    assert_eq!(count(dir.path()), 4);
}
