//! Light for scenes that have none.

use glam::DVec3;

use super::framing::rounded;
use super::rays::{clip, view_rays};
use super::{Survey, significant};
use crate::error::{Error, Result};
use crate::integrators::lighting::LightingSettings;
use crate::scene::{Camera, Material, light_spec};

/// Radiance of the sky: neutral, so that colours are those of the surfaces.
const SKY: &str = "0.5,0.5,0.5";
/// The sun: from above, the left and before a scene seen from its front, ten times as wide as the
/// real one, for soft shadows. Together with the sky a white floor reflects a radiance of 0.9.
const SUN: &str = "sun direction=0.45,-1,-0.7 irradiance=1.65 angle=5";
/// Median irradiance in view of a closed room over pi: the radiance of white diffuse surfaces.
const LAMP: f64 = 0.5;
/// Rays through the image, along its width and height, that find what is in view.
pub(super) const VIEW: [usize; 2] = [24, 16];

/// Lights a scene without light, and names the light: sky and sun, or a lamp in a closed room.
pub fn choose(survey: &Survey, camera: &Camera, aspect: f64) -> Result<(LightingSettings, String)> {
    let eye = camera.camera_to_world.translation;
    let parse = |text: &str| light_spec::parse(text).map_err(Error::Usage);
    let Some(walls) = survey.walls(eye) else {
        let light = LightingSettings { environment: Some(SKY.into()), light: vec![parse(SUN)?], ..Default::default() };
        return Ok((light, "a grey sky and a soft sun".into()));
    };
    // above the camera, so that there are shadows; the first direction is upwards
    let lamp = rounded(eye + DVec3::Y * (0.5 * walls[0]), survey.diagonal());
    let views = view_rays(camera, aspect, VIEW);
    let mut seen = survey.trace(&views)?;
    clip(camera, &views, &mut seen);
    // irradiance of each surface by a lamp of one candela, without shadows, and its reflectance
    let mut lit: Vec<(f64, f64)> = views
        .iter()
        .zip(seen)
        .filter_map(|((from, direction), seen)| {
            let seen = seen?;
            let to_lamp = lamp - (*from + *direction * seen.distance);
            let distance = to_lamp.length().max(1e-30);
            let irradiance = seen.normal.dot(to_lamp / distance).max(0.0) / (distance * distance);
            (irradiance > 0.0).then(|| (irradiance, reflectance(&survey.scene().materials[seen.material])))
        })
        .collect();
    lit.sort_by(|a, b| a.0.total_cmp(&b.0));
    let median = lit.get(lit.len() / 2).map_or(1.0 / (walls[0] * walls[0]), |l| l.0);
    let reflectance = lit.iter().map(|l| l.1).sum::<f64>() / lit.len().max(1) as f64;
    // light that walls reflect onto each other adds up to 1 + r + r^2 + ... times the lamp's
    let intensity = LAMP * std::f64::consts::PI / median * (1.0 - reflectance);
    let intensity = significant(intensity, 4);
    let text = format!("point position={},{},{} intensity={intensity}", lamp.x, lamp.y, lamp.z);
    Ok((LightingSettings { light: vec![parse(&text)?], ..Default::default() }, "a lamp above the camera".into()))
}

/// About how much light a material reflects, at most 0.9; half of its colour if it has a texture.
fn reflectance(material: &Material) -> f64 {
    let colour = material.base_color.truncate().dot(glam::Vec3::new(0.2126, 0.7152, 0.0722));
    let texture = if material.base_color_texture.is_some() { 0.5 } else { 1.0 };
    f64::from(colour * texture).clamp(0.0, 0.9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rooms_have_a_lamp_and_the_rest_a_sky() {
        for (name, closed) in [("closed-box", true), ("stairs", false)] {
            let scene = crate::scene::builtin::by_name(name).unwrap();
            let survey = Survey::new(&scene);
            let (light, words) = choose(&survey, &scene.cameras[0], 1.5).unwrap();
            assert_eq!((light.environment.is_none(), light.light.len()), (closed, 1), "{name}: {words}");
            let mut lit = scene.clone();
            light.apply(&mut lit).unwrap();
            assert!(scene.is_dark() && !lit.is_dark());
        }
    }
}
