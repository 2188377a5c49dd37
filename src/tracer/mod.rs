//! The seam: a pass describes a stream of rays, a tracer runs it.

/// Which tracer runs the streams.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum TracerKind {
    /// VK_KHR_ray_tracing_pipeline.
    Pipeline,
    /// VK_KHR_ray_query in compute shaders.
    Query,
    /// Compute shaders over our own hierarchy.
    Compute,
}
