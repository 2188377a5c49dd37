//! Normals of smoothing groups.

use glam::{DVec3, Vec3};

use super::keys::PositionKeys;
use super::parse::{Corner, Group, NONE, ObjFile};

/// Gives the corners without a normal in smoothing groups the mean of the normals of the triangles
/// of their group around their position, weighted by angle, in whichever meshes they are. The other
/// triangles of their meshes are flat. Returns the number of meshes that got normals.
pub(super) fn smooth(file: &mut ObjFile) -> usize {
    let lacks = |t: &[Corner; 3]| t.iter().any(|c| c.normal == NONE);
    let is_smoothed =
        |g: &Group| runs(g).any(|(from, to, number)| number > 0 && g.triangles[from..to].iter().any(lacks));
    let smoothed: Vec<bool> = file.groups.iter().map(is_smoothed).collect();
    if !smoothed.contains(&true) {
        return 0;
    }

    // sums of normals for each smoothing group at each position
    let mut keys = PositionKeys::new(file.positions.len());
    keys.clear();
    let mut sums: Vec<DVec3> = Vec::new();
    for group in &file.groups {
        for (from, to, number) in runs(group).filter(|r| r.2 > 0) {
            for triangle in &group.triangles[from..to] {
                let p = triangle.map(|c| file.positions[c.position as usize]);
                let Some(normal) = normal(p) else { continue };
                for (k, corner) in triangle.iter().enumerate() {
                    let index = keys.index(corner.position, [number, 0]) as usize;
                    sums.resize(sums.len().max(index + 1), DVec3::ZERO);
                    let (a, b) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
                    sums[index] += normal * a.angle_between(b);
                }
            }
        }
    }
    let first = file.normals.len();
    file.normals.extend(sums.iter().map(|sum| sum.normalize_or_zero().as_vec3()));

    // corners refer to them; triangles without a group have a normal of their own
    let ObjFile { groups, positions, normals, .. } = file;
    for (group, _) in groups.iter_mut().zip(&smoothed).filter(|(_, is_smoothed)| **is_smoothed) {
        for (from, to, number) in runs(group).collect::<Vec<_>>() {
            for triangle in group.triangles[from..to].iter_mut().filter(|t| lacks(t)) {
                let flat = normal(triangle.map(|c| positions[c.position as usize])).map_or(Vec3::ZERO, |n| n.as_vec3());
                let own = normals.len();
                for corner in triangle.iter_mut().filter(|c| c.normal == NONE) {
                    let index = (number > 0).then(|| keys.index(corner.position, [number, 0]) as usize);
                    let index = index.filter(|&i| sums.get(i).is_some_and(|sum| *sum != DVec3::ZERO));
                    corner.normal = index.map_or(own, |i| first + i) as u32;
                }
                if triangle.iter().any(|c| c.normal as usize == own) {
                    normals.push(flat);
                }
            }
        }
    }
    smoothed.iter().filter(|s| **s).count()
}

/// The runs of a mesh's triangles with one smoothing group: first, end and number.
fn runs(group: &Group) -> impl Iterator<Item = (usize, usize, u32)> {
    let starts = std::iter::once((0, 0)).chain(group.smoothing.iter().map(|&(at, number)| (at as usize, number)));
    let ends = group.smoothing.iter().map(|&(at, _)| at as usize).chain([group.triangles.len()]);
    starts.zip(ends).map(|((from, number), to)| (from, to, number))
}

/// The unit normal of a triangle, if it has an area.
fn normal([a, b, c]: [DVec3; 3]) -> Option<DVec3> {
    (b - a).cross(c - a).try_normalize()
}
