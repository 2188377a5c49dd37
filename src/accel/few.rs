//! The leaves of a tree that has few, with their boxes side by side: small scenes are traced
//! against all of them, without a hierarchy (`shaders/trace/few.glsl`).

use super::wide::{self, Block, WideBvh};

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
}

impl FewLeaves {
    /// Collects the leaves of the trees over primitives of instances in the top level, in their
    /// order; `None` if there is none, or more than [`MAX_LEAVES`].
    pub fn collect<'a>(trees: impl IntoIterator<Item = &'a WideBvh>) -> Option<Self> {
        let mut few = Self::default();
        for (instance, tree) in (0..).zip(trees) {
            few.add(tree, instance)?;
            if few.leaves.len() > MAX_LEAVES {
                return None;
            }
        }

        // whole grains, by leaves that are there already
        let (leaf, leaf_box) = (*few.leaves.first()?, *few.boxes.first()?);
        few.leaves.resize(few.leaves.len().next_multiple_of(GRAIN), leaf);
        few.boxes.resize(few.leaves.len(), leaf_box);
        Some(few)
    }

    /// Adds the leaves of a tree, if it may have few enough.
    fn add(&mut self, tree: &WideBvh, instance: u32) -> Option<()> {
        if tree.blocks.len() > 2 * MAX_LEAVES {
            return None;
        }
        for node in tree.blocks.iter().filter(|b| !wide::is_leaf(b)) {
            for (slot, child) in wide::children(node) {
                let block = tree.blocks.get(child as usize)?;
                if wide::is_leaf(block) {
                    let planes = wide::child_box(node, slot);
                    self.leaves.push(*block);
                    self.boxes.push(std::array::from_fn(|k| match k {
                        0..3 => rounded_down(planes[k][0]),
                        3..6 => -rounded_down(-planes[k - 3][1]),
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

/// The largest float that is not above a number.
fn rounded_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x { nearest.next_down() } else { nearest }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::{Aabb, BuildPreset, build};

    fn tree(n: usize) -> (Vec<Aabb>, WideBvh) {
        let boxes = wide::tests::boxes(n, 0.37, -11.3);
        let tree = WideBvh::collapse(&build::tree(&boxes, BuildPreset::Default, None), wide::tests::of_item);
        (boxes, tree)
    }

    /// Every leaf is there, within a box that its item lies in, and never an odd number of them.
    #[test]
    fn leaves_are_whole_and_within_their_boxes() {
        for n in [1, 2, 3, 7, 8, 31, 32] {
            let (boxes, tree) = tree(n);
            let few = FewLeaves::collect([&tree]).expect("few");
            assert_eq!((few.leaves.len(), few.boxes.len()), (n.next_multiple_of(2), n.next_multiple_of(2)));
            assert_eq!(few.bytes().len(), few.leaves.len() * 96);
            let mut seen = vec![0; n];
            for (leaf, b) in few.leaves.iter().zip(&few.boxes) {
                let item = leaf.body[0] as usize;
                seen[item] += 1;
                let (min, max) = (boxes[item].min.to_array(), boxes[item].max.to_array());
                assert!((0..3).all(|k| b[k] <= min[k] && b[k + 3] >= max[k]), "{n} {item}: {b:?}");
            }
            assert!(seen.iter().all(|&times| times >= 1), "{n}: {seen:?}");
        }
    }

    #[test]
    fn none_of_empty_and_of_larger_trees() {
        assert_eq!(FewLeaves::collect([&WideBvh::default()]), None);
        assert_eq!(FewLeaves::collect([]), None);
        assert_eq!(FewLeaves::collect([&tree(MAX_LEAVES + 1).1]), None);
        assert_eq!(FewLeaves::collect([&tree(MAX_LEAVES).1, &tree(1).1]), None);
    }

    #[test]
    fn leaves_name_their_instances() {
        let few = FewLeaves::collect([&tree(3).1, &tree(2).1]).expect("few");
        let instances: Vec<u32> = few.boxes.iter().map(|b| b[6].to_bits()).collect();
        // the last is the first again
        assert_eq!(instances, [0, 0, 0, 1, 1, 0]);
    }

    #[test]
    fn corners_are_rounded_outwards() {
        let x = 1.0 + f64::from(f32::EPSILON) * 0.75;
        assert_eq!((rounded_down(x), rounded_down(-x)), (1.0, -1.0 - f32::EPSILON));
        assert_eq!(rounded_down(0.5), 0.5);
    }
}
