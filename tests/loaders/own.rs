//! The scenes that come with the repository.

use std::path::Path;

use skylit::scene::{AlphaMode, LightKind, Scene};

use crate::build::*;

fn own(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let scene = load(&path).unwrap();
    assert!(scene.report.warnings.is_empty(), "{name}: {:?}", scene.report.warnings);
    assert_eq!(scene.report.degenerate_triangles, 0);
    scene
}

#[test]
fn leaves() {
    let scene = own("leaves.glb");
    assert_eq!((scene.triangle_count(), scene.instances.len(), scene.meshes.len()), (2 + 24 * 6, 25, 2));
    assert_eq!(scene.materials[1].alpha_mode, AlphaMode::Mask { cutoff: 0.5 });
    let alpha = |f: fn(u8) -> bool| scene.textures[0].texels.as_bytes().chunks(4).filter(|p| f(p[3])).count();
    assert!(alpha(|a| a == 0) > 1000 && alpha(|a| a == 255) > 1000);
}

#[test]
fn courtyard() {
    let scene = own("courtyard.gltf");
    assert_eq!((scene.triangle_count(), scene.instances.len()), (2 + 15 * 12, 16));
    assert_eq!((scene.cameras.len(), scene.lights.len(), scene.textures.len()), (2, 2, 1));
    assert_eq!(scene.lights[0].kind, LightKind::Directional { angle: 0.0 });
}

#[test]
fn parade() {
    let scene = own("parade.glb");
    assert_eq!((scene.instances.len(), scene.cameras.len()), (10, 2));
    assert_eq!(scene.rig.map(|r| r.animations().len()), Some(2));
}

#[test]
fn alcove() {
    let scene = own("alcove.brhan");
    assert_eq!((scene.sphere_count(), scene.cameras.len(), scene.hints.size), (3, 1, Some([512, 512])));
    assert_eq!(scene.triangle_count(), 8 + 8 + 10 + 2 * 12);
}

#[test]
fn files_are_small() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    for file in std::fs::read_dir(folder).unwrap().flatten() {
        assert!(file.metadata().unwrap().len() < 200_000, "{:?}", file.path());
    }
}

/// Geometry alone, and how far the images are.
#[test]
fn images_can_be_left_out() {
    use std::sync::Mutex;

    use skylit::scene::load::{LoadOptions, LoadPart, LoadProgress, load_with};

    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/courtyard.gltf");
    let whole = own("courtyard.gltf");
    let counted = Mutex::new(Vec::new());
    let progress = |at: LoadProgress| counted.lock().unwrap().push(at);
    let again = load_with(source, &LoadOptions { progress: &progress, ..Default::default() }).unwrap();
    let n = counted.lock().unwrap().len();
    assert!(n > 0 && again.textures.len() == whole.textures.len() && again.report.skipped_images == 0);
    assert!(
        counted.lock().unwrap().contains(&LoadProgress { part: LoadPart::Images, done: n, of: Some(n) }),
        "{counted:?}"
    );
    let geometry = load_with(source, &LoadOptions { textures: false, ..Default::default() }).unwrap();
    assert_eq!((geometry.textures.len(), geometry.report.skipped_images), (0, n));
    assert!(geometry.materials.iter().all(|m| m.base_color_texture.is_none()));
    assert_eq!(geometry.triangle_count(), whole.triangle_count());
    assert_eq!((geometry.materials.len(), geometry.cameras.len()), (whole.materials.len(), whole.cameras.len()));
    let mut files: Vec<_> = whole.report.files.iter().map(|f| f.file_name().unwrap().to_string_lossy()).collect();
    files.sort();
    assert_eq!(files, ["courtyard.bin", "courtyard.gltf", "courtyard_0.png"]);
}
