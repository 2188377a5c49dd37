//! `skylit render`: the files that other programs read, what is in their metadata, and images that are sent to tev.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::net::TcpListener;
use std::path::Path;

use skylit::output::{self, Image, Samples};

use crate::common::command::{self, device, json, place, refuses, run, skylit, stderr};

const BASE: [&str; 7] = ["render", "builtin:spheres:30", "--size", "48x32", "--ao-radius", "3", "--validation"];

fn render(args: &[&str]) -> serde_json::Value {
    json(&run(&[&BASE[..], args, &["--json"]].concat()))
}

fn load(path: &str) -> Image {
    output::load(path.as_ref()).unwrap()
}

/// The integers of a PNG and its number of channels.
fn decode(path: &str) -> (Vec<u16>, usize) {
    let mut reader = png::Decoder::new(BufReader::new(File::open(path).unwrap())).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    let values = match info.bit_depth {
        png::BitDepth::Sixteen => bytes.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect(),
        _ => bytes.iter().map(|b| u16::from(*b)).collect(),
    };
    (values, info.color_type.samples())
}

#[test]
fn options_without_effect_are_refused() {
    let render = |extra: &[&'static str]| [&["render", "builtin:plane"], extra].concat();
    for (extra, says) in [
        (&["-o", "a.exr", "--png-bits", "16"][..], "--png-bits has no effect without a .png output"),
        (&["-o", "a.exr", "--png-encoding", "linear"], "--png-encoding has no effect"),
        (&["-o", "a.exr", "--background", "transparent"], "--background has no effect without a .png, .webp, .jpg"),
        (&["-o", "a.jpg", "--background", "transparent"], "a.jpg cannot have alpha"),
        (&["-o", "a.png", "--jpeg-quality", "50"], "--jpeg-quality has no effect without a .jpg output"),
        (&["-o", "a.jpg", "--jpeg-quality", "101"], "1..=100"),
        (&["-o", "a.png", "--background", "white"], "R,G,B"),
        (&["-o", "a.png", "--png-bits", "12"], "8, 16"),
        (&["-o", "a.png", "--exr-half"], "--exr-half has no effect without a .exr output"),
        (&["-o", "a.png", "--exr-compression", "zip"], "--exr-compression has no effect"),
        (&["-o", "a.exr", "--exr-compression", "b44"], "add --exr-half"),
        (&["-o", "a.exr", "--exr-compression", "dwaa"], "none, rle, zips, zip, piz, pxr24, b44, b44a"),
        (&["-o", "a.exr", "--exr-compression", "pxr24", "--resumable"], "the film's state needs all bits"),
        (
            &["-o", "a.png", "--preset", "fast", "--show", "depth", "--png-bits", "16"],
            "--show depth is converted to 8-bit sRGB",
        ),
        (&["-o", "a.exr", "--depth-image", "d.jpg"], "--depth-image d.jpg: the name must end in .png or .exr"),
        (&["-o", "a.webp", "--aov", "depth"], "--aov needs an .exr output"),
        (&["-o", "a.exr", "--tev", ":1"], "HOST:PORT"),
    ] {
        refuses(&render(extra), 64, says);
    }
    // nothing listens there
    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let dir = tempfile::tempdir().unwrap();
    let address = format!("127.0.0.1:{free}");
    refuses(&["render", "builtin:plane", "-o", &place(&dir, "a.exr"), "--tev", &address], 64, "no connection");
    assert_eq!(command::count(dir.path()), 0);
}

#[test]
fn gpu_pictures_of_a_still() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| place(&dir, name);
    let (exr, png, webp) = (at("a.exr"), at("a.png"), at("a.webp"));
    let transparent = ["--background", "transparent", "--png-bits", "16", "--png-encoding", "linear"];
    render(&[&["--spp", "8", "-o", &exr, "-o", &png, "-o", &webp][..], &transparent].concat());
    let image = load(&exr);
    let (y, alpha) = (image.f32("Y").unwrap(), image.f32("A").unwrap());
    assert!(alpha.iter().any(|a| *a > 0.0 && *a < 1.0) && alpha.contains(&0.0) && alpha.contains(&1.0));
    let (values, channels) = decode(&png);
    assert_eq!(channels, 2);
    for (p, pixel) in values.chunks_exact(2).enumerate() {
        let straight = if alpha[p] > 0.0 { y[p] / alpha[p] } else { 0.0 };
        assert_eq!(pixel, [(straight * 65535.0).round() as u16, (alpha[p] * 65535.0).round() as u16], "{p}");
    }
    // of 8-bit formats alone the options of .png are not
    assert!(load(&webp).metadata("encoding") == Some("8-bit sRGB") && load(&webp).f32("A").is_some());
    // a colour behind the scene
    let (red, jpg) = (at("red.png"), at("red.jpg"));
    render(&["--spp", "8", "-o", &red, "-o", &jpg, "--background", "1,0,0", "--jpeg-quality", "95"]);
    let picture = load(&red);
    let (r, g) = (picture.f32("R").unwrap(), picture.f32("G").unwrap());
    assert!((0..y.len()).all(|p| (r[p] - (y[p] + 1.0 - alpha[p])).abs() < 0.01 && (g[p] - y[p]).abs() < 0.01));
    assert_eq!(load(&jpg).channels.len(), 3);
    // without a background nothing is as it was not: the scene on black, without alpha
    let plain = at("plain.png");
    render(&["--spp", "8", "-o", &plain]);
    let (values, channels) = decode(&plain);
    let expected: Vec<_> = y.iter().map(|v| u16::from(skylit::colour::srgb_byte(*v))).collect();
    assert_eq!((channels, values), (1, expected));
    // radiance is tone mapped before alpha
    let (exr, png) = (at("p.exr"), at("p.png"));
    let light = ["--integrator", "direct", "--light", "point position=0,20,20 intensity=4000", "--tone-map", "exp"];
    let out = ["-o", &exr, "-o", &png, "--background", "transparent", "--png-bits", "16", "--png-encoding", "linear"];
    json(&run(
        &[&["render", "builtin:spheres:30", "--size", "48x32", "--spp", "4", "--json"][..], &light, &out].concat()
    ));
    let image = load(&exr);
    let (r, alpha) = (image.f32("R").unwrap(), image.f32("A").unwrap());
    let (values, channels) = decode(&png);
    assert_eq!(channels, 4);
    for (p, pixel) in values.chunks_exact(4).enumerate() {
        let mapped = if alpha[p] > 0.0 { 1.0 - (-f64::from(r[p]) / f64::from(alpha[p])).exp() } else { 0.0 };
        assert!((f64::from(pixel[0]) - mapped * 65535.0).abs() < 1.0, "{p}: {pixel:?} {mapped}");
    }
    // an environment lights the scene and is not behind it
    let (exr, blue) = (at("e.exr"), at("blue.png"));
    let sky = ["render", "builtin:spheres:30", "--size", "48x32", "--spp", "4", "--integrator", "direct", "--json"];
    let lit = |more: &[&str]| json(&run(&[&sky[..], &["--environment", "0.5,0.5,0.5"], more].concat()));
    lit(&["-o", &exr, "--backdrop", "hidden"]);
    lit(&["-o", &blue, "--background", "0,0,1"]);
    let (image, picture) = (load(&exr), load(&blue));
    let [r, b, alpha] = ["R", "B", "A"].map(|name| image.f32(name).unwrap());
    let (red, above) = (picture.f32("R").unwrap(), picture.f32("B").unwrap());
    assert!(alpha.contains(&0.0) && alpha.contains(&1.0) && image.metadata("background") == Some("hidden"));
    for p in 0..r.len() {
        assert!((alpha[p] > 0.0 || r[p] == 0.0) && (red[p] - r[p]).abs() < 0.01, "{p}: {} {}", r[p], red[p]);
        assert!((above[p] - (b[p] + 1.0 - alpha[p])).abs() < 0.01, "{p}: {} {}", b[p], above[p]);
    }
    // what shows no environment has none to blur
    let blurred = ["render", "builtin:plane", "--integrator", "ao-sky", "-o", &png, "--background", "blurred"];
    refuses(&blurred, 64, "--integrator ao-sky shows no environment");
    // depths in 16 bits
    let (depth, numbers) = (at("d.png"), at("d.exr"));
    render(&["--spp", "1", "-o", &numbers, "--aov", "depth", "--depth-image", &depth, "--png-bits", "16"]);
    let z = load(&numbers);
    let z = z.f32("depth.Z").unwrap();
    let (near, far) = z.iter().filter(|z| z.is_finite()).fold((f32::MAX, 0f32), |(n, f), z| (n.min(*z), f.max(*z)));
    let grey = |z: f32| if z.is_finite() { ((far - z) / (far - near) * 65535.0).round() as u16 } else { 0 };
    assert_eq!(decode(&depth), (z.iter().map(|z| grey(*z)).collect(), 1));
}

#[test]
fn gpu_pictures_of_frames() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| place(&dir, name);
    let frames = ["--preset", "fast", "--frames", "0..2"];
    let (exr, png, apng, webp) = (at("a.#.exr"), at("a.#.png"), at("a.apng"), at("a.#.webp"));
    render(&[&frames[..], &["-o", &exr, "-o", &png, "-o", &apng, "-o", &webp, "--background", "transparent"]].concat());
    let image = load(&at("a.1.exr"));
    let (y, alpha) = (image.f32("Y").unwrap(), image.f32("A").unwrap());
    let (values, channels) = decode(&at("a.1.png"));
    assert_eq!(channels, 2);
    for (p, pixel) in values.chunks_exact(2).enumerate() {
        // straight alpha: the colour is that of what is covered, which the image has times its coverage
        let opacity = (alpha[p] * 255.0).round() as u16;
        let grey = if opacity > 0 { u16::from(skylit::colour::srgb_byte(y[p] / alpha[p])) } else { 0 };
        // the picture is made of eight bits
        let tolerance = if opacity == 255 { 0 } else { (1.0 + 1.5 / alpha[p].sqrt()) as u16 };
        assert!(pixel[0].abs_diff(grey) <= tolerance && pixel[1] == opacity, "{p}: {pixel:?}, {grey}, {opacity}");
    }
    let mut reader = png::Decoder::new(BufReader::new(File::open(&apng).unwrap())).read_info().unwrap();
    assert_eq!(
        (reader.info().color_type, reader.info().animation_control.unwrap().num_frames),
        (png::ColorType::GrayscaleAlpha, 2)
    );
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    reader.next_frame(&mut bytes).unwrap();
    assert_eq!(bytes.iter().map(|b| u16::from(*b)).collect::<Vec<_>>(), values);
    assert!(load(&at("a.1.webp")).f32("A").is_some());
    // numbers that 8 bits do not suffice for, and a colour
    let deep = ["--png-bits", "16", "--png-encoding", "linear", "--background", "0,0.5,0"];
    render(&[&frames[..], &["-o", &exr, "-o", &png], &deep].concat());
    let (values, channels) = decode(&at("a.1.png"));
    // what is covered lies on what is behind it
    let expected = |p: usize, c: usize| y[p] + [0.0, 0.5, 0.0][c] * (1.0 - alpha[p]);
    assert_eq!(channels, 3);
    for (p, pixel) in values.chunks_exact(3).enumerate() {
        for (c, value) in pixel.iter().enumerate() {
            let expected = (expected(p, c) * 65535.0).round() as u16;
            assert!(value.abs_diff(expected) <= 1, "{p}, {c}: {value} {expected}");
        }
    }
    // what is shown in colour has a background, too
    render(&[&frames[..], &["-o", &png, "--show", "normal", "--background", "1,1,1"]].concat());
    let (values, _) = decode(&at("a.1.png"));
    assert!((0..y.len()).all(|p| alpha[p] > 0.0 || values[3 * p..3 * p + 3] == [255; 3]));
}

#[test]
fn gpu_metadata_tells_the_camera_and_no_path() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| place(&dir, name);
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/parade.glb");
    std::fs::create_dir(dir.path().join("scenes")).unwrap();
    let copy = dir.path().join("scenes/parade.glb");
    std::fs::copy(scene, &copy).unwrap();
    let copy = copy.to_str().unwrap();
    let base = ["render", copy, "--size", "40x24", "--ao-radius", "2", "--json"];
    let (still, frame, again) = (at("still.exr"), at("frame.#.exr"), at("again.exr"));
    let record = json(&run(&[&base[..], &["--spp", "2", "-o", &still]].concat()));
    let orbit = ["--preset", "fast", "--orbit", "8", "--frames", "0..3", "-o", &frame];
    let inside = skylit(&[&base[..], &orbit].concat()).current_dir(dir.path()).output().unwrap();
    json(&inside);
    let (a, b) = (load(&still), load(&at("frame.2.exr")));
    // relative to the working directory, or the name alone
    assert_eq!((a.metadata("scene"), b.metadata("scene")), (Some("parade.glb"), Some("scenes/parade.glb")));
    let folder = dir.path().to_str().unwrap();
    for image in [&a, &b] {
        assert!(image.metadata.iter().all(|(_, value)| !value.contains(folder)), "{:?}", image.metadata);
    }
    // frames have every key of stills
    let missing: Vec<_> = a.metadata.iter().filter(|(key, _)| b.metadata(key).is_none()).collect();
    assert!(missing.is_empty(), "{missing:?}");
    // and one type of each channel
    let kinds = |image: &Image| {
        let of = |samples: &Samples| matches!(samples, Samples::F32(_));
        image.channels.iter().map(|c| (c.name.clone(), of(&c.samples))).collect::<BTreeMap<_, _>>()
    };
    let (of_still, of_frame) = (kinds(&a), kinds(&b));
    assert!(of_frame.iter().all(|(name, kind)| of_still.get(name) == Some(kind)), "{of_frame:?}");
    assert!(a.f32("samples").unwrap().iter().all(|n| *n == 2.0));
    // the camera moves
    assert_ne!(b.metadata("camera"), load(&at("frame.0.exr")).metadata("camera"));
    // the same numbers give the same image
    let pose: serde_json::Value = serde_json::from_str(a.metadata("camera_pose").unwrap()).unwrap();
    assert_eq!(pose, record["camera_pose"]);
    let vector =
        |key: &str| pose[key].as_array().unwrap().iter().map(ToString::to_string).collect::<Vec<_>>().join(",");
    let (eye, target, up, fov) = (vector("eye"), vector("target"), vector("up"), pose["fov_y"].to_string());
    let camera = ["--eye", &eye, "--target", &target, "--up", &up, "--fov-y", &fov];
    json(&run(&[&base[..], &camera, &["--spp", "2", "-o", &again]].concat()));
    let again = load(&again);
    let off = a.f32("Y").unwrap().iter().zip(again.f32("Y").unwrap()).filter(|(a, b)| a != b).count();
    assert!(off < 10, "{off} pixels differ");
    // matrices project the position of each pixel to it
    let positions = at("positions.exr");
    json(&run(&[&base[..], &["--spp", "1", "--aov", "position,depth", "-o", &positions]].concat()));
    let image = load(&positions);
    let ndc: Vec<f32> = image.metadata("worldToNDC").unwrap().split(',').map(|v| v.parse().unwrap()).collect();
    let axes = ["position.X", "position.Y", "position.Z"].map(|name| image.f32(name).unwrap());
    let mut seen = 0;
    let depth = image.f32("depth.Z").unwrap();
    for p in (0..image.pixel_count()).filter(|p| depth[*p].is_finite()) {
        let point = [axes[0][p], axes[1][p], axes[2][p], 1.0];
        // a row times the matrix
        let clip: [f32; 4] = std::array::from_fn(|c| (0..4).map(|r| point[r] * ndc[4 * r + c]).sum());
        let (x, y) = (clip[0] / clip[3], clip[1] / clip[3]);
        let column = (p % 40) as f32 + 0.5;
        let row = (p / 40) as f32 + 0.5;
        assert!(((x + 1.0) * 20.0 - column).abs() < 0.01 && ((1.0 - y) * 12.0 - row).abs() < 0.01, "{p}: {x} {y}");
        seen += 1;
    }
    assert!(seen > 200, "{seen}");
}

#[test]
fn gpu_half_floats_resume_and_compare() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| place(&dir, name);
    let (begun, done, whole, full) = (at("begun.exr"), at("done.exr"), at("whole.exr"), at("full.exr"));
    let half = ["--exr-half", "--exr-compression", "piz"];
    render(&[&["--spp", "4", "--resumable", "-o", &begun][..], &half].concat());
    render(&[&["--spp", "15", "--resume", &begun, "-o", &done][..], &half].concat());
    render(&[&["--spp", "15", "--resumable", "-o", &whole][..], &half].concat());
    // fifteenths are no half floats
    render(&["--spp", "15", "--resumable", "-o", &full]);
    // a file of an earlier version: grey alone, counts of samples as unsigned integers
    let mut earlier = load(&begun);
    for channel in earlier.channels.iter_mut().filter(|c| c.name == "samples") {
        let Samples::F32(counts) = &channel.samples else { panic!("{:?}", channel.samples) };
        channel.samples = Samples::U32(counts.iter().map(|n| *n as u32).collect());
    }
    earlier.metadata.retain(|(key, _)| !key.starts_with("camera_pose") && !key.starts_with("worldTo"));
    let options = output::exr::ExrOptions { grey_as_rgb: false, ..Default::default() };
    output::exr::write_with(&earlier, begun.as_ref(), &options).unwrap();
    let resumed = at("resumed.exr");
    render(&["--spp", "15", "--resume", &begun, "-o", &resumed]);
    assert_eq!(load(&resumed), load(&full));
    let (done, whole, full) = (load(&done), load(&whole), load(&full));
    assert_eq!(done, whole);
    for (a, b) in whole.channels.iter().zip(&full.channels) {
        let is_half = ["A", "Y"].contains(&a.name.as_str());
        assert_eq!(a.samples == b.samples, !is_half, "{}", a.name);
    }
    let differ = json(&run(&["diff", &at("whole.exr"), &at("full.exr"), "--max-rmse", "1e-3", "--json"]));
    assert!(differ["compared"]["rmse"].as_f64().is_some_and(|e| e > 0.0 && e < 3e-4), "{differ}");
}

/// A viewer that reads packets as tev does (Ipc.cpp of tev 2.0), and keeps the images.
struct FakeTev {
    images: BTreeMap<String, BTreeMap<String, Vec<f32>>>,
    sizes: BTreeMap<String, [u32; 2]>,
    updates: usize,
}

/// What is left of a packet.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(&mut self, count: usize) -> &'a [u8] {
        let (first, rest) = self.0.split_at(count);
        self.0 = rest;
        first
    }

    fn word(&mut self) -> u32 {
        u32::from_le_bytes(self.bytes(4).try_into().unwrap())
    }

    fn long(&mut self) -> usize {
        u64::from_le_bytes(self.bytes(8).try_into().unwrap()) as usize
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|b| *b == 0).unwrap();
        let text = String::from_utf8(self.bytes(end).to_vec()).unwrap();
        self.bytes(1);
        text
    }
}

impl FakeTev {
    fn read(bytes: &[u8]) -> Self {
        let mut viewer = Self { images: BTreeMap::new(), sizes: BTreeMap::new(), updates: 0 };
        let mut rest = bytes;
        while !rest.is_empty() {
            let length = u32::from_le_bytes(rest[..4].try_into().unwrap()) as usize;
            viewer.packet(&rest[4..length]);
            rest = &rest[length..];
        }
        viewer
    }

    fn packet(&mut self, packet: &[u8]) {
        let mut fields = Fields(packet);
        let kind = fields.bytes(1)[0];
        let _grabs_focus = fields.bytes(1);
        let name = fields.text();
        match kind {
            4 => {
                let size = [fields.word(), fields.word()];
                let channels = (0..fields.word()).map(|_| fields.text()).collect::<Vec<_>>();
                let zero = vec![0.0; (size[0] * size[1]) as usize];
                self.sizes.insert(name.clone(), size);
                self.images.insert(name, channels.into_iter().map(|c| (c, zero.clone())).collect());
            }
            6 => {
                let count = fields.word() as usize;
                let channels: Vec<_> = (0..count).map(|_| fields.text()).collect();
                let [x, y, width, height] = std::array::from_fn(|_| fields.word() as usize);
                let offsets: Vec<_> = (0..count).map(|_| fields.long()).collect();
                let strides: Vec<_> = (0..count).map(|_| fields.long()).collect();
                let values: Vec<f32> =
                    fields.0.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
                let across = self.sizes[&name][0] as usize;
                for (c, channel) in channels.iter().enumerate() {
                    let plane = self.images.get_mut(&name).unwrap().get_mut(channel).unwrap();
                    for p in 0..width * height {
                        plane[(y + p / width) * across + x + p % width] = values[offsets[c] + p * strides[c]];
                    }
                }
                self.updates += 1;
            }
            other => panic!("packet {other}"),
        }
    }
}

#[test]
fn gpu_tev_shows_the_image_while_it_renders() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let exr = place(&dir, "a.exr");
    let serve = |args: &[&str]| {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let reader = std::thread::spawn(move || {
            let mut bytes = Vec::new();
            listener.accept().unwrap().0.read_to_end(&mut bytes).unwrap();
            bytes
        });
        render(&[args, &["-o", &exr, "--tev", &address]].concat());
        FakeTev::read(&reader.join().unwrap())
    };
    let check = |viewer: &FakeTev, image: &Image| {
        let channels = &viewer.images["a.exr"];
        assert_eq!((viewer.images.len(), viewer.sizes["a.exr"]), (1, [image.width, image.height]));
        assert_eq!(channels.len(), image.channels.iter().filter(|c| !c.name.starts_with("state.")).count());
        for (name, shown) in channels {
            let channel = image.channels.iter().find(|c| c.name == *name).unwrap();
            match &channel.samples {
                Samples::F32(values) => {
                    assert!(values.iter().zip(shown).all(|(a, b)| a.to_bits() == b.to_bits()), "{name}")
                }
                Samples::U32(values) => assert!(values.iter().zip(shown).all(|(a, b)| *a as f32 == *b), "{name}"),
            }
        }
    };
    let viewer = serve(&["--spp", "16", "--aov", "depth,ids", "--resumable"]);
    let image = load(&exr);
    check(&viewer, &image);
    // 1, 2, 4, 8 and 16 samples, each channel in one packet; no file of theirs
    assert_eq!((viewer.updates, command::count(dir.path())), (5 * viewer.images["a.exr"].len(), 1));
    // the image is the same without a viewer
    render(&["--spp", "16", "--aov", "depth,ids", "--resumable", "-o", &exr]);
    assert_eq!(load(&exr), image);
    // frames, one after another
    let viewer = serve(&["--preset", "fast", "--frames", "3..4", "--warm-up", "2"]);
    check(&viewer, &load(&exr));
    // a viewer that is closed is a warning
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let closes = std::thread::spawn(move || drop(listener.accept().unwrap()));
    let large = ["render", "builtin:spheres:30", "--size", "640x480", "--spp", "8", "-o", &exr, "--tev", &address];
    let out = run(&large);
    closes.join().unwrap();
    assert!(out.status.success() && stderr(&out).contains("--tev: the connection has ended"), "{}", stderr(&out));
}

/// A quad at depth 2 in front of another at depth 4, and a camera of another aspect ratio than other images.
const CLIPPED: &str = r#"{
    "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0, 1, 2] }],
    "nodes": [{ "mesh": 0, "translation": [0, 0, -2] }, { "mesh": 0, "translation": [0, 0, -4], "scale": [9, 9, 1] }, { "camera": 0 }],
    "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
    "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }],
    "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
    "buffers": [{ "byteLength": 36, "uri": "data:;base64,AACAvwAAgL8AAAAAAACAPwAAgL8AAAAAAAAAAAAAgD8AAAAA" }],
    "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.5, "aspectRatio": 4.0, "znear": 3.0, "zfar": 3.5 } }]
}"#;

#[test]
fn gpu_images_follow_the_cameras_aspect_ratio_and_its_clipping_planes() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let (scene, image) = (place(&dir, "clipped.gltf"), place(&dir, "a.exr"));
    std::fs::write(&scene, CLIPPED).unwrap();
    let render = |args: &[&str]| {
        let base = ["render", &scene, "--spp", "1", "--ao-radius", "1", "--aov", "depth", "--json", "-o", &image];
        let record = json(&run(&[&base[..], args].concat()));
        let image = load(&image);
        let middle = (image.height / 2 * image.width + image.width / 2) as usize;
        (record, [image.width, image.height], image.f32("depth.Z").unwrap()[middle])
    };
    let (record, size, depth) = render(&[]);
    assert_eq!((size, depth), ([1920, 480], f32::INFINITY));
    let said = record["choices"].to_string();
    assert!(said.contains("image size: 1920x480") && said.contains("sees from 3 to 3.5"), "{said}");
    let small = |clip: &'static str| render(&["--size", "16x4", "--clip", clip]);
    for (clip, expected) in [("none", 2.0), ("3,inf", 4.0), ("1,3", 2.0)] {
        let (record, size, depth) = small(clip);
        // the middle of the image is a corner of four pixels
        assert!(size == [16, 4] && (depth / expected - 1.0).abs() < 0.02, "{clip}: {depth}");
        assert!(!record["choices"].to_string().contains("image size"));
        assert_eq!(record["camera_pose"]["clip"].as_str(), Some(clip).filter(|c| *c != "none"));
    }
    refuses(&["render", &scene, "-o", &image, "--clip", "3,2"], 64, "expected NEAR,FAR");
}
