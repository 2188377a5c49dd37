//! A scene from near and far: every preset standing still, at rest, and moving.

use super::args::Part;
use super::candidates::Candidate;
use super::equal_time;
use super::orbit::OrbitRun;
use super::reference::{AoReference, ReferenceRenderer};
use super::scenes::{self, AoScene, View};
use super::session::AoSession;
use super::table;
use super::view_renderer::ViewRenderer;
use crate::accel::flatten::FlatScene;
use crate::bench::record::ao::{TechniqueRecord, Verdict, ViewRecord};
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::raster::Primary;

/// Both views of a scene.
pub fn measure(session: &mut AoSession, source: &str) -> Result<()> {
    let [width, height] = session.args.size();
    session.phase(format!("{source}: loading"));
    let loaded = scenes::load(source, f64::from(width) / f64::from(height))?;
    session.note_warnings(source, &loaded.scene);
    if let Some(known) = loaded.well_known {
        let plane = if loaded.on_plane { ", on a plane" } else { "" };
        session.note(format!("{source}: seen as {known} is{plane} (docs/benchmarks.md)"));
    }
    let flat = FlatScene::new(&loaded.scene);
    let tracer = session.tracer(source, &flat)?;
    let occlusion = session.args.occlusion(loaded.reach)?;
    for (k, view) in loaded.views.iter().enumerate() {
        if session.is_over() {
            session.leave_out(&format!("{source}, {}", view.name));
            continue;
        }
        let camera = CameraRecord::new(&view.camera, flat.origin, f64::from(width) / f64::from(height));
        let renderer = ViewRenderer { tracer: &tracer, size: [width, height], camera, occlusion };
        let mut record = ViewRecord::default();
        let share = (k as f64 / loaded.views.len() as f64, 1.0 / loaded.views.len() as f64);
        let outcome = from_there(session, source, (&loaded, view), &renderer, &mut record, share);
        // what there is, also where it failed
        if !record.results.is_empty() {
            session.show(&table::view(&record))?;
            session.record.views.push(record);
        }
        outcome?;
    }
    Ok(())
}

fn from_there(
    session: &mut AoSession,
    source: &str,
    (loaded, view): (&AoScene, &View),
    renderer: &ViewRenderer,
    record: &mut ViewRecord,
    share: (f64, f64),
) -> Result<()> {
    let name = format!("{source}, {}", view.name);
    let (args, candidates) = (session.args, session.args.candidates());
    session.phase(format!("{name}: reference"));
    let mut reference_renderer =
        ReferenceRenderer::new(renderer.tracer, renderer.size, &renderer.occlusion, args.reference_rays())?;
    let reference = reference_renderer.render(renderer.tracer, &renderer.camera)?;
    let to_world = view.camera.camera_to_world;
    *record = ViewRecord {
        scene: source.to_owned(),
        view: view.name.to_owned(),
        primitives: loaded.scene.triangle_count() + loaded.scene.sphere_count(),
        reach: renderer.occlusion.reach,
        eye: to_world.translation.to_array(),
        towards: (-to_world.matrix3.z_axis).normalize_or_zero().to_array(),
        covered: reference.covered(),
        reference_rmse: reference.rmse,
        ..Default::default()
    };
    if reference.covered() == 0 {
        session.note(format!("{name}: nothing is in view"));
        return Ok(());
    }
    // a step for each preset, and one for the references of the moving camera, another for equal time
    let steps = candidates.len() as f64 + 2.0;
    let mut step = 0.0;
    let mut done = |session: &mut AoSession| {
        step += 1.0;
        session.advance(share.0 + share.1 * step / steps);
    };
    let orbit = match args.wants(Part::Moving) {
        true => {
            session.phase(format!("{name}: references on the orbit"));
            let origin = loaded.scene.origin();
            Some(OrbitRun::new(renderer, &mut reference_renderer, &view.camera, (view.middle, origin), args.frames())?)
        }
        false => None,
    };
    done(session);
    for candidate in &candidates {
        if session.is_over() || session.is_late() && !record.results.is_empty() {
            session.leave_out(&format!("{name}: {}", candidate.name));
            continue;
        }
        session.phase(format!("{name}: {}", candidate.name));
        let result = one(session, renderer, candidate, &reference, orbit.as_ref())?;
        record.results.push(result);
        done(session);
    }
    let equal = if args.wants(Part::EqualTime) && !session.is_late() {
        session.phase(format!("{name}: equal time"));
        equal_time::find(renderer, record, &reference, args.frames())?
    } else {
        None
    };
    record.verdict = Verdict::of(record, equal);
    done(session);
    Ok(())
}

fn one(
    session: &AoSession,
    renderer: &ViewRenderer,
    candidate: &Candidate,
    reference: &AoReference,
    orbit: Option<&OrbitRun>,
) -> Result<TechniqueRecord> {
    let settings = candidate.settings(&renderer.occlusion);
    let pixels = u64::from(renderer.size[0]) * u64::from(renderer.size[1]);
    let primary = settings.primary.unwrap_or_else(|| Primary::auto(renderer.tracer, pixels).0);
    // equal time is judged by what a still camera shows
    let still = session.args.wants(Part::Still) || session.args.wants(Part::EqualTime);
    Ok(TechniqueRecord {
        preset: candidate.name.to_owned(),
        technique: settings.technique.name().to_owned(),
        primary: if primary == Primary::Traced { "traced" } else { "raster" }.to_owned(),
        rays_per_pixel: settings.rays_per_pixel,
        still: if still { Some(renderer.still(candidate, reference, session.args.frames())?) } else { None },
        rest: if session.args.wants(Part::Rest) { renderer.rest(candidate, reference)? } else { None },
        moving: orbit.map(|orbit| orbit.follow(renderer, candidate)).transpose()?,
    })
}
