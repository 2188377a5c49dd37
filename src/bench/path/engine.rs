//! Renderers: our own strategies, or kernels of a peer.

use std::time::Instant;

use crate::accel::flatten::FlatScene;
use crate::bench::peers::process::{Peer, PeerError};
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::integrators::path::{PathIntegrator, PathOptions};
use crate::measure::halves::ReferenceHalves;
use crate::terminal::interrupt::SilentControl;
use crate::tracer::Tracer;

/// Seeds of references: no timed image has them.
const REFERENCE_SEED: u32 = 0x7e0_0000;
/// Seconds that one image of a reference should take.
const CHUNK_SECONDS: f64 = 2.0;
/// Sample counts go up by this: powers of four are what stratifying samplers do best with.
pub const STEP: u32 = 4;
/// Paths of a pixel in one image at most.
pub const MAX_SPP: u32 = 1 << 16;
/// Images of a reference at least: two for each half.
const MIN_CHUNKS: u32 = 4;

/// An image and what it took.
pub struct TimedImage {
    /// Wall seconds; of a peer, by its own clock.
    pub seconds: f64,
    /// Linear RGB, rows from the top.
    pub rgb: Vec<f32>,
    /// Rays, where they are counted.
    pub rays: Option<u64>,
    /// Longest launch, device seconds, where it is known.
    pub longest_launch: Option<f64>,
}

pub enum Engine<'a> {
    /// One of our strategies.
    Own { tracer: &'a Tracer, camera: CameraRecord, integrator: Box<PathIntegrator> },
    /// A kernel of a peer that has the scene.
    Peer {
        /// The index of the peer.
        peer: usize,
        /// The peer's own name for it.
        kernel: String,
        size: [u32; 2],
    },
}

impl<'a> Engine<'a> {
    pub fn own(tracer: &'a Tracer, flat: &FlatScene, camera: CameraRecord, options: &PathOptions) -> Result<Self> {
        let integrator = Box::new(PathIntegrator::new(tracer, flat, options)?);
        Ok(Self::Own { tracer, camera, integrator })
    }

    pub fn render(&mut self, peers: &mut [Peer], spp: u32, seed: u32) -> Result<TimedImage, PeerError> {
        match self {
            Self::Own { tracer, camera, integrator } => {
                let start = Instant::now();
                let result = integrator.render(tracer, camera, spp, seed, &mut SilentControl)?;
                let seconds = start.elapsed().as_secs_f64();
                let rays = result.image.primary_rays + result.bounce_rays + result.shadow_rays;
                let longest = result.image.longest_launch;
                let longest_launch = (longest > 0.0).then_some(longest);
                Ok(TimedImage { seconds, rgb: result.image.film.mean, rays: Some(rays), longest_launch })
            }
            Self::Peer { peer, kernel, size } => {
                let (seconds, rgb) = peers[*peer].render(kernel, spp, seed, *size)?;
                Ok(TimedImage { seconds, rgb, rays: None, longest_launch: None })
            }
        }
    }
}

pub struct PathReference {
    /// Who rendered it: skylit, or the name of a peer.
    pub engine: String,
    /// Linear RGB, rows from the top.
    pub image: Vec<f32>,
    /// Standard error of `image`, root mean square over pixels and channels.
    pub rmse: f64,
    pub spp: u64,
    /// Seconds that it took.
    pub seconds: f64,
}

/// Renders the reference of an engine for `limit` seconds. `advance` hears the share that is done.
pub fn render_reference(
    engine: &mut Engine,
    name: &str,
    peers: &mut [Peer],
    (limit, max_spp): (f64, u32),
    advance: &mut dyn FnMut(f64),
) -> Result<PathReference, PeerError> {
    // how many paths take about a chunk's time
    let mut spp = 4;
    loop {
        let image = engine.render(peers, spp, REFERENCE_SEED)?;
        if image.seconds * f64::from(STEP) > CHUNK_SECONDS.min(limit / f64::from(MIN_CHUNKS)) || spp * STEP > max_spp {
            break;
        }
        spp *= STEP;
    }
    let (mut halves, mut seconds, mut chunks) = (ReferenceHalves::default(), 0.0, 0u32);
    // as many in one half as in the other
    while chunks < MIN_CHUNKS || seconds < limit || chunks % 2 == 1 {
        let image = engine.render(peers, spp, REFERENCE_SEED + 1 + chunks)?;
        halves.add(chunks as usize % 2, &image.rgb);
        seconds += image.seconds;
        chunks += 1;
        advance((seconds / limit).min(1.0));
    }
    let rmse = halves.standard_error(3, None)?;
    let spp = u64::from(spp) * u64::from(chunks);
    Ok(PathReference { engine: name.to_owned(), image: halves.mean(), rmse, spp, seconds })
}
