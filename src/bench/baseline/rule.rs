//! When a result is worse than an earlier one beyond noise.

use super::super::record::snapshot::{Measurement, Values};
use super::Change;

/// Least change that counts, as a share of the baseline: builds that differ in nothing but the addresses of their code differ by a few per cent.
const MIN_CHANGE: f64 = 0.05;
/// Standard errors that chance is given: a run has hundreds of results, and none of them should be called worse by chance.
const STANDARD_ERRORS: f64 = 4.0;

/// The rule in a sentence.
pub const TEXT: &str = "A median counts as changed if it differs from the baseline's by more than 5 % and by more than 4 standard errors of the difference (from the \
                        quartiles of the repeats), and if the interquartile ranges of both runs do not overlap; what has no noise counts from 5 % on.";

/// What is said of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judgement {
    /// Worse beyond noise.
    Worse,
    /// Better beyond noise.
    Better,
    /// What noise explains.
    Same,
    /// There are too few repeats to know the noise.
    Unknown,
}

/// Judges a result by an earlier one.
pub fn judge(before: &Measurement, now: &Measurement) -> (Judgement, Change) {
    let (a, b) = (before.values.middle(), now.values.middle());
    // positive where it is worse
    let worse = if now.more_is_better { a - b } else { b - a };
    let noise = noise(&before.values, &now.values).map(|n| n.max(MIN_CHANGE * a.abs()));
    let share = |x: f64| {
        if a == 0.0 && x != 0.0 {
            f64::INFINITY.copysign(x)
        } else if x == 0.0 {
            0.0
        } else {
            x / a.abs()
        }
    };
    let change = Change {
        row: now.row.clone(),
        quantity: now.quantity,
        before: a,
        now: b,
        worse_by: share(worse),
        noise: noise.map_or(f64::NAN, share),
    };
    let judgement = match noise {
        // a number that is none any more
        _ if a.is_finite() && !b.is_finite() => Judgement::Worse,
        _ if !a.is_finite() => Judgement::Unknown,
        None => Judgement::Unknown,
        Some(noise) if worse.abs() <= noise || overlap(&before.values, &now.values) => Judgement::Same,
        Some(_) if worse > 0.0 => Judgement::Worse,
        Some(_) => Judgement::Better,
    };
    (judgement, change)
}

/// What chance makes of the difference; `None` where that is unknown.
fn noise(before: &Values, now: &Values) -> Option<f64> {
    match (before, now) {
        (Values::Repeated(a), Values::Repeated(b)) => Some(STANDARD_ERRORS * a.standard_error()?.hypot(b.standard_error()?)),
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
    use crate::measure::stats::Percentiles;

    fn measured(values: Values, more_is_better: bool) -> Measurement {
        Measurement { row: "r".into(), quantity: "q", values, more_is_better, is_peers: false }
    }

    fn repeated(values: &[f64]) -> Values {
        Values::Repeated(Percentiles::from_values(values).unwrap())
    }

    fn of(before: Values, now: Values) -> Judgement {
        judge(&measured(before, false), &measured(now, false)).0
    }

    #[test]
    fn worse_better_and_the_same() {
        let steady = |m: f64| repeated(&[0.99 * m, m, 1.01 * m, m, 0.995 * m, 1.005 * m, m]);
        assert_eq!(of(steady(10.0), steady(12.0)), Judgement::Worse);
        assert_eq!(of(steady(12.0), steady(10.0)), Judgement::Better);
        assert_eq!(of(steady(10.0), steady(10.4)), Judgement::Same);
        // a fifth slower, but either run spreads over more than that
        let wide = |m: f64| repeated(&[0.7 * m, m, 1.3 * m, 0.8 * m, 1.2 * m, 0.75 * m, 1.25 * m]);
        assert_eq!(of(wide(10.0), wide(12.0)), Judgement::Same);
        assert_eq!(of(wide(10.0), wide(40.0)), Judgement::Worse);
        // rates: less is worse
        let rates = |before, now| judge(&measured(steady(before), true), &measured(steady(now), true));
        assert_eq!(rates(12.0, 10.0).0, Judgement::Worse);
        assert!((rates(10.0, 8.0).1.worse_by - 0.2).abs() < 1e-9);
        assert_eq!(rates(10.0, 12.0).0, Judgement::Better);
    }

    #[test]
    fn what_has_no_noise_counts_from_five_per_cent_on() {
        assert_eq!(of(Values::Exact(1.0), Values::Exact(1.04)), Judgement::Same);
        assert_eq!(of(Values::Exact(1.0), Values::Exact(1.2)), Judgement::Worse);
        assert_eq!(of(Values::Exact(0.0), Values::Exact(0.0)), Judgement::Same);
        let from_nothing = judge(&measured(Values::Exact(0.0), false), &measured(Values::Exact(0.1), false));
        assert_eq!((from_nothing.0, from_nothing.1.worse_by), (Judgement::Worse, f64::INFINITY));
        assert_eq!(of(Values::Exact(1.0), Values::Exact(f64::NAN)), Judgement::Worse);
        assert_eq!(of(Values::Exact(f64::NAN), Values::Exact(1.0)), Judgement::Unknown);
    }

    #[test]
    fn a_single_measurement_says_nothing_of_noise() {
        assert_eq!(of(repeated(&[1.0]), repeated(&[2.0])), Judgement::Unknown);
        assert_eq!(of(repeated(&[1.0, 1.01, 1.02]), repeated(&[2.0])), Judgement::Unknown);
        // a record of a version that kept no quartiles
        let old = Values::Repeated(Percentiles { median: 1.0, p95: 1.1, ..Percentiles::default() });
        assert_eq!(of(old, repeated(&[2.0, 2.0, 2.0])), Judgement::Unknown);
    }

    /// Two runs of the same program whose times have a deviation of a tenth: how often is one called worse?
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
                let values: Vec<f64> = (0..repeats).map(|_| 10.0 + (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect();
                repeated(&values)
            };
            let runs = 20_000;
            let alarms =
                (0..runs).filter(|_| judge(&measured(run(), false), &measured(run(), false)).0 == Judgement::Worse).count();
            let rate = alarms as f64 / f64::from(runs);
            println!("{repeats} repeats: {rate}");
            assert!(rate < most, "{repeats} repeats: {rate}");
        }
    }
}
