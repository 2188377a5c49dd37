//! Polygons to triangles.

use earcut::Earcut;
use glam::DVec3;

/// Most corners of a polygon that is cut. Of one that crosses itself cutting costs the square of
/// its corners: a second for so many.
pub(super) const MAX_CORNERS: usize = 10_000;

/// Cuts concave polygons; keeps its buffers from one to the next.
#[derive(Default)]
pub(super) struct PolygonTriangulator {
    earcut: Earcut<f64>,
    points: Vec<[f64; 2]>,
    triangles: Vec<u32>,
}

impl PolygonTriangulator {
    /// The triangles of a polygon of finite corners that no fan from its first corner can fill, as
    /// indices of corners and with the polygon's orientation. `None` where the fan is right, or
    /// nothing is: the polygon is a triangle, convex, a quad whose fan starts at the dent, has no
    /// area, or more than [`MAX_CORNERS`].
    pub(super) fn cut(
        &mut self,
        corners: impl Iterator<Item = DVec3> + Clone,
    ) -> Option<impl Iterator<Item = [usize; 3]>> {
        self.project(corners)?;
        if self.points.len() > MAX_CORNERS {
            return None;
        }
        let area = |[a, b, c]: [[f64; 2]; 3]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        let points = &self.points;
        if points[1..].windows(2).all(|w| area([points[0], w[0], w[1]]) >= 0.0) {
            return None;
        }
        self.earcut.earcut_slice(points, &[], &mut self.triangles);
        (!self.triangles.is_empty()).then(|| {
            self.triangles.as_chunks::<3>().0.iter().map(move |t| {
                let t = t.map(|i| i as usize);
                // the crate's triangles turn one way, whichever the polygon turns
                if area(t.map(|i| points[i])) < 0.0 { [t[0], t[2], t[1]] } else { t }
            })
        })
    }

    /// Drops the axis along which the polygon's normal (by Newell's method) is longest, so that the
    /// polygon turns counter-clockwise. `None` for triangles, and if there is no normal.
    fn project(&mut self, corners: impl Iterator<Item = DVec3> + Clone) -> Option<()> {
        // relative to a corner, so that no digits are lost far from the origin
        let origin = corners.clone().next()?;
        let relative = corners.map(|p| p - origin);
        let next = relative.clone().skip(1);
        // the last corner and the first, which is the origin, add nothing
        let normal: DVec3 = relative.clone().zip(next).map(|(p, q)| p.cross(q)).sum();
        let axis = normal.abs().max_position();
        let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
        if normal[axis] < 0.0 {
            (u, v) = (v, u);
        }
        self.points.clear();
        self.points.extend(relative.map(|p| [p[u], p[v]]));
        (self.points.len() > 3 && normal[axis] != 0.0).then_some(())
    }
}
