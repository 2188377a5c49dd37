//! Choosing one of many with given probabilities, in constant time: Walker's alias method (1974) as built by Vose, "A Linear Algorithm for
//! Generating Random Numbers with a Given Distribution" (1991).

use bytemuck::{Pod, Zeroable};

/// A bin of the table: with a number in [0, 1), the bin's own outcome below `threshold`, `alias` from there on.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct AliasBin {
    /// 0 to 1.
    pub threshold: f32,
    /// Index of an outcome.
    pub alias: u32,
}

/// A table over outcomes `0..n`.
#[derive(Clone, Debug, Default)]
pub struct AliasTable {
    /// A bin an outcome.
    pub bins: Vec<AliasBin>,
    /// Probability of each outcome, as the table draws it (thresholds are rounded).
    pub probabilities: Vec<f32>,
}

impl AliasTable {
    /// From weights that are finite and not negative; all equal where their sum is 0. At most 2^32 - 1 of them.
    pub fn new(weights: &[f64]) -> Self {
        let n = weights.len();
        let total: f64 = weights.iter().sum();
        let mut scaled: Vec<f64> = match total > 0.0 {
            true => weights.iter().map(|w| w / total * n as f64).collect(),
            false => vec![1.0; n],
        };
        let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..n).partition(|&k| scaled[k] < 1.0);
        let mut bins: Vec<AliasBin> = (0..n).map(|k| AliasBin { threshold: 1.0, alias: k as u32 }).collect();
        while let (Some(&s), Some(&l)) = (small.last(), large.last()) {
            small.pop();
            bins[s] = AliasBin { threshold: scaled[s] as f32, alias: l as u32 };
            scaled[l] -= 1.0 - scaled[s];
            if scaled[l] < 1.0 {
                large.pop();
                small.push(l);
            }
        }
        // what is left over is 1 but for rounding; an impossible outcome must stay impossible
        for &k in &small {
            if weights[k] == 0.0 && total > 0.0 {
                let likeliest = (0..n).max_by(|&a, &b| weights[a].total_cmp(&weights[b])).unwrap_or(k);
                bins[k] = AliasBin { threshold: 0.0, alias: likeliest as u32 };
            }
        }
        let mut probabilities = vec![0.0f64; n];
        for (k, bin) in bins.iter().enumerate() {
            probabilities[k] += f64::from(bin.threshold);
            probabilities[bin.alias as usize] += 1.0 - f64::from(bin.threshold);
        }
        Self { bins, probabilities: probabilities.into_iter().map(|p| (p / n as f64) as f32).collect() }
    }

    /// The outcome of a number in [0, 1).
    pub fn sample(&self, u: f32) -> usize {
        let x = u * self.bins.len() as f32;
        let k = (x as usize).min(self.bins.len() - 1);
        let bin = self.bins[k];
        if x - k as f32 >= bin.threshold { bin.alias as usize } else { k }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_as_often_as_asked() {
        for weights in [vec![1.0], vec![0.0, 3.0], vec![1.0, 2.0, 3.0, 4.0], vec![0.0, 0.0], vec![1e-9, 1.0, 0.0, 5.0, 1e9]] {
            let table = AliasTable::new(&weights);
            let (n, total) = (weights.len(), weights.iter().sum::<f64>());
            let mut counts = vec![0u32; n];
            let draws = 1 << 16;
            for k in 0..draws {
                counts[table.sample((k as f32 + 0.5) / draws as f32)] += 1;
            }
            for k in 0..n {
                let wanted = if total > 0.0 { weights[k] / total } else { 1.0 / n as f64 };
                assert!((f64::from(table.probabilities[k]) - wanted).abs() < 1e-6, "{weights:?}: {k}");
                assert!((f64::from(counts[k]) / f64::from(draws) - wanted).abs() < 1e-3, "{weights:?}: {k}");
                assert!(total == 0.0 || weights[k] > 0.0 || counts[k] == 0, "{weights:?}: {k} is impossible");
            }
        }
    }
}
