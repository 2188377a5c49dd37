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

#[cfg(test)]
mod tests {
    use super::*;

    fn repeated(values: &[f64]) -> Values {
        Values::Repeated(Percentiles::from_values(values).unwrap())
    }

    fn judgement(before: Values, now: Values) -> Judgement {
        judge(&before, &now, false).judgement
    }

    #[test]
    fn worse_better_and_the_same() {
        let steady = |m: f64| repeated(&[0.99 * m, m, 1.01 * m, m, 0.995 * m, 1.005 * m, m]);
        assert_eq!(judgement(steady(10.0), steady(12.0)), Judgement::Worse);
        assert_eq!(judgement(steady(12.0), steady(10.0)), Judgement::Better);
        assert_eq!(judgement(steady(10.0), steady(10.4)), Judgement::Same);
        // a fifth slower, but either run spreads over more than that
        let wide = |m: f64| repeated(&[0.7 * m, m, 1.3 * m, 0.8 * m, 1.2 * m, 0.75 * m, 1.25 * m]);
        assert_eq!(judgement(wide(10.0), wide(12.0)), Judgement::Same);
        assert_eq!(judgement(wide(10.0), wide(40.0)), Judgement::Worse);
        // rates: less is worse
        let rates = |before, now| judge(&steady(before), &steady(now), true);
        assert_eq!(rates(12.0, 10.0).judgement, Judgement::Worse);
        assert!((rates(10.0, 8.0).worse_by - 0.2).abs() < 1e-9);
        assert_eq!(rates(10.0, 12.0).judgement, Judgement::Better);
    }

    #[test]
    fn what_has_no_noise_counts_from_five_per_cent_on() {
        assert_eq!(judgement(Values::Exact(1.0), Values::Exact(1.04)), Judgement::Same);
        assert_eq!(judgement(Values::Exact(1.0), Values::Exact(1.2)), Judgement::Worse);
        assert_eq!(judgement(Values::Exact(0.0), Values::Exact(0.0)), Judgement::Same);
        let from_nothing = judge(&Values::Exact(0.0), &Values::Exact(0.1), false);
        assert_eq!((from_nothing.judgement, from_nothing.worse_by), (Judgement::Worse, f64::INFINITY));
        assert_eq!(judgement(Values::Exact(1.0), Values::Exact(f64::NAN)), Judgement::Worse);
        assert_eq!(judgement(Values::Exact(f64::NAN), Values::Exact(1.0)), Judgement::Unknown);
    }

    #[test]
    fn a_single_measurement_says_nothing_of_noise() {
        assert_eq!(judgement(repeated(&[1.0]), repeated(&[2.0])), Judgement::Unknown);
        assert_eq!(judgement(repeated(&[1.0, 1.01, 1.02]), repeated(&[2.0])), Judgement::Unknown);
        // a record of a version that kept no quartiles
        let old = Values::Repeated(Percentiles { median: 1.0, p95: 1.1, ..Percentiles::default() });
        assert_eq!(judgement(old, repeated(&[2.0, 2.0, 2.0])), Judgement::Unknown);
    }

    /// Two runs of the same program whose times have a deviation of a tenth: how often is one
    /// called worse?
    #[test]
    fn false_alarms_are_rare() {
        let mut state = 1u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        for (repeats, most) in [(3, 0.005), (7, 0.001), (32, 0.0002)] {
            let mut run = || {
                // twelve uniform numbers: nearly normal
                let values: Vec<f64> =
                    (0..repeats).map(|_| 10.0 + (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect();
                repeated(&values)
            };
            let runs = 20_000;
            let alarms = (0..runs).filter(|_| judge(&run(), &run(), false).judgement == Judgement::Worse).count();
            let rate = alarms as f64 / f64::from(runs);
            println!("{repeats} repeats: {rate}");
            assert!(rate < most, "{repeats} repeats: {rate}");
        }
    }
}
