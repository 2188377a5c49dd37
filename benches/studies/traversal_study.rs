//! The study of traversal orders and triangle tests that docs/notebook/2026-11-22-which-child-first.md reports: `scripts/traversal_study.sh` runs it.
//!
//!     cargo run --release --example traversal_study -- orders SCENE... [--eye X,Y,Z --target X,Y,Z] [--json]
//!     cargo run --release --example traversal_study -- tests SCENE...
//!     cargo run --release --example traversal_study -- leaks
//!
//! Every row is one line of a Markdown table; `--header` prints the head of the table instead. Variants take turns, round after
//! round, so that what else the machine does hits all of them alike; a rate is the median over the rounds.

use std::sync::Arc;

use clap::{Parser, ValueEnum};
use glam::DVec3;
use serde_json::{Value, json};
use skylit::accel::flatten::FlatScene;
use skylit::film::camera::{self, CameraRecord, Choice};
use skylit::film::{NoControl, SampleSettings};
use skylit::gpu::{Device, Options};
use skylit::integrators::ao::{self, AoOptions};
use skylit::integrators::rays::{Mode, trace};
use skylit::measure::ray_sets::leak_rays;
use skylit::measure::stats::median;
use skylit::oracle::Oracle;
use skylit::ray::Ray;
use skylit::scene::{builtin, load};
use skylit::tracer::{ComputeOptions, Kernel, Needs, Tracer, TracerKind, TriangleTest};
use skylit::{Error, Result};

/// Coello, "Real-time ray tracing in OpenGL compute" (2024): spheres, then frames per second without a hierarchy, with the
/// nearest child first and by the sign of the ray's direction (1920x1080, two bounces, RTX 2070 Max-Q).
const COELLO: [(usize, Option<f64>, f64, f64); 8] = [
    (100, Some(154.98), 562.98, 699.86),
    (200, Some(76.30), 398.26, 561.22),
    (500, Some(31.16), 386.76, 515.28),
    (1000, Some(14.42), 310.08, 410.76),
    (2000, None, 176.44, 378.40),
    (5000, None, 122.74, 284.54),
    (8000, None, 108.08, 259.44),
    (10000, None, 110.68, 264.68),
];

/// Tests of a ray against a primitive that a pass without a hierarchy may take: it gets fewer rays in larger scenes.
const BRUTE_TESTS: usize = 50_000_000;

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Study {
    /// Orders of traversal: camera rays and one bounce of diffuse rays, to their nearest hits; then occlusion rays, to any hit
    Orders,
    /// Triangle tests, watertight and not: rates
    Tests,
    /// Rays aimed at edges and corners of closed meshes that come through
    Leaks,
}

#[derive(Parser)]
struct Arguments {
    #[arg(value_enum)]
    study: Study,
    /// As `skylit render` takes them
    scenes: Vec<String>,
    #[arg(long, value_parser = vector, requires = "target", allow_hyphen_values = true)]
    eye: Option<DVec3>,
    #[arg(long, value_parser = vector, requires = "eye", allow_hyphen_values = true)]
    target: Option<DVec3>,
    /// Vertical field of view of --eye in degrees
    #[arg(long, default_value_t = 45.0)]
    fov_y: f64,
    /// Camera rays: width and height of the image
    #[arg(long, num_args = 2, default_values_t = [640, 360])]
    size: Vec<u32>,
    /// How often each variant has its turn
    #[arg(long, default_value_t = 5)]
    rounds: u32,
    /// Print the head of the table only
    #[arg(long)]
    header: bool,
    /// Print a JSON record per scene with all rates instead of a row
    #[arg(long)]
    json: bool,
}

fn vector(text: &str) -> std::result::Result<DVec3, String> {
    let parts: Option<Vec<f64>> =
        text.split(',').map(|p| p.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    parts
        .and_then(|p| <[f64; 3]>::try_from(p).ok())
        .map(DVec3::from)
        .ok_or_else(|| "expected three finite numbers X,Y,Z".into())
}

fn main() {
    let arguments = Arguments::parse();
    if arguments.header {
        println!("{}", header(arguments.study));
        return;
    }
    if let Err(e) = run(&arguments) {
        eprintln!("traversal_study: error: {e}");
        std::process::exit(e.exit_code().into());
    }
}

fn header(study: Study) -> &'static str {
    match study {
        Study::Orders => {
            "| scene | primitives | no tree | nearest | direction | wide | direction / nearest | no tree / nearest \
             | Coello: direction / nearest | Coello: no tree / nearest | any: nearest | any: direction | any: wide | any: direction / nearest |\n\
             |---|---|---|---|---|---|---|---|---|---|---|---|---|---|"
        }
        Study::Tests => {
            "| scene | triangles | kernel | stream | watertight | Moeller-Trumbore | cost of watertightness |\n|---|---|---|---|---|---|---|"
        }
        Study::Leaks => "| mesh | rays | kernel | watertight | Moeller-Trumbore |\n|---|---|---|---|---|",
    }
}

fn run(arguments: &Arguments) -> Result<()> {
    let device = Device::open(&Options::default())?;
    if arguments.study == Study::Leaks {
        return leaks(&device);
    }
    for name in &arguments.scenes {
        let scene = load::load(name)?;
        let flat = FlatScene::new(&scene);
        let streams = streams(&device, &flat, arguments)?;
        let label = std::path::Path::new(name).file_stem().map_or(name.as_str().into(), |s| s.to_string_lossy());
        match arguments.study {
            Study::Orders => orders(&device, &flat, &label, &streams, arguments)?,
            _ => tests(&device, &flat, &label, &streams, arguments)?,
        }
    }
    Ok(())
}

/// Rays of one kind and what is asked of them.
struct RayStream {
    name: &'static str,
    mode: Mode,
    rays: Vec<Ray>,
}

/// Camera rays and the cosine-distributed rays from what they meet: to the nearest hit (a diffuse bounce) and to any (ambient
/// occlusion).
fn streams(device: &Arc<Device>, flat: &FlatScene, arguments: &Arguments) -> Result<[RayStream; 3]> {
    let size = [arguments.size[0], arguments.size[1]];
    let aspect = f64::from(size[0]) / f64::from(size[1]);
    let choice = match (arguments.eye, arguments.target) {
        (Some(eye), Some(target)) => Choice::LookAt { eye, target, up: DVec3::Y, fov_y: arguments.fov_y.to_radians() },
        _ => Choice::Auto,
    };
    let camera = CameraRecord::new(&camera::choose(flat.scene, &choice, aspect)?, flat.origin, aspect);
    let tracer = Tracer::new(device, TracerKind::Compute, flat, Needs::default())?;
    let options = AoOptions {
        samples: SampleSettings { keep_rays: true, ..SampleSettings::new(size, 1, 0) },
        ..Default::default()
    };
    let kept = ao::render(&tracer, &camera, &options, &mut NoControl)?;
    let bounce: Vec<_> = kept.kept_occlusion.into_iter().filter(|r| r.tmax > r.tmin).collect();
    Ok([
        RayStream { name: "camera", mode: Mode::Closest, rays: kept.kept_primary },
        RayStream { name: "bounce", mode: Mode::Closest, rays: bounce.clone() },
        RayStream { name: "any", mode: Mode::Any, rays: bounce },
    ])
}

/// Median seconds per ray for each variant and stream, the variants taking turns.
fn measure(tracers: &[Tracer], streams: &[RayStream], limits: &[usize], rounds: u32) -> Result<Vec<Vec<f64>>> {
    let mut seconds = vec![vec![Vec::new(); streams.len()]; tracers.len()];
    for _ in 0..rounds.max(1) {
        for (s, stream) in streams.iter().enumerate() {
            for (k, tracer) in tracers.iter().enumerate() {
                // every so many-th, so that fewer rays see the same scene
                let step = stream.rays.len().div_ceil(limits[k]).max(1);
                let fewer: Vec<Ray>;
                let rays = match step {
                    1 => &stream.rays,
                    _ => {
                        fewer = stream.rays.chunks(64).step_by(step).flatten().copied().collect();
                        &fewer
                    }
                };
                if rays.is_empty() {
                    return Err(Error::Scene("the camera sees nothing: give --eye and --target".into()));
                }
                let (_, times) = trace(tracer, rays, stream.mode, 1, &mut NoControl)?;
                seconds[k][s].extend(times.device.iter().map(|t| t / rays.len() as f64));
            }
        }
    }
    Ok(seconds.into_iter().map(|v| v.iter().map(|s| median(s).unwrap_or(f64::NAN)).collect()).collect())
}

fn orders(
    device: &Arc<Device>,
    flat: &FlatScene,
    label: &str,
    streams: &[RayStream; 3],
    arguments: &Arguments,
) -> Result<()> {
    let primitives = flat.primitive_count();
    let mut kernels = vec![Kernel::Nearest, Kernel::Direction, Kernel::Wide];
    if Kernel::brute_tests(flat) <= Kernel::MAX_BRUTE_TESTS {
        kernels.push(Kernel::Brute);
    }
    let tracers = kernels
        .iter()
        .map(|&k| Tracer::with_options(device, TracerKind::Compute, flat, Needs::default(), k))
        .collect::<Result<Vec<_>>>()?;
    let limits: Vec<_> = kernels
        .iter()
        .map(|&k| if k == Kernel::Brute { (BRUTE_TESTS / primitives.max(1)).max(4096) } else { usize::MAX })
        .collect();
    let seconds = measure(&tracers, streams, &limits, arguments.rounds)?;
    let rays = streams.each_ref().map(|s| s.rays.len() as f64);
    // a frame: the camera rays and their bounce
    let frame = |k: usize| (rays[0] + rays[1]) / (rays[0] * seconds[k][0] + rays[1] * seconds[k][1]) / 1e6;
    let any = |k: usize| 1e-6 / seconds[k][2];
    if arguments.json {
        let rates: serde_json::Map<String, Value> = kernels
            .iter()
            .zip(&seconds)
            .map(|(k, s)| {
                let streams: serde_json::Map<String, Value> =
                    streams.iter().zip(s).map(|(stream, s)| (stream.name.to_owned(), json!(1e-6 / s))).collect();
                (k.name().to_owned(), json!(streams))
            })
            .collect();
        let counts = json!({ "camera": rays[0], "bounce": rays[1], "any": rays[2] });
        println!("{}", json!({ "scene": label, "primitives": primitives, "rays": counts, "mrays_s": rates }));
        return Ok(());
    }
    let brute = (kernels.len() > 3).then(|| frame(3));
    let dash = || "-".to_owned();
    let theirs = label.strip_prefix("builtin:spheres:").and_then(|n| COELLO.iter().find(|c| n.parse() == Ok(c.0)));
    println!(
        "| {} | {primitives} | {} | {:.2} | {:.2} | {:.2} | {:.2} | {} | {} | {} | {:.2} | {:.2} | {:.2} | {:.2} |",
        label.trim_start_matches("builtin:"),
        brute.map_or_else(dash, |b| format!("{b:.3}")),
        frame(0),
        frame(1),
        frame(2),
        frame(1) / frame(0),
        brute.map_or_else(dash, |b| format!("{:.4}", b / frame(0))),
        theirs.map_or_else(dash, |t| format!("{:.2}", t.3 / t.2)),
        theirs.and_then(|t| t.1.map(|none| none / t.2)).map_or_else(dash, |r| format!("{r:.3}")),
        any(0),
        any(1),
        any(2),
        any(1) / any(0),
    );
    Ok(())
}

/// Both triangle tests.
const TESTS: [TriangleTest; 2] = [TriangleTest::Watertight, TriangleTest::MollerTrumbore];

fn tests(
    device: &Arc<Device>,
    flat: &FlatScene,
    label: &str,
    streams: &[RayStream; 3],
    arguments: &Arguments,
) -> Result<()> {
    let variants: Vec<_> = [Kernel::Wide, Kernel::Nearest]
        .into_iter()
        .flat_map(|kernel| TESTS.map(|triangle_test| ComputeOptions { kernel, triangle_test }))
        .collect();
    let tracers = variants
        .iter()
        .map(|&v| Tracer::with_options(device, TracerKind::Compute, flat, Needs::default(), v))
        .collect::<Result<Vec<_>>>()?;
    let seconds = measure(&tracers, streams, &[usize::MAX; 4], arguments.rounds)?;
    for pair in [0, 2] {
        for (s, stream) in streams.iter().enumerate() {
            let rates = [seconds[pair][s], seconds[pair + 1][s]].map(|t| 1e-6 / t);
            let kernel = variants[pair].kernel;
            if arguments.json {
                let record = json!({ "scene": label, "kernel": kernel, "stream": stream.name, "mrays_s": {
                    "watertight": rates[0], "moller-trumbore": rates[1] } });
                println!("{record}");
                continue;
            }
            println!(
                "| {} | {} | {kernel} | {} | {:.2} | {:.2} | {:.1} % |",
                label.trim_start_matches("builtin:"),
                flat.primitive_count(),
                stream.name,
                rates[0],
                rates[1],
                100.0 * (1.0 - rates[0] / rates[1]),
            );
        }
    }
    Ok(())
}

fn leaks(device: &Arc<Device>) -> Result<()> {
    let cube = builtin::analytic::closed_box(1.0, builtin::SceneTransform { scale: 1.0, offset: DVec3::ZERO });
    let sphere = |levels| {
        let mut scene = cube.clone();
        scene.meshes[0].geometry = builtin::shapes::icosphere(1.0, levels);
        scene
    };
    for (name, scene) in [("cube", cube.clone()), ("icosphere, 20480", sphere(5)), ("icosphere, 327680", sphere(7))] {
        let oracle = Oracle::new(&scene, scene.origin());
        let rays = leak_rays(&oracle, 1_000_000, 7);
        let flat = FlatScene::new(&scene);
        for kernel in [Kernel::Wide, Kernel::Nearest] {
            let mut counts = [0; 2];
            for (count, triangle_test) in counts.iter_mut().zip(TESTS) {
                let options = ComputeOptions { kernel, triangle_test };
                let tracer = Tracer::with_options(device, TracerKind::Compute, &flat, Needs::default(), options)?;
                let (hits, _) = trace(&tracer, &rays, Mode::Closest, 1, &mut NoControl)?;
                *count = hits.iter().filter(|h| !h.is_hit()).count();
            }
            println!("| {name} | {} | {kernel} | {} | {} |", rays.len(), counts[0], counts[1]);
        }
    }
    Ok(())
}
