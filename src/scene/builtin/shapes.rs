//! The meshes that built-in scenes are made of. Counter-clockwise seen from outside; closed shapes
//! share their vertices.

use crate::scene::{Geometry, Sphere, TriangleMesh};
use glam::{DVec3, Vec3};
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// One analytic sphere.
pub fn sphere(center: DVec3, radius: f64) -> Geometry {
    Geometry::Spheres(vec![Sphere { center: center.as_vec3(), radius: radius as f32 }])
}

/// A triangle mesh of quads, four corners each, counter-clockwise.
pub fn quads(corners: &[[DVec3; 4]]) -> Geometry {
    let mut mesh = TriangleMesh::default();
    for (q, corner) in (0u32..).zip(corners) {
        mesh.positions.extend(corner.iter().map(|p| p.as_vec3()));
        mesh.indices.extend([[4 * q, 4 * q + 1, 4 * q + 2], [4 * q, 4 * q + 2, 4 * q + 3]]);
    }
    Geometry::Triangles(mesh)
}

/// A horizontal square of the given side, centred at `center`, seen from above.
pub fn floor(center: DVec3, side: f64) -> Geometry {
    rectangle(center, DVec3::Z * side, DVec3::X * side)
}

/// A parallelogram around `center` with edges `u` and `v`; it faces `u x v`.
pub fn rectangle(center: DVec3, u: DVec3, v: DVec3) -> Geometry {
    let (u, v) = (u * 0.5, v * 0.5);
    quads(&[[center - u - v, center + u - v, center + u + v, center - u + v]])
}

/// A closed box with eight shared vertices.
pub fn cuboid(lo: DVec3, hi: DVec3) -> Geometry {
    let pick = |bit: bool, l: f64, h: f64| if bit { h } else { l };
    let positions = (0..8)
        .map(|k| {
            DVec3::new(pick(k & 1 != 0, lo.x, hi.x), pick(k & 2 != 0, lo.y, hi.y), pick(k & 4 != 0, lo.z, hi.z))
                .as_vec3()
        })
        .collect();
    // corners by bits zyx; each face counter-clockwise from outside
    let faces: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let indices = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Geometry::Triangles(TriangleMesh { positions, indices, ..TriangleMesh::default() })
}

/// A sphere of `20 * 4^levels` triangles around the origin, closed, with smooth normals.
pub fn icosphere(radius: f64, levels: u32) -> Geometry {
    // an icosahedron from the golden ratio
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let mut points: Vec<DVec3> = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ]
    .map(|p| DVec3::from_array(p).normalize())
    .to_vec();
    let mut faces: Vec<[u32; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];

    // each level divides every triangle into four
    for _ in 0..levels {
        let mut middle_of = HashMap::new();
        let mut middle = |points: &mut Vec<DVec3>, a: u32, b: u32| {
            *middle_of.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(&mut points, a, b), middle(&mut points, b, c), middle(&mut points, c, a));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }

    Geometry::Triangles(TriangleMesh {
        positions: points.iter().map(|p| (*p * radius).as_vec3()).collect(),
        normals: points.iter().map(|p| p.as_vec3()).collect(),
        indices: faces,
        ..TriangleMesh::default()
    })
}

/// A torus around the y axis, closed, with `2 * segments * sides` triangles and smooth normals.
pub fn torus(major: f64, minor: f64, segments: u32, sides: u32) -> Geometry {
    let mut mesh = TriangleMesh::default();
    for i in 0..segments {
        let (sin_a, cos_a) = (TAU * i as f64 / segments as f64).sin_cos();
        for j in 0..sides {
            let (sin_b, cos_b) = (TAU * j as f64 / sides as f64).sin_cos();
            let normal = DVec3::new(cos_a * cos_b, sin_b, -sin_a * cos_b);
            let ring = DVec3::new(cos_a, 0.0, -sin_a) * major;
            mesh.positions.push((ring + normal * minor).as_vec3());
            mesh.normals.push(normal.as_vec3());
            let at = |i: u32, j: u32| (i % segments) * sides + j % sides;
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            mesh.indices.extend([[a, b, c], [a, c, d]]);
        }
    }
    Geometry::Triangles(mesh)
}

/// A closed cylinder around the y axis from `y = 0` to `height`, its caps fans.
pub fn cylinder(radius: f64, height: f64, segments: u32) -> Geometry {
    let mut mesh = TriangleMesh { positions: vec![Vec3::ZERO, Vec3::Y * height as f32], ..TriangleMesh::default() };
    for i in 0..segments {
        let (s, c) = (TAU * i as f64 / segments as f64).sin_cos();
        for y in [0.0, height] {
            mesh.positions.push(DVec3::new(c * radius, y, -s * radius).as_vec3());
        }
        let j = (i + 1) % segments;
        let (a, b, c, d) = (2 + 2 * i, 2 + 2 * j, 3 + 2 * j, 3 + 2 * i);
        mesh.indices.extend([[a, b, c], [a, c, d], [0, b, a], [1, d, c]]);
    }
    Geometry::Triangles(mesh)
}

/// A profile of radii and heights rotated about the y axis, closed at both ends.
pub fn lathe(profile: &[[f64; 2]], segments: u32) -> Geometry {
    fluted_lathe(profile, segments, 0, 0..0)
}

/// A [`lathe`] with as many grooves as `flutes` around the points of the profile that `fluted`
/// counts.
pub fn fluted_lathe(profile: &[[f64; 2]], segments: u32, flutes: u32, fluted: Range<usize>) -> Geometry {
    let mut mesh = TriangleMesh::default();
    for (k, [radius, y]) in profile.iter().enumerate() {
        for i in 0..segments {
            let angle = TAU * f64::from(i) / f64::from(segments);
            let depth = if fluted.contains(&k) { 0.07 * (0.5 - 0.5 * (angle * f64::from(flutes)).cos()) } else { 0.0 };
            let r = radius * (1.0 - depth);
            mesh.positions.push(DVec3::new(r * angle.cos(), *y, -r * angle.sin()).as_vec3());
        }
    }
    let rings = profile.len() as u32;
    for (k, i) in (0..rings - 1).flat_map(|k| (0..segments).map(move |i| (k, i))) {
        let (a, b) = (k * segments + i, k * segments + (i + 1) % segments);
        mesh.indices.extend([[a, b, b + segments], [a, b + segments, a + segments]]);
    }
    for (ring, is_top) in [(0, false), (rings - 1, true)] {
        let middle = mesh.positions.len() as u32;
        mesh.positions.push(Vec3::Y * profile[ring as usize][1] as f32);
        for i in 0..segments {
            let (a, b) = (ring * segments + i, ring * segments + (i + 1) % segments);
            mesh.indices.push(if is_top { [middle, a, b] } else { [middle, b, a] });
        }
    }
    Geometry::Triangles(mesh)
}

/// A curtain of folds around x = 0, hanging from y = `height` to 0; seen from both sides. It is a
/// grid of `columns` by `rows` quads.
pub fn curtain(width: f64, height: f64, columns: u32, rows: u32) -> Geometry {
    let mut mesh = TriangleMesh::default();
    for (k, i) in (0..=rows).flat_map(|k| (0..=columns).map(move |i| (k, i))) {
        let (u, v) = (f64::from(i) / f64::from(columns), f64::from(k) / f64::from(rows));
        // folds grow deeper towards the hem, and the cloth is gathered in the middle of its height
        let gather = 1.0 - 0.25 * (PI * v).sin();
        let z = 0.07 * (0.4 + 0.6 * (1.0 - v)) * (TAU * 9.0 * u + 1.3 * v).sin();
        mesh.positions.push(DVec3::new((u - 0.5) * width * gather, v * height, z).as_vec3());
    }
    for (k, i) in (0..rows).flat_map(|k| (0..columns).map(move |i| (k, i))) {
        let a = k * (columns + 1) + i;
        let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
        mesh.indices.extend([[a, b, c], [a, c, d]]);
    }
    Geometry::Triangles(mesh)
}
