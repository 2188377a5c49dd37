//! The rays of samples of ambient occlusion: camera rays, and occlusion rays from their hits.

use super::{NO_HIT, Occlusion};
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::gpu::{Buffer, Memory, Recorder, Specialization};
use crate::interface::constants;
use crate::interface::records::ao::{AoParams, OcclusionRecord};
use crate::shaders::{self, StreamShaders};
use crate::tracer::entry_points::EntryPoints;
use crate::tracer::queue::RayQueue;
use crate::tracer::{Push, Stream, Tracer};

/// Streams and memory of launches of samples.
pub struct AoRays {
    primary: Stream,
    occlusion: Stream,
    entry_points: Option<EntryPoints>,
    queue: RayQueue,
    samples: Buffer,
    camera_shift: u32,
    catcher: Option<u32>,
}

/// The streams that samples need: without a falloff any hit ends an occlusion ray.
pub fn streams(occlusion: Occlusion) -> [&'static StreamShaders; 2] {
    let traced = if occlusion.is_binary() { &shaders::OCCLUSION_ANY } else { &shaders::OCCLUSION_CLOSEST };
    [&shaders::PRIMARY_CLOSEST, traced]
}

impl AoRays {
    /// For launches of at most `most` samples, and at most 2^`sample_bits` of a pixel, of which
    /// 2^`camera_shift` consecutive ones share a camera ray. `catcher`: [`super::AoOptions`].
    ///
    /// # Errors
    /// Those of the device.
    pub fn new(
        tracer: &Tracer,
        occlusion: Occlusion,
        most: u32,
        sample_bits: u32,
        camera_shift: u32,
        catcher: Option<u32>,
    ) -> Result<Self> {
        let device = tracer.device();
        let [primary, occlusion] = streams(occlusion);
        let mut constants = Specialization::default();
        if catcher.is_some() {
            constants = constants.set(constants::HAS_CATCHER, true);
        }
        let primary = tracer.specialized(primary, &constants)?;
        Ok(Self {
            entry_points: EntryPoints::new(tracer, &primary, most, sample_bits.saturating_sub(camera_shift))?,
            primary,
            occlusion: tracer.specialized(occlusion, &constants)?,
            queue: RayQueue::new(device, most)?,
            samples: Buffer::new(device, "samples", size_of::<f32>() as u64 * u64::from(most), Memory::Device)?,
            camera_shift,
            catcher,
        })
    }

    /// Device address of a float per sample: ambient visibility, or negative for a miss.
    pub fn samples(&self) -> u64 {
        self.samples.address()
    }

    /// Returns true if rays of the camera start below the root of the hierarchy, in launches of
    /// enough samples.
    pub fn has_entry_points(&self, camera: &CameraRecord) -> bool {
        self.entry_points.is_some() && !camera.orthographic
    }

    /// The parameters of the streams.
    pub fn params(&self, occlusion: OcclusionRecord, camera: &CameraRecord) -> AoParams {
        AoParams {
            occlusion,
            samples: self.samples.address(),
            queue: self.queue.record(),
            camera_shift: self.camera_shift,
            catcher: self.catcher.unwrap_or_default(),
            entry_points: match &self.entry_points {
                Some(lists) if self.has_entry_points(camera) => lists.address(),
                _ => 0,
            },
            ..Default::default()
        }
    }

    /// The camera rays of a launch of samples. A launch that begins or ends between samples that
    /// share a camera ray traces that ray again: the samples are the same, however they are
    /// launched.
    pub fn camera_push(&self, push: &Push) -> Push {
        let shared_bits = self.camera_shift.min(push.sample_bits).min(push.sample_index.trailing_zeros());
        Push {
            first: push.first >> shared_bits,
            count: push.count >> shared_bits,
            sample_bits: push.sample_bits - shared_bits,
            shared_bits,
            ..*push
        }
    }

    /// Records the rays of a launch. Commands before and after it need a barrier in between.
    pub fn record(&self, r: &mut Recorder, push: &Push, has_entry_points: bool) {
        let camera = self.camera_push(push);
        self.queue.clear(r);
        if let Some(entry_points) = self.entry_points.as_ref().filter(|_| has_entry_points) {
            entry_points.record(r, &camera);
        }
        r.fill(&self.samples, size_of::<f32>() as u64 * u64::from(push.count), NO_HIT.to_bits());
        r.barrier();
        self.primary.record(r, &camera);
        r.barrier();
        self.occlusion.record(r, &self.queue.push(*push, push.count));
    }
}
