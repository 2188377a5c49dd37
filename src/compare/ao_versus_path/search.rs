//! The radius and falloff whose ambient light is closest to a target: a coarse grid over all that a
//! scene's size allows, then a fine one about the best.

use super::samples::Samples;
use super::sums::{GROUPS, Sums, Table, Target};
use crate::integrators::ao::Occlusion;

/// Radii of the coarse grid: per octave, and octaves below the scene's diagonal.
const COARSE: (f64, f64) = (4.0, 12.0);
/// Falloffs of the coarse grid: octaves of the half-occlusion distance, below the scene's diagonal.
const HALF_DISTANCES: f64 = 8.0;
/// Greatest base 2 logarithm of a falloff, so that the falloff itself is finite.
const MAX_LOG2: f64 = 900.0;
/// Radii per octave of the fine grid for binary occlusion, one octave wide.
const FINE: f64 = 16.0;
/// Falloffs per octave of the fine grid, two octaves wide.
const FINE_FALLOFFS: f64 = 8.0;
/// Radii per octave of the fine grid of both, two octaves wide.
const FINE_BOTH: f64 = 8.0;
/// Maximum number of pixels for falloffs, each of which costs as much as all binary radii together.
const PIXELS: usize = 1 << 15;
/// Share by which a choice of two parameters must lower the mean squared error to be preferred.
const GAIN: f64 = 0.01;

/// A radius and falloff with the best ambient radiance for them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    pub occlusion: Occlusion,
    /// Ambient radiance, linear RGB; grey targets have it in the first channel.
    pub ambient: [f64; 3],
    /// Mean squared error against the target.
    pub mse: f64,
    /// Standard error of the natural logarithm of the radius, or (where it is infinite) of the
    /// distance at which occlusion halves, by a jackknife. `None` if the best is at the grid's end.
    pub log_error: Option<f64>,
}

/// Error of the best ambient radiance, over radii, for one falloff.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Falloff; 1 is binary.
    pub falloff: f64,
    /// Radii, ascending; the last is infinite.
    pub radii: Vec<f64>,
    /// Root mean squared error for each radius.
    pub rmse: Vec<f64>,
}

#[derive(Clone, Debug)]
pub struct Found {
    /// The best radius for binary occlusion.
    pub binary: Choice,
    /// The best falloff without a radius.
    pub falloff: Choice,
    /// The best pair of radius and falloff.
    pub both: Choice,
    /// The simplest of these whose error is within 1 % of the smallest.
    pub best: Choice,
    /// Error over radius: binary, then some falloffs.
    pub curves: Vec<Curve>,
}

/// Searches. `diagonal`: that of the scene's bounding box, scene units.
pub fn search(samples: &Samples, target: &Target, diagonal: f64) -> Found {
    let thinned = target.thinned(PIXELS);
    let searcher = Searcher { samples, target, thinned: &thinned };
    let mut radii = geometric(diagonal * (-COARSE.1).exp2(), diagonal, COARSE.0);
    radii.push(f64::INFINITY);
    let mut falloffs = vec![0.0];
    let halves = geometric(diagonal * (-HALF_DISTANCES).exp2(), diagonal, 1.0);
    falloffs.extend(halves.iter().map(|half| (1.0 / half).min(MAX_LOG2)));
    let coarse = Table::evaluate(samples, &thinned, &falloffs, &radii);
    let binary = searcher.binary(&coarse);
    let falloff = searcher.falloff(&coarse);
    let both = searcher.both(&coarse, &[binary, falloff]);
    let least = both.mse.min(binary.mse).min(falloff.mse);
    let good = |c: &Choice| c.mse - least <= GAIN * least.max(0.0);
    let single = if binary.mse <= falloff.mse { binary } else { falloff };
    let best = if good(&single) { single } else { both };
    Found { binary, falloff, both, best, curves: searcher.curves(&coarse) }
}

struct Searcher<'a> {
    samples: &'a Samples,
    target: &'a Target,
    /// Some of its pixels.
    thinned: &'a Target,
}

impl Searcher<'_> {
    /// One radius and falloff, over all pixels.
    fn evaluate(&self, log2: f64, radius: f64, log_error: Option<f64>) -> Choice {
        let sums = Table::evaluate(self.samples, self.target, &[log2], &[radius]).sums(0, 0, None);
        let mse = (self.target.energy() - sums.explained()) / self.target.values().max(1.0);
        Choice { occlusion: Occlusion::new(radius, log2.exp2()), ambient: sums.ambient(), mse, log_error }
    }

    fn binary(&self, coarse: &Table) -> Choice {
        let last = coarse.radii.len() - 1;
        let explained: Vec<f64> = (0..=last).map(|r| coarse.sums(0, r, None).explained()).collect();
        let best = greatest(&explained);
        if best == last {
            return self.evaluate(0.0, f64::INFINITY, None);
        }
        let radii = grid_around(coarse.radii[best], 0.5, FINE);
        let fine = Table::evaluate(self.samples, self.target, &[0.0], &radii);
        let at = |without| peak(&(0..radii.len()).map(|r| fine.sums(0, r, without).explained()).collect::<Vec<_>>());
        let (position, log_error) = jackknife(at, FINE);
        let is_inside = best > 0 || position > 0.0;
        self.evaluate(0.0, interpolated(&radii, position), is_inside.then_some(log_error))
    }

    fn falloff(&self, coarse: &Table) -> Choice {
        let unlimited = coarse.radii.len() - 1;
        let explained: Vec<f64> =
            (1..coarse.falloffs.len()).map(|f| coarse.sums(f, unlimited, None).explained()).collect();
        let best = greatest(&explained);
        let half = 1.0 / coarse.falloffs[1 + best];
        let halves = grid_around(half, 1.0, FINE_FALLOFFS);
        let falloffs: Vec<f64> = halves.iter().map(|half| (1.0 / half).min(MAX_LOG2)).collect();
        let fine = Table::evaluate(self.samples, self.thinned, &falloffs, &[f64::INFINITY]);
        let at = |without| peak(&(0..falloffs.len()).map(|f| fine.sums(f, 0, without).explained()).collect::<Vec<_>>());
        let (position, log_error) = jackknife(at, FINE_FALLOFFS);
        let is_inside =
            (best > 0 || position > 0.0) && (best + 1 < explained.len() || position < (halves.len() - 1) as f64);
        let log_error = is_inside.then_some(log_error);
        self.evaluate((1.0 / interpolated(&halves, position)).min(MAX_LOG2), f64::INFINITY, log_error)
    }

    /// `others`: what one parameter alone reaches, which two cannot fall short of.
    fn both(&self, coarse: &Table, others: &[Choice]) -> Choice {
        let pairs = |table: &Table| {
            let mut best = (1, 0, f64::NEG_INFINITY);
            for f in 0..table.falloffs.len() {
                // binary occlusion has its own search
                for r in (0..table.radii.len()).filter(|_| table.falloffs[f] > 0.0) {
                    let explained = table.sums(f, r, None).explained();
                    if explained > best.2 {
                        best = (f, r, explained);
                    }
                }
            }
            best
        };
        let (f, r, _) = pairs(coarse);
        let falloffs: Vec<f64> = grid_around(1.0 / coarse.falloffs[f], 1.0, FINE_BOTH)
            .iter()
            .map(|half| (1.0 / half).min(MAX_LOG2))
            .collect();
        // of an infinite radius the finite ones next to it are the largest
        let finite = coarse.radii[r.min(coarse.radii.len() - 2)];
        let mut radii = grid_around(finite, 1.0, FINE_BOTH);
        radii.push(f64::INFINITY);
        let fine = Table::evaluate(self.samples, self.thinned, &falloffs, &radii);
        let (f, r, _) = pairs(&fine);
        let found = self.evaluate(fine.falloffs[f], fine.radii[r], None);
        others.iter().fold(found, |best, other| if other.mse <= best.mse { *other } else { best })
    }

    fn curves(&self, coarse: &Table) -> Vec<Curve> {
        let energy = self.thinned.energy();
        let rmse = |sums: Sums| ((energy - sums.explained()) / self.thinned.values().max(1.0)).max(0.0).sqrt();
        let curve = |f: usize| Curve {
            falloff: coarse.falloffs[f].exp2(),
            radii: coarse.radii.clone(),
            rmse: (0..coarse.radii.len()).map(|r| rmse(coarse.sums(f, r, None))).collect(),
        };
        // every second falloff: their lines lie apart
        (0..1).chain((1..coarse.falloffs.len()).step_by(2)).map(curve).collect()
    }
}

/// Numbers from `from` to `to`, `per_octave` to each factor of two.
fn geometric(from: f64, to: f64, per_octave: f64) -> Vec<f64> {
    let steps = ((to / from).log2() * per_octave).round() as i32;
    (0..=steps).map(|k| from * (f64::from(k) / per_octave).exp2()).collect()
}

/// Numbers about another, `octaves` to each side.
fn grid_around(middle: f64, octaves: f64, per_octave: f64) -> Vec<f64> {
    geometric(middle * (-octaves).exp2(), middle * octaves.exp2(), per_octave)
}

/// The number at a position between those of a geometric list.
fn interpolated(list: &[f64], position: f64) -> f64 {
    let k = (position.floor() as usize).min(list.len().saturating_sub(2));
    let share = position - k as f64;
    (list[k].ln() * (1.0 - share) + list[k + 1].ln() * share).exp()
}

/// Index of the greatest value; the last of equal ones.
fn greatest(values: &[f64]) -> usize {
    (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(0)
}

/// Position of the maximum, refined by the parabola through it and its neighbours.
fn peak(values: &[f64]) -> f64 {
    let k = greatest(values);
    if k == 0 || k + 1 >= values.len() {
        return k as f64;
    }
    let [a, b, c] = [values[k - 1], values[k], values[k + 1]];
    let curvature = a - 2.0 * b + c;
    if curvature < 0.0 { k as f64 + (0.5 * (a - c) / curvature).clamp(-0.5, 0.5) } else { k as f64 }
}

/// A position on a grid with `per_octave` points, and the standard error of its natural logarithm.
/// `at`: the position with a group left out.
fn jackknife(at: impl Fn(Option<usize>) -> f64, per_octave: f64) -> (f64, f64) {
    let position = at(None);
    let others: Vec<f64> = (0..GROUPS).map(|g| at(Some(g))).collect();
    let mean = others.iter().sum::<f64>() / GROUPS as f64;
    let squares: f64 = others.iter().map(|x| (x - mean).powi(2)).sum();
    (position, ((GROUPS - 1) as f64 / GROUPS as f64 * squares).sqrt() * std::f64::consts::LN_2 / per_octave)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrators::path::ambient::AmbientSample;

    #[test]
    fn peaks_are_found_between_values() {
        let curve = |x: f64| 3.0 - (x - 4.3).powi(2);
        let values: Vec<f64> = (0..9).map(|k| curve(f64::from(k))).collect();
        assert!((peak(&values) - 4.3).abs() < 1e-12);
        assert_eq!((peak(&[3.0, 2.0, 1.0]), peak(&[1.0, 2.0, 3.0]), peak(&[1.0])), (0.0, 2.0, 0.0));
        let list = geometric(1.0, 16.0, 2.0);
        assert!(
            list.len() == 9
                && (list[8] - 16.0).abs() < 1e-12
                && (interpolated(&list, 4.5) - 2f64.powf(2.25)).abs() < 1e-12
        );
    }

    /// Pixels whose occluders are at random distances up to that of the pixel.
    fn occluded(reach: impl Fn(u32) -> f32) -> Samples {
        let mut samples = Samples::new(64 * 64, 32).unwrap();
        let mut state = 3u32;
        let mut random = || {
            state = crate::sampling::sobol::hash(state.wrapping_add(0x9e37_79b9));
            crate::sampling::sobol::to_unit(state)
        };
        for half in 0..2 {
            for pixel in 0..64 * 64 {
                for _ in 0..32 {
                    let hit = random() < 0.8;
                    let distance = if hit { random() * reach(pixel as u32) } else { f32::INFINITY };
                    samples.add(half, pixel, &[AmbientSample { reflectance: [0.8, 0.5, 0.2], distance }]);
                }
            }
        }
        samples
    }

    #[test]
    fn what_was_put_in_is_found() {
        let samples = occluded(|pixel| 0.1 + 40.0 * (pixel % 97) as f32 / 97.0);
        for (radius, falloff) in [(5.0, 1.0), (f64::INFINITY, 1.25)] {
            let image = samples.ambient(Occlusion::new(radius, falloff));
            let tinted = image.map(|half| half.iter().enumerate().map(|(k, v)| v * [2.0, 1.0, 0.5][k % 3]).collect());
            let target = Target { channels: 3, halves: tinted, pixels: samples.diffuse(), width: 64 };
            let found = search(&samples, &target, 100.0);
            let best = found.best;
            println!("{best:?}");
            if falloff == 1.0 {
                assert!((best.occlusion.radius / radius - 1.0).abs() < 0.02 && best.occlusion.falloff == 1.0);
            } else {
                assert!((best.occlusion.falloff.ln() / falloff.ln() - 1.0).abs() < 0.02, "{best:?}");
            }
            assert!(best.ambient.iter().zip([2.0, 1.0, 0.5]).all(|(a, b)| (a / b - 1.0).abs() < 0.01), "{best:?}");
            assert!(best.log_error.is_some_and(|e| e < 0.05), "{best:?}");
            assert!(best.mse < 0.002 * target.energy() / target.values(), "{best:?}");
        }
    }
}
