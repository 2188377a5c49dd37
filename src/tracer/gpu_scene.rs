//! The scene in device memory: the records of [`crate::interface::records::scene`].

use std::sync::Arc;

use glam::Vec3;

use super::albedo;
use super::attributes::{Attribute, Attributes};
use super::group_buffers::GroupBuffers;
use super::hierarchy::Hierarchy;
use super::needs::Needs;
use super::previous_frame::PreviousFrame;
use super::raster_instance::{RasterGeometry, RasterInstance};
use super::shading;
use super::textures::{TextureSlots, Textures};
use super::transform::{rows, world_to_group};
use super::upload::write_all;
use crate::accel::features::Blend;
use crate::accel::flatten::{FlatScene, TlasInstance};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Device};
use crate::interface::records::ray::INVALID;
use crate::interface::records::scene::{InstanceRecord, MaterialRecord, SceneRoot, SubmeshRecord};
use crate::interface::records::shading::ShadingRecord;
use crate::interface::{BsdfModel, MaterialFeature, ShadingFeatures};
use crate::scene::{Geometry, Material};

/// Number and size of mip levels.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MipStats {
    /// Largest number of levels of a texture, level 0 included; 0 without mip levels.
    pub levels: u32,
    /// Size of levels 1 and up, in bytes.
    pub bytes: u64,
}

/// A change of materials, the least first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum MaterialChange {
    /// Nothing has changed.
    #[default]
    None,
    /// How surfaces look has changed.
    Shading,
    /// Where surfaces are has changed, too: their alpha is tested.
    Alpha,
}

/// Writes the records of materials that change.
struct MaterialWriter {
    textures: TextureSlots,
    needs: Needs,
    /// The numbers of [`shading::indices_of_refraction`].
    indices: Vec<f32>,
    blend: Blend,
}

impl MaterialWriter {
    /// `None` where no material changes.
    fn new(textures: &Textures, needs: Needs, indices: &[f32], flat: &FlatScene) -> Option<Self> {
        let make = || Self { textures: textures.slots.clone(), needs, indices: indices.to_vec(), blend: flat.blend };
        (!flat.motion.materials.is_empty()).then(make)
    }
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
    /// Whether rays miss each TLAS instance.
    hidden: Vec<bool>,
    material_records: Vec<MaterialRecord>,
    material_buffer: Buffer,
    /// Empty for tracers that do not shade, as is their buffer.
    shading_records: Vec<ShadingRecord>,
    shading_buffer: Option<Buffer>,
    /// `None` where no material changes.
    changing: Option<MaterialWriter>,
    others: Vec<Buffer>,
    mips: MipStats,
}

impl GpuScene {
    /// Uploads the data that `needs` and the scene itself require.
    pub fn new(device: &Arc<Device>, flat: &FlatScene, needs: Needs) -> Result<Self> {
        let needs = Needs {
            normals: needs.normals || needs.shading,
            albedo: needs.albedo || needs.shading && !needs.white,
            ..needs
        };

        // vertices, indices and their attributes
        let groups = flat.groups.iter().map(|g| GroupBuffers::upload(device, flat, g)).collect::<Result<Vec<_>>>()?;
        let attributes = Attributes::upload(device, flat, needs)?;

        // records of submeshes and instances
        let (submeshes, first_submesh) = submesh_records(flat, &groups, &attributes);
        let instances = instance_records(flat, &groups, &first_submesh)?;
        let scene_instances = scene_instance_records(flat, &first_submesh);

        // materials and their textures
        let textures = Textures::upload(device, flat, needs)?;
        let materials: Vec<_> = flat.scene.materials.iter().map(|m| textures.slots.material(m, flat.blend)).collect();
        let indices = shading::indices_of_refraction(flat);
        let shading: Vec<_> = if needs.shading {
            let record = |m| shading::record(m, needs, &indices, |slot| textures.slots.slot(slot));
            flat.scene.materials.iter().map(record).collect()
        } else {
            Vec::new()
        };

        // all of them in device memory, with the root that has their addresses
        let instance_buffer = Buffer::from_slice(device, "instance records", &instances)?;
        let mut others = Vec::new();
        let mut keep = |buffer: Buffer| {
            let address = buffer.address();
            others.push(buffer);
            address
        };
        let material_buffer = Buffer::from_slice(device, "material records", &materials)?;
        let mut root = SceneRoot {
            instances: instance_buffer.address(),
            materials: material_buffer.address(),
            ..Default::default()
        };
        root.submesh_count = submeshes.len() as u32;
        root.submeshes = keep(Buffer::from_slice(device, "submesh records", &submeshes)?);
        root.scene_instances = keep(Buffer::from_slice(device, "records of scene instances", &scene_instances)?);
        root.textures = keep(Buffer::from_slice(device, "texture records", &textures.records)?);
        let changing = MaterialWriter::new(&textures, needs, &indices, flat);
        keep(textures.texels);
        let mut shading_buffer = None;
        let mut mip_stats = MipStats::default();
        if let Some(mips) = textures.mips {
            let records = Buffer::from_slice(device, "mip records", &mips.records)?;
            let levels = mips.records.iter().map(|r| r.last + 1).max().unwrap_or(0);
            mip_stats = MipStats { levels, bytes: records.size() + mips.texels.size() };
            root.mips = keep(records);
            keep(mips.texels);
        }
        if needs.shading {
            let buffer = Buffer::from_slice(device, "shading records", &shading)?;
            root.shading = buffer.address();
            shading_buffer = Some(buffer);
            if let Some(tables) = albedo_tables(flat, needs, &indices) {
                root.albedo = keep(Buffer::from_slice(device, "albedo tables", &tables)?);
            }
        }

        // what may change: a deforming mesh is never baked
        let normals = |&mesh: &usize| Some((mesh, attributes.normals_offset(mesh)?));
        let normals = flat.motion.meshes.iter().filter_map(normals).collect();
        let motion = PreviousFrame::new(device, flat, |group| groups[group].positions.size())?;
        root.motion = motion.as_ref().map_or(0, PreviousFrame::address);
        let root_buffer = Buffer::from_slice(device, "scene root", &[root])?;

        // what the host reads of it
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
            hidden: flat.instances.iter().map(|p| p.hidden).collect(),
            material_records: materials,
            material_buffer,
            shading_records: shading,
            shading_buffer,
            changing,
            others,
            mips: mip_stats,
        })
    }

    /// The TLAS instances for rasterization, in their current state.
    pub(super) fn raster_instances(&self) -> impl Iterator<Item = RasterInstance<'_>> {
        (0..).zip(self.instances.iter().zip(&self.group_of)).map(|(entry, (instance, &group))| {
            let hidden = self.hidden[entry as usize];
            let buffers = &self.groups[group as usize];
            RasterInstance {
                entry,
                hidden,
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
        let own = [&self.attributes, &self.instance_buffer, &self.material_buffer];
        let others = self.others.iter().chain(own).chain(&self.shading_buffer);
        self.groups.iter().map(GroupBuffers::bytes).chain(others.map(Buffer::size)).sum()
    }

    /// Number and size of mip levels.
    pub(super) fn mips(&self) -> MipStats {
        self.mips
    }

    /// Before an update that moves these TLAS instances, now at `placements`, and deforms these
    /// groups.
    pub(super) fn begin_update(
        &mut self,
        instances: &[TlasInstance],
        moving: Vec<usize>,
        deforming: Vec<usize>,
    ) -> Result<()> {
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

    /// Materials have changed. Returns what has, by their records.
    pub(super) fn set_materials(&mut self, changed: &[(usize, Material)]) -> Result<MaterialChange> {
        let Some(writer) = &self.changing else { return Ok(MaterialChange::None) };
        let mut change = MaterialChange::None;
        for (k, material) in changed {
            let record = writer.textures.material(material, writer.blend);
            if let Some(place) = self.material_records.get_mut(*k).filter(|r| **r != record) {
                let is_there = record.alpha_cutoff < 0.0 || has_same_alpha(place, &record);
                change = change.max(if is_there { MaterialChange::Shading } else { MaterialChange::Alpha });
                *place = record;
            }
            let use_of = |slot| writer.textures.slot(slot);
            let record = shading::record(material, writer.needs, &writer.indices, use_of);
            if let Some(place) = self.shading_records.get_mut(*k)
                && bytemuck::bytes_of(place) != bytemuck::bytes_of(&record)
            {
                change = change.max(MaterialChange::Shading);
                *place = record;
            }
        }
        if change != MaterialChange::None {
            write_all(&mut self.material_buffer, &self.material_records)?;
            if let Some(buffer) = &mut self.shading_buffer {
                write_all(buffer, &self.shading_records)?;
            }
        }
        Ok(change)
    }

    /// TLAS instances have moved, or were hidden or shown: which, and how they are.
    pub(super) fn set_transforms(&mut self, moved: &[(usize, TlasInstance)]) -> Result<()> {
        for (k, instance) in moved {
            let record = &mut self.instances[*k];
            (record.group_to_world, record.world_to_group) = (rows(&instance.to_world), world_to_group(instance));
            self.hidden[*k] = instance.hidden;
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
        self.root.launch_hits = h.launch.hits.address();
        self.root.launch_counters = h.launch.counters.address();
        self.root.areas = h.areas.as_ref().map_or(0, |a| a.root.address());
        self.root.suspended = h.launch.suspended.as_ref().map_or(0, |s| s.memory.address());
        write_all(&mut self.root_buffer, &[self.root])
    }

    /// Stores the address of the hardware tracers' top level in the scene root.
    pub(super) fn set_top_level(&mut self, address: u64) -> Result<()> {
        self.root.top_level = address;
        write_all(&mut self.root_buffer, &[self.root])
    }
}

/// Whether two states of a material that is tested for alpha are there at the same places.
fn has_same_alpha(a: &MaterialRecord, b: &MaterialRecord) -> bool {
    a.base_color[3] == b.base_color[3]
        && a.alpha_cutoff == b.alpha_cutoff
        && (a.texcoord_transform, a.texcoord_offset) == (b.texcoord_transform, b.texcoord_offset)
}

/// The records of all submeshes, and the index of each group's first.
fn submesh_records(
    flat: &FlatScene,
    groups: &[GroupBuffers],
    attributes: &Attributes,
) -> (Vec<SubmeshRecord>, Vec<u32>) {
    let (mut submeshes, mut first_submesh) = (Vec::new(), Vec::new());
    for (group, buffers) in flat.groups.iter().zip(groups) {
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
                texcoord_sets: match &flat.scene.meshes[part.mesh].geometry {
                    Geometry::Triangles(t) => 1 + t.more_texcoords.len() as u32,
                    Geometry::Spheres(_) => flat.has_sphere_textures(part).into(),
                },
                tangents: attributes.address(part, k, Attribute::Tangents(0)),
                clearcoat_tangents: attributes.address(part, k, Attribute::Tangents(1)),
                anisotropy_tangents: attributes.address(part, k, Attribute::Tangents(2)),
            });
        }
    }
    (submeshes, first_submesh)
}

/// The records of all TLAS instances; fails for a transform that cannot be inverted.
fn instance_records(flat: &FlatScene, groups: &[GroupBuffers], first_submesh: &[u32]) -> Result<Vec<InstanceRecord>> {
    let instances: Vec<_> = flat
        .instances
        .iter()
        .map(|p| InstanceRecord {
            group_to_world: rows(&p.to_world),
            world_to_group: world_to_group(p),
            submesh_of: groups[p.group].submesh_of.as_ref().map_or(0, Buffer::address),
            first_submesh: first_submesh[p.group],
            scene_instance: p.scene_instance.map_or(INVALID, |i| i as u32),
            root: 0,
            opaque_count: flat.groups[p.group].opaque_count as u32,
            ..Default::default()
        })
        .collect();
    let is_finite =
        |i: &InstanceRecord| i.group_to_world.iter().chain(&i.world_to_group).flatten().all(|x| x.is_finite());
    if let Some(bad) = instances.iter().position(|i| !is_finite(i)) {
        let name = flat.instances[bad].scene_instance.map_or("", |i| flat.scene.instances[i].name.as_str());
        return Err(Error::Scene(format!(
            "instance {bad} '{name}' has a transform that cannot be inverted (a scale of zero?)"
        )));
    }
    Ok(instances)
}

/// The TLAS instance and the submesh record of each instance of the scene.
fn scene_instance_records(flat: &FlatScene, first_submesh: &[u32]) -> Vec<[u32; 2]> {
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
    scene_instances
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
