//! An image that is kept up to date: at a resolution that holds the frame rate while something
//! moves, at full resolution once it rests.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use crate::error::{Error, Result};
use crate::film::Control;
use crate::renderer::RenderSettings;
use crate::renderer::interactive::{Interactive, View, ViewStep};
use crate::scene::Camera;

/// Scales of the resolution along each axis.
const SCALES: [f64; 8] = [1.0, 0.75, 0.5, 0.375, 0.25, 0.1875, 0.125, 0.0625];
/// Scale to start with.
const FIRST_SCALE: usize = 2;
/// A finer scale is chosen if a frame of it is expected to take at most this share of the time that
/// there is.
const HEADROOM: f64 = 0.8;
/// Frames whose times count. The least of them is taken: drivers compile at the first use of a
/// shader, and other programs run, too.
const REMEMBERED: usize = 3;
/// Frames after which a finer scale is tried again though it was too slow.
const FORGET: u32 = 20;
/// Wall-clock time of a step of a still at rest: the first, and later ones.
const STILL_STEPS: [Duration; 2] = [Duration::from_millis(150), Duration::from_millis(600)];

/// An image in progress, as a view that moves and one that rests.
pub struct Pane {
    settings: RenderSettings,
    size: [u32; 2],
    /// Index into [`SCALES`] of what moves.
    scale: usize,
    moving: Option<View>,
    resting: Option<View>,
    /// Wall-clock seconds of the last frames at each scale while something moves.
    times: [VecDeque<f64>; SCALES.len()],
    /// Frames since the scale was last changed.
    frames_at_scale: u32,
    /// Whether the resting view's next step is its first.
    is_fresh: bool,
    /// The last step was of the resting view.
    shows_rest: bool,
    /// It has not been stepped since the scene or the camera has moved.
    is_outdated: bool,
    is_settled: bool,
    /// Wall-clock time of its steps since it came to rest.
    spent: Duration,
    steps: u64,
    /// The settings cannot be rendered.
    failed: bool,
}

/// How a pane is stepped.
pub struct Pacing {
    /// Something moves.
    pub moves: bool,
    /// Time of a frame while something moves; `None`: full resolution always.
    pub frame_time: Option<Duration>,
}

impl Pane {
    /// A pane of these settings, of so many pixels at full resolution.
    pub fn new(settings: &RenderSettings, size: [u32; 2]) -> Self {
        Self {
            settings: settings.clone(),
            size,
            scale: FIRST_SCALE,
            moving: None,
            resting: None,
            times: Default::default(),
            frames_at_scale: 0,
            is_fresh: true,
            shows_rest: false,
            is_outdated: false,
            is_settled: false,
            spent: Duration::ZERO,
            steps: 0,
            failed: false,
        }
    }

    /// Returns true if it is of these settings and size.
    pub fn is_of(&self, settings: &RenderSettings, size: [u32; 2]) -> bool {
        self.settings == *settings && self.size == size
    }

    /// Returns true if it is of this size.
    pub fn is_of_size(&self, size: [u32; 2]) -> bool {
        self.size == size
    }

    /// Keeps what was measured for a pane of other settings or another size.
    pub fn inherit_pace(&mut self, before: &Self) {
        if self.settings.integrator == before.settings.integrator {
            (self.scale, self.times) = (before.scale, before.times.clone());
        }
    }

    /// Returns true if it does not change any more while nothing moves.
    pub fn is_idle(&self) -> bool {
        self.failed || self.is_settled && self.shows_rest
    }

    /// The settings could not be rendered.
    pub fn has_failed(&self) -> bool {
        self.failed
    }

    /// Notes that the settings cannot be rendered.
    pub fn fail(&mut self) {
        self.failed = true;
    }

    /// The scene or the camera has moved.
    pub fn restart(&mut self) {
        (self.is_settled, self.is_fresh, self.is_outdated, self.spent) = (false, true, true, Duration::ZERO);
    }

    /// Wall-clock time of its steps since it came to rest.
    pub fn spent(&self) -> Duration {
        self.spent
    }

    /// Number of steps so far.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// The view at full resolution, once it has been rendered.
    pub fn rest(&self) -> Option<&View> {
        // before its first step it is of another camera
        self.resting.as_ref().filter(|_| self.shows_rest && !self.is_fresh)
    }

    /// There is no image of where scene and camera are, but there will be one.
    pub fn is_to_come(&self) -> bool {
        (self.is_outdated || self.shown().is_none()) && !self.failed
    }

    /// The view that was rendered last.
    pub fn shown(&self) -> Option<&View> {
        if self.shows_rest { self.resting.as_ref() } else { self.moving.as_ref() }
    }

    /// Size of the moving view.
    fn scaled(&self) -> [u32; 2] {
        self.size.map(|n| ((f64::from(n) * SCALES[self.scale]).round() as u32).max(1))
    }

    /// Renders the next step. Returns the step and its wall-clock time. After an error the view is
    /// gone; [`Error::Interrupted`] says nothing about the settings.
    ///
    /// # Errors
    /// Those of [`View::new`] and [`View::step`].
    pub fn step(
        &mut self,
        session: &mut Interactive,
        camera: &Camera,
        pacing: &Pacing,
        control: &mut dyn Control,
    ) -> Result<(ViewStep, Duration)> {
        // while something moves a smaller image is rendered, to hold the frame rate
        let scales = pacing.moves && pacing.frame_time.is_some() && self.scale > 0;
        let size = if scales { self.scaled() } else { self.size };
        let (slot, other) = if scales { (&mut self.moving, &self.resting) } else { (&mut self.resting, &self.moving) };
        let mut before = slot.take().filter(|v| !v.is_stale(session));
        let is_new = before.as_ref().is_none_or(|v| v.size() != size);
        let was_shown = self.shows_rest != scales;

        // a view of this size, made anew if the one before does not fit
        let mut view = match before.take_if(|_| !is_new) {
            Some(view) => view,
            None => match View::new(session, &self.settings, size, control) {
                // without the one before
                Err(Error::OutOfMemory(_)) if before.take().is_some() => {
                    View::new(session, &self.settings, size, control)?
                }
                made => made?,
            },
        };

        // the image that was shown goes on
        let shown = if was_shown { before.as_ref() } else { other.as_ref() };
        if let Some(shown) = shown {
            // at rest what was seen before is finer
            view.continue_from(session, shown, !scales)?;
        }
        drop(before);

        // steps are short while something moves, so that input is answered
        let view = slot.insert(view);
        let time = match () {
            () if pacing.moves => Duration::from_millis(1),
            () if self.is_fresh => STILL_STEPS[0],
            () => STILL_STEPS[1],
        };
        let start = Instant::now();
        let step = match view.step(session, camera, time, control) {
            Ok(step) => step,
            Err(e) => {
                if !matches!(e, Error::Interrupted) {
                    *slot = None;
                }
                return Err(e);
            }
        };

        // what the window asks about
        let elapsed = start.elapsed();
        self.shows_rest = !scales;
        self.is_settled = step.is_settled;
        self.is_outdated = false;
        self.is_fresh &= scales;
        self.steps += 1;
        self.spent += elapsed;
        if pacing.moves && !is_new {
            self.learn(elapsed.as_secs_f64(), pacing.frame_time);
        }
        Ok((step, elapsed))
    }

    /// Chooses the scale of the next frames by the time of this one.
    fn learn(&mut self, seconds: f64, frame_time: Option<Duration>) {
        let Some(most) = frame_time.map(|t| t.as_secs_f64()) else { return };
        let times = &mut self.times[self.scale];
        times.push_back(seconds);
        if times.len() > REMEMBERED {
            times.pop_front();
        }
        self.frames_at_scale += 1;
        let now = least(times);
        let (scale, last) = (self.scale, SCALES.len() - 1);
        let pixels = |k: usize| SCALES[k] * SCALES[k];
        if now > most && times.len() == REMEMBERED && scale < last {
            // time does not fall below what does not depend on pixels: one step at a time unless it
            // is far too slow
            let fits = |k: &usize| now * pixels(*k) / pixels(scale) <= most;
            self.scale = if now > 2.0 * most { (scale + 1..last).find(fits).unwrap_or(last) } else { scale + 1 };
        } else if scale > 0 && now <= most {
            let finer = &mut self.times[scale - 1];
            if self.frames_at_scale >= FORGET {
                finer.clear();
            }
            let expected = if finer.is_empty() { now * pixels(scale - 1) / pixels(scale) } else { least(finer) };
            // what was not measured yet is expected to be slower than it is
            if expected <= HEADROOM * most
                || finer.is_empty() && now <= 0.6 * most && self.frames_at_scale >= REMEMBERED as u32
            {
                self.scale = scale - 1;
            }
        }
        if self.scale != scale {
            self.frames_at_scale = 0;
        }
    }
}

fn least(times: &VecDeque<f64>) -> f64 {
    times.iter().copied().fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_holds_the_frame_time() {
        let most = Duration::from_millis(60);
        // milliseconds of a full frame, and of what does not depend on pixels
        for (full, overhead) in [(1.0, 1.0), (50.0, 5.0), (200.0, 20.0), (1000.0, 10.0), (1e5, 1.0)] {
            let mut pane = Pane::new(&RenderSettings::default(), [960, 540]);
            let mut changes = 0;
            let at = |scale: usize| 1e-3 * (overhead + (full - overhead) * SCALES[scale] * SCALES[scale]);
            for frame in 0..200 {
                let before = pane.scale;
                // the first frame compiles shaders
                pane.learn(at(pane.scale) + if frame == 0 { 0.5 } else { 0.0 }, Some(most));
                changes += u32::from(pane.scale != before);
            }
            // it tries a finer scale now and then
            let seconds = at((pane.scale + 1).min(SCALES.len() - 1)).min(at(pane.scale));
            let most = most.as_secs_f64();
            assert!(seconds <= most || pane.scale == SCALES.len() - 1, "{full}: {seconds}");
            assert!(pane.scale == 0 || at(pane.scale - 1) > HEADROOM * most, "{full}: scale {}", pane.scale);
            assert!(changes < 16, "{full}: it swings, {changes}");
        }
    }
}
