//! Images that are black: whether one is, why, and from where it would not be.

use std::time::Duration;

use crate::error::Result;
use crate::film::Control;
use crate::realtime::display::DisplayMode;
use crate::renderer::RenderSettings;
use crate::renderer::interactive::{Interactive, View, ViewPicture};
use crate::renderer::survey::rays::camera_ray;
use crate::scene::Camera;
use crate::settings::Capability;

/// Brightest value, of 255, of a pixel that counts as black.
const BLACK: u8 = 3;
/// One in so many pixels may be brighter: samples of a path are few at first.
const BRIGHT: usize = 500;
/// Rays through the image, along its width and height, that find what is in view.
const VIEW: [usize; 2] = [60, 40];
/// Least share of what is in view that a view of the whole scene has to show from its front.
const FRONTS: f64 = 0.3;
/// Width of the images that cameras are compared by, pixels.
const PREVIEW: u32 = 64;
/// Steps of such an image until it counts as black, and the time of each.
const PREVIEW_STEPS: u32 = 4;
const PREVIEW_TIME: Duration = Duration::from_millis(30);

/// Returns true if nothing is to be seen on an image.
pub fn is_black(picture: &ViewPicture) -> bool {
    let most = picture.rgba.len() / 4 / BRIGHT;
    let is_bright = |p: &&[u8]| p[..3].iter().any(|v| *v > BLACK);
    picture.rgba.chunks_exact(4).filter(is_bright).take(most + 1).count() <= most
}

/// Surfaces that a camera has in view.
struct Seen {
    /// Share of its rays that hit something.
    hits: f64,
    /// Share of those that hit a surface on its front.
    fronts: f64,
}

impl Seen {
    fn by(session: &Interactive, camera: &Camera, aspect: f64) -> Result<Self> {
        let [columns, rows] = VIEW;
        let at = |k: usize| [((k % columns) as f64 + 0.5) / columns as f64, ((k / columns) as f64 + 0.5) / rows as f64];
        let rays: Vec<_> = (0..columns * rows).map(|k| camera_ray(camera, at(k), aspect)).collect();
        let seen = session.visible_surfaces(&rays)?;
        let hits = seen.iter().flatten().count();
        let fronts = seen.iter().flatten().filter(|s| s.is_front).count();
        Ok(Self { hits: hits as f64 / rays.len() as f64, fronts: fronts as f64 / hits.max(1) as f64 })
    }
}

/// Why a black image of these settings is black, if that is no property of what it shows.
/// `brightest`: of its values, before they are exposed.
///
/// # Errors
/// Those of the device.
pub fn reason(
    session: &Interactive,
    camera: &Camera,
    aspect: f64,
    settings: &RenderSettings,
    brightest: f32,
) -> Result<Option<String>> {
    let seen = Seen::by(session, camera, aspect)?;

    // the most likely reason is the first that holds
    let capabilities = settings.integrator().get().capabilities();
    let shows_buffer = settings.frames.show.is_some_and(|show| show != DisplayMode::Result);
    let is_light = capabilities.contains(&Capability::SceneLights);
    let is_occlusion = capabilities.contains(&Capability::AmbientOcclusion);
    let radius = settings.integrators.ao.radius();
    let text = match () {
        // so few pixels make no image that counts as bright
        () if seen.hits <= 1.0 / BRIGHT as f64 => {
            "Black: nothing of the scene is in view, or too little of it to be seen. F frames it".to_owned()
        }
        () if shows_buffer => return Ok(None),
        () if is_light && brightest > 0.0 && settings.picture.exposure.unwrap_or(0.0) < 0.0 => {
            "Black at this exposure: Picture has another".to_owned()
        }
        () if is_light && session.scene().is_dark() => {
            "Black: the scene has no light. Drop an .hdr here, or add a light in Light".to_owned()
        }
        () if seen.fronts < FRONTS => {
            "Black: the camera is behind a wall or inside something, only backs of surfaces are in view. F frames the scene"
                .to_owned()
        }
        () if is_light => "Black: no light reaches what is in view. F frames the scene".to_owned(),
        () if is_occlusion && radius.is_finite() => {
            format!(
                "Black: everything in view is occluded within the AO radius of {radius}. Take a smaller one, or F frames the scene"
            )
        }
        () if is_occlusion => {
            "Black: every ray hits something in a closed room. Give an AO radius, or F frames the scene".to_owned()
        }
        () => return Ok(None),
    };
    Ok(Some(text))
}

/// The first of some cameras whose image is not black; `None` if all are. `frames`: it shows
/// something from its front, too, if any does.
///
/// # Errors
/// Those of the device and of `control`.
pub fn first_visible(
    session: &mut Interactive,
    settings: &RenderSettings,
    aspect: f64,
    cameras: Vec<Camera>,
    frames: bool,
    control: &mut dyn Control,
) -> Result<Option<Camera>> {
    let height = (f64::from(PREVIEW) / aspect).round().clamp(1.0, f64::from(4 * PREVIEW)) as u32;
    let mut view = View::new(session, settings, [PREVIEW, height], control)?;
    let mut visible = None;
    for camera in cameras {
        view.reset();
        let mut shows = false;
        for _ in 0..PREVIEW_STEPS {
            view.step(session, &camera, PREVIEW_TIME, control)?;
            shows = view.picture()?.is_some_and(|picture| !is_black(&picture));
            if shows {
                break;
            }
        }
        if !shows {
            continue;
        }
        if !frames || Seen::by(session, &camera, aspect)?.fronts >= FRONTS {
            return Ok(Some(camera));
        }
        visible.get_or_insert(camera);
    }
    Ok(visible)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_bright_pixels_are_still_black() {
        let picture = |bright: usize| {
            let rgba = (0..1000).flat_map(|k| if k < bright { [0, 9, 0, 255] } else { [3, 0, 1, 255] }).collect();
            ViewPicture { size: [100, 10], rgba }
        };
        assert!(is_black(&picture(0)) && is_black(&picture(2)) && !is_black(&picture(3)));
    }
}
