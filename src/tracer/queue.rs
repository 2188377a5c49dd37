//! Queues of rays in device memory: what one pass appends (`append_ray` of shaders/common/queue.glsl), a later stream traces.
//! How many there are, only the device knows; a stream over a queue gets that number's address ([`Push::queued`]) and its
//! work-groups beyond it return at once. The order of the rays differs from run to run, so results go to where their tags say.

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
    /// For `capacity` rays at most. It holds nothing in particular until it is cleared.
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

    /// Where shaders find it.
    pub fn record(&self) -> QueueRecord {
        QueueRecord { rays: self.rays.address(), tags: self.tags.address(), count: self.count.address() }
    }

    /// Empties it; what is recorded before must not use it any more, nor what comes after without a barrier.
    pub fn clear(&self, recorder: &mut Recorder) {
        recorder.fill(&self.count, 4, 0);
    }

    /// A `u32`: how many rays it holds.
    pub fn count(&self) -> &Buffer {
        &self.count
    }

    /// `push` for a stream that traces what is queued, `most` rays at most. Whoever fills the queue appends no more than
    /// `most`, so that there is room.
    pub fn push(&self, push: Push, most: u32) -> Push {
        assert!(most <= self.capacity);
        Push { rays: self.rays.address(), queued: self.count.address(), first: 0, count: most, ..push }
    }
}
