//! Contestants, and what was measured of them until now.

use super::curve::{ErrorCurve, ErrorPoint};
use super::engine::{Engine, MAX_SPP, PathReference, STEP};
use crate::bench::peers::process::{Peer, PeerError};
use crate::measure::displayed::without_reference;
use crate::measure::metrics::{ImagePair, bad_pixels};
use crate::measure::stats::median;

/// A sampling strategy of our own or a kernel of a peer, with a scene.
pub struct Contestant<'a> {
    pub name: String,
    pub reference: usize,
    pub engine: Engine<'a>,
    /// Measurements by sample count.
    pub by_spp: Vec<SampleCount>,
    /// Sums of image - reference over all images, one for each repeat.
    biases: Vec<f64>,
    longest_launch: Option<f64>,
}

/// Images of one sample count.
pub struct SampleCount {
    pub spp: u32,
    /// Seconds of each image.
    pub seconds: Vec<f64>,
    squares: Vec<f64>,
    bad: Vec<f64>,
    rays: Option<u64>,
}

impl SampleCount {
    /// Error over all images, that of the reference included.
    fn rmse(&self) -> f64 {
        (self.squares.iter().sum::<f64>() / self.squares.len() as f64).sqrt()
    }
}

impl<'a> Contestant<'a> {
    /// One of which nothing was measured yet.
    pub fn new(name: String, reference: usize, engine: Engine<'a>) -> Self {
        Self { name, reference, engine, by_spp: Vec::new(), biases: Vec::new(), longest_launch: None }
    }

    /// The sample count to warm up with next: two in any case, then while images take less than
    /// half of `seconds`, and once more where that should get to the error `target`.
    pub fn next_count(&self, seconds: f64, target: Option<f64>) -> Option<u32> {
        let Some(last) = self.by_spp.last() else { return Some(1) };
        let is_short = last.spp == 1 || 2.0 * last.seconds[0] < seconds;
        let goes_on = is_short || last.seconds[0] < seconds && target.is_some_and(|rmse| self.would_reach(rmse));
        last.spp.checked_mul(STEP).filter(|spp| goes_on && *spp <= MAX_SPP)
    }

    /// Does one more sample count get to an error, if it falls as between the last two?
    fn would_reach(&self, rmse: f64) -> bool {
        let [.., before, last] = self.by_spp.as_slice() else { return false };
        let (before, last) = (before.rmse(), last.rmse());
        last > rmse && last * last / before <= rmse
    }

    /// Error of the longest images, that of the reference included.
    pub fn last_rmse(&self) -> Option<f64> {
        self.by_spp.last().map(SampleCount::rmse)
    }

    /// Renders an image and measures it, also in the warming round, whose seeds are its own.
    pub fn render(
        &mut self,
        peers: &mut [Peer],
        round: u32,
        spp: u32,
        references: &[PathReference],
    ) -> Result<(), PeerError> {
        let image = self.engine.render(peers, spp, 1 + round)?;
        let reference = &references[self.reference];
        let pair = ImagePair::new(&image.rgb, &reference.image, 3, None)?;
        let index = match self.by_spp.iter().position(|l| l.spp == spp) {
            Some(index) => index,
            None => {
                let (seconds, squares, bad) = (Vec::new(), Vec::new(), Vec::new());
                self.by_spp.push(SampleCount { spp, seconds, squares, bad, rays: None });
                self.by_spp.len() - 1
            }
        };
        let entry = &mut self.by_spp[index];
        entry.seconds.push(image.seconds);
        entry.squares.push(pair.mse());
        entry.bad.push(bad_pixels(&image.rgb, &reference.image));
        entry.rays = image.rays;
        // the first launch of all compiles
        if round > 0 {
            self.longest_launch = [self.longest_launch, image.longest_launch].into_iter().flatten().reduce(f64::max);
        }
        let bias = pair.bias() * f64::from(spp);
        match self.biases.get_mut(round as usize) {
            Some(sum) => *sum += bias,
            None => self.biases.push(bias),
        }
        Ok(())
    }

    pub fn finish(self, size: [u32; 2], references: &[PathReference]) -> ErrorCurve {
        let reference_mse = references[self.reference].rmse.powi(2);
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let points: Vec<ErrorPoint> = self
            .by_spp
            .iter()
            .map(|l| {
                let squares = mean(&l.squares);
                let is_unsure = squares < 4.0 * reference_mse;
                let reference_rmse = references[self.reference].rmse;
                let error = |squares: f64| {
                    if is_unsure { squares.sqrt() } else { without_reference(squares.sqrt(), reference_rmse) }
                };
                ErrorPoint {
                    spp: l.spp,
                    seconds: l.seconds.clone(),
                    rmse: error(squares),
                    rmse_repeats: l.squares.iter().map(|s| error(*s)).collect(),
                    is_unsure,
                    bad_pixels: mean(&l.bad),
                }
            })
            .collect();
        let paths = |l: &SampleCount| f64::from(l.spp) * f64::from(size[0]) * f64::from(size[1]);
        let last = self.by_spp.last().zip(points.last());
        let seconds = last.and_then(|(_, p)| median(&p.seconds)).unwrap_or(f64::NAN);
        // how far the mean of all images is off, by how far the rounds are from one another
        let n = self.biases.len() as f64;
        let middle = mean(&self.biases);
        let spread = (self.biases.iter().map(|b| (b - middle).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
        ErrorCurve {
            name: self.name,
            is_peers: matches!(self.engine, Engine::Peer { .. }),
            bias_sigmas: (self.biases.len() > 2 && spread > 0.0).then(|| middle / spread),
            mpaths: last.map_or(0.0, |(l, _)| paths(l) / seconds / 1e6),
            mrays: last.and_then(|(l, _)| Some(l.rays? as f64 / seconds / 1e6)),
            longest_launch: self.longest_launch,
            points,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn next(counts: &[(f64, f64)], target: f64) -> Option<u32> {
        let engine = Engine::Peer { peer: 0, kernel: String::new(), size: [1, 1] };
        let mut contestant = Contestant::new("a".into(), 0, engine);
        for (k, (seconds, rmse)) in counts.iter().enumerate() {
            let (seconds, squares) = (vec![*seconds], vec![rmse * rmse]);
            contestant.by_spp.push(SampleCount {
                spp: STEP.pow(k as u32),
                seconds,
                squares,
                bad: Vec::new(),
                rays: None,
            });
        }
        contestant.next_count(4.0, Some(target))
    }

    #[test]
    fn images_get_longer_until_the_target() {
        assert_eq!(
            [next(&[], 0.1), next(&[(9.0, 1.0)], 0.1), next(&[(0.1, 1.0), (0.4, 0.5)], 0.1)],
            [1, 4, 16].map(Some)
        );
        // at the limit: only where one more gets there
        let curve = [(0.2, 1.0), (0.8, 0.4), (3.0, 0.16)];
        assert_eq!([next(&curve, 0.2), next(&curve, 0.07), next(&curve, 0.06)], [None, Some(64), None]);
        assert_eq!(next(&[(1.5, 1.0), (6.0, 0.4)], 0.2), None);
    }
}
