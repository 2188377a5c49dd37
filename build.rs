//! Compiles the shaders: each pass's stream once per tracer and mode, and the shaders that the tracers share.
//!
//! A pass is a file `shaders/NAME.glsl` whose head says `// stream: any`, `// stream: closest` or both; `// rays: queue` besides
//! when the rays are in memory before it begins, `// rays: coherent` when they are the camera's: neighbours go much the
//! same way (packets pay), and what they meet can be drawn instead of traced, where there is one a pixel. The generated `shaders.rs` holds a constant `NAME_ANY` / `NAME_CLOSEST` for each
//! (see `src/tracer/stream.rs`). `// compute` instead: a compute shader that traces nothing, as the constant `NAME`.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

use shaderc::{
    CompileOptions, Compiler, EnvVersion, IncludeType, OptimizationLevel, ResolvedInclude, ShaderKind, SpirvVersion, TargetEnv,
};

// Debian's libshaderc_combined.a leaves glslang and SPIRV-Tools out; their order is that of their dependencies.
#[cfg(not(feature = "build-shaderc"))]
#[link(name = "glslang")]
#[link(name = "SPIRV")]
#[link(name = "MachineIndependent")]
#[link(name = "GenericCodeGen")]
#[link(name = "OSDependent")]
#[link(name = "OGLCompiler")]
#[link(name = "HLSL")]
#[link(name = "SPIRV-Tools-opt")]
#[link(name = "SPIRV-Tools")]
#[link(name = "stdc++")]
unsafe extern "C" {}

/// Threads of a work-group of a stream.
const LANES: u32 = 64;

/// Runs of work-groups of streams that follow each other take runs of parts of a dispatch that are so far apart (shaders/trace/spread.glsl).
const SPREAD: u32 = 16;

/// Work-groups that take neighbouring parts, where a part is a ray for each lane: memory is fetched ahead.
const RUN: u32 = 4;

const EXTENSIONS: &str = "#extension GL_EXT_buffer_reference : require\n#extension GL_EXT_buffer_reference_uvec2 : require\n\
                          #extension GL_EXT_control_flow_attributes : require\n";

/// What was compiled before, by what it was compiled from: the other profiles' builds find theirs here, and a change compiles anew only what includes it.
/// A file `KEY.spv` each, in the folder `spirv` beside the profiles'.
struct Cache {
    folder: PathBuf,
    // whose words they are
    compiler: String,
}

/// More shaders than this are not kept; the oldest go first.
const MOST_KEPT: usize = 1500;

impl Cache {
    /// `None`: nobody says which compiler this is, or the folder cannot be made. Then all is compiled, every time.
    fn open(out: &Path) -> Option<Self> {
        if std::env::var_os("CARGO_FEATURE_BUILD_SHADERC").is_some() {
            return None;
        }
        let said = Command::new("pkg-config").args(["--modversion", "shaderc", "SPIRV-Tools"]).output().ok()?;
        let compiler = said.status.success().then(|| String::from_utf8_lossy(&said.stdout).into_owned())?;
        // target/PROFILE/build/PACKAGE/out
        let folder = out.ancestors().nth(4)?.join("spirv");
        std::fs::create_dir_all(&folder).ok()?;
        Some(Self { folder, compiler })
    }

    /// Where a job's SPIR-V is or will be, and the files that it includes. `None` where one of them cannot be read: the compiler says it better.
    fn find(&self, job: &Job, shaders: &Path) -> Option<(PathBuf, BTreeSet<PathBuf>)> {
        // two numbers of 64 bits
        let mut hashes = [DefaultHasher::new(), DefaultHasher::new()];
        hashes[1].write_u8(1);
        let mut tell = |text: &str| hashes.iter_mut().for_each(|h| text.hash(h));
        tell(&self.compiler);
        tell(include_str!("build.rs"));
        tell(&format!("{:?}", job.kind));
        let (mut seen, mut texts) = (BTreeSet::new(), vec![job.source.clone()]);
        while let Some(text) = texts.pop() {
            tell(&text);
            for name in text.lines().filter_map(|l| l.trim_start().strip_prefix("#include \"")?.split('"').next()) {
                let path = shaders.join(name);
                if !seen.contains(&path) {
                    texts.push(std::fs::read_to_string(&path).ok()?);
                    seen.insert(path);
                }
            }
        }
        let key: String = hashes.iter().map(|h| format!("{:016x}", h.finish())).collect();
        Some((self.folder.join(key + ".spv"), seen))
    }

    /// Beside, then renamed: builds of two profiles may run at once. What fails is compiled again next time.
    fn keep(place: &Path, spirv: &[u8]) {
        let beside = place.with_extension(std::process::id().to_string());
        if std::fs::write(&beside, spirv).is_err() || std::fs::rename(&beside, place).is_err() {
            let _ = std::fs::remove_file(&beside);
        }
    }

    fn prune(&self) {
        let Ok(entries) = std::fs::read_dir(&self.folder) else { return };
        let mut all: Vec<_> =
            entries.filter_map(|e| e.ok()).filter_map(|e| Some((e.metadata().ok()?.modified().ok()?, e.path()))).collect();
        all.sort();
        for (_, path) in all.iter().take(all.len().saturating_sub(MOST_KEPT)) {
            let _ = std::fs::remove_file(path);
        }
    }
}

struct Build {
    shaders: PathBuf,
    jobs: Vec<Job>,
    errors: Vec<String>,
}

/// A shader to be compiled.
struct Job {
    source: String,
    kind: ShaderKind,
    name: String,
    // file name
    output: String,
}

/// How a tracer turns a stream into a shader.
struct Variant {
    field: &'static str,
    template: &'static str,
    head: &'static str,
    kind: ShaderKind,
}

/// Loads and stores of 64 bits, where the device has such integers.
const HEAD_64: &str = "#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require\n#define LOAD64\n";

/// Subgroup ballots besides: one atomic for all lanes that append to a queue.
const HEAD_64_BALLOT: &str = "#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require\n#define LOAD64\n\
     #extension GL_KHR_shader_subgroup_ballot : require\n#define BALLOT\n";

/// What a packet's lanes share.
const HEAD_PACKET: &str = "#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require\n#define LOAD64\n\
     #extension GL_KHR_shader_subgroup_ballot : require\n#define BALLOT\n\
     #extension GL_KHR_shader_subgroup_arithmetic : require\n#extension GL_EXT_control_flow_attributes : require\n\
     #define PACKET_RAYS 2\n";

const VARIANTS: [Variant; 10] = [
    Variant { field: "generate", template: "trace/generate.glsl", head: "", kind: ShaderKind::Compute },
    Variant { field: "generate_64", template: "trace/generate.glsl", head: HEAD_64_BALLOT, kind: ShaderKind::Compute },
    Variant { field: "deliver", template: "trace/deliver.glsl", head: "", kind: ShaderKind::Compute },
    Variant { field: "deliver_64", template: "trace/deliver.glsl", head: HEAD_64_BALLOT, kind: ShaderKind::Compute },
    Variant { field: "packet", template: "trace/packet.glsl", head: HEAD_PACKET, kind: ShaderKind::Compute },
    Variant { field: "reference", template: "trace/reference.glsl", head: "", kind: ShaderKind::Compute },
    Variant { field: "brute", template: "trace/brute.glsl", head: "", kind: ShaderKind::Compute },
    Variant {
        field: "query",
        template: "trace/query.glsl",
        head: "#extension GL_EXT_ray_query : require\n",
        kind: ShaderKind::Compute,
    },
    Variant {
        field: "raygen",
        template: "trace/pipeline.glsl",
        head: "#extension GL_EXT_ray_tracing : require\n",
        kind: ShaderKind::RayGeneration,
    },
    Variant { field: "visibility", template: "trace/visibility.glsl", head: "", kind: ShaderKind::Compute },
];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let manifest = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let mut build = Build { shaders: manifest.join("shaders"), jobs: Vec::new(), errors: Vec::new() };
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets it"));
    let table = build.streams() + &build.kernels() + &build.shared();
    std::fs::write(out.join("shaders.rs"), table).expect("OUT_DIR can be written");
    println!("cargo:rerun-if-changed={}", build.shaders.display());
    for file in build.compile(&out) {
        println!("cargo:rerun-if-changed={}", file.display());
    }
    if !build.errors.is_empty() {
        for line in build.errors.iter().flat_map(|e| e.lines()) {
            println!("cargo:warning={line}");
        }
        eprintln!("{}", build.errors.join("\n"));
        std::process::exit(1);
    }
}

impl Build {
    /// All passes, for all tracers.
    fn streams(&mut self) -> String {
        let mut table = String::new();
        let mut files: Vec<_> = std::fs::read_dir(&self.shaders)
            .expect("shaders/ is there")
            .filter_map(|e| e.ok().map(|e| e.path()))
            .filter(|p| p.extension().is_some_and(|e| e == "glsl"))
            .collect();
        files.sort();
        for file in files {
            let name = file.file_stem().and_then(|s| s.to_str()).expect("shader names are plain").to_owned();
            let text = std::fs::read_to_string(&file).expect("a shader can be read");
            if text.lines().any(|l| l == "// compute") {
                let constant = name.to_uppercase();
                let _ = write!(
                    table,
                    "/// `shaders/{name}.glsl`, which traces nothing.\npub static {constant}: ComputeShader = ComputeShader {{\n    name: \"{name}\",\n"
                );
                for (field, head) in [("plain", ""), ("int64", HEAD_64)] {
                    let source = format!("#version 460\n{EXTENSIONS}{head}#define LANES {LANES}\n#include \"{name}.glsl\"\n");
                    let output = format!("{name}_{field}.spv");
                    self.add(source, ShaderKind::Compute, &format!("{name}.glsl"), &output);
                    let _ = writeln!(table, "    {field}: include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{output}\")),");
                }
                table.push_str("};\n");
                continue;
            }
            let Some(modes) = text.lines().find_map(|l| l.strip_prefix("// stream:")) else {
                self.errors.push(format!(
                    "{}: no line '// stream: any', '// stream: closest' or '// compute' at its head",
                    file.display()
                ));
                continue;
            };
            // what traces rays in memory needs no step that puts them there
            let queue = text.lines().any(|l| l == "// rays: queue");
            // neighbouring rays take nearly the same way: packets pay
            let coherent = text.lines().any(|l| l == "// rays: coherent");
            for mode in modes.split_whitespace() {
                let constant = format!("{}_{}", name.to_uppercase(), mode.to_uppercase());
                let _ = write!(
                    table,
                    "/// The stream `shaders/{name}.glsl`, mode `{mode}`.\npub static {constant}: StreamShaders = StreamShaders {{\n    name: \"{name} {mode}\",\n    pass: \"{name}\",\n    steps: [\"{name} generate\", \"{name} trace\", \"{name} deliver\"],\n    queue: {queue},\n    coherent: {coherent},\n    mode: Mode::{},\n",
                    if mode == "any" { "Any" } else { "Closest" }
                );
                for v in &VARIANTS {
                    // only what camera rays meet can be drawn
                    let drawn = v.field != "visibility" || coherent && mode == "closest";
                    if !drawn || queue && ["generate", "generate_64", "packet"].contains(&v.field) {
                        let _ = writeln!(table, "    {}: &[],", v.field);
                        continue;
                    }
                    let define = if mode == "any" { "#define STREAM_ANY\n" } else { "#define STREAM_CLOSEST\n" };
                    let source = format!(
                        "#version 460\n{EXTENSIONS}{}#define LANES {LANES}\n#define SPREAD {SPREAD}u\n#define RUN {RUN}u\n{define}#include \"{name}.glsl\"\n#include \"{}\"\n",
                        v.head, v.template
                    );
                    let output = format!("{name}_{mode}_{}.spv", v.field);
                    self.add(source, v.kind, &format!("{name}.glsl as {} ({mode})", v.template), &output);
                    let _ = writeln!(table, "    {}: include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{output}\")),", v.field);
                }
                table.push_str("};\n");
            }
        }
        let _ = writeln!(
            table,
            "/// Threads of a work-group of a stream.\npub const LANES: u32 = {LANES};\n/// Runs of work-groups are so far apart in a dispatch.\nconst SPREAD: u32 = {SPREAD};\n/// Work-groups of such a run.\nconst RUN: u32 = {RUN};"
        );
        table
    }

    /// The compute tracer's fast kernel: no stream's code is in it.
    fn kernels(&mut self) -> String {
        let mut table = String::new();
        for mode in ["any", "closest"] {
            for (bits, head) in [(32, ""), (64, HEAD_64)] {
                let source = format!(
                    "#version 460\n{EXTENSIONS}{head}#define LANES {LANES}\n#define SPREAD {SPREAD}u\n#define RUN {RUN}u\n\
                     #define STREAM_{}\n#include \"trace/wide.glsl\"\n",
                    mode.to_uppercase()
                );
                let (constant, output) = (format!("WIDE_{}_{bits}", mode.to_uppercase()), format!("wide_{mode}_{bits}.spv"));
                self.add(source, ShaderKind::Compute, &format!("trace/wide.glsl ({mode}, {bits}-bit loads)"), &output);
                let _ = writeln!(
                    table,
                    "/// `shaders/trace/wide.glsl`, mode `{mode}`, {bits}-bit loads.\npub static {constant}: &[u8] = include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{output}\"));"
                );
            }
        }
        table
    }

    /// The shaders that every stream of the pipeline tracer shares, and those that draw.
    fn shared(&mut self) -> String {
        let mut table = String::new();
        for (constant, file, kind) in [
            ("MISS", "trace/miss.rmiss", ShaderKind::Miss),
            ("TRIANGLE_CLOSEST", "trace/triangle.rchit", ShaderKind::ClosestHit),
            ("TRIANGLE_ANY", "trace/triangle.rahit", ShaderKind::AnyHit),
            ("SPHERE_CLOSEST", "trace/sphere.rchit", ShaderKind::ClosestHit),
            ("SPHERE_INTERSECTION", "trace/sphere.rint", ShaderKind::Intersection),
            ("DRAW_TRIANGLES", "raster/triangle.vert", ShaderKind::Vertex),
            ("DRAW_OPAQUE", "raster/opaque.frag", ShaderKind::Fragment),
            ("DRAW_ALPHA", "raster/alpha.frag", ShaderKind::Fragment),
            ("DRAW_SPHERES", "raster/sphere.vert", ShaderKind::Vertex),
            ("DRAW_SPHERE", "raster/sphere.frag", ShaderKind::Fragment),
        ] {
            let path = self.shaders.join(file);
            let source = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            let output = format!("{}.spv", constant.to_lowercase());
            self.add(source, kind, file, &output);
            let _ = writeln!(
                table,
                "/// `shaders/{file}`.\npub static {constant}: &[u8] = include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{output}\"));"
            );
        }
        table
    }

    fn add(&mut self, source: String, kind: ShaderKind, name: &str, output: &str) {
        self.jobs.push(Job { source, kind, name: name.to_owned(), output: output.to_owned() });
    }

    /// Compiles all shaders, on all cores, and says which files they included.
    fn compile(&mut self, out: &Path) -> BTreeSet<PathBuf> {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let (jobs, shaders) = (Mutex::new(self.jobs.iter()), &self.shaders);
        let results = Mutex::new((BTreeSet::new(), Vec::new()));
        let cache = Cache::open(out);
        std::thread::scope(|scope| {
            for _ in 0..threads {
                scope.spawn(|| {
                    let compiler = Compiler::new().unwrap_or_else(|e| panic!("shaderc does not start: {e}"));
                    loop {
                        let Some(job) = jobs.lock().expect("no compiler panics").next() else { break };
                        let (seen, error) = job.make(&compiler, shaders, out, cache.as_ref());
                        let mut results = results.lock().expect("no compiler panics");
                        results.0.extend(seen);
                        results.1.extend(error);
                    }
                });
            }
        });
        if let Some(cache) = &cache {
            cache.prune();
        }
        let (seen, mut errors) = results.into_inner().expect("no compiler panics");
        errors.sort();
        self.errors.extend(errors);
        seen
    }
}

impl Job {
    /// Takes it from the cache, or compiles it. Returns the files that were included, and what is wrong, in words.
    fn make(
        &self,
        compiler: &Compiler,
        shaders: &Path,
        out: &Path,
        cache: Option<&Cache>,
    ) -> (BTreeSet<PathBuf>, Option<String>) {
        let found = cache.and_then(|c| c.find(self, shaders));
        let output = out.join(&self.output);
        if let Some((place, seen)) = &found
            && let Ok(spirv) = std::fs::read(place)
        {
            std::fs::write(&output, spirv).expect("OUT_DIR can be written");
            return (seen.clone(), None);
        }
        let (seen, error) = self.compile(compiler, shaders, out);
        if let (Some((place, _)), None) = (&found, &error) {
            Cache::keep(place, &std::fs::read(&output).expect("it was written"));
        }
        (seen, error)
    }

    /// Returns the files that were included, and what is wrong, in words.
    fn compile(&self, compiler: &Compiler, shaders: &Path, out: &Path) -> (BTreeSet<PathBuf>, Option<String>) {
        // who included what, to name the chain when a file does not compile
        let chain: RefCell<Vec<(String, String)>> = RefCell::new(Vec::new());
        let seen = RefCell::new(BTreeSet::new());
        let mut options = CompileOptions::new().expect("options can be made");
        options.set_target_env(TargetEnv::Vulkan, EnvVersion::Vulkan1_3 as u32);
        options.set_target_spirv(SpirvVersion::V1_5);
        options.set_optimization_level(OptimizationLevel::Performance);
        options.set_warnings_as_errors();
        options.set_include_callback(|requested, _: IncludeType, from, _| {
            let path = shaders.join(requested);
            let content = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
            seen.borrow_mut().insert(path);
            chain.borrow_mut().push((requested.to_owned(), from.to_owned()));
            // glslang numbers lines per file and names the file through this
            Ok(ResolvedInclude { resolved_name: requested.to_owned(), content })
        });
        let result = compiler.compile_into_spirv(&self.source, self.kind, &self.name, "main", Some(&options));
        drop(options);
        let error = match result {
            Ok(artifact) => {
                std::fs::write(out.join(&self.output), artifact.as_binary_u8()).expect("OUT_DIR can be written");
                None
            }
            Err(error) => {
                // so that the table's include_bytes! does not add a second, misleading error
                let _ = std::fs::write(out.join(&self.output), []);
                Some(self.explain(&error.to_string(), &chain.borrow()))
            }
        };
        (seen.into_inner(), error)
    }

    /// The compiler's words, and how the file that the first of them names came in.
    fn explain(&self, text: &str, chain: &[(String, String)]) -> String {
        let mut message = format!("shader {} does not compile:\n{text}", self.name);
        if let Some(mut file) =
            text.lines().find_map(|l| chain.iter().find(|c| l.starts_with(&format!("{}:", c.0))).map(|c| c.0.clone()))
        {
            while let Some((_, from)) = chain.iter().find(|c| c.0 == file) {
                let _ = write!(message, "\n  {file} was included from {from}");
                file = from.clone();
            }
        }
        message
    }
}
