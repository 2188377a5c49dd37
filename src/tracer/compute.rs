//! What the compute tracer walks: a binary hierarchy per group and one over the placed groups, all in one node array.

use std::sync::Arc;

use glam::Vec3;

use crate::bvh::{Aabb, BuildPreset, Bvh2, bvh2};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Device, Memory};
use crate::scene::flatten::{FlatScene, Group};

/// Rays that a lane takes one after the other on a CPU driver, where idle lanes of a vector cost most.
pub const RAYS_PER_LANE_CPU: u32 = 8;
/// On a GPU enough rays fill the machine; long loops per lane only lengthen the tail.
pub const RAYS_PER_LANE_GPU: u32 = 1;

/// Bytes of a primitive record: three corners, and the number with its flags.
const PRIMITIVE_BYTES: u64 = 40;
const ALPHA_TESTED: u32 = 0x8000_0000;
const SPHERE: u32 = 0x4000_0000;
/// Primitives of a leaf at most: more cost memory accesses, fewer cost nodes.
const MAX_LEAF: u32 = 4;

/// Hierarchies on the host.
pub(super) struct Trees {
    groups: Vec<Bvh2>,
    top: Option<Bvh2>,
}

/// Hierarchies in device memory.
pub(super) struct Hierarchy {
    pub nodes: Buffer,
    pub primitives: Buffer,
    /// Where a ray begins.
    pub root: u32,
    /// Where it begins within each entry of the top level.
    pub instance_roots: Vec<u32>,
    pub stack_entries: u32,
}

impl Hierarchy {
    pub fn bytes(&self) -> u64 {
        self.nodes.size() + self.primitives.size()
    }
}

impl Trees {
    pub fn build(flat: &FlatScene) -> Result<Self> {
        let total = flat.primitive_count();
        if total > bvh2::MAX_PRIMITIVES || flat.placements.len() > bvh2::MAX_PRIMITIVES {
            return Err(Error::Scene(format!(
                "{total} primitives and {} instances; the compute tracer numbers at most {} of each",
                flat.placements.len(),
                bvh2::MAX_PRIMITIVES
            )));
        }
        let groups: Vec<_> =
            flat.groups.iter().map(|g| Bvh2::build(&primitive_boxes(flat, g), BuildPreset::Default, MAX_LEAF)).collect();
        let top = (!flat.is_single_level()).then(|| Bvh2::build(&placement_boxes(flat, &groups), BuildPreset::Default, 1));
        Ok(Self { groups, top })
    }

    pub fn upload(self, device: &Arc<Device>, flat: &FlatScene) -> Result<Hierarchy> {
        let group_depth = self.groups.iter().map(|g| g.depth).max().unwrap_or(0);
        // every inner node pushes at most one child; entering an entry of the top level pushes the way back
        let stack_entries = self.top.as_ref().map_or(group_depth, |t| t.depth + 1 + group_depth);
        let top_nodes = self.top.as_ref().map_or(0, |t| t.nodes.len());
        // the top level first: it is visited by every ray
        let mut bases = Vec::new();
        let (mut node, mut primitive) = (top_nodes as u32, 0u32);
        for g in &self.groups {
            bases.push((node, primitive));
            node += g.nodes.len() as u32;
            primitive += g.primitives.len() as u32;
        }
        let roots: Vec<_> = self.groups.iter().zip(&bases).map(|(g, b)| bvh2::rebase(g.root, b.0, b.1)).collect();
        let instance_roots: Vec<_> = flat.placements.iter().map(|p| roots[p.group]).collect();
        // a leaf of the top level names the entry itself
        let entry = |top: &Bvh2, reference: u32| match bvh2::leaf_range(reference) {
            Some((slot, _)) => reference - slot + top.primitives[slot as usize],
            None => reference,
        };
        let root = match &self.top {
            Some(top) => entry(top, top.root),
            None => roots.first().copied().unwrap_or(bvh2::EMPTY),
        };

        let size = size_of::<bvh2::Node>() as u64;
        let mut nodes = Buffer::new(device, "hierarchy nodes", size * node as u64, Memory::Device)?;
        let top_iter = self
            .top
            .iter()
            .flat_map(|top| top.nodes.iter().map(move |n| bvh2::Node { children: n.children.map(|c| entry(top, c)), ..*n }));
        let group_iter = self.groups.iter().zip(&bases).flat_map(|(g, b)| {
            let pad = padding(g);
            g.nodes.iter().map(move |n| bvh2::Node {
                boxes: padded(n.boxes, pad),
                children: n.children.map(|c| bvh2::rebase(c, b.0, b.1)),
                ..*n
            })
        });
        let mut all = top_iter.chain(group_iter);
        nodes.fill(size * node as u64, size, |_, bytes| {
            for (out, n) in bytes.chunks_exact_mut(size as usize).zip(&mut all) {
                out.copy_from_slice(bytemuck::bytes_of(&n));
            }
        })?;

        let mut primitives = Buffer::new(device, "hierarchy primitives", PRIMITIVE_BYTES * primitive as u64, Memory::Device)?;
        let mut all = self
            .groups
            .iter()
            .zip(&flat.groups)
            .flat_map(|(tree, group)| tree.primitives.iter().map(move |&p| record(flat, group, p)));
        primitives.fill(PRIMITIVE_BYTES * primitive as u64, PRIMITIVE_BYTES, |_, bytes| {
            for (out, r) in bytes.chunks_exact_mut(PRIMITIVE_BYTES as usize).zip(&mut all) {
                out.copy_from_slice(bytemuck::cast_slice(&r));
            }
        })?;
        Ok(Hierarchy { nodes, primitives, root, instance_roots, stack_entries })
    }
}

/// How far a tree's boxes are widened: four half-ulps of its largest coordinate. A ray that runs within the plane of flat
/// geometry is then strictly inside the box, and the traversal needs no special case for it.
fn padding(tree: &Bvh2) -> f32 {
    let reach =
        tree.nodes.first().map_or(0.0, |n| n.boxes.as_flattened().as_flattened().iter().fold(0.0f32, |m, x| m.max(x.abs())));
    (2.0 * f32::EPSILON * reach).max(1e-30)
}

fn padded(boxes: [[[f32; 3]; 2]; 2], pad: f32) -> [[[f32; 3]; 2]; 2] {
    boxes.map(|[lo, hi]| [lo.map(|x| x - pad), hi.map(|x| x + pad)])
}

fn primitive_boxes(flat: &FlatScene, group: &Group) -> Vec<Aabb> {
    let mut boxes = Vec::with_capacity(group.primitive_count);
    for part in &group.parts {
        let count = flat.scene.meshes[part.mesh].geometry.primitive_count();
        boxes.extend((part.first_primitive..part.first_primitive + count).map(|p| flat.primitive_bounds(group, part, p)));
    }
    boxes
}

/// World boxes of the placed groups, widened by what rounding a ray into a group's space may move it.
fn placement_boxes(flat: &FlatScene, trees: &[Bvh2]) -> Vec<Aabb> {
    let scene = flat.bounds();
    let reach = scene.min.abs().max(scene.max.abs()).max_element().max(0.0);
    // 16 half-ulps of the largest coordinate: two transforms of three products each, and the inverse's own rounding
    let pad = 16.0 * f32::EPSILON * 0.5 * reach;
    flat.placements
        .iter()
        .map(|p| {
            let tree = &trees[p.group];
            let boxes: Vec<Aabb> = match tree.nodes.first() {
                Some(n) => n.boxes.iter().map(|b| Aabb { min: b[0].into(), max: b[1].into() }).collect(),
                // a single leaf: its primitives themselves
                None => {
                    let group = &flat.groups[p.group];
                    tree.primitives
                        .iter()
                        .map(|&k| flat.primitive_bounds(group, flat.part_of(group, k as usize), k as usize))
                        .collect()
                }
            };
            let mut out = Aabb::EMPTY;
            for b in boxes {
                for k in 0..8u32 {
                    let pick = |axis: usize| if k >> axis & 1 == 0 { b.min[axis] } else { b.max[axis] };
                    let corner = p.to_world.transform_point3(Vec3::new(pick(0), pick(1), pick(2)).as_dvec3()).as_vec3();
                    out = out.union(Aabb { min: corner - pad, max: corner + pad });
                }
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
