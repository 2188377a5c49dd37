//! Histories of a pipeline of another size, so that a change of size does not begin with noise.

use super::Realtime;
use super::resources::Resource;
use super::seen::SeenSurfaces;
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::gpu::{Buffer, Commands};
use crate::interface::records::frame::FrameParams;
use crate::interface::records::passes::ResampleParams;
use crate::shaders::{self, LANES};
use crate::tracer::{Push, Tracer};

/// Resources of the previous frame that the next one reads.
const REMEMBERED: [Resource; 6] = [
    Resource::Guide,
    Resource::History,
    Resource::BentHistory,
    Resource::DiffuseHistory,
    Resource::SpecularHistory,
    Resource::ResolvedHistory,
];

/// Share of the surfaces in view from which own histories, of an image at rest, are better: coarser
/// ones are of motion, and so noisier.
const SEEN_ENOUGH: f64 = 0.75;

/// Largest side of images that are resampled, pixels: the shader multiplies two in 32 bits.
const MAX_SIDE: u32 = 1 << 15;

impl Realtime {
    /// Has the next frame continue those of `other`, a pipeline of the same scene, tracer and
    /// settings, and mostly of another size: each pixel has the histories of the nearest pixel
    /// there. Samples at rest start anew. Returns false, and changes nothing, where `other` has no
    /// histories or they are of another kind, and for sides of more than 2^15 pixels; with
    /// `keeps_own` also where this pipeline has histories of its own of most surfaces that the
    /// other's last frame shows.
    ///
    /// # Errors
    /// Those of the device.
    pub fn continue_from(&mut self, tracer: &Tracer, other: &Self, keeps_own: bool) -> Result<bool> {
        let Some(camera) = other.history.camera.filter(|_| other.history.has_history) else { return Ok(false) };
        let is_like = self.channels() == other.channels() && self.settings.technique == other.settings.technique;
        let is_wide = self.size.iter().chain(&other.size).any(|n| *n > MAX_SIDE);
        if !is_like || is_wide || !self.signal.has_pixel_histories() {
            return Ok(false);
        }
        if keeps_own && self.share_seen(tracer, other, &camera)? >= SEEN_ENOUGH {
            return Ok(false);
        }
        let (ours, theirs) = (self.graph.resources(), other.graph.resources());
        let both = |r: &&Resource| ours.buffer(**r).is_some() && theirs.buffer(**r).is_some();
        let images: Vec<Resource> = REMEMBERED.iter().filter(both).copied().collect();
        let record = |&resource: &Resource| ResampleParams {
            from: theirs.address(resource),
            to: ours.address(resource),
            from_size: other.size,
            to_size: self.size,
            words: resource.words(),
            reserved: 0,
        };
        let records: Vec<ResampleParams> = images.iter().map(record).collect();
        let device = tracer.device();
        let params = Buffer::from_slice(device, "parameters of resampling", &records)?;
        let pipeline = shaders::RESAMPLE.pipeline(device)?;
        let count = self.pixels() as u32;
        Commands::new(device)?.run(|r| {
            for k in 0..records.len() {
                let pass = params.address() + (k * size_of::<ResampleParams>()) as u64;
                r.dispatch(&pipeline, &Push { pass, count, ..Default::default() }, count.div_ceil(LANES));
            }
        })?;
        self.graph.invalidate();
        self.history = self.history.continued_from(&other.history, images.contains(&Resource::ResolvedHistory));
        Ok(true)
    }

    /// Share of the surfaces in the last frame of `other`, by this camera, of which this pipeline
    /// has histories; 0 if it has none.
    fn share_seen(&mut self, tracer: &Tracer, other: &Self, camera: &CameraRecord) -> Result<f64> {
        if !self.history.has_history || self.history.camera.is_none() {
            return Ok(0.0);
        }
        let (ours, theirs) = (self.graph.resources(), other.graph.resources());
        let frame = FrameParams {
            guide: theirs.address(Resource::Guide),
            surface: theirs.address(Resource::Surface),
            normals: theirs.address(Resource::Normals),
            previous_guide: ours.address(Resource::Guide),
            previous_position: 0,
            ..self.frame_params(camera, false, other.history.offset)
        };
        // of the next frame, which is not yet there
        self.params.write(&frame)?;
        SeenSurfaces::new(tracer)?.share(self.params.address(), other.pixels() as u32, 1)
    }
}
