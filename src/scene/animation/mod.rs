//! Animation: a node hierarchy, skins, morph targets, and channels that change them over time, as
//! in glTF. All of it is computed on the host, independent of tracers.
//!
//! [`RigParts`] is the description, [`AnimationRig`] the same after validation against a scene. A
//! static scene has no rig. Playing goes in two steps: [`AnimationRig::motion`] declares once what
//! an animation changes, so that tracers keep state for that only ([`super::Motion`]);
//! [`AnimationRig::pose`] computes the state at any time.
//!
//! Matrices are composed in f64 and vertices are rounded to f32 at the end. A skinned mesh lies in
//! world space, as glTF wants it; its instance only has a translation, which is zero unless the
//! skeleton stands far from the origin.

mod check;
mod deform;
mod keep;
mod pose;
mod sampler;
mod transform;
mod values;

pub use deform::{Deformation, Influences, MorphTarget, VertexData};
pub use pose::{Playback, Pose, PosedMesh};
pub use sampler::{Interpolation, Sampler};
pub(in crate::scene) use transform::{from_skin_place, skin_place};
pub use values::{
    AnimatedLight, AnimatedMaterial, CameraProperty, LightProperty, MaterialProperty, SLOTS, Target, TextureTransform,
    ValueChannel,
};

use std::collections::BTreeMap;

use glam::{DAffine3, DQuat, DVec3};

use super::material::VariantMaterials;
use super::{Camera, Light, Material, Scene};
use crate::error::{Error, Result};

/// Transform of a node relative to its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LocalTransform {
    /// Translation, rotation and scale (applied in reverse order), which animations can change.
    Trs {
        /// Translation, in units of the parent.
        translation: DVec3,
        /// Rotation, a unit quaternion.
        rotation: DQuat,
        /// Scale along the node's axes.
        scale: DVec3,
    },
    /// An affine matrix, which cannot be animated.
    Matrix(DAffine3),
}

impl Default for LocalTransform {
    fn default() -> Self {
        Self::Trs { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE }
    }
}

impl LocalTransform {
    /// The transform from node to parent.
    pub fn affine(&self) -> DAffine3 {
        match *self {
            Self::Trs { translation, rotation, scale } => {
                DAffine3::from_scale_rotation_translation(scale, rotation, translation)
            }
            Self::Matrix(m) => m,
        }
    }

    /// Decomposes the transform into translation, rotation and scale; `None` for a matrix that is
    /// no product of these.
    pub(in crate::scene) fn taken_apart(&self) -> Option<Self> {
        let Self::Matrix(matrix) = *self else { return Some(*self) };
        let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
        let parts = Self::Trs { translation, rotation, scale };
        let largest = matrix.matrix3.to_cols_array().into_iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        // files hold single precision
        parts.affine().matrix3.abs_diff_eq(matrix.matrix3, 1e-5 * largest).then_some(parts)
    }
}

/// A node of the hierarchy, in its rest pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Node {
    /// Name in the file; may be empty.
    pub name: String,
    /// Index of its parent, which comes before it in [`RigParts::nodes`].
    pub parent: Option<usize>,
    /// Transform relative to the parent.
    pub local: LocalTransform,
    /// Weights of the morph targets of its meshes, one per target.
    pub weights: Vec<f32>,
    /// Whether it and all below it are hidden at rest.
    pub hidden: bool,
}

/// A skin (glTF): joints and inverse bind matrices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// Name in the file; may be empty.
    pub name: String,
    /// Joints, as indices into [`RigParts::nodes`].
    pub joints: Vec<usize>,
    /// Inverse bind matrix of each joint: from the undeformed mesh to the joint's space.
    pub inverse_bind: Vec<DAffine3>,
}

/// The property of a node that a channel animates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Property {
    /// Translation; three numbers.
    Translation,
    /// Rotation; a quaternion x, y, z, w.
    Rotation,
    /// Scale; three numbers. It is clamped so that the extent of an instance is at least 1e-7 of
    /// the scene's size in every direction, because tracers invert transforms.
    Scale,
    /// Weights of morph targets, as many as the node has.
    Weights,
}

/// The keyframes of one property of one node.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Index into [`RigParts::nodes`].
    pub node: usize,
    /// The animated property.
    pub property: Property,
    /// Values of the property over time, in seconds.
    pub sampler: Sampler,
}

/// An animation of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// Name in the file; may be empty.
    pub name: String,
    /// Time of the last key in seconds; zero when there is none.
    pub duration: f64,
    /// Channels, at most one for each property of a node.
    pub channels: Vec<Channel>,
    /// Channels of other values, at most one for each target.
    pub values: Vec<ValueChannel>,
}

/// The data of an [`AnimationRig`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RigParts {
    /// The node hierarchy, parents before children.
    pub nodes: Vec<Node>,
    /// Skins.
    pub skins: Vec<Skin>,
    /// Meshes that deform, each listed once.
    pub deformations: Vec<Deformation>,
    /// Animations that can be played.
    pub animations: Vec<Animation>,
    /// The node of each of [`Scene::instances`]; `None` for a static instance, and for skinned
    /// meshes.
    pub instances: Vec<Option<usize>>,
    /// The node of each of [`Scene::cameras`]; `None` for a static camera.
    pub cameras: Vec<Option<usize>>,
    /// The node of each of the first of [`Scene::lights`]; `None` for a static light, as are those
    /// beyond.
    pub lights: Vec<Option<usize>>,
    /// Materials that animations may change.
    pub materials: Vec<AnimatedMaterial>,
    /// Lights that animations may change beside moving them.
    pub animated_lights: Vec<AnimatedLight>,
    /// Cameras that animations may change beside moving them: those of [`Scene::cameras`] that are
    /// one camera of the file.
    pub animated_cameras: Vec<Vec<usize>>,
    /// Instances that an animation may hide, and the node by which each is hidden or shown.
    pub switched_instances: Vec<(usize, usize)>,
    /// Lights that an animation may hide, and the node by which each is hidden or shown.
    pub switched_lights: Vec<(usize, usize)>,
}

/// A scene's animations, with the nodes, skins and meshes that they act on.
#[derive(Clone, Debug)]
pub struct AnimationRig {
    parts: RigParts,
    /// World transforms of the nodes at rest.
    rest: Vec<DAffine3>,
    /// For each channel of each animation: whether it keeps its property at the rest value.
    still: Vec<Vec<bool>>,
    /// For each deformation its undeformed mesh. Empty until [`AnimationRig::apply_rest_pose`].
    shapes: Vec<VertexData>,
    /// For each instance the minimum scale.
    floors: Vec<f64>,
    /// The animated materials at rest, by index. Empty until [`AnimationRig::apply_rest_pose`], as
    /// are the following.
    rest_materials: BTreeMap<usize, Material>,
    /// Materials that are a copy of others by the variant of the scene.
    varied: Vec<(usize, VariantMaterials)>,
    /// The lights at rest.
    rest_lights: Vec<Light>,
    /// The cameras at rest.
    rest_cameras: Vec<Camera>,
    /// The variant of the scene.
    variant: Option<usize>,
}

impl AnimationRig {
    /// Attaches a rig to a scene made in code. Deforming meshes must hold their undeformed
    /// vertices, and get those of the rest pose; instances and cameras of nodes get the nodes' rest
    /// transforms.
    ///
    /// # Errors
    /// [`Error::Scene`] for indices out of range, wrong counts, numbers that are not finite.
    pub fn attach(scene: &mut Scene, parts: RigParts) -> Result<()> {
        scene.rig = Some(Self::new(scene, parts).map_err(|e| Error::Scene(format!("{}: {e}", scene.name)))?);
        Self::apply_rest_pose(scene);
        Ok(())
    }

    /// The rig of `scene`, whose meshes are undeformed.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub(in crate::scene) fn new(scene: &Scene, parts: RigParts) -> Result<Self, String> {
        check::check(scene, &parts)?;
        let mut rest: Vec<DAffine3> = Vec::with_capacity(parts.nodes.len());
        for node in &parts.nodes {
            let local = node.local.affine();
            rest.push(node.parent.map_or(local, |p| rest[p] * local));
        }
        if let Some(i) = rest.iter().position(|m| !m.is_finite()) {
            return Err(format!("node {i} `{}` has a transform that is not finite", parts.nodes[i].name));
        }
        let still =
            parts.animations.iter().map(|a| a.channels.iter().map(|c| c.is_constant(&parts.nodes[c.node])).collect());
        Ok(Self {
            still: still.collect(),
            rest,
            shapes: Vec::new(),
            floors: Vec::new(),
            rest_materials: BTreeMap::new(),
            varied: Vec::new(),
            rest_lights: Vec::new(),
            rest_cameras: Vec::new(),
            variant: None,
            parts,
        })
    }

    /// Nodes, skins, deformations and animations of the rig.
    pub fn parts(&self) -> &RigParts {
        &self.parts
    }

    /// Animations that can be played.
    pub fn animations(&self) -> &[Animation] {
        &self.parts.animations
    }

    /// Notes which variant of its materials the scene is in.
    pub(in crate::scene) fn set_variant(&mut self, variant: Option<usize>) {
        self.variant = variant;
    }

    /// A deforming undeformed mesh, before targets and skin. `deformation` is an index into
    /// [`RigParts::deformations`].
    pub fn undeformed(&self, deformation: usize) -> Option<&VertexData> {
        self.shapes.get(deformation)
    }
}

/// The new index of each of what is kept.
pub(in crate::scene) fn renumbered(keep: &[bool]) -> Vec<usize> {
    let mut next = 0;
    let count = |&keep: &bool| {
        next += usize::from(keep);
        next - usize::from(keep)
    };
    keep.iter().map(count).collect()
}

impl Channel {
    /// Number of components of a value.
    fn width(&self, node: &Node) -> usize {
        match self.property {
            Property::Translation | Property::Scale => 3,
            Property::Rotation => 4,
            Property::Weights => node.weights.len(),
        }
    }

    /// Whether it keeps the node at its rest value, up to rounding. Exporters write such channels
    /// for everything that could be animated.
    pub(in crate::scene) fn is_constant(&self, node: &Node) -> bool {
        let close = |a: f64, b: f32| {
            (a - f64::from(b)).abs() <= 2.0 * f64::from(f32::EPSILON) * a.abs().max(f64::from(b.abs()))
        };
        let same = |v: &[f32]| match (self.property, node.local) {
            (Property::Weights, _) => v == node.weights,
            (Property::Translation, LocalTransform::Trs { translation: at, .. }) => {
                at.to_array().iter().zip(v).all(|(a, b)| close(*a, *b))
            }
            (Property::Scale, LocalTransform::Trs { scale, .. }) => {
                scale.to_array().iter().zip(v).all(|(a, b)| close(*a, *b))
            }
            (Property::Rotation, LocalTransform::Trs { rotation, .. }) => {
                let q = glam::DVec4::from_array([0, 1, 2, 3].map(|i| v.get(i).map_or(0.0, |&x| f64::from(x))));
                // within a millionth of a radian
                sampler::unit(q).dot(rotation).abs() > 1.0 - 1e-13
            }
            _ => false,
        };
        self.sampler.is_constant(self.width(node), same)
    }
}
