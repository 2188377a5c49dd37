//! Environment variables of CPU drivers, set right before the Vulkan loader loads a driver.
//!
//! Mesa's lavapipe uses vectors of 256 bits unless `LP_NATIVE_VECTOR_WIDTH` sets another width. With 512, where the CPU supports it, the compute tracer is a quarter to
//! two fifths faster (docs/traversal.md). So the first device that a process opens, in skylit itself, in a test or in another program that uses this crate, sets
//! the CPU's widest vectors, unless the user has set a width.
//!
//! Mesa's shader cache does not distinguish widths, and code for one width gives wrong results with another. So a width other than the driver's default
//! has its own cache folder, and the file names of the pipeline cache contain the width (`cache.rs`).

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Once, OnceLock};

const WIDTH: &str = "LP_NATIVE_VECTOR_WIDTH";
const CACHE: &str = "MESA_SHADER_CACHE_DIR";
const NO_CACHE: &str = "MESA_SHADER_CACHE_DISABLE";

/// Preferred vector width in bits; 0 for the CPU's widest.
static PREFERRED: AtomicU32 = AtomicU32::new(0);

/// Sets the vector width of lavapipe in this process: 128, 256 or 512 bits in place of the CPU's widest. Mesa can rasterize with at most 256. It has no
/// effect if the user has set `LP_NATIVE_VECTOR_WIDTH`, nor after a device has been opened or listed: a driver keeps the width with which it was loaded.
pub fn prefer_vector_bits(bits: u32) {
    PREFERRED.store(bits, Ordering::Relaxed);
}

/// Sets the variables, once per process. To be called before the Vulkan loader is opened.
///
/// std locks the environment for reads and writes by Rust code, but not for `getenv` in C code on another thread. A program that has such threads must open
/// its first device before they start, or set both variables itself; then nothing is changed here.
pub(super) fn prepare() {
    static PREPARED: Once = Once::new();
    PREPARED.call_once(|| {
        // a driver that another part of the process has loaded keeps its width, and must keep its cache
        if is_loaded() {
            return;
        }
        let (cache, folder) = (std::env::var_os(CACHE), crate::files::cache_folder());
        let mut changes = changes(std::env::var_os(WIDTH), cache.clone(), preferred_bits(), folder.clone());
        if changes.is_empty() {
            // the driver's own width, and its own cache, beside ours
            let base = cache.map(PathBuf::from).or_else(|| folder.and_then(|f| f.parent().map(Path::to_path_buf)));
            if base.is_some_and(|base| !can_hold_default_cache(&base)) {
                changes.push((NO_CACHE, "true".into()));
            }
        }
        for (mut name, mut value) in changes {
            if name == CACHE {
                // older versions of Mesa create only the last folder of the path
                let folder = PathBuf::from(&value);
                let is_writable =
                    std::fs::create_dir_all(&folder).is_ok() && crate::files::check_writable(&folder.join("any")).is_ok();
                if !is_writable {
                    // Mesa would print a line and do the same
                    (name, value) = (NO_CACHE, "true".into());
                }
            }
            // SAFETY: std's lock excludes other Rust code, no driver that could read the environment is loaded yet, and `prepare` documents what programs with
            // C threads must do
            unsafe { std::env::set_var(name, value) };
        }
    });
}

/// Whether Mesa can write its shader cache below a folder: it would print a line otherwise, for either of the two folders that its versions use.
fn can_hold_default_cache(base: &Path) -> bool {
    let is_writable = |name: &str| {
        let folder = base.join(name);
        crate::files::check_writable(&if folder.is_dir() { folder.join("any") } else { base.join("any") }).is_ok()
    };
    std::fs::create_dir_all(base).is_ok() && ["mesa_shader_cache", "mesa_shader_cache_db"].into_iter().all(is_writable)
}

/// The vector width to request if the user has set none; `None` for the driver's default.
fn preferred_bits() -> Option<u32> {
    match PREFERRED.load(Ordering::Relaxed) {
        0 => has_512_bits().then_some(512),
        bits => Some(bits),
    }
}

/// The variables to set. `width`, `cache`: current values of the two variables; `preferred`: the width if the user has set none; `folder`: skylit's cache folder.
fn changes(
    width: Option<OsString>,
    cache: Option<OsString>,
    preferred: Option<u32>,
    folder: Option<PathBuf>,
) -> Vec<(&'static str, OsString)> {
    let Some(chosen) = width.clone().or_else(|| preferred.map(|bits| bits.to_string().into())) else { return Vec::new() };
    let mut name = OsString::from("mesa-");
    name.push(&chosen);
    // without a separate cache folder the driver's default width stays
    let Some(base) = cache.as_ref().map(PathBuf::from).or(folder) else { return Vec::new() };
    let mut changes = Vec::new();
    // a child process of skylit inherits the variable
    if base.file_name() != Some(OsStr::new(&name)) {
        changes.push((CACHE, base.join(name).into_os_string()));
    }
    if width.is_none() {
        changes.push((WIDTH, chosen));
    }
    changes
}

/// Whether lavapipe is loaded in this process already.
fn is_loaded() -> bool {
    std::fs::read_to_string("/proc/self/maps").is_ok_and(|maps| maps.contains("libvulkan_lvp"))
}

/// The limit of this process for the size of files (`ulimit -f`), bytes; `None` without one. Lavapipe keeps device memory in a file without a name, and crashes where that cannot grow.
pub(super) fn file_size_limit() -> Option<u64> {
    static LIMIT: OnceLock<Option<u64>> = OnceLock::new();
    *LIMIT.get_or_init(|| file_size_limit_in(&std::fs::read_to_string("/proc/self/limits").ok()?))
}

/// Reads the limit that is in force from the text of `/proc/self/limits`.
fn file_size_limit_in(limits: &str) -> Option<u64> {
    limits
        .lines()
        .find_map(|line| line.strip_prefix("Max file size"))
        .and_then(|line| line.split_whitespace().next()?.parse().ok())
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

    #[test]
    fn the_limit_for_files_is_read() {
        let of = |limit: &str| {
            let head = "Limit                     Soft Limit           Hard Limit           Units\nMax cpu time              5                    unlimited            seconds\n";
            file_size_limit_in(&format!("{head}Max file size             {limit}                 unlimited            bytes\n"))
        };
        assert_eq!((of("8192"), of("unlimited"), file_size_limit_in("")), (Some(8192), None, None));
    }

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

    #[test]
    fn a_cache_that_cannot_be_written_is_known() {
        let dir = tempfile::tempdir().unwrap();
        assert!(can_hold_default_cache(&dir.path().join("missing/.cache")));
        // files where folders should be, of the cache itself and of what is above it
        std::fs::write(dir.path().join("file"), "").unwrap();
        assert!(!can_hold_default_cache(&dir.path().join("file")));
        assert!(!can_hold_default_cache(&dir.path().join("file/.cache")));
        // what is there already is asked itself
        std::fs::create_dir(dir.path().join("mesa_shader_cache_db")).unwrap();
        assert!(can_hold_default_cache(dir.path()));
        assert_eq!(std::fs::read_dir(dir.path().join("mesa_shader_cache_db")).unwrap().count(), 0);
    }
}
