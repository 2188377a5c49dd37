//! Which points of surfaces the texels of a texture show.

use glam::{DVec2, Vec2};
use rayon::prelude::*;

/// Points that each texel is divided into, and their places in it: a rotated grid.
pub const POINTS: usize = 4;
const PLACES: [DVec2; POINTS] =
    [DVec2::new(0.375, 0.125), DVec2::new(0.875, 0.375), DVec2::new(0.125, 0.625), DVec2::new(0.625, 0.875)];

/// Rows of a texture whose points are found at a time, by one thread.
pub const BAND: u32 = 16;

/// Barycentric weight from which on a point counts as within a triangle, not on its edge.
const INSIDE: f64 = 1e-3;

/// Triangles of a surface in the texture: corners by their texture coordinates.
pub struct Layout {
    /// Width and height of the texture in texels.
    pub size: [u32; 2],
    /// Triangles, with texture coordinates in units of the texture.
    triangles: Vec<FlatTriangle>,
    /// Triangles that reach into each band of rows.
    bands: Vec<Vec<u32>>,
}

/// A triangle in the texture.
struct FlatTriangle {
    surface: u32,
    triangle: u32,
    /// Corners in texels, in the tile that begins at (0, 0).
    corners: [DVec2; 3],
}

/// A point of a surface, and the texel that shows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexelPoint {
    /// Column and row of the texel.
    pub texel: [u32; 2],
    /// Index of the surface.
    pub surface: u32,
    /// Index of the triangle in the surface's mesh.
    pub triangle: u32,
    /// Barycentric weights of the triangle's second and third vertex.
    pub barycentrics: Vec2,
}

/// The points of a band of rows.
#[derive(Default)]
pub struct Band {
    /// Points by texel: row after row, those of a texel together.
    pub points: Vec<TexelPoint>,
    /// Places that two triangles share, not only along their edges.
    pub overlaps: u64,
}

impl Layout {
    /// `surfaces`: texture coordinates of the corners of each triangle; those of triangles without
    /// an area in the texture are left out. A triangle may lie in any tile of a repeated texture.
    pub fn new(size: [u32; 2], surfaces: &[&[[Vec2; 3]]]) -> Self {
        let scale = DVec2::new(size[0].into(), size[1].into());
        let flat = |(surface, triangle, corners): (usize, usize, &[Vec2; 3])| {
            let tile = corners.iter().fold(Vec2::INFINITY, |least, c| least.min(*c)).floor().as_dvec2();
            let corners = corners.map(|c| (c.as_dvec2() - tile) * scale);
            let area = (corners[1] - corners[0]).perp_dot(corners[2] - corners[0]);
            // so large a triangle repeats the texture, and shows no texel of its own
            let is_within = corners.iter().all(|c| c.cmple(2.0 * scale).all());
            (area != 0.0 && is_within).then_some(FlatTriangle {
                surface: surface as u32,
                triangle: triangle as u32,
                corners,
            })
        };
        let all = surfaces.iter().enumerate().flat_map(|(s, t)| t.iter().enumerate().map(move |(k, c)| (s, k, c)));
        let triangles: Vec<FlatTriangle> = all.filter_map(flat).collect();

        // rows may wrap around
        let mut bands = vec![Vec::new(); size[1].div_ceil(BAND) as usize];
        for (index, triangle) in triangles.iter().enumerate() {
            let (low, high) = rows(triangle);
            let touched = (low..=high).map(|y| y.rem_euclid(size[1].into()) / i64::from(BAND));
            let mut last = -1;
            for band in touched {
                if band != last && bands[band as usize].last() != Some(&(index as u32)) {
                    bands[band as usize].push(index as u32);
                }
                last = band;
            }
        }
        Self { size, triangles, bands }
    }

    /// Number of bands of rows.
    pub fn band_count(&self) -> usize {
        self.bands.len()
    }

    /// The points of several bands, which are found in parallel.
    pub fn points(&self, bands: std::ops::Range<usize>) -> Vec<Band> {
        bands.into_par_iter().map(|band| self.points_of_band(band)).collect()
    }

    /// Share of the places that some triangle covers at which another lies, too; 0 where texture
    /// coordinates are unique.
    pub fn overlap(&self) -> f64 {
        let counted = (0..self.band_count()).into_par_iter().map(|band| {
            let band = self.points_of_band(band);
            [band.overlaps, band.points.len() as u64]
        });
        let [overlaps, points] = counted.reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        overlaps as f64 / points.max(1) as f64
    }

    fn points_of_band(&self, band: usize) -> Band {
        const NOBODY: u32 = u32::MAX;
        let width = self.size[0] as usize;
        let first = band as u32 * BAND;
        let rows_here = BAND.min(self.size[1] - first) as usize;
        // the triangle at each place, and whether it alone is within it
        let mut owners = vec![(NOBODY, false, Vec2::ZERO); rows_here * width * POINTS];
        let mut overlaps = 0;

        // places within triangles
        for &index in &self.bands[band] {
            let triangle = &self.triangles[index as usize];
            self.visit(triangle, first, |at, corner| {
                for (place, owner) in PLACES.iter().zip(&mut owners[at * POINTS..][..POINTS]) {
                    let Some(weights) = weights(&triangle.corners, corner + *place) else { continue };
                    let is_inside = weights.iter().all(|w| *w > INSIDE);
                    if owner.0 == NOBODY {
                        let [_, u, v] = weights;
                        *owner = (index, is_inside, Vec2::new(u as f32, v as f32));
                    } else if is_inside && owner.1 {
                        owner.1 = false;
                        overlaps += 1;
                    }
                }
            });
        }

        // texels of which a triangle has a corner or a strip only: the point nearest to the centre
        for &index in &self.bands[band] {
            let triangle = &self.triangles[index as usize];
            self.visit(triangle, first, |at, corner| {
                let owners = &mut owners[at * POINTS..][..POINTS];
                if owners.iter().any(|owner| owner.0 != NOBODY) {
                    return;
                }
                let centre = corner + 0.5;
                let (nearest, [_, u, v]) = nearest_point(&triangle.corners, centre);
                if (nearest - centre).abs().max_element() < 0.5 {
                    owners[0] = (index, false, Vec2::new(u as f32, v as f32));
                }
            });
        }

        // as a list
        let owned = owners.iter().enumerate().filter(|(_, owner)| owner.0 != NOBODY);
        let points = owned.map(|(at, (index, _, barycentrics))| {
            let (x, y) = (at / POINTS % width, at / POINTS / width);
            let FlatTriangle { surface, triangle, .. } = self.triangles[*index as usize];
            TexelPoint { texel: [x as u32, first + y as u32], surface, triangle, barycentrics: *barycentrics }
        });
        Band { points: points.collect(), overlaps }
    }

    /// Calls `visit` with each texel of a band that a triangle's bounds touch: its index in the
    /// band, and its corner in the coordinates of the triangle.
    fn visit(&self, triangle: &FlatTriangle, first: u32, mut visit: impl FnMut(usize, DVec2)) {
        let [width, height] = self.size.map(i64::from);
        let last = (first + BAND).min(self.size[1]);
        let (low, high) = rows(triangle);
        let [left, right] = [f64::min as fn(f64, f64) -> f64, f64::max]
            .map(|pick| triangle.corners.iter().map(|c| c.x).reduce(pick).unwrap_or_default().floor() as i64);
        for y in low..=high {
            let row = y.rem_euclid(height) as u32;
            if row < first || row >= last {
                continue;
            }
            for x in left..=right {
                let column = x.rem_euclid(width);
                visit(((i64::from(row - first)) * width + column) as usize, DVec2::new(x as f64, y as f64));
            }
        }
    }
}

/// The first and the last row of texels that a triangle's bounds touch.
fn rows(triangle: &FlatTriangle) -> (i64, i64) {
    let y = triangle.corners.map(|c| c.y);
    (y[0].min(y[1]).min(y[2]).floor() as i64, y[0].max(y[1]).max(y[2]).floor() as i64)
}

/// Barycentric weights of a point; `None` outside of the triangle.
fn weights(corners: &[DVec2; 3], point: DVec2) -> Option<[f64; 3]> {
    let [a, b, c] = *corners;
    let area = (b - a).perp_dot(c - a);
    let u = (point - a).perp_dot(c - a) / area;
    let v = (b - a).perp_dot(point - a) / area;
    let weights = [1.0 - u - v, u, v];
    weights.iter().all(|w| *w >= 0.0).then_some(weights)
}

/// The point of a triangle that is nearest to another, and its weights.
fn nearest_point(corners: &[DVec2; 3], point: DVec2) -> (DVec2, [f64; 3]) {
    if let Some(weights) = weights(corners, point) {
        return (point, weights);
    }
    let mut nearest = (corners[0], [1.0, 0.0, 0.0]);
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        let along = ((point - a).dot(b - a) / (b - a).length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let found = a + along * (b - a);
        if (found - point).length_squared() < (nearest.0 - point).length_squared() {
            let mut weights = [0.0; 3];
            weights[k] = 1.0 - along;
            weights[(k + 1) % 3] = along;
            nearest = (found, weights);
        }
    }
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quad(low: Vec2, high: Vec2) -> [[Vec2; 3]; 2] {
        let [a, b, c, d] = [low, Vec2::new(high.x, low.y), high, Vec2::new(low.x, high.y)];
        [[a, b, c], [a, c, d]]
    }

    fn all_points(layout: &Layout) -> Vec<TexelPoint> {
        layout.points(0..layout.band_count()).into_iter().flat_map(|band| band.points).collect()
    }

    #[test]
    fn a_square_covers_its_texels_once() {
        let square = quad(Vec2::ZERO, Vec2::ONE);
        let layout = Layout::new([40, 24], &[&square]);
        let points = all_points(&layout);
        assert_eq!(points.len(), 40 * 24 * POINTS);
        assert_eq!(layout.overlap(), 0.0);
        // a point's texture coordinates are those of its place
        for p in &points {
            let [a, b, c] = square[p.triangle as usize];
            let at = a + p.barycentrics.x * (b - a) + p.barycentrics.y * (c - a);
            let texel = Vec2::new(p.texel[0] as f32, p.texel[1] as f32);
            let within = at * Vec2::new(40.0, 24.0) - texel;
            assert!(PLACES.iter().any(|place| (place.as_vec2() - within).length() < 1e-3), "{p:?}: {within}");
        }
    }

    #[test]
    fn tiles_and_borders_wrap_around() {
        // the same square in another tile, and one that crosses the border of tiles
        let moved = quad(Vec2::new(3.0, -2.0), Vec2::new(4.0, -1.0));
        assert_eq!(all_points(&Layout::new([8, 8], &[&moved])).len(), 64 * POINTS);
        let across = quad(Vec2::new(0.75, 0.75), Vec2::new(1.25, 1.25));
        let points = all_points(&Layout::new([8, 8], &[&across]));
        assert_eq!(points.len(), 16 * POINTS);
        assert!(points.iter().all(|p| p.texel.iter().all(|&x| !(2..6).contains(&x))));
    }

    #[test]
    fn overlaps_are_found_and_shared_edges_are_none() {
        let (left, right) = (quad(Vec2::ZERO, Vec2::new(0.5, 1.0)), quad(Vec2::new(0.5, 0.0), Vec2::ONE));
        assert_eq!(Layout::new([64, 64], &[&left, &right]).overlap(), 0.0);
        assert!((Layout::new([64, 64], &[&left, &left]).overlap() - 1.0).abs() < 0.05);
        let mirrored = left.map(|[a, b, c]| [a, c, b]);
        assert!((Layout::new([64, 64], &[&left, &mirrored]).overlap() - 1.0).abs() < 0.05);
    }

    #[test]
    fn slivers_show_in_the_texels_that_they_touch() {
        // thinner than the distance of places
        let sliver = quad(Vec2::new(0.0, 0.5), Vec2::new(1.0, 0.5 + 1e-4));
        let points = all_points(&Layout::new([16, 16], &[&sliver]));
        assert_eq!(points.len(), 16);
        assert!(points.iter().all(|p| p.texel[1] == 8));
        // as small as a hundredth of a texel
        let dot = quad(Vec2::new(0.53, 0.53), Vec2::new(0.5301, 0.5301));
        assert_eq!(all_points(&Layout::new([16, 16], &[&dot])).len(), 1);
        // no area at all
        assert!(all_points(&Layout::new([16, 16], &[&quad(Vec2::ONE, Vec2::ONE)])).is_empty());
    }
}
