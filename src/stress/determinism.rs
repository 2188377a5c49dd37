//! Section 9, determinism: the same seed gives the same bits over runs, sizes of launches, restarts
//! and numbers of threads, and close images over tracers and vector widths.

use std::cell::OnceCell;
use std::path::Path;
use std::process::{Command, Stdio};

use super::closed_forms::{self, options};
use super::sampling;
use super::{Check, Section, Setup, StressSession, Watch};
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::SampleSettings;
use crate::integrators::path::PathOptions;
use crate::output::{self, Image};
use crate::scene::{Scene, builtin};

pub const SECTION: Section = Section {
    name: "determinism",
    title: "Determinism",
    about: "the same seed gives the same bits over runs, threads, tile masks and restarts, and images that agree within a bound over tracers and vector widths",
    of_scene: false,
    run,
};

/// Largest share of pixels that another tracer may render differently by more than a rounding.
const SHARE: f64 = 0.02;
/// Ambient visibility that is more than a rounding.
const STEP: f32 = 1e-5;

/// Values of two images that differ in any bit; all, if their numbers do.
pub fn different_bits(a: &[f32], b: &[f32]) -> usize {
    if a.len() == b.len() {
        a.iter().zip(b).filter(|(a, b)| a.to_bits() != b.to_bits()).count()
    } else {
        a.len().max(b.len())
    }
}

/// Share of two images' values that differ by more than `STEP`, and the difference of their means.
pub fn difference(a: &[f32], b: &[f32]) -> (f64, f64) {
    let n = a.len().min(b.len()).max(1) as f64;
    let differ = a.iter().zip(b).filter(|(a, b)| (*a - *b).is_nan() || (*a - *b).abs() > STEP).count() as f64;
    (differ / n, a.iter().zip(b).map(|(a, b)| f64::from(a - b)).sum::<f64>() / n)
}

fn scene(name: &str) -> Result<Scene> {
    builtin::by_name(name).ok_or_else(|| Error::Scene(format!("no built-in scene {name}")))
}

fn run(session: &mut StressSession) -> Result<()> {
    let kinds = session.setup().tracers();
    let (size, spp) = session.setup().effort().pick((64, 4), (256, 64));
    let stairs = scene("stairs")?;
    let ao = |s: &Setup, kind, w: &mut Watch| -> Result<Vec<f32>> {
        let tracer = s.tracer(kind, &stairs)?;
        Ok(closed_forms::render(&tracer, &stairs, &stairs.cameras[0], &options(size, spp, 1.0, 2.0), w)?
            .image
            .film
            .mean)
    };
    let name = "ambient occlusion, two runs";
    session.measure_each(name, &kinds, |s, kind, w| {
        let (a, b) = (ao(s, kind, w)?, ao(s, kind, w)?);
        Ok(Check::at_most(name, different_bits(&a, &b) as f64, "pixels", 0.0).says(format!("of {} differ", a.len())))
    })?;

    // paths, and what does not depend on tiles
    let name = "paths, two runs";
    let shading = session.setup().shading_tracers();
    session.measure_each(name, &shading, |s, kind, w| {
        let cornell = scene("cornell-box")?;
        let flat = FlatScene::for_paths(&cornell);
        let options = PathOptions { samples: SampleSettings::new([32, 32], 4, 3), max_depth: 3, ..Default::default() };
        let image = |w: &mut Watch| -> Result<Vec<f32>> {
            Ok(sampling::render(&super::scale::path_tracer(s, kind, &flat)?, &flat, &options, w)?.image.film.mean)
        };
        let (a, b) = (image(w)?, image(w)?);
        Ok(Check::at_most(name, different_bits(&a, &b) as f64, "values", 0.0).says(format!("of {} differ", a.len())))
    })?;
    let name = "tiles that show nothing, left out";
    session.measure_each(name, &kinds, |s, kind, w| masked_tiles(s, kind, name, &stairs, w))?;

    // tracers among one another
    if let [first, others @ ..] = &kinds[..] {
        for kind in others {
            let name = format!("{kind} against {first}");
            session.measure(&name, Some(*kind), |s, w| {
                let (share, bias) = difference(&ao(s, *kind, w)?, &ao(s, *first, w)?);
                let sentence = format!("of the pixels differ by more than {STEP:e}; means differ by {bias:+.1e}");
                let value = if bias.abs() > 1e-3 { f64::NAN } else { share };
                Ok(Check::at_most(name.as_str(), value, "of the pixels", SHARE).says(sentence))
            })?;
        }
    }
    restarts(session)
}

/// The same image without the tiles to which nothing projects, in launches of other sizes.
fn masked_tiles(
    setup: &Setup,
    kind: crate::tracer::TracerKind,
    name: &str,
    scene: &Scene,
    watch: &mut Watch,
) -> Result<Check> {
    use crate::film::camera::CameraRecord;
    use crate::film::tile_mask::TileMask;
    use crate::integrators::ao;
    let flat = FlatScene::new(scene);
    let tracer = setup.tracer(kind, scene)?;
    let record = CameraRecord::new(&scene.cameras[0], flat.origin, 1.0);
    let whole = options(72, 3, 1.0, 2.0);
    let all = ao::render(&tracer, &record, &whole, watch)?.image.film.mean;
    let tile_mask = TileMask::new(&flat, &record, whole.samples.size, whole.samples.spp).map(std::sync::Arc::new);
    let masked = tile_mask.is_some();
    let some = ao::render(&tracer, &record, &whole.with_samples(|s| s.tile_mask = tile_mask), watch)?.image.film.mean;
    let note = if masked { "some tiles were left out" } else { "no tile could be left out" };
    Ok(Check::at_most(name, different_bits(&all, &some) as f64, "pixels", 0.0)
        .says(format!("of {} differ; {note}", all.len())))
}

/// Renders an image in a process of its own, with these variables of its environment.
fn in_child(program: &Path, setup: &Setup, file: &Path, variables: &[(&str, &str)]) -> Result<Image> {
    let mut command = Command::new(program);
    let size = setup.effort().pick("64x48", "256x192");
    command.args([
        "render",
        "builtin:stairs",
        "--size",
        size,
        "--spp",
        "4",
        "--ao-radius",
        "2",
        "--tracer",
        "compute",
        "--no-config",
        "--quiet",
    ]);
    if let Some(device) = &setup.device_settings.device {
        command.args(["--device", device]);
    }
    command.arg("--output").arg(file).envs(variables.iter().copied()).stdin(Stdio::null());
    let output = command.output().map_err(|e| Error::read(program, &e))?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        return Err(Error::CheckFailed(format!("{} ended with {}: {}", program.display(), output.status, text.trim())));
    }
    output::load(file)
}

fn visibility(image: &Image) -> Result<&[f32]> {
    image.f32("Y").ok_or_else(|| Error::CheckFailed("an image without ambient visibility".into()))
}

fn restarts(session: &mut StressSession) -> Result<()> {
    let (program, is_cpu) = (session.setup().program.clone(), session.setup().device().info.is_cpu());
    let (restart, threads) = ("the program started again", "threads and vector widths of the CPU driver");
    let Some(program) = program else {
        let why = "the program that would be started again is not known";
        return session.measure(restart, None, |_, _| Ok(Check::not_applicable(restart, why)));
    };
    let dir = tempfile::tempdir().map_err(|e| Error::write("a temporary folder", &e))?;
    let file = dir.path().join("image.exr");

    // the image that all others are compared with: rendered by the first check that is wanted
    let first = OnceCell::new();
    let unchanged = |s: &Setup| -> Result<&Vec<f32>> {
        if first.get().is_none() {
            let _ = first.set(visibility(&in_child(&program, s, &file, &[])?)?.to_vec());
        }
        first.get().ok_or_else(|| Error::CheckFailed("an image that was not kept".into()))
    };
    session.measure(restart, None, |s, _| {
        let (a, again) = (unchanged(s)?, in_child(&program, s, &file, &[])?);
        let differ = different_bits(a, visibility(&again)?);
        Ok(Check::at_most(restart, differ as f64, "pixels", 0.0).says(format!("of {} differ", a.len())))
    })?;
    if !is_cpu {
        let why = "the device is no CPU: its driver says how it divides work";
        return session.measure(threads, None, |_, _| Ok(Check::not_applicable(threads, why)));
    }

    // Threads change no bit, and vector widths little.
    for count in ["1", "2", "8"] {
        let name = format!("LP_NUM_THREADS={count}");
        session.measure(&name, None, |s, _| {
            let image = in_child(&program, s, &file, &[("LP_NUM_THREADS", count)])?;
            let differ = different_bits(visibility(&image)?, unchanged(s)?);
            Ok(Check::at_most(name.as_str(), differ as f64, "pixels", 0.0)
                .says("differ from the driver's own number of threads"))
        })?;
    }
    for bits in ["128", "256"] {
        let name = format!("LP_NATIVE_VECTOR_WIDTH={bits}");
        let cache = dir.path().join(bits);
        session.measure(&name, None, |s, _| {
            // Mesa's cache does not distinguish widths
            let cache = cache.to_string_lossy().into_owned();
            let image =
                in_child(&program, s, &file, &[("LP_NATIVE_VECTOR_WIDTH", bits), ("MESA_SHADER_CACHE_DIR", &cache)])?;
            let (share, bias) = difference(visibility(&image)?, unchanged(s)?);
            let value = if bias.abs() > 1e-3 { f64::NAN } else { share };
            let sentence = format!(
                "of the pixels differ by more than {STEP:e} from the width in use; means differ by {bias:+.1e}"
            );
            Ok(Check::at_most(name.as_str(), value, "of the pixels", SHARE).says(sentence))
        })?;
    }
    Ok(())
}
