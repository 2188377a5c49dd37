//! The compute tracer's hierarchies: a BVH per group and a top level over the instances, all in one node array. This file has what the
//! kernels share; `wide.rs` has the fast kernel's BVH, `reference.rs` the binary one, and `brute.rs` has none.

use std::sync::Arc;

use glam::{DAffine3, Vec3};

use super::dynamic_trees::DynamicTrees;
use super::kernel::{BuildOptions, Kernel};
use super::stream::LaunchMemory;
use super::{brute, reference, wide};
use crate::accel::flatten::{BlasGroup, FlatScene, TlasInstance};
use crate::accel::{Aabb, bvh2};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Device, DeviceInfo, Memory};
use crate::interface::records::hierarchy::{ALPHA_TESTED, SPHERE, STACK_IN_REGISTERS, SphereRecord, TriangleRecord};

/// Rays per lane of the fast kernel, traced one after the other, on a CPU driver, where idle lanes of a vector cost most.
const RAYS_PER_LANE_CPU: u32 = 16;
/// Rays per lane on a GPU: the many rays of a launch already fill it, and long loops per lane only lengthen the tail.
const RAYS_PER_LANE_GPU: u32 = 2;

/// The number of rays that a lane traces one after the other, and the number of iterations of its loop after which it fetches no
/// further ray (0: no bound).
///
/// Where drivers end loops early, half of the iterations are reserved for the last ray. With one ray per lane of a work-group every ray
/// is still fetched, because each lane fetches at least one. On a CPU the vectors of a work-group run one after the other, and the first
/// fetches most rays, so lanes still trace about eight each.
pub(super) fn lane_budget(device: &DeviceInfo) -> (u32, u32) {
    match (device.cuts_long_loops(), device.is_cpu()) {
        (true, _) => (1, CUT_LOOP_TURNS / 2),
        (false, true) => (RAYS_PER_LANE_CPU, 0),
        (false, false) => (RAYS_PER_LANE_GPU, 0),
    }
}

/// Stack entries beyond those in registers that suffice for most scenes.
pub(super) const USUAL_STACK: u32 = 16;

/// Number of iterations after which some drivers leave any loop: [`DeviceInfo::cuts_long_loops`]. It is of all loops of an invocation together, and where shaders are not
/// optimized, short ones are not unrolled: up to twenty iterations in one of traversal.
const CUT_LOOP_TURNS: u32 = if cfg!(feature = "live-shaders") { 65_535 / 20 } else { 65_535 };

/// Iterations after which rays are not resumed any more: enough for one that passes a million instances.
const MAX_RESUMED_ITERATIONS: u64 = 1 << 22;

/// How often rays have to be resumed of which none visits more than `visits` blocks; 0 where no driver ends a loop before such a ray is done.
pub(super) fn resumptions(device: &DeviceInfo, visits: u64) -> u32 {
    let (_, last_fetch) = lane_budget(device);
    // SUSPEND_ITERATION in shaders/trace/suspend.glsl
    let suspended_at = u64::from(2 * last_fetch - (last_fetch >> 3));
    match suspended_at.saturating_sub(u64::from(last_fetch)) {
        0 => 0,
        left if visits < left => 0,
        _ => visits.min(MAX_RESUMED_ITERATIONS).div_ceil(suspended_at) as u32,
    }
}

/// Hierarchies on the host.
pub(super) enum Trees {
    Wide(wide::Trees, Kernel),
    Binary(reference::Trees, Kernel),
    None,
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
    /// Buffers between the steps of a launch (fast kernel only).
    pub launch: Option<LaunchMemory>,
    /// State to update it in a dynamic scene (fast kernel only).
    pub dynamic: Option<Box<DynamicTrees>>,
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

    /// Buffers between the steps of a launch of the fast kernel.
    pub fn launch_memory(&self) -> Result<LaunchMemory> {
        self.launch.clone().ok_or_else(|| Error::Vulkan(format!("kernel '{}' has no steps", self.kernel)))
    }

    /// Value of the specialization constant for the stack's array. The fast kernels hold the top of the stack in registers; the rest is
    /// rounded up, so that scenes share compiled shaders.
    pub fn stack_constant(&self) -> u32 {
        match self.kernel {
            Kernel::Auto | Kernel::Wide | Kernel::Packet => stack_constant(self.stack_entries),
            _ => self.stack_entries.max(1),
        }
    }

    pub fn bytes(&self) -> u64 {
        self.nodes.size() + self.primitives.as_ref().map_or(0, Buffer::size)
    }

    /// See [`DynamicTrees::deform`].
    pub fn deform(&mut self, device: &Arc<Device>, group: usize, positions: &[Vec3]) -> Result<(bool, f64)> {
        match &mut self.dynamic {
            Some(d) => d.deform(device, &mut self.nodes, group, positions),
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

impl Trees {
    pub fn build(flat: &FlatScene, kernel: Kernel, options: &BuildOptions) -> Result<Self> {
        let total = flat.primitive_count();
        if total > bvh2::MAX_PRIMITIVES || flat.instances.len() > bvh2::MAX_PRIMITIVES {
            return Err(Error::Scene(format!(
                "{total} primitives and {} instances are too many: the compute tracer takes at most {} of each",
                flat.instances.len(),
                bvh2::MAX_PRIMITIVES
            )));
        }
        if !flat.motion.is_none() && !matches!(kernel, Kernel::Auto | Kernel::Wide | Kernel::Packet) {
            return Err(Error::Usage(format!("traversal '{kernel}' is for static scenes; use --traversal {}", Kernel::Wide)));
        }
        Ok(match kernel {
            Kernel::Auto | Kernel::Wide | Kernel::Packet => Trees::Wide(wide::Trees::build(flat, options), kernel),
            Kernel::Nearest | Kernel::Direction => Trees::Binary(reference::Trees::build(flat, options), kernel),
            Kernel::Brute => {
                brute::check(flat)?;
                Trees::None
            }
        })
    }

    /// See [`super::BuildStats::sah_cost`].
    pub fn sah_cost(&self) -> Option<f64> {
        match self {
            Trees::Wide(trees, _) => trees.sah_cost(),
            _ => None,
        }
    }

    pub fn upload(self, device: &Arc<Device>, flat: &FlatScene) -> Result<Hierarchy> {
        match self {
            Trees::Wide(trees, kernel) => trees.upload(device, flat, kernel),
            Trees::Binary(trees, kernel) => trees.upload(device, flat, kernel),
            Trees::None => brute::upload(device, flat),
        }
    }
}

/// Entries of a stack of the fast kernels beyond those in registers.
pub(super) fn stack_constant(stack_entries: u32) -> u32 {
    match stack_entries.saturating_sub(STACK_IN_REGISTERS) {
        0 => 0,
        n => n.next_power_of_two().max(USUAL_STACK),
    }
}

/// A counter of rays whose traversal ended early: see [`Hierarchy::check_finished`].
pub(super) fn unfinished_counter(device: &Arc<Device>) -> Result<Buffer> {
    let mut counter = Buffer::new(device, "unfinished rays", 4, Memory::Readback)?;
    counter.fill(4, 4, |_, bytes| bytes.fill(0))?;
    Ok(counter)
}

pub(super) fn write_records<T: bytemuck::NoUninit>(
    device: &Arc<Device>,
    name: &str,
    count: u64,
    records: &mut dyn Iterator<Item = T>,
) -> Result<Buffer> {
    let size = size_of::<T>() as u64;
    let mut buffer = Buffer::new(device, name, size * count, Memory::Device)?;
    buffer.fill(size * count, size, |_, bytes| {
        for (out, r) in bytes.chunks_exact_mut(size as usize).zip(&mut *records) {
            out.copy_from_slice(bytemuck::bytes_of(&r));
        }
    })?;
    Ok(buffer)
}

/// The distance by which boxes are padded: eight half-ulps of the largest coordinate. It covers the rounding of quantization, and a ray
/// within the plane of flat geometry is then strictly inside the box, so that traversal needs no special case for it.
pub(super) fn padding<'a>(boxes: impl Iterator<Item = &'a Aabb>) -> f32 {
    let reach = boxes.fold(0.0f32, |m, b| m.max(b.min.abs().max(b.max.abs()).max_element()));
    reach_padding(reach)
}

/// [`padding`] of boxes whose largest coordinate is `reach`.
pub(super) fn reach_padding(reach: f32) -> f32 {
    (4.0 * f32::EPSILON * reach).max(1e-30)
}

pub(super) fn primitive_boxes(flat: &FlatScene, group: &BlasGroup) -> impl Iterator<Item = Aabb> {
    group.submeshes.iter().flat_map(move |part| {
        let count = flat.scene.meshes[part.mesh].geometry.primitive_count();
        (part.first_primitive..part.first_primitive + count).map(move |p| flat.primitive_bounds(group, part, p))
    })
}

/// World-space bounds of the instances, from those of their groups, padded by the rounding error of transforming a ray to group space.
pub(super) fn instance_boxes(flat: &FlatScene, bounds: &[Aabb]) -> Vec<Aabb> {
    let scene = flat.bounds();
    let pad = instance_padding(scene.min.abs().max(scene.max.abs()).max_element().max(0.0));
    flat.instances
        .iter()
        .map(|p| {
            let b = transformed_bounds(&p.to_world, bounds[p.group]);
            Aabb { min: b.min - pad, max: b.max + pad }
        })
        .collect()
}

/// 16 half-ulps of the largest coordinate: two transforms of three products each, and the inverse's own rounding.
pub(super) fn instance_padding(reach: f32) -> f32 {
    16.0 * f32::EPSILON * 0.5 * reach
}

/// Bounds of a transformed box, rounded but not padded.
pub(super) fn transformed_bounds(to_world: &DAffine3, b: Aabb) -> Aabb {
    (0..8u32).fold(Aabb::EMPTY, |out, k| {
        let pick = |axis: usize| if k >> axis & 1 == 0 { b.min[axis] } else { b.max[axis] };
        let corner = to_world.transform_point3(Vec3::new(pick(0), pick(1), pick(2)).as_dvec3()).as_vec3();
        out.union(Aabb { min: corner, max: corner })
    })
}

/// The record of a group's primitive for the binary and brute-force kernels: a triangle, or a sphere in its layout.
pub(super) fn record(flat: &FlatScene, group: &BlasGroup, primitive: u32) -> TriangleRecord {
    let part = flat.submesh_of(group, primitive as usize);
    let k = primitive as usize - part.first_primitive;
    if group.spheres {
        let s = flat.sphere(part, k);
        let sphere =
            SphereRecord { center: s.center.to_array(), radius: s.radius, number: primitive | SPHERE, ..Default::default() };
        return bytemuck::cast(sphere);
    }
    let flag = if part.alpha_tested { ALPHA_TESTED } else { 0 };
    TriangleRecord { corners: flat.triangle(part, k).map(|v| v.to_array()), number: primitive | flag }
}
