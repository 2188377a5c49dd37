//! Time of frames at 1 to 4 bounces, in the scenes of Coello (2024), whose frames are of one path per pixel, without any filter: beside plain accumulation.

use super::FramesSession;
use super::scenes::FramesScene;
use super::stage::Stage;
use super::table;
use crate::accel::flatten::FlatScene;
use crate::bench::frame_log::{FrameLog, first_timed};
use crate::bench::record::frames::{BouncePoint, BouncesRecord};
use crate::error::Result;
use crate::film::camera::{self, Choice};
use crate::realtime::Preset;
use crate::scene::{Environment, load};

/// A scene, and frames per second of that work at 1, 2, ... bounces: 1920x1080 pixels on a GeForce RTX 2070 Max-Q, children of nodes in the order of the ray's signs.
struct PublishedScene {
    source: &'static str,
    fps: [Option<f64>; 4],
}

const fn published(source: &'static str, fps: [f64; 4]) -> PublishedScene {
    let [a, b, c, d] = fps;
    PublishedScene { source, fps: [Some(a), Some(b), Some(c), Some(d)] }
}

/// With two bounces alone.
const fn spheres(source: &'static str, fps: f64) -> PublishedScene {
    PublishedScene { source, fps: [None, Some(fps), None, None] }
}

const SCENES: [PublishedScene; 5] = [
    published("builtin:coello:1", [549.82, 435.06, 356.46, 298.95]),
    published("builtin:coello:2", [309.67, 212.26, 159.02, 130.58]),
    published("builtin:coello:3", [323.80, 226.82, 171.24, 137.30]),
    spheres("builtin:spheres:1000", 410.76),
    spheres("builtin:spheres:10000", 264.68),
];
/// With `--quick`.
const QUICK: usize = 2;
/// Frames of a run.
const FRAMES: u32 = 24;

/// Measures all of them.
///
/// # Errors
/// Those of the device; Ctrl-C.
pub fn measure(session: &mut FramesSession) -> Result<()> {
    let args = session.args;
    let preset = args.presets.first().copied().unwrap_or(Preset::Balanced);
    let scenes = if args.common.quick { &SCENES[..QUICK] } else { &SCENES };
    for (k, scene) in scenes.iter().enumerate() {
        session.advance(k as f64 / scenes.len() as f64);
        if session.is_over() {
            session.leave_out(&format!("bounces: {}", scene.source));
            continue;
        }
        session.phase(format!("bounces: {}", scene.source));
        let record = one(session, scene, preset)?;
        session.record.bounces.push(record);
    }
    session.show(&table::bounces(&session.record.bounces))
}

fn one(session: &FramesSession, published: &PublishedScene, preset: Preset) -> Result<BouncesRecord> {
    let args = session.args;
    let mut scene = load::load(published.source)?;
    // one white light around everything
    scene.environment = Environment::Uniform(glam::Vec3::ONE);
    let camera = camera::choose(&scene, &Choice::Auto, args.aspect())?;
    let loaded = FramesScene {
        name: published.source.to_owned(),
        middle: camera.camera_to_world.translation,
        camera,
        scene,
        light: "white".into(),
        reach: f64::INFINITY,
    };
    let flat = FlatScene::for_paths(&loaded.scene);
    let mut points = Vec::new();
    for (bounces, fps) in (1..).zip(published.fps) {
        let stage = Stage::new(session, &loaded, &flat, Some(bounces), None)?;
        let mut realtime = stage.realtime_as_in_motion(preset)?;
        let mut log = FrameLog::default();
        let camera = stage.still_camera();
        for _ in 0..FRAMES {
            log.frame(&mut realtime, &stage.tracer, &camera, &[])?;
        }
        let cost = log.cost(first_timed(FRAMES));
        points.push(BouncePoint {
            bounces,
            cost,
            plain_ms: stage.plain_time.per_image + stage.plain_time.per_path,
            coello_fps: fps,
        });
    }
    let primitives = loaded.scene.triangle_count() + loaded.scene.sphere_count();
    Ok(BouncesRecord { scene: loaded.name, primitives, preset: preset.to_string(), points })
}
