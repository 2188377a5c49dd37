//! Lights of very different power, distance and extent in one scene. What each brings alone is known, or rendered alone; together they bring the sum, with hardly more
//! noise, and the error that an image reports is the error that it has. Grounds, powers and distances are varied over what files can have.

use super::*;
use skylit::scene::EnvironmentMap;
use skylit::scene::builtin::shapes;
use skylit::stress::sampling::add;

const SPP: u32 = 64;
/// Height of the lamp that is near.
const HEIGHT: f64 = 2.0;

/// A source of light: adds itself to a scene.
type Source = dyn Fn(&mut Scene);

fn options(spp: u32, seed: u32) -> PathOptions {
    PathOptions { samples: SampleSettings::new([24, 24], spp, seed), max_depth: 1, ..Default::default() }
}

/// A ground of this side, of which the view shows what is around the lamp.
fn ground(side: f64) -> Scene {
    let camera = Camera::look_at(DVec3::new(0.0, 1.9, 0.0), DVec3::ZERO, DVec3::Z, 1.9);
    scene_of(vec![(shapes::floor(DVec3::ZERO, side), matte(0.5))], camera)
}

/// The same ground, seen in a mirror: the path's first bounce is none that lights are sampled at. The mirror fills the view, and the ground reflects no further.
fn mirrored_ground(side: f64) -> Scene {
    let camera = Camera::look_at(DVec3::new(0.0, 1.0, 0.0), DVec3::new(0.0, 0.55, -3.0), DVec3::Y, 0.16);
    let mirror = Material { kind: MaterialKind::Mirror, specular_color: Vec3::ONE, ..Material::default() };
    let wall = shapes::rectangle(DVec3::new(0.0, 1.0, -3.0), DVec3::X * 4.0, DVec3::Y * 1.8);
    scene_of(vec![(shapes::floor(DVec3::ZERO, side), matte(0.5)), (wall, mirror)], camera)
}

fn lamp(kind: LightKind, position: DVec3, intensity: f64) -> impl Fn(&mut Scene) {
    move |scene| {
        scene.lights.push(Light {
            name: String::new(),
            kind,
            intensity: Vec3::splat(intensity as f32),
            position,
            direction: DVec3::NEG_Y,
            range: f64::INFINITY,
        });
    }
}

/// A square that faces down, of this intensity along its axis.
fn panel(position: DVec3, side: f64, intensity: f64) -> impl Fn(&mut Scene) {
    move |scene| {
        let square = shapes::rectangle(position, DVec3::X * side, DVec3::Z * side);
        add(scene, square, emitter((intensity / (side * side)) as f32));
    }
}

fn sky(radiance: f32) -> impl Fn(&mut Scene) {
    move |scene| scene.environment = Environment::Uniform(Vec3::splat(radiance))
}

/// A sky with a bright spot.
fn map(radiance: f32) -> impl Fn(&mut Scene) {
    move |scene| {
        let texel = |k: u32| radiance * if (200..204).contains(&k) { 100.0 } else { 1.0 };
        scene.environment = Environment::Map(EnvironmentMap {
            name: "map".into(),
            width: 32,
            height: 16,
            radiance: (0..512).map(|k| Vec3::splat(texel(k))).collect(),
            factor: Vec3::ONE,
            to_map: DMat3::IDENTITY,
        });
    }
}

/// Holds two sources in one scene against each of them alone. `noise`: relative RMSE that the image may have.
fn adds_up(device: &Arc<Device>, what: &str, scene: &Scene, sources: [&Source; 2], options: &PathOptions, noise: f64) {
    let with = |sources: &[&Source]| {
        let mut scene = scene.clone();
        sources.iter().for_each(|add_to| add_to(&mut scene));
        scene
    };
    let kinds = picked(device);
    let film = |scene: &Scene, options: &PathOptions| {
        let flat = FlatScene::for_paths(scene);
        render(&tracer(device, kinds[0], &flat), &flat, options).image.film
    };
    let alone = sources.map(|source| {
        film(&with(&[source]), &options.clone().with_samples(|s| (s.spp, s.seed) = (16 * options.samples.spp, 9)))
    });
    let both = film(&with(&sources), options);
    let truth: Vec<f64> =
        (alone[0].mean.iter().zip(&alone[1].mean)).map(|(&a, &b)| f64::from(a) + f64::from(b)).collect();
    let mean = truth.iter().sum::<f64>() / truth.len() as f64;
    let squares: f64 = both.mean.iter().zip(&truth).map(|(&m, t)| (f64::from(m) - t).powi(2)).sum();
    let rmse = (squares / truth.len() as f64).sqrt();
    let (reported, [a, b]) = (both.estimated_rmse(), [&alone[0], &alone[1]].map(|film| mean_of(film).0 / mean));
    println!("{what}: {:.3} + {:.3}, relative RMSE {:.4}, reported {:.4}", a, b, rmse / mean, reported / mean);
    assert!(rmse < noise * mean, "{what}: RMSE is {} of the mean, not below {noise}", rmse / mean);
    // evenly placed samples have less error than independent ones, which is what is reported
    assert!(rmse < 1.3 * reported + 1e-4 * mean, "{what}: RMSE is {rmse}, reported is {reported}");
}

#[test]
fn gpu_a_lamp_is_found_beside_a_sky_on_any_ground() {
    let device = device();
    let at = DVec3::Y * HEIGHT;
    for side in [20.0, 1e3, 1e6] {
        let scene = ground(side);
        let sky = sky(0.2);
        adds_up(
            &device,
            &format!("point, {side}"),
            &scene,
            [&lamp(LightKind::Point, at, 3.2), &sky],
            &options(SPP, 1),
            0.02,
        );
        adds_up(&device, &format!("panel, {side}"), &scene, [&panel(at, 0.4, 3.2), &sky], &options(SPP, 1), 0.02);
    }
    let mirrored = mirrored_ground(1e4);
    for intensity in [0.032, 3.2, 320.0] {
        let options = PathOptions { max_depth: 2, ..options(SPP, 1) };
        let what = format!("panel of {intensity} cd in a mirror");
        adds_up(&device, &what, &mirrored, [&panel(at, 0.4, intensity), &map(0.2)], &options, 0.06);
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_a_lamp_is_found_beside_a_sun() {
    let device = device();
    let spot = LightKind::Spot { inner_angle: 0.5, outer_angle: 0.9 };
    for (intensity, irradiance) in [(3.2, 1e-3), (3.2, 1.0), (3.2, 1e3)] {
        let sun = lamp(LightKind::Directional { angle: 0.01 }, DVec3::ZERO, irradiance);
        let what = format!("spot of {intensity} cd, sun of {irradiance} lx");
        adds_up(
            &device,
            &what,
            &ground(1e4),
            [&lamp(spot, DVec3::Y * HEIGHT, intensity), &sun],
            &options(SPP, 1),
            0.02,
        );
        adds_up(&device, &format!("{what}, sky"), &ground(1e4), [&sky(0.2), &sun], &options(SPP, 1), 0.02);
        adds_up(&device, &format!("{what}, map"), &ground(1e4), [&map(1e3), &sun], &options(SPP, 1), 0.04);
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_a_near_lamp_is_found_beside_a_far_and_strong_one() {
    let device = device();
    for (distance, power) in [(10.0, 1e2), (1e3, 1e6), (1e4, 1e8), (1e5, 1e12)] {
        let far = lamp(LightKind::Point, DVec3::new(0.6 * distance, 0.8 * distance, 0.0), power);
        let what = format!("{power:e} cd at {distance:e}");
        let near = lamp(LightKind::Point, DVec3::Y * HEIGHT, 3.2);
        adds_up(&device, &what, &ground(3.0 * distance), [&near, &far], &options(SPP, 1), 0.03);
    }
    assert_validation_clean(&device);
}

/// What is thought bright may be hidden: a roof keeps a strong light off, and what is left of it must not decide.
#[test]
fn gpu_a_weak_lamp_is_found_below_a_roof() {
    let device = device();
    let roof = (shapes::floor(DVec3::Y * 3.0, 90.0), matte(0.5));
    let under = |side: f64| {
        let mut scene = ground(side);
        add(&mut scene, roof.0.clone(), roof.1.clone());
        scene
    };
    let weak = lamp(LightKind::Point, DVec3::Y * HEIGHT, 1e-3);
    for strength in [1e1, 1e3, 1e5] {
        let above = lamp(LightKind::Point, DVec3::Y * 50.0, strength * 2500.0);
        adds_up(&device, &format!("lamp of {strength} lx above"), &under(1e3), [&weak, &above], &options(SPP, 1), 0.2);
        let sun = lamp(LightKind::Directional { angle: 0.0 }, DVec3::ZERO, strength);
        adds_up(&device, &format!("sun of {strength} lx above"), &under(1e3), [&weak, &sun], &options(SPP, 1), 0.02);
    }
    assert_validation_clean(&device);
}
