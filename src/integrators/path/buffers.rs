//! Device memory of the paths of a launch, and the parameters that lead shaders to it.

use std::sync::Arc;

use super::params::{
    CONE_BYTES, INVALID, MEDIA_BYTES, PathParams, QUAD_BYTES, SHARE_BYTES, SKY_PDF_BYTES, STATE_BYTES, STRAIGHT_BYTES,
};
use crate::error::Result;
use crate::gpu::{Buffer, Device, Memory};
use crate::interface::records::path::SignalRecord;
use crate::interface::{PathFeature, PathFeatures};
use crate::tracer::queue::{QueueRecord, RayQueue};

/// Words of a vertex in the buffer of ray counts: numbers of rays, of shadow rays, of rays of
/// ambient light, and of shadow rays to distant lights alone.
pub(super) const COUNTS: u32 = 4;
/// Word of the number of rays of ambient light.
pub(super) const AMBIENT_COUNT: u32 = 2;
/// Word of the number of shadow rays to distant lights alone.
pub(super) const DISTANT_COUNT: u32 = 3;

/// Resources of rays of a path's first surface beside the shadow rays of all of them: occlusion
/// rays of ambient light, and shadow rays to distant lights where each group of lights is sampled.
/// They are traced as shadow rays are, from a queue of their own: two rays that add to a path at
/// the same time would depend on their order.
pub(super) struct FirstSurfaceRays {
    pub queue: RayQueue,
    /// Index of the parameters with which they are traced.
    pub params: usize,
    /// Word of a vertex in which their number is read back.
    pub count: u32,
}

/// Queues and buffers of the paths of a launch.
pub(super) struct PathBuffers {
    /// The queues of bounces: one is traced while the other is filled.
    pub queues: [RayQueue; 2],
    pub shadow_queue: RayQueue,
    ambient_queue: Option<RayQueue>,
    distant_queue: Option<RayQueue>,
    /// Radiance of each path.
    pub radiance: Buffer,
    /// Addresses of the states of paths, one for each queue of bounces.
    states: [u64; 2],
    /// All that shaders alone read and write.
    _memory: Vec<Buffer>,
}

/// Allocates buffers that have a record for each path.
struct PathMemory<'a> {
    device: &'a Arc<Device>,
    /// Maximum number of paths of a launch.
    most: u32,
    buffers: Vec<Buffer>,
}

impl PathMemory<'_> {
    /// Address of a new buffer of `bytes` for each path.
    fn add(&mut self, name: &str, bytes: u64) -> Result<u64> {
        let buffer = Buffer::new(self.device, name, bytes * u64::from(self.most), Memory::Device)?;
        let address = buffer.address();
        self.buffers.push(buffer);
        Ok(address)
    }

    /// As [`PathMemory::add`] if shaders need it, else 0.
    fn add_if(&mut self, is_needed: bool, name: &str, bytes: u64) -> Result<u64> {
        if is_needed { self.add(name, bytes) } else { Ok(0) }
    }

    fn queue_if(&self, is_needed: bool) -> Result<Option<RayQueue>> {
        is_needed.then(|| RayQueue::new(self.device, self.most)).transpose()
    }
}

impl PathBuffers {
    /// Allocates what shaders of these features need for launches of at most `most` paths. Also
    /// returns `params` with the addresses that all launches have in common. `stores_sky_pdfs`:
    /// paths keep the density of light samples of the environment.
    pub fn new(
        device: &Arc<Device>,
        most: u32,
        features: PathFeatures,
        stores_sky_pdfs: bool,
        params: PathParams,
    ) -> Result<(Self, PathParams)> {
        let [has_signal, has_media, has_clear_walls, splits, has_ambient] = [
            PathFeature::Signal,
            PathFeature::Media,
            PathFeature::ClearWalls,
            PathFeature::LightSplit,
            PathFeature::Ambient,
        ]
        .map(|feature| features.contains(feature));
        let mut memory = PathMemory { device, most, buffers: Vec::new() };

        // queues, and what their rays may add to paths
        let queues = [RayQueue::new(device, most)?, RayQueue::new(device, most)?];
        let shadow_queue = RayQueue::new(device, most)?;
        let ambient_queue = memory.queue_if(has_ambient)?;
        let distant_queue = memory.queue_if(splits)?;
        let radiance = Buffer::new(device, "radiance of paths", QUAD_BYTES * u64::from(most), Memory::Device)?;
        let contributions = memory.add("shadow ray contributions", QUAD_BYTES)?;
        let distant_contributions = memory.add_if(splits, "contributions of distant lights", QUAD_BYTES)?;
        let ambient_contributions = memory.add_if(has_ambient, "contributions of ambient light", QUAD_BYTES)?;

        // the diffuse part of contributions, and of paths
        let mut add_diffuse =
            |is_needed| memory.add_if(has_signal && is_needed, "diffuse part of contributions", QUAD_BYTES);
        let diffuse_contributions = add_diffuse(true)?;
        let later_diffuse_contributions = add_diffuse(has_clear_walls)?;
        let ambient_diffuse_contributions = add_diffuse(has_ambient)?;
        let distant_diffuse_contributions = add_diffuse(splits)?;
        let signals = memory.add_if(has_signal, "signals of paths", size_of::<SignalRecord>() as u64)?;

        // what paths carry from bounce to bounce
        let states = [memory.add("paths", STATE_BYTES)?, memory.add("paths", STATE_BYTES)?];
        let cones = memory.add_if(features.contains(PathFeature::RayCones), "ray cones", CONE_BYTES)?;
        let media = memory.add_if(has_media, "media stacks", MEDIA_BYTES)?;
        let straight = memory.add_if(has_clear_walls, "straight path lengths", STRAIGHT_BYTES)?;
        let sky_pdfs = memory.add_if(stores_sky_pdfs, "environment densities", SKY_PDF_BYTES)?;
        let has_groups = features.contains(PathFeature::LightGroups);
        let placed_shares = memory.add_if(has_groups, "shares of placed lights", SHARE_BYTES)?;

        let params = PathParams {
            radiance: radiance.address(),
            contributions,
            shadow: shadow_queue.record(),
            cones,
            media,
            straight,
            sky_pdfs,
            placed_shares,
            distant_shadow: distant_queue.as_ref().map(RayQueue::record).unwrap_or_default(),
            distant_contributions,
            distant_diffuse_contributions,
            camera_media: [INVALID; 4],
            ambient: ambient_queue.as_ref().map(RayQueue::record).unwrap_or_default(),
            ambient_contributions,
            signals,
            diffuse_contributions,
            later_diffuse_contributions,
            ambient_diffuse_contributions,
            ..params
        };
        let _memory = memory.buffers;
        Ok((Self { queues, shadow_queue, ambient_queue, distant_queue, radiance, states, _memory }, params))
    }

    /// Parameters of launches, from what all have in common: those that fill either queue of
    /// bounces; those that trace either queue of shadow rays behind walls; and those of rays of
    /// first surfaces, whose queues are taken. `walls`: the queue of shadow rays behind one more
    /// wall, and the address of their contributions.
    pub fn launch_params(
        &mut self,
        walls: Option<(QueueRecord, u64)>,
        base: PathParams,
    ) -> (Vec<PathParams>, Vec<FirstSurfaceRays>) {
        // parameters k fill queue k, and read the state of the other
        let [first, second] = [0, 1].map(|k: usize| {
            let (next, tags) = (self.queues[k].record(), self.queues[k ^ 1].record().tags);
            PathParams { next, tags, states: self.states[k ^ 1], next_states: self.states[k], ..base }
        });
        let mut records = vec![first, second];

        // shadow rays move from one queue to the other at each wall
        if let Some((later, later_contributions)) = walls {
            records.push(PathParams { later, later_contributions, ..base });
            records.push(PathParams {
                shadow: later,
                contributions: later_contributions,
                diffuse_contributions: base.later_diffuse_contributions,
                later: base.shadow,
                later_contributions: base.contributions,
                later_diffuse_contributions: base.diffuse_contributions,
                ..base
            });
        }

        // rays of first surfaces are shadow rays of another queue
        let mut of_first_surface = Vec::new();
        if let Some(queue) = self.ambient_queue.take() {
            of_first_surface.push(FirstSurfaceRays { queue, params: records.len(), count: AMBIENT_COUNT });
            records.push(PathParams {
                shadow: base.ambient,
                contributions: base.ambient_contributions,
                diffuse_contributions: base.ambient_diffuse_contributions,
                ..base
            });
        }
        if let Some(queue) = self.distant_queue.take() {
            of_first_surface.push(FirstSurfaceRays { queue, params: records.len(), count: DISTANT_COUNT });
            records.push(PathParams {
                shadow: base.distant_shadow,
                contributions: base.distant_contributions,
                diffuse_contributions: base.distant_diffuse_contributions,
                ..base
            });
        }
        (records, of_first_surface)
    }
}
