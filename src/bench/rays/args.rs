//! Command-line arguments of `skylit bench rays`.

use clap::{Args, ValueHint};

use super::contestant::KERNELS;
use super::streams::STREAMS;
use crate::bench::common::CommonArgs;
use crate::bench::session::BenchSession;
use crate::settings::parse::parse_radius;
use crate::tracer::BuildOptions;
use crate::tracer::settings::BuildChoice;

/// Default rays of a set, of an image; and with `--quick`.
const RAYS: [u32; 2] = [1280 * 720, 320 * 180];
/// Default timed repeats, and with `--quick`.
const REPEATS: [u32; 2] = [7, 3];

const EXAMPLES: &str = "\
Examples:
  skylit bench rays --quick                              # does everything work?
  skylit bench rays scene.glb --plot rays.svg --json rays.json
  skylit bench rays --baseline rays.json                 # is anything slower than then?
  skylit bench rays --edges --rays 10000000              # does anything get through closed meshes?";

/// `skylit bench rays`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXAMPLES)]
pub struct BenchRaysArgs {
    /// Scenes, as `render` takes them [default: well-known and built-in ones]
    ///
    /// The default is the well-known scenes that are available, and built-in ones of 10^4 to
    /// 2.5*10^7 triangles.
    pub scenes: Vec<String>,
    /// Kernels of skylit, separated by commas [default: all that the device supports]
    ///
    /// Slow ones are measured on small scenes only, unless they are named.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = kernel_names())]
    pub kernels: Vec<String>,
    /// Ray streams, separated by commas [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = stream_names())]
    pub streams: Vec<String>,
    /// Timed repeats of each contestant, interleaved, after one warm-up [default: 7; 3 with --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeats: Option<u32>,
    /// Approximate number of rays per set [default: 921600; 57600 with --quick]
    ///
    /// They are one per pixel of a 16:9 image.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(64..=1 << 26))]
    pub rays: Option<u32>,
    /// Build quality of the compute tracer's hierarchies
    #[arg(long, value_enum, default_value = "default")]
    pub build: BuildChoice,
    /// Length of ambient occlusion rays, in scene units [default: by the scene, else unlimited]
    ///
    /// Well-known scenes have suitable lengths by default.
    #[arg(long, value_name = "R", value_parser = parse_radius, allow_hyphen_values = true)]
    pub ao_radius: Option<f64>,
    /// Also compare all hits with those of the first kernel; fail on any difference beyond rounding
    #[arg(long)]
    pub check: bool,
    /// Instead of measuring, send rays at shared edges and vertices, and count leaks
    ///
    /// As many rays as --rays says in all go at edges and vertices of closed meshes through every
    /// contestant. Those that get through are counted, and those whose answers the double-precision
    /// oracle does not explain; any of the compute tracer's fails the run.
    #[arg(long, conflicts_with_all = ["scenes", "streams", "repeats", "baseline", "check", "alpha", "ao_radius"])]
    pub edges: bool,
    /// Keep alpha masks; otherwise they are treated as opaque, because peers do not support them
    #[arg(long)]
    pub alpha: bool,
    /// Peers to compare with: a file, or `none` [default: benches/peers.toml of this version]
    ///
    /// Commands of the file are run. benches/peers.toml in the working folder is taken by default
    /// if it is the one of this version.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub peers: Option<String>,
    /// Options of every benchmark
    #[command(flatten)]
    pub common: CommonArgs,
}

/// A run of `skylit bench rays`.
pub type RaySession<'a> = BenchSession<'a, BenchRaysArgs>;

fn kernel_names() -> clap::builder::PossibleValuesParser {
    KERNELS.iter().map(|o| o.name).collect::<Vec<_>>().into()
}

fn stream_names() -> clap::builder::PossibleValuesParser {
    STREAMS.iter().map(|s| s.name).collect::<Vec<_>>().into()
}

impl BenchRaysArgs {
    /// Build options of skylit's hierarchies.
    pub fn build_options(&self) -> BuildOptions {
        let [width, height] = self.size();
        // a set of rays is traced once more to warm up
        let rays = u64::from(width) * u64::from(height) * (u64::from(self.repeats()) + 1);
        BuildOptions { preset: self.build.preset(), on_device: self.build.on_device(), rays, ..Default::default() }
    }

    /// Timed repeats.
    pub fn repeats(&self) -> u32 {
        self.common.setting(self.repeats, REPEATS)
    }

    /// Rays of all closed meshes together, with [`BenchRaysArgs::edges`].
    pub fn edge_rays(&self) -> usize {
        self.common.setting(self.rays, RAYS) as usize
    }

    /// Pixels of the image whose rays are traced: 16:9, multiples of 8.
    pub fn size(&self) -> [u32; 2] {
        let rays = f64::from(self.common.setting(self.rays, RAYS));
        let side = |x: f64| ((x / 8.0).round() as u32).max(1) * 8;
        let width = side((rays * 16.0 / 9.0).sqrt());
        // exactly the requested number where the factors allow it
        let height = (rays / f64::from(width)).round() as u32;
        [width, height.max(1)]
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::accel::BuildPreset;
    use crate::settings::parse::parse_args;

    fn parse(extra: &[&str]) -> BenchRaysArgs {
        parse_args(extra).unwrap()
    }

    #[test]
    fn sizes_are_those_of_images() {
        assert_eq!(parse(&[]).size(), [1280, 720]);
        assert_eq!(parse(&["--quick"]).size(), [320, 180]);
        assert_eq!((parse(&[]).repeats(), parse(&["--quick"]).repeats()), (7, 3));
        for n in [64u32, 1000, 10_000, 1_000_000] {
            let [w, h] = parse(&["--rays", &n.to_string()]).size();
            assert!((f64::from(w * h) / f64::from(n) - 1.0).abs() < 0.2, "{n}: {w}x{h}");
        }
    }

    #[test]
    fn hierarchies_are_built_as_asked() {
        let built = |extra: &[&str]| parse(extra).build_options();
        assert_eq!(built(&[]).preset, Some(BuildPreset::Default));
        assert_eq!(built(&["--build", "best"]).preset, Some(BuildPreset::Best));
        let auto = built(&["--build", "auto", "--repeats", "9"]);
        assert_eq!((auto.preset, auto.rays), (None, 1280 * 720 * 10));
    }

    #[test]
    fn json_with_and_without_a_file() {
        assert!(parse(&["--json"]).common.outputs.console().json);
        let to_file = parse(&["--json=a.json", "scene"]);
        assert!(
            !to_file.common.outputs.console().json
                && to_file.common.outputs.json_file().is_some()
                && to_file.scenes == ["scene"]
        );
        assert_eq!(parse(&["--json", "A.JSON", "scene"]).common.outputs.json_file().unwrap(), Path::new("A.JSON"));
        // a record takes no scene's place
        let refused = parse_args::<BenchRaysArgs>(&["--json", "scene.glb"]).unwrap_err();
        assert!(refused.to_string().contains("ends in .json"));
    }
}
