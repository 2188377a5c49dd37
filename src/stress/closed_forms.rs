//! Ambient occlusion images against closed forms: the measuring that this suite and tests/ao share.
//!
//! An image's pixel is an integral over its footprint, so it is compared with the closed form
//! integrated over it (Gauss-Legendre, through double-precision camera rays). Pixels are
//! independent, so the spread of `pixel - expectation` is the standard error of the image's mean.

use glam::DVec3;

use crate::error::Result;
use crate::film::SampleSettings;
use crate::film::camera::CameraRecord;
use crate::film::{Control, Film};
use crate::integrators::ao::{self, AoOptions, AoResult, Occlusion};
use crate::oracle::OracleRay;
use crate::oracle::camera::camera_ray;
use crate::scene::{Camera, Scene};
use crate::tracer::Tracer;

pub struct Case<'a> {
    pub what: &'a str,
    pub scene: &'a Scene,
    pub camera: Camera,
    pub options: AoOptions,
    /// The hit of a ray with the surface; `None`: other things are in the pixel, which is left out.
    pub surface: &'a dyn Fn(&OracleRay) -> Option<DVec3>,
    /// Ambient visibility at that point.
    pub expected: &'a dyn Fn(DVec3) -> f64,
}

/// Distance of an image from its closed form.
#[derive(Clone, Copy, Debug, Default)]
pub struct Bias {
    /// Mean of the closed form over the pixels that are compared.
    pub expected: f64,
    /// Mean of the image minus that.
    pub bias: f64,
    /// True standard error of the image's mean.
    pub standard_error: f64,
    /// Standard error that independent samples would have.
    pub independent_error: f64,
    pub pixels: usize,
    /// Pixels among them of which a ray met nothing.
    pub uncovered: usize,
    pub spp: u32,
}

impl Case<'_> {
    /// Mean of the expected ambient visibility over each pixel that shows nothing but the surface.
    pub fn expectations(&self) -> Vec<Option<f64>> {
        // three-point Gauss-Legendre on [0, 1]
        let r = 0.5 * 0.6f64.sqrt();
        let nodes = [(0.5 - r, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + r, 5.0 / 18.0)];
        let size = self.options.samples.size;
        let at = |x: f64, y: f64| (self.surface)(&camera_ray(&self.camera, DVec3::ZERO, size, [x, y]));
        (0..size[0] * size[1])
            .map(|i| {
                let (x, y) = ((i % size[0]) as f64, (i / size[0]) as f64);
                // corners first: they are what sticks out
                for [u, v] in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
                    at(x + u, y + v)?;
                }
                let mut sum = 0.0;
                for (u, wu) in nodes {
                    for (v, wv) in nodes {
                        sum += wu * wv * (self.expected)(at(x + u, y + v)?);
                    }
                }
                Some(sum)
            })
            .collect()
    }

    /// Renders the case and compares it with its [`Case::expectations`].
    pub fn bias(&self, tracer: &Tracer, expected: &[Option<f64>], control: &mut dyn Control) -> Result<Bias> {
        let image = render(tracer, self.scene, &self.camera, &self.options, control)?;
        Ok(bias(&image.image.film, image.image.spp, expected))
    }
}

/// Compares a film with what its pixels should be.
pub fn bias(film: &Film, spp: u32, expected: &[Option<f64>]) -> Bias {
    let mut out = Bias { pixels: expected.iter().flatten().count(), spp, ..Bias::default() };
    let n = out.pixels.max(1) as f64;
    let (mut squares, mut variance) = (0.0, 0.0);
    for (i, want) in expected.iter().enumerate() {
        let Some(want) = want else { continue };
        out.uncovered += usize::from(film.coverage[i] != 1.0);
        let residual = f64::from(film.mean[i]) - want;
        out.bias += residual / n;
        squares += residual * residual / n;
        variance += f64::from(film.variance[i]) / f64::from(spp);
        out.expected += want / n;
    }
    out.independent_error = variance.sqrt() / n;
    out.standard_error = ((squares - out.bias * out.bias).max(0.0) / n).sqrt();
    out
}

/// Samples of a film that meet geometry, and those among them whose value (0 or 1) is not `want`.
pub fn samples_off(film: &Film, spp: u32, want: f32) -> (f64, f64) {
    let spp = f64::from(spp);
    let covered = film.coverage.iter().map(|&c| f64::from(c) * spp).sum();
    // misses of the camera count 0 in the mean
    let off = film.mean.iter().zip(&film.coverage).map(|(m, c)| (f64::from((m - c * want).abs()) * spp).round()).sum();
    (covered, off)
}

/// Renders an ambient occlusion image through a camera.
pub fn render(
    tracer: &Tracer,
    scene: &Scene,
    camera: &Camera,
    options: &AoOptions,
    control: &mut dyn Control,
) -> Result<AoResult> {
    let aspect = f64::from(options.samples.size[0]) / f64::from(options.samples.size[1]);
    ao::render(tracer, &CameraRecord::new(camera, scene.origin(), aspect), options, control)
}

/// Options of a square image.
pub fn options(size: u32, spp: u32, falloff: f64, radius: f64) -> AoOptions {
    AoOptions {
        samples: SampleSettings::new([size, size], spp, 1),
        occlusion: Occlusion::new(radius, falloff),
        ..Default::default()
    }
}

/// Where a ray meets the plane through `point` with unit normal `normal`, seen from its front.
pub fn on_plane(ray: &OracleRay, point: DVec3, normal: DVec3) -> Option<DVec3> {
    let cos = -ray.direction.dot(normal);
    let t = (ray.origin - point).dot(normal) / cos;
    (cos > 1e-9 && t > 0.0).then(|| ray.at(t))
}
