//! `skylit bench path` from outside, with a peer that is a shell script: what is measured of tiny images, what a peer is told, and what is
//! refused.
use std::path::PathBuf;
use std::process::Output;

use crate::common::command::{device, fails, json, run};
use serde_json::Value;

/// A peer that takes half a second, always, and whose images are black but for the first pixel. It keeps the scene that it gets.
const FAKE: &str = r#"
kept=$1; dies_at=$2; pixels=$3
echo '{"protocol":1,"peer":"Fake","kernels":["k","l"]}'
while read -r command a b c d; do
  if [ "$command" = "$dies_at" ]; then echo '{"error":"no such thing"}'; continue; fi
  case $command in
    quit) exit 0;;
    scene) cp -r "$a" "$kept"; echo '{"build_seconds":0.5}';;
    render) { printf '\000\000\200\077'; head -c $((pixels * 12 - 4)) /dev/zero; } > "$d"; echo '{"seconds":0.5}';;
    *) echo '{"error":"what is that?"}';;
  esac
done
"#;

const TINY: [&str; 8] = ["--quick", "--size", "12x8", "--seconds", "0.02", "--reference-seconds", "0.05", "--quiet"];

/// A peers file with a peer that renders paths, and what it keeps.
pub struct Place {
    dir: tempfile::TempDir,
}

impl Place {
    /// `dies_at`: the command that it answers with an error; `pixels`: of its images.
    pub fn new(dies_at: &str, pixels: u32) -> Self {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("fake.sh"), FAKE).unwrap();
        let peers = format!(
            "[[peer]]\nname = 'fake'\nmeasures = 'paths'\nrun = ['sh', '{{dir}}/fake.sh', '{{dir}}/kept', '{dies_at}', '{pixels}']\n\
             kernels = ['k', 'l']\n[[peer]]\nname = 'rays'\nrun = ['false']\nkernels = ['k']\n"
        );
        std::fs::write(dir.path().join("peers.toml"), peers).unwrap();
        Self { dir }
    }

    /// A file of it.
    pub fn at(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn run(&self, args: &[&str]) -> Output {
        command(&[args, &["--peers", self.at("peers.toml").to_str().unwrap()]].concat())
    }

    /// The record, and its notes in one piece.
    fn record(&self, args: &[&str]) -> (Value, String) {
        let out = self.run(&[&TINY[..], args, &["--json"]].concat());
        let record = json(&out);
        let notes = record["notes"].to_string();
        (record, notes)
    }
}

fn command(args: &[&str]) -> Output {
    run(&[&["bench", "path"], args].concat())
}

#[test]
fn wrong_usage() {
    fails(&command(&["--strategies", "magic"]), 64, &["magic", "uniform"]);
    fails(&command(&["--seconds", "-1"]), 64, &["--seconds"]);
    fails(&command(&["--repeats", "0"]), 64, &["--repeats"]);
    fails(&command(&["--plot", "a.pdf"]), 64, &[".png"]);
    fails(&command(&["--json=/nonexistent/a.json"]), 4, &["folder does not exist"]);
    fails(&command(&["sphere-nothing"]), 3, &["sphere-nothing"]);
    fails(&command(&["--peers", "/nonexistent.toml"]), 3, &["/nonexistent.toml"]);
}

/// Strategies and a peer beside each other: curves that fall, times to an error, files that are whole.
#[test]
fn gpu_error_against_time() {
    if !device() {
        return;
    }
    let place = Place::new("", 96);
    let (csv, plot) = (place.at("a.csv"), place.at("a.png"));
    let files = ["cornell", "--strategies", "mis,uniform", "--csv", csv.to_str().unwrap(), "--plot", plot.to_str().unwrap()];
    let (record, notes) = place.record(&files);
    assert!(!notes.contains("rays"), "a peer that traces rays was asked: {notes}");
    assert_eq!(record["peers"], serde_json::json!(["Fake"]));
    let scene = &record["scenes"][0];
    let engines: Vec<_> = scene["references"].as_array().unwrap().iter().map(|r| r["engine"].as_str().unwrap()).collect();
    assert_eq!(engines, ["skylit", "fake"]);
    assert!(scene["references"][0]["rmse"].as_f64().unwrap() > 0.0);
    assert_eq!(scene["references"][1]["rmse"], 0.0, "its images are all the same");
    assert!(scene["differences"][0]["mean_ratio"].as_f64().unwrap() < 0.5);
    let results = scene["results"].as_array().unwrap();
    let names: Vec<_> = results.iter().map(|r| r["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["mis", "uniform", "fake k", "fake l"]);
    for ours in &results[..2] {
        let points = ours["points"].as_array().unwrap();
        assert!(points.len() >= 2 && points[1]["spp"] == 4, "{points:?}");
        assert_eq!(points[0]["seconds"]["median"].as_f64().map(|s| s > 0.0), Some(true));
        let rmse = |k: usize| points[k]["rmse"].as_f64().unwrap();
        assert!(rmse(points.len() - 1) < rmse(0), "{points:?}");
        assert!(ours["mrays"].as_f64().unwrap() > ours["mpaths"].as_f64().unwrap());
    }
    // half a second an image is more than it may take: it stops as soon as it may
    assert_eq!(results[2]["points"].as_array().unwrap().len(), 2);
    assert_eq!(results[2]["points"][0]["seconds"]["median"], 0.5);
    // it is told all that is there
    let told: Value = serde_json::from_slice(&std::fs::read(place.at("kept/scene.json")).unwrap()).unwrap();
    assert_eq!(told["size"], serde_json::json!([12, 8]));
    let size = |name: &Value| std::fs::metadata(place.at("kept").join(name.as_str().unwrap())).unwrap().len();
    let triangles: u64 = told["meshes"].as_array().unwrap().iter().map(|m| size(&m["indices"]) / 12).sum();
    assert_eq!(Some(triangles), scene["triangles"].as_u64());
    let lamps = told["materials"].as_array().unwrap().iter().filter(|m| m["emissive"][0].as_f64() > Some(0.0)).count();
    assert_eq!(lamps, 1);
    let rows = csv::Reader::from_path(&csv).unwrap().records().count();
    let points: usize = results.iter().map(|r| r["points"].as_array().unwrap().len()).sum();
    assert_eq!(rows, points);
    let image = skylit::output::load(&plot).unwrap();
    assert!(image.width > 500 && image.height > 300);
}

/// What a peer cannot do leaves it out, with its reason; without peers, errors are held against our own.
#[test]
fn gpu_peers_that_fail_are_left_out() {
    if !device() {
        return;
    }
    for (place, says) in
        [(Place::new("scene", 96), "it reports: no such thing"), (Place::new("", 95), "its image has 285 values")]
    {
        let (record, notes) = place.record(&["sphere-diffuse", "--strategies", "mis"]);
        assert!(notes.contains("peer 'fake' left out") && notes.contains(says), "{notes}");
        let scene = &record["scenes"][0];
        assert_eq!(scene["results"].as_array().unwrap().len(), 1);
        assert_eq!(scene["target"]["set_by"], "mis");
        assert!(scene["environment"].as_str().unwrap().starts_with("own sun map"));
    }
}
