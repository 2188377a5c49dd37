//! The scene in device memory: the records of [`crate::interface::records::scene`].

use std::borrow::Cow;
use std::sync::Arc;

use bytemuck::Pod;
use glam::{DAffine3, Vec3, Vec4};

use super::albedo;
use super::compute::Hierarchy;
use super::mipmap;
use super::previous_frame::PreviousFrame;
use super::raster_instance::{RasterGeometry, RasterInstance};
use super::shading;
use crate::accel::features::{Blend, alpha_cutoff};
use crate::accel::flatten::{BlasGroup, FlatScene, Submesh, TlasInstance};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Device, Memory};
use crate::interface::records::ray::INVALID;
use crate::interface::records::scene::{
    InstanceRecord, MaterialRecord, MipRecord, SceneRoot, SubmeshRecord, TextureRecord, TextureUse,
};
use crate::interface::{BsdfModel, MaterialFeature, ShadingFeatures, TexelFormat, Texels};
use crate::scene::{AlphaMode, Filter, Geometry, Material, TexelData, TextureSlot, TriangleMesh};

/// The parts of a scene that the passes require; the rest is not uploaded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    /// Shading normals.
    pub normals: bool,
    /// Base colours of all surfaces, not only of alpha-tested ones.
    pub albedo: bool,
    /// Materials and emission, for path tracing. Implies `normals`, and `albedo` unless `white`.
    pub shading: bool,
    /// With `shading`: white-furnace mode, in which every surface has one constant albedo and no other material data.
    pub white: bool,
    /// With `shading`: compensation for energy lost to multiple scattering between microfacets.
    pub compensation: bool,
    /// With `shading`: baked occlusion textures, for the AOV of that name.
    pub baked_occlusion: bool,
    /// With `shading`: mip levels of textures, for ray cones ([`crate::integrators::path::TextureFilter::RayCone`]).
    pub mip_levels: bool,
}

impl Needs {
    /// What both need together.
    pub fn union(self, other: Self) -> Self {
        let Self { normals, albedo, shading, white, compensation, baked_occlusion, mip_levels } = other;
        Self {
            normals: self.normals || normals,
            albedo: self.albedo || albedo,
            shading: self.shading || shading,
            white: self.white || white,
            compensation: self.compensation || compensation,
            baked_occlusion: self.baked_occlusion || baked_occlusion,
            mip_levels: self.mip_levels || mip_levels,
        }
    }

    /// Returns true if one scene can serve both: materials look the same to both, if both need them.
    pub fn is_compatible(self, other: Self) -> bool {
        let materials = |n: Self| (n.white, n.compensation, n.mip_levels, n.baked_occlusion);
        !self.shading || !other.shading || materials(self) == materials(other)
    }

    /// Returns true if nothing of `other` is missing.
    pub fn covers(self, other: Self) -> bool {
        self.union(other) == self
    }
}

/// The three rows of an affine map in single precision, as shaders and Vulkan's instances take it.
pub fn rows(t: &DAffine3) -> [[f32; 4]; 3] {
    let (m, o) = (t.matrix3, t.translation);
    std::array::from_fn(|k| [m.x_axis[k] as f32, m.y_axis[k] as f32, m.z_axis[k] as f32, o[k] as f32])
}

/// Buffers of a group, over which its BLAS is built.
pub(super) struct GroupBuffers {
    /// 3 floats per vertex, or 4 per sphere.
    pub positions: Buffer,
    /// 3 uints per triangle; `None` for spheres.
    pub indices: Option<Buffer>,
    submesh_of: Option<Buffer>,
}

/// A scene in device memory, without its acceleration structures.
pub struct GpuScene {
    root: SceneRoot,
    root_buffer: Buffer,
    instances: Vec<InstanceRecord>,
    instance_buffer: Buffer,
    pub(super) groups: Vec<GroupBuffers>,
    shapes: Vec<RasterGeometry>,
    /// The group of each TLAS instance.
    group_of: Vec<u32>,
    attributes: Buffer,
    /// Mesh index and byte offset in `attributes` of the normals of each mesh that may deform.
    normals: Vec<(usize, u64)>,
    /// State before the last update; `None` for a static scene.
    motion: Option<PreviousFrame>,
    others: Vec<Buffer>,
    mips: MipStats,
}

/// Number and size of mip levels.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MipStats {
    /// Largest number of levels of a texture, level 0 included; 0 without mip levels.
    pub levels: u32,
    /// Size of levels 1 and up, in bytes.
    pub bytes: u64,
}

impl GpuScene {
    /// Uploads the data that `needs` and the scene itself require.
    pub fn new(device: &Arc<Device>, flat: &FlatScene, needs: Needs) -> Result<Self> {
        let needs =
            Needs { normals: needs.normals || needs.shading, albedo: needs.albedo || needs.shading && !needs.white, ..needs };
        let groups = flat.groups.iter().map(|g| group_buffers(device, flat, g)).collect::<Result<Vec<_>>>()?;
        let (mut submeshes, mut first_submesh) = (Vec::new(), Vec::new());
        let mut others = Vec::new();
        let attributes = Attributes::upload(device, flat, needs)?;
        for (group, buffers) in flat.groups.iter().zip(&groups) {
            first_submesh.push(submeshes.len() as u32);
            for (k, part) in group.submeshes.iter().enumerate() {
                submeshes.push(SubmeshRecord {
                    indices: buffers.indices.as_ref().map_or(0, Buffer::address),
                    positions: buffers.positions.address(),
                    normals: attributes.address(part, k, Attribute::Normals),
                    texcoords0: attributes.address(part, k, Attribute::Texcoords(0)),
                    texcoords1: attributes.address(part, k, Attribute::Texcoords(1)),
                    colors: attributes.address(part, k, Attribute::Colors),
                    first_primitive: part.first_primitive as u32,
                    first_vertex: part.first_vertex as u32,
                    material: flat.scene.meshes[part.mesh].material as u32,
                    scene_instance: part.scene_instance.map_or(INVALID, |i| i as u32),
                    mirrored: part.mirrored as u32,
                    reserved: 0,
                    tangents: attributes.address(part, k, Attribute::Tangents(0)),
                    clearcoat_tangents: attributes.address(part, k, Attribute::Tangents(1)),
                    anisotropy_tangents: attributes.address(part, k, Attribute::Tangents(2)),
                });
            }
        }
        let instances: Vec<_> = flat
            .instances
            .iter()
            .map(|p| InstanceRecord {
                group_to_world: rows(&p.to_world),
                world_to_group: rows(&p.to_world.inverse()),
                submesh_of: groups[p.group].submesh_of.as_ref().map_or(0, Buffer::address),
                first_submesh: first_submesh[p.group],
                scene_instance: p.scene_instance.map_or(INVALID, |i| i as u32),
                root: 0,
                opaque_count: flat.groups[p.group].opaque_count as u32,
                ..Default::default()
            })
            .collect();
        if let Some(bad) =
            instances.iter().position(|i| !i.group_to_world.iter().chain(&i.world_to_group).flatten().all(|x| x.is_finite()))
        {
            let name = flat.instances[bad].scene_instance.map_or("", |i| flat.scene.instances[i].name.as_str());
            return Err(Error::Scene(format!(
                "instance {bad} '{name}' has a transform that cannot be inverted (a scale of zero?)"
            )));
        }
        // TLAS instance and submesh record of each instance of the scene
        let mut scene_instances = vec![[0u32; 2]; flat.scene.instances.len()];
        for (k, p) in flat.instances.iter().enumerate() {
            match p.scene_instance {
                Some(i) => scene_instances[i] = [k as u32, first_submesh[p.group]],
                None => {
                    for (j, part) in flat.groups[p.group].submeshes.iter().enumerate() {
                        if let Some(i) = part.scene_instance {
                            scene_instances[i] = [k as u32, first_submesh[p.group] + j as u32];
                        }
                    }
                }
            }
        }
        let textures = Textures::upload(device, flat, needs)?;
        let materials: Vec<_> = flat.scene.materials.iter().map(|m| textures.material(m, flat.blend)).collect();
        let indices = shading::indices_of_refraction(&flat.scene.materials);
        let shading: Vec<_> = match needs.shading {
            true => {
                let record = |m| shading::record(m, needs, &indices, |slot| textures.slot(slot));
                flat.scene.materials.iter().map(record).collect()
            }
            false => Vec::new(),
        };
        let instance_buffer = Buffer::from_slice(device, "instance records", &instances)?;
        let mut keep = |buffer: Buffer| {
            let address = buffer.address();
            others.push(buffer);
            address
        };
        let mut root = SceneRoot { instances: instance_buffer.address(), ..Default::default() };
        root.submesh_count = submeshes.len() as u32;
        root.submeshes = keep(Buffer::from_slice(device, "submesh records", &submeshes)?);
        root.scene_instances = keep(Buffer::from_slice(device, "records of scene instances", &scene_instances)?);
        root.materials = keep(Buffer::from_slice(device, "material records", &materials)?);
        root.textures = keep(Buffer::from_slice(device, "texture records", &textures.records)?);
        keep(textures.texels);
        let mut mip_stats = MipStats::default();
        if let Some(mips) = textures.mips {
            let records = Buffer::from_slice(device, "mip records", &mips.records)?;
            let levels = mips.records.iter().map(|r| r.last + 1).max().unwrap_or(0);
            mip_stats = MipStats { levels, bytes: records.size() + mips.texels.size() };
            root.mips = keep(records);
            keep(mips.texels);
        }
        if needs.shading {
            root.shading = keep(Buffer::from_slice(device, "shading records", &shading)?);
            if let Some(tables) = albedo_tables(flat, needs, &indices) {
                root.albedo = keep(Buffer::from_slice(device, "albedo tables", &tables)?);
            }
        }
        // a deforming mesh is never baked
        let normals = |&mesh: &usize| {
            let address = attributes.addresses.get(&(mesh, None, Attribute::Normals))?;
            Some((mesh, address - attributes.buffer.address()))
        };
        let normals = flat.motion.meshes.iter().filter_map(normals).collect();
        let motion = PreviousFrame::new(device, flat, |group| groups[group].positions.size())?;
        root.motion = motion.as_ref().map_or(0, PreviousFrame::address);
        let root_buffer = Buffer::from_slice(device, "scene root", &[root])?;
        let shapes = flat.groups.iter().map(|g| RasterGeometry::new(flat, g)).collect();
        let group_of = flat.instances.iter().map(|p| p.group as u32).collect();
        let attributes = attributes.buffer;
        Ok(Self {
            root,
            root_buffer,
            instances,
            instance_buffer,
            groups,
            shapes,
            group_of,
            attributes,
            normals,
            motion,
            others,
            mips: mip_stats,
        })
    }

    /// The TLAS instances for rasterization, in their current state.
    pub(super) fn raster_instances(&self) -> impl Iterator<Item = RasterInstance<'_>> {
        (0..).zip(self.instances.iter().zip(&self.group_of)).map(|(entry, (instance, &group))| {
            let buffers = &self.groups[group as usize];
            RasterInstance {
                entry,
                to_world: instance.group_to_world,
                shape: &self.shapes[group as usize],
                positions: buffers.positions.address(),
                indices: buffers.indices.as_ref().map_or(0, Buffer::address),
            }
        })
    }

    /// Device address of the scene root, from which shaders reach everything.
    pub fn root_address(&self) -> u64 {
        self.root_buffer.address()
    }

    /// Size in device memory, in bytes.
    pub fn bytes(&self) -> u64 {
        let groups = self.groups.iter().flat_map(|g| [Some(&g.positions), g.indices.as_ref(), g.submesh_of.as_ref()]).flatten();
        let others = self.others.iter().chain([&self.attributes, &self.instance_buffer]);
        groups.chain(others).map(Buffer::size).sum::<u64>()
    }

    /// Number and size of mip levels.
    pub(super) fn mips(&self) -> MipStats {
        self.mips
    }

    /// Before an update that moves these TLAS instances, now at `placements`, and deforms these groups.
    pub(super) fn begin_update(&mut self, instances: &[TlasInstance], moving: Vec<usize>, deforming: Vec<usize>) -> Result<()> {
        let groups = &self.groups;
        match &mut self.motion {
            Some(motion) => motion.begin(instances, |g| &groups[g].positions, moving, deforming),
            None => Ok(()),
        }
    }

    /// Vertices of a mesh that is a group of its own have moved.
    pub(super) fn set_positions(&mut self, group: usize, positions: &[Vec3]) -> Result<()> {
        self.shapes[group].deform(positions);
        self.groups[group].positions.write(0, bytemuck::cast_slice(positions))
    }

    /// Shading normals of a mesh that may deform; without effect where none were uploaded.
    pub(super) fn set_normals(&mut self, mesh: usize, normals: &[Vec3]) -> Result<()> {
        match self.normals.iter().find(|n| n.0 == mesh) {
            Some(&(_, offset)) => self.attributes.write(offset, bytemuck::cast_slice(normals)),
            None => Ok(()),
        }
    }

    /// TLAS instances have moved: which, and where to.
    pub(super) fn set_transforms(&mut self, moved: &[(usize, DAffine3)]) -> Result<()> {
        for (k, to_world) in moved {
            let record = &mut self.instances[*k];
            (record.group_to_world, record.world_to_group) = (rows(to_world), rows(&to_world.inverse()));
        }
        // one piece: copying what lies between costs less than a call each
        let (first, last) = moved.iter().fold((usize::MAX, 0), |(a, b), m| (a.min(m.0), b.max(m.0)));
        match self.instances.get(first..=last) {
            Some(records) => {
                self.instance_buffer.write((first * size_of::<InstanceRecord>()) as u64, bytemuck::cast_slice(records))
            }
            None => Ok(()),
        }
    }

    /// Stores the addresses of the compute tracer's hierarchy in the scene root.
    pub(super) fn set_hierarchy(&mut self, h: &Hierarchy) -> Result<()> {
        if self.instances.iter().zip(&h.instance_roots).any(|(record, root)| record.root != *root) {
            for (record, root) in self.instances.iter_mut().zip(&h.instance_roots) {
                record.root = *root;
            }
            write_all(&mut self.instance_buffer, &self.instances)?;
        }
        self.root.nodes = h.nodes.address();
        self.root.primitives = h.primitives.as_ref().map_or(0, Buffer::address);
        self.root.root = h.root;
        self.root.unfinished = h.unfinished.address();
        self.root.bounds_min = h.bounds.min.extend(0.0).to_array();
        self.root.bounds_max = h.bounds.max.extend(0.0).to_array();
        self.root.launch_hits = h.launch.as_ref().map_or(0, |l| l.hits.address());
        self.root.launch_counters = h.launch.as_ref().map_or(0, |l| l.counters.address());
        self.root.suspended = h.launch.as_ref().and_then(|l| l.suspended.as_ref()).map_or(0, |s| s.memory.address());
        write_all(&mut self.root_buffer, &[self.root])
    }

    /// Stores the address of the hardware tracers' top level in the scene root.
    pub(super) fn set_top_level(&mut self, address: u64) -> Result<()> {
        self.root.top_level = address;
        write_all(&mut self.root_buffer, &[self.root])
    }
}

/// The albedo tables that the materials require, if any.
fn albedo_tables(flat: &FlatScene, needs: Needs, indices: &[f32]) -> Option<Vec<f32>> {
    let ShadingFeatures { bsdfs, materials, .. } = shading::features(flat, needs);
    let wanted = albedo::AlbedoTables {
        ggx: needs.compensation && bsdfs.contains(BsdfModel::Gltf),
        sheen: materials.contains(MaterialFeature::Sheen),
        beckmann: needs.compensation && bsdfs.contains(BsdfModel::Conductor),
    };
    let glass = if needs.compensation && !needs.white { indices } else { &[] };
    let any = wanted.ggx || wanted.sheen || wanted.beckmann || !glass.is_empty();
    any.then(|| albedo::tables(wanted, glass))
}

fn write_all<T: Pod>(buffer: &mut Buffer, data: &[T]) -> Result<()> {
    let bytes: &[u8] = bytemuck::cast_slice(data);
    buffer.fill(bytes.len() as u64, 1, |first, chunk| chunk.copy_from_slice(&bytes[first as usize..][..chunk.len()]))
}

fn group_buffers(device: &Arc<Device>, flat: &FlatScene, group: &BlasGroup) -> Result<GroupBuffers> {
    let n = group.primitive_count as u64;
    if group.spheres {
        let mut positions = Buffer::new(device, "spheres", 16 * n, Memory::Device)?;
        positions.fill(16 * n, 16, |first, bytes| {
            for (k, out) in bytes.chunks_exact_mut(16).enumerate() {
                let primitive = first as usize + k;
                let part = flat.submesh_of(group, primitive);
                let s = flat.sphere(part, primitive - part.first_primitive);
                out.copy_from_slice(bytemuck::bytes_of(&[s.center.x, s.center.y, s.center.z, s.radius]));
            }
        })?;
        return Ok(GroupBuffers { positions, indices: None, submesh_of: submesh_of(device, group)? });
    }
    let triangles = |part: &Submesh| match &flat.scene.meshes[part.mesh].geometry {
        Geometry::Triangles(t) => t,
        Geometry::Spheres(_) => unreachable!("a triangle group holds triangles"),
    };
    let mut positions = Buffer::new(device, "vertices", 12 * group.vertex_count as u64, Memory::Device)?;
    let mut cursor = Cursor::new(group.submeshes.iter().map(|p| triangles(p).positions.len()));
    positions.fill(12 * group.vertex_count as u64, 12, |_, bytes| {
        for out in bytes.chunks_exact_mut(12) {
            let (part, vertex) = cursor.next();
            out.copy_from_slice(bytemuck::bytes_of(&flat.vertex(&group.submeshes[part], vertex).to_array()));
        }
    })?;
    let mut indices = Buffer::new(device, "indices", 12 * n, Memory::Device)?;
    let mut cursor = Cursor::new(group.submeshes.iter().map(|p| triangles(p).indices.len()));
    indices.fill(12 * n, 12, |_, bytes| {
        for out in bytes.chunks_exact_mut(12) {
            let (part, triangle) = cursor.next();
            let part = &group.submeshes[part];
            let corners = triangles(part).indices[triangle].map(|i| i + part.first_vertex as u32);
            out.copy_from_slice(bytemuck::bytes_of(&corners));
        }
    })?;
    Ok(GroupBuffers { positions, indices: Some(indices), submesh_of: submesh_of(device, group)? })
}

/// The submesh index of each primitive; `None` for a group of one submesh.
fn submesh_of(device: &Arc<Device>, group: &BlasGroup) -> Result<Option<Buffer>> {
    if group.submeshes.len() <= 1 {
        return Ok(None);
    }
    let ends = group.submeshes.iter().skip(1).map(|p| p.first_primitive).chain([group.primitive_count]);
    let sizes: Vec<_> = group.submeshes.iter().zip(ends).map(|(p, end)| end - p.first_primitive).collect();
    let mut buffer = Buffer::new(device, "submesh of each primitive", 4 * group.primitive_count as u64, Memory::Device)?;
    let mut cursor = Cursor::new(sizes.into_iter());
    buffer.fill(4 * group.primitive_count as u64, 4, |_, bytes| {
        for out in bytes.chunks_exact_mut(4) {
            out.copy_from_slice(&(cursor.next().0 as u32).to_le_bytes());
        }
    })?;
    Ok(Some(buffer))
}

/// Walks over the items of consecutive ranges of given lengths: (range, item within it).
struct Cursor<I> {
    lengths: I,
    range: usize,
    item: usize,
    length: usize,
}

impl<I: Iterator<Item = usize>> Cursor<I> {
    fn new(mut lengths: I) -> Self {
        let length = lengths.next().unwrap_or(0);
        Self { lengths, range: 0, item: 0, length }
    }

    fn next(&mut self) -> (usize, usize) {
        while self.item >= self.length {
            self.length = self.lengths.next().unwrap_or(usize::MAX);
            self.range += 1;
            self.item = 0;
        }
        self.item += 1;
        (self.range, self.item - 1)
    }
}

/// Several arrays in one buffer, each aligned to 16 bytes; returns their addresses.
fn concatenate(device: &Arc<Device>, name: &str, arrays: &[Cow<[u8]>]) -> Result<(Buffer, Vec<u64>)> {
    let mut offsets = Vec::with_capacity(arrays.len());
    let mut size = 0u64;
    for a in arrays {
        offsets.push(size);
        size += (a.len() as u64).next_multiple_of(16);
    }
    let mut buffer = Buffer::new(device, name, size, Memory::Device)?;
    buffer.fill(size, 16, |first, bytes| {
        let (start, end) = (16 * first, 16 * first + bytes.len() as u64);
        for (a, &offset) in arrays.iter().zip(&offsets) {
            let (lo, hi) = (offset.max(start), (offset + a.len() as u64).min(end));
            if lo < hi {
                bytes[(lo - start) as usize..(hi - start) as usize]
                    .copy_from_slice(&a[(lo - offset) as usize..(hi - offset) as usize]);
            }
        }
    })?;
    let base = buffer.address();
    Ok((buffer, offsets.into_iter().map(|o| base + o).collect()))
}

#[derive(Clone, Copy, PartialEq, Eq, Hash)]
enum Attribute {
    Normals,
    /// Those of the mesh, of its clearcoat, of its anisotropy.
    Tangents(usize),
    Texcoords(usize),
    Colors,
}

/// Vertex attributes of all submeshes in one buffer.
struct Attributes {
    buffer: Buffer,
    // by mesh, submesh if the attribute is baked, and attribute
    addresses: std::collections::HashMap<(usize, Option<usize>, Attribute), u64>,
}

impl Attributes {
    /// Baked normals and tangents differ between submeshes of one mesh; all other attributes are shared.
    fn key(part: &Submesh, index: usize, attribute: Attribute) -> (usize, Option<usize>, Attribute) {
        let baked =
            matches!(attribute, Attribute::Normals | Attribute::Tangents(_)) && part.to_group.matrix3 != glam::DMat3::IDENTITY;
        (part.mesh, baked.then_some(index), attribute)
    }

    fn upload(device: &Arc<Device>, flat: &FlatScene, needs: Needs) -> Result<Self> {
        let (mut keys, mut arrays) = (Vec::new(), Vec::new());
        let mut seen = std::collections::HashSet::new();
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

    fn address(&self, part: &Submesh, index: usize, attribute: Attribute) -> u64 {
        self.addresses.get(&Self::key(part, index, attribute)).copied().unwrap_or(0)
    }
}

fn tangents(t: &TriangleMesh, which: usize) -> &[Vec4] {
    [&t.tangents, &t.clearcoat_tangents, &t.anisotropy_tangents][which]
}

fn attribute_bytes<'a>(t: &'a TriangleMesh, part: &Submesh, attribute: Attribute) -> Cow<'a, [u8]> {
    match attribute {
        Attribute::Normals if part.to_group.matrix3 == glam::DMat3::IDENTITY => Cow::Borrowed(bytemuck::cast_slice(&t.normals)),
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
        Attribute::Texcoords(set) => Cow::Borrowed(bytemuck::cast_slice(&t.texcoords[set])),
        Attribute::Colors => Cow::Borrowed(bytemuck::cast_slice(&t.colors)),
    }
}

/// The textures that are used, in one buffer.
struct Textures {
    texels: Buffer,
    records: Vec<TextureRecord>,
    // record of each texture of the scene
    record_of: Vec<u32>,
    mips: Option<Mips>,
}

/// Mip levels of textures, in one buffer.
struct Mips {
    texels: Buffer,
    records: Vec<MipRecord>,
}

impl Mips {
    /// Makes the levels of the used textures, for each use of a texture (`uses`, by [`Texels`]).
    fn upload(device: &Arc<Device>, flat: &FlatScene, used: &[usize], uses: &[[bool; 3]]) -> Result<Self> {
        let texture = |t: usize| &flat.scene.textures[t];
        let mut records: Vec<_> = used.iter().map(|&t| mipmap::record([texture(t).width, texture(t).height])).collect();
        // textures that share an image share its levels, too
        let mut pyramids: Vec<Cow<[u8]>> = Vec::new();
        let mut pyramid_of = std::collections::HashMap::new();
        let mut destinations = Vec::new();
        for (k, (&t, uses)) in used.iter().zip(uses).enumerate() {
            for texels in Texels::ALL.into_iter().filter(|&texels| uses[texels as usize]) {
                let pyramid = *pyramid_of.entry((texture(t).texels.as_bytes().as_ptr(), texels)).or_insert_with(|| {
                    pyramids.push(Cow::Owned(mipmap::pyramid(texture(t), texels)));
                    pyramids.len() - 1
                });
                destinations.push((k, texels, pyramid));
            }
        }
        let (texels, addresses) = concatenate(device, "mip levels", &pyramids)?;
        for (k, texels, pyramid) in destinations {
            records[k].texels[texels as usize] = addresses[pyramid];
        }
        Ok(Self { texels, records })
    }
}

impl Textures {
    fn upload(device: &Arc<Device>, flat: &FlatScene, needs: Needs) -> Result<Self> {
        let mut record_of = vec![INVALID; flat.scene.textures.len()];
        let (mut used, mut uses) = (Vec::new(), Vec::new());
        for part in flat.groups.iter().flat_map(|g| &g.submeshes) {
            let material = &flat.scene.materials[flat.scene.meshes[part.mesh].material];
            let base = material.base_color_texture.filter(|_| needs.albedo || part.alpha_tested);
            let base_texels = if alpha_cutoff(material).is_some() { Texels::Covered } else { Texels::Srgb };
            let slots = shading::slots(material, needs).into_iter().enumerate().map(|(k, slot)| (slot, shading::texels(k)));
            for (slot, texels) in slots.chain([(base, base_texels)]) {
                let Some(slot) = slot else { continue };
                if record_of[slot.texture] == INVALID {
                    record_of[slot.texture] = used.len() as u32;
                    used.push(slot.texture);
                    uses.push([false; 3]);
                }
                uses[record_of[slot.texture] as usize][texels as usize] = true;
            }
        }
        // two textures may share an image: it is stored once
        let mut images: Vec<Cow<[u8]>> = Vec::new();
        let mut image_of = std::collections::HashMap::new();
        let mut image = Vec::new();
        for &t in &used {
            let texture = &flat.scene.textures[t];
            image.push(*image_of.entry(texture.texels.as_bytes().as_ptr()).or_insert_with(|| {
                images.push(Cow::Borrowed(texture.texels.as_bytes()));
                images.len() - 1
            }));
        }
        let (texels, addresses) = concatenate(device, "texels", &images)?;
        let records = used
            .iter()
            .zip(image)
            .map(|(&t, image)| {
                let texture = &flat.scene.textures[t];
                TextureRecord {
                    texels: addresses[image],
                    width: texture.width,
                    height: texture.height,
                    wrap_u: texture.wrap[0] as u32,
                    wrap_v: texture.wrap[1] as u32,
                    nearest: (texture.filter == Filter::Nearest) as u32,
                    format: match texture.texels {
                        TexelData::Unorm8(_) => TexelFormat::Unorm8,
                        TexelData::Unorm16(_) => TexelFormat::Unorm16,
                        TexelData::Float(_) => TexelFormat::Float,
                    } as u32,
                }
            })
            .collect();
        let mips = match needs.mip_levels && needs.shading && !needs.white && !used.is_empty() {
            true => Some(Mips::upload(device, flat, &used, &uses)?),
            false => None,
        };
        Ok(Self { texels, records, record_of, mips })
    }

    /// The record of an uploaded texture's use; without a texture, one that reads 1 everywhere.
    fn slot(&self, slot: Option<TextureSlot>) -> TextureUse {
        match slot {
            Some(s) => TextureUse {
                transform: s.transform.matrix2.to_cols_array(),
                offset: s.transform.translation.to_array(),
                texture: self.record_of[s.texture],
                set: s.texcoord as u32,
            },
            None => TextureUse { transform: [1.0, 0.0, 0.0, 1.0], offset: [0.0; 2], texture: INVALID, set: 0 },
        }
    }

    fn material(&self, m: &Material, blend: Blend) -> MaterialRecord {
        let slot = m.base_color_texture.filter(|s| self.record_of[s.texture] != INVALID);
        let transform = slot.map_or(glam::Affine2::IDENTITY, |s| s.transform);
        MaterialRecord {
            base_color: m.base_color.to_array(),
            texcoord_transform: transform.matrix2.to_cols_array(),
            texcoord_offset: transform.translation.to_array(),
            base_color_texture: slot.map_or(INVALID, |s| self.record_of[s.texture]),
            texcoord_set: slot.map_or(0, |s| s.texcoord as u32),
            alpha_cutoff: alpha_cutoff(m).unwrap_or(-1.0),
            coverage: (blend == Blend::Stochastic && m.alpha_mode == AlphaMode::Blend).into(),
            ..Default::default()
        }
    }
}
