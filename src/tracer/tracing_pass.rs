//! Passes that trace their rays themselves, among other work, with the compute tracer's functions
//! (`shaders/trace/few.glsl`): each lane has a ray, and waits until those of the others are done.

use super::hierarchy::FewAddresses;
use super::lane_budget::lane_budget;
use super::stream::spread;
use super::{ComputeOptions, Kernel, Push, Structure, Tracer, precompiled};
use crate::error::{Error, Result};
use crate::gpu::{ComputePipeline, Recorder, Specialization};
use crate::shaders::{LANES, Shader};

/// A pass that traces its rays itself, compiled for a tracer.
pub struct TracingPass {
    name: &'static str,
    pipeline: ComputePipeline,
    /// Items, such as paths, that a work-group processes.
    items_per_group: u32,
}

impl TracingPass {
    /// Records it for the items `push.first .. push.first + push.count`, timed under its name.
    pub fn record(&self, recorder: &mut Recorder, push: &Push) {
        let groups = spread(push.count.div_ceil(self.items_per_group), 1);
        recorder.timed(self.name, |r| r.dispatch_3d(&self.pipeline, push, groups));
    }
}

impl Tracer {
    /// Whether a [`TracingPass`] can trace rays on this device and with this tracer, if the scene
    /// has few leaves ([`Tracer::few_leaves`]): on a CPU driver that does not end long loops, with
    /// subgroups of 8 or 16 lanes.
    pub fn can_trace_in_passes(&self) -> bool {
        let info = &self.device.info;
        let lanes = info.limits.subgroup_size;
        let has_lanes = info.is_cpu() && info.packets() && (lanes == 8 || lanes == 16);
        let is_chosen = matches!(&self.structure, Structure::Compute(h) if h.kernel == Kernel::Auto);
        has_lanes && is_chosen && !info.cuts_long_loops()
    }

    /// The leaves of a static scene without instances that has few; `None` for other scenes and
    /// tracers.
    pub fn few_leaves(&self) -> Option<FewAddresses> {
        match &self.structure {
            Structure::Compute(h) => h.few.as_ref().map(|(_, few)| *few),
            Structure::Hardware { .. } => None,
        }
    }

    /// Compiles a pass that traces its rays itself, where [`Tracer::can_trace_in_passes`] says so.
    /// A lane processes several items, one after the other.
    ///
    /// # Errors
    /// Those of the device; [`Error::Usage`] where it cannot.
    pub fn tracing_pass(&self, name: &'static str, shader: &Shader, constants: &Specialization) -> Result<TracingPass> {
        let (true, Structure::Compute(h)) = (self.can_trace_in_passes(), &self.structure) else {
            return Err(Error::Usage(format!("{name} needs a CPU driver of Mesa 23 or later, and the compute tracer")));
        };
        let (info, options) =
            (&self.device.info, ComputeOptions { kernel: h.kernel, triangle_test: self.triangle_test });
        let s = precompiled::specialization(info, self.features, options, h.stack_constant());
        Ok(TracingPass {
            name,
            pipeline: ComputePipeline::with_full_subgroups(&self.device, name, shader, &s.and(constants))?,
            items_per_group: LANES * lane_budget(info).0,
        })
    }
}
