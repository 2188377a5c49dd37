//! Traces a set of rays: what joins skylit's tracers to any other.

use bytemuck::{Pod, Zeroable};

use super::Control;
use super::pace::{MOST, Pace};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Commands, Memory};
use crate::ray::{Hit, Ray};
use crate::tracer::{Push, Tracer, stream};

/// What to find.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// Whether something is in the way.
    Any,
    /// The nearest hit.
    Closest,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct RaySet {
    rays: u64,
    results: u64,
}

/// How fast a set was traced.
#[derive(Clone, Debug, Default)]
pub struct RayTimes {
    /// Device seconds of each repeat.
    pub device: Vec<f64>,
    /// Wall seconds of each repeat, submission included.
    pub wall: Vec<f64>,
}

/// Checks what the tracers assume of a ray.
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
            "ray {k} is broken ({:?}): origin and direction must be finite, the direction not zero, tmin >= 0",
            rays[k]
        ))),
    }
}

/// Traces the set `repeats` times (at least once) after a first pass that finds the size of launches, and returns the hits.
/// In mode [`Mode::Any`] an occluded ray's hit has t = 0 and no ids.
pub fn trace(
    tracer: &Tracer,
    rays: &[Ray],
    mode: Mode,
    repeats: u32,
    control: &mut dyn Control,
) -> Result<(Vec<Hit>, RayTimes)> {
    let device = tracer.device();
    let stream = tracer.stream(match mode {
        Mode::Any => &stream::RAYS_ANY,
        Mode::Closest => &stream::RAYS_CLOSEST,
    })?;
    let n = u32::try_from(rays.len())
        .ok()
        .filter(|&n| n < 1 << 28)
        .ok_or_else(|| Error::Usage(format!("{} rays: at most 2^28 at a time", rays.len())))?;
    let record = if mode == Mode::Any { 4 } else { size_of::<Hit>() as u64 };
    let source = Buffer::from_slice(device, "rays", rays)?;
    let results = Buffer::new(device, "hits", record * n as u64, Memory::Readback)?;
    let set = Buffer::from_slice(device, "ray set", &[RaySet { rays: source.address(), results: results.address() }])?;
    let mut commands = Commands::new(device)?;
    let mut pace = Pace::default();
    let mut times = RayTimes::default();
    for repeat in 0..=repeats.max(1) {
        let (mut first, mut device_seconds, mut wall_seconds) = (0, 0.0, 0.0);
        while first < n {
            let rays = pace.rays().min(MOST);
            let launches = if repeat == 0 { 1 } else { pace.launches() };
            let begin = first;
            let start = std::time::Instant::now();
            let mut recorded = 0;
            let timings = commands.run(|r| {
                while recorded < launches && first < n {
                    let count = rays.min(n - first);
                    let push = Push { scene: tracer.scene_address(), pass: set.address(), first, count, ..Default::default() };
                    // launches do not depend on each other
                    stream.record(r, &push);
                    first += count;
                    recorded += 1;
                }
            })?;
            let wall = start.elapsed().as_secs_f64();
            wall_seconds += wall;
            device_seconds += if timings.is_empty() { wall } else { timings.iter().map(|t| t.seconds).sum() };
            if repeat == 0 && first - begin == rays {
                pace.learn(rays, &timings, wall, recorded);
            }
            control.should_stop()?;
        }
        control.progress(repeat as u64 + 1, repeats.max(1) as u64 + 1);
        if repeat > 0 {
            times.device.push(device_seconds);
            times.wall.push(wall_seconds);
        }
    }
    tracer.check_finished()?;
    let mut hits = Vec::with_capacity(rays.len());
    results.read_with(0, record * n as u64, record, |_, bytes| match mode {
        Mode::Closest => hits.extend(bytemuck::pod_collect_to_vec::<u8, Hit>(bytes)),
        Mode::Any => hits.extend(
            bytemuck::pod_collect_to_vec::<u8, u32>(bytes)
                .into_iter()
                .map(|o| if o != 0 { Hit { t: 0.0, ..Hit::MISS } } else { Hit::MISS }),
        ),
    })?;
    Ok((hits, times))
}
