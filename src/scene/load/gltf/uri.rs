//! URIs of buffers and images: data URIs, and relative paths with percent-encoding.

use std::path::PathBuf;

use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

/// What a URI stands for.
pub(super) enum Uri {
    /// The bytes of a data URI.
    Data(Vec<u8>),
    /// A path, relative to the glTF file unless absolute.
    Path(PathBuf),
}

/// Exporters disagree on padding; the length says it all anyway.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Reads a URI.
///
/// # Errors
/// What is wrong with it, in words.
pub(super) fn parse(uri: &str) -> Result<Uri, String> {
    if let Some(rest) = uri.strip_prefix("data:") {
        let (head, data) = rest.split_once(',').ok_or("has a data URI without a comma")?;
        let data = percent_decode(data);
        if !head.ends_with(";base64") {
            return Ok(Uri::Data(data));
        }
        return BASE64.decode(&data).map(Uri::Data).map_err(|e| format!("has a data URI with broken base64 ({e})"));
    }
    if let Some((scheme, _)) = uri.split_once("://")
        && scheme != "file"
    {
        return Err(format!("is at {scheme}://, but skylit reads local files only: download it first"));
    }
    let path = percent_decode(uri.strip_prefix("file://").unwrap_or(uri));
    let path = String::from_utf8(path).map_err(|_| "has a URI that is not UTF-8")?;
    Ok(Uri::Path(PathBuf::from(path)))
}

/// `%41` to `A`; what is no valid escape stays as it is, since some exporters do not escape at all.
fn percent_decode(text: &str) -> Vec<u8> {
    let bytes = text.as_bytes();
    let mut out = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        let escape = (bytes[i] == b'%')
            .then(|| bytes.get(i + 1..i + 3))
            .flatten()
            .filter(|hex| hex.iter().all(u8::is_ascii_hexdigit))
            .and_then(|hex| std::str::from_utf8(hex).ok())
            .and_then(|hex| u8::from_str_radix(hex, 16).ok());
        out.push(escape.unwrap_or(bytes[i]));
        i += if escape.is_some() { 3 } else { 1 };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_and_padding() {
        assert_eq!(percent_decode("a%20b%2Fc%zz%"), b"a b/c%zz%");
        for uri in ["data:application/octet-stream;base64,aGk=", "data:;base64,aGk", "data:,hi", "data:;base64,aGk%3D"] {
            assert!(matches!(parse(uri), Ok(Uri::Data(d)) if d == b"hi"), "{uri}");
        }
        assert!(parse("data:;base64,a*k=").is_err());
        assert!(parse("https://example.org/a.bin").is_err());
    }
}
