//! A machine that does not do as it should: files that cannot be named in Unicode, disks that are full or read-only, memory that runs out, devices that are lost, signals, other
//! processes, clocks. Each ends with one line and its exit code, with nothing half-written and no temporary file left (docs/reference/exit-codes.md).

use std::ffi::OsString;
use std::io::Read;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant, SystemTime};

use skylit::output::{self, Channel, Image, Samples};

use crate::common::command::{assert_refusal, count, device, fails, json, place, run, skylit, stderr};
use crate::common::is_full;

/// A still of a built-in scene that takes a moment: 16 samples in three parts.
const STILL: [&str; 6] = ["render", "builtin:cornell-box", "--size", "64x48", "--spp", "16"];

/// Names of the files in a folder, sorted.
fn names(folder: &Path) -> Vec<OsString> {
    let mut names: Vec<_> = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().file_name()).collect();
    names.sort();
    names
}

/// It failed with this code; its last line is its error and says this.
fn ends(out: &Output, code: i32, says: &str) {
    fails(out, code, &[says]);
}

#[test]
fn gpu_names_that_are_not_unicode() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    // a folder, too, with defaults in it
    let folder = dir.path().join(OsString::from_vec(b"folder \xff".to_vec()));
    std::fs::create_dir_all(folder.join("skylit")).unwrap();
    std::fs::write(folder.join("skylit/skylit.toml"), "[image]\nsize = [24, 16]\n").unwrap();
    let at = |name: &[u8]| folder.join(OsString::from_vec(name.to_vec()));
    let render = |options: &[&str], output: &Path| {
        let mut command = skylit(&["render", "builtin:cornell-box", "--json"]);
        command.args(options).arg("-o").arg(output).current_dir(&folder).env("XDG_CONFIG_HOME", &folder);
        command
    };
    let [exr, png, frames] = [&b"\xe4.exr"[..], b"\xe4.png", b"\xe4.##.png"].map(at);
    let mut still = render(&["--spp", "2", "--resumable"], &exr);
    let mut depth = OsString::from("--depth-image=");
    depth.push(at(b"depth\xff.exr"));
    let mut rays = OsString::from("--dump-rays=");
    rays.push(at(b"rays\xff"));
    let record = json(&still.arg("-o").arg(&png).args([depth, rays]).output().unwrap());
    assert!(record["output"][0].as_str().unwrap().ends_with("\u{fffd}.exr"), "{record}");
    assert!(record["defaults"].to_string().contains("skylit.toml"), "{record}");
    // numbers are put into names of frames, which have to be Unicode for it
    for options in [["--preset", "fast"], ["--spp", "2"]] {
        let out = render(&[&options[..], &["--frames", "0..2"]].concat(), &frames).output().unwrap();
        ends(&out, 64, "a name with a frame number (#) must be Unicode; rename it");
    }
    let mut resume = OsString::from("--resume=");
    resume.push(&exr);
    json(&render(&["--spp", "4"], &exr).arg(resume).output().unwrap());
    let difference = at(b"difference\xff.png");
    let mut compare = skylit(&["compare", "--json"]);
    let record = json(&compare.args([&exr, &png]).arg("--difference").arg(&difference).output().unwrap());
    assert!(record["pictures"].to_string().contains('\u{fffd}') && difference.exists(), "{record}");
    assert!(at(b"rays\xff.primary.bin").exists());
    // scenes and names of formats are text: one line says so
    for argument in [&b"sc\xffene.glb"[..], b"\xff"] {
        let out =
            skylit(&["render"]).arg(OsString::from_vec(argument.to_vec())).args(["-o", "a.png"]).output().unwrap();
        assert_refusal(&out, 64, "UTF-8", &["render"]);
    }
}

/// The file that [`STILL`] writes.
fn reference(dir: &Path) -> Vec<u8> {
    let exr = dir.join("reference.exr");
    json(&run(&[&STILL[..], &["--resumable", "--json", "-o", exr.to_str().unwrap()]].concat()));
    let bytes = std::fs::read(&exr).unwrap();
    std::fs::remove_file(exr).unwrap();
    bytes
}

#[test]
fn gpu_a_device_that_is_lost() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let whole = reference(dir.path());
    let (exr, png) = (place(&dir, "a.exr"), place(&dir, "a.png"));
    std::fs::write(&png, "an older image").unwrap();
    let args = [&STILL[..], &["--resumable", "--intervals", "-o", &exr, "-o", &png]].concat();
    let (mut lost, mut resumed) = (0, 0);
    for submission in 1..200 {
        let out = skylit(&args).env("SKYLIT_FAULT_DEVICE_LOST", submission.to_string()).output().unwrap();
        if out.status.success() {
            break;
        }
        ends(&out, 6, "the Vulkan device was lost");
        lost += 1;
        assert_eq!(std::fs::read(&png).unwrap(), b"an older image");
        // intermediate images are whole, and the render goes on from the last of them
        let files = names(dir.path());
        assert!(files.iter().all(|f| f.to_str().unwrap().starts_with("a.")) && !Path::new(&exr).exists(), "{files:?}");
        let last = files.iter().rfind(|f| f.to_str().unwrap().ends_with(".exr"));
        if let Some(last) = last.map(|f| dir.path().join(f)).filter(|_| resumed < 3) {
            json(&run(&[&STILL[..], &["--json", "-o", &exr, "--resume", last.to_str().unwrap()]].concat()));
            assert_eq!(std::fs::read(&exr).unwrap(), whole);
            resumed += 1;
        }
        for file in files.iter().filter(|f| *f != "a.png") {
            std::fs::remove_file(dir.path().join(file)).unwrap();
        }
        let _ = std::fs::remove_file(&exr);
    }
    assert!((4..199).contains(&lost) && resumed > 0, "{lost} {resumed}");
    assert_eq!(std::fs::read(&exr).unwrap(), whole);
}

#[test]
fn gpu_frames_of_a_device_that_is_lost() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let (png, apng) = (place(&dir, "a.##.png"), place(&dir, "a.apng"));
    let args = ["render", "builtin:stairs", "--size", "48x32", "--preset", "fast", "--frames", "0..12", "--orbit"];
    let all = run(&[&args[..], &["-o", &png]].concat());
    assert!(all.status.success() && count(dir.path()) == 12, "{}", stderr(&all));
    let before: Vec<_> = names(dir.path()).iter().map(|f| std::fs::read(dir.path().join(f)).unwrap()).collect();
    names(dir.path()).iter().for_each(|f| std::fs::remove_file(dir.path().join(f)).unwrap());
    let lose = |submission: u32| {
        let out = skylit(&args)
            .args(["-o", &png, "-o", &apng])
            .env("SKYLIT_FAULT_DEVICE_LOST", submission.to_string())
            .output();
        out.unwrap()
    };
    // the submission that ends somewhere in the middle
    let middle = (10..400).step_by(5).find(|&n| {
        let out = lose(n);
        ends(&out, 6, "the Vulkan device was lost");
        (3..11).contains(&count(dir.path()))
    });
    assert!(middle.is_some(), "{} frames", count(dir.path()));
    // those that are there are whole; an animation that is not has no file
    for (name, frame) in names(dir.path()).iter().zip(&before) {
        assert_eq!(&std::fs::read(dir.path().join(name)).unwrap(), frame, "{name:?}");
    }
    assert!(!Path::new(&apng).exists());
}

/// The viewer opens the device again, and everything is as it was.
#[cfg(feature = "viewer")]
#[test]
fn gpu_the_viewer_goes_on_after_a_device_was_lost() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| place(&dir, name);
    let save = |name: &str| {
        format!("key Ctrl+S\nwait text:Save the image\nkey Ctrl+A\ntype {}\nkey Enter\nwait text:saved\n", at(name))
    };
    let view = |script: &str, fault: &str| {
        std::fs::write(at("script"), script).unwrap();
        let args = ["view", "builtin:stairs", "--size", "520x400", "--headless-script", &at("script")];
        skylit(&args).env("SKYLIT_FAULT_DEVICE_LOST", fault).output().unwrap()
    };
    // the device is lost once there is the screenshot
    let script = format!(
        "wait picture\ndrag 300 200 380 240 0.5\nclick Radius\nset Radius = 0.6\nwait samples 8 400\n{}screenshot {}\nset Radius = 0.5\n\
         set Radius = 0.6\nwait text:started again\nwait samples 8 400\n{}",
        save("kept.exr"),
        at("lost.png"),
        save("lost.exr")
    );
    let out = view(&script, &at("lost.png"));
    assert!(out.status.success(), "{}", stderr(&out));
    let [kept, lost] = ["kept.exr", "lost.exr"].map(|name| skylit::output::load(at(name).as_ref()).unwrap());
    for key in ["command", "camera_pose", "scene"] {
        assert!(
            kept.metadata(key).is_some() && kept.metadata(key) == lost.metadata(key),
            "{key}: {:?}",
            lost.metadata(key)
        );
    }
    assert!(lost.metadata("command").unwrap().contains("--ao-radius 0.6"), "{:?}", lost.metadata("command"));
    // one that is lost again and again is no endless loop
    let out =
        view("wait text:was lost\nwait text:failed; the driver has reset it or crashed\nexpect-no-errors\n", "1+");
    ends(&out, 1, "lost");
}

/// A window that moves to a display of another scale shows the same, with as many more pixels.
#[cfg(feature = "viewer")]
#[test]
fn gpu_a_display_with_another_scale() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| place(&dir, name);
    let script = format!(
        "wait picture\nclick Radius\nset Radius = 0.6\nwait samples 32 400\nscreenshot {}\nscale 2\nwait 0.5\nwait samples 32 400\nscreenshot {}\n\
         scale 1.25\nwait 0.5\nscale 1\nwait 0.5\nwait samples 32 400\nscreenshot {}\nexpect-no-errors\n",
        at("one.png"),
        at("two.png"),
        at("back.png")
    );
    std::fs::write(at("script"), script).unwrap();
    let out = run(&["view", "builtin:stairs", "--size", "400x300", "--headless-script", &at("script")]);
    assert!(out.status.success(), "{}", stderr(&out));
    let load = |name: &str| skylit::output::load(at(name).as_ref()).unwrap();
    let [one, two, back] = ["one.png", "two.png", "back.png"].map(load);
    assert_eq!([one.width, one.height, two.width, two.height, back.width, back.height], [400, 300, 800, 600, 400, 300]);
    // the same picture, to what fonts and edges are at another size: means of 8x8 points
    let means = |image: &skylit::output::Image, scale: usize| -> Vec<f32> {
        let (plane, width) = (image.f32("G").or(image.f32("Y")).unwrap(), image.width as usize);
        let side = 20 * scale;
        let block = |bx: usize, by: usize| {
            let sum: f32 = (0..side * side).map(|k| plane[(by * side + k / side) * width + bx * side + k % side]).sum();
            sum / (side * side) as f32
        };
        (0..15).flat_map(|y| (0..20).map(move |x| (x, y))).map(|(x, y)| block(x, y)).collect()
    };
    let difference = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>() / a.len() as f32;
    let (first, double, last) = (means(&one, 1), means(&two, 2), means(&back, 1));
    assert!(difference(&first, &double) < 0.02, "{}", difference(&first, &double));
    assert!(difference(&first, &last) < 0.02, "{}", difference(&first, &last));
}

#[test]
fn gpu_device_memory_that_runs_out() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let exr = place(&dir, "a.exr");
    let (size, limits) = match is_full() {
        true => ("640x480", &["0", "1", "2", "4", "8", "16", "32", "4000"][..]),
        false => ("320x240", &["0", "1", "3", "8", "20", "4000"][..]),
    };
    let frames = ["render", "builtin:stairs", "--size", size, "--preset", "balanced"];
    let still = ["render", "builtin:spheres:3000", "--size", size, "--spp", "4"];
    for args in [&frames[..], &still] {
        let mut codes = Vec::new();
        for mib in limits {
            let out = skylit(args).args(["-o", &exr]).env("SKYLIT_FAULT_DEVICE_MEMORY", mib).output().unwrap();
            codes.push(out.status.code());
            if !out.status.success() {
                ends(&out, 5, "out of memory: no device memory left for ");
                assert!(stderr(&out).contains("use a smaller image") && count(dir.path()) == 0, "{}", stderr(&out));
            }
        }
        assert!(codes[0] == Some(5) && codes[1] == Some(5) && codes.last() == Some(&Some(0)), "{codes:?}");
        std::fs::remove_file(&exr).unwrap();
    }
}

/// The program under a limit of its address space, in KiB.
#[cfg(target_os = "linux")]
fn limited(kib: u64, args: &[&str]) -> Output {
    let mut command = skylit(&[]);
    let program = command.get_program().to_owned();
    command = Command::new("sh");
    command.args(["-c", &format!("ulimit -c 0; ulimit -v {kib}; exec \"$@\""), "sh"]).arg(program).args(args);
    command.env("XDG_CONFIG_HOME", "/nonexistent").env_remove("RUST_BACKTRACE").stdin(Stdio::null()).output().unwrap()
}

#[cfg(target_os = "linux")]
#[test]
fn host_memory_that_runs_out() {
    let dir = tempfile::tempdir().unwrap();
    let file = place(&dir, "a.glb");
    let export = ["export", "builtin:terrain:2000000", &file];
    // what the program itself takes depends on how it was optimised; a little more is enough to start, and too little for threads
    let starts = |kib: &u64| limited(*kib, &["-V"]).status.success();
    let least: u64 = (40_000..400_000).step_by(2_000).find(starts).expect("the program starts somewhere");
    for kib in [(8_000..28_000).step_by(2_000).collect(), vec![40_000, 80_000]]
        .concat()
        .into_iter()
        .map(|more: u64| least + more)
    {
        let out = limited(kib, &export);
        ends(&out, 5, "out of memory: the system has no ");
        assert_eq!((count(dir.path()), stderr(&out).lines().count()), (0, 1), "{}", stderr(&out));
    }
    assert!(limited(4_000_000, &export).status.success() && count(dir.path()) == 1);
}

#[test]
fn gpu_a_driver_without_a_feature() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let (whole, exr) = (reference(dir.path()), place(&dir, "a.exr"));
    let render = |without: &str, extra: &[&str]| {
        let args = [&STILL[..], &["--resumable", "-o", &exr], extra].concat();
        skylit(&args).env("SKYLIT_FAULT_WITHOUT", without).output().unwrap()
    };
    for feature in ["Vulkan 1.3", "bufferDeviceAddress", "hostQueryReset", "maintenance4", "synchronization2"] {
        let out = render(feature, &[]);
        ends(&out, 2, &format!("lacks {feature}, which skylit needs"));
        assert_eq!(count(dir.path()), 0);
        let out = skylit(&["doctor"]).env("SKYLIT_FAULT_WITHOUT", feature).output().unwrap();
        assert_eq!(out.status.code(), Some(2), "{}", stderr(&out));
    }
    ends(&render("bufferDeviceAddress,maintenance4", &[]), 2, "lacks bufferDeviceAddress, maintenance4");
    // what is not needed is not missed: the same bits without 64-bit integers, and without ray tracing
    let ray_tracing = "VK_KHR_acceleration_structure,VK_KHR_ray_query,VK_KHR_ray_tracing_pipeline";
    for (without, extra) in [("shaderInt64", &["--tracer", "compute"][..]), (ray_tracing, &["--tracer", "compute"])] {
        let out = render(without, extra);
        assert!(out.status.success(), "{without}: {}", stderr(&out));
        assert!(std::fs::read(&exr).unwrap() == whole, "{without}: other bits");
    }
    std::fs::remove_file(&exr).unwrap();
    for tracer in ["query", "pipeline"] {
        ends(&render(ray_tracing, &["--tracer", tracer]), 2, tracer);
    }
    assert_eq!(count(dir.path()), 0);
}

/// Runs a shell script in which `$1` is a folder of this size, in a name space of its own; `None` where the system does not let.
#[cfg(target_os = "linux")]
fn with_mount(options: &str, script: &str, args: &[&str]) -> Option<Output> {
    let dir = tempfile::tempdir().unwrap();
    let unshare = |script: &str| {
        let mut command = Command::new("unshare");
        command.args(["--user", "--map-root-user", "--mount", "sh", "-c", script, "sh"]).arg(dir.path());
        command.arg(env!("CARGO_BIN_EXE_skylit")).args(args);
        command.env("XDG_CONFIG_HOME", "/nonexistent").env_remove("RUST_BACKTRACE").stdin(Stdio::null()).output()
    };
    let mount = format!("mount -t tmpfs -o {options} tmpfs \"$1\"");
    if !unshare(&mount).is_ok_and(|out| out.status.success()) {
        println!("skipped: no file systems can be mounted here");
        return None;
    }
    Some(unshare(&format!("{mount} && export F=\"$1\" S=\"$2\" && shift 2 && {script}")).unwrap())
}

#[cfg(target_os = "linux")]
#[test]
fn gpu_disks_that_are_full() {
    if !device() {
        return;
    }
    // an older file stays, and what does not fit leaves nothing
    let script = "echo older > $F/a.exr && $S \"$@\" -o $F/a.exr; code=$?; cat $F/a.exr; ls -A $F; exit $code";
    let large = ["render", "builtin:cornell-box", "--size", "320x240", "--spp", "1", "--quiet"];
    for extra in [&["--exr-compression", "none"][..], &["--resumable"]] {
        let Some(out) = with_mount("size=128k", script, &[&large[..], extra].concat()) else { return };
        ends(&out, 4, "a.exr: cannot write: the disk is full");
        assert_eq!(out.stdout, b"older\na.exr\n", "{}", String::from_utf8_lossy(&out.stdout));
    }
    let frames = ["render", "builtin:cornell-box", "--size", "160x120", "--preset", "fast", "--quiet"];
    for (name, command) in [("a.png", large), ("a.webp", large), ("a.jpg", large), ("a.apng", frames)] {
        let script = format!("$S \"$@\" -o $F/{name}; code=$?; ls -A $F; exit $code");
        let out = with_mount("size=4k", &script, &command).unwrap();
        ends(&out, 4, &format!("{name}: cannot write: the disk is full"));
        assert!(out.stdout.is_empty(), "{name}: {}", String::from_utf8_lossy(&out.stdout));
    }
    // a still whose intermediate images do not fit any more: those before are whole, and the render goes on from them
    let script = "$S \"$@\" -o $F/a.exr; code=$?; ls -A $F; exit $code";
    let stills = [&large[..4], &["--spp", "4", "--frames", "0..8", "--orbit", "--quiet"]].concat();
    let out = with_mount("size=400k", &script.replace("a.exr", "a.#.exr"), &stills).unwrap();
    ends(&out, 4, "the disk is full");
    let written = String::from_utf8(out.stdout).unwrap();
    assert!((1..8).contains(&written.lines().count()) && written.lines().all(|l| l.ends_with(".exr")), "{written}");
    // a cache that is full costs time, and nothing else
    let script = "XDG_CACHE_HOME=$F $S \"$@\" && find $F -name '*.tmp'";
    let png = tempfile::tempdir().unwrap();
    let file = place(&png, "a.png");
    let out = with_mount("size=8k", script, &[&large[..], &["-o", &file]].concat()).unwrap();
    assert!(out.status.success() && out.stdout.is_empty() && out.stderr.is_empty(), "{}", stderr(&out));
    // a device that takes nothing
    let link = place(&png, "full.png");
    std::os::unix::fs::symlink("/dev/full", &link).unwrap();
    ends(&run(&[&large[..], &["-o", &link]].concat()), 4, "full.png: cannot write: the disk is full");
    assert_eq!(names(png.path()), ["a.png", "full.png"]);
}

/// A limit for files (`ulimit -f`) is as a disk that is full, and says what to raise.
#[cfg(target_os = "linux")]
#[test]
fn gpu_files_that_exceed_their_limit() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let limited = |args: &[&str]| {
        let program = skylit(&[]).get_program().to_owned();
        let mut command = Command::new("sh");
        // in blocks of 512 bytes or, with bash, of 1024
        command
            .args(["-c", "ulimit -c 0; ulimit -f 8; exec \"$@\"", "sh"])
            .arg(program)
            .args(args)
            .current_dir(dir.path());
        command
            .env("XDG_CONFIG_HOME", "/nonexistent")
            .env_remove("RUST_BACKTRACE")
            .stdin(Stdio::null())
            .output()
            .unwrap()
    };
    std::fs::write(dir.path().join("a.glb"), "older").unwrap();
    let remedy = "raise the limit (`ulimit -f unlimited`)";
    for name in ["a.glb", "a.bin"] {
        let out = limited(&["export", "builtin:spheres:100", name]);
        ends(&out, 4, &format!("{name}: cannot write: it would be larger than files may be here: {remedy}"));
    }
    // a driver that runs on the CPU keeps its memory in a file, too
    let out = limited(&["render", "builtin:cornell-box", "--size", "160x120", "--spp", "1", "--quiet", "-o", "a.exr"]);
    ends(&out, 4, remedy);
    assert_eq!(names(dir.path()), ["a.glb"]);
    assert_eq!(std::fs::read(dir.path().join("a.glb")).unwrap(), b"older");
}

#[cfg(target_os = "linux")]
#[test]
fn gpu_folders_that_are_read_only() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let file = place(&dir, "a.png");
    let small = ["render", "builtin:cornell-box", "--size", "32x24", "--spp", "1", "--quiet"];
    let script = "mount -o remount,ro $F && $S \"$@\" -o $F/a.png";
    let Some(out) = with_mount("size=1m", script, &small) else { return };
    ends(&out, 4, "a.png: cannot write: the file system is read-only");
    // no cache, and no word about it
    let script = "mkdir $F/skylit && mount -o remount,ro $F && XDG_CACHE_HOME=$F HOME=$F $S \"$@\"";
    let out = with_mount("size=1m", script, &[&small[..], &["-o", &file]].concat()).unwrap();
    assert!(out.status.success() && out.stderr.is_empty(), "{}", stderr(&out));
    // hierarchies that are to be kept are a warning
    let script = "mount -o remount,ro $F && $S \"$@\" --build best --bvh-cache $F/kept";
    let arguments =
        ["render", "builtin:cornell-box", "--tracer", "compute", "--size", "32x24", "--spp", "1", "-o", &file];
    let out = with_mount("size=1m", script, &arguments).unwrap();
    assert!(out.status.success() && stderr(&out).contains("not cached"), "{}", stderr(&out));
    // neither a home nor a cache
    let out = skylit(&small).args(["-o", &file]).env_remove("HOME").env_remove("XDG_CACHE_HOME").output().unwrap();
    assert!(out.status.success() && out.stderr.is_empty(), "{}", stderr(&out));
    assert_eq!(names(dir.path()), ["a.png"]);
}

fn signal(child: &Child, name: &str) {
    // it may have ended already
    let _ = Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).stderr(Stdio::null()).status();
}

/// Starts the program, sends a signal after a time, and waits for it.
fn signalled(args: &[&str], name: &str, after: Duration) -> (Output, Duration) {
    let child = skylit(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(after);
    signal(&child, name);
    let start = Instant::now();
    (child.wait_with_output().unwrap(), start.elapsed())
}

/// Whenever a signal comes, the output is whole or there is none, and no file besides.
#[test]
fn gpu_signals_at_any_time() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let exr = place(&dir, "a.exr");
    let still =
        ["render", "builtin:terrain:300000", "--size", "320x200", "--spp", "24", "--resumable", "-o", &exr, "--quiet"];
    let start = Instant::now();
    assert!(run(&still).status.success());
    let whole_time = start.elapsed();
    let whole = std::fs::read(&exr).unwrap();
    std::fs::remove_file(&exr).unwrap();
    let mut interrupted = 0;
    for (k, name) in ["INT", "TERM", "INT", "TERM", "KILL", "INT", "TERM", "KILL", "INT", "TERM"].iter().enumerate() {
        let (out, after) = signalled(&still, name, whole_time.mul_f64(k as f64 / 10.0));
        let text = stderr(&out);
        match (out.status.code(), out.status.signal()) {
            (Some(130), _) => {
                interrupted += 1;
                assert!(text.lines().last() == Some("skylit: error: interrupted"), "{text}");
                assert!(after < Duration::from_secs(20), "{after:?}");
            }
            // before the program could say what it does with it
            (None, Some(2 | 15)) if k == 0 => {}
            (None, Some(9)) if *name == "KILL" => {}
            (Some(0), _) => {}
            other => panic!("{name} after {k} tenths: {other:?} {text}"),
        }
        // a signal may come when all is written, and the program is about to end
        if out.status.success() || Path::new(&exr).exists() {
            assert_eq!(std::fs::read(&exr).unwrap(), whole, "{name} after {k} tenths");
            std::fs::remove_file(&exr).unwrap();
        }
        assert_eq!(names(dir.path()), Vec::<OsString>::new(), "{name} after {k} tenths");
    }
    assert!(interrupted > 2, "{interrupted}");
}

/// Waits until a condition holds.
fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < Duration::from_secs(120), "{what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn gpu_what_was_interrupted_goes_on() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = |name: &str| {
        let folder = dir.path().join(name);
        std::fs::create_dir(&folder).unwrap();
        folder
    };
    // stills of a time line: those that were written are whole, and --continue makes the others
    let [all, part] = ["all", "part"].map(folder);
    let stills = |folder: &Path, extra: &[&str]| {
        let output = folder.join("a.#.exr").to_str().unwrap().to_owned();
        let base =
            ["render", "builtin:parade", "--integrator", "direct", "--size", "64x36", "--frames", "0..6", "--animate"];
        let rest = ["--fps", "10", "--spp", "4", "--quiet", "-o", &output];
        let mut command = skylit(&[&base[..], &rest, extra].concat());
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    assert!(stills(&all, &[]).output().unwrap().status.success());
    let child = stills(&part, &[]).spawn().unwrap();
    until("no still", || count(&part) > 1);
    signal(&child, "TERM");
    let out = child.wait_with_output().unwrap();
    ends(&out, 130, "interrupted");
    let written = names(&part);
    assert!((2..6).contains(&written.len()) && written.iter().all(|f| f.as_bytes().ends_with(b".exr")), "{written:?}");
    assert!(stills(&part, &["--continue"]).output().unwrap().status.success());
    let read = |folder: &Path| names(folder).iter().map(|f| std::fs::read(folder.join(f)).unwrap()).collect::<Vec<_>>();
    assert!(names(&part) == names(&all) && read(&part) == read(&all));
    // a still that keeps what it has, and is resumed: the same bits as in one go
    let [a, b] = ["a.exr", "b.exr"].map(|name| place(&dir, name));
    let base = ["render", "builtin:stairs", "--size", "320x200", "--quiet", "--spp"];
    let child = skylit(&[&base[..], &["100000", "--intervals", "--keep-partial", "-o", &a]].concat());
    let mut child = { child }.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    until("no intermediate image", || names(dir.path()).iter().any(|n| n.as_bytes().starts_with(b"a.0")));
    signal(&child, "INT");
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let image = skylit::output::load(a.as_ref()).unwrap();
    let samples = image.metadata("spp").unwrap().to_owned();
    let more = (samples.parse::<u32>().unwrap() + 5).to_string();
    assert!(run(&[&base[..], &[&more, "--resume", &a, "-o", &a]].concat()).status.success());
    assert!(run(&[&base[..], &[&more, "--resumable", "-o", &b]].concat()).status.success());
    assert_eq!(std::fs::read(a).unwrap(), std::fs::read(b).unwrap());
}

/// Ctrl-C of a bake whose finished parts are kept says that the same command goes on, and it does.
#[test]
fn gpu_an_interrupted_bake_says_how_it_goes_on() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let [model, exr, parts] = ["floor.obj", "a.exr", "a.exr.parts"].map(|name| place(&dir, name));
    let corners = "v 0 0 1\nv 1 0 1\nv 1 0 0\nv 0 0 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    std::fs::write(&model, format!("{corners}f 1/1 2/2 3/3 4/4\n")).unwrap();
    let args = ["bake", &model, "-o", &exr, "--size", "2048", "--spp", "16", "--ground", "--resumable"];
    let child = skylit(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // the header has 48 bytes
    until("no part", || std::fs::metadata(&parts).is_ok_and(|file| file.len() > 1 << 20));
    signal(&child, "INT");
    let out = child.wait_with_output().unwrap();
    ends(&out, 130, "interrupted: the same command goes on with the");
    let last = stderr(&out).lines().last().unwrap_or_default().to_owned();
    assert!(last.contains(" finished part") && last.ends_with(&format!(" in {parts}")), "{last}");
    assert!(!Path::new(&exr).exists());

    // so it does
    let out = run(&args);
    let said = String::from_utf8_lossy(&out.stdout).into_owned() + &stderr(&out);
    assert!(out.status.success() && said.contains("goes on with the finished parts in"), "{said}");
    assert!(Path::new(&exr).is_file() && !Path::new(&parts).exists());

    // before there is a part, there is nothing to go on with
    let (out, _) = signalled(&["bake", &model, "-o", &exr, "--size", "64", "--resumable"], "INT", Duration::ZERO);
    assert!(!stderr(&out).contains("finished part"), "{}", stderr(&out));
}

/// The second signal ends the program at once, whatever it does.
#[test]
fn gpu_a_second_signal_ends_at_once() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let exr = place(&dir, "a.exr");
    let args = ["render", "builtin:terrain:2000000", "--size", "320x200", "--spp", "64", "-o", &exr];
    let child = skylit(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(400));
    signal(&child, "INT");
    std::thread::sleep(Duration::from_millis(50));
    signal(&child, "INT");
    let start = Instant::now();
    let out = child.wait_with_output().unwrap();
    assert_eq!(out.status.code(), Some(130), "{}", stderr(&out));
    assert!(start.elapsed() < Duration::from_secs(3) && count(dir.path()) == 0, "{:?}", start.elapsed());
}

/// A viewer that reads a little now and then keeps every write alive: Ctrl-C ends the wait all the same.
#[test]
fn gpu_a_viewer_that_drips_can_be_interrupted() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let exr = place(&dir, "a.exr");
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let (sender, connected) = std::sync::mpsc::channel();
    let drips = std::thread::spawn(move || {
        let (mut connection, _) = listener.accept().unwrap();
        let mut buffer = vec![0; 100_000];
        let mut is_first = true;
        while connection.read(&mut buffer).is_ok_and(|n| n > 0) {
            // the image is on its way
            if std::mem::take(&mut is_first) {
                sender.send(()).unwrap();
            }
            std::thread::sleep(Duration::from_millis(300));
        }
    });
    let args = ["render", "builtin:plane", "--size", "1600x1200", "--spp", "1", "-o", &exr, "--tev", &address];
    let child = skylit(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    connected.recv_timeout(Duration::from_secs(60)).unwrap();
    let start = Instant::now();
    signal(&child, "INT");
    let out = child.wait_with_output().unwrap();
    assert!(start.elapsed() < Duration::from_secs(3), "{:?}", start.elapsed());
    assert!(matches!(out.status.code(), Some(0 | 130)), "{}", stderr(&out));
    drips.join().unwrap();
}

/// Several processes write one output and fill one cache: the output is that of one of them, and the cache is whole.
#[test]
fn gpu_processes_side_by_side() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let (exr, cache, kept) = (place(&dir, "a.exr"), place(&dir, "cache"), place(&dir, "kept"));
    let seeds = ["1", "2", "3"];
    let command = |seed: &str, output: &str| {
        let args =
            [&STILL[..], &["--tracer", "compute", "--build", "best", "--seed", seed, "--quiet", "-o", output]].concat();
        let mut command = skylit(&args);
        command.args(["--bvh-cache", &kept]).env("XDG_CACHE_HOME", &cache);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    let children: Vec<Child> = seeds.iter().map(|seed| command(seed, &exr).spawn().unwrap()).collect();
    for child in children {
        let out = child.wait_with_output().unwrap();
        assert!(out.status.success() && out.stderr.is_empty(), "{}", stderr(&out));
    }
    let written = std::fs::read(&exr).unwrap();
    let alone = seeds.map(|seed| {
        let file = place(&dir, &format!("{seed}.exr"));
        let out = command(seed, &file).output().unwrap();
        // a hierarchy that is damaged would be a warning
        assert!(out.status.success() && out.stderr.is_empty(), "{}", stderr(&out));
        std::fs::read(file).unwrap()
    });
    assert!(alone.contains(&written) && alone[0] != alone[1]);
    let temporary = |folder: &str| names(folder.as_ref()).iter().any(|f| f.as_bytes().ends_with(b".tmp"));
    assert!(!temporary(&kept) && !temporary(&place(&dir, "cache/skylit")) && count(kept.as_ref()) == 1);
    assert_eq!(names(dir.path()), ["1.exr", "2.exr", "3.exr", "a.exr", "cache", "kept"]);
}

/// What files call their things is shown as text, whatever a terminal would make of it.
#[test]
fn names_cannot_command_a_terminal() {
    let dir = tempfile::tempdir().unwrap();
    let evil = "a\u{1b}[31m\u{9b}2J\u{202e}b\nc\r\u{7}";
    let gltf = serde_json::json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "name": evil, "nodes": [0] }],
        "nodes": [{ "name": evil, "camera": 0, "mesh": 0 }],
        "cameras": [{ "name": evil, "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }],
        "meshes": [{ "name": evil, "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
        "materials": [{ "name": evil }],
        "animations": [],
        "extensionsUsed": [evil],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "buffers": [{ "byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA" }],
    });
    let scene = place(&dir, "evil.gltf");
    std::fs::write(&scene, gltf.to_string()).unwrap();
    let channel = |value: f32| Channel { name: "a\u{1b}[31m\nb".into(), samples: Samples::F32(vec![value; 4]) };
    let exr = place(&dir, "evil.exr");
    output::save(&Image { width: 2, height: 2, channels: vec![channel(0.5)], metadata: Vec::new() }, exr.as_ref())
        .unwrap();
    std::fs::write(dir.path().join("skylit.toml"), "\"a\\u001b[31m\\u009bb\" = 1\n").unwrap();
    for args in [
        &["info", &scene, "--no-device"][..],
        &["info", &scene, "--no-device", "--json"],
        &["diff", &exr, &exr],
        &["diff", &exr, &exr, "--json"],
        &["render", &scene, "--camera", evil, "-o", "a.tga"],
    ] {
        let out = run(args);
        let text = String::from_utf8([out.stdout, out.stderr].concat()).unwrap();
        let obeyed = |c: char| c.is_control() && c != '\n' || c == '\u{202e}';
        assert!(!text.chars().any(obeyed), "{args:?}: {text:?}");
        assert!(
            !text.lines().any(|line| line.starts_with("c ") || line.starts_with("b ") || line == "b"),
            "{args:?}: {text}"
        );
    }
}

/// Numbers have points, whatever the locale writes.
#[cfg(target_os = "linux")]
#[test]
fn gpu_a_locale_with_decimal_commas() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let locales = place(&dir, "locales");
    std::fs::create_dir(&locales).unwrap();
    let made =
        Command::new("localedef").args(["-i", "de_DE", "-f", "UTF-8", &format!("{locales}/de_DE.UTF-8")]).output();
    if !made.is_ok_and(|out| out.status.success()) {
        println!("without a German locale: its name alone is set");
    }
    let render = |name: &str, locale: &str| {
        let exr = place(&dir, name);
        let args = [&STILL[..], &["--ao-radius", "0.75", "--fov-y", "41.5", "--json", "-o", &exr]].concat();
        let mut command = skylit(&args);
        let out = command.env("LC_ALL", locale).env("LANG", locale).env("LOCPATH", &locales).output().unwrap();
        let record = json(&out);
        (std::fs::read(exr).unwrap(), record["mean"].as_f64().unwrap())
    };
    assert_eq!(render("a.exr", "C"), render("b.exr", "de_DE.UTF-8"));
    let out =
        skylit(&[&STILL[..], &["--ao-radius", "0,75", "-o", "a.png"]].concat()).env("LC_ALL", "de_DE.UTF-8").output();
    assert_refusal(&out.unwrap(), 64, "0,75", &STILL);
}

/// Times of files mean nothing to caches and resumed renders, and time limits do not follow the clock.
#[test]
fn gpu_clocks_that_jump() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let (cache, kept) = (place(&dir, "cache"), place(&dir, "kept"));
    let render = |name: &str, extra: &[&str], wrapper: &[&str]| {
        let args = [&STILL[..], &["--tracer", "compute", "--resumable", "--quiet", "-o", name], extra].concat();
        let program = env!("CARGO_BIN_EXE_skylit");
        let words = [wrapper, &[program], &args].concat();
        let mut command = Command::new(words[0]);
        command.args(&words[1..]).env("XDG_CONFIG_HOME", "/nonexistent").env("XDG_CACHE_HOME", &cache);
        let out = command.args(["--build", "best", "--bvh-cache", &kept]).output().unwrap();
        assert!(out.status.success() && out.stderr.is_empty(), "{}", stderr(&out));
        std::fs::read(name).unwrap()
    };
    let exr = |name: &str| place(&dir, name);
    let first = render(&exr("a.exr"), &[], &[]);
    let set = |folder: &Path, time: SystemTime| {
        let mut folders = vec![folder.to_owned()];
        while let Some(folder) = folders.pop() {
            for path in std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()) {
                std::fs::File::open(&path).unwrap().set_modified(time).unwrap();
                if path.is_dir() {
                    folders.push(path);
                }
            }
        }
    };
    for time in [SystemTime::UNIX_EPOCH, SystemTime::now() + Duration::from_secs(3_000_000_000)] {
        set(dir.path(), time);
        assert_eq!(render(&exr("b.exr"), &["--resume", &exr("a.exr")], &[]), first);
    }
    // with libfaketime: a clock that starts in another year and runs a hundred times as fast
    let has_faketime = Command::new("faketime").arg("--version").output().is_ok_and(|out| out.status.success());
    for start in ["@1971-01-01 00:00:00", "@2100-01-01 00:00:00 x100"] {
        if has_faketime {
            assert_eq!(render(&exr("b.exr"), &[], &["faketime", "-f", start]), first);
        } else {
            println!("skipped: no faketime");
        }
    }
    let path: PathBuf = exr("b.exr").into();
    assert!(path.exists());
}

/// What files may take of the memory is an option, for scenes, their environments and images that are compared. Beyond it ends with one line, before anything is written.
#[test]
fn files_take_as_much_memory_as_they_may() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| place(&dir, name);
    let channel = |name: &str| Channel { name: name.into(), samples: Samples::F32(vec![0.5; 512 * 256]) };
    let image =
        Image { width: 512, height: 256, channels: ["R", "G", "B"].map(channel).to_vec(), metadata: Vec::new() };
    for name in ["a.png", "a.exr"] {
        output::save(&image, Path::new(&at(name))).unwrap();
    }
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/courtyard.gltf");
    let (scene, before) = (scene.to_string_lossy(), names(dir.path()));
    let (png, exr) = (at("a.png"), at("a.exr"));
    let commands: [&[&str]; 5] = [
        &["info", &scene, "--no-device"],
        &["export", &scene, &at("b.glb")],
        &["diff", &png, &png],
        &["diff", &exr, &exr],
        &["compare", &png, &exr],
    ];
    for command in commands {
        let out = run(&[command, &["--memory-limit", "4KiB"][..]].concat());
        // in words of whoever asks: a reader of a file, or of an image
        ends(&out, 5, "--memory-limit");
        assert!(stderr(&out).contains("more than the 4"), "{}", stderr(&out));
        assert_eq!(names(dir.path()), before, "{command:?}");
    }
    for command in [commands[0], commands[2], commands[3]] {
        assert!(run(&[&["--memory-limit", "100MB"][..], command].concat()).status.success(), "{command:?}");
    }
    for size in ["lots", "-1", ""] {
        ends(&run(&["info", &scene, &format!("--memory-limit={size}")]), 64, "--memory-limit");
    }
}

/// Ctrl-C ends a load at once, whatever the format.
#[test]
fn loading_is_interrupted_at_once() {
    use std::io::Write;
    let dir = tempfile::tempdir().unwrap();
    let path = place(&dir, "large.obj");
    let mut file = std::io::BufWriter::new(std::fs::File::create(&path).unwrap());
    for k in 0..4_000_000 {
        writeln!(file, "v {} {} {}\nf {} {} {}", k % 1009, k % 997, k % 991, k + 1, k / 2 + 1, k / 3 + 1).unwrap();
    }
    drop(file);
    let mut program = skylit(&["info", &path, "--no-device"]);
    let child = program.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(700));
    let start = Instant::now();
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let out = child.wait_with_output().unwrap();
    ends(&out, 130, "interrupted");
    assert!(start.elapsed().as_secs_f64() < 1.0, "{:?}", start.elapsed());
}

/// Ctrl-C ends a render in each stage before its first sample, once and without a file: a builder asks nobody whether it
/// is to stop.
#[test]
fn gpu_building_is_given_up() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let image = place(&dir, "a.png");
    for (milliseconds, options) in
        [(700, &[][..]), (1400, &["--json"]), (2100, &["--build", "best"]), (3500, &["--json"])]
    {
        let args = ["render", "builtin:terrain:9000000", "-o", &image, "--tracer", "compute"];
        let mut program = skylit(&[&args[..], options].concat());
        let child = program.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(milliseconds));
        assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
        let out = child.wait_with_output().unwrap();
        ends(&out, 130, "interrupted");
        assert_eq!(stderr(&out).matches("interrupted").count(), 1, "{}", stderr(&out));
        let record = serde_json::from_slice::<serde_json::Value>(&out.stdout).ok();
        assert_eq!(record.map(|r| r["exit_code"] == 130), options.contains(&"--json").then_some(true));
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0, "after {milliseconds} ms");
    }
}

/// A mistake in the file of influence areas costs no loading of a scene.
#[test]
fn areas_are_read_before_the_scene() {
    let dir = tempfile::tempdir().unwrap();
    let (scene, image, areas) = (place(&dir, "gone.glb"), place(&dir, "a.png"), place(&dir, "areas.json"));
    let build = ["--traversal", "nearest", "--build", "pah", "--build-areas", &areas];
    let commands = [&["render", &scene, "-o", &image][..], &["info", &scene]];
    for command in commands {
        ends(&run(&[command, &build].concat()), 3, "areas.json");
    }
    std::fs::write(&areas, "[{}]").unwrap();
    for command in commands {
        ends(&run(&[command, &build].concat()), 3, "is no list of influence areas");
    }
}
