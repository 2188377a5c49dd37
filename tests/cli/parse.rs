//! Values of options.

use glam::DVec3;
use skylit::settings::parse::{parse_falloff, parse_fov, parse_radiance, parse_radius, parse_seconds, parse_vector};

#[test]
fn numbers() {
    assert_eq!(parse_vector("1,-2.5,3e2"), Ok(DVec3::new(1.0, -2.5, 300.0)));
    for bad in ["1,2", "1,2,3,4", "a,b,c", "nan,0,0", "inf,0,0", ""] {
        assert!(parse_vector(bad).is_err(), "{bad}");
    }
    assert!(parse_radiance("0,0.5,2").is_ok() && parse_radiance("1,-1,1").is_err() && parse_radiance("1,1").is_err());
    assert!(
        parse_fov("nan").is_err() && parse_fov("0").is_err() && parse_fov("180").is_err() && parse_fov("45").is_ok()
    );
    assert!(parse_falloff("0.9").is_err() && parse_falloff("inf").is_err() && parse_falloff("1").is_ok());
    assert!(parse_radius("-1").is_err() && parse_radius("0").is_err() && parse_radius("inf").is_ok());
    assert!(parse_seconds("-1").is_err() && parse_seconds("1e300").is_err() && parse_seconds("0.5").is_ok());
}
