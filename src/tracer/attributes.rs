//! Vertex attributes in device memory.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use glam::{Vec2, Vec3, Vec4};

use super::needs::Needs;
use super::shading;
use super::upload::concatenate;
use crate::accel::flatten::{FlatScene, Submesh};
use crate::error::Result;
use crate::gpu::{Buffer, Device};
use crate::scene::{Geometry, TriangleMesh};

/// An attribute of vertices.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Attribute {
    Normals,
    /// Tangents of the mesh (0), of its clearcoat (1), of its anisotropy (2).
    Tangents(usize),
    Texcoords(usize),
    Colors,
}

/// Vertex attributes of all submeshes in one buffer.
pub(super) struct Attributes {
    pub buffer: Buffer,
    // by mesh, submesh if the attribute is baked, and attribute
    addresses: HashMap<(usize, Option<usize>, Attribute), u64>,
}

impl Attributes {
    /// Baked normals and tangents differ between submeshes of one mesh; all other attributes are
    /// shared.
    fn key(part: &Submesh, index: usize, attribute: Attribute) -> (usize, Option<usize>, Attribute) {
        let baked = matches!(attribute, Attribute::Normals | Attribute::Tangents(_))
            && part.to_group.matrix3 != glam::DMat3::IDENTITY;
        (part.mesh, baked.then_some(index), attribute)
    }

    /// Writes the attributes that `needs` and the materials require.
    pub fn upload(device: &Arc<Device>, flat: &FlatScene, needs: Needs) -> Result<Self> {
        let (mut keys, mut arrays) = (Vec::new(), Vec::new());
        let mut seen = HashSet::new();
        for (index, part) in flat.groups.iter().flat_map(|g| g.submeshes.iter().enumerate()) {
            let mesh = &flat.scene.meshes[part.mesh];
            let Geometry::Triangles(t) = &mesh.geometry else { continue };
            let color = needs.albedo || part.alpha_tested;
            let material = &flat.scene.materials[mesh.material];
            let textured = color && material.base_color_texture.is_some()
                || shading::slots(material, needs).into_iter().any(|slot| slot.is_some());
            for (attribute, wanted) in [
                (Attribute::Normals, needs.normals),
                (Attribute::Tangents(0), needs.shading && !needs.white),
                (Attribute::Tangents(1), needs.shading && !needs.white),
                (Attribute::Tangents(2), needs.shading && !needs.white),
                (Attribute::Texcoords(0), textured),
                (Attribute::Texcoords(1), textured),
                (Attribute::Colors, color),
            ] {
                let key = Self::key(part, index, attribute);
                let bytes = if wanted { attribute_bytes(t, part, attribute) } else { Cow::Borrowed(&[][..]) };
                if !bytes.is_empty() && seen.insert(key) {
                    keys.push(key);
                    arrays.push(bytes);
                }
            }
        }
        let (buffer, addresses) = concatenate(device, "vertex attributes", &arrays)?;
        Ok(Self { buffer, addresses: keys.into_iter().zip(addresses).collect() })
    }

    /// Device address of a submesh's attribute, 0 where it has none. `index`: of the submesh in its
    /// group.
    pub fn address(&self, part: &Submesh, index: usize, attribute: Attribute) -> u64 {
        self.addresses.get(&Self::key(part, index, attribute)).copied().unwrap_or(0)
    }

    /// Offset in the buffer of the normals of a mesh that is not baked, in bytes; `None` where it
    /// has none.
    pub fn normals_offset(&self, mesh: usize) -> Option<u64> {
        Some(self.addresses.get(&(mesh, None, Attribute::Normals))? - self.buffer.address())
    }
}

fn tangents(t: &TriangleMesh, which: usize) -> &[Vec4] {
    [&t.tangents, &t.clearcoat_tangents, &t.anisotropy_tangents][which]
}

fn attribute_bytes<'a>(t: &'a TriangleMesh, part: &Submesh, attribute: Attribute) -> Cow<'a, [u8]> {
    match attribute {
        Attribute::Normals if part.to_group.matrix3 == glam::DMat3::IDENTITY => {
            Cow::Borrowed(bytemuck::cast_slice(&t.normals))
        }
        Attribute::Normals => {
            let m = part.to_group.matrix3.inverse().transpose();
            let baked: Vec<Vec3> = t.normals.iter().map(|n| (m * n.as_dvec3()).as_vec3()).collect();
            Cow::Owned(bytemuck::cast_slice(&baked).to_vec())
        }
        Attribute::Tangents(k) if part.to_group.matrix3 == glam::DMat3::IDENTITY => {
            Cow::Borrowed(bytemuck::cast_slice(tangents(t, k)))
        }
        Attribute::Tangents(k) => {
            let m = part.to_group.matrix3;
            // a mirroring transform reverses the bitangent relative to the cross product
            let side = if part.mirrored { -1.0 } else { 1.0 };
            let bake = |t: &Vec4| (m * t.truncate().as_dvec3()).normalize_or_zero().as_vec3().extend(side * t.w);
            Cow::Owned(bytemuck::cast_slice(&tangents(t, k).iter().map(bake).collect::<Vec<_>>()).to_vec())
        }
        Attribute::Texcoords(1) if !t.more_texcoords.is_empty() => {
            // sets from 1 on, those of a vertex side by side
            let sets: Vec<&[Vec2]> = (1..t.texcoord_sets()).map(|set| t.texcoord_set(set)).collect();
            let at = |vertex: usize| sets.iter().map(move |set| set.get(vertex).copied().unwrap_or_default());
            let side_by_side: Vec<Vec2> = (0..t.positions.len()).flat_map(at).collect();
            Cow::Owned(bytemuck::cast_slice(&side_by_side).to_vec())
        }
        Attribute::Texcoords(set) => Cow::Borrowed(bytemuck::cast_slice(&t.texcoords[set])),
        Attribute::Colors => Cow::Borrowed(bytemuck::cast_slice(&t.colors)),
    }
}
