//! Contestants: our own tracers and kernels, and those of peers, behind one interface.

use std::sync::Arc;

use crate::accel::flatten::FlatScene;
use crate::bench::peers::process::{Peer, PeerError};
use crate::error::{Error, Result};
use crate::film::Control;
use crate::gpu::{Device, DeviceInfo};
use crate::integrators::ray_sets::{RaySet, sample};
use crate::integrators::rays::{Mode, PreparedRays};
use crate::ray::{Hit, Ray};
use crate::tracer::{BuildOptions, DeviceBuildStats, Kernel, Needs, Tracer, TracerKind};

/// A tracer of our own with its kernel. A new one is a line of [`KERNELS`].
pub struct OwnKernel {
    /// On the command line and in tables.
    pub name: &'static str,
    pub tracer: TracerKind,
    /// Which kernel of the compute tracer.
    pub kernel: Kernel,
    /// On a CPU device, it traces one in this many rays.
    pub divisor: usize,
    /// Maximum of primitives on a CPU device, unless requested by name: brute force tests all.
    pub max_primitives: usize,
}

const fn compute(kernel: Kernel, name: &'static str, divisor: usize, max_primitives: usize) -> OwnKernel {
    OwnKernel { name, tracer: TracerKind::Compute, kernel, divisor, max_primitives }
}

const fn hardware(tracer: TracerKind, name: &'static str) -> OwnKernel {
    OwnKernel { name, tracer, kernel: Kernel::Wide, divisor: 16, max_primitives: 1 << 21 }
}

/// All kernels. The first supported one generates the rays, and the others are checked against it.
pub const KERNELS: [OwnKernel; 7] = [
    compute(Kernel::Wide, "wide", 1, usize::MAX),
    compute(Kernel::Packet, "packet", 1, usize::MAX),
    compute(Kernel::Nearest, "nearest", 4, 1 << 22),
    compute(Kernel::Direction, "direction", 4, 1 << 22),
    compute(Kernel::Brute, "brute", 64, 2000),
    hardware(TracerKind::Pipeline, "pipeline"),
    hardware(TracerKind::Query, "query"),
];

impl OwnKernel {
    /// Does it take part on this device and scene? `named`: the user asked for it.
    pub fn takes_part(&self, info: &DeviceInfo, flat: &FlatScene, named: bool) -> Result<(), String> {
        if !self.tracer.is_supported_by(info) {
            return Err("the device does not support it; see `skylit doctor`".into());
        }
        if self.kernel == Kernel::Packet && !info.packets() {
            // it would be `wide` under another name
            return Err(
                "the device has no subgroups of eight lanes or no 64-bit integers, and traces as 'wide' does".into()
            );
        }
        // without a tree, a GPU is slow too, and what is placed counts, not what is stored
        let brute = self.kernel == Kernel::Brute;
        let work = if brute { Kernel::brute_tests(flat) } else { flat.primitive_count() };
        if (brute || info.is_cpu()) && !named && work > self.max_primitives {
            return Err(format!("slow on this many primitives; use --kernels {} to measure it anyway", self.name));
        }
        Ok(())
    }
}

/// Where a contestant's rays are traced.
enum Engine<'a> {
    Own { tracer: Box<Tracer>, divisor: usize },
    Peer { peer: usize, kernel: String, flat: &'a FlatScene<'a> },
}

/// The cost of building a contestant's hierarchy.
#[derive(Clone, Debug)]
pub struct BuildCost {
    /// Seconds to build the hierarchy.
    pub seconds: f64,
    /// Seconds to write the scene into device memory; `None` for peers.
    pub upload_seconds: Option<f64>,
    /// Bytes of nodes and primitives by stored primitive.
    pub bytes_per_primitive: f64,
    /// Cost of the hierarchy by the surface area heuristic, where it is known.
    pub sah_cost: Option<f64>,
    /// Builds of the device, if any.
    pub on_device: DeviceBuildStats,
}

/// A contestant with a scene.
pub struct Contestant<'a> {
    pub name: String,
    pub build: BuildCost,
    /// Must its answers agree with the reference?
    pub strict: bool,
    /// Which kernel of the compute tracer it is.
    pub kernel: Option<Kernel>,
    engine: Engine<'a>,
}

impl<'a> Contestant<'a> {
    pub fn own(device: &Arc<Device>, flat: &'a FlatScene, own: &OwnKernel, build: &BuildOptions) -> Result<Self> {
        let tracer = Tracer::with_build(device, own.tracer, flat, Needs::default(), own.kernel.into(), build)?;
        let stats = tracer.stats();
        let build = BuildCost {
            seconds: stats.build_seconds,
            upload_seconds: Some(stats.upload_seconds),
            bytes_per_primitive: stats.bytes_per_primitive(),
            sah_cost: stats.sah_cost,
            on_device: stats.on_device,
        };
        let divisor = if device.info.is_cpu() { own.divisor } else { 1 };
        Ok(Self {
            name: own.name.to_owned(),
            build,
            strict: true,
            kernel: (own.tracer == TracerKind::Compute).then_some(own.kernel),
            engine: Engine::Own { tracer: Box::new(tracer), divisor },
        })
    }

    /// A kernel of a peer that has the scene.
    pub fn peer(peers: &mut [Peer], index: usize, kernel: &str, flat: &'a FlatScene<'a>) -> Result<Self, PeerError> {
        let peer = &mut peers[index];
        let name = peer.spec.title_of(kernel);
        let (seconds, bytes) = peer.build(kernel)?;
        let build = BuildCost {
            seconds,
            upload_seconds: None,
            bytes_per_primitive: bytes / flat.primitive_count().max(1) as f64,
            sah_cost: None,
            on_device: DeviceBuildStats::default(),
        };
        let strict = peer.spec.strict.iter().any(|k| k == kernel);
        Ok(Self {
            name,
            build,
            strict,
            kernel: None,
            engine: Engine::Peer { peer: index, kernel: kernel.to_owned(), flat },
        })
    }

    /// Is it made for such rays? Packets are for coherent ones alone.
    pub fn is_for(&self, set: RaySet) -> bool {
        self.kernel != Some(Kernel::Packet) || set.is_coherent()
    }

    pub fn tracer(&self) -> Option<&Tracer> {
        match &self.engine {
            Engine::Own { tracer, .. } => Some(tracer),
            Engine::Peer { .. } => None,
        }
    }

    pub fn peer_index(&self) -> Option<usize> {
        match self.engine {
            Engine::Own { .. } => None,
            Engine::Peer { peer, .. } => Some(peer),
        }
    }

    /// Makes ready for one stream.
    pub fn prepare<'c>(&'c self, set: RaySet, rays: &[Ray], mode: Mode) -> Result<PreparedRun<'c>> {
        match &self.engine {
            Engine::Own { tracer, divisor } => {
                let rays = sample(rays, *divisor);
                let prepared = PreparedRays::new(tracer, &rays, mode)?;
                Ok(PreparedRun { rays: rays.len(), engine: PreparedEngine::Own(Box::new(prepared)) })
            }
            Engine::Peer { peer, kernel, .. } => Ok(PreparedRun {
                rays: rays.len(),
                engine: PreparedEngine::Peer { peer: *peer, kernel, set: set.name(), mode, hits: 0 },
            }),
        }
    }

    /// Traces rays without timing and returns their hits.
    pub fn hits(
        &self,
        peers: &mut [Peer],
        rays: &[Ray],
        mode: Mode,
        control: &mut dyn Control,
    ) -> Result<Vec<Hit>, PeerError> {
        match &self.engine {
            Engine::Own { tracer, .. } => {
                let mut prepared = PreparedRays::new(tracer, rays, mode)?;
                prepared.pass(control)?;
                Ok(prepared.hits()?)
            }
            Engine::Peer { peer, kernel, flat } => {
                let peer = &mut peers[*peer];
                peer.load_rays("check", rays)?;
                peer.hits(flat, kernel, mode, "check", rays.len())
            }
        }
    }
}

/// A contestant about to trace one stream again and again.
pub struct PreparedRun<'c> {
    pub rays: usize,
    engine: PreparedEngine<'c>,
}

enum PreparedEngine<'c> {
    Own(Box<PreparedRays<'c>>),
    Peer { peer: usize, kernel: &'c str, set: &'static str, mode: Mode, hits: u64 },
}

impl PreparedRun<'_> {
    /// Traces once. Returns the seconds on the device, or by the peer's own clock, and those by our
    /// clock; `None` for peers.
    pub fn repeat(&mut self, peers: &mut [Peer], control: &mut dyn Control) -> Result<(f64, Option<f64>), PeerError> {
        match &mut self.engine {
            PreparedEngine::Own(prepared) => {
                let (device, wall) = prepared.pass(control)?;
                Ok((device, Some(wall)))
            }
            PreparedEngine::Peer { peer, kernel, set, mode, hits } => {
                let (seconds, found) = peers[*peer].trace(kernel, *mode, set)?;
                *hits = found;
                Ok((seconds, None))
            }
        }
    }

    pub fn hit_count(&self) -> Result<u64, Error> {
        match &self.engine {
            PreparedEngine::Own(prepared) => Ok(prepared.hits()?.iter().filter(|h| h.is_hit()).count() as u64),
            PreparedEngine::Peer { hits, .. } => Ok(*hits),
        }
    }
}
