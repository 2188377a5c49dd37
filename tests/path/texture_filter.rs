//! Textures read over ray cones: what they are for, where they must change nothing, what they must keep; and what is made for them only when required.

use super::*;
use glam::{Affine2, Vec2};
use skylit::integrators::path::{TextureFilter, View};
use skylit::scene::builtin::shapes;
use skylit::scene::material::AlphaMode;
use skylit::scene::{Filter, Projection, TexelData, Texture, TextureSlot, TriangleMesh, Wrap};

const SLOT: Option<TextureSlot> = Some(TextureSlot { texture: 0, texcoord: 0, transform: Affine2::IDENTITY });

fn texture(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> Texture {
    let rgba8: Vec<u8> = (0..width * height).flat_map(|i| texel(i % width, i / width)).collect();
    Texture {
        name: String::new(),
        width,
        height,
        texels: rgba8.into(),
        wrap: [Wrap::Repeat; 2],
        filter: Filter::Linear,
    }
}

fn grey(v: u8) -> [u8; 4] {
    [v, v, v, 255]
}

/// Squares of so many texels, two by two.
fn checkers(side: u32) -> Texture {
    texture(2 * side, 2 * side, |x, y| {
        if (x / side + y / side).is_multiple_of(2) { [230, 200, 180, 255] } else { [20, 30, 60, 255] }
    })
}

/// A parallelogram around `center` with edges `u` and `v` that faces `u x v` and shows so many textures in each direction.
fn textured(center: DVec3, u: DVec3, v: DVec3, times: f32) -> Geometry {
    let Geometry::Triangles(mesh) = shapes::rectangle(center, u, v) else { unreachable!("a rectangle has triangles") };
    let corners = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    Geometry::Triangles(TriangleMesh { texcoords: [corners.map(|c| c * times).to_vec(), Vec::new()], ..mesh })
}

/// One textured surface.
fn scene_with(geometry: Geometry, texture: Texture, camera: Camera) -> Scene {
    let material = Material { base_color_texture: SLOT, ..matte(1.0) };
    Scene { textures: vec![texture], ..scene_of(vec![(geometry, material)], camera) }
}

/// A plane of squares a unit wide, to the horizon.
fn plane() -> Scene {
    let camera = Camera::look_at(DVec3::new(0.3, 1.0, 0.0), DVec3::new(0.0, 0.6, -3.0), DVec3::Y, 0.8);
    scene_with(textured(DVec3::ZERO, DVec3::X * 400.0, DVec3::NEG_Z * 400.0, 200.0), checkers(32), camera)
}

/// Square textures of a repeated image, seen straight on in parallel: `texels` to a pixel's side.
fn wall(image: Texture, texels: f64) -> Scene {
    let mut camera = Camera::look_at(DVec3::new(0.0, 0.0, 1.0), DVec3::ZERO, DVec3::Y, 1.0);
    camera.projection = Projection::Orthographic { half_height: 8.0 };
    let times = 16.0 * texels / f64::from(image.width);
    scene_with(textured(DVec3::ZERO, DVec3::X * 16.0, DVec3::Y * 16.0, times as f32), image, camera)
}

fn with_levels(device: &Arc<Device>, kind: TracerKind, flat: &FlatScene) -> Tracer {
    let needs = Needs { shading: true, baked_occlusion: true, mip_levels: true, ..Default::default() };
    Tracer::new(device, kind, flat, needs).unwrap_or_else(|e| panic!("{kind}: {e}"))
}

fn options(spp: u32, texture_filter: TextureFilter) -> PathOptions {
    PathOptions { samples: SampleSettings::new([16, 16], spp, 3), texture_filter, ..Default::default() }
}

fn albedo(spp: u32, texture_filter: TextureFilter) -> PathOptions {
    PathOptions { view: Some(View::Albedo), ..options(spp, texture_filter) }
}

/// 1 + strength (texture - 1), and 1 without a texture.
#[test]
fn gpu_baked_occlusion_has_a_strength() {
    let device = device();
    let image = texture(1, 1, |_, _| grey(51));
    let mut scene = wall(image, 1.0);
    let view = PathOptions { view: Some(View::BakedOcclusion), ..options(1, TextureFilter::Bilinear) };
    for kind in picked(&device) {
        for (strength, occlusion_texture, expected) in
            [(1.0, SLOT, 0.2), (0.25, SLOT, 0.8), (0.0, SLOT, 1.0), (0.5, None, 1.0)]
        {
            let material = &mut scene.materials[0];
            (material.occlusion_texture, material.occlusion_strength) = (occlusion_texture, strength);
            let flat = FlatScene::for_paths(&scene);
            let film = render(&with_levels(&device, kind, &flat), &flat, &view).image.film;
            assert!(film.mean.iter().all(|m| (m - expected).abs() < 1e-6), "{kind}, {strength}: {:?}", &film.mean[..3]);
        }
    }
    assert_validation_clean(&device);
}

/// Levels of textures of 16 bits and of floats have the mean of the texture: four texels to a pixel's side.
#[test]
fn gpu_levels_of_deep_textures() {
    let device = device();
    let float: Vec<f32> = (0..64).flat_map(|i| if i % 2 == 0 { [9.0, 3.0, 0.0, 1.0] } else { [1.0; 4] }).collect();
    let unorm: Vec<u16> =
        (0..64).flat_map(|i| if i % 2 == 0 { [1200u16, 600, 0, 65535] } else { [0, 0, 0, 65535] }).collect();
    let mean = |v: [f64; 3]| v.map(|v| v / 65535.0 / 12.92);
    for (texels, expected) in [(TexelData::from(float), [5.0, 2.0, 0.5]), (unorm.into(), mean([600.0, 300.0, 0.0]))] {
        let image = Texture { texels, ..texture(8, 8, |_, _| grey(0)) };
        let scene = wall(image, 4.0);
        let flat = FlatScene::for_paths(&scene);
        for kind in picked(&device) {
            let film = render(&with_levels(&device, kind, &flat), &flat, &albedo(4, TextureFilter::RayCone)).image.film;
            for pixel in film.mean.chunks(3) {
                for (found, expected) in pixel.iter().zip(expected) {
                    let off = (f64::from(*found) - expected).abs();
                    assert!(off < 1e-4 * expected + 1e-6, "{kind}: {pixel:?}, not {expected}");
                }
            }
        }
    }
    assert_validation_clean(&device);
}

fn mean_square(a: &Film, b: &Film) -> f64 {
    let squares = a.mean.iter().zip(&b.mean).map(|(a, b)| f64::from(a - b).powi(2));
    squares.sum::<f64>() / a.mean.len() as f64
}

fn greatest_difference(a: &Film, b: &Film) -> f32 {
    a.mean.iter().zip(&b.mean).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

fn mean_colour(film: &Film) -> [f64; 3] {
    [0, 1, 2]
        .map(|c| film.mean.iter().skip(c).step_by(3).map(|&v| f64::from(v)).sum::<f64>() / (film.mean.len() / 3) as f64)
}

#[test]
fn gpu_cones_see_a_checkered_plane_with_less_noise() {
    let device = device();
    let scene = plane();
    let flat = FlatScene::for_paths(&scene);
    let sized = |o: PathOptions| o.with_samples(|s| s.size = [48, 32]);
    let truth = render(
        &tracer(&device, TracerKind::Compute, &flat),
        &flat,
        &sized(albedo(4096, TextureFilter::Bilinear).with_samples(|s| s.seed = 91)),
    );
    for kind in picked(&device) {
        let tracer = with_levels(&device, kind, &flat);
        let of = |spp, filter| render(&tracer, &flat, &sized(albedo(spp, filter))).image.film;
        let [points, cones] = [TextureFilter::Bilinear, TextureFilter::RayCone].map(|f| of(1, f));
        let [a, b] = [&points, &cones].map(|f| mean_square(f, &truth.image.film).sqrt());
        println!("{kind}: RMSE of one sample {a:.4} bilinear, {b:.4} over ray cones: {:.2} times less", a / b);
        assert!(b < 0.8 * a, "{kind}: RMSE {b} over ray cones, {a} without");
        // what is filtered is neither brighter nor darker
        let many = of(64, TextureFilter::RayCone);
        for (found, expected) in mean_colour(&many).into_iter().zip(mean_colour(&truth.image.film)) {
            assert!((found - expected).abs() < 0.02 * expected, "{kind}: mean {found}, expected {expected}");
        }
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_what_is_magnified_or_constant_stays_as_it_was() {
    let device = device();
    // a texel is four pixels, or half of one
    let near = wall(texture(4, 4, |x, y| [(40 * x + 15 * y) as u8, 90, (30 * y) as u8, 255]), 0.25);
    let constant = wall(texture(64, 64, |_, _| [37, 150, 201, 255]), 2.0);
    for (what, scene, bound) in [("magnified", near, 1e-6), ("constant", constant, 1e-5)] {
        let flat = FlatScene::for_paths(&scene);
        for kind in picked(&device) {
            let tracer = with_levels(&device, kind, &flat);
            let [points, cones] = [TextureFilter::Bilinear, TextureFilter::RayCone]
                .map(|f| render(&tracer, &flat, &albedo(2, f)).image.film);
            let difference = greatest_difference(&points, &cones);
            assert!(difference <= bound, "{what}, {kind}: differs by {difference}");
        }
    }
    assert_validation_clean(&device);
}

/// One image as sRGB and as numbers, and one that is not all there, from so far that only the last level is read.
#[test]
fn gpu_averages_are_those_of_what_texels_mean() {
    let device = device();
    let striped = texture(64, 64, |x, _| grey(if x % 2 == 0 { 188 } else { 0 }));
    let mut both = wall(striped, 64.0);
    both.materials[0].occlusion_texture = SLOT;
    let leaf = |x: u32, y: u32| if (x + y).is_multiple_of(2) { [255, 255, 255, 255] } else { [0, 0, 0, 0] };
    let mut masked = wall(texture(32, 32, leaf), 32.0);
    masked.materials[0].alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
    let light = f64::from(skylit::colour::srgb_decode(188.0 / 255.0)) / 2.0;
    let nearest = |mut scene: Scene| {
        scene.textures[0].filter = Filter::Nearest;
        scene
    };
    for (what, scene, view, expected) in [
        ("light", both.clone(), View::Albedo, light),
        ("numbers", both.clone(), View::BakedOcclusion, 94.0 / 255.0),
        ("nearest texels", nearest(both), View::Albedo, light),
        ("what is there", masked, View::Albedo, 1.0),
    ] {
        let flat = FlatScene::for_paths(&scene);
        for kind in picked(&device) {
            let film = render(
                &with_levels(&device, kind, &flat),
                &flat,
                &PathOptions { view: Some(view), ..options(16, TextureFilter::RayCone) },
            )
            .image
            .film;
            for (value, covered) in film.mean.chunks(3).zip(&film.coverage) {
                let found = f64::from(value[0]) / f64::from(*covered).max(1e-9);
                assert!(
                    *covered > 0.0 && (found - expected).abs() < 2e-5,
                    "{what}, {kind}: {found}, expected {expected}"
                );
            }
        }
    }
    assert_validation_clean(&device);
}

/// A flat mirror leaves cones as they are: what it shows is what is seen from behind it, at the whole distance.
#[test]
fn gpu_mirrors_keep_cones() {
    let device = device();
    let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 1.0);
    let shining = Material { emissive: Vec3::ONE, emissive_texture: SLOT, ..matte(0.0) };
    let mirror = Material { kind: MaterialKind::Mirror, specular_color: Vec3::ONE, ..Material::default() };
    let far = |z: f64, v: DVec3| textured(DVec3::new(0.0, 0.0, z), DVec3::X * 24.0, v * 24.0, 12.0);
    let seen = scene_of(vec![(far(-7.0, DVec3::Y), shining.clone())], camera.clone());
    let reflected = scene_of(
        // its rows run the other way about the middle, where there are two alike
        vec![
            (far(1.0, DVec3::NEG_Y), shining),
            (shapes::rectangle(DVec3::new(0.0, 0.0, -3.0), DVec3::X * 20.0, DVec3::Y * 20.0), mirror),
        ],
        camera,
    );
    let image =
        texture(32, 32, |x, y| grey(if (x.min(31 - x) / 4 + y.min(31 - y) / 4).is_multiple_of(2) { 250 } else { 5 }));
    for kind in picked(&device) {
        let of = |scene: &Scene, filter: TextureFilter| {
            let scene = Scene { textures: vec![image.clone()], ..scene.clone() };
            let flat = FlatScene::for_paths(&scene);
            let o = PathOptions { max_depth: 1, strategy: Strategy::Bsdf, ..options(4, filter) };
            render(&with_levels(&device, kind, &flat), &flat, &o).image.film
        };
        let [a, b] = [&seen, &reflected].map(|scene| of(scene, TextureFilter::RayCone));
        let difference = greatest_difference(&a, &b);
        assert!(difference < 1e-3, "{kind}: differs by {difference}");
        assert!(greatest_difference(&a, &of(&seen, TextureFilter::Bilinear)) > 0.1, "{kind}: nothing was filtered");
    }
    assert_validation_clean(&device);
}

/// Bounces of all kinds: every tracer makes the same image.
#[test]
fn gpu_tracers_agree_on_cones() {
    let device = device();
    let glass = Material {
        kind: MaterialKind::Glass,
        ior: 1.5,
        specular_color: Vec3::ONE,
        transmittance: Vec3::ONE,
        ..Material::default()
    };
    let shiny = Material { metallic: 1.0, roughness: 0.4, base_color_texture: SLOT, ..Material::default() };
    let mut scene = plane();
    let more = scene_of(
        vec![
            (shapes::sphere(DVec3::new(-0.5, 0.6, -2.5), 0.5), glass),
            (textured(DVec3::new(0.0, 1.0, -4.0), DVec3::X * 5.0, DVec3::Y * 1.6, 6.0), shiny),
            (
                shapes::icosphere(0.4, 2),
                Material { kind: MaterialKind::Mirror, specular_color: Vec3::splat(0.9), ..Material::default() },
            ),
        ],
        scene.cameras[0].clone(),
    );
    for (mesh, material) in more.meshes.into_iter().zip(more.materials) {
        let k = scene.materials.len();
        scene.materials.push(material);
        scene.meshes.push(Mesh { material: k, ..mesh });
        let place = if k == 3 { DVec3::new(0.7, 0.5, -2.4) } else { DVec3::ZERO };
        scene.instances.push(Instance {
            name: format!("mesh {k}"),
            mesh: k,
            object_to_world: DAffine3::from_translation(place),
        });
    }
    scene.environment = Environment::Uniform(Vec3::ONE);
    let flat = FlatScene::for_paths(&scene);
    let films: Vec<_> = tracers(&device)
        .into_iter()
        .map(|kind| {
            let tracer = with_levels(&device, kind, &flat);
            let [cones, points] = [TextureFilter::RayCone, TextureFilter::Bilinear].map(|f| {
                let o = PathOptions { max_depth: 6, ..options(64, f).with_samples(|s| s.size = [32, 24]) };
                render(&tracer, &flat, &o).image.film
            });
            for (found, expected) in mean_colour(&cones).into_iter().zip(mean_colour(&points)) {
                assert!((found - expected).abs() < 0.02 * expected, "{kind}: mean {found}, bilinear {expected}");
            }
            (kind, cones)
        })
        .collect();
    for (kind, film) in &films[1..] {
        // a ray that an edge's rounding sends elsewhere makes another path
        let rmse = mean_square(film, &films[0].1).sqrt();
        assert!(rmse < 2e-3, "{kind} and {}: RMSE {rmse}", films[0].0);
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_mip_levels_exist_when_required() {
    let device = device();
    let scene = plane();
    let flat = FlatScene::for_paths(&scene);
    for kind in picked(&device) {
        let (without, with) = (tracer(&device, kind, &flat), with_levels(&device, kind, &flat));
        let (a, b) = (without.stats(), with.stats());
        assert_eq!((a.mip_levels, a.mip_bytes), (0, 0), "{kind}");
        assert_eq!(b.mip_levels, 7, "{kind}: 64 texels and their halves");
        // 1365 texels of 8 bytes are below 64 x 64, and a record of 88; buffers are whole 16 bytes
        assert_eq!(b.mip_bytes, 1365 * 8 + 8 + 88 + 8, "{kind}");
        assert_eq!(b.scene_bytes - a.scene_bytes, b.mip_bytes, "{kind}");
        let film = |tracer: &Tracer| render(tracer, &flat, &albedo(4, TextureFilter::Bilinear)).image.film;
        assert_eq!(film(&without).mean, film(&with).mean, "{kind}: levels that nobody reads");
        let record = CameraRecord::new(&scene.cameras[0], flat.origin, 1.0);
        let refused = path::render(&without, &flat, &record, &albedo(1, TextureFilter::RayCone), &mut NoControl);
        assert!(refused.is_err_and(|e| e.to_string().contains("Needs::mip_levels")), "{kind}");
    }
    assert_validation_clean(&device);
}
