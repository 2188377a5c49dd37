//! A window's swapchain, and egui's triangles drawn into it: on a device of its own, so that the
//! window neither waits for what is traced nor is lost with it.

use std::ffi::CStr;
use std::sync::Arc;

use ash::{khr, vk};
use egui::epaint::ClippedPrimitive;
use egui_ash_renderer::{Options, Renderer, RendererError};
use egui_winit::winit::raw_window_handle::{HasDisplayHandle, HasWindowHandle};

use super::instance::Instance;
use super::result::{Context, explain};
use crate::error::{Error, Result};

/// A window to draw to: it says which window and display that is, and lives as long as the
/// renderer.
pub trait Target: HasDisplayHandle + HasWindowHandle {}

impl<T: HasDisplayHandle + HasWindowHandle> Target for T {}

/// Draws egui's triangles into a window.
pub struct WindowRenderer {
    egui: Option<Renderer>,
    swapchain: Swapchain,
    render_pass: vk::RenderPass,
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    /// Signaled when the last frame's commands have ended.
    fence: vk::Fence,
    /// Signaled when an image of the swapchain can be drawn to.
    available: vk::Semaphore,
    queue: vk::Queue,
    device: ash::Device,
    swapchains: khr::swapchain::Device,
    physical: vk::PhysicalDevice,
    surface: vk::SurfaceKHR,
    surfaces: khr::surface::Instance,
    format: vk::SurfaceFormatKHR,
    instance: Arc<Instance>,
    // dropped last: the surface is of this window
    _target: Arc<dyn Target>,
}

/// The images of a window, at one size.
#[derive(Default)]
struct Swapchain {
    raw: vk::SwapchainKHR,
    extent: vk::Extent2D,
    views: Vec<vk::ImageView>,
    framebuffers: Vec<vk::Framebuffer>,
    /// For each image, signaled when it can be presented.
    finished: Vec<vk::Semaphore>,
    /// It no longer fits the window.
    is_stale: bool,
}

impl WindowRenderer {
    /// Opens a device that can present to the window: the one of this name if there is one, else
    /// the first.
    ///
    /// # Errors
    /// [`Error::Device`] where no device can present to it; [`Error::Vulkan`].
    pub fn new(target: Arc<dyn Target>, device_name: Option<&str>, validation: bool) -> Result<Self> {
        let no_handle = |e| Error::Device(format!("the window cannot be drawn to: {e}"));
        let display = target.display_handle().map_err(no_handle)?.as_raw();
        let window = target.window_handle().map_err(no_handle)?.as_raw();
        let extensions =
            ash_window::enumerate_required_extensions(display).context("listing extensions of surfaces")?;
        let instance = Instance::with_extensions(validation, extensions)?;

        // SAFETY: the handles are those of a window that lives as long as the surface
        let surface = unsafe { ash_window::create_surface(&instance.entry, &instance.raw, display, window, None) }
            .context("creating the window's surface")?;
        let surfaces = khr::surface::Instance::new(&instance.entry, &instance.raw);

        // a device that can present to this surface; without one the surface goes again
        let chosen = choose(&instance, &surfaces, surface, device_name);
        let created = chosen
            .and_then(|(physical, family)| create_device(&instance, physical, family).map(|d| (physical, family, d)));
        let (physical, family, device) = match created {
            Ok(created) => created,
            Err(e) => {
                // SAFETY: nothing uses it
                unsafe { surfaces.destroy_surface(surface, None) };
                return Err(e);
            }
        };

        // SAFETY (all calls below): plain objects of the living device; on an early return Drop
        // destroys null handles, too
        let queue = unsafe { device.get_device_queue(family, 0) };
        let mut renderer = Self {
            egui: None,
            swapchain: Swapchain { is_stale: true, ..Default::default() },
            render_pass: vk::RenderPass::null(),
            pool: vk::CommandPool::null(),
            commands: vk::CommandBuffer::null(),
            fence: vk::Fence::null(),
            available: vk::Semaphore::null(),
            queue,
            swapchains: khr::swapchain::Device::new(&instance.raw, &device),
            device,
            physical,
            surface,
            surfaces,
            format: vk::SurfaceFormatKHR::default(),
            instance,
            _target: target,
        };
        renderer.prepare(family)?;
        Ok(renderer)
    }

    /// Creates what does not depend on the window's size.
    fn prepare(&mut self, family: u32) -> Result<()> {
        let what = "preparing the window";

        // a format of sRGB if there is one: the presentation engine then encodes
        // SAFETY (all calls below): plain objects of the living device
        let formats =
            unsafe { self.surfaces.get_physical_device_surface_formats(self.physical, self.surface) }.context(what)?;
        let wanted = [
            vk::Format::B8G8R8A8_SRGB,
            vk::Format::R8G8B8A8_SRGB,
            vk::Format::B8G8R8A8_UNORM,
            vk::Format::R8G8B8A8_UNORM,
        ];
        let found = wanted.iter().find_map(|w| formats.iter().find(|f| f.format == *w)).or(formats.first());
        self.format = *found.ok_or_else(|| Error::Device("the window has no format of pixels".into()))?;

        // one pass that clears the image and leaves it ready to be presented
        let attachment = [vk::AttachmentDescription::default()
            .format(self.format.format)
            .samples(vk::SampleCountFlags::TYPE_1)
            .load_op(vk::AttachmentLoadOp::CLEAR)
            .store_op(vk::AttachmentStoreOp::STORE)
            .initial_layout(vk::ImageLayout::UNDEFINED)
            .final_layout(vk::ImageLayout::PRESENT_SRC_KHR)];
        let reference = [vk::AttachmentReference { attachment: 0, layout: vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL }];
        let subpass = [vk::SubpassDescription::default().color_attachments(&reference)];

        // the image is there once the semaphore that is waited for at this stage is signaled
        let dependency = [vk::SubpassDependency {
            src_subpass: vk::SUBPASS_EXTERNAL,
            dst_subpass: 0,
            src_stage_mask: vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT,
            dst_stage_mask: vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT,
            src_access_mask: vk::AccessFlags::empty(),
            dst_access_mask: vk::AccessFlags::COLOR_ATTACHMENT_WRITE,
            dependency_flags: vk::DependencyFlags::empty(),
        }];
        let pass =
            vk::RenderPassCreateInfo::default().attachments(&attachment).subpasses(&subpass).dependencies(&dependency);
        self.render_pass = unsafe { self.device.create_render_pass(&pass, None) }.context(what)?;

        // one frame is in flight: a command buffer, a fence and a semaphore do
        let pool = vk::CommandPoolCreateInfo::default()
            .queue_family_index(family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        self.pool = unsafe { self.device.create_command_pool(&pool, None) }.context(what)?;
        let buffers = vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
        self.commands = unsafe { self.device.allocate_command_buffers(&buffers) }.context(what)?[0];
        self.fence = unsafe { self.device.create_fence(&vk::FenceCreateInfo::default(), None) }.context(what)?;
        self.available =
            unsafe { self.device.create_semaphore(&vk::SemaphoreCreateInfo::default(), None) }.context(what)?;

        // the painter has to know who encodes
        let srgb_framebuffer = [vk::Format::B8G8R8A8_SRGB, vk::Format::R8G8B8A8_SRGB].contains(&self.format.format);
        let options = Options { srgb_framebuffer, ..Default::default() };
        let (instance, device) = (&self.instance.raw, self.device.clone());
        let egui = Renderer::with_default_allocator(instance, self.physical, device, self.render_pass, options);
        self.egui = Some(egui.map_err(failed)?);
        Ok(())
    }

    /// Takes the messages of the validation layer since the last call.
    pub fn validation_messages(&self) -> Vec<String> {
        self.instance.validation.as_ref().map(|v| v.take()).unwrap_or_default()
    }

    /// Draws a frame into a window of `size` physical pixels, none of which is 0, over a background
    /// (linear RGB).
    ///
    /// # Errors
    /// [`Error::DeviceLost`], [`Error::OutOfMemory`], [`Error::Vulkan`].
    pub fn draw(
        &mut self,
        size: [u32; 2],
        background: [f32; 3],
        pixels_per_point: f32,
        primitives: &[ClippedPrimitive],
        textures: &egui::TexturesDelta,
    ) -> Result<()> {
        let what = "drawing the window";

        // textures first: the frame may show them
        if let Some(egui) = &mut self.egui {
            egui.set_textures(self.queue, self.pool, &textures.set).map_err(failed)?;
        }
        let is_other_size = [self.swapchain.extent.width, self.swapchain.extent.height] != size;
        if (self.swapchain.is_stale || is_other_size) && !self.recreate(size)? {
            return self.free(textures);
        }

        // SAFETY (all calls below): one frame is in flight at a time, and its fence was waited for,
        // so that nothing of it is in use
        let acquired = unsafe {
            self.swapchains.acquire_next_image(self.swapchain.raw, u64::MAX, self.available, vk::Fence::null())
        };
        let index = match acquired {
            Ok((index, is_suboptimal)) => {
                self.swapchain.is_stale = is_suboptimal;
                index
            }
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => {
                // the next frame has another
                self.swapchain.is_stale = true;
                return self.free(textures);
            }
            Err(e) => return Err(explain(what, e)),
        };

        // commands of the frame
        let extent = self.swapchain.extent;
        let [r, g, b] = background;
        let clear = [vk::ClearValue { color: vk::ClearColorValue { float32: [r, g, b, 1.0] } }];
        let pass = vk::RenderPassBeginInfo::default()
            .render_pass(self.render_pass)
            .framebuffer(self.swapchain.framebuffers[index as usize])
            .render_area(extent.into())
            .clear_values(&clear);
        let finished = [self.swapchain.finished[index as usize]];
        unsafe {
            let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
            self.device.begin_command_buffer(self.commands, &begin).context(what)?;
            self.device.cmd_begin_render_pass(self.commands, &pass, vk::SubpassContents::INLINE);
            let drawn = match &mut self.egui {
                Some(egui) => egui.cmd_draw(self.commands, extent, pixels_per_point, primitives),
                None => Ok(()),
            };
            self.device.cmd_end_render_pass(self.commands);
            self.device.end_command_buffer(self.commands).context(what)?;
            drawn.map_err(failed)?;
            let (available, stages) = ([self.available], [vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT]);
            let commands = [self.commands];
            let submit = [vk::SubmitInfo::default()
                .wait_semaphores(&available)
                .wait_dst_stage_mask(&stages)
                .command_buffers(&commands)
                .signal_semaphores(&finished)];
            self.device.queue_submit(self.queue, &submit, self.fence).context(what)?;
        }

        // presented once drawing has finished; then nothing is in flight any more
        let (swapchain, indices) = ([self.swapchain.raw], [index]);
        let present =
            vk::PresentInfoKHR::default().wait_semaphores(&finished).swapchains(&swapchain).image_indices(&indices);
        let presented = unsafe { self.swapchains.queue_present(self.queue, &present) };
        unsafe {
            self.device.wait_for_fences(&[self.fence], true, u64::MAX).context(what)?;
            self.device.reset_fences(&[self.fence]).context(what)?;
        }
        match presented {
            Ok(is_suboptimal) => self.swapchain.is_stale |= is_suboptimal,
            Err(vk::Result::ERROR_OUT_OF_DATE_KHR) => self.swapchain.is_stale = true,
            Err(e) => return Err(explain(what, e)),
        }
        self.free(textures)
    }

    fn free(&mut self, textures: &egui::TexturesDelta) -> Result<()> {
        self.egui.as_mut().map_or(Ok(()), |egui| egui.free_textures(&textures.free)).map_err(failed)
    }

    /// Creates the swapchain anew at the window's size. Returns false if the window has no pixels
    /// now.
    fn recreate(&mut self, size: [u32; 2]) -> Result<bool> {
        let what = "creating the swapchain";
        // SAFETY (all calls below): the device is idle, so that nothing of the old swapchain is in
        // use
        unsafe { self.device.device_wait_idle() }.context(what)?;

        // the size that the surface has, or takes
        let capabilities =
            unsafe { self.surfaces.get_physical_device_surface_capabilities(self.physical, self.surface) }
                .context(what)?;
        let (least, most, now) =
            (capabilities.min_image_extent, capabilities.max_image_extent, capabilities.current_extent);
        let extent = match now.width {
            // the surface takes the size that it is given
            u32::MAX => vk::Extent2D {
                width: size[0].clamp(least.width, most.width.max(least.width)),
                height: size[1].clamp(least.height, most.height.max(least.height)),
            },
            _ => now,
        };
        if extent.width == 0 || extent.height == 0 {
            return Ok(false);
        }

        // 0: no limit
        let most_images = if capabilities.max_image_count == 0 { u32::MAX } else { capabilities.max_image_count };
        let count = (capabilities.min_image_count + 1).min(most_images);
        let alpha = [vk::CompositeAlphaFlagsKHR::OPAQUE, vk::CompositeAlphaFlagsKHR::INHERIT]
            .into_iter()
            .find(|a| capabilities.supported_composite_alpha.contains(*a))
            .unwrap_or(vk::CompositeAlphaFlagsKHR::OPAQUE);

        // the old swapchain is retired by the new one
        let old = std::mem::take(&mut self.swapchain);
        let create = vk::SwapchainCreateInfoKHR::default()
            .surface(self.surface)
            .min_image_count(count)
            .image_format(self.format.format)
            .image_color_space(self.format.color_space)
            .image_extent(extent)
            .image_array_layers(1)
            .image_usage(vk::ImageUsageFlags::COLOR_ATTACHMENT)
            .pre_transform(capabilities.current_transform)
            .composite_alpha(alpha)
            .present_mode(vk::PresentModeKHR::FIFO)
            .clipped(true)
            .old_swapchain(old.raw);
        let raw = unsafe { self.swapchains.create_swapchain(&create, None) }.context(what);
        self.destroy(old);
        self.swapchain = Swapchain { raw: raw?, extent, ..Default::default() };

        // a view, a framebuffer and a semaphore for each image
        let images = unsafe { self.swapchains.get_swapchain_images(self.swapchain.raw) }.context(what)?;
        for image in images {
            let view = vk::ImageViewCreateInfo::default()
                .image(image)
                .view_type(vk::ImageViewType::TYPE_2D)
                .format(self.format.format)
                .subresource_range(vk::ImageSubresourceRange {
                    aspect_mask: vk::ImageAspectFlags::COLOR,
                    level_count: 1,
                    layer_count: 1,
                    ..Default::default()
                });
            let view = unsafe { self.device.create_image_view(&view, None) }.context(what)?;
            self.swapchain.views.push(view);
            let views = [view];
            let framebuffer = vk::FramebufferCreateInfo::default()
                .render_pass(self.render_pass)
                .attachments(&views)
                .width(extent.width)
                .height(extent.height)
                .layers(1);
            let framebuffer = unsafe { self.device.create_framebuffer(&framebuffer, None) }.context(what)?;
            self.swapchain.framebuffers.push(framebuffer);
            let finished =
                unsafe { self.device.create_semaphore(&vk::SemaphoreCreateInfo::default(), None) }.context(what)?;
            self.swapchain.finished.push(finished);
        }
        Ok(true)
    }

    fn destroy(&self, swapchain: Swapchain) {
        // SAFETY: the device is idle
        unsafe {
            swapchain.framebuffers.iter().for_each(|f| self.device.destroy_framebuffer(*f, None));
            swapchain.views.iter().for_each(|v| self.device.destroy_image_view(*v, None));
            swapchain.finished.iter().for_each(|s| self.device.destroy_semaphore(*s, None));
            if swapchain.raw != vk::SwapchainKHR::null() {
                self.swapchains.destroy_swapchain(swapchain.raw, None);
            }
        }
    }
}

impl Drop for WindowRenderer {
    fn drop(&mut self) {
        // SAFETY: the device is idle (or lost), and the objects are destroyed before what they were
        // created from
        unsafe {
            let _ = self.device.device_wait_idle();
            drop(self.egui.take());
            let swapchain = std::mem::take(&mut self.swapchain);
            self.destroy(swapchain);
            self.device.destroy_semaphore(self.available, None);
            self.device.destroy_fence(self.fence, None);
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_render_pass(self.render_pass, None);
            self.device.destroy_device(None);
            self.surfaces.destroy_surface(self.surface, None);
        }
    }
}

/// A physical device and a queue family that can draw and present to the surface.
fn choose(
    instance: &Instance,
    surfaces: &khr::surface::Instance,
    surface: vk::SurfaceKHR,
    name: Option<&str>,
) -> Result<(vk::PhysicalDevice, u32)> {
    // SAFETY (all calls below): all objects are of this instance
    let devices = unsafe { instance.raw.enumerate_physical_devices() }.context("listing devices")?;
    let mut found = Vec::new();
    for physical in devices {
        let properties = unsafe { instance.raw.get_physical_device_properties(physical) };
        let extensions = unsafe { instance.raw.enumerate_device_extension_properties(physical) }.unwrap_or_default();
        if !extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(khr::swapchain::NAME)) {
            continue;
        }
        let families = unsafe { instance.raw.get_physical_device_queue_family_properties(physical) };
        let can_present =
            |family: u32| unsafe { surfaces.get_physical_device_surface_support(physical, family, surface) };
        let family = (0..families.len() as u32).find(|k| {
            families[*k as usize].queue_flags.contains(vk::QueueFlags::GRAPHICS) && can_present(*k).unwrap_or(false)
        });
        if let Some(family) = family {
            let own = properties.device_name_as_c_str().map(CStr::to_string_lossy).unwrap_or_default();
            found.push((physical, family, name.is_some_and(|n| own == n)));
        }
    }
    let best = found.iter().find(|f| f.2).or(found.first());
    best.map(|f| (f.0, f.1)).ok_or_else(|| Error::Device("no Vulkan device can draw to the window".into()))
}

fn create_device(instance: &Instance, physical: vk::PhysicalDevice, family: u32) -> Result<ash::Device> {
    let priorities = [1.0];
    let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
    let extensions = [khr::swapchain::NAME.as_ptr()];
    let create = vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&extensions);
    // SAFETY: the physical device is of this instance and lists the extension
    unsafe { instance.raw.create_device(physical, &create, None) }.context("opening the window's device")
}

fn failed(e: RendererError) -> Error {
    match e {
        RendererError::Vulkan(result) => explain("drawing the window", result),
        other => Error::Vulkan(format!("drawing the window failed: {other}")),
    }
}
