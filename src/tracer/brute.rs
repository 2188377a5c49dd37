//! The compute tracer's data without a BVH (`shaders/trace/brute.glsl`): primitives group by group,
//! and for each instance the range of its primitives.

use std::sync::Arc;

use super::boxes::scene_bounds;
use super::hierarchy::{Hierarchy, record, unfinished_counter};
use super::kernel::Kernel;
use super::stream::LaunchMemory;
use super::upload::write_records;
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::gpu::Device;

/// Fails for a scene with more than [`Kernel::MAX_BRUTE_TESTS`] tests per ray.
pub(super) fn check(flat: &FlatScene) -> Result<()> {
    let tests = Kernel::brute_tests(flat);
    if tests <= Kernel::MAX_BRUTE_TESTS {
        return Ok(());
    }
    Err(Error::Scene(format!(
        "traversal 'brute' tests every primitive of every instance against every ray, at most {}; this scene has {tests}: use \
         another --traversal",
        Kernel::MAX_BRUTE_TESTS
    )))
}

/// Writes the lists. The scene must have passed [`check`].
pub(super) fn upload(device: &Arc<Device>, flat: &FlatScene) -> Result<Hierarchy> {
    let mut total = 0;
    let ranges: Vec<[u32; 2]> = flat
        .groups
        .iter()
        .map(|g| {
            let first = total;
            total += g.primitive_count as u32;
            [first, total]
        })
        .collect();
    let mut records = flat.groups.iter().flat_map(|g| (0..g.primitive_count as u32).map(move |p| record(flat, g, p)));
    let mut entries = flat.instances.iter().map(|p| ranges[p.group]);
    Ok(Hierarchy {
        kernel: Kernel::Brute,
        nodes: write_records(device, "instance ranges", flat.instances.len() as u64, &mut entries)?,
        primitives: Some(write_records(device, "primitives", u64::from(total), &mut records)?),
        root: flat.instances.len() as u32,
        instance_roots: flat.instances.iter().map(|p| ranges[p.group][0]).collect(),
        stack_entries: 0,
        bounds: scene_bounds(flat),
        unfinished: unfinished_counter(device)?,
        few: None,
        launch: LaunchMemory::new(device, None)?,
        dynamic: None,
        builder: None,
        areas: None,
    })
}
