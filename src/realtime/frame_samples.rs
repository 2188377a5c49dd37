//! How many samples the frames take, in motion and at rest.

use super::settings::Settings;

/// Number of the first long frame at rest, from 1: who stops for a moment has pictures as often as before. Samples of short frames lie at the frame's place in all pixels, so more of them leave edges
/// jagged.
const FIRST_LONG: u32 = 4;

/// Samples of a pixel in a frame: paths of radiance, occlusion rays of ambient visibility. Frames in motion are short. At rest, after a few of them, come long ones: what a frame costs besides its samples, and
/// does not depend on their number, is a third to a half of the time of a short one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameSamples {
    /// In a short frame.
    pub few: u32,
    /// In a long frame.
    pub many: u32,
    /// Number of the first long frame at rest, from 1.
    first_long: u32,
    /// Number of short frames in which each pixel is sampled once.
    period: u32,
    /// Samples at rest start anew with the first long frame: those of the short ones lie at the frame's place in all pixels, and may all be bright there.
    forgets_short: bool,
}

impl FrameSamples {
    /// Those of radiance in images of so many pixels. `period` is left to the paths, whose frames at rest all sample the same pattern.
    pub fn of_radiance(settings: &Settings, pixels: u64) -> Self {
        // a tenth of a frame's time is then for other things, and with twice as many a twentieth; all paths together take about a second on two cores
        const MAX_PER_PIXEL: u64 = 8;
        const MAX_PATHS: u64 = 1 << 20;
        let few = settings.rays_per_pixel;
        let most = (MAX_PATHS / pixels.max(1)).min(MAX_PER_PIXEL) as u32;
        let many = if settings.converges() { few.max(power_of_two(most)) } else { few };
        // several paths of a short frame lie anywhere in their pixels
        let forgets_short = few == 1 && many >= FIRST_LONG;
        Self { few, many, first_long: FIRST_LONG, period: 1, forgets_short }
    }

    /// Those of ambient visibility. Long frames take them as stills do, which is faster from eight samples of a pixel on.
    pub fn of_visibility(settings: &Settings, pixels: u64) -> Self {
        // half a second on two cores, where that is enough for eight; in large images seconds
        const MAX_PER_PIXEL: u64 = 16;
        const MANY_SAMPLES: u64 = 1 << 22;
        const MAX_SAMPLES: u64 = 1 << 25;
        let (few, period) = (settings.rays_per_pixel, settings.resolution.period());
        let pixels = pixels.max(1);
        let most = (MANY_SAMPLES / pixels).clamp(8, MAX_PER_PIXEL).min(MAX_SAMPLES / pixels) as u32;
        let has_long = settings.converges() && !settings.bent && most >= few.max(4);
        let (many, first_long) = if has_long { (power_of_two(most), FIRST_LONG) } else { (few, u32::MAX) };
        Self { few, many, first_long, period, forgets_short: false }
    }

    /// Returns true if there are long frames.
    pub fn has_long(&self) -> bool {
        self.first_long < u32::MAX
    }

    /// Returns true if a frame is long. `resting`: frames at rest, this one included.
    pub fn is_long(&self, resting: u32) -> bool {
        resting >= self.first_long
    }

    /// Samples of a pixel in the frame.
    pub fn of(&self, resting: u32) -> u32 {
        if self.is_long(resting) { self.many } else { self.few }
    }

    /// Samples of a pixel in the frames before the first long one.
    pub fn in_short(&self) -> u32 {
        self.first_long.saturating_mul(self.few)
    }

    /// Returns true if samples at rest start anew with this long frame.
    pub fn starts_anew(&self, resting: u32) -> bool {
        self.forgets_short && resting == self.first_long
    }

    /// Returns true if the samples of short frames no longer count.
    pub fn has_forgotten_short(&self, resting: u32) -> bool {
        self.forgets_short && self.is_long(resting)
    }

    /// Mean number of samples of a pixel that count in all frames since the image came to rest, but for the first; rounded down.
    pub fn since_rest(&self, resting: u32) -> u64 {
        let short = resting.min(self.first_long - 1);
        if self.has_forgotten_short(resting) {
            return u64::from(resting - short) * u64::from(self.many);
        }
        u64::from(short) * u64::from(self.few) / u64::from(self.period) + u64::from(resting - short) * u64::from(self.many)
    }

    /// Samples of a pixel in the long frames before a long frame.
    pub fn in_long_before(&self, resting: u32) -> u32 {
        (resting - self.first_long).saturating_mul(self.many)
    }

    /// Number of frames at rest that have so many samples in all.
    pub fn frames_for(&self, samples: u32) -> u32 {
        let short = self.first_long - 1;
        let in_short = self.since_rest(short);
        if u64::from(samples) <= in_short {
            // no more than the short frames
            return (u64::from(samples) * u64::from(self.period)).div_ceil(u64::from(self.few)) as u32;
        }
        let in_short = if self.forgets_short { 0 } else { in_short };
        short + (u64::from(samples) - in_short).div_ceil(u64::from(self.many)) as u32
    }
}

/// The largest power of two that is not larger; 0 for 0.
fn power_of_two(n: u32) -> u32 {
    n.checked_ilog2().map_or(0, |bits| 1 << bits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::realtime::{Preset, Resolution};

    #[test]
    fn frames_at_rest_have_the_samples_that_are_counted() {
        for pixels in [1, 14_400, 518_400, 10_000_000] {
            for settings in [Preset::Fast, Preset::Quality].map(Preset::settings) {
                let settings = Settings { converge: true, ..settings };
                for samples in [FrameSamples::of_radiance(&settings, pixels), FrameSamples::of_visibility(&settings, pixels)] {
                    assert!(samples.many >= samples.few);
                    let few_or = |most: u64| samples.many == samples.few || u64::from(samples.many) * pixels <= most;
                    assert!(few_or(1 << 25));
                    let mut sum = 0;
                    for resting in 1..100 {
                        sum = if samples.starts_anew(resting) { 0 } else { sum } + samples.of(resting);
                        assert_eq!(samples.since_rest(resting), u64::from(sum));
                        assert_eq!(samples.frames_for(sum), resting, "{samples:?}");
                        assert_eq!(samples.frames_for(sum + 1), resting + 1, "{samples:?}");
                    }
                }
                let held = Settings { converge: false, ..settings };
                for samples in [FrameSamples::of_radiance(&held, pixels), FrameSamples::of_visibility(&held, pixels)] {
                    assert_eq!(samples.many, samples.few);
                }
            }
        }
    }

    #[test]
    fn long_frames_sample_all_pixels_of_a_pattern() {
        let half = Settings { converge: true, resolution: Resolution::Half, ..Preset::Fast.settings() };
        let samples = FrameSamples::of_visibility(&half, 14_400);
        let short = samples.first_long - 1;
        assert_eq!(samples.since_rest(short + 2), u64::from(short / samples.period + 2 * samples.many));
        for wanted in 1..100 {
            let frames = samples.frames_for(wanted);
            assert!(samples.since_rest(frames) >= wanted.into());
            assert!(frames == 1 || samples.since_rest(frames - 1) < wanted.into(), "{wanted}");
        }
    }
}
