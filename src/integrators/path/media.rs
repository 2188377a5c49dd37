//! The volumes that a camera is in, and whether paths must track theirs: shaders/path/media.glsl.

use glam::{DAffine3, DVec3};

use super::params::INVALID;
use crate::accel::flatten::FlatScene;
use crate::scene::{Geometry, Instance, Material};
use crate::tracer::shading::{absorbs, disperses, is_medium};

/// Maximum number of volumes that a path can be in at once.
const MAX_NESTED: usize = 4;

/// Directions of the rays that test whether a point is inside a volume, unlikely to be symmetry
/// axes of a scene. The majority decides, in case one ray passes through an edge.
const DIRECTIONS: [DVec3; 3] = [
    DVec3::new(0.412_31, 0.827_17, 0.381_93),
    DVec3::new(-0.713_29, 0.211_07, 0.668_37),
    DVec3::new(0.137_83, -0.591_61, -0.794_33),
];

/// Returns true if paths must track the volumes that they are in. The winding tells inside from
/// outside in a scene with one volume that neither absorbs nor disperses.
pub(super) fn need_tracking(flat: &FlatScene) -> bool {
    let mut used: Vec<usize> = flat.scene.instances.iter().map(|i| flat.scene.meshes[i.mesh].material).collect();
    used.sort_unstable();
    used.dedup();
    let media: Vec<&Material> =
        used.into_iter().flat_map(|k| flat.motion.states(flat.scene, k)).filter(|m| is_medium(m)).collect();
    media.len() > 1 || media.iter().any(|m| absorbs(m) || disperses(m))
}

/// Surfaces of the scene's volumes, in double precision.
pub(super) struct ClosedVolumes(Vec<VolumeMesh>);

/// A mesh that bounds a volume.
struct VolumeMesh {
    material: u32,
    /// World (relative to the scene's origin) to object space, where the winding is the mesh's own.
    to_object: DAffine3,
    /// A corner and two edges of each triangle.
    triangles: Vec<[DVec3; 3]>,
    spheres: Vec<(DVec3, f64)>,
}

impl ClosedVolumes {
    /// Collects the volumes of a scene.
    pub fn new(flat: &FlatScene) -> Self {
        let scene = flat.scene;
        let body = |instance: &Instance| {
            let mesh = &scene.meshes[instance.mesh];
            let to_world = instance.object_to_world;
            if !is_medium(&scene.materials[mesh.material]) || to_world.matrix3.determinant() == 0.0 {
                return None;
            }
            let to_world = DAffine3 { translation: to_world.translation - flat.origin, ..to_world };
            let (mut triangles, mut spheres) = (Vec::new(), Vec::new());
            match &mesh.geometry {
                Geometry::Triangles(mesh) => triangles.extend(mesh.indices.iter().map(|corners| {
                    let [a, b, c] = corners.map(|k| mesh.positions[k as usize].as_dvec3());
                    [a, b - a, c - a]
                })),
                Geometry::Spheres(all) => {
                    spheres.extend(all.iter().map(|s| (s.center.as_dvec3(), f64::from(s.radius))))
                }
            }
            Some(VolumeMesh { material: mesh.material as u32, to_object: to_world.inverse(), triangles, spheres })
        };
        Self(scene.shown_instances().filter_map(body).collect())
    }

    /// The volumes that contain a point (relative to the scene's origin), innermost first, then
    /// [`INVALID`]: those whose surfaces a ray from there leaves more often than it enters.
    pub fn containing(&self, point: DVec3) -> [u32; MAX_NESTED] {
        let by_direction = DIRECTIONS.map(|d| self.along(point, d));
        // the majority; if all three differ, the first
        let most = by_direction
            .iter()
            .find(|a| by_direction.iter().filter(|b| b == a).count() > 1)
            .unwrap_or(&by_direction[0]);
        let mut stack = [INVALID; MAX_NESTED];
        stack.iter_mut().zip(most).for_each(|(slot, &material)| *slot = material);
        stack
    }

    /// The volumes that contain a point, tested along one direction.
    fn along(&self, point: DVec3, direction: DVec3) -> Vec<u32> {
        let exit = |body: &VolumeMesh| {
            let (o, d) = (body.to_object.transform_point3(point), body.to_object.transform_vector3(direction));
            let of_triangles = body.triangles.iter().filter_map(|t| crossing(o, d, *t));
            let of_spheres = body.spheres.iter().filter_map(|&(centre, radius)| {
                let to = centre - o;
                let middle = to.dot(d) / d.length_squared();
                let half = (radius.powi(2) - (to - middle * d).length_squared()).max(0.0).sqrt() / d.length();
                (to.length() < radius).then_some((middle + half, true))
            });
            let (mut winding, mut exit) = (0i64, f64::INFINITY);
            for (t, outwards) in of_triangles.chain(of_spheres) {
                winding += if outwards { 1 } else { -1 };
                exit = if outwards { exit.min(t) } else { exit };
            }
            (winding > 0).then_some((exit, body.material))
        };
        let mut found: Vec<_> = self.0.iter().filter_map(exit).collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.into_iter().map(|(_, material)| material).collect()
    }
}

/// Intersects a ray with a triangle (a corner and two edges); returns the parameter, and whether
/// the ray leaves through the back (Möller and Trumbore 1997).
fn crossing(o: DVec3, d: DVec3, [a, e1, e2]: [DVec3; 3]) -> Option<(f64, bool)> {
    let p = d.cross(e2);
    let det = e1.dot(p);
    let s = o - a;
    let q = s.cross(e1);
    let (u, v, t) = (s.dot(p) / det, d.dot(q) / det, e2.dot(q) / det);
    // a determinant of 0 makes the comparisons below false
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t.is_finite()).then_some((t, det < 0.0))
}
