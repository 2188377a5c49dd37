//! Checks and repairs that establish the guarantees of every loaded scene, whatever its format;
//! [`super::load`] lists them.

use std::path::Path;

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::options::GeometryOptions;
use super::{normals, orientation, ranges, tangents, vertices};
use crate::error::{Error, Result};
use crate::memory::Budget;
use crate::scene::MAX_COORDINATE;
use crate::scene::animation::{Deformation, renumbered};
use crate::scene::material::all_variants;
use crate::scene::{AnimationRig, Geometry, Instance, Material, Mesh, Scene, TriangleMesh};
use crate::stage;

/// Smallest extent of a scene: below it products of lengths are lost in single precision, those of
/// drivers' triangle tests first.
const MIN_EXTENT: f64 = 1e-12;

/// Vertices or triangles that a thread looks at at least.
const MIN_LENGTH: usize = 1 << 16;

/// Largest element of an inverse transform, for the same reason.
const MAX_INVERSE: f64 = 1e30;

/// Checks and repairs `scene`, which was read from `path`, and gives its meshes the normals and
/// texture coordinates of `options`.
pub(super) fn finish(scene: &mut Scene, path: &Path, options: GeometryOptions, budget: &Budget) -> Result<()> {
    let _stage = stage::begin("checking meshes");
    check(scene, path)?;
    if scene.materials.is_empty() {
        scene.materials.push(Material::default());
    }
    ranges::apply(scene);
    texture_slots(scene);
    bake_singular(scene, budget);
    budget.check().map_err(|e| e.in_file(path))?;
    drop_unplaced(scene);
    vertices::apply(scene, options, budget).map_err(|e| e.in_file(path))?;

    // each mesh by itself
    let materials = &scene.materials;
    let deforming = match &mut scene.rig {
        Some(rig) => rig.deformations_mut(scene.meshes.len()),
        None => (0..scene.meshes.len()).map(|_| None).collect(),
    };
    let meshes = scene.meshes.par_iter_mut().zip(deforming);
    let notes: Vec<Notes> =
        meshes.map(|(mesh, deformation)| repair(mesh, &all_variants(materials, mesh.material), deformation)).collect();
    for note in notes {
        scene.report.warnings.extend(note.warnings);
        scene.report.degenerate_triangles += note.degenerate;
        scene.report.normals_computed += usize::from(note.flat && scene.report.normals_replaced == 0);
        scene.report.tangents_computed += usize::from(note.tangents);
    }
    if let Some(rig) = &mut scene.rig {
        orientation::turn_rig(rig, options.up);
        AnimationRig::apply_rest_pose(scene);
        check(scene, path)?;
    }
    drop_empty(scene);
    orientation::apply(scene, options.up);
    extent(scene, path)
}

/// Checks for errors that cannot be repaired: positions that are not finite, indices out of range.
pub(super) fn check(scene: &Scene, path: &Path) -> Result<()> {
    for (m, mesh) in scene.meshes.iter().enumerate() {
        check_mesh(mesh).map_err(|e| Error::input(path, format!("mesh {m} `{}`: {e}", mesh.name)))?;
    }
    match scene.instances.iter().find(|i| !i.object_to_world.is_finite()) {
        Some(i) => Err(Error::input(path, format!("node `{}` has a transform that is not finite", i.name))),
        None => Ok(()),
    }
}

fn check_mesh(mesh: &Mesh) -> Result<(), String> {
    const REMEDY: &str = "repair the model and export it again";
    let triangles = match &mesh.geometry {
        Geometry::Triangles(triangles) => triangles,
        Geometry::Spheres(spheres) => {
            let good = |s: &crate::scene::Sphere| s.center.is_finite() && s.radius.is_finite() && s.radius > 0.0;
            return match spheres.iter().position(|s| !good(s)) {
                Some(i) => {
                    Err(format!("sphere {i} has a radius that is not above zero, or a value that is not finite"))
                }
                None => Ok(()),
            };
        }
    };
    let far = |p: &glam::Vec3| f64::from(p.abs().max_element()) > MAX_COORDINATE;
    let count = triangles.positions.len();
    let outside = |t: &[u32; 3]| t.iter().any(|&i| i as usize >= count);

    // nearly all are good, and then the first bad one need not be found
    let positions = triangles.positions.par_iter().with_min_len(MIN_LENGTH);
    let indices = triangles.indices.par_iter().with_min_len(MIN_LENGTH);
    if positions.all(|p| p.is_finite() && !far(p)) && !indices.any(outside) {
        return Ok(());
    }
    if let Some(i) = triangles.positions.iter().position(|p| !p.is_finite()) {
        return Err(format!("the position of vertex {i} is not finite (NaN or infinite): {REMEDY}"));
    }
    if let Some(i) = triangles.positions.iter().position(far) {
        return Err(format!("the position of vertex {i} is beyond {MAX_COORDINATE:e} units: scale the model down"));
    }
    if let Some(t) = triangles.indices.iter().position(outside) {
        let index = triangles.indices[t].iter().max().copied().unwrap_or(0);
        return Err(format!("triangle {t} refers to vertex {index}, but there are only {count}: {REMEDY}"));
    }
    Ok(())
}

/// Makes the transforms of texture slots finite.
fn texture_slots(scene: &mut Scene) {
    for slot in scene.materials.iter_mut().flat_map(Material::texture_slots_mut).flatten() {
        if !slot.transform.is_finite() {
            slot.transform = glam::Affine2::IDENTITY;
        }
    }
}

/// Bytes of a mesh in host memory, at most.
fn host_bytes(mesh: &Mesh) -> u64 {
    match &mesh.geometry {
        Geometry::Triangles(t) => 12 * t.indices.len() as u64 + 80 * t.positions.len() as u64,
        Geometry::Spheres(spheres) => size_of_val(&spheres[..]) as u64,
    }
}

/// Handles singular transforms, because tracers invert transforms. A mesh that is scaled to a plane
/// is baked: the transform is applied to its vertices. An instance that is scaled to a line or a
/// point, which is a way of hiding it, is dropped. Animated instances may grow again, and deforming
/// meshes cannot be baked: both get a minimum scale instead ([`AnimationRig::apply_rest_pose`]).
fn bake_singular(scene: &mut Scene, budget: &Budget) {
    let before = scene.instances.len();
    let moving = scene.rig.as_ref().map(|rig| rig.moving(scene));
    let moves = |i: usize| moving.as_ref().is_some_and(|m| m[i]);

    // instances that are scaled to a line or a point show nothing
    let shows = |(i, instance): (usize, &Instance)| {
        let m = &instance.object_to_world.matrix3;
        let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis];
        moves(i) || [x.cross(y), y.cross(z), z.cross(x)].iter().any(|n| *n != DVec3::ZERO)
    };
    let keep: Vec<bool> = scene.instances.iter().enumerate().map(shows).collect();
    let moving: Option<Vec<bool>> =
        moving.as_ref().map(|m| m.iter().zip(&keep).filter(|(_, k)| **k).map(|(m, _)| *m).collect());
    retain_instances(scene, &keep);
    let hidden = before - scene.instances.len();
    if hidden > 0 {
        scene.report.warnings.push(format!("{hidden} instances are scaled to nothing: left out"));
    }

    // those that are scaled to a plane get a mesh of their own, in world space
    let deforming = scene.rig.as_ref().map(|rig| rig.deforming(scene));
    for (i, instance) in scene.instances.iter_mut().enumerate() {
        if moving.as_ref().is_some_and(|m| m[i]) || deforming.as_ref().is_some_and(|d| d[instance.mesh]) {
            continue;
        }
        let inverse = instance.object_to_world.inverse().to_cols_array();
        if inverse.iter().all(|x| x.abs() <= MAX_INVERSE) {
            continue;
        }

        let source = &scene.meshes[instance.mesh];
        if budget
            .take(host_bytes(source), || format!("the mesh `{}`, which is scaled to a plane,", source.name))
            .is_err()
        {
            return;
        }
        let geometry = match &source.geometry {
            Geometry::Triangles(t) => {
                let place = |p: &glam::Vec3| instance.object_to_world.transform_point3(p.as_dvec3()).as_vec3();
                let positions = t.positions.iter().map(place).collect();
                // empty normals: the inverse that would turn them does not exist
                Geometry::Triangles(TriangleMesh { positions, normals: Vec::new(), tangents: Vec::new(), ..t.clone() })
            }
            Geometry::Spheres(_) => Geometry::Spheres(Vec::new()),
        };
        let mesh = Mesh { name: source.name.clone(), geometry, material: source.material, source: None };
        instance.mesh = scene.meshes.len();
        instance.object_to_world = DAffine3::IDENTITY;
        scene.meshes.push(mesh);
        if let Some(rig) = &mut scene.rig {
            rig.release(i);
        }
    }
}

#[derive(Default)]
struct Notes {
    warnings: Vec<String>,
    degenerate: usize,
    flat: bool,
    tangents: bool,
}

/// `materials`: that of the mesh, and what it is in variants of the scene. `deformation`: how the
/// mesh deforms, if it does; the mesh is undeformed then.
fn repair(mesh: &mut Mesh, materials: &[&Material], deformation: Option<&mut Deformation>) -> Notes {
    let mut notes = Notes::default();
    let Geometry::Triangles(triangles) = &mut mesh.geometry else { return notes };

    // degenerate triangles
    let before = triangles.indices.len();
    let positions = &triangles.positions;
    let opens = |t| deformation.as_ref().is_some_and(|d| !d.stays_flat(t, positions));
    if triangles.indices.par_iter().with_min_len(MIN_LENGTH).any(|&t| is_degenerate(t, positions)) {
        triangles.indices.retain(|&t| !is_degenerate(t, positions) || opens(t));
    }
    notes.degenerate = before - triangles.indices.len();
    if triangles.indices.is_empty() {
        return notes;
    }
    let mut warn = |text: String| notes.warnings.push(format!("mesh `{}`: {text}", mesh.name));

    // texture coordinates and colours
    for (material, slot) in materials.iter().flat_map(|m| m.textures().map(move |slot| (m, slot))) {
        if triangles.texcoord_set(slot.texcoord).is_empty() {
            let (number, name) = (slot.texcoord, &material.name);
            warn(format!(
                "has no texture coordinates {number}, which textures of its material `{name}` use: taken as zero; --uv box (or spherical, cylindrical) makes some"
            ));
            let count = triangles.positions.len();
            triangles.texcoord_set_mut(slot.texcoord).resize(count, glam::Vec2::ZERO);
        }
    }
    let texcoords = triangles.texcoord_sets_mut().flatten();
    let bad: usize = texcoords.filter(|t| !t.is_finite()).map(|t| *t = glam::Vec2::ZERO).count();
    let bad_colors = triangles.colors.iter_mut().filter(|c| !c.is_finite()).map(|c| *c = glam::Vec4::ONE).count();
    if bad + bad_colors > 0 {
        warn(format!("{bad} texture coordinates and {bad_colors} colours were not finite: replaced"));
    }

    // normals and tangents
    if triangles.normals.is_empty() {
        notes.flat = true;
    } else {
        let repaired = normals::repair(triangles);
        if repaired > 0 {
            notes.warnings.push(format!("mesh `{}`: {repaired} normals had no direction: computed", mesh.name));
        }
    }
    let with_tangents = materials.iter().find(|m| m.needs_tangents());
    let Some(material) = with_tangents else {
        triangles.tangents = Vec::new();
        return notes;
    };
    if !tangents::normalize(triangles) {
        if material.anisotropy.strength > 0.0
            && !(0..triangles.texcoord_sets()).any(|set| tangents::varies(triangles.texcoord_set(set)))
        {
            let text = "is anisotropic and has neither tangents nor texture coordinates: stretched around its y axis";
            notes.warnings.push(format!("mesh `{}`: {text}", mesh.name));
        }
        let source = tangents::compute(triangles, material);
        if let Some(deformation) = deformation {
            deformation.reorder(&source);
        }
        notes.tangents = true;
    }
    notes
}

/// Whether two corners coincide or all three lie on a line, exactly, in f64: such triangles are
/// dropped.
pub fn is_degenerate(t: [u32; 3], positions: &[glam::Vec3]) -> bool {
    if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
        return true;
    }
    let [a, b, c] = t.map(|i| positions[i as usize].as_dvec3());
    (b - a).cross(c - a) == DVec3::ZERO
}

/// Removes meshes without an instance.
fn drop_unplaced(scene: &mut Scene) {
    let mut keep = vec![false; scene.meshes.len()];
    for instance in &scene.instances {
        keep[instance.mesh] = true;
    }
    retain_meshes(scene, &keep);
}

/// Removes meshes without a triangle or sphere, and their instances: acceleration structures must
/// not be empty.
fn drop_empty(scene: &mut Scene) {
    let keep: Vec<bool> = scene.meshes.iter().map(|m| m.geometry.primitive_count() > 0).collect();
    for mesh in scene.meshes.iter().zip(&keep).filter(|(_, keep)| !**keep).map(|(m, _)| m) {
        scene.report.warnings.push(format!("mesh `{}` has no triangles or spheres: left out", mesh.name));
    }
    let placed: Vec<bool> = scene.instances.iter().map(|i| keep[i.mesh]).collect();
    retain_instances(scene, &placed);
    retain_meshes(scene, &keep);
}

fn retain_instances(scene: &mut Scene, keep: &[bool]) {
    if keep.iter().all(|&k| k) {
        return;
    }
    let mut each = keep.iter();
    scene.instances.retain(|_| each.next().copied().unwrap_or(true));
    let mut each = keep.iter();
    scene.report.instance_nodes.retain(|_| each.next().copied().unwrap_or(true));
    let number = renumbered(keep);
    scene.nodes.keep_instances(keep);
    scene.hidden = scene.hidden.iter().filter(|i| keep[**i]).map(|i| number[*i]).collect();
    if let Some(rig) = &mut scene.rig {
        rig.keep_instances(keep);
    }
}

fn retain_meshes(scene: &mut Scene, keep: &[bool]) {
    if keep.iter().all(|&k| k) {
        return;
    }
    let mut index = Vec::with_capacity(keep.len());
    let mut next = 0;
    for &k in keep {
        index.push(next);
        next += usize::from(k);
    }
    for instance in &mut scene.instances {
        instance.mesh = index[instance.mesh];
    }
    if let Some(rig) = &mut scene.rig {
        rig.keep_meshes(keep, &index);
    }
    let mut keep = keep.iter();
    scene.meshes.retain(|_| keep.next().copied().unwrap_or(true));
}

/// Fails for an empty scene, and for coordinates beyond [`MAX_COORDINATE`].
fn extent(scene: &Scene, path: &Path) -> Result<()> {
    let Some((lo, hi)) = scene.bounds() else {
        let dropped = scene.report.degenerate_triangles;
        let why = if dropped > 0 { format!(" ({dropped} degenerate ones were dropped)") } else { String::new() };
        let name = path.display();
        return Err(Error::Scene(format!("{name}: the scene has no triangles and no spheres{why}: nothing to render")));
    };
    if lo.abs().max(hi.abs()).max_element() > MAX_COORDINATE {
        return Err(Error::Scene(format!(
            "{}: the scene reaches beyond {MAX_COORDINATE:e} units: scale it down",
            path.display()
        )));
    }
    let size = (hi - lo).max_element();
    if size < MIN_EXTENT {
        return Err(Error::Scene(format!(
            "{}: the scene is {size:.1e} units large, and single precision has the products of three lengths from {MIN_EXTENT:e} on: scale it up",
            path.display()
        )));
    }
    Ok(())
}
