//! FLIP against answers by hand and against a slow implementation that shares no code with it.

use skylit::measure::flip::{Flip, PIXELS_PER_DEGREE, flip, pixels_per_degree};
use skylit::measure::metrics::ImagePair;

fn of(image: &[f32], reference: &[f32], channels: usize, width: usize) -> Flip {
    flip(&ImagePair::new(image, reference, channels, None).unwrap(), width, PIXELS_PER_DEGREE).unwrap()
}

/// Numbers in [0, 1) that repeat.
fn noise(count: usize, seed: u32) -> Vec<f32> {
    let mut state = seed;
    let next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    std::iter::repeat_with(next).take(count).collect()
}

/// A scene of sorts: ramps, an edge, a disc, single bright pixels; `shift` moves the disc and the edge.
fn picture(width: usize, height: usize, shift: f32) -> Vec<f32> {
    let mut pixels = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let (u, v) = (x as f32 / width as f32, y as f32 / height as f32);
            let disc = (u - 0.6 - shift).hypot(v - 0.4) < 0.2;
            let edge = u + 0.3 * v > 0.7 + shift;
            let spark = (x * 7 + y * 13) % 97 == 0;
            let mut rgb = if disc { [0.8, 0.2 + 0.3 * v, 0.1] } else { [0.2 * u, 0.3, 0.5 * v] };
            if edge {
                rgb = [rgb[0] * 0.3, rgb[1] * 0.5, rgb[2] + 0.3];
            }
            pixels.extend(if spark { [1.0, 1.0, 0.9] } else { rgb });
        }
    }
    pixels
}

#[test]
fn viewing_conditions() {
    assert!((pixels_per_degree(0.7, 0.7, 3840.0) - PIXELS_PER_DEGREE).abs() < 1e-12);
    assert!((PIXELS_PER_DEGREE - 67.0206).abs() < 1e-4);
}

#[test]
fn equal_images_look_equal() {
    for channels in [1, 3] {
        let image = noise(50 * 70 * channels, 1);
        let same = of(&image, &image, channels, 50);
        assert!(same.mean == 0.0 && same.map.iter().all(|e| *e == 0.0));
    }
}

/// Black against white has no features, so the error is that of the colours. L* differs by 100, a* and b* not at all:
/// 100^0.7 = 25.119. Green is L* = 87.735, a* = -86.183, b* = 83.180, adjusted -75.613 and 72.977; blue 32.302, 79.196 and
/// -107.864, adjusted 25.582 and -34.842. Their HyAB distance is 55.43 + hypot(101.19, 107.82) = 203.30, to the power of 0.7
/// 41.28, of which 0.4 are 16.51: the error is 0.95 + 0.05 (25.119 - 16.51) / (41.28 - 16.51) = 0.9674.
#[test]
fn black_against_white() {
    for channels in [1, 3] {
        let (black, white) = (vec![0.0; 40 * 40 * channels], vec![1.0; 40 * 40 * channels]);
        let found = of(&black, &white, channels, 40);
        assert!((found.mean - 0.9674).abs() < 1e-4, "{channels}: {}", found.mean);
        assert!(found.map.iter().all(|e| (f64::from(*e) - found.mean).abs() < 1e-4));
    }
    // green against blue is the greatest difference there is
    let fill = |rgb: [f32; 3]| rgb.repeat(40 * 40);
    let greatest = of(&fill([0.0, 1.0, 0.0]), &fill([0.0, 0.0, 1.0]), 3, 40).mean;
    assert!((greatest - 1.0).abs() < 1e-5, "{greatest}");
}

#[test]
fn grey_is_the_colour_of_equal_channels() {
    let (a, b) = (noise(60 * 90, 3), noise(60 * 90, 4));
    let spread = |v: &[f32]| v.iter().flat_map(|&v| [v; 3]).collect::<Vec<_>>();
    let (grey, colour) = (of(&a, &b, 1, 60), of(&spread(&a), &spread(&b), 3, 60));
    let worst = grey.map.iter().zip(&colour.map).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn grows_with_the_difference_whichever_comes_first() {
    let truth = picture(64, 48, 0.0);
    let grain = noise(truth.len(), 5);
    let mut last = 0.0;
    for strength in [0.01, 0.03, 0.1, 0.3] {
        let noisy: Vec<f32> =
            truth.iter().zip(&grain).map(|(v, n)| (v + strength * (n - 0.5)).clamp(0.0, 1.0)).collect();
        let (there, back) = (of(&noisy, &truth, 3, 64).mean, of(&truth, &noisy, 3, 64).mean);
        assert!(there > last * 1.2, "{strength}: {there} after {last}");
        assert!((there - back).abs() < 1e-9, "{there} {back}");
        last = there;
    }
    // a feature that is out of place is worse than a faint veil of the same mean square
    let moved = picture(64, 48, 0.05);
    let pair = ImagePair::new(&moved, &truth, 3, None).unwrap();
    let veil: Vec<f32> = truth.iter().map(|v| v + pair.rmse() as f32).collect();
    assert!(of(&moved, &truth, 3, 64).map.iter().copied().fold(0.0, f32::max) > of(&veil, &truth, 3, 64).mean as f32);
}

#[test]
fn coverage_and_broken_values() {
    let (width, truth) = (80, vec![0.5; 80 * 80]);
    let mut image = truth.clone();
    (image[0], image[81]) = (f32::NAN, f32::INFINITY);
    // far from them nothing differs
    let far: Vec<f32> = (0..80 * 80).map(|i| f32::from(u8::from(i % width > 40))).collect();
    let found = flip(&ImagePair::new(&image, &truth, 1, Some(&far)).unwrap(), width, PIXELS_PER_DEGREE).unwrap();
    assert_eq!(found.mean, 0.0);
    assert!(found.map[0].is_nan() && found.map[81].is_nan() && found.map[1] > 0.0);
    assert!(of(&image, &truth, 1, width).mean.is_nan(), "a broken pixel is not averaged away");
    assert!(of(&[], &[], 1, 1).mean.is_nan());
    // what a display cannot show makes no difference
    assert_eq!(of(&[7.0; 64], &[1.0; 64], 1, 8).mean, 0.0);
}

#[test]
fn arguments_are_checked() {
    let pair = |channels| ImagePair::new(&[0.0; 12], &[0.0; 12], channels, None).unwrap();
    assert!(flip(&pair(2), 2, 67.0).is_err());
    assert!(flip(&pair(1), 5, 67.0).is_err() && flip(&pair(1), 0, 67.0).is_err());
    for bad in [0.0, f64::NAN, f64::INFINITY, -67.0] {
        assert!(flip(&pair(3), 2, bad).is_err(), "{bad}");
    }
    assert!(flip(&pair(3), 2, 1.0).is_ok_and(|f| f.mean == 0.0));
}

#[test]
fn agrees_with_the_direct_computation() {
    // more rows than a band, odd sizes, sizes below the reach of the filters
    for (width, height, ppd) in [(37, 141, PIXELS_PER_DEGREE), (65, 9, PIXELS_PER_DEGREE), (5, 3, 30.0), (40, 30, 20.0)]
    {
        let a = picture(width, height, 0.04);
        let mut b = picture(width, height, 0.0);
        b.iter_mut().zip(noise(a.len(), 9)).for_each(|(v, n)| *v = (*v + 0.1 * (n - 0.5)).clamp(0.0, 1.0));
        let fast = flip(&ImagePair::new(&a, &b, 3, None).unwrap(), width, ppd).unwrap();
        let slow = direct::flip(&a, &b, width, height, ppd);
        let worst = fast.map.iter().zip(&slow).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
        let mean = slow.iter().sum::<f64>() / slow.len() as f64;
        println!("{width}x{height}, {ppd:.1}: mean {mean:.6}, worst difference {worst:.1e}");
        assert!(mean > 0.05, "the images differ: {mean}");
        // the root of a feature difference magnifies the rounding of f32 where there is none
        assert!(worst < 1e-4 && (fast.mean - mean).abs() < 1e-5, "{worst:e}, {} and {mean}", fast.mean);
    }
}

/// The paper step by step: double precision, two-dimensional filters, every conversion written out.
mod direct {
    use std::f64::consts::PI;

    type Colour = [f64; 3];
    const M: [Colour; 3] = [
        [10135552.0 / 24577794.0, 8788810.0 / 24577794.0, 4435075.0 / 24577794.0],
        [2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0],
        [1425312.0 / 73733382.0, 8788810.0 / 73733382.0, 70074185.0 / 73733382.0],
    ];

    fn xyz(c: Colour) -> Colour {
        M.map(|m| m[0] * c[0] + m[1] * c[1] + m[2] * c[2])
    }

    /// By Cramer's rule.
    fn rgb(v: Colour) -> Colour {
        let det = |m: [Colour; 3]| {
            m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
                + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
        };
        [0, 1, 2].map(|k| {
            let mut m = M;
            (0..3).for_each(|row| m[row][k] = v[row]);
            det(m) / det(M)
        })
    }

    fn ycxcz(c: Colour) -> Colour {
        let (v, n) = (xyz(c), xyz([1.0; 3]));
        let v = [v[0] / n[0], v[1] / n[1], v[2] / n[2]];
        [116.0 * v[1] - 16.0, 500.0 * (v[0] - v[1]), 200.0 * (v[1] - v[2])]
    }

    fn rgb_of_ycxcz(c: Colour) -> Colour {
        let n = xyz([1.0; 3]);
        let y = (c[0] + 16.0) / 116.0;
        rgb([(y + c[1] / 500.0) * n[0], y * n[1], (y - c[2] / 200.0) * n[2]])
    }

    fn hunt_lab(c: Colour) -> Colour {
        let (v, n) = (xyz(c), xyz([1.0; 3]));
        let d: f64 = 6.0 / 29.0;
        let f = |t: f64| if t > d.powi(3) { t.powf(1.0 / 3.0) } else { t / (3.0 * d * d) + 4.0 / 29.0 };
        let (x, y, z) = (f(v[0] / n[0]), f(v[1] / n[1]), f(v[2] / n[2]));
        let l = 116.0 * y - 16.0;
        [l, 0.01 * l * 500.0 * (x - y), 0.01 * l * 200.0 * (y - z)]
    }

    fn hyab(a: Colour, b: Colour) -> f64 {
        (a[0] - b[0]).abs() + ((a[1] - b[1]).powi(2) + (a[2] - b[2]).powi(2)).sqrt()
    }

    struct Filter {
        radius: i64,
        weights: Vec<f64>,
    }

    impl Filter {
        fn new(radius: i64, f: impl Fn(f64, f64) -> f64) -> Self {
            let side = -radius..=radius;
            let mut weights: Vec<f64> = side
                .clone()
                .flat_map(|y| side.clone().map(move |x| (x, y)))
                .map(|(x, y)| f(x as f64, y as f64))
                .collect();
            let positive: f64 = weights.iter().filter(|w| **w > 0.0).sum();
            let negative: f64 = weights.iter().filter(|w| **w < 0.0).map(|w| -w).sum();
            weights.iter_mut().for_each(|w| *w /= if *w > 0.0 { positive } else { negative.max(1e-300) });
            Self { radius, weights }
        }

        fn apply(&self, value: impl Fn(usize, usize) -> f64, at: [usize; 2], size: [usize; 2]) -> f64 {
            let mut sum = 0.0;
            let mut weights = self.weights.iter();
            let inside = |k: usize, d: i64| (at[k] as i64 + d).clamp(0, size[k] as i64 - 1) as usize;
            for dy in -self.radius..=self.radius {
                for dx in -self.radius..=self.radius {
                    sum += weights.next().unwrap() * value(inside(0, dx), inside(1, dy));
                }
            }
            sum
        }
    }

    struct Seen {
        lab: Colour,
        edge: f64,
        point: f64,
    }

    fn see(image: &[f32], size: [usize; 2], ppd: f64) -> Vec<Seen> {
        let pixels: Vec<Colour> = image.chunks(3).map(|c| ycxcz([0, 1, 2].map(|k| f64::from(c[k])))).collect();
        let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * ppd).ceil() as i64;
        let gauss = |a: f64, b: f64, z: f64| a * (PI / b).sqrt() * (-PI * PI * z / b).exp();
        let z = |x: f64, y: f64| (x * x + y * y) / (ppd * ppd);
        let sensitivity = [
            Filter::new(radius, |x, y| gauss(1.0, 0.0047, z(x, y))),
            Filter::new(radius, |x, y| gauss(1.0, 0.0053, z(x, y))),
            Filter::new(radius, |x, y| gauss(34.1, 0.04, z(x, y)) + gauss(13.5, 0.025, z(x, y))),
        ];
        let s = 0.5 * 0.082 * ppd;
        let radius = (3.0 * s).ceil() as i64;
        let g = |x: f64, y: f64| (-(x * x + y * y) / (2.0 * s * s)).exp();
        let edges = [Filter::new(radius, |x, y| -x * g(x, y)), Filter::new(radius, |x, y| -y * g(x, y))];
        let points = [
            Filter::new(radius, |x, y| (x * x / (s * s) - 1.0) * g(x, y)),
            Filter::new(radius, |x, y| (y * y / (s * s) - 1.0) * g(x, y)),
        ];
        let mut seen = Vec::new();
        for y in 0..size[1] {
            for x in 0..size[0] {
                let blurred = [0, 1, 2].map(|k| sensitivity[k].apply(|x, y| pixels[y * size[0] + x][k], [x, y], size));
                let lab = hunt_lab(rgb_of_ycxcz(blurred).map(|v| v.clamp(0.0, 1.0)));
                let luminance = |x: usize, y: usize| (pixels[y * size[0] + x][0] + 16.0) / 116.0;
                let strength = |filters: &[Filter; 2]| {
                    filters.iter().map(|f| f.apply(luminance, [x, y], size).powi(2)).sum::<f64>().sqrt()
                };
                seen.push(Seen { lab, edge: strength(&edges), point: strength(&points) });
            }
        }
        seen
    }

    pub fn flip(a: &[f32], b: &[f32], width: usize, height: usize, ppd: f64) -> Vec<f64> {
        let greatest = hyab(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0])).powf(0.7);
        let (a, b) = (see(a, [width, height], ppd), see(b, [width, height], ppd));
        a.iter()
            .zip(&b)
            .map(|(a, b)| {
                let d = hyab(a.lab, b.lab).powf(0.7);
                let knee = 0.4 * greatest;
                let colour =
                    if d < knee { 0.95 / knee * d } else { 0.95 + (d - knee) / (greatest - knee) * (1.0 - 0.95) };
                let feature = (a.edge - b.edge).abs().max((a.point - b.point).abs());
                colour.powf(1.0 - (feature / 2f64.sqrt()).sqrt())
            })
            .collect()
    }
}
