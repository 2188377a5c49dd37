//! `skylit bench rays` from outside, with peers that are shell scripts: what is measured, in which order, and what is said
//! when something is missing.
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::common::command::{device, fails, json, skylit, stderr};
use serde_json::Value;

use super::measured::{contestants, find, of_part, scenes, value};

/// A peer that takes no time and writes down what it is asked. Its clock says a quarter of a second, always. Its hits are
/// zeros: it claims to meet the first primitive at t = 0.
const FAKE: &str = r#"
log=$1; name=$2; dies_at=$3
echo '{"protocol":1,"peer":"Fake '$name'","threads":1,"kernels":["k","l"]}'
while read -r command a b c d; do
  echo "$name $command $a $b $c" >> "$log"
  if [ "$command" = "$dies_at" ]; then exit 3; fi
  if [ "hang $b" = "$dies_at" ]; then exec sleep 600; fi
  case $command in
    quit) exit 0;;
    scene) echo '{"primitives":1}';;
    rays) bytes=$(wc -c < "$b"); eval "rays_$a=$((bytes / 32))"; echo '{"rays":1}';;
    build) echo '{"build_seconds":0.5,"bytes":1000}';;
    trace) echo '{"seconds":0.25,"hits":3}';;
    hits) eval "n=\$rays_$c"; head -c $((n * 20)) /dev/zero > "$d"; echo '{"seconds":0.25,"hits":3}';;
    *) echo '{"error":"what is that?"}';;
  esac
done
"#;

/// A folder with a peers file, the fake, and what they write.
struct Place {
    dir: tempfile::TempDir,
}

impl Place {
    fn new(peers: &str) -> Self {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("fake.sh"), FAKE).unwrap();
        std::fs::write(dir.path().join("peers.toml"), peers).unwrap();
        Self { dir }
    }

    /// An entry for the fake under a name.
    fn entry(name: &str, dies_at: &str, more: &str) -> String {
        format!(
            "[[peer]]\nname = '{name}'\nrun = ['sh', '{{dir}}/fake.sh', '{{dir}}/log', '{name}', '{dies_at}']\nkernels = ['k']\n{more}\n"
        )
    }

    fn at(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = skylit(&["bench", "rays"]);
        command.args(args).args(["--peers", self.at("peers.toml").to_str().unwrap()]);
        command
    }

    fn run(&self, args: &[&str]) -> Output {
        self.command(args).output().unwrap()
    }

    fn log(&self) -> Vec<String> {
        std::fs::read_to_string(self.at("log")).unwrap().lines().map(|l| l.trim().to_owned()).collect()
    }
}

const SMALL: [&str; 9] =
    ["builtin:cornell-box", "--kernels", "wide", "--rays", "2000", "--repeats", "3", "--streams", "primary,shadow-any"];

#[test]
fn wrong_usage() {
    let place = Place::new("");
    fails(&place.run(&["--kernels", "magic"]), 64, &["magic", "wide, packet, nearest"]);
    fails(&place.run(&["--streams", "up"]), 64, &["up", "primary"]);
    fails(&place.run(&["--repeats", "0"]), 64, &["--repeats"]);
    fails(&place.run(&["--plot", "a.png"]), 64, &["must end in .svg"]);
    fails(&place.run(&["--csv", "/nonexistent/a.csv"]), 4, &["folder does not exist"]);
    fails(&place.run(&["builtin:nothing"]), 64, &["nothing"]);
    fails(&place.run(&["no-such-scene.glb"]), 3, &["no such file"]);
    // before anything is measured
    fails(&place.run(&["builtin:plane", "builtin:terrain:1"]), 64, &["terrain:1"]);
}

#[test]
fn a_broken_peers_file_is_named_with_its_line() {
    let place = Place::new(&format!("{}\n[[peer]]\nname = 3\n", Place::entry("a", "", "")));
    fails(&place.run(&SMALL), 3, &["peers.toml: line 8: "]);
    let nowhere = skylit(&["bench", "rays", "--peers", "/nonexistent.toml"]).output();
    fails(&nowhere.unwrap(), 3, &["/nonexistent.toml", "no such file"]);
}

/// Repeats are taken in turn, the peer is asked as the protocol says, and its clock and hits are believed.
#[test]
fn gpu_rounds_are_interleaved() {
    if !device() {
        return;
    }
    let place = Place::new(&(Place::entry("a", "", "") + &Place::entry("b", "", "baselines = ['k']")));
    let record = json(&place.run(&[&SMALL[..], &["--json"]].concat()));
    let log = place.log();
    let traced: Vec<_> = log.iter().filter(|l| l.contains(" trace ")).map(String::as_str).collect();
    // one round to warm up and three that count, of each stream
    let round = |set: &str, mode: &str| [format!("a trace k {mode} {set}"), format!("b trace k {mode} {set}")].concat();
    let expected = [round("primary", "closest").repeat(4), round("shadow", "any").repeat(4)].concat();
    assert_eq!(traced.concat(), expected);
    // each is given the scene once and each set once, before any timing
    let first_trace = log.iter().position(|l| l.contains(" trace ")).unwrap();
    for name in ["a", "b"] {
        for command in ["scene ", "build k", "rays primary ", "rays shadow "] {
            let asked: Vec<_> = (0..log.len()).filter(|&k| log[k].starts_with(&format!("{name} {command}"))).collect();
            assert!(asked.len() == 1 && asked[0] < first_trace, "{name} {command}: {log:?}");
        }
    }

    let scene = "builtin:cornell-box";
    assert_eq!(contestants(&record, scene, "primary"), ["wide", "a k", "b k"]);
    let of = |contestant: &str, quantity: &str| value(&record, [scene, "primary", contestant, quantity]);
    for peer in ["a k", "b k"] {
        let (rate, rays) = (of(peer, "rate"), of(peer, "traced"));
        assert!((rate - rays / 0.25 / 1e6).abs() < 1e-9 * rate);
        let repeated = find(&record, [scene, "primary", peer, "rate"]).unwrap();
        assert_eq!((repeated["values"]["count"].as_u64(), &repeated["is_peers"]), (Some(3), &Value::Bool(true)));
        assert!((of(peer, "hit share") - 3.0 / rays).abs() < 1e-12);
        assert_eq!(of(peer, "x b k"), 1.0);
        assert!(find(&record, [scene, "primary", peer, "wall rate"]).is_none());
    }
    // ours: the ratio is what the rates say
    assert!((of("wide", "x b k") / (of("wide", "rate") / of("b k", "rate")) - 1.0).abs() < 1e-9);
    assert!(of("wide", "hit share") > 0.5 && of("wide", "wall rate") > 0.0);
    assert_eq!(value(&record, [scene, "building", "a k", "build"]), 0.5);
}

#[test]
fn gpu_files_of_results() {
    if !device() {
        return;
    }
    let place = Place::new(&Place::entry("a", "", "baselines = ['k']"));
    let (csv, plot, record) = (place.at("a.csv"), place.at("a.svg"), place.at("a.json"));
    let args = [
        "builtin:terrain:200",
        "builtin:terrain:2000",
        "--kernels",
        "wide,nearest",
        "--rays",
        "2000",
        "--repeats",
        "2",
    ];
    let files = ["--csv", csv.to_str().unwrap(), "--plot", plot.to_str().unwrap()];
    let out = place.run(&[&args[..], &files, &[&format!("--json={}", record.display())]].concat());
    assert!(out.status.success(), "{}", stderr(&out));
    let text = String::from_utf8(out.stdout).unwrap();
    for word in [
        "builtin:terrain:2000:\n  2,000 triangles",
        "shuffled-any",
        "x a k",
        "no faster than log n: ",
        "bytes a primitive",
    ] {
        assert!(text.contains(word), "{word}: {text}");
    }
    let mut rows = csv::Reader::from_path(&csv).unwrap();
    let head = rows.headers().unwrap().clone();
    for column in ["scene", "part", "contestant", "quantity", "median"] {
        assert!(head.iter().any(|h| h == column), "{column}");
    }
    // two scenes, five streams, three contestants
    let quantity = head.iter().position(|h| h == "quantity").unwrap();
    assert_eq!(rows.records().map(Result::unwrap).filter(|r| &r[quantity] == "rate").count(), 2 * 5 * 3);
    let drawn = std::fs::read_to_string(&plot).unwrap();
    assert!(
        drawn.starts_with("<svg") && drawn.contains("shuffled-any") && drawn.contains("as 1 &#x2f; log n"),
        "{drawn}"
    );
    let record: Value = serde_json::from_slice(&std::fs::read(&record).unwrap()).unwrap();
    let laws = record["measurements"].as_array().unwrap().iter().filter(|m| m["quantity"] == "worst x log n");
    assert_eq!(laws.count(), 5 * 3);
    let left: Vec<_> = std::fs::read_dir(place.dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(left.iter().all(|n| !n.to_string_lossy().ends_with(".tmp")), "{left:?}");

    let quiet = place.run(&[&SMALL[..], &["--quiet"]].concat());
    assert!(quiet.status.success() && quiet.stdout.is_empty() && quiet.stderr.is_empty(), "{}", stderr(&quiet));
}

#[test]
fn gpu_missing_peers_are_named_and_left_out() {
    if !device() {
        return;
    }
    let broken = r#"'echo "peer.cpp:1:10: fatal error: embree3/rtcore.h: No such file" >&2; exit 1'"#;
    let place = Place::new(&format!(
        "[[peer]]\nname = 'x'\nbuild = ['no-such-compiler', '{{out}}']\nrun = ['{{out}}']\nkernels = ['k']\nneeds = 'a compiler'\n\
         [[peer]]\nname = 'y'\nbuild = ['sh', '-c', {broken}]\nrun = ['{{out}}']\nkernels = ['k']\nneeds = 'a library'\n\
         [[peer]]\nname = 'z'\nrun = ['true']\nkernels = ['k']\n\
         [[peer]]\nname = 'w'\nrun = ['sh', '{{dir}}/fake.sh', '{{dir}}/log', 'w']\nkernels = ['unheard']\n{}",
        Place::entry("v", "trace", "")
    ));
    let record = json(&place.run(&[&SMALL[..], &["--json"]].concat()));
    let notes: Vec<_> = record["notes"].as_array().unwrap().iter().map(|n| n.as_str().unwrap()).collect();
    let expect = [
        ("'x' is missing", "no-such-compiler"),
        ("'x' is missing", "it needs a compiler"),
        ("'y' is missing", "fatal error: embree3/rtcore.h"),
        ("'y' is missing", "it needs a library"),
        ("'z' is missing", "it ended"),
        ("'w' is missing", "no kernel 'unheard'"),
        ("'v k' left out from here", "it ended"),
    ];
    for (who, why) in expect {
        assert!(notes.iter().any(|n| n.contains(who) && n.contains(why)), "{who} {why}: {notes:?}");
    }
    // the rest is measured
    assert_eq!(contestants(&record, "builtin:cornell-box", "primary"), ["wide"]);
    // and people are told, too
    assert!(stderr(&place.run(&SMALL)).contains("skylit: warning: peer 'x' is missing"));
}

/// A kernel that refuses a scene is named with its reason, and the others are measured; alone, its reason ends the run.
#[test]
fn gpu_refusals_leave_the_rest() {
    if !device() {
        return;
    }
    let place = Place::new("");
    let args =
        ["builtin:grid:8", "--build", "fast", "--rays", "2000", "--repeats", "1", "--streams", "primary", "--kernels"];
    let record = json(&place.run(&[&args[..], &["wide,nearest,brute", "--json"]].concat()));
    assert_eq!(record["settings"]["build"], "fast");
    let notes = record["notes"].to_string();
    assert!(notes.contains("'brute' left out: traversal 'brute' tests every primitive"), "{notes}");
    assert_eq!(contestants(&record, "builtin:grid:8", "primary"), ["wide", "nearest"]);
    // without a peer ratios are to the first
    let of = |kernel: &str, quantity: &str| value(&record, ["builtin:grid:8", "primary", kernel, quantity]);
    assert_eq!(of("wide", "x wide"), 1.0);
    assert!((of("nearest", "x wide") / (of("nearest", "rate") / of("wide", "rate")) - 1.0).abs() < 1e-9);
    fails(&place.run(&[&args[..], &["brute"]].concat()), 3, &["traversal 'brute' tests every primitive"]);
}

/// The fake's answers are wrong, and found to be.
#[test]
fn gpu_wrong_answers_fail_the_check() {
    if !device() {
        return;
    }
    let lenient = Place::new(&Place::entry("a", "", ""));
    let args = ["builtin:cornell-box", "--rays", "2000", "--repeats", "1", "--kernels", "wide,nearest", "--check"];
    let record = json(&lenient.run(&[&args[..], &["--json"]].concat()));
    let of = |who: &str, stream: &str, quantity: &str| {
        value(&record, ["builtin:cornell-box", &format!("answers, {stream}"), who, quantity])
    };
    for stream in ["primary", "ao-any", "ao-closest", "shuffled-any", "shadow-any"] {
        let ours = |quantity: &str| of("nearest", stream, quantity);
        assert_eq!(ours("unexplained"), 0.0, "{stream}");
        assert_eq!(ours("agree") + ours("ties"), ours("compared"));
        // the box has the light outside: that nothing sees it is right by chance
        assert!(stream == "shadow-any" || of("a k", stream, "unexplained") > 0.0, "{stream}");
    }
    assert_eq!(of("a k", "primary", "unexplained"), of("a k", "primary", "compared"));

    let strict = Place::new(&Place::entry("a", "", "strict = ['k']"));
    fails(&strict.run(&args), 1, &["'a k' differ from those of 'wide'", "primary", "builtin:cornell-box"]);
}

#[test]
fn gpu_time_limit_and_interruption() {
    if !device() {
        return;
    }
    let place = Place::new(&Place::entry("a", "", ""));
    // over before anything starts: one round of one stream is measured all the same
    let args = [
        "builtin:plane",
        "builtin:stairs",
        "--kernels",
        "wide,nearest",
        "--rays",
        "2000",
        "--repeats",
        "1000",
        "--check",
    ];
    let record = json(&place.run(&[&args[..], &["--time-limit", "0.000001", "--json"]].concat()));
    assert_eq!(record["stopped_early"], true);
    assert_eq!(scenes(&record), ["builtin:plane"]);
    let rates: Vec<_> = record["measurements"].as_array().unwrap().iter().filter(|m| m["quantity"] == "rate").collect();
    assert!(rates.iter().all(|m| m["part"] == "primary" && m["values"]["count"] == 1), "{rates:?}");
    let notes = record["notes"].to_string();
    for note in ["4 streams left out", "1 streams not checked", "builtin:stairs: left out"] {
        assert!(notes.contains(note), "{note}: {notes}");
    }

    // interrupted in the first stream, where there is nothing to write yet, and in the second
    for (hangs_at, written) in [("hang closest", false), ("hang any", true)] {
        let place = Place::new(&Place::entry("a", hangs_at, ""));
        let csv = place.at("a.csv");
        let more = ["--streams", "primary,shadow-any", "--csv", csv.to_str().unwrap(), "--json"];
        let args = [&["builtin:stairs", "--kernels", "wide", "--rays", "2000", "--repeats", "1"], &more[..]].concat();
        let child = place.command(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let asked = format!("a trace k {}", &hangs_at[5..]);
        let start = std::time::Instant::now();
        while !std::fs::read_to_string(place.at("log")).is_ok_and(|log| log.contains(&asked)) {
            assert!(start.elapsed().as_secs() < 120, "the peer was never asked to trace");
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
        let out = child.wait_with_output().unwrap();
        fails(&out, 130, &["interrupted"]);
        assert_eq!(csv.exists(), written);
        // one record, with what there is and how it ended
        let record: Value = serde_json::from_slice(&out.stdout).unwrap();
        assert_eq!(
            (record["exit_code"].as_u64(), record["scenes"].as_array().unwrap().len()),
            (Some(130), usize::from(written))
        );
    }
}

/// A scene that fails costs neither the others nor what is written, and the run still fails.
#[test]
fn gpu_a_scene_that_fails_leaves_the_rest() {
    if !device() {
        return;
    }
    let place = Place::new("");
    let (broken, csv) = (place.at("broken.glb"), place.at("a.csv"));
    std::fs::write(&broken, "no glTF").unwrap();
    let args = ["builtin:cornell-box", broken.to_str().unwrap(), "builtin:plane", "--csv", csv.to_str().unwrap()];
    let more = ["--kernels", "wide", "--rays", "2000", "--repeats", "1", "--streams", "primary", "--json"];
    let out = place.run(&[&args[..], &more].concat());
    fails(&out, 3, &["broken.glb"]);
    let record: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(scenes(&record), ["builtin:cornell-box", "builtin:plane"]);
    assert!(record["notes"].to_string().contains("broken.glb: left out"), "{}", record["notes"]);
    assert_eq!(record["exit_code"], 3);
    let rows = std::fs::read_to_string(&csv).unwrap();
    assert_eq!(rows.lines().filter(|l| l.contains(",rate,")).count(), 2, "{rows}");
}

/// Packets are for coherent rays: asked of others alone, there is nothing to measure, and that is said.
#[test]
fn gpu_a_stream_without_contestants_is_named() {
    if !device() {
        return;
    }
    let place = Place::new("");
    let args = ["builtin:cornell-box", "--rays", "2000", "--repeats", "1", "--kernels", "packet", "--streams"];
    let out = place.run(&[&args[..], &["ao-any"]].concat());
    let said = stderr(&out);
    if said.contains("traces as 'wide' does") {
        println!("skipped: no packets here");
        return;
    }
    fails(&out, 64, &["nothing was measured", "ao-any: no contestant takes part"]);
    let record = json(&place.run(&[&args[..], &["ao-any,primary", "--check", "--json"]].concat()));
    assert!(of_part(&record, "", "ao-any").is_empty() && !of_part(&record, "", "primary").is_empty());
    assert!(
        record["notes"].to_string().contains("hits not checked: only 'packet' traces these rays"),
        "{}",
        record["notes"]
    );
}

/// The real peer, where it can be built: it loads triangles, instances and spheres, and agrees with us.
#[test]
fn gpu_embree_agrees() {
    if !device() {
        return;
    }
    let peers = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers.toml");
    let scenes = ["builtin:grid:3", "builtin:spheres:500", "builtin:terrain:5000", "builtin:stairs"];
    let args = ["--kernels", "wide", "--rays", "20000", "--repeats", "1", "--check", "--json"];
    // compiled here and now, whatever earlier runs have left
    let cache = tempfile::tempdir().unwrap();
    let out = Command::new(env!("CARGO_BIN_EXE_skylit"))
        .args(["bench", "rays", "--peers", peers.to_str().unwrap()])
        .args(scenes)
        .args(args)
        .env("XDG_CACHE_HOME", cache.path())
        .output()
        .unwrap();
    let record = json(&out);
    if record["peers"].as_array().unwrap().is_empty() {
        let notes = record["notes"].to_string();
        // no compiler, no header, no library; any other reason is a fault of ours
        let missing = [
            "` does not run (",
            "embree3/rtcore.h: No such file",
            "'embree3/rtcore.h' file not found",
            "cannot find -lembree3",
        ];
        assert!(missing.iter().any(|m| notes.contains(m)), "{notes}");
        println!("skipped: {notes}");
        return;
    }
    for scene in scenes {
        let all = record["measurements"].as_array().unwrap().iter();
        let robust: Vec<_> = all
            .filter(|m| m["scene"] == scene && m["part"].as_str().unwrap().starts_with("answers, "))
            .filter(|m| m["contestant"].as_str().unwrap().contains("robust"))
            .collect();
        let counts = |quantity: &str| -> Vec<u64> {
            let own = robust.iter().filter(|m| m["quantity"] == quantity);
            own.map(|m| m["values"].as_f64().unwrap() as u64).collect()
        };
        assert_eq!(counts("unexplained"), [0; 10], "{scene}");
        assert!(counts("agree").iter().zip(counts("compared")).all(|(agree, all)| agree * 100 >= all * 99), "{scene}");
    }
}
