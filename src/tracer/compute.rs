//! Builds the compute tracer's hierarchies, a kind a kernel: `wide.rs` has the fast kernel's BVH,
//! `reference.rs` the binary one, and `brute.rs` has none.

use std::sync::Arc;

use super::device_builder::DeviceBuilder;
use super::hierarchy::Hierarchy;
use super::kernel::{BuildOptions, Kernel};
use super::{brute, reference, wide};
use crate::accel::bvh2;
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::gpu::Device;
use crate::stage;

/// Hierarchies on the host.
pub(super) enum Trees {
    Wide(wide::Trees, Kernel),
    Binary(reference::Trees, Kernel),
    None,
}

impl Trees {
    /// `device`: builds trees of wide nodes, where it can.
    pub fn build(
        flat: &FlatScene,
        kernel: Kernel,
        options: &BuildOptions,
        device: Option<&DeviceBuilder>,
    ) -> Result<Self> {
        let total = flat.primitive_count();
        if total > bvh2::MAX_PRIMITIVES || flat.instances.len() > bvh2::MAX_PRIMITIVES {
            return Err(Error::Scene(format!(
                "{total} primitives and {} instances are too many: the compute tracer takes at most {} of each",
                flat.instances.len(),
                bvh2::MAX_PRIMITIVES
            )));
        }
        if !flat.motion.is_none() && !kernel.is_wide() {
            return Err(Error::Usage(format!(
                "traversal '{kernel}' is for static scenes; use --traversal {}",
                Kernel::Wide
            )));
        }
        if (options.heuristic.is_some() || options.local.is_some())
            && !matches!(kernel, Kernel::Nearest | Kernel::Direction)
        {
            return Err(Error::Usage(format!(
                "traversal '{kernel}' takes no tree of a heuristic; use --traversal {}",
                Kernel::Nearest
            )));
        }
        let _stage = stage::begin_counted("building the BVH", total as u64);
        Ok(match kernel {
            Kernel::Auto | Kernel::Wide | Kernel::Packet => {
                Trees::Wide(wide::Trees::build(flat, options, device), kernel)
            }
            Kernel::Nearest | Kernel::Direction => Trees::Binary(reference::Trees::build(flat, options)?, kernel),
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
