//! `skylit bench frames`: what frames in real time of any integrator cost and how far they are from converged images, preset by preset, beside plain accumulation in
//! the same time: standing still, moving, and after changes. docs/bench-frames.md says what is measured and how.

mod args;
mod bounces;
mod change;
mod displayed;
mod moving;
mod peers;
mod scenes;
mod signal;
mod stage;
mod still;
pub mod table;
mod views;

pub use args::BenchFramesArgs;
use args::Part;

use super::peers::file::{self, Measures, PeerSpec};
use super::record::frames::FramesBenchmark;
use super::session::Session;
use super::table::Block;
use crate::error::Result;
use crate::terminal::console::Failure;

/// A run of `skylit bench frames`.
type FramesSession<'a> = Session<'a, BenchFramesArgs, FramesBenchmark>;

/// Measures, shows, writes.
///
/// # Errors
/// The first that went wrong; what was measured is written all the same.
pub fn run(args: &BenchFramesArgs) -> Result<(), Failure> {
    args.check()?;
    let scenes = scenes::choose(args);
    // before anything that takes long
    let specs = if args.wants_peers() { file::choose(args.peers.as_deref(), Measures::Paths)? } else { Ok(Vec::new()) };
    scenes.sources.iter().try_for_each(|s| scenes::check(s))?;
    args.common.check_inputs(&scenes.sources, args.environment.as_deref(), args.peers.as_deref())?;
    let mut session = Session::start(args, &args.common, |device| FramesBenchmark {
        host: device.host_info(),
        tracer: args.tracer.on(device.info()).0.name().to_owned(),
        integrator: args.integrator.name().to_owned(),
        size: args.size(),
        frames: args.frames(),
        seed: args.seed,
        runs: args.runs,
        reference_paths: args.reference_paths(),
        ..Default::default()
    })?;
    scenes.notes.into_iter().for_each(|n| session.note(n));
    let measured = measure(&mut session, &scenes.sources, specs);
    session.finish(measured, !args.scenes.is_empty(), Ok(()))
}

/// All jobs. One that fails does not stop the others.
fn measure(session: &mut FramesSession, scenes: &[String], specs: Result<Vec<PeerSpec>, String>) -> Result<()> {
    session.start_peers(specs)?;
    session.record.peers = session.peer_titles();
    let title = table::title(&session.record);
    session.show(&[Block::Line(title)])?;
    let (views, bounces) = (session.args.wants_views(), session.args.wants(Part::Bounces));
    let oidn = views::open_denoiser(session);
    session.expect_jobs(if views { scenes.len() } else { 0 } + usize::from(bounces));
    for source in scenes.iter().filter(|_| views) {
        session.job(source, |session| views::measure(session, source, oidn.as_ref()))?;
    }
    if bounces {
        session.job("bounces", bounces::measure)?;
    }
    Ok(())
}
