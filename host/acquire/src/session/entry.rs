//! What a line of the journal says.

use gonia_rig::Role;
use std::fmt;

/// One line's content.
#[derive(Clone, Debug, PartialEq)]
pub enum Entry {
    /// A program took the session up, for the first time or again.
    Start(String),
    /// A pose is done: its frame is on the disk.
    Pose(PoseDone),
    /// A pose was given up, for now: which, and why.
    GivenUp(String),
    /// A control pose was compared with its first take.
    Control(String),
    /// Poses are done no more, from this line of the journal on (counted from 0), for the control
    /// pose came out otherwise.
    Void(usize, String),
    /// Anything else that somebody should know in the morning.
    Event(String),
    /// The program left the session in good order.
    Stop(End, String),
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
pub enum End {
    /// Every pose is done, or given up.
    Finished,
    /// Somebody asked for a pause, or must change the sample.
    Paused,
    /// Something is wrong.
    Failed,
}

impl End {
    const ALL: [(End, &'static str); 3] = [
        (End::Finished, "finished"),
        (End::Paused, "paused"),
        (End::Failed, "failed"),
    ];
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
            Entry::Void(since, text) => write!(f, "void since={since} {}", one_line(text)),
            Entry::Event(text) => write!(f, "event {}", one_line(text)),
            Entry::Stop(end, text) => {
                let word = End::ALL.iter().find(|(e, _)| e == end).map_or("", |e| e.1);
                write!(f, "stop {word} {}", one_line(text))
            }
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
                Entry::Void(since.strip_prefix("since=")?.parse().ok()?, why.into())
            }
            "event" => Entry::Event(rest.into()),
            "stop" => {
                let (word, reason) = rest.split_once(' ')?;
                let end = End::ALL.iter().find(|(_, name)| *name == word)?.0;
                Entry::Stop(end, reason.into())
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

/// A line of the journal is one line whatever an error says.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
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
            Entry::Void(17, "the lamp is darker".into()),
            Entry::Event("the disk is nearly full".into()),
            Entry::Stop(End::Finished, "all poses done".into()),
            Entry::Stop(End::Failed, "the camera is gone".into()),
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
