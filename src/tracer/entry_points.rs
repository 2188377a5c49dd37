//! Entry points of camera rays: per bundle of 2x2 pixels a short list of blocks of the hierarchy,
//! at which the packet kernel starts instead of at the root (shaders/entry_points.glsl). A pass
//! writes the lists of a launch; they pay where a launch has several samples of each pixel, because
//! packets of one bundle visit the same upper levels again and again.

use super::{Push, Stream, Tracer};
use crate::error::Result;
use crate::gpu::{Buffer, ComputePipeline, Memory, Recorder};
use crate::interface::records::ao::{BUNDLE_BITS, ENTRY_LIST_BYTES};
use crate::shaders::{self, PACKET_RAYS};

/// The lists of a launch, and the pass that writes them.
pub struct EntryPoints {
    lists: Buffer,
    pass: ComputePipeline,
    // log2 of the least samples of a pixel in a launch for which a packet is within a bundle
    sample_bits: u32,
}

impl EntryPoints {
    /// Entry points for the camera rays of `stream`, at most `rays` in a launch and at most
    /// 2^`sample_bits` of a pixel. They are for rays that start at one point, as those of a
    /// perspective camera do. `None` where they do not apply: only the packet kernel has them, and
    /// packets must be within bundles. On GPUs they are not measured, and Mesa's CPU driver before
    /// version 23 loses hits.
    ///
    /// # Errors
    /// Those of the device.
    pub fn new(tracer: &Tracer, stream: &Stream, rays: u32, sample_bits: u32) -> Result<Option<Self>> {
        let device = tracer.device();
        let least = least_sample_bits(device.info.limits.subgroup_size);
        if !stream.traces_packets() || !device.info.is_cpu() || device.info.cuts_long_loops() || sample_bits < least {
            return Ok(None);
        }
        // a launch may begin and end within a bundle
        let bundles = u64::from(rays >> (least + BUNDLE_BITS)) + 2;
        Ok(Some(Self {
            lists: Buffer::new(device, "entry points", u64::from(ENTRY_LIST_BYTES) * bundles, Memory::Device)?,
            pass: tracer.entry_pass()?,
            sample_bits: least,
        }))
    }

    /// Device address of the lists, for `AoParams`.
    pub fn address(&self) -> u64 {
        self.lists.address()
    }

    /// Records the pass for a launch of camera rays. The shaders ignore the lists in launches of
    /// fewer samples. Commands before and after it need a barrier in between.
    pub fn record(&self, recorder: &mut Recorder, push: &Push) {
        if push.sample_bits >= self.sample_bits && push.count > 0 {
            let bundles = (push.count >> (push.sample_bits + BUNDLE_BITS)) + 2;
            recorder.timed("entry points", |r| r.dispatch(&self.pass, push, bundles.div_ceil(shaders::LANES)));
        }
    }
}

/// Log2 of the samples of a pixel that a packet of a subgroup needs to be within a bundle.
fn least_sample_bits(subgroup_size: u32) -> u32 {
    (subgroup_size * PACKET_RAYS).next_power_of_two().ilog2().saturating_sub(BUNDLE_BITS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_are_within_bundles() {
        assert_eq!([8, 16, 32, 64].map(least_sample_bits), [2, 3, 4, 5]);
        for size in [8, 16, 32, 64] {
            assert!((PACKET_RAYS * size) >> least_sample_bits(size) <= 1 << BUNDLE_BITS);
        }
    }
}
