//! The resources of a frame: what its passes read and write, by name, and the device memory behind the names.

use std::sync::Arc;

use super::graph::Stage;
use crate::error::Result;
use crate::gpu::{Buffer, Device, Memory};
use crate::interface::records::frame::{SUMS_COUNT, SurfaceRecord};
use crate::tracer::stream::LAUNCH_RAYS;

/// Bytes of a pixel's surface.
pub const SURFACE_BYTES: u64 = size_of::<SurfaceRecord>() as u64;
/// Bytes of three floats.
pub const VECTOR_BYTES: u64 = 12;
/// Bytes of a guide or an estimate (src/interface/records/frame.rs).
pub const PAIR_BYTES: u64 = 8;

/// What a pass may read or write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resource {
    /// The frame's camera, on the host.
    Camera,
    /// The scene as it is now.
    Scene,
    /// The number of the frame, which its samples follow from: it changes in every frame.
    FrameNumber,
    /// What is shown, and how, on the host.
    DisplaySettings,
    /// Depth, normal and id of a pixel, for edge tests.
    Guide,
    /// `SurfaceRecord`s.
    Surface,
    /// Axes of hemispheres.
    Axes,
    /// Where surfaces were in the previous frame.
    PreviousPosition,
    /// Estimates from this frame's samples alone.
    Current,
    /// Bent normals of this frame's samples.
    CurrentBent,
    /// Ambient visibility of each ray of a launch, or with a budget of the frame.
    Samples,
    /// Number of occlusion rays.
    RayCount,
    /// Estimates from the samples of this frame and those before.
    History,
    /// Bent normals beside them.
    BentHistory,
    /// Estimates between the steps of a filter of several, which take turns.
    Filtered(usize),
    /// Bent normals beside them.
    FilteredBent(usize),
    /// Ambient visibility.
    Result,
    /// Filtered bent normals.
    BentResult,
    /// The frame as it is shown.
    Words,
    /// BVH nodes that camera rays visit.
    Nodes,
    /// Budget: deviation of one sample and number of samples, pixels in tiles.
    DesiredSamples,
    /// Budget: `SUMS_*`.
    Sums,
    /// Budget: each pixel's rays and its limit of samples.
    Plan,
    /// Budget: each ray's pixel.
    List,
    /// Budget: rays that each pixel has had in all frames.
    Taken,
    /// Larsen: lights that each pixel sees.
    Lit,
    /// Larsen: occlusion at half resolution.
    Occlusion,
    /// Larsen: one minus occlusion, blurred, at full resolution.
    Combined,
    /// Larsen: the result of the frame before.
    PreviousResult,
}

/// How long what a resource holds is needed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lifetime {
    /// On the host, or the tracer's: there is no buffer.
    Host,
    /// From its first pass to its last in a frame: resources whose turns do not overlap share memory.
    Frame,
    /// Until it is written again.
    Kept,
    /// Until the next frame has used it: two buffers, which take turns.
    Pair,
}

/// What the sizes of resources follow from.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extent {
    /// Pixels.
    pub pixels: u64,
    /// Pixels, those that fill tiles of 8x8 included.
    pub tiled_pixels: u64,
    /// Pixels of an image of half the size per axis.
    pub half_pixels: u64,
    /// With a budget: rays of a pixel at most; else 0.
    pub most_rays: u64,
}

/// A resource's buffer.
struct Description {
    name: &'static str,
    bytes: u64,
    memory: Memory,
    lifetime: Lifetime,
}

impl Resource {
    fn describe(self, extent: &Extent) -> Description {
        use Lifetime::{Frame, Host, Kept, Pair};
        let Extent { pixels, tiled_pixels, half_pixels, most_rays } = *extent;
        let device = |name, bytes, lifetime| Description { name, bytes, memory: Memory::Device, lifetime };
        let readback = |name, bytes| Description { name, bytes, memory: Memory::Readback, lifetime: Kept };
        match self {
            Self::Camera | Self::Scene | Self::FrameNumber | Self::DisplaySettings => device("host", 0, Host),
            Self::Guide => device("guide", PAIR_BYTES * pixels, Pair),
            Self::Surface => device("surfaces", SURFACE_BYTES * pixels, Kept),
            Self::Axes => device("axes of hemispheres", VECTOR_BYTES * pixels, Kept),
            Self::PreviousPosition => device("previous positions", VECTOR_BYTES * pixels, Kept),
            Self::Current => device("estimates of the frame", PAIR_BYTES * pixels, Frame),
            Self::CurrentBent => device("bent normals of the frame", VECTOR_BYTES * pixels, Frame),
            Self::Samples if most_rays > 0 => device("samples", 4 * most_rays * pixels, Frame),
            Self::Samples => device("samples", 4 * u64::from(LAUNCH_RAYS), Frame),
            Self::RayCount => readback("number of rays", 4),
            Self::History => device("history", PAIR_BYTES * pixels, Pair),
            Self::BentHistory => device("bent history", VECTOR_BYTES * pixels, Pair),
            Self::Filtered(_) => device("filtered estimates", PAIR_BYTES * pixels, Frame),
            Self::FilteredBent(_) => device("filtered bent normals", VECTOR_BYTES * pixels, Frame),
            Self::Result => readback("ambient visibility", 4 * pixels),
            Self::BentResult => device("bent normals", VECTOR_BYTES * pixels, Kept),
            Self::Words => device("display", 4 * pixels, Kept),
            Self::Nodes => readback("visited nodes", 4 * pixels),
            Self::DesiredSamples => device("desired samples", 8 * tiled_pixels, Frame),
            Self::Sums => device("sums of desired samples", 4 * u64::from(SUMS_COUNT), Frame),
            Self::Plan => device("plan of rays", 8 * pixels, Frame),
            Self::List => device("list of rays", 4 * most_rays * pixels, Frame),
            Self::Taken => device("rays taken", 4 * pixels, Kept),
            Self::Lit => device("visible lights", 4 * pixels, Frame),
            Self::Occlusion => device("occlusion", 4 * half_pixels, Frame),
            Self::Combined => device("combined", 4 * pixels, Frame),
            Self::PreviousResult => device("previous frame", 4 * pixels, Frame),
        }
    }

    /// Is what it holds lost when its last pass of a frame is done?
    pub fn is_transient(self) -> bool {
        self.describe(&Extent::default()).lifetime == Lifetime::Frame
    }
}

/// A resource that has memory.
struct Entry {
    resource: Resource,
    /// Indices of its buffers: one, or with [`Lifetime::Pair`] this frame's and the previous frame's.
    buffers: [usize; 2],
    /// Grows whenever it is written.
    version: u64,
}

/// The memory of a frame's resources.
pub struct Resources {
    extent: Extent,
    buffers: Vec<Buffer>,
    entries: Vec<Entry>,
    /// Versions of what is on the host.
    host: Vec<(Resource, u64)>,
}

impl Resources {
    /// Nothing yet.
    pub fn new(extent: Extent) -> Self {
        Self { extent, buffers: Vec::new(), entries: Vec::new(), host: Vec::new() }
    }

    /// Allocates what these stages write and what is not there yet. What nothing writes is not allocated, and its address is 0.
    pub fn allocate(&mut self, device: &Arc<Device>, stages: &[Stage]) -> Result<()> {
        // of each resource the first and the last stage that touches it, in the order in which they are first written
        let mut spans: Vec<(Resource, [usize; 2])> = Vec::new();
        for (k, stage) in stages.iter().enumerate() {
            for uses in stage.uses() {
                for &resource in &uses.writes {
                    let is_new = self.buffer_index(resource).is_none() && !spans.iter().any(|s| s.0 == resource);
                    if is_new && resource.describe(&self.extent).lifetime != Lifetime::Host {
                        spans.push((resource, [k, k]));
                    }
                }
                for resource in uses.touched() {
                    spans.iter_mut().filter(|s| s.0 == resource).for_each(|s| s.1[1] = k);
                }
            }
        }
        // buffers of resources of a frame, with the stage after which they are free
        let mut shared: Vec<(usize, u64, usize)> = Vec::new();
        for (resource, [first, last]) in spans {
            let Description { name, bytes, memory, lifetime } = resource.describe(&self.extent);
            let free = shared.iter_mut().find(|s| lifetime == Lifetime::Frame && s.1 == bytes && s.2 < first);
            let buffers = match free {
                Some(slot) => {
                    slot.2 = last;
                    [slot.0; 2]
                }
                None => {
                    let own = self.buffers.len();
                    let count = if lifetime == Lifetime::Pair { 2 } else { 1 };
                    for _ in 0..count {
                        self.buffers.push(Buffer::new(device, name, bytes, memory)?);
                    }
                    if lifetime == Lifetime::Frame {
                        shared.push((own, bytes, last));
                    }
                    [own, own + count - 1]
                }
            };
            self.entries.push(Entry { resource, buffers, version: 0 });
        }
        Ok(())
    }

    fn entry(&self, resource: Resource) -> Option<&Entry> {
        self.entries.iter().find(|e| e.resource == resource)
    }

    /// Which buffer holds a resource; resources that share memory have the same.
    pub fn buffer_index(&self, resource: Resource) -> Option<usize> {
        self.entry(resource).map(|e| e.buffers[0])
    }

    /// Which buffer holds what the previous frame left.
    pub fn previous_index(&self, resource: Resource) -> Option<usize> {
        self.entry(resource).map(|e| e.buffers[1])
    }

    /// The buffer; `None` where no pass writes it.
    pub fn buffer(&self, resource: Resource) -> Option<&Buffer> {
        self.buffer_index(resource).map(|k| &self.buffers[k])
    }

    /// Its address; 0 where no pass writes it.
    pub fn address(&self, resource: Resource) -> u64 {
        self.buffer(resource).map_or(0, Buffer::address)
    }

    /// Address of what the previous frame left, of a resource with two buffers.
    pub fn previous_address(&self, resource: Resource) -> u64 {
        self.previous_index(resource).map_or(0, |k| self.buffers[k].address())
    }

    /// A `uint` a pixel or another record each, read back; nothing where no pass writes it.
    pub fn read<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(&self, resource: Resource, count: u64) -> Result<Vec<T>> {
        match self.buffer(resource) {
            Some(buffer) => Ok(bytemuck::pod_collect_to_vec(&buffer.read(0, count * size_of::<T>() as u64)?)),
            None => Ok(Vec::new()),
        }
    }

    /// Notes that a resource has changed.
    pub fn touch(&mut self, resource: Resource) {
        if let Some(entry) = self.entries.iter_mut().find(|e| e.resource == resource) {
            entry.version += 1;
        } else if let Some(host) = self.host.iter_mut().find(|h| h.0 == resource) {
            host.1 += 1;
        } else {
            self.host.push((resource, 1));
        }
    }

    /// How often a resource has changed.
    pub fn version(&self, resource: Resource) -> u64 {
        let host = || self.host.iter().find(|h| h.0 == resource).map_or(0, |h| h.1);
        self.entry(resource).map_or_else(host, |e| e.version)
    }

    /// Makes this frame's buffer of a resource with two the previous frame's.
    pub fn swap(&mut self, resource: Resource) {
        if let Some(entry) = self.entries.iter_mut().find(|e| e.resource == resource) {
            entry.buffers.swap(0, 1);
        }
    }
}
