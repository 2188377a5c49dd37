//! Lengths that fit the scene.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A length of the scene: `2.5`, `5%`, `inf`, `auto`; in files also a number of scene units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Length {
    /// Scene units, above 0; may be infinite.
    Units(f64),
    /// Share of the diagonal of the scene's bounds, above 0 and finite: 0.05 is `5%`.
    OfDiagonal(f64),
    /// Chosen by what the camera sees.
    Auto,
}

impl Length {
    /// Length in scene units, or `None` for [`Length::Auto`]. `diagonal`: of the scene's bounds.
    pub fn units(self, diagonal: f64) -> Option<f64> {
        match self {
            Self::Units(units) => Some(units),
            Self::OfDiagonal(share) => Some(share * diagonal),
            Self::Auto => None,
        }
    }
}

impl FromStr for Length {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let text = text.trim();
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let expected = "expected a length above 0 in scene units, a share of the scene's diagonal such as 5%, \
                        `inf` for no limit, or `auto`";
        let above_0 = |text: &str| text.trim().parse::<f64>().ok().filter(|v| *v > 0.0).ok_or(expected);
        match text.strip_suffix('%') {
            Some(percent) => {
                let percent = above_0(percent)?;
                if percent.is_finite() { Ok(Self::OfDiagonal(percent / 100.0)) } else { Err(expected.into()) }
            }
            None => Ok(Self::Units(above_0(text)?)),
        }
    }
}

impl fmt::Display for Length {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Units(units) => units.fmt(f),
            // rounded, because 0.07 * 100 is 7.000000000000001
            Self::OfDiagonal(share) => write!(f, "{}%", (share * 1e14).round() / 1e12),
            Self::Auto => f.write_str("auto"),
        }
    }
}

impl Serialize for Length {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            // JSON has no infinity
            Self::Units(units) if units.is_finite() => units.serialize(serializer),
            other => other.to_string().serialize(serializer),
        }
    }
}

/// Reads a value that files give as a number or as text.
///
/// # Errors
/// Those of its `FromStr`.
pub(crate) fn number_or_text<'de, D: Deserializer<'de>, T: FromStr<Err: fmt::Display>>(
    deserializer: D,
) -> Result<T, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Value {
        Number(f64),
        Text(String),
    }
    let text = match Value::deserialize(deserializer)? {
        Value::Number(number) => number.to_string(),
        Value::Text(text) => text,
    };
    text.parse().map_err(serde::de::Error::custom)
}

impl<'de> Deserialize<'de> for Length {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        number_or_text(deserializer)
    }
}
