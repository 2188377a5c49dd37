//! The scene: plain host data, no Vulkan. Loaders make it, [`crate::accel::flatten`] turns it into
//! what tracers consume.
//!
//! Conventions, everywhere: right-handed, lengths in scene units (metres in glTF), angles in
//! radians, colours linear with sRGB primaries, triangles counter-clockwise seen from their front.

pub mod animation;
mod append;
pub mod blackbody;
mod bounds;
pub mod builtin;
pub mod camera;
pub mod camera_path;
pub mod environments;
pub mod export;
pub mod fingerprint;
pub mod ground;
pub mod inventory;
pub(crate) mod laid_ground;
pub mod light;
pub mod light_spec;
pub mod lights;
pub mod load;
pub mod material;
pub mod material_edit;
pub mod mesh;
pub mod motion;
pub mod nodes;
pub(crate) mod open_edges;
pub mod orbit;
pub mod settings;
pub mod sky;
mod take_out;
pub mod texture;

pub use animation::AnimationRig;
pub use camera::{Camera, ClipPlanes, Projection};
pub use camera_path::CameraPath;
pub use ground::{Ground, LaidGround};
pub use light::{Environment, EnvironmentMap, Light, Portal};
pub use lights::LightKind;
pub use material::{AlphaMode, Material, TextureSlot};
pub use mesh::{Geometry, Mesh, MeshSource, Sphere, TriangleMesh};
pub use motion::Motion;
pub use nodes::NodeTree;
pub use orbit::Orbit;
pub use settings::SceneSettings;
pub use texture::{Filter, TexelData, Texture, Wrap};

use std::collections::BTreeSet;
use std::path::PathBuf;

use glam::{DAffine3, DVec3, Vec3};

/// Largest coordinate, in object and world space: beyond it the triangle test's products of three
/// lengths overflow single precision, and rays would miss.
pub const MAX_COORDINATE: f64 = 1e12;

/// A mesh placed in the world.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Name of the node it came from; may be empty.
    pub name: String,
    /// Index into [`Scene::meshes`].
    pub mesh: usize,
    /// Object to world, composed on the host in f64. World here is the file's world, before
    /// rebasing by [`Scene::origin`].
    pub object_to_world: DAffine3,
}

/// Warnings and statistics of loading a scene; none of them is fatal.
#[derive(Clone, Debug, Default)]
pub struct LoadReport {
    /// One line each: ignored optional extensions, missing textures, ...
    pub warnings: Vec<String>,
    /// Files that it was read from: models, materials, buffers and images, also those that could
    /// not be read.
    pub files: Vec<PathBuf>,
    /// Options that decided what was loaded ([`load::LoadOptions::flags`]).
    pub options: Vec<String>,
    /// Names and texts of what a glTF file says of itself (KHR_xmp_json_ld).
    pub metadata: Vec<(String, String)>,
    /// Index of the node of a glTF file that each instance came from, in the order of
    /// [`Scene::instances`]; empty for other formats.
    pub instance_nodes: Vec<usize>,
    /// Names of the scenes of a glTF file, of which one is loaded.
    pub scenes: Vec<String>,
    /// Extensions that a glTF file names.
    pub extensions: Vec<FileExtension>,
    /// Images that were not decoded because [`load::LoadOptions::textures`] said so.
    pub skipped_images: usize,
    /// Triangles dropped because two of their corners coincide or their area is zero.
    pub degenerate_triangles: usize,
    /// Meshes whose normals were computed because the file had none.
    pub normals_computed: usize,
    /// Meshes whose normals are those that [`load::VertexOptions::normals`] asks for.
    pub normals_replaced: usize,
    /// Meshes that got texture coordinates by [`load::VertexOptions::uv`].
    pub texcoords_projected: usize,
    /// Meshes whose tangents were computed (MikkTSpace) because a normal map needs them and the
    /// file had none.
    pub tangents_computed: usize,
}

impl LoadReport {
    /// Warnings for the user, a sentence each, about dropped triangles, too.
    pub fn all_warnings(&self) -> Vec<String> {
        let n = self.degenerate_triangles;
        let dropped = (n > 0).then(|| format!("dropped {n} degenerate triangles"));
        self.warnings.iter().cloned().chain(dropped).collect()
    }

    /// Sentences about what options have made of the meshes.
    pub fn remarks(&self) -> Vec<String> {
        let meshes = |count: usize| if count == 1 { "1 mesh".to_owned() } else { format!("{count} meshes") };
        let [normals, uv] = [self.normals_replaced, self.texcoords_projected].map(|n| (n > 0).then(|| meshes(n)));
        let normals = normals.map(|meshes| format!("normals of {meshes}: computed from triangles (--normals)"));
        let uv = uv.map(|meshes| format!("texture coordinates of {meshes} without any: projected (--uv)"));
        normals.into_iter().chain(uv).collect()
    }
}

/// An extension that a glTF file names.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct FileExtension {
    /// Name, such as `KHR_materials_sheen`.
    pub name: String,
    /// The file cannot be read without it.
    pub required: bool,
    /// It is ignored.
    pub ignored: bool,
}

/// Render settings in a scene file (`.brhan` has them); options on the command line override them.
#[derive(Clone, Debug, Default)]
pub struct RenderHints {
    /// Image size in pixels.
    pub size: Option<[u32; 2]>,
    /// Samples per pixel.
    pub spp: Option<u32>,
    /// Maximum path depth, in bounces.
    pub max_depth: Option<u32>,
    /// Samples per pixel after which intermediate images are saved.
    pub save_intervals: Vec<u32>,
    /// The file requests a depth image of one ray per pixel.
    pub depth_image: bool,
}

/// A scene from a file, or a built-in one.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// File name or name of the built-in scene.
    pub name: String,
    /// Meshes in object space.
    pub meshes: Vec<Mesh>,
    /// Instances of meshes. Their indices are the instance ids in hits and images.
    pub instances: Vec<Instance>,
    /// The nodes of the file that have something below them.
    pub nodes: NodeTree,
    /// Instances that are not there until an animation shows them, as indices into
    /// [`Scene::instances`].
    pub hidden: BTreeSet<usize>,
    /// Edits by settings, and what they have replaced ([`SceneSettings`]).
    pub edited: Option<Box<material_edit::EditedScene>>,
    /// Materials; [`Mesh::material`] indexes them. Never empty once loaded.
    pub materials: Vec<Material>,
    /// Names of the variants of materials that a file has (KHR_materials_variants).
    pub variants: Vec<String>,
    /// Decoded images with their samplers.
    pub textures: Vec<Texture>,
    /// Lights that no surface emits.
    pub lights: Vec<Light>,
    /// Openings through which the environment is sampled; none: by itself.
    pub portals: Vec<Portal>,
    /// Cameras of the file; may be empty.
    pub cameras: Vec<Camera>,
    /// Environment light.
    pub environment: Environment,
    /// The ground that settings have put under it ([`Scene::lay_ground`]).
    pub ground: Option<LaidGround>,
    /// Render settings of the file.
    pub hints: RenderHints,
    /// Animations of the scene; `None` for a static scene.
    pub rig: Option<AnimationRig>,
    /// Warnings and statistics of the loader.
    pub report: LoadReport,
}

impl Scene {
    /// Number of triangles over all instances.
    pub fn triangle_count(&self) -> u64 {
        self.count(|g| match g {
            Geometry::Triangles(t) => t.indices.len(),
            Geometry::Spheres(_) => 0,
        })
    }

    /// Number of analytic spheres over all instances.
    pub fn sphere_count(&self) -> u64 {
        self.count(|g| match g {
            Geometry::Triangles(_) => 0,
            Geometry::Spheres(s) => s.len(),
        })
    }

    fn count(&self, f: impl Fn(&Geometry) -> usize) -> u64 {
        self.instances.iter().map(|i| f(&self.meshes[i.mesh].geometry) as u64).sum()
    }

    /// The instances that are not hidden.
    pub fn shown_instances(&self) -> impl Iterator<Item = &Instance> {
        self.instances.iter().enumerate().filter(|(k, _)| !self.hidden.contains(k)).map(|(_, instance)| instance)
    }

    /// The instances but a ground that settings have added, which is the last.
    pub fn standing(&self) -> &[Instance] {
        &self.instances[..self.instances.len() - usize::from(self.ground.is_some())]
    }

    /// Whether nothing in it emits light: it has no environment, no lights, and no surface that
    /// emits or shows its colour unlit.
    pub fn is_dark(&self) -> bool {
        self.lights.is_empty() && self.is_black()
    }

    /// Whether nothing in it emits light in its pose: as [`Scene::is_dark`], but there may be
    /// lights whose intensity is 0.
    pub fn is_black(&self) -> bool {
        let shines = |i: &Instance| {
            let material = &self.materials[self.meshes[i.mesh].material];
            material.unlit || material.emissive.max_element() > 0.0
        };
        let is_off = |l: &Light| l.intensity == Vec3::ZERO;
        self.environment == Environment::Black && self.lights.iter().all(is_off) && !self.shown_instances().any(shines)
    }

    /// World-space bounds `(min, max)` of the vertices and spheres of all instances but a ground
    /// that settings have added, or `None` for an empty scene.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        bounds::of_scene(self, self.ground.map(|ground| ground.mesh))
    }

    /// As [`Scene::bounds`], with such a ground.
    pub fn bounds_with_ground(&self) -> Option<(DVec3, DVec3)> {
        bounds::of_scene(self, None)
    }

    /// Whether a ray that leaves the scene may see an emitter: an environment, or a directional
    /// light with an angular diameter.
    pub fn has_visible_sky(&self) -> bool {
        let is_disk = |l: &Light| matches!(l.kind, LightKind::Directional { angle } if angle > 0.0);
        self.environment != Environment::Black || self.lights.iter().any(is_disk)
    }

    /// The point that tracers use as their origin, in the file's world space: zero for a scene
    /// around the origin, the centre of the bounds for one that lies far away from it compared with
    /// its size, so that single precision is spent on the scene and not on its distance. Rounded to
    /// f32, so that subtracting it is exact where it can be.
    pub fn origin(&self) -> DVec3 {
        self.bounds().map_or(DVec3::ZERO, |(lo, hi)| distant_centre(lo, hi))
    }
}

/// The centre of bounds that are far from the origin for their size, rounded to f32; zero for
/// others.
pub(crate) fn distant_centre(lo: DVec3, hi: DVec3) -> DVec3 {
    let (centre, extent) = ((lo + hi) * 0.5, (hi - lo).max_element());
    // up to four times its own size away costs two bits; leave such scenes where they are
    if centre.abs().max_element() <= 4.0 * extent { DVec3::ZERO } else { centre.as_vec3().as_dvec3() }
}
