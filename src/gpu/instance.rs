//! The Vulkan loader and instance, with the validation layer as an option.

use std::ffi::{CStr, c_char, c_void};
use std::sync::{Arc, Mutex};

use ash::{ext, khr, vk};

use super::result::Context;
use crate::error::{Error, Result};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// The loader of this system.
const LOADER: Loader = if cfg!(windows) {
    Loader {
        file: "vulkan-1.dll",
        install: "install the driver of your graphics card, which brings it",
        renew: "install a newer driver of your graphics card",
    }
} else if cfg!(target_os = "macos") {
    Loader {
        file: "libvulkan.dylib",
        install: "install the Vulkan SDK, which has MoltenVK",
        renew: "install a newer Vulkan SDK",
    }
} else {
    Loader {
        file: "libvulkan.so.1",
        install: "run ./scripts/setup.sh or install libvulkan1",
        renew: "install a newer libvulkan1",
    }
};

/// The Vulkan loader of a system.
struct Loader {
    file: &'static str,
    /// The remedy where there is none, and where it is too old.
    install: &'static str,
    renew: &'static str,
}

/// Messages of the validation layer, kept so that one of them can fail a run.
#[derive(Default)]
pub(super) struct ValidationLog(Mutex<Vec<String>>);

impl ValidationLog {
    fn push(&self, message: String) {
        if let Ok(mut log) = self.0.lock() {
            log.push(message);
        }
    }

    pub(super) fn take(&self) -> Vec<String> {
        self.0.lock().map(|mut log| std::mem::take(&mut *log)).unwrap_or_default()
    }
}

/// A Vulkan instance.
pub struct Instance {
    pub(super) raw: ash::Instance,
    pub(super) validation: Option<Arc<ValidationLog>>,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    pub(super) debug_names: bool,
    // dropped last, because that unloads the library
    #[cfg_attr(
        not(feature = "viewer"),
        allow(dead_code, reason = "it is kept loaded; only surfaces of windows use it")
    )]
    pub(super) entry: ash::Entry,
}

impl Instance {
    /// Loads Vulkan. With `validation`, every message of VK_LAYER_KHRONOS_validation is kept and
    /// can fail the run.
    ///
    /// The first instance of a process sets environment variables that Mesa's CPU driver reads
    /// ([`super::environment`]): a program with threads in which C code reads the environment must
    /// create it before they start.
    ///
    /// # Errors
    /// [`Error::Device`] without a loader, without a driver for Vulkan 1.3, or without the
    /// requested validation layer.
    pub fn new(validation: bool) -> Result<Arc<Self>> {
        Self::with_extensions(validation, &[])
    }

    /// As [`Instance::new`], with extensions, which the loader must have: names that end with NUL
    /// and live forever.
    ///
    /// # Errors
    /// As [`Instance::new`].
    pub(super) fn with_extensions(validation: bool, required: &[*const c_char]) -> Result<Arc<Self>> {
        super::environment::prepare()?;
        if let Some(error) = super::manifests::deadly() {
            return Err(error);
        }

        // SAFETY: the loader's own initialisation code runs, as in every Vulkan program
        let entry = unsafe { ash::Entry::load() }.map_err(|e| {
            Error::Device(format!("no Vulkan loader ({}) on this machine: {} ({e})", LOADER.file, LOADER.install))
        })?;

        // the loader may be older than the version that skylit needs
        // SAFETY: no preconditions
        let version = unsafe { entry.try_enumerate_instance_version() }
            .map_err(|r| explain_loader("querying the Vulkan version", r))?
            .unwrap_or(vk::API_VERSION_1_0);
        if version < vk::API_VERSION_1_3 {
            return Err(Error::Device(format!(
                "the Vulkan loader is for version {}.{}, skylit needs 1.3: {}",
                vk::api_version_major(version),
                vk::api_version_minor(version),
                LOADER.renew
            )));
        }

        // the layer and extensions that diagnostics need
        // SAFETY: no preconditions
        let layers = unsafe { entry.enumerate_instance_layer_properties() }
            .map_err(|r| explain_loader("listing Vulkan layers", r))?;
        if validation && !layers.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION_LAYER)) {
            return Err(Error::Device(
                "--validation needs VK_LAYER_KHRONOS_validation, which is not installed: install vulkan-validationlayers"
                    .into(),
            ));
        }
        // SAFETY: no preconditions
        let extensions = unsafe { entry.enumerate_instance_extension_properties(None) }
            .map_err(|r| explain_loader("listing Vulkan extensions", r))?;
        let debug_names =
            validation || extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(ext::debug_utils::NAME));

        let application = vk::ApplicationInfo::default()
            .application_name(c"skylit")
            .application_version(vk::make_api_version(0, 0, 1, 0))
            .api_version(vk::API_VERSION_1_3);
        let layer_names = if validation { vec![VALIDATION_LAYER.as_ptr()] } else { vec![] };
        let mut extension_names = required.to_vec();
        if debug_names {
            extension_names.push(ext::debug_utils::NAME.as_ptr());
        }
        let log = validation.then(|| Arc::new(ValidationLog::default()));
        let mut create_messenger = log.as_ref().map(messenger_info);
        // drivers over another API, as MoltenVK is, are listed for those that know of them only
        let lists_portable =
            extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(khr::portability_enumeration::NAME));
        if lists_portable {
            extension_names.push(khr::portability_enumeration::NAME.as_ptr());
        }
        let listed = vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
        let mut info = vk::InstanceCreateInfo::default()
            .flags(if lists_portable { listed } else { vk::InstanceCreateFlags::empty() })
            .application_info(&application)
            .enabled_layer_names(&layer_names)
            .enabled_extension_names(&extension_names);
        if let Some(m) = create_messenger.as_mut() {
            // also reports messages of vkCreateInstance and vkDestroyInstance
            info = info.push_next(m);
        }
        // SAFETY: all pointers in `info` outlive the call
        let raw = unsafe { entry.create_instance(&info, None) }
            .map_err(|r| explain_loader("creating the Vulkan instance", r))?;

        // messages of the validation layer go to a log
        let messenger = match &log {
            Some(log) => {
                let utils = ext::debug_utils::Instance::new(&entry, &raw);
                // SAFETY: the log is kept alive by Self, which destroys the messenger first
                let messenger = unsafe { utils.create_debug_utils_messenger(&messenger_info(log), None) }
                    .context("creating the debug messenger")?;
                Some((utils, messenger))
            }
            None => None,
        };
        Ok(Arc::new(Self { raw, validation: log, messenger, debug_names, entry }))
    }
}

/// The error for a call of the loader that failed. A broken manifest of a driver or layer is
/// reported as if memory had run out, so manifests are looked at before that is believed.
fn explain_loader(what: &str, result: vk::Result) -> Error {
    use vk::Result as R;
    let may_be_manifest =
        [R::ERROR_OUT_OF_HOST_MEMORY, R::ERROR_INITIALIZATION_FAILED, R::ERROR_INCOMPATIBLE_DRIVER].contains(&result);
    let broken = if may_be_manifest { super::manifests::broken() } else { None };
    broken.unwrap_or_else(|| match result {
        R::ERROR_INCOMPATIBLE_DRIVER => super::manifests::unusable().unwrap_or_else(no_driver),
        _ => super::result::explain(what, result),
    })
}

pub(super) fn no_driver() -> Error {
    Error::Device("no Vulkan device on this machine: install a driver (./scripts/setup.sh installs Mesa's lavapipe, which runs on the CPU)".into())
}

fn messenger_info(log: &Arc<ValidationLog>) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    use vk::{DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Type};
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(Severity::WARNING | Severity::ERROR)
        .message_type(Type::VALIDATION | Type::PERFORMANCE)
        .pfn_user_callback(Some(on_message))
        .user_data(Arc::as_ptr(log) as *mut c_void)
}

/// # Safety
/// `user` points to the [`ValidationLog`] of a living [`Instance`], `data` to a message, as Vulkan
/// promises.
unsafe extern "system" fn on_message(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _types: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: see above
    let (data, log) = unsafe { (&*data, &*(user as *const ValidationLog)) };
    // SAFETY: Vulkan's strings end with NUL
    let message = unsafe { data.message_as_c_str() }.map(|m| m.to_string_lossy().into_owned()).unwrap_or_default();
    log.push(format!("{severity:?}: {message}"));
    vk::FALSE
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: devices hold an Arc of the instance, so they are gone
        unsafe {
            if let Some((utils, messenger)) = &self.messenger {
                utils.destroy_debug_utils_messenger(*messenger, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}
