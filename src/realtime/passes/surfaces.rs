//! `surfaces`: the G-buffer of radiance: surfaces behind pixels that scatter light, and materials.

use std::sync::Arc;

use super::uncovered::Uncovered;
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::film::block::{Block, BlockParams};
use crate::gpu::Recorder;
use crate::integrators::path::signal::{GuideRays, SignalPaths};
use crate::interface::records::radiance::SurfacesParams;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Pass, Range, Stage};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::tracer::{Push, Tracer};

struct Surfaces {
    rays: GuideRays,
    path: u64,
    is_dynamic: bool,
    /// Paths can begin at what its rays hit.
    keeps_hits: bool,
    uncovered: Option<Arc<Uncovered>>,
    pixels: u32,
}

/// The pass over all pixels of an image, which lists `uncovered` ones if there are histories.
pub fn stage(
    tracer: &Tracer,
    flat: &FlatScene,
    paths: &SignalPaths,
    block: Block,
    uncovered: Option<Arc<Uncovered>>,
    launch_rays: u32,
) -> Result<Stage> {
    let ranges = Range::launches(block.rays(), 1, launch_rays);
    let pass = Surfaces {
        rays: paths.surfaces(tracer, flat, ranges.iter().map(|r| r.count).max().unwrap_or(0))?,
        path: paths.params_address(),
        is_dynamic: tracer.is_dynamic(),
        keeps_hits: paths.can_begin_at_known(),
        uncovered,
        pixels: block.rays(),
    };
    Ok(Stage::new(vec![Box::new(pass)], ranges))
}

/// Parameters of a block of pixels that camera rays of a frame read.
pub(super) fn block_params(frame: &Frame, block: Block) -> BlockParams {
    BlockParams {
        centre_offset: frame.plan.offset,
        ..block.params(frame.block.size, &frame.camera, frame.settings.seed)
    }
}

impl Pass for Surfaces {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        use Resource::{Camera, Direct, Guide, KnownHits, Materials, Normals, PreviousPosition, Scene, Surface};
        ResourceUse::new(&[Camera, Scene], &[Guide, Surface, Normals, Materials, Direct])
            .and_writes(self.is_dynamic, &[PreviousPosition])
            .and_writes(self.keeps_hits, &[KnownHits])
            .clears(Guide, f32::INFINITY.to_bits())
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        let [materials, direct, known_hits] =
            [Resource::Materials, Resource::Direct, Resource::KnownHits].map(|r| resources.address(r));
        let lists = self.uncovered.as_ref().map(|u| u.outputs(frame)).unwrap_or_default();
        let own = SurfacesParams { frame: frame.params, path: self.path, materials, direct, known_hits, ..lists };
        self.rays.prepare(&block_params(frame, frame.block), &own)
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        let Range { first, count } = range;
        let push = Push { sample_index: frame.plan.placement.first_sample, ..frame.push(0, range) };
        let uncovered = self.uncovered.as_ref().filter(|_| Uncovered::are_listed(frame));
        if let Some(uncovered) = uncovered.filter(|_| first == 0) {
            uncovered.clear(r);
            r.barrier();
        }
        self.rays.record(r, &push);
        if let Some(uncovered) = uncovered.filter(|_| first + count == self.pixels) {
            r.barrier();
            uncovered.copy_counts(r);
        }
        Ok(())
    }
}
