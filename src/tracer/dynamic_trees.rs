//! The fast kernel's hierarchies of a scene that changes: kept up to date on the host, where they lie. On a device that shares
//! the host's memory nothing is copied; on others a copy is kept and the parts that changed are written.
//!
//! Trees have room to grow in the array of blocks, and the kernel's stack some more entries than the first trees need: streams are
//! compiled once. A tree that needs more room moves the array, one that would be deeper is made shallower.

use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

use glam::Vec3;
use rayon::prelude::*;

use super::compute::{instance_padding, padding, reach_padding, transformed_bounds};
use super::dynamic::group_of;
use super::gpu_scene::rows;
use super::wide::{Trees, Triangles, tree, triangle_tree_of};
use crate::accel::build::MAX_DEPTH;
use crate::accel::flatten::{FlatScene, TlasInstance};
use crate::accel::refit::{RefitPlan, RefitPolicy, refit};
use crate::accel::wide::{self, BLOCK_BYTES, Block, LEAF, Wide};
use crate::accel::{Aabb, BuildPreset, pairs};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Device, Memory};
use crate::interface::records::hierarchy::{ALPHA_TESTED, InstanceLeaf, TriangleLeaf};
use crate::scene::Geometry;

/// A top level of so many entries is always built anew: docs/dynamic-scenes.md has the measurement.
const MAX_TOP_REBUILD: usize = 256;
/// Levels that a tree may grow by when it is built anew.
const MORE_LEVELS: u32 = 4;

/// Blocks that trees take in the array, with room to grow.
pub(super) struct TreeCapacities {
    pub top: usize,
    pub groups: Vec<usize>,
}

/// Nodes that may lie on a path, for the kernel's stack.
pub(super) struct TreeDepths {
    pub top: u32,
    pub groups: Vec<u32>,
}

/// Where a tree lies.
struct Tree {
    base: usize,
    room: usize,
    len: usize,
    /// Nodes on its longest path at most.
    depth: u32,
    bounds: Aabb,
    sah_cost: f64,
    /// `None`: it stays as it is.
    changing: Option<Changing>,
}

struct Changing {
    plan: RefitPlan,
    policy: RefitPolicy,
}

/// A group that deforms.
struct Deforming {
    indices: Vec<[u32; 3]>,
    /// Which vertices triangles use, unless all of them.
    used: Option<Vec<bool>>,
    opaque: u32,
}

/// The hierarchies of a scene that changes.
pub(super) struct DynamicTrees {
    /// What is in device memory, where the host cannot reach it.
    copy: Option<Vec<Block>>,
    top: Option<Tree>,
    groups: Vec<Tree>,
    deforming: Vec<Option<Deforming>>,
}

fn ceil_log2(n: usize) -> u32 {
    n.next_power_of_two().ilog2()
}

/// What a tree is given so that it can be built anew.
fn most_depth(depth: u32, leaves: usize) -> u32 {
    (depth + MORE_LEVELS).max(ceil_log2(leaves.max(2))).min(MAX_DEPTH)
}

fn more_room(blocks: usize) -> usize {
    blocks + blocks / 16 + 8
}

fn may_deform(flat: &FlatScene) -> Vec<bool> {
    let mut out = vec![false; flat.groups.len()];
    for group in flat.motion.meshes.iter().filter_map(|&m| group_of(flat, m)) {
        out[group] = true;
    }
    out
}

/// TreeCapacities and depths that a scene's trees get: what they need, and more for those that change.
pub(super) fn provide(trees: &Trees, flat: &FlatScene) -> (TreeCapacities, TreeDepths) {
    let deform = may_deform(flat);
    let rooms = |t: &Wide, more: bool| if more { more_room(t.blocks.len()) } else { t.blocks.len() };
    let top = trees.top.as_ref().map_or((0, 0), |t| match flat.motion.is_none() {
        true => (t.blocks.len(), t.depth),
        // every node but the root has two children at least
        false => (2 * flat.instances.len() + 1, most_depth(t.depth, flat.instances.len())),
    });
    let groups = trees
        .groups
        .iter()
        .zip(&flat.groups)
        .zip(deform)
        .map(|((t, g), more)| (rooms(t, more), if more { most_depth(t.depth, g.primitive_count) } else { t.depth }));
    let (room, depth) = groups.unzip();
    (TreeCapacities { top: top.0, groups: room }, TreeDepths { top: top.1, groups: depth })
}

impl DynamicTrees {
    /// Of trees that lie in the array with these rooms, the top level first.
    pub fn new(trees: &Trees, flat: &FlatScene, rooms: &TreeCapacities, depths: &TreeDepths) -> Self {
        let deform = may_deform(flat);
        let describe = |t: &Wide, base, room, depth, seconds, changes: bool| Tree {
            base,
            room,
            len: t.blocks.len(),
            depth,
            bounds: t.bounds.unwrap_or(Aabb::EMPTY),
            sah_cost: t.sah_cost,
            changing: changes
                .then(|| Changing { plan: RefitPlan::new(&t.blocks, 0), policy: RefitPolicy::new(t.sah_cost, seconds) }),
        };
        let mut at = rooms.top;
        let groups = (0..trees.groups.len()).map(|k| {
            let (base, room) = (at, rooms.groups[k]);
            at += room;
            describe(&trees.groups[k], base, room, depths.groups[k], trees.seconds[k], deform[k])
        });
        let groups = groups.collect();
        let top = trees.top.as_ref().map(|t| describe(t, 0, rooms.top, depths.top, trees.top_seconds, true));
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

    /// Keeps a copy of the array, where the host cannot reach the device's.
    pub fn keep_copy(&mut self, device: &Device, nodes: &Buffer) -> Result<()> {
        if !device.info.unified_memory {
            self.copy = Some(bytemuck::pod_collect_to_vec(&nodes.read(0, nodes.size())?));
        }
        Ok(())
    }

    /// A group's vertices have moved: refits its tree, or builds it anew where the policy says so. Gives whether it did the latter, and the
    /// growth of the SAH cost.
    pub fn deform(
        &mut self,
        device: &Arc<Device>,
        nodes: &mut Buffer,
        group: usize,
        positions: &[Vec3],
    ) -> Result<(bool, f64)> {
        let Some(deforming) = &self.deforming[group] else {
            return Err(Error::Vulkan(format!("group {group} was not said to deform")));
        };
        let start = Instant::now();
        if self.groups[group].should_rebuild() {
            let triangles = Triangles { positions: positions.to_vec(), indices: deforming.indices.clone() };
            let built = triangle_tree_of(&triangles, deforming.opaque, BuildPreset::Default, Some(self.groups[group].depth));
            let seconds = start.elapsed().as_secs_f64();
            if built.blocks.len() > self.groups[group].room {
                self.make_room(device, nodes, group, more_room(built.blocks.len()))?;
            }
            self.groups[group].replace(blocks(&mut self.copy, nodes)?, &built, seconds);
            self.flush(nodes, self.groups[group].range())?;
            return Ok((true, 1.0));
        }
        let reach = |(v, p): (usize, &Vec3)| match &deforming.used {
            Some(used) if !used[v] => 0.0,
            _ => p.abs().max_element(),
        };
        let pad = reach_padding(positions.par_iter().with_min_len(4096).enumerate().map(reach).reduce(|| 0.0, f32::max));
        let leaf = |block: &mut Block| rewrite_pair(block, positions, &deforming.indices);
        self.groups[group].refit(blocks(&mut self.copy, nodes)?, pad, leaf, start);
        self.flush(nodes, self.groups[group].range())?;
        Ok((false, self.groups[group].growth()))
    }

    /// Entries or groups have moved: refits the top level or builds it anew. Gives whether it did the latter, and the bounds of everything.
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
            let built = tree(boxes, BuildPreset::Fast, Some(top.depth), |entry| bytemuck::cast(leaf(entry)));
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

    /// Shares out the time of tracing among the trees, by how many blocks of each a ray is expected to visit.
    pub fn traced(&mut self, seconds: f64, instances: &[TlasInstance]) {
        let mut visits = vec![0.0f64; self.groups.len()];
        let whole = self.top.as_ref().map_or(1.0, |t| t.bounds.half_area() as f64).max(f64::MIN_POSITIVE);
        for p in instances {
            let g = &self.groups[p.group];
            let share =
                if self.top.is_some() { transformed_bounds(&p.to_world, g.bounds).half_area() as f64 / whole } else { 1.0 };
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

    /// Gives a group more room: the whole array moves.
    fn make_room(&mut self, device: &Arc<Device>, nodes: &mut Buffer, group: usize, room: usize) -> Result<()> {
        let old: Vec<Block> = blocks(&mut self.copy, nodes)?.to_vec();
        let before: Vec<usize> = self.groups.iter().map(|g| g.base).collect();
        self.groups[group].room = room;
        let mut at = self.top.as_ref().map_or(0, |t| t.room);
        for g in &mut self.groups {
            g.base = at;
            at += g.room;
        }
        if u32::try_from(at).is_err() {
            return Err(Error::Scene(format!("its hierarchy has {at} blocks; the compute tracer addresses 2^32")));
        }
        let mut new = vec![Block::default(); at];
        if let Some(top) = &self.top {
            // its entries name the groups' roots; whoever makes room places them anew
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

/// The array, where the host can write.
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

    /// Puts a tree in the place of this one. It fits.
    fn replace(&mut self, array: &mut [Block], built: &Wide, seconds: f64) {
        self.len = built.blocks.len();
        (self.bounds, self.sah_cost) = (built.bounds.unwrap_or(Aabb::EMPTY), built.sah_cost);
        let base = self.base as u32;
        array[self.range()]
            .par_iter_mut()
            .with_min_len(4096)
            .zip(&built.blocks)
            .for_each(|(to, b)| *to = wide::rebased(*b, base));
        self.changing =
            Some(Changing { plan: RefitPlan::new(&built.blocks, 0), policy: RefitPolicy::new(built.sah_cost, seconds) });
    }
}

/// The leaf of an entry of the top level, whose group's root is block `root`.
pub(super) fn instance_leaf(entry: u32, instance: &TlasInstance, root: u32) -> InstanceLeaf {
    InstanceLeaf { world_to_group: rows(&instance.to_world.inverse()), root, instance: entry, ..Default::default() }
}

/// Moves the corners of a leaf to where its vertices are now, and gives their box. Which vertex is which corner follows from the numbers of the
/// triangles and the places of their corners, as the shader reads them.
fn rewrite_pair(block: &mut Block, positions: &[Vec3], indices: &[[u32; 3]]) -> Aabb {
    let places = |word: u32| [word as usize & 3, word as usize >> 2 & 3];
    let leaf: &mut TriangleLeaf = bytemuck::cast_mut(block);
    let [second, third] = places(leaf.order);
    let mut corners = [0u32; 4];
    let [a, b, c] = indices[(leaf.primitives[0] & !ALPHA_TESTED) as usize];
    // the places of a triangle's corners are 0, 1 and 2
    corners[3 - second - third] = a;
    corners[second] = b;
    corners[third] = c;
    corners[3] = corners[2];
    if leaf.primitives[1] != pairs::NONE {
        // places 0, 1, 2 are corners 0, 2, 3 here
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
