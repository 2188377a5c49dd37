//! Sample sequences for real-time rendering with few samples per frame: how the error is
//! distributed over pixels and frames decides how much of it a spatio-temporal filter removes.
//!
//! Integer arithmetic: shaders/common/sequence.glsl has the same functions, equal bit for bit.

use super::morton::morton;
pub use crate::interface::Sequence;

use super::sobol::{AO_DIRECTION, Sampler, hash_combine, owen_scramble, sobol_2d, to_unit};

/// 2^32 / g and 2^32 / g^2, where g^3 = g + 1.
const R2_STEP: [u32; 2] = [3_242_174_889, 2_447_445_414];

impl Sequence {
    /// Convergence exponent e beyond that of random sampling: the variance of the mean of n samples
    /// of a smooth function falls as n^-(1 + e). Measured (docs/design/real-time.md).
    pub fn evenness(self) -> f32 {
        match self {
            Sequence::Sobol => 0.375,
            Sequence::Blue => 0.25,
        }
    }

    /// Sample `index` of the `count` that `pixel` takes in a frame, as fractions of 2^32. The
    /// sequence continues from frame to frame.
    pub fn get_2d(self, seed: u32, pixel: [u32; 2], frame: u32, index: u32, count: u32) -> [u32; 2] {
        match self {
            Sequence::Sobol => {
                let n = frame.wrapping_mul(count).wrapping_add(index);
                Sampler { seed }.get_2d(pixel, n, AO_DIRECTION)
            }
            Sequence::Blue => {
                let seed = hash_combine(seed, AO_DIRECTION);
                let [x, y] = sobol_2d(owen_scramble(morton(pixel), seed).wrapping_mul(count).wrapping_add(index));
                let p = [owen_scramble(x, hash_combine(seed, 0)), owen_scramble(y, hash_combine(seed, 1))];
                std::array::from_fn(|k| p[k].wrapping_add(frame.wrapping_mul(R2_STEP[k])))
            }
        }
    }

    /// [`Sequence::get_2d`] as fractions in [0, 1).
    pub fn get_2d_unit(self, seed: u32, pixel: [u32; 2], frame: u32, index: u32, count: u32) -> [f32; 2] {
        self.get_2d(seed, pixel, frame, index, count).map(to_unit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a set, by cell of a grid of `n` x `n`.
    fn counts(points: impl Iterator<Item = [u32; 2]>, n: u64) -> Vec<u32> {
        let mut out = vec![0; (n * n) as usize];
        for [x, y] in points {
            let at = |v: u32| (u64::from(v) * n) >> 32;
            out[(at(y) * n + at(x)) as usize] += 1;
        }
        out
    }

    #[test]
    fn each_sequence_stratifies_what_it_says() {
        let ones = vec![1; 16];
        for pixel in [[3, 5], [100, 7]] {
            for first in [0, 2] {
                let frames = |s: Sequence| (first * 16..first * 16 + 16).map(move |f| s.get_2d(9, pixel, f, 0, 1));
                assert_eq!(counts(frames(Sequence::Sobol), 4), ones);
                // four samples of four frames, likewise
                let four = (0..16).map(|k| Sequence::Sobol.get_2d(9, pixel, 4 * first + k / 4, k % 4, 4));
                assert_eq!(counts(four, 4), ones);
            }
        }
        // an aligned square of four by four pixels, in the first frame; later ones are shifted and
        // stay as even
        for corner in [[0, 0], [8, 4], [640, 352]] {
            let square = |frame| {
                (0..16u32).map(move |k| Sequence::Blue.get_2d(1, [corner[0] + k % 4, corner[1] + k / 4], frame, 0, 1))
            };
            assert_eq!(counts(square(0), 4), ones);
            let first: Vec<_> = square(0).collect();
            for (a, b) in first.iter().zip(square(7)) {
                assert_eq!([0, 1].map(|k| b[k].wrapping_sub(a[k])), [0, 1].map(|k| 7u32.wrapping_mul(R2_STEP[k])));
            }
        }
    }

    #[test]
    fn the_steps_are_powers_of_the_plastic_number() {
        let g = 1.324_717_957_244_746_f64;
        assert!((g * g * g - g - 1.0).abs() < 1e-14);
        for (k, step) in R2_STEP.into_iter().enumerate() {
            let exact = 2f64.powi(32) / g.powi(k as i32 + 1);
            assert!((f64::from(step) - exact).abs() < 1.0, "{step} {exact}");
        }
    }

    #[test]
    fn means_are_right() {
        for s in Sequence::ALL {
            let mut sum = [0.0f64; 2];
            let n = 40 * 40 * 8;
            for k in 0..n {
                let p = s.get_2d_unit(5, [k % 40, k / 40 % 40], k / 1600, 0, 1);
                (0..2).for_each(|i| sum[i] += f64::from(p[i]));
            }
            // random numbers would be 0.0026 off
            assert!(sum.iter().all(|x| (x / f64::from(n) - 0.5).abs() < 0.01), "{s:?} {sum:?}");
        }
    }
}
