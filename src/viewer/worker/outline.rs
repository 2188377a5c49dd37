//! The outline of objects in the image: where rays that hit one lie beside rays that do not.

use std::collections::HashMap;
use std::ops::Range;

use glam::{DVec3, Vec2};

use crate::error::Result;
use crate::renderer::interactive::Interactive;
use crate::scene::{Camera, Projection};

/// Corners that a line leaves out lie this close to it, in cells of the grid.
const STRAIGHT: f32 = 0.8;
/// Most rays that are traced for an outline; fewer than pixels make it coarser.
const RAYS: f64 = 60_000.0;

/// Points of the lines around objects, from (0, 0) at the top left of the view to (1, 1).
/// `bounds`: the objects' in world space, if they are where it says. `size`: the view's, pixels.
///
/// # Errors
/// Those of the device.
pub fn lines(
    session: &Interactive,
    camera: &Camera,
    objects: &Range<usize>,
    bounds: Option<(DVec3, DVec3)>,
    size: [u32; 2],
) -> Result<Vec<Vec<[f32; 2]>>> {
    let pixels = size.map(f64::from);
    let aspect = pixels[0] / pixels[1];
    let [lo, hi] = bounds.and_then(|b| rectangle(camera, b, aspect)).unwrap_or([[0.0; 2], [1.0; 2]]);

    // rays in a grid over the rectangle, as fine as the pixels if there are not too many
    let area = (hi[0] - lo[0]) * pixels[0] * (hi[1] - lo[1]) * pixels[1];
    let step = (area / RAYS).sqrt().max(1.0);
    let count = |k: usize| ((hi[k] - lo[k]) * pixels[k] / step).ceil().max(1.0) as usize;
    let grid = Grid { columns: count(0), rows: count(1) };
    let place = |x: f64, y: f64| {
        let along = |k: usize, at: f64, n: usize| lo[k] + (hi[k] - lo[k]) * at / n as f64;
        [along(0, x, grid.columns), along(1, y, grid.rows)]
    };
    let points: Vec<[f64; 2]> = (0..grid.columns * grid.rows)
        .map(|k| place((k % grid.columns) as f64 + 0.5, (k / grid.columns) as f64 + 0.5))
        .collect();
    let hits = session.objects_at(camera, &points, aspect)?;
    let mask: Vec<bool> = hits.into_iter().map(|hit| hit.is_some_and(|hit| objects.contains(&hit))).collect();
    let points = |line: Vec<Vec2>| {
        let place = |p: Vec2| place(f64::from(p.x), f64::from(p.y)).map(|at| at as f32);
        straightened(&line).into_iter().map(place).collect()
    };
    Ok(joined(&grid.borders(&mask)).into_iter().map(points).collect())
}

/// The part of the view that shows bounds, as its top left and its bottom right; `None` where a
/// corner is not in front of the camera, or nothing of it is in view.
fn rectangle(camera: &Camera, (lo, hi): (DVec3, DVec3), aspect: f64) -> Option<[[f64; 2]; 2]> {
    let to_camera = camera.camera_to_world.inverse();
    let mut out = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for k in 0..8 {
        let corner =
            DVec3::from_array(std::array::from_fn(|axis| if k >> axis & 1 == 0 { lo[axis] } else { hi[axis] }));
        let p = to_camera.transform_point3(corner);
        let (x, y) = match camera.projection {
            Projection::Perspective { .. } if p.z >= 0.0 => return None,
            Projection::Perspective { fov_y } => {
                let half = (0.5 * fov_y).tan() * -p.z;
                (p.x / (half * aspect), p.y / half)
            }
            Projection::Orthographic { half_height } => (p.x / (half_height * aspect), p.y / half_height),
        };
        for (axis, at) in [0.5 + 0.5 * x, 0.5 - 0.5 * y].into_iter().enumerate() {
            out[0][axis] = out[0][axis].min(at);
            out[1][axis] = out[1][axis].max(at);
        }
    }
    let out = out.map(|point| point.map(|at| at.clamp(0.0, 1.0)));
    (out[0][0] < out[1][0] && out[0][1] < out[1][1]).then_some(out)
}

/// Cells of a grid, rows from the top.
struct Grid {
    columns: usize,
    rows: usize,
}

impl Grid {
    /// Lines between cells that are of the object and others (marching squares), in cells from the
    /// top left. What lies beside the grid is not of the object.
    fn borders(&self, mask: &[bool]) -> Vec<[Vec2; 2]> {
        let is_inside = |x: usize, y: usize| {
            // shifted by one cell
            (1..=self.columns).contains(&x) && (1..=self.rows).contains(&y) && mask[(y - 1) * self.columns + x - 1]
        };
        let mut lines = Vec::new();
        for y in 0..=self.rows {
            for x in 0..=self.columns {
                let [a, b, c, d] = [is_inside(x, y), is_inside(x + 1, y), is_inside(x, y + 1), is_inside(x + 1, y + 1)];
                let middle = Vec2::new(x as f32, y as f32);
                let [top, left, right, bottom] =
                    [(0.0, -0.5), (-0.5, 0.0), (0.5, 0.0), (0.0, 0.5)].map(|(dx, dy)| middle + Vec2::new(dx, dy));
                // each corner that differs from both of its neighbours is cut off
                if a != b && a != c {
                    lines.push([top, left]);
                }
                if d != b && d != c {
                    lines.push([right, bottom]);
                }
                if a == b && c == d && a != c {
                    lines.push([left, right]);
                } else if a == c && b == d && a != b {
                    lines.push([top, bottom]);
                } else if b != a && b != d && a == d && b != c && c != a {
                    // both corners are cut off above
                } else if b != a && b != d {
                    lines.push([top, right]);
                } else if c != a && c != d {
                    lines.push([left, bottom]);
                }
            }
        }
        lines
    }
}

/// Joins lines that share an end to longer ones. Ends lie on halves.
fn joined(lines: &[[Vec2; 2]]) -> Vec<Vec<Vec2>> {
    let key = |p: Vec2| [(2.0 * p.x).round() as i32, (2.0 * p.y).round() as i32];
    let mut at: HashMap<[i32; 2], Vec<usize>> = HashMap::new();
    for (k, line) in lines.iter().enumerate() {
        line.iter().for_each(|end| at.entry(key(*end)).or_default().push(k));
    }
    let mut used = vec![false; lines.len()];
    let mut out = Vec::new();
    for (start, line) in lines.iter().enumerate() {
        if std::mem::replace(&mut used[start], true) {
            continue;
        }
        // around the object, back to where it began
        let mut points = line.to_vec();
        while let Some(end) = points.last().copied()
            && let Some(next) = at.get(&key(end)).into_iter().flatten().copied().find(|k| !used[*k])
        {
            used[next] = true;
            let [a, b] = lines[next];
            points.push(if key(a) == key(end) { b } else { a });
        }
        out.push(points);
    }
    out
}

/// A line of fewer points, which passes close to those that it leaves out (Douglas and Peucker).
fn straightened(points: &[Vec2]) -> Vec<Vec2> {
    let [Some(&first), Some(&last)] = [points.first(), points.last()] else { return Vec::new() };
    let along = (last - first).normalize_or_zero();
    let distance = |p: Vec2| {
        let offset = p - first;
        // a closed line has no direction
        if along == Vec2::ZERO { offset.length() } else { offset.perp_dot(along).abs() }
    };
    let inner = points.len().saturating_sub(1).max(1);
    let farthest = (1..inner).max_by(|a, b| distance(points[*a]).total_cmp(&distance(points[*b])));
    match farthest.filter(|k| distance(points[*k]) > STRAIGHT) {
        Some(k) => {
            let mut out = straightened(&points[..=k]);
            out.pop();
            out.extend(straightened(&points[k..]));
            out
        }
        None => vec![first, last],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders_enclose_what_is_inside() {
        // one cell is enclosed by a diamond
        let one = Grid { columns: 3, rows: 3 };
        let mut mask = vec![false; 9];
        mask[4] = true;
        let lines = one.borders(&mask);
        assert_eq!(lines.len(), 4, "{lines:?}");
        // each end is the beginning of another: it is closed
        let ends: Vec<Vec2> = lines.iter().flatten().copied().collect();
        assert!(ends.iter().all(|end| ends.iter().filter(|other| *other == end).count() == 2), "{ends:?}");
        let middle = ends.iter().copied().sum::<Vec2>() / ends.len() as f32;
        assert_eq!(middle, Vec2::splat(1.5), "around the middle of its cell");

        // all of a grid is enclosed by its border, none of it by nothing
        let all = Grid { columns: 4, rows: 2 };
        assert_eq!(all.borders(&[true; 8]).len(), 2 * (4 + 2 - 2) + 4);
        assert!(all.borders(&[false; 8]).is_empty());
    }

    #[test]
    fn lines_are_joined_and_straight() {
        // a square of cells
        let grid = Grid { columns: 20, rows: 20 };
        let mask: Vec<bool> = (0..400).map(|k| (4..16).contains(&(k % 20)) && (4..16).contains(&(k / 20))).collect();
        let [line] = &joined(&grid.borders(&mask))[..] else { panic!("one line") };
        assert_eq!(line.first(), line.last(), "it is closed");
        let straight = straightened(line);
        assert!((5..=7).contains(&straight.len()), "{straight:?}");
        assert!(straight.iter().all(|p| [p.x, p.y].iter().any(|v| (v - 4.0).abs() < 1.0 || (v - 16.0).abs() < 1.0)));
        // two of them
        let two: Vec<bool> = (0..400).map(|k| k / 20 == 3 || k / 20 == 9).collect();
        assert_eq!(joined(&grid.borders(&two)).len(), 2);
        assert!(straightened(&[]).is_empty());
    }

    #[test]
    fn bounds_are_looked_for_where_they_are_seen() {
        let camera = Camera::look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 0.8);
        let around = |at: DVec3| (at - 0.5, at + 0.5);
        let [lo, hi] = rectangle(&camera, around(DVec3::ZERO), 1.5).unwrap();
        assert!((lo[0] + hi[0] - 1.0).abs() < 1e-12 && (lo[1] + hi[1] - 1.0).abs() < 1e-12, "in the middle");
        assert!(hi[0] - lo[0] < hi[1] - lo[1], "of a wide view");
        assert!(rectangle(&camera, around(DVec3::new(0.0, 0.0, 5.0)), 1.5).is_none(), "the camera is in it");
        assert!(rectangle(&camera, around(DVec3::new(50.0, 0.0, 0.0)), 1.5).is_none(), "out of view");
    }
}
