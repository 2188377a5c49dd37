//! What a command line should be able to do beside its work: help, version, completions, manual pages, progress, and times that add up.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::common::command::{device, json, place, refuses, run, skylit, stderr};

fn stdout(args: &[&str]) -> String {
    let out = run(args);
    assert!(out.status.success() && out.stderr.is_empty(), "{args:?}: {}", stderr(&out));
    String::from_utf8(out.stdout).unwrap()
}

/// `-h` is a screen of what most people use, `--help` goes by task, `--help-all` has everything.
#[test]
fn three_helps() {
    let [short, long, all] = ["-h", "--help", "--help-all"].map(|option| stdout(&["render", option]));
    let lines = |text: &str| text.lines().count();
    assert!(lines(&short) <= 72 && lines(&short) < lines(&long) && lines(&long) < lines(&all), "{}", lines(&short));
    for (option, is_short, is_long) in [
        ("--spp", true, true),
        ("--ao-radius", true, true),
        ("--denoise", true, true),
        ("--preset", true, true),
        ("--pixel-filter", false, true),
        ("--resume", false, true),
        ("--no-config", false, true),
        ("--traversal", false, false),
        ("--min-depth", false, false),
        ("--dump-rays", false, false),
    ] {
        let has = |text: &str| text.split_whitespace().any(|word| word.trim_matches([',', '.']) == option);
        assert_eq!([has(&short), has(&long), has(&all)], [is_short, is_long, true], "{option}");
    }
    for help in [&short, &long, &all] {
        // examples first, then options by what they are about
        let at = |text: &str| help.find(text).unwrap_or_else(|| panic!("{text}: {help}"));
        assert!(
            at("Examples:") < at("Arguments:")
                && at("Arguments:") < at("Image:")
                && at("Camera:") < at("Ambient occlusion:")
        );
    }
    assert_eq!(all, stdout(&["render", "no-such.glb", "--help-all"]));
    assert_eq!(stdout(&["help", "render"]), long);
    assert_eq!(stdout(&["help", "compare", "ao-vs-path"]), stdout(&["compare", "ao-vs-path", "--help"]));
    assert_eq!(stdout(&["help"]), stdout(&["--help"]));
    refuses(&["help", "fly"], 64, "fly");
    for command in [
        "view",
        "compare",
        "verify",
        "bench rays",
        "bench report",
        "rays",
        "stress",
        "export",
        "convert",
        "diff",
        "scenes",
        "doctor",
        "completions",
    ] {
        let words: Vec<&str> = command.split(' ').chain(["--help"]).collect();
        assert!(stdout(&words).contains("Examples:\n  "), "{command}");
    }
}

/// One line for scripts, and what a bug report needs.
#[test]
fn versions() {
    let version = env!("CARGO_PKG_VERSION");
    assert_eq!(stdout(&["-V"]), format!("skylit {version}\n"));
    let text = stdout(&["--version"]);
    let values = |key: &str| text.lines().filter_map(|l| l.strip_prefix(key)).map(str::trim).collect::<Vec<_>>();
    assert_eq!(text.lines().next(), Some(&*format!("skylit {version}")));
    assert_eq!((values("commit").len(), values("features").len()), (1, 1), "{text}");
    let features: Vec<&str> = values("features")[0].split(", ").collect();
    assert!(
        ["bench", "cli", "compare"].iter().all(|f| features.contains(f)) && !features.contains(&"default"),
        "{text}"
    );
    assert!(!values("vulkan").is_empty(), "{text}");
    if device() {
        let record = json(&run(&["doctor", "--json"]));
        let devices = record["devices"].as_array().unwrap();
        assert_eq!(values("vulkan").len(), devices.len());
        for (line, device) in values("vulkan").iter().zip(devices) {
            assert!(["name", "driver"].iter().all(|key| line.contains(device[key].as_str().unwrap())), "{line}");
        }
    }
    // no device is no reason to fail
    let out = skylit(&["--version"])
        .env("VK_DRIVER_FILES", "/nonexistent")
        .env("VK_ICD_FILENAMES", "/nonexistent")
        .output()
        .unwrap();
    let text = String::from_utf8(out.stdout).unwrap();
    assert!(out.status.success() && text.contains("no device found") | text.contains("not available: "), "{text}");
}

/// The script completes in the shell that it is for.
#[test]
fn bash_completes_options_values_and_scenes() {
    if Command::new("bash").arg("--version").output().is_err() {
        println!("skipped: no bash");
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let script = place(&dir, "skylit.bash");
    std::fs::write(&script, stdout(&["completions", "bash"])).unwrap();
    // as the shell calls it: words split at colons, too
    let complete = |words: &str| {
        let test = r#"
            source "$1"; shift
            function_name=$(complete -p skylit | sed 's/.*-F \([^ ]*\).*/\1/')
            COMP_WORDS=("$@"); COMP_CWORD=$(( $# - 1 )); compopt() { :; }
            "$function_name" skylit "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD-1]}"
            printf '%s\n' "${COMPREPLY[@]}""#;
        let words: Vec<&str> = words.split(' ').collect();
        let out = Command::new("bash").args(["--norc", "-c", test, "bash", &script]).args(words).output().unwrap();
        assert!(out.status.success() && out.stderr.is_empty(), "{}", stderr(&out));
        let text = String::from_utf8(out.stdout).unwrap();
        text.split_whitespace().map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(complete("skylit ren"), ["render"]);
    assert_eq!(complete("skylit render x.glb --integrator di"), ["direct"]);
    assert_eq!(complete("skylit render x.glb --tone-map ag"), ["agx"]);
    assert_eq!(complete("skylit render x.glb --ao-radi"), ["--ao-radius"]);
    assert_eq!(complete("skylit render x.glb --trav"), ["--traversal"]);
    assert_eq!(complete("skylit render builtin : at"), ["atrium"]);
    // quoted, it is one word
    assert_eq!(complete("skylit render builtin:at"), ["builtin:atrium"]);
    assert_eq!(complete("skylit render bui").len(), stdout(&["scenes"]).lines().count());
    assert_eq!(complete("skylit compare --scene builtin : terr"), ["terrain"]);
    let scenes = complete("skylit render builtin : ");
    assert_eq!(scenes.len(), stdout(&["scenes"]).lines().count(), "{scenes:?}");
    assert!(scenes.contains(&"atrium".to_owned()));
    assert_eq!(complete("skylit help comp"), ["compare", "completions"]);
    for shell in ["zsh", "fish", "powershell", "elvish"] {
        assert!(stdout(&["completions", shell]).contains("filter-radius"), "{shell}");
    }
    refuses(&["completions", "tcsh"], 64, "bash");
}

/// A page for each command, which groff formats without a complaint.
#[test]
fn manual_pages() {
    let dir = tempfile::tempdir().unwrap();
    let folder = place(&dir, "man");
    assert!(stdout(&["man", &folder]).is_empty());
    let mut names: Vec<_> =
        std::fs::read_dir(&folder).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    for name in
        ["skylit.1", "skylit-render.1", "skylit-bench-ao.1", "skylit-compare-ao-vs-path.1", "skylit-completions.1"]
    {
        assert!(names.contains(&name.to_owned()), "{name}: {names:?}");
    }
    assert!(!names.iter().any(|n| n.contains("help") || n.contains("man")), "{names:?}");
    let read = |name: &str| std::fs::read_to_string(dir.path().join("man").join(name)).unwrap();
    // everything, with examples; and the table of exit codes as it is
    let page = read("skylit-render.1");
    assert!(page.contains(".SH EXAMPLES") && page.contains("rr\\-depth") && page.contains(".SH CAMERA"), "{page}");
    assert!(read("skylit.1").contains(".SH EXIT STATUS") && read("skylit.1").contains("  130  interrupted"));
    if Command::new("groff").arg("--version").output().is_ok() {
        for name in &names {
            let path = dir.path().join("man").join(name);
            let out = Command::new("groff").args(["-man", "-Tutf8", "-ww", "-z"]).arg(&path).output().unwrap();
            assert!(out.status.success() && out.stderr.is_empty(), "{name}: {}", stderr(&out));
        }
    }
    let file = place(&dir, "file");
    std::fs::write(&file, "").unwrap();
    refuses(&["man", &format!("{file}/below")], 4, "file/below");
}

/// The pages of docs/reference/commands are those of the program.
#[test]
fn pages_of_the_reference_are_up_to_date() {
    let dir = tempfile::tempdir().unwrap();
    let folder = place(&dir, "pages");
    assert!(stdout(&["man", &folder, "--format", "markdown"]).is_empty());
    let pages = |folder: &Path| -> BTreeMap<String, String> {
        let files = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path());
        files.map(|f| (f.file_name().unwrap().to_string_lossy().into(), std::fs::read_to_string(&f).unwrap())).collect()
    };
    let made = pages(folder.as_ref());
    let kept = pages(&Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/reference/commands"));
    let differ: Vec<_> = made.keys().chain(kept.keys()).filter(|name| made.get(*name) != kept.get(*name)).collect();
    assert!(differ.is_empty(), "pages differ from the help of the program: run `just reference` ({differ:?})");
    // all commands, and nothing of the tests' build
    assert!(made.len() > 20 && !made["view.md"].contains("headless-script"), "{:?}", made.keys());
}

/// The parts of a run add up to its total, and little of it has no name.
#[test]
fn gpu_times_add_up() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let (exr, png) = (place(&dir, "a.exr"), place(&dir, "a.png"));
    let still = ["render", "builtin:cornell-box", "--size", "96x64", "--spp", "2", "--integrator", "path", "-o", &exr];
    let frames = ["render", "builtin:cornell-box", "--size", "96x64", "--preset", "fast", "-o", &png];
    let (ao, path): (&[&str], &[&str]) = (
        &["open", "survey", "frames", "warm-up", "write"],
        &["open", "survey", "trace", "compile", "write", "denoise"],
    );
    // a view that is found by looking at the scene, which is the part `survey`
    let denoised = [&still[..], &["--denoise", "filter", "--view", "iso"]].concat();
    for (args, expected) in [(&denoised, path), (&frames.to_vec(), ao)] {
        let record = json(&run(&[&args[..], &["--json"]].concat()));
        let seconds = &record["seconds"];
        let parts = seconds["parts"].as_object().unwrap();
        let of = |name: &str| parts[name].as_f64().unwrap();
        for name in expected {
            assert!(of(name) > 0.0, "{name}: {seconds}");
        }
        let (sum, total): (f64, f64) =
            (parts.values().filter_map(Value::as_f64).sum(), seconds["total"].as_f64().unwrap());
        assert!((sum - total).abs() < 1e-6 * total, "{sum} of {seconds}");
        // what the program does beside: reading its arguments, composing the report
        assert!(of("other") < 0.05 + 0.05 * total, "{seconds}");
    }
    let text = |more: &[&str]| String::from_utf8(run(&[&still[..], more].concat()).stdout).unwrap();
    let line = text(&["--verbose"]);
    assert!(line.contains(" seconds: open ") && line.contains("(load 0."), "{line}");
    // what, how long, how sure
    let summary = text(&[]);
    let lines: Vec<&str> = summary.lines().collect();
    let [what, time, error] = lines[..] else { panic!("{summary}") };
    assert!(what.contains(": 96x64, 2 spp, path, on ") && time.contains(" seconds, "), "{summary}");
    assert!(error.starts_with("mean radiance ") && error.contains("; estimated rmse "), "{summary}");
}

/// A mean of one sample has no error, and of more it has one.
#[test]
fn gpu_an_error_is_printed_if_there_is_one() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let exr = place(&dir, "a.exr");
    let of = |spp: &str| stdout(&["render", "builtin:stairs", "--size", "32x24", "--spp", spp, "-o", &exr]);
    assert!(!of("1").contains("+-") && of("16").contains(" +- 0.0"), "{}", of("16"));
}

/// A log gets lines, a terminal would get a bar; whoever wants neither gets none.
#[test]
fn gpu_progress_in_a_log() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let png = place(&dir, "a.##.png");
    let lines = |options: &[&str], seconds: &str| {
        let args = [
            "render",
            "builtin:stairs",
            "--size",
            "64x48",
            "--preset",
            "fast",
            "--frames",
            "0..40",
            "--orbit",
            "-o",
            &png,
        ];
        let out = skylit(&[&args[..], options].concat()).env("SKYLIT_PROGRESS_SECONDS", seconds).output().unwrap();
        assert!(out.status.success(), "{}", stderr(&out));
        stderr(&out).lines().filter(|l| l.starts_with("skylit: rendering: ")).map(str::to_owned).collect::<Vec<_>>()
    };
    let shown = lines(&[], "0.02");
    assert!(
        (3..40).contains(&shown.len()) && shown[0].contains(" % after ") && shown[0].ends_with(" left"),
        "{shown:?}"
    );
    for (options, seconds) in [(&["--quiet"][..], "0.001"), (&["--json"], "0.001"), (&[], "0"), (&[], "10")] {
        assert!(lines(options, seconds).is_empty(), "{options:?}");
    }
}

/// Loading is shown, too: how many of a file's textures are decoded.
#[test]
fn progress_of_loading() {
    const TEXTURES: usize = 40;
    let dir = tempfile::tempdir().unwrap();
    for k in 0..TEXTURES {
        let texels = image::RgbaImage::from_fn(1024, 1024, |x, y| image::Rgba([x as u8, y as u8, k as u8, 255]));
        texels.save(place(&dir, &format!("{k}.png"))).unwrap();
    }
    let triangle: Vec<u8> =
        [0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    std::fs::write(place(&dir, "t.bin"), triangle).unwrap();
    let list = |entry: &dyn Fn(usize) -> Value| (0..TEXTURES).map(entry).collect::<Vec<_>>();
    let file = serde_json::json!({
        "asset": { "version": "2.0" },
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "buffers": [{ "uri": "t.bin", "byteLength": 36 }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }],
        "meshes": [{ "primitives": list(&|k| serde_json::json!({ "attributes": { "POSITION": 0 }, "material": k })) }],
        "images": list(&|k| serde_json::json!({ "uri": format!("{k}.png") })),
        "textures": list(&|k| serde_json::json!({ "source": k })),
        "materials": list(&|k| serde_json::json!({ "pbrMetallicRoughness": { "baseColorTexture": { "index": k } } })),
    });
    let path = place(&dir, "many.gltf");
    std::fs::write(&path, file.to_string()).unwrap();
    let lines = |options: &[&str], seconds: &str| {
        let args = [&["info", &path, "--no-device"], options].concat();
        // on one thread it takes long enough for a look at it
        let out = skylit(&args).env("SKYLIT_PROGRESS_SECONDS", seconds).env("RAYON_NUM_THREADS", "1").output().unwrap();
        assert!(out.status.success(), "{}", stderr(&out));
        let shown = |l: &&str| l.starts_with("skylit: loading many.gltf: ") && l.contains(" % after ");
        stderr(&out).lines().filter(shown).count()
    };
    assert!((1..TEXTURES).contains(&lines(&[], "0.01")));
    for (options, seconds) in [(&["--json"][..], "0.001"), (&[], "0"), (&[], "60")] {
        assert_eq!(lines(options, seconds), 0, "{options:?}");
    }
}
