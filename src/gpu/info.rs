//! Properties and features of the machine's Vulkan devices, for choosing one and for `doctor`.

use std::ffi::CStr;

use ash::{khr, vk};

use super::faults;
use super::formats::{DEPTH, IDS};
use super::instance::Instance;
use super::result::Context;
use crate::error::{Error, Result};

/// The device limits that skylit depends on.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Limits {
    /// Number of invocations in a subgroup.
    pub subgroup_size: u32,
    /// Compute shaders support subgroup ballots.
    pub subgroup_ballot: bool,
    /// The packet kernel can run: compute shaders support ballots, subgroup arithmetic and full
    /// subgroups of 8 to 64 lanes.
    pub packets: bool,
    /// Maximum number of work-groups along x in a dispatch.
    pub max_workgroups_x: u32,
    /// Maximum width and height of a render target, in pixels.
    pub max_image_side: u32,
    /// Maximum width and height of a viewport, in pixels.
    pub max_viewport_side: f32,
    /// Minimum and maximum coordinate of a viewport's corners, in pixels.
    pub viewport_range: [f32; 2],
    /// Maximum size of one buffer, in bytes.
    pub max_allocation: u64,
    /// Size of all device-local heaps, in bytes.
    pub device_memory: u64,
    /// Maximum size of push constants, in bytes.
    pub max_push_constants: u32,
    /// Nanoseconds per timestamp tick; 0 without timestamps.
    pub timestamp_period: f32,
    /// Alignment of acceleration-structure scratch memory, in bytes; 0 without ray tracing.
    pub scratch_alignment: u32,
    /// Size of a shader group handle, in bytes; 0 without ray tracing.
    pub shader_group_handle_size: u32,
    /// Alignment of shader group handles, in bytes.
    pub shader_group_handle_alignment: u32,
    /// Alignment of the regions of the shader binding table, in bytes.
    pub shader_group_base_alignment: u32,
}

/// Properties of a physical device.
#[derive(Clone, Debug, serde::Serialize)]
pub struct DeviceInfo {
    #[serde(skip)]
    pub(super) physical: vk::PhysicalDevice,
    /// Index in Vulkan's list of devices, as `--device INDEX` takes it.
    pub index: usize,
    /// Device name that the driver reports.
    pub name: String,
    /// "discrete", "integrated", "virtual", "cpu" or "other".
    pub kind: &'static str,
    /// Supported Vulkan version, such as "1.3.230".
    pub api_version: String,
    /// Name and version of the driver.
    pub driver: String,
    /// PCI vendor id, or a Khronos vendor id.
    pub vendor_id: u32,
    /// Device id of the vendor.
    pub device_id: u32,
    /// Driver version in the vendor's encoding.
    pub driver_version: u32,
    #[serde(skip)]
    pub(super) pipeline_cache_uuid: [u8; 16],
    /// Minimum requirements of skylit that the device lacks, by name; it is usable when empty.
    pub missing_floor: Vec<String>,
    /// shaderInt64.
    pub int64: bool,
    /// The device shares the host's memory (a CPU or an integrated GPU).
    pub unified_memory: bool,
    /// bufferDeviceAddress.
    #[serde(skip)]
    pub buffer_device_address: bool,
    /// Supported ray-tracing extensions.
    #[serde(skip)]
    pub ray_tracing: RayTracingExtensions,
    /// VK_KHR_portability_subset: the driver translates to another API, as MoltenVK does to Metal.
    #[serde(skip)]
    pub(super) is_portability_subset: bool,
    /// Requirements of rasterization that the device lacks; it can rasterize when empty.
    pub missing_raster: Vec<String>,
    /// Device limits.
    pub limits: Limits,
    #[serde(skip)]
    pub(super) queue_family: Option<u32>,
}

/// The ray-tracing extensions that a device supports, each with its feature.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayTracingExtensions {
    /// VK_KHR_acceleration_structure.
    pub acceleration_structure: bool,
    /// VK_KHR_deferred_host_operations, which VK_KHR_acceleration_structure requires.
    pub deferred_host_operations: bool,
    /// VK_KHR_ray_tracing_pipeline.
    pub ray_tracing_pipeline: bool,
    /// VK_KHR_ray_query.
    pub ray_query: bool,
}

impl DeviceInfo {
    /// Whether VK_KHR_ray_tracing_pipeline and everything it requires is available.
    pub(super) fn has_ray_tracing_pipelines(&self) -> bool {
        self.has_acceleration_structures() && self.ray_tracing.ray_tracing_pipeline
    }

    /// Whether VK_KHR_ray_query and everything it requires is available.
    pub(super) fn has_ray_queries(&self) -> bool {
        self.has_acceleration_structures() && self.ray_tracing.ray_query
    }

    fn has_acceleration_structures(&self) -> bool {
        let extensions = &self.ray_tracing;
        self.missing_floor.is_empty() && extensions.acceleration_structure && extensions.deferred_host_operations
    }

    /// Whether the device can rasterize; compute-only devices cannot.
    pub fn can_rasterise(&self) -> bool {
        self.missing_floor.is_empty() && self.missing_raster.is_empty()
    }

    /// Whether the driver leaves any loop in a shader after 65,535 iterations, as Mesa's CPU driver
    /// did before version 23.
    pub fn cuts_long_loops(&self) -> bool {
        let major =
            self.driver.split("Mesa ").nth(1).and_then(|v| v.split('.').next()).and_then(|v| v.parse::<u32>().ok());
        self.is_cpu() && major.is_some_and(|m| m < 23)
    }

    /// Whether the compute tracer can trace rays in packets.
    pub fn packets(&self) -> bool {
        self.limits.packets && self.int64
    }

    /// Whether the device is a CPU.
    pub fn is_cpu(&self) -> bool {
        self.kind == "cpu"
    }

    /// Rank among devices: the highest is the default.
    pub(super) fn preference(&self) -> u32 {
        match self.kind {
            "discrete" => 4,
            "integrated" => 3,
            "virtual" => 2,
            "cpu" => 1,
            _ => 0,
        }
    }
}

fn text(s: &[std::ffi::c_char]) -> String {
    let bytes: Vec<u8> = s.iter().map(|&c| c as u8).take_while(|&c| c != 0).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

/// With wider vectors Mesa's CPU driver crashes when it compiles a vertex shader (seen with 22.3.6
/// and 25.0.7).
const MAX_RASTER_BITS: u32 = 256;

/// Vector width of Mesa's CPU driver in bits, from its device name: "llvmpipe (LLVM 15.0.6, 256
/// bits)".
fn vector_bits(name: &str) -> Option<u32> {
    name.strip_prefix("llvmpipe")?.strip_suffix(" bits)")?.rsplit(' ').next()?.parse().ok()
}

/// Whether images of this format can be render targets.
fn is_target(
    raw: &ash::Instance,
    physical: vk::PhysicalDevice,
    format: vk::Format,
    target: vk::FormatFeatureFlags,
) -> bool {
    // SAFETY: the physical device belongs to the living instance
    let features = unsafe { raw.get_physical_device_format_properties(physical, format) }.optimal_tiling_features;
    features.contains(target)
}

/// All devices of the machine, usable or not.
pub fn enumerate(instance: &Instance) -> Result<Vec<DeviceInfo>> {
    // SAFETY: the instance lives
    let devices = unsafe { instance.raw.enumerate_physical_devices() }.map_err(|e| match e {
        // what the loader says where no driver's library could be loaded
        vk::Result::ERROR_INITIALIZATION_FAILED => Error::Device(
            "no Vulkan driver of this machine could be started: too little memory for it, or a broken installation (VK_LOADER_DEBUG=error tells why)".into(),
        ),
        e => super::result::explain("listing Vulkan devices", e),
    })?;
    devices.into_iter().enumerate().map(|(index, d)| describe(instance, index, d)).collect()
}

fn describe(instance: &Instance, index: usize, physical: vk::PhysicalDevice) -> Result<DeviceInfo> {
    let raw = &instance.raw;
    // SAFETY (all queries below): the physical device belongs to the living instance
    let extensions =
        unsafe { raw.enumerate_device_extension_properties(physical) }.context("listing device extensions")?;
    let has = |name: &CStr| {
        extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(name)) && !name.to_str().is_ok_and(faults::lacks)
    };

    // properties of the driver and of the extensions that it has
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut v11 = vk::PhysicalDeviceVulkan11Properties::default();
    let mut structure = vk::PhysicalDeviceAccelerationStructurePropertiesKHR::default();
    let mut pipeline = vk::PhysicalDeviceRayTracingPipelinePropertiesKHR::default();
    let mut properties2 = vk::PhysicalDeviceProperties2::default().push_next(&mut driver).push_next(&mut v11);
    if has(khr::acceleration_structure::NAME) {
        properties2 = properties2.push_next(&mut structure);
    }
    if has(khr::ray_tracing_pipeline::NAME) {
        properties2 = properties2.push_next(&mut pipeline);
    }
    unsafe { raw.get_physical_device_properties2(physical, &mut properties2) };
    let properties = properties2.properties;

    // features, of which structures may be chained only if the driver knows them
    let mut f12 = vk::PhysicalDeviceVulkan12Features::default();
    let mut f13 = vk::PhysicalDeviceVulkan13Features::default();
    let mut f_structure = vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default();
    let mut f_pipeline = vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default();
    let mut f_query = vk::PhysicalDeviceRayQueryFeaturesKHR::default();
    let mut features2 = vk::PhysicalDeviceFeatures2::default();
    let vulkan13 = properties.api_version >= vk::API_VERSION_1_3;
    if vulkan13 {
        features2 = features2.push_next(&mut f12).push_next(&mut f13);
    }
    if has(khr::acceleration_structure::NAME) {
        features2 = features2.push_next(&mut f_structure);
    }
    if has(khr::ray_tracing_pipeline::NAME) {
        features2 = features2.push_next(&mut f_pipeline);
    }
    if has(khr::ray_query::NAME) {
        features2 = features2.push_next(&mut f_query);
    }
    unsafe { raw.get_physical_device_features2(physical, &mut features2) };
    let int64 = features2.features.shader_int64 == vk::TRUE && !faults::lacks("shaderInt64");

    let families = unsafe { raw.get_physical_device_queue_family_properties(physical) };
    let family = |flags| families.iter().position(|f| f.queue_flags.contains(flags)).map(|k| k as u32);
    // one queue family for graphics and compute, if available
    let graphics_family = family(vk::QueueFlags::COMPUTE | vk::QueueFlags::GRAPHICS);
    let queue_family = graphics_family.or_else(|| family(vk::QueueFlags::COMPUTE));

    // requirements, and what is an option
    let missing_floor = missing_floor(vulkan13, queue_family.is_some(), &f12, &f13);
    let missing_raster = missing_raster(raw, physical, &properties, graphics_family.is_some(), &f13);
    let ray_tracing = RayTracingExtensions {
        acceleration_structure: f_structure.acceleration_structure == vk::TRUE,
        deferred_host_operations: has(khr::deferred_host_operations::NAME),
        ray_tracing_pipeline: f_pipeline.ray_tracing_pipeline == vk::TRUE,
        ray_query: f_query.ray_query == vk::TRUE,
    };

    // limits and names
    let kind = match properties.device_type {
        vk::PhysicalDeviceType::DISCRETE_GPU => "discrete",
        vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated",
        vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual",
        vk::PhysicalDeviceType::CPU => "cpu",
        _ => "other",
    };
    let max_allocation = if vulkan13 { max_allocation(raw, physical) } else { 0 };
    let device_memory = device_memory(raw, physical);
    let limits = Limits { max_allocation, device_memory, ..limits(&properties, &v11, &f13, &structure, &pipeline) };
    Ok(DeviceInfo {
        physical,
        index,
        name: text(&properties.device_name),
        kind,
        api_version: version_text(properties.api_version),
        driver: format!("{} {}", text(&driver.driver_name), text(&driver.driver_info)),
        vendor_id: properties.vendor_id,
        device_id: properties.device_id,
        driver_version: properties.driver_version,
        pipeline_cache_uuid: properties.pipeline_cache_uuid,
        missing_floor,
        int64,
        unified_memory: matches!(kind, "cpu" | "integrated"),
        buffer_device_address: vulkan13 && f12.buffer_device_address == vk::TRUE,
        ray_tracing,
        is_portability_subset: has(khr::portability_subset::NAME),
        missing_raster,
        limits,
        queue_family,
    })
}

/// A Vulkan version, as people write it.
fn version_text(version: u32) -> String {
    let [major, minor] = [vk::api_version_major(version), vk::api_version_minor(version)];
    format!("{major}.{minor}.{}", vk::api_version_patch(version))
}

/// Names of the features that the device lacks and skylit cannot do without.
fn missing_floor(
    vulkan13: bool,
    has_queue: bool,
    f12: &vk::PhysicalDeviceVulkan12Features,
    f13: &vk::PhysicalDeviceVulkan13Features,
) -> Vec<String> {
    let mut missing_floor = Vec::new();
    if !vulkan13 || faults::lacks("Vulkan 1.3") {
        missing_floor.push("Vulkan 1.3".to_owned());
    } else {
        for (supported, name) in [
            (f12.buffer_device_address, "bufferDeviceAddress"),
            (f12.host_query_reset, "hostQueryReset"),
            (f13.maintenance4, "maintenance4"),
            (f13.synchronization2, "synchronization2"),
        ] {
            if supported == vk::FALSE || faults::lacks(name) {
                missing_floor.push(name.to_owned());
            }
        }
    }
    if !has_queue {
        missing_floor.push("a compute queue".to_owned());
    }
    missing_floor
}

/// Names of the features that the device lacks and rasterization needs.
fn missing_raster(
    raw: &ash::Instance,
    physical: vk::PhysicalDevice,
    properties: &vk::PhysicalDeviceProperties,
    has_graphics_queue: bool,
    f13: &vk::PhysicalDeviceVulkan13Features,
) -> Vec<String> {
    let narrow = vector_bits(&text(&properties.device_name)).is_none_or(|bits| bits <= MAX_RASTER_BITS);
    let missing_raster = [
        (has_graphics_queue, "a queue for graphics and compute"),
        (f13.dynamic_rendering == vk::TRUE, "dynamicRendering"),
        (narrow, "vectors of at most 256 bits (LP_NATIVE_VECTOR_WIDTH=256)"),
        (
            is_target(raw, physical, IDS, vk::FormatFeatureFlags::COLOR_ATTACHMENT),
            "render targets of format R32G32_UINT",
        ),
        (
            is_target(raw, physical, DEPTH, vk::FormatFeatureFlags::DEPTH_STENCIL_ATTACHMENT),
            "depth images of format D32_SFLOAT",
        ),
    ];
    missing_raster.iter().filter(|n| !n.0).map(|n| n.1.to_owned()).collect()
}

/// Bytes of memory that is the device's own.
fn device_memory(raw: &ash::Instance, physical: vk::PhysicalDevice) -> u64 {
    // SAFETY: the physical device belongs to the living instance
    let memory = unsafe { raw.get_physical_device_memory_properties(physical) };
    let heaps = &memory.memory_heaps[..memory.memory_heap_count as usize];
    heaps.iter().filter(|h| h.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL)).map(|h| h.size).sum()
}

/// Bytes of the largest buffer, which Vulkan 1.3 tells.
fn max_allocation(raw: &ash::Instance, physical: vk::PhysicalDevice) -> u64 {
    let mut v13 = vk::PhysicalDeviceVulkan13Properties::default();
    let mut v11 = vk::PhysicalDeviceVulkan11Properties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut v13).push_next(&mut v11);
    // SAFETY: the physical device belongs to the living instance
    unsafe { raw.get_physical_device_properties2(physical, &mut properties) };
    v13.max_buffer_size.min(v11.max_memory_allocation_size)
}

/// The limits that properties and features tell.
fn limits(
    properties: &vk::PhysicalDeviceProperties,
    v11: &vk::PhysicalDeviceVulkan11Properties,
    f13: &vk::PhysicalDeviceVulkan13Features,
    structure: &vk::PhysicalDeviceAccelerationStructurePropertiesKHR,
    pipeline: &vk::PhysicalDeviceRayTracingPipelinePropertiesKHR,
) -> Limits {
    // what the invocations of a subgroup can do together
    let can = |operations| {
        v11.subgroup_supported_stages.contains(vk::ShaderStageFlags::COMPUTE)
            && v11.subgroup_supported_operations.contains(vk::SubgroupFeatureFlags::BASIC | operations)
    };
    let has_ballot = can(vk::SubgroupFeatureFlags::BALLOT);
    let has_arithmetic = can(vk::SubgroupFeatureFlags::BALLOT | vk::SubgroupFeatureFlags::ARITHMETIC);
    let is_full = (8..=64).contains(&v11.subgroup_size) && f13.compute_full_subgroups == vk::TRUE;

    // the rest is as the structures have it
    let limits = &properties.limits;
    Limits {
        subgroup_size: v11.subgroup_size,
        subgroup_ballot: has_ballot,
        packets: has_arithmetic && is_full,
        max_workgroups_x: limits.max_compute_work_group_count[0],
        max_image_side: [limits.max_image_dimension2_d, limits.max_framebuffer_width, limits.max_framebuffer_height]
            .into_iter()
            .min()
            .unwrap_or(0),
        max_push_constants: limits.max_push_constants_size,
        max_viewport_side: limits.max_viewport_dimensions.map(|n| n as f32).into_iter().fold(f32::INFINITY, f32::min),
        viewport_range: limits.viewport_bounds_range,
        timestamp_period: if limits.timestamp_compute_and_graphics == vk::TRUE { limits.timestamp_period } else { 0.0 },
        scratch_alignment: structure.min_acceleration_structure_scratch_offset_alignment,
        shader_group_handle_size: pipeline.shader_group_handle_size,
        shader_group_handle_alignment: pipeline.shader_group_handle_alignment,
        shader_group_base_alignment: pipeline.shader_group_base_alignment,
        ..Default::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cpu_drivers_name_says_how_wide_its_vectors_are() {
        assert_eq!(vector_bits("llvmpipe (LLVM 15.0.6, 256 bits)"), Some(256));
        assert_eq!(vector_bits("llvmpipe (LLVM 19.1.7, 512 bits)"), Some(512));
        for other in ["llvmpipe", "NVIDIA H100 80GB HBM3", "a GPU with 512 bits)", ""] {
            assert_eq!(vector_bits(other), None, "{other}");
        }
    }
}
