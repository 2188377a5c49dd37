//! Compiles every shader of src/shaders/registry.rs into OUT_DIR; not with the feature
//! `live-shaders`: then the program compiles what it needs when it runs. Before, it checks that the
//! records of src/interface lie for shaders where they lie for the program.

#[path = "src/shaders/compiler.rs"]
mod compiler;
#[path = "src/interface/mod.rs"]
#[allow(dead_code, unused_imports, reason = "the program uses the rest")]
mod interface;
#[cfg(feature = "probes")]
#[path = "tests/shaders/registry.rs"]
mod probes;
#[path = "src/shaders/registry.rs"]
mod registry;
#[path = "src/settings"]
mod settings {
    mod choices;
    pub(crate) use choices::choices;
}
#[path = "src/shaders/source.rs"]
#[allow(dead_code, reason = "the program uses the rest")]
mod source;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use compiler::Compiler;
use interface::layout::Reflected;
use rspirv::dr::{Instruction, Operand};
use rspirv::spirv::{Decoration, Op};
use source::Shader;

/// Lists all shaders that are to be compiled.
fn all_shaders() -> Vec<Shader> {
    let all = registry::list_shaders().into_iter();
    #[cfg(feature = "probes")]
    let all = all.chain(probes::list_shaders());
    all.collect()
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

/// What `skylit --version` says of the build, as variables that the program reads while it is
/// compiled: its features, and its commit.
///
/// Only builds with optimization (`--release`) know their commit. To follow it, cargo has to run
/// this program and compile everything after it again with each commit, which is right for what is
/// installed and too slow for whoever works on skylit.
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

/// The commit that is checked out, and its day; `None` without git, or if this folder is not the
/// root of a repository.
fn commit() -> Option<String> {
    let git = |arguments: &[&str]| {
        let out = std::process::Command::new("git").args(arguments).output().ok().filter(|o| o.status.success())?;
        Some(String::from_utf8(out.stdout).ok()?.trim().to_owned())
    };
    if !git(&["rev-parse", "--show-prefix"])?.is_empty() {
        return None;
    }
    // both change with each commit and checkout; one that is missing would have cargo build anew
    // every time
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
    // in the library the types of src/interface derive traits of packages that this program does
    // without
    println!("cargo:rustc-cfg=library");
    for file in [
        "build.rs",
        "src/interface",
        "src/settings/choices.rs",
        "src/shaders/compiler.rs",
        "src/shaders/source.rs",
        "src/shaders/registry.rs",
    ] {
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
    let shaders = all_shaders();
    let (included, mut errors) = compile(&shaders, &manifest, &out);
    for file in included {
        println!("cargo:rerun-if-changed={}", file.display());
    }
    write_table(&shaders, &out);
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

/// Writes the table of SPIR-V by name that src/shaders/mod.rs includes, an expression.
fn write_table(shaders: &[Shader], out: &Path) {
    let names: BTreeSet<String> = shaders.iter().map(|s| s.source().file_name()).collect();
    let mut table = "&[\n".to_owned();
    for name in names {
        let _ = writeln!(table, "    (\"{name}\", include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{name}.spv\"))),");
    }
    std::fs::write(out.join("spirv.rs"), table + "]\n").expect("OUT_DIR can be written");
}

/// Compiles on all cores. Returns the files that were included, and what is wrong, in words.
fn compile(shaders: &[Shader], manifest: &Path, out: &Path) -> (BTreeSet<PathBuf>, Vec<String>) {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let compiler =
        Compiler::new(&manifest.join("shaders"), source::generated_files(interface::glsl::files(), manifest), out);
    let next = Mutex::new(shaders.iter());
    let results = Mutex::new((BTreeSet::new(), Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let Some(shader) = next.lock().expect("no compiler panics").next() else { break };
                    let compiled = compiler.compile(shader.source());
                    let mut results = results.lock().expect("no compiler panics");
                    // what does not compile is empty, so that no second error follows
                    let mut spirv = Vec::new();
                    match compiled {
                        Ok(compiled) => {
                            results.0.extend(compiled.included);
                            spirv = compiled.spirv;
                        }
                        Err(error) => results.1.push(error),
                    }
                    std::fs::write(out.join(shader.source().file_name() + ".spv"), spirv)
                        .expect("OUT_DIR can be written");
                }
            });
        }
    });
    results.into_inner().expect("no compiler panics")
}
