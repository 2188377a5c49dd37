//! Metadata of PNG files: text chunks (iTXt) called `skylit.KEY`, as attributes of an EXR are.

use std::io::{self, BufReader, BufWriter, Write};
use std::path::Path;

use super::Image;
use super::png::bytes_of;
use crate::error::{Error, Result};
use crate::files::{self, write_atomically};

/// Prefix of the keywords.
const PREFIX: &str = "skylit.";
const MAX_KEYWORD: usize = 79;

/// Writes the colour channels as 8-bit sRGB, and metadata. The same image gives the same bytes.
///
/// # Errors
/// [`Error::Usage`] for an image without colour or a key that is too long, [`Error::Output`].
pub fn write(image: &Image, path: &Path) -> Result<()> {
    let (bytes, colour) = bytes_of(image, 0.0, path)?;
    if let Some((key, _)) =
        image.metadata.iter().find(|(key, _)| key.is_empty() || PREFIX.len() + key.len() > MAX_KEYWORD)
    {
        return Err(Error::Usage(format!("metadata key {key:?} is empty or too long for a PNG")));
    }
    write_atomically(path, |file| {
        let mut out = BufWriter::new(file);
        let mut encoder = png::Encoder::new(&mut out, image.width, image.height);
        encoder.set_color(colour.png());
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        for (key, value) in &image.metadata {
            encoder.add_itxt_chunk(format!("{PREFIX}{key}"), value.clone()).map_err(io::Error::from)?;
        }
        let mut writer = encoder.write_header().map_err(io::Error::from)?;
        writer.write_image_data(&bytes).map_err(io::Error::from)?;
        writer.finish().map_err(io::Error::from)?;
        out.flush()
    })
}

/// Reads the metadata of a PNG, sorted by key; empty for one of another program.
pub fn read_metadata(path: &Path) -> Result<Vec<(String, String)>> {
    files::read_start(path)?;
    let file = files::open_regular(path).map_err(|e| Error::read(path, &e))?;
    let broken = |e: &dyn std::fmt::Display| Error::input(path, format!("not a readable PNG: {e}"));
    let reader = png::Decoder::new(BufReader::new(file)).read_info().map_err(|e| broken(&e))?;
    let mut metadata = Vec::new();
    for chunk in &reader.info().utf8_text {
        if let Some(key) = chunk.keyword.strip_prefix(PREFIX) {
            metadata.push((key.to_owned(), chunk.get_text().map_err(|e| broken(&e))?));
        }
    }
    metadata.sort();
    Ok(metadata)
}

#[cfg(test)]
mod tests {
    use super::super::{Channel, Samples, png};
    use super::*;

    #[test]
    fn metadata_comes_back_and_pixels_stay() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let plane = |name: &str, v: f32| Channel { name: name.into(), samples: Samples::F32(vec![v, 0.0, 0.5, 1.0]) };
        let metadata =
            [("driver", "Mesa 25 (LLVM)"), ("scene", "Größe.glb")].map(|(k, v)| (k.to_owned(), v.to_owned())).to_vec();
        let image =
            Image { width: 2, height: 2, channels: vec![plane("B", 0.1), plane("G", 0.7), plane("R", 0.2)], metadata };
        write(&image, &path).unwrap();
        assert_eq!(read_metadata(&path).unwrap(), image.metadata);
        let back = png::read(&path, &crate::memory::Budget::default()).unwrap();
        assert_eq!(bytes_of(&back, 0.0, &path).unwrap(), bytes_of(&image, 0.0, &path).unwrap());
        // one without metadata
        png::write(&image, &path, 0.0).unwrap();
        assert_eq!(read_metadata(&path).unwrap(), []);
        let long = Image { metadata: vec![("k".repeat(80), String::new())], ..image };
        assert!(write(&long, &path).unwrap_err().to_string().contains("too long"));
    }
}
