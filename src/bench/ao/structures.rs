//! How long acceleration structures take to be brought up to date: the top level when everything moves, a mesh when it deforms, by
//! refitting and by building anew.

use glam::{DAffine3, Vec3};

use super::session::AoSession;
use super::table;
use crate::accel::flatten::FlatScene;
use crate::bench::record::ao::StructureRecord;
use crate::error::{Error, Result};
use crate::measure::stats::Percentiles;
use crate::scene::{Geometry, Motion, load};
use crate::terminal::interrupt;
use crate::tracer::{Changes, MeshChange, Tracer};

/// 15 meshes as in the reference work, and one that is as large as the mean of its: 25.2 M triangles by 15.
const SCENES: [&str; 2] = ["builtin:instances:25000000", "builtin:terrain:1680000"];
/// With `--quick`.
const QUICK: [&str; 2] = ["builtin:instances:25000", "builtin:terrain:1680"];
/// Radians that every instance turns in an update.
const TURN: f64 = 0.01;
/// How far vertices go, by the diagonal of their mesh.
const WAY: f32 = 1e-3;
/// The mesh that deforms.
const MESH: usize = 0;

/// All scenes.
pub fn measure(session: &mut AoSession) -> Result<()> {
    let first = session.record.structures.len();
    let sources = if session.args.common.quick { QUICK } else { SCENES };
    for (k, source) in sources.into_iter().enumerate() {
        if session.is_over() {
            session.leave_out(&format!("structures of {source}"));
            continue;
        }
        session.advance(k as f64 / sources.len() as f64);
        let record = one(session, source)?;
        session.record.structures.push(record);
    }
    session.show(&table::structures(&session.record.structures[first..]))
}

fn one(session: &mut AoSession, source: &str) -> Result<StructureRecord> {
    session.phase(format!("structures of {source}: loading"));
    let scene = load::load(source)?;
    let motion = Motion { instances: (0..scene.instances.len()).collect(), meshes: vec![MESH] };
    let flat = FlatScene::with_motion(&scene, motion)?;
    let mut tracer = session.tracer(&format!("structures of {source}"), &flat)?;
    let Some(Geometry::Triangles(mesh)) = scene.meshes.get(MESH).map(|m| &m.geometry) else {
        return Err(Error::Scene(format!("{source}: its first mesh has no triangles to deform")));
    };
    let mut record = StructureRecord {
        scene: source.to_owned(),
        primitives: scene.triangle_count() + scene.sphere_count(),
        stored: flat.primitive_count() as u64,
        meshes: scene.meshes.len(),
        instances: scene.instances.len(),
        build_ms: 1e3 * tracer.stats().build_seconds,
        upload_ms: 1e3 * tracer.stats().upload_seconds,
        mesh_triangles: mesh.indices.len() as u64,
        ..Default::default()
    };
    let repeats = session.args.repeats();
    session.phase(format!("structures of {source}: updating"));
    let mut tops = Vec::new();
    for round in 0..=repeats {
        interrupt::check()?;
        let turn = DAffine3::from_rotation_y(TURN * f64::from(round + 1));
        let instances = scene.instances.iter().enumerate().map(|(i, x)| (i, x.object_to_world * turn)).collect();
        let stats = tracer.update(&Changes { instances, ..Default::default() })?;
        record.top_rebuilt = stats.top_rebuilt;
        // the first finds its memory
        if round > 0 {
            tops.push(1e3 * stats.top_seconds);
        }
    }
    record.top = Percentiles::from_values(&tops);
    let poses = poses(&mesh.positions);
    let [refits, rebuilds] = [false, true].map(|rebuild| deform(&mut tracer, &poses, repeats, rebuild));
    let [refits, rebuilds] = [refits?, rebuilds?];
    if rebuilds.is_empty() {
        session.note(format!("{source}: the tracer refits its mesh whatever that costs; building it anew was not timed"));
    }
    (record.refit, record.rebuild) = (Percentiles::from_values(&refits), Percentiles::from_values(&rebuilds));
    Ok(record)
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
