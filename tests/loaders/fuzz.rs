//! Broken files: an error or a scene, never a panic, never absurd memory.

use std::path::{Path, PathBuf};

use serde_json::json;
use skylit::film::state::FilmState;
use skylit::output::exr::ExrOptions;
use skylit::output::settings::ExrCompression as Compression;
use skylit::output::{Channel, Image, Samples};
use skylit::renderer::film_file;

use crate::build::*;

/// What the fuzzers of `fuzz/` run.
#[path = "../../fuzz/src/targets.rs"]
mod targets;

/// A small generator; the cases are the same on every run.
struct Random(u64);

impl Random {
    fn next(&mut self, below: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((self.0 >> 33) as usize) % below.max(1)
    }
}

/// A file with some of everything in it.
fn rich() -> Doc {
    let mut doc = Doc::triangle();
    let normal = doc.accessor(&bytes(&[[0.0, 0.0, 1.0f32]; 3]), F32, "VEC3", 3);
    let texcoord = doc.accessor(&bytes(&TRIANGLE.map(|p| [p[0], p[1]])), F32, "VEC2", 3);
    let color = doc.accessor(&[255; 12], U8, "VEC4", 3);
    let indices = doc.accessor(&[0, 1, 2], U8, "SCALAR", 3);
    let at = doc.view(&[1], None);
    let values = doc.view(&bytes(&[[2.0, 0.0, 0.0f32]]), None);
    doc.json["accessors"][0]["sparse"] = json!({
        "count": 1, "indices": { "bufferView": at, "componentType": U8 }, "values": { "bufferView": values },
    });
    let image = doc.view(&png(4, 4, [1, 2, 3, 4]), None);
    doc.push("images", json!({ "bufferView": image, "mimeType": "image/png" }));
    doc.push("textures", json!({ "source": 0 }));
    doc.push(
        "materials",
        json!({
            "normalTexture": { "index": 0 }, "alphaMode": "MASK",
            "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } },
        }),
    );
    let position = doc.first()["attributes"]["POSITION"].clone();
    *doc.first() = json!({ "attributes": { "POSITION": position, "NORMAL": normal, "TEXCOORD_0": texcoord, "COLOR_0": color },
        "indices": indices, "material": 0 });
    doc.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }));
    let joints = doc.accessor(&[0, 1, 0, 0].repeat(3), U8, "VEC4", 3);
    let weights = doc.accessor(&[128, 127, 0, 0].repeat(3), U8, "VEC4", 3);
    doc.json["accessors"][weights]["normalized"] = json!(true);
    doc.first()["attributes"]["JOINTS_0"] = json!(joints);
    doc.first()["attributes"]["WEIGHTS_0"] = json!(weights);
    doc.first()["targets"] = json!([{ "POSITION": position, "NORMAL": normal }]);
    let bind = doc.accessor(&bytes(&[glam::Mat4::IDENTITY.to_cols_array(); 2]), F32, "MAT4", 2);
    doc.push("skins", json!({ "joints": [1, 2], "inverseBindMatrices": bind }));
    let times = doc.accessor(&bytes(&[[0.0f32], [1.0]]), F32, "SCALAR", 2);
    let moves = doc.accessor(&bytes(&[[0.0f32; 3], [1.0; 3]]), F32, "VEC3", 2);
    let morphs = doc.accessor(&bytes(&[[0.0f32], [0.5], [0.0], [0.0], [1.0], [0.0]]), F32, "SCALAR", 6);
    doc.push(
        "animations",
        json!({ "samplers": [
            { "input": times, "output": moves },
            { "input": times, "output": morphs, "interpolation": "CUBICSPLINE" },
        ], "channels": [
            { "sampler": 0, "target": { "node": 1, "path": "scale" } },
            { "sampler": 1, "target": { "node": 0, "path": "weights" } },
            { "sampler": 0, "target": { "node": 3, "path": "translation" } },
        ] }),
    );
    doc.json["nodes"] = json!([
        { "mesh": 0, "skin": 0, "children": [1], "scale": [1, 2, 3], "weights": [0.5] },
        { "camera": 0, "rotation": [0, 0, 0, 1], "children": [2, 3] },
        { "translation": [0, 1, 0] },
        { "mesh": 0 },
    ]);
    doc
}

/// What matters in text formats.
const TEXT: &[u8] = b"0123456789-eE.[]{},:\"# /\\\n";

fn mutate(original: &[u8], random: &mut Random) -> Vec<u8> {
    let mut data = original.to_vec();
    for _ in 0..1 + random.next(4) {
        if data.is_empty() {
            break;
        }
        let at = random.next(data.len());
        match random.next(6) {
            0 => data.truncate(at),
            1 => drop(data.remove(at)),
            2 => data[at] = TEXT[random.next(TEXT.len())],
            3 => data[at] ^= 1 << random.next(8),
            4 => data[at] = random.next(256) as u8,
            _ => {
                let from = random.next(data.len());
                let piece = data[from..(from + random.next(20)).min(data.len())].to_vec();
                data.splice(at..at, piece);
            }
        }
    }
    data
}

/// Runs a target over mutants of its seeds. Some must be refused, and all in one line.
fn survive(name: &str, cases: usize) {
    let target = targets::TARGETS.iter().find(|(n, _)| *n == name).unwrap().1;
    let folder = tempfile::tempdir().unwrap();
    let seeds = seeds(name);
    for (k, seed) in seeds.iter().enumerate() {
        assert!(target(folder.path(), seed), "seed {k} of {name} is refused");
    }
    // SKYLIT_FUZZ_CASES=N: so many times as many, and others
    let factor: Option<usize> = std::env::var("SKYLIT_FUZZ_CASES").ok().map(|n| n.parse().unwrap());
    let cases = cases * factor.unwrap_or(1);
    let mut random = Random(0x5eed + factor.unwrap_or(0) as u64);
    let (mut good, mut bad) = (0, 0);
    for case in 0..cases {
        match target(folder.path(), &mutate(&seeds[case % seeds.len()], &mut random)) {
            true => good += 1,
            false => bad += 1,
        }
    }
    println!("{name}: {good} read, {bad} refused");
    assert!(bad > 0);
}

/// An image in an EXR file with this compression.
fn exr(channels: Vec<Channel>, [width, height]: [u32; 2], metadata: &[(&str, &str)], options: &ExrOptions) -> Vec<u8> {
    let metadata = metadata.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    let file = tempfile::Builder::new().suffix(".exr").tempfile().unwrap();
    skylit::output::exr::write_with(&Image { width, height, channels, metadata }, file.path(), options).unwrap();
    std::fs::read(file.path()).unwrap()
}

fn ramp(name: &str, count: usize) -> Channel {
    Channel { name: name.into(), samples: Samples::F32((0..count).map(|k| k as f32 / count as f32).collect()) }
}

/// The film of an image of 8x8 pixels with some samples.
fn film() -> Vec<u8> {
    let names = ["Y"];
    let words = skylit::film::state::words(&names);
    let planes: Vec<Vec<u32>> = words.iter().map(|w| vec![if w.float { 1.5f32.to_bits() } else { 0 }; 64]).collect();
    let state = FilmState::from_planes([8, 8], 1, &planes, &[4; 64]).unwrap();
    let mut channels = vec![ramp("Y", 64)];
    channels.extend(film_file::state_channels(&state, &names));
    exr(channels, [8, 8], &[("tracer", "compute"), ("device", "a device")], &ExrOptions::default())
}

fn png_of(colour: png::ColorType, depth: png::BitDepth, bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, 4, 4);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    encoder.add_text_chunk("scene".into(), "a.glb".into()).unwrap();
    encoder.write_header().unwrap().write_image_data(bytes).unwrap();
    out
}

/// Files of each format that are read as they are. `write_seeds` puts them into a folder for fuzzers.
fn seeds(target: &str) -> Vec<Vec<u8>> {
    let texts = |texts: &[&str]| texts.iter().map(|t| t.as_bytes().to_vec()).collect();
    match target {
        "gltf" => vec![rich().gltf(), Doc::triangle().gltf()],
        "glb" => vec![rich().glb(), Doc::triangle().glb()],
        "obj" => texts(&[
            "mtllib a.mtl\no a\nv 0 0 0\nv 1 0 0 1 1 1\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 1\nvn 0 0 1\nusemtl m\n\
            f 1/1/1 2/2/1 3/1/1 4/2/1\nf -1 -2 -3\nf 1//1 2//1 3//1\n",
        ]),
        "mtl" => texts(&[
            "newmtl m\nKd 1 1 1\nKs 0 0 0\nNs 10\nd 0.5\nillum 2\nmap_Kd -s 1 2 -o 1 -clamp on t.png\nmap_d t.png\n",
            "newmtl m\nKd 0.5 0.5 0.5\nKe 1 1 1\nPr 0.5\nPm 1\nNi 1.5\nTf 1 1 1\n",
        ]),
        "brhan" => texts(&["Camera position[0 1 2] view_direction[0 0 -1] vertical_fov[45] width[64] height[64]\n\
            Integrator type[path] spp[4] max_depth[4]\nSphere center[0 0 0] radius[1] material[glass]\n\
            SphericalLight center[0 9 0] radius[1] emittance[1 1 1]\nSaveIntervals[4 8]\nGenDepthImage[true]\n"]),
        "hdr" => {
            let encode = |width: usize, height: usize| {
                let mut out = Vec::new();
                let pixels: Vec<_> = (0..width * height).map(|k| image::Rgb([k as f32, 0.5, 1e-3])).collect();
                image::codecs::hdr::HdrEncoder::new(&mut out).encode(&pixels, width, height).unwrap();
                out
            };
            // runs of equal bytes from 8 pixels on
            vec![encode(16, 8), encode(4, 2)]
        }
        "exr" => {
            let of = |channels: Vec<Channel>, compression, half| {
                exr(channels, [8, 4], &[("scene", "a.glb")], &ExrOptions { compression, half, grey_as_rgb: false })
            };
            let rgb = || ["R", "G", "B"].map(|name| ramp(name, 32)).to_vec();
            [
                Compression::None,
                Compression::Rle,
                Compression::Zips,
                Compression::Zip,
                Compression::Piz,
                Compression::Pxr24,
            ]
            .map(|c| of(rgb(), c, false))
            .into_iter()
            .chain([Compression::B44, Compression::B44a].map(|c| of(rgb(), c, true)))
            .collect()
        }
        "png" => vec![
            png_of(png::ColorType::Rgba, png::BitDepth::Eight, &[90; 64]),
            png_of(png::ColorType::Grayscale, png::BitDepth::Sixteen, &[7; 32]),
            png_of(png::ColorType::Rgb, png::BitDepth::Eight, &[200; 48]),
        ],
        "camera_path" => texts(&[r#"{ "fps": 30, "interpolation": "smooth", "keys": [
            { "frame": 0, "eye": [0, 1.6, 4], "target": [0, 1, 0], "up": [0, 1, 0], "fov_y_degrees": 45 },
            { "frame": 9.5, "eye": [3, 1.6, 2], "target": [0, 1, 0] }, { "frame": 60, "eye": [1, 2, 2], "target": [0, 1, 0] }] }"#]),
        "manifest" => texts(&["[drivers]\npinned = [\"llvmpipe Mesa 25.0\"]\n[defaults]\ntracers = [\"compute\"]\n\
            tolerance = { z_test = { bias = 0.005 } }\n[[frame]]\nname = \"a\"\nscene = \"builtin:stairs\"\n\
            render = \"ao --size 80x60 --spp 128 --ao-radius 2\"\ntracers = [\"all\"]\n"]),
        "film" => vec![film()],
        "hierarchy" => vec![skylit::tracer::hierarchy_probes::hierarchy(&targets::hierarchy_scene())],
        "mesh_bin" => vec![{
            let words =
                [3_u32, 1].into_iter().chain(TRIANGLE.as_flattened().iter().map(|x| x.to_bits())).chain([0, 1, 2]);
            words.flat_map(u32::to_le_bytes).collect()
        }],
        "settings" => texts(&[
            r#"{"image":{"size":[64,48],"spp":16,"seed":7},"integrator":"path","integrators":{"ao":{"ao_radius":0.5}}}"#,
            "[image]\nsize = [64, 48]\nspp = 16\n",
            "path --size 64x48 --spp 16 --max-depth 4 --exposure 1.5",
        ]),
        // `scripts/compressed/make.sh` made the files that these are parts of
        "draco" | "meshopt" | "ktx2" | "dds" => {
            let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds").join(target);
            let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path()).collect();
            files.sort();
            files.iter().map(|file| std::fs::read(file).unwrap()).collect()
        }
        _ => panic!("no seeds for {target}"),
    }
}

/// Every target of the fuzzers, with its seeds: a test each, so that they run side by side.
macro_rules! survives {
    ($($name:ident $cases:literal,)*) => {
        mod mutants {
            $(#[test]
            fn $name() {
                super::survive(stringify!($name), $cases);
            })*
        }

        #[test]
        fn every_target_is_run() {
            let names: Vec<&str> = targets::TARGETS.iter().map(|(name, _)| *name).collect();
            assert_eq!(names, [$(stringify!($name)),*]);
        }
    };
}

survives! {
    gltf 6000,
    glb 6000,
    draco 6000,
    meshopt 6000,
    ktx2 6000,
    dds 6000,
    obj 6000,
    mtl 3000,
    brhan 6000,
    hdr 3000,
    exr 4000,
    png 3000,
    camera_path 6000,
    manifest 3000,
    film 1000,
    hierarchy 3000,
    mesh_bin 3000,
    settings 3000,
}

/// Writes the seeds into folders of the targets' names: `SKYLIT_FUZZ_SEEDS=DIR cargo test --test loaders write_seeds -- --ignored`.
#[test]
#[ignore = "writes files, for fuzzers"]
fn write_seeds() {
    let folder = PathBuf::from(std::env::var_os("SKYLIT_FUZZ_SEEDS").expect("SKYLIT_FUZZ_SEEDS names the folder"));
    for (name, _) in targets::TARGETS {
        std::fs::create_dir_all(folder.join(name)).unwrap();
        for (k, seed) in seeds(name).iter().enumerate() {
            std::fs::write(folder.join(name).join(format!("seed-{k}")), seed).unwrap();
        }
    }
}

#[test]
fn the_seed_with_everything_moves() {
    assert!(rich().try_load().is_ok_and(|s| s.rig.is_some_and(|r| !r.motion(0).unwrap().meshes.is_empty())));
}

#[test]
fn images() {
    let mut jpeg = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_fn(16, 16, |x, y| image::Rgb([x as u8 * 16, y as u8 * 16, 0]))
        .write_to(&mut jpeg, image::ImageFormat::Jpeg)
        .unwrap();
    for (name, data) in [("t.png", png(16, 16, [1, 2, 3, 4])), ("t.jpg", jpeg.into_inner())] {
        let folder = Folder::new();
        let mut doc = Doc::triangle();
        doc.push("images", json!({ "uri": name }));
        doc.push("textures", json!({ "source": 0 }));
        doc.push("materials", json!({ "emissiveTexture": { "index": 0 } }));
        doc.first()["material"] = json!(0);
        folder.write("a.gltf", doc.gltf());
        let mut random = Random(3);
        let mut shown = 0;
        for _ in 0..2000 {
            folder.write(name, mutate(&data, &mut random));
            shown += usize::from(!load(&folder.path("a.gltf")).unwrap().textures.is_empty());
        }
        println!("{name}: {shown} of 2000 shown");
    }
}
