//! What camera rays cost, drawn and traced: time of the auxiliary outputs' pass on each of some scenes, the two by turns, medians of
//! the time from recording to the end of the work.
//!
//! Where the device cannot draw, traced alone. A CPU driver of Mesa draws with vectors of 256 bits at most; what traced rays cost with
//! wider ones is shown with `LP_NATIVE_VECTOR_WIDTH=512` and a `MESA_SHADER_CACHE_DIR` of its own.
//!
//!     cargo run --release --example primary -- [--repeats N] [SCENE[@EX,EY,EZ,TX,TY,TZ,FOV]...]

use skylit::shaders;
use std::time::Instant;

use glam::DVec3;
use skylit::accel::flatten::FlatScene;
use skylit::film::block::{Block, PassParams};
use skylit::film::camera::{CameraRecord, Choice, choose};
use skylit::gpu::{Buffer, Commands, Device, Memory, Options};
use skylit::integrators::aov::AovParams;
use skylit::raster::{Raster, View};
use skylit::scene::{Scene, builtin, load};
use skylit::tracer::stream::LAUNCH_RAYS;
use skylit::tracer::{Needs, Push, Tracer, TracerKind};

const SCENES: [&str; 6] = ["cornell-box", "stairs", "grid:6", "leaf-cards", "terrain:100000", "terrain:1000000"];
const SIZES: [[u32; 2]; 2] = [[640, 360], [1280, 720]];

fn main() -> skylit::Result<()> {
    let (mut repeats, mut scenes) = (9, Vec::new());
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--repeats" => repeats = args.next().and_then(|n| n.parse().ok()).unwrap_or(repeats).max(1),
            _ => scenes.push(arg),
        }
    }
    if scenes.is_empty() {
        scenes = SCENES.map(str::to_owned).to_vec();
    }
    let device = Device::open(&Options::default())?;
    println!(
        "{} ({}), medians of {repeats}, milliseconds from recording to the end",
        device.info.name, device.info.driver
    );
    println!(
        "{:28} {:>10} {:>9} {:>9} {:>9} {:>9} {:>12} {:>6}",
        "scene", "image", "traced", "drawn", "its draw", "its hits", "primitives", "draws"
    );
    for given in &scenes {
        let (name, camera) = given.split_once('@').map_or((given.as_str(), None), |(n, c)| (n, Some(c)));
        let scene = open(name)?;
        let choice = match camera.map(|c| c.split(',').filter_map(|x| x.parse().ok()).collect::<Vec<f64>>()).as_deref()
        {
            Some(&[a, b, c, d, e, f, fov]) => Choice::LookAt {
                eye: DVec3::new(a, b, c),
                target: DVec3::new(d, e, f),
                up: DVec3::Y,
                fov_y: fov.to_radians(),
            },
            _ => Choice::Auto,
        };
        let flat = FlatScene::new(&scene);
        let tracer = Tracer::new(&device, TracerKind::Compute, &flat, Needs { normals: true, ..Needs::default() })?;
        for size in SIZES {
            measure(&tracer, &scene, name, &choice, size, repeats)?;
        }
    }
    Ok(())
}

fn open(name: &str) -> skylit::Result<Scene> {
    match builtin::by_name(name) {
        Some(scene) => Ok(scene),
        None => load::load(name),
    }
}

fn measure(
    tracer: &Tracer,
    scene: &Scene,
    name: &str,
    choice: &Choice,
    size: [u32; 2],
    repeats: usize,
) -> skylit::Result<()> {
    let device = tracer.device();
    let aspect = size[0] as f64 / size[1] as f64;
    let camera = CameraRecord::new(&choose(scene, choice, aspect)?, scene.origin(), aspect);
    let block = Block::cut(size)[0];
    let count = block.rays();
    let target = Buffer::new(device, "outputs", 64 * count as u64, Memory::Device)?;
    let mut params = PassParams::new(device, "parameters of outputs")?;
    params.write(&block.params(size, &camera, 0), &AovParams { pixels: target.address() })?;
    let push = Push { scene: tracer.scene_address(), pass: params.address(), count, ..Default::default() };
    let stream = tracer.stream(&shaders::AOV_CLOSEST)?;
    let raster = device.info.can_rasterise().then(|| Raster::new(tracer, &shaders::AOV_CLOSEST, size)).transpose()?;
    let view = View { camera, image_size: size, block, at: [0.5; 2] };
    let mut commands = Commands::new(device)?;
    // traced, drawn, and of the latter the drawing and the hits
    let mut times: [Vec<f64>; 4] = Default::default();
    let mut drawn = Ok(Default::default());
    for _ in 0..=repeats {
        let start = Instant::now();
        commands.run(|r| {
            for first in (0..count).step_by(LAUNCH_RAYS as usize) {
                stream.record(r, &Push { first, count: LAUNCH_RAYS.min(count - first), ..push });
            }
        })?;
        times[0].push(start.elapsed().as_secs_f64());
        let Some(raster) = &raster else { continue };
        let start = Instant::now();
        let timings = commands.run(|r| drawn = raster.record(r, tracer, &push, &view))?;
        times[1].push(start.elapsed().as_secs_f64());
        for (k, t) in timings.iter().enumerate().take(2) {
            times[2 + k].push(t.seconds);
        }
    }
    let drawn = drawn?;
    // the first is to warm up
    let [traced, both, draw, hits] = times.map(|t| 1e3 * median(t.get(1..).unwrap_or_default()));
    println!(
        "{:28} {:>10} {traced:9.2} {both:9.2} {draw:9.2} {hits:9.2} {:>12} {:>6}",
        name.rsplit('/').next().unwrap_or(name),
        format!("{}x{}", size[0], size[1]),
        format!("{:.0}k/{:.0}k", drawn.primitives as f64 / 1e3, drawn.placed as f64 / 1e3),
        drawn.draws
    );
    Ok(())
}

fn median(times: &[f64]) -> f64 {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}
