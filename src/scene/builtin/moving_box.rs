//! The scene that changes: a floor, walls, a column, and a box that is moved about.

use glam::{DAffine3, DVec3};

use super::shapes;
use crate::scene::{Camera, Geometry, Instance, Material, Mesh, Scene};

/// How far occlusion reaches, scene units.
pub const REACH: f64 = 2.0;
/// The camera, and what it looks at.
const EYE: DVec3 = DVec3::new(0.6, 2.2, 6.0);
const TARGET: DVec3 = DVec3::new(0.0, 0.6, 0.0);
const FOV_Y: f64 = 45.0;
/// Where the box stands, and where it is out of sight and of reach.
const HERE: DVec3 = DVec3::new(0.3, 0.0, 0.4);
const AWAY: DVec3 = DVec3::new(0.3, 12.0, 0.4);
/// Everything is turned by so much, radians: the pipeline of the reference work has no directions
/// about a normal along z.
const TURN: f64 = 0.5;
/// Share of the view's width that the sliding box goes in a frame.
const SLIDE: f64 = 0.02;
/// Frames after which it turns back, from the middle.
const SLIDE_FRAMES: u32 = 12;

/// A box that moves, one of a scene's instances.
#[derive(Clone, Copy, Debug)]
pub struct Mover {
    /// The instance.
    pub instance: usize,
}

/// The scene with the box where it stands, and the box.
pub fn build_room() -> (Scene, Mover) {
    let mut scene = Scene { name: "room".into(), materials: vec![Material::default()], ..Default::default() };
    let mut add = |name: &str, geometry: Geometry, at: DVec3| {
        scene.meshes.push(Mesh { name: name.into(), geometry, material: 0, source: None });
        let (mesh, object_to_world) = (scene.meshes.len() - 1, placed(at));
        scene.instances.push(Instance { name: name.into(), mesh, object_to_world });
        scene.instances.len() - 1
    };
    add("floor", shapes::floor(DVec3::ZERO, 16.0), DVec3::ZERO);
    add("wall", shapes::cuboid(DVec3::new(-5.0, -0.1, -2.4), DVec3::new(5.0, 3.5, -2.2)), DVec3::ZERO);
    add("side", shapes::cuboid(DVec3::new(-3.4, -0.1, -2.3), DVec3::new(-3.2, 3.0, 2.0)), DVec3::ZERO);
    add("column", shapes::cylinder(0.35, 2.6, 48), DVec3::new(1.7, -0.01, -0.6));
    add("block", shapes::cuboid(DVec3::new(-2.2, -0.1, -1.3), DVec3::new(-1.2, 0.5, -0.4)), DVec3::ZERO);
    add("ball", shapes::icosphere(0.4, 4), DVec3::new(-0.9, 0.39, 1.2));
    let mover = add("box", shapes::cuboid(DVec3::new(-0.5, 0.0, -0.5), DVec3::new(0.5, 1.1, 0.5)), HERE);
    scene.cameras.push(Camera::look_at(turned(EYE), turned(TARGET), DVec3::Y, FOV_Y.to_radians()));
    (scene, Mover { instance: mover })
}

impl Mover {
    /// Where the box is when it is out of sight and of reach.
    pub fn away(self) -> (usize, DAffine3) {
        (self.instance, placed(AWAY))
    }

    /// Where it stands.
    pub fn at_home(self) -> (usize, DAffine3) {
        (self.instance, placed(HERE))
    }

    /// Where it is in a frame in which it slides to and fro, always by the same share of the view's
    /// width.
    pub fn sliding(self, frame: u32, aspect: f64) -> (usize, DAffine3) {
        let half_height = (0.5 * FOV_Y.to_radians()).tan() * EYE.distance(HERE);
        let step = SLIDE * 2.0 * half_height * aspect;
        (self.instance, placed(HERE + DVec3::X * (step * f64::from(wave(frame)))))
    }
}

fn turned(p: DVec3) -> DVec3 {
    DAffine3::from_rotation_y(TURN).transform_point3(p)
}

fn placed(at: DVec3) -> DAffine3 {
    DAffine3::from_rotation_y(TURN) * DAffine3::from_translation(at)
}

/// 0, 1, ... up to [`SLIDE_FRAMES`], down to its negative and up again: never the same twice in a
/// row.
fn wave(frame: u32) -> i32 {
    let (most, period) = (SLIDE_FRAMES as i32, 4 * SLIDE_FRAMES);
    let at = (frame % period) as i32;
    if at <= most {
        at
    } else if at <= 3 * most {
        2 * most - at
    } else {
        at - 4 * most
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_never_rests() {
        assert_eq!([0, 1, 12, 13, 24, 36, 37, 48].map(wave), [0, 1, 12, 11, 0, -12, -11, 0]);
        assert!((0..200).all(|f| wave(f).abs_diff(wave(f + 1)) == 1));
    }

    #[test]
    fn away_is_out_of_reach() {
        let (_, hi) = {
            let (mut scene, mover) = build_room();
            scene.instances.remove(mover.instance);
            scene.bounds().unwrap()
        };
        assert!(AWAY.y - hi.y > 2.0 * REACH);
    }
}
