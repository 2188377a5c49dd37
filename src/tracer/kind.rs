//! Which tracers there are, and what each needs of a device.

use crate::gpu::DeviceInfo;

/// Which tracer runs the streams.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum TracerKind {
    /// VK_KHR_ray_tracing_pipeline.
    Pipeline,
    /// VK_KHR_ray_query in compute shaders.
    Query,
    /// Compute shaders over a software BVH.
    Compute,
}

impl TracerKind {
    /// All of them, in the order in which they are listed to users.
    pub const ALL: [TracerKind; 3] = [TracerKind::Pipeline, TracerKind::Query, TracerKind::Compute];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            TracerKind::Pipeline => "pipeline",
            TracerKind::Query => "query",
            TracerKind::Compute => "compute",
        }
    }

    /// The extensions and features that it requires, and those that the device lacks.
    pub fn needs(self, info: &DeviceInfo) -> TracerNeeds {
        let extensions = &info.ray_tracing;
        let structures = [
            ("VK_KHR_acceleration_structure", extensions.acceleration_structure),
            ("VK_KHR_deferred_host_operations", extensions.deferred_host_operations),
        ];
        let with_structures = |own| [own, structures[0], structures[1]].to_vec();
        let list = match self {
            TracerKind::Pipeline => with_structures(("VK_KHR_ray_tracing_pipeline", extensions.ray_tracing_pipeline)),
            TracerKind::Query => with_structures(("VK_KHR_ray_query", extensions.ray_query)),
            TracerKind::Compute => vec![("bufferDeviceAddress", info.buffer_device_address)],
        };
        TracerNeeds {
            tracer: self,
            needs: list.iter().map(|n| n.0.to_owned()).collect(),
            missing: list.iter().filter(|n| !n.1).map(|n| n.0.to_owned()).collect(),
        }
    }

    /// Whether it can run on this device.
    pub fn is_supported_by(self, info: &DeviceInfo) -> bool {
        info.missing_floor.is_empty() && self.needs(info).missing.is_empty()
    }

    /// The tracer that `auto` chooses on a device, and the reason.
    pub fn auto(info: &DeviceInfo) -> (TracerKind, String) {
        if info.is_cpu() {
            (
                TracerKind::Compute,
                "the device is a CPU, where ray-tracing extensions are slower than the software BVH".into(),
            )
        } else if TracerKind::Pipeline.is_supported_by(info) {
            (TracerKind::Pipeline, "the device has VK_KHR_ray_tracing_pipeline".into())
        } else if TracerKind::Query.is_supported_by(info) {
            (TracerKind::Query, "the device has VK_KHR_ray_query but no ray-tracing pipelines".into())
        } else {
            (TracerKind::Compute, "the device has no ray-tracing extension".into())
        }
    }
}

impl std::fmt::Display for TracerKind {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// Requirements of a tracer on a device.
#[derive(Clone, Debug, serde::Serialize)]
pub struct TracerNeeds {
    /// The tracer.
    pub tracer: TracerKind,
    /// Required extensions and features.
    pub needs: Vec<String>,
    /// Requirements that the device lacks. When empty, the tracer runs if the device has skylit's
    /// minimum requirements.
    pub missing: Vec<String>,
}
