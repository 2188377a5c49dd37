//! Queues of rays in device memory: one pass appends rays (`append_ray` of
//! shaders/common/queue.glsl), a later stream traces them. Their number is known on the device
//! only: a stream over a queue gets its address ([`Push::queued`]), and work-groups beyond it
//! return at once. The order of the rays differs from run to run, so a result is stored by the tag
//! of its ray.

use std::sync::Arc;

use super::Push;
use crate::error::Result;
use crate::gpu::{Buffer, Device, Memory, Recorder};
pub use crate::interface::records::queue::QueueRecord;
use crate::ray::Ray;

/// A queue and its memory: 36 bytes per ray.
pub struct RayQueue {
    rays: Buffer,
    tags: Buffer,
    count: Buffer,
    capacity: u32,
}

impl RayQueue {
    /// A queue for `capacity` rays. Its contents are undefined until it is cleared.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`].
    pub fn new(device: &Arc<Device>, capacity: u32) -> Result<Self> {
        Ok(Self {
            rays: Buffer::new(device, "queued rays", size_of::<Ray>() as u64 * capacity as u64, Memory::Device)?,
            tags: Buffer::new(device, "tags of queued rays", 4 * capacity as u64, Memory::Device)?,
            count: Buffer::new(device, "number of queued rays", 4, Memory::Device)?,
            capacity,
        })
    }

    /// The queue's addresses, for shaders.
    pub fn record(&self) -> QueueRecord {
        QueueRecord { rays: self.rays.address(), tags: self.tags.address(), count: self.count.address() }
    }

    /// Empties the queue. Commands before and after it need a barrier in between.
    pub fn clear(&self, recorder: &mut Recorder) {
        recorder.fill(&self.count, 4, 0);
    }

    /// The buffer of a `u32`: the number of rays in the queue.
    pub fn count(&self) -> &Buffer {
        &self.count
    }

    /// `push` for a stream that traces the queued rays, at most `max_rays`. The pass that fills the
    /// queue must not append more than that.
    pub fn push(&self, push: Push, max_rays: u32) -> Push {
        assert!(max_rays <= self.capacity);
        Push { rays: self.rays.address(), queued: self.count.address(), first: 0, count: max_rays, ..push }
    }
}
