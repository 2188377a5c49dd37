//! Cameras over time.

use glam::{DMat3, DVec3};
use skylit::Error;
use skylit::scene::camera_path::{CameraPath, Interpolation, Key};
use skylit::scene::load::load_camera_path;
use skylit::scene::{Camera, Orbit, Projection};

/// Unevenly spaced keys that turn back, rest, and zoom.
fn keys() -> Vec<Key> {
    let at = |frame: f64, eye: [f64; 3], target: [f64; 3], degrees: f64| Key {
        frame,
        eye: DVec3::from(eye),
        target: DVec3::from(target),
        up: DVec3::new(0.1, 1.0, 0.0),
        fov_y: f64::to_radians(degrees),
        cut: false,
    };
    vec![
        at(-3.0, [0.0, 1.5, 4.0], [0.0, 1.0, 0.0], 45.0),
        at(10.0, [3.0, 1.6, 2.0], [0.0, 1.0, 0.0], 45.0),
        at(12.5, [3.5, 1.2, 0.1], [0.3, 1.1, 0.0], 30.0),
        at(40.0, [3.5, 1.2, 0.1], [0.3, 1.1, 0.0], 30.0),
        at(55.0, [-2.0, 0.7, 0.3], [0.2, 0.1, 0.5], 60.0),
    ]
}

fn path(interpolation: Interpolation) -> CameraPath {
    CameraPath::new(keys(), interpolation, 30.0).unwrap()
}

fn numbers(k: &Key) -> [f64; 10] {
    let ([a, b, c], [d, e, f], [g, h, i]) = (k.eye.to_array(), k.target.to_array(), k.up.to_array());
    [a, b, c, d, e, f, g, h, i, k.fov_y]
}

#[test]
fn keys_are_met_and_the_ends_hold() {
    for interpolation in [Interpolation::Linear, Interpolation::Smooth] {
        let path = path(interpolation);
        for key in keys() {
            assert_eq!(path.key_at(key.frame), key);
            assert_eq!(path.camera_at(key.frame), Camera::look_at(key.eye, key.target, key.up, key.fov_y));
        }
        let (first, last) = path.range();
        assert_eq!((first, last, path.fps()), (-3.0, 55.0, 30.0));
        for (frame, end) in [(-1e9, first), (f64::NEG_INFINITY, first), (f64::NAN, first), (56.0, last), (1e300, last)]
        {
            assert_eq!(path.camera_at(frame), path.camera_at(end), "{frame}");
        }
        // a single key is a camera that stands
        let still = CameraPath::new(keys()[..1].to_vec(), interpolation, 30.0).unwrap();
        assert_eq!(still.key_at(7.0), keys()[0]);
    }
}

#[test]
fn linear_is_exact() {
    let middle = path(Interpolation::Linear).key_at(3.5);
    assert_eq!((middle.eye, middle.target), (DVec3::new(1.5, 1.55, 3.0), DVec3::new(0.0, 1.0, 0.0)));
    // two keys leave no choice but a line
    let two = |interpolation| CameraPath::new(keys()[..2].to_vec(), interpolation, 30.0).unwrap().key_at(1.0);
    let (a, b) = (numbers(&two(Interpolation::Linear)), numbers(&two(Interpolation::Smooth)));
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-14));
}

/// Until a cut the camera stands where the key before has it, and each shot is a path of its own.
#[test]
fn cuts_are_no_motion() {
    let cut = Key { cut: true, ..keys()[2] };
    let cut_keys = [&keys()[..2], &[cut], &keys()[3..]].concat();
    for interpolation in [Interpolation::Linear, Interpolation::Smooth] {
        let path = CameraPath::new(cut_keys.clone(), interpolation, 30.0).unwrap();
        for key in &cut_keys {
            assert_eq!(path.key_at(key.frame), *key);
        }
        assert_eq!(path.camera_at(12.499), path.camera_at(10.0));
        let shots =
            [&cut_keys[..2], &cut_keys[2..]].map(|keys| CameraPath::new(keys.to_vec(), interpolation, 30.0).unwrap());
        for (frame, shot) in [(-1.0, 0), (9.0, 0), (12.0, 0), (12.5, 1), (50.0, 1), (60.0, 1)] {
            assert_eq!(path.camera_at(frame), shots[shot].camera_at(frame), "frame {frame}");
        }
        let between =
            [(12.0, 13.0), (12.0, 12.5), (12.5, 13.0), (11.0, 12.0), (0.0, 60.0)].map(|(a, b)| path.has_cut(a, b));
        assert_eq!(between, [true, true, false, false, true]);
        assert!(!self::path(interpolation).has_cut(f64::NEG_INFINITY, f64::INFINITY));
        // nothing precedes the first key
        assert!(!shots[1].has_cut(f64::NEG_INFINITY, f64::INFINITY));
    }
}

/// Position and speed are continuous at every key.
#[test]
fn smooth_is_smooth() {
    let path = path(Interpolation::Smooth);
    let speed = |frame: f64, step: f64| {
        let (a, b) = (numbers(&path.key_at(frame)), numbers(&path.key_at(frame + step)));
        std::array::from_fn::<f64, 10, _>(|i| (b[i] - a[i]) / step)
    };
    for key in &keys()[1..4] {
        let (before, after) = (speed(key.frame, -1e-5), speed(key.frame, 1e-5));
        for (a, b) in before.iter().zip(&after) {
            assert!((a - b).abs() < 1e-4, "frame {}: {before:?} and {after:?}", key.frame);
        }
    }
    // and the linear one is not
    let line = self::path(Interpolation::Linear);
    let x = |frame: f64| line.key_at(frame).eye.x;
    assert!(((x(10.0) - x(9.9)) - (x(10.1) - x(10.0))).abs() > 1e-3);
}

#[test]
fn smooth_never_overshoots() {
    let path = path(Interpolation::Smooth);
    for pair in keys().windows(2) {
        let (a, b) = (numbers(&pair[0]), numbers(&pair[1]));
        let mut last = a;
        for step in 1..=100 {
            let frame = pair[0].frame + (pair[1].frame - pair[0].frame) * f64::from(step) / 100.0;
            let now = numbers(&path.key_at(frame));
            for i in 0..10 {
                // monotone from one key to the next, and still where they are alike
                assert!((now[i] - last[i]) * (b[i] - a[i]) >= -1e-14, "number {i} at frame {frame}");
                assert!(a[i] != b[i] || now[i] == a[i], "number {i} at frame {frame}");
            }
            last = now;
        }
    }
}

#[test]
fn orbits() {
    let camera = Camera {
        name: "a".into(),
        aspect: Some(1.5),
        ..Camera::look_at(DVec3::new(3.0, 2.0, 1.0), DVec3::ONE, DVec3::Y, 0.7)
    };
    let around = DVec3::new(1.0, 0.0, 0.5);
    let orbit = Orbit::vertical(around, 36.0).unwrap();
    for frame in [0.0, 36.0, -36.0, 360.0] {
        assert_eq!(orbit.camera_at(&camera, frame), camera, "{frame}");
    }
    // a quarter turn, counter-clockwise from above: +z comes to +x, +x to -z
    let quarter = orbit.camera_at(&camera, 9.0);
    let eye = quarter.camera_to_world.translation;
    assert!((eye - DVec3::new(1.5, 2.0, -1.5)).length() < 1e-12, "{eye}");
    assert_eq!((quarter.projection, &quarter.name, quarter.aspect), (camera.projection, &camera.name, camera.aspect));
    let back = Orbit::vertical(around, -36.0).unwrap();
    assert!(back.camera_at(&quarter, 9.0).camera_to_world.abs_diff_eq(camera.camera_to_world, 1e-12));
    // frame by frame, a whole turn
    let mut turned = camera.clone();
    for _ in 0..36 {
        turned = orbit.camera_at(&turned, 1.0);
        let matrix = turned.camera_to_world.matrix3;
        assert!((matrix * matrix.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-13));
    }
    assert!(turned.camera_to_world.abs_diff_eq(camera.camera_to_world, 1e-12));
    // what it looks at stays in sight when it lies on the axis
    let eye = DVec3::new(4.0, 1.0, 2.0);
    let looking = Camera::look_at(eye, around, DVec3::Y, 0.7);
    let there = Orbit::vertical(around, 100.0).unwrap().camera_at(&looking, 31.0).camera_to_world.inverse();
    let seen = there.transform_point3(around);
    assert!(seen.x.abs() < 1e-12 && seen.y.abs() < 1e-12 && (seen.z + (eye - around).length()).abs() < 1e-12, "{seen}");
    // other projections and axes
    let parallel = Camera { projection: Projection::Orthographic { half_height: 2.0 }, ..camera.clone() };
    let tilted = Orbit::new(around, DVec3::new(0.0, 0.0, 5.0), 4.0).unwrap().camera_at(&parallel, 2.0);
    assert_eq!(tilted.projection, parallel.projection);
    assert!((tilted.camera_to_world.translation - DVec3::new(-1.0, -2.0, 1.0)).length() < 1e-12);

    for bad in [
        Orbit::new(around, DVec3::ZERO, 36.0),
        Orbit::vertical(around, 0.0),
        Orbit::vertical(around, f64::NAN),
        Orbit::vertical(DVec3::NAN, 36.0),
    ] {
        assert!(matches!(bad, Err(Error::Usage(_))));
    }
}

#[test]
fn files() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("path.json");
    let load = |text: &str| {
        std::fs::write(&file, text).unwrap();
        load_camera_path(&file)
    };
    let text = r#"{"fps": 24, "interpolation": "linear", "keys": [
        {"frame": 0, "eye": [0, 1.6, 4], "target": [0, 1, 0], "up": [0, 0, 1], "fov_y_degrees": 60},
        {"frame": 60.5, "eye": [3, 1.6, 2], "target": [0, 1, 0]}]}"#;
    let path = load(text).unwrap();
    assert_eq!((path.fps(), path.interpolation(), path.range()), (24.0, Interpolation::Linear, (0.0, 60.5)));
    let up = DVec3::Z;
    let first =
        Key { frame: 0.0, eye: DVec3::new(0.0, 1.6, 4.0), target: DVec3::Y, up, fov_y: 60f64.to_radians(), cut: false };
    assert_eq!(path.keys()[0], first);
    assert_eq!((path.keys()[1].up, path.keys()[1].fov_y), (DVec3::Y, 45f64.to_radians()));
    let cut = r#"{"keys": [{"frame": 0, "eye": [0, 0, 1], "target": [0, 0, 0]},
        {"frame": 1, "eye": [1, 0, 0], "target": [0, 0, 0], "cut": true}]}"#;
    assert_eq!(load(cut).unwrap().keys().iter().map(|k| k.cut).collect::<Vec<_>>(), [false, true]);
    let defaults =
        load(r#"{"keys": [{"frame": 0, "eye": [0, 0, 1], "target": [0, 0, 0], "fov_y_degrees": 179}]}"#).unwrap();
    assert_eq!((defaults.fps(), defaults.interpolation()), (30.0, Interpolation::Smooth));

    let key = r#"{"frame": 0, "eye": [0, 0, 1], "target": [0, 0, 0]}"#;
    let second = |fields: &str| format!(r#"{{"keys": [{key}, {{{fields}}}]}}"#);
    let broken = [
        ("", "is empty"),
        ("[1, 2]", "not a readable camera path"),
        (r#"{"fps": 30}"#, "missing field `keys`"),
        (r#"{"keys": []}"#, "no keys"),
        (&format!(r#"{{"keys": [{key}], "loop": true}}"#), "unknown field `loop`, expected one of `fps`"),
        (&format!(r#"{{"keys": [{key}], "fps": 0}}"#), "fps is 0"),
        (&format!(r#"{{"keys": [{key}], "interpolation": "cubic"}}"#), "expected `smooth` or `linear`"),
        (&second(r#""frame": 0, "eye": [0, 0, 1], "target": [0, 0, 0]"#), "key 2: frame 0 does not come after frame 0"),
        (&second(r#""frame": 1, "eye": [0, 0, 1], "target": [0, 0, 1]"#), "key 2: eye and target are the same"),
        (&second(r#""frame": 1, "eye": [0, 0, 1]"#), "key 2: missing field `target`"),
        (&second(r#""frame": 1, "eye": [0, 1], "target": [0, 0, 0]"#), "key 2: invalid length 2"),
        (&second(r#""frame": 1, "eye": [0, 0, 1], "target": [0, 0, 0], "fov": 3"#), "key 2: unknown field `fov`"),
        (&second(r#""frame": 1, "eye": [0, 0, null], "target": [0, 0, 0]"#), "key 2: invalid type: null"),
        (&second(r#""frame": 1, "eye": [0, 0, NaN], "target": [0, 0, 0]"#), "not a readable camera path"),
        (&second(r#""frame": 1, "eye": [0, 0, 1e200], "target": [0, 0, 0]"#), "key 2: contains a number"),
        (&second(r#""frame": 1, "eye": [0, 5, 0], "target": [0, 0, 0]"#), "key 2: up lies along the view"),
        (&second(r#""frame": 1, "eye": [0, 5, 0], "target": [0, 0, 0], "up": [0, 0, 0]"#), "key 2: up has no length"),
        (
            &second(r#""frame": 1, "eye": [0, 0, 1], "target": [0, 0, 0], "fov_y_degrees": 180"#),
            "between 0.001 and 179",
        ),
    ];
    for (text, said) in broken {
        let error = load(text).unwrap_err();
        let message = error.to_string();
        assert_eq!(error.exit_code(), 3, "{message}");
        assert!(
            message.contains("path.json: ") && message.contains(said) && !message.contains('\n'),
            "{text}: {message}"
        );
    }
    let none = load_camera_path(&dir.path().join("none.json")).unwrap_err();
    assert!(none.exit_code() == 3 && none.to_string().contains("no such file"));
    let nan = Key { eye: DVec3::NAN, ..keys()[1] };
    assert!(CameraPath::new(vec![keys()[0], nan], Interpolation::Smooth, 30.0).unwrap_err().starts_with("key 2: "));
}
