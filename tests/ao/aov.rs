//! Auxiliary outputs against the double-precision oracle's.

use std::f64::consts::{PI, TAU};

use bytemuck::Zeroable;
use glam::{Affine2, DAffine3, DQuat, DVec2, DVec3, DVec4, Vec3};
use rayon::prelude::*;
use skylit::film::NoControl;
use skylit::integrators::aov::{self, AovPixel};
use skylit::oracle::Oracle;
use skylit::oracle::camera::camera_ray;
use skylit::scene::builtin::shapes;
use skylit::scene::{
    Camera, Filter, Geometry, Instance, Material, Mesh, Projection, Scene, Sphere, Texture, TextureSlot, Wrap,
};

use crate::common::{assert_validation_clean, device, record, scene, tracer, tracers};

/// A texture's linear colour at coordinates `uv`, as the glTF specification says: sRGB decoded before filtering.
fn texture_color(texture: &Texture, uv: DVec2) -> DVec3 {
    let rgba8 = texture.texels.as_bytes();
    let decode = |c: u8| {
        let c = c as f64 / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    };
    let wrap = |i: f64, n: u32, mode: Wrap| {
        let (i, n) = (i as i64, n as i64);
        match mode {
            Wrap::Repeat => i.rem_euclid(n),
            Wrap::Clamp => i.clamp(0, n - 1),
            Wrap::Mirror => (i.rem_euclid(2 * n)).min(2 * n - 1 - i.rem_euclid(2 * n)),
        }
    };
    let fetch = |x: f64, y: f64| {
        let (x, y) = (wrap(x, texture.width, texture.wrap[0]), wrap(y, texture.height, texture.wrap[1]));
        let at = 4 * (y * texture.width as i64 + x) as usize;
        DVec3::from_array([0, 1, 2].map(|k| decode(rgba8[at + k])))
    };
    let p = uv * DVec2::new(texture.width as f64, texture.height as f64);
    match texture.filter {
        Filter::Nearest => fetch(p.x.floor(), p.y.floor()),
        Filter::Linear => {
            let corner = (p - 0.5).floor();
            let f = p - 0.5 - corner;
            let row = |y: f64| fetch(corner.x, y).lerp(fetch(corner.x + 1.0, y), f.x);
            row(corner.y).lerp(row(corner.y + 1.0), f.y)
        }
    }
}

/// What a pixel's centre shows, in double precision.
fn expected_aov(scene: &Scene, oracle: &Oracle, camera: &Camera, size: [u32; 2], pixel: [u32; 2]) -> AovPixel {
    let ray = camera_ray(camera, oracle.origin(), size, pixel.map(|p| p as f64 + 0.5));
    let hit = oracle.closest(ray);
    if !hit.is_hit() {
        let none = u32::MAX;
        return AovPixel {
            depth: f32::INFINITY,
            instance: none,
            primitive: none,
            material: none,
            ..AovPixel::zeroed()
        };
    }
    let instance = &scene.instances[hit.instance as usize];
    let mesh = &scene.meshes[instance.mesh];
    let material = &scene.materials[mesh.material];
    // normals go by the inverse transpose: the front stays the front, also of mirrored instances
    let normals = instance.object_to_world.matrix3.inverse().transpose();
    let [v, w] = hit.barycentrics;
    let mut color = material.base_color.as_dvec4();
    let (ng, mut ns) = match &mesh.geometry {
        Geometry::Triangles(t) => {
            let corners = t.indices[hit.primitive as usize].map(|i| i as usize);
            let [a, b, c] = corners.map(|i| t.positions[i].as_dvec3());
            let ng = (normals * (b - a).cross(c - a)).normalize();
            let blend =
                |f: &dyn Fn(usize) -> DVec4| f(corners[0]) * (1.0 - v - w) + f(corners[1]) * v + f(corners[2]) * w;
            let ns = match t.normals.is_empty() {
                true => ng,
                false => (normals * blend(&|i| t.normals[i].as_dvec3().extend(0.0)).truncate()).normalize(),
            };
            if !t.colors.is_empty() {
                color *= blend(&|i| t.colors[i].as_dvec4());
            }
            if let Some(slot) = material.base_color_texture {
                let set = &t.texcoords[slot.texcoord];
                let uv = match set.is_empty() {
                    true => DVec2::ZERO,
                    false => blend(&|i| set[i].as_dvec2().extend(0.0).extend(0.0)).truncate().truncate(),
                };
                let uv = slot.transform.matrix2.as_dmat2() * uv + slot.transform.translation.as_dvec2();
                color *= texture_color(&scene.textures[slot.texture], uv).extend(1.0);
            }
            (ng, ns)
        }
        Geometry::Spheres(s) => {
            let center = s[hit.primitive as usize].center.as_dvec3();
            let object = instance.object_to_world.inverse().transform_point3(ray.at(hit.t) + oracle.origin());
            if let Some(slot) = material.base_color_texture {
                // pbrt's coordinates, with v down
                let n = (object - center).normalize();
                let uv = DVec2::new((n.y.atan2(n.x) / TAU).rem_euclid(1.0), n.z.clamp(-1.0, 1.0).acos() / PI);
                let uv = slot.transform.matrix2.as_dmat2() * uv + slot.transform.translation.as_dvec2();
                color *= texture_color(&scene.textures[slot.texture], uv).extend(1.0);
            }
            let ng = (normals * (object - center)).normalize();
            (ng, ng)
        }
    };
    if ns.dot(ng) < 0.0 {
        ns = -ns;
    }
    AovPixel {
        depth: hit.t as f32,
        instance: hit.instance,
        primitive: hit.primitive,
        material: mesh.material as u32,
        position: ray.at(hit.t).as_vec3().to_array(),
        ng: ng.as_vec3().to_array(),
        ns: ns.as_vec3().to_array(),
        red: color.x as f32,
        green: color.y as f32,
        blue: color.z as f32,
    }
}

/// A globe of 8 x 4 fields, each with a colour of its own, as a material of the scene.
fn add_globe(scene: &mut Scene, filter: Filter) -> usize {
    let texels = (0..32).flat_map(|i| [32 * (i % 8) as u8 + 16, 64 * (i / 8) as u8 + 16, 200, 255]);
    let texels = texels.collect::<Vec<u8>>().into();
    scene.textures.push(Texture { name: String::new(), width: 8, height: 4, texels, wrap: [Wrap::Repeat; 2], filter });
    let slot = TextureSlot { texture: scene.textures.len() - 1, texcoord: 0, transform: Affine2::IDENTITY };
    scene.materials.push(Material { base_color_texture: Some(slot), ..Material::default() });
    scene.materials.len() - 1
}

/// The field of a globe at each end of its axes, and between them, as the host computes it and as every tracer shows it.
#[test]
fn gpu_texture_coordinates_of_spheres() {
    let device = device();
    let mut scene = Scene::default();
    let material = add_globe(&mut scene, Filter::Nearest);
    scene.meshes.push(Mesh {
        name: String::new(),
        geometry: shapes::sphere(DVec3::new(3.0, 0.0, 0.0), 0.5),
        material,
        source: None,
    });
    // turned by a quarter about x: the pole at z is at -y
    let turn = DAffine3::from_rotation_x(0.5 * PI);
    scene.instances.push(Instance { name: String::new(), mesh: 0, object_to_world: turn });
    // just beside each end, so that no field's border is met; u is a turn from x to y, v goes down from z
    let ends = [
        (Vec3::X, [0, 2], [1e-3, -1e-3]),
        (Vec3::Y, [2, 2], [1e-3, -1e-3]),
        (Vec3::NEG_X, [4, 2], [1e-3, -1e-3]),
        (Vec3::NEG_Y, [6, 2], [1e-3, -1e-3]),
        (Vec3::Z, [0, 0], [1e-3, 5e-4]),
        (Vec3::NEG_Z, [0, 3], [1e-3, 5e-4]),
    ];
    for (end, [column, row], [along, up]) in ends {
        let (right, above) = if end.z == 0.0 { (Vec3::Z.cross(end), Vec3::Z) } else { (Vec3::X, Vec3::Y) };
        let n = (end + along * right + up * above).normalize();
        let uv = Sphere::texcoord(n);
        assert_eq!([(uv.x * 8.0) as u32, (uv.y * 4.0) as u32], [column, row], "{end}: {uv}");
        let centre = turn.transform_point3(DVec3::new(3.0, 0.0, 0.0));
        let n = turn.matrix3 * n.as_dvec3();
        let camera = Camera::look_at(centre + 2.0 * n, centre, n.any_orthonormal_vector(), 0.1);
        let i = (8 * row + column) as usize;
        let expected = texture_color(
            &scene.textures[0],
            DVec2::new((i % 8) as f64 + 0.5, (i / 8) as f64 + 0.5) / DVec2::new(8.0, 4.0),
        );
        for kind in tracers(&device) {
            let tracer = tracer(&device, kind, &scene);
            let got = aov::render(&tracer, &record(&scene, &camera, [1, 1]), [1, 1], &mut NoControl).unwrap()[0];
            let color = DVec3::new(f64::from(got.red), f64::from(got.green), f64::from(got.blue));
            assert!(color.abs_diff_eq(expected, 1e-5), "{kind}, {end}: {color} is not {expected}");
        }
    }
    assert_validation_clean(&device);
}

/// Everything at once: an ellipsoid, mirrored and stretched instances (in a group of their own and baked), spheres, smooth
/// normals, textures with transforms, vertex colours.
fn everything() -> Scene {
    let mut scene = scene("leaf-cards");
    let globe = add_globe(&mut scene, Filter::Linear);
    let mut add = |geometry: Geometry, material: usize, transforms: &[DAffine3]| {
        scene.meshes.push(Mesh { name: String::new(), geometry, material, source: None });
        let mesh = scene.meshes.len() - 1;
        scene.instances.extend(transforms.iter().map(|&t| Instance { name: String::new(), mesh, object_to_world: t }));
    };
    let place = |scale: DVec3, turn: f64, x: f64, y: f64| {
        DAffine3::from_scale_rotation_translation(scale, DQuat::from_rotation_x(turn), DVec3::new(x, y, 1.5))
    };
    add(
        shapes::torus(0.3, 0.12, 24, 12),
        1,
        &[place(DVec3::new(-1.0, 1.0, 1.3), 0.4, -1.2, 1.0), place(DVec3::new(1.0, 0.6, 1.0), 1.0, -0.4, 1.1)],
    );
    add(shapes::icosphere(0.3, 2), 0, &[place(DVec3::new(1.0, -1.0, 0.8), 0.3, 0.4, 1.0)]);
    add(shapes::sphere(DVec3::new(0.1, 0.0, 0.0), 0.3), 0, &[place(DVec3::new(1.5, 0.6, 1.0), 0.9, 1.2, 1.0)]);
    add(
        shapes::sphere(DVec3::ZERO, 0.2),
        0,
        &[place(DVec3::splat(1.2), 0.2, 0.0, 1.8), place(DVec3::splat(-0.7), 0.2, 0.7, 1.8)],
    );
    // textures turn with spheres, also with one that could be placed in the world with others
    add(shapes::sphere(DVec3::new(0.0, 0.1, 0.0), 0.25), globe, &[place(DVec3::ONE, 0.7, -0.5, 1.8)]);
    let two = [place(DVec3::new(-1.0, 1.0, 1.4), 2.0, -1.2, 1.7), place(DVec3::ONE, 0.0, 1.3, 1.7)];
    add(shapes::sphere(DVec3::ZERO, 0.2), globe, &two);
    scene
}

#[test]
fn gpu_auxiliary_outputs_equal_the_oracles() {
    let device = device();
    let mut scenes: Vec<(String, Scene)> =
        ["cornell-box", "stairs", "spheres:300", "grid:4", "far-away"].map(|n| (n.to_owned(), scene(n))).to_vec();
    scenes.push(("everything".into(), everything()));
    for (name, scene) in &scenes {
        let oracle = Oracle::new(scene, scene.origin());
        let extent = oracle.bounds().map_or(1.0, |(lo, hi)| lo.abs().max(hi.abs()).max_element()) as f32;
        let mut cameras = vec![("", scene.cameras[0].clone())];
        if name == "everything" || name == "stairs" {
            let mut camera = scene.cameras[0].clone();
            camera.projection = Projection::Orthographic { half_height: 2.0 };
            cameras.push((", orthographic", camera));
        }
        for (view, camera) in &cameras {
            let size = [150, 101];
            let want: Vec<AovPixel> = (0..size[0] * size[1])
                .into_par_iter()
                .map(|i| expected_aov(scene, &oracle, camera, size, [i % size[0], i / size[0]]))
                .collect();
            let instances: std::collections::HashSet<u32> = want.iter().map(|p| p.instance).collect();
            for kind in tracers(&device) {
                let what = format!("{name}{view} {kind}");
                let tracer = tracer(&device, kind, scene);
                let got = aov::render(&tracer, &record(scene, camera, size), size, &mut NoControl).unwrap();
                let far = |a: [f32; 3], b: [f32; 3]| {
                    let d = [0, 1, 2].map(|k| (a[k] - b[k]).abs());
                    // NaN counts as far
                    if d.iter().all(|x| x.is_finite()) { d[0].max(d[1]).max(d[2]) } else { f32::INFINITY }
                };
                // ids, depth, position, geometric normal, shading normal, colour
                let mut off = [0; 6];
                let mut example = [None; 6];
                for (i, (a, b)) in got.iter().zip(&want).enumerate() {
                    let ids = |p: &AovPixel| (p.instance, p.primitive, p.material);
                    let mut wrong = [false; 6];
                    wrong[0] = ids(a) != ids(b) || a.depth.is_finite() != b.depth.is_finite();
                    if wrong[0] || b.instance == u32::MAX {
                        // a pixel that misses holds nothing but its infinite depth
                        wrong[1] = !wrong[0] && a != b;
                    } else {
                        wrong[1] = a.depth.is_nan() || (a.depth - b.depth).abs() > 2e-5 * b.depth;
                        wrong[2] = far(a.position, b.position) > 1e-5 * extent;
                        wrong[3] = far(a.ng, b.ng) > 1e-4;
                        // a mesh that is placed once has its normals scaled to unit length before they are interpolated, others
                        // after: under a stretching transform that differs by a share of a triangle's curvature
                        wrong[4] = far(a.ns, b.ns) > 1e-4;
                        wrong[5] = far([a.red, a.green, a.blue], [b.red, b.green, b.blue]) > 2e-3;
                    }
                    for k in 0..6 {
                        off[k] += wrong[k] as usize;
                        if wrong[k] && example[k].is_none() {
                            example[k] = Some((i, *a, *b));
                        }
                    }
                }
                println!(
                    "{what}: of {} pixels and {} instances differ: ids {}, depth {}, position {}, ng {}, ns {}, colour {}",
                    want.len(),
                    instances.len(),
                    off[0],
                    off[1],
                    off[2],
                    off[3],
                    off[4],
                    off[5]
                );
                // edges within rounding of a pixel's centre, grazing views, borders of texels
                for k in 0..6 {
                    assert!(
                        off[k] <= want.len() / 1000,
                        "{what}: output {k} differs at {} pixels: {:?}",
                        off[k],
                        example[k]
                    );
                }
            }
        }
    }
    assert_validation_clean(&device);
}
