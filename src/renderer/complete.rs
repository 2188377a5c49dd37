//! Completes settings by the scene: the camera, the AO radius, and light where there is none.
//!
//! This is the one rule for all commands. Its choices are also known as options
//! ([`Completed::chosen`]): with them the same image is made, whatever becomes of the scene.

use glam::DVec3;

use super::settings::{DEFAULT_SIZE, options_text, size_of_aspect};
use super::shell::quoted;
use super::survey::own_light::{self, OwnLight};
use super::survey::radius::{CLOSED, TARGET};
use super::survey::{Survey, framing, light, radius, significant};
use super::{RenderSettings, Renderer};
use crate::error::Result;
use crate::integrators::lighting::LightingSettings;
use crate::scene::{Camera, ClipPlanes, Scene, SceneSettings};
use crate::settings::{Capability, Length};
use crate::stage;

/// Metadata key of the options that were chosen ([`Completed::chosen`]).
pub const CHOSEN: &str = "chosen";
/// Metadata key of the options by which the scene was loaded ([`Renderer::scene_options`]).
pub const SCENE_OPTIONS: &str = "scene.options";

/// AO radius of scenes that are too large to be looked at, as a share of the diagonal.
const LARGE_SCENE_RADIUS: f64 = 0.05;
/// Significant digits of an AO radius that is a share of the diagonal.
const RADIUS_DIGITS: usize = 6;

/// Width over height of a window whose size is not known yet.
const ASPECT: f64 = 16.0 / 9.0;

/// Settings with nothing left open.
pub struct Completed {
    /// The camera.
    pub camera: Camera,
    /// The settings, whose AO radius is a number of scene units.
    pub settings: RenderSettings,
    /// The camera, AO radius and light that the scene decided, as settings that choose the same.
    pub chosen: RenderSettings,
    /// A sentence for each choice, and how to choose otherwise.
    pub choices: Vec<String>,
}

impl Completed {
    /// The choices of the scene as options of `skylit render`; `None` if there are none.
    pub fn options(&self) -> Option<String> {
        Some(options_text(&self.chosen)).filter(|text| !text.is_empty())
    }
}

impl Renderer {
    /// Reads and lights the scene as settings say and completes them. `camera` replaces theirs.
    ///
    /// # Errors
    /// Those of the settings that do not fit the scene.
    pub fn complete(&mut self, settings: &RenderSettings, camera: Option<Camera>) -> Result<Completed> {
        let _stage = stage::begin("choosing what is left open");

        // what is chosen is chosen for what stands on the ground
        self.scene.take_ground();
        self.want_ground(settings.image.ground.unwrap_or_default(), settings.image.ground_height);
        self.apply_scene_settings(&settings.scene)?;
        let is_default = settings.lighting == LightingSettings::default();
        let integrator = settings.integrator().get();
        let capabilities = integrator.capabilities();
        // what has ambient light is not black without another
        let needs_light =
            capabilities.contains(&Capability::SceneLights) && !capabilities.contains(&Capability::AmbientLight);
        // the light of a dark scene stays as long as it makes no difference: nothing is rebuilt
        let stays = self.lighting.is_automatic && is_default && (needs_light || !integrator.sees_environment());
        if !stays {
            self.light(&settings.lighting)?;
        }
        let (mut chosen, mut choices) = (RenderSettings::default(), Vec::new());
        let mut settings = settings.clone();

        // the size
        if let Some((size, sentence)) = size_of_camera(&settings, &self.scene).filter(|_| camera.is_none()) {
            settings.image.size = Some(size);
            chosen.image.size = Some(size);
            choices.push(sentence);
        }
        let size = settings.size(&self.scene);
        crate::output::check_size(size[0], size[1])?;
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let survey = Survey::new(&self.scene);

        // the camera, by which the others are chosen
        let found = if camera.is_some() { None } else { settings.camera.automatic(&survey, aspect)? };
        let view = settings.camera.view;
        if let Some(found) = found {
            chosen.camera = found.settings();
            let none = if settings.camera.view.is_some() { "" } else { "the scene has none and is seen " };
            let options = options_text(&RenderSettings { camera: found.settings(), ..Default::default() });
            choices.push(format!("camera: {none}{} ({options})", found.words));
            settings.camera.view = None;
            settings.camera.override_with(&found.settings());
        }
        let mut camera = match camera {
            Some(camera) => camera,
            None => settings.camera.choose(&survey, aspect)?,
        };
        if let Some(view) = view {
            camera.name = view.to_string();
        }
        choices.extend(clipped(&camera, &survey));
        choices.extend(self.scene.report.remarks());

        // the AO radius
        if capabilities.contains(&Capability::AmbientOcclusion) {
            let wanted = settings.integrators.ao.ao_radius;
            let found = ao_radius(wanted, &survey, &camera, aspect)?;
            settings.integrators.ao.ao_radius = found.units.map(Length::Units);
            if settings.integrators.ao.ao_radius != wanted {
                chosen.integrators.ao.ao_radius = settings.integrators.ao.ao_radius;
            }
            choices.extend(found.sentence);
        }

        // light
        let needs_light = is_default && needs_light;
        let own_light = match self.lighting.own_light {
            None if needs_light && !self.lighting.is_automatic => Some(own_light::in_view(&survey, &camera, aspect)?),
            known => known,
        };
        let is_dark = own_light.is_none_or(|own| own != OwnLight::ShowsView);
        if needs_light && is_dark {
            let (lighting, words) = light::choose(&survey, &camera, aspect)?;
            let options = options_text(&RenderSettings { lighting: lighting.clone(), ..Default::default() });
            let why = match own_light {
                Some(OwnLight::LeavesBlack) => "what the scene has leaves the view black, and it gets",
                _ => "the scene has none and gets",
            };
            choices.push(format!("light: {why} {words} ({options}); --environment none leaves it dark"));
            chosen.lighting = lighting.clone();
            self.light(&lighting)?;
            self.lighting.is_automatic = true;
        }
        self.lighting.own_light = own_light;

        // the ground
        self.lay_ground();
        choices.extend(self.seen_from_below(&camera));
        Ok(Completed { camera, settings, chosen, choices })
    }

    /// A sentence on a ground that is seen from below.
    fn seen_from_below(&self, camera: &Camera) -> Option<String> {
        let height = self.scene.ground?.height;
        let is_below = camera.camera_to_world.translation.y < height;
        is_below.then(|| format!("ground: the camera is below it, at a height of {height} (--ground-height)"))
    }

    /// The options by which the scene was loaded and its file understood, as text: `--gltf-scene`,
    /// `--normals`, `--uv`, `--variant`, `--mtl-dissolve`; `None` if all are the defaults.
    pub fn scene_options(&self, settings: &SceneSettings) -> Option<String> {
        let understood = RenderSettings { scene: settings.clone(), ..Default::default() }.flags();
        let words = self.scene.report.options.iter().chain(&understood);
        Some(words.map(|word| quoted(word)).collect::<Vec<_>>().join(" ")).filter(|text| !text.is_empty())
    }

    /// Lights a dark scene that is seen from many places, by integrators of which some need it.
    ///
    /// # Errors
    /// Those of [`LightingSettings::apply`].
    pub(super) fn light_or_choose(&mut self, lighting: &LightingSettings) -> Result<()> {
        self.scene.take_ground();
        self.light(lighting)?;
        if *lighting == LightingSettings::default() && self.scene.is_dark() {
            let survey = Survey::new(&self.scene);
            let Ok((lo, hi)) = survey.bounds() else { return Ok(()) };
            let camera = match self.scene.cameras.first() {
                Some(camera) => camera.clone(),
                // the middle of a scene shows whether it is a closed room, without a hierarchy
                None if survey.is_small() && survey.walls((lo + hi) * 0.5).is_some() => {
                    framing::choose_on_host(&survey, ASPECT, None)?.camera()
                }
                None => Camera::framing(lo, hi, ASPECT),
            };
            let (lighting, _) = light::choose(&survey, &camera, ASPECT)?;
            self.light(&lighting)?;
            self.lighting.is_automatic = true;
        }
        Ok(())
    }
}

/// The image size of the scene's camera, and a sentence on it; `None` if given or the default.
fn size_of_camera(settings: &RenderSettings, scene: &Scene) -> Option<([u32; 2], String)> {
    if settings.image.size.or(scene.hints.size).is_some() {
        return None;
    }
    let aspect = settings.camera.scene_camera(scene)?.aspect?;
    let size = size_of_aspect(aspect).filter(|size| *size != DEFAULT_SIZE)?;
    let [width, height] = size;
    Some((
        size,
        format!("image size: {width}x{height}, of the aspect ratio of the scene's camera, {:.4} (--size)", aspect),
    ))
}

/// A sentence on clipping planes that hide something, as far as the scene's bounds tell.
fn clipped(camera: &Camera, survey: &Survey) -> Option<String> {
    let (lo, hi) = survey.bounds().ok().filter(|_| camera.clip != ClipPlanes::NONE)?;
    let to_camera = camera.camera_to_world.inverse();
    let corner =
        |k: usize| DVec3::from_array([0, 1, 2].map(|axis| if k >> axis & 1 == 0 { lo[axis] } else { hi[axis] }));
    let farthest = (0..8).map(|k| -to_camera.transform_point3(corner(k)).z).fold(0.0, f64::max);
    // a near plane is usually there for rasterizers
    let hides = camera.clip.far < farthest || camera.clip.near > 1e-2 * survey.diagonal();
    hides.then(|| {
        format!("clipping: the camera sees from {} to {} scene units (--clip)", camera.clip.near, camera.clip.far)
    })
}

/// An AO radius, and what there is to say about it.
struct ChosenRadius {
    /// Scene units; `None` for no limit that anyone asked for.
    units: Option<f64>,
    sentence: Option<String>,
}

fn ao_radius(wanted: Option<Length>, survey: &Survey, camera: &Camera, aspect: f64) -> Result<ChosenRadius> {
    let say = |units: f64, why: String| {
        Ok(ChosenRadius { units: Some(units), sentence: Some(format!("AO radius: {units} scene units, {why}")) })
    };
    let unlimited = || Ok(ChosenRadius { units: None, sentence: None });
    let diagonal = survey.diagonal();
    let share = |share: f64| significant(share * diagonal, RADIUS_DIGITS);
    match wanted {
        Some(Length::Units(units)) => return Ok(ChosenRadius { units: Some(units), sentence: None }),
        Some(length @ Length::OfDiagonal(part)) => {
            let units = share(part);
            return say(units, format!("{length} of the scene's diagonal (--ao-radius {units})"));
        }
        None if !survey.is_small() || survey.walls(camera.camera_to_world.translation).is_none() => return unlimited(),
        Some(Length::Auto) if !survey.is_small() => {
            let units = share(LARGE_SCENE_RADIUS);
            return say(
                units,
                format!("5% of the scene's diagonal, for the scene is too large to be looked at (--ao-radius {units})"),
            );
        }
        Some(Length::Auto) | None => {}
    }
    let Some(seen) = radius::measure(camera, aspect, diagonal, &|rays| survey.trace(rays))? else { return unlimited() };
    if wanted.is_none() && seen.open >= CLOSED {
        return unlimited();
    }
    let open = format!("{:.0} % of occlusion rays get out of the scene", 100.0 * seen.open);
    if !seen.radius.is_finite() {
        let sentence = Some(format!("AO radius: no limit, for {open} (--ao-radius inf)"));
        return Ok(ChosenRadius { units: Some(f64::INFINITY), sentence });
    }
    let (units, target) = (seen.radius, 100.0 * TARGET);
    say(
        units,
        format!(
            "at which surfaces in view are {target} % open on average (--ao-radius {units}); without a radius {open} (--ao-radius inf)"
        ),
    )
}
