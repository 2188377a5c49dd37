//! Sets of rays to measure tracers with: those of an image, in the order of skylit's own passes.

use glam::DVec3;

use super::ao::{self, AoOptions, Occlusion};
use super::rays::{Mode, PreparedRays};
use crate::error::{Error, Result};
use crate::film::camera::CameraRecord;
use crate::film::{Control, SampleSettings};
use crate::ray::{Hit, Ray};
use crate::sampling::sobol::hash_combine;
use crate::scene::{Camera, Geometry, Scene};
use crate::tracer::Tracer;

/// Minimum and maximum rays that stay together when a slow tracer gets a part of a set. Fewer than
/// a work-group of them would be less coherent than the set.
const CHUNK: [usize; 2] = [64, 1024];
/// Chunks that a part of a set has at least, so that it is from all over the image.
const CHUNKS: usize = 32;
const SEED: u32 = 1;

/// A set of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RaySet {
    /// Through the pixels, in tiles of 8x8, Morton order within (4x2 pixels are eight rays).
    Primary,
    /// One from each visible point, cosine-distributed; in the order of the pixels.
    Occlusion,
    /// The same in random order.
    Shuffled,
    /// From each visible point that faces a light to that light; in the order of the pixels.
    Shadow,
}

impl RaySet {
    /// All of them.
    pub const ALL: [RaySet; 4] = [RaySet::Primary, RaySet::Occlusion, RaySet::Shuffled, RaySet::Shadow];

    /// Do neighbouring rays take nearly the same way?
    pub fn is_coherent(self) -> bool {
        matches!(self, RaySet::Primary | RaySet::Shadow)
    }

    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            RaySet::Primary => "primary",
            RaySet::Occlusion => "occlusion",
            RaySet::Shuffled => "shuffled",
            RaySet::Shadow => "shadow",
        }
    }
}

/// The rays of an image, relative to the scene's origin.
pub struct RaySets([Vec<Ray>; 4]);

impl RaySets {
    /// Makes them with a tracer: ambient occlusion rays of length `ao_radius`, shadow rays to a
    /// point light (world coordinates).
    ///
    /// # Errors
    /// Those of the device.
    pub fn new(
        tracer: &Tracer,
        (scene, camera): (&Scene, &Camera),
        (ao_radius, light): (f64, DVec3),
        size: [u32; 2],
        control: &mut dyn Control,
    ) -> Result<Self> {
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let origin = scene.origin();
        let camera = CameraRecord::new(camera, origin, aspect);
        let samples = SampleSettings { keep_rays: true, ..SampleSettings::new(size, 1, SEED) };
        let options = AoOptions { samples, occlusion: Occlusion::new(ao_radius, 1.0), ..AoOptions::default() };
        let made = ao::render(tracer, &camera, &options, control)?;
        let (primary, occlusion) = (made.kept_primary, made.kept_occlusion);
        let mut prepared = PreparedRays::new(tracer, &primary, Mode::Closest)?;
        prepared.pass(control)?;
        let hits = prepared.hits()?;
        let shadow = shadow_rays(scene, &primary, &hits, &occlusion, light - origin)?;
        let shuffled = shuffle(&occlusion);
        Ok(Self([primary, occlusion, shuffled, shadow]))
    }

    /// The rays of a set.
    pub fn get(&self, set: RaySet) -> &[Ray] {
        &self.0[set as usize]
    }
}

/// From the origins of occlusion rays, visible points moved off surfaces, to the light before them.
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

/// A normal, of either side and any length, of a hit near `at` (relative to the scene's origin).
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
            let local =
                inverse.transform_point3(at + scene.origin()) - s.get(hit.primitive as usize)?.center.as_dvec3();
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

/// About one ray in `divisor`, in chunks from all over the set, in its order. Of a small set more:
/// too few to be from all over it say nothing about it, and take no time.
pub fn sample(rays: &[Ray], divisor: usize) -> Vec<Ray> {
    let chunk = (rays.len() / (divisor.max(1) * CHUNKS)).clamp(CHUNK[0], CHUNK[1]) / CHUNK[0] * CHUNK[0];
    let step = divisor.min(rays.len() / (chunk * CHUNKS)).max(1);
    rays.chunks(chunk).step_by(step).flatten().copied().collect()
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
        let rays = numbered(200_007);
        assert_eq!(sample(&rays, 1), rays);
        let part = sample(&rays, 4);
        assert_eq!(part.len(), 49 * 1024);
        assert_eq!(part[1024].origin[0] as usize, 4 * 1024);
        assert_eq!(sample(&numbered(5), 16).len(), 5);
        assert!(sample(&[], 16).is_empty());
    }

    #[test]
    fn samples_are_from_all_over_the_set() {
        for n in [1000, 2000, 20_000, 57_600, 300_000, 921_600] {
            for divisor in [1, 4, 16, 64] {
                let rays = numbered(n);
                let part = sample(&rays, divisor);
                // no gap as long as a sixteenth of the image, nor after the last chunk
                let gap = |w: &[Ray]| (w[1].origin[0] - w[0].origin[0]) as usize;
                let longest =
                    part.windows(2).map(gap).max().unwrap().max(n - 1 - part[part.len() - 1].origin[0] as usize);
                assert!(longest <= n / 16, "{n} rays, one in {divisor}: none of {longest} in a row");
                let most = (n / divisor).max(2 * CHUNK[0] * CHUNKS) * 5 / 4;
                assert!(
                    part.len() <= most && part.len() >= (n / divisor).min(n),
                    "{n} rays, one in {divisor}: {}",
                    part.len()
                );
            }
        }
    }

    /// Light above a plane reaches its points, light below it does not, however it is wound.
    #[test]
    fn shadow_rays_start_where_the_surface_faces_the_light() {
        for mirrored in [false, true] {
            let mut scene = crate::scene::builtin::by_name("plane").unwrap();
            if let (true, Geometry::Triangles(t)) = (mirrored, &mut scene.meshes[0].geometry) {
                t.indices.iter_mut().for_each(|c| c.swap(1, 2));
            }
            let down = Ray { origin: [0.5, 3.0, 0.25], tmin: 0.0, direction: [0.0, -1.0, 0.0], tmax: f32::INFINITY };
            let away = Ray { direction: [0.0, 1.0, 0.0], ..down };
            let hit = Hit { t: 3.0, instance: 0, primitive: 0, ..Hit::MISS };
            let up = Ray { origin: [0.5, 1e-4, 0.25], tmin: 0.0, direction: [0.0, 1.0, 0.0], tmax: 7.0 };
            let made = |light: DVec3| shadow_rays(&scene, &[away, down], &[Hit::MISS, hit], &[up], light).unwrap();
            let [ray] = made(DVec3::new(2.5, 4.0, 1.25))[..] else { panic!("one point, one light") };
            // to the light and no farther
            assert_eq!((ray.origin, ray.tmax), (up.origin, 1.0));
            let end = DVec3::from(ray.origin.map(f64::from)) + DVec3::from(ray.direction.map(f64::from));
            assert!((end - DVec3::new(2.5, 4.0, 1.25)).length() < 1e-6);
            assert!(made(DVec3::new(2.5, -4.0, 1.25)).is_empty());
            let n = normal(&scene, &hit, DVec3::from(up.origin.map(f64::from))).unwrap().normalize();
            assert!((n.y.abs() - 1.0).abs() < 1e-12, "{n}");
            assert!(shadow_rays(&scene, &[down], &[hit], &[], DVec3::Y).is_err());
        }
        let sphere = crate::scene::builtin::by_name("sphere-over-plane").unwrap();
        let k = sphere
            .instances
            .iter()
            .position(|i| matches!(sphere.meshes[i.mesh].geometry, Geometry::Spheres(_)))
            .unwrap();
        let hit = Hit { t: 1.0, instance: k as u32, primitive: 0, ..Hit::MISS };
        let top = DVec3::new(0.0, 2.25, 0.0) - sphere.origin();
        let n = normal(&sphere, &hit, top).unwrap().normalize();
        assert!((n - DVec3::Y).length() < 1e-6, "{n}");
    }
}
