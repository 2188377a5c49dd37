//! What knows no device: metrics of images, temporal metrics, FLIP, the parity judge, the double-precision oracle, the sampler.

mod comparison;
mod flip;
mod images;
mod known_answers;
mod oracle;
mod sampling;
mod temporal;
mod z_test;
