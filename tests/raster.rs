//! Drawn against traced: what a pixel's centre shows must be the same, but for edges within the fraction of a pixel that a rasteriser
//! rounds corners to. A binary of its own: Mesa draws with vectors of 256 bits at most, and a process has one width.

mod common;

use skylit::shaders;
use std::sync::Arc;

use bytemuck::Zeroable;
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use skylit::accel::flatten::FlatScene;
use skylit::film::NoControl;
use skylit::film::block::{Block, PassParams};
use skylit::film::camera::CameraRecord;
use skylit::gpu::{Buffer, Commands, Device, Memory};
use skylit::integrators::aov::{self, AovParams, AovPixel};
use skylit::oracle::Oracle;
use skylit::oracle::camera::camera_ray;
use skylit::raster::{DrawStats, Primary, Raster, View};
use skylit::scene::builtin::shapes;
use skylit::scene::{Camera, ClipPlanes, Geometry, Instance, Mesh, Motion, Projection, Scene};
use skylit::tracer::{Changes, MeshChange, Push, Tracer, TracerKind};

use common::{ALL, assert_validation_clean, picked, scene, tracer, tracers};

const NONE: u32 = u32::MAX;
const SIZE: [u32; 2] = [320, 200];
/// Pixels: corners are rounded to 1/256 by the drivers here, and Vulkan asks for 1/16.
const BESIDE: f64 = 1.0 / 64.0;
const RAYS_BESIDE: usize = 1000;

/// `None`, said on stdout and checked, where the driver's vectors are too wide to draw with.
fn device() -> Option<Arc<Device>> {
    skylit::gpu::environment::prefer_vector_bits(256);
    let device = common::device();
    if device.info.can_rasterise() {
        return Some(device);
    }
    println!("skipped: the device lacks {:?}", device.info.missing_raster);
    assert!(
        device.info.missing_raster.iter().all(|m| m.contains("LP_NATIVE_VECTOR_WIDTH")),
        "{:?}",
        device.info.missing_raster
    );
    let tracer = tracer(&device, TracerKind::Compute, &scene("cornell-box"));
    let Err(error) = Raster::new(&tracer, &shaders::AOV_CLOSEST, SIZE) else { panic!("it can draw") };
    assert!(
        error.to_string().contains("LP_NATIVE_VECTOR_WIDTH") && error.to_string().contains("--primary traced"),
        "{error}"
    );
    assert_eq!(Primary::auto(&tracer, 1 << 20).0, Primary::Traced);
    None
}

/// How two images differ.
#[derive(Debug, Default)]
struct Difference {
    hits: usize,
    /// Pixels that show another primitive.
    ids: usize,
    /// Of those, pixels that no ray explains which passes less than [`BESIDE`] the centre.
    unexplained: usize,
    /// Greatest differences where the primitive is the same: depth and position relative to the distances there, normals.
    depth: f32,
    position: f32,
    ng: f32,
    ns: f32,
    /// Pixels with the very same bits.
    same: usize,
}

/// What may differ in an image.
#[derive(Clone, Copy)]
struct Bounds {
    /// Share of pixels that show another primitive.
    ids: f64,
    /// Relative.
    depth: f32,
    /// Relative; in a thin long triangle corners' weights, and with them the place along it, round the most.
    position: f32,
    normal: f32,
}

const BOUNDS: Bounds = Bounds { ids: 0.001, depth: 1e-5, position: 1e-4, normal: 1e-3 };

/// A scene, a camera, an image.
struct Shot<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    size: [u32; 2],
}

impl Shot<'_> {
    fn record(&self) -> CameraRecord {
        CameraRecord::new(self.camera, self.scene.origin(), self.size[0] as f64 / self.size[1] as f64)
    }

    /// Is the rasterized surface where the oracle finds it just beside the centre, or what was traced at the same depth? Triangles behind a silhouette may
    /// be rasterized a little before those that hide them: then the oracle finds their neighbour at their depth.
    fn explains(&self, oracle: &Oracle, traced: &AovPixel, drawn: &AovPixel, at: usize) -> bool {
        let (x, y) = ((at as u32 % self.size[0]) as f64 + 0.5, (at as u32 / self.size[0]) as f64 + 0.5);
        let both = traced.depth.is_finite() && drawn.depth.is_finite();
        both && (traced.depth - drawn.depth).abs() <= 3e-5 * traced.depth
            || (0..RAYS_BESIDE).any(|k| {
                // a spiral that fills the disc evenly
                let (radius, turn) = (BESIDE * ((k + 1) as f64 / RAYS_BESIDE as f64).sqrt(), k as f64 * 2.399963);
                let film = [x + radius * turn.cos(), y + radius * turn.sin()];
                let hit = oracle.closest(camera_ray(self.camera, oracle.origin(), self.size, film));
                match hit.is_hit() {
                    true => {
                        let off = (hit.t as f32 - drawn.depth).abs();
                        hit.instance == drawn.instance
                            && (hit.primitive == drawn.primitive || off <= 1e-3 * drawn.depth)
                    }
                    false => drawn.instance == NONE,
                }
            })
    }

    fn compare(&self, traced: &[AovPixel], drawn: &[AovPixel]) -> Difference {
        assert_eq!(traced.len(), drawn.len());
        let mut d = Difference::default();
        let far = |a: [f32; 3], b: [f32; 3]| {
            let worst = [0, 1, 2].map(|k| (a[k] - b[k]).abs()).into_iter().fold(0.0, f32::max);
            if a.iter().chain(&b).all(|x| x.is_finite()) { worst } else { f32::INFINITY }
        };
        let mut oracle = None;
        for (at, (a, b)) in traced.iter().zip(drawn).enumerate() {
            d.hits += (a.instance != NONE) as usize;
            d.same += (a == b) as usize;
            if (a.instance, a.primitive, a.material) != (b.instance, b.primitive, b.material) {
                d.ids += 1;
                let oracle = oracle.get_or_insert_with(|| Oracle::new(self.scene, self.scene.origin()));
                if !self.explains(oracle, a, b, at) {
                    println!(
                        "  unexplained: pixel {at}: {} {} at {}, drawn {} {} at {}",
                        a.instance, a.primitive, a.depth, b.instance, b.primitive, b.depth
                    );
                    d.unexplained += 1;
                }
            } else if a.instance != NONE {
                let scale = a.position.iter().fold(a.depth, |w, x| w.max(x.abs()));
                d.depth = d.depth.max((a.depth - b.depth).abs() / scale);
                d.position = d.position.max(far(a.position, b.position) / scale);
                d.ng = d.ng.max(far(a.ng, b.ng));
                d.ns = d.ns.max(far(a.ns, b.ns));
            }
        }
        d
    }

    fn check(&self, what: &str, tracer: &Tracer, bounds: Bounds) -> Difference {
        let [traced, drawn] = [Primary::Traced, Primary::Raster].map(|p| {
            aov::render_with(tracer, &self.record(), self.size, p, &mut NoControl)
                .unwrap_or_else(|e| panic!("{p:?}: {e}"))
        });
        let d = self.compare(&traced, &drawn);
        println!("{what}, {}: {} pixels, {d:?}", tracer.kind(), traced.len());
        let most = (bounds.ids * traced.len() as f64).ceil() as usize;
        assert!(d.ids <= most, "{what}: {} of {} pixels show another primitive", d.ids, traced.len());
        assert!(d.unexplained == 0, "{what}: pixels away from any edge show another primitive: {d:?}");
        assert!(d.depth <= bounds.depth && d.position <= bounds.position, "{what}: {d:?}");
        assert!(d.ng <= bounds.normal && d.ns <= bounds.normal, "{what}: {d:?}");
        d
    }
}

fn check(
    device: &Arc<Device>,
    what: &str,
    scene: &Scene,
    camera: &Camera,
    size: [u32; 2],
    bounds: Bounds,
) -> Difference {
    let tracer = tracer(device, TracerKind::Compute, scene);
    Shot { scene, camera, size }.check(what, &tracer, bounds)
}

fn orthographic(camera: &Camera, half_height: f64) -> Camera {
    Camera { projection: Projection::Orthographic { half_height }, ..camera.clone() }
}

#[test]
fn gpu_rasterized_scenes_equal_traced_ones() {
    let Some(device) = device() else { return };
    for name in [
        "cornell-box",
        "stairs",
        "grid:6",
        "leaf-cards",
        "cornell-spheres",
        "spheres:300",
        "far-away",
        "terrain:20000",
        "instances:20000",
        "closed-box",
        "plane",
        "v-groove:20",
    ] {
        let scene = scene(name);
        let d = check(&device, name, &scene, &scene.cameras[0], SIZE, BOUNDS);
        assert!(d.hits > 1000, "{name}: hardly anything is seen");
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_every_tracers_scene_can_be_rasterized() {
    let Some(device) = device() else { return };
    for name in ["grid:4", "leaf-cards", "spheres:300"] {
        let scene = scene(name);
        let shot = Shot { scene: &scene, camera: &scene.cameras[0], size: SIZE };
        let mut first: Option<Vec<AovPixel>> = None;
        for kind in tracers(&device) {
            let tracer = tracer(&device, kind, &scene);
            shot.check(name, &tracer, BOUNDS);
            let drawn = aov::render_with(&tracer, &shot.record(), SIZE, Primary::Raster, &mut NoControl).unwrap();
            // whatever the tracer, rasterization is the same
            assert!(*first.get_or_insert(drawn.clone()) == drawn, "{name} {kind}");
        }
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_orthographic_views() {
    let Some(device) = device() else { return };
    for (name, half) in
        [("stairs", 2.0), ("grid:4", 3.0), ("leaf-cards", 2.0), ("cornell-spheres", 3.0), ("far-away", 2.0)]
    {
        let scene = scene(name);
        // faces seen exactly from their side, and edges along rows of pixels
        let bounds = Bounds { ids: 0.005, ..BOUNDS };
        let d = check(
            &device,
            &format!("{name}, orthographic"),
            &scene,
            &orthographic(&scene.cameras[0], half),
            SIZE,
            bounds,
        );
        assert!(d.hits > 10_000, "{name}: hardly anything is seen");
    }
    // from among the geometry: what lies behind is not seen
    let scene = scene("grid:4");
    let (lo, hi) = scene.bounds().unwrap();
    let camera = Camera::look_at(0.5 * (lo + hi), hi, DVec3::Y, 1.0);
    check(&device, "grid:4, orthographic from its middle", &scene, &orthographic(&camera, 2.0), SIZE, BOUNDS);
    assert_validation_clean(&device);
}

/// The camera with clipping planes that cut what it sees: at these shares of the depth of the scene's bounds.
fn clipped(scene: &Scene, camera: &Camera, [near, far]: [f64; 2]) -> Camera {
    let (lo, hi) = scene.bounds().unwrap();
    let corner =
        |k: usize| DVec3::from_array([0, 1, 2].map(|axis| if k >> axis & 1 == 0 { lo[axis] } else { hi[axis] }));
    let depths: Vec<f64> = (0..8).map(|k| -camera.camera_to_world.inverse().transform_point3(corner(k)).z).collect();
    let (least, most) = depths.iter().fold((f64::INFINITY, 0.0f64), |(l, m), &d| (l.min(d.max(0.0)), m.max(d)));
    let at = |share: f64| if share.is_finite() { least + share * (most - least) } else { share };
    Camera { clip: ClipPlanes { near: at(near), far: at(far) }, ..camera.clone() }
}

#[test]
fn gpu_clipping_planes() {
    let Some(device) = device() else { return };
    let planes = [[0.4, f64::INFINITY], [0.0, 0.6], [0.35, 0.7]];
    for (k, (name, half)) in
        [("stairs", 2.0), ("leaf-cards", 2.0), ("cornell-spheres", 3.0), ("mirrored", 1.5)].into_iter().enumerate()
    {
        let scene = if name == "mirrored" { mirrored() } else { scene(name) };
        let tracer = tracer(&device, TracerKind::Compute, &scene);
        // each scene has planes of its own unless there is time for all
        let planes = if common::is_full() { &planes[..] } else { std::slice::from_ref(&planes[k % planes.len()]) };
        for &planes in planes {
            for camera in [scene.cameras[0].clone(), orthographic(&scene.cameras[0], half)] {
                let camera = clipped(&scene, &camera, planes);
                let shot = Shot { scene: &scene, camera: &camera, size: SIZE };
                // a plane cuts a surface between pixels, as an edge does
                let bounds = Bounds { ids: 0.01, ..BOUNDS };
                let d = shot.check(&format!("{name}, {planes:?}, {:?}", camera.projection), &tracer, bounds);
                assert!(d.hits > 1000, "{name}: hardly anything is seen");
                let drawn = aov::render_with(&tracer, &shot.record(), SIZE, Primary::Raster, &mut NoControl).unwrap();
                let to_camera = camera.camera_to_world.inverse();
                // looks at the whole scene
                let origin = scene.origin();
                for pixel in drawn.iter().filter(|p| p.instance != NONE) {
                    let p = Vec3::from_array(pixel.position).as_dvec3() + origin;
                    let depth = -to_camera.transform_point3(p).z;
                    let ClipPlanes { near, far } = camera.clip;
                    assert!(
                        depth >= near - 1e-2 && depth <= far + 1e-2,
                        "{name}, {planes:?}: {depth} of {near} to {far}"
                    );
                }
            }
        }
    }
    assert_validation_clean(&device);
}

/// Mirrored and stretched instances, in groups of their own and baked; spheres that become ellipsoids.
fn mirrored() -> Scene {
    let mut scene = scene("leaf-cards");
    let mut add = |geometry: Geometry, transforms: &[DAffine3]| {
        scene.meshes.push(Mesh { name: String::new(), geometry, material: 0, source: None });
        let mesh = scene.meshes.len() - 1;
        scene.instances.extend(transforms.iter().map(|&t| Instance { name: String::new(), mesh, object_to_world: t }));
    };
    let place = |scale: DVec3, turn: f64, x: f64, y: f64| {
        DAffine3::from_scale_rotation_translation(scale, DQuat::from_rotation_x(turn), DVec3::new(x, y, 1.5))
    };
    add(
        shapes::torus(0.3, 0.12, 24, 12),
        &[place(DVec3::new(-1.0, 1.0, 1.3), 0.4, -1.2, 1.0), place(DVec3::new(1.0, 0.6, 1.0), 1.0, -0.4, 1.1)],
    );
    add(shapes::icosphere(0.3, 2), &[place(DVec3::new(1.0, -1.0, 0.8), 0.3, 0.4, 1.0)]);
    add(shapes::sphere(DVec3::new(0.1, 0.0, 0.0), 0.3), &[place(DVec3::new(-1.5, 0.6, 1.0), 0.9, 1.2, 1.0)]);
    add(
        shapes::sphere(DVec3::ZERO, 0.2),
        &[place(DVec3::splat(1.2), 0.2, 0.0, 1.8), place(DVec3::splat(-0.7), 0.2, 0.7, 1.8)],
    );
    scene
}

#[test]
fn gpu_mirrored_instances_and_cameras() {
    let Some(device) = device() else { return };
    let scene = mirrored();
    let camera = &scene.cameras[0];
    check(&device, "mirrored instances", &scene, camera, SIZE, BOUNDS);
    check(&device, "mirrored instances, orthographic", &scene, &orthographic(camera, 1.5), SIZE, BOUNDS);
    let mut mirrored = camera.clone();
    mirrored.camera_to_world *= DAffine3::from_mat3(DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)));
    check(&device, "mirrored camera", &scene, &mirrored, SIZE, BOUNDS);
    assert_validation_clean(&device);
}

#[test]
fn gpu_image_sizes() {
    let Some(device) = device() else { return };
    let scene = scene("cornell-spheres");
    // a pixel or a few may all lie on an edge
    let few = |size: [u32; 2]| Bounds { ids: BOUNDS.ids.max(2.0 / (size[0] * size[1]) as f64), ..BOUNDS };
    // the last takes two blocks
    for size in [[1, 1], [1, 7], [9, 1], [33, 17], [641, 3], [2900, 800]] {
        check(&device, &format!("{size:?}"), &scene, &scene.cameras[0], size, few(size));
    }
    let side = device.info.limits.max_image_side;
    let tracer = tracer(&device, TracerKind::Compute, &scene);
    for size in [[side + 1, 1], [1, side + 1]] {
        let Err(error) = Raster::new(&tracer, &shaders::AOV_CLOSEST, size) else { panic!("{size:?} can be drawn") };
        assert!(error.to_string().contains("--primary traced"), "{error}");
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_cameras_within_and_before_geometry() {
    let Some(device) = device() else { return };
    // within a sphere, within a torus of many placed ones, on a landscape that goes on behind
    let spheres = scene("cornell-spheres");
    let sphere = spheres
        .instances
        .iter()
        .find_map(|i| match &spheres.meshes[i.mesh].geometry {
            Geometry::Spheres(s) => Some(i.object_to_world.transform_point3(s[0].center.as_dvec3())),
            _ => None,
        })
        .unwrap();
    let within = Camera::look_at(sphere, sphere + DVec3::new(0.3, 0.2, 1.0), DVec3::Y, 1.2);
    let d = check(&device, "within a sphere", &spheres, &within, SIZE, BOUNDS);
    assert_eq!(d.hits, 320 * 200);

    let grid = scene("grid:4");
    let (lo, hi) = grid.bounds().unwrap();
    for k in 0..8 {
        let direction = DQuat::from_rotation_y(k as f64 * 0.8) * DVec3::new(0.0, -0.2, 1.0);
        let eye = lo.lerp(hi, 0.35 + 0.04 * k as f64);
        let camera = Camera::look_at(eye, eye + direction, DVec3::Y, 1.4);
        check(&device, &format!("among a grid, {k}"), &grid, &camera, SIZE, BOUNDS);
    }

    let terrain = scene("terrain:20000");
    let (lo, hi) = terrain.bounds().unwrap();
    for (k, height) in [1.0, 0.3, 0.05].into_iter().enumerate() {
        let eye = DVec3::new(0.5 * (lo.x + hi.x), hi.y + height * (hi.y - lo.y), 0.5 * (lo.z + hi.z));
        let camera = Camera::look_at(eye, DVec3::new(hi.x, lo.y, hi.z), DVec3::Y, 1.0);
        let d = check(&device, &format!("over a terrain, {k}"), &terrain, &camera, SIZE, BOUNDS);
        assert!(d.hits > 10_000);
    }
    // everything behind
    let scene = scene("stairs");
    let (_, hi) = scene.bounds().unwrap();
    let away = Camera::look_at(hi + DVec3::ONE, hi + DVec3::splat(2.0), DVec3::Y, 1.0);
    let d = check(&device, "everything behind", &scene, &away, SIZE, BOUNDS);
    assert_eq!((d.hits, d.same), (0, 320 * 200));
    let d = check(&device, "everything behind, orthographic", &scene, &orthographic(&away, 5.0), SIZE, BOUNDS);
    assert_eq!((d.hits, d.same), (0, 320 * 200));
    assert_validation_clean(&device);
}

#[test]
fn gpu_scales_and_distances() {
    let Some(device) = device() else { return };
    for (name, factor, back) in [
        ("stairs", 1e-3, 1.0),
        ("stairs", 1e6, 1.0),
        ("cornell-spheres", 1e-3, 1.0),
        ("cornell-spheres", 1e6, 1.0),
        // through a narrow view from afar
        ("grid:4", 1.0, 200.0),
    ] {
        let mut scene = scene(name);
        let scale = DAffine3::from_scale(DVec3::splat(factor));
        for i in &mut scene.instances {
            i.object_to_world = scale * i.object_to_world;
        }
        let mut camera = scene.cameras[0].clone();
        let middle = scene.bounds().map(|(lo, hi)| 0.5 * (lo + hi)).unwrap();
        let eye = camera.camera_to_world.translation * factor;
        let forward = camera.camera_to_world.matrix3 * DVec3::NEG_Z;
        camera.camera_to_world.translation = eye - forward * ((back - 1.0) * (middle - eye).length());
        if let Projection::Perspective { fov_y } = &mut camera.projection {
            *fov_y = 2.0 * ((0.5 * *fov_y).tan() / back).atan();
        }
        // from afar single precision resolves less than a pixel's 1/64
        let bounds = if back > 1.0 { Bounds { ids: 0.01, depth: 1e-4, position: 1e-4, normal: 0.1 } } else { BOUNDS };
        let d = check(&device, &format!("{name} x {factor:e}, {back} times as far"), &scene, &camera, SIZE, bounds);
        assert!(d.hits > 10_000, "{name}: hardly anything is seen");
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_rasterized_scenes_follow_updates() {
    let Some(device) = device() else { return };
    for kind in picked(&device) {
        let mut scene = scene("grid:3");
        let motion = Motion {
            instances: (0..scene.instances.len()).collect(),
            meshes: vec![scene.instances[0].mesh],
            ..Motion::default()
        };
        let flat = FlatScene::with_motion(&scene, motion.clone()).unwrap();
        let mut tracer = Tracer::new(&device, kind, &flat, ALL).unwrap();
        let camera = scene.cameras[0].clone();
        let before = {
            let shot = Shot { scene: &scene, camera: &camera, size: SIZE };
            shot.check("before an update", &tracer, BOUNDS);
            aov::render_with(&tracer, &shot.record(), SIZE, Primary::Raster, &mut NoControl).unwrap()
        };
        let origin = scene.origin();
        let (meshes, instances) = (&mut scene.meshes, &mut scene.instances);
        for (k, i) in instances.iter_mut().enumerate().skip(1) {
            let shift = DVec3::new((k as f64).sin(), (1.7 * k as f64).cos(), (2.3 * k as f64).sin()) * 0.3;
            i.object_to_world = DAffine3::from_translation(shift) * i.object_to_world;
        }
        for &m in &motion.meshes {
            let Geometry::Triangles(t) = &mut meshes[m].geometry else { panic!("triangles deform") };
            t.positions.iter_mut().for_each(|p| *p += 0.2 * Vec3::new(p.y.sin(), p.z.cos(), p.x.sin()));
        }
        assert_eq!(scene.origin(), origin, "the test must not move the origin");
        let positions = |m: usize| match &scene.meshes[m].geometry {
            Geometry::Triangles(t) => t.positions.as_slice(),
            Geometry::Spheres(_) => panic!("triangles deform"),
        };
        let changes = Changes {
            instances: motion.instances.iter().map(|&i| (i, scene.instances[i].object_to_world)).collect(),
            meshes: motion
                .meshes
                .iter()
                .map(|&mesh| MeshChange { mesh, positions: positions(mesh), normals: None })
                .collect(),
            ..Changes::default()
        };
        tracer.update(&changes).unwrap();
        let shot = Shot { scene: &scene, camera: &camera, size: SIZE };
        shot.check("after an update", &tracer, BOUNDS);
        let after = aov::render_with(&tracer, &shot.record(), SIZE, Primary::Raster, &mut NoControl).unwrap();
        let moved = before.iter().zip(&after).filter(|(a, b)| a.depth != b.depth).count();
        assert!(moved > 1000, "{kind}: hardly anything moved");
    }
    assert_validation_clean(&device);
}

/// Draws one view and hands out what the auxiliary outputs of its block are, in the block's order.
fn draw(raster: &Raster, tracer: &Tracer, view: &View, seen: &View) -> (Vec<AovPixel>, DrawStats) {
    let device = tracer.device();
    let count = seen.block.rays();
    let target = Buffer::new(device, "outputs", 64 * count as u64, Memory::Readback).unwrap();
    let mut params = PassParams::new(device, "parameters of outputs").unwrap();
    let block = seen.block.params(seen.image_size, &seen.camera, 0);
    params.write(&block, &AovParams { pixels: target.address() }).unwrap();
    let push = Push { scene: tracer.scene_address(), pass: params.address(), count, ..Default::default() };
    let mut drawn = None;
    let timings =
        Commands::new(device).unwrap().run(|r| drawn = Some(raster.record(r, tracer, &push, view).unwrap())).unwrap();
    assert!(timings.is_empty() || timings.iter().map(|t| t.label).eq(["raster draw", "aov"]), "{timings:?}");
    let mut out = vec![AovPixel::zeroed(); count as usize];
    let bytes = target.read(0, 64 * count as u64).unwrap();
    bytemuck::cast_slice_mut(&mut out).copy_from_slice(&bytes);
    (out, drawn.unwrap())
}

/// A position in the pixel shifts rasterization as far as the pixels' own numbers do.
#[test]
fn gpu_a_pixels_sample_may_lie_anywhere() {
    let Some(device) = device() else { return };
    for scene in [scene("grid:4"), mirrored()] {
        let tracer = tracer(&device, TracerKind::Compute, &scene);
        let size = [128, 96];
        let raster = Raster::new(&tracer, &shaders::AOV_CLOSEST, size).unwrap();
        for camera in [scene.cameras[0].clone(), orthographic(&scene.cameras[0], 2.0)] {
            let camera = Shot { scene: &scene, camera: &camera, size: [320, 200] }.record();
            let block = |origin: [u32; 2]| Block { origin, size };
            let seen = View { camera, image_size: [320, 200], block: block([64, 48]), at: [0.5, 0.5] };
            let moved = View { block: block([60, 56]), at: [4.5, -7.5], ..seen };
            let (want, _) = draw(&raster, &tracer, &seen, &seen);
            let (got, _) = draw(&raster, &tracer, &moved, &seen);
            let differ = want.iter().zip(&got).filter(|(a, b)| a != b).count();
            let hits = want.iter().filter(|p| p.instance != NONE).count();
            println!("{}: {differ} of {hits} differ", scene.name);
            // alpha tests and spheres ask the exact ray, which rounds otherwise
            assert!(hits > 2000 && differ <= want.len() / 500, "{differ} of {hits}");
            // half a pixel beside it is another image
            let beside = View { at: [1.0, 0.5], ..seen };
            let (other, _) = draw(&raster, &tracer, &beside, &seen);
            assert!(want.iter().zip(&other).filter(|(a, b)| a != b).count() > 10 * differ.max(10));
        }
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_geometry_outside_the_view_is_not_rasterized() {
    let Some(device) = device() else { return };
    let scene = scene("terrain:200000");
    let (lo, hi) = scene.bounds().unwrap();
    let eye = DVec3::new(0.5 * (lo.x + hi.x), hi.y + 0.1, 0.5 * (lo.z + hi.z));
    let camera = Camera::look_at(eye, DVec3::new(hi.x, lo.y, hi.z), DVec3::Y, 0.7);
    let tracer = tracer(&device, TracerKind::Compute, &scene);
    let shot = Shot { scene: &scene, camera: &camera, size: SIZE };
    // triangles of a pixel and less
    shot.check("a quarter of a terrain", &tracer, Bounds { ids: 0.01, normal: 1e-2, ..BOUNDS });
    let raster = Raster::new(&tracer, &shaders::AOV_CLOSEST, SIZE).unwrap();
    let view =
        View { camera: shot.record(), image_size: SIZE, block: Block { origin: [0, 0], size: SIZE }, at: [0.5; 2] };
    let (_, drawn) = draw(&raster, &tracer, &view, &view);
    println!("{drawn:?}");
    assert_eq!(drawn.placed, FlatScene::new(&scene).primitive_count() as u64);
    assert!(drawn.primitives < 6 * drawn.placed / 10, "{drawn:?}");
    assert_validation_clean(&device);
}

#[test]
fn gpu_auto_draws_few_primitives_and_traces_many() {
    let Some(device) = device() else { return };
    let tracer = tracer(&device, TracerKind::Compute, &scene("terrain:20000"));
    for (pixels, want) in [(1 << 20, Primary::Raster), (1000, Primary::Traced)] {
        let (primary, why) = Primary::auto(&tracer, pixels);
        assert_eq!(primary, want, "{why}");
        assert!(why.contains("primitives per pixel"), "{why}");
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_unsupported_rasterization_is_reported() {
    let Some(device) = device() else { return };
    let scene = scene("cornell-box");
    let tracer = tracer(&device, TracerKind::Compute, &scene);
    let Err(error) = Raster::new(&tracer, &shaders::RAYS_CLOSEST, SIZE) else { panic!("any rays can be drawn") };
    assert!(error.to_string().contains("rays closest"), "{error}");
    let mut flat = scene.cameras[0].clone();
    flat.camera_to_world.matrix3.x_axis = flat.camera_to_world.matrix3.y_axis;
    let record = Shot { scene: &scene, camera: &flat, size: SIZE }.record();
    let Err(error) = aov::render_with(&tracer, &record, SIZE, Primary::Raster, &mut NoControl) else {
        panic!("a flat camera sees something")
    };
    assert!(error.to_string().contains("camera"), "{error}");
    assert_validation_clean(&device);
}
