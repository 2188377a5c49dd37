//! Paths in one kernel, on CPU drivers and for scenes of few primitives, against the wavefront: the same images to the bit, the same numbers of rays, and the kernel that
//! the scene calls for.

use super::*;
use skylit::integrators::path::{Lens, PathKernel, PixelFilter, Schedule};
use skylit::scene::builtin::shapes;
use skylit::scene::material::{AlphaMode, Transmission};
use skylit::scene::{EnvironmentMap, Sphere};
use skylit::stress::sampling::{add, glass};

/// Whether the device can trace rays among other work.
fn is_possible(device: &Device) -> bool {
    device.info.packets() && device.info.is_cpu() && !device.info.cuts_long_loops()
}

fn options() -> PathOptions {
    // a width that is no multiple of a tile's, and samples that are no power of two
    PathOptions { samples: SampleSettings::new([37, 24], 19, 3), ..Default::default() }
}

/// A map of one row of texels a hundred times as bright as the rest.
fn map() -> Environment {
    Environment::Map(EnvironmentMap {
        name: "spot".into(),
        width: 8,
        height: 4,
        radiance: (0..32).map(|k| Vec3::splat(if k == 5 { 20.0 } else { 0.2 })).collect(),
        factor: Vec3::ONE,
        to_map: DMat3::IDENTITY,
    })
}

/// A sphere under a map, with a lamp beside it.
fn ball(material: Material) -> Scene {
    let camera = Camera::look_at(DVec3::new(0.0, 0.6, 3.2), DVec3::ZERO, DVec3::Y, 0.8);
    let sphere = Geometry::Spheres(vec![Sphere { center: Vec3::ZERO, radius: 1.0 }]);
    let mut scene = scene_of(vec![(sphere, material)], camera);
    scene.environment = map();
    scene.lights.push(Light {
        name: String::new(),
        kind: LightKind::Point,
        intensity: Vec3::ONE,
        position: DVec3::new(1.5, 1.5, 1.5),
        direction: DVec3::NEG_Y,
        range: f64::INFINITY,
    });
    scene
}

/// A box of glass and a pane that lets half of the rays through, over a floor, under a lamp that has a surface.
fn table() -> Scene {
    let camera = Camera::look_at(DVec3::new(0.0, 1.5, 4.0), DVec3::new(0.0, 0.5, 0.0), DVec3::Y, 0.9);
    let mut scene = scene_of(vec![(shapes::floor(DVec3::ZERO, 6.0), matte(0.6))], camera);
    add(&mut scene, shapes::cuboid(DVec3::new(-1.3, 0.05, -0.5), DVec3::new(-0.4, 0.95, 0.4)), glass(0.0, 1.5));
    let pane = Material { base_color: Vec3::splat(0.8).extend(0.5), alpha_mode: AlphaMode::Blend, ..matte(0.8) };
    add(&mut scene, shapes::rectangle(DVec3::new(0.8, 0.8, 0.3), DVec3::X, DVec3::Y), pane);
    add(&mut scene, shapes::rectangle(DVec3::new(0.0, 3.0, 0.0), DVec3::X, DVec3::Z), emitter(8.0));
    scene
}

fn rendered(tracer: &Tracer, flat: &FlatScene, options: &PathOptions, kernel: PathKernel) -> PathResult {
    render(tracer, flat, &PathOptions { kernel, ..options.clone() })
}

/// Compares both, and returns what the default did.
fn compare(device: &Arc<Device>, what: &str, scene: &Scene, options: &PathOptions) -> PathResult {
    let flat = FlatScene::for_paths(scene);
    let tracer = tracer(device, TracerKind::Compute, &flat);
    let [auto, wavefront] =
        [PathKernel::Auto, PathKernel::Wavefront].map(|kernel| rendered(&tracer, &flat, options, kernel));
    assert_eq!(wavefront.schedule, Schedule::Wavefront);
    let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    let differ =
        bits(&auto.image.film.mean).iter().zip(bits(&wavefront.image.film.mean)).filter(|(a, b)| **a != *b).count();
    assert_eq!(differ, 0, "{what}: values that differ");
    assert_eq!(bits(&auto.image.film.variance), bits(&wavefront.image.film.variance), "{what}");
    assert_eq!(bits(&auto.image.film.coverage), bits(&wavefront.image.film.coverage), "{what}");
    let counts = |r: &PathResult| [r.bounce_rays, r.shadow_rays, u64::from(r.longest_path)];
    assert_eq!(counts(&auto), counts(&wavefront), "{what}: rays");
    assert!(auto.bounce_rays > 0 && auto.image.film.mean.iter().any(|&v| v > 0.0), "{what}: black");
    auto
}

#[test]
fn gpu_megakernel_makes_the_images_of_the_wavefront() {
    let device = device();
    let cornell = common::scene("cornell-box");
    let metal = Material { metallic: 1.0, roughness: 0.2, ..Material::default() };
    let lens = Some(Lens { radius: 0.1, focus: 3.0 });
    let mut filtered = options();
    filtered.samples.pixel_filter = PixelFilter::BlackmanHarris;
    let cases: Vec<(&str, Scene, PathOptions)> = vec![
        ("cornell", cornell.clone(), options()),
        ("one bounce", cornell.clone(), PathOptions { max_depth: 1, ..options() }),
        ("white sky", cornell.clone(), PathOptions { white_sky: Some(0.5), ..options() }),
        ("clamped", cornell, PathOptions { firefly_clamp: 0.5, min_depth: 1, rr_depth: 1, lens, ..options() }),
        ("metal ball", ball(metal), options()),
        ("glass ball", ball(glass(0.0, 1.5)), options()),
        ("table", table(), options()),
        ("spheres and triangles", common::scene("cornell-spheres"), options()),
        ("a wide filter", common::scene("cornell-glass-sphere"), filtered),
    ];
    for (what, scene, options) in &cases {
        let schedule = compare(&device, what, scene, options).schedule;
        assert_eq!(matches!(schedule, Schedule::Megakernel(_)), is_possible(&device), "{what}: {schedule}");
    }
    assert_validation_clean(&device);
}

/// Where it cannot be used the wavefront is, says why, and an option that asks for it is refused.
#[test]
fn gpu_megakernel_is_for_few_leaves() {
    let device = device();
    let clear = Material {
        transmission: Transmission { factor: 1.0, ..Default::default() },
        roughness: 0.0,
        ..Material::default()
    };
    let mut window = common::scene("cornell-box");
    add(&mut window, shapes::rectangle(DVec3::ZERO, DVec3::X * 0.1, DVec3::Y * 0.1), clear);
    for (scene, schedule, says) in
        [(common::scene("stairs"), Schedule::Large, "at most 32 leaves"), (window, Schedule::NeedsQueues, "thin walls")]
    {
        let flat = FlatScene::for_paths(&scene);
        let tracer = tracer(&device, TracerKind::Compute, &flat);
        let (schedule, says) =
            if is_possible(&device) { (schedule, says) } else { (Schedule::CannotTrace, "Mesa 23 or later") };
        let options = PathOptions { samples: SampleSettings::new([8, 8], 1, 0), ..Default::default() };
        let auto = rendered(&tracer, &flat, &options, PathKernel::Auto).schedule;
        assert_eq!(auto, schedule);
        assert!(auto.to_string().contains(says), "{auto}");
        let camera = CameraRecord::new(&flat.scene.cameras[0], flat.origin, 1.0);
        let options = PathOptions { kernel: PathKernel::Megakernel, ..options };
        let refused = path::render(&tracer, &flat, &camera, &options, &mut NoControl).unwrap_err().to_string();
        assert!(refused.contains("--path-kernel megakernel") && refused.contains(says), "{refused}");
    }
}
