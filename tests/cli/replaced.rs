//! Outputs replace neither inputs nor each other: one line and exit code 64 before anything is written, however a file is spelled.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;

use skylit::output::{self, Channel, Image, Samples};

use crate::common::command::{assert_refusal, device, fails, json, run, skylit, stderr};

/// A glTF file of a triangle with a buffer and a texture beside it.
pub fn gltf(folder: &Path, name: &str, buffer: &str, image: &str) {
    let json = serde_json::json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "material": 0 }] }],
        "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } }],
        "textures": [{ "source": 0 }],
        "images": [{ "uri": image }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
            { "bufferView": 0, "byteOffset": 36, "componentType": 5126, "count": 3, "type": "VEC2" },
        ],
        "bufferViews": [{ "buffer": 0, "byteLength": 60 }],
        "buffers": [{ "byteLength": 60, "uri": buffer }],
    });
    fs::write(folder.join(name), json.to_string()).unwrap();
}

/// The bytes of its buffer.
pub fn triangle() -> Vec<u8> {
    let floats: [f32; 15] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0];
    floats.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// An image of four pixels.
pub fn image(path: &Path, value: f32) {
    let channel = |name: &str| Channel { name: name.into(), samples: Samples::F32(vec![value; 4]) };
    let image = Image { width: 2, height: 2, channels: ["B", "G", "R"].map(channel).into(), metadata: Vec::new() };
    match path.extension().is_some_and(|e| e == "exr") {
        true => output::save(&image, path).unwrap(),
        false => image::RgbImage::from_pixel(2, 2, image::Rgb([128; 3])).save(path).unwrap(),
    }
}

/// Every file of a folder with its bytes.
fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let files = fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()).filter(|p| p.is_file());
    let mut all: Vec<_> =
        files.map(|p| (p.file_name().unwrap().to_string_lossy().into_owned(), fs::read(&p).unwrap())).collect();
    all.sort();
    all
}

/// A folder with a scene `s.gltf` of `buffer.bin` and `t.png`, and other spellings of them.
fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    gltf(dir.path(), "s.gltf", "buffer.bin", "t.png");
    fs::write(at("buffer.bin"), triangle()).unwrap();
    image(&at("t.png"), 0.5);
    fs::create_dir(at("sub")).unwrap();
    symlink("s.gltf", at("link.gltf")).unwrap();
    symlink("t.png", at("link.png")).unwrap();
    fs::hard_link(at("s.gltf"), at("hard.gltf")).unwrap();
    fs::hard_link(at("t.png"), at("hard.png")).unwrap();
    dir
}

/// Runs in a folder; every line ends with 64, says this, and leaves all files as they were.
fn refuses_all(dir: &Path, cases: &[(&str, &str)]) {
    for (line, says) in cases {
        let before = contents(dir);
        let args: Vec<&str> = line.split(' ').collect();
        let out = skylit(&args).current_dir(dir).output().unwrap();
        assert_refusal(&out, 64, says, &args);
        assert!(contents(dir) == before, "{line} changed a file");
    }
}

#[test]
fn an_export_does_not_replace_its_scene() {
    let dir = folder();
    refuses_all(
        dir.path(),
        &[
            ("export s.gltf s.gltf", "s.gltf: the output would replace the scene, which is read"),
            ("export s.gltf ./s.gltf", "./s.gltf: the output would replace the scene (s.gltf)"),
            ("export s.gltf sub/../s.gltf", "would replace the scene"),
            ("export s.gltf -o link.gltf", "would replace the scene"),
            ("export s.gltf hard.gltf", "would replace the scene"),
            ("export link.gltf s.gltf", "would replace the scene"),
            // what it writes beside a .gltf
            ("export s.gltf buffer.gltf", "buffer.bin: a file beside the output would replace a file of the scene"),
            ("export s.gltf buffer.gltf --force", "would replace a file of the scene"),
            // a triangle soup takes the place of the buffer
            ("export s.gltf buffer.bin", "buffer.bin: the output would replace a file of the scene"),
        ],
    );
}

#[test]
fn an_export_does_not_replace_what_lies_beside_it() {
    let dir = folder();
    let at = |name: &str| dir.path().join(name);
    let export = |line: &str| skylit(&line.split(' ').collect::<Vec<_>>()).current_dir(dir.path()).output().unwrap();
    fs::write(at("out.bin"), "another's").unwrap();
    refuses_all(dir.path(), &[("export s.gltf out.gltf", "out.bin: would be replaced by what belongs to out.gltf")]);
    fs::rename(at("out.bin"), at("out_0.png")).unwrap();
    refuses_all(dir.path(), &[("export s.gltf out.gltf", "out_0.png: would be replaced")]);
    // a glTF file that another program has written does not make its buffer ours
    fs::rename(at("out_0.png"), at("out.bin")).unwrap();
    gltf(dir.path(), "out.gltf", "out.bin", "out_0.png");
    refuses_all(dir.path(), &[("export s.gltf out.gltf", "add --force")]);
    assert!(export("export s.gltf out.gltf --force").status.success() && fs::read(at("out.bin")).unwrap().len() > 36);
    // and what an earlier export has written may be written again
    let again = export("export s.gltf out.gltf");
    assert!(again.status.success(), "{}", stderr(&again));
    assert!(
        export("export builtin:plane new.gltf").status.success()
            && export("export builtin:plane new.gltf").status.success()
    );
}

/// A link to a file that does not exist yet stays a link, and the file is made; where that cannot be, one line says so.
#[test]
fn dangling_links_are_written_through() {
    let dir = folder();
    let at = |name: &str| dir.path().join(name);
    for (link, target) in [("a.glb", "made.glb"), ("b.glb", "a2.glb"), ("c.glb", "none/c.glb"), ("d.glb", "d.glb")] {
        symlink(target, at(link)).unwrap();
    }
    symlink("chain.glb", at("a2.glb")).unwrap();
    let export = |name: &str| skylit(&["export", "s.gltf", name]).current_dir(dir.path()).output().unwrap();
    for (link, target) in [("a.glb", "made.glb"), ("b.glb", "chain.glb")] {
        let out = export(link);
        assert!(out.status.success(), "{}", stderr(&out));
        assert!(at(link).is_symlink() && at(target).is_file() && !at(target).is_symlink(), "{link}");
    }
    fails(&export("c.glb"), 4, &["c.glb: cannot write: its folder does not exist"]);
    fails(&export("d.glb"), 4, &["d.glb: cannot write"]);
    assert!(at("c.glb").is_symlink() && at("d.glb").is_symlink());
    // the file that a link stands for is an output like others
    refuses_all(dir.path(), &[("render s.gltf -o new.png -o new2.png --depth-image new.png", "-o")]);
    symlink("new.png", at("to-new.png")).unwrap();
    refuses_all(dir.path(), &[("render s.gltf -o new.png -o to-new.png", "two outputs would be one file")]);
}

#[test]
fn a_render_names_each_output_once() {
    let dir = folder();
    fs::write(dir.path().join("settings.json"), "{}").unwrap();
    fs::write(dir.path().join("keys.png"), "[]").unwrap();
    image(&dir.path().join("t.exr"), 0.5);
    refuses_all(
        dir.path(),
        &[
            ("render s.gltf -o a.png -o a.png", "a.png: two outputs would be one file (-o is given twice)"),
            ("render s.gltf -o a.png -o ./a.png", "./a.png: two outputs would be one file (a.png)"),
            ("render s.gltf -o a.png -o A.PNG", "two outputs would be one file"),
            ("render s.gltf -o a.png --depth-image sub/../a.png", "two outputs would be one file"),
            ("render s.gltf -o link.png -o hard.png", "two outputs would be one file"),
            ("render s.gltf -o a.exr --depth-image a.exr", "a.exr: two outputs would be one file"),
            (
                "render s.gltf -o a.#.png -o a.##.png --preset fast --frames 0..12",
                "a.10.png: two outputs would be one file",
            ),
            (
                "render s.gltf -o new.png --integrator path --environment t.png -o t.png",
                "-o would replace --environment",
            ),
            (
                "render s.gltf -o link.png --integrator path --environment t.png",
                "-o would replace --environment (t.png)",
            ),
            (
                "render s.gltf -o keys.png --preset fast --camera-path keys.png --frames 0..1",
                "-o would replace --camera-path",
            ),
            ("render s.gltf -o a.exr --depth-image t.exr --resume t.exr", "--depth-image would replace --resume"),
        ],
    );
    // what is no file is not replaced
    let out = run(&["render", "no.gltf", "-o", "/dev/null", "-o", "/dev/null"]);
    assert!(!stderr(&out).contains("two outputs"), "{}", stderr(&out));
}

/// Which files a scene refers to is known once it is loaded, which is before anything is rendered.
#[test]
fn gpu_a_render_does_not_replace_files_of_its_scene() {
    if !device() {
        return;
    }
    let dir = folder();
    let at = |name: &str| dir.path().join(name);
    gltf(dir.path(), "f.gltf", "set.ao.bin", "t.0001.png");
    fs::write(at("set.ao.bin"), triangle()).unwrap();
    image(&at("t.0001.png"), 0.5);
    // a buffer may have any name
    gltf(dir.path(), "v.gltf", "points.svg", "t.png");
    fs::write(at("points.svg"), triangle()).unwrap();
    fs::write(at("m.obj"), "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n").unwrap();
    fs::write(at("m.mtl"), "newmtl m\nKd 1 1 1\nmap_Kd t.png\n").unwrap();
    fs::write(at("a.0002.png"), "").unwrap();
    fs::copy(at("t.png"), at("a.0002.png")).unwrap();
    gltf(dir.path(), "i.gltf", "buffer.bin", "a.0002.png");
    refuses_all(
        dir.path(),
        &[
            ("render s.gltf -o t.png --size 8x8 --spp 1", "t.png: -o would replace a file of the scene"),
            ("render s.gltf -o link.png --size 8x8 --spp 1", "link.png: -o would replace a file of the scene"),
            ("render s.gltf -o new.png -o hard.png --size 8x8 --spp 1", "-o would replace a file of the scene"),
            ("render m.obj -o t.png --size 8x8 --spp 1", "-o would replace a file of the scene"),
            (
                "render f.gltf -o new.png --dump-rays set --size 8x8 --spp 1",
                "--dump-rays would replace a file of the scene",
            ),
            (
                "render f.gltf -o t.####.png --size 8x8 --preset fast --frames 0..3",
                "t.0001.png: -o would replace a file",
            ),
            ("render f.gltf -o t.####.png --size 8x8 --spp 1 --frames 0..3", "t.0001.png: -o would replace a file"),
            (
                "render i.gltf -o a.png --size 8x8 --spp 4 --intervals",
                "an intermediate image would replace a file of the scene",
            ),
            (
                "compare --scene s.gltf --a ao --b ao-sky --size 8x8 --difference t.png",
                "--difference would replace a file",
            ),
            ("compare ao-vs-path v.gltf --size 8x8 --plot points.svg", "--plot would replace a file of the scene"),
            ("bench rays s.gltf --quick --csv buffer.bin", "--csv would replace a file of the scene"),
            ("bench frames v.gltf --quick --plot points.svg", "--plot would replace a file of the scene"),
        ],
    );
    // an image takes the place of the one that it goes on from
    let still = |more: &[&str]| {
        let args = [&["render", "builtin:plane", "--size", "16x12", "--json", "-o", "r.exr"][..], more].concat();
        json(&skylit(&args).current_dir(dir.path()).output().unwrap())
    };
    still(&["--spp", "2", "--resumable"]);
    still(&["--spp", "4", "--resume", "r.exr"]);
}

#[test]
fn comparisons_and_benchmarks_keep_what_they_read() {
    let dir = folder();
    let at = |name: &str| dir.path().join(name);
    image(&at("a.exr"), 0.5);
    image(&at("b.exr"), 0.25);
    image(&at("b.png"), 0.25);
    symlink("b.png", at("l.png")).unwrap();
    for name in ["ao.json", "before.json"] {
        fs::write(at(name), "{}").unwrap();
    }
    fs::write(at("rays.bin"), [0u8; 32]).unwrap();
    refuses_all(
        dir.path(),
        &[
            ("compare t.png b.png --difference b.png", "b.png: --difference would replace image B"),
            ("compare t.png b.png --flip l.png", "l.png: --flip would replace image B (b.png)"),
            ("compare a.exr b.exr --csv a.exr", "a.exr: --csv would replace image A"),
            ("compare a.exr b.exr --difference d.png --flip ./d.png", "two outputs would be one file"),
            ("compare a.exr b.exr --html sub --csv sub/index.html", "two outputs would be one file"),
            ("compare t.png b.png link.png --difference b.png --csv b.a.png", "two outputs would be one file"),
            (
                "compare a.exr --scene builtin:plane --b ao --c ao-sky --save . --csv b.exr",
                "two outputs would be one file",
            ),
            (
                "compare b.exr --scene builtin:plane --a ao --reference A --save . --csv a.exr",
                "two outputs would be one file",
            ),
            ("compare a.exr --scene builtin:plane --a ao --save .", "a.exr: --save would replace image B"),
            ("compare ao-vs-path s.gltf --output x.exr --plot x.exr", "two outputs would be one file"),
            ("compare ao-vs-path s.gltf --environment t.png --plot t.png", "--plot would replace --environment"),
            ("bench report ao.json --json=ao.json", "ao.json: --json would replace a record"),
            ("bench report ao.json --baseline before.json --json=./before.json", "--json would replace --baseline"),
            ("bench report sub/index.html --html sub", "index.html: --html would replace a record"),
            ("bench ao --quick --baseline before.json --json=before.json", "--json would replace --baseline"),
            ("bench rays s.gltf --quick --csv c.json --plot p.png --json=c.json", "two outputs would be one file"),
            ("bench rays s.gltf --quick --csv s.gltf", "--csv would replace the scene"),
            ("bench path s.gltf --quick --environment t.png --plot t.png", "--plot would replace --environment"),
            ("rays --mesh s.gltf --rays rays.bin --hits rays.bin", "rays.bin: --hits would replace --rays"),
            ("rays --mesh s.gltf --rays rays.bin --hits hard.gltf", "hard.gltf: --hits would replace --mesh"),
        ]
        .map(|(line, says)| {
            // the page that is there already
            fs::write(at("sub/index.html"), "{}").unwrap();
            (line, says)
        }),
    );
}

/// A manifest with a frame, its golden image, and files that the frame is made of.
fn frames() -> tempfile::TempDir {
    let dir = folder();
    let manifest = "[[frame]]\nname = \"a\"\nscene = \"s.gltf\"\nrender = \"path --size 8x8 --spp 2 --environment t.png\"\ntolerance = \"exact\"\n";
    fs::write(dir.path().join("frames.toml"), manifest).unwrap();
    image(&dir.path().join("a.exr"), 0.5);
    dir
}

#[test]
fn results_of_verify_replace_no_reference() {
    let dir = frames();
    refuses_all(
        dir.path(),
        &[
            ("verify . --junit frames.toml", "--junit would replace the manifest"),
            ("verify . --junit a.exr", "--junit would replace a golden image"),
            ("verify . --junit hard.gltf", "--junit would replace a scene"),
            ("verify . --junit t.png", "--junit would replace an environment"),
            ("verify . --junit buffer.bin", "buffer.bin: --junit would replace a file that is not XML"),
            ("verify . --junit sub/index.html --html sub", "two outputs would be one file"),
        ],
    );
}

#[test]
fn gpu_golden_images_stay_in_their_folder() {
    if !device() {
        return;
    }
    let dir = frames();
    let at = |name: &str| dir.path().join(name);
    let outside = tempfile::tempdir().unwrap();
    let target = outside.path().join("theirs.exr");
    image(&target, 0.5);
    let before = fs::read(&target).unwrap();
    let bless = |option: &str| skylit(&["verify", ".", option, "--force"]).current_dir(dir.path()).output().unwrap();
    let refused = |option: &str, says: &str| {
        let out = bless(option);
        let text = stderr(&out) + &String::from_utf8_lossy(&out.stdout);
        assert!(out.status.code() == Some(2) && text.contains(says), "{text}");
    };
    // a link to a file outside, to one that is not there yet, and through a folder
    for link in [target.clone(), outside.path().join("new.exr")] {
        fs::remove_file(at("a.exr")).unwrap();
        symlink(link, at("a.exr")).unwrap();
        refused("--bless", "outside of the manifest's folder");
    }
    fs::remove_file(at("a.exr")).unwrap();
    symlink(outside.path(), at("away")).unwrap();
    symlink("away/theirs.exr", at("a.exr")).unwrap();
    refused("--bless", "outside of the manifest's folder");
    assert!(fs::read(&target).unwrap() == before && fs::read_dir(outside.path()).unwrap().count() == 1);
    // a link within the folder is followed
    fs::remove_file(at("a.exr")).unwrap();
    symlink("sub/a.exr", at("a.exr")).unwrap();
    let out = bless("--update-missing");
    assert!(out.status.success() && at("a.exr").is_symlink() && at("sub/a.exr").is_file(), "{}", stderr(&out));
    // a golden image has the name of a file that the frame is made of
    let manifest = fs::read_to_string(at("frames.toml")).unwrap();
    fs::write(at("frames.toml"), manifest.replace("\"a\"", "\"t\"\ngolden = \"png\"")).unwrap();
    refused("--bless", "would replace an environment");
    fs::write(
        at("frames.toml"),
        manifest.replace("\"a\"", "\"t\"\ngolden = \"png\"").replace(" --environment t.png", ""),
    )
    .unwrap();
    refused("--bless", "would replace a file of the scene");
}
