//! Frames made one after another, and what they cost.

use std::time::Instant;

use crate::bench::record::{Record, plain, quantity};
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::measure::stats::Percentiles;
use crate::realtime::{FrameStats, Realtime, Technique};
use crate::terminal::interrupt;
use crate::tracer::{MovedBounds, Tracer};

/// Frames in which a camera on an orbit is back.
pub const FRAMES_PER_TURN: f64 = 720.0;
/// Frames of a sequence with a reference.
const REFERENCES: u32 = 4;

/// The first of so many frames whose time counts: half of them compile, fill caches and histories.
pub fn first_timed(frames: u32) -> usize {
    frames as usize / 2
}

/// Frames whose error is measured: in the second half of a sequence, the last included.
pub fn measured(frames: u32) -> Vec<u32> {
    let half = frames / 2;
    let mut at: Vec<u32> =
        (1..=REFERENCES).map(|k| frames - half + half * k / REFERENCES).map(|end| end.max(1) - 1).collect();
    at.dedup();
    at
}

/// Passes of a frame that trace and average samples.
const SAMPLING: [&str; 6] = ["path_camera", "path_bounce", "path_shadow", "path_gather", "ao_trace", "gather"];

/// Cost of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameCost {
    /// Passes, and their times on the device over the timed frames, milliseconds.
    pub passes: Vec<(String, Percentiles)>,
    /// All passes, on the device; 0 where the device has no clock.
    pub device_ms: Percentiles,
    /// By the clock of the process, submission included.
    pub wall_ms: Percentiles,
    /// Camera rays, the mean of a frame.
    pub camera_rays: f64,
    /// Occlusion rays traced, the mean of a frame.
    pub rays: f64,
    /// Occlusion rays that were left out, the mean of a frame.
    pub skipped_rays: f64,
}

impl FrameCost {
    /// Time on the device, or by the clock where the device has none, milliseconds.
    pub fn time(&self) -> Percentiles {
        if self.device_ms.median > 0.0 { self.device_ms } else { self.wall_ms }
    }

    /// Median on the device, or by the clock where the device has none.
    pub fn ms(&self) -> f64 {
        self.time().median
    }

    /// Share of device time in passes that trace and average new samples, if it is known.
    pub fn sampling_share(&self) -> Option<f64> {
        let is_sampling = |(pass, _): &&(String, Percentiles)| SAMPLING.contains(&pass.as_str());
        let sampling: f64 = self.passes.iter().filter(is_sampling).map(|(_, ms)| ms.median).sum();
        let all: f64 = self.passes.iter().map(|(_, ms)| ms.median).sum();
        (sampling > 0.0).then(|| sampling / all)
    }

    /// Adds it to a record: time, rays, and the time of each pass as a part of its own.
    pub fn add_to(&self, record: &mut Record, [scene, part, contestant]: [&str; 3]) {
        let mut row = record.row(scene, part, contestant);
        row.repeated(quantity::FRAME_TIME, self.time()).repeated(plain("wall time", "ms"), self.wall_ms);
        row.exact(quantity::CAMERA_RAYS, self.camera_rays).exact(quantity::RAYS, self.rays);
        row.exact(plain("skipped rays", ""), (self.skipped_rays > 0.0).then_some(self.skipped_rays));
        let mut row = record.row(scene, &format!("{part}, passes"), contestant);
        for (pass, ms) in &self.passes {
            row.repeated(plain(pass, "ms"), *ms);
        }
    }

    /// Rays of a frame, those of the camera included.
    pub fn all_rays(&self) -> f64 {
        self.rays + self.camera_rays
    }
}

#[derive(Default)]
pub struct FrameLog {
    frames: Vec<TimedFrame>,
}

/// The typical time of a frame like others, noise of the clock aside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TypicalFrame {
    /// By the clock, milliseconds.
    pub ms: f64,
    /// Paths of a pixel if the frame did nothing but trace, in the time of all of its passes.
    pub paths: f64,
}

struct TimedFrame {
    wall: f64,
    stats: FrameStats,
}

impl FrameLog {
    /// Makes the next frame and takes its time. Fails when the user asked to stop.
    pub fn render_frame(
        &mut self,
        realtime: &mut Realtime,
        tracer: &Tracer,
        camera: &CameraRecord,
        moved: &[MovedBounds],
    ) -> Result<&FrameStats> {
        interrupt::check()?;
        let start = Instant::now();
        let mut stats = realtime.frame(tracer, camera, moved)?;
        let wall = start.elapsed().as_secs_f64();
        if realtime.settings().technique == Technique::Gtao {
            // it would have traced none
            stats.skipped_rays = 0;
        }
        self.frames.push(TimedFrame { wall, stats });
        // just pushed
        Ok(&self.frames[self.frames.len() - 1].stats)
    }

    pub fn count(&self) -> usize {
        self.frames.len()
    }

    /// Occlusion rays of all frames so far.
    pub fn rays(&self) -> u64 {
        self.frames.iter().map(|l| l.stats.occlusion_rays).sum()
    }

    /// Device seconds of each frame, or by the clock where the device has none.
    pub fn seconds(&self) -> Vec<f64> {
        let seconds = |l: &TimedFrame| {
            if l.stats.timings.is_empty() { l.wall } else { l.stats.timings.iter().map(|t| t.seconds).sum() }
        };
        self.frames.iter().map(seconds).collect()
    }

    /// The cost of frames from `first` on: earlier ones compile and find their memory.
    pub fn cost(&self, first: usize) -> FrameCost {
        cost_of(&self.frames[first.min(self.frames.len())..].iter().collect::<Vec<_>>())
    }

    /// The time of each frame: the median of those with as many samples, from `first` on.
    pub fn typical(&self, first: usize) -> Vec<TypicalFrame> {
        let mut kinds: Vec<(u32, TypicalFrame)> = Vec::new();
        let of_frame = |frame: &TimedFrame| {
            let samples = frame.stats.samples;
            if let Some((_, typical)) = kinds.iter().find(|k| k.0 == samples) {
                return *typical;
            }
            let alike =
                |from: usize| self.frames.iter().skip(from).filter(|f| f.stats.samples == samples).collect::<Vec<_>>();
            let late = alike(first);
            let cost = cost_of(&if late.is_empty() { alike(0) } else { late });
            let paths = f64::from(samples) / cost.sampling_share().unwrap_or(1.0);
            let typical = TypicalFrame { ms: cost.wall_ms.median, paths };
            kinds.push((samples, typical));
            typical
        };
        self.frames.iter().map(of_frame).collect()
    }
}

fn cost_of(frames: &[&TimedFrame]) -> FrameCost {
    let ms = |values: &mut dyn Iterator<Item = f64>| {
        Percentiles::from_values(&values.map(|s| s * 1e3).collect::<Vec<_>>()).unwrap_or_default()
    };
    let mean = |of: fn(&FrameStats) -> u64| {
        frames.iter().map(|l| of(&l.stats)).sum::<u64>() as f64 / frames.len().max(1) as f64
    };
    // steps and launches of a pass belong together: "PASS STEP"
    let mut passes: Vec<&str> = Vec::new();
    for label in frames.iter().flat_map(|l| &l.stats.timings).map(|t| pass(t.label)) {
        if !passes.contains(&label) {
            passes.push(label);
        }
    }
    let of_pass = |name: &str| {
        let of_frame = |l: &TimedFrame| {
            let here = l.stats.timings.iter().filter(|t| pass(t.label) == name).map(|t| t.seconds);
            // a frame that has no need of it says nothing about it
            here.reduce(|a, b| a + b)
        };
        (name.to_owned(), ms(&mut frames.iter().copied().filter_map(of_frame)))
    };
    FrameCost {
        passes: passes.iter().map(|name| of_pass(name)).collect(),
        device_ms: ms(&mut frames.iter().map(|l| l.stats.timings.iter().map(|t| t.seconds).sum())),
        wall_ms: ms(&mut frames.iter().map(|l| l.wall)),
        camera_rays: mean(|s| s.primary_rays),
        rays: mean(|s| s.occlusion_rays),
        skipped_rays: mean(|s| s.skipped_rays),
    }
}

fn pass(label: &str) -> &str {
    label.split_once(' ').map_or(label, |(pass, _)| pass)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::Timing;

    #[test]
    fn errors_are_measured_late() {
        assert_eq!(measured(64), [39, 47, 55, 63]);
        assert_eq!(measured(16), [9, 11, 13, 15]);
        assert_eq!(measured(4), [1, 2, 3]);
    }

    #[test]
    fn steps_of_a_pass_are_added() {
        let lap = |k: f64| TimedFrame {
            wall: k,
            stats: FrameStats {
                timings: [("gbuffer trace", 1.0), ("gbuffer deliver", 0.5), ("filter", 0.25)]
                    .map(|(label, seconds)| Timing { label, seconds: seconds * k * 1e-3 })
                    .to_vec(),
                occlusion_rays: 10,
                ..Default::default()
            },
        };
        let log = FrameLog { frames: vec![lap(100.0), lap(1.0), lap(1.0), lap(2.0)] };
        let cost = log.cost(1);
        let names: Vec<_> = cost.passes.iter().map(|(pass, ms)| (pass.as_str(), ms.median)).collect();
        assert_eq!(names, [("gbuffer", 1.5), ("filter", 0.25)]);
        assert!((cost.device_ms.median - 1.75).abs() < 1e-12 && (cost.device_ms.p95 - 3.5).abs() < 1e-12);
        assert_eq!((log.rays(), cost.rays), (40, 10.0));
    }

    #[test]
    fn the_share_of_samples() {
        let pass = |pass: &str, ms: f64| (pass.to_owned(), Percentiles::from_values(&[ms]).unwrap());
        let cost = FrameCost {
            passes: vec![pass("path_camera", 1.0), pass("path_bounce", 2.0), pass("filter", 1.0)],
            ..FrameCost::default()
        };
        assert_eq!(cost.sampling_share(), Some(0.75));
        assert_eq!(FrameCost::default().sampling_share(), None);
    }
}
