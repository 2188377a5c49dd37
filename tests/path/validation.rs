//! Kernels of all features under the validation layer: it checks the SPIR-V of every kernel with the features that are switched on, which takes longer than
//! compiling it. The other tests of this folder have the layer with `SKYLIT_FULL` (`./scripts/test.sh --full`).

use super::*;
use crate::common::new_device;
use glam::{Affine2, Vec2, Vec4};
use skylit::accel::features::SceneFeatures;
use skylit::integrators::ao::{Hemisphere, Occlusion};
use skylit::integrators::backdrop::Backdrop;
use skylit::integrators::path::ambient::{Ambient, OccludedLight};
use skylit::integrators::path::points::PointLight;
use skylit::integrators::path::{Lens, PixelFilter, TextureFilter, View};
use skylit::interface::records::bake::BakePoint;
use skylit::interface::{BsdfModel, LightKind as Kind, MaterialFeature, PathFeature, TextureFeature};
use skylit::realtime::{Preset, Realtime, Settings};
use skylit::scene::builtin::shapes;
use skylit::scene::material::{
    AlphaMode, Anisotropy, Clearcoat, DiffuseTransmission, Iridescence, Retroreflection, Sheen, Specular, TextureSlot,
    Transmission, VolumeScatter,
};
use skylit::scene::{EnvironmentMap, Filter, Ground, Portal, Sphere, Texture, Wrap};

/// All BSDFs, textures in all slots, alpha of both kinds, and lights of all kinds: so many that a tree chooses among them.
fn everything() -> Scene {
    let mut scene = bsdf::scene(&bsdf::cases());
    let slot = Some(TextureSlot { texture: 0, texcoord: 0, transform: Affine2::IDENTITY });
    let textured = Material {
        base_color_texture: slot,
        metallic_roughness_texture: slot,
        emissive: Vec3::ONE,
        emissive_texture: slot,
        normal_texture: slot,
        occlusion_texture: slot,
        clearcoat: Clearcoat {
            factor: 0.5,
            texture: slot,
            roughness_texture: slot,
            normal_texture: slot,
            ..Default::default()
        },
        sheen: Sheen { color: Vec3::ONE, color_texture: slot, roughness_texture: slot, ..Default::default() },
        transmission: Transmission { factor: 0.5, texture: slot, ..Default::default() },
        specular: Specular { texture: slot, color_texture: slot, ..Default::default() },
        anisotropy: Anisotropy { strength: 0.5, texture: slot, ..Default::default() },
        iridescence: Iridescence { factor: 0.5, texture: slot, thickness_texture: slot, ..Default::default() },
        diffuse_transmission: DiffuseTransmission {
            factor: 0.5,
            texture: slot,
            color_texture: slot,
            ..Default::default()
        },
        retroreflection: Retroreflection { factor: 0.5, texture: slot },
        alpha_mode: AlphaMode::Blend,
        ..Material::default()
    };
    let body = Transmission {
        factor: 1.0,
        thickness: 1.0,
        attenuation_color: Vec3::splat(0.5),
        attenuation_distance: 1.0,
        ..Default::default()
    };
    let volume_scatter = VolumeScatter { color: Vec3::splat(0.5), anisotropy: 0.3 };
    let masked = Material { base_color_texture: slot, alpha_mode: AlphaMode::Mask { cutoff: 0.5 }, ..matte(0.5) };
    let sphere = Geometry::Spheres(vec![Sphere { center: Vec3::new(0.0, 2.0, -1.0), radius: 0.5 }]);
    let at = |y: f64| shapes::rectangle(DVec3::new(0.0, y, -0.5), DVec3::X, DVec3::Z);
    let triangle = scene.meshes[0].geometry.clone();
    // textures of directions that lie differently on a surface
    let mut turned = triangle.clone();
    if let Geometry::Triangles(mesh) = &mut turned {
        mesh.tangents = vec![Vec4::new(1.0, 0.0, 0.0, 1.0); mesh.positions.len()];
        mesh.clearcoat_tangents = vec![Vec4::new(0.0, 0.0, 1.0, -1.0); mesh.positions.len()];
        mesh.anisotropy_tangents = mesh.clearcoat_tangents.clone();
        mesh.more_texcoords = vec![vec![Vec2::ZERO; mesh.positions.len()]];
    }
    for (geometry, material) in [
        (turned, textured),
        (triangle.clone(), masked),
        (
            triangle.clone(),
            Material { transmission: body, volume_scatter, dispersion: 0.5, roughness: 0.3, ..Material::default() },
        ),
        (triangle.clone(), Material { unlit: true, ..Material::default() }),
        (triangle, emitter(1.0)),
        (at(3.0), emitter(1.0)),
        (sphere, emitter(1.0)),
    ] {
        let mesh = scene.meshes.len();
        scene.materials.push(material);
        scene.meshes.push(Mesh { name: String::new(), geometry, material: mesh, source: None });
        scene.instances.push(Instance { name: String::new(), mesh, object_to_world: DAffine3::IDENTITY });
    }
    // 16 bits a channel, half of it transparent
    let texels: Vec<u16> = (0..16u16).flat_map(|k| [30000, 30000, 60000, 4000 * k]).collect();
    scene.textures.push(Texture {
        name: String::new(),
        width: 4,
        height: 4,
        texels: texels.into(),
        wrap: [Wrap::Repeat; 2],
        filter: Filter::Linear,
    });
    let light = |kind| Light {
        name: String::new(),
        kind,
        intensity: Vec3::ONE,
        position: DVec3::Y * 2.0,
        direction: DVec3::NEG_Y,
        range: f64::INFINITY,
    };
    scene.lights = [
        LightKind::Spot { inner_angle: 0.1, outer_angle: 0.5 },
        LightKind::Directional { angle: 0.01 },
        LightKind::Led { half_angle: 0.5 },
    ]
    .into_iter()
    .chain(std::iter::repeat_n(LightKind::Point, 300))
    .map(light)
    .collect();
    scene.portals = vec![Portal { corner: DVec3::new(-1.0, 4.0, -1.0), edges: [DVec3::X * 2.0, DVec3::Z * 2.0] }];
    scene.environment = Environment::Map(EnvironmentMap {
        name: String::new(),
        width: 8,
        height: 4,
        radiance: vec![Vec3::ONE; 32].into(),
        factor: Vec3::ONE,
        to_map: glam::DMat3::IDENTITY,
    });
    scene
}

/// Runs `gpu_kernels_are_valid_here` in a process whose CPU driver does not optimize kernels: each is compiled for an
/// image of a few pixels, and optimizing them would be half of the test.
#[test]
fn gpu_kernels_of_all_features_are_valid() {
    const TEST: &str = "validation::gpu_kernels_are_valid_here";
    let child = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", TEST, "--ignored", "--nocapture"])
        .env("GALLIVM_PERF", "nopt")
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&child.stdout);
    assert!(child.status.success() && text.contains("1 passed"), "{text}{}", String::from_utf8_lossy(&child.stderr));
}

#[test]
#[ignore = "gpu_kernels_of_all_features_are_valid runs it in a process of its own"]
fn gpu_kernels_are_valid_here() {
    let device = new_device();
    let base = PathOptions { samples: SampleSettings::new([8, 8], 1, 0), max_depth: 3, ..Default::default() };
    let whole = PathOptions {
        firefly_clamp: 10.0,
        min_depth: 1,
        indirect_scale: 2.0,
        lens: Some(Lens { radius: 0.01, focus: 1.0 }),
        texture_filter: TextureFilter::RayCone,
        ambient: Some(Ambient {
            color: Vec3::ONE,
            occlusion: Occlusion { radius: 1.0, falloff: 2.0, hemisphere: Hemisphere::Shading },
            occluded: OccludedLight::All,
        }),
        ..base.clone().with_samples(|s| s.pixel_filter = PixelFilter::Tent)
    };
    let all_needs =
        Needs { shading: true, compensation: true, mip_levels: true, baked_occlusion: true, ..Needs::default() };
    let white = Needs { white: true, ..all_needs };
    let mut seen = (Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut holds = |kinds: &[TracerKind], scene: &Scene, needs: Needs, options: &PathOptions| {
        let flat = FlatScene::for_paths(scene);
        for &kind in kinds {
            let tracer = Tracer::new(&device, kind, &flat, needs).unwrap();
            let result = render(&tracer, &flat, options);
            assert_validation_clean(&device);
            let shading = tracer.features().shading.unwrap();
            seen.0.extend(BsdfModel::ALL.iter().filter(|&&f| shading.bsdfs.contains(f)));
            seen.1.extend(MaterialFeature::ALL.iter().filter(|&&f| shading.materials.contains(f)));
            seen.2.extend(TextureFeature::ALL.iter().filter(|&&f| shading.textures.contains(f)));
            seen.3.extend(PathFeature::ALL.iter().filter(|&&f| result.features.contains(f)));
            // frames in real time trace the same paths, and more
            if kind == TracerKind::Compute && options.ambient.is_some() {
                let settings = Settings { antialias: true, converge: true, ..Preset::Balanced.settings() };
                let mut frames = Realtime::radiance(&tracer, &flat, options.samples.size, &settings, options).unwrap();
                let aspect = f64::from(options.samples.size[0]) / f64::from(options.samples.size[1]);
                let camera = CameraRecord::new(&scene.cameras[0], flat.origin, aspect);
                for _ in 0..2 {
                    frames.frame(&tracer, &camera, &[]).unwrap();
                }
                assert_validation_clean(&device);
                seen.3.push(&PathFeature::Signal);

                // and light maps the same from points of surfaces on
                let options = PathOptions { ambient: None, lens: None, min_depth: 0, ..options.clone() };
                let is_mesh = |i: &Instance| matches!(scene.meshes[i.mesh].geometry, Geometry::Triangles(_));
                let instance = scene.instances.iter().position(is_mesh).unwrap() as u32;
                let point = BakePoint { instance, u: 0.25, v: 0.25, ..bytemuck::Zeroable::zeroed() };
                let mut light = PointLight::new(&tracer, &flat, &options, 1, 1).unwrap();
                light.estimate(&[point], 1, 0, &mut NoControl).unwrap();
                assert_validation_clean(&device);
                seen.3.push(&PathFeature::SurfacePoints);
            }
            seen.4.extend(Kind::ALL.iter().filter(|&&f| result.light_kinds.contains(f)));
        }
    };
    let scene = everything();
    let features = SceneFeatures::from_flat(&FlatScene::for_paths(&scene));
    assert!(features.alpha && features.stochastic_alpha && features.spheres && features.deep_texels, "{features:?}");
    assert!(features.many_texcoords, "{features:?}");
    holds(&tracers(&device), &scene, all_needs, &whole);
    // what excludes something of these, with as little else as there can be
    let little = scene_of(vec![(shapes::floor(DVec3::ZERO, 1.0), matte(0.5))], scene.cameras[0].clone());
    let little = Scene { environment: Environment::Uniform(Vec3::ONE), ..little };
    // clear walls exclude a sample of each group of lights
    let both = Scene { lights: vec![scene.lights[3].clone()], ..little.clone() };
    holds(&tracers(&device), &both, all_needs, &base);
    let blurred = PathOptions { backdrop: Backdrop::Blurred, ..base.clone() };
    holds(
        &[TracerKind::Compute],
        &Scene { environment: scene.environment.clone(), ..little.clone() },
        all_needs,
        &blurred,
    );
    let mut caught = both.clone();
    caught.lay_ground(Ground::Catcher, None);
    let catcher = PathOptions { catcher: caught.catcher(), ..base.clone() };
    holds(&tracers(&device), &caught, all_needs, &catcher);
    for options in [
        PathOptions { strategy: Strategy::Light, ..base.clone() },
        PathOptions { strategy: Strategy::Cosine, ..base.clone() },
        PathOptions { strategy: Strategy::Uniform, ..base.clone() },
        PathOptions { specular_only: true, ..base.clone() },
        PathOptions { background_only: true, ..base.clone() },
        PathOptions { backdrop: Backdrop::Transparent, ..base.clone() },
        PathOptions { view: Some(View::Normals), ..base.clone() },
    ] {
        holds(&[TracerKind::Compute], &little, all_needs, &options);
    }
    holds(&[TracerKind::Compute], &little, white, &PathOptions { white_sky: Some(0.5), ..base });
    assert_eq!(missing(BsdfModel::ALL, &seen.0, BsdfModel::label), [""; 0], "BSDFs of no image");
    assert_eq!(
        missing(MaterialFeature::ALL, &seen.1, MaterialFeature::label),
        [""; 0],
        "features of materials of no image"
    );
    assert_eq!(missing(TextureFeature::ALL, &seen.2, TextureFeature::label), [""; 0], "textures of no image");
    assert_eq!(missing(PathFeature::ALL, &seen.3, PathFeature::label), [""; 0], "features of paths of no image");
    assert_eq!(missing(Kind::ALL, &seen.4, Kind::label), [""; 0], "kinds of lights of no image");
}

/// Labels of the features that were not seen.
fn missing<T: Copy + PartialEq>(all: &[T], seen: &[&T], label: fn(T) -> &'static str) -> Vec<&'static str> {
    all.iter().filter(|f| !seen.contains(f)).map(|f| label(*f)).collect()
}
