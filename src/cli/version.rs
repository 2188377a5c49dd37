//! `skylit --version`: the commit, the features that were compiled in, and the Vulkan devices of
//! the machine.

use crate::error::Result;
use crate::gpu::{DeviceInfo, Instance, enumerate};

/// Name and version in one line, as `-V` prints it.
fn short() -> String {
    format!("skylit {}", env!("CARGO_PKG_VERSION"))
}

/// Returns the text of `--version`, which has all that a bug report needs.
pub fn long() -> String {
    let lines =
        [("commit", env!("SKYLIT_BUILD_COMMIT").to_owned()), ("features", env!("SKYLIT_BUILD_FEATURES").to_owned())];
    let lines = lines.into_iter().chain(vulkan().into_iter().map(|line| ("vulkan", line)));
    std::iter::once(short() + "\n").chain(lines.map(|(key, value)| format!("{key:8}  {value}\n"))).collect()
}

/// A line for each device, or why there is none.
fn vulkan() -> Vec<String> {
    match devices() {
        Ok(devices) if devices.is_empty() => {
            vec!["no device found: install a Vulkan driver (see `skylit doctor`)".into()]
        }
        Ok(devices) => devices.iter().map(device).collect(),
        Err(e) => vec![format!("not available: {e}")],
    }
}

fn devices() -> Result<Vec<DeviceInfo>> {
    let instance = Instance::new(false)?;
    enumerate(&instance)
}

fn device(d: &DeviceInfo) -> String {
    let lacks = match d.missing_floor.as_slice() {
        [] => String::new(),
        missing => format!("; skylit cannot use it: it lacks {}", missing.join(", ")),
    };
    format!("device {}: {} ({}), {}, Vulkan {}{lacks}", d.index, d.name, d.kind, d.driver, d.api_version)
}
