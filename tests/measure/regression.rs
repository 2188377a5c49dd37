//! Measurements that have become worse, and those that only scatter.

use skylit::measure::regression::{Judgement, Values, judge};
use skylit::measure::stats::Percentiles;

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
            let values: Vec<f64> = (0..repeats).map(|_| 10.0 + (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect();
            repeated(&values)
        };
        let runs = 20_000;
        let alarms = (0..runs).filter(|_| judge(&run(), &run(), false).judgement == Judgement::Worse).count();
        let rate = alarms as f64 / f64::from(runs);
        println!("{repeats} repeats: {rate}");
        assert!(rate < most, "{repeats} repeats: {rate}");
    }
}
