//! The spatial filter of the real-time renderer (shaders/common/filter.glsl) applied to radiance:
//! it is divided by albedo, averaged over neighbours on the same surface as far as noise explains
//! their differences, and multiplied by albedo again.
//!
//! Left alone are mirrors, glass and polished metal, because the features do not show the edges in
//! reflections; emitters and the background; and pixels that contain one of the latter two. Pixels
//! with several surfaces are averaged among themselves only, so that no light leaks.

use glam::Vec3;

use super::DenoiseInput;
use super::features::{Features, PinholeView, PixelContent, is_uniform_emitter};
use crate::error::Result;
use crate::film::block::Block;
use crate::film::pace::Pace;
use crate::film::{Control, Film};
use crate::gpu::{Buffer, Commands, Memory};
use crate::interface::records::denoise::RadianceRecord;
use crate::interface::records::passes::{FILTER_STRIP, FilterParams};
use crate::realtime::params::FrameParams;
use crate::realtime::settings::FilterStep;
use crate::realtime::{DEPTH_TOLERANCE, Filter, FilterKind, inverse};
use crate::scene::material::{Material, MaterialKind};
use crate::shaders::{self, LANES};
use crate::tracer::Push;

/// Settings of the filter.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Settings {
    /// Shape of the neighbourhood.
    pub kind: FilterKind,
    /// Radius in pixels.
    pub radius: u32,
    /// Minimum cosine between the shading normals of neighbours; below it there is an edge.
    pub cosine: f32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { kind: FilterKind::Box, radius: 5, cosine: 0.95 }
    }
}

/// Minimum albedo by which radiance is divided: darker surfaces tell nothing about irradiance.
const MIN_ALBEDO: f32 = 0.01;
/// Roughness below which metals count as mirrors.
const POLISHED: f32 = 0.25;
/// The shader's inputs per pixel.
struct Guided {
    normals: Vec<[f32; 4]>,
    guides: Vec<[u32; 2]>,
    estimates: Vec<RadianceRecord>,
    /// Albedo by which each pixel is divided; zero for pixels that are not filtered.
    divisors: Vec<Vec3>,
}

/// A filtered film.
pub struct Filtered {
    /// Means, channels interleaved, rows from the top.
    pub means: Vec<f32>,
    /// Depth of each pixel's surface, scene units: negative for several surfaces, 0 if left alone.
    pub depths: Vec<f32>,
}

/// See [`super::Denoiser::denoise`].
pub fn filter(
    shot: &DenoiseInput,
    film: &Film,
    features: &Features,
    settings: &Settings,
    control: &mut dyn Control,
) -> Result<Filtered> {
    let guided = guide(shot, film, features);
    let filtered = run(shot, [film.width, film.height], &guided, settings, control)?;
    let mut means = film.mean.clone();
    let mut depths = vec![0.0; film.samples.len()];
    for (k, divisor) in guided.divisors.iter().enumerate().filter(|(_, d)| **d != Vec3::ZERO) {
        let radiance = Vec3::from(filtered[k].mean) * *divisor;
        means[3 * k..][..3].copy_from_slice(&radiance.to_array());
        let depth = f32::from_bits(guided.guides[k][0]);
        depths[k] = if features.content[k] == PixelContent::SeveralSurfaces { -depth } else { depth };
    }
    Ok(Filtered { means, depths })
}

fn rgb(image: &[f32], pixel: usize) -> Vec3 {
    Vec3::from_slice(&image[3 * pixel..][..3])
}

/// Whether the material shows sharp reflections or refractions: features lack their edges.
fn has_sharp_reflections(material: &Material) -> bool {
    let polished = material.roughness < POLISHED;
    match material.kind {
        MaterialKind::Mirror | MaterialKind::Glass => true,
        MaterialKind::Matte => false,
        MaterialKind::Copper | MaterialKind::Gold => polished,
        MaterialKind::MetallicRoughness => material.transmission.factor > 0.0 || polished && material.metallic > 0.5,
    }
}

/// Specular reflectance at normal incidence, independent of the base colour.
fn specular_albedo(material: &Material) -> f32 {
    match material.kind {
        MaterialKind::MetallicRoughness => {
            ((material.ior - 1.0) / (material.ior + 1.0)).powi(2) * material.specular.factor
        }
        MaterialKind::Matte
        | MaterialKind::Mirror
        | MaterialKind::Glass
        | MaterialKind::Copper
        | MaterialKind::Gold => 0.0,
    }
}

fn guide(shot: &DenoiseInput, film: &Film, features: &Features) -> Guided {
    let DenoiseInput { scene, camera, options, .. } = *shot;
    let pixels = film.samples.len();
    let mut out = Guided {
        normals: vec![[0.0; 4]; pixels],
        guides: vec![[f32::INFINITY.to_bits(), 0]; pixels],
        estimates: vec![RadianceRecord::default(); pixels],
        divisors: vec![Vec3::ZERO; pixels],
    };
    let view = PinholeView::new(camera, film.height);
    let white = options.white_sky.is_some();

    for k in 0..pixels {
        let (centre, samples, content) = (&features.centres[k], film.samples[k], features.content[k]);
        let Some(material) = scene.materials.get(centre.material as usize).filter(|_| centre.depth < f32::INFINITY)
        else {
            continue;
        };
        let albedo = rgb(&features.albedo, k) / features.coverage[k].max(f32::MIN_POSITIVE);
        let reflects = if white { albedo } else { albedo + specular_albedo(material) };
        let is_black = reflects.max_element() <= MIN_ALBEDO;
        let is_skipped = !white && (has_sharp_reflections(material) || is_uniform_emitter(material) || is_black);
        if samples == 0 || content == PixelContent::Emitter || is_skipped {
            continue;
        }

        // depth of field blurs radiance but not the albedo, which comes from a pinhole
        let divisor = if options.lens.is_some() { Vec3::ONE } else { reflects.max(Vec3::splat(MIN_ALBEDO)) };
        // the shader wants the mean square about the pixel's own mean
        let variance = rgb(&film.variance, k) * (1.0 - 1.0 / samples as f32) / (divisor * divisor);
        out.estimates[k] = RadianceRecord {
            mean: (rgb(&film.mean, k) / divisor).to_array(),
            samples: samples as f32,
            variance: variance.to_array(),
            narrowed: 0.0,
        };

        // eight bits: seven of a hash of the material, and one that is set for several surfaces
        let is_several = u32::from(content == PixelContent::SeveralSurfaces);
        let class = (centre.material.wrapping_mul(0x9e37_79b1) >> 25) << 1 | is_several;
        let [x, y, z] = centre.ng;
        out.normals[k] = [x, y, z, 0.0];
        out.guides[k] = [view.depth(centre.position).to_bits(), pack_normal(Vec3::from(centre.ns)) | class << 24];
        out.divisors[k] = divisor;
    }
    out
}

/// `pack_normal` of shaders/common/frame.glsl.
fn pack_normal(n: Vec3) -> u32 {
    let byte = |x: f32| u32::from((x.clamp(-1.0, 1.0) * 127.0).round() as i8 as u8);
    byte(n.x) | byte(n.y) << 8 | byte(n.z) << 16
}

/// Filters on the device, in several short launches.
fn run(
    shot: &DenoiseInput,
    size: [u32; 2],
    guided: &Guided,
    settings: &Settings,
    control: &mut dyn Control,
) -> Result<Vec<RadianceRecord>> {
    let (device, camera) = (shot.tracer.device(), shot.camera);
    let block = Block { origin: [0, 0], size };

    // Buffers and the parameters that all steps share.
    let normals = Buffer::from_slice(device, "normals", &guided.normals)?;
    let guide = Buffer::from_slice(device, "guide", &guided.guides)?;
    let given = Buffer::from_slice(device, "radiance", &guided.estimates)?;
    let image = || Buffer::new(device, "filtered radiance", given.size(), Memory::Device);
    let filter = Filter { kind: settings.kind, radius: settings.radius, samples: f32::MAX };
    let steps: Vec<FilterStep> = filter.steps();
    let between = if steps.len() > 1 { vec![image()?, image()?] } else { vec![image()?] };
    let params = FrameParams {
        camera_to_world: camera.camera_to_world,
        world_to_camera: inverse(camera),
        view: camera.view,
        orthographic: camera.orthographic.into(),
        size,
        tiles_x: block.tiles_x(),
        depth_tolerance: DEPTH_TOLERANCE,
        normal_tolerance: settings.cosine,
        // estimates are final: no later frame improves them
        most_samples: 1.0,
        normals: normals.address(),
        guide: guide.address(),
        ..Default::default()
    };
    let params = Buffer::from_slice(device, "frame parameters", &[params])?;

    // Each step reads the image of the one before.
    let pipeline = shaders::DENOISE.specialized(device, &filter.specialization())?;
    let (mut commands, mut pace) = (Commands::new(device)?, Pace::default());
    let mut from = &given;
    for (k, step) in steps.iter().enumerate() {
        let to = &between[k % between.len()];
        let step = FilterParams {
            frame: params.address(),
            from: from.address(),
            to: to.address(),
            samples: filter.samples,
            ..step.params()
        };
        let step = Buffer::from_slice(device, "filter parameters", &[step])?;
        pace.run_launches(block.rays(), control, |first, n| {
            let push = Push { pass: step.address(), first, count: first + n, ..Default::default() };
            let groups = n.div_ceil(FILTER_STRIP * LANES);
            commands.run(|r| r.timed("denoise", |r| r.dispatch(&pipeline, &push, groups)))
        })?;
        from = to;
    }
    Ok(bytemuck::pod_collect_to_vec(&from.read(0, from.size())?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_are_packed_as_the_shader_does() {
        assert_eq!(pack_normal(Vec3::new(1.0, -1.0, 0.0)), 0x00_81_7f);
        assert_eq!(pack_normal(Vec3::new(0.5, 2.0, -0.004)), 0xff_7f_40);
    }

    #[test]
    fn what_shows_others_is_left_alone() {
        let is_sharp = |kind, roughness, metallic| {
            has_sharp_reflections(&Material { kind, roughness, metallic, ..Material::default() })
        };
        assert!(is_sharp(MaterialKind::Mirror, 1.0, 0.0) && is_sharp(MaterialKind::Glass, 1.0, 0.0));
        assert!(is_sharp(MaterialKind::Gold, 0.1, 0.0) && !is_sharp(MaterialKind::Gold, 0.5, 0.0));
        assert!(!is_sharp(MaterialKind::Matte, 0.0, 1.0));
        assert!(is_sharp(MaterialKind::MetallicRoughness, 0.1, 1.0));
        assert!(!is_sharp(MaterialKind::MetallicRoughness, 0.1, 0.0));
    }
}
