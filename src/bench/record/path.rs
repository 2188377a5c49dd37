//! What a benchmark of path tracing found: how the error of an image falls with the time spent on it, by contestant.
//!
//! A *contestant* is a sampling strategy of ours, or a kernel of a peer. Errors are root mean squares over all pixels and channels, of linear
//! radiance, against a reference of the contestant's own engine, with the reference's own error taken off: engines whose materials differ
//! are compared by how soon they know *their* image.

use std::io::Write;

use serde::{Deserialize, Serialize};

use super::saved::SavedRecord;
use super::{BenchRecord, Completeness, HostInfo};
use crate::measure::stats::{Summary, number_or_nan, numbers_or_nan};

/// Name of our own engine.
pub const OWN: &str = "skylit";

/// A whole run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct PathBenchmark {
    /// What it ran on.
    #[serde(flatten)]
    pub host: HostInfo,
    /// How our rays were traced.
    pub tracer: String,
    /// Timed images of each kind, after one that warms up.
    pub repeats: u32,
    /// Peers that ran, as they introduce themselves.
    pub peers: Vec<String>,
    /// What was measured.
    pub scenes: Vec<SceneRecord>,
    /// What is missing.
    #[serde(flatten)]
    pub completeness: Completeness,
}

/// One scene.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct SceneRecord {
    /// As on the command line.
    pub scene: String,
    /// Pixels.
    pub size: [u32; 2],
    /// Over all instances.
    pub triangles: u64,
    /// Over all instances.
    pub spheres: u64,
    /// Lights that our integrator samples.
    pub lights: u32,
    /// Environment light, in words.
    pub environment: String,
    /// Reference images, by engine.
    pub references: Vec<ReferenceRecord>,
    /// How far the references of peers are from ours.
    pub differences: Vec<ReferenceDifference>,
    /// Error that [`ContestantRecord::seconds_to_target`] is about, and whose greatest sample count reached it.
    pub target: Option<ErrorTarget>,
    /// By contestant.
    pub results: Vec<ContestantRecord>,
}

/// A reference image by one engine.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ReferenceRecord {
    /// `skylit`, or the name of a peer.
    pub engine: String,
    /// Paths a pixel.
    pub spp: u64,
    /// Seconds spent on it.
    pub seconds: f64,
    /// Its own error, from two independent halves.
    #[serde(deserialize_with = "number_or_nan")]
    pub rmse: f64,
    /// Mean radiance of all pixels and channels.
    #[serde(deserialize_with = "number_or_nan")]
    pub mean: f64,
}

/// Two references beside each other.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ReferenceDifference {
    /// The peer.
    pub engine: String,
    /// Its mean over ours.
    #[serde(deserialize_with = "number_or_nan")]
    pub mean_ratio: f64,
    /// Between the images.
    #[serde(deserialize_with = "number_or_nan")]
    pub rmse: f64,
    /// What the references' own errors explain of it.
    #[serde(deserialize_with = "number_or_nan")]
    pub explained: f64,
}

/// An error, and the contestant that set it.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ErrorTarget {
    /// Root mean square.
    #[serde(deserialize_with = "number_or_nan")]
    pub rmse: f64,
    /// Contestant whose last point it is.
    pub set_by: String,
}

/// Images of one sample count.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ErrorPoint {
    /// Paths a pixel.
    pub spp: u32,
    /// Wall seconds of an image.
    pub seconds: Option<Summary>,
    /// Wall seconds of each timed image, in the order of the rounds.
    #[serde(deserialize_with = "numbers_or_nan")]
    pub repeats: Vec<f64>,
    /// Error, over all repeats, the reference's own taken off; unless `unsure`.
    #[serde(deserialize_with = "number_or_nan")]
    pub rmse: f64,
    /// The same of each image, those of the warming round included.
    #[serde(deserialize_with = "numbers_or_nan")]
    pub rmse_repeats: Vec<f64>,
    /// The reference's own error is more than half of what was measured: `rmse` is all of that, and the error is less.
    pub unsure: bool,
    /// Share of pixels that are wrong to the eye: off by more than a tenth of white in any channel after 1 - exp(-radiance).
    #[serde(deserialize_with = "number_or_nan")]
    pub bad_pixels: f64,
}

/// What one contestant did.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct ContestantRecord {
    /// In tables.
    pub name: String,
    /// Engine whose reference it is compared with.
    pub engine: String,
    /// By sample count, ascending.
    pub points: Vec<ErrorPoint>,
    /// Of all images: mean of image - reference, in standard errors of the repeats' means; `None` with fewer than three.
    pub bias_sigmas: Option<f64>,
    /// 10^6 paths a second at the greatest sample count.
    #[serde(deserialize_with = "number_or_nan")]
    pub mpaths: f64,
    /// 10^6 rays a second there, where they are counted.
    pub mrays: Option<f64>,
    /// 1 / (mean squared error * seconds) there (Veach 1997).
    #[serde(deserialize_with = "number_or_nan")]
    pub efficiency: f64,
    /// Longest launch on the device, seconds, where it is known.
    pub longest_launch: Option<f64>,
    /// To the target.
    pub seconds_to_target: Option<TimeToError>,
}

/// Time at which an error is reached.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimeToError {
    /// Wall seconds of one image.
    pub seconds: f64,
    /// How it was found.
    pub how: TimeEstimate,
}

/// How a time was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TimeEstimate {
    /// Interpolated between two measured images.
    Between,
    /// An upper bound: the shortest measured image is better already.
    Less,
    /// Extrapolated by the square root law from the longest measured image.
    Extrapolated,
}

impl ContestantRecord {
    /// Time at which the error falls to `rmse`: logarithmically between points; after the last one as for independent samples.
    pub fn time_to(&self, rmse: f64) -> Option<TimeToError> {
        let curve: Vec<(f64, f64)> =
            self.points.iter().filter_map(|p| Some((p.seconds?.median, p.rmse))).filter(|p| p.1.is_finite()).collect();
        let (first, last) = (curve.first()?, curve.last()?);
        if first.1 <= rmse {
            return Some(TimeToError { seconds: first.0, how: TimeEstimate::Less });
        }
        let between = curve.windows(2).find(|w| w[0].1 > rmse && w[1].1 <= rmse).map(|w| {
            let [(t0, e0), (t1, e1)] = [w[0], w[1]];
            // no error at all is as good as the target
            let share = if e1 > 0.0 { (e0 / rmse).ln() / (e0 / e1).ln() } else { 1.0 };
            TimeToError { seconds: t0 * (t1 / t0).powf(share), how: TimeEstimate::Between }
        });
        between.or_else(|| {
            (rmse > 0.0).then(|| TimeToError { seconds: last.0 * (last.1 / rmse).powi(2), how: TimeEstimate::Extrapolated })
        })
    }
}

impl SceneRecord {
    /// Says when everybody reaches the error that `set_by` had in the end.
    pub fn set_target(&mut self, set_by: &str) {
        let Some(target) = self.results.iter().find(|r| r.name == set_by).and_then(|r| r.points.last()) else { return };
        if target.rmse == 0.0 || !target.rmse.is_finite() {
            return;
        }
        let rmse = target.rmse;
        self.target = Some(ErrorTarget { rmse, set_by: set_by.to_owned() });
        self.results.iter_mut().for_each(|r| r.seconds_to_target = r.time_to(rmse));
    }
}

impl BenchRecord for PathBenchmark {
    fn saved(&self) -> SavedRecord {
        SavedRecord::Path(Box::new(self.clone()))
    }

    fn completeness(&mut self) -> &mut Completeness {
        &mut self.completeness
    }

    fn is_empty(&self) -> bool {
        self.scenes.iter().all(|s| s.results.is_empty())
    }

    fn write_csv(&self, out: &mut dyn Write) -> csv::Result<()> {
        let mut csv = csv::Writer::from_writer(out);
        csv.write_record([
            "scene",
            "contestant",
            "engine",
            "width",
            "height",
            "spp",
            "seconds",
            "seconds min",
            "seconds max",
            "rmse",
            "unsure",
            "bad pixels",
            "reference rmse",
            "target rmse",
            "seconds to target",
            "how",
        ])?;
        for scene in &self.scenes {
            for result in &scene.results {
                let reference = scene.references.iter().find(|r| r.engine == result.engine).map(|r| r.rmse);
                let text = |x: Option<f64>| x.map_or_else(String::new, |x| x.to_string());
                for point in &result.points {
                    let seconds = point.seconds;
                    csv.write_record([
                        scene.scene.clone(),
                        result.name.clone(),
                        result.engine.clone(),
                        scene.size[0].to_string(),
                        scene.size[1].to_string(),
                        point.spp.to_string(),
                        text(seconds.map(|s| s.median)),
                        text(seconds.map(|s| s.min)),
                        text(seconds.map(|s| s.max)),
                        point.rmse.to_string(),
                        point.unsure.to_string(),
                        point.bad_pixels.to_string(),
                        text(reference),
                        text(scene.target.as_ref().map(|t| t.rmse)),
                        text(result.seconds_to_target.map(|r| r.seconds)),
                        result.seconds_to_target.map_or_else(String::new, |r| format!("{:?}", r.how).to_lowercase()),
                    ])?;
                }
            }
        }
        csv.flush()?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(points: &[(f64, f64)]) -> ContestantRecord {
        let point = |&(t, rmse): &(f64, f64)| ErrorPoint { seconds: Summary::from_values(&[t]), rmse, ..ErrorPoint::default() };
        ContestantRecord { name: "x".into(), points: points.iter().map(point).collect(), ..ContestantRecord::default() }
    }

    #[test]
    fn times_to_an_error() {
        // error 1 / sqrt(t)
        let c = curve(&[(1.0, 1.0), (4.0, 0.5), (16.0, 0.25)]);
        let at = |rmse| c.time_to(rmse).unwrap();
        assert!((at(0.7).seconds - 1.0 / 0.49).abs() < 1e-9 && at(0.7).how == TimeEstimate::Between);
        assert!((at(0.125).seconds - 64.0).abs() < 1e-9 && at(0.125).how == TimeEstimate::Extrapolated);
        assert_eq!(at(2.0), TimeToError { seconds: 1.0, how: TimeEstimate::Less });
        assert_eq!(at(0.25), TimeToError { seconds: 16.0, how: TimeEstimate::Between });
        assert_eq!(curve(&[]).time_to(1.0), None);
        // one that is exact in the end
        let exact = curve(&[(1.0, 1.0), (2.0, 0.0)]);
        assert_eq!(exact.time_to(0.5), Some(TimeToError { seconds: 2.0, how: TimeEstimate::Between }));
        let mut scene = SceneRecord { results: vec![c.clone()], ..SceneRecord::default() };
        scene.set_target("x");
        assert_eq!(scene.target.as_ref().unwrap().rmse, 0.25);
        assert_eq!(scene.results[0].seconds_to_target.unwrap().seconds, 16.0);
    }
}
