//! A scene from near and far: every preset standing still, at rest, and moving.

use super::Bench;
use super::args::Part;
use super::candidates::Candidate;
use super::equal_time;
use super::moving::Way;
use super::reference::{Referee, Truth};
use super::scenes::{self, Subject, View};
use super::shot::Shot;
use super::table;
use crate::accel::flatten::FlatScene;
use crate::bench::record::ao::{TechniqueRecord, Verdict, ViewRecord};
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::raster::Primary;

/// Both views of a scene.
pub fn measure(bench: &mut Bench, source: &str) -> Result<()> {
    let [width, height] = bench.args.size();
    bench.phase(format!("{source}: loading"));
    let subject = scenes::load(source, f64::from(width) / f64::from(height))?;
    for warning in crate::terminal::warnings::warnings_of(&subject.scene) {
        bench.note(format!("{source}: {}", crate::terminal::warnings::one_line(&warning)));
    }
    if let Some(known) = subject.known {
        let plane = if subject.plane { ", on a plane" } else { "" };
        bench.note(format!("{source}: seen as {known} is{plane} (docs/benchmarks.md)"));
    }
    let flat = FlatScene::new(&subject.scene);
    let tracer = bench.tracer(source, &flat)?;
    let occlusion = bench.args.occlusion(subject.reach)?;
    for (k, view) in subject.views.iter().enumerate() {
        if bench.is_late() && !bench.out.is_empty() {
            bench.leave_out(&format!("{source}, {}", view.name));
            continue;
        }
        let camera = CameraRecord::new(&view.camera, flat.origin, f64::from(width) / f64::from(height));
        let shot = Shot { tracer: &tracer, size: [width, height], camera, occlusion };
        let mut record = ViewRecord::default();
        let share = (k as f64 / subject.views.len() as f64, 1.0 / subject.views.len() as f64);
        let outcome = from_there(bench, source, (&subject, view), &shot, &mut record, share);
        // what there is, also where it failed
        if !record.results.is_empty() {
            bench.lines(&table::view(&record))?;
            bench.out.views.push(record);
        }
        outcome?;
    }
    Ok(())
}

fn from_there(
    bench: &mut Bench,
    source: &str,
    (subject, view): (&Subject, &View),
    shot: &Shot,
    record: &mut ViewRecord,
    share: (f64, f64),
) -> Result<()> {
    let name = format!("{source}, {}", view.name);
    let (args, candidates) = (bench.args, bench.args.candidates());
    bench.phase(format!("{name}: reference"));
    let mut referee = Referee::new(shot.tracer, shot.size, &shot.occlusion, args.reference_rays())?;
    let truth = referee.truth(shot.tracer, &shot.camera)?;
    let to_world = view.camera.camera_to_world;
    *record = ViewRecord {
        scene: source.to_owned(),
        view: view.name.to_owned(),
        primitives: subject.scene.triangle_count() + subject.scene.sphere_count(),
        reach: shot.occlusion.reach,
        eye: to_world.translation.to_array(),
        towards: (-to_world.matrix3.z_axis).normalize_or_zero().to_array(),
        covered: truth.covered(),
        reference_rmse: truth.rmse,
        ..Default::default()
    };
    if truth.covered() == 0 {
        bench.note(format!("{name}: nothing is in view"));
        return Ok(());
    }
    // a step for each preset, and one for the references of the moving camera, another for equal time
    let steps = candidates.len() as f64 + 2.0;
    let mut step = 0.0;
    let mut done = |bench: &mut Bench| {
        step += 1.0;
        bench.advance(share.0 + share.1 * step / steps);
    };
    let way = match args.wants(Part::Moving) {
        true => {
            bench.phase(format!("{name}: references on the way"));
            let origin = subject.scene.origin();
            Some(Way::new(shot, &mut referee, &view.camera, (view.middle, origin), args.frames())?)
        }
        false => None,
    };
    done(bench);
    for candidate in &candidates {
        if bench.is_late() && !(record.results.is_empty() && bench.out.is_empty()) {
            bench.leave_out(&format!("{name}: {}", candidate.name));
            continue;
        }
        bench.phase(format!("{name}: {}", candidate.name));
        let result = one(bench, shot, candidate, &truth, way.as_ref())?;
        record.results.push(result);
        done(bench);
    }
    let equal = if args.wants(Part::EqualTime) && !bench.is_late() {
        bench.phase(format!("{name}: equal time"));
        equal_time::find(shot, record, &truth, args.frames())?
    } else {
        None
    };
    record.verdict = Verdict::of(record, equal);
    done(bench);
    Ok(())
}

fn one(bench: &Bench, shot: &Shot, candidate: &Candidate, truth: &Truth, way: Option<&Way>) -> Result<TechniqueRecord> {
    let settings = candidate.settings(&shot.occlusion);
    let pixels = u64::from(shot.size[0]) * u64::from(shot.size[1]);
    let primary = settings.primary.unwrap_or_else(|| Primary::auto(shot.tracer, pixels).0);
    // equal time is judged by what a still camera shows
    let still = bench.args.wants(Part::Still) || bench.args.wants(Part::EqualTime);
    Ok(TechniqueRecord {
        preset: candidate.name.to_owned(),
        technique: settings.technique.name().to_owned(),
        primary: if primary == Primary::Traced { "traced" } else { "raster" }.to_owned(),
        rays_per_pixel: settings.rays_per_pixel,
        still: if still { Some(shot.still(candidate, truth, bench.args.frames())?) } else { None },
        rest: if bench.args.wants(Part::Rest) { shot.rest(candidate, truth)? } else { None },
        moving: way.map(|way| way.follow(shot, candidate)).transpose()?,
    })
}
