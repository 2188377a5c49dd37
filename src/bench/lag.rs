//! How much of the past frames show after a change.

use crate::measure::temporal::{Ghosting, Residual};

/// Adds to `ghosting` how much of `wrong`, the reference before the change, an image shows. `settled` is what the image ends at when nothing changes any more: what
/// is always wrong with it is no ghost. `None` where nothing differs.
pub fn add_ghost(
    ghosting: &mut Ghosting,
    (image, settled): (&[f32], &[f32]),
    (reference, wrong): (&[f32], &[f32]),
    mask: Option<&[f32]>,
) -> Option<Residual> {
    // as if it settled at the reference
    let shifted: Vec<f32> = image.iter().zip(settled).zip(reference).map(|((v, s), t)| v - s + t).collect();
    ghosting.add(&shifted, reference, wrong, mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lasting_error_is_no_ghost() {
        let (old, new) = ([0.0, 1.0], [1.0, 0.0]);
        // it ends a tenth too bright, and a quarter of the old is left
        let settled = [1.1, 0.1];
        let image = [0.85, 0.35];
        let mut ghosting = Ghosting::default();
        let left = add_ghost(&mut ghosting, (&image, &settled), (&new, &old), None).unwrap();
        assert!((left.share - 0.25).abs() < 1e-6 && (ghosting.energy() - 0.0625).abs() < 1e-6);
    }
}
