//! Triangles cut by a plane: the boxes of both parts hold the whole.

use glam::Vec3;
use skylit::accel::Aabb;
use skylit::accel::clip::clip;

/// A sequence of numbers in [0, 1).
fn numbers() -> impl FnMut() -> f32 {
    let mut state = 1u64;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1u32 << 24) as f32
    }
}

/// Whatever plane a triangle is cut by, at any scale and far from the origin, every point of it
/// is in one of both boxes.
#[test]
fn parts_hold_the_whole() {
    let mut next = numbers();
    for (scale, offset) in
        [(1.0f32, 0.0f32), (1e-6, 0.0), (1e6, 0.0), (1e-3, 1e3), (1.0, -1e5), (1e-20, 0.0), (1e15, 0.0)]
    {
        for _ in 0..2000 {
            let mut point = || Vec3::new(next(), next(), next() * 0.01) * scale + offset;
            let t = [point(), point(), point()];
            let whole = Aabb::of_points(&t);
            let axis = (next() * 3.0) as usize;
            let at = whole.min[axis] + (whole.max[axis] - whole.min[axis]) * next();
            let (mut low, mut high) = (whole, whole);
            low.max[axis] = at;
            high.min[axis] = at;
            let triangles = |_: u32, see: &mut dyn FnMut([Vec3; 3])| see(t);
            let parts = [low, high].map(|cell| clip(0, cell, &triangles));
            for (part, cell) in parts.iter().zip([low, high]) {
                assert!(part.is_none_or(|p| cell.contains(&p)), "{t:?} {cell:?}");
            }
            for _ in 0..20 {
                let (mut u, mut v) = (next() as f64, next() as f64);
                if u + v > 1.0 {
                    (u, v) = (1.0 - u, 1.0 - v);
                }
                let [a, b, c] = t.map(Vec3::as_dvec3);
                let p = a + (b - a) * u + (c - a) * v;
                let inside = |b: &Aabb| {
                    b.min.as_dvec3().cmple(p + 1e-14 * p.abs()).all()
                        && b.max.as_dvec3().cmpge(p - 1e-14 * p.abs()).all()
                };
                assert!(parts.iter().flatten().any(inside), "{p} of {t:?} cut at {at} on axis {axis}: {parts:?}");
            }
        }
    }
}

/// Cutting is worth it: each half of a diagonal is a quarter of the box.
#[test]
fn parts_are_tight() {
    let triangles =
        |_: u32, see: &mut dyn FnMut([Vec3; 3])| see([Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0), Vec3::new(1.0, 1.0, 1e-3)]);
    let cell = Aabb { min: Vec3::ZERO, max: Vec3::new(0.5, 1.0, 1.0) };
    let part = clip(0, cell, &triangles).unwrap();
    assert!((part.max - Vec3::new(0.5, 0.5, 0.0005)).abs().max_element() < 1e-6, "{part:?}");
    assert_eq!(clip(0, Aabb { min: Vec3::splat(2.0), max: Vec3::splat(3.0) }, &triangles), None);
}
