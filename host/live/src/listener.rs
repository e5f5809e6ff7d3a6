//! Connections that cannot use up what the session needs: so many at a time, and none that is idle.
//!
//! Every connection is a file descriptor, of which a program has a thousand; a frame that cannot be
//! written because of sockets that say nothing would end a night.

use axum::serve::Listener;
use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{Instant, Sleep, sleep};

/// Connections at a time. Others wait at the door of the system.
const MOST: usize = 64;
/// A connection to which nothing was sent for so long is closed: one that sends no request, or sends it
/// letter by letter. A browser that watches is sent something more often.
pub const IDLE: Duration = Duration::from_secs(20);
/// Pause after a connection that the system did not give.
const PAUSE: Duration = Duration::from_millis(500);

/// Accepts connections.
pub struct LimitedListener {
    inner: TcpListener,
    places: Arc<Semaphore>,
    idle: Duration,
}

impl LimitedListener {
    /// With [`MOST`] connections at a time, each closed when it is idle for so long.
    pub fn new(inner: TcpListener, idle: Duration) -> Self {
        let places = Arc::new(Semaphore::new(MOST));
        Self {
            inner,
            places,
            idle,
        }
    }
}

impl Listener for LimitedListener {
    type Io = Connection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Connection, SocketAddr) {
        loop {
            // The semaphore is never closed.
            let Ok(place) = self.places.clone().acquire_owned().await else {
                sleep(PAUSE).await;
                continue;
            };
            match self.inner.accept().await {
                Ok((stream, address)) => {
                    let connection = Connection {
                        stream,
                        idle: self.idle,
                        closes: Box::pin(sleep(self.idle)),
                        _place: place,
                    };
                    return (connection, address);
                }
                Err(_) => sleep(PAUSE).await,
            }
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.inner.local_addr()
    }
}

/// A connection that is closed when it is idle.
pub struct Connection {
    stream: TcpStream,
    idle: Duration,
    closes: Pin<Box<Sleep>>,
    _place: OwnedSemaphorePermit,
}

impl Connection {
    fn is_written(&mut self) {
        let at = Instant::now() + self.idle;
        self.closes.as_mut().reset(at);
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if self.closes.as_mut().poll(context).is_ready() {
            return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
        }
        Pin::new(&mut self.stream).poll_read(context, buffer)
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let written = ready!(Pin::new(&mut self.stream).poll_write(context, bytes));
        self.is_written();
        Poll::Ready(written)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::Router;
    use axum::routing::get;
    use std::io::{Read, Write};

    #[test]
    fn idle_sockets_are_closed_and_keep_nobody_out() {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .unwrap();
        let door = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        door.set_nonblocking(true).unwrap();
        let address = door.local_addr().unwrap();
        std::thread::spawn(move || {
            runtime.block_on(async {
                let listener = TcpListener::from_std(door).unwrap();
                let listener = LimitedListener::new(listener, Duration::from_millis(300));
                let router: Router = Router::new().route("/", get(|| async { "here" }));
                axum::serve(listener, router).await.unwrap();
            });
        });
        // As many as there are places, and some more; one sends its request letter by letter.
        let mut idle: Vec<std::net::TcpStream> = (0..MOST + 10)
            .map(|_| std::net::TcpStream::connect(address).unwrap())
            .collect();
        let mut slow = idle.swap_remove(0);
        let letters = std::thread::spawn(move || {
            (0..40)
                .take_while(|_| {
                    std::thread::sleep(Duration::from_millis(50));
                    slow.write_all(b"G").is_ok()
                })
                .count()
        });
        let mut asks = std::net::TcpStream::connect(address).unwrap();
        asks.set_read_timeout(Some(Duration::from_secs(10)))
            .unwrap();
        asks.write_all(b"GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n")
            .unwrap();
        let mut answer = String::new();
        asks.read_to_string(&mut answer).unwrap();
        assert!(answer.ends_with("here"), "{answer}");
        // They were closed, and not answered.
        let mut first = idle.swap_remove(0);
        first
            .set_read_timeout(Some(Duration::from_secs(10)))
            .unwrap();
        assert_eq!(first.read(&mut [0; 10]).unwrap_or(0), 0);
        assert!(letters.join().unwrap() < 40);
    }
}
