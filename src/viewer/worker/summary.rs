//! A summary of a scene for the window: figures, objects, materials.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use glam::DVec3;

use crate::scene::{Geometry, Instance, Light, Material, Mesh, Scene};
use crate::viewer::request::{ObjectSummary, SceneSummary};

/// Most instances that are listed, for the memory of their names and bounds.
const MOST: usize = 500_000;

/// Figures of a scene from a file, or a built-in one, that took this time to load.
pub fn summary(source: &str, scene: &Scene, time: Duration) -> SceneSummary {
    let animations = scene.rig.as_ref().map_or(&[][..], |rig| rig.animations());
    let name = |k: usize, name: &str| if name.is_empty() { format!("{k}") } else { name.to_owned() };
    SceneSummary {
        load: 0,
        is_complete: scene.report.skipped_images == 0,
        source: source.to_owned(),
        files: scene.report.files.clone(),
        bounds: scene.bounds().unwrap_or_default(),
        cameras: scene.cameras.clone(),
        animations: animations.iter().enumerate().map(|(k, a)| (name(k, &a.name), a.duration)).collect(),
        scenes: scene.report.scenes.clone(),
        variants: scene.variants.clone(),
        textures: scene.textures.iter().enumerate().map(|(k, t)| name(k, &t.name)).collect(),
        objects: Arc::new(objects(scene)),
        nodes: Arc::new(scene.nodes.clone()),
        lights: scene.lights.iter().map(light_name).collect(),
        materials: Arc::new(materials(scene)),
        primitives: scene.triangle_count() + scene.sphere_count(),
        counts: [scene.instances.len(), scene.meshes.len(), scene.materials.len(), scene.lights.len()],
        seconds: time.as_secs_f64(),
    }
}

/// The instances that are listed.
fn objects(scene: &Scene) -> Vec<ObjectSummary> {
    let boxes: Vec<Option<(DVec3, DVec3)>> = scene.meshes.iter().map(mesh_bounds).collect();
    let names: Vec<Arc<str>> = scene.meshes.iter().map(|mesh| mesh.name.as_str().into()).collect();
    let object = |(k, instance): (usize, &Instance)| {
        let mesh = &scene.meshes[instance.mesh];
        ObjectSummary {
            name: instance.name.clone(),
            mesh: (instance.mesh, names[instance.mesh].clone()),
            material: mesh.material,
            primitives: mesh.geometry.primitive_count(),
            bounds: boxes[instance.mesh].map(|bounds| placed(instance, bounds)),
            is_hidden: scene.hidden.contains(&k),
        }
    };
    scene.instances.iter().take(MOST).enumerate().map(object).collect()
}

/// The materials as they are without edits.
fn materials(scene: &Scene) -> Vec<Material> {
    (0..scene.materials.len()).map(|k| scene.unedited_material(k).clone()).collect()
}

fn light_name(light: &Light) -> String {
    if light.name.is_empty() { light.kind.about().name.to_owned() } else { light.name.clone() }
}

/// World-space bounds of instances at rest, those of the boxes of their meshes.
pub fn bounds(scene: &Scene, instances: Range<usize>) -> Option<(DVec3, DVec3)> {
    let mut of_meshes = BTreeMap::new();
    let instances = scene.instances.get(instances)?.iter();
    let boxes = instances.filter_map(|instance| {
        let bounds = of_meshes.entry(instance.mesh).or_insert_with(|| mesh_bounds(&scene.meshes[instance.mesh]));
        bounds.map(|bounds| placed(instance, bounds))
    });
    boxes.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}

fn mesh_bounds(mesh: &Mesh) -> Option<(DVec3, DVec3)> {
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (lo, hi) = match &mesh.geometry {
        Geometry::Triangles(t) => {
            t.positions.iter().fold(none, |(lo, hi), p| (lo.min(p.as_dvec3()), hi.max(p.as_dvec3())))
        }
        Geometry::Spheres(spheres) => spheres.iter().fold(none, |(lo, hi), s| {
            let (centre, radius) = (s.center.as_dvec3(), f64::from(s.radius));
            (lo.min(centre - radius), hi.max(centre + radius))
        }),
    };
    (lo.x <= hi.x).then_some((lo, hi))
}

/// Bounds around those of a mesh where an instance has it.
fn placed(instance: &Instance, (lo, hi): (DVec3, DVec3)) -> (DVec3, DVec3) {
    let corner = |k: usize| {
        let at = std::array::from_fn(|axis| if k >> axis & 1 == 0 { lo[axis] } else { hi[axis] });
        instance.object_to_world.transform_point3(DVec3::from_array(at))
    };
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    (0..8).map(corner).fold(none, |(lo, hi), p| (lo.min(p), hi.max(p)))
}
