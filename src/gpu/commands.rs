//! Recording and submitting work, with a timestamp pair around each pass.

use std::sync::Arc;

use ash::vk;

use super::buffer::Buffer;
use super::device::Device;
use super::pipeline::{ComputePipeline, RayTracingPipeline};
use super::result::Context;
use crate::error::Result;

/// Maximum number of work-groups along y and z on every device (Vulkan 1.3, Required Limits).
const MAX_WORKGROUPS: u32 = 65_535;

/// Maximum number of timed regions in one submission.
const MAX_REGIONS: u32 = 512;

/// Device time of a timed region.
#[derive(Clone, Debug, PartialEq)]
pub struct Timing {
    /// Name of the region.
    pub label: &'static str,
    /// Seconds between its first and last command.
    pub seconds: f64,
}

/// A command buffer that is recorded, submitted and waited for repeatedly.
pub struct Commands {
    pool: vk::CommandPool,
    buffer: vk::CommandBuffer,
    fence: vk::Fence,
    queries: Option<vk::QueryPool>,
    /// Number of queries to reset: those that the last submission wrote, and all before the first.
    written: u32,
    device: Arc<Device>,
}

impl Commands {
    /// Makes the pool, buffer, fence and timestamp queries.
    pub fn new(device: &Arc<Device>) -> Result<Self> {
        let raw = &device.raw;
        let pool_info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(device.queue_family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        // SAFETY (all calls below): plain objects of the living device; on an early return Drop
        // destroys null handles too
        let mut commands = Self {
            pool: unsafe { raw.create_command_pool(&pool_info, None) }.context("the command pool")?,
            buffer: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
            queries: None,
            written: 2 * MAX_REGIONS,
            device: device.clone(),
        };
        let info = vk::CommandBufferAllocateInfo::default().command_pool(commands.pool).command_buffer_count(1);
        commands.buffer = unsafe { raw.allocate_command_buffers(&info) }.context("the command buffer")?[0];
        commands.fence = unsafe { raw.create_fence(&vk::FenceCreateInfo::default(), None) }.context("the fence")?;
        if device.info.limits.timestamp_period > 0.0 {
            let info =
                vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(2 * MAX_REGIONS);
            commands.queries = Some(unsafe { raw.create_query_pool(&info, None) }.context("the timestamp queries")?);
        }
        Ok(commands)
    }

    /// Records with `record`, submits, waits until the device is done, and returns the timed
    /// regions in order. Writes of the work are visible to the host and to later submissions.
    pub fn run(&mut self, record: impl FnOnce(&mut Recorder)) -> Result<Vec<Timing>> {
        self.begin()?;
        let mut recorder = Recorder {
            device: &self.device,
            buffer: self.buffer,
            queries: self.queries,
            labels: Vec::new(),
            drew: false,
        };
        record(&mut recorder);
        recorder.final_barrier();
        let labels = recorder.labels;
        self.submit(&labels)
    }

    /// Begins recording.
    fn begin(&self) -> Result<()> {
        let raw = &self.device.raw;
        // SAFETY: the buffer and its queries are not in use: every submission was waited for
        unsafe {
            if let Some(queries) = self.queries.filter(|_| self.written > 0) {
                raw.reset_query_pool(queries, 0, self.written);
            }
            let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
            raw.begin_command_buffer(self.buffer, &begin).context("recording commands")
        }
    }

    /// Submits what was recorded, and waits for it.
    fn submit(&mut self, labels: &[&'static str]) -> Result<Vec<Timing>> {
        self.written = 2 * labels.len() as u32;
        let raw = &self.device.raw;
        // SAFETY: recording and submission follow the specification's order; the queue is locked
        unsafe {
            raw.end_command_buffer(self.buffer).context("recording commands")?;
            let buffers = [self.buffer];
            let submit = [vk::SubmitInfo::default().command_buffers(&buffers)];
            super::faults::submission(&self.device.is_lost).context("submitting work")?;
            let queue = self.device.queue.lock().unwrap_or_else(|e| e.into_inner());
            raw.queue_submit(*queue, &submit, self.fence).context("submitting work")?;
            drop(queue);
            raw.wait_for_fences(&[self.fence], true, u64::MAX).context("waiting for the device")?;
            raw.reset_fences(&[self.fence]).context("waiting for the device")?;
        }
        self.timings(labels)
    }

    fn timings(&self, labels: &[&'static str]) -> Result<Vec<Timing>> {
        let Some(queries) = self.queries.filter(|_| !labels.is_empty()) else { return Ok(Vec::new()) };
        let mut ticks = vec![0u64; 2 * labels.len()];
        // SAFETY: the queries were written by the work that was waited for
        unsafe {
            self.device.raw.get_query_pool_results(
                queries,
                0,
                &mut ticks,
                vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WAIT,
            )
        }
        .context("reading timestamps")?;
        let period = self.device.info.limits.timestamp_period as f64 * 1e-9;
        Ok(labels
            .iter()
            .zip(ticks.chunks_exact(2))
            .map(|(&label, t)| Timing { label, seconds: t[1].saturating_sub(t[0]) as f64 * period })
            .collect())
    }
}

impl Drop for Commands {
    fn drop(&mut self) {
        // SAFETY: nothing is in flight: every submission was waited for (or the device is lost)
        unsafe {
            if let Some(queries) = self.queries {
                self.device.raw.destroy_query_pool(queries, None);
            }
            self.device.raw.destroy_fence(self.fence, None);
            self.device.raw.destroy_command_pool(self.pool, None);
        }
    }
}

/// Records commands into a buffer that is being built.
pub struct Recorder<'a> {
    pub(super) device: &'a Device,
    pub(super) buffer: vk::CommandBuffer,
    queries: Option<vk::QueryPool>,
    labels: Vec<&'static str>,
    // a draw was recorded
    pub(super) drew: bool,
}

impl Recorder<'_> {
    /// Times what `record` records. Regions do not nest; beyond the first few hundred of a
    /// submission they are not timed.
    pub fn timed(&mut self, label: &'static str, record: impl FnOnce(&mut Self)) {
        let region = self.labels.len() as u32;
        let Some(queries) = self.queries.filter(|_| region < MAX_REGIONS) else { return record(self) };
        self.labels.push(label);
        let stamp = |stage, k| {
            // SAFETY: the query was reset and is written once
            unsafe { self.device.raw.cmd_write_timestamp2(self.buffer, stage, queries, 2 * region + k) }
        };
        stamp(vk::PipelineStageFlags2::ALL_COMMANDS, 0);
        if self.drew {
            // after draws, CPU drivers delay a timestamp until a barrier forces them to wait
            self.barrier();
        }
        record(self);
        let (device, buffer) = (self.device, self.buffer);
        // SAFETY: as above
        unsafe {
            device.raw.cmd_write_timestamp2(buffer, vk::PipelineStageFlags2::ALL_COMMANDS, queries, 2 * region + 1)
        };
    }

    /// A full memory barrier: commands recorded before it finish, and their writes are visible,
    /// before commands recorded after it start. It costs microseconds, so passes use it rather than
    /// finer barriers.
    pub fn barrier(&mut self) {
        let stages = vk::PipelineStageFlags2::ALL_COMMANDS;
        self.memory_barrier(
            stages,
            vk::AccessFlags2::MEMORY_WRITE,
            stages,
            vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE,
        );
    }

    fn final_barrier(&mut self) {
        let all = vk::PipelineStageFlags2::ALL_COMMANDS;
        // a fence makes writes available, but only a barrier makes them visible to the host
        self.memory_barrier(
            all,
            vk::AccessFlags2::MEMORY_WRITE,
            vk::PipelineStageFlags2::HOST | all,
            vk::AccessFlags2::HOST_READ | vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE,
        );
    }

    fn memory_barrier(
        &mut self,
        from: vk::PipelineStageFlags2,
        write: vk::AccessFlags2,
        to: vk::PipelineStageFlags2,
        read: vk::AccessFlags2,
    ) {
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(from)
            .src_access_mask(write)
            .dst_stage_mask(to)
            .dst_access_mask(read)];
        // SAFETY: recording state
        unsafe {
            self.device.raw.cmd_pipeline_barrier2(self.buffer, &vk::DependencyInfo::default().memory_barriers(&barrier))
        };
    }

    /// Copies bytes between buffers.
    pub fn copy(&mut self, from: &Buffer, from_offset: u64, to: &Buffer, to_offset: u64, size: u64) {
        let region = [vk::BufferCopy { src_offset: from_offset, dst_offset: to_offset, size }];
        assert!(from_offset + size <= from.size() && to_offset + size <= to.size());
        // SAFETY: the ranges lie within the buffers
        unsafe { self.device.raw.cmd_copy_buffer(self.buffer, from.raw, to.raw, &region) };
    }

    /// Writes a value to the beginning of a buffer when the device executes this command
    /// (vkCmdUpdateBuffer). Its size must be a multiple of 4, up to 64 KiB.
    pub fn update<T: bytemuck::NoUninit>(&mut self, buffer: &Buffer, value: &T) {
        let bytes = bytemuck::bytes_of(value);
        assert!(bytes.len().is_multiple_of(4) && bytes.len() <= 1 << 16 && bytes.len() as u64 <= buffer.size());
        // SAFETY: the range lies within the buffer and has a size that may be recorded
        unsafe { self.device.raw.cmd_update_buffer(self.buffer, buffer.raw, 0, bytes) };
    }

    /// Sets the whole buffer to zero.
    pub fn clear(&mut self, buffer: &Buffer) {
        self.fill(buffer, buffer.size(), 0);
    }

    /// Sets the first `size` bytes, a multiple of 4 above 0, to a repeated word.
    pub fn fill(&mut self, buffer: &Buffer, size: u64, word: u32) {
        assert!(size > 0 && size.is_multiple_of(4) && size <= buffer.size());
        // SAFETY: the range lies within the buffer
        unsafe { self.device.raw.cmd_fill_buffer(self.buffer, buffer.raw, 0, size, word) };
    }

    /// Dispatches a compute pipeline over `groups` work-groups. The addresses in `push` must be
    /// those of live buffers with the layout that the shader expects.
    pub fn dispatch<P: bytemuck::NoUninit>(&mut self, pipeline: &ComputePipeline, push: &P, groups: u32) {
        self.dispatch_3d(pipeline, push, [groups, 1, 1]);
    }

    /// As [`Recorder::dispatch`], over work-groups along x, y and z.
    pub fn dispatch_3d<P: bytemuck::NoUninit>(&mut self, pipeline: &ComputePipeline, push: &P, [x, y, z]: [u32; 3]) {
        assert!(x <= self.device.info.limits.max_workgroups_x && y.max(z) <= MAX_WORKGROUPS);
        // SAFETY: recording state; the push constants have the size that the layout was made with
        // (asserted there)
        unsafe {
            self.device.raw.cmd_bind_pipeline(self.buffer, vk::PipelineBindPoint::COMPUTE, pipeline.raw());
            self.push(pipeline.layout(), vk::ShaderStageFlags::COMPUTE, push);
            self.device.raw.cmd_dispatch(self.buffer, x, y, z);
        }
    }

    /// As [`Recorder::dispatch`], over as many work-groups along x, y and z as the three words say
    /// that lie at `offset`, a multiple of 4, when the device executes this command. What writes
    /// them keeps to the device's limits.
    pub fn dispatch_indirect<P: bytemuck::NoUninit>(
        &mut self,
        pipeline: &ComputePipeline,
        push: &P,
        groups: &Buffer,
        offset: u64,
    ) {
        assert!(offset.is_multiple_of(4) && offset + 12 <= groups.size());
        // SAFETY: as above; the words lie within the buffer, which was made for it
        unsafe {
            self.device.raw.cmd_bind_pipeline(self.buffer, vk::PipelineBindPoint::COMPUTE, pipeline.raw());
            self.push(pipeline.layout(), vk::ShaderStageFlags::COMPUTE, push);
            self.device.raw.cmd_dispatch_indirect(self.buffer, groups.raw, offset);
        }
    }

    /// Traces with a ray-tracing pipeline over `rays` invocations; see [`Recorder::dispatch`] for
    /// `push`.
    pub fn trace_rays<P: bytemuck::NoUninit>(&mut self, pipeline: &RayTracingPipeline, push: &P, rays: u32) {
        let (Some(functions), Some(table)) = (&self.device.pipelines, pipeline.table()) else { return };
        // SAFETY: as above; the tables were made for this pipeline
        unsafe {
            self.device.raw.cmd_bind_pipeline(self.buffer, vk::PipelineBindPoint::RAY_TRACING_KHR, pipeline.raw());
            self.push(pipeline.layout(), super::pipeline::RAY_STAGES, push);
            let none = vk::StridedDeviceAddressRegionKHR::default();
            functions.cmd_trace_rays(self.buffer, &table.raygen, &table.miss, &table.hit, &none, rays, 1, 1);
        }
    }

    pub(super) fn push<P: bytemuck::NoUninit>(
        &self,
        layout: vk::PipelineLayout,
        stages: vk::ShaderStageFlags,
        push: &P,
    ) {
        let bytes = bytemuck::bytes_of(push);
        assert_eq!(bytes.len() as u32, super::pipeline::PUSH_BYTES);
        // SAFETY: the layout has one range of this size for these stages
        unsafe { self.device.raw.cmd_push_constants(self.buffer, layout, stages, 0, bytes) };
    }
}
