//! An arcaded courtyard of two storeys, open to the sky: the kind of scene that Sponza is, of about
//! as many triangles, and made in code.

use std::f64::consts::PI;

use glam::{DAffine3, DQuat, DVec3, Vec3};

use super::random::Rng;
use super::shapes;
use crate::scene::{Geometry, Scene};

/// Half of the court's sides along x and z, metres: between the axes of the columns.
const COURT: [f64; 2] = [12.0, 4.5];
/// Arches along x and z.
const BAYS: [u32; 2] = [8, 3];
/// Width of the aisles around the court.
const AISLE: f64 = 4.0;
/// Floor of each storey, and the top of the walls.
const LEVELS: [f64; 3] = [0.0, 5.4, 10.0];
/// Thickness of walls and arches.
const THICKNESS: f64 = 0.5;
/// Height of a storey's cornice and of the slab behind it.
const SLAB: f64 = 0.5;

/// About 270,000 triangles, most of them in columns and balusters, which are instances.
pub fn atrium() -> Scene {
    let mut scene = Scene { name: "atrium".to_owned(), ..Scene::default() };
    let [stone, plaster, tile, cloth, leaf] = [
        ("stone", Vec3::new(0.66, 0.61, 0.52)),
        ("plaster", Vec3::new(0.74, 0.7, 0.63)),
        ("tile", Vec3::new(0.48, 0.4, 0.34)),
        ("cloth", Vec3::new(0.5, 0.08, 0.07)),
        ("leaf", Vec3::new(0.17, 0.3, 0.1)),
    ]
    .map(|(name, color)| scene.add_matte(name, color));
    add_shell(&mut scene, plaster, tile);
    add_arcades(&mut scene, stone);
    add_furniture(&mut scene, [stone, cloth, leaf]);
    scene.add_camera(DVec3::new(-11.0, 1.9, -1.9), DVec3::new(3.0, 3.6, 0.9), 60.0);
    scene
}

/// Ground, outer walls, slabs and vaults of the aisles.
fn add_shell(scene: &mut Scene, plaster: usize, tile: usize) {
    let [x, z] = COURT.map(|c| c + AISLE);
    scene.add_object("ground", shapes::floor(DVec3::new(0.0, -0.05, 0.0), 4.0 * x), tile, DAffine3::IDENTITY);
    let slab = shapes::cuboid(DVec3::new(0.01, -0.3, 0.01), DVec3::new(0.99, 0.0, 0.99));
    let slab = scene.add_mesh("tile", slab, tile);
    let mut rng = Rng::new(0xa721);
    for (i, k) in (0..32).flat_map(|i| (0..17).map(move |k| (i, k))) {
        let at = DVec3::new(f64::from(i) - 16.0, rng.range(-0.006, 0.0), f64::from(k) - 8.5);
        scene.add_instance("tile", slab, DAffine3::from_translation(at));
    }
    let top = LEVELS[2];
    for (name, lo, hi) in [
        ("wall west", DVec3::new(-x - THICKNESS, -0.2, -z), DVec3::new(-x, top, z)),
        ("wall east", DVec3::new(x, -0.2, -z), DVec3::new(x + THICKNESS, top, z)),
        ("wall north", DVec3::new(-x - THICKNESS, -0.2, -z - THICKNESS), DVec3::new(x + THICKNESS, top, -z)),
        ("wall south", DVec3::new(-x - THICKNESS, -0.2, z), DVec3::new(x + THICKNESS, top, z + THICKNESS)),
    ] {
        scene.add_object(name, shapes::cuboid(lo, hi), plaster, DAffine3::IDENTITY);
    }
    for level in [LEVELS[1], LEVELS[2]] {
        let [inner_x, inner_z] = COURT.map(|c| c + THICKNESS / 2.0);
        let (lo, hi) = (level - SLAB * 0.6, level - 0.01);
        for (sx, sz) in [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)] {
            // the slabs along z lie between those along x
            let [a, b] = if sx == 0.0 {
                [DVec3::new(-x, lo, inner_z), DVec3::new(x, hi, z)]
            } else {
                [DVec3::new(inner_x, lo, -inner_z), DVec3::new(x, hi, inner_z)]
            };
            let turn = DAffine3::from_rotation_y(if sx < 0.0 || sz < 0.0 { PI } else { 0.0 });
            scene.add_object("slab", shapes::cuboid(a, b), plaster, turn);
        }
        let rise = AISLE / 2.0 * 0.6;
        let vault = scene.add_mesh("vault", vault(2.0 * x, AISLE, rise), plaster);
        for side in [-1.0, 1.0] {
            let at = DVec3::new(0.0, lo - rise, side * (COURT[1] + AISLE / 2.0));
            scene.add_instance("vault", vault, DAffine3::from_translation(at));
        }
    }
}

/// Columns, arches, cornices and balustrades of both storeys around the court.
fn add_arcades(scene: &mut Scene, stone: usize) {
    let baluster = scene.add_mesh("baluster", shapes::lathe(&BALUSTER, 16), stone);
    for storey in 0..2 {
        // a storey has columns of its own height
        let (floor, ceiling) = (LEVELS[storey], LEVELS[storey + 1] - SLAB);
        let spring = floor + 0.62 * (ceiling - floor);
        let column =
            scene.add_mesh("column", shapes::fluted_lathe(&column_profile(spring - floor), 72, 18, FLUTED), stone);
        for side in 0..4u32 {
            let (along, across) = ((side % 2) as usize, 1 - (side % 2) as usize);
            let turn = DAffine3::from_rotation_y(f64::from(side) * PI / 2.0);
            let width = 2.0 * COURT[along] / f64::from(BAYS[along]);

            // the corner column is that of the side before
            for k in 1..=BAYS[along] {
                let at = DVec3::new(f64::from(k) * width - COURT[along], floor, COURT[across]);
                scene.add_instance("column", column, turn * DAffine3::from_translation(at));
            }

            // arches between the columns, above with a balustrade
            let piece = arch(width, ceiling - spring);
            let piece = scene.add_mesh("arch", piece, stone);
            for k in 0..BAYS[along] {
                let middle = (f64::from(k) + 0.5) * width - COURT[along];
                let at = turn * DAffine3::from_translation(DVec3::new(middle, spring, COURT[across]));
                scene.add_instance("arch", piece, at);
                if storey == 1 {
                    let count = 9;
                    for j in 0..count {
                        let x = middle + (f64::from(j) - f64::from(count - 1) / 2.0) * (width - 1.0) / f64::from(count);
                        let at = DVec3::new(x, floor, COURT[across]);
                        scene.add_instance("baluster", baluster, turn * DAffine3::from_translation(at));
                    }
                }
            }

            // a cornice over the arches, above with a rail
            let half = COURT[along] + THICKNESS * 0.5;
            let (z0, z1) = (COURT[across] - THICKNESS * 0.62, COURT[across] + THICKNESS * 0.5);
            let cornice = shapes::cuboid(DVec3::new(-half, ceiling, z0), DVec3::new(half, ceiling + SLAB, z1));
            scene.add_object("cornice", cornice, stone, turn);
            if storey == 1 {
                let rail = |y0, y1, w: f64| {
                    let z = COURT[across];
                    shapes::cuboid(DVec3::new(-COURT[along], y0, z - w), DVec3::new(COURT[along], y1, z + w))
                };
                scene.add_object("rail", rail(floor + 0.86, floor + 0.98, 0.14), stone, turn);
            }
        }
    }
}

/// Curtains in some arches, and pots with shrubs.
fn add_furniture(scene: &mut Scene, [stone, cloth, leaf]: [usize; 3]) {
    let width = 2.0 * COURT[0] / f64::from(BAYS[0]);
    let curtain = scene.add_mesh("curtain", shapes::curtain(width * 0.72, 3.0, 96, 24), cloth);
    for (bay, side) in [(1.5, 1.0), (3.5, 1.0), (6.5, 1.0), (2.5, -1.0), (4.5, -1.0), (5.5, -1.0)] {
        let at = DVec3::new(bay * width - COURT[0], LEVELS[1] + 0.9, side * (COURT[1] + 0.42));
        scene.add_instance("curtain", curtain, DAffine3::from_translation(at));
    }
    let pot = scene.add_mesh("pot", shapes::lathe(&POT, 40), stone);
    let shrub = scene.add_mesh("shrub", shapes::icosphere(0.34, 2), leaf);
    let mut rng = Rng::new(0x5b4b);
    for (x, z) in [(-7.5, 2.7), (-1.5, -2.9), (4.5, 2.8), (9.0, -2.6)] {
        let at = DVec3::new(x, 0.0, z);
        scene.add_instance("pot", pot, DAffine3::from_translation(at));
        for _ in 0..5 {
            let to = at + DVec3::new(rng.range(-0.3, 0.3), rng.range(0.95, 1.5), rng.range(-0.3, 0.3));
            let transform =
                DAffine3::from_scale_rotation_translation(DVec3::splat(rng.range(0.6, 1.1)), rng.rotation(), to);
            scene.add_instance("shrub", shrub, transform);
        }
    }
    let ring = shapes::torus(1.35, 0.16, 64, 16);
    let turn = DAffine3::from_rotation_translation(DQuat::IDENTITY, DVec3::new(1.5, 0.42, 0.0));
    scene.add_object("basin's rim", ring, stone, turn);
    scene.add_object(
        "basin",
        shapes::cylinder(1.32, 0.44, 64),
        stone,
        DAffine3::from_translation(DVec3::new(1.5, -0.04, 0.0)),
    );
}

/// Radius and height of points of a baluster.
const BALUSTER: [[f64; 2]; 11] = [
    [0.09, 0.0],
    [0.09, 0.06],
    [0.06, 0.08],
    [0.05, 0.14],
    [0.085, 0.28],
    [0.09, 0.36],
    [0.05, 0.56],
    [0.035, 0.7],
    [0.06, 0.76],
    [0.085, 0.8],
    [0.085, 0.87],
];

/// Radius and height of points of a pot.
const POT: [[f64; 2]; 9] = [
    [0.3, -0.02],
    [0.3, 0.08],
    [0.22, 0.12],
    [0.3, 0.3],
    [0.44, 0.62],
    [0.46, 0.8],
    [0.52, 0.84],
    [0.52, 0.9],
    [0.4, 0.88],
];

/// Points of a column's profile around which it has grooves: the shaft without its ends.
const FLUTED: std::ops::Range<usize> = 8..17;

/// Radius and height of points of a column: base, a shaft that tapers, capital. Points 7 to 17 are
/// the shaft.
fn column_profile(height: f64) -> Vec<[f64; 2]> {
    let mut profile =
        vec![[0.36, -0.02], [0.36, 0.14], [0.33, 0.16], [0.35, 0.2], [0.35, 0.25], [0.31, 0.29], [0.28, 0.34]];
    let (bottom, top) = (0.36, height - 0.5);
    for k in 0..11 {
        let t = f64::from(k) / 10.0;
        profile.push([0.27 - 0.04 * t * t, bottom + (top - bottom) * t]);
    }
    profile.extend([
        [0.25, height - 0.46],
        [0.27, height - 0.43],
        [0.24, height - 0.4],
        [0.29, height - 0.22],
        [0.37, height - 0.14],
        [0.37, height + 0.02],
    ]);
    profile
}

/// A wall of the given width around x = 0 from y = 0 to `height`, with a round opening whose crown
/// is below its top.
fn arch(width: f64, height: f64) -> Geometry {
    let pier = 0.3;
    let (half, span, crown) = (width / 2.0, width / 2.0 - pier, height - 0.25);
    let segments = 32;
    let mut faces: Vec<[DVec3; 4]> = Vec::new();
    let z = THICKNESS / 2.0;
    // a point of the opening's edge, and the one above it
    let edge = |k: u32| {
        let angle = PI * (1.0 - f64::from(k) / f64::from(segments));
        [span * angle.cos(), crown * angle.sin()]
    };
    let mut strip = |[x0, y0]: [f64; 2], [x1, y1]: [f64; 2]| {
        let p = DVec3::new;
        faces.push([p(x0, y0, z), p(x1, y1, z), p(x1, height, z), p(x0, height, z)]);
        faces.push([p(x1, y1, -z), p(x0, y0, -z), p(x0, height, -z), p(x1, height, -z)]);
        faces.push([p(x0, y0, -z), p(x1, y1, -z), p(x1, y1, z), p(x0, y0, z)]);
    };
    strip([-half, 0.0], [-span, 0.0]);
    (0..segments).for_each(|k| strip(edge(k), edge(k + 1)));
    strip([span, 0.0], [half, 0.0]);
    shapes::quads(&faces)
}

/// A barrel vault along x, seen from below: `rise` high over y = 0.
fn vault(length: f64, width: f64, rise: f64) -> Geometry {
    let segments = 48;
    let edge = |k: u32| {
        let angle = PI * f64::from(k) / f64::from(segments);
        [rise * angle.sin(), -width / 2.0 * angle.cos()]
    };
    let face = |k: u32| {
        let ([y0, z0], [y1, z1]) = (edge(k), edge(k + 1));
        let p = |x: f64, y, z| DVec3::new(x * length / 2.0, y, z);
        [p(-1.0, y0, z0), p(1.0, y0, z0), p(1.0, y1, z1), p(-1.0, y1, z1)]
    };
    shapes::quads(&(0..segments).map(face).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_has_as_many_triangles_as_sponza() {
        let scene = atrium();
        let triangles = |mesh: usize| match &scene.meshes[mesh].geometry {
            Geometry::Triangles(t) => t.indices.len(),
            Geometry::Spheres(_) => 0,
        };
        let count: usize = scene.instances.iter().map(|i| triangles(i.mesh)).sum();
        assert!((240_000..300_000).contains(&count), "{count}");
        // all of it is in one place, and the camera stands in the court
        let eye = scene.cameras[0].camera_to_world.translation;
        assert!(eye.x.abs() < COURT[0] && eye.z.abs() < COURT[1] && (0.5..LEVELS[1]).contains(&eye.y));
    }
}
