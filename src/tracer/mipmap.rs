//! Mip levels of textures, for footprints wider than a texel: made on the host, and only when
//! required.

use std::ops::Range;

use glam::Vec4;
use rayon::prelude::*;

use crate::interface::Texels;
use crate::interface::records::scene::{MAX_LEVELS, MipRecord};
use crate::scene::{TexelData, Texture};

/// The mip record of a texture of this size, without addresses.
pub(super) fn record(size: [u32; 2]) -> MipRecord {
    let mut record = MipRecord::default();
    let mut texels = 0;
    for (k, size) in levels(size).enumerate() {
        record.first[k] = texels;
        record.last = k as u32 + 1;
        texels += size[0] * size[1];
    }
    record
}

/// Sizes of the levels from level 1 on: each half of the one before, rounded down, to one texel.
fn levels(size: [u32; 2]) -> impl Iterator<Item = [u32; 2]> {
    let halves = std::iter::successors(Some(size), |s| (*s != [1, 1]).then(|| s.map(|n| (n / 2).max(1))));
    halves.skip(1).take(MAX_LEVELS as usize)
}

/// All levels from 1 on as they lie in device memory, one after the other, rows from the top: four
/// numbers of 16 bits a texel, to 2^-17, or four floats where the texture has more than 8 bits
/// itself.
pub(super) fn pyramid(texture: &Texture, texels: Texels) -> Vec<u8> {
    let levels = means(texture, texels);
    match texture.texels {
        TexelData::Unorm8(_) => bytemuck::pod_collect_to_vec(&levels.iter().map(unorm16).collect::<Vec<_>>()),
        _ => bytemuck::pod_collect_to_vec(&levels),
    }
}

fn unorm16(texel: &Vec4) -> [u16; 4] {
    texel.to_array().map(|c| (c.clamp(0.0, 1.0) * 65535.0).round() as u16)
}

/// The texels of all levels from 1 on, each the mean of the texels that it covers in the level
/// before.
fn means(texture: &Texture, texels: Texels) -> Vec<Vec4> {
    let texel = |i: usize| {
        let c = Vec4::from_array(if texels == Texels::Linear {
            texture.texels.get(i)
        } else {
            texture.texels.decode_srgb(i)
        });
        if texels == Texels::Covered { (c.truncate() * c.w).extend(c.w) } else { c }
    };
    let mut out = Vec::new();
    let mut before = [texture.width, texture.height];
    let mut means: Vec<Vec4> = Vec::new();
    for size in levels(before) {
        means = if means.is_empty() { reduced(before, size, texel) } else { reduced(before, size, |i| means[i]) };
        out.extend_from_slice(&means);
        before = size;
    }
    out
}

/// Means of a smaller image's texels over what they cover, with texels that are covered in part
/// counted in part.
fn reduced(from: [u32; 2], to: [u32; 2], texel: impl Fn(usize) -> Vec4 + Sync) -> Vec<Vec4> {
    let [columns, rows] = [0, 1].map(|k| (0..to[k]).map(|i| Taps::new(i, from[k], to[k])).collect::<Vec<_>>());
    let mut out = vec![Vec4::ZERO; rows.len() * columns.len()];
    out.par_chunks_mut(columns.len()).zip(&rows).for_each(|(line, row)| {
        for (mean, column) in line.iter_mut().zip(&columns) {
            for (y, v) in row.texels.clone().zip(row.weights) {
                let along = |(x, u): (usize, f32)| u * texel(y * from[0] as usize + x);
                *mean += v * column.texels.clone().zip(column.weights).map(along).sum::<Vec4>();
            }
        }
    });
    out
}

/// The texels of a row that a texel of the next level covers, with their weights.
struct Taps {
    texels: Range<usize>,
    weights: [f32; 3],
}

impl Taps {
    fn new(i: u32, from: u32, to: u32) -> Self {
        let (i, from, to) = (u64::from(i), u64::from(from), u64::from(to));
        // in units in which a texel of the longer row has length `to`, of the shorter row `from`
        let (begin, end) = (i * from, (i + 1) * from);
        let texels = begin / to..end.div_ceil(to);
        let mut weights = [0.0; 3];
        // `from` is at most 2 * to + 1, so a texel covers at most three
        for (weight, x) in weights.iter_mut().zip(texels.clone()) {
            *weight = (end.min((x + 1) * to) - begin.max(x * to)) as f32 / from as f32;
        }
        Self { texels: texels.start as usize..texels.end as usize, weights }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::srgb_decode;
    use crate::scene::{Filter, Wrap};

    fn pyramid(texture: &Texture, texels: Texels) -> Vec<[u16; 4]> {
        bytemuck::pod_collect_to_vec(&super::pyramid(texture, texels))
    }

    fn texture(width: u32, height: u32, rgba8: Vec<u8>) -> Texture {
        let (wrap, filter) = ([Wrap::Repeat; 2], Filter::Linear);
        Texture { name: String::new(), width, height, texels: rgba8.into(), wrap, filter }
    }

    fn channel(texels: &[[u16; 4]], c: usize) -> Vec<f64> {
        texels.iter().map(|t| f64::from(t[c]) / 65535.0).collect()
    }

    fn mean(values: &[f64]) -> f64 {
        values.iter().sum::<f64>() / values.len() as f64
    }

    #[test]
    fn five_texels_become_two_that_share_the_middle_one() {
        let t = texture(5, 1, [10, 20, 30, 40, 50].into_iter().flat_map(|v| [v, 0, 0, 255]).collect());
        let levels = channel(&pyramid(&t, Texels::Linear), 0);
        let expected = [(10.0 + 20.0 + 15.0) / 2.5, (15.0 + 40.0 + 50.0) / 2.5, 30.0].map(|v| v / 255.0);
        assert_eq!(levels.len(), 3);
        for (found, expected) in levels.iter().zip(expected) {
            assert!((found - expected).abs() < 8e-6, "{found}, expected {expected}");
        }
    }

    #[test]
    fn every_level_has_the_mean_of_the_texture() {
        for [width, height] in [[1, 1], [2, 1], [3, 3], [7, 5], [1, 9], [64, 64], [63, 31], [100, 37]] {
            let mut state = 1u32;
            let mut random = || {
                state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
                (state >> 24) as u8
            };
            let t = texture(width, height, (0..4 * width * height).map(|_| random()).collect());
            let record = super::record([width, height]);
            for texels in Texels::ALL {
                let levels = pyramid(&t, texels);
                let value = |c: usize| {
                    let texel = |p: [f32; 4]| {
                        let v = f64::from(p[c]);
                        let linear =
                            if c == 3 || texels == Texels::Linear { v } else { f64::from(srgb_decode(v as f32)) };
                        if texels == Texels::Covered && c < 3 { linear * f64::from(p[3]) } else { linear }
                    };
                    mean(&t.texels.iter().map(texel).collect::<Vec<_>>())
                };
                let ends =
                    record.first[..record.last as usize].iter().skip(1).map(|&n| n as usize).chain([levels.len()]);
                for (&first, end) in record.first[..record.last as usize].iter().zip(ends) {
                    for c in 0..4 {
                        let found = mean(&channel(&levels[first as usize..end], c));
                        assert!(
                            (found - value(c)).abs() < 1e-5,
                            "{width}x{height}, {texels:?}: {found}, expected {}",
                            value(c)
                        );
                    }
                }
                assert_eq!(levels.is_empty(), [width, height] == [1, 1]);
            }
        }
    }

    #[test]
    fn light_is_averaged_and_not_its_code() {
        let t = texture(2, 1, vec![255, 255, 255, 255, 0, 0, 0, 0]);
        assert_eq!(pyramid(&t, Texels::Srgb), [[32768, 32768, 32768, 32768]]);
        // the black half is not there: what is there is white
        assert_eq!(pyramid(&t, Texels::Covered), [[32768, 32768, 32768, 32768]]);
        let t = texture(2, 1, vec![188, 188, 188, 255, 188, 188, 188, 255]);
        let linear = (f64::from(srgb_decode(188.0 / 255.0)) * 65535.0).round() as u16;
        assert_eq!(pyramid(&t, Texels::Srgb), [[linear, linear, linear, 65535]]);
    }
}
