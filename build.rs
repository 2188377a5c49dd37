//! Compiles every shader of src/shaders/registry.rs into OUT_DIR. With the feature `live-shaders` there is nothing to do: the program compiles what it
//! needs when it runs.

// what the program derives for the types of interface, build.rs has no use for
macro_rules! shared_record {
    ($($item:tt)*) => { $($item)* };
}
macro_rules! shared_enumeration {
    ($($item:tt)*) => { $($item)* };
}
macro_rules! shared_choice {
    (
        $(#[$meta:meta])* pub enum $name:ident $((default $default:ident))? {
            $($(#[$about:meta])+ $variant:ident = $setting:literal,)+
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy)]
        pub enum $name {
            $($(#[$about])+ $variant,)+
        }
    };
}

#[path = "src/shaders/compiler.rs"]
mod compiler;
#[path = "src/interface/mod.rs"]
#[allow(dead_code, unused_imports, reason = "the program uses the rest")]
mod interface;
#[path = "src/shaders/source.rs"]
#[allow(dead_code, reason = "the program uses the rest")]
mod source;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use compiler::Compiler;
use source::{Mode, Rays, Source, Stage, Variant, mode, rays};

// Debian's libshaderc_combined.a leaves glslang and SPIRV-Tools out; their order is that of their dependencies.
macro_rules! libraries {
    ($($name:literal)*) => {
        $(
            #[cfg(not(feature = "build-shaderc"))]
            #[link(name = $name)]
            unsafe extern "C" {}
        )*
        /// For programs that compile shaders themselves.
        const LIBRARIES: &[&str] = &[$($name),*];
    };
}

libraries!("glslang" "SPIRV" "MachineIndependent" "GenericCodeGen" "OSDependent" "OGLCompiler" "HLSL" "SPIRV-Tools-opt" "SPIRV-Tools" "stdc++");

/// A shader that is to be compiled: its file's name in OUT_DIR, and what it is compiled from; nothing where no such shader applies.
type Job = (String, Option<Source>);

macro_rules! registry {
    (
        streams { $($stream:ident = $pass:literal, $mode:ident, $rays:ident;)* }
        compute { $($compute:ident = $name:literal;)* }
        stages { $($stage:ident = $path:literal, $kind:ident;)* }
    ) => {
        pub fn jobs() -> Vec<Job> {
            let mut jobs = Vec::new();
            $(
                for variant in Variant::ALL {
                    let source = Source::Stream { pass: $pass, mode: mode!($mode), variant };
                    let file = format!("{}_{}_{variant:?}.spv", $pass, stringify!($mode));
                    jobs.push((file, variant.applies_to(rays!($rays)).then_some(source)));
                }
            )*
            $(
                for (int64, bits) in [(false, 32), (true, 64)] {
                    jobs.push((format!("{}_{bits}.spv", $name), Some(Source::Compute { pass: $name, int64 })));
                }
            )*
            $(jobs.push((concat!(stringify!($stage), ".spv").to_owned(), Some(Source::File { path: $path, stage: Stage::$kind })));)*
            jobs
        }
    };
}

include!("src/shaders/registry.rs");

#[cfg(feature = "probes")]
mod probes {
    use super::*;

    include!("tests/shaders/registry.rs");
}

/// Everything that is to be compiled.
fn all_jobs() -> Vec<Job> {
    let mut all = jobs();
    #[cfg(feature = "probes")]
    all.extend(probes::jobs());
    for (int64, bits) in [(false, 32), (true, 64)] {
        for (mode, name) in [(Mode::Any, "any"), (Mode::Closest, "closest")] {
            all.push((format!("wide_{name}_{bits}.spv"), Some(Source::Kernel { mode, int64 })));
        }
    }
    all
}

fn main() {
    for file in ["build.rs", "src/interface", "src/shaders/compiler.rs", "src/shaders/source.rs", "src/shaders/registry.rs"] {
        println!("cargo:rerun-if-changed={file}");
    }
    if cfg!(feature = "live-shaders") {
        if cfg!(not(feature = "build-shaderc")) {
            LIBRARIES.iter().for_each(|library| println!("cargo:rustc-link-lib={library}"));
        }
        return;
    }
    let manifest = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets it"));
    let shaders = manifest.join("shaders");
    println!("cargo:rerun-if-changed={}", shaders.display());
    if cfg!(feature = "probes") {
        println!("cargo:rerun-if-changed={}", manifest.join(source::PROBES).display());
    }
    let (included, mut errors) = compile(&all_jobs(), &manifest, &out);
    for file in included {
        println!("cargo:rerun-if-changed={}", file.display());
    }
    if !errors.is_empty() {
        errors.sort();
        for line in errors.iter().flat_map(|e| e.lines()) {
            println!("cargo:warning={line}");
        }
        eprintln!("{}", errors.join("\n"));
        std::process::exit(1);
    }
}

/// Compiles on all cores. Returns the files that were included, and what is wrong, in words.
fn compile(jobs: &[Job], manifest: &Path, out: &Path) -> (BTreeSet<PathBuf>, Vec<String>) {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let compiler = Compiler::new(&manifest.join("shaders"), source::made_files(interface::glsl::files(), manifest), out);
    let next = Mutex::new(jobs.iter());
    let results = Mutex::new((BTreeSet::new(), Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let Some((file, source)) = next.lock().expect("no compiler panics").next() else { break };
                    let compiled = source.as_ref().map(|s| compiler.compile(s));
                    let mut results = results.lock().expect("no compiler panics");
                    // what does not compile is empty, too, so that no second error follows
                    let mut spirv = Vec::new();
                    match compiled {
                        None => {}
                        Some(Ok(compiled)) => {
                            results.0.extend(compiled.included);
                            spirv = compiled.spirv;
                        }
                        Some(Err(error)) => results.1.push(error),
                    }
                    std::fs::write(out.join(file), spirv).expect("OUT_DIR can be written");
                }
            });
        }
    });
    results.into_inner().expect("no compiler panics")
}
