//! A furnished room of as many triangles as one asks for: closed on all sides but for a window,
//! with large walls, round shapes, thin parts and, in its bookcases, many small boxes. Rays that
//! start on its surfaces meet something near them and nearly always something.

use glam::{DAffine3, DQuat, DVec3, Vec3};

use super::random::Rng;
use super::shapes;
use crate::scene::{Geometry, Scene};

/// Half of the room's length along x and width along z, metres.
const HALF: [f64; 2] = [4.0, 3.0];
const HEIGHT: f64 = 2.8;
/// Thickness of the walls.
const WALL: f64 = 0.25;
/// The window in the wall at +x: its sill, its top, half of its width along z.
const WINDOW: [f64; 3] = [0.9, 2.3, 1.4];
/// Length and depth of a bookcase, and its boards' distance and thickness.
const CASE: [f64; 2] = [2.2, 0.32];
const BOARDS: u32 = 6;
const BOARD: [f64; 2] = [0.36, 0.02];
/// Where the bookcases stand along x, at the wall at -z.
const CASES: [f64; 3] = [-2.7, -0.4, 1.9];

/// A room of about `triangles` triangles, 10,000 at least. Round parts of furniture have more
/// segments where there are more triangles; what is left is in books: three fifths of 40,000.
pub fn room(triangles: u32) -> Scene {
    let mut scene = Scene { name: "room".to_owned(), ..Scene::default() };
    let [plaster, wood, metal, cloth, paper, leaf] = [
        ("plaster", Vec3::new(0.78, 0.76, 0.72)),
        ("wood", Vec3::new(0.42, 0.28, 0.16)),
        ("metal", Vec3::new(0.5, 0.5, 0.52)),
        ("cloth", Vec3::new(0.35, 0.38, 0.5)),
        ("paper", Vec3::new(0.7, 0.62, 0.5)),
        ("leaf", Vec3::new(0.16, 0.32, 0.1)),
    ]
    .map(|(name, color)| scene.add_matte(name, color));
    // parts are grids of segments squared, so furniture keeps its share
    let finest = (f64::from(triangles) / 400.0).sqrt();
    let segments = (finest.round() as u32).max(4);
    add_walls(&mut scene, plaster, wood);
    add_window(&mut scene, metal, cloth, segments);
    add_table(&mut scene, wood, segments);
    add_seats(&mut scene, cloth, wood, segments);
    add_lamps(&mut scene, metal, paper, segments);
    add_plant(&mut scene, wood, leaf, segments);
    add_bookcases(&mut scene, wood);
    let books = triangles.saturating_sub(count(&scene)) / 12;
    add_books(&mut scene, paper, books);
    scene.add_camera(DVec3::new(-3.4, 1.6, 2.5), DVec3::new(1.2, 0.9, -1.0), 65.0);
    scene
}

fn count(scene: &Scene) -> u32 {
    let triangles = |mesh: usize| match &scene.meshes[mesh].geometry {
        Geometry::Triangles(t) => t.indices.len() as u32,
        Geometry::Spheres(_) => 0,
    };
    scene.instances.iter().map(|i| triangles(i.mesh)).sum()
}

fn add_box(scene: &mut Scene, name: &str, lo: [f64; 3], hi: [f64; 3], material: usize) {
    scene.add_object(name, shapes::cuboid(lo.into(), hi.into()), material, DAffine3::IDENTITY);
}

/// Floor, ceiling and walls, which do not overlap, with skirting boards.
fn add_walls(scene: &mut Scene, plaster: usize, wood: usize) {
    let [x, z] = HALF;
    let (ox, oz) = (x + WALL, z + WALL);
    let [sill, top, half] = WINDOW;
    add_box(scene, "floor", [-ox, -WALL, -oz], [ox, 0.0, oz], wood);
    add_box(scene, "ceiling", [-ox, HEIGHT, -oz], [ox, HEIGHT + WALL, oz], plaster);
    add_box(scene, "wall", [-ox, 0.0, -oz], [-x, HEIGHT, oz], plaster);
    add_box(scene, "wall", [-x, 0.0, -oz], [x, HEIGHT, -z], plaster);
    add_box(scene, "wall", [-x, 0.0, z], [x, HEIGHT, oz], plaster);
    add_box(scene, "wall", [x, 0.0, -oz], [ox, HEIGHT, -half], plaster);
    add_box(scene, "wall", [x, 0.0, half], [ox, HEIGHT, oz], plaster);
    add_box(scene, "wall", [x, 0.0, -half], [ox, sill, half], plaster);
    add_box(scene, "wall", [x, top, -half], [ox, HEIGHT, half], plaster);
    add_box(scene, "skirting", [-x + 0.015, 0.0, z - 0.015], [x - 0.015, 0.08, z], wood);
    add_box(scene, "skirting", [-x, 0.0, -z], [-x + 0.015, 0.08, z], wood);
    add_box(scene, "skirting", [x - 0.015, 0.0, -z], [x, 0.08, z], wood);
    for k in 0..5 {
        let at = -3.2 + 1.6 * f64::from(k);
        add_box(scene, "beam", [at, HEIGHT - 0.14, -z], [at + 0.12, HEIGHT, z], wood);
    }
}

/// Frame, bars and a half-open blind of thin slats; curtains beside it; a radiator of thin fins
/// below.
fn add_window(scene: &mut Scene, metal: usize, cloth: usize, segments: u32) {
    let x = HALF[0];
    let [sill, top, half] = WINDOW;
    for z in [-half, -0.02, half - 0.04] {
        add_box(scene, "bar", [x + 0.1, sill, z], [x + 0.14, top, z + 0.04], metal);
    }
    for y in [sill, (sill + top) / 2.0, top - 0.04] {
        add_box(scene, "bar", [x + 0.101, y, -half], [x + 0.139, y + 0.04, half], metal);
    }
    let slat = shapes::cuboid(DVec3::new(-0.02, -0.0006, 0.02 - half), DVec3::new(0.02, 0.0006, half - 0.02));
    let slats = 8 + 2 * segments;
    for k in 0..slats {
        let y = top - 0.05 - (top - sill - 0.1) * f64::from(k) / f64::from(slats);
        let transform = DAffine3::from_rotation_translation(DQuat::from_rotation_z(0.6), DVec3::new(x + 0.06, y, 0.0));
        scene.add_object("slat", slat.clone(), metal, transform);
    }
    for side in [-1.0, 1.0] {
        let curtain = shapes::curtain(0.9, 2.3, 6 * segments, segments);
        let turn = DAffine3::from_rotation_translation(
            DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2),
            DVec3::new(x - 0.12, 0.2, side * (half + 0.4)),
        );
        scene.add_object("curtain", curtain, cloth, turn);
    }
    for k in 0..24 {
        let z = -0.9 + 0.075 * f64::from(k);
        add_box(scene, "fin", [x - 0.12, 0.12, z], [x - 0.03, 0.72, z + 0.008], metal);
    }
}

/// A table with turned legs, six chairs around it, cups and a bowl on it.
fn add_table(scene: &mut Scene, wood: usize, segments: u32) {
    let at = DVec3::new(0.6, 0.0, 0.6);
    let mut place = |name: &str, shape: Geometry, offset: DVec3, turn: f64| {
        let transform = DAffine3::from_rotation_translation(DQuat::from_rotation_y(turn), at + offset);
        scene.add_object(name, shape, wood, transform);
    };
    place("table", shapes::cuboid(DVec3::new(-1.0, 0.72, -0.5), DVec3::new(1.0, 0.76, 0.5)), DVec3::ZERO, 0.0);
    for (sx, sz) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        place("leg", shapes::lathe(&LEG, 2 * segments), DVec3::new(0.92 * sx, 0.0, 0.42 * sz), 0.0);
    }
    for k in 0..6 {
        let (row, side) = (f64::from(k % 3) - 1.0, if k < 3 { -1.0 } else { 1.0f64 });
        let (stand, turn) = (
            DVec3::new(0.62 * row, 0.0, 0.72 * side),
            if side < 0.0 { 0.1 * row } else { std::f64::consts::PI + 0.07 * row },
        );
        let on = |p: DVec3| stand + DQuat::from_rotation_y(turn) * p;
        place("seat", shapes::cuboid(DVec3::new(-0.22, 0.44, -0.22), DVec3::new(0.22, 0.47, 0.22)), stand, turn);
        for (sx, sz) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
            place("leg", shapes::cylinder(0.016, 0.44, segments), on(DVec3::new(0.19 * sx, 0.0, 0.19 * sz)), turn);
        }
        for spindle in 0..7 {
            let x = -0.18 + 0.06 * f64::from(spindle);
            place("spindle", shapes::cylinder(0.008, 0.45, segments), on(DVec3::new(x, 0.47, -0.2)), turn);
        }
        place("rail", shapes::cuboid(DVec3::new(-0.22, 0.92, -0.22), DVec3::new(0.22, 0.98, -0.18)), stand, turn);
        place("cup", shapes::lathe(&CUP, 2 * segments), DVec3::new(0.62 * row, 0.76, 0.3 * side), 0.0);
    }
    place("bowl", shapes::torus(0.16, 0.05, 4 * segments, 2 * segments), DVec3::new(0.05, 0.81, 0.0), 0.0);
}

/// A sofa with cushions at the wall at +z, and a rug of waves before it.
fn add_seats(scene: &mut Scene, cloth: usize, wood: usize, segments: u32) {
    let z = HALF[1];
    add_box(scene, "sofa", [-3.0, 0.12, z - 0.95], [-0.8, 0.4, z - 0.05], cloth);
    add_box(scene, "sofa's back", [-3.0, 0.4, z - 0.25], [-0.8, 0.85, z - 0.05], cloth);
    for x in [-3.2, -0.8] {
        add_box(scene, "arm", [x, 0.12, z - 0.95], [x + 0.2, 0.62, z - 0.05], cloth);
        for depth in [0.85, 0.15] {
            scene.add_object("foot", shapes::cylinder(0.025, 0.12, segments), wood, {
                DAffine3::from_translation(DVec3::new(x + 0.1, 0.0, z - depth))
            });
        }
    }
    let levels = (f64::from(segments) / 3.0).log2().round().clamp(1.0, 6.0) as u32;
    let mut rng = Rng::new(0x500f);
    for k in 0..5 {
        let at = DVec3::new(-2.75 + 0.42 * f64::from(k), 0.6, z - 0.4);
        let turn = DQuat::from_rotation_y(rng.range(-0.4, 0.4)) * DQuat::from_rotation_x(rng.range(-0.5, -0.2));
        let transform = DAffine3::from_scale_rotation_translation(DVec3::new(1.0, 1.0, 0.4), turn, at);
        scene.add_object("cushion", shapes::icosphere(0.24, levels), cloth, transform);
    }
    let rug = shapes::curtain(2.2, 1.3, 4 * segments, segments);
    let lay = DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    let transform =
        DAffine3::from_scale_rotation_translation(DVec3::new(1.0, 1.0, 0.12), lay, DVec3::new(-1.9, 0.012, 1.9));
    scene.add_object("rug", rug, cloth, transform);
}

/// A standing lamp, and one that hangs from the ceiling by a wire.
fn add_lamps(scene: &mut Scene, metal: usize, paper: usize, segments: u32) {
    let at = |x, y, z| DAffine3::from_translation(DVec3::new(x, y, z));
    scene.add_object("lamp's foot", shapes::cylinder(0.16, 0.02, 2 * segments), metal, at(-3.6, 0.0, 1.6));
    scene.add_object("pole", shapes::cylinder(0.009, 1.5, segments), metal, at(-3.6, 0.02, 1.6));
    scene.add_object("shade", shapes::lathe(&SHADE, 4 * segments), paper, at(-3.6, 1.35, 1.6));
    scene.add_object("wire", shapes::cylinder(0.003, 0.8, segments), metal, at(0.6, HEIGHT - 0.8, 0.6));
    scene.add_object(
        "globe",
        shapes::torus(0.22, 0.06, 4 * segments, 2 * segments),
        paper,
        at(0.6, HEIGHT - 0.86, 0.6),
    );
}

/// A pot with leaves that are long, thin and flat.
fn add_plant(scene: &mut Scene, wood: usize, leaf: usize, segments: u32) {
    let foot = DVec3::new(3.4, 0.0, 2.4);
    scene.add_object("pot", shapes::lathe(&POT, 3 * segments), wood, DAffine3::from_translation(foot));
    let mut rng = Rng::new(0x1eaf);
    let mut leaves = Vec::new();
    for _ in 0..10 * segments {
        let (turn, lean, length) = (rng.range(0.0, std::f64::consts::TAU), rng.range(0.1, 0.9), rng.range(0.4, 0.9));
        let out = DVec3::new(turn.cos() * lean, (1.0 - lean * lean).sqrt(), turn.sin() * lean);
        let across = DVec3::new(-turn.sin(), 0.0, turn.cos()) * 0.02;
        let from = foot + DVec3::new(rng.range(-0.05, 0.05), 0.3, rng.range(-0.05, 0.05));
        let (middle, tip) = (from + out * length * 0.6, from + out * length + DVec3::Y * (-0.2 * lean));
        leaves.push([from - across * 0.3, from + across * 0.3, middle + across, middle - across]);
        leaves.push([middle - across, middle + across, tip + across * 0.1, tip - across * 0.1]);
    }
    scene.add_object("leaves", shapes::quads(&leaves), leaf, DAffine3::IDENTITY);
}

fn add_bookcases(scene: &mut Scene, wood: usize) {
    let ([length, depth], [rise, thickness]) = (CASE, BOARD);
    let back = -HALF[1];
    for x in CASES {
        let (lo, hi) = (x - length / 2.0, x + length / 2.0);
        let height = f64::from(BOARDS) * rise + thickness;
        for side in [lo, hi - thickness] {
            add_box(scene, "bookcase", [side, 0.0, back], [side + thickness, height, back + depth], wood);
        }
        for k in 0..=BOARDS {
            let y = f64::from(k) * rise;
            add_box(scene, "board", [lo + thickness, y, back], [hi - thickness, y + thickness, back + depth], wood);
        }
    }
}

/// Books side by side on all boards, of equal number a board.
fn add_books(scene: &mut Scene, paper: usize, books: u32) {
    let ([length, depth], [rise, thickness]) = (CASE, BOARD);
    let boards = CASES.len() as u32 * BOARDS;
    let mut rng = Rng::new(0xb00c);
    for board in 0..boards {
        let (case, row) = ((board / BOARDS) as usize, board % BOARDS);
        let mine = books / boards + u32::from(board < books % boards);
        let space = length - 2.0 * thickness - 0.02;
        let (left, floor) = (CASES[case] - space / 2.0, f64::from(row) * rise + thickness);
        let pitch = space / f64::from(mine.max(1));
        for k in 0..mine {
            let lo = DVec3::new(left + pitch * f64::from(k), floor, rng.range(0.0, 0.02) - HALF[1]);
            let (wide, tall, deep) =
                (pitch * rng.range(0.8, 0.98), rng.range(0.2, rise - 0.05), rng.range(0.18, depth - 0.06));
            scene.add_object("book", shapes::cuboid(lo, lo + DVec3::new(wide, tall, deep)), paper, DAffine3::IDENTITY);
        }
    }
}

/// Radius and height of points of a table's leg.
const LEG: [[f64; 2]; 9] = [
    [0.03, 0.0],
    [0.035, 0.05],
    [0.02, 0.08],
    [0.03, 0.2],
    [0.045, 0.45],
    [0.025, 0.6],
    [0.045, 0.63],
    [0.045, 0.7],
    [0.04, 0.72],
];

/// Radius and height of points of a cup, closed at its bottom.
const CUP: [[f64; 2]; 7] =
    [[0.02, 0.0], [0.032, 0.005], [0.038, 0.04], [0.04, 0.08], [0.037, 0.08], [0.034, 0.04], [0.02, 0.01]];

/// Radius and height of points of a lamp's shade.
const SHADE: [[f64; 2]; 4] = [[0.24, 0.0], [0.14, 0.3], [0.135, 0.3], [0.235, 0.0]];

/// Radius and height of points of a pot.
const POT: [[f64; 2]; 6] = [[0.12, 0.0], [0.17, 0.28], [0.19, 0.3], [0.19, 0.33], [0.16, 0.33], [0.15, 0.28]];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_has_about_as_many_triangles_as_asked_for() {
        for triangles in [10_000, 40_000, 300_000, 2_000_000] {
            let scene = room(triangles);
            let found = count(&scene);
            assert!(found.abs_diff(triangles) < triangles / 20, "{triangles}: {found}");
            // a fifth at least in books
            let books = scene.instances.iter().filter(|i| i.name == "book").count() as u32 * 12;
            assert!(books > triangles / 5, "{triangles}: {books} in books");
        }
    }
}
