//! What CPU drivers read from the environment, set right before the first of them is loaded.
//!
//! Mesa's lavapipe has vectors of 256 bits unless `LP_NATIVE_VECTOR_WIDTH` says otherwise. With 512, where the CPU has them, the compute tracer is a quarter to
//! two fifths faster (docs/traversal.md). So whoever opens a device first in a process, be it the program, a test or another program that uses this crate, gets
//! the CPU's widest vectors; a width that the user has set stays.
//!
//! Mesa's cache of compiled shaders does not tell widths apart, and code for one gives wrong results with another. So a width that is not the driver's own choice
//! has a folder of its own, and the pipeline cache has the width in its files' names (`cache.rs`).

use std::ffi::{OsStr, OsString};
use std::path::PathBuf;
use std::sync::Once;
use std::sync::atomic::{AtomicU32, Ordering};

const WIDTH: &str = "LP_NATIVE_VECTOR_WIDTH";
const CACHE: &str = "MESA_SHADER_CACHE_DIR";

/// Bits; 0: the CPU's widest.
static PREFERRED: AtomicU32 = AtomicU32::new(0);

/// Has lavapipe use vectors of so many bits (128, 256 or 512) in place of the CPU's widest, in this process. Mesa draws with 256 at most. It counts for nothing
/// where the user has set `LP_NATIVE_VECTOR_WIDTH`, and once a device has been opened or listed: a driver keeps the width with which it was loaded.
pub fn prefer_vector_bits(bits: u32) {
    PREFERRED.store(bits, Ordering::Relaxed);
}

/// To be called before the Vulkan loader is opened: sets, once in a process, what the drivers that it loads will read.
///
/// The environment belongs to the process. Rust's own reads and writes of it exclude each other (std has a lock), but C code that calls `getenv` in another
/// thread meanwhile is not excluded: a program that has such threads opens its first device before they start, or sets both variables itself, and then nothing
/// is changed here.
pub(super) fn prepare() {
    static PREPARED: Once = Once::new();
    PREPARED.call_once(|| {
        // a driver that another part of the process has loaded keeps its width, and must keep its cache
        if is_loaded() {
            return;
        }
        let changes = changes(std::env::var_os(WIDTH), std::env::var_os(CACHE), preferred_bits(), crate::files::cache_folder());
        for (name, value) in changes {
            if name == CACHE {
                // older versions of Mesa make the last folder of the path only; without it there is no cache, no more
                let _ = std::fs::create_dir_all(&value);
            }
            // SAFETY: std's lock keeps Rust code off the environment meanwhile, no driver runs yet that could read it, and `prepare` says what is asked of
            // programs with other threads in C
            unsafe { std::env::set_var(name, value) };
        }
    });
}

/// Width that is to be asked for where the user has set none; `None`: the driver's own choice.
fn preferred_bits() -> Option<u32> {
    match PREFERRED.load(Ordering::Relaxed) {
        0 => has_512_bits().then_some(512),
        bits => Some(bits),
    }
}

/// Variables that have to be set. width, cache: as they are; preferred: width where the user has set none; folder: for what runs keep.
fn changes(
    width: Option<OsString>,
    cache: Option<OsString>,
    preferred: Option<u32>,
    folder: Option<PathBuf>,
) -> Vec<(&'static str, OsString)> {
    let Some(chosen) = width.clone().or_else(|| preferred.map(|bits| bits.to_string().into())) else { return Vec::new() };
    let mut name = OsString::from("mesa-");
    name.push(&chosen);
    // without a folder of its own the width stays the driver's
    let Some(base) = cache.as_ref().map(PathBuf::from).or(folder) else { return Vec::new() };
    let mut changes = Vec::new();
    // programs that were started by one of us have it already
    if base.file_name() != Some(OsStr::new(&name)) {
        changes.push((CACHE, base.join(name).into_os_string()));
    }
    if width.is_none() {
        changes.push((WIDTH, chosen));
    }
    changes
}

/// Is lavapipe in this process already?
fn is_loaded() -> bool {
    std::fs::read_to_string("/proc/self/maps").is_ok_and(|maps| maps.contains("libvulkan_lvp"))
}

#[cfg(target_arch = "x86_64")]
fn has_512_bits() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512bw")
}

#[cfg(not(target_arch = "x86_64"))]
fn has_512_bits() -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(width: Option<&str>, cache: Option<&str>, preferred: Option<u32>) -> Vec<(&'static str, String)> {
        let all = changes(width.map(Into::into), cache.map(Into::into), preferred, Some("/home/.cache/skylit".into()));
        all.into_iter().map(|(name, value)| (name, value.into_string().unwrap())).collect()
    }

    #[test]
    fn each_width_has_a_cache_of_its_own() {
        let cache = |path: &str| (CACHE, path.to_owned());
        assert_eq!(of(None, None, Some(512)), [cache("/home/.cache/skylit/mesa-512"), (WIDTH, "512".to_owned())]);
        assert_eq!(of(None, Some("/c"), Some(256)), [cache("/c/mesa-256"), (WIDTH, "256".to_owned())]);
        // the driver's own choice
        assert_eq!(of(None, Some("/c"), None), []);
        // what the user has set stays
        assert_eq!(of(Some("128"), None, Some(512)), [cache("/home/.cache/skylit/mesa-128")]);
        // a program that one of us has started changes nothing
        assert_eq!(of(Some("512"), Some("/c/mesa-512"), Some(512)), []);
        assert!(changes(None, None, Some(512), None).is_empty());
    }
}
