//! What the hardware tracers traverse: one bottom level per group, one top level.

use std::sync::Arc;

use super::gpu_scene::{GpuScene, rows};
use crate::error::Result;
use crate::gpu::{AccelerationStructure, BottomLevelInput, Buffer, Commands, Device, Memory, TopLevelEntry};
use crate::scene::flatten::{FlatScene, Group};

// hit groups of the pipeline: see gpu::RayTracingPipeline
const OPAQUE_TRIANGLES: u32 = 0;
const ALPHA_TRIANGLES: u32 = 1;
const SPHERES: u32 = 2;

/// All levels of a scene.
pub(super) struct Structures {
    bottom: Vec<AccelerationStructure>,
    top: AccelerationStructure,
}

impl Structures {
    pub fn build(device: &Arc<Device>, flat: &FlatScene, scene: &GpuScene) -> Result<Self> {
        let mut commands = Commands::new(device)?;
        let mut bottom = Vec::with_capacity(flat.groups.len());
        for (group, buffers) in flat.groups.iter().zip(&scene.groups) {
            let boxes;
            let input = match &buffers.indices {
                Some(indices) => BottomLevelInput::Triangles {
                    positions: &buffers.positions,
                    vertex_count: group.vertex_count as u32,
                    indices,
                    opaque: group.opaque_count as u32,
                    alpha_tested: (group.primitive_count - group.opaque_count) as u32,
                },
                None => {
                    boxes = sphere_boxes(device, flat, group)?;
                    BottomLevelInput::Boxes { boxes: &boxes, count: group.primitive_count as u32 }
                }
            };
            bottom.push(AccelerationStructure::bottom_level(device, &mut commands, "bottom level", &input)?);
        }
        let entries: Vec<_> = flat
            .placements
            .iter()
            .enumerate()
            .map(|(k, p)| {
                let group = &flat.groups[p.group];
                let hit_group = match group {
                    g if g.spheres => SPHERES,
                    g if g.opaque_count == 0 => ALPHA_TRIANGLES,
                    _ => OPAQUE_TRIANGLES,
                };
                let mut transform = [0.0; 12];
                transform.copy_from_slice(rows(&p.to_world).as_flattened());
                TopLevelEntry { transform, index: k as u32, hit_group, bottom_level: bottom[p.group].address() }
            })
            .collect();
        let top = AccelerationStructure::top_level(device, &mut commands, &entries)?;
        Ok(Self { bottom, top })
    }

    pub fn address(&self) -> u64 {
        self.top.address()
    }

    pub fn bytes(&self) -> u64 {
        self.top.size() + self.bottom.iter().map(AccelerationStructure::size).sum::<u64>()
    }
}

fn sphere_boxes(device: &Arc<Device>, flat: &FlatScene, group: &Group) -> Result<Buffer> {
    let size = 24 * group.primitive_count as u64;
    let mut buffer = Buffer::new(device, "sphere boxes", size, Memory::Device)?;
    buffer.fill(size, 24, |first, bytes| {
        for (k, out) in bytes.chunks_exact_mut(24).enumerate() {
            let primitive = first as usize + k;
            let b = flat.primitive_bounds(group, flat.part_of(group, primitive), primitive);
            out.copy_from_slice(bytemuck::cast_slice(&[b.min.to_array(), b.max.to_array()]));
        }
    })?;
    Ok(buffer)
}
