//! What knows no device: metrics of images, temporal metrics, FLIP, statistics, the parity judge, the double-precision oracle, the sampler and its distributions, hierarchies.

mod agreement;
mod bilinear;
mod bvh2;
mod clip;
mod comparison;
mod cumulative;
mod distributions;
mod flip;
mod glsl;
mod images;
mod known_answers;
mod lab;
mod layout;
mod mask;
mod oracle;
mod presets;
mod regression;
mod sampling;
mod stats;
mod temporal;
mod visits;
mod z_test;
