//! `skylit bake`: what is added to a model, what stays, and what is refused.

use std::fs;
use std::path::Path;

use glam::DVec3;
use serde_json::Value;
use skylit::output;
use skylit::scene::animation::{Playback, Pose};
use skylit::scene::load::load;
use skylit::scene::{Geometry, Instance, Scene};

use crate::common::command::{device, fails, json, place, refuses, run, stderr};

/// The JSON and the binary chunk of a `.glb`.
fn chunks(path: &str) -> (String, Vec<u8>) {
    let file = fs::read(path).unwrap();
    let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&file[..4], word(8)), (&b"glTF"[..], file.len()), "{path}");
    let end = 20 + word(12);
    let bin = if end < file.len() { file[end + 8..][..word(end)].to_vec() } else { Vec::new() };
    (String::from_utf8(file[20..end].to_vec()).unwrap(), bin)
}

fn document(path: &str) -> Value {
    serde_json::from_str(&chunks(path).0).unwrap()
}

fn bakes(args: &[&str]) -> Value {
    let out = run(&[&["bake", "--json"], args].concat());
    assert!(out.status.success(), "{}", stderr(&out));
    json(&out)
}

/// A `.gltf` of two triangles that share their texture coordinates, with what no tool of ours knows, and its buffer beside it.
fn folded(folder: &Path) -> String {
    let positions: [[f32; 3]; 6] =
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, -1.0]];
    let texcoords: [[f32; 2]; 6] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 0.0], [0.0, 1.0]];
    let ids: [u16; 6] = [7, 8, 9, 10, 11, 12];
    let mut bytes: Vec<u8> = Vec::new();
    bytes.extend(positions.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
    bytes.extend(texcoords.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
    bytes.extend(ids.iter().flat_map(|x| x.to_le_bytes()));
    fs::write(folder.join("folded data.bin"), &bytes).unwrap();
    let text = r#"{ "asset":{"version":"2.0", "generator":"a person"}, "scene":0, "scenes":[{"nodes":[0]}],
  "nodes":[{"mesh":0, "name":"fold", "extras":{"weight":1.50, "tags":[ 1,2 ]}}],
  "meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1,"_ID":2}, "material":0, "extras":{"x":1e+2}}]}],
  "materials":[{"name":"paper", "extras":{"of":"someone"}, "pbrMetallicRoughness":{"roughnessFactor":0.500}}],
  "accessors":[
    {"bufferView":0,"componentType":5126,"count":6,"type":"VEC3","min":[0,0,-1],"max":[1,1,0]},
    {"bufferView":1,"componentType":5126,"count":6,"type":"VEC2"},
    {"bufferView":2,"componentType":5123,"count":6,"type":"SCALAR"}],
  "bufferViews":[
    {"buffer":0,"byteLength":72}, {"buffer":0,"byteOffset":72,"byteLength":48}, {"buffer":0,"byteOffset":120,"byteLength":12}],
  "buffers":[{"uri":"folded%20data.bin","byteLength":132}], "somethingElse":{"kept":[true]} }"#;
    let path = folder.join("folded.gltf");
    fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

fn triangles(scene: &Scene) -> &skylit::scene::TriangleMesh {
    let Geometry::Triangles(triangles) = &scene.meshes[0].geometry else { panic!("no triangles") };
    triangles
}

#[test]
fn a_model_gets_coordinates_and_a_texture_and_keeps_the_rest() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let model = folded(dir.path());
    let glb = place(&dir, "baked.glb");
    let record = bakes(&[&model, "-o", &glb, "--size", "64", "--spp", "16"]);
    let texture = &record["textures"][0];
    assert_eq!(
        (&texture["material"], &texture["unwrapped"], &texture["texcoord"]),
        (&"paper".into(), &true.into(), &1.into())
    );

    // the text of what nothing changes is that of the file
    let (text, bin) = chunks(&glb);
    for kept in [
        r#""asset":{"version":"2.0", "generator":"a person"}"#,
        r#""extras":{"weight":1.50, "tags":[ 1,2 ]}"#,
        r#""extras":{"x":1e+2}"#,
        r#""extras":{"of":"someone"}"#,
        r#""pbrMetallicRoughness":{"roughnessFactor":0.500}"#,
        r#""somethingElse":{"kept":[true]}"#,
        r#"{"bufferView":2,"componentType":5123,"count":6,"type":"SCALAR"}"#,
    ] {
        assert!(text.contains(kept), "{kept}\n{text}");
    }
    let original = fs::read(dir.path().join("folded data.bin")).unwrap();
    assert_eq!(&bin[..original.len()], &original[..]);

    // the texture, by the new set of coordinates
    let document = document(&glb);
    let occlusion = &document["materials"][0]["occlusionTexture"];
    assert_eq!(occlusion["texCoord"], 1);
    let source = document["textures"][occlusion["index"].as_u64().unwrap() as usize]["source"].as_u64().unwrap();
    assert_eq!(document["images"][source as usize]["mimeType"], "image/png");
    let attributes = document["meshes"][0]["primitives"][0]["attributes"].as_object().unwrap();
    assert_eq!(attributes.keys().collect::<Vec<_>>(), ["POSITION", "TEXCOORD_0", "TEXCOORD_1", "_ID"]);

    // vertices are copies: the same triangles, with unique coordinates, and ids that go with positions
    let (before, after) = (load(&model).unwrap(), load(&glb).unwrap());
    let (old, new) = (triangles(&before), triangles(&after));
    assert_eq!(old.indices.len(), new.indices.len());
    for (a, b) in old.indices.iter().zip(&new.indices) {
        for (a, b) in a.iter().zip(b) {
            assert_eq!(old.positions[*a as usize], new.positions[*b as usize]);
            assert_eq!(old.texcoords[0][*a as usize], new.texcoords[0][*b as usize]);
        }
    }
    let position = &document["accessors"][attributes["POSITION"].as_u64().unwrap() as usize];
    assert_eq!(
        (&position["min"], &position["max"]),
        (&serde_json::json!([0.0, 0.0, -1.0]), &serde_json::json!([1.0, 1.0, 0.0]))
    );

    // what is baked is what is traced: half of the fold is open
    let record = bakes(&[&model, "-o", &glb, "--size", "128", "--spp", "256", "--verify"]);
    let verify = &record["verify"];
    assert!(verify["pixels"].as_u64().unwrap() > 10_000, "{verify}");
    assert!(verify["rmse"].as_f64().unwrap() < 0.03 && verify["bias"].as_f64().unwrap().abs() < 0.004, "{verify}");

    // pictures of what is baked have the values of its .exr
    let [exr, png] = ["seen.exr", "seen.png"].map(|name| place(&dir, name));
    let seen = run(&[
        "render",
        &glb,
        "-o",
        &exr,
        "-o",
        &png,
        "--integrator",
        "baked-occlusion",
        "--size",
        "48x32",
        "--spp",
        "4",
    ]);
    assert!(seen.status.success());
    let record = json(&run(&["diff", &exr, &png, "--json"]));
    assert!(record["compared"]["rmse"].as_f64().unwrap() < 0.004, "{record}");
}

#[test]
fn a_text_file_refers_to_the_files_of_the_source() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let model = folded(dir.path());
    fs::create_dir(dir.path().join("out")).unwrap();
    let output = place(&dir, "out/baked.gltf");
    let record = bakes(&[&model, "-o", &output, "--size", "32", "--spp", "4"]);
    assert_eq!(record["files"].as_array().unwrap().len(), 3);
    let text = fs::read_to_string(&output).unwrap();
    assert!(text.contains(r#""uri":"../folded%20data.bin""#), "{text}");
    assert!(dir.path().join("out/baked-paper-occlusion.png").is_file());
    let scene = load(&output).unwrap();
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    assert!(scene.materials[0].occlusion_texture.is_some());

    // a .glb has no text form here
    refuses(&["bake", &output, "-o", &output], 64, "the output");
}

#[test]
fn vertices_get_colours() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let model = folded(dir.path());
    let glb = place(&dir, "colours.glb");
    let record = bakes(&[&model, "-o", &glb, "--to", "vertices", "--spp", "1024"]);
    assert_eq!((&record["vertices"], &record["rays"]), (&6.into(), &(6 * 1024).into()));
    let scene = load(&glb).unwrap();
    let colors = &triangles(&scene).colors;
    assert_eq!(colors.len(), 6);
    // near the fold half is open, far from it more
    assert!(colors.iter().all(|c| c.x == c.y && c.y == c.z && c.w == 1.0));
    let (near, far) = (colors[0].x, colors[1].x);
    assert!(near > 0.5 && near < far && far < 1.0, "{near} {far}");
}

#[test]
fn other_formats_become_gltf_and_images_have_a_file_each() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let glb = place(&dir, "box.glb");
    let record = bakes(&["builtin:cornell-box", "-o", &glb, "--size", "64", "--spp", "4", "--ao-radius", "1"]);
    assert!(record["textures"].as_array().unwrap().iter().all(|t| t["unwrapped"] == true));
    let sides = record["textures"].as_array().unwrap().iter().flat_map(|t| t["size"].as_array().unwrap());
    assert!(sides.map(|side| side.as_u64().unwrap()).all(|side| side <= 64 && side % 4 == 0), "{record}");
    let scene = load(&glb).unwrap();
    assert!(scene.materials.iter().all(|m| m.occlusion_texture.is_some()));

    // the model that has coordinates needs none, and its maps are files by material
    let map = place(&dir, "map.exr");
    let record = bakes(&[&glb, "-o", &map, "--size", "64", "--spp", "4", "--map", "thickness"]);
    let files = record["files"].as_array().unwrap();
    assert_eq!(files.len(), record["textures"].as_array().unwrap().len());
    assert!(files.len() > 1);
    let image = output::load(Path::new(files[0].as_str().unwrap())).unwrap();
    assert!(image.f32("Y").unwrap().iter().all(|v| (0.0..=1.0).contains(v)));

    // one material alone has the name that was given, and 16 bits
    let name = record["textures"][0]["material"].as_str().unwrap();
    let map = place(&dir, "normal.png");
    bakes(&[&glb, "-o", &map, "--size", "32", "--map", "normal", "--only-material", name, "--bits", "16"]);
    assert_eq!(image::open(&map).unwrap().color(), image::ColorType::Rgb16);
}

/// Squares of an OBJ file, 3 apart, each in the tile of its number.
fn squares(folder: &Path, name: &str, y: f32, tiles: &[[i32; 2]]) -> String {
    let mut text = String::new();
    for (k, [u, v]) in tiles.iter().enumerate() {
        for [x, z] in [[0, 1], [1, 1], [1, 0], [0, 0]] {
            let at = 3 * k as i32 + x;
            text += &format!("v {at} {y} {z}\nvt {}.0 {}.0\n", u + x, v + 1 - z);
        }
        let [a, b, c, d] = [1, 2, 3, 4].map(|n| 4 * k + n);
        text += &format!("f {a}/{a} {b}/{b} {c}/{c} {d}/{d}\n");
    }
    let path = folder.join(name);
    fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

/// A detailed model is lit by the lights of the command line, too, and all of the scene lights a surface.
#[test]
fn light_of_a_detailed_model() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let model = squares(dir.path(), "flat.obj", 0.0, &[[0, 0]]);
    let exr = place(&dir, "light.exr");
    let light = ["bake", &model, "-o", &exr, "--size", "8", "--spp", "4", "--map", "light", "--environment", "1,1,1"];
    let run_with = |options: &[&str]| run(&[&light[..], options].concat());
    for options in [&[][..], &["--from", &model], &["--ground"]] {
        assert!(run_with(options).status.success(), "{options:?}");
        let image = output::load(Path::new(&exr)).unwrap();
        let values = image.f32("G").unwrap();
        assert!(values.iter().all(|v| (v - 1.0).abs() < 1e-4), "{options:?}: {values:?}");
    }
    fails(&run_with(&["--occluders", "material"]), 64, &["--occluders material", "--map light"]);
    fails(&run_with(&["--ao-radius", "1"]), 64, &["--ao-radius", "--map light"]);
    fails(&run_with(&["--integrator", "ao"]), 64, &["--integrator ao", "ao-sky"]);
    refuses(&["bake", &model, "-o", &exr, "--environment", "1,1,1"], 64, "for --map light");
}

#[test]
fn tiles_have_an_image_each_and_models_new_coordinates() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let model = squares(dir.path(), "tiles.obj", 0.0, &[[0, 0], [1, 0], [0, 1]]);
    let png = place(&dir, "map.png");
    let record = bakes(&[&model, "-o", &png, "--size", "16", "--spp", "4"]);
    let textures = record["textures"].as_array().unwrap();
    let tiles: Vec<u64> = textures.iter().map(|t| t["tile"].as_u64().unwrap()).collect();
    assert_eq!(tiles, [1011, 1001, 1002]);
    assert!(tiles.iter().all(|tile| Path::new(&place(&dir, &format!("map.{tile}.png"))).is_file()));
    assert!(textures.iter().all(|t| t["covered"] == 1.0 && t["seam_edges"] == 0 && t["seam_rmse"].is_null()));

    // glTF has no tiles
    let glb = place(&dir, "tiles.glb");
    let out = run(&["bake", &model, "-o", &glb, "--size", "64", "--spp", "4"]);
    let said = String::from_utf8(out.stdout.clone()).unwrap() + &stderr(&out);
    assert!(out.status.success() && said.contains("lie in 3 tiles (UDIM), which glTF does not have"), "{said}");
}

#[test]
fn other_models_occlude_and_are_cages() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let model = squares(dir.path(), "floor.obj", 0.0, &[[0, 0]]);
    let above = squares(dir.path(), "above.obj", 0.01, &[[0, 0]]);
    // a lid looks down: its back would have the floor within it
    let text = fs::read_to_string(&above).unwrap().replace("f 1/1 2/2 3/3 4/4", "f 4/4 3/3 2/2 1/1");
    let lid = place(&dir, "lid.obj");
    fs::write(&lid, text).unwrap();
    let exr = place(&dir, "map.exr");
    let mean = |args: &[&str]| {
        bakes(&[&[&model, "-o", &exr, "--size", "16", "--spp", "64", "--ao-radius", "5"], args].concat());
        let image = output::load(Path::new(&exr)).unwrap();
        let plane = image.f32("Y").unwrap();
        plane.iter().sum::<f32>() / plane.len() as f32
    };
    assert_eq!(mean(&[]), 1.0);
    assert!(mean(&["--occluders", &lid]) < 0.1);
    assert!(mean(&["--occluders", "material", "--occluders", &lid]) < 0.1);

    // a cage above finds a floor below that is too far for the distance
    let below = squares(dir.path(), "below.obj", -0.005, &[[0, 0]]);
    let normals = |cage: &str| {
        let record = bakes(&[&model, "-o", &exr, "--from", &below, "--cage", cage, "--map", "normal", "--size", "16"]);
        record["textures"][0]["covered"].as_f64().unwrap()
    };
    assert_eq!([normals("0.001"), normals(&above)], [0.0, 1.0]);
    let other = squares(dir.path(), "other.obj", 0.01, &[[0, 0], [0, 0]]);
    let args = ["bake", &model, "-o", &exr, "--from", &below, "--map", "normal", "--cage", &other];
    fails(
        &run(&args),
        64,
        &["--cage ", "other.obj: mesh", "has 4 triangles, and that of the model has 2", "moved outwards"],
    );
}

/// A detailed model is looked for as far behind and as straight as wanted, also from vertices.
#[test]
fn rays_to_a_detailed_model_are_as_long_and_as_straight_as_wanted() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let model = squares(dir.path(), "floor.obj", 0.0, &[[0, 0]]);
    let below = squares(dir.path(), "below.obj", -0.1, &[[0, 0]]);
    let cage = squares(dir.path(), "cage.obj", 0.05, &[[0, 0]]);
    let [exr, glb, skew] = ["map.exr", "colours.glb", "skew.png"].map(|name| place(&dir, name));
    let covered = |options: &[&str]| {
        let base = [&model, "-o", &exr, "--from", &below, "--map", "position", "--size", "16"];
        bakes(&[&base[..], options].concat())["textures"][0]["covered"].as_f64().unwrap()
    };
    for cage in ["0.05", &cage] {
        assert_eq!(covered(&["--cage", cage]), 0.0, "{cage}");
        assert_eq!(covered(&["--cage", cage, "--cage-behind", "0.15"]), 1.0, "{cage}");
        // of a diagonal of 1.41
        assert_eq!(covered(&["--cage", cage, "--cage-behind", "10%"]), 1.0, "{cage}");
        assert_eq!(covered(&["--cage", cage, "--cage-behind", "5%"]), 0.0, "{cage}");
    }

    // vertices take the occlusion of what lies behind them; what meets nothing is open
    let lid = place(&dir, "lid.obj");
    let text = fs::read_to_string(&below).unwrap();
    let above = fs::read_to_string(&below).unwrap().replace(" -0.1 ", " -0.05 ").replace("f 1/1 2/2 3/3 4/4", "");
    fs::write(&lid, format!("{text}{above}f 8/8 7/7 6/6 5/5\n")).unwrap();
    let grey = |options: &[&str]| {
        let base = [&model, "-o", &glb, "--to", "vertices", "--from", &lid, "--ao-radius", "5", "--cage", "0.01"];
        assert_eq!(bakes(&[&base[..], options].concat())["vertices"], 4);
        let colors = triangles(&load(&glb).unwrap()).colors.clone();
        colors.iter().map(|c| c.x).sum::<f32>() / 4.0
    };
    assert_eq!(grey(&[]), 1.0);
    // the lid is met first, which looks down onto the floor
    assert!(grey(&["--cage-behind", "0.2", "--skew", "1"]) < 0.5);

    // a map of the skew is an image in the coordinates of the texture
    image::GrayImage::from_pixel(2, 2, image::Luma([128])).save(&skew).unwrap();
    assert_eq!(covered(&["--cage", "0.2", "--skew", &skew]), 1.0);
    assert_eq!(covered(&["--cage", "0.2", "--skew", "0.5"]), 1.0);
    let unwrapped = ["bake", &model, "-o", &glb, "--from", &below, "--skew", &skew, "--texcoord", "unwrap"];
    fails(&run(&unwrapped), 64, &["--skew ", "skew.png: material", "gets new texture coordinates"]);
    let missing = ["bake", &model, "-o", &exr, "--from", &below, "--skew", "none.png"];
    fails(&run(&missing), 3, &["none.png: no such file"]);
}

#[test]
fn instances_have_an_image_each() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let [glb, exr] = ["stairs.glb", "stairs.exr"].map(|name| place(&dir, name));
    bakes(&["builtin:stairs", "-o", &glb, "--size", "64", "--spp", "4"]);
    let record = bakes(&[&glb, "-o", &exr, "--size", "16", "--spp", "4", "--unique-instances"]);
    let textures = record["textures"].as_array().unwrap();
    let instances: Vec<u64> =
        textures.iter().filter_map(|t| t["instances"].as_array()).flatten().map(|i| i.as_u64().unwrap()).collect();
    let unique: std::collections::BTreeSet<_> = instances.iter().collect();
    assert!(instances.len() > 2 && unique.len() == instances.len(), "{record}");
    assert!(record["files"].as_array().unwrap().iter().all(|f| Path::new(f.as_str().unwrap()).is_file()));
}

/// In a model each instance has a copy of its mesh, and of its material with a texture of its own; vertices are shared.
#[test]
fn instances_have_a_texture_each_in_a_model() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let [shared, unique] = ["shared.glb", "unique.glb"].map(|name| place(&dir, name));
    let options = ["--size", "64", "--spp", "64", "--verify"];
    let bake = |glb: &str, more: &[&str]| bakes(&[&["builtin:stairs", "-o", glb], &options[..], more].concat());
    let [before, after] = [bake(&shared, &[]), bake(&unique, &["--unique-instances"])];

    // steps see other steps above them than the first one does
    let error = |record: &Value| record["verify"]["rmse"].as_f64().unwrap();
    assert!(error(&after) < 0.85 * error(&before) && error(&after) < 0.06, "{before} {after}");

    // as many accessors but for none, and each node its own mesh
    let [before, after] = [&shared, &unique].map(|glb| document(glb));
    let count = |document: &Value, list: &str| document[list].as_array().unwrap().len();
    assert_eq!(count(&before, "accessors"), count(&after, "accessors"));
    let placed = |document: &Value| -> Vec<u64> {
        let nodes = document["nodes"].as_array().unwrap().iter();
        nodes.filter_map(|node| node["mesh"].as_u64()).collect()
    };
    let distinct = |numbers: &[u64]| numbers.iter().collect::<std::collections::BTreeSet<_>>().len();
    let (meshes, instances) = (distinct(&placed(&before)), placed(&after).len());
    assert!(meshes < instances && distinct(&placed(&after)) == instances, "{after}");
    assert_eq!(count(&after, "meshes") - count(&before, "meshes"), instances - meshes);

    // materials and textures of their own, from the same vertices
    let of_mesh = |mesh: u64| &after["meshes"][mesh as usize]["primitives"][0];
    let textures = placed(&after).into_iter().map(|mesh| {
        let material = of_mesh(mesh)["material"].as_u64().unwrap() as usize;
        after["materials"][material]["occlusionTexture"]["index"].as_u64().unwrap()
    });
    let textures: Vec<u64> = textures.collect();
    let most = placed(&before).iter().map(|m| placed(&before).iter().filter(|n| *n == m).count()).max().unwrap();
    assert!(most > 2 && distinct(&textures) >= most, "{textures:?}");
    let scene = load(&unique).unwrap();
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);

    // a node that places its mesh several times has one material for all
    let model = folded(dir.path());
    let text = fs::read_to_string(&model).unwrap();
    let extension = r#""extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":0}}}, "mesh":0"#;
    let instanced = place(&dir, "instanced.gltf");
    fs::write(&instanced, text.replacen(r#""mesh":0"#, extension, 1)).unwrap();
    let args = ["bake", &instanced, "-o", &unique, "--size", "32", "--unique-instances"];
    fails(&run(&args), 64, &["node `fold`", "EXT_mesh_gpu_instancing", "bake images"]);
    let out = run(&["bake", &instanced, "-o", &unique, "--size", "32", "--spp", "4"]);
    assert!(out.status.success(), "{}", stderr(&out));
}

/// A `.gltf` of one mesh on three nodes: two are skinned, each by two joints of its own, the third is not; all of them morph. An animation turns the upper joints about different axes, and changes the weights of each node.
fn deformed(folder: &Path) -> String {
    let (mut data, mut accessors, mut views) = (Vec::<u8>::new(), Vec::new(), Vec::new());
    let mut add = |bytes: Vec<u8>, kind: u32, shape: &str, count: usize| {
        views.push(serde_json::json!({ "buffer": 0, "byteOffset": data.len(), "byteLength": bytes.len() }));
        data.extend(bytes);
        data.resize(data.len().next_multiple_of(4), 0);
        let mut accessor = serde_json::json!({ "bufferView": views.len() - 1, "componentType": kind, "count": count });
        accessor["type"] = shape.into();
        if accessors.is_empty() {
            (accessor["min"], accessor["max"]) = (serde_json::json!([0, 0, 0]), serde_json::json!([1, 2, 0]));
        }
        accessors.push(accessor);
        accessors.len() - 1
    };
    let floats = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let bind = |y: f32| [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, y, 0.0, 1.0];
    const FLOAT: u32 = 5126;
    let half = std::f32::consts::FRAC_1_SQRT_2;

    // the strip: its lower corners follow the first joint, its upper ones the second, and a target moves one
    let position = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 2.0, 0.0]);
    assert_eq!(add(position, FLOAT, "VEC3", 4), 0);
    add(floats(&[0.1, 0.1, 0.9, 0.1, 0.9, 0.9, 0.1, 0.9]), FLOAT, "VEC2", 4);
    add([0, 1, 0, 0].repeat(4), 5121, "VEC4", 4);
    let [lower, upper] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]];
    add(floats([lower, lower, upper, upper].as_flattened()), FLOAT, "VEC4", 4);
    add(floats(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0]), FLOAT, "VEC3", 4);
    add([0u16, 1, 2, 0, 2, 3].iter().flat_map(|v| v.to_le_bytes()).collect(), 5123, "SCALAR", 6);
    add(floats([bind(0.0), bind(-1.0)].as_flattened()), FLOAT, "MAT4", 2);

    // the animation
    let times = add(floats(&[0.0, 1.0]), FLOAT, "SCALAR", 2);
    let (mut samplers, mut channels) = (Vec::new(), Vec::new());
    let turns = [[0.0, 0.0, half, half], [half, 0.0, 0.0, half]].map(|turn| [[0.0, 0.0, 0.0, 1.0], turn]);
    let turned = turns.iter().map(|t| (floats(t.as_flattened()), "VEC4", "rotation")).zip([4, 6]);
    let weighted = [1.0, -1.0, 2.0].map(|w| (floats(&[0.25, w]), "SCALAR", "weights")).into_iter().zip([0, 1, 2]);
    for ((values, shape, path), node) in turned.chain(weighted) {
        let output = add(values, FLOAT, shape, 2);
        channels.push(serde_json::json!({ "sampler": samplers.len(), "target": { "node": node, "path": path } }));
        samplers.push(serde_json::json!({ "input": times, "output": output }));
    }

    // the file
    fs::write(folder.join("strips.bin"), &data).unwrap();
    let primitive = serde_json::json!({
        "attributes": { "POSITION": 0, "TEXCOORD_0": 1, "JOINTS_0": 2, "WEIGHTS_0": 3 },
        "targets": [{ "POSITION": 4 }], "indices": 5, "material": 0,
    });
    let document = serde_json::json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0, 1, 2, 3, 5] }],
        "nodes": [
            { "mesh": 0, "skin": 0 }, { "mesh": 0, "skin": 1 }, { "mesh": 0, "translation": [10, 0, 0] },
            { "children": [4] }, { "translation": [0, 1, 0] },
            { "translation": [5, 0, 0], "children": [6] }, { "translation": [0, 1, 0] },
        ],
        "skins": [{ "joints": [3, 4], "inverseBindMatrices": 6 }, { "joints": [5, 6], "inverseBindMatrices": 6 }],
        "meshes": [{ "primitives": [primitive], "weights": [0.25] }], "materials": [{ "name": "strip" }],
        "animations": [{ "samplers": samplers, "channels": channels }],
        "accessors": accessors, "bufferViews": views,
        "buffers": [{ "uri": "strips.bin", "byteLength": data.len() }],
    });
    let path = folder.join("strips.gltf");
    fs::write(&path, document.to_string()).unwrap();
    path.to_str().unwrap().to_owned()
}

/// Corners of all triangles of each instance in world space, at a time of the first animation.
fn posed(scene: &Scene, seconds: f64) -> Vec<Vec<DVec3>> {
    let (mut scene, mut pose) = (scene.clone(), Pose::default());
    scene.rig.as_ref().unwrap().pose(0, seconds, Playback::Once, &mut pose).unwrap();
    pose.apply(&mut scene);
    let corners = |instance: &Instance| {
        let Geometry::Triangles(t) = &scene.meshes[instance.mesh].geometry else { panic!("no triangles") };
        let corner = |v: &u32| instance.object_to_world.transform_point3(t.positions[*v as usize].as_dvec3());
        t.indices.as_flattened().iter().map(corner).collect()
    };
    scene.instances.iter().map(corners).collect()
}

/// Copies of skinned and morphed meshes keep skins, weights and targets: each of them deforms as before, in the animation, too.
#[test]
fn instances_that_deform_have_a_texture_each() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let (model, glb) = (deformed(dir.path()), place(&dir, "unique.glb"));
    let before = load(&model).unwrap();
    assert!(before.report.warnings.is_empty(), "{:?}", before.report.warnings);

    // no two instances are deformed alike, and none is as at rest
    let apart = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
    let shape = |corners: &[DVec3]| corners.iter().map(|c| *c - corners[0]).collect::<Vec<_>>();
    let [rest, moved] = [0.0, 1.0].map(|seconds| posed(&before, seconds));
    assert!(moved.len() == 3 && rest.iter().zip(&moved).all(|(a, b)| apart(a, b) > 0.3), "{rest:?} {moved:?}");
    for [a, b] in [[0, 1], [0, 2], [1, 2]] {
        assert!(apart(&shape(&moved[a]), &shape(&moved[b])) > 0.3, "{moved:?}");
    }

    // with the texture coordinates of the file, and with new ones, for which vertices are written anew
    for texcoord in ["0", "unwrap"] {
        let options = ["--size", "32", "--spp", "4", "--unique-instances", "--texcoord", texcoord];
        let record = bakes(&[&[&model, "-o", &glb], &options[..]].concat());
        assert_eq!(record["textures"].as_array().unwrap().len(), 3, "{record}");
        let after = load(&glb).unwrap();
        assert!(after.report.warnings.is_empty(), "{:?}", after.report.warnings);
        assert_eq!(after.instances.len(), 3);
        for seconds in [0.0, 0.5, 1.0] {
            let pairs = posed(&before, seconds).into_iter().zip(posed(&after, seconds));
            let worst = pairs.map(|(a, b)| apart(&a, &b)).fold(0.0, f64::max);
            assert!(worst < 1e-6, "--texcoord {texcoord}, {seconds} s: {worst}");
        }

        // a mesh, a material and a texture each, with the joints, weights and targets of one primitive
        let document = document(&glb);
        let nodes: Vec<&Value> = document["nodes"].as_array().unwrap().iter().take(3).collect();
        assert_eq!(nodes.iter().map(|n| n["skin"].as_u64()).collect::<Vec<_>>(), [Some(0), Some(1), None]);
        let meshes = nodes.iter().map(|n| &document["meshes"][n["mesh"].as_u64().unwrap() as usize]);
        let meshes: Vec<&Value> = meshes.collect();
        let materials = meshes.iter().map(|m| m["primitives"][0]["material"].as_u64().unwrap());
        assert_eq!(materials.collect::<std::collections::BTreeSet<_>>().len(), 3);
        for mesh in &meshes {
            assert_eq!(mesh["weights"], meshes[0]["weights"]);
            for part in ["attributes", "targets", "indices"] {
                assert_eq!(mesh["primitives"][0][part], meshes[0]["primitives"][0][part]);
            }
            assert!(mesh["primitives"][0]["attributes"]["JOINTS_0"].is_u64(), "{mesh}");
        }
        assert_eq!(document["animations"][0]["channels"].as_array().unwrap().len(), 5);
    }
}

/// One texture for all materials, as exact as those that have as many texels together.
#[test]
fn an_atlas_is_one_texture_of_all_materials() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let [glb, own] = ["atlas.glb", "own.glb"].map(|name| place(&dir, name));
    let bake = |glb: &str, size: &str, more: &[&str]| {
        let options = ["--spp", "64", "--ao-radius", "1", "--verify"];
        bakes(&[&["builtin:cornell-box", "-o", glb, "--size", size], &options[..], more].concat())
    };
    let separate = bake(&own, "64", &[]);
    let count = separate["textures"].as_array().unwrap().len();
    let atlas = bake(&glb, "128", &["--atlas"]);
    assert!(count == 3 || count == 4, "{separate}");
    let error = |record: &Value| record["verify"]["rmse"].as_f64().unwrap();
    println!("RMSE of an atlas {}, of {count} textures {}", error(&atlas), error(&separate));
    assert!(error(&atlas) < 1.25 * error(&separate) && error(&atlas) < 0.05, "{atlas} {separate}");

    // all materials have it, by the same set of coordinates
    let textures = atlas["textures"].as_array().unwrap();
    assert_eq!((textures.len(), textures[0]["materials"].as_array().unwrap().len()), (1, count));
    let document = document(&glb);
    assert_eq!(document["images"].as_array().unwrap().len(), 1);
    let slots = document["materials"].as_array().unwrap().iter().map(|m| m["occlusionTexture"].to_string());
    let slots: std::collections::BTreeSet<String> = slots.collect();
    assert_eq!(slots.into_iter().collect::<Vec<_>>(), [r#"{"index":0,"texCoord":0}"#]);

    // its coordinates are those of images, and of the next atlas; without them there is no image
    let exr = place(&dir, "map.exr");
    let record = bakes(&[&glb, "-o", &exr, "--atlas", "--size", "64", "--spp", "4", "--map", "thickness"]);
    assert_eq!((record["files"].as_array().unwrap().len(), &record["textures"][0]["texcoord"]), (1, &0.into()));
    assert!(record["textures"][0]["covered"].as_f64().unwrap() > 0.4, "{record}");
    let again = bakes(&[&glb, "-o", &own, "--atlas", "--size", "64", "--spp", "4"]);
    assert_eq!(again["textures"][0]["unwrapped"], false);
    fails(&run(&["bake", "builtin:cornell-box", "-o", &exr, "--atlas"]), 64, &["atlas: has no texture coordinates"]);
    let model = squares(dir.path(), "tiles.obj", 0.0, &[[0, 0], [1, 0]]);
    fails(&run(&["bake", &model, "-o", &exr, "--atlas"]), 64, &["lie in 2 tiles (UDIM), not in one", "-o NAME.glb"]);
}

/// The file of finished parts is taken where it is of this bake, and refused where it is not.
#[test]
fn finished_parts_are_kept_until_the_output_is_written() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let model = squares(dir.path(), "floor.obj", 0.0, &[[0, 0]]);
    let [exr, parts] = ["map.exr", "map.exr.parts"].map(|name| place(&dir, name));
    let args = ["bake", &model, "-o", &exr, "--size", "16", "--spp", "4", "--resumable"];
    assert!(run(&args).status.success());
    assert!(Path::new(&exr).is_file() && !Path::new(&parts).exists());
    let whole = fs::read(&exr).unwrap();
    fs::remove_file(&exr).unwrap();

    // a file that is none, and one of another bake
    fs::write(&parts, "something else").unwrap();
    fails(&run(&args), 3, &["map.exr.parts: is no file of a bake under way"]);
    fs::write(&parts, format!("skylit parts  1\n{}", "0".repeat(32))).unwrap();
    fails(&run(&args), 64, &["--resumable", "map.exr.parts is of another bake", "delete it"]);
    fs::remove_file(&parts).unwrap();
    assert!(run(&args).status.success());
    assert_eq!(fs::read(&exr).unwrap(), whole);
}

#[test]
fn what_cannot_be_baked_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let model = folded(dir.path());
    let [glb, png, gltf] = ["a.glb", "a.png", "a.gltf"].map(|n| place(&dir, n));
    refuses(&["bake", &model, "-o", "a.jpg"], 64, ".png or .exr");
    refuses(&["bake", &model, "-o", &glb, "--map", "normal"], 64, "a model holds ambient occlusion alone");
    refuses(&["bake", &model, "-o", &png, "--to", "vertices"], 64, "an image has no vertices");
    refuses(&["bake", &model, "-o", &glb, "--to", "vertices", "--atlas"], 64, "--atlas is for textures");
    refuses(&["bake", &model, "-o", &glb, "--to", "vertices", "--resumable"], 64, "--resumable is for textures");
    refuses(&["bake", &model, "-o", &glb, "--to", "vertices", "--unique-instances"], 64, "instances share");
    refuses(&["bake", &model, "-o", &glb, "--atlas", "--texcoord", "0"], 64, "--texcoord: an atlas needs");
    refuses(&["bake", &model, "-o", &glb, "--atlas", "--unique-instances"], 64, "--atlas: instances");
    refuses(&["bake", &model, "-o", &glb, "--atlas", "--pack", "orm"], 64, "not in an atlas");
    refuses(&["bake", &model, "-o", &png, "--verify"], 64, "--verify renders the written model");
    refuses(&["bake", &model, "-o", &glb, "--size", "0"], 64, "from 1 to 16384");
    refuses(&["bake", &model, "-o", &glb, "--texcoord", "x"], 64, "auto, unwrap or the number of a set");
    refuses(&["bake", &model, "-o", &glb, "--to", "vertices", "--spp", "2000"], 64, "at most 1024 samples");
    refuses(&["bake", "none.glb", "-o", &glb], 3, "none.glb");
    refuses(&["bake", &model, "-o", &png, "--occluders", "all"], 64, "scene, material or a model");
    refuses(&["bake", &model, "-o", &png, "--occluders", "scene", "--occluders", "material"], 64, "not both");
    refuses(&["bake", &model, "-o", &png, "--from", &model, "--cage", "wide"], 64, "or a model");
    // what says where a detailed model is looked for
    let from = |options: &[&str], says: &str| {
        refuses(&[&["bake", &model, "-o", &png, "--from", &model], options].concat(), 64, says);
    };
    from(&["--occluders", "material"], "what --from names occludes");
    from(&["--cage", "auto"], "--cage: a length or a share");
    from(&["--cage", "inf"], "--cage: a length or a share");
    from(&["--cage-behind", "auto"], "--cage-behind: a length or a share");
    from(&["--cage-behind=-1"], "expected a length above 0");
    from(&["--cage-behind", "NaN"], "expected a length above 0");
    from(&["--cage-behind", &model], "expected a length above 0");
    for wrong in ["--skew=-0.1", "--skew=1.5", "--skew=NaN", "--skew=auto", "--skew=grey.txt"] {
        from(&[wrong], "expected a number from 0 to 1, or an image");
    }
    for alone in ["--cage=1", "--cage-behind=1", "--skew=1"] {
        refuses(&["bake", &model, "-o", &png, alone], 64, "--from");
    }
    let vertices = ["bake", &model, "-o", &glb, "--to", "vertices", "--from", &model, "--skew", "grey.png"];
    refuses(&vertices, 64, "--skew: an image is for textures");
    let tangent = ["bake", &model, "-o", &png, "--map", "normal", "--space", "tangent", "--seams", "match"];
    refuses(&tangent, 64, "turns at a seam");
    if !device() {
        return;
    }
    // what the scene's options say counts, with a radius, too
    fails(&run(&["bake", &model, "-o", &glb, "--ao-radius", "1", "--hide", "nothing"]), 64, &["--hide nothing"]);
    let out = run(&["bake", &model, "-o", &png]);
    fails(&out, 64, &["texture coordinates 0 overlap", "-o NAME.glb"]);
    fails(&run(&["bake", &model, "-o", &glb, "--texcoord", "0"]), 64, &["overlap", "--texcoord unwrap"]);
    fails(&run(&["bake", &model, "-o", &glb, "--only-material", "x"]), 64, &["--only-material x"]);
    fails(&run(&["bake", "builtin:cornell-box", "-o", &gltf]), 64, &["becomes a .glb"]);
    fails(&run(&["bake", &model, "-o", &png, "--map", "thickness", "--ao-radius", "inf"]), 64, &["needs a length"]);
    assert!(!Path::new(&glb).exists() && !Path::new(&png).exists());
}
