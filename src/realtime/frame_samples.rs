//! How many samples the frames take, in motion and at rest.

use super::settings::Settings;

/// Number of the first long frame at rest, from 1, where long frames do not begin with few samples:
/// who stops for a moment has pictures as often as before. Samples of short frames lie at the
/// frame's place in all pixels, so more of them leave edges jagged.
const FIRST_LONG: u32 = 4;

/// A long frame has at most one in this many of all samples at rest: viewers see every change.
const PARTS: u32 = 8;

/// Samples of a pixel in a frame: paths of radiance, occlusion rays of ambient visibility. Frames
/// in motion are short. At rest, after a few of them, come long ones: what a frame costs besides
/// its samples, and does not depend on their number, is a third to a half of the time of a short
/// one. Those of radiance become longer with the samples there are: by powers of two, so that each
/// begins at a multiple of its number and together they fill the sequence evenly. First each has as
/// many as all before it (2, 2, 4, 8; where short ones have 4, 4, 4, 8), then as many for some
/// time, and then a part of those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameSamples {
    /// In a short frame.
    pub few: u32,
    /// In long frames, after the first few.
    many: u32,
    /// The first long frame has this power of two less.
    ramp: u32,
    /// Times that the number of samples of a long frame doubles after that.
    doublings: u32,
    /// Number of the first long frame at rest, from 1.
    first_long: u32,
    /// Number of short frames in which each pixel is sampled once.
    period: u32,
    /// Samples at rest start anew with the first long frame: those of the short ones lie at the
    /// frame's place in all pixels, and may all be bright there.
    forgets_short: bool,
}

impl FrameSamples {
    /// Samples of radiance in images of so many pixels. `period` is left to the paths, whose frames
    /// at rest all sample the same pattern, and so have the same number.
    pub fn for_radiance(settings: &Settings, pixels: u64, is_cpu: bool) -> Self {
        // a tenth of a frame's time is then for other things
        const FIRST_PER_PIXEL: u64 = 8;
        // a fortieth
        const MAX_PER_PIXEL: u64 = 32;
        // the first long frames take about a second on two cores, and a tenth of that on a GPU
        const FIRST_PATHS: u64 = 1 << 20;
        const FIRST_GPU_PATHS: u64 = 1 << 24;
        const GROWTH: u64 = 4;
        let few = settings.rays_per_pixel;
        let most_paths = if is_cpu { FIRST_PATHS } else { FIRST_GPU_PATHS };
        let per_pixel = |paths: u64, most: u64| (paths / pixels.max(1)).min(most) as u32;
        let many =
            if settings.converges() { few.max(power_of_two(per_pixel(most_paths, FIRST_PER_PIXEL))) } else { few };
        let grows = settings.converges() && settings.resolution.period() == 1;
        // several paths of a short frame after the first at rest lie anywhere in their pixels
        let forgets_short = many >= 4 && (few == 1 || grows);
        let (ramp, first_long) = if forgets_short && grows {
            ((many / few.next_power_of_two().max(2)).checked_ilog2().unwrap_or(0), 1)
        } else {
            (0, FIRST_LONG)
        };
        let times = per_pixel(GROWTH * most_paths, MAX_PER_PIXEL) / many;
        let doublings = if grows { times.checked_ilog2().unwrap_or(0) } else { 0 };
        Self { few, many, ramp, doublings, first_long, period: 1, forgets_short }
    }

    /// Samples of ambient visibility; long frames take eight or more of a pixel, as stills do.
    pub fn for_visibility(settings: &Settings, pixels: u64) -> Self {
        // half a second on two cores, where that is enough for eight; in large images seconds
        const MAX_PER_PIXEL: u64 = 16;
        const MANY_SAMPLES: u64 = 1 << 22;
        const MAX_SAMPLES: u64 = 1 << 25;
        let (few, period) = (settings.rays_per_pixel, settings.resolution.period());
        let pixels = pixels.max(1);
        let most = (MANY_SAMPLES / pixels).clamp(8, MAX_PER_PIXEL).min(MAX_SAMPLES / pixels) as u32;
        let has_long = settings.converges() && !settings.bent && most >= few.max(4);
        let (many, first_long) = if has_long { (power_of_two(most), FIRST_LONG) } else { (few, u32::MAX) };
        Self { few, many, ramp: 0, doublings: 0, first_long, period, forgets_short: false }
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
    pub fn in_frame(&self, resting: u32) -> u32 {
        let Some(long) = resting.checked_sub(self.first_long) else { return self.few };
        if long <= self.ramp {
            (self.many >> self.ramp) << long.saturating_sub(1)
        } else {
            self.many << self.doublings_before(long - self.ramp)
        }
    }

    /// Frames at rest that have as many samples as so many frames without growth.
    pub fn frames_for_first(&self, frames: u32) -> u32 {
        self.frames_for(frames.saturating_mul(self.many))
    }

    /// Maximum number of samples of a pixel in a frame.
    pub fn most(&self) -> u32 {
        self.many << self.doublings
    }

    /// How often the number of samples has doubled by the long frame with this index, those with
    /// fewer than `many` counted as one; it has a part of [`PARTS`] of those before it, or less.
    fn doublings_before(&self, long: u32) -> u32 {
        (long.saturating_sub(PARTS) / PARTS).min(self.doublings)
    }

    /// Samples of a pixel in so many long frames.
    fn in_long(&self, frames: u32) -> u64 {
        if frames <= self.ramp {
            return if frames == 0 { 0 } else { u64::from(self.many >> self.ramp) << (frames - 1) };
        }
        // all that have fewer have as many together as one
        let frames = frames - self.ramp;
        let doublings = self.doublings_before(frames);
        // 2 PARTS frames have as many together as PARTS of the next number, and so on
        (u64::from(self.many) * u64::from(frames - PARTS * doublings)) << doublings
    }

    /// Number of long frames that have so many samples in all, one at least.
    fn long_for(&self, samples: u64) -> u32 {
        let many = u64::from(self.many);
        if samples <= many {
            let times = samples.div_ceil(many >> self.ramp);
            return if times <= 1 { 1 } else { 1 + times.next_power_of_two().ilog2() };
        }
        let frames = |doublings: u32| samples.div_ceil(many << doublings) + u64::from(PARTS * doublings);
        // the last frame is of the first number of samples that reaches so far
        let last = (0..self.doublings).find(|&d| frames(d) <= u64::from(PARTS * (d + 2))).unwrap_or(self.doublings);
        self.ramp + frames(last) as u32
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

    /// Mean number of samples of a pixel at rest but for the first frame's; rounded down.
    pub fn since_rest(&self, resting: u32) -> u64 {
        let short = resting.min(self.first_long - 1);
        if self.has_forgotten_short(resting) {
            return self.in_long(resting - short);
        }
        u64::from(short) * u64::from(self.few) / u64::from(self.period) + self.in_long(resting - short)
    }

    /// Samples of a pixel in the long frames before a long frame.
    pub fn in_long_before(&self, resting: u32) -> u32 {
        u32::try_from(self.in_long(resting - self.first_long)).unwrap_or(u32::MAX)
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
        short + self.long_for(u64::from(samples) - in_short)
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
                let all = |settings: &Settings| {
                    let for_radiance = [true, false].map(|is_cpu| FrameSamples::for_radiance(settings, pixels, is_cpu));
                    for_radiance.into_iter().chain([FrameSamples::for_visibility(settings, pixels)])
                };
                let settings = Settings { converge: true, ..settings };
                for samples in all(&settings) {
                    assert!(samples.many >= samples.few);
                    let few_or =
                        |most: u64| samples.most() == samples.few || u64::from(samples.most()) * pixels <= most;
                    assert!(few_or(1 << 26));
                    let (mut sum, mut in_long) = (0, 0);
                    for resting in 1..100 {
                        let now = samples.in_frame(resting);
                        if samples.is_long(resting) {
                            assert_eq!(samples.in_long_before(resting), in_long);
                            // a block of the sequence, and a small part of all, or as few as first
                            assert!(in_long.is_multiple_of(now), "{samples:?}");
                            let is_part = if now <= samples.many {
                                in_long == 0 || now <= in_long.max(samples.few)
                            } else {
                                PARTS * now <= in_long
                            };
                            assert!(is_part && now <= samples.most(), "{samples:?}");
                            // and no smaller part than that, while they grow
                            assert!(now == samples.most() || PARTS * 2 * now > in_long, "{samples:?}");
                            in_long += now;
                        }
                        sum = if samples.starts_anew(resting) { 0 } else { sum } + now;
                        assert_eq!(samples.since_rest(resting), u64::from(sum));
                        assert_eq!(samples.frames_for(sum), resting, "{samples:?}");
                        assert_eq!(samples.frames_for(sum + 1), resting + 1, "{samples:?}");
                    }
                }
                for samples in all(&Settings { converge: false, ..settings }) {
                    assert_eq!(samples.most(), samples.few);
                }
            }
        }
    }

    #[test]
    fn frames_at_rest_become_longer() {
        let settings = Settings { converge: true, ..Preset::Balanced.settings() };
        let samples = FrameSamples::for_radiance(&settings, 14_400, true);
        assert_eq!(
            [0, 1, 2, 3, 4, 18, 19, 26, 27, 1000].map(|resting| samples.in_frame(resting)),
            [1, 2, 2, 4, 8, 8, 16, 16, 32, 32]
        );
        assert_eq!([samples.frames_for_first(10), samples.frames_for_first(64)], [12, 34]);
        let quality = Settings { converge: true, ..Preset::Quality.settings() };
        let quality = FrameSamples::for_radiance(&quality, 14_400, true);
        assert_eq!([0, 1, 2, 3, 4, 1000].map(|resting| quality.in_frame(resting)), [4, 4, 4, 8, 8, 32]);
        // a GPU has time for several paths in a large image
        let large = |is_cpu| FrameSamples::for_radiance(&settings, 1920 * 1080, is_cpu);
        assert_eq!(
            [large(true).in_frame(4), large(false).in_frame(4), large(true).most(), large(false).most()],
            [1, 8, 2, 32]
        );
        // all pixels of a pattern have the same number
        let half = FrameSamples::for_radiance(&Settings { resolution: Resolution::Half, ..settings }, 14_400, true);
        assert_eq!([3, 4, 100].map(|resting| half.in_frame(resting)), [1, 8, 8]);
    }

    #[test]
    fn long_frames_sample_all_pixels_of_a_pattern() {
        let half = Settings { converge: true, resolution: Resolution::Half, ..Preset::Fast.settings() };
        let samples = FrameSamples::for_visibility(&half, 14_400);
        let short = samples.first_long - 1;
        assert_eq!(samples.since_rest(short + 2), u64::from(short / samples.period + 2 * samples.most()));
        for wanted in 1..100 {
            let frames = samples.frames_for(wanted);
            assert!(samples.since_rest(frames) >= wanted.into());
            assert!(frames == 1 || samples.since_rest(frames - 1) < wanted.into(), "{wanted}");
        }
    }
}
