//! The oracle against itself: the BVH against brute force, and against shapes with a known answer.

use glam::{DAffine3, DQuat, DVec3};
use skylit::measure::ray_sets;
use skylit::oracle::{Oracle, OracleHit, OracleRay};
use skylit::ray::Ray;
use skylit::scene::builtin::{self, SceneTransform, analytic};
use skylit::scene::{Geometry, Scene};

fn scene(name: &str) -> Scene {
    builtin::by_name(name).unwrap_or_else(|| panic!("no scene {name}"))
}

fn oracle(name: &str) -> Oracle {
    let s = scene(name);
    Oracle::new(&s, s.origin())
}

/// Every kind of ray that tests use, for one scene.
fn all_rays(o: &Oracle, s: &Scene, scale: usize) -> Vec<Ray> {
    let mut rays = ray_sets::random_rays(o, 20 * scale, 1);
    let camera = ray_sets::camera_rays(o, &s.cameras[0], [scale as u32, 8], 2);
    let hits = o.trace_closest(&camera);
    rays.extend(ray_sets::ao_rays(o, &camera, &hits, 2, f64::INFINITY, 3));
    rays.extend(ray_sets::leak_rays(o, 8 * scale, 4));
    rays.extend(camera);
    rays
}

#[test]
fn bvh_equals_brute_force() {
    let names = [
        "cornell-box",
        "sphere-over-plane",
        "grid:2",
        "spheres:300",
        "leaf-cards",
        "stairs",
        "far-away",
        "v-groove:60",
    ];
    for name in names {
        let s = scene(name);
        let o = Oracle::new(&s, s.origin());
        let quick = Oracle::for_few_rays(&s, s.origin());
        let rays = all_rays(&o, &s, 60);
        let mut hits = 0;
        for ray in &rays {
            let (a, b) = (o.closest(ray), o.brute_force_closest(ray));
            assert_eq!(a, b, "{name}: {ray:?}");
            assert_eq!(quick.closest(ray), a, "{name}: {ray:?}");
            assert_eq!(o.any(ray), a.is_hit(), "{name}: {ray:?}");
            assert_eq!(o.brute_force_any(ray), a.is_hit(), "{name}: {ray:?}");
            hits += a.is_hit() as usize;
        }
        println!("{name}: {} primitives, {} rays, {hits} hits", o.primitive_count(), rays.len());
        assert!(hits > rays.len() / 10, "{name}: {hits} hits");
    }
}

/// Hierarchies of so many primitives are built on several cores.
#[test]
fn large_hierarchies_have_the_hits_of_one_another() {
    let s = scene("terrain:40000");
    let (o, quick) = (Oracle::new(&s, s.origin()), Oracle::for_few_rays(&s, s.origin()));
    assert_eq!(o.bounds(), quick.bounds());
    let rays = all_rays(&o, &s, 200);
    for (k, ray) in rays.iter().enumerate() {
        let hit = o.closest(ray);
        assert_eq!(quick.closest(ray), hit, "{ray:?}");
        if k % 100 == 0 {
            assert_eq!(o.brute_force_closest(ray), hit, "{ray:?}");
        }
    }
}

#[test]
fn bvh_equals_brute_force_on_awkward_rays() {
    // along axes, in planes of faces, through vertices, and with origins on surfaces
    for (name, at) in [
        ("unit", SceneTransform::default()),
        ("moved", SceneTransform { scale: 1e-3, offset: DVec3::new(1e3, -1e6, 7.0) }),
    ] {
        let s = analytic::closed_box(2.0, at);
        for origin in [DVec3::ZERO, s.origin()] {
            let (o, quick) = (Oracle::new(&s, origin), Oracle::for_few_rays(&s, origin));
            let values = [-1.5, -1.0, -0.5, 0.0, 0.25, 1.0, 2.0];
            for x in values {
                for y in values {
                    for z in values {
                        let from = at.point(DVec3::new(x, y, z)) - origin;
                        for d in [
                            [1.0, 0.0, 0.0],
                            [0.0, -1.0, 0.0],
                            [1.0, 1.0, 0.0],
                            [-1.0, 1.0, 1.0],
                            [0.0, 0.0, 1e-30],
                            [1e20, 1.0, 0.0],
                        ] {
                            let ray = OracleRay {
                                origin: from,
                                direction: DVec3::from_array(d),
                                tmin: 0.0,
                                tmax: f64::INFINITY,
                            };
                            let hit = o.brute_force_closest(ray);
                            assert_eq!(o.closest(ray), hit, "{name}: {ray:?}");
                            assert_eq!(quick.closest(ray), hit, "{name}: {ray:?}");
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn closed_meshes_do_not_leak() {
    for scale in [1e-3, 1.0, 1e6] {
        for offset in [DVec3::ZERO, DVec3::new(1e6, 0.3, -1e6), DVec3::splat(1e5 / 3.0)] {
            let at = SceneTransform { scale, offset };
            let mut ball = analytic::closed_box(1.0, at);
            ball.meshes[0].geometry = builtin::shapes::icosphere(1.0, 2);
            for s in [analytic::closed_box(2.0, at), ball] {
                let o = Oracle::new(&s, s.origin());
                let rays = ray_sets::leak_rays(&o, 20_000, 5);
                let leaks = rays.iter().filter(|r| !o.closest(*r).is_hit()).count();
                assert_eq!(leaks, 0, "scale {scale}, offset {offset}");
            }
        }
    }
}

fn ray(origin: [f64; 3], direction: [f64; 3]) -> OracleRay {
    OracleRay {
        origin: DVec3::from_array(origin),
        direction: DVec3::from_array(direction),
        tmin: 0.0,
        tmax: f64::INFINITY,
    }
}

#[test]
fn hits_are_where_they_should_be() {
    let o = oracle("sphere-over-plane");
    let down = o.closest(ray([0.3, 5.0, 0.4], [0.0, -2.0, 0.0]));
    let top = 1.25 + (1.0f64 - 0.25).sqrt();
    assert!((down.t - (5.0 - top) / 2.0).abs() < 1e-7 && (down.instance, down.primitive) == (1, 0), "{down:?}");
    // from inside the sphere
    let inside = o.closest(ray([0.0, 1.25, 0.0], [1.0, 0.0, 0.0]));
    assert!((inside.t - 1.0).abs() < 1e-12 && inside.instance == 1);
    let floor = o.closest(ray([3.0, 5.0, 2.0], [0.0, -1.0, 0.0]));
    assert!((floor.t - 5.0).abs() < 1e-12 && floor.instance == 0);
    assert_eq!(o.closest(ray([3.0, 5.0, 2.0], [0.0, 1.0, 0.0])), OracleHit::MISS);
    // ends are exclusive
    for (tmin, tmax, hit) in [(0.0, floor.t, false), (0.0, 5.1, true), (floor.t, 9.0, false), (4.9, 9.0, true)] {
        let r = OracleRay { tmin, tmax, ..ray([3.0, 5.0, 2.0], [0.0, -1.0, 0.0]) };
        assert_eq!((o.closest(r).is_hit(), o.any(r)), (hit, hit), "{tmin} {tmax}");
    }
    // barycentrics weigh the corners
    let t = o.triangles()[floor.primitive as usize];
    let [u, v] = floor.barycentrics;
    let p = t.v[0] * (1.0 - u - v) + t.v[1] * u + t.v[2] * v;
    assert!((p - DVec3::new(3.0, 0.0, 2.0)).length() < 1e-12);
}

#[test]
fn ellipsoids_by_stretched_instances() {
    let mut s = analytic::sphere_over_plane(1.0, 0.0, 1e-3, SceneTransform::default());
    let turn = DQuat::from_rotation_z(0.5);
    s.instances[1].object_to_world =
        DAffine3::from_scale_rotation_translation(DVec3::new(3.0, 0.5, 1.0), turn, DVec3::new(10.0, 0.0, 0.0));
    let o = Oracle::new(&s, DVec3::ZERO);
    for (axis, radius) in [(DVec3::X, 3.0), (DVec3::Y, 0.5), (DVec3::Z, 1.0)] {
        let d = turn * axis;
        let r = OracleRay { origin: DVec3::new(10.0, 0.0, 0.0), direction: d, tmin: 0.0, tmax: f64::INFINITY };
        let hit = o.closest(r);
        assert!((hit.t - radius).abs() < 1e-9, "{hit:?}");
        assert!((o.facing_normal(&r, &hit) + d).length() < 1e-9);
    }
}

#[test]
fn alpha_masks_cut_holes() {
    use skylit::scene::{AlphaMode, Filter, Texture, TextureSlot, Wrap};
    let mut s = analytic::plane(2.0, SceneTransform::default());
    // 2 x 1 texels, transparent and opaque; coordinates follow x over [-1, 1]
    s.textures.push(Texture {
        name: String::new(),
        width: 2,
        height: 1,
        texels: vec![0u8, 0, 0, 0, 0, 0, 0, 255].into(),
        wrap: [Wrap::Clamp; 2],
        filter: Filter::Nearest,
    });
    let Geometry::Triangles(mesh) = &mut s.meshes[0].geometry else { panic!() };
    mesh.texcoords[0] = mesh.positions.iter().map(|p| glam::Vec2::new(p.x * 0.5 + 0.5, 0.5)).collect();
    s.materials[0].base_color_texture =
        Some(TextureSlot { texture: 0, texcoord: 0, transform: glam::Affine2::IDENTITY });
    s.materials[0].alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
    let present = |s: &Scene, x: f64| Oracle::new(s, DVec3::ZERO).any(ray([x, 1.0, 0.1], [0.0, -1.0, 0.0]));
    assert!(!present(&s, -0.01) && present(&s, 0.01));
    // of 16 bits: two values that are one in 8
    s.textures[0].texels = vec![0u16, 0, 0, 32770, 0, 0, 0, 32800].into();
    s.materials[0].alpha_mode = AlphaMode::Mask { cutoff: 0.5002 };
    assert!(!present(&s, -0.01) && present(&s, 0.01));
    s.textures[0].texels = vec![0u8, 0, 0, 0, 0, 0, 0, 255].into();
    // bilinear: alpha is 0 at x = -0.5, 1 at 0.5, 1/4 at -0.25
    s.textures[0].filter = Filter::Linear;
    s.materials[0].alpha_mode = AlphaMode::Mask { cutoff: 0.25 };
    assert!(!present(&s, -0.26) && present(&s, -0.24));
    // base colour and vertex alpha multiply
    s.materials[0].base_color.w = 0.5;
    assert!(!present(&s, -0.01) && present(&s, 0.01));
    let Geometry::Triangles(mesh) = &mut s.meshes[0].geometry else { panic!() };
    mesh.colors = vec![glam::Vec4::splat(0.5); mesh.positions.len()];
    assert!(!present(&s, 0.49) && present(&s, 0.51));
    // mirrored repeat with a transform that doubles: opaque texels touch at x = 0, transparent ones at the ends
    s.materials[0].base_color.w = 1.0;
    s.textures[0].wrap = [Wrap::Mirror; 2];
    if let Some(slot) = &mut s.materials[0].base_color_texture {
        slot.transform = glam::Affine2::from_scale(glam::Vec2::new(2.0, 1.0));
    }
    assert!(present(&s, 0.0) && !present(&s, -0.9) && !present(&s, 0.9));
    s.textures[0].wrap = [Wrap::Repeat; 2];
    assert!(present(&s, -0.25) && present(&s, 0.75) && !present(&s, 0.25) && !present(&s, -0.75));
    // blended: a mask at one half; opaque: no test
    s.materials[0].alpha_mode = AlphaMode::Blend;
    assert!(!present(&s, 0.25));
    s.materials[0].alpha_mode = AlphaMode::Opaque;
    assert!(present(&s, 0.25));
}

#[test]
fn every_builtin_scene_is_sound() {
    for info in builtin::names() {
        let s = scene(info.name);
        assert_eq!(s.name, info.name);
        assert!(!s.cameras.is_empty() && !s.materials.is_empty());
        for m in &s.meshes {
            assert!(m.material < s.materials.len());
            if let Geometry::Triangles(t) = &m.geometry {
                assert!(t.indices.iter().flatten().all(|&i| (i as usize) < t.positions.len()), "{}", info.name);
                assert!(t.positions.iter().all(|p| p.is_finite()), "{}", info.name);
                for n in [t.normals.len(), t.texcoords[0].len(), t.colors.len()] {
                    assert!(n == 0 || n == t.positions.len());
                }
            }
        }
        let o = Oracle::new(&s, s.origin());
        let rays = ray_sets::camera_rays(&o, &s.cameras[0], [48, 36], 9);
        let hits = o.trace_closest(&rays).iter().filter(|h| h.is_hit()).count();
        assert!(hits * 4 > rays.len(), "{}: the camera sees something in {hits} of {} pixels", info.name, rays.len());
    }
    assert_eq!(scene("v-groove:60").name, "v-groove:60");
    assert_eq!(scene("spheres:17").sphere_count(), 17);
    assert_eq!(scene("grid:3").instances.len(), 28);
    for wrong in [
        "",
        "cornell",
        "cornell-box:3",
        "v-groove:x",
        "v-groove:0",
        "v-groove:NaN",
        "grid:0",
        "grid:-1",
        "grid:4000000000",
    ] {
        assert!(builtin::by_name(wrong).is_none(), "{wrong}");
    }
}

#[test]
fn closed_shapes_are_closed_and_face_outwards() {
    use skylit::scene::builtin::shapes::*;
    let shapes = [cuboid(-DVec3::ONE, DVec3::ONE), icosphere(1.0, 2), torus(1.0, 0.3, 12, 7), cylinder(0.5, 2.0, 9)];
    for g in shapes {
        let Geometry::Triangles(t) = g else { panic!() };
        let mut edges = std::collections::HashMap::new();
        let mut volume = 0.0;
        for [a, b, c] in &t.indices {
            for e in [(a, b), (b, c), (c, a)] {
                assert!(edges.insert(e, ()).is_none(), "an edge is used twice in one direction");
            }
            let [p, q, r] = [a, b, c].map(|i| t.positions[*i as usize].as_dvec3());
            volume += p.dot(q.cross(r)) / 6.0;
        }
        assert!(edges.keys().all(|(a, b)| edges.contains_key(&(*b, *a))), "an edge has no partner");
        assert!(volume > 0.1, "volume {volume}");
    }
}

#[test]
fn baked_scenes_are_the_same_scenes() {
    let s = scene("stairs");
    let (a, b) = (Oracle::new(&s, DVec3::ZERO), Oracle::new(&builtin::bake(&s), DVec3::ZERO));
    for (x, y) in a.triangles().iter().zip(b.triangles()) {
        assert!((0..3).all(|k| (x.v[k] - y.v[k]).length() < 2e-6));
    }
}

mod ao {
    use super::*;
    use skylit::oracle::ao::{AoSettings, ambient_visibility, render};
    use skylit::oracle::closed_form as exact;
    use skylit::sampling::Sampler;

    const SAMPLES: u32 = 1 << 17;

    /// Oracle's estimate at a point against the closed form: within three standard errors (which are generous, samples being
    /// stratified) and within 5e-4.
    fn check(what: &str, s: &Scene, point: DVec3, normal: DVec3, settings: AoSettings, want: f64) {
        let o = Oracle::new(s, s.origin());
        // vertices are f32: take the point on the surface as it is, a little off the one asked for
        let above = OracleRay {
            origin: point - o.origin() + normal * 1e-3 * (point - o.origin()).length().max(1e-3),
            direction: -normal,
            tmin: 0.0,
            tmax: f64::INFINITY,
        };
        let hit = o.closest(above);
        assert!(hit.is_hit(), "{what}: no surface");
        let (point, normal) = (above.at(hit.t), o.facing_normal(&above, &hit));
        for seed in 0..2 {
            let got = ambient_visibility(&o, point, normal, &settings, SAMPLES, Sampler { seed }, [3, 4]);
            let difference = (got.mean - want).abs();
            println!("{what}: {:.6} want {want:.6}, difference {difference:.1e}", got.mean);
            assert!(difference <= (3.0 * got.standard_error).clamp(1e-12, 5e-4), "{what}: {got:?}, want {want}");
        }
    }

    const BINARY: AoSettings = AoSettings { radius: f64::INFINITY, falloff: 1.0, rays: 1 };

    #[test]
    fn planes_and_boxes() {
        let places =
            [(1.0, DVec3::ZERO), (1e-3, DVec3::new(0.1, 0.2, 0.3)), (1e6, DVec3::ZERO), (1.0, DVec3::splat(1e6))];
        for (scale, offset) in places {
            let at = SceneTransform { scale, offset };
            let s = analytic::plane(10.0, at);
            check("plane", &s, at.point(DVec3::new(1.0, 0.0, 2.0)), DVec3::Y, BINARY, exact::plane());
            let s = analytic::closed_box(2.0, at);
            check("box", &s, at.point(DVec3::new(0.3, -1.0, 0.9)), DVec3::Y, BINARY, exact::closed_box());
        }
    }

    #[test]
    fn grooves() {
        for degrees in [20.0f64, 60.0, 90.0, 135.0, 180.0] {
            let angle = degrees.to_radians();
            let (sin, cos) = (angle * 0.5).sin_cos();
            // on the right wall; its normal points to the left and up
            let on_wall = |d: f64, z: f64| DVec3::new(d * sin, d * cos, z);
            let normal = DVec3::new(-cos, sin, 0.0);
            let small = analytic::v_groove(angle, 4.0, 6.0, SceneTransform::default());
            for (d, z) in [(0.5, 0.0), (2.5, 1.5)] {
                let want = exact::v_groove_finite(angle, d, z, 4.0, 6.0);
                check(&format!("groove {degrees}, finite, at {d}"), &small, on_wall(d, z), normal, BINARY, want);
            }
            let large = analytic::v_groove(angle, 1e5, 1e5, SceneTransform::default());
            check(&format!("groove {degrees}"), &large, on_wall(1.0, 0.0), normal, BINARY, exact::v_groove(angle));
            let falloff = AoSettings { falloff: 8.0, ..BINARY };
            let want = exact::v_groove_falloff(angle, 0.4, 8.0);
            check(&format!("groove {degrees}, falloff"), &large, on_wall(0.4, 0.0), normal, falloff, want);
        }
        for angle in [0.3, 1.0, 2.0, 3.0] {
            assert!((exact::v_groove_finite(angle, 1.0, 0.0, 1e7, 1e7) - exact::v_groove(angle)).abs() < 1e-6);
            assert!((exact::v_groove_falloff(angle, 1.0, 1.0) - exact::v_groove(angle)).abs() < 1e-6);
        }
        assert_eq!(exact::v_groove(std::f64::consts::PI), 1.0);
        // Ki_3(0) = pi/4
        assert!((exact::bickley_3(0.0) - std::f64::consts::FRAC_PI_4).abs() < 1e-12);
    }

    #[test]
    fn sphere_over_plane() {
        for (height, rho) in [(1.25, 0.0), (1.25, 1.0), (3.0, 4.0), (1.0, 1.5)] {
            let s = analytic::sphere_over_plane(1.0, height, 100.0, SceneTransform::default());
            let want = exact::sphere_over_plane(1.0, height, rho).unwrap();
            check(&format!("sphere {height} {rho}"), &s, DVec3::new(rho, 0.0, 0.0), DVec3::Y, BINARY, want);
        }
        for c in [1.0, 2.0, 8.0] {
            let s = analytic::sphere_over_plane(1.0, 1.5, 100.0, SceneTransform::default());
            let want = exact::sphere_over_plane_falloff(1.0, 1.5, c).unwrap();
            check(
                &format!("sphere, falloff {c}"),
                &s,
                DVec3::ZERO,
                DVec3::Y,
                AoSettings { falloff: c, ..BINARY },
                want,
            );
        }
        assert_eq!(exact::sphere_over_plane(1.0, 0.5, 2.0), None);
        let (a, b) = (exact::sphere_over_plane(1.0, 2.0, 0.0), exact::sphere_over_plane_falloff(1.0, 2.0, 1.0));
        assert!((a.unwrap() - b.unwrap()).abs() < 1e-9);
    }

    #[test]
    fn parallel_planes() {
        let s = analytic::parallel_planes(8.0, 6.0, 1.5, SceneTransform::default());
        for (x, z) in [(0.0, 0.0), (3.5, -1.0), (4.0, 3.0)] {
            let want = exact::parallel_rectangle(1.5, [-4.0 - x, 4.0 - x], [-3.0 - z, 3.0 - z]);
            check(&format!("rectangle {x} {z}"), &s, DVec3::new(x, 0.0, z), DVec3::Y, BINARY, want);
            let corners = [[-4.0, -3.0], [4.0, -3.0], [4.0, 3.0], [-4.0, 3.0]].map(|[x, z]| DVec3::new(x, 1.5, z));
            let lambert = 1.0 - exact::polygon_form_factor(DVec3::new(x, 0.0, z), DVec3::Y, &corners);
            assert!((lambert - want).abs() < 1e-12, "Lambert's formula agrees");
        }
        let s = analytic::parallel_planes(1e4, 1e4, 0.5, SceneTransform::default());
        for (c, radius) in [(8.0, f64::INFINITY), (2.0, f64::INFINITY), (8.0, 1.0), (1.0, 0.8), (1.0, 0.4)] {
            let want = exact::parallel_disk(0.5, f64::INFINITY, c, radius);
            check(
                &format!("planes {c} {radius}"),
                &s,
                DVec3::ZERO,
                DVec3::Y,
                AoSettings { radius, falloff: c, rays: 1 },
                want,
            );
        }
        assert!((exact::parallel_disk(1.0, 2.0, 1.0, f64::INFINITY) - 0.2).abs() < 1e-12);
        // 1 - 2 E_3(ln 8), by the series of E_1 and the recurrence (Abramowitz and Stegun 5.1.11, 5.1.14)
        let infinite = exact::parallel_disk(1.0, f64::INFINITY, 8.0, f64::INFINITY);
        assert!((infinite - 0.945_399_170_817_140_5).abs() < 1e-10, "{infinite}");
    }

    #[test]
    fn images() {
        let s = scene("closed-box");
        let o = Oracle::new(&s, s.origin());
        let image = render(&o, &s.cameras[0], [16, 9], 4, 1, &AoSettings::default());
        assert!(image.ambient_visibility.iter().all(|a| *a == 0.0) && image.coverage.iter().all(|c| *c == 1.0));
        let s = scene("plane");
        let o = Oracle::new(&s, s.origin());
        let image = render(&o, &s.cameras[0], [32, 18], 4, 1, &AoSettings::default());
        let (a, c) = (&image.ambient_visibility, &image.coverage);
        assert!(a.iter().zip(c).all(|(a, c)| *a == (*c > 0.0) as u8 as f32), "1 on the plane, nothing elsewhere");
        assert!(c.contains(&0.0) && c.contains(&1.0));
    }
}
