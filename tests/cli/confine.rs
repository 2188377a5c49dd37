//! `--confine`: a scene of strangers reads nothing outside of its own folder.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use super::replaced::{gltf, image, triangle};
use crate::common::command::{device, fails, json, skylit, stderr};

/// A folder `top/scene` with what scenes need, and `top/secret.*` that none may read.
struct Place {
    top: tempfile::TempDir,
}

impl Place {
    fn new() -> Self {
        let place = Self { top: tempfile::tempdir().unwrap() };
        fs::create_dir_all(place.scene("maps")).unwrap();
        for (folder, name) in [("", "secret"), ("scene", "own"), ("scene/maps", "inner")] {
            let at = |extension: &str| place.top.path().join(folder).join(format!("{name}.{extension}"));
            fs::write(at("bin"), triangle()).unwrap();
            image(&at("png"), 0.5);
            fs::write(at("mtl"), "newmtl m\nKd 1 1 1\n").unwrap();
            fs::write(at("obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        }
        for extension in ["bin", "png", "mtl", "obj"] {
            symlink(format!("../secret.{extension}"), place.scene(&format!("link.{extension}"))).unwrap();
            symlink(format!("maps/inner.{extension}"), place.scene(&format!("alias.{extension}"))).unwrap();
        }
        symlink("..", place.scene("up")).unwrap();
        place
    }

    fn scene(&self, name: &str) -> PathBuf {
        self.top.path().join("scene").join(name)
    }

    /// Names of a file outside, with this extension, as a scene may have them.
    fn outside(&self, extension: &str) -> Vec<String> {
        let absolute = self.top.path().join(format!("secret.{extension}"));
        let absolute = absolute.to_str().unwrap();
        let mut names: Vec<String> =
            ["../secret", "maps/../../secret", "link", "up/secret", "../scene/own", "..\\secret"]
                .map(|name| format!("{name}.{extension}"))
                .into();
        // whether a file is there is not told either
        names.extend([format!("../none.{extension}"), "/none/such".into(), absolute.into()]);
        names
    }

    fn run(&self, args: &[&str]) -> std::process::Output {
        skylit(args).current_dir(self.top.path()).output().unwrap()
    }

    /// `info` of a scene, with `--confine` and without.
    fn info(&self, scene: &str) -> [std::process::Output; 2] {
        let args = ["info", scene, "--no-device", "--json", "--confine"];
        [self.run(&args), self.run(&args[..4])]
    }

    fn refuses(&self, scene: &str, says: &str) {
        let [confined, free] = self.info(scene);
        fails(&confined, 3, &["which --confine does not allow", says]);
        assert_ne!(free.status.code(), None, "{}", stderr(&free));
        assert!(!stderr(&free).contains("--confine"), "{}", stderr(&free));
    }

    fn accepts(&self, scene: &str) {
        let warnings = self.info(scene).map(|out| json(&out)["warnings"].clone());
        assert_eq!(warnings[0], warnings[1], "{scene}");
    }
}

#[test]
fn buffers_and_images_of_gltf() {
    let place = Place::new();
    let scene = |buffer: &str, image: &str| gltf(&place.scene(""), "s.gltf", buffer, image);
    let hidden = |extension: &str| {
        let mut names = place.outside(extension);
        let absolute = place.top.path().join(format!("secret.{extension}"));
        names.extend([
            format!("%2e%2e/secret.{extension}"),
            format!("..%2Fsecret.{extension}"),
            format!("file://{}", absolute.display()),
            format!("file:../secret.{extension}"),
        ]);
        names
    };
    for name in hidden("bin") {
        scene(&name, "own.png");
        place.refuses("scene/s.gltf", &name);
    }
    for name in hidden("png") {
        scene("own.bin", &name);
        place.refuses("scene/s.gltf", &name);
    }
    for (buffer, image) in [
        ("own.bin", "own.png"),
        ("maps/inner.bin", "maps/../own.png"),
        ("./own.bin", "alias.png"),
        ("alias.bin", "none.png"),
    ] {
        scene(buffer, image);
        place.accepts("scene/s.gltf");
    }
    // an absolute path of another machine means the file beside the scene
    scene("file:///home/someone/own.bin", "C:\\work\\own.png");
    place.accepts("scene/s.gltf");
    // from within the folder, and through a link to it
    scene("own.bin", "../secret.png");
    let inside = skylit(&["info", "s.gltf", "--no-device", "--confine"]).current_dir(place.scene("")).output().unwrap();
    fails(&inside, 3, &["../secret.png"]);
    symlink("scene", place.top.path().join("other")).unwrap();
    place.refuses("other/s.gltf", "../secret.png");
    scene("own.bin", "own.png");
    place.accepts("other/s.gltf");
    // the scene's own file is no way out, either
    gltf(place.top.path(), "outside.gltf", "scene/own.bin", "scene/own.png");
    symlink("../outside.gltf", place.scene("linked.gltf")).unwrap();
    place.refuses("scene/linked.gltf", "a link that leads out of its folder");
}

#[test]
fn libraries_and_maps_of_obj() {
    let place = Place::new();
    let scene = |library: &str, map: &str| {
        let obj = format!("mtllib {library}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n");
        fs::write(place.scene("s.obj"), obj).unwrap();
        fs::write(place.scene("s.mtl"), format!("newmtl m\nKd 1 1 1\nmap_Kd {map}\n")).unwrap();
    };
    // a name whose end is a file beside the model means that file
    let leaves = |name: &String| !name.ends_with("own.mtl") && !name.ends_with("own.png");
    for name in place.outside("mtl").iter().filter(|n| leaves(n)) {
        scene(name, "own.png");
        place.refuses("scene/s.obj", name);
    }
    for name in place.outside("png").iter().filter(|n| leaves(n)) {
        scene("s.mtl", name);
        place.refuses("scene/s.obj", name);
    }
    for (library, map) in
        [("s.mtl", "own.png"), ("S.MTL", "maps\\inner.png"), ("s.mtl", "../scene/own.png"), ("./s.mtl", "alias.png")]
    {
        scene(library, map);
        place.accepts("scene/s.obj");
    }
    // folders above are not searched: a name alone does not find what lies there
    scene("s.mtl", "secret.png");
    let [confined, free] = place.info("scene/s.obj").map(|out| json(&out)["warnings"].to_string());
    assert!(confined.contains("`secret.png` was not found") && !free.contains("was not found"), "{confined} {free}");
}

#[test]
fn models_of_brhan_and_what_they_name() {
    let place = Place::new();
    let scene = |model: &str| {
        let text = format!("Camera position[0 0 3]\nModel file[{model}]\n");
        fs::write(place.scene("s.brhan"), text).unwrap();
    };
    scene("own.obj");
    place.accepts("scene/s.brhan");
    for name in place.outside("obj").iter().filter(|n| !n.ends_with("own.obj") && !n.contains('\\')) {
        scene(name);
        let out = place.run(&["info", "scene/s.brhan", "--no-device", "--confine"]);
        fails(&out, 3, &["which --confine does not allow"]);
    }
    // a model in a folder of the scene may refer to the scene's folder, and to nothing above
    gltf(&place.scene("maps"), "m.gltf", "../own.bin", "inner.png");
    scene("maps/m.gltf");
    place.accepts("scene/s.brhan");
    gltf(&place.scene("maps"), "m.gltf", "inner.bin", "../../secret.png");
    place.refuses("scene/s.brhan", "../../secret.png");
}

/// A skylit.toml that came with a scene may name an environment and a camera path: of its own folder.
#[test]
fn settings_beside_a_scene() {
    let place = Place::new();
    gltf(&place.scene(""), "s.gltf", "own.bin", "own.png");
    let toml = place.scene("skylit.toml");
    let render = |options: &[&str]| place.run(&[&["render", "scene/s.gltf", "-o", "none/a.png"], options].concat());
    let cube = place.scene("cube");
    fs::create_dir(&cube).unwrap();
    symlink("../link.png", cube.join("px.png")).unwrap();
    for key in [
        "environment = \"../secret.png\"",
        "environment = \"/etc/passwd\"",
        "environment = \"link.png\"",
        "environment = \"cube\"",
    ] {
        fs::write(&toml, format!("integrator = \"path\"\n[lighting]\n{key}\n")).unwrap();
        fails(&render(&["--confine"]), 3, &["skylit.toml", "which --confine does not allow"]);
        // the folder of the output does not exist
        fails(&render(&[]), 4, &["none/a.png"]);
    }
    fs::write(&toml, "[frames]\ncamera_path = \"../none.json\"\n").unwrap();
    fails(&render(&["--confine"]), 3, &["none.json"]);
    fs::write(&toml, "integrator = \"path\"\n[lighting]\nenvironment = \"own.png\"\n").unwrap();
    fails(&render(&["--confine"]), 4, &["none/a.png"]);
    // of the command line it may be any file
    fails(&render(&["--confine", "--integrator", "path", "--environment", "secret.png"]), 4, &["none/a.png"]);
    // the file itself is a link to another's
    fs::remove_file(&toml).unwrap();
    fs::write(place.top.path().join("other.toml"), "secret words\n").unwrap();
    symlink("../other.toml", &toml).unwrap();
    let out = render(&["--confine"]);
    fails(&out, 3, &["skylit.toml", "which --confine does not allow"]);
    assert!(!stderr(&out).contains("secret words"));
}

/// Every command that reads scenes has the option.
#[test]
fn gpu_commands_that_read_scenes() {
    if !device() {
        return;
    }
    let place = Place::new();
    gltf(&place.scene(""), "s.gltf", "own.bin", "../secret.png");
    fs::write(place.top.path().join("rays.bin"), [0u8; 32]).unwrap();
    let rays: Vec<u8> = [0.0f32, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0, 9.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    fs::write(place.top.path().join("rays.bin"), rays).unwrap();
    for line in [
        "info scene/s.gltf --no-device",
        "render scene/s.gltf -o a.png --size 8x8 --spp 1",
        "render scene/s.gltf -o a.apng --size 8x8 --preset fast --frames 0..2",
        "export scene/s.gltf a.glb",
        "compare --scene scene/s.gltf --a ao --b ao-sky --size 8x8",
        "compare ao-vs-path scene/s.gltf --size 8x8",
        "rays --mesh scene/s.gltf --rays rays.bin",
        "stress scene/s.gltf",
    ] {
        let args: Vec<&str> = line.split(' ').chain(["--confine"]).collect();
        fails(&place.run(&args), 3, &["scene/s.gltf: refers to ../secret.png", "--confine"]);
    }
    assert!(!Path::new(&place.top.path().join("a.glb")).exists());
    // a window stays open, and a script of the viewer fails
    fs::write(place.top.path().join("script.txt"), "wait settled\n").unwrap();
    let out = place.run(&["view", "scene/s.gltf", "--headless-script", "script.txt", "--confine"]);
    fails(&out, 1, &["script.txt, line 1", "scene/s.gltf: refers to ../secret.png", "--confine"]);
    // a built-in scene has no files
    let out = place.run(&["render", "builtin:plane", "-o", "b.png", "--size", "8x8", "--spp", "1", "--confine"]);
    assert!(out.status.success(), "{}", stderr(&out));
}

/// A manifest of strangers reads nothing outside of its folder.
#[test]
fn manifests_of_verify() {
    let place = Place::new();
    gltf(&place.scene(""), "s.gltf", "own.bin", "own.png");
    fs::write(place.top.path().join("settings.json"), "{}").unwrap();
    fs::copy(place.scene("s.gltf"), place.top.path().join("out.gltf")).unwrap();
    let manifest = |scene: &str, render: &str, more: &str| {
        let text = format!(
            "[[frame]]\nname = \"a\"\nscene = \"{scene}\"\nrender = \"{render} --size 8x8\"\ntolerance = \"exact\"\n{more}\n"
        );
        fs::write(place.scene("frames.toml"), text).unwrap();
    };
    let verify = |options: &[&str]| place.run(&[&["verify", "scene"], options].concat());
    let refused = |what: &str| {
        let said =
            |out: std::process::Output| (out.status.code(), stderr(&out) + &String::from_utf8_lossy(&out.stdout));
        let (code, text) = said(verify(&["--confine"]));
        assert!(
            code == Some(2) && text.contains("which --confine does not allow") && text.contains("frames.toml: line"),
            "{what}: {text}"
        );
        let (_, text) = said(verify(&[]));
        assert!(!text.contains("--confine"), "{what}: {text}");
    };
    for scene in ["../out.gltf", "up/out.gltf", "/none/such.gltf", "../none.gltf"] {
        manifest(scene, "ao", "");
        refused(scene);
    }
    manifest("builtin:plane", "path --environment ../secret.png", "");
    refused("environment");
    manifest("builtin:plane", "path --environment link.png", "");
    refused("environment by a link");
    manifest("builtin:plane", "balanced --frames 0..2 --camera-path ../none.json", "");
    refused("camera path");
    manifest("builtin:plane", "ao", "settings = \"../settings.json\"");
    refused("settings");
    symlink("../secret.exr", place.scene("a.exr")).unwrap();
    image(&place.top.path().join("secret.exr"), 0.5);
    manifest("builtin:plane", "ao", "");
    refused("golden image");
    fs::remove_file(place.scene("a.exr")).unwrap();
    // the manifest itself
    fs::rename(place.scene("frames.toml"), place.top.path().join("frames.toml")).unwrap();
    symlink("../frames.toml", place.scene("frames.toml")).unwrap();
    fails(&verify(&["--confine"]), 2, &["frames.toml", "--confine"]);
}

/// Scenes of a manifest may refer to each other's folders, and to nothing above the manifest's.
#[test]
fn gpu_scenes_of_manifests() {
    if !device() {
        return;
    }
    let place = Place::new();
    let manifest =
        "[[frame]]\nname = \"a\"\nscene = \"maps/m.gltf\"\nrender = \"ao --size 8x8 --spp 1\"\ntolerance = \"exact\"\n";
    fs::write(place.scene("frames.toml"), manifest).unwrap();
    let verify = || place.run(&["verify", "scene", "--confine", "--bless", "--force"]);
    gltf(&place.scene("maps"), "m.gltf", "../own.bin", "inner.png");
    let out = verify();
    assert!(out.status.success(), "{}", stderr(&out));
    gltf(&place.scene("maps"), "m.gltf", "../../secret.bin", "inner.png");
    let out = verify();
    let text = stderr(&out) + &String::from_utf8_lossy(&out.stdout);
    assert!(
        out.status.code() == Some(2) && text.contains("refers to ../../secret.bin") && text.contains("--confine"),
        "{text}"
    );
}
