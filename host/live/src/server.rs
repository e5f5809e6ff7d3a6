//! The server: a thread of its own, which only reads what the session's events have left on the board.

use crate::dashboard::Dashboard;
use crate::guard::{Guard, random_hex};
use crate::listener::{IDLE, LimitedListener};
use crate::page;
use crate::thumbnail::Thumbnail;
use axum::Router;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::header::{self, HeaderName, HeaderValue};
use axum::http::{Method, StatusCode};
use axum::middleware::{self, Next};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use futures_core::Stream;
use gonia_acquire::capture::{Orders, SessionEvent, Watch};
use gonia_acquire::session::{SessionEnd, SessionFolder};
use gonia_formats::FileError;
use gonia_rig::Target;
use std::convert::Infallible;
use std::future::Future;
use std::net::{SocketAddr, TcpListener};
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot, watch};

/// A browser is sent changes no more often than this.
const TELL_EVERY: Duration = Duration::from_millis(200);
/// Browsers that watch at a time.
const MOST_BROWSERS: usize = 32;
/// For so long the last changes are sent to the browsers.
const LAST_WORD: Duration = Duration::from_millis(600);

/// Why there is no live page.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// Other computers of the network could look.
    #[error(
        "the live page at {0} could be seen from other computers: give a loopback address such as 127.0.0.1:8080, or add --serve-anywhere"
    )]
    NotLoopback(SocketAddr),
    /// The port is taken, or the address is not this computer's.
    #[error(
        "the live page cannot be served at {address} ({source}); give another port with --serve, or 0 for any that is free"
    )]
    Address {
        /// Which.
        address: SocketAddr,
        /// What the system says.
        source: std::io::Error,
    },
    /// The system has no thread or no random numbers.
    #[error("the live page cannot be started ({0}); try again, or leave --serve out")]
    System(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// What is already measured cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
}

/// An address that is taken, before anything else of a session begins.
#[derive(Debug)]
pub struct Listening(TcpListener);

impl Listening {
    /// Takes an address; one that other computers can reach only with `anywhere`.
    ///
    /// # Errors
    /// As [`LiveError::NotLoopback`] and [`LiveError::Address`] say.
    pub fn at(address: SocketAddr, anywhere: bool) -> Result<Self, LiveError> {
        if !anywhere && !address.ip().is_loopback() {
            return Err(LiveError::NotLoopback(address));
        }
        let bound = TcpListener::bind(address).and_then(|listener| {
            listener.set_nonblocking(true)?;
            Ok(listener)
        });
        bound
            .map(Self)
            .map_err(|source| LiveError::Address { address, source })
    }
}

fn no_random_bits(error: getrandom::Error) -> LiveError {
    LiveError::System(error.into())
}

/// What the session and the server share.
struct Shared {
    board: Mutex<Dashboard>,
    orders: Orders,
    guard: Guard,
    nonce: String,
    version: watch::Sender<()>,
    browsers: Arc<Semaphore>,
}

impl Shared {
    fn board(&self) -> MutexGuard<'_, Dashboard> {
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Dashboard)) {
        change(&mut self.board());
        self.version.send_replace(());
    }

    fn update(&self, since: u64) -> (u64, String) {
        let (held, ends) = (self.orders.is_held(), self.orders.ends());
        self.board().update(since, held, ends)
    }
}

/// A live page that is being served. It ends with this value.
pub struct LivePage {
    shared: Arc<Shared>,
    target: Target,
    address: SocketAddr,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl LivePage {
    /// Serves a session, which may have been measured in part. Orders given on the page are given
    /// to `orders`.
    ///
    /// # Errors
    /// When a frame of the session cannot be read, or the system has no thread for it.
    pub fn serve(
        listening: Listening,
        session: &SessionFolder,
        orders: &Orders,
    ) -> Result<Self, LiveError> {
        let folder = session.folder();
        let name = folder.file_name().unwrap_or(folder.as_os_str());
        let title = name.to_string_lossy().into_owned();
        let mut board = Dashboard::new(title, session.rig(), session.plan(), session.roles());
        for pose in session.done() {
            board.remember(&session.frame(pose)?);
        }
        let shared = Arc::new(Shared {
            board: Mutex::new(board),
            orders: orders.clone(),
            guard: Guard::new().map_err(no_random_bits)?,
            nonce: random_hex().map_err(no_random_bits)?,
            version: watch::Sender::new(()),
            browsers: Arc::new(Semaphore::new(MOST_BROWSERS)),
        });
        let address = listening
            .0
            .local_addr()
            .map_err(|error| LiveError::System(error.into()))?;
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(|error| LiveError::System(error.into()))?;
        let (stop, stopped) = oneshot::channel();
        let router = router(shared.clone());
        let serve = move || {
            runtime.block_on(async {
                let listener = tokio::net::TcpListener::from_std(listening.0);
                if let Ok(listener) = listener {
                    let listener = LimitedListener::new(listener, IDLE);
                    // It ends with the runtime, and so do the browsers' streams.
                    tokio::spawn(axum::serve(listener, router).into_future());
                    if stopped.await.is_ok() {
                        tokio::time::sleep(LAST_WORD).await;
                    }
                }
            });
        };
        let thread = std::thread::Builder::new()
            .name("live page".into())
            .spawn(serve)
            .map_err(|error| LiveError::System(error.into()))?;
        Ok(Self {
            shared,
            target: session.rig().target.clone(),
            address,
            stop: Some(stop),
            thread: Some(thread),
        })
    }

    /// Where it is served.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The token that orders need.
    pub fn token(&self) -> &str {
        self.shared.guard.token()
    }

    /// The session is over: the page says how.
    pub fn end(&self, end: SessionEnd, reason: &str) {
        self.shared.change(|board| board.end(end, reason));
    }
}

impl Watch for LivePage {
    fn on_event(&self, event: &SessionEvent) {
        if let SessionEvent::Frame {
            frame,
            registration,
            sampled,
        } = event
        {
            // Drawn while no other thread waits for the board.
            if self.shared.board().is_thumbnail_due() {
                let outcome = sampled.report.outcome;
                let thumbnail = Thumbnail::of(frame, registration, outcome, &self.target);
                self.shared.change(|board| board.show(thumbnail, sampled));
            }
        } else {
            self.shared.change(|board| board.handle(event));
        }
    }
}

impl Drop for LivePage {
    fn drop(&mut self) {
        if let Some(stop) = self.stop.take() {
            let _ = stop.send(());
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

type Page = State<Arc<Shared>>;

fn router(shared: Arc<Shared>) -> Router {
    Router::new()
        .route("/", get(document))
        .route("/events", get(events))
        .route("/state.json", get(state))
        .route("/frame.png", get(frame))
        .route("/slice.png", get(slice))
        .route("/pause", post(|page: Page| order(page, |o| o.hold(true))))
        .route("/resume", post(|page: Page| order(page, |o| o.hold(false))))
        .route("/end", post(|page: Page| order(page, Orders::end)))
        .layer(middleware::from_fn_with_state(shared.clone(), guarded))
        .with_state(shared)
}

/// Refuses what the guard refuses, and tells the browser to be careful with the rest.
async fn guarded(State(shared): Page, request: Request, next: Next) -> Response {
    let checked = shared
        .guard
        .check(request.method(), request.uri(), request.headers());
    let mut response = match checked {
        Err(why) => (StatusCode::FORBIDDEN, why).into_response(),
        // Nothing that this page knows has a body, and none is read.
        Ok(()) if *request.method() == Method::POST => {
            let (head, _) = request.into_parts();
            next.run(Request::from_parts(head, Body::empty())).await
        }
        Ok(()) => next.run(request).await,
    };
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CACHE_CONTROL, "no-store"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (
            HeaderName::from_static("cross-origin-resource-policy"),
            "same-origin",
        ),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    if let Ok(policy) = HeaderValue::from_str(&page::policy(&shared.nonce)) {
        headers.insert(header::CONTENT_SECURITY_POLICY, policy);
    }
    response
}

async fn document(State(shared): Page) -> Response {
    let html = [(header::CONTENT_TYPE, "text/html; charset=utf-8")];
    (html, page::page(&shared.nonce)).into_response()
}

async fn state(State(shared): Page) -> Response {
    let json = [(header::CONTENT_TYPE, "application/json")];
    (json, shared.update(0).1).into_response()
}

async fn frame(State(shared): Page) -> Response {
    // Encoded without the session waiting for it.
    let thumbnail = shared.board().thumbnail().cloned();
    match thumbnail {
        Some(thumbnail) => png(thumbnail.png()),
        None => (StatusCode::NOT_FOUND, "no frame yet\n").into_response(),
    }
}

async fn slice(State(shared): Page) -> Response {
    let slice = shared.board().slice().clone();
    png(slice.png())
}

fn png(bytes: Vec<u8>) -> Response {
    ([(header::CONTENT_TYPE, "image/png")], bytes).into_response()
}

async fn order(State(shared): Page, give: impl FnOnce(&Orders)) -> StatusCode {
    give(&shared.orders);
    shared.change(Dashboard::touch);
    StatusCode::NO_CONTENT
}

async fn events(State(shared): Page) -> Response {
    let Ok(place) = shared.browsers.clone().try_acquire_owned() else {
        return (StatusCode::SERVICE_UNAVAILABLE, "too many browsers\n").into_response();
    };
    let changes = Changes {
        next: Box::pin(next_change(Browser {
            changed: shared.version.subscribe(),
            shared,
            seen: 0,
            _place: place,
        })),
    };
    Sse::new(changes)
        .keep_alive(KeepAlive::default())
        .into_response()
}

/// One that watches.
struct Browser {
    shared: Arc<Shared>,
    changed: watch::Receiver<()>,
    /// The version that it has; 0 before the first.
    seen: u64,
    _place: OwnedSemaphorePermit,
}

type NextChange = Pin<Box<dyn Future<Output = (String, Browser)> + Send>>;

/// What changes, as a browser takes it in: when it is slow, more has changed.
struct Changes {
    next: NextChange,
}

impl Stream for Changes {
    type Item = Result<Event, Infallible>;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        self.next.as_mut().poll(context).map(|(text, browser)| {
            self.next = Box::pin(next_change(browser));
            Some(Ok(Event::default().data(text)))
        })
    }
}

async fn next_change(mut browser: Browser) -> (String, Browser) {
    if browser.seen > 0 {
        tokio::time::sleep(TELL_EVERY).await;
        // The sender lives as long as what is shared.
        let _ = browser.changed.changed().await;
    }
    browser.changed.mark_unchanged();
    let (version, text) = browser.shared.update(browser.seen);
    browser.seen = version;
    (text, browser)
}
