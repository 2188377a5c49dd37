//! Normals and texture coordinates that options ask for in place of the file's, or of none.

use std::collections::{BTreeSet, HashMap};

use glam::DAffine3;
use rayon::prelude::*;

use super::options::{GeometryOptions, NormalSource};
use super::projection::project;
use super::smoothing::smooth;
use super::split::drop_tangents;
use crate::error::Result;
use crate::memory::Budget;
use crate::scene::animation::Deformation;
use crate::scene::material::all_variants;
use crate::scene::{Geometry, Scene, TriangleMesh};

/// Bytes of host memory that a corner takes at most while its mesh is smoothed or projected, and as
/// a vertex of its own afterwards.
const BYTES_PER_CORNER: u64 = 200;

/// Meshes of more instances are smoothed each by itself.
const MAX_PLACES: usize = 64;

/// A mesh, and how it deforms, if it does.
type Part<'a> = (&'a mut TriangleMesh, Option<&'a mut Deformation>);

/// Gives meshes the normals and texture coordinates of `options`, and notes in the report how many
/// it was. Changed meshes have no tangents then: they follow from both.
///
/// # Errors
/// [`crate::Error::OutOfMemory`] where that takes more memory than the budget has.
pub(super) fn apply(scene: &mut Scene, options: GeometryOptions, budget: &Budget) -> Result<()> {
    if options == GeometryOptions::default() {
        return Ok(());
    }
    let corners = |g: &Geometry| if let Geometry::Triangles(t) = g { 3 * t.indices.len() as u64 } else { 0 };
    let corners: u64 = scene.meshes.iter().map(|m| corners(&m.geometry)).sum();
    // a refusal is what `check` says
    let _ = budget.take(BYTES_PER_CORNER * corners, || "computing normals or texture coordinates".to_owned());
    budget.check()?;
    replace_normals(scene, options.normals);
    if let Some(projection) = options.uv {
        let missing: Vec<Vec<usize>> = (0..scene.meshes.len()).map(|i| missing_sets(scene, i)).collect();
        scene.report.texcoords_projected = missing.iter().filter(|sets| !sets.is_empty()).count();
        parts(scene).into_par_iter().zip(missing).for_each(|(part, missing)| {
            let Some((mesh, deformation)) = part.filter(|_| !missing.is_empty()) else { return };
            let source = project(mesh, projection, &missing);
            deformation.into_iter().for_each(|d| d.reorder(&source));
        });
    }
    Ok(())
}

/// The triangle meshes of a scene; `None` for spheres.
fn parts(scene: &mut Scene) -> Vec<Option<Part<'_>>> {
    let deformations = match &mut scene.rig {
        Some(rig) => rig.deformations_mut(scene.meshes.len()),
        None => (0..scene.meshes.len()).map(|_| None).collect(),
    };
    let meshes = scene.meshes.iter_mut().zip(deformations);
    meshes
        .map(|(mesh, deformation)| match &mut mesh.geometry {
            Geometry::Triangles(triangles) => Some((triangles, deformation)),
            Geometry::Spheres(_) => None,
        })
        .collect()
}

fn replace_normals(scene: &mut Scene, normals: NormalSource) {
    let surfaces = surfaces(scene);
    let parts = parts(scene);
    let count = parts.iter().flatten().count();
    match normals {
        NormalSource::File => return,
        NormalSource::Flat => {
            for (mesh, _) in parts.into_iter().flatten() {
                mesh.normals = Vec::new();
                drop_tangents(mesh);
            }
        }
        NormalSource::Smooth(degrees) => {
            let mut together: Vec<Vec<Part>> = Vec::new();
            together.resize_with(surfaces.len(), Vec::new);
            for (part, surface) in parts.into_iter().zip(surfaces) {
                together[surface].extend(part);
            }
            together.into_par_iter().for_each(|parts| {
                let (mut meshes, deformations): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
                let sources = smooth(&mut meshes, degrees.to_radians());
                for (deformation, source) in deformations.into_iter().zip(sources) {
                    deformation.into_iter().for_each(|d| d.reorder(&source));
                }
            });
        }
    }
    scene.report.normals_replaced = count;
}

/// The surface that each mesh is a part of, as the index of its first mesh: meshes that are placed
/// alike, as an exporter cuts a model up by materials, are one, unless they move.
fn surfaces(scene: &Scene) -> Vec<usize> {
    let count = scene.meshes.len();
    let mut is_single = scene.rig.as_ref().map_or_else(|| vec![false; count], |rig| rig.deforming(scene));
    let moving = scene.rig.as_ref().map_or_else(|| vec![false; scene.instances.len()], |rig| rig.moving(scene));
    let mut places: Vec<Vec<&DAffine3>> = vec![Vec::new(); count];
    for (instance, moves) in scene.instances.iter().zip(moving) {
        let places = &mut places[instance.mesh];
        is_single[instance.mesh] |= moves || places.len() == MAX_PLACES;
        if !is_single[instance.mesh] {
            places.push(&instance.object_to_world);
        }
    }
    let mut first: HashMap<Vec<[u64; 12]>, usize> = HashMap::new();
    places
        .into_iter()
        .zip(is_single)
        .enumerate()
        .map(|(i, (places, is_single))| {
            let key = || places.iter().map(|t| t.to_cols_array().map(f64::to_bits)).collect();
            if is_single { i } else { *first.entry(key()).or_insert(i) }
        })
        .collect()
}

/// The sets of texture coordinates that textures of a mesh's materials use and the mesh lacks.
fn missing_sets(scene: &Scene, mesh: usize) -> Vec<usize> {
    let mesh = &scene.meshes[mesh];
    let Geometry::Triangles(triangles) = &mesh.geometry else { return Vec::new() };
    let used = all_variants(&scene.materials, mesh.material).into_iter().flat_map(|m| m.textures());
    let sets: BTreeSet<usize> = used.map(|slot| slot.texcoord).collect();
    sets.into_iter().filter(|set| triangles.texcoord_set(*set).is_empty()).collect()
}
