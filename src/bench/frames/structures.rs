//! Time to update acceleration structures: moving instances, a mesh refitted and rebuilt.

use glam::{DAffine3, Vec3};

use super::args::FramesSession;
use crate::accel::flatten::FlatScene;
use crate::bench::record::{plain, quantity};
use crate::error::{Error, Result};
use crate::measure::stats::Percentiles;
use crate::report::thousands;
use crate::scene::{Geometry, Motion, load};
use crate::terminal::interrupt;
use crate::tracer::{Changes, ComputeOptions, MeshChange, Needs, Tracer};

/// 15 meshes as in Larsen's work, and one of their mean size: 25.2 M triangles by 15.
const SCENES: [&str; 2] = ["builtin:instances:25000000", "builtin:terrain:1680000"];
const QUICK: [&str; 2] = ["builtin:instances:25000", "builtin:terrain:1680"];
/// Radians that every instance turns in an update.
const TURN: f64 = 0.01;
/// How far vertices go, by the diagonal of their mesh.
const WAY: f32 = 1e-3;
const PART: &str = "structures";
/// Top levels of Larsen (2019), by million triangles and meshes, on a GPU that he does not name;
/// and the rest of what he says about structures.
const LARSENS: &str = "Larsen: top level, ms: 4.9 M in 4 meshes 0.157, 6.7 M in 5 0.160, 8.6 M in 6 0.160, 25.2 M in 15 0.180; first build of 25.2 M 230 ms; updating a mesh was guessed at 100 to 200 ms, not measured";
const MESH: usize = 0;

pub fn measure(session: &mut FramesSession) -> Result<()> {
    let sources = if session.args.common.quick { QUICK } else { SCENES };
    for (k, source) in sources.into_iter().enumerate() {
        if !session.has_time_for(format!("structures of {source}")) {
            continue;
        }
        session.advance(k as f64 / sources.len() as f64);
        measure_scene(session, source)?;
        session.show_scene(source)?;
    }
    Ok(())
}

fn measure_scene(session: &mut FramesSession, source: &str) -> Result<()> {
    // the scene, whose instances and first mesh move
    session.phase(format!("structures of {source}: building"));
    let scene = load::load(source)?;
    let motion = Motion { instances: (0..scene.instances.len()).collect(), meshes: vec![MESH], ..Motion::default() };
    let flat = FlatScene::with_motion(&scene, motion)?;
    let build = session.args.build_options(session.args.size());
    let (kind, _) = session.args.tracer.on(&session.device.info);
    let (needs, options) = (Needs::default(), ComputeOptions::default());
    let mut tracer = Tracer::with_build(&session.device, kind, &flat, needs, options, &build)?;
    let Some(Geometry::Triangles(mesh)) = scene.meshes.get(MESH).map(|m| &m.geometry) else {
        return Err(Error::Scene(format!("{source}: its first mesh has no triangles to deform")));
    };

    // the top level, all of whose instances turn; the first update finds its memory
    let repeats = session.args.repeats();
    session.phase(format!("structures of {source}: updating"));
    let (mut tops, mut is_rebuilt) = (Vec::new(), false);
    for round in 0..=repeats {
        interrupt::check()?;
        let turn = DAffine3::from_rotation_y(TURN * f64::from(round + 1));
        let instances = scene.instances.iter().enumerate().map(|(i, x)| (i, x.object_to_world * turn)).collect();
        let stats = tracer.update(&Changes { instances, ..Default::default() })?;
        is_rebuilt = stats.top_rebuilt;
        tops.extend((round > 0).then_some(1e3 * stats.top_seconds));
    }

    // the mesh that deforms
    let poses = poses(&mesh.positions);
    let [refits, rebuilds] = [false, true].map(|rebuild| deform(&mut tracer, &poses, repeats, rebuild));
    let [refits, rebuilds] = [refits?, rebuilds?];
    if rebuilds.is_empty() {
        session
            .note(format!("{source}: the tracer refits its mesh whatever that costs; building it anew was not timed"));
    }

    // all of it into the record
    let (build_seconds, upload_seconds) = (tracer.stats().build_seconds, tracer.stats().upload_seconds);
    let mut row = session.record.row(source, PART, "first build");
    row.exact(plain("time", "ms"), 1e3 * build_seconds).exact(plain("upload", "ms"), 1e3 * upload_seconds);
    let top = if is_rebuilt { "top level, built" } else { "top level, refitted" };
    for (name, times) in [(top, &tops), ("mesh, refitted", &refits), ("mesh, built", &rebuilds)] {
        session.record.row(source, PART, name).repeated(quantity::UPDATE_TIME, Percentiles::from_values(times));
    }
    let described = session.record.scene(source);
    described.about = format!(
        "{} triangles and spheres in {} instances, {} stored in {} meshes; the mesh that deforms has {} triangles",
        thousands(scene.triangle_count() + scene.sphere_count()),
        thousands(scene.instances.len() as u64),
        thousands(flat.primitive_count() as u64),
        thousands(scene.meshes.len() as u64),
        thousands(mesh.indices.len() as u64)
    );
    described.remarks.push(LARSENS.to_owned());
    Ok(())
}

/// Two shapes of a mesh, a little apart.
fn poses(positions: &[Vec3]) -> [Vec<Vec3>; 2] {
    let fold = |f: fn(Vec3, Vec3) -> Vec3| positions.iter().copied().reduce(f).unwrap_or_default();
    let size = (fold(Vec3::max) - fold(Vec3::min)).length();
    [0.0f32, 1.0].map(|phase| {
        let wave = |p: &Vec3| *p + Vec3::Y * (WAY * size * (p.x * 20.0 / size.max(f32::MIN_POSITIVE) + phase).sin());
        positions.iter().map(wave).collect()
    })
}

/// Milliseconds of each update that did what was asked: refitted the mesh, or built it anew.
fn deform(tracer: &mut Tracer, poses: &[Vec<Vec3>; 2], repeats: u32, rebuild: bool) -> Result<Vec<f64>> {
    let mut times = Vec::new();
    for round in 0..=repeats {
        interrupt::check()?;
        if rebuild {
            // tracing is said to have become so slow that anything pays
            tracer.traced(1e-6);
            tracer.traced(1e9);
        }
        let positions = &poses[round as usize % 2];
        let change = MeshChange { mesh: MESH, positions, normals: None };
        let stats = tracer.update(&Changes { meshes: vec![change], ..Default::default() })?;
        if round > 0 && rebuild == stats.rebuilt.contains(&MESH) {
            times.push(1e3 * stats.mesh_seconds);
        }
    }
    Ok(times)
}
