//! Debian's and Ubuntu's libshaderc_combined.a leaves glslang and SPIRV-Tools out, and their libraries differ from version to version: glslang 14 (Ubuntu
//! 24.04, Debian 13) has no OGLCompiler and no HLSL any more. Those that are beside shaderc are linked. (The shared libshaderc.so of Debian 12 leaves them
//! out, too, and cannot be linked at all.)

use std::path::{Path, PathBuf};

/// In the order of their dependencies.
const LIBRARIES: [&str; 9] = [
    "glslang",
    "SPIRV",
    "MachineIndependent",
    "GenericCodeGen",
    "OSDependent",
    "OGLCompiler",
    "HLSL",
    "SPIRV-Tools-opt",
    "SPIRV-Tools",
];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed=SHADERC_LIB_DIR");
    if cfg!(feature = "build-shaderc") {
        return;
    }
    // where shaderc-sys looks
    let folder = std::env::var_os("SHADERC_LIB_DIR").map_or_else(multiarch, PathBuf::from);
    println!("cargo:rustc-link-search=native={}", folder.display());
    let is_there = |library: &str| ["a", "so"].iter().any(|end| folder.join(format!("lib{library}.{end}")).exists());
    for library in LIBRARIES.into_iter().filter(|l| is_there(l)) {
        println!("cargo:rustc-link-lib={library}");
    }
    println!("cargo:rustc-link-lib=stdc++");
}

fn multiarch() -> PathBuf {
    let architecture = std::env::var("CARGO_CFG_TARGET_ARCH").expect("cargo sets it");
    Path::new("/usr/lib").join(format!("{architecture}-linux-gnu"))
}
