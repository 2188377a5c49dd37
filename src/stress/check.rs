//! A figure, the bound that it is held against, and what came of it.

use serde::Serialize;

use crate::tracer::TracerKind;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The figure is within its bound.
    Holds,
    /// The figure is beyond its bound, or could not be measured.
    Fails,
    /// The device or the scene lacks what the check is about.
    NotApplicable,
    /// A figure without a bound.
    Reported,
}

/// The side of a bound on which figures hold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Bound {
    AtMost(f64),
}

impl Bound {
    /// Returns true if a figure is within the bound; one that is not a number never is.
    pub fn holds(self, value: f64) -> bool {
        match self {
            Bound::AtMost(bound) => value <= bound,
        }
    }
}

/// A figure, its bound, and what they mean.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Name of the section, in [`super::SECTIONS`].
    pub section: &'static str,
    /// The quantity that was measured, in a few words.
    pub name: String,
    /// The tracer, or `None` for the CPU alone.
    pub tracer: Option<TracerKind>,
    /// The figure; not a number if it could not be measured.
    pub value: f64,
    /// Unit of the figure and its bound; may be empty.
    pub unit: &'static str,
    /// The bound; `None` for figures that are reported only.
    pub bound: Option<Bound>,
    pub verdict: Verdict,
    /// A sentence on what the figure means; may be empty.
    pub sentence: String,
    pub seconds: f64,
}

impl Check {
    fn new(name: impl Into<String>, value: f64, unit: &'static str, bound: Option<Bound>) -> Self {
        let verdict = match bound {
            None => Verdict::Reported,
            Some(bound) if bound.holds(value) => Verdict::Holds,
            Some(_) => Verdict::Fails,
        };
        Self {
            section: "",
            name: name.into(),
            tracer: None,
            value,
            unit,
            bound,
            verdict,
            sentence: String::new(),
            seconds: 0.0,
        }
    }

    /// A check that holds for figures up to `bound`.
    pub fn at_most(name: impl Into<String>, value: f64, unit: &'static str, bound: f64) -> Self {
        Self::new(name, value, unit, Some(Bound::AtMost(bound)))
    }

    pub fn reported(name: impl Into<String>, value: f64, unit: &'static str) -> Self {
        Self::new(name, value, unit, None)
    }

    /// A count that must be 0; what is the affair of a driver (`is_ours` is false) is reported
    /// only.
    pub fn none_of(name: impl Into<String>, count: u64, unit: &'static str, is_ours: bool) -> Self {
        Self::new(name, count as f64, unit, is_ours.then_some(Bound::AtMost(0.0)))
    }

    /// A check that cannot be made here, and why.
    pub fn not_applicable(name: impl Into<String>, why: impl Into<String>) -> Self {
        Self { verdict: Verdict::NotApplicable, ..Self::new(name, f64::NAN, "", None) }.says(why)
    }

    /// A check that should have been made and could not be.
    pub fn failed(name: impl Into<String>, error: impl std::fmt::Display) -> Self {
        Self { verdict: Verdict::Fails, ..Self::new(name, f64::NAN, "", None) }.says(error.to_string())
    }

    pub fn says(self, sentence: impl Into<String>) -> Self {
        Self { sentence: sentence.into(), ..self }
    }

    pub fn tracer_name(&self) -> &'static str {
        self.tracer.map_or("cpu", TracerKind::name)
    }

    /// The figure with its unit: `1.2e-5 of radiance`; a dash if there is none.
    pub fn figure(&self) -> String {
        with_unit(self.value, self.unit)
    }

    /// The bound in words: `at most 0 leaks`; empty if there is none.
    pub fn bound_text(&self) -> String {
        match self.bound {
            None => String::new(),
            Some(Bound::AtMost(b)) => format!("at most {}", number(b)),
        }
    }
}

/// A number in at most three digits after the first; whole numbers below ten million in full.
pub fn number(value: f64) -> String {
    match value.abs() {
        _ if value.is_nan() => "-".to_owned(),
        a if a == a.trunc() && a < 1e7 => format!("{}", value.trunc() as i64),
        a if (1e-2..1e5).contains(&a) => {
            let digits = (3 - a.log10().floor() as i32).clamp(0, 6) as usize;
            format!("{value:.digits$}")
        }
        _ => format!("{value:.2e}"),
    }
}

fn with_unit(value: f64, unit: &str) -> String {
    if unit.is_empty() || value.is_nan() { number(value) } else { format!("{} {unit}", number(value)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_held_against_bounds() {
        let verdict = |c: Check| c.verdict;
        assert_eq!(verdict(Check::at_most("a", 1.0, "", 1.0)), Verdict::Holds);
        assert_eq!(verdict(Check::at_most("a", 1.1, "", 1.0)), Verdict::Fails);
        assert_eq!(verdict(Check::at_most("a", f64::NAN, "", 1.0)), Verdict::Fails);
        assert_eq!(verdict(Check::reported("a", f64::NAN, "")), Verdict::Reported);
        assert_eq!(verdict(Check::none_of("a", 1, "leaks", true)), Verdict::Fails);
        assert_eq!(verdict(Check::none_of("a", 1, "leaks", false)), Verdict::Reported);
    }

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (-3.0, "-3"),
            (1e6, "1000000"),
            (0.25, "0.2500"),
            (1234.5, "1234"),
            (1.234e-5, "1.23e-5"),
            (4e38, "4.00e38"),
            (f64::NAN, "-"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
