//! Ambient light, as real-time renderers have it: the same radiance from everywhere, kept from
//! surfaces by ambient occlusion.
//!
//! Radiance towards the camera is then L = direct light + ambient * V * albedo, V the ambient
//! visibility of a radius and falloff. [`trace`] traces the occlusion rays of an image once and
//! returns the distances of their hits, by which V is known for every radius and falloff.

use glam::Vec3;

pub use super::ambient_light::{Ambient, EnvironmentLight, OccludedLight};
use super::buffers::{AMBIENT_COUNT, FirstSurfaceRays};
use super::{PathEstimator, PathOptions, Strategy};
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::film::accumulate::{Estimator, MAX_SAMPLE_BITS, accumulate, max_rays};
use crate::film::block::{Block, BlockParams};
use crate::film::camera::CameraRecord;
use crate::film::{Control, SampleSettings};
use crate::gpu::{Commands, Timing};
use crate::integrators::ao::Occlusion;
use crate::shaders;
use crate::tracer::stream::launch_rays;
use crate::tracer::{Push, Stream, Tracer};

/// A sample of a pixel, as far as ambient light is concerned.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct AmbientSample {
    /// Share of ambient light that the surface reflects towards the camera, linear RGB; 0 for
    /// misses, and for surfaces that reflect no ambient light.
    pub reflectance: [f32; 3],
    /// Distance of the occlusion ray's hit, scene units; infinite for a miss. Without an occlusion
    /// ray: 1 if the camera ray hit a surface, else 0.
    pub distance: f32,
}

/// Receives the index of a pixel (rows from the top), and samples that were taken together.
pub type TakeSamples<'a> = dyn FnMut(usize, &[AmbientSample]) + 'a;

/// Traces the occlusion rays of an image, to their nearest hits without a limit, and hands their
/// distances to `take`: `options.samples.spp` samples of each pixel in all. Camera, seed and
/// hemisphere are those of `options`; the samples are those of an image of the integrator `lit`
/// with the same seed. The tracer must have been built from `flat` with
/// [`crate::tracer::Needs::shading`].
///
/// # Errors
/// Those of the device, and [`crate::Error::Interrupted`] when `control` says so.
pub fn trace(
    tracer: &Tracer,
    flat: &FlatScene,
    camera: &CameraRecord,
    options: &PathOptions,
    control: &mut dyn Control,
    take: &mut TakeSamples,
) -> Result<()> {
    let hemisphere = options.ambient.map(|a| a.occlusion.hemisphere).unwrap_or_default();
    let unlimited = Occlusion { hemisphere, ..Default::default() };
    let ambient = Ambient { color: Vec3::ONE, occlusion: unlimited, occluded: OccludedLight::Ambient };
    // every sample of every tile, in one go
    let SampleSettings { size, spp, seed, pixel_filter, .. } = options.samples;
    let samples = SampleSettings { size, spp, seed, pixel_filter, ..Default::default() };
    // the first surface alone, and no light but the ambient one
    let options = PathOptions {
        samples,
        max_depth: 0,
        min_depth: 1,
        strategy: Strategy::Bsdf,
        ambient: Some(ambient),
        background_only: true,
        ..options.clone()
    };
    let capacity = max_rays(launch_rays(&tracer.device().info), size, spp, MAX_SAMPLE_BITS);
    let mut paths = PathEstimator::new(tracer, flat, &options, capacity, false)?;
    paths.find_camera_media(camera)?;
    let distance = tracer.stream(&shaders::PATH_DISTANCE_CLOSEST)?;
    let mut estimator = DistanceEstimator { paths, distance, block: None, width: size[0], take };
    accumulate(tracer, camera, &options.samples, &mut estimator, control).map(drop)
}

struct DistanceEstimator<'a, 't> {
    paths: PathEstimator,
    distance: Stream,
    block: Option<Block>,
    /// Width of the image in pixels.
    width: u32,
    take: &'a mut TakeSamples<'t>,
}

impl Estimator for DistanceEstimator<'_, '_> {
    const CHANNELS: usize = 3;

    fn begin(&mut self, block: &BlockParams, film: u64, keep: bool) -> Result<u64> {
        self.block = Some(Block { origin: block.block_origin, size: block.block_size });
        self.paths.begin(block, film, keep)
    }

    fn launch(&mut self, commands: &mut Commands, launches: &[Push], _: bool) -> Result<Vec<Timing>> {
        let (block, width, take) = (self.block, self.width, &mut self.take);
        let mut timings = Vec::new();
        for push in launches {
            timings.extend(self.paths.launch_distances(commands, *push, &self.distance)?);
            let samples = 1usize << push.sample_bits;
            self.paths.read_samples(push.count, |first, all: &[AmbientSample]| {
                for (k, of_pixel) in all.chunks_exact(samples).enumerate() {
                    let index = (push.first >> push.sample_bits) + first / samples as u32 + k as u32;
                    if let Some(at) = block.and_then(|b| b.image_index(index, width)) {
                        take(at, of_pixel);
                    }
                }
            })?;
        }
        Ok(timings)
    }
}

impl PathEstimator {
    /// Traces camera rays, then the distances of the rays of ambient light that they leave.
    fn launch_distances(&self, commands: &mut Commands, push: Push, distance: &Stream) -> Result<Vec<Timing>> {
        let of_ambient = |rays: &&FirstSurfaceRays| rays.count == AMBIENT_COUNT;
        let Some(ambient) = self.of_first_surface.iter().find(of_ambient) else { return Ok(Vec::new()) };
        let wavefront = self.traced_by.wavefront()?;
        let [camera, occlusion] = [0, ambient.params].map(|k| Push { pass: self.params[k].address(), ..push });
        commands.run(|r| {
            self.buffers.queues[0].clear(r);
            self.clear_light_queues(r);
            r.barrier();
            wavefront.camera.record(r, &camera);
            r.barrier();
            distance.record(r, &ambient.queue.push(occlusion, push.count));
            r.barrier();
        })
    }

    /// Reads the samples of the last launch; `take` also receives the index of its first sample.
    fn read_samples(&self, count: u32, mut take: impl FnMut(u32, &[AmbientSample])) -> Result<()> {
        let size = size_of::<AmbientSample>() as u64;
        // all samples of a pixel at once
        let record = size << MAX_SAMPLE_BITS;
        self.buffers.radiance.read_with(0, size * u64::from(count), record, |first, bytes| {
            let samples: Vec<AmbientSample> = bytemuck::pod_collect_to_vec(bytes);
            take((first << MAX_SAMPLE_BITS) as u32, &samples);
        })
    }
}
