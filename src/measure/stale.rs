//! Pixels that keep what was right before a change, by more than chance explains.

/// Standard deviations that chance does not explain.
const SIGMAS: f64 = 5.0;
/// Half side of the squares over which deviations are pooled, pixels.
const POOL: i64 = 2;
/// A difference that an 8-bit image does not show counts as noise.
const HALF_STEP: f64 = 1.0 / 510.0;

/// Images of runs that never saw the old: what chance does to a pixel.
pub struct FreshImages {
    size: [u32; 2],
    sums: Vec<f64>,
    squares: Vec<f64>,
    count: usize,
}

impl FreshImages {
    /// No image yet, of this size and one value per pixel.
    pub fn new(size: [u32; 2]) -> Self {
        let pixels = size[0] as usize * size[1] as usize;
        Self { size, sums: vec![0.0; pixels], squares: vec![0.0; pixels], count: 0 }
    }

    /// Adds an image.
    pub fn add(&mut self, image: &[f32]) {
        for ((sum, square), v) in self.sums.iter_mut().zip(&mut self.squares).zip(image) {
            *sum += f64::from(*v);
            *square += f64::from(*v).powi(2);
        }
        self.count += 1;
    }

    /// Number of pixels of an image that are off from the mean of these towards `old`, where that
    /// differs from `reference`, beyond five standard deviations. Only pixels whose `mask` is above
    /// 0 count.
    pub fn stale_pixels(&self, image: &[f32], mask: &[f32], [reference, old]: [&[f32]; 2]) -> u64 {
        let runs = self.count as f64;
        let moments = self.sums.iter().zip(&self.squares);
        let scatter: Vec<f64> = moments.map(|(s, q)| ((q - s * s / runs) / (runs - 1.0)).max(0.0)).collect();
        let variances = pool(&scatter, mask, self.size);
        let is_stale = |k: &usize| {
            let k = *k;
            let towards = f64::from(old[k] - reference[k]);
            let off = (f64::from(image[k]) - self.sums[k] / runs) * towards.signum();
            // of one image and of a mean of some
            let variance = variances[k] * (1.0 + 1.0 / runs) + HALF_STEP.powi(2);
            mask[k] > 0.0 && towards != 0.0 && off > SIGMAS * variance.sqrt()
        };
        (0..image.len()).filter(is_stale).count() as u64
    }
}

/// Mean variance of each pixel, over squares of pixels around it that count.
fn pool(variances: &[f64], mask: &[f32], size: [u32; 2]) -> Vec<f64> {
    let [width, height] = size.map(i64::from);
    let neighbourhood = |k: usize| {
        let (x, y) = (k as i64 % width, k as i64 / width);
        let (mut sum, mut n) = (0.0, 0.0);
        for v in (y - POOL).max(0)..=(y + POOL).min(height - 1) {
            for u in (x - POOL).max(0)..=(x + POOL).min(width - 1) {
                let at = (v * width + u) as usize;
                if mask[at] > 0.0 {
                    sum += variances[at];
                    n += 1.0;
                }
            }
        }
        if n > 0.0 { sum / n } else { 0.0 }
    };
    (0..variances.len()).map(neighbourhood).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_are_pooled_over_what_counts() {
        let mask = [1.0, 1.0, 0.0, 1.0, 1.0, 1.0];
        let variances = [2.0, 4.0, 100.0, 6.0, 0.0, 0.0];
        assert_eq!(pool(&variances, &mask, [6, 1])[0], 3.0);
        assert_eq!(pool(&variances, &mask, [1, 6])[5], 2.0);
    }

    #[test]
    fn pixels_that_keep_the_old_are_counted() {
        let mut fresh = FreshImages::new([4, 1]);
        for k in 0..8u8 {
            fresh.add(&[0.5 + 0.001 * f32::from(k % 2); 4]);
        }
        let (reference, old) = ([0.5; 4], [1.0, 1.0, 0.0, 0.5]);
        // towards the old, a little towards it, away from it, and where nothing changed
        let image = [0.7, 0.5005, 0.7, 0.7];
        assert_eq!(fresh.stale_pixels(&image, &[1.0; 4], [&reference, &old]), 1);
        assert_eq!(fresh.stale_pixels(&image, &[0.0; 4], [&reference, &old]), 0);
    }
}
