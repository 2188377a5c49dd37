//! Sources of shaders: a tracer's template and a pass make one text.

use std::fmt;
use std::path::Path;
use std::sync::OnceLock;

/// Invocations per workgroup of a stream.
pub const LANES: u32 = 64;

/// Number of distant parts of a dispatch from which runs of workgroups take their work.
pub const SPREAD: u32 = 16;

/// Consecutive workgroups that take neighbouring work, one ray per invocation each: a prefetch.
pub const RUN: u32 = 4;

/// Rays per invocation of a packet.
pub const PACKET_RAYS: u32 = 2;

const EXTENSIONS: &str = "#extension GL_EXT_buffer_reference : require\n#extension GL_EXT_buffer_reference_uvec2 : require\n\
                          #extension GL_EXT_control_flow_attributes : require\n";

/// Enables loads and stores of 64 bits, for devices with 64-bit integers.
const HEAD_64: &str = "#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require\n#define LOAD64\n";

/// Enables subgroup ballots: one atomic operation for all invocations that append to a queue.
const HEAD_BALLOT: &str = "#extension GL_KHR_shader_subgroup_ballot : require\n#define BALLOT\n";

/// The answer that a stream gives to each of its rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Whether a ray is occluded.
    Any,
    /// The closest hit.
    Closest,
}

impl Mode {
    fn define(self) -> &'static str {
        match self {
            Mode::Any => "#define STREAM_ANY\n",
            Mode::Closest => "#define STREAM_CLOSEST\n",
        }
    }

    fn name(self) -> &'static str {
        match self {
            Mode::Any => "any",
            Mode::Closest => "closest",
        }
    }
}

/// Source of a stream's rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rays {
    /// The pass generates them.
    Generated,
    /// The pass generates coherent rays: neighbours are traced as packets.
    Camera,
    /// As [`Rays::Camera`]; or primary visibility is rasterized instead.
    CameraOrRasterized,
    /// As [`Rays::Camera`]; or another pass has traced them, and the hits are in memory.
    CameraOrKnown,
    /// They are in memory before the pass begins.
    Queue,
}

impl Rays {
    /// Returns true for rays of which neighbours are alike.
    pub fn are_coherent(self) -> bool {
        matches!(self, Self::Camera | Self::CameraOrRasterized | Self::CameraOrKnown)
    }
}

/// Kind of a shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "Vulkan's own names")]
pub enum Stage {
    Compute,
    RayGeneration,
    Miss,
    ClosestHit,
    AnyHit,
    Intersection,
    Vertex,
    Fragment,
}

/// How a tracer turns a stream into a shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// Compute tracer: generates rays into memory.
    Generate,
    /// As [`Variant::Generate`], for devices with 64-bit integers and subgroup ballots.
    Generate64,
    /// Compute tracer: passes hits to the pass's callback; for every tracer hits that another pass
    /// has found.
    Deliver,
    /// As [`Variant::Deliver`], for devices with 64-bit integers and subgroup ballots.
    Deliver64,
    /// Compute tracer: traces the rays of a subgroup together.
    Packet,
    /// Query tracer.
    Query,
    /// Pipeline tracer.
    Raygen,
    /// No tracer: reads a rasterized visibility buffer.
    Visibility,
}

impl Variant {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Generate,
        Self::Generate64,
        Self::Deliver,
        Self::Deliver64,
        Self::Packet,
        Self::Query,
        Self::Raygen,
        Self::Visibility,
    ];

    /// Returns true if streams with this source of rays have this variant.
    pub fn applies_to(self, rays: Rays) -> bool {
        match self {
            Self::Generate | Self::Generate64 | Self::Packet => rays != Rays::Queue,
            Self::Visibility => rays == Rays::CameraOrRasterized,
            _ => true,
        }
    }

    fn template(self) -> &'static str {
        match self {
            Self::Generate | Self::Generate64 => "trace/generate.glsl",
            Self::Deliver | Self::Deliver64 => "trace/deliver.glsl",
            Self::Packet => "trace/packet.glsl",
            Self::Query => "trace/query.glsl",
            Self::Raygen => "trace/pipeline.glsl",
            Self::Visibility => "trace/visibility.glsl",
        }
    }

    fn head(self) -> String {
        match self {
            Self::Generate64 | Self::Deliver64 => format!("{HEAD_64}{HEAD_BALLOT}"),
            Self::Packet => format!(
                "#define KEEPS_CORNERS\n{HEAD_64}{HEAD_BALLOT}#extension GL_KHR_shader_subgroup_arithmetic : require\n#define PACKET_RAYS {PACKET_RAYS}\n"
            ),
            Self::Query => "#extension GL_EXT_ray_query : require\n".into(),
            Self::Raygen => "#extension GL_EXT_ray_tracing : require\n".into(),
            _ => String::new(),
        }
    }
}

/// Folder of the test shaders of the feature `probes`; they include files of shaders/.
#[cfg_attr(not(feature = "live-shaders"), allow(dead_code, reason = "a program that has SPIR-V compiles nothing"))]
pub const PROBES: &str = "tests/shaders";

/// Files that shaders include and that are not in shaders/: generated ones, and with the feature
/// `probes` those of the tests. `manifest`: the source tree.
#[cfg_attr(not(feature = "live-shaders"), allow(dead_code, reason = "a program that has SPIR-V compiles nothing"))]
pub fn generated_files(mut made: Vec<(String, String)>, manifest: &Path) -> Vec<(String, String)> {
    if cfg!(feature = "probes") {
        // the compiler reports files that cannot be read
        for entry in std::fs::read_dir(manifest.join(PROBES)).into_iter().flatten().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            if name.ends_with(".glsl")
                && let Ok(text) = std::fs::read_to_string(entry.path())
            {
                made.push((name, text));
            }
        }
    }
    made
}

/// A kernel of the compute tracer that contains no code of a stream: it traces rays in memory, and
/// stores their hits there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Traversal {
    /// The fast kernel, over a wide BVH.
    Wide,
    /// The simple kernel over a binary BVH, written for readability.
    Binary,
    /// Every primitive of every instance, without a BVH.
    Brute,
}

impl Traversal {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Wide, Self::Binary, Self::Brute];

    fn name(self) -> &'static str {
        match self {
            Self::Wide => "wide",
            Self::Binary => "binary",
            Self::Brute => "brute",
        }
    }

    fn template(self) -> &'static str {
        match self {
            Self::Wide => "trace/wide.glsl",
            Self::Binary => "trace/reference.glsl",
            Self::Brute => "trace/brute.glsl",
        }
    }
}

/// The source of a shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A stream in a tracer's template.
    Stream {
        /// File in shaders/, without its ending.
        pass: &'static str,
        /// The answer to each ray.
        mode: Mode,
        /// Source of its rays.
        rays: Rays,
        /// The template.
        variant: Variant,
    },
    /// A pass that traces no rays.
    Compute {
        /// File in shaders/, without its ending.
        pass: &'static str,
        /// For devices with 64-bit integers.
        int64: bool,
    },
    /// A kernel of the compute tracer.
    Kernel {
        /// The hierarchy that it traverses, if any.
        traversal: Traversal,
        /// The answer to each ray.
        mode: Mode,
        /// For devices with 64-bit integers and subgroup ballots.
        ballot: bool,
    },
    /// A pass that traces its rays itself, by the compute tracer's functions, on devices with
    /// 64-bit integers and subgroups of a known size.
    Tracing {
        /// File in shaders/, without its ending.
        pass: &'static str,
    },
    /// A whole file.
    File {
        /// In shaders/.
        path: &'static str,
        /// Kind of the shader.
        stage: Stage,
    },
}

impl Source {
    /// Name of the file that build.rs writes its SPIR-V to, without its ending.
    pub fn file_name(&self) -> String {
        let bits = |has_64: &bool| if *has_64 { "64" } else { "32" };
        match self {
            Self::Stream { pass, mode, variant, .. } => format!("{pass}_{}_{variant:?}", mode.name()),
            Self::Compute { pass, int64 } => format!("{pass}_{}", bits(int64)),
            Self::Kernel { traversal, mode, ballot } => {
                format!("{}_{}_{}", traversal.name(), mode.name(), bits(ballot))
            }
            Self::Tracing { pass } => format!("{pass}_tracing"),
            Self::File { path, .. } => path.replace(['/', '.'], "_"),
        }
    }

    /// Kind of the shader.
    pub fn stage(&self) -> Stage {
        match self {
            Self::Stream { variant: Variant::Raygen, .. } => Stage::RayGeneration,
            Self::File { stage, .. } => *stage,
            _ => Stage::Compute,
        }
    }

    /// Whether the SPIR-V is optimized before it reaches the driver. The optimizer leaves the loops
    /// over a thread's four pixels in common/filter.glsl rolled up in a form that lavapipe's does
    /// not unroll; the pixels' sums are then in memory, which every thread of a vector accesses by
    /// itself, and filters take three times as long. So it is with the neighbours of `antialias`,
    /// which takes half as long without, and of the two that reproject histories (three quarters).
    pub fn is_optimized(&self) -> bool {
        !matches!(
            self,
            Self::Compute {
                pass: "filter"
                    | "denoise"
                    | "nlmeans"
                    | "nlmeans_radiance"
                    | "antialias"
                    | "temporal"
                    | "radiance_temporal",
                ..
            }
        )
    }

    /// The GLSL text, with unresolved includes. `shaders`: the folder.
    ///
    /// # Errors
    /// A file that cannot be read, in words.
    pub fn text(&self, shaders: &Path) -> Result<String, String> {
        let lanes = format!("#define LANES {LANES}\n");
        let spread = format!("#define SPREAD {SPREAD}u\n#define RUN {RUN}u\n");
        let head_64 = |int64: bool| if int64 { HEAD_64 } else { "" };
        Ok(match self {
            Self::Stream { pass, mode, rays, variant } => format!(
                "#version 460\n{EXTENSIONS}{}{lanes}{spread}{}{}#include \"{pass}.glsl\"\n#include \"{}\"\n",
                variant.head(),
                mode.define(),
                if *rays == Rays::CameraOrKnown { "#define KNOWN_HITS\n" } else { "" },
                variant.template()
            ),
            Self::Compute { pass, int64 } => {
                format!("#version 460\n{EXTENSIONS}{}{lanes}#include \"{pass}.glsl\"\n", head_64(*int64))
            }
            Self::Kernel { traversal, mode, ballot } => format!(
                "#version 460\n{EXTENSIONS}{}{lanes}{spread}{}#include \"{}\"\n",
                if *ballot { format!("{HEAD_64}{HEAD_BALLOT}") } else { String::new() },
                mode.define(),
                traversal.template()
            ),
            Self::Tracing { pass } => {
                format!("#version 460\n{EXTENSIONS}{HEAD_64}{HEAD_BALLOT}{lanes}{spread}#include \"{pass}.glsl\"\n")
            }
            Self::File { path, .. } => {
                let path = shaders.join(path);
                std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?
            }
        })
    }
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let bits = |int64: &bool| if *int64 { "64" } else { "32" };
        match self {
            Self::Stream { pass, mode, variant, .. } => {
                write!(f, "{pass}.glsl as {} ({})", variant.template(), mode.name())
            }
            Self::Compute { pass, int64 } => write!(f, "{pass}.glsl ({}-bit loads)", bits(int64)),
            Self::Kernel { traversal, mode, ballot } => {
                write!(f, "{} ({}, {}-bit loads)", traversal.template(), mode.name(), bits(ballot))
            }
            Self::Tracing { pass } => write!(f, "{pass}.glsl (traces its rays)"),
            Self::File { path, .. } => f.write_str(path),
        }
    }
}

/// A shader. SPIR-V is reached by the name of its file ([`Source::file_name`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shader {
    source: Source,
}

impl Shader {
    /// The shader that is compiled from a source.
    pub const fn new(source: Source) -> Self {
        Self { source }
    }

    /// The shader that is a whole file of shaders/.
    pub const fn from_file(path: &'static str, stage: Stage) -> Self {
        Self::new(Source::File { path, stage })
    }

    /// The source that the shader is compiled from.
    pub fn source(&self) -> &Source {
        &self.source
    }
}

/// A pass that traces rays: a shader for each tracer and step.
pub struct StreamShaders {
    /// Label of its timings if the stream is a single shader.
    pub pass: &'static str,
    /// The answer to each ray.
    pub mode: Mode,
    /// Source of its rays.
    pub rays: Rays,
    // file in shaders/, without its ending, and the source of rays that it is compiled for
    file: &'static str,
    compiled_for: Rays,
    labels: OnceLock<Labels>,
}

/// Texts that are made of the names of a pass and its mode, once.
struct Labels {
    name: String,
    steps: [String; 3],
}

impl StreamShaders {
    /// The pass `shaders/PASS.glsl` in a mode.
    pub const fn new(pass: &'static str, mode: Mode, rays: Rays) -> Self {
        Self { pass, mode, rays, file: pass, compiled_for: rays, labels: OnceLock::new() }
    }

    /// The same of `shaders/FILE.glsl`, which another stream has, too. One of both has its rays in
    /// a queue (`RAYS_ARE_QUEUED`); the other has those that the file generates, `rays`.
    pub const fn sharing(mut self, file: &'static str, rays: Rays) -> Self {
        (self.file, self.compiled_for) = (file, rays);
        self
    }

    /// Pass and mode.
    pub fn name(&self) -> &str {
        &self.labels().name
    }

    /// Labels of the timings of each step if the stream is three shaders.
    pub fn steps(&self) -> [&str; 3] {
        self.labels().steps.each_ref().map(String::as_str)
    }

    fn labels(&self) -> &Labels {
        self.labels.get_or_init(|| Labels {
            name: format!("{} {}", self.pass, self.mode.name()),
            steps: ["generate", "trace", "deliver"].map(|step| format!("{} {step}", self.pass)),
        })
    }

    /// The shader for a tracer and step; `None` where [`Variant::applies_to`] says so.
    pub fn variant(&self, variant: Variant) -> Option<Shader> {
        let source = Source::Stream { pass: self.file, mode: self.mode, rays: self.compiled_for, variant };
        variant.applies_to(self.rays).then_some(Shader::new(source))
    }

    /// All its shaders.
    pub fn variants(&self) -> impl Iterator<Item = Shader> {
        Variant::ALL.into_iter().filter_map(|variant| self.variant(variant))
    }
}

impl fmt::Debug for StreamShaders {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A pass that traces no rays: a shader for devices with 64-bit integers, and one for others.
#[derive(Debug)]
pub struct ComputeShader {
    /// File in shaders/, without its ending.
    pub name: &'static str,
}

impl ComputeShader {
    /// The pass `shaders/NAME.glsl`.
    pub const fn new(name: &'static str) -> Self {
        Self { name }
    }

    /// The shader for devices with or without 64-bit integers.
    pub fn variant(&self, int64: bool) -> Shader {
        Shader::new(Source::Compute { pass: self.name, int64 })
    }

    /// All its shaders.
    pub fn variants(&self) -> [Shader; 2] {
        [false, true].map(|int64| self.variant(int64))
    }
}
