//! The images that ambient light is compared with, in two halves of independent samples.

use glam::DVec3;

use super::samples::Samples;
use super::{AoVersusPathSettings, Steps};
use crate::error::{Error, Result};
use crate::film::Control;
use crate::integrators::path::ambient::EnvironmentLight;
use crate::output::Image;
use crate::renderer::{RenderSettings, Renderer};
use crate::scene::Environment;

/// Share of the progress that each render has, per sample of a pixel.
const COST: [f64; 5] = [6.0, 1.5, 1.5, 1.0, 3.0];

/// An image in two independent halves, channels interleaved.
pub type Halves = [Vec<f32>; 2];

pub struct References {
    /// Light of paths of two or more bounces: what direct light lacks.
    pub indirect: Halves,
    /// Emitted light and direct light, that of the environment included.
    pub direct: Halves,
    /// Light of emitters and all lights but the environment; `None` without an environment.
    pub lights: Option<Halves>,
    /// Image of the integrator `ao-sky`, one channel.
    pub sky: Halves,
    pub samples: Samples,
}

/// The subject of a render.
#[derive(Clone, Copy, PartialEq)]
enum Reference {
    Indirect,
    Direct,
    Lights,
    Samples,
    Sky,
}

impl References {
    pub fn render(renderer: &mut Renderer, settings: &AoVersusPathSettings, control: &mut dyn Control) -> Result<Self> {
        let [width, height] = settings.size;
        let samples = Samples::new(width as usize * height as usize, settings.ao_samples_per_half())?;
        let mut references = Self {
            indirect: Halves::default(),
            direct: Halves::default(),
            lights: None,
            sky: Halves::default(),
            samples,
        };
        let black =
            matches!(renderer.scene().environment, Environment::Black) && settings.lighting.environment.is_none();
        let mut renders = vec![Reference::Indirect, Reference::Direct];
        if !black {
            renders.push(Reference::Lights);
            references.lights = Some(Halves::default());
        }
        // the last has a tracer of its own, without materials
        renders.extend([Reference::Samples, Reference::Sky]);
        let cost = |r: &Reference| COST[*r as usize];
        let total = 2.0 * renders.iter().map(cost).sum::<f64>();
        let mut started = 0.0;
        for render in &renders {
            for half in 0..2 {
                let mut steps = Steps { control: &mut *control, first: started / total, share: cost(render) / total };
                references.add(renderer, settings, *render, half, &mut steps)?;
                started += cost(render);
            }
        }
        Ok(references)
    }

    fn add(
        &mut self,
        renderer: &mut Renderer,
        settings: &AoVersusPathSettings,
        render: Reference,
        half: usize,
        control: &mut dyn Control,
    ) -> Result<()> {
        let wanted = render.settings(settings, half)?;
        if render == Reference::Samples {
            let samples = &mut self.samples;
            return renderer
                .ambient_samples(&wanted, control, &mut |pixel, of_pixel| samples.add(half, pixel, of_pixel));
        }
        let image = renderer.still(&wanted, control)?.image;
        match render {
            Reference::Indirect => self.indirect[half] = colors(&image)?,
            Reference::Direct => self.direct[half] = colors(&image)?,
            Reference::Lights => self.lights.get_or_insert_default()[half] = colors(&image)?,
            _ => self.sky[half] = channel(&image, "R")?.to_vec(),
        }
        Ok(())
    }
}

impl Reference {
    fn settings(self, from: &AoVersusPathSettings, half: usize) -> Result<RenderSettings> {
        let mut out = RenderSettings { scene: from.scene.clone(), camera: from.camera.clone(), ..Default::default() };
        let (name, samples) = match self {
            Self::Indirect => ("path", from.spp_per_half()),
            Self::Direct => ("direct", from.spp_per_half()),
            Self::Lights => ("lit", from.spp_per_half()),
            Self::Samples => ("lit", from.ao_samples_per_half()),
            Self::Sky => ("ao-sky", from.spp_per_half()),
        };
        out.integrator = Some(name.parse()?);
        out.image.size = Some(from.size);
        out.image.spp = Some(samples);
        out.image.seed = Some(from.seed.wrapping_mul(2).wrapping_add(half as u32));
        let path = &mut out.integrators.path;
        match self {
            Self::Indirect => {
                (path.min_depth, path.max_depth, path.firefly_clamp) = (Some(2), from.max_depth, from.firefly_clamp);
            }
            Self::Lights => {
                (path.ambient, path.environment_light) = (Some(DVec3::ZERO), Some(EnvironmentLight::Ambient));
            }
            Self::Sky => path.sky_albedo = from.sky_albedo,
            Self::Samples => out.integrators.ao.ao_normal = from.ao_normal,
            Self::Direct => {}
        }
        if self != Self::Sky {
            out.lighting = from.lighting.clone();
        }
        Ok(out)
    }
}

fn channel<'a>(image: &'a Image, name: &str) -> Result<&'a [f32]> {
    image.f32(name).ok_or_else(|| Error::CheckFailed(format!("the image has no channel {name}")))
}

/// The colour channels, interleaved.
fn colors(image: &Image) -> Result<Vec<f32>> {
    let planes = [channel(image, "R")?, channel(image, "G")?, channel(image, "B")?];
    Ok((0..planes[0].len()).flat_map(|p| planes.map(|plane| plane[p])).collect())
}
