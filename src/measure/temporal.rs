//! Temporal metrics of image sequences: lag, ghosting, recovery and drift.
//!
//! An image that reuses its past is, after a change, a blend of what is right and what was right
//! before. Where both are known, the share of the old is a number that noise does not move:
//! [`residual`]. What follows from it, frame by frame, is said by [`LagCurve`] and [`Ghosting`];
//! [`recovery`] and [`Drift`] take numbers a frame. Numbers in, numbers out; NaN wherever a value
//! that counts is not finite: invalid pixels must not be averaged away.

/// How much of a wrong history an image still shows, by least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// `g` in `result = truth + g (wrong - truth)`: 0 = nothing of it, 1 = all of it; noise may
    /// take it a little beyond.
    pub share: f64,
    /// Standard error of `share`, whatever the noise of each pixel (White 1980). Takes pixels for
    /// independent: a filter that spreads noise over n pixels makes the true one up to the root of
    /// n greater.
    pub standard_error: f64,
    /// Pixels that took part.
    pub pixels: u64,
    /// Mean over these pixels of (wrong - truth)^2: how much there was to forget.
    pub contrast: f64,
}

impl Residual {
    /// Fits the share of an image, given what is right now and what is still remembered, all of the
    /// same size, over the pixels whose `mask` is above 0 (`None`: all). `None` where sizes differ,
    /// or `wrong` and `truth` are the same everywhere: then nothing can be said.
    ///
    /// `truth` and `wrong` are to be free of noise, or nearly so: noise of `truth` is in both
    /// differences and passes for a ghost, noise of `wrong` makes a ghost look weaker.
    pub fn from_images(result: &[f32], truth: &[f32], wrong: &[f32], mask: Option<&[f32]>) -> Option<Self> {
        let n = result.len();
        if truth.len() != n || wrong.len() != n || mask.is_some_and(|m| m.len() != n) {
            return None;
        }
        let pairs = || {
            (0..n).filter(|&i| mask.is_none_or(|m| m[i] > 0.0)).map(|i| {
                let t = f64::from(truth[i]);
                (f64::from(result[i]) - t, f64::from(wrong[i]) - t)
            })
        };
        let (products, squares, pixels) =
            pairs().fold((0.0, 0.0, 0u64), |(p, s, k), (error, d)| (p + error * d, s + d * d, k + 1));
        if squares == 0.0 {
            return None;
        }
        let share = products / squares;
        let scatter: f64 = pairs().map(|(error, d)| (d * (error - share * d)).powi(2)).sum();
        // one number was fitted; one pixel says nothing about its own noise
        let freedom = pixels as f64 / (pixels as f64 - 1.0);
        let standard_error = if pixels > 1 { (freedom * scatter).sqrt() / squares } else { f64::INFINITY };
        Some(Self { share, standard_error, pixels, contrast: squares / pixels as f64 })
    }
}

/// [`Residual::share`] alone; NaN where there is none.
pub fn residual(result: &[f32], truth: &[f32], wrong: &[f32], mask: Option<&[f32]>) -> f64 {
    Residual::from_images(result, truth, wrong, mask).map_or(f64::NAN, |r| r.share)
}

/// How a sudden change fades in: the residual of each frame from the first that sees the change
/// (frame 0) on. Before it, the residual was 1.
#[derive(Clone, Debug, PartialEq)]
pub struct LagCurve {
    residuals: Vec<f64>,
}

impl LagCurve {
    /// Residual below which the old image counts as gone.
    pub const GONE: f64 = 0.05;

    /// A curve of the residual of each frame.
    pub fn new(residuals: Vec<f64>) -> Self {
        Self { residuals }
    }

    /// The residual of each frame.
    pub fn residuals(&self) -> &[f64] {
        &self.residuals
    }

    /// Frames in which half of the old is forgotten, at the rate of the first frame: ln 2 /
    /// -ln(g0). Below 1 where less than half is left after one frame; 0 where nothing is; infinite
    /// where the first frame forgets nothing; NaN for no frames.
    pub fn half_life(&self) -> f64 {
        self.residuals.first().map_or(f64::NAN, |&g| half_life(-ln_above_zero(g)))
    }

    /// As [`LagCurve::half_life`], at the rate that fits all frames before the first below
    /// [`LagCurve::GONE`], by least squares of ln(g) through 1 at the frame before the change. For
    /// curves that are no single exponential, such as those of pipelines that answer a frame late.
    /// That of the first frame alone where it is below already.
    pub fn fitted_half_life(&self) -> f64 {
        let lasting: Vec<f64> = self.residuals.iter().copied().take_while(|g| g.is_nan() || *g >= Self::GONE).collect();
        if lasting.is_empty() {
            return self.half_life();
        }
        let ages = || (1..=lasting.len()).map(|k| k as f64);
        let products: f64 = ages().zip(&lasting).map(|(age, &g)| age * ln_above_zero(g)).sum();
        half_life(-products / ages().map(|age| age * age).sum::<f64>())
    }

    /// The first frame at which no more than [`LagCurve::GONE`] of the old is there, of either
    /// sign; 0 = it was never seen.
    pub fn gone(&self) -> Option<usize> {
        self.residuals.iter().position(|g| g.abs() < Self::GONE)
    }
}

/// Logarithm; minus infinity of what is not above 0.
fn ln_above_zero(g: f64) -> f64 {
    if g <= 0.0 { f64::NEG_INFINITY } else { g.ln() }
}

/// Half-life of a value that falls as exp(-rate t).
fn half_life(rate: f64) -> f64 {
    if rate <= 0.0 { f64::INFINITY } else { std::f64::consts::LN_2 / rate }
}

/// Ghosting energy of a sequence, frame by frame: the mean over frames and pixels of (g d)^2, what
/// the old adds to the squared error of the new. Its unit is that of the image, squared.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ghosting {
    sum: f64,
    pixels: u64,
}

impl Ghosting {
    /// Adds a frame; arguments as those of [`Residual::from_images`]. A frame without anything to
    /// forget adds pixels and no ghost; one whose sizes differ makes the energy NaN. Returns the
    /// residual of the frame.
    pub fn add(&mut self, result: &[f32], truth: &[f32], wrong: &[f32], mask: Option<&[f32]>) -> Option<Residual> {
        let found = Residual::from_images(result, truth, wrong, mask);
        match found {
            Some(r) => {
                self.sum += r.share * r.share * r.contrast * r.pixels as f64;
                self.pixels += r.pixels;
            }
            None if result.len() == truth.len()
                && result.len() == wrong.len()
                && mask.is_none_or(|m| m.len() == result.len()) =>
            {
                self.pixels += mask.map_or(result.len(), |m| m.iter().filter(|v| **v > 0.0).count()) as u64;
            }
            None => self.sum = f64::NAN,
        }
        found
    }

    /// Adds the share of `wrong`, what was right before a change, in an image. `settled` is its
    /// final state, whose errors are no ghosts. `mask`: a value per pixel, above 0 where pixels
    /// take part, for all of their channels. `None` where nothing differs.
    pub fn add_beside(
        &mut self,
        (image, settled): (&[f32], &[f32]),
        (truth, wrong): (&[f32], &[f32]),
        mask: Option<&[f32]>,
    ) -> Option<Residual> {
        // as if it settled at the truth
        let shifted: Vec<f32> = image.iter().zip(settled).zip(truth).map(|((v, s), t)| v - s + t).collect();
        // a value a channel
        let mask: Option<Vec<f32>> = mask.map(|mask| {
            let channels = image.len() / mask.len().max(1);
            mask.iter().flat_map(|&m| std::iter::repeat_n(m, channels)).collect()
        });
        self.add(&shifted, truth, wrong, mask.as_deref())
    }

    /// Mean so far; NaN for no pixels.
    pub fn energy(&self) -> f64 {
        self.sum / self.pixels as f64
    }
}

/// Frames that pixels take to recover after they came into sight: the first frame from which on
/// every error stays within `tolerance` times `settled_error`. `errors_per_frame` starts at the
/// frame that shows them first, so 0 = they were never worse. `tolerance` is at least 1 (1.1: a
/// tenth more). `None` where the last error is still above, or there is none.
pub fn recovery(errors_per_frame: &[f64], settled_error: f64, tolerance: f64) -> Option<usize> {
    // NaN is never within
    let within = |e: &f64| *e <= settled_error * tolerance;
    let held = errors_per_frame.iter().rev().take_while(|e| within(e)).count();
    (held > 0).then(|| errors_per_frame.len() - held)
}

/// Does a number that should stay the same move over a long run? A line by least squares through
/// one value a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Change a frame.
    pub slope: f64,
    /// Standard error of the slope. Frames that share history are no independent samples; what the
    /// residuals of neighbouring frames have in common widens it, as for noise of first order.
    pub standard_error: f64,
    /// Correlation of the residuals of neighbouring frames, in [-1, 1].
    pub correlation: f64,
}

impl Drift {
    /// Standard errors within which a slope counts as none.
    pub const SIGMAS: f64 = 3.0;

    /// Fits one value a frame, three at least; `None` for fewer.
    pub fn from_values(values: &[f64]) -> Option<Self> {
        let n = values.len() as f64;
        if values.len() < 3 {
            return None;
        }
        let mean = values.iter().sum::<f64>() / n;
        let middle = (n - 1.0) / 2.0;
        // frames from the middle, values from the mean
        let points = || values.iter().enumerate().map(|(t, v)| (t as f64 - middle, v - mean));
        let spread: f64 = points().map(|(t, _)| t * t).sum();
        let slope = points().map(|(t, v)| t * v).sum::<f64>() / spread;
        let left: Vec<f64> = points().map(|(t, v)| v - slope * t).collect();
        let squares: f64 = left.iter().map(|e| e * e).sum();
        let neighbours: f64 = left.windows(2).map(|e| e[0] * e[1]).sum();
        let correlation = if squares > 0.0 { neighbours / squares } else { 0.0 };
        // of noise of first order a frame is worth (1 - r) / (1 + r) samples; near 1 the run is too
        // short to tell it from drift
        let r = correlation.clamp(0.0, 0.99);
        let standard_error = (squares / (n - 2.0) / spread * (1.0 + r) / (1.0 - r)).sqrt();
        Some(Self { slope, standard_error, correlation })
    }

    /// Does no slope lie within [`Drift::SIGMAS`] standard errors?
    pub fn is_level(&self) -> bool {
        self.slope.abs() <= Self::SIGMAS * self.standard_error
    }
}
