//! Sequences on the device.

use skylit::sampling::Sequence;
use skylit::sampling::sobol::hash_combine;
use skylit::shaders;

use crate::common::{assert_validation_clean, device};
use crate::probe;

#[test]
fn gpu_sequences_are_the_hosts_bit_for_bit() {
    let device = device();
    let random = |i: u32, k: u32| hash_combine(hash_combine(11, i), k);
    let mut inputs: Vec<[u32; 8]> = Vec::new();
    for s in Sequence::ALL {
        // as in images: a few pixels, every frame of two histories
        for pixel in [[0, 0], [1, 0], [0, 1], [639, 359], [1919, 1079], [16383, 16383]] {
            for frame in 0..80 {
                for (index, count) in [(0, 1), (0, 3), (2, 3), (63, 64), (999, 1000)] {
                    inputs.push([s as u32, 0, pixel[0], pixel[1], frame, index, count, 0]);
                }
            }
        }
        // and all bits of everything: what wraps, wraps alike
        for i in 0..4000 {
            let [seed, x, y, frame, index, count] = [0, 1, 2, 3, 4, 5].map(|k| random(i, k));
            inputs.push([s as u32, seed, x, y, frame, index, count, 0]);
        }
    }
    let got = probe(&device, &shaders::probes::SEQUENCE_PROBE, &inputs);
    for (input, got) in inputs.iter().zip(&got) {
        let &[s, seed, x, y, frame, index, count, _] = input;
        let s = Sequence::ALL[s as usize];
        let [a, b] = s.get_2d(seed, [x, y], frame, index, count);
        let [u, v] = s.get_2d_unit(seed, [x, y], frame, index, count).map(f32::to_bits);
        assert_eq!(got, &[a, b, u, v], "{s:?}: {input:?}");
    }
    assert_validation_clean(&device);
}
