//! What a line of the journal says.

use crate::session::control::ControlDone;
use gonia_formats::one_line;
use gonia_rig::Role;
use std::fmt;

/// The reason with which a session ends between reference and material. In a journal of an older program
/// it tells [`SessionEnd::AwaitsMaterial`] from another pause.
pub const CHANGE_THE_SAMPLE: &str =
    "the reference is measured: put the material on the target and go on with --resume";

/// One line's content.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A program began the session, or went on with it.
    Start(String),
    /// A pose is done: its frame is on the disk.
    Pose(PoseDone),
    /// A pose was given up.
    GivenUp(GivenUp),
    /// The session stood still, and the lamp may have changed meanwhile: with the reason.
    Pause(String),
    /// A control pose was compared with its first take.
    Control(ControlDone),
    /// The poses of later lines are discarded, since the control pose has changed. In the journal:
    /// `void`.
    Discard {
        /// Of this role; of all of them in a journal of an older program.
        role: Option<Role>,
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
    /// Whether its fiducial lines were seen; `None` in a journal of an older program, which did not say.
    pub has_lines: Option<bool>,
}

/// A pose that is not measured.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenUp {
    /// What lay on the target.
    pub role: Role,
    /// The pose's place in the plan.
    pub index: usize,
    /// Why.
    pub why: String,
    /// A person left it out, for good; otherwise the next program tries it again.
    pub is_left_out: bool,
}

impl fmt::Display for GivenUp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (role, why) = (self.role.name(), one_line(&self.why));
        write!(f, "{role} pose {}: {why}", self.index)
    }
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
    /// Its word on the live page, where [`SessionEnd::AwaitsMaterial`] is a pause.
    pub fn name(self) -> &'static str {
        match self {
            SessionEnd::Finished => "finished",
            SessionEnd::Paused | SessionEnd::AwaitsMaterial => "paused",
            SessionEnd::Failed => "failed",
        }
    }

    /// Its word in the journal.
    fn word(self) -> &'static str {
        match self {
            SessionEnd::AwaitsMaterial => "awaits-material",
            end => end.name(),
        }
    }

    /// Of a line of the journal.
    fn of_line(word: &str, reason: &str) -> Option<Self> {
        Some(match word {
            "finished" => SessionEnd::Finished,
            "awaits-material" => SessionEnd::AwaitsMaterial,
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
                "pose {} {} at={} bytes={} crc={:08x} pointing={:.6}{}",
                pose.role.name(),
                pose.index,
                pose.at,
                pose.bytes,
                pose.crc,
                pose.pointing_deg,
                match pose.has_lines {
                    Some(true) => " lines=seen",
                    Some(false) => " lines=unseen",
                    None => "",
                }
            ),
            Entry::GivenUp(pose) if pose.is_left_out => write!(f, "left-out {pose}"),
            Entry::GivenUp(pose) => write!(f, "given-up {pose}"),
            Entry::Pause(text) => write!(f, "pause {}", one_line(text)),
            Entry::Control(control) => write!(f, "control {control}"),
            Entry::Discard { role, since, why } => {
                let role = role.map_or(String::new(), |role| format!("{} ", role.name()));
                write!(f, "void {role}since={since} {}", one_line(why))
            }
            Entry::Event(text) => write!(f, "event {}", one_line(text)),
            Entry::Stop(end, text) => write!(f, "stop {} {}", end.word(), one_line(text)),
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
            "given-up" => Entry::GivenUp(parse_given_up(rest, false)?),
            "left-out" => Entry::GivenUp(parse_given_up(rest, true)?),
            "pause" => Entry::Pause(rest.into()),
            "control" => Entry::Control(ControlDone::parse(rest)?),
            "void" => {
                let (first, _) = rest.split_once(' ')?;
                let role = role_of(first);
                let rest = role.map_or(rest, |role| &rest[role.name().len() + 1..]);
                let (since, why) = rest.split_once(' ')?;
                Entry::Discard {
                    role,
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

fn role_of(name: &str) -> Option<Role> {
    Role::ALL.into_iter().find(|role| role.name() == name)
}

fn parse_given_up(text: &str, is_left_out: bool) -> Option<GivenUp> {
    let (role, rest) = text.split_once(" pose ")?;
    let (index, why) = rest.split_once(": ")?;
    Some(GivenUp {
        role: role_of(role)?,
        index: index.parse().ok()?,
        why: why.into(),
        is_left_out,
    })
}

fn parse_pose(text: &str) -> Option<PoseDone> {
    let words: Vec<&str> = text.split(' ').collect();
    let (words, lines) = match words[..] {
        [role, index, at, bytes, crc, pointing] => ([role, index, at, bytes, crc, pointing], None),
        [role, index, at, bytes, crc, pointing, lines] => {
            ([role, index, at, bytes, crc, pointing], Some(lines))
        }
        _ => return None,
    };
    let [role, index, at, bytes, crc, pointing] = words;
    Some(PoseDone {
        has_lines: match lines {
            None => None,
            Some("lines=seen") => Some(true),
            Some("lines=unseen") => Some(false),
            Some(_) => return None,
        },
        role: role_of(role)?,
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
    use crate::session::control::{ControlComparison, Judgement};

    #[test]
    fn every_entry_comes_back_from_its_line() {
        let pose = PoseDone {
            role: Role::Reference,
            index: 8504,
            at: 1 << 40,
            bytes: 25_743,
            crc: 0x00ab_cdef,
            pointing_deg: 0.004_125,
            has_lines: None,
        };
        let control = ControlDone {
            role: Role::Reference,
            index: 3,
            judgement: Some(Judgement::Drifted),
            comparison: Some(ControlComparison {
                ratio: 0.9,
                scatter: 0.001_25,
                moved_deg: 0.002,
            }),
        };
        let given_up = GivenUp {
            role: Role::Material,
            index: 3,
            why: "no trigger: twice".into(),
            is_left_out: false,
        };
        for entry in [
            Entry::Start("gonia 0.1.0".into()),
            Entry::Pose(pose.clone()),
            Entry::Pose(PoseDone {
                has_lines: Some(true),
                ..pose.clone()
            }),
            Entry::Pose(PoseDone {
                has_lines: Some(false),
                ..pose
            }),
            Entry::GivenUp(given_up.clone()),
            Entry::GivenUp(GivenUp {
                is_left_out: true,
                ..given_up
            }),
            Entry::Pause("held by hand".into()),
            Entry::Control(control.clone()),
            Entry::Control(ControlDone {
                judgement: Some(Judgement::Unconfirmed),
                comparison: None,
                ..control
            }),
            Entry::Discard {
                role: None,
                since: 17,
                why: "the lamp is darker".into(),
            },
            Entry::Discard {
                role: Some(Role::Material),
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
        // As an older program wrote it.
        assert_eq!(
            Entry::parse(&format!("stop paused {CHANGE_THE_SAMPLE}")),
            Some(Entry::Stop(
                SessionEnd::AwaitsMaterial,
                CHANGE_THE_SAMPLE.into()
            ))
        );
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
