//! Baked maps against closed forms, and what is filled.

use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec2, Vec3};
use skylit::Error;
use skylit::bake::cage::{Cage, Detailed, check};
use skylit::bake::kept::KeptParts;
use skylit::bake::map::BakedMap;
use skylit::bake::plan::{PlannedTexture, plan};
use skylit::bake::session::BakeSession;
use skylit::bake::texels::{Layout, TexelPoint};
use skylit::bake::{BakeSettings, LightSettings, Map, Occluders, SeamTreatment, Space};
use skylit::film::{Control, NoControl};
use skylit::gpu::Device;
use skylit::integrators::ao::Occlusion;
use skylit::oracle::closed_form as exact;
use skylit::scene::builtin::shapes;
use skylit::scene::material::MaterialKind;
use skylit::scene::{Environment, Geometry, Instance, Light, LightKind, Material, Mesh, Scene, Sphere, TriangleMesh};
use skylit::tracer::{DeviceSettings, TracerChoice, TracerKind};

use crate::common::{assert_validation_clean, device, picked};

/// A rectangle with texture coordinates from (0, 0) at its first corner, which is `centre - u - v`.
pub(crate) fn rectangle(centre: Vec3, u: Vec3, v: Vec3) -> TriangleMesh {
    TriangleMesh {
        positions: vec![centre - u - v, centre + u - v, centre + u + v, centre - u + v],
        indices: vec![[0, 1, 2], [0, 2, 3]],
        texcoords: [vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y], Vec::new()],
        ..TriangleMesh::default()
    }
}

/// A scene of meshes, each with a material of its own, whose names are their numbers.
pub(crate) fn scene_of(meshes: Vec<Geometry>) -> Scene {
    let mut scene = Scene::default();
    for (k, geometry) in meshes.into_iter().enumerate() {
        scene.materials.push(Material { name: k.to_string(), ..Material::default() });
        scene.instances.push(Instance { name: String::new(), mesh: k, object_to_world: DAffine3::IDENTITY });
        scene.meshes.push(Mesh { name: k.to_string(), geometry, material: k, source: None });
    }
    scene
}

pub(crate) fn tracing(kind: TracerKind) -> DeviceSettings {
    let tracer = match kind {
        TracerKind::Pipeline => TracerChoice::Pipeline,
        TracerKind::Query => TracerChoice::Query,
        TracerKind::Compute => TracerChoice::Compute,
    };
    DeviceSettings { tracer: Some(tracer), ..DeviceSettings::default() }
}

/// The map of the first material.
fn bake(device: &Arc<Device>, kind: TracerKind, scene: &Scene, settings: BakeSettings) -> (PlannedTexture, BakedMap) {
    let mut all = bake_all(device, kind, scene, &[], settings);
    assert_eq!(all.len(), 1);
    all.remove(0)
}

/// The maps of the first material, where other models occlude besides.
fn bake_all(
    device: &Arc<Device>,
    kind: TracerKind,
    scene: &Scene,
    occluding: &[Scene],
    settings: BakeSettings,
) -> Vec<(PlannedTexture, BakedMap)> {
    let settings = BakeSettings { materials: vec!["0".to_owned()], ..settings };
    let planned = plan(scene, None, &settings, &mut NoControl).unwrap();
    let session =
        BakeSession { scene, device, tracing: &tracing(kind), settings: &settings, detailed: None, occluding };
    let maps = session.bake_textures(&planned, &mut NoControl).unwrap();
    planned.into_iter().zip(maps).collect()
}

pub(crate) fn settings(size: u32, spp: u32) -> BakeSettings {
    BakeSettings { size: [size; 2], spp, ..BakeSettings::default() }
}

/// Mean and root mean square difference of a map's first channel from what is expected at texels' centres, in units of the texture.
fn differences(map: &BakedMap, expected: impl Fn(Vec2) -> f64) -> [f64; 2] {
    let [width, height] = map.size;
    let mut sums = [0.0; 2];
    for (k, value) in map.values.iter().enumerate() {
        let at = Vec2::new((k as u32 % width) as f32 + 0.5, (k as u32 / width) as f32 + 0.5);
        let difference = f64::from(value.x) - expected(at / Vec2::new(width as f32, height as f32));
        sums[0] += difference;
        sums[1] += difference * difference;
    }
    let n = map.values.len() as f64;
    [sums[0] / n, (sums[1] / n).sqrt()]
}

#[test]
fn gpu_bake_a_plane_below_a_sphere() {
    let device = device();
    let floor = rectangle(Vec3::ZERO, Vec3::X * 3.0, Vec3::NEG_Z * 3.0);
    let sphere = Sphere { center: Vec3::new(0.0, 1.25, 0.0), radius: 1.0 };
    let scene = scene_of(vec![Geometry::Triangles(floor), Geometry::Spheres(vec![sphere])]);
    let sphere_at = |uv: Vec2| {
        let rho = ((uv - 0.5) * 6.0).length();
        exact::sphere_over_plane(1.0, 1.25, rho.into()).unwrap()
    };
    for kind in picked(&device) {
        let (texture, map) = bake(&device, kind, &scene, settings(48, 256));
        assert_eq!((texture.texcoord, map.hidden), (0, 0));
        assert!(map.covered.iter().all(|c| *c));
        let [bias, rmse] = differences(&map, sphere_at);
        println!("{kind}: bias {bias:+.1e}, rmse {rmse:.1e}, estimated {:.1e}", map.error);
        assert!(bias.abs() < 5e-4 && rmse < 0.012, "{kind}: {bias} {rmse}");
        // independent samples would have the estimated error, these have less
        assert!(rmse < map.error && map.error < 0.05, "{kind}: {}", map.error);

        // as many samples as an error takes, and a filter of what is left
        let few = settings(48, 16);
        let target = BakeSettings { target_error: Some(0.02), ..few.clone() };
        let (_, target) = bake(&device, kind, &scene, target);
        let (_, plain) = bake(&device, kind, &scene, few.clone());
        let (_, smooth) = bake(&device, kind, &scene, BakeSettings { is_smoothed: true, ..few });
        let error = |map: &BakedMap| differences(map, sphere_at)[1];
        assert!(target.rays > 2 * plain.rays && target.rays < 64 * plain.rays, "{kind}: {}", target.rays);
        assert!(error(&target) < 0.02, "{kind}: {}", error(&target));
        assert!(error(&smooth) < 0.6 * error(&plain), "{kind}: {} {}", error(&smooth), error(&plain));
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_bake_a_groove() {
    // a small floor at a wall so large that its ends are not seen
    let device = device();
    let floor = rectangle(Vec3::X, Vec3::X, Vec3::NEG_Z);
    let wall = rectangle(Vec3::Y * 1e3, Vec3::Y * 1e3, Vec3::Z * 1e3);
    let scene = scene_of(vec![Geometry::Triangles(floor), Geometry::Triangles(wall)]);
    for kind in picked(&device) {
        // every texel sees a groove
        let (_, map) = bake(&device, kind, &scene, settings(16, 1024));
        let [bias, rmse] = differences(&map, |_| exact::v_groove(std::f64::consts::FRAC_PI_2));
        assert!(bias.abs() < 1e-3 && rmse < 0.01, "{kind}: {bias} {rmse}");

        // directions lean away from the wall: half of the mean open direction of a quarter of the sphere
        let (_, bent) = bake(&device, kind, &scene, BakeSettings { map: Map::BentNormal, ..settings(16, 1024) });
        let tangent = BakeSettings { map: Map::BentNormal, space: Space::Tangent, ..settings(16, 1024) };
        let (_, tangent) = bake(&device, kind, &scene, tangent);
        for (world, own) in bent.values.iter().zip(&tangent.values) {
            assert!((world.length() - 1.0).abs() < 1e-4 && world.z.abs() < 0.05, "{kind}: {world}");
            // means of cosine-weighted directions with x > 0: x = 2/3 * 2/pi, y = 2/3
            let slope = world.x / world.y;
            assert!((slope - std::f32::consts::FRAC_2_PI).abs() < 0.05, "{kind}: {world}");
            // u grows along x; v grows against z, and the bitangent points where it falls, as normal maps have it
            assert!((*own - Vec3::new(world.x, world.z, world.y)).length() < 1e-3, "{kind}: {own} {world}");
        }
    }
}

#[test]
fn gpu_bake_thickness_and_curvature_of_a_slab() {
    // two faces that look away from each other, far wider than they are thick
    let device = device();
    let (thick, radius) = (1.0f32, 4.0f64);
    let top = rectangle(Vec3::ZERO, Vec3::X * 100.0, Vec3::NEG_Z * 100.0);
    let bottom = rectangle(Vec3::new(0.0, -thick, 0.0), Vec3::X * 100.0, Vec3::Z * 100.0);
    let scene = scene_of(vec![Geometry::Triangles(top), Geometry::Triangles(bottom)]);
    for kind in picked(&device) {
        let map = |map, radius| {
            let settings = BakeSettings { map, occlusion: Occlusion::new(radius, 1.0), ..settings(8, 1024) };
            bake(&device, kind, &scene, settings).1
        };
        // the integral of min(t / cos, r) / r over the cosine-weighted hemisphere
        let share = f64::from(thick) / radius;
        let middle = f64::from(map(Map::Thickness, radius).values[4 * 8 + 4].x);
        assert!((middle - (2.0 * share - share * share)).abs() < 2e-3, "{kind}: {middle}");
        // nothing within the radius on either side: flat; and open above alone: an edge
        assert_eq!(map(Map::Curvature, 0.5).values[4 * 8 + 4].x, 0.5);
        assert!(map(Map::Curvature, radius).values[4 * 8 + 4].x > 0.9);
    }
}

#[test]
fn gpu_bake_fills_what_is_inside_of_others() {
    let device = device();
    let floor = rectangle(Vec3::ZERO, Vec3::X * 2.0, Vec3::NEG_Z * 2.0);
    let cube = shapes::cuboid(DVec3::new(-1.0, -1.0, -1.0), DVec3::new(1.0, 1.0, 1.0));
    let scene = scene_of(vec![Geometry::Triangles(floor), cube]);
    for kind in picked(&device) {
        let (_, map) = bake(&device, kind, &scene, settings(32, 64));
        // a quarter of the floor lies within the cube
        assert_eq!(map.hidden, 16 * 16, "{kind}");
        assert!(map.values.iter().all(|v| v.x > 0.2), "{kind}: filled from outside");

        // by itself nothing occludes it, and on the ground nothing changes above it
        let alone = BakeSettings { occluders: Occluders::Material, ..settings(32, 64) };
        for has_ground in [false, true] {
            let (_, map) = bake(&device, kind, &scene, BakeSettings { has_ground, ..alone.clone() });
            assert!(map.values.iter().all(|v| v.x == 1.0) && map.hidden == 0, "{kind}");
        }
    }
}

/// Light maps against irradiance divided by pi: of a white sky, of a directional light, and within a furnace.
#[test]
fn gpu_bake_light() {
    let device = device();
    let light_map = |integrator: &str| BakeSettings {
        map: Map::Light,
        light: LightSettings { integrator: Some(integrator.parse().unwrap()), max_depth: None },
        ..settings(16, 64)
    };
    let floor = || Geometry::Triangles(rectangle(Vec3::ZERO, Vec3::X, Vec3::NEG_Z));
    for kind in picked(&device) {
        // an open floor under a white sky, whatever its material
        let mut scene = scene_of(vec![floor()]);
        scene.materials[0].base_color = [0.1, 0.2, 0.3, 1.0].into();
        scene.materials[0].emissive = Vec3::splat(5.0);
        scene.environment = Environment::Uniform(Vec3::ONE);
        for integrator in ["path", "direct", "ao-sky"] {
            let (_, map) = bake(&device, kind, &scene, light_map(integrator));
            let [bias, rmse] = differences(&map, |_| 1.0);
            println!("{integrator} on {}: bias {bias:e}, RMSE {rmse:e}", kind.name());
            assert!(bias.abs() < 1e-5 && rmse < 1e-4, "{integrator}: {bias} {rmse}");
        }

        // a distant light has no noise
        scene.environment = Environment::Black;
        scene.lights.push(Light {
            name: String::new(),
            kind: LightKind::Directional { angle: 0.0 },
            position: DVec3::ZERO,
            direction: DVec3::new(0.6, -0.8, 0.0),
            intensity: Vec3::new(1.0, 2.0, 3.0),
            range: f64::INFINITY,
        });
        let (_, map) = bake(&device, kind, &scene, light_map("direct"));
        let exact = 0.8 / std::f64::consts::PI * DVec3::new(1.0, 2.0, 3.0);
        let worst = map.values.iter().map(|v| (v.as_dvec3() - exact).length()).fold(0.0, f64::max);
        assert!(worst < 1e-5, "{worst}");

        // a closed box of albedo one half whose walls emit one: two arrives everywhere
        let walls = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z].map(|outward| {
            let along = if outward.x == 0.0 { Vec3::X } else { Vec3::Y };
            // the front is within
            Geometry::Triangles(rectangle(outward, along, (-outward).cross(along)))
        });
        let mut scene = scene_of(walls.into());
        for material in &mut scene.materials {
            material.kind = MaterialKind::Matte;
            (material.base_color, material.emissive) = ([0.5, 0.5, 0.5, 1.0].into(), Vec3::ONE);
        }
        let (_, map) = bake(&device, kind, &scene, light_map("path"));
        let [bias, rmse] = differences(&map, |_| 2.0);
        println!("furnace on {}: bias {bias:e}, RMSE {rmse:e}, estimated {:e}", kind.name(), map.error);
        assert!(bias.abs() < 0.02 && rmse < 2.0 * map.error.max(0.02), "{bias} {rmse}");
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_bake_the_ground_occludes() {
    let device = device();
    // a ceiling that looks down upon it, and what makes it the ground of a higher scene
    let ceiling = rectangle(Vec3::ZERO, Vec3::X, Vec3::Z);
    let below = rectangle(Vec3::new(0.0, -1.0, 0.0), Vec3::X * 1e-3, Vec3::Z * 1e-3);
    let scene = scene_of(vec![Geometry::Triangles(ceiling), Geometry::Triangles(below)]);
    for kind in picked(&device) {
        let value =
            |has_ground| bake(&device, kind, &scene, BakeSettings { has_ground, ..settings(4, 64) }).1.values[5].x;
        assert!(value(false) > 0.99 && value(true) < 0.01, "{kind}: {} {}", value(false), value(true));
    }
}

/// Instances share a texture: that of the first, or the mean.
#[test]
fn gpu_bake_instances() {
    let device = device();
    let floor = rectangle(Vec3::ZERO, Vec3::X, Vec3::NEG_Z);
    // it looks down: its back would have the floor within it
    let lid = rectangle(Vec3::new(0.0, 0.01, 0.0), Vec3::X * 9.0, Vec3::Z * 9.0);
    let mut scene = scene_of(vec![Geometry::Triangles(floor), Geometry::Triangles(lid)]);
    let far = DAffine3::from_translation(DVec3::X * 100.0);
    scene.instances.push(Instance { name: String::new(), mesh: 0, object_to_world: far });
    for kind in picked(&device) {
        let value = |averages_instances| {
            bake(&device, kind, &scene, BakeSettings { averages_instances, ..settings(4, 256) }).1.values[5].x
        };
        assert!(value(false) < 0.01, "{kind}: {}", value(false));
        assert!((value(true) - 0.5).abs() < 0.01, "{kind}: {}", value(true));
    }
}

/// The same, with a texture for each.
#[test]
fn gpu_bake_unique_instances() {
    let device = device();
    let floor = rectangle(Vec3::ZERO, Vec3::X, Vec3::NEG_Z);
    let lid = rectangle(Vec3::new(0.0, 0.01, 0.0), Vec3::X * 9.0, Vec3::Z * 9.0);
    let mut scene = scene_of(vec![Geometry::Triangles(floor), Geometry::Triangles(lid)]);
    let far = DAffine3::from_translation(DVec3::X * 100.0);
    scene.instances.push(Instance { name: String::new(), mesh: 0, object_to_world: far });
    for kind in picked(&device) {
        let settings = BakeSettings { has_unique_instances: true, ..settings(4, 256) };
        let baked = bake_all(&device, kind, &scene, &[], settings);
        let found: Vec<_> =
            baked.iter().map(|(t, m)| (t.placement, t.surfaces[0].instances[0], m.values[5].x)).collect();
        let [(Some(0), 0, dark), (Some(1), 2, open)] = found[..] else { panic!("{kind}: {found:?}") };
        assert!(dark < 0.01 && open > 0.99, "{kind}: {dark} {open}");
    }
}

/// A floor in the left half of an atlas and a lid above it in the right half, of another material.
fn floor_and_lid() -> Scene {
    let mut floor = rectangle(Vec3::ZERO, Vec3::X, Vec3::NEG_Z);
    let mut lid = rectangle(Vec3::new(0.0, 0.01, 0.0), Vec3::X * 9.0, Vec3::Z * 9.0);
    floor.texcoords[0].iter_mut().for_each(|c| c.x *= 0.5);
    lid.texcoords[0].iter_mut().for_each(|c| c.x = 0.5 * c.x + 0.5);
    scene_of(vec![Geometry::Triangles(floor), Geometry::Triangles(lid)])
}

/// The maps of all materials.
fn bake_atlas(device: &Arc<Device>, kind: TracerKind, scene: &Scene, settings: &BakeSettings) -> Vec<BakedMap> {
    let planned = plan(scene, None, settings, &mut NoControl).unwrap();
    let tracing = tracing(kind);
    let session = BakeSession { scene, device, tracing: &tracing, settings, detailed: None, occluding: &[] };
    session.bake_textures(&planned, &mut NoControl).unwrap()
}

/// Materials that share a texture occlude one another, or each itself alone.
#[test]
fn gpu_bake_an_atlas() {
    let device = device();
    let scene = floor_and_lid();
    for kind in picked(&device) {
        let values = |occluders| {
            let settings = BakeSettings { is_atlas: true, occluders, ..settings(8, 64) };
            let maps = bake_atlas(&device, kind, &scene, &settings);
            assert!(maps.len() == 1 && maps[0].covered.iter().all(|c| *c), "{kind}");
            [maps[0].values[8].x, maps[0].values[15].x]
        };
        let [floor, lid] = values(Occluders::Scene);
        assert!(floor < 0.01 && lid > 0.9, "{kind}: {floor} {lid}");
        assert_eq!(values(Occluders::Material), [1.0; 2], "{kind}");
    }
}

/// Stops a bake once it has told of so many parts.
struct StopAfter(u32);

impl Control for StopAfter {
    fn progress(&mut self, _: u64, _: u64) {
        self.0 = self.0.saturating_sub(1);
    }

    fn should_stop(&mut self) -> skylit::Result<bool> {
        if self.0 == 0 { Err(Error::Interrupted) } else { Ok(false) }
    }
}

/// A bake that is interrupted between its parts, and goes on, has the bits of one that is not.
#[test]
fn gpu_bake_goes_on_after_an_interruption() {
    let device = device();
    let scene = floor_and_lid();
    let kind = picked(&device)[0];
    let tracing = tracing(kind);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("map.parts");
    // so wide a texture has two parts; each of two materials that occlude themselves has them, too
    let wide = BakeSettings { size: [16384, 32], is_atlas: true, ..settings(8, 4) };
    let filtered = BakeSettings { is_smoothed: true, occluders: Occluders::Material, ..wide.clone() };
    for settings in [BakeSettings { is_smoothed: false, ..wide }, filtered] {
        let planned = plan(&scene, None, &settings, &mut NoControl).unwrap();
        let session = BakeSession {
            scene: &scene,
            device: &device,
            tracing: &tracing,
            settings: &settings,
            detailed: None,
            occluding: &[],
        };
        let fingerprint = session.fingerprint(&planned);
        let run = |control: &mut dyn Control| {
            let mut kept = KeptParts::open(&path, &fingerprint, settings.is_smoothed).unwrap();
            session.bake_textures_in_parts(&planned, Some(&mut kept), control)
        };
        let mut length = 0;
        let mut interruptions = 0;
        let map = loop {
            // each run gets a part further than the one before
            match run(&mut StopAfter(interruptions + 1)) {
                Ok(mut maps) => break maps.remove(0),
                Err(Error::Interrupted) => interruptions += 1,
                Err(e) => panic!("{e}"),
            }
            let grown = std::fs::metadata(&path).unwrap().len();
            assert!(grown >= length && interruptions < 100, "{grown} {length}");
            length = grown;
        };
        let rays_of_last = map.rays;
        let whole = session.bake_textures(&planned, &mut NoControl).unwrap().remove(0);
        println!("{interruptions} interruptions, {length} bytes of parts");
        assert!(interruptions > 0 && length > 1 << 20);
        assert_eq!((map.values, map.error.to_bits()), (whole.values, whole.error.to_bits()));
        assert_eq!((rays_of_last, map.hidden, map.seams), (whole.rays, whole.hidden, whole.seams));

        // of another seed it is another bake
        let other = BakeSettings { seed: 1, ..settings.clone() };
        let other = BakeSession { settings: &other, ..session };
        assert_ne!(other.fingerprint(&planned), fingerprint);
        std::fs::remove_file(&path).unwrap();
    }
}

/// Surfaces in two tiles at the same place: each tile has an image of its own surface.
#[test]
fn gpu_bake_tiles() {
    let device = device();
    let mut floors = rectangle(Vec3::ZERO, Vec3::X, Vec3::NEG_Z);
    let far = rectangle(Vec3::X * 100.0, Vec3::X, Vec3::NEG_Z);
    floors.positions.extend(far.positions);
    floors.indices.extend(far.indices.iter().map(|t| t.map(|v| v + 4)));
    floors.texcoords[0].extend(far.texcoords[0].iter().map(|c| *c + Vec2::new(1.0, -1.0)));
    let lid = rectangle(Vec3::new(100.0, 0.01, 0.0), Vec3::X * 9.0, Vec3::Z * 9.0);
    let scene = scene_of(vec![Geometry::Triangles(floors), Geometry::Triangles(lid)]);
    for kind in picked(&device) {
        let baked = bake_all(&device, kind, &scene, &[], settings(8, 64));
        let tiles: Vec<_> = baked.iter().map(|(t, _)| t.tile.unwrap().to_array()).collect();
        assert_eq!(tiles, [[0, 0], [1, -1]], "{kind}");
        for ((_, map), is_open) in baked.iter().zip([true, false]) {
            assert!(map.covered.iter().all(|c| *c), "{kind}");
            assert!(map.values.iter().all(|v| if is_open { v.x > 0.99 } else { v.x < 0.01 }), "{kind}: {is_open}");
        }
    }
}

/// A model that is not baked occludes, wherever the scene's own occluders are looked for.
#[test]
fn gpu_bake_another_model_occludes() {
    let device = device();
    let floor = rectangle(Vec3::ZERO, Vec3::X, Vec3::NEG_Z);
    let scene = scene_of(vec![Geometry::Triangles(floor)]);
    let lid = |x: f32| Geometry::Triangles(rectangle(Vec3::new(x, 0.01, 0.0), Vec3::X * 9.0, Vec3::Z * 9.0));
    let (above, beside) = (scene_of(vec![lid(0.0)]), scene_of(vec![lid(100.0)]));
    let mut hidden = above.clone();
    hidden.hidden.insert(0);
    for kind in picked(&device) {
        for occluders in [Occluders::Scene, Occluders::Material] {
            let value = |models: &[Scene]| {
                let settings = BakeSettings { occluders, ..settings(4, 64) };
                bake_all(&device, kind, &scene, models, settings)[0].1.values[5].x
            };
            assert!(value(&[]) > 0.99 && value(&[beside.clone(), hidden.clone()]) > 0.99, "{kind}");
            assert!(value(&[beside.clone(), above.clone()]) < 0.01, "{kind}");
        }
    }
}

/// A floor below a sphere in two charts of other sizes and directions: both sides of the seam differ by less than the noise that a texel has.
#[test]
fn gpu_bake_a_seam() {
    let device = device();
    let corners = [[-3, 3], [0, 3], [0, -3], [-3, -3], [0, 3], [3, 3], [3, -3], [0, -3]];
    let texcoords =
        [[0.03, 0.03], [0.45, 0.03], [0.45, 0.97], [0.03, 0.97], [0.55, 0.9], [0.55, 0.1], [0.97, 0.1], [0.97, 0.9]];
    let floor = TriangleMesh {
        positions: corners.iter().map(|[x, z]| Vec3::new(*x as f32, 0.0, *z as f32)).collect(),
        indices: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
        texcoords: [texcoords.map(Vec2::from).to_vec(), Vec::new()],
        ..TriangleMesh::default()
    };
    let sphere = Sphere { center: Vec3::new(0.0, 1.25, 0.0), radius: 1.0 };
    let scene = scene_of(vec![Geometry::Triangles(floor), Geometry::Spheres(vec![sphere])]);
    for kind in picked(&device) {
        let seams = |seams, spp| {
            let (_, map) = bake(&device, kind, &scene, BakeSettings { seams, ..settings(64, spp) });
            (map.seams.unwrap(), map.error)
        };
        let (left, noise) = seams(SeamTreatment::Leave, 256);
        let (noisy, _) = seams(SeamTreatment::Leave, 4);
        let (matched, _) = seams(SeamTreatment::Match, 256);
        println!("{kind}: {left:?}, noise {noise:.4}, 4 samples {noisy:?}, matched {matched:?}");
        assert_eq!(left.edges, 1, "{kind}");
        assert!(left.rmse > 0.0 && left.rmse < noise && left.max < 4.0 * noise, "{kind}: {left:?} {noise}");
        assert!(noisy.rmse > 3.0 * left.rmse, "{kind}: {noisy:?}");
        assert!(matched.rmse < 0.1 * left.rmse, "{kind}: {matched:?}");
    }
}

#[test]
fn positions_and_normals_are_those_of_the_surface() {
    let device = device();
    let floor = rectangle(Vec3::new(1.0, 0.0, 0.0), Vec3::X * 2.0, Vec3::NEG_Z);
    let mut scene = scene_of(vec![Geometry::Triangles(floor)]);
    scene.instances[0].object_to_world = DAffine3::from_rotation_z(-std::f64::consts::FRAC_PI_2);
    let kind = picked(&device)[0];
    let value = |map, space| {
        let (texture, map) = bake(&device, kind, &scene, BakeSettings { map, space, ..settings(16, 4) });
        let layout = Layout::new(texture.size, &[&texture.surfaces[0].corners]);
        let points: Vec<TexelPoint> = layout.points(0..1).remove(0).points;
        assert_eq!(points.len(), 16 * 16 * 4);
        map.values[0]
    };
    let corner = value(Map::Position, Space::Object);
    assert!((corner - Vec3::new(-1.0 + 2.0 / 16.0, 0.0, 1.0 - 1.0 / 16.0)).length() < 0.1, "{corner}");
    let world = value(Map::Position, Space::World);
    assert!((world - Vec3::new(corner.y, -corner.x, corner.z)).length() < 1e-4, "{world}");
    assert!((value(Map::Normal, Space::World) - Vec3::X).length() < 1e-6);
    assert!((value(Map::Normal, Space::Object) - Vec3::Y).length() < 1e-6);
    assert_eq!(value(Map::Normal, Space::Tangent), Vec3::Z);
}

/// What is not unique is said, and no image is made of it.
#[test]
fn coordinates_that_overlap_are_refused() {
    let plane = |x: f32| rectangle(Vec3::X * x, Vec3::X, Vec3::NEG_Z);
    let mut scene = scene_of(vec![Geometry::Triangles(plane(0.0)), Geometry::Triangles(plane(5.0))]);
    scene.meshes[1].material = 0;
    let refused = |scene: &Scene| match plan(scene, None, &settings(64, 1), &mut NoControl) {
        Err(e) => e.to_string(),
        Ok(_) => panic!("accepted"),
    };
    let text = refused(&scene);
    assert!(text.contains("overlap: 100.0 % of the texels") && text.contains("-o NAME.glb"), "{text}");
    let change = |change: fn(&mut Vec2)| {
        let mut scene = scene_of(vec![Geometry::Triangles(plane(0.0))]);
        let Geometry::Triangles(triangles) = &mut scene.meshes[0].geometry else { unreachable!() };
        triangles.texcoords[0].iter_mut().for_each(change);
        refused(&scene)
    };
    assert!(change(|uv| *uv *= 3.0).contains("repeat the texture on 100 % of the surface"));
    assert!(change(|uv| *uv = Vec2::ZERO).contains("show no texels on 100 % of the surface"));
}

/// A flat card that looks at a bumpy model takes its normals and its occlusion.
#[test]
fn gpu_bake_from_a_detailed_model() {
    let device = device();
    let card = scene_of(vec![Geometry::Triangles(rectangle(Vec3::ZERO, Vec3::X, Vec3::NEG_Z))]);
    // half of it lies on a slope of 45 degrees, the other half on nothing
    let slope = Vec3::new(0.25, 0.25, 0.0);
    let detailed = scene_of(vec![Geometry::Triangles(rectangle(Vec3::X * 0.5, slope * 2.0, Vec3::NEG_Z * 4.0))]);
    for kind in picked(&device) {
        for (map, space) in [(Map::Normal, Space::Tangent), (Map::Normal, Space::World), (Map::Position, Space::World)]
        {
            let settings = BakeSettings { map, space, padding: 0.0, ..settings(32, 4) };
            let planned = plan(&card, None, &settings, &mut NoControl).unwrap();
            let session = BakeSession {
                scene: &card,
                device: &device,
                tracing: &tracing(kind),
                settings: &settings,
                detailed: Some(Detailed::new(&detailed, Cage::Distance(0.6))),
                occluding: &[],
            };
            let map = session.bake_textures(&planned, &mut NoControl).unwrap().remove(0);
            for (at, (value, covered)) in map.values.iter().zip(&map.covered).enumerate() {
                let x = (at % 32) as f32 / 16.0 - 1.0 + 1.0 / 32.0;
                // from the lower end of the slope, at x = 0, to where it leaves the cage
                assert_eq!(*covered, x > 0.0, "{kind}: {x}");
                if !*covered {
                    continue;
                }
                let expected = match space {
                    Space::Tangent => Vec3::new(-0.5f32.sqrt(), 0.0, 0.5f32.sqrt()),
                    _ if settings.map == Map::Normal => Vec3::new(-0.5f32.sqrt(), 0.5f32.sqrt(), 0.0),
                    _ => Vec3::new(x, x - 0.5, value.z),
                };
                assert!((*value - expected).length() < 0.02, "{kind}: {value} {expected}");
            }
        }
    }
}

/// Rays start at the cage: a slanted one finds what lies in its direction.
#[test]
fn gpu_bake_from_a_cage() {
    let device = device();
    let card = scene_of(vec![Geometry::Triangles(rectangle(Vec3::ZERO, Vec3::X, Vec3::NEG_Z))]);
    let cage = scene_of(vec![Geometry::Triangles(rectangle(Vec3::new(0.5, 0.6, 0.0), Vec3::X, Vec3::NEG_Z))]);
    let below = Vec3::new(0.0, -0.3, 0.0);
    let detailed = scene_of(vec![Geometry::Triangles(rectangle(below, Vec3::X * 9.0, Vec3::NEG_Z * 9.0))]);
    check(&card, &cage).unwrap();
    for kind in picked(&device) {
        let settings = BakeSettings { map: Map::Position, ..settings(16, 4) };
        let session = BakeSession {
            scene: &card,
            device: &device,
            tracing: &tracing(kind),
            settings: &settings,
            detailed: Some(Detailed::new(&detailed, Cage::Model(&cage))),
            occluding: &[],
        };
        let planned = plan(&card, None, &settings, &mut NoControl).unwrap();
        let map = session.bake_textures(&planned, &mut NoControl).unwrap().remove(0);
        assert!(map.covered.iter().all(|c| *c), "{kind}");
        for (at, value) in map.values.iter().enumerate() {
            let [x, z] = [at % 16, at / 16].map(|k| (k as f32 + 0.5) / 8.0 - 1.0);
            // half of the way from the cage to the card lies behind it
            assert!((*value - Vec3::new(x - 0.25, -0.3, -z)).length() < 1e-3, "{kind}: {value} at {x} {z}");
        }
    }
}

#[test]
fn a_cage_of_other_triangles_is_refused() {
    let card = || rectangle(Vec3::ZERO, Vec3::X, Vec3::NEG_Z);
    let scene = scene_of(vec![Geometry::Triangles(card())]);
    let refused = |cage: &Scene| check(&scene, cage).unwrap_err().to_string();
    let turned = TriangleMesh { indices: vec![[0, 1, 3], [1, 2, 3]], ..card() };
    let fewer = TriangleMesh { indices: vec![[0, 1, 2]], ..card() };
    let sphere = Geometry::Spheres(vec![Sphere { center: Vec3::ZERO, radius: 1.0 }]);
    let several = || vec![Geometry::Triangles(card()), Geometry::Triangles(card())];
    let texts = [vec![Geometry::Triangles(turned)], vec![Geometry::Triangles(fewer)], vec![sphere], several()]
        .map(|meshes| refused(&scene_of(meshes)));
    for (text, what) in texts.iter().zip(["join other vertices", "has 1 triangles", "spheres", "has 2 instances"]) {
        assert!(text.contains(what) && text.contains("a copy of the model"), "{text}");
    }
}
