//! A city of any number of triangles: quarters of houses, each quarter turned by an angle of its
//! own, made of boxes by seed.

use glam::{DAffine3, DQuat, DVec2, DVec3, Vec3};

use super::random::Rng;
use super::shapes;
use crate::scene::{Environment, Geometry, Light, LightKind, Scene, TriangleMesh};

/// Side of a house's plot, metres.
const PLOT: f64 = 24.0;
/// Plots along a side of a quarter.
const PLOTS: usize = 6;
/// Boxes of a house: base, tower, its upper part, and what stands on the roof.
const BOXES: usize = 4;
/// Share of a quarter's square that its houses take: turned by [`TURN`] they stay within it.
const BUILT: f64 = 0.8;
/// Most by which a quarter is turned to either side, radians.
const TURN: f64 = 0.25;

/// About `n` triangles, at most as many: a ground, and boxes of 12; with a low sun.
pub fn city(n: u32) -> Scene {
    let mut scene = Scene { name: "city".to_owned(), ..Scene::default() };
    let [asphalt, stone] = [("asphalt", Vec3::splat(0.35)), ("stone", Vec3::new(0.68, 0.62, 0.54))]
        .map(|(name, color)| scene.add_matte(name, color));
    let houses = (n as usize - 2) / (12 * BOXES);
    let quarters = (houses as f64 / (PLOTS * PLOTS) as f64).sqrt().ceil().max(1.0);
    let side = quarters * PLOT * PLOTS as f64 / BUILT;
    scene.add_object("ground", shapes::floor(DVec3::ZERO, 1.1 * side), asphalt, DAffine3::IDENTITY);

    // house after house, quarter after quarter
    let mut rng = Rng::new(0xc17e);
    let mut mesh = TriangleMesh::default();
    let mut quarter = DAffine3::IDENTITY;
    for k in 0..houses {
        let (number, plot) = (k / (PLOTS * PLOTS), k % (PLOTS * PLOTS));
        if plot == 0 {
            let at = DVec2::new((number % quarters as usize) as f64, (number / quarters as usize) as f64);
            let middle = (at + 0.5) * (side / quarters) - 0.5 * side;
            let turn = DQuat::from_rotation_y(rng.range(-TURN, TURN));
            quarter = DAffine3::from_rotation_translation(turn, DVec3::new(middle.x, 0.0, middle.y));
        }
        let place = |j: usize| (j as f64 + 0.5 - 0.5 * PLOTS as f64) * PLOT;
        let at = DVec3::new(place(plot % PLOTS), 0.0, place(plot / PLOTS));
        // the centre is the highest
        let distance = quarter.transform_point3(at).length() / (0.5 * side);
        house(&mut mesh, &mut rng, &(quarter * DAffine3::from_translation(at)), 90.0 * (-3.0 * distance).exp());
    }
    scene.add_object("houses", Geometry::Triangles(mesh), stone, DAffine3::IDENTITY);
    scene.add_camera(DVec3::new(-0.36, 0.11, 0.42) * side + DVec3::Y * 40.0, DVec3::new(0.0, 10.0, 0.0), 35.0);
    scene.lights.push(low_sun());
    scene.environment = Environment::Uniform(Vec3::new(0.35, 0.45, 0.6));
    scene
}

/// A sun of the afternoon, whose shadows reach across streets and lie along no axis.
fn low_sun() -> Light {
    Light {
        name: "sun".to_owned(),
        kind: LightKind::Directional { angle: 0.0093 },
        intensity: Vec3::splat(3.0),
        position: DVec3::ZERO,
        direction: DVec3::new(-0.6, -0.5, 0.35).normalize(),
        range: f64::INFINITY,
    }
}

/// Boxes one on the other, each of which leaves something of the roof below.
fn house(mesh: &mut TriangleMesh, rng: &mut Rng, to_world: &DAffine3, extra: f64) {
    let mut half = [0, 1].map(|_| PLOT * rng.range(0.3, 0.48));
    let mut bottom = 0.0;
    for storey in 0..BOXES {
        let height = match storey {
            0 => rng.range(6.0, 18.0),
            3 => rng.range(1.5, 4.0),
            _ => rng.range(2.0, 12.0) + 0.5 * extra * rng.range(0.3, 1.0),
        };
        let [x, z] = half;
        let Geometry::Triangles(cuboid) = shapes::cuboid(DVec3::new(-x, bottom, -z), DVec3::new(x, bottom + height, z))
        else {
            return;
        };
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(cuboid.positions.iter().map(|p| to_world.transform_point3(p.as_dvec3()).as_vec3()));
        mesh.indices.extend(cuboid.indices.iter().map(|t| t.map(|k| k + first)));
        bottom += height;
        half = half.map(|side| side * rng.range(0.45, 0.9));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cities_have_about_as_many_triangles_as_asked_for_within_their_ground() {
        for n in [100u32, 5_000, 200_000] {
            let scene = city(n);
            let count = scene.triangle_count();
            assert!(count <= u64::from(n) && count + 12 * BOXES as u64 >= u64::from(n), "{count} of {n}");
            let Geometry::Triangles(ground) = &scene.meshes[0].geometry else { panic!() };
            let Geometry::Triangles(houses) = &scene.meshes[1].geometry else { panic!() };
            let half = ground.positions[0].x.abs();
            assert!(houses.positions.iter().all(|p| p.x.abs() < half && p.z.abs() < half && p.y >= 0.0));
            // houses do not cover everything: there are streets
            let highest = houses.positions.iter().map(|p| p.y).fold(0.0, f32::max);
            assert!(highest > 20.0 && highest < 200.0, "{highest}");
        }
        let places = |scene: Scene| match scene.meshes.into_iter().nth(1).map(|m| m.geometry) {
            Some(Geometry::Triangles(houses)) => houses.positions,
            _ => panic!("houses are triangles"),
        };
        assert_eq!(places(city(5_000)), places(city(5_000)), "by seed");
    }
}
