//! What CPU drivers read from the environment, which has to be right before the first of them is loaded.

use std::ffi::{OsStr, OsString};
use std::path::PathBuf;

/// lavapipe's vectors are 256 bits wide unless told otherwise. With 512, where the CPU has them, the compute tracer is a quarter to
/// two fifths faster (docs/traversal.md).
const WIDTH: &str = "LP_NATIVE_VECTOR_WIDTH";
const CACHE: &str = "MESA_SHADER_CACHE_DIR";

/// Lets lavapipe use the CPU's widest vectors, unless the user has chosen. To be called first in `main`: it does nothing once there
/// is a second thread, or on other systems than Linux.
pub fn prefer_wide_vectors() {
    let chosen = std::env::var_os(WIDTH);
    if chosen.is_none() && !has_512_bits() || !is_single_threaded() {
        return;
    }
    // Mesa's own cache of compiled shaders does not tell widths apart, and code for one gives wrong results with another:
    // a width that is not the driver's own choice gets a folder of its own.
    let width = chosen.unwrap_or_else(|| OsString::from("512"));
    let Some(folder) = cache_folder(&width) else { return };
    for (name, value) in [(WIDTH, width), (CACHE, folder.into_os_string())] {
        // SAFETY: there is no other thread that could read the environment meanwhile
        unsafe { std::env::set_var(name, value) };
    }
}

fn cache_folder(width: &OsStr) -> Option<PathBuf> {
    let chosen = std::env::var_os(CACHE).map(PathBuf::from);
    let mut name = OsString::from("mesa-");
    name.push(width);
    chosen.or_else(crate::files::cache_folder).map(|f| f.join(name))
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

fn is_single_threaded() -> bool {
    std::fs::read_dir("/proc/self/task").is_ok_and(|tasks| tasks.count() == 1)
}
