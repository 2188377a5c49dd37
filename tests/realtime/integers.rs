//! Whole numbers on the device: quotients, conversions and texels without what CPU drivers do lane by lane, against the host's.

use skylit::interface::Wrap;
use skylit::sampling::sobol::hash_combine;
use skylit::shaders;

use crate::common::{assert_validation_clean, device};
use crate::probe;

const MODES: [Wrap; 3] = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];

fn wrapped(i: i32, n: i32, mode: Wrap) -> i32 {
    match mode {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::Mirror => match i.rem_euclid(2 * n) {
            m if m < n => m,
            m => 2 * n - 1 - m,
        },
        Wrap::Clamp => i.clamp(0, n - 1),
    }
}

#[test]
fn gpu_whole_numbers_are_the_hosts() {
    let device = device();
    let random = |i: u32, k: u32| hash_combine(hash_combine(17, i), k);
    let mut divisions: Vec<[u32; 2]> = Vec::new();
    for divisor in [1, 2, 3, 5, 7, 8, 10, 97, 160, 240, 256, 1000, 1920, 2048, 4095, 16383, 16384, 65535] {
        // around multiples, where a rounded quotient is wrong first: the smallest, the largest, and some between
        let most = (i32::MAX as u32 / divisor).min((1 << 21) - 1);
        for quotient in [0, 1, 2, 3, 1000, most / 3, most / 2, most - 1, most]
            .into_iter()
            .chain((0..40).map(|k| random(k, divisor) % most))
        {
            for off in [-1i64, 0, 1] {
                let dividend = i64::from(quotient) * i64::from(divisor) + off;
                if (0..=i64::from(i32::MAX)).contains(&dividend) && dividend / i64::from(divisor) < 1 << 21 {
                    divisions.push([dividend as u32, divisor]);
                }
            }
        }
    }
    divisions.extend((0..20_000).map(|i| {
        let divisor = 1 + (random(i, 0) >> (16 + random(i, 1) % 16));
        let most = (u64::from(divisor) << 21).min(1 << 31) as u32;
        [random(i, 2) % most, divisor]
    }));
    let count = divisions.len() as u32;
    let large = (1 << 22) as f32;
    let special = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        large,
        -large,
        large - 1.0,
        f32::NAN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        1e30,
        large + 1.0,
    ];
    let inputs: Vec<[u32; 8]> = (0..count)
        .map(|i| {
            let [dividend, divisor] = divisions[i as usize];
            let whole =
                special.get(i as usize).copied().unwrap_or((random(i, 3) as i32 >> (9 + random(i, 4) % 20)) as f32);
            let size = 1 + (random(i, 5) >> (18 + random(i, 6) % 14));
            let texel = -1 + (random(i, 7) % (2 * size + 3)) as i32;
            [dividend, divisor, whole.to_bits(), 0, texel as u32, size, MODES[random(i, 8) as usize % 3] as u32, 0]
        })
        .collect();
    let got = probe(&device, &shaders::probes::INTEGERS_PROBE, &inputs);
    for (input, got) in inputs.iter().zip(&got) {
        let &[dividend, divisor, whole, _, texel, size, mode, _] = input;
        let x = f32::from_bits(whole);
        let converted = if x.abs() <= large { x as i32 } else { 0 };
        let mode = MODES.into_iter().find(|m| *m as u32 == mode).unwrap();
        let expected =
            [dividend % divisor, dividend / divisor, converted as u32, wrapped(texel as i32, size as i32, mode) as u32];
        assert_eq!(got, &expected, "{dividend} / {divisor}, {x}, texel {} of {size}, mode {mode:?}", texel as i32);
    }
    assert_validation_clean(&device);
}
