//! [`Scene`](crate::scene::Scene) to files: glTF, which every tool reads, and the plain triangle soup that joins us to
//! other tracers.

mod gltf;
mod icosphere;
mod material;
mod mesh_bin;

use std::io::{BufWriter, Write};
use std::path::Path;

pub use gltf::export_gltf;
pub use mesh_bin::{mesh_bin, read_mesh_bin, write_mesh_bin};

use crate::error::Result;

/// What a scene has become in a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ExportStats {
    /// Triangles placed, those that stand for spheres included.
    pub triangles: u64,
    /// What the file does not hold as the scene does, a sentence each.
    pub warnings: Vec<String>,
}

/// Lets `fill` write a file that takes its name once it is complete.
fn write_buffered(path: &Path, fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    crate::files::write_atomically(path, |file| {
        let mut out = BufWriter::with_capacity(1 << 20, file);
        fill(&mut out)?;
        out.flush()
    })
}
