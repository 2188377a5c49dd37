//! Export of a [`Scene`](crate::scene::Scene): to glTF, which most tools read, and to a plain
//! triangle soup for other tracers.

pub mod amend;
mod glb;
mod gltf;
mod icosphere;
mod material;
mod mesh_bin;
mod peer;

use std::io::{BufWriter, Write};
use std::path::Path;

pub use amend::AmendedFile;
pub use gltf::{companions, export_gltf, is_companion_of};
pub use mesh_bin::{mesh_bin, read_mesh_bin, write_mesh_bin};
pub use peer::write_peer_scene;

use crate::error::Result;

/// Statistics and warnings of an export.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ExportStats {
    /// Number of triangles over all instances, those of tessellated spheres included.
    pub triangles: u64,
    /// Differences between the file and the scene, one sentence each.
    pub warnings: Vec<String>,
}

/// Writes a file with `fill` and gives it its name only when it is complete.
fn write_buffered(path: &Path, fill: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    crate::files::write_atomically(path, |file| {
        let mut out = BufWriter::with_capacity(1 << 20, file);
        fill(&mut out)?;
        out.flush()
    })
}
