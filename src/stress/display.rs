//! Section 8, filters and display: constants and hot pixels ([`super::hot_pixel`]) through every
//! filter, extreme radiance and NaN through every tone map and the sRGB transfer function.

use glam::DVec3;

use super::long_runs::{frames_off, traced};
use super::sampling::{self, emitter};
use super::{Check, Section, StressSession};
use crate::accel::flatten::FlatScene;
use crate::colour::{srgb_byte, srgb_decode, srgb_encode};
use crate::error::Result;
use crate::film::SampleSettings;
use crate::integrators::path::PathOptions;
use crate::output::tone_map::ToneMap;
use crate::realtime::{Filter, FilterKind, Preset, Settings};
use crate::scene::builtin::{SceneTransform, analytic, shapes};
use crate::tracer::{Tracer, TracerKind};

pub const SECTION: Section = Section {
    name: "display",
    title: "Filters and display",
    about: "constants and single hot pixels through filters, radiance of 1e30, negative and NaN, monotone tone maps",
    of_scene: false,
    run,
};

pub const TONE_MAPS: [ToneMap; 5] =
    [ToneMap::Linear, ToneMap::Exponential, ToneMap::Reinhard, ToneMap::Neutral, ToneMap::Agx];

/// Greys from 0 to beyond what any display shows.
fn greys() -> impl Iterator<Item = f32> {
    std::iter::once(0.0).chain((-400..=1200).map(|k| 10f32.powf(k as f32 * 0.025)))
}

/// Greys that a map shows darker than the grey before, by more than `tolerance`.
pub fn falls(map: impl Fn(f32) -> f32, tolerance: f32) -> usize {
    let mapped: Vec<f32> = greys().map(map).collect();
    mapped.windows(2).filter(|w| w[1].is_nan() || w[1] < w[0] - tolerance).count()
}

/// Counts colours that a map brings to no number of at least 0: NaN, negative and huge ones.
pub fn bad_colours(map: impl Fn([f32; 3]) -> [f32; 3]) -> usize {
    let hard = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.0, 1e-40, 1.0, 1e30, f32::MAX];
    let mut bad = 0;
    for r in hard {
        for g in hard {
            for b in [0.0, 1.0, 1e30, f32::NAN] {
                // slightly below 0 is what gamuts do, and is cut off later
                bad +=
                    usize::from(map([r, g, b]).iter().any(|x| !x.is_finite() || *x < -1e-3 && !(r < 0.0 || g < 0.0)));
            }
        }
    }
    bad
}

/// Filters of frames: that of the presets, and one that no preset has.
pub fn filters() -> Vec<(&'static str, Settings)> {
    let base = traced(Preset::Balanced);
    let a_trous = Filter { kind: FilterKind::Atrous, radius: 7, ..base.filter };
    vec![("box filter", base), ("a-trous filter", Settings { filter: a_trous, ..base })]
}

fn run(session: &mut StressSession) -> Result<()> {
    for map in TONE_MAPS {
        let name = format!("tone map {map} is monotone");
        session.measure(&name, None, |_, _| {
            // polynomials leave their end by a rounding
            let count = falls(|x| map.map([x; 3])[1], 1e-6);
            Ok(Check::at_most(name.as_str(), count as f64, "greys", 0.0)
                .says("of 1602 are shown darker than a darker one"))
        })?;
        let name = format!("tone map {map} of NaN, infinity and 1e30");
        session.measure(&name, None, |_, _| {
            Ok(Check::at_most(name.as_str(), bad_colours(|c| map.map(c)) as f64, "colours", 0.0)
                .says("of 324 become no numbers"))
        })?;
    }
    let name = "sRGB there and back";
    session.measure(name, None, |_, _| {
        let worst =
            (0..=1000).map(|k| k as f32 / 1000.0).map(|x| (srgb_decode(srgb_encode(x)) - x).abs()).fold(0.0, f32::max);
        let bytes = [f32::NAN, f32::NEG_INFINITY, -1.0, 0.0, 1.0, 1e30, f32::INFINITY].map(srgb_byte);
        let right = bytes[1..4] == [0; 3] && bytes[4..] == [255; 3];
        let value = if right { f64::from(worst) } else { f64::NAN };
        Ok(Check::at_most(name, value, "of 1", 1e-6).says(format!("NaN becomes {}, infinity {}", bytes[0], bytes[6])))
    })?;
    constants(session)?;
    super::hot_pixel::run(session)?;
    extremes(session)
}

fn constants(session: &mut StressSession) -> Result<()> {
    let (kinds, frames) = (session.setup().shading_tracers(), session.setup().effort().pick(6, 200));
    let plane = analytic::plane(20.0, SceneTransform::default());
    let closed = analytic::closed_box(2.0, SceneTransform::default());
    for (what, settings) in filters() {
        for (scene_name, scene, value) in [("a plane", &plane, 1.0f32), ("a closed box", &closed, 0.0)] {
            let name = format!("{what} of {scene_name}, {frames} frames");
            session.measure_each(&name, &kinds, |s, kind, _| {
                let tracer = Tracer::new(s.device(), kind, &FlatScene::new(scene), super::degenerate::NEEDS)?;
                let (off, seen) =
                    frames_off(&tracer, scene, &settings, frames, DVec3::new(0.007, 0.003, -0.004), value)?;
                let figure = if seen == 0 { f64::NAN } else { off as f64 };
                let is_ours = value == 1.0 || kind == TracerKind::Compute;
                let check = if is_ours {
                    Check::at_most(name.as_str(), figure, "pixels", 0.0)
                } else {
                    Check::reported(name.as_str(), figure, "pixels")
                };
                Ok(check.says(format!("of {seen} are not {value}, bit for bit")))
            })?;
        }
    }
    Ok(())
}

/// Radiance at the ends of single precision arrives on the film, and its picture is a picture.
fn extremes(session: &mut StressSession) -> Result<()> {
    let kinds = session.setup().shading_tracers();
    // from 1e30 on a sample counts as infinite
    for radiance in [9e29f32, 1e-30] {
        let name = format!("an emitter of {radiance:e} on a film");
        let mut scene = sampling::furnace(1.0, emitter(radiance));
        scene.environment = crate::scene::Environment::Black;
        scene.meshes[0].geometry = shapes::rectangle(DVec3::ZERO, DVec3::X * 40.0, DVec3::Y * 40.0);
        session.measure_each(&name, &kinds, |s, kind, w| {
            let flat = FlatScene::for_paths(&scene);
            let options = PathOptions { samples: SampleSettings::new([8, 8], 16, 0), ..Default::default() };
            let film = sampling::render(&super::scale::path_tracer(s, kind, &flat)?, &flat, &options, w)?.image.film;
            let off = film.mean.iter().map(|m| (f64::from(*m) / f64::from(radiance) - 1.0).abs()).fold(0.0, f64::max);
            let lost = sampling::not_finite(&film);
            let shown = film
                .mean
                .chunks(3)
                .filter(|c| TONE_MAPS.iter().any(|t| t.map([c[0], c[1], c[2]]).iter().any(|x| !x.is_finite())))
                .count();
            let value = if film.not_finite > 0 || shown > 0 { f64::NAN } else { off };
            Ok(Check::at_most(name.as_str(), value, "relative", 1e-6)
                .says(format!("off; {lost} values are not finite, variances included")))
        })?;
    }
    Ok(())
}
