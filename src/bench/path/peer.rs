//! Messages to a peer that renders paths: a scene in files, images back
//! (docs/reference/benchmarks.md).

use crate::bench::peers::process::{Peer, PeerError};
use crate::error::Error;
use crate::scene::{Camera, Scene, export};

impl Peer {
    /// Gives it a scene; the one before is forgotten.
    ///
    /// # Errors
    /// [`PeerError::Failed`] when it knows something of the scene not.
    pub fn load_scene(&mut self, scene: &Scene, camera: &Camera, size: [u32; 2]) -> Result<(), PeerError> {
        let folder = self.file("scene");
        export::write_peer_scene(scene, camera, size, &folder)?;
        let answer = self.ask(&format!("scene {}", folder.display()));
        // it has read it: the space is worth more than the files
        let _ = std::fs::remove_dir_all(&folder);
        answer.map(drop)
    }

    /// Renders; seconds by its own clock, and linear RGB, rows from the top.
    ///
    /// # Errors
    /// [`PeerError::Failed`] when it does not, or not that many pixels.
    pub fn render(&mut self, kernel: &str, spp: u32, seed: u32, size: [u32; 2]) -> Result<(f64, Vec<f32>), PeerError> {
        let path = self.file("image.bin");
        let answer = self.ask(&format!("render {kernel} {spp} {seed} {}", path.display()))?;
        let seconds = Peer::number(&answer, "seconds")?;
        let bytes = std::fs::read(&path).map_err(|e| Error::read(&path, &e))?;
        let _ = std::fs::remove_file(&path);
        let image: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes);
        if image.len() != 3 * size[0] as usize * size[1] as usize {
            return Err(PeerError::Failed(format!("its image has {} values", image.len())));
        }
        if !(seconds > 0.0 && seconds.is_finite()) {
            return Err(PeerError::Failed(format!("it rendered in {seconds} seconds")));
        }
        Ok((seconds, image))
    }
}
