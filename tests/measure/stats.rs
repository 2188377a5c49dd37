//! Statistics of repeated measurements.

use skylit::measure::stats::{LogScaling, Percentiles, Summary, median, paired_ratio, percentile};

#[test]
fn medians() {
    assert_eq!(Summary::from_values(&[]), None);
    assert_eq!(Summary::from_values(&[3.0, 1.0, 2.0]), Some(Summary { median: 2.0, min: 1.0, max: 3.0 }));
    assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), Some(2.5));
    assert_eq!(median(&[7.0]), Some(7.0));
    let hundred: Vec<f64> = (1..=100).rev().map(f64::from).collect();
    let of_hundred = Percentiles { median: 50.5, p95: 95.0, p5: 5.0, p25: 25.0, p75: 75.0, count: 100 };
    assert_eq!(Percentiles::from_values(&hundred), Some(of_hundred));
    let of_two = Percentiles { median: 1.5, p95: 2.0, p5: 1.0, p25: 1.0, p75: 2.0, count: 2 };
    assert_eq!(Percentiles::from_values(&[2.0, 1.0]), Some(of_two));
    assert_eq!(Percentiles::from_values(&[]), None);
    assert_eq!(percentile(&[], 0.95), None);
    assert_eq!(percentile(&[3.0, 1.0, 2.0, 4.0, 5.0], 0.5), Some(3.0));
    assert_eq!(percentile(&[3.0, 1.0, 2.0, 4.0, 5.0], 0.95), Some(4.8));
}

#[test]
fn the_error_of_a_median() {
    // normal quantiles: the standard deviation is 2
    let normal = Percentiles { median: 5.0, p25: 5.0 - 1.349, p75: 5.0 + 1.349, count: 100, ..Percentiles::default() };
    assert!((normal.standard_error().unwrap() - 1.2533 * 2.0 / 10.0).abs() < 1e-4);
    assert_eq!(Percentiles::from_values(&[3.0]).unwrap().standard_error(), None);
    assert_eq!(Percentiles::from_values(&[3.0, 3.0]).unwrap().standard_error(), Some(0.0));
}

#[test]
fn ratios_are_taken_round_by_round() {
    // the machine halves its speed in the second round: both slow down
    let (ours, theirs) = ([1.0, 2.0, 1.0], [2.0, 4.0, 2.0]);
    assert_eq!(paired_ratio(&ours, 10.0, &theirs, 10.0), Some(2.0));
    // half the rays in the same time is half the rate
    assert_eq!(paired_ratio(&ours, 5.0, &theirs, 10.0), Some(1.0));
    // one slow round of one of them is not the result
    assert_eq!(paired_ratio(&[1.0, 9.0, 1.0], 1.0, &[1.0, 1.0, 1.0], 1.0), Some(1.0));
    // 8, 3 and 1
    assert_eq!(paired_ratio(&[1.0, 2.0, 4.0], 1.0, &[8.0, 6.0, 4.0], 1.0), Some(3.0));
    // 1, 8 and 1.5, where the quotient of the medians is 2
    assert_eq!(paired_ratio(&[4.0, 1.0, 2.0], 1.0, &[4.0, 8.0, 3.0], 1.0), Some(1.5));
    assert_eq!(paired_ratio(&[], 1.0, &[1.0], 1.0), None);
}

#[test]
fn logarithmic_rates_hold_and_steeper_ones_do_not() {
    let sizes = [10_000u64, 100_000, 1_000_000, 10_000_000];
    let rates = |f: &dyn Fn(f64) -> f64| sizes.iter().rev().map(|&n| (n, f(n as f64))).collect::<Vec<_>>();
    let log = LogScaling::from_points(&rates(&|n| 80.0 / n.ln())).unwrap();
    assert!(log.holds() && (log.worst - 1.0).abs() < 1e-12);
    let flat = LogScaling::from_points(&rates(&|_| 5.0)).unwrap();
    assert!(flat.holds() && flat.exponent.abs() < 1e-12);
    let root = LogScaling::from_points(&rates(&|n| 1e3 / n.sqrt())).unwrap();
    assert!(!root.holds() && (root.exponent + 0.5).abs() < 1e-9 && root.worst_at == 10_000_000);
    assert_eq!(LogScaling::from_points(&[(10, 1.0)]), None);
    assert_eq!(LogScaling::from_points(&[(10, 1.0), (10, 2.0)]), None);
    assert_eq!(LogScaling::from_points(&[(10, 1.0), (20, 0.0)]), None);
}
