//! How often does `skylit verify` call an image different of which only the seed is another? Renders frames with a Z-test many times, each with another seed.
//!
//!     cargo run --release --example false_alarms -- tests/frames ao-cornell-box,path-cornell-box [RUNS] [SIZE] [SPP]
//!
//! Two rates for each frame: against its golden image in the folder, where that is for the size and the samples asked for, and against golden images that are
//! made of the renders themselves, 32 at random for each render. docs/notebook/2026-11-23-false-alarms.md has the result of 1,000 runs.

use std::path::Path;

use skylit::film::NoControl;
use skylit::measure::z_test::{Estimate, Reference, ZTest, ZTestVerdict};
use skylit::output::parse_size;
use skylit::tracer::DeviceSettings;
use skylit::verify::golden::{Golden, REPLICATES};
use skylit::verify::manifest::Manifest;
use skylit::verify::session::VerifySession;
use skylit::{Error, Result};

/// Rates of false alarms that are looked at.
const RATES: [f64; 5] = [0.1, 0.05, 0.01, 1e-3, 1e-4];

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let usage = || Error::Usage("false_alarms FOLDER FRAME,FRAME... [RUNS] [WxH] [SPP]".into());
    let [folder, names, rest @ ..] = &arguments[..] else { return Err(usage()) };
    let runs: usize = rest.first().map_or(Ok(1000), |n| n.parse()).map_err(|_| usage())?;
    let size = rest.get(1).map(|s| parse_size(s)).transpose().map_err(Error::Usage)?;
    let spp: Option<u32> = rest.get(2).map(|n| n.parse()).transpose().map_err(|_| usage())?;
    let manifest = Manifest::load(Path::new(folder))?;
    let mut session = VerifySession::open(&manifest, &DeviceSettings::default())?;
    println!("frame | golden image | runs | below {}", RATES.map(|r| r.to_string()).join(" | "));
    for name in names.split(',') {
        let mut frame = manifest.frames.iter().find(|f| f.name == name).cloned().ok_or_else(usage)?;
        let changed = size.is_some() || spp.is_some();
        frame.settings.image.size = size.or(frame.settings.image.size);
        frame.settings.image.spp = spp.or(frame.settings.image.spp);
        let (kind, _) = skylit::tracer::TracerKind::auto(session.info());
        let mut estimates = Vec::new();
        for seed in 0..runs as u32 {
            estimates.push(Estimate::from_image(&session.render(&frame, kind, Some(seed), None, &mut NoControl)?)?);
        }
        if !changed {
            let golden = Golden::load(&manifest.golden(&frame))?;
            let reference = golden.reference.as_ref().ok_or_else(|| Error::Usage(format!("{name} has no Z-test")))?;
            report(name, "of the folder", estimates.iter().map(|e| compare(e, reference)).collect::<Result<_>>()?);
        }
        let mut random = Random(1);
        let mut verdicts = Vec::new();
        for (k, estimate) in estimates.iter().enumerate() {
            let mut chosen = Vec::new();
            while chosen.len() < REPLICATES as usize {
                let other = random.below(estimates.len());
                if other != k && !chosen.contains(&other) {
                    chosen.push(other);
                }
            }
            let renders: Vec<Estimate> = chosen.iter().map(|&c| estimates[c].clone()).collect();
            verdicts.push(compare(estimate, &Reference::new(&renders)?)?);
        }
        report(name, "another each time", verdicts);
    }
    Ok(())
}

fn compare(image: &Estimate, reference: &Reference) -> Result<ZTestVerdict> {
    ZTest { false_alarms: RATES[4] }.compare(image, reference)
}

fn report(name: &str, golden: &str, verdicts: Vec<ZTestVerdict>) {
    let below = |p: fn(&ZTestVerdict) -> f64| {
        RATES.map(|r| verdicts.iter().filter(|v| p(v) < r).count().to_string()).join(" | ")
    };
    println!("{name} | {golden} | {} | {}", verdicts.len(), below(|v| v.p));
    // of each scale: where alarms come from
    println!("  pixels | | | {}", below(|v| v.extremes[0].p));
    println!("  tiles | | | {}", below(|v| v.extremes[1].p));
    println!("  mean | | | {}", below(|v| v.extremes[2].p));
    let worst = verdicts.iter().min_by(|a, b| a.p.total_cmp(&b.p));
    println!("  least: {worst:?}");
}

/// A linear congruential generator: which golden images are made of which renders.
struct Random(u64);

impl Random {
    fn below(&mut self, count: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) % count as u64) as usize
    }
}
