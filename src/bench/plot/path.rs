//! A benchmark of path tracing, drawn: error against time, a panel a scene.

use super::chart::{self, Line, Panel, Picture};
use crate::bench::record::path::{PathBenchmark, SceneRecord};
use crate::error::Result;

/// Draws every scene.
///
/// # Errors
/// [`crate::Error::Usage`] when nothing was measured.
pub fn draw(benchmark: &PathBenchmark) -> Result<Picture> {
    let panel = |scene: &SceneRecord| Panel {
        title: format!("{}, {}x{}", scene.scene, scene.size[0], scene.size[1]),
        x: "seconds an image".into(),
        y: "RMSE".into(),
        lines: scene
            .results
            .iter()
            .map(|r| Line {
                name: r.name.clone(),
                points: r.points.iter().filter_map(|p| Some((p.seconds?.median, p.rmse))).collect(),
            })
            .collect(),
    };
    let panels: Vec<Panel> = benchmark.scenes.iter().filter(|s| !s.results.is_empty()).map(panel).collect();
    let subtitle = format!(
        "{} ({}), tracer {}, {} threads",
        benchmark.host.device, benchmark.host.driver, benchmark.tracer, benchmark.host.threads
    );
    chart::draw("Path tracing: error against time", &subtitle, &panels)
}
