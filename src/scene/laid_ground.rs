//! A ground is put under a scene, and taken away again.

use glam::{DAffine3, DVec3, Vec4};

use super::builtin::shapes;
use super::material::MaterialKind;
use super::{Geometry, Ground, Instance, LaidGround, Material, Mesh, Scene};

/// Linear base colour of a ground: grey.
const COLOR: Vec4 = Vec4::new(0.5, 0.5, 0.5, 1.0);
/// Sides of the squares of which one surrounds the other, in diagonals of the scene: triangles are
/// small near the scene, where rounding would show, and the horizon is far.
const SIDES: [f64; 3] = [4.0, 60.0, 1000.0];

impl Scene {
    /// Puts a ground under the scene: at a height (y), or under its lowest point. A scene without
    /// geometry gets none. [`Scene::bounds`] are those of what stands on it.
    pub fn lay_ground(&mut self, kind: Ground, height: Option<f64>) {
        self.take_ground();
        let Some((low, high)) = self.bounds().filter(|_| kind != Ground::None) else { return };
        let (height, diagonal) = (height.unwrap_or(low.y), (high - low).length());
        let geometry =
            shapes::quads(&squares(SIDES.map(|side| 0.5 * side * diagonal.max(f64::from(f32::MIN_POSITIVE)))));
        let middle = 0.5 * (low + high);
        add_plane(self, geometry, DVec3::new(middle.x, height, middle.z));
        let (mesh, material) = (self.meshes.len() - 1, self.materials.len() - 1);
        self.ground = Some(LaidGround { kind, height, mesh, material });
    }

    /// Takes the ground of [`Scene::lay_ground`] away again.
    pub fn take_ground(&mut self) {
        if self.ground.take().is_some() {
            self.meshes.pop();
            self.materials.pop();
            self.instances.pop();
        }
    }

    /// The material of a ground that catches shadows.
    pub fn catcher(&self) -> Option<u32> {
        self.ground.filter(|ground| ground.kind == Ground::Catcher).map(|ground| ground.material as u32)
    }
}

/// Adds a grey plane as the last instance of a scene, at a place of its own coordinates.
pub(crate) fn add_plane(scene: &mut Scene, geometry: Geometry, at: DVec3) {
    // of no material of the scene, which may emit
    let (mesh, material) = (scene.meshes.len(), scene.materials.len());
    let object_to_world = DAffine3::from_translation(at);
    scene.instances.push(Instance { name: "ground".to_owned(), mesh, object_to_world });
    scene.materials.push(Material { kind: MaterialKind::Matte, base_color: COLOR, ..Material::default() });
    scene.meshes.push(Mesh { name: "ground".to_owned(), geometry, material, source: None });
}

/// Horizontal squares about the origin, seen from above: the first, and what each next one adds.
/// Neighbours share whole edges, so there are no gaps.
fn squares<const N: usize>(half_sides: [f64; N]) -> Vec<[DVec3; 4]> {
    let corners =
        |half: f64| [[-half, -half], [-half, half], [half, half], [half, -half]].map(|[x, z]| DVec3::new(x, 0.0, z));
    let mut quads = vec![corners(half_sides[0])];
    for pair in half_sides.windows(2) {
        let (inner, outer) = (corners(pair[0]), corners(pair[1]));
        quads.extend((0..4).map(|k| [outer[k], outer[(k + 1) % 4], inner[(k + 1) % 4], inner[k]]));
    }
    quads
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builtin;

    #[test]
    fn a_ground_comes_and_goes() {
        let scene = builtin::by_name("spheres:20").unwrap();
        let mut with = scene.clone();
        with.lay_ground(Ground::Catcher, None);
        with.lay_ground(Ground::Plane, None);
        let (low, high) = scene.bounds().unwrap();
        assert_eq!((with.bounds(), with.origin()), (scene.bounds(), scene.origin()), "it is no part of the bounds");
        let (outer_low, outer_high) = with.bounds_with_ground().unwrap();
        assert!((outer_low.y - low.y).abs() < 1e-6 && outer_high.x - outer_low.x > 900.0 * (high - low).length());
        assert_eq!(with.standing().len(), scene.instances.len());
        assert_eq!((with.instances.len(), with.catcher()), (scene.instances.len() + 1, None));
        with.lay_ground(Ground::Catcher, Some(-7.0));
        assert_eq!(with.catcher(), Some(scene.materials.len() as u32));
        assert_eq!(with.bounds_with_ground().unwrap().0.y, -7.0);
        with.take_ground();
        assert_eq!(
            (with.instances.len(), with.meshes.len(), with.materials.len(), with.ground),
            (scene.instances.len(), scene.meshes.len(), scene.materials.len(), None)
        );
        let mut empty = Scene::default();
        empty.lay_ground(Ground::Plane, None);
        assert!(empty.instances.is_empty());
    }

    /// The squares face upwards and cover the largest one without overlap: their areas add up.
    #[test]
    fn squares_are_one_plane() {
        let quads = squares([1.0, 3.0, 10.0]);
        let area = |q: &[DVec3; 4]| 0.5 * (q[2] - q[0]).cross(q[3] - q[1]);
        assert!(quads.iter().all(|q| area(q).y > 0.0 && area(q).x == 0.0));
        assert!((quads.iter().map(area).sum::<DVec3>().y - 400.0).abs() < 1e-9);
    }
}
