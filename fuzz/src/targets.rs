//! What fuzzers feed: a function for each format that others can give us. Each takes the bytes of a file and has it read as the program reads it: an error of one line or a
//! result, never a panic. `fuzz_targets` hands them to libFuzzer, and `tests/loaders/fuzz.rs` runs the same functions over the same seeds with a mutator of its own.

use std::path::{Path, PathBuf};

use skylit::renderer::RenderSettings;
use skylit::renderer::film_file;
use skylit::scene::Scene;
use skylit::scene::animation::{Playback, Pose};
use skylit::scene::load::{load_camera_path, load_environment, load_file};
use skylit::{Result, output};

/// A target: reads these bytes in a folder of its own, and returns whether they were accepted.
pub type Target = fn(&Path, &[u8]) -> bool;

/// All targets by name.
pub const TARGETS: &[(&str, Target)] = &[
    ("gltf", gltf),
    ("glb", glb),
    ("draco", draco),
    ("meshopt", meshopt),
    ("ktx2", ktx2),
    ("dds", dds),
    ("obj", obj),
    ("mtl", mtl),
    ("brhan", brhan),
    ("hdr", hdr),
    ("exr", exr),
    ("png", png),
    ("camera_path", camera_path),
    #[cfg(feature = "verify")]
    ("manifest", manifest),
    ("film", film),
    ("hierarchy", hierarchy),
    ("mesh_bin", mesh_bin),
    ("settings", settings),
];

/// A file of this name with these bytes.
fn write(folder: &Path, name: &str, data: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, data).unwrap();
    path
}

/// Whether it was accepted; what is refused is refused in one line.
fn accepted<T>(result: Result<T>, check: impl FnOnce(T)) -> bool {
    match result {
        Ok(value) => {
            check(value);
            true
        }
        Err(e) => {
            assert!(!e.to_string().contains('\n'), "{e}");
            false
        }
    }
}

/// Whatever was loaded has finite bounds, and can be played.
fn play(scene: Scene) {
    assert!(scene.bounds().is_some_and(|(low, high)| low.is_finite() && high.is_finite()));
    let Some(rig) = &scene.rig else { return };
    let mut pose = Pose::default();
    for animation in 0..rig.animations().len().min(3) {
        let motion = rig.motion(animation).unwrap();
        for seconds in [0.0, 0.4, 1e9] {
            rig.pose(animation, seconds, Playback::Once, &mut pose).unwrap();
            assert_eq!((pose.instances.len(), pose.meshes.len()), (motion.instances.len(), motion.meshes.len()));
        }
    }
}

fn scene(folder: &Path, name: &str, data: &[u8]) -> bool {
    accepted(load_file(&write(folder, name, data)), play)
}

/// A glTF file as text, with its buffers and images in it.
pub fn gltf(folder: &Path, data: &[u8]) -> bool {
    scene(folder, "a.gltf", data)
}

/// A binary glTF file.
pub fn glb(folder: &Path, data: &[u8]) -> bool {
    scene(folder, "a.glb", data)
}

/// Positions of a triangle.
const TRIANGLE: &str = "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";

/// A stream of Draco, the mesh of a glTF file.
pub fn draco(folder: &Path, data: &[u8]) -> bool {
    write(folder, "a.bin", data);
    let document = format!(
        r#"{{ "asset": {{ "version": "2.0" }}, "scenes": [{{ "nodes": [0] }}], "nodes": [{{ "mesh": 0 }}],
            "extensionsUsed": ["KHR_draco_mesh_compression"], "extensionsRequired": ["KHR_draco_mesh_compression"],
            "meshes": [{{ "primitives": [{{ "attributes": {{ "POSITION": 0, "TEXCOORD_0": 1 }}, "indices": 2,
                "extensions": {{ "KHR_draco_mesh_compression":
                    {{ "bufferView": 0, "attributes": {{ "POSITION": 0, "TEXCOORD_0": 1 }} }} }} }}] }}],
            "accessors": [{{ "componentType": 5126, "type": "VEC3", "count": 4 }},
                {{ "componentType": 5126, "type": "VEC2", "count": 4 }}, {{ "componentType": 5125, "type": "SCALAR", "count": 6 }}],
            "bufferViews": [{{ "buffer": 0, "byteLength": {0} }}], "buffers": [{{ "uri": "a.bin", "byteLength": {0} }}] }}"#,
        data.len()
    );
    scene(folder, "a.gltf", document.as_bytes())
}

/// A view that meshoptimizer compressed: a byte for the mode and the filter, one for the size of an element, two for their
/// number, then what is compressed.
pub fn meshopt(folder: &Path, data: &[u8]) -> bool {
    let &[kind, stride, low, high, ref compressed @ ..] = data else { return false };
    write(folder, "a.bin", compressed);
    let mode = ["ATTRIBUTES", "TRIANGLES", "INDICES"][usize::from(kind) % 3];
    let filter = ["NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"][usize::from(kind) / 3 % 5];
    let document = format!(
        r#"{{ "asset": {{ "version": "2.0" }}, "scenes": [{{ "nodes": [0] }}], "nodes": [{{ "mesh": 0 }}],
            "extensionsUsed": ["KHR_meshopt_compression"], "extensionsRequired": ["KHR_meshopt_compression"],
            "meshes": [{{ "primitives": [{{ "attributes": {{ "POSITION": 0 }} }}] }}],
            "accessors": [{{ "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3 }}],
            "bufferViews": [{{ "buffer": 1, "byteLength": 36 }},
                {{ "buffer": 2, "byteLength": 1, "extensions": {{ "KHR_meshopt_compression": {{ "buffer": 0,
                "byteLength": {0}, "byteStride": {stride}, "count": {count}, "mode": "{mode}", "filter": "{filter}" }} }} }}],
            "buffers": [{{ "uri": "a.bin", "byteLength": {0} }}, {{ "uri": "{TRIANGLE}", "byteLength": 36 }}, {{ "byteLength": 1 }}] }}"#,
        compressed.len(),
        count = u16::from_le_bytes([low, high]),
    );
    scene(folder, "a.gltf", document.as_bytes())
}

/// A KTX2 image, as a texture that is left out if it is broken.
pub fn ktx2(folder: &Path, data: &[u8]) -> bool {
    image(folder, "KHR_texture_basisu", data)
}

/// A DDS image, likewise.
pub fn dds(folder: &Path, data: &[u8]) -> bool {
    image(folder, "MSFT_texture_dds", data)
}

/// An image of a texture that has it by an extension.
fn image(folder: &Path, extension: &str, data: &[u8]) -> bool {
    write(folder, "t.image", data);
    let document = r#"{ "asset": { "version": "2.0" }, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "extensionsUsed": ["EXTENSION"], "extensionsRequired": ["EXTENSION"],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "material": 0 }] }],
        "materials": [{ "emissiveTexture": { "index": 0 } }], "images": [{ "uri": "t.image" }],
        "textures": [{ "extensions": { "EXTENSION": { "source": 0 } } }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3 }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "buffers": [{ "uri": "TRIANGLE", "byteLength": 36 }] }"#
        .replace("EXTENSION", extension)
        .replace("TRIANGLE", TRIANGLE);
    match load_file(&write(folder, "a.gltf", document.as_bytes())) {
        Ok(scene) => scene.textures.len() == 1,
        Err(e) => {
            assert!(!e.to_string().contains('\n'), "{e}");
            false
        }
    }
}

/// Wavefront OBJ.
pub fn obj(folder: &Path, data: &[u8]) -> bool {
    scene(folder, "a.obj", data)
}

/// A library of materials, which never hides the model.
pub fn mtl(folder: &Path, data: &[u8]) -> bool {
    write(folder, "a.mtl", data);
    let path = write(
        folder,
        "b.obj",
        b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n",
    );
    let scene = load_file(&path).unwrap();
    assert_eq!(scene.triangle_count(), 1);
    // the texture that seeds name is not there
    scene.report.warnings.iter().all(|w| w.contains("t.png"))
}

/// A scene of the brhan renderer.
pub fn brhan(folder: &Path, data: &[u8]) -> bool {
    scene(folder, "a.brhan", data)
}

/// A Radiance HDR image as environment.
pub fn hdr(folder: &Path, data: &[u8]) -> bool {
    accepted(load_environment(&write(folder, "a.hdr", data)), |map| {
        assert_eq!(map.radiance.len(), map.width as usize * map.height as usize);
        assert!(map.radiance.iter().all(|c| c.is_finite() && c.min_element() >= 0.0));
    })
}

/// An EXR image, as images are compared and as environment.
pub fn exr(folder: &Path, data: &[u8]) -> bool {
    let path = write(folder, "a.exr", data);
    let environment = accepted(load_environment(&path), drop);
    accepted(output::load(&path), whole) | environment
}

/// A PNG image, as images are compared and as texture.
pub fn png(folder: &Path, data: &[u8]) -> bool {
    let path = write(folder, "t.png", data);
    write(folder, "t.mtl", b"newmtl m\nKd 1 1 1\nmap_Kd t.png\nmap_Bump t.png\n");
    let model = b"mtllib t.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n";
    assert_eq!(load_file(&write(folder, "t.obj", model)).unwrap().triangle_count(), 1);
    accepted(output::load(&path), whole)
}

/// All channels have as many values as the image has pixels.
fn whole(image: output::Image) {
    assert!(image.channels.iter().all(|c| c.samples.len() == image.pixel_count()));
}

/// Keys of a camera.
pub fn camera_path(folder: &Path, data: &[u8]) -> bool {
    accepted(load_camera_path(&write(folder, "a.json", data)), |path| {
        let (first, last) = path.range();
        for frame in [first - 1.0, first, first.midpoint(last), last, last + 1e9] {
            let camera = path.camera_at(frame);
            assert!(camera.camera_to_world.is_finite(), "frame {frame}: {camera:?}");
        }
    })
}

/// The frames of `skylit verify`.
#[cfg(feature = "verify")]
pub fn manifest(folder: &Path, data: &[u8]) -> bool {
    write(folder, "frames.toml", data);
    accepted(skylit::verify::manifest::Manifest::load(folder), |manifest| {
        for frame in &manifest.frames {
            let _ = (manifest.golden(frame), manifest.scene(frame), manifest.settings(frame));
        }
    })
}

/// An image with a film's sums, which a render resumes.
pub fn film(folder: &Path, data: &[u8]) -> bool {
    let maker = [("tracer", "compute".to_owned()), ("device", "a device".to_owned())];
    let path = write(folder, "a.exr", data);
    accepted(film_file::resume(&path, "a.glb", &["Y"], [8, 8], u32::MAX, &Vec::new(), &maker), |resumed| {
        assert_eq!(resumed.state.size(), [8, 8]);
        let _ = resumed.state.film();
    })
}

/// The scene whose hierarchies [`hierarchy`] reads.
pub fn hierarchy_scene() -> Scene {
    skylit::scene::builtin::by_name("cornell-box").unwrap()
}

/// A hierarchy as the cache keeps it, behind its checksum: depth and blocks.
pub fn hierarchy(_folder: &Path, data: &[u8]) -> bool {
    skylit::tracer::hierarchy_probes::is_accepted(&hierarchy_scene(), data)
}

/// The triangles of `skylit rays --mesh`.
pub fn mesh_bin(folder: &Path, data: &[u8]) -> bool {
    accepted(skylit::scene::export::read_mesh_bin(&write(folder, "a.bin", data)), play)
}

/// Settings of a render: JSON as the viewer saves them, TOML as people write them, and words in a line.
pub fn settings(folder: &Path, data: &[u8]) -> bool {
    let check = |settings: RenderSettings| {
        let _ = settings.check().map_err(|e| assert!(!e.to_string().contains('\n'), "{e}"));
    };
    let json = accepted(RenderSettings::load(&write(folder, "a.json", data)), check);
    let toml = accepted(RenderSettings::load(&write(folder, "a.toml", data)), check);
    #[cfg(feature = "verify")]
    let words = std::str::from_utf8(data).is_ok_and(|line| {
        let line = line.trim_end();
        !line.contains(char::is_control) && accepted(RenderSettings::from_words(line), check)
    });
    #[cfg(not(feature = "verify"))]
    let words = false;
    json | toml | words
}
