//! The sampler on the device against the host's, bit for bit.

use skylit::gpu::{Buffer, Commands, Memory};
use skylit::interface::records::ray_set::Probe;
use skylit::sampling::sobol::hash_combine;
use skylit::sampling::{Sampler, to_unit, warp};
use skylit::scene::builtin::{SceneTransform, analytic};
use skylit::shaders;
use skylit::tracer::Push;

use crate::common::{assert_validation_clean, device, tracer, tracers};

#[test]
fn gpu_sampler_gives_the_hosts_bits() {
    let device = device();
    let count = 100_000u32;
    let random = |i: u32, k: u32| hash_combine(hash_combine(7, i), k);
    let inputs: Vec<[u32; 8]> = (0..count)
        .map(|i| {
            // a third of the sample indices small, as in images; the others use all bits
            let sample = random(i, 3) >> if i % 3 == 0 { 20 } else { 0 };
            let z = 1.0 - 2.0 * to_unit(random(i, 5)) as f64;
            let (s, c) = (std::f64::consts::TAU * to_unit(random(i, 6)) as f64).sin_cos();
            let r = (1.0 - z * z).max(0.0).sqrt();
            let normal = match i {
                // the frame's seam and poles
                0 => [0.0, 0.0, 1.0],
                1 => [0.0, 0.0, -1.0],
                2 => [1.0, 0.0, -0.0],
                _ => [r * c, r * s, z].map(|x| x as f32),
            };
            let [nx, ny, nz] = normal.map(f32::to_bits);
            [random(i, 0), random(i, 1) >> 18, random(i, 2) >> 18, sample, random(i, 4) & 15, nx, ny, nz]
        })
        .collect();
    let scene = analytic::plane(1.0, SceneTransform::default());
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        let stream = tracer.stream(&shaders::probes::SAMPLER_PROBE_ANY).unwrap();
        let source = Buffer::from_slice(&device, "probe inputs", &inputs).unwrap();
        let results = Buffer::new(&device, "probe outputs", 48 * count as u64, Memory::Readback).unwrap();
        let probe =
            Buffer::from_slice(&device, "probe", &[Probe { inputs: source.address(), outputs: results.address() }])
                .unwrap();
        let push = Push { scene: tracer.scene_address(), pass: probe.address(), count, ..Default::default() };
        Commands::new(&device).unwrap().run(|r| stream.record(r, &push)).unwrap();
        let results = results.read(0, 48 * count as u64).unwrap();
        let (mut worst_local, mut worst_world, mut same) = (0.0f32, 0.0f32, 0);
        for (i, (input, bytes)) in inputs.iter().zip(results.chunks_exact(48)).enumerate() {
            let got: [u32; 12] = bytemuck::pod_read_unaligned(bytes);
            let &[seed, x, y, sample, dimension, nx, ny, nz] = input;
            let sampler = Sampler { seed };
            let bits = sampler.get_2d([x, y], sample, dimension);
            assert_eq!([got[0], got[1]], bits, "{kind}: probe {i}, {input:?}");
            let choice = sampler.get_choice_2d([x, y], sample, dimension);
            assert_eq!([got[11], bits[1]], choice, "{kind}: choice of probe {i}, {input:?}");
            let u = sampler.get_2d_unit([x, y], sample, dimension);
            assert_eq!([got[2], got[3]], u.map(f32::to_bits), "{kind}: probe {i}");
            assert_eq!(got[7], 0, "{kind}: a ray that is none was occluded");
            let local = warp::cosine_hemisphere(u);
            let world = warp::to_world([nx, ny, nz].map(f32::from_bits), local);
            let worst = |a: [f32; 3], b: &[u32]| {
                // NaN must not pass for small
                a.iter().zip(b).fold(0.0f32, |w, (a, b)| {
                    let d = (a - f32::from_bits(*b)).abs();
                    if d <= w { w } else { d }
                })
            };
            worst_local = worst_local.max(worst(local, &got[4..7]));
            worst_world = worst_world.max(worst(world, &got[8..11]));
            assert!(
                worst(local, &got[4..7]) <= 1e-6 && worst(world, &got[8..11]) <= 1e-6,
                "{kind}: probe {i}, {input:?}"
            );
            same += (local.map(f32::to_bits) == got[4..7] && world.map(f32::to_bits) == got[8..11]) as u32;
        }
        println!(
            "{kind}: {count} points bit for bit; hemisphere within {worst_local:.1e}, in the world {worst_world:.1e}; {same} of them bit for bit, too"
        );
    }
    assert_validation_clean(&device);
}
