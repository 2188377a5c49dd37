//! Builds wide hierarchies on the device: leaves are sorted along a Morton curve, clustered from
//! the bottom up in parallel (PLOC++; Benthin, Drabinski, Tessari, Dittebrandt, HPG 2022, after
//! Meister and Bittner, TVCG 2018), and collapsed as on the host (`accel/wide.rs`). The host
//! records all passes at once and waits once; how many rounds and levels there are is known to the
//! device alone. The same leaves make the same bits on one device.
//!
//! docs/design/bvh.md describes the passes (shaders/bvh_*.glsl).

use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use crate::accel::build::MAX_DEPTH;
use crate::accel::wide::{BLOCK_BYTES, Block, WideBvh};
use crate::accel::{Aabb, bvh2};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Commands, ComputePipeline, Device, Memory, Recorder, Timing};
use crate::interface::records::builder::{
    BUILD_LANES, BUILD_STEPS, BuildInner, BuildNode, BuildParams, BuildState, BuildStep, CLUSTER_TILE, FIRST_LEVEL,
    FIRST_ROUND, MAX_GROUPS_X, MAX_ROUNDS, MAX_TREE_LEVELS, SORT_DIGITS, SORT_KEYS, SORT_PASSES,
};
use crate::interface::records::ray::Push;
use crate::shaders;
use crate::stage;

const _: () = assert!(MAX_TREE_LEVELS == MAX_DEPTH);

/// Keys of a work-group of the sort.
const SORT_TILE: u32 = BUILD_LANES * SORT_KEYS;

/// The largest coordinate of boxes that are built over on the device: areas relative to it are
/// neither infinite nor zero.
const MAX_REACH: f32 = 1e30;

/// Counts and times of the hierarchies that a device has built.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct DeviceBuildStats {
    /// Number of hierarchies.
    pub trees: u32,
    /// Number of leaves in them.
    pub leaves: u64,
    /// Seconds of the device for sorting leaves; 0 where it has no clock.
    pub sort_seconds: f64,
    /// Seconds of the device for clustering.
    pub cluster_seconds: f64,
    /// Seconds of the device for the wide nodes.
    pub emit_seconds: f64,
    /// Rounds of clustering of the last one.
    pub rounds: u32,
    /// Number of hierarchies that the device could not build, and the host did.
    pub refused: u32,
}

/// A builder of wide hierarchies on a device.
pub struct DeviceBuilder {
    device: Arc<Device>,
    bounds: ComputePipeline,
    morton: ComputePipeline,
    sort: [ComputePipeline; 2],
    cluster: [ComputePipeline; 2],
    emit: ComputePipeline,
    work: Mutex<Work>,
    min_leaves: usize,
}

/// The device's account of a tree.
struct BuildResult {
    state: BuildState,
    /// Levels of wide nodes; one more than can be for a tree that is too deep.
    depth: u32,
}

/// Memory and commands of one build after the other.
struct Work {
    commands: Commands,
    memory: Option<BuildMemory>,
    stats: DeviceBuildStats,
}

/// Memory of a build over up to so many leaves.
struct BuildMemory {
    capacity: usize,
    nodes: Buffer,
    inners: Buffer,
    pairs: [Buffer; 2],
    counts: Buffer,
    leaves: Buffer,
    blocks: Buffer,
    /// The state and the steps.
    state: Buffer,
    params: Buffer,
    /// A copy of the state for the host.
    read_back: Buffer,
}

const STATE_BYTES: u64 = size_of::<BuildState>() as u64;
const STEP_BYTES: u64 = size_of::<BuildStep>() as u64;

/// Work-groups along x and y for a number of tiles.
fn tile_groups(tiles: u32) -> [u32; 3] {
    [tiles.min(MAX_GROUPS_X), tiles.div_ceil(MAX_GROUPS_X), 1]
}

impl DeviceBuilder {
    /// Number of leaves below which so many passes hardly pay: a guess, not measured on a GPU.
    pub const MIN_LEAVES: usize = 4096;

    /// Compiles the passes for a device, for hierarchies of at least `min_leaves` leaves.
    ///
    /// # Errors
    /// Those of the device.
    pub fn new(device: &Arc<Device>, min_leaves: usize) -> Result<Self> {
        Ok(Self {
            device: device.clone(),
            bounds: shaders::BVH_BOUNDS.pipeline(device)?,
            morton: shaders::BVH_MORTON.pipeline(device)?,
            sort: [shaders::BVH_SORT_COUNT.pipeline(device)?, shaders::BVH_SORT_SCATTER.pipeline(device)?],
            cluster: [shaders::BVH_NEAREST.pipeline(device)?, shaders::BVH_MERGE.pipeline(device)?],
            emit: shaders::BVH_EMIT.pipeline(device)?,
            work: Mutex::new(Work { commands: Commands::new(device)?, memory: None, stats: Default::default() }),
            min_leaves,
        })
    }

    /// Counts and times so far.
    pub fn stats(&self) -> DeviceBuildStats {
        self.work.lock().unwrap_or_else(PoisonError::into_inner).stats
    }

    /// Counts and times so far; the memory is freed until the next build.
    pub(super) fn take_stats(&self) -> DeviceBuildStats {
        let mut work = self.work.lock().unwrap_or_else(PoisonError::into_inner);
        work.memory = None;
        std::mem::take(&mut work.stats)
    }

    /// Builds a hierarchy as [`DeviceBuilder::build`] does, no deeper than `max_depth` if bounded.
    /// `None` where the host has to: for few leaves, and for those that the device cannot take.
    pub(super) fn try_build(
        &self,
        boxes: &[Aabb],
        max_depth: Option<u32>,
        leaf: &(impl Fn(u32) -> Block + Sync),
    ) -> Option<WideBvh> {
        if boxes.len() < self.min_leaves {
            return None;
        }
        let built = self.build(boxes, max_depth.unwrap_or(MAX_DEPTH), leaf);
        match &built {
            Ok(_) => stage::advance(boxes.len() as u64),
            Err(_) => self.work.lock().unwrap_or_else(PoisonError::into_inner).stats.refused += 1,
        }
        built.ok()
    }

    /// Builds a hierarchy over boxes, which are padded, and not empty or NaN. `leaf` returns the
    /// block of one; no path has more nodes than `max_depth`, at least the binary logarithm of the
    /// number of boxes and at most [`MAX_DEPTH`].
    ///
    /// # Errors
    /// [`Error::Scene`] for more boxes or larger coordinates than a device takes, and those of the
    /// device: [`Error::OutOfMemory`] among them. The host's builder takes such boxes.
    pub fn build(&self, boxes: &[Aabb], max_depth: u32, leaf: impl Fn(u32) -> Block + Sync) -> Result<WideBvh> {
        if boxes.is_empty() {
            return Ok(WideBvh::default());
        }
        let bounds = boxes.par_iter().with_min_len(1 << 14).copied().reduce(|| Aabb::EMPTY, Aabb::union);
        let reach = bounds.min.abs().max(bounds.max.abs()).max_element();
        if boxes.len() > bvh2::MAX_PRIMITIVES || reach > MAX_REACH {
            return Err(Error::Scene(format!(
                "{} leaves with coordinates up to {reach} are no hierarchy for a device",
                boxes.len()
            )));
        }

        // leaves and parameters; the rest is made on the device
        let mut work = self.work.lock().unwrap_or_else(PoisonError::into_inner);
        let Work { commands, memory, stats } = &mut *work;
        if memory.as_ref().is_none_or(|m| m.capacity < boxes.len()) {
            *memory = None;
        }
        let memory = match memory {
            Some(memory) => memory,
            None => memory.insert(BuildMemory::new(&self.device, boxes.len())?),
        };
        let count = boxes.len() as u32;
        memory.write(boxes, 0.5 / reach, leaf)?;
        let mut result = self.run(commands, memory, count, MAX_ROUNDS, stats)?;
        if result.depth > max_depth {
            // no wide tree is deeper than the binary one, whose quality suffers from the bound
            result = self.run(commands, memory, count, max_depth.max(count.next_power_of_two().ilog2()), stats)?;
        }
        stats.trees += 1;
        stats.leaves += u64::from(count);

        // the blocks, and what the host needs to know besides
        let BuildResult { state, depth } = result;
        let mut blocks = vec![Block::default(); state.blocks as usize];
        memory.blocks.read_with(0, BLOCK_BYTES * u64::from(state.blocks), BLOCK_BYTES, |first, bytes| {
            let part: &mut [u8] = bytemuck::cast_slice_mut(&mut blocks[first as usize..]);
            part[..bytes.len()].copy_from_slice(bytes);
        })?;
        let sah_cost = if state.root_area > 0.0 { f64::from(state.root_cost / state.root_area) } else { 0.0 };
        Ok(WideBvh { blocks, depth, bounds: Some(bounds), sah_cost })
    }

    /// Runs all passes for a binary tree of at most `max_height` inner nodes on a path.
    fn run(
        &self,
        commands: &mut Commands,
        memory: &mut BuildMemory,
        count: u32,
        max_height: u32,
        stats: &mut DeviceBuildStats,
    ) -> Result<BuildResult> {
        memory.start(count, max_height)?;
        let timings = commands.run(|r| self.record(r, memory, count))?;
        let bytes =
            memory.read_back.bytes().ok_or_else(|| Error::Vulkan("the read-back buffer is not mapped".into()))?;
        let (state, steps) = bytes.split_at(STATE_BYTES as usize);
        let steps: Vec<BuildStep> = bytemuck::pod_collect_to_vec(&steps[..(BUILD_STEPS as u64 * STEP_BYTES) as usize]);
        let busy = |first: u32| steps[first as usize..].iter().take_while(|s| s.groups[0] > 0).count() as u32;
        stats.add(busy(FIRST_ROUND), &timings);
        Ok(BuildResult { state: bytemuck::pod_read_unaligned(state), depth: busy(FIRST_LEVEL) })
    }

    /// Records all passes. Rounds and levels that are not needed have no work-groups.
    fn record(&self, r: &mut Recorder, memory: &BuildMemory, count: u32) {
        let push = |first: u32| Push { pass: memory.params.address(), first, ..Default::default() };
        let direct = |r: &mut Recorder, pass: &ComputePipeline, first: u32, size: u32| {
            r.dispatch_3d(pass, &push(first), tile_groups(count.div_ceil(size)));
            r.barrier();
        };
        let indirect = |r: &mut Recorder, pass: &ComputePipeline, first: u32, step: u32| {
            r.dispatch_indirect(pass, &push(first), &memory.state, STATE_BYTES + STEP_BYTES * u64::from(step));
            r.barrier();
        };
        r.timed(SORTING, |r| {
            direct(r, &self.bounds, 0, SORT_TILE);
            direct(r, &self.morton, 0, BUILD_LANES);
            for pass in 0..SORT_PASSES {
                self.sort.iter().for_each(|half| direct(r, half, pass, SORT_TILE));
            }
        });
        r.timed(CLUSTERING, |r| {
            for round in 0..MAX_ROUNDS {
                self.cluster.iter().for_each(|half| indirect(r, half, round, FIRST_ROUND + round));
            }
        });
        r.timed(EMITTING, |r| {
            (0..MAX_TREE_LEVELS).for_each(|level| indirect(r, &self.emit, level, FIRST_LEVEL + level));
        });
        r.copy(&memory.state, 0, &memory.read_back, 0, memory.state.size());
    }
}

const SORTING: &str = "sorting leaves";
const CLUSTERING: &str = "clustering";
const EMITTING: &str = "making wide nodes";

impl DeviceBuildStats {
    fn add(&mut self, rounds: u32, timings: &[Timing]) {
        let seconds = |label| timings.iter().filter(|t| t.label == label).map(|t| t.seconds).sum::<f64>();
        self.sort_seconds += seconds(SORTING);
        self.cluster_seconds += seconds(CLUSTERING);
        self.emit_seconds += seconds(EMITTING);
        self.rounds = rounds;
    }

    /// The counts in words; `None` where nothing was to be built.
    pub fn text(&self) -> Option<String> {
        let Self { trees, leaves, refused, .. } = self;
        let refused = if *refused > 0 { format!("; {refused} that it could not build") } else { String::new() };
        (self.trees + self.refused > 0).then(|| {
            format!(
                "BVHs built on the device: {trees}, over {leaves} leaves, in {:.1} ms{refused}",
                1e3 * self.seconds()
            )
        })
    }

    /// Seconds of the device.
    pub fn seconds(&self) -> f64 {
        self.sort_seconds + self.cluster_seconds + self.emit_seconds
    }
}

impl BuildMemory {
    fn new(device: &Arc<Device>, capacity: usize) -> Result<Self> {
        let leaves = capacity as u64;
        let tiles = [SORT_TILE, CLUSTER_TILE].map(|size| leaves.div_ceil(u64::from(size)));
        let buffer = |name: &str, count: u64, bytes: u64| {
            Buffer::new(device, &format!("builder's {name}"), count * bytes, Memory::Device)
        };
        let state = buffer("state", 1, STATE_BYTES + STEP_BYTES * u64::from(BUILD_STEPS))?;
        Ok(Self {
            capacity,
            nodes: buffer("nodes", 2 * leaves, size_of::<BuildNode>() as u64)?,
            inners: buffer("inner nodes", leaves, size_of::<BuildInner>() as u64)?,
            pairs: [buffer("pairs", leaves, 8)?, buffer("pairs", leaves, 8)?],
            counts: buffer("counts", (tiles[0] * u64::from(SORT_DIGITS)).max(2 * tiles[1]), 4)?,
            leaves: buffer("leaves", leaves, BLOCK_BYTES)?,
            blocks: buffer("blocks", 2 * leaves, BLOCK_BYTES)?,
            read_back: state.sibling("builder's result", Memory::Readback)?,
            state,
            params: buffer("parameters", 1, size_of::<BuildParams>() as u64)?,
        })
    }

    /// Writes leaves and parameters.
    fn write(&mut self, boxes: &[Aabb], scale: f32, leaf: impl Fn(u32) -> Block + Sync) -> Result<()> {
        let count = boxes.len() as u32;
        let node = |i: u32| {
            let b = &boxes[i as usize];
            BuildNode { min: b.min.to_array(), choices: 0, max: b.max.to_array(), blocks: 1 }
        };
        fill(&mut self.nodes, count, node)?;
        fill(&mut self.leaves, count, leaf)?;
        let params = BuildParams {
            state: self.state.address(),
            steps: self.state.address() + STATE_BYTES,
            nodes: self.nodes.address(),
            inners: self.inners.address(),
            pairs: [self.pairs[0].address(), self.pairs[1].address()],
            counts: self.counts.address(),
            leaves: self.leaves.address(),
            blocks: self.blocks.address(),
            count,
            scale,
        };
        self.params.write(0, bytemuck::bytes_of(&params))
    }

    /// Writes the state before the first pass: all clusters are in the first round, and the root is
    /// in the first level.
    fn start(&mut self, count: u32, max_height: u32) -> Result<()> {
        let state = BuildState { low: [u32::MAX; 3], max_height, ..Default::default() };
        let mut steps = [BuildStep { groups: [0, 1, 1], ..Default::default() }; BUILD_STEPS as usize];
        steps[FIRST_LEVEL as usize].groups[0] = 1;
        if count > 1 {
            steps[FIRST_ROUND as usize] =
                BuildStep { groups: tile_groups(count.div_ceil(CLUSTER_TILE)), count, ..Default::default() };
        }
        self.state.write(0, &[bytemuck::bytes_of(&state), bytemuck::cast_slice(&steps)].concat())
    }
}

/// Writes an array of records, in parallel.
fn fill<T: bytemuck::NoUninit>(buffer: &mut Buffer, count: u32, record: impl Fn(u32) -> T + Sync) -> Result<()> {
    let size = size_of::<T>();
    buffer.fill(size as u64 * u64::from(count), size as u64, |first, bytes| {
        bytes.par_chunks_exact_mut(size).with_min_len(1 << 12).enumerate().for_each(|(k, out)| {
            out.copy_from_slice(bytemuck::bytes_of(&record(first as u32 + k as u32)));
        });
    })
}
