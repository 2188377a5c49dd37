//! Bent normals: device memory for them, which is there only where they are asked for.

use std::sync::Arc;

use super::params::FrameParams;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Device, Memory};

/// Three floats a pixel each.
pub(super) struct Bent {
    current: Buffer,
    histories: [Buffer; 2],
    /// Between the steps of a filter of several.
    between: Option<[Buffer; 2]>,
    /// Filtered.
    pub result: Buffer,
}

impl Bent {
    /// `steps`: of the filter.
    pub fn new(device: &Arc<Device>, pixels: u64, steps: usize) -> Result<Self> {
        let image = |name: &str| Buffer::new(device, name, 12 * pixels, Memory::Device);
        Ok(Self {
            current: image("directions of the frame")?,
            histories: [image("bent history")?, image("bent history")?],
            between: match steps {
                0 | 1 => None,
                _ => Some([image("filtered bent normals")?, image("filtered bent normals")?]),
            },
            result: image("bent normals")?,
        })
    }

    /// Its addresses, everything else 0. `history`: which of the two is this frame's.
    pub fn params(&self, history: usize) -> FrameParams {
        let between = |k: usize| self.between.as_ref().map_or(0, |b| b[k].address());
        FrameParams {
            current_bent: self.current.address(),
            previous_bent_history: self.histories[history ^ 1].address(),
            bent: [self.histories[history].address(), between(0), between(1), self.result.address()],
            ..Default::default()
        }
    }
}

pub(super) fn not_asked_for() -> Error {
    Error::Usage("bent normals are made only where the settings ask for them".into())
}
