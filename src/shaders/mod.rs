//! The shaders, as SPIR-V: `registry.rs` lists all of them, and build.rs compiles them into the
//! program.
//!
//! A program that was built with the cargo feature `live-shaders` contains no SPIR-V: it reads
//! shaders/ in the source tree when it runs, and compiles shaders on first use, into a cache that
//! all builds share. An edit of a shader then takes effect with the next run, or with the next
//! pipeline that is created, without compiling any Rust.

#[cfg(feature = "live-shaders")]
mod compiler;
#[cfg(feature = "probes")]
#[path = "../../tests/shaders/registry.rs"]
pub mod probes;
mod registry;
mod source;
mod specialize;
#[cfg(test)]
mod unrolled;

use std::borrow::Cow;

pub use registry::*;
pub use source::{
    ComputeShader, LANES, Mode, PACKET_RAYS, RUN, Rays, SPREAD, Shader, Source, Stage, StreamShaders, Traversal,
    Variant,
};
pub(crate) use specialize::specialize;

use crate::error::Result;

/// SPIR-V by [`Source::file_name`], in the order of names; build.rs writes the table.
#[cfg(not(feature = "live-shaders"))]
static SPIRV: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/spirv.rs"));

impl Shader {
    /// SPIR-V that build.rs has compiled, or with `live-shaders` from the files as they are now.
    ///
    /// # Errors
    /// None but with `live-shaders`: [`crate::Error::Usage`] with the compiler's message.
    ///
    /// # Panics
    /// If no list of `registry.rs` names the shader.
    #[cfg(not(feature = "live-shaders"))]
    pub fn spirv(&self) -> Result<Cow<'static, [u8]>> {
        let name = self.source().file_name();
        let index = SPIRV.binary_search_by_key(&name.as_str(), |entry| entry.0);
        let Ok(index) = index else { panic!("{} is in no list of src/shaders/registry.rs", self.source()) };
        Ok(Cow::Borrowed(SPIRV[index].1))
    }

    /// SPIR-V, compiled from the files as they are now.
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
        compiler.compile(self.source()).map(|c| Cow::Owned(c.spirv)).map_err(crate::Error::Usage)
    }
}

/// Folder of the shader sources, with the feature `live-shaders`.
#[cfg(feature = "live-shaders")]
fn folder() -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders")
}

/// Time of the last change of a shader source: older pipelines are outdated. `None` without the
/// feature `live-shaders`, or if the folder cannot be read.
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

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn variants_are_those_that_apply() {
        for (k, variant) in Variant::ALL.into_iter().enumerate() {
            assert_eq!(variant as usize, k, "{variant:?} stands where its number says");
            let source = Source::Stream { pass: "aov", mode: Mode::Closest, rays: Rays::CameraOrRasterized, variant };
            assert_eq!(AOV_CLOSEST.variant(variant), Some(Shader::new(source)));
        }
        assert!(
            OCCLUSION_ANY.variant(Variant::Packet).is_none() && OCCLUSION_ANY.variant(Variant::Generate64).is_none()
        );
        assert!(PRIMARY_CLOSEST.variant(Variant::Visibility).is_none());
        assert!(RAYS_ANY.variant(Variant::Visibility).is_none() && RAYS_ANY.variant(Variant::Packet).is_some());
        assert_eq!(OCCLUSION_ANY.name(), "occlusion any");
        assert_eq!(RAYS_ANY.steps(), ["rays generate", "rays trace", "rays deliver"]);
    }

    /// A shader that no list names is not compiled.
    #[test]
    fn lists_name_every_static_once() {
        let is_name = |c: char| c.is_ascii_alphanumeric() || "_&".contains(c);
        let mut statics = 0;
        for text in [include_str!("registry.rs"), include_str!("../../tests/shaders/registry.rs")] {
            for name in text.lines().filter_map(|line| line.strip_prefix("pub static ")?.split(':').next()) {
                let listed = text.split(|c| !is_name(c)).filter(|word| word.strip_prefix('&') == Some(name)).count();
                assert_eq!(listed, 1, "{name}");
                statics += 1;
            }
        }
        // the tests' own are four
        assert_eq!(statics, STREAMS.len() + COMPUTE.len() + STAGES.len() + 4);
    }

    #[test]
    fn every_shader_is_spirv() {
        // a program that compiles shaders when it runs would take minutes for all
        let shaders = if cfg!(feature = "live-shaders") {
            vec![
                MISS,
                DRAW_SPHERE,
                RESOLVE.variant(true),
                RESOLVE.variant(false),
                kernel(Traversal::Wide, Mode::Any, true),
            ]
        } else {
            list_shaders()
        };
        for shader in &shaders {
            assert_eq!(shader.spirv().unwrap()[..4], 0x0723_0203u32.to_le_bytes(), "{}", shader.source());
        }
        let names: BTreeSet<String> = shaders.iter().map(|s| s.source().file_name()).collect();
        assert_eq!(names.len(), shaders.len(), "two shaders have the same file");
    }
}
