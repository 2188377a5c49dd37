//! Nodes of the hierarchy that rays visit.

use skylit::accel::flatten::FlatScene;
use skylit::ray::Ray;
use skylit::scene::load;
use skylit::tracer::visits::{VisitCounter, Visits};

#[test]
fn rays_that_meet_nothing_visit_the_root_alone() {
    let scene = load::load("builtin:cornell-box").unwrap();
    let flat = FlatScene::new(&scene);
    let counter = VisitCounter::new(&flat).unwrap();
    let bounds = flat.bounds();
    let away =
        Ray { origin: (bounds.max + 1.0).to_array(), tmin: 0.0, direction: [1.0, 1.0, 1.0], tmax: f32::INFINITY };
    assert_eq!(counter.mean(&[away], false), Visits { nodes: 1.0, leaves: 0.0 });
    let through = Ray { direction: [-1.0, -1.0, -1.0], ..away };
    let (closest, any) = (counter.mean(&[through], false), counter.mean(&[through], true));
    assert!(closest.nodes >= 1.0 && any.nodes <= closest.nodes + 8.0, "{closest:?} {any:?}");
    let none = Ray { tmax: -1.0, ..through };
    assert_eq!(counter.mean(&[none], false), Visits::default());
}
