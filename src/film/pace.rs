//! Adapts launches to a twentieth of a second: drivers reset devices that are busy, users cancel.

use std::time::Instant;

use super::Control;
use crate::error::Result;
use crate::gpu::Timing;

/// Target duration of a launch, seconds.
const TARGET: f64 = 0.05;
/// Rays of the first launch. It is small because some drivers compile shaders at the first launch.
const FIRST: u32 = 1 << 13;
/// Launches are multiples of this: of the packets of rays of all devices, also of camera rays that
/// 16 samples share.
const GRAIN: u32 = 1 << 10;
/// Maximum number of rays in a launch on every device, which the tracer must not split.
pub const MAX_RAYS: u32 = crate::tracer::stream::LAUNCH_RAYS;

/// Chooses the size of launches from the measured time of earlier ones.
#[derive(Clone, Debug)]
pub struct Pace {
    rays: u32,
    most: u32,
    /// Duration of a launch that is aimed for, seconds.
    target: f64,
    seen: bool,
}

impl Default for Pace {
    fn default() -> Self {
        Self::up_to(MAX_RAYS)
    }
}

impl Pace {
    /// For launches of at most `most` rays.
    pub fn up_to(most: u32) -> Self {
        Self { rays: FIRST.min(most), most, target: TARGET, seen: false }
    }

    /// For launches of which one region does the work of `steps` regions of others: it may take as
    /// long as they take together.
    pub fn with_steps(self, steps: u32) -> Self {
        Self { target: TARGET * f64::from(steps), ..self }
    }

    /// Rays of the next launch; a multiple of [`GRAIN`].
    pub fn rays(&self) -> u32 {
        self.rays
    }

    /// Number of launches in a submission: the host regains control about ten times a second.
    pub fn launches(&self) -> u32 {
        // a launch takes at most TARGET once the pace is found
        if self.rays < self.most { 2 } else { 4 }
    }

    /// Runs `count` threads or rays in launches, which `run` makes from their first and number, and
    /// asks `control` between them whether to stop.
    ///
    /// # Errors
    /// Those of `run` and `control`.
    pub fn run_launches(
        &mut self,
        count: u32,
        control: &mut dyn Control,
        mut run: impl FnMut(u32, u32) -> Result<Vec<Timing>>,
    ) -> Result<()> {
        let mut first = 0;
        while first < count {
            let n = self.rays.min(count - first);
            let start = Instant::now();
            let timings = run(first, n)?;
            if n == self.rays {
                self.learn(n, &timings, start.elapsed().as_secs_f64(), 1);
            }
            control.should_stop()?;
            first += n;
        }
        Ok(())
    }

    /// Learns from the longest region of a submission whose launches had at most `rays` rays.
    pub fn learn(&mut self, rays: u32, timings: &[Timing], wall: f64, launches: u32) {
        let longest = timings.iter().map(|t| t.seconds).fold(0.0, f64::max);
        // without timestamps, the wall time is divided evenly among the launches
        let seconds = if longest > 0.0 { longest } else { wall / launches.max(1) as f64 };
        let fit = rays as f64 * self.target / seconds.max(1e-6);
        // the first launch may have compiled the shader: its time says little
        let growth = if self.seen { 2.0 } else { 4.0 };
        let next = fit.clamp(self.rays as f64 * 0.25, self.rays as f64 * growth).clamp(GRAIN.into(), self.most as f64);
        self.rays = (next as u32) / GRAIN * GRAIN;
        self.seen = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn converges_to_the_target_from_below_and_above() {
        for (rate, most) in [(1e5, MAX_RAYS), (5e6, MAX_RAYS), (1e12, MAX_RAYS), (1e12, 4 * MAX_RAYS)] {
            let mut pace = Pace::up_to(most);
            for _ in 0..40 {
                let rays = pace.rays();
                pace.learn(rays, &[Timing { label: "x", seconds: rays as f64 / rate }], 0.0, 1);
            }
            let seconds = pace.rays() as f64 / rate;
            assert!(seconds <= 0.06, "{rate}: {seconds}");
            assert!(pace.rays() == most || seconds > 0.03, "{rate}: {seconds}");
            assert_eq!(pace.rays() % 64, 0);
        }
    }
}
