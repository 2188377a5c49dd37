//! `skylit export`: writes a scene as glTF, or as a triangle soup for other tracers.

use std::path::Path;

use super::args::ExportArgs;
use crate::error::{Error, Result};
use crate::files;
use crate::files::plan::FilePlan;
use crate::scene::Scene;
use crate::scene::export::{self, ExportStats};
use crate::terminal::warnings::Warnings;

/// Checks the files that are written beside a `.gltf`: they replace no file of the scene and,
/// without `--force`, none that no earlier export to the same name has written.
fn check_companions(args: &ExportArgs, mut plan: FilePlan, scene: &Scene, output: &Path) -> Result<()> {
    let companions = export::companions(scene, output);
    companions.iter().for_each(|path| plan.writes("a file beside the output", path));
    plan.check()?;
    plan.check_scene(&scene.report.files)?;
    for path in companions {
        if path.exists() && !args.force && !export::is_companion_of(&path, output) {
            return Err(Error::Usage(format!(
                "{}: would be replaced by what belongs to {}, and no earlier export has written it: choose another name, or add --force",
                path.display(),
                output.display()
            )));
        }
        files::check_writable(&path)?;
    }
    Ok(())
}

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
    let mut plan = FilePlan::default();
    plan.reads("the scene", &args.scene);
    plan.writes("the output", output);
    plan.check()?;
    files::check_writable(output)?;
    let mut scene = args.load.load(&args.scene, &console)?;
    args.meaning.apply(&mut scene)?;
    scene.take_out_hidden();
    check_companions(args, plan, &scene, output)?;
    let mut warnings = Warnings::new(console);
    scene.report.all_warnings().iter().for_each(|w| warnings.add(w));
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
