//! `skylit compare`: files and renders, numbers, pictures, the report.

use std::path::Path;

use serde_json::Value;
use skylit::output::picture::Picture;
use skylit::output::png::Colour;
use skylit::output::{self, Channel, Image, Samples};

use crate::common::command::{device, fails, json, place, refuses, run, stderr};

/// Writes an image of 8 x 4 pixels whose channels have these values.
pub(crate) fn write(
    dir: &tempfile::TempDir,
    name: &str,
    channels: &[(&str, &dyn Fn(usize) -> f32)],
    metadata: &[(&str, &str)],
) -> String {
    let samples = |value: &dyn Fn(usize) -> f32| Samples::F32((0..32).map(value).collect());
    let channels =
        channels.iter().map(|(name, value)| Channel { name: (*name).into(), samples: samples(value) }).collect();
    let metadata = metadata.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    let path = place(dir, name);
    output::save(&Image { width: 8, height: 4, channels, metadata }, path.as_ref()).unwrap();
    path
}

#[test]
fn numbers_of_files() {
    let dir = tempfile::tempdir().unwrap();
    let a = write(&dir, "a.exr", &[("Y", &|k| if k < 8 { 0.7 } else { 0.5 })], &[("camera", "1")]);
    let b = write(&dir, "b.exr", &[("Y", &|_| 0.5)], &[("camera", "2")]);
    let c = write(&dir, "c.exr", &[("Y", &|_| 0.25)], &[]);
    let out = run(&["compare", &a, &b, &c]);
    assert!(out.status.success(), "{}", stderr(&out));
    assert!(stderr(&out).contains("A and B differ in their camera (1; 2)"), "{}", stderr(&out));
    let text = String::from_utf8(out.stdout).unwrap();
    let row = |name: &str| text.lines().find(|l| l.starts_with(name)).unwrap_or_else(|| panic!("{text}")).to_owned();
    assert!(row("B (reference)").contains("b.exr"));
    assert_eq!(row("RMSE").split_whitespace().collect::<Vec<_>>(), ["RMSE", "0.1000", "0.2500"]);
    assert!(row("Bias").contains("+0.0500") && row("Bias").contains("-0.2500"), "{text}");

    let record = json(&run(&["compare", &a, &b, &c, "--json", "--reference", "c", "--rectangle", "0,0,8,1"]));
    let metrics = |k: usize| &record["images"][k]["metrics"];
    assert!((metrics(0)["rmse"].as_f64().unwrap() - 0.45).abs() < 1e-6 && metrics(2).is_null(), "{record}");
    assert_eq!((metrics(1)["pixels"].as_u64(), record["reference"].as_str()), (Some(8), Some("C")));
    // C has no camera to disagree with
    assert_eq!(record["warnings"].as_array().map(Vec::len), Some(0));
    assert!(run(&["compare", &a, &b, "--quiet"]).stdout.is_empty());
}

#[test]
fn only_pixels_of_the_mask() {
    let dir = tempfile::tempdir().unwrap();
    let covered = |k: usize| f32::from(u8::from(k >= 16));
    let bright = |k: usize| covered(k) * if k < 24 { 0.6 } else { 0.5 };
    let a = write(&dir, "a.exr", &[("Y", &bright), ("A", &covered)], &[]);
    let b = write(&dir, "b.exr", &[("Y", &|k| 0.5 * covered(k)), ("A", &covered)], &[]);
    let of = |options: &[&str]| {
        let record = json(&run(&[&["compare", &a, &b, "--json"], options].concat()));
        let metrics = record["images"][0]["metrics"].clone();
        (metrics["pixels"].as_u64().unwrap(), (metrics["bias"].as_f64().unwrap() * 1e4).round() as i64)
    };
    assert_eq!([of(&[]), of(&["--mask", "all"])], [(16, 500), (32, 250)]);
    assert_eq!(of(&["--rectangle", "0,0,4,3"]), (4, 1000));
    assert_eq!(of(&["--channels", "A", "--mask", "all"]), (32, 0));
    refuses(&["compare", &a, &b, "--instance", "1"], 64, "--aov ids");
    refuses(&["compare", &a, &b, "--rectangle", "6,0,4,4"], 64, "not inside the image of 8x4");
}

#[test]
fn pictures_and_the_report() {
    let dir = tempfile::tempdir().unwrap();
    let of = |shift: f32| move |k: usize| 0.3 + 0.02 * k as f32 + shift;
    let rgb = |name: &str, shift: f32| {
        write(&dir, name, &[("R", &of(shift)), ("G", &of(0.0)), ("B", &of(-shift))], &[("scene", "<script>")])
    };
    let (a, b) = (rgb("a.exr", 0.1), rgb("b <1>.exr", 0.0));
    let [difference, flip, report] = ["d.png", "f.png", "report"].map(|n| place(&dir, n));
    let out = run(&["compare", &a, &b, "--difference", &difference, "--flip", &flip, "--html", &report]);
    assert!(out.status.success(), "{}", stderr(&out));
    let text = String::from_utf8(out.stdout).unwrap();
    let address = text.lines().last().unwrap().strip_prefix("report: file:///").unwrap();
    assert!(address.ends_with("/report/index.html"), "{address}");
    for picture in [&difference, &flip] {
        let picture = output::load(picture.as_ref()).unwrap();
        // the image, and a legend that needs more room
        assert!(picture.width > 8 && picture.height > 4);
    }
    let page = std::fs::read_to_string(Path::new(&report).join("index.html")).unwrap();
    assert!(page.contains("b &lt;1&gt;.exr") && !page.contains("<script>\"") && page.contains("&lt;script&gt;"));
    assert!(!page.contains("http://") && !page.contains("https://") && page.contains("data/images-1.js"));
    assert!(Path::new(&report).join("data/images-1.js").is_file());

    let c = rgb("c.exr", -0.1);
    let out = run(&["compare", &a, &b, &c, "--difference", &difference, "--json"]);
    let pictures: Vec<String> = serde_json::from_value(json(&out)["pictures"].clone()).unwrap();
    assert_eq!(pictures, [place(&dir, "d.a.png"), place(&dir, "d.c.png")]);
    assert!(pictures.iter().all(|p| Path::new(p).is_file()));
}

#[test]
fn images_that_do_not_fit_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let a = write(&dir, "a.exr", &[("Y", &|_| 0.5)], &[]);
    let hdr = write(&dir, "hdr.exr", &[("Y", &|_| 3.0)], &[]);
    let depth = write(&dir, "depth.exr", &[("depth.Z", &|_| 3.0)], &[]);
    let png = place(&dir, "a.png");
    let grey = |values: Vec<u8>, size| Picture::of_bytes(values, size, Colour::Grey).unwrap();
    grey(vec![128; 32], [8, 4]).save(png.as_ref(), 90).unwrap();
    let small = place(&dir, "small.png");
    grey(vec![128; 16], [4, 4]).save(small.as_ref(), 90).unwrap();
    fails(&run(&["compare", &a, &small]), 1, &["A (a.exr) against B (small.png)", "8x4 and 4x4"]);
    fails(&run(&["compare", &png, &hdr]), 64, &["differ in encoding", "8-bit sRGB", "up to 3"]);
    fails(&run(&["compare", &a, &depth]), 64, &["no colour", "depth.Z", "--channels"]);
    fails(&run(&["compare", &a, &depth, "--channels", "depth.Z"]), 64, &["A (a.exr)", "no channel depth.Z"]);
    // FLIP is for colours
    let flip = place(&dir, "f.png");
    fails(&run(&["compare", &depth, &depth, "--channels", "depth.Z", "--flip", &flip]), 64, &["FLIP is for colours"]);
    assert!(!Path::new(&flip).exists());
    refuses(&["compare", &a, &place(&dir, "none.exr")], 3, "no such file");
}

#[test]
fn wrong_usage() {
    refuses(&["compare"], 64, "two images are needed");
    refuses(&["compare", "a.exr"], 64, "two images are needed");
    refuses(&["compare", "a.exr", "b.exr", "--reference", "C"], 64, "there are 2 images, A to B");
    refuses(&["compare", "a.exr", "b.exr", "--reference", "7"], 64, "letter of an image");
    refuses(&["compare", "a.exr", "b.exr", "--rectangle", "1,2,3"], 64, "X,Y,WIDTH,HEIGHT");
    refuses(&["compare", "a.exr", "b.exr", "--difference", "d.exr"], 64, ".png");
    refuses(&["compare", "a.exr", "b.exr", "--spp", "4"], 64, "--spp is for renders");
    refuses(&["compare", "a.exr", "b.exr", "--scene", "builtin:plane"], 64, "nothing is rendered");
    refuses(&["compare", "a.exr", "--a", "ao"], 64, "--scene");
    refuses(&["compare", "--scene", "builtin:plane", "--b", "ao"], 64, "image A is missing");
    refuses(&["compare", "--scene", "builtin:plane", "--a", "ao", "--b", "oa"], 64, "oa");
    refuses(
        &["compare", "--scene", "builtin:plane", "--a", "ao", "--b", "ao --max-depth 2"],
        64,
        "--max-depth has no effect",
    );
    refuses(
        &["compare", "--scene", "builtin:plane", "--a", "fast", "--b", "ao", "--frames", "0..4"],
        64,
        "\"ao\": --frames makes a still of each frame",
    );
    refuses(&["compare", "a.exr", "b.exr", "--ao-radius", "2"], 64, "--ao-radius is for renders");
    refuses(&["compare", "a.exr", "b.exr", "--csv", "/dev/null/a.csv"], 4, "/dev/null/a.csv");
    refuses(
        &["compare", "--scene", "builtin:plane", "--a", "ao", "--b", "ao", "--environment", "1,1,1"],
        64,
        "on any of the renders",
    );
    refuses(&["compare", "a.exr", "b.exr", "--html", "/dev/null/report"], 4, "/dev/null/report");
}

/// Renders on the spot are the images that `render` makes, and files take the letters that are left.
#[test]
fn gpu_renders() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let [file, saved, report] = ["ao.exr", "saved", "report"].map(|n| place(&dir, n));
    let scene = ["--scene", "builtin:stairs", "--size", "48x27"];
    let out = run(&["render", "builtin:stairs", "--size", "48x27", "--spp", "4", "-o", &file]);
    assert!(out.status.success(), "{}", stderr(&out));
    let words = [
        "compare",
        &file,
        "--b",
        "ao --spp 4",
        "--c",
        "path --spp 4 --environment 1,1,1",
        "--c",
        "fast --frames 2 --antialias off",
        "--instance",
        "0",
    ];
    let record = json(&run(&[&words[..], &scene, &["--save", &saved, "--html", &report, "--json"]].concat()));
    let metric = |k: usize, name: &str| record["images"][k]["metrics"][name].as_f64();
    assert_eq!((metric(0, "rmse"), metric(0, "differing")), (Some(0.0), Some(0.0)), "{record}");
    assert!(metric(2, "rmse").unwrap() > 0.01 && metric(3, "pixels").unwrap() > 0.0, "{record}");
    // outliers are told by the variance that stills have
    assert!(record["images"][0]["metrics"]["reference_standard_error"].is_f64(), "{record}");
    let warnings = record["warnings"].to_string();
    assert!(warnings.contains("D and B differ in their pixel filter (centre; box)"), "{warnings}");
    let names: Vec<Value> = record["images"].as_array().unwrap().iter().map(|i| i["name"].clone()).collect();
    assert_eq!(names, ["ao.exr", "ao --spp 4", "path --spp 4 --environment 1,1,1", "fast --frames 2 --antialias off"]);
    let of = |name: &str| output::load(&Path::new(&saved).join(name)).unwrap();
    let (ours, theirs) = (of("b.exr"), output::load(file.as_ref()).unwrap());
    assert!(ours.f32("Y") == theirs.f32("Y") && ours.metadata("spp") == Some("4"));
    assert!(of("c.exr").f32("G").is_some() && of("d.exr").metadata("preset") == Some("fast"));
    assert!(!Path::new(&saved).join("a.exr").exists());
    assert!(std::fs::read_to_string(Path::new(&report).join("index.html")).unwrap().contains("pixel filter"));
}

/// What filters and histories do shows in the first frame, or in motion: at rest an image has converged.
#[test]
fn gpu_presets_have_a_first_frame() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let [csv, saved] = ["table.csv", "saved"].map(|n| place(&dir, n));
    let scene = ["compare", "--scene", "builtin:stairs", "--size", "48x27", "--ao-radius", "2", "--json"];
    let of = |options: &[&str]| json(&run(&[&scene[..], options].concat()));
    let record = of(&[
        "--a",
        "balanced --filter none",
        "--c",
        "balanced",
        "--b",
        "ao --spp 64",
        "--csv",
        &csv,
        "--save",
        &saved,
    ]);
    let images = record["images"].as_array().unwrap();
    let names: Vec<&str> = images.iter().map(|i| i["name"].as_str().unwrap()).collect();
    let first = ["balanced --filter none --warm-up 0", "balanced --warm-up 0"];
    assert_eq!(names, ["balanced --filter none", "ao --spp 64", "balanced", first[0], first[1]]);
    let rmse = |k: usize| images[k]["metrics"]["rmse"].as_f64().unwrap();
    let description = |k: usize| images[k]["description"].as_str().unwrap();
    assert!(description(0).contains("at rest") && description(3).contains("the first frame"), "{record}");
    // filters: all but the same at rest, and what makes the first frame clean
    assert!((rmse(0) / rmse(2) - 1.0).abs() < 0.3 && rmse(3) > 1.5 * rmse(4) && rmse(3) > 3.0 * rmse(0), "{record}");
    let warnings = record["warnings"].to_string();
    assert!(warnings.contains("A (balanced --filter none): --filter has next to no effect on frame "), "{warnings}");
    // the radius is that of all
    for k in ["a", "b", "e"] {
        let image = output::load(&Path::new(&saved).join(format!("{k}.exr"))).unwrap();
        assert_eq!(image.metadata("ao.radius"), Some("2"), "{k}");
    }
    // the same numbers as a table
    let mut table = csv::Reader::from_path(&csv).unwrap();
    let column = table.headers().unwrap().iter().position(|name| name == "rmse").unwrap();
    let rows: Vec<f64> = table.records().map(|row| row.unwrap()[column].parse().unwrap()).collect();
    assert_eq!(rows, [rmse(0), rmse(2), rmse(3), rmse(4)]);

    // as asked: in motion all have the same camera, and a history that is kept has its filter
    let motion = [
        "--a",
        "balanced",
        "--b",
        "ao",
        "--c",
        "balanced --filter none",
        "--frames",
        "0..4",
        "--orbit",
        "40",
        "--spp",
        "16",
    ];
    let record = of(&motion);
    assert_eq!(record["images"].as_array().unwrap().len(), 3, "{record}");
    assert!(!record["warnings"].to_string().contains("differ in their camera"), "{record}");
    let record = of(&["--a", "balanced --filter none", "--b", "ao --spp 64", "--at-rest", "hold"]);
    assert!(!record["warnings"].to_string().contains("next to no effect"), "{record}");
    // an option that does nothing
    let record = of(&["--a", "fast --warm-up 0", "--b", "ao --spp 4", "--c", "fast --warm-up 0 --at-rest hold"]);
    assert!(record["warnings"].to_string().contains("A and C are the same in every bit"), "{record}");
}

/// A folder for results that is made before anything is read is not there afterwards, if nothing was written into it.
#[test]
fn gpu_folders_of_results_that_did_not_come() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let folder = place(&dir, "new/of/report");
    let table = place(&dir, "new/of/report/table.csv");
    let missing = place(&dir, "none.gltf");
    for args in [
        &["compare", &missing, &missing, "--html", &folder, "--csv", &table][..],
        &["compare", "--scene", &missing, "--a", "ao", "--b", "ao-sky", "--save", &folder],
        &["compare", "ao-vs-path", &missing, "--html", &folder],
        &["bench", "report", &missing, "--html", &folder],
        &["bench", "rays", &missing, "--html", &folder],
    ] {
        let out = run(args);
        assert!(!out.status.success(), "{args:?}");
        assert!(stderr(&out).contains("none.gltf"), "{args:?}: {}", stderr(&out));
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0, "{args:?}");
    }
    // a folder that was there stays
    std::fs::create_dir_all(&folder).unwrap();
    assert!(!run(&["compare", &missing, &missing, "--html", &folder]).status.success());
    assert!(Path::new(&folder).is_dir());
}
