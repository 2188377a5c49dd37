//! Trees of two boxes a node: any number of boxes, order along axes, and damage that is noticed.

use glam::Vec3;
use skylit::accel::bvh2::{Bvh2, EMPTY, inner_node, rebase};
use skylit::accel::{Aabb, BuildPreset};
use skylit::interface::records::hierarchy::AXIS_SHIFT;

fn boxes(n: usize, place: impl Fn(usize) -> Vec3, size: impl Fn(usize) -> f32) -> Vec<Aabb> {
    (0..n).map(|i| Aabb { min: place(i) - size(i), max: place(i) + size(i) }).collect()
}

#[test]
fn trees_of_every_small_size_are_valid() {
    for n in 0..70 {
        let b = boxes(
            n,
            |i| Vec3::new((i * 37 % 101) as f32, (i * 61 % 89) as f32, (i * 17 % 97) as f32),
            |i| 0.1 + i as f32 * 0.01,
        );
        for max_leaf in [1, 3, 8] {
            let tree = Bvh2::build(&b, BuildPreset::Default, max_leaf);
            tree.validate(&b).unwrap_or_else(|e| panic!("{n} boxes, leaf {max_leaf}: {e}"));
        }
    }
}

/// Two clusters apart along one axis only: the root must say so, whichever of them the builder
/// put first.
#[test]
fn a_reference_names_the_axis_that_separates() {
    for axis in 0..3 {
        let place = |i: usize| {
            let mut p = Vec3::new((i % 3) as f32, (i % 5) as f32, (i % 7) as f32);
            p[axis] += if i.is_multiple_of(2) { 1000.0 } else { 0.0 };
            p
        };
        let b = boxes(40, place, |_| 0.3);
        let tree = Bvh2::build(&b, BuildPreset::Default, 2);
        tree.validate(&b).unwrap();
        assert_eq!(inner_node(tree.root), Some((0, axis)));
        assert!(tree.nodes[0].boxes[0][1][axis] < 500.0 && tree.nodes[0].boxes[1][0][axis] > 500.0);
        // a rebased reference keeps its axis
        assert_eq!(inner_node(rebase(tree.root, 77, 5)), Some((77, axis)));
    }
    assert_eq!(inner_node(EMPTY), None);
}

#[test]
fn coincident_boxes_are_valid() {
    let b = boxes(1000, |_| Vec3::ONE, |_| 0.5);
    Bvh2::build(&b, BuildPreset::Fast, 4).validate(&b).unwrap();
}

#[test]
fn validate_sees_damage() {
    let b = boxes(50, |i| Vec3::splat(i as f32), |_| 0.4);
    let good = Bvh2::build(&b, BuildPreset::Default, 2);
    let mut bad = good.clone();
    bad.nodes[0].boxes[0][1][0] -= 30.0;
    assert!(bad.validate(&b).is_err());
    let mut bad = good.clone();
    bad.primitives[3] = bad.primitives[4];
    assert!(bad.validate(&b).is_err());
    let mut bad = good.clone();
    bad.depth += 1;
    assert!(bad.validate(&b).is_err());
    let mut bad = good.clone();
    bad.nodes[0].boxes.reverse();
    bad.nodes[0].children.reverse();
    assert!(bad.validate(&b).unwrap_err().contains("order"));
    let mut bad = good;
    bad.root += 3 << AXIS_SHIFT;
    assert!(bad.validate(&b).is_err());
}
