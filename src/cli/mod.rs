//! The command line: one file per command. Every failure ends as one line on stderr (and a record
//! on stdout with `--json`) and an exit code of [`EXIT_CODES`].

mod args;
#[cfg(feature = "bake")]
mod bake;
mod bvh;
#[cfg(feature = "report")]
mod bvh_page;
#[cfg(feature = "compare")]
mod compare;
#[cfg(feature = "compare")]
mod compare_ao;
mod completions;
mod config;
mod convert;
mod diff;
mod doctor;
mod export;
mod help;
mod image_info;
mod info;
mod man;
mod rays;
mod reference;
mod render;
mod scenes;
mod stress;
#[cfg(feature = "verify")]
mod verify;
mod version;
#[cfg(feature = "viewer")]
mod view;

use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use bytesize::ByteSize;
use clap::error::ErrorKind;
use clap::{FromArgMatches, Parser};

use crate::error::{Error, Result};
use crate::files;
use crate::gpu::threads;
use crate::memory;
use crate::settings::parse::usage_message;
use crate::terminal::console::{Failure, one_line};
use crate::terminal::{console, interrupt, panic};

/// Exit codes of the process; part of `--help`.
pub const EXIT_CODES: &str = "\
Exit codes:
  0    done
  1    a check did not hold (images differ, a check of `stress` fails, validation messages), or a
       Vulkan call failed
  2    no Vulkan loader, no device, or one that lacks a requirement (see `skylit doctor`);
       no Open Image Denoise; `verify` could not render or judge a frame
  3    an input file is missing or broken, or the scene cannot be rendered
  4    an output file cannot be written; nothing half-written is left
  5    out of memory, or no room for threads
  6    the Vulkan device was lost
  64   wrong usage of the command line
  70   a bug in skylit
  130  interrupted (Ctrl-C)";

/// Examples by task; `skylit help COMMAND` has more of each.
const EXAMPLES: &str = "\
Examples:
  skylit scene.glb                                        look at a scene
  skylit render scene.glb -o ao.png                       render its ambient occlusion
  skylit render scene.glb -o path.png --integrator path   path-trace it
  skylit render scene.glb -o a.apng --preset balanced --orbit --frames 0..240     in real time
  skylit compare ao.exr path.exr --html report            measure how far apart two images are
  skylit verify tests/frames                              check reference frames in CI
  skylit doctor                                           find out whether this machine can do it";

#[derive(Debug, Parser)]
#[command(name = "skylit", version, about, before_help = EXAMPLES, after_help = EXIT_CODES)]
struct Cli {
    /// Memory that files loaded together may take, like 8GiB [default: half of this machine's]
    ///
    /// Without the option they may also take no more than 1 GiB and 256 bytes for each byte that is
    /// read.
    #[arg(long, global = true, value_name = "SIZE", hide_short_help = true, help_heading = "Files")]
    memory_limit: Option<ByteSize>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    /// Render a scene: ambient occlusion, path tracing, or frames in real time
    Render(Box<render::RenderArgs>),
    /// Look at a scene in a window while it is traced, or at images
    #[cfg(feature = "viewer")]
    View(Box<view::ViewArgs>),
    /// Describe a scene or an image, and suggest options
    ///
    /// Of a scene it shows geometry, materials, textures, lights, a camera and an AO radius that
    /// fit, memory and time on this device.
    Info(info::InfoArgs),
    /// Describe the hierarchy that rays traverse: cost by level, and what rays cost in it
    Bvh(Box<bvh::BvhArgs>),
    /// List the built-in scenes
    Scenes(args::ScenesArgs),
    /// Write a scene as glTF (.glb, .gltf) or as a world-space triangle soup (.bin)
    Export(args::ExportArgs),
    /// Bake ambient occlusion into textures or vertex colours of a model, or other maps as images
    #[cfg(feature = "bake")]
    Bake(Box<bake::BakeArgs>),
    /// Write an image in other formats: exposed, tone mapped, or one of its layers
    Convert(convert::ConvertArgs),
    /// Check whether two images agree
    Diff(args::DiffArgs),
    /// Compare images or renders with a reference: metrics, difference pictures, an HTML report
    #[cfg(feature = "compare")]
    Compare(Box<compare::CompareArgs>),
    /// Compare the frames of a manifest with their golden images: for continuous integration
    #[cfg(feature = "verify")]
    Verify(Box<verify::VerifyArgs>),
    /// Benchmark rays, frames in real time and path tracing, beside other programs
    #[cfg(feature = "bench")]
    Bench(crate::bench::BenchArgs),
    /// Trace a set of rays against a mesh and report the ray throughput
    Rays(args::RaysArgs),
    /// Check numerics of tracers, sampling, films and filters, or of a scene of yours
    Stress(Box<stress::StressArgs>),
    /// Show the Vulkan devices, what each tracer requires and supports, and which one `auto` chooses
    Doctor(args::DoctorArgs),
    /// Print a script by which a shell completes commands, options and names of built-in scenes
    Completions(completions::CompletionsArgs),
    /// Write manual pages, a file for each command
    #[command(hide = true)]
    Man(man::ManArgs),
}

impl Cli {
    fn parse_from(arguments: Vec<OsString>) -> clap::error::Result<Self> {
        let matches = help::definition().try_get_matches_from(arguments)?;
        Self::from_arg_matches(&matches)
    }
}

/// Runs the command that the process' arguments name.
pub fn run() -> ExitCode {
    run_from(std::env::args_os().collect())
}

/// Most threads that commands share.
const MAX_THREADS: usize = 1024;

/// Starts the threads that commands share, fewer than there are processors where the system has no
/// room for more: without them the first use would panic.
fn start_threads() -> Result<()> {
    crate::gpu::host_memory::check_room_to_start();
    let requested = std::env::var("RAYON_NUM_THREADS").ok().and_then(|n| n.parse::<usize>().ok()).filter(|n| *n > 0);
    let wanted =
        requested.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from)).min(MAX_THREADS);
    let all = wanted + threads::RESERVED;
    let count = match threads::room(all) {
        room if room == all => wanted,
        // a driver of the CPU has two for each of ours
        room => (room.saturating_sub(threads::RESERVED) / 3).clamp(1, wanted),
    };
    let outcome = rayon::ThreadPoolBuilder::new().num_threads(count).build_global();
    outcome.map_err(|e| Error::OutOfMemory(format!("the system has no room for a thread of this process: raise the limit (`ulimit -u`, or that of the container), or end other programs ({e})")))
}

/// Says which variables are ignored that name folders of the user.
fn note_ignored_folders() {
    for (name, path) in files::ignored_user_folders() {
        console::note(&format!("{name} is ignored: {} is not an absolute path", path.display()));
    }
}

fn run_from(arguments: Vec<OsString>) -> ExitCode {
    let start = Instant::now();
    // before parsing: usage errors must be reported as JSON, too
    let json = prints_json(&arguments);
    let quiet = arguments.iter().any(|a| a == "--quiet" || a == "-q");
    panic::install();
    // before other threads start, which inherit it
    interrupt::block_file_size_signal();

    // the command
    let outcome = panic::catch(|| {
        if let Some(text) = help::all(&arguments) {
            return console::print(&text).map_err(Failure::from);
        }
        let is_long_version = arguments.get(1).is_some_and(|a| a == "--version");
        match Cli::parse_from(with_view(arguments)) {
            Ok(cli) => {
                cli.memory_limit.into_iter().for_each(|limit| memory::set_limit(limit.as_u64()));
                let started = start_threads().inspect(|()| {
                    if !quiet {
                        note_ignored_folders()
                    }
                });
                started.map_err(Failure::from).and_then(|()| dispatch(cli.command, start))
            }
            Err(e) if e.kind() == ErrorKind::DisplayVersion && is_long_version => Ok(console::print(&version::long())?),
            Err(e) => explain(&e).map_err(Failure::from),
        }
    });

    // what failed, and the exit code
    let (message, code, reported) = match outcome {
        Ok(Ok(())) => return ExitCode::SUCCESS,
        Ok(Err(Failure { error, reported })) => (one_line(&error.to_string()), error.exit_code(), reported),
        Err(bug) => (bug, panic::EXIT_CODE, false),
    };
    console::error(&message);
    if json && !reported {
        // nothing can be done about a stdout that fails now
        let _ = console::json(&serde_json::json!({ "error": message, "exit_code": code }));
    }
    if code == Error::Interrupted.exit_code() {
        // a driver may still be at work, and nobody waits for its end
        threads::end_process(code);
    }
    ExitCode::from(code)
}

/// Adds the command `view` where none is given: `skylit` alone, on a machine with a display, and
/// `skylit SCENE`.
fn with_view(mut arguments: Vec<OsString>) -> Vec<OsString> {
    #[cfg(feature = "viewer")]
    {
        // other systems have one always
        let is_set = |v: &&str| std::env::var_os(v).is_some_and(|v| !v.is_empty());
        let has_display =
            || cfg!(any(windows, target_os = "macos")) || ["DISPLAY", "WAYLAND_DISPLAY"].iter().any(is_set);
        let is_view = match arguments.get(1).map(|a| a.to_string_lossy()) {
            None => has_display(),
            Some(first) => !first.starts_with('-') && view::is_file(&first),
        };
        if is_view {
            arguments.insert(1.min(arguments.len()), "view".into());
        }
    }
    #[cfg(not(feature = "viewer"))]
    let _ = &mut arguments;
    arguments
}

/// Whether errors are records on stdout, too, which usage errors are as well. The
/// `--json FILE.json` of a benchmark prints none.
fn prints_json(arguments: &[OsString]) -> bool {
    let is_benchmark = arguments.get(1).is_some_and(|a| a == "bench") && arguments.get(2).is_none_or(|a| a != "report");
    let is_file = |name: &OsString| is_benchmark && files::has_extension(Path::new(name), "json");
    (1..arguments.len()).any(|k| arguments[k] == "--json" && !arguments.get(k + 1).is_some_and(is_file))
}

fn dispatch(command: Command, start: Instant) -> Result<(), Failure> {
    match command {
        Command::Render(args) => return render::run(&args, start),
        #[cfg(feature = "viewer")]
        Command::View(args) => return view::run(&args),
        Command::Info(args) => return info::run(&args),
        Command::Bvh(args) => return bvh::run(&args),
        Command::Scenes(args) => scenes::run(&args),
        Command::Export(args) => export::run(&args),
        #[cfg(feature = "bake")]
        Command::Bake(args) => bake::run(&args),
        Command::Rays(args) => rays::run(&args),
        Command::Doctor(args) => doctor::run(&args),
        Command::Completions(args) => completions::run(&args),
        Command::Man(args) => man::run(&args),
        Command::Convert(args) => return convert::run(&args),
        Command::Diff(args) => return diff::run(&args),
        Command::Stress(args) => return stress::run(&args),
        #[cfg(feature = "compare")]
        Command::Compare(args) => return compare::run(&args, start),
        #[cfg(feature = "verify")]
        Command::Verify(args) => return verify::run(&args),
        #[cfg(feature = "bench")]
        Command::Bench(args) => return crate::bench::run(&args),
    }
    .map_err(Failure::from)
}

/// Help and version go to stdout; everything else that clap says becomes a usage error of one line.
fn explain(error: &clap::Error) -> Result<()> {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => console::print(&error.render().to_string()),
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            Err(Error::Usage("no command given; `skylit --help` lists the commands".into()))
        }
        _ => Err(Error::Usage(usage_message(error))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn definitions_are_sound() {
        help::definition().debug_assert();
        help::complete_definition().debug_assert();
    }

    #[cfg(feature = "viewer")]
    #[test]
    fn a_scene_alone_is_looked_at() {
        let arguments = |line: &str| -> Vec<String> {
            let words = line.split(' ').map(OsString::from).collect();
            with_view(words).into_iter().map(|w| w.to_string_lossy().into_owned()).collect()
        };
        assert_eq!(arguments("skylit builtin:stairs")[1], "view");
        assert_eq!(arguments("skylit no/such/file.glb --tracer compute")[1..3], ["view", "no/such/file.glb"]);
        for line in ["skylit render a.glb", "skylit --help", "skylit stairs", "skylit doctor"] {
            assert_eq!(arguments(line).join(" "), line);
        }
    }

    #[test]
    fn a_json_file_keeps_stdout_empty() {
        let prints = |line: &str| prints_json(&line.split(' ').map(OsString::from).collect::<Vec<_>>());
        for line in ["skylit bench ao --json", "skylit bench report --json a.json", "skylit diff --json a.json b.png"] {
            assert!(prints(line), "{line}");
        }
        for line in
            ["skylit bench ao --json a.json scene.glb", "skylit bench rays --json=a.json", "skylit bench ao a.json"]
        {
            assert!(!prints(line), "{line}");
        }
    }

    #[test]
    fn help_lists_every_exit_code() {
        let help = help::definition().render_help().to_string();
        for code in [0, 1, 2, 3, 4, 5, 6, 64, 70, 130] {
            assert!(help.contains(&format!("\n  {code:<4} ")), "{code}");
        }
    }
}
