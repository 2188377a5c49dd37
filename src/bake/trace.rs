//! The rays of texels: samples of the hemispheres over surface points, summed for each point.

use glam::Vec3;

use crate::error::Result;
use crate::film::Control;
use crate::film::pace::{MAX_RAYS, Pace};
use crate::gpu::{Buffer, Commands, ComputePipeline, Memory};
use crate::integrators::ao::Occlusion;
use crate::interface::records::bake::BakeParams;
pub use crate::interface::records::bake::BakePoint;
use crate::shaders;
use crate::tracer::{Push, Stream, Tracer};

/// Points whose samples are counted in 32 bits, however many each has.
const MAX_POINTS: usize = 1 << 20;

/// The quantity that samples of a point measure.
#[derive(Clone, Copy, Debug)]
pub struct Sampling {
    /// Which hits occlude, and how much; for thickness its radius, which must be finite, is the
    /// length of rays.
    pub occlusion: Occlusion,
    /// Rays leave into the surface, not from it.
    pub is_inward: bool,
    /// The value of a ray is the share of the radius that it gets, not whether it is open.
    pub has_lengths: bool,
    /// Directions of samples are summed, too.
    pub has_directions: bool,
    /// Seed of the sampler.
    pub seed: u32,
    /// Base 2 logarithm of the samples of each point, at most 10.
    pub sample_bits: u32,
}

/// The sums over the samples of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointSums {
    /// Sum of the samples' directions, each times its value, in world space.
    pub direction: Vec3,
    /// Sum of the values: ambient visibility, or the share of a ray's length.
    pub value: f32,
    /// Sum of the squared values.
    pub squares: f32,
}

/// Traces the samples of points of a tracer's scene.
pub struct PointTracer<'t> {
    tracer: &'t Tracer,
    sampling: Sampling,
    stream: Stream,
    sum: ComputePipeline,
    samples: Buffer,
    commands: Commands,
    pace: Pace,
}

impl<'t> PointTracer<'t> {
    /// Compiles the passes. The tracer's scene must have shading normals if the hemisphere is about
    /// them.
    ///
    /// # Errors
    /// Those of the device.
    pub fn new(tracer: &'t Tracer, sampling: Sampling) -> Result<Self> {
        let device = tracer.device();
        let takes_any = sampling.occlusion.is_binary() && !sampling.has_lengths;
        let record = if sampling.has_directions { 16 } else { 4 };
        Ok(Self {
            tracer,
            sampling,
            stream: tracer.stream(if takes_any { &shaders::BAKE_ANY } else { &shaders::BAKE_CLOSEST })?,
            sum: shaders::BAKE_SUM.pipeline(device)?,
            samples: Buffer::new(device, "samples of texels", record * u64::from(MAX_RAYS), Memory::Device)?,
            commands: Commands::new(device)?,
            pace: Pace::default(),
        })
    }

    /// The sums of each point; `control` is asked between launches whether to stop.
    ///
    /// # Errors
    /// Those of the device, and of `control`.
    pub fn trace(&mut self, points: &[BakePoint], control: &mut dyn Control) -> Result<Vec<PointSums>> {
        let mut sums = Vec::with_capacity(points.len());
        for part in points.chunks(MAX_POINTS) {
            sums.extend(self.trace_part(part, control)?);
        }
        Ok(sums)
    }

    /// As [`PointTracer::trace`], for at most [`MAX_POINTS`] and at least one.
    fn trace_part(&mut self, points: &[BakePoint], control: &mut dyn Control) -> Result<Vec<PointSums>> {
        // what shaders read and write
        let device = self.tracer.device();
        let Sampling { occlusion, is_inward, has_lengths, has_directions, seed, sample_bits } = self.sampling;
        let source = Buffer::from_slice(device, "points of texels", points)?;
        let bytes = 32 * points.len() as u64;
        let sums = Buffer::new(device, "sums of texels", bytes, Memory::Device)?;
        let params = BakeParams {
            points: source.address(),
            samples: self.samples.address(),
            sums: sums.address(),
            occlusion: occlusion.record(),
            seed,
            is_inward: is_inward.into(),
            has_lengths: has_lengths.into(),
            has_directions: has_directions.into(),
            reserved: 0,
        };
        let params = Buffer::from_slice(device, "parameters of texels", &[params])?;

        // launch after launch
        let (scene, pass) = (self.tracer.scene_address(), params.address());
        let (commands, stream, sum) = (&mut self.commands, &self.stream, &self.sum);
        commands.run(|r| r.fill(&sums, bytes, 0))?;
        self.pace.run_launches((points.len() as u32) << sample_bits, control, |first, count| {
            let push = Push { scene, pass, first, count, sample_bits, ..Default::default() };
            commands.run(|r| {
                stream.record(r, &push);
                r.barrier();
                r.timed("bake_sum", |r| r.dispatch(sum, &push, (count >> sample_bits).div_ceil(shaders::LANES)));
                // the next launch reuses the samples
                r.barrier();
            })
        })?;
        self.tracer.check_finished()?;

        // two vectors a point
        let mut out = Vec::with_capacity(points.len());
        sums.read_with(0, bytes, 32, |_, bytes| {
            out.extend(bytemuck::pod_collect_to_vec::<u8, [f32; 8]>(bytes).into_iter().map(|s| PointSums {
                direction: Vec3::new(s[0], s[1], s[2]),
                value: s[3],
                squares: s[7],
            }));
        })?;
        Ok(out)
    }
}
