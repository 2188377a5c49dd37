//! Statistics of repeated measurements.

use serde::{Deserialize, Deserializer, Serialize};

/// For serde: a number, or NaN for null. JSON has no numbers that are not finite, and writes them
/// as null.
///
/// # Errors
/// Those of the format.
pub fn number_or_nan<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

/// Median, minimum and maximum of some values, in their unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Middle value; the mean of the two in the middle of an even number.
    #[serde(deserialize_with = "number_or_nan")]
    pub median: f64,
    /// Minimum.
    #[serde(deserialize_with = "number_or_nan")]
    pub min: f64,
    /// Maximum.
    #[serde(deserialize_with = "number_or_nan")]
    pub max: f64,
}

impl Summary {
    /// Summarizes values; `None` for no values.
    pub fn from_values(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (min, max) = (*sorted.first()?, *sorted.last()?);
        Some(Self { median: middle(&sorted), min, max })
    }
}

/// Median and percentiles of repeated measurements, in their unit. Percentiles are by nearest rank:
/// values that occurred.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Percentiles {
    /// Middle value; the mean of the two in the middle of an even number.
    pub median: f64,
    /// The 95th percentile.
    pub p95: f64,
    /// The 5th percentile.
    #[serde(default)]
    pub p5: f64,
    /// The 25th percentile.
    #[serde(default)]
    pub p25: f64,
    /// The 75th percentile.
    #[serde(default)]
    pub p75: f64,
    /// Number of values; 0 where it is unknown.
    #[serde(default)]
    pub count: usize,
}

impl Percentiles {
    /// Summarizes values; `None` for no values.
    pub fn from_values(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        let rank = |percent: usize| Some(sorted[(n * percent).div_ceil(100).checked_sub(1)?]);
        Some(Self { p5: rank(5)?, p25: rank(25)?, median: middle(&sorted), p75: rank(75)?, p95: rank(95)?, count: n })
    }

    /// Standard error of the median of independent values, estimated from the quartiles, which
    /// values far out do not move: for normally distributed values the interquartile range is 1.349
    /// standard deviations, and the median's standard error sqrt(pi / 2) times that of the mean.
    /// `None` for fewer than two values, which tell nothing of it.
    pub fn standard_error(&self) -> Option<f64> {
        let deviation = (self.p75 - self.p25) / 1.349;
        (self.count > 1).then(|| std::f64::consts::FRAC_PI_2.sqrt() * deviation / (self.count as f64).sqrt())
    }
}

/// Median of some values; `None` for no values.
pub fn median(values: &[f64]) -> Option<f64> {
    Summary::from_values(values).map(|s| s.median)
}

/// The value below which a share of the values lies, by linear interpolation between ranks; `None`
/// for no values. `share` from 0 to 1.
pub fn percentile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    percentile_of_sorted(&sorted, share)
}

/// As [`percentile`], of values in ascending order.
pub fn percentile_of_sorted(sorted: &[f64], share: f64) -> Option<f64> {
    let at = share.clamp(0.0, 1.0) * sorted.len().checked_sub(1)? as f64;
    let (low, high) = (sorted[at.floor() as usize], sorted[at.ceil() as usize]);
    Some(low + (high - low) * at.fract())
}

fn middle(sorted: &[f64]) -> f64 {
    let n = sorted.len();
    if n % 2 == 1 { sorted[n / 2] } else { 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]) }
}

/// How much faster `seconds` are than `baseline`, entry `k` of both taken in the same round: the
/// median of the rounds' quotients. A machine that slows down for a while slows both down, and the
/// quotient stays. `None` when there is no round that both took part in. `work` and `baseline_work`
/// are what a repeat did, in the same unit.
pub fn paired_ratio(seconds: &[f64], work: f64, baseline: &[f64], baseline_work: f64) -> Option<f64> {
    let ratios: Vec<f64> =
        seconds.iter().zip(baseline).map(|(s, b)| (work / s) / (baseline_work / b)).filter(|r| r.is_finite()).collect();
    median(&ratios)
}

/// Does a rate fall faster than the logarithm of the size allows?
///
/// A tracer that visits a constant number of nodes a level has rate proportional to 1 / log n. From
/// points (n, rate), in any order, it takes `rate(n) * ln(n)`, relative to that of the smallest
/// `n`: at least 1 where the rate falls no faster.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LogScaling {
    /// The least of these relative products.
    pub worst: f64,
    /// The size at which it occurs.
    pub worst_at: u64,
    /// Slope of log(rate) against log(n), by least squares: the rate falls as n to this power.
    pub exponent: f64,
}

impl LogScaling {
    /// Exponent within which a rate falls no faster than log n: rates vary by about this much from
    /// run to run.
    pub const TOLERANCE: f64 = 0.1;

    /// Fits at least two points of different size, sizes above 1 and rates above 0; `None`
    /// otherwise.
    pub fn from_points(points: &[(u64, f64)]) -> Option<Self> {
        let mut sorted = points.to_vec();
        sorted.sort_by_key(|p| p.0);
        let &(n0, r0) = sorted.first()?;
        if n0 < 2 || sorted.last()?.0 == n0 || sorted.iter().any(|p| !(p.1 > 0.0 && p.1.is_finite())) {
            return None;
        }
        let relative = |&(n, r): &(u64, f64)| (r * (n as f64).ln()) / (r0 * (n0 as f64).ln());
        let worst = sorted[1..].iter().min_by(|a, b| relative(a).total_cmp(&relative(b)))?;
        let logs: Vec<_> = sorted.iter().map(|&(n, r)| ((n as f64).ln(), r.ln())).collect();
        let mean = |f: fn(&(f64, f64)) -> f64| logs.iter().map(f).sum::<f64>() / logs.len() as f64;
        let (mx, my) = (mean(|p| p.0), mean(|p| p.1));
        let covariance: f64 = logs.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
        let variance: f64 = logs.iter().map(|p| (p.0 - mx).powi(2)).sum();
        Some(Self { worst: relative(worst), worst_at: worst.0, exponent: covariance / variance })
    }

    /// Does it fall no faster than log n, within [`Self::TOLERANCE`]?
    pub fn holds(&self) -> bool {
        self.worst >= 1.0 - Self::TOLERANCE
    }
}
