//! `skylit compare ao-vs-path` from outside.

use crate::common::command::{device, json, place, refuses, run, stderr};

const SMALL: [&str; 6] = ["--size", "48x32", "--spp", "8", "--ao-samples", "16"];

#[test]
fn gpu_compare_ao_says_what_fits_best() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let (plot, layers) = (place(&dir, "curve.svg"), place(&dir, "layers.exr"));
    let html = place(&dir, "report");
    let outputs = ["--json", "--plot", &plot, "-o", &layers, "--html", &html];
    let out = run(&[&["compare", "ao-vs-path", "builtin:stairs"], &outputs[..], &SMALL].concat());
    let record = json(&out);
    assert!(stderr(&out).is_empty(), "{}", stderr(&out));
    let choices = record["choices"].as_array().unwrap();
    assert!(choices.len() == 1 && choices[0].as_str().unwrap().starts_with("light: the scene has none"), "{record}");
    assert!(record["chosen"].as_str().unwrap().contains("--light 'sun"), "{record}");
    let fits = record["path"].as_array().unwrap();
    let stands_for: Vec<_> = fits.iter().map(|f| f["environment_light"].as_str().unwrap()).collect();
    assert_eq!(stands_for, ["ambient", "traced"]);
    for fit in fits.iter().chain([&record["sky"]]) {
        assert!(fit["rows"].as_array().unwrap().len() >= 6 && fit["best"]["rmse"].as_f64().unwrap() >= 0.0, "{fit}");
        assert!(fit["curves"][0]["radii"].as_array().unwrap().len() > 20, "{fit}");
    }
    let page = std::fs::read_to_string(dir.path().join("report/index.html")).unwrap();
    assert!(page.contains("AO with the best radius") && page.contains("Error over radius"));
    let drawn = std::fs::read_to_string(&plot).unwrap();
    assert!(
        drawn.starts_with("<svg") && drawn.contains("AO radius, scene units") && drawn.contains("binary"),
        "{drawn}"
    );
    let image = skylit::output::load(layers.as_ref()).unwrap();
    assert_eq!((image.width, image.height), (48, 32));
    for channel in ["R", "path.G", "direct.B", "ao.Y", "sky.Y"] {
        assert!(image.f32(channel).is_some_and(|v| v.iter().all(|v| v.is_finite())), "{channel}");
    }
    // as text, with a command that renders the best; that no sky gets into a closed room is nothing to warn about
    let out = run(&[&["compare", "ao-vs-path", "builtin:cornell-box"], &SMALL[..]].concat());
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(!stderr(&out).contains("all but black"), "{}", stderr(&out));
    assert!(out.status.success() && !text.contains("NaN"), "{text}");
    assert!(text.contains("AO with the best radius") && text.contains("Ambient visibility against ao-sky"), "{text}");
    let command =
        text.lines().find(|l| l.starts_with("skylit render builtin:cornell-box --integrator lit")).expect(&text);
    let image = place(&dir, "lit.exr");
    // of options that are given twice the last one counts
    let command = command.strip_suffix(" -o lit.exr").unwrap();
    let words: Vec<&str> = command.split(' ').skip(1).chain(["-o", &image, "--size", "48x32", "--spp", "4"]).collect();
    assert!(run(&words).status.success(), "{command}");
}

#[test]
fn compare_ao_refuses_what_makes_no_sense() {
    refuses(&["compare", "ao-vs-path", "builtin:plane", "-o", "a.png"], 64, ".exr");
    refuses(&["compare", "ao-vs-path", "builtin:plane", "--plot", "a.pdf"], 64, ".svg");
    refuses(&["compare", "ao-vs-path", "builtin:plane", "--spp", "1"], 64, "--spp");
    refuses(&["compare", "ao-vs-path", "builtin:plane", "--sky-albedo", "0"], 64, "--sky-albedo");
    refuses(&["compare", "ao-vs-path", "builtin:plane", "--json=a.json"], 64, "--json > FILE");
    refuses(&["render", "builtin:plane", "-o", "a.png", "--integrator", "depth", "--preset", "fast"], 64, "--preset");
    refuses(&["render", "builtin:plane", "-o", "a.png", "--ambient", "1,1,1"], 64, "--integrator lit");
    if !device() {
        return;
    }
    refuses(&["compare", "ao-vs-path", "no-such-file.glb"], 3, "no-such-file.glb");
    let away = [
        "compare",
        "ao-vs-path",
        "builtin:plane",
        "--eye",
        "0,5,0",
        "--target",
        "0,9,0",
        "--up",
        "1,0,0",
        "--size",
        "16x16",
    ];
    refuses(&away, 3, "shows no surface");
    let many = ["compare", "ao-vs-path", "builtin:plane", "--size", "4096x4096", "--ao-samples", "4096"];
    refuses(&many, 64, "--ao-samples");
}
