//! A running session in a browser: what it has measured so far, and two buttons.
//!
//! [`LivePage`] watches the session, which never waits for a browser: each browser is sent what changed
//! since it was last sent something, so that a slow one only sees fewer steps. Looking needs no token.
//! Pausing, going on and ending do, and both are refused to pages of other hosts (`guard`).
//!
//! | module | holds |
//! |---|---|
//! | `board` | all that the page shows, and what of it has changed |
//! | `filled`, `slice` | bins filled so far, and a slice through them as a picture |
//! | `thumbnail` | [`Thumbnail`]: the last frame with its fiducial lines |
//! | `server` | [`LivePage`]: a thread that serves page, pictures, changes and orders |
//! | `listener` | connections, of which none is idle |
//! | `guard`, `page` | who may look and who may order; the document and its policy |

mod dashboard;
mod filled;
mod guard;
mod listener;
mod page;
mod server;
mod slice;
mod thumbnail;

pub use server::{Listening, LiveError, LivePage};
pub use thumbnail::Thumbnail;
