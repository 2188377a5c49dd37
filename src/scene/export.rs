//! [`Scene`](crate::scene::Scene) to files: glTF, which every tool reads, and the plain triangle soup that joins us to
//! other tracers.

mod atomic;
mod gltf;
mod icosphere;
mod material;
mod mesh_bin;

pub use gltf::export_gltf;
pub use mesh_bin::{mesh_bin, read_mesh_bin, write_mesh_bin};
