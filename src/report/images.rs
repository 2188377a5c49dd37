//! Images to compare, and how a page carries their pixels.

use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use rayon::prelude::*;
use serde::Serialize;

use crate::error::{Error, Result};

/// Two or more images of one size. A reader looks at them side by side, with a slider, or in turn,
/// at their differences and FLIP maps; reads values; zooms, moves and brightens all at once.
#[derive(Clone, Debug, Default)]
pub struct ImageComparison {
    pub size: [u32; 2],
    /// Channel names of every image. Three are red, green and blue; else the first is grey.
    pub channels: Vec<String>,
    pub images: Vec<ComparedImage>,
    /// Index of the image that the others are compared with.
    pub reference: usize,
    /// One entry a pixel: whether it counts. `None`: all do.
    pub mask: Option<Vec<bool>>,
}

#[derive(Clone, Debug, Default)]
pub struct ComparedImage {
    /// A short name: a file's, or an integrator's.
    pub name: String,
    /// More about it, a line; may be empty.
    pub description: String,
    /// Linear values, channels of a pixel side by side, rows from the top. The reader exposes them.
    pub values: Vec<f32>,
    /// FLIP of each pixel against the reference, 0 to 1, if it was computed.
    pub flip: Option<Vec<f32>>,
}

/// The part of an [`ImageComparison`] in the page itself; pixels are in a file of their own.
#[derive(Clone, Debug, Serialize)]
pub struct ImagesContext {
    /// Tells it apart on the page.
    key: String,
    /// The file of its pixels, relative to the page.
    source: String,
    size: [u32; 2],
    channels: Vec<String>,
    images: Vec<ImageContext>,
    reference: usize,
    has_mask: bool,
    has_flip: bool,
}

#[derive(Clone, Debug, Serialize)]
struct ImageContext {
    name: String,
    description: String,
    has_flip: bool,
}

/// Pixels as the page's script reads them.
#[derive(Debug, Serialize)]
pub struct PixelData {
    images: Vec<ImageData>,
    mask: Option<String>,
}

#[derive(Debug, Serialize)]
struct ImageData {
    values: String,
    flip: Option<String>,
}

impl ImageComparison {
    /// Do sizes and numbers agree? Otherwise a page would show the wrong values.
    fn check(&self) -> Result<()> {
        let wrong = |what: String| Err(Error::Usage(format!("the report cannot show images: {what}")));
        let pixels = self.size[0] as usize * self.size[1] as usize;
        let channels = self.channels.len();
        if pixels == 0 || channels == 0 {
            return wrong(format!("{}x{} pixels of {channels} channels", self.size[0], self.size[1]));
        }
        if self.reference >= self.images.len() {
            return wrong(format!(
                "there are {}, and the reference is number {}",
                self.images.len(),
                self.reference + 1
            ));
        }
        for image in &self.images {
            if image.values.len() != pixels * channels || image.flip.as_ref().is_some_and(|f| f.len() != pixels) {
                return wrong(format!("{} differs in size from the others", image.name));
            }
        }
        if self.mask.as_ref().is_some_and(|m| m.len() != pixels) {
            return wrong("the mask differs in size".to_owned());
        }
        Ok(())
    }

    /// The part of the page about the images, as number `index` of it.
    ///
    /// # Errors
    /// [`Error::Usage`] for images that differ in size.
    pub(super) fn context(&self, index: usize) -> Result<ImagesContext> {
        self.check()?;
        let images = self.images.iter();
        Ok(ImagesContext {
            key: format!("images-{}", index + 1),
            source: format!("data/images-{}.js", index + 1),
            size: self.size,
            channels: self.channels.clone(),
            images: images
                .map(|i| ImageContext {
                    name: i.name.clone(),
                    description: i.description.clone(),
                    has_flip: i.flip.is_some(),
                })
                .collect(),
            reference: self.reference,
            has_mask: self.mask.is_some(),
            has_flip: self.images.iter().any(|i| i.flip.is_some()),
        })
    }

    /// The pixels, encoded.
    pub(super) fn data(&self) -> Result<PixelData> {
        let channels = self.channels.len();
        let images = self.images.par_iter().map(|i| {
            Ok(ImageData {
                values: encode(&i.values, channels)?,
                flip: i.flip.as_ref().map(|f| encode(f, 1)).transpose()?,
            })
        });
        let mask = self.mask.as_ref().map(|m| compress(&m.iter().map(|&counts| u8::from(counts)).collect::<Vec<_>>()));
        Ok(PixelData { images: images.collect::<Result<_>>()?, mask: mask.transpose()? })
    }
}

impl ImagesContext {
    /// Tells it apart on the page.
    pub(super) fn key(&self) -> &str {
        &self.key
    }

    /// The file of its pixels, relative to the page.
    pub(super) fn source(&self) -> &str {
        &self.source
    }
}

/// Interleaved floats without loss: channel after channel, and of each the least significant bytes
/// of all values before the next ones, which compresses better than values as they lie in memory.
fn encode(values: &[f32], channels: usize) -> Result<String> {
    let planar: Vec<[u8; 4]> =
        (0..channels).flat_map(|c| values.iter().skip(c).step_by(channels)).map(|v| v.to_le_bytes()).collect();
    let bytes: Vec<u8> = (0..4).flat_map(|k| planar.iter().map(move |v| v[k])).collect();
    compress(&bytes)
}

/// Bytes as text: zlib, then base64.
fn compress(bytes: &[u8]) -> Result<String> {
    let failed = |e: std::io::Error| Error::CheckFailed(format!("cannot compress the pixels of the report: {e}"));
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).map_err(failed)?;
    Ok(STANDARD.encode(encoder.finish().map_err(failed)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Read;

    fn decode(text: &str) -> Vec<u8> {
        let mut bytes = Vec::new();
        flate2::read::ZlibDecoder::new(&STANDARD.decode(text).unwrap()[..]).read_to_end(&mut bytes).unwrap();
        bytes
    }

    #[test]
    fn all_bits_of_values_are_kept() {
        let values: Vec<f32> = (0..12).map(|k| f32::from_bits(0x3f12_3456u32.rotate_left(k) ^ k)).collect();
        let bytes = decode(&encode(&values, 3).unwrap());
        let back = |k: usize| f32::from_le_bytes([0, 1, 2, 3].map(|b| bytes[b * 12 + k]));
        for (k, value) in values.iter().enumerate() {
            assert_eq!(back(k % 3 * 4 + k / 3).to_bits(), value.to_bits(), "{k}");
        }
    }

    #[test]
    fn images_that_do_not_fit_together_are_refused() {
        let image = |n: usize| ComparedImage { name: format!("of {n}"), values: vec![0.5; n], ..Default::default() };
        let of = |images: Vec<ComparedImage>| ImageComparison {
            size: [2, 2],
            channels: vec!["Y".into()],
            images,
            mask: Some(vec![true, false, true, true]),
            ..Default::default()
        };
        let good = of(vec![image(4), image(4)]);
        assert_eq!(good.context(4).unwrap().source(), "data/images-5.js");
        assert_eq!(decode(good.data().unwrap().mask.as_deref().unwrap()), [1, 0, 1, 1]);
        assert!(of(vec![image(4), image(5)]).context(0).unwrap_err().to_string().contains("of 5"));
        assert!(of(Vec::new()).context(0).is_err());
        assert!(ImageComparison { channels: Vec::new(), ..of(vec![image(0)]) }.context(0).is_err());
        assert!(ImageComparison { channels: vec!["A".into(), "B".into()], ..of(vec![image(8)]) }.context(0).is_ok());
    }
}
