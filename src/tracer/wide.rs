//! The wide BVHs of the compute tracer's fast kernel (`shaders/trace/wide.glsl`): one per group and
//! one over the instances, all in one array of blocks. This file makes their leaves:
//! [`TriangleLeaf`], [`SphereLeaf`] and, in the top level, [`InstanceLeaf`].

use std::sync::Arc;
use std::time::Instant;

use glam::{DAffine3, Vec3};
use obvhs::bvh2::Bvh2;
use rayon::prelude::*;

use super::boxes::{instance_boxes, padding, primitive_boxes, reach_padding};
use super::device_builder::DeviceBuilder;
use super::dynamic_trees::{DynamicTrees, instance_leaf, reserve};
use super::hierarchy::{FewAddresses, Hierarchy, unfinished_counter};
use super::kernel::{BuildOptions, Kernel};
use super::lane_budget::{resumptions, stack_constant};
use super::stream::{LaunchMemory, SuspendedRays};
use super::upload::write_records;
use crate::accel::build::{self, MAX_DEPTH};
use crate::accel::cache::{Entries, KeyBuilder};
use crate::accel::few::FewLeaves;
use crate::accel::flatten::{BlasGroup, FlatScene, TlasInstance};
use crate::accel::pairs::{self, Fan, Pair};
use crate::accel::wide::{self, Block, WideBvh};
use crate::accel::{Aabb, BuildPreset};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Device, Memory};
use crate::interface::records::hierarchy::{
    ALPHA_TESTED, InstanceLeaf, SPHERE, STACK_IN_REGISTERS, SUSPENDED_RAYS, SUSPENDED_START, SUSPENDED_WORDS,
    SphereLeaf, TriangleLeaf,
};
use crate::scene::Geometry;
use crate::stage;

/// The hierarchies on the host.
pub(super) struct Trees {
    pub groups: Vec<WideBvh>,
    pub top: Option<WideBvh>,
    /// Seconds to build each group's BVH, and the top level.
    pub seconds: Vec<f64>,
    pub top_seconds: f64,
}

/// How a tree is built.
#[derive(Clone, Copy)]
pub(super) struct TreeBuilder<'a> {
    /// How the host builds it.
    preset: BuildPreset,
    /// The device that builds it instead, where it can.
    device: Option<&'a DeviceBuilder>,
}

impl From<BuildPreset> for TreeBuilder<'_> {
    fn from(preset: BuildPreset) -> Self {
        Self { preset, device: None }
    }
}

impl<'a> TreeBuilder<'a> {
    pub fn new(preset: BuildPreset, device: Option<&'a DeviceBuilder>) -> Self {
        Self { preset, device }
    }
}

impl Trees {
    /// `device`: builds the groups' trees, where it can.
    pub fn build(flat: &FlatScene, options: &BuildOptions, device: Option<&DeviceBuilder>) -> Self {
        let timed = |g: &BlasGroup| {
            let start = Instant::now();
            let builder = TreeBuilder::new(options.preset(g.primitive_count), device);
            let make = if g.spheres { sphere_tree } else { triangle_tree };
            let tree = make(flat, g, options, builder);
            (tree, start.elapsed().as_secs_f64())
        };
        let (groups, seconds): (Vec<_>, _) = flat.groups.par_iter().map(timed).unzip();
        let start = Instant::now();
        let top = (!flat.is_single_level()).then(|| {
            let bounds: Vec<_> = groups.iter().map(|g| g.bounds.unwrap_or(Aabb::EMPTY)).collect();
            let boxes = instance_boxes(flat, &bounds);
            // upload() fills in the root, once the groups have their ranges in the array
            let leaf = |entry: u32| bytemuck::cast(instance_leaf(entry, &flat.instances[entry as usize], 0));
            match unique_instances(flat) {
                None => tree(boxes, options.preset(flat.instances.len()).into(), None, leaf),
                Some(kept) => {
                    let boxes = kept.iter().map(|&k| boxes[k as usize]).collect();
                    tree(boxes, options.preset(kept.len()).into(), None, |entry| leaf(kept[entry as usize]))
                }
            }
        });
        Self { groups, top, seconds, top_seconds: start.elapsed().as_secs_f64() }
    }

    /// The tree of a scene with a single group and no top level.
    pub fn into_only_group(mut self) -> Option<WideBvh> {
        if self.top.is_none() { self.groups.pop() } else { None }
    }

    /// Expected number of blocks that a ray visits; `None` for several trees.
    pub fn sah_cost(&self) -> Option<f64> {
        match (&self.top, self.groups.as_slice()) {
            (None, [group]) => Some(group.sah_cost),
            _ => None,
        }
    }

    pub fn upload(mut self, device: &Arc<Device>, flat: &FlatScene, kernel: Kernel) -> Result<Hierarchy> {
        let bounds = self.top.as_ref().or(self.groups.first()).and_then(|t| t.bounds).unwrap_or(Aabb::EMPTY);
        let (capacities, depths) = reserve(&self, flat);
        let dynamic = (!flat.motion.is_none()).then(|| Box::new(DynamicTrees::new(&self, flat, &capacities, &depths)));
        let group_depth = depths.groups.iter().copied().max().unwrap_or(0);
        // Every node visit pushes at most one entry. Entering a TLAS instance pushes its siblings
        // and the return to the top level.
        let stack_entries = self.top.as_ref().map_or(0, |_| depths.top + 2) + group_depth;
        debug_assert!(stack_entries <= 2 * MAX_DEPTH + 2);

        // the top level first: it is visited by every ray
        let mut roots = Vec::new();
        let mut count = capacities.top;
        for capacity in &capacities.groups {
            roots.push(count as u32);
            count += capacity;
        }
        if u32::try_from(count).is_err() {
            return Err(Error::Scene(format!(
                "the scene's BVH has {count} blocks, more than the 2^32 that the compute tracer can address"
            )));
        }

        // leaves of the top level name the root of their group
        if let Some(top) = &mut self.top {
            for block in top.blocks.iter_mut().filter(|b| wide::is_leaf(b)) {
                let leaf: &mut InstanceLeaf = bytemuck::cast_mut(block);
                leaf.root = roots[flat.instances[leaf.instance as usize].group];
            }
        }

        // each tree is moved to its place, with room to grow where it may change
        let trees = self.top.iter().map(|t| (t, 0, capacities.top)).chain(
            self.groups
                .iter()
                .zip(roots.iter().copied())
                .zip(&capacities.groups)
                .map(|((t, by), &capacity)| (t, by, capacity)),
        );
        let reserved = trees.flat_map(|(t, by, capacity)| {
            let free = std::iter::repeat_n(Block::default(), capacity - t.blocks.len());
            t.blocks.iter().map(move |b| wide::rebased(*b, by)).chain(free)
        });
        // an empty scene has a node without children
        let reserved = reserved.chain(std::iter::repeat_n(Block::default(), usize::from(count == 0)));
        let nodes = write_records(device, "hierarchy", count.max(1) as u64, &mut { reserved })?;

        // a ray visits a block once, and those of a group once for each of its instances
        let blocks_of = |i: &TlasInstance| capacities.groups[i.group] as u64;
        let visits = match &self.top {
            Some(_) => capacities.top as u64 + flat.instances.iter().map(blocks_of).sum::<u64>(),
            None => count as u64,
        };

        // the leaves, where there are few, nothing moves, and all are in the world's space
        let reach = bounds.min.abs().max(bounds.max.abs()).max_element();
        let is_baked = |i: &TlasInstance| i.scene_instance.is_none() && i.to_world == DAffine3::IDENTITY && !i.hidden;
        let few = (dynamic.is_none() && flat.instances.iter().all(is_baked))
            .then(|| FewLeaves::collect(flat.instances.iter().map(|i| &self.groups[i.group]), reach_padding(reach)))
            .flatten();
        let few = few.map(|few| {
            let buffer = Buffer::from_slice(device, "few leaves", &few.bytes())?;
            let (leaves, count) = (buffer.address(), few.leaves.len() as u32);
            Ok::<_, Error>((buffer, FewAddresses { leaves, count, flat: few.flat }))
        });

        let suspended = match resumptions(&device.info, visits) {
            0 => None,
            n => Some(SuspendedRays { memory: suspended_rays(device, stack_entries)?, resumptions: n }),
        };
        Ok(Hierarchy {
            kernel,
            primitives: None,
            root: 0,
            instance_roots: Vec::new(),
            stack_entries,
            bounds,
            unfinished: unfinished_counter(device)?,
            dynamic: dynamic.map(|mut d| d.keep_copy(device, &nodes).map(|()| d)).transpose()?,
            builder: None,
            areas: None,
            nodes,
            few: few.transpose()?,
            launch: LaunchMemory::new(device, suspended)?,
        })
    }
}

/// Memory of suspended rays, none yet, each with its stack (shaders/trace/suspend.glsl).
fn suspended_rays(device: &Arc<Device>, stack_entries: u32) -> Result<Arc<Buffer>> {
    let stack = 2 * (STACK_IN_REGISTERS + stack_constant(stack_entries) + 1);
    let words = SUSPENDED_START + SUSPENDED_RAYS * (SUSPENDED_WORDS + stack);
    let mut buffer = Buffer::new(device, "suspended rays", 4 * u64::from(words), Memory::Device)?;
    // none, in no work-group along x and one along y and z
    buffer.fill(16, 4, |first, bytes| {
        for (k, word) in bytes.chunks_exact_mut(4).enumerate() {
            word.copy_from_slice(&u32::from(first as usize + k > 1).to_le_bytes());
        }
    })?;
    Ok(Arc::new(buffer))
}

/// A tree over boxes, not yet padded. `depth`: maximum depth in nodes, if bounded.
pub(super) fn tree(
    mut boxes: Vec<Aabb>,
    builder: TreeBuilder,
    depth: Option<u32>,
    leaf: impl Fn(u32) -> Block + Sync,
) -> WideBvh {
    if boxes.is_empty() {
        return WideBvh::default();
    }
    let pad = padding(boxes.iter());
    boxes.par_iter_mut().for_each(|b| *b = Aabb { min: b.min - pad, max: b.max + pad });
    if let Some(tree) = builder.device.and_then(|d| d.try_build(&boxes, depth, &leaf)) {
        return tree;
    }
    let binary = build::tree(&boxes, builder.preset, None);
    drop(boxes);
    collapse(binary, depth, leaf)
}

/// Collapses a binary tree to a wide one of at most `depth` levels of nodes, if bounded.
fn collapse(binary: Bvh2, depth: Option<u32>, leaf: impl Fn(u32) -> Block + Sync) -> WideBvh {
    let built = WideBvh::collapse(&binary, &leaf);
    match depth {
        // a binary tree is never shallower than the wide one that it becomes
        Some(max) if built.depth > max => WideBvh::collapse(&build::limit_depth(binary, max), leaf),
        _ => built,
    }
}

/// Version of cached BVHs. Raise it with every change that makes other blocks of the same input: in
/// builders, pairs, collapse, or the layout of nodes and leaves.
const LAYOUT_VERSION: u32 = 6;

/// The header of a cached BVH, beside its blocks.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct CachedTree {
    bounds: [[f32; 3]; 2],
    depth: u32,
    reserved: u32,
    sah_cost: f64,
}

/// Primitives of a group as leaves hold them: its BVH is built from them, and one from the cache is
/// checked against them.
trait LeafSource: Sync {
    /// Number of primitives.
    fn primitive_count(&self) -> usize;
    /// The leaf of two primitives, the second of which may be [`pairs::NONE`]; `None` if there is
    /// no such leaf.
    fn leaf(&self, numbers: [u32; 2]) -> Option<Block>;
    /// Bounds of a primitive.
    fn bounds(&self, number: u32) -> Aabb;
    /// Key that two primitives share of which a BVH holds the first alone; `None` for one that each
    /// BVH holds.
    fn duplicate_key(&self, number: u32) -> Option<[[u32; 4]; 3]>;
}

/// Checks a BVH from the cache as input: each leaf is the one that its primitives make, every
/// primitive is held, the tree is one, and boxes contain what is below them. So whatever wrote the
/// file, the device reads nothing beyond the scene, and the image is that of a BVH built here; with
/// spatial splits (`Best`), whose leaves hold parts of primitives, boxes are not compared.
fn check_loaded(tree: &WideBvh, source: &impl LeafSource, preset: BuildPreset) -> Result<(), String> {
    let numbers = |b: &Block| {
        bytemuck::cast_ref::<Block, TriangleLeaf>(b).primitives.map(|id| match id {
            pairs::NONE => id,
            id => id & !(ALPHA_TESTED | SPHERE),
        })
    };
    let count = source.primitive_count();
    let exists = |number: u32| (number as usize) < count;

    // each leaf by itself
    let is_right = |b: &Block| {
        let [first, second] = numbers(b);
        let exist = exists(first) && (second == pairs::NONE || exists(second));
        exist && source.leaf([first, second]).is_some_and(|own| wide::as_leaf(own) == *b)
    };
    let wrong = tree.blocks.par_iter().enumerate().find_any(|(_, b)| wide::is_leaf(b) && !is_right(b));
    if let Some((at, _)) = wrong {
        return Err(format!("leaf {at} is not that of its primitives"));
    }

    // all of them: every primitive, or one that is the same
    let mut held = vec![false; count];
    let leaves = || tree.blocks.iter().filter(|b| wide::is_leaf(b));
    leaves().flat_map(numbers).filter(|n| *n != pairs::NONE).for_each(|n| held[n as usize] = true);
    if held.contains(&false) {
        let held = &held;
        let keys = |is_held: bool| (0..count as u32).filter(move |&n| held[n as usize] == is_held);
        let known: std::collections::HashSet<_> = keys(true).filter_map(|n| source.duplicate_key(n)).collect();
        if let Some(n) = keys(false).find(|&n| source.duplicate_key(n).is_none_or(|key| !known.contains(&key))) {
            return Err(format!("primitive {n} is missing"));
        }
    }

    // the tree above them
    let bounds = |b: &Block| {
        numbers(b).into_iter().filter(|n| *n != pairs::NONE).map(|n| source.bounds(n)).fold(Aabb::EMPTY, Aabb::union)
    };
    let all = match preset {
        BuildPreset::Best => {
            tree.validate(|_| Aabb::EMPTY)?;
            leaves().map(bounds).fold(Aabb::EMPTY, Aabb::union)
        }
        _ => tree.validate(bounds)?,
    };
    let is_within = tree.bounds.is_some_and(|b| b.contains(&all) && b.min.is_finite() && b.max.is_finite());
    if is_within && tree.sah_cost >= 0.0 && tree.sah_cost.is_finite() {
        Ok(())
    } else {
        Err("its bounds or its cost are wrong".into())
    }
}

/// The BVH of the geometry that `content` describes: from the cache if available, otherwise built
/// and stored there.
fn load_or_build(
    options: &BuildOptions,
    builder: TreeBuilder,
    content: &[&[u8]],
    source: &impl LeafSource,
    build: impl FnOnce() -> WideBvh,
) -> WideBvh {
    let Some(cache) = &options.cache else { return build() };
    let preset = builder.preset;
    let name = if builder.device.is_some() { "on the device".to_owned() } else { format!("{preset:?}") };
    let head = KeyBuilder::default().with(&LAYOUT_VERSION.to_le_bytes()).with(name.as_bytes());
    let key = content.iter().fold(head, |k, bytes| k.with(bytes)).finish();
    let tree_of = |entries: Entries| {
        let kept = *entries.get::<CachedTree>("tree")?.first()?;
        let [min, max] = kept.bounds.map(Vec3::from);
        let bounds = Some(Aabb { min, max });
        Some(WideBvh { blocks: entries.get("blocks")?, depth: kept.depth, bounds, sah_cost: kept.sah_cost })
    };
    if let Some(entries) = cache.load(key) {
        let checked = tree_of(entries).ok_or_else(|| "it lacks an array".to_owned()).and_then(|tree| {
            check_loaded(&tree, source, preset)?;
            Ok(tree)
        });
        match checked {
            Ok(tree) => return tree,
            Err(defect) => cache.reject(key, &defect),
        }
    }
    let wide = build();
    if let Some(b) = wide.bounds {
        let bounds = [b.min.to_array(), b.max.to_array()];
        let kept = CachedTree { bounds, depth: wide.depth, reserved: 0, sah_cost: wide.sah_cost };
        cache.store(key, &[("tree", bytemuck::bytes_of(&kept)), ("blocks", bytemuck::cast_slice(&wide.blocks))]);
    }
    wide
}

fn sphere_tree(flat: &FlatScene, group: &BlasGroup, options: &BuildOptions, builder: TreeBuilder) -> WideBvh {
    let spheres: Vec<[f32; 4]> = (0..group.primitive_count)
        .into_par_iter()
        .map(|primitive| {
            let part = flat.submesh_of(group, primitive);
            let s = flat.sphere(part, primitive - part.first_primitive);
            [s.center.x, s.center.y, s.center.z, s.radius]
        })
        .collect();
    // whether spheres that are the same are held once
    let once = group.opaque_count == group.primitive_count && flat.motion.is_none();
    let source = Spheres { spheres: &spheres, once };
    load_or_build(options, builder, &[b"spheres", &[u8::from(once)], bytemuck::cast_slice(&spheres)], &source, || {
        let leaf = |primitive: u32| source.block(primitive);
        let boxes: Vec<Aabb> = primitive_boxes(flat, group).collect();
        let kept = if once { firsts(spheres.len() as u32, |k| spheres[k as usize].map(bits)) } else { None };
        match kept {
            None => tree(boxes, builder, None, leaf),
            Some(kept) => {
                let boxes = kept.iter().map(|&k| boxes[k as usize]).collect();
                tree(boxes, builder, None, |k| leaf(kept[k as usize]))
            }
        }
    })
}

/// A group's spheres: centre and radius, BLAS space.
struct Spheres<'a> {
    spheres: &'a [[f32; 4]],
    /// Whether those that are the same are held once.
    once: bool,
}

impl Spheres<'_> {
    fn block(&self, number: u32) -> Block {
        let [x, y, z, radius] = self.spheres[number as usize];
        let primitives = [number | SPHERE, pairs::NONE];
        bytemuck::cast(SphereLeaf { center: [x, y, z], radius, primitives, ..Default::default() })
    }
}

impl LeafSource for Spheres<'_> {
    fn primitive_count(&self) -> usize {
        self.spheres.len()
    }

    fn leaf(&self, [number, second]: [u32; 2]) -> Option<Block> {
        (second == pairs::NONE).then(|| self.block(number))
    }

    fn bounds(&self, number: u32) -> Aabb {
        let [x, y, z, radius] = self.spheres[number as usize];
        let center = Vec3::new(x, y, z);
        Aabb { min: center - radius, max: center + radius }
    }

    fn duplicate_key(&self, number: u32) -> Option<[[u32; 4]; 3]> {
        self.once.then(|| [self.spheres[number as usize].map(bits), [0; 4], [0; 4]])
    }
}

/// A group's triangles, gathered from its parts.
pub(super) struct Triangles {
    pub positions: Vec<Vec3>,
    pub indices: Vec<[u32; 3]>,
}

impl Triangles {
    fn from_group(flat: &FlatScene, group: &BlasGroup) -> Self {
        let mut out = Self {
            positions: Vec::with_capacity(group.vertex_count),
            indices: Vec::with_capacity(group.primitive_count),
        };
        for part in &group.submeshes {
            let Geometry::Triangles(t) = &flat.scene.meshes[part.mesh].geometry else { continue };
            out.positions.par_extend((0..t.positions.len()).into_par_iter().map(|v| flat.vertex(part, v)));
            out.indices.par_extend(t.indices.par_iter().map(|t| t.map(|v| v + part.first_vertex as u32)));
        }
        out
    }

    fn corners(&self, vertices: [u32; 3]) -> [Vec3; 3] {
        vertices.map(|v| self.positions[v as usize])
    }
}

fn triangle_tree(flat: &FlatScene, group: &BlasGroup, options: &BuildOptions, builder: TreeBuilder) -> WideBvh {
    let triangles = Triangles::from_group(flat, group);
    let opaque = group.opaque_count as u32;
    let is_fixed = flat.motion.is_none();
    let content: [&[u8]; 4] = [
        &opaque.to_le_bytes(),
        &[u8::from(is_fixed)],
        bytemuck::cast_slice(&triangles.positions),
        bytemuck::cast_slice(&triangles.indices),
    ];
    let source = TriangleSource { triangles: &triangles, opaque, once: if is_fixed { opaque } else { 0 } };
    load_or_build(options, builder, &content, &source, || {
        if is_fixed {
            unique_triangle_tree(&triangles, opaque, builder)
        } else {
            triangle_tree_of(&triangles, opaque, builder, None)
        }
    })
}

/// A group's triangles as leaves hold them.
struct TriangleSource<'a> {
    triangles: &'a Triangles,
    /// Triangles before the first alpha-tested one.
    opaque: u32,
    /// Triangles before the first that is held even where another is the same.
    once: u32,
}

impl LeafSource for TriangleSource<'_> {
    fn primitive_count(&self) -> usize {
        self.triangles.indices.len()
    }

    fn leaf(&self, triangles: [u32; 2]) -> Option<Block> {
        pair_block(self.triangles, Pair { triangles }, self.opaque)
    }

    fn bounds(&self, number: u32) -> Aabb {
        Aabb::of_points(&self.triangles.corners(self.triangles.indices[number as usize]))
    }

    fn duplicate_key(&self, number: u32) -> Option<[[u32; 4]; 3]> {
        let corners = || same_from_first(self.triangles.corners(self.triangles.indices[number as usize]));
        (number < self.once).then(|| corners().map(|[x, y, z]| [x, y, z, 0]))
    }
}

/// A tree that has opaque triangles with the same three corners once, the first of them: a ray that
/// meets one meets all of them at the same distance, and which of them it meets is not said. Very
/// many would make a traversal that some drivers do not finish.
fn unique_triangle_tree(triangles: &Triangles, opaque: u32, builder: TreeBuilder) -> WideBvh {
    let all = &triangles.indices;
    let Some(mut numbers) = firsts(opaque, |k| same_from_first(triangles.corners(all[k as usize]))) else {
        return triangle_tree_of(triangles, opaque, builder, None);
    };
    let kept = numbers.len() as u32;
    numbers.extend(opaque..all.len() as u32);
    let indices = numbers.iter().map(|&k| all[k as usize]).collect();
    let few = Triangles { positions: triangles.positions.clone(), indices };
    let mut tree = triangle_tree_of(&few, kept, builder, None);
    for block in tree.blocks.iter_mut().filter(|b| wide::is_leaf(b)) {
        let leaf: &mut TriangleLeaf = bytemuck::cast_mut(block);
        for id in leaf.primitives.iter_mut().filter(|id| **id != pairs::NONE) {
            *id = numbers[(*id & !ALPHA_TESTED) as usize] | (*id & ALPHA_TESTED);
        }
    }
    tree
}

/// Instances of which each is the first of its group at its place; `None`: all of them. As with
/// triangles, rays would meet all of those in one place. Where something may move or alpha decides,
/// each is held.
fn unique_instances(flat: &FlatScene) -> Option<Vec<u32>> {
    let is_opaque = |i: &TlasInstance| {
        let group = &flat.groups[i.group];
        group.opaque_count == group.primitive_count
    };
    if !flat.motion.is_none() || !flat.instances.iter().all(is_opaque) {
        return None;
    }
    firsts(flat.instances.len() as u32, |k| {
        let instance = &flat.instances[k as usize];
        // zero is not two numbers
        (instance.group, instance.to_world.to_cols_array().map(|x| (x + 0.0).to_bits()))
    })
}

/// Things that are looked at for duplicates.
const SAMPLED: usize = 4096;

/// Numbers of the things that are the first with their key, in order; `None` if a look at some of
/// `count` finds no two alike: duplicates too rare for it are too few to matter.
fn firsts<K: Ord + Send>(count: u32, key: impl Fn(u32) -> K + Sync) -> Option<Vec<u32>> {
    let stride = (count as usize).div_ceil(SAMPLED).max(1);
    let mut some: Vec<K> = (0..count).step_by(stride).map(&key).collect();
    some.sort_unstable();
    if !some.windows(2).any(|w| w[0] == w[1]) {
        return None;
    }
    let mut order: Vec<(K, u32)> = (0..count).into_par_iter().map(|k| (key(k), k)).collect();
    order.par_sort_unstable();
    order.dedup_by(|a, b| a.0 == b.0);
    let mut numbers: Vec<u32> = order.into_iter().map(|(_, k)| k).collect();
    numbers.par_sort_unstable();
    Some(numbers)
}

/// Bits of a number, the same for both zeros.
fn bits(x: f32) -> u32 {
    (x + 0.0).to_bits()
}

/// The triangle's corners in their order, one and the same of them first.
fn same_from_first(corners: [Vec3; 3]) -> [[u32; 3]; 3] {
    let t = corners.map(|p| p.to_array().map(bits));
    let k = (0..3).min_by_key(|k| t[*k]).unwrap_or(0);
    [t[k], t[(k + 1) % 3], t[(k + 2) % 3]]
}

/// `opaque`: triangles before the first alpha-tested one; `depth` as in [`tree`].
pub(super) fn triangle_tree_of(
    triangles: &Triangles,
    opaque: u32,
    builder: TreeBuilder,
    depth: Option<u32>,
) -> WideBvh {
    let single: Vec<Aabb> = triangles.indices.par_iter().map(|&t| Aabb::of_points(&triangles.corners(t))).collect();
    let pairs = pairs::pair_up(&triangles.indices, &single, triangles.positions.len());
    let boxes: Vec<Aabb> = pairs
        .par_iter()
        .map(|p| match p.triangles {
            [a, pairs::NONE] => single[a as usize],
            [a, b] => single[a as usize].union(single[b as usize]),
        })
        .collect();
    drop(single);
    // the builder counts pairs, and the stage triangles
    stage::advance((triangles.indices.len() - pairs.len()) as u64);
    if boxes.is_empty() {
        return WideBvh::default();
    }
    let pad = padding(boxes.iter());
    let leaf = |pair: u32| pair_block(triangles, pairs[pair as usize], opaque).expect("a pair shares an edge");
    if let Some(device) = builder.device {
        let padded: Vec<Aabb> = boxes.par_iter().map(|b| Aabb { min: b.min - pad, max: b.max + pad }).collect();
        if let Some(tree) = device.try_build(&padded, depth, &leaf) {
            return tree;
        }
    }
    let of_pair = |pair: u32, see: &mut dyn FnMut([Vec3; 3])| {
        for t in pairs[pair as usize].triangles.into_iter().filter(|&t| t != pairs::NONE) {
            see(triangles.corners(triangles.indices[t as usize]));
        }
    };
    let binary = build::tree_with_splits(&boxes, &of_pair, builder.preset, pad);
    drop(boxes);
    collapse(binary, depth, leaf)
}

/// The leaf of a pair of triangles; `None` if they share no edge.
fn pair_block(triangles: &Triangles, pair: Pair, opaque: u32) -> Option<Block> {
    let [a, b] = pair.triangles;
    let corners = |t: u32| triangles.indices[t as usize];
    let fan = if b == pairs::NONE { Fan::single(corners(a)) } else { Fan::from_triangles(corners(a), corners(b))? };
    let number = |t: u32| {
        if t == pairs::NONE {
            t
        } else if t >= opaque {
            t | ALPHA_TESTED
        } else {
            t
        }
    };
    let places = fan.second_third.map(|[second, third]| (second | third << 2) as u32);
    Some(bytemuck::cast(TriangleLeaf {
        corners: fan.corners.map(|v| triangles.positions[v as usize].to_array()),
        primitives: [a, b].map(number),
        order: places[0] | places[1] << 4,
        ..Default::default()
    }))
}

/// Reads hierarchies as files of the cache hold them, for tests and fuzzers.
#[cfg(feature = "probes")]
pub mod probes {
    use super::*;
    use crate::scene::Scene;

    /// The hierarchy of the triangles of a scene's first group, built here: its depth in four
    /// bytes, then its blocks as a cache file has them.
    pub fn hierarchy(scene: &Scene) -> Vec<u8> {
        let flat = FlatScene::new(scene);
        let tree = triangle_tree(&flat, &flat.groups[0], &BuildOptions::default(), BuildPreset::Default.into());
        [&tree.depth.to_le_bytes()[..], bytemuck::cast_slice(&tree.blocks)].concat()
    }

    /// Whether such bytes are taken for the hierarchy of that group. What is taken leads nowhere
    /// but into itself, and ends.
    ///
    /// # Panics
    /// Where it does not.
    pub fn is_accepted(scene: &Scene, bytes: &[u8]) -> bool {
        let flat = FlatScene::new(scene);
        let triangles = Triangles::from_group(&flat, &flat.groups[0]);
        let opaque = flat.groups[0].opaque_count as u32;
        let source = TriangleSource { triangles: &triangles, opaque, once: opaque };
        let built = triangle_tree(&flat, &flat.groups[0], &BuildOptions::default(), BuildPreset::Default.into());
        let Some((depth, blocks)) = bytes.split_first_chunk::<4>() else { return false };
        if blocks.len() % size_of::<Block>() != 0 {
            return false;
        }
        let blocks = bytemuck::pod_collect_to_vec(blocks);
        let tree = WideBvh { blocks, depth: u32::from_le_bytes(*depth), ..built.clone() };
        if check_loaded(&tree, &source, BuildPreset::Default).is_err() {
            return false;
        }
        // as a device walks it, with no more steps than there are blocks
        let mut stack = vec![(0, 1)];
        for _ in 0..tree.blocks.len() {
            let (at, level) = stack.pop().expect("every block is reached");
            let block = &tree.blocks[at as usize];
            assert!(level <= tree.depth + 1, "deeper than recorded");
            if !wide::is_leaf(block) {
                stack.extend(wide::children(block).map(|(_, child)| (child, level + 1)));
            }
        }
        assert!(stack.is_empty(), "a block is reached twice");
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builtin;

    /// Every leaf lies within the boxes above it and holds what the scene has: each triangle and
    /// sphere once, its corners bit for bit and in their order, its alpha flag; each TLAS instance
    /// its number.
    fn check(name: &str) {
        let scene = builtin::by_name(name).unwrap();
        let flat = FlatScene::new(&scene);
        let trees = Trees::build(&flat, &BuildOptions::default(), None);
        for (tree, group) in trees.groups.iter().zip(&flat.groups) {
            let triangles = Triangles::from_group(&flat, group);
            let boxes: Vec<Aabb> = primitive_boxes(&flat, group).collect();
            // what a leaf of a sphere holds is read as a triangle's: their numbers are in one place
            let leaf = |b: &Block| *bytemuck::cast_ref::<Block, TriangleLeaf>(b);
            let held = |b: &Block| leaf(b).primitives.into_iter().filter(|&id| id != pairs::NONE);
            let number = |id: u32| (id & !(ALPHA_TESTED | SPHERE)) as usize;
            tree.validate(|b| held(b).map(|id| boxes[number(id)]).fold(Aabb::EMPTY, Aabb::union))
                .unwrap_or_else(|e| panic!("{name}: {e}"));
            let mut seen = vec![0; group.primitive_count];
            for block in tree.blocks.iter().filter(|b| wide::is_leaf(b)) {
                let leaf = leaf(block);
                for (k, id) in leaf.primitives.into_iter().enumerate().filter(|(_, id)| *id != pairs::NONE) {
                    seen[number(id)] += 1;
                    assert_eq!(id & SPHERE != 0, group.spheres, "{name}: {id:x}");
                    if group.spheres {
                        continue;
                    }
                    assert_eq!(id & ALPHA_TESTED != 0, number(id) >= group.opaque_count, "{name}: {id:x}");
                    let corners = if k == 0 { [0, 1, 2] } else { [0, 2, 3] };
                    let (second, third) = (leaf.order >> (4 * k) & 3, leaf.order >> (4 * k + 2) & 3);
                    let order = [3 - second - third, second, third]
                        .map(|p| leaf.corners[corners[p as usize]].map(f32::to_bits));
                    let own = triangles.corners(triangles.indices[number(id)]).map(|v| v.to_array().map(f32::to_bits));
                    assert_eq!(order, own, "{name}: triangle {}", number(id));
                }
            }
            assert!(seen.iter().all(|&n| n == 1), "{name}: a primitive is missing or there twice");
        }
        if let Some(top) = &trees.top {
            let bounds: Vec<_> = trees.groups.iter().map(|g| g.bounds.unwrap_or(Aabb::EMPTY)).collect();
            let boxes = instance_boxes(&flat, &bounds);
            top.validate(|b| boxes[bytemuck::cast_ref::<Block, InstanceLeaf>(b).instance as usize])
                .unwrap_or_else(|e| panic!("{name}: {e}"));
        }
    }

    /// A BVH holds the first of the triangles with the same vertices in the same order; one that is
    /// turned over is another.
    #[test]
    fn the_same_triangle_is_held_once() {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let mut indices = vec![[3, 1, 2]];
        indices.extend((0..3000).map(|k| [[0, 1, 2], [1, 2, 0], [2, 1, 0]][k % 3]));
        let opaque = indices.len() as u32;
        // those that are tested are kept, each
        indices.extend([[0, 1, 2]; 5]);
        let triangles = Triangles { positions, indices };
        let expected: Vec<u32> = [0, 1, 3].into_iter().chain((opaque..opaque + 5).map(|k| k | ALPHA_TESTED)).collect();
        assert_eq!(held(&unique_triangle_tree(&triangles, opaque, BuildPreset::Default.into())), expected);
        // and where each has vertices of its own, and a zero is negative
        let mut own = Triangles { positions: Vec::new(), indices: Vec::new() };
        for (k, t) in triangles.indices.iter().enumerate() {
            let first = own.positions.len() as u32;
            own.indices.push([first, first + 1, first + 2]);
            own.positions
                .extend(triangles.corners(*t).map(|p| if k % 2 == 0 { p } else { -Vec3::ZERO + p * Vec3::ONE }));
        }
        own.positions.iter_mut().skip(9).step_by(4).for_each(|p| p.z = if p.z == 0.0 { -0.0 } else { p.z });
        assert_eq!(held(&unique_triangle_tree(&own, opaque, BuildPreset::Default.into())), expected);
    }

    /// Numbers of the triangles that a tree holds, with their flags.
    fn held(tree: &WideBvh) -> Vec<u32> {
        let leaves =
            tree.blocks.iter().filter(|b| wide::is_leaf(b)).map(|b| *bytemuck::cast_ref::<Block, TriangleLeaf>(b));
        let mut held: Vec<u32> =
            leaves.flat_map(|l: TriangleLeaf| l.primitives).filter(|id| *id != pairs::NONE).collect();
        held.sort_unstable_by_key(|id| id & !ALPHA_TESTED);
        held
    }

    /// A BVH holds the first of the instances in one place, and of the spheres that are the same.
    #[test]
    fn the_same_instance_and_sphere_is_held_once() {
        use crate::scene::{Instance, Sphere};
        let mut scene = builtin::by_name("cornell-box").unwrap();
        let one = Instance {
            object_to_world: glam::DAffine3::from_scale(glam::DVec3::splat(1.5)),
            ..scene.instances[0].clone()
        };
        let moved =
            |x: f64| Instance { object_to_world: glam::DAffine3::from_translation(glam::DVec3::X * x), ..one.clone() };
        scene.instances = [vec![moved(1.0)], vec![one.clone(); 500], vec![moved(2.0)], vec![moved(1.0)]].concat();
        let trees = Trees::build(&FlatScene::new(&scene), &BuildOptions::default(), None);
        let top = trees.top.unwrap();
        let leaves = top.blocks.iter().filter(|b| wide::is_leaf(b));
        let mut held: Vec<u32> = leaves.map(|b| bytemuck::cast_ref::<Block, InstanceLeaf>(b).instance).collect();
        held.sort_unstable();
        assert_eq!(held, [0, 1, 501]);
        let sphere = |x: f32| Sphere { center: Vec3::X * x, radius: 1.0 };
        scene.meshes[0].geometry =
            Geometry::Spheres([vec![sphere(3.0)], vec![sphere(0.0); 700], vec![sphere(-0.0)]].concat());
        scene.instances.truncate(1);
        let flat = FlatScene::new(&scene);
        let tree = sphere_tree(&flat, &flat.groups[0], &BuildOptions::default(), BuildPreset::Default.into());
        let leaves =
            tree.blocks.iter().filter(|b| wide::is_leaf(b)).map(|b| *bytemuck::cast_ref::<Block, SphereLeaf>(b));
        let mut held: Vec<u32> = leaves.map(|l| l.primitives[0] & !SPHERE).collect();
        held.sort_unstable();
        assert_eq!(held, [0, 1]);
    }

    /// Damage in a tree: what is wrong with it, and how it gets there.
    type Damage = (&'static str, fn(&mut WideBvh));

    fn node(tree: &mut WideBvh) -> &mut wide::WideNode {
        bytemuck::cast_mut(&mut tree.blocks[0])
    }

    fn last_leaf(tree: &mut WideBvh) -> &mut TriangleLeaf {
        let at = tree.blocks.iter().rposition(wide::is_leaf).unwrap();
        bytemuck::cast_mut(&mut tree.blocks[at])
    }

    const DAMAGE: [Damage; 14] = [
        ("a child beyond the end", |t| node(t).first_child = 0x7fff_0000),
        ("children beyond 2^32", |t| node(t).first_child = u32::MAX - 2),
        ("a loop", |t| node(t).first_child = 0),
        ("children of another", |t| node(t).first_child += 1),
        ("a box elsewhere", |t| node(t).corner[0] = 1e9),
        ("a box that is no number", |t| node(t).corner[1] = f32::NAN),
        ("a scale that is infinite", |t| node(t).lower_z[7] = 255),
        ("a primitive that does not exist", |t| last_leaf(t).primitives[0] = 0x0fff_ffff),
        ("a primitive twice, another missing", |t| last_leaf(t).primitives[0] ^= 1),
        ("another flag", |t| last_leaf(t).primitives[0] ^= ALPHA_TESTED),
        ("a corner elsewhere", |t| last_leaf(t).corners[1][0] += 1.0),
        ("a node for a leaf", |t| last_leaf(t).flags = 0),
        ("a depth that takes all memory", |t| t.depth = 1 << 31),
        ("bounds that are too small", |t| t.bounds.as_mut().unwrap().max.y -= 0.5),
    ];

    /// Writes a tree over the only file of a cache, with the checksum that belongs to it.
    fn plant(folder: &std::path::Path, tree: &WideBvh) {
        let path = std::fs::read_dir(folder).unwrap().next().unwrap().unwrap().path();
        let good = std::fs::read(&path).unwrap();
        let bounds = tree.bounds.unwrap();
        let bounds = [bounds.min.to_array(), bounds.max.to_array()];
        let kept = CachedTree { bounds, depth: tree.depth, reserved: 0, sah_cost: tree.sah_cost };
        let arrays = [bytemuck::bytes_of(&kept), bytemuck::cast_slice(&tree.blocks)].concat();
        // magic, length, checksum; then the table and the arrays
        let body = [&good[32..good.len() - arrays.len()], &arrays].concat();
        let sum = xxhash_rust::xxh3::xxh3_128(&body).to_le_bytes();
        std::fs::write(&path, [&good[..16], &sum, &body].concat()).unwrap();
    }

    /// A file in the cache that says anything else than what would be built is not taken, whoever
    /// wrote it: a warning, and the BVH is built.
    #[test]
    fn a_cached_hierarchy_is_checked_against_the_geometry() {
        for name in ["stairs", "spheres:300"] {
            let scene = builtin::by_name(name).unwrap();
            let flat = FlatScene::new(&scene);
            let folder = tempfile::tempdir().unwrap();
            let cache = crate::accel::cache::Cache::new(folder.path());
            let options = BuildOptions { cache: Some(cache.clone()), ..Default::default() };
            let build = || Trees::build(&flat, &options, None).groups.swap_remove(0);
            let good = build();
            let same = |tree: &WideBvh| tree.blocks == good.blocks && tree.depth == good.depth;
            // what was stored is taken
            assert!(same(&build()) && cache.take_warnings().is_empty(), "{name}");
            for (what, damage) in DAMAGE {
                let mut bad = good.clone();
                damage(&mut bad);
                plant(folder.path(), &bad);
                assert!(same(&build()), "{name}: {what}");
                let warnings = cache.take_warnings();
                assert!(matches!(&warnings[..], [one] if one.contains("rebuilding")), "{name}: {what}: {warnings:?}");
                // and replaced by what is right
                assert!(same(&build()) && cache.take_warnings().is_empty(), "{name}: {what}");
            }
        }
    }

    /// Any one bit of the blocks turned: the tree is refused, or it is one that gives the same hits
    /// (a box that is larger).
    #[test]
    fn no_bit_of_a_cached_hierarchy_is_trusted() {
        let scene = builtin::by_name("stairs").unwrap();
        let flat = FlatScene::new(&scene);
        let triangles = Triangles::from_group(&flat, &flat.groups[0]);
        let opaque = flat.groups[0].opaque_count as u32;
        let source = TriangleSource { triangles: &triangles, opaque, once: opaque };
        let good = triangle_tree(&flat, &flat.groups[0], &BuildOptions::default(), BuildPreset::Default.into());
        check_loaded(&good, &source, BuildPreset::Default).unwrap();
        let bits = good.blocks.len() * 512;
        let accepted = (0..bits).step_by(7).filter(|bit| {
            let mut bad = good.clone();
            let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut bad.blocks);
            bytes[bit / 8] ^= 1 << (bit % 8);
            let is_leaf = wide::is_leaf(&good.blocks[bit / 512]);
            let taken = check_loaded(&bad, &source, BuildPreset::Default).is_ok();
            assert!(!(taken && is_leaf), "bit {bit} of a leaf");
            taken
        });
        // bits of planes that make a box larger, and planes of slots that hold nothing
        assert!(accepted.count() < bits / 7 / 4);
    }

    #[test]
    fn hierarchies_hold_what_the_scene_has() {
        for name in ["cornell-box", "cornell-spheres", "leaf-cards", "grid:6", "spheres:300", "stairs", "far-away"] {
            check(name);
        }
    }
}
