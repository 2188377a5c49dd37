//! Primitives to triangle meshes.

use ::gltf::json::accessor::Type;
use ::gltf::json::mesh::{Mode, Primitive, Semantic};
use ::gltf::json::validation::Checked;
use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::accessor::{Indices, Reader};
use super::compressed::{self, DRACO};
use super::values::{AccessorIndex, valid};
use crate::scene::TriangleMesh;

/// Reads a primitive; `None` for points and lines, which have no surface. `tangents` says whether
/// the material needs them, `sets` which sets of texture coordinates are kept.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn read(
    reader: &Reader,
    primitive: &Primitive,
    tangents: bool,
    sets: &[u32],
    warn: &mut dyn FnMut(String),
) -> Result<Option<TriangleMesh>, String> {
    let mode = match valid(primitive.mode) {
        Some(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
        Some(_) => {
            warn("is made of points or lines, which have no surface: skipped".to_owned());
            return Ok(None);
        }
        None => {
            warn("has an unknown mode: skipped".to_owned());
            return Ok(None);
        }
    };

    // positions, which decide how many vertices there are
    let attribute = |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
    let Some(position) = attribute(Semantic::Positions) else {
        warn("has no positions: skipped".to_owned());
        return Ok(None);
    };
    let is_compressed = compressed::draco_extension(primitive).is_some();
    if is_compressed && !reader.has_data(position)? {
        return Err(format!(
            "accessor {position} has no data of its own, and the extension {DRACO} does not fill it{}",
            if cfg!(feature = "draco") { "" } else { ": this program was built without it" }
        ));
    }
    // compressed strips are lists once they are decoded
    let mode = if primitive.indices.is_some_and(|i| reader.is_decoded(i)) { Mode::Triangles } else { mode };
    let mut mesh =
        TriangleMesh { positions: reader.floats(position, Type::Vec3, Vec3::from_array)?, ..Default::default() };
    let vertices = mesh.positions.len();
    if u32::try_from(vertices).is_err() {
        return Err(format!("has {vertices} vertices, more than 32-bit indices reach"));
    }

    // checked before it is read: a short array would be indexed beyond its end
    let same_count = |accessor: AccessorIndex| match reader.count(accessor)? {
        n if n == vertices => Ok(accessor),
        n => Err(format!("accessor {accessor} has {n} elements for {vertices} vertices")),
    };
    if let Some(a) = attribute(Semantic::Normals) {
        mesh.normals = reader.floats(same_count(a)?, Type::Vec3, Vec3::from_array)?;
    }
    // without normals the file's tangents must be ignored, says the specification
    if let Some(a) = attribute(Semantic::Tangents).filter(|_| tangents && !mesh.normals.is_empty()) {
        mesh.tangents = reader.floats(same_count(a)?, Type::Vec4, Vec4::from_array)?;
    }
    for (k, set) in sets.iter().enumerate() {
        if let Some(a) = attribute(Semantic::TexCoords(*set)) {
            *mesh.texcoord_set_mut(k) = reader.floats(same_count(a)?, Type::Vec2, Vec2::from_array)?;
        }
    }
    if let Some(a) = attribute(Semantic::Colors(0)) {
        mesh.colors = match reader.shape(a)? {
            Some(Type::Vec3) => reader.floats(same_count(a)?, Type::Vec3, |[r, g, b]| Vec4::new(r, g, b, 1.0))?,
            _ => reader.floats(same_count(a)?, Type::Vec4, Vec4::from_array)?,
        };
    }

    // corners
    mesh.indices = match primitive.indices {
        Some(accessor) => {
            let indices = reader.indices(accessor)?;
            reader.budget.take(12 * indices.len() as u64, || format!("a mesh of {} corners", indices.len()))?;
            // one call site per storage, so that the common one compiles to a plain loop
            match &indices {
                Indices::Owned(v) => triangles(mode, v.len(), |i| v[i]),
                in_place => triangles(mode, in_place.len(), |i| in_place.get(i)),
            }
        }
        None => triangles(mode, vertices, |i| i as u32),
    };

    if mode == Mode::Triangles {
        let corners = match primitive.indices {
            Some(accessor) => reader.count(accessor)?,
            None => vertices,
        };
        if corners % 3 != 0 {
            warn(format!("has {corners} corners, no multiple of three: the last {} ignored", corners % 3));
        }
    }
    Ok(Some(mesh))
}

/// Triangles of a list that a thread reads at least.
const MIN_TRIANGLES: usize = 1 << 16;

/// Triangles of a list, strip or fan of `n` corners, all counter-clockwise as the specification
/// orders them.
fn triangles(mode: Mode, n: usize, corner: impl Fn(usize) -> u32 + Sync) -> Vec<[u32; 3]> {
    match mode {
        Mode::Triangles => {
            let triangle = |t: usize| [corner(3 * t), corner(3 * t + 1), corner(3 * t + 2)];
            (0..n / 3).into_par_iter().with_min_len(MIN_TRIANGLES).map(triangle).collect()
        }
        Mode::TriangleStrip => {
            (0..n.saturating_sub(2)).map(|t| [corner(t), corner(t + 1 + t % 2), corner(t + 2 - t % 2)]).collect()
        }
        _ => (0..n.saturating_sub(2)).map(|t| [corner(t + 1), corner(t + 2), corner(0)]).collect(),
    }
}
