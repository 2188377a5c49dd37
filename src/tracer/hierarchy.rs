//! The compute tracer's hierarchy in device memory, a BVH per group and a top level over the
//! instances, all in one node array: what its kernels share.

use std::sync::Arc;

use glam::Vec3;

use super::device_builder::DeviceBuilder;
use super::dynamic_trees::DynamicTrees;
use super::kernel::Kernel;
use super::lane_budget::stack_constant;
use super::local_trees::AreaBuffers;
use super::stream::LaunchMemory;
use crate::accel::Aabb;
use crate::accel::flatten::{BlasGroup, FlatScene, TlasInstance};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Device, Memory};
use crate::interface::records::hierarchy::{ALPHA_TESTED, SPHERE, SphereRecord, TriangleRecord};

/// The leaves of a scene that has few ([`crate::accel::few`]).
#[derive(Clone, Copy, Debug, Default)]
pub struct FewAddresses {
    /// Device address of the leaves, then of their boxes.
    pub leaves: u64,
    /// Their number.
    pub count: u32,
    /// A bit for each: it is flat.
    pub flat: u32,
}

/// Hierarchies in device memory.
pub(super) struct Hierarchy {
    pub kernel: Kernel,
    pub nodes: Buffer,
    /// Records of primitives; `None` where the leaves hold them.
    pub primitives: Option<Buffer>,
    /// Reference of the root node.
    pub root: u32,
    /// Reference of the root node of each TLAS instance.
    pub instance_roots: Vec<u32>,
    pub stack_entries: u32,
    /// World-space bounds of the whole scene, padded.
    pub bounds: Aabb,
    /// A u32: number of rays whose traversal the driver ended early.
    pub unfinished: Buffer,
    /// The leaves of a static scene without instances that has few, for passes that trace rays
    /// among other work, and where they are.
    pub few: Option<(Buffer, FewAddresses)>,
    /// Buffers between the steps of a launch.
    pub launch: LaunchMemory,
    /// State to update it in a dynamic scene (fast kernel only).
    pub dynamic: Option<Box<DynamicTrees>>,
    /// Builds trees of a dynamic scene on the device; `None`: the host does.
    pub builder: Option<DeviceBuilder>,
    /// Influence areas that have trees of their own (binary kernels only).
    pub areas: Option<AreaBuffers>,
}

impl Hierarchy {
    /// Fails when the driver ended a traversal loop early.
    pub fn check_finished(&self) -> Result<()> {
        let mut count = 0u32;
        self.unfinished.read_with(0, 4, 4, |_, bytes| count = bytemuck::pod_read_unaligned(bytes))?;
        let (what, remedy) = match self.kernel {
            Kernel::Packet => ("packets of rays", "--traversal wide, or a newer driver"),
            Kernel::Auto | Kernel::Wide => ("rays", "a newer driver, or fewer overlapping surfaces"),
            _ => ("rays", "--traversal wide, or a newer driver"),
        };
        match count {
            0 => Ok(()),
            n => Err(Error::Vulkan(format!(
                "the driver ended the traversal of {n} {what} early (Mesa before 23 leaves a loop after 65,535 iterations): use {remedy}"
            ))),
        }
    }

    /// Value of the specialization constant for the stack's array. The fast kernels hold the top of
    /// the stack in registers; the rest is rounded up, so that scenes share compiled shaders.
    pub fn stack_constant(&self) -> u32 {
        match self.kernel {
            Kernel::Auto | Kernel::Wide | Kernel::Packet => stack_constant(self.stack_entries),
            _ => self.stack_entries.max(1),
        }
    }

    pub fn bytes(&self) -> u64 {
        let areas = self.areas.as_ref().map_or(0, AreaBuffers::bytes);
        self.nodes.size() + self.primitives.as_ref().map_or(0, Buffer::size) + areas
    }

    /// See [`DynamicTrees::deform`].
    pub fn deform(&mut self, device: &Arc<Device>, group: usize, positions: &[Vec3]) -> Result<(bool, f64)> {
        match &mut self.dynamic {
            Some(d) => d.deform((device, self.builder.as_ref()), &mut self.nodes, group, positions),
            None => Ok((false, 1.0)),
        }
    }

    /// See [`DynamicTrees::place`].
    pub fn place(&mut self, instances: &[TlasInstance]) -> Result<bool> {
        let Some(dynamic) = &mut self.dynamic else { return Ok(false) };
        let (rebuilt, bounds) = dynamic.place(&mut self.nodes, instances)?;
        self.bounds = bounds;
        Ok(rebuilt)
    }

    /// See [`DynamicTrees::traced`].
    pub fn traced(&mut self, seconds: f64, instances: &[TlasInstance]) {
        if let Some(dynamic) = &mut self.dynamic {
            dynamic.traced(seconds, instances);
        }
    }
}

/// A counter of rays whose traversal ended early: see [`Hierarchy::check_finished`].
pub(super) fn unfinished_counter(device: &Arc<Device>) -> Result<Buffer> {
    let mut counter = Buffer::new(device, "unfinished rays", 4, Memory::Readback)?;
    counter.fill(4, 4, |_, bytes| bytes.fill(0))?;
    Ok(counter)
}

/// The record of a group's primitive for the binary and brute-force kernels: a triangle, or a
/// sphere in its layout.
pub(super) fn record(flat: &FlatScene, group: &BlasGroup, primitive: u32) -> TriangleRecord {
    let part = flat.submesh_of(group, primitive as usize);
    let k = primitive as usize - part.first_primitive;
    if group.spheres {
        let s = flat.sphere(part, k);
        let sphere = SphereRecord {
            center: s.center.to_array(),
            radius: s.radius,
            number: primitive | SPHERE,
            ..Default::default()
        };
        return bytemuck::cast(sphere);
    }
    let flag = if part.alpha_tested { ALPHA_TESTED } else { 0 };
    TriangleRecord { corners: flat.triangle(part, k).map(|v| v.to_array()), number: primitive | flag }
}
