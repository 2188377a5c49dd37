//! Shaders that only tests use: programs that are built with the feature `probes` have them, as tests
//! are, and no other. `src/shaders/registry.rs` has the rest.

use super::source::{ComputeShader, Mode::Any, Rays::Generated, Shader, StreamShaders};

/// BSDFs of materials, evaluated for given directions.
pub static BSDF_PROBE_ANY: StreamShaders = StreamShaders::new("bsdf_probe", Any, Generated);
/// The sampler and the warps, evaluated for given inputs.
pub static SAMPLER_PROBE_ANY: StreamShaders = StreamShaders::new("sampler_probe", Any, Generated);

/// The passes that trace rays.
pub const STREAMS: &[&StreamShaders] = &[&BSDF_PROBE_ANY, &SAMPLER_PROBE_ANY];

/// Divisions and conversions of whole numbers, evaluated for given inputs.
pub static INTEGERS_PROBE: ComputeShader = ComputeShader::new("integers_probe");
/// Sequences, evaluated for given inputs.
pub static SEQUENCE_PROBE: ComputeShader = ComputeShader::new("sequence_probe");

/// The passes that trace no rays.
pub const COMPUTE: &[&ComputeShader] = &[&INTEGERS_PROBE, &SEQUENCE_PROBE];

/// Lists all shaders of tests.
pub fn list_shaders() -> Vec<Shader> {
    let streams = STREAMS.iter().flat_map(|s| s.variants());
    streams.chain(COMPUTE.iter().flat_map(|c| c.variants())).collect()
}
