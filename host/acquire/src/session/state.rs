//! What a session has come to: a pure function of its journal's entries.
//!
//! A running session holds one, and applies every entry to it once the entry is on the disk; a session
//! that goes on replays the journal. Both are the same at every line.
//!
//! A pose is *doubtful* until a control pose behind it is as its first take was. When a control pose is
//! not, the doubtful poses are discarded by that entry itself: a program that is killed right after it
//! leaves none of them.

use crate::session::control::Judgement;
use crate::session::entry::{Entry, PoseDone, SessionEnd};
use gonia_rig::Role;
use std::collections::{BTreeMap, BTreeSet};

/// Why an entry cannot follow those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Contradiction {
    /// The plan has fewer poses.
    #[error("{} pose {index} is not in the plan", role.name())]
    NotPlanned {
        /// What lay on the target.
        role: Role,
        /// The pose's place in the plan.
        index: usize,
    },
    /// The pose is done, and was not discarded.
    #[error("{} pose {index} is done twice", role.name())]
    DoneTwice {
        /// What lay on the target.
        role: Role,
        /// The pose's place in the plan.
        index: usize,
    },
}

/// One role of a session.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RoleState {
    /// By place in the plan; each with the line that says so.
    done: BTreeMap<usize, (usize, PoseDone)>,
    given_up: BTreeSet<usize>,
    left_out: BTreeSet<usize>,
    /// The first pose whose fiducial lines were seen, also when it was discarded since: the lamp is to
    /// be as it was there for as long as the session keeps any pose.
    baseline: Option<PoseDone>,
    /// Poses of this line and later ones are doubtful.
    doubtful_since: usize,
    last_control: Option<Judgement>,
    /// Controls that were not as the first take since the last one that was, or since the program began.
    bad_controls: u32,
    /// A program began, or stood still, since the last control.
    is_interrupted: bool,
}

impl RoleState {
    /// The poses that are done, in the plan's order.
    pub fn done(&self) -> impl Iterator<Item = &PoseDone> {
        self.done.values().map(|(_, pose)| pose)
    }

    /// A pose that is done.
    pub fn pose_done(&self, index: usize) -> Option<&PoseDone> {
        self.done.get(&index).map(|(_, pose)| pose)
    }

    /// Poses that are given up for now, or left out for good, and not done.
    pub fn given_up(&self) -> usize {
        let all = self.given_up.union(&self.left_out);
        all.filter(|index| !self.done.contains_key(index)).count()
    }

    /// Whether a person left a pose out.
    pub fn is_left_out(&self, index: usize) -> bool {
        self.left_out.contains(&index)
    }

    /// The pose whose first take the control pose is compared with.
    pub fn baseline(&self) -> Option<&PoseDone> {
        self.baseline.as_ref()
    }

    /// Poses that no good control pose stands behind, in the order in which they were measured.
    pub fn doubtful(&self) -> Vec<usize> {
        let doubtful = |(index, (line, _)): (&usize, &(usize, PoseDone))| {
            (*line >= self.doubtful_since).then_some((*line, *index))
        };
        let mut poses: Vec<(usize, usize)> = self.done.iter().filter_map(doubtful).collect();
        poses.sort_unstable();
        poses.into_iter().map(|(_, index)| index).collect()
    }

    /// The line of the first doubtful pose, or the one from which on poses will be.
    pub fn doubtful_since(&self) -> usize {
        self.doubtful_since
    }

    /// What the last control pose meant.
    pub fn last_control(&self) -> Option<Judgement> {
        self.last_control
    }

    /// Controls in a row that were not as the first take.
    pub fn bad_controls(&self) -> u32 {
        self.bad_controls
    }

    /// Whether the control pose comes before the next pose, when `every` poses may be doubtful.
    pub fn is_control_due(&self, every: usize) -> bool {
        self.baseline.is_some()
            && (self.is_interrupted
                || self.last_control.is_some_and(|j| j != Judgement::Same)
                || self.doubtful().len() >= every)
    }

    fn discard_since(&mut self, since: usize) {
        self.done.retain(|_, (line, _)| *line < since);
    }
}

/// A session, as far as its journal tells.
#[derive(Clone, Debug, PartialEq)]
pub struct SessionState {
    planned: usize,
    drift_limit: f64,
    /// Entries so far: the number of the next line.
    lines: usize,
    material: RoleState,
    reference: RoleState,
    mirror: RoleState,
    frame_bytes: u64,
    has_awaited_material: bool,
    end: Option<(SessionEnd, String)>,
}

impl SessionState {
    /// Before its first entry: of a plan of so many poses, whose control pose may change by the share
    /// `drift_limit`.
    pub fn new(planned: usize, drift_limit: f64) -> Self {
        Self {
            planned,
            drift_limit,
            lines: 0,
            material: RoleState::default(),
            reference: RoleState::default(),
            mirror: RoleState::default(),
            frame_bytes: 0,
            has_awaited_material: false,
            end: None,
        }
    }

    /// One of its roles.
    pub fn role(&self, role: Role) -> &RoleState {
        match role {
            Role::Material => &self.material,
            Role::Reference => &self.reference,
            Role::Mirror => &self.mirror,
        }
    }

    fn role_mut(&mut self, role: Role) -> &mut RoleState {
        match role {
            Role::Material => &mut self.material,
            Role::Reference => &mut self.reference,
            Role::Mirror => &mut self.mirror,
        }
    }

    /// The number of the journal's next line.
    pub fn next_line(&self) -> usize {
        self.lines
    }

    /// How many bytes of frames the journal vouches for, also those of discarded poses.
    pub fn frame_bytes(&self) -> u64 {
        self.frame_bytes
    }

    /// Whether the session ended once so that a person would change the sample. One that was killed
    /// between reference and material did not.
    pub fn has_awaited_material(&self) -> bool {
        self.has_awaited_material
    }

    /// How the last program left it; `None` when it was killed, or still runs.
    pub fn end(&self) -> Option<(SessionEnd, &str)> {
        self.end.as_ref().map(|(end, why)| (*end, why.as_str()))
    }

    /// Poses of a role that are not done, in the plan's order.
    pub fn missing(&self, role: Role) -> Vec<usize> {
        let state = self.role(role);
        let is_missing = |index: &usize| !state.done.contains_key(index);
        (0..self.planned).filter(is_missing).collect()
    }

    /// Poses of a role that are to be measured, in the plan's order: missing, and not given up.
    pub fn to_measure(&self, role: Role) -> Vec<usize> {
        let state = self.role(role);
        let mut poses = self.missing(role);
        poses.retain(|i| !state.given_up.contains(i) && !state.left_out.contains(i));
        poses
    }

    /// Whether nothing is left to do for a role: no pose to be measured, and none doubtful of those that
    /// a control pose can vouch for.
    pub fn is_complete(&self, role: Role) -> bool {
        let state = self.role(role);
        let is_vouched = state.baseline.is_none() || state.doubtful().is_empty();
        is_vouched && self.to_measure(role).is_empty()
    }

    /// Whether an entry can follow.
    ///
    /// # Errors
    /// It contradicts those before it.
    pub fn check(&self, entry: &Entry) -> Result<(), Contradiction> {
        let (role, index) = match entry {
            Entry::Pose(pose) => (pose.role, pose.index),
            Entry::GivenUp(pose) => (pose.role, pose.index),
            Entry::Control(control) => (control.role, control.index),
            _ => return Ok(()),
        };
        if index >= self.planned {
            return Err(Contradiction::NotPlanned { role, index });
        }
        let is_pose = matches!(entry, Entry::Pose(_));
        if is_pose && self.role(role).done.contains_key(&index) {
            return Err(Contradiction::DoneTwice { role, index });
        }
        Ok(())
    }

    /// What the session has come to with one more entry.
    ///
    /// # Errors
    /// As [`Self::check`]; nothing is changed then.
    pub fn apply(&mut self, entry: &Entry) -> Result<(), Contradiction> {
        self.check(entry)?;
        let line = self.lines;
        self.lines += 1;
        self.end = None;
        match entry {
            Entry::Start(_) => {
                let begins = self.material.done.is_empty() && self.reference.done.is_empty();
                for role in [&mut self.material, &mut self.reference] {
                    role.is_interrupted = true;
                    role.bad_controls = 0;
                    role.given_up.clear();
                    // With nothing kept, any lamp will do.
                    if begins {
                        role.baseline = None;
                        role.last_control = None;
                    }
                }
            }
            Entry::Pose(pose) => {
                self.frame_bytes = self.frame_bytes.max(pose.at.saturating_add(pose.bytes));
                let role = self.role_mut(pose.role);
                role.done.insert(pose.index, (line, pose.clone()));
                if role.baseline.is_none() && pose.has_lines == Some(true) {
                    role.baseline = Some(pose.clone());
                    role.is_interrupted = false;
                }
            }
            Entry::GivenUp(pose) => {
                let role = self.role_mut(pose.role);
                let set = if pose.is_left_out {
                    &mut role.left_out
                } else {
                    &mut role.given_up
                };
                set.insert(pose.index);
            }
            Entry::Pause(_) => {
                self.material.is_interrupted = true;
                self.reference.is_interrupted = true;
            }
            Entry::Control(control) => {
                let judgement = control.judge(self.drift_limit);
                let role = self.role_mut(control.role);
                role.last_control = Some(judgement);
                role.is_interrupted = false;
                if judgement == Judgement::Same {
                    role.bad_controls = 0;
                    role.doubtful_since = line + 1;
                } else {
                    role.bad_controls += 1;
                    // A frame that shows nothing speaks against itself, and not yet against the lamp.
                    let shows_nothing =
                        judgement == Judgement::Unconfirmed && control.comparison.is_none();
                    if !shows_nothing {
                        role.discard_since(role.doubtful_since);
                    }
                }
            }
            Entry::Discard { role, since, .. } => {
                for each in Role::ALL
                    .into_iter()
                    .filter(|r| role.is_none_or(|role| role == *r))
                {
                    self.role_mut(each).discard_since(*since);
                }
            }
            Entry::Event(_) => {}
            Entry::Stop(end, why) => {
                self.has_awaited_material |= *end == SessionEnd::AwaitsMaterial;
                self.end = Some((*end, why.clone()));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn replayed(lines: &[&str]) -> SessionState {
        let mut state = SessionState::new(10, 0.02);
        for line in lines {
            state.apply(&Entry::parse(line).unwrap()).unwrap();
        }
        state
    }

    fn done(state: &SessionState, role: Role) -> Vec<usize> {
        state.role(role).done().map(|pose| pose.index).collect()
    }

    const SAME: &str = "control material pose 0: brightness +0.01 %, points scatter 0.10 %, marks moved 0.001 degrees";
    const DARK: &str = "control material pose 0: brightness -10.00 %, points scatter 0.10 %, marks moved 0.001 degrees";

    #[test]
    fn an_older_journal_that_kept_doubtful_poses_over_a_kill_keeps_them_no_more() {
        let pose = |i: usize| {
            format!(
                "pose material {i} at={} bytes=9 crc=00000001 pointing=0.001000",
                9 * i
            )
        };
        let poses: Vec<String> = (0..5).map(pose).collect();
        let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|i| poses[i].as_str());
        // As the older program left it: no void after the control that was a tenth darker.
        let state = replayed(&[
            "start gonia 0.1.0",
            a,
            b,
            SAME,
            c,
            d,
            "start gonia 0.1.0",
            DARK,
            "event the lamp has drifted",
            SAME,
            e,
            SAME,
            "stop finished every pose is done",
        ]);
        assert_eq!(done(&state, Role::Material), [0, 1, 4]);
        assert_eq!(state.role(Role::Material).doubtful(), [0usize; 0]);
        assert_eq!(state.to_measure(Role::Material), [2, 3, 5, 6, 7, 8, 9]);
        // Its void is of both roles.
        let state = replayed(&["start gonia 0.1.0", a, b, "void since=2 the lamp is darker"]);
        assert_eq!(done(&state, Role::Material), [0]);
    }

    #[test]
    fn what_no_entry_can_follow_is_refused_and_changes_nothing() {
        let mut state =
            replayed(&["pose material 3 at=0 bytes=9 crc=00000001 pointing=0.001000 lines=seen"]);
        let before = state.clone();
        for (line, expected) in [
            (
                "pose material 3 at=9 bytes=9 crc=00000001 pointing=0.001000",
                "material pose 3 is done twice",
            ),
            (
                "pose reference 10 at=9 bytes=9 crc=00000001 pointing=0.001000",
                "reference pose 10 is not in the plan",
            ),
            (
                "left-out material pose 10: by hand",
                "material pose 10 is not in the plan",
            ),
        ] {
            let refused = state.apply(&Entry::parse(line).unwrap()).unwrap_err();
            assert_eq!(refused.to_string(), expected);
            assert_eq!(state, before);
        }
    }
}
