//! Auxiliary outputs: properties of the surface at each pixel's centre.

use crate::shaders;
use bytemuck::Zeroable;
use glam::DVec3;

use crate::error::Result;
use crate::film::Control;
use crate::film::block::{Block, PassParams};
use crate::film::camera::CameraRecord;
use crate::film::pace::{MAX_RAYS, Pace};
use crate::gpu::{Buffer, Commands, Memory};
pub use crate::interface::records::aov::{AovParams, AovPixel};
use crate::output::{Channel, Samples};
use crate::raster::{CameraRays, Primary, View};
use crate::settings::choices;
use crate::tracer::{Push, Tracer};

choices! {
    /// An auxiliary output.
    pub enum Aov {
        /// Distance along the ray: depth.Z
        Depth = "depth",
        /// World position: position.X, .Y, .Z
        Position = "position",
        /// Geometric normal: Ng.X, .Y, .Z
        Ng = "ng",
        /// Shading normal: Ns.X, .Y, .Z
        Ns = "ns",
        /// Indices: id.instance, id.primitive, id.material
        Ids = "ids",
        /// Base colour: albedo.R, .G, .B
        Albedo = "albedo",
        /// Bent normal, of frames in real time: bent.X, .Y, .Z
        Bent = "bent",
        /// All of these but the bent normal
        All = "all",
    }
}

impl Aov {
    /// Returns true if this output is among `wanted`.
    pub fn is_in(self, wanted: &[Aov]) -> bool {
        wanted.contains(&self) || self != Aov::Bent && wanted.contains(&Aov::All)
    }
}

/// Renders the outputs of an image, rows from the top. The tracer must have been built with the
/// [`crate::tracer::Needs`] of the outputs.
pub fn render(
    tracer: &Tracer,
    camera: &CameraRecord,
    size: [u32; 2],
    control: &mut dyn Control,
) -> Result<Vec<AovPixel>> {
    render_with(tracer, camera, size, Primary::Traced, control)
}

/// As [`render`], with a choice of primary visibility.
pub fn render_with(
    tracer: &Tracer,
    camera: &CameraRecord,
    size: [u32; 2],
    primary: Primary,
    control: &mut dyn Control,
) -> Result<Vec<AovPixel>> {
    let mut out = vec![AovPixel::zeroed(); size[0] as usize * size[1] as usize];
    visit(tracer, camera, size, primary, control, &mut |at, pixel| out[at] = *pixel)?;
    Ok(out)
}

/// As [`render_with`], without storing the image: `take` receives each pixel once, with its index
/// (rows from the top), in an order that depends on the image size alone.
pub fn visit(
    tracer: &Tracer,
    camera: &CameraRecord,
    size: [u32; 2],
    primary: Primary,
    control: &mut dyn Control,
    take: &mut dyn FnMut(usize, &AovPixel),
) -> Result<()> {
    // Buffers for the largest block, and for a launch.
    let device = tracer.device();
    let blocks = Block::cut(size);
    let rays = CameraRays::new(tracer, &shaders::AOV_CLOSEST, primary, blocks.first().map_or([1; 2], |b| b.size))?;
    let mut commands = Commands::new(device)?;
    let record = size_of::<AovPixel>() as u64;
    let most = blocks.iter().map(Block::rays).max().unwrap_or(0).min(MAX_RAYS);
    let target = Buffer::new(device, "auxiliary outputs", record * most as u64, Memory::Device)?;
    let mut params = PassParams::new(device, "parameters of auxiliary outputs")?;
    params.write_own(&AovParams { pixels: target.address() })?;

    let mut pace = Pace::default();
    for block in &blocks {
        // Rasterize the block, if primary visibility is.
        params.write_block(&block.params(size, camera, 0))?;
        if rays.is_rasterized() {
            let view = View { camera: *camera, image_size: size, block: *block, at: [0.5; 2] };
            let mut drawn = Ok(());
            commands.run(|r| drawn = rays.draw(r, tracer, &view))?;
            drawn?;
        }

        // Launch after launch, whose pixels are read back.
        let (scene, pass) = (tracer.scene_address(), params.address());
        pace.run_launches(block.rays(), control, |first, count| {
            let push = Push { scene, pass, first, count, ..Default::default() };
            let timings = commands.run(|r| rays.record(r, &push))?;
            target.read_with(0, record * count as u64, record, |begin, bytes| {
                for (k, pixel) in bytes.chunks_exact(record as usize).enumerate() {
                    if let Some(at) = block.image_index(first + begin as u32 + k as u32, size[0]) {
                        take(at, &bytemuck::pod_read_unaligned(pixel));
                    }
                }
            })?;
            Ok(timings)
        })?;
    }
    tracer.check_finished()
}

/// Auxiliary outputs as channels of an image. `origin` is that of the tracer's scene.
pub fn channels(wanted: &[Aov], pixels: &[AovPixel], origin: DVec3) -> Vec<Channel> {
    let wants = |aov: Aov| aov.is_in(wanted);
    let mut out = Vec::new();
    let plane = |name: &str, f: &dyn Fn(&AovPixel) -> f32| Channel::from_floats(name, pixels.iter().map(f).collect());
    let ids = |name: &str, f: &dyn Fn(&AovPixel) -> u32| Channel {
        name: name.into(),
        samples: Samples::U32(pixels.iter().map(f).collect()),
    };
    if wants(Aov::Depth) {
        out.push(plane("depth.Z", &|p| p.depth));
    }
    for (k, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
        if wants(Aov::Position) {
            out.push(plane(&format!("position.{axis}"), &|p| (f64::from(p.position[k]) + origin[k]) as f32));
        }
        if wants(Aov::Ng) {
            out.push(plane(&format!("Ng.{axis}"), &|p| p.ng[k]));
        }
        if wants(Aov::Ns) {
            out.push(plane(&format!("Ns.{axis}"), &|p| p.ns[k]));
        }
    }
    if wants(Aov::Ids) {
        out.push(ids("id.instance", &|p| p.instance));
        out.push(ids("id.primitive", &|p| p.primitive));
        out.push(ids("id.material", &|p| p.material));
    }
    if wants(Aov::Albedo) {
        out.push(plane("albedo.R", &|p| p.red));
        out.push(plane("albedo.G", &|p| p.green));
        out.push(plane("albedo.B", &|p| p.blue));
    }
    out
}
