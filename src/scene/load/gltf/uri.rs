//! URIs of buffers and images: data URIs, and relative paths with percent-encoding, also as
//! exporters get them wrong.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use crate::scene::load::confine;
use crate::scene::load::find::percent_decoded;

/// Target of a URI.
pub(super) enum Uri {
    /// The bytes of a data URI.
    Data(Vec<u8>),
    /// Paths, relative to the glTF file unless absolute: the one that the URI means, then what else
    /// its writer may have meant.
    Paths(Vec<PathBuf>),
}

/// Exporters disagree on padding, and on the bits beyond the last byte; the length says it all
/// anyway.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// `text` without a prefix, in capitals or not.
fn strip_prefix<'a>(text: &'a str, prefix: &str) -> Option<&'a str> {
    let head = text.get(..prefix.len())?;
    head.eq_ignore_ascii_case(prefix).then(|| &text[prefix.len()..])
}

/// Whether the bytes are in the URI itself.
pub(super) fn is_data(uri: &str) -> bool {
    strip_prefix(uri.trim_start(), "data:").is_some()
}

/// Reads a URI.
///
/// # Errors
/// What is wrong with it, in words.
pub(super) fn parse(uri: &str) -> Result<Uri, String> {
    if let Some(rest) = strip_prefix(uri.trim_start(), "data:") {
        let (head, data) = rest.split_once(',').ok_or("has a data URI without a comma")?;
        let data = percent_decoded(data.as_bytes());
        let is_base64 = head.rsplit(';').next().is_some_and(|last| last.trim().eq_ignore_ascii_case("base64"));
        if !is_base64 {
            return Ok(Uri::Data(data.into_owned()));
        }
        let text = standard_base64(&data);
        return BASE64.decode(&text).map(Uri::Data).map_err(|e| format!("has a data URI with broken base64 ({e})"));
    }
    let local = match strip_prefix(uri, "file:") {
        Some(rest) => file_path(rest),
        None => uri,
    };
    // a letter before `:` is a drive of Windows
    if let Some((scheme, _)) = local.split_once("://")
        && scheme.len() > 1
        && scheme.bytes().all(|b| b.is_ascii_alphanumeric() || b"+-.".contains(&b))
    {
        return Err(format!("is at {scheme}://, but skylit reads local files only: download it first"));
    }
    Ok(Uri::Paths(paths(local)?))
}

/// The path of a `file:` URI after its scheme: `//host/path`, `/path` or `path`.
fn file_path(rest: &str) -> &str {
    let Some(authority) = rest.strip_prefix("//") else { return rest };
    // `file://a/b` is meant to be a relative path by whoever writes it into a glTF file, a machine
    // of that name by the standard
    strip_prefix(authority, "localhost/").map_or(authority, |path| &authority[authority.len() - path.len() - 1..])
}

/// The paths that `uri` may mean, the likeliest first: escapes decoded and backslashes as slashes,
/// without a query and a fragment; then, for files with such names, with fewer of these; an
/// absolute path of another machine last, as a file name beside the glTF file.
fn paths(uri: &str) -> Result<Vec<PathBuf>, String> {
    let decoded =
        String::from_utf8(percent_decoded(uri.as_bytes()).into_owned()).map_err(|_| "has a URI that is not UTF-8")?;
    let slashes = decoded.replace('\\', "/");
    let mut names = vec![slashes.clone(), decoded, uri.replace('\\', "/"), uri.to_owned()];
    if let Some(end) = uri.find(['?', '#']) {
        let cut = String::from_utf8(percent_decoded(&uri.as_bytes()[..end]).into_owned());
        names.extend(cut.map(|cut| cut.replace('\\', "/")));
    }
    let is_absolute = |name: &str| name.starts_with('/') || name.as_bytes().get(1) == Some(&b':');
    for name in [slashes, uri.replace('\\', "/")].into_iter().filter(|name| is_absolute(name)) {
        names.push(name.trim_start_matches('/').to_owned());
        names.extend(name.rsplit('/').next().filter(|name| !name.is_empty()).map(str::to_owned));
    }
    let mut paths: Vec<PathBuf> = Vec::new();
    for name in names {
        let path = PathBuf::from(name);
        if !paths.contains(&path) {
            paths.push(path);
        }
    }
    Ok(paths)
}

/// The first of the paths that is a file in `folder`; the first of all if none is. `confine`: the
/// folder without links that files have to lie below. `None` where a file elsewhere is meant.
pub(super) fn resolve(paths: &[PathBuf], folder: &Path, confine: Option<&Path>) -> Option<PathBuf> {
    if let Some(confine) = confine {
        let from = std::fs::canonicalize(folder.join(".")).ok()?;
        let may = |path: &&PathBuf| !confine::leaves(confine, &from, path);
        let found =
            paths.iter().filter(may).find_map(|path| confine::below(confine, &from.join(path)).filter(|p| p.is_file()));
        if found.is_some() || !paths.iter().all(|path| may(&path)) {
            return found;
        }
        return paths.first().map(|path| folder.join(path));
    }
    let mut joined = paths.iter().map(|path| folder.join(path));
    let found = joined.clone().find(|path| path.is_file());
    Some(found.or_else(|| joined.next()).unwrap_or_else(|| folder.to_owned()))
}

/// Base64 of the standard alphabet, without the line breaks of e-mails, of what may be of the
/// alphabet for URLs.
fn standard_base64(text: &[u8]) -> Cow<'_, [u8]> {
    if !text.iter().any(|b| b.is_ascii_whitespace() || matches!(b, b'-' | b'_')) {
        return text.into();
    }
    let standard = |b: &u8| match b {
        b'-' => Some(b'+'),
        b'_' => Some(b'/'),
        b if b.is_ascii_whitespace() => None,
        b => Some(*b),
    };
    text.iter().filter_map(standard).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_as_exporters_write_it() {
        assert_eq!(&*percent_decoded(b"a%20b%2Fc%zz%"), b"a b/c%zz%");
        for uri in [
            "data:application/octet-stream;base64,aGk=",
            "data:;base64,aGk",
            "data:,hi",
            "data:;base64,aGk%3D",
            "DATA:;BASE64,aGk=",
            "Data:application/gltf-buffer;charset=utf-8; base64,aG\r\nk=\n",
            " data:;base64,aG%0Ak",
            // trailing bits that are not zero
            "data:;base64,aGl",
        ] {
            assert!(matches!(parse(uri), Ok(Uri::Data(d)) if d == b"hi"), "{uri}");
        }
        assert!(matches!(parse("data:;base64,-_-_"), Ok(Uri::Data(d)) if d == [0xfb, 0xff, 0xbf]));
        assert!(parse("data:;base64,a*k=").is_err() && parse("data:;base64").is_err());
        assert!(parse("https://example.org/a.bin").is_err());
    }

    #[test]
    fn the_path_that_is_meant_comes_first() {
        let all = |uri: &str| match parse(uri) {
            Ok(Uri::Paths(paths)) => paths.iter().map(|p| p.to_string_lossy().into_owned()).collect::<Vec<_>>(),
            _ => panic!("{uri}"),
        };
        assert_eq!(all("a%20b/c.png"), ["a b/c.png", "a%20b/c.png"]);
        assert_eq!(all("a b.png"), ["a b.png"]);
        assert_eq!(all("maps\\t.png"), ["maps/t.png", "maps\\t.png"]);
        assert_eq!(all("maps%5Ct.png")[0], "maps/t.png");
        assert_eq!(all("t.png?v=2"), ["t.png?v=2", "t.png"]);
        assert_eq!(all("file:///home/x/t.png"), ["/home/x/t.png", "home/x/t.png", "t.png"]);
        assert_eq!(all("FILE://localhost/x/t.png")[0], "/x/t.png");
        assert_eq!(all("file:t.png"), ["t.png"]);
        assert_eq!(all("file://t.png"), ["t.png"]);
        assert_eq!(all("C:\\x\\t.png").last().unwrap(), "t.png");
    }
}
