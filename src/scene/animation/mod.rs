//! What moves: a tree of nodes, skins, morph targets, and animations that change them over time. Plain data and arithmetic on the
//! host; nothing here knows a tracer.
//!
//! [`RigParts`] is the description, [`AnimationRig`] the same once it is known to be sound and tied to a scene. A scene of which nothing can
//! move has no rig. Playing goes in two steps: [`AnimationRig::motion`] says once what an animation will change, so that tracers keep only
//! that ready ([`super::Motion`]); [`AnimationRig::pose`] gives the state at a time, as often as wanted.
//!
//! Matrices are composed in f64 and vertices are rounded to f32 at the end. A skinned mesh lies in world space, as glTF wants it; its
//! instance only has a translation, which is zero unless the skeleton stands far from the origin.

mod check;
mod deform;
mod keep;
mod pose;
mod sampler;
mod transform;

pub use deform::{Deformation, Influences, MorphTarget, VertexData};
pub use pose::{Playback, Pose, PosedMesh};
pub use sampler::{Interpolation, Sampler};
pub(in crate::scene) use transform::anchor;

use glam::{DAffine3, DQuat, DVec3};

use super::Scene;
use crate::error::{Error, Result};

/// Where a node stands relative to its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LocalTransform {
    /// Scaled, then turned, then moved: what animations can change.
    Trs {
        /// Moved by.
        translation: DVec3,
        /// Turned by; unit length.
        rotation: DQuat,
        /// Scaled by.
        scale: DVec3,
    },
    /// Any affine transform; no animation changes it.
    Matrix(DAffine3),
}

impl Default for LocalTransform {
    fn default() -> Self {
        Self::Trs { translation: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE }
    }
}

impl LocalTransform {
    /// Node to parent.
    pub fn affine(&self) -> DAffine3 {
        match *self {
            Self::Trs { translation, rotation, scale } => {
                DAffine3::from_scale_rotation_translation(scale, rotation, translation)
            }
            Self::Matrix(m) => m,
        }
    }
}

/// A node of the tree, at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Node {
    /// Name in the file; may be empty.
    pub name: String,
    /// Its parent, which comes before it in [`RigParts::nodes`].
    pub parent: Option<usize>,
    /// Where it stands.
    pub local: LocalTransform,
    /// Weights of the morph targets of the meshes that it carries; as many as these have targets.
    pub weights: Vec<f32>,
}

/// A skeleton as a mesh is bound to it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// Name in the file; may be empty.
    pub name: String,
    /// Nodes.
    pub joints: Vec<usize>,
    /// For each joint, from the undeformed mesh to the joint.
    pub inverse_bind: Vec<DAffine3>,
}

/// What of a node a channel changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Property {
    /// Where it is moved to; three numbers.
    Translation,
    /// How it is turned; a quaternion x, y, z, w.
    Rotation,
    /// How it is scaled; three numbers. Where that would leave less of an instance than 1e-7 of the scene's size in some direction,
    /// that much is left, since tracers invert transforms.
    Scale,
    /// Weights of morph targets, as many as the node has.
    Weights,
}

/// Keys for one property of one node.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Index into [`RigParts::nodes`].
    pub node: usize,
    /// What of the node.
    pub property: Property,
    /// Over time.
    pub sampler: Sampler,
}

/// An animation of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// Name in the file; may be empty.
    pub name: String,
    /// Time of the last key in seconds; zero when there is none.
    pub duration: f64,
    /// What it changes; at most one channel for each property of a node.
    pub channels: Vec<Channel>,
}

/// What a [`AnimationRig`] is made of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RigParts {
    /// The tree, parents before children.
    pub nodes: Vec<Node>,
    /// Skeletons.
    pub skins: Vec<Skin>,
    /// Meshes that deform, each named once.
    pub deformations: Vec<Deformation>,
    /// What can be played.
    pub animations: Vec<Animation>,
    /// For each of [`Scene::instances`] the node that places it; `None` for one that stays, and for skinned meshes.
    pub instances: Vec<Option<usize>>,
    /// For each of [`Scene::cameras`] the node that carries it; `None` for one that stays.
    pub cameras: Vec<Option<usize>>,
}

/// A scene's animations and what they act on.
#[derive(Clone, Debug)]
pub struct AnimationRig {
    parts: RigParts,
    /// World transforms of the nodes at rest.
    rest: Vec<DAffine3>,
    /// For each channel of each animation: it keeps its property as it is at rest.
    still: Vec<Vec<bool>>,
    /// For each deformation its undeformed mesh. Empty until [`AnimationRig::apply_rest_pose`].
    shapes: Vec<VertexData>,
    /// For each instance the least scale, below which nothing could be seen.
    floors: Vec<f64>,
}

impl AnimationRig {
    /// Gives a scene made in code its rig. Meshes that deform hold their undeformed shape before, that at rest afterwards; what nodes
    /// place or carry is put where they are at rest.
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
        let still = parts.animations.iter().map(|a| a.channels.iter().map(|c| c.is_constant(&parts.nodes[c.node])).collect());
        Ok(Self { still: still.collect(), rest, shapes: Vec::new(), floors: Vec::new(), parts })
    }

    /// What it is made of.
    pub fn parts(&self) -> &RigParts {
        &self.parts
    }

    /// What can be played.
    pub fn animations(&self) -> &[Animation] {
        &self.parts.animations
    }

    /// A deforming undeformed mesh, before targets and skin. `deformation` is an index into [`RigParts::deformations`].
    pub fn undeformed(&self, deformation: usize) -> Option<&VertexData> {
        self.shapes.get(deformation)
    }
}

impl Channel {
    /// How many numbers a value has.
    fn width(&self, node: &Node) -> usize {
        match self.property {
            Property::Translation | Property::Scale => 3,
            Property::Rotation => 4,
            Property::Weights => node.weights.len(),
        }
    }

    /// Does it keep the node as it is at rest, but for rounding? Exporters write such channels for all that could be animated.
    pub(in crate::scene) fn is_constant(&self, node: &Node) -> bool {
        let close =
            |a: f64, b: f32| (a - f64::from(b)).abs() <= 2.0 * f64::from(f32::EPSILON) * a.abs().max(f64::from(b.abs()));
        let same = |v: &[f32]| match (self.property, node.local) {
            (Property::Weights, _) => v == node.weights,
            (Property::Translation, LocalTransform::Trs { translation: at, .. }) => {
                at.to_array().iter().zip(v).all(|(a, b)| close(*a, *b))
            }
            (Property::Scale, LocalTransform::Trs { scale, .. }) => scale.to_array().iter().zip(v).all(|(a, b)| close(*a, *b)),
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
