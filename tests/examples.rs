//! The examples that people copy: each renders a small scene and says something true of it.

// the examples have a `main` besides what is called here
#![allow(dead_code, reason = "`main` of an example is not called by a test")]

#[path = "../examples/custom_pass.rs"]
mod custom_pass;
#[path = "../examples/frames.rs"]
mod frames;
#[path = "../examples/hello_ao.rs"]
mod hello_ao;
#[path = "../examples/path_trace.rs"]
mod path_trace;

use skylit::output::load;

#[test]
fn gpu_hello_ao() {
    let folder = tempfile::tempdir().unwrap();
    let image = folder.path().join("ao.png");
    let mean = hello_ao::render("builtin:plane", &image).unwrap();
    // nothing covers a plane
    assert!((mean - 1.0).abs() < 1e-5, "{mean}");
    assert_eq!([load(&image).unwrap().width, load(&image).unwrap().height], [320, 180]);
}

#[test]
fn gpu_path_trace() {
    let folder = tempfile::tempdir().unwrap();
    let image = folder.path().join("image");
    let report = path_trace::render("builtin:sphere-over-plane", &image).unwrap();
    assert!(report.mean > 0.1 && report.mean < 1.0, "{}", report.mean);
    assert!(load(&image.with_extension("exr")).unwrap().f32("B").is_some());
    assert!(load(&image.with_extension("png")).is_ok());
}

#[test]
fn gpu_frames() {
    let folder = tempfile::tempdir().unwrap();
    let report = frames::render("builtin:sphere-over-plane", folder.path()).unwrap();
    assert_eq!(report.frames.len(), 30);
    let [first, later] = [0, 10].map(|k| load(&folder.path().join(format!("frame-{k:02}.png"))).unwrap());
    assert!(first != later, "the camera does not move");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
}

#[test]
fn gpu_custom_pass() {
    let folder = tempfile::tempdir().unwrap();
    let image = folder.path().join("sunlight.png");
    // a plane has the sun all day, a closed box never
    let open = custom_pass::render("builtin:plane", &image).unwrap();
    let closed = custom_pass::render("builtin:closed-box", &image).unwrap();
    let seen = custom_pass::render("builtin:sphere-over-plane", &image).unwrap();
    assert!(open > 0.3 && seen > 0.1 && seen < 1.0, "{open}, {seen}");
    assert_eq!(closed, 0.0);
}
