//! Links what a distribution's static shaderc leaves out; `use shaderc_libraries as _` is all there is to do. build.rs says what that is.
#![no_std]
