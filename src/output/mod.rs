//! Images in files: EXR with named float channels, PNG for looking. Files are written beside their target and renamed, so
//! that a run that is broken off leaves no half-written file.

/// Samples of one channel, rows from the top, `width * height` of them.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// 32-bit floats.
    F32(Vec<f32>),
    /// 32-bit unsigned integers (ids).
    U32(Vec<u32>),
}

/// A named channel of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name as EXR has it: `R`, `A`, `variance`, `depth.Z`, `position.X`, ...
    pub name: String,
    /// Its samples.
    pub samples: Samples,
}

/// An image with named channels, linear values, and text that says how it came to be.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Pixels in x.
    pub width: u32,
    /// Pixels in y.
    pub height: u32,
    /// Channels; the names are distinct.
    pub channels: Vec<Channel>,
    /// Key and value of each metadata entry (scene, camera, spp, tracer, device, version, ...).
    pub metadata: Vec<(String, String)>,
}

impl Image {
    /// The float samples of the channel called `name`.
    pub fn f32(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|c| c.name == name).and_then(|c| match &c.samples {
            Samples::F32(s) => Some(s.as_slice()),
            Samples::U32(_) => None,
        })
    }
}
