//! Primitives to triangle meshes.

use glam::{Vec2, Vec3, Vec4};

use super::accessor::{Indices, Reader};
use super::schema::Primitive;
use crate::scene::TriangleMesh;

/// Reads a primitive; `None` for points and lines, which have no surface. `tangents` says whether the material needs them.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn read(
    reader: &Reader,
    primitive: &Primitive,
    tangents: bool,
    warn: &mut dyn FnMut(String),
) -> Result<Option<TriangleMesh>, String> {
    let mode = primitive.mode.unwrap_or(4);
    if !(4..=6).contains(&mode) {
        match mode {
            0..=3 => warn("is made of points or lines, which have no surface: skipped".to_owned()),
            _ => warn(format!("has the unknown mode {mode}: skipped")),
        }
        return Ok(None);
    }
    let attribute = |name: &str| primitive.attributes.get(name).copied();
    let Some(position) = attribute("POSITION") else {
        warn("has no positions: skipped".to_owned());
        return Ok(None);
    };
    let mut mesh = TriangleMesh { positions: reader.floats(position, "VEC3", Vec3::from_array)?, ..Default::default() };
    let vertices = mesh.positions.len();
    if u32::try_from(vertices).is_err() {
        return Err(format!("has {vertices} vertices, more than 32-bit indices reach"));
    }

    // checked before it is read: a short array would be indexed beyond its end
    let same_count = |accessor: usize| match reader.count(accessor)? {
        n if n == vertices => Ok(accessor),
        n => Err(format!("accessor {accessor} has {n} elements for {vertices} vertices")),
    };
    if let Some(a) = attribute("NORMAL") {
        mesh.normals = reader.floats(same_count(a)?, "VEC3", Vec3::from_array)?;
    }
    // without normals the file's tangents must be ignored, says the specification
    if let Some(a) = attribute("TANGENT").filter(|_| tangents && !mesh.normals.is_empty()) {
        mesh.tangents = reader.floats(same_count(a)?, "VEC4", Vec4::from_array)?;
    }
    for (set, name) in ["TEXCOORD_0", "TEXCOORD_1"].into_iter().enumerate() {
        if let Some(a) = attribute(name) {
            mesh.texcoords[set] = reader.floats(same_count(a)?, "VEC2", Vec2::from_array)?;
        }
    }
    if let Some(a) = attribute("COLOR_0") {
        mesh.colors = match reader.document.accessors.get(a).map(|a| a.shape.as_str()) {
            Some("VEC3") => reader.floats(same_count(a)?, "VEC3", |[r, g, b]| Vec4::new(r, g, b, 1.0))?,
            _ => reader.floats(same_count(a)?, "VEC4", Vec4::from_array)?,
        };
    }
    mesh.indices = match primitive.indices {
        Some(accessor) => {
            let indices = reader.indices(accessor)?;
            // one call site per storage, so that the common one compiles to a plain loop
            match &indices {
                Indices::Owned(v) => triangles(mode, v.len(), |i| v[i]),
                in_place => triangles(mode, in_place.len(), |i| in_place.get(i)),
            }
        }
        None => triangles(mode, vertices, |i| i as u32),
    };
    if mode == 4 {
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

/// Triangles of a list (mode 4), strip (5) or fan (6) of `n` corners, all counter-clockwise as the specification orders them.
fn triangles(mode: u32, n: usize, corner: impl Fn(usize) -> u32) -> Vec<[u32; 3]> {
    match mode {
        4 => (0..n / 3).map(|t| [corner(3 * t), corner(3 * t + 1), corner(3 * t + 2)]).collect(),
        5 => (0..n.saturating_sub(2)).map(|t| [corner(t), corner(t + 1 + t % 2), corner(t + 2 - t % 2)]).collect(),
        _ => (0..n.saturating_sub(2)).map(|t| [corner(t + 1), corner(t + 2), corner(0)]).collect(),
    }
}
