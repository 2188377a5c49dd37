//! Which pixels a change is about, told from what each of them shows.

use super::Surface;
use crate::film::camera::CameraRecord;

/// A point that moved by less, by the length that occlusion reaches, has not moved.
const SAME: f64 = 1e-5;
/// Footprints of a pixel within which a point is the one that was seen, at a slant.
const SEEN: f64 = 4.0;

type Surfaces = [Option<Surface>];

fn distance(a: [f32; 3], b: [f32; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>().sqrt()
}

/// 1 where a camera that stands still shows the same surface as before, and that did not move.
pub fn unchanged(now: &Surfaces, before: &Surfaces, reach: f64) -> Vec<f32> {
    let same = |pair: (&Option<Surface>, &Option<Surface>)| match pair {
        (Some(n), Some(b)) => {
            let stayed = distance(n.position, n.before) <= SAME * reach;
            f32::from(u8::from(stayed && distance(n.position, b.position) <= SAME * reach))
        }
        _ => 0.0,
    };
    now.iter().zip(before).map(same).collect()
}

/// 1 where a pixel shows what another camera, which saw `before`, did not.
pub fn newly_seen(now: &Surfaces, before: &Surfaces, camera: &CameraRecord, size: [u32; 2]) -> Vec<f32> {
    let seen = |s: &Surface| {
        let Some((at, footprint)) = project(s.position, camera, size) else { return false };
        let [x, y] = at.map(|v| v.floor() as i64);
        (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (x + dx, y + dy))).any(|(x, y)| {
            let inside = (0..i64::from(size[0])).contains(&x) && (0..i64::from(size[1])).contains(&y);
            let there = inside.then(|| before[(y * i64::from(size[0]) + x) as usize]).flatten();
            there.is_some_and(|b| distance(b.position, s.position) <= SEEN * footprint)
        })
    };
    now.iter().map(|s| f32::from(u8::from(s.as_ref().is_some_and(|s| !seen(s))))).collect()
}

/// Position of a point in the image and size of a pixel there, pixels; `None` behind the camera.
fn project(p: [f32; 3], camera: &CameraRecord, size: [u32; 2]) -> Option<([f64; 2], f64)> {
    let m = camera.camera_to_world;
    let from_eye = [0, 1, 2].map(|k| f64::from(p[k] - m[k][3]));
    // the camera's axes are the columns, unit vectors
    let [x, y, z] = [0, 1, 2].map(|c| (0..3).map(|k| f64::from(m[k][c]) * from_eye[k]).sum::<f64>());
    let depth = if camera.orthographic { 1.0 } else { -z };
    if depth <= 0.0 {
        return None;
    }
    let half = camera.view.map(|v| f64::from(v) * depth);
    let size = size.map(f64::from);
    Some(([(0.5 + 0.5 * x / half[0]) * size[0], (0.5 - 0.5 * y / half[1]) * size[1]], 2.0 * half[1] / size[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(position: [f32; 3]) -> Option<Surface> {
        Some(Surface { position, before: position })
    }

    #[test]
    fn what_moved_is_left_out() {
        let before = [at([0.0; 3]), at([1.0, 0.0, 0.0]), at([2.0, 0.0, 0.0]), None];
        let slid = Some(Surface { position: [1.0, 0.0, 0.0], before: [0.9, 0.0, 0.0] });
        let now = [at([0.0; 3]), slid, at([2.1, 0.0, 0.0]), at([3.0, 0.0, 0.0])];
        assert_eq!(unchanged(&now, &before, 1.0), [1.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn what_was_not_in_the_image_is_new() {
        let rows = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let camera =
            CameraRecord { camera_to_world: rows, view: [1.0, 1.0], orthographic: false, clip: [0.0, f32::INFINITY] };
        // pixels of a plane at distance 2: their middles are at -1, 1
        let before = [at([-1.0, 1.0, -2.0]), at([1.0, 1.0, -2.0]), at([-1.0, -1.0, -2.0]), at([1.0, -1.0, -20.0])];
        let (at_middle, footprint) = project([-1.0, 1.0, -2.0], &camera, [2, 2]).unwrap();
        assert_eq!((at_middle, footprint), ([0.5, 0.5], 2.0));
        let now = [at([-1.0, 1.0, -2.0]), at([30.0, 1.0, -2.0]), at([0.0, 0.0, 5.0]), None];
        assert_eq!(newly_seen(&now, &before, &camera, [2, 2]), [0.0, 1.0, 1.0, 0.0]);
    }
}
