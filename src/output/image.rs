//! An image in memory: named channels and metadata.

use crate::error::{Error, Result};

/// Samples of one channel, rows from the top, `width * height` of them.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// 32-bit floats.
    F32(Vec<f32>),
    /// 32-bit unsigned integers (ids).
    U32(Vec<u32>),
}

impl Samples {
    pub fn len(&self) -> usize {
        match self {
            Samples::F32(s) => s.len(),
            Samples::U32(s) => s.len(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Name as EXR has it: `R`, `A`, `variance`, `depth.Z`, `position.X`, ...
    pub name: String,
    pub samples: Samples,
}

impl Channel {
    /// A channel of floats.
    pub fn from_floats(name: impl Into<String>, samples: Vec<f32>) -> Self {
        Self { name: name.into(), samples: Samples::F32(samples) }
    }
}

/// An image with named channels, linear values, and text metadata on how it was rendered.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    pub width: u32,
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

    pub fn pixel_count(&self) -> usize {
        self.width as usize * self.height as usize
    }

    pub fn metadata(&self, key: &str) -> Option<&str> {
        self.metadata.iter().find(|(k, _)| k == key).map(|(_, v)| v.as_str())
    }

    /// Fails unless every channel has a sample for each pixel, and a name of its own. Writers rely
    /// on it.
    pub(super) fn check(&self) -> Result<()> {
        let bad = |what: String| Err(Error::Usage(what));
        if self.pixel_count() == 0 || self.channels.is_empty() {
            return bad(format!(
                "an image of {} x {} pixels and {} channels",
                self.width,
                self.height,
                self.channels.len()
            ));
        }
        for (i, c) in self.channels.iter().enumerate() {
            if c.samples.len() != self.pixel_count() {
                return bad(format!(
                    "channel {:?} has {} samples for {} pixels",
                    c.name,
                    c.samples.len(),
                    self.pixel_count()
                ));
            }
            // 255 is the limit of the EXR format
            if c.name.is_empty() || c.name.len() > 255 || self.channels[..i].iter().any(|d| d.name == c.name) {
                return bad(format!("channel name {:?} is empty, too long or used twice", c.name));
            }
        }
        Ok(())
    }
}
