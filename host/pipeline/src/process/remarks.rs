//! What is to be said of the frames of a source, gathered from any thread and told in their order.

use crate::process::account::{FrameReport, Outcome, Refusal};
use crate::process::{ProcessError, Processed};
use gonia_imaging::RegistrationFailure;
use gonia_rig::{FrameRow, Remark, Role};
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// Remarks of one kind beyond this many are counted, not told.
const MOST: usize = 5;

/// Gathers remarks while frames are processed.
#[derive(Default)]
pub struct HeardRemarks {
    /// By role (the reference's first) and number.
    frames: Mutex<BTreeMap<(bool, u32), Heard>>,
}

/// Of one frame.
struct Heard {
    role: Role,
    /// Why it cannot be used.
    error: Option<ProcessError>,
    remarks: Vec<Remark>,
}

impl HeardRemarks {
    /// What was said of a frame that is used.
    pub fn of_frame(&self, row: &FrameRow, remarks: Vec<Remark>) {
        if !remarks.is_empty() {
            self.hear(row, None, remarks);
        }
    }

    /// A frame that cannot be used.
    pub fn unusable(&self, row: &FrameRow, error: ProcessError) {
        self.hear(row, Some(error), Vec::new());
    }

    fn hear(&self, row: &FrameRow, error: Option<ProcessError>, remarks: Vec<Remark>) {
        let mut frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        let heard = Heard {
            role: row.role,
            error,
            remarks,
        };
        frames.insert((row.role == Role::Material, row.frame), heard);
    }

    /// The result with its remarks; or, where no frame of a role could be used, why the first could not.
    ///
    /// # Errors
    /// The result's own, and that one.
    pub fn judge(
        self,
        rows: &[FrameRow],
        result: Result<Processed, ProcessError>,
    ) -> Result<Processed, ProcessError> {
        let frames = self
            .frames
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        let all = |role: Role| {
            let wanted = rows.iter().filter(|row| row.role == role).count();
            let failed = frames
                .values()
                .filter(|f| f.role == role && f.error.is_some());
            wanted > 0 && failed.count() == wanted
        };
        let lost = [Role::Reference, Role::Material]
            .into_iter()
            .find(|role| all(*role));
        let is_over = match &result {
            Ok(_) => lost.is_some(),
            Err(ProcessError::ReferenceRefused { .. }) => lost == Some(Role::Reference),
            Err(_) => false,
        };
        if is_over {
            let of_role = frames.into_values().filter(|f| Some(f.role) == lost);
            let first = of_role.filter_map(|frame| frame.error).next();
            return match first {
                Some(error) => Err(error),
                None => result,
            };
        }
        let mut processed = result?;
        let mut errors = Vec::new();
        let mut remarks = Vec::new();
        for heard in frames.into_values() {
            errors.extend(heard.error.map(|error| refused(heard.role, &error)));
            remarks.extend(heard.remarks);
        }
        processed
            .remarks
            .extend(unsure_turns(rows, &processed.frames));
        processed
            .remarks
            .extend(some(errors, "frames that cannot be used"));
        processed
            .remarks
            .extend(some(remarks, "frames of which the same can be said"));
        Ok(processed)
    }
}

/// Views closer to the normal than this do not show by the lines whether a frame is turned by 180°:
/// their far side is less than 3 % smaller than their near one.
const UNSURE_THETA_DEG: f64 = 5.0;

/// Where some frames of a source are turned or mirrored, those seen from straight above may be too, and
/// do not show it.
fn unsure_turns(rows: &[FrameRow], frames: &[FrameReport]) -> Option<Remark> {
    let turned = frames.iter().find_map(|frame| match frame.outcome {
        Outcome::Refused(Refusal::NotTheTarget(RegistrationFailure::Turned(turn))) => {
            Some((frame, turn))
        }
        _ => None,
    })?;
    let above = |row: &&FrameRow| row.pose.view.theta_deg() < UNSURE_THETA_DEG;
    let unsure = rows.iter().filter(above).filter(|row| {
        let is_it = |f: &&FrameReport| (f.frame, f.role) == (row.frame, row.role);
        let report = frames.iter().find(is_it);
        report.is_some_and(|f| !matches!(f.outcome, Outcome::Refused(_)))
    });
    let count = unsure.count();
    let (first, turn) = turned;
    (count > 0).then(|| {
        Remark::new(
            "frames",
            format_args!(
                "{} frame {} is {turn}; {count} frames seen from within {UNSURE_THETA_DEG} degrees of the normal are used, and would not show it",
                first.role.name(),
                first.frame
            ),
            "turn all frames as the sensor saw them (dcraw -t 0), and process them again",
        )
    })
}

/// A frame that is left out.
fn refused(role: Role, error: &ProcessError) -> Remark {
    match error {
        ProcessError::Load { frame, source } => Remark::new(
            format_args!("{} frame {frame}", role.name()),
            "is left out",
            source,
        ),
        error => Remark::new(format_args!("{} frame", role.name()), "is left out", error),
    }
}

/// The first few of many remarks, and how many more there are.
fn some(mut remarks: Vec<Remark>, what: &str) -> Vec<Remark> {
    let more = remarks.len().saturating_sub(MOST);
    remarks.truncate(MOST);
    if more > 0 {
        let last = Remark::new(
            "frames",
            format_args!("there are {more} more {what}"),
            "mend these, and run it again",
        );
        remarks.push(last);
    }
    remarks
}
