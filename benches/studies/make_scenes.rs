//! Writes the files in `scenes/`, all of our own making: `cargo run --example make_scenes`

use std::path::Path;

use glam::{Affine2, DAffine3, DQuat, DVec3, Vec2, Vec3, Vec4};
use skylit::scene::export::export_gltf;
use skylit::scene::*;

fn main() -> skylit::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    export_gltf(&leaves(), &folder.join("leaves.glb"))?;
    export_gltf(&builtin::parade::parade(), &folder.join("parade.glb"))?;
    export_gltf(&courtyard(), &folder.join("courtyard.gltf")).map(drop)
}

/// A rectangle in the xz plane, facing +y, centred on the origin.
fn ground(half: f32, tiles: f32) -> TriangleMesh {
    let corners = [Vec2::new(-1.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(-1.0, -1.0), Vec2::new(1.0, -1.0)];
    TriangleMesh {
        positions: corners.iter().map(|c| Vec3::new(c.x, 0.0, c.y) * half).collect(),
        normals: vec![Vec3::Y; 4],
        texcoords: [corners.iter().map(|c| (*c + 1.0) * 0.5 * tiles).collect(), Vec::new()],
        indices: vec![[0, 1, 2], [2, 1, 3]],
        ..Default::default()
    }
}

/// Bent cards, three quads each, that carry a leaf cut out of an alpha mask: two-sided, flat things that stand close.
fn leaves() -> Scene {
    let mut card = TriangleMesh::default();
    for row in 0..4 {
        let y = row as f32 / 3.0;
        for x in [-0.5, 0.5] {
            card.positions.push(Vec3::new(x, y, 0.3 * y * y));
            card.texcoords[0].push(Vec2::new(x + 0.5, 1.0 - y));
        }
    }
    for row in 0..3 {
        let i = 2 * row;
        card.indices.extend([[i, i + 1, i + 2], [i + 2, i + 1, i + 3]]);
    }
    let size = 128;
    let leaf = |x: u32, y: u32| {
        let (u, v) = ((x as f32 + 0.5) / size as f32 - 0.5, 1.0 - (y as f32 + 0.5) / size as f32);
        // a lens with a toothed edge, on a stalk
        let edge = 0.44 * (std::f32::consts::PI * ((v - 0.2) / 0.8).clamp(0.0, 1.0)).sin() + 0.02 * (v * 90.0).sin();
        let vein = u.abs() < 0.012 || ((u.abs() * 1.2 - v * 1.3) * 9.0).rem_euclid(1.0) < 0.08;
        let inside = u.abs() < edge.max(0.025);
        let [r, g, b] = if vein { [96, 148, 60] } else { [46, 112, 36] };
        // colour runs on beyond the edge, so that filtering draws no dark seam
        [r, g, b, if inside { 255 } else { 0 }]
    };
    let rgba8: Vec<u8> = (0..size).flat_map(|y| (0..size).flat_map(move |x| leaf(x, y))).collect();
    let mut instances = vec![Instance { name: "ground".into(), mesh: 0, object_to_world: DAffine3::IDENTITY }];
    for i in 0..24 {
        // the golden angle spreads them evenly
        let (angle, radius) = (f64::from(i) * 2.399963, 0.35 * f64::from(i).sqrt());
        let place = DVec3::new(radius * angle.cos(), 0.0, radius * angle.sin());
        let turn = DQuat::from_rotation_y(-angle) * DQuat::from_rotation_x(0.25 + 0.02 * f64::from(i));
        let scale = DVec3::splat(0.7 + 0.02 * f64::from(i % 7));
        let object_to_world = DAffine3::from_scale_rotation_translation(scale, turn, place);
        instances.push(Instance { name: format!("leaf {i}"), mesh: 1, object_to_world });
    }
    let mut camera = Camera::look_at(DVec3::new(2.2, 1.8, 3.0), DVec3::new(0.0, 0.4, 0.0), DVec3::Y, 0.7);
    camera.name = "front".into();
    Scene {
        meshes: vec![
            Mesh { name: "ground".into(), geometry: Geometry::Triangles(ground(4.0, 1.0)), material: 0, source: None },
            Mesh { name: "leaf".into(), geometry: Geometry::Triangles(card), material: 1, source: None },
        ],
        instances,
        materials: vec![
            Material { name: "soil".into(), base_color: Vec4::new(0.35, 0.27, 0.2, 1.0), ..Default::default() },
            Material {
                name: "leaf".into(),
                base_color_texture: Some(TextureSlot { texture: 0, texcoord: 0, transform: Affine2::IDENTITY }),
                alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
                double_sided: true,
                ..Default::default()
            },
        ],
        textures: vec![Texture {
            name: "leaf".into(),
            width: size,
            height: size,
            texels: rgba8.into(),
            wrap: [Wrap::Clamp; 2],
            filter: Filter::Linear,
        }],
        cameras: vec![camera],
        ..Default::default()
    }
}

/// Steps and pillars on a tiled floor: instances, a texture transform, a sun and a lamp.
fn courtyard() -> Scene {
    let mut cube = TriangleMesh::default();
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let mut normal = Vec3::ZERO;
            normal[axis] = sign;
            let mut u = Vec3::ZERO;
            u[(axis + 1) % 3] = 1.0;
            let v = normal.cross(u);
            let first = cube.positions.len() as u32;
            for (a, b) in [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)] {
                cube.positions.push(normal * 0.5 + u * a + v * b);
                cube.normals.push(normal);
                cube.texcoords[0].push(Vec2::new(a + 0.5, 0.5 - b));
            }
            cube.indices.extend([[first, first + 1, first + 2], [first + 2, first + 1, first + 3]]);
        }
    }
    let size = 32;
    let tile = |x: u32, y: u32| {
        let joint = x.is_multiple_of(16) || y.is_multiple_of(16);
        let dark = (x / 16 + y / 16).is_multiple_of(2);
        let grain = (x * 7 + y * 13) % 9;
        let value = if joint {
            70
        } else if dark {
            150 + grain
        } else {
            200 + grain
        };
        [value as u8, (value - value / 12) as u8, (value - value / 6) as u8, 255]
    };
    let rgba8: Vec<u8> = (0..size).flat_map(|y| (0..size).flat_map(move |x| tile(x, y))).collect();
    let mut instances = vec![Instance { name: "floor".into(), mesh: 0, object_to_world: DAffine3::IDENTITY }];
    let mut block = |name: String, size: DVec3, at: DVec3| {
        let object_to_world =
            DAffine3::from_scale_rotation_translation(size, DQuat::IDENTITY, at + DVec3::Y * size.y * 0.5);
        instances.push(Instance { name, mesh: 1, object_to_world });
    };
    for i in 0..5 {
        let i = f64::from(i);
        block(format!("step {i}"), DVec3::new(3.0, 0.2 * (i + 1.0), 0.5), DVec3::new(0.0, 0.0, -1.0 - 0.5 * i));
    }
    for i in 0..8 {
        let (x, z) = (if i % 2 == 0 { -2.2 } else { 2.2 }, 2.0 - 1.5 * f64::from(i / 2));
        block(format!("pillar {i}"), DVec3::new(0.3, 2.4, 0.3), DVec3::new(x, 0.0, z));
    }
    block("beam left".into(), DVec3::new(0.4, 0.3, 5.2), DVec3::new(-2.2, 2.4, -0.25));
    block("beam right".into(), DVec3::new(0.4, 0.3, 5.2), DVec3::new(2.2, 2.4, -0.25));
    let light = |name: &str, kind, intensity, position| Light {
        name: name.into(),
        kind,
        intensity,
        position,
        direction: DVec3::new(0.4, -0.8, -0.45).normalize(),
        range: f64::INFINITY,
    };
    let mut camera = Camera::look_at(DVec3::new(1.2, 2.2, 6.0), DVec3::new(0.0, 0.8, -0.5), DVec3::Y, 0.8);
    camera.name = "entrance".into();
    let mut plan = Camera::look_at(DVec3::new(0.0, 10.0, 0.0), DVec3::ZERO, DVec3::NEG_Z, 0.8);
    (plan.name, plan.projection) = ("plan".into(), Projection::Orthographic { half_height: 4.0 });
    plan.aspect = Some(1.0);
    let tiles = TextureSlot {
        texture: 0,
        texcoord: 0,
        transform: Affine2::from_scale_angle_translation(Vec2::splat(8.0), 0.0, Vec2::splat(0.5)),
    };
    Scene {
        meshes: vec![
            Mesh { name: "floor".into(), geometry: Geometry::Triangles(ground(5.0, 1.0)), material: 0, source: None },
            Mesh { name: "block".into(), geometry: Geometry::Triangles(cube), material: 1, source: None },
        ],
        instances,
        materials: vec![
            Material { name: "tiles".into(), base_color_texture: Some(tiles), roughness: 0.4, ..Default::default() },
            Material { name: "plaster".into(), base_color: Vec4::new(0.8, 0.76, 0.7, 1.0), ..Default::default() },
        ],
        textures: vec![Texture {
            name: "tiles".into(),
            width: size,
            height: size,
            texels: rgba8.into(),
            wrap: [Wrap::Repeat; 2],
            filter: Filter::Linear,
        }],
        lights: vec![
            light("sun", LightKind::Directional { angle: 0.0 }, Vec3::new(3.0, 2.8, 2.5), DVec3::ZERO),
            light("lamp", LightKind::Point, Vec3::new(20.0, 14.0, 8.0), DVec3::new(0.0, 2.0, 1.0)),
        ],
        cameras: vec![camera, plan],
        ..Default::default()
    }
}
