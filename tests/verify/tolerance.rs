//! Tolerances of reference frames, as files state them.

use skylit::verify::tolerance::{FALSE_ALARMS, FlipLimit, Tolerance, ZTestLimit};

fn parse(text: &str) -> Result<Tolerance, String> {
    #[derive(serde::Deserialize)]
    struct File {
        tolerance: Tolerance,
    }
    toml::from_str::<File>(&format!("tolerance = {text}")).map(|f| f.tolerance).map_err(|e| e.message().to_owned())
}

#[test]
fn conditions() {
    assert!(parse("\"exact\"").unwrap().exact);
    let z = parse("\"z_test\"").unwrap();
    assert_eq!(z.z_test, Some(ZTestLimit { false_alarms: FALSE_ALARMS, bias: None }));
    assert_eq!(parse("{ z_test = {} }").unwrap(), z);
    assert!(z.allows_other_seeds() && !parse("\"exact\"").unwrap().allows_other_seeds());
    let both = parse("{ flip = { max = 0.05 }, bad_pixels = 3 }").unwrap();
    assert_eq!(both.flip, Some(FlipLimit { percentile: 99.0, max: 0.05 }));
    assert_eq!((both.bad_pixels, both.exact, both.z_test), (Some(3), false, None));
    for (text, says) in [
        ("\"roughly\"", "roughly"),
        ("{}", "needs a condition"),
        ("{ flip = { max = 2 } }", "max 0 to 1"),
        ("{ flip = { percentile = 101, max = 0.1 } }", "percentile is 0 to 100"),
        ("{ flip = { percentle = 99, max = 0.1 } }", "percentle"),
        ("{ z_test = { false_alarms = 0 } }", "above 0"),
        ("{ z_test = { bias = -1 } }", "bias is a share"),
        ("{ zzz = 1 }", "zzz"),
        ("{ bad_pixels = -1 }", "-1"),
        ("3", "expected"),
    ] {
        let error = parse(text).unwrap_err();
        assert!(error.contains(says), "{text}: {error}");
    }
}
