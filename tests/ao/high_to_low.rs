//! Directions and lengths of the rays that find a detailed model from a simple one, against closed forms.

use std::sync::Arc;

use glam::{DAffine3, Vec2, Vec3};
use skylit::bake::cage::{Cage, Detailed, check};
use skylit::bake::map::BakedMap;
use skylit::bake::plan::{PlannedTexture, plan};
use skylit::bake::session::BakeSession;
use skylit::bake::skew::{Skew, SkewMap};
use skylit::bake::{BakeSettings, Map};
use skylit::film::NoControl;
use skylit::gpu::Device;
use skylit::scene::{Geometry, Instance, Scene, TriangleMesh};
use skylit::tracer::TracerKind;

use crate::baking::{rectangle, scene_of, settings, tracing};
use crate::common::{assert_validation_clean, device, picked};

/// A cube around the origin. Each face has a sixth of the texture, three in a row, and the normals of corners are those of a smooth surface: they point away from the centre.
fn cube(half: f32) -> Scene {
    let mut mesh = TriangleMesh::default();
    for (face, out) in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z].into_iter().enumerate() {
        let (u, v) = (out.any_orthonormal_vector(), out.cross(out.any_orthonormal_vector()));
        let low = Vec2::new((face % 3) as f32 / 3.0, (face / 3) as f32 / 2.0);
        for [x, y] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
            let corner = half * (out + (2.0 * x - 1.0) * u + (2.0 * y - 1.0) * v);
            mesh.positions.push(corner);
            mesh.normals.push(corner.normalize());
            mesh.texcoords[0].push(low + Vec2::new(x / 3.0, y / 2.0));
        }
        let first = 4 * face as u32;
        mesh.indices.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    scene_of(vec![Geometry::Triangles(mesh)])
}

/// A map of a scene, of a detailed model if there is one.
fn bake(
    device: &Arc<Device>,
    kind: TracerKind,
    scene: &Scene,
    detailed: Option<Detailed>,
    settings: &BakeSettings,
) -> BakedMap {
    let planned = planned(scene, settings);
    let tracing = tracing(kind);
    let session = BakeSession { scene, device, tracing: &tracing, settings, detailed, occluding: &[] };
    session.bake_textures(&planned, &mut NoControl).unwrap().remove(0)
}

fn planned(scene: &Scene, settings: &BakeSettings) -> Vec<PlannedTexture> {
    plan(scene, None, settings, &mut NoControl).unwrap()
}

/// Where the ray of a point of the cube meets a larger one: the smooth normal of a point is along its position, so that all is known.
fn expected(point: Vec3, larger: f32, skew: f32) -> Vec3 {
    let face = if point.abs().max_element() == point.x.abs() {
        Vec3::X * point.x.signum()
    } else if point.abs().max_element() == point.y.abs() {
        Vec3::Y * point.y.signum()
    } else {
        Vec3::Z * point.z.signum()
    };
    let direction = (1.0 - skew) * point.normalize() + skew * face;
    point + (larger - point.dot(face)) / direction.dot(face) * direction
}

/// Details are displaced from where they lie above a face by what the smooth normal slants, less with a skew, and not at all with a skew of 1.
#[test]
fn gpu_bake_skewed_and_straight() {
    let device = device();
    let (simple, larger, cage) = (cube(1.0), cube(1.1), cube(1.3));
    check(&simple, &cage).unwrap();
    let settings = BakeSettings { map: Map::Position, padding: 0.0, ..settings(48, 4) };
    // black on the left half, white on the right one
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("skew.png");
    let image = image::GrayImage::from_fn(48, 48, |x, _| image::Luma([if x < 24 { 0 } else { 255 }]));
    image.save(&path).unwrap();
    let map = SkewMap::load(&path, &planned(&simple, &settings)).unwrap();
    for kind in picked(&device) {
        let points = bake(&device, kind, &simple, None, &settings);
        for cage in [Cage::Distance(0.3), Cage::Model(&cage)] {
            for (skew, share) in [
                (Skew::Uniform(0.0), [0.0, 0.0]),
                (Skew::Uniform(0.5), [0.5, 0.5]),
                (Skew::Uniform(1.0), [1.0, 1.0]),
                (Skew::Map(&map), [0.0, 1.0]),
            ] {
                let detailed = Detailed { skew, ..Detailed::new(&larger, cage) };
                let found = bake(&device, kind, &simple, Some(detailed), &settings);
                let (mut compared, mut moved) = (0, 0.0f32);
                for (at, (value, point)) in found.values.iter().zip(&points.values).enumerate() {
                    let column = at % 48;
                    // points of a texel at an edge, or between black and white, differ in what they meet
                    let is_one_face = point.abs().to_array().iter().filter(|c| **c > 0.95).count() == 1;
                    if !is_one_face || column.abs_diff(23) < 2 || column == 24 {
                        continue;
                    }
                    let wanted = expected(*point, 1.1, share[usize::from(column >= 24)]);
                    assert!((*value - wanted).length() < 2e-3, "{kind}: {value} {wanted} at {point}");
                    compared += 1;
                    moved = moved.max((*value - expected(*point, 1.1, 1.0)).length());
                }
                assert!(compared > 1300, "{kind}: {compared}");
                // a tenth of the height of the detail near an edge, half of a tenth with half of the skew
                let slant = [0.12..0.14, 0.04..0.06, 0.0..2e-3][(2.0 * share[0]) as usize].clone();
                assert!(slant.contains(&moved), "{kind}: {moved} {share:?}");
            }
        }
    }
    assert_validation_clean(&device);
}

/// Rays end where they are told to, whether they start at a distance or at a model.
#[test]
fn gpu_bake_as_far_behind_as_wanted() {
    let device = device();
    let plane = |y: f32| scene_of(vec![Geometry::Triangles(rectangle(Vec3::Y * y, Vec3::X * 9.0, Vec3::NEG_Z * 9.0))]);
    let card = |y: f32| scene_of(vec![Geometry::Triangles(rectangle(Vec3::Y * y, Vec3::X, Vec3::NEG_Z))]);
    let (simple, above) = (card(0.0), card(0.1));
    let settings = BakeSettings { map: Map::Position, padding: 0.0, ..settings(4, 4) };
    for kind in picked(&device) {
        for cage in [Cage::Distance(0.1), Cage::Model(&above)] {
            for (y, behind, is_found) in [
                (-0.05, None, true),
                (-0.15, None, false),
                (-0.15, Some(0.2), true),
                (-0.25, Some(0.2), false),
                (-0.05, Some(0.02), false),
                (0.05, Some(0.02), true),
                (0.15, Some(f64::INFINITY), false),
                (-1e3, Some(f64::INFINITY), true),
            ] {
                let detailed = plane(y);
                let detailed = Detailed { behind, ..Detailed::new(&detailed, cage) };
                let map = bake(&device, kind, &simple, Some(detailed), &settings);
                assert!(map.covered.iter().all(|c| *c == is_found), "{kind}: {y} {behind:?}");
                assert!(!is_found || map.values.iter().all(|v| (v.y - y).abs() < 1e-3 * y.abs()), "{kind}: {y}");
            }
        }
    }
}

/// One map is of one texture.
#[test]
fn maps_of_the_skew_that_fit_no_texture_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("skew.png");
    image::GrayImage::new(2, 2).save(&path).unwrap();
    let mut two = scene_of(vec![
        Geometry::Triangles(rectangle(Vec3::ZERO, Vec3::X, Vec3::NEG_Z)),
        Geometry::Triangles(rectangle(Vec3::Y, Vec3::X, Vec3::NEG_Z)),
    ]);
    let load = |scene: &Scene, path: &std::path::Path| {
        SkewMap::load(path, &planned(scene, &settings(8, 1))).map(|_| ()).map_err(|e| e.to_string())
    };
    let text = load(&two, &path).unwrap_err();
    assert!(text.contains("skew.png: is an image of one texture, and 2 are baked: choose one"), "{text}");
    // a further instance is no further texture
    two.instances.remove(1);
    two.instances.push(Instance { name: String::new(), mesh: 0, object_to_world: DAffine3::IDENTITY });
    assert_eq!(load(&two, &path), Ok(()));
    std::fs::write(&path, "no image").unwrap();
    assert!(load(&two, &path).unwrap_err().contains("skew.png: "));
    let text = load(&two, &dir.path().join("none.exr")).unwrap_err();
    assert!(text.contains("none.exr: no such file"), "{text}");
}
