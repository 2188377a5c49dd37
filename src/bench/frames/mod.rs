//! `skylit bench frames`: cost and error of frames in real time, preset by preset, beside plain
//! accumulation in the same time: standing still, moving, after changes, and along series.
//! docs/reference/benchmarks.md says what is measured and how.

mod args;
mod bounces;
mod candidates;
mod change;
mod frame_log;
mod larsen;
mod moving;
mod peers;
mod scenes;
mod series;
mod signal;
mod stage;
mod still;
mod structures;
mod views;

pub use args::BenchFramesArgs;
use args::{FalloffChoice, FramesSession, Part};

use super::peers::file::{self, Measures, PeerSpec};
use super::record::BenchKind;
use super::session::BenchSession;
use crate::error::Result;
use crate::terminal::console::Failure;

pub fn run(args: &BenchFramesArgs) -> Result<(), Failure> {
    args.check()?;
    let scenes = scenes::choose(args);
    // before anything that takes long
    let specs = if args.wants_peers() { file::choose(args.peers.as_deref(), Measures::Paths)? } else { Ok(Vec::new()) };
    scenes.sources.iter().try_for_each(|s| scenes::check(s))?;
    let plan = args.common.check(&scenes.sources, args.environment.as_deref(), args.peers.as_deref())?;
    let mut session = BenchSession::start(args, &args.common, plan, BenchKind::Frames, |device| {
        let [width, height] = args.size();
        let falloff = if args.ao_falloff == FalloffChoice::Binary { "binary" } else { "exponential" };
        let mut settings = vec![
            ("tracer", args.tracer.on(device).0.name().to_owned()),
            ("integrator", args.integrator().name().to_owned()),
            ("size", format!("{width}x{height}")),
            ("frames", args.frames().to_string()),
            ("seed", args.seed.to_string()),
            ("runs", args.runs.to_string()),
            ("reference paths", args.reference_paths().to_string()),
        ];
        settings.extend(args.is_occlusion().then(|| ("falloff", falloff.to_owned())));
        settings
    })?;
    scenes.notes.into_iter().for_each(|n| session.note(n));
    let measured = measure(&mut session, &scenes.sources, specs);
    session.finish(measured, !args.scenes.is_empty(), Ok(()))
}

/// All jobs. One that fails does not stop the others.
fn measure(session: &mut FramesSession, scenes: &[String], specs: Result<Vec<PeerSpec>, String>) -> Result<()> {
    session.start_peers(specs)?;
    let args = session.args;
    let views = if args.wants_views() { scenes } else { &[] };
    let (bounces, structures) = (args.wants(Part::Bounces), args.wants(Part::Structures));
    let oidn = if views.is_empty() || args.is_occlusion() { None } else { views::open_denoiser(session) };
    session.expect_jobs(views.len() + usize::from(bounces) + usize::from(structures) + args.series.len());
    for source in views {
        session.job(source, |session| views::measure(session, source, oidn.as_ref()))?;
    }
    if bounces {
        session.job("bounces", bounces::measure)?;
    }
    if structures {
        session.job("structures", structures::measure)?;
    }
    for series in &args.series {
        session.job("series", |session| series::measure(session, *series, scenes))?;
    }
    Ok(())
}
