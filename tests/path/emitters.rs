//! Emitters of which only a part is there, directional lights with an extent, and samples that choose a light and a point on it at once.

use super::*;
use glam::{Affine2, Vec2, Vec4};
use skylit::scene::builtin::shapes;
use skylit::scene::material::AlphaMode;
use skylit::scene::{Filter, Texture, TextureSlot, TriangleMesh, Wrap};

const RHO: f64 = 0.6;

fn options(strategy: Strategy, spp: u32) -> PathOptions {
    PathOptions { samples: SampleSettings::new([16, 16], spp, 5), strategy, max_depth: 1, ..Default::default() }
}

/// A floor, its middle seen from above through a view of 2e-3 units.
fn floor_and(mut parts: Vec<(Geometry, Material)>) -> Scene {
    let camera = Camera::look_at(DVec3::new(0.0, 0.1, 0.0), DVec3::ZERO, DVec3::Z, 0.02);
    parts.insert(0, (shapes::floor(DVec3::ZERO, 10.0), matte(0.6)));
    scene_of(parts, camera)
}

/// A rectangle that faces down at height 1, with texture coordinates from 0 to 1 along x and z.
fn panel(x: [f64; 2], z: [f64; 2]) -> Geometry {
    let at = |x: f64, z: f64| DVec3::new(x, 1.0, z).as_vec3();
    Geometry::Triangles(TriangleMesh {
        positions: vec![at(x[0], z[0]), at(x[1], z[0]), at(x[1], z[1]), at(x[0], z[1])],
        indices: vec![[0, 1, 2], [0, 2, 3]],
        texcoords: [vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y], Vec::new()],
        ..TriangleMesh::default()
    })
}

/// What a floor below a panel of radiance 4 reflects in its middle.
fn below(x: [f64; 2], z: [f64; 2]) -> f64 {
    let corners = [(x[0], z[0]), (x[1], z[0]), (x[1], z[1]), (x[0], z[1])].map(|(x, z)| DVec3::new(x, 1.0, z));
    RHO * 4.0 * skylit::oracle::closed_form::polygon_form_factor(DVec3::ZERO, DVec3::Y, &corners).abs()
}

/// A panel of which one texel of 256 is bright: the floor gets its light and no other, and few light samples find it.
#[test]
fn gpu_panels_are_sampled_by_their_pictures() {
    let device = device();
    let (x, z) = ([-0.3, 1.3], [-0.4, 0.6]);
    let (column, row) = (5, 9);
    let mut texels = vec![0u8; 4 * 256];
    texels[4 * (16 * row + column)..][..4].fill(255);
    let slot = TextureSlot { texture: 0, texcoord: 0, transform: Affine2::IDENTITY };
    let mut scene = floor_and(vec![(panel(x, z), Material { emissive_texture: Some(slot), ..emitter(4.0) })]);
    scene.textures.push(Texture {
        name: String::new(),
        width: 16,
        height: 16,
        texels: texels.into(),
        wrap: [Wrap::Clamp; 2],
        filter: Filter::Nearest,
    });
    let texel = |range: [f64; 2], k: usize| [k, k + 1].map(|k| range[0] + (range[1] - range[0]) * k as f64 / 16.0);
    let expected = below(texel(x, column), texel(z, row));
    let flat = FlatScene::for_paths(&scene);
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &flat);
        for strategy in [Strategy::Mis, Strategy::Light] {
            let film = render(&tracer, &flat, &options(strategy, 64)).image.film;
            let values: Vec<f64> = film.mean.iter().map(|v| f64::from(*v)).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let error = (values.iter().map(|v| (v - expected).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
            println!(
                "{kind}, {strategy:?}: {mean:.6}, {expected:.6} by its form factor, RMSE {:.3} of it",
                error / expected
            );
            assert!((mean / expected - 1.0).abs() < 0.02, "{kind}, {strategy:?}: {mean}, not {expected}");
            // two without parts
            assert!(error < 0.3 * expected, "{kind}, {strategy:?}: {error} of {expected}");
        }
    }
    assert_validation_clean(&device);
}

/// Light samples of an emitter count what of it is there: half of it by a mask, a share of it by coverage, nothing of one whose alpha is 0.
#[test]
fn gpu_emitters_are_there_as_their_alpha_says() {
    let device = device();
    let (x, z) = ([-0.3, 1.3], [-0.4, 0.6]);
    let lit = |alpha_mode: AlphaMode, alpha: f32, texels: Option<[u8; 8]>| {
        let slot = texels.map(|_| TextureSlot { texture: 0, texcoord: 0, transform: Affine2::IDENTITY });
        let base_color = Vec4::new(0.0, 0.0, 0.0, alpha);
        let material = Material { alpha_mode, base_color, base_color_texture: slot, ..emitter(4.0) };
        let mut scene = floor_and(vec![(panel(x, z), material)]);
        scene.textures.extend(texels.map(|rgba8| Texture {
            name: String::new(),
            width: 2,
            height: 1,
            texels: rgba8.to_vec().into(),
            wrap: [Wrap::Clamp; 2],
            filter: Filter::Nearest,
        }));
        scene
    };
    let halves = Some([0, 0, 0, 255, 0, 0, 0, 51]);
    let middle = 0.5 * (x[0] + x[1]);
    let (near, far) = (below([x[0], middle], z), below([middle, x[1]], z));
    let mask = lit(AlphaMode::Mask { cutoff: 0.5 }, 1.0, halves);
    let blend = lit(AlphaMode::Blend, 0.5, halves);
    let covered = 0.5 * near + 0.1 * far;
    holds(&device, "half a mask", &mask, &options(Strategy::Mis, 512), near, 5e-3);
    holds(&device, "half a mask", &mask, &options(Strategy::Bsdf, 2048), near, 5e-3);
    holds(&device, "coverage", &blend, &options(Strategy::Mis, 512), covered, 8e-3);
    holds(&device, "coverage", &blend, &options(Strategy::Light, 512), covered, 8e-3);
    for (alpha_mode, alpha) in [(AlphaMode::Blend, 0.0), (AlphaMode::Mask { cutoff: 0.5 }, 0.4)] {
        let scene = lit(alpha_mode, alpha, None);
        let flat = FlatScene::for_paths(&scene);
        for kind in picked(&device) {
            let result = render(&tracer(&device, kind, &flat), &flat, &options(Strategy::Mis, 4));
            assert!(
                result.image.film.mean.iter().all(|&m| m == 0.0),
                "{kind}: light from an emitter that is not there"
            );
            assert_eq!(result.lights, 0, "{kind}");
        }
    }
    assert_validation_clean(&device);
}

/// A directional light with an extent is a disk in the sky: mirrors and the camera see its radiance, and all strategies bring the same light.
#[test]
fn gpu_wide_suns_are_met() {
    let device = device();
    let angle = 8f64.to_radians();
    let sun = |direction: DVec3| Light {
        name: String::new(),
        kind: LightKind::Directional { angle: angle as f32 },
        intensity: Vec3::ONE,
        position: DVec3::ZERO,
        direction: direction.normalize(),
        range: f64::INFINITY,
    };
    // irradiance over the disk's projected solid angle
    let radiance = 1.0 / (std::f64::consts::PI * (0.5 * angle).sin().powi(2));
    assert!((radiance - 65.4).abs() < 0.1);
    let mirror = Material { kind: MaterialKind::Mirror, specular_color: Vec3::splat(0.5), ..Material::default() };
    let camera = Camera::look_at(DVec3::new(0.0, 0.1, 0.0), DVec3::ZERO, DVec3::Z, 0.02);
    let mut reflected = scene_of(vec![(shapes::floor(DVec3::ZERO, 10.0), mirror)], camera);
    reflected.lights.push(sun(DVec3::NEG_Y));
    holds(&device, "a sun in a mirror", &reflected, &options(Strategy::Mis, 16), 0.5 * radiance, 1e-3);
    let mut seen = scene_of(
        vec![(shapes::floor(DVec3::new(0.0, -5.0, 0.0), 1.0), matte(0.5))],
        Camera::look_at(DVec3::ZERO, DVec3::Y, DVec3::Z, 0.02),
    );
    seen.lights.push(sun(DVec3::NEG_Y));
    holds_on_compute(2e-6, &device, "a sun in the view", &seen, &options(Strategy::Mis, 16), radiance, 1e-3);
    let mut floor = floor_and(Vec::new());
    floor.lights.push(sun(DVec3::new(-0.6, -0.8, 0.0)));
    floor.lights.push(sun(DVec3::new(0.8, -0.6, 0.0)));
    let expected = RHO / std::f64::consts::PI * (0.8 + 0.6);
    for (strategy, spp) in
        [(Strategy::Mis, 256), (Strategy::Light, 256), (Strategy::Bsdf, 1 << 14), (Strategy::Cosine, 1 << 14)]
    {
        holds(&device, "two suns on a floor", &floor, &options(strategy, spp), expected, 1e-2);
    }
}

/// One rectangle, the same as two triangles that are no neighbours in the mesh, and as a fan of triangles of very different areas: the same light, and
/// of each kind all points are reached.
#[test]
fn gpu_rectangles_are_what_their_triangles_are() {
    let device = device();
    for (k, (x, z)) in
        [([-0.3, 1.3], [-0.4, 0.6]), ([2.0, 2.1], [-0.05, 3.0]), ([-4.0, 4.0], [-3.0, 4.0])].into_iter().enumerate()
    {
        let expected = below(x, z);
        let one = floor_and(vec![(panel(x, z), emitter(4.0))]);
        let Geometry::Triangles(mut fan) = panel(x, z) else { unreachable!() };
        let inside = glam::Vec3::new((0.9 * x[0] + 0.1 * x[1]) as f32, 1.0, (0.3 * z[0] + 0.7 * z[1]) as f32);
        fan.positions.push(inside);
        fan.indices = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
        fan.texcoords = Default::default();
        let four = floor_and(vec![(Geometry::Triangles(fan), emitter(4.0))]);
        let flat = FlatScene::for_paths(&one);
        assert_eq!(render(&tracer(&device, TracerKind::Compute, &flat), &flat, &options(Strategy::Light, 1)).lights, 1);
        holds(&device, "a rectangle", &one, &options(Strategy::Light, 256), expected, 2e-3);
        holds(&device, "a fan", &four, &options(Strategy::Light, 256), expected, 2e-3);
        if k == 0 {
            holds(&device, "a rectangle", &one, &options(Strategy::Mis, 256), expected, 2e-3);
        }
    }
}

/// What is left to chance under several lights: samples that choose a light by a number of its own leave each light a random subset, and the error of a
/// smooth integrand falls by the root of their number; as one stratified sample it falls faster. From 64 to 1024 samples: more than by 8, where chance
/// alone gives 4.
#[test]
fn gpu_choices_among_lights_are_stratified() {
    let device = device();
    let panels =
        [([-1.0, 0.0], [-1.0, 0.0]), ([0.2, 1.0], [-1.0, -0.1]), ([-1.0, -0.3], [0.3, 1.0]), ([0.1, 0.9], [0.2, 1.1])];
    let scene = floor_and(panels.iter().map(|&(x, z)| (panel(x, z), emitter(4.0))).collect());
    let expected: f64 = panels.iter().map(|&(x, z)| below(x, z)).sum();
    let flat = FlatScene::for_paths(&scene);
    let compute = tracer(&device, TracerKind::Compute, &flat);
    let rmse = |spp: u32| {
        let film = render(&compute, &flat, &options(Strategy::Light, spp)).image.film;
        (film.mean.iter().map(|&m| (f64::from(m) - expected).powi(2)).sum::<f64>() / film.mean.len() as f64).sqrt()
            / expected
    };
    let (few, many) = (rmse(64), rmse(1024));
    println!("relative error with 64 samples {few:.2e}, with 1024 {many:.2e}");
    assert!(few / many > 8.0, "{few} with 64 samples, {many} with 1024");
}
