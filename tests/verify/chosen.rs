//! Camera, AO radius and light that a frame leaves open are those of its golden image: they do not follow the scene that is judged by it.

use std::path::Path;

use glam::{DAffine3, DVec3};
use skylit::Renderer;
use skylit::film::NoControl;
use skylit::scene::export::export_gltf;
use skylit::scene::{Environment, Geometry, Instance, Mesh, Scene};
use skylit::verify::golden::Golden;
use skylit::verify::manifest::Manifest;
use skylit::verify::{FrameResult, Outcome, Summary};

use crate::common::{self, device};
use crate::{bless, differing, verify};

const FRAMES: &str = r#"
[defaults]
tolerance = "z_test"

[[frame]]
name = "ao"
scene = "scene.glb"
render = "ao --size 48x32 --spp 64"

[[frame]]
name = "share"
scene = "scene.glb"
render = "ao --size 48x32 --spp 64 --view iso --ao-radius 5%"

[[frame]]
name = "path"
scene = "scene.glb"
render = "path --size 32x24 --spp 64 --max-depth 2"

[[frame]]
name = "preset"
scene = "scene.glb"
render = "fast --size 48x32 --frames 0..2"
golden = "png"
tolerance = { flip = { percentile = 95, max = 0.05 } }

[[frame]]
name = "room"
scene = "room.glb"
render = "ao --size 48x32 --spp 64"
"#;

/// A scene without cameras and lights.
fn bare(name: &str) -> Scene {
    Scene { cameras: Vec::new(), lights: Vec::new(), environment: Environment::Black, ..common::scene(name) }
}

fn export(folder: &Path, change: impl Fn(&mut Scene)) {
    for (name, file) in [("stairs", "scene.glb"), ("closed-box", "room.glb")] {
        let mut scene = bare(name);
        if let ("closed-box", Geometry::Triangles(mesh)) = (name, &mut scene.meshes[0].geometry) {
            // walls that face the room
            mesh.indices.iter_mut().for_each(|t| t.swap(1, 2));
        }
        change(&mut scene);
        export_gltf(&scene, &folder.join(file)).unwrap();
    }
}

fn transform(scene: &mut Scene, by: DAffine3) {
    scene.instances.iter_mut().for_each(|i| i.object_to_world = by * i.object_to_world);
}

fn chosen(summary: &Summary, frame: &str) -> Option<String> {
    summary.frames.iter().find(|f| f.frame == frame).unwrap().chosen.clone()
}

fn names(lines: &[String]) -> Vec<&str> {
    lines.iter().map(|l| l.split(':').next().unwrap()).collect()
}

/// Removes metadata of golden images, as earlier versions did not write them.
fn forget(folder: &Path, keys: &[&str]) {
    let manifest = Manifest::load(folder).unwrap();
    for frame in &manifest.frames {
        let mut golden = Golden::load(&manifest.golden(frame)).unwrap();
        golden.image.metadata.retain(|(key, _)| !keys.contains(&key.as_str()));
        golden.save().unwrap();
    }
}

#[test]
fn gpu_what_was_chosen_does_not_follow_the_scene() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    std::fs::write(folder.join("frames.toml"), FRAMES).unwrap();
    export(folder, |_| {});
    bless(folder);
    let before = verify(folder);
    assert_eq!(differing(&before), [""; 0]);
    let of = |frame: &str| chosen(&before, frame).unwrap_or_default();
    assert!(of("ao").contains("--eye") && !of("ao").contains("--light"), "{}", of("ao"));
    assert!(of("share").contains("--ao-radius") && of("path").contains("--light") && of("preset").contains("--eye"));
    assert!(of("room").contains("--ao-radius") && of("room").contains("--eye"), "{}", of("room"));

    // all of the scene moved, or larger and stretched
    let diagonal = {
        let (lo, hi) = bare("stairs").bounds().unwrap();
        (hi - lo).length()
    };
    let changes = [
        DAffine3::from_translation(DVec3::new(0.02, 0.03, 0.01) * diagonal),
        DAffine3::from_scale(DVec3::new(1.05, 1.3, 1.05)),
    ];
    for by in changes {
        export(folder, |scene| transform(scene, by));
        let found = differing(&verify(folder));
        assert!(names(&found).starts_with(&["ao", "share", "path", "preset"]), "{by}: {found:#?}");
    }

    // one object more: nothing but what it covers, and what it shades, is another image
    let add = |scene: &mut Scene| {
        let (lo, hi) = scene.bounds().unwrap();
        let at = lo + (hi - lo) * DVec3::new(0.9, 1.4, 0.1);
        let geometry = Geometry::Triangles(small_box(at, 0.02 * (hi - lo).length()));
        scene.meshes.push(Mesh { name: "more".into(), geometry, material: 0, source: None });
        let mesh = scene.meshes.len() - 1;
        scene.instances.push(Instance { name: "more".into(), mesh, object_to_world: DAffine3::IDENTITY });
    };
    export(folder, add);
    let manifest = Manifest::load(folder).unwrap();
    let frame = manifest.frames.iter().find(|f| f.name == "path").unwrap();
    let golden = Golden::load(&manifest.golden(frame)).unwrap();
    let (mut frozen, mut scene) = (manifest.settings(frame), bare("stairs"));
    golden.freeze(&mut frozen, false).unwrap();
    let image = |scene: Scene| {
        let mut renderer = Renderer::new(device(), scene, &Default::default()).unwrap();
        renderer.image(&frozen, &mut NoControl).unwrap().f32("R").unwrap().to_vec()
    };
    let without = image(scene.clone());
    add(&mut scene);
    let with = image(scene);
    let others = without.iter().zip(&with).filter(|(a, b)| a != b).count();
    assert!(others < without.len() / 3, "{others} of {}", without.len());
    export(folder, |_| {});

    // golden images of earlier versions name camera and radius; light is chosen anew, and that is said
    forget(folder, &["chosen"]);
    let old = verify(folder);
    assert_eq!(differing(&old), [""; 0]);
    let notes: Vec<&FrameResult> = old.frames.iter().filter(|f| f.note.is_some()).collect();
    assert!(
        notes.len() == 1 && notes[0].frame == "path" && notes[0].note.as_ref().unwrap().contains("--light"),
        "{notes:?}"
    );
    export(folder, |scene| transform(scene, changes[0]));
    assert!(names(&differing(&verify(folder))).starts_with(&["ao", "share", "path"]));

    // metadata that make no sense
    export(folder, |_| {});
    forget(folder, &["camera_pose"]);
    let manifest = Manifest::load(folder).unwrap();
    let mut golden = Golden::load(&manifest.golden(&manifest.frames[0])).unwrap();
    golden.image.metadata.push(("chosen".into(), "--eye nowhere".into()));
    golden.save().unwrap();
    let outcome = &verify(folder).frames[0].outcome;
    assert!(
        matches!(outcome, Outcome::Failed(why) if why.contains("chosen") && why.contains("--bless")),
        "{outcome:?}"
    );
}

fn small_box(at: DVec3, size: f64) -> skylit::scene::TriangleMesh {
    let mut scene = bare("closed-box");
    let (lo, hi) = scene.bounds().unwrap();
    let Geometry::Triangles(mut mesh) = scene.meshes.remove(0).geometry else { panic!("triangles") };
    for p in &mut mesh.positions {
        let place = (p.as_dvec3() - lo) / (hi - lo);
        *p = (at + place * size).as_vec3();
    }
    mesh
}
