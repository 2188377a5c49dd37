//! Time to build hierarchies on the host: `cargo bench --bench hierarchy`. Throughput is primitives a second.
//!
//! Tracing is timed on a device, by `skylit bench rays`.

use divan::Bencher;
use divan::counter::ItemsCount;
use glam::Vec3;
use skylit::accel::wide::Block;
use skylit::accel::{Aabb, BuildPreset, Bvh2, WideBvh, build};

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

/// Up to ten million: time per primitive may grow with the logarithm of their number, no faster.
const SIZES: [usize; 4] = [10_000, 100_000, 1_000_000, 10_000_000];

#[divan::bench(args = SIZES, sample_count = 5, sample_size = 1)]
fn fast(bencher: Bencher, n: usize) {
    let boxes = surface(n);
    bencher.counter(ItemsCount::new(n)).bench(|| build::tree(&boxes, BuildPreset::Fast, None));
}

#[divan::bench(args = SIZES, sample_count = 5, sample_size = 1)]
fn default(bencher: Bencher, n: usize) {
    let boxes = surface(n);
    bencher.counter(ItemsCount::new(n)).bench(|| build::tree(&boxes, BuildPreset::Default, None));
}

/// What there was before, and what others have: PLOC and reinsertion of obvhs.
#[divan::bench(args = SIZES, sample_count = 5, sample_size = 1)]
fn obvhs_medium(bencher: Bencher, n: usize) {
    let boxes = surface(n);
    let params = obvhs::BvhBuildParams { max_prims_per_leaf: 1, ..obvhs::BvhBuildParams::medium_build() };
    let mut time = std::time::Duration::default();
    bencher.counter(ItemsCount::new(n)).bench_local(|| obvhs::bvh2::builder::build_bvh2(&boxes, params, &mut time));
}

#[divan::bench(args = SIZES, sample_count = 5, sample_size = 1)]
fn wide(bencher: Bencher, n: usize) {
    let boxes = surface(n);
    bencher.counter(ItemsCount::new(n)).bench(|| {
        WideBvh::collapse(&build::tree(&boxes, BuildPreset::Default, None), |item| Block {
            body: [item; 15],
            ..Block::default()
        })
    });
}

#[divan::bench(args = SIZES, sample_count = 5, sample_size = 1)]
fn binary(bencher: Bencher, n: usize) {
    let boxes = surface(n);
    bencher.counter(ItemsCount::new(n)).bench(|| Bvh2::build(&boxes, BuildPreset::Default, 4));
}
