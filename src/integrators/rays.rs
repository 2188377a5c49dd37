//! Traces a given set of rays, for comparison with other ray tracers.

use crate::settings::choices;
use crate::shaders;

use crate::error::{Error, Result};
use crate::film::Control;
use crate::film::pace::{MAX_RAYS, Pace};
use crate::gpu::{Buffer, Commands, Memory};
use crate::interface::records::ray_set::RaySet;
use crate::ray::{Hit, Ray};
use crate::tracer::{Push, Stream, Tracer};

choices! {
    /// What to find of a ray.
    pub enum Mode {
        /// Any hit
        Any = "any",
        /// Closest hit
        Closest = "closest",
    }
}

/// Times of tracing a set of rays.
#[derive(Clone, Debug, Default)]
pub struct RayTimes {
    /// Device seconds of each repetition.
    pub device: Vec<f64>,
    /// Wall clock seconds of each repetition, submission included.
    pub wall: Vec<f64>,
}

/// Checks that rays are valid for the tracers.
///
/// # Errors
/// [`Error::Scene`], naming the first bad ray.
pub fn check(rays: &[Ray]) -> Result<()> {
    let bad = |r: &Ray| {
        !r.origin.iter().chain(&r.direction).all(|x| x.is_finite())
            || r.direction == [0.0; 3]
            || !(r.tmin >= 0.0 && r.tmin.is_finite())
            || r.tmax.is_nan()
    };
    match rays.iter().position(bad) {
        None => Ok(()),
        Some(k) => Err(Error::Scene(format!(
            "ray {k} is invalid ({:?}): origin and direction must be finite, the direction not zero, tmin >= 0",
            rays[k]
        ))),
    }
}

/// Traces the set `repeats` times (at least once) after a warm-up, and returns the hits. In mode
/// [`Mode::Any`] those of occluded rays have t = 0 and no ids.
pub fn trace(
    tracer: &Tracer,
    rays: &[Ray],
    mode: Mode,
    repeats: u32,
    control: &mut dyn Control,
) -> Result<(Vec<Hit>, RayTimes)> {
    let mut set = PreparedRays::new(tracer, rays, mode)?;
    let mut times = RayTimes::default();
    for repeat in 0..=repeats.max(1) {
        let (device, wall) = set.pass(control)?;
        control.progress(repeat as u64 + 1, repeats.max(1) as u64 + 1);
        if repeat > 0 {
            times.device.push(device);
            times.wall.push(wall);
        }
    }
    Ok((set.hits()?, times))
}

/// A set of rays in device memory, with the buffers and pipelines to trace it repeatedly.
pub struct PreparedRays<'t> {
    tracer: &'t Tracer,
    stream: Stream,
    mode: Mode,
    count: u32,
    results: Buffer,
    set: Buffer,
    // `set` holds its address
    _source: Buffer,
    commands: Commands,
    pace: Pace,
    passes: u32,
}

impl<'t> PreparedRays<'t> {
    /// Uploads the rays and compiles their stream.
    ///
    /// # Errors
    /// [`Error::Usage`] for 2^28 rays or more; those of the device.
    pub fn new(tracer: &'t Tracer, rays: &[Ray], mode: Mode) -> Result<Self> {
        let device = tracer.device();
        let stream = tracer.stream(match mode {
            Mode::Any => &shaders::RAYS_ANY,
            Mode::Closest => &shaders::RAYS_CLOSEST,
        })?;
        let count = u32::try_from(rays.len())
            .ok()
            .filter(|&n| n < 1 << 28)
            .ok_or_else(|| Error::Usage(format!("{} rays: the maximum is 2^28", rays.len())))?;
        let source = Buffer::from_slice(device, "rays", rays)?;
        let results = Buffer::new(device, "hits", Self::record(mode) * count as u64, Memory::Device)?;
        let set =
            Buffer::from_slice(device, "ray set", &[RaySet { rays: source.address(), results: results.address() }])?;
        let commands = Commands::new(device)?;
        Ok(Self {
            tracer,
            stream,
            mode,
            count,
            results,
            set,
            _source: source,
            commands,
            pace: Pace::default(),
            passes: 0,
        })
    }

    /// Bytes of a result.
    fn record(mode: Mode) -> u64 {
        if mode == Mode::Any { 4 } else { size_of::<Hit>() as u64 }
    }

    /// Traces the whole set once; returns device seconds (wall clock seconds if the device has no
    /// timestamps) and wall clock seconds, submission included. The first call finds the size of
    /// launches and makes the driver compile: its times are not representative.
    pub fn pass(&mut self, control: &mut dyn Control) -> Result<(f64, f64)> {
        let (n, learning) = (self.count, self.passes == 0);
        let (mut first, mut device_seconds, mut wall_seconds) = (0, 0.0, 0.0);
        while first < n {
            let rays = self.pace.rays().min(MAX_RAYS);
            let launches = if learning { 1 } else { self.pace.launches() };
            let begin = first;
            let start = std::time::Instant::now();
            let mut recorded = 0;
            let (stream, tracer, set) = (&self.stream, self.tracer, &self.set);
            let timings = self.commands.run(|r| {
                while recorded < launches && first < n {
                    let count = rays.min(n - first);
                    let push =
                        Push { scene: tracer.scene_address(), pass: set.address(), first, count, ..Default::default() };
                    // launches do not depend on each other
                    stream.record(r, &push);
                    first += count;
                    recorded += 1;
                }
            })?;
            let wall = start.elapsed().as_secs_f64();
            wall_seconds += wall;
            device_seconds += if timings.is_empty() { wall } else { timings.iter().map(|t| t.seconds).sum() };
            if learning && first - begin == rays {
                self.pace.learn(rays, &timings, wall, recorded);
            }
            control.should_stop()?;
        }
        self.passes += 1;
        Ok((device_seconds, wall_seconds))
    }

    /// Results of the last pass.
    pub fn hits(&self) -> Result<Vec<Hit>> {
        self.tracer.check_finished()?;
        let record = Self::record(self.mode);
        let mut hits = Vec::with_capacity(self.count as usize);
        self.results.read_with(0, record * self.count as u64, record, |_, bytes| match self.mode {
            Mode::Closest => hits.extend(bytemuck::pod_collect_to_vec::<u8, Hit>(bytes)),
            Mode::Any => hits.extend(
                bytemuck::pod_collect_to_vec::<u8, u32>(bytes)
                    .into_iter()
                    .map(|o| if o != 0 { Hit { t: 0.0, ..Hit::MISS } } else { Hit::MISS }),
            ),
        })?;
        Ok(hits)
    }
}
