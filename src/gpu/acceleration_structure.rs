//! Bottom- and top-level acceleration structures of VK_KHR_acceleration_structure.

use std::sync::Arc;

use ash::vk;

use super::buffer::{Buffer, Memory};
use super::commands::{Commands, Recorder};
use super::device::Device;
use super::result::Context;
use crate::error::{Error, Result};

/// Minimum saving, as a fraction of the size, for which a structure is compacted.
const MIN_COMPACTION_SAVING: f64 = 0.1;

/// Geometry of a bottom-level structure.
pub enum BottomLevelInput<'a> {
    /// Indexed triangles: opaque ones first, alpha-tested ones behind them as a second geometry.
    Triangles {
        /// 3 floats per vertex.
        positions: &'a Buffer,
        /// Number of vertices.
        vertex_count: u32,
        /// 3 uints per triangle.
        indices: &'a Buffer,
        /// Number of opaque triangles, which come first.
        opaque: u32,
        /// Number of alpha-tested triangles, which follow and need an any-hit shader.
        alpha_tested: u32,
    },
    /// Boxes of 6 floats: procedural geometry, opaque.
    Boxes {
        /// `VkAabbPositionsKHR` each.
        boxes: &'a Buffer,
        /// Number of boxes.
        count: u32,
    },
}

/// A TLAS instance, as VkAccelerationStructureInstanceKHR.
pub struct AccelerationStructureInstance {
    /// Object to world, three rows.
    pub transform: [f32; 12],
    /// Custom index (gl_InstanceCustomIndexEXT), below 2^24.
    pub index: u32,
    /// Offset of its hit group in the shader binding table.
    pub hit_group: u32,
    /// Device address of its bottom-level structure ([`AccelerationStructure::address`]).
    pub bottom_level: u64,
    /// Rays miss it.
    pub hidden: bool,
}

/// How a structure is updated after its inputs have changed in place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Update {
    /// The bounding boxes are recomputed, the tree is kept.
    Refit,
    /// The structure is built from scratch.
    Rebuild,
}

/// A built acceleration structure.
pub struct AccelerationStructure {
    raw: vk::AccelerationStructureKHR,
    address: u64,
    buffer: Buffer,
    device: Arc<Device>,
}

impl AccelerationStructure {
    fn allocate(device: &Arc<Device>, name: &str, ty: vk::AccelerationStructureTypeKHR, size: u64) -> Result<Self> {
        let functions = functions(device)?;
        let buffer = Buffer::with_usage(
            device,
            name,
            size,
            Memory::Device,
            vk::BufferUsageFlags::ACCELERATION_STRUCTURE_STORAGE_KHR,
        )?;
        let info = vk::AccelerationStructureCreateInfoKHR::default().buffer(buffer.raw).size(size).ty(ty);
        // SAFETY: the buffer holds `size` bytes; offset 0 is aligned
        let raw = unsafe { functions.create_acceleration_structure(&info, None) }.context(name)?;
        device.name(raw, name);
        // SAFETY: just made
        let address = unsafe {
            functions.get_acceleration_structure_device_address(
                &vk::AccelerationStructureDeviceAddressInfoKHR::default().acceleration_structure(raw),
            )
        };
        Ok(Self { raw, address, buffer, device: device.clone() })
    }

    /// Builds a bottom-level structure, and compacts it if that saves memory. On lavapipe it never
    /// does, but the query runs there too, so that tests cover it.
    pub fn bottom_level(
        device: &Arc<Device>,
        commands: &mut Commands,
        name: &str,
        input: &BottomLevelInput,
    ) -> Result<Self> {
        let (geometries, ranges) = bottom_level_geometry(input);
        let flags = vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE
            | vk::BuildAccelerationStructureFlagsKHR::ALLOW_COMPACTION;
        let inputs = Inputs { ty: vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL, flags, geometries, ranges };
        inputs.build(device, commands, name)?.compacted(commands, name)
    }

    /// As [`AccelerationStructure::bottom_level`], for inputs that will change: it can be updated,
    /// and is not compacted, so that a rebuild fits.
    pub fn changing_bottom_level(
        device: &Arc<Device>,
        commands: &mut Commands,
        name: &str,
        input: &BottomLevelInput,
    ) -> Result<Self> {
        Inputs::changing(input).build(device, commands, name)
    }

    /// Updates a structure made by [`AccelerationStructure::changing_bottom_level`]. Only the
    /// vertex positions of the input may differ. The address stays valid.
    pub fn update(&self, commands: &mut Commands, input: &BottomLevelInput, update: Update) -> Result<()> {
        Inputs::changing(input).record(self, commands, update)
    }

    /// Builds a top level.
    pub fn top_level(
        device: &Arc<Device>,
        commands: &mut Commands,
        entries: &[AccelerationStructureInstance],
    ) -> Result<Self> {
        let records = entry_records(device, entries)?;
        Inputs::top_level(&records, entries.len()).build(device, commands, "top level")
    }

    /// Rebuilds a top level in place, for as many instances as before. The address stays valid.
    pub fn rebuild_top_level(&self, commands: &mut Commands, entries: &[AccelerationStructureInstance]) -> Result<()> {
        let records = entry_records(&self.device, entries)?;
        Inputs::top_level(&records, entries.len()).record(self, commands, Update::Rebuild)
    }

    /// Device address, by which shaders and TLAS instances refer to it.
    pub fn address(&self) -> u64 {
        self.address
    }

    /// Size in bytes.
    pub fn size(&self) -> u64 {
        self.buffer.size()
    }

    fn compacted(self, commands: &mut Commands, name: &str) -> Result<Self> {
        let functions = functions(&self.device)?.clone();

        // the driver tells the compacted size on the device's side: a query
        let info = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR)
            .query_count(1);
        // SAFETY: one query, reset, written by the submission below and read after it; the pool is
        // destroyed here
        let size = unsafe {
            let pool = self.device.raw.create_query_pool(&info, None).context("the compaction query")?;
            self.device.raw.reset_query_pool(pool, 0, 1);
            let submitted = commands.run(|r| {
                functions.cmd_write_acceleration_structures_properties(
                    r.buffer,
                    &[self.raw],
                    vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR,
                    pool,
                    0,
                )
            });
            let mut size = [0u64];
            let read = submitted.and_then(|_| {
                let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT;
                self.device.raw.get_query_pool_results(pool, 0, &mut size, flags).context("the compacted size")
            });
            self.device.raw.destroy_query_pool(pool, None);
            read?;
            size[0]
        };

        // a copy of nearly the same size is not worth its memory
        if size == 0 || size as f64 > (1.0 - MIN_COMPACTION_SAVING) * self.size() as f64 {
            return Ok(self);
        }
        let compact = Self::allocate(&self.device, name, vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL, size)?;
        let copy = vk::CopyAccelerationStructureInfoKHR::default()
            .src(self.raw)
            .dst(compact.raw)
            .mode(vk::CopyAccelerationStructureModeKHR::COMPACT);
        commands.run(|r| {
            // SAFETY: the source was built with ALLOW_COMPACTION, the target has the compacted size
            unsafe { functions.cmd_copy_acceleration_structure(r.buffer, &copy) };
        })?;
        Ok(compact)
    }
}

fn functions(device: &Device) -> Result<&ash::khr::acceleration_structure::Device> {
    device.structures.as_ref().ok_or_else(|| Error::Device("the device has no VK_KHR_acceleration_structure".into()))
}

type Geometry<'a> = vk::AccelerationStructureGeometryKHR<'a>;
type Range = vk::AccelerationStructureBuildRangeInfoKHR;

fn bottom_level_geometry<'a>(input: &BottomLevelInput) -> (Vec<Geometry<'a>>, Vec<Range>) {
    match *input {
        BottomLevelInput::Triangles { positions, vertex_count, indices, opaque, alpha_tested } => {
            let triangles = vk::AccelerationStructureGeometryTrianglesDataKHR::default()
                .vertex_format(vk::Format::R32G32B32_SFLOAT)
                .vertex_data(vk::DeviceOrHostAddressConstKHR { device_address: positions.address() })
                .vertex_stride(12)
                .max_vertex(vertex_count.saturating_sub(1))
                .index_type(vk::IndexType::UINT32)
                .index_data(vk::DeviceOrHostAddressConstKHR { device_address: indices.address() });
            let geometry = |flags| {
                vk::AccelerationStructureGeometryKHR::default()
                    .geometry_type(vk::GeometryTypeKHR::TRIANGLES)
                    .geometry(vk::AccelerationStructureGeometryDataKHR { triangles })
                    .flags(flags)
            };
            let mut out = (Vec::new(), Vec::new());
            if opaque > 0 || alpha_tested == 0 {
                out.0.push(geometry(vk::GeometryFlagsKHR::OPAQUE));
                out.1.push(Range::default().primitive_count(opaque));
            }
            if alpha_tested > 0 {
                out.0.push(geometry(vk::GeometryFlagsKHR::empty()));
                out.1.push(Range::default().primitive_count(alpha_tested).primitive_offset(12 * opaque));
            }
            out
        }
        BottomLevelInput::Boxes { boxes, count } => {
            let aabbs = vk::AccelerationStructureGeometryAabbsDataKHR::default()
                .data(vk::DeviceOrHostAddressConstKHR { device_address: boxes.address() })
                .stride(24);
            let geometry = vk::AccelerationStructureGeometryKHR::default()
                .geometry_type(vk::GeometryTypeKHR::AABBS)
                .geometry(vk::AccelerationStructureGeometryDataKHR { aabbs })
                .flags(vk::GeometryFlagsKHR::OPAQUE);
            (vec![geometry], vec![Range::default().primitive_count(count)])
        }
    }
}

/// The instances of a top level in a buffer, as VkAccelerationStructureInstanceKHR.
fn entry_records(device: &Arc<Device>, entries: &[AccelerationStructureInstance]) -> Result<Buffer> {
    if entries.len() >= 1 << 24 {
        return Err(Error::Scene(format!(
            "{} instances are more than the 2^24 of a Vulkan top-level structure; use --tracer compute",
            entries.len()
        )));
    }
    let mut records = Buffer::new(device, "top-level entries", 64 * entries.len() as u64, Memory::Upload)?;
    let bytes = records.bytes_mut().ok_or_else(|| Error::Vulkan("the top-level entries are not mapped".into()))?;
    for (entry, record) in entries.iter().zip(bytes.chunks_exact_mut(64)) {
        // VkAccelerationStructureInstanceKHR: transform, index | mask, hit group | flags, address
        record[..48].copy_from_slice(bytemuck::cast_slice(&entry.transform));
        let mask: u32 = if entry.hidden { 0 } else { 0xff };
        record[48..52].copy_from_slice(&(entry.index | mask << 24).to_le_bytes());
        let cull_disable = vk::GeometryInstanceFlagsKHR::TRIANGLE_FACING_CULL_DISABLE.as_raw();
        record[52..56].copy_from_slice(&(entry.hit_group | cull_disable << 24).to_le_bytes());
        record[56..].copy_from_slice(&entry.bottom_level.to_le_bytes());
    }
    Ok(records)
}

/// Inputs that a structure is built over, as Vulkan takes them.
struct Inputs<'a> {
    ty: vk::AccelerationStructureTypeKHR,
    flags: vk::BuildAccelerationStructureFlagsKHR,
    geometries: Vec<Geometry<'a>>,
    ranges: Vec<Range>,
}

impl<'a> Inputs<'a> {
    fn changing(input: &BottomLevelInput) -> Self {
        let (geometries, ranges) = bottom_level_geometry(input);
        let flags = vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE
            | vk::BuildAccelerationStructureFlagsKHR::ALLOW_UPDATE;
        Self { ty: vk::AccelerationStructureTypeKHR::BOTTOM_LEVEL, flags, geometries, ranges }
    }

    fn top_level(records: &Buffer, entries: usize) -> Self {
        let instances = vk::AccelerationStructureGeometryInstancesDataKHR::default()
            .data(vk::DeviceOrHostAddressConstKHR { device_address: records.address() });
        let geometry = vk::AccelerationStructureGeometryKHR::default()
            .geometry_type(vk::GeometryTypeKHR::INSTANCES)
            .geometry(vk::AccelerationStructureGeometryDataKHR { instances });
        Self {
            ty: vk::AccelerationStructureTypeKHR::TOP_LEVEL,
            flags: vk::BuildAccelerationStructureFlagsKHR::PREFER_FAST_TRACE,
            geometries: vec![geometry],
            ranges: vec![vk::AccelerationStructureBuildRangeInfoKHR::default().primitive_count(entries as u32)],
        }
    }

    fn info(&self, mode: vk::BuildAccelerationStructureModeKHR) -> vk::AccelerationStructureBuildGeometryInfoKHR<'_> {
        vk::AccelerationStructureBuildGeometryInfoKHR::default()
            .ty(self.ty)
            .flags(self.flags)
            .mode(mode)
            .geometries(&self.geometries)
    }

    fn sizes(
        &self,
        functions: &ash::khr::acceleration_structure::Device,
    ) -> vk::AccelerationStructureBuildSizesInfoKHR<'_> {
        let counts: Vec<u32> = self.ranges.iter().map(|r| r.primitive_count).collect();
        let mut sizes = vk::AccelerationStructureBuildSizesInfoKHR::default();
        let info = self.info(vk::BuildAccelerationStructureModeKHR::BUILD);
        let ty = vk::AccelerationStructureBuildTypeKHR::DEVICE;
        // SAFETY: geometries and counts match
        unsafe { functions.get_acceleration_structure_build_sizes(ty, &info, &counts, &mut sizes) };
        sizes
    }

    fn build(&self, device: &Arc<Device>, commands: &mut Commands, name: &str) -> Result<AccelerationStructure> {
        let size = self.sizes(functions(device)?).acceleration_structure_size;
        let structure = AccelerationStructure::allocate(device, name, self.ty, size)?;
        self.record(&structure, commands, Update::Rebuild)?;
        Ok(structure)
    }

    /// Builds into `target`, which must be large enough, and waits.
    fn record(&self, target: &AccelerationStructure, commands: &mut Commands, update: Update) -> Result<()> {
        let device = &target.device;
        let functions = functions(device)?;
        let sizes = self.sizes(functions);
        debug_assert!(sizes.acceleration_structure_size <= target.size());
        let (mode, size) = match update {
            Update::Rebuild => (vk::BuildAccelerationStructureModeKHR::BUILD, sizes.build_scratch_size),
            Update::Refit => (vk::BuildAccelerationStructureModeKHR::UPDATE, sizes.update_scratch_size),
        };
        // VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-03710: the address itself has to be
        // aligned, so leave room for it
        let alignment = device.info.limits.scratch_alignment.max(1) as u64;
        let scratch = Buffer::new(device, "acceleration-structure scratch", size + alignment, Memory::Device)?;
        let mut info = self
            .info(mode)
            .dst_acceleration_structure(target.raw)
            .scratch_data(vk::DeviceOrHostAddressKHR { device_address: scratch.address().next_multiple_of(alignment) });
        if update == Update::Refit {
            info = info.src_acceleration_structure(target.raw);
        }
        commands.run(|r: &mut Recorder| {
            r.timed("build", |r| {
                // SAFETY: inputs, target and scratch live until the submission is waited for; a
                // refit's target was built with ALLOW_UPDATE over as many primitives
                unsafe { functions.cmd_build_acceleration_structures(r.buffer, &[info], &[&self.ranges]) };
            })
        })?;
        Ok(())
    }
}

impl Drop for AccelerationStructure {
    fn drop(&mut self) {
        if let Ok(functions) = functions(&self.device) {
            // SAFETY: submissions are waited for; its buffer is dropped after it
            unsafe { functions.destroy_acceleration_structure(self.raw, None) };
        }
    }
}
