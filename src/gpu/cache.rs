//! The pipeline cache on disk: one file per device and driver version, replaced atomically, and
//! ignored when it is another device's.

use std::io::Write;
use std::path::PathBuf;

use super::info::DeviceInfo;
use crate::files;

fn file(info: &DeviceInfo) -> Option<PathBuf> {
    let uuid: String = info.pipeline_cache_uuid.iter().map(|b| format!("{b:02x}")).collect();
    files::cache_folder().map(|f| {
        // Vulkan's device identity does not include a CPU driver's vector width; the subgroup size
        // is that width over 32 bits
        let lanes = info.limits.subgroup_size;
        f.join(format!(
            "pipelines-{:04x}-{:04x}-{:08x}-{lanes}-{uuid}.bin",
            info.vendor_id, info.device_id, info.driver_version
        ))
    })
}

/// Whether the data begins with a VkPipelineCacheHeaderVersionOne of this device.
fn fits(info: &DeviceInfo, data: &[u8]) -> bool {
    let word = |k: usize| data.get(4 * k..4 * k + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    word(0).is_some_and(|n| n >= 32)
        && word(1) == Some(1)
        && word(2) == Some(info.vendor_id)
        && word(3) == Some(info.device_id)
        && data.get(16..32) == Some(&info.pipeline_cache_uuid[..])
}

/// The cache data that an earlier run stored for this device and driver; empty if there is none.
pub fn load(info: &DeviceInfo) -> Vec<u8> {
    file(info).and_then(|f| std::fs::read(f).ok()).filter(|d| fits(info, d)).unwrap_or_default()
}

/// Stores the cache. A failure is ignored: it only costs the next run time.
pub fn store(info: &DeviceInfo, data: &[u8]) {
    let Some(path) = file(info) else { return };
    if !fits(info, data) || std::fs::read(&path).is_ok_and(|old| old == data) {
        return;
    }
    let Some(folder) = path.parent() else { return };
    // no warning: without a writable folder there is no cache
    let write = || files::write_atomically(&path, |file| file.write_all(data));
    if std::fs::create_dir_all(folder).is_ok() {
        let _ = write();
    }
}
