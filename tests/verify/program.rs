//! `skylit verify` from outside: manifests that are wrong, exit codes, what it prints and writes.

use std::path::Path;

use crate::common::command::{device, fails, json, run, stderr};

const TWO: &str = r#"
[defaults]
render = "ao --size 24x16 --spp 8"
tolerance = "z_test"

[[frame]]
name = "plane"
scene = "builtin:plane"
tolerance = "exact"

[[frame]]
name = "stairs"
scene = "builtin:stairs"
render = "ao --ao-radius 2"
"#;

fn folder(manifest: &str) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("frames.toml"), manifest).unwrap();
    dir
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Reading, sorting and reporting take time in proportion to the number of frames.
#[test]
fn a_manifest_of_ten_thousand_frames() {
    let frame = |k: usize| {
        let scene = if k.is_multiple_of(2) { "builtin:none".to_owned() } else { format!("missing-{k}.glb") };
        format!(
            "[[frame]]\nname = \"frame-{k}\"\nscene = \"{scene}\"\nrender = \"ao --spp 4\"\ntolerance = \"z_test\"\n"
        )
    };
    let dir = folder(&(0..10_000).map(frame).collect::<String>());
    let [junit, page] = ["a.xml", "page"].map(|name| dir.path().join(name));
    let start = std::time::Instant::now();
    let out = run(&["verify", text(dir.path()), "--junit", text(&junit), "--html", text(&page)]);
    fails(&out, 2, &["10000 frames could not be judged: frame-0, frame-2, frame-4, frame-6, frame-8 and 9995 more"]);
    assert!(String::from_utf8_lossy(&out.stdout).contains("frames.toml: line 49998: no scene"));
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

#[test]
fn manifests_that_are_wrong_name_the_line() {
    let frame = |lines: &str| format!("[[frame]]\nname = \"a\"\nscene = \"builtin:plane\"\n{lines}\n");
    let good = "render = \"ao\"\ntolerance = \"exact\"";
    let cases = [
        ("".to_owned(), "it has no frames"),
        ("frames = 3".to_owned(), "line 1: unknown field `frames`"),
        (frame("render = \"ao\"\ntolerence = \"exact\""), "line 5: unknown field `tolerence`"),
        (frame("render = \"ao\""), "line 1: a has no tolerance"),
        (frame("render = \"ao\"\ntolerance = { flip = { mx = 1 } }"), "line 5: unknown field `mx`"),
        (frame("render = \"ao\"\ntolerance = \"roughly\""), "line 5: invalid value: string \"roughly\""),
        (frame("render = \"oa --spp 3\"\ntolerance = \"exact\""), "line 4: \"oa --spp 3\": unknown integrator oa"),
        (frame("render = \"ao --spp many\"\ntolerance = \"exact\""), "line 4: \"ao --spp many\""),
        (frame("render = \"ao --max-depth 3\"\ntolerance = \"exact\""), "line 4: --max-depth has no effect"),
        (frame("render = \"ao --time-limit 3\"\ntolerance = \"exact\""), "line 1: a: --time-limit"),
        (
            frame("render = \"fast --frames 0..4294967295\"\ntolerance = \"exact\""),
            "line 1: a: the last of its frames is compared, and up to 10000",
        ),
        (frame("render = \"fast --warm-up 10000\"\ntolerance = \"exact\""), "use fewer --frames or less --warm-up"),
        (frame("render = \"fast\"\ntolerance = \"z_test\""), "line 1: a: --preset selects frames in real time"),
        (frame("render = \"ao\"\ngolden = \"png\"\ntolerance = \"z_test\""), "a PNG has no variances"),
        (frame("render = \"ao\"\ngolden = \"jpg\"\ntolerance = \"exact\""), "line 5: unknown variant `jpg`"),
        (frame("render = \"path --denoise filter\"\ntolerance = \"z_test\""), "denoised"),
        (frame(&format!("{good}\ntracers = [\"magic\"]")), "line 6: unknown tracer magic"),
        (frame(&format!("{good}\nsettings = \"none.json\"")), "line 6: "),
        (frame(good) + &frame(good), "line 7: two frames are called a"),
        (frame(good).replace("\"a\"", "\"a/b\""), "line 2: the name \"a/b\""),
        (frame(good).replace("plane", "plain"), "line 3: no built-in scene plain"),
        (frame(good).replace("builtin:plane", "no.glb"), "line 3: no scene "),
        ("[[frame]]\nname = \"a\"\n".to_owned(), "line 1: missing field `scene`"),
        ("name = \"".to_owned(), "line 1: "),
    ];
    for (manifest, says) in cases {
        let dir = folder(&manifest);
        let out = run(&["verify", text(dir.path())]);
        // of a frame in its line, of the manifest in the error
        let said = stderr(&out) + &String::from_utf8_lossy(&out.stdout);
        assert!(out.status.code() == Some(2) && said.contains("frames.toml") && said.contains(says), "{says}: {said}");
    }
    let dir = tempfile::tempdir().unwrap();
    fails(
        &run(&["verify", text(dir.path())]),
        2,
        &["frames.toml: no such file: it lists the frames", "tolerance = \"z_test\""],
    );
    let json = run(&["verify", text(dir.path()), "--json"]);
    let record: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(record["exit_code"], 2);
}

#[test]
fn options_that_have_no_effect() {
    let dir = folder(TWO);
    let refuse =
        |options: &[&str], says: &str| fails(&run(&[&["verify", text(dir.path())], options].concat()), 64, &[says]);
    refuse(&["--force"], "--force is for --bless");
    refuse(&["--bless", "--update-missing"], "--update-missing");
    refuse(&["--bless", "--seed", "3"], "--seed has no effect");
    refuse(&["--bless", "--tracers", "all"], "--tracers has no effect");
    refuse(&["--tracers", "magic"], "unknown tracer magic");
    refuse(&["--tracer", "compute"], "use --tracers");
    refuse(&["--shard", "3/2"], "I/N");
    refuse(&["--filter", "nothing"], "no frame has such a name");
}

/// What is wrong with one frame keeps no other from being rendered, and no result of an earlier run stays.
#[test]
fn gpu_a_broken_frame_stops_no_other() {
    if !device() {
        return;
    }
    let dir = folder(TWO);
    let path = dir.path();
    let verify = |options: &[&str]| run(&[&["verify", text(path)], options].concat());
    let (junit, page) = (path.join("out.xml"), path.join("report"));
    let results = || std::fs::read_to_string(&junit).unwrap();
    let scene = path.join("broken.gltf");
    assert!(run(&["export", "builtin:plane", "-o", text(&scene)]).status.success());
    let sound = "\n[[frame]]\nname = \"frame-5\"\nscene = \"broken.gltf\"\n";
    std::fs::write(path.join("frames.toml"), TWO.to_owned() + sound).unwrap();
    assert!(verify(&["--update-missing", "--force"]).status.success());
    assert!(verify(&["--junit", text(&junit)]).status.success() && results().contains("errors=\"0\""));

    // scenes, options, tracers and names that are wrong, and a golden image that is none
    let broken = [
        ("scene = \"gone.glb\"", "no scene"),
        ("scene = \"builtin:gone\"", "no built-in scene gone"),
        ("scene = \"builtin:plane\"\nrender = \"ao --ssp 3\"", "--ssp"),
        ("scene = \"builtin:plane\"\nsettings = \"gone.json\"", "gone.json"),
        ("scene = \"builtin:plane\"\ntracers = [\"magic\"]", "unknown tracer magic"),
        ("scene = \"broken.gltf\"", "broken.gltf"),
        ("scene = \"builtin:plane\"\nname = \"PLANE\"", "two frames are called PLANE"),
        ("scene = \"builtin:plane\"\nname = \"torn\"", "torn.exr"),
    ];
    std::fs::write(&scene, "{").unwrap();
    std::fs::write(path.join("torn.exr"), "no image").unwrap();
    let mut manifest = TWO.to_owned();
    for (k, (lines, _)) in broken.iter().enumerate() {
        let name = if lines.contains("name =") { String::new() } else { format!("name = \"frame-{k}\"\n") };
        manifest += &format!("\n[[frame]]\n{name}{lines}\n");
    }
    std::fs::write(path.join("frames.toml"), &manifest).unwrap();
    let out = verify(&["--junit", text(&junit), "--html", text(&page)]);
    fails(&out, 2, &["8 frames could not be judged"]);
    let lines = String::from_utf8(out.stdout).unwrap();
    let xml = results();
    assert!(lines.contains("10 renders: 2 hold, 8 failed") && xml.contains("errors=\"8\""), "{lines}{xml}");
    for (_, says) in broken {
        assert!(lines.contains(says), "{says}: {lines}");
    }
    let page = std::fs::read_to_string(page.join("index.html")).unwrap();
    assert!(page.contains("8 could not be judged"), "{page}");
    // one that differs besides counts more
    let differs = manifest.replace("builtin:stairs", "builtin:cornell-box");
    std::fs::write(path.join("frames.toml"), differs).unwrap();
    assert!(verify(&["--filter", "stairs"]).status.code() == Some(2));

    // without any frame that could be rendered there is a result, too: one error
    let failure = |manifest: &str, options: &[&str], code: i32, says: &str| {
        std::fs::write(&junit, "<testsuites errors=\"0\"/>").unwrap();
        std::fs::write(path.join("frames.toml"), manifest).unwrap();
        fails(&verify(&[&["--junit", text(&junit)], options].concat()), code, &[says]);
        assert!(results().contains("errors=\"1\"") && results().contains(says), "{}", results());
    };
    failure("name = \"", &[], 2, "line 1");
    failure(TWO, &["--filter", "nothing"], 64, "no frame has such a name");
    failure(TWO, &["--tracers", "magic"], 64, "unknown tracer magic");
    failure(TWO, &["--device", "no such device"], 2, "no such device");
}

#[cfg(unix)]
#[test]
fn results_that_cannot_be_written_are_exit_code_4() {
    let dir = folder(TWO);
    for option in ["--junit", "--html"] {
        fails(&run(&["verify", text(dir.path()), option, "/dev/null/out"]), 4, &["/dev/null"]);
    }
    // whatever else is wrong
    std::fs::write(dir.path().join("frames.toml"), "name = \"").unwrap();
    fails(&run(&["verify", text(dir.path()), "--junit", "/dev/null/out.xml"]), 4, &["/dev/null"]);
}

#[test]
fn gpu_golden_images_are_made_and_compared() {
    if !device() {
        return;
    }
    let dir = folder(TWO);
    let path = dir.path();
    let verify = |options: &[&str]| run(&[&["verify", text(path)], options].concat());
    let junit = path.join("out.xml");

    // none are there
    fails(&verify(&["--junit", text(&junit)]), 2, &["2 frames could not be judged: plane, stairs"]);
    let xml = std::fs::read_to_string(&junit).unwrap();
    assert!(xml.contains("errors=\"2\"") && xml.contains("--update-missing"), "{xml}");
    // what several tracers could not render is one frame
    fails(&verify(&["--tracers", "pipeline,query,compute"]), 2, &["2 frames could not be judged: plane, stairs"]);

    // nothing is pinned; nothing of this name
    fails(&verify(&["--bless"]), 64, &["no driver is pinned", "--force"]);
    let pin = |driver: &str| {
        std::fs::write(path.join("frames.toml"), format!("[drivers]\npinned = [{driver:?}]\n{TWO}")).unwrap()
    };
    pin("a driver of the past");
    fails(&verify(&["--update-missing"]), 64, &["which is not pinned", "a driver of the past"]);
    assert!(!path.join("plane.exr").exists());

    // the driver here, without the last part of its version
    let record = json(&run(&["doctor", "--json"]));
    let driver = record["devices"][record["device"].as_u64().unwrap() as usize]["driver"].as_str().unwrap().to_owned();
    pin(driver.rsplit_once(['.', ' ', '-']).unwrap().0);
    let made = json(&verify(&["--update-missing", "--filter", "plane", "--json"]));
    assert_eq!(made["frames"][0]["outcome"]["blessed"]["change"], "new");
    assert!(path.join("plane.exr").exists() && !path.join("stairs.exr").exists());
    let made = json(&verify(&["--update-missing", "--json"]));
    assert_eq!(made["frames"].as_array().unwrap().len(), 1, "{made}");

    // they hold, in one go and in parts, with another seed where noise may differ
    let all = json(&verify(&["--json", "--junit", text(&junit)]));
    let outcomes = all["frames"].as_array().unwrap();
    assert!(outcomes.len() == 2 && outcomes.iter().all(|f| f["outcome"]["holds"].is_array()), "{all}");
    let xml = std::fs::read_to_string(&junit).unwrap();
    assert!(xml.contains("tests=\"2\"") && xml.contains("failures=\"0\"") && xml.contains("stairs ("), "{xml}");
    let part = |i: usize| {
        json(&verify(&["--json", "--seed", "9", "--shard", &format!("{i}/2")]))["frames"][0]["frame"].clone()
    };
    assert_eq!([part(1), part(2)], ["plane", "stairs"]);
    let out = verify(&[]);
    assert!(out.status.success(), "{}", stderr(&out));
    let lines = String::from_utf8(out.stdout).unwrap();
    assert!(lines.starts_with("holds    plane") && lines.contains("2 renders: 2 hold (on "), "{lines}");
    assert!(all["pinned"] == true && !lines.contains("not pinned"), "{lines}");
    let here = std::fs::read_to_string(path.join("frames.toml")).unwrap();
    pin("a driver of the past");
    let elsewhere = String::from_utf8(verify(&["--filter", "plane"]).stdout).unwrap();
    assert!(
        elsewhere.contains("1 render: 1 hold (on ") && elsewhere.contains(", which is not pinned, "),
        "{elsewhere}"
    );
    std::fs::write(path.join("frames.toml"), here).unwrap();

    // the same again is the same; other settings are not
    let again = json(&verify(&["--bless", "--json"]));
    assert!(
        again["frames"].as_array().unwrap().iter().all(|f| f["outcome"]["blessed"]["change"] == "unchanged"),
        "{again}"
    );
    let manifest = std::fs::read_to_string(path.join("frames.toml")).unwrap();
    std::fs::write(path.join("frames.toml"), manifest.replace("radius 2", "radius 0.2")).unwrap();
    fails(&verify(&["--junit", text(&junit)]), 2, &["1 frame could not be judged: stairs"]);
    assert!(std::fs::read_to_string(&junit).unwrap().contains("--ao-radius 2"));
    let blessed = json(&verify(&["--bless", "--filter", "stairs", "--json"]));
    let change = blessed["frames"][0]["outcome"]["blessed"]["text"].as_str().unwrap().to_owned();
    assert!(change.contains("rmse") && change.contains("FLIP") && change.contains("--ao-radius 0.2"), "{change}");

    // a golden image of something else; one of no frame
    std::fs::copy(path.join("stairs.exr"), path.join("other.exr")).unwrap();
    let image = skylit::output::load(&path.join("stairs.exr")).unwrap();
    let mut wrong = image.clone();
    for channel in wrong.channels.iter_mut().filter(|c| c.name == "Y") {
        let skylit::output::Samples::F32(values) = &mut channel.samples else { panic!("floats") };
        values.iter_mut().for_each(|v| *v *= 0.5);
    }
    skylit::output::save(&wrong, &path.join("stairs.exr")).unwrap();
    let report = path.join("report");
    let out = verify(&["--junit", text(&junit), "--html", text(&report)]);
    assert_eq!(out.status.code(), Some(1));
    assert!(stderr(&out).contains("other.exr: an image of no frame"), "{}", stderr(&out));
    let lines = String::from_utf8(out.stdout).unwrap();
    assert!(
        lines.contains("DIFFERS  stairs") && lines.contains("standard errors") && lines.contains("1 hold, 1 differ"),
        "{lines}"
    );
    assert!(std::fs::read_to_string(&junit).unwrap().contains("failures=\"1\""));
    let page = std::fs::read_to_string(report.join("index.html")).unwrap();
    assert!(
        page.contains("stairs (") && page.contains("standard errors") && page.contains("1 differs from golden images"),
        "{page}"
    );
    assert!(report.join("data/images-1.js").exists() && lines.contains("report: file://"));
}

/// A map of a model is compared with its golden image, with every seed, and a part that moves is found.
#[test]
fn a_change_of_a_baked_map_is_found() {
    if !device() {
        return;
    }
    let options = "--map ao --atlas --size 32 --spp 64 --ao-radius 2";
    let frame = |name: &str, bake: &str, tolerance: &str| {
        format!(
            "[[frame]]\nname = \"{name}\"\nscene = \"corner.obj\"\nbake = \"{bake}\"\ntracers = [\"all\"]\ntolerance = {tolerance}\n"
        )
    };
    let light = "--map light --atlas --size 32 --spp 16 --environment 1,1,1";
    let flip = "{ flip = { percentile = 99, max = 0.05 } }";
    let dir = folder(&(frame("ao", options, "\"z_test\"") + &frame("light", light, flip)));
    let model = std::fs::read_to_string("tests/frames/corner.obj").unwrap();
    std::fs::copy("tests/frames/corner.mtl", dir.path().join("corner.mtl")).unwrap();
    std::fs::write(dir.path().join("corner.obj"), &model).unwrap();
    let verify = |more: &[&str]| run(&[&["verify", text(dir.path())], more].concat());
    let made = verify(&["--update-missing", "--force"]);
    assert!(made.status.success(), "{}", stderr(&made));
    for more in [&[][..], &["--seed", "7", "--filter", "ao"]] {
        let out = verify(more);
        assert!(out.status.success(), "{}{}", String::from_utf8_lossy(&out.stdout), stderr(&out));
    }

    // the top of the box sinks
    let sunk = model.replace(" 1.5 ", " 1 ");
    assert_ne!(sunk, model);
    std::fs::write(dir.path().join("corner.obj"), sunk).unwrap();
    let out = verify(&[]);
    let said = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(out.status.code() == Some(1) && !said.contains(" hold"), "{said}{}", stderr(&out));

    // one image: two materials have two
    let two = frame("two", "--map ao --size 32 --spp 64", "\"z_test\"");
    std::fs::write(dir.path().join("frames.toml"), two).unwrap();
    let out = verify(&["--update-missing", "--force"]);
    let said = String::from_utf8_lossy(&out.stdout).into_owned();
    assert_eq!(out.status.code(), Some(2));
    assert!(said.contains("has 2 textures, and a frame is one image: add --atlas or --only-material"), "{said}");
}
