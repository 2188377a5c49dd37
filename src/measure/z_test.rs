//! Whether two noisy images show the same: a Z-test of each pixel, of tiles, and of the whole
//! image's mean (Subr, Arvo 2007; Rousselle, Jarosz, Novak 2016).
//!
//! [`Estimate`] is an image with the noise of its pixels, [`Region`] a part of one; the functions
//! give scores, differences in standard errors. [`ZTest`] judges an image by them against a
//! [`Reference`], with a stated rate of false alarms:
//!
//! - **pixels**: the difference over the standard error that the variances of samples give. The
//!   variance is the larger of the image's own and the reference's: a pixel that has met a rare
//!   bright sample knows its noise, and one that has not is given that of the reference. So heavy
//!   tails make a score smaller, not larger. Stratified samples do better than this error says, so
//!   pixels err on the side of silence.
//! - **tiles** and the **mean**: the reference is a mean of renders with seeds of their own
//!   (*replicates*), which tell how far the mean over a tile moves from seed to seed: with
//!   stratified samples a fraction of what variances of samples say, which is what makes a bias of
//!   half a percent visible. The image is one more such render if nothing is wrong, so the
//!   difference over the replicates' standard deviation has Student's distribution. What samples of
//!   a pixel scatter beyond what all replicates have seen there (a firefly, [`SURPRISE`]) is added
//!   to the variance.
//!
//! The probability that chance alone would give the largest score of each of the three is corrected
//! for the number of scores, and the least of the three for their number (Sidak 1967). An alarm is
//! a probability below the rate of false alarms.

use super::distributions::{critical_value, sidak, two_sided};
use crate::error::{Error, Result};
use crate::output::{Image, Samples};

/// Side of a tile, pixels.
pub const TILE: usize = 8;
/// Share of a value that may differ without noise: rounding of drivers.
pub const ROUNDING: f64 = 2e-4;
/// A pixel whose samples scatter so many times the variance that is known of it has met what is
/// rare.
pub const SURPRISE: f64 = 3.0;
/// Standard errors by which a bias has to exceed the threshold to be detected with a probability of
/// 99.9 %.
const POWER: f64 = 3.1;
/// The least replicates from which a variance is estimated.
pub const MIN_REPLICATES: u32 = 8;

/// An image with the noise of its pixels; channels interleaved.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Number of channels.
    pub channels: usize,
    /// Means.
    pub mean: Vec<f64>,
    /// Variance of one sample of each mean.
    pub variance: Vec<f64>,
    /// Samples of each pixel.
    pub samples: Vec<f64>,
}

/// Names of the channels with values of an image that has variances: `Y`, or `R`, `G`, `B`; empty
/// for others.
pub fn channels_with_variance(image: &Image) -> Vec<(&'static str, &'static str)> {
    const GREY: [(&str, &str); 1] = [("Y", "variance")];
    const COLOUR: [(&str, &str); 3] = [("R", "variance.R"), ("G", "variance.G"), ("B", "variance.B")];
    let has = |names: &[(&str, &str)]| names.iter().all(|(a, b)| image.f32(a).is_some() && image.f32(b).is_some());
    [&GREY[..], &COLOUR].into_iter().find(|names| has(names)).map(<[_]>::to_vec).unwrap_or_default()
}

impl Estimate {
    /// The estimate of an image that holds means, variances of one sample, and numbers of samples,
    /// as stills do.
    ///
    /// # Errors
    /// [`Error::Usage`] for images without them, such as frames in real time.
    pub fn from_image(image: &Image) -> Result<Self> {
        let names = channels_with_variance(image);
        let samples: Option<Vec<f64>> = image.channels.iter().find(|c| c.name == "samples").map(|c| match &c.samples {
            Samples::U32(n) => n.iter().map(|&n| f64::from(n)).collect(),
            Samples::F32(n) => n.iter().map(|&n| f64::from(n)).collect(),
        });
        let (Some(samples), false) = (samples, names.is_empty()) else {
            return Err(Error::Usage(
                "a Z-test needs the channels variance and samples of stills: compare other images by FLIP".into(),
            ));
        };
        let planes = |which: fn(&(&'static str, &'static str)) -> &'static str| -> Vec<f64> {
            let planes: Vec<&[f32]> = names.iter().filter_map(|n| image.f32(which(n))).collect();
            (0..image.pixel_count()).flat_map(|p| planes.iter().map(move |plane| f64::from(plane[p]))).collect()
        };
        let size = [image.width as usize, image.height as usize];
        Ok(Self { size, channels: names.len(), mean: planes(|n| n.0), variance: planes(|n| n.1), samples })
    }

    /// Mean of each channel over the image.
    pub fn averages(&self) -> Vec<f64> {
        self.means_over(&self.mean, &[Region::whole(self.size)])
    }

    /// Means of values of this image over regions: a value for each region and channel, channels of
    /// a region together.
    pub fn means_over(&self, values: &[f64], regions: &[Region]) -> Vec<f64> {
        let mut means = Vec::with_capacity(regions.len() * self.channels);
        for region in regions {
            let pixels = region.pixels(self.size[0]);
            let count = region.count() as f64;
            means.extend(
                (0..self.channels).map(|c| pixels.clone().map(|p| values[self.channels * p + c]).sum::<f64>() / count),
            );
        }
        means
    }

    /// Difference that rounding alone may make of each value: a share of it, or of the channel's
    /// mean where that is larger.
    pub fn rounding(&self, share: f64) -> Vec<f64> {
        let averages = self.averages();
        self.mean.iter().enumerate().map(|(k, m)| share * m.abs().max(averages[k % self.channels].abs())).collect()
    }

    /// Returns this estimate with the values and variances of `other` where its own are not finite.
    fn finite_or(&self, other: &Self) -> Self {
        let mut out = self.clone();
        for k in 0..out.mean.len() {
            if !(out.mean[k].is_finite() && out.variance[k].is_finite()) {
                (out.mean[k], out.variance[k]) = (other.mean[k], other.variance[k]);
            }
        }
        out
    }

    fn check_like(&self, other: &Self) -> Result<()> {
        if (self.size, self.channels) != (other.size, other.channels) {
            let text = |e: &Self| format!("{}x{} pixels of {} channels", e.size[0], e.size[1], e.channels);
            return Err(Error::Usage(format!("the images differ: {} and {}", text(self), text(other))));
        }
        Ok(())
    }
}

/// A rectangle of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// First column and row.
    pub first: [usize; 2],
    /// Columns and rows.
    pub size: [usize; 2],
}

impl Region {
    /// All of an image.
    pub fn whole(size: [usize; 2]) -> Self {
        Self { first: [0, 0], size }
    }

    /// Squares of `side` pixels that cover an image, row by row; those at its right and lower edges
    /// may be smaller.
    pub fn tiles(size: [usize; 2], side: usize) -> Vec<Self> {
        let [across, down] = size.map(|n| n.div_ceil(side));
        let tile = |x: usize, y: usize| Self {
            first: [x * side, y * side],
            size: [side.min(size[0] - x * side), side.min(size[1] - y * side)],
        };
        (0..across * down).map(|t| tile(t % across, t / across)).collect()
    }

    /// Number of pixels.
    pub fn count(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// Indices of its pixels in an image of this width.
    pub fn pixels(&self, width: usize) -> impl Iterator<Item = usize> + Clone {
        let Self { first, size } = *self;
        (first[1]..first[1] + size[1]).flat_map(move |y| (0..size[0]).map(move |x| y * width + first[0] + x))
    }
}

/// A difference in standard errors; `rounding` is a difference that is no error. 0 for no
/// difference.
pub fn score(difference: f64, variance: f64, rounding: f64) -> f64 {
    if difference == 0.0 { 0.0 } else { difference / (variance + rounding * rounding).sqrt().max(f64::MIN_POSITIVE) }
}

/// The score of each value, image - reference.
///
/// # Errors
/// [`Error::Usage`] for images of different sizes.
pub fn pixel_scores(image: &Estimate, reference: &Estimate, rounding: &[f64]) -> Result<Vec<f64>> {
    image.check_like(reference)?;
    let value = |k: usize| {
        let p = k / image.channels;
        let known = image.variance[k].max(reference.variance[k]);
        let variance = known / image.samples[p].max(1.0) + reference.variance[k] / reference.samples[p].max(1.0);
        score(image.mean[k] - reference.mean[k], variance, rounding[k])
    };
    Ok((0..image.mean.len()).map(value).collect())
}

/// The mean of several renders of an image that differ by their seeds alone, and how far they are
/// apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// The mean of all renders.
    pub estimate: Estimate,
    /// Number of renders.
    pub replicates: u32,
    /// Variance of the mean over each of [`Region::tiles`] from render to render, channels of a
    /// tile together.
    pub tiles: Vec<f64>,
    /// Variance of the mean over the image from render to render, of each channel.
    pub whole: Vec<f64>,
}

impl Reference {
    /// Creates a reference from renders with seeds of their own and otherwise equal settings.
    ///
    /// # Errors
    /// [`Error::Usage`] for fewer than [`MIN_REPLICATES`], or renders of different sizes.
    pub fn new(renders: &[Estimate]) -> Result<Self> {
        let count = renders.len() as f64;
        let Some(first) = renders.first().filter(|_| renders.len() >= MIN_REPLICATES as usize) else {
            return Err(Error::Usage(format!("a reference image needs at least {MIN_REPLICATES} renders")));
        };
        renders.iter().try_for_each(|r| first.check_like(r))?;
        let mean_of = |values: &dyn Fn(&Estimate) -> &[f64]| -> Vec<f64> {
            (0..values(first).len()).map(|k| renders.iter().map(|r| values(r)[k]).sum::<f64>() / count).collect()
        };
        let mut samples = mean_of(&|r| &r.samples);
        samples.iter_mut().for_each(|n| *n *= count);
        let estimate =
            Estimate { mean: mean_of(&|r| &r.mean), variance: mean_of(&|r| &r.variance), samples, ..first.clone() };
        let variances = |regions: &[Region]| -> Vec<f64> {
            let means: Vec<Vec<f64>> = renders.iter().map(|r| r.means_over(&r.mean, regions)).collect();
            let variance = |k: usize| {
                let mean = means.iter().map(|m| m[k]).sum::<f64>() / count;
                means.iter().map(|m| (m[k] - mean).powi(2)).sum::<f64>() / (count - 1.0)
            };
            (0..regions.len() * first.channels).map(variance).collect()
        };
        let tiles = variances(&Region::tiles(first.size, TILE));
        let whole = variances(&[Region::whole(first.size)]);
        Ok(Self { estimate, replicates: renders.len() as u32, tiles, whole })
    }
}

/// Size of the regions that a [`ZTest`] looks at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// Each pixel.
    Pixel,
    /// Means over tiles of [`TILE`] pixels.
    Tile,
    /// The mean over the image.
    Mean,
}

/// The largest score of a scale.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Extreme {
    /// The scale.
    pub scale: Scale,
    /// Difference in standard errors, image - reference.
    pub score: f64,
    /// The probability that chance alone makes a score of this scale so large.
    pub p: f64,
    /// First column and row of the region.
    pub at: [usize; 2],
    /// Channel, counted from 0.
    pub channel: usize,
    /// Mean of image - reference there.
    pub difference: f64,
    /// Mean of the reference there.
    pub reference: f64,
}

/// The result of a Z-test.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ZTestVerdict {
    /// The probability that chance alone makes the images differ so much.
    pub p: f64,
    /// Pixels, tiles and the mean.
    pub extremes: [Extreme; 3],
    /// Mean of image - reference over that of the reference, of the channel for which it is largest
    /// in standard errors.
    pub bias: f64,
    /// Standard error of `bias`.
    pub bias_error: f64,
    /// The least bias of a channel's mean, as a share of it, that would be found with a probability
    /// of 99.9 %.
    pub detectable_bias: f64,
}

/// A test whether an image and a reference show the same.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ZTest {
    /// The probability that an image is called different though it is not, 0 to 1.
    pub false_alarms: f64,
}

impl ZTest {
    /// Does the verdict say that images show the same?
    pub fn holds(&self, verdict: &ZTestVerdict) -> bool {
        verdict.p >= self.false_alarms
    }

    /// Compares an image with a reference. Values that are not finite count as no difference here.
    ///
    /// # Errors
    /// [`Error::Usage`] for images of different sizes.
    pub fn compare(&self, image: &Estimate, reference: &Reference) -> Result<ZTestVerdict> {
        let known = &reference.estimate;
        image.check_like(known)?;
        let image = &image.finite_or(known);
        let rounding = known.rounding(ROUNDING);
        let scores = pixel_scores(image, known, &rounding)?;
        let differences: Vec<f64> = image.mean.iter().zip(&known.mean).map(|(a, b)| a - b).collect();
        let at_pixel = |k: usize| [k / known.channels % known.size[0], k / known.channels / known.size[0]];
        let pixels = extreme(Scale::Pixel, &scores, f64::INFINITY, known.channels, |k| {
            (at_pixel(k), differences[k], known.mean[k])
        });

        let surplus = surplus(image, known);
        let freedom = f64::from(reference.replicates) - 1.0;
        let spread = 1.0 + 1.0 / f64::from(reference.replicates);
        let of_regions = |scale: Scale, regions: &[Region], variances: &[f64]| {
            let [differences, means, rounding, surplus] =
                [&differences, &known.mean, &rounding, &surplus].map(|values| known.means_over(values, regions));
            let variance = |k: usize| variances[k] * spread + surplus[k] / regions[k / known.channels].count() as f64;
            let scores: Vec<f64> = (0..means.len()).map(|k| score(differences[k], variance(k), rounding[k])).collect();
            let errors: Vec<f64> = (0..means.len()).map(|k| (variance(k) + rounding[k].powi(2)).sqrt()).collect();
            let at = |k: usize| (regions[k / known.channels].first, differences[k], means[k]);
            (extreme(scale, &scores, freedom, known.channels, at), errors)
        };
        let (tiles, _) = of_regions(Scale::Tile, &Region::tiles(known.size, TILE), &reference.tiles);
        let (mean, errors) = of_regions(Scale::Mean, &[Region::whole(known.size)], &reference.whole);

        // the verdict is that of the most extreme, and of bias also what would have been found
        let extremes = [pixels, tiles, mean];
        let least = extremes.iter().map(|e| e.p).fold(1.0, f64::min);
        let share = |x: f64| if mean.reference == 0.0 { 0.0 } else { x / mean.reference.abs() };
        let needed = critical_value(self.false_alarms, 3.0 * known.channels as f64, freedom) + POWER;
        let averages = known.averages();
        let detectable = averages.iter().zip(&errors).map(|(a, e)| needed * e / a.abs().max(f64::MIN_POSITIVE));
        Ok(ZTestVerdict {
            p: sidak(least, 3.0),
            extremes,
            bias: share(mean.difference),
            bias_error: share(errors[mean.channel]),
            detectable_bias: detectable.fold(0.0, f64::max),
        })
    }
}

/// The largest of scores; `at` says where a score is, its difference and the reference's value.
fn extreme(
    scale: Scale,
    scores: &[f64],
    freedom: f64,
    channels: usize,
    at: impl Fn(usize) -> ([usize; 2], f64, f64),
) -> Extreme {
    let worst = (0..scores.len()).max_by(|&a, &b| scores[a].abs().total_cmp(&scores[b].abs())).unwrap_or(0);
    let score = scores[worst];
    let (at, difference, reference) = at(worst);
    let p = sidak(two_sided(score, freedom), scores.len() as f64);
    Extreme { scale, score, p, at, channel: worst % channels, difference, reference }
}

/// The variance of each mean of an image that its reference knows nothing of: of pixels whose
/// samples scatter [`SURPRISE`] times as much as the reference's.
fn surplus(image: &Estimate, known: &Estimate) -> Vec<f64> {
    let value = |k: usize| {
        let (own, before) = (image.variance[k], known.variance[k]);
        if own > SURPRISE * before { (own - before) / image.samples[k / image.channels].max(1.0) } else { 0.0 }
    };
    (0..image.mean.len()).map(value).collect()
}
