//! Logarithmic axes: where values lie along them, and which numbers stand beside them.

/// An axis whose ends are above 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogAxis {
    lo: f64,
    hi: f64,
}

/// A line across a panel.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    /// Value.
    pub value: f64,
    /// Number beside the axis; empty for a fine line without one.
    pub text: String,
}

/// Least ratio of an axis' ends: the noise of values that are all but the same is not blown up to the whole panel.
const MIN_SPAN: f64 = 2.5;
/// Share of the axis that stays empty at each end.
const MARGIN: f64 = 0.07;
/// Axes of less than this ratio have evenly spaced numbers.
const LINEAR: f64 = 6.0;

/// What axes hold at most. Beyond it, quotients and powers of an axis' ends would be no numbers any more.
const LIMITS: std::ops::RangeInclusive<f64> = 1e-100..=1e100;

impl LogAxis {
    /// An axis that holds all values, of which those that are not finite and above 0, or beyond what an axis can hold, have no place; `None` where there is no other.
    pub fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        let placed = values.filter(|v| LIMITS.contains(v));
        let (mut lo, mut hi) = placed.fold((f64::INFINITY, 0.0f64), |(lo, hi), v| (lo.min(v), hi.max(v)));
        if lo > hi {
            return None;
        }
        if hi / lo < MIN_SPAN {
            let widen = (MIN_SPAN * lo / hi).sqrt();
            (lo, hi) = (lo / widen, hi * widen);
        }
        let margin = (hi / lo).powf(MARGIN);
        Some(Self { lo: lo / margin, hi: hi * margin })
    }

    /// Values at the low and the high end.
    pub fn ends(&self) -> [f64; 2] {
        [self.lo, self.hi]
    }

    /// Place of a value: 0 at the low end, 1 at the high end.
    pub fn place(&self, value: f64) -> f64 {
        (value.ln() - self.lo.ln()) / (self.hi.ln() - self.lo.ln())
    }

    /// The place of a value; of one beyond an end, that end.
    pub fn clamped(&self, value: f64) -> f64 {
        if value > 0.0 { self.place(value).clamp(0.0, 1.0) } else { 0.0 }
    }

    /// The densest ticks whose numbers `fit` beside each other.
    pub fn ticks(&self, fit: impl Fn(&[Tick]) -> bool) -> Vec<Tick> {
        let candidates = self.candidates();
        let chosen = candidates.iter().position(|c| fit(c)).map_or_else(Vec::new, |k| candidates[k].clone());
        // lines without numbers where there is room for many
        let mut ticks = chosen;
        if self.hi / self.lo >= LINEAR {
            for value in self.multiples(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0], 1) {
                if !ticks.iter().any(|t| t.value == value) {
                    ticks.push(Tick { value, text: String::new() });
                }
            }
        }
        ticks
    }

    /// Ticks with numbers, from many to few.
    fn candidates(&self) -> Vec<Vec<Tick>> {
        let text = |values: Vec<f64>| values.into_iter().map(|value| Tick { value, text: short(value) }).collect();
        if self.hi / self.lo < LINEAR {
            return [10.0, 7.0, 5.0, 3.0, 2.0].map(|count| text(self.even((self.hi - self.lo) / count))).into();
        }
        let digits: [&[f64]; 5] =
            [&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0], &[1.0, 2.0, 3.0, 5.0], &[1.0, 2.0, 5.0], &[1.0, 3.0], &[1.0]];
        let within = digits.into_iter().map(|d| text(self.multiples(d, 1)));
        within.chain([2, 3, 5, 10, 30, 100].map(|step| text(self.multiples(&[1.0], step)))).collect()
    }

    /// Multiples of a round step that is no less than `step`.
    fn even(&self, step: f64) -> Vec<f64> {
        let power = 10f64.powf(step.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|k| k * power).find(|s| *s >= step * 0.999).unwrap_or(10.0 * power);
        let (first, last) = ((self.lo / step).ceil() as i64, (self.hi / step).floor() as i64);
        // a negative power is divided by: 3 * 0.1 is not 0.3
        let value = |k: i64| if step < 1.0 { k as f64 / (1.0 / step).round() } else { k as f64 * step };
        (first..=last).map(value).filter(|v| *v > 0.0).collect()
    }

    /// `digits` times every `step`-th power of ten.
    fn multiples(&self, digits: &[f64], step: i32) -> Vec<f64> {
        let powers = (self.lo.log10().floor() as i32)..=(self.hi.log10().ceil() as i32);
        let value = |digit: f64, power: i32| if power < 0 { digit / 10f64.powi(-power) } else { digit * 10f64.powi(power) };
        powers
            .filter(|p| p.rem_euclid(step) == 0)
            .flat_map(|p| digits.iter().map(move |d| value(*d, p)))
            .filter(|v| (self.lo..=self.hi).contains(v))
            .collect()
    }
}

/// 10k, 2.5M, 0.3, 2e-5.
pub fn short(value: f64) -> String {
    let (scaled, unit) = match value {
        v if !(1e-4..1e12).contains(&v) => return format!("{v:.2e}").replace(".00e", "e").replace("0e", "e"),
        v if v >= 1e9 => (v * 1e-9, "G"),
        v if v >= 1e6 => (v * 1e-6, "M"),
        v if v >= 1e4 => (v * 1e-3, "k"),
        v => (v, ""),
    };
    // what a tick has, without the noise of its last bits
    let digits = (3 - scaled.log10().floor() as i32).max(0) as usize;
    let text = format!("{scaled:.digits$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    format!("{text}{unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(values: &[f64], most: usize) -> Vec<String> {
        let axis = LogAxis::of(values.iter().copied()).unwrap();
        let ticks = axis.ticks(|t| t.len() <= most);
        ticks.into_iter().map(|t| t.text).filter(|t| !t.is_empty()).collect()
    }

    #[test]
    fn numbers_are_round_and_few() {
        assert_eq!(texts(&[1.0, 10.0], 5), ["1", "2", "3", "5", "10"]);
        assert_eq!(texts(&[0.001, 0.5], 4), ["0.001", "0.01", "0.1"]);
        assert_eq!(texts(&[3.0, 3.1], 7), ["2", "2.5", "3", "3.5", "4", "4.5", "5"]);
        assert_eq!(texts(&[1e4, 2.5e7], 4), ["10k", "100k", "1M", "10M"]);
        assert_eq!(texts(&[1e-7, 1e-5], 3), ["1e-7", "1e-6", "1e-5"]);
        assert!(texts(&[1e-100, 1e100], 8).len() > 1);
        // whatever the range there are two numbers at least, if there is room for seven
        for k in 0..2000 {
            let lo = 1e-6 * 1.013f64.powi(k);
            for span in [1.0, 1.1, 1.7, 2.4, 3.0, 5.0, 5.9, 6.1, 9.0, 30.0, 200.0, 1e4, 1e6] {
                let found = texts(&[lo, lo * span], 7);
                assert!(found.len() >= 2, "{lo} {span}: {found:?}");
                assert!(found.iter().all(|t| t.len() <= 8), "{found:?}");
                assert!(found.windows(2).all(|w| w[0] != w[1]), "{found:?}");
            }
        }
    }

    #[test]
    fn values_lie_where_they_should() {
        let axis = LogAxis::of([1.0, 100.0, f64::NAN, 0.0, f64::INFINITY].into_iter()).unwrap();
        assert!((axis.place(10.0) - 0.5).abs() < 1e-12);
        assert!(axis.place(1.0) > 0.0 && axis.place(100.0) < 1.0);
        assert_eq!((axis.clamped(1e9), axis.clamped(0.0)), (1.0, 0.0));
        assert_eq!(LogAxis::of([0.0, -1.0, 5e-324, 1e-320, f64::MIN_POSITIVE, f64::MAX].into_iter()), None);
        let widest = LogAxis::of([1e-320, 1e-100, 1e100, 1e308].into_iter()).unwrap();
        assert!(widest.ends().iter().all(|end| end.is_finite() && *end > 0.0) && (widest.place(1.0) - 0.5).abs() < 1e-9);
        // all but one value
        assert!((LogAxis::of([5.0].into_iter()).unwrap().place(5.0) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn numbers_are_short() {
        let values = [0.002, 0.5, 10.0, 1e4, 2.5e6, 25e6, 3e-5, 1000.0, 5000.0, 0.30000000000000004];
        assert_eq!(values.map(short), ["0.002", "0.5", "10", "10k", "2.5M", "25M", "3e-5", "1000", "5000", "0.3"]);
    }
}
