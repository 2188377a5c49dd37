//! A peer: a process that traces, driven by lines on its stdin, answering with JSON lines. docs/benchmarks.md has the protocol.

use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::peers_file::PeerSpec;
use crate::cli::interrupt;
use crate::error::{Error, Result};
use crate::ray::{Hit, Ray};
use crate::render::rays::Mode;
use crate::scene::Geometry;
use crate::scene::flatten::FlatScene;

/// The protocol that we speak.
const PROTOCOL: u64 = 1;
/// A peer that says nothing for so long is given up. Building over 10^7 triangles takes seconds.
const PATIENCE: Duration = Duration::from_secs(600);
/// To say hello.
const START_PATIENCE: Duration = Duration::from_secs(60);
/// Of peer scenes: "SKYP".
const SCENE_MAGIC: u32 = 0x5059_4b53;

/// Why a peer did not do what it was asked to.
pub enum PeerError {
    /// It failed; a sentence that says how.
    Failed(String),
    /// Something of ours failed, or the user pressed Ctrl-C.
    Ours(Error),
}

impl From<Error> for PeerError {
    fn from(e: Error) -> Self {
        Self::Ours(e)
    }
}

/// A running peer.
pub struct Peer {
    /// From the peers file.
    pub spec: PeerSpec,
    /// As it introduces itself.
    pub title: String,
    child: Child,
    stdin: ChildStdin,
    lines: Receiver<String>,
    files: tempfile::TempDir,
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = writeln!(self.stdin, "quit");
        // it may be in the middle of something, or not listen
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Peer {
    /// Builds, starts and greets it.
    ///
    /// # Errors
    /// [`PeerError::Failed`] when it does not build or start, or speaks another protocol.
    pub fn start(spec: &PeerSpec) -> Result<Self, PeerError> {
        let mut command = spec.prepare().map_err(PeerError::Failed)?;
        let not_started = |e: std::io::Error| PeerError::Failed(format!("`{}` does not run ({e})", spec.run[0]));
        let mut child =
            command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().map_err(not_started)?;
        let (Some(stdin), Some(stdout)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(PeerError::Failed("it has no stdin or stdout".into()));
        };
        let (to_us, lines) = channel();
        // ends with the process' stdout, or when nobody listens any more
        std::thread::spawn(move || BufReader::new(stdout).lines().map_while(|l| l.ok()).try_for_each(|l| to_us.send(l)));
        let files = tempfile::tempdir().map_err(|e| Error::write(std::env::temp_dir(), &e))?;
        let mut peer = Self { spec: spec.clone(), title: String::new(), child, stdin, lines, files };
        let hello = peer.listen(START_PATIENCE)?;
        if hello["protocol"].as_u64() != Some(PROTOCOL) {
            return Err(PeerError::Failed(format!("it does not speak protocol {PROTOCOL}")));
        }
        peer.title = hello["peer"].as_str().unwrap_or(&spec.name).to_owned();
        let offered: Vec<&str> = hello["kernels"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        if let Some(k) = spec.kernels.iter().find(|k| !offered.contains(&k.as_str())) {
            return Err(PeerError::Failed(format!("it has no kernel '{k}' (it has {})", offered.join(", "))));
        }
        Ok(peer)
    }

    /// Waits for one answer.
    fn listen(&mut self, patience: Duration) -> Result<Value, PeerError> {
        let start = Instant::now();
        let line = loop {
            match self.lines.recv_timeout(Duration::from_millis(100)) {
                Ok(line) => break line,
                Err(RecvTimeoutError::Disconnected) => {
                    // Ctrl-C reaches both of us
                    interrupt::check()?;
                    let how = self.child.wait().map_or_else(|e| e.to_string(), |s| s.to_string());
                    return Err(PeerError::Failed(format!("it ended ({how})")));
                }
                Err(RecvTimeoutError::Timeout) => {
                    interrupt::check()?;
                    if start.elapsed() > patience {
                        return Err(PeerError::Failed(format!("it said nothing for {} seconds", patience.as_secs())));
                    }
                }
            }
        };
        let value: Value =
            serde_json::from_str(&line).map_err(|_| PeerError::Failed(format!("it said what is no JSON: {line:.80}")))?;
        match value["error"].as_str() {
            Some(e) => Err(PeerError::Failed(format!("it says: {e}"))),
            None => Ok(value),
        }
    }

    fn ask(&mut self, command: &str) -> Result<Value, PeerError> {
        let sent = writeln!(self.stdin, "{command}").and_then(|()| self.stdin.flush());
        // one that has ended says so to `listen`
        let _ = sent;
        self.listen(PATIENCE)
    }

    fn number(answer: &Value, name: &str) -> Result<f64, PeerError> {
        answer[name].as_f64().ok_or_else(|| PeerError::Failed(format!("its answer has no number '{name}'")))
    }

    /// Gives it a scene; the one before is forgotten, and all rays.
    pub fn load_scene(&mut self, flat: &FlatScene) -> Result<(), PeerError> {
        let path = self.files.path().join("scene.bin");
        write_scene(flat, &path).map_err(|e| Error::write(&path, &e))?;
        self.ask(&format!("scene {}", path.display()))?;
        // it has read it: the space is worth more than the file
        let _ = std::fs::remove_file(&path);
        Ok(())
    }

    /// Builds what a kernel traces: seconds and bytes, the same for kernels that share a structure.
    pub fn build(&mut self, kernel: &str) -> Result<(f64, f64), PeerError> {
        let answer = self.ask(&format!("build {kernel}"))?;
        Ok((Self::number(&answer, "build_seconds")?, Self::number(&answer, "bytes")?))
    }

    /// Gives it a set of rays under a name.
    pub fn load_rays(&mut self, name: &str, rays: &[Ray]) -> Result<(), PeerError> {
        let path = self.files.path().join(format!("{name}.rays"));
        std::fs::write(&path, bytemuck::cast_slice(rays)).map_err(|e| Error::write(&path, &e))?;
        self.ask(&format!("rays {name} {}", path.display()))?;
        let _ = std::fs::remove_file(&path);
        Ok(())
    }

    /// Traces a set once: seconds by its own clock, and how many rays met something.
    pub fn trace(&mut self, kernel: &str, mode: Mode, name: &str) -> Result<(f64, u64), PeerError> {
        let answer = self.ask(&format!("trace {kernel} {} {name}", mode_name(mode)))?;
        let (seconds, hits) = (Self::number(&answer, "seconds")?, Self::number(&answer, "hits")?);
        if !(seconds > 0.0 && seconds.is_finite()) {
            return Err(PeerError::Failed(format!("it traced in {seconds} seconds")));
        }
        Ok((seconds, hits as u64))
    }

    /// What a set of `count` rays meets, with the scene's ids.
    pub fn hits(
        &mut self,
        flat: &FlatScene,
        kernel: &str,
        mode: Mode,
        name: &str,
        count: usize,
    ) -> Result<Vec<Hit>, PeerError> {
        let path = self.files.path().join("hits.bin");
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

/// From placement and primitive of its group to instance and primitive of its mesh. Ids that do not exist stay: nothing is
/// there under them, and a check will say so.
fn rename(flat: &FlatScene, hit: &mut Hit) {
    let Some(placement) = flat.placements.get(hit.instance as usize) else { return };
    let group = &flat.groups[placement.group];
    if hit.primitive as usize >= group.primitive_count {
        return;
    }
    let part = flat.part_of(group, hit.primitive as usize);
    hit.primitive -= part.first_primitive as u32;
    if let Some(instance) = placement.scene_instance.or(part.scene_instance) {
        hit.instance = instance as u32;
    }
}

/// Writes the groups and placements that our tracers build over, vertices as they lie in device memory.
fn write_scene(flat: &FlatScene, path: &Path) -> std::io::Result<()> {
    let mut out = BufWriter::with_capacity(1 << 20, std::fs::File::create(path)?);
    let mut words = |w: &[u32]| w.iter().try_for_each(|x| out.write_all(&x.to_le_bytes()));
    words(&[SCENE_MAGIC, 1, flat.groups.len() as u32, flat.placements.len() as u32])?;
    for group in &flat.groups {
        let vertices = if group.spheres { group.primitive_count } else { group.vertex_count };
        words(&[u32::from(group.spheres), vertices as u32, group.primitive_count as u32])?;
        for part in &group.parts {
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
        for part in &group.parts {
            if let Geometry::Triangles(t) = &flat.scene.meshes[part.mesh].geometry {
                t.indices.iter().try_for_each(|i| words(&i.map(|k| k + part.first_vertex as u32)))?;
            }
        }
    }
    for placement in &flat.placements {
        words(&[placement.group as u32])?;
        for row in crate::tracer::gpu_scene::rows(&placement.to_world) {
            words(&row.map(f32::to_bits))?;
        }
    }
    out.flush()
}
