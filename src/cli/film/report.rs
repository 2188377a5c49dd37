//! What `skylit render` tells of a film: how good it is, and how that was come by.

use serde_json::{Value, json};

use crate::cli::args::RenderArgs;
use crate::film::Film;
use crate::film::convergence::TileCount;
use crate::scene::RenderHints;

/// The same for people and for programs.
pub struct Told {
    /// A sentence each.
    pub lines: Vec<String>,
    /// A map.
    pub record: Value,
}

/// Tells of a film that was to get `spp` samples per pixel, and had `before` when it was gone on with.
pub fn tell(
    args: &RenderArgs,
    hints: &RenderHints,
    film: &Film,
    converged: Option<TileCount>,
    before: Option<u32>,
    spp: u32,
) -> Told {
    let (min, mean, max) = film.samples_range();
    let (options, estimated) = (&args.film, film.estimated_rmse());
    let mut lines = Vec::new();
    if let (Some(before), Some(path)) = (before, &options.resume) {
        lines.push(format!("went on with {} from {before} samples per pixel", path.display()));
    }
    if let (Some(tiles), Some(target)) = (converged, options.target_rmse) {
        lines.push(format!(
            "estimated rmse {estimated:.3e} (target {target:e}): {} of {} tiles done; {min} to {max} samples per pixel, {mean:.1} in the mean",
            tiles.done, tiles.all
        ));
    }
    if !options.intervals && hints.save_intervals.iter().any(|&n| n < spp) {
        lines.push("the scene asks for images on the way: add --intervals".into());
    }
    let record = json!({
        "samples": { "min": min, "mean": mean, "max": max },
        "estimated_rmse": estimated,
        "target_rmse": options.target_rmse,
        "tiles": converged,
        "resumed": options.resume,
        "samples_before": before,
    });
    Told { lines, record }
}
