//! `skylit render` where it makes frames.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;
use skylit::output;

use crate::common::command::{self, count, place, refuses, run, skylit};

fn json(args: &[&str]) -> Value {
    command::json(&run(args))
}

#[test]
fn gpu_one_frame_as_png_and_as_exr() {
    let dir = tempfile::tempdir().unwrap();
    let (png, exr) = (place(&dir, "x.png"), place(&dir, "x.exr"));
    let base =
        ["render", "builtin:stairs", "--preset", "fast", "--size", "64x36", "--antialias", "off", "--validation"];
    let record = json(&[&base[..], &["-o", &png, "-o", &exr, "--json"]].concat());
    assert_eq!((record["preset"].as_str(), record["settings"]["history"].as_u64()), (Some("fast"), Some(32)));
    // it is settled: as many frames as its history counts, the last one kept, and one with camera rays
    let frames = record["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 32);
    assert_eq!(frames.iter().filter(|f| f["kept"] == true).count(), 1);
    assert_eq!(frames[31]["primary_rays"], 0);
    let (a, b) = (output::load(png.as_ref()).unwrap(), output::load(exr.as_ref()).unwrap());
    assert_eq!(([a.width, a.height], [b.width, b.height]), ([64, 36], [64, 36]));
    let y = b.f32("Y").unwrap();
    assert_eq!(b.f32("samples").unwrap(), b.f32("A").unwrap().iter().map(|c| 32.0 * c).collect::<Vec<_>>());
    let mean = |of: &dyn Fn(usize) -> bool| {
        let own: Vec<f64> = (0..y.len()).filter(|&i| of(i)).map(|i| f64::from(y[i])).collect();
        own.iter().sum::<f64>() / own.len() as f64
    };
    let covered = b.f32("A").unwrap();
    let said = record["mean"].as_f64().unwrap();
    assert!((mean(&|i| covered[i] > 0.0) - said).abs() < 1e-6 && said > 0.3 && said < 1.0, "{said}");
    let difference = json(&["diff", &png, &exr, "--json"]);
    // what eight bits lose
    assert!(difference["channels"][0]["max"].as_f64().unwrap() < 0.005, "{difference}");
    assert_eq!(count(dir.path()), 2);
}

#[test]
fn gpu_frames_by_number_tell_what_they_are() {
    let dir = tempfile::tempdir().unwrap();
    let pattern = place(&dir, "x.####.exr");
    let base = [
        "render",
        "builtin:parade",
        "--animate",
        "--preset",
        "balanced",
        "--size",
        "48x27",
        "--seed",
        "3",
        "--ao-radius",
        "2.5",
    ];
    let record = json(&[&base[..], &["--frames", "0..3", "-o", &pattern, "--json"]].concat());
    assert_eq!(record["frames"].as_array().map(Vec::len), Some(3));
    let names: std::collections::BTreeSet<_> =
        std::fs::read_dir(dir.path()).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
    assert_eq!(names, ["x.0000.exr", "x.0001.exr", "x.0002.exr"].map(str::to_owned).into());
    let mut images = Vec::new();
    for frame in 0..3 {
        let image = output::load(place(&dir, &format!("x.{frame:04}.exr")).as_ref()).unwrap();
        for (key, value) in [
            ("frame", frame.to_string().as_str()),
            ("preset", "balanced"),
            ("technique", "traced"),
            ("seed", "3"),
            ("ao.radius", "2.5"),
            ("history", "64"),
            ("rays_per_pixel", "1"),
            ("resolution", "full"),
            ("sequence", "sobol"),
            ("scene", "builtin:parade"),
            ("integrator", "ao"),
        ] {
            assert_eq!(image.metadata(key), Some(value), "frame {frame}: {key}");
        }
        images.push(image.f32("Y").unwrap().to_vec());
        let most = image.f32("samples").unwrap().iter().copied().fold(0.0, f32::max);
        assert_eq!(most, (frame + 1) as f32, "histories grow from frame to frame");
    }
    assert!(images[0] != images[1] && images[1] != images[2]);
    // the same command, the same bytes
    let again = place(&dir, "y.####.exr");
    json(&[&base[..], &["--frames", "0..3", "-o", &again, "--json"]].concat());
    for frame in 0..3 {
        let read = |name: &str| std::fs::read(place(&dir, &format!("{name}.{frame:04}.exr"))).unwrap();
        assert_eq!(read("x"), read("y"), "frame {frame}");
    }
}

#[test]
fn gpu_an_animation_in_one_file() {
    let dir = tempfile::tempdir().unwrap();
    let (apng, file) = (place(&dir, "x.apng"), place(&dir, "x.##.png"));
    let base = [
        "render",
        "builtin:stairs",
        "--preset",
        "fast",
        "--orbit",
        "8",
        "--size",
        "32x18",
        "--frames",
        "2..6",
        "--fps",
        "10",
    ];
    json(&[&base[..], &["-o", &apng, "-o", &file, "--json"]].concat());
    assert_eq!(count(dir.path()), 5);
    let mut reader =
        png::Decoder::new(std::io::BufReader::new(std::fs::File::open(&apng).unwrap())).read_info().unwrap();
    assert_eq!(reader.info().animation_control.unwrap().num_frames, 4);
    let mut frames: Vec<Vec<u8>> = Vec::new();
    for frame in 2..6 {
        let mut shown = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut shown).unwrap();
        let control = reader.info().frame_control.unwrap();
        assert_eq!(control.delay_den / control.delay_num, 10);
        let still = std::fs::File::open(place(&dir, &format!("x.{frame:02}.png"))).unwrap();
        let mut still = png::Decoder::new(std::io::BufReader::new(still)).read_info().unwrap();
        let mut own = vec![0; still.output_buffer_size().unwrap()];
        still.next_frame(&mut own).unwrap();
        assert_eq!(own, shown, "frame {frame}");
        frames.push(shown);
    }
    assert!(frames.windows(2).all(|pair| pair[0] != pair[1]));
    // the camera turns by an eighth, which is more than noise
    let moved = frames[0].iter().zip(&frames[1]).filter(|(a, b)| a.abs_diff(**b) > 60).count();
    assert!(moved > 100, "{moved} of {} pixels show something else", frames[0].len());
}

#[test]
fn what_does_not_go_together_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let (png, exr, apng, pattern) =
        (place(&dir, "x.png"), place(&dir, "x.exr"), place(&dir, "x.apng"), place(&dir, "x.##.apng"));
    let render = |extra: &[&str]| {
        [&["render", "builtin:stairs"], extra].concat().iter().map(|s| (*s).to_owned()).collect::<Vec<_>>()
    };
    for (extra, says) in [
        (&["--preset", "fast", "--frames", "0..3", "-o", &exr][..], "a # for each digit"),
        (&["--preset", "fast", "--frames", "0..3", "-o", &pattern], "leave out the #"),
        (&["--preset", "fast", "--frames", "3..3", "-o", &apng], "no frames"),
        (&["--preset", "fast", "--frames", "x", "-o", &apng], "A..B"),
        (&["--preset", "slow", "-o", &png], "balanced"),
        (&["--preset", "fast", "--fps", "0", "-o", &png], "frames per second"),
        (&["--preset", "fast", "--rays-per-pixel", "0", "-o", &png], "--rays-per-pixel"),
        (&["--preset", "fast", "--rays-per-pixel", "5000", "-o", &png], "--rays-per-pixel"),
        (&["--preset", "fast", "--history", "0", "-o", &png], "--history"),
        (&["--preset", "fast", "--filter-radius", "17", "-o", &png], "--filter-radius"),
        (&["--preset", "fast", "--ao-radius", "0", "-o", &png], "above 0"),
        (&["--preset", "fast", "--ao-falloff", "0.5", "-o", &png], "at least 1"),
        (&["--preset", "fast", "--technique", "larsen", "-o", &png], "--preset larsen"),
        (&["--preset", "larsen", "--technique", "gtao", "-o", &png], "--technique"),
        (&["--preset", "larsen", "--history", "4", "-o", &png], "--history"),
        (&["--preset", "larsen", "--rays-per-pixel", "4", "-o", &png], "--rays-per-pixel"),
        (&["--preset", "fast", "--spp", "4", "-o", &png], "--spp"),
        (&["--preset", "fast", "--orbit", "--camera-path", "keys.toml", "-o", &png], "--camera-path"),
        (&["--preset", "fast", "-o", "x.bmp"], ".exr"),
    ] {
        let args = render(extra);
        refuses(&args.iter().map(String::as_str).collect::<Vec<_>>(), 64, says);
    }
    assert_eq!(count(dir.path()), 0);
}

/// What is found only after the scene has been read.
#[test]
fn gpu_runs_that_fail_leave_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let apng = place(&dir, "x.apng");
    for (extra, says) in [
        (&["builtin:stairs", "--animate"][..], "no such animation"),
        (&["builtin:parade", "--animate", "fly"], "it has 0 'parade', 1 'bend'"),
        (&["builtin:parade", "--camera", "nobody"], "no such camera"),
        (&["builtin:parade", "--rays-per-pixel", "4096", "--size", "4096x4096"], "2^32 rays"),
    ] {
        refuses(&[&["render"], extra, &["--preset", "fast", "--frames", "0..3", "-o", &apng]].concat(), 64, says);
    }
    assert_eq!(count(dir.path()), 0);
}

#[cfg(unix)]
#[test]
fn gpu_what_is_broken_off_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let apng = place(&dir, "x.apng");
    let args =
        ["render", "builtin:stairs", "--preset", "fast", "--frames", "0..1000000", "--size", "64x36", "-o", &apng];
    let mut child = skylit(&args)
        .env("SKYLIT_PROGRESS_SECONDS", "0.1")
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    // frames are being made: the file was begun, and has another name, or none, until it is whole
    assert!(lines.any(|l| l.starts_with("skylit: rendering: ")), "nothing was begun");
    assert!(!Path::new(&apng).exists());
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let stderr = lines.collect::<Vec<_>>().join("\n");
    assert_eq!(child.wait().unwrap().code(), Some(130), "{stderr}");
    assert!(stderr.contains("skylit: error: interrupted"), "{stderr}");
    assert_eq!(count(dir.path()), 0, "{:?}", std::fs::read_dir(dir.path()).unwrap().collect::<Vec<_>>());
}
