//! Rasterized primary visibility: hits of camera rays, one ray per pixel.
//!
//! Geometry is rasterized into a visibility buffer (one primitive id per pixel), and a compute
//! shader intersects each ray with that one primitive and calls the stream's shader
//! (`shaders/trace/visibility.glsl`). So the shader and its hits are those of traced rays; only at
//! an edge within the rasterizer's precision may the neighbouring primitive be hit instead.

mod camera_rays;
mod frustum;

use crate::settings::choices;
use std::ops::Range;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::film::block::BlockParams;
use crate::gpu::{Buffer, Cull, Device, GraphicsPipeline, Memory, Recorder, Targets};
use crate::interface::records::raster::RasterParams;
use crate::shaders::{self, StreamShaders};
use crate::tracer::raster_instance::CHUNK;
use crate::tracer::stream;
use crate::tracer::{Push, RasterInstance, Stream, Tracer};
pub use camera_rays::CameraRays;
pub use frustum::View;
use frustum::{Frustum, FrustumTest};

/// Vertices of the box around a sphere; shaders/raster/sphere.vert.
const BOX_VERTICES: u32 = 36;

/// Parameters of what is rasterized, and those of its block behind them.
#[repr(C)]
#[derive(Clone, Copy, Zeroable, Pod)]
struct RasterMemory {
    raster: RasterParams,
    block: BlockParams,
}

choices! {
    /// Primary visibility: rasterized or ray traced.
    pub enum Primary {
        /// Ray traced
        Traced = "traced",
        /// Rasterized
        Raster = "raster",
    }
}

/// Maximum instanced primitives per pixel at which rasterizing costs less than tracing: on CPU
/// devices, and on others (not measured). Mesa's CPU driver takes 90 to 240 ns for a triangle; at
/// 0.43 a pixel both cost the same, at 0.28 it saves a third (`benches/studies/primary.rs`).
const PRIMITIVES_PER_PIXEL: (f64, f64) = (0.4, 8.0);

impl Primary {
    /// The cheaper method for images of `pixels` pixels with one sample each, and the reason.
    pub fn auto(tracer: &Tracer, pixels: u64) -> (Primary, String) {
        let info = &tracer.device().info;
        if !info.can_rasterise() {
            return (
                Primary::Traced,
                format!("the device lacks {}, which rasterising needs", info.missing_raster.join(", ")),
            );
        }
        let placed: u64 = tracer.raster_instances().map(|d| d.shape.primitives as u64).sum();
        let most = if info.is_cpu() { PRIMITIVES_PER_PIXEL.0 } else { PRIMITIVES_PER_PIXEL.1 };
        let share = placed as f64 / pixels.max(1) as f64;
        let primary = if share > most { Primary::Traced } else { Primary::Raster };
        (
            primary,
            format!("{share:.2} primitives per pixel; up to {most}, this device rasterizes faster than it traces"),
        )
    }
}

/// Statistics of a rasterized view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DrawStats {
    /// Number of draw calls.
    pub draws: usize,
    /// Number of primitives drawn.
    pub primitives: u64,
    /// Number of primitives of the scene over all instances.
    pub placed: u64,
}

/// Rasterizes a tracer's scene and finds the hits of a stream of camera rays with it.
pub struct Raster {
    triangles: GraphicsPipeline,
    // only where the scene has any
    alpha_tested: Option<GraphicsPipeline>,
    spheres: Option<GraphicsPipeline>,
    targets: Targets,
    ids: Buffer,
    params: Buffer,
    stream: Stream,
}

/// The vertices that draw a range of primitives.
type Vertices<'a> = &'a dyn Fn(Range<u32>) -> Range<u32>;

/// Consecutive primitives of a TLAS instance.
struct Draw {
    push: Push,
    primitives: Range<u32>,
}

/// Draws by pipeline.
#[derive(Default)]
struct Draws {
    triangles: Vec<Draw>,
    alpha_tested: Vec<Draw>,
    spheres: Vec<Draw>,
}

impl Raster {
    /// Compiles the shaders for a scene and a stream of camera rays, for blocks up to `size`.
    ///
    /// # Errors
    /// [`crate::Error::Device`] when the device cannot rasterize, or not at this size;
    /// [`crate::Error::Usage`] for a stream of other rays; [`crate::Error::OutOfMemory`].
    pub fn new(tracer: &Tracer, shaders: &'static StreamShaders, size: [u32; 2]) -> Result<Self> {
        let (device, features) = (tracer.device(), tracer.features());
        let targets = Targets::new(device, size)?;
        let s = stream::scene_specialization(features);
        let pipeline = |name, vertex, fragment, cull| GraphicsPipeline::new(device, name, vertex, fragment, &s, cull);
        let alpha = || pipeline("draw alpha-tested", &shaders::DRAW_TRIANGLES, &shaders::DRAW_ALPHA, Cull::None);
        let spheres = || pipeline("draw spheres", &shaders::DRAW_SPHERES, &shaders::DRAW_SPHERE, Cull::Front);
        Ok(Self {
            triangles: pipeline("draw opaque", &shaders::DRAW_TRIANGLES, &shaders::DRAW_OPAQUE, Cull::None)?,
            alpha_tested: features.alpha.then(alpha).transpose()?,
            spheres: features.spheres.then(spheres).transpose()?,
            targets,
            ids: buffer(device, "rasterized ids", 8 * size[0] as u64 * size[1] as u64)?,
            params: buffer(device, "raster parameters", size_of::<RasterMemory>() as u64)?,
            stream: tracer.rasterized_stream(shaders)?,
        })
    }

    /// Records both [`Raster::draw`], whose errors it has, and [`Raster::trace`].
    pub fn record(&self, recorder: &mut Recorder, tracer: &Tracer, push: &Push, view: &View) -> Result<DrawStats> {
        let stats = self.draw(recorder, tracer, view)?;
        self.trace(recorder, push);
        Ok(stats)
    }

    /// Records the drawing of a view, timed as "raster draw", in place of the last one.
    ///
    /// # Errors
    /// [`crate::Error::Scene`] when the camera's transform is flat.
    pub fn draw(&self, recorder: &mut Recorder, tracer: &Tracer, view: &View) -> Result<DrawStats> {
        let size = view.block.size;
        let frustum = Frustum::new(view)?;
        let (draws, depth, stats) = self.collect(tracer, &frustum);
        let params = RasterMemory {
            raster: RasterParams {
                clip: frustum.clip(depth, tracer.device().viewport_factor(size) as f64),
                eye: frustum.eye.to_array(),
                turned: if frustum.turned { -1.0 } else { 1.0 },
                at: view.at,
                block: self.params.address() + std::mem::offset_of!(RasterMemory, block) as u64,
                box_depth: frustum.box_depth(depth),
                reserved: [0; 3],
            },
            block: view.block.params(view.image_size, &view.camera, 0),
        };
        recorder.barrier();
        recorder.update(&self.params, &params);
        recorder.barrier();

        // Opaque triangles first: they hide most of the rest.
        recorder.timed("raster draw", |r| {
            r.draw_into(&self.targets, size, |d| {
                let triangles = |n: Range<u32>| 3 * n.start..3 * n.end;
                let boxes = |n: Range<u32>| BOX_VERTICES * n.start..BOX_VERTICES * n.end;
                let mut all = |pipeline: &GraphicsPipeline, draws: &[Draw], vertices: Vertices| {
                    if !draws.is_empty() {
                        d.bind(pipeline);
                    }
                    let mut entry = None;
                    for draw in draws {
                        if entry.replace(draw.push.first) != Some(draw.push.first) {
                            d.push(&draw.push);
                        }
                        d.draw(vertices(draw.primitives.clone()), 0..1);
                    }
                };
                all(&self.triangles, &draws.triangles, &triangles);
                if let Some(pipeline) = &self.spheres {
                    all(pipeline, &draws.spheres, &boxes);
                }
                if let Some(pipeline) = &self.alpha_tested {
                    all(pipeline, &draws.alpha_tested, &triangles);
                }
            });
            r.copy_ids(&self.targets, size, &self.ids);
        });
        recorder.barrier();
        Ok(stats)
    }

    /// Records the stream's rays `push.first .. push.first + push.count` through the pixels of the
    /// last block drawn, timed under the name of their pass. The stream's parameters must be
    /// [`BlockParams`] of the same block and camera, and `push.sample_bits` 0.
    pub fn trace(&self, recorder: &mut Recorder, push: &Push) {
        debug_assert!(push.sample_bits == 0, "one ray a pixel");
        self.stream.record(recorder, &Push { rays: self.ids.address(), ..*push });
    }

    /// The draws of a view, their depth range and statistics.
    fn collect(&self, tracer: &Tracer, frustum: &Frustum) -> (Draws, [f64; 2], DrawStats) {
        let (mut draws, mut stats) = (Draws::default(), DrawStats::default());
        let mut depth = [f64::INFINITY, 0.0f64];
        for entry in tracer.raster_instances() {
            if entry.hidden {
                continue;
            }
            stats.placed += entry.shape.primitives as u64;
            let overlap = frustum.classify(&entry.shape.bounds, &entry.to_world);
            if overlap == FrustumTest::Outside {
                continue;
            }
            let [least, most] = frustum.depth(&entry.shape.bounds, &entry.to_world);
            depth = [depth[0].min(least), depth[1].max(most)];
            self.collect_entry(tracer, frustum, &entry, overlap, &mut draws);
        }
        for draw in [&draws.triangles, &draws.alpha_tested, &draws.spheres].into_iter().flatten() {
            stats.draws += 1;
            stats.primitives += draw.primitives.len() as u64;
        }
        (draws, depth, stats)
    }

    fn collect_entry(
        &self,
        tracer: &Tracer,
        frustum: &Frustum,
        entry: &RasterInstance,
        overlap: FrustumTest,
        draws: &mut Draws,
    ) {
        let push = Push {
            scene: tracer.scene_address(),
            pass: self.params.address(),
            rays: entry.positions,
            queued: entry.indices,
            first: entry.entry,
            ..Default::default()
        };

        // Ranges that meet are one draw; triangles are divided into opaque and alpha-tested ones.
        let shape = entry.shape;
        let mut add = |range: Range<u32>| {
            let push_range = |to: &mut Vec<Draw>, range: Range<u32>| match to.last_mut() {
                _ if range.is_empty() => (),
                Some(last) if last.push.first == push.first && last.primitives.end == range.start => {
                    last.primitives.end = range.end
                }
                _ => to.push(Draw { push, primitives: range }),
            };
            if shape.spheres {
                push_range(&mut draws.spheres, range);
            } else {
                push_range(&mut draws.triangles, range.start..range.end.min(shape.opaque));
                push_range(&mut draws.alpha_tested, range.start.max(shape.opaque)..range.end);
            }
        };

        // Of an instance that the frustum cuts, only the chunks that may be visible.
        if overlap == FrustumTest::Inside || shape.chunks.is_empty() {
            return add(0..shape.primitives);
        }
        for (k, bounds) in (0..).zip(&shape.chunks) {
            if frustum.classify(bounds, &entry.to_world) != FrustumTest::Outside {
                add(CHUNK * k..(CHUNK * (k + 1)).min(shape.primitives));
            }
        }
    }
}

fn buffer(device: &Arc<Device>, name: &str, size: u64) -> Result<Buffer> {
    Buffer::new(device, name, size, Memory::Device)
}
