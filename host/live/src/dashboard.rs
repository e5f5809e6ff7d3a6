//! All that the page shows, and what of it has changed since a browser last asked.

use crate::filled::SeenBins;
use crate::slice::Slice;
use crate::thumbnail::Thumbnail;
use gonia_acquire::capture::{POINTING_LIMIT_DEG, Pace, SessionEvent};
use gonia_acquire::session::SessionEnd;
use gonia_brdf::Pose;
use gonia_pipeline::process::{Outcome, SampledFrame};
use gonia_rig::{Rig, Role};
use serde::Serialize;
use std::collections::VecDeque;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Notes that are kept; the journal has them all.
const NOTES: usize = 200;
/// Thumbnails are drawn no more often than this.
const THUMBNAIL_EVERY: Duration = Duration::from_millis(700);

/// What became of a pose in the role under way. The numbers are the page's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PoseState {
    /// Still to be taken.
    ToDo = 0,
    /// Done, registered by its fiducial lines.
    Locked = 1,
    /// Done, at the pose of the arms' reading.
    FellBack = 2,
    /// Done, and its frame does not show the target.
    Refused = 3,
    /// Not reached.
    GivenUp = 4,
}

/// Something that happened.
#[derive(Clone, Debug, Serialize)]
struct Note {
    #[serde(skip)]
    version: u64,
    /// Milliseconds since 1970.
    at_ms: u64,
    text: String,
}

/// The last frame.
#[derive(Clone, Debug, Serialize)]
struct LastFrame {
    version: u64,
    role: &'static str,
    index: u32,
    state: &'static str,
    why: String,
    residual_px: f64,
    offset_deg: [f64; 2],
}

/// What the page shows.
pub struct Dashboard {
    title: String,
    plan: Vec<Pose>,
    roles: &'static [Role],
    role: Role,
    states: Vec<(PoseState, u64)>,
    /// Counts every change.
    version: u64,
    phase: &'static str,
    current: Option<usize>,
    pace: Pace,
    last_deg: f64,
    worst_deg: f64,
    filled: SeenBins,
    slice_version: u64,
    thumbnail: Option<Thumbnail>,
    drawn: Option<Instant>,
    last: Option<LastFrame>,
    notes: VecDeque<Note>,
    ended: Option<(SessionEnd, String)>,
}

/// What is sent: all of it, or what is newer than a version. Angles in degrees.
#[derive(Serialize)]
struct Update<'a> {
    version: u64,
    /// Only in a whole one: what does not change.
    #[serde(skip_serializing_if = "Option::is_none")]
    whole: Option<Whole<'a>>,
    phase: &'static str,
    /// Whether the session was ordered to hold, which it does at the next pose, and to end.
    held: bool,
    ends: bool,
    role: &'static str,
    /// Pairs of a pose and its state.
    poses: Vec<(usize, u8)>,
    current: Option<usize>,
    done: usize,
    planned: usize,
    rate: Option<f64>,
    left_s: Option<f64>,
    last_deg: f64,
    worst_deg: f64,
    bins: usize,
    bins_share: f64,
    samples: usize,
    slice: SliceNote,
    frame: Option<&'a LastFrame>,
    notes: Vec<&'a Note>,
    ended: Option<[&'a str; 2]>,
}

#[derive(Serialize)]
struct Whole<'a> {
    title: &'a str,
    program: &'static str,
    roles: Vec<&'static str>,
    limit_deg: f64,
    /// θi, φi, θv, φv of every pose.
    plan: Vec<[f64; 4]>,
}

#[derive(Serialize)]
struct SliceNote {
    version: u64,
    theta_deg: [f64; 2],
    filled: f64,
}

impl Dashboard {
    /// Of a session of that name over a plan.
    pub fn new(title: String, rig: &Rig, plan: &[Pose], roles: &'static [Role]) -> Self {
        Self {
            title,
            states: vec![(PoseState::ToDo, 0); plan.len()],
            roles,
            role: roles.first().copied().unwrap_or(Role::Material),
            version: 1,
            phase: "homing",
            current: None,
            pace: Pace::new(plan.len(), roles.len()),
            last_deg: 0.0,
            worst_deg: 0.0,
            filled: SeenBins::new(rig, plan),
            slice_version: 0,
            thumbnail: None,
            drawn: None,
            last: None,
            notes: VecDeque::new(),
            ended: None,
            plan: plan.to_vec(),
        }
    }

    /// Takes in a frame of an earlier run.
    pub fn remember(&mut self, frame: &SampledFrame) {
        if frame.report.role == Role::Material && self.filled.add(frame) {
            self.slice_version = self.version;
        }
    }

    /// Takes in an event of the session.
    pub fn handle(&mut self, event: &SessionEvent) {
        self.version += 1;
        match event {
            SessionEvent::Begin { role, missing, .. } => {
                self.role = *role;
                self.phase = "measuring";
                self.states.fill((PoseState::Locked, self.version));
                for index in *missing {
                    self.set(*index, PoseState::ToDo);
                }
                self.pace.begin(*role, missing.len(), Instant::now());
            }
            SessionEvent::Going { index } => self.current = Some(*index),
            // Drawn by the caller, and shown by `show`.
            SessionEvent::Frame { .. } => {}
            SessionEvent::Pose { done, frame } => {
                self.set(
                    done.index,
                    match frame.report.outcome {
                        Outcome::Locked => PoseState::Locked,
                        Outcome::FellBack(_) => PoseState::FellBack,
                        Outcome::Refused(_) => PoseState::Refused,
                    },
                );
                self.pace.pose(Instant::now());
                self.last_deg = done.pointing_deg;
                self.worst_deg = self.worst_deg.max(done.pointing_deg);
                self.remember(frame);
            }
            SessionEvent::Discarded(poses) => {
                for index in *poses {
                    self.set(*index, PoseState::ToDo);
                }
                self.pace.discard(poses.len());
            }
            SessionEvent::GivenUp { index, why } => {
                self.set(*index, PoseState::GivenUp);
                self.note(why);
            }
            SessionEvent::Held(held) => {
                self.phase = if *held { "held" } else { "measuring" };
                if !held {
                    self.pace.go_on(Instant::now());
                }
            }
            SessionEvent::Note(text) => self.note(text),
        }
    }

    /// Whether a frame should be drawn now; then it is not due for a while.
    pub fn is_thumbnail_due(&mut self) -> bool {
        let is_due = self.drawn.is_none_or(|at| at.elapsed() >= THUMBNAIL_EVERY);
        if is_due {
            self.drawn = Some(Instant::now());
        }
        is_due
    }

    /// Takes in a frame that was drawn.
    pub fn show(&mut self, thumbnail: Thumbnail, sampled: &SampledFrame) {
        self.version += 1;
        self.thumbnail = Some(thumbnail);
        self.last = Some(LastFrame::of(sampled, self.version));
    }

    /// The session is over.
    pub fn end(&mut self, end: SessionEnd, reason: &str) {
        self.version += 1;
        self.phase = "ended";
        self.current = None;
        self.ended = Some((end, reason.to_owned()));
    }

    /// An order was given: browsers are sent it.
    pub fn touch(&mut self) {
        self.version += 1;
    }

    /// What has changed since a version (0: all of it) as JSON, and the version it brings one to.
    pub fn update(&self, since: u64, held: bool, ends: bool) -> (u64, String) {
        let states = self.states.iter().enumerate();
        let changed = states.filter(|(_, (state, version))| match since {
            0 => *state != PoseState::ToDo,
            _ => *version > since,
        });
        let update = Update {
            version: self.version,
            whole: (since == 0).then(|| self.whole()),
            phase: self.phase,
            held,
            ends,
            role: self.role.name(),
            poses: changed.map(|(k, (state, _))| (k, *state as u8)).collect(),
            current: self.current,
            done: self.pace.done,
            planned: self.pace.planned,
            rate: self.pace.rate(),
            left_s: self.pace.left_s(),
            last_deg: self.last_deg,
            worst_deg: self.worst_deg,
            bins: self.filled.bins(),
            bins_share: self.filled.share(),
            samples: self.filled.samples(),
            slice: SliceNote {
                version: self.slice_version,
                theta_deg: self.filled.slice().theta_deg(),
                filled: self.filled.slice().filled(),
            },
            frame: self.last.as_ref(),
            notes: self.notes.iter().filter(|n| n.version > since).collect(),
            ended: self.ended.as_ref().map(|(e, why)| [e.name(), why.as_str()]),
        };
        // Numbers and texts alone: nothing in it that JSON cannot say.
        let text = serde_json::to_string(&update).unwrap_or_default();
        (self.version, text)
    }

    /// The last frame that was drawn.
    pub fn thumbnail(&self) -> Option<&Thumbnail> {
        self.thumbnail.as_ref()
    }

    /// The slice.
    pub fn slice(&self) -> &Slice {
        self.filled.slice()
    }

    fn whole(&self) -> Whole<'_> {
        let plan = self.plan.iter().map(|pose| {
            let (light, view) = (pose.light, pose.view);
            [
                light.theta_deg(),
                light.phi_deg(),
                view.theta_deg(),
                view.phi_deg(),
            ]
            .map(|deg| (deg * 1e4).round() * 1e-4)
        });
        Whole {
            title: &self.title,
            program: concat!("gonia ", env!("CARGO_PKG_VERSION")),
            roles: self.roles.iter().map(|role| role.name()).collect(),
            limit_deg: POINTING_LIMIT_DEG,
            plan: plan.collect(),
        }
    }

    fn set(&mut self, index: usize, state: PoseState) {
        if let Some(place) = self.states.get_mut(index) {
            *place = (state, self.version);
        }
    }

    fn note(&mut self, text: &str) {
        if self.notes.len() == NOTES {
            self.notes.pop_front();
        }
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        self.notes.push_back(Note {
            version: self.version,
            at_ms: since.map_or(0, |d| d.as_millis() as u64),
            text: text.to_owned(),
        });
    }
}

impl LastFrame {
    fn of(sampled: &SampledFrame, version: u64) -> Self {
        let report = &sampled.report;
        let (state, why) = match report.outcome {
            Outcome::Locked => ("locked", String::new()),
            Outcome::FellBack(why) => ("fell back", why.to_string()),
            Outcome::Refused(why) => ("refused", why.to_string()),
        };
        let offset = report.pose_offset;
        Self {
            version,
            role: report.role.name(),
            index: report.frame,
            state,
            why,
            residual_px: report.residual_px,
            offset_deg: [offset.theta_deg, offset.phi_deg],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_acquire::session::PoseDone;
    use gonia_brdf::Direction;
    use gonia_imaging::{PoseOffset, RegistrationFailure};
    use gonia_pipeline::process::{FrameReport, Refusal};
    use serde_json::Value;

    /// A frame without points.
    fn some_frame(frame: u32, role: Role) -> SampledFrame {
        let reading = Pose::from_deg([15.0, 60.0, 30.0, 359.9]);
        SampledFrame {
            report: FrameReport {
                frame,
                role,
                outcome: Outcome::Locked,
                residual_px: 0.031,
                pose_offset: PoseOffset {
                    theta_deg: 0.01,
                    phi_deg: -0.02,
                },
            },
            reading,
            view: reading.view,
            points: Vec::new(),
            mask: None,
        }
    }

    fn board() -> Dashboard {
        let pose = |k: usize| Pose {
            light: Direction::from_deg(15.0, 10.0 * k as f64),
            view: Direction::from_deg(30.0, 0.0),
        };
        let plan: Vec<Pose> = (0..5).map(pose).collect();
        let mut board = Dashboard::new(
            "silk".into(),
            &Rig::paper(100),
            &plan,
            &[Role::Reference, Role::Material],
        );
        board.handle(&SessionEvent::Begin {
            role: Role::Reference,
            missing: &[1, 2, 3, 4],
            planned: 5,
        });
        board
    }

    fn done(board: &mut Dashboard, index: u32, outcome: Outcome) {
        let mut frame = some_frame(index, Role::Reference);
        frame.report.outcome = outcome;
        let done = PoseDone {
            role: Role::Reference,
            index: index as usize,
            at: 0,
            bytes: 0,
            crc: 0,
            pointing_deg: 0.001 * f64::from(index),
            has_lines: Some(true),
        };
        board.handle(&SessionEvent::Pose {
            done: &done,
            frame: &frame,
        });
    }

    fn update(board: &Dashboard, since: u64) -> (u64, Value) {
        let (version, text) = board.update(since, false, false);
        (version, serde_json::from_str(&text).unwrap())
    }

    #[test]
    fn a_browser_is_sent_everything_once_and_then_what_has_changed() {
        let mut board = board();
        let (first, whole) = update(&board, 0);
        assert_eq!(whole["whole"]["plan"].as_array().unwrap().len(), 5);
        assert_eq!(whole["poses"], serde_json::json!([[0, 1]]));
        assert_eq!(whole["done"], 1);

        done(&mut board, 2, Outcome::Locked);
        let lost = RegistrationFailure::LinesMissing { found: 1 };
        done(&mut board, 3, Outcome::Refused(Refusal::NotTheTarget(lost)));
        board.handle(&SessionEvent::GivenUp {
            index: 4,
            why: "reference pose 4: too far",
        });
        let (second, changed) = update(&board, first);
        assert!(changed.get("whole").is_none());
        assert_eq!(
            changed["poses"],
            serde_json::json!([[2, 1], [3, 3], [4, 4]])
        );
        assert_eq!(
            (&changed["done"], &changed["worst_deg"]),
            (&3.into(), &0.003.into())
        );
        assert_eq!(changed["notes"][0]["text"], "reference pose 4: too far");
        // A slow one, which has seen only the beginning, is sent the same and what came after.
        board.handle(&SessionEvent::Discarded(&[2]));
        assert_eq!(
            update(&board, second).1["poses"],
            serde_json::json!([[2, 0]])
        );
        let slow = update(&board, first).1;
        assert_eq!(slow["poses"], serde_json::json!([[2, 0], [3, 3], [4, 4]]));
        assert_eq!(slow["notes"].as_array().unwrap().len(), 1);
        assert_eq!(slow["done"], 2);
    }

    #[test]
    fn another_role_begins_with_an_empty_map_and_the_end_says_how() {
        let mut board = board();
        let (version, _) = update(&board, 0);
        board.handle(&SessionEvent::Begin {
            role: Role::Material,
            missing: &[0, 1, 2, 3, 4],
            planned: 5,
        });
        board.handle(&SessionEvent::Held(true));
        let (_, begun) = update(&board, version);
        assert_eq!(
            (&begun["role"], &begun["phase"]),
            (&"material".into(), &"held".into())
        );
        assert!(begun["poses"].as_array().unwrap().iter().all(|p| p[1] == 0));
        board.end(SessionEnd::Failed, "the lamp is out");
        let (_, ended) = update(&board, 0);
        assert_eq!(
            ended["ended"],
            serde_json::json!(["failed", "the lamp is out"])
        );
    }

    #[test]
    fn the_oldest_notes_go_and_a_plan_never_grows() {
        let mut board = board();
        for k in 0..1000 {
            board.handle(&SessionEvent::Note(&format!("event {k}")));
        }
        done(&mut board, 77, Outcome::Locked);
        let (_, whole) = update(&board, 0);
        let notes = whole["notes"].as_array().unwrap();
        assert_eq!(
            (notes.len(), &notes[0]["text"]),
            (NOTES, &"event 800".into())
        );
        assert_eq!(board.states.len(), 5);
    }
}
