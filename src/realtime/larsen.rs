//! The pipeline that the reference work measured (Larsen 2019), exactly as it was: half resolution per axis, 64 nearest-hit rays from
//! one turned table of points, occlusion only where no point light is visible, a box of 3x3 that knows no edges, half of the frame
//! before. What its text leaves open is taken as favourable to it: the geometric normal, a bias and a reach that fit the scene's scale
//! ([`super::Settings::unit`]), white surfaces.

use crate::shaders::{self, LANES};
use std::sync::Arc;

use super::settings::{FilterKind, Settings};
use crate::error::Result;
use crate::film::block::Block;
use crate::gpu::{Buffer, ComputePipeline, Device, Memory, Recorder};
use crate::interface::records::larsen::{LARSEN_NOISE, LARSEN_RAYS, LarsenParams};
use crate::sampling::{best_candidates, blue_noise};
use crate::tracer::stream::LAUNCH_RAYS;
use crate::tracer::{Push, Stream, Tracer};

/// Its passes and memory.
pub(super) struct Larsen {
    light: Stream,
    occlusion: Stream,
    sum: ComputePipeline,
    blur: ComputePipeline,
    temporal: ComputePipeline,
    params: LarsenParams,
    params_buffer: Buffer,
    size: [u32; 2],
    blurred: bool,
    lit: Buffer,
    previous: Buffer,
    rays: Buffer,
    // reached by address
    _others: [Buffer; 6],
}

impl Larsen {
    /// `lights`: positions of point lights relative to the scene's origin.
    pub fn new(tracer: &Tracer, size: [u32; 2], lights: &[[f32; 3]], settings: &Settings) -> Result<Self> {
        let device = tracer.device();
        let half = size.map(|n| n.div_ceil(2));
        let pixels = |s: [u32; 2]| u64::from(s[0]) * u64::from(s[1]);
        let image = |name: &str, n: u64| Buffer::new(device, name, 4 * n, Memory::Device);
        let light_records: Vec<[f32; 4]> = lights.iter().map(|p| [p[0], p[1], p[2], 0.0]).collect();
        let others = [
            Buffer::from_slice(device, "lights", &light_records)?,
            Buffer::from_slice(device, "points", &best_candidates(LARSEN_RAYS as usize, 1))?,
            Buffer::from_slice(device, "noise", &blue_noise(LARSEN_NOISE as usize, 1))?,
            image("samples", u64::from(LAUNCH_RAYS))?,
            image("occlusion", pixels(half))?,
            image("combined", pixels(size))?,
        ];
        let (lit, previous) = (image("visible lights", pixels(size))?, image("previous frame", pixels(size))?);
        let rays = Buffer::new(device, "number of rays", 4, Memory::Readback)?;
        let [lights_at, points, noise, samples, occlusion, combined] = [0, 1, 2, 3, 4, 5].map(|k| others[k].address());
        let params = LarsenParams {
            lights: lights_at,
            light_count: lights.len() as u32,
            half_size: half,
            unit: settings.unit as f32,
            points,
            noise,
            lit: lit.address(),
            samples,
            occlusion,
            combined,
            previous: previous.address(),
            rays: rays.address(),
            ..Default::default()
        };
        Ok(Self {
            light: tracer.stream(&shaders::LARSEN_LIGHT_ANY)?,
            occlusion: tracer.stream(&shaders::LARSEN_OCCLUSION_CLOSEST)?,
            sum: shaders::LARSEN_SUM.pipeline(device)?,
            blur: shaders::LARSEN_BLUR.pipeline(device)?,
            temporal: shaders::LARSEN_TEMPORAL.pipeline(device)?,
            params,
            params_buffer: upload(device)?,
            size,
            blurred: settings.filter.kind != FilterKind::None,
            lit,
            previous,
            rays,
            _others: others,
        })
    }

    /// Before a frame is recorded.
    pub fn begin(&mut self, frame_params: u64, frame: u32) -> Result<()> {
        // the count that turns the table only ever alternates between two values
        let params = LarsenParams { frame: frame_params, frame_parity: frame & 1, ..self.params };
        self.params_buffer.write(0, bytemuck::bytes_of(&params))
    }

    /// Everything after the G-buffer, into `result`.
    pub fn record(&self, r: &mut Recorder, push: Push, result: &Buffer) {
        let push = Push { pass: self.params_buffer.address(), ..push };
        r.copy(result, 0, &self.previous, 0, self.previous.size());
        r.clear(&self.lit);
        r.clear(&self.rays);
        r.barrier();
        let launches =
            |rays: u32| (0..rays).step_by(LAUNCH_RAYS as usize).map(move |first| (first, LAUNCH_RAYS.min(rays - first)));
        let tiles = |size: [u32; 2]| Block { origin: [0, 0], size }.rays();
        for (first, count) in launches(tiles(self.size) * self.params.light_count) {
            self.light.record(r, &Push { first, count, ..push });
            r.barrier();
        }
        for (first, count) in launches(tiles(self.params.half_size) * LARSEN_RAYS) {
            let push = Push { first, count, ..push };
            self.occlusion.record(r, &push);
            r.barrier();
            r.timed("sum", |r| r.dispatch(&self.sum, &push, (count / LARSEN_RAYS).div_ceil(LANES)));
            r.barrier();
        }
        let all = Push { count: self.size[0] * self.size[1], sample_bits: self.blurred.into(), ..push };
        let groups = all.count.div_ceil(LANES);
        r.timed("blur", |r| r.dispatch(&self.blur, &all, groups));
        r.barrier();
        r.timed("temporal", |r| r.dispatch(&self.temporal, &all, groups));
    }

    /// Occlusion rays of the last frame.
    pub fn occlusion_rays(&self) -> Result<u64> {
        let bytes = self.rays.read(0, 4)?;
        Ok(u64::from(u32::from_ne_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])))
    }
}

fn upload(device: &Arc<Device>) -> Result<Buffer> {
    Buffer::new(device, "parameters", size_of::<LarsenParams>() as u64, Memory::Upload)
}
