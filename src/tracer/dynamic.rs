//! Dynamic scenes: instances move, meshes deform, the rest is static.
//!
//! What may change is declared when the scene is flattened ([`crate::scene::Motion`]);
//! [`Tracer::update`] applies the changes. The compute tracer refits its BVHs on the host or
//! rebuilds them (`dynamic_trees.rs`), the hardware tracers let the driver do so (`hardware.rs`).
//! The tracer of a static scene has no such state.

use std::collections::HashMap;
use std::time::Instant;

use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

use super::transform::{rows, transformed_bounds};
use super::{MaterialChange, Structure, Tracer};
use crate::accel::Aabb;
use crate::accel::flatten::{BlasGroup, FlatScene, Submesh, TlasInstance};
use crate::error::{Error, Result};
use crate::scene::animation::{Pose, PosedMesh};
use crate::scene::{Geometry, Material};

/// New vertices of a mesh.
#[derive(Clone, Copy, Debug)]
pub struct MeshChange<'a> {
    /// Index into [`crate::scene::Scene::meshes`].
    pub mesh: usize,
    /// Object-space positions, as many as the mesh has vertices. All finite.
    pub positions: &'a [Vec3],
    /// Unit shading normals, one per vertex; `None` leaves them unchanged. Without effect where the
    /// mesh or the tracer has none.
    pub normals: Option<&'a [Vec3]>,
}

/// Changes of a scene since the last update.
#[derive(Clone, Debug, Default)]
pub struct Changes<'a> {
    /// Instances (indices into [`crate::scene::Scene::instances`]) and their new object-to-world
    /// transforms, in the file's world space. Of two entries for one instance the last counts.
    pub instances: Vec<(usize, DAffine3)>,
    /// Meshes that have deformed.
    pub meshes: Vec<MeshChange<'a>>,
    /// Instances that are hidden from now on, or no longer.
    pub hidden: Vec<(usize, bool)>,
}

/// Bounds of an instance that moved or deformed in an update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovedBounds {
    /// World-space bounds of it before and after the update together, relative to the scene's
    /// origin.
    pub bounds: Aabb,
    /// Largest displacement of one of its points over half the diagonal of its bounds. At 1 and
    /// above, the positions before and after the update need not overlap.
    pub share: f32,
}

impl Pose {
    /// The changes for a tracer whose scene was flattened with the animation's
    /// [`crate::scene::animation::AnimationRig::motion`].
    pub fn changes(&self) -> Changes<'_> {
        fn mesh(posed: &PosedMesh) -> MeshChange<'_> {
            let shape = &posed.shape;
            let normals = Some(&shape.normals[..]).filter(|n| !n.is_empty());
            MeshChange { mesh: posed.mesh, positions: &shape.positions, normals }
        }
        Changes {
            instances: self.instances.clone(),
            meshes: self.meshes.iter().map(mesh).collect(),
            hidden: self.hidden.clone(),
        }
    }
}

/// Time and work of an update.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct UpdateStats {
    /// Seconds to refit or rebuild the BVHs of deformed meshes, and to upload them.
    pub mesh_seconds: f64,
    /// Seconds for the top level.
    pub top_seconds: f64,
    /// Meshes whose BVH was rebuilt, as indices into [`crate::scene::Scene::meshes`]; the others
    /// were refitted.
    pub rebuilt: Vec<usize>,
    /// The top level was rebuilt.
    pub top_rebuilt: bool,
    /// Largest SAH cost of a deformed mesh's BVH relative to its cost when it was built (compute
    /// tracer; else 1).
    pub growth: f64,
    /// Bounds of what moved or deformed.
    #[serde(skip)]
    pub moved: Vec<MovedBounds>,
    /// The change of materials.
    #[serde(skip)]
    pub materials: MaterialChange,
}

/// A mesh that may deform.
struct DeformingMesh {
    /// `None` when no instance uses the mesh.
    group: Option<usize>,
    /// Current vertices of the mesh, in object space.
    positions: Vec<Vec3>,
    normals: usize,
}

/// Host-side state of a dynamic scene.
pub(super) struct Dynamic {
    origin: DVec3,
    instances: Vec<TlasInstance>,
    /// Bounds of each group, in group space.
    bounds: Vec<Aabb>,
    /// Entry of the top level for each instance that may move, where it has one.
    entries: HashMap<usize, Option<usize>>,
    meshes: HashMap<usize, DeformingMesh>,
}

impl Dynamic {
    /// `None` for a static scene.
    pub fn new(flat: &FlatScene) -> Option<Self> {
        if flat.motion.is_none() {
            return None;
        }
        let placed: HashMap<usize, usize> =
            flat.instances.iter().enumerate().filter_map(|(k, p)| Some((p.scene_instance?, k))).collect();
        let meshes = flat.motion.meshes.iter().filter_map(|&mesh| {
            let Geometry::Triangles(t) = &flat.scene.meshes[mesh].geometry else { return None };
            let group = flat.group_of_mesh(mesh);
            Some((mesh, DeformingMesh { group, positions: t.positions.clone(), normals: t.normals.len() }))
        });
        Some(Self {
            origin: flat.origin,
            instances: flat.instances.clone(),
            bounds: flat.groups.iter().map(|g| group_bounds(flat, g)).collect(),
            entries: flat.motion.instances.iter().map(|i| (*i, placed.get(i).copied())).collect(),
            meshes: meshes.collect(),
        })
    }

    /// Checks that the changes were declared and are valid. Returns the TLAS instances that move,
    /// with their new transforms.
    fn check(&self, changes: &Changes) -> Result<Vec<(usize, DAffine3)>> {
        // meshes: declared as deforming, of the same size, and finite
        for change in &changes.meshes {
            let m = change.mesh;
            let Some(mesh) = self.meshes.get(&m) else {
                return Err(Error::Usage(format!("mesh {m} was not declared as deforming: list it in Motion::meshes")));
            };
            let count = |what: &str, given: usize, expected: usize| {
                if given == expected {
                    Ok(())
                } else {
                    Err(Error::Scene(format!("mesh {m} has {expected} {what}, but {given} were given")))
                }
            };
            count("vertices", change.positions.len(), mesh.positions.len())?;
            let bad = |v: &[Vec3]| v.par_iter().position_any(|p| !p.is_finite());
            if let Some(v) = bad(change.positions) {
                return Err(Error::Scene(format!("vertex {v} of mesh {m} is not finite: {}", change.positions[v])));
            }
            if let Some(normals) = change.normals.filter(|_| mesh.normals > 0) {
                count("normals", normals.len(), mesh.normals)?;
                if let Some(v) = bad(normals) {
                    return Err(Error::Scene(format!("normal {v} of mesh {m} is not finite: {}", normals[v])));
                }
            }
        }

        // instances: declared as moving, with transforms that can be inverted
        let mut moved = Vec::with_capacity(changes.instances.len());
        for &(i, object_to_world) in &changes.instances {
            let Some(&entry) = self.entries.get(&i) else {
                return Err(Error::Usage(format!(
                    "instance {i} was not declared as moving: list it in Motion::instances"
                )));
            };
            let to_world = DAffine3 { translation: object_to_world.translation - self.origin, ..object_to_world };
            let finite = |t: &DAffine3| rows(t).iter().flatten().all(|x| x.is_finite());
            if !finite(&to_world) || !finite(&to_world.inverse()) {
                return Err(Error::Scene(format!(
                    "instance {i} was given a transform that cannot be inverted (a scale of zero?)"
                )));
            }
            moved.extend(entry.map(|e| (e, to_world)));
        }
        if let Some((i, _)) = changes.hidden.iter().find(|(i, _)| !self.entries.contains_key(i)) {
            return Err(Error::Usage(format!(
                "instance {i} was not declared as one that may be hidden: list it in Motion::instances"
            )));
        }
        Ok(moved)
    }

    /// Hides and shows instances; returns the TLAS instances that were the other before.
    fn switch(&mut self, changes: &Changes) -> Vec<usize> {
        let mut switched = Vec::new();
        for (i, hidden) in &changes.hidden {
            let Some(entry) = self.entries.get(i).copied().flatten() else { continue };
            if std::mem::replace(&mut self.instances[entry].hidden, *hidden) != *hidden {
                switched.push(entry);
            }
        }
        switched
    }
}

/// Bounds of a group's primitives, in group space.
fn group_bounds(flat: &FlatScene, group: &BlasGroup) -> Aabb {
    let part = |part: &Submesh| {
        let count = flat.scene.meshes[part.mesh].geometry.primitive_count();
        (part.first_primitive..part.first_primitive + count)
            .into_par_iter()
            .with_min_len(4096)
            .map(|k| flat.primitive_bounds(group, part, k))
            .reduce(|| Aabb::EMPTY, |a, b| a.union(b))
    };
    group.submeshes.iter().map(part).fold(Aabb::EMPTY, |a, b| a.union(b))
}

impl Dynamic {
    /// Applies the changes to the host-side state and returns the bounds of what moved. Instances
    /// whose transform and vertices are unchanged are left out.
    fn advance(&mut self, changes: &Changes, moved: &[(usize, DAffine3)], switched: &[usize]) -> Vec<MovedBounds> {
        // bounds before the update and largest displacement of the deformed groups, in group space
        let mut ways: HashMap<usize, (Aabb, f32)> = HashMap::new();
        for change in &changes.meshes {
            let Some(mesh) = self.meshes.get_mut(&change.mesh) else { continue };
            let Some(group) = mesh.group else { continue };
            let (bounds, way) = mesh
                .positions
                .par_iter()
                .zip(change.positions)
                .with_min_len(4096)
                .map(|(a, b)| (Aabb { min: *b, max: *b }, a.distance(*b)))
                .reduce(|| (Aabb::EMPTY, 0.0), |a, b| (a.0.union(b.0), a.1.max(b.1)));
            mesh.positions.copy_from_slice(change.positions);
            let before = std::mem::replace(&mut self.bounds[group], bounds);
            if way > 0.0 {
                ways.insert(group, (before, way));
            }
        }

        // of two transforms for one instance the last counts
        let latest: HashMap<usize, DAffine3> = moved.iter().copied().collect();
        let mut out = Vec::new();
        for (k, p) in self.instances.iter_mut().enumerate() {
            let (old, new) = (p.to_world, latest.get(&k).copied().unwrap_or(p.to_world));
            let deformed = ways.get(&p.group).copied();
            let switches = switched.contains(&k);
            if old == new && deformed.is_none() && !switches {
                continue;
            }
            p.to_world = new;
            let now = self.bounds[p.group];
            let (before, way) = deformed.unwrap_or((now, 0.0));
            let (from, to) = (transformed_bounds(&old, before), transformed_bounds(&new, now));
            let scale = new.matrix3.x_axis.length().max(new.matrix3.y_axis.length()).max(new.matrix3.z_axis.length());
            let carried =
                corners(now).map(|c| old.transform_point3(c).distance(new.transform_point3(c))).fold(0.0, f64::max);
            let half = 0.5 * (to.max - to.min).length().max(f32::MIN_POSITIVE);
            // nothing is where it was before
            let share = if switches { 1.0 } else { (f64::from(way) * scale + carried) as f32 / half };
            out.push(MovedBounds { bounds: from.union(to), share });
        }
        out
    }
}

fn corners(b: Aabb) -> impl Iterator<Item = DVec3> {
    let pick = move |k: usize, axis: usize| f64::from(if k >> axis & 1 == 0 { b.min[axis] } else { b.max[axis] });
    (0..8).map(move |k| DVec3::new(pick(k, 0), pick(k, 1), pick(k, 2)))
}

impl Tracer {
    /// Applies changes of the scene. Ids in hits, streams and [`Tracer::scene_address`] stay valid;
    /// no stream may be running meanwhile. The origin stays where it was: a scene that moves far
    /// away from it loses precision.
    ///
    /// # Errors
    /// [`Error::Usage`] when a change was not declared in [`crate::scene::Motion`];
    /// [`Error::Scene`] for numbers that are not finite, wrong counts and transforms that cannot be
    /// inverted. These two leave the tracer unchanged. After [`Error::OutOfMemory`],
    /// [`Error::Vulkan`] and [`Error::DeviceLost`] the tracer must not be used any more.
    pub fn update(&mut self, changes: &Changes) -> Result<UpdateStats> {
        let Some(dynamic) = &mut self.dynamic else {
            return Err(Error::Usage("this tracer's scene is static: use FlatScene::with_motion".into()));
        };
        let moved = dynamic.check(changes)?;

        // the frame that was shown becomes the previous one, for motion vectors
        let mut stats = UpdateStats { growth: 1.0, ..Default::default() };
        let start = Instant::now();
        let deforming = changes.meshes.iter().filter_map(|c| dynamic.meshes.get(&c.mesh)?.group).collect();
        self.scene.begin_update(&dynamic.instances, moved.iter().map(|m| m.0).collect(), deforming)?;
        let switched = dynamic.switch(changes);
        stats.moved = dynamic.advance(changes, &moved, &switched);

        // vertices, then the trees over them: refitted, or built anew
        let mut deformed = false;
        for change in &changes.meshes {
            if let Some(normals) = change.normals {
                self.scene.set_normals(change.mesh, normals)?;
            }
            let Some(group) = dynamic.meshes.get(&change.mesh).and_then(|m| m.group) else { continue };
            self.scene.set_positions(group, change.positions)?;
            let (rebuilt, growth) = match &mut self.structure {
                Structure::Compute(h) => h.deform(&self.device, group, change.positions)?,
                Structure::Hardware { levels } => (levels.deform(&self.device, group, &self.scene)?, 1.0),
            };
            if rebuilt {
                stats.rebuilt.push(change.mesh);
            }
            stats.growth = stats.growth.max(growth);
            deformed = true;
        }
        stats.mesh_seconds = start.elapsed().as_secs_f64();

        // the top level, above what has changed
        if !deformed && moved.is_empty() && switched.is_empty() {
            return Ok(stats);
        }
        let start = Instant::now();
        let entries = moved.iter().map(|m| m.0).chain(switched);
        let latest: Vec<_> = entries.map(|k| (k, dynamic.instances[k].clone())).collect();
        self.scene.set_transforms(&latest)?;
        match &mut self.structure {
            Structure::Compute(h) => {
                stats.top_rebuilt = h.place(&dynamic.instances)?;
                self.scene.set_hierarchy(h)?;
            }
            Structure::Hardware { levels } => {
                levels.place(&self.device, &latest)?;
                stats.top_rebuilt = true;
            }
        }
        stats.top_seconds = start.elapsed().as_secs_f64();
        Ok(stats)
    }

    /// Changes materials, as indices into [`crate::scene::Scene::materials`]: those that were
    /// declared in [`crate::scene::Motion`]. Returns what of them has changed since they were set
    /// before.
    ///
    /// # Errors
    /// Those of the device.
    pub fn set_materials(&mut self, changed: &[(usize, Material)]) -> Result<MaterialChange> {
        if changed.is_empty() { Ok(MaterialChange::None) } else { self.scene.set_materials(changed) }
    }

    /// Reports the device time of tracing since the last update, in seconds, from which the next
    /// update decides between refitting and rebuilding ([`crate::accel::RefitPolicy`]). Without
    /// effect for a static scene.
    pub fn traced(&mut self, seconds: f64) {
        let Some(dynamic) = &self.dynamic else { return };
        match &mut self.structure {
            Structure::Compute(h) => h.traced(seconds, &dynamic.instances),
            Structure::Hardware { levels } => levels.traced(seconds),
        }
    }
}
