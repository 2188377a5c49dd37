//! Portals change the noise of an image and nothing else. A floor is lit through a hole in a lid that hides everything else: a closed form.

use super::*;
use skylit::scene::builtin::shapes;
use skylit::scene::{EnvironmentMap, Portal};

const RHO: f64 = 0.6;
/// Edge of the square hole, one unit above the floor.
const EDGE: f64 = 0.5;

/// The floor's point under the middle of the hole, seen from below the lid.
fn room(environment: Environment, portals: &[Portal]) -> Scene {
    let camera = Camera::look_at(DVec3::new(0.0, 0.1, 0.0), DVec3::ZERO, DVec3::Z, 0.02);
    // light that comes in past the lid's far edges is 1e-6 of it
    let (reach, half) = (2000.0, 0.5 * EDGE);
    let (width, middle) = (reach - half, 0.5 * (reach + half));
    let mut parts = vec![(shapes::floor(DVec3::ZERO, 4.0), matte(RHO as f32))];
    for side in [-1.0, 1.0] {
        let across = shapes::rectangle(DVec3::new(side * middle, 1.0, 0.0), DVec3::X * width, DVec3::Z * 2.0 * reach);
        let along = shapes::rectangle(DVec3::new(0.0, 1.0, side * middle), DVec3::X * EDGE, DVec3::Z * width);
        parts.extend([(across, matte(0.0)), (along, matte(0.0))]);
    }
    let mut scene = scene_of(parts, camera);
    (scene.environment, scene.portals) = (environment, portals.to_vec());
    scene
}

/// Over a part of the hole, from its edge at -x.
fn portal(share: f64) -> Portal {
    let corner = DVec3::new(-0.5 * EDGE, 1.0, -0.5 * EDGE);
    Portal { corner, edges: [DVec3::X * EDGE * share, DVec3::Z * EDGE] }
}

/// Share of the floor's light that comes through the hole: four times the view factor of a parallel rectangle with a corner overhead.
fn seen_through_the_hole() -> f64 {
    let a = 0.5 * EDGE;
    let r = (1.0 + a * a).sqrt();
    4.0 / (2.0 * std::f64::consts::PI) * 2.0 * (a / r * (a / r).atan())
}

/// Radiance 2 from everywhere.
fn bright() -> [(&'static str, Environment); 2] {
    let map = EnvironmentMap {
        name: "bright".into(),
        width: 16,
        height: 8,
        radiance: vec![Vec3::ONE; 128].into(),
        factor: Vec3::splat(2.0),
        to_map: glam::DMat3::IDENTITY,
    };
    [("constant", Environment::Uniform(Vec3::splat(2.0))), ("map", Environment::Map(map))]
}

fn options(strategy: Strategy, spp: u32) -> PathOptions {
    PathOptions { samples: SampleSettings::new([16, 16], spp, 5), strategy, max_depth: 1, ..Default::default() }
}

#[test]
fn gpu_portals_change_no_image() {
    let device = device();
    let expected = RHO * 2.0 * seen_through_the_hole();
    for (what, environment) in bright() {
        for (where_, portals) in [
            ("the whole hole", vec![portal(1.0)]),
            ("half of it", vec![portal(0.5)]),
            ("the hole, and once more half of it", vec![portal(1.0), portal(0.5)]),
            // behind the floor's back, and far larger than the hole
            ("nowhere", vec![Portal { corner: DVec3::new(-1.0, -3.0, -1.0), edges: [DVec3::X * 2.0, DVec3::Z * 2.0] }]),
        ] {
            let scene = room(environment.clone(), &portals);
            let what = format!("{what}, a portal over {where_}");
            for strategy in [Strategy::Mis, Strategy::Light] {
                let (spp, precision) =
                    if where_ == "nowhere" || portals[0] == portal(0.5) { (1024, 3e-2) } else { (256, 1e-3) };
                holds(&device, &what, &scene, &options(strategy, spp), expected, precision);
            }
        }
    }
    assert_validation_clean(&device);
}

/// With other lights beside: each is sampled, and the portal's density counts the choice among them.
#[test]
fn gpu_portals_stand_beside_lights() {
    let device = device();
    for (what, environment) in bright() {
        let mut scene = room(environment, &[portal(1.0)]);
        scene.lights.push(Light {
            name: String::new(),
            kind: LightKind::Point,
            intensity: Vec3::splat(0.1),
            position: DVec3::Y * 0.5,
            direction: DVec3::NEG_Y,
            range: f64::INFINITY,
        });
        let expected = RHO * (2.0 * seen_through_the_hole() + 0.1 / 0.25 / std::f64::consts::PI);
        holds_with(&tracers(&device), 2e-6, &device, what, &scene, &options(Strategy::Mis, 256), expected, 1e-2);
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_portals_lessen_noise() {
    let device = device();
    let expected = RHO * 2.0 * seen_through_the_hole();
    for (what, environment) in bright() {
        let squared_error = |portals: &[Portal]| {
            let scene = room(environment.clone(), portals);
            let flat = FlatScene::for_paths(&scene);
            let film =
                render(&tracer(&device, TracerKind::Compute, &flat), &flat, &options(Strategy::Mis, 16)).image.film;
            film.mean.iter().map(|&m| (f64::from(m) - expected).powi(2)).sum::<f64>() / film.mean.len() as f64
        };
        let [without, with] = [squared_error(&[]), squared_error(&[portal(1.0)])];
        println!("{what}: squared error at 16 samples {without:.3e}, with a portal {with:.3e}");
        assert!(with < 0.1 * without, "{what}: {with} with a portal, {without} without");
    }
    assert_validation_clean(&device);
}
