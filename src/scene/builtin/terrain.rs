//! Terrain of any number of triangles, for measuring how tracers scale, and many placed copies of
//! some.
//!
//! Heights are fractional Brownian motion (Musgrave, Kolb and Mace, "The Synthesis and Rendering of
//! Eroded Fractal Terrains", 1989) of gradient noise (Perlin, "Improving Noise", 2002), in integer
//! hashes and `f64` arithmetic without library functions: the same bits on every machine. The
//! number of triangles decides how finely the same landscape is sampled, not what it looks like, so
//! that rays of one camera meet the same hills at every size.

use super::random::Rng;
use crate::sampling::sobol::hash_combine;
use crate::scene::{Geometry, Scene, TriangleMesh};
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

/// Side of the terrain in scene units.
const SIDE: f64 = 100.0;
/// Height of the lowest octave's hills in scene units.
const RELIEF: f64 = 14.0;
/// Cells of the lowest octave along a side.
const CELLS: f64 = 5.0;
/// The finest octave has 5 * 2^11 = 10,240 cells a side: finer than the grid of 1e7 triangles
/// (2,236).
const OCTAVES: u32 = 12;
/// Amplitude from one octave to the next; 0.5 would be 1/f^2 noise, a little less looks like eroded
/// hills.
const GAIN: f64 = 0.47;

/// The product of one of eight gradients, by a hash of the lattice point, with an offset.
fn gradient(hash: u32, dx: f64, dy: f64) -> f64 {
    let h = hash >> 29;
    let (a, b) = if h & 4 == 0 { (dx, dy) } else { (dy, dx) };
    // (+-1, +-1/2) and (+-1/2, +-1)
    (if h & 1 == 0 { a } else { -a }) + 0.5 * (if h & 2 == 0 { b } else { -b })
}

/// Adds gradient noise in about [-1, 1], times the amplitude, to the heights of points of one y and
/// the `x` of each. Neighbours in a cell of the lattice have the hashes of its corners in common.
fn add_noise(heights: &mut [f64], seed: u32, amplitude: f64, x: impl Fn(usize) -> f64, y: f64) {
    let (fy, fade) = (y.floor(), |t: f64| t * t * t * (t * (t * 6.0 - 15.0) + 10.0));
    let (dy, iy, v) = (y - fy, fy as i64, fade(y - fy));
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let mut cell: Option<(i64, [[u32; 2]; 2])> = None;
    for (k, height) in heights.iter_mut().enumerate() {
        let x = x(k);
        let fx = x.floor();
        let (dx, ix) = (x - fx, fx as i64);
        let corners = match cell {
            Some((known, corners)) if known == ix => corners,
            _ => [0, 1].map(|i| {
                let column = hash_combine(seed, (ix + i) as u32);
                [0, 1].map(|j| hash_combine(column, (iy + j) as u32))
            }),
        };
        cell = Some((ix, corners));
        let corner = |i: usize, j: usize| gradient(corners[i][j], dx - i as f64, dy - j as f64);
        let u = fade(dx);
        *height += amplitude * mix(mix(corner(0, 0), corner(1, 0), u), mix(corner(0, 1), corner(1, 1), u), v);
    }
}

/// Heights of the landscape `seed` at points of one y and the `x` of each, in the unit square.
fn heights(seed: u32, count: usize, x: impl Fn(usize) -> f64, y: f64) -> Vec<f64> {
    let (mut sums, mut amplitude, mut frequency) = (vec![0.0; count], RELIEF, CELLS);
    for octave in 0..OCTAVES {
        add_noise(&mut sums, hash_combine(seed, octave), amplitude, |k| x(k) * frequency, y * frequency);
        amplitude *= GAIN;
        frequency *= 2.0;
    }
    sums
}

/// `n` triangles (at least 2) over a square of side [`SIDE`] around the origin, y up. Vertices are
/// shared: 6 bytes of positions and 12 of indices a triangle.
fn mesh(seed: u32, n: u32) -> Geometry {
    // the smallest grid of two triangles a cell that has n or more; what is too many is left out of
    // the last row
    let columns = ((n as f64 / 2.0).sqrt().floor() as u32).max(1);
    let rows = n.div_ceil(2 * columns);
    let across = columns + 1;
    let mut positions = vec![Vec3::ZERO; across as usize * (rows as usize + 1)];
    positions.par_chunks_mut(across as usize).enumerate().for_each(|(row, positions)| {
        let (x, z) = (|k: usize| k as f64 / columns as f64, row as f64 / rows as f64);
        let heights = heights(seed, positions.len(), x, z);
        for (k, (position, height)) in positions.iter_mut().zip(heights).enumerate() {
            *position = DVec3::new((x(k) - 0.5) * SIDE, height, (z - 0.5) * SIDE).as_vec3();
        }
    });
    let indices = (0..n)
        .into_par_iter()
        .map(|t| {
            let (cell, half) = (t / 2, t % 2);
            let a = cell / columns * across + cell % columns;
            let (b, c, d) = (a + across, a + across + 1, a + 1);
            if half == 0 { [a, b, c] } else { [a, c, d] }
        })
        .collect();
    Geometry::Triangles(TriangleMesh { positions, indices, ..TriangleMesh::default() })
}

/// A fractal landscape of exactly `n` triangles, seen over its hills from one side.
pub fn terrain(n: u32) -> Scene {
    let mut scene = Scene { name: "terrain".to_owned(), ..Scene::default() };
    let earth = scene.add_matte("earth", Vec3::new(0.5, 0.45, 0.38));
    scene.add_object("terrain", mesh(0x7e44_a125, n), earth, DAffine3::IDENTITY);
    scene.add_camera(DVec3::new(8.0, 20.0, 46.0), DVec3::new(0.0, -2.0, 0.0), 50.0);
    scene
}

/// Different pieces of land in [`instances`].
const PIECES: u32 = 15;

/// `n` triangles by placing 15 landscapes, each turned, sunk and stretched differently, 125 times
/// in total, on a quasi-random layout: about `n / 125` triangles a landscape, 25 million seen for 3
/// million stored.
pub fn instances(n: u32) -> Scene {
    const PLACES: u32 = 125;
    let mut scene = Scene { name: "instances".to_owned(), ..Scene::default() };
    let earth = scene.add_matte("earth", Vec3::new(0.5, 0.45, 0.38));
    let each = (n / PLACES).max(2);
    let pieces: Vec<_> =
        (0..PIECES).map(|k| scene.add_mesh("land", mesh(hash_combine(0x1a4d, k), each), earth)).collect();
    let mut rng = Rng::new(0x17_57a7);
    for k in 0..PLACES {
        // each piece shrinks to an island of about a fifth of the whole; they overlap, as scattered
        // rocks do
        let at = DVec3::new(rng.range(-0.5, 0.5) * SIDE, rng.range(-3.0, 3.0), rng.range(-0.5, 0.5) * SIDE);
        let turn = DAffine3::from_rotation_y(rng.range(0.0, std::f64::consts::TAU))
            * DAffine3::from_rotation_x(rng.range(-0.25, 0.25))
            * DAffine3::from_rotation_z(rng.range(-0.25, 0.25));
        let scale =
            DAffine3::from_scale(DVec3::new(rng.range(0.15, 0.25), rng.range(0.15, 0.4), rng.range(0.15, 0.25)));
        scene.add_instance("land", pieces[(k % PIECES) as usize], DAffine3::from_translation(at) * turn * scale);
    }
    scene.add_camera(DVec3::new(8.0, 26.0, 52.0), DVec3::new(0.0, -2.0, 0.0), 50.0);
    scene
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_counts_and_valid_indices() {
        for n in [2, 3, 7, 1000, 9_999, 10_000] {
            let scene = terrain(n);
            assert_eq!(scene.triangle_count(), u64::from(n));
            let Geometry::Triangles(t) = &scene.meshes[0].geometry else { panic!("triangles") };
            assert!(t.indices.iter().flatten().all(|&i| (i as usize) < t.positions.len()), "{n}");
            assert!(t.positions.iter().all(|p| p.is_finite()));
            // upwards, none without area
            assert!(t.indices.iter().all(|f| {
                let [a, b, c] = f.map(|i| t.positions[i as usize].as_dvec3());
                (b - a).cross(c - a).y > 0.0
            }));
        }
        assert_eq!(instances(25_000).triangle_count(), 25_000);
    }

    #[test]
    fn the_same_land_at_every_size() {
        // the corner vertices and the middle lie on every grid
        let at = |n: u32| {
            let scene = terrain(n);
            let Geometry::Triangles(t) = &scene.meshes[0].geometry else { panic!("triangles") };
            (t.positions[0], t.positions[t.positions.len() - 1])
        };
        assert_eq!(at(200), at(20_000));
        let (lo, hi) = (0..50)
            .flat_map(|row| heights(1, 50, |k| k as f64 / 50.0, f64::from(row) / 50.0))
            .fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(y), h.max(y)));
        assert!(hi - lo > 0.5 * RELIEF && hi - lo < 4.0 * RELIEF, "{lo} {hi}");
    }
}
