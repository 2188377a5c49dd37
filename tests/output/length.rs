//! Lengths in scene units, as shares of the diagonal, and chosen by the scene.

use skylit::settings::Length;

#[test]
fn lengths_are_read_and_written() {
    let parse = |text: &str| text.parse::<Length>();
    for (text, length) in [
        ("2.5", Length::Units(2.5)),
        ("inf", Length::Units(f64::INFINITY)),
        ("5%", Length::OfDiagonal(0.05)),
        ("7%", Length::OfDiagonal(7.0 / 100.0)),
        ("0.3%", Length::OfDiagonal(0.3 / 100.0)),
        ("250%", Length::OfDiagonal(2.5)),
        ("auto", Length::Auto),
    ] {
        assert_eq!(parse(text), Ok(length), "{text}");
        assert_eq!(length.to_string(), text);
        let json = serde_json::to_string(&length).unwrap();
        assert_eq!(serde_json::from_str::<Length>(&json).unwrap(), length, "{json}");
    }
    for wrong in ["0", "-1", "nan", "0%", "inf%", "%", "", "5 %%", "Auto", "1m"] {
        assert!(parse(wrong).is_err(), "{wrong}");
    }
    assert_eq!(serde_json::to_string(&Length::Units(2.0)).unwrap(), "2.0");
    assert!(serde_json::from_str::<Length>("-1").is_err());
    assert_eq!(
        [Length::Units(3.0), Length::OfDiagonal(0.5), Length::Auto].map(|l| l.units(4.0)),
        [Some(3.0), Some(2.0), None]
    );
}
