//! Cameras: clipping planes as text, and views that enclose.

use glam::DVec3;
use skylit::scene::camera::{Camera, ClipPlanes};

#[test]
fn clipping_planes_are_read_as_they_are_written() {
    for (text, near, far) in [("0.1,100", 0.1, 100.0), ("0,inf", 0.0, f64::INFINITY), (" 2 , 3.5", 2.0, 3.5)] {
        let planes: ClipPlanes = text.parse().unwrap();
        assert_eq!((planes.near, planes.far), (near, far));
        assert_eq!(planes.to_string().parse(), Ok(planes));
    }
    assert_eq!(ClipPlanes::NONE.to_string(), "none");
    for text in ["", "1", "1,1", "2,1", "-1,2", "inf,inf", "nan,2", "0,nan", "a,b"] {
        assert!(text.parse::<ClipPlanes>().is_err(), "{text}");
    }
}

#[test]
fn enclosing_touches_what_it_holds() {
    let mut points: Vec<(DVec3, f64)> = (0..200)
        .map(|k| (DVec3::new((k as f64).sin() * 3.0, (1.7 * k as f64).cos(), (0.3 * k as f64).sin() + 20.0), 0.0))
        .collect();
    points.push((DVec3::new(4.0, 0.5, 20.0), 0.75));
    for (aspect, from) in [(0.3, DVec3::new(0.35, 0.3, 1.0)), (1.0, DVec3::Y), (2.5, DVec3::new(-1.0, 0.2, 0.0))] {
        let fov_y = 0.8f64;
        let camera = Camera::enclosing(&points, from, DVec3::Y, fov_y, aspect).unwrap();
        let world_to_camera = camera.camera_to_world.inverse();
        let tan = (fov_y / 2.0).tan();
        // how far out the outermost point of each sphere lies on each side, 1 at the border of
        // the image
        let mut sides = [f64::NEG_INFINITY; 4];
        for (centre, radius) in &points {
            let p = world_to_camera.transform_point3(*centre);
            for (side, value, tan) in [(0, p.x, tan * aspect), (1, -p.x, tan * aspect), (2, p.y, tan), (3, -p.y, tan)] {
                // the sphere's distance from the plane through the eye at this side
                let angle = value.atan2(-p.z) + (radius / (value.hypot(p.z))).asin();
                sides[side] = sides[side].max(angle.tan() / tan);
            }
        }
        let most = sides.into_iter().fold(0.0, f64::max);
        assert!((0.94..=0.9525).contains(&most), "{aspect}: {sides:?}");
        // in the middle along both axes
        assert!((sides[0] - sides[1]).abs() < 0.08 && (sides[2] - sides[3]).abs() < 0.08, "{aspect}: {sides:?}");
    }
    assert!(Camera::enclosing(&[], DVec3::Z, DVec3::Y, 1.0, 1.0).is_none());
    // one point is before the camera
    let camera = Camera::enclosing(&[(DVec3::ONE, 0.0)], DVec3::Z, DVec3::Y, 1.0, 1.0).unwrap();
    assert!(camera.camera_to_world.translation.z > 1.0);
}

#[test]
fn framing_holds_every_corner_and_wastes_little() {
    let (lo, hi) = (DVec3::new(-3.0, 0.0, 10.0), DVec3::new(4.0, 1.0, 11.0));
    for aspect in [0.3, 1.0, 2.5] {
        let camera = Camera::framing(lo, hi, aspect);
        let world_to_camera = camera.camera_to_world.inverse();
        let tan = 22.5f64.to_radians().tan();
        let mut most = 0.0f64;
        for k in 0..8u32 {
            let corner = DVec3::from_array([0, 1, 2].map(|a| if k >> a & 1 == 0 { lo[a] } else { hi[a] }));
            let p = world_to_camera.transform_point3(corner);
            most = most.max(p.x.abs() / (-p.z * tan * aspect)).max(p.y.abs() / (-p.z * tan));
        }
        assert!((0.8..=1.0).contains(&most), "aspect {aspect}: {most}");
    }
}
