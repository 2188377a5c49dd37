//! What the compute tracer walks: a hierarchy per group and one over the placed groups, all in one node array, for one of two
//! kernels.

use std::sync::Arc;

use glam::Vec3;

use super::stream::{LAUNCH_RAYS, LaunchMemory};
use crate::bvh::build::MAX_DEPTH;
use crate::bvh::{Aabb, BuildPreset, Bvh2, Cwbvh, bvh2, cwbvh};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Device, Memory};
use crate::ray::Ray;
use crate::scene::flatten::{FlatScene, Group};

/// Rays that a lane of the fast kernel takes one after the other on a CPU driver, where idle lanes of a vector cost most.
pub const RAYS_PER_LANE_CPU: u32 = 8;
/// On a GPU enough rays fill the machine; long loops per lane only lengthen the tail.
pub const RAYS_PER_LANE_GPU: u32 = 2;

/// Which kernel traces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kernel {
    /// Eight-wide quantised nodes, lanes that refill: `shaders/trace/wide.glsl`.
    #[default]
    Wide,
    /// The readable one: binary nodes, one ray a lane: `shaders/trace/reference.glsl`.
    Reference,
}

/// Bytes of a primitive record.
const PRIMITIVE_BYTES: u64 = 40;
const ALPHA_TESTED: u32 = 0x8000_0000;
const SPHERE: u32 = 0x4000_0000;
/// Primitives of a leaf of the binary tree at most: more cost memory accesses, fewer cost nodes.
const REFERENCE_LEAF: u32 = 4;
/// Bytes of a closest hit between the steps of a launch.
pub(super) const HIT_BYTES: u64 = 24;

/// A tree of one kernel or the other.
enum Tree {
    Wide(Cwbvh),
    Reference(Bvh2),
}

/// Hierarchies on the host.
pub(super) struct Trees {
    groups: Vec<Tree>,
    top: Option<Tree>,
}

/// Hierarchies in device memory.
pub(super) struct Hierarchy {
    pub kernel: Kernel,
    pub nodes: Buffer,
    pub primitives: Buffer,
    /// Where a ray begins.
    pub root: u32,
    /// Where it begins within each entry of the top level.
    pub instance_roots: Vec<u32>,
    pub stack_entries: u32,
    /// Of everything, padded.
    pub bounds: Aabb,
    /// A u32: rays whose traversal the driver cut short.
    pub unfinished: Buffer,
    /// Between the steps of a launch (fast kernel only).
    pub launch_rays: Option<Arc<Buffer>>,
    pub launch_hits: Option<Arc<Buffer>>,
}

impl Hierarchy {
    /// Fails when the driver cut a traversal short.
    pub fn check_finished(&self) -> Result<()> {
        let mut count = 0u32;
        self.unfinished.read_with(0, 4, 4, |_, bytes| count = bytemuck::pod_read_unaligned(bytes))?;
        match count {
            0 => Ok(()),
            n => Err(Error::Vulkan(format!(
                "the driver cut the traversal of {n} rays short (Mesa before 23 leaves a loop after 65,535 turns; the scene has \
                 very many surfaces in one place): use a newer driver, or --tracer pipeline"
            ))),
        }
    }

    /// Between the steps of a launch of the fast kernel.
    pub fn launch_memory(&self) -> Result<LaunchMemory> {
        match (&self.launch_rays, &self.launch_hits) {
            (Some(rays), Some(hits)) => Ok(LaunchMemory { rays: rays.clone(), hits: hits.clone() }),
            _ => Err(Error::Vulkan("the reference kernel has no steps".into())),
        }
    }

    pub fn bytes(&self) -> u64 {
        self.nodes.size() + self.primitives.size()
    }
}

impl Tree {
    fn build(kernel: Kernel, boxes: Vec<Aabb>, max_leaf: u32) -> Self {
        match kernel {
            Kernel::Wide => {
                let pad = padding(boxes.iter());
                Tree::Wide(Cwbvh::build(boxes, pad, BuildPreset::Default))
            }
            Kernel::Reference => Tree::Reference(Bvh2::build(&boxes, BuildPreset::Default, max_leaf)),
        }
    }

    fn nodes(&self) -> u32 {
        match self {
            Tree::Wide(t) => t.nodes.len() as u32,
            Tree::Reference(t) => t.nodes.len() as u32,
        }
    }

    fn primitives(&self) -> &[u32] {
        match self {
            Tree::Wide(t) => &t.primitives,
            Tree::Reference(t) => &t.primitives,
        }
    }

    fn depth(&self) -> u32 {
        match self {
            Tree::Wide(t) => t.depth,
            Tree::Reference(t) => t.depth,
        }
    }

    fn bounds(&self, boxes: impl Iterator<Item = Aabb>) -> Aabb {
        match self {
            Tree::Wide(t) => t.bounds.unwrap_or(Aabb::EMPTY),
            Tree::Reference(_) => boxes.fold(Aabb::EMPTY, Aabb::union),
        }
    }
}

impl Trees {
    pub fn build(flat: &FlatScene, kernel: Kernel) -> Result<Self> {
        let total = flat.primitive_count();
        if total > bvh2::MAX_PRIMITIVES || flat.placements.len() > bvh2::MAX_PRIMITIVES {
            return Err(Error::Scene(format!(
                "{total} primitives and {} instances; the compute tracer numbers at most {} of each",
                flat.placements.len(),
                bvh2::MAX_PRIMITIVES
            )));
        }
        let groups: Vec<_> =
            flat.groups.iter().map(|g| Tree::build(kernel, primitive_boxes(flat, g).collect(), REFERENCE_LEAF)).collect();
        let top = (!flat.is_single_level()).then(|| Tree::build(kernel, placement_boxes(flat, &groups), 1));
        Ok(Self { groups, top })
    }

    pub fn upload(self, device: &Arc<Device>, flat: &FlatScene) -> Result<Hierarchy> {
        let bounds = match (&self.top, self.groups.first()) {
            (Some(top), _) => top.bounds(placement_boxes(flat, &self.groups).into_iter()),
            (None, Some(group)) => group.bounds(flat.groups.iter().flat_map(|g| primitive_boxes(flat, g))),
            (None, None) => Aabb::EMPTY,
        };
        let group_depth = self.groups.iter().map(Tree::depth).max().unwrap_or(0);
        let kernel = match self.groups.first().or(self.top.as_ref()) {
            Some(Tree::Reference(_)) => Kernel::Reference,
            _ => Kernel::Wide,
        };
        // Every node visit pushes at most one entry. Entering an entry of the top level pushes the way back; the wide kernel
        // also what is left of the node's children and of the leaf's other entries.
        let stack_entries = match (&self.top, kernel) {
            (None, _) => group_depth,
            (Some(top), Kernel::Reference) => top.depth() + 1 + group_depth,
            (Some(top), Kernel::Wide) => top.depth() + 3 + group_depth,
        };
        debug_assert!(stack_entries <= 2 * MAX_DEPTH + 3);
        // the top level first: it is visited by every ray
        let top_primitives = match (&self.top, kernel) {
            // leaves of the wide top level are records, those of the binary one are references
            (Some(top), Kernel::Wide) => top.primitives().len() as u32,
            _ => 0,
        };
        let mut bases = Vec::new();
        let (mut node, mut primitive) = (self.top.as_ref().map_or(0, Tree::nodes), top_primitives);
        for g in &self.groups {
            bases.push((node, primitive));
            node += g.nodes();
            primitive += g.primitives().len() as u32;
        }
        let roots: Vec<_> = self
            .groups
            .iter()
            .zip(&bases)
            .map(|(g, b)| match g {
                Tree::Wide(_) => b.0,
                Tree::Reference(t) => bvh2::rebase(t.root, b.0, b.1),
            })
            .collect();
        let instance_roots: Vec<_> = flat.placements.iter().map(|p| roots[p.group]).collect();
        let root = match &self.top {
            Some(Tree::Wide(_)) => 0,
            Some(Tree::Reference(top)) => top_reference(top, top.root),
            None => roots.first().copied().unwrap_or(bvh2::EMPTY),
        };

        let trees: Vec<(&Tree, (u32, u32), bool)> = self
            .top
            .iter()
            .map(|t| (t, (0, 0), true))
            .chain(self.groups.iter().zip(&bases).map(|(t, &b)| (t, b, false)))
            .collect();
        let nodes = match kernel {
            Kernel::Wide => write_records(
                device,
                "hierarchy nodes",
                cwbvh::NODE_BYTES,
                node as u64,
                &mut trees.iter().flat_map(|&(t, b, _)| {
                    let Tree::Wide(t) = t else { unreachable!("all trees are of one kernel") };
                    (0..t.nodes.len()).map(move |k| t.rebased(k, b.0, b.1))
                }),
            )?,
            Kernel::Reference => write_records(
                device,
                "hierarchy nodes",
                size_of::<bvh2::Node>() as u64,
                node as u64,
                &mut trees.iter().flat_map(|&(t, b, is_top)| {
                    let Tree::Reference(t) = t else { unreachable!("all trees are of one kernel") };
                    let pad = padding(
                        t.nodes
                            .first()
                            .into_iter()
                            .flat_map(|n| n.boxes.map(|b| Aabb { min: b[0].into(), max: b[1].into() }))
                            .collect::<Vec<_>>()
                            .iter(),
                    );
                    t.nodes.iter().map(move |n| bvh2::Node {
                        boxes: n.boxes.map(|[lo, hi]| [lo.map(|x| x - pad), hi.map(|x| x + pad)]),
                        children: n.children.map(|c| if is_top { top_reference(t, c) } else { bvh2::rebase(c, b.0, b.1) }),
                        ..*n
                    })
                }),
            )?,
        };
        let top_records = self.top.iter().filter(|_| kernel == Kernel::Wide).flat_map(|t| {
            t.primitives().iter().map(|&entry| {
                let mut r = [0u32; 10];
                r[9] = entry;
                r
            })
        });
        let group_records = self
            .groups
            .iter()
            .zip(&flat.groups)
            .flat_map(|(t, group)| t.primitives().iter().map(move |&p| record(flat, group, p)));
        // one more: the fast kernel loads records in pairs
        let primitives = write_records(
            device,
            "hierarchy primitives",
            PRIMITIVE_BYTES,
            primitive as u64 + 1,
            &mut top_records.chain(group_records).chain([[0u32; 10]]),
        )?;
        let launch = |name, bytes| match kernel {
            Kernel::Wide => Buffer::new(device, name, bytes * LAUNCH_RAYS as u64, Memory::Device).map(|b| Some(Arc::new(b))),
            Kernel::Reference => Ok(None),
        };
        let (launch_rays, launch_hits) = (launch("launch rays", size_of::<Ray>() as u64)?, launch("launch hits", HIT_BYTES)?);
        let mut unfinished = Buffer::new(device, "unfinished rays", 4, Memory::Readback)?;
        unfinished.fill(4, 4, |_, bytes| bytes.fill(0))?;
        Ok(Hierarchy {
            unfinished,
            kernel,
            nodes,
            primitives,
            root,
            instance_roots,
            stack_entries,
            bounds,
            launch_rays,
            launch_hits,
        })
    }
}

/// A leaf of the binary top level names the entry itself.
fn top_reference(top: &Bvh2, reference: u32) -> u32 {
    match bvh2::leaf_range(reference) {
        Some((slot, _)) => reference - slot + top.primitives[slot as usize],
        None => reference,
    }
}

fn write_records<T: bytemuck::NoUninit>(
    device: &Arc<Device>,
    name: &str,
    size: u64,
    count: u64,
    records: &mut dyn Iterator<Item = T>,
) -> Result<Buffer> {
    let mut buffer = Buffer::new(device, name, size * count, Memory::Device)?;
    buffer.fill(size * count, size, |_, bytes| {
        for (out, r) in bytes.chunks_exact_mut(size as usize).zip(&mut *records) {
            out.copy_from_slice(bytemuck::bytes_of(&r));
        }
    })?;
    Ok(buffer)
}

/// How far boxes are widened: eight half-ulps of the largest coordinate. It covers what quantisation rounds away; and a ray that
/// runs within the plane of flat geometry is then strictly inside the box, so that the traversal needs no special case for it.
fn padding<'a>(boxes: impl Iterator<Item = &'a Aabb>) -> f32 {
    let reach = boxes.fold(0.0f32, |m, b| m.max(b.min.abs().max(b.max.abs()).max_element()));
    (4.0 * f32::EPSILON * reach).max(1e-30)
}

fn primitive_boxes(flat: &FlatScene, group: &Group) -> impl Iterator<Item = Aabb> {
    group.parts.iter().flat_map(move |part| {
        let count = flat.scene.meshes[part.mesh].geometry.primitive_count();
        (part.first_primitive..part.first_primitive + count).map(move |p| flat.primitive_bounds(group, part, p))
    })
}

/// World boxes of the placed groups, widened by what rounding a ray into a group's space may move it.
fn placement_boxes(flat: &FlatScene, trees: &[Tree]) -> Vec<Aabb> {
    let scene = flat.bounds();
    let reach = scene.min.abs().max(scene.max.abs()).max_element().max(0.0);
    // 16 half-ulps of the largest coordinate: two transforms of three products each, and the inverse's own rounding
    let pad = 16.0 * f32::EPSILON * 0.5 * reach;
    let bounds: Vec<Aabb> = trees.iter().zip(&flat.groups).map(|(t, g)| t.bounds(primitive_boxes(flat, g))).collect();
    flat.placements
        .iter()
        .map(|p| {
            let b = bounds[p.group];
            let mut out = Aabb::EMPTY;
            for k in 0..8u32 {
                let pick = |axis: usize| if k >> axis & 1 == 0 { b.min[axis] } else { b.max[axis] };
                let corner = p.to_world.transform_point3(Vec3::new(pick(0), pick(1), pick(2)).as_dvec3()).as_vec3();
                out = out.union(Aabb { min: corner - pad, max: corner + pad });
            }
            out
        })
        .collect()
}

fn record(flat: &FlatScene, group: &Group, primitive: u32) -> [u32; 10] {
    let part = flat.part_of(group, primitive as usize);
    let k = primitive as usize - part.first_primitive;
    let mut out = [0u32; 10];
    if group.spheres {
        let s = flat.sphere(part, k);
        out[..4].copy_from_slice(&[s.center.x, s.center.y, s.center.z, s.radius].map(f32::to_bits));
        out[9] = primitive | SPHERE;
    } else {
        for (c, v) in flat.triangle(part, k).iter().enumerate() {
            out[3 * c..3 * c + 3].copy_from_slice(&v.to_array().map(f32::to_bits));
        }
        out[9] = primitive | if part.alpha_tested { ALPHA_TESTED } else { 0 };
    }
    out
}
