//! Metrics of images, and the parity judge.

mod metrics {
    use skylit::measure::metrics::ImagePair;

    fn pair<'a>(image: &'a [f32], reference: &'a [f32]) -> ImagePair<'a> {
        ImagePair::new(image, reference, 1, None).unwrap()
    }

    #[track_caller]
    fn close(a: f64, b: f64) {
        assert!((a - b).abs() <= 1e-12 * b.abs().max(1.0), "{a} is not {b}");
    }

    #[test]
    fn known_answers() {
        let p = pair(&[1.0, 0.5, 0.0, 0.25], &[0.5, 0.5, 0.25, 0.5]);
        // differences 1/2, 0, -1/4, -1/4
        close(p.mse(), (0.25 + 0.0625 + 0.0625) / 4.0);
        close(p.rmse(), 0.09375f64.sqrt());
        close(p.bias(), 0.0);
        close(p.max_abs_difference(), 0.5);
        close(p.psnr(), 10.0 * (1.0f64 / 0.09375).log10());
        close(p.rel_mse(), (0.25 / 0.26 + 0.0625 / 0.0725 + 0.0625 / 0.26) / 4.0);
        close(p.minimum_ratio(), (0.5 + 1.0 + 0.0 + 0.5) / 4.0);
        // a.b = 1/2 + 1/4 + 0 + 1/8 = 7/8; |a|^2 = 21/16, |b|^2 = 13/16
        close(p.tanimoto(), 0.875 / (21.0 / 16.0 + 13.0 / 16.0 - 0.875));
        assert_eq!((p.count(), p.non_finite()), (4, 0));
        close(pair(&[0.75, 0.5], &[0.5, 0.5]).bias(), 0.125);
    }

    #[test]
    fn equal_images() {
        for x in [0.0, 0.3, 7.0] {
            let image = [x; 3];
            let p = pair(&image, &image);
            assert_eq!((p.rmse(), p.bias(), p.max_abs_difference(), p.rel_mse()), (0.0, 0.0, 0.0, 0.0));
            assert_eq!((p.psnr(), p.minimum_ratio(), p.tanimoto()), (f64::INFINITY, 1.0, 1.0));
        }
    }

    #[test]
    fn only_covered_pixels_count() {
        // two pixels of three channels; the second, broken, is not covered
        let image = [0.5, 0.5, 0.5, f32::NAN, 9.0, f32::INFINITY];
        let reference = [0.25, 0.5, 0.75, 0.0, 0.0, 0.0];
        let p = ImagePair::new(&image, &reference, 3, Some(&[0.1, 0.0])).unwrap();
        assert_eq!((p.count(), p.non_finite()), (3, 0));
        close(p.rmse(), (0.125f64 / 3.0).sqrt());
        close(p.bias(), 0.0);
        let all = ImagePair::new(&image, &reference, 3, None).unwrap();
        assert_eq!((all.count(), all.non_finite()), (6, 2));
        for x in [
            all.rmse(),
            all.bias(),
            all.max_abs_difference(),
            all.rel_mse(),
            all.psnr(),
            all.minimum_ratio(),
            all.tanimoto(),
        ] {
            assert!(x.is_nan(), "a broken pixel is not averaged away");
        }
        assert!(pair(&[], &[]).rmse().is_nan());
    }

    #[test]
    fn sizes_must_fit() {
        assert!(ImagePair::new(&[0.0; 6], &[0.0; 5], 1, None).is_err());
        assert!(ImagePair::new(&[0.0; 6], &[0.0; 6], 4, None).is_err());
        assert!(ImagePair::new(&[0.0; 6], &[0.0; 6], 0, None).is_err());
        assert!(ImagePair::new(&[0.0; 6], &[0.0; 6], 3, Some(&[1.0; 6])).is_err());
    }
}

mod parity {
    use glam::{DVec3, Vec3};
    use skylit::measure::parity::{RayVerdict, judge_any, judge_closest, judge_closest_ray, judge_pair};
    use skylit::measure::ray_sets;
    use skylit::oracle::rounding::Rounding;
    use skylit::oracle::{Oracle, OracleHit, OracleRay};
    use skylit::ray::{Hit, Ray};
    use skylit::scene::builtin::{self, SceneTransform, analytic};
    use skylit::scene::{Geometry, Scene};

    /// A tracer in single precision, the way a GPU would do it: object-space rays by an f32 inverse, brute force.
    struct Narrow {
        parts: Vec<Part>,
    }

    /// The f32 inverse of an instance, and its object-space triangles or spheres.
    type Part = (glam::Affine3A, Vec<[Vec3; 3]>, Vec<(Vec3, f32)>);

    impl Narrow {
        fn new(scene: &Scene, origin: DVec3) -> Self {
            let part = |i: &skylit::scene::Instance| {
                let mut to_world = i.object_to_world;
                to_world.translation -= origin;
                let m = to_world.inverse();
                let inverse = glam::Affine3A::from_mat3_translation(m.matrix3.as_mat3(), m.translation.as_vec3());
                match &scene.meshes[i.mesh].geometry {
                    Geometry::Triangles(t) => {
                        (inverse, t.indices.iter().map(|c| c.map(|k| t.positions[k as usize])).collect(), vec![])
                    }
                    Geometry::Spheres(s) => (inverse, vec![], s.iter().map(|s| (s.center, s.radius)).collect()),
                }
            };
            Self { parts: scene.instances.iter().map(part).collect() }
        }

        fn closest(&self, ray: &Ray) -> Hit {
            let mut best = Hit { t: ray.tmax, ..Hit::MISS };
            for (instance, (inverse, triangles, spheres)) in (0u32..).zip(&self.parts) {
                let o = inverse.transform_point3(Vec3::from_array(ray.origin));
                let d = inverse.transform_vector3(Vec3::from_array(ray.direction));
                for (primitive, t) in (0u32..).zip(triangles) {
                    if let Some((t, u, v)) = triangle(o, d, t)
                        && t > ray.tmin
                        && t < best.t
                    {
                        best = Hit { t, instance, primitive, u, v };
                    }
                }
                for (primitive, (center, radius)) in (0u32..).zip(spheres) {
                    let from = o - *center;
                    let (a, b) = (d.length_squared(), -from.dot(d));
                    let x = radius * radius - (from + d * (b / a)).length_squared();
                    let half = (x / a).sqrt();
                    for t in [b / a - half, b / a + half] {
                        if t > ray.tmin && t < best.t {
                            best = Hit { t, instance, primitive, u: 0.0, v: 0.0 };
                        }
                    }
                }
            }
            if best.instance == u32::MAX { Hit::MISS } else { best }
        }
    }

    /// Woop et al. 2013 in f32, without its double-precision fallback.
    fn triangle(o: Vec3, d: Vec3, v: &[Vec3; 3]) -> Option<(f32, f32, f32)> {
        let z = d.abs().max_position();
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let (sx, sy) = (d[x] / d[z], d[y] / d[z]);
        let [a, b, c] = v.map(|p| {
            let p = p - o;
            Vec3::new(p[x] - sx * p[z], p[y] - sy * p[z], p[z])
        });
        let (u, v, w) = (c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return None;
        }
        let det = u + v + w;
        let t = (u * a.z + v * b.z + w * c.z) / (d[z] * det);
        (det != 0.0).then_some((t, v / det, w / det))
    }

    fn rays_for(s: &Scene, o: &Oracle, count: u32) -> Vec<Ray> {
        let mut rays = ray_sets::random_rays(o, count as usize, 1);
        let camera = ray_sets::camera_rays(o, &s.cameras[0], [count / 64, 64], 2);
        let hits = o.trace_closest(&camera);
        rays.extend(ray_sets::ao_rays(o, &camera, &hits, 2, f64::INFINITY, 3));
        rays.extend(ray_sets::ao_rays(o, &camera, &hits, 1, 0.5, 4));
        rays.extend(ray_sets::leak_rays(o, count as usize, 5));
        rays.extend(camera);
        rays
    }

    #[test]
    fn rounding_is_explained() {
        let scenes = [
            ("cornell-box", 40_000),
            ("sphere-over-plane", 40_000),
            ("closed-box", 40_000),
            ("parallel-planes", 40_000),
            ("spheres:300", 10_000),
            ("grid:2", 6_000),
            ("stairs", 4_000),
            ("far-away", 4_000),
        ];
        for (name, count) in scenes {
            let s = builtin::by_name(name).unwrap();
            let o = Oracle::new(&s, s.origin());
            let narrow = Narrow::new(&s, s.origin());
            let rays = rays_for(&s, &o, count);
            let truth = o.trace_closest(&rays);
            let hits: Vec<Hit> = rays.iter().map(|r| narrow.closest(r)).collect();
            let report = judge_closest(&o, &rays, &hits, &truth, Rounding::default());
            println!("{name}: {report}");
            assert_eq!(report.unexplained, 0, "{name}: {report}");
            assert_eq!(report.rays, rays.len() as u64);
            assert!(report.agree + report.ties == report.rays);
            let occluded: Vec<bool> = hits.iter().map(Hit::is_hit).collect();
            let any = judge_any(&o, &rays, &occluded, &o.trace_any(&rays), Rounding::default());
            println!("{name}, any: {any}");
            assert_eq!(any.unexplained, 0, "{name}: {any}");
            let pair = judge_pair(
                &o,
                &rays,
                &hits,
                &truth.iter().map(OracleHit::to_hit).collect::<Vec<_>>(),
                Rounding::default(),
            );
            assert_eq!(pair.unexplained, 0, "{name}: {pair}");
        }
    }

    #[test]
    fn ties_stay_rare_on_ordinary_rays() {
        // a judge that calls everything a tie would pass the test above
        for name in ["cornell-box", "sphere-over-plane", "spheres:300"] {
            let s = builtin::by_name(name).unwrap();
            let o = Oracle::new(&s, s.origin());
            let narrow = Narrow::new(&s, s.origin());
            let mut rays = ray_sets::camera_rays(&o, &s.cameras[0], [200, 200], 2);
            let hits = o.trace_closest(&rays);
            rays.extend(ray_sets::ao_rays(&o, &rays, &hits, 1, f64::INFINITY, 3));
            let truth = o.trace_closest(&rays);
            let hits: Vec<Hit> = rays.iter().map(|r| narrow.closest(r)).collect();
            let report = judge_closest(&o, &rays, &hits, &truth, Rounding::default());
            println!("{name}: {report}");
            assert!(report.ties as f64 <= 2e-4 * report.rays as f64, "{name}: {report}");
        }
    }

    #[test]
    fn faults_are_found() {
        let s = builtin::by_name("cornell-box").unwrap();
        let o = Oracle::new(&s, s.origin());
        let rays = ray_sets::camera_rays(&o, &s.cameras[0], [100, 100], 7);
        let truth = o.trace_closest(&rays);
        let good: Vec<Hit> = truth.iter().map(OracleHit::to_hit).collect();
        let judge = |hits: &[Hit]| judge_closest(&o, &rays, hits, &truth, Rounding::default());
        assert_eq!(judge(&good).agree, 10_000);
        let hits = truth.iter().filter(|h| h.is_hit()).count() as u64;
        type Fault = (&'static str, fn(Hit) -> Hit);
        let faults: [Fault; 6] = [
            ("misses", |_| Hit::MISS),
            ("t off by 2e-4", |h| Hit { t: h.t * 1.0002, ..h }),
            ("next primitive", |h| Hit { primitive: h.primitive ^ 1, ..h }),
            ("next instance", |h| Hit { instance: (h.instance + 1) % 8, ..h }),
            ("no such primitive", |h| Hit { primitive: 77_777, ..h }),
            ("not a number", |h| Hit { t: f32::NAN, ..h }),
        ];
        for (what, fault) in faults {
            let bad: Vec<Hit> = good.iter().map(|h| if h.is_hit() { fault(*h) } else { *h }).collect();
            let report = judge(&bad);
            println!("{what}: {report}");
            // a few rays at edges may be explained
            assert!(report.unexplained as f64 > 0.995 * hits as f64, "{what}: {report}");
            assert_eq!(report.examples.len(), 8);
        }
        // a hit out of nothing
        let bad: Vec<Hit> = good.iter().map(|h| if h.is_hit() { *h } else { good[5050] }).collect();
        let missing = truth.len() as u64 - hits;
        assert!(missing > 0 && judge(&bad).unexplained == missing);
        // any-hit, both ways
        let occluded = o.trace_any(&rays);
        let flipped: Vec<bool> = occluded.iter().map(|b| !b).collect();
        let report = judge_any(&o, &rays, &flipped, &occluded, Rounding::default());
        assert!(report.unexplained as f64 > 0.995 * report.rays as f64, "{report}");
        // the nearest skipped: a surface further along that is really there
        let behind: Vec<Hit> = rays
            .iter()
            .zip(&truth)
            .map(|(r, h)| {
                let beyond = OracleRay { tmin: h.t + 1e-3, ..OracleRay::from(r) };
                if h.is_hit() { o.closest(beyond).to_hit() } else { Hit::MISS }
            })
            .collect();
        assert!(judge(&behind).unexplained as f64 > 0.995 * hits as f64);
        // two tracers, one of them wrong
        let wrong: Vec<Hit> = good.iter().map(|_| Hit::MISS).collect();
        assert!(judge_pair(&o, &rays, &good, &wrong, Rounding::default()).unexplained as f64 > 0.995 * hits as f64);
        assert!(judge_pair(&o, &rays, &wrong, &good, Rounding::default()).unexplained as f64 > 0.995 * hits as f64);
    }

    #[test]
    fn each_kind_of_tie() {
        let s = analytic::parallel_planes(2.0, 2.0, 1.0, SceneTransform::default());
        let o = Oracle::new(&s, DVec3::ZERO);
        let judge = |ray: Ray, hit: Hit| judge_closest_ray(&o, &ray, &hit, &o.closest(ray), Rounding::default());
        let down =
            |x: f32, z: f32| Ray { origin: [x, 0.5, z], tmin: 0.0, direction: [0.0, -1.0, 0.0], tmax: f32::INFINITY };
        let hit = |primitive: u32, t: f32| Hit { t, instance: 0, primitive, u: 0.0, v: 0.0 };
        // outer edge: hit or miss; a little further in or out: not
        assert_eq!(judge(down(1.0, 0.3), Hit::MISS), RayVerdict::Tie);
        assert_ne!(judge(down(0.9999, 0.3), Hit::MISS), RayVerdict::Tie);
        let truth = o.closest(down(0.9999, 0.3));
        assert_eq!(judge(down(1.000001, 0.3), hit(truth.primitive, 0.5)), RayVerdict::Tie);
        assert!(matches!(judge(down(1.0001, 0.3), hit(truth.primitive, 0.5)), RayVerdict::Unexplained(_)));
        // the diagonal that both triangles share: either
        let primitive = o.closest(down(0.5, 0.5)).primitive;
        assert_eq!(judge(down(0.5, 0.5), hit(primitive ^ 1, 0.5)), RayVerdict::Tie);
        assert_eq!(judge(down(0.5, 0.5), hit(primitive, 0.5)), RayVerdict::Agree);
        // t at the ends
        let ended = |tmin, tmax| Ray { tmin, tmax, ..down(0.3, 0.6) };
        let truth = o.closest(down(0.3, 0.6));
        assert_eq!(judge(ended(0.0, 0.5), hit(truth.primitive, 0.499_999_97)), RayVerdict::Tie);
        assert_eq!(judge(ended(0.0, 0.500_000_1), Hit::MISS), RayVerdict::Tie);
        assert_eq!(judge(ended(0.499_999_9, 9.0), Hit::MISS), RayVerdict::Tie);
        assert!(matches!(judge(ended(0.0, 0.51), Hit::MISS), RayVerdict::Unexplained(_)));
        // coincident surfaces: either, and not the same when they are apart
        for (apart, tie) in [(0.0, true), (1e-7, true), (1e-3, false)] {
            let mut s = s.clone();
            s.instances[1].object_to_world.translation.y = -1.0 + apart;
            let o = Oracle::new(&s, DVec3::ZERO);
            let ray = down(0.3, 0.6);
            let below = Hit { t: 0.5, instance: 0, primitive: o.closest(ray).primitive, u: 0.0, v: 0.0 };
            // from below the ceiling, which is the upper one: naming the floor passes over it
            let other = OracleHit { instance: 1, ..o.closest(ray) };
            let floor =
                (0..2).find(|&p| o.candidates(&OracleRay::from(ray), 0, p, Rounding::default()).any(|c| c.certain));
            let verdict =
                judge_closest_ray(&o, &ray, &Hit { primitive: floor.unwrap(), ..below }, &other, Rounding::default());
            assert_eq!(verdict == RayVerdict::Tie, tie, "{apart}: {verdict:?}");
        }
        // grazing: in the plane of the floor
        let grazing = Ray { origin: [-3.0, 0.0, 0.2], tmin: 0.0, direction: [1.0, 0.0, 0.0], tmax: f32::INFINITY };
        assert_ne!(judge(grazing, Hit::MISS), RayVerdict::Unexplained("misses a primitive that it certainly hits"));
        assert!(!matches!(judge(grazing, hit(0, 3.0)), RayVerdict::Unexplained(_)));
        assert!(matches!(judge(grazing, hit(0, 7.0)), RayVerdict::Unexplained(_)), "beyond the floor's extent");
    }

    #[test]
    fn alpha_at_the_cutoff_is_a_tie() {
        let s = builtin::by_name("leaf-cards").unwrap();
        let o = Oracle::new(&s, s.origin());
        let rays = ray_sets::camera_rays(&o, &s.cameras[0], [300, 200], 3);
        let truth = o.trace_closest(&rays);
        // the same scene with cutoffs moved by half of a 255th: what an 8-bit texture unit may do
        let mut moved = s.clone();
        for m in &mut moved.materials {
            if let skylit::scene::AlphaMode::Mask { cutoff } = &mut m.alpha_mode {
                *cutoff += 0.5 / 255.0;
            }
        }
        let answers = |scene: &Scene| -> Vec<Hit> {
            Oracle::new(scene, s.origin()).trace_closest(&rays).iter().map(OracleHit::to_hit).collect()
        };
        let report = judge_closest(&o, &rays, &answers(&moved), &truth, Rounding::default());
        println!("half a 255th: {report}");
        assert!(report.unexplained == 0 && report.ties > 0, "{report}");
        // alpha ignored: found out
        for m in &mut moved.materials {
            m.alpha_mode = Default::default();
        }
        let report = judge_closest(&o, &rays, &answers(&moved), &truth, Rounding::default());
        println!("ignored: {report}");
        assert!(report.unexplained > 1000, "{report}");
    }

    #[test]
    fn far_and_small_and_large() {
        for scale in [1e-3, 1.0, 1e6] {
            for offset in [DVec3::ZERO, DVec3::new(1e6, -2e6, 3e5)] {
                let s = analytic::closed_box(2.0, SceneTransform { scale, offset });
                let o = Oracle::new(&s, s.origin());
                let narrow = Narrow::new(&s, s.origin());
                let mut rays = ray_sets::random_rays(&o, 20_000, 1);
                rays.extend(ray_sets::leak_rays(&o, 20_000, 2));
                let truth = o.trace_closest(&rays);
                let hits: Vec<Hit> = rays.iter().map(|r| narrow.closest(r)).collect();
                let report = judge_closest(&o, &rays, &hits, &truth, Rounding::default());
                println!("scale {scale}, offset {offset}: {report}");
                assert_eq!(report.unexplained, 0, "scale {scale}, offset {offset}: {report}");
            }
        }
    }
}
