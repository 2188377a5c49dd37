//! `skylit bvh` and `skylit bench builders` from outside: figures of a hierarchy, files, and refusals.

use serde_json::Value;

use crate::common::command::{device, fails, json, place, refuses, run};

fn stream<'a>(record: &'a Value, name: &str, query: &str, kernel: &str) -> &'a Value {
    let is_it = |s: &&Value| s["name"] == name && s["query"] == query && s["kernel"] == kernel;
    record["streams"].as_array().unwrap().iter().find(is_it).unwrap_or_else(|| panic!("{name} {query}: {record}"))
}

#[test]
fn a_hierarchy_is_described_without_a_device() {
    let record = json(&run(&["bvh", "builtin:terrain:5000", "--json", "--wide"]));
    let tree = &record["trees"][0];
    let sum = |key: &str| tree["levels"].as_array().unwrap().iter().map(|l| l[key].as_f64().unwrap()).sum::<f64>();
    assert_eq!(sum("leaves"), record["leaves"].as_f64().unwrap());
    assert_eq!(record["leaves"].as_u64().unwrap(), record["inner_nodes"].as_u64().unwrap() + 1);
    assert_eq!(sum("primitives"), tree["references"].as_f64().unwrap());
    assert!((sum("sah") - tree["sah"]["falcone"].as_f64().unwrap()).abs() < 1e-9, "{tree}");
    assert!(tree["pah"].is_null() && tree["worst"][0]["share"].as_f64().unwrap() > 0.0);
    for name in ["camera", "sun shadow", "point shadow", "ambient occlusion", "bounce"] {
        let cost = |query| stream(&record, name, query, "nearest")["cost"].as_f64().unwrap();
        assert!(cost("any") <= cost("closest") && cost("closest") <= cost("exhaustive"), "{name}: {record}");
    }
    assert!(stream(&record, "camera", "closest", "wide")["nodes"].as_f64().unwrap() > 1.0);
    let text = String::from_utf8(run(&["bvh", "builtin:terrain:5000"]).stdout).unwrap();
    for expected in ["SAH cost", "costly", "siblings share", "ambient occlusion", "exhaustive"] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
}

/// Rays of one direction are counted as they were predicted: each that meets the scene's bounds costs the projected cost. Of a plane
/// from above that is all of them.
#[test]
fn projected_areas_predict_what_is_counted() {
    for build in ["sah", "pah-spfh", "default"] {
        let args = ["bvh", "builtin:terrain:20000", "--build", build, "--direction", "0,-1,0", "--json"];
        let record = json(&run(&args));
        let predicted = record["trees"][0]["pah"]["falcone"].as_f64().unwrap();
        let counted = stream(&record, "parallel", "exhaustive", "nearest")["cost"].as_f64().unwrap();
        assert!((counted / predicted - 1.0).abs() < 0.03, "{build}: {counted} against {predicted}");
    }
}

/// Two levels, spheres, and the tree itself.
#[test]
fn instances_and_spheres_are_described() {
    let folder = tempfile::tempdir().unwrap();
    let tree = place(&folder, "tree.json");
    let record = json(&run(&["bvh", "builtin:grid:3", "--json", "--tree", &tree]));
    assert_eq!(record["trees"][0]["name"], "top level");
    assert!(record["trees"].as_array().unwrap().iter().any(|t| t["instances"] == 27), "{record}");
    let written: Value = serde_json::from_slice(&std::fs::read(&tree).unwrap()).unwrap();
    let trees = written["trees"].as_array().unwrap();
    assert_eq!(trees.len(), record["trees"].as_array().unwrap().len());
    let nodes: usize = trees.iter().map(|t| t["nodes"].as_array().unwrap().len()).sum();
    assert_eq!(nodes as u64, record["inner_nodes"].as_u64().unwrap() + record["leaves"].as_u64().unwrap());
    let spheres = json(&run(&["bvh", "builtin:spheres:200", "--eye", "0,3,0", "--build", "pah", "--json", "--wide"]));
    assert!(stream(&spheres, "from the eye", "closest", "nearest")["hits"].as_f64().unwrap() > 0.2, "{spheres}");
    assert!(spheres["warnings"][0].as_str().unwrap().contains("--wide is left out"), "{spheres}");
}

/// One line for each light; the verdict is that of the figures. A scene without lights is asked about those of its image.
#[test]
fn lights_are_asked_whether_a_tree_pays() {
    let scene = "scenes/courtyard.gltf";
    let record = json(&run(&["bvh", scene, "--light-trees", "--json"]));
    let lights = record["lights"].as_array().unwrap();
    assert!(!lights.is_empty(), "{record}");
    for l in lights {
        let number = |key: &str| l[key].as_f64().unwrap();
        let saved = number("boxes") - number("local_boxes");
        assert!(number("rays") > 100.0 && number("boxes") > 1.0 && number("build_ms") > 0.0, "{l}");
        let rays = l["break_even_rays"].as_f64();
        assert_eq!(rays.is_some(), saved > 0.0, "{l}");
        let expected = 1e6 * number("build_ms") / (saved * number("box_test_ns"));
        assert!(rays.is_none_or(|n| (n / expected - 1.0).abs() < 1e-9), "{l}");
        assert_eq!(l["pays"], rays.is_some_and(|n| n <= 1280.0 * 720.0 * 64.0), "{l}");
    }
    let city = String::from_utf8(run(&["bvh", "builtin:city:5000", "--light-trees"]).stdout).unwrap();
    assert!(city.contains("light       light `sun`: would save ") && !city.contains("sun from above"), "{city}");
    let text = String::from_utf8(run(&["bvh", "builtin:terrain:5000", "--light-trees"]).stdout).unwrap();
    for expected in
        ["sun from above (the scene has no light): would save ", "lamp in the upper part", "A tree pays if it saves"]
    {
        assert!(text.contains(expected), "{expected}: {text}");
    }
    // it takes a while, so it is not there unless it is asked for; other rays have no lights
    assert_eq!(json(&run(&["bvh", "builtin:city:5000", "--json"]))["lights"], serde_json::json!([]));
    let directed = ["bvh", "builtin:city:5000", "--light-trees", "--direction", "0,-1,0"];
    refuses(&directed, 64, "--light-trees");
}

#[test]
fn areas_of_a_scene_and_of_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let scene = json(&run(&["bvh", "builtin:cornell-box", "--areas", "scene", "--json"]));
    let names: Vec<&str> = scene["areas"].as_array().unwrap().iter().map(|a| a["name"].as_str().unwrap()).collect();
    assert!(names.iter().any(|n| n.starts_with("camera")), "{names:?}");
    // the same share of rays hits with local trees
    let hits = |kernel| stream(&scene, "bounce", "closest", kernel)["hits"].as_f64().unwrap();
    assert_eq!(hits("local trees"), hits("nearest"));
    let file = place(&folder, "areas.json");
    let area = r#"[{"kind": "plane", "origin": [0, 1, 3], "direction": [0, 0, -1], "half_width": 1, "half_height": 1, "far": 5}]"#;
    std::fs::write(&file, area).unwrap();
    let record = json(&run(&["bvh", "builtin:cornell-box", "--areas", &file, "--json"]));
    assert_eq!(record["areas"].as_array().unwrap().len(), 1);
    std::fs::write(&file, area.replace("plane", "cone")).unwrap();
    fails(&run(&["bvh", "builtin:cornell-box", "--areas", &file]), 3, &["areas.json", "no list of influence areas"]);
}

#[test]
fn a_page_has_levels_and_subtrees() {
    let folder = tempfile::tempdir().unwrap();
    let page = place(&folder, "report");
    let record = json(&run(&["bvh", "scenes/parade.glb", "--light-trees", "--html", &page, "--json"]));
    let text = std::fs::read_to_string(record["report"].as_str().unwrap()).unwrap();
    for expected in
        ["Overlap of siblings", "Costliest subtrees", "by surface area", "skylit bvh", "Would local trees pay?"]
    {
        assert!(text.contains(expected), "{expected}");
    }
}

#[test]
fn what_has_no_effect_is_refused() {
    let scene = "builtin:cornell-box";
    refuses(&["bvh", scene, "--build", "pah"], 64, "add --direction X,Y,Z, --eye X,Y,Z or --rays");
    refuses(&["bvh", scene, "--direction", "0,0,0"], 64, "no direction");
    refuses(&["bvh", scene, "--areas", "rays"], 64, "add --rays");
    refuses(&["bvh", scene, "--rays", "nowhere.bin"], 3, "nowhere.bin");
    refuses(&["bvh", "builtin:nothing"], 64, "no built-in scene");
    refuses(&["render", scene, "-o", "never.png", "--build", "pah"], 64, "--traversal nearest");
    refuses(&["bench", "builders", "--areas", "none", "--runs", "a.csv"], 64, "--runs has no effect");
}

/// The image is the same with a tree for known rays.
#[test]
fn gpu_images_do_not_depend_on_the_builder() {
    if !device() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let image = |name: &str, more: &[&str]| {
        let path = place(&folder, name);
        let args =
            ["render", "builtin:cornell-box", "-o", &path, "--size", "64x64", "--spp", "4", "--traversal", "nearest"];
        let out = run(&[&args, more].concat());
        assert!(out.status.success(), "{}", crate::common::command::stderr(&out));
        path
    };
    let a = image("a.exr", &[]);
    let b = image("b.exr", &["--build", "pah-spfh", "--build-direction", "0.2,-1,0.1"]);
    assert!(run(&["diff", &a, &b, "--max-rmse", "0"]).status.success());
}

#[test]
fn gpu_builders_are_measured() {
    if !device() {
        return;
    }
    let out =
        run(&["bench", "builders", "builtin:cornell-box", "--quick", "--areas", "none", "--width", "32", "--json"]);
    let record = json(&out);
    let rows = record["measurements"].as_array().unwrap();
    for contestant in ["default", "sah", "pah-spfh", "pah-spfh, turned", "kd-tree"] {
        let is_it = |m: &&Value| m["part"] == "sun shadow" && m["contestant"] == contestant && m["quantity"] == "cost";
        assert!(rows.iter().any(|m| is_it(&m)), "{contestant}: {record}");
    }
}
