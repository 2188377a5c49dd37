//! The pipeline that Larsen (2019) measured, as the paper describes it: half resolution per axis,
//! 64 closest-hit rays from one rotated table of points, occlusion only where no point light is
//! visible, a 3x3 box filter without edge tests, and half of the previous frame. Where the paper is
//! silent, the choice favours it: the geometric normal, a bias and a ray length that fit the
//! scene's scale ([`Settings::unit`]), white surfaces.

use std::sync::Arc;

use crate::error::Result;
use crate::film::block::Block;
use crate::gpu::{Buffer, ComputePipeline, Recorder};
use crate::interface::records::larsen::{LARSEN_NOISE, LARSEN_RAYS, LarsenParams};
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, Stage};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::realtime::settings::{FilterKind, Settings};
use crate::sampling::{best_candidates, blue_noise};
use crate::shaders::{self, LANES};
use crate::tracer::{Stream, Tracer};

/// Parameters that its passes share, each of which has its own copy.
struct Shared {
    params: LarsenParams,
    // referenced by address
    _tables: [Buffer; 3],
}

/// The work of a pass of the pipeline.
enum Work {
    /// Copies the result of the previous frame.
    Keep,
    Light(Stream),
    Occlusion(Stream),
    Sum(ComputePipeline),
    Blur(ComputePipeline),
    Temporal(ComputePipeline),
}

struct Larsen {
    work: Work,
    shared: Arc<Shared>,
    params: Params<LarsenParams>,
}

/// The passes after the G-buffer, for an image of `size` pixels. `lights`: positions of point
/// lights relative to the scene's origin.
pub fn stages(tracer: &Tracer, size: [u32; 2], settings: &Settings, lights: &[[f32; 3]]) -> Result<Vec<Stage>> {
    // what the passes share: lights, points of the hemisphere, noise that turns them
    let device = tracer.device();
    let half = size.map(|n| n.div_ceil(2));
    let light_records: Vec<[f32; 4]> = lights.iter().map(|p| [p[0], p[1], p[2], 0.0]).collect();
    let tables = [
        Buffer::from_slice(device, "lights", &light_records)?,
        Buffer::from_slice(device, "points", &best_candidates(LARSEN_RAYS as usize, 1))?,
        Buffer::from_slice(device, "noise", &blue_noise(LARSEN_NOISE as usize, 1))?,
    ];
    let params = LarsenParams {
        lights: tables[0].address(),
        light_count: lights.len() as u32,
        half_size: half,
        unit: settings.unit as f32,
        blurred: (settings.filter.kind != FilterKind::None).into(),
        points: tables[1].address(),
        noise: tables[2].address(),
        ..Default::default()
    };
    let shared = Arc::new(Shared { params, _tables: tables });

    // the stages
    let pass = |work| -> Result<Box<dyn Pass>> {
        Ok(Box::new(Larsen {
            work,
            shared: shared.clone(),
            params: Params::new(device, "parameters of Larsen's pipeline")?,
        }))
    };
    let tiles = |size: [u32; 2]| Block { origin: [0, 0], size }.rays();
    let light_rays = tiles(size) * lights.len() as u32;
    let pixels = Range::all(size[0] * size[1]);
    let mut stages = vec![Stage::new(vec![pass(Work::Keep)?], pixels.clone())];
    // without lights the pass runs, too, and clears the number of visible lights
    let light_ranges =
        if light_rays > 0 { Range::launches(light_rays, 1, settings.launch_rays) } else { Range::all(0) };
    stages.push(Stage::new(vec![pass(Work::Light(tracer.stream(&shaders::LARSEN_LIGHT_ANY)?))?], light_ranges));
    stages.push(Stage::new(
        vec![
            pass(Work::Occlusion(tracer.stream(&shaders::LARSEN_OCCLUSION_CLOSEST)?))?,
            pass(Work::Sum(shaders::LARSEN_SUM.pipeline(device)?))?,
        ],
        Range::launches(tiles(half) * LARSEN_RAYS, LARSEN_RAYS, settings.launch_rays),
    ));
    stages.push(Stage::new(vec![pass(Work::Blur(shaders::LARSEN_BLUR.pipeline(device)?))?], pixels.clone()));
    stages.push(Stage::new(vec![pass(Work::Temporal(shaders::LARSEN_TEMPORAL.pipeline(device)?))?], pixels));
    Ok(stages)
}

impl Pass for Larsen {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        use Resource::{
            Combined, FrameNumber, Guide, Normals, Occlusion, PreviousResult, RayCount, Result, Samples, Surface,
            VisibleLights,
        };
        let surfaces = [FrameNumber, Guide, Surface, Normals];
        match self.work {
            Work::Keep => ResourceUse::new(&[Result], &[PreviousResult]),
            Work::Light(_) => ResourceUse::new(&surfaces, &[VisibleLights]).clears(VisibleLights, 0),
            Work::Occlusion(_) => ResourceUse::new(&surfaces, &[Samples]).and_reads(&[VisibleLights]),
            Work::Sum(_) => ResourceUse::new(&surfaces, &[Occlusion, RayCount])
                .and_reads(&[VisibleLights, Samples])
                .clears(RayCount, 0),
            Work::Blur(_) => ResourceUse::new(&surfaces, &[Combined]).and_reads(&[Occlusion]),
            Work::Temporal(_) => ResourceUse::new(&surfaces, &[Result]).and_reads(&[Combined, PreviousResult]),
        }
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        self.params.write(&LarsenParams {
            frame: frame.params,
            // the frame index that rotates the table alternates between two values, as in the paper
            frame_parity: frame.plan.number & 1,
            lit: resources.address(Resource::VisibleLights),
            samples: resources.address(Resource::Samples),
            occlusion: resources.address(Resource::Occlusion),
            combined: resources.address(Resource::Combined),
            previous: resources.address(Resource::PreviousResult),
            result: resources.address(Resource::Result),
            rays: resources.address(Resource::RayCount),
            ..self.shared.params
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, resources: &Resources, range: Range) -> Result<()> {
        match &self.work {
            Work::Keep => {
                if let (Some(from), Some(to)) =
                    (resources.buffer(Resource::Result), resources.buffer(Resource::PreviousResult))
                {
                    r.copy(from, 0, to, 0, to.size());
                }
            }
            Work::Light(stream) | Work::Occlusion(stream) => stream.record(r, &self.params.push(frame, range)),
            Work::Sum(pipeline) => {
                let push = self.params.push(frame, range);
                r.timed("sum", |r| r.dispatch(pipeline, &push, (range.count / LARSEN_RAYS).div_ceil(LANES)));
            }
            Work::Blur(pipeline) => self.params.dispatch(r, "blur", pipeline, frame, range),
            Work::Temporal(pipeline) => self.params.dispatch(r, "temporal", pipeline, frame, range),
        }
        Ok(())
    }
}
