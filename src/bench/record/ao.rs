//! What a benchmark of real-time ambient occlusion found: records for programs. `ao_rows` writes them a row a result, `ao_verdict`
//! says what follows from them.
//!
//! Times are milliseconds, errors are of ambient visibility (1 - ambient occlusion, 0 to 1) over the pixels that show a surface.

use serde::Serialize;

use super::{Completeness, HostInfo};
use crate::measure::stats::MedianP95;

/// A whole run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct AoBenchmark {
    /// What it ran on.
    #[serde(flatten)]
    pub host: HostInfo,
    /// What traces rays.
    pub tracer: String,
    /// Pixels of the images, but where a series says otherwise.
    pub size: [u32; 2],
    /// Frames of a run.
    pub frames: u32,
    /// Rays a pixel of a reference, both of its halves.
    pub reference_rays: u32,
    /// How occlusion fades with distance: `exponential` or `binary`.
    pub falloff: String,
    /// Each scene, from near and far.
    pub views: Vec<ViewRecord>,
    /// Scenes that change while they are seen.
    pub changes: Vec<ChangeRecord>,
    /// What keeping structures up to date takes.
    pub structures: Vec<StructureRecord>,
    /// One number varied, all others the same.
    pub series: Vec<SeriesRecord>,
    /// What is missing.
    #[serde(flatten)]
    pub completeness: Completeness,
}

/// One scene from one place.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ViewRecord {
    /// As on the command line.
    pub scene: String,
    /// `near` or `far`.
    pub view: String,
    /// Triangles and spheres over all instances.
    pub primitives: u64,
    /// Distance in scene units beyond which occlusion is less than 1/255 (exponential), or none (binary).
    pub reach: f64,
    /// The camera's place, world coordinates.
    pub eye: [f64; 3],
    /// Where it looks, a unit vector.
    pub towards: [f64; 3],
    /// Pixels that show something.
    pub covered: u64,
    /// Standard error of the reference that errors are measured against.
    pub reference_rmse: f64,
    /// What was measured, in the order of the command line.
    pub results: Vec<TechniqueRecord>,
    /// What follows.
    pub verdict: Verdict,
}

/// Results of one preset in one view.
#[derive(Clone, Debug, Default, Serialize)]
pub struct TechniqueRecord {
    /// Its name.
    pub preset: String,
    /// Where its occlusion comes from.
    pub technique: String,
    /// What finds what the camera sees: `traced` camera rays, or `raster`.
    pub primary: String,
    /// Rays of a pixel that is sampled in a frame.
    pub rays_per_pixel: u32,
    /// Under a camera that stands still, all work done in every frame.
    pub still: Option<StillRecord>,
    /// The same, with what is known already left out.
    pub rest: Option<RestRecord>,
    /// Under a camera that goes round.
    pub moving: Option<OrbitRecord>,
}

/// Times of a pass, or of one step of several launches of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PassTime {
    /// Name of the pass.
    pub pass: String,
    /// On the device, over the frames that count.
    pub ms: MedianP95,
}

/// What a frame costs.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FrameCost {
    /// Each pass.
    pub passes: Vec<PassTime>,
    /// All passes, on the device; 0 where the device has no clock.
    pub device_ms: MedianP95,
    /// By the clock of the process, submission included.
    pub wall_ms: MedianP95,
    /// Camera rays, the mean of a frame.
    pub camera_rays: f64,
    /// Occlusion rays traced, the mean of a frame.
    pub rays: f64,
    /// Occlusion rays that were left out, the mean of a frame.
    pub skipped_rays: f64,
}

impl FrameCost {
    /// Median on the device, or by the clock where the device has none.
    pub fn ms(&self) -> f64 {
        if self.device_ms.median > 0.0 { self.device_ms.median } else { self.wall_ms.median }
    }

    /// Rays of a frame, those of the camera included.
    pub fn all_rays(&self) -> f64 {
        self.rays + self.camera_rays
    }
}

/// How far an image is from the reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ImageErrors {
    /// Root of the mean squared error, as measured: the reference's own error is in it.
    pub rmse: f64,
    /// Without the reference's: `sqrt(max(0, rmse^2 - reference^2))`.
    pub rmse_corrected: f64,
    /// Mean of image - reference.
    pub bias: f64,
    /// How different they look, 0 to 1.
    pub flip: f64,
    /// Larsen's similarity of the images as vectors.
    pub tanimoto: f64,
    /// Larsen's similarity pixel by pixel.
    pub minimum_ratio: f64,
}

impl ImageErrors {
    /// Number by number; `None` for none.
    pub fn mean(of: &[ImageErrors]) -> Option<ImageErrors> {
        let n = of.len() as f64;
        let mean = |f: fn(&ImageErrors) -> f64| of.iter().map(f).sum::<f64>() / n;
        (!of.is_empty()).then(|| ImageErrors {
            rmse: mean(|e| e.rmse),
            rmse_corrected: mean(|e| e.rmse_corrected),
            bias: mean(|e| e.bias),
            flip: mean(|e| e.flip),
            tanimoto: mean(|e| e.tanimoto),
            minimum_ratio: mean(|e| e.minimum_ratio),
        })
    }
}

/// The error after some frames.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ErrorPoint {
    /// Frames made.
    pub frame: u32,
    /// Occlusion rays traced for them.
    pub rays: u64,
    /// Camera rays traced for them.
    pub camera_rays: u64,
    /// Of the image.
    pub errors: ImageErrors,
    /// Of what the filter was given.
    pub unfiltered: Option<ImageErrors>,
}

/// A camera that stands still, all work done in every frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StillRecord {
    /// A frame's, as it comes: no camera rays where nothing moved.
    pub cost: FrameCost,
    /// A frame's with all of its camera rays and reprojection: the camera trembles by less than a thousandth of a pixel.
    pub moving_cost: FrameCost,
    /// Error after 1, 2, 4, ... frames; the last is the settled one.
    pub curve: Vec<ErrorPoint>,
    /// RMSE after each frame.
    pub rmse: Vec<f64>,
    /// Occlusion rays traced until each frame is done.
    pub rays: Vec<u64>,
}

impl StillRecord {
    /// The error that it settles at: that of the last frame.
    pub fn settled(&self) -> Option<&ErrorPoint> {
        self.curve.last()
    }
}

/// A camera that stands still, and what that saves.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RestRecord {
    /// Frames until no ray is traced any more; `None`: it never came to rest.
    pub frames: Option<u32>,
    /// Of a frame at rest.
    pub cost: FrameCost,
    /// At rest.
    pub errors: ImageErrors,
}

/// A camera that goes round.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct OrbitRecord {
    /// How far it goes in a frame.
    pub degrees_per_frame: f64,
    /// A frame's.
    pub cost: FrameCost,
    /// Frames in which the error was measured.
    pub frames: Vec<u32>,
    /// The mean of these.
    pub errors: ImageErrors,
    /// The same before the filter.
    pub unfiltered: Option<ImageErrors>,
    /// Standard error of the references, the mean.
    pub reference_rmse: f64,
}

/// One kind of change of one scene.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ChangeRecord {
    /// What changes.
    pub scene: String,
    /// `appear`, `slide`, `sidestep` or `animated`.
    pub change: String,
    /// Frames after it.
    pub frames: u32,
    /// Pixels that are looked at.
    pub pixels: u64,
    /// Standard error of the references.
    pub reference_rmse: f64,
    /// One for each preset.
    pub results: Vec<ChangeResult>,
}

/// What of the past a preset shows after a change. What does not apply to the kind of change is `None`; numbers that are not finite are
/// null in JSON (a half-life is infinite where nothing is forgotten).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ChangeResult {
    /// Name.
    pub preset: String,
    /// Where its occlusion comes from.
    pub technique: String,
    /// Share of the old image in each frame from the change on; of `slide` and `animated`, of the reference of the frame before, in frames
    /// that have a reference. What the preset itself ends at counts as 0.
    pub residuals: Vec<f64>,
    /// The same beside frames of the same age without a past, which are as blurred and as noisy: what is remembered, and no more.
    pub memory: Vec<f64>,
    /// Frames in which half of that is forgotten.
    pub memory_half_life: Option<f64>,
    /// Frames in which half of the old is forgotten, by the first frame.
    pub half_life: Option<f64>,
    /// The same, by all frames that still show some.
    pub fitted_half_life: Option<f64>,
    /// First frame, from 0, with no more than a twentieth of the old.
    pub gone: Option<usize>,
    /// What the old adds to the mean squared error.
    pub ghosting: Option<f64>,
    /// The larsen preset's half-life of memory over this one's.
    pub times_as_quick: Option<f64>,
    /// Error of each frame over the pixels that are looked at.
    pub rmse: Vec<f64>,
    /// Frames until that error stays within a tenth of where it ends.
    pub recovery: Option<usize>,
    /// Frames until it stays within a tenth of where the larsen preset's ends.
    pub recovery_to_larsen: Option<usize>,
    /// Pixels that are off towards the old value by more than 5 standard deviations, 8 frames after the change.
    pub stale_pixels: Option<u64>,
    /// As many of a run that never saw the old: what chance makes.
    pub stale_pixels_by_chance: Option<u64>,
    /// Of whole images, the mean over the frames with a reference.
    pub errors: Option<ImageErrors>,
    /// A frame's.
    pub cost: Option<FrameCost>,
    /// Milliseconds to bring the tracer up to date.
    pub update_ms: Option<MedianP95>,
}

/// Keeping structures up to date.
#[derive(Clone, Debug, Default, Serialize)]
pub struct StructureRecord {
    /// Scene.
    pub scene: String,
    /// Triangles and spheres over all instances.
    pub primitives: u64,
    /// As many as are stored.
    pub stored: u64,
    /// Meshes.
    pub meshes: usize,
    /// Placed meshes.
    pub instances: usize,
    /// The first build of everything, milliseconds.
    pub build_ms: f64,
    /// Writing the scene into device memory, milliseconds.
    pub upload_ms: f64,
    /// The top level, all instances moved.
    pub top: Option<MedianP95>,
    /// It was built anew, not refitted.
    pub top_rebuilt: bool,
    /// Triangles of the mesh that deforms.
    pub mesh_triangles: u64,
    /// Refitting that mesh, its vertices written.
    pub refit: Option<MedianP95>,
    /// Building it anew, its vertices written; `None` where the tracer would not.
    pub rebuild: Option<MedianP95>,
}

/// One number varied.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SeriesRecord {
    /// Which: `triangles`, `rays`, `resolution` or `sampling`.
    pub series: String,
    /// What it was varied in: the scene, or several.
    pub scene: String,
    /// The lines of its plot.
    pub lines: Vec<SeriesLine>,
}

/// One line of a series.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SeriesLine {
    /// A preset, or a sequence.
    pub name: String,
    /// In the order of the number that varies.
    pub points: Vec<SeriesPoint>,
}

/// One measurement of a series.
#[derive(Clone, Debug, Default, Serialize)]
pub struct SeriesPoint {
    /// Scene.
    pub scene: String,
    /// The number: triangles, rays a pixel, pixels, frames.
    pub x: f64,
    /// A frame's, with all of its camera rays.
    pub cost: Option<FrameCost>,
    /// Settled error.
    pub rmse: Option<f64>,
    /// The same before the filter.
    pub unfiltered_rmse: Option<f64>,
    /// Error when the quickest line of the series was done.
    pub equal_time_rmse: Option<f64>,
}

/// Of one view. `None` where one of the two was not measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Verdict {
    /// Occlusion rays of a frame of ours over those of theirs.
    pub rays_ratio: Option<f64>,
    /// The same, camera rays counted: a still camera needs none of ours, theirs always all.
    pub rays_ratio_with_camera: Option<f64>,
    /// The same while something moves.
    pub rays_ratio_moving: Option<f64>,
    /// Settled RMSE of ours over that of theirs.
    pub rmse_ratio: Option<f64>,
    /// The same under the camera that goes round.
    pub moving_rmse_ratio: Option<f64>,
    /// Frames until ours is first as good as theirs is settled.
    pub frames_to_reach: Option<u32>,
    /// Occlusion rays until then.
    pub rays_to_reach: Option<u64>,
    /// These over the occlusion rays of one frame of theirs.
    pub rays_to_reach_ratio: Option<f64>,
    /// With as many rays as take their time.
    pub equal_time: Option<EqualTime>,
    /// Presets whose filter raises the settled error.
    pub filter_raises: Vec<String>,
}

/// The preset `balanced`, with so many rays a pixel that a frame takes no longer than one of theirs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EqualTime {
    /// Rays a pixel.
    pub rays_per_pixel: u32,
    /// A frame's, camera rays included.
    pub ms: f64,
    /// A frame of theirs.
    pub their_ms: f64,
    /// Its settled error.
    pub rmse: f64,
    /// That over theirs.
    pub rmse_ratio: f64,
}
