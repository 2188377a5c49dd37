//! Pixels whose surface was not seen in the previous image, which a camera or object in motion
//! uncovers. They have more paths ([`Counts::listed_bits`]) in the launch of all pixels. The pass
//! `surfaces` lists them, and `paths` reads the list.

use std::sync::Arc;

use crate::error::Result;
use crate::film::block::Block;
use crate::gpu::{Buffer, Device, Memory, Recorder};
use crate::interface::records::radiance::{LIST_PART, SurfacesParams};
use crate::realtime::graph::Frame;
use crate::tracer::stream::UNCOVERED_SHARE;

/// Log2 of the number of paths that uncovered pixels have besides, where there are few.
const MAX_BITS: u32 = 2;

/// A list of uncovered pixels.
pub struct Uncovered {
    sampled: Block,
    /// Their number, a part of the number of pixels that show a surface, and each.
    list: Buffer,
    counts: Buffer,
}

/// Numbers of pixels of a frame.
#[derive(Clone, Copy, Default)]
pub struct Counts {
    /// Pixels that it uncovers.
    pub uncovered: u32,
    /// Pixels that show a surface, about.
    pub surfaces: u32,
}

/// Maximum number of paths of uncovered pixels besides, in frames of `samples` of each pixel.
pub fn most_paths(pixels: u32, samples: u32) -> u32 {
    pixels.saturating_mul(samples) / UNCOVERED_SHARE
}

impl Uncovered {
    /// Creates the list for the pixels that are sampled in a frame.
    ///
    /// # Errors
    /// Those of the device.
    pub fn new(device: &Arc<Device>, sampled: Block) -> Result<Self> {
        Ok(Self {
            sampled,
            list: Buffer::new(device, "uncovered pixels", 4 * (2 + u64::from(sampled.rays())), Memory::Device)?,
            counts: Buffer::new(device, "number of uncovered pixels", 8, Memory::Readback)?,
        })
    }

    /// Whether a frame lists uncovered pixels: in motion, after a previous image.
    pub fn are_listed(frame: &Frame) -> bool {
        frame.plan.has_moved && frame.plan.has_resolved
    }

    /// Device address of the list: where each pixel is among those that are sampled.
    pub fn address(&self) -> u64 {
        self.list.address() + 8
    }

    /// The outputs of the pass that lists them in a frame.
    pub fn outputs(&self, frame: &Frame) -> SurfacesParams {
        let list = if Self::are_listed(frame) { self.list.address() } else { 0 };
        SurfacesParams { list, tiles_x: self.sampled.tiles_x(), ..Default::default() }
    }

    /// Empties the list.
    pub fn clear(&self, r: &mut Recorder) {
        r.fill(&self.list, 8, 0);
    }

    /// Hands the numbers of pixels to the host.
    pub fn copy_counts(&self, r: &mut Recorder) {
        r.copy(&self.list, 0, &self.counts, 0, 8);
    }

    /// The numbers of pixels, after a submission with [`Uncovered::copy_counts`].
    ///
    /// # Errors
    /// Those of the device.
    pub fn counts(&self) -> Result<Counts> {
        let [uncovered, surfaces]: [u32; 2] = bytemuck::pod_read_unaligned(&self.counts.read(0, 8)?);
        Ok(Counts { uncovered, surfaces: surfaces * LIST_PART })
    }
}

impl Counts {
    /// Log2 of how often each uncovered pixel is in a launch besides, where a pixel has `1 <<
    /// sample_bits` paths and there is `room` for more paths. `None`: there are none, or too many.
    pub fn listed_bits(self, sample_bits: u32, room: u32) -> Option<u32> {
        let all = |bits: u32| u64::from(self.uncovered) << bits;
        let fits = |bits: &u32| {
            all(*bits) <= u64::from(self.surfaces / UNCOVERED_SHARE) && all(bits + sample_bits) <= u64::from(room)
        };
        (0..=MAX_BITS.saturating_sub(sample_bits)).rev().find(fits).filter(|_| self.uncovered > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uncovered_pixels_have_few_of_all_paths() {
        let bits = |uncovered, sample_bits, room| Counts { uncovered, surfaces: 3200 }.listed_bits(sample_bits, room);
        let room = most_paths(3200, 1);
        let expected = [None, Some(2), Some(2), Some(1), Some(1), Some(0), Some(0), None];
        assert_eq!([0, 1, 100, 101, 200, 201, 400, 401].map(|n| bits(n, 0, room)), expected);
        // of four paths each
        let room = most_paths(3200, 4);
        assert_eq!([1, 400, 401].map(|n| bits(n, 2, room)), [Some(0), Some(0), None]);
        assert_eq!([100, 101].map(|n| bits(n, 2, 400)), [Some(0), None]);
    }
}
