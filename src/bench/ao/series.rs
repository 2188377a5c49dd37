//! One number varied, everything else as it is.

use super::args::Series;
use super::candidates::{CANDIDATES, Candidate, Occlusion};
use super::reference::{AoReference, ReferenceRenderer};
use super::scenes::{self, AoScene};
use super::session::AoSession;
use super::table;
use super::view_renderer::ViewRenderer;
use crate::accel::flatten::FlatScene;
use crate::bench::frame_log::first_timed;
use crate::bench::record::ao::{SeriesLine, SeriesPoint, SeriesRecord};
use crate::bench::record::ao_verdict::{OURS, THEIRS};
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::realtime::Settings;
use crate::sampling::Sequence;

/// Preset whose resolution is varied.
const FAST: &str = "fast";
const TRIANGLES: [&str; 6] = [
    "builtin:terrain:10000",
    "builtin:terrain:100000",
    "builtin:terrain:1000000",
    "builtin:terrain:2450000",
    "builtin:terrain:10000000",
    "builtin:instances:25000000",
];
const QUICK_TRIANGLES: [&str; 3] = ["builtin:terrain:1000", "builtin:terrain:10000", "builtin:instances:25000"];
const RAYS: [u32; 7] = [1, 2, 4, 8, 16, 32, 64];
const QUICK_RAYS: [u32; 2] = [1, 4];
const SIZES: [[u32; 2]; 5] = [[320, 180], [640, 360], [960, 540], [1280, 720], [1920, 1080]];
const QUICK_SIZES: [[u32; 2]; 2] = [[80, 45], [160, 90]];
/// Scenes over which sequences are compared, of those that are measured.
const SAMPLED: usize = 4;

/// A whole series. `scenes`: those on the command line, or the default ones.
pub fn measure(session: &mut AoSession, series: Series, scenes: &[String]) -> Result<()> {
    let first = scenes.first().cloned().unwrap_or_default();
    let record = match series {
        Series::Triangles => triangles(session, scenes)?,
        Series::Rays => rays(session, &first)?,
        Series::Resolution => resolution(session, &first)?,
        Series::Sampling => {
            for source in scenes.iter().take(SAMPLED) {
                let record = sampling(session, source)?;
                finish(session, record)?;
            }
            return Ok(());
        }
    };
    finish(session, record)
}

fn finish(session: &mut AoSession, record: SeriesRecord) -> Result<()> {
    session.show(&table::series(&record))?;
    if record.lines.iter().any(|l| !l.points.is_empty()) {
        session.record.series.push(record);
    }
    Ok(())
}

fn of(name: &str) -> impl Iterator<Item = &'static Candidate> {
    CANDIDATES.iter().filter(move |c| c.name == name)
}

/// Loads a scene and hands over its near view.
fn near<R>(
    session: &mut AoSession,
    source: &str,
    work: impl FnOnce(&mut AoSession, &AoScene, &ViewRenderer) -> Result<R>,
) -> Result<R> {
    session.phase(format!("{source}: loading"));
    let aspect = session.aspect();
    let loaded = scenes::load(source, aspect)?;
    let flat = FlatScene::new(&loaded.scene);
    let tracer = session.tracer(source, &flat)?;
    let occlusion: Occlusion = session.args.occlusion(loaded.reach)?;
    let camera = CameraRecord::new(&loaded.views[0].camera, flat.origin, aspect);
    let renderer = ViewRenderer { tracer: &tracer, size: session.args.size(), camera, occlusion };
    work(session, &loaded, &renderer)
}

fn reference(session: &mut AoSession, renderer: &ViewRenderer) -> Result<AoReference> {
    let mut reference_renderer =
        ReferenceRenderer::new(renderer.tracer, renderer.size, &renderer.occlusion, session.args.reference_rays())?;
    reference_renderer.render(renderer.tracer, &renderer.camera)
}

/// Time by the number of triangles.
fn triangles(session: &mut AoSession, scenes: &[String]) -> Result<SeriesRecord> {
    let default: Vec<String> = if session.args.common.quick {
        QUICK_TRIANGLES.map(str::to_owned).to_vec()
    } else {
        TRIANGLES.map(str::to_owned).to_vec()
    };
    let sources = if session.args.scenes.is_empty() { default } else { scenes.to_vec() };
    let mut lines: Vec<SeriesLine> = [OURS, THEIRS].map(|name| SeriesLine { name: name.to_owned(), points: Vec::new() }).into();
    for (k, source) in sources.iter().enumerate() {
        if k > 0 && session.is_late() {
            session.leave_out(source);
            continue;
        }
        session.advance(k as f64 / sources.len() as f64);
        let frames = session.args.frames();
        near(session, source, |session, loaded, renderer| {
            for line in &mut lines {
                session.phase(format!("{source}: {}", line.name));
                for candidate in of(&line.name) {
                    let log = renderer.tremble(&candidate.settings(&renderer.occlusion), frames)?.1;
                    line.points.push(SeriesPoint {
                        scene: source.clone(),
                        x: (loaded.scene.triangle_count() + loaded.scene.sphere_count()) as f64,
                        cost: Some(log.cost(first_timed(frames))),
                        ..Default::default()
                    });
                }
            }
            Ok(())
        })?;
    }
    lines.iter_mut().for_each(|l| l.points.sort_by(|a, b| a.x.total_cmp(&b.x)));
    Ok(SeriesRecord { series: "triangles".into(), scene: "near".into(), lines })
}

/// Time and error by the number of rays.
fn rays(session: &mut AoSession, source: &str) -> Result<SeriesRecord> {
    let numbers: &[u32] = if session.args.common.quick { &QUICK_RAYS } else { &RAYS };
    let frames = session.args.frames();
    let points = near(session, source, |session, _, renderer| {
        session.phase(format!("{source}: reference"));
        let reference = reference(session, renderer)?;
        let mut points = Vec::new();
        for (k, &rays_per_pixel) in numbers.iter().enumerate() {
            if k > 0 && session.is_late() {
                session.leave_out(&format!("{rays_per_pixel} rays a pixel"));
                continue;
            }
            session.phase(format!("{source}: {rays_per_pixel} rays a pixel"));
            session.advance(k as f64 / numbers.len() as f64);
            for candidate in of(OURS) {
                let settings = Settings { rays_per_pixel, ..candidate.settings(&renderer.occlusion) };
                let still = renderer.still_with(&Settings { rest: false, ..settings }, &reference, frames)?;
                let settled = still.settled();
                points.push(SeriesPoint {
                    scene: source.to_owned(),
                    x: f64::from(rays_per_pixel),
                    rmse: settled.map(|p| p.errors.rmse_corrected),
                    unfiltered_rmse: settled.and_then(|p| p.unfiltered).map(|e| e.rmse_corrected),
                    cost: Some(still.moving_cost),
                    ..Default::default()
                });
            }
        }
        Ok(points)
    })?;
    Ok(SeriesRecord { series: "rays".into(), scene: source.to_owned(), lines: vec![SeriesLine { name: OURS.into(), points }] })
}

/// Time by the number of pixels.
fn resolution(session: &mut AoSession, source: &str) -> Result<SeriesRecord> {
    let sizes: &[[u32; 2]] = if session.args.common.quick { &QUICK_SIZES } else { &SIZES };
    let frames = session.args.frames();
    let points = near(session, source, |session, _, renderer| {
        let mut points = Vec::new();
        for (k, &size) in sizes.iter().enumerate() {
            let name = format!("{}x{}", size[0], size[1]);
            if k > 0 && session.is_late() {
                session.leave_out(&name);
                continue;
            }
            session.phase(format!("{source}: {name}"));
            session.advance(k as f64 / sizes.len() as f64);
            for candidate in of(FAST) {
                let log = ViewRenderer { size, ..*renderer }.tremble(&candidate.settings(&renderer.occlusion), frames)?.1;
                points.push(SeriesPoint {
                    scene: name.clone(),
                    x: f64::from(size[0]) * f64::from(size[1]),
                    cost: Some(log.cost(first_timed(frames))),
                    ..Default::default()
                });
            }
        }
        Ok(points)
    })?;
    let lines = vec![SeriesLine { name: FAST.into(), points }];
    Ok(SeriesRecord { series: "resolution".into(), scene: source.to_owned(), lines })
}

/// Error of every sequence of samples: by frames, and when the quickest of them is done.
fn sampling(session: &mut AoSession, source: &str) -> Result<SeriesRecord> {
    let frames = session.args.frames();
    let lines = near(session, source, |session, _, renderer| {
        session.phase(format!("{source}: reference"));
        let reference = reference(session, renderer)?;
        let mut lines: Vec<(SeriesLine, Vec<(f64, f64)>)> = Vec::new();
        for (k, sequence) in Sequence::ALL.into_iter().enumerate() {
            if k > 0 && session.is_late() {
                session.leave_out(&format!("{source}: {}", sequence.name()));
                continue;
            }
            session.phase(format!("{source}: {}", sequence.name()));
            session.advance(k as f64 / Sequence::ALL.len() as f64);
            for candidate in of(OURS) {
                let settings = Settings { sequence, rest: false, ..candidate.settings(&renderer.occlusion) };
                lines.push(one_sequence(renderer, &settings, &reference, (source, frames))?);
            }
        }
        // all of them get as long as the quickest needs
        let done = lines.iter().filter_map(|(_, spent)| spent.last()).map(|s| s.0).fold(f64::INFINITY, f64::min);
        for (line, spent) in &mut lines {
            let until = spent.iter().take_while(|s| s.0 <= done).last();
            if let (Some(last), Some((_, rmse))) = (line.points.last_mut(), until) {
                last.equal_time_rmse = Some(*rmse);
            }
        }
        Ok(lines.into_iter().map(|l| l.0).collect())
    })?;
    Ok(SeriesRecord { series: "sampling".into(), scene: source.to_owned(), lines })
}

/// A sequence's errors, and after each frame the seconds that were spent so far with the error then.
fn one_sequence(
    renderer: &ViewRenderer,
    settings: &Settings,
    reference: &AoReference,
    (source, frames): (&str, u32),
) -> Result<(SeriesLine, Vec<(f64, f64)>)> {
    let still = renderer.still_with(settings, reference, frames)?;
    // every frame at its median price: single ones are too noisy to be added
    let spent = still.rmse.iter().enumerate().map(|(k, e)| ((k + 1) as f64 * still.cost.ms(), *e)).collect();
    let points = still.curve.iter().map(|p| SeriesPoint {
        scene: source.to_owned(),
        x: f64::from(p.frame),
        rmse: Some(p.errors.rmse_corrected),
        unfiltered_rmse: p.unfiltered.map(|e| e.rmse_corrected),
        cost: (p.frame == frames).then(|| still.cost.clone()),
        ..Default::default()
    });
    Ok((SeriesLine { name: settings.sequence.name().to_owned(), points: points.collect() }, spent))
}
