//! Whitted's integrator: direct light on what scatters it, seen through any chain of mirrors and glass.

use super::*;
use skylit::scene::builtin::shapes;

fn whitted(spp: u32) -> PathOptions {
    PathOptions {
        samples: SampleSettings::new([32, 24], spp, 5),
        strategy: Strategy::Light,
        specular_only: true,
        ..Default::default()
    }
}

/// Where there is neither mirror nor glass it is direct light: the same bits as paths of one bounce by light samples.
#[test]
fn gpu_without_mirrors_it_is_direct_light() {
    let device = device();
    let scene = skylit::scene::builtin::by_name("cornell-box").unwrap();
    let flat = FlatScene::for_paths(&scene);
    for kind in tracers(&device) {
        let direct = PathOptions { specular_only: false, max_depth: 1, ..whitted(8) };
        let [ours, theirs] =
            [whitted(8), direct].map(|o| render(&tracer(&device, kind, &flat), &flat, &o).image.film.mean);
        assert!(ours == theirs, "{kind}");
    }
    assert_validation_clean(&device);
}

/// A floor lit by a point, seen in a mirror that reflects three quarters, and in two such: closed forms. The camera looks at the mirror over its shoulder's height.
#[test]
fn gpu_mirrors_show_what_is_lit() {
    let device = device();
    let mirror = Material { kind: MaterialKind::Mirror, specular_color: Vec3::splat(0.75), ..Material::default() };
    // a vertical mirror at z = 0 that faces +z; the floor in front of it, lit from above the point that is seen
    let wall = shapes::rectangle(DVec3::new(0.0, 2.0, 0.0), DVec3::X * 8.0, DVec3::Y * 4.0);
    let (eye, seen) = (DVec3::new(0.0, 1.0, 2.0), DVec3::new(0.0, 0.0, 2.0));
    // the image of the seen point behind the mirror
    let camera = Camera::look_at(eye, DVec3::new(0.0, 0.0, -2.0), DVec3::Y, 0.01);
    let mut scene = scene_of(vec![(wall, mirror), (shapes::floor(DVec3::ZERO, 40.0), matte(0.6))], camera);
    scene.environment = Environment::Black;
    scene.lights.push(Light {
        name: "lamp".into(),
        kind: LightKind::Point,
        intensity: Vec3::splat(9.0),
        position: seen + DVec3::Y * 3.0,
        direction: DVec3::NEG_Y,
        range: f64::INFINITY,
    });
    // the light straight above; its own image in the mirror lights nothing: that is a caustic
    let expected = 0.75 * 0.6 / std::f64::consts::PI * 9.0 / 9.0;
    for kind in tracers(&device) {
        let flat = FlatScene::for_paths(&scene);
        let film = render(&tracer(&device, kind, &flat), &flat, &whitted(16)).image.film;
        let (mean, _) = mean_of(&film);
        assert!((mean - expected).abs() < 2e-3 * expected, "{kind}: {mean}, expected {expected}");
    }
    assert_validation_clean(&device);
}
