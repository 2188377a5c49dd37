//! Every reflection model against itself: densities add up, samples follow them (Pearson's chi-square), weights are value over density, directions
//! may be exchanged, no more light leaves than came; and on all tracers the same.

use super::*;
use skylit::gpu::{Buffer, Commands, Memory};
use skylit::interface::records::ray_set;
use skylit::scene::TriangleMesh;
use skylit::scene::material::{
    Anisotropy, Clearcoat, DiffuseTransmission, Iridescence, Retroreflection, Sheen, Specular, Transmission,
};
use skylit::shaders;
use skylit::tracer::{Push, Stream};
use std::f64::consts::PI;

/// Cells of the sphere: by cosine, by angle.
const GRID: [usize; 2] = [256, 512];
/// So many cells of the grid, along both axes, are a cell of the histogram.
const COARSE: usize = 16;
/// Samples of a histogram.
const SAMPLES: usize = 1 << 17;

/// What the probe wrote about a direction.
#[derive(Clone, Copy, Debug)]
struct Answer {
    f: DVec3,
    pdf: f64,
    wi: DVec3,
    delta: bool,
    weight: DVec3,
}

/// What to ask: a direction, or a sample at a point of the unit cube.
#[derive(Clone, Copy)]
enum Ask {
    At(DVec3),
    Sample([f64; 3]),
}

struct Probe<'a> {
    device: &'a Arc<Device>,
    tracer: Tracer,
    stream: Stream,
}

impl Probe<'_> {
    fn new(device: &Arc<Device>, tracer: Tracer) -> Probe<'_> {
        let stream = tracer.stream(&shaders::probes::BSDF_PROBE_ANY).unwrap();
        Probe { device, tracer, stream }
    }

    /// `part`: number of the material. `normal`: the shading normal; the surface's own is z.
    fn ask(&self, part: u32, viewer: DVec3, normal: DVec3, asks: &[Ask]) -> Vec<Answer> {
        self.ask_all(part, normal, asks.iter().map(|&ask| (viewer, ask)))
    }

    /// The same, each as seen from a direction of its own.
    fn ask_all(&self, part: u32, normal: DVec3, asks: impl Iterator<Item = (DVec3, Ask)>) -> Vec<Answer> {
        let bits = |v: DVec3| v.as_vec3().to_array().map(f32::to_bits);
        let n = bits(normal);
        let inputs: Vec<[u32; 12]> = asks
            .map(|(viewer, ask)| {
                let v = bits(viewer);
                let (given, sample) = match ask {
                    Ask::At(w) => (bits(w), 0),
                    Ask::Sample(u) => (u.map(|x| (x as f32).min(0.999_999_94).to_bits()), 1),
                };
                [v[0], v[1], v[2], part, given[0], given[1], given[2], 0, n[0], n[1], n[2], sample]
            })
            .collect();
        let source = Buffer::from_slice(self.device, "probe inputs", &inputs).unwrap();
        let bytes = 48 * inputs.len() as u64;
        let results = Buffer::new(self.device, "probe outputs", bytes, Memory::Readback).unwrap();
        let probe = [ray_set::Probe { inputs: source.address(), outputs: results.address() }];
        let probe = Buffer::from_slice(self.device, "probe", &probe).unwrap();
        let count = inputs.len() as u32;
        let push = Push { scene: self.tracer.scene_address(), pass: probe.address(), count, ..Default::default() };
        Commands::new(self.device).unwrap().run(|r| self.stream.record(r, &push)).unwrap();
        let results = results.read(0, bytes).unwrap();
        let vector = |v: &[f32]| DVec3::new(v[0].into(), v[1].into(), v[2].into());
        results
            .chunks_exact(48)
            .map(|bytes| {
                let v: [f32; 12] = bytemuck::pod_read_unaligned(bytes);
                Answer {
                    f: vector(&v[..3]),
                    pdf: v[3].into(),
                    wi: vector(&v[4..7]),
                    delta: v[7] != 0.0,
                    weight: vector(&v[8..11]),
                }
            })
            .collect()
    }
}

/// A material, its name, and what is to be known of it.
pub(super) struct Case {
    pub(super) name: &'static str,
    pub(super) material: Material,
    /// Directions may be exchanged.
    reciprocal: bool,
    /// Reflects everything that comes, or all but so much.
    conserves: Option<f64>,
    /// Index of refraction of what is beyond, for what refracts.
    eta: Option<f64>,
}

fn gltf(metallic: f32, roughness: f32) -> Material {
    Material { metallic, roughness, ..Material::default() }
}

pub(super) fn cases() -> Vec<Case> {
    let case = |name, material| Case { name, material, reciprocal: true, conserves: None, eta: None };
    let coat = |factor, roughness| Clearcoat { factor, roughness, ..Default::default() };
    let sheen = |roughness| Sheen { color: Vec3::new(0.9, 0.5, 0.3), roughness, ..Default::default() };
    let through = |factor, thickness| Transmission { factor, thickness, ..Default::default() };
    let grey = |factor, color: f32| Specular { factor, color: Vec3::splat(color), ..Default::default() };
    let turned = Anisotropy { strength: 0.7, rotation: 0.6, ..Default::default() };
    let brhan = |kind, roughness| Material {
        kind,
        roughness,
        specular_color: Vec3::ONE,
        transmittance: Vec3::ONE,
        ior: 1.5,
        ..Material::default()
    };
    let film =
        |factor, nanometres, ior| Iridescence { factor, thickness: [0.0, nanometres], ior, ..Default::default() };
    let translucent =
        |factor, color: f32| DiffuseTransmission { factor, color: Vec3::splat(color), ..Default::default() };
    let returning = |factor| Retroreflection { factor, texture: None };
    let no_specular = grey(0.0, 1.0);
    let rough = |sigma| Material { parameters: [("sigma".to_owned(), sigma)].into(), ..matte(1.0) };
    let ior = |eta: f64, c: Case| Case { eta: Some(eta), ..c };
    vec![
        Case { conserves: Some(0.0), ..case("matte", matte(1.0)) },
        case("Oren-Nayar 0.3", rough(0.3)),
        case("Oren-Nayar 1", rough(1.0)),
        case("metallic-roughness 0.3", gltf(0.0, 0.3)),
        case("metallic-roughness 0.7", gltf(0.0, 0.7)),
        case("metallic-roughness 1", gltf(0.0, 1.0)),
        case("metal 0.3", gltf(1.0, 0.3)),
        case("metal 0.8", gltf(1.0, 0.8)),
        case("half metal 0.5", gltf(0.5, 0.5)),
        case("anisotropic metal", Material { anisotropy: turned, ..gltf(1.0, 0.4) }),
        case("coat 0.3 over plastic", Material { clearcoat: coat(1.0, 0.3), ..gltf(0.0, 0.6) }),
        case("smooth half coat over metal", Material { clearcoat: coat(0.5, 0.0), ..gltf(1.0, 0.5) }),
        case("sheen 0.3", Material { sheen: sheen(0.3), ..gltf(0.0, 0.8) }),
        case("sheen 0.8", Material { sheen: sheen(0.8), ..gltf(0.0, 0.8) }),
        case("coat over sheen", Material { sheen: sheen(0.6), clearcoat: coat(1.0, 0.4), ..gltf(0.0, 0.8) }),
        case("thin walls 0.4", Material { transmission: through(0.8, 0.0), ..gltf(0.0, 0.4) }),
        case("smooth thin walls, half metal", Material { transmission: through(0.7, 0.0), ..gltf(0.5, 0.0) }),
        case("thin walls 0.5, half metal", Material { transmission: through(0.7, 0.0), ..gltf(0.4, 0.5) }),
        ior(1.5, case("volume 0.4, half metal", Material { transmission: through(0.8, 1.0), ..gltf(0.3, 0.4) })),
        case("index 0", Material { ior: 0.0, specular: grey(0.8, 0.3), ..gltf(0.0, 0.5) }),
        case(
            "index 0, body",
            Material { ior: 0.0, specular: grey(0.8, 0.3), transmission: through(0.6, 1.0), ..gltf(0.2, 0.5) },
        ),
        Case { conserves: Some(1e-5), ..case("smooth, index 0", Material { ior: 0.0, ..gltf(0.0, 0.0) }) },
        ior(1.5, case("volume 0.5", Material { transmission: through(1.0, 1.0), ..gltf(0.0, 0.5) })),
        ior(1.33, case("half volume 0.6", Material { transmission: through(0.5, 1.0), ior: 1.33, ..gltf(0.0, 0.6) })),
        ior(
            1.5,
            Case {
                conserves: Some(1e-3),
                ..case("smooth volume", Material { transmission: through(1.0, 1.0), ..gltf(0.0, 0.0) })
            },
        ),
        case("film over plastic", Material { iridescence: film(1.0, 380.0, 1.3), ..gltf(0.0, 0.4) }),
        case("film over half metal", Material { iridescence: film(0.7, 550.0, 1.8), ..gltf(0.5, 0.5) }),
        case("film over smooth metal", Material { iridescence: film(1.0, 300.0, 1.4), ..gltf(1.0, 0.0) }),
        case(
            "film over thin walls",
            Material { iridescence: film(1.0, 420.0, 1.4), transmission: through(0.9, 0.0), ..gltf(0.0, 0.4) },
        ),
        ior(
            1.5,
            case(
                "film over volume 0.5",
                Material { iridescence: film(1.0, 420.0, 1.4), transmission: through(1.0, 1.0), ..gltf(0.0, 0.5) },
            ),
        ),
        case("translucent", Material { diffuse_transmission: translucent(0.6, 0.8), ..gltf(0.0, 0.5) }),
        case(
            "translucent, thin walls, sheen",
            Material {
                diffuse_transmission: translucent(0.6, 0.8),
                transmission: through(0.4, 0.0),
                sheen: sheen(0.5),
                ..gltf(0.2, 0.5)
            },
        ),
        Case {
            conserves: Some(0.0),
            ..case(
                "translucent alone",
                Material { diffuse_transmission: translucent(0.3, 1.0), specular: no_specular, ..gltf(0.0, 1.0) },
            )
        },
        case("retroreflective plastic", Material { retroreflection: returning(0.7), ..gltf(0.0, 0.4) }),
        case("retroreflective metal", Material { retroreflection: returning(1.0), ..gltf(1.0, 0.5) }),
        case(
            "retroreflective anisotropic metal under a coat",
            Material {
                retroreflection: returning(0.5),
                anisotropy: turned,
                clearcoat: coat(1.0, 0.3),
                ..gltf(1.0, 0.5)
            },
        ),
        ior(
            1.5,
            case(
                "retroreflective volume 0.5",
                Material { retroreflection: returning(0.6), transmission: through(1.0, 1.0), ..gltf(0.0, 0.5) },
            ),
        ),
        Case {
            conserves: Some(1e-5),
            ..case("smooth retroreflective metal", Material { retroreflection: returning(0.3), ..gltf(1.0, 0.0) })
        },
        ior(1.5, case("rough glass", brhan(MaterialKind::Glass, 0.6))),
        ior(1.5, Case { conserves: Some(1e-3), ..case("smooth glass", brhan(MaterialKind::Glass, 0.0)) }),
        case("copper", brhan(MaterialKind::Copper, 0.4)),
        case("gold", brhan(MaterialKind::Gold, 0.7)),
        Case { conserves: Some(0.0), ..case("mirror", brhan(MaterialKind::Mirror, 0.0)) },
    ]
}

/// A triangle of each material, with a tangent along x.
pub(super) fn scene(cases: &[Case]) -> Scene {
    let triangle = || {
        Geometry::Triangles(TriangleMesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            indices: vec![[0, 1, 2]],
            normals: vec![Vec3::Z; 3],
            tangents: vec![glam::Vec4::new(1.0, 0.0, 0.0, 1.0); 3],
            texcoords: [vec![glam::Vec2::ZERO, glam::Vec2::X, glam::Vec2::Y], Vec::new()],
            ..TriangleMesh::default()
        })
    };
    let camera = Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, 0.5);
    scene_of(cases.iter().map(|c| (triangle(), c.material.clone())).collect(), camera)
}

fn from_above(cosine: f64, turn: f64) -> DVec3 {
    let s = (1.0 - cosine * cosine).sqrt();
    DVec3::new(s * turn.cos(), s * turn.sin(), cosine)
}

/// Middles of the grid's cells.
fn grid() -> Vec<Ask> {
    let [across, around] = GRID;
    let at = |k: usize, n: usize| (k as f64 + 0.5) / n as f64;
    (0..across * around)
        .map(|k| Ask::At(from_above(1.0 - 2.0 * at(k / around, across), 2.0 * PI * at(k % around, around))))
        .collect()
}

/// Solid angle of a cell.
const CELL: f64 = 4.0 * PI / (GRID[0] * GRID[1]) as f64;

/// Independent points of the unit cube.
fn random(n: usize, seed: u32) -> Vec<[f64; 3]> {
    use skylit::sampling::sobol::{hash_combine, to_unit};
    let x = |i: usize, k: u32| f64::from(to_unit(hash_combine(hash_combine(seed, i as u32), k)));
    (0..n).map(|i| [x(i, 0), x(i, 1), x(i, 2)]).collect()
}

/// Where a direction's cell of the histogram is.
fn coarse(w: DVec3) -> usize {
    let [across, around] = GRID.map(|n| n / COARSE);
    let row = ((0.5 - 0.5 * w.z) * across as f64).clamp(0.0, across as f64 - 1.0) as usize;
    let turn = (w.y.atan2(w.x) / (2.0 * PI)).rem_euclid(1.0);
    row * around + ((turn * around as f64) as usize).min(around - 1)
}

/// How far a chi-square statistic is from what it should be, in standard deviations (Wilson and Hilferty 1931).
fn deviations(statistic: f64, freedom: f64) -> f64 {
    let v = 2.0 / (9.0 * freedom);
    ((statistic / freedom).cbrt() - (1.0 - v)) / v.sqrt()
}

/// Pearson's statistic of counts against what is expected; cells of which little is expected are taken together.
fn chi_square(expected: &[f64], counts: &[f64]) -> f64 {
    let (mut statistic, mut cells, mut rest) = (0.0, 0.0f64, (0.0, 0.0));
    for (&e, &c) in expected.iter().zip(counts) {
        if e < 8.0 {
            rest = (rest.0 + e, rest.1 + c);
        } else {
            statistic += (c - e).powi(2) / e;
            cells += 1.0;
        }
    }
    if rest.0 >= 8.0 {
        statistic += (rest.1 - rest.0).powi(2) / rest.0;
        cells += 1.0;
    } else {
        // where next to nothing is expected, next to nothing may be
        assert!(rest.1 <= rest.0 + 6.0 * (rest.0 + 1.0).sqrt(), "{} samples where {} are expected", rest.1, rest.0);
    }
    deviations(statistic, (cells - 1.0).max(1.0))
}

/// Views of a surface: cosines, from behind too where it refracts.
fn views(case: &Case) -> Vec<DVec3> {
    let above = [0.95, 0.5, 0.12].map(|c| from_above(c, 0.4));
    above.into_iter().chain(case.eta.map(|_| from_above(-0.8, 0.4))).collect()
}

#[test]
fn gpu_samples_follow_their_density() {
    samples_follow_their_density(&cases(), false);
}

/// The same of what energy compensation changes: its factors are part of probabilities.
#[test]
fn gpu_compensated_samples_follow_their_density() {
    // the grid over the sphere resolves neither narrower lobes, which have a test of their own, nor the edge of what the roughest refract
    let resolved = |c: &Case| match c.material.roughness {
        0.0 => true,
        roughness if c.eta.is_some() => (0.3..0.8).contains(&roughness),
        roughness => roughness >= 0.3,
    };
    let cases: Vec<Case> = compensated().into_iter().filter(resolved).collect();
    samples_follow_their_density(&cases, true);
}

fn samples_follow_their_density(cases: &[Case], compensation: bool) {
    let device = device();
    let scene = scene(cases);
    let flat = FlatScene::for_paths(&scene);
    let needs = Needs { shading: true, compensation, ..Default::default() };
    let probe = Probe::new(&device, Tracer::new(&device, TracerKind::Compute, &flat, needs).unwrap());
    let (grid, samples) = (grid(), random(SAMPLES, 5));
    let asks: Vec<Ask> = samples.iter().map(|&u| Ask::Sample(u)).collect();
    println!(
        "{:32} {:>6} {:>9} {:>9} {:>7} {:>9} {:>9}",
        "material", "cos", "density", "samples", "delta", "chi2, sd", "albedo"
    );
    let (mut worst, mut most) = (0.0f64, 0.0f64);
    for (part, case) in (0u32..).zip(cases) {
        // and about a normal that leans away from the surface's
        for (view, normal) in
            views(case).into_iter().map(|v| (v, DVec3::Z)).chain([(from_above(0.6, 0.4), from_above(0.9, 2.9))])
        {
            let what = format!("{}, {:.2}, normal {normal:.2}", case.name, view.z);
            let at = probe.ask(part, view, normal, &grid);
            let drawn = probe.ask(part, view, normal, &asks);
            let finite = |a: &Answer| a.f.is_finite() && a.pdf.is_finite() && a.pdf >= 0.0 && a.f.min_element() >= 0.0;
            assert!(at.iter().all(finite), "{what}: {:?}", at.iter().find(|a| !finite(a)));
            assert!(drawn.iter().all(|a| finite(a) && a.weight.is_finite()), "{what}");

            let (mut expected, mut counts) =
                (vec![0.0; grid.len() / (COARSE * COARSE)], vec![0.0; grid.len() / (COARSE * COARSE)]);
            for (ask, a) in grid.iter().zip(&at) {
                let Ask::At(w) = ask else { unreachable!() };
                expected[coarse(*w)] += a.pdf * CELL * SAMPLES as f64;
            }
            let (mut rough, mut delta) = (0.0, 0.0);
            // radiance is compressed beyond the surface: as energy it is more, by the square of the index
            let index = case.eta.map_or(1.0, |eta| if view.z > 0.0 { eta * eta } else { 1.0 / (eta * eta) });
            let (mut reflected, mut energy) = (DVec3::ZERO, DVec3::ZERO);
            for a in drawn.iter().filter(|a| a.pdf > 0.0) {
                reflected += a.weight;
                energy += a.weight * if a.wi.z * view.z < 0.0 { index } else { 1.0 };
                assert!((a.wi.length() - 1.0).abs() < 1e-4, "{what}: {a:?}");
                if a.delta {
                    delta += 1.0;
                } else {
                    rough += 1.0;
                    counts[coarse(a.wi)] += 1.0;
                    let again = (a.weight * a.pdf - a.f).abs().max_element();
                    assert!(
                        again <= 2e-4 * a.f.max_element() + 1e-6,
                        "{what}: weight {:?} is not value over density: {a:?}",
                        a.weight
                    );
                }
            }
            let n = SAMPLES as f64;
            let density = expected.iter().sum::<f64>() / n;
            let (share, sd) = (rough / n, (density * (1.0 - density).max(1e-4) / n).sqrt());
            let chi = if rough > 0.0 { chi_square(&expected, &counts) } else { 0.0 };
            let (albedo, energy) = (reflected / n, energy / n);
            println!(
                "{:32} {:6.2} {density:9.5} {share:9.5} {:7.3} {chi:9.2} {:9.5}",
                case.name,
                view.z,
                delta / n,
                energy.x
            );
            worst = worst.max(chi);
            assert!((density - share).abs() <= 5.0 * sd + 3e-3, "{what}: density {density}, samples {share}");
            assert!(chi < 5.0, "{what}: samples do not follow their density: {chi} standard deviations");
            // what of the light comes back; a sample's weight varies little
            most = most.max(energy.max_element());
            // glTF takes what is diffuse for what the Fresnel term leaves at the half vector, which is another for each direction: at grazing
            // angles that is more than the specular term, whose half vectors are near the normal, takes away
            let mixes = case.material.kind == MaterialKind::MetallicRoughness && case.material.metallic < 1.0;
            let limit = if compensation {
                1.0 + 5e-3
            } else if mixes {
                1.0 + 0.4 * (1.0 - view.dot(normal).abs()).powi(2)
            } else {
                1.0
            };
            assert!(energy.max_element() <= limit + 5e-3, "{what}: {energy} of the light goes on");
            // what a rough lobe about a normal that leans sends through the true surface is lost; a perfectly smooth one has nothing to lose
            if let Some(loss) = case.conserves.filter(|_| normal == DVec3::Z || rough == 0.0) {
                assert!((1.0 - energy.x).abs() <= loss + 1e-5, "{what}: {energy} of the light goes on");
            }
            if case.name == "matte" && normal != DVec3::Z {
                for (ask, a) in grid.iter().zip(&at) {
                    let Ask::At(w) = ask else { unreachable!() };
                    // Chiang, Li, Burley 2019
                    let g = w.z / (normal.dot(*w) * normal.z);
                    let factor = if g >= 1.0 { 1.0 } else { g + g * g - g.powi(3) };
                    let seen = w.z > 0.0 && normal.dot(*w) > 0.0;
                    let expected = if seen { normal.dot(*w) / PI * factor } else { 0.0 };
                    assert!((a.f.x - expected).abs() < 1e-5, "{what}: {w}: {}, not {expected}", a.f.x);
                }
            }
            // the same by quadrature, of what is not a delta lobe
            if delta == 0.0 {
                let sum = at.iter().map(|a| a.f * CELL).sum::<DVec3>();
                assert!((sum - albedo).abs().max_element() < 8e-3, "{what}: {sum} by quadrature, {albedo} by samples");
            }
        }
    }
    println!("greatest: {worst:.2}; most light that goes on: {most:.4}");
    assert_validation_clean(&device);
}

/// What retroreflects looks, in each direction, as what does not from the mirror image of that direction; a half of both is their mean. Without roughness all
/// that is reflected returns.
#[test]
fn gpu_retroreflection_is_reflection_of_the_mirror_image() {
    let device = device();
    let case = |material| Case { name: "", material, reciprocal: true, conserves: None, eta: None };
    let returning =
        |factor, below: Material| Material { retroreflection: Retroreflection { factor, texture: None }, ..below };
    let colored = Material { base_color: glam::Vec4::new(0.9, 0.6, 0.2, 1.0), ..gltf(1.0, 0.4) };
    let all = [
        case(colored.clone()),
        case(returning(1.0, colored.clone())),
        case(returning(0.5, colored)),
        case(returning(1.0, gltf(1.0, 0.0))),
    ];
    let scene = scene(&all);
    let flat = FlatScene::for_paths(&scene);
    let probe = Probe::new(&device, tracer(&device, TracerKind::Compute, &flat));
    let pairs: Vec<_> = random(512, 3)
        .iter()
        .map(|u| (from_above(0.05 + 0.95 * u[0], 1.3), from_above(0.05 + 0.95 * u[1], 2.0 * PI * u[2])))
        .collect();
    let from = |part, is_mirrored: bool| {
        let viewer = move |v: DVec3| if is_mirrored { DVec3::new(-v.x, -v.y, v.z) } else { v };
        probe.ask_all(part, DVec3::Z, pairs.iter().map(move |&(a, b)| (viewer(a), Ask::At(b))))
    };
    let (plain, mirrored, returned, half) = (from(0, false), from(0, true), from(1, false), from(2, false));
    let mut bright = 0;
    for (k, (a, b)) in pairs.iter().enumerate() {
        let scale = plain[k].f.max_element().max(mirrored[k].f.max_element());
        let differs = |a: DVec3, b: DVec3| (a - b).abs().max_element() > 2e-4 * scale + 1e-7;
        assert!(!differs(returned[k].f, mirrored[k].f), "{a} {b}: {} and {}", returned[k].f, mirrored[k].f);
        let mean = 0.5 * (plain[k].f + mirrored[k].f);
        assert!(!differs(half[k].f, mean), "{a} {b}: {} and {mean}", half[k].f);
        bright += usize::from(differs(returned[k].f, plain[k].f));
    }
    assert!(bright > 400, "only {bright} of {} pairs tell the two apart", pairs.len());
    let view = from_above(0.6, 0.4);
    for a in probe.ask(3, view, DVec3::Z, &random(64, 2).into_iter().map(Ask::Sample).collect::<Vec<_>>()) {
        assert!(a.delta && (a.wi - view).length() < 1e-5 && (a.weight - DVec3::ONE).length() < 1e-5, "{a:?}");
    }
}

#[test]
fn gpu_directions_may_be_exchanged() {
    let device = device();
    let cases = cases();
    let scene = scene(&cases);
    let flat = FlatScene::for_paths(&scene);
    let probe = Probe::new(&device, tracer(&device, TracerKind::Compute, &flat));
    let mut checked = 0;
    for (part, case) in (0u32..).zip(&cases).filter(|(_, c)| c.reciprocal) {
        let side = if case.eta.is_some() || case.material.transmission.factor > 0.0 { 2.0 } else { 1.0 };
        let two = |u: &[f64; 3]| {
            (from_above(0.05 + 0.95 * u[0], 1.0), from_above(1.0 - (side - 0.05) * u[1], 2.0 * PI * u[2]))
        };
        let all: Vec<_> = random(256, 9).iter().map(two).filter(|(_, b)| b.z.abs() > 0.05).collect();
        let there = probe.ask_all(part, DVec3::Z, all.iter().map(|&(a, b)| (a, Ask::At(b))));
        let back = probe.ask_all(part, DVec3::Z, all.iter().map(|&(a, b)| (b, Ask::At(a))));
        let mut pairs = 0;
        for ((&(a, b), there), back) in all.iter().zip(&there).zip(&back) {
            let (there, back) = (there.f / b.z.abs(), back.f / a.z.abs());
            // through a surface radiance changes with the square of the index (Veach 1997, 5.2)
            let eta = if b.z < 0.0 { case.eta.unwrap_or(1.0) } else { 1.0 };
            let difference = (there * eta * eta - back).abs().max_element();
            let scale = there.max_element().max(back.max_element());
            assert!(difference <= 2e-3 * scale + 1e-6, "{}: {a} {b}: {there} and {back}", case.name);
            pairs += usize::from(scale > 1e-6);
        }
        checked += usize::from(pairs > 10);
    }
    assert!(checked >= 17, "of {} materials only {checked} had anything to exchange", cases.len());
}

/// White materials, all light of which goes on with energy compensation.
fn compensated() -> Vec<Case> {
    let glass = |roughness| Material {
        kind: MaterialKind::Glass,
        specular_color: Vec3::ONE,
        transmittance: Vec3::ONE,
        roughness,
        ..Material::default()
    };
    let through = |factor, thickness, metallic, roughness| Material {
        transmission: Transmission { factor, thickness, ..Default::default() },
        ..gltf(metallic, roughness)
    };
    let case = |name, material| Case { name, material, reciprocal: false, conserves: None, eta: None };
    let body = |name, material| Case { eta: Some(1.5), ..case(name, material) };
    let half_specular = Specular { factor: 0.5, ..Default::default() };
    let coated = |factor, roughness, below| Material {
        clearcoat: Clearcoat { factor, roughness, ..Default::default() },
        ..below
    };
    vec![
        case("smooth coat over plastic", coated(1.0, 0.0, gltf(0.0, 0.6))),
        case("coat 0.3 over metal", coated(1.0, 0.3, gltf(1.0, 0.5))),
        case("coat 1 over plastic", coated(1.0, 1.0, gltf(0.0, 0.5))),
        case("half coat 0.6 over smooth metal", coated(0.5, 0.6, gltf(1.0, 0.0))),
        case("metal 0.1", gltf(1.0, 0.1)),
        case("metal 0.5", gltf(1.0, 0.5)),
        case("metal 1", gltf(1.0, 1.0)),
        case("smooth plastic", gltf(0.0, 0.0)),
        case("plastic 0.1", gltf(0.0, 0.1)),
        case("plastic 0.5", gltf(0.0, 0.5)),
        case("plastic 1", gltf(0.0, 1.0)),
        case("half metal 0", gltf(0.5, 0.0)),
        case("half metal 0.5", gltf(0.5, 0.5)),
        case("half metal 1", gltf(0.5, 1.0)),
        case("thin walls 0", through(1.0, 0.0, 0.0, 0.0)),
        case("thin walls 0.5", through(1.0, 0.0, 0.0, 0.5)),
        case("thin walls 1", through(1.0, 0.0, 0.0, 1.0)),
        case("half thin walls 0", through(0.5, 0.0, 0.0, 0.0)),
        case("half thin walls 0.5", through(0.5, 0.0, 0.0, 0.5)),
        case("half metal, half thin walls 1", through(0.5, 0.0, 0.5, 1.0)),
        body("glass 0.5", glass(0.5)),
        body("glass 1", glass(1.0)),
        body("smooth volume", through(1.0, 1.0, 0.0, 0.0)),
        body("volume 0.1", through(1.0, 1.0, 0.0, 0.1)),
        body("volume 0.5", through(1.0, 1.0, 0.0, 0.5)),
        body("volume 1", through(1.0, 1.0, 0.0, 1.0)),
        body("smooth half volume", through(0.5, 1.0, 0.0, 0.0)),
        body("half volume 0.5", through(0.5, 1.0, 0.0, 0.5)),
        body("volume 0.7, specular 0.5", Material { specular: half_specular, ..through(1.0, 1.0, 0.0, 0.7) }),
        body("half metal volume 0.6", through(0.7, 1.0, 0.5, 0.6)),
    ]
}

/// Microfacets of one bounce lose light; what `--energy-compensation` gives back is all of it, at every angle and from inside of bodies too.
#[test]
fn gpu_compensation_gives_back_what_is_lost() {
    let device = device();
    let cases = compensated();
    let scene = scene(&cases);
    let flat = FlatScene::for_paths(&scene);
    let cosines = [1.0, 0.6, 0.2, 0.1, 0.05, 0.02, 0.01];
    let asks: Vec<Ask> = random(SAMPLES, 3).into_iter().map(Ask::Sample).collect();
    let probes = [false, true].map(|compensation| {
        let needs = Needs { shading: true, compensation, ..Default::default() };
        Probe::new(&device, Tracer::new(&device, TracerKind::Compute, &flat, needs).unwrap())
    });
    println!("{:30} {:>6} {:>9} {:>11}", "material", "cos", "as it is", "compensated");
    for (part, case) in (0u32..).zip(&cases) {
        let inside: &[f64] = if case.eta.is_some() { &[-1.0, -0.8, -0.7, -0.6, -0.2, -0.05, -0.01] } else { &[] };
        let mut worst = 0.0f64;
        for &cosine in cosines.iter().chain(inside) {
            let energy = |probe: &Probe| {
                let drawn = probe.ask(part, from_above(cosine, 0.3), DVec3::Z, &asks);
                // radiance is compressed beyond the surface: as energy it is more, by the square of the index
                let index = f64::from(case.material.ior).powi(if cosine > 0.0 { 2 } else { -2 });
                let through = |a: &Answer| case.eta.is_some() && a.wi.z * cosine < 0.0;
                let sum: f64 = drawn
                    .iter()
                    .filter(|a| a.pdf > 0.0)
                    .map(|a| a.weight.x * if through(a) { index } else { 1.0 })
                    .sum();
                sum / asks.len() as f64
            };
            let [plain, full] = probes.each_ref().map(energy);
            println!("{:30} {cosine:6.2} {plain:9.4} {full:11.4}", case.name);
            worst = worst.max((full - 1.0).abs());
            assert!(
                (full - 1.0).abs() <= 1e-2,
                "{}: {full} of the light at cosine {cosine}, {plain} without",
                case.name
            );
        }
        println!("{:30} at most off by {worst:.4}", case.name);
    }
}

/// Lobes that a grid over the sphere does not resolve, down to the least alpha: density and samples by cells of the half vector's hemisphere that
/// hold an equal share of the microfacets each, and weights that lose nothing.
#[test]
fn gpu_narrow_lobes_follow_their_density() {
    const N: usize = 256;
    let device = device();
    let roughnesses = [0.0032f32, 0.004, 0.006, 0.01, 0.02, 0.032, 0.1];
    let cases = roughnesses.map(|roughness| Case {
        name: "metal",
        material: gltf(1.0, roughness),
        reciprocal: true,
        conserves: None,
        eta: None,
    });
    let scene = scene(&cases);
    let flat = FlatScene::for_paths(&scene);
    let probe = Probe::new(&device, tracer(&device, TracerKind::Compute, &flat));
    let asks: Vec<Ask> = random(SAMPLES, 6).into_iter().map(Ask::Sample).collect();
    println!("{:>9} {:>9} {:>5} {:>9} {:>9} {:>9}", "roughness", "alpha", "cos", "density", "albedo", "chi2, sd");
    for (part, roughness) in (0u32..).zip(roughnesses) {
        let alpha = f64::from(roughness).powi(2);
        for cosine in [0.95, 0.5, 0.12] {
            let wo = from_above(cosine, 0.4);
            // by the squared slope and the angle of the half vector
            let coarse = |u: f64, turn: f64| ((u * 16.0) as usize).min(15) * 16 + ((turn * 16.0) as usize).min(15);
            let (mut directions, mut shares) = (Vec::new(), Vec::new());
            for k in 0..N * N {
                let (u, turn) = (((k / N) as f64 + 0.5) / N as f64, ((k % N) as f64 + 0.5) / N as f64);
                let slope = alpha * (u / (1.0 - u)).sqrt();
                let z = 1.0 / (1.0 + slope * slope).sqrt();
                let m = DVec3::new(slope * z * (2.0 * PI * turn).cos(), slope * z * (2.0 * PI * turn).sin(), z);
                let om = wo.dot(m);
                let wi = 2.0 * om * m - wo;
                if om > 0.0 && wi.z > 0.0 {
                    let d = 1.0 / (PI * alpha * alpha * z.powi(4) * (1.0 + u / (1.0 - u)).powi(2));
                    directions.push(Ask::At(wi));
                    shares.push((coarse(u, turn), 4.0 * om / (d * z) / (N * N) as f64));
                }
            }
            let mut expected = vec![0.0; 256];
            for (a, (cell, share)) in probe.ask(part, wo, DVec3::Z, &directions).iter().zip(&shares) {
                expected[*cell] += a.pdf * share * SAMPLES as f64;
            }
            let (mut counts, mut albedo) = (vec![0.0; 256], 0.0);
            for a in probe.ask(part, wo, DVec3::Z, &asks).iter().filter(|a| a.pdf > 0.0) {
                assert!(!a.delta && a.weight.is_finite(), "roughness {roughness}: {a:?}");
                let h = a.wi + wo;
                let slope2 = (h.x * h.x + h.y * h.y) / (h.z * h.z);
                counts[coarse(slope2 / (alpha * alpha + slope2), (h.y.atan2(h.x) / (2.0 * PI)).rem_euclid(1.0))] += 1.0;
                albedo += a.weight.x / SAMPLES as f64;
            }
            let density = expected.iter().sum::<f64>() / SAMPLES as f64;
            let chi = chi_square(&expected, &counts);
            println!("{roughness:9.4} {alpha:9.1e} {cosine:5.2} {density:9.5} {albedo:9.5} {chi:9.2}");
            let what = format!("roughness {roughness}, cosine {cosine}");
            assert!((density - counts.iter().sum::<f64>() / SAMPLES as f64).abs() < 2e-3, "{what}: density {density}");
            assert!(chi < 5.0, "{what}: samples do not follow their density: {chi} standard deviations");
            assert!(roughness > 0.032 || (albedo - 1.0).abs() < 1e-3, "{what}: {albedo}");
        }
    }
    assert_validation_clean(&device);
}

/// Reflectance of a film by the phase between its two reflections, exactly: Fresnel's amplitudes of both polarizations and Airy's sum over reflections.
fn airy(film: f64, base: f64, cosine: f64, phase: f64) -> f64 {
    let (c1, c2, c3) = (cosine, cosine_in(film, cosine), cosine_in(base, cosine));
    let reflectance = |upper: f64, lower: f64| {
        let product = upper * lower;
        let both = 2.0 * product * phase.cos();
        (upper * upper + lower * lower + both) / (1.0 + product * product + both)
    };
    let perpendicular = |n: f64, c: f64, m: f64, d: f64| (n * c - m * d) / (n * c + m * d);
    let parallel = |n: f64, c: f64, m: f64, d: f64| (m * c - n * d) / (m * c + n * d);
    let s = reflectance(perpendicular(1.0, c1, film, c2), perpendicular(film, c2, base, c3));
    let p = reflectance(parallel(1.0, c1, film, c2), parallel(film, c2, base, c3));
    0.5 * (s + p)
}

/// Cosine of light within a medium of this index that had `cosine` outside.
fn cosine_in(index: f64, cosine: f64) -> f64 {
    (1.0 - (1.0 - cosine * cosine) / (index * index)).sqrt()
}

/// The eye's sensitivities at a wavelength, by a fit of their own (Wyman, Sloan, Shirley, "Simple Analytic Approximations to the CIE XYZ Color Matching Functions", JCGT 2013).
fn sensitivities(wavelength: f64) -> DVec3 {
    let lobe = |area: f64, mean: f64, below: f64, above: f64| {
        let t = (wavelength - mean) / if wavelength < mean { below } else { above };
        area * (-0.5 * t * t).exp()
    };
    DVec3::new(
        lobe(1.056, 599.8, 37.9, 31.0) + lobe(0.362, 442.0, 16.0, 26.7) + lobe(-0.065, 501.1, 20.4, 26.2),
        lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1),
        lobe(1.217, 437.0, 11.8, 36.0) + lobe(0.681, 459.0, 26.0, 13.8),
    )
}

/// Colours of thin films against interference that is integrated over the spectrum: the shader's closed form has Schlick's Fresnel terms, two orders and Gaussians.
#[test]
fn gpu_colours_of_thin_films() {
    let device = device();
    let films = [(250.0, 1.33, 0.5), (380.0, 1.33, 0.04), (500.0, 1.33, 0.9), (300.0, 1.8, 0.04), (550.0, 2.0, 0.6)];
    let material = |&(nanometres, ior, f0): &(f32, f32, f32)| Material {
        iridescence: Iridescence { factor: 1.0, ior, thickness: [0.0, nanometres], ..Default::default() },
        base_color: glam::Vec4::new(f0, f0, f0, 1.0),
        ..gltf(1.0, 0.0)
    };
    let case = |film| Case { name: "film", material: material(film), reciprocal: true, conserves: None, eta: None };
    let cases: Vec<Case> = films.iter().map(case).collect();
    let scene = scene(&cases);
    let flat = FlatScene::for_paths(&scene);
    let to_srgb = glam::DMat3::from_cols(
        DVec3::new(3.2404542, -0.9692660, 0.0556434),
        DVec3::new(-1.5371385, 1.8760108, -0.2040259),
        DVec3::new(-0.4985314, 0.0415560, 1.0572252),
    );
    for kind in tracers(&device) {
        let probe = Probe::new(&device, tracer(&device, kind, &flat));
        let mut worst = 0.0f64;
        for (part, &(nanometres, ior, f0)) in (0u32..).zip(&films) {
            let base = (1.0 + f64::from(f0).sqrt()) / (1.0 - f64::from(f0).sqrt());
            for cosine in [1.0, 0.9, 0.7, 0.5] {
                let at = |phase: f64| airy(ior.into(), base, cosine, phase);
                // what does not depend on the wavelength is the same in all channels
                let mean = (0..256).map(|k| at(2.0 * PI * f64::from(k) / 256.0)).sum::<f64>() / 256.0;
                let path = 2.0 * f64::from(ior) * f64::from(nanometres) * cosine_in(ior.into(), cosine);
                let (mut sum, mut white) = (DVec3::ZERO, 0.0);
                for wavelength in (360..=830).map(f64::from) {
                    sum += sensitivities(wavelength) * (at(2.0 * PI * path / wavelength) - mean);
                    white += sensitivities(wavelength).y;
                }
                let expected = (DVec3::splat(mean) + to_srgb * (sum / white)).clamp(DVec3::ZERO, DVec3::ONE);
                let found = probe.ask(part, from_above(cosine, 0.3), DVec3::Z, &[Ask::Sample([0.5, 0.5, 0.1])])[0];
                assert!(found.delta);
                let off = (found.weight - expected).abs().max_element();
                worst = worst.max(off);
                // Schlick's term is farthest from both polarizations' mean at grazing angles
                let bound = if cosine >= 0.9 { 0.035 } else { 0.08 };
                assert!(
                    off < bound,
                    "{kind} {nanometres} nm of {ior} over {f0}, cosine {cosine}: {:.3}, {expected:.3}",
                    found.weight
                );
                println!(
                    "{kind} {nanometres} nm of {ior} over {f0}, cosine {cosine}: {:.3}, {expected:.3}",
                    found.weight
                );
            }
        }
        println!("{kind}: at most off by {worst:.4}");
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_tracers_agree_on_materials() {
    let device = device();
    let cases = cases();
    let scene = scene(&cases);
    let flat = FlatScene::for_paths(&scene);
    let asks: Vec<Ask> = random(64, 1).iter().map(|&u| Ask::Sample(u)).collect();
    let answers = |kind: TracerKind| -> Vec<Answer> {
        let probe = Probe::new(&device, tracer(&device, kind, &flat));
        (0..cases.len() as u32).flat_map(|part| probe.ask(part, from_above(0.6, 0.2), DVec3::Z, &asks)).collect()
    };
    let kinds = tracers(&device);
    let first = answers(kinds[0]);
    for &kind in &kinds[1..] {
        for (k, (a, b)) in first.iter().zip(answers(kind)).enumerate() {
            let near = |x: DVec3, y: DVec3| (x - y).abs().max_element() <= 1e-4 * x.abs().max_element() + 1e-6;
            let name = cases[k / asks.len()].name;
            assert!(
                near(a.wi, b.wi) && near(a.weight, b.weight) && a.delta == b.delta,
                "{name}: {a:?} by {}, {b:?} by {kind}",
                kinds[0]
            );
        }
    }
    assert_validation_clean(&device);
}
