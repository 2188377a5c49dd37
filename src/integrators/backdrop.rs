//! The background of a scene: camera rays that leave it show it, apart from what lights it.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use crate::error::{Error, Result};
use crate::output::settings::{Background, check_alpha};
use crate::output::{ImageFormat, is_animation};
use crate::settings::{Editable, Value};

/// The background: camera rays that leave the scene show it. Mirrors and glass show the environment
/// whatever it is, and so does light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Backdrop {
    /// The environment as it is.
    #[default]
    Map,
    /// The environment, blurred.
    Blurred,
    /// Nothing in images, and a linear colour in pictures: sRGB primaries, each channel 0 to 1.
    Colour([f32; 3]),
    /// Nothing: alpha is 0 there.
    Transparent,
}

impl Backdrop {
    /// The background that pictures are put on; `None` where the image itself has it.
    pub fn of_pictures(self) -> Option<Background> {
        match self {
            Self::Map | Self::Blurred => None,
            Self::Colour(colour) => Some(Background::Colour(colour)),
            Self::Transparent => Some(Background::Transparent),
        }
    }

    /// The colour of pictures, linear.
    pub fn colour(self) -> Option<[f32; 3]> {
        if let Self::Colour(colour) = self { Some(colour) } else { None }
    }

    /// Whether camera rays do not show the environment.
    pub fn hides_environment(self) -> bool {
        self.of_pictures().is_some()
    }

    /// Checks that an image of an integrator has it. `sees_environment`: it shows environments.
    ///
    /// # Errors
    /// [`Error::Usage`], naming the setting and what to do about it.
    pub fn check(self, sees_environment: bool, integrator: &str) -> Result<()> {
        if sees_environment || self.hides_environment() {
            return Ok(());
        }
        Err(Error::Usage(format!(
            "--background {self}: --integrator {integrator} shows no environment; leave --background out, give a colour R,G,B or transparent, or use --integrator path"
        )))
    }

    /// Checks that it has an effect on one of these files and that all of them can have it.
    /// `sees_environment`: the image would show the environment without it.
    ///
    /// # Errors
    /// [`Error::Usage`], naming the setting and what to do about it.
    pub fn check_files(self, outputs: &[PathBuf], sees_environment: bool) -> Result<()> {
        let Some(background) = self.of_pictures() else { return Ok(()) };
        let is_picture = |p: &PathBuf| is_animation(p) || ImageFormat::from_path(p).is_ok_and(ImageFormat::is_picture);
        let hides = sees_environment && background == Background::Transparent;
        if !hides && !outputs.iter().any(is_picture) {
            return Err(Error::Usage(
                "--background has no effect without a .png, .webp, .jpg or .apng output: leave it out, or add such an output"
                    .into(),
            ));
        }
        check_alpha(Some(background), outputs)
    }
}

impl FromStr for Backdrop {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.trim() {
            "map" => Ok(Self::Map),
            "blurred" => Ok(Self::Blurred),
            text => match text.parse() {
                Ok(Background::Transparent) => Ok(Self::Transparent),
                Ok(Background::Colour(colour)) => Ok(Self::Colour(colour)),
                Err(_) => {
                    Err("expected `map`, `blurred`, `transparent`, or a linear colour R,G,B of numbers from 0 to 1"
                        .into())
                }
            },
        }
    }
}

impl fmt::Display for Backdrop {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Map => f.write_str("map"),
            Self::Blurred => f.write_str("blurred"),
            Self::Colour(colour) => Background::Colour(*colour).fmt(f),
            Self::Transparent => Background::Transparent.fmt(f),
        }
    }
}

impl serde::Serialize for Backdrop {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> serde::Deserialize<'de> for Backdrop {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

impl Editable for Option<Backdrop> {
    fn value(&mut self) -> Value<'_> {
        Value::Other
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backdrops_are_text() {
        for text in ["map", "blurred", "transparent", "0.25,0.5,1"] {
            let backdrop: Backdrop = text.parse().unwrap();
            assert_eq!(backdrop.to_string(), text);
            let json = serde_json::to_string(&backdrop).unwrap();
            assert_eq!(serde_json::from_str::<Backdrop>(&json).unwrap(), backdrop, "{json}");
        }
        assert_eq!("hidden".parse(), Ok(Backdrop::Transparent));
        for bad in ["", "white", "1,1", "0,0,2"] {
            assert!(bad.parse::<Backdrop>().unwrap_err().contains("`blurred`"), "{bad}");
        }
    }

    #[test]
    fn files_and_integrators_have_it() {
        let check = |backdrop: Backdrop, file: &str, sees| backdrop.check_files(&[file.into()], sees).is_ok();
        assert!(check(Backdrop::Transparent, "a.exr", true) && !check(Backdrop::Transparent, "a.exr", false));
        assert!(!check(Backdrop::Transparent, "a.jpg", true) && check(Backdrop::Colour([1.0; 3]), "a.jpg", true));
        assert!(!check(Backdrop::Colour([1.0; 3]), "a.exr", true) && check(Backdrop::Blurred, "a.exr", true));
        assert!(Backdrop::Blurred.check(false, "ao").is_err_and(|e| e.to_string().contains("--integrator path")));
        assert!(Backdrop::Transparent.check(false, "ao").is_ok() && Backdrop::Map.check(true, "path").is_ok());
    }
}
