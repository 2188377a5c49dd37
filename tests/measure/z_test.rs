//! The Z-test of images: how often it raises a false alarm over noise of many kinds, and what it finds.

use skylit::measure::z_test::{Estimate, Reference, Region, Scale, ZTest, score};

const SIZE: [usize; 2] = [32, 24];
const REPLICATES: usize = 32;

struct Random(u64);

impl Random {
    /// Uniform in [0, 1).
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = ((self.0 >> 22) ^ self.0) >> (22 + (self.0 >> 61));
        (x as u32) as f64 / 4_294_967_296.0
    }
}

/// A sample of a pixel from two uniform numbers.
type Sample = fn(pixel: usize, u: f64, v: f64) -> f64;

/// Ambient occlusion: open or not, in part of the image never, in part always.
fn binary(p: usize, u: f64, _: f64) -> f64 {
    f64::from(u8::from(u < (p % SIZE[0]) as f64 / 28.0))
}

/// Hardly any pixel is occluded, and those seldom.
fn rare(p: usize, u: f64, _: f64) -> f64 {
    f64::from(u8::from(u > if p.is_multiple_of(7) { 0.003 } else { 0.0 }))
}

/// Smooth shading with some noise.
fn smooth(p: usize, u: f64, v: f64) -> f64 {
    0.2 + 0.01 * (p % SIZE[0]) as f64 + 0.3 * u * v
}

/// A light that paths seldom find: a sample in 2,000 is 300 times as bright as others.
fn fireflies(_: usize, u: f64, v: f64) -> f64 {
    if u < 0.0005 { 90.0 * v } else { 0.3 + 0.2 * v }
}

/// A tail without a variance: Pareto's distribution with index 1.8.
fn heavy(_: usize, u: f64, _: f64) -> f64 {
    (1.0 - u).powf(-1.0 / 1.8)
}

const NOISES: [(&str, Sample); 5] =
    [("binary", binary), ("rare", rare), ("smooth", smooth), ("fireflies", fireflies), ("heavy", heavy)];

/// A render: `strata` of samples of a pixel are in strata of their own, as a low-discrepancy sequence has them.
fn render(sample: Sample, count: usize, stratified: bool, seed: u64) -> Estimate {
    let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x1234_5678);
    for _ in 0..8 {
        random.uniform();
    }
    let pixels = SIZE[0] * SIZE[1];
    let mut out = Estimate { size: SIZE, channels: 1, samples: vec![count as f64; pixels], ..Estimate::default() };
    for p in 0..pixels {
        let (mut sum, mut squares) = (0.0, 0.0);
        for s in 0..count {
            let (u, v) = (random.uniform(), random.uniform());
            let x = sample(p, if stratified { (s as f64 + u) / count as f64 } else { u }, v);
            (sum, squares) = (sum + x, squares + x * x);
        }
        let n = count as f64;
        out.mean.push(sum / n);
        out.variance.push(((squares - sum * sum / n) / (n - 1.0)).max(0.0));
    }
    out
}

fn reference(sample: Sample, count: usize, stratified: bool, seed: u64) -> Reference {
    let renders: Vec<_> = (0..REPLICATES as u64).map(|r| render(sample, count, stratified, seed + r)).collect();
    Reference::new(&renders).unwrap()
}

#[test]
fn false_alarms_are_as_rare_as_stated() {
    const RUNS: u64 = 400;
    const GOLDENS: u64 = 10;
    for (name, sample) in NOISES {
        for stratified in [false, true] {
            let mut alarms = [0u64; 3];
            let rates = [0.1, 0.02, 0.002];
            for golden in 0..GOLDENS {
                let seed = 1 + 1_000_000 * golden;
                let known = reference(sample, 16, stratified, seed);
                for run in 0..RUNS / GOLDENS {
                    let image = render(sample, 16, stratified, seed + 1000 + run);
                    let p = ZTest { false_alarms: 0.01 }.compare(&image, &known).unwrap().p;
                    for (alarms, rate) in alarms.iter_mut().zip(rates) {
                        *alarms += u64::from(p < rate);
                    }
                }
            }
            println!("{name}, stratified {stratified}: {alarms:?} of {RUNS} below {rates:?}");
            for (alarms, rate) in alarms.into_iter().zip(rates) {
                let expected = rate * RUNS as f64;
                // four sigmas of a count
                assert!(
                    alarms as f64 <= expected + 4.0 * expected.sqrt() + 1.0,
                    "{name}, {stratified}: {alarms} alarms at {rate}"
                );
            }
        }
    }
}

#[test]
fn what_is_wrong_is_found() {
    let test = ZTest { false_alarms: 1e-4 };
    let known = reference(smooth, 64, true, 1);
    let good = render(smooth, 64, true, 900);
    let verdict = test.compare(&good, &known).unwrap();
    assert!(test.holds(&verdict) && verdict.detectable_bias < 0.005, "{verdict:?}");
    let planted = |change: &dyn Fn(usize, f64) -> f64| {
        let mean = good.mean.iter().enumerate().map(|(p, m)| change(p, *m)).collect();
        let verdict = test.compare(&Estimate { mean, ..good.clone() }, &known).unwrap();
        assert!(!test.holds(&verdict), "{verdict:?}");
        *verdict.extremes.iter().min_by(|a, b| a.p.total_cmp(&b.p)).unwrap()
    };
    let bias = planted(&|_, m| 1.005 * m);
    assert_eq!(bias.scale, Scale::Mean);
    assert!((bias.difference / bias.reference - 0.005).abs() < 0.001, "{bias:?}");
    let pixel = planted(&|p, m| if p == 5 * SIZE[0] + 7 { 1.5 * m } else { m });
    assert_eq!((pixel.scale, pixel.at), (Scale::Pixel, [7, 5]));
    // a twentieth of a tile's mean
    let tile = planted(&|p, m| if p % SIZE[0] / 8 == 2 && p / SIZE[0] / 8 == 1 { 1.05 * m } else { m });
    assert_eq!((tile.scale, tile.at), (Scale::Tile, [16, 8]));
    // the row above
    planted(&|p, _| good.mean[if p % SIZE[0] == 0 { p } else { p - 1 }]);
}

#[test]
fn images_that_are_not_finite_or_not_alike() {
    let known = reference(binary, 16, false, 1);
    let mut image = render(binary, 16, false, 77);
    let before = ZTest { false_alarms: 0.01 }.compare(&image, &known).unwrap();
    image.mean[100] = f64::NAN;
    let after = ZTest { false_alarms: 0.01 }.compare(&image, &known).unwrap();
    assert!(after.p.is_finite() && (after.bias - before.bias).abs() < 0.01, "{after:?}");
    let small = Estimate { size: [16, 48], ..image };
    assert!(ZTest { false_alarms: 0.01 }.compare(&small, &known).unwrap_err().to_string().contains("16x48"));
    assert!(Reference::new(std::slice::from_ref(&known.estimate)).unwrap_err().to_string().contains("at least"));
}

#[test]
fn regions_cover_an_image() {
    let tiles = Region::tiles([20, 9], 8);
    assert_eq!(tiles.len(), 6);
    let mut seen = vec![0; 180];
    tiles.iter().flat_map(|t| t.pixels(20)).for_each(|p| seen[p] += 1);
    assert!(seen.iter().all(|n| *n == 1));
    assert_eq!(tiles[5], Region { first: [16, 8], size: [4, 1] });
    assert_eq!(score(0.0, 0.0, 0.0), 0.0);
    assert_eq!(score(3.0, 1.0, 0.0), 3.0);
    assert!((score(5.0, 9.0, 4.0) - 1.0).abs() < 1e-12);
}
