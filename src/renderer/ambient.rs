//! Samples of ambient light: how an image changes with radius and falloff of ambient occlusion.

use super::complete::Completed;
use super::{RenderSettings, Renderer, TracerRequest};
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::film::Control;
use crate::integrators::path::ambient::{self, TakeSamples};
use crate::scene::Motion;

impl Renderer {
    /// Traces the occlusion rays of an image of the integrator `lit`, which `settings` must name,
    /// to their nearest hits. The distances that `take` receives tell the image for every radius.
    ///
    /// # Errors
    /// As [`Renderer::still`].
    pub fn ambient_samples(
        &mut self,
        settings: &RenderSettings,
        control: &mut dyn Control,
        take: &mut TakeSamples,
    ) -> Result<()> {
        settings.check()?;
        let Completed { camera, settings, .. } = self.complete(settings, None)?;
        let integrator = settings.integrator().get();
        let (device, kind, compute) = (self.device.clone(), self.kind, self.compute);
        let ready = self.tracer.take();
        let scene = &self.scene;
        let mut warnings = scene.report.all_warnings();
        let job = settings.job(scene, &camera);
        let flat = FlatScene::with_motion_and_blend(scene, Motion::default(), integrator.blend())?;
        let request = TracerRequest {
            needs: integrator.needs(&settings.integrators),
            streams: integrator.streams(&settings.integrators),
            rays: integrator.rays_per_sample() * job.samples.count(),
            camera: Some(&camera),
            control: &mut *control,
            warnings: &mut warnings,
        };
        let ready = request.reuse_or_build(ready, &device, kind, &flat, compute, &self.settings)?;
        if let Some(options) = integrator.path_options(&job)? {
            ambient::trace(&ready.tracer, &flat, &job.camera_record(&flat), &options, control, take)?;
        }
        device.check_validation()?;
        self.tracer = Some(ready);
        self.keep_pipelines();
        Ok(())
    }
}
