//! Compiles GLSL to SPIR-V, with a cache on disk: for build.rs, which compiles all shaders, and for
//! the feature `live-shaders`, which compiles them on demand.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::Command;

use shaderc::{
    CompileOptions, EnvVersion, IncludeType, OptimizationLevel, ResolvedInclude, ShaderKind, SpirvVersion, TargetEnv,
};
// what the linker needs besides
use shaderc_libraries as _;

use super::source::{Source, Stage};

/// A cache of SPIR-V on disk, shared by all build profiles and later runs: files `KEY.spv` in the
/// folder `target/spirv`. The key is a hash of the code with all includes, so that a change
/// recompiles only the shaders that include it, and one of comments none.
struct Cache {
    folder: PathBuf,
    // version of the compiler
    compiler: String,
}

/// Maximum number of cached shaders; the oldest are removed first.
const MAX_ENTRIES: usize = 1500;

/// Optimization takes three quarters of the compile time, so live shaders go without.
fn optimization(source: &Source) -> OptimizationLevel {
    if cfg!(feature = "live-shaders") || !source.is_optimized() {
        OptimizationLevel::Zero
    } else {
        OptimizationLevel::Performance
    }
}

/// Adds a text to a hash, but for comments and blank lines: without debug information SPIR-V knows
/// nothing of them.
fn hash_code(text: &str, hash: &mut DefaultHasher) {
    let code = text.lines().map(|line| line.split_once("//").map_or(line, |(code, _)| code).trim_end());
    code.filter(|line| !line.is_empty()).for_each(|line| line.hash(hash));
}

/// Compiles the shaders of one folder.
pub struct Compiler {
    shaders: PathBuf,
    // generated files, by name
    interface: BTreeMap<String, String>,
    cache: Option<Cache>,
}

/// A compiled shader.
pub struct Compiled {
    /// The SPIR-V, as bytes.
    pub spirv: Vec<u8>,
    /// The files that it includes.
    #[cfg_attr(feature = "live-shaders", allow(dead_code, reason = "build.rs alone tells cargo"))]
    pub included: BTreeSet<PathBuf>,
}

impl Compiler {
    /// `shaders`: the folder. `interface`: generated files, by name. `out`: OUT_DIR, from which the
    /// cache's folder follows. Without pkg-config, which tells the compiler's version, it has none.
    pub fn new(shaders: &Path, interface: Vec<(String, String)>, out: &Path) -> Self {
        Self { shaders: shaders.to_owned(), interface: interface.into_iter().collect(), cache: Cache::open(out) }
    }

    /// The text of an included file, and its path if it has one.
    fn read(&self, name: &str) -> Result<(String, Option<PathBuf>), String> {
        if let Some(text) = self.interface.get(name) {
            return Ok((text.clone(), None));
        }
        let path = self.shaders.join(name);
        let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok((text, Some(path)))
    }

    /// Compiles a shader, or reads it from the cache.
    ///
    /// # Errors
    /// The compiler's message, with the include chain of the first file that it names.
    pub fn compile(&self, source: &Source) -> Result<Compiled, String> {
        let text = source.text(&self.shaders)?;
        // `None` if an included file cannot be read: the compiler reports the error
        let (key, included) = self.key(&text, source).unzip();
        let path = self.cache.as_ref().zip(key).map(|(cache, key)| cache.path(&key));
        if let (Some(path), Some(included)) = (&path, included)
            && let Ok(spirv) = std::fs::read(path)
            && !spirv.is_empty()
        {
            return Ok(Compiled { spirv, included });
        }
        let compiled = self.run(source, &text)?;
        if let Some(path) = path {
            Cache::store(&path, &compiled.spirv);
        }
        Ok(compiled)
    }

    /// The key of a text with its includes, kind and options; and the included files.
    fn key(&self, text: &str, source: &Source) -> Option<(String, BTreeSet<PathBuf>)> {
        // two hashes of 64 bits
        let mut hashes = [DefaultHasher::new(), DefaultHasher::new()];
        hashes[1].write_u8(1);
        let mut add = |text: &str| hashes.iter_mut().for_each(|h| hash_code(text, h));
        add(&format!("{:?} {:?}", source.stage(), optimization(source)));
        let (mut names, mut paths, mut texts) = (BTreeSet::new(), BTreeSet::new(), vec![text.to_owned()]);
        while let Some(text) = texts.pop() {
            add(&text);
            for name in text.lines().filter_map(|l| l.trim_start().strip_prefix("#include \"")?.split('"').next()) {
                if names.insert(name.to_owned()) {
                    let (text, path) = self.read(name).ok()?;
                    texts.push(text);
                    paths.extend(path);
                }
            }
        }
        Some((hashes.iter().map(|h| format!("{:016x}", h.finish())).collect(), paths))
    }

    fn run(&self, source: &Source, text: &str) -> Result<Compiled, String> {
        // pairs of included and including file, for the include chain in error messages
        let chain: RefCell<Vec<(String, String)>> = RefCell::new(Vec::new());
        let included = RefCell::new(BTreeSet::new());
        let compiler = shaderc::Compiler::new().map_err(|e| format!("cannot start shaderc: {e}"))?;
        let mut options = CompileOptions::new().map_err(|e| format!("cannot start shaderc: {e}"))?;
        options.set_target_env(TargetEnv::Vulkan, EnvVersion::Vulkan1_3 as u32);
        options.set_target_spirv(SpirvVersion::V1_5);
        options.set_optimization_level(optimization(source));
        options.set_warnings_as_errors();
        options.set_include_callback(|requested, _: IncludeType, from, _| {
            let (content, path) = self.read(requested)?;
            included.borrow_mut().extend(path);
            chain.borrow_mut().push((requested.to_owned(), from.to_owned()));
            // glslang numbers lines per file and names the file through this
            Ok(ResolvedInclude { resolved_name: requested.to_owned(), content })
        });
        let kind = match source.stage() {
            Stage::Compute => ShaderKind::Compute,
            Stage::RayGeneration => ShaderKind::RayGeneration,
            Stage::Miss => ShaderKind::Miss,
            Stage::ClosestHit => ShaderKind::ClosestHit,
            Stage::AnyHit => ShaderKind::AnyHit,
            Stage::Intersection => ShaderKind::Intersection,
            Stage::Vertex => ShaderKind::Vertex,
            Stage::Fragment => ShaderKind::Fragment,
        };
        let result = compiler.compile_into_spirv(text, kind, &source.to_string(), "main", Some(&options));
        drop(options);
        match result {
            Ok(artifact) => Ok(Compiled { spirv: artifact.as_binary_u8().to_vec(), included: included.into_inner() }),
            Err(error) => Err(explain(source, &error.to_string(), &chain.borrow())),
        }
    }
}

impl Cache {
    fn open(out: &Path) -> Option<Self> {
        if cfg!(feature = "build-shaderc") {
            return None;
        }
        let version = Command::new("pkg-config").args(["--modversion", "shaderc", "SPIRV-Tools"]).output().ok()?;
        let compiler = version.status.success().then(|| String::from_utf8_lossy(&version.stdout).into_owned())?;
        // target/PROFILE/build/PACKAGE/out
        let folder = out.ancestors().nth(4)?.join("spirv");
        std::fs::create_dir_all(&folder).ok()?;
        let cache = Self { folder, compiler };
        cache.prune();
        Some(cache)
    }

    /// Removes the oldest entries beyond the maximum.
    fn prune(&self) {
        let Ok(entries) = std::fs::read_dir(&self.folder) else { return };
        let mut all: Vec<_> = entries
            .filter_map(|e| e.ok())
            .filter_map(|e| Some((e.metadata().ok()?.modified().ok()?, e.path())))
            .collect();
        all.sort();
        for (_, path) in all.iter().take(all.len().saturating_sub(MAX_ENTRIES)) {
            let _ = std::fs::remove_file(path);
        }
    }

    fn path(&self, key: &str) -> PathBuf {
        let mut hash = DefaultHasher::new();
        self.compiler.hash(&mut hash);
        hash_code(include_str!("compiler.rs"), &mut hash);
        self.folder.join(format!("{key}{:016x}.spv", hash.finish()))
    }

    /// Writes a temporary file and renames it, because other builds and programs may run at the
    /// same time. If it fails, the shader is compiled again next time.
    fn store(path: &Path, spirv: &[u8]) {
        let temporary = path.with_extension(std::process::id().to_string());
        if std::fs::write(&temporary, spirv).is_err() || std::fs::rename(&temporary, path).is_err() {
            let _ = std::fs::remove_file(&temporary);
        }
    }
}

/// Adds the include chain of the first file that the compiler's message names.
fn explain(source: &Source, text: &str, chain: &[(String, String)]) -> String {
    let mut message = format!("shader {source} does not compile:\n{text}");
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
