//! Contestants, and what was measured of them until now.

use super::curve::{ErrorCurve, ErrorPoint};
use super::engine::{Engine, PathReference};
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

impl<'a> Contestant<'a> {
    /// One of which nothing was measured yet.
    pub fn new(name: String, reference: usize, engine: Engine<'a>) -> Self {
        Self { name, reference, engine, by_spp: Vec::new(), biases: Vec::new(), longest_launch: None }
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
