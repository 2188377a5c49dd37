//! Cameras in the metadata of images.

use glam::{DVec3, DVec4};
use serde_json::{Value, json};
use skylit::renderer::camera_numbers::{matrices, metadata, settings};
use skylit::scene::camera::ViewHeight;
use skylit::scene::{Camera, Projection};

#[test]
fn matrices_project_points() {
    let (eye, target) = (DVec3::new(1.0, 2.0, 3.0), DVec3::new(-4.0, 0.5, -2.0));
    let (fov_y, aspect) = (0.7f64, 1.5);
    let mut camera = Camera::look_at(eye, target, DVec3::Y, fov_y);
    let m = camera.camera_to_world;
    let half = (fov_y * 0.5).tan();
    // a point at the right and a quarter above the middle of the image, four units away
    let point = eye + 4.0 * (-m.matrix3.z_axis + m.matrix3.x_axis * half * aspect + m.matrix3.y_axis * half * 0.5);
    let near = |a: DVec4, b: [f64; 4]| assert!((a - DVec4::from_array(b)).abs().max_element() < 1e-12, "{a} {b:?}");
    let [to_camera, to_ndc] = matrices(&camera, aspect);
    near(to_camera * point.extend(1.0), [4.0 * half * aspect, 2.0 * half, -4.0, 1.0]);
    let projected = to_ndc * point.extend(1.0);
    near(projected / projected.w, [1.0, 0.5, 0.75, 1.0]);
    camera.projection = Projection::Orthographic { half_height: 3.0 };
    let point = eye + m.matrix3 * DVec3::new(-4.5, 1.5, -7.0);
    near(matrices(&camera, aspect)[1] * point.extend(1.0), [-1.0, 0.5, 7.0, 1.0]);
    let [(_, pose), ..] = metadata(&camera, aspect);
    let typed = settings(&pose).unwrap();
    assert_eq!((typed.eye, typed.fov_y, typed.orthographic), (Some(eye), None, Some(ViewHeight::Units(6.0))));
    // rows of the standard: the translation is at the end
    let [(_, pose), (_, text), _] = metadata(&Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, 1.0), 1.0);
    assert_eq!(text, "1,0,0,0,0,1,0,0,0,0,1,0,0,0,-1,1");
    let pose: Value = serde_json::from_str(&pose).unwrap();
    assert_eq!(
        (&pose["eye"], &pose["target"], &pose["up"]),
        (&json!([0.0, 0.0, 1.0]), &json!([0.0, 0.0, 0.0]), &json!([0.0, 1.0, 0.0]))
    );
    let typed = settings(&pose.to_string()).unwrap();
    assert_eq!((typed.eye, typed.target, typed.up), (Some(DVec3::Z), Some(DVec3::ZERO), Some(DVec3::Y)));
    assert!(settings("{}").is_none() && settings("").is_none());
    assert!((pose["fov_y"].as_f64().unwrap() - 1f64.to_degrees()).abs() < 1e-12);
}
