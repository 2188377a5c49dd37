//! Declares settings: one struct is a part of the command line (with the feature `cli`), of
//! settings files and of the JSON record.
//!
//! Each setting names a [`Capability`] that an integrator needs for it, and whether it applies to
//! stills, real-time frames, or both: [`check`] rejects settings without effect. So an integrator
//! names its capabilities, and no setting names an integrator.

mod choices;
mod edit;
mod length;
pub mod parse;

pub(crate) use choices::choices;
pub use edit::{Choice, ChoiceValue, Editable, Setting, Value};
pub use length::Length;
pub(crate) use length::number_or_text;

use crate::error::{Error, Result};

/// Something that an integrator can do, and that settings are about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Capability {
    /// It computes ambient occlusion of a radius and falloff.
    AmbientOcclusion,
    /// Values are ambient visibility, from 0 to 1, and no light.
    AmbientVisibility,
    /// It renders frames in real time.
    RealTimeFrames,
    /// It adds ambient light.
    AmbientLight,
    /// It follows light from surface to surface.
    LightTransport,
    /// It computes all light of the scene, as other path tracers do.
    GlobalIllumination,
    /// The length of its paths can be chosen.
    PathLength,
    /// Directions can be sampled by a strategy of choice.
    SamplingStrategy,
    /// It sees the environment and the lights of the scene.
    SceneLights,
    /// The only light is a white sky, and surfaces are grey.
    WhiteSky,
    /// It reads textures.
    Textures,
    /// The camera has a pixel filter and a lens.
    CameraModel,
    /// Images are tone mapped.
    ToneMapping,
    /// Images can be denoised.
    Denoising,
    /// It can keep the rays of the first sample.
    KeptRays,
}

/// An integrator as settings see it: its name and its capabilities.
pub type Integrator = (&'static str, &'static [Capability]);

/// The integrators and kinds of output that a setting has an effect on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AppliesTo {
    /// The capability that an integrator needs; `None`: any integrator will do.
    pub capability: Option<Capability>,
    /// It applies to stills.
    pub stills: bool,
    /// It applies to real-time frames.
    pub frames: bool,
}

impl AppliesTo {
    /// Everything.
    pub const ALL: Self = Self { capability: None, stills: true, frames: true };
    /// Stills of any integrator.
    pub const STILLS: Self = Self { capability: None, stills: true, frames: false };
    /// Real-time frames of any integrator.
    pub const FRAMES: Self = Self { capability: None, stills: false, frames: true };

    /// Stills of the integrators that are capable of this.
    pub const fn stills_of(capability: Capability) -> Self {
        Self { capability: Some(capability), ..Self::STILLS }
    }

    /// Frames of the integrators that are capable of this.
    pub const fn frames_of(capability: Capability) -> Self {
        Self { capability: Some(capability), ..Self::FRAMES }
    }

    /// Stills and frames of the integrators that are capable of this.
    pub const fn all_of(capability: Capability) -> Self {
        Self { capability: Some(capability), ..Self::ALL }
    }

    /// Returns true if it applies to this integrator.
    pub fn includes(&self, integrator: &Integrator) -> bool {
        self.capability.is_none_or(|c| integrator.1.contains(&c))
    }
}

/// Who needs a setting, and so which help lists it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Most people need it: `-h` lists it, too.
    Basic,
    /// Some people need it: from `--help` on.
    Advanced,
    /// It is for research and for comparisons: `--help-all` alone lists it.
    Research,
}

impl Level {
    /// The level that a line of [`settings!`] names: advanced where it names none.
    ///
    /// # Panics
    /// For another word than `basic` or `research`; lines of settings are then not compiled.
    pub const fn from_words(words: &[&str]) -> Self {
        match words {
            [] => Self::Advanced,
            [word] if matches!(word.as_bytes(), b"basic") => Self::Basic,
            [word] if matches!(word.as_bytes(), b"research") => Self::Research,
            _ => panic!("a level is `basic` or `research`"),
        }
    }

    /// Returns true if `-h` does not list it.
    pub const fn is_hidden_from_short_help(self) -> bool {
        !matches!(self, Self::Basic)
    }

    /// Returns true if `--help` does not list it.
    pub const fn is_hidden_from_long_help(self) -> bool {
        matches!(self, Self::Research)
    }
}

/// A setting that the user has given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GivenSetting {
    /// Name in files: `max_depth`.
    pub name: &'static str,
    /// Integrators and images on which the setting has an effect.
    pub applies: AppliesTo,
}

impl GivenSetting {
    /// Name on the command line: `--max-depth`.
    pub fn option(&self) -> String {
        format!("--{}", self.name.replace('_', "-"))
    }
}

/// Returns true if the value is the default, so that the setting was not given.
pub fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// A list in words: `a`, `a or b`, `a, b or c`.
fn list(names: &[&str]) -> String {
    match names {
        [] => "none".into(),
        [one] => (*one).to_owned(),
        [most @ .., last] => format!("{} or {last}", most.join(", ")),
    }
}

/// Checks that each setting has an effect on what `integrator` renders: real-time frames if
/// `frames` is the setting that selects them, else a still. Errors name others of `all`.
///
/// # Errors
/// [`Error::Usage`] for the first setting without effect.
pub fn check(
    given: &[GivenSetting],
    integrator: &Integrator,
    all: &[Integrator],
    frames: Option<&GivenSetting>,
) -> Result<()> {
    let wrong = |text: String| Err(Error::Usage(text));
    for setting in given {
        let (option, applies) = (setting.option(), setting.applies);
        if let (Some(frames), false) = (frames, applies.frames) {
            return wrong(format!(
                "{option} is for stills, and {} selects frames in real time: leave one of them out",
                frames.option()
            ));
        }
        if !applies.includes(integrator) {
            let others: Vec<_> = all.iter().filter(|i| applies.includes(i)).map(|i| i.0).collect();
            return wrong(format!(
                "{option} has no effect on --integrator {}: leave it out, or use --integrator {}",
                integrator.0,
                list(&others)
            ));
        }
    }
    Ok(())
}

/// Declares settings: `name: type, option(arguments of clap), applies(AppliesTo), level;`, each
/// with its help text as documentation. The [`Level`] is `basic` or `research`, or left out.
///
/// A setting is an `Option`, a `bool` or a `Vec`; the default value means that it was not given.
macro_rules! settings {
    (
        $(#[$meta:meta])*
        $heading:literal
        $vis:vis struct $name:ident {
            $(
                $(#[doc = $doc:literal])+
                $field:ident: $type:ty, option($($option:tt)*), applies($applies:expr) $(, $level:ident)?;
            )*
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        #[cfg_attr(feature = "cli", derive(clap::Args))]
        #[cfg_attr(feature = "cli", command(next_help_heading = $heading))]
        $vis struct $name {
            $(
                $(#[doc = $doc])+
                #[serde(skip_serializing_if = "crate::settings::is_default")]
                #[cfg_attr(feature = "cli", arg(
                    long,
                    hide_short_help = const {
                        crate::settings::Level::from_words(&[$(stringify!($level))?]).is_hidden_from_short_help()
                    },
                    hide_long_help = const {
                        crate::settings::Level::from_words(&[$(stringify!($level))?]).is_hidden_from_long_help()
                    },
                    $($option)*
                ))]
                pub $field: $type,
            )*
        }

        impl $name {
            /// The settings that were given.
            pub fn given(&self) -> Vec<$crate::settings::GivenSetting> {
                let mut out = Vec::new();
                $(
                    if !$crate::settings::is_default(&self.$field) {
                        out.push($crate::settings::GivenSetting { name: stringify!($field), applies: $applies });
                    }
                )*
                out
            }

            /// Removes the settings that `keeps` returns false for, so that their defaults hold.
            pub fn retain(&mut self, keeps: &dyn Fn(&str, $crate::settings::AppliesTo) -> bool) {
                $(
                    if !keeps(stringify!($field), $applies) {
                        self.$field = Default::default();
                    }
                )*
            }

            /// Takes the settings that `other` gives.
            pub fn override_with(&mut self, other: &Self) {
                $(
                    if !$crate::settings::is_default(&other.$field) {
                        self.$field = other.$field.clone();
                    }
                )*
            }

            /// All settings, for editors.
            pub fn editable(&mut self) -> Vec<$crate::settings::Setting<'_>> {
                vec![$(
                    $crate::settings::Setting {
                        name: stringify!($field),
                        help: concat!($($doc),+).trim(),
                        applies: $applies,
                        level: $crate::settings::Level::from_words(&[$(stringify!($level))?]),
                        value: $crate::settings::Editable::value(&mut self.$field),
                    },
                )*]
            }
        }
    };
}
pub(crate) use settings;

#[cfg(test)]
mod tests {
    use super::*;

    settings! {
        /// For this test.
        "Test"
        struct Some {
            /// First.
            max_depth: Option<u32>, option(value_name = "N"), applies(AppliesTo::stills_of(Capability::PathLength));
            /// Second.
            fps: Option<f64>, option(value_name = "N"), applies(AppliesTo::FRAMES), research;
        }
    }

    #[test]
    fn settings_know_what_they_are_for() {
        let mut some = Some { max_depth: Option::Some(3), fps: None };
        assert_eq!(some.editable().iter().map(|s| s.name).collect::<Vec<_>>(), ["max_depth", "fps"]);
        let [depth] = some.given()[..] else { panic!("one was given") };
        assert_eq!(depth.option(), "--max-depth");
        let all: [Integrator; 3] =
            [("ao", &[]), ("path", &[Capability::PathLength]), ("direct", &[Capability::PathLength])];
        let check =
            |given: &[GivenSetting], k: usize, frames: Option<&GivenSetting>| check(given, &all[k], &all, frames);
        assert!(check(&[depth], 1, None).is_ok());
        let text = |r: Result<()>| r.unwrap_err().to_string();
        assert!(text(check(&[depth], 0, None)).contains("use --integrator path or direct"));
        let fps = Some { fps: Option::Some(24.0), ..Default::default() }.given()[0];
        assert!(text(check(&[depth], 1, Option::Some(&fps))).contains("--fps selects frames"));
    }

    #[test]
    fn settings_are_files() {
        let some = Some { max_depth: Option::Some(3), fps: None };
        let text = serde_json::to_string(&some).unwrap();
        assert_eq!(text, r#"{"max_depth":3}"#);
        assert_eq!(serde_json::from_str::<Some>(&text).unwrap(), some);
        assert!(serde_json::from_str::<Some>(r#"{"max_deptth":3}"#).is_err());
    }

    #[test]
    fn settings_are_merged_and_removed_by_name() {
        let mut some = Some { max_depth: Option::Some(3), fps: Option::Some(24.0) };
        some.override_with(&Some { max_depth: None, fps: Option::Some(f64::INFINITY) });
        assert_eq!(some, Some { max_depth: Option::Some(3), fps: Option::Some(f64::INFINITY) });
        some.retain(&|name, applies| name == "fps" && applies == AppliesTo::FRAMES);
        assert_eq!(some, Some { max_depth: None, fps: Option::Some(f64::INFINITY) });
    }
}
