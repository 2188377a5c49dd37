//! Shading normals that are not the surface's, interpolated or from a map: no light is made, none comes through the surface, and all strategies agree.

use super::*;
use glam::{Affine2, DQuat, Vec2, Vec4};
use skylit::scene::builtin::shapes;
use skylit::scene::material::{Anisotropy, Clearcoat};
use skylit::scene::{Filter, Texture, TextureSlot, TriangleMesh, Wrap};
use std::f64::consts::PI;

fn options(spp: u32) -> PathOptions {
    PathOptions { samples: SampleSettings::new([16, 16], spp, 9), ..Default::default() }
}

/// Chiang, Li, Burley, "Taming the Shadow Terminator" (2019): what is left of light from `wi` on a surface of normal z whose shading normal is `n`.
fn shadowing(n: DVec3, wi: DVec3) -> f64 {
    let g = wi.z / (n.dot(wi) * n.z);
    if wi.z <= 0.0 || n.dot(wi) <= 0.0 || g <= 0.0 {
        0.0
    } else {
        (g + g * g - g.powi(3)).min(1.0).max(f64::from(g >= 1.0))
    }
}

fn tilted(degrees: f64) -> DVec3 {
    let (s, c) = degrees.to_radians().sin_cos();
    DVec3::new(s, 0.0, c)
}

/// A square of normal z seen from above; its shading normal, by its vertices or by a map of one texel.
fn sheet(normal: DVec3, mapped: bool, material: Material) -> Scene {
    let Geometry::Triangles(t) = shapes::rectangle(DVec3::ZERO, DVec3::X * 8.0, DVec3::Y * 8.0) else { unreachable!() };
    let interpolated = if mapped { DVec3::Z } else { normal };
    let mesh = TriangleMesh {
        normals: vec![interpolated.as_vec3(); 4],
        tangents: vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 4],
        texcoords: [vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y], Vec::new()],
        ..t
    };
    let camera = Camera::look_at(DVec3::new(0.0, 0.0, 2.0), DVec3::ZERO, DVec3::Y, 0.02);
    if !mapped {
        return scene_of(vec![(Geometry::Triangles(mesh), material)], camera);
    }
    let slot = TextureSlot { texture: 0, texcoord: 0, transform: Affine2::IDENTITY };
    let mut scene =
        scene_of(vec![(Geometry::Triangles(mesh), Material { normal_texture: Some(slot), ..material })], camera);
    let texel = (normal * 127.5 + 127.5).round().as_vec3().to_array().map(|c| c as u8);
    scene.textures.push(Texture {
        name: String::new(),
        width: 1,
        height: 1,
        texels: vec![texel[0], texel[1], texel[2], 255].into(),
        wrap: [Wrap::Repeat; 2],
        filter: Filter::Nearest,
    });
    scene
}

/// A sun near the horizon that a shading normal leans towards: a white surface reflects less than one that faces it, by the published factor.
#[test]
fn gpu_leaning_normals_gain_nothing_from_a_low_sun() {
    let device = device();
    for (tilt, elevation, known) in [
        (30.0, 3.0, Some(0.066)),
        (45.0, 10.0, None),
        (30.0, 60.0, None),
        (-30.0, 40.0, None),
        (-30.0, 20.0, Some(0.0)),
    ] {
        let n = tilted(tilt);
        let wi = tilted(90.0 - elevation);
        let expected = n.dot(wi).max(0.0) * shadowing(n, wi);
        assert!(
            expected <= 1.0 && known.is_none_or(|k: f64| (expected - k).abs() < 1e-3),
            "{tilt}, {elevation}: {expected}"
        );
        let mut scene = sheet(n, false, matte(1.0));
        scene.lights.push(Light {
            name: String::new(),
            kind: LightKind::Directional { angle: 0.0 },
            intensity: Vec3::splat(PI as f32),
            position: DVec3::ZERO,
            direction: -wi,
            range: f64::INFINITY,
        });
        if expected > 0.0 {
            let what = format!("tilt {tilt}, sun at {elevation}");
            if known.is_some() {
                holds_but_for(1e-4, &device, &what, &scene, &options(4), expected, 1e-3);
            } else {
                holds_on_compute(1e-4, &device, &what, &scene, &options(4), expected, 1e-3);
            }
            continue;
        }
        let flat = FlatScene::for_paths(&scene);
        let film = render(&tracer(&device, TracerKind::Compute, &flat), &flat, &options(4)).image.film;
        assert!(film.mean.iter().all(|&m| m == 0.0), "light on the side that is turned away");
    }
}

/// Under a white sky: what quadrature says, by every strategy, for normals of vertices and of maps.
#[test]
fn gpu_leaning_normals_under_a_sky() {
    let device = device();
    for (tilt, mapped) in [(20.0, false), (45.0, true)] {
        let n = match mapped {
            // as eight bits hold it
            true => ((tilted(tilt) * 127.5 + 127.5).round() / 127.5 - 1.0).normalize(),
            false => tilted(tilt),
        };
        let steps = 1200;
        let mut expected = 0.0;
        for i in 0..steps {
            let z = (f64::from(i) + 0.5) / f64::from(steps);
            for j in 0..steps {
                let turn = 2.0 * PI * (f64::from(j) + 0.5) / f64::from(steps);
                let wi = DVec3::new((1.0 - z * z).sqrt() * turn.cos(), (1.0 - z * z).sqrt() * turn.sin(), z);
                expected += n.dot(wi).max(0.0) * shadowing(n, wi) * 2.0 / f64::from(steps * steps);
            }
        }
        assert!(expected < 1.0 && expected > 0.5);
        let mut scene = sheet(n, mapped, matte(1.0));
        scene.environment = Environment::Uniform(Vec3::ONE);
        println!("tilt {tilt}: a white surface in white light keeps {expected:.4}");
        for strategy in [Strategy::Mis, Strategy::Bsdf, Strategy::Cosine] {
            holds_but_for(
                1e-4,
                &device,
                &format!("tilt {tilt}"),
                &scene,
                &PathOptions { strategy, ..options(512) },
                expected,
                3e-3,
            );
        }
        // the white sky of the views of the sky's share
        let white = PathOptions { white_sky: Some(0.5), max_depth: 1, ..options(512) };
        if !mapped {
            holds_but_for(1e-4, &device, &format!("tilt {tilt}, ao-sky"), &scene, &white, expected, 3e-3);
        }
    }
}

/// Rough and smooth, reflecting and transmitting: strategies agree about what a leaning normal leaves, and no more than came goes on.
#[test]
fn gpu_strategies_agree_about_leaning_normals() {
    let device = device();
    let gltf = |metallic, roughness| Material { metallic, roughness, ..Material::default() };
    let coat = skylit::scene::material::Clearcoat { factor: 1.0, roughness: 0.4, ..Default::default() };
    let thin = skylit::scene::material::Transmission { factor: 0.7, ..Default::default() };
    for (what, material) in [
        ("metal", gltf(1.0, 0.5)),
        ("plastic", gltf(0.0, 0.4)),
        ("coat", Material { clearcoat: coat, ..gltf(0.2, 0.6) }),
        ("thin walls", Material { transmission: thin, ..gltf(0.0, 0.5) }),
    ] {
        let mut scene = sheet(tilted(35.0), true, material);
        scene.environment = Environment::Uniform(Vec3::ONE);
        let flat = FlatScene::for_paths(&scene);
        let compute = tracer(&device, TracerKind::Compute, &flat);
        let of =
            |strategy, spp| mean_of(&render(&compute, &flat, &PathOptions { strategy, ..options(spp) }).image.film);
        let (bsdf, error) = of(Strategy::Bsdf, 4096);
        println!("{what}: {bsdf:.4} +- {error:.5}");
        assert!(bsdf <= 1.0 + 4.0 * error, "{what}: {bsdf} of the light goes on");
        holds_on_compute(4.0 * error / bsdf + 1e-5, &device, what, &scene, &options(1024), bsdf, 5e-3);
        let light = PathOptions { strategy: Strategy::Light, ..options(4096) };
        holds_but_for(4.0 * error / bsdf + 1e-5, &device, what, &scene, &light, bsdf, 1e-2);
    }
}

/// A clearcoat's map and an anisotropy texture may have tangents of their own beside a normal map's.
#[test]
fn gpu_textures_have_tangents_of_their_own() {
    let device = device();
    let slot = |texture| Some(TextureSlot { texture, texcoord: 0, transform: Affine2::IDENTITY });
    // light that a coat reflects to the camera if its normals lean towards y
    let light = Light {
        name: String::new(),
        kind: LightKind::Directional { angle: 0.0 },
        intensity: Vec3::ONE,
        position: DVec3::ZERO,
        direction: -DQuat::from_rotation_x(-40f64.to_radians()).mul_vec3(DVec3::Z),
        range: f64::INFINITY,
    };
    let mean = |has_normal_map: bool, tangents: [Option<Vec4>; 3]| {
        let coat = Clearcoat { factor: 1.0, roughness: 0.3, normal_texture: slot(0), ..Clearcoat::default() };
        let anisotropy = Anisotropy { strength: 0.8, ..Anisotropy::default() };
        let material = Material { metallic: 1.0, roughness: 0.5, clearcoat: coat, anisotropy, ..Material::default() };
        let mut scene = sheet(tilted(20.0), true, material);
        scene.materials[0].normal_texture = slot(1).filter(|_| has_normal_map);
        let flat_map = Texture { texels: vec![128u8, 128, 255, 255].into(), ..scene.textures[0].clone() };
        scene.textures.push(flat_map);
        scene.lights.push(light.clone());
        let Geometry::Triangles(mesh) = &mut scene.meshes[0].geometry else { unreachable!() };
        let [own, coat, stretched] = tangents.map(|t| t.map_or_else(Vec::new, |t| vec![t; 4]));
        (mesh.tangents, mesh.clearcoat_tangents, mesh.anisotropy_tangents) = (own, coat, stretched);
        let flat = FlatScene::for_paths(&scene);
        let film = render(&tracer(&device, TracerKind::Compute, &flat), &flat, &options(4)).image.film;
        film.mean.iter().map(|&m| f64::from(m)).sum::<f64>() / film.mean.len() as f64
    };
    let (x, y) = (Some(Vec4::new(1.0, 0.0, 0.0, 1.0)), Some(Vec4::new(0.0, 1.0, 0.0, 1.0)));
    let (all, separate) = (mean(false, [y, None, None]), mean(true, [x, y, y]));
    assert!((separate / all - 1.0).abs() < 0.03, "{separate}, expected {all}");
    for tangents in [[x, y, None], [x, None, y]] {
        let other = mean(true, tangents);
        assert!((other / all - 1.0).abs() > 0.1, "{tangents:?}: {other}, as {all}");
    }
}
