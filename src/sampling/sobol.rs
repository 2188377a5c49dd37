//! Padded two-dimensional Owen-scrambled Sobol points, by hashing.
//!
//! After Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020: each pair of dimensions
//! is the same two-dimensional Sobol sequence, shuffled and scrambled by its own hash. The
//! permutation that stands in for a true random Owen scramble is that of Laine and Karras (2011)
//! with the constants of Vegdahl, "Building a Better LK Hash" (2021), which has far less
//! correlation between neighbouring seeds. The first `2^k` samples of any pixel and dimension are a
//! (0,k,2)-net in base 2.
//!
//! Everything is unsigned 32-bit arithmetic that wraps: GLSL `uint` gives the same bits
//! (`bitfieldReverse` is [`u32::reverse_bits`]).

pub use crate::interface::records::sampler::{
    AO_DIRECTION, CAMERA_FILM, CAMERA_LENS, PATH_FIRST, PATH_STRIDE, RAY_SEED,
};

/// A good 32-bit mixer: Wellons' `lowbias32` (<https://nullprogram.com/blog/2018/07/31/>). A
/// bijection with `hash(0) == 0`.
pub const fn hash(x: u32) -> u32 {
    let mut x = x;
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// A new seed from a seed and a value. A bijection in either argument while the other is fixed; the
/// order of a chain matters. The constant (2^32 / golden ratio) keeps `v = 0` from leaving the
/// hashed seed unmixed.
pub const fn hash_combine(seed: u32, v: u32) -> u32 {
    hash(seed ^ hash(v.wrapping_add(0x9e37_79b9)))
}

/// The permutation of Laine and Karras with Vegdahl's constants: each bit depends on itself and
/// lower bits only, so that in reversed bit order it acts as an Owen scramble.
pub const fn laine_karras_permutation(x: u32, seed: u32) -> u32 {
    let mut x = x;
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

/// Nested uniform (Owen) scramble in base 2: every bit is flipped depending on the bits above it.
pub const fn owen_scramble(x: u32, seed: u32) -> u32 {
    laine_karras_permutation(x.reverse_bits(), seed).reverse_bits()
}

/// Point `index` of the two-dimensional Sobol sequence (first two dimensions of Joe and Kuo 2008),
/// as 32-bit fractions.
///
/// The first dimension is van der Corput's sequence: the index with its bits reversed. The
/// generator matrix of the second is Pascal's triangle modulo 2: bit `j` of the *reversed* result
/// is the exclusive or of the index bits `k` whose binary digits contain those of `j` (Lucas'
/// theorem). That subset sum takes one butterfly step for each digit of `k`.
pub const fn sobol_2d(index: u32) -> [u32; 2] {
    let mut v = index;
    v ^= (v & 0xaaaa_aaaa) >> 1;
    v ^= (v & 0xcccc_cccc) >> 2;
    v ^= (v & 0xf0f0_f0f0) >> 4;
    v ^= (v & 0xff00_ff00) >> 8;
    v ^= (v & 0xffff_0000) >> 16;
    [index.reverse_bits(), v.reverse_bits()]
}

/// The upper 24 bits as a fraction in [0, 1), exactly representable.
pub fn to_unit(x: u32) -> f32 {
    (x >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Points for pixels. Two samplers with the same seed give the same points, whichever device runs
/// them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sampler {
    /// Seed of the whole image.
    pub seed: u32,
}

impl Sampler {
    /// Point `sample_index` of `pixel` in the dimension pair `dimension`, as 32-bit fractions.
    pub const fn get_2d(&self, pixel: [u32; 2], sample_index: u32, dimension: u32) -> [u32; 2] {
        let seed = hash_combine(hash_combine(hash_combine(self.seed, pixel[0]), pixel[1]), dimension);
        // the order of the points within each dimension pair is shuffled, so that pairs are
        // independent of each other
        let [x, y] = sobol_2d(owen_scramble(sample_index, seed));
        [owen_scramble(x, hash_combine(seed, 0)), owen_scramble(y, hash_combine(seed, 1))]
    }

    /// Returns a point of the same set, for a first number that chooses among many outcomes: it is
    /// scrambled by a digital shift alone, so that the first `2^k` points of any pixel and
    /// dimension have evenly spaced first numbers. An Owen scramble places each of them at random
    /// in its interval of `2^-k`: better for smooth functions, but where an interval holds several
    /// outcomes their choice is noise.
    pub const fn get_choice_2d(&self, pixel: [u32; 2], sample_index: u32, dimension: u32) -> [u32; 2] {
        let seed = hash_combine(hash_combine(hash_combine(self.seed, pixel[0]), pixel[1]), dimension);
        let [x, y] = sobol_2d(owen_scramble(sample_index, seed));
        [x ^ hash_combine(seed, 0), owen_scramble(y, hash_combine(seed, 1))]
    }

    /// [`Sampler::get_2d`] as fractions in [0, 1).
    pub fn get_2d_unit(&self, pixel: [u32; 2], sample_index: u32, dimension: u32) -> [f32; 2] {
        self.get_2d(pixel, sample_index, dimension).map(to_unit)
    }
}
