//! Without the feature `probes` nothing fails on demand (`faults.rs`).

use std::sync::atomic::AtomicBool;

use ash::vk;

pub(super) fn submission(_is_lost: &AtomicBool) -> Result<(), vk::Result> {
    Ok(())
}

pub(super) fn is_out_of_memory(_used: impl FnOnce() -> u64, _size: u64) -> bool {
    false
}

pub(super) fn lacks(_name: &str) -> bool {
    false
}
