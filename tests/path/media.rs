//! Volumes within volumes, a camera inside of one, and thin walls that light goes straight through.

use super::*;
use skylit::scene::builtin::shapes;
use skylit::scene::material::{Specular, Transmission};

/// A camera at a height above the floor that looks straight down, so narrowly that all its rays are as long.
fn down_from(y: f64) -> Camera {
    Camera::look_at(DVec3::new(0.05, y, 0.08), DVec3::new(0.05, 0.0, 0.08), DVec3::Z, 1e-3)
}

fn options(spp: u32) -> PathOptions {
    PathOptions { samples: SampleSettings::new([16, 16], spp, 11), ..Default::default() }
}

/// What leaves of a colour this much after a unit of length.
fn body(ior: f32, left: f64, priority: i32) -> Material {
    Material {
        metallic: 0.0,
        roughness: 0.0,
        ior,
        dielectric_priority: priority,
        transmission: Transmission {
            factor: 1.0,
            thickness: 1.0,
            attenuation_color: Vec3::splat(left as f32),
            attenuation_distance: if left < 1.0 { 1.0 } else { f32::INFINITY },
            ..Default::default()
        },
        ..Material::default()
    }
}

fn block(lo: f64, hi: f64, half: f64) -> Geometry {
    shapes::cuboid(DVec3::new(-half, lo, -half), DVec3::new(half, hi, half))
}

/// What is seen through surfaces that are met at a right angle, each of which reflects ((a - b) / (a + b))^2 once: no path of one reflection ends at the light.
fn through(indices: &[f64]) -> f64 {
    indices.windows(2).map(|w| 1.0 - ((w[0] - w[1]) / (w[0] + w[1])).powi(2)).product()
}

fn light_below(parts: Vec<(Geometry, Material)>, camera: Camera) -> Scene {
    let mut all = vec![(shapes::floor(DVec3::new(0.0, -1.0, 0.0), 20.0), emitter(1.0))];
    all.extend(parts);
    scene_of(all, camera)
}

/// Directly seen light, without what is reflected between surfaces and comes back.
fn direct(device: &Arc<Device>, what: &str, scene: &Scene, surfaces: u32, expected: f64) {
    // reflections back and forth need two bounces more than the way straight through
    let options = PathOptions { max_depth: surfaces, ..options(512) };
    holds_but_for(3e-5, device, what, scene, &options, expected, 5e-3);
}

fn direct_on_compute(device: &Arc<Device>, what: &str, scene: &Scene, surfaces: u32, expected: f64) {
    holds_on_compute(3e-5, device, what, scene, &PathOptions { max_depth: surfaces, ..options(512) }, expected, 5e-3);
}

/// Absorption inside of the innermost volume, and of the outer one again once the inner is left; and surfaces refract by both media that meet there.
#[test]
fn gpu_volumes_lie_in_each_other() {
    let device = device();
    let outer = |left| (block(0.0, 1.0, 4.0), body(1.5, left, 0));
    let inner = |ior, left| (block(0.3, 0.7, 2.0), body(ior, left, 0));
    let one = light_below(vec![outer(1.0), inner(1.33, 1.0)], down_from(3.0));
    direct_on_compute(&device, "glass that holds water", &one, 4, through(&[1.0, 1.5, 1.33, 1.5, 1.0]));
    let absorbing = light_below(vec![outer(0.5), inner(1.5, 0.2)], down_from(3.0));
    // nothing is reflected between media of one index
    direct(
        &device,
        "absorption on both sides",
        &absorbing,
        4,
        0.5f64.powf(0.6) * 0.2f64.powf(0.4) * through(&[1.0, 1.5, 1.0]),
    );
    let clear = light_below(vec![outer(0.5), inner(1.33, 1.0)], down_from(3.0));
    direct_on_compute(
        &device,
        "a clear body within",
        &clear,
        4,
        0.5f64.powf(0.6) * through(&[1.0, 1.5, 1.33, 1.5, 1.0]),
    );
}

/// Bodies that overlap: the one of higher priority is there, and the other's surface within it is not.
#[test]
fn gpu_the_volume_of_higher_priority_is_there() {
    let device = device();
    // water from 0.2 to 0.8, glass from 0.6 to 1.4
    let overlapping = |water: i32, glass: i32| {
        let parts = vec![(block(0.2, 0.8, 4.0), body(1.33, 0.3, water)), (block(0.6, 1.4, 3.0), body(1.5, 0.6, glass))];
        light_below(parts, down_from(3.0))
    };
    let indices = through(&[1.0, 1.5, 1.33, 1.0]);
    direct(&device, "glass first", &overlapping(0, 1), 4, 0.6f64.powf(0.8) * 0.3f64.powf(0.4) * indices);
    direct_on_compute(&device, "water first", &overlapping(1, 0), 4, 0.6f64.powf(0.6) * 0.3f64.powf(0.6) * indices);
    // what overlaps with itself is one body
    let parts = vec![(block(0.2, 0.8, 4.0), body(1.33, 0.3, 0)), (block(0.6, 1.4, 3.0), body(1.33, 0.3, 0))];
    let mut same = light_below(parts, down_from(3.0));
    same.meshes[2].material = 1;
    direct_on_compute(&device, "one body of two", &same, 4, 0.3f64.powf(1.2) * through(&[1.0, 1.33, 1.0]));
}

/// A camera inside of volumes knows in which: light is absorbed on the way to it, also light that light samples bring.
#[test]
fn gpu_the_camera_may_be_inside() {
    let device = device();
    // radiance is the square of the index more in water than outside
    let square = 1.33 * 1.33;
    let water = light_below(vec![(block(0.0, 1.0, 4.0), body(1.33, 0.3, 0))], down_from(0.5));
    direct_on_compute(&device, "in water", &water, 2, square * 0.3f64.powf(0.5) * through(&[1.33, 1.0]));
    let parts = vec![(block(0.0, 1.0, 4.0), body(1.5, 0.5, 0)), (block(0.3, 0.7, 2.0), body(1.33, 0.2, 0))];
    let both = light_below(parts, down_from(0.5));
    direct(
        &device,
        "in water in glass",
        &both,
        4,
        square * 0.2f64.powf(0.2) * 0.5f64.powf(0.3) * through(&[1.33, 1.5, 1.0]),
    );
    // mirrored and far from the origin: the winding is still what says inside
    let mut moved = both.clone();
    let far = DAffine3::from_translation(DVec3::new(3e3, -2e3, 5e3)) * DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    moved.instances.iter_mut().for_each(|i| i.object_to_world = far);
    let at = |y: f64| far.transform_point3(DVec3::new(0.05, y, 0.08));
    moved.cameras = vec![Camera::look_at(at(0.5), at(0.0), DVec3::Z, 1e-3)];
    let options = PathOptions { max_depth: 4, ..options(512) };
    let expected = square * 0.2f64.powf(0.2) * 0.5f64.powf(0.3) * through(&[1.33, 1.5, 1.0]);
    holds_on_compute(1e-3, &device, "mirrored and moved", &moved, &options, expected, 5e-3);
    // under water, a point light too
    let mut lit = scene_of(
        vec![(block(-2.0, 1.0, 6.0), body(1.33, 0.5, 0)), (shapes::floor(DVec3::ZERO, 4.0), matte(0.8))],
        down_from(0.5),
    );
    lit.lights.push(Light {
        name: String::new(),
        kind: LightKind::Point,
        intensity: Vec3::splat(2.0),
        position: DVec3::new(0.05, 0.8, 0.08),
        direction: DVec3::NEG_Y,
        range: f64::INFINITY,
    });
    let expected = 0.8 / std::f64::consts::PI * 2.0 / 0.64 * 0.5f64.powf(0.8 + 0.5);
    holds_but_for(
        1e-4,
        &device,
        "a light in water",
        &lit,
        &PathOptions { max_depth: 1, ..self::options(16) },
        expected,
        5e-3,
    );
}

/// A wall without thickness that lets light through, but for what Fresnel's term reflects.
fn pane(tint: f32) -> Material {
    Material {
        metallic: 0.0,
        roughness: 0.0,
        base_color: Vec3::splat(tint).extend(1.0),
        transmission: Transmission { factor: 1.0, ..Default::default() },
        ..Material::default()
    }
}

/// A floor lit through panes by light without extent, which no BSDF sample finds; and by light with one, which both strategies find, once.
#[test]
fn gpu_light_goes_straight_through_panes() {
    let device = device();
    let reflected = 0.6 / std::f64::consts::PI;
    let schlick = |c: f64| 0.04 + 0.96 * (1.0 - c).powi(5);
    let camera = || Camera::look_at(DVec3::new(0.0, 0.1, 0.0), DVec3::ZERO, DVec3::Z, 0.02);
    let under = |panes: &[f64], lamp: Option<Geometry>| {
        let mut parts = vec![(shapes::floor(DVec3::ZERO, 10.0), matte(0.6))];
        parts.extend(panes.iter().map(|&y| (shapes::floor(DVec3::new(0.0, y, 0.0), 30.0), pane(0.9))));
        parts.extend(lamp.map(|l| (l, emitter(4.0))));
        scene_of(parts, camera())
    };
    let light = |kind, position: DVec3, direction: DVec3| Light {
        name: String::new(),
        kind,
        intensity: Vec3::splat(3.0),
        position,
        direction: direction.normalize(),
        range: f64::INFINITY,
    };
    let direct = |spp| PathOptions { max_depth: 1, ..options(spp) };
    for panes in [&[0.4][..], &[0.3, 0.5, 0.6]] {
        let n = panes.len() as i32;
        let at = DVec3::new(0.6, 0.8, 0.0);
        let pass = |c: f64| (0.9 * (1.0 - schlick(c))).powi(n);
        for (what, kind) in [("sun", LightKind::Directional { angle: 0.0 }), ("point", LightKind::Point)] {
            let mut scene = under(panes, None);
            scene.lights.push(light(kind, at, -at));
            let expected = reflected * 3.0 * 0.8 * pass(0.8);
            let name = format!("{what} through {n}");
            // all tracers where rays go through most walls
            if n > 1 {
                holds_but_for(1e-5, &device, &name, &scene, &direct(16), expected, 1e-3);
            } else {
                holds_on_compute(1e-5, &device, &name, &scene, &direct(16), expected, 1e-3);
            }
        }
        if n > 1 {
            continue;
        }
        // so wide that cosines differ little over it, and met by paths
        let mut scene = under(panes, None);
        scene.lights.push(light(LightKind::Directional { angle: 0.1 }, DVec3::ZERO, DVec3::NEG_Y));
        holds_on_compute(1e-5, &device, "disk", &scene, &direct(256), reflected * 3.0 * pass(1.0), 2e-2);
        let bsdf = PathOptions { strategy: Strategy::Bsdf, ..direct(1 << 14) };
        holds_on_compute(1e-5, &device, "disk", &scene, &bsdf, reflected * 3.0 * pass(1.0), 2e-2);
        // a light behind panes, as strategies see it: the same, whatever share each finds
        let lamp = shapes::rectangle(DVec3::new(0.2, 0.9, 0.1), DVec3::X * 0.5, DVec3::Z * 0.4);
        let scene = under(panes, Some(lamp));
        let flat = FlatScene::for_paths(&scene);
        let compute = tracer(&device, TracerKind::Compute, &flat);
        let of = |strategy, spp| mean_of(&render(&compute, &flat, &PathOptions { strategy, ..direct(spp) }).image.film);
        let (bsdf, error) = of(Strategy::Bsdf, 1 << 14);
        holds_but_for(2.0 * error / bsdf, &device, "lamp", &scene, &direct(512), bsdf, 5e-3);
        holds_but_for(
            2.0 * error / bsdf,
            &device,
            "lamp",
            &scene,
            &PathOptions { strategy: Strategy::Light, ..direct(512) },
            bsdf,
            5e-3,
        );
    }
    // seen through a pane, at no bounce at all
    let mut seen = scene_of(
        vec![(shapes::floor(DVec3::ZERO, 4.0), emitter(2.0)), (shapes::floor(DVec3::Y, 4.0), pane(0.9))],
        down_from(2.0),
    );
    seen.materials[1].specular = Specular { factor: 0.0, ..Default::default() };
    holds(&device, "lamp behind a pane", &seen, &PathOptions { max_depth: 0, ..options(16) }, 1.8, 1e-3);
}
