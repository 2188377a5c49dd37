//! The resources of a frame, which its passes read and write, and their device memory.

use std::sync::Arc;

use crate::error::Result;
use crate::gpu::{Buffer, Device, Memory};
use crate::interface::records::denoise::RadianceRecord;
use crate::interface::records::frame::SurfaceRecord;
use crate::interface::records::radiance::KnownHit;

/// Bytes of a `SurfaceRecord`.
pub const SURFACE_BYTES: u64 = size_of::<SurfaceRecord>() as u64;
/// Bytes of three floats.
pub const VECTOR_BYTES: u64 = 12;
/// Bytes of four floats.
pub const QUAD_BYTES: u64 = 16;
/// Bytes of a `RadianceRecord`.
pub const RADIANCE_BYTES: u64 = size_of::<RadianceRecord>() as u64;
/// Bytes of the parts of a pixel's samples at rest: three times four floats.
pub const REST_PARTS_BYTES: u64 = 48;
/// Bytes of a guide or an estimate (src/interface/records/frame.rs).
pub const PAIR_BYTES: u64 = 8;

/// A resource that a pass may read or write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resource {
    /// The camera, on the host.
    Camera,
    /// The scene, in the tracer's memory.
    Scene,
    /// The frame index, which selects the sampler's points: it changes in every frame.
    FrameNumber,
    /// The display settings, on the host.
    DisplaySettings,
    /// Depth, normal and id of a pixel, for edge tests.
    Guide,
    /// `SurfaceRecord` of each pixel.
    Surface,
    /// Geometric normal of each pixel's surface.
    Normals,
    /// Axis of each pixel's hemisphere.
    Axes,
    /// Position of each pixel's surface in the previous frame.
    PreviousPosition,
    /// Estimates of this frame's samples alone.
    Current,
    /// Bent normals of this frame's samples.
    CurrentBent,
    /// Ambient visibility of each ray of a launch.
    Samples,
    /// Number of occlusion rays traced.
    RayCount,
    /// Estimates accumulated over this frame and those before.
    History,
    /// Accumulated bent normals.
    BentHistory,
    /// Estimates between the steps of a filter, two buffers used alternately.
    Filtered(usize),
    /// Bent normals between the steps of a filter.
    FilteredBent(usize),
    /// Ambient visibility, filtered.
    Result,
    /// Bent normals, filtered.
    BentResult,
    /// The displayed image, 8-bit RGBA.
    DisplayImage,
    /// Counts of a debug view.
    DebugCounts,
    /// Radiance: diffuse albedo and roughness of each pixel's surface.
    Materials,
    /// Radiance: emission and background seen directly.
    Direct,
    /// Radiance: what the ray through each pixel hits, where paths can begin there.
    KnownHits,
    /// Radiance: this frame's samples of diffuse reflection, divided by the albedo.
    CurrentDiffuse,
    /// Radiance: this frame's samples of the rest.
    CurrentSpecular,
    /// Radiance: distance of what each pixel reflects.
    ReflectedDistance,
    /// Radiance: accumulated diffuse reflection.
    DiffuseHistory,
    /// Radiance: accumulated rest.
    SpecularHistory,
    /// Radiance: estimates between the steps of a filter, two buffers used alternately for diffuse
    /// reflection, and two for the rest.
    FilteredRadiance(usize),
    /// Radiance: the filtered image.
    Composed,
    /// Samples since the image came to rest.
    Rest,
    /// Their mean and the variance of that: the input of non-local means.
    RestNoise,
    /// Their mean after non-local means.
    Denoised,
    /// Radiance: the parts of which those samples consist.
    RestParts,
    /// The mean over frames whose samples lie at different places within the pixels.
    ResolvedHistory,
    /// The final image: value and coverage.
    Resolved,
    /// Larsen: number of point lights visible from each pixel.
    VisibleLights,
    /// Larsen: occlusion at half resolution.
    Occlusion,
    /// Larsen: one minus occlusion, blurred, at full resolution.
    Combined,
    /// Larsen: result of the previous frame.
    PreviousResult,
}

/// How long the contents of a resource are needed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lifetime {
    /// On the host, or in the tracer's memory: no buffer is allocated.
    Host,
    /// From its first pass to its last in a frame: others may share the memory.
    Frame,
    /// Until it is written again.
    Kept,
    /// Until the next frame has used it: double buffered.
    Pair,
}

/// Quantities from which the sizes of resources follow.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extent {
    /// Number of pixels.
    pub pixels: u64,
    /// Number of pixels at half resolution per axis.
    pub half_pixels: u64,
    /// Maximum rays of a launch.
    pub launch_rays: u64,
}

/// Description of a resource's buffer.
struct Description {
    name: &'static str,
    bytes: u64,
    lifetime: Lifetime,
}

impl Resource {
    fn describe(self, extent: &Extent) -> Description {
        use Lifetime::{Frame, Host, Kept, Pair};
        let Extent { pixels, half_pixels, launch_rays } = *extent;

        // All are in the device's memory, also what the host reads: a GPU takes ten times as long
        // to write to the host's, pixel by pixel.
        let device = |name, bytes, lifetime| Description { name, bytes, lifetime };
        match self {
            Self::Camera | Self::Scene | Self::FrameNumber | Self::DisplaySettings => device("host", 0, Host),
            Self::Guide => device("guide", PAIR_BYTES * pixels, Pair),
            Self::Surface => device("surfaces", SURFACE_BYTES * pixels, Kept),
            Self::Normals => device("normals", QUAD_BYTES * pixels, Kept),
            Self::Axes => device("axes of hemispheres", VECTOR_BYTES * pixels, Kept),
            Self::PreviousPosition => device("previous positions", VECTOR_BYTES * pixels, Kept),
            Self::Current => device("estimates of the frame", PAIR_BYTES * pixels, Frame),
            Self::CurrentBent => device("bent normals of the frame", VECTOR_BYTES * pixels, Frame),
            Self::Samples => device("samples", 4 * launch_rays, Frame),
            Self::RayCount => device("number of rays", 4, Kept),
            Self::History => device("history", PAIR_BYTES * pixels, Pair),
            Self::BentHistory => device("bent history", VECTOR_BYTES * pixels, Pair),
            Self::Filtered(_) => device("filtered estimates", PAIR_BYTES * pixels, Frame),
            Self::FilteredBent(_) => device("filtered bent normals", VECTOR_BYTES * pixels, Frame),
            Self::Result => device("ambient visibility", 4 * pixels, Kept),
            Self::BentResult => device("bent normals", VECTOR_BYTES * pixels, Kept),
            Self::DisplayImage => device("display", 4 * pixels, Kept),
            Self::DebugCounts => device("counts of a debug view", 4 * pixels, Kept),
            Self::Materials => device("materials of surfaces", QUAD_BYTES * pixels, Kept),
            Self::Direct => device("direct view", QUAD_BYTES * pixels, Kept),
            Self::KnownHits => device("hits of camera rays", size_of::<KnownHit>() as u64 * pixels, Kept),
            Self::CurrentDiffuse => device("diffuse samples of the frame", RADIANCE_BYTES * pixels, Frame),
            Self::CurrentSpecular => device("other samples of the frame", RADIANCE_BYTES * pixels, Frame),
            Self::ReflectedDistance => device("reflected distances", 4 * pixels, Frame),
            Self::DiffuseHistory => device("diffuse history", RADIANCE_BYTES * pixels, Pair),
            Self::SpecularHistory => device("other history", RADIANCE_BYTES * pixels, Pair),
            Self::FilteredRadiance(_) => device("filtered radiance", RADIANCE_BYTES * pixels, Frame),
            Self::Composed => device("composed image", QUAD_BYTES * pixels, Frame),
            Self::Rest => device("samples at rest", RADIANCE_BYTES * pixels, Kept),
            Self::RestNoise => device("noise at rest", PAIR_BYTES * pixels, Frame),
            Self::Denoised => device("denoised samples at rest", 4 * pixels, Kept),
            Self::RestParts => device("parts at rest", REST_PARTS_BYTES * pixels, Kept),
            Self::ResolvedHistory => device("resolved history", QUAD_BYTES * pixels, Pair),
            Self::Resolved => device("resolved image", QUAD_BYTES * pixels, Kept),
            Self::VisibleLights => device("visible lights", 4 * pixels, Frame),
            Self::Occlusion => device("occlusion", 4 * half_pixels, Frame),
            Self::Combined => device("combined", 4 * pixels, Frame),
            Self::PreviousResult => device("previous frame", 4 * pixels, Frame),
        }
    }

    /// Words of 32 bits of a pixel's record.
    pub fn words(self) -> u32 {
        let pixel = Extent { pixels: 1, ..Default::default() };
        (self.describe(&pixel).bytes / 4) as u32
    }

    /// Returns true if its contents are lost after its last pass in a frame.
    pub fn is_transient(self) -> bool {
        self.describe(&Extent::default()).lifetime == Lifetime::Frame
    }
}

/// Resources that a pass reads and writes: barriers, memory and skipping follow from them.
#[derive(Clone, Debug, Default)]
pub struct ResourceUse {
    /// Resources read.
    pub reads: Vec<Resource>,
    /// Resources of the previous frame that are read.
    pub previous: Vec<Resource>,
    /// Resources written, which may be read, too.
    pub writes: Vec<Resource>,
    /// Resources among the written ones that are filled with a word first.
    pub clears: Vec<(Resource, u32)>,
}

impl ResourceUse {
    /// Declares resources that are read and written.
    pub fn new(reads: &[Resource], writes: &[Resource]) -> Self {
        Self { reads: reads.to_vec(), writes: writes.to_vec(), ..Default::default() }
    }

    /// Adds resources of the previous frame that are read.
    pub fn previous(mut self, resources: &[Resource]) -> Self {
        self.previous.extend(resources);
        self
    }

    /// Adds resources that are read.
    pub fn and_reads(mut self, resources: &[Resource]) -> Self {
        self.reads.extend(resources);
        self
    }

    /// Adds resources that are written if `wanted` is true.
    pub fn and_writes(mut self, wanted: bool, resources: &[Resource]) -> Self {
        self.writes.extend(resources.iter().filter(|_| wanted));
        self
    }

    /// Adds a resource that is filled with a word first.
    pub fn clears(mut self, resource: Resource, word: u32) -> Self {
        self.clears.push((resource, word));
        self
    }

    /// All resources of this frame that are read or written.
    pub fn touched(&self) -> impl Iterator<Item = Resource> + '_ {
        self.reads.iter().chain(&self.previous).chain(&self.writes).copied()
    }
}

/// A resource that has a buffer.
struct Entry {
    resource: Resource,
    /// Indices of its buffers: one, or with [`Lifetime::Pair`] this and the previous frame's.
    buffers: [usize; 2],
    /// Incremented whenever it is written.
    version: u64,
}

/// The memory of a frame's resources.
pub struct Resources {
    extent: Extent,
    buffers: Vec<Buffer>,
    entries: Vec<Entry>,
    /// Versions of resources on the host.
    host: Vec<(Resource, u64)>,
}

impl Resources {
    /// Creates it without any buffer.
    pub fn new(extent: Extent) -> Self {
        Self { extent, buffers: Vec::new(), entries: Vec::new(), host: Vec::new() }
    }

    /// The quantities from which sizes follow.
    pub fn extent(&self) -> Extent {
        self.extent
    }

    /// Allocates buffers of resources that stages write and that have none yet. `stages` has the
    /// uses of each stage's passes. Resources that no pass writes have no buffer and address 0.
    pub fn allocate(&mut self, device: &Arc<Device>, stages: &[Vec<ResourceUse>]) -> Result<()> {
        // first and last stage that use a resource, in the order in which they are first written
        let mut spans: Vec<(Resource, [usize; 2])> = Vec::new();
        for (k, stage) in stages.iter().enumerate() {
            for uses in stage {
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

        // buffers of transient resources, with the last stage that uses them
        let mut shared: Vec<(usize, u64, usize)> = Vec::new();

        // a buffer each, or that of a transient resource which is no longer used by then
        for (resource, [first, last]) in spans {
            let Description { name, bytes, lifetime } = resource.describe(&self.extent);
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
                        self.buffers.push(Buffer::new(device, name, bytes, Memory::Device)?);
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

    /// Index of a resource's buffer; resources that share memory have the same.
    pub fn buffer_index(&self, resource: Resource) -> Option<usize> {
        self.entry(resource).map(|e| e.buffers[0])
    }

    /// Index of the buffer that holds the previous frame's contents.
    pub fn previous_index(&self, resource: Resource) -> Option<usize> {
        self.entry(resource).map(|e| e.buffers[1])
    }

    /// Buffer of a resource; `None` if no pass writes it.
    pub fn buffer(&self, resource: Resource) -> Option<&Buffer> {
        self.buffer_index(resource).map(|k| &self.buffers[k])
    }

    /// Device address of a resource; 0 if no pass writes it.
    pub fn address(&self, resource: Resource) -> u64 {
        self.buffer(resource).map_or(0, Buffer::address)
    }

    /// Device address of the previous frame's contents of a double-buffered resource.
    pub fn previous_address(&self, resource: Resource) -> u64 {
        self.previous_index(resource).map_or(0, |k| self.buffers[k].address())
    }

    /// Reads back `count` records; none if no pass writes the resource.
    pub fn read<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(
        &self,
        resource: Resource,
        count: u64,
    ) -> Result<Vec<T>> {
        match self.buffer(resource) {
            Some(buffer) => Ok(bytemuck::pod_collect_to_vec(&buffer.read(0, count * size_of::<T>() as u64)?)),
            None => Ok(Vec::new()),
        }
    }

    /// Marks a resource as changed.
    pub fn touch(&mut self, resource: Resource) {
        if let Some(entry) = self.entries.iter_mut().find(|e| e.resource == resource) {
            entry.version += 1;
        } else if let Some(host) = self.host.iter_mut().find(|h| h.0 == resource) {
            host.1 += 1;
        } else {
            self.host.push((resource, 1));
        }
    }

    /// Version of a resource, which is incremented with each change.
    pub fn version(&self, resource: Resource) -> u64 {
        let host = || self.host.iter().find(|h| h.0 == resource).map_or(0, |h| h.1);
        self.entry(resource).map_or_else(host, |e| e.version)
    }

    /// Swaps the buffers of a double-buffered resource.
    pub fn swap(&mut self, resource: Resource) {
        if let Some(entry) = self.entries.iter_mut().find(|e| e.resource == resource) {
            entry.buffers.swap(0, 1);
        }
    }
}
