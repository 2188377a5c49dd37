//! Sizes of images.

use crate::error::{Error, Result};
use crate::settings::parse::Parsed;

/// Maximum number of pixels of an image: more overflow the 32-bit indices of the tracers.
pub const MAX_PIXELS: u64 = 1 << 28;

/// Parses an image size `WxH` in pixels.
pub fn parse_size(text: &str) -> Parsed<[u32; 2]> {
    let side =
        |s: &str| s.trim().parse::<u32>().map_err(|_| "expected WIDTHxHEIGHT in pixels, like 1280x720".to_owned());
    let (w, h) = text.split_once(['x', 'X']).ok_or("expected WIDTHxHEIGHT in pixels, like 1280x720")?;
    let size = [side(w)?, side(h)?];
    check_size(size[0], size[1]).map_err(|e| e.to_string())?;
    Ok(size)
}

/// Refuses image sizes of zero or more than [`MAX_PIXELS`] pixels.
pub fn check_size(width: u32, height: u32) -> Result<()> {
    if width == 0 || height == 0 {
        return Err(Error::Usage(format!("image size {width}x{height}: both sides must be at least 1")));
    }
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(Error::Usage(format!(
            "image size {width}x{height}: more than {MAX_PIXELS} pixels (16384x16384 is the most)"
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(parse_size("1x1"), Ok([1, 1]));
        assert_eq!(parse_size("16384x16384"), Ok([16384, 16384]));
        for bad in ["0x5", "5x0", "16385x16384", "5", "x", "-1x5", "1x2x3", "4294967296x1", ""] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
    }
}
