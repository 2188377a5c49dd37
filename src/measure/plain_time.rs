//! The time that images of independent samples take: one for the image, and one for each path.

use super::stats::median;

/// Times of plain accumulation that are taken between frames.
const TIMES_BETWEEN: usize = 4;

/// Paths of a pixel in the images whose times are taken: what an image costs besides its paths is
/// told by two numbers of them.
pub const TIMED_PATHS: [u32; 2] = [1, 9];

/// Times of images of independent samples. They are taken between the frames that they are compared
/// with: a machine that slows down for a while slows both down.
#[derive(Clone, Debug, Default)]
pub struct PlainClock {
    seconds: [Vec<f64>; 2],
}

impl PlainClock {
    /// Takes the times of an image of few and one of many paths. `image` renders one, and returns
    /// its seconds.
    pub fn take<E>(&mut self, mut image: impl FnMut(u32) -> Result<f64, E>) -> Result<(), E> {
        for (seconds, paths) in self.seconds.iter_mut().zip(TIMED_PATHS) {
            seconds.push(image(paths)?);
        }
        Ok(())
    }

    /// By the medians of all times.
    pub fn time(&self) -> PlainTime {
        let ms = [0, 1].map(|k| 1e3 * median(&self.seconds[k]).unwrap_or(f64::NAN));
        PlainTime::through(TIMED_PATHS, ms)
    }
}

/// Time of images of independent samples, milliseconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlainTime {
    /// Time of an image, besides its paths.
    pub per_image: f64,
    /// Time of each path per pixel.
    pub per_path: f64,
}

impl PlainTime {
    /// The times of images that took `ms` for so many paths: a line through two points, neither
    /// part of which is negative.
    fn through([few, many]: [u32; 2], [least, most]: [f64; 2]) -> Self {
        let per_path = ((most - least) / f64::from(many - few)).clamp(0.0, most / f64::from(many));
        // times have noise: paths are not free
        let per_path = per_path.max(0.1 * most / f64::from(many));
        Self { per_image: (least - f64::from(few) * per_path).max(0.0), per_path }
    }

    /// As many paths as an image of so many milliseconds can have: at least one.
    pub fn paths_in(&self, ms: f64) -> u32 {
        (((ms - self.per_image) / self.per_path) as u32).max(1)
    }
}

/// Is the time of plain accumulation taken after a frame, counted from 0, of so many whose time
/// counts from `first` on?
pub fn is_plain_timed(frame: u32, first: usize, frames: u32) -> bool {
    let step = (frames as usize - first).div_ceil(TIMES_BETWEEN);
    (frame as usize).checked_sub(first).is_some_and(|n| n.is_multiple_of(step.max(1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_that_fit_a_time() {
        let time = PlainTime::through([1, 9], [5.0, 21.0]);
        assert_eq!(time, PlainTime { per_image: 3.0, per_path: 2.0 });
        assert_eq!([1.0, 5.0, 10.9, 23.0].map(|ms| time.paths_in(ms)), [1, 1, 3, 10]);
        // noise alone
        let odd = PlainTime::through([1, 9], [5.0, 4.0]);
        assert!(odd.per_path > 0.0 && odd.per_image >= 0.0);
        let mut clock = PlainClock::default();
        clock.take(|paths| Ok::<_, ()>(0.003 + 0.002 * f64::from(paths))).unwrap();
        assert!((clock.time().per_path - 2.0).abs() < 1e-9 && (clock.time().per_image - 3.0).abs() < 1e-9);
    }

    #[test]
    fn plain_accumulation_is_timed_between_late_frames() {
        let at =
            |frames: u32, first: usize| (0..frames).filter(|f| is_plain_timed(*f, first, frames)).collect::<Vec<_>>();
        assert_eq!(at(96, 48), [48, 60, 72, 84]);
        assert_eq!(at(8, 0), [0, 2, 4, 6]);
        assert_eq!(at(4, 2), [2, 3]);
    }
}
