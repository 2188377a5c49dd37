//! Error of a contestant by sample count, and the time to reach an error.

use crate::bench::record::{Record, Row, plain, quantity};
use crate::measure::stats::{Percentiles, median};

/// Part of the record that holds them, and its axis.
pub const PART: &str = "images";
/// Axis of sample counts.
pub const SPP: &str = "samples per pixel";

/// Images of one sample count.
#[derive(Clone, Debug, Default)]
pub struct ErrorPoint {
    pub spp: u32,
    /// Wall seconds of each timed image, in the order of the rounds.
    pub seconds: Vec<f64>,
    /// Error, over all repeats, the reference's own taken off; unless `is_unsure`.
    pub rmse: f64,
    /// The same of each image, those of the warming round included.
    pub rmse_repeats: Vec<f64>,
    /// The reference's own error is more than half of `rmse`, which overstates the contestant's.
    pub is_unsure: bool,
    /// Share of pixels off by more than a tenth of white in any channel after 1 - exp(-radiance).
    pub bad_pixels: f64,
}

/// The curve of one contestant.
#[derive(Clone, Debug, Default)]
pub struct ErrorCurve {
    pub name: String,
    /// Whether a peer rendered it.
    pub is_peers: bool,
    /// By sample count, ascending.
    pub points: Vec<ErrorPoint>,
    /// Mean of image - reference, in standard errors over repeats; `None` with fewer than three.
    pub bias_sigmas: Option<f64>,
    /// 10^6 paths a second at the greatest sample count.
    pub mpaths: f64,
    /// 10^6 rays a second there, where they are counted.
    pub mrays: Option<f64>,
    /// Longest launch on the device, seconds, where it is known.
    pub longest_launch: Option<f64>,
}

/// Quantities of a time to an error: interpolated between two measured images; an upper bound where
/// the shortest one is better already; by the square root law from the longest one.
const BETWEEN: &str = "time to the target";
const AT_MOST: &str = "at most to the target";
const EXTRAPOLATED: &str = "extrapolated to the target";

impl ErrorCurve {
    /// Wall seconds of an image at which the error falls to `rmse`, and the name of that quantity.
    fn time_to(&self, rmse: f64) -> Option<(f64, &'static str)> {
        let points = self.points.iter().filter_map(|p| Some((median(&p.seconds)?, p.rmse)));
        let curve: Vec<(f64, f64)> = points.filter(|p| p.1.is_finite()).collect();
        let (first, last) = (curve.first()?, curve.last()?);
        if first.1 <= rmse {
            return Some((first.0, AT_MOST));
        }
        let between = curve.windows(2).find(|w| w[0].1 > rmse && w[1].1 <= rmse).map(|w| {
            let [(t0, e0), (t1, e1)] = [w[0], w[1]];
            // no error at all is as good as the target
            let share = if e1 > 0.0 { (e0 / rmse).ln() / (e0 / e1).ln() } else { 1.0 };
            (t0 * (t1 / t0).powf(share), BETWEEN)
        });
        between.or_else(|| (rmse > 0.0).then(|| (last.0 * (last.1 / rmse).powi(2), EXTRAPOLATED)))
    }

    /// Adds all of it to a record, with how long it takes to the error of `target`.
    pub fn add_to(&self, record: &mut Record, scene: &str, target: Option<&ErrorCurve>) {
        let mut row = record.row(scene, PART, &self.name).of_peer(self.is_peers);
        for p in &self.points {
            let mut at = row.at(SPP, f64::from(p.spp));
            at.repeated(quantity::IMAGE_TIME, Percentiles::from_values(&p.seconds));
            // what is less than the reference's own error says nothing
            let error = if p.is_unsure { quantity::RMSE.not_compared() } else { quantity::RMSE };
            at.repeated(error, Percentiles::from_values(&p.rmse_repeats));
            at.exact(plain("mean RMSE", ""), p.rmse).exact(plain("bad pixels", ""), p.bad_pixels);
        }
        let Some(last) = self.points.last() else { return };
        let seconds = median(&last.seconds);
        row.exact(plain("greatest", "spp"), f64::from(last.spp)).exact(plain("image", "s"), seconds);
        row.exact(plain("its RMSE", ""), last.rmse).exact(plain("bad pixels", ""), last.bad_pixels);
        row.exact(plain("paths", "10^6/s"), self.mpaths).exact(plain("rays", "10^6/s"), self.mrays);
        // 1 / (mean squared error * seconds) (Veach 1997)
        row.exact(plain("efficiency", ""), seconds.map(|s| 1.0 / (last.rmse * last.rmse * s)));
        row.exact(plain("bias", "standard errors"), self.bias_sigmas);
        row.exact(plain("longest launch", "s"), self.longest_launch);
        self.add_time_to_target(&mut row, target);
    }

    fn add_time_to_target(&self, row: &mut Row, target: Option<&ErrorCurve>) {
        let Some(target) = target else { return };
        let Some(rmse) = target.points.last().map(|p| p.rmse).filter(|rmse| *rmse > 0.0 && rmse.is_finite()) else {
            return;
        };
        let Some((seconds, name)) = self.time_to(rmse) else { return };
        row.exact(plain(name, "s"), seconds);
        row.exact(plain("times as long", ""), target.time_to(rmse).map(|(base, _)| seconds / base));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(name: &str, points: &[(f64, f64)]) -> ErrorCurve {
        let point = |&(t, rmse): &(f64, f64)| ErrorPoint { seconds: vec![t], rmse, ..ErrorPoint::default() };
        ErrorCurve { name: name.into(), points: points.iter().map(point).collect(), ..ErrorCurve::default() }
    }

    #[test]
    fn times_to_an_error() {
        // error 1 / sqrt(t)
        let c = curve("x", &[(1.0, 1.0), (4.0, 0.5), (16.0, 0.25)]);
        let at = |rmse| c.time_to(rmse).unwrap();
        assert!((at(0.7).0 - 1.0 / 0.49).abs() < 1e-9 && at(0.7).1 == BETWEEN);
        assert!((at(0.125).0 - 64.0).abs() < 1e-9 && at(0.125).1 == EXTRAPOLATED);
        assert_eq!([at(2.0), at(0.25)], [(1.0, AT_MOST), (16.0, BETWEEN)]);
        assert_eq!(curve("x", &[]).time_to(1.0), None);
        // one that is exact in the end
        let exact = curve("x", &[(1.0, 1.0), (2.0, 0.0)]);
        assert_eq!(exact.time_to(0.5), Some((2.0, BETWEEN)));
        // beside one that sets the target
        let mut record = Record::default();
        curve("slow", &[(4.0, 1.0), (64.0, 0.25)]).add_to(&mut record, "a", Some(&c));
        assert_eq!(record.value("a", PART, "slow", plain("time to the target", "s")), Some(64.0));
        assert_eq!(record.value("a", PART, "slow", plain("times as long", "")), Some(4.0));
    }
}
