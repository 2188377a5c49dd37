//! Compute and ray-tracing pipelines. There are no descriptor sets: everything is reached by
//! address from push constants.
//!
//! A pipeline is a shared handle: the device knows the pipelines in use, and returns the same one
//! for the same SPIR-V and the same specialization. [`Device::live_pipelines`] keeps pipelines
//! alive beyond the work that they were compiled for.

use std::cell::Cell;
use std::collections::{HashMap, VecDeque};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Instant;

use ash::vk;

use super::buffer::{Buffer, Memory};
use super::device::Device;
use super::result::Context;
use crate::error::{Error, Result};
use crate::interface::constants::Constant;
use crate::interface::records::ray::Push;
use crate::shaders::{ComputeShader, Shader, specialize};
use crate::stage::{self, Stage};

/// Size in bytes of the push-constant block, the same for all pipelines.
pub(super) const PUSH_BYTES: u32 = size_of::<Push>() as u32;

pub(super) const RAY_STAGES: vk::ShaderStageFlags = vk::ShaderStageFlags::from_raw(
    vk::ShaderStageFlags::RAYGEN_KHR.as_raw()
        | vk::ShaderStageFlags::MISS_KHR.as_raw()
        | vk::ShaderStageFlags::CLOSEST_HIT_KHR.as_raw()
        | vk::ShaderStageFlags::ANY_HIT_KHR.as_raw()
        | vk::ShaderStageFlags::INTERSECTION_KHR.as_raw(),
);

/// Values of specialization constants.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct Specialization {
    entries: Vec<(u32, u32)>,
}

impl Specialization {
    /// Sets a constant; a bool is 0 or 1.
    pub fn set(mut self, constant: Constant, value: impl Into<u32>) -> Self {
        self.entries.push((constant.id, value.into()));
        self
    }

    /// Sets several constants.
    pub fn set_all(mut self, constants: impl IntoIterator<Item = (Constant, u32)>) -> Self {
        self.entries.extend(constants.into_iter().map(|(constant, value)| (constant.id, value)));
        self
    }

    /// Adds the constants of `other`.
    pub fn and(mut self, other: &Specialization) -> Self {
        self.entries.extend(&other.entries);
        self
    }
}

/// A shader module that lives while pipelines are made from it.
pub(super) struct Module<'a> {
    pub(super) raw: vk::ShaderModule,
    device: &'a Device,
}

impl<'a> Module<'a> {
    /// Creates a module whose specialization constants are set: pipelines need not set them.
    pub(super) fn new(
        device: &'a Device,
        name: &str,
        shader: &Shader,
        specialization: &Specialization,
    ) -> Result<Self> {
        let words = specialize(&shader.spirv()?, &specialization.entries, device.info.is_cpu())
            .map_err(|e| Error::Vulkan(format!("shader {name} is not SPIR-V: {e}")))?;
        // SAFETY: SPIR-V from the build script's compiler, and valid after specialization: the
        // validation layer looks at it in tests
        let raw = unsafe { device.raw.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&words), None) }
            .context(name)?;
        device.name(raw, name);
        Ok(Self { raw, device })
    }
}

impl Drop for Module<'_> {
    fn drop(&mut self) {
        // SAFETY: pipelines keep no reference to modules once made
        unsafe { self.device.raw.destroy_shader_module(self.raw, None) };
    }
}

pub(super) fn layout(device: &Device, stages: vk::ShaderStageFlags) -> Result<vk::PipelineLayout> {
    let ranges = [vk::PushConstantRange { stage_flags: stages, offset: 0, size: PUSH_BYTES }];
    // SAFETY: a plain layout
    unsafe {
        device.raw.create_pipeline_layout(&vk::PipelineLayoutCreateInfo::default().push_constant_ranges(&ranges), None)
    }
    .context("the pipeline layout")
}

/// The identity of a pipeline: hashes of its shaders' SPIR-V (of the contents, because
/// live-compiled shaders change), their specialization, and creation flags.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Key {
    shaders: Vec<u128>,
    specialization: Specialization,
    flags: u32,
}

impl Key {
    fn new<'a>(
        shaders: impl IntoIterator<Item = &'a Shader>,
        specialization: &Specialization,
        flags: u32,
    ) -> Result<Self> {
        let hash = |shader: &Shader| Ok(xxhash_rust::xxh3::xxh3_128(&shader.spirv()?));
        let shaders = shaders.into_iter().map(hash).collect::<Result<_>>()?;
        Ok(Self { shaders, specialization: specialization.clone(), flags })
    }
}

/// A pipeline and its layout, destroyed with the last handle.
pub(super) struct Compiled {
    pub(super) raw: vk::Pipeline,
    pub(super) layout: vk::PipelineLayout,
    /// The shader binding table of a ray-tracing pipeline.
    table: Option<Table>,
    device: Arc<Device>,
}

impl Compiled {
    /// A layout whose pipeline is yet to be compiled.
    pub(super) fn begin(device: &Arc<Device>, layout: vk::PipelineLayout) -> Self {
        Self { raw: vk::Pipeline::null(), layout, table: None, device: device.clone() }
    }
}

impl Drop for Compiled {
    fn drop(&mut self) {
        // SAFETY: submissions are waited for
        unsafe {
            self.device.raw.destroy_pipeline(self.raw, None);
            self.device.raw.destroy_pipeline_layout(self.layout, None);
        }
    }
}

thread_local! {
    static COMPILE_SECONDS: Cell<f64> = const { Cell::new(0.0) };
}

/// Seconds that this thread has waited for pipelines to be compiled.
pub fn compile_seconds() -> f64 {
    COMPILE_SECONDS.get()
}

/// Adds the time until it is dropped to [`compile_seconds`], and is a stage meanwhile.
pub(super) struct CompileTimer(Instant, #[expect(dead_code, reason = "it is a guard")] Stage);

impl CompileTimer {
    pub(super) fn start() -> Self {
        Self(Instant::now(), stage::begin("compiling kernels"))
    }
}

impl Drop for CompileTimer {
    fn drop(&mut self) {
        COMPILE_SECONDS.set(COMPILE_SECONDS.get() + self.0.elapsed().as_secs_f64());
    }
}

/// The pipelines of a device that are in use.
pub(super) struct LivePipelines {
    all: Mutex<HashMap<Key, Weak<Compiled>>>,
    /// The pipelines compiled last, at most `max_kept`. They hold their device, which is then never
    /// closed.
    kept: Mutex<VecDeque<Arc<Compiled>>>,
    max_kept: usize,
    /// How many have been compiled.
    compiled: AtomicU64,
}

impl LivePipelines {
    /// `max_kept`: [`super::Options::keep_pipelines`].
    pub(super) fn new(max_kept: usize) -> Self {
        Self { all: Mutex::default(), kept: Mutex::default(), max_kept, compiled: AtomicU64::new(0) }
    }

    /// The pipeline with this key, compiled by `make` if there is none.
    fn get(&self, key: Key, make: impl FnOnce() -> Result<Compiled>) -> Result<Arc<Compiled>> {
        let all = || self.all.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(pipeline) = all().get(&key).and_then(Weak::upgrade) {
            return Ok(pipeline);
        }
        // not under the lock: compiling takes seconds, and several threads compile at once
        let made = Arc::new(make()?);
        self.compiled.fetch_add(1, Ordering::Relaxed);
        let mut all = all();
        all.retain(|_, pipeline| pipeline.strong_count() > 0);
        all.insert(key, Arc::downgrade(&made));
        drop(all);
        Ok(self.keep(made))
    }

    fn keep(&self, pipeline: Arc<Compiled>) -> Arc<Compiled> {
        if self.max_kept > 0 {
            let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
            if kept.len() == self.max_kept {
                kept.pop_front();
            }
            kept.push_back(pipeline.clone());
        }
        pipeline
    }
}

/// Keeps pipelines alive ([`Device::live_pipelines`]).
#[derive(Default)]
pub struct KeptPipelines {
    #[expect(dead_code, reason = "only keeps them alive")]
    pipelines: Vec<Arc<Compiled>>,
}

impl Device {
    /// Handles of all pipelines in use. While they are kept, requesting one of these pipelines
    /// again does not compile it.
    pub fn live_pipelines(&self) -> KeptPipelines {
        let all = self.live.all.lock().unwrap_or_else(PoisonError::into_inner);
        KeptPipelines { pipelines: all.values().filter_map(Weak::upgrade).collect() }
    }

    /// Number of pipelines that have been compiled with this device, whether they came from the
    /// driver's cache or not.
    pub fn compiled_pipelines(&self) -> u64 {
        self.live.compiled.load(Ordering::Relaxed)
    }
}

/// A compute pipeline.
#[derive(Clone)]
pub struct ComputePipeline(Arc<Compiled>);

impl ComputePipeline {
    /// Compiles a compute shader with the entry point `main`.
    pub fn new(device: &Arc<Device>, name: &str, shader: &Shader, specialization: &Specialization) -> Result<Self> {
        Self::with_flags(device, name, shader, specialization, vk::PipelineShaderStageCreateFlags::empty())
    }

    /// As [`ComputePipeline::new`], for a shader that requires full subgroups of the reported size;
    /// the device must have [`super::Limits::packets`].
    pub fn with_full_subgroups(device: &Arc<Device>, name: &str, shader: &Shader, s: &Specialization) -> Result<Self> {
        Self::with_flags(device, name, shader, s, vk::PipelineShaderStageCreateFlags::REQUIRE_FULL_SUBGROUPS)
    }

    fn with_flags(
        device: &Arc<Device>,
        name: &str,
        shader: &Shader,
        specialization: &Specialization,
        flags: vk::PipelineShaderStageCreateFlags,
    ) -> Result<Self> {
        let _timer = CompileTimer::start();
        let key = Key::new([shader], specialization, flags.as_raw())?;
        let make = || {
            let module = Module::new(device, name, shader, specialization)?;
            let mut pipeline = Compiled::begin(device, layout(device, vk::ShaderStageFlags::COMPUTE)?);
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .flags(flags)
                .module(module.raw)
                .name(c"main");
            let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(pipeline.layout)];
            // SAFETY: module and layout are of this device
            pipeline.raw = unsafe { device.raw.create_compute_pipelines(device.pipeline_cache, &info, None) }
                .map_err(|e| e.1)
                .context(name)?[0];
            device.name(pipeline.raw, name);
            Ok(pipeline)
        };
        device.live.get(key, make).map(Self)
    }

    pub(super) fn raw(&self) -> vk::Pipeline {
        self.0.raw
    }

    pub(super) fn layout(&self) -> vk::PipelineLayout {
        self.0.layout
    }
}

impl ComputeShader {
    /// Compiles it for a device.
    ///
    /// # Errors
    /// Those of the device.
    pub fn pipeline(&self, device: &Arc<Device>) -> Result<ComputePipeline> {
        self.specialized(device, &Specialization::default())
    }

    /// Compiles it for a device, with specialization constants.
    ///
    /// # Errors
    /// Those of the device.
    pub fn specialized(&self, device: &Arc<Device>, constants: &Specialization) -> Result<ComputePipeline> {
        ComputePipeline::new(device, self.name, &self.variant(device.info.int64), constants)
    }
}

/// The miss and hit shaders, which all streams of the pipeline tracer share.
pub struct HitShaders<'a> {
    /// Miss shader.
    pub miss: &'a Shader,
    /// Closest-hit shader of triangles.
    pub triangle_closest: &'a Shader,
    /// Any-hit shader of alpha-tested triangles; `None` if the scene has none.
    pub triangle_any: Option<&'a Shader>,
    /// Closest-hit and intersection shaders of spheres; `None` if the scene has none.
    pub sphere: Option<[&'a Shader; 2]>,
}

/// A ray-tracing pipeline with its shader binding table. Hit groups: 0 opaque triangles, 1
/// alpha-tested triangles, 2 spheres (unused groups repeat group 0, so that the indices are always
/// the same).
#[derive(Clone)]
pub struct RayTracingPipeline(Arc<Compiled>);

/// A shader binding table.
pub(super) struct Table {
    pub(super) raygen: vk::StridedDeviceAddressRegionKHR,
    pub(super) miss: vk::StridedDeviceAddressRegionKHR,
    pub(super) hit: vk::StridedDeviceAddressRegionKHR,
    _buffer: Buffer,
}

impl RayTracingPipeline {
    /// Compiles a ray generation shader together with the shared shaders.
    pub fn new(
        device: &Arc<Device>,
        name: &str,
        raygen: &Shader,
        shared: &HitShaders,
        specialization: &Specialization,
    ) -> Result<Self> {
        let _timer = CompileTimer::start();
        let functions = device
            .pipelines
            .as_ref()
            .ok_or_else(|| Error::Device("the device has no VK_KHR_ray_tracing_pipeline".into()))?;
        let optional = shared.triangle_any.into_iter().chain(shared.sphere.into_iter().flatten());
        let key = Key::new(
            [raygen, shared.miss, shared.triangle_closest].into_iter().chain(optional),
            specialization,
            u32::MAX,
        )?;
        device.live.get(key, || Self::compile(device, functions, name, raygen, shared, specialization)).map(Self)
    }

    fn compile(
        device: &Arc<Device>,
        functions: &ash::khr::ray_tracing_pipeline::Device,
        name: &str,
        raygen: &Shader,
        shared: &HitShaders,
        specialization: &Specialization,
    ) -> Result<Compiled> {
        let module = |name, shader| Module::new(device, name, shader, specialization);
        let mut modules = vec![
            (module(name, raygen)?, vk::ShaderStageFlags::RAYGEN_KHR),
            (module("miss", shared.miss)?, vk::ShaderStageFlags::MISS_KHR),
            (module("triangle closest hit", shared.triangle_closest)?, vk::ShaderStageFlags::CLOSEST_HIT_KHR),
        ];

        // groups in the order that the structures' instances name: opaque, with alpha, spheres
        let unused = vk::SHADER_UNUSED_KHR;
        let general = |index| {
            vk::RayTracingShaderGroupCreateInfoKHR::default()
                .ty(vk::RayTracingShaderGroupTypeKHR::GENERAL)
                .general_shader(index)
                .closest_hit_shader(unused)
                .any_hit_shader(unused)
                .intersection_shader(unused)
        };
        let triangles = |any| {
            vk::RayTracingShaderGroupCreateInfoKHR::default()
                .ty(vk::RayTracingShaderGroupTypeKHR::TRIANGLES_HIT_GROUP)
                .general_shader(unused)
                .closest_hit_shader(2)
                .any_hit_shader(any)
                .intersection_shader(unused)
        };
        let mut groups = vec![general(0), general(1), triangles(unused), triangles(unused), triangles(unused)];

        // kinds of geometry that the scene lacks have no shaders
        if let Some(any) = shared.triangle_any {
            groups[3] = triangles(modules.len() as u32);
            modules.push((module("triangle any hit", any)?, vk::ShaderStageFlags::ANY_HIT_KHR));
        }
        if let Some([closest, intersection]) = shared.sphere {
            let first = modules.len() as u32;
            groups[4] = vk::RayTracingShaderGroupCreateInfoKHR::default()
                .ty(vk::RayTracingShaderGroupTypeKHR::PROCEDURAL_HIT_GROUP)
                .general_shader(unused)
                .closest_hit_shader(first)
                .any_hit_shader(unused)
                .intersection_shader(first + 1);
            modules.push((module("sphere closest hit", closest)?, vk::ShaderStageFlags::CLOSEST_HIT_KHR));
            modules.push((module("sphere intersection", intersection)?, vk::ShaderStageFlags::INTERSECTION_KHR));
        }

        let mut pipeline = Compiled::begin(device, layout(device, RAY_STAGES)?);
        let stages: Vec<_> = modules
            .iter()
            .map(|(m, stage)| vk::PipelineShaderStageCreateInfo::default().stage(*stage).module(m.raw).name(c"main"))
            .collect();
        let info = [vk::RayTracingPipelineCreateInfoKHR::default()
            .stages(&stages)
            .groups(&groups)
            .max_pipeline_ray_recursion_depth(1)
            .layout(pipeline.layout)];
        // SAFETY: modules and layout are of this device
        pipeline.raw = unsafe {
            functions.create_ray_tracing_pipelines(vk::DeferredOperationKHR::null(), device.pipeline_cache, &info, None)
        }
        .map_err(|e| e.1)
        .context(name)?[0];
        device.name(pipeline.raw, name);
        pipeline.table = Some(Table::new(functions, &pipeline, groups.len() as u32)?);
        Ok(pipeline)
    }

    pub(super) fn raw(&self) -> vk::Pipeline {
        self.0.raw
    }

    pub(super) fn layout(&self) -> vk::PipelineLayout {
        self.0.layout
    }

    pub(super) fn table(&self) -> Option<&Table> {
        self.0.table.as_ref()
    }
}

impl Table {
    /// Writes the group handles with the device's sizes and alignments: raygen, miss, then the hit
    /// groups.
    fn new(functions: &ash::khr::ray_tracing_pipeline::Device, pipeline: &Compiled, groups: u32) -> Result<Self> {
        let limits = &pipeline.device.info.limits;
        let size = limits.shader_group_handle_size as usize;
        // SAFETY: the pipeline has this many groups
        let handles =
            unsafe { functions.get_ray_tracing_shader_group_handles(pipeline.raw, 0, groups, size * groups as usize) }
                .context("the shader group handles")?;

        // a region for each kind of shader
        let base = limits.shader_group_base_alignment as u64;
        let stride = (size as u64).next_multiple_of(limits.shader_group_handle_alignment as u64);
        let regions = [1u64, 1, groups as u64 - 2];
        let sizes = regions.map(|n| (n * stride).next_multiple_of(base));
        let mut table = Buffer::with_usage(
            &pipeline.device,
            "shader binding table",
            // room to align its beginning
            sizes.iter().sum::<u64>() + base,
            Memory::Upload,
            vk::BufferUsageFlags::SHADER_BINDING_TABLE_KHR,
        )?;
        let start = table.address().next_multiple_of(base);
        let mut offset = start - table.address();
        let mut addresses = [0; 3];
        let mut handle = 0;

        // handles at the strides that the device wants
        let table_address = table.address();
        let bytes = table.bytes_mut().ok_or_else(|| Error::Vulkan("the shader binding table is not mapped".into()))?;
        for (k, n) in regions.into_iter().enumerate() {
            addresses[k] = table_address + offset;
            for g in 0..n {
                let at = (offset + g * stride) as usize;
                bytes[at..at + size].copy_from_slice(&handles[handle * size..][..size]);
                handle += 1;
            }
            offset += sizes[k];
        }
        let region = |k: usize, stride: u64| vk::StridedDeviceAddressRegionKHR {
            device_address: addresses[k],
            stride,
            size: sizes[k],
        };
        // the ray generation table's size must be its stride
        Ok(Self { raygen: region(0, sizes[0]), miss: region(1, stride), hit: region(2, stride), _buffer: table })
    }
}
