//! `skylit bench builders`: what rays cost in trees that were built for them, in counts on the host
//! and in rates of the binary kernel. Two parts: the placements of Falcone (2024) beside his
//! results (`falcone.rs`), and the rays of images (`streams.rs`).

mod args;
mod falcone;
mod streams;

use std::path::PathBuf;

pub use args::BenchBuildersArgs;

use super::record::BenchKind;
use super::scenes::{DRAGON, SPONZA, SceneList, check_exists, shared_folder};
use super::session::BenchSession;
use crate::accel::lab::influence::Placement;
use crate::error::{Error, Result};
use crate::terminal::console::Failure;

/// A run of `skylit bench builders`.
type BuilderSession<'a> = BenchSession<'a, BenchBuildersArgs>;

/// Runs the benchmark, prints the results and writes the files.
pub fn run(args: &BenchBuildersArgs) -> Result<(), Failure> {
    // files are read before anything that takes long
    let (placements, runs, missing) = falcone_files(args)?;
    let scenes = match args.scenes.as_slice() {
        [] if args.common.quick => SceneList::from_sources(&["builtin:atrium"]),
        [] => SceneList::well_known(&[&SPONZA, &DRAGON]).then(SceneList::from_sources(&["builtin:atrium"])),
        named => SceneList::from_sources(named),
    };
    scenes.sources.iter().try_for_each(|s| check_exists(s))?;
    let plan = args.common.check(&scenes.sources, None, None)?;
    let mut session = BenchSession::start(args, &args.common, plan, BenchKind::Builders, |_| {
        let [width, height] = args.size();
        vec![("image", format!("{width}x{height}"))]
    })?;
    scenes.notes.into_iter().chain(missing).for_each(|n| session.note(n));
    let measured = measure(&mut session, &placements, &runs, &scenes.sources);
    session.finish(measured, !args.scenes.is_empty(), Ok(()))
}

/// Falcone's placements and results; a note where they are not there and were not asked for.
fn falcone_files(args: &BenchBuildersArgs) -> Result<(Vec<Placement>, Vec<falcone::Run>, Option<String>)> {
    if args.areas.as_deref() == Some("none") {
        if args.runs.is_some() {
            return Err(Error::Usage("--runs has no effect with --areas none: leave either out".into()));
        }
        return Ok(Default::default());
    }
    let folder = shared_folder().join("../references");
    let areas = args.areas.as_ref().map_or_else(|| folder.join("falcone_influence_areas.json"), PathBuf::from);
    if args.areas.is_none() && !areas.is_file() {
        let note =
            format!("{}: file not found, Falcone's placements are left out (--areas FILE.json)", areas.display());
        return Ok((Vec::new(), Vec::new(), Some(note)));
    }
    let mut placements = Placement::read_list(&areas)?;
    if args.common.quick {
        placements.retain(|p| p.scene == "Random100" || p.scene == "Suzanne");
    }
    let beside = areas.with_file_name("falcone_runs.csv");
    let runs = args.runs.clone().or(Some(beside).filter(|path| path.is_file()));
    let runs = runs.as_deref().map_or(Ok(Vec::new()), falcone::read_runs)?;
    Ok((placements, runs, None))
}

fn measure(
    session: &mut BuilderSession,
    placements: &[Placement],
    runs: &[falcone::Run],
    scenes: &[String],
) -> Result<()> {
    session.show_title()?;
    let names = super::chart::distinct(placements.iter().map(|p| p.scene.as_str()));
    session.expect_jobs(names.len() + scenes.len());
    let mut pairs = Vec::new();
    for name in &names {
        let own: Vec<&Placement> = placements.iter().filter(|p| p.scene == *name).collect();
        session.job(name, |session| {
            let outcome = falcone::scene(session, name, &own, runs, &mut pairs);
            session.show_scene(&falcone::title(name))?;
            outcome
        })?;
    }
    falcone::summarize(session, &pairs)?;
    for source in scenes {
        session.job(source, |session| {
            let outcome = streams::scene(session, source);
            session.show_scene(source)?;
            outcome
        })?;
    }
    Ok(())
}
