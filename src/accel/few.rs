//! The leaves of a tree that has few, with their boxes side by side: small scenes are traced
//! against all of them, without a hierarchy (`shaders/trace/few.glsl`).

use glam::{DVec3, Vec3};

use super::Aabb;
use super::wide::{self, Block, WideBvh};
use crate::interface::records::hierarchy::{SPHERE, SphereLeaf, TriangleLeaf};

/// Maximum number of leaves: each ray has a bit for each of them.
pub const MAX_LEAVES: usize = 32;

/// Leaves that come in pairs are read together; an odd one is there twice.
const GRAIN: usize = 2;

/// A leaf's box: lower corner, upper corner, the instance in the top level that the leaf belongs to
/// (an integer in the bits), and padding.
type LeafBox = [f32; 8];

/// The leaves of trees whose space is the world's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FewLeaves {
    /// Their blocks; an even number.
    pub leaves: Vec<Block>,
    /// Their boxes.
    pub boxes: Vec<LeafBox>,
    /// A bit for each: its triangles lie in one plane, so that no ray that starts on one of them
    /// meets another.
    pub flat: u32,
}

impl FewLeaves {
    /// Collects the leaves of the trees over primitives of instances in the top level, in their
    /// order; `None` if there is none, or more than [`MAX_LEAVES`]. `pad`: how much wider than its
    /// primitives a box is on all sides.
    pub fn collect<'a>(trees: impl IntoIterator<Item = &'a WideBvh>, pad: f32) -> Option<Self> {
        let mut few = Self::default();
        for (instance, tree) in (0..).zip(trees) {
            few.add(tree, instance, pad)?;
            if few.leaves.len() > MAX_LEAVES {
                return None;
            }
        }

        // whole grains, by leaves that are there already
        let (leaf, leaf_box) = (*few.leaves.first()?, *few.boxes.first()?);
        few.leaves.resize(few.leaves.len().next_multiple_of(GRAIN), leaf);
        few.boxes.resize(few.leaves.len(), leaf_box);
        few.flat = (0..).zip(&few.leaves).map(|(k, leaf)| u32::from(is_flat(leaf)) << k).sum();
        Some(few)
    }

    /// Adds the leaves of a tree, if it may have few enough.
    fn add(&mut self, tree: &WideBvh, instance: u32, pad: f32) -> Option<()> {
        if tree.blocks.len() > 2 * MAX_LEAVES {
            return None;
        }
        for node in tree.blocks.iter().filter(|b| !wide::is_leaf(b)) {
            for (slot, child) in wide::children(node) {
                let block = tree.blocks.get(child as usize)?;
                if wide::is_leaf(block) {
                    // planes of the node have eight bits, but a leaf may hold a part of its
                    // primitives only
                    let (planes, all) = (wide::child_box(node, slot), bounds(block));
                    self.leaves.push(*block);
                    self.boxes.push(std::array::from_fn(|k| match k {
                        0..3 => rounded_down(planes[k][0]).max(all.min[k] - pad),
                        3..6 => (-rounded_down(-planes[k - 3][1])).min(all.max[k - 3] + pad),
                        6 => f32::from_bits(instance),
                        _ => 0.0,
                    }));
                }
            }
        }
        Some(())
    }

    /// As shaders read them: the leaves, then the boxes.
    pub fn bytes(&self) -> Vec<u8> {
        [bytemuck::cast_slice(&self.leaves), bytemuck::cast_slice::<LeafBox, u8>(&self.boxes)].concat()
    }
}

/// Bounds of the primitives of a leaf.
fn bounds(leaf: &Block) -> Aabb {
    let (triangles, sphere): (&TriangleLeaf, &SphereLeaf) = (bytemuck::cast_ref(leaf), bytemuck::cast_ref(leaf));
    if triangles.primitives[0] & SPHERE != 0 {
        let (center, radius) = (Vec3::from_array(sphere.center), sphere.radius);
        return Aabb { min: center - radius, max: center + radius };
    }
    let corners = triangles.corners.map(Vec3::from_array);
    let fold = |f: fn(Vec3, Vec3) -> Vec3| corners.into_iter().fold(corners[0], f);
    Aabb { min: fold(Vec3::min), max: fold(Vec3::max) }
}

/// Do the triangles of a leaf lie in one plane? False where it holds a sphere.
fn is_flat(leaf: &Block) -> bool {
    let leaf: &TriangleLeaf = bytemuck::cast_ref(leaf);
    let [a, b, c, d] = leaf.corners.map(|corner| DVec3::from_array(corner.map(f64::from)));
    // of a single triangle the fourth corner is the third; what is no number is not 0
    leaf.primitives[0] & SPHERE == 0 && (b - a).cross(c - a).dot(d - a) == 0.0
}

/// The largest float that is not above a number.
fn rounded_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x { nearest.next_down() } else { nearest }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::{BuildPreset, build};

    /// A tree over triangles in boxes, whose leaves name their number.
    fn tree(n: usize) -> (Vec<Aabb>, WideBvh) {
        let boxes = wide::tests::boxes(n, 0.37, -11.3);
        let leaf = |item: u32| {
            let Aabb { min, max } = boxes[item as usize];
            let corners = [min, max, Vec3::new(min.x, max.y, min.z), max].map(|corner| corner.to_array());
            bytemuck::cast(TriangleLeaf { corners, primitives: [item, u32::MAX], order: 0, flags: 0 })
        };
        let tree = WideBvh::collapse(&build::tree(&boxes, BuildPreset::Default, None), leaf);
        (boxes, tree)
    }

    fn collect(trees: &[&WideBvh]) -> Option<FewLeaves> {
        FewLeaves::collect(trees.iter().copied(), 0.0)
    }

    /// Every leaf is there, within a box that its item just fits in, and never an odd number of
    /// them.
    #[test]
    fn leaves_are_whole_and_fit_their_boxes() {
        for n in [1, 2, 3, 7, 8, 31, 32] {
            let (boxes, tree) = tree(n);
            let few = collect(&[&tree]).expect("few");
            assert_eq!((few.leaves.len(), few.boxes.len()), (n.next_multiple_of(2), n.next_multiple_of(2)));
            assert_eq!(few.bytes().len(), few.leaves.len() * 96);
            let mut seen = vec![0; n];
            for (leaf, b) in few.leaves.iter().zip(&few.boxes) {
                let item = bytemuck::cast_ref::<Block, TriangleLeaf>(leaf).primitives[0] as usize;
                seen[item] += 1;
                let (min, max) = (boxes[item].min.to_array(), boxes[item].max.to_array());
                assert_eq!((&b[..3], &b[3..6]), (&min[..], &max[..]), "{n} {item}");
            }
            assert!(seen.iter().all(|&times| times >= 1), "{n}: {seen:?}");
        }
    }

    #[test]
    fn boxes_are_padded_but_within_those_of_their_nodes() {
        let (boxes, tree) = tree(8);
        let [tight, wide] = [1e-3, 1e6].map(|pad| FewLeaves::collect([&tree], pad).expect("few"));
        for ((leaf, tight), wide) in tight.leaves.iter().zip(&tight.boxes).zip(&wide.boxes) {
            let item = bytemuck::cast_ref::<Block, TriangleLeaf>(leaf).primitives[0] as usize;
            assert!((0..3).all(|k| tight[k] <= boxes[item].min[k] && tight[k + 3] >= boxes[item].max[k]));
            assert!((0..3).all(|k| wide[k] <= tight[k] && wide[k + 3] >= tight[k + 3] && wide[k + 3] < 1e3));
        }
    }

    #[test]
    fn none_of_empty_and_of_larger_trees() {
        assert_eq!(collect(&[&WideBvh::default()]), None);
        assert_eq!(collect(&[]), None);
        assert_eq!(collect(&[&tree(MAX_LEAVES + 1).1]), None);
        assert_eq!(collect(&[&tree(MAX_LEAVES).1, &tree(1).1]), None);
    }

    #[test]
    fn leaves_name_their_instances() {
        let few = collect(&[&tree(3).1, &tree(2).1]).expect("few");
        let instances: Vec<u32> = few.boxes.iter().map(|b| b[6].to_bits()).collect();
        // the last is the first again
        assert_eq!(instances, [0, 0, 0, 1, 1, 0]);
    }

    #[test]
    fn spheres_have_boxes_and_are_not_flat() {
        let sphere =
            SphereLeaf { center: [1.0, 2.0, 3.0], radius: 0.5, primitives: [SPHERE, u32::MAX], ..Default::default() };
        let leaf: Block = bytemuck::cast(sphere);
        assert_eq!(bounds(&leaf), Aabb { min: Vec3::new(0.5, 1.5, 2.5), max: Vec3::new(1.5, 2.5, 3.5) });
        assert!(!is_flat(&leaf));
    }

    #[test]
    fn flat_leaves_are_known() {
        let leaf = |fourth: [f32; 3], flags: u32| -> Block {
            let corners = [[0.1, 0.0, 0.3], [0.7, 0.0, 0.3], [0.7, 0.9, 0.3], fourth];
            bytemuck::cast(TriangleLeaf { corners, primitives: [flags, 1], order: 0, flags: 0 })
        };
        assert!(is_flat(&leaf([0.1, 0.9, 0.3], 0)) && is_flat(&leaf([0.7, 0.9, 0.3], 0)));
        assert!(!is_flat(&leaf([0.1, 0.9, 0.300_000_04], 0)) && !is_flat(&leaf([0.1, 0.9, f32::NAN], 0)));
        assert!(!is_flat(&leaf([0.1, 0.9, 0.3], SPHERE)));
    }

    #[test]
    fn corners_are_rounded_outwards() {
        let x = 1.0 + f64::from(f32::EPSILON) * 0.75;
        assert_eq!((rounded_down(x), rounded_down(-x)), (1.0, -1.0 - f32::EPSILON));
        assert_eq!(rounded_down(0.5), 0.5);
    }
}
