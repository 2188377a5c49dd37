//! What the programs of `fuzz_targets` share: libFuzzer's entry points for a function of [`targets`].

pub mod targets;

#[doc(hidden)]
pub use libfuzzer_sys;

use std::path::Path;
use std::sync::OnceLock;

/// The folder of this process, which its target writes its file to again and again. It is in `TMPDIR`.
pub fn folder() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    FOLDER.get_or_init(|| tempfile::tempdir().expect("a folder for temporary files")).path()
}

/// Ends the process for panics that leave a target alone: one in a decoder that the program makes an error of is no finding, and libFuzzer's own hook would end the process at
/// once. Called when libFuzzer has set its own.
pub fn keep_caught_panics() {
    std::panic::set_hook(Box::new(|info| eprintln!("{info}")));
}

/// The program of a target: `fuzz!(gltf);`.
#[macro_export]
macro_rules! fuzz {
    ($target:ident) => {
        $crate::libfuzzer_sys::fuzz_target!(
            init: $crate::keep_caught_panics(),
            |data: &[u8]| {
                $crate::targets::$target($crate::folder(), data);
            }
        );
    };
}
