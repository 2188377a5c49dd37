//! The binary BVHs of the compute tracer's simple kernel (`shaders/trace/reference.glsl`): one per
//! group, one over the instances, and those of influence areas, in one node array.

use std::sync::Arc;

use super::boxes::{instance_boxes, padding, primitive_boxes, scene_bounds};
use super::hierarchy::{Hierarchy, record, unfinished_counter};
use super::kernel::{BuildOptions, Kernel};
use super::local_trees::LocalTrees;
use super::stream::LaunchMemory;
use super::upload::write_records;
use crate::accel::build::MAX_DEPTH;
use crate::accel::flatten::FlatScene;
use crate::accel::lab::builder::MAX_LEAF;
use crate::accel::{Aabb, Bvh2, bvh2};
use crate::error::{Error, Result};
use crate::gpu::Device;

/// The trees on the host.
pub(super) struct Trees {
    groups: Vec<Bvh2>,
    top: Option<Bvh2>,
    /// Trees of influence areas.
    local: Option<LocalTrees>,
}

impl Trees {
    pub fn build(flat: &FlatScene, options: &BuildOptions) -> Result<Self> {
        let (mut groups, mut bounds) = (Vec::new(), Vec::new());
        for (k, g) in flat.groups.iter().enumerate() {
            let boxes: Vec<_> = primitive_boxes(flat, g).collect();
            bounds.push(boxes.iter().copied().fold(Aabb::EMPTY, Aabb::union));
            let builder = options.builder(flat, boxes.len()).for_group(flat.instances.iter().filter(|i| i.group == k));
            groups.push(Bvh2::from_tree(builder.tree(&boxes, MAX_LEAF)));
        }
        let mut top = None;
        if !flat.is_single_level() {
            let boxes = instance_boxes(flat, &bounds);
            // a leaf of the top level holds one instance, because traversal continues in the
            // instance's own BVH
            top = Some(Bvh2::from_tree(options.builder(flat, boxes.len()).tree(&boxes, 1)));
        }
        let local = options.local.as_ref().map(|o| LocalTrees::build(flat, o, MAX_LEAF)).transpose()?.flatten();
        Ok(Self { groups, top, local })
    }

    pub fn upload(self, device: &Arc<Device>, flat: &FlatScene, kernel: Kernel) -> Result<Hierarchy> {
        let group_depth = self.groups.iter().map(|g| g.depth).max().unwrap_or(0);
        // every node visit pushes at most one entry, entering a TLAS instance the way back
        let whole_depth = self.top.as_ref().map_or(0, |top| top.depth + 1) + group_depth;
        let stack_entries = whole_depth.max(self.local.as_ref().map_or(0, LocalTrees::depth));
        debug_assert!(stack_entries <= 2 * MAX_DEPTH + 1);

        // the top level first: it is visited by every ray; trees of influence areas last
        let local = self.local.as_ref().map_or(&[][..], LocalTrees::trees);
        let mut bases = Vec::new();
        let (mut node, mut primitive) = (self.top.as_ref().map_or(0, |t| t.nodes.len()), 0);
        for tree in self.groups.iter().chain(local) {
            bases.push((node as u32, primitive as u32));
            node += tree.nodes.len();
            primitive += tree.primitives.len();
        }
        if primitive.max(node) > bvh2::MAX_PRIMITIVES {
            return Err(Error::Scene(format!(
                "{primitive} primitives in all trees are too many: the compute tracer takes at most {}; leave out \
                 --build-areas",
                bvh2::MAX_PRIMITIVES
            )));
        }
        let trees = || self.groups.iter().chain(local).zip(&bases);
        let roots: Vec<_> = trees().map(|(g, b)| bvh2::rebase(g.root, b.0, b.1)).collect();
        let root = match &self.top {
            Some(top) => top_reference(top, top.root),
            None => roots.first().copied().unwrap_or(bvh2::EMPTY),
        };
        let top_nodes = self.top.iter().flat_map(|t| padded(t, |c| top_reference(t, c)));
        let nodes = trees().flat_map(|(t, b)| padded(t, move |c| bvh2::rebase(c, b.0, b.1)));

        // into device memory
        let nodes = write_records(device, "hierarchy nodes", node as u64, &mut top_nodes.chain(nodes))?;
        let own = self.groups.iter().zip(&flat.groups);
        let own = own.flat_map(|(t, group)| t.primitives.iter().map(move |&p| record(flat, group, p)));
        let mut records = own.chain(self.local.iter().flat_map(|l| l.records(flat)));
        let primitives = write_records(device, "hierarchy primitives", primitive as u64, &mut records)?;
        let groups = self.groups.len();
        let areas = self.local.as_ref().map(|l| l.upload(device, &roots[groups..], bases[groups].1)).transpose()?;
        Ok(Hierarchy {
            kernel,
            nodes,
            primitives: Some(primitives),
            root,
            instance_roots: flat.instances.iter().map(|p| roots[p.group]).collect(),
            stack_entries,
            bounds: scene_bounds(flat),
            unfinished: unfinished_counter(device)?,
            few: None,
            launch: LaunchMemory::new(device, None)?,
            dynamic: None,
            builder: None,
            areas,
        })
    }
}

/// The reference of a top-level node, with a leaf referring to its instance directly.
fn top_reference(top: &Bvh2, reference: u32) -> u32 {
    match bvh2::leaf_range(reference) {
        Some((slot, _)) => reference - slot + top.primitives[slot as usize],
        None => reference,
    }
}

/// A tree's nodes with padded boxes and changed references.
fn padded<'a>(tree: &'a Bvh2, change: impl Fn(u32) -> u32 + 'a) -> impl Iterator<Item = bvh2::BinaryNode> + 'a {
    let root = tree.nodes.first().map(|n| n.boxes.map(|b| Aabb { min: b[0].into(), max: b[1].into() }));
    let pad = padding(root.iter().flatten());
    tree.nodes.iter().map(move |n| bvh2::BinaryNode {
        boxes: n.boxes.map(|[lo, hi]| [lo.map(|x| x - pad), hi.map(|x| x + pad)]),
        children: n.children.map(&change),
        ..*n
    })
}
