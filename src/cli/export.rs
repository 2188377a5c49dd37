//! `skylit export`: writes a scene as glTF, or as a triangle soup for other tracers.

use std::path::Path;

use super::args::ExportArgs;
use crate::error::{Error, Result};
use crate::files;
use crate::scene::export::{self, ExportStats};
use crate::scene::{Scene, load};
use crate::terminal::warnings::{Warnings, warnings_of};

/// Loads a scene and writes it.
pub fn run(args: &ExportArgs) -> Result<()> {
    let console = args.verbosity.console();
    let output = args.output.as_ref().or(args.output_argument.as_ref());
    let output = output.ok_or_else(|| Error::Usage("export: say where to: add -o FILE".into()))?;
    let extension = output.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let write: fn(&Scene, &Path) -> Result<ExportStats> = match extension.as_str() {
        "bin" => export::write_mesh_bin,
        "glb" | "gltf" => export::export_gltf,
        _ => {
            let path = output.display();
            return Err(Error::Usage(format!("{path}: unknown format: the file name must end in .bin, .glb or .gltf")));
        }
    };
    files::check_writable(output)?;
    let mut scene = load::load(&args.scene)?;
    args.meaning.apply(&mut scene);
    let mut warnings = Warnings::new(console);
    warnings_of(&scene).iter().for_each(|w| warnings.add(w));
    let written = write(&scene, output)?;
    written.warnings.iter().for_each(|w| warnings.add(w));
    console.line(&format!("{}: {} triangles of {}", output.display(), written.triangles, scene.name))?;
    console.record(&serde_json::json!({
        "scene": scene.name,
        "output": output,
        "triangles": scene.triangle_count(),
        "spheres": scene.sphere_count(),
        "triangles_written": written.triangles,
        "warnings": warnings.list,
    }))
}
