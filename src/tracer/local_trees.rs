//! Trees of influence areas for the binary kernels (`shaders/trace/areas.glsl`), built by the rules
//! of the laboratory and laid out behind the trees of the scene.
//!
//! Hits are those of the scene's own trees, bit for bit. A primitive is tested in its group's space
//! by the same arithmetic, and a tree is complete over more space than a ray is asked in. The area
//! that a device sees is half of [`MARGIN`] larger than the one given, and its tree holds what lies
//! within all of it; rounding moves a point by less than a hundredth of that.

use std::sync::Arc;

use glam::DVec3;

use super::hierarchy::record;
use super::kernel::LocalOptions;
use super::transform::instance_padding;
use crate::accel::flatten::FlatScene;
use crate::accel::lab::influence::{InfluenceArea, areas_of_scene};
use crate::accel::lab::local::{Cell, Octree, local_tree};
use crate::accel::lab::{Body, Heuristic, RayDistribution};
use crate::accel::{Aabb, Bvh2};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Device};
use crate::interface::records::hierarchy::{AreaRecord, AreasRecord, DIVIDED, TriangleRecord};

/// Distance by which trees reach beyond their areas, as a share of the largest coordinate of the
/// area or of the scene.
const MARGIN: f64 = 1e-5;

/// Areas from which on an octree finds those of a ray.
const OCTREE_AREAS: usize = 8;

/// Primitives over all instances that local trees are built over at most.
const MAX_PLACED: usize = 1 << 25;

/// Trees of influence areas on the host.
pub(super) struct LocalTrees {
    areas: Vec<InfluenceArea>,
    trees: Vec<Bvh2>,
    /// Instance and primitive in its group, of each primitive that leaves refer to.
    owners: Vec<[u32; 2]>,
    /// Distance within which a point counts as that of an area's rays.
    near: f64,
}

/// Influence areas in device memory.
pub(super) struct AreaBuffers {
    /// The `AreasRecord`.
    pub root: Buffer,
    // it holds their addresses
    others: Vec<Buffer>,
    pub count: u32,
    pub primitives: u64,
}

impl AreaBuffers {
    pub fn bytes(&self) -> u64 {
        self.root.size() + self.others.iter().map(Buffer::size).sum::<u64>()
    }
}

impl LocalTrees {
    /// Builds a tree for each area of the options; `None` where there is no area.
    ///
    /// # Errors
    /// [`Error::Scene`] for scenes of too many primitives, and of spheres that an instance
    /// stretches.
    pub fn build(flat: &FlatScene, options: &LocalOptions, max_leaf: u32) -> Result<Option<Self>> {
        let counts = flat.instances.iter().map(|i| flat.groups[i.group].primitive_count);
        let placed: usize = counts.clone().sum();
        if placed > MAX_PLACED {
            return Err(Error::Scene(format!(
                "{placed} primitives over all instances are too many for trees of influence areas, which take \
                 {MAX_PLACED}: leave out --build-areas"
            )));
        }
        let areas = match &options.areas {
            Some(areas) => areas.iter().map(|a| a.relative_to(flat.origin)).collect(),
            None => {
                let cameras: Vec<_> = flat.scene.cameras.iter().chain(&options.camera).cloned().collect();
                areas_of_scene(flat.scene, &cameras, flat.origin)
            }
        };

        // primitives in world space; boxes cover the rounding of rays on their way to groups
        let body = Body::from_scene(flat)?;
        let bounds = flat.bounds();
        let reach = bounds.min.abs().max(bounds.max.abs()).max_element().max(0.0);
        let pad = if flat.is_single_level() { 0.0 } else { instance_padding(reach) };
        let grown = |b: Aabb| Aabb { min: b.min - pad, max: b.max + pad };
        let boxes: Vec<Aabb> = body.boxes().into_iter().map(grown).collect();
        let owners = counts.enumerate().flat_map(|(k, n)| (0..n as u32).map(move |p| [k as u32, p])).collect();

        // the trees, over a little more than what devices see of the areas
        let heuristic = capped(options.heuristic, max_leaf);
        let margin = MARGIN * areas.iter().map(|a| a.region.reach()).fold(f64::from(reach), f64::max);
        let tree = |area: &InfluenceArea| {
            let region = area.region.widened(margin + f64::from(pad));
            Bvh2::from_tree(local_tree(&body, &boxes, &InfluenceArea { region, ..area.clone() }, &heuristic))
        };
        let trees: Vec<Bvh2> = areas.iter().map(tree).collect();
        let trees = Self { trees, owners, near: 0.5 * margin, areas };
        Ok(Some(trees).filter(|t| !t.areas.is_empty()))
    }

    /// Deepest tree: inner nodes on the longest path.
    pub fn depth(&self) -> u32 {
        self.trees.iter().map(|t| t.depth).max().unwrap_or(0)
    }

    /// The trees.
    pub fn trees(&self) -> &[Bvh2] {
        &self.trees
    }

    /// The records of all primitives of the trees, tree by tree.
    pub fn records<'a>(&'a self, flat: &'a FlatScene) -> impl Iterator<Item = TriangleRecord> + 'a {
        let groups = flat.instances.iter().map(|i| &flat.groups[i.group]).collect::<Vec<_>>();
        self.slots().map(move |[instance, primitive]| record(flat, groups[instance as usize], primitive))
    }

    /// Instance and primitive of each slot of the trees.
    fn slots(&self) -> impl Iterator<Item = [u32; 2]> {
        self.trees.iter().flat_map(|t| t.primitives.iter().map(|&p| self.owners[p as usize]))
    }

    /// Writes the areas to device memory. `roots` are the references of the trees' roots, whose
    /// primitives begin at `first_primitive`.
    pub fn upload(&self, device: &Arc<Device>, roots: &[u32], first_primitive: u32) -> Result<AreaBuffers> {
        let mut others = Vec::new();
        let mut keep = |buffer: Result<Buffer>| {
            let buffer = buffer?;
            let address = buffer.address();
            others.push(buffer);
            Ok::<_, Error>(address)
        };

        // the areas, as devices see them
        let records: Vec<AreaRecord> =
            self.areas.iter().zip(roots).map(|(area, &root)| area_record(area, root, self.near)).collect();
        let instances: Vec<u32> = self.slots().map(|s| s[0]).collect();
        let mut root = AreasRecord {
            areas: keep(Buffer::from_slice(device, "influence areas", &records))?,
            count: records.len() as u32,
            first_primitive,
            ..Default::default()
        };
        if !instances.is_empty() {
            root.instances = keep(Buffer::from_slice(device, "instances of local trees", &instances))?;
        }

        // how a ray's area is found
        if self.areas.len() >= OCTREE_AREAS {
            let octree = Octree::build(&self.areas);
            let (cells, members) = flattened(&octree.cells);
            root.bounds_min = octree.bounds.min.extend(0.0).to_array();
            root.bounds_max = octree.bounds.max.extend(0.0).to_array();
            root.cells = keep(Buffer::from_slice(device, "cells of influence areas", &cells))?;
            root.members = keep(Buffer::from_slice(device, "influence areas of cells", &members))?;
        }
        let root = Buffer::from_slice(device, "influence areas' root", &[root])?;
        Ok(AreaBuffers { root, others, count: records.len() as u32, primitives: instances.len() as u64 })
    }
}

/// Rules whose leaves the binary kernel can hold.
fn capped(mut heuristic: Heuristic, max_leaf: u32) -> Heuristic {
    let stop = &mut heuristic.stop;
    (stop.at_most, stop.by_cost) = (stop.at_most.min(max_leaf), stop.by_cost.min(max_leaf));
    heuristic
}

/// An area that is larger by `near`, so that the point of a camera is inside after rounding.
fn area_record(area: &InfluenceArea, root: u32, near: f64) -> AreaRecord {
    let bounds = area.region.widened(near).bounds();
    let (rays, point) = match area.rays {
        RayDistribution::Parallel(direction) => (direction.normalize(), 0.0),
        RayDistribution::Point(eye) => (eye, 1.0),
        RayDistribution::View(view) => (view.eye, 1.0),
        RayDistribution::Uniform => (DVec3::ZERO, 0.0),
    };
    AreaRecord {
        planes: area.region.planes().map(|(n, d)| n.as_vec3().extend((d + near) as f32).to_array()),
        rays: rays.as_vec3().extend(point).to_array(),
        bounds_min: bounds.min.extend((area.agreement * area.agreement) as f32).to_array(),
        bounds_max: bounds.max.extend((near * near) as f32).to_array(),
        root,
        ..Default::default()
    }
}

/// Cells of an octree as devices read them, and the areas that they refer to.
fn flattened(cells: &[Cell]) -> (Vec<[u32; 2]>, Vec<u32>) {
    let mut members: Vec<u32> = Vec::new();
    let cell = |cell: &Cell| match cell {
        Cell::Divided(first) => [DIVIDED | *first as u32, 0],
        Cell::Leaf(areas) => {
            let first = members.len() as u32;
            members.extend(areas);
            [first, areas.len() as u32]
        }
    };
    let cells = cells.iter().map(cell).collect();
    // a buffer has a size
    if members.is_empty() {
        members.push(0);
    }
    (cells, members)
}
