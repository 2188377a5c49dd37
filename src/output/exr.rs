//! OpenEXR: one part, all channels with 32 bits and lossless unless [`ExrOptions`] say otherwise.
//!
//! A layer is the prefix of a channel's name (`depth.Z`, `position.X`). Metadata entries are text
//! attributes called `skylit.KEY`, but [`WORLD_TO_CAMERA`] and [`WORLD_TO_NDC`], the standard's
//! matrices. A grey image has its channel `Y` also as `R`, `G` and `B`, for programs that look for
//! these alone; [`read`] drops the copies. The same image gives the same bytes.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Cursor, Read, Seek, SeekFrom, Write};
use std::path::Path;

use exr::block::chunk::CompressedBlock;
use exr::block::lines::LineRefMut;
use exr::image::write::samples::{SamplesWriter, WritableSamples};
use exr::math::{RoundingMode, Vec2};
use exr::meta::attribute::{
    AttributeValue, ChannelDescription, Chromaticities, IntegerBounds, LevelMode, LineOrder, Matrix4x4, SampleType,
    Text,
};
use exr::meta::{MetaData, header::Header};
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Layer, LayerAttributes, ReadChannels,
    ReadLayers, WritableImage, f16,
};

use super::decode::ENDS_EARLY;
use super::settings::{ExrCompression, FileSettings};
use super::{Channel, Image, Samples, check_size};
use crate::error::{Error, Result};
use crate::files::{self, write_atomically};
use crate::memory::Budget;

/// First bytes of a file.
pub const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
/// Metadata key of the display window's upper left corner, `x,y`, from which pixels are counted.
pub const DISPLAY_ORIGIN: &str = "displayWindow.origin";
/// Maximum bytes of pixels outside of the data window: a header alone must not decide how many.
const MAX_PADDING: u64 = 2 << 30;
/// Prefix of the attributes that hold metadata.
const PREFIX: &str = "skylit.";
/// Metadata key of the matrix from world to camera space (x right, y up, looking along -z).
pub const WORLD_TO_CAMERA: &str = "worldToCamera";
/// Metadata key of the matrix from world space to normalized device coordinates, y up.
pub const WORLD_TO_NDC: &str = "worldToNDC";
/// Samples of each pixel; unsigned integers in files of earlier versions.
const SAMPLES: &str = "samples";

/// How an EXR file is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExrOptions {
    /// Colours, alpha, normals and albedo have 16 bits ([`is_half`]), at most 65504 if finite.
    pub half: bool,
    pub compression: ExrCompression,
    /// A grey image has its channel `Y` as `R`, `G` and `B`, too.
    pub grey_as_rgb: bool,
}

impl Default for ExrOptions {
    fn default() -> Self {
        Self { half: false, compression: ExrCompression::default(), grey_as_rgb: true }
    }
}

impl From<&FileSettings> for ExrOptions {
    fn from(settings: &FileSettings) -> Self {
        Self { half: settings.exr_half, compression: settings.exr_compression.unwrap_or_default(), ..Self::default() }
    }
}

impl From<ExrCompression> for Compression {
    fn from(compression: ExrCompression) -> Self {
        match compression {
            ExrCompression::None => Self::Uncompressed,
            ExrCompression::Rle => Self::RLE,
            ExrCompression::Zips => Self::ZIP1,
            ExrCompression::Zip => Self::ZIP16,
            ExrCompression::Piz => Self::PIZ,
            ExrCompression::Pxr24 => Self::PXR24,
            ExrCompression::B44 => Self::B44,
            ExrCompression::B44a => Self::B44A,
        }
    }
}

/// Does a channel have 16 bits with [`ExrOptions::half`]? Colours, alpha and directions do; depths,
/// positions, ids, counts, variances and the film's state need all their bits.
pub fn is_half(channel: &str) -> bool {
    let layer = channel.split_once('.').map(|(layer, _)| layer);
    match layer {
        None => matches!(channel, "R" | "G" | "B" | "A" | "Y"),
        Some(layer) => matches!(layer, "albedo" | "bent" | "Ng" | "noisy" | "Ns"),
    }
}

/// The text of a matrix in metadata: 16 numbers in the order of EXR files, whose matrices are
/// multiplied from the right with rows (a translation is in the last four).
pub fn matrix_text(matrix: &Matrix4x4) -> String {
    matrix.map(|v| v.to_string()).join(",")
}

fn matrix_of(text: &str) -> Option<Matrix4x4> {
    let values = text.split(',').map(|v| v.trim().parse().ok()).collect::<Option<Vec<f32>>>()?;
    values.try_into().ok()
}

/// Writes an image with all its channels and metadata, 32 bits and lossless.
pub fn write(image: &Image, path: &Path) -> Result<()> {
    write_with(image, path, &ExrOptions::default())
}

/// Writes an image with all its channels and metadata.
///
/// # Errors
/// [`Error::Usage`] for a contradictory image or metadata unfit for the format, [`Error::Output`].
pub fn write_with(image: &Image, path: &Path, options: &ExrOptions) -> Result<()> {
    image.check()?;
    check_size(image.width, image.height)?;
    if let Some((key, _)) =
        image.metadata.iter().find(|(k, _)| k.is_empty() || k.len() + PREFIX.len() > 255 || k.contains('\0'))
    {
        return Err(Error::Usage(format!("metadata key {key:?} is empty, too long or holds a zero byte")));
    }
    write_atomically(path, |file| {
        encode(image, file, options)?;
        sort_attributes(file)
    })
}

fn encode(image: &Image, file: &mut File, options: &ExrOptions) -> io::Result<()> {
    let stored =
        |name: &str, samples| AnyChannel::new(text(name), Borrowed { samples, half: options.half && is_half(name) });
    let mut channels: exr::prelude::SmallVec<_> = image.channels.iter().map(|c| stored(&c.name, &c.samples)).collect();
    let is_free = |name: &&str| image.channels.iter().all(|c| c.name != **name);
    let rgb = ["R", "G", "B"];
    if let (true, Some(grey)) =
        (options.grey_as_rgb && rgb.iter().all(is_free), image.channels.iter().find(|c| c.name == "Y"))
    {
        channels.extend(rgb.iter().map(|name| stored(name, &grey.samples)));
    }

    // metadata, of which two keys are attributes of the format
    let software = text(concat!("skylit ", env!("CARGO_PKG_VERSION")));
    let mut attributes = LayerAttributes { software_name: Some(software), ..Default::default() };
    for (key, value) in &image.metadata {
        match (key.as_str(), matrix_of(value)) {
            (WORLD_TO_CAMERA, Some(matrix)) => attributes.world_to_camera = Some(matrix),
            (WORLD_TO_NDC, Some(matrix)) => attributes.world_to_normalized_device = Some(matrix),
            _ => drop(attributes.other.insert(text(&format!("{PREFIX}{key}")), AttributeValue::Text(text(value)))),
        }
    }

    // blocks in order of their rows, whichever thread finishes first: the bytes are always the same
    let encoding = Encoding {
        compression: options.compression.into(),
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let size = (image.width as usize, image.height as usize);
    let layer = Layer::new(size, attributes, encoding, AnyChannels::sort(channels));
    let mut file_image = exr::image::Image::from_layer(layer);
    // sRGB's, which are also those that a file without the attribute has
    file_image.attributes.chromaticities = Some(Chromaticities {
        red: Vec2(0.64, 0.33),
        green: Vec2(0.3, 0.6),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.329),
    });

    // written through a buffer
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

/// Sorts the attributes of the header by name: the library writes them in a hash table's order.
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

/// Samples that the library reads where they lie: copies of large images would double the memory.
struct Borrowed<'a> {
    samples: &'a Samples,
    /// Floats have 16 bits.
    half: bool,
}

/// Copies parts of rows to the encoder.
struct RowWriter<'a> {
    samples: &'a Samples,
    half: bool,
    width: usize,
}

/// The nearest half float; the largest one for finite values beyond it, not infinity.
fn half(value: f32) -> f16 {
    let largest = f16::MAX.to_f32();
    f16::from_f32(if value.is_finite() { value.clamp(-largest, largest) } else { value })
}

impl<'s, 'a: 's> WritableSamples<'s> for Borrowed<'a> {
    type Writer = RowWriter<'s>;

    fn sample_type(&self) -> SampleType {
        match self.samples {
            Samples::F32(_) if self.half => SampleType::F16,
            Samples::F32(_) => SampleType::F32,
            Samples::U32(_) => SampleType::U32,
        }
    }

    fn infer_level_modes(&self) -> (LevelMode, RoundingMode) {
        (LevelMode::Singular, RoundingMode::Down)
    }

    fn create_samples_writer(&'s self, header: &Header) -> RowWriter<'s> {
        RowWriter { samples: self.samples, half: self.half, width: header.layer_size.width() }
    }
}

impl SamplesWriter for RowWriter<'_> {
    fn extract_line(&self, line: LineRefMut<'_>) {
        let Vec2(x, y) = line.location.position;
        let start = y * self.width + x;
        let range = start..start + line.location.sample_count;
        // native byte order: the library converts
        match self.samples {
            Samples::F32(s) if self.half => {
                let pairs = line.value.chunks_exact_mut(2).zip(&s[range]);
                pairs.for_each(|(bytes, v)| bytes.copy_from_slice(&half(*v).to_ne_bytes()));
            }
            Samples::F32(s) => line.value.copy_from_slice(bytemuck::cast_slice(&s[range])),
            Samples::U32(s) => line.value.copy_from_slice(bytemuck::cast_slice(&s[range])),
        }
    }
}

/// Reads an EXR with all its channels, as 32-bit floats, and its `skylit.` metadata, sorted by key.
/// The names of several parts become prefixes of their channels' names.
///
/// The image is what the display window shows: overscan is left out, missing pixels are 0.
///
/// Copies of a grey image's channel are left out, and `samples` are floats whatever the version.
pub fn read(path: &Path) -> Result<Image> {
    read_within(path, &Budget::default())
}

/// As [`read`], with memory of a budget that images which are read together share.
///
/// # Errors
/// [`Error::Input`], and [`Error::OutOfMemory`] for more than the budget has.
pub fn read_within(path: &Path, budget: &Budget) -> Result<Image> {
    // the decoder panics at some files that are damaged
    std::panic::catch_unwind(|| decode(path, budget))
        .unwrap_or_else(|_| Err(Error::input(path, "not a readable EXR: it is damaged")))
}

/// Minimum bytes of a part's pixels: a damaged header must not make the decoder take gigabytes. An
/// entry of the table of blocks has 8 bytes, a block's own header as many or more.
fn least_bytes(header: &Header) -> u64 {
    let pixels = header.layer_size.0 as u64 * header.layer_size.1 as u64;
    let of_channel = |c: &ChannelDescription| {
        let samples = pixels / (c.sampling.0 as u64 * c.sampling.1 as u64).max(1);
        samples * c.sample_type.bytes_per_sample() as u64 / most_of_byte(header.compression, c.sample_type)
    };
    (16 * header.chunk_count as u64).max(header.channels.list.iter().map(of_channel).sum())
}

/// Bytes of samples that a byte may hold at most.
fn most_of_byte(compression: Compression, samples: SampleType) -> u64 {
    // at most 128 bytes in two
    const RUN_LENGTHS: u64 = 64;
    // RFC 1951: copies at most 258 bytes in two bits
    const DEFLATE: u64 = 258 * 4;
    match compression {
        Compression::Uncompressed => 1,
        Compression::RLE => RUN_LENGTHS,
        Compression::ZIP1 | Compression::ZIP16 => DEFLATE,
        // floats are cut to three bytes first
        Compression::PXR24 => DEFLATE * 4 / 3,
        // Huffman codes of two-byte words: a run of at most 255 is a code of a bit, and eight
        Compression::PIZ => (255_u64 * 2 * 8).div_ceil(9),
        // blocks of 4 x 4 equal halves take three bytes; other samples are not compressed
        Compression::B44 | Compression::B44A if samples == SampleType::F16 => 32_u64.div_ceil(3),
        Compression::B44 | Compression::B44A => 1,
        // some channels have run lengths, deflated
        _ => RUN_LENGTHS * DEFLATE,
    }
}

/// Has a block more in its header than its pixels can? Blocks of DWAA and DWAB begin with eleven
/// numbers of 64 bits; the decoder takes memory for as much as the second to the tenth say.
fn has_block_that_is_too_large(file: Cursor<&[u8]>, meta: &MetaData) -> exr::error::Result<bool> {
    let has_sizes = |h: &Header| matches!(h.compression, Compression::DWAA(_) | Compression::DWAB(_));
    if !meta.headers.iter().any(has_sizes) {
        return Ok(false);
    }
    for chunk in exr::block::read(file, false)?.all_chunks(false)? {
        let chunk = chunk?;
        let Some(header) = meta.headers.get(chunk.layer_index).filter(|h| has_sizes(h)) else { continue };
        let (size, bytes) = match &chunk.compressed_block {
            CompressedBlock::ScanLine(block) => {
                let from_top =
                    block.y_coordinate.saturating_sub(header.own_attributes.layer_position.1).max(0) as usize;
                let lines = header.compression.scan_lines_per_block().min(header.layer_size.1.saturating_sub(from_top));
                (Vec2(header.layer_size.0, lines), &block.compressed_pixels_le)
            }
            CompressedBlock::Tile(block) => {
                (header.get_absolute_block_pixel_coordinates(block.coordinates)?.size, &block.compressed_pixels_le)
            }
            CompressedBlock::DeepScanLine(_) | CompressedBlock::DeepTile(_) => continue,
        };
        // pixels that would take more bytes otherwise are stored as they are
        if bytes.len() == size.area() * header.channels.bytes_per_pixel {
            continue;
        }
        // transforms are of 8 x 8 pixels; four bytes a value, and what deflating adds at worst
        let values = (size.0.next_multiple_of(8) * size.1.next_multiple_of(8) * header.channels.list.len()) as u64;
        let most = 8 * values + 4096;
        let mut sizes = bytes.chunks_exact(8).take(10).skip(1);
        if sizes.any(|b| b.try_into().map_or(u64::MAX, u64::from_le_bytes) > most) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// A rectangle of pixels, which are counted to the right and down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Window {
    position: Vec2<i32>,
    size: Vec2<usize>,
}

impl From<IntegerBounds> for Window {
    fn from(bounds: IntegerBounds) -> Self {
        Self { position: bounds.position, size: bounds.size }
    }
}

impl std::fmt::Display for Window {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{} pixels at {},{}", self.size.0, self.size.1, self.position.0, self.position.1)
    }
}

impl Window {
    fn pixels(self) -> u128 {
        self.size.0 as u128 * self.size.1 as u128
    }

    /// The starts of the overlap in this window and the other along an axis, and its length.
    fn overlap(self, other: Self, axis: usize) -> (usize, usize, usize) {
        let of = |w: Self| match axis {
            0 => (i64::from(w.position.0), w.size.0 as i64),
            _ => (i64::from(w.position.1), w.size.1 as i64),
        };
        let ((a, a_size), (b, b_size)) = (of(self), of(other));
        let (first, end) = (a.max(b), (a + a_size).min(b + b_size));
        let count = (end - first).max(0);
        if count == 0 { (0, 0, 0) } else { ((first - a) as usize, (first - b) as usize, count as usize) }
    }

    /// Samples of this window as `display` shows them: 0 for pixels that this window does not have.
    fn shown_in<T: Copy + Default>(self, display: Self, samples: Vec<T>) -> Vec<T> {
        if self == display {
            return samples;
        }
        let mut shown = vec![T::default(); display.size.area()];
        let ((x, to_x, width), (y, to_y, height)) = (self.overlap(display, 0), self.overlap(display, 1));
        for row in 0..height {
            let (from, to) = ((y + row) * self.size.0 + x, (to_y + row) * display.size.0 + to_x);
            shown[to..to + width].copy_from_slice(&samples[from..from + width]);
        }
        shown
    }
}

/// Refuses sizes of no image of this program, windows that do not meet, and subsampled channels.
///
/// # Errors
/// What is wrong, as the end of a sentence.
fn check_windows(meta: &MetaData) -> std::result::Result<(), String> {
    let (mut padding, mut is_shown) = (0, false);
    for header in &meta.headers {
        let (data, display) =
            (Window::from(header.data_window()), Window::from(header.shared_attributes.display_window));
        for (name, window) in [("data", data), ("display", display)] {
            if window.pixels() == 0 || window.pixels() > u128::from(super::MAX_PIXELS) {
                return Err(format!("an image of {} x {} pixels ({name} window)", window.size.0, window.size.1));
            }
        }
        let lesser: Vec<_> =
            header.channels.list.iter().filter(|c| c.sampling != Vec2(1, 1)).map(|c| string(&c.name)).collect();
        if !lesser.is_empty() {
            let names = lesser.join(", ");
            let what = if names.contains("RY") { "colours are luminance and chroma" } else { "they are subsampled" };
            return Err(format!(
                "has channels of less resolution than the image ({names}: {what}), which are not read: save it with R, G and B"
            ));
        }
        let [width, height] = [0, 1].map(|axis| data.overlap(display, axis).2);
        is_shown |= width * height > 0;
        padding += (display.pixels() as u64 - (width * height) as u64) * header.channels.list.len() as u64 * 4;
        if padding > MAX_PADDING {
            return Err(format!(
                "has a display window of {display}, of which it holds {width}x{height} pixels ({data}): crop its display window"
            ));
        }
    }
    match meta.headers.first() {
        Some(header) if !is_shown => Err(format!(
            "shows nothing: its display window of {} has none of its pixels ({})",
            Window::from(header.shared_attributes.display_window),
            Window::from(header.data_window())
        )),
        _ => Ok(()),
    }
}

fn decode(path: &Path, budget: &Budget) -> Result<Image> {
    let broken = |e: exr::error::Error| match e {
        exr::error::Error::Io(e) => Error::read(path, &e),
        exr::error::Error::NotSupported(m) => {
            Error::input(path, format!("an EXR of a kind that is not supported: {m}"))
        }
        // what the decoder says of a file that ends early
        exr::error::Error::Invalid(m) if m == "reference to missing bytes" => Error::input(path, ENDS_EARLY),
        e => Error::input(path, format!("not a readable EXR: {e}")),
    };
    let data = files::read(path)?;
    let open = || Cursor::new(&data[..]);
    // the header first: it says how much memory the rest will take
    let meta = MetaData::read_from_buffered(open(), false).map_err(broken)?;
    check_windows(&meta).map_err(|message| Error::input(path, message))?;
    let bytes = data.len() as u64;
    if meta.headers.iter().map(least_bytes).sum::<u64>() > bytes {
        return Err(Error::input(
            path,
            format!("not a readable EXR: {bytes} bytes are too few for what its header says"),
        ));
    }
    budget.read(usize::try_from(bytes).unwrap_or(usize::MAX));
    for header in &meta.headers {
        let [data, display] =
            [header.data_window(), header.shared_attributes.display_window].map(|w| Window::from(w).pixels());
        let bytes = |pixels: u128| {
            u64::try_from(pixels.saturating_mul(4 * header.channels.list.len() as u128)).unwrap_or(u64::MAX)
        };
        let size = Window::from(header.data_window()).size;
        // as they are shown, and before that as they are read
        let taken =
            budget.take_for_now(bytes(display), bytes(data), || format!("an image of {}x{} pixels", size.0, size.1));
        taken.or_else(|_| budget.check().map_err(|e| e.in_file(path)))?;
    }
    if has_block_that_is_too_large(open(), &meta).map_err(broken)? {
        return Err(Error::input(path, "not a readable EXR: the header of a block has more than its pixels can"));
    }
    let reader =
        exr::prelude::read().no_deep_data().largest_resolution_level().all_channels().all_layers().all_attributes();
    // a panic in one of the decoder's threads ends the process, and damaged blocks are not checked
    let is_simple = |h: &Header| {
        matches!(h.compression, Compression::Uncompressed | Compression::RLE | Compression::ZIP1 | Compression::ZIP16)
    };
    let reader = if meta.headers.iter().all(is_simple) { reader } else { reader.non_parallel() };
    let file = reader.from_buffered(open()).map_err(broken)?;

    // all parts have the same display window
    let display = Window::from(file.attributes.display_window);
    let mut image = Image { width: display.size.0 as u32, height: display.size.1 as u32, ..Image::default() };
    let parts = file.layer_data.len();
    let is_ours = |a: &LayerAttributes| a.software_name.as_ref().is_some_and(|s| s.as_slice().starts_with(b"skylit "));
    let ours = file.layer_data.iter().all(|layer| is_ours(&layer.attributes));
    for layer in file.layer_data {
        let data = Window { position: layer.attributes.layer_position, size: layer.size };
        let prefix =
            layer.attributes.layer_name.as_ref().filter(|_| parts > 1).map(|n| string(n) + ".").unwrap_or_default();
        for channel in layer.channel_data.list {
            let samples = match channel.sample_data {
                FlatSamples::F16(s) => {
                    Samples::F32(data.shown_in(display, s.into_iter().map(|v| v.to_f32()).collect()))
                }
                FlatSamples::F32(s) => Samples::F32(data.shown_in(display, s)),
                FlatSamples::U32(s) => Samples::U32(data.shown_in(display, s)),
            };
            image.channels.push(Channel { name: prefix.clone() + &string(&channel.name), samples });
        }
        let matrices = [
            (WORLD_TO_CAMERA, layer.attributes.world_to_camera),
            (WORLD_TO_NDC, layer.attributes.world_to_normalized_device),
        ];
        let matrices =
            matrices.iter().filter_map(|(key, matrix)| Some(((*key).to_owned(), matrix_text(matrix.as_ref()?))));
        image.metadata.extend(matrices);
        for (key, value) in layer.attributes.other.iter().chain(&file.attributes.other) {
            if let (Some(key), AttributeValue::Text(value)) = (string(key).strip_prefix(PREFIX), value) {
                image.metadata.push((key.to_owned(), string(value)));
            }
        }
    }
    if display.position != Vec2(0, 0) {
        image.metadata.retain(|(key, _)| key != DISPLAY_ORIGIN);
        image.metadata.push((DISPLAY_ORIGIN.to_owned(), format!("{},{}", display.position.0, display.position.1)));
    }
    image.metadata.sort();
    image.metadata.dedup();
    if parts == 1 && ours {
        normalize(&mut image);
    }
    image.check().map_err(|e| Error::input(path, e.to_string()))?;
    Ok(image)
}

/// An image of skylit, whatever version wrote it and for whichever other programs.
fn normalize(image: &mut Image) {
    for channel in image.channels.iter_mut().filter(|c| c.name == SAMPLES) {
        if let Samples::U32(counts) = &channel.samples {
            channel.samples = Samples::F32(counts.iter().map(|n| *n as f32).collect());
        }
    }
    let bits = |name: &str| image.f32(name).map(bytemuck::cast_slice::<f32, u32>);
    let is_grey = bits("Y").is_some_and(|grey| ["R", "G", "B"].iter().all(|name| bits(name) == Some(grey)));
    if is_grey {
        image.channels.retain(|c| !matches!(c.name.as_str(), "R" | "G" | "B"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_where_windows_put_them() {
        let window = |x, y, width, height| Window { position: Vec2(x, y), size: Vec2(width, height) };
        let display = window(-2, 5, 3, 2);
        let shown = |data: Window| data.shown_in(display, (1..=data.size.area() as u32).collect());
        assert_eq!(shown(display), [1, 2, 3, 4, 5, 6]);
        assert_eq!(shown(window(-2, 5, 3, 1)), [1, 2, 3, 0, 0, 0]);
        assert_eq!(shown(window(-1, 6, 1, 1)), [0, 0, 0, 0, 1, 0]);
        // overscan on all sides, and a corner
        assert_eq!(shown(window(-3, 4, 5, 4)), [7, 8, 9, 12, 13, 14]);
        assert_eq!(shown(window(-5, 0, 4, 6)), [24, 0, 0, 0, 0, 0]);
        assert_eq!(shown(window(1, 5, 3, 2)), [0; 6]);
        assert_eq!(shown(window(i32::MIN, i32::MAX, 1, 1)), [0; 6]);
    }

    /// A header is a few hundred bytes; what it says must not decide how much memory is taken.
    #[test]
    fn files_are_as_large_as_their_headers_say() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image.exr");
        let name = "R".to_owned();
        let image = |samples| {
            let channels = vec![Channel { name: name.clone(), samples: Samples::F32(samples) }];
            Image { width: 512, height: 512, channels, metadata: Vec::new() }
        };
        use ExrCompression as C;
        for compression in [C::None, C::Rle, C::Zips, C::Zip, C::Piz, C::Pxr24, C::B44, C::B44a] {
            for half in [false, true] {
                let options = ExrOptions { half, compression, ..Default::default() };
                // the samples that compress best are read, whatever the method
                for samples in [vec![0.0; 512 * 512], vec![0.5; 512 * 512]] {
                    write_with(&image(samples.clone()), &path, &options).unwrap();
                    let again = read(&path).unwrap_or_else(|e| panic!("{compression:?}: {e}"));
                    let Samples::F32(read) = &again.channels[0].samples else { panic!("not floats") };
                    assert_eq!(*read, samples, "{compression:?}");
                }
                let bytes = std::fs::read(&path).unwrap();
                for size in [8192_u32, 16_384] {
                    let mut damaged = bytes.clone();
                    for name in [&b"dataWindow\0box2i\0"[..], b"displayWindow\0box2i\0"] {
                        let at = damaged.windows(name.len()).position(|w| w == name).unwrap() + name.len() + 4 + 8;
                        for corner in 0..2 {
                            damaged[at + 4 * corner..][..4].copy_from_slice(&(size - 1).to_le_bytes());
                        }
                    }
                    std::fs::write(&path, damaged).unwrap();
                    let error = read(&path).unwrap_err().to_string();
                    assert!(error.contains("too few"), "{compression:?}, {size}: {error}");
                }
            }
        }
    }

    /// Blocks of cosine transforms say how many values the decoder takes memory for.
    #[test]
    fn blocks_have_as_many_values_as_their_pixels() {
        use exr::prelude::{Blocks, Encoding, Layer, LineOrder, SpecificChannels, WritableImage};
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image.exr");
        for compression in [Compression::DWAA(None), Compression::DWAB(None)] {
            // blocks that are not a multiple of eight pixels, and the last one is not whole
            let encoding = Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
            let colours =
                SpecificChannels::rgb(|at: Vec2<usize>| (at.x() as f32 / 41.0, at.y() as f32 / 300.0, 0.5_f32));
            let layer = Layer::new((41, 300), LayerAttributes::named("colours"), encoding, colours);
            exr::prelude::Image::from_layer(layer).write().to_file(&path).unwrap();
            let image = read(&path).unwrap();
            assert_eq!((image.width, image.height, image.channels.len()), (41, 300, 3));
            let chunks = exr::block::read(BufReader::new(File::open(&path).unwrap()), false).unwrap();
            let chunk = chunks.all_chunks(false).unwrap().next().unwrap().unwrap();
            let CompressedBlock::ScanLine(block) = chunk.compressed_block else { panic!("not of lines") };
            let bytes = std::fs::read(&path).unwrap();
            let data = &block.compressed_pixels_le[..88];
            let at = bytes.windows(data.len()).position(|w| w == data).unwrap();
            for counter in 1..10 {
                let mut damaged = bytes.clone();
                damaged[at + 8 * counter..][..8].copy_from_slice(&(1_u64 << 40).to_le_bytes());
                std::fs::write(&path, damaged).unwrap();
                let error = read(&path).unwrap_err().to_string();
                assert!(error.contains("more than its pixels can"), "{compression:?}, {counter}: {error}");
            }
        }
    }
}
