//! Many frames: nothing drifts, nothing grows, nothing breaks. They run in a process of their own, whose memory is nobody else's.

use std::process::Command;

use glam::DVec3;
use skylit::measure::temporal::Drift;
use skylit::realtime::Preset;

use crate::common::{assert_validation_clean, device, picked, scene, tracer};
use crate::{assert_sound, mean, realtime, stepped, traced};

const FRAMES: &str = "SKYLIT_TEST_FRAMES";
/// Frames after which the camera is where it was.
const TURN: u32 = 20;

/// Bytes of this process's memory; `None` where the system does not say.
fn resident() -> Option<u64> {
    let pages = std::fs::read_to_string("/proc/self/statm").ok()?;
    Some(pages.split_whitespace().nth(1)?.parse::<u64>().ok()? * 4096)
}

/// A few hundred frames of every tracer.
#[test]
fn gpu_hundreds_of_frames_stay_level() {
    let out = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "long_run::gpu_ten_thousand_frames_stay_level", "--ignored", "--nocapture"])
        .env(FRAMES, "400")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&out.stdout);
    print!("{said}");
    assert!(out.status.success() && said.contains("1 passed"), "{}", String::from_utf8_lossy(&out.stderr));
}

#[test]
#[ignore = "10,000 frames of each tracer: two minutes on two cores"]
fn gpu_ten_thousand_frames_stay_level() {
    let count: u32 = std::env::var(FRAMES).map_or(10_000, |n| n.parse().unwrap());
    let device = device();
    let scene = scene("stairs");
    let size = [16, 9];
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        let mut realtime = realtime(&tracer, size, &traced(Preset::Fast));
        let (mut level, mut turn, mut first) = (Vec::new(), Vec::new(), None);
        for frame in 0..count {
            // to and fro
            let phase = f64::from(frame % TURN) / f64::from(TURN) * std::f64::consts::TAU;
            let camera = stepped(&scene, size, DVec3::new(0.3, 0.1, 0.0) * phase.sin());
            realtime.frame(&tracer, &camera, &[]).unwrap();
            assert_sound(&format!("{kind}, frame {frame}"), &realtime);
            turn.push(mean(realtime.result().unwrap().into_iter().map(f64::from)));
            if turn.len() == TURN as usize {
                level.push(mean(turn.drain(..)));
            }
            if frame == count / 4 {
                first = resident();
            }
        }
        // histories have filled up
        let drift = Drift::from_values(&level[4..]).unwrap();
        println!("{kind}: {drift:?} over {} turns of {TURN} frames", level.len() - 4);
        assert!(drift.is_level(), "{kind}: {drift:?}");
        // and what a slope of ever so little error would come to
        assert!((drift.slope * level.len() as f64).abs() < 0.01, "{kind}: {drift:?}");
        if let (Some(a), Some(b)) = (first, resident()) {
            // the device's memory is the process's on CPU drivers, whose own caches come and go; a buffer of a frame would be more
            let frames = u64::from(count - count / 4);
            println!("{kind}: {} KiB more after {frames} frames", b.saturating_sub(a) / 1024);
            assert!(b.saturating_sub(a) < (4 << 20) + 256 * frames, "{kind}: from {a} to {b} bytes in {frames} frames");
        }
    }
    assert_validation_clean(&device);
}
