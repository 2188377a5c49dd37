//! Messages to peers that trace rays: scenes and rays in files, seconds and hits back.

use std::io::{BufWriter, Write};
use std::path::Path;

use crate::accel::flatten::FlatScene;
use crate::bench::peers::process::{Peer, PeerError};
use crate::error::{Error, Result};
use crate::integrators::rays::Mode;
use crate::ray::{Hit, Ray};
use crate::scene::Geometry;

/// Magic number of peer scene files: "SKYP".
const SCENE_MAGIC: u32 = 0x5059_4b53;

impl Peer {
    /// Sends the scene's geometry, which replaces the previous scene and all ray sets.
    pub fn load_geometry(&mut self, flat: &FlatScene) -> Result<(), PeerError> {
        let path = self.file("scene.bin");
        write_scene(flat, &path).map_err(|e| Error::write(&path, &e))?;
        self.ask(&format!("scene {}", path.display()))?;
        // it has read it: the space is worth more than the file
        let _ = std::fs::remove_file(&path);
        Ok(())
    }

    /// Builds what a kernel traces: seconds and bytes, the same for kernels that share a structure.
    pub fn build(&mut self, kernel: &str) -> Result<(f64, f64), PeerError> {
        let answer = self.ask(&format!("build {kernel}"))?;
        Ok((Peer::number(&answer, "build_seconds")?, Peer::number(&answer, "bytes")?))
    }

    /// Sends a named set of rays.
    pub fn load_rays(&mut self, name: &str, rays: &[Ray]) -> Result<(), PeerError> {
        let path = self.file(&format!("{name}.rays"));
        std::fs::write(&path, bytemuck::cast_slice(rays)).map_err(|e| Error::write(&path, &e))?;
        self.ask(&format!("rays {name} {}", path.display()))?;
        let _ = std::fs::remove_file(&path);
        Ok(())
    }

    /// Traces a set once: seconds by its own clock, and the number of hits.
    pub fn trace(&mut self, kernel: &str, mode: Mode, name: &str) -> Result<(f64, u64), PeerError> {
        let answer = self.ask(&format!("trace {kernel} {} {name}", mode_name(mode)))?;
        let (seconds, hits) = (Peer::number(&answer, "seconds")?, Peer::number(&answer, "hits")?);
        if !(seconds > 0.0 && seconds.is_finite()) {
            return Err(PeerError::Failed(format!("it reported an invalid time of {seconds} seconds")));
        }
        Ok((seconds, hits as u64))
    }

    /// The hits of a set of `count` rays, with the scene's ids.
    pub fn hits(
        &mut self,
        flat: &FlatScene,
        kernel: &str,
        mode: Mode,
        name: &str,
        count: usize,
    ) -> Result<Vec<Hit>, PeerError> {
        let path = self.file("hits.bin");
        self.ask(&format!("hits {kernel} {} {name} {}", mode_name(mode), path.display()))?;
        let bytes = std::fs::read(&path).map_err(|e| Error::read(&path, &e))?;
        let _ = std::fs::remove_file(&path);
        if bytes.len() != count * size_of::<Hit>() {
            return Err(PeerError::Failed(format!("it wrote {} bytes of hits for {count} rays", bytes.len())));
        }
        let mut hits: Vec<Hit> = bytemuck::pod_collect_to_vec(&bytes);
        if mode == Mode::Closest {
            hits.iter_mut().filter(|h| h.is_hit()).for_each(|h| rename(flat, h));
        }
        Ok(hits)
    }
}

fn mode_name(mode: Mode) -> &'static str {
    match mode {
        Mode::Any => "any",
        Mode::Closest => "closest",
    }
}

/// Maps instance and group primitive to scene instance and mesh primitive, but for invalid ids.
fn rename(flat: &FlatScene, hit: &mut Hit) {
    let Some(entry) = flat.instances.get(hit.instance as usize) else { return };
    let group = &flat.groups[entry.group];
    if hit.primitive as usize >= group.primitive_count {
        return;
    }
    let part = flat.submesh_of(group, hit.primitive as usize);
    hit.primitive -= part.first_primitive as u32;
    if let Some(instance) = entry.scene_instance.or(part.scene_instance) {
        hit.instance = instance as u32;
    }
}

/// Writes the geometry and instances that our tracers build over, with device memory's vertices.
fn write_scene(flat: &FlatScene, path: &Path) -> std::io::Result<()> {
    let mut out = BufWriter::with_capacity(1 << 20, std::fs::File::create(path)?);
    let mut words = |w: &[u32]| w.iter().try_for_each(|x| out.write_all(&x.to_le_bytes()));
    words(&[SCENE_MAGIC, 1, flat.groups.len() as u32, flat.instances.len() as u32])?;
    for group in &flat.groups {
        let vertices = if group.spheres { group.primitive_count } else { group.vertex_count };
        words(&[u32::from(group.spheres), vertices as u32, group.primitive_count as u32])?;
        for part in &group.submeshes {
            match &flat.scene.meshes[part.mesh].geometry {
                Geometry::Spheres(s) => {
                    for k in 0..s.len() {
                        let s = flat.sphere(part, k);
                        words(&[s.center.x, s.center.y, s.center.z, s.radius].map(f32::to_bits))?;
                    }
                }
                Geometry::Triangles(t) => {
                    for k in 0..t.positions.len() {
                        words(&flat.vertex(part, k).to_array().map(f32::to_bits))?;
                    }
                }
            }
        }
        for part in &group.submeshes {
            if let Geometry::Triangles(t) = &flat.scene.meshes[part.mesh].geometry {
                t.indices.iter().try_for_each(|i| words(&i.map(|k| k + part.first_vertex as u32)))?;
            }
        }
    }
    for entry in &flat.instances {
        words(&[entry.group as u32])?;
        for row in crate::tracer::transform::rows(&entry.to_world) {
            words(&row.map(f32::to_bits))?;
        }
    }
    out.flush()
}
