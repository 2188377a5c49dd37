//! Precomputed tables of sample points and noise for the pipeline of Larsen (2019).

use super::sobol::{hash_combine, to_unit};

/// `count` points of the unit square by Mitchell's best candidate, in the order in which they were
/// found: each is the farthest from all before it (on the torus) of ten times as many random ones
/// as there are points. "Spectrally Optimal Sampling for Distribution Ray Tracing", SIGGRAPH 1991.
pub fn best_candidates(count: usize, seed: u32) -> Vec<[f32; 2]> {
    let mut next = 0u32;
    let mut random = || {
        next += 1;
        to_unit(hash_combine(seed, next))
    };
    let mut points: Vec<[f32; 2]> = Vec::with_capacity(count);
    for k in 0..count {
        let mut best = ([0.0; 2], -1.0f32);
        for _ in 0..10 * (k + 1) {
            let c = [random(), random()];
            let nearest = points.iter().map(|p| torus_distance2(*p, c)).fold(f32::INFINITY, f32::min);
            if nearest > best.1 {
                best = (c, nearest);
            }
        }
        points.push(best.0);
    }
    points
}

fn torus_distance2(a: [f32; 2], b: [f32; 2]) -> f32 {
    let d = |k: usize| {
        let d = (a[k] - b[k]).abs();
        d.min(1.0 - d)
    };
    d(0) * d(0) + d(1) * d(1)
}

/// A tile of `side` x `side` values in [0, 1), each of a different rank, whose neighbours differ
/// much: Ulichney, "The Void-and-Cluster Method for Dither Array Generation", SPIE 1913, 1993.
/// `side` is a multiple of 8.
pub fn blue_noise(side: usize, seed: u32) -> Vec<f32> {
    let n = side * side;
    let mut field = Field::new(side);
    // a tenth of the pixels, at random; then tightest clusters change places with largest voids
    // until they are the same
    let mut k = 0;
    while field.ones < n / 10 {
        let at = hash_combine(seed, k) as usize % n;
        if !field.set[at] {
            field.toggle(at);
        }
        k += 1;
    }
    loop {
        let cluster = field.extreme(true);
        field.toggle(cluster);
        let void = field.extreme(false);
        field.toggle(void);
        if void == cluster {
            break;
        }
    }
    let mut rank = vec![0usize; n];
    let mut start =
        Field { energy: field.energy.clone(), set: field.set.clone(), kernel: field.kernel.clone(), ..field };
    for r in (0..field.ones).rev() {
        let cluster = start.extreme(true);
        start.toggle(cluster);
        rank[cluster] = r;
    }
    for r in field.ones..n {
        let void = field.extreme(false);
        field.toggle(void);
        rank[void] = r;
    }
    rank.into_iter().map(|r| r as f32 / n as f32).collect()
}

/// A binary pattern, and the energy (local density) at each pixel.
struct Field {
    side: usize,
    set: Vec<bool>,
    energy: Vec<f32>,
    // energy of a pixel at the origin, on the torus
    kernel: Vec<f32>,
    ones: usize,
}

impl Field {
    fn new(side: usize) -> Self {
        // the width that Ulichney found best
        let sigma2 = 1.5f32 * 1.5;
        let wrap = |k: usize| k.min(side - k) as f32;
        let kernel = (0..side * side)
            .map(|k| {
                let (x, y) = (wrap(k % side), wrap(k / side));
                (-(x * x + y * y) / (2.0 * sigma2)).exp()
            })
            .collect();
        Self { side, set: vec![false; side * side], energy: vec![0.0; side * side], kernel, ones: 0 }
    }

    fn toggle(&mut self, at: usize) {
        let (side, x, y) = (self.side, at % self.side, at / self.side);
        let sign = if self.set[at] { -1.0 } else { 1.0 };
        self.set[at] = !self.set[at];
        self.ones = if self.set[at] { self.ones + 1 } else { self.ones - 1 };
        for (k, e) in self.energy.iter_mut().enumerate() {
            let (dx, dy) = ((k % side + side - x) % side, (k / side + side - y) % side);
            *e += sign * self.kernel[dy * side + dx];
        }
    }

    /// The set pixel in the tightest cluster, or the empty one in the largest void.
    fn extreme(&self, cluster: bool) -> usize {
        let candidates = (0..self.set.len()).filter(|&k| self.set[k] == cluster);
        let by = |a: &usize, b: &usize| self.energy[*a].total_cmp(&self.energy[*b]);
        let found = if cluster { candidates.max_by(by) } else { candidates.min_by(by) };
        // there always is one while ranks are left
        found.unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn candidates_keep_apart() {
        let points = best_candidates(64, 1);
        let nearest = |k: usize| {
            let others = points.iter().enumerate().filter(|(j, _)| *j != k);
            others.map(|(_, p)| torus_distance2(*p, points[k])).fold(f32::INFINITY, f32::min).sqrt()
        };
        let least = (0..64).map(nearest).fold(f32::INFINITY, f32::min);
        // random points would come within 0.01; a hexagonal lattice keeps 0.134
        assert!(least > 0.07 && points.iter().flatten().all(|x| (0.0..1.0).contains(x)), "{least}");
    }

    #[test]
    fn noise_has_every_rank_once_and_no_low_frequencies() {
        let side = 32;
        let noise = blue_noise(side, 1);
        let mut ranks: Vec<usize> = noise.iter().map(|x| (x * (side * side) as f32).round() as usize).collect();
        ranks.sort_unstable();
        assert!(ranks.iter().enumerate().all(|(k, r)| k == *r));
        // means of 4x4 squares vary by 0.072 for white noise
        let square = |k: usize| {
            let (x, y) = (k % 8 * 4, k / 8 * 4);
            (0..16).map(|j| noise[(y + j / 4) * side + x + j % 4]).sum::<f32>() / 16.0
        };
        let variance = (0..64).map(|k| (square(k) - 0.5).powi(2)).sum::<f32>() / 64.0;
        assert!(variance.sqrt() < 0.03, "{}", variance.sqrt());
    }
}
