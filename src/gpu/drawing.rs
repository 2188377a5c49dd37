//! Recording of draw commands.

use std::ops::Range;

use ash::vk;

use super::buffer::Buffer;
use super::commands::Recorder;
use super::device::Device;
use super::graphics_pipeline::{DRAW_STAGES, GraphicsPipeline};
use super::image::{Image, Targets, range};

/// Maximum size of the viewport relative to the image.
const MAX_VIEWPORT_FACTOR: f32 = 8.0;

impl Device {
    /// Size of the viewport relative to an image of `size` pixels, with which it shares its centre:
    /// clip space extends beyond the image by this factor. CPU drivers clip at the viewport, having
    /// no guard band, and are slow at it: a larger viewport avoids that.
    pub fn viewport_factor(&self, size: [u32; 2]) -> f32 {
        let limits = &self.info.limits;
        let most = size.map(|n| {
            let n = n as f32;
            let reach = (limits.viewport_range[1] - 0.5 * n).min(0.5 * n - limits.viewport_range[0]);
            (limits.max_viewport_side / n).min(2.0 * reach / n)
        });
        most[0].min(most[1]).min(MAX_VIEWPORT_FACTOR).floor().max(1.0)
    }
}

/// Records draws into targets; made by [`Recorder::draw_into`].
pub struct DrawRecorder<'r, 'd> {
    recorder: &'r mut Recorder<'d>,
    bound: Option<vk::PipelineLayout>,
}

impl<'d> Recorder<'d> {
    /// Clears the upper left `size` pixels of the targets to zero and draws there. Clip space is
    /// [`Device::viewport_factor`] times as large as the image. The previous contents of the
    /// targets are discarded.
    pub fn draw_into(&mut self, targets: &Targets, size: [u32; 2], record: impl FnOnce(&mut DrawRecorder<'_, 'd>)) {
        assert!(size[0] <= targets.size()[0] && size[1] <= targets.size()[1]);

        // contents of the frame before are dropped
        self.transition(
            &targets.ids,
            vk::ImageAspectFlags::COLOR,
            [vk::ImageLayout::UNDEFINED, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL],
        );
        self.transition(
            &targets.depth,
            vk::ImageAspectFlags::DEPTH,
            [vk::ImageLayout::UNDEFINED, vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL],
        );

        // both targets are cleared: no primitive, and the furthest depth, which is 0
        let area =
            vk::Rect2D { offset: vk::Offset2D::default(), extent: vk::Extent2D { width: size[0], height: size[1] } };
        let ids = [vk::RenderingAttachmentInfo::default()
            .image_view(targets.ids.view)
            .image_layout(vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL)
            .load_op(vk::AttachmentLoadOp::CLEAR)
            .store_op(vk::AttachmentStoreOp::STORE)
            .clear_value(vk::ClearValue { color: vk::ClearColorValue { uint32: [0; 4] } })];
        let depth = vk::RenderingAttachmentInfo::default()
            .image_view(targets.depth.view)
            .image_layout(vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL)
            .load_op(vk::AttachmentLoadOp::CLEAR)
            .store_op(vk::AttachmentStoreOp::DONT_CARE)
            .clear_value(vk::ClearValue { depth_stencil: vk::ClearDepthStencilValue { depth: 0.0, stencil: 0 } });
        let info = vk::RenderingInfo::default()
            .render_area(area)
            .layer_count(1)
            .color_attachments(&ids)
            .depth_attachment(&depth);

        // a viewport that is larger than the device allows is scaled about its middle
        let factor = self.device.viewport_factor(size);
        let [width, height] = size.map(|n| factor * n as f32);
        let [x, y] = size.map(|n| 0.5 * n as f32 * (1.0 - factor));
        let viewport = vk::Viewport { x, y, width, height, min_depth: 0.0, max_depth: 1.0 };

        // the caller records its draws between begin and end
        let (raw, buffer) = (&self.device.raw, self.buffer);
        // SAFETY: recording state; the targets are in the layouts that are named here
        unsafe {
            raw.cmd_begin_rendering(buffer, &info);
            raw.cmd_set_viewport(buffer, 0, &[viewport]);
            raw.cmd_set_scissor(buffer, 0, &[area]);
        }
        record(&mut DrawRecorder { recorder: self, bound: None });
        self.drew = true;
        // SAFETY: begun above
        unsafe { self.device.raw.cmd_end_rendering(self.buffer) };
    }

    /// Copies the ids of the upper left `size` pixels to a buffer: two words per pixel, rows
    /// without padding.
    pub fn copy_ids(&mut self, targets: &Targets, size: [u32; 2], to: &Buffer) {
        assert!(8 * size[0] as u64 * size[1] as u64 <= to.size());
        self.transition(
            &targets.ids,
            vk::ImageAspectFlags::COLOR,
            [vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL, vk::ImageLayout::TRANSFER_SRC_OPTIMAL],
        );
        let region = [vk::BufferImageCopy::default()
            .image_subresource(vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: 1,
            })
            .image_extent(vk::Extent3D { width: size[0], height: size[1], depth: 1 })];
        let layout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
        // SAFETY: the image is in that layout, the buffer is large enough
        unsafe { self.device.raw.cmd_copy_image_to_buffer(self.buffer, targets.ids.raw, layout, to.raw, &region) };
    }

    /// As [`Recorder::barrier`], with a layout transition of an image.
    fn transition(&mut self, image: &Image, aspect: vk::ImageAspectFlags, [from, to]: [vk::ImageLayout; 2]) {
        let all = vk::PipelineStageFlags2::ALL_COMMANDS;
        let barrier = [vk::ImageMemoryBarrier2::default()
            .src_stage_mask(all)
            .src_access_mask(vk::AccessFlags2::MEMORY_WRITE)
            .dst_stage_mask(all)
            .dst_access_mask(vk::AccessFlags2::MEMORY_READ | vk::AccessFlags2::MEMORY_WRITE)
            .old_layout(from)
            .new_layout(to)
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(image.raw)
            .subresource_range(range(aspect))];
        // SAFETY: recording state, outside of a render pass instance
        unsafe {
            self.device
                .raw
                .cmd_pipeline_barrier2(self.buffer, &vk::DependencyInfo::default().image_memory_barriers(&barrier))
        };
    }
}

impl DrawRecorder<'_, '_> {
    /// Binds the pipeline of the next draws.
    pub fn bind(&mut self, pipeline: &GraphicsPipeline) {
        let (raw, buffer) = (&self.recorder.device.raw, self.recorder.buffer);
        // SAFETY: recording state; the pipeline was made for these targets
        unsafe { raw.cmd_bind_pipeline(buffer, vk::PipelineBindPoint::GRAPHICS, pipeline.0.raw) };
        self.bound = Some(pipeline.0.layout);
    }

    /// Sets the push constants of the next draws. The addresses in `push` must be those of live
    /// buffers with the layout that the shaders expect. To be called after [`DrawRecorder::bind`].
    pub fn push<P: bytemuck::NoUninit>(&mut self, push: &P) {
        if let Some(layout) = self.bound {
            self.recorder.push(layout, DRAW_STAGES, push);
        }
    }

    /// Draws triangles from consecutive vertices, once per instance. To be called after
    /// [`DrawRecorder::push`].
    pub fn draw(&mut self, vertices: Range<u32>, instances: Range<u32>) {
        if self.bound.is_none() || vertices.is_empty() || instances.is_empty() {
            return;
        }
        let (raw, buffer) = (&self.recorder.device.raw, self.recorder.buffer);
        // SAFETY: a pipeline is bound, viewport and scissor are set
        unsafe { raw.cmd_draw(buffer, vertices.len() as u32, instances.len() as u32, vertices.start, instances.start) };
    }
}
