//! Integrators of stills: how samples become pixels, a folder each; and [`rays`], which traces a set of rays as it is.

pub mod ao;
pub mod aov;
pub mod path;
pub mod rays;
