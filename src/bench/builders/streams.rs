//! Rays of images in trees by all builders: visits on the host, rates of the binary kernel.

use std::time::Instant;

use glam::{DAffine3, DMat3, DVec3};

use super::BuilderSession;
use crate::accel::BuildPreset;
use crate::accel::flatten::FlatScene;
use crate::accel::lab::analysis::analyse;
use crate::accel::lab::budget::Whole;
use crate::accel::lab::builder::MAX_LEAF;
use crate::accel::lab::cells::{CellKind, Cells};
use crate::accel::lab::influence::{InfluenceArea, areas_of_rays, distribution_of};
use crate::accel::lab::local::{FallbackStart, LocalTrees, TopLevelKind};
use crate::accel::lab::projection::frame;
use crate::accel::lab::streams::{RayStream, corners, image_streams};
use crate::accel::lab::{Body, Builder, HeuristicChoice, Hierarchy, LabRay, Query, RayDistribution, Visits};
use crate::bench::rays::scenes::load;
use crate::bench::record::{plain, quantity};
use crate::error::{Error, Result};
use crate::integrators::rays::{Mode, PreparedRays};
use crate::measure::stats::Percentiles;
use crate::ray::Ray;
use crate::report::thousands;
use crate::scene::Scene;
use crate::terminal::interrupt::{self, SilentControl};
use crate::tracer::{BuildOptions, Kernel, LocalOptions, Needs, Tracer, TracerKind};

/// Rules by which trees of influence areas are built.
const LOCAL_RULES: [HeuristicChoice; 3] = [HeuristicChoice::Sah, HeuristicChoice::Pah, HeuristicChoice::PahSpfh];

/// A tree to measure: its name, its builder, and whether the scene is turned so that the rays lie
/// along an axis.
struct Contestant {
    name: String,
    builder: Builder,
    is_turned: bool,
}

/// All builders that take part for rays of a distribution.
fn contestants(rays: Option<&RayDistribution>) -> Vec<Contestant> {
    let mut out = Vec::new();
    let mut add = |name: &str, builder, is_turned| out.push(Contestant { name: name.to_owned(), builder, is_turned });
    for (name, preset) in [("fast", BuildPreset::Fast), ("default", BuildPreset::Default), ("best", BuildPreset::Best)]
    {
        add(name, Builder::Preset(preset), false);
    }
    for choice in HeuristicChoice::ALL.into_iter().filter(|c| rays.is_some() || !c.needs_rays()) {
        add(choice.name(), Builder::Heuristic(choice.heuristic(rays.copied().unwrap_or_default())), false);
    }
    if let Some(RayDistribution::Parallel(_)) = rays {
        // in the frame of the rays
        let along_z = RayDistribution::Parallel(DVec3::Z);
        for choice in [HeuristicChoice::Sah, HeuristicChoice::SahSpfh, HeuristicChoice::PahSpfh] {
            add(&format!("{}, turned", choice.name()), Builder::Heuristic(choice.heuristic(along_z)), true);
        }
        add("default, turned", Builder::Preset(BuildPreset::Default), true);
    }
    out
}

/// Measures the rays of a scene's image.
pub fn scene(session: &mut BuilderSession, source: &str) -> Result<()> {
    // the scene, and the rays of its image
    session.phase(format!("{source}: loading"));
    let size = session.args.size();
    let loaded = load(source, false, None, f64::from(size[0]) / f64::from(size[1]))?;
    let mut scene = loaded.scene;
    session.note_warnings(source, &scene);
    add_lamp(&mut scene, loaded.light);
    let flat = FlatScene::new(&scene);
    let first = Hierarchy::build(&flat, &Builder::Preset(BuildPreset::Default));
    let streams = image_streams(&first, &scene, &loaded.camera, flat.origin, size, loaded.ao_radius);
    let bounds = corners(&scene, flat.origin).ok_or_else(|| Error::Scene(format!("{source}: has no surfaces")))?;
    // structures that divide space are of one level
    let body = first.groups.into_iter().next().filter(|_| first.top.is_none()).map(|(_, body)| body);
    let cells = body.as_ref().map_or_else(Vec::new, divided);
    session.record.scene(source).about =
        format!("{} primitives, {} instances", thousands(flat.primitive_count() as u64), scene.instances.len());

    // stream by stream, all builders
    for (k, stream) in streams.iter().enumerate() {
        // the rays' distribution is found, not told
        let areas = areas_of_rays(&stream.name, &stream.rays, &bounds);
        let distribution = distribution_of(&areas);
        let turned = match distribution {
            Some(RayDistribution::Parallel(d)) => Some(turned(&scene, d)),
            _ => None,
        };
        for contestant in contestants(distribution.as_ref()) {
            session.phase(format!("{source}: {}, {}", stream.name, contestant.name));
            match (&turned, contestant.is_turned) {
                (Some((turned, by)), true) => {
                    let flat_turned = FlatScene::new(turned);
                    let rays = stream.rays.iter().map(|r| turn(r, by, flat.origin, flat_turned.origin)).collect();
                    let stream = RayStream { rays, ..stream.clone() };
                    run(
                        session,
                        source,
                        &flat_turned,
                        &stream,
                        &contestant,
                        Some(&RayDistribution::Parallel(DVec3::Z)),
                    )?;
                }
                _ => run(session, source, &flat, stream, &contestant, distribution.as_ref())?,
            }
            interrupt::check()?;
        }
        if !areas.is_empty() {
            // the tree of the whole, which all local ones are beside
            let placed = Body::from_scene(&flat)?;
            let whole = Builder::Preset(BuildPreset::Default).tree(&placed.boxes(), MAX_LEAF);
            let whole = Whole { body: &placed, tree: &whole };
            for choice in LOCAL_RULES {
                session.phase(format!("{source}: {}, trees of areas by {}", stream.name, choice.name()));
                run_local(session, source, (&flat, &whole), stream, choice, &areas)?;
                interrupt::check()?;
            }
        }
        for (kind, cells, seconds) in &cells {
            count_cells(session, source, stream, *kind, cells, *seconds);
        }
        session.advance((k + 1) as f64 / streams.len() as f64);
        if session.is_over() {
            session.stop_early();
            break;
        }
    }
    Ok(())
}

/// Gives a scene the point light of its shadow rays, if it has none.
fn add_lamp(scene: &mut Scene, position: DVec3) {
    use crate::scene::{Light, LightKind};
    if scene.lights.iter().all(|l| matches!(l.kind, LightKind::Directional { .. })) {
        let (kind, intensity) = (LightKind::Point, glam::Vec3::ONE);
        let name = "lamp".to_owned();
        scene.lights.push(Light { name, kind, intensity, position, direction: DVec3::NEG_Y, range: f64::INFINITY });
    }
}

/// The scene turned so that a direction becomes z, and the turn.
fn turned(scene: &Scene, direction: DVec3) -> (Scene, DMat3) {
    let [right, up, forward] = frame(direction);
    // right-handed: nothing is mirrored
    let by = DMat3::from_cols(right, -up, forward).transpose();
    let mut out = scene.clone();
    let turn = DAffine3::from_mat3(by);
    out.instances.iter_mut().for_each(|i| i.object_to_world = turn * i.object_to_world);
    (out, by)
}

/// A ray in the turned scene, around its origin.
fn turn(ray: &LabRay, by: &DMat3, from: DVec3, to: DVec3) -> LabRay {
    LabRay::new(*by * (ray.origin + from) - to, *by * ray.direction, ray.tmin, ray.tmax)
}

/// Builds, counts, and traces on the device.
fn run(
    session: &mut BuilderSession,
    source: &str,
    flat: &FlatScene,
    stream: &RayStream,
    contestant: &Contestant,
    rays: Option<&RayDistribution>,
) -> Result<()> {
    let start = Instant::now();
    let hierarchy = Hierarchy::build(flat, &contestant.builder);
    let seconds = start.elapsed().as_secs_f64();
    let (visits, hits) = hierarchy.visits(&stream.rays, stream.query);
    let exhaustive = hierarchy.visits(&stream.rays, Query::Exhaustive).0;
    let single = hierarchy.top.is_none().then(|| &hierarchy.groups[0]);
    let analysis = single.map(|(tree, _)| analyse(tree, None, rays));
    let build = match contestant.builder {
        Builder::Preset(preset) => BuildOptions { preset: Some(preset), ..Default::default() },
        // in world space
        Builder::Heuristic(h) => {
            let heuristic = Some(h.for_rays(h.rays.relative_to(-flat.origin)));
            BuildOptions { heuristic, ..Default::default() }
        }
    };
    let rates = rates(session, flat, stream, &build)?;
    let n = stream.rays.len() as f64;
    let mut row = session.record.row(source, &stream.name, &contestant.name);
    row.exact(quantity::RAY_COST, visits.cost() / n).exact(quantity::NODES, visits.nodes as f64 / n);
    row.exact(plain("primitives a ray", ""), visits.primitives as f64 / n);
    row.exact(plain("exhaustive cost", ""), exhaustive.cost() / n);
    row.repeated(quantity::RATE, rates);
    row.exact(plain("SAH cost", ""), analysis.as_ref().map(|a| a.sah.falcone));
    row.exact(plain("PAH cost", ""), analysis.as_ref().and_then(|a| a.pah).map(|c| c.falcone));
    row.exact(plain("build", "ms"), 1e3 * seconds).exact(plain("hits", ""), hits as f64 / n);
    Ok(())
}

/// Structures that divide the space of a body, and the seconds to build each.
fn divided(body: &Body) -> Vec<(CellKind, Cells<'_>, f64)> {
    let build = |kind| {
        let start = Instant::now();
        (kind, Cells::build(body, kind), start.elapsed().as_secs_f64())
    };
    CellKind::ALL.map(build).into()
}

/// Counts the rays of a stream in a divided space.
fn count_cells(
    session: &mut BuilderSession,
    source: &str,
    stream: &RayStream,
    kind: CellKind,
    cells: &Cells,
    seconds: f64,
) {
    let mut visits = Visits::default();
    let hits = stream.rays.iter().filter(|r| cells.trace(r, stream.query, &mut visits).is_some()).count();
    let n = stream.rays.len() as f64;
    let mut row = session.record.row(source, &stream.name, kind.name());
    row.exact(quantity::RAY_COST, visits.cost() / n).exact(quantity::NODES, visits.nodes as f64 / n);
    row.exact(plain("primitives a ray", ""), visits.primitives as f64 / n);
    row.exact(plain("build", "ms"), 1e3 * seconds).exact(plain("hits", ""), hits as f64 / n);
}

/// Builds trees of the influence areas of a stream's rays beside the default tree, counts, and
/// traces on the device. The areas are relative to the origin of `flat`.
fn run_local(
    session: &mut BuilderSession,
    source: &str,
    (flat, whole): (&FlatScene, &Whole),
    stream: &RayStream,
    choice: HeuristicChoice,
    areas: &[InfluenceArea],
) -> Result<()> {
    let heuristic = choice.heuristic(RayDistribution::Uniform);
    let start = Instant::now();
    let top = (TopLevelKind::List, FallbackStart::Exit);
    let trees = LocalTrees::build(whole.body, whole.tree, areas.to_vec(), heuristic, top);
    let seconds = start.elapsed().as_secs_f64();
    let visits = trees.visits(&stream.rays, stream.query);
    let both = visits.local.plus(visits.whole);

    // areas are given in world space
    let world = areas.iter().map(|a| a.relative_to(-flat.origin)).collect();
    let local = LocalOptions { areas: Some(world), camera: None, heuristic };
    let build = BuildOptions { local: Some(local), ..Default::default() };
    let rates = rates(session, flat, stream, &build)?;
    let n = stream.rays.len() as f64;
    let mut row = session.record.row(source, &stream.name, &format!("areas: {}", choice.name()));
    row.exact(quantity::RAY_COST, both.cost() / n).exact(quantity::NODES, both.nodes as f64 / n);
    row.exact(plain("primitives a ray", ""), both.primitives as f64 / n);
    row.exact(plain("areas a ray", ""), visits.top as f64 / n);
    row.exact(plain("affine", ""), visits.affine as f64 / n);
    row.repeated(quantity::RATE, rates);
    row.exact(plain("build", "ms"), 1e3 * seconds).exact(plain("hits", ""), visits.hits as f64 / n);
    Ok(())
}

/// Rates of the binary kernel on the device, unless nothing but counts is wanted.
fn rates(
    session: &BuilderSession,
    flat: &FlatScene,
    stream: &RayStream,
    build: &BuildOptions,
) -> Result<Option<Percentiles>> {
    if session.args.counts {
        return Ok(None);
    }
    let (needs, kernel) = (Needs::default(), Kernel::Nearest.into());
    let tracer = Tracer::with_build(&session.device, TracerKind::Compute, flat, needs, kernel, build)?;
    let rays: Vec<Ray> = stream.rays.iter().map(|r| Ray::new(r.origin, r.direction, [r.tmin, r.tmax])).collect();
    let mode = if stream.query == Query::Any { Mode::Any } else { Mode::Closest };
    let mut prepared = PreparedRays::new(&tracer, &rays, mode)?;
    let mut rates = Vec::new();
    for repeat in 0..=session.args.repeats() {
        let (seconds, _) = prepared.pass(&mut SilentControl)?;
        // the first compiles and finds launch sizes
        if repeat > 0 && seconds > 0.0 {
            rates.push(rays.len() as f64 / seconds / 1e6);
        }
    }
    Ok(Percentiles::from_values(&rates))
}
