//! Text files as others write them: with byte order marks, in UTF-16, with any line end, and with
//! names in encodings that nobody knows.
//!
//! A name is its bytes: two that differ in a byte that is no UTF-8 are two names. So such a byte
//! becomes a character of a private plane ([`from_bytes`]), which [`bytes_of`] turns back and
//! [`shown`] makes readable.

use std::borrow::Cow;
use std::io::{Cursor, Read};
use std::path::PathBuf;

/// The character of a byte that is no UTF-8 is this far above it.
const PRIVATE: u32 = 0x10_ff00;

/// Smallest read, in bytes.
const BLOCK: usize = 1 << 18;

/// The bytes as text; [`bytes_of`] is the inverse.
pub(super) fn from_bytes(bytes: &[u8]) -> Cow<'_, str> {
    if let Ok(text) = std::str::from_utf8(bytes) {
        return Cow::Borrowed(text);
    }
    let mut text = String::with_capacity(bytes.len() + 16);
    for chunk in bytes.utf8_chunks() {
        text.push_str(chunk.valid());
        text.extend(chunk.invalid().iter().filter_map(|&b| char::from_u32(PRIVATE + u32::from(b))));
    }
    Cow::Owned(text)
}

/// The byte that a character of a text stands for, if it is one that is no UTF-8.
fn private_byte(c: char) -> Option<u8> {
    (u32::from(c)).checked_sub(PRIVATE).and_then(|b| u8::try_from(b).ok()).filter(|b| *b >= 0x80)
}

/// Whether a text has bytes that are no UTF-8.
pub(super) fn is_foreign(text: &str) -> bool {
    text.chars().any(|c| private_byte(c).is_some())
}

/// The bytes of a text.
pub(super) fn bytes_of(text: &str) -> Cow<'_, [u8]> {
    if !is_foreign(text) {
        return Cow::Borrowed(text.as_bytes());
    }
    let mut bytes = Vec::with_capacity(text.len());
    for c in text.chars() {
        match private_byte(c) {
            Some(byte) => bytes.push(byte),
            None => bytes.extend_from_slice(c.encode_utf8(&mut [0; 4]).as_bytes()),
        }
    }
    Cow::Owned(bytes)
}

/// The text for people: what is no UTF-8 is read as Latin-1, the likeliest of all encodings, and
/// its control characters are written as numbers.
pub(super) fn shown(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match private_byte(c) {
            Some(byte) if byte < 0xa0 => out.push_str(&format!("\\x{byte:02x}")),
            Some(byte) => out.push(char::from(byte)),
            None => out.push(c),
        }
    }
    out
}

/// The path whose bytes a text stands for, where the system's paths are bytes.
pub(super) fn path(bytes: &[u8]) -> PathBuf {
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        PathBuf::from(std::ffi::OsStr::from_bytes(bytes))
    }
    #[cfg(not(unix))]
    PathBuf::from(String::from_utf8_lossy(bytes).into_owned())
}

/// An encoding that the first bytes of a file show.
#[derive(Clone, Copy, PartialEq)]
enum Encoding {
    Utf16LittleEndian,
    Utf16BigEndian,
    /// UTF-8, or another in which ASCII is a byte a character.
    Bytes,
}

/// The encoding of a file that begins with these bytes, and the length of its byte order mark. What
/// we read begins with a word of ASCII, so a zero beside the first character is the other half of
/// UTF-16 without a mark.
fn encoding(start: &[u8]) -> (Encoding, usize) {
    match start {
        [0xef, 0xbb, 0xbf, ..] => (Encoding::Bytes, 3),
        [0xff, 0xfe, ..] => (Encoding::Utf16LittleEndian, 2),
        [0xfe, 0xff, ..] => (Encoding::Utf16BigEndian, 2),
        [1..=255, 0, 1..=255, 0, ..] => (Encoding::Utf16LittleEndian, 0),
        [0, 1..=255, 0, 1..=255, ..] => (Encoding::Utf16BigEndian, 0),
        _ => (Encoding::Bytes, 0),
    }
}

/// UTF-16 units as UTF-8; what is no character becomes U+FFFD.
fn utf8_of(bytes: &[u8], is_big_endian: bool) -> Vec<u8> {
    let unit = |pair: &[u8; 2]| if is_big_endian { u16::from_be_bytes(*pair) } else { u16::from_le_bytes(*pair) };
    let characters = char::decode_utf16(bytes.as_chunks::<2>().0.iter().map(unit));
    characters.map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect::<String>().into_bytes()
}

/// A whole file as text.
pub(super) fn decode(bytes: &[u8]) -> Cow<'_, str> {
    let (encoding, mark) = encoding(bytes);
    match encoding {
        Encoding::Bytes => from_bytes(&bytes[mark..]),
        other => {
            let text = utf8_of(&bytes[mark..], other == Encoding::Utf16BigEndian);
            Cow::Owned(from_bytes(&text).into_owned())
        }
    }
}

/// The lines of a text, which LF, CR LF or CR ends.
pub(super) fn lines(text: &str) -> impl Iterator<Item = &str> {
    text.split('\n').flat_map(|line| line.strip_suffix('\r').unwrap_or(line).split('\r'))
}

/// White space, zeros included: files are padded with them.
pub(super) fn trim(text: &str) -> &str {
    text.trim_matches(|c: char| c.is_ascii_whitespace() || c == '\0')
}

/// Returns the text before ` #`: names may hold a `#`, so only one after white space begins a
/// comment.
pub(super) fn without_comment(text: &str) -> &str {
    let end = text.char_indices().zip(text.chars().skip(1)).find(|((_, a), b)| a.is_ascii_whitespace() && *b == '#');
    trim(end.map_or(text, |((i, _), _)| &text[..i]))
}

/// A name and what is left of it where comments are cut off: it may hold ` #` itself, so the
/// longest comes first.
pub(super) fn uncommented(text: &str) -> impl Iterator<Item = &str> {
    /// More parts than a name has.
    const MAX_CUTS: usize = 4;
    let bytes = text.as_bytes();
    let is_cut = move |i: &usize| bytes[*i] == b'#' && *i > 0 && bytes[i - 1].is_ascii_whitespace();
    let cuts = (0..bytes.len()).rev().filter(is_cut).take(MAX_CUTS).map(|i| trim(&text[..i]));
    std::iter::once(text).chain(cuts)
}

/// Takes quotation marks off, if all of the text stands in them.
pub(super) fn unquoted(text: &str) -> &str {
    let text = trim(text);
    let inner = |mark: char| text.strip_prefix(mark).and_then(|t| t.strip_suffix(mark));
    inner('"').or_else(|| inner('\'')).unwrap_or(text)
}

/// The lines of a file, one after another, with those that a backslash continues joined.
pub(super) struct Lines<R> {
    reader: R,
    /// Number of the last line that was read, from 1.
    pub number: usize,
    block: Vec<u8>,
    /// The part of the block that has not been returned.
    start: usize,
    end: usize,
    has_ended: bool,
    joined: Vec<u8>,
    /// Number of calls of [`Lines::plain`] that find nothing yet.
    impure: usize,
}

/// Lines that need no joining, as one text.
pub(super) struct PlainLines<'a> {
    /// The lines, each with its end, LF or CR LF.
    pub text: &'a [u8],
    /// Number of the last line before them.
    pub before: usize,
}

impl Lines<Box<dyn Read>> {
    /// Reads the first bytes to find the encoding. UTF-16 is read whole.
    pub(super) fn new(mut reader: impl Read + 'static) -> std::io::Result<Self> {
        let mut first = Vec::new();
        reader.by_ref().take(4).read_to_end(&mut first)?;
        let (encoding, mark) = encoding(&first);
        let reader: Box<dyn Read> = match encoding {
            Encoding::Bytes => Box::new(Cursor::new(first.split_off(mark)).chain(reader)),
            other => {
                reader.read_to_end(&mut first)?;
                Box::new(Cursor::new(utf8_of(&first[mark..], other == Encoding::Utf16BigEndian)))
            }
        };
        Ok(Self {
            reader,
            number: 0,
            block: vec![0; BLOCK],
            start: 0,
            end: 0,
            has_ended: false,
            joined: Vec::new(),
            impure: 0,
        })
    }
}

impl<R: Read> Lines<R> {
    /// The next line, without its end.
    pub(super) fn next(&mut self) -> std::io::Result<Option<Cow<'_, str>>> {
        let Some((mut from, mut to)) = self.physical()? else { return Ok(None) };
        if !is_continued(&self.block[from..to]) && memchr::memchr(0, &self.block[from..to]).is_none() {
            return Ok(Some(from_bytes(&self.block[from..to])));
        }
        self.joined.clear();
        loop {
            let line = self.block[from..to].trim_ascii_end();
            let is_continued = is_continued(line);
            let kept = if is_continued { &line[..line.len() - 1] } else { line };
            self.joined.extend(kept.iter().map(|&b| if b == 0 { b' ' } else { b }));
            if !is_continued {
                break;
            }
            self.joined.push(b' ');
            let Some(next) = self.physical()? else { break };
            (from, to) = next;
        }
        Ok(Some(from_bytes(&self.joined)))
    }

    /// The lines of the next `size` bytes or more at once; `None` if they have to be read one by
    /// one, because there is a backslash among them, which may join two, a zero or a lone CR, or
    /// because they are the last.
    pub(super) fn plain(&mut self, size: usize) -> std::io::Result<Option<PlainLines<'_>>> {
        if self.impure > 0 {
            self.impure -= 1;
            return Ok(None);
        }
        while self.end - self.start < size && !self.has_ended {
            self.read_more()?;
        }
        let unread = &self.block[self.start..self.end];
        let Some(last) = memchr::memrchr(b'\n', unread) else { return Ok(None) };
        let text = &unread[..=last];
        let count = memchr::memchr_iter(b'\n', text).count();
        let is_plain = memchr::memchr2(b'\\', 0, text).is_none()
            && memchr::memchr_iter(b'\r', text).all(|at| text[at + 1] == b'\n');
        if !is_plain {
            self.impure = count;
            return Ok(None);
        }
        let before = self.number;
        self.number += count;
        let start = self.start;
        self.start += last + 1;
        Ok(Some(PlainLines { text: &self.block[start..=start + last], before }))
    }

    /// Where in the block the next line is, which LF, CR LF or CR ends.
    fn physical(&mut self) -> std::io::Result<Option<(usize, usize)>> {
        let mut searched = self.start;
        loop {
            let found = memchr::memchr2(b'\n', b'\r', &self.block[searched..self.end]).map(|i| searched + i);
            // whether LF follows a CR must be known
            if let Some(at) = found.filter(|&at| self.block[at] == b'\n' || at + 1 < self.end || self.has_ended) {
                let line = (self.start, at);
                let is_pair = self.block[at] == b'\r' && at + 1 < self.end && self.block[at + 1] == b'\n';
                self.start = at + 1 + usize::from(is_pair);
                self.number += 1;
                return Ok(Some(line));
            }
            searched = found.unwrap_or(self.end) - self.start;
            if self.has_ended {
                let line = (self.start, self.end);
                self.start = self.end;
                self.number += usize::from(line.0 < line.1);
                return Ok((line.0 < line.1).then_some(line));
            }
            self.read_more()?;
        }
    }

    /// Moves what is left to the front of the block, and reads as much as there is room for.
    fn read_more(&mut self) -> std::io::Result<()> {
        self.block.copy_within(self.start..self.end, 0);
        (self.start, self.end) = (0, self.end - self.start);
        if self.block.len() - self.end < BLOCK / 2 {
            self.block.resize(self.block.len() * 2, 0);
        }
        let count = loop {
            match self.reader.read(&mut self.block[self.end..]) {
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                result => break result?,
            }
        };
        self.end += count;
        self.has_ended = count == 0;
        Ok(())
    }
}

/// Whether a backslash at the end of a line joins the next one to it. In a comment it is the end of
/// a path, and after a byte that is no UTF-8 the second half of a character of GBK or Shift JIS.
fn is_continued(line: &[u8]) -> bool {
    let line = line.trim_ascii_end();
    let [.., before, b'\\'] = line else { return line == b"\\" };
    let is_character = *before >= 0x80 && std::str::from_utf8(line).is_err();
    !is_character && line.trim_ascii_start().first() != Some(&b'#')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Vec<(usize, String)> {
        let mut lines = Lines::new(Cursor::new(bytes.to_vec())).unwrap();
        let mut out = Vec::new();
        while let Some(line) = lines.next().unwrap().map(Cow::into_owned) {
            out.push((lines.number, line));
        }
        out
    }

    fn texts(bytes: &[u8]) -> Vec<String> {
        read(bytes).into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn names_are_bytes() {
        let all: Vec<Vec<u8>> = [&b"r\xe9d"[..], b"r\xe8d", b"r\xc3\xa9d", b"\xc4\xbe\xc4\xbe", b"\x80\xff", b"red"]
            .map(<[u8]>::to_vec)
            .into();
        let texts: Vec<String> = all.iter().map(|b| from_bytes(b).into_owned()).collect();
        for (bytes, text) in all.iter().zip(&texts) {
            assert_eq!(bytes_of(text).as_ref(), bytes);
            assert_eq!(texts.iter().filter(|t| *t == text).count(), 1);
        }
        assert_eq!((shown(&texts[0]), shown(&texts[4]), shown("red")), ("réd".into(), "\\x80ÿ".into(), "red".into()));
    }

    #[test]
    fn every_line_end() {
        assert_eq!(read(b"a\nb\r\nc\rd"), [(1, "a".into()), (2, "b".into()), (3, "c".into()), (4, "d".into())]);
        assert_eq!(texts(b"a\r"), ["a"]);
        assert_eq!(texts(b"\r\n\n\r"), ["", "", ""]);
        assert_eq!(texts(b""), [""; 0]);
        // CR LF across the end of a block, and lines longer than one
        for length in [BLOCK - 2, BLOCK - 1, BLOCK, 5 * BLOCK] {
            let long = "x".repeat(length);
            assert_eq!(texts(format!("{long}\r\ny\r{long}").as_bytes()), [&long[..], "y", &long]);
        }
        assert_eq!(lines("a\nb\r\nc\rd").collect::<Vec<_>>(), ["a", "b", "c", "d"]);
    }

    #[test]
    fn continued_lines() {
        assert_eq!(read(b"f 1 \\\n2 \\\r\n3\nv"), [(3, "f 1  2  3".into()), (4, "v".into())]);
        assert_eq!(texts(b"a\\"), ["a "]);
        assert_eq!(texts(b"# in C:\\models\\\nv 1"), ["# in C:\\models\\", "v 1"]);
        // Shift JIS has backslashes as second bytes
        assert_eq!(texts(b"usemtl \x95\x5c\nf 1").len(), 2);
        assert_eq!(texts(b"v 0\0 1\0\n\0\0"), ["v 0  1 ", "  "]);
    }

    #[test]
    fn encodings() {
        for text in ["mtllib a.mtl\nv 0\n", "usemtl \u{6728}\n"] {
            let little: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
            let big: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
            let marked = |mark: &[u8], body: &[u8]| [mark, body].concat();
            let files = [
                marked(b"\xef\xbb\xbf", text.as_bytes()),
                marked(b"\xff\xfe", &little),
                marked(b"\xfe\xff", &big),
                little,
                big,
                text.into(),
            ];
            for file in files {
                assert_eq!(decode(&file), text);
                assert_eq!(texts(&file).join("\n") + "\n", text);
            }
        }
        assert_eq!(texts(b"\xef\xbb\xbf"), [""; 0]);
    }

    #[test]
    fn parts_of_lines() {
        assert_eq!(without_comment("Material #25 # a comment"), "Material");
        assert_eq!((without_comment("a#b"), without_comment("\t# c"), trim(" a\0\0")), ("a#b", "", "a"));
        let name = "Material #25 # a comment";
        assert_eq!(uncommented(name).collect::<Vec<_>>(), [name, "Material #25", "Material"]);
        assert_eq!((unquoted("\"my lib.mtl\""), unquoted("'a'"), unquoted("a\"")), ("my lib.mtl", "a", "a\""));
    }
}
