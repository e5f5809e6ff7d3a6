//! A running session in a browser: what it has measured so far, and two buttons.
//!
//! The session tells [`LivePage`] what happens, and never waits for a browser: every browser asks
//! for what changed since it last asked, so that a slow one only sees fewer steps. Looking needs no
//! token. Pausing, going on and ending do, and both are refused to pages of other hosts
//! ([`Guard`](guard::Guard)).

mod board;
mod filled;
mod guard;
mod page;
mod server;
mod slice;
mod thumbnail;

pub use server::{Listening, LiveError, LivePage};
pub use thumbnail::Thumbnail;
