//! What all changes share: where they are played, and what their frames are held against.

use crate::bench::ao::candidates::{Candidate, Occlusion};
use crate::bench::ao::reference::{AoReference, ReferenceRenderer};
use crate::bench::ao::session::AoSession;
use crate::bench::ao::view_renderer::ViewRenderer;
use crate::bench::frame_log::FrameLog;
use crate::bench::lag;
use crate::bench::record::ao::ChangeResult;
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::measure::temporal::{Ghosting, LagCurve, Residual};
use crate::realtime::{Realtime, Technique};
use crate::tracer::Tracer;

/// How much more than the settled error still counts as recovered.
pub const RECOVERED: f64 = 1.1;

/// Where a script is played.
pub struct ChangeStage<'a> {
    /// Holds the scene.
    pub tracer: &'a mut Tracer,
    /// Renders references.
    pub reference_renderer: ReferenceRenderer,
    /// Pixels.
    pub size: [u32; 2],
    /// From where.
    pub camera: CameraRecord,
    /// How occlusion fades.
    pub occlusion: Occlusion,
    /// In messages.
    pub name: String,
}

impl ChangeStage<'_> {
    /// Renders the reference of what the scene is now.
    pub fn reference(&mut self) -> Result<AoReference> {
        self.reference_renderer.render(self.tracer, &self.camera)
    }

    /// What the camera sees now.
    pub fn renderer(&self) -> ViewRenderer<'_> {
        ViewRenderer { tracer: self.tracer, size: self.size, camera: self.camera, occlusion: self.occlusion }
    }
}

/// Presets that know a past.
pub fn candidates(session: &AoSession) -> Vec<&'static Candidate> {
    session.args.candidates().into_iter().filter(|c| c.name != "reference").collect()
}

/// A result with the name of its preset.
pub fn result_of(candidate: &Candidate, stage: &ChangeStage) -> ChangeResult {
    let technique: Technique = candidate.settings(&stage.occlusion).technique;
    ChangeResult { preset: candidate.name.to_owned(), technique: technique.name().to_owned(), ..Default::default() }
}

/// How much of `wrong` an image shows, added to `ghosting`. `settled` is what the preset itself ends at when nothing changes any more: what
/// it always gets wrong is no ghost. `None` where nothing differs.
pub fn ghost(
    ghosting: &mut Ghosting,
    (image, settled): (&[f32], &[f32]),
    (reference, wrong): (&AoReference, &AoReference),
    mask: &[f32],
) -> Option<Residual> {
    lag::add_ghost(ghosting, (image, settled), (&reference.image, &wrong.image), Some(mask))
}

/// What a preset shows of a scene that does not change, in each of `frames` frames from now on, without any past.
pub fn afresh(realtime: &mut Realtime, stage: &ChangeStage, frames: u32) -> Result<Vec<Vec<f32>>> {
    realtime.reset();
    let mut log = FrameLog::default();
    let one = |_| {
        log.frame(realtime, stage.tracer, &stage.camera, &[])?;
        realtime.result()
    };
    (0..frames).map(one).collect()
}

/// The last of them: what it ends at.
pub fn settled(realtime: &mut Realtime, stage: &ChangeStage, frames: u32) -> Result<Vec<f32>> {
    Ok(afresh(realtime, stage, frames)?.pop().unwrap_or_default())
}

/// What the residuals of frames after a sudden change say, beside what the preset ends at and beside frames of the same age without a
/// past.
pub fn lag(result: &mut ChangeResult, residuals: Vec<f64>, memory: Vec<f64>) {
    let remembered = LagCurve::new(memory);
    result.memory_half_life = Some(remembered.fitted_half_life());
    result.memory = remembered.residuals().to_vec();
    let curve = LagCurve::new(residuals);
    result.half_life = Some(curve.half_life());
    result.fitted_half_life = Some(curve.fitted_half_life());
    result.gone = curve.gone();
    result.residuals = curve.residuals().to_vec();
}
