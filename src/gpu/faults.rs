//! Faults on demand, for tests (feature `probes`): a device that is lost, memory that runs out, a
//! driver without a feature. Environment variables ask for them:
//!
//! | variable | what happens |
//! |---|---|
//! | `SKYLIT_FAULT_DEVICE_LOST=N` | the process's submission N (from 1) fails with `VK_ERROR_DEVICE_LOST`, and so does what that device is given from then on |
//! | `SKYLIT_FAULT_DEVICE_LOST=N+` | the same, and every device that is opened later is lost at its first submission |
//! | `SKYLIT_FAULT_DEVICE_LOST=FILE` | as N, at the first submission once this file exists |
//! | `SKYLIT_FAULT_DEVICE_MEMORY=MIB` | allocations fail with `VK_ERROR_OUT_OF_DEVICE_MEMORY` once so much device memory is in use |
//! | `SKYLIT_FAULT_WITHOUT=NAME,NAME` | devices do not have these features and extensions, as `doctor` names them |
//!
//! Programs without the feature know none of them.

use std::path::PathBuf;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use ash::vk;

fn variable(name: &str) -> Option<String> {
    std::env::var(name).ok().filter(|value| !value.is_empty())
}

/// When a device is lost.
enum Loss {
    /// The device is lost at the submission of this number.
    At(u64),
    /// The device is lost at that one and at all later ones.
    From(u64),
    /// The device is lost once, when this file exists.
    When(PathBuf),
}

static LOSS: LazyLock<Option<Loss>> = LazyLock::new(|| {
    let text = variable("SKYLIT_FAULT_DEVICE_LOST")?;
    let number = |text: &str| text.parse().ok();
    let from = text.strip_suffix('+').and_then(number).map(Loss::From);
    Some(from.or(number(&text).map(Loss::At)).unwrap_or_else(|| Loss::When(text.into())))
});
static SUBMISSIONS: AtomicU64 = AtomicU64::new(0);

/// Counts a submission of the device whose state `is_lost` is.
///
/// # Errors
/// `VK_ERROR_DEVICE_LOST`, instead of submitting anything.
pub(super) fn submission(is_lost: &AtomicBool) -> Result<(), vk::Result> {
    static HAPPENED: AtomicBool = AtomicBool::new(false);
    let Some(loss) = &*LOSS else { return Ok(()) };
    let count = SUBMISSIONS.fetch_add(1, Ordering::Relaxed) + 1;
    let happens = match loss {
        Loss::At(number) => count == *number,
        Loss::From(number) => count >= *number,
        Loss::When(file) => file.exists() && !HAPPENED.swap(true, Ordering::Relaxed),
    };
    if happens {
        is_lost.store(true, Ordering::Relaxed);
    }
    if is_lost.load(Ordering::Relaxed) { Err(vk::Result::ERROR_DEVICE_LOST) } else { Ok(()) }
}

/// Device memory that may be in use, bytes.
static MEMORY: LazyLock<Option<u64>> = LazyLock::new(|| {
    let mib: u64 = variable("SKYLIT_FAULT_DEVICE_MEMORY")?.parse().ok()?;
    Some(mib << 20)
});

/// Whether `size` bytes more are too many beside `used`.
pub(super) fn is_out_of_memory(used: impl FnOnce() -> u64, size: u64) -> bool {
    MEMORY.is_some_and(|most| used() + size > most)
}

static WITHOUT: LazyLock<Vec<String>> =
    LazyLock::new(|| variable("SKYLIT_FAULT_WITHOUT").iter().flat_map(|t| t.split(',')).map(str::to_owned).collect());

/// Whether devices are to lack the feature or extension of this name.
pub(super) fn lacks(name: &str) -> bool {
    WITHOUT.iter().any(|n| n == name)
}
