//! Tone mapping from radiance to display range, for 8-bit images only: images are kept linear.

use rayon::prelude::*;

use super::{Channel, Image, Samples};

pub use crate::interface::ToneMap;

type Rgb = [f32; 3];

impl ToneMap {
    /// Maps one colour; negative and non-finite values count as 0.
    pub fn map(self, colour: Rgb) -> Rgb {
        let c = colour.map(|x| if x.is_finite() { x.max(0.0) } else { 0.0 });
        match self {
            ToneMap::Linear => c,
            ToneMap::Exponential => c.map(|x| 1.0 - (-x).exp()),
            ToneMap::Reinhard => {
                let luminance = 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
                c.map(|x| x / (1.0 + luminance))
            }
            ToneMap::Neutral => neutral(c),
            ToneMap::Agx => agx(c),
        }
    }

    /// The channels `R`, `G`, `B`, brightened by `exposure` stops and mapped; none if any is
    /// missing.
    pub fn apply(self, image: &Image, exposure: f32) -> Image {
        let gain = exposure.exp2();
        let mut out = Image { width: image.width, height: image.height, ..Default::default() };
        if let (Some(r), Some(g), Some(b)) = (image.f32("R"), image.f32("G"), image.f32("B")) {
            let pixels = (0..image.pixel_count()).into_par_iter().with_min_len(1024);
            let mapped: Vec<Rgb> = pixels.map(|k| self.map([r[k] * gain, g[k] * gain, b[k] * gain])).collect();
            let plane = |c: usize| Samples::F32(mapped.iter().map(|p| p[c]).collect());
            out.channels = (0..3).map(|c| Channel { name: ["R", "G", "B"][c].to_owned(), samples: plane(c) }).collect();
        }
        out
    }
}

fn neutral(c: Rgb) -> Rgb {
    const START: f32 = 0.8 - 0.04;
    const DESATURATION: f32 = 0.15;
    let least = c[0].min(c[1]).min(c[2]);
    let offset = if least < 0.08 { least - 6.25 * least * least } else { 0.04 };
    let c = c.map(|x| x - offset);
    let peak = c[0].max(c[1]).max(c[2]);
    if peak < START {
        return c;
    }
    let room = 1.0 - START;
    let new_peak = 1.0 - room * room / (peak + room - START);
    let grey = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    c.map(|x| x * new_peak / peak * (1.0 - grey) + new_peak * grey)
}

type Matrix = [Rgb; 3];
const INSET: Matrix = [
    [0.842_479, 0.078_433_6, 0.079_223_75],
    [0.042_328_242, 0.878_468_64, 0.079_166_13],
    [0.042_375_655, 0.078_433_6, 0.879_143],
];
const OUTSET: Matrix = [
    [1.196_879, -0.098_020_88, -0.099_029_74],
    [-0.052_896_85, 1.151_903_1, -0.098_961_18],
    [-0.052_971_635, -0.098_043_45, 1.151_073_7],
];

fn transform(m: &Matrix, c: Rgb) -> Rgb {
    m.map(|row| row[0] * c[0] + row[1] * c[1] + row[2] * c[2])
}

fn agx(c: Rgb) -> Rgb {
    const MIN_STOPS: f32 = -12.473_93;
    const MAX_STOPS: f32 = 4.026_069;
    let curve = |x: f32| {
        let x = ((x.max(1e-10).log2() - MIN_STOPS) / (MAX_STOPS - MIN_STOPS)).clamp(0.0, 1.0);
        let polynomial = [15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232];
        polynomial.iter().fold(0.0f32, |sum, k| sum * x + k)
    };
    let encoded = transform(&OUTSET, transform(&INSET, c).map(curve));
    encoded.map(|x| x.clamp(0.0, 1.0).powf(2.2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grey_stays_grey_and_brighter_stays_brighter() {
        for map in ToneMap::ALL {
            let mut last = -1.0;
            for k in 0..400 {
                let x = 1e-3 * 1.04f32.powi(k);
                let [r, g, b] = map.map([x; 3]);
                assert!((r - g).abs() < 1e-3 && (r - b).abs() < 1e-3, "{map:?} of {x}: {r} {g} {b}");
                assert!(r >= last, "{map:?} of {x}: {r} after {last}");
                assert!(map == ToneMap::Linear || r <= 1.0 + 1e-6, "{map:?} of {x}: {r}");
                last = r;
            }
            // what no light is
            for bad in [f32::NAN, f32::INFINITY, -1.0] {
                assert!(map.map([bad, 0.5, 0.5]).iter().all(|x| x.is_finite() && *x >= 0.0), "{map:?} of {bad}");
            }
        }
    }

    #[test]
    fn known_values() {
        assert_eq!(ToneMap::Exponential.map([1.0; 3])[0], 1.0 - (-1.0f32).exp());
        assert_eq!(ToneMap::Reinhard.map([1.0; 3])[0], 0.5);
        // below its start it only takes off the 4 % that a dielectric reflects
        let [r, g, b] = ToneMap::Neutral.map([0.5, 0.3, 0.2]);
        assert!((r - 0.46).abs() < 1e-6 && (g - 0.26).abs() < 1e-6 && (b - 0.16).abs() < 1e-6, "{r} {g} {b}");
        // the two matrices undo each other
        for (k, e) in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].into_iter().enumerate() {
            let back = transform(&OUTSET, transform(&INSET, e));
            assert!((0..3).all(|i| (back[i] - if i == k { 1.0 } else { 0.0 }).abs() < 1e-5), "{back:?}");
        }
        // middle grey lands near one half of the code values: 0.18 at 12.47 - 2.47 stops of 16.5
        let encoded = ToneMap::Agx.map([0.18; 3])[0].powf(1.0 / 2.2);
        assert!((0.4..0.6).contains(&encoded), "{encoded}");
    }
}
