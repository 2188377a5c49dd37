//! Results of the real-time ambient occlusion benchmark. `ao_rows` writes them as a table, one row per result; `ao_verdict` derives the
//! comparison with the `larsen` preset.
//!
//! Times are milliseconds, errors are of ambient visibility (1 - ambient occlusion, 0 to 1) over the pixels that show a surface.

use serde::{Deserialize, Serialize};

use super::cost::FrameCost;
use super::{Completeness, HostInfo};
use crate::measure::stats::{Percentiles, number_or_nan, numbers_or_nan};

/// A whole run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct AoBenchmark {
    /// Host and device.
    #[serde(flatten)]
    pub host: HostInfo,
    /// Name of the tracer.
    pub tracer: String,
    /// Image size, pixels, unless a series varies it.
    pub size: [u32; 2],
    /// Frames of a run.
    pub frames: u32,
    /// Rays per pixel of a reference image, both halves together.
    pub reference_rays: u32,
    /// Falloff of occlusion with distance: `exponential` or `binary`.
    pub falloff: String,
    /// Each scene, from near and far.
    pub views: Vec<ViewRecord>,
    /// Scenes that change while they are seen.
    pub changes: Vec<ChangeRecord>,
    /// Updates of acceleration structures.
    pub structures: Vec<StructureRecord>,
    /// Parameter sweeps.
    pub series: Vec<SeriesRecord>,
    /// Results that are missing, and why.
    #[serde(flatten)]
    pub completeness: Completeness,
}

/// Results of one view of a scene.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ViewRecord {
    /// As on the command line.
    pub scene: String,
    /// `near` or `far`.
    pub view: String,
    /// Triangles and spheres over all instances.
    pub primitives: u64,
    /// Distance in scene units beyond which occlusion is less than 1/255 (exponential), or none (binary).
    #[serde(deserialize_with = "number_or_nan")]
    pub reach: f64,
    /// Camera position, world coordinates.
    pub eye: [f64; 3],
    /// View direction, a unit vector.
    pub towards: [f64; 3],
    /// Number of pixels that show a surface.
    pub covered: u64,
    /// Standard error of the reference that errors are measured against.
    #[serde(deserialize_with = "number_or_nan")]
    pub reference_rmse: f64,
    /// Results of each preset.
    pub results: Vec<TechniqueRecord>,
    /// Comparison of `balanced` with `larsen`.
    pub verdict: Verdict,
}

/// Results of one preset in one view.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct TechniqueRecord {
    /// Name of the preset.
    pub preset: String,
    /// Technique that computes occlusion.
    pub technique: String,
    /// Primary visibility: `traced` or `raster`.
    pub primary: String,
    /// Rays of a pixel that is sampled in a frame.
    pub rays_per_pixel: u32,
    /// Static camera, all work done in every frame.
    pub still: Option<StillRecord>,
    /// Static camera, with sampling stopped once histories are full.
    pub rest: Option<RestRecord>,
    /// Orbiting camera.
    pub moving: Option<OrbitRecord>,
}

/// How far an image is from the reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ImageErrors {
    /// Root of the mean squared error, as measured: the reference's own error is in it.
    #[serde(deserialize_with = "number_or_nan")]
    pub rmse: f64,
    /// Without the reference's: `sqrt(max(0, rmse^2 - reference^2))`.
    #[serde(deserialize_with = "number_or_nan")]
    pub rmse_corrected: f64,
    /// Mean of image - reference.
    #[serde(deserialize_with = "number_or_nan")]
    pub bias: f64,
    /// How different they look, 0 to 1.
    #[serde(deserialize_with = "number_or_nan")]
    pub flip: f64,
    /// Larsen's similarity of the images as vectors.
    #[serde(deserialize_with = "number_or_nan")]
    pub tanimoto: f64,
    /// Larsen's similarity pixel by pixel.
    #[serde(deserialize_with = "number_or_nan")]
    pub minimum_ratio: f64,
}

impl ImageErrors {
    /// Mean of each metric; `None` for an empty slice.
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
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ErrorPoint {
    /// Frames made.
    pub frame: u32,
    /// Occlusion rays traced for them.
    pub rays: u64,
    /// Camera rays traced for them.
    pub camera_rays: u64,
    /// Errors of the final image.
    pub errors: ImageErrors,
    /// Errors of the filter's input.
    pub unfiltered: Option<ImageErrors>,
}

/// Results with a static camera, all work done in every frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StillRecord {
    /// Cost of a frame; a static view needs no camera rays.
    pub cost: FrameCost,
    /// Cost of a frame with camera rays and reprojection: the camera is jittered by less than a thousandth of a pixel.
    pub moving_cost: FrameCost,
    /// Error after 1, 2, 4, ... frames; the last is the settled one.
    pub curve: Vec<ErrorPoint>,
    /// RMSE after each frame.
    #[serde(deserialize_with = "numbers_or_nan")]
    pub rmse: Vec<f64>,
    /// Occlusion rays traced until each frame is done.
    pub rays: Vec<u64>,
}

impl StillRecord {
    /// RMSE after each of the frames over which the time is taken: the second half.
    pub fn timed_rmse(&self) -> &[f64] {
        &self.rmse[self.rmse.len() / 2..]
    }

    /// The error that it settles at: that of the last frame.
    pub fn settled(&self) -> Option<&ErrorPoint> {
        self.curve.last()
    }
}

/// Results with a static camera after sampling has stopped.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RestRecord {
    /// Frames until no ray is traced any more; `None`: it never came to rest.
    pub frames: Option<u32>,
    /// Cost of a frame at rest.
    pub cost: FrameCost,
    /// Errors at rest.
    pub errors: ImageErrors,
}

/// Results with an orbiting camera.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct OrbitRecord {
    /// Rotation of the camera per frame, degrees.
    pub degrees_per_frame: f64,
    /// A frame's.
    pub cost: FrameCost,
    /// Frames in which the error was measured.
    pub frames: Vec<u32>,
    /// Mean errors of these frames.
    pub errors: ImageErrors,
    /// The same before the filter.
    pub unfiltered: Option<ImageErrors>,
    /// Standard error of the references, the mean.
    #[serde(deserialize_with = "number_or_nan")]
    pub reference_rmse: f64,
}

/// One kind of change of one scene.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ChangeRecord {
    /// Name of the scene.
    pub scene: String,
    /// `appear`, `slide`, `sidestep` or `animated`.
    pub change: String,
    /// Number of frames after the change.
    pub frames: u32,
    /// Number of pixels that are compared.
    pub pixels: u64,
    /// Standard error of the references.
    #[serde(deserialize_with = "number_or_nan")]
    pub reference_rmse: f64,
    /// One for each preset.
    pub results: Vec<ChangeResult>,
}

/// What of the past a preset shows after a change. What does not apply to the kind of change is `None`; numbers that are not finite are
/// null in JSON (a half-life is infinite where nothing is forgotten).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ChangeResult {
    /// Name.
    pub preset: String,
    /// Technique that computes occlusion.
    pub technique: String,
    /// Share of the old image in each frame from the change on; of `slide` and `animated`, of the reference of the frame before, in frames
    /// that have a reference. What the preset itself ends at counts as 0.
    #[serde(deserialize_with = "numbers_or_nan")]
    pub residuals: Vec<f64>,
    /// The same beside frames of the same age without a past, which are as blurred and as noisy: what is remembered, and no more.
    #[serde(deserialize_with = "numbers_or_nan")]
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
    #[serde(deserialize_with = "numbers_or_nan")]
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
    pub update_ms: Option<Percentiles>,
}

/// Updates of acceleration structures.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct StructureRecord {
    /// Scene.
    pub scene: String,
    /// Triangles and spheres over all instances.
    pub primitives: u64,
    /// As many as are stored.
    pub stored: u64,
    /// Meshes.
    pub meshes: usize,
    /// Number of instances.
    pub instances: usize,
    /// The first build of everything, milliseconds.
    pub build_ms: f64,
    /// Writing the scene into device memory, milliseconds.
    pub upload_ms: f64,
    /// Update of the TLAS after all instances moved, milliseconds.
    pub top: Option<Percentiles>,
    /// The TLAS was rebuilt, not refitted.
    pub top_rebuilt: bool,
    /// Triangles of the mesh that deforms.
    pub mesh_triangles: u64,
    /// Refit of that mesh's BLAS, vertex upload included, milliseconds.
    pub refit: Option<Percentiles>,
    /// Rebuild of that BLAS, vertex upload included, milliseconds; `None` if the tracer does not rebuild.
    pub rebuild: Option<Percentiles>,
}

/// A parameter sweep.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct SeriesRecord {
    /// Which: `triangles`, `rays`, `resolution` or `sampling`.
    pub series: String,
    /// The scene, or a label for several.
    pub scene: String,
    /// The lines of its plot.
    pub lines: Vec<SeriesLine>,
}

/// One line of a series.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct SeriesLine {
    /// A preset, or a sequence.
    pub name: String,
    /// In the order of the number that varies.
    pub points: Vec<SeriesPoint>,
}

/// One measurement of a series.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
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

/// Comparison of `balanced` (ours) with `larsen` (theirs) in one view. `None` if one of the two was not measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EqualTime {
    /// Rays a pixel.
    pub rays_per_pixel: u32,
    /// A frame's, camera rays included.
    pub ms: f64,
    /// A frame of theirs.
    pub their_ms: f64,
    /// Its settled error.
    #[serde(deserialize_with = "number_or_nan")]
    pub rmse: f64,
    /// That over theirs.
    #[serde(deserialize_with = "number_or_nan")]
    pub rmse_ratio: f64,
}
