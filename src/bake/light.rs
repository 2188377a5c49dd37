//! Light maps: the light of an integrator of paths at the points of texels.

use glam::{DVec3, Vec3};

use super::trace::{BakePoint, PointSums};
use super::{BakeSettings, LightSettings};
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::{Control, SampleSettings};
use crate::integrators::backdrop::Backdrop;
use crate::integrators::path::PathOptions;
use crate::integrators::path::points::PointLight;
use crate::integrators::{IntegratorName, IntegratorSettings, RenderJob};
use crate::scene::{Camera, Scene};
use crate::settings::Capability;
use crate::tracer::{Needs, Tracer};

/// Points whose light is estimated at a time.
const POINTS_AT_A_TIME: usize = 1 << 18;

impl LightSettings {
    /// The integrator.
    ///
    /// # Errors
    /// [`Error::Usage`] for one that has no paths, or darkens light by ambient occlusion.
    pub fn integrator(&self) -> Result<IntegratorName> {
        let integrator = self.integrator.or_else(|| IntegratorName::find("path")).unwrap_or_default();
        if integrator.can(Capability::LightTransport) && !integrator.can(Capability::AmbientOcclusion) {
            return Ok(integrator);
        }
        let name = integrator.name();
        Err(Error::Usage(format!("--integrator {name}: a light map is of path, direct, whitted or ao-sky")))
    }

    fn of_integrators(&self) -> IntegratorSettings {
        let mut settings = IntegratorSettings::default();
        settings.path.max_depth = self.max_depth;
        settings
    }

    /// The requirements of the tracer.
    ///
    /// # Errors
    /// Those of [`LightSettings::integrator`].
    pub fn needs(&self) -> Result<Needs> {
        Ok(self.integrator()?.get().needs(&self.of_integrators()))
    }

    /// The options of paths in a scene.
    fn path_options(&self, scene: &Scene) -> Result<PathOptions> {
        let settings = self.of_integrators();
        let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 1.0);
        let job = RenderJob {
            scene,
            camera: &camera,
            samples: SampleSettings::default(),
            settings: &settings,
            backdrop: Backdrop::default(),
        };
        let options = self.integrator()?.get().path_options(&job)?;
        options.ok_or_else(|| Error::Usage("a light map needs an integrator of paths".to_owned()))
    }
}

/// Estimates the light at points of a tracer's scene.
pub struct LightTracer<'t> {
    light: PointLight<'t>,
    /// Samples of each point.
    spp: u32,
    seed: u32,
    /// Rays so far.
    pub rays: u64,
}

impl<'t> LightTracer<'t> {
    /// Compiles it, for `1 << sample_bits` samples of each point.
    ///
    /// # Errors
    /// Those of the device, and of [`LightSettings::integrator`].
    pub fn new(tracer: &'t Tracer, flat: &FlatScene, settings: &BakeSettings, sample_bits: u32) -> Result<Self> {
        let options = settings.light.path_options(flat.scene)?;
        let spp = 1 << sample_bits;
        let light = PointLight::new(tracer, flat, &options, POINTS_AT_A_TIME, spp)?;
        Ok(Self { light, spp, seed: settings.seed, rays: 0 })
    }

    /// The sums of each point: of linear RGB in place of a direction, and of the mean channel.
    ///
    /// # Errors
    /// Those of the device, and [`Error::Interrupted`].
    pub fn trace(&mut self, points: &[BakePoint], control: &mut dyn Control) -> Result<Vec<PointSums>> {
        let mut sums = Vec::with_capacity(points.len());
        let n = self.spp as f32;
        for part in points.chunks(POINTS_AT_A_TIME) {
            let found = self.light.estimate(part, self.spp, self.seed, &mut StopsOnly(&mut *control))?;
            self.rays += found.rays;
            let pixels = found.film.mean.chunks_exact(3).zip(found.film.variance.chunks_exact(3)).take(part.len());
            sums.extend(pixels.map(|(mean, variance)| {
                let [mean, deviation] = [Vec3::from_slice(mean), Vec3::from_slice(variance).map(f32::sqrt)];
                // channels vary together at most
                let (value, deviation) = (mean.element_sum() / 3.0, deviation.element_sum() / 3.0);
                let squares = (n - 1.0) * deviation * deviation + n * value * value;
                PointSums { direction: n * mean, value: n * value, squares }
            }));
        }
        Ok(sums)
    }
}

/// A part of a longer work, whose progress is not that of the whole.
struct StopsOnly<'c>(&'c mut dyn Control);

impl Control for StopsOnly<'_> {
    fn warning(&mut self, text: &str) {
        self.0.warning(text);
    }

    fn should_stop(&mut self) -> Result<bool> {
        self.0.should_stop()
    }
}
