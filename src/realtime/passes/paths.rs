//! `paths`: paths of the pixels that are sampled, and means of their parts. The host counts paths
//! left.

use std::sync::Arc;

use super::uncovered::{Counts, Uncovered};
use crate::error::{Error, Result};
use crate::film::Control;
use crate::film::block::{Block, BlockParams, TILE_PIXELS};
use crate::gpu::{Commands, Recorder, Timing};
use crate::integrators::path::signal::SignalPaths;
use crate::interface::PixelFilter;
use crate::interface::records::path::PathFrameParams;
use crate::interface::records::radiance::GatherParams;
use crate::realtime::Settings;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, Stage};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::scene::Scene;
use crate::tracer::{Push, Tracer};

/// Log2 of the maximum number of samples per pixel in a launch.
const MAX_SAMPLE_BITS: u32 = 4;
/// Maximum number of samples per pixel in a launch.
pub const MAX_SAMPLES: u32 = 1 << MAX_SAMPLE_BITS;

struct Paths {
    paths: SignalPaths,
    /// The pixels that are sampled in a frame, close together.
    sampled: Block,
    gather: Params<GatherParams>,
    /// Where there are histories.
    uncovered: Option<(Arc<Uncovered>, Params<GatherParams>)>,
    has_rest: bool,
}

/// The pass over the pixels that are sampled in a frame
/// ([`Resolution::sampled_size`](crate::realtime::Resolution::sampled_size)).
pub fn stage(
    tracer: &Tracer,
    paths: SignalPaths,
    sampled: Block,
    uncovered: Option<Arc<Uncovered>>,
    settings: &Settings,
    has_rest: bool,
) -> Result<Stage> {
    // a range is a launch, or several of the same pixels, and has room for uncovered ones
    let pixels =
        settings.launch_rays.min(paths.capacity()) / settings.rays_per_pixel.min(MAX_SAMPLES).next_power_of_two();
    let ranges = Range::launches(sampled.rays(), TILE_PIXELS, pixels);
    let gather = || Params::new(tracer.device(), "parameters of gathering");
    let uncovered = uncovered.map(|list| Ok::<_, Error>((list, gather()?))).transpose()?;
    let pass = Paths { paths, sampled, gather: gather()?, uncovered, has_rest };
    Ok(Stage::new(vec![Box::new(pass)], ranges))
}

/// Parts of `n` samples per pixel that launches take: powers of two, at most 2^`most_bits`.
fn sample_batches(n: u32, most_bits: u32) -> impl Iterator<Item = (u32, u32)> {
    let mut done = 0;
    std::iter::from_fn(move || {
        let bits = (n - done).checked_ilog2()?.min(most_bits);
        let batch = (done, bits);
        done += 1 << bits;
        Some(batch)
    })
}

impl Pass for Paths {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        use Resource::{
            CurrentDiffuse, CurrentSpecular, FrameNumber, Guide, KnownHits, ReflectedDistance, Rest, RestParts, Scene,
        };
        ResourceUse::new(&[FrameNumber, Scene, Guide], &[CurrentDiffuse, CurrentSpecular, ReflectedDistance])
            .and_reads(if self.paths.can_begin_at_known() { &[KnownHits] } else { &[] })
            .and_writes(self.has_rest, &[Rest, RestParts])
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        if let Some(to_map) = &frame.plan.environment_turn {
            self.paths.turn_environment(to_map)?;
        }
        let pixel_filter = if frame.plan.placement.spreads { PixelFilter::Box } else { PixelFilter::Centre };
        // paths that lie where the G-buffer's rays do begin at what those hit
        let begins_at_known = !frame.plan.placement.spreads && self.paths.can_begin_at_known();
        let block =
            BlockParams { pixel_filter: pixel_filter as u32, ..super::surfaces::block_params(frame, self.sampled) };
        let of_frame = PathFrameParams {
            frame: frame.params,
            known_hits: if begins_at_known { resources.address(Resource::KnownHits) } else { 0 },
            points: 0,
            listed: self.uncovered.as_ref().map_or(0, |(u, _)| u.address()),
            cells: self.sampled.rays(),
            listed_bits: 0,
        };
        let rr_depth = if frame.plan.progress.is_long { frame.settings.rest_rr_depth } else { 0 };
        self.paths.begin(&frame.camera, &block, of_frame, rr_depth)
    }

    fn record(&self, _: &mut Recorder, _: &Frame, _: &Resources, _: Range) -> Result<()> {
        Ok(())
    }

    fn move_lights(&mut self, tracer: &Tracer, scene: &Scene) -> Result<bool> {
        self.paths.move_lights(tracer, scene)
    }

    fn is_run_by_host(&self) -> bool {
        true
    }

    fn run(
        &mut self,
        commands: &mut Commands,
        frame: &Frame,
        resources: &Resources,
        range: Range,
        mut control: Option<&mut dyn Control>,
    ) -> Result<Vec<Timing>> {
        // pixels that the frame uncovers have more paths, with the last launch
        let mut timings = Vec::new();
        let most_bits = (self.paths.capacity() / range.count.max(1)).checked_ilog2().unwrap_or(0).min(MAX_SAMPLE_BITS);
        let has_uncovered = Uncovered::are_listed(frame) && range.first + range.count == self.sampled.rays();
        let uncovered = match &self.uncovered {
            Some((uncovered, _)) if has_uncovered => uncovered.counts()?,
            _ => Counts::default(),
        };

        for (earlier, sample_bits) in sample_batches(frame.plan.progress.samples, most_bits) {
            if earlier > 0
                && let Some(control) = &mut control
                && control.should_stop()?
            {
                return Err(Error::Interrupted);
            }

            // paths of all pixels of the range
            let gathered = GatherParams {
                frame: frame.params,
                path: self.paths.params_address(),
                diffuse: resources.address(Resource::CurrentDiffuse),
                specular: resources.address(Resource::CurrentSpecular),
                distances: resources.address(Resource::ReflectedDistance),
                rest: resources.address(Resource::Rest),
                rest_parts: resources.address(Resource::RestParts),
                starts: frame.plan.progress.starts_anew.into(),
                earlier,
                tiles_x: self.sampled.tiles_x(),
                ..Default::default()
            };
            self.gather.write(&gathered)?;
            let mut push = Push {
                scene: frame.tracer.scene_address(),
                first: range.first << sample_bits,
                count: range.count << sample_bits,
                sample_index: frame.plan.placement.first_sample.wrapping_add(earlier),
                sample_bits,
                ..Default::default()
            };
            let mut gathers = vec![Push { pass: self.gather.address(), ..push }];

            // and more of those that are listed
            if let Some((list, gather)) = &mut self.uncovered
                && earlier + (1 << sample_bits) == frame.plan.progress.samples
                && let Some(bits) = uncovered.listed_bits(sample_bits, self.paths.capacity() - push.count)
            {
                self.paths.list(bits)?;
                // samples at rest are as many for all pixels
                let (rest, rest_parts, earlier) = (0, 0, frame.plan.progress.samples);
                let first_path = push.count;
                gather.write(&GatherParams {
                    listed: list.address(),
                    first_path,
                    earlier,
                    rest,
                    rest_parts,
                    ..gathered
                })?;
                let sample_bits = sample_bits + bits;
                let count = uncovered.uncovered << sample_bits;
                gathers.push(Push { pass: gather.address(), first: 0, count, sample_bits, ..push });
                push.count += count;
            }
            timings.extend(self.paths.launch(commands, push, &gathers)?);
        }
        Ok(timings)
    }

    fn rays(&self) -> u64 {
        self.paths.rays()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn batches_take_every_sample_once() {
        for (n, most) in (1..100).zip([0, 1, 4].into_iter().cycle()) {
            let mut next = 0;
            for (done, bits) in sample_batches(n, most) {
                assert_eq!(done, next);
                assert!(bits <= most);
                next += 1 << bits;
            }
            assert_eq!(next, n);
        }
    }
}
