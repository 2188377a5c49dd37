//! Sends images to the viewer tev (<https://github.com/Tom94/tev>) over TCP.

use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::path::Path;
use std::str::FromStr;
use std::time::Duration;

use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

use crate::error::{Error, Result};
use crate::output::{Image, Samples};

/// The port on which tev listens unless it is told another.
const DEFAULT_PORT: u16 = 14158;
/// How long to wait for a connection, and for a viewer that reads nothing.
const PATIENCE: Duration = Duration::from_secs(10);
/// Most values in a packet: its length has 32 bits, and a viewer that draws is not to wait for long.
const MAX_VALUES: usize = 1 << 22;
/// The layer of channels that are of no use in a viewer: the film's sums.
const STATE: &str = "state.";

/// Where tev listens: `HOST[:PORT]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TevAddress {
    host: String,
    port: u16,
}

impl FromStr for TevAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        const EXPECTED: &str = "expected HOST or HOST:PORT, like localhost:14158; an IPv6 address is in brackets";
        let (host, port) = match text.rsplit_once(':') {
            // the colon of an IPv6 address without a port
            Some((_, rest)) if rest.ends_with(']') => (text, DEFAULT_PORT),
            Some((host, port)) => (host, port.parse().ok().filter(|p| *p > 0).ok_or(EXPECTED)?),
            None => (text, DEFAULT_PORT),
        };
        let is_bracketed = host.starts_with('[') && host.ends_with(']');
        let host = if is_bracketed { &host[1..host.len() - 1] } else { host };
        if host.is_empty() || host.contains(char::is_whitespace) || !is_bracketed && host.contains(':') {
            return Err(EXPECTED.into());
        }
        Ok(Self { host: host.to_owned(), port })
    }
}

/// A connection to tev, and the image that it shows.
pub struct TevViewer {
    client: TevClient,
    name: String,
    /// Size and channels of the image that tev has.
    shown: Option<([u32; 2], Vec<String>)>,
}

impl TevViewer {
    /// Connects. The image will be called as the file `output`.
    ///
    /// # Errors
    /// [`Error::Usage`] where nothing listens.
    pub fn connect(address: &TevAddress, output: &Path) -> Result<Self> {
        let stream = Self::stream(address).map_err(|e| {
            let TevAddress { host, port } = address;
            Error::Usage(format!(
                "--tev {host}:{port}: no connection ({e}); start tev there, or name the host and port that it listens on"
            ))
        })?;
        let name = output.file_name().unwrap_or(output.as_os_str()).to_string_lossy().replace('\0', "");
        Ok(Self { client: TevClient::wrap(stream), name, shown: None })
    }

    fn stream(address: &TevAddress) -> io::Result<TcpStream> {
        let mut last = io::Error::from(io::ErrorKind::NotFound);
        for address in (address.host.as_str(), address.port).to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, PATIENCE) {
                Ok(stream) => {
                    stream.set_write_timeout(Some(PATIENCE))?;
                    stream.set_nodelay(true)?;
                    return Ok(stream);
                }
                Err(e) => last = e,
            }
        }
        Err(last)
    }

    /// Shows an image in place of the one before: all channels but the film's sums; ids as the nearest floats.
    ///
    /// # Errors
    /// Those of the connection.
    pub fn send(&mut self, image: &Image) -> io::Result<()> {
        let channels: Vec<_> = image.channels.iter().filter(|c| !c.name.starts_with(STATE)).collect();
        let names: Vec<String> = channels.iter().map(|c| c.name.clone()).collect();
        let shown = ([image.width, image.height], names);
        if self.shown.as_ref() != Some(&shown) {
            self.client.send(PacketCreateImage {
                image_name: &self.name,
                grab_focus: true,
                width: image.width,
                height: image.height,
                channel_names: &shown.1,
            })?;
        }
        let width = image.width as usize;
        let rows = (MAX_VALUES / width.max(1)).clamp(1, image.height as usize);
        for channel in channels {
            for first in (0..image.height as usize).step_by(rows) {
                let range = first * width..(first + rows).min(image.height as usize) * width;
                let data: Vec<f32> = match &channel.samples {
                    Samples::F32(values) => values[range].to_vec(),
                    Samples::U32(values) => values[range].iter().map(|v| *v as f32).collect(),
                };
                self.client.send(PacketUpdateImage {
                    image_name: &self.name,
                    grab_focus: false,
                    channel_names: &[channel.name.as_str()],
                    channel_offsets: &[0],
                    channel_strides: &[1],
                    x: 0,
                    y: first as u32,
                    width: image.width,
                    height: (data.len() / width) as u32,
                    data: &data,
                })?;
            }
        }
        self.shown = Some(shown);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses() {
        let of = |text: &str| text.parse::<TevAddress>().map(|a| (a.host, a.port));
        let is = |text: &str, host: &str, port| assert_eq!(of(text), Ok((host.to_owned(), port)), "{text}");
        is("localhost", "localhost", 14158);
        is("10.0.0.7:99", "10.0.0.7", 99);
        is("[::1]", "::1", 14158);
        is("[::1]:5", "::1", 5);
        for bad in ["", ":5", "host:", "host:0", "host:70000", "::1", "a b"] {
            assert!(of(bad).is_err_and(|e| e.contains("HOST:PORT")), "{bad}");
        }
    }
}
