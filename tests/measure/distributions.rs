//! Tails of distributions, against values of scipy.

use skylit::measure::distributions::{critical_value, normal_tail, sidak, two_sided};

/// Values of scipy 1.17.1: norm.sf, 2 * t.sf.
#[test]
fn tails_are_those_of_scipy() {
    let close =
        |value: f64, expected: f64| assert!((value / expected - 1.0).abs() < 1e-7, "{value:e}, not {expected:e}");
    close(normal_tail(0.0), 0.5);
    close(normal_tail(0.5), 3.085375387259869e-01);
    close(normal_tail(1.0), 1.586552539314571e-01);
    close(normal_tail(1.9), 2.87165598160018e-02);
    close(normal_tail(2.1), 1.786442056281654e-02);
    close(normal_tail(5.0), 2.866515718791933e-07);
    close(normal_tail(12.0), 1.776482112077653e-33);
    close(normal_tail(-1.5), 9.331927987311419e-01);
    close(two_sided(0.3, 1.0), 8.144528418445154e-01);
    close(two_sided(2.0, 1.0), 2.951672353008665e-01);
    close(two_sided(7.5, 1.0), 8.438492631768273e-02);
    close(two_sided(0.3, 2.0), 7.924856608401776e-01);
    close(two_sided(2.0, 2.0), 1.83503419072274e-01);
    close(two_sided(7.5, 2.0), 1.731732687937244e-02);
    close(two_sided(0.3, 15.0), 7.682945345355523e-01);
    close(two_sided(2.0, 15.0), 6.394500728472015e-02);
    close(two_sided(7.5, 15.0), 1.888853860470804e-06);
    close(two_sided(0.3, 31.0), 7.661796750110288e-01);
    close(two_sided(2.0, 31.0), 5.432721536717571e-02);
    close(two_sided(7.5, 31.0), 1.885087212431842e-08);
    close(two_sided(0.3, 63.0), 7.65164807013884e-01);
    close(two_sided(2.0, 63.0), 4.981576369904482e-02);
    close(two_sided(7.5, 63.0), 2.674901424749289e-10);
    close(two_sided(0.3, 2048.0), 7.642076013382825e-01);
    close(two_sided(2.0, 2048.0), 4.56321082974197e-02);
    close(two_sided(7.5, 2048.0), 9.451721281346238e-14);
}

#[test]
fn corrections_for_many_tests() {
    // two-sided 1 % of one variable
    assert!((critical_value(0.01, 1.0, f64::INFINITY) - 2.575_829_303_5).abs() < 1e-8);
    // as many as it takes for 5 sigmas
    let count = -(-0.01f64).ln_1p() / (2.0 * normal_tail(5.0));
    assert!((sidak(2.0 * normal_tail(5.0), count) - 0.01).abs() < 1e-7);
    // small probabilities add up
    assert!((sidak(1e-20, 1000.0) - 1e-17).abs() < 1e-24);
    assert_eq!((sidak(1.0, 3.0), two_sided(f64::NAN, 3.0), two_sided(f64::INFINITY, 31.0)), (1.0, 1.0, 0.0));
    for freedom in [3.0, 31.0, 1e4, f64::INFINITY] {
        let t = critical_value(1e-4, 3000.0, freedom);
        assert!((sidak(two_sided(t, freedom), 3000.0) / 1e-4 - 1.0).abs() < 1e-6, "{freedom}");
    }
}
