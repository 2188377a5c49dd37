//! Morton order, the same as shaders/common/morton.glsl.

/// Interleaves the lower 16 bits of the coordinates: pixels of aligned squares of 2^k follow each
/// other.
pub fn morton(pixel: [u32; 2]) -> u32 {
    let spread = |x: u32| {
        let x = x & 0xffff;
        let x = (x | x << 8) & 0x00ff_00ff;
        let x = (x | x << 4) & 0x0f0f_0f0f;
        let x = (x | x << 2) & 0x3333_3333;
        (x | x << 1) & 0x5555_5555
    };
    spread(pixel[0]) | spread(pixel[1]) << 1
}

/// Pixel `k` of a tile of 8x8, the inverse of [`morton`] there.
pub fn morton_pixel(k: u32) -> [u32; 2] {
    [(k & 1) | (k >> 1 & 2) | (k >> 2 & 4), (k >> 1 & 1) | (k >> 2 & 2) | (k >> 3 & 4)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn morton_keeps_squares_together() {
        assert_eq!([[0, 0], [1, 0], [0, 1], [1, 1], [2, 0]].map(morton), [0, 1, 2, 3, 4]);
        assert_eq!(morton([0xffff, 0xffff]), u32::MAX);
        assert!((0..64).all(|k| morton(morton_pixel(k)) == k));
    }
}
