//! `skylit bench path` from outside, with a peer that is a shell script: what is measured of tiny images, what a peer is told, and what is
//! refused.
use std::path::PathBuf;
use std::process::Output;

use crate::common::command::{device, fails, json, run};
use serde_json::Value;

use super::measured::{contestants, curve, find, scenes, value};

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
    fails(&command(&["--plot", "a.pdf"]), 64, &["must end in .svg"]);
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
    let (csv, plot) = (place.at("a.csv"), place.at("a.svg"));
    let files =
        ["cornell", "--strategies", "mis,uniform", "--csv", csv.to_str().unwrap(), "--plot", plot.to_str().unwrap()];
    let (record, notes) = place.record(&files);
    assert!(!notes.contains("rays"), "a peer that traces rays was asked: {notes}");
    assert_eq!(record["peers"], serde_json::json!(["Fake"]));
    assert_eq!(scenes(&record), ["cornell"]);
    let images = |contestant: &str, quantity: &str| value(&record, ["cornell", "images", contestant, quantity]);
    let names = ["reference of skylit", "reference of fake", "mis", "uniform", "fake k", "fake l"];
    assert_eq!(contestants(&record, "cornell", "images"), names);
    assert!(images("reference of skylit", "RMSE") > 0.0);
    assert_eq!(images("reference of fake", "RMSE"), 0.0, "its images are all the same");
    assert!(images("reference of fake", "mean over ours") < 0.5);
    for ours in ["mis", "uniform"] {
        let times = curve(&record, ["cornell", "images", ours, "time"]);
        assert!(times.len() >= 2 && times[1].0 == 4.0 && times[0].1 > 0.0, "{times:?}");
        let rmse = curve(&record, ["cornell", "images", ours, "mean RMSE"]);
        assert!(rmse[rmse.len() - 1].1 < rmse[0].1, "{rmse:?}");
        assert!(images(ours, "rays") > images(ours, "paths"));
    }
    // half a second an image is more than it may take: it stops as soon as it may
    assert_eq!(curve(&record, ["cornell", "images", "fake k", "time"]), [(1.0, 0.5), (4.0, 0.5)]);
    // its images are exact: an error of nothing is no target
    assert!(find(&record, ["cornell", "images", "mis", "times as long"]).is_none());
    // it is told all that is there
    let told: Value = serde_json::from_slice(&std::fs::read(place.at("kept/scene.json")).unwrap()).unwrap();
    assert_eq!(told["size"], serde_json::json!([12, 8]));
    let size = |name: &Value| std::fs::metadata(place.at("kept").join(name.as_str().unwrap())).unwrap().len();
    let triangles: u64 = told["meshes"].as_array().unwrap().iter().map(|m| size(&m["indices"]) / 12).sum();
    let about = record["scenes"][0]["about"].as_str().unwrap();
    assert!(about.starts_with(&format!("{triangles} triangles")), "{about}");
    let lamps = told["materials"].as_array().unwrap().iter().filter(|m| m["emissive"][0].as_f64() > Some(0.0)).count();
    assert_eq!(lamps, 1);
    let rows = csv::Reader::from_path(&csv).unwrap().records().count();
    assert_eq!(rows, record["measurements"].as_array().unwrap().len());
    let drawn = std::fs::read_to_string(&plot).unwrap();
    assert!(drawn.starts_with("<svg") && drawn.contains("cornell, images: error over time"), "{drawn}");
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
        assert_eq!(contestants(&record, "sphere-diffuse", "images"), ["reference", "mis"]);
        assert_eq!(value(&record, ["sphere-diffuse", "images", "mis", "times as long"]), 1.0);
        assert!(record["scenes"][0]["about"].as_str().unwrap().contains("environment own sun map"));
    }
}
