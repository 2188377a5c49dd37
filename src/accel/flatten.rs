//! From the scene's instances to the two levels that tracers build acceleration structures over.
//!
//! A *group* is the geometry of one bottom-level acceleration structure (BLAS). A mesh that has one instance gains nothing from a
//! BLAS of its own: all such meshes are baked into one group of triangles (and one of spheres) in world space. A mesh that has several
//! instances is a group of its own with several TLAS instances. Most files become one group with one TLAS instance; then there is no
//! top level.

use glam::{DAffine3, DVec3, Vec3};

use super::Aabb;
use super::features::{AlphaClass, Blend, alpha_classes};
use crate::error::Result;
use crate::scene::{AlphaMode, Geometry, Motion, Scene, Sphere};

/// A mesh within a group; `PartRecord` on the device.
#[derive(Clone, Debug)]
pub struct Submesh {
    /// Index into [`Scene::meshes`].
    pub mesh: usize,
    /// Index into [`Scene::instances`], when the group has one TLAS instance; otherwise [`TlasInstance::scene_instance`] has it.
    pub scene_instance: Option<usize>,
    /// Mesh to group space; identity unless baked.
    pub to_group: DAffine3,
    /// The first of its primitives in the group.
    pub first_primitive: usize,
    /// The first of its vertices in the group (triangles only).
    pub first_vertex: usize,
    /// `to_group` mirrors, so it reverses the winding.
    pub mirrored: bool,
    /// Its alpha is tested at every hit.
    pub alpha_tested: bool,
}

impl Submesh {
    /// The primitive of the group that follows its last.
    pub fn end(&self, flat: &FlatScene) -> usize {
        self.first_primitive + flat.scene.meshes[self.mesh].geometry.primitive_count()
    }
}

/// The geometry of one bottom-level acceleration structure: triangles or spheres, never both.
#[derive(Clone, Debug)]
pub struct BlasGroup {
    /// Spheres (true) or triangles.
    pub spheres: bool,
    /// Its meshes; alpha-tested ones last.
    pub submeshes: Vec<Submesh>,
    /// Triangles or spheres.
    pub primitive_count: usize,
    /// Vertices (triangles only).
    pub vertex_count: usize,
    /// Primitives before the first alpha-tested one.
    pub opaque_count: usize,
}

/// A TLAS instance.
#[derive(Clone, Debug)]
pub struct TlasInstance {
    /// Index into [`FlatScene::groups`].
    pub group: usize,
    /// Group space to world, relative to [`FlatScene::origin`].
    pub to_world: DAffine3,
    /// The instance of the scene, when the group has one mesh placed several times.
    pub scene_instance: Option<usize>,
}

/// The scene as tracers take it.
#[derive(Clone, Debug)]
pub struct FlatScene<'a> {
    /// Where it came from.
    pub scene: &'a Scene,
    /// The file's world coordinates of the tracers' origin ([`Scene::origin`]).
    pub origin: DVec3,
    /// Bottom-level structures.
    pub groups: Vec<BlasGroup>,
    /// Top-level entries.
    pub instances: Vec<TlasInstance>,
    /// Triangles and spheres left out because their material is nowhere opaque enough to be seen.
    pub absent_primitives: usize,
    /// What may change.
    pub motion: Motion,
    /// What partial coverage means.
    pub blend: Blend,
}

impl<'a> FlatScene<'a> {
    /// Groups the meshes of a scene of which nothing changes.
    pub fn new(scene: &'a Scene) -> Self {
        Self::group(scene, Motion::default(), Blend::Masked)
    }

    /// As [`FlatScene::new`], for paths: what covers a surface in part is there for a part of the rays.
    pub fn for_paths(scene: &'a Scene) -> Self {
        Self::group(scene, Motion::default(), Blend::Covered)
    }

    /// Groups the meshes of a scene; what may change is not baked into anything: its mesh is a group of its own, in object space.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] when `motion` names what is not there, or spheres to deform.
    pub fn with_motion(scene: &'a Scene, motion: Motion) -> Result<Self> {
        motion.check(scene)?;
        Ok(Self::group(scene, motion, Blend::Masked))
    }

    fn group(scene: &'a Scene, motion: Motion, blend: Blend) -> Self {
        let origin = scene.origin();
        let alpha = alpha_classes(scene, blend);
        let mut uses = vec![0usize; scene.meshes.len()];
        for i in &scene.instances {
            uses[i.mesh] += 1;
        }
        let mut changes = vec![false; scene.meshes.len()];
        for mesh in motion.meshes.iter().copied().chain(motion.instances.iter().map(|&i| scene.instances[i].mesh)) {
            changes[mesh] = true;
        }
        let relative = |t: DAffine3| DAffine3 { translation: t.translation - origin, ..t };
        let mut flat = Self { scene, origin, groups: Vec::new(), instances: Vec::new(), absent_primitives: 0, motion, blend };
        let mut world = [BlasGroup::empty(false), BlasGroup::empty(true)];
        let mut own: Vec<Option<usize>> = vec![None; scene.meshes.len()];
        // opaque meshes first, so that alpha-tested primitives are the tail of every group
        for tested in [false, true] {
            for (k, instance) in scene.instances.iter().enumerate() {
                let geometry = &scene.meshes[instance.mesh].geometry;
                let class = alpha[instance.mesh];
                if (class == AlphaClass::Tested) != tested || geometry.primitive_count() == 0 {
                    continue;
                }
                if class == AlphaClass::Absent {
                    flat.absent_primitives += geometry.primitive_count();
                    continue;
                }
                let to_world = relative(instance.object_to_world);
                let spheres = matches!(geometry, Geometry::Spheres(_));
                if uses[instance.mesh] == 1 && !changes[instance.mesh] && (!spheres || is_similarity(&to_world)) {
                    world[spheres as usize].push(scene, instance.mesh, Some(k), to_world, tested);
                } else {
                    let group = *own[instance.mesh].get_or_insert_with(|| {
                        let mut g = BlasGroup::empty(spheres);
                        g.push(scene, instance.mesh, None, DAffine3::IDENTITY, tested);
                        flat.groups.push(g);
                        flat.groups.len() - 1
                    });
                    flat.instances.push(TlasInstance { group, to_world, scene_instance: Some(k) });
                }
            }
        }
        for group in world.into_iter().filter(|g| g.primitive_count > 0) {
            flat.instances.push(TlasInstance { group: flat.groups.len(), to_world: DAffine3::IDENTITY, scene_instance: None });
            flat.groups.push(group);
        }
        flat
    }

    /// One entry that needs no transform: the second level can be skipped.
    pub fn is_single_level(&self) -> bool {
        self.motion.instances.is_empty() && matches!(self.instances.as_slice(), [p] if p.to_world == DAffine3::IDENTITY)
    }

    /// Does any primitive need its material asked at every hit?
    pub fn has_alpha(&self) -> bool {
        self.groups.iter().any(|g| g.opaque_count < g.primitive_count)
    }

    /// Is any of them there for a part of the rays only?
    pub fn has_coverage(&self) -> bool {
        let covers = |p: &Submesh| self.scene.materials[self.scene.meshes[p.mesh].material].alpha_mode == AlphaMode::Blend;
        self.blend == Blend::Covered && self.groups.iter().flat_map(|g| &g.submeshes).any(|p| p.alpha_tested && covers(p))
    }

    /// Is there a sphere?
    pub fn has_spheres(&self) -> bool {
        self.groups.iter().any(|g| g.spheres)
    }

    /// Primitives over all groups, each group counted once.
    pub fn primitive_count(&self) -> usize {
        self.groups.iter().map(|g| g.primitive_count).sum()
    }

    /// World bounds relative to the origin; empty when nothing is placed.
    pub fn bounds(&self) -> Aabb {
        let Some((lo, hi)) = self.scene.bounds() else { return Aabb::EMPTY };
        Aabb { min: (lo - self.origin).as_vec3(), max: (hi - self.origin).as_vec3() }
    }

    /// Position of a part's vertex in group space, exactly as it lies in device memory.
    pub fn vertex(&self, part: &Submesh, vertex: usize) -> Vec3 {
        match &self.scene.meshes[part.mesh].geometry {
            Geometry::Triangles(t) => place(part, t.positions[vertex]),
            Geometry::Spheres(s) => place(part, s[vertex].center),
        }
    }

    /// Corners of a part's triangle in group space. `triangle` counts in the mesh.
    pub fn triangle(&self, part: &Submesh, triangle: usize) -> [Vec3; 3] {
        match &self.scene.meshes[part.mesh].geometry {
            Geometry::Triangles(t) => t.indices[triangle].map(|i| place(part, t.positions[i as usize])),
            Geometry::Spheres(_) => unreachable!("triangles are asked of triangle groups only"),
        }
    }

    /// A part's sphere in group space.
    pub fn sphere(&self, part: &Submesh, sphere: usize) -> Sphere {
        match &self.scene.meshes[part.mesh].geometry {
            Geometry::Spheres(s) => {
                let scale = part.to_group.matrix3.x_axis.length();
                Sphere { center: place(part, s[sphere].center), radius: (s[sphere].radius as f64 * scale) as f32 }
            }
            Geometry::Triangles(_) => unreachable!("spheres are asked of sphere groups only"),
        }
    }

    /// The part that holds a group's primitive.
    pub fn submesh_of<'g>(&self, group: &'g BlasGroup, primitive: usize) -> &'g Submesh {
        &group.submeshes[group.submeshes.partition_point(|p| p.first_primitive <= primitive) - 1]
    }

    /// Box of a group's primitive in group space.
    pub fn primitive_bounds(&self, group: &BlasGroup, part: &Submesh, primitive: usize) -> Aabb {
        let k = primitive - part.first_primitive;
        if group.spheres {
            let s = self.sphere(part, k);
            // the sum is rounded: one step outwards holds the exact sphere
            let out = |v: Vec3, f: fn(f32) -> f32| Vec3::new(f(v.x), f(v.y), f(v.z));
            Aabb { min: out(s.center - s.radius, f32::next_down), max: out(s.center + s.radius, f32::next_up) }
        } else {
            Aabb::of_points(&self.triangle(part, k))
        }
    }
}

fn place(part: &Submesh, p: Vec3) -> Vec3 {
    if part.to_group == DAffine3::IDENTITY { p } else { part.to_group.transform_point3(p.as_dvec3()).as_vec3() }
}

/// Rotation, uniform scale, mirroring, translation: what keeps a sphere a sphere.
fn is_similarity(t: &DAffine3) -> bool {
    let m = t.matrix3;
    let (a, b, c) = (m.x_axis.length_squared(), m.y_axis.length_squared(), m.z_axis.length_squared());
    let skew = m.x_axis.dot(m.y_axis).abs() + m.y_axis.dot(m.z_axis).abs() + m.z_axis.dot(m.x_axis).abs();
    // far below what single precision could show
    let tolerance = 1e-10 * a;
    (a - b).abs() <= tolerance && (a - c).abs() <= tolerance && skew <= tolerance
}

impl BlasGroup {
    fn empty(spheres: bool) -> Self {
        Self { spheres, submeshes: Vec::new(), primitive_count: 0, vertex_count: 0, opaque_count: 0 }
    }

    fn push(&mut self, scene: &Scene, mesh: usize, scene_instance: Option<usize>, to_group: DAffine3, alpha_tested: bool) {
        let (primitives, vertices) = match &scene.meshes[mesh].geometry {
            Geometry::Triangles(t) => (t.indices.len(), t.positions.len()),
            Geometry::Spheres(s) => (s.len(), 0),
        };
        self.submeshes.push(Submesh {
            mesh,
            scene_instance,
            to_group,
            first_primitive: self.primitive_count,
            first_vertex: self.vertex_count,
            mirrored: to_group.matrix3.determinant() < 0.0,
            alpha_tested,
        });
        self.primitive_count += primitives;
        self.vertex_count += vertices;
        if !alpha_tested {
            self.opaque_count = self.primitive_count;
        }
    }
}
