//! The list of all integrators, and the choice of one by its name.

use super::{Integrator, ao, path};
use crate::error::{Error, Result};
use crate::settings::{self, Capability, GivenSetting};

/// All integrators, in the order in which they are listed to users.
pub static ALL: &[&dyn Integrator] = &[
    &ao::AmbientOcclusion,
    &path::kinds::PATH,
    &path::kinds::DIRECT,
    &path::kinds::LIT,
    &path::kinds::WHITTED,
    &path::kinds::AO_SKY,
    &path::kinds::NORMALS,
    &path::kinds::ALBEDO,
    &path::kinds::DEPTH,
    &path::kinds::BAKED_OCCLUSION,
];

/// The name of an existing integrator.
#[derive(Clone, Copy)]
pub struct IntegratorName(&'static dyn Integrator);

impl IntegratorName {
    /// Finds an integrator by name.
    pub fn find(name: &str) -> Option<Self> {
        ALL.iter().find(|i| i.name() == name).map(|i| Self(*i))
    }

    /// Name on the command line and in files.
    pub fn name(self) -> &'static str {
        self.0.name()
    }

    /// Returns true if the integrator can do this.
    pub fn can(self, capability: Capability) -> bool {
        self.0.can(capability)
    }

    /// The integrator.
    pub fn get(self) -> &'static dyn Integrator {
        self.0
    }
}

/// Name and capabilities of all integrators.
fn capabilities() -> Vec<settings::Integrator> {
    ALL.iter().map(|i| (i.name(), i.capabilities())).collect()
}

/// Checks that each of these settings has an effect on what an integrator renders: real-time frames
/// if `frames` is the setting that selects them, else a still.
///
/// # Errors
/// [`Error::Usage`] for the first setting without effect.
pub fn check(given: &[GivenSetting], integrator: IntegratorName, frames: Option<&GivenSetting>) -> Result<()> {
    settings::check(given, &(integrator.name(), integrator.get().capabilities()), &capabilities(), frames)
}

impl Default for IntegratorName {
    fn default() -> Self {
        Self(ALL[0])
    }
}

impl PartialEq for IntegratorName {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl std::fmt::Debug for IntegratorName {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for IntegratorName {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        let names = || ALL.iter().map(|i| i.name()).collect::<Vec<_>>().join(", ");
        Self::find(name).ok_or_else(|| Error::Usage(format!("unknown integrator {name}; choose one of {}", names())))
    }
}

impl serde::Serialize for IntegratorName {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> serde::Deserialize<'de> for IntegratorName {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

/// Parser of the command line, which lists the integrators with their descriptions.
#[cfg(feature = "cli")]
pub fn parser() -> impl clap::builder::TypedValueParser<Value = IntegratorName> {
    use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
    PossibleValuesParser::new(ALL.iter().map(|i| PossibleValue::new(i.name()).help(i.help())))
        .try_map(|name| name.parse::<IntegratorName>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrators::IntegratorSettings;

    #[test]
    fn integrators_have_names_of_their_own() {
        for integrator in ALL {
            assert_eq!(IntegratorName::find(integrator.name()).unwrap().name(), integrator.name());
            assert_eq!(ALL.iter().filter(|i| i.name() == integrator.name()).count(), 1);
        }
        assert!("ambient".parse::<IntegratorName>().unwrap_err().to_string().contains("choose one of ao, path"));
    }

    /// A setting that applies to no integrator would have no effect.
    #[test]
    fn settings_apply_to_some_integrator() {
        let mut settings = IntegratorSettings::default();
        let all = settings.ao.editable().into_iter().chain(settings.path.editable()).collect::<Vec<_>>();
        assert!(all.len() >= 14);
        for setting in all {
            assert!(capabilities().iter().any(|i| setting.applies.includes(i)), "{}", setting.name);
        }
    }
}
