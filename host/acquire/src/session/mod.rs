//! A session as a folder that a person can read, crash-safe.
//!
//! | file | holds | written |
//! |---|---|---|
//! | `rig.toml`, `plan.csv` | the rig and the poses, as the session began with them | whole |
//! | `provenance.toml` | versions, controllers and their settings' checksums, camera, seed | whole |
//! | `journal.log` | start, pose, event, stop: a line each ([`Entry`]), checksummed | appended, synced a line |
//! | `frames.bin` | what each frame showed at the grid points ([`sampled_bytes`](gonia_pipeline::process::sampled_bytes)) | appended, synced a frame |
//! | `lock` | held while a capture runs | – |
//!
//! A pose is done when its line is in the journal, and its line is written after its frame is on the
//! disk. What a killed program leaves behind the last whole line is cut off when it goes on. Everything
//! else that a session knows follows from the journal's entries: [`SessionState`].

mod append;
mod clock;
mod control;
mod entry;
mod folder;
mod journal;
mod provenance;
mod samples;
#[cfg(test)]
mod simulation;
#[cfg(test)]
mod some_frame;
mod state;
mod verify;
mod writer;

pub use clock::now;
pub use control::{ControlComparison, ControlDone, Judgement};
pub use entry::{CHANGE_THE_SAMPLE, Entry, GivenUp, PoseDone, SessionEnd};
pub use folder::{CALIBRATION, FRAMES, JOURNAL, PLAN, PROVENANCE, RIG, SessionFolder};
pub use provenance::{ControllerIdentity, SessionProvenance};
pub use state::{Contradiction, RoleState, SessionState};
pub use verify::{Finding, Verdict, verify};
pub use writer::{Beginning, Claim, SessionWriter};
