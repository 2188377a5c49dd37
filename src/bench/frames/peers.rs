//! Other renderers beside a camera that stands still: images of paths in a preset's time.

use std::collections::HashMap;
use std::rc::Rc;

use super::args::FramesSession;
use super::scenes::{CameraView, FramesScene};
use super::stage::{PlainImage, REFERENCE_SEEDS, TIMED_IMAGES};
use crate::bench::peers::process::{Peer, PeerError};
use crate::bench::record::{FRAME, plain, quantity};
use crate::error::Result;
use crate::measure::displayed::{FrameReference, ImageErrors};
use crate::measure::plain_time::{PlainClock, PlainTime, TIMED_PATHS};

const CHANNELS: usize = 3;

/// The images of a peer of a scene.
pub struct PeerImages {
    /// The index of the peer.
    peer: usize,
    kernel: String,
    /// The name of both.
    title: String,
    size: [u32; 2],
    seed: u32,
    reference: Rc<FrameReference>,
    clock: PlainClock,
    /// Images by their number of paths: presets take similar times.
    images: HashMap<u32, Image>,
}

#[derive(Clone, Copy)]
struct Image {
    ms: f64,
    errors: ImageErrors,
}

/// Maximum number of images that are rendered to find the number of paths that takes a time.
const TRIES: usize = 3;
/// Relative difference from the right number of paths that is small enough.
const NEAR: f64 = 0.05;

/// Gives all peers a scene, and takes references and times. Those that fail are left out.
pub fn prepare(session: &mut FramesSession, loaded: &FramesScene, view: &CameraView) -> Result<Vec<PeerImages>> {
    let mut images = Vec::new();
    for peer in 0..session.peers.len() {
        let name = session.peers[peer].spec.name.clone();
        session.phase(format!("{}: reference of {name}", loaded.name));
        let prepared = prepare_peer(session, (loaded, view), peer);
        let what = format!("{}: peer '{name}' left out", loaded.name);
        images.extend(session.unless_peer_fails(&what, prepared)?.into_iter().flatten());
    }
    Ok(images)
}

/// Adds images of every peer in the time of frames of a preset, `(frames, milliseconds)`. One that
/// fails is left out from here on.
pub fn render_beside(
    session: &mut FramesSession,
    (scene, preset): (&str, &str),
    all: &mut Vec<PeerImages>,
    ms: &[(u32, f64)],
) -> Result<()> {
    for mut images in std::mem::take(all) {
        session.phase(format!("images of {}", images.title));
        let rendered = images.render_in(&mut session.peers[images.peer], ms);
        let what = format!("{} left out", images.title);
        let Some(rendered) = session.unless_peer_fails(&what, rendered)? else { continue };
        let contestant = format!("{} in the time of {preset}", images.title);
        let mut row = session.record.row(scene, "still, other renderers", &contestant).of_peer(true);
        let time = images.clock.time();
        row.exact(plain("image", "ms"), time.per_image).exact(plain("path", "ms"), time.per_path);
        row.exact(plain("reference's RMSE", ""), images.reference.rmse);
        for (frame, image) in rendered {
            let mut at = row.at(FRAME, f64::from(frame));
            at.exact(quantity::RMSE.not_compared(), image.errors.rmse);
            at.exact(quantity::CORRECTED, image.errors.corrected).exact(plain("paths", ""), f64::from(image.paths));
        }
        all.push(images);
    }
    Ok(())
}

fn prepare_peer(
    session: &mut FramesSession,
    (loaded, view): (&FramesScene, &CameraView),
    k: usize,
) -> Result<Vec<PeerImages>, PeerError> {
    let (size, seed, paths) = (session.args.size(), session.args.seed, session.args.reference_paths());
    let peer = &mut session.peers[k];
    peer.load_scene(&loaded.scene, &view.camera, size)?;
    let spec = peer.spec.clone();
    let Some(first) = spec.kernels.first() else { return Ok(Vec::new()) };
    let mut half = |seed| Ok::<_, PeerError>(peer.render(first, paths.div_ceil(2), seed, size)?.1);
    let [a, b] = REFERENCE_SEEDS.map(&mut half);
    let reference = Rc::new(FrameReference::new([&a?, &b?], CHANNELS, size[0] as usize, None)?);
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
            images: HashMap::new(),
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

    /// The image of as many paths as take `ms`. Many paths take less time each than the timed few.
    fn image_in(&mut self, peer: &mut Peer, time: PlainTime, ms: f64) -> Result<PlainImage, PeerError> {
        let mut paths = time.paths_in(ms);
        for _ in 0..TRIES {
            if paths <= TIMED_PATHS[1] {
                break;
            }
            let took = self.image(peer, paths)?.ms;
            let tracing = |ms: f64| (ms - time.per_image).max(0.1 * ms);
            let better = f64::from(paths) * (tracing(ms) / tracing(took)).clamp(0.25, 4.0);
            if (better / f64::from(paths) - 1.0).abs() <= NEAR {
                break;
            }
            paths = (better as u32).max(1);
        }
        Ok(PlainImage { paths, errors: self.image(peer, paths)?.errors })
    }

    fn image(&mut self, peer: &mut Peer, paths: u32) -> Result<Image, PeerError> {
        if let Some(image) = self.images.get(&paths) {
            return Ok(*image);
        }
        // the first may compile
        let (first, _) = peer.render(&self.kernel, paths, self.seed, self.size)?;
        let (second, rgb) = peer.render(&self.kernel, paths, self.seed, self.size)?;
        let image = Image { ms: 1e3 * first.min(second), errors: self.reference.errors_of(&rgb)? };
        self.images.insert(paths, image);
        Ok(image)
    }

    fn render_in(&mut self, peer: &mut Peer, ms: &[(u32, f64)]) -> Result<Vec<(u32, PlainImage)>, PeerError> {
        // beside the frames that it is compared with, too
        let mut clock = std::mem::take(&mut self.clock);
        self.time(peer, &mut clock)?;
        self.clock = clock;
        let time = self.clock.time();
        ms.iter().map(|&(frame, ms)| Ok((frame, self.image_in(peer, time, ms)?))).collect()
    }
}
