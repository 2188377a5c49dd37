//! The shaders, as SPIR-V: `registry.rs` lists all of them, and build.rs compiles them into the program.
//!
//! A program that was built with the cargo feature `live-shaders` contains no SPIR-V: it reads shaders/ in the source tree when it runs, and compiles
//! shaders on first use, into a cache that all builds share. An edit of a shader then takes effect with the next run, or with the next pipeline that
//! is created, without compiling any Rust.

#[cfg(feature = "live-shaders")]
mod compiler;
mod source;
mod specialize;
#[cfg(test)]
mod unrolled;

use std::borrow::Cow;

pub use source::{LANES, Mode, PACKET_RAYS, RUN, Rays, SPREAD, Source, Stage, Variant};
use source::{mode, rays};
pub(crate) use specialize::specialize;

use crate::error::Result;
use crate::interface::debug_views::debug_views;

/// A shader as SPIR-V.
#[derive(Debug)]
pub struct Shader {
    source: Source,
    #[cfg(not(feature = "live-shaders"))]
    spirv: &'static [u8],
}

impl Shader {
    /// Its source.
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// Its SPIR-V.
    ///
    /// # Errors
    /// None, except with the feature `live-shaders`: [`crate::Error::Usage`] with the compiler's message.
    #[cfg(not(feature = "live-shaders"))]
    pub fn spirv(&self) -> Result<Cow<'static, [u8]>> {
        Ok(Cow::Borrowed(self.spirv))
    }

    /// Its SPIR-V, compiled from the files as they are now.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] with the compiler's message.
    #[cfg(feature = "live-shaders")]
    pub fn spirv(&self) -> Result<Cow<'static, [u8]>> {
        use std::path::Path;
        use std::sync::OnceLock;

        static COMPILER: OnceLock<compiler::Compiler> = OnceLock::new();
        let compiler = COMPILER.get_or_init(|| {
            let files = source::generated_files(crate::interface::glsl::files(), Path::new(env!("CARGO_MANIFEST_DIR")));
            compiler::Compiler::new(&folder(), files, Path::new(env!("OUT_DIR")))
        });
        compiler.compile(&self.source).map(|c| Cow::Owned(c.spirv)).map_err(crate::Error::Usage)
    }
}

/// Folder of the shader sources, with the feature `live-shaders`.
#[cfg(feature = "live-shaders")]
fn folder() -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders")
}

/// Time of the last change of a shader source: older pipelines are outdated. `None` without the feature `live-shaders`, or if the folder cannot be read.
pub fn last_change() -> Option<std::time::SystemTime> {
    #[cfg(feature = "live-shaders")]
    {
        let (mut last, mut folders) = (None, vec![folder()]);
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).ok()?.filter_map(|e| e.ok()) {
                let data = entry.metadata().ok()?;
                if data.is_dir() {
                    folders.push(entry.path());
                }
                last = last.max(data.modified().ok());
            }
        }
        last
    }
    #[cfg(not(feature = "live-shaders"))]
    None
}

/// The shaders of a stream, one for each tracer and step.
pub struct StreamShaders {
    /// Pass and mode.
    pub name: &'static str,
    /// Name of the pass: label of its timings if the stream is a single shader.
    pub pass: &'static str,
    /// Labels of the timings of each step if the stream is three shaders.
    pub steps: [&'static str; 3],
    /// What it finds for each ray.
    pub mode: Mode,
    /// Source of its rays.
    pub rays: Rays,
    // in the order of Variant::ALL; the source of a variant that does not apply is never compiled
    variants: [Shader; 12],
}

impl StreamShaders {
    /// Its shader for a tracer and step; `None` where [`Variant::applies_to`] says so.
    pub fn variant(&self, variant: Variant) -> Option<&Shader> {
        variant.applies_to(self.rays).then(|| &self.variants[variant as usize])
    }
}

impl std::fmt::Debug for StreamShaders {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

/// The shaders of a pass that traces no rays.
#[derive(Debug)]
pub struct ComputeShader {
    /// The pass.
    pub name: &'static str,
    plain: Shader,
    int64: Shader,
}

impl ComputeShader {
    /// The shader for devices with or without 64-bit integers.
    pub fn variant(&self, int64: bool) -> &Shader {
        if int64 { &self.int64 } else { &self.plain }
    }
}

/// The compute tracer's wide kernel, which all streams of a mode share. `ballot`: for devices with 64-bit integers and subgroup ballots.
pub fn wide_kernel(mode: Mode, ballot: bool) -> &'static Shader {
    match (mode, ballot) {
        (Mode::Any, true) => &WIDE_ANY_64,
        (Mode::Any, false) => &WIDE_ANY_32,
        (Mode::Closest, true) => &WIDE_CLOSEST_64,
        (Mode::Closest, false) => &WIDE_CLOSEST_32,
    }
}

#[cfg(not(feature = "live-shaders"))]
macro_rules! shader {
    ($source:expr, $($file:expr),*) => {
        Shader { source: $source, spirv: include_bytes!(concat!(env!("OUT_DIR"), "/", $($file,)* ".spv")) }
    };
}

#[cfg(feature = "live-shaders")]
macro_rules! shader {
    ($source:expr, $($file:expr),*) => {
        Shader { source: $source }
    };
}

macro_rules! variant {
    ($pass:literal, $mode:ident, $variant:ident) => {
        shader!(
            Source::Stream { pass: $pass, mode: mode!($mode), variant: Variant::$variant },
            $pass,
            "_",
            stringify!($mode),
            "_",
            stringify!($variant)
        )
    };
}

macro_rules! compute {
    ($constant:ident = $name:literal) => {
        #[doc = concat!("`shaders/", $name, ".glsl`, which traces no rays.")]
        pub static $constant: ComputeShader = ComputeShader {
            name: $name,
            plain: shader!(Source::Compute { pass: $name, int64: false }, $name, "_32"),
            int64: shader!(Source::Compute { pass: $name, int64: true }, $name, "_64"),
        };
    };
}

macro_rules! registry {
    (
        streams { $($stream:ident = $pass:literal, $mode:ident, $rays:ident;)* }
        compute { $($compute:ident = $name:literal;)* }
        stages { $($stage:ident = $path:literal, $kind:ident;)* }
    ) => {
        $(
            #[doc = concat!("The stream `shaders/", $pass, ".glsl`, mode `", stringify!($mode), "`.")]
            pub static $stream: StreamShaders = StreamShaders {
                name: concat!($pass, " ", stringify!($mode)),
                pass: $pass,
                steps: [concat!($pass, " generate"), concat!($pass, " trace"), concat!($pass, " deliver")],
                mode: mode!($mode),
                rays: rays!($rays),
                variants: [
                    variant!($pass, $mode, Generate),
                    variant!($pass, $mode, Generate64),
                    variant!($pass, $mode, Deliver),
                    variant!($pass, $mode, Deliver64),
                    variant!($pass, $mode, Packet),
                    variant!($pass, $mode, Bvh2),
                    variant!($pass, $mode, Brute),
                    variant!($pass, $mode, Query),
                    variant!($pass, $mode, Raygen),
                    variant!($pass, $mode, Visibility),
                    variant!($pass, $mode, Known),
                    variant!($pass, $mode, Known64),
                ],
            };
        )*
        $(compute!($compute = $name);)*
        $(
            #[doc = concat!("`shaders/", $path, "`.")]
            pub static $stage: Shader = shader!(Source::File { path: $path, stage: Stage::$kind }, stringify!($stage));
        )*
    };
}

static WIDE_ANY_32: Shader = shader!(Source::Kernel { mode: Mode::Any, ballot: false }, "wide_any_32");
static WIDE_ANY_64: Shader = shader!(Source::Kernel { mode: Mode::Any, ballot: true }, "wide_any_64");
static WIDE_CLOSEST_32: Shader = shader!(Source::Kernel { mode: Mode::Closest, ballot: false }, "wide_closest_32");
static WIDE_CLOSEST_64: Shader = shader!(Source::Kernel { mode: Mode::Closest, ballot: true }, "wide_closest_64");

include!("registry.rs");

macro_rules! debug_view_shaders {
    ($($(#[doc = $doc:literal])+ $view:ident = $name:literal, $glsl:literal, mod $module:ident, shader $shader:ident;)*) => {
        $(compute!($shader = $name);)*
    };
}
debug_views!(debug_view_shaders);

/// Shaders that only tests use: tests/shaders.
#[cfg(feature = "probes")]
pub mod probes {
    use super::source::{mode, rays};
    use super::{ComputeShader, Mode, Rays, Shader, Source, StreamShaders, Variant};

    include!("../../tests/shaders/registry.rs");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variants_are_numbered_in_order() {
        for (k, variant) in Variant::ALL.into_iter().enumerate() {
            assert_eq!(variant as usize, k);
            let Some(shader) = PATH_CAMERA_CLOSEST.variant(variant) else { panic!("{variant:?}") };
            assert_eq!(*shader.source(), Source::Stream { pass: "path_camera", mode: Mode::Closest, variant });
        }
        assert!(OCCLUSION_ANY.variant(Variant::Packet).is_none() && OCCLUSION_ANY.variant(Variant::Generate64).is_none());
        assert!(PRIMARY_CLOSEST.variant(Variant::Known).is_none() && PRIMARY_CLOSEST.variant(Variant::Visibility).is_some());
        assert!(RAYS_ANY.variant(Variant::Visibility).is_none() && RAYS_ANY.variant(Variant::Packet).is_some());
    }

    #[test]
    fn every_shader_is_spirv() {
        let spirv = |shader: &Shader| shader.spirv().unwrap()[..4] == 0x0723_0203u32.to_le_bytes();
        assert!(spirv(&MISS) && spirv(&DRAW_SPHERE) && spirv(RESOLVE.variant(true)) && spirv(RESOLVE.variant(false)));
        for (mode, ballot) in [(Mode::Any, true), (Mode::Any, false), (Mode::Closest, true), (Mode::Closest, false)] {
            let shader = wide_kernel(mode, ballot);
            assert!(spirv(shader) && *shader.source() == Source::Kernel { mode, ballot });
        }
    }
}
