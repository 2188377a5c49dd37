//! Compiles every shader of src/shaders/registry.rs into OUT_DIR; not with the feature `live-shaders`: then the program compiles what it needs when it
//! runs. Before, it checks that the records of src/interface lie for shaders where they lie for the program.

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

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use compiler::Compiler;
use interface::layout::Reflected;
use rspirv::dr::{Instruction, Operand};
use rspirv::spirv::{Decoration, Op};
use source::{Mode, Rays, Source, Stage, Variant, mode, rays};

/// A shader that is to be compiled: its file's name in OUT_DIR, and what it is compiled from; nothing where no such shader applies.
type Job = (String, Option<Source>);

/// The two variants of a pass that traces no rays.
fn compute_jobs(pass: &'static str) -> [Job; 2] {
    [(false, 32), (true, 64)].map(|(int64, bits)| (format!("{pass}_{bits}.spv"), Some(Source::Compute { pass, int64 })))
}

macro_rules! debug_view_jobs {
    ($($(#[doc = $doc:literal])+ $view:ident = $name:literal, $glsl:literal, mod $module:ident, shader $shader:ident;)*) => {
        [$(compute_jobs($name)),*].concat()
    };
}

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
            $(jobs.extend(compute_jobs($name));)*
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
    all.extend(interface::debug_views::debug_views!(debug_view_jobs));
    #[cfg(feature = "probes")]
    all.extend(probes::jobs());
    for (ballot, bits) in [(false, 32), (true, 64)] {
        for (mode, name) in [(Mode::Any, "any"), (Mode::Closest, "closest")] {
            all.push((format!("wide_{name}_{bits}.spv"), Some(Source::Kernel { mode, ballot })));
        }
    }
    all
}

/// Fails the build where a record lies elsewhere for shaders than for the program.
fn check_records() -> Result<(), Vec<String>> {
    let failed = |what: String| vec![format!("the check of records: {what}")];
    let compiler = shaderc::Compiler::new().map_err(|e| failed(e.to_string()))?;
    let mut options = shaderc::CompileOptions::new().map_err(|e| failed(e.to_string()))?;
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
    options.set_target_spirv(shaderc::SpirvVersion::V1_5);
    // names stay, and what nothing uses
    options.set_optimization_level(shaderc::OptimizationLevel::Zero);
    let text = interface::glsl::check_shader();
    let kind = shaderc::ShaderKind::Compute;
    let spirv = compiler
        .compile_into_spirv(&text, kind, "the check shader of src/interface", "main", Some(&options))
        .map_err(|e| failed(e.to_string()))?;
    let module = rspirv::dr::load_words(spirv.as_binary()).map_err(|e| failed(e.to_string()))?;
    let records = interface::records::FILES.iter().flat_map(|f| f.records);
    match interface::layout::mismatches(records, &reflect(&module)) {
        mismatches if mismatches.is_empty() => Ok(()),
        mismatches => Err(mismatches),
    }
}

/// The structures of a module, as the compiler laid them out.
fn reflect(module: &rspirv::dr::Module) -> Vec<Reflected> {
    let layout = Layout::new(module);
    let mut out = Vec::new();
    for (&id, name) in &layout.names {
        let Some(fields) = layout.types.get(&id).filter(|t| t.class.opcode == Op::TypeStruct) else { continue };
        let member = |(k, field): (usize, &Operand)| {
            let name = layout.member_names.get(&(id, k as u32)).cloned().unwrap_or_default();
            (name, layout.offsets.get(&(id, k as u32)).map_or(0, |&o| o as usize), layout.size(field.unwrap_id_ref()))
        };
        let members = fields.operands.iter().enumerate().map(member).collect();
        let array = |t: &&&Instruction| {
            matches!(t.class.opcode, Op::TypeArray | Op::TypeRuntimeArray) && t.operands[0] == Operand::IdRef(id)
        };
        let array = layout.types.values().find(array).and_then(|t| layout.strides.get(&t.result_id?));
        out.push(Reflected { name: name.clone(), members, stride: array.map(|&s| s as usize) });
    }
    out
}

/// What a module says of its types, by their ids; members by their numbers besides.
#[derive(Default)]
struct Layout<'m> {
    types: BTreeMap<u32, &'m Instruction>,
    names: BTreeMap<u32, String>,
    member_names: BTreeMap<(u32, u32), String>,
    offsets: BTreeMap<(u32, u32), u32>,
    strides: BTreeMap<u32, u32>,
}

impl<'m> Layout<'m> {
    fn new(module: &'m rspirv::dr::Module) -> Self {
        let mut out = Self::default();
        out.types.extend(module.types_global_values.iter().filter_map(|t| Some((t.result_id?, t))));
        for i in module.debug_names.iter().chain(&module.annotations) {
            match (i.class.opcode, i.operands.as_slice()) {
                (Op::Name, [Operand::IdRef(id), Operand::LiteralString(name)]) => {
                    out.names.insert(*id, name.clone());
                }
                (Op::MemberName, [Operand::IdRef(id), Operand::LiteralBit32(k), Operand::LiteralString(name)]) => {
                    out.member_names.insert((*id, *k), name.clone());
                }
                (
                    Op::MemberDecorate,
                    [
                        Operand::IdRef(id),
                        Operand::LiteralBit32(k),
                        Operand::Decoration(Decoration::Offset),
                        Operand::LiteralBit32(n),
                    ],
                ) => {
                    out.offsets.insert((*id, *k), *n);
                }
                (
                    Op::Decorate,
                    [Operand::IdRef(id), Operand::Decoration(Decoration::ArrayStride), Operand::LiteralBit32(n)],
                ) => {
                    out.strides.insert(*id, *n);
                }
                _ => {}
            }
        }
        out
    }

    /// Bytes of a type; of a structure up to the end of its last member.
    fn size(&self, id: u32) -> usize {
        let Some(t) = self.types.get(&id) else { return 0 };
        match (t.class.opcode, t.operands.as_slice()) {
            (Op::TypeInt | Op::TypeFloat, [Operand::LiteralBit32(bits), ..]) => *bits as usize / 8,
            (Op::TypeVector, [Operand::IdRef(of), Operand::LiteralBit32(n)]) => self.size(*of) * *n as usize,
            (Op::TypeArray, [_, Operand::IdRef(count)]) => {
                let count = self.types.get(count).map(|c| c.operands[0].clone());
                let stride = self.strides.get(&id).copied().unwrap_or(0);
                if let Some(Operand::LiteralBit32(n)) = count { (n * stride) as usize } else { 0 }
            }
            (Op::TypeStruct, [.., last]) => {
                let offset = self.offsets.get(&(id, t.operands.len() as u32 - 1)).copied().unwrap_or(0);
                offset as usize + self.size(last.unwrap_id_ref())
            }
            _ => 0,
        }
    }
}

/// What `skylit --version` says of the build, as variables that the program reads while it is compiled: its features, and its commit.
///
/// Only builds with optimization (`--release`) know their commit. To follow it, cargo has to run this program and compile everything after it again with
/// each commit, which is right for what is installed and too slow for whoever works on skylit.
fn describe_build() {
    let features = std::env::vars().filter_map(|(name, _)| {
        let name = name.strip_prefix("CARGO_FEATURE_")?.to_lowercase().replace('_', "-");
        (name != "default").then_some(name)
    });
    let features: Vec<_> = features.collect::<BTreeSet<_>>().into_iter().collect();
    println!("cargo:rustc-env=SKYLIT_BUILD_FEATURES={}", features.join(", "));
    println!("cargo:rerun-if-env-changed=SKYLIT_COMMIT");
    let given = std::env::var("SKYLIT_COMMIT").ok().filter(|c| !c.is_empty());
    let is_release = std::env::var("PROFILE").is_ok_and(|p| p == "release");
    let commit = match given {
        Some(commit) => commit,
        None if is_release => commit().unwrap_or_else(|| "unknown: built without git".into()),
        None => "not recorded in builds of the profile dev".into(),
    };
    println!("cargo:rustc-env=SKYLIT_BUILD_COMMIT={commit}");
}

/// The commit that is checked out, and its day; `None` without git, or if this folder is not the root of a repository.
fn commit() -> Option<String> {
    let git = |arguments: &[&str]| {
        let out = std::process::Command::new("git").args(arguments).output().ok().filter(|o| o.status.success())?;
        Some(String::from_utf8(out.stdout).ok()?.trim().to_owned())
    };
    if !git(&["rev-parse", "--show-prefix"])?.is_empty() {
        return None;
    }
    // both change with each commit and checkout; one that is missing would have cargo build anew every time
    for name in ["HEAD", "logs/HEAD"] {
        let path = git(&["rev-parse", "--git-path", name])?;
        if Path::new(&path).exists() {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    git(&["log", "-1", "--format=%h (%cs)", "--abbrev=12"])
}

fn main() {
    describe_build();
    for file in ["build.rs", "src/interface", "src/shaders/compiler.rs", "src/shaders/source.rs", "src/shaders/registry.rs"] {
        println!("cargo:rerun-if-changed={file}");
    }
    if let Err(mismatches) = check_records() {
        fail(&mismatches);
    }
    if cfg!(feature = "live-shaders") {
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
        fail(&errors);
    }
}

fn fail(errors: &[String]) -> ! {
    for line in errors.iter().flat_map(|e| e.lines()) {
        println!("cargo:warning={line}");
    }
    eprintln!("{}", errors.join("\n"));
    std::process::exit(1);
}

/// Compiles on all cores. Returns the files that were included, and what is wrong, in words.
fn compile(jobs: &[Job], manifest: &Path, out: &Path) -> (BTreeSet<PathBuf>, Vec<String>) {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let compiler = Compiler::new(&manifest.join("shaders"), source::generated_files(interface::glsl::files(), manifest), out);
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
