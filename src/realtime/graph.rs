//! The frame graph: what passes read and write is declared, and what follows from it is derived here: which memory there is, where
//! barriers are, what is timed, and which passes are left out because nothing that they read has changed.

use std::marker::PhantomData;
use std::sync::Arc;

use super::display::Display;
use super::resources::{Extent, Resource, Resources};
use super::settings::Settings;
use crate::error::Result;
use crate::film::block::Block;
use crate::film::camera::CameraRecord;
use crate::gpu::{Buffer, Commands, ComputePipeline, Device, Memory, Recorder, Timing};
use crate::interface::records::frame::MovedRecord;
use crate::shaders::LANES;
use crate::tracer::stream::LAUNCH_RAYS;
use crate::tracer::{Push, Tracer};

/// Launches of a submission: between them others get their turn on the device.
const MAX_LAUNCHES: usize = 8;

/// What passes are told of a frame.
pub struct Frame<'a> {
    /// What traces.
    pub tracer: &'a Tracer,
    /// How frames are made.
    pub settings: &'a Settings,
    /// All of the image.
    pub block: Block,
    /// From where it is seen.
    pub camera: CameraRecord,
    /// What has moved since the previous frame.
    pub moved: &'a [MovedRecord],
    /// Counts up.
    pub number: u32,
    /// Address of the frame's `FrameParams`.
    pub params: u64,
    /// What is shown, if anything.
    pub display: Option<Display>,
}

/// Invocations or rays of a pass: `first .. first + count`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Range {
    /// The first.
    pub first: u32,
    /// How many.
    pub count: u32,
}

impl Range {
    /// One for all.
    pub fn all(count: u32) -> Vec<Self> {
        vec![Self { first: 0, count }]
    }

    /// Launches of rays, each of whole groups of `group` rays.
    pub fn launches(rays: u32, group: u32) -> Vec<Self> {
        let most = LAUNCH_RAYS / group * group;
        (0..rays).step_by(most as usize).map(|first| Self { first, count: most.min(rays - first) }).collect()
    }
}

/// What a pass reads and writes.
#[derive(Clone, Debug, Default)]
pub struct ResourceUse {
    /// What it reads.
    pub reads: Vec<Resource>,
    /// What it reads as the previous frame left it.
    pub previous: Vec<Resource>,
    /// What it writes, and may read besides.
    pub writes: Vec<Resource>,
    /// Of what it writes: what is filled with a word before.
    pub clears: Vec<(Resource, u32)>,
}

impl ResourceUse {
    /// Reads and writes.
    pub fn new(reads: &[Resource], writes: &[Resource]) -> Self {
        Self { reads: reads.to_vec(), writes: writes.to_vec(), ..Default::default() }
    }

    /// Reads besides what the previous frame left.
    pub fn previous(mut self, resources: &[Resource]) -> Self {
        self.previous.extend(resources);
        self
    }

    /// Reads besides.
    pub fn and_reads(mut self, resources: &[Resource]) -> Self {
        self.reads.extend(resources);
        self
    }

    /// Writes besides, where `wanted`.
    pub fn and_writes(mut self, wanted: bool, resources: &[Resource]) -> Self {
        self.writes.extend(resources.iter().filter(|_| wanted));
        self
    }

    /// What is filled with a word before.
    pub fn clears(mut self, resource: Resource, word: u32) -> Self {
        self.clears.push((resource, word));
        self
    }

    /// All of them.
    pub fn touched(&self) -> impl Iterator<Item = Resource> + '_ {
        self.reads.iter().chain(&self.previous).chain(&self.writes).copied()
    }
}

/// A pass of a frame: a file in src/realtime/passes.
pub trait Pass {
    /// What it reads and writes with this display.
    fn uses(&self, display: Option<&Display>) -> ResourceUse;

    /// Does it take part in frames with this display?
    fn is_enabled(&self, _display: Option<&Display>) -> bool {
        true
    }

    /// Writes the record of its parameters, before the frame is recorded.
    ///
    /// # Errors
    /// Those of the device.
    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()>;

    /// Records it over a range, timed under its name.
    ///
    /// # Errors
    /// Those of what it draws.
    fn record(&self, recorder: &mut Recorder, frame: &Frame, resources: &Resources, range: Range) -> Result<()>;
}

/// Passes that are recorded in turn for each of several ranges; mostly it is one pass and one range.
pub struct Stage {
    passes: Vec<Box<dyn Pass>>,
    ranges: Vec<Range>,
    /// Versions of what its passes read when they were last recorded.
    versions: Vec<u64>,
}

impl Stage {
    /// Passes that hand results on within a range.
    pub fn new(passes: Vec<Box<dyn Pass>>, ranges: Vec<Range>) -> Self {
        Self { passes, ranges, versions: Vec::new() }
    }

    /// What its passes read and write while nothing is shown.
    pub fn uses(&self) -> impl Iterator<Item = ResourceUse> + '_ {
        self.passes.iter().map(|p| p.uses(None))
    }
}

/// The passes of a frame in order, and their memory.
pub struct Graph {
    stages: Vec<Stage>,
    resources: Resources,
    commands: Commands,
}

impl Graph {
    /// Allocates what the passes need.
    pub fn new(device: &Arc<Device>, extent: Extent, stages: Vec<Stage>) -> Result<Self> {
        let mut resources = Resources::new(extent);
        resources.allocate(device, &stages)?;
        Ok(Self { stages, resources, commands: Commands::new(device)? })
    }

    /// Adds stages after all others.
    pub fn extend(&mut self, device: &Arc<Device>, stages: Vec<Stage>) -> Result<()> {
        self.resources.allocate(device, &stages)?;
        self.stages.extend(stages);
        Ok(())
    }

    /// The memory of the passes.
    pub fn resources(&self) -> &Resources {
        &self.resources
    }

    /// Notes that something on the host has changed.
    pub fn touch(&mut self, resource: Resource) {
        self.resources.touch(resource);
    }

    /// Decides which stages are recorded in this frame: those that read something that has changed since they were last, or that the
    /// previous frame left, or that write something that does not outlive a frame. Resources with two buffers take turns where they are
    /// written again, so what [`Graph::resources`] says is this frame's from here on.
    pub fn begin(&mut self, display: Option<&Display>) -> Vec<usize> {
        let mut recorded = Vec::new();
        for (k, stage) in self.stages.iter_mut().enumerate() {
            let enabled = || stage.passes.iter().filter(|p| p.is_enabled(display));
            let uses: Vec<ResourceUse> = enabled().map(|p| p.uses(display)).collect();
            if uses.is_empty() {
                continue;
            }
            let versions: Vec<u64> = uses.iter().flat_map(|u| &u.reads).map(|r| self.resources.version(*r)).collect();
            let must = uses.iter().any(|u| !u.previous.is_empty() || u.writes.iter().any(|r| r.is_transient()));
            if !must && stage.versions == versions {
                continue;
            }
            stage.versions = versions;
            let mut written: Vec<Resource> = Vec::new();
            for &resource in uses.iter().flat_map(|u| &u.writes) {
                if !written.contains(&resource) {
                    written.push(resource);
                    self.resources.touch(resource);
                    self.resources.swap(resource);
                }
            }
            recorded.push(k);
        }
        recorded
    }

    /// Records, submits and waits for the stages that [`Graph::begin`] chose. Returns the times of passes, in order.
    ///
    /// # Errors
    /// Those of the passes and the device.
    pub fn run(&mut self, frame: &Frame, stages: &[usize]) -> Result<Vec<Timing>> {
        let display = frame.display.as_ref();
        for &k in stages {
            for pass in self.stages[k].passes.iter_mut().filter(|p| p.is_enabled(display)) {
                pass.prepare(frame, &self.resources)?;
            }
        }
        let launches: Vec<(&Stage, usize)> =
            stages.iter().map(|&k| &self.stages[k]).flat_map(|s| (0..s.ranges.len()).map(move |k| (s, k))).collect();
        let (mut timings, resources) = (Vec::new(), &self.resources);
        // a stage of several launches is cut, others go with what is before them
        let mut rest = launches.as_slice();
        while !rest.is_empty() {
            let mut several = 0;
            let end = rest.iter().position(|(stage, _)| {
                several += usize::from(stage.ranges.len() > 1);
                several > MAX_LAUNCHES
            });
            let (submission, others) = rest.split_at(end.unwrap_or(rest.len()));
            rest = others;
            let mut outcome = Ok(());
            timings.extend(self.commands.run(|r| {
                let mut hazards = Hazards::default();
                outcome =
                    submission.iter().try_for_each(|(stage, k)| record_range(r, frame, resources, &mut hazards, stage, *k));
            })?);
            outcome?;
        }
        Ok(timings)
    }
}

fn record_range(
    r: &mut Recorder,
    frame: &Frame,
    resources: &Resources,
    hazards: &mut Hazards,
    stage: &Stage,
    range: usize,
) -> Result<()> {
    let display = frame.display.as_ref();
    let enabled = || stage.passes.iter().filter(|p| p.is_enabled(display));
    if range == 0 {
        for (resource, word) in enabled().flat_map(|p| p.uses(display).clears) {
            if let Some(buffer) = resources.buffer(resource) {
                hazards.before(r, &[], &[resources.buffer_index(resource)]);
                r.fill(buffer, buffer.size(), word);
            }
        }
    }
    for pass in enabled() {
        let uses = pass.uses(display);
        let reads: Vec<_> = uses.reads.iter().map(|u| resources.buffer_index(*u)).collect();
        let previous: Vec<_> = uses.previous.iter().map(|u| resources.previous_index(*u)).collect();
        let writes: Vec<_> = uses.writes.iter().map(|u| resources.buffer_index(*u)).collect();
        hazards.before(r, &[reads, previous].concat(), &writes);
        pass.record(r, frame, resources, stage.ranges[range])?;
    }
    Ok(())
}

/// Buffers that were read and written since the last barrier.
#[derive(Default)]
struct Hazards {
    read: Vec<usize>,
    written: Vec<usize>,
}

impl Hazards {
    /// A barrier, where what comes next reads what was written, or writes what was read or written. Then notes what comes next.
    fn before(&mut self, r: &mut Recorder, reads: &[Option<usize>], writes: &[Option<usize>]) {
        if self.conflicts(reads, writes) {
            r.barrier();
            *self = Self::default();
        }
        self.read.extend(reads.iter().flatten());
        self.written.extend(writes.iter().flatten());
    }

    fn conflicts(&self, reads: &[Option<usize>], writes: &[Option<usize>]) -> bool {
        let is_in = |all: &[usize], k: &Option<usize>| k.is_some_and(|k| all.contains(&k));
        reads.iter().any(|k| is_in(&self.written, k)) || writes.iter().any(|k| is_in(&self.written, k) || is_in(&self.read, k))
    }
}

/// A pass's record of parameters in device memory.
pub struct Params<T> {
    buffer: Buffer,
    record: PhantomData<T>,
}

impl<T: bytemuck::NoUninit> Params<T> {
    /// Allocates it.
    pub fn new(device: &Arc<Device>, name: &str) -> Result<Self> {
        Ok(Self { buffer: Buffer::new(device, name, size_of::<T>() as u64, Memory::Upload)?, record: PhantomData })
    }

    /// Writes it; nothing may be in flight.
    pub fn write(&mut self, record: &T) -> Result<()> {
        self.buffer.write(0, bytemuck::bytes_of(record))
    }

    /// Where it is.
    pub fn address(&self) -> u64 {
        self.buffer.address()
    }

    /// Push constants for a range: scene, parameters and range, and nothing else.
    pub fn push(&self, frame: &Frame, range: Range) -> Push {
        let Range { first, count } = range;
        Push { scene: frame.tracer.scene_address(), pass: self.address(), first, count, ..Default::default() }
    }

    /// Records a compute pipeline with an invocation for each of `range`.
    pub fn dispatch(&self, r: &mut Recorder, label: &'static str, pipeline: &ComputePipeline, frame: &Frame, range: Range) {
        let push = self.push(frame, range);
        r.timed(label, |r| r.dispatch(pipeline, &push, range.count.div_ceil(LANES)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hazards_are_writes_before_uses() {
        let hazards = Hazards { read: vec![1], written: vec![2] };
        assert!(!hazards.conflicts(&[Some(1), Some(3), None], &[Some(3), None]));
        assert!(hazards.conflicts(&[Some(2)], &[]) && hazards.conflicts(&[], &[Some(1)]) && hazards.conflicts(&[], &[Some(2)]));
    }

    #[test]
    fn launches_are_of_whole_groups() {
        let ranges = Range::launches(2 * LAUNCH_RAYS, 3);
        assert!(ranges.iter().all(|r| r.first % 3 == 0 && r.count <= LAUNCH_RAYS));
        assert_eq!(ranges.iter().map(|r| r.count).sum::<u32>(), 2 * LAUNCH_RAYS);
        assert_eq!(Range::launches(100, 64), Range::all(100));
    }
}
