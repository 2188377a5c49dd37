//! Skins, and the joints, weights and morph targets of primitives.

use ::gltf::json::Index;
use ::gltf::json::accessor::Type;
use ::gltf::json::mesh::{Primitive, Semantic};
use ::gltf::json::validation::Checked;
use glam::{DAffine3, DMat4, DVec4, Vec3};
use serde::Deserialize;

use super::accessor::Reader;
use super::values::AccessorIndex;
use crate::scene::animation::{self, Influences, MorphTarget};

/// A skin in the file.
#[derive(Deserialize, Default)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Skin {
    name: Option<String>,
    joints: Vec<usize>,
    inverse_bind_matrices: Option<u32>,
}

/// Reads a skin; `index` has the index of each node of the file.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn read(reader: &Reader, skin: &Skin, index: &[Option<usize>]) -> Result<animation::Skin, String> {
    let joint = |&j: &usize| match index.get(j) {
        None => Err(format!("joint node {j} does not exist (the file has {})", index.len())),
        Some(None) => Err(format!("joint node {j} is its own ancestor")),
        Some(Some(placed)) => Ok(*placed),
    };
    let joints: Vec<usize> = skin.joints.iter().map(joint).collect::<Result<_, _>>()?;
    if joints.is_empty() {
        return Err("has no joints".to_owned());
    }
    let Some(accessor) = skin.inverse_bind_matrices else {
        let inverse_bind = vec![DAffine3::IDENTITY; joints.len()];
        return Ok(animation::Skin { name: skin.name.clone().unwrap_or_default(), joints, inverse_bind });
    };
    let matrix = |m: [f32; 16]| DMat4::from_cols_array(&m.map(f64::from));
    let mut matrices = reader.floats(Index::new(accessor), Type::Mat4, matrix)?;
    if matrices.len() < joints.len() {
        return Err(format!("has {} inverse bind matrices for {} joints", matrices.len(), joints.len()));
    }
    // the specification allows more of them
    matrices.truncate(joints.len());
    let affine = |m: &DMat4| m.is_finite() && (m.row(3) - DVec4::W).abs().max_element() <= 1e-6;
    match matrices.iter().position(|m| !affine(m)) {
        Some(i) => Err(format!("accessor {accessor}: inverse bind matrix {i} is not finite, or not affine")),
        None => Ok(animation::Skin {
            name: skin.name.clone().unwrap_or_default(),
            joints,
            inverse_bind: matrices.into_iter().map(DAffine3::from_mat4).collect(),
        }),
    }
}

/// Joints and weights of each vertex, up to two sets; none if the primitive has none. `joints`: how
/// many the skin has.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn influences(
    reader: &Reader,
    primitive: &Primitive,
    vertices: usize,
    joints: usize,
    warn: &mut dyn FnMut(String),
) -> Result<Vec<Influences>, String> {
    let attribute = |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
    let mut sets = Vec::new();
    for set in 0..2 {
        let (Some(joint), Some(weight)) = (attribute(Semantic::Joints(set)), attribute(Semantic::Weights(set))) else {
            break;
        };
        let mut influence = Influences {
            joints: reader
                .floats(same_count(reader, joint, vertices)?, Type::Vec4, |j: [f32; 4]| j.map(|j| j as u16))?,
            weights: reader.floats(same_count(reader, weight, vertices)?, Type::Vec4, |w: [f32; 4]| w)?,
        };
        for (v, (j, w)) in influence.joints.iter_mut().zip(&influence.weights).enumerate() {
            if w.iter().any(|w| !(w.is_finite() && *w >= 0.0)) {
                return Err(format!("accessor {weight}: a weight of vertex {v} is not finite, or below zero"));
            }
            for (j, w) in j.iter_mut().zip(w).filter(|(j, _)| usize::from(**j) >= joints) {
                if *w > 0.0 {
                    return Err(format!("accessor {joint}: vertex {v} is bound to joint {j} of only {joints}"));
                }
                // what has no weight may name anything
                *j = 0;
            }
        }
        sets.push(influence);
    }
    if attribute(Semantic::Joints(2)).is_some() {
        warn("has more than eight joints per vertex: only the first eight are used".to_owned());
    }
    Ok(sets)
}

/// Morph targets, as many as `count`; those that the primitive lacks add nothing. `normals`: the
/// primitive has some.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn targets(
    reader: &Reader,
    primitive: &Primitive,
    vertices: usize,
    normals: bool,
    count: usize,
) -> Result<Vec<MorphTarget>, String> {
    let deltas = |accessor: Option<AccessorIndex>, t: usize| -> Result<Vec<Vec3>, String> {
        let Some(accessor) = accessor else { return Ok(Vec::new()) };
        // all zeros, of as many vertices as the file cares to name
        let accessor = same_count(reader, accessor, vertices)?;
        if !reader.has_data(accessor)? {
            return Ok(Vec::new());
        }
        let deltas = reader.floats(accessor, Type::Vec3, Vec3::from_array)?;
        if let Some(v) = deltas.iter().position(|d| !d.is_finite()) {
            return Err(format!("accessor {accessor}: morph target {t} is not finite at vertex {v}"));
        }
        // exporters write all-zero deltas, which cost time and memory
        Ok(if deltas.iter().all(|d| *d == Vec3::ZERO) { Vec::new() } else { deltas })
    };
    let none = Vec::new();
    let all = primitive.targets.as_ref().unwrap_or(&none);
    let mut out = Vec::with_capacity(count);
    for (t, target) in all.iter().take(count).enumerate() {
        out.push(MorphTarget {
            positions: deltas(target.positions, t)?,
            normals: deltas(target.normals.filter(|_| normals), t)?,
        });
    }
    out.resize(count, MorphTarget::default());
    Ok(out)
}

/// Checked before it is read: a short array would be indexed beyond its end.
fn same_count(reader: &Reader, accessor: AccessorIndex, vertices: usize) -> Result<AccessorIndex, String> {
    match reader.count(accessor)? {
        n if n == vertices => Ok(accessor),
        n => Err(format!("accessor {accessor} has {n} elements for {vertices} vertices")),
    }
}
