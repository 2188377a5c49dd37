//! Sends images to the viewer tev (<https://github.com/Tom94/tev>) over TCP.

use std::io;
use std::net::{Shutdown, TcpStream, ToSocketAddrs};
use std::path::Path;
use std::str::FromStr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

use crate::error::{Error, Result};
use crate::output::{Channel, Image, Samples};
use crate::terminal::interrupt;

/// The port on which tev listens unless it is told another.
const DEFAULT_PORT: u16 = 14158;
/// How long to wait for a connection, and for a viewer to read an image.
const PATIENCE: Duration = Duration::from_secs(10);
/// How often it is looked whether the user has interrupted the program.
const INTERVAL: Duration = Duration::from_millis(50);
/// Most values in a packet: its length has 32 bits, and a viewer that draws is not to wait for
/// long.
const MAX_VALUES: usize = 1 << 20;
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
    /// The client's socket, to end what it waits for.
    socket: TcpStream,
    name: String,
    /// Size and channels of the image that tev has.
    shown: Option<([u32; 2], Vec<String>)>,
    /// How long it may take to read an image.
    patience: Duration,
}

/// Why an image is not shown.
#[derive(Debug)]
pub enum SendError {
    /// The user has interrupted the program.
    Interrupted,
    /// The viewer or the connection fails, for this reason.
    Failed(String),
}

impl TevViewer {
    /// Connects. The image will be called as the file `output`.
    ///
    /// # Errors
    /// [`Error::Usage`] where nothing listens, [`Error::Interrupted`] after Ctrl-C.
    pub fn connect(address: &TevAddress, output: &Path) -> Result<Self> {
        let TevAddress { host, port } = address;
        let wrong = |why: String| {
            Error::Usage(format!(
                "--tev {host}:{port}: no connection ({why}); start tev there, or name the host and port that it listens on"
            ))
        };
        // looking up a name and connecting cannot be interrupted: they are left behind
        let (sender, receiver) = channel();
        let wanted = address.clone();
        std::thread::Builder::new()
            .name("tev".into())
            // nobody waits for it any more after a while
            .spawn(move || drop(sender.send(Self::open(&wanted))))
            .map_err(|e| wrong(e.to_string()))?;
        let start = Instant::now();
        let stream = loop {
            match receiver.recv_timeout(INTERVAL) {
                Ok(opened) => break opened.map_err(|e| wrong(e.to_string()))?,
                Err(RecvTimeoutError::Timeout) if start.elapsed() < PATIENCE => interrupt::check()?,
                Err(_) => return Err(wrong(format!("no answer within {} s", PATIENCE.as_secs()))),
            }
        };
        let socket = stream.try_clone().map_err(|e| wrong(e.to_string()))?;
        let name = output.file_name().unwrap_or(output.as_os_str()).to_string_lossy().replace('\0', "");
        Ok(Self { client: TevClient::wrap(stream), socket, name, shown: None, patience: PATIENCE })
    }

    fn open(address: &TevAddress) -> io::Result<TcpStream> {
        let mut last = io::Error::from(io::ErrorKind::NotFound);
        for address in (address.host.as_str(), address.port).to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, PATIENCE) {
                Ok(stream) => {
                    stream.set_nodelay(true)?;
                    return Ok(stream);
                }
                Err(e) => last = e,
            }
        }
        Err(last)
    }

    /// Shows an image in place of the one before: all channels but the film's sums; ids as the
    /// nearest floats. The viewer has [`PATIENCE`] for all of it. After an error the connection is
    /// of no use any more.
    ///
    /// # Errors
    /// Those of the connection, and Ctrl-C.
    pub fn send(&mut self, image: &Image) -> Result<(), SendError> {
        let channels: Vec<&Channel> = image.channels.iter().filter(|c| !c.name.starts_with(STATE)).collect();
        let values = u64::from(image.width) * u64::from(image.height) * channels.len() as u64;

        let (sent, socket, patience) = (AtomicU64::new(0), &self.socket, self.patience);
        let sender = Sender { client: &mut self.client, name: &self.name, shown: &mut self.shown, sent: &sent };
        let (start, caller) = (Instant::now(), std::thread::current());
        // a viewer that reads a little now and then keeps every single write alive: they are made
        // on a thread, and all of them have one time limit
        let (outcome, ended) = std::thread::scope(|scope| {
            let work = move || {
                let outcome = sender.send(image, &channels);
                caller.unpark();
                outcome
            };

            let thread = std::thread::Builder::new().name("tev".into()).spawn_scoped(scope, work);
            let thread = match thread {
                Ok(thread) => thread,
                Err(e) => return (Err(e), None),
            };

            // until all is sent, the user interrupts, or the time is over
            let mut ended = None;
            while !thread.is_finished() {
                let why = match () {
                    () if interrupt::requested() => Some(SendError::Interrupted),
                    () if start.elapsed() >= patience => {
                        let share = 100.0 * sent.load(Ordering::Relaxed) as f64 / values.max(1) as f64;
                        Some(SendError::Failed(format!(
                            "in {} s the viewer has read about {share:.0} % of an image",
                            patience.as_secs()
                        )))
                    }
                    () => None,
                };
                if why.is_some() {
                    ended = why;
                    // its write fails
                    let _ = socket.shutdown(Shutdown::Both);
                    break;
                }
                std::thread::park_timeout(INTERVAL);
            }
            let outcome = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            (outcome, ended)
        });

        match (ended, outcome) {
            (Some(ended), _) => Err(ended),
            (None, outcome) => outcome.map_err(|e| SendError::Failed(e.to_string())),
        }
    }
}

/// Sends one image.
struct Sender<'a> {
    client: &'a mut TevClient,
    name: &'a str,
    shown: &'a mut Option<([u32; 2], Vec<String>)>,
    /// Number of values that have been sent.
    sent: &'a AtomicU64,
}

impl Sender<'_> {
    fn send(self, image: &Image, channels: &[&Channel]) -> io::Result<()> {
        // the protocol ends names with a zero
        let named = |channel: &Channel| channel.name.replace('\0', "");
        let shown = ([image.width, image.height], channels.iter().map(|c| named(c)).collect::<Vec<_>>());
        if self.shown.as_ref() != Some(&shown) {
            self.client.send(PacketCreateImage {
                image_name: self.name,
                grab_focus: true,
                width: image.width,
                height: image.height,
                channel_names: &shown.1,
            })?;
        }
        let width = image.width as usize;
        let rows = (MAX_VALUES / width.max(1)).clamp(1, image.height as usize);
        for (channel, name) in channels.iter().zip(&shown.1) {
            for first in (0..image.height as usize).step_by(rows) {
                let range = first * width..(first + rows).min(image.height as usize) * width;
                let data: Vec<f32> = match &channel.samples {
                    Samples::F32(values) => values[range].to_vec(),
                    Samples::U32(values) => values[range].iter().map(|v| *v as f32).collect(),
                };
                self.client.send(PacketUpdateImage {
                    image_name: self.name,
                    grab_focus: false,
                    channel_names: &[name.as_str()],
                    channel_offsets: &[0],
                    channel_strides: &[1],
                    x: 0,
                    y: first as u32,
                    width: image.width,
                    height: (data.len() / width) as u32,
                    data: &data,
                })?;
                self.sent.fetch_add(data.len() as u64, Ordering::Relaxed);
            }
        }
        *self.shown = Some(shown);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;
    use std::net::TcpListener;

    use super::*;

    /// A viewer that reads a little now and then keeps every write alive, and is left alone after
    /// its time for the image.
    #[test]
    fn a_viewer_that_drips_is_left() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string().parse().unwrap();
        let drips = std::thread::spawn(move || {
            let (mut connection, _) = listener.accept().unwrap();
            let mut buffer = vec![0; 100_000];
            while connection.read(&mut buffer).is_ok_and(|n| n > 0) {
                std::thread::sleep(Duration::from_millis(200));
            }
        });
        let mut viewer = TevViewer::connect(&address, Path::new("a.exr")).unwrap();
        viewer.patience = Duration::from_secs(1);
        let channel = |name: &str| Channel { name: name.into(), samples: Samples::F32(vec![0.5; 4 << 20]) };
        let image =
            Image { width: 2048, height: 2048, channels: ["R", "G", "B"].map(channel).to_vec(), metadata: Vec::new() };
        let start = Instant::now();
        let error = viewer.send(&image).unwrap_err();
        assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
        let SendError::Failed(why) = error else { panic!("{error:?}") };
        assert!(why.contains("in 1 s the viewer has read about"), "{why}");
        drop(viewer);
        drips.join().unwrap();
    }

    #[test]
    fn addresses() {
        let address = |text: &str| text.parse::<TevAddress>().map(|a| (a.host, a.port));
        let is = |text: &str, host: &str, port| assert_eq!(address(text), Ok((host.to_owned(), port)), "{text}");
        is("localhost", "localhost", 14158);
        is("10.0.0.7:99", "10.0.0.7", 99);
        is("[::1]", "::1", 14158);
        is("[::1]:5", "::1", 5);
        for bad in ["", ":5", "host:", "host:0", "host:70000", "::1", "a b"] {
            assert!(address(bad).is_err_and(|e| e.contains("HOST:PORT")), "{bad}");
        }
    }
}
