//! A single hot pixel through every filter. Part of section 8, [`super::display`].
//!
//! A filter averages: nothing it makes is brighter than the hot pixel was or darker than the others
//! were, farther away than it reaches, or no number, up to the radiance that counts as infinite.

use glam::{DAffine3, DVec3};

use super::degenerate::random;
use super::sampling::{self, emitter, matte, scene_of};
use super::{Check, Setup, StressSession, Watch};
use crate::accel::flatten::FlatScene;
use crate::denoise::{self, DenoiseInput, Denoiser, Features};
use crate::error::Result;
use crate::film::Film;
use crate::film::SampleSettings;
use crate::film::camera::CameraRecord;
use crate::integrators::path::PathOptions;
use crate::interface::records::denoise::NLMEANS_RADIUS;
use crate::realtime::{Filter, FilterKind, Realtime, Settings};
use crate::scene::builtin::{SceneTransform, analytic, shapes};
use crate::scene::{Camera, Light, LightKind, Scene};
use crate::tracer::{Tracer, TracerKind};

/// Radiance of hot pixels beside one of [`COLD`]: a firefly's, and nearly what counts as infinite.
pub const HOT: [f32; 3] = [1e3, 1e10, 4e29];
/// Radiance of the other pixels of a still.
pub const COLD: f32 = 0.25;
/// Variance of a sample of the other pixels, where they have noise.
const NOISE: f32 = 0.01;
/// Side of a still's film, pixels.
const SIZE: u32 = 33;
/// Samples of a pixel beside a glint ([`beside_glint`]).
pub const GLINT_SAMPLES: u32 = 1024;
/// Bright samples among them.
pub const GLINT_HITS: u32 = 16;
/// By what share every second pixel is brighter, where they have detail.
pub const GLINT_DETAIL: f32 = 0.5;
/// Samples of a pixel under rare light ([`rare_light`]).
const RARE_SAMPLES: u32 = 64;
/// Share of the pixels that have met it.
const RARE_SHARE: f64 = 0.5;
/// Frames in which the camera moves before it rests.
const MOVES: u32 = 6;
const ALBEDO: f32 = 0.5;
/// Rounding, relative to the hot pixel or to the others.
const ROUNDING: f32 = 1e-4;

/// The traces of a hot pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spread {
    /// Values that are no numbers, brighter than the hot pixel or darker than the others.
    pub unsound: usize,
    /// Values beyond the filter's reach that are not those of the others.
    pub far: usize,
    /// Radiance above that of the others, of all pixels together, over that of the hot pixel.
    pub total: f64,
}

impl Spread {
    /// Counts an image of which pixel `k` is beyond reach where `is_far(k)`.
    pub fn measure(image: &[f32], cold: f32, hot: f32, is_far: impl Fn(usize) -> bool) -> Self {
        let mut out = Self::default();
        for (k, pixel) in image.chunks(3).enumerate() {
            for &value in pixel {
                out.unsound += usize::from(!(value >= cold * (1.0 - ROUNDING) && value <= hot * (1.0 + ROUNDING)));
                // false for NaN
                let is_cold = (value - cold).abs() <= cold * ROUNDING;
                out.far += usize::from(is_far(k) && !is_cold);
                out.total += f64::from(value - cold) / f64::from(hot - cold) / 3.0;
            }
        }
        out
    }

    fn check(&self, name: &str) -> Check {
        Check::at_most(name, (self.unsound + self.far) as f64, "values", 0.0).says(format!(
            "{} are no numbers or out of range, {} changed beyond its reach; what is brighter adds up to {:.3} of the hot pixel",
            self.unsound, self.far, self.total
        ))
    }
}

/// How far a filter reaches, in pixels along each axis.
fn reach(filter: &Filter) -> u32 {
    filter.steps().iter().map(|s| s.radius * s.stride).sum()
}

/// A film of [`COLD`] with one hot pixel in its middle. With noise, a variance is that of a pixel
/// with a single bright sample: that of the hottest overflows.
pub fn film(size: u32, hot: f32, noisy: bool) -> Film {
    film_of(size, 16, 1, hot, noisy)
}

/// See [`film`]. `hits`: samples of the hot pixel that have all of its radiance.
fn film_of(size: u32, spp: u32, hits: u32, hot: f32, noisy: bool) -> Film {
    let mut film = Film::new(size, size, 3);
    film.mean.fill(COLD);
    film.samples.fill(spp);
    film.coverage.fill(1.0);
    if noisy {
        film.variance.fill(NOISE);
    }
    let middle = (size * size / 2) as usize;
    for c in 0..3 {
        film.mean[3 * middle + c] = hot;
        film.variance[3 * middle + c] =
            if noisy { (f64::from(hot).powi(2) * f64::from(spp) / f64::from(hits)) as f32 } else { 0.0 };
    }
    film
}

/// Applies a still's filter to a film with a hot pixel.
pub fn still(
    setup: &Setup,
    kind: TracerKind,
    filter: FilterKind,
    hot: f32,
    noisy: bool,
    watch: &mut Watch,
) -> Result<Spread> {
    let image = filtered(setup, kind, filter, &film(SIZE, hot, noisy), watch)?;
    let settings = denoise::Settings { kind: filter, ..Default::default() };
    // non-local means follow
    let reach = reach(&Filter { kind: filter, radius: settings.radius, samples: f32::MAX }).max(NLMEANS_RADIUS);
    let is_far = |k: usize| [k as u32 % SIZE, k as u32 / SIZE].into_iter().any(|x| x.abs_diff(SIZE / 2) > reach);
    Ok(Spread::measure(&image, COLD, hot, is_far))
}

/// Farthest move of pixels of [`GLINT_SAMPLES`], which know their radiance, towards a glint a
/// thousand times as bright in `hits` of its samples, in its standard errors. Pixels of the sun are
/// such. Every second pixel is brighter by the share `detail`: a texture, not to be blurred.
pub fn beside_glint(
    setup: &Setup,
    kind: TracerKind,
    filter: FilterKind,
    hits: u32,
    detail: f32,
    watch: &mut Watch,
) -> Result<f64> {
    let spp = GLINT_SAMPLES;
    let mut film = film_of(SIZE, spp, hits, 1e3 * COLD, true);
    let middle = (SIZE * SIZE / 2) as usize;
    for (_, pixel) in film.mean.chunks_mut(3).enumerate().filter(|(k, _)| k % 2 == 1 && *k != middle) {
        pixel.iter_mut().for_each(|v| *v *= 1.0 + detail);
    }
    let image = filtered(setup, kind, filter, &film, watch)?;
    let others = image.iter().zip(&film.mean).enumerate().filter(|(k, _)| k / 3 != middle);
    let worst = others.fold(0.0f64, |worst, (_, (v, own))| {
        let off = f64::from((v - own).abs());
        if off.is_nan() { f64::NAN } else { worst.max(off) }
    });
    Ok(worst / f64::from(NOISE / spp as f32).sqrt())
}

/// Error of rare light after a still's filter over that before, root mean squares. A random half of
/// the pixels have met light in one of [`RARE_SAMPLES`]. The others' samples are all alike, which
/// is no reason to keep them. The film says `noise` times the variance of samples.
pub fn rare_light(setup: &Setup, kind: TracerKind, filter: FilterKind, noise: f32, watch: &mut Watch) -> Result<f64> {
    let mut film = Film::new(SIZE, SIZE, 3);
    film.samples.fill(RARE_SAMPLES);
    film.coverage.fill(1.0);
    for (k, (mean, variance)) in film.mean.chunks_mut(3).zip(film.variance.chunks_mut(3)).enumerate() {
        let is_lit = random(k as u32, 0) < RARE_SHARE;
        mean.fill(if is_lit { 2.0 * COLD } else { COLD });
        variance.fill(if is_lit { noise * COLD * COLD * RARE_SAMPLES as f32 } else { 0.0 });
    }
    let truth = f64::from(COLD) * (1.0 + RARE_SHARE);
    let error = |image: &[f32]| image.iter().map(|v| (f64::from(*v) - truth).powi(2)).sum::<f64>().sqrt();
    Ok(error(&filtered(setup, kind, filter, &film, watch)?) / error(&film.mean))
}

/// The check of [`rare_light`].
pub fn check_rare_light(name: &str, left: f64) -> Check {
    Check::at_most(name, left, "of the error", 0.5)
        .says(format!("{:.0} % of pixels have met light in one sample of {RARE_SAMPLES}", 100.0 * RARE_SHARE))
}

/// A film after a still's filter; its camera looks down at a floor.
fn filtered(setup: &Setup, kind: TracerKind, filter: FilterKind, film: &Film, watch: &mut Watch) -> Result<Vec<f32>> {
    let camera = Camera::look_at(DVec3::new(0.0, 10.0, 0.0), DVec3::ZERO, DVec3::Z, 0.6);
    let scene = scene_of(vec![(shapes::floor(DVec3::ZERO, 100.0), matte(ALBEDO))], camera);
    let flat = FlatScene::for_paths(&scene);
    let tracer = super::scale::path_tracer(setup, kind, &flat)?;
    let record = CameraRecord::new(&scene.cameras[0], flat.origin, 1.0);
    let options = PathOptions { samples: SampleSettings::new([SIZE, SIZE], 16, 0), ..Default::default() };
    let shot = DenoiseInput { tracer: &tracer, scene: &scene, camera: &record, options: &options };
    let features = Features::render(&shot, watch)?;
    let settings = denoise::Settings { kind: filter, ..Default::default() };
    Denoiser::Filter(settings).denoise(&shot, film, &features, watch)
}

/// The check of [`beside_glint`].
pub fn check_beside_glint(name: &str, moved: f64) -> Check {
    Check::at_most(name, moved, "standard errors", 1.0)
        .says(format!("pixels of {GLINT_SAMPLES} samples beside one that has its radiance from {GLINT_HITS}"))
}

/// A dark floor with a spot less than a pixel of [`frames`] large, lit to the radiance `hot`.
pub fn spotlit(hot: f32) -> (Scene, f64) {
    let (height, radius) = (5.0, 0.1f64);
    let camera = Camera::look_at(DVec3::new(0.0, 10.0, 0.0), DVec3::ZERO, DVec3::Z, 0.6);
    let mut scene = scene_of(vec![(shapes::floor(DVec3::ZERO, 100.0), matte(ALBEDO))], camera);
    let angle = (radius / height).atan();
    let intensity = f64::from(hot) / f64::from(ALBEDO) * std::f64::consts::PI * height * height;
    scene.lights.push(Light {
        name: String::new(),
        kind: LightKind::Spot { inner_angle: 0.99 * angle as f32, outer_angle: angle as f32 },
        intensity: glam::Vec3::splat(intensity as f32),
        position: DVec3::new(0.03, height, 0.02),
        direction: DVec3::NEG_Y,
        range: f64::INFINITY,
    });
    (scene, radius)
}

/// The traces of a spot less than a pixel large in filtered frames while the camera moves: sums
/// over all frames, with the last frame's `total`.
pub fn frames(setup: &Setup, kind: TracerKind, settings: &Settings, hot: f32, frames: u32) -> Result<Spread> {
    let (scene, radius) = spotlit(hot);
    frames_of(setup, kind, &scene, radius, settings, hot, frames)
}

/// See [`frames`]: those of a scene of [`spotlit`].
pub fn frames_of(
    setup: &Setup,
    kind: TracerKind,
    scene: &Scene,
    radius: f64,
    settings: &Settings,
    hot: f32,
    frames: u32,
) -> Result<Spread> {
    let size = [48, 27];
    let flat = FlatScene::for_paths(scene);
    let tracer = super::scale::path_tracer(setup, kind, &flat)?;
    let options = PathOptions { samples: SampleSettings::new(size, 16, 0), max_depth: 1, ..Default::default() };
    let mut realtime = Realtime::radiance(&tracer, &flat, size, settings, &options)?;
    let spot = scene.lights[0].position - flat.origin;
    let footprint: f64 = 2.0 * 10.0 * 0.3f64.tan() / f64::from(size[1]);
    // the spot's own pixel and, for each moving frame, a tap between two pixels of the frame before
    let limit = radius + footprint * f64::from(reach(&settings.filter) + 2 + MOVES);
    let mut out = Spread::default();
    for frame in 0..frames {
        let mut camera = scene.cameras[0].clone();
        let step = DVec3::new(0.05, 0.02, 0.01) * f64::from(frame.min(MOVES));
        camera.camera_to_world = DAffine3::from_translation(step) * camera.camera_to_world;
        let record = CameraRecord::new(&camera, flat.origin, f64::from(size[0]) / f64::from(size[1]));
        realtime.frame(&tracer, &record, &[])?;
        let surfaces = realtime.surfaces()?;
        let is_far = |k: usize| {
            surfaces[k].is_none_or(|s: crate::realtime::Surface| {
                let off = glam::Vec3::from(s.position).as_dvec3() - spot;
                off.x.abs().max(off.z.abs()) > limit
            })
        };
        // a sample in the circle may be all of a pixel's
        let now = Spread::measure(&realtime.result()?, 0.0, hot, is_far);
        out = Spread { unsound: out.unsound + now.unsound, far: out.far + now.far, total: now.total };
    }
    Ok(out)
}

/// Side of the sheet of [`rare_occlusion`] that occludes one sample in a hundred.
pub const SHEET: f64 = 1.1;

/// Occlusion, summed over pixels and frames without history, of a floor under a sheet of side
/// `side`.
pub fn rare_occlusion(setup: &Setup, kind: TracerKind, settings: &Settings, side: f64, frames: u32) -> Result<f64> {
    let mut scene = analytic::plane(20.0, SceneTransform::default());
    sampling::add(&mut scene, shapes::rectangle(DVec3::Y * 6.0, DVec3::X * side, DVec3::Z * side), emitter(0.0));
    scene.cameras[0] = Camera::look_at(DVec3::new(0.0, 3.0, 0.0), DVec3::ZERO, DVec3::Z, 0.6);
    let tracer = Tracer::new(setup.device(), kind, &FlatScene::new(&scene), super::degenerate::NEEDS)?;
    let size = [48, 27];
    let mut realtime = Realtime::new(&tracer, size, &Settings { history: 1, ..*settings }, &[])?;
    let mut sum = 0.0;
    for frame in 0..frames {
        let mut camera = scene.cameras[0].clone();
        camera.camera_to_world =
            DAffine3::from_translation(DVec3::X * 1e-3 * f64::from(frame)) * camera.camera_to_world;
        realtime.frame(&tracer, &CameraRecord::new(&camera, scene.origin(), 16.0 / 9.0), &[])?;
        sum += realtime.result()?.iter().map(|v| 1.0 - f64::from(*v)).sum::<f64>();
    }
    Ok(sum)
}

/// The check of filtered occlusion against unfiltered, by [`rare_occlusion`]: means stay.
pub fn check_rare_occlusion(name: &str, filtered: f64, unfiltered: f64) -> Check {
    let ratio = filtered / unfiltered;
    Check::at_most(name, (ratio - 1.0).abs(), "of its occlusion", 0.02)
        .says(format!("{ratio:.3} of the occlusion that frames without a filter have"))
}

pub(super) fn run(session: &mut StressSession) -> Result<()> {
    let (kinds, effort) = (session.setup().shading_tracers(), session.setup().effort());
    for filter in [FilterKind::Box, FilterKind::Atrous] {
        for hot in HOT {
            for (noisy, noise) in [(true, "noisy"), (false, "without noise")] {
                let name = format!("{filter} filter of a still with one pixel of {hot:e}, {noise}");
                session.measure_each(&name, &kinds, |s, kind, w| {
                    Ok(still(s, kind, filter, hot, noisy, w)?.check(&name))
                })?;
            }
        }
        for (what, detail) in [("quiet pixels", 0.0), ("detail", GLINT_DETAIL)] {
            let name = format!("{filter} filter of a still, {what} beside a glint");
            session.measure_each(&name, &kinds, |s, kind, w| {
                Ok(check_beside_glint(&name, beside_glint(s, kind, filter, GLINT_HITS, detail, w)?))
            })?;
        }
        let name = format!("{filter} filter of a still, rare light");
        session.measure_each(&name, &kinds, |s, kind, w| {
            Ok(check_rare_light(&name, rare_light(s, kind, filter, 1.0, w)?))
        })?;
    }
    let count = effort.pick(24, 240);
    for (what, settings) in super::display::filters() {
        for hot in HOT {
            let name = format!("{what} of {count} frames with one pixel of {hot:e}");
            session
                .measure_each(&name, &kinds, |s, kind, _| Ok(frames(s, kind, &settings, hot, count)?.check(&name)))?;
        }
        let name = format!("{what} of a rare occluder, no history");
        session.measure_each(&name, &kinds, |s, kind, _| {
            let frames = effort.pick(8, 64);
            let filtered = rare_occlusion(s, kind, &settings, SHEET, frames)?;
            let plain = Settings { filter: Filter { kind: FilterKind::None, ..settings.filter }, ..settings };
            Ok(check_rare_occlusion(&name, filtered, rare_occlusion(s, kind, &plain, SHEET, frames)?))
        })?;
    }
    Ok(())
}
