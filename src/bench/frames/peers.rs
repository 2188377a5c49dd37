//! Other renderers beside a camera that stands still: images of paths, in the time that a preset takes.

use std::collections::HashMap;
use std::rc::Rc;

use super::FramesSession;
use super::displayed::FrameReference;
use super::scenes::FramesScene;
use super::signal::PlainClock;
use super::stage::{REFERENCE_SEEDS, TIMED_IMAGES};
use crate::bench::peers::process::{Peer, PeerError};
use crate::bench::record::frames::{FrameErrors, PeerFrames, PeerPoint, PlainImage};
use crate::error::Result;

/// Values per pixel.
const CHANNELS: usize = 3;

/// What a peer renders a scene with.
pub struct PeerImages {
    /// Its place among the peers.
    peer: usize,
    kernel: String,
    /// Name of both.
    title: String,
    size: [u32; 2],
    seed: u32,
    reference: Rc<FrameReference>,
    clock: PlainClock,
    /// Errors of images by their number of paths: presets take similar times.
    errors: HashMap<u32, FrameErrors>,
}

/// Gives all peers a scene, has them render their references, and takes their times. Those that fail are left out with a note.
///
/// # Errors
/// Those of our own side; Ctrl-C.
pub fn prepare(session: &mut FramesSession, loaded: &FramesScene) -> Result<Vec<PeerImages>> {
    let mut images = Vec::new();
    for peer in 0..session.peers.len() {
        let name = session.peers[peer].spec.name.clone();
        session.phase(format!("{}: reference of {name}", loaded.name));
        match of_peer(session, loaded, peer) {
            Ok(all) => images.extend(all),
            Err(e) => left_out(session, &format!("{}: peer '{name}'", loaded.name), e)?,
        }
    }
    Ok(images)
}

/// Images in the time of so many frames, `(frames, milliseconds)`, of every peer. One that fails is left out from here on, with a note.
///
/// # Errors
/// Those of our own side; Ctrl-C.
pub fn beside(session: &mut FramesSession, all: &mut Vec<PeerImages>, ms: &[(u32, f64)]) -> Result<Vec<PeerFrames>> {
    let mut done = Vec::new();
    for mut images in std::mem::take(all) {
        session.phase(format!("images of {}", images.title));
        match images.beside(&mut session.peers[images.peer], ms) {
            Ok(frames) => {
                done.push(frames);
                all.push(images);
            }
            Err(e) => left_out(session, &images.title, e)?,
        }
    }
    Ok(done)
}

fn left_out(session: &mut FramesSession, what: &str, e: PeerError) -> Result<()> {
    match e {
        PeerError::Ours(e) => return Err(e),
        PeerError::Failed(why) => session.note(format!("{what} left out: {why}")),
    }
    Ok(())
}

fn of_peer(session: &mut FramesSession, loaded: &FramesScene, k: usize) -> Result<Vec<PeerImages>, PeerError> {
    let (size, seed, paths) = (session.args.size(), session.args.seed, session.args.reference_paths());
    let peer = &mut session.peers[k];
    peer.load_scene(&loaded.scene, &loaded.camera, size)?;
    let spec = peer.spec.clone();
    let Some(first) = spec.kernels.first() else { return Ok(Vec::new()) };
    let mut half = |seed| Ok::<_, PeerError>(peer.render(first, paths.div_ceil(2), seed, size)?.1);
    let [a, b] = REFERENCE_SEEDS.map(&mut half);
    let reference = Rc::new(FrameReference::new([&a?, &b?], CHANNELS, size[0] as usize)?);
    let mut all = Vec::new();
    for kernel in &spec.kernels {
        let mut images = PeerImages {
            peer: k,
            kernel: kernel.clone(),
            title: spec.title_of(kernel),
            size,
            seed,
            reference: reference.clone(),
            clock: PlainClock::default(),
            errors: HashMap::new(),
        };
        // the first images compile
        images.time(peer, &mut PlainClock::default())?;
        let mut clock = PlainClock::default();
        for _ in 0..TIMED_IMAGES {
            images.time(peer, &mut clock)?;
        }
        images.clock = clock;
        all.push(images);
    }
    Ok(all)
}

impl PeerImages {
    fn time(&self, peer: &mut Peer, clock: &mut PlainClock) -> Result<(), PeerError> {
        clock.take(|paths| Ok(peer.render(&self.kernel, paths, self.seed, self.size)?.0))
    }

    fn beside(&mut self, peer: &mut Peer, ms: &[(u32, f64)]) -> Result<PeerFrames, PeerError> {
        // beside the frames that it is compared with, too
        let mut clock = std::mem::take(&mut self.clock);
        self.time(peer, &mut clock)?;
        self.clock = clock;
        let time = self.clock.time();
        let mut points = Vec::new();
        for &(frame, ms) in ms {
            let paths = time.paths_in(ms);
            let errors = match self.errors.get(&paths) {
                Some(errors) => *errors,
                None => self.reference.errors_of(&peer.render(&self.kernel, paths, self.seed, self.size)?.1)?,
            };
            self.errors.insert(paths, errors);
            points.push(PeerPoint { frame, image: PlainImage { paths, errors } });
        }
        Ok(PeerFrames {
            peer: self.title.clone(),
            reference_rmse: self.reference.rmse,
            ms_per_image: time.per_image,
            ms_per_path: time.per_path,
            points,
        })
    }
}
