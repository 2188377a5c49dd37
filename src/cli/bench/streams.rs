//! The rays that are traced: made by skylit's own passes, so that they are those of an image, in the order of the renderer.

use glam::DVec3;

use super::scenes::Subject;
use crate::error::{Error, Result};
use crate::ray::{Hit, Ray};
use crate::render::Control;
use crate::render::ao::{self, AoOptions};
use crate::render::camera::CameraRecord;
use crate::render::rays::{Mode, PreparedRays};
use crate::sampling::sobol::hash_combine;
use crate::scene::{Geometry, Scene};
use crate::tracer::Tracer;

/// Rays that stay together when a slow tracer gets only a part of a set.
const CHUNK: usize = 1024;
const SEED: u32 = 1;

/// A stream: a set of rays and what is asked of them.
pub struct StreamKind {
    /// On the command line and in tables.
    pub name: &'static str,
    /// Its rays.
    pub set: Set,
    /// What is asked.
    pub mode: Mode,
}

/// All streams.
pub const STREAMS: [StreamKind; 5] = [
    StreamKind { name: "primary", set: Set::Primary, mode: Mode::Closest },
    StreamKind { name: "ao-any", set: Set::Occlusion, mode: Mode::Any },
    StreamKind { name: "ao-closest", set: Set::Occlusion, mode: Mode::Closest },
    StreamKind { name: "shuffled-any", set: Set::Shuffled, mode: Mode::Any },
    StreamKind { name: "shadow-any", set: Set::Shadow, mode: Mode::Any },
];

/// A set of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Set {
    /// Through the pixels, in tiles of 8x8, Morton order within (so 4x2 pixels are eight rays in a row).
    Primary,
    /// One from each visible point, cosine-distributed; in the order of the pixels.
    Occlusion,
    /// The same in random order.
    Shuffled,
    /// From each visible point that faces a light to that light; in the order of the pixels.
    Shadow,
}

impl Set {
    /// All of them.
    pub const ALL: [Set; 4] = [Set::Primary, Set::Occlusion, Set::Shuffled, Set::Shadow];

    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Set::Primary => "primary",
            Set::Occlusion => "occlusion",
            Set::Shuffled => "shuffled",
            Set::Shadow => "shadow",
        }
    }
}

/// The rays of an image, relative to the scene's origin.
pub struct RaySets([Vec<Ray>; 4]);

impl RaySets {
    /// Makes them with a tracer.
    ///
    /// # Errors
    /// Those of the device.
    pub fn make(tracer: &Tracer, subject: &Subject, size: [u32; 2], control: &mut dyn Control) -> Result<Self> {
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let origin = subject.scene.origin();
        let camera = CameraRecord::new(&subject.camera, origin, aspect);
        let options =
            AoOptions { size, spp: 1, seed: SEED, radius: subject.ao_radius, keep_rays: true, ..AoOptions::default() };
        let made = ao::render(tracer, &camera, &options, control)?;
        let (primary, occlusion) = (made.kept_primary, made.kept_occlusion);
        let mut prepared = PreparedRays::new(tracer, &primary, Mode::Closest)?;
        prepared.pass(control)?;
        let hits = prepared.hits()?;
        let shadow = shadow_rays(&subject.scene, &primary, &hits, &occlusion, subject.light - origin)?;
        let shuffled = shuffle(&occlusion);
        Ok(Self([primary, occlusion, shuffled, shadow]))
    }

    /// The rays of a set.
    pub fn get(&self, set: Set) -> &[Ray] {
        &self.0[set as usize]
    }
}

/// From the origin of each occlusion ray, which is the visible point moved off its surface, to the light, where the surface
/// faces it.
fn shadow_rays(scene: &Scene, primary: &[Ray], hits: &[Hit], occlusion: &[Ray], light: DVec3) -> Result<Vec<Ray>> {
    let met: Vec<usize> = (0..hits.len()).filter(|&i| hits[i].is_hit()).collect();
    if met.len() != occlusion.len() {
        // shadow rays would start at other surfaces than the normals belong to
        return Err(Error::CheckFailed(format!(
            "{} camera rays met something, but {} occlusion rays were made of them: two kernels disagree",
            met.len(),
            occlusion.len()
        )));
    }
    let rays = met.iter().zip(occlusion).filter_map(|(&i, from)| {
        let start = DVec3::from(from.origin.map(f64::from));
        let towards = light - start;
        let viewer = -DVec3::from(primary[i].direction.map(f64::from));
        let normal = normal(scene, &hits[i], start)?;
        let facing = if normal.dot(viewer) < 0.0 { -normal } else { normal };
        // the light lies at t = 1
        (facing.dot(towards) > 0.0).then(|| Ray { direction: towards.as_vec3().to_array(), tmax: 1.0, ..*from })
    });
    Ok(rays.collect())
}

/// A normal of what a ray met near `at` (relative to the scene's origin), on either side, of any length.
fn normal(scene: &Scene, hit: &Hit, at: DVec3) -> Option<DVec3> {
    let instance = scene.instances.get(hit.instance as usize)?;
    let to_world = instance.object_to_world;
    match &scene.meshes.get(instance.mesh)?.geometry {
        Geometry::Triangles(t) => {
            let corners = t.indices.get(hit.primitive as usize)?;
            let [a, b, c] = corners.map(|i| to_world.transform_point3(t.positions[i as usize].as_dvec3()));
            Some((b - a).cross(c - a))
        }
        Geometry::Spheres(s) => {
            let inverse = to_world.inverse();
            let local = inverse.transform_point3(at + scene.origin()) - s.get(hit.primitive as usize)?.center.as_dvec3();
            Some(inverse.matrix3.transpose() * local)
        }
    }
}

/// A random order (Fisher and Yates), the same on every machine.
fn shuffle(rays: &[Ray]) -> Vec<Ray> {
    let mut out = rays.to_vec();
    for i in (1..out.len()).rev() {
        let random = u64::from(hash_combine(hash_combine(SEED, 0x5f1e), i as u32));
        out.swap(i, ((random * (i as u64 + 1)) >> 32) as usize);
    }
    out
}

/// About one ray in `divisor`, in chunks from all over the set, in its order.
pub fn sample(rays: &[Ray], divisor: usize) -> Vec<Ray> {
    rays.chunks(CHUNK).step_by(divisor.max(1)).flatten().copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbered(n: usize) -> Vec<Ray> {
        (0..n).map(|i| Ray { origin: [i as f32, 0.0, 0.0], tmin: 0.0, direction: [0.0, 0.0, 1.0], tmax: 1.0 }).collect()
    }

    #[test]
    fn shuffling_keeps_every_ray_once() {
        let rays = numbered(10_000);
        let out = shuffle(&rays);
        let fixed = out.iter().zip(&rays).filter(|(a, b)| a == b).count();
        assert!(fixed < 20, "{fixed} stayed");
        let mut sorted: Vec<u32> = out.iter().map(|r| r.origin[0] as u32).collect();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..10_000));
    }

    #[test]
    fn samples_are_chunks_of_the_set() {
        let rays = numbered(10 * CHUNK + 7);
        assert_eq!(sample(&rays, 1), rays);
        let part = sample(&rays, 4);
        assert_eq!(part.len(), 3 * CHUNK);
        assert_eq!(part[CHUNK].origin[0] as usize, 4 * CHUNK);
        assert_eq!(sample(&numbered(5), 16).len(), 5);
        assert!(sample(&[], 16).is_empty());
    }
}
