//! What a line of the journal says.

use gonia_formats::one_line;
use gonia_rig::Role;
use std::fmt;

/// The reason with which a session ends between reference and material, for people and in the journal,
/// where it tells [`End::AwaitsMaterial`] from another pause.
pub const CHANGE_THE_SAMPLE: &str =
    "the reference is measured: put the material on the target and go on with --resume";

/// One line's content.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A program began the session, or went on with it.
    Start(String),
    /// A pose is done: its frame is on the disk.
    Pose(PoseDone),
    /// A pose was given up, for now: which, and why.
    GivenUp(String),
    /// A control pose was compared with its first take.
    Control(String),
    /// The poses of later lines are discarded, since the control pose has changed. In the journal:
    /// `void`.
    Discard {
        /// From this line of the journal on, counted from 0.
        since: usize,
        /// How the control pose has changed.
        why: String,
    },
    /// Anything else that somebody should know in the morning.
    Event(String),
    /// The program ended cleanly: in which state, and why.
    Stop(SessionEnd, String),
}

/// A pose that is done.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseDone {
    /// What lay on the target.
    pub role: Role,
    /// The pose's place in the plan.
    pub index: usize,
    /// Where its frame begins in the file of frames.
    pub at: u64,
    /// The frame's bytes there.
    pub bytes: u64,
    /// Their checksum.
    pub crc: u32,
    /// The largest |commanded − encoder| at the trigger, degrees.
    pub pointing_deg: f64,
}

/// How a program left a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SessionEnd {
    /// Every pose is done, or given up.
    Finished,
    /// A person ordered it.
    Paused,
    /// The reference is measured, and a person must put the material on the target.
    AwaitsMaterial,
    /// Something is wrong that does not go away.
    Failed,
}

impl SessionEnd {
    /// Its word in the journal and on the live page. [`End::AwaitsMaterial`] is a pause there.
    pub fn name(self) -> &'static str {
        match self {
            SessionEnd::Finished => "finished",
            SessionEnd::Paused | SessionEnd::AwaitsMaterial => "paused",
            SessionEnd::Failed => "failed",
        }
    }

    /// Of a line of the journal.
    fn of_line(word: &str, reason: &str) -> Option<Self> {
        Some(match word {
            "finished" => SessionEnd::Finished,
            "paused" if reason == CHANGE_THE_SAMPLE => SessionEnd::AwaitsMaterial,
            "paused" => SessionEnd::Paused,
            "failed" => SessionEnd::Failed,
            _ => return None,
        })
    }
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Entry::Start(text) => write!(f, "start {}", one_line(text)),
            Entry::Pose(pose) => write!(
                f,
                "pose {} {} at={} bytes={} crc={:08x} pointing={:.6}",
                pose.role.name(),
                pose.index,
                pose.at,
                pose.bytes,
                pose.crc,
                pose.pointing_deg
            ),
            Entry::GivenUp(text) => write!(f, "given-up {}", one_line(text)),
            Entry::Control(text) => write!(f, "control {}", one_line(text)),
            Entry::Discard { since, why } => write!(f, "void since={since} {}", one_line(why)),
            Entry::Event(text) => write!(f, "event {}", one_line(text)),
            Entry::Stop(end, text) => write!(f, "stop {} {}", end.name(), one_line(text)),
        }
    }
}

impl Entry {
    /// What a line says; `None` when it is no line of a journal.
    pub fn parse(text: &str) -> Option<Self> {
        let (kind, rest) = text.split_once(' ')?;
        Some(match kind {
            "start" => Entry::Start(rest.into()),
            "pose" => Entry::Pose(parse_pose(rest)?),
            "given-up" => Entry::GivenUp(rest.into()),
            "control" => Entry::Control(rest.into()),
            "void" => {
                let (since, why) = rest.split_once(' ')?;
                Entry::Discard {
                    since: since.strip_prefix("since=")?.parse().ok()?,
                    why: why.into(),
                }
            }
            "event" => Entry::Event(rest.into()),
            "stop" => {
                let (word, reason) = rest.split_once(' ')?;
                Entry::Stop(SessionEnd::of_line(word, reason)?, reason.into())
            }
            _ => return None,
        })
    }
}

fn parse_pose(text: &str) -> Option<PoseDone> {
    let words: Vec<&str> = text.split(' ').collect();
    let [role, index, at, bytes, crc, pointing] = words[..] else {
        return None;
    };
    Some(PoseDone {
        role: [Role::Material, Role::Reference]
            .into_iter()
            .find(|r| r.name() == role)?,
        index: index.parse().ok()?,
        at: at.strip_prefix("at=")?.parse().ok()?,
        bytes: bytes.strip_prefix("bytes=")?.parse().ok()?,
        crc: u32::from_str_radix(crc.strip_prefix("crc=")?, 16).ok()?,
        pointing_deg: pointing.strip_prefix("pointing=")?.parse().ok()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_entry_comes_back_from_its_line() {
        let pose = PoseDone {
            role: Role::Reference,
            index: 8504,
            at: 1 << 40,
            bytes: 25_743,
            crc: 0x00ab_cdef,
            pointing_deg: 0.004_125,
        };
        for entry in [
            Entry::Start("gonia 0.1.0".into()),
            Entry::Pose(pose),
            Entry::GivenUp("material 3: no trigger".into()),
            Entry::Control("material 0 ratio=1.001".into()),
            Entry::Discard {
                since: 17,
                why: "the lamp is darker".into(),
            },
            Entry::Event("the disk is nearly full".into()),
            Entry::Stop(SessionEnd::Finished, "all poses done".into()),
            Entry::Stop(SessionEnd::Failed, "the camera is gone".into()),
            Entry::Stop(SessionEnd::Paused, "by Ctrl-C".into()),
            Entry::Stop(SessionEnd::AwaitsMaterial, CHANGE_THE_SAMPLE.into()),
        ] {
            assert_eq!(Entry::parse(&entry.to_string()), Some(entry));
        }
        for text in ["", "pose", "pose material 1", "stop early now", "dance on"] {
            assert_eq!(Entry::parse(text), None, "{text}");
        }
    }

    #[test]
    fn an_error_of_two_lines_is_one_line() {
        let entry = Entry::Event("first\nsecond".into());
        assert_eq!(entry.to_string(), "event first second");
    }
}
