//! OpenEXR: one part, all channels with 32 bits, lossless.
//!
//! A layer is the prefix of a channel's name (`depth.Z`, `position.X`), as the format has it. Metadata entries are text
//! attributes called `skylit.KEY`. The same image gives the same bytes.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

use exr::block::lines::LineRefMut;
use exr::image::write::samples::{SamplesWriter, WritableSamples};
use exr::math::{RoundingMode, Vec2};
use exr::meta::attribute::{AttributeValue, LevelMode, LineOrder, SampleType, Text};
use exr::meta::{MetaData, header::Header};
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Layer, LayerAttributes, ReadChannels, ReadLayers,
    WritableImage,
};

use super::{Channel, Image, Samples, check_size};
use crate::error::{Error, Result};
use crate::files::write_atomically;

/// Prefix of the attributes that hold metadata.
const PREFIX: &str = "skylit.";

/// Writes an image with all its channels and metadata.
pub fn write(image: &Image, path: &Path) -> Result<()> {
    image.check()?;
    check_size(image.width, image.height)?;
    if let Some((key, _)) =
        image.metadata.iter().find(|(k, _)| k.is_empty() || k.len() + PREFIX.len() > 255 || k.contains('\0'))
    {
        return Err(Error::Usage(format!("metadata key {key:?} is empty, too long or holds a zero byte")));
    }
    write_atomically(path, |file| {
        encode(image, file)?;
        sort_attributes(file)
    })
}

fn encode(image: &Image, file: &mut File) -> io::Result<()> {
    let channels = image.channels.iter().map(|c| AnyChannel::new(text(&c.name), Borrowed(&c.samples))).collect();
    let software = text(concat!("skylit ", env!("CARGO_PKG_VERSION")));
    let mut attributes = LayerAttributes { software_name: Some(software), ..Default::default() };
    for (key, value) in &image.metadata {
        attributes.other.insert(text(&format!("{PREFIX}{key}")), AttributeValue::Text(text(value)));
    }
    // Blocks in order of their rows whichever thread finishes first: the same image gives the same bytes.
    let encoding = Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let size = (image.width as usize, image.height as usize);
    let layer = Layer::new(size, attributes, encoding, AnyChannels::sort(channels));
    let file_image = exr::image::Image::from_layer(layer);
    let mut out = BufWriter::with_capacity(1 << 18, file);
    file_image.write().to_buffered(&mut out).map_err(|e| match e {
        exr::error::Error::Io(e) => e,
        e => io::Error::other(e.to_string()),
    })?;
    out.flush()
}

/// Text of an EXR is bytes; UTF-8 goes through as it is.
fn text(s: &str) -> Text {
    Text::from_slice_unchecked(s.as_bytes())
}

fn string(t: &Text) -> String {
    String::from_utf8_lossy(t.as_slice()).into_owned()
}

/// Puts the attributes of the header, which the library writes in the order of a hash table, in the order of their names.
fn sort_attributes(file: &mut File) -> io::Result<()> {
    const MAGIC_AND_VERSION: u64 = 8;
    file.seek(SeekFrom::Start(MAGIC_AND_VERSION))?;
    let mut reader = BufReader::new(&mut *file);
    let mut attributes = Vec::new();
    loop {
        let mut attribute = Vec::new();
        let mut read_byte = |into: &mut Vec<u8>| -> io::Result<u8> {
            let mut byte = [0];
            reader.read_exact(&mut byte)?;
            into.push(byte[0]);
            Ok(byte[0])
        };
        // name and type end with a zero byte; an empty name ends the header
        while read_byte(&mut attribute)? != 0 {}
        if attribute.len() == 1 {
            break;
        }
        let name = attribute.len() - 1;
        while read_byte(&mut attribute)? != 0 {}
        let mut size = [0; 4];
        reader.read_exact(&mut size)?;
        attribute.extend(size);
        io::copy(&mut (&mut reader).take(u64::from(u32::from_le_bytes(size))), &mut attribute)?;
        attributes.push((name, attribute));
    }
    attributes.sort_by(|a, b| a.1[..a.0].cmp(&b.1[..b.0]));
    file.seek(SeekFrom::Start(MAGIC_AND_VERSION))?;
    file.write_all(&attributes.into_iter().flat_map(|a| a.1).collect::<Vec<_>>())
}

/// Lets the library read the samples where they lie: a copy of a large image would double its memory.
struct Borrowed<'a>(&'a Samples);

/// Copies parts of rows to the encoder.
struct RowWriter<'a> {
    samples: &'a Samples,
    width: usize,
}

impl<'s, 'a: 's> WritableSamples<'s> for Borrowed<'a> {
    type Writer = RowWriter<'s>;

    fn sample_type(&self) -> SampleType {
        match self.0 {
            Samples::F32(_) => SampleType::F32,
            Samples::U32(_) => SampleType::U32,
        }
    }

    fn infer_level_modes(&self) -> (LevelMode, RoundingMode) {
        (LevelMode::Singular, RoundingMode::Down)
    }

    fn create_samples_writer(&'s self, header: &Header) -> RowWriter<'s> {
        RowWriter { samples: self.0, width: header.layer_size.width() }
    }
}

impl SamplesWriter for RowWriter<'_> {
    fn extract_line(&self, line: LineRefMut<'_>) {
        let Vec2(x, y) = line.location.position;
        let start = y * self.width + x;
        let range = start..start + line.location.sample_count;
        // native byte order: the library converts
        let bytes: &[u8] = match self.samples {
            Samples::F32(s) => bytemuck::cast_slice(&s[range]),
            Samples::U32(s) => bytemuck::cast_slice(&s[range]),
        };
        line.value.copy_from_slice(bytes);
    }
}

/// Reads an EXR with all its channels (16-bit floats are converted to 32-bit ones) and its `skylit.` metadata, sorted by key. In a
/// file with several parts, a part's name becomes the prefix of its channels' names; all parts must have the same size.
pub fn read(path: &Path) -> Result<Image> {
    let broken = |e: exr::error::Error| match e {
        exr::error::Error::Io(e) => Error::read(path, &e),
        exr::error::Error::NotSupported(m) => Error::input(path, format!("an EXR of a kind that is not supported: {m}")),
        e => Error::input(path, format!("not a readable EXR: {e}")),
    };
    let open = || File::open(path).map_err(|e| Error::read(path, &e));
    // the header first: it says how much memory the rest will take
    let meta = MetaData::read_from_unbuffered(open()?, false).map_err(broken)?;
    for header in &meta.headers {
        let pixels = header.layer_size.0 as u128 * header.layer_size.1 as u128;
        if pixels == 0 || pixels > u128::from(super::MAX_PIXELS) {
            return Err(Error::input(path, format!("an image of {} x {} pixels", header.layer_size.0, header.layer_size.1)));
        }
    }
    let file = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_unbuffered(open()?)
        .map_err(broken)?;

    let mut image = Image::default();
    let parts = file.layer_data.len();
    for (i, layer) in file.layer_data.into_iter().enumerate() {
        let size = (layer.size.0 as u32, layer.size.1 as u32);
        if i == 0 {
            (image.width, image.height) = size;
        } else if size != (image.width, image.height) {
            return Err(Error::input(path, "its parts differ in size"));
        }
        let prefix = layer.attributes.layer_name.as_ref().filter(|_| parts > 1).map(|n| string(n) + ".").unwrap_or_default();
        for channel in layer.channel_data.list {
            let samples = match channel.sample_data {
                FlatSamples::F16(s) => Samples::F32(s.into_iter().map(|v| v.to_f32()).collect()),
                FlatSamples::F32(s) => Samples::F32(s),
                FlatSamples::U32(s) => Samples::U32(s),
            };
            image.channels.push(Channel { name: prefix.clone() + &string(&channel.name), samples });
        }
        for (key, value) in layer.attributes.other.iter().chain(&file.attributes.other) {
            if let (Some(key), AttributeValue::Text(value)) = (string(key).strip_prefix(PREFIX), value) {
                image.metadata.push((key.to_owned(), string(value)));
            }
        }
    }
    image.metadata.sort();
    image.metadata.dedup();
    image.check().map_err(|e| Error::input(path, e.to_string()))?;
    Ok(image)
}
