//! Sampling of a discrete distribution by inversion of its cumulative distribution. Unlike an alias
//! table it preserves the order of the outcomes: neighbouring numbers choose neighbouring outcomes,
//! and the remainder of a number is again uniform and stratified. So one stratified sample can
//! choose an outcome and then a point of it (pbrt-v4, A.1, `SampleDiscrete`).

/// A discrete distribution over outcomes `0..n`, in units of 2^-32: sampling matches the
/// probabilities exactly.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CumulativeTable {
    /// `n + 1` numbers: outcome `k` is chosen from `starts[k]` up to `starts[k + 1]`. The last is
    /// 2^32, which wraps to 0.
    pub starts: Vec<u32>,
    /// Probability of each outcome.
    pub probabilities: Vec<f32>,
}

impl CumulativeTable {
    /// Builds the distribution of at most 2^31 weights, all finite and above 0.
    pub fn new(weights: &[f64]) -> Self {
        let n = weights.len() as u64;
        debug_assert!(weights.iter().all(|&w| w > 0.0 && w.is_finite()), "weights must be above 0");
        if n == 0 {
            return Self::default();
        }
        let total: f64 = weights.iter().sum();
        let all = 1u64 << 32;
        // every outcome gets one unit, and its share of the others
        let spare = (all - n) as f64;
        let (mut sum, mut starts) = (0.0, Vec::with_capacity(weights.len() + 1));
        for (k, weight) in weights.iter().enumerate() {
            starts.push(k as u64 + (spare * (sum / total)) as u64);
            sum += weight;
        }
        starts.push(all);
        let probabilities = starts.windows(2).map(|w| ((w[1] - w[0]) as f64 / all as f64) as f32).collect();
        Self { starts: starts.into_iter().map(|s| s as u32).collect(), probabilities }
    }

    /// The outcome of 32 random bits, and their remainder, rescaled to [0, 1].
    pub fn sample(&self, bits: u32) -> (usize, f32) {
        let n = self.probabilities.len();
        let k = self.starts[..n].partition_point(|&s| s <= bits) - 1;
        let width = self.starts[k + 1].wrapping_sub(self.starts[k]);
        // a single outcome fills all 2^32
        let width = if width == 0 { 4_294_967_296.0 } else { width as f32 };
        (k, (bits - self.starts[k]) as f32 / width)
    }
}
