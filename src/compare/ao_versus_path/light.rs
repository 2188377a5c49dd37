//! A light for scenes that have none.

use super::AoVersusPathSettings;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::integrators::lighting::LightingSettings;
use crate::renderer::{RenderSettings, Renderer};
use crate::scene::light_spec;

/// Size and samples of the image by which a scene is found to be closed.
const SIZE: [u32; 2] = [64, 36];
const SPP: u32 = 16;

/// Light for a scene that has none: a white environment of radiance 1, or, where nothing of it reaches what the camera sees, a sphere that emits in the middle of the scene's bounding box.
/// Its radius is a fiftieth of the box's diagonal, and at a quarter of the diagonal it makes an irradiance of 1.
///
/// # Errors
/// Those of [`Renderer::still`].
pub fn default_light(
    renderer: &mut Renderer,
    settings: &AoVersusPathSettings,
    control: &mut dyn Control,
) -> Result<LightingSettings> {
    let white = LightingSettings { environment: Some("1,1,1".into()), ..Default::default() };
    let mut direct = RenderSettings { camera: settings.camera.clone(), lighting: white.clone(), ..Default::default() };
    direct.integrator = Some("direct".parse()?);
    (direct.image.size, direct.image.spp) = (Some(SIZE), Some(SPP));
    // what is seen behind the scene is no light on it
    direct.integrators.path.min_depth = Some(1);
    if renderer.still(&direct, &mut Silent(control))?.report.mean > 0.0 {
        return Ok(white);
    }
    let Some((lo, hi)) = renderer.scene().bounds() else { return Ok(white) };
    let (middle, diagonal) = (0.5 * (lo + hi), (hi - lo).length());
    let radius = diagonal / 50.0;
    let radiance = (0.25 * diagonal / radius).powi(2) / std::f64::consts::PI;
    let text = format!("sphere position={},{},{} radius={radius} radiance={radiance}", middle.x, middle.y, middle.z);
    let light = light_spec::parse(&text).map_err(Error::Usage)?;
    Ok(LightingSettings { light: vec![light], ..Default::default() })
}

/// Interruption without progress.
struct Silent<'a>(&'a mut dyn Control);

impl Control for Silent<'_> {
    fn should_stop(&mut self) -> Result<bool> {
        self.0.should_stop()
    }
}
