//! Environment variables of CPU drivers, set right before the Vulkan loader loads a driver.
//!
//! Mesa's lavapipe uses vectors of 256 bits unless `LP_NATIVE_VECTOR_WIDTH` sets another width.
//! With 512, where the CPU supports it, the compute tracer is a quarter to two fifths faster
//! (docs/design/tracers.md). So the first device that a process opens, in skylit itself, in a test
//! or in another program that uses this crate, sets the CPU's widest vectors, unless the user has
//! set a width.
//!
//! Mesa's shader cache does not distinguish widths, and code for one width gives wrong results with
//! another. So a width other than the driver's default has its own cache folder, and the file names
//! of the pipeline cache contain the width (`cache.rs`).

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Once, OnceLock};

use super::threads;
use crate::error::{Error, Result};

const WIDTH: &str = "LP_NATIVE_VECTOR_WIDTH";
const CACHE: &str = "MESA_SHADER_CACHE_DIR";
const NO_CACHE: &str = "MESA_SHADER_CACHE_DISABLE";
const WORKERS: &str = "LP_NUM_THREADS";
const BASE: &str = "XDG_CACHE_HOME";

/// Variables of Mesa's developers that are switches: with them nothing is rasterized, or the driver
/// crashes.
const SWITCHES: [&str; 2] = ["LP_NO_RAST", "GALLIUM_NOOP"];
/// The variable of Mesa's developers that, switched off, has vertices processed by an interpreter,
/// which Vulkan drivers have not.
const INTERPRETER: &str = "DRAW_USE_LLVM";
/// The variable of Mesa's developers that names parts of rasterization to leave out, such as
/// `no_depth`.
const LEFT_OUT: &str = "LP_PERF";
/// Values of switches that are off, as Mesa reads them.
const OFF: [&str; 7] = ["0", "n", "no", "f", "F", "false", "FALSE"];

/// Widths of vectors for which lavapipe computes what it should: with others it crashes, or half of
/// the pixels are wrong.
const WIDTHS: [&str; 3] = ["128", "256", "512"];

/// Preferred vector width in bits; 0 for the CPU's widest.
static PREFERRED: AtomicU32 = AtomicU32::new(0);

/// Sets the vector width of lavapipe in this process: 128, 256 or 512 bits in place of the CPU's
/// widest. Mesa can rasterize with at most 256. It has no effect if the user has set
/// `LP_NATIVE_VECTOR_WIDTH`, nor after a device has been opened or listed: a driver keeps the width
/// with which it was loaded.
pub fn prefer_vector_bits(bits: u32) {
    PREFERRED.store(bits, Ordering::Relaxed);
}

/// Checks the variables, and sets those that are missing once per process. To be called before the
/// Vulkan loader is opened.
///
/// std locks the environment for reads and writes by Rust code, but not for `getenv` in C code on
/// another thread. A program that has such threads must open its first device before they start, or
/// set these variables itself; then nothing is changed here.
///
/// # Errors
/// [`Error::Device`] for a variable that would make the driver crash or compute what is wrong,
/// [`Error::OutOfMemory`] if there is no room for a driver's threads.
pub(super) fn prepare() -> Result<()> {
    check(&|name| std::env::var_os(name).filter(|value| !value.is_empty()))?;
    let requested = || requested_workers(std::env::var_os(WORKERS));
    let workers = threads::driver_workers(requested()).ok_or_else(no_room)?;

    // variables are set once, before any driver is loaded
    static PREPARED: Once = Once::new();
    PREPARED.call_once(|| {
        // a driver that another part of the process has loaded keeps its width, and must keep its
        // cache
        if is_loaded() {
            return;
        }
        let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
        let (cache, folder) = (variable(CACHE), crate::files::cache_folder());
        let mut changes = changes(variable(WIDTH), cache.clone(), preferred_bits(), folder.clone());
        if changes.is_empty() {
            // the driver's own width, and its own cache, beside ours
            let is_lost = variable(BASE).is_some_and(|base| !Path::new(&base).is_absolute());
            changes.extend(default_cache(cache, folder.as_deref().and_then(Path::parent), is_lost));
        }
        if workers < threads::workers(requested()) {
            changes.push((WORKERS, workers.to_string().into()));
        }
        for (mut name, mut value) in changes {
            if name == CACHE {
                // older versions of Mesa create only the last folder of the path
                let folder = PathBuf::from(&value);
                let is_writable = std::fs::create_dir_all(&folder).is_ok()
                    && crate::files::check_writable(&folder.join("any")).is_ok();
                if !is_writable {
                    // Mesa would print a line and do the same
                    (name, value) = (NO_CACHE, "true".into());
                }
            }
            // SAFETY: std's lock excludes other Rust code, no driver that could read the
            // environment is loaded yet, and `prepare` documents what programs with C threads must
            // do
            unsafe { std::env::set_var(name, value) };
        }
    });

    // one that was loaded before starts as many threads as it did then
    if workers < threads::workers(requested()) { Err(no_room()) } else { Ok(()) }
}

fn no_room() -> Error {
    Error::OutOfMemory(
        "the system has no room for the threads of a Vulkan driver: raise the limit (`ulimit -u`, or that of the container), or end other programs"
            .into(),
    )
}

/// Refuses values with which a driver of the CPU crashes or computes what is wrong. `variable` has
/// those that are set.
fn check(variable: &dyn Fn(&str) -> Option<OsString>) -> Result<()> {
    let refuse = |name: &str, value: &OsStr, why: &str| {
        Err(Error::Device(format!("{name}={} {why}", value.to_string_lossy().replace(char::is_control, " "))))
    };
    if let Some(width) = variable(WIDTH).filter(|width| !WIDTHS.iter().any(|w| width == *w)) {
        let widths = WIDTHS.join(", ");
        return refuse(
            WIDTH,
            &width,
            &format!("is no width that the driver computes right with: set one of {widths}, or unset it"),
        );
    }
    for name in SWITCHES {
        if let Some(value) = variable(name).filter(|value| !OFF.iter().any(|off| value == *off)) {
            return refuse(name, &value, "makes the driver render nothing: unset it");
        }
    }
    if let Some(value) = variable(INTERPRETER).filter(|value| OFF.iter().any(|off| value == *off)) {
        return refuse(INTERPRETER, &value, "makes the driver crash: unset it");
    }
    match variable(LEFT_OUT).filter(|parts| parts.to_string_lossy().contains("no_depth")) {
        Some(parts) => refuse(LEFT_OUT, &parts, "makes the driver leave out the depth test: unset it"),
        None => Ok(()),
    }
}

/// The number of workers that the user asks for, as Mesa reads it; `None` for one for each
/// processor.
fn requested_workers(text: Option<OsString>) -> Option<usize> {
    let text = text?.into_string().ok()?;
    let number: i64 = text.trim().parse().ok()?;
    // Mesa takes a negative number for a large one
    Some(usize::try_from(number).unwrap_or(usize::MAX))
}

/// Returns the variable to set where the driver keeps its default width. `cache`: the folder that
/// the user has chosen for its cache; `base`: the folder of caches; `is_lost`: the driver would
/// take another one, relative to the current folder.
fn default_cache(cache: Option<OsString>, base: Option<&Path>, is_lost: bool) -> Option<(&'static str, OsString)> {
    let none = Some((NO_CACHE, "true".into()));
    match (cache, base) {
        (Some(cache), _) => {
            if can_hold_default_cache(Path::new(&cache)) {
                None
            } else {
                none
            }
        }
        (None, Some(base)) if !can_hold_default_cache(base) => none,
        (None, Some(base)) => is_lost.then(|| (CACHE, base.as_os_str().to_owned())),
        (None, None) => {
            if is_lost {
                none
            } else {
                None
            }
        }
    }
}

/// Whether Mesa can write its shader cache below a folder: it would print a line otherwise, for
/// either of the two folders that its versions use.
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

/// The variables to set. `width`, `cache`: current values of the two variables; `preferred`: the
/// width if the user has set none; `folder`: skylit's cache folder.
fn changes(
    width: Option<OsString>,
    cache: Option<OsString>,
    preferred: Option<u32>,
    folder: Option<PathBuf>,
) -> Vec<(&'static str, OsString)> {
    let Some(chosen) = width.clone().or_else(|| preferred.map(|bits| bits.to_string().into())) else {
        return Vec::new();
    };
    let mut name = OsString::from("mesa-");
    name.push(&chosen);
    // without a separate cache folder the driver's default width stays
    let Some(base) = cache.map(PathBuf::from).or(folder) else { return Vec::new() };
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

/// The limit of this process for the size of files (`ulimit -f`), bytes; `None` without one.
/// Lavapipe keeps device memory in a file without a name, and crashes where that cannot grow.
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
        let read_limit = |limit: &str| {
            let head = "Limit                     Soft Limit           Hard Limit           Units\nMax cpu time              5                    unlimited            seconds\n";
            file_size_limit_in(&format!(
                "{head}Max file size             {limit}                 unlimited            bytes\n"
            ))
        };
        assert_eq!((read_limit("8192"), read_limit("unlimited"), file_size_limit_in("")), (Some(8192), None, None));
    }

    fn changes_as_text(
        width: Option<&str>,
        cache: Option<&str>,
        preferred: Option<u32>,
    ) -> Vec<(&'static str, String)> {
        let all = changes(width.map(Into::into), cache.map(Into::into), preferred, Some("/home/.cache/skylit".into()));
        all.into_iter().map(|(name, value)| (name, value.into_string().unwrap())).collect()
    }

    #[test]
    fn each_width_has_a_cache_of_its_own() {
        let cache = |path: &str| (CACHE, path.to_owned());
        assert_eq!(
            changes_as_text(None, None, Some(512)),
            [cache("/home/.cache/skylit/mesa-512"), (WIDTH, "512".to_owned())]
        );
        assert_eq!(changes_as_text(None, Some("/c"), Some(256)), [cache("/c/mesa-256"), (WIDTH, "256".to_owned())]);
        // the driver's own choice
        assert_eq!(changes_as_text(None, Some("/c"), None), []);
        // what the user has set stays
        assert_eq!(changes_as_text(Some("128"), None, Some(512)), [cache("/home/.cache/skylit/mesa-128")]);
        // a program that one of us has started changes nothing
        assert_eq!(changes_as_text(Some("512"), Some("/c/mesa-512"), Some(512)), []);
        assert!(changes(None, None, Some(512), None).is_empty());
    }

    #[test]
    fn variables_that_compute_wrong_are_refused() {
        let with = |value: &str| check(&|name| (name == WIDTH).then(|| value.into()));
        assert!(["128", "256", "512"].iter().all(|width| with(width).is_ok()) && check(&|_| None).is_ok());
        for wrong in ["0", "7", "64", "1024", "-256", "256 ", "0x100", "wide", "4294967552"] {
            let error = with(wrong).unwrap_err();
            assert!(
                error.exit_code() == 2 && error.to_string().contains(&format!("{WIDTH}={wrong} is no width")),
                "{error}"
            );
        }
    }

    #[test]
    fn what_mesas_developers_switch_off_is_refused() {
        let with = |name: &'static str, value: &'static str| check(&move |asked| (asked == name).then(|| value.into()));
        for (name, value) in [
            ("LP_NO_RAST", "1"),
            ("LP_NO_RAST", "true"),
            ("GALLIUM_NOOP", "1"),
            ("LP_PERF", "texmem,no_depth"),
            ("DRAW_USE_LLVM", "0"),
        ] {
            let error = with(name, value).unwrap_err();
            assert!(
                error.exit_code() == 2 && error.to_string().starts_with(&format!("{name}={value} makes the driver")),
                "{error}"
            );
        }
        for (name, value) in
            [("LP_NO_RAST", "0"), ("GALLIUM_NOOP", "false"), ("LP_PERF", "no_mip_linear"), ("DRAW_USE_LLVM", "1")]
        {
            assert!(with(name, value).is_ok(), "{name}={value}");
        }
    }

    #[test]
    fn workers_are_read_as_mesa_does() {
        let read_workers = |text: &str| requested_workers(Some(text.into()));
        assert_eq!(
            [read_workers("3"), read_workers("0"), read_workers("-1"), read_workers("many"), requested_workers(None)],
            [Some(3), Some(0), Some(usize::MAX), None, None]
        );
    }

    #[test]
    fn a_driver_takes_no_cache_in_the_current_folder() {
        let dir = tempfile::tempdir().unwrap();
        let base = dir.path();
        assert_eq!(default_cache(None, Some(base), false), None);
        assert_eq!(default_cache(None, Some(base), true), Some((CACHE, base.into())));
        assert_eq!(default_cache(None, None, true), Some((NO_CACHE, "true".into())));
        assert_eq!(default_cache(None, None, false), None);
        assert_eq!(default_cache(Some(base.into()), None, true), None);
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
