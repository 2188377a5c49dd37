//! Occlusion rays of an image, traced once for all radii and falloffs.

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::integrators::ao::Occlusion;
use crate::integrators::path::ambient::AmbientSample;

/// Maximum memory of samples, bytes.
const MAX_BYTES: u64 = 4 << 30;

/// Samples of each pixel, in two independent halves.
pub struct Samples {
    per_half: usize,
    halves: [Vec<AmbientSample>; 2],
    /// Samples of each pixel so far.
    counts: [Vec<u32>; 2],
}

impl Samples {
    /// Memory for `per_half` samples of each pixel in each half.
    ///
    /// # Errors
    /// [`Error::Usage`] for more samples than fit into memory.
    pub fn new(pixels: usize, per_half: u32) -> Result<Self> {
        let bytes = 2 * pixels as u64 * u64::from(per_half) * size_of::<AmbientSample>() as u64;
        if bytes > MAX_BYTES {
            let gib = |b: u64| b as f64 / (1u64 << 30) as f64;
            return Err(Error::Usage(format!(
                "--ao-samples: the samples take {:.1} GiB, and {:.0} are allowed: give fewer, or a smaller --size",
                gib(bytes),
                gib(MAX_BYTES)
            )));
        }
        let half = || vec![AmbientSample::default(); pixels * per_half as usize];
        Ok(Self { per_half: per_half as usize, halves: [half(), half()], counts: [vec![0; pixels], vec![0; pixels]] })
    }

    /// Adds samples of a pixel to a half, 0 or 1; what is more than the half holds is ignored.
    pub fn add(&mut self, half: usize, pixel: usize, samples: &[AmbientSample]) {
        let count = &mut self.counts[half][pixel];
        let n = samples.len().min(self.per_half - *count as usize);
        let begin = pixel * self.per_half + *count as usize;
        self.halves[half][begin..begin + n].copy_from_slice(&samples[..n]);
        *count += n as u32;
    }

    pub fn pixels(&self) -> usize {
        self.counts[0].len()
    }

    /// Samples of a pixel in each half.
    pub fn per_half(&self) -> usize {
        self.per_half
    }

    /// Samples of a pixel in a half.
    pub fn pixel_samples(&self, half: usize, pixel: usize) -> &[AmbientSample] {
        &self.halves[half][pixel * self.per_half..(pixel + 1) * self.per_half]
    }

    /// All samples of a pixel.
    fn all_of(&self, pixel: usize) -> impl Iterator<Item = &AmbientSample> {
        self.pixel_samples(0, pixel).iter().chain(self.pixel_samples(1, pixel))
    }

    /// Pixels that show a surface, wherever in their area.
    pub fn covered(&self) -> Vec<usize> {
        (0..self.pixels()).filter(|&p| self.all_of(p).any(|s| s.distance > 0.0)).collect()
    }

    /// Pixels that show nothing but surfaces that reflect ambient light.
    pub fn diffuse(&self) -> Vec<usize> {
        (0..self.pixels()).filter(|&p| self.all_of(p).all(reflects)).collect()
    }

    /// A value of each pixel in each half: `of` of its samples, `channels` of them.
    fn image(&self, channels: usize, of: impl Fn(&[AmbientSample], &mut [f32]) + Sync) -> [Vec<f32>; 2] {
        [0, 1].map(|half| {
            let mut out = vec![0.0; channels * self.pixels()];
            out.par_chunks_exact_mut(channels)
                .enumerate()
                .for_each(|(pixel, out)| of(self.pixel_samples(half, pixel), out));
            out
        })
    }

    /// Ambient light of radiance 1 that surfaces reflect, linear RGB, without occlusion.
    pub fn reflectance(&self) -> [Vec<f32>; 2] {
        self.image(3, |samples, out| {
            let n = samples.len() as f32;
            (0..3).for_each(|c| out[c] = samples.iter().map(|s| s.reflectance[c]).sum::<f32>() / n);
        })
    }

    /// Ambient light of radiance 1 that surfaces reflect, linear RGB.
    pub fn ambient(&self, occlusion: Occlusion) -> [Vec<f32>; 2] {
        let falloff = Falloff::new(occlusion);
        self.image(3, |samples, out| {
            let n = samples.len() as f32;
            for s in samples {
                let visibility = 1.0 - falloff.occlusion(s.distance);
                (0..3).for_each(|c| out[c] += s.reflectance[c] * visibility / n);
            }
        })
    }

    /// Ambient visibility. Samples of surfaces that reflect no ambient light count 0.
    pub fn visibility(&self, occlusion: Occlusion) -> [Vec<f32>; 2] {
        let falloff = Falloff::new(occlusion);
        self.image(1, |samples, out| {
            let open = samples.iter().filter(|s| reflects(s)).map(|s| 1.0 - falloff.occlusion(s.distance)).sum::<f32>();
            out[0] = open / samples.len() as f32;
        })
    }
}

/// Whether the surface of a sample reflects ambient light, so that the sample has an occlusion ray.
pub fn reflects(sample: &AmbientSample) -> bool {
    sample.reflectance.iter().any(|&c| c > 0.0)
}

/// Occlusion by distance.
#[derive(Clone, Copy, Debug)]
pub struct Falloff {
    log2: f32,
    reach: f32,
}

impl Falloff {
    /// That of a radius and falloff.
    pub fn new(occlusion: Occlusion) -> Self {
        Self { log2: occlusion.falloff_log2() as f32, reach: occlusion.reach() as f32 }
    }

    /// Occlusion of a hit at a distance; infinite distances are misses.
    pub fn occlusion(self, distance: f32) -> f32 {
        if distance >= self.reach || distance.is_nan() {
            0.0
        } else if self.log2 == 0.0 {
            1.0
        } else {
            (-distance * self.log2).exp2()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_what_integrators_make_of_them() {
        let mut samples = Samples::new(3, 2).unwrap();
        let hit = |distance| AmbientSample { reflectance: [0.5, 0.25, 0.0], distance };
        // a mirror has no ray, and a miss neither
        let mirror = AmbientSample { reflectance: [0.0; 3], distance: 1.0 };
        for half in 0..2 {
            samples.add(half, 0, &[hit(1.0)]);
            samples.add(half, 0, &[hit(f32::INFINITY), hit(9.0)]);
            samples.add(half, 1, &[mirror, hit(3.0)]);
        }
        assert_eq!((samples.covered(), samples.diffuse()), (vec![0, 1], vec![0]));
        let binary = |radius| Occlusion::new(radius, 1.0);
        assert_eq!(samples.visibility(binary(1.0))[1][0], 1.0);
        assert_eq!(samples.visibility(binary(1.5))[0][0], 0.5);
        assert_eq!(samples.ambient(binary(1.5))[0][..3], [0.25, 0.125, 0.0]);
        assert_eq!(samples.ambient(binary(1.5))[0][3..6], [0.25, 0.125, 0.0]);
        assert_eq!(samples.reflectance()[0][3..6], [0.25, 0.125, 0.0]);
        // half of the hit at distance 1 counts
        let halves = Occlusion::new(f64::INFINITY, 2.0);
        assert!((samples.visibility(halves)[0][0] - 0.75).abs() < 1e-6);
    }

    #[test]
    fn too_many_samples_are_refused() {
        let error = Samples::new(1 << 24, 1 << 10).map(drop).unwrap_err();
        assert!(error.exit_code() == 64 && error.to_string().contains("--ao-samples"), "{error}");
    }
}
