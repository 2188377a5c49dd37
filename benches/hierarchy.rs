//! Time to build hierarchies on the host: `cargo bench --bench hierarchy`. Throughput is primitives a second.
//!
//! Tracing is timed on a device, by `skylit rays --repeats N --json` on any mesh and ray set.

use divan::Bencher;
use divan::counter::ItemsCount;
use glam::Vec3;
use skylit::bvh::{Aabb, BuildPreset, Bvh2, Wide, build};

fn main() {
    divan::main();
}

/// A bumpy surface of n small boxes: what a scanned mesh looks like to a builder.
fn surface(n: usize) -> Vec<Aabb> {
    let edge = (n as f32).sqrt();
    (0..n)
        .map(|i| {
            let (x, y) = (i as f32 % edge, (i as f32 / edge).floor());
            let c = Vec3::new(x, y, 20.0 * (x * 0.05).sin() * (y * 0.03).cos());
            Aabb { min: c - 0.7, max: c + 0.7 }
        })
        .collect()
}

const SIZES: [usize; 3] = [10_000, 100_000, 1_000_000];

#[divan::bench(args = SIZES, sample_count = 5, sample_size = 1)]
fn wide(bencher: Bencher, n: usize) {
    let boxes = surface(n);
    bencher
        .counter(ItemsCount::new(n))
        .bench(|| Wide::collapse(&build::tree(&boxes, BuildPreset::Default, None), |item| [item; 16]));
}

#[divan::bench(args = SIZES, sample_count = 5, sample_size = 1)]
fn binary(bencher: Bencher, n: usize) {
    let boxes = surface(n);
    bencher.counter(ItemsCount::new(n)).bench(|| Bvh2::build(&boxes, BuildPreset::Default, 4));
}
