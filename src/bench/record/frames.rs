//! What a benchmark of frames in real time found: what the frames of each preset cost and how far they are from converged images, beside *plain accumulation*,
//! paths without history and filter that take as long.
//!
//! Times are milliseconds. Errors are of what is displayed, tone mapped and sRGB from 0 to 1, unless they say otherwise.

use std::io::Write;

use serde::{Deserialize, Serialize};

use super::cost::FrameCost;
use super::saved::SavedRecord;
use super::{BenchRecord, Completeness, HostInfo};
use crate::measure::stats::{number_or_nan, numbers_or_nan};

/// A whole run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct FramesBenchmark {
    /// What it ran on.
    #[serde(flatten)]
    pub host: HostInfo,
    /// Name of the tracer.
    pub tracer: String,
    /// Name of the integrator.
    pub integrator: String,
    /// Image size, pixels.
    pub size: [u32; 2],
    /// Frames of a run.
    pub frames: u32,
    /// Seed of the samples of frames.
    pub seed: u32,
    /// Runs of a still camera, with seeds one after another, whose errors are averaged.
    pub runs: u32,
    /// Paths per pixel of the reference of a still camera, both halves together.
    pub reference_paths: u32,
    /// Peers, as they introduce themselves.
    pub peers: Vec<String>,
    /// Scenes that are looked at.
    pub views: Vec<FramesView>,
    /// Times by number of bounces.
    pub bounces: Vec<BouncesRecord>,
    /// Results that are missing, and why.
    #[serde(flatten)]
    pub completeness: Completeness,
}

/// Results of one scene.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct FramesView {
    /// As on the command line.
    pub scene: String,
    /// Triangles and spheres over all instances.
    pub primitives: u64,
    /// What lights it, in words.
    pub light: String,
    /// Time of each path per pixel of plain accumulation.
    #[serde(deserialize_with = "number_or_nan")]
    pub ms_per_path: f64,
    /// Time of an image of plain accumulation besides its paths.
    #[serde(deserialize_with = "number_or_nan")]
    pub ms_per_image: f64,
    /// Standard error of the reference of the still camera.
    #[serde(deserialize_with = "number_or_nan")]
    pub reference_rmse: f64,
    /// A camera that stands still, by preset.
    pub still: Vec<StillFrames>,
    /// Something moves in every frame.
    pub motions: Vec<MotionRecord>,
    /// Something changes once.
    pub changes: Vec<FramesChange>,
}

/// How far an image is from the reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameErrors {
    /// Root of the mean squared error, as measured: the reference's own error is in it.
    #[serde(deserialize_with = "number_or_nan")]
    pub rmse: f64,
    /// Without the reference's: `sqrt(max(0, rmse^2 - reference^2))`.
    #[serde(deserialize_with = "number_or_nan")]
    pub rmse_corrected: f64,
    /// Mean of (image - reference)^2 / (reference^2 + 0.01) of linear values.
    #[serde(deserialize_with = "number_or_nan")]
    pub rel_mse: f64,
    /// Mean of image - reference over the mean of the reference, of linear values as displayed: from 0 to 1.
    #[serde(deserialize_with = "number_or_nan")]
    pub bias: f64,
    /// How different they look, 0 to 1.
    #[serde(deserialize_with = "number_or_nan")]
    pub flip: f64,
}

impl FrameErrors {
    /// Mean of each metric; `None` for an empty slice.
    pub fn mean(of: &[Self]) -> Option<Self> {
        let n = of.len() as f64;
        let mean = |f: fn(&Self) -> f64| of.iter().map(f).sum::<f64>() / n;
        (!of.is_empty()).then(|| Self {
            rmse: mean(|e| e.rmse),
            rmse_corrected: mean(|e| e.rmse_corrected),
            rel_mse: mean(|e| e.rel_mse),
            bias: mean(|e| e.bias),
            flip: mean(|e| e.flip),
        })
    }
}

/// An image of plain accumulation, in the time that a preset takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PlainImage {
    /// Paths per pixel, at least one.
    pub paths: u32,
    /// Its errors.
    pub errors: FrameErrors,
}

/// Plain accumulation whose every frame is denoised, in the time that a preset takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct DenoisedImage {
    /// Paths per pixel: at least one a frame.
    pub paths: u32,
    /// Time of a frame: paths and denoiser. More than the preset's where the denoiser alone takes longer.
    #[serde(deserialize_with = "number_or_nan")]
    pub ms: f64,
    /// Its errors.
    pub errors: FrameErrors,
}

/// Errors after some frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FramePoint {
    /// Frames made.
    pub frame: u32,
    /// Errors of the preset's image.
    pub errors: FrameErrors,
    /// Plain accumulation in the time of all frames so far.
    pub plain: PlainImage,
}

/// Images of paths that a peer renders, in the time that a preset takes, held against a reference of its own: its materials have other formulas.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct PeerFrames {
    /// Its name, and that of what it renders with.
    pub peer: String,
    /// Standard error of its reference.
    #[serde(deserialize_with = "number_or_nan")]
    pub reference_rmse: f64,
    /// Time of an image besides its paths, by its own clock.
    #[serde(deserialize_with = "number_or_nan")]
    pub ms_per_image: f64,
    /// Time of each path per pixel.
    #[serde(deserialize_with = "number_or_nan")]
    pub ms_per_path: f64,
    /// After as many frames as the preset's errors are of.
    pub points: Vec<PeerPoint>,
}

/// A peer's image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PeerPoint {
    /// Frames of the preset whose time it has.
    pub frame: u32,
    /// The image.
    #[serde(flatten)]
    pub image: PlainImage,
}

/// Differences between consecutive frames of a camera that stands still.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Flicker {
    /// Frames before the first difference.
    pub after: u32,
    /// Root mean square over pixels and pairs of frames.
    #[serde(deserialize_with = "number_or_nan")]
    pub rms: f64,
    /// Greatest root mean square over the pixels of a pair of frames.
    #[serde(deserialize_with = "number_or_nan")]
    pub greatest: f64,
}

impl Flicker {
    /// Frames after which no image may flicker any more.
    pub const SETTLED: u32 = 64;
    /// A step of an 8-bit image.
    pub const LIMIT: f64 = 1.0 / 255.0;

    /// Is it less than a step of an 8-bit image, in each pair of frames? `None` of a run that was too short to tell.
    pub fn is_invisible(&self) -> Option<bool> {
        (self.after >= Self::SETTLED).then_some(self.greatest < Self::LIMIT)
    }
}

/// A preset under a camera that stands still.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct StillFrames {
    /// Name.
    pub preset: String,
    /// Paths, or occlusion rays, of a pixel in a frame.
    pub rays_per_pixel: u32,
    /// A frame's.
    pub cost: FrameCost,
    /// Errors after 1, 2, 4, ... frames.
    pub curve: Vec<FramePoint>,
    /// Flicker in the last frames.
    pub flicker: Option<Flicker>,
    /// Plain accumulation with Open Image Denoise after as many frames, where the library is there.
    pub denoised: Option<DenoisedImage>,
    /// Images of peers in the same time.
    pub peers: Vec<PeerFrames>,
}

impl StillFrames {
    /// Its error over that of plain accumulation, after all frames.
    pub fn ratio(&self) -> Option<f64> {
        self.curve.last().and_then(|p| ratio(&p.errors, &p.plain.errors))
    }
}

/// Error over that of plain accumulation. `None` where the references' own errors are all there is.
fn ratio(ours: &FrameErrors, plain: &FrameErrors) -> Option<f64> {
    (plain.rmse_corrected > 0.0).then(|| ours.rmse_corrected / plain.rmse_corrected)
}

/// A scene in which something moves in every frame.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct MotionRecord {
    /// `orbit` (the camera), `sun` (the environment map) or `animation` (objects).
    pub motion: String,
    /// Frames in which errors were measured.
    pub frames: Vec<u32>,
    /// Standard error of their references, the mean.
    #[serde(deserialize_with = "number_or_nan")]
    pub reference_rmse: f64,
    /// By preset.
    pub results: Vec<MovingFrames>,
}

/// A preset while something moves.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct MovingFrames {
    /// Name.
    pub preset: String,
    /// A frame's.
    pub cost: FrameCost,
    /// Mean errors of the measured frames.
    pub errors: FrameErrors,
    /// As many paths as fit into a frame's time, the mean of the same frames.
    pub plain: PlainImage,
    /// The same with Open Image Denoise.
    pub denoised: Option<DenoisedImage>,
}

impl MovingFrames {
    /// Its error over that of plain accumulation.
    pub fn ratio(&self) -> Option<f64> {
        ratio(&self.errors, &self.plain.errors)
    }
}

/// A change of a scene after which everything rests.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct FramesChange {
    /// `turn` (the environment map, at once) or `sidestep` (of the camera).
    pub change: String,
    /// Number of frames after the change.
    pub frames: u32,
    /// Number of pixels that are looked at.
    pub pixels: u64,
    /// Standard error of the reference over all pixels.
    #[serde(deserialize_with = "number_or_nan")]
    pub reference_rmse: f64,
    /// By preset.
    pub results: Vec<ChangedFrames>,
}

/// A preset after a change. Numbers that are not finite are null in JSON: a half-life is infinite where nothing is forgotten.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ChangedFrames {
    /// Name.
    pub preset: String,
    /// Error of each frame over the pixels that are looked at.
    #[serde(deserialize_with = "numbers_or_nan")]
    pub rmse: Vec<f64>,
    /// The same of plain accumulation since the change, at equal time, in frames that are powers of two, counted from 1.
    pub plain: Vec<PlainPoint>,
    /// `turn`: share of the old image in each frame; what the preset itself ends at counts as 0.
    #[serde(deserialize_with = "numbers_or_nan")]
    pub residuals: Vec<f64>,
    /// Frames in which half of that is forgotten, by all frames that still show some.
    pub half_life: Option<f64>,
    /// First frame, from 0, with no more than a twentieth of the old.
    pub gone: Option<usize>,
    /// What the old adds to the mean squared error.
    pub ghosting: Option<f64>,
    /// `sidestep`: frames until the error stays within a tenth of where it ends.
    pub recovery: Option<usize>,
}

/// Error of plain accumulation some frames after a change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct PlainPoint {
    /// Frames since the change, the first is 1.
    pub frame: u32,
    /// Error over the pixels that are looked at.
    #[serde(deserialize_with = "number_or_nan")]
    pub rmse: f64,
}

impl ChangedFrames {
    /// Errors of the preset and of plain accumulation in frame `frame` after the change, from 1.
    pub fn at(&self, frame: u32) -> Option<(f64, f64)> {
        let plain = self.plain.iter().find(|p| p.frame == frame)?.rmse;
        Some((*self.rmse.get(frame.checked_sub(1)? as usize)?, plain))
    }
}

/// Times of frames of a scene by number of bounces.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct BouncesRecord {
    /// Scene.
    pub scene: String,
    /// Triangles and spheres over all instances.
    pub primitives: u64,
    /// Preset.
    pub preset: String,
    /// 1, 2, 3, 4 bounces.
    pub points: Vec<BouncePoint>,
}

/// Times of frames of one number of bounces.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct BouncePoint {
    /// Maximum number of bounces.
    pub bounces: u32,
    /// Of the preset.
    pub cost: FrameCost,
    /// Time of an image of one path per pixel of plain accumulation.
    #[serde(deserialize_with = "number_or_nan")]
    pub plain_ms: f64,
    /// Frames per second of Coello (2024) at 1920x1080 on a GeForce RTX 2070 Max-Q, where the scene is his.
    pub coello_fps: Option<f64>,
}

const COLUMNS: [&str; 24] = [
    "part",
    "scene",
    "preset",
    "frame",
    "pass",
    "device ms",
    "device ms p95",
    "wall ms",
    "camera rays",
    "rays",
    "reference rmse",
    "rmse",
    "rmse corrected",
    "rel mse",
    "bias",
    "flip",
    "plain paths",
    "plain rmse",
    "plain rmse corrected",
    "plain flip",
    "flicker",
    "half-life",
    "ghosting",
    "recovery",
];

/// A row; what it does not say is empty.
#[derive(Clone)]
struct Row([String; COLUMNS.len()]);

impl Row {
    fn new(part: &str, scene: &str, preset: &str) -> Self {
        let empty = Self(std::array::from_fn(|_| String::new()));
        empty.text("part", part).text("scene", scene).text("preset", preset)
    }

    fn text(mut self, column: &str, value: &str) -> Self {
        if let Some(k) = COLUMNS.iter().position(|c| *c == column) {
            value.clone_into(&mut self.0[k]);
        }
        self
    }

    fn number(self, column: &str, value: impl Into<Option<f64>>) -> Self {
        let text = value.into().map(|v| if v.fract() == 0.0 && v.abs() < 1e15 { format!("{v:.0}") } else { format!("{v:.6}") });
        self.text(column, &text.unwrap_or_default())
    }

    fn errors(self, e: &FrameErrors) -> Self {
        let row = self.number("rmse", e.rmse).number("rmse corrected", e.rmse_corrected).number("rel mse", e.rel_mse);
        row.number("bias", e.bias).number("flip", e.flip)
    }

    fn plain(self, p: &PlainImage) -> Self {
        let row = self.number("plain paths", f64::from(p.paths)).number("plain rmse", p.errors.rmse);
        row.number("plain rmse corrected", p.errors.rmse_corrected).number("plain flip", p.errors.flip)
    }

    fn denoised(self, d: &DenoisedImage) -> Self {
        self.text("pass", "oidn").number("plain paths", f64::from(d.paths)).number("wall ms", d.ms).errors(&d.errors)
    }

    fn peer(self, p: &PeerPoint) -> Self {
        let row = self.number("frame", f64::from(p.frame)).number("plain paths", f64::from(p.image.paths));
        row.errors(&p.image.errors)
    }

    fn cost(self, c: &FrameCost) -> Self {
        let row = self.number("device ms", c.device_ms.median).number("device ms p95", c.device_ms.p95);
        row.number("wall ms", c.wall_ms.median).number("camera rays", c.camera_rays).number("rays", c.rays)
    }

    /// One row for each pass.
    fn passes(&self, c: &FrameCost) -> Vec<Self> {
        let of = |p: &super::cost::PassTime| {
            self.clone().text("pass", &p.pass).number("device ms", p.ms.median).number("device ms p95", p.ms.p95)
        };
        c.passes.iter().map(of).collect()
    }
}

impl FramesView {
    fn rows(&self) -> Vec<Row> {
        let mut rows = Vec::new();
        for r in &self.still {
            let head = Row::new("still", &self.scene, &r.preset);
            let last = r.curve.len().saturating_sub(1);
            for (k, p) in r.curve.iter().enumerate() {
                let row = head.clone().number("frame", f64::from(p.frame)).number("reference rmse", self.reference_rmse);
                let row = row.errors(&p.errors).plain(&p.plain);
                rows.push(if k == last { row.cost(&r.cost).number("flicker", r.flicker.map(|f| f.rms)) } else { row });
            }
            rows.extend(head.passes(&r.cost));
            rows.extend(r.denoised.iter().map(|d| head.clone().denoised(d)));
            for peer in &r.peers {
                let head = head.clone().text("pass", &peer.peer).number("reference rmse", peer.reference_rmse);
                rows.extend(peer.points.iter().map(|p| head.clone().peer(p)));
            }
        }
        for m in &self.motions {
            for r in &m.results {
                let head = Row::new(&m.motion, &self.scene, &r.preset);
                let row = head.clone().number("reference rmse", m.reference_rmse).cost(&r.cost);
                rows.push(row.errors(&r.errors).plain(&r.plain));
                rows.extend(head.passes(&r.cost));
                rows.extend(r.denoised.iter().map(|d| head.clone().denoised(d)));
            }
        }
        for c in &self.changes {
            for r in &c.results {
                let head = Row::new(&c.change, &self.scene, &r.preset).number("reference rmse", c.reference_rmse);
                rows.extend(r.plain.iter().filter_map(|p| {
                    let (ours, plain) = r.at(p.frame)?;
                    Some(head.clone().number("frame", f64::from(p.frame)).number("rmse", ours).number("plain rmse", plain))
                }));
                let row = head.number("half-life", r.half_life).number("ghosting", r.ghosting);
                rows.push(row.number("recovery", r.recovery.map(|n| n as f64)));
            }
        }
        rows
    }
}

impl BenchRecord for FramesBenchmark {
    fn saved(&self) -> SavedRecord {
        SavedRecord::Frames(Box::new(self.clone()))
    }

    fn completeness(&mut self) -> &mut Completeness {
        &mut self.completeness
    }

    fn is_empty(&self) -> bool {
        self.views.is_empty() && self.bounces.is_empty()
    }

    fn write_csv(&self, out: &mut dyn Write) -> csv::Result<()> {
        let mut csv = csv::Writer::from_writer(out);
        csv.write_record(COLUMNS)?;
        for row in self.views.iter().flat_map(FramesView::rows) {
            csv.write_record(row.0)?;
        }
        for b in &self.bounces {
            for p in &b.points {
                let row = Row::new(&format!("{} bounces", p.bounces), &b.scene, &b.preset).cost(&p.cost);
                csv.write_record(row.0)?;
            }
        }
        csv.flush()?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(rmse: f64) -> FrameErrors {
        FrameErrors { rmse, rmse_corrected: rmse, ..FrameErrors::default() }
    }

    #[test]
    fn ratios_to_plain_accumulation() {
        let point = |frame, ours, plain| FramePoint {
            frame,
            errors: errors(ours),
            plain: PlainImage { paths: 4 * frame, errors: errors(plain) },
        };
        let still = StillFrames { curve: vec![point(1, 0.1, 0.4), point(2, 0.1, 0.2)], ..StillFrames::default() };
        assert_eq!(still.ratio(), Some(0.5));
        let exact = MovingFrames { errors: errors(0.1), ..MovingFrames::default() };
        assert_eq!(exact.ratio(), None);
    }

    #[test]
    fn a_row_a_result() {
        let curve = vec![FramePoint { frame: 1, ..FramePoint::default() }, FramePoint { frame: 2, ..FramePoint::default() }];
        let flicker = Some(Flicker { after: 1, rms: 0.25, greatest: 0.5 });
        let still = vec![StillFrames { preset: "fast".into(), curve, flicker, ..StillFrames::default() }];
        let changed =
            ChangedFrames { rmse: vec![0.5, 0.25], plain: vec![PlainPoint { frame: 2, rmse: 1.5 }], ..Default::default() };
        let changes = vec![FramesChange { change: "turn".into(), results: vec![changed], ..FramesChange::default() }];
        let view = FramesView { scene: "a.glb".into(), still, changes, ..FramesView::default() };
        let mut text = Vec::new();
        FramesBenchmark { views: vec![view], ..FramesBenchmark::default() }.write_csv(&mut text).unwrap();
        let mut reader = csv::Reader::from_reader(text.as_slice());
        let head = reader.headers().unwrap().clone();
        let rows: Vec<_> = reader.records().map(Result::unwrap).collect();
        let at = |row: usize, name: &str| rows[row][head.iter().position(|h| h == name).unwrap()].to_owned();
        assert_eq!(rows.len(), 4);
        assert_eq!([at(0, "flicker"), at(1, "flicker"), at(2, "plain rmse")], ["", "0.250000", "1.500000"]);
        assert_eq!((at(2, "rmse"), at(3, "part")), ("0.250000".into(), "turn".into()));
    }
}
