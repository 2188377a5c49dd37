//! Conversion of Vulkan's result codes to errors.

use ash::vk;

use crate::error::Error;

/// The error for a failed call; `what` names the operation.
pub fn explain(what: &str, result: vk::Result) -> Error {
    match result {
        vk::Result::ERROR_OUT_OF_HOST_MEMORY => {
            Error::OutOfMemory(format!("the driver has no host memory left for {what}"))
        }
        vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => Error::OutOfMemory(format!(
            "no device memory left for {what}; use a smaller image or scene, or another --device"
        )),
        vk::Result::ERROR_DEVICE_LOST => {
            Error::DeviceLost(format!("{what} failed; the driver has reset it or crashed"))
        }
        vk::Result::ERROR_EXTENSION_NOT_PRESENT | vk::Result::ERROR_FEATURE_NOT_PRESENT => {
            Error::Device(format!("{what}: the driver lacks a feature that it listed ({result:?})"))
        }
        other => Error::Vulkan(format!("{what} failed: {other:?}")),
    }
}

/// `result.context("what")?` for ash calls.
pub trait Context<T> {
    /// Converts the error, naming the operation.
    fn context(self, what: &str) -> Result<T, Error>;
}

impl<T> Context<T> for Result<T, vk::Result> {
    fn context(self, what: &str) -> Result<T, Error> {
        self.map_err(|r| explain(what, r))
    }
}
