//! `skylit convert`: formats, tone mapping, layers, and what it refuses.

use std::fs;

use skylit::colour::srgb_encode;
use skylit::interface::ToneMap;
use skylit::output::{self, Image};

use crate::common::command::{fails, json, place, refuses, run, stderr};
use crate::compare::write;

/// Values of a channel of an image file.
fn values(path: &str, channel: &str) -> Vec<f32> {
    let image: Image = output::load(path.as_ref()).unwrap();
    image.f32(channel).unwrap_or_else(|| panic!("{path}: {channel}")).to_vec()
}

/// Bytes of the colours of a picture, as a display gets them.
fn bytes(path: &str, channel: &str) -> Vec<u8> {
    values(path, channel).iter().map(|v| (255.0 * srgb_encode(*v)).round() as u8).collect()
}

fn converts(args: &[&str]) -> String {
    let out = run(&[&["convert"], args].concat());
    assert!(out.status.success(), "{}", stderr(&out));
    String::from_utf8(out.stdout).unwrap()
}

#[test]
fn pictures_show_what_render_would() {
    let dir = tempfile::tempdir().unwrap();
    let [grey, png, jpg, webp] = ["grey.exr", "a.png", "a.jpg", "a.webp"].map(|n| place(&dir, n));
    write(&dir, "grey.exr", &[("Y", &|k| k as f32 / 31.0)], &[]);
    let text = converts(&[&grey, &png, &jpg, &webp]);
    assert_eq!(text.lines().count(), 3);
    assert!(text.starts_with(&format!("{png}: 8x4\n")), "{text}");
    let expected: Vec<u8> = (0..32).map(|k| (255.0 * srgb_encode(k as f32 / 31.0)).round() as u8).collect();
    assert_eq!(bytes(&png, "Y"), expected);
    assert_eq!(bytes(&webp, "R"), expected);

    // colours: exposed, then tone mapped
    let colour = write(&dir, "colour.exr", &[("R", &|_| 0.25), ("G", &|_| 0.5), ("B", &|_| 4.0)], &[]);
    for (operator, tone_map) in [("linear", ToneMap::Linear), ("agx", ToneMap::Agx), ("neutral", ToneMap::Neutral)] {
        converts(&[&colour, &png, "--tone-map", operator, "--exposure", "-1"]);
        let expected = tone_map.map([0.125, 0.25, 2.0]);
        for (channel, value) in ["R", "G", "B"].into_iter().zip(expected) {
            assert_eq!(bytes(&png, channel)[0], (255.0 * srgb_encode(value.clamp(0.0, 1.0))).round() as u8);
        }
    }
    assert_eq!(bytes(&png, "R").len(), 32);

    // 16 bits keep what 8 round, and a picture of a picture is that picture
    converts(&[&grey, &png, "--png-bits", "16"]);
    assert!(values(&png, "Y").iter().enumerate().all(|(k, v)| (v - k as f32 / 31.0).abs() < 2e-5));
    converts(&[&webp, &png]);
    assert_eq!(bytes(&png, "R"), bytes(&webp, "R"));
}

#[test]
fn exposures_are_chosen_by_surfaces() {
    let dir = tempfile::tempdir().unwrap();
    let png = place(&dir, "a.png");
    let dim = |_: usize| 0.01;
    let image = write(&dir, "dim.exr", &[("R", &dim), ("G", &dim), ("B", &dim)], &[]);
    let record = json(&run(&["convert", &image, &png, "--exposure", "auto", "--json"]));
    let stops = record["exposure"].as_f64().unwrap();
    assert!((3.0..=5.0).contains(&stops), "{record}");
    assert!((values(&png, "R")[0] - 0.01 * stops.exp2() as f32).abs() < 0.01);
    assert!(run(&["convert", &image, &png, "--quiet"]).stdout.is_empty());
}

#[test]
fn layers_are_images_of_their_own() {
    let dir = tempfile::tempdir().unwrap();
    let covered = |k: usize| f32::from(u8::from(k >= 8));
    let image = write(
        &dir,
        "layers.exr",
        &[
            ("Y", &|_| 0.5),
            ("A", &covered),
            ("depth.Z", &|k| if k < 8 { 0.0 } else { k as f32 }),
            ("Ng.X", &|_| -1.0),
            ("Ng.Y", &|_| 0.0),
            ("Ng.Z", &|_| 1.0),
            ("albedo.R", &|_| 0.2),
            ("albedo.G", &|_| 0.4),
            ("albedo.B", &|_| 0.6),
            ("state.one", &|_| 1.0),
            ("state.two", &|_| 2.0),
        ],
        &[],
    );
    let [png, exr] = ["a.png", "a.exr"].map(|n| place(&dir, n));

    // one channel: from the least to the greatest value of surfaces, or between two that are named
    let text = converts(&[&image, &png, &exr, "--layer", "depth", "--png-bits", "16", "--png-encoding", "linear"]);
    assert!(text.lines().next().unwrap().contains("8 to 31 as 0 to 1"), "{text}");
    let shown = values(&png, "Y");
    assert_eq!([shown[8], shown[31]], [0.0, 1.0]);
    // an .exr has the values themselves, unless a range is given
    let depths = values(&exr, "Y");
    assert_eq!([depths[8], depths[31]], [8.0, 31.0]);
    converts(&[&image, &exr, "--layer", "depth", "--range", "auto"]);
    let depths = values(&exr, "Y");
    assert_eq!([depths[8], depths[31]], [0.0, 1.0]);
    converts(&[&image, &exr, "--layer", "depth.Z", "--range", "31,7"]);
    assert_eq!(values(&exr, "Y")[31], 0.0);

    // the number of no object is none of the numbers
    let ids = write(&dir, "ids.exr", &[("id.instance", &|k| if k == 0 { u32::MAX as f32 } else { k as f32 })], &[]);
    let text = converts(&[&ids, &png, "--layer", "id.instance"]);
    assert!(text.lines().next().unwrap().contains("1 to 31 as 0 to 1"), "{text}");

    // directions by their components in order, colours as they are
    let record = json(&run(&["convert", &image, &png, "--layer", "Ng", "--json", "--png-encoding", "linear"]));
    assert_eq!(record["channels"], serde_json::json!(["Ng.X", "Ng.Y", "Ng.Z"]));
    let shown = ["R", "G", "B"].map(|c| values(&png, c)[9]);
    assert!(shown.iter().zip([0.0, 0.5, 1.0]).all(|(a, b)| (a - b).abs() < 0.003), "{shown:?}");
    converts(&[&image, &exr, "--layer", "albedo"]);
    assert_eq!(["R", "G", "B"].map(|c| values(&exr, c)[9]), [0.2, 0.4, 0.6]);

    fails(&run(&["convert", &image, &png, "--layer", "normals"]), 64, &["no layer \"normals\"", "Ng", "albedo"]);
    fails(&run(&["convert", &image, &png, "--layer", "state"]), 64, &["2 channels", "state.one"]);
    let colourless = write(&dir, "depth.exr", &[("depth.Z", &|_| 1.0)], &[]);
    fails(&run(&["convert", &colourless, &png]), 64, &["no colours", "--layer", "depth.Z"]);
}

#[test]
fn an_exr_keeps_everything() {
    let dir = tempfile::tempdir().unwrap();
    let image = write(&dir, "a.exr", &[("Y", &|k| k as f32), ("depth.Z", &|k| k as f32 + 0.1)], &[("skylit.spp", "7")]);
    let copy = place(&dir, "b.exr");
    converts(&[&image, &copy, "--exr-half", "--exr-compression", "piz"]);
    assert_eq!(values(&copy, "Y"), values(&image, "Y"));
    assert_eq!(values(&copy, "depth.Z"), values(&image, "depth.Z"));
    let [old, new] = [&image, &copy].map(|path| output::load(path.as_ref()).unwrap());
    assert_eq!(new.metadata("skylit.spp"), Some("7"));
    assert_eq!(new.metadata("skylit.spp"), old.metadata("skylit.spp"));
}

#[test]
fn radiance_files_and_alpha() {
    let dir = tempfile::tempdir().unwrap();
    let [hdr, exr, png] = ["a.hdr", "a.exr", "a.png"].map(|n| place(&dir, n));
    // two pixels of 2.0 and 0.5: a mantissa of a half, and exponents
    let pixels = [[128, 128, 128, 130], [128, 128, 128, 128]].concat();
    fs::write(&hdr, [b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n".as_slice(), &pixels].concat()).unwrap();
    converts(&[&hdr, &exr]);
    assert_eq!(values(&exr, "G"), [2.0, 0.5]);

    // premultiplied colours become straight ones, or are mixed with what is behind
    let half = write(&dir, "half.exr", &[("Y", &|_| 0.25), ("A", &|_| 0.5)], &[]);
    converts(&[&half, &png, "--background", "transparent", "--png-bits", "16", "--png-encoding", "linear"]);
    assert!((values(&png, "A")[0] - 0.5).abs() < 1e-4 && (values(&png, "Y")[0] - 0.25).abs() < 1e-4);
    converts(&[&half, &png, "--background", "1,1,1", "--png-bits", "16"]);
    assert!((values(&png, "Y")[0] - 0.75).abs() < 1e-3);
}

#[test]
fn what_cannot_be_converted() {
    let dir = tempfile::tempdir().unwrap();
    let image = write(&dir, "a.exr", &[("Y", &|_| 0.5)], &[]);
    let [png, exr, broken] = ["a.png", "b.exr", "broken.exr"].map(|n| place(&dir, n));
    fs::write(&broken, &fs::read(&image).unwrap()[..200]).unwrap();
    refuses(&["convert", &image, &image], 64, "a.exr");
    refuses(&["convert", &image, "a.tiff"], 64, "a.tiff");
    refuses(&["convert", &image, &exr, "--tone-map", "agx"], 64, "--tone-map");
    refuses(&["convert", &image, &png, "--range", "1,1"], 64, "--range");
    refuses(&["convert", &image, &png, "--exposure", "bright"], 64, "--exposure");
    refuses(&["convert", &image, &exr, "--png-bits", "16"], 64, "--png-bits");
    refuses(&["convert", &broken, &png], 3, "broken.exr");
    refuses(&["convert", "nowhere.exr", &png], 3, "nowhere.exr");
    assert!(!fs::exists(&png).unwrap() && !fs::exists(&exr).unwrap());
}

/// `view` shows images as well, in a window of their own.
#[cfg(feature = "viewer")]
#[test]
fn what_cannot_be_looked_at() {
    let dir = tempfile::tempdir().unwrap();
    let image = write(&dir, "a.exr", &[("Y", &|_| 0.5)], &[]);
    refuses(&["view", &image, "builtin:stairs"], 64, "builtin:stairs");
    refuses(&["view", "builtin:stairs", "builtin:plane"], 64, "builtin:plane");
    refuses(&["view", &image, "--ao-radius", "2"], 64, "--ao-radius");
    refuses(&["view", &image, "nowhere.exr"], 3, "nowhere.exr");
}
