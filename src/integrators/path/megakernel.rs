//! Paths from the camera to their end in one kernel (`shaders/path_megakernel.glsl`), and when it
//! is used: for scenes of few primitives on CPU drivers.

use std::fmt;

use super::settings::PathKernel;
use super::{PathEstimator, TracedBy};
use crate::accel::few::MAX_LEAVES;
use crate::error::{Error, Result};
use crate::gpu::{Commands, Timing};
use crate::interface::{PathFeature, PathFeatures};
use crate::tracer::{Push, Tracer};

/// Number of regions of the wavefront, camera rays, bounces and shadow rays, whose work the kernel
/// does in one.
pub(super) const STEPS: u32 = 8;
/// Bytes of what the kernel counts ([`super::params::PathParams::counts`]).
const COUNTED_BYTES: u64 = 12;

/// How paths are traced, and why.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Schedule {
    /// A wavefront, because it was asked for.
    #[default]
    Wavefront,
    /// A wavefront, because a kernel cannot trace rays among other work on this device and with
    /// this tracer.
    CannotTrace,
    /// A wavefront, because of what the paths do.
    NeedsQueues,
    /// A wavefront, because the scene has too many leaves, or may change.
    Large,
    /// The megakernel, for a scene of so many leaves.
    Megakernel(u32),
}

impl Schedule {
    /// Chooses.
    ///
    /// # Errors
    /// [`Error::Usage`] where the megakernel is asked for and cannot be used.
    pub(super) fn choose(kernel: PathKernel, tracer: &Tracer, features: PathFeatures) -> Result<Self> {
        let queued = [
            PathFeature::Signal,
            PathFeature::SurfacePoints,
            PathFeature::ClearWalls,
            PathFeature::Ambient,
            PathFeature::View,
        ];
        let schedule = match tracer.few_leaves() {
            _ if kernel == PathKernel::Wavefront => Self::Wavefront,
            _ if !tracer.can_trace_in_passes() => Self::CannotTrace,
            _ if queued.into_iter().any(|f| features.contains(f)) => Self::NeedsQueues,
            None => Self::Large,
            Some(few) => Self::Megakernel(few.count),
        };
        match schedule {
            Self::Megakernel(_) => Ok(schedule),
            _ if kernel == PathKernel::Megakernel => {
                Err(Error::Usage(format!("--path-kernel megakernel: {}; leave the option out", schedule.reason())))
            }
            _ => Ok(schedule),
        }
    }

    fn reason(self) -> String {
        match self {
            Self::Wavefront => "--path-kernel asks for it".into(),
            Self::CannotTrace => {
                "the megakernel needs a CPU driver of Mesa 23 or later, --tracer compute and --traversal auto".into()
            }
            Self::NeedsQueues => {
                "thin walls that light passes straight, ambient light, light maps and views of surfaces need queues of rays"
                    .into()
            }
            Self::Large => {
                format!("the megakernel is for static scenes without instances, of at most {MAX_LEAVES} leaves")
            }
            Self::Megakernel(leaves) => {
                format!("the device is a CPU, and the scene has {leaves} leaves, at most {MAX_LEAVES}")
            }
        }
    }
}

impl fmt::Display for Schedule {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let name = if matches!(self, Self::Megakernel(_)) { "one kernel for whole paths" } else { "a wavefront" };
        write!(f, "{name}: {}", self.reason())
    }
}

impl PathEstimator {
    /// Traces the paths of a launch by the megakernel, and adds them to the film.
    pub(super) fn trace_at_once(&mut self, commands: &mut Commands, push: Push) -> Result<Vec<Timing>> {
        let TracedBy::Megakernel(kernel) = &self.traced_by else {
            return Err(Error::Usage("paths of the wavefront have several steps".into()));
        };
        let traced = Push { pass: self.params[0].address(), ..push };
        let timings = commands.run(|r| {
            r.fill(&self.counts, COUNTED_BYTES, 0);
            r.barrier();
            kernel.record(r, &traced);
            r.barrier();
            self.record_resolve(r, push);
        })?;

        // what the kernel has counted
        let counts: Vec<u32> = bytemuck::pod_collect_to_vec(&self.counts.read(0, COUNTED_BYTES)?);
        self.traced.bounce_rays += u64::from(counts[0]);
        self.traced.shadow_rays += u64::from(counts[1]);
        self.traced.longest_path = self.traced.longest_path.max(counts[2]);
        Ok(timings)
    }
}
