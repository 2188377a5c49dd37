//! `skylit export`: a scene as glTF, or as the plain triangles that other tracers read.

use std::path::Path;

use super::args::ExportArgs;
use crate::error::{Error, Result};
use crate::output;
use crate::scene::{Scene, export, load};

/// Loads and writes.
pub fn run(args: &ExportArgs) -> Result<()> {
    let console = args.verbosity.console();
    let extension = args.output.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let write: fn(&Scene, &Path) -> Result<()> = match extension.as_str() {
        "bin" => |scene, path| export::write_mesh_bin(scene, path).map(drop),
        "glb" | "gltf" => export::export_gltf,
        _ => {
            let path = args.output.display();
            return Err(Error::Usage(format!("{path}: unknown kind of scene: the name must end in .bin, .glb or .gltf")));
        }
    };
    output::check_writable(&args.output)?;
    let scene = load::load(&args.scene)?;
    super::warn(&console, &scene);
    if scene.sphere_count() > 0 {
        console.warning(&format!("{} analytic spheres become triangles: .{extension} cannot hold them", scene.sphere_count()));
    }
    write(&scene, &args.output)?;
    console.line(&format!("{}: {} triangles of {}", args.output.display(), scene.triangle_count(), scene.name))?;
    console.record(&serde_json::json!({
        "scene": scene.name,
        "output": args.output,
        "triangles": scene.triangle_count(),
        "spheres": scene.sphere_count(),
        "warnings": scene.report.warnings,
    }))
}
