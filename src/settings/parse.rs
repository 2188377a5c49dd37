//! Parses values of options, and checks their ranges.

use std::time::Duration;

#[cfg(feature = "cli")]
use clap::error::{ContextKind, ContextValue, ErrorKind};
use glam::DVec3;

/// A value, or a description of what is expected.
pub type Parsed<T> = std::result::Result<T, String>;

/// The message of clap about wrong arguments, in one line.
#[cfg(feature = "cli")]
pub fn usage_message(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let lines = text.lines().map(str::trim).take_while(|l| !l.starts_with("Usage:") && !l.starts_with("For more"));
    let words = lines.filter(|l| !l.is_empty()).collect::<Vec<_>>().join(" ");
    // --json=FILE and --json FILE, as `skylit bench` has them
    let about_json = match (error.kind(), error.get(ContextKind::InvalidArg)) {
        (ErrorKind::TooManyValues, Some(ContextValue::String(name))) => name == "--json",
        (ErrorKind::UnknownArgument, Some(ContextValue::String(name))) => name.ends_with(".json"),
        _ => false,
    };
    let remedy = if about_json { ": this command prints its record on stdout, so write `--json > FILE`" } else { "" };
    words.trim_start_matches("error: ").to_owned() + remedy
}

/// Options as they are parsed alone from the words of a command line, without its command.
#[cfg(feature = "cli")]
pub fn parse_args<A: clap::Args>(words: &[impl AsRef<str>]) -> std::result::Result<A, clap::Error> {
    let command = clap::Command::new("skylit").no_binary_name(true).disable_help_flag(true).disable_version_flag(true);
    A::from_arg_matches(&A::augment_args(command).try_get_matches_from(words.iter().map(AsRef::as_ref))?)
}

/// Any number that is not NaN.
pub fn parse_number(text: &str) -> Parsed<f64> {
    text.trim().parse::<f64>().ok().filter(|v| !v.is_nan()).ok_or_else(|| "expected a number".to_owned())
}

/// `X,Y,Z`, finite.
pub fn parse_vector(text: &str) -> Parsed<DVec3> {
    let parts =
        text.split(',').map(parse_number).collect::<Parsed<Vec<_>>>().map_err(|_| "expected X,Y,Z".to_owned())?;
    match parts[..] {
        [x, y, z] if parts.iter().all(|v| v.is_finite()) => Ok(DVec3::new(x, y, z)),
        _ => Err("expected three finite numbers X,Y,Z".into()),
    }
}

/// A radiance `R,G,B`: finite, not negative.
pub fn parse_radiance(text: &str) -> Parsed<DVec3> {
    parse_vector(text)
        .ok()
        .filter(|c| c.min_element() >= 0.0)
        .ok_or_else(|| "expected three finite numbers R,G,B that are not negative".into())
}

/// Parses a number for which `holds` is true; `rule` is the error message.
pub fn parse_where(text: &str, holds: impl Fn(f64) -> bool, rule: &str) -> Parsed<f64> {
    parse_number(text).and_then(|v| if holds(v) { Ok(v) } else { Err(rule.to_owned()) })
}

/// A field of view, 0.001 to 179 degrees.
pub fn parse_fov(text: &str) -> Parsed<f64> {
    // beyond this range, the tangent in single precision is too inaccurate
    parse_where(text, |v| (0.001..=179.0).contains(&v), "must be between 0.001 and 179 degrees")
}

/// A distance above 0 in scene units; may be infinite.
pub fn parse_radius(text: &str) -> Parsed<f64> {
    parse_where(text, |v| v > 0.0, "must be above 0 (`inf` for no limit)")
}

/// A base of the falloff: 1 or above.
pub fn parse_falloff(text: &str) -> Parsed<f64> {
    parse_where(text, |v| v >= 1.0 && v.is_finite(), "must be at least 1 (1 = binary) and finite")
}

/// Seconds above 0.
pub fn parse_time(text: &str) -> Parsed<f64> {
    parse_where(text, |v| v > 0.0 && v <= 1e9, "must be above 0 seconds")
}

/// Seconds, 0 or above.
pub fn parse_playback_time(text: &str) -> Parsed<f64> {
    parse_where(text, |v| (0.0..=1e9).contains(&v), "must be a number of seconds, not negative")
}

/// A time above 0, given in seconds.
pub fn parse_seconds(text: &str) -> Parsed<Duration> {
    parse_time(text).map(Duration::from_secs_f64)
}

/// A bound: 0 or above.
pub fn parse_limit(text: &str) -> Parsed<f64> {
    parse_where(text, |v| v >= 0.0, "must not be negative")
}

/// A number above 0.
pub fn parse_positive(text: &str) -> Parsed<f64> {
    parse_where(text, |v| v > 0.0, "must be above 0")
}

/// A factor: finite, 0 or above.
pub fn parse_factor(text: &str) -> Parsed<f64> {
    parse_where(text, |v| v >= 0.0 && v.is_finite(), "must be finite and not negative")
}

/// An albedo above 0, at most 1.
pub fn parse_albedo(text: &str) -> Parsed<f64> {
    parse_where(text, |v| v > 0.0 && v <= 1.0, "must be above 0 and at most 1")
}

/// A bound on an error: finite, above 0.
pub fn parse_target(text: &str) -> Parsed<f64> {
    parse_where(text, |v| v > 0.0 && v.is_finite(), "must be finite and above 0")
}

/// A frame rate, 0.01 to 1000 frames per second.
pub fn parse_rate(text: &str) -> Parsed<f64> {
    parse_where(text, |v| (0.01..=1000.0).contains(&v), "must be between 0.01 and 1000 frames per second")
}
