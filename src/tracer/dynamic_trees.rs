//! The fast kernel's BVHs of a dynamic scene, refitted and rebuilt on the host. On a device with
//! unified memory they are changed in place; on others the host keeps a copy and uploads the ranges
//! that changed.
//!
//! Each tree has spare capacity in the array of blocks, and the kernel's stack has spare entries,
//! so that streams are compiled once. A tree that outgrows its capacity causes a reallocation of
//! the array; a tree that would be too deep for the stack is made shallower.

use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

use glam::Vec3;
use rayon::prelude::*;

use super::boxes::{padding, reach_padding};
use super::device_builder::DeviceBuilder;
use super::transform::{instance_padding, transformed_bounds, world_to_group};
use super::wide::{Trees, Triangles, tree, triangle_tree_of};
use crate::accel::build::MAX_DEPTH;
use crate::accel::flatten::{FlatScene, TlasInstance};
use crate::accel::refit::{RefitPlan, RefitPolicy, refit};
use crate::accel::wide::{self, BLOCK_BYTES, Block, LEAF, WideBvh};
use crate::accel::{Aabb, BuildPreset, pairs};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Device, Memory};
use crate::interface::records::hierarchy::{ALPHA_TESTED, InstanceLeaf, TriangleLeaf};
use crate::scene::Geometry;

/// Maximum number of TLAS instances for which the top level is always rebuilt:
/// docs/design/bvh.md has the measurement.
const MAX_TOP_REBUILD: usize = 256;
/// Number of levels by which a rebuilt tree may be deeper than the first one.
const SPARE_LEVELS: u32 = 4;

/// Capacity of each tree in the array of blocks, spare blocks included.
pub(super) struct TreeCapacities {
    pub top: usize,
    pub groups: Vec<usize>,
}

/// Maximum depth of each tree in nodes, for the kernel's stack.
pub(super) struct TreeDepths {
    pub top: u32,
    pub groups: Vec<u32>,
}

/// A tree's range in the array, and its state.
struct Tree {
    base: usize,
    capacity: usize,
    len: usize,
    /// Maximum depth in nodes.
    depth: u32,
    bounds: Aabb,
    sah_cost: f64,
    /// `None` for a static tree.
    changing: Option<Changing>,
}

struct Changing {
    plan: RefitPlan,
    policy: RefitPolicy,
}

/// The topology of a group that deforms.
struct Deforming {
    indices: Vec<[u32; 3]>,
    /// Whether each vertex is used by a triangle; `None` when all are.
    used: Option<Vec<bool>>,
    opaque: u32,
}

/// The BVHs of a dynamic scene.
pub(super) struct DynamicTrees {
    /// A copy of the array in device memory, where the host cannot access that.
    copy: Option<Vec<Block>>,
    top: Option<Tree>,
    groups: Vec<Tree>,
    deforming: Vec<Option<Deforming>>,
}

fn ceil_log2(n: usize) -> u32 {
    n.next_power_of_two().ilog2()
}

/// Maximum depth that is reserved for a tree and its rebuilds.
fn max_depth(depth: u32, leaves: usize) -> u32 {
    (depth + SPARE_LEVELS).max(ceil_log2(leaves.max(2))).min(MAX_DEPTH)
}

fn spare_capacity(blocks: usize) -> usize {
    blocks + blocks / 16 + 8
}

fn may_deform(flat: &FlatScene) -> Vec<bool> {
    let mut out = vec![false; flat.groups.len()];
    for group in flat.motion.meshes.iter().filter_map(|&m| flat.group_of_mesh(m)) {
        out[group] = true;
    }
    out
}

/// Capacities and maximum depths of a scene's trees, with a reserve for those that change.
pub(super) fn reserve(trees: &Trees, flat: &FlatScene) -> (TreeCapacities, TreeDepths) {
    let deform = may_deform(flat);
    let capacity_of = |t: &WideBvh, more: bool| if more { spare_capacity(t.blocks.len()) } else { t.blocks.len() };
    let top = trees.top.as_ref().map_or((0, 0), |t| {
        if flat.motion.is_none() {
            (t.blocks.len(), t.depth)
        } else {
            // every node but the root has at least two children
            (2 * flat.instances.len() + 1, max_depth(t.depth, flat.instances.len()))
        }
    });
    let groups = trees.groups.iter().zip(&flat.groups).zip(deform).map(|((t, g), more)| {
        (capacity_of(t, more), if more { max_depth(t.depth, g.primitive_count) } else { t.depth })
    });
    let (capacities, depths) = groups.unzip();
    (TreeCapacities { top: top.0, groups: capacities }, TreeDepths { top: top.1, groups: depths })
}

impl DynamicTrees {
    /// The state of trees that lie in the array with these capacities, the top level first.
    pub fn new(trees: &Trees, flat: &FlatScene, capacities: &TreeCapacities, depths: &TreeDepths) -> Self {
        let deform = may_deform(flat);
        let describe = |t: &WideBvh, base, capacity, depth, seconds, changes: bool| Tree {
            base,
            capacity,
            len: t.blocks.len(),
            depth,
            bounds: t.bounds.unwrap_or(Aabb::EMPTY),
            sah_cost: t.sah_cost,
            changing: changes.then(|| Changing {
                plan: RefitPlan::new(&t.blocks, 0),
                policy: RefitPolicy::new(t.sah_cost, seconds),
            }),
        };
        let mut at = capacities.top;
        let groups = (0..trees.groups.len()).map(|k| {
            let (base, capacity) = (at, capacities.groups[k]);
            at += capacity;
            describe(&trees.groups[k], base, capacity, depths.groups[k], trees.seconds[k], deform[k])
        });
        let groups = groups.collect();
        let top = trees.top.as_ref().map(|t| describe(t, 0, capacities.top, depths.top, trees.top_seconds, true));
        let deforming = flat.groups.iter().zip(&deform).map(|(g, &deform)| {
            let Geometry::Triangles(t) = &flat.scene.meshes[g.submeshes[0].mesh].geometry else { return None };
            deform.then(|| {
                let mut used = vec![false; t.positions.len()];
                t.indices.iter().flatten().for_each(|&v| used[v as usize] = true);
                let used = used.contains(&false).then_some(used);
                Deforming { indices: t.indices.clone(), used, opaque: g.opaque_count as u32 }
            })
        });
        Self { copy: None, top, groups, deforming: deforming.collect() }
    }

    /// Keeps a copy of the array, where the host cannot access device memory.
    pub fn keep_copy(&mut self, device: &Device, nodes: &Buffer) -> Result<()> {
        if !device.info.unified_memory {
            self.copy = Some(bytemuck::pod_collect_to_vec(&nodes.read(0, nodes.size())?));
        }
        Ok(())
    }

    /// Refits the tree of a deformed group, or rebuilds it when the policy decides so. Returns
    /// whether it was rebuilt, and its SAH cost relative to that at the last build. `builder`
    /// rebuilds it on the device, where it can.
    pub fn deform(
        &mut self,
        (device, builder): (&Arc<Device>, Option<&DeviceBuilder>),
        nodes: &mut Buffer,
        group: usize,
        positions: &[Vec3],
    ) -> Result<(bool, f64)> {
        let Some(deforming) = &self.deforming[group] else {
            return Err(Error::Vulkan(format!("group {group} was not declared as deforming")));
        };
        let start = Instant::now();
        let reach = |(v, p): (usize, &Vec3)| match &deforming.used {
            Some(used) if !used[v] => 0.0,
            _ => p.abs().max_element(),
        };
        let pad =
            reach_padding(positions.par_iter().with_min_len(4096).enumerate().map(reach).reduce(|| 0.0, f32::max));
        let leaf = |block: &mut Block| rewrite_pair(block, positions, &deforming.indices);

        // another tree: on the device over the same leaves, pairs of triangles as they are
        if self.groups[group].should_rebuild() {
            let depth = Some(self.groups[group].depth);
            let array = blocks(&mut self.copy, nodes)?;
            let rebuild = |builder: &DeviceBuilder| {
                let all = array[self.groups[group].range()].par_iter();
                let (leaves, boxes): (Vec<Block>, Vec<Aabb>) = all
                    .filter(|b| wide::is_leaf(b))
                    .map(|&(mut block)| {
                        let b = leaf(&mut block);
                        (block, Aabb { min: b.min - pad, max: b.max + pad })
                    })
                    .unzip();
                builder.try_build(&boxes, depth, &|k| leaves[k as usize])
            };
            let built = builder.and_then(rebuild).unwrap_or_else(|| {
                let triangles = Triangles { positions: positions.to_vec(), indices: deforming.indices.clone() };
                triangle_tree_of(&triangles, deforming.opaque, BuildPreset::Default.into(), depth)
            });
            let seconds = start.elapsed().as_secs_f64();
            if built.blocks.len() > self.groups[group].capacity {
                self.grow(device, nodes, group, spare_capacity(built.blocks.len()))?;
            }
            self.groups[group].replace(blocks(&mut self.copy, nodes)?, &built, seconds);
            self.flush(nodes, self.groups[group].range())?;
            return Ok((true, 1.0));
        }

        // or the same one with other boxes
        self.groups[group].refit(blocks(&mut self.copy, nodes)?, pad, leaf, start);
        self.flush(nodes, self.groups[group].range())?;
        Ok((false, self.groups[group].growth()))
    }

    /// Refits or rebuilds the top level after instances have moved or groups have deformed. Returns
    /// whether it was rebuilt, and the bounds of the scene.
    pub fn place(&mut self, nodes: &mut Buffer, instances: &[TlasInstance]) -> Result<(bool, Aabb)> {
        let Some(top) = &mut self.top else {
            return Ok((false, self.groups.first().map_or(Aabb::EMPTY, |g| g.bounds)));
        };
        let start = Instant::now();
        let groups = &self.groups;
        let mut boxes: Vec<Aabb> =
            instances.par_iter().map(|p| transformed_bounds(&p.to_world, groups[p.group].bounds)).collect();
        let pad = instance_padding(boxes.iter().fold(0.0f32, |m, b| m.max(b.min.abs().max(b.max.abs()).max_element())));
        boxes.par_iter_mut().for_each(|b| *b = Aabb { min: b.min - pad, max: b.max + pad });
        let leaf = |entry: u32| {
            let instance = &instances[entry as usize];
            instance_leaf(entry, instance, groups[instance.group].base as u32)
        };
        let rebuild = instances.len() <= MAX_TOP_REBUILD || top.should_rebuild();
        if rebuild {
            let built = tree(boxes, BuildPreset::Fast.into(), Some(top.depth), |entry| bytemuck::cast(leaf(entry)));
            top.replace(blocks(&mut self.copy, nodes)?, &built, start.elapsed().as_secs_f64());
        } else {
            let pad = padding(boxes.iter());
            let leaf = |block: &mut Block| {
                let entry = bytemuck::cast_ref::<Block, InstanceLeaf>(block).instance;
                *block = bytemuck::cast(leaf(entry));
                block.flags |= LEAF;
                boxes[entry as usize]
            };
            top.refit(blocks(&mut self.copy, nodes)?, pad, leaf, start);
        }
        let (range, bounds) = (top.range(), top.bounds);
        self.flush(nodes, range)?;
        Ok((rebuild, bounds))
    }

    /// Distributes the time of tracing over the trees, by the expected number of blocks of each
    /// that a ray visits.
    pub fn traced(&mut self, seconds: f64, instances: &[TlasInstance]) {
        let mut visits = vec![0.0f64; self.groups.len()];
        let whole = self.top.as_ref().map_or(1.0, |t| t.bounds.half_area() as f64).max(f64::MIN_POSITIVE);
        for p in instances {
            let g = &self.groups[p.group];
            let share = if self.top.is_some() {
                transformed_bounds(&p.to_world, g.bounds).half_area() as f64 / whole
            } else {
                1.0
            };
            visits[p.group] += share * g.sah_cost;
        }
        let top_visits = self.top.as_ref().map_or(0.0, |t| t.sah_cost);
        let total = visits.iter().sum::<f64>() + top_visits;
        for (tree, visits) in self.groups.iter_mut().zip(visits).chain(self.top.iter_mut().map(|t| (t, top_visits))) {
            if let Some(changing) = &mut tree.changing {
                changing.policy.traced(seconds * visits / total);
            }
        }
    }

    /// Enlarges the capacity of a group's tree, which reallocates the whole array.
    fn grow(&mut self, device: &Arc<Device>, nodes: &mut Buffer, group: usize, capacity: usize) -> Result<()> {
        let old: Vec<Block> = blocks(&mut self.copy, nodes)?.to_vec();
        let before: Vec<usize> = self.groups.iter().map(|g| g.base).collect();
        self.groups[group].capacity = capacity;
        let mut at = self.top.as_ref().map_or(0, |t| t.capacity);
        for g in &mut self.groups {
            g.base = at;
            at += g.capacity;
        }
        if u32::try_from(at).is_err() {
            return Err(Error::Scene(format!(
                "the scene's BVH has {at} blocks, more than the 2^32 that the compute tracer can address"
            )));
        }
        let mut new = vec![Block::default(); at];
        if let Some(top) = &self.top {
            // its leaves still hold the old roots: the caller rebuilds or refits the top level next
            new[..top.len].copy_from_slice(&old[..top.len]);
        }
        for (g, from) in self.groups.iter().zip(before) {
            let by = (g.base as u32).wrapping_sub(from as u32);
            for (to, block) in new[g.range()].iter_mut().zip(&old[from..from + g.len]) {
                *to = wide::rebased(*block, by);
            }
        }
        *nodes = Buffer::new(device, "hierarchy", BLOCK_BYTES * at as u64, Memory::Device)?;
        nodes.write(0, bytemuck::cast_slice(&new))?;
        self.copy = self.copy.is_some().then_some(new);
        Ok(())
    }

    fn flush(&self, nodes: &mut Buffer, range: Range<usize>) -> Result<()> {
        match &self.copy {
            Some(blocks) => nodes.write(range.start as u64 * BLOCK_BYTES, bytemuck::cast_slice(&blocks[range])),
            None => Ok(()),
        }
    }
}

/// The array of blocks as the host can write it: the copy, or mapped device memory.
fn blocks<'a>(copy: &'a mut Option<Vec<Block>>, nodes: &'a mut Buffer) -> Result<&'a mut [Block]> {
    match copy {
        Some(blocks) => Ok(blocks),
        None => {
            let bytes = nodes.bytes_mut().ok_or_else(|| Error::Vulkan("the hierarchy is not mapped".into()))?;
            Ok(bytemuck::cast_slice_mut(bytes))
        }
    }
}

impl Tree {
    fn range(&self) -> Range<usize> {
        self.base..self.base + self.len
    }

    fn should_rebuild(&self) -> bool {
        self.changing.as_ref().is_some_and(|c| c.policy.should_rebuild())
    }

    fn growth(&self) -> f64 {
        self.changing.as_ref().map_or(1.0, |c| c.policy.growth())
    }

    /// `start`: when the work for this refit began.
    fn refit(&mut self, array: &mut [Block], pad: f32, leaf: impl Fn(&mut Block) -> Aabb + Sync, start: Instant) {
        let (range, base) = (self.range(), self.base as u32);
        let Some(changing) = &mut self.changing else { return };
        let refitted = refit(&mut array[range], base, &changing.plan, pad, leaf);
        self.bounds = refitted.bounds.unwrap_or(Aabb::EMPTY);
        self.sah_cost = refitted.sah_cost;
        changing.policy.refitted(refitted.sah_cost, start.elapsed().as_secs_f64());
    }

    /// Replaces this tree by a rebuilt one, which must fit its capacity.
    fn replace(&mut self, array: &mut [Block], built: &WideBvh, seconds: f64) {
        self.len = built.blocks.len();
        (self.bounds, self.sah_cost) = (built.bounds.unwrap_or(Aabb::EMPTY), built.sah_cost);
        let base = self.base as u32;
        array[self.range()]
            .par_iter_mut()
            .with_min_len(4096)
            .zip(&built.blocks)
            .for_each(|(to, b)| *to = wide::rebased(*b, base));
        self.changing = Some(Changing {
            plan: RefitPlan::new(&built.blocks, 0),
            policy: RefitPolicy::new(built.sah_cost, seconds),
        });
    }
}

/// The top-level leaf of an instance, whose group has its root at block `root`.
pub(super) fn instance_leaf(entry: u32, instance: &TlasInstance, root: u32) -> InstanceLeaf {
    InstanceLeaf { world_to_group: world_to_group(instance), root, instance: entry, ..Default::default() }
}

/// Updates the corners of a leaf to the current vertices and returns their bounds. The vertex of
/// each corner follows from the leaf's triangle indices and its corner order, as the shader reads
/// them.
fn rewrite_pair(block: &mut Block, positions: &[Vec3], indices: &[[u32; 3]]) -> Aabb {
    let places = |word: u32| [word as usize & 3, word as usize >> 2 & 3];
    let leaf: &mut TriangleLeaf = bytemuck::cast_mut(block);
    let [second, third] = places(leaf.order);
    let mut corners = [0u32; 4];
    let [a, b, c] = indices[(leaf.primitives[0] & !ALPHA_TESTED) as usize];
    // `order` has the positions of the triangle's second and third vertex among corners 0, 1 and 2
    corners[3 - second - third] = a;
    corners[second] = b;
    corners[third] = c;
    corners[3] = corners[2];
    if leaf.primitives[1] != pairs::NONE {
        // for the second triangle, positions 0, 1, 2 are corners 0, 2, 3
        let [second, third] = places(leaf.order >> 4);
        let t = indices[(leaf.primitives[1] & !ALPHA_TESTED) as usize];
        corners[3] = if second == 2 {
            t[1]
        } else if third == 2 {
            t[2]
        } else {
            t[0]
        };
    }
    let points = corners.map(|v| positions[v as usize]);
    leaf.corners = points.map(|p| p.to_array());
    Aabb::of_points(&points)
}
