//! Lights and environments in addition to those of the scene's file.

use std::path::PathBuf;

use glam::{DMat3, DVec3, Vec3};

use crate::error::{Error, Result};
use crate::scene::environments::BuiltinEnvironment;
#[cfg(feature = "cli")]
use crate::scene::light_spec;
use crate::scene::light_spec::LightSpec;
use crate::scene::sky::Sky;
use crate::scene::{Environment, Light, Scene, load};
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
        /// Environment light: a map, a radiance R,G,B, a built-in one, or `none` [default: the
        /// scene's]
        ///
        /// A map is an equirectangular .hdr, .exr, .png, .jpg or .webp, or a folder with the six
        /// faces of a cube. Built in are a clear `sky`, `studio`, `softbox` and `overcast`.
        ///
        /// `sky:ELEVATION,AZIMUTH,TURBIDITY` says where the sun is, -6 to 90 degrees above the
        /// horizon and in degrees clockwise from -z, and how hazy the air is, 1 to 10; numbers may
        /// be left out from the end [35,215,2.5]. A radiance of 1 is 25,000 candela per square metre.
        /// The mean radiance of `studio`, `softbox` and `overcast` is 1.
        ///
        /// A scene without any light gets a grey sky and a soft sun, or a lamp if the camera is in
        /// a closed room, and the render prints them as options; `none` leaves it dark.
        environment: Option<String>, option(value_name = "FILE|R,G,B|sky|none", value_parser = parse_environment), applies(LIT), basic;
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

/// The text of an environment; what it says of a sky is checked.
#[cfg(feature = "cli")]
fn parse_environment(text: &str) -> Result<String, String> {
    Sky::parse(text).transpose().map(|_| text.to_owned())
}

/// An environment as it is asked for.
enum Wanted {
    None,
    Radiance(DVec3),
    Sky(Result<Sky, String>),
    Builtin(BuiltinEnvironment),
    File(PathBuf),
}

impl Wanted {
    fn parse(text: &str) -> Self {
        match (text, parse_vector(text), Sky::parse(text)) {
            ("none", ..) => Self::None,
            (_, Ok(radiance), _) => Self::Radiance(radiance),
            (_, _, Some(sky)) => Self::Sky(sky),
            _ => match BuiltinEnvironment::from_name(text) {
                Some(builtin) => Self::Builtin(builtin),
                None => Self::File(PathBuf::from(text)),
            },
        }
    }
}

impl LightingSettings {
    /// Adds the lights to a scene, and replaces its environment if one is given.
    ///
    /// # Errors
    /// [`Error::Input`] for a map that cannot be read, [`Error::Usage`] for a negative radiance and
    /// for a sky that there is not.
    pub fn apply(&self, scene: &mut Scene) -> Result<()> {
        if let Some((environment, sun)) = self.environment(&mut |warning| scene.report.warnings.push(warning))? {
            scene.environment = environment;
            scene.lights.extend(sun);
        }
        self.light.iter().for_each(|l| l.add(scene));
        Ok(())
    }

    /// The file or folder of the environment, if it is one.
    pub fn environment_file(&self) -> Option<PathBuf> {
        match Wanted::parse(self.environment.as_ref()?) {
            Wanted::File(path) => Some(path),
            _ => None,
        }
    }

    /// The environment, and the sun that belongs to it.
    fn environment(&self, warn: &mut dyn FnMut(String)) -> Result<Option<(Environment, Option<Light>)>> {
        let Some(text) = &self.environment else { return Ok(None) };
        let scale = self.environment_scale.unwrap_or(1.0);
        let turn = self.environment_turn.unwrap_or(0.0);
        let environment = match Wanted::parse(text) {
            Wanted::None => Environment::Black,
            Wanted::Radiance(colour) if colour.min_element() < 0.0 => {
                return Err(Error::Usage(format!("--environment {text}: radiance must not be negative")));
            }
            Wanted::Radiance(colour) => Environment::Uniform(colour.as_vec3() * scale as f32),
            Wanted::Sky(sky) => {
                let sky = sky.map_err(|e| Error::Usage(format!("--environment {text}: {e}")))?;
                // counter-clockwise, as maps are turned
                let (map, sun) = Sky { azimuth: sky.azimuth - turn, ..sky }.light(scale);
                return Ok(Some((Environment::Map(map), sun)));
            }
            Wanted::Builtin(builtin) => Environment::Map(builtin.map(scale, turn.to_radians())),
            Wanted::File(path) => {
                let mut map = load::load_environment_with(&path, warn)?;
                map.factor = Vec3::splat(scale as f32);
                map.to_map = DMat3::from_rotation_y(-turn.to_radians());
                Environment::Map(map)
            }
        };
        Ok(Some((environment, None)))
    }
}
