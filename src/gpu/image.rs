//! Render targets.

use std::sync::Arc;

use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::device::Device;
use super::formats::{DEPTH, IDS};
use super::result::Context;
use crate::error::{Error, Result};

/// A two-dimensional image in device memory.
pub struct Image {
    pub(super) raw: vk::Image,
    pub(super) view: vk::ImageView,
    allocation: Option<Allocation>,
    size: [u32; 2],
    device: Arc<Device>,
}

impl Image {
    fn new(
        device: &Arc<Device>,
        name: &str,
        format: vk::Format,
        aspect: vk::ImageAspectFlags,
        usage: vk::ImageUsageFlags,
        size: [u32; 2],
    ) -> Result<Self> {
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(format)
            .extent(vk::Extent3D { width: size[0], height: size[1], depth: 1 })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(usage)
            .sharing_mode(vk::SharingMode::EXCLUSIVE);
        // SAFETY: a plain image of the living device, of a size and format that were checked
        let raw = unsafe { device.raw.create_image(&info, None) }.context(name)?;
        device.name(raw, name);
        let mut image = Self { raw, view: vk::ImageView::null(), allocation: None, size, device: device.clone() };

        // SAFETY: the image is of this device
        let requirements = unsafe { device.raw.get_image_memory_requirements(raw) };
        let mib = requirements.size.div_ceil(1 << 20);
        let allocation = device.allocate(
            &AllocationCreateDesc {
                name,
                requirements,
                location: MemoryLocation::GpuOnly,
                linear: false,
                allocation_scheme: AllocationScheme::GpuAllocatorManaged,
            },
            &format!("{name} ({mib} MiB)"),
            "use a smaller image, or another --device",
        )?;
        // SAFETY: fresh memory that fits the image's requirements
        unsafe { device.raw.bind_image_memory(raw, allocation.memory(), allocation.offset()) }.context(name)?;
        image.allocation = Some(allocation);

        // a view of all of it
        let info = vk::ImageViewCreateInfo::default()
            .image(raw)
            .view_type(vk::ImageViewType::TYPE_2D)
            .format(format)
            .subresource_range(range(aspect));
        // SAFETY: the image has memory, and this format
        image.view = unsafe { device.raw.create_image_view(&info, None) }.context(name)?;
        Ok(image)
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        // SAFETY: submissions are waited for, so the device is not using it
        unsafe {
            self.device.raw.destroy_image_view(self.view, None);
            self.device.raw.destroy_image(self.raw, None);
        }
        if let Some(allocation) = self.allocation.take() {
            // a failed free can only leak
            let _ = self.device.allocator().free(allocation);
        }
    }
}

/// The subresource range of a whole image.
pub(super) fn range(aspect: vk::ImageAspectFlags) -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange {
        aspect_mask: aspect,
        base_mip_level: 0,
        level_count: 1,
        base_array_layer: 0,
        layer_count: 1,
    }
}

/// Render targets of the visibility pass: two unsigned integers per pixel, and reversed depth
/// (greater is nearer).
pub struct Targets {
    pub(super) ids: Image,
    pub(super) depth: Image,
}

impl Targets {
    /// Allocates both.
    ///
    /// # Errors
    /// [`Error::Device`] when the device cannot rasterize, or not into images of that size;
    /// [`Error::OutOfMemory`].
    pub fn new(device: &Arc<Device>, size: [u32; 2]) -> Result<Self> {
        let info = &device.info;
        if !info.can_rasterise() {
            return Err(Error::Device(format!(
                "rasterization needs {}, which '{}' lacks; use --primary traced",
                info.missing_raster.join(", "),
                info.name
            )));
        }
        let max = info.limits.max_image_side;
        if size[0].max(size[1]) > max || size[0].min(size[1]) == 0 {
            return Err(Error::Device(format!(
                "'{}' rasterizes images of 1 to {max} pixels a side, not of {}x{}; use --primary traced",
                info.name, size[0], size[1]
            )));
        }
        let (color, depth) = (vk::ImageUsageFlags::COLOR_ATTACHMENT, vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT);
        let copied = color | vk::ImageUsageFlags::TRANSFER_SRC;
        Ok(Self {
            ids: Image::new(device, "visible primitives", IDS, vk::ImageAspectFlags::COLOR, copied, size)?,
            depth: Image::new(device, "depth", DEPTH, vk::ImageAspectFlags::DEPTH, depth, size)?,
        })
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.ids.size()
    }
}
