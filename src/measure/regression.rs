//! When a result is worse than an earlier one beyond noise.

use serde::{Deserialize, Serialize};

use super::stats::{Percentiles, number_or_nan};

/// Least change that counts, as a share of the baseline: builds that differ in nothing but the
/// addresses of their code differ by a few per cent.
const MIN_CHANGE: f64 = 0.05;
/// Standard errors that chance is given: a run has hundreds of results, and none of them should be
/// called worse by chance.
const STANDARD_ERRORS: f64 = 4.0;

/// The rule in a sentence.
pub const RULE: &str = "A median counts as changed if it differs from the baseline's by more than 5 % and by more than 4 standard errors of the difference (from the \
                        quartiles of the repeats), and if the interquartile ranges of both runs do not overlap; what has no noise counts from 5 % on.";

/// The verdict on a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judgement {
    /// Worse beyond noise.
    Worse,
    /// Better beyond noise.
    Better,
    /// The difference that noise explains.
    Same,
    /// There are too few repeats to know the noise.
    Unknown,
}

/// Values of a result.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Values {
    /// Repeated measurements, which have noise.
    Repeated(Percentiles),
    /// A value that is the same in every run on the same device. JSON has null for a number that is
    /// not finite.
    Exact(#[serde(deserialize_with = "number_or_nan")] f64),
}

impl Values {
    /// Whether it has noise.
    pub fn is_repeated(&self) -> bool {
        matches!(self, Self::Repeated(_))
    }

    /// The median, or the value.
    pub fn middle(&self) -> f64 {
        match self {
            Self::Repeated(p) => p.median,
            Self::Exact(v) => *v,
        }
    }

    /// The 5th to the 95th percentile, where several values differ.
    pub fn spread(&self) -> Option<[f64; 2]> {
        match self {
            Self::Repeated(p) if p.count > 1 && p.p5 > 0.0 && p.p95 > p.p5 => Some([p.p5, p.p95]),
            _ => None,
        }
    }
}

/// A result beside an earlier one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judged {
    /// The verdict on the result.
    pub judgement: Judgement,
    /// How much worse it is, as a share of the earlier one; negative where it is better.
    pub worse_by: f64,
    /// How much would still be noise; NaN where that is unknown.
    pub noise: f64,
}

/// Judges a result by an earlier one.
pub fn judge(before: &Values, now: &Values, more_is_better: bool) -> Judged {
    // positive where it is worse
    let (a, b) = (before.middle(), now.middle());
    let worse = if more_is_better { a - b } else { b - a };
    let noise = noise(before, now).map(|n| n.max(MIN_CHANGE * a.abs()));
    let share = |x: f64| {
        if a == 0.0 && x != 0.0 {
            f64::INFINITY.copysign(x)
        } else if x == 0.0 {
            0.0
        } else {
            x / a.abs()
        }
    };
    let judgement = match noise {
        // a number that is none any more
        _ if a.is_finite() && !b.is_finite() => Judgement::Worse,
        _ if !a.is_finite() => Judgement::Unknown,
        None => Judgement::Unknown,
        Some(noise) if worse.abs() <= noise || overlap(before, now) => Judgement::Same,
        Some(_) if worse > 0.0 => Judgement::Worse,
        Some(_) => Judgement::Better,
    };
    Judged { judgement, worse_by: share(worse), noise: noise.map_or(f64::NAN, share) }
}

/// The difference that chance makes; `None` where that is unknown.
fn noise(before: &Values, now: &Values) -> Option<f64> {
    match (before, now) {
        (Values::Repeated(a), Values::Repeated(b)) => {
            Some(STANDARD_ERRORS * a.standard_error()?.hypot(b.standard_error()?))
        }
        _ => Some(0.0),
    }
}

/// Do the interquartile ranges have a value in common?
fn overlap(before: &Values, now: &Values) -> bool {
    match (before, now) {
        (Values::Repeated(a), Values::Repeated(b)) => a.p25 <= b.p75 && b.p25 <= a.p75,
        _ => false,
    }
}
