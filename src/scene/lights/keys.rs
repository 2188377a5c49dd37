//! `key=value` of a light's description, and what its values may be.

use std::ops::RangeInclusive;

use glam::{DVec3, Vec3};

use crate::settings::parse::{parse_number, parse_vector};

/// Values by key, each asked for once.
pub struct Keys<'a> {
    kind: &'a str,
    given: Vec<(&'a str, &'a str)>,
}

impl<'a> Keys<'a> {
    /// Creates the keys that are given for a kind of light; messages name the kind.
    pub fn new(kind: &'a str, given: Vec<(&'a str, &'a str)>) -> Self {
        Self { kind, given }
    }

    /// The text of a key, if it is given.
    pub fn take(&mut self, key: &str) -> Option<&'a str> {
        let at = self.given.iter().position(|(k, _)| *k == key)?;
        Some(self.given.remove(at).1)
    }

    /// The value of a key that must be given.
    ///
    /// # Errors
    /// That it is missing, or what is wrong with its value.
    pub fn needed<T>(&mut self, key: &str, parse: impl Fn(&str) -> Result<T, String>) -> Result<T, String> {
        let text = self.take(key).ok_or_else(|| format!("{} needs {key}=...", self.kind))?;
        parse(text).map_err(|e| format!("{key}={text}: {e}"))
    }

    /// The value of a key, or a default.
    ///
    /// # Errors
    /// What is wrong with its value.
    pub fn or<T>(&mut self, key: &str, default: T, parse: impl Fn(&str) -> Result<T, String>) -> Result<T, String> {
        match self.take(key) {
            Some(text) => parse(text).map_err(|e| format!("{key}={text}: {e}")),
            None => Ok(default),
        }
    }

    /// `value`, if all keys have been taken.
    ///
    /// # Errors
    /// The key that the kind does not have.
    pub fn end<T>(&self, value: T) -> Result<T, String> {
        match self.given.first() {
            Some((key, _)) => Err(format!("{} has no {key}", self.kind)),
            None => Ok(value),
        }
    }
}

/// A finite number above 0.
///
/// # Errors
/// What is wrong, in words.
pub fn positive(text: &str) -> Result<f64, String> {
    parse_number(text).and_then(|v| if v > 0.0 && v.is_finite() { Ok(v) } else { Err("must be above 0".into()) })
}

/// A position, `X,Y,Z`.
///
/// # Errors
/// What is wrong, in words.
pub fn position(text: &str) -> Result<DVec3, String> {
    parse_vector(text)
}

/// A direction, made of unit length.
///
/// # Errors
/// What is wrong, in words.
pub fn direction(text: &str) -> Result<DVec3, String> {
    parse_vector(text)?.try_normalize().ok_or_else(|| "has no direction".into())
}

/// An angle in a range of degrees, as radians.
pub fn degrees(range: RangeInclusive<f64>) -> impl Fn(&str) -> Result<f64, String> {
    move |text| {
        let v = parse_number(text)?;
        let (least, most) = (range.start(), range.end());
        if range.contains(&v) { Ok(v.to_radians()) } else { Err(format!("must be {least} to {most} degrees")) }
    }
}

/// `WIDTH,HEIGHT`, both above 0.
///
/// # Errors
/// What is wrong, in words.
pub fn size(text: &str) -> Result<[f64; 2], String> {
    let (w, h) = text.split_once(',').ok_or("expected WIDTH,HEIGHT")?;
    Ok([positive(w)?, positive(h)?])
}

/// A linear colour that is nowhere negative.
///
/// # Errors
/// What is wrong, in words.
pub fn colour(text: &str) -> Result<Vec3, String> {
    let c = parse_vector(text)?;
    if c.min_element() < 0.0 { Err("light is not negative".into()) } else { Ok(c.as_vec3()) }
}
