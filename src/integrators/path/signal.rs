//! Paths for frames in real time: diffuse reflection is kept apart from the rest, so that both can
//! be filtered, and guide rays find surfaces to reproject by ([`SignalPaths::surfaces`]).

use glam::DMat3;

use super::{PathEstimator, PathOptions};
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::block::{BlockParams, PassParams};
use crate::film::camera::CameraRecord;
use crate::gpu::{Buffer, Commands, ComputePipeline, Memory, Recorder, Specialization, Timing};
use crate::interface::records::path::PathFrameParams;
use crate::interface::records::radiance::{GuideRayRecord, MAX_GUIDE_BOUNCES, SurfacesParams};
use crate::interface::{PathFeature, PathFeatures};
use crate::scene::material::MaterialKind;
use crate::scene::{Material, Scene};
use crate::shaders::{self, LANES};
use crate::tracer::queue::RayQueue;
use crate::tracer::{Push, Stream, Tracer};

/// Traces the paths of frames in real time, some for each pixel.
pub struct SignalPaths {
    paths: PathEstimator,
    gather: ComputePipeline,
    capacity: u32,
    rr_depth: u32,
}

/// Finds the surface behind each pixel that scatters light, seen directly or by mirrors and glass.
pub struct GuideRays {
    camera: Stream,
    behind: Option<RaysBehind>,
    params: [PassParams<SurfacesParams>; 2],
}

/// Rays behind mirrors and glass, in two queues: one is traced while the other is filled.
struct RaysBehind {
    stream: Stream,
    queues: [RayQueue; 2],
    states: [Buffer; 2],
}

impl SignalPaths {
    /// Creates it for launches of at most `capacity` paths. The tracer must have been built from
    /// `flat` with [`crate::tracer::Needs::shading`].
    ///
    /// # Errors
    /// Those of [`super::PathIntegrator::new`].
    pub fn new(tracer: &Tracer, flat: &FlatScene, options: &PathOptions, capacity: u32) -> Result<Self> {
        Ok(Self {
            paths: PathEstimator::new(tracer, flat, options, capacity, true)?,
            gather: shaders::PATH_GATHER.specialized(tracer.device(), &gather_constants(options))?,
            capacity,
            rr_depth: options.rr_depth,
        })
    }

    /// Maximum number of paths of a launch.
    pub fn capacity(&self) -> u32 {
        self.capacity
    }

    /// Creates what finds the surfaces of images, for launches of at most so many pixels.
    ///
    /// # Errors
    /// Those of the device.
    pub fn surfaces(&self, tracer: &Tracer, flat: &FlatScene, pixels: u32) -> Result<GuideRays> {
        let device = tracer.device();
        let PathEstimator { features, light_kinds, .. } = &self.paths;
        let constants = Specialization::default().set_all(features.constants()).set_all(light_kinds.constants());
        let params = || PassParams::new(device, "parameters of surfaces");
        let behind = || {
            let bytes = size_of::<GuideRayRecord>() as u64 * u64::from(pixels);
            let states = || Buffer::new(device, "rays of the G-buffer", bytes, Memory::Device);
            Ok::<_, Error>(RaysBehind {
                stream: tracer.specialized(&shaders::PATH_REFLECTION_CLOSEST, &constants)?,
                queues: [RayQueue::new(device, pixels)?, RayQueue::new(device, pixels)?],
                states: [states()?, states()?],
            })
        };
        let mut states = (0..flat.scene.materials.len()).flat_map(|k| flat.motion.states(flat.scene, k));
        let behind = states.any(may_be_smooth).then(behind).transpose()?;
        Ok(GuideRays {
            camera: tracer.specialized(&shaders::PATH_SURFACE_CLOSEST, &constants)?,
            behind,
            params: [params()?, params()?],
        })
    }

    /// Device address of the parameters of paths, for other shaders.
    pub fn params_address(&self) -> u64 {
        self.paths.params[0].own_address()
    }

    /// Turns the environment map: `to_map` is the rotation from world directions to the map's.
    ///
    /// # Errors
    /// Those of the device.
    pub fn turn_environment(&mut self, to_map: &DMat3) -> Result<()> {
        self.paths.turn_environment(to_map)
    }

    /// Moves the lights to where they are in `scene`, which is that of the tracer in another pose;
    /// returns true if they have moved.
    ///
    /// # Errors
    /// Those of the device; [`crate::Error::Scene`] for lights that need other shaders.
    pub fn move_lights(&mut self, tracer: &Tracer, scene: &Scene) -> Result<bool> {
        self.paths.move_lights(tracer.device(), scene)
    }

    /// Returns true if paths can begin at [`PathFrameParams::known_hits`], as they share camera
    /// rays.
    pub fn can_begin_at_known(&self) -> bool {
        self.paths.traced_by.wavefront().is_ok_and(|wavefront| wavefront.known.is_some())
    }

    /// Begins a frame: the camera and its block, with [`BlockParams::centre_offset`] and
    /// [`BlockParams::pixel_filter`], which is `FILTER_CENTRE` for samples that all lie there.
    /// Russian roulette begins after `rr_depth` bounces, or later by the options.
    ///
    /// # Errors
    /// Those of the device.
    pub fn begin(
        &mut self,
        camera: &CameraRecord,
        block: &BlockParams,
        of_frame: PathFrameParams,
        rr_depth: u32,
    ) -> Result<()> {
        self.paths.begin_roulette_after(rr_depth.max(self.rr_depth))?;
        self.paths.find_camera_media(camera)?;
        self.paths.traced = super::PathCounts::default();
        self.paths.begins_at_known = of_frame.known_hits != 0;
        self.paths.write_block(block)?;
        self.paths.change_records(|record| record.of_frame = of_frame)
    }

    /// Has later launches take `1 << bits` more pixels of each listed one
    /// ([`PathFrameParams::listed`]).
    ///
    /// # Errors
    /// Those of the device.
    pub fn list(&mut self, bits: u32) -> Result<()> {
        self.paths.change_records(|record| record.of_frame.listed_bits = bits)
    }

    /// Traces the paths of a launch; then `path_gather` adds them to the images of the frame, with
    /// each of `gathers`: the paths that it gathers, and its parameters.
    ///
    /// # Errors
    /// Those of the device.
    pub fn launch(&mut self, commands: &mut Commands, push: Push, gathers: &[Push]) -> Result<Vec<Timing>> {
        let gather = &self.gather;
        self.paths.trace(commands, push, |_, r| {
            for (k, push) in gathers.iter().enumerate() {
                if k > 0 {
                    // they are of pixels that the first one wrote
                    r.barrier();
                }
                let groups = (push.count >> push.sample_bits).div_ceil(LANES);
                r.timed("path_gather", |r| r.dispatch(gather, push, groups));
            }
        })
    }

    /// Number of rays since [`SignalPaths::begin`], but for camera rays.
    pub fn rays(&self) -> u64 {
        let counts = &self.paths.traced;
        counts.bounce_rays + counts.shadow_rays + counts.ambient_rays
    }
}

impl GuideRays {
    /// Writes the parameters of a frame: those of the block, with [`BlockParams::centre_offset`],
    /// and those of the pass, in which the fields about rays that go on are 0.
    ///
    /// # Errors
    /// Those of the device.
    pub fn prepare(&mut self, block: &BlockParams, own: &SurfacesParams) -> Result<()> {
        for k in 0..2 {
            // parameters k fill queue k, and read the states of the other
            let surfaces = match &self.behind {
                None => *own,
                Some(behind) => SurfacesParams {
                    next: behind.queues[k].record(),
                    states: behind.states[k ^ 1].address(),
                    next_states: behind.states[k].address(),
                    tags: behind.queues[k ^ 1].record().tags,
                    ..*own
                },
            };
            self.params[k].write(block, &surfaces)?;
        }
        Ok(())
    }

    /// Records the rays of a launch of pixels.
    pub fn record(&self, r: &mut Recorder, push: &Push) {
        let push = |fills: usize| Push { pass: self.params[fills].address(), ..*push };
        let Some(behind) = &self.behind else {
            self.camera.record(r, &push(0));
            return;
        };
        behind.queues[0].clear(r);
        r.barrier();
        self.camera.record(r, &push(0));
        for bounce in 0..MAX_GUIDE_BOUNCES as usize {
            let (traced, fills) = (bounce % 2, (bounce + 1) % 2);
            r.barrier();
            behind.queues[fills].clear(r);
            r.barrier();
            behind.stream.record(r, &behind.queues[traced].push(push(fills), push(fills).count));
        }
    }
}

/// Constants of the shader that gathers paths: the other features make no difference to it.
fn gather_constants(options: &PathOptions) -> Specialization {
    let mut features = PathFeatures::default();
    features.insert_if(options.catches(), PathFeature::Catcher);
    Specialization::default().set_all(features.constants())
}

/// Returns true if a surface of the material may have delta lobes alone, and so show others.
fn may_be_smooth(material: &Material) -> bool {
    match material.kind {
        MaterialKind::Mirror | MaterialKind::Glass => true,
        MaterialKind::MetallicRoughness => {
            let is_smooth = material.roughness < 0.05 || material.metallic_roughness_texture.is_some();
            is_smooth && (material.metallic > 0.0 || material.transmission.factor > 0.0)
        }
        MaterialKind::Matte => false,
        MaterialKind::Copper | MaterialKind::Gold => material.roughness == 0.0,
    }
}
