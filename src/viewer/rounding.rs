//! Lengths as the viewer shows them.

/// A length with two significant digits.
pub fn round_length(x: f64) -> f64 {
    let digits = 1 - x.abs().max(1e-300).log10().floor() as i32;
    // decimal digits, not what is left of dividing by a power of ten
    format!("{x:.*}", digits.max(0) as usize)
        .parse()
        .map_or(x, |r| if digits >= 0 { r } else { (r / 10f64.powi(-digits)).round() * 10f64.powi(-digits) })
}

#[cfg(test)]
mod tests {
    #[test]
    fn lengths_are_rounded_to_two_digits() {
        for (x, expected) in [(2.4531, 2.5), (0.034_49, 0.034), (1234.0, 1200.0), (99.9, 100.0), (5e-5, 5e-5)] {
            assert_eq!(super::round_length(x), expected);
        }
    }
}
