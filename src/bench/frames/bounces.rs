//! Time of frames at 1 to 4 bounces in the scenes of Coello (2024), one unfiltered path per pixel.

use super::args::FramesSession;
use super::candidates::Candidate;
use super::frame_log::{FrameLog, first_timed};
use super::larsen::OURS;
use super::scenes::{CameraView, FramesScene};
use super::stage::SceneStage;
use crate::accel::flatten::FlatScene;
use crate::bench::record::{plain, quantity};
use crate::error::Result;
use crate::film::camera::{self, Choice};
use crate::realtime::Settings;
use crate::report::thousands;
use crate::scene::{Environment, load};

/// A scene and the published frames per second at 1, 2, ... bounces: 1920x1080 pixels, GeForce RTX
/// 2070 Max-Q, nodes in the order of the ray's signs.
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
const QUICK: usize = 2;
const FRAMES: u32 = 24;

pub fn measure(session: &mut FramesSession) -> Result<()> {
    let args = session.args;
    let name = args.presets.first().map_or(OURS, String::as_str);
    let Some(candidate) = Candidate::find(name) else { return Ok(()) };
    let scenes = if args.common.quick { &SCENES[..QUICK] } else { &SCENES };
    for (k, scene) in scenes.iter().enumerate() {
        session.advance(k as f64 / scenes.len() as f64);
        if !session.has_time_for(format!("bounces: {}", scene.source)) {
            continue;
        }
        measure_scene(session, scene, candidate)?;
        session.show_scene(scene.source)?;
    }
    Ok(())
}

fn measure_scene(session: &mut FramesSession, published: &PublishedScene, candidate: &Candidate) -> Result<()> {
    let args = session.args;
    let mut scene = load::load(published.source)?;
    // one white light around everything
    scene.environment = Environment::Uniform(glam::Vec3::ONE);
    let camera = camera::choose(&scene, &Choice::Auto, args.aspect())?;
    let name = published.source.to_owned();
    let view = CameraView { name: name.clone(), middle: camera.camera_to_world.translation, camera };
    let light = "white".into();
    let loaded = FramesScene { name, scene, views: vec![view], light, reach: f64::INFINITY, mover: None };
    let flat = FlatScene::for_paths(&loaded.scene);
    for (bounces, fps) in (1..).zip(published.fps) {
        let stage = SceneStage::new(session, (&loaded, &loaded.views[0]), &flat, args.size(), Some(bounces), None)?;
        // frames at rest take as many paths as those in motion
        let settings = Settings { converge: false, ..stage.settings(candidate)? };
        let mut realtime = stage.realtime_with(candidate, settings)?;
        let mut log = FrameLog::default();
        let camera = stage.still_camera();
        for _ in 0..FRAMES {
            log.render_frame(&mut realtime, &stage.tracer, &camera, &[])?;
        }
        let cost = log.cost(first_timed(FRAMES));
        let mut row = session.record.row(published.source, "bounces", candidate.name);
        let mut at = row.at("bounces", f64::from(bounces));
        at.repeated(quantity::FRAME_TIME, cost.time()).exact(quantity::RAYS, cost.rays);
        at.exact(plain("plain time", "ms"), stage.plain_time.per_image + stage.plain_time.per_path);
        at.exact(plain("Coello (2024), 1920x1080", "ms"), fps.map(|fps: f64| 1e3 / fps));
    }
    session.record.scene(published.source).about = format!("{} primitives", thousands(loaded.primitives()));
    Ok(())
}
