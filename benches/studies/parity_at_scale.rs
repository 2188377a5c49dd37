//! Parity with the double-precision oracle and watertightness, on as many rays as one has patience for: more than a test run can
//! afford.
//!
//!     cargo run --release --example parity_at_scale -- [SCENE...] [--rays N] [--edge-rays N] [--without-int64] [--kernel wide,nearest]
//!
//! Rays that renderers send go through the compute tracer over every scene, any hit and nearest, and each answer is judged:
//! what differs from the oracle's by more than rounding is unexplained (`src/measure/parity.rs`). Rays aimed at edges and corners
//! of closed bodies must all hit. Prints a table, and every ray that is at fault; exits with 1 if there is one.
//!
//! The width of the driver's vectors is set from outside: `LP_NATIVE_VECTOR_WIDTH=256 MESA_SHADER_CACHE_DISABLE=true`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Parser;
use skylit::accel::flatten::FlatScene;
use skylit::film::NoControl;
use skylit::film::camera::{self, Choice};
use skylit::gpu::{Device, Options};
use skylit::integrators::rays::{Mode, trace};
use skylit::measure::parity::{ParityReport, judge_any, judge_closest, judge_weights};
use skylit::measure::ray_sets::{leak_rays, leak_scenes, mixed_rays};
use skylit::oracle::Oracle;
use skylit::oracle::rounding::Rounding;
use skylit::ray::{Hit, Ray};
use skylit::scene::load;
use skylit::tracer::{Kernel, Needs, Tracer, TracerKind};
use skylit::{Error, Result};

/// Scenes of our own: triangles, spheres, both, instances, alpha, and coordinates that single precision does not hold.
const BUILTIN: [&str; 8] = [
    "cornell-box",
    "cornell-spheres",
    "sphere-over-plane",
    "spheres:10000",
    "leaf-cards",
    "grid:16",
    "stairs",
    "far-away",
];
/// Scenes of others, where they are.
const SHARED: [&str; 4] =
    ["sponza/sponza.glb", "dragon/dragon.glb", "bunny/bunny.glb", "flight_helmet/FlightHelmet.gltf"];

#[derive(Parser)]
struct Arguments {
    /// As `skylit render` takes them; all of the above if none is named
    scenes: Vec<String>,
    /// Rays over all scenes together
    #[arg(long, default_value_t = 10_000_000)]
    rays: usize,
    /// Rays aimed at edges, over all closed bodies together
    #[arg(long, default_value_t = 10_000_000)]
    edge_rays: usize,
    /// Rays in memory at a time
    #[arg(long, default_value_t = 1_000_000, value_parser = piece)]
    piece: usize,
    /// Which rays: another number makes others
    #[arg(long, default_value_t = 1)]
    seed: u32,
    /// Also with the 32-bit loads of devices that lack shaderInt64
    #[arg(long)]
    without_int64: bool,
    /// Kernels, by their names for --traversal
    #[arg(long, value_delimiter = ',', default_value = "wide")]
    kernel: Vec<String>,
}

fn piece(text: &str) -> std::result::Result<usize, String> {
    text.parse().ok().filter(|&n| n > 0).ok_or_else(|| "expected a number above 0".to_owned())
}

/// What is judged: a device and a kernel on it.
struct Subject {
    name: String,
    device: Arc<Device>,
    kernel: Kernel,
}

/// One subject's answers over all scenes.
#[derive(Clone, Default)]
struct Tally {
    closest: ParityReport,
    any: ParityReport,
    weights: ParityReport,
    edge_rays: usize,
    leaks: usize,
}

impl Tally {
    fn faults(&self) -> u64 {
        self.closest.unexplained + self.any.unexplained + self.weights.unexplained + self.leaks as u64
    }
}

fn main() {
    match run(&Arguments::parse()) {
        Ok(0) => {}
        Ok(faults) => {
            eprintln!("parity_at_scale: {faults} faults");
            std::process::exit(1);
        }
        Err(e) => {
            eprintln!("parity_at_scale: {e}");
            std::process::exit(e.exit_code() as i32);
        }
    }
}

fn run(arguments: &Arguments) -> Result<u64> {
    let subjects = subjects(arguments)?;
    let info = &subjects[0].device.info;
    println!("{} ({}), subgroups of {}\n", info.name, info.driver, info.limits.subgroup_size);
    println!(
        "| scene | subject | rays | hits | ties | unexplained: nearest, any, weights |\n|---|---|---|---|---|---|"
    );
    let mut totals = vec![Tally::default(); subjects.len()];
    let names = scenes(arguments);
    for name in &names {
        for (subject, (total, tally)) in
            subjects.iter().zip(totals.iter_mut().zip(judge(name, arguments, &subjects, names.len())?))
        {
            row(name, subject, &tally);
            for report in [&tally.closest, &tally.any, &tally.weights].into_iter().filter(|r| r.unexplained > 0) {
                println!("\n{report}\n");
            }
            total.closest = std::mem::take(&mut total.closest).merge(tally.closest);
            total.any = std::mem::take(&mut total.any).merge(tally.any);
            total.weights = std::mem::take(&mut total.weights).merge(tally.weights);
        }
    }
    for (subject, total) in subjects.iter().zip(&totals) {
        row("**all**", subject, total);
    }
    let bodies = leak_scenes();
    println!("\n| closed body | subject | rays at edges | leaks: any, nearest |\n|---|---|---|---|");
    for (body, scene) in &bodies {
        let oracle = Oracle::new(scene, scene.origin());
        let rays = leak_rays(&oracle, arguments.edge_rays.div_ceil(bodies.len()), arguments.seed.wrapping_add(6));
        for (subject, total) in subjects.iter().zip(&mut totals) {
            let tracer = tracer(subject, &FlatScene::new(scene))?;
            let mut leaks = [0, 0];
            for (mode, leaks) in [Mode::Any, Mode::Closest].into_iter().zip(&mut leaks) {
                let hits = answers(&tracer, &rays, mode)?;
                *leaks = hits.iter().filter(|h| !h.is_hit()).count();
                for (ray, _) in rays.iter().zip(&hits).filter(|(_, h)| !h.is_hit()).take(4) {
                    println!("\n{mode:?}: {ray:?} leaks\n");
                }
            }
            println!("| {body} | {} | {} | {}, {} |", subject.name, rays.len(), leaks[0], leaks[1]);
            total.edge_rays += rays.len();
            total.leaks += leaks[0] + leaks[1];
        }
    }
    for (subject, total) in subjects.iter().zip(&totals) {
        println!("| **all** | {} | {} | {} together |", subject.name, total.edge_rays, total.leaks);
    }
    Ok(totals.iter().map(Tally::faults).sum())
}

fn subjects(arguments: &Arguments) -> Result<Vec<Subject>> {
    let mut out = Vec::new();
    for no_int64 in if arguments.without_int64 { vec![false, true] } else { vec![false] } {
        let device = Device::open(&Options { no_int64, ..Options::default() })?;
        for name in &arguments.kernel {
            let kernel = Kernel::ALL.into_iter().find(|k| k.name() == name).ok_or_else(|| {
                Error::Usage(format!("there is no kernel '{name}': {}", Kernel::ALL.map(Kernel::name).join(", ")))
            })?;
            let loads = if device.info.int64 { "64-bit loads" } else { "32-bit loads" };
            out.push(Subject { name: format!("{kernel}, {loads}"), device: device.clone(), kernel });
        }
    }
    Ok(out)
}

fn scenes(arguments: &Arguments) -> Vec<String> {
    if !arguments.scenes.is_empty() {
        return arguments.scenes.clone();
    }
    // as `skylit bench` looks for them
    let folder = std::env::var_os("SKYLIT_SHARED_SCENES").map_or_else(|| "../shared/scenes".into(), PathBuf::from);
    let shared =
        SHARED.iter().map(|s| folder.join(s)).filter(|p| p.is_file()).map(|p| p.to_string_lossy().into_owned());
    BUILTIN.iter().map(|s| (*s).to_owned()).chain(shared).collect()
}

fn judge(name: &str, arguments: &Arguments, subjects: &[Subject], scenes: usize) -> Result<Vec<Tally>> {
    let scene = load::load(name)?;
    let oracle = Oracle::new(&scene, scene.origin());
    let camera = camera::choose(&scene, &Choice::Auto, 1.0)?;
    let flat = FlatScene::new(&scene);
    let tracers = subjects.iter().map(|s| tracer(s, &flat)).collect::<Result<Vec<_>>>()?;
    let mut tallies = vec![Tally::default(); subjects.len()];
    let rounding = Rounding::default();
    let mut left = arguments.rays.div_ceil(scenes);
    let mut seed = arguments.seed;
    while left > 0 {
        let rays = mixed_rays(&oracle, &camera, left.min(arguments.piece), seed);
        let (truth, occluded) = (oracle.trace_closest(&rays), oracle.trace_any(&rays));
        for (tracer, tally) in tracers.iter().zip(&mut tallies) {
            let hits = answers(tracer, &rays, Mode::Closest)?;
            let any: Vec<bool> = answers(tracer, &rays, Mode::Any)?.iter().map(Hit::is_hit).collect();
            let add = |sum: &mut ParityReport, report| *sum = std::mem::take(sum).merge(report);
            add(&mut tally.closest, judge_closest(&oracle, &rays, &hits, &truth, rounding));
            add(&mut tally.any, judge_any(&oracle, &rays, &any, &occluded, rounding));
            add(&mut tally.weights, judge_weights(&oracle, &rays, &hits, rounding));
        }
        left = left.saturating_sub(rays.len());
        // a set takes three numbers
        seed = seed.wrapping_add(3);
    }
    Ok(tallies)
}

fn tracer(subject: &Subject, flat: &FlatScene) -> Result<Tracer> {
    let needs = Needs::default();
    Tracer::with_options(&subject.device, TracerKind::Compute, flat, needs, subject.kernel)
}

fn answers(tracer: &Tracer, rays: &[Ray], mode: Mode) -> Result<Vec<Hit>> {
    Ok(trace(tracer, rays, mode, 1, &mut NoControl)?.0)
}

fn row(scene: &str, subject: &Subject, tally: &Tally) {
    let scene = Path::new(scene).file_name().map_or(scene.into(), |n| n.to_string_lossy());
    println!(
        "| {scene} | {} | {} | {} | {} | {}, {}, {} |",
        subject.name,
        tally.closest.rays,
        tally.closest.hits,
        tally.closest.ties + tally.any.ties,
        tally.closest.unexplained,
        tally.any.unexplained,
        tally.weights.unexplained
    );
}
