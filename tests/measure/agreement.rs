//! Hits of two tracers agree, or differ for a reason.

use skylit::measure::agreement::{Agreement, compare_any, compare_closest};
use skylit::measure::ray_sets;
use skylit::oracle::Oracle;
use skylit::ray::{Hit, Ray};
use skylit::scene::Scene;
use skylit::scene::builtin::by_name;

fn set(name: &str) -> (Scene, Vec<Ray>, Vec<Hit>) {
    let scene = by_name(name).unwrap();
    let oracle = Oracle::new(&scene, scene.origin());
    let rays = ray_sets::camera_rays(&oracle, &scene.cameras[0], [64, 48], 3);
    let hits = oracle.trace_closest(&rays).iter().map(|h| h.to_hit()).collect();
    (scene, rays, hits)
}

#[test]
fn equal_answers_agree() {
    for name in ["stairs", "spheres:50"] {
        let (scene, rays, hits) = set(name);
        let r = compare_closest(&scene, &rays, &hits, &hits).report;
        assert_eq!((r.agree, r.ties, r.unexplained, r.rays), (rays.len() as u64, 0, 0, rays.len() as u64));
        assert!(r.hits > 0);
    }
}

#[test]
fn wrong_answers_are_found_and_named() {
    let (scene, rays, hits) = set("stairs");
    let met: Vec<usize> = (0..hits.len()).filter(|&i| hits[i].is_hit()).collect();
    let mut wrong = hits.clone();
    // a miss, another place, another primitive
    wrong[met[10]] = Hit::MISS;
    wrong[met[200]].t *= 1.01;
    wrong[met[400]] = hits[met[900]];
    let Agreement { report: r, reference_unexplained } = compare_closest(&scene, &rays, &wrong, &hits);
    assert_eq!(reference_unexplained, 0);
    // the other way round it is the reference that is wrong
    assert_eq!(compare_closest(&scene, &rays, &hits, &wrong).reference_unexplained, 3);
    assert_eq!((r.unexplained, r.ties), (3, 0), "{r}");
    let mut found: Vec<usize> = r.examples.iter().map(|e| e.index).collect();
    found.sort_unstable();
    assert_eq!(found, [met[10], met[200], met[400]]);
    let moved = r.examples.iter().find(|e| e.index == met[200]).unwrap();
    assert_eq!(moved.answer.primitive, hits[met[200]].primitive);
}

#[test]
fn rounding_is_a_tie_or_agreement() {
    let (scene, rays, hits) = set("stairs");
    let mut other = hits.clone();
    other.iter_mut().filter(|h| h.is_hit()).for_each(|h| h.t *= 1.0 + 8.0 * f32::EPSILON);
    let r = compare_closest(&scene, &rays, &other, &hits).report;
    assert_eq!(r.unexplained, 0, "{r}");
}

#[test]
fn occlusion_that_differs_is_judged() {
    let (scene, rays, closest) = set("stairs");
    let any: Vec<Hit> =
        closest.iter().map(|h| if h.is_hit() { Hit { t: 0.0, ..Hit::MISS } } else { Hit::MISS }).collect();
    let k = any.iter().position(Hit::is_hit).unwrap();
    let mut wrong = any.clone();
    wrong[k] = Hit::MISS;
    let asked = |r: &[Ray]| {
        assert_eq!(r, [rays[k]]);
        Ok::<_, ()>(vec![closest[k]])
    };
    let Agreement { report: r, reference_unexplained } = compare_any(&scene, &rays, &wrong, &any, asked).unwrap();
    assert_eq!(reference_unexplained, 0);
    assert_eq!(compare_any(&scene, &rays, &any, &wrong, asked).unwrap().reference_unexplained, 1);
    assert_eq!((r.unexplained, r.ties, r.agree), (1, 0, rays.len() as u64 - 1));
    assert_eq!(r.examples[0].index, k);
    let r = compare_any(&scene, &rays, &any, &any, |_| Err("nothing differs, so nothing is asked")).unwrap().report;
    assert_eq!(r.agree, rays.len() as u64);
}
