//! How many paths the frames of radiance take, in motion and at rest.

use super::settings::Settings;

/// Frames at rest before a frame takes more paths: who stops for a moment has pictures as often as before.
const FIRST_LONG_FRAME: u32 = 8;
/// Maximum number of paths of a pixel in a long frame, if the settings do not ask for more: a tenth of its time is then for other things, and with twice as many a twentieth.
const LONG_FRAME_RAYS: u64 = 8;
/// Maximum number of paths of a long frame, likewise: about a second on two cores.
const LONG_FRAME_PATHS: u64 = 1 << 20;

/// How many paths the pixels have that are sampled in a frame. At rest there are more than in motion: what a frame costs besides paths, and does not depend on their number, is a third to a half of its time with one path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FramePaths {
    /// In motion, and in the first frames at rest.
    pub few: u32,
    /// Later.
    pub many: u32,
}

impl FramePaths {
    /// `pixels`: of the image.
    pub fn new(settings: &Settings, pixels: u64) -> Self {
        let few = settings.rays_per_pixel;
        let most = (LONG_FRAME_PATHS / pixels.max(1)).min(LONG_FRAME_RAYS) as u32;
        let many = if settings.converges() { few.max(most.checked_ilog2().map_or(0, |bits| 1 << bits)) } else { few };
        Self { few, many }
    }

    /// Returns true if a frame takes more paths than in motion. `resting`: as [`Frame::resting`].
    pub fn is_long(resting: u32) -> bool {
        resting >= FIRST_LONG_FRAME
    }

    /// Paths of the frame.
    pub fn of(&self, resting: u32) -> u32 {
        if Self::is_long(resting) { self.many } else { self.few }
    }

    /// Paths of all frames since the image came to rest, but for the first.
    pub fn since_rest(&self, resting: u32) -> u64 {
        let few = resting.min(FIRST_LONG_FRAME - 1);
        u64::from(few) * u64::from(self.few) + u64::from(resting - few) * u64::from(self.many)
    }

    /// Number of frames at rest that have so many paths in all.
    pub fn frames_for(&self, paths: u32) -> u32 {
        let first = (FIRST_LONG_FRAME - 1) * self.few;
        match paths.checked_sub(first) {
            None => paths.div_ceil(self.few),
            Some(others) => FIRST_LONG_FRAME - 1 + others.div_ceil(self.many),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::realtime::Preset;

    #[test]
    fn frames_at_rest_have_the_paths_that_are_counted() {
        for pixels in [1, 14_400, 518_400, 10_000_000] {
            for settings in [Preset::Fast, Preset::Quality].map(Preset::settings) {
                let paths = FramePaths::new(&Settings { converge: true, ..settings }, pixels);
                assert!(
                    paths.many >= paths.few && (paths.many == paths.few || u64::from(paths.many) * pixels <= LONG_FRAME_PATHS)
                );
                let mut sum = 0;
                for resting in 1..100 {
                    sum += paths.of(resting);
                    assert_eq!(paths.since_rest(resting), u64::from(sum));
                    assert_eq!(paths.frames_for(sum), resting, "{paths:?}");
                    assert_eq!(paths.frames_for(sum + 1), resting + 1, "{paths:?}");
                }
                let held = FramePaths::new(&Settings { converge: false, ..settings }, pixels);
                assert_eq!(held.many, held.few);
            }
        }
    }
}
