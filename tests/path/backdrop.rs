//! What is behind a scene: camera rays show it, and mirrors, glass and light do not.

use super::*;
use skylit::integrators::backdrop::Backdrop;
use skylit::scene::builtin::shapes;
use skylit::scene::{EnvironmentMap, Sphere};
use skylit::stress::sampling::glass;

/// Dark but for a bright texel ahead.
fn lamp() -> Environment {
    Environment::Map(EnvironmentMap {
        name: "lamp".into(),
        width: 64,
        height: 32,
        radiance: (0..64 * 32).map(|k| Vec3::splat(if k == 16 * 64 + 32 { 100.0 } else { 0.1 })).collect(),
        factor: Vec3::splat(0.5),
        to_map: DMat3::IDENTITY,
    })
}

/// A sphere in the middle of an image that the environment is seen around.
fn ball(material: Material, environment: Environment) -> Scene {
    let camera = Camera::look_at(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, DVec3::Y, 0.9);
    let sphere = Geometry::Spheres(vec![Sphere { center: Vec3::ZERO, radius: 1.0 }]);
    Scene { environment, ..scene_of(vec![(sphere, material)], camera) }
}

fn image(kind: TracerKind, scene: &Scene, options: &PathOptions) -> Film {
    let flat = FlatScene::for_paths(scene);
    render(&tracer(&device(), kind, &flat), &flat, options).image.film
}

/// Surfaces keep their bits, whatever is behind them, and alpha does; a mirror shows the environment.
#[test]
fn gpu_surfaces_keep_their_light() {
    let device = device();
    let mirror = Material { kind: MaterialKind::Mirror, specular_color: Vec3::ONE, ..matte(0.0) };
    let options = PathOptions { samples: SampleSettings::new([24, 24], 16, 0), max_depth: 4, ..Default::default() };
    for (what, material) in [("matte", matte(0.5)), ("mirror", mirror), ("glass", glass(0.0, 1.5))] {
        let scene = ball(material, lamp());
        // the others are the same code
        let kinds = if what == "mirror" { tracers(&device) } else { vec![TracerKind::Compute] };
        for kind in kinds {
            let of = |backdrop| image(kind, &scene, &PathOptions { backdrop, ..options.clone() });
            let [map, blurred, hidden] = [Backdrop::Map, Backdrop::Blurred, Backdrop::Transparent].map(of);
            let mut counts = [0; 2];
            for (p, alpha) in map.coverage.iter().enumerate() {
                let values = |film: &Film| film.mean[3 * p..3 * p + 3].to_vec();
                if *alpha == 1.0 {
                    assert_eq!((values(&map), values(&map)), (values(&blurred), values(&hidden)), "{what} {kind} {p}");
                    assert!(values(&map)[0] > 0.0, "{what} {kind} {p}: a surface without light");
                    counts[0] += 1;
                } else if *alpha == 0.0 {
                    assert_eq!(values(&hidden), [0.0; 3], "{what} {kind} {p}");
                    assert!(values(&map)[0] > 0.0 && values(&blurred)[0] > 0.0);
                    counts[1] += 1;
                }
            }
            assert!(counts[0] > 50 && counts[1] > 100, "{what} {kind}: {counts:?}");
            assert_eq!((&map.coverage, &map.coverage), (&blurred.coverage, &hidden.coverage));
        }
    }
    assert_validation_clean(&device);
}

/// A blurred lamp is wide and weak, a blurred constant what it was, and both follow the environment's factor.
#[test]
fn gpu_blurred_environments() {
    let options = PathOptions {
        samples: SampleSettings::new([33, 33], 16, 0),
        backdrop: Backdrop::Blurred,
        max_depth: 1,
        ..Default::default()
    };
    // behind the camera there is a floor, so that the scene is not empty
    let behind = |environment| {
        let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 1.2);
        Scene { environment, ..scene_of(vec![(shapes::floor(DVec3::Z * 9.0, 1.0), matte(0.5))], camera) }
    };
    let film = image(TracerKind::Compute, &behind(lamp()), &options);
    let row = |x: usize| f64::from(film.mean[3 * (16 * 33 + x)]);
    let sharp =
        image(TracerKind::Compute, &behind(lamp()), &PathOptions { backdrop: Backdrop::Map, ..options.clone() });
    let greatest = |film: &Film| f64::from(film.mean.iter().copied().fold(0.0, f32::max));
    // the texel's solid angle times the density at half a texel aside and below, beside a constant
    let texel = std::f64::consts::PI / 32.0;
    let (deviation, aside) = (8f64.to_radians(), 0.5 * texel * 2f64.sqrt());
    let density = (-0.5 * (aside / deviation).powi(2)).exp() / (std::f64::consts::TAU * deviation * deviation);
    let expected = 0.05 + 49.95 * texel * texel * density;
    assert!((row(16) / expected - 1.0).abs() < 0.05, "{} is not {expected}", row(16));
    assert!(greatest(&sharp) > 30.0, "{}", greatest(&sharp));
    assert!(row(16) > row(20) && row(20) > row(26) && row(26) > 0.049, "it falls from the middle on");
    assert!((row(1) - 0.05).abs() < 0.005, "nothing of it arrives far away: {}", row(1));

    let constant = behind(Environment::Uniform(Vec3::new(0.25, 0.5, 1.0)));
    let film = image(TracerKind::Compute, &constant, &options);
    assert!(film.mean.chunks_exact(3).all(|c| c == [0.25, 0.5, 1.0]));
    assert_validation_clean(&device());
}
