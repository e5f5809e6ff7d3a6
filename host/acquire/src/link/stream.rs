//! Real transports: a serial port, or a Unix socket (QEMU, tests). A thread reads, so that nothing
//! is lost while the host computes.

use std::io::{self, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crate::link::Transport;

/// How long the reader sleeps in the system before it looks whether it is still wanted.
const READ_TIMEOUT: Duration = Duration::from_millis(100);

/// A byte stream of the operating system.
pub struct StreamTransport {
    writer: Box<dyn Write + Send>,
    chunks: Receiver<io::Result<Vec<u8>>>,
    stop: Arc<AtomicBool>,
    reader: Option<JoinHandle<()>>,
    opened: Instant,
    opened_us: u64,
}

impl StreamTransport {
    /// Opens a serial port, 8N1 without flow control, for nobody else.
    pub fn open_serial(path: &str, baud: u32) -> io::Result<Self> {
        let port = serialport::new(path, baud).timeout(READ_TIMEOUT).open()?;
        let reader = port.try_clone()?;
        Self::start(reader, port)
    }

    /// Connects to a Unix socket.
    #[cfg(unix)]
    pub fn open_unix(path: &std::path::Path) -> io::Result<Self> {
        let socket = std::os::unix::net::UnixStream::connect(path)?;
        socket.set_read_timeout(Some(READ_TIMEOUT))?;
        Self::start(socket.try_clone()?, socket)
    }

    /// From the two ends of any stream. Reads must return now and then with `TimedOut` or
    /// `WouldBlock`, or the transport cannot be closed.
    pub fn start(
        mut from: impl Read + Send + 'static,
        to: impl Write + Send + 'static,
    ) -> io::Result<Self> {
        let (sender, chunks) = mpsc::channel();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let read = move || {
            let mut buffer = [0; 4096];
            while !stopped.load(Ordering::Relaxed) {
                let chunk = match from.read(&mut buffer) {
                    Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
                    Ok(n) => Ok(buffer[..n].to_vec()),
                    Err(error) if is_only_silence(&error) => continue,
                    Err(error) => Err(error),
                };
                let ended = chunk.is_err();
                if sender.send(chunk).is_err() || ended {
                    return;
                }
            }
        };
        let reader = std::thread::Builder::new()
            .name("link-reader".into())
            .spawn(read)?;
        let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH);
        Ok(Self {
            writer: Box::new(to),
            chunks,
            stop,
            reader: Some(reader),
            opened: Instant::now(),
            opened_us: since_epoch.unwrap_or_default().as_micros() as u64,
        })
    }
}

impl Transport for StreamTransport {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.writer.write_all(bytes)?;
        self.writer.flush()
    }

    fn receive(&mut self, out: &mut Vec<u8>, timeout_us: u64) -> io::Result<()> {
        match self.chunks.recv_timeout(Duration::from_micros(timeout_us)) {
            Ok(chunk) => out.extend(chunk?),
            Err(RecvTimeoutError::Timeout) => return Ok(()),
            Err(RecvTimeoutError::Disconnected) => {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
        }
        while let Ok(chunk) = self.chunks.try_recv() {
            out.extend(chunk?);
        }
        Ok(())
    }

    fn now_us(&self) -> u64 {
        self.opened_us + self.opened.elapsed().as_micros() as u64
    }
}

impl Drop for StreamTransport {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(reader) = self.reader.take() {
            // A reader that panicked has nothing left to say.
            let _ = reader.join();
        }
    }
}

fn is_only_silence(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted
    )
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::net::UnixListener;

    use super::*;

    #[test]
    fn bytes_pass_both_ways_and_a_closed_end_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        let listener = UnixListener::bind(&path).unwrap();
        let mut transport = StreamTransport::open_unix(&path).unwrap();
        let (mut peer, _) = listener.accept().unwrap();

        transport.send(b"ask").unwrap();
        let mut asked = [0; 3];
        peer.read_exact(&mut asked).unwrap();
        assert_eq!(&asked, b"ask");

        let mut got = Vec::new();
        transport.receive(&mut got, 1000).unwrap();
        assert!(got.is_empty());
        peer.write_all(b"answer").unwrap();
        while got.len() < 6 {
            transport.receive(&mut got, 1_000_000).unwrap();
        }
        assert_eq!(got, b"answer");

        drop(peer);
        assert!(transport.receive(&mut got, 2_000_000).is_err());
    }
}
