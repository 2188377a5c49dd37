//! Materials whose textures are on more than two sets of texture coordinates.

use super::*;
use glam::{Affine2, Mat2, Vec2, Vec4};
use skylit::accel::features::SceneFeatures;
use skylit::integrators::path::TextureFilter;
use skylit::scene::builtin::shapes;
use skylit::scene::material::AlphaMode;
use skylit::scene::{Filter, Texture, TextureSlot, TriangleMesh, Wrap};

/// What makes each set of the first: exact in single precision.
fn transforms() -> [Affine2; 4] {
    let quarter = Vec2::splat(0.25);
    [
        Affine2::IDENTITY,
        Affine2::from_scale(Vec2::splat(2.0)),
        Affine2::from_scale_angle_translation(Vec2::splat(0.5), 0.0, quarter),
        Affine2::from_mat2_translation(Mat2::from_cols(Vec2::Y, Vec2::X), quarter),
    ]
}

/// A texture of 8 by 8 texels, a different one for each number.
fn texture(number: u32) -> Texture {
    let texel = |i: u32| {
        let (x, y) = (i % 8, i / 8);
        match number {
            // normals that lean
            3 => [100 + 8 * x as u8, 100 + 8 * y as u8, 240, 255],
            _ => [(40 + 25 * x) as u8, (30 + 20 * ((y + number) % 8)) as u8, (10 * (x + y)) as u8, (32 * x + 4) as u8],
        }
    };
    Texture {
        name: String::new(),
        width: 8,
        height: 8,
        texels: (0..64).flat_map(texel).collect::<Vec<u8>>().into(),
        wrap: [Wrap::Repeat; 2],
        filter: Filter::Linear,
    }
}

/// A square of four textures and one of holes before it, under a white sky. `slot`: how the texture of this number is placed on its set.
fn scene(slot: impl Fn(usize) -> TextureSlot, sets: usize) -> Scene {
    let corners = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    let set = |k: usize| corners.map(|c| transforms()[k].transform_point2(c)).to_vec();
    let square = |z: f64, tangents: bool| {
        let geometry = shapes::rectangle(DVec3::new(0.0, 0.0, z), DVec3::X * 2.0, DVec3::Y * 2.0);
        let Geometry::Triangles(mesh) = geometry else { panic!("no triangles") };
        Geometry::Triangles(TriangleMesh {
            normals: vec![Vec3::Z; 4],
            tangents: if tangents { vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 4] } else { Vec::new() },
            texcoords: [set(0), if sets > 1 { set(1) } else { Vec::new() }],
            more_texcoords: (2..sets).map(set).collect(),
            ..mesh
        })
    };
    let material = Material {
        base_color_texture: Some(slot(0)),
        metallic_roughness_texture: Some(slot(1)),
        emissive_texture: Some(slot(2)),
        emissive: Vec3::splat(0.5),
        normal_texture: Some(slot(3)),
        ..Material::default()
    };
    let holes = Material {
        base_color_texture: Some(TextureSlot { texture: 0, ..slot(3) }),
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        ..matte(1.0)
    };
    let camera = Camera::look_at(DVec3::new(0.5, 0.3, 3.0), DVec3::ZERO, DVec3::Y, 0.8);
    let mut scene = scene_of(vec![(square(0.0, true), material), (square(0.4, false), holes)], camera);
    scene.textures = (0..4).map(texture).collect();
    scene.environment = Environment::Uniform(Vec3::ONE);
    scene
}

/// Four sets of coordinates make the image that one set makes with a transform for each texture: on all tracers, of colours, numbers, emission, normals and
/// holes, at hits and along rays.
#[test]
fn gpu_four_sets_are_as_four_transforms() {
    let device = device();
    let many = scene(|k| TextureSlot { texture: k, texcoord: k, transform: Affine2::IDENTITY }, 4);
    let few = scene(|k| TextureSlot { texture: k, texcoord: 0, transform: transforms()[k] }, 1);
    let other = scene(|k| TextureSlot { texture: k, texcoord: 0, transform: Affine2::IDENTITY }, 1);
    let flats = [&many, &few, &other].map(FlatScene::for_paths);
    let features = [0, 1].map(|k| SceneFeatures::from_flat(&flats[k]).many_texcoords);
    assert_eq!(features, [true, false], "code for many sets is compiled in where a mesh has them");
    for filter in [TextureFilter::Bilinear, TextureFilter::RayCone] {
        let options = PathOptions {
            samples: SampleSettings::new([24, 24], 16, 5),
            max_depth: 2,
            texture_filter: filter,
            ..Default::default()
        };
        let needs = Needs { shading: true, mip_levels: filter == TextureFilter::RayCone, ..Default::default() };
        for kind in picked(&device) {
            let [many, few, other] = flats.each_ref().map(|flat| {
                let tracer = Tracer::new(&device, kind, flat, needs).unwrap_or_else(|e| panic!("{kind}: {e}"));
                render(&tracer, flat, &options).image.film.mean
            });
            // a ray at the edge of a hole rounds to one side or the other
            let differing = |a: &[f32], b: &[f32]| {
                let pixels = a.chunks(3).zip(b.chunks(3));
                pixels.filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| (a - b).abs() > 2e-3)).count()
            };
            let (same, not) = (differing(&many, &few), differing(&other, &few));
            assert!(same <= 4, "{kind}, {filter}: {same} of 576 pixels differ");
            assert!(not > 200, "{kind}, {filter}: {not} of 576 pixels show where textures are");
        }
    }
    assert_validation_clean(&device);
}
