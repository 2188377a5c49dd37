//! Options of what is baked, as `skylit bake` and frames of `skylit verify` have them.

use crate::error::{Error, Result};
use crate::integrators::IntegratorName;
use crate::integrators::ao::{Hemisphere, Occlusion};
use crate::integrators::lighting::LightingSettings;
use crate::renderer::{RenderSettings, Renderer};
use crate::scene::SceneSettings;
use crate::settings::Length;
use crate::settings::parse::parse_falloff;

use super::{BakeSettings, LightSettings, Map, SeamTreatment, Space, TexcoordChoice};

/// Largest width and height of a texture.
const MAX_SIZE: u32 = 16384;

/// What is baked, of which surfaces, and how well it is sampled.
#[derive(Clone, Debug, clap::Args)]
pub struct BakeOptions {
    /// Property of the surfaces
    #[arg(long, value_enum, default_value = "ao")]
    pub map: Map,
    /// Width and height of textures in texels, WIDTHxHEIGHT or one number
    #[arg(long, value_name = "SIZE", default_value = "1024", value_parser = parse_size)]
    pub size: [u32; 2],
    /// Samples per texel, or per corner of a triangle with --to vertices; rounded up to a power of two
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub spp: u32,
    /// More samples for texels whose standard error is larger, 64 times --spp at most
    #[arg(long, value_name = "ERROR", value_parser = parse_error)]
    pub target_error: Option<f64>,
    /// Integrator of --map light: path, direct, whitted or ao-sky [default: path]
    #[arg(long, value_name = "NAME", value_parser = str::parse::<IntegratorName>)]
    pub integrator: Option<IntegratorName>,
    /// Maximum path length of --map light in bounces; 1 is direct light [default: no limit]
    #[arg(long, value_name = "N")]
    pub max_depth: Option<u32>,
    /// Seed of the random numbers
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u32,
    /// Radius of occlusion [default: that of `render`; of thickness 10%, of curvature 1%]
    ///
    /// Hits beyond do not occlude. Of thickness and curvature it is the length of rays.
    #[arg(long, value_name = "R|PERCENT%|auto", value_parser = str::parse::<Length>)]
    pub ao_radius: Option<Length>,
    /// Falloff: a hit at distance d occludes by C^-d; 1 is binary [default: 1]
    #[arg(long, value_name = "C", value_parser = parse_falloff)]
    pub ao_falloff: Option<f64>,
    /// Normal of the hemisphere
    #[arg(long, value_enum, default_value = "geometric")]
    pub ao_normal: Hemisphere,
    /// A ground plane under the scene occludes, too
    #[arg(long)]
    pub ground: bool,
    /// Texture coordinates: the number of a set, `unwrap` for new ones, or `auto`
    ///
    /// `auto` takes set 1 or 0 if no two places share a texel, else new ones.
    #[arg(long, value_name = "auto|N|unwrap", default_value = "auto", value_parser = str::parse::<TexcoordChoice>)]
    pub texcoord: TexcoordChoice,
    /// Texels around charts that get the value of the nearest covered texel [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=16384))]
    pub padding: Option<u32>,
    /// Filter noise in the texture, not across edges or charts (biased)
    #[arg(long)]
    pub denoise: bool,
    /// Edges whose two sides lie apart in the texture
    #[arg(long, value_enum, default_value = "leave")]
    pub seams: SeamTreatment,
    /// Coordinates of directions and positions
    #[arg(long, value_enum, default_value = "world")]
    pub space: Space,
    /// Average over all instances of a mesh, not the first alone
    #[arg(long)]
    pub average_instances: bool,
    /// Bake one texture for all materials, with new coordinates that have room for all of them
    ///
    /// Coordinates that the model has are taken if all materials together share no texel in them.
    #[arg(long)]
    pub atlas: bool,
    /// Bake this material alone; may be given several times [default: all]
    #[arg(long, value_name = "NAME")]
    pub only_material: Vec<String>,
    /// Light of --map light
    #[command(flatten)]
    pub lighting: LightingSettings,
}

fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let (width, height) = text.split_once('x').unwrap_or((text, text));
    let side = |t: &str| t.trim().parse().ok().filter(|n| (1..=MAX_SIZE).contains(n));
    let size = side(width).zip(side(height)).map(|(w, h)| [w, h]);
    size.ok_or_else(|| format!("expected texels, WIDTHxHEIGHT or one number from 1 to {MAX_SIZE}"))
}

fn parse_error(text: &str) -> Result<f64, String> {
    let error = text.trim().parse().ok().filter(|e: &f64| *e > 0.0 && *e < 1.0);
    error.ok_or_else(|| "expected a number between 0 and 1".to_owned())
}

/// Options with nothing left open.
pub struct CompleteOptions {
    /// The settings, with a radius in scene units.
    pub settings: BakeSettings,
    /// Sentences on what was chosen.
    pub remarks: Vec<String>,
    /// The light besides the scene's.
    pub lighting: LightingSettings,
}

impl BakeOptions {
    /// Checks that options go together.
    ///
    /// # Errors
    /// [`Error::Usage`] with the remedy.
    pub fn check(&self) -> Result<()> {
        let is_light = self.map == Map::Light;
        let has_path_options = self.integrator.is_some() || self.max_depth.is_some();
        let has_reach = self.ao_radius.is_some() || self.ao_falloff.is_some();
        let refusals = [
            (
                self.target_error.is_some() && (!self.map.is_sampled() || is_light),
                "--target-error is for textures of what rays sample, but for light",
            ),
            (
                is_light && (has_reach || self.ao_normal != Hemisphere::default()),
                "--ao-radius, --ao-falloff and --ao-normal have no effect on --map light",
            ),
            (
                !is_light && (self.lighting != LightingSettings::default() || has_path_options),
                "--environment, --light, --integrator and --max-depth are for --map light",
            ),
            (
                self.seams == SeamTreatment::Match && self.map.is_vector() && self.space == Space::Tangent,
                "--seams match is for textures, and not for directions in tangent space, which turns at a seam",
            ),
            (
                self.atlas && matches!(self.texcoord, TexcoordChoice::Set(_)),
                "--texcoord: an atlas needs coordinates in which all materials lie apart; leave it out, or choose unwrap",
            ),
        ];
        match refusals.into_iter().find(|(is_refused, _)| *is_refused) {
            Some((_, reason)) => Err(Error::Usage(reason.to_owned())),
            None => Ok(()),
        }
    }

    /// Chooses what is left open by what the scene is like, whose file means what `meaning` says.
    ///
    /// # Errors
    /// Those of the renderer, and [`Error::Usage`] for a radius that a map cannot have.
    pub fn complete(&self, renderer: &mut Renderer, meaning: &SceneSettings) -> Result<CompleteOptions> {
        renderer.apply_scene_settings(meaning)?;
        let bounds = renderer.scene().bounds();
        let diagonal = bounds.map_or(1.0, |(low, high)| (high - low).length());
        let mut remarks = Vec::new();

        // a light map has the light of a render
        let light = LightSettings { integrator: self.integrator, max_depth: self.max_depth };
        let mut lighting = self.lighting.clone();
        if self.map == Map::Light {
            let (scene, integrator) = (meaning.clone(), Some(light.integrator()?));
            let mut settings =
                RenderSettings { scene, integrator, lighting: lighting.clone(), ..RenderSettings::default() };
            settings.integrators.path.max_depth = self.max_depth;
            settings.check()?;
            let completed = renderer.complete(&settings, None)?;
            remarks.extend(completed.choices.into_iter().filter(|line| line.starts_with("light")));
            if completed.chosen.lighting != LightingSettings::default() {
                lighting = completed.chosen.lighting;
            }
        }

        // the radius of ambient occlusion is chosen as that of a render
        let own = self.map.default_radius().map(Length::OfDiagonal);
        let unlimited = (self.map == Map::Light).then_some(Length::Units(f64::INFINITY));
        let wanted = self.ao_radius.or(own).or(unlimited);
        let radius = match wanted.and_then(|length| length.units(diagonal)) {
            Some(units) => units,
            None => {
                let mut settings = RenderSettings { scene: meaning.clone(), ..RenderSettings::default() };
                settings.integrators.ao.ao_radius = wanted;
                let completed = renderer.complete(&settings, None)?;
                remarks.extend(completed.choices.into_iter().filter(|line| line.starts_with("AO radius")));
                completed.settings.integrators.ao.radius()
            }
        };
        if own.is_some() && !radius.is_finite() {
            return Err(Error::Usage(format!(
                "--ao-radius {radius}: --map {} needs a length, as 10%",
                self.map.name()
            )));
        }
        let settings = BakeSettings {
            map: self.map,
            size: self.size,
            spp: self.spp,
            target_error: self.target_error,
            seed: self.seed,
            occlusion: Occlusion { radius, falloff: self.ao_falloff.unwrap_or(1.0), hemisphere: self.ao_normal },
            has_ground: self.ground,
            texcoords: self.texcoord,
            padding: self.padding.map_or(f64::INFINITY, f64::from),
            is_smoothed: self.denoise,
            seams: self.seams,
            space: self.space,
            averages_instances: self.average_instances,
            is_atlas: self.atlas,
            materials: self.only_material.clone(),
            light,
            ..BakeSettings::default()
        };
        if renderer.scene().rig.is_some() {
            remarks.push("the scene is animated: its rest pose is baked".to_owned());
        }
        Ok(CompleteOptions { settings, remarks, lighting })
    }
}
