//! What materials do along a path: coverage, absorption, normal maps, textures; and views of them.

use super::*;
use glam::{Affine2, Vec2, Vec4};
use skylit::integrators::path::View;
use skylit::scene::builtin::shapes;
use skylit::scene::material::{AlphaMode, Transmission};
use skylit::scene::{Filter, Sphere, TexelData, Texture, TextureSlot, TriangleMesh, Wrap};

/// A camera at z = 2 that looks at the origin through a narrow view.
fn ahead() -> Camera {
    Camera::look_at(DVec3::new(0.0, 0.0, 2.0), DVec3::ZERO, DVec3::Y, 0.2)
}

/// A square across the view, which faces the camera.
fn sheet(z: f64) -> Geometry {
    shapes::rectangle(DVec3::new(0.0, 0.0, z), DVec3::X * 8.0, DVec3::Y * 8.0)
}

fn options(spp: u32) -> PathOptions {
    PathOptions { samples: SampleSettings::new([16, 16], spp, 7), ..Default::default() }
}

fn covered(alpha: f32, material: Material) -> Material {
    Material { alpha_mode: AlphaMode::Blend, base_color: material.base_color.truncate().extend(alpha), ..material }
}

/// A sheet that covers a share of what is behind it: for camera rays, for bounces and for rays to lights.
#[test]
fn gpu_coverage() {
    let device = device();
    let many = options(2048);
    let seen = scene_of(vec![(sheet(0.5), covered(0.3, emitter(2.0))), (sheet(0.0), emitter(5.0))], ahead());
    holds(&device, "camera rays", &seen, &many, 0.3 * 2.0 + 0.7 * 5.0, 3e-3);
    let twice = scene_of(
        vec![
            (sheet(0.5), covered(0.5, emitter(0.0))),
            (sheet(0.4), covered(0.25, emitter(0.0))),
            (sheet(0.0), emitter(5.0)),
        ],
        ahead(),
    );
    holds(&device, "two sheets", &twice, &many, 0.5 * 0.75 * 5.0, 4e-3);
    // a light behind the camera emits through a sheet that the camera does not look through
    let mut lit = scene_of(vec![(sheet(0.0), matte(0.5)), (sheet(3.0), covered(0.6, matte(0.0)))], ahead());
    lit.lights.push(Light {
        name: String::new(),
        kind: LightKind::Directional { angle: 0.0 },
        intensity: Vec3::splat(4.0),
        position: DVec3::ZERO,
        direction: DVec3::NEG_Z,
        range: f64::INFINITY,
    });
    holds(
        &device,
        "rays to lights",
        &lit,
        &PathOptions { max_depth: 1, ..many.clone() },
        0.4 * 4.0 * 0.5 / std::f64::consts::PI,
        4e-3,
    );
    let sky = Scene {
        environment: Environment::Uniform(Vec3::ONE),
        ..scene_of(vec![(sheet(0.0), matte(0.5)), (sheet(3.0), covered(1.0, matte(0.0)))], ahead())
    };
    let all = {
        let flat = FlatScene::for_paths(&sky);
        assert!(!flat.has_alpha(), "an alpha of 1 is opaque");
        flat.primitive_count()
    };
    assert_eq!(all, 4);
}

/// Coverage is right at pixels so small that few coordinates of the sheet are told apart in single precision, for camera rays, for bounces and for
/// rays to lights.
#[test]
fn gpu_coverage_of_tiny_pixels() {
    let device = device();
    let (eye, target) = (DVec3::new(0.9, 0.5, 2.0), DVec3::new(0.3, 0.2, 0.0));
    // of the sheet's width, which is 8
    for pixel in [6e-7, 6e-9] {
        let narrow = Camera::look_at(eye, target, DVec3::Y, 16.0 * pixel * 8.0 / 1.6);
        let seen = scene_of(vec![(sheet(0.5), covered(0.3, emitter(2.0))), (sheet(0.0), emitter(5.0))], narrow.clone());
        holds(&device, &format!("camera rays, {pixel:e}"), &seen, &options(1024), 0.3 * 2.0 + 0.7 * 5.0, 3e-3);
        // behind the camera, in a mirror
        let mirror = Material { kind: MaterialKind::Mirror, specular_color: Vec3::ONE, ..matte(1.0) };
        let both_sides = |m: Material| Material { double_sided: true, ..m };
        let behind = vec![
            (sheet(0.0), mirror),
            (sheet(3.0), both_sides(covered(0.3, emitter(2.0)))),
            (sheet(4.0), both_sides(emitter(5.0))),
        ];
        let reflected = scene_of(behind, narrow.clone());
        holds(&device, &format!("bounces, {pixel:e}"), &reflected, &options(1024), 0.3 * 2.0 + 0.7 * 5.0, 3e-3);
        let mut lit = scene_of(vec![(sheet(0.0), matte(0.5)), (sheet(3.0), covered(0.6, matte(0.0)))], narrow);
        lit.lights.push(Light {
            name: String::new(),
            kind: LightKind::Directional { angle: 0.0 },
            intensity: Vec3::splat(4.0),
            position: DVec3::ZERO,
            direction: DVec3::NEG_Z,
            range: f64::INFINITY,
        });
        let direct = PathOptions { max_depth: 1, ..options(1024) };
        let expected = 0.4 * 4.0 * 0.5 / std::f64::consts::PI;
        holds(&device, &format!("rays to lights, {pixel:e}"), &lit, &direct, expected, 4e-3);
    }
}

/// A box of index 1 that absorbs: light goes straight through it and loses e^(-a d).
#[test]
fn gpu_absorption() {
    let device = device();
    let glass = |ior| Material {
        metallic: 0.0,
        roughness: 0.0,
        ior,
        transmission: Transmission {
            factor: 1.0,
            thickness: 1.0,
            attenuation_color: Vec3::splat(0.3),
            attenuation_distance: 0.5,
            ..Default::default()
        },
        ..Material::default()
    };
    let body = shapes::cuboid(DVec3::new(-3.0, -3.0, 0.1), DVec3::new(3.0, 3.0, 0.9));
    // so narrow that all rays are as long
    let narrow = Camera::look_at(DVec3::new(0.0, 0.0, 2.0), DVec3::ZERO, DVec3::Y, 1e-3);
    let seen = scene_of(vec![(body.clone(), glass(1.0)), (sheet(0.0), emitter(5.0))], narrow);
    let expected = 5.0 * 0.3f64.powf(0.8 / 0.5);
    // rays start above surfaces, by what rounding asks of so large a box: a millionth of it
    holds_but_for(2e-5, &device, "absorption", &seen, &options(16), expected, 5e-3);
    // the sky through a box that absorbs nothing has what Fresnel leaves of two surfaces: with all bounces, everything
    let clear = Material {
        transmission: Transmission { attenuation_distance: f32::INFINITY, ..glass(1.5).transmission },
        ..glass(1.5)
    };
    let furnace = Scene { environment: Environment::Uniform(Vec3::ONE), ..scene_of(vec![(body, clear)], ahead()) };
    holds(&device, "clear box", &furnace, &options(256), 1.0, 3e-3);
}

/// Interpolated normals, which are far from the triangles' on so coarse a ball, make no light: in white light a white body is nowhere brighter.
#[test]
fn gpu_shading_normals_make_no_light() {
    let device = device();
    let Geometry::Triangles(mut ball) = shapes::icosphere(1.0, 1) else { panic!("no triangles") };
    ball.normals = ball.positions.iter().map(|p| p.normalize()).collect();
    let scene = Scene {
        environment: Environment::Uniform(Vec3::ONE),
        ..scene_of(vec![(Geometry::Triangles(ball), matte(1.0))], ahead())
    };
    let flat = FlatScene::for_paths(&scene);
    for kind in picked(&device) {
        let film = render(&tracer(&device, kind, &flat), &flat, &options(256)).image.film;
        let (mean, error) = mean_of(&film);
        println!("coarse ball, {kind}: {mean:.4} +- {error:.4}");
        assert!(
            film.mean
                .iter()
                .zip(&film.variance)
                .all(|(m, v)| f64::from(*m) <= 1.0 + 5.0 * (f64::from(*v) / 256.0).sqrt()),
            "{kind}"
        );
        // what the terminator takes is little where normals lean by up to 20 degrees
        assert!((0.9..1.0).contains(&mean), "{kind}: {mean}");
    }
    assert_validation_clean(&device);
}

/// Texels of 16 bits and floats are what they are, with and without filtering; integers are sRGB where textures are, floats never.
#[test]
fn gpu_deep_texels() {
    let device = device();
    let slot = Some(TextureSlot { texture: 0, texcoord: 0, transform: Affine2::IDENTITY });
    let with = |texels: TexelData, filter: Filter, material: Material| {
        let width = texels.len() as u32;
        let texture = Texture { name: String::new(), width, height: 1, texels, wrap: [Wrap::Repeat; 2], filter };
        let behind = (sheet(-0.5), emitter(5.0));
        Scene { textures: vec![texture], ..scene_of(vec![(textured_sheet(false), material), behind], ahead()) }
    };
    for filter in [Filter::Nearest, Filter::Linear] {
        let lamp = Material { emissive_texture: slot, ..emitter(2.0) };
        let dark = with(vec![600u16, 600, 600, 65535].into(), filter, lamp.clone());
        holds(&device, "16 bits", &dark, &options(4), 2.0 * 600.0 / 65535.0 / 12.92, 1e-3);
        let coded: f64 = 30001.0 / 65535.0;
        let bright = with(vec![30001u16, 30001, 30001, 65535].into(), filter, lamp.clone());
        let expected = 2.0 * ((coded + 0.055) / 1.055).powf(2.4);
        holds_but_for(2e-5, &device, "16 bits, above the linear part", &bright, &options(4), expected, 1e-3);
        let float = with(vec![7.25f32, 7.25, 7.25, 1.0].into(), filter, lamp);
        holds(&device, "floats", &float, &options(4), 2.0 * 7.25, 1e-3);
        // two values of alpha that are the same in 8 bits, and a cutoff between them
        let mask =
            Material { base_color_texture: slot, alpha_mode: AlphaMode::Mask { cutoff: 0.5002 }, ..emitter(2.0) };
        for (alpha, seen) in [(32800u16, 2.0), (32770, 5.0)] {
            let mask = with(vec![65535u16, 65535, 65535, alpha].into(), filter, mask.clone());
            holds(&device, "alpha of 16 bits", &mask, &options(4), seen, 1e-3);
        }
    }
    // numbers, and not colours
    let mapped = Material { normal_texture: slot, ..Material::default() };
    let straight = with(vec![32768u16, 32768, 65535, 65535].into(), Filter::Linear, mapped);
    let flat = FlatScene::for_paths(&straight);
    for kind in picked(&device) {
        let view = PathOptions { view: Some(View::Normals), ..options(2) };
        let film = render(&tracer(&device, kind, &flat), &flat, &view).image.film;
        let off = film.mean.chunks(3).map(|p| (Vec3::from_slice(p) - Vec3::Z).length()).fold(0.0, f32::max);
        // in 8 bits the nearest to straight is off by 0.005
        assert!(off < 5e-5, "{kind}: off by {off}");
    }
}

/// A square with texture coordinates and tangents along them; `mirrored`: its handedness is the other.
fn textured_sheet(mirrored: bool) -> Geometry {
    let Geometry::Triangles(t) = sheet(0.0) else { panic!("no triangles") };
    let w = if mirrored { -1.0 } else { 1.0 };
    Geometry::Triangles(TriangleMesh {
        normals: vec![Vec3::Z; 4],
        tangents: vec![Vec4::new(1.0, 0.0, 0.0, w); 4],
        texcoords: [vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y], Vec::new()],
        ..t
    })
}

/// A map of one colour bends all normals alike: the same normal as a view, also where transforms mirror and stretch.
#[test]
fn gpu_normal_maps_follow_tangents() {
    let device = device();
    let texel = [204u8, 153, 229, 255];
    let t = Vec3::new(204.0, 153.0, 229.0) / 255.0 * 2.0 - 1.0;
    let map = |x: [u8; 4]| Texture {
        name: String::new(),
        width: 1,
        height: 1,
        texels: x.to_vec().into(),
        wrap: [Wrap::Repeat; 2],
        filter: Filter::Nearest,
    };
    let slot = TextureSlot { texture: 0, texcoord: 0, transform: Affine2::IDENTITY };
    let material = Material { normal_texture: Some(slot), normal_scale: 0.5, ..matte(1.0) };
    let n = Vec3::new(0.5 * t.x, 0.5 * t.y, t.z).normalize();
    let turn = DAffine3::from_rotation_z(0.5);
    let cases = [
        ("as it is", DAffine3::IDENTITY, false, n),
        ("other handedness", DAffine3::IDENTITY, true, Vec3::new(n.x, -n.y, n.z)),
        ("turned", turn, false, turn.matrix3.as_mat3() * n),
        // x points the other way, and so does the tangent; the bitangent stays
        ("mirrored", DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)), false, Vec3::new(-n.x, n.y, n.z)),
    ];
    for (name, transform, handed, expected) in cases {
        for twice in [false, true] {
            let mut scene = scene_of(vec![(textured_sheet(handed), material.clone())], ahead());
            scene.textures.push(map(texel));
            scene.instances[0].object_to_world = transform;
            if twice {
                // placed twice it is not baked: the shader transforms
                let far = DAffine3::from_translation(DVec3::new(0.0, 0.0, -50.0));
                scene.instances.push(Instance { name: String::new(), mesh: 0, object_to_world: far });
            }
            let flat = FlatScene::for_paths(&scene);
            for kind in picked(&device) {
                let options = PathOptions {
                    view: Some(View::Normals),
                    ..options(1).with_samples(|s| (s.size, s.spp) = ([4, 4], 2))
                };
                let film = render(&tracer(&device, kind, &flat), &flat, &options).image.film;
                for pixel in film.mean.chunks(3) {
                    let off = (Vec3::from_slice(pixel) - expected).length();
                    assert!(off < 1e-4, "{name}, twice {twice}, {kind}: {pixel:?}, not {expected}");
                }
            }
        }
    }
}

/// An anisotropic mesh of a file without tangents and texture coordinates is rendered as one with tangents around the y axis; spheres, whose direction
/// is arbitrary, are rendered, too.
#[test]
fn gpu_anisotropy_without_texture_coordinates() {
    let device = device();
    let folder = tempfile::tempdir().unwrap();
    let Geometry::Triangles(square) = sheet(0.0) else { panic!("no triangles") };
    let floats: Vec<f32> =
        square.indices.iter().flatten().flat_map(|&i| square.positions[i as usize].to_array()).collect();
    std::fs::write(folder.path().join("a.bin"), bytemuck::cast_slice::<f32, u8>(&floats)).unwrap();
    let count = floats.len() / 3;
    let document = serde_json::json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3", "min": [-4, -4, 0], "max": [4, 4, 0] }],
        "bufferViews": [{ "buffer": 0, "byteLength": 12 * count }],
        "buffers": [{ "uri": "a.bin", "byteLength": 12 * count }],
        "materials": [{
            "pbrMetallicRoughness": { "roughnessFactor": 0.3 },
            "extensions": { "KHR_materials_anisotropy": { "anisotropyStrength": 0.9, "anisotropyRotation": 0.4 } },
        }],
        "extensionsUsed": ["KHR_materials_anisotropy"],
    });
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, document.to_string()).unwrap();
    let light = Light {
        name: String::new(),
        kind: LightKind::Directional { angle: 0.1 },
        intensity: Vec3::splat(4.0),
        position: DVec3::ZERO,
        direction: DVec3::new(-0.3, -0.2, -1.0).normalize(),
        range: f64::INFINITY,
    };
    let mut file = skylit::scene::load::load(path.to_str().unwrap()).unwrap();
    (file.cameras, file.lights) = (vec![ahead()], vec![light.clone()]);
    let mut ours = scene_of(vec![(textured_sheet(false), file.materials[0].clone())], ahead());
    ours.lights.push(light.clone());
    let ball = Geometry::Spheres(vec![Sphere { center: Vec3::ZERO, radius: 1.0 }]);
    let mut spheres = scene_of(vec![(ball, file.materials[0].clone())], ahead());
    spheres.lights.push(light);
    for kind in picked(&device) {
        let film = |scene: &Scene| {
            let flat = FlatScene::for_paths(scene);
            render(&tracer(&device, kind, &flat), &flat, &options(4)).image.film
        };
        let (a, b) = (film(&file), film(&ours));
        assert!(mean_of(&b).0 > 1e-3, "{kind}: nothing is lit");
        let off = a.mean.iter().zip(&b.mean).map(|(a, b)| (a - b).abs() / (a + b + 1e-3)).fold(0.0, f32::max);
        println!("{kind}: off by {off:e}");
        assert!(off < 1e-4, "{kind}: off by {off}");
        assert!(mean_of(&film(&spheres)).0 > 1e-3, "{kind}: no sphere is lit");
    }
    assert_validation_clean(&device);
}

/// Views are what the auxiliary outputs are, where a sample goes through the pixel's middle: at pixels that see one flat surface.
#[test]
fn gpu_views_show_surfaces() {
    let device = device();
    let colour = Material { base_color: Vec4::new(0.2, 0.5, 0.8, 1.0), ..Material::default() };
    let scene = scene_of(vec![(sheet(0.0), colour)], ahead());
    let flat = FlatScene::for_paths(&scene);
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &flat);
        let of = |view| {
            render(
                &tracer,
                &flat,
                &PathOptions { view: Some(view), ..options(1).with_samples(|s| (s.size, s.spp) = ([8, 8], 4)) },
            )
            .image
            .film
        };
        assert!(
            of(View::Albedo).mean.chunks(3).all(|p| (Vec3::from_slice(p) - Vec3::new(0.2, 0.5, 0.8)).length() < 1e-6)
        );
        assert!(of(View::Normals).mean.chunks(3).all(|p| (Vec3::from_slice(p) - Vec3::Z).length() < 1e-6));
        let depth = of(View::Depth);
        // two units ahead, a little more towards the corners
        assert!(depth.mean.iter().all(|&d| (2.0..2.03).contains(&d)), "{kind}: {:?}", depth.mean);
        assert!(of(View::BakedOcclusion).mean.iter().all(|&o| o == 1.0));
    }
    assert_validation_clean(&device);
}

/// A tracer that was made for less is refused: its image would be wrong.
#[test]
fn gpu_tracers_without_materials_are_refused() {
    let device = device();
    let scene = scene_of(vec![(sheet(0.0), matte(0.5))], ahead());
    let flat = FlatScene::for_paths(&scene);
    let record = CameraRecord::new(&scene.cameras[0], flat.origin, 1.0);
    for (needs, says) in [
        (Needs::default(), "Needs::shading"),
        (Needs { shading: true, white: true, ..Default::default() }, "Needs::white"),
    ] {
        let tracer = Tracer::new(&device, TracerKind::Compute, &flat, needs).unwrap();
        let error = path::render(&tracer, &flat, &record, &options(1), &mut NoControl).unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
    }
}

/// A sphere has tangents along which its u grows, and a light whose texture is sampled as it is seen.
#[test]
fn gpu_textures_of_spheres() {
    let device = device();
    let slot = Some(TextureSlot { texture: 0, texcoord: 0, transform: Affine2::IDENTITY });
    let with_map = |mut scene: Scene, texel: [u16; 4]| {
        let texels = texel.to_vec().into();
        let (wrap, filter) = ([Wrap::Repeat; 2], Filter::Nearest);
        scene.textures.push(Texture { name: String::new(), width: 1, height: 1, texels, wrap, filter });
        scene
    };
    // a map that bends normals to the right and up: by u, which grows from x to y, and to z
    let encode = |x: f32| (65535.0 * (0.5 * x + 0.5)).round() as u16;
    let t = Vec3::new(0.36, 0.48, 0.8);
    let mapped = Material { normal_texture: slot, ..matte(1.0) };
    let view =
        PathOptions { view: Some(View::Normals), samples: SampleSettings::new([1, 1], 1, 7), ..Default::default() };
    let turn = DAffine3::from_rotation_x(0.4);
    for (what, to_world) in [("as it is", DAffine3::IDENTITY), ("turned", turn)] {
        let at_x = Camera::look_at(
            to_world.transform_point3(DVec3::new(3.0, 0.0, 0.0)),
            DVec3::ZERO,
            to_world.transform_vector3(DVec3::Z),
            1e-3,
        );
        let mut scene = with_map(
            scene_of(vec![(shapes::sphere(DVec3::ZERO, 1.0), mapped.clone())], at_x),
            t.extend(1.0).to_array().map(encode),
        );
        scene.instances[0].object_to_world = to_world;
        // at x the tangent is y, and up is z
        let expected = to_world.matrix3.as_mat3() * Vec3::new(t.z, t.x, t.y);
        let flat = FlatScene::for_paths(&scene);
        for kind in picked(&device) {
            let film = render(&tracer(&device, kind, &flat), &flat, &view).image.film;
            let found = Vec3::from_slice(&film.mean);
            assert!(found.abs_diff_eq(expected, 2e-3), "{what}, {kind}: {found} is not {expected}");
        }
    }

    // a light beside the view, one half of which is black by its texture, and the same with the lit half turned away
    let lamp = || shapes::sphere(DVec3::new(0.0, 0.0, 0.0), 0.5);
    let ground = (sheet(-1.0), matte(0.5));
    let beside = DAffine3::from_translation(DVec3::new(1.5, 0.0, 0.0));
    let mean = |texels: [u16; 2], to_world: DAffine3, strategy: Strategy| {
        let light = Material { emissive_texture: slot, ..emitter(5.0) };
        let mut scene = scene_of(vec![(lamp(), light), ground.clone()], ahead());
        scene.instances[0].object_to_world = to_world;
        let rgba = texels.iter().flat_map(|v| [*v, *v, *v, u16::MAX]).collect::<Vec<u16>>().into();
        let (wrap, filter) = ([Wrap::Repeat; 2], Filter::Nearest);
        scene.textures.push(Texture { name: String::new(), width: 1, height: 2, texels: rgba, wrap, filter });
        let flat = FlatScene::for_paths(&scene);
        let settings = PathOptions { max_depth: 1, strategy, ..options(512) };
        mean_of(&render(&tracer(&device, TracerKind::Compute, &flat), &flat, &settings).image.film)
    };
    let white = u16::MAX;
    let (full, full_error) = mean([white, white], beside, Strategy::Mis);
    let down = beside * DAffine3::from_rotation_x(std::f64::consts::PI);
    // the upper half of the image is about z, and the ground sees the other
    for (what, texels, to_world, share) in [
        ("the half that is seen", [0, white], beside, None),
        ("the same half", [white, 0], down, None),
        ("a quarter of the light everywhere", [35199, 35199], beside, Some(0.25)),
    ] {
        let (lights, lights_error) = mean(texels, to_world, Strategy::Light);
        let (bsdf, bsdf_error) = mean(texels, to_world, Strategy::Bsdf);
        println!(
            "{what}: {lights} +- {lights_error} by lights, {bsdf} +- {bsdf_error} by BSDFs, {full} of a white one"
        );
        assert!((lights - bsdf).abs() < 4.5 * (lights_error + bsdf_error), "{what}: {lights} {bsdf}");
        match share {
            Some(share) => assert!((lights / full - share).abs() < 0.01, "{what}: {lights} of {full} +- {full_error}"),
            None => assert!(lights > 0.3 * full && lights < 0.98 * full, "{what}: {lights} of {full}"),
        }
    }
    assert_validation_clean(&device);
}
