//! `skylit rays`: traces and times a raw file of rays. The file formats are simple, so that other
//! tracers can read the same files.

use std::io::Write;
use std::path::Path;

use super::args::RaysArgs;
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::files;
use crate::files::plan::FilePlan;
use crate::gpu::Device;
use crate::integrators::rays;
use crate::measure::stats::median;
use crate::ray::{Ray, translate};
use crate::scene::{Scene, export};
use crate::terminal::interrupt::{self, ProgressControl};
use crate::terminal::progress::Progress;
use crate::terminal::warnings::Warnings;
use crate::tracer::{Needs, Tracer};

/// Loads, traces, and reports.
pub fn run(args: &RaysArgs) -> Result<()> {
    args.device.check_with_files()?;
    interrupt::install();

    // files are checked before anything is loaded
    let console = args.verbosity.console();
    let mut plan = FilePlan::default();
    plan.reads("--mesh", &args.mesh);
    plan.reads("--rays", &args.rays);
    args.device.areas_file().iter().for_each(|path| plan.reads("--build-areas", path));
    if let Some(hits) = &args.hits {
        plan.writes("--hits", hits);
        plan.check()?;
        files::check_writable(hits)?;
    }

    // rays and the scene, around the same origin
    let mut set = read_rays(&args.rays)?;
    rays::check(&set)?;
    let scene = read_mesh(args)?;
    plan.check_scene(&scene.report.files)?;
    let mut warnings = Warnings::new(console);
    scene.report.all_warnings().iter().for_each(|w| warnings.add(w));
    let flat = FlatScene::new(&scene);
    translate(&mut set, -flat.origin);

    let device = Device::open(&args.device.options())?;
    let (kind, _, compute) = args.device.choose(&device.info)?;
    // the repeats and one warm-up pass
    let build = args.device.build_options(set.len() as u64 * (args.repeats as u64 + 1))?;
    let tracer = Tracer::with_build(&device, kind, &flat, Needs::default(), compute, &build)?;
    build.take_warnings().iter().for_each(|w| warnings.add(w));
    let stats = tracer.stats();

    // the measurement
    let mut control = ProgressControl { progress: Progress::new("tracing", &console), keep_partial: false };
    let (hits, times) = rays::trace(&tracer, &set, args.mode, args.repeats, &mut control)?;
    drop(control);
    if let Some(path) = &args.hits {
        files::write_atomically(path, |file| file.write_all(bytemuck::cast_slice(&hits)))?;
    }

    device.check_validation()?;
    device.save_pipeline_cache();

    let hit_count = hits.iter().filter(|h| h.is_hit()).count();
    let rate = |seconds: f64| if seconds > 0.0 { set.len() as f64 / seconds / 1e6 } else { 0.0 };
    let middle = |seconds: &[f64]| median(seconds).unwrap_or(0.0);
    let (on_device, on_wall) = (rate(middle(&times.device)), rate(middle(&times.wall)));

    // a line for people, a record for programs
    console.line(&format!(
        "{} rays, {hit_count} hit; tracer {kind}{} on {}: {on_device:.2} Mrays/s on the device, {on_wall:.2} by wall clock \
         (median of {}); built in {:.3} s, {:.1} bytes per primitive",
        set.len(),
        tracer.compute_options().map(|o| format!(" ({})", o.kernel)).unwrap_or_default(),
        device.info.name,
        args.repeats,
        stats.build_seconds,
        stats.bytes_per_primitive(),
    ))?;
    console.record(&serde_json::json!({
        "tracer": kind.name(),
        "traversal": tracer.compute_options().map(|o| o.kernel),
        "triangle_test": tracer.compute_options().map(|o| o.triangle_test),
        "device": device.info.name,
        "driver": device.info.driver,
        "mode": args.mode,
        "triangles": scene.triangle_count(),
        "spheres": scene.sphere_count(),
        "rays": set.len(),
        "hits": hit_count,
        "build_seconds": stats.build_seconds,
        "upload_seconds": stats.upload_seconds,
        "on_device": stats.on_device,
        "bytes_per_triangle": stats.bytes_per_primitive(),
        "mrays_s": on_device,
        "mrays_s_wall": on_wall,
        "device_seconds": times.device,
        "wall_seconds": times.wall,
        "warnings": warnings.list,
    }))
}

/// Reads a triangle soup (.bin) or any scene.
fn read_mesh(args: &RaysArgs) -> Result<Scene> {
    let path = Path::new(&args.mesh);
    let soup = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("bin"));
    if soup { export::read_mesh_bin(path) } else { args.load.load(&args.mesh, &args.verbosity.console()) }
}

/// Reads RAYS.bin.
pub(super) fn read_rays(path: &Path) -> Result<Vec<Ray>> {
    let bytes = files::read(path)?;
    if bytes.is_empty() || bytes.len() % size_of::<Ray>() != 0 {
        let message = format!(
            "{} bytes: expected a non-zero multiple of {} bytes, the size of a ray",
            bytes.len(),
            size_of::<Ray>()
        );
        return Err(Error::input(path, message));
    }
    Ok(bytemuck::pod_collect_to_vec(&bytes))
}
