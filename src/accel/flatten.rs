//! Arranges a scene's instances into the bottom-level (BLAS) and top-level (TLAS) geometry that
//! tracers build over.
//!
//! A mesh with a single instance gains nothing from a BLAS of its own: all such meshes are baked
//! into one *group* of triangles (and one of spheres) in world space. A mesh with several instances
//! is a group of its own with several TLAS instances. A group is the geometry of one BLAS. Most
//! files end up as one group with one TLAS instance, and the top level is skipped altogether.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::Aabb;
use super::features::{AlphaClass, Blend, alpha_classes};
use crate::error::Result;
use crate::scene::{AlphaMode, Geometry, Motion, Scene, Sphere};

/// A submesh: one scene mesh within the geometry of a BLAS (a group).
#[derive(Clone, Debug)]
pub struct Submesh {
    /// Index into [`Scene::meshes`].
    pub mesh: usize,
    /// Index into [`Scene::instances`] of the baked instance; `None` where the group has several
    /// TLAS instances, which then name it.
    pub scene_instance: Option<usize>,
    /// Transform from mesh space to group space; identity unless baked.
    pub to_group: DAffine3,
    /// Index of its first primitive in the group.
    pub first_primitive: usize,
    /// Index of its first vertex in the group (triangles only).
    pub first_vertex: usize,
    /// `to_group` mirrors, which flips the winding order.
    pub mirrored: bool,
    /// Hits need an alpha test against the material.
    pub alpha_tested: bool,
}

impl Submesh {
    /// Index in the group one past its last primitive.
    pub fn end(&self, flat: &FlatScene) -> usize {
        self.first_primitive + flat.scene.meshes[self.mesh].geometry.primitive_count()
    }
}

/// The geometry of one bottom-level acceleration structure (a group): triangles or spheres, never
/// both.
#[derive(Clone, Debug)]
pub struct BlasGroup {
    /// True for spheres, false for triangles.
    pub spheres: bool,
    /// Submeshes of the group; alpha-tested ones last.
    pub submeshes: Vec<Submesh>,
    /// Number of triangles or spheres.
    pub primitive_count: usize,
    /// Number of vertices (triangles only).
    pub vertex_count: usize,
    /// Number of opaque primitives, which precede the alpha-tested ones.
    pub opaque_count: usize,
}

/// An instance of a BLAS in the top-level acceleration structure.
#[derive(Clone, Debug)]
pub struct TlasInstance {
    /// Index into [`FlatScene::groups`].
    pub group: usize,
    /// Transform from group space to world space, relative to [`FlatScene::origin`].
    pub to_world: DAffine3,
    /// Index into [`Scene::instances`]; `None` for a baked group, whose submeshes name theirs.
    pub scene_instance: Option<usize>,
    /// Rays miss it, until an animation shows it.
    pub hidden: bool,
}

/// A scene arranged for building acceleration structures.
#[derive(Clone, Debug)]
pub struct FlatScene<'a> {
    /// The source scene.
    pub scene: &'a Scene,
    /// World position of the tracers' coordinate origin ([`Scene::origin`]).
    pub origin: DVec3,
    /// Geometry of each bottom-level structure.
    pub groups: Vec<BlasGroup>,
    /// Instances in the top-level structure.
    pub instances: Vec<TlasInstance>,
    /// Number of triangles and spheres dropped because their material is fully transparent.
    pub absent_primitives: usize,
    /// Instances and meshes that may move or deform between frames.
    pub motion: Motion,
    /// How alpha blending is interpreted.
    pub blend: Blend,
}

impl<'a> FlatScene<'a> {
    /// Arranges a static scene.
    pub fn new(scene: &'a Scene) -> Self {
        Self::group(scene, Motion::default(), Blend::Masked)
    }

    /// As [`FlatScene::new`], for path tracing: blended surfaces are intersected with a probability
    /// of their alpha ([`Blend::Stochastic`]).
    pub fn for_paths(scene: &'a Scene) -> Self {
        Self::group(scene, Motion::default(), Blend::Stochastic)
    }

    /// Arranges a dynamic scene. A mesh that may move or deform is not baked: it is a group of its
    /// own, in object space.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] when `motion` names an instance or mesh that does not exist, or asks
    /// spheres to deform.
    pub fn with_motion(scene: &'a Scene, motion: Motion) -> Result<Self> {
        Self::with_motion_and_blend(scene, motion, Blend::Masked)
    }

    /// As [`FlatScene::with_motion`], with an interpretation of alpha blending.
    ///
    /// # Errors
    /// As [`FlatScene::with_motion`].
    pub fn with_motion_and_blend(scene: &'a Scene, motion: Motion, blend: Blend) -> Result<Self> {
        motion.check(scene)?;
        Ok(Self::group(scene, motion, blend))
    }

    fn group(scene: &'a Scene, motion: Motion, blend: Blend) -> Self {
        let origin = scene.origin();
        let alpha = alpha_classes(scene, &motion, blend);

        // a mesh that is used once and never changes can be baked into world space
        let mut uses = vec![0usize; scene.meshes.len()];
        for i in &scene.instances {
            uses[i.mesh] += 1;
        }
        let mut changes = vec![false; scene.meshes.len()];
        for mesh in motion.meshes.iter().copied().chain(motion.instances.iter().map(|&i| scene.instances[i].mesh)) {
            changes[mesh] = true;
        }

        // in world space: a group of triangles and one of spheres; other meshes have their own
        let relative = |t: DAffine3| DAffine3 { translation: t.translation - origin, ..t };
        let mut flat =
            Self { scene, origin, groups: Vec::new(), instances: Vec::new(), absent_primitives: 0, motion, blend };
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
                // what is hidden and stays so is not there
                let hidden = flat.scene.hidden.contains(&k);
                if hidden && !flat.motion.instances.contains(&k) {
                    continue;
                }
                if class == AlphaClass::Absent {
                    flat.absent_primitives += geometry.primitive_count();
                    continue;
                }
                let to_world = relative(instance.object_to_world);
                let spheres = matches!(geometry, Geometry::Spheres(_));
                if uses[instance.mesh] == 1
                    && !changes[instance.mesh]
                    && (!spheres || may_bake_spheres(scene, instance.mesh, &to_world))
                {
                    world[spheres as usize].push(scene, instance.mesh, Some(k), to_world, tested);
                } else {
                    let group = *own[instance.mesh].get_or_insert_with(|| {
                        let mut g = BlasGroup::empty(spheres);
                        g.push(scene, instance.mesh, None, DAffine3::IDENTITY, tested);
                        flat.groups.push(g);
                        flat.groups.len() - 1
                    });
                    flat.instances.push(TlasInstance { group, to_world, scene_instance: Some(k), hidden });
                }
            }
        }

        // the groups in world space are instances, too
        for group in world.into_iter().filter(|g| g.primitive_count > 0) {
            flat.instances.push(TlasInstance {
                group: flat.groups.len(),
                to_world: DAffine3::IDENTITY,
                scene_instance: None,
                hidden: false,
            });
            flat.groups.push(group);
        }
        flat
    }

    /// Is there a single TLAS instance without a transform, so that the top level can be skipped?
    pub fn is_single_level(&self) -> bool {
        self.motion.instances.is_empty() && matches!(self.instances.as_slice(), [p] if p.to_world == DAffine3::IDENTITY)
    }

    /// Does any primitive need an alpha test?
    pub fn has_alpha(&self) -> bool {
        self.groups.iter().any(|g| g.opaque_count < g.primitive_count)
    }

    /// Does any primitive have stochastic alpha ([`Blend::Stochastic`])?
    pub fn has_stochastic_alpha(&self) -> bool {
        let covers =
            |p: &Submesh| self.scene.materials[self.scene.meshes[p.mesh].material].alpha_mode == AlphaMode::Blend;
        self.blend == Blend::Stochastic
            && self.groups.iter().flat_map(|g| &g.submeshes).any(|p| p.alpha_tested && covers(p))
    }

    /// Whether a submesh consists of spheres whose material has textures.
    pub fn has_sphere_textures(&self, part: &Submesh) -> bool {
        matches!(self.scene.meshes[part.mesh].geometry, Geometry::Spheres(_)) && is_textured(self.scene, part.mesh)
    }

    /// Does the scene have analytic spheres?
    pub fn has_spheres(&self) -> bool {
        self.groups.iter().any(|g| g.spheres)
    }

    /// Number of primitives over all groups, each group counted once however many instances it has.
    pub fn primitive_count(&self) -> usize {
        self.groups.iter().map(|g| g.primitive_count).sum()
    }

    /// World bounds relative to the origin; empty for a scene without geometry.
    pub fn bounds(&self) -> Aabb {
        let Some((lo, hi)) = self.scene.bounds_with_ground() else { return Aabb::EMPTY };
        Aabb { min: (lo - self.origin).as_vec3(), max: (hi - self.origin).as_vec3() }
    }

    /// Position of a submesh's vertex in group space, bit for bit as in device memory.
    pub fn vertex(&self, part: &Submesh, vertex: usize) -> Vec3 {
        match &self.scene.meshes[part.mesh].geometry {
            Geometry::Triangles(t) => place(part, t.positions[vertex]),
            Geometry::Spheres(s) => place(part, s[vertex].center),
        }
    }

    /// Corners of a submesh's triangle in group space. `triangle` is an index into the mesh.
    pub fn triangle(&self, part: &Submesh, triangle: usize) -> [Vec3; 3] {
        match &self.scene.meshes[part.mesh].geometry {
            Geometry::Triangles(t) => t.indices[triangle].map(|i| place(part, t.positions[i as usize])),
            Geometry::Spheres(_) => unreachable!("a triangle was requested of a group of spheres"),
        }
    }

    /// A submesh's sphere in group space. `sphere` is an index into the mesh.
    pub fn sphere(&self, part: &Submesh, sphere: usize) -> Sphere {
        match &self.scene.meshes[part.mesh].geometry {
            Geometry::Spheres(s) => {
                let scale = part.to_group.matrix3.x_axis.length();
                Sphere { center: place(part, s[sphere].center), radius: (s[sphere].radius as f64 * scale) as f32 }
            }
            Geometry::Triangles(_) => unreachable!("a sphere was requested of a group of triangles"),
        }
    }

    /// The index of the group that consists of this mesh alone, if it was not baked into a larger
    /// one.
    pub fn group_of_mesh(&self, mesh: usize) -> Option<usize> {
        self.groups.iter().position(|g| matches!(g.submeshes.as_slice(), [p] if p.mesh == mesh))
    }

    /// The submesh that contains a group's primitive.
    pub fn submesh_of<'g>(&self, group: &'g BlasGroup, primitive: usize) -> &'g Submesh {
        &group.submeshes[group.submeshes.partition_point(|p| p.first_primitive <= primitive) - 1]
    }

    /// Bounding box of a group's primitive in group space. `primitive` is an index into the group.
    pub fn primitive_bounds(&self, group: &BlasGroup, part: &Submesh, primitive: usize) -> Aabb {
        let k = primitive - part.first_primitive;
        if group.spheres {
            let s = self.sphere(part, k);
            // the sum is rounded: one step outwards makes the box contain the exact sphere
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

/// Is the transform a similarity (rotation, uniform scale, mirroring, translation), which maps
/// spheres to spheres?
/// Whether spheres can be placed in the world with the other ones: they stay spheres, and no
/// texture turns with them.
fn may_bake_spheres(scene: &Scene, mesh: usize, to_world: &DAffine3) -> bool {
    is_similarity(to_world) && (!is_textured(scene, mesh) || to_world.matrix3 == DMat3::IDENTITY)
}

/// Whether the material of a mesh has textures.
fn is_textured(scene: &Scene, mesh: usize) -> bool {
    scene.materials[scene.meshes[mesh].material].textures().next().is_some()
}

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

    fn push(
        &mut self,
        scene: &Scene,
        mesh: usize,
        scene_instance: Option<usize>,
        to_group: DAffine3,
        alpha_tested: bool,
    ) {
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
