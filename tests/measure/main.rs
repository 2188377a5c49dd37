//! What knows no device: metrics of images, temporal metrics, FLIP, statistics, the parity judge, the double-precision oracle, the sampler and its distributions, hierarchies.

mod bilinear;
mod bvh2;
mod clip;
mod comparison;
mod convergence;
mod cumulative;
mod displayed;
mod distributions;
mod flip;
mod images;
mod known_answers;
mod layout;
mod mask;
mod oracle;
mod refit;
mod regression;
mod sampling;
mod stats;
mod temporal;
mod z_test;
