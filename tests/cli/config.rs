//! Files of defaults: what is read, what replaces what, what is said of it, and who reads none.

use std::path::Path;
use std::process::Output;

use serde_json::{Value, json as value};

use crate::common::command::{device, fails, json, place, skylit, stderr};

/// A folder with a scene, and one with the user's configuration.
struct Place {
    dir: tempfile::TempDir,
}

impl Place {
    fn new(user: &str, beside: &str) -> Self {
        let dir = tempfile::tempdir().unwrap();
        for (folder, text) in [("config/skylit", user), ("scenes", beside)] {
            let folder = dir.path().join(folder);
            std::fs::create_dir_all(&folder).unwrap();
            if !text.is_empty() {
                std::fs::write(folder.join("skylit.toml"), text).unwrap();
            }
        }
        let place = Self { dir };
        let out = skylit(&["export", "builtin:stairs", &place.at("scenes/stairs.glb"), "--quiet"]).output().unwrap();
        assert!(out.status.success(), "{}", stderr(&out));
        place
    }

    fn at(&self, name: &str) -> String {
        place(&self.dir, name)
    }

    fn run(&self, line: &str) -> Output {
        let words: Vec<String> =
            line.split(' ').map(|w| w.replace('@', &format!("{}/", self.dir.path().display()))).collect();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        skylit(&words).env("XDG_CONFIG_HOME", self.dir.path().join("config")).output().unwrap()
    }

    fn record(&self, line: &str) -> Value {
        json(&self.run(&format!("{line} --json")))
    }
}

fn wrote(folder: &Path) -> usize {
    std::fs::read_dir(folder)
        .unwrap()
        .filter(|f| f.as_ref().unwrap().path().extension().is_some_and(|e| e == "exr"))
        .count()
}

#[test]
fn gpu_files_settings_and_options_in_their_order() {
    if !device() {
        return;
    }
    let user = "[image]\nspp = 2\nseed = 1\nsize = [32, 16]\n[integrators.path]\nmax_depth = 3\n[frames]\nhistory = 4\n[device]\nvalidation = true";
    let place = Place::new(user, "[image]\nseed = 2\nsize = [16, 16]\n[integrators.ao]\nao_radius = 1.5");
    std::fs::write(place.at("s.toml"), "[image]\nsize = [16, 8]").unwrap();
    std::fs::write(place.at("s.json"), r#"{"image":{"size":[24,8]}}"#).unwrap();
    let of = |record: &Value| ["spp", "seed", "width", "height"].map(|key| record[key].as_u64().unwrap());

    // the folder of the user, then that of the scene
    let render = "render @scenes/stairs.glb -o @a.exr";
    let record = place.record(render);
    assert_eq!((of(&record), record["ao"]["radius"].as_f64()), ([2, 2, 16, 16], Some(1.5)));
    let [first, second] = [0, 1].map(|k| record["defaults"][k].clone());
    assert_eq!(first["settings"], value!({ "device.validation": true, "image.spp": 2 }));
    // of another integrator, and of frames in real time: no error, and no frames
    assert_eq!(first["unused"], value!(["frames.history", "integrators.path.max_depth"]));
    assert_eq!(first["file"].as_str(), Some(&*place.at("config/skylit/skylit.toml")));
    assert_eq!(
        second["settings"],
        value!({ "image.seed": 2, "image.size": [16, 16], "integrators.ao.ao_radius": 1.5 })
    );
    assert_eq!(second["file"].as_str(), Some(&*place.at("scenes/skylit.toml")));

    // then a file of settings, .toml or .json, then options
    assert_eq!(of(&place.record(&format!("{render} --settings @s.toml"))), [2, 2, 16, 8]);
    assert_eq!(of(&place.record(&format!("{render} --settings @s.json --seed 7"))), [2, 7, 24, 8]);
    // built-in scenes are in no folder
    assert_eq!(of(&place.record("render builtin:stairs -o @a.exr")), [2, 1, 32, 16]);
    // a limit that is lifted again
    assert_eq!(place.record(&format!("{render} --ao-radius inf"))["ao"]["radius"], Value::Null);

    // what applies to frames in real time, and to paths
    let frames = place.record(&format!("{render} --preset fast"));
    assert_eq!((&frames["settings"]["history"], &frames["settings"]["radius"]), (&value!(4), &value!(1.5)));
    let path = place.record(&format!("{render} --integrator path"));
    assert_eq!(
        (path["max_depth"].as_u64(), path["defaults"][1]["unused"][0].as_str()),
        (Some(3), Some("integrators.ao.ao_radius"))
    );

    // without files
    let record = place.record(&format!("{render} --no-config --size 16x16"));
    assert_eq!((of(&record)[0], &record["defaults"]), (16, &value!([])));

    // said on stderr, unless --quiet
    let said = stderr(&place.run(render));
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines.len(), 2, "{said}");
    assert!(lines[0].starts_with("skylit: defaults from ") && lines[0].contains("image.spp = 2"), "{said}");
    assert!(lines[0].ends_with("; without effect here: frames.history, integrators.path.max_depth"), "{said}");
    assert!(stderr(&place.run(&format!("{render} --quiet"))).is_empty());
}

#[test]
fn wrong_files_are_named_with_the_key() {
    let place = Place::new("", "");
    let user = place.at("config/skylit/skylit.toml");
    for (text, says) in [
        ("[image]\nsppp = 2", "unknown field `sppp`"),
        ("[devices]\ntracer = \"query\"", "unknown field `devices`"),
        ("[image]\nspp = 0", "--spp"),
        ("integrator = \"magic\"", "magic"),
        ("[image", "line 1"),
    ] {
        std::fs::write(&user, text).unwrap();
        fails(&place.run("render builtin:stairs -o @a.exr"), 3, &["config/skylit/skylit.toml: ", says]);
    }
    // beside the scene, too, and in files of settings
    std::fs::remove_file(&user).unwrap();
    std::fs::write(place.at("scenes/skylit.toml"), "spp = 3").unwrap();
    fails(&place.run("render @scenes/stairs.glb -o @a.exr"), 3, &["scenes/skylit.toml: ", "unknown field `spp`"]);
    fails(&place.run("render builtin:stairs --settings @scenes/skylit.toml -o @a.exr"), 3, &["unknown field `spp`"]);
    // what comes with a scene chooses neither files nor devices
    std::fs::write(place.at("scenes/skylit.toml"), "[device]\ntracer = \"compute\"\nbvh_cache = \"../../x\"").unwrap();
    let refused = ["scenes/skylit.toml: ", "device.bvh_cache, device.tracer", "--no-config"];
    fails(&place.run("render @scenes/stairs.glb -o @a.exr"), 3, &refused);
    fails(&place.run("render @scenes/stairs.glb -o @a.exr --quiet"), 3, &refused);
    assert!(!place.dir.path().join("../x").exists());
    // a setting that is given has to have an effect, a default has not
    fails(&place.run("render builtin:stairs --max-depth 3 -o @a.exr"), 64, &["--max-depth has no effect"]);
    assert_eq!(wrote(place.dir.path()), 0);
}

/// Golden images depend on nobody's files, nor do comparisons.
#[test]
fn gpu_verify_and_compare_read_no_defaults() {
    if !device() {
        return;
    }
    // reading it would be an error
    let wrong = "[image]\nsppp = 2";
    let place = Place::new(wrong, wrong);
    fails(&place.run("render @scenes/stairs.glb -o @a.exr"), 3, &["sppp"]);
    let frame = "[[frame]]\nname = \"a\"\nscene = \"stairs.glb\"\nrender = \"ao --size 16x16 --spp 4\"\ntolerance = \"exact\"\n";
    std::fs::write(place.at("scenes/frames.toml"), frame).unwrap();
    let record = place.record("verify @scenes --bless --force");
    assert_eq!(record["frames"].as_array().map(Vec::len), Some(1));
    // files that could be read, and would change the image
    for folder in ["config/skylit", "scenes"] {
        std::fs::write(
            place.at(&format!("{folder}/skylit.toml")),
            "[image]\nseed = 9\n[integrators.ao]\nao_radius = 0.01",
        )
        .unwrap();
    }
    assert!(place.run("verify @scenes").status.success());
    let out = place.run("compare --scene @scenes/stairs.glb --a ao --b ao --size 16x16 --spp 4");
    assert!(out.status.success() && !stderr(&out).contains("defaults"), "{}", stderr(&out));
}
