//! `skylit stress`: a line for each check, a record, a page, and how it ends.

use crate::common::command::{device, json, refuses, run};

#[test]
fn sections_that_do_not_exist_are_refused() {
    refuses(&["stress", "--sections", "nothing"], 64, "watertight");
    refuses(&["stress", "--sections", "scene"], 64, "name one");
    refuses(&["stress", "builtin:stairs", "--sections", "scale"], 64, "leave SCENE out");
    refuses(&["stress", "--quick", "--full"], 64, "--full");
    refuses(&["stress", "nowhere.glb"], 3, "nowhere.glb");
}

#[test]
fn gpu_checks_are_chosen_by_their_names() {
    if !device() {
        return;
    }
    fn of<'a>(more: &[&'a str]) -> Vec<&'a str> {
        [&["stress", "--sections", "display,determinism", "--tracer", "compute"], more].concat()
    }
    // the second is compared with an image of a check that is left out
    let out = run(&of(&["--json", "--checks", "agx", "--checks", "LP_NUM_THREADS=1"]));
    let record = json(&out);
    let names: Vec<_> = record["checks"].as_array().unwrap().iter().map(|c| c["name"].as_str().unwrap()).collect();
    let agx = ["tone map agx is monotone", "tone map agx of NaN, infinity and 1e30"];
    // of CPU drivers alone
    let threads = ["LP_NUM_THREADS=1"];
    assert!(names[..2] == agx && (names.len() == 2 || names[2..] == threads), "{names:?}");
    assert_eq!(out.status.code(), Some(0), "{record}");
    refuses(&of(&["--checks", "no such check"]), 64, "'no such check' in its name");
}

#[test]
fn gpu_a_scene_is_examined() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let page = dir.path().join("report");
    let out = run(&["stress", "builtin:far-away", "--tracer", "compute", "--json", "--html", page.to_str().unwrap()]);
    let record = json(&out);
    assert_eq!((out.status.code(), record["schema"].as_u64()), (Some(0), Some(1)), "{record}");
    let checks = record["checks"].as_array().unwrap();
    let of = |name: &str| checks.iter().find(|c| c["name"] == name).unwrap_or_else(|| panic!("{name}: {record}"));
    let origin = of("step of the scene for tracers");
    assert!(origin["sentence"].as_str().unwrap().starts_with("the origin was moved"), "{origin}");
    assert_eq!((of("open edges")["verdict"].as_str(), of("open edges")["bound"].is_null()), (Some("reported"), true));
    let rays = of("rays at shared edges");
    assert_eq!(
        (rays["tracer"].as_str(), rays["verdict"].as_str(), rays["value"].as_f64()),
        (Some("compute"), Some("holds"), Some(0.0))
    );
    assert!(std::fs::read_to_string(page.join("index.html")).unwrap().contains("hits against the f64 oracle"));
    let text = String::from_utf8(run(&["stress", "builtin:plane", "--tracer", "compute"]).stdout).unwrap();
    assert!(
        text.contains("figure cpu      open edges: 4 edges; 4 open edges: AO leaks there by construction"),
        "{text}"
    );
    assert_eq!(run(&["stress", "builtin:plane", "--tracer", "compute", "--quiet"]).stdout, b"");
}
