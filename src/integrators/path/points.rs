//! Light that arrives at given points of surfaces, for light maps: that which a white diffuse
//! surface would reflect there, which is irradiance divided by pi.
//!
//! A path begins with a ray straight onto its point, whose hit is known. Its first vertex is white
//! and emits nothing; all else is as in images.

use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::accumulate::{MAX_SAMPLE_BITS, accumulate, max_rays};
use crate::film::camera::CameraRecord;
use crate::film::{Control, Film, SampleSettings};
use crate::gpu::Buffer;
use crate::interface::records::bake::BakePoint;
use crate::interface::records::ray::INVALID;
use crate::tracer::Tracer;
use crate::tracer::stream::launch_rays;

use super::{PathCounts, PathEstimator, PathOptions};

/// Points in a row of the image that they are arranged in.
const WIDTH: u32 = 1024;
/// Rows of the image are a multiple of those of a tile.
const ROWS: u32 = 8;

/// Estimates the light at points.
pub struct PointLight<'t> {
    tracer: &'t Tracer,
    paths: PathEstimator,
}

/// The light at points.
#[derive(Clone, Debug, Default)]
pub struct LightOfPoints {
    /// A pixel for each point, in order, and some that are not covered.
    pub film: Film,
    /// Rays.
    pub rays: u64,
}

impl<'t> PointLight<'t> {
    /// Creates it for at most `points` points at a time, of up to `spp` samples each. The tracer
    /// must have been built from `flat` with [`crate::tracer::Needs::shading`]. `options` are those
    /// of an integrator without a view.
    ///
    /// # Errors
    /// Those of [`super::PathIntegrator::new`].
    pub fn new(tracer: &'t Tracer, flat: &FlatScene, options: &PathOptions, points: usize, spp: u32) -> Result<Self> {
        let options = PathOptions { begins_at_points: true, ..options.clone() };
        let size = image_size(points);
        let capacity = max_rays(launch_rays(&tracer.device().info), size, spp, MAX_SAMPLE_BITS);
        Ok(Self { tracer, paths: PathEstimator::new(tracer, flat, &options, capacity, false)? })
    }

    /// Takes `spp` samples of each point; its sequence goes on at [`BakePoint::first_sample`].
    ///
    /// # Errors
    /// Those of the device; [`Error::Interrupted`] when `control` says so.
    pub fn estimate(
        &mut self,
        points: &[BakePoint],
        spp: u32,
        seed: u32,
        control: &mut dyn Control,
    ) -> Result<LightOfPoints> {
        // an image of them; what is left of it has none
        let size = image_size(points.len());
        let mut padded = points.to_vec();
        let none = BakePoint { instance: INVALID, ..bytemuck::Zeroable::zeroed() };
        padded.resize(size[0] as usize * size[1] as usize, none);
        let device = self.tracer.device();
        let records = Buffer::from_slice(device, "points of paths", &padded)?;
        self.paths.change_records(|record| record.of_frame.points = records.address())?;

        // nothing is seen by a camera
        let camera =
            CameraRecord { camera_to_world: [[0.0; 4]; 3], view: [1.0; 2], orthographic: true, clip: [0.0, 0.0] };
        let samples = SampleSettings::new(size, spp, seed);
        self.paths.traced = PathCounts::default();
        let image = accumulate(self.tracer, &camera, &samples, &mut self.paths, control)?;
        if image.stopped_early {
            return Err(Error::Interrupted);
        }
        let PathCounts { bounce_rays, shadow_rays, ambient_rays, .. } = self.paths.traced;
        Ok(LightOfPoints { film: image.film, rays: bounce_rays + shadow_rays + ambient_rays })
    }
}

/// Width and height of the image that has so many points.
fn image_size(points: usize) -> [u32; 2] {
    let rows = (points as u32).div_ceil(WIDTH).max(1);
    [WIDTH, rows.next_multiple_of(ROWS)]
}
