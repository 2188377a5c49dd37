//! Images of the sphere as distributions.

use skylit::sampling::bilinear::BilinearDistribution;

fn widths(table: &[f32]) -> Vec<f32> {
    table.windows(2).map(|w| w[1] - w[0]).collect()
}

#[test]
fn an_even_image_is_even_over_the_sphere() {
    let (w, h) = (8, 4);
    let patches = BilinearDistribution::new(w, h, |_, out| out.fill(3.0));
    assert_eq!(patches.table.len(), h + 2 + (h + 1) * (w + 1));
    let rows = widths(&patches.table[..h + 2]);
    for (row, width) in rows.iter().enumerate() {
        let cos = |y: f64| (y.clamp(0.0, 4.0) / 4.0 * std::f64::consts::PI).cos();
        let share = 0.5 * (cos(row as f64 - 0.5) - cos(row as f64 + 0.5));
        assert!((f64::from(*width) - share).abs() < 1e-6, "{row}: {width}, not {share}");
    }
    for row in 0..=h {
        let first = h + 2 + row * (w + 1);
        assert!(widths(&patches.table[first..first + w + 1]).iter().all(|c| (c - 0.125).abs() < 1e-6));
    }
}

#[test]
fn one_texel_lights_the_patches_around_it() {
    let (w, h) = (4, 3);
    let mut values = vec![0.0; w * h];
    values[w + 3] = 1.0;
    let patches = BilinearDistribution::new(w, h, |y, out| out.copy_from_slice(&values[y * w..][..w]));
    let rows = widths(&patches.table[..h + 2]);
    // rows of patches above and below the middle one of three rows of texels, and none at the
    // poles
    assert_eq!((rows[0], rows[3]), (0.0, 0.0));
    assert!((rows[1] - 0.5).abs() < 1e-6 && (rows[2] - 0.5).abs() < 1e-6);
    for row in [1, 2] {
        let first = h + 2 + row * (w + 1);
        // the last column wraps
        assert_eq!(widths(&patches.table[first..first + w + 1]), [0.0, 0.0, 0.5, 0.5]);
    }
    // nothing at all: no interval is broken
    assert!(BilinearDistribution::new(2, 1, |_, out| out.fill(0.0)).table.iter().all(|v| (0.0..=1.0).contains(v)));
}
