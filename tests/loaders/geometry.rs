//! Accessors, index types, modes, attributes.

use glam::{DVec3, Vec2, Vec3, Vec4};
use serde_json::json;
use skylit::scene::animation::{Playback, Pose};
use skylit::scene::load::{LoadOptions, load_with};
use skylit::scene::{Geometry, Scene};

use crate::build::*;

const QUAD: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];

#[test]
fn not_indexed_in_every_container() {
    let folder = Folder::new();
    let doc = Doc::triangle();
    let mut external = doc.json.clone();
    external["buffers"] = json!([{ "byteLength": doc.bin.len(), "uri": "my%20buffer.bin" }]);
    folder.write("my buffer.bin", &doc.bin);
    for (name, data) in [("a.gltf", doc.gltf()), ("a.GLB", doc.glb()), ("b.glTF", external.to_string().into_bytes())] {
        let scene = folder.load(name, data).unwrap();
        assert_eq!(scene.triangle_count(), 1, "{name}");
        assert_eq!(corners(mesh(&scene, 0))[0], TRIANGLE, "{name}");
        assert_eq!((scene.name.as_str(), scene.meshes[0].name.as_str()), (name, "mesh"));
        assert_eq!(scene.materials.len(), 1);
        // no normals: flat, and said so
        assert!(mesh(&scene, 0).normals.is_empty());
        assert_eq!(scene.report.normals_computed, 1);
        assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    }
}

#[test]
fn index_types() {
    let indices = [2u32, 1, 3, 0, 1, 2];
    let data: [(u32, Vec<u8>); 3] = [
        (U8, indices.iter().map(|&i| i as u8).collect()),
        (U16, indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect()),
        (U32, indices.iter().flat_map(|&i| i.to_le_bytes()).collect()),
    ];
    for (component, data) in data {
        let mut doc = Doc::new();
        let position = doc.positions(&QUAD);
        let accessor = doc.accessor(&data, component, "SCALAR", 6);
        doc.primitive(json!({ "attributes": { "POSITION": position }, "indices": accessor }));
        assert_eq!(mesh(&doc.load(), 0).indices, [[2, 1, 3], [0, 1, 2]], "{component}");
    }
}

#[test]
fn strips_fans_points_and_lines() {
    let strip = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 2.0, 0.0]];
    let fan = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    for (mode, points, indexed) in [(5, strip, false), (5, strip, true), (6, fan, false), (6, fan, true)] {
        let mut doc = Doc::new();
        let position = doc.positions(&points);
        doc.primitive(json!({ "attributes": { "POSITION": position }, "mode": mode }));
        if indexed {
            let indices = doc.accessor(&[0, 1, 2, 3, 4], U8, "SCALAR", 5);
            doc.first()["indices"] = json!(indices);
        }
        let scene = doc.load();
        assert_eq!(scene.triangle_count(), 3);
        for [a, b, c] in corners(mesh(&scene, 0)).into_iter().map(|t| t.map(Vec3::from)) {
            assert!((b - a).cross(c - a).z > 0.0, "mode {mode} must stay counter-clockwise");
        }
    }
    for mode in 0..4 {
        let mut doc = Doc::triangle();
        let position = doc.first()["attributes"]["POSITION"].clone();
        doc.primitive(json!({ "attributes": { "POSITION": position }, "mode": mode }));
        let scene = doc.load();
        assert_eq!((scene.meshes.len(), scene.report.warnings.len()), (1, 1), "{:?}", scene.report.warnings);
    }
}

#[test]
fn incomplete_triangles_are_ignored() {
    let mut doc = Doc::new();
    let position = doc.positions(&QUAD);
    doc.primitive(json!({ "attributes": { "POSITION": position } }));
    let scene = doc.load();
    assert_eq!((scene.triangle_count(), scene.report.warnings.len()), (1, 1));
}

#[test]
fn interleaved_attributes() {
    let mut doc = Doc::new();
    let mut data = Vec::new();
    for p in TRIANGLE {
        data.extend(bytes(&[p]));
        data.extend(bytes(&[[0.0, 0.0, 1.0f32]]));
        data.extend(bytes(&[[p[0], 1.0 - p[1]]]));
    }
    let view = doc.view(&data, Some(32));
    let mut part = |offset: usize, shape: &str| {
        doc.push(
            "accessors",
            json!({ "bufferView": view, "byteOffset": offset, "componentType": F32, "type": shape, "count": 3 }),
        )
    };
    let (position, normal, texcoord) = (part(0, "VEC3"), part(12, "VEC3"), part(24, "VEC2"));
    doc.primitive(json!({ "attributes": { "POSITION": position, "NORMAL": normal, "TEXCOORD_0": texcoord } }));
    let scene = doc.load();
    let mesh = mesh(&scene, 0);
    assert_eq!(corners(mesh)[0], TRIANGLE);
    assert_eq!(mesh.normals, [Vec3::Z; 3]);
    assert_eq!(mesh.texcoords[0], [Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(0.0, 0.0)]);
    assert_eq!(scene.report.normals_computed, 0);
}

#[test]
fn sparse_accessors() {
    // over a buffer view
    let mut doc = Doc::triangle();
    let at = doc.view(&1u16.to_le_bytes(), None);
    let values = doc.view(&bytes(&[[7.0, 0.0, 0.0f32]]), None);
    let sparse = json!({
        "count": 1,
        "indices": { "bufferView": at, "componentType": U16 },
        "values": { "bufferView": values },
    });
    doc.json["accessors"][0]["sparse"] = sparse;
    assert_eq!(corners(mesh(&doc.load(), 0))[0], [TRIANGLE[0], [7.0, 0.0, 0.0], TRIANGLE[2]]);

    // over zeros
    let mut doc = Doc::new();
    let at = doc.view(&[1, 2], None);
    let values = doc.view(&bytes(&TRIANGLE[1..]), None);
    let accessor = doc.push(
        "accessors",
        json!({
            "componentType": F32, "type": "VEC3", "count": 3,
            "sparse": {
                "count": 2,
                "indices": { "bufferView": at, "componentType": U8 },
                "values": { "bufferView": values },
            },
        }),
    );
    doc.primitive(json!({ "attributes": { "POSITION": accessor } }));
    assert_eq!(corners(mesh(&doc.load(), 0))[0], TRIANGLE);

    // indices
    let mut doc = Doc::new();
    let position = doc.positions(&QUAD);
    let indices = doc.accessor(&[0, 1, 1], U8, "SCALAR", 3);
    let at = doc.view(&2u32.to_le_bytes(), None);
    let values = doc.view(&[3], None);
    doc.json["accessors"][indices]["sparse"] = json!({
        "count": 1,
        "indices": { "bufferView": at, "componentType": U32 },
        "values": { "bufferView": values },
    });
    doc.primitive(json!({ "attributes": { "POSITION": position }, "indices": indices }));
    assert_eq!(mesh(&doc.load(), 0).indices, [[0, 1, 3]]);
    doc.json["accessors"][indices]["sparse"]["indices"]["byteOffset"] = json!(1);
    assert!(doc.error().contains(&format!("accessor {indices}")), "{}", doc.error());
}

#[test]
fn quantized_positions_normals_and_texcoords() {
    let mut doc = Doc::new();
    doc.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
    doc.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    let short = |v: &[i16]| v.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    // i16, padded to 8 bytes
    let data = short(&[0, 0, 0, 0, 100, 0, 0, 0, 0, -100, 0, 0]);
    let view = doc.view(&data, Some(8));
    let position =
        doc.push("accessors", json!({ "bufferView": view, "componentType": I16, "type": "VEC3", "count": 3 }));
    // normalised i8, padded to 4 bytes
    let normals = [0u8, 0, 127, 0, 0, 0, 127, 0, 0, 129, 0, 0];
    let view = doc.view(&normals, Some(4));
    let normal = doc.push(
        "accessors",
        json!({ "bufferView": view, "componentType": I8, "normalized": true, "type": "VEC3", "count": 3 }),
    );
    let view = doc.view(&[0, 0, 0, 0, 255, 255, 0, 0, 0, 0, 255, 255], Some(4));
    let texcoord = doc.push(
        "accessors",
        json!({ "bufferView": view, "componentType": U16, "normalized": true, "type": "VEC2", "count": 3 }),
    );
    doc.primitive(json!({ "attributes": { "POSITION": position, "NORMAL": normal, "TEXCOORD_0": texcoord } }));
    let scene = doc.load();
    let m = mesh(&scene, 0);
    assert_eq!(corners(m)[0], [[0.0; 3], [100.0, 0.0, 0.0], [0.0, -100.0, 0.0]]);
    assert_eq!(m.normals, [Vec3::Z, Vec3::Z, Vec3::NEG_Y]);
    assert_eq!(m.texcoords[0], [Vec2::ZERO, Vec2::new(1.0, 0.0), Vec2::new(0.0, 1.0)]);

    // normalised u8 and i16 positions
    for (component, data) in
        [(U8, vec![0u8, 0, 0, 255, 0, 0, 0, 255, 0]), (I16, short(&[0, 0, 0, 32767, 0, 0, 0, 32767, 0]))]
    {
        let mut doc = Doc::new();
        let position = doc.accessor(&data, component, "VEC3", 3);
        doc.json["accessors"][0]["normalized"] = json!(true);
        doc.primitive(json!({ "attributes": { "POSITION": position } }));
        assert_eq!(corners(mesh(&doc.load(), 0))[0], TRIANGLE);
    }
}

#[test]
fn vertex_colors() {
    let colors: [(u32, &str, Vec<u8>, bool); 3] = [
        (F32, "VEC3", bytes(&[[1.0, 0.5, 0.0f32]; 3]), false),
        (U8, "VEC4", [255, 128, 0, 255].repeat(3), true),
        (U16, "VEC4", [255, 255, 0, 128, 0, 0, 255, 255].repeat(3), true),
    ];
    for (component, shape, data, normalized) in colors {
        let mut doc = Doc::triangle();
        let color = doc.accessor(&data, component, shape, 3);
        doc.json["accessors"][color]["normalized"] = json!(normalized);
        doc.first()["attributes"]["COLOR_0"] = json!(color);
        let scene = doc.load();
        for c in &mesh(&scene, 0).colors {
            assert!(c.abs_diff_eq(Vec4::new(1.0, 0.5, 0.0, 1.0), 0.003), "{component} {shape}: {c}");
        }
    }
}

#[test]
fn degenerate_triangles_are_dropped_and_counted() {
    let mut doc = Doc::new();
    let mut points = QUAD.to_vec();
    points.push([2.0, 0.0, 0.0]); // on a line with 0 and 1
    points.push([0.0, 0.0, 0.0]); // coincides with 0
    let position = doc.positions(&points);
    let indices = doc.accessor(&[0, 1, 2, 0, 0, 1, 0, 1, 4, 0, 5, 2, 1, 3, 2], U8, "SCALAR", 15);
    doc.primitive(json!({ "attributes": { "POSITION": position }, "indices": indices }));
    let scene = doc.load();
    assert_eq!((scene.triangle_count(), scene.report.degenerate_triangles), (2, 3));
    assert_eq!(mesh(&scene, 0).indices, [[0, 1, 2], [1, 3, 2]]);
}

#[test]
fn shared_vertex_arrays_are_cut_to_what_is_used() {
    let mut doc = Doc::new();
    let points: Vec<[f32; 3]> = (0..100).flat_map(|i| TRIANGLE.map(|p| [p[0] + i as f32, p[1], p[2]])).collect();
    let position = doc.positions(&points);
    let normal = doc.accessor(&bytes(&[[0.0, 0.0, 1.0f32]; 300]), F32, "VEC3", 300);
    let texcoord = doc.accessor(&bytes(&points.iter().map(|p| [p[0], p[1]]).collect::<Vec<_>>()), F32, "VEC2", 300);
    for i in 0..100u16 {
        let corners: Vec<u8> = [3 * i, 3 * i + 1, 3 * i + 2].into_iter().flat_map(u16::to_le_bytes).collect();
        let indices = doc.accessor(&corners, U16, "SCALAR", 3);
        doc.primitive(
            json!({ "attributes": { "POSITION": position, "NORMAL": normal, "TEXCOORD_0": texcoord }, "indices": indices }),
        );
    }
    let scene = doc.load();
    assert_eq!(scene.meshes.len(), 100);
    for i in 0..100 {
        let m = mesh(&scene, i);
        assert_eq!((m.positions.len(), m.normals.len(), m.texcoords[0].len()), (3, 3, 3));
        assert_eq!(corners(m)[0], TRIANGLE.map(|p| [p[0] + i as f32, p[1], p[2]]));
        assert_eq!(m.texcoords[0][1].x, i as f32 + 1.0);
    }
}

#[test]
fn normals_are_repaired() {
    let mut doc = Doc::triangle();
    let normal = doc.accessor(&bytes(&[[0.0, 0.0, 9.0], [0.0; 3], [f32::NAN, 0.0, 0.0]]), F32, "VEC3", 3);
    doc.first()["attributes"]["NORMAL"] = json!(normal);
    let scene = doc.load();
    assert_eq!(mesh(&scene, 0).normals, [Vec3::Z; 3]);
    assert!(scene.report.warnings[0].contains("2 normals"), "{:?}", scene.report.warnings);
}

#[test]
fn tangents_only_where_a_normal_map_needs_them() {
    let mut doc = Doc::triangle();
    let normal = doc.accessor(&bytes(&[[0.0, 0.0, 1.0f32]; 3]), F32, "VEC3", 3);
    // u along x, v down along -y: the bitangent is +y
    let texcoord = doc.accessor(&bytes(&TRIANGLE.map(|p| [p[0], 1.0 - p[1]])), F32, "VEC2", 3);
    let tangent = doc.accessor(&bytes(&[[0.0, 2.0, 0.0, -1.0f32]; 3]), F32, "VEC4", 3);
    doc.first()["attributes"]["NORMAL"] = json!(normal);
    doc.first()["attributes"]["TEXCOORD_0"] = json!(texcoord);
    doc.first()["attributes"]["TANGENT"] = json!(tangent);
    assert!(mesh(&doc.load(), 0).tangents.is_empty());

    let uri = format!("data:image/png;base64,{}", base64(&png(2, 2, [128, 128, 255, 255])));
    doc.push("images", json!({ "uri": uri }));
    doc.push("textures", json!({ "source": 0 }));
    doc.push("materials", json!({ "normalTexture": { "index": 0, "scale": 0.5 } }));
    doc.first()["material"] = json!(0);
    let scene = doc.load();
    assert_eq!(mesh(&scene, 0).tangents, [Vec4::new(0.0, 1.0, 0.0, -1.0); 3]);
    assert_eq!((scene.report.tangents_computed, scene.materials[0].normal_scale), (0, 0.5));

    doc.first()["attributes"].as_object_mut().unwrap().remove("TANGENT");
    let scene = doc.load();
    assert_eq!(mesh(&scene, 0).tangents, [Vec4::new(1.0, 0.0, 0.0, 1.0); 3]);
    assert_eq!(scene.report.tangents_computed, 1);

    // without normals the tangents of flat shading are needed
    doc.first()["attributes"].as_object_mut().unwrap().remove("NORMAL");
    let scene = doc.load();
    assert_eq!(mesh(&scene, 0).tangents, [Vec4::new(1.0, 0.0, 0.0, 1.0); 3]);
    assert_eq!(mesh(&scene, 0).normals, [Vec3::Z; 3]);
}

/// Without tangents, and without texture coordinates to compute them from: around the y axis.
#[test]
fn tangents_without_texture_coordinates() {
    const POINTS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [0.0, 0.0, -2.0], [0.0, 2.0, 0.0]];
    let anisotropy = json!({ "KHR_materials_anisotropy": { "anisotropyStrength": 0.5 } });
    let coat = json!({ "KHR_materials_clearcoat": { "clearcoatFactor": 1, "clearcoatNormalTexture": { "index": 0 } } });
    let cases = [
        ("anisotropy", json!({ "extensions": anisotropy }), true),
        (
            "anisotropy from a texture",
            json!({ "extensions": {
            "KHR_materials_anisotropy": { "anisotropyStrength": 0.5, "anisotropyTexture": { "index": 0 } } } }),
            true,
        ),
        ("normal map", json!({ "normalTexture": { "index": 0 } }), false),
        ("normal map of set 1", json!({ "normalTexture": { "index": 0, "texCoord": 1 } }), false),
        ("coat's normal map", json!({ "extensions": coat }), false),
    ];
    for (name, material, warned) in cases {
        for (normals, set) in [(false, None), (true, None), (false, Some(0)), (true, Some(1))] {
            let mut doc = Doc::new();
            let position = doc.positions(&POINTS);
            doc.primitive(json!({ "attributes": { "POSITION": position }, "material": 0 }));
            doc.push("materials", material.clone());
            let uri = format!("data:image/png;base64,{}", base64(&png(2, 2, [128, 128, 255, 255])));
            doc.push("images", json!({ "uri": uri }));
            doc.push("textures", json!({ "source": 0 }));
            if normals {
                let normal = doc.accessor(&bytes(&[[1.0, 0.0, 0.0f32]; 3]), F32, "VEC3", 3);
                doc.first()["attributes"]["NORMAL"] = json!(normal);
            }
            if let Some(set) = set {
                // u upwards
                let texcoord = doc.accessor(&bytes(&[[0.0, 0.0], [0.0, 1.0], [1.0, 0.0f32]]), F32, "VEC2", 3);
                doc.first()["attributes"][format!("TEXCOORD_{set}")] = json!(texcoord);
            }
            let scene = doc.load();
            let m = mesh(&scene, 0);
            // the normal is +x or -x
            assert_eq!(m.normals.len(), 3, "{name}");
            let expected = if set.is_some() { Vec3::Y } else { Vec3::new(0.0, 0.0, -m.normals[0].x) };
            for t in &m.tangents {
                assert!((t.truncate() - expected).length() < 1e-6 && t.w.abs() == 1.0, "{name}, {set:?}: {t}");
            }
            assert_eq!((m.tangents.len(), scene.report.tangents_computed), (3, 1), "{name}");
            let about = scene.report.warnings.iter().any(|w| w.contains("neither tangents nor texture coordinates"));
            assert_eq!(about, warned && set.is_none(), "{name}, {set:?}: {:?}", scene.report.warnings);
        }
    }
}

#[test]
fn tangents_split_vertices_where_texcoords_mirror() {
    // two triangles share the edge 1-2; u runs one way in the first and back in the second
    let mut doc = Doc::new();
    let position = doc.positions(&QUAD);
    let normal = doc.accessor(&bytes(&[[0.0, 0.0, 1.0f32]; 4]), F32, "VEC3", 4);
    let uv = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0f32]];
    let texcoord = doc.accessor(&bytes(&uv), F32, "VEC2", 4);
    let indices = doc.accessor(&[0, 1, 2, 1, 3, 2], U8, "SCALAR", 6);
    let view = doc.view(&png(1, 1, [128, 128, 255, 255]), None);
    doc.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
    doc.push("textures", json!({ "source": 0 }));
    doc.push("materials", json!({ "normalTexture": { "index": 0 } }));
    doc.primitive(json!({
        "attributes": { "POSITION": position, "NORMAL": normal, "TEXCOORD_0": texcoord },
        "indices": indices, "material": 0,
    }));
    let scene = doc.load();
    let m = mesh(&scene, 0);
    assert_eq!(m.positions.len(), 6);
    for array in [m.normals.len(), m.texcoords[0].len(), m.tangents.len()] {
        assert_eq!(array, 6);
    }
    assert_eq!(corners(m)[1], [QUAD[1], QUAD[3], QUAD[2]]);
    let handedness = |t: usize| m.indices[t].map(|i| m.tangents[i as usize].w);
    assert_eq!((handedness(0), handedness(1)), ([-1.0; 3], [1.0; 3]));
}

/// Normals by options of a glTF file, whose meshes are flat without any; a mesh that deforms keeps its shape.
#[test]
fn normals_of_options() {
    // a tent: two quads over a ridge, bent by 90 degrees, with the corners of each its own
    let corners = [
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 1.0, 1.0],
        [-1.0, 0.0, 1.0],
        [0.0, 1.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 0.0, 1.0],
        [0.0, 1.0, 1.0f32],
    ];
    let mut doc = Doc::new();
    let position = doc.positions(&corners);
    let indices = doc.accessor(&[0, 3, 2, 0, 2, 1, 4, 7, 6, 4, 6, 5], U8, "SCALAR", 12);
    let slide = doc.positions(&[[0.0, 3.0, 0.0]; 8]);
    doc.primitive(
        json!({ "attributes": { "POSITION": position }, "indices": indices, "targets": [{ "POSITION": slide }] }),
    );
    let folder = Folder::new();
    for is_animated in [false, true] {
        if is_animated {
            let times = doc.accessor(&bytes(&[[0.0], [1.0f32]]), F32, "SCALAR", 2);
            let weights = doc.accessor(&bytes(&[[0.0], [1.0f32]]), F32, "SCALAR", 2);
            doc.push(
                "animations",
                json!({
                    "samplers": [{ "input": times, "output": weights }],
                    "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
                }),
            );
        }
        let path = folder.write("tent.gltf", doc.gltf());
        assert!(mesh(&load_vertices(&path, "file", None), 0).normals.is_empty());
        assert!(mesh(&load_vertices(&path, "flat", None), 0).normals.is_empty());
        let left = Vec3::new(-1.0, 1.0, 0.0).normalize();
        for (normals, ridge) in [("smooth", Vec3::Y), ("91", Vec3::Y), ("89", left)] {
            let scene = load_vertices(&path, normals, None);
            let m = mesh(&scene, 0);
            assert_eq!((m.normals.len(), m.positions.len(), scene.report.normals_replaced), (8, 8, 1));
            for (p, n) in m.positions.iter().zip(&m.normals).take(4) {
                let expected = if p.x == 0.0 { ridge } else { left };
                assert!(n.abs_diff_eq(expected, 1e-6), "{normals}: {p} {n}");
            }
            // vertices of the pose follow
            if let Some(rig) = &scene.rig {
                let mut pose = Pose::default();
                rig.pose(0, 1.0, Playback::Once, &mut pose).unwrap();
                let shape = &pose.meshes[0].shape;
                assert!(shape.positions.iter().zip(&m.positions).all(|(a, b)| *a == *b + 3.0 * Vec3::Y));
                assert!(shape.normals.iter().zip(&m.normals).all(|(a, b)| a.abs_diff_eq(*b, 1e-6)));
            }
        }
    }
    // built-in scenes have normals of options, too: a box of twelve triangles
    let smooth = load_vertices(std::path::Path::new("builtin:closed-box"), "smooth", None);
    assert!(smooth.report.normals_replaced > 0 && !mesh(&smooth, 0).normals.is_empty());
}

/// A file with two scenes: which one is loaded is an option.
#[test]
fn scenes_of_a_file() {
    let mut doc = Doc::triangle();
    let nodes: Vec<usize> =
        ["a", "b", "c"].iter().map(|name| doc.push("nodes", json!({ "name": name, "mesh": 0 }))).collect();
    doc.json["scenes"] = json!([
        { "name": "first", "nodes": [nodes[0]] }, { "name": "second", "nodes": [nodes[1], nodes[2]] }, { "name": "0", "nodes": [nodes[2]] },
    ]);
    doc.json["scene"] = json!(1);
    let folder = Folder::new();
    let path = folder.write("scenes.gltf", doc.gltf());
    let source = path.to_str().unwrap();
    let load = |scene| load_with(source, &LoadOptions { scene, ..Default::default() });
    let names = |scene| load(scene).unwrap().instances.iter().map(|i| i.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(None), ["b", "c"]);
    assert_eq!(names(Some("first")), ["a"]);
    assert_eq!(names(Some("1")), ["b", "c"]);
    // a name prevails over a number
    assert_eq!(names(Some("0")), ["c"]);
    let scene = load(Some("first")).unwrap();
    assert_eq!(
        (scene.name.as_str(), &scene.report.scenes[..]),
        ("scenes.gltf, scene first", &["first", "second", "0"].map(str::to_owned)[..])
    );

    // what there is not
    let error = |scene| load(Some(scene)).map(|_| ()).unwrap_err().to_string();
    assert!(error("3").contains("--gltf-scene 3: no such scene, but 0 `first`, 1 `second`"), "{}", error("3"));
    let other = load_with("builtin:atrium", &LoadOptions { scene: Some("0"), ..Default::default() });
    assert!(other.map(|_| ()).unwrap_err().to_string().contains("no glTF file"));
}

/// What points up along z is turned to y, with the cameras, lights and light from all around of the file.
#[test]
fn z_may_point_up() {
    use skylit::scene::load::{GeometryOptions, UpAxis};
    let options = |up| LoadOptions { geometry: GeometryOptions { up, ..Default::default() }, ..LoadOptions::default() };
    let folder = Folder::new();
    let path = folder.write("a.obj", "v 1 2 3\nv 2 2 3\nv 1 5 3\nf 1 2 3\n");
    let scene = load_with(path.to_str().unwrap(), &options(UpAxis::Z)).unwrap();
    let (lo, hi) = scene.bounds().unwrap();
    assert!((lo - DVec3::new(1.0, 3.0, -5.0)).length() < 1e-12 && (hi - DVec3::new(2.0, 3.0, -2.0)).length() < 1e-12);
    assert_eq!(scene.report.options, ["--up-axis", "z"]);

    // where everything is in the view of a camera does not change
    for name in ["builtin:cornell-box", "builtin:stairs", "builtin:spheres:20"] {
        let [before, after] = [UpAxis::Y, UpAxis::Z].map(|up| load_with(name, &options(up)).unwrap());
        let seen = |scene: &Scene| {
            let to_camera = scene.cameras[0].camera_to_world.inverse();
            let instances = scene.instances.iter().map(|i| to_camera * i.object_to_world);
            let lights = scene
                .lights
                .iter()
                .flat_map(|l| [to_camera.transform_point3(l.position), to_camera.transform_vector3(l.direction)]);
            (instances.collect::<Vec<_>>(), lights.collect::<Vec<_>>())
        };
        let (before, after) = (seen(&before), seen(&after));
        assert!(before.0.iter().zip(&after.0).all(|(a, b)| a.abs_diff_eq(*b, 1e-9)), "{name}");
        assert!(before.1.iter().zip(&after.1).all(|(a, b)| a.abs_diff_eq(*b, 1e-9)), "{name}");
    }

    // animated files turn with their nodes, skins and morph targets, at rest and at any time
    for name in ["scenes/parade.glb"] {
        let [before, after] = [UpAxis::Y, UpAxis::Z].map(|up| load_with(name, &options(up)).unwrap());
        let turn = glam::DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);
        for time in [None, Some(0.0), Some(0.37), Some(1.1)] {
            let [before, after] = [&before, &after].map(|scene| {
                let mut scene = scene.clone();
                if let Some(time) = time {
                    let rig = scene.rig.clone().unwrap();
                    let mut pose = Pose::default();
                    rig.pose(0, time, Playback::Loop, &mut pose).unwrap();
                    pose.apply(&mut scene);
                }
                world_points(&scene)
            });
            assert!(before.len() > 100 && before.len() == after.len());
            let size = before.iter().fold(0.0, |m: f64, p| m.max(p.abs().max_element()));
            let worst = before.iter().zip(&after).map(|(a, b)| (turn * *a - *b).length()).fold(0.0, f64::max);
            assert!(worst < 1e-6 * size, "{name} at {time:?}: {worst:e} of {size}");
        }
    }
}

/// Vertices, cameras and lights of a scene in world space.
fn world_points(scene: &Scene) -> Vec<DVec3> {
    let mut points = Vec::new();
    for instance in &scene.instances {
        if let Geometry::Triangles(t) = &scene.meshes[instance.mesh].geometry {
            points.extend(t.positions.iter().map(|p| instance.object_to_world.transform_point3(p.as_dvec3())));
        }
    }
    points.extend(scene.cameras.iter().map(|c| c.camera_to_world.translation));
    points.extend(scene.lights.iter().map(|l| l.position));
    points
}
