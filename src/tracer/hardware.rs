//! The acceleration structures of the hardware tracers: one bottom level per group, and one top
//! level.

use std::sync::Arc;
use std::time::Instant;

use super::gpu_scene::GpuScene;
use super::group_buffers::GroupBuffers;
use super::transform::rows;
use crate::accel::RefitPolicy;
use crate::accel::flatten::{BlasGroup, FlatScene, TlasInstance};
use crate::error::{Error, Result};
use crate::gpu::{
    AccelerationStructure, AccelerationStructureInstance, BottomLevelInput, Buffer, Commands, Device, Memory, Update,
};

// hit groups of the pipeline: see gpu::RayTracingPipeline
const OPAQUE_TRIANGLES: u32 = 0;
const ALPHA_TRIANGLES: u32 = 1;
const SPHERES: u32 = 2;

/// The acceleration structures of a scene.
pub(super) struct Structures {
    bottom: Vec<AccelerationStructure>,
    top: AccelerationStructure,
    /// State of a dynamic scene; `None` for a static one.
    changing: Option<Changing>,
}

/// Inputs for rebuilding and refitting in a dynamic scene.
struct Changing {
    entries: Vec<AccelerationStructureInstance>,
    deforming: Vec<Option<Deforming>>,
}

/// A bottom level whose mesh deforms.
struct Deforming {
    vertex_count: u32,
    opaque: u32,
    alpha_tested: u32,
    policy: RefitPolicy,
    /// Seconds of the first trace after it was built. A driver does not report the quality of its
    /// BVH, so later traces are compared with this one.
    first_trace: Option<f64>,
}

impl Deforming {
    fn input<'a>(&self, buffers: &'a GroupBuffers) -> Result<BottomLevelInput<'a>> {
        let indices =
            buffers.indices.as_ref().ok_or_else(|| Error::Vulkan("a group that deforms has no indices".into()))?;
        Ok(BottomLevelInput::Triangles {
            positions: &buffers.positions,
            vertex_count: self.vertex_count,
            indices,
            opaque: self.opaque,
            alpha_tested: self.alpha_tested,
        })
    }
}

impl Structures {
    pub fn build(device: &Arc<Device>, flat: &FlatScene, scene: &GpuScene) -> Result<Self> {
        // deforming groups keep what a later refit needs
        let mut commands = Commands::new(device)?;
        let mut bottom = Vec::with_capacity(flat.groups.len());
        let mut deforming: Vec<Option<Deforming>> = flat.groups.iter().map(|_| None).collect();
        for k in flat.motion.meshes.iter().filter_map(|&mesh| flat.group_of_mesh(mesh)) {
            let group = &flat.groups[k];
            deforming[k] = Some(Deforming {
                vertex_count: group.vertex_count as u32,
                opaque: group.opaque_count as u32,
                alpha_tested: (group.primitive_count - group.opaque_count) as u32,
                policy: RefitPolicy::new(1.0, 0.0),
                first_trace: None,
            });
        }

        // bottom levels: those that deform can be updated, the others are compacted
        for ((group, buffers), deforming) in flat.groups.iter().zip(&scene.groups).zip(&mut deforming) {
            if let Some(d) = deforming {
                let start = Instant::now();
                let input = d.input(buffers)?;
                bottom.push(AccelerationStructure::changing_bottom_level(
                    device,
                    &mut commands,
                    "bottom level",
                    &input,
                )?);
                d.policy = RefitPolicy::new(1.0, start.elapsed().as_secs_f64());
                continue;
            }
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

        // the top level: instances with their hit groups
        let entries: Vec<_> = flat
            .instances
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
                AccelerationStructureInstance {
                    transform,
                    index: k as u32,
                    hit_group,
                    bottom_level: bottom[p.group].address(),
                    hidden: p.hidden,
                }
            })
            .collect();
        let top = AccelerationStructure::top_level(device, &mut commands, &entries)?;
        let changing = (!flat.motion.is_none()).then_some(Changing { entries, deforming });
        Ok(Self { bottom, top, changing })
    }

    /// Refits the bottom level of a deformed group, or rebuilds it when the policy decides so.
    /// Returns whether it was rebuilt.
    pub fn deform(&mut self, device: &Arc<Device>, group: usize, scene: &GpuScene) -> Result<bool> {
        let Some(d) = self.changing.as_mut().and_then(|c| c.deforming[group].as_mut()) else { return Ok(false) };
        let start = Instant::now();
        let rebuild = d.policy.should_rebuild();
        let update = if rebuild { Update::Rebuild } else { Update::Refit };
        let mut commands = Commands::new(device)?;
        self.bottom[group].update(&mut commands, &d.input(&scene.groups[group])?, update)?;
        let seconds = start.elapsed().as_secs_f64();
        if rebuild {
            (d.policy, d.first_trace) = (RefitPolicy::new(1.0, seconds), None);
        } else {
            d.policy.refitted(d.policy.growth(), seconds);
        }
        Ok(rebuild)
    }

    /// Rebuilds the top level in place, after instances have moved, were hidden or shown, or groups
    /// have deformed.
    pub fn place(&mut self, device: &Arc<Device>, moved: &[(usize, TlasInstance)]) -> Result<()> {
        let Some(changing) = &mut self.changing else { return Ok(()) };
        for (entry, instance) in moved {
            let entry = &mut changing.entries[*entry];
            entry.transform.copy_from_slice(rows(&instance.to_world).as_flattened());
            entry.hidden = instance.hidden;
        }
        self.top.rebuild_top_level(&mut Commands::new(device)?, &changing.entries)
    }

    /// Records that tracing took `seconds` since the last update. An increase over the first trace
    /// is attributed to the loss of quality by refitting, in all deforming structures alike.
    pub fn traced(&mut self, seconds: f64) {
        let Some(changing) = &mut self.changing else { return };
        for d in changing.deforming.iter_mut().flatten() {
            let first = *d.first_trace.get_or_insert(seconds);
            d.policy.costs(seconds / first);
            d.policy.traced(seconds);
        }
    }

    pub fn address(&self) -> u64 {
        self.top.address()
    }

    pub fn bytes(&self) -> u64 {
        self.top.size() + self.bottom.iter().map(AccelerationStructure::size).sum::<u64>()
    }
}

fn sphere_boxes(device: &Arc<Device>, flat: &FlatScene, group: &BlasGroup) -> Result<Buffer> {
    let size = 24 * group.primitive_count as u64;
    let mut buffer = Buffer::new(device, "sphere boxes", size, Memory::Device)?;
    buffer.fill(size, 24, |first, bytes| {
        for (k, out) in bytes.chunks_exact_mut(24).enumerate() {
            let primitive = first as usize + k;
            let b = flat.primitive_bounds(group, flat.submesh_of(group, primitive), primitive);
            out.copy_from_slice(bytemuck::cast_slice(&[b.min.to_array(), b.max.to_array()]));
        }
    })?;
    Ok(buffer)
}
