//! No output replaces an input: what a command reads and writes.

use std::fs;

use skylit::files::plan::FilePlan;

#[cfg(unix)]
#[test]
fn files_are_compared_by_what_they_are() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    fs::create_dir(at("folder")).unwrap();
    fs::write(at("old.png"), "old").unwrap();
    fs::hard_link(at("old.png"), at("hard.png")).unwrap();
    std::os::unix::fs::symlink("old.png", at("soft.png")).unwrap();
    std::os::unix::fs::symlink("new.png", at("dangling.png")).unwrap();
    std::os::unix::fs::symlink("folder", at("other")).unwrap();
    let twice = |a: &str, b: &str| {
        let mut plan = FilePlan::default();
        plan.writes("-o", at(a));
        plan.writes("--csv", at(b));
        plan.check().err().map(|e| (e.exit_code(), e.to_string()))
    };
    for (a, b) in [
        ("a.png", "a.png"),
        ("a.png", "./a.png"),
        ("a.png", "folder/../a.png"),
        ("a.png", "A.PNG"),
        ("old.png", "hard.png"),
        ("old.png", "soft.png"),
        ("new.png", "dangling.png"),
        ("folder/a.png", "other/a.png"),
        ("none/a.png", "none/a.png"),
    ] {
        let (code, text) = twice(a, b).unwrap_or_else(|| panic!("{a} {b}"));
        assert!(code == 64 && text.contains("-o and --csv") && !text.contains('\n'), "{text}");
    }
    for (a, b) in [("a.png", "b.png"), ("old.png", "OLD.png"), ("a.png", "folder/a.png"), ("old.png", "dangling.png")] {
        assert_eq!(twice(a, b), None, "{a} {b}");
    }
    // what is no file is not replaced
    let mut plan = FilePlan::default();
    plan.writes("-o", "/dev/null");
    plan.writes("-o", "/dev/null");
    plan.reads("the scene", "/dev/null");
    plan.check().unwrap();
}

#[cfg(unix)]
#[test]
fn inputs_stay() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    fs::create_dir(at("cube")).unwrap();
    fs::write(at("cube/px.png"), "face").unwrap();
    fs::write(at("scene.glb"), "scene").unwrap();
    std::os::unix::fs::symlink("scene.glb", at("link.glb")).unwrap();
    let plan = |output: &str| {
        let mut plan = FilePlan::default();
        plan.reads("the scene", at("scene.glb"));
        plan.reads_images("--environment", at("cube"));
        plan.reads("--baseline", at("none.json"));
        plan.writes("-o", at(output));
        plan
    };
    for (output, role) in [("scene.glb", "the scene"), ("link.glb", "the scene"), ("cube/px.png", "--environment")] {
        let text = plan(output).check().unwrap_err().to_string();
        assert!(text.contains(&format!("-o would replace {role}")), "{text}");
    }
    // a file that is not there cannot be replaced
    plan("none.json").check().unwrap();
    let after = plan("link.glb").check_scene(&[at("cube/px.png"), at("scene.glb")]).unwrap_err();
    assert!(after.to_string().contains("link.glb: -o would replace a file of the scene"), "{after}");
    plan("new.png").check_scene(&[at("scene.glb")]).unwrap();
    assert!(plan("scene.glb").replaces_files() && !plan("new.png").replaces_files());
}
