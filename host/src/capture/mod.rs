//! A session: both arms to every pose, a trigger, and the encoders latched with it.

mod arms;
pub mod keep_out;
mod session;
mod timing;

pub use arms::{Arms, BadExposures, HomeError, Options};
pub use session::{SessionError, SessionSummary, Shot, ShotOutcome, run_session};
pub use timing::{POINTING_LIMIT_DEG, SETTLE_TIME_S, move_time_s, nearest_turn_deg};
