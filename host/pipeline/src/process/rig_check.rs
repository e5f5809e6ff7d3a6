//! Whether the frames show the rig that `rig.toml` describes.
//!
//! One frame that is not where its pose puts it may be a slip; frames that are all off alike show a rig
//! that is another than it is said to be.

use crate::process::ProcessError;
use crate::process::account::{FrameReport, OffsetStatistics, Outcome, Refusal};
use gonia_brdf::Elementary;
use gonia_imaging::{RegistrationFailure, Turn};
use gonia_rig::{FrameRow, Remark, Rig, Role};
use std::fmt;

/// So many refused frames must agree, and so large a share of all that do not show the target in its place.
const LEAST_ALIKE: usize = 3;
const SHARE_ALIKE: f64 = 0.5;
/// And so large a share of them and those that do: a rig that most frames bear out is what it says.
const SHARE_OF_ALL: f64 = 0.1;
/// Two frames agree within this share of how far they are off, and within these: pixels at 1000 pixels'
/// width, degrees, and a share of the size.
const ALIKE: f64 = 0.25;
const ALIKE_PX_PER_1000: f64 = 2.0;
const ALIKE_DEG: f64 = 0.1;
const ALIKE_SIZE: f64 = 0.002;
/// So many frames must show the target turned alike, and more than this share of those of their role.
const LEAST_TURNED: usize = 2;
const SHARE_TURNED: f64 = 0.15;
/// A larger share of the used frames than this, kept by their pose alone, is said; and no fewer than so many.
const BY_POSE_SHARE: f64 = 0.05;
const LEAST_BY_POSE: usize = 2;
/// What the arms are trusted to, degrees: a mean offset beyond it is no arm's scatter.
const ARM_DEG: f64 = 0.03;
/// Fewer frames make no mean.
const LEAST_OFFSETS: usize = 5;
/// Nearer to the zenith than this an azimuth and a roll are alike, degrees.
const STEEP_DEG: f64 = 20.0;
/// A mean must stand out from its own uncertainty by so many of it.
const CLEAR: f64 = 4.0;

const REMEDY: &str = "run gonia calibrate DIR -o DIR/rig.toml, and process again";
/// The same of a target that lies turned.
const REMEDY_TURNED: &str = "turn it back and take the frames again; where it lay right, correct target.mark_mm, or turn the frames as the sensor saw them";

/// What many frames have in common that do not show the target in its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alike {
    /// Frames that agree.
    frames: usize,
    /// Frames that do not show the target in its place.
    of: usize,
    off: Off,
}

/// How the target is off in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Off {
    Shift([f64; 2]),
    Roll(f64),
    Size(f64),
    Arm(f64),
    Layout,
    Turned(Turn),
}

impl Off {
    fn of(reason: RegistrationFailure) -> Option<Self> {
        Some(match reason {
            RegistrationFailure::Displaced { shift_px } => Self::Shift(shift_px),
            RegistrationFailure::Rolled { roll_deg } => Self::Roll(roll_deg),
            RegistrationFailure::Resized { share } => Self::Size(share),
            RegistrationFailure::FarFromPose { offset_deg } => Self::Arm(offset_deg),
            RegistrationFailure::WrongLayout { .. } => Self::Layout,
            RegistrationFailure::TargetTurned(turn) => Self::Turned(turn),
            RegistrationFailure::LinesMissing { .. } | RegistrationFailure::Turned(_) => {
                return None;
            }
        })
    }

    fn is_like(self, other: Self, width_px: f64) -> bool {
        let within = |a: f64, b: f64, floor: f64| (a - b).abs() <= floor + ALIKE * a.abs();
        match (self, other) {
            (Self::Shift(a), Self::Shift(b)) => {
                let apart = (a[0] - b[0]).hypotenuse(a[1] - b[1]);
                apart <= ALIKE_PX_PER_1000 * 1e-3 * width_px + ALIKE * a[0].hypotenuse(a[1])
            }
            (Self::Roll(a), Self::Roll(b)) | (Self::Arm(a), Self::Arm(b)) => {
                within(a, b, ALIKE_DEG)
            }
            (Self::Size(a), Self::Size(b)) => within(a, b, ALIKE_SIZE),
            (Self::Layout, Self::Layout) => true,
            (Self::Turned(a), Self::Turned(b)) => a == b,
            _ => false,
        }
    }
}

impl fmt::Display for Alike {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of = match self.of {
            of if of == self.frames => format!("all {of}"),
            of => format!("{} of {of}", self.frames),
        };
        if let Off::Turned(turn) = self.off {
            return write!(
                f,
                "the target is {turn}: {of} frames that do not show it as it should lie show its orientation mark there"
            );
        }
        write!(f, "the rig is not what it says: ")?;
        write!(f, "{of} frames that do not show the target in its place ")?;
        match self.off {
            Off::Shift([right, down]) => write!(
                f,
                "show it about {right:+.1} pixels to the right and {down:+.1} down from there"
            ),
            Off::Roll(deg) => write!(
                f,
                "show it turned by about {:.2} degrees {}",
                deg.abs(),
                if deg > 0.0 {
                    "clockwise"
                } else {
                    "anticlockwise"
                }
            ),
            Off::Size(share) => write!(f, "show it about {:+.1} % larger", 100.0 * share),
            Off::Arm(deg) => write!(
                f,
                "put the camera about {deg:.1} degrees from its arm's reading"
            ),
            Off::Layout => write!(
                f,
                "show four lines that are not laid out as its camera sees them"
            ),
            Off::Turned(_) => Ok(()),
        }
    }
}

impl Alike {
    /// As a warning.
    pub fn remark(&self) -> Remark {
        match self.off {
            Off::Turned(_) => Remark::new("frames", self, REMEDY_TURNED),
            _ => Remark::new("rig.toml", self, REMEDY),
        }
    }
}

/// What most of the frames that do not show the target in its place agree in.
pub fn refused_alike(rig: &Rig, frames: &[FrameReport]) -> Option<Alike> {
    let width_px = rig.camera.width_px as f64;
    let not_there = frames.iter().filter_map(|frame| match frame.outcome {
        Outcome::Refused(Refusal::NotTheTarget(reason)) => Some(Off::of(reason)),
        _ => None,
    });
    let not_there: Vec<Option<Off>> = not_there.collect();
    let agree = |off: Off| {
        let like = not_there.iter().flatten();
        like.filter(|other| off.is_like(**other, width_px)).count()
    };
    // The one that most others are like; of equals the first.
    let best = not_there.iter().flatten().map(|off| (*off, agree(*off)));
    let (off, count) = best.reduce(|a, b| if b.1 > a.1 { b } else { a })?;
    let there = frames
        .iter()
        .filter(|frame| frame.outcome == Outcome::Locked)
        .count();
    let least = (SHARE_ALIKE * not_there.len() as f64)
        .max(SHARE_OF_ALL * (there + count) as f64)
        .max(LEAST_ALIKE as f64);
    (count as f64 >= least).then_some(Alike {
        frames: count,
        of: not_there.len(),
        off,
    })
}

/// Refuses a target that lay turned: frames that hide its mark do not show it, and would be used.
pub fn check_orientation(frames: &[FrameReport], role: Role) -> Result<(), ProcessError> {
    let of_role = || frames.iter().filter(|frame| frame.role == role);
    let turns = of_role().filter_map(|frame| match frame.outcome {
        Outcome::Refused(Refusal::NotTheTarget(RegistrationFailure::TargetTurned(turn))) => {
            Some(turn)
        }
        _ => None,
    });
    let turns: Vec<Turn> = turns.collect();
    let count = |turn: Turn| turns.iter().filter(|t| **t == turn).count();
    let most = turns.iter().copied();
    let most = most.reduce(|a, b| if count(b) > count(a) { b } else { a });
    let all = of_role().count();
    let few = |turned: usize| turned < LEAST_TURNED || (turned as f64) <= SHARE_TURNED * all as f64;
    match most {
        Some(turn) if !few(count(turn)) => Err(ProcessError::TargetTurned {
            role,
            turn,
            turned: count(turn),
            frames: all,
        }),
        _ => Ok(()),
    }
}

/// What speaks against the rig in what became of its frames.
pub fn warnings(rig: &Rig, rows: &[FrameRow], frames: &[FrameReport]) -> Vec<Remark> {
    let alike = refused_alike(rig, frames).map(|alike| alike.remark());
    let mut remarks: Vec<Remark> = alike.into_iter().collect();
    remarks.extend(by_pose(frames));
    remarks.extend(arm_offset(rows, frames));
    remarks
}

/// A share of the frames kept by their pose that is not small.
fn by_pose(frames: &[FrameReport]) -> Option<Remark> {
    let count = |is: fn(&Outcome) -> bool| frames.iter().filter(|f| is(&f.outcome)).count();
    let used = count(|outcome| !matches!(outcome, Outcome::Refused(_)));
    let by_pose = count(|outcome| matches!(outcome, Outcome::FellBack(_)));
    let is_many = by_pose >= LEAST_BY_POSE && by_pose as f64 > BY_POSE_SHARE * used as f64;
    is_many.then(|| {
        Remark::new(
            "frames",
            format_args!(
                "{by_pose} of the {used} used are kept by their pose, with fewer than 3 fiducial lines seen: where they see the target rests on rig.toml and the arms' readings alone"
            ),
            "see that the lines are lit, in the frame and not hidden",
        )
    })
}

/// A camera that the lines put elsewhere than its arm says, in the mean of the frames.
fn arm_offset(rows: &[FrameRow], frames: &[FrameReport]) -> Option<Remark> {
    let is_steep = |frame: &FrameReport| {
        let is_it = |row: &&FrameRow| (row.frame, row.role) == (frame.frame, frame.role);
        let row = rows.iter().find(is_it);
        row.is_none_or(|row| row.pose.view.theta_deg() < STEEP_DEG)
    };
    let whole = OffsetStatistics::of(frames)?;
    // Only where a mean is large at all: the search is for every frame.
    if whole.theta_mean_deg.abs().max(whole.phi_mean_deg.abs()) <= ARM_DEG {
        return None;
    }
    let slanting: Vec<FrameReport> = frames.iter().filter(|f| !is_steep(f)).copied().collect();
    let offsets = OffsetStatistics::of(&slanting)?;
    if offsets.frames < LEAST_OFFSETS {
        return None;
    }
    let own = CLEAR / (offsets.frames as f64).sqrt();
    let is_clear = |mean: f64, sd: f64| mean.abs() > ARM_DEG + own * sd;
    let is_off = is_clear(offsets.theta_mean_deg, offsets.theta_sd_deg)
        || is_clear(offsets.phi_mean_deg, offsets.phi_sd_deg);
    is_off.then(|| {
        Remark::new(
            "rig.toml",
            format_args!(
                "the fiducial lines of {} frames put the camera {:+.3} degrees in theta and {:+.3} in phi from its arm's reading, in the mean: the zeros of that arm are off (and the light's may be too, which no line shows)",
                offsets.frames, offsets.theta_mean_deg, offsets.phi_mean_deg
            ),
            REMEDY,
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Pose;
    use gonia_imaging::PoseOffset;

    fn report(frame: u32, outcome: Outcome, theta_deg: f64) -> FrameReport {
        FrameReport {
            frame,
            role: Role::Material,
            outcome,
            residual_px: 0.0,
            pose_offset: PoseOffset {
                theta_deg,
                phi_deg: 0.0,
            },
        }
    }

    fn refused(reason: RegistrationFailure) -> FrameReport {
        report(0, Outcome::Refused(Refusal::NotTheTarget(reason)), 0.0)
    }

    fn alike(frames: &[FrameReport]) -> Option<String> {
        refused_alike(&Rig::paper(640), frames).map(|alike| alike.to_string())
    }

    #[test]
    fn frames_that_are_off_alike_show_another_rig_and_others_do_not() {
        let rolled = |roll_deg| refused(RegistrationFailure::Rolled { roll_deg });
        let shifted = |x| refused(RegistrationFailure::Displaced { shift_px: [x, 0.5] });
        let missing = refused(RegistrationFailure::LinesMissing { found: 0 });
        let said = alike(&[rolled(0.7), missing, rolled(0.72), rolled(0.69)]).unwrap();
        assert!(
            said.contains("3 of 4") && said.contains("0.70 degrees clockwise"),
            "{said}"
        );
        let said = alike(&[shifted(6.0), rolled(0.1), shifted(5.5), shifted(6.2)]).unwrap();
        assert!(said.contains("+6.0 pixels"), "{said}");
        let turned = |turn| refused(RegistrationFailure::TargetTurned(turn));
        let said = alike(&[
            turned(Turn::Left),
            turned(Turn::Left),
            missing,
            turned(Turn::Left),
        ]);
        let said = said.unwrap();
        assert!(
            said.starts_with("the target is turned by 90 degrees anticlockwise: 3 of 4"),
            "{said}"
        );
        assert_eq!(
            alike(&[turned(Turn::Left), turned(Turn::Half), turned(Turn::Right)]),
            None
        );
        // Too few, each its own way, or a minority.
        assert_eq!(alike(&[rolled(0.7), rolled(0.7)]), None);
        assert_eq!(
            alike(&[shifted(6.0), shifted(-6.0), shifted(20.0), rolled(1.0)]),
            None
        );
        let many = [missing; 4];
        assert_eq!(alike(&[&many[..], &[rolled(0.7); 3]].concat()), None);
        // Or few of many that do show it.
        let there = [report(0, Outcome::Locked, 0.0); 30];
        assert_eq!(alike(&[&there[..], &[rolled(0.7); 3]].concat()), None);
        assert!(alike(&[&there[..20], &[rolled(0.7); 3]].concat()).is_some());
    }

    #[test]
    fn a_target_that_lay_turned_is_refused_though_other_frames_hide_it() {
        let turned = |turn| refused(RegistrationFailure::TargetTurned(turn));
        let frames = |turned_frames: &[FrameReport], others: u32| {
            let others = (0..others).map(|i| report(i, Outcome::Locked, 0.0));
            let all: Vec<FrameReport> = others.chain(turned_frames.iter().copied()).collect();
            check_orientation(&all, Role::Material)
        };
        assert!(frames(&[], 5).is_ok());
        assert!(frames(&[turned(Turn::Left); 1], 5).is_ok());
        assert!(frames(&[turned(Turn::Left); 3], 20).is_ok());
        let error = frames(&[turned(Turn::Left); 4], 16)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("anticlockwise in 4 of 20 frames of the material"),
            "{error}"
        );
        let other = [turned(Turn::Half), turned(Turn::Left)];
        assert!(frames(&other, 2).is_ok());
    }

    #[test]
    fn many_frames_kept_by_their_pose_are_said() {
        let kept = |i| report(i, Outcome::Locked, 0.0);
        let lost = RegistrationFailure::LinesMissing { found: 2 };
        let by = |i| report(i, Outcome::FellBack(lost), 0.0);
        let frames = |by_pose: u32| -> Vec<FrameReport> {
            (0..20)
                .map(|i| if i < by_pose { by(i) } else { kept(i) })
                .collect()
        };
        assert_eq!(by_pose(&frames(1)), None);
        assert!(
            by_pose(&frames(2))
                .unwrap()
                .to_string()
                .contains("2 of the 20")
        );
        assert!(by_pose(&frames(20)).is_some());
    }

    #[test]
    fn a_mean_offset_beyond_the_arms_own_is_said() {
        let rows: Vec<FrameRow> = (0..12)
            .map(|frame| FrameRow {
                frame,
                role: Role::Material,
                pose: Pose::from_deg([30.0, 0.0, 45.0, f64::from(frame)]),
                file: String::new(),
            })
            .collect();
        let said = |mean: f64, scatter: f64| {
            let frames: Vec<FrameReport> = (0..12)
                .map(|i| {
                    let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
                    report(i, Outcome::Locked, mean + sign * scatter)
                })
                .collect();
            arm_offset(&rows, &frames)
        };
        assert!(said(0.06, 0.01).unwrap().to_string().contains("+0.060"));
        assert!(said(-0.2, 0.05).is_some());
        assert_eq!(said(0.02, 0.01), None);
        assert_eq!(said(0.04, 0.03), None);
    }
}
