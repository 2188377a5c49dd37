//! Materials, textures, images, samplers.

use glam::{Vec2, Vec3, Vec4};
use serde_json::{Value, json};
use skylit::scene::material::{AlphaMode, Material, TextureSlot};
use skylit::scene::{Filter, Geometry, Scene, SceneSettings, TexelData, Wrap};

use crate::build::*;

/// A textured triangle with three embedded images and this material.
fn with_material(material: Value) -> Doc {
    let mut doc = Doc::triangle();
    let texcoord = doc.accessor(&bytes(&TRIANGLE.map(|p| [p[0], p[1]])), F32, "VEC2", 3);
    doc.first()["attributes"]["TEXCOORD_0"] = json!(texcoord);
    doc.first()["attributes"]["TEXCOORD_1"] = json!(texcoord);
    let normal = doc.accessor(&bytes(&[[0.0, 0.0, 1.0f32]; 3]), F32, "VEC3", 3);
    doc.first()["attributes"]["NORMAL"] = json!(normal);
    for i in 0..3 {
        let view = doc.view(&png(1 + i, 2, [i as u8, 2, 3, 4]), None);
        doc.push("images", json!({ "bufferView": view, "mimeType": "image/png", "name": format!("image {i}") }));
        doc.push("textures", json!({ "source": i }));
    }
    doc.push("materials", material);
    doc.first()["material"] = json!(0);
    doc
}

fn material(scene: &Scene) -> &Material {
    &scene.materials[0]
}

#[test]
fn core() {
    let doc = with_material(json!({
        "name": "m", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25, "emissiveFactor": [1, 0.5, 0],
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 0.25,
            "baseColorTexture": { "index": 2 }, "metallicRoughnessTexture": { "index": 1, "texCoord": 1 },
        },
        "occlusionTexture": { "index": 1 }, "emissiveTexture": { "index": 0 },
    }));
    let scene = doc.load();
    let m = material(&scene);
    assert_eq!((m.name.as_str(), m.double_sided, m.alpha_mode), ("m", true, AlphaMode::Mask { cutoff: 0.25 }));
    assert_eq!((m.base_color, m.metallic, m.roughness), (Vec4::new(0.1, 0.2, 0.3, 0.4), 0.5, 0.25));
    assert_eq!(m.emissive, Vec3::new(1.0, 0.5, 0.0));
    assert_eq!(scene.textures.len(), 3);
    let texture = &scene.textures[m.base_color_texture.unwrap().texture];
    assert_eq!((texture.name.as_str(), texture.width, texture.height), ("image 2", 3, 2));
    assert_eq!(texture.texels.as_bytes()[..4], [2, 2, 3, 4]);
    assert_eq!(m.metallic_roughness_texture.unwrap().texcoord, 1);
    assert_eq!(m.occlusion_texture.unwrap().texture, m.metallic_roughness_texture.unwrap().texture);
}

/// The older extension is the newer ones with an index of refraction of 0: one material.
#[test]
fn specular_and_glossiness() {
    let older = |factor: f32| {
        with_material(json!({ "pbrMetallicRoughness": { "metallicFactor": 1, "baseColorTexture": { "index": 1 } },
            "extensions": { "KHR_materials_pbrSpecularGlossiness": {
                "diffuseFactor": [0.1, 0.2, 0.3, 0.4], "diffuseTexture": { "index": 2 }, "specularFactor": [0.5, 0.6, 0.7],
                "glossinessFactor": factor, "specularGlossinessTexture": { "index": 0, "texCoord": 1 },
            } } }))
        .load()
    };
    let newer = with_material(json!({
        "pbrMetallicRoughness": { "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "baseColorTexture": { "index": 2 }, "metallicFactor": 0 },
        "extensions": { "KHR_materials_ior": { "ior": 0 }, "KHR_materials_specular": {
            "specularColorFactor": [0.5, 0.6, 0.7], "specularColorTexture": { "index": 0, "texCoord": 1 },
        } } }))
    .load();
    let scene = older(1.0);
    let (a, b) = (material(&scene), material(&newer));
    assert_eq!((a.base_color, a.metallic, a.roughness, a.ior), (b.base_color, b.metallic, b.roughness, b.ior));
    assert_eq!((a.specular.factor, a.specular.color), (b.specular.factor, b.specular.color));
    let image = |scene: &Scene, slot: Option<TextureSlot>| {
        let slot = slot.unwrap();
        (scene.textures[slot.texture].name.clone(), slot.texcoord)
    };
    assert_eq!(image(&scene, a.base_color_texture), image(&newer, b.base_color_texture));
    assert_eq!(image(&scene, a.specular.color_texture), image(&newer, b.specular.color_texture));

    // alpha 4 of 255 is glossiness
    let roughness = |scene: &Scene| {
        let slot = material(scene).metallic_roughness_texture.unwrap();
        assert_eq!(slot.texcoord, 1);
        scene.textures[slot.texture].texels.get(0)[1]
    };
    assert_eq!(roughness(&scene), 251.0 / 255.0);
    assert!((roughness(&older(0.5)) - (1.0 - 2.0 / 255.0)).abs() < 1e-5);

    // without a texture, and without anything
    let plain = |glossiness: Value| {
        let scene =
            with_material(json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": glossiness } })).load();
        (
            material(&scene).roughness,
            material(&scene).specular.color,
            material(&scene).metallic_roughness_texture.is_some(),
        )
    };
    assert_eq!(plain(json!({ "glossinessFactor": 0.75 })), (0.25, Vec3::ONE, false));
    assert_eq!(plain(json!({})), (0.0, Vec3::ONE, false));
}

#[test]
fn defaults_and_alpha_modes() {
    let scene = with_material(json!({})).load();
    let m = material(&scene);
    assert_eq!((m.base_color, m.metallic, m.roughness, m.ior), (Vec4::ONE, 1.0, 1.0, 1.5));
    assert_eq!((m.alpha_mode, m.double_sided, m.unlit), (AlphaMode::Opaque, false, false));
    // images that nothing uses are not decoded
    assert!(scene.textures.is_empty());
    let scene = with_material(json!({ "alphaMode": "MASK" })).load();
    assert_eq!(material(&scene).alpha_mode, AlphaMode::Mask { cutoff: 0.5 });
    let scene = with_material(json!({ "alphaMode": "BLEND" })).load();
    assert_eq!(material(&scene).alpha_mode, AlphaMode::Blend);
}

#[test]
fn extensions() {
    let doc = with_material(json!({ "emissiveFactor": [1, 1, 0], "extensions": {
        "KHR_materials_clearcoat": {
            "clearcoatFactor": 0.5, "clearcoatTexture": { "index": 0 }, "clearcoatRoughnessFactor": 0.25,
            "clearcoatRoughnessTexture": { "index": 1 }, "clearcoatNormalTexture": { "index": 2 },
        },
        "KHR_materials_sheen": {
            "sheenColorFactor": [0.1, 0.2, 0.3], "sheenColorTexture": { "index": 0 }, "sheenRoughnessFactor": 0.7,
            "sheenRoughnessTexture": { "index": 1 },
        },
        "KHR_materials_transmission": { "transmissionFactor": 0.9, "transmissionTexture": { "index": 0 } },
        "KHR_materials_volume": {
            "thicknessFactor": 2, "thicknessTexture": { "index": 1 }, "attenuationDistance": 3,
            "attenuationColor": [0.5, 1, 1],
        },
        "KHR_materials_ior": { "ior": 1.33 },
        "KHR_materials_specular": {
            "specularFactor": 0.4, "specularTexture": { "index": 0 }, "specularColorFactor": [1, 0, 0],
            "specularColorTexture": { "index": 1 },
        },
        "KHR_materials_anisotropy": {
            "anisotropyStrength": 0.6, "anisotropyRotation": 0.3, "anisotropyTexture": { "index": 2 },
        },
        "KHR_materials_emissive_strength": { "emissiveStrength": 8 },
        "KHR_materials_unlit": {},
    } }));
    let scene = doc.load();
    let m = material(&scene);
    assert_eq!((m.clearcoat.factor, m.clearcoat.roughness), (0.5, 0.25));
    assert_eq!((m.sheen.color, m.sheen.roughness), (Vec3::new(0.1, 0.2, 0.3), 0.7));
    assert_eq!((m.transmission.factor, m.transmission.thickness), (0.9, 2.0));
    assert_eq!(
        (m.transmission.attenuation_distance, m.transmission.attenuation_color),
        (3.0, Vec3::new(0.5, 1.0, 1.0))
    );
    assert_eq!((m.ior, m.specular.factor, m.specular.color), (1.33, 0.4, Vec3::X));
    assert_eq!((m.anisotropy.strength, m.anisotropy.rotation), (0.6, 0.3));
    assert_eq!((m.emissive, m.unlit), (Vec3::new(8.0, 8.0, 0.0), true));
    assert_eq!(m.textures().count(), 10);
    let uses = |t: usize| m.textures().filter(|s| s.texture == t).count();
    assert_eq!([uses(0), uses(1), uses(2)], [4, 4, 2]);
    // a coat's normal map needs tangents
    assert_eq!(scene.report.tangents_computed, 1);
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
}

#[test]
fn extensions_have_defaults() {
    let scene = with_material(json!({ "extensions": {
        "KHR_materials_specular": {}, "KHR_materials_volume": {}, "KHR_materials_ior": {}, "KHR_materials_clearcoat": {},
    } }))
    .load();
    let m = material(&scene);
    assert_eq!((m.specular.factor, m.specular.color, m.ior, m.clearcoat.factor), (1.0, Vec3::ONE, 1.5, 0.0));
    assert_eq!((m.transmission.attenuation_color, m.transmission.attenuation_distance), (Vec3::ONE, f32::INFINITY));
}

/// Two triangles, of which the first has other materials in variants.
fn with_variants() -> Doc {
    let mut doc = with_material(json!({ "name": "base" }));
    let normal_map = json!({ "name": "night", "normalTexture": { "index": 1, "texCoord": 1 },
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 2 } } });
    doc.push("materials", normal_map);
    doc.push("materials", json!({ "name": "winter", "emissiveFactor": [1, 2, 3] }));
    let (primitive, base) = (doc.first().clone(), doc.first().clone());
    doc.json["meshes"][0]["primitives"] = json!([primitive, base]);
    doc.first()["extensions"]["KHR_materials_variants"] =
        json!({ "mappings": [{ "material": 1, "variants": [0, 2] }, { "material": 2, "variants": [1] }] });
    let names = json!([{ "name": "at night" }, { "name": "in winter" }, { "name": "0" }]);
    doc.json["extensions"]["KHR_materials_variants"]["variants"] = names;
    doc.json["extensionsUsed"] = json!(["KHR_materials_variants"]);
    doc.json["extensionsRequired"] = json!(["KHR_materials_variants"]);
    doc
}

#[test]
fn variants() {
    let mut scene = with_variants().load();
    assert_eq!(scene.variants, ["at night", "in winter", "0"]);
    assert!(!scene.report.extensions[0].ignored);
    let shown = |scene: &Scene| {
        scene.instances.iter().map(|i| scene.materials[scene.meshes[i.mesh].material].name.clone()).collect::<Vec<_>>()
    };
    let apply = |scene: &mut Scene, variant: Option<&str>| {
        SceneSettings { variant: variant.map(str::to_owned), ..Default::default() }.apply(scene)
    };
    assert_eq!(shown(&scene), ["base", "base"]);

    // one after another, by name, then by number; a name prevails
    for (variant, name, changes) in [
        (Some("in winter"), "winter", true),
        (Some("1"), "winter", false),
        (Some("at night"), "night", true),
        (Some("0"), "night", false),
        (None, "base", true),
        (None, "base", false),
    ] {
        assert_eq!(apply(&mut scene, variant).unwrap(), changes, "{variant:?}");
        assert_eq!(shown(&scene), [name, "base"], "{variant:?}");
    }

    // what a variant needs of a mesh is there: tangents, and no set of coordinates is missing
    let Geometry::Triangles(triangles) = &scene.meshes[scene.instances[0].mesh].geometry else { panic!() };
    assert_eq!(triangles.tangents.len(), triangles.positions.len());
    let Geometry::Triangles(triangles) = &scene.meshes[scene.instances[1].mesh].geometry else { panic!() };
    assert!(triangles.tangents.is_empty());

    // what there is not
    apply(&mut scene, Some("in winter")).unwrap();
    let error = apply(&mut scene, Some("in spring")).unwrap_err().to_string();
    assert!(error.contains("in spring") && error.contains("at night, in winter, 0"), "{error}");
    assert_eq!(shown(&scene), ["winter", "base"]);
    let mut plain = with_material(json!({})).load();
    assert!(apply(&mut plain, Some("0")).unwrap_err().to_string().contains("no variants"));
}

/// Values of materials and objects that are left out are settings: by name or number, whatever was applied before.
#[test]
fn materials_and_objects_are_edited() {
    use skylit::scene::{builtin, material_edit};

    let mut scene = builtin::by_name("cornell-box").unwrap();
    let before = scene.clone();
    let name = |k: usize| before.materials[k].name.clone();
    let edited = |material: &[&str], hide: &[&str], only: &[&str]| SceneSettings {
        material: material.iter().map(|text| material_edit::parse(text).unwrap()).collect(),
        hide: hide.iter().map(|text| (*text).to_owned()).collect(),
        only: only.iter().map(|text| (*text).to_owned()).collect(),
        ..SceneSettings::default()
    };
    let by_name = format!("{} roughness=0.25", name(0));
    let settings = edited(&[&by_name, "0 base_color=1,0,0.5", "1 metallic=1"], &["0"], &[]);
    assert!(settings.apply(&mut scene).unwrap(), "it has changed");
    assert_eq!((scene.materials[0].roughness, scene.materials[1].metallic), (0.25, 1.0));
    assert_eq!(scene.materials[0].base_color.truncate(), glam::Vec3::new(1.0, 0.0, 0.5));
    assert!(scene.hidden.contains(&0) && !settings.apply(&mut scene).unwrap(), "once is enough");

    // one alone; the materials are the file's again
    assert!(edited(&[], &[], &["1"]).apply(&mut scene).unwrap());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("one.glb");
    skylit::scene::export::export_gltf(&scene, &path).unwrap();
    let written = skylit::scene::load::load(&path.to_string_lossy()).unwrap();
    assert_eq!(written.instances.len(), 1, "what is left out is not written");
    assert_eq!(written.instances[0].name, before.instances[1].name);
    assert_eq!(scene.materials, before.materials);
    assert_eq!(scene.shown_instances().count(), 1);
    for (settings, parts) in [
        (edited(&["Velvet roughness=1"], &[], &[]), ["--material Velvet", "no such material"]),
        (edited(&[], &["lamp 7"], &[]), ["--hide lamp 7", "no such object"]),
        (edited(&[], &[], &["99"]), ["--only 99", "no such object"]),
    ] {
        let error = settings.apply(&mut scene).unwrap_err().to_string();
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        assert_eq!(scene.shown_instances().count(), 1, "nothing is changed then");
    }
    assert!(SceneSettings::default().apply(&mut scene).unwrap());
    assert_eq!((scene.materials, scene.hidden), (before.materials, before.hidden));
}

#[test]
fn variants_that_do_not_exist() {
    for (mapping, expected) in [
        (json!({ "material": 3, "variants": [0] }), "material 3"),
        (json!({ "material": 1, "variants": [3] }), "variant 3"),
        (json!({ "material": 1 }), "KHR_materials_variants"),
    ] {
        let mut doc = with_variants();
        doc.first()["extensions"]["KHR_materials_variants"]["mappings"] = json!([mapping]);
        let error = doc.error();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn texture_transform() {
    let slot = |transform: Value| {
        let doc = with_material(json!({ "pbrMetallicRoughness": { "baseColorTexture": {
            "index": 0, "extensions": { "KHR_texture_transform": transform } } } }));
        material(&doc.load()).base_color_texture.unwrap()
    };
    // the specification's example: the lower left quadrant of the image, turned
    let s = slot(json!({ "offset": [0, 1], "rotation": std::f32::consts::FRAC_PI_2, "scale": [0.5, 0.5] }));
    let at = |u: f32, v: f32| s.transform.transform_point2(Vec2::new(u, v));
    assert!(at(0.0, 0.0).abs_diff_eq(Vec2::new(0.0, 1.0), 1e-6));
    assert!(at(1.0, 0.0).abs_diff_eq(Vec2::new(0.0, 0.5), 1e-6), "{}", at(1.0, 0.0));
    assert!(at(0.0, 1.0).abs_diff_eq(Vec2::new(0.5, 1.0), 1e-6), "{}", at(0.0, 1.0));
    let s = slot(json!({ "scale": [2, 3], "texCoord": 1 }));
    assert_eq!(s.transform.transform_point2(Vec2::ONE), Vec2::new(2.0, 3.0));
    assert_eq!(s.texcoord, 1);
    // the same on every kind of texture
    let transform =
        json!({ "index": 0, "extensions": { "KHR_texture_transform": { "scale": [2, 3], "texCoord": 1 } } });
    let doc = with_material(json!({
        "normalTexture": transform, "occlusionTexture": transform, "emissiveTexture": transform,
        "extensions": { "KHR_materials_clearcoat": { "clearcoatTexture": transform, "clearcoatNormalTexture": transform } },
    }));
    assert_eq!(material(&doc.load()).textures().filter(|t| *t == s).count(), 5);
}

/// A primitive keeps the sets that its material uses, whatever their numbers, and however many.
#[test]
fn sets_of_texture_coordinates() {
    let load = |material: Value| {
        let mut doc = with_material(material);
        for set in 2..6u8 {
            let texcoord = doc.accessor(&bytes(&[[f32::from(set); 2]; 3]), F32, "VEC2", 3);
            doc.first()["attributes"][format!("TEXCOORD_{set}")] = json!(texcoord);
        }
        doc.load()
    };
    let of_mesh = |scene: &Scene| scene.materials[scene.meshes[0].material].clone();
    let slot = |set: u32| json!({ "index": 0, "texCoord": set });

    // one above the first two, alone and beside another
    let scene = load(json!({ "emissiveTexture": slot(3) }));
    assert_eq!(of_mesh(&scene).emissive_texture.unwrap().texcoord, 0);
    assert_eq!(mesh(&scene, 0).texcoords[0], [Vec2::splat(3.0); 3]);
    let scene = load(json!({ "emissiveTexture": slot(4), "occlusionTexture": slot(1) }));
    let material = of_mesh(&scene);
    assert_eq!([material.occlusion_texture, material.emissive_texture].map(|s| s.unwrap().texcoord), [0, 1]);
    assert_eq!(mesh(&scene, 0).texcoords[1], [Vec2::splat(4.0); 3]);
    assert_eq!(mesh(&scene, 0).texcoords[0], TRIANGLE.map(|p| Vec2::new(p[0], p[1])));
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);

    // a third one, and a fourth, which the file does not have
    let scene = load(json!({
        "emissiveTexture": slot(2), "occlusionTexture": slot(3), "normalTexture": slot(5),
        "pbrMetallicRoughness": { "baseColorTexture": slot(4_000_000_000) },
    }));
    let material = of_mesh(&scene);
    let slots =
        [material.emissive_texture, material.occlusion_texture, material.normal_texture, material.base_color_texture];
    assert_eq!(slots.map(|s| s.unwrap().texcoord), [0, 1, 2, 3]);
    let mesh = mesh(&scene, 0);
    let sets: Vec<Vec2> = (0..mesh.texcoord_sets()).map(|set| mesh.texcoord_set(set)[0]).collect();
    assert_eq!(sets, [2.0, 3.0, 5.0, 0.0].map(Vec2::splat));
    let warnings = &scene.report.warnings;
    assert!(warnings.len() == 1 && warnings[0].contains("has no texture coordinates 3"), "{warnings:?}");

    // they are written and read again
    let folder = Folder::new();
    let copy = folder.path("copy.glb");
    skylit::scene::export::export_gltf(&scene, &copy).unwrap();
    let copy = crate::build::load(&copy).unwrap();
    assert_eq!(of_mesh(&copy).normal_texture.unwrap().texcoord, 2);
    assert_eq!(self::mesh(&copy, 0).more_texcoords, mesh.more_texcoords);
}

#[test]
fn missing_texture_coordinates_are_zero() {
    let mut doc = with_material(json!({ "emissiveTexture": { "index": 0, "texCoord": 1 } }));
    doc.first()["attributes"].as_object_mut().unwrap().remove("TEXCOORD_1");
    let scene = doc.load();
    assert_eq!(mesh(&scene, 0).texcoords[1], [Vec2::ZERO; 3]);
    assert_eq!(scene.report.warnings.len(), 1);
}

#[test]
fn samplers() {
    let mut doc = with_material(json!({ "emissiveTexture": { "index": 0 }, "occlusionTexture": { "index": 1 } }));
    doc.json["samplers"] = json!([{ "magFilter": 9728, "minFilter": 9987, "wrapS": 33071, "wrapT": 33648 }]);
    doc.json["textures"][0]["sampler"] = json!(0);
    doc.json["textures"][1]["source"] = json!(0);
    let scene = doc.load();
    let [a, b] = &scene.textures[..] else { panic!() };
    assert_eq!((a.wrap, a.filter), ([Wrap::Clamp, Wrap::Mirror], Filter::Nearest));
    assert_eq!((b.wrap, b.filter), ([Wrap::Repeat; 2], Filter::Linear));
    // one image, decoded once
    assert!(a.texels.is_shared_with(&b.texels));
}

/// Images keep the bits that they have: 16 a channel, and floats, which may be above 1. Eight bits that were widened to 16 need no more than eight.
#[test]
fn images_keep_their_bits() {
    let mut hdr = std::io::Cursor::new(Vec::new());
    image::Rgb32FImage::from_pixel(4, 4, image::Rgb([0.25, 8.0, 0.0]))
        .write_to(&mut hdr, image::ImageFormat::Hdr)
        .unwrap();
    let mut grey = std::io::Cursor::new(Vec::new());
    image::ImageBuffer::<image::Luma<u16>, _>::from_pixel(1, 1, image::Luma([600u16]))
        .write_to(&mut grey, image::ImageFormat::Png)
        .unwrap();
    let texels: [(&[u8], TexelData); 4] = [
        (&png16([600, 2, 3, 65000]), vec![600u16, 2, 3, 65000].into()),
        (&png16([257 * 9, 0, 257, 65535]), vec![9u8, 0, 1, 255].into()),
        (grey.get_ref(), vec![600u16, 600, 600, 65535].into()),
        (hdr.get_ref(), vec![0.25f32, 8.0, 0.0, 1.0].into()),
    ];
    for (file, expected) in texels {
        let folder = Folder::new();
        folder.write("image", file);
        let mut doc = with_material(json!({ "emissiveTexture": { "index": 0 } }));
        doc.json["images"][0] = json!({ "uri": "image" });
        let scene = folder.load("scene.gltf", doc.gltf()).unwrap();
        assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
        let found = &scene.textures[0].texels;
        assert_eq!((std::mem::discriminant(found), found.get(0)), (std::mem::discriminant(&expected), expected.get(0)));
    }
}

#[test]
fn images_from_everywhere() {
    let mut jpeg = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_pixel(8, 8, image::Rgb([200, 100, 50]))
        .write_to(&mut jpeg, image::ImageFormat::Jpeg)
        .unwrap();
    let folder = Folder::new();
    folder.write("sub dir/a b.png", png(4, 4, [9, 8, 7, 6]));
    let mut doc = with_material(json!({
        "emissiveTexture": { "index": 0 }, "occlusionTexture": { "index": 1 },
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 2 } },
    }));
    doc.json["images"][0] = json!({ "uri": format!("data:image/jpeg;base64,{}", base64(jpeg.get_ref())) });
    doc.json["images"][1] = json!({ "uri": "sub%20dir/a%20b.png" });
    let scene = folder.load("scene.gltf", doc.gltf()).unwrap();
    let m = material(&scene);
    let texture = |slot: &Option<skylit::scene::TextureSlot>| &scene.textures[slot.unwrap().texture];
    let jpeg = texture(&m.emissive_texture);
    let rgba8 = jpeg.texels.as_bytes();
    assert!(rgba8[0].abs_diff(200) < 4 && rgba8[1].abs_diff(100) < 4 && rgba8[3] == 255);
    assert_eq!(texture(&m.occlusion_texture).texels.as_bytes()[..4], [9, 8, 7, 6]);
    assert_eq!(texture(&m.base_color_texture).width, 3);
}

#[test]
fn missing_and_broken_images_are_left_out() {
    let mut doc = with_material(json!({
        "emissiveTexture": { "index": 0 }, "occlusionTexture": { "index": 1 }, "normalTexture": { "index": 7 },
        "pbrMetallicRoughness": { "baseColorTexture": { "index": 2 } },
    }));
    doc.json["images"][0] = json!({ "uri": "gone.png" });
    doc.json["images"][1] = json!({ "uri": "data:image/png;base64,AAAA" });
    let scene = doc.load();
    let m = material(&scene);
    assert!(m.emissive_texture.is_none() && m.occlusion_texture.is_none() && m.normal_texture.is_none());
    assert_eq!(m.base_color_texture.unwrap().texture, 0);
    assert_eq!(scene.report.warnings.len(), 3, "{:?}", scene.report.warnings);
    assert!(scene.report.warnings[0].contains("gone.png"), "{:?}", scene.report.warnings);
}

/// Numbers that no material has, in every format: light is not negative, nothing reflects more than there is, and all is finite.
#[test]
fn numbers_out_of_range() {
    let is_possible = |scene: &Scene, from: &str| {
        for m in &scene.materials {
            let shares = [
                m.base_color.truncate(),
                m.sheen.color,
                m.transmittance,
                m.transmission.attenuation_color,
                m.specular_color,
            ];
            assert!(shares.iter().all(|c| c.min_element() >= 0.0 && c.max_element() <= 1.0), "{from}: {m:?}");
            assert!(
                [m.emissive, m.specular.color].iter().all(|c| c.min_element() >= 0.0 && c.is_finite()),
                "{from}: {m:?}"
            );
            let shares = [
                m.metallic,
                m.roughness,
                m.clearcoat.factor,
                m.clearcoat.roughness,
                m.sheen.roughness,
                m.specular.factor,
            ];
            assert!(shares.iter().chain([&m.anisotropy.strength]).all(|v| (0.0..=1.0).contains(v)), "{from}: {m:?}");
            assert!(
                m.normal_scale.is_finite() && m.ior.is_finite() && m.anisotropy.rotation.is_finite(),
                "{from}: {m:?}"
            );
        }
        assert!(scene.lights.iter().all(|l| l.intensity.min_element() >= 0.0), "{from}");
        assert!(
            scene.report.warnings.iter().any(|w| w.contains("instead") || w.contains("ignored")),
            "{from}: {:?}",
            scene.report.warnings
        );
    };
    for value in [-1.0, -1e308, 1e308, 1e25, -1e-2] {
        let colour = [value; 3];
        let mut doc = with_material(json!({
            "emissiveFactor": colour,
            "pbrMetallicRoughness": { "baseColorFactor": [value, value, value, value], "metallicFactor": value, "roughnessFactor": value },
            "normalTexture": { "index": 0, "scale": value },
            "extensions": {
                "KHR_materials_specular": { "specularColorFactor": colour, "specularFactor": value },
                "KHR_materials_sheen": { "sheenColorFactor": colour, "sheenRoughnessFactor": value },
                "KHR_materials_clearcoat": { "clearcoatFactor": value, "clearcoatRoughnessFactor": value },
                "KHR_materials_anisotropy": { "anisotropyStrength": value, "anisotropyRotation": value },
                "KHR_materials_volume": { "attenuationColor": colour, "thicknessFactor": value, "attenuationDistance": value },
                "KHR_materials_ior": { "ior": value },
                "KHR_materials_emissive_strength": { "emissiveStrength": value },
            },
        }));
        let color = doc.accessor(&bytes(&[[value as f32; 4]; 3]), F32, "VEC4", 3);
        doc.first()["attributes"]["COLOR_0"] = json!(color);
        let scene = doc.load();
        is_possible(&scene, &format!("glTF, {value}"));
        let colors = &mesh(&scene, 0).colors;
        assert!(colors.iter().all(|c| c.min_element() >= 0.0 && c.max_element() <= 1.0), "{value}: {colors:?}");

        let folder = Folder::new();
        let numbers = format!("{value} {value} {value}");
        let library = format!(
            "newmtl m\nKd {numbers}\nKs {numbers}\nKe {numbers}\nTf {numbers}\nNi 1.5\nillum 7\nPr {value}\nPm {value}\nd {value}\n"
        );
        folder.write("m.mtl", library);
        let scene = folder.load("m.obj", "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n").unwrap();
        is_possible(&scene, &format!("MTL, {value}"));

        let sphere = "Sphere center[0 0 0] radius[1] material[matte]";
        let scene = folder.load("s.brhan", format!("{sphere} diffuse[{numbers}]\n")).unwrap();
        is_possible(&scene, &format!(".brhan, {value}"));
    }
}

#[test]
fn what_volumes_and_signs_do_with_light() {
    let scene = with_material(json!({ "extensions": {
        "KHR_materials_volume": { "thicknessFactor": 1, "attenuationColor": [0.5, 0.5, 0.5], "attenuationDistance": 0.1 },
        "KHR_materials_diffuse_transmission": { "diffuseTransmissionFactor": 1 },
        "KHR_materials_volume_scatter": { "multiscatterColor": [0.8, 0.5, 0.2], "scatterAnisotropy": 0.3 },
        "KHR_materials_dispersion": { "dispersion": 0.36 },
        "KHR_materials_retroreflection": { "retroreflectionFactor": 0.7, "retroreflectionTexture": { "index": 1 } },
    } }))
    .load();
    let m = material(&scene);
    assert_eq!((m.dispersion, m.retroreflection.factor), (0.36, 0.7));
    assert!(m.retroreflection.texture.is_some());
    assert_eq!((m.volume_scatter.color, m.volume_scatter.anisotropy), (Vec3::new(0.8, 0.5, 0.2), 0.3));
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);

    // beyond their ranges, and none at all
    let scene = with_material(json!({ "extensions": {
        "KHR_materials_volume_scatter": { "multiscatterColor": [2, 0, 0], "scatterAnisotropy": -3 },
        "KHR_materials_retroreflection": {},
        "KHR_materials_dispersion": { "dispersion": -1 },
    } }))
    .load();
    let m = material(&scene);
    assert_eq!((m.volume_scatter.color, m.volume_scatter.anisotropy), (Vec3::X, -1.0));
    assert_eq!((m.dispersion, m.retroreflection.factor), (0.0, 0.0));
    assert_eq!(scene.report.warnings.len(), 3, "{:?}", scene.report.warnings);
}
