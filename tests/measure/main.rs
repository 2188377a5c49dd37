//! What knows no device: metrics of images, temporal metrics, FLIP, the parity judge, the double-precision oracle, the sampler.

mod flip;
mod images;
mod oracle;
mod sampling;
mod temporal;
