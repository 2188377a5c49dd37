//! Transforms and vertices of a dynamic scene before the last update, in device memory: shaders
//! compute motion vectors from them. Static scenes have none.

use std::sync::Arc;

use super::transform::rows;
use crate::accel::flatten::{FlatScene, TlasInstance};
use crate::error::Result;
use crate::gpu::{Buffer, Device, Memory};
use crate::interface::records::scene::MotionRecord;

/// Transforms and vertices before the last update.
pub(super) struct PreviousFrame {
    records: Vec<MotionRecord>,
    buffer: Buffer,
    /// Previous vertices of each group that may deform.
    previous: Vec<Option<Buffer>>,
    /// TLAS instances that the last update moved, and groups that it deformed.
    moved: Vec<usize>,
    deformed: Vec<usize>,
}

impl PreviousFrame {
    /// The state before any update; `None` for a static scene.
    pub fn new(device: &Arc<Device>, flat: &FlatScene, positions: impl Fn(usize) -> u64) -> Result<Option<Self>> {
        if flat.motion.is_none() {
            return Ok(None);
        }
        let mut previous: Vec<Option<Buffer>> = flat.groups.iter().map(|_| None).collect();
        let deforming: Vec<usize> = flat.motion.meshes.iter().filter_map(|&m| flat.group_of_mesh(m)).collect();
        for &group in &deforming {
            previous[group] = Some(Buffer::new(device, "previous vertices", positions(group), Memory::Device)?);
        }
        let records: Vec<_> = flat
            .instances
            .iter()
            .map(|p| MotionRecord {
                previous_group_to_world: rows(&p.to_world),
                previous_positions: previous[p.group].as_ref().map_or(0, Buffer::address),
                reserved: 0,
            })
            .collect();
        let buffer = Buffer::from_slice(device, "motion records", &records)?;
        // the first update copies their vertices
        Ok(Some(Self { records, buffer, previous, moved: Vec::new(), deformed: deforming }))
    }

    /// Device address of the motion records.
    pub fn address(&self) -> u64 {
        self.buffer.address()
    }

    /// Makes the current state the previous one. To be called before an update that moves these
    /// instances and deforms these groups.
    pub fn begin<'a>(
        &mut self,
        instances: &[TlasInstance],
        positions: impl Fn(usize) -> &'a Buffer,
        moving: Vec<usize>,
        deforming: Vec<usize>,
    ) -> Result<()> {
        let (moved, deformed) =
            (std::mem::replace(&mut self.moved, moving), std::mem::replace(&mut self.deformed, deforming));
        let mut changed = false;
        for &k in moved.iter().chain(&self.moved) {
            self.records[k].previous_group_to_world = rows(&instances[k].to_world);
            changed = true;
        }
        if changed {
            self.buffer.write(0, bytemuck::cast_slice(&self.records))?;
        }
        let mut groups: Vec<usize> = deformed.iter().chain(&self.deformed).copied().collect();
        groups.sort_unstable();
        groups.dedup();
        for group in groups {
            if let Some(previous) = &mut self.previous[group] {
                previous.copy_from(positions(group))?;
            }
        }
        Ok(())
    }
}
