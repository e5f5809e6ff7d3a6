//! What a session does: both arms to every pose, a trigger, the encoders captured with it, and the frame.
//!
//! | module | holds |
//! |---|---|
//! | `equipment` | opens arms and camera, as `rig.toml` names them |
//! | `arms` | both arms together: homing, moves, triggers, recovery |
//! | `shot`, `shooter` | one pose with its retakes; [`run_session`] without a camera |
//! | `unattended` | a whole session: roles, control pose, disk, temperature, orders |
//! | `coordinator`, `frame_worker` | its threads: pulses and frames matched, frames sampled and kept |
//! | `course` | what comes next, by what the journal's entries have come to |
//! | `thermometer`, `disk` | the conditions under which poses count |
//! | `keep_out`, `timing`, `pace` | ways that keep the arms apart; how long moves and sessions take |
//! | `guard` | faults of this program, which cost a frame |
//! | `watch`, `orders` | events for those who watch; orders |
//! | `port`, `usb_port` | ports that are opened again, also under another name |

mod arms;
mod coordinator;
mod course;
mod disk;
mod equipment;
mod frame_worker;
mod guard;
pub mod keep_out;
mod orders;
mod pace;
mod port;
mod shooter;
mod shot;
mod thermometer;
mod timing;
mod travel;
mod unattended;
mod usb_port;
mod watch;

pub use arms::{Arms, BadExposures, HomeError, ShotOptions};
pub use course::{AfterControl, Step, after_control, judged, next_step};
pub use disk::free_mb;
pub use equipment::{ArmPortNames, Equipment, EquipmentError, simulated_arms};
pub use orders::Orders;
pub use pace::Pace;
pub use port::{PortOpener, SessionPort};
pub use shooter::{SessionError, SessionSummary, Shooter, run_session};
pub use shot::{Shot, ShotOutcome};
pub use timing::{POINTING_LIMIT_DEG, SETTLE_TIME_S, move_time_s, nearest_turn_deg};
pub use travel::{KeptApart, keep_apart, travelling, travelling_order, travelling_some};
pub use unattended::{Ended, UnattendedSession};
pub use watch::{SessionEvent, Watch, Watchers};
