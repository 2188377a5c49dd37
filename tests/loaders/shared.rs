//! Scenes of others, where they are present.

use std::path::PathBuf;

use glam::{Vec3, Vec4};
use skylit::scene::{AlphaMode, Scene};

use crate::build::*;

/// The folder of the shared scenes: `SKYLIT_SHARED_SCENES`, or `../shared/scenes` beside the repository.
fn shared(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("SKYLIT_SHARED_SCENES")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes"), PathBuf::from);
    let path = folder.join(name);
    if !path.exists() {
        println!("skipped: no shared scenes ({name})");
        return None;
    }
    Some(path)
}

fn shared_scene(name: &str) -> Option<Scene> {
    shared(name).map(|path| load(&path).unwrap())
}

/// Every promise that the loader makes.
fn check(scene: &Scene) {
    assert!(!scene.materials.is_empty() && scene.triangle_count() + scene.sphere_count() > 0);
    for i in &scene.instances {
        assert!(i.object_to_world.inverse().is_finite() && i.mesh < scene.meshes.len());
    }
    for (m, mesh) in scene.meshes.iter().enumerate() {
        assert!(mesh.material < scene.materials.len());
        let skylit::scene::Geometry::Triangles(t) = &mesh.geometry else { continue };
        let n = t.positions.len();
        for length in [t.normals.len(), t.tangents.len(), t.texcoords[0].len(), t.texcoords[1].len(), t.colors.len()] {
            assert!(length == 0 || length == n, "mesh {m}");
        }
        assert!(t.positions.iter().all(|p| p.is_finite()) && t.indices.iter().flatten().all(|&i| (i as usize) < n));
        assert!(t.normals.iter().all(|x| (x.length() - 1.0).abs() < 1e-4), "mesh {m}");
    }
    for slot in scene.materials.iter().flat_map(|m| m.textures()) {
        let t = &scene.textures[slot.texture];
        assert_eq!(t.texels.len(), t.width as usize * t.height as usize);
    }
}

fn triangles(scene: &Scene) -> u64 {
    scene.triangle_count() + scene.report.degenerate_triangles as u64
}

#[test]
fn meshes() {
    for (name, expected) in [
        ("sponza/sponza.glb", 263_167),
        ("dragon/dragon.glb", 871_414),
        ("bunny/bunny.glb", 69_451),
        ("flight_helmet/FlightHelmet.gltf", 94_722),
    ] {
        let Some(scene) = shared_scene(name) else { continue };
        check(&scene);
        assert_eq!(triangles(&scene), expected, "{name}");
        assert!(scene.report.warnings.is_empty(), "{name}: {:?}", scene.report.warnings);
    }
}

#[test]
fn sponza_has_textures_and_masks() {
    let Some(scene) = shared_scene("sponza/sponza.glb") else { return };
    assert_eq!((scene.materials.len(), scene.textures.len()), (25, 19));
    assert!(scene.materials.iter().any(|m| matches!(m.alpha_mode, AlphaMode::Mask { .. })));
}

#[test]
fn computed_tangents_agree_with_those_of_the_file() {
    let Some(path) = shared("flight_helmet/FlightHelmet.gltf") else { return };
    let theirs = load(&path).unwrap();
    // the same file without its tangents, read from the same folder's buffer and images
    let text = std::fs::read_to_string(&path).unwrap().replace("\"TANGENT\"", "\"_TANGENT\"");
    let folder = Folder::new();
    for file in std::fs::read_dir(path.parent().unwrap()).unwrap().flatten() {
        std::fs::copy(file.path(), folder.path(file.file_name().to_str().unwrap())).unwrap();
    }
    let copy = folder.path("without.gltf");
    std::fs::write(&copy, text).unwrap();
    let ours = load(&copy).unwrap();
    assert_eq!((theirs.report.tangents_computed, ours.report.tangents_computed), (0, 6));
    let (mut total, mut close, mut handed) = (0, 0, 0);
    for (a, b) in (0..6).map(|i| (mesh(&theirs, i), mesh(&ours, i))) {
        for (ta, tb) in a.indices.iter().flatten().zip(b.indices.iter().flatten()) {
            let (x, y): (Vec4, Vec4) = (a.tangents[*ta as usize], b.tangents[*tb as usize]);
            total += 1;
            close += usize::from(Vec3::dot(x.truncate(), y.truncate()) > 0.9);
            handed += usize::from(x.w == y.w);
        }
    }
    println!("{total} corners: {close} within 26 degrees, {handed} of the same handedness");
    assert!(close as f64 > 0.95 * total as f64 && handed as f64 > 0.95 * total as f64, "{close} {handed} of {total}");
}

#[test]
fn brhan_samples() {
    let Some(folder) = shared("brhan/scenes") else { return };
    let mut loaded = 0;
    for file in std::fs::read_dir(folder).unwrap().flatten().map(|f| f.path()) {
        let name = file.file_stem().unwrap().to_str().unwrap().to_owned();
        match load(&file) {
            Ok(scene) => {
                check(&scene);
                assert!(!scene.cameras.is_empty() && scene.hints.spp.is_some(), "{name}");
                assert!(scene.report.warnings.is_empty(), "{name}: {:?}", scene.report.warnings);
                loaded += 1;
            }
            Err(e) => {
                // some refer to models that are not there; the message says which, and on which line
                let text = e.to_string();
                assert!(text.contains(": line ") && text.contains("does not exist"), "{name}: {text}");
                println!("{text}");
            }
        }
    }
    assert!(loaded >= 7, "{loaded}");
}

#[test]
fn cornell_boxes_are_opaque() {
    let Some(folder) = shared("brhan/CornellBox") else { return };
    for file in std::fs::read_dir(folder).unwrap().flatten().map(|f| f.path()) {
        if file.extension().is_some_and(|e| e == "obj") {
            let scene = load(&file).unwrap();
            check(&scene);
            let opaque = |m: &skylit::scene::Material| m.alpha_mode == AlphaMode::Opaque && m.base_color.w == 1.0;
            assert!(scene.materials.iter().all(opaque), "{}", file.display());
        }
    }
}

#[test]
fn obj_models() {
    for (name, expected) in [("Cottage", 4281), ("CottageWalls", 5817), ("MonkeyModel", 967), ("WoodScene", 7058)] {
        let Some(scene) = shared_scene(&format!("falcone/{name}.obj")) else { continue };
        check(&scene);
        assert_eq!(triangles(&scene), expected, "{name}");
    }
}
