//! Bounds of a scene: those of its vertices and spheres, however instances turn them.
//!
//! The box around a mesh's box is too large where an instance turns it, by up to the square root of
//! three along each axis. So such instances count by their vertices, but only those whose box
//! reaches beyond what is known: few of a million.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{DAffine3, DVec3, Vec3, Vec4};
use rayon::prelude::*;

use super::{Geometry, Instance, Scene, Sphere, TriangleMesh};

/// Least number of instances or triangles of a parallel task.
const BLOCK: usize = 8192;
/// Number of instances that are looked at one after the other, for each raises what is known.
const FURTHEST: usize = 256;
/// Number of instances of a mesh whose vertices are all looked at, before a hierarchy is built of
/// them.
const LOOKED_AT: usize = 16;
/// Maximum number of points below a node of that hierarchy.
const LEAF: usize = 32;
/// Share of a box's extent along an axis of the world below which it does not count that the box is
/// turned: exporters' rotations by quarter turns have such numbers for zeros.
const ROUNDING: f64 = 1e-9;

/// The greatest x, y and z, and the greatest -x, -y and -z.
type Extremes = [f64; 6];

const NOTHING: Extremes = [f64::NEG_INFINITY; 6];

fn union(a: Extremes, b: Extremes) -> Extremes {
    std::array::from_fn(|k| a[k].max(b[k]))
}

/// World-space bounds `(min, max)` over all instances but those of a mesh, or `None` without
/// geometry.
pub(super) fn of_scene(scene: &Scene, but: Option<usize>) -> Option<(DVec3, DVec3)> {
    let shapes: Vec<Option<Shape>> = scene.meshes.par_iter().map(|m| Shape::new(&m.geometry)).collect();
    let shape_of = |i: &Instance| shapes[i.mesh].as_ref().filter(|_| Some(i.mesh) != but);
    let blocks = || scene.instances.par_iter().with_min_len(BLOCK);

    // What is certain: boxes that are not turned, and some points of each other mesh.
    let certain = |(known, is_turned): (Extremes, bool), i: &Instance| {
        let Some(shape) = shape_of(i) else { return (known, is_turned) };
        let placed = PlacedBox::new(shape, &i.object_to_world);
        let boxed =
            std::array::from_fn(|k| if placed.is_turned[k % 3] { f64::NEG_INFINITY } else { placed.extremes[k] });
        let known = union(known, boxed);
        if placed.is_turned.contains(&true) {
            (shape.touching().iter().map(|p| shape.extremes_of(p, &i.object_to_world)).fold(known, union), true)
        } else {
            (known, is_turned)
        }
    };
    let none = || (NOTHING, false);
    let (known, is_turned) = blocks().fold(none, certain).reduce(none, |a, b| (union(a.0, b.0), a.1 || b.1));
    if !is_turned {
        return bounds(known);
    }

    // The turned instances that may reach beyond it, the furthest first: after those the others
    // hardly do.
    let excess = |i: &Instance| {
        let Some(shape) = shape_of(i) else { return 0.0 };
        let placed = PlacedBox::new(shape, &i.object_to_world);
        let reaches = placed.reaches(&known);
        (0..6).filter(|&k| reaches[k]).map(|k| placed.extremes[k] - known[k]).fold(0.0, f64::max)
    };
    let mut beyond: Vec<(f64, &Instance)> = blocks().map(|i| (excess(i), i)).filter(|(most, _)| *most > 0.0).collect();
    beyond.par_sort_by(|a, b| b.0.total_cmp(&a.0));
    let raise = |mut known: Extremes, (_, i): &(f64, &Instance)| {
        if let Some(shape) = shape_of(i) {
            let reaches = PlacedBox::new(shape, &i.object_to_world).reaches(&known);
            if reaches.contains(&true) {
                shape.raise(&i.object_to_world, reaches, &mut known);
            }
        }
        known
    };
    let (first, rest) = beyond.split_at(beyond.len().min(FURTHEST));
    let known = first.iter().fold(known, raise);
    bounds(rest.par_iter().with_min_len(BLOCK).fold(|| known, raise).reduce(|| known, union))
}

/// Corners of the box of these extremes; `None` where there are none.
fn bounds([x, y, z, low_x, low_y, low_z]: Extremes) -> Option<(DVec3, DVec3)> {
    x.is_finite().then(|| (-DVec3::new(low_x, low_y, low_z), DVec3::new(x, y, z)))
}

/// Row `k` of the matrix to world space, up to its third, and from then on of its negative.
fn row(to_world: &DAffine3, k: usize) -> DVec3 {
    let row = to_world.matrix3.row(k % 3);
    if k < 3 { row } else { -row }
}

/// Offset that is added to a product with a [`row`].
fn offset(to_world: &DAffine3, k: usize) -> f64 {
    if k < 3 { to_world.translation[k] } else { -to_world.translation[k - 3] }
}

/// The box of a mesh in world space.
struct PlacedBox {
    extremes: Extremes,
    /// For each axis of the world: whether the box may reach further along it than what it holds.
    is_turned: [bool; 3],
}

impl PlacedBox {
    fn new(shape: &Shape, to_world: &DAffine3) -> Self {
        let (lo, hi) = (shape.lo, shape.hi);
        let (mut extremes, mut is_turned) = (NOTHING, [false; 3]);
        for axis in 0..3 {
            let row = to_world.matrix3.row(axis);
            let (a, b) = (row * lo, row * hi);
            // in the order in which a point is transformed, so that it rounds alike
            let sum = |v: DVec3| v.x + v.y + v.z + to_world.translation[axis];
            (extremes[axis], extremes[axis + 3]) = (sum(a.max(b)), -sum(a.min(b)));
            let reach = (b - a).abs();
            is_turned[axis] = reach.max_element() < (1.0 - ROUNDING) * reach.element_sum();
        }
        Self { extremes, is_turned }
    }

    /// For each direction: whether it is turned and reaches beyond what is known.
    fn reaches(&self, known: &Extremes) -> [bool; 6] {
        std::array::from_fn(|k| self.is_turned[k % 3] && self.extremes[k] > known[k])
    }
}

/// A mesh, with what has been found out about it.
struct Shape<'a> {
    geometry: &'a Geometry,
    lo: DVec3,
    hi: DVec3,
    /// [`Shape::touching`], once an instance is turned.
    touching: OnceLock<[Vec4; 6]>,
    looked_at: AtomicUsize,
    hierarchy: OnceLock<Hierarchy>,
}

impl<'a> Shape<'a> {
    /// `None` for a mesh without primitives.
    fn new(geometry: &'a Geometry) -> Option<Self> {
        let none = || (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (lo, hi) = match geometry {
            Geometry::Triangles(t) => {
                let add = |(lo, hi): (Vec3, Vec3), triangle: &[u32; 3]| {
                    let [a, b, c] = triangle.map(|i| t.positions[i as usize]);
                    (lo.min(a).min(b).min(c), hi.max(a).max(b).max(c))
                };
                let union = |a: (Vec3, Vec3), b: (Vec3, Vec3)| (a.0.min(b.0), a.1.max(b.1));
                t.indices.par_iter().with_min_len(BLOCK).fold(none, add).reduce(none, union)
            }
            Geometry::Spheres(s) => {
                s.iter().fold(none(), |(lo, hi), s| (lo.min(s.center - s.radius), hi.max(s.center + s.radius)))
            }
        };
        let (lo, hi) = (lo.as_dvec3(), hi.as_dvec3());
        let is_empty = geometry.primitive_count() == 0;
        (!is_empty).then(|| Self {
            geometry,
            lo,
            hi,
            touching: OnceLock::new(),
            looked_at: AtomicUsize::new(0),
            hierarchy: OnceLock::new(),
        })
    }

    /// For each direction a vertex that the mesh's box touches there, or a sphere with its radius.
    fn touching(&self) -> &[Vec4; 6] {
        self.touching.get_or_init(|| {
            let (mut lo, mut hi) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
            let mut points = [Vec4::ZERO; 6];
            let mut add = |p: Vec3, radius: f32| {
                for axis in 0..3 {
                    if p[axis] + radius > hi[axis] {
                        hi[axis] = p[axis] + radius;
                        points[axis] = p.extend(radius);
                    }
                    if p[axis] - radius < lo[axis] {
                        lo[axis] = p[axis] - radius;
                        points[axis + 3] = p.extend(radius);
                    }
                }
            };
            match self.geometry {
                Geometry::Triangles(t) => t.indices.iter().flatten().for_each(|&i| add(t.positions[i as usize], 0.0)),
                Geometry::Spheres(s) => s.iter().for_each(|s| add(s.center, s.radius)),
            }
            points
        })
    }

    fn extremes_of(&self, point: &Vec4, to_world: &DAffine3) -> Extremes {
        let p = to_world.transform_point3(point.truncate().as_dvec3());
        let radius = match self.geometry {
            Geometry::Triangles(_) => DVec3::ZERO,
            Geometry::Spheres(_) => {
                DVec3::from_array([0, 1, 2].map(|k| to_world.matrix3.row(k).length() * f64::from(point.w)))
            }
        };
        let (high, low) = (p + radius, radius - p);
        [high.x, high.y, high.z, low.x, low.y, low.z]
    }

    /// Raises those of `known` that `reaches` names by an instance.
    fn raise(&self, to_world: &DAffine3, reaches: [bool; 6], known: &mut Extremes) {
        if self.looked_at.fetch_add(1, Ordering::Relaxed) < LOOKED_AT {
            *known = union(*known, self.extremes(to_world));
            return;
        }
        let hierarchy = self.hierarchy.get_or_init(|| Hierarchy::new(self.geometry.points()));
        for k in (0..6).filter(|&k| reaches[k]) {
            let offset = offset(to_world, k);
            known[k] = offset + hierarchy.greatest(row(to_world, k), known[k] - offset);
        }
    }

    /// The extremes of an instance, by everything in the mesh.
    fn extremes(&self, to_world: &DAffine3) -> Extremes {
        match self.geometry {
            Geometry::Triangles(t) => extremes_of_triangles(t, to_world).unwrap_or_else(|| {
                let points = self.geometry.points();
                points.iter().map(|p| self.extremes_of(p, to_world)).fold(NOTHING, union)
            }),
            Geometry::Spheres(spheres) => {
                let sphere = |s: &Sphere| self.extremes_of(&s.center.extend(s.radius), to_world);
                spheres.par_iter().with_min_len(BLOCK).map(sphere).reduce(|| NOTHING, union)
            }
        }
    }
}

/// The extremes of all vertices, if triangles use those that are extreme: one look at the vertices
/// and one at the indices, in the order of memory.
fn extremes_of_triangles(t: &TriangleMesh, to_world: &DAffine3) -> Option<Extremes> {
    type Found = [(f64, usize); 6];
    let further = |mut a: Found, b: Found| {
        for k in 0..6 {
            if b[k].0 > a[k].0 {
                a[k] = b[k];
            }
        }
        a
    };
    let look = |found: Found, (index, p): (usize, &Vec3)| {
        let p = to_world.transform_point3(p.as_dvec3());
        further(found, [p.x, p.y, p.z, -p.x, -p.y, -p.z].map(|value| (value, index)))
    };
    let nothing = || [(f64::NEG_INFINITY, usize::MAX); 6];
    let vertices = t.positions.par_iter().enumerate().with_min_len(BLOCK);
    let found = vertices.fold(nothing, look).reduce(nothing, further);
    let vertices = found.map(|(_, index)| index as u32);
    let uses = |used: u8, triangle: &[u32; 3]| {
        (0..6).fold(used, |used, k| used | u8::from(triangle.contains(&vertices[k])) << k)
    };
    let used = t.indices.par_iter().with_min_len(BLOCK).fold(|| 0, uses).reduce(|| 0, |a, b| a | b);
    (used == 0b11_1111).then(|| found.map(|(value, _)| value))
}

/// Points with radii in a binary hierarchy of boxes: which of them reaches furthest in a direction
/// is found without looking at all.
struct Hierarchy {
    points: Vec<Vec4>,
    /// Box of each node, as [`Node::children`] divides the points; children of node i are nodes 2 i
    /// + 1 and 2 i + 2.
    boxes: Vec<[DVec3; 2]>,
}

/// Points of a node.
#[derive(Clone, Copy)]
struct Node {
    index: usize,
    start: usize,
    end: usize,
}

impl Node {
    /// Children of the node; `None` for a leaf.
    fn children(self) -> Option<[Self; 2]> {
        let Self { index, start, end } = self;
        let middle = start + (end - start) / 2;
        let child = |k: usize, start: usize, end: usize| Self { index: 2 * index + k, start, end };
        (end - start > LEAF).then(|| [child(1, start, middle), child(2, middle, end)])
    }
}

impl Hierarchy {
    fn new(points: Vec<Vec4>) -> Self {
        let mut out = Self { points, boxes: Vec::new() };
        let mut stack = vec![out.root()];
        while let Some(node) = stack.pop() {
            let points = &mut out.points[node.start..node.end];
            let empty = [DVec3::INFINITY, DVec3::NEG_INFINITY];
            let bounds = points.iter().fold(empty, |[lo, hi], p| {
                let (center, radius) = (p.truncate().as_dvec3(), f64::from(p.w));
                [lo.min(center - radius), hi.max(center + radius)]
            });
            if out.boxes.len() <= node.index {
                out.boxes.resize(node.index + 1, empty);
            }
            out.boxes[node.index] = bounds;
            if let Some([a, b]) = node.children() {
                let extent = bounds[1] - bounds[0];
                let axis = [0, 1, 2].into_iter().max_by(|&i, &j| extent[i].total_cmp(&extent[j])).unwrap_or(0);
                points.select_nth_unstable_by(a.end - a.start, |p, q| p[axis].total_cmp(&q[axis]));
                stack.extend([a, b]);
            }
        }
        out
    }

    fn root(&self) -> Node {
        Node { index: 0, start: 0, end: self.points.len() }
    }

    /// The greatest product of a point with `direction`, plus its radius; at least `known`.
    fn greatest(&self, direction: DVec3, mut known: f64) -> f64 {
        let length = direction.length();
        let most = |node: &Node| {
            let [lo, hi] = self.boxes[node.index];
            (direction * lo).max(direction * hi).element_sum()
        };
        let mut stack = vec![self.root()];
        while let Some(node) = stack.pop() {
            if most(&node) <= known {
                continue;
            }
            match node.children() {
                // the one that reaches further first
                Some([a, b]) => stack.extend(if most(&a) > most(&b) { [b, a] } else { [a, b] }),
                None => {
                    let values = self.points[node.start..node.end].iter();
                    let values = values.map(|p| direction.dot(p.truncate().as_dvec3()) + length * f64::from(p.w));
                    known = values.fold(known, f64::max);
                }
            }
        }
        known
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DQuat};

    use super::*;
    use crate::scene::Mesh;

    /// Numbers from 0 to 1 that are the same in each run.
    struct Numbers(u32);

    impl Numbers {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            f64::from((self.0 >> ((self.0 >> 28) + 4)) ^ self.0) / f64::from(u32::MAX)
        }

        fn vector(&mut self) -> DVec3 {
            DVec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0
        }

        fn transform(&mut self) -> DAffine3 {
            let axis = self.vector().normalize_or(DVec3::X);
            let turn = DMat3::from_quat(DQuat::from_axis_angle(axis, 7.0 * self.next()));
            let shear = DMat3::from_cols(DVec3::X * 1.5, DVec3::new(0.3, 0.8, 0.0), DVec3::new(-0.2, 0.1, -1.0));
            DAffine3::from_mat3_translation(turn * shear, self.vector() * 4.0)
        }
    }

    fn mesh(geometry: Geometry) -> Mesh {
        Mesh { name: String::new(), geometry, material: 0, source: None }
    }

    fn scene(meshes: Vec<Mesh>, transforms: impl Iterator<Item = DAffine3>) -> Scene {
        let count = meshes.len();
        let place = |(k, object_to_world)| Instance { name: String::new(), mesh: k % count, object_to_world };
        Scene { meshes, instances: transforms.enumerate().map(place).collect(), ..Scene::default() }
    }

    /// Computes the bounds from every vertex and sphere of every instance.
    fn slow(scene: &Scene) -> (DVec3, DVec3) {
        let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for i in &scene.instances {
            let m = &i.object_to_world;
            let mut add = |p: Vec3, radius: f64| {
                let reach = DVec3::from_array([0, 1, 2].map(|k| m.matrix3.row(k).length() * radius));
                let p = m.transform_point3(p.as_dvec3());
                (lo, hi) = (lo.min(p - reach), hi.max(p + reach));
            };
            match &scene.meshes[i.mesh].geometry {
                Geometry::Triangles(t) => t.indices.iter().flatten().for_each(|&v| add(t.positions[v as usize], 0.0)),
                Geometry::Spheres(s) => s.iter().for_each(|s| add(s.center, f64::from(s.radius))),
            }
        }
        (lo, hi)
    }

    #[test]
    fn turned_instances_count_by_their_vertices_and_spheres() {
        let mut numbers = Numbers(7);
        // more points than a leaf of a hierarchy has, and one that no triangle uses
        let mut positions: Vec<Vec3> = (0..300).map(|_| numbers.vector().as_vec3()).collect();
        positions.push(Vec3::splat(100.0));
        let indices = (0..298).map(|i| [i, i + 1, i + 2]).collect();
        let triangles =
            || mesh(Geometry::Triangles(TriangleMesh { positions: positions.clone(), indices, ..Default::default() }));
        let spheres = (0..100).map(|k| Sphere { center: numbers.vector().as_vec3(), radius: 0.1 + 0.005 * k as f32 });
        let spheres = mesh(Geometry::Spheres(spheres.collect()));
        let empty = mesh(Geometry::Spheres(Vec::new()));
        let mut scene = scene(vec![triangles(), spheres, empty], std::iter::empty());
        assert_eq!(of_scene(&scene, None), None);
        for count in [1, 2, 3, 40, 1000] {
            let place = |k: usize, object_to_world| Instance { name: String::new(), mesh: k % 3, object_to_world };
            scene.instances = (0..count).map(|k| place(k, numbers.transform())).collect();
            let ((lo, hi), (low, high)) = (of_scene(&scene, None).unwrap(), slow(&scene));
            assert!(
                (lo - low).abs().max_element().max((hi - high).abs().max_element()) < 1e-12,
                "{count}: {lo} {low} {hi} {high}"
            );
        }
    }

    #[test]
    fn boxes_that_are_not_turned_are_bounds_to_the_bit() {
        let positions = vec![Vec3::new(0.1, -0.7, 3.3), Vec3::new(1e-3, 0.2, 0.3), Vec3::new(-5.5, 9.1, 0.7)];
        let triangle = Geometry::Triangles(TriangleMesh { positions, indices: vec![[0, 1, 2]], ..Default::default() });
        let quarter = DMat3::from_cols(DVec3::Z * 0.3, DVec3::X * -1.7, DVec3::Y * 0.9);
        let at = DVec3::new(1e3, -0.1, 7.7);
        for matrix in [DMat3::IDENTITY, quarter] {
            let scene = scene(vec![mesh(triangle.clone())], [DAffine3::from_mat3_translation(matrix, at)].into_iter());
            assert_eq!(of_scene(&scene, None).unwrap(), slow(&scene));
        }
    }

    /// A quarter turn as files have it, whose zeros are not exact.
    #[test]
    fn quarter_turns_need_no_vertices() {
        let sphere = Geometry::Spheres(vec![Sphere { center: Vec3::ONE, radius: 2.0 }]);
        let turn = DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2);
        let placed = PlacedBox::new(&Shape::new(&sphere).unwrap(), &DAffine3::from_quat(turn));
        assert_eq!(placed.is_turned, [false; 3]);
    }
}
