//! How long the compute tracer's kernels may run: rays of a lane, iterations of its loop, and its
//! stack.

use crate::gpu::DeviceInfo;
use crate::interface::records::hierarchy::STACK_IN_REGISTERS;

/// Rays per lane of the fast kernel, traced one after the other, on a CPU driver, where idle lanes
/// of a vector cost most.
const RAYS_PER_LANE_CPU: u32 = 16;

/// Rays per lane on a GPU: the many rays of a launch already fill it, and long loops per lane only
/// lengthen the tail.
const RAYS_PER_LANE_GPU: u32 = 2;

/// The number of rays that a lane traces one after the other, and the number of iterations of its
/// loop after which it fetches no further ray (0: no bound).
///
/// Where drivers end loops early, half of the iterations are reserved for the last ray. With one
/// ray per lane of a work-group every ray is still fetched, because each lane fetches at least one.
/// On a CPU the vectors of a work-group run one after the other, and the first fetches most rays,
/// so lanes still trace about eight each.
pub(super) fn lane_budget(device: &DeviceInfo) -> (u32, u32) {
    match (device.cuts_long_loops(), device.is_cpu()) {
        (true, _) => (1, CUT_LOOP_TURNS / 2),
        (false, true) => (RAYS_PER_LANE_CPU, 0),
        (false, false) => (RAYS_PER_LANE_GPU, 0),
    }
}

/// Stack entries beyond those in registers that suffice for most scenes.
pub(super) const USUAL_STACK: u32 = 16;

/// Number of iterations after which some drivers leave any loop: [`DeviceInfo::cuts_long_loops`].
/// It is of all loops of an invocation together, and where shaders are not optimized, short ones
/// are not unrolled: up to twenty iterations in one of traversal.
const CUT_LOOP_TURNS: u32 = if cfg!(feature = "live-shaders") { 65_535 / 20 } else { 65_535 };

/// Iterations after which rays are not resumed any more: enough for one that passes a million
/// instances.
const MAX_RESUMED_ITERATIONS: u64 = 1 << 22;

/// How often rays have to be resumed of which none visits more than `visits` blocks; 0 where no
/// driver ends a loop before such a ray is done.
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

/// Entries of a stack of the fast kernels beyond those in registers.
pub(super) fn stack_constant(stack_entries: u32) -> u32 {
    match stack_entries.saturating_sub(STACK_IN_REGISTERS) {
        0 => 0,
        n => n.next_power_of_two().max(USUAL_STACK),
    }
}
