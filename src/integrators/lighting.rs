//! Lights and environments in addition to those of the scene's file.

use std::path::PathBuf;

use glam::{DMat3, Vec3};

use crate::error::{Error, Result};
#[cfg(feature = "cli")]
use crate::scene::light_spec;
use crate::scene::light_spec::LightSpec;
use crate::scene::{Environment, Scene, load};
use crate::settings::parse::parse_vector;
#[cfg(feature = "cli")]
use crate::settings::parse::{parse_factor, parse_number};
use crate::settings::{AppliesTo, Capability, settings};

/// Integrators that lights apply to.
const LIT: AppliesTo = AppliesTo::all_of(Capability::SceneLights);

settings! {
    /// Light besides the scene's.
    "Light (--integrator path, direct, lit, whitted)"
    pub struct LightingSettings {
        /// Environment light: an equirectangular map (.hdr, .exr, .png, .jpg, .webp), a constant
        /// radiance R,G,B, or `none` [default: the scene's]
        ///
        /// A scene without any light gets a grey sky and a soft sun, or a lamp if the camera is in
        /// a closed room, and the render prints them as options; `none` leaves it dark.
        environment: Option<String>, option(value_name = "FILE|R,G,B|none"), applies(LIT), basic;
        /// Rotate the environment map about the vertical axis by this angle, counter-clockwise from
        /// above
        environment_turn: Option<f64>,
            option(value_name = "DEG", value_parser = parse_number, requires = "environment", allow_hyphen_values = true), applies(LIT);
        /// Factor of the environment's radiance
        environment_scale: Option<f64>,
            option(value_name = "X", value_parser = parse_factor, requires = "environment", allow_hyphen_values = true), applies(LIT);
        /// Add a light: its kind, then key=value, like "sun direction=0,-1,0 irradiance=3"; may be
        /// repeated
        light: Vec<LightSpec>,
            option(value_name = "SPEC", value_parser = light_spec::parse, long_help = light_spec::help()), applies(LIT), basic;
    }
}

impl LightingSettings {
    /// Adds the lights to a scene, and replaces its environment if one is given.
    ///
    /// # Errors
    /// [`Error::Input`] for a map that cannot be read, [`Error::Usage`] for a negative radiance.
    pub fn apply(&self, scene: &mut Scene) -> Result<()> {
        if let Some(environment) = self.environment(&mut |warning| scene.report.warnings.push(warning))? {
            scene.environment = environment;
        }
        self.light.iter().for_each(|l| l.add(scene));
        Ok(())
    }

    /// The file or folder of the environment, if it is one.
    pub fn environment_file(&self) -> Option<PathBuf> {
        self.environment.as_ref().filter(|text| *text != "none" && parse_vector(text).is_err()).map(PathBuf::from)
    }

    fn environment(&self, warn: &mut dyn FnMut(String)) -> Result<Option<Environment>> {
        let Some(text) = &self.environment else { return Ok(None) };
        if text == "none" {
            return Ok(Some(Environment::Black));
        }
        let scale = self.environment_scale.unwrap_or(1.0) as f32;
        if let Ok(colour) = parse_vector(text) {
            if colour.min_element() < 0.0 {
                return Err(Error::Usage(format!("--environment {text}: radiance must not be negative")));
            }
            return Ok(Some(Environment::Uniform(colour.as_vec3() * scale)));
        }
        let mut map = load::load_environment_with(&PathBuf::from(text), warn)?;
        map.factor = Vec3::splat(scale);
        map.to_map = DMat3::from_rotation_y(-self.environment_turn.unwrap_or(0.0).to_radians());
        Ok(Some(Environment::Map(map)))
    }
}
