//! The logical device: one queue, one allocator, one pipeline cache.

use std::mem::ManuallyDrop;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard};

use ash::{ext, khr, vk};
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, Allocator, AllocatorCreateDesc};
use gpu_allocator::{AllocationError, AllocationSizes};

use super::cache;
use super::info::{DeviceInfo, enumerate};
use super::instance::{Instance, ValidationLog, no_driver};
use super::pipeline::LivePipelines;
use super::result::Context;
use crate::error::{Error, Result};

/// Memory that is taken from the driver at a time, bytes; larger buffers get an allocation of their
/// own, so small blocks waste little.
const BLOCK: u64 = 16 << 20;

/// Options to open a device with.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// Index, or part of the name (case does not matter); `None`: the most capable.
    pub device: Option<String>,
    /// Enable the validation layer.
    pub validation: bool,
    /// Use 32-bit loads even if shaderInt64 is available, to test them.
    pub no_int64: bool,
    /// Number of recently compiled pipelines that are kept though unused: for processes that render
    /// many scenes with one device, which is then never closed. A CPU driver's pipelines take
    /// megabytes each.
    pub keep_pipelines: usize,
}

/// An open device.
pub struct Device {
    pub(super) raw: ash::Device,
    /// Functions of VK_KHR_acceleration_structure, if a hardware tracer is supported.
    pub(super) structures: Option<khr::acceleration_structure::Device>,
    /// Functions of VK_KHR_ray_tracing_pipeline, if supported.
    pub(super) pipelines: Option<khr::ray_tracing_pipeline::Device>,
    debug: Option<ext::debug_utils::Device>,
    allocator: ManuallyDrop<Mutex<Allocator>>,
    pub(super) queue: Mutex<vk::Queue>,
    pub(super) queue_family: u32,
    /// A fault that a test asked for has lost it.
    pub(super) is_lost: AtomicBool,
    pub(super) pipeline_cache: vk::PipelineCache,
    pub(super) live: LivePipelines,
    /// Properties of the device. `int64` is false with [`Options::no_int64`], even if supported.
    pub info: DeviceInfo,
    validation: Option<Arc<ValidationLog>>,
    // dropped last
    _instance: Arc<Instance>,
}

impl Device {
    /// Opens the device that `options` name, or the most capable one.
    ///
    /// # Errors
    /// [`Error::Device`] when there is no device, none matches, or it lacks a required feature; the
    /// message names it.
    pub fn open(options: &Options) -> Result<Arc<Self>> {
        let instance = Instance::new(options.validation)?;
        let mut info = pick(enumerate(&instance)?, options.device.as_deref())?;
        info.int64 &= !options.no_int64;
        let queue_family = info.queue_family.ok_or_else(no_driver)?;

        let pipeline = info.has_ray_tracing_pipelines();
        let query = info.has_ray_queries();

        // features that the renderer needs, and those of the tracers that the device can run
        let mut extensions = Vec::new();
        let mut f12 = vk::PhysicalDeviceVulkan12Features::default().buffer_device_address(true).host_query_reset(true);
        let mut f13 = vk::PhysicalDeviceVulkan13Features::default()
            .maintenance4(true)
            .synchronization2(true)
            .dynamic_rendering(info.can_rasterise())
            .compute_full_subgroups(info.limits.packets);
        let mut f_structure =
            vk::PhysicalDeviceAccelerationStructureFeaturesKHR::default().acceleration_structure(true);
        let mut f_pipeline = vk::PhysicalDeviceRayTracingPipelineFeaturesKHR::default().ray_tracing_pipeline(true);
        let mut f_query = vk::PhysicalDeviceRayQueryFeaturesKHR::default().ray_query(true);
        let priorities = [1.0];
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(queue_family).queue_priorities(&priorities)];
        let features = vk::PhysicalDeviceFeatures::default().shader_int64(info.int64);
        let mut create = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_features(&features)
            .push_next(&mut f12)
            .push_next(&mut f13);

        // each tracer's extensions are enabled if they are there
        if pipeline || query {
            extensions
                .extend([khr::acceleration_structure::NAME.as_ptr(), khr::deferred_host_operations::NAME.as_ptr()]);
            create = create.push_next(&mut f_structure);
        }
        if pipeline {
            extensions.push(khr::ray_tracing_pipeline::NAME.as_ptr());
            create = create.push_next(&mut f_pipeline);
        }
        if query {
            extensions.push(khr::ray_query::NAME.as_ptr());
            create = create.push_next(&mut f_query);
        }
        if info.is_portability_subset {
            // Vulkan wants it enabled where it is; features that are optional in it stay off
            extensions.push(khr::portability_subset::NAME.as_ptr());
        }
        create = create.enabled_extension_names(&extensions);

        // SAFETY: the physical device is of this instance; everything enabled was reported as
        // supported
        let raw =
            unsafe { instance.raw.create_device(info.physical, &create, None) }.context("opening the Vulkan device")?;
        // SAFETY: the device was created with one queue of this family
        let queue = unsafe { raw.get_device_queue(queue_family, 0) };

        // memory, and pipelines that were compiled before
        let allocator = Allocator::new(&AllocatorCreateDesc {
            instance: instance.raw.clone(),
            device: raw.clone(),
            physical_device: info.physical,
            debug_settings: Default::default(),
            buffer_device_address: true,
            allocation_sizes: AllocationSizes::new(BLOCK, BLOCK),
        })
        .map_err(|e| Error::Vulkan(format!("creating the allocator failed: {e}")))?;
        let data = cache::load(&info);
        let cache_info = vk::PipelineCacheCreateInfo::default().initial_data(&data);
        // SAFETY: the data's header was checked to be of this device and driver
        let pipeline_cache =
            unsafe { raw.create_pipeline_cache(&cache_info, None) }.context("creating the pipeline cache")?;
        Ok(Arc::new(Self {
            structures: (pipeline || query).then(|| khr::acceleration_structure::Device::new(&instance.raw, &raw)),
            pipelines: pipeline.then(|| khr::ray_tracing_pipeline::Device::new(&instance.raw, &raw)),
            debug: instance.debug_names.then(|| ext::debug_utils::Device::new(&instance.raw, &raw)),
            allocator: ManuallyDrop::new(Mutex::new(allocator)),
            queue: Mutex::new(queue),
            queue_family,
            is_lost: AtomicBool::new(false),
            pipeline_cache,
            live: LivePipelines::new(options.keep_pipelines),
            info,
            validation: instance.validation.clone(),
            raw,
            _instance: instance,
        }))
    }

    pub(super) fn allocator(&self) -> MutexGuard<'_, Allocator> {
        // a poisoned lock means that a thread panicked within the allocator; there is nothing
        // better to do than go on
        self.allocator.lock().unwrap_or_else(|e| e.into_inner())
    }

    /// Allocates memory. `what` it is for, and what helps where none is left, are put into errors.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`], and [`Error::Output`] where the driver keeps memory in a file that
    /// would exceed the limit for files.
    pub(super) fn allocate(&self, request: &AllocationCreateDesc, what: &str, remedy: &str) -> Result<Allocation> {
        let mut allocator = self.allocator();
        let size = request.requirements.size;
        let none_left = |e| Error::OutOfMemory(format!("no device memory left for {what}: {e}; {remedy}"));
        if super::faults::is_out_of_memory(|| allocator.generate_report().total_allocated_bytes, size) {
            return Err(none_left(AllocationError::OutOfMemory));
        }
        let limit = if self.info.is_cpu() { super::environment::file_size_limit() } else { None };
        if let Some(limit) = limit {
            let needed = allocator.generate_report().total_capacity_bytes + size.max(BLOCK);
            // what was freed leaves gaps in the file
            if needed + needed / 2 > limit {
                return Err(Error::Output {
                    path: "device memory".into(),
                    message: format!(
                        "this driver keeps it in a file, which for {what} would be larger than files may be here ({limit} bytes): \
                         raise the limit (`ulimit -f unlimited`)"
                    ),
                });
            }
        }
        allocator.allocate(request).map_err(none_left)
    }

    /// Names an object for validation messages and debuggers.
    pub(super) fn name<T: vk::Handle>(&self, object: T, name: &str) {
        if let Some(debug) = &self.debug
            && let Ok(name) = std::ffi::CString::new(name)
        {
            let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
            // SAFETY: the object is of this device. A failure costs a name only
            let _ = unsafe { debug.set_debug_utils_object_name(&info) };
        }
    }

    /// Takes the messages of the validation layer since the last call.
    pub fn validation_messages(&self) -> Vec<String> {
        self.validation.as_ref().map(|v| v.take()).unwrap_or_default()
    }

    /// Fails if the validation layer has reported a message.
    pub fn check_validation(&self) -> Result<()> {
        match self.validation_messages().as_slice() {
            [] => Ok(()),
            [first, rest @ ..] => Err(Error::Vulkan(format!("validation: {first} (and {} more)", rest.len()))),
        }
    }

    /// Writes the pipeline cache to disk for the next run. A failure is ignored.
    pub fn save_pipeline_cache(&self) {
        // SAFETY: the cache is of this device
        if let Ok(data) = unsafe { self.raw.get_pipeline_cache_data(self.pipeline_cache) } {
            cache::store(&self.info, &data);
        }
    }
}

/// The device that [`Device::open`] would open with these options.
///
/// # Errors
/// As [`Device::open`].
pub fn preferred(options: &Options) -> Result<DeviceInfo> {
    let instance = Instance::new(false)?;
    pick(enumerate(&instance)?, options.device.as_deref())
}

fn pick(devices: Vec<DeviceInfo>, wanted: Option<&str>) -> Result<DeviceInfo> {
    let names = || devices.iter().map(|d| format!("{}: {}", d.index, d.name)).collect::<Vec<_>>().join("; ");
    if devices.is_empty() {
        return Err(no_driver());
    }
    let found = match wanted {
        None => devices.iter().max_by_key(|d| (d.missing_floor.is_empty(), d.preference(), std::cmp::Reverse(d.index))),
        Some(w) => match w.parse::<usize>() {
            Ok(index) => devices.iter().find(|d| d.index == index),
            Err(_) => devices.iter().find(|d| d.name.to_lowercase().contains(&w.to_lowercase())),
        },
    };
    let Some(info) = found else {
        return Err(Error::Device(format!(
            "no device matches '{}'; available: {}",
            wanted.unwrap_or_default(),
            names()
        )));
    };
    if !info.missing_floor.is_empty() {
        return Err(Error::Device(format!(
            "device '{}' lacks {}, which skylit needs; `skylit doctor` lists the devices",
            info.name,
            info.missing_floor.join(", ")
        )));
    }
    Ok(info.clone())
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: every object of the device holds an Arc of it, so all are gone; the allocator
        // goes before the device
        unsafe {
            let _ = self.raw.device_wait_idle();
            self.raw.destroy_pipeline_cache(self.pipeline_cache, None);
            ManuallyDrop::drop(&mut self.allocator);
            self.raw.destroy_device(None);
        }
    }
}
