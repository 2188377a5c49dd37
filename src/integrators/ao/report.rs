//! The report of an ambient occlusion image.

use serde_json::{Value, json};

use super::{AoOptions, AoResult};
use crate::film::covered_mean;
use crate::integrators::IntegratorReport;
use crate::interface::records::ao::MAX_ENTRY_POINTS;

/// Composes the report of an ambient occlusion image.
pub(super) fn report(options: &AoOptions, result: &AoResult) -> IntegratorReport {
    let image = &result.image;
    let covered_mean = covered_mean(&image.film.mean, 1, &image.film.coverage);
    let traced = result.camera_rays + result.occlusion_rays;
    let mrays_s = if image.trace_seconds > 0.0 { traced as f64 / image.trace_seconds / 1e6 } else { 0.0 };
    let finite = |v: f64| if v.is_finite() { json!(v) } else { Value::Null };
    let record = json!({
        "ao": {
            "radius": finite(options.occlusion.radius),
            "falloff": options.occlusion.falloff,
            "normal": options.occlusion.hemisphere,
            "rays": options.rays,
            "reach": finite(options.occlusion.reach()),
        },
        "covered_mean": covered_mean,
        "rays": {
            "primary": result.camera_rays,
            "skipped_primary": image.skipped_primary_rays,
            "occlusion": result.occlusion_rays,
            "skipped": result.skipped_rays,
        },
        "mrays_s_wall": mrays_s,
    });

    // Explanations of skipped work.
    let is_binary = options.occlusion.is_binary();
    let occlusion = if is_binary {
        "binary occlusion: any-hit rays"
    } else {
        "occlusion falls off with distance: closest-hit rays"
    };
    let mut explanations = vec![occlusion.to_owned()];
    explanations.push(match options.occlusion.reach() {
        r if r.is_finite() => {
            // four digits, however small the scene is
            let reach: f64 = format!("{r:.3e}").parse().unwrap_or(r);
            format!("occlusion rays end at distance {reach}: hits beyond change no sample")
        }
        _ => "occlusion rays are infinite: neither --ao-radius nor --ao-falloff is given".into(),
    });
    if result.has_entry_points {
        explanations.push(format!(
            "entry points: camera rays of 2x2 pixels start at up to {MAX_ENTRY_POINTS} blocks of the hierarchy, \
             the levels above are skipped"
        ));
    }
    if options.rays > 1 {
        explanations.push(format!("camera rays are shared by {} samples of their pixel", options.rays));
    }
    let all = result.occlusion_rays + result.skipped_rays;
    // a sample of an open ground counts as one whose camera ray missed
    let why = match options.catcher {
        None => "not traced: their camera ray missed",
        Some(_) => "not traced, or of the open ground: they show what is behind the scene",
    };
    explanations.push(format!(
        "{} of {all} occlusion rays ({:.1} %) {why}",
        result.skipped_rays,
        100.0 * result.skipped_rays as f64 / all.max(1) as f64
    ));
    IntegratorReport {
        lines: vec![format!("mean over the scene's pixels {covered_mean:.5}; {mrays_s:.1} Mrays/s")],
        explanations,
        record: record.as_object().cloned().unwrap_or_default(),
        warnings: Vec::new(),
    }
}
