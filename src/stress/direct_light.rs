//! Direct light against closed forms at scales from 1e-6 to 1e6, through mirrored, sheared and
//! non-uniform transforms and nested glTF nodes. Part of section 1, [`super::scale`].

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use serde_json::{Value, json};

use super::sampling;
use super::scale::{linear_maps, load_text, through};
use super::{StressSession, Watch};
use crate::error::Result;
use crate::film::SampleSettings;
use crate::integrators::path::PathOptions;
use crate::oracle::closed_form::polygon_form_factor;
use crate::scene::builtin::shapes;
use crate::scene::{Camera, Geometry, Light, LightKind, Scene};

const ALBEDO: f64 = 0.6;
const EMITTED: f64 = 5.0;
/// Side of the floors, in units of their scale.
const SIDE: f64 = 10.0;

/// A floor of `scale` units that a light of each kind meets, and its reflected radiance.
pub fn lit_floors(scale: f64) -> Vec<(&'static str, Scene, f64)> {
    let at = DVec3::new(0.6, 0.8, 0.0) * scale;
    let lit = |kind: LightKind, intensity: f64| {
        let mut scene = unlit_floor(scale);
        let direction = -at.normalize();
        let intensity = Vec3::splat(intensity as f32);
        scene.lights.push(Light {
            name: String::new(),
            kind,
            intensity,
            position: at,
            direction,
            range: f64::INFINITY,
        });
        scene
    };
    let reflected = ALBEDO / std::f64::consts::PI * 3.0 * 0.8;
    let far = 3.0 * scale * scale;
    let spot = LightKind::Spot { inner_angle: 0.2, outer_angle: 0.4 };
    // a sphere under a half angle a, its centre at angle t from the normal: pi L sin^2 a cos t
    let (mut ball, radius) = (unlit_floor(scale), 0.2);
    sampling::add(&mut ball, shapes::sphere(at, radius * scale), sampling::emitter(EMITTED as f32));
    let of_ball = ALBEDO * EMITTED * radius * radius * 0.8;
    // and a rectangle, by Lambert's formula
    let mut pane = unlit_floor(scale);
    let (u, v) = (DVec3::new(-0.3, 0.1, 0.5) * scale, DVec3::new(0.4, 0.2, 0.3) * scale);
    // it faces the floor
    sampling::add(&mut pane, shapes::rectangle(at, v, u), sampling::emitter(EMITTED as f32));
    let (a, b) = (u * 0.5, v * 0.5);
    let seen = polygon_form_factor(DVec3::ZERO, DVec3::Y, &[at - a - b, at + a - b, at + a + b, at - a + b]);
    vec![
        ("point light", lit(LightKind::Point, far), reflected),
        ("spot light", lit(spot, far), reflected),
        ("directional light", lit(LightKind::Directional { angle: 0.0 }, 3.0), reflected),
        ("emitting sphere", ball, of_ball),
        ("emitting rectangle", pane, ALBEDO * EMITTED * seen),
    ]
}

fn unlit_floor(scale: f64) -> Scene {
    let camera = Camera::look_at(DVec3::new(0.0, 0.1 * scale, 0.0), DVec3::ZERO, DVec3::Z, 0.02);
    sampling::scene_of(vec![(shapes::floor(DVec3::ZERO, SIDE * scale), sampling::matte(ALBEDO as f32))], camera)
}

/// Transforms of nested nodes, outermost first, whose product is sheared and mirrored.
fn nested_nodes() -> [(DVec3, DQuat, DVec3); 3] {
    let turn = |x: f64, y: f64, z: f64| DQuat::from_euler(glam::EulerRot::XYZ, x, y, z);
    [
        (DVec3::new(2.0, -1.0, 0.5), turn(0.3, 0.9, -0.4), DVec3::new(2.0, 0.5, 1.0)),
        (DVec3::new(-0.5, 0.25, 1.0), turn(-0.7, 0.2, 1.1), DVec3::new(-1.0, 3.0, 0.75)),
        (DVec3::new(0.0, 1.5, -2.0), turn(1.2, -0.5, 0.1), DVec3::new(1.0, 0.25, 4.0)),
    ]
}

/// A scene of [`lit_floors`] from a glTF file with meshes and lights in nested nodes: the same but
/// for rounding. Spheres are no part of glTF.
pub fn nested(scene: &Scene) -> Result<Scene> {
    let nodes = nested_nodes();
    let to_world =
        nodes.iter().fold(DAffine3::IDENTITY, |m, &(t, r, s)| m * DAffine3::from_scale_rotation_translation(s, r, t));
    let (inverse, mirrors) = (to_world.inverse(), to_world.matrix3.determinant() < 0.0);

    // Writes buffers, views and accessors.
    let trs = |k: usize, children: Vec<usize>| {
        let (t, r, s) = nodes[k];
        json!({ "translation": t.to_array(), "rotation": r.to_array(), "scale": s.to_array(), "children": children })
    };
    let mut bytes: Vec<u8> = Vec::new();
    let mut accessors: Vec<Value> = Vec::new();
    let mut views: Vec<Value> = Vec::new();
    let mut view = |data: &[u8], accessor: Value| {
        let mut accessor = accessor;
        accessor["bufferView"] = json!(views.len());
        views.push(json!({ "buffer": 0, "byteOffset": bytes.len(), "byteLength": data.len() }));
        bytes.extend(data);
        accessors.push(accessor);
        accessors.len() - 1
    };

    // Puts meshes and lights into the innermost node's space.
    let mut leaves: Vec<Value> = Vec::new();
    let mut meshes: Vec<Value> = Vec::new();
    for mesh in &scene.meshes {
        let Geometry::Triangles(t) = &mesh.geometry else { continue };
        let positions: Vec<Vec3> =
            t.positions.iter().map(|p| inverse.transform_point3(p.as_dvec3()).as_vec3()).collect();
        let (lo, hi) =
            positions.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), p| (lo.min(*p), hi.max(*p)));
        let corners = json!({ "componentType": 5126, "type": "VEC3", "count": positions.len(), "min": lo.to_array(), "max": hi.to_array() });
        let position = view(bytemuck::cast_slice(&positions), corners);
        let indices = json!({ "componentType": 5125, "type": "SCALAR", "count": 3 * t.indices.len() });
        // a transform that mirrors turns faces over
        let turned: Vec<[u32; 3]> =
            t.indices.iter().map(|&[a, b, c]| if mirrors { [a, c, b] } else { [a, b, c] }).collect();
        let indices = view(bytemuck::cast_slice(&turned), indices);
        leaves.push(json!({ "mesh": meshes.len() }));
        meshes.push(
            json!({ "primitives": [{ "attributes": { "POSITION": position }, "indices": indices, "material": meshes.len() }] }),
        );
    }
    let mut lights: Vec<Value> = Vec::new();
    for light in &scene.lights {
        let mut entry = json!({ "intensity": light.intensity.x });
        entry["type"] = match light.kind {
            LightKind::Spot { inner_angle, outer_angle } => {
                entry["spot"] = json!({ "innerConeAngle": inner_angle, "outerConeAngle": outer_angle });
                json!("spot")
            }
            LightKind::Directional { .. } => json!("directional"),
            _ => json!("point"),
        };
        // it emits along -z of its node
        let along = inverse.transform_vector3(light.direction).normalize();
        leaves.push(json!({
            "translation": inverse.transform_point3(light.position).to_array(),
            "rotation": DQuat::from_rotation_arc(DVec3::NEG_Z, along).to_array(),
            "extensions": { "KHR_lights_punctual": { "light": lights.len() } },
        }));
        lights.push(entry);
    }

    // Writes the document and loads it.
    let data = base64::Engine::encode(&base64::engine::general_purpose::STANDARD, &bytes);
    let children = (3..3 + leaves.len()).collect();
    let nodes: Vec<Value> = [trs(0, vec![1]), trs(1, vec![2]), trs(2, children)].into_iter().chain(leaves).collect();
    let materials: Vec<Value> = meshes.iter().map(|_| json!({ "doubleSided": true })).collect();
    let mut document = json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": nodes, "meshes": meshes,
        "materials": materials, "accessors": accessors, "bufferViews": views,
        "buffers": [{ "byteLength": bytes.len(), "uri": format!("data:application/octet-stream;base64,{data}") }],
    });
    if !lights.is_empty() {
        document["extensionsUsed"] = json!(["KHR_lights_punctual"]);
        document["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
    }
    let mut loaded = load_text("nested.gltf", &document.to_string())?;
    // matte, which glTF's own model is not
    for mesh in &mut loaded.meshes {
        mesh.material = mesh.material.min(scene.materials.len() - 1);
    }
    loaded.materials.clone_from(&scene.materials);
    loaded.cameras.clone_from(&scene.cameras);
    Ok(loaded)
}

pub(super) fn run(session: &mut StressSession) -> Result<()> {
    for scale in [1e-6, 1e-3, 1.0, 1e3, 1e6] {
        for (what, scene, expected) in lit_floors(scale) {
            measure(session, &format!("{what}, scale {scale:e}"), expected, |_| Ok(scene.clone()))?;
        }
        let furnace = sampling::furnace(scale, sampling::matte(1.0));
        measure(session, &format!("furnace, matte, scale {scale:e}"), 1.0, |_| Ok(furnace.clone()))?;
    }
    for (what, scene, expected) in lit_floors(1.0) {
        for (map_name, map) in placed_maps() {
            measure(session, &format!("{what}, floor and emitter {map_name}"), expected, |_| {
                Ok(through(&scene, &map))
            })?;
        }
        if scene.meshes.iter().all(|m| matches!(m.geometry, Geometry::Triangles(_))) {
            measure(session, &format!("{what}, in nested nodes of a glTF file"), expected, |_| nested(&scene))?;
        }
    }
    Ok(())
}

/// The maps of [`linear_maps`], and the product of [`nested_nodes`].
fn placed_maps() -> Vec<(&'static str, DMat3)> {
    let nested =
        nested_nodes().iter().fold(DMat3::IDENTITY, |m, &(_, r, s)| m * DMat3::from_quat(r) * DMat3::from_diagonal(s));
    let mut maps = linear_maps();
    maps.push(("turned and stretched thrice", nested));
    maps
}

fn measure(
    session: &mut StressSession,
    name: &str,
    expected: f64,
    scene: impl Fn(&mut Watch) -> Result<Scene>,
) -> Result<()> {
    let (kinds, effort) = (session.setup().shading_tracers(), session.setup().effort());
    let options =
        PathOptions { samples: SampleSettings::new([16, 16], effort.pick(16, 1024), 5), ..Default::default() };
    session.measure_each(name, &kinds, |s, kind, w| {
        sampling::check_mean(s, kind, name, &scene(w)?, &options, expected, 2e-6, w)
    })
}
