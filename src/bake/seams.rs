//! Seams: edges of a mesh whose two sides lie apart in the texture. Bilinear lookups along both
//! sides read texels of two charts, which may differ; within a chart they are the same lookup.

use glam::{Vec2, Vec3};

use super::plan::{PlannedTexture, triangles_of};
use super::{BakeSettings, Map, Space};
use crate::scene::{Scene, TriangleMesh};

/// Cosines of the angles between shading normals (11 degrees) and between triangles (20 degrees)
/// up to which the surface counts as smooth across an edge: a crease shows an edge of its own,
/// whatever the texture has, and so does one whose shading alone is smooth, as the rim of a lens.
const SMOOTH_SHADING: f32 = 0.98;
const SMOOTH_SURFACE: f32 = 0.94;
/// Distance in texels from which on two places of the texture are apart.
const APART: f32 = 0.01;
/// Lookups for each texel of an edge. With one, both sides agree there, and lie apart between two
/// lookups by up to a third of what they did before.
const LOOKUPS: f32 = 4.0;
/// Lookups along an edge, at most.
const MAX_LOOKUPS: f32 = 65536.0;
/// Passes over all lookups that make both sides agree, at most, and the difference that is left
/// where no further one is made.
const PASSES: usize = 64;
const AGREEMENT: f32 = 1e-3;

/// How far apart lookups on both sides of seams are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seams {
    /// Number of edges.
    pub edges: usize,
    /// Root mean square difference, weighted by length on the surface.
    pub rmse: f64,
    /// Largest difference.
    pub max: f64,
}

/// Lookups along the seams of a texture.
pub struct SeamLookups {
    edges: usize,
    pairs: Vec<LookupPair>,
}

/// A lookup on one side of a seam less that on the other side, at the same point of the surface.
struct LookupPair {
    /// Texels and their weights, those of the other side negative. Weights of a texel that both
    /// sides read are added up, and the entries that this leaves have no weight.
    terms: [(u32, f32); TERMS],
    /// Length of the seam that it stands for, in object space.
    length: f64,
}

/// Texels of two bilinear lookups.
const TERMS: usize = 8;

/// An edge of a triangle, whose ends are ordered by their positions.
struct Side {
    /// Bits of the positions of both ends.
    key: [[u32; 3]; 2],
    /// The triangle goes from the first end to the second.
    is_forward: bool,
    texcoords: [Vec2; 2],
    normals: [Vec3; 2],
    /// Unit normal of the triangle.
    flat: Vec3,
    length: f64,
}

impl SeamLookups {
    /// Finds the seams of a texture: edges of a mesh across which its normals go on, whose sides
    /// lie apart in the texture. `None` for directions in tangent space, which turns at a seam.
    /// `covered`: texels whose values are sampled. Where another one shows an edge, as inside of
    /// other geometry, nobody sees it, and it does not count.
    pub fn find(scene: &Scene, texture: &PlannedTexture, settings: &BakeSettings, covered: &[bool]) -> Option<Self> {
        if settings.space == Space::Tangent && settings.map.is_vector() {
            return None;
        }
        let (mut found, scale) = (Self { edges: 0, pairs: Vec::new() }, Vec2::from(texture.size.map(|n| n as f32)));
        let repeats = texture.repeats();
        for (surface, corners) in texture.surfaces.iter().zip(texture.shown_corners()) {
            let Some(mesh) = triangles_of(&scene.meshes[surface.mesh]) else { continue };
            let mut sides = sides_of_mesh(mesh, &corners);
            sides.sort_by_key(|side| side.key);
            for around in sides.chunk_by(|a, b| a.key == b.key) {
                for (one, other) in pairs(around) {
                    let gap = [0, 1].map(|end| {
                        let between = one.texcoords[end] - other.texcoords[end];
                        // a whole tile apart is the same place
                        ((between - between.round()) * scale).length()
                    });
                    if gap[0].max(gap[1]) > APART {
                        found.edges += usize::from(found.add(one, other, texture.size, repeats, covered));
                    }
                }
            }
        }
        Some(found)
    }

    /// Adds the lookups along an edge, at most a quarter of a texel apart on either side. Returns
    /// true if there is one that counts.
    fn add(&mut self, one: &Side, other: &Side, size: [u32; 2], repeats: bool, covered: &[bool]) -> bool {
        let scale = Vec2::from(size.map(|n| n as f32));
        let texels = |side: &Side| ((side.texcoords[1] - side.texcoords[0]) * scale).length();
        let count = (LOOKUPS * texels(one).max(texels(other))).ceil().clamp(1.0, MAX_LOOKUPS) as usize;
        let before = self.pairs.len();
        for k in 0..count {
            let along = (k as f32 + 0.5) / count as f32;
            let places = [one, other].map(|side| side.texcoords[0].lerp(side.texcoords[1], along));
            if !places.iter().all(|place| covered[nearest(*place, size, repeats)]) {
                continue;
            }
            let mut terms = [(0, 0.0); TERMS];
            let mut known = 0;
            for (place, sign) in places.into_iter().zip([1.0, -1.0]) {
                for (texel, weight) in footprint(place, size, repeats) {
                    let at = terms[..known].iter().position(|term| term.0 == texel).unwrap_or(known);
                    known = known.max(at + 1);
                    terms[at] = (texel, terms[at].1 + sign * weight);
                }
            }
            self.pairs.push(LookupPair { terms, length: one.length / count as f64 });
        }
        self.pairs.len() > before
    }

    /// Compares both sides; `None` without seams.
    pub fn measure(&self, values: &[Vec3]) -> Option<Seams> {
        let (mut squares, mut length, mut max) = (0.0, 0.0, 0.0f64);
        for pair in &self.pairs {
            let difference = f64::from(pair.difference(values).length());
            squares += pair.length * difference * difference;
            length += pair.length;
            max = max.max(difference);
        }
        (length > 0.0).then(|| Seams { edges: self.edges, rmse: (squares / length).sqrt(), max })
    }

    /// Changes texels until both sides agree, each lookup by the least change of its texels
    /// (Kaczmarz 1937): where all are met, no other change of the texture is smaller.
    pub fn equalize(&self, values: &mut [Vec3], map: Map) {
        for _ in 0..PASSES {
            let mut largest = 0.0f32;
            for pair in &self.pairs {
                let norm: f32 = pair.terms.iter().map(|(_, weight)| weight * weight).sum();
                if norm > f32::EPSILON {
                    let difference = pair.difference(values);
                    largest = largest.max(difference.abs().max_element());
                    let step = difference / norm;
                    pair.terms.iter().for_each(|(texel, weight)| values[*texel as usize] -= *weight * step);
                }
            }
            if largest < AGREEMENT {
                break;
            }
        }

        // what was changed keeps to the values of the map
        for &(texel, _) in self.pairs.iter().flat_map(|pair| &pair.terms).filter(|(_, weight)| *weight != 0.0) {
            let value = &mut values[texel as usize];
            *value = match map {
                Map::Ao | Map::Thickness | Map::Curvature => value.clamp(Vec3::ZERO, Vec3::ONE),
                Map::BentNormal | Map::Normal => value.normalize_or(Vec3::Z),
                Map::Light => value.max(Vec3::ZERO),
                Map::Position => *value,
            };
        }
    }
}

impl LookupPair {
    fn difference(&self, values: &[Vec3]) -> Vec3 {
        self.terms.iter().map(|(texel, weight)| *weight * values[*texel as usize]).sum()
    }
}

/// The edges of all triangles of a mesh that have an area in the texture.
fn sides_of_mesh(mesh: &TriangleMesh, corners: &[[Vec2; 3]]) -> Vec<Side> {
    let mut sides = Vec::with_capacity(3 * corners.len());
    for (triangle, texcoords) in mesh.indices.iter().zip(corners) {
        let area = (texcoords[1] - texcoords[0]).perp_dot(texcoords[2] - texcoords[0]);
        if area == 0.0 || !area.is_finite() {
            continue;
        }
        let positions = triangle.map(|v| mesh.positions[v as usize]);
        let flat = (positions[1] - positions[0]).cross(positions[2] - positions[0]).normalize_or_zero();
        let normals = triangle.map(|v| mesh.normals.get(v as usize).map_or(flat, |n| n.normalize_or_zero()));
        for (from, to) in [(0, 1), (1, 2), (2, 0)] {
            // negative zeros are zeros
            let bits = |end: usize| (positions[end] + Vec3::ZERO).to_array().map(f32::to_bits);
            let is_forward = bits(from) < bits(to);
            let ends = if is_forward { [from, to] } else { [to, from] };
            sides.push(Side {
                key: ends.map(bits),
                is_forward,
                texcoords: ends.map(|end| texcoords[end]),
                normals: ends.map(|end| normals[end]),
                flat,
                length: (positions[to] - positions[from]).as_dvec3().length(),
            });
        }
    }
    sides
}

/// Pairs the triangles at an edge that go on each other smoothly.
fn pairs(around: &[Side]) -> Vec<(&Side, &Side)> {
    let mut others: Vec<&Side> = around.iter().filter(|side| !side.is_forward).collect();
    let mut found = Vec::new();
    for one in around.iter().filter(|side| side.is_forward) {
        let goes_on = |other: &&Side| {
            one.flat.dot(other.flat) > SMOOTH_SURFACE
                && (0..2).all(|end| one.normals[end].dot(other.normals[end]) > SMOOTH_SHADING)
        };
        if let Some(at) = others.iter().position(goes_on) {
            found.push((one, others.swap_remove(at)));
        }
    }
    found
}

/// The texel that holds a place.
fn nearest(at: Vec2, size: [u32; 2], repeats: bool) -> usize {
    let heaviest = |a: (u32, f32), b: (u32, f32)| if b.1 > a.1 { b } else { a };
    footprint(at, size, repeats).into_iter().reduce(heaviest).map_or(0, |(texel, _)| texel as usize)
}

/// The texels of a bilinear lookup and their weights.
fn footprint(at: Vec2, size: [u32; 2], repeats: bool) -> [(u32, f32); 4] {
    let place = at * Vec2::from(size.map(|n| n as f32)) - 0.5;
    let (first, part) = (place.floor(), place - place.floor());
    let index = |value: f32, count: u32| match (value as i64, i64::from(count)) {
        (value, count) if repeats => value.rem_euclid(count) as u32,
        (value, count) => value.clamp(0, count - 1) as u32,
    };
    let texel = |x: f32, y: f32| index(first.y + y, size[1]) * size[0] + index(first.x + x, size[0]);
    let rest = 1.0 - part;
    [
        (texel(0.0, 0.0), rest.x * rest.y),
        (texel(1.0, 0.0), part.x * rest.y),
        (texel(0.0, 1.0), rest.x * part.y),
        (texel(1.0, 1.0), part.x * part.y),
    ]
}

#[cfg(test)]
mod tests {
    use super::super::plan::plan;
    use super::*;
    use crate::film::NoControl;
    use crate::scene::{Geometry, Instance, Material, Mesh};

    /// A square of two triangles that share a diagonal, in the left and the right half of a
    /// texture; the second turned by an angle about the diagonal.
    fn halves(angle: f32) -> Scene {
        let (a, b) = (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0));
        let turn = glam::Quat::from_axis_angle(b.normalize(), angle);
        let texcoords = [[0.1, 0.1], [0.4, 0.1], [0.4, 0.9], [0.6, 0.1], [0.9, 0.9], [0.6, 0.9]];
        let triangles = TriangleMesh {
            positions: vec![a, Vec3::X, b, a, b, turn * Vec3::Y],
            indices: vec![[0, 1, 2], [3, 4, 5]],
            texcoords: [texcoords.map(Vec2::from).to_vec(), Vec::new()],
            ..TriangleMesh::default()
        };
        let mut scene = Scene { materials: vec![Material::default()], ..Scene::default() };
        let to_world = glam::DAffine3::IDENTITY;
        scene.instances.push(Instance { name: String::new(), mesh: 0, object_to_world: to_world });
        let geometry = Geometry::Triangles(triangles);
        scene.meshes.push(Mesh { name: String::new(), geometry, material: 0, source: None });
        scene
    }

    fn lookups(scene: &Scene, settings: &BakeSettings) -> Option<SeamLookups> {
        let planned = plan(scene, None, settings, &mut NoControl).unwrap();
        SeamLookups::find(scene, &planned[0], settings, &[true; 64 * 64])
    }

    /// Texels that are filled, as those inside of other geometry are, show nothing that is seen.
    #[test]
    fn what_nobody_sees_is_no_seam() {
        let settings = BakeSettings { size: [64; 2], ..BakeSettings::default() };
        let scene = halves(0.0);
        let planned = plan(&scene, None, &settings, &mut NoControl).unwrap();
        let step: Vec<Vec3> = (0..64 * 64).map(|k| Vec3::X * if k % 64 < 32 { 0.25 } else { 0.75 }).collect();
        let seams = |last_row: usize| {
            // rows from there on are hidden in the right half
            let covered: Vec<bool> = (0..64 * 64).map(|k| k % 64 < 32 || k / 64 < last_row).collect();
            let found = SeamLookups::find(&scene, &planned[0], &settings, &covered).unwrap();
            let mut values = step.clone();
            found.equalize(&mut values, Map::Ao);
            (found.measure(&step), values)
        };
        let (whole, _) = seams(64);
        let (half, matched) = seams(32);
        for seams in [whole, half].map(Option::unwrap) {
            assert!(seams.edges == 1 && (seams.max - 0.5).abs() < 1e-6, "{seams:?}");
        }
        // the diagonal goes from row 6 to row 57: values beside its hidden part stay
        let column = |row: usize| 6 + (row - 6) * 19 / 51;
        assert!((matched[64 * 20 + column(20)].x - 0.5).abs() < 0.1);
        assert_eq!(matched[64 * 50 + column(50)].x, 0.25);
        let (hidden, untouched) = seams(0);
        assert!(hidden.is_none() && untouched == step);
    }

    #[test]
    fn a_known_step_at_a_seam_is_measured_and_taken_away() {
        let settings = BakeSettings { size: [64; 2], ..BakeSettings::default() };
        let scene = halves(0.0);
        let found = lookups(&scene, &settings).unwrap();
        // the left half has 0.25, the right 0.75
        let mut values: Vec<Vec3> = (0..64 * 64).map(|k| Vec3::X * if k % 64 < 32 { 0.25 } else { 0.75 }).collect();
        let seams = found.measure(&values).unwrap();
        assert_eq!(seams.edges, 1);
        assert!((seams.rmse - 0.5).abs() < 1e-6 && (seams.max - 0.5).abs() < 1e-6, "{seams:?}");

        // half of the step on one side alone, and values far from it stay
        found.equalize(&mut values, Map::Ao);
        let seams = found.measure(&values).unwrap();
        assert!(seams.max < 0.03, "{seams:?}");
        assert_eq!((values[0].x, values[64 * 20 + 24].x), (0.25, 0.25));
        assert!(values.iter().all(|v| (0.2..0.8).contains(&v.x)));

        // values that are linear on the surface have no seam
        let on_left = |u: f32| Vec3::X * ((u - 0.1) / 0.3);
        let linear = (0..64 * 64).map(|k| {
            let at = (Vec2::new((k % 64) as f32, (k / 64) as f32) + 0.5) / 64.0;
            if at.x < 0.5 { on_left(at.x) } else { Vec3::X * ((at.x - 0.6) / 0.3) }
        });
        let seams = found.measure(&linear.collect::<Vec<_>>()).unwrap();
        assert!(seams.max < 1e-4, "{seams:?}");
    }

    /// Sides agree between the lookups, too, however different they were.
    #[test]
    fn both_sides_agree_all_along_a_seam() {
        let settings = BakeSettings { size: [64; 2], ..BakeSettings::default() };
        let scene = halves(0.0);
        let found = lookups(&scene, &settings).unwrap();
        let mut values: Vec<Vec3> = (0..64 * 64u32)
            .map(|k| Vec3::X * (0.2 + 0.6 * (k.wrapping_mul(0x9e37_79b9) >> 16) as f32 / 65536.0))
            .collect();
        let largest = |values: &[Vec3]| {
            let look = |from: Vec2, to: Vec2, along: f32| -> f32 {
                let texels = footprint(from.lerp(to, along), [64; 2], false);
                texels.iter().map(|(texel, weight)| weight * values[*texel as usize].x).sum()
            };
            let sides = [[[0.1, 0.1], [0.4, 0.9]], [[0.6, 0.1], [0.9, 0.9]]].map(|side| side.map(Vec2::from));
            let differences = (0..=5000).map(|k| k as f32 / 5000.0).map(|along| {
                let [one, other] = sides.map(|[from, to]| look(from, to, along));
                (one - other).abs()
            });
            differences.fold(0.0, f32::max)
        };
        let before = largest(&values);
        found.equalize(&mut values, Map::Ao);
        let after = largest(&values);
        assert!(before > 0.3 && after < 0.1 * before, "{before} {after}");
        // what is measured is not far below what there is
        let reported = found.measure(&values).unwrap().max as f32;
        assert!(reported > 0.25 * after, "{reported} {after}");
    }

    #[test]
    fn creases_and_edges_within_a_chart_are_no_seams() {
        let settings = BakeSettings { size: [64; 2], ..BakeSettings::default() };
        let step = vec![Vec3::X; 64 * 64];
        assert!(lookups(&halves(0.5), &settings).unwrap().measure(&step).is_none());
        // smooth shading makes no crease smooth
        for (angle, is_seam) in [(0.5, false), (0.2, true)] {
            let mut scene = halves(angle);
            let Geometry::Triangles(triangles) = &mut scene.meshes[0].geometry else { unreachable!() };
            triangles.normals = vec![Vec3::Z; 6];
            let found = lookups(&scene, &settings).unwrap().measure(&step);
            assert_eq!(found.is_some(), is_seam, "{angle}");
        }
        let mut scene = halves(0.0);
        let Geometry::Triangles(triangles) = &mut scene.meshes[0].geometry else { unreachable!() };
        triangles.texcoords[0] =
            [[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.1], [0.9, 0.9], [0.1, 0.9]].map(Vec2::from).to_vec();
        assert!(lookups(&scene, &settings).unwrap().measure(&step).is_none());
        // tangent space turns at seams
        let tangent = BakeSettings { map: Map::Normal, space: Space::Tangent, ..settings };
        assert!(lookups(&halves(0.0), &tangent).is_none());
    }
}
