//! Images of the last frame, read back from the device.

use super::Realtime;
use super::passes::display::bent_normals_disabled;
use super::resources::{Resource, SURFACE_BYTES};
use crate::error::Result;
use crate::interface::records::denoise::RadianceRecord;
use crate::interface::records::frame::MAX_VARIANCE;

/// The surface point at a pixel's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Position, relative to the scene's origin.
    pub position: [f32; 3],
    /// Position of the same point before the scene's last update.
    pub before: [f32; 3],
}

impl Realtime {
    /// Reads the last frame, rows from the top: ambient visibility of each pixel, 0 for background,
    /// or linear radiance, red, green and blue. At edges it is the mean over the surfaces.
    pub fn result(&self) -> Result<Vec<f32>> {
        let channels = self.channels();
        match self.resolved()? {
            Some(resolved) => Ok(resolved.iter().flat_map(|q| &q[..channels]).copied().collect()),
            None => self.read(Resource::Result),
        }
    }

    /// Reads the final image with coverage, if there is one besides that of the filter.
    fn resolved(&self) -> Result<Option<Vec<[f32; 4]>>> {
        let resolved: Vec<[f32; 4]> = self.read(Resource::Resolved)?;
        Ok((!resolved.is_empty()).then_some(resolved))
    }

    /// Reads the input of the last frame's spatial filter, rows from the top; 0 for background and
    /// for pixels without a sample yet. Of radiance it is diffuse reflection divided by the albedo,
    /// the mean of its channels; with Larsen's pipeline the result.
    pub fn unfiltered(&self) -> Result<Vec<f32>> {
        if !self.signal.has_pixel_histories() {
            return self.result();
        }
        Ok(self.estimates()?.into_iter().map(|e| e[0]).collect())
    }

    /// Reads the number of samples accumulated in each pixel of the last frame.
    pub fn samples(&self) -> Result<Vec<f32>> {
        Ok(self.estimates()?.into_iter().map(|e| e[1]).collect())
    }

    /// Reads the variance of each pixel's mean before any spatial filter; 0 for background.
    pub fn variances(&self) -> Result<Vec<f32>> {
        Ok(self.estimates()?.into_iter().map(|[_, samples, variance]| variance / samples.max(1.0)).collect())
    }

    /// Reads the bent normal of each pixel of the last frame, rows from the top: the mean over the
    /// cosine-weighted hemisphere of ambient visibility times direction, world space. Its length is
    /// two thirds on an unoccluded plane, and 0 if everything is occluded. Divided by
    /// [`Realtime::result`] it is the mean unoccluded direction. 0 for background.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] without [`super::Settings::bent`], and those of the device.
    pub fn bent(&self) -> Result<Vec<[f32; 3]>> {
        if !self.settings.bent {
            return Err(bent_normals_disabled());
        }
        self.read(Resource::BentResult)
    }

    /// Reads back a resource, one record per pixel.
    fn read<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(&self, resource: Resource) -> Result<Vec<T>> {
        self.graph.resources().read(resource, self.pixels())
    }

    /// Reads mean, number of samples and variance of one sample of each pixel.
    fn estimates(&self) -> Result<Vec<[f32; 3]>> {
        if self.signal.depends_on_light() {
            let history: Vec<RadianceRecord> = self.read(Resource::DiffuseHistory)?;
            let mean = |c: [f32; 3]| c.iter().sum::<f32>() / 3.0;
            return Ok(history.iter().map(|h| [mean(h.mean), h.samples, mean(h.variance)]).collect());
        }
        let mut history: Vec<[u32; 2]> = self.read(Resource::History)?;
        // Larsen's pipeline has none
        history.resize(self.pixels() as usize, [0; 2]);
        // as shaders pack it (`pack_estimate`)
        let unpack = |[mean, packed]: &[u32; 2]| {
            let variance = (packed & 0xffff) as f32 * (MAX_VARIANCE / 65535.0);
            [f32::from_bits(*mean), (packed >> 16) as f32 / 16.0, variance]
        };
        Ok(history.iter().map(unpack).collect())
    }

    /// Reads the coverage of the last frame, rows from the top: the fraction of each pixel that
    /// shows the scene. Without antialiasing: 1 where its centre does, else 0.
    pub fn coverage(&self) -> Result<Vec<f32>> {
        match self.resolved()? {
            Some(resolved) => Ok(resolved.iter().map(|q| q[3]).collect()),
            None => self.sampled(),
        }
    }

    /// Reads 1 where the sample of a pixel shows the scene, else 0; rows from the top.
    fn sampled(&self) -> Result<Vec<f32>> {
        let guide: Vec<[f32; 2]> = self.read(Resource::Guide)?;
        Ok(guide.iter().map(|g| if g[0] < f32::INFINITY { 1.0 } else { 0.0 }).collect())
    }

    /// Reads the surface point of each pixel, rows from the top; `None` for background.
    pub fn surfaces(&self) -> Result<Vec<Option<Surface>>> {
        const WORDS: usize = SURFACE_BYTES as usize / 4;
        let now: Vec<[f32; WORDS]> = self.read(Resource::Surface)?;
        let before: Vec<[f32; 3]> = self.read(Resource::PreviousPosition)?;
        let covered = self.sampled()?;
        let surface = |(k, covered): (usize, &f32)| {
            let position = [now[k][0], now[k][1], now[k][2]];
            let before = before.get(k).copied().unwrap_or(position);
            (*covered > 0.0).then_some(Surface { position, before })
        };
        Ok(covered.iter().enumerate().map(surface).collect())
    }
}
