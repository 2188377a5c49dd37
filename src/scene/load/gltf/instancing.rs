//! `EXT_mesh_gpu_instancing`: a node that places its mesh many times.
//!
//! <https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/EXT_mesh_gpu_instancing>

use std::collections::BTreeMap;

use ::gltf::json::accessor::Type;
use ::gltf::json::{Index, Node};
use glam::{DAffine3, DQuat, DVec3};
use serde::Deserialize;

use super::accessor::Reader;
use crate::scene::Instance;

const NAME: &str = "EXT_mesh_gpu_instancing";

#[derive(Deserialize)]
struct Instancing {
    #[serde(default)]
    attributes: BTreeMap<String, u32>,
}

/// Returns true if a node places its mesh many times.
pub(super) fn is_instanced(node: &Node) -> bool {
    node.extensions.as_ref().is_some_and(|e| e.others.contains_key(NAME))
}

/// Transforms from the instances of a node to the node; `None` if the node has no such extension.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn read(reader: &Reader, node: &Node) -> Result<Option<Vec<DAffine3>>, String> {
    let Some(value) = node.extensions.as_ref().and_then(|e| e.others.get(NAME)) else { return Ok(None) };
    let Instancing { attributes } =
        serde_json::from_value(value.clone()).map_err(|e| format!("{NAME} is not valid: {e}"))?;
    let accessor = |name: &str| attributes.get(name).map(|&index| Index::new(index));

    // as many of each as of the first; an application's own attributes do not place anything
    let named = ["TRANSLATION", "ROTATION", "SCALE"].map(accessor);
    let Some(first) = named.into_iter().flatten().next() else { return Ok(Some(Vec::new())) };
    let count = reader.count(first)?;
    for other in named.into_iter().flatten() {
        if reader.count(other)? != count {
            return Err(format!("{NAME}: accessor {other} has {} elements, not {count}", reader.count(other)?));
        }
    }
    let bytes = (count * size_of::<(Instance, DAffine3)>()) as u64;
    reader.budget.take(bytes, || format!("a node with {count} instances"))?;

    // translations, rotations and scales that are missing change nothing
    let vectors = |accessor, default| match accessor {
        Some(accessor) => reader.floats(accessor, Type::Vec3, |v: [f32; 3]| DVec3::from(v.map(f64::from))),
        None => Ok(vec![default; count]),
    };
    let [translation, rotation, scale] = named;
    let (translations, scales) = (vectors(translation, DVec3::ZERO)?, vectors(scale, DVec3::ONE)?);
    let rotations = match rotation {
        Some(accessor) => reader.floats(accessor, Type::Vec4, |q: [f32; 4]| {
            let rotation = DQuat::from_array(q.map(f64::from));
            if rotation.length_squared() > 0.0 { rotation.normalize() } else { rotation }
        })?,
        None => vec![DQuat::IDENTITY; count],
    };
    let transforms = translations.iter().zip(&rotations).zip(&scales);
    let transforms: Vec<DAffine3> =
        transforms.map(|((t, r), s)| DAffine3::from_scale_rotation_translation(*s, *r, *t)).collect();
    match transforms.iter().position(|t| !t.is_finite()) {
        Some(k) => Err(format!("{NAME}: the transform of instance {k} is not finite")),
        None => Ok(Some(transforms)),
    }
}
