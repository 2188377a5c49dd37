//! Graphics pipelines that draw triangles into [`super::Targets`]. Vertices are fetched by address:
//! there are no vertex buffers.

use std::sync::Arc;

use ash::vk;

use super::device::Device;
use super::formats::{DEPTH, IDS};
use super::pipeline::{CompileTimer, Compiled, Module, Specialization, layout};
use super::result::Context;
use crate::error::Result;
use crate::shaders::Shader;

/// Shader stages that read the push constants.
pub(super) const DRAW_STAGES: vk::ShaderStageFlags =
    vk::ShaderStageFlags::from_raw(vk::ShaderStageFlags::VERTEX.as_raw() | vk::ShaderStageFlags::FRAGMENT.as_raw());

/// Triangle culling.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cull {
    /// Both faces are drawn.
    None,
    /// Triangles with counter-clockwise corners in the image are culled.
    Front,
}

/// A pipeline of a vertex and a fragment shader.
pub struct GraphicsPipeline(pub(super) Compiled);

impl GraphicsPipeline {
    /// Compiles two shaders with entry point `main` and the same specialization. The depth test
    /// passes for greater values (reversed depth).
    pub fn new(
        device: &Arc<Device>,
        name: &str,
        vertex: &Shader,
        fragment: &Shader,
        specialization: &Specialization,
        cull: Cull,
    ) -> Result<Self> {
        let _timer = CompileTimer::start();
        let module = |shader| Module::new(device, name, shader, specialization);
        let modules = [module(vertex)?, module(fragment)?];
        let mut pipeline = Compiled::begin(device, layout(device, DRAW_STAGES)?);

        // no vertex buffers: shaders read the scene's records themselves
        let vertex_input = vk::PipelineVertexInputStateCreateInfo::default();
        let assembly =
            vk::PipelineInputAssemblyStateCreateInfo::default().topology(vk::PrimitiveTopology::TRIANGLE_LIST);
        let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let rasterization = vk::PipelineRasterizationStateCreateInfo::default()
            .polygon_mode(vk::PolygonMode::FILL)
            .cull_mode(match cull {
                Cull::None => vk::CullModeFlags::NONE,
                Cull::Front => vk::CullModeFlags::FRONT,
            })
            .front_face(vk::FrontFace::COUNTER_CLOCKWISE)
            .line_width(1.0);
        let multisample =
            vk::PipelineMultisampleStateCreateInfo::default().rasterization_samples(vk::SampleCountFlags::TYPE_1);

        // depth is reversed: nearer is greater
        let depth = vk::PipelineDepthStencilStateCreateInfo::default()
            .depth_test_enable(true)
            .depth_write_enable(true)
            .depth_compare_op(vk::CompareOp::GREATER);

        // IDs have two channels
        let both = vk::ColorComponentFlags::R | vk::ColorComponentFlags::G;
        let attachments = [vk::PipelineColorBlendAttachmentState::default().color_write_mask(both)];
        let blend = vk::PipelineColorBlendStateCreateInfo::default().attachments(&attachments);
        let states = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&states);

        // dynamic rendering: the formats stand in for a render pass
        let formats = [IDS];
        let mut rendering = vk::PipelineRenderingCreateInfo::default()
            .color_attachment_formats(&formats)
            .depth_attachment_format(DEPTH);
        let stage = |k: usize, stage| {
            vk::PipelineShaderStageCreateInfo::default().stage(stage).module(modules[k].raw).name(c"main")
        };
        let stages = [stage(0, vk::ShaderStageFlags::VERTEX), stage(1, vk::ShaderStageFlags::FRAGMENT)];
        let info = [vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&vertex_input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&rasterization)
            .multisample_state(&multisample)
            .depth_stencil_state(&depth)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(pipeline.layout)
            .push_next(&mut rendering)];
        // SAFETY: modules and layout are of this device; all required states are given
        pipeline.raw = unsafe { device.raw.create_graphics_pipelines(device.pipeline_cache, &info, None) }
            .map_err(|e| e.1)
            .context(name)?[0];
        device.name(pipeline.raw, name);
        Ok(Self(pipeline))
    }
}
