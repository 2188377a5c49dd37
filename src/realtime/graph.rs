//! The frame graph: passes declare which resources they read and write. From that follow memory,
//! barriers, timings, and which passes are skipped because no input has changed.

use std::marker::PhantomData;
use std::sync::Arc;

use super::display::Display;
use super::plan::FramePlan;
use super::resources::{Extent, Resource, ResourceUse, Resources};
use super::settings::Settings;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::film::block::Block;
use crate::film::camera::CameraRecord;
use crate::gpu::{Buffer, Commands, ComputePipeline, Device, Memory, Recorder, Timing};
use crate::interface::records::frame::MovedRecord;
use crate::scene::Scene;
use crate::shaders::LANES;
use crate::tracer::{Push, Tracer};

/// Maximum launches per submission, so that other users of the device are not blocked for long.
const MAX_LAUNCHES: usize = 8;

/// The inputs of the passes of a frame.
pub struct Frame<'a> {
    /// The tracer, which holds the scene.
    pub tracer: &'a Tracer,
    /// Settings of the pipeline.
    pub settings: &'a Settings,
    /// The whole image as a block.
    pub block: Block,
    /// The camera of this frame.
    pub camera: CameraRecord,
    /// Objects that moved since the previous frame.
    pub moved: &'a [MovedRecord],
    /// The plan of the frame.
    pub plan: &'a FramePlan,
    /// From the space of the previous frame's camera to that of this one's, three rows.
    pub previous_to_camera: [[f32; 4]; 3],
    /// Whether the camera is where it was in the previous frame, and sees as much.
    pub camera_rests: bool,
    /// Address of the frame's `FrameParams`.
    pub params: u64,
    /// The buffer to display, if any.
    pub display: Option<Display>,
}

impl Frame<'_> {
    /// Push constants of a range: scene, address of the pass's parameters, and range.
    pub fn push(&self, pass: u64, range: Range) -> Push {
        let Range { first, count } = range;
        Push { scene: self.tracer.scene_address(), pass, first, count, ..Default::default() }
    }
}

/// A range of invocations or rays of a pass: `first .. first + count`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Range {
    /// First index.
    pub first: u32,
    /// Number of invocations or rays.
    pub count: u32,
}

impl Range {
    /// A single range of `count` invocations.
    pub fn all(count: u32) -> Vec<Self> {
        vec![Self { first: 0, count }]
    }

    /// Splits rays into launches of whole groups of `group` rays, of at most `most` or a group.
    pub fn launches(rays: u32, group: u32, most: u32) -> Vec<Self> {
        let most = (most / group).max(1) * group;
        (0..rays).step_by(most as usize).map(|first| Self { first, count: most.min(rays - first) }).collect()
    }
}

/// A pass of a frame: a file in src/realtime/passes.
pub trait Pass {
    /// The resources that it reads and writes with this display.
    fn uses(&self, display: Option<&Display>) -> ResourceUse;

    /// Returns true if the pass runs in frames with this display.
    fn is_enabled(&self, _display: Option<&Display>) -> bool {
        true
    }

    /// Writes the parameters of the pass, before the frame is recorded.
    ///
    /// # Errors
    /// Those of the device.
    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()>;

    /// Records the pass over a range, timed under its label.
    ///
    /// # Errors
    /// Those of what it draws.
    fn record(&self, recorder: &mut Recorder, frame: &Frame, resources: &Resources, range: Range) -> Result<()>;

    /// Returns true if the pass submits its work itself, because the host decides in between what
    /// comes next: then [`Pass::run`] is called in place of [`Pass::record`]. Such a pass is the
    /// only one of its stage, and clears its resources itself.
    fn is_run_by_host(&self) -> bool {
        false
    }

    /// Moves the lights that it samples to where they are in `scene`, which is that of the tracer
    /// in another pose. Returns true if they have moved.
    ///
    /// # Errors
    /// Those of the device; [`Error::Scene`] for lights that need other shaders.
    fn move_lights(&mut self, _tracer: &Tracer, _scene: &Scene) -> Result<bool> {
        Ok(false)
    }

    /// Number of rays of its last frame, if the host knows it.
    fn rays(&self) -> u64 {
        0
    }

    /// Runs the pass over a range in submissions of its own, and waits for them. `control` is asked
    /// between launches whether to stop. Returns their times.
    ///
    /// # Errors
    /// Those of the device; [`Error::Interrupted`] when `control` says so.
    fn run(
        &mut self,
        commands: &mut Commands,
        frame: &Frame,
        resources: &Resources,
        range: Range,
        _control: Option<&mut dyn Control>,
    ) -> Result<Vec<Timing>> {
        let mut outcome = Ok(());
        let timings = commands.run(|r| outcome = self.record(r, frame, resources, range))?;
        outcome.map(|()| timings)
    }
}

/// The frames in which a stage runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Frames {
    All,
    Short,
    Long,
}

/// Passes that are recorded one after another for each of several ranges.
pub struct Stage {
    passes: Vec<Box<dyn Pass>>,
    ranges: Vec<Range>,
    frames: Frames,
    /// Versions of the resources read when the stage was last recorded.
    versions: Vec<u64>,
}

impl Stage {
    /// Creates a stage of passes that hand results on within a range.
    pub fn new(passes: Vec<Box<dyn Pass>>, ranges: Vec<Range>) -> Self {
        Self { passes, ranges, frames: Frames::All, versions: Vec::new() }
    }

    /// Has the stage run in long frames alone ([`super::frame_samples`]).
    pub fn in_long_frames(self) -> Self {
        Self { frames: Frames::Long, ..self }
    }

    /// Has the stage run in all frames but long ones.
    pub fn in_short_frames(self) -> Self {
        Self { frames: Frames::Short, ..self }
    }

    fn is_run_by_host(&self) -> bool {
        self.passes.iter().any(|p| p.is_run_by_host())
    }

    /// Resources that its passes read and write without a display.
    fn uses(&self) -> Vec<ResourceUse> {
        self.passes.iter().map(|p| p.uses(None)).collect()
    }
}

/// The passes of a frame in order, and their memory.
pub struct Graph {
    stages: Vec<Stage>,
    resources: Resources,
    commands: Commands,
    /// The number of rays, where the host cannot read that of the device.
    ray_count: Option<Buffer>,
    /// Resources that the frame under way writes.
    unfinished: Vec<Resource>,
}

impl Graph {
    /// Allocates the resources of the stages.
    pub fn new(device: &Arc<Device>, extent: Extent, stages: Vec<Stage>) -> Result<Self> {
        let mut resources = Resources::new(extent);
        resources.allocate(device, &stages.iter().map(Stage::uses).collect::<Vec<_>>())?;
        let needs_copy = resources.buffer(Resource::RayCount).is_some_and(|b| b.bytes().is_none());
        let ray_count = || Buffer::new(device, "number of rays for the host", 4, Memory::Readback);
        let ray_count = needs_copy.then(ray_count).transpose()?;
        Ok(Self { stages, resources, commands: Commands::new(device)?, ray_count, unfinished: Vec::new() })
    }

    /// Adds stages after all others. Returns false if that discarded the contents of all resources:
    /// stages that read transient ones have them allocated anew, because their memory is another's
    /// by then.
    pub fn extend(&mut self, device: &Arc<Device>, stages: Vec<Stage>) -> Result<bool> {
        let uses: Vec<_> = stages.iter().map(Stage::uses).collect();
        let keeps = !uses.iter().flatten().any(|u| u.reads.iter().any(|r| r.is_transient()));
        if keeps {
            self.resources.allocate(device, &uses)?;
            self.stages.extend(stages);
            return Ok(true);
        }
        self.stages.extend(stages);
        // the old memory first
        let extent = self.resources.extent();
        self.resources = Resources::new(extent);
        self.resources.allocate(device, &self.stages.iter().map(Stage::uses).collect::<Vec<_>>())?;
        self.invalidate();
        Ok(false)
    }

    /// Rays of the last frame, as the device or the host counted them.
    ///
    /// # Errors
    /// Those of the device.
    pub fn rays(&self) -> Result<u64> {
        if let Some(count) = self.ray_count.as_ref().or(self.resources.buffer(Resource::RayCount)) {
            return Ok(bytemuck::pod_read_unaligned::<u32>(&count.read(0, 4)?).into());
        }
        Ok(self.stages.iter().flat_map(|s| &s.passes).map(|p| p.rays()).sum())
    }

    /// Moves the lights to where they are in `scene`. Returns true if any have moved.
    ///
    /// # Errors
    /// Those of the passes ([`Pass::move_lights`]).
    pub fn move_lights(&mut self, tracer: &Tracer, scene: &Scene) -> Result<bool> {
        let mut passes = self.stages.iter_mut().flat_map(|s| &mut s.passes);
        passes.try_fold(false, |moved, pass| Ok(pass.move_lights(tracer, scene)? || moved))
    }

    /// The memory of the passes.
    pub fn resources(&self) -> &Resources {
        &self.resources
    }

    /// Marks a resource as changed by the host.
    pub fn touch(&mut self, resource: Resource) {
        self.resources.touch(resource);
    }

    /// Chooses the stages to record in this frame: those that read a resource that has changed
    /// since they were last recorded, or one of the previous frame, and those that write a
    /// transient resource. Double-buffered resources that are written again are swapped, so
    /// [`Graph::resources`] is valid for this frame from here on.
    pub fn begin(&mut self, display: Option<&Display>, is_long: bool) -> Vec<usize> {
        let mut recorded = Vec::new();
        self.unfinished.clear();
        let others = if is_long { Frames::Short } else { Frames::Long };
        for (k, stage) in self.stages.iter_mut().enumerate().filter(|(_, s)| s.frames != others) {
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
            self.unfinished.append(&mut written);
            recorded.push(k);
        }
        recorded
    }

    /// Has the next frame record all stages, because a frame was not finished.
    pub fn invalidate(&mut self) {
        self.stages.iter_mut().for_each(|s| s.versions.clear());
    }

    /// Takes an unfinished frame back: double-buffered resources are the frame before's again.
    /// The contents of [`Resource::Rest`] and [`Resource::RestParts`] are lost.
    pub fn take_back(&mut self) {
        for resource in self.unfinished.drain(..) {
            self.resources.swap(resource);
        }
        self.invalidate();
    }

    /// Records, submits and waits for the stages that [`Graph::begin`] chose, or for some of them
    /// in their order. Returns the times of passes, in order. With `control` each launch is a
    /// submission of its own, and it is asked between them whether to stop.
    ///
    /// # Errors
    /// Those of the passes and the device; [`Error::Interrupted`] when `control` says so.
    pub fn run(&mut self, frame: &Frame, stages: &[usize], control: Option<&mut dyn Control>) -> Result<Vec<Timing>> {
        // parameters of all passes
        let display = frame.display.as_ref();
        for &k in stages {
            for pass in self.stages[k].passes.iter_mut().filter(|p| p.is_enabled(display)) {
                pass.prepare(frame, &self.resources)?;
            }
        }

        // submissions: a stage of several launches is cut, others go with what is before them
        let launches: Vec<(usize, usize)> =
            stages.iter().flat_map(|&s| (0..self.stages[s].ranges.len()).map(move |k| (s, k))).collect();
        let (mut timings, resources) = (Vec::new(), &self.resources);
        let mut rest = launches.as_slice();
        let mut control = control;
        while !rest.is_empty() {
            let by_host = |stage: usize| self.stages[stage].is_run_by_host();
            let mut several = 0;
            let end = match control {
                Some(_) => Some(1),
                None if by_host(rest[0].0) => Some(1),
                None => rest.iter().position(|&(stage, _)| {
                    several += usize::from(self.stages[stage].ranges.len() > 1);
                    several > MAX_LAUNCHES || by_host(stage)
                }),
            };
            let (submission, others) = rest.split_at(end.unwrap_or(rest.len()));
            rest = others;
            if let Some(control) = &mut control
                && control.should_stop()?
            {
                return Err(Error::Interrupted);
            }

            // a pass that submits its work itself
            if let &[(stage, k)] = submission
                && by_host(stage)
            {
                let Stage { passes, ranges, .. } = &mut self.stages[stage];
                for pass in passes.iter_mut().filter(|p| p.is_enabled(display)) {
                    let control = control.as_mut().map(|c| &mut **c as &mut dyn Control);
                    timings.extend(pass.run(&mut self.commands, frame, resources, ranges[k], control)?);
                }
                continue;
            }

            // all others; with the last one the host is told how many rays there were
            let mut outcome = Ok(());
            let counted = self.ray_count.as_ref().filter(|_| rest.is_empty()).zip(resources.buffer(Resource::RayCount));
            timings.extend(self.commands.run(|r| {
                let mut hazards = Hazards::default();
                outcome = submission.iter().try_for_each(|&(stage, k)| {
                    record_range(r, frame, resources, &mut hazards, &self.stages[stage], k)
                });
                if let Some((to, from)) = counted {
                    r.barrier();
                    r.copy(from, 0, to, 0, 4);
                }
            })?);
            outcome?;
        }
        Ok(timings)
    }

    /// After a frame whose stages have all run: it cannot be taken back any more.
    pub fn finish(&mut self) {
        self.unfinished.clear();
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
                hazards.separate(r, &[], &[resources.buffer_index(resource)]);
                r.fill(buffer, buffer.size(), word);
            }
        }
    }
    for pass in enabled() {
        let uses = pass.uses(display);
        let reads: Vec<_> = uses.reads.iter().map(|u| resources.buffer_index(*u)).collect();
        let previous: Vec<_> = uses.previous.iter().map(|u| resources.previous_index(*u)).collect();
        let writes: Vec<_> = uses.writes.iter().map(|u| resources.buffer_index(*u)).collect();
        hazards.separate(r, &[reads, previous].concat(), &writes);
        pass.record(r, frame, resources, stage.ranges[range])?;
    }
    Ok(())
}

/// Buffers read and written since the last barrier.
#[derive(Default)]
struct Hazards {
    read: Vec<usize>,
    written: Vec<usize>,
}

impl Hazards {
    /// Records a barrier if a use conflicts with those since the last one; then notes the use.
    fn separate(&mut self, r: &mut Recorder, reads: &[Option<usize>], writes: &[Option<usize>]) {
        if self.conflicts(reads, writes) {
            r.barrier();
            *self = Self::default();
        }
        self.read.extend(reads.iter().flatten());
        self.written.extend(writes.iter().flatten());
    }

    fn conflicts(&self, reads: &[Option<usize>], writes: &[Option<usize>]) -> bool {
        let is_in = |all: &[usize], k: &Option<usize>| k.is_some_and(|k| all.contains(&k));
        reads.iter().any(|k| is_in(&self.written, k))
            || writes.iter().any(|k| is_in(&self.written, k) || is_in(&self.read, k))
    }
}

/// The parameter record of a pass in device memory.
pub struct Params<T> {
    buffer: Buffer,
    record: PhantomData<T>,
}

impl<T: bytemuck::NoUninit> Params<T> {
    /// Allocates the record.
    pub fn new(device: &Arc<Device>, name: &str) -> Result<Self> {
        Ok(Self { buffer: Buffer::new(device, name, size_of::<T>() as u64, Memory::Upload)?, record: PhantomData })
    }

    /// Writes the record; no submission that reads it may be in flight.
    pub fn write(&mut self, record: &T) -> Result<()> {
        self.buffer.write(0, bytemuck::bytes_of(record))
    }

    /// Device address.
    pub fn address(&self) -> u64 {
        self.buffer.address()
    }

    /// Push constants of a range: scene, parameters and range.
    pub fn push(&self, frame: &Frame, range: Range) -> Push {
        frame.push(self.address(), range)
    }

    /// Records a compute pipeline with one invocation per element of `range`.
    pub fn dispatch(
        &self,
        r: &mut Recorder,
        label: &'static str,
        pipeline: &ComputePipeline,
        frame: &Frame,
        range: Range,
    ) {
        self.dispatch_strips(r, label, pipeline, frame, range, 1);
    }

    /// Records a compute pipeline each invocation of which takes `strip` elements of `range`.
    pub fn dispatch_strips(
        &self,
        r: &mut Recorder,
        label: &'static str,
        pipeline: &ComputePipeline,
        frame: &Frame,
        range: Range,
        strip: u32,
    ) {
        let push = self.push(frame, range);
        r.timed(label, |r| r.dispatch(pipeline, &push, range.count.div_ceil(strip * LANES)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracer::stream::LAUNCH_RAYS;

    #[test]
    fn hazards_are_writes_before_uses() {
        let hazards = Hazards { read: vec![1], written: vec![2] };
        assert!(!hazards.conflicts(&[Some(1), Some(3), None], &[Some(3), None]));
        assert!(
            hazards.conflicts(&[Some(2)], &[])
                && hazards.conflicts(&[], &[Some(1)])
                && hazards.conflicts(&[], &[Some(2)])
        );
    }

    #[test]
    fn launches_are_of_whole_groups() {
        let ranges = Range::launches(2 * LAUNCH_RAYS, 3, LAUNCH_RAYS);
        assert!(ranges.iter().all(|r| r.first % 3 == 0 && r.count <= LAUNCH_RAYS));
        assert_eq!(ranges.iter().map(|r| r.count).sum::<u32>(), 2 * LAUNCH_RAYS);
        assert_eq!(Range::launches(100, 64, LAUNCH_RAYS), Range::all(100));
        assert_eq!(Range::launches(100, 64, 10).len(), 2);
    }
}
