//! `--sampling`: the sampling strategies of paths.

use clap::ValueEnum;

use crate::integrators::path::Strategy;

/// How directions are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Sampling {
    /// Multiple importance sampling of BSDF and lights, power heuristic
    Mis,
    /// BSDF sampling only
    Bsdf,
    /// Light sampling for emitters that it can sample, BSDF sampling for the rest
    Light,
    /// Cosine-weighted hemisphere sampling
    Cosine,
    /// Uniform hemisphere sampling
    Uniform,
}

impl From<Sampling> for Strategy {
    fn from(s: Sampling) -> Self {
        match s {
            Sampling::Mis => Strategy::Mis,
            Sampling::Bsdf => Strategy::Bsdf,
            Sampling::Light => Strategy::Light,
            Sampling::Cosine => Strategy::Cosine,
            Sampling::Uniform => Strategy::Uniform,
        }
    }
}
