//! How far baked ambient occlusion is from traced, where cameras look at it.

use std::path::Path;

use super::BakeSettings;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::renderer::{RenderSettings, Renderer};
use crate::settings::Length;
use crate::tracer::DeviceSettings;

/// Width and height of the images that are compared, pixels.
const SIZE: [u32; 2] = [640, 360];
/// Samples per pixel of them.
const SPP: u32 = 64;

/// Differences of baked from traced ambient visibility, over the pixels that surfaces cover.
#[derive(Clone, Copy, Debug)]
pub struct Agreement {
    /// Number of pixels.
    pub pixels: usize,
    /// Root mean square.
    pub rmse: f64,
    /// Mean: positive where baked is brighter.
    pub bias: f64,
}

/// Renders a written model from the camera that `skylit render` chooses, with its occlusion
/// textures and with traced ambient occlusion.
///
/// # Errors
/// Those of the renderer.
pub fn measure(
    model: &Path,
    device: &DeviceSettings,
    settings: &BakeSettings,
    control: &mut dyn Control,
) -> Result<Agreement> {
    let mut renderer = Renderer::open(&model.to_string_lossy(), device)?;
    let mut render = |integrator: &str| {
        let name = integrator.parse()?;
        let mut image = RenderSettings { integrator: Some(name), ..RenderSettings::default() };
        image.image.size = Some(SIZE);
        image.image.spp = Some(SPP);
        if integrator == "ao" {
            image.integrators.ao.ao_radius = Some(Length::Units(settings.occlusion.radius));
            image.integrators.ao.ao_falloff = Some(settings.occlusion.falloff);
            image.integrators.ao.ao_normal = Some(settings.occlusion.hemisphere);
        }
        Ok::<_, Error>(renderer.still(&image, control)?.image)
    };
    let (traced, baked) = (render("ao")?, render("baked-occlusion")?);

    // pixels that surfaces cover in full, by both
    let planes = [("Y", &traced), ("A", &traced), ("A", &baked)].map(|(name, image)| image.f32(name));
    let grey = baked.f32("Y").or_else(|| baked.f32("R"));
    let ([Some(traced), Some(alpha), Some(covered)], Some(baked)) = (planes, grey) else {
        return Err(Error::Usage("--verify: the images have no ambient visibility to compare".to_owned()));
    };
    let pixels = traced.iter().zip(baked).zip(alpha.iter().zip(covered));
    let differences: Vec<f64> = pixels
        .filter(|(_, (a, b))| **a == 1.0 && **b == 1.0)
        .map(|((traced, baked), _)| f64::from(*baked) - f64::from(*traced))
        .collect();
    let n = differences.len().max(1) as f64;
    Ok(Agreement {
        pixels: differences.len(),
        rmse: (differences.iter().map(|d| d * d).sum::<f64>() / n).sqrt(),
        bias: differences.iter().sum::<f64>() / n,
    })
}
