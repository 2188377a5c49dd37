//! The exporter: what it writes comes back.

use glam::{Affine2, DAffine3, DQuat, DVec3, Vec2, Vec3, Vec4};
use serde_json::{Value, json};
use skylit::Error;
use skylit::scene::export::{ExportStats, export_gltf, mesh_bin, read_mesh_bin, write_mesh_bin};
use skylit::scene::material::{Anisotropy, Clearcoat, Sheen, Specular, Transmission};
use skylit::scene::*;

use crate::build::*;

fn slot(texture: usize) -> Option<TextureSlot> {
    Some(TextureSlot { texture, texcoord: 0, transform: Affine2::IDENTITY })
}

fn two_triangles() -> TriangleMesh {
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.1)];
    TriangleMesh {
        normals: vec![Vec3::Z; 4],
        tangents: vec![Vec4::new(1.0, 0.0, 0.0, -1.0); 4],
        texcoords: [positions.iter().map(|p| p.truncate()).collect(), vec![Vec2::new(0.3, 0.7); 4]],
        colors: vec![Vec4::new(0.1, 0.2, 0.3, 1.0); 4],
        positions,
        indices: vec![[0, 1, 2], [2, 1, 3]],
        ..TriangleMesh::default()
    }
}

/// A scene with everything that glTF has words for.
fn scene() -> Scene {
    let rgba8: TexelData = (0..4 * 8 * 4).map(|i| (i * 7) as u8).collect::<Vec<u8>>().into();
    let texture = |name: &str, wrap, filter| Texture {
        name: name.into(),
        width: 8,
        height: 4,
        texels: rgba8.clone(),
        wrap,
        filter,
    };
    let turned = TextureSlot {
        texture: 1,
        texcoord: 1,
        transform: Affine2::from_mat2_translation(
            glam::Mat2::from_cols(Vec2::new(0.6, -0.8) * 2.0, Vec2::new(0.8, 0.6) * -3.0),
            Vec2::new(0.25, 0.5),
        ),
    };
    let material = Material {
        name: "all".into(),
        base_color: Vec4::new(0.1, 0.2, 0.3, 0.4),
        base_color_texture: slot(0),
        metallic: 0.3,
        roughness: 0.6,
        metallic_roughness_texture: Some(turned),
        normal_texture: slot(1),
        normal_scale: 0.5,
        occlusion_strength: 0.25,
        occlusion_texture: slot(0),
        emissive: Vec3::new(17.0, 12.0, 4.1),
        emissive_texture: slot(1),
        alpha_mode: AlphaMode::Mask { cutoff: 0.3 },
        double_sided: true,
        ior: 1.33,
        unlit: true,
        clearcoat: Clearcoat {
            factor: 0.5,
            texture: slot(0),
            roughness: 0.2,
            roughness_texture: slot(1),
            normal_texture: slot(0),
            normal_scale: 0.7,
        },
        sheen: Sheen {
            color: Vec3::new(0.1, 0.2, 0.3),
            color_texture: slot(0),
            roughness: 0.4,
            roughness_texture: slot(1),
        },
        transmission: Transmission {
            factor: 0.9,
            texture: slot(0),
            thickness: 0.5,
            thickness_texture: slot(1),
            attenuation_color: Vec3::new(0.9, 0.8, 0.7),
            attenuation_distance: 3.0,
        },
        specular: Specular { factor: 0.7, texture: slot(0), color: Vec3::new(0.5, 1.0, 0.2), color_texture: slot(1) },
        anisotropy: Anisotropy { strength: 0.5, rotation: 0.1, texture: slot(0) },
        ..Material::default()
    };
    let mesh = |name: &str, material, triangles| Mesh {
        name: name.into(),
        geometry: Geometry::Triangles(triangles),
        material,
        source: None,
    };
    let bare = TriangleMesh { positions: two_triangles().positions, indices: vec![[0, 2, 1]], ..Default::default() };
    let far = DAffine3::from_scale_rotation_translation(
        DVec3::new(-1.0, 2.0, 0.1),
        DQuat::from_rotation_y(0.3),
        DVec3::new(1e6 + 1e-7, 0.1, -3.3),
    );
    let instance = |name: &str, mesh, object_to_world| Instance { name: name.into(), mesh, object_to_world };
    let light = |name: &str, kind| Light {
        name: name.into(),
        kind,
        intensity: Vec3::new(30.0, 20.0, 1.7),
        position: DVec3::new(1.0, 2.0, 3.0),
        direction: DVec3::new(0.6, -0.8, 0.0),
        range: if kind == LightKind::Point { 5.0 } else { f64::INFINITY },
    };
    Scene {
        name: "everything.glb".into(),
        meshes: vec![mesh("full", 0, two_triangles()), mesh("bare", 1, bare)],
        instances: vec![
            instance("first", 0, DAffine3::IDENTITY),
            instance("second", 0, far),
            instance("third", 1, DAffine3::from_translation(DVec3::Y)),
        ],
        materials: vec![material, Material { name: "plain".into(), ..Material::default() }],
        textures: vec![
            texture("one", [Wrap::Repeat, Wrap::Mirror], Filter::Linear),
            texture("two", [Wrap::Clamp, Wrap::Clamp], Filter::Nearest),
        ],
        lights: vec![
            light("lamp", LightKind::Point),
            light("spot", LightKind::Spot { inner_angle: 0.1, outer_angle: 0.4 }),
            light("sun", LightKind::Directional { angle: 0.0 }),
        ],
        cameras: vec![
            Camera::look_at(DVec3::new(3.0, 2.0, 1.0), DVec3::ZERO, DVec3::Y, 0.7),
            Camera {
                name: "ortho".into(),
                aspect: Some(1.5),
                projection: Projection::Orthographic { half_height: 2.5 },
                clip: ClipPlanes { near: 0.5, far: 20.0 },
                ..Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, 0.7)
            },
        ],
        ..Scene::default()
    }
}

fn same(a: &Scene, b: &Scene) {
    assert_eq!((a.meshes.len(), a.instances.len()), (b.meshes.len(), b.instances.len()));
    for (i, (x, y)) in a.meshes.iter().zip(&b.meshes).enumerate() {
        assert_eq!((&x.name, x.material), (&y.name, y.material));
        let (x, y) = (mesh(a, i), mesh(b, i));
        assert_eq!((&x.positions, &x.indices, &x.normals), (&y.positions, &y.indices, &y.normals));
        assert_eq!((&x.tangents, &x.texcoords, &x.colors), (&y.tangents, &y.texcoords, &y.colors));
    }
    for (x, y) in a.instances.iter().zip(&b.instances) {
        // bit by bit: JSON holds f64
        assert_eq!((&x.name, x.mesh, x.object_to_world), (&y.name, y.mesh, y.object_to_world));
    }
    for (x, y) in a.textures.iter().zip(&b.textures) {
        assert_eq!((&x.name, x.width, x.height, &x.texels), (&y.name, y.width, y.height, &y.texels));
        assert_eq!((x.wrap, x.filter), (y.wrap, y.filter));
    }
    for (x, y) in a.materials.iter().zip(&b.materials) {
        let (mut x, mut y) = (x.clone(), y.clone());
        // rotations go through an angle
        for (s, t) in x.texture_slots_mut().into_iter().flatten().zip(y.texture_slots_mut().into_iter().flatten()) {
            assert!(s.transform.abs_diff_eq(t.transform, 1e-6), "{s:?} {t:?}");
            t.transform = s.transform;
        }
        assert_eq!(x, y);
    }
    assert_eq!((a.materials.len(), a.textures.len()), (b.materials.len(), b.textures.len()));
    assert_eq!((a.lights.len(), a.cameras.len()), (b.lights.len(), b.cameras.len()));
    for (x, y) in a.lights.iter().zip(&b.lights) {
        assert_eq!(
            (&x.name, x.kind, x.intensity, x.position, x.range),
            (&y.name, y.kind, y.intensity, y.position, y.range)
        );
        assert!((x.direction - y.direction).length() < 1e-12);
    }
    for (x, y) in a.cameras.iter().zip(&b.cameras) {
        assert_eq!((&x.name, x.projection, x.aspect), (&y.name, y.projection, y.aspect));
        // a perspective camera of glTF has a near plane
        let next_to_nothing = y.clip.near <= 0.01 && y.clip.far == f64::INFINITY;
        assert!(y.clip == x.clip || x.clip == ClipPlanes::NONE && next_to_nothing, "{}", y.clip);
        assert!(x.camera_to_world.abs_diff_eq(y.camera_to_world, 1e-12));
    }
}

/// 16 bits a channel stay; floats have no image format in glTF.
#[test]
fn gltf_keeps_textures_of_16_bits() {
    let folder = Folder::new();
    let mut original = scene();
    for (name, alpha) in [("opaque.glb", 65535), ("alpha.gltf", 1000)] {
        let texels: Vec<u16> = (0..8 * 4u16).flat_map(|i| [i * 517, 600, i, alpha]).collect();
        original.textures[0].texels = texels.into();
        let path = folder.path(name);
        export_gltf(&original, &path).unwrap();
        same(&original, &load(&path).unwrap());
    }
    original.textures[0].texels = vec![1.5f32; 4 * 8 * 4].into();
    let error = export_gltf(&original, &folder.path("float.glb")).unwrap_err().to_string();
    assert!(error.contains("floating-point texels"), "{error}");
}

#[test]
fn gltf_round_trips() {
    let folder = Folder::new();
    let original = scene();
    for name in ["a.glb", "with space & ümlaut.gltf"] {
        let path = folder.path(name);
        export_gltf(&original, &path).unwrap();
        let loaded = load(&path).unwrap();
        assert!(loaded.report.warnings.is_empty(), "{:?}", loaded.report.warnings);
        assert_eq!(loaded.report.tangents_computed, 0);
        same(&original, &loaded);
        // and once more, from what was loaded
        let again = folder.path(&format!("again {name}"));
        export_gltf(&loaded, &again).unwrap();
        same(&loaded, &load(&again).unwrap());
    }
    // one image for both textures, no temporary files
    let names: Vec<_> = std::fs::read_dir(folder.path("")).unwrap().flatten().map(|f| f.file_name()).collect();
    assert_eq!(names.len(), 2 + 2 * 3, "{names:?}");
}

/// Groups stay groups, with what is below them in its order and where it was: meshes, a camera and lights among them.
#[test]
fn gltf_keeps_the_tree_of_nodes() {
    let folder = Folder::new();
    let mut doc = Doc::triangle();
    doc.json["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }]);
    doc.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    doc.json["extensions"] =
        json!({ "KHR_lights_punctual": { "lights": [{ "type": "point" }, { "type": "spot", "spot": {} }] } });
    let light = |k: usize| json!({ "KHR_lights_punctual": { "light": k } });
    doc.json["nodes"] = json!([
        { "name": "street", "translation": [10, 0, 0.1], "children": [1, 5, 7, 8] },
        { "name": "car", "mesh": 0, "rotation": [0, 0.6, 0, 0.8], "scale": [1, 2, 3], "children": [2, 3, 4] },
        { "name": "wheel", "mesh": 0, "translation": [0.1, 0.2, 0.3] },
        { "name": "lamps", "children": [9, 10] },
        { "name": "wheel", "mesh": 0, "scale": [-1, 1, 1] },
        { "name": "tripod", "translation": [0, 1.7, 0], "children": [6] },
        { "name": "view", "camera": 0 },
        { "name": "house", "mesh": 0 },
        { "children": [11] },
        { "name": "left", "extensions": light(0), "translation": [1, 2, 3] },
        { "name": "right", "extensions": light(1), "rotation": [0.6, 0, 0, 0.8] },
        { "name": "tree", "mesh": 0, "children": [12] },
        { "name": "leaf", "mesh": 0 },
    ]);
    let original = doc.load();
    let shape = |scene: &Scene| {
        let node = |n: &nodes::SceneNode| (n.name.to_string(), n.parent(), n.end(), n.items());
        scene.nodes.iter().map(node).collect::<Vec<_>>()
    };
    let names: Vec<String> = shape(&original).into_iter().map(|node| node.0).collect();
    assert_eq!(names, ["street", "car", "lamps", "tripod", "tree"]);
    for name in ["a.glb", "b.gltf"] {
        let path = folder.path(name);
        export_gltf(&original, &path).unwrap();
        let loaded = load(&path).unwrap();
        assert!(loaded.report.warnings.is_empty(), "{:?}", loaded.report.warnings);
        same(&original, &loaded);
        assert_eq!(shape(&loaded), shape(&original), "{name}");
    }
    // other readers see a hierarchy, too
    let written: Value = serde_json::from_slice(&std::fs::read(folder.path("b.gltf")).unwrap()).unwrap();
    assert_eq!(written["scenes"][0]["nodes"].as_array().unwrap().len(), 1);
    let street = written["scenes"][0]["nodes"][0].as_u64().unwrap() as usize;
    let below: Vec<_> = written["nodes"][street]["children"].as_array().unwrap().iter().collect();
    let named = |k: &&Value| written["nodes"][k.as_u64().unwrap() as usize]["name"].as_str().unwrap().to_owned();
    assert_eq!(below.iter().map(named).collect::<Vec<_>>(), ["car", "tripod", "house", "tree"]);

    // what is hidden is left out, and its group stays while it has something
    let mut fewer = original.clone();
    fewer.hidden.insert(1);
    export_gltf(&fewer, &folder.path("c.glb")).unwrap();
    let loaded = load(&folder.path("c.glb")).unwrap();
    assert_eq!((loaded.instances.len(), loaded.nodes[1].instances().len()), (5, 2));
}

/// glTF has no LEDs: the others stay, and it is said.
#[test]
fn gltf_leaves_out_leds() {
    let folder = Folder::new();
    let mut original = scene();
    let led = Light { name: "ceiling".into(), kind: LightKind::Led { half_angle: 0.5 }, ..original.lights[0].clone() };
    original.lights.insert(1, led);
    let path = folder.path("a.glb");
    let written = export_gltf(&original, &path).unwrap();
    assert_eq!(written.warnings, ["light 'ceiling' is left out: glTF has no LED lights"]);
    original.lights.remove(1);
    same(&original, &load(&path).unwrap());
}

#[test]
fn spheres_are_tessellated() {
    let folder = Folder::new();
    let sphere = Sphere { center: Vec3::new(1.0, 0.0, 0.0), radius: 2.0 };
    let bulb = Sphere { center: Vec3::ZERO, radius: 0.5 };
    let scene = Scene {
        meshes: vec![
            Mesh { name: "ball".into(), geometry: Geometry::Spheres(vec![sphere]), material: 0, source: None },
            Mesh { name: "bulb".into(), geometry: Geometry::Spheres(vec![bulb]), material: 1, source: None },
        ],
        instances: vec![
            Instance { name: "ball".into(), mesh: 0, object_to_world: DAffine3::from_scale(DVec3::splat(2.0)) },
            Instance {
                name: "bulb".into(),
                mesh: 1,
                object_to_world: DAffine3::from_translation(DVec3::new(0.0, 9.0, 0.0)),
            },
        ],
        materials: vec![Material::default(), Material { emissive: Vec3::new(10.0, 5.0, 1.0), ..Material::default() }],
        ..Scene::default()
    };
    let path = folder.path("a.glb");
    export_gltf(&scene, &path).unwrap();
    let loaded = load(&path).unwrap();
    assert_eq!((loaded.instances.len(), loaded.lights.len(), loaded.triangle_count()), (2, 0, 2 * 5120));
    assert_eq!(loaded.materials[loaded.meshes[1].material].emissive, Vec3::new(10.0, 5.0, 1.0));
    let (positions, indices) = mesh_bin(&scene).unwrap();
    assert_eq!(indices.len(), 2 * 20480);
    let ball = |p: &Vec3| (p.distance(Vec3::new(2.0, 0.0, 0.0)) - 4.0).abs() < 1e-5;
    let bulb = |p: &Vec3| (p.distance(Vec3::new(0.0, 9.0, 0.0)) - 0.5).abs() < 1e-5;
    assert!(
        positions.iter().all(|p| ball(p) || bulb(p))
            && positions.iter().filter(|p| bulb(p)).count() * 2 == positions.len()
    );
}

#[test]
fn mesh_bin_round_trips() {
    let folder = Folder::new();
    let mut original = scene();
    // degenerate triangles and order survive
    if let Geometry::Triangles(t) = &mut original.meshes[0].geometry {
        t.indices.push([1, 1, 2]);
    }
    let path = folder.path("a.bin");
    assert_eq!(write_mesh_bin(&original, &path).unwrap(), ExportStats { triangles: 7, warnings: Vec::new() });
    assert_eq!(std::fs::metadata(&path).unwrap().len(), 8 + 12 * 12 + 7 * 12);
    let scene = read_mesh_bin(&path).unwrap();
    let m = mesh(&scene, 0);
    let (positions, indices) = mesh_bin(&original).unwrap();
    assert_eq!((&m.positions, &m.indices), (&positions, &indices));
    assert_eq!(m.indices[..4], [[0, 1, 2], [2, 1, 3], [1, 1, 2], [4, 5, 6]]);
    let to_world = original.instances[1].object_to_world;
    assert_eq!(positions[5], to_world.transform_point3(DVec3::X).as_vec3());
    assert_eq!((scene.triangle_count(), scene.materials.len()), (7, 1));
}

#[test]
fn broken_mesh_bin() {
    let folder = Folder::new();
    let read = |data: &[u8]| read_mesh_bin(&folder.write("a.bin", data)).map(|_| ()).unwrap_err();
    let words = |w: &[u32]| w.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    assert!(read(&[1]).to_string().contains("no header"));
    assert!(read(&words(&[u32::MAX, u32::MAX])).to_string().contains("has 8"));
    assert!(matches!(read(&words(&[0, 0])), Error::Scene(_)));
    assert!(read(&words(&[1, 1, 0, 0, 0, 0, 0, 1])).to_string().contains("triangle 0"));
    assert!(read(&words(&[1, 1, f32::NAN.to_bits(), 0, 0, 0, 0, 0])).to_string().contains("vertex 0"));
    assert!(read_mesh_bin(&folder.path("gone.bin")).is_err());
}

#[test]
fn writing_fails_whole() {
    let folder = Folder::new();
    let original = scene();
    let error = export_gltf(&original, &folder.path("gone/a.glb")).unwrap_err();
    assert_eq!(error.exit_code(), 4);
    assert!(error.to_string().contains("folder does not exist"), "{error}");
    assert!(export_gltf(&original, &folder.path("a.obj")).unwrap_err().to_string().contains(".glb or .gltf"));
    std::fs::create_dir(folder.path("dir.glb")).unwrap();
    assert_eq!(export_gltf(&original, &folder.path("dir.glb")).unwrap_err().exit_code(), 4);
    assert_eq!(write_mesh_bin(&original, &folder.path("dir.glb")).unwrap_err().exit_code(), 4);
    // nothing else was left there
    assert_eq!(std::fs::read_dir(folder.path("")).unwrap().count(), 1);
}
