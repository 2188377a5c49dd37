//! `skylit bench ao`: what each preset's frames cost and how far they are from reference images, by scene and view, standing still and
//! moving, and what of the past they show where the scene changes. docs/bench-ao.md says what is measured and how.

mod args;
mod candidates;
mod changes;
mod equal_time;
mod orbit;
mod reference;
mod scenes;
mod series;
mod session;
mod structures;
pub mod table;
mod view_renderer;
mod views;

pub use args::BenchAoArgs;
use args::{FalloffChoice, Part};
use session::AoSession;

use super::record::ao::AoBenchmark;
use super::scenes::check_exists;
use super::session::Session;
use super::table::Block;
use crate::error::Result;
use crate::terminal::console::Failure;

/// Measures, shows, writes.
///
/// # Errors
/// The first that went wrong; what was measured is written all the same.
pub fn run(args: &BenchAoArgs) -> Result<(), Failure> {
    let scenes = scenes::choose(args);
    // before anything that takes long
    scenes.sources.iter().try_for_each(|s| check_exists(s))?;
    args.common.check_inputs(&scenes.sources, None, None)?;
    let mut session = Session::start(args, &args.common, |device| AoBenchmark {
        host: device.host_info(),
        tracer: args.tracer.on(device.info()).0.name().to_owned(),
        size: args.size(),
        frames: args.frames(),
        reference_rays: args.reference_rays(),
        falloff: if args.ao_falloff == FalloffChoice::Binary { "binary" } else { "exponential" }.to_owned(),
        ..Default::default()
    })?;
    scenes.notes.into_iter().for_each(|n| session.note(n));
    let measured = measure(&mut session, &scenes.sources);
    session.finish(measured, !args.scenes.is_empty(), Ok(()))
}

/// All jobs. One that fails does not stop the others.
fn measure(session: &mut AoSession, scenes: &[String]) -> Result<()> {
    let title = table::title(&session.record);
    session.show(&[Block::Line(title)])?;
    let (args, views) = (session.args, session.args.wants_views());
    let (changes, structures) = (args.wants(Part::Changes), args.wants(Part::Structures));
    let count = |wanted: bool, n: usize| if wanted { n } else { 0 };
    session.expect_jobs(count(views, scenes.len()) + count(changes, 1) + count(structures, 1) + args.series.len());
    for source in scenes.iter().filter(|_| views) {
        session.job(source, |session| views::measure(session, source))?;
    }
    if changes {
        session.job("changes", |session| changes::measure(session, scenes))?;
    }
    if structures {
        session.job("structures", structures::measure)?;
    }
    for series in &args.series {
        session.job("series", |session| series::measure(session, *series, scenes))?;
    }
    Ok(())
}
