//! The filters of FLIP. All of them are products of a filter along x and one along y, or a sum of
//! two such products, and are applied so.

use std::f64::consts::PI;

/// A filter along one axis: an odd number of taps around its middle.
#[derive(Clone, Debug)]
pub struct Kernel(Vec<f32>);

impl Kernel {
    /// Pixels it reaches to either side.
    pub fn radius(&self) -> usize {
        self.0.len() / 2
    }

    fn from_taps(taps: &[f64]) -> Self {
        Self(taps.iter().map(|&v| v as f32).collect())
    }
}

/// All filters for one distance of the eye.
#[derive(Clone, Debug)]
pub struct Filters {
    /// Contrast sensitivity to luminance.
    pub achromatic: Kernel,
    /// Contrast sensitivity to red against green.
    pub red_green: Kernel,
    /// Contrast sensitivity to blue against yellow: two filters, and the share of each.
    pub blue_yellow: [(Kernel, f32); 2],
    /// A feature detector's weights across its direction.
    pub across: Kernel,
    /// Along its direction: an edge.
    pub edge: Kernel,
    /// Along its direction: a point or line.
    pub point: Kernel,
}

impl Filters {
    /// Sections 4.1.1 and 4.2.1 of the paper, for an eye that sees so many pixels a degree.
    pub fn new(pixels_per_degree: f64) -> Self {
        // (amplitude, width) of the Gaussians fitted to the eye's contrast sensitivity
        const A: (f64, f64) = (1.0, 0.0047);
        const RG: (f64, f64) = (1.0, 0.0053);
        const BY: [(f64, f64); 2] = [(34.1, 0.04), (13.5, 0.025)];
        // the paper gives all of them the reach of the widest
        let reach = (3.0 * (BY[0].1 / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as i64;
        let sensitivity =
            |(_, b): (f64, f64)| sampled(reach, |x| (-PI * PI * (x / pixels_per_degree).powi(2) / b).exp());
        let [first, second] = BY.map(|(a, b)| {
            let taps = sensitivity((a, b));
            // what the product of two such filters adds up to
            let sum = a * (PI / b).sqrt() * taps.iter().sum::<f64>().powi(2);
            (trimmed(&taps), sum)
        });
        let total = first.1 + second.1;
        let blue_yellow = [first, second].map(|(kernel, sum)| (kernel, (sum / total) as f32));

        // half the width of the feature that the eye finds best, 0.082 degrees
        let deviation = 0.5 * 0.082 * pixels_per_degree;
        let reach = (3.0 * deviation).ceil() as i64;
        let gauss = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
        Self {
            achromatic: trimmed(&sensitivity(A)),
            red_green: trimmed(&sensitivity(RG)),
            blue_yellow,
            across: Kernel::from_taps(&balanced(sampled(reach, gauss))),
            edge: Kernel::from_taps(&balanced(sampled(reach, |x| -x * gauss(x)))),
            point: Kernel::from_taps(&balanced(sampled(reach, |x| (x * x / (deviation * deviation) - 1.0) * gauss(x)))),
        }
    }

    /// The farthest that any of them reaches, in pixels.
    pub fn reach(&self) -> usize {
        let all = [&self.achromatic, &self.red_green, &self.blue_yellow[0].0, &self.blue_yellow[1].0];
        all.into_iter().chain([&self.across, &self.edge, &self.point]).map(Kernel::radius).max().unwrap_or(0)
    }
}

fn sampled(reach: i64, f: impl Fn(f64) -> f64) -> Vec<f64> {
    (-reach..=reach).map(|x| f(x as f64)).collect()
}

/// Scaled so that what is positive adds up to 1, and what is negative to -1.
fn balanced(taps: Vec<f64>) -> Vec<f64> {
    let positive: f64 = taps.iter().filter(|v| **v > 0.0).sum();
    let negative: f64 = -taps.iter().filter(|v| **v < 0.0).sum::<f64>();
    taps.iter()
        .map(|v| {
            if *v > 0.0 {
                v / positive
            } else if *v < 0.0 {
                v / negative
            } else {
                0.0
            }
        })
        .collect()
}

/// A Gaussian without the taps that single precision does not feel, adding up to 1.
fn trimmed(taps: &[f64]) -> Kernel {
    let peak = taps[taps.len() / 2];
    let nothing = taps.iter().take_while(|v| **v < 1e-9 * peak).count();
    let kept = &taps[nothing..taps.len() - nothing];
    Kernel::from_taps(&balanced(kept.to_vec()))
}

/// Rows of one number a pixel.
#[derive(Clone, Debug)]
pub struct Plane {
    /// Values in a row.
    pub width: usize,
    /// Row after row.
    pub values: Vec<f32>,
}

impl Plane {
    /// All zero.
    pub fn new(width: usize, rows: usize) -> Self {
        Self { width, values: vec![0.0; width * rows] }
    }

    /// Filtered along x; the rows lose `margin` values at either end, at least the radius of the
    /// filter.
    pub fn along_x(&self, kernel: &Kernel, margin: usize) -> Self {
        let mut out = Self::new(self.width - 2 * margin, self.values.len() / self.width);
        let start = margin - kernel.radius();
        for (row, into) in self.values.chunks_exact(self.width).zip(out.values.chunks_exact_mut(out.width)) {
            for (k, &weight) in kernel.0.iter().enumerate() {
                add_scaled(into, &row[start + k..], weight);
            }
        }
        out
    }

    /// Filtered along y, times `scale`, added to `out`, which has `margin` rows less at either end,
    /// at least the radius.
    pub fn add_along_y(&self, kernel: &Kernel, margin: usize, scale: f32, out: &mut Self) {
        let start = margin - kernel.radius();
        for (y, into) in out.values.chunks_exact_mut(self.width).enumerate() {
            for (k, &weight) in kernel.0.iter().enumerate() {
                add_scaled(into, &self.values[(y + start + k) * self.width..], weight * scale);
            }
        }
    }

    /// Filtered along y; `margin` as in [`Plane::add_along_y`].
    pub fn along_y(&self, kernel: &Kernel, margin: usize) -> Self {
        let mut out = Self::new(self.width, self.values.len() / self.width - 2 * margin);
        self.add_along_y(kernel, margin, 1.0, &mut out);
        out
    }
}

/// A loop over a row that compilers turn into vector instructions.
fn add_scaled(into: &mut [f32], from: &[f32], weight: f32) {
    for (o, v) in into.iter_mut().zip(from) {
        *o += weight * v;
    }
}
