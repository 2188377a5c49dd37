//! Radiance HDR (`.hdr`, `.pic`): the header is read here, the pixels by the crate image, which
//! knows neither all signatures and orientations nor exposures.
//!
//! Values are divided by all `EXPOSURE` and `COLORCORR` entries: so they are as recorded.

use std::io::ErrorKind;
use std::path::Path;

use image::codecs::hdr::HdrDecoder;
use image::{ImageDecoder, ImageError};

use super::decode::ENDS_EARLY;
use super::{Channel, Image, check_size};
use crate::error::Error;
use crate::files;
use crate::memory::Budget;

/// Longest header, bytes: commands that made an image may be listed in it.
const MAX_HEADER: usize = 1 << 16;

/// Greatest side of an image that [`read`] reads, pixels.
const MAX_SIDE: u32 = 1 << 20;

/// A decoded file: linear values, rows from the top, pixels from the left.
#[derive(Clone, Debug, PartialEq)]
pub struct RadianceImage {
    pub width: u32,
    pub height: u32,
    pub rgb: Vec<[f32; 3]>,
}

/// Does a file begin as those of Radiance: `#?RADIANCE`, `#?RGBE`, or another program's name?
pub fn is_radiance(bytes: &[u8]) -> bool {
    bytes.starts_with(b"#?")
}

#[derive(Clone, Debug, PartialEq)]
struct Header {
    /// Where the pixels begin.
    length: usize,
    /// Multiplies the values of each channel.
    factors: [f32; 3],
    resolution: Resolution,
}

/// How pixels are stored: scan lines one after another, along an axis of the image each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Resolution {
    scan_lines: u32,
    /// Pixels of each.
    length: u32,
    /// Scan lines are columns.
    is_transposed: bool,
    /// The first scan line is at the right or, of rows, at the bottom.
    reverses_lines: bool,
    /// The first pixel of a scan line is at the right or, of columns, at the bottom.
    reverses_pixels: bool,
}

/// Reads a file of sides up to `max_side` pixels.
///
/// # Errors
/// [`Error::Input`] naming the file, [`Error::OutOfMemory`].
pub fn read_file(path: &Path, max_side: u32, budget: &Budget) -> crate::error::Result<RadianceImage> {
    let bytes = files::read(path)?;
    budget.read(bytes.len());
    let image = decode(bytes, max_side, budget);
    budget.check().map_err(|e| e.in_file(path))?;
    image.map_err(|e| Error::input(path, e))
}

/// Reads a file as an image with the channels `R`, `G` and `B`.
///
/// # Errors
/// Those of [`read_file`].
pub fn read(path: &Path, budget: &Budget) -> crate::error::Result<Image> {
    let RadianceImage { width, height, rgb } = read_file(path, MAX_SIDE, budget)?;
    check_size(width, height).map_err(|e| Error::input(path, e.to_string()))?;
    let plane = |c: usize| rgb.iter().map(|pixel| pixel[c]).collect();
    let channels = ["R", "G", "B"].into_iter().enumerate().map(|(c, name)| Channel::from_floats(name, plane(c)));
    Ok(Image { width, height, channels: channels.collect(), metadata: Vec::new() })
}

/// Decodes a file.
///
/// # Errors
/// What is wrong with the file, as the end of a sentence.
pub fn decode(mut bytes: Vec<u8>, max_side: u32, budget: &Budget) -> Result<RadianceImage, String> {
    let Header { length, factors, resolution } = Header::parse(&bytes)?;
    let (lines, pixels) = (resolution.scan_lines, resolution.length);
    if lines == 0 || pixels == 0 || lines > max_side || pixels > max_side {
        return Err(format!("has {lines} scan lines of {pixels} pixels: 1 to {max_side} are possible"));
    }
    // a scan line has a pixel at least: memory is not taken for those that are not there
    if u64::from(lines) * 4 > (bytes.len() - length) as u64 {
        return Err(ENDS_EARLY.to_owned());
    }
    let size = || format!("an image of {pixels}x{lines} pixels");
    // once as it is read and once as it is turned
    let image = u64::from(lines) * u64::from(pixels) * 12;
    budget.take_for_now(image, image, size)?;

    // the header that the decoder knows
    bytes.splice(..length, format!("#?RADIANCE\n\n-Y {lines} +X {pixels}\n").into_bytes());
    let wrong = |e: ImageError| match e {
        ImageError::IoError(e) if e.kind() == ErrorKind::UnexpectedEof => ENDS_EARLY.to_owned(),
        e => format!("cannot be decoded as Radiance HDR: {e}"),
    };
    let decoder = HdrDecoder::new(&bytes[..]).map_err(wrong)?;
    let mut rgb = vec![[0.0_f32; 3]; lines as usize * pixels as usize];
    decoder.read_image(bytemuck::cast_slice_mut(&mut rgb)).map_err(wrong)?;

    // values and places as the header says
    if factors != [1.0; 3] {
        rgb.iter_mut().for_each(|pixel| pixel.iter_mut().zip(factors).for_each(|(v, factor)| *v *= factor));
    }
    Ok(resolution.upright(rgb))
}

impl Header {
    fn parse(bytes: &[u8]) -> Result<Self, String> {
        let (mut length, mut exposure, mut correction) = (0, 1.0, [1.0; 3]);
        let mut next_line = || -> Result<String, String> {
            let rest = &bytes[length..];
            let end = rest.iter().take(MAX_HEADER).position(|b| *b == b'\n');
            let end = end.filter(|end| length + end < MAX_HEADER).ok_or_else(|| {
                if bytes.len() < MAX_HEADER {
                    ENDS_EARLY.to_owned()
                } else {
                    "is no Radiance HDR: its header has no end".to_owned()
                }
            })?;
            length += end + 1;
            Ok(String::from_utf8_lossy(&rest[..end]).trim().to_owned())
        };

        // Multiplies the exposures of all lines up to an empty one.
        loop {
            let line = next_line()?;
            if line.is_empty() {
                break;
            }
            let Some((key, value)) = line.split_once('=').filter(|_| !line.starts_with('#')) else { continue };
            match key.trim() {
                "FORMAT" if value.trim() == "32-bit_rle_xyze" => {
                    return Err("holds CIE XYZ colours (FORMAT=32-bit_rle_xyze): convert it to RGB, for example with \
                                `ra_xyze -r`"
                        .to_owned());
                }
                "FORMAT" if value.trim() != "32-bit_rle_rgbe" => {
                    return Err(format!("has pixels of a format that skylit does not read ({})", value.trim()));
                }
                // each multiplies those before
                "EXPOSURE" => exposure *= numbers::<1>(&line, value)?[0],
                "COLORCORR" => {
                    let factors = numbers::<3>(&line, value)?;
                    correction = std::array::from_fn(|c| correction[c] * factors[c]);
                }
                _ => {}
            }
        }
        let resolution = Resolution::parse(&next_line()?)?;
        let factors = correction.map(|c| (1.0 / (exposure * c)) as f32);
        if !factors.iter().all(|f| f.is_normal()) {
            return Err(format!("has an exposure of {exposure:e}, which no image has"));
        }
        Ok(Self { length, factors, resolution })
    }
}

/// Positive numbers of a line.
fn numbers<const N: usize>(line: &str, text: &str) -> Result<[f64; N], String> {
    let values: Vec<f64> = text.split_whitespace().filter_map(|n| n.parse().ok()).collect();
    let values: Option<[f64; N]> =
        values.try_into().ok().filter(|v: &[f64; N]| v.iter().all(|n| n.is_finite() && *n > 0.0));
    values.ok_or_else(|| {
        format!("has a line {:?} in its header, in which {N} numbers above 0 are missing", shortened(line))
    })
}

fn shortened(line: &str) -> String {
    line.chars().take(60).collect()
}

impl Resolution {
    /// Parses a line such as `-Y 512 +X 1024`: the axis across scan lines, and the one along them.
    fn parse(line: &str) -> Result<Self, String> {
        let wrong = || format!("has {:?} in its header where its size should be, like -Y 512 +X 1024", shortened(line));
        let words: Vec<&str> = line.split_whitespace().collect();
        let [lines, scan_lines, pixels, length] = words[..] else { return Err(wrong()) };
        let axis = |word: &str| match word {
            // y grows upwards, rows are from the top
            "-Y" => Some(('Y', false)),
            "+Y" => Some(('Y', true)),
            "+X" => Some(('X', false)),
            "-X" => Some(('X', true)),
            _ => None,
        };
        let ((first, reverses_lines), (second, reverses_pixels)) = axis(lines).zip(axis(pixels)).ok_or_else(wrong)?;
        let (scan_lines, length) = scan_lines.parse().ok().zip(length.parse().ok()).ok_or_else(wrong)?;
        if first == second {
            return Err(wrong());
        }
        Ok(Self { scan_lines, length, is_transposed: first == 'X', reverses_lines, reverses_pixels })
    }

    /// Moves pixels to their places.
    fn upright(self, mut rgb: Vec<[f32; 3]>) -> RadianceImage {
        let length = self.length as usize;
        if self.reverses_pixels {
            rgb.chunks_exact_mut(length).for_each(<[_]>::reverse);
        }
        if self.reverses_lines {
            let lines = self.scan_lines as usize;
            for k in 0..lines / 2 {
                let (head, tail) = rgb.split_at_mut((lines - 1 - k) * length);
                head[k * length..][..length].swap_with_slice(&mut tail[..length]);
            }
        }
        if !self.is_transposed {
            return RadianceImage { width: self.length, height: self.scan_lines, rgb };
        }
        let rows = (0..length).flat_map(|y| (0..self.scan_lines as usize).map(move |x| (x, y)));
        let rgb = rows.map(|(x, y)| rgb[x * length + y]).collect();
        RadianceImage { width: self.scan_lines, height: self.length, rgb }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(bytes: Vec<u8>, max_side: u32) -> Result<RadianceImage, String> {
        super::decode(bytes, max_side, &Budget::default())
    }

    /// An image of 3 x 2 pixels whose red says where they are: 0, 1, 2 in the upper row.
    fn file(signature: &str, header: &str, size: &str, order: [u8; 6]) -> Vec<u8> {
        let mut bytes = format!("{signature}{header}\n{size}\n").into_bytes();
        // the exponent of 2^0, mantissas of 256ths
        order.iter().for_each(|k| bytes.extend([128 + k, 128, 64, 128]));
        bytes
    }

    fn red(k: u8) -> f32 {
        f32::from(128 + k) / 256.0
    }

    #[test]
    fn orientations() {
        let stored = [
            ("-Y 2 +X 3", [0, 1, 2, 3, 4, 5]),
            ("-Y 2 -X 3", [2, 1, 0, 5, 4, 3]),
            ("+Y 2 +X 3", [3, 4, 5, 0, 1, 2]),
            ("+Y 2 -X 3", [5, 4, 3, 2, 1, 0]),
            ("+X 3 -Y 2", [0, 3, 1, 4, 2, 5]),
            ("+X 3 +Y 2", [3, 0, 4, 1, 5, 2]),
            ("-X 3 -Y 2", [2, 5, 1, 4, 0, 3]),
            ("-X 3 +Y 2", [5, 2, 4, 1, 3, 0]),
        ];
        for (size, order) in stored {
            let image = decode(file("#?RADIANCE\n", "FORMAT=32-bit_rle_rgbe\n", size, order), 64).unwrap();
            assert_eq!((image.width, image.height), (3, 2), "{size}");
            let reds: Vec<f32> = image.rgb.iter().map(|p| p[0]).collect();
            assert_eq!(reds, [0, 1, 2, 3, 4, 5].map(red), "{size}");
        }
    }

    #[test]
    fn values_are_divided_by_exposures() {
        let first = |header: &str| decode(file("#?RGBE\n", header, "-Y 2 +X 3", [0; 6]), 64).map(|image| image.rgb[0]);
        assert_eq!(first("").unwrap(), [0.5, 0.5, 0.25]);
        assert_eq!(first("# EXPOSURE=8\nFORMAT=32-bit_rle_rgbe\r\nEXPOSURE= 2.0\n").unwrap(), [0.25, 0.25, 0.125]);
        assert_eq!(first("EXPOSURE=4\nrpict -vp 0 0 0\nEXPOSURE=0.5\n").unwrap(), [0.25, 0.25, 0.125]);
        assert_eq!(first("COLORCORR=1 2 0.5\nEXPOSURE=2\nCOLORCORR=1 1 2\n").unwrap(), [0.25, 0.125, 0.125]);
        for bad in ["EXPOSURE=0", "EXPOSURE=-1", "EXPOSURE=x", "EXPOSURE=nan", "EXPOSURE=", "COLORCORR=1 2"] {
            assert!(first(&format!("{bad}\n")).unwrap_err().contains(bad), "{bad}");
        }
        assert!(first("EXPOSURE=1e-300\n").unwrap_err().contains("exposure"));
    }

    #[test]
    fn what_is_refused() {
        let bytes = |header: &str, size: &str| file("#?RADIANCE\n", header, size, [0; 6]);
        assert!(decode(bytes("FORMAT=32-bit_rle_xyze\n", "-Y 2 +X 3"), 64).unwrap_err().contains("CIE XYZ"));
        assert!(decode(bytes("FORMAT=ascii\n", "-Y 2 +X 3"), 64).unwrap_err().contains("(ascii)"));
        for size in ["", "-Y 2", "-Y 2 +Y 3", "2 3", "-Y two +X 3", "-Y 2 +X 3 -Z 1", "-Y -2 +X 3"] {
            assert!(decode(bytes("", size), 64).unwrap_err().contains("like -Y 512 +X 1024"), "{size}");
        }
        assert!(decode(bytes("", "-Y 2 +X 65"), 64).unwrap_err().contains("65 pixels"));
        assert!(decode(bytes("", "-Y 0 +X 3"), 64).is_err());
        // cut off in its header and in its pixels, and a header that promises more than there is
        let whole = bytes("", "-Y 2 +X 3");
        for length in [1, 5, 11, 15, whole.len() - 20, whole.len() - 1] {
            assert_eq!(decode(whole[..length].to_vec(), 64).unwrap_err(), ENDS_EARLY, "{length}");
        }
        assert_eq!(decode(bytes("", "-Y 16384 +X 16384"), 1 << 14).unwrap_err(), ENDS_EARLY);
        assert!(decode(vec![b'#'; MAX_HEADER + 1], 64).unwrap_err().contains("no end"));
    }

    /// Pixels that repeat, as files of before 1991 have them.
    #[test]
    fn old_run_lengths() {
        let mut bytes = b"#?RADIANCE\n\n-Y 1 +X 5\n".to_vec();
        bytes.extend([[130, 128, 128, 128], [1, 1, 1, 3], [131, 128, 128, 128]].as_flattened());
        let reds: Vec<f32> = decode(bytes, 64).unwrap().rgb.iter().map(|p| p[0]).collect();
        assert_eq!(reds, [2, 2, 2, 2, 3].map(red));
    }
}
