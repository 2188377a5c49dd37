//! Which of some choices are worth making: none of the others is better in one respect and no worse in the other.

/// For each point, whether another one dominates it: is less along one axis and no greater along the other. Points that are equal do not dominate each other,
/// and one that is not a number is dominated.
pub fn dominated(points: &[[f64; 2]]) -> Vec<bool> {
    let dominates = |a: &[f64; 2], b: &[f64; 2]| a[0] <= b[0] && a[1] <= b[1] && a != b;
    points.iter().map(|p| p.iter().any(|v| v.is_nan()) || points.iter().any(|q| dominates(q, p))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_another_one_beats_in_everything_is_dominated() {
        let points = [[1.0, 5.0], [2.0, 2.0], [3.0, 3.0], [5.0, 1.0], [5.0, 2.0], [1.0, 6.0], [f64::NAN, 0.0], [2.0, 2.0]];
        assert_eq!(dominated(&points), [false, false, true, false, true, true, true, false]);
        assert!(dominated(&[]).is_empty());
    }
}
