//! Scenes to files (being written).

use std::io::{BufWriter, Write};
use std::path::Path;

use super::{Geometry, Instance, Material, Mesh, Scene, TriangleMesh};
use crate::error::{Error, Result};

/// Writes a scene as glTF.
pub fn export_gltf(_scene: &Scene, path: &Path) -> Result<()> {
    Err(Error::Usage(format!("{}: glTF export is not there yet", path.display())))
}

/// Writes all triangles in world space: u32 vertices, u32 triangles, f32 xyz[], u32 abc[].
pub fn write_mesh_bin(scene: &Scene, path: &Path) -> Result<()> {
    let (mut positions, mut indices) = (Vec::new(), Vec::new());
    for i in &scene.instances {
        let Geometry::Triangles(t) = &scene.meshes[i.mesh].geometry else { continue };
        let base = positions.len() as u32;
        positions.extend(t.positions.iter().map(|p| i.object_to_world.transform_point3(p.as_dvec3()).as_vec3()));
        indices.extend(t.indices.iter().map(|t| t.map(|v| v + base)));
    }
    crate::output::write_atomically(path, |file| {
        let mut out = BufWriter::new(file);
        out.write_all(bytemuck::cast_slice(&[positions.len() as u32, indices.len() as u32]))?;
        out.write_all(bytemuck::cast_slice(&positions))?;
        out.write_all(bytemuck::cast_slice(&indices))?;
        out.flush()
    })
}

/// Reads what [`write_mesh_bin`] wrote.
pub fn read_mesh_bin(path: &Path) -> Result<Scene> {
    let bytes = std::fs::read(path).map_err(|e| Error::read(path, &e))?;
    let word = |k: usize| bytes.get(4 * k..4 * k + 4).map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let (nv, nt) = (word(0), word(1));
    if bytes.len() != 8 + 12 * (nv + nt) {
        return Err(Error::input(path, "not a mesh soup: its length does not fit its counts"));
    }
    let (v, t) = bytes[8..].split_at(12 * nv);
    let mesh = TriangleMesh {
        positions: bytemuck::pod_collect_to_vec(v),
        indices: bytemuck::pod_collect_to_vec(t),
        ..Default::default()
    };
    Ok(Scene {
        name: path.display().to_string(),
        meshes: vec![Mesh { name: String::new(), geometry: Geometry::Triangles(mesh), material: 0 }],
        instances: vec![Instance { name: String::new(), mesh: 0, object_to_world: Default::default() }],
        materials: vec![Material::default()],
        ..Default::default()
    })
}
