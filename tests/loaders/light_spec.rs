//! Lights in a line of text.

use glam::DVec3;
use skylit::scene::light_spec::parse;
use skylit::scene::{Geometry, Scene};

#[test]
fn what_is_wrong_is_said() {
    for (text, says) in [
        ("", "empty"),
        ("lamp position=0,0,0", "no light"),
        ("point intensity=1", "needs position"),
        ("point position=0,0,0", "needs intensity"),
        ("point position=0,0,0 intensity=-1", "above 0"),
        ("point position=0,0,0 intensity=1 radius=2", "has no radius"),
        ("sun direction=0,0,0 irradiance=1", "no direction"),
        ("disk position=0,0,0 direction=0,1,0 radius=1 radiance=1 temperature=20", "1000 to 40000"),
        ("sphere position=0,0,0 radius=1 radiance=1 color=1,1,1 temperature=3000", "not both"),
        ("rectangle position=0,0,0 direction=0,1,0 size=1 radiance=1", "WIDTH,HEIGHT"),
        ("portal position=0,0,0 direction=0,1,0 size=1,1 radiance=1", "portal has no radiance"),
    ] {
        let error = parse(text).unwrap_err();
        assert!(error.contains(says), "{text}: {error}");
    }
}

#[test]
fn portals_lie_about_their_position() {
    let mut scene = Scene::default();
    parse("portal position=1,2,3 direction=0,-1,0 size=2,3").unwrap().add(&mut scene);
    let portal = &scene.portals[0];
    assert!((portal.corner + 0.5 * (portal.edges[0] + portal.edges[1]) - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
    assert!((portal.area() - 6.0).abs() < 1e-12 && scene.instances.is_empty() && scene.lights.is_empty());
}

#[test]
fn shapes_face_their_direction_with_their_area() {
    let area = |text: &str| {
        let mut scene = Scene::default();
        parse(text).unwrap().add(&mut scene);
        let Geometry::Triangles(t) = &scene.meshes[0].geometry else { panic!("no triangles") };
        let p = |i: u32| t.positions[i as usize].as_dvec3();
        t.indices.iter().map(|c| 0.5 * (p(c[1]) - p(c[0])).cross(p(c[2]) - p(c[0]))).sum::<DVec3>()
    };
    let d = DVec3::new(1.0, -2.0, 0.5).normalize();
    let disk = area("disk position=1,2,3 direction=1,-2,0.5 radius=2 radiance=1");
    assert!((disk - d * std::f64::consts::PI * 4.0).length() < 1e-5, "{disk}");
    let rectangle = area("rectangle position=1,2,3 direction=0,-1,0 size=2,3 radiance=1");
    assert!((rectangle - DVec3::NEG_Y * 6.0).length() < 1e-6, "{rectangle}");
}
