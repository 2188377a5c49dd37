//! The device that benchmarks run on: the one place where they open it and build tracers.

use std::sync::Arc;

use super::common::CommonArgs;
use super::record::HostInfo;
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::gpu::{Device, DeviceInfo, Options};
use crate::terminal::console::one_line;
use crate::tracer::{BuildOptions, ComputeOptions, Needs, Tracer, TracerKind};

pub struct BenchDevice {
    device: Arc<Device>,
}

impl BenchDevice {
    /// Opens the device that the options name.
    pub fn open(args: &CommonArgs) -> Result<Self> {
        let options = Options { device: args.device.clone(), validation: args.validation, ..Default::default() };
        Ok(Self { device: Device::open(&options)? })
    }

    pub fn info(&self) -> &DeviceInfo {
        &self.device.info
    }

    pub fn host_info(&self) -> HostInfo {
        HostInfo {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            device: self.device.info.name.clone(),
            driver: self.device.info.driver.clone(),
            cpu: cpu_name(),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
        }
    }

    /// Builds what traces a scene.
    pub fn tracer(
        &self,
        flat: &FlatScene,
        kind: TracerKind,
        needs: Needs,
        options: impl Into<ComputeOptions>,
        build: &BuildOptions,
    ) -> Result<Tracer> {
        Tracer::with_build(&self.device, kind, flat, needs, options.into(), build)
    }

    /// Saves compiled pipelines for the next run, if this one `succeeded`.
    ///
    /// # Errors
    /// [`crate::Error::CheckFailed`] when the validation layer had something to say.
    pub fn close(&self, succeeded: bool) -> Result<()> {
        let valid = self.device.check_validation();
        if succeeded {
            self.device.save_pipeline_cache();
        }
        valid
    }
}

/// Name of the host's processor, as the kernel says it; empty where it does not.
fn cpu_name() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    // "model name" on x86; boards with other processors say "Hardware" or "Model" at best
    let value = |key: &str| {
        text.lines().filter_map(|l| l.split_once(':')).find(|(k, _)| k.trim() == key).map(|(_, v)| one_line(v))
    };
    ["model name", "Hardware", "Model", "cpu model"].into_iter().find_map(value).unwrap_or_default()
}
