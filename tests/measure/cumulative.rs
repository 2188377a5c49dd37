//! Discrete distributions are sampled with their probabilities, in order.

use skylit::sampling::cumulative::CumulativeTable;

#[test]
fn samples_match_the_probabilities_in_order() {
    let many: Vec<f64> = (0..1000).map(|k| 1.0 + f64::from(k % 7)).collect();
    for weights in [vec![1.0], vec![1.0, 2.0, 3.0, 4.0], vec![1e-9, 1.0, 1e-30, 5.0, 1e9], many] {
        let table = CumulativeTable::new(&weights);
        let (n, total) = (weights.len(), weights.iter().sum::<f64>());
        let (mut counts, mut last, draws) = (vec![0u32; n], (0, 0.0), 1u32 << 18);
        for k in 0..draws {
            let (chosen, rest) = table.sample((k << 14) + (1 << 13));
            assert!((0.0..=1.0).contains(&rest), "{weights:?}: {rest}");
            assert!((chosen, rest) >= last, "{weights:?}: not in order");
            last = (chosen, rest);
            counts[chosen] += 1;
        }
        for k in 0..n {
            let wanted = weights[k] / total;
            assert!((f64::from(table.probabilities[k]) - wanted).abs() < 1e-6, "{weights:?}: {k}");
            assert!((f64::from(counts[k]) / f64::from(draws) - wanted).abs() < 1e-5, "{weights:?}: {k}");
            assert!(table.probabilities[k] > 0.0, "{weights:?}: {k} is impossible");
        }
        assert_eq!(table.sample(0).0, 0);
        assert_eq!(table.sample(u32::MAX).0, n - 1);
    }
}
