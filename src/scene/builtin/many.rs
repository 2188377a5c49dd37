//! Scenes of many parts: instances, spheres, alpha-masked cards, stairs.

use super::random::Rng;
use super::shapes;
use crate::scene::{AlphaMode, Filter, Geometry, Material, Scene, Sphere, Texture, TextureSlot, TriangleMesh, Wrap};
use glam::{Affine2, DAffine3, DQuat, DVec3, Vec2, Vec3, Vec4};

/// `n` x `n` x `n` instances of one torus, each turned and stretched differently, above a floor.
pub fn grid(n: u32) -> Scene {
    let mut scene = Scene { name: "grid".to_owned(), ..Scene::default() };
    let floor = scene.add_matte("floor", Vec3::splat(0.7));
    let clay = scene.add_matte("clay", Vec3::new(0.75, 0.55, 0.4));
    let half = n as f64 * 0.5;
    scene.add_object("floor", shapes::floor(DVec3::ZERO, 6.0 * n as f64 + 8.0), floor, DAffine3::IDENTITY);
    let torus = scene.add_mesh("torus", shapes::torus(0.32, 0.12, 16, 8), clay);
    let mut rng = Rng::new(0x6e1d);
    for (z, y, x) in (0..n).flat_map(|z| (0..n).flat_map(move |y| (0..n).map(move |x| (z, y, x)))) {
        let at = DVec3::new(x as f64 + 0.5 - half, y as f64 + 0.55, z as f64 + 0.5 - half);
        let scale = DVec3::new(rng.range(0.7, 1.25), rng.range(0.7, 1.25), rng.range(0.7, 1.25));
        let transform = DAffine3::from_scale_rotation_translation(scale, rng.rotation(), at);
        scene.add_instance("torus", torus, transform);
    }
    scene.add_camera(DVec3::new(0.9, 1.0, 1.7) * (n as f64 + 1.0), DVec3::new(0.0, 0.42 * n as f64, 0.0), 40.0);
    scene
}

/// `n` analytic spheres of random size and place above a floor; their density does not depend on
/// `n`.
pub fn spheres(n: u32) -> Scene {
    let mut scene = Scene { name: "spheres".to_owned(), ..Scene::default() };
    let floor = scene.add_matte("floor", Vec3::splat(0.7));
    let stone = scene.add_matte("stone", Vec3::new(0.6, 0.62, 0.65));
    let side = (n as f64).cbrt().max(1.0);
    scene.add_object("floor", shapes::floor(DVec3::ZERO, 8.0 * side), floor, DAffine3::IDENTITY);
    let mut rng = Rng::new(0x5eed);
    let balls = (0..n)
        .map(|_| {
            let radius = rng.range(0.12, 0.42);
            let center = DVec3::new(rng.range(-side, side), radius + rng.range(0.0, side), rng.range(-side, side));
            Sphere { center: center.as_vec3(), radius: radius as f32 }
        })
        .collect();
    scene.add_object("spheres", Geometry::Spheres(balls), stone, DAffine3::IDENTITY);
    scene.add_camera(DVec3::new(0.8, 1.1, 2.6) * side, DVec3::new(0.0, 0.4 * side, 0.0), 45.0);
    scene
}

/// A leaf with ribs and a toothed border: alpha falls over a few texels, so that the cutoff
/// matters.
fn leaf_texture(size: u32, wrap: Wrap, filter: Filter) -> Texture {
    let mut rgba8 = Vec::with_capacity(4 * (size * size) as usize);
    for y in 0..size {
        for x in 0..size {
            let (u, v) = ((x as f32 + 0.5) / size as f32, (y as f32 + 0.5) / size as f32);
            // along the leaf from its stem (v = 0.98) to its tip (v = 0.03)
            let along = (0.98 - v) / 0.95;
            let across = (u - 0.5).abs();
            let teeth = 0.02 * (along * 40.0).fract();
            let width = 0.95 * (along.clamp(0.0, 1.0) * (1.0 - along).clamp(0.0, 1.0)).powf(0.8) - teeth;
            let inside = (width - across) * size as f32 / 6.0 + 0.5;
            let stem = (0.012 - across) * size as f32 / 3.0 + 0.5;
            let alpha = if (0.0..=1.0).contains(&along) { inside.max(stem) } else { 0.0 };
            let rib =
                if across < 0.012 || ((along * 9.0 - across * 6.0).fract() - 0.5).abs() < 0.06 { 1.25 } else { 1.0 };
            let shade = |c: f32| (c * rib * (0.8 + 0.2 * along)).min(255.0) as u8;
            rgba8.extend([shade(70.0), shade(130.0), shade(45.0), (alpha.clamp(0.0, 1.0) * 255.0).round() as u8]);
        }
    }
    Texture { name: "leaf".to_owned(), width: size, height: size, texels: rgba8.into(), wrap: [wrap; 2], filter }
}

/// A tuft of `count` leaf cards around the origin. Its texture coordinates span `span` of the
/// texture; with `alpha`, its vertex colours have alpha that varies.
fn tuft(rng: &mut Rng, count: u32, span: f32, alpha: bool) -> Geometry {
    let mut mesh = TriangleMesh::default();
    for k in 0..count {
        let turn = DQuat::from_rotation_y(rng.range(0.0, std::f64::consts::TAU))
            * DQuat::from_rotation_x(rng.range(-1.2, 0.5));
        let (size, from) =
            (rng.range(0.5, 0.9), DVec3::new(rng.range(-0.35, 0.35), rng.range(0.05, 0.5), rng.range(-0.35, 0.35)));
        for (x, y) in [(0.0f32, 0.0f32), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            mesh.positions.push((from + turn * DVec3::new(x as f64 - 0.5, y as f64, 0.0) * size).as_vec3());
            mesh.texcoords[0].push(Vec2::new(x, 1.0 - y) * span);
            if alpha {
                mesh.colors.push(Vec4::new(1.0, 1.0, 1.0, 0.7 + 0.3 * y));
            }
        }
        mesh.indices.extend([[4 * k, 4 * k + 1, 4 * k + 2], [4 * k, 4 * k + 2, 4 * k + 3]]);
    }
    Geometry::Triangles(mesh)
}

/// Bushes of leaves cut from quads: bilinear and nearest masks, wrapped and transformed texture
/// coordinates, vertex alpha, and one blended material.
pub fn leaf_cards() -> Scene {
    let mut scene = Scene { name: "leaf-cards".to_owned(), ..Scene::default() };
    let floor = scene.add_matte("ground", Vec3::new(0.45, 0.38, 0.3));
    scene.add_object("ground", shapes::floor(DVec3::ZERO, 40.0), floor, DAffine3::IDENTITY);

    // three textures that are wrapped and filtered in different ways
    scene.textures.push(leaf_texture(64, Wrap::Clamp, Filter::Linear));
    scene.textures.push(leaf_texture(32, Wrap::Repeat, Filter::Nearest));
    scene.textures.push(leaf_texture(48, Wrap::Mirror, Filter::Linear));
    let slot = |texture: usize, transform: Affine2| Some(TextureSlot { texture, texcoord: 0, transform });

    // a material for each kind of alpha
    let mut leaf = |name: &str, tint: Vec4, base_color_texture: Option<TextureSlot>, alpha_mode: AlphaMode| {
        scene.materials.push(Material {
            name: name.to_owned(),
            base_color: tint,
            base_color_texture,
            alpha_mode,
            double_sided: true,
            ..Material::default()
        });
        scene.materials.len() - 1
    };
    let turned = Affine2::from_scale_angle_translation(Vec2::new(1.5, 1.0), 0.35, Vec2::new(-0.2, 0.15));
    let kinds = [
        (leaf("masked", Vec4::ONE, slot(0, Affine2::IDENTITY), AlphaMode::Mask { cutoff: 0.5 }), 1.0, false),
        (leaf("nearest", Vec4::ONE, slot(1, turned), AlphaMode::Mask { cutoff: 0.5 }), 1.5, false),
        (
            leaf(
                "mirrored",
                Vec4::new(1.0, 0.9, 0.6, 1.0),
                slot(2, Affine2::IDENTITY),
                AlphaMode::Mask { cutoff: 0.3 },
            ),
            2.0,
            true,
        ),
        (leaf("blended", Vec4::new(1.0, 0.8, 0.8, 0.9), slot(0, Affine2::IDENTITY), AlphaMode::Blend), 1.0, true),
    ];

    // tufts of cards, ten of each kind
    let mut rng = Rng::new(0x1eaf);
    for (k, (material, span, alpha)) in kinds.into_iter().enumerate() {
        let mesh = scene.add_mesh(&format!("tuft {k}"), tuft(&mut rng, 12, span, alpha), material);
        for _ in 0..10 {
            let at = DVec3::new(rng.range(-1.6, 1.6), rng.range(-0.05, 0.9), rng.range(-1.2, 1.2));
            let scale = DVec3::splat(rng.range(0.8, 1.3));
            let turn = DQuat::from_rotation_y(rng.range(0.0, std::f64::consts::TAU));
            scene.add_instance("tuft", mesh, DAffine3::from_scale_rotation_translation(scale, turn, at));
        }
    }
    scene.add_camera(DVec3::new(1.3, 2.0, 5.8), DVec3::new(0.0, 0.85, 0.0), 40.0);
    scene
}

/// Stairs along a wall, a column, a rail and a few things that lie on the steps; `offset` moves
/// everything.
pub fn stairs(offset: DVec3) -> Scene {
    let mut scene = Scene { name: "stairs".to_owned(), ..Scene::default() };
    let stone = scene.add_matte("stone", Vec3::new(0.66, 0.64, 0.6));
    let plaster = scene.add_matte("plaster", Vec3::splat(0.78));
    let wood = scene.add_matte("wood", Vec3::new(0.5, 0.33, 0.2));
    let at = |p: DVec3| DAffine3::from_translation(offset + p);
    scene.add_object("floor", shapes::floor(DVec3::ZERO, 16.0), stone, at(DVec3::ZERO));
    scene.add_object(
        "wall",
        shapes::cuboid(DVec3::new(-8.0, -0.1, -0.2), DVec3::new(8.0, 5.0, 0.0)),
        plaster,
        at(DVec3::Z * -1.5),
    );

    // Each step is a block down to below the floor: no two faces coincide.
    let (steps, rise, run) = (12, 0.18, 0.3);
    let step =
        scene.add_mesh("step", shapes::cuboid(DVec3::new(0.0, -0.05, -1.51), DVec3::new(run - 0.002, 1.0, 0.6)), stone);
    let pole = scene.add_mesh("pole", shapes::cylinder(0.025, 0.9, 16), wood);
    for k in 0..steps {
        let (x, y) = (k as f64 * run - 1.8, (k + 1) as f64 * rise);
        scene.add_instance("step", step, at(DVec3::X * x) * DAffine3::from_scale(DVec3::new(1.0, y, 1.0)));
        scene.add_instance("pole", pole, at(DVec3::new(x + run * 0.5, y, 0.5)));
    }

    // the rail, and what stands around
    let slope = (rise / run).atan();
    let length = (steps as f64 + 0.5) * run / slope.cos();
    let rail = shapes::cylinder(0.035, length, 20);
    let turn = DAffine3::from_rotation_z(slope - std::f64::consts::FRAC_PI_2);
    scene.add_object("rail", rail, wood, at(DVec3::new(-1.9, 1.04, 0.5)) * turn);
    scene.add_object("column", shapes::cylinder(0.35, 4.5, 48), plaster, at(DVec3::new(-2.6, -0.01, 1.2)));
    scene.add_object("ring", shapes::torus(0.4, 0.08, 48, 16), plaster, at(DVec3::new(-2.6, 0.08, 1.2)));
    scene.add_object("ball", shapes::icosphere(0.3, 4), wood, at(DVec3::new(0.4, 0.299, 1.3)));
    scene.add_object(
        "marble",
        shapes::sphere(DVec3::ZERO, 0.12),
        plaster,
        at(DVec3::new(-1.35, 0.18 * 2.0 + 0.12, 0.1)),
    );
    let crate_turn = DAffine3::from_rotation_y(0.5);
    let crate_box = shapes::cuboid(DVec3::new(-0.35, -0.001, -0.35), DVec3::new(0.35, 0.7, 0.35));
    scene.add_object("crate", crate_box, wood, at(DVec3::new(1.6, 0.0, 1.4)) * crate_turn);
    scene.add_camera(offset + DVec3::new(-2.2, 2.4, 6.0), offset + DVec3::new(-0.1, 0.95, 0.0), 45.0);
    scene
}
