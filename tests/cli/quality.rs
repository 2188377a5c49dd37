//! `render --quality`: noise on a display below a bound, announced, with as many samples as it takes.

use serde_json::Value;
use skylit::output;

use crate::common::command::{device, json, place, run};

const SIZE: [usize; 2] = [64, 48];
const TILES: usize = 48;

/// Renders a scene and returns its record and the sRGB values of its pixels, from 0 to 255.
fn render(scene: &[&str], options: &[&str], exr: &str) -> (Value, Vec<f64>) {
    let base = ["--size", "64x48", "--json", "--no-config", "-o", exr];
    let record = json(&run(&[&["render"], scene, &base[..], options].concat()));
    let image = output::load(exr.as_ref()).unwrap();
    let names: &[&str] = if image.f32("Y").is_some() { &["Y"] } else { &["R", "G", "B"] };
    let shown = |v: &f32| 255.0 * f64::from(skylit::colour::srgb_encode(v.clamp(0.0, 1.0)));
    let planes: Vec<Vec<f64>> = names.iter().map(|name| image.f32(name).unwrap().iter().map(shown).collect()).collect();
    let pixels = (0..SIZE[0] * SIZE[1]).flat_map(|p| planes.iter().map(move |plane| plane[p])).collect();
    (record, pixels)
}

/// Root mean square difference of each tile.
fn tile_errors(a: &[f64], b: &[f64]) -> Vec<f64> {
    let channels = a.len() / SIZE[0] / SIZE[1];
    let mut sums = vec![0.0; TILES];
    for (k, (a, b)) in a.iter().zip(b).enumerate() {
        let (x, y) = (k / channels % SIZE[0], k / channels / SIZE[0]);
        sums[y / 8 * (SIZE[0] / 8) + x / 8] += (a - b).powi(2) / (64 * channels) as f64;
    }
    sums.into_iter().map(f64::sqrt).collect()
}

/// The tile whose corner a record names.
fn tile_of(corner: &Value) -> usize {
    let [x, y] = [0, 1].map(|k| corner[k].as_u64().unwrap() as usize);
    assert!(x % 8 == 0 && y % 8 == 0 && x < SIZE[0] && y < SIZE[1], "{corner}");
    y / 8 * (SIZE[0] / 8) + x / 8
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// Qualities are ordered by what they leave and what they cost, and what is announced is there: the error of the image
/// and, but for tiles that are named, of each tile.
#[test]
fn gpu_a_quality_is_what_it_announces() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let exr = place(&dir, "a.exr");
    for scene in [["builtin:stairs", "--integrator", "ao"], ["builtin:cornell-box", "--integrator", "path"]] {
        let (_, reference) = render(&scene, &["--spp", "2048", "--seed", "9"], &exr);
        let mut before: Option<[f64; 2]> = None;
        for (quality, bound) in [("draft", 4.0), ("good", 2.0)] {
            let (record, pixels) = render(&scene, &["--quality", quality], &exr);
            let film = &record["film"];
            let number =
                |path: &str| film.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path}: {film}"));
            let errors = tile_errors(&pixels, &reference);
            let (error, announced, samples) = (rms(&errors), 255.0 * number("/quality/error"), number("/samples/mean"));
            let limited: Vec<usize> =
                film["quality"]["limited_tiles"].as_array().unwrap().iter().map(tile_of).collect();
            let reached = (0..TILES).filter(|tile| !limited.contains(tile)).map(|tile| errors[tile]);
            let worst = reached.fold(0.0, f64::max);
            println!(
                "{scene:?} {quality}: error {error:.3}, announced {announced:.3}, worst tile {worst:.3}, {samples} samples"
            );
            assert!((255.0 * number("/quality/bound") - bound).abs() < 1e-9 && film["quality"]["name"] == quality);

            // the image is within its bound, and the estimate within its own uncertainty: it is too large where samples
            // are stratified, which is what ambient occlusion gains most by
            assert!(error < bound && announced < bound, "{film}");
            assert!((0.8..1.6).contains(&(announced / error)), "announced {announced}, found {error}");
            // an estimate from 64 pixels is off by a tenth, and the reference has noise, too
            assert!(worst < 1.5 * bound && limited.len() <= 2, "a tile with {worst}: {film}");

            // the next one leaves less, and costs more
            if let Some([more, fewer]) = before.replace([error, samples]) {
                assert!(error < 0.75 * more && samples > 1.5 * fewer, "{error} after {more}, {samples} after {fewer}");
            }
        }
    }
}

/// Tiles with less noise have fewer samples, the file says how many, and the same command makes the same bytes.
#[test]
fn gpu_quiet_tiles_have_fewer_samples() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let (exr, again) = (place(&dir, "a.exr"), place(&dir, "b.exr"));
    // a lamp in view, which is white whatever its samples, and a caustic
    let scene = ["builtin:cornell-glass-sphere", "--integrator", "path"];
    let (record, _) = render(&scene, &["--quality", "draft", "--explain", "--validation"], &exr);
    let film = &record["film"];
    let number = |name: &str| film["samples"][name].as_f64().unwrap();
    assert!(number("min") <= 64.0 && number("max") == 256.0 && number("mean") < 230.0, "{film}");
    assert_eq!(record["spp_asked"], 256);
    assert_eq!(record["stopped_early"], false);

    // the tiles that are named have all samples, and noise above the bound
    let image = output::load(exr.as_ref()).unwrap();
    assert_eq!(image.metadata("quality"), Some("draft"));
    let samples = image.f32("samples").unwrap();
    let limited = film["quality"]["limited_tiles"].as_array().unwrap();
    assert!(!limited.is_empty() && limited.len() < TILES, "{film}");
    for tile in limited {
        let (tile, width) = (tile_of(tile), SIZE[0] / 8);
        assert_eq!(samples[8 * (tile / width) * SIZE[0] + 8 * (tile % width)], 256.0);
    }
    let counts = film["quality"]["tiles_by_samples"].as_object().unwrap();
    assert_eq!(counts.values().map(|n| n.as_u64().unwrap()).sum::<u64>(), TILES as u64);
    for (count, tiles) in counts {
        let count: f32 = count.parse().unwrap();
        let pixels = samples.iter().filter(|n| **n == count).count() as u64;
        assert_eq!(Some(pixels), tiles.as_u64().map(|n| 64 * n), "{count} samples");
    }
    let lines: Vec<_> = record["explain"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert!(lines.iter().any(|l| l.contains("tiles by samples per pixel: ")), "{lines:?}");

    // twice the same, and people are told as well
    let base = ["--size", "64x48", "--no-config", "-o", &again, "--quality", "draft"];
    let text =
        |more: &[&str]| String::from_utf8(run(&[&["render"], &scene[..], &base[..], more].concat()).stdout).unwrap();
    let short = text(&[]);
    assert!(short.contains("quality draft: noise on a display is estimated as "), "{short}");
    let text = text(&["--verbose"]);
    assert!(text.contains("of 48 tiles have 256 samples, the most, and noise above the bound"), "{text}");
    let bytes = |path: &str| std::fs::read(path).unwrap();
    assert!(bytes(&exr) == bytes(&again), "other bytes");
}

/// A quality takes the place of `--spp` in stills of a time line, too.
#[test]
fn gpu_stills_of_a_time_line_have_a_quality() {
    if !device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let png = place(&dir, "a.#.exr");
    let base = ["render", "builtin:parade", "--integrator", "ao", "--size", "48x27", "--frames", "3..5", "--animate"];
    let args = [&base[..], &["--quality", "draft", "--json", "--no-config", "-o", &png]].concat();
    let record = json(&run(&args));
    let stills = record["stills"].as_array().unwrap();
    assert!(stills.len() == 2 && stills.iter().all(|s| s["film"]["quality"]["name"] == "draft"), "{record}");
    // finished is what has the same quality
    let again = |more: &[&str]| json(&run(&[&args[..], &["--continue"], more].concat()))["finished_before"].clone();
    assert_eq!(again(&[]), 2);
    assert_eq!(again(&["--quality", "good"]), 0);
}
