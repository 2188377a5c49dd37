//! Labels beside points, which cover neither each other nor anything else, where there is room.

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    pub x: f64,
    pub y: f64,
    pub width: f64,
    pub height: f64,
}

impl Rect {
    /// The rectangle with these two corners, opposite each other.
    pub fn between(a: [f64; 2], b: [f64; 2]) -> Self {
        Self { x: a[0].min(b[0]), y: a[1].min(b[1]), width: (a[0] - b[0]).abs(), height: (a[1] - b[1]).abs() }
    }

    /// The rectangle, larger by `by` on each side.
    pub fn grown(self, by: f64) -> Self {
        Self { x: self.x - by, y: self.y - by, width: self.width + 2.0 * by, height: self.height + 2.0 * by }
    }

    /// Area that both cover.
    pub fn overlap(&self, other: &Self) -> f64 {
        let along = |a: f64, wa: f64, b: f64, wb: f64| ((a + wa).min(b + wb) - a.max(b)).max(0.0);
        along(self.x, self.width, other.x, other.width) * along(self.y, self.height, other.y, other.height)
    }

    fn contains(&self, other: &Self) -> bool {
        self.overlap(other) >= other.width * other.height - 1e-9
    }
}

/// Distances of a label from its point, pixels: the nearest that is free is taken.
const DISTANCES: [f64; 5] = [7.0, 14.0, 26.0, 42.0, 64.0];
/// Directions from a point, from the most usual one.
const DIRECTIONS: [[f64; 2]; 8] =
    [[1.0, 0.0], [1.0, -1.0], [1.0, 1.0], [0.0, -1.0], [0.0, 1.0], [-1.0, 0.0], [-1.0, -1.0], [-1.0, 1.0]];
/// A label as far away as this has a line to its point.
pub const LINE_FROM: f64 = 20.0;

/// Where a label goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedLabel {
    pub rect: Rect,
    /// Distance from its point in pixels.
    pub distance: f64,
}

/// Places labels of these sizes beside their points, in order, within `frame` and outside of
/// `obstacles`. A label that has room nowhere covers as little as it can.
pub fn place(labels: &[([f64; 2], [f64; 2])], frame: Rect, obstacles: &[Rect]) -> Vec<PlacedLabel> {
    let mut taken = obstacles.to_vec();
    let mut placed = Vec::with_capacity(labels.len());
    for &(point, size) in labels {
        let candidates =
            DISTANCES.iter().flat_map(|&d| DIRECTIONS.iter().map(move |&dir| (d, beside(point, size, dir, d))));
        let cost = |rect: &Rect| -> f64 { taken.iter().map(|t| t.overlap(&rect.grown(1.5))).sum() };
        let mut best: Option<(f64, f64, Rect)> = None;
        for (distance, rect) in candidates.filter(|(_, rect)| frame.contains(rect)) {
            let covered = cost(&rect);
            if best.is_none_or(|(least, ..)| covered < least) {
                best = Some((covered, distance, rect));
            }
            if covered == 0.0 {
                break;
            }
        }
        // a label that is wider than the frame
        let (_, distance, rect) = best.unwrap_or((0.0, 0.0, beside(point, size, DIRECTIONS[0], DISTANCES[0])));
        taken.push(rect);
        placed.push(PlacedLabel { rect, distance });
    }
    placed
}

/// A rectangle of this size beside a point, in a direction and at a distance.
fn beside(point: [f64; 2], size: [f64; 2], direction: [f64; 2], distance: f64) -> Rect {
    // by its nearest edge or corner; on a diagonal as far as along an axis
    let length = direction[0].hypot(direction[1]);
    let corner = |k: usize| {
        let edge = match direction[k] {
            d if d > 0.0 => 0.0,
            d if d < 0.0 => -size[k],
            _ => -0.5 * size[k],
        };
        point[k] + edge + direction[k] / length * distance
    };
    Rect { x: corner(0), y: corner(1), width: size[0], height: size[1] }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: Rect = Rect { x: 0.0, y: 0.0, width: 400.0, height: 300.0 };

    fn covered(placed: &[PlacedLabel]) -> f64 {
        let of = |k: usize| placed[..k].iter().map(|p| p.rect.overlap(&placed[k].rect)).sum::<f64>();
        (0..placed.len()).map(of).sum()
    }

    #[test]
    fn labels_of_points_on_top_of_each_other_are_apart() {
        let labels: Vec<_> = (0..7).map(|k| ([200.0 + f64::from(k), 150.0], [60.0, 14.0])).collect();
        let placed = place(&labels, FRAME, &[]);
        assert_eq!(covered(&placed), 0.0, "{placed:?}");
        assert!(placed[0].distance == DISTANCES[0] && placed.iter().all(|p| FRAME.contains(&p.rect)));
    }

    #[test]
    fn labels_keep_clear_of_obstacles_and_edges() {
        let corner = ([398.0, 2.0], [60.0, 14.0]);
        let line = Rect { x: 0.0, y: 0.0, width: 396.0, height: 30.0 };
        let placed = place(&[corner], FRAME, &[line])[0];
        assert!(FRAME.contains(&placed.rect) && placed.rect.overlap(&line) == 0.0, "{placed:?}");
        // no room at all: it is there all the same
        assert_eq!(place(&[corner], Rect { width: 10.0, ..FRAME }, &[]).len(), 1);
    }
}
