//! Sums over pixels that give ambient colours and errors for many radii and falloffs in one pass.
//!
//! The ambient radiance A of a channel minimizes the mean of (A x - g)^2, x the light that surfaces
//! reflect of an ambient radiance of 1 and g the target: A = sum(x g) / sum(x x). Both have noise,
//! in two independent halves a and b. Products of different halves have the expected value of
//! converged images, so noise adds nothing to errors. A signal that is hardly there (a radius that
//! nothing is nearer than) has a sum of squares of mere noise, of either sign, and would explain
//! anything: such sums explain nothing ([`CERTAIN`]).

use std::ops::{AddAssign, Sub};

use rayon::prelude::*;

use super::samples::{Falloff, Samples, reflects};
use crate::integrators::ao::Occlusion;

/// Groups of image tiles, each of which is left out once to estimate standard errors (jackknife).
pub const GROUPS: usize = 8;
/// Tiles in a row of an image that are divided into groups.
const TILES: usize = 20;
/// Maximum number of channels.
const CHANNELS: usize = 3;
/// Standard errors by which the sum of squares of a signal must exceed 0 to be one.
const CERTAIN: f64 = 4.0;

/// The target of ambient light: an image in two halves, and the pixels that count.
pub struct Target {
    /// 1 (ambient visibility) or 3 (linear RGB radiance).
    pub channels: usize,
    /// Values of all pixels, channels interleaved.
    pub halves: [Vec<f32>; 2],
    /// Indices of the pixels that count.
    pub pixels: Vec<usize>,
    /// Width of the image in pixels.
    pub width: usize,
}

/// Sums of products of a signal x and a target g, by channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// Sum of x g.
    pub xg: [f64; CHANNELS],
    /// Sum of x^2.
    pub xx: [f64; CHANNELS],
    /// Variance of that sum by the noise of x.
    pub xx_variance: [f64; CHANNELS],
}

impl Sums {
    /// Adds a pair of values, each in two halves.
    fn add(&mut self, channel: usize, [xa, xb]: [f32; 2], [ga, gb]: [f32; 2]) {
        self.xg[channel] += 0.5 * (f64::from(xa) * f64::from(gb) + f64::from(xb) * f64::from(ga));
        self.xx[channel] += f64::from(xa) * f64::from(xb);
        // expected square of mean times difference of the halves: the variance of their product
        self.xx_variance[channel] += (0.5 * (f64::from(xa) * f64::from(xa) - f64::from(xb) * f64::from(xb))).powi(2);
    }

    /// The ambient radiance of least error, not negative; 0 where the signal is no more than noise.
    pub fn ambient(&self) -> [f64; CHANNELS] {
        let is_certain = |c: usize| self.xx[c] > CERTAIN * self.xx_variance[c].sqrt();
        [0, 1, 2].map(|c| if is_certain(c) { (self.xg[c] / self.xx[c]).max(0.0) } else { 0.0 })
    }

    /// The decrease of the target's sum of squares by the best ambient radiance.
    pub fn explained(&self) -> f64 {
        let ambient = self.ambient();
        (0..CHANNELS).map(|c| ambient[c] * self.xg[c]).sum()
    }
}

impl AddAssign for Sums {
    fn add_assign(&mut self, other: Self) {
        for c in 0..CHANNELS {
            self.xg[c] += other.xg[c];
            self.xx[c] += other.xx[c];
            self.xx_variance[c] += other.xx_variance[c];
        }
    }
}

impl Sub for Sums {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        let minus = |a: [f64; CHANNELS], b: [f64; CHANNELS]| [0, 1, 2].map(|c| a[c] - b[c]);
        Self {
            xg: minus(self.xg, other.xg),
            xx: minus(self.xx, other.xx),
            xx_variance: minus(self.xx_variance, other.xx_variance),
        }
    }
}

impl Target {
    /// A target of at most about `most` pixels, spread over the image.
    pub fn thinned(&self, most: usize) -> Self {
        // an odd step does not follow the columns of an image
        let step = self.pixels.len().div_ceil(most.max(1)) | 1;
        let pixels = self.pixels.iter().copied().step_by(step).collect();
        Self { channels: self.channels, halves: self.halves.clone(), pixels, width: self.width }
    }

    /// The group of a pixel.
    fn group(&self, pixel: usize) -> usize {
        let side = self.width.div_ceil(TILES);
        let (x, y) = (pixel % self.width / side, pixel / self.width / side);
        // neighbours in a row and in a column are in different groups
        (x + 3 * y) % GROUPS
    }

    /// Number of values that count: pixels times channels.
    pub fn values(&self) -> f64 {
        (self.pixels.len() * self.channels) as f64
    }

    /// Values of a pixel's channel in both halves.
    fn value(&self, pixel: usize, channel: usize) -> [f32; 2] {
        [0, 1].map(|h| self.halves[h][self.channels * pixel + channel])
    }

    /// Sum of squares of the target.
    pub fn energy(&self) -> f64 {
        self.product(&self.halves, &self.halves)
    }

    /// Sum of products of two images over the pixels that count, each in two independent halves.
    pub fn product(&self, x: &[Vec<f32>; 2], y: &[Vec<f32>; 2]) -> f64 {
        let of = |k: usize| 0.5 * (f64::from(x[0][k]) * f64::from(y[1][k]) + f64::from(x[1][k]) * f64::from(y[0][k]));
        self.pixels.iter().flat_map(|p| (0..self.channels).map(move |c| self.channels * p + c)).map(of).sum()
    }

    /// Sums with a signal that is given as an image in two halves.
    pub fn sums(&self, x: &[Vec<f32>; 2]) -> Sums {
        let mut sums = Sums::default();
        for &p in &self.pixels {
            for c in 0..self.channels {
                let k = self.channels * p + c;
                sums.add(c, [x[0][k], x[1][k]], self.value(p, c));
            }
        }
        sums
    }

    /// Standard error of the mean of both halves: root mean square over the values that count.
    pub fn standard_error(&self) -> f64 {
        let squares: f64 = self
            .pixels
            .iter()
            .flat_map(|&p| (0..self.channels).map(move |c| (p, c)))
            .map(|(p, c)| {
                let [a, b] = self.value(p, c);
                (f64::from(a) - f64::from(b)).powi(2)
            })
            .sum();
        0.5 * (squares / self.values().max(1.0)).sqrt()
    }
}

/// Sums for each falloff and radius of a grid, by group.
#[derive(Clone, Debug)]
pub struct Table {
    /// Base 2 logarithms of the falloffs, per scene unit; 0 is binary.
    pub falloffs: Vec<f64>,
    /// Radii in ascending order, scene units; the last may be infinite.
    pub radii: Vec<f64>,
    sums: Vec<Sums>,
}

impl Table {
    fn new(falloffs: &[f64], radii: &[f64]) -> Self {
        let sums = vec![Sums::default(); GROUPS * falloffs.len() * radii.len()];
        Self { falloffs: falloffs.to_vec(), radii: radii.to_vec(), sums }
    }

    fn index(&self, group: usize, falloff: usize, radius: usize) -> usize {
        (group * self.falloffs.len() + falloff) * self.radii.len() + radius
    }

    /// Sums over all groups but `without`.
    pub fn sums(&self, falloff: usize, radius: usize, without: Option<usize>) -> Sums {
        let mut all = Sums::default();
        (0..GROUPS).filter(|g| Some(*g) != without).for_each(|g| all += self.sums[self.index(g, falloff, radius)]);
        all
    }

    /// Evaluates all radii and falloffs of a grid in one pass over the samples.
    pub fn evaluate(samples: &Samples, target: &Target, falloffs: &[f64], radii: &[f64]) -> Self {
        let chunk = target.pixels.len().div_ceil(4 * rayon::current_num_threads()).max(256);
        let parts = target.pixels.par_chunks(chunk).map(|pixels| {
            let mut table = Self::new(falloffs, radii);
            let mut pixel_sums = PixelSums::new(samples, falloffs, radii);
            pixels.iter().for_each(|&p| pixel_sums.add(&mut table, samples, target, p));
            table
        });
        let mut table = Self::new(falloffs, radii);
        // in their order, so that sums are the same from run to run
        for part in parts.collect::<Vec<_>>() {
            table.sums.iter_mut().zip(part.sums).for_each(|(sum, part)| *sum += part);
        }
        table
    }
}

/// Evaluation of one pixel, with memory that pixels share.
struct PixelSums {
    falloffs: Vec<Falloff>,
    radii: Vec<f32>,
    /// For each sample of each half, the first radius larger than the distance of its hit.
    first: [Vec<usize>; 2],
    /// Light that occluders between two radii take away, by half.
    taken: [Vec<[f32; CHANNELS]>; 2],
}

impl PixelSums {
    fn new(samples: &Samples, falloffs: &[f64], radii: &[f64]) -> Self {
        let unlimited = |log2: &f64| Falloff::new(Occlusion::new(f64::INFINITY, log2.exp2()));
        let first = || vec![0; samples.per_half()];
        let taken = || vec![[0.0; CHANNELS]; radii.len() + 1];
        Self {
            falloffs: falloffs.iter().map(unlimited).collect(),
            radii: radii.iter().map(|r| *r as f32).collect(),
            first: [first(), first()],
            taken: [taken(), taken()],
        }
    }

    fn add(&mut self, table: &mut Table, samples: &Samples, target: &Target, pixel: usize) {
        let halves = [0, 1].map(|h| samples.pixel_samples(h, pixel));
        let scale = 1.0 / samples.per_half() as f32;
        let group = target.group(pixel);
        let weights = |s: &crate::integrators::path::ambient::AmbientSample| match target.channels {
            1 => [scale, 0.0, 0.0],
            _ => s.reflectance.map(|c| c * scale),
        };

        // Finds the first radius that each sample's hit is within, and light beyond all.
        let mut unhit = [[0.0f32; CHANNELS]; 2];
        for (h, samples) in halves.iter().enumerate() {
            for (k, s) in samples.iter().enumerate() {
                self.first[h][k] = if reflects(s) && s.distance.is_finite() {
                    self.radii.partition_point(|r| *r <= s.distance)
                } else {
                    self.radii.len()
                };
                if self.first[h][k] == self.radii.len() {
                    let w = weights(s);
                    (0..CHANNELS).for_each(|c| unhit[h][c] += w[c]);
                }
            }
        }

        // Adds up light from the largest radius down, so that it is 0 where hits occlude all.
        for (f, falloff) in self.falloffs.iter().enumerate() {
            let mut left = unhit;
            for (h, samples) in halves.iter().enumerate() {
                self.taken[h].fill([0.0; CHANNELS]);
                for (s, &first) in samples.iter().zip(&self.first[h]) {
                    if first < self.radii.len() {
                        let (w, occlusion) = (weights(s), falloff.occlusion(s.distance));
                        (0..CHANNELS).for_each(|c| {
                            self.taken[h][first][c] += w[c] * occlusion;
                            left[h][c] += w[c] * (1.0 - occlusion);
                        });
                    }
                }
            }
            let row = table.index(group, f, 0);
            for r in (0..self.radii.len()).rev() {
                let sums = &mut table.sums[row + r];
                (0..target.channels).for_each(|c| {
                    sums.add(c, [left[0][c], left[1][c]], target.value(pixel, c));
                    // a smaller radius lets through what hits at this one take away
                    (0..2).for_each(|h| left[h][c] += self.taken[h][r][c]);
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrators::path::ambient::AmbientSample;

    /// A scatter of samples, the same in each run.
    fn scattered(pixels: usize, per_half: u32) -> Samples {
        let mut samples = Samples::new(pixels, per_half).unwrap();
        let mut state = 1u32;
        let mut random = || {
            state = crate::sampling::sobol::hash(state.wrapping_add(0x9e37_79b9));
            crate::sampling::sobol::to_unit(state)
        };
        for half in 0..2 {
            for pixel in 0..pixels {
                for _ in 0..per_half {
                    let distance = if random() < 0.3 { f32::INFINITY } else { random() * 10.0 };
                    samples.add(
                        half,
                        pixel,
                        &[AmbientSample { reflectance: [random(), random(), random()], distance }],
                    );
                }
            }
        }
        samples
    }

    /// The table is what evaluating each radius and falloff by itself gives.
    #[test]
    fn tables_agree_with_images() {
        let samples = scattered(300, 4);
        let goal = samples.ambient(Occlusion::new(3.0, 1.2));
        let target = Target { channels: 3, halves: goal, pixels: (0..300).step_by(3).collect(), width: 100 };
        let (falloffs, radii) = ([0.0, 0.5, 1.2f64.log2()], [1.0, 3.0, f64::INFINITY]);
        let table = Table::evaluate(&samples, &target, &falloffs, &radii);
        for (f, log2) in falloffs.iter().enumerate() {
            for (r, radius) in radii.iter().enumerate() {
                let occlusion = Occlusion::new(*radius, log2.exp2());
                let (a, b) = (table.sums(f, r, None), target.sums(&samples.ambient(occlusion)));
                for c in 0..3 {
                    assert!((a.xx[c] - b.xx[c]).abs() < 1e-4 * b.xx[c], "{occlusion:?}");
                    assert!((a.xg[c] - b.xg[c]).abs() < 1e-4 * b.xg[c], "{occlusion:?}");
                }
            }
        }
        let exact = table.sums(2, 1, None);
        assert!(exact.ambient().iter().all(|a| (a - 1.0).abs() < 1e-4), "{:?}", exact.ambient());
        assert!((target.energy() - exact.explained()).abs() < 1e-4 * target.energy());
        // groups make up the whole
        let mut sum = Sums::default();
        (0..GROUPS).for_each(|g| sum += table.sums(0, 0, None) - table.sums(0, 0, Some(g)));
        assert!((sum.xg[0] - table.sums(0, 0, None).xg[0]).abs() < 1e-9 * sum.xg[0]);
    }

    /// Where every ray is occluded nothing is left, not even rounding.
    #[test]
    fn what_is_occluded_is_black() {
        let samples = scattered(300, 7);
        let image = [0, 1].map(|half| {
            let hits = |p: usize| {
                samples.pixel_samples(half, p).iter().filter(|s| s.distance.is_finite()).copied().collect::<Vec<_>>()
            };
            (0..300).map(hits).collect::<Vec<_>>()
        });
        let most = image.iter().flatten().map(Vec::len).max().unwrap();
        let mut occluded = Samples::new(300, most as u32).unwrap();
        for (half, pixels) in image.iter().enumerate() {
            pixels.iter().enumerate().for_each(|(p, hits)| occluded.add(half, p, hits));
        }
        let ones = [0, 1].map(|_| vec![1.0; 900]);
        let target = Target { channels: 3, halves: ones, pixels: (0..300).collect(), width: 100 };
        let table = Table::evaluate(&occluded, &target, &[0.0], &[1.0, 10.0, 20.0, f64::INFINITY]);
        assert!(table.sums(0, 0, None).explained() > 0.0);
        (1..4).for_each(|r| assert_eq!(table.sums(0, r, None), Sums::default(), "{r}"));
    }

    /// Two halves that hardly ever meet: by their one common pixel they would explain too much.
    #[test]
    fn a_signal_that_is_noise_explains_nothing() {
        let n = 10_000;
        let half = |h: usize| (0..n).map(|k| f32::from(u8::from(k % 100 == h || k == 5))).collect::<Vec<f32>>();
        let ones = [0, 1].map(|_| vec![1.0; n]);
        let target = Target { channels: 1, halves: ones, pixels: (0..n).collect(), width: 100 };
        let sums = target.sums(&[half(0), half(1)]);
        assert!(sums.xx[0] == 1.0 && sums.xg[0].powi(2) / sums.xx[0] > target.energy(), "{sums:?}");
        assert_eq!((sums.ambient(), sums.explained()), ([0.0; 3], 0.0));
        // a tenth of the pixels, in both halves: that is no noise
        let tenth = [0, 1].map(|_| (0..n).map(|k| f32::from(u8::from(k % 10 == 0))).collect::<Vec<f32>>());
        assert!((target.sums(&tenth).explained() / target.energy() - 0.1).abs() < 1e-9);
    }

    /// Noise of the target does not change the error on average.
    #[test]
    fn noise_is_no_error() {
        let n = 60_000;
        let mut state = 7u32;
        let mut noise = || {
            state = crate::sampling::sobol::hash(state.wrapping_add(0x9e37_79b9));
            crate::sampling::sobol::to_unit(state) - 0.5
        };
        let signal: Vec<f32> = (0..n).map(|k| (k % 100) as f32 / 100.0).collect();
        let mut noisy = |scale: f32| -> Vec<f32> { signal.iter().map(|s| scale * s + noise()).collect() };
        let target = Target { channels: 1, halves: [noisy(2.0), noisy(2.0)], pixels: (0..n).collect(), width: 300 };
        let sums = target.sums(&[noisy(1.0), noisy(1.0)]);
        let mse = (target.energy() - sums.explained()) / target.values();
        assert!((sums.ambient()[0] - 2.0).abs() < 0.02 && mse.abs() < 0.01, "{:?}, {mse}", sums.ambient());
        assert!((target.standard_error() - (1.0f64 / 12.0).sqrt() / 2f64.sqrt()).abs() < 0.01);
    }
}
