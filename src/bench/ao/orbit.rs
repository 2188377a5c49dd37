//! A camera on an orbit, and reference images along it.

use super::candidates::Candidate;
use super::reference::{AoReference, ReferenceRenderer};
use super::view_renderer::ViewRenderer;
use crate::bench::frame_log::{FRAMES_PER_TURN, FrameLog, first_timed, measured};
use crate::bench::record::ao::{ImageErrors, OrbitRecord};
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::realtime::Technique;
use crate::scene::{Camera, Orbit};

/// Cameras of an orbit, a frame each, and the references of some frames.
pub struct OrbitRun {
    cameras: Vec<CameraRecord>,
    references: Vec<(u32, AoReference)>,
}

impl OrbitRun {
    /// About the vertical through `middle`, `frames` of them.
    pub fn new(
        renderer: &ViewRenderer,
        reference_renderer: &mut ReferenceRenderer,
        camera: &Camera,
        (middle, origin): (glam::DVec3, glam::DVec3),
        frames: u32,
    ) -> Result<Self> {
        let orbit = Orbit::vertical(middle, FRAMES_PER_TURN)?;
        let aspect = f64::from(renderer.size[0]) / f64::from(renderer.size[1]);
        let record = |f: u32| CameraRecord::new(&orbit.camera_at(camera, f64::from(f)), origin, aspect);
        let cameras: Vec<CameraRecord> = (0..frames).map(record).collect();
        let reference = |f: u32| Ok((f, reference_renderer.render(renderer.tracer, &cameras[f as usize])?));
        let references = measured(frames).into_iter().map(reference).collect::<Result<_>>()?;
        Ok(Self { cameras, references })
    }

    /// Renders the frames with a preset.
    pub fn follow(&self, renderer: &ViewRenderer, candidate: &Candidate) -> Result<OrbitRecord> {
        let settings = candidate.settings(&renderer.occlusion);
        let mut realtime = renderer.realtime(&settings)?;
        let mut log = FrameLog::default();
        let (mut errors, mut unfiltered): (Vec<ImageErrors>, Vec<ImageErrors>) = (Vec::new(), Vec::new());
        for (f, camera) in self.cameras.iter().enumerate() {
            log.frame(&mut realtime, renderer.tracer, camera, &[])?;
            let Some((_, reference)) = self.references.iter().find(|t| t.0 as usize == f) else { continue };
            errors.push(reference.errors_of(&realtime.result()?)?);
            if settings.technique != Technique::Larsen {
                unfiltered.push(reference.errors_of(&realtime.unfiltered()?)?);
            }
        }
        let references = self.references.len().max(1) as f64;
        Ok(OrbitRecord {
            degrees_per_frame: 360.0 / FRAMES_PER_TURN,
            cost: log.cost(first_timed(self.cameras.len() as u32)),
            frames: self.references.iter().map(|t| t.0).collect(),
            errors: ImageErrors::mean(&errors).unwrap_or_default(),
            unfiltered: ImageErrors::mean(&unfiltered),
            reference_rmse: self.references.iter().map(|t| t.1.rmse).sum::<f64>() / references,
        })
    }
}
