//! Tails of the normal and of Student's distribution, and the correction for many tests at once.

use std::f64::consts::FRAC_1_SQRT_2;

use statrs::function::beta::beta_reg;
use statrs::function::erf::erfc;

/// The probability that a standard normal variable is above `z`; for negative `z`, too.
pub fn normal_tail(z: f64) -> f64 {
    0.5 * erfc(z * FRAC_1_SQRT_2)
}

/// The probability that a variable is at least as far from 0 as `t`, on either side: by Student's
/// distribution with this many degrees of freedom, or the normal distribution where they are
/// infinite. 1 for NaN: nothing is known.
pub fn two_sided(t: f64, freedom: f64) -> f64 {
    if t.is_nan() {
        return 1.0;
    }
    if freedom == f64::INFINITY {
        return 2.0 * normal_tail(t.abs());
    }
    // of a large t, t * t may be infinite: the tail is then 0
    beta_reg(0.5 * freedom, 0.5, freedom / (freedom + t * t))
}

/// The probability that the least of `count` independent probabilities is below `p` by chance
/// (Sidak 1967).
pub fn sidak(p: f64, count: f64) -> f64 {
    -(count * (-p.min(1.0)).ln_1p()).exp_m1()
}

/// The distance from 0 that all of `count` independent variables stay within with probability 1 -
/// `alpha`: variables of Student's distribution with this many degrees of freedom, normal ones
/// where they are infinite.
pub fn critical_value(alpha: f64, count: f64, freedom: f64) -> f64 {
    let (mut lo, mut hi) = (0.0, 1.0);
    while sidak(two_sided(hi, freedom), count) > alpha && hi < 1e12 {
        hi *= 2.0;
    }
    for _ in 0..200 {
        let middle = 0.5 * (lo + hi);
        if sidak(two_sided(middle, freedom), count) > alpha { lo = middle } else { hi = middle }
    }
    hi
}
