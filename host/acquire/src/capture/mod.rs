//! A session: both arms to every pose, a trigger, and the encoders latched with it.

mod accounts;
mod arms;
mod conditions;
mod control;
mod desk;
pub mod keep_out;
mod orders;
mod pace;
mod port;
mod session;
mod thermometer;
mod timing;
mod travel;
mod unattended;
mod watch;

pub use arms::{Arms, BadExposures, HomeError, Options};
pub use conditions::free_mb;
pub use control::{Comparison, Judgement};
pub use orders::Orders;
pub use pace::Pace;
pub use port::{Opener, SessionPort};
pub use session::{SessionError, SessionSummary, Shooter, Shot, ShotOutcome, run_session};
pub use timing::{POINTING_LIMIT_DEG, SETTLE_TIME_S, move_time_s, nearest_turn_deg};
pub use travel::{KeptApart, keep_apart, travelling, travelling_order};
pub use unattended::{Capture, Ended};
pub use watch::{Told, Watch, Watchers};
