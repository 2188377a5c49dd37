//! The sampler: known answers, agreement with direction numbers, stratification, independence; and the warps.

use skylit::sampling::sobol::*;
use skylit::sampling::warp::*;

/// The second dimension by direction numbers: the recurrence of Joe and Kuo for the polynomial x + 1 with m_1 = 1.
fn second_dimension(index: u32) -> u32 {
    let mut v = 1u32 << 31;
    let mut x = 0;
    for bit in 0..32 {
        if index >> bit & 1 == 1 {
            x ^= v;
        }
        v ^= v >> 1;
    }
    x
}

#[test]
fn sobol_matches_direction_numbers() {
    for i in 0..1u32 << 16 {
        for index in [i, i << 16, i.wrapping_mul(0x9e37_79b9)] {
            assert_eq!(sobol_2d(index), [index.reverse_bits(), second_dimension(index)], "index {index:#x}");
        }
    }
}

/// Are there exactly `2^(k-a-b)` of the `2^k` points in each box of 2^-a by 2^-b?
fn is_net(points: &[[u32; 2]]) -> bool {
    let k = points.len().trailing_zeros();
    (0..=k).all(|a| {
        let mut seen = vec![false; points.len()];
        points.iter().all(|p| {
            let cell = ((p[0] as u64 >> (32 - a)) << (k - a) | p[1] as u64 >> (32 - (k - a))) as usize;
            !std::mem::replace(&mut seen[cell], true)
        })
    })
}

#[test]
fn scrambled_points_are_nets_in_every_pixel_and_dimension() {
    for k in 0..=10 {
        for pixel in [[0, 0], [1, 0], [0, 1], [640, 359], [16383, 16383]] {
            for dimension in 0..4 {
                let sampler = Sampler { seed: 7 };
                let points: Vec<_> = (0..1u32 << k).map(|i| sampler.get_2d(pixel, i, dimension)).collect();
                assert!(is_net(&points), "first 2^{k} points of {pixel:?}, {dimension}");
                // the sequence is progressive: the next 2^k are a net too
                let points: Vec<_> = (1u32 << k..2 << k).map(|i| sampler.get_2d(pixel, i, dimension)).collect();
                assert!(is_net(&points), "second 2^{k} points of {pixel:?}, {dimension}");
            }
        }
    }
    assert!(!is_net(&[[0, 0], [1, 1]]), "the judge can say no");
}

/// They are nets like the others, and the first numbers of the first 2^k are 2^-k apart, all of them.
#[test]
fn choices_are_nets_and_evenly_spaced() {
    for k in 0..=10 {
        for (pixel, dimension) in [([0, 0], 0), ([640, 359], 2), ([16383, 16383], 5)] {
            let sampler = Sampler { seed: 9 };
            let points: Vec<_> = (0..1u32 << k).map(|i| sampler.get_choice_2d(pixel, i, dimension)).collect();
            assert!(is_net(&points), "first 2^{k} choices of {pixel:?}, {dimension}");
            let mut first: Vec<u32> = points.iter().map(|p| p[0]).collect();
            first.sort_unstable();
            assert!(
                first.windows(2).all(|w| u64::from(w[1] - w[0]) == 1u64 << (32 - k)),
                "{pixel:?}, {dimension}: {first:?}"
            );
        }
    }
    // those of pixels are shifted against each other, uniformly
    let (n, sampler) = (4096, Sampler { seed: 1 });
    let mean: f64 =
        (0..n).map(|x| f64::from(to_unit(sampler.get_choice_2d([x, 3], 0, 2)[0]))).sum::<f64>() / f64::from(n);
    assert!((mean - 0.5).abs() < 4.0 * (1.0 / 12.0 / f64::from(n)).sqrt(), "{mean}");
}

#[test]
fn first_points_are_uniform_and_independent_between_pixels_and_dimensions() {
    // Over many pixels the first sample must be uniform, and uncorrelated with its neighbour, with the other coordinate, with
    // the next sample's first coordinate beyond stratification, and with other dimensions.
    let n = 256u32;
    let unit = |sampler: Sampler, x, y, i, d| sampler.get_2d([x, y], i, d).map(|v| v as f64 / 4294967296.0 - 0.5);
    type Other = fn(u32, u32) -> (u32, u32, u32, u32, u32);
    let others: [(&str, Other); 5] = [
        ("right", |x, y| (x + 1, y, 0, 2, 1)),
        ("below", |x, y| (x, y + 1, 0, 2, 1)),
        ("transposed", |x, y| (y, x + 300, 0, 2, 1)),
        ("dimension", |x, y| (x, y, 0, 3, 1)),
        ("seed", |x, y| (x, y, 0, 2, 2)),
    ];
    let count = (n * n) as f64;
    for (name, other) in others {
        let (mut mean, mut own, mut cross) = ([0.0; 2], 0.0, [[0.0; 2]; 2]);
        for y in 0..n {
            for x in 0..n {
                let a = unit(Sampler { seed: 1 }, x, y, 0, 2);
                let (x2, y2, i2, d2, seed) = other(x, y);
                let b = unit(Sampler { seed }, x2, y2, i2, d2);
                own += a[0] * a[1];
                for i in 0..2 {
                    mean[i] += a[i];
                    for j in 0..2 {
                        cross[i][j] += a[i] * b[j];
                    }
                }
            }
        }
        // 4.5 standard errors: of the mean 1/sqrt(12 n), of a product of independent terms 1/(12 sqrt n)
        let (mean_limit, product_limit) = (4.5 / (12.0 * count).sqrt(), 4.5 / (12.0 * count.sqrt()));
        assert!(mean.iter().all(|m| (m / count).abs() < mean_limit), "{name}: mean {mean:?}");
        assert!((own / count).abs() < product_limit, "{name}: x against y {own}");
        assert!(cross.iter().flatten().all(|c| (c / count).abs() < product_limit), "{name}: {cross:?}");
    }
}

#[test]
fn owen_scramble_keeps_the_tree() {
    // two numbers that share exactly k leading bits still do after scrambling
    for i in 0..2000u32 {
        let (a, b, seed) = (hash(i), hash(i ^ 0x5bd1), hash(i + 99));
        for shift in 0..32 {
            let b = a ^ (b | 1 << 31) >> shift;
            let lead = (a ^ b).leading_zeros();
            assert_eq!((owen_scramble(a, seed) ^ owen_scramble(b, seed)).leading_zeros(), lead);
        }
    }
}

#[test]
fn to_unit_stays_below_one() {
    assert_eq!(to_unit(0), 0.0);
    assert_eq!(to_unit(1 << 31), 0.5);
    assert_eq!(to_unit(u32::MAX), 1.0 - 1.0 / 16_777_216.0);
}

#[test]
fn known_answers() {
    for (x, want) in HASH_GOLDEN {
        assert_eq!(hash(x), want, "hash({x:#x})");
    }
    for ((x, seed), want) in SCRAMBLE_GOLDEN {
        assert_eq!(owen_scramble(x, seed), want, "owen_scramble({x:#x}, {seed:#x})");
    }
    for ((seed, pixel, index, dimension), want) in SAMPLE_GOLDEN {
        assert_eq!(Sampler { seed }.get_2d(pixel, index, dimension), want, "{seed} {pixel:?} {index} {dimension}");
    }
}

#[test]
fn sine_and_cosine_are_accurate() {
    let worst = (-100_000..=100_000i32)
        .map(|i| {
            let x = std::f32::consts::FRAC_PI_4 * i as f32 / 100_000.0;
            let (s, c) = (sin_quarter(x) as f64, cos_quarter(x) as f64);
            (s - (x as f64).sin()).abs().max((c - (x as f64).cos()).abs())
        })
        .fold(0.0, f64::max);
    println!("worst error of the polynomials: {worst:.2e}");
    assert!(worst <= 1e-7, "{worst}");
}

fn grid(n: u32) -> impl Iterator<Item = [f32; 2]> {
    (0..n * n).map(move |i| [((i % n) as f32 + 0.5) / n as f32, ((i / n) as f32 + 0.5) / n as f32])
}

/// Mean of `f` over an n by n grid of midpoints.
fn mean(n: u32, f: impl Fn([f32; 2]) -> f64) -> f64 {
    grid(n).map(f).sum::<f64>() / (n * n) as f64
}

#[test]
fn disk_preserves_area() {
    // moments of the uniform disk: E[r^2] = 1/2, E[x] = 0, E[x^2] = 1/4, and a quarter of the points within half the radius
    let disk = |u| concentric_disk(u).map(f64::from);
    assert!((mean(512, |u| disk(u)[0].powi(2) + disk(u)[1].powi(2)) - 0.5).abs() < 1e-5);
    assert!((mean(512, |u| disk(u)[0].powi(2)) - 0.25).abs() < 1e-5);
    assert!(mean(512, |u| disk(u)[0]).abs() < 1e-6 && mean(512, |u| disk(u)[1]).abs() < 1e-6);
    assert!((mean(512, |u| (disk(u)[2].abs() < 0.5) as u8 as f64) - 0.25).abs() < 1e-3);
    assert_eq!(concentric_disk([0.5, 0.5]), [0.0; 3]);
    for u in [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.25, 0.75], [0.5, 0.0], [0.0, 0.5]] {
        let d = disk(u);
        assert!((d[0].hypot(d[1]) - d[2].abs()).abs() < 2e-7, "{u:?} {d:?}");
    }
}

#[test]
fn hemispheres_have_their_densities() {
    // cosine: E[z] = 2/3, E[z^2] = 1/2; uniform: E[z] = 1/2, E[z^2] = 1/3; both unit length, and the densities integrate to 1
    let z = |v: [f32; 3]| v[2] as f64;
    // the square root at the horizon costs the midpoint rule some accuracy
    assert!((mean(512, |u| z(cosine_hemisphere(u))) - 2.0 / 3.0).abs() < 5e-5);
    assert!((mean(512, |u| z(cosine_hemisphere(u)).powi(2)) - 0.5).abs() < 1e-5);
    assert!((mean(512, |u| z(uniform_hemisphere(u))) - 0.5).abs() < 1e-5);
    assert!((mean(512, |u| z(uniform_hemisphere(u)).powi(2)) - 1.0 / 3.0).abs() < 1e-5);
    let ratio = mean(512, |u| (cosine_hemisphere_pdf(uniform_hemisphere(u)[2]) / UNIFORM_HEMISPHERE_PDF) as f64);
    assert!((ratio - 1.0).abs() < 1e-5, "{ratio}");
    for u in grid(100).chain([[0.0, 0.0], [0.0, 0.3], [0.5, 0.5]]) {
        for v in [cosine_hemisphere(u), uniform_hemisphere(u)] {
            let length = v.iter().map(|x| (*x as f64).powi(2)).sum::<f64>().sqrt();
            assert!((length - 1.0).abs() < 3e-7 && v[2] >= 0.0, "{u:?} {v:?}");
        }
    }
}

#[test]
fn basis_is_orthonormal_everywhere() {
    let dot = |a: [f32; 3], b: [f32; 3]| (0..3).map(|i| a[i] as f64 * b[i] as f64).sum::<f64>();
    let poles = [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [1.0, 0.0, -0.0], [1e-4, 0.0, -1.0]];
    let around = grid(64).flat_map(|u| {
        let v = uniform_hemisphere(u);
        [v, v.map(|x| -x)]
    });
    for n in around.chain(poles) {
        let (s, t) = orthonormal_basis(n);
        for (a, b, want) in [(s, s, 1.0), (t, t, 1.0), (s, t, 0.0), (s, n, 0.0), (t, n, 0.0)] {
            assert!((dot(a, b) - want).abs() < 1e-6, "{n:?}");
        }
        let cross = [s[1] * t[2] - s[2] * t[1], s[2] * t[0] - s[0] * t[2], s[0] * t[1] - s[1] * t[0]];
        assert!(dot(cross, n) > 0.999, "right-handed around {n:?}");
    }
    assert_eq!(to_world([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]), [0.0, 1.0, 0.0]);
}

// From an independent implementation in Python, with the direction numbers in place of the butterfly.
const HASH_GOLDEN: [(u32, u32); 5] =
    [(0, 0x0000_0000), (1, 0x6889_90c0), (2, 0xd113_2181), (0x8000_0000, 0xcc4b_4124), (u32::MAX, 0x6768_824a)];

const SCRAMBLE_GOLDEN: [((u32, u32), u32); 4] = [
    ((0x0000_0000, 0x0000_0000), 0x0000_0000),
    ((0x0000_0000, 0x0000_0001), 0xd5a1_fe3d),
    ((0x8000_0000, 0x1234_5678), 0x87e3_2b06),
    ((0xdead_beef, 0xcafe_f00d), 0x4591_8a04),
];

type Key = (u32, [u32; 2], u32, u32);
const SAMPLE_GOLDEN: [(Key, [u32; 2]); 10] = [
    ((0, [0, 0], 0, 0), [0x7446_c19e, 0xfc73_c841]),
    ((0, [0, 0], 1, 0), [0xdaaa_093e, 0x6742_d439]),
    ((0, [0, 0], 0, 1), [0xdbf9_66d2, 0x8539_5a91]),
    ((1, [0, 0], 0, 0), [0xdcbb_25ec, 0xde18_5bca]),
    ((0, [1, 0], 0, 0), [0xcca2_1d8e, 0x98d2_c001]),
    ((0, [0, 1], 0, 0), [0x83e3_76b3, 0x3cd8_ee21]),
    ((1, [640, 360], 15, 2), [0x380a_fd5f, 0xdd00_fb49]),
    ((42, [1919, 1079], 255, 2), [0x7655_dae4, 0x84be_b607]),
    ((0xffff_ffff, [16383, 16383], 65535, 31), [0xc059_5953, 0x4d92_e1a9]),
    ((12345, [7, 11], 0x8000_0001, 8), [0x0897_56cd, 0xe3d5_ffe8]),
];
