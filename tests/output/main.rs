//! Files that are written: images and animations come back as they were, and a failed write leaves nothing behind.

mod animations;
mod camera_numbers;
mod exr_files;
mod images;
mod length;
mod pictures;
mod plan;
mod settings;

/// How many files a folder has.
fn files_in(folder: &std::path::Path) -> usize {
    std::fs::read_dir(folder).unwrap().count()
}
