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

impl<'de> Deserialize<'de> for Length {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_read_and_written() {
        let parse = |text: &str| text.parse::<Length>();
        for (text, length) in [
            ("2.5", Length::Units(2.5)),
            ("inf", Length::Units(f64::INFINITY)),
            ("5%", Length::OfDiagonal(0.05)),
            ("7%", Length::OfDiagonal(7.0 / 100.0)),
            ("0.3%", Length::OfDiagonal(0.3 / 100.0)),
            ("250%", Length::OfDiagonal(2.5)),
            ("auto", Length::Auto),
        ] {
            assert_eq!(parse(text), Ok(length), "{text}");
            assert_eq!(length.to_string(), text);
            let json = serde_json::to_string(&length).unwrap();
            assert_eq!(serde_json::from_str::<Length>(&json).unwrap(), length, "{json}");
        }
        for wrong in ["0", "-1", "nan", "0%", "inf%", "%", "", "5 %%", "Auto", "1m"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
        assert_eq!(serde_json::to_string(&Length::Units(2.0)).unwrap(), "2.0");
        assert!(serde_json::from_str::<Length>("-1").is_err());
        assert_eq!(
            [Length::Units(3.0), Length::OfDiagonal(0.5), Length::Auto].map(|l| l.units(4.0)),
            [Some(3.0), Some(2.0), None]
        );
    }
}
