//! Points of a chart that no other dominates: less along one axis, no greater along the other.

use super::chart::{Mark, Point, Series};

/// Beyond the ends of every axis: points there are drawn at the end.
pub const BEYOND: f64 = 1e200;

/// For each point, whether another is less along one axis and no greater along the other.
pub fn dominated(points: &[[f64; 2]]) -> Vec<bool> {
    let dominates = |a: &[f64; 2], b: &[f64; 2]| a[0] <= b[0] && a[1] <= b[1] && a != b;
    points.iter().map(|p| points.iter().any(|q| dominates(q, p))).collect()
}

/// The border of what points dominate, in steps from the chart's upper end to its right end.
pub fn front(points: &[Point]) -> Option<Series> {
    let places: Vec<[f64; 2]> = points.iter().map(|p| [p.x, p.y]).collect();
    let best = places.iter().zip(dominated(&places)).filter(|(_, is_dominated)| !is_dominated);
    let mut best: Vec<[f64; 2]> = best.map(|(p, _)| *p).collect();
    best.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let (first, last) = (best.first()?, best.last()?);
    let steps = best.windows(2).flat_map(|w| [[w[1][0], w[0][1]], w[1]]);
    let corners = [[first[0], BEYOND], *first].into_iter().chain(steps).chain([[BEYOND, last[1]]]);
    let corner = |[x, y]: [f64; 2]| Point { label: "Pareto front".into(), ..Point::from((x, y)) };
    Some(Series { name: "Pareto front".into(), mark: Mark::Border, points: corners.map(corner).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_another_one_beats_in_everything_is_dominated() {
        let points = [[1.0, 5.0], [2.0, 2.0], [3.0, 3.0], [5.0, 1.0], [5.0, 2.0], [1.0, 6.0], [2.0, 2.0]];
        assert_eq!(dominated(&points), [false, false, true, false, true, true, false]);
        let named = |(x, y)| Point::from((x, y));
        let front = front(&[(3.0, 1.0), (1.0, 3.0), (2.0, 2.0), (3.0, 3.0)].map(named)).unwrap();
        let corners: Vec<_> = front.points.iter().map(|p| (p.x, p.y)).collect();
        let steps = [(1.0, 3.0), (2.0, 3.0), (2.0, 2.0), (3.0, 2.0), (3.0, 1.0)];
        assert_eq!(corners[1..6], steps);
        assert!(corners[0] == (1.0, BEYOND) && corners[6] == (BEYOND, 1.0) && super::front(&[]).is_none());
    }
}
