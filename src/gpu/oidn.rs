//! Intel Open Image Denoise, loaded at run time where it is installed, so that skylit starts
//! without it. Versions 1.4 to 2 have the same functions, except for the names of two.

use std::ffi::{CStr, c_char, c_int, c_void};
use std::ptr::null;

use libloading::Library;

use crate::error::{Error, Result};

/// File names of the library, the newest first.
const NAMES: &[&str] = if cfg!(windows) {
    &["OpenImageDenoise.dll"]
} else if cfg!(target_os = "macos") {
    &["libOpenImageDenoise.dylib", "libOpenImageDenoise.2.dylib", "libOpenImageDenoise.1.dylib"]
} else {
    &["libOpenImageDenoise.so", "libOpenImageDenoise.so.2", "libOpenImageDenoise.so.1", "libOpenImageDenoise.so.0"]
};

// values of oidn.h
const DEVICE_TYPE_CPU: c_int = 1;
const FORMAT_FLOAT3: c_int = 3;
const ERROR_NONE: c_int = 0;
const ERROR_OUT_OF_MEMORY: c_int = 4;

type Handle = *mut c_void;

/// The functions of the library that are called, as oidn.h declares them.
struct Functions {
    new_device: unsafe extern "C" fn(c_int) -> Handle,
    commit_device: unsafe extern "C" fn(Handle),
    device_int: unsafe extern "C" fn(Handle, *const c_char) -> c_int,
    device_error: unsafe extern "C" fn(Handle, *mut *const c_char) -> c_int,
    release_device: unsafe extern "C" fn(Handle),
    new_filter: unsafe extern "C" fn(Handle, *const c_char) -> Handle,
    set_image: unsafe extern "C" fn(Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize),
    set_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    commit_filter: unsafe extern "C" fn(Handle),
    execute_filter: unsafe extern "C" fn(Handle),
    release_filter: unsafe extern "C" fn(Handle),
}

/// The library and its CPU device, which accesses host memory directly.
pub struct Oidn {
    functions: Functions,
    device: Handle,
    version: String,
    // dropped last: the functions above are in it
    _library: Library,
}

impl Oidn {
    /// Loads the library and starts its device.
    ///
    /// # Errors
    /// [`Error::Device`] if the library is not installed or does not support this CPU.
    pub fn open() -> Result<Self> {
        let missing =
            |why: String| Error::Device(format!("Open Image Denoise: {why}; install it, or use --denoise filter"));
        // SAFETY: the library's initialisation has no requirements of its own
        let library = NAMES.iter().find_map(|name| unsafe { Library::new(name) }.ok());
        let library = library.ok_or_else(|| missing(format!("{} was not found", NAMES[0])))?;
        let functions = functions(&library).map_err(|e| missing(format!("the library lacks a function ({e})")))?;
        // SAFETY: no requirements
        let device = unsafe { (functions.new_device)(DEVICE_TYPE_CPU) };
        if device.is_null() {
            return Err(missing("it does not run on this CPU".into()));
        }
        let mut oidn = Self { functions, device, version: String::new(), _library: library };
        // SAFETY: the device exists
        unsafe { (oidn.functions.commit_device)(device) };
        oidn.check()?;
        // SAFETY: the device exists, and the name ends with 0
        let version = unsafe { (oidn.functions.device_int)(device, c"version".as_ptr()) };
        oidn.version = format!("{}.{}.{}", version / 10_000, version / 100 % 100, version % 100);
        Ok(oidn)
    }

    /// Version of the library, such as "2.3.0".
    pub fn version(&self) -> &str {
        &self.version
    }

    /// Denoises an image of `size` pixels. All planes have three floats per pixel, rows from the
    /// top: `color` is linear radiance, `albedo` linear in [0, 1], `normal` a world-space vector of
    /// length at most 1. The two auxiliary planes may be noisy.
    ///
    /// # Errors
    /// [`Error::Usage`] for planes of other sizes, [`Error::OutOfMemory`], and [`Error::Device`]
    /// with the library's message.
    pub fn denoise(&self, size: [u32; 2], color: &[f32], albedo: &[f32], normal: &[f32]) -> Result<Vec<f32>> {
        let [width, height] = size.map(|n| n as usize);
        let images = [(c"color", color), (c"albedo", albedo), (c"normal", normal)];
        if images.iter().any(|(_, plane)| plane.len() != 3 * width * height) {
            return Err(Error::Usage(format!(
                "the image to denoise and its auxiliary images must have {width}x{height} pixels"
            )));
        }
        let (f, mut out) = (&self.functions, vec![0.0f32; 3 * width * height]);
        // SAFETY: device and filter exist; names end with 0; every plane has 3 * width * height
        // floats and outlives the filter, and the library writes to none but the output
        unsafe {
            let filter = (f.new_filter)(self.device, c"RT".as_ptr());
            if filter.is_null() {
                self.check()?;
                return Err(Error::Device("Open Image Denoise: it has no filter for ray-traced images".into()));
            }
            let set = |name: &CStr, data: *mut f32| {
                (f.set_image)(filter, name.as_ptr(), data.cast(), FORMAT_FLOAT3, width, height, 0, 0, 0);
            };
            for (name, plane) in images {
                set(name, plane.as_ptr().cast_mut());
            }
            set(c"output", out.as_mut_ptr());
            (f.set_bool)(filter, c"hdr".as_ptr(), true);
            // albedo and normal have the noise of the camera rays' antialiasing
            (f.set_bool)(filter, c"cleanAux".as_ptr(), false);
            (f.commit_filter)(filter);
            (f.execute_filter)(filter);
            (f.release_filter)(filter);
        }
        self.check()?;
        Ok(out)
    }

    /// Fails with the first error since the last call.
    fn check(&self) -> Result<()> {
        let mut message = null();
        // SAFETY: the device exists, and the library writes a pointer
        let code = unsafe { (self.functions.device_error)(self.device, &raw mut message) };
        if code == ERROR_NONE {
            return Ok(());
        }
        let text = if message.is_null() {
            format!("error {code}")
        } else {
            // SAFETY: the library's string stays valid until the next call
            unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned()
        };
        Err(match code {
            ERROR_OUT_OF_MEMORY => Error::OutOfMemory(format!("Open Image Denoise: {text}; render a smaller image")),
            _ => Error::Device(format!("Open Image Denoise: {text}; use --denoise filter")),
        })
    }
}

impl Drop for Oidn {
    fn drop(&mut self) {
        // SAFETY: nothing uses it any more
        unsafe { (self.functions.release_device)(self.device) };
    }
}

/// Looks up all functions.
fn functions(library: &Library) -> Result<Functions, libloading::Error> {
    // SAFETY: the types are those of oidn.h, the same in all versions from 1.4 on
    unsafe {
        Ok(Functions {
            new_device: *library.get(b"oidnNewDevice\0")?,
            commit_device: *library.get(b"oidnCommitDevice\0")?,
            // version 2 has new names for these
            device_int: *library.get(b"oidnGetDeviceInt\0").or_else(|_| library.get(b"oidnGetDevice1i\0"))?,
            device_error: *library.get(b"oidnGetDeviceError\0")?,
            release_device: *library.get(b"oidnReleaseDevice\0")?,
            new_filter: *library.get(b"oidnNewFilter\0")?,
            set_image: *library.get(b"oidnSetSharedFilterImage\0")?,
            set_bool: *library.get(b"oidnSetFilterBool\0").or_else(|_| library.get(b"oidnSetFilter1b\0"))?,
            commit_filter: *library.get(b"oidnCommitFilter\0")?,
            execute_filter: *library.get(b"oidnExecuteFilter\0")?,
            release_filter: *library.get(b"oidnReleaseFilter\0")?,
        })
    }
}
