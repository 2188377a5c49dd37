//! Videos, MP4, WebM and GIF, by the program ffmpeg, which is asked for when there is one to write.

use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use super::png::Colour;
use super::{AnimationFormat, check_size};
use crate::error::{Error, Result};
use crate::files::AtomicFile;

/// Where ffmpeg writes: its standard output, which is a file, so that it can go back in it.
#[cfg(unix)]
const OUTPUT: &str = "file:/dev/fd/1";
#[cfg(not(unix))]
const OUTPUT: &str = "pipe:1";

impl AnimationFormat {
    /// How ffmpeg encodes it. Players want sides of an even number of pixels: an odd one gets a
    /// black row or column.
    fn ffmpeg_arguments(self, has_alpha: bool) -> Vec<&'static str> {
        const EVEN: &str = "pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv";
        const COLOURS: [&str; 6] = ["-color_primaries", "bt709", "-color_trc", "iec61966-2-1", "-colorspace", "bt709"];
        let format = if has_alpha { "yuva420p" } else { "yuv420p" };
        let encoded: &[&str] = match self {
            Self::Mp4 if cfg!(unix) => &["-c:v", "libx264", "-crf", "16", "-movflags", "+faststart", "-f", "mp4"],
            Self::Mp4 => &["-c:v", "libx264", "-crf", "16", "-movflags", "frag_keyframe+empty_moov", "-f", "mp4"],
            Self::WebM => &["-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0", "-row-mt", "1", "-f", "webm"],
            Self::Apng => &["-f", "apng", "-plays", "0"],
            Self::Gif => {
                return vec!["-vf", "split[a][b];[a]palettegen[p];[b][p]paletteuse", "-loop", "0", "-f", "gif"];
            }
        };
        [&["-vf", EVEN, "-pix_fmt", format], &COLOURS[..], encoded].concat()
    }
}

/// A video being written. [`VideoWriter::finish`] makes the file; dropped before, none is left.
pub struct VideoWriter {
    encoder: Child,
    // taken when the video is finished
    file: Option<AtomicFile>,
    path: PathBuf,
    frame_bytes: usize,
}

impl VideoWriter {
    /// Starts a video that will be `path`, of 8-bit sRGB frames.
    ///
    /// # Errors
    /// [`Error::Output`] where there is no ffmpeg, or the file cannot be written.
    pub fn create(path: &Path, [width, height]: [u32; 2], colour: Colour, fps: f64) -> Result<Self> {
        check_size(width, height)?;
        let format = AnimationFormat::from_path(path).unwrap_or(AnimationFormat::Mp4);
        let mut file = AtomicFile::create(path)?;
        let pixels = match colour {
            Colour::Grey => "gray",
            Colour::GreyAlpha => "ya8",
            Colour::Rgb => "rgb24",
            Colour::Rgba => "rgba",
        };
        let (size, rate) = (format!("{width}x{height}"), fps.to_string());
        let encoder = Command::new("ffmpeg")
            .args(["-nostdin", "-loglevel", "error", "-f", "rawvideo", "-pixel_format", pixels])
            .args(["-video_size", &size, "-framerate", &rate, "-i", "pipe:0"])
            .args(format.ffmpeg_arguments(colour.has_alpha()))
            .args(["-y", OUTPUT])
            .stdin(Stdio::piped())
            .stdout(file.handle()?)
            .stderr(Stdio::piped())
            .spawn();
        let encoder = encoder.map_err(|e| {
            let why = match e.kind() {
                io::ErrorKind::NotFound => {
                    "ffmpeg is needed for it and is not installed; an .apng needs none".to_owned()
                }
                _ => format!("ffmpeg does not start: {e}"),
            };
            file.failed(&io::Error::other(why))
        })?;
        let frame_bytes = width as usize * height as usize * colour.channels();
        Ok(Self { encoder, file: Some(file), path: path.to_owned(), frame_bytes })
    }

    /// Adds a frame of 8-bit sRGB values, rows from the top.
    ///
    /// # Errors
    /// [`Error::Usage`] for another number of values; [`Error::Output`] with what ffmpeg says.
    pub fn add_bytes(&mut self, bytes: &[u8]) -> Result<()> {
        if bytes.len() != self.frame_bytes {
            let (path, expected) = (self.path.display(), self.frame_bytes);
            return Err(Error::Usage(format!("{path}: a frame of {} values instead of {expected}", bytes.len())));
        }
        let written = match &mut self.encoder.stdin {
            Some(frames) => frames.write_all(bytes),
            None => Ok(()),
        };
        written.map_err(|e| self.failure(&e))
    }

    /// Finishes the video and moves the file to its path.
    ///
    /// # Errors
    /// [`Error::Output`] with what ffmpeg says; then there is no file.
    pub fn finish(mut self) -> Result<()> {
        // without more frames ffmpeg ends
        drop(self.encoder.stdin.take());
        match self.encoder.wait() {
            Ok(status) if status.success() => {}
            Ok(status) => return Err(self.failure(&io::Error::other(format!("ffmpeg ended with {status}")))),
            Err(e) => return Err(self.failure(&e)),
        }
        self.file.take().map_or(Ok(()), AtomicFile::commit)
    }

    /// The error of an encoder that has failed, with the last line that it printed.
    fn failure(&mut self, error: &io::Error) -> Error {
        drop(self.encoder.stdin.take());
        let mut said = String::new();
        if let Some(messages) = &mut self.encoder.stderr {
            let _ = messages.take(1 << 16).read_to_string(&mut said);
        }
        match said.lines().rev().find(|line| !line.trim().is_empty()) {
            Some(line) => Error::write(&self.path, &io::Error::other(format!("ffmpeg: {}", line.trim()))),
            None => Error::write(&self.path, error),
        }
    }
}

impl Drop for VideoWriter {
    fn drop(&mut self) {
        // an encoder that has ended cannot be killed, which is no error
        let _ = self.encoder.kill();
        let _ = self.encoder.wait();
    }
}
