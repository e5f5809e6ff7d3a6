//! A target that is not where its pose puts it: where else it is, and what that says of the frame or the rig.

use super::estimate::{Estimate, MAX_SURPRISE, MIN_LINES, Trust};
use super::prior::ARM_DEG;
use super::{NEAR_WIDTHS, Registrar, RegistrationFailure, SEARCH_WIDTHS, Shot};
use crate::hough::LineEdges;
use crate::lines::LineStrip;
use crate::refine::{LineFit, Starts, fit_lines};
use crate::turn::Turn;
use gonia_brdf::Elementary;
use gonia_rig::{CameraShift, Homography, Target};

/// Standard deviation of the roll of a camera that is not mounted as rig.toml says.
const LOOSE_ROLL_DEG: f64 = 1.0;
/// Half the width of the neighbourhood in which a displaced target is looked for.
const FAR_WIDTHS: f64 = 0.15;

/// Four lines that are not where they were predicted.
pub(super) struct Elsewhere {
    pub strips: [LineStrip; 4],
    pub fit: LineFit,
    pub estimate: Estimate,
}

impl Registrar {
    /// A failure, or what is behind it where the whole target is elsewhere.
    pub(super) fn explain(
        &self,
        shot: &Shot<'_>,
        predicted: &Homography,
        failure: RegistrationFailure,
    ) -> RegistrationFailure {
        if let Some(turn) = self.turned(shot, predicted) {
            return RegistrationFailure::Turned(turn);
        }
        if let RegistrationFailure::FarFromPose { .. } = failure {
            return failure;
        }
        // A target that is moved along two of its lines shows those two in their places.
        let found = [SEARCH_WIDTHS, FAR_WIDTHS]
            .into_iter()
            .find_map(|within| self.displacement(shot, predicted, within));
        match found {
            Some(by) => {
                // What moves the fiducial lines most.
                let radius_px = predicted_radius_px(predicted, &self.target);
                let by_roll = by.roll.abs() * radius_px;
                let by_size = by.log_scale.abs() * radius_px;
                let by_shift = by.shift_px[0].hypotenuse(by.shift_px[1]);
                if by_roll > by_shift.max(by_size) {
                    let roll_deg = by.roll.to_degrees();
                    RegistrationFailure::Rolled { roll_deg }
                } else if by_size > by_shift {
                    let share = by.log_scale.exponential() - 1.0;
                    RegistrationFailure::Resized { share }
                } else {
                    let shift_px = by.shift_px;
                    RegistrationFailure::Displaced { shift_px }
                }
            }
            None => failure,
        }
    }

    /// How a frame in which the lines are not where they should be was turned, when they are once it is
    /// turned back. A square target straight from above, or along an axis of its symmetry, is the same either
    /// way: there nothing is said.
    fn turned(&self, shot: &Shot<'_>, predicted: &Homography) -> Option<Turn> {
        let near_px = NEAR_WIDTHS * shot.frame.width as f64 + 4.0;
        let size_px = [shot.frame.width, shot.frame.height].map(|px| px as f64);
        Turn::ALL.into_iter().find(|turn| {
            if moves_by_px(*turn, predicted, &self.target, size_px) < near_px {
                return false;
            }
            let Some(frame) = turn.undo(shot.frame) else {
                return false;
            };
            let as_taken = Shot {
                frame: &frame,
                ..*shot
            };
            let strips = self.strips(&as_taken, predicted, near_px);
            let lines = fit_lines(&strips, &Starts::Predicted, &self.target).lines;
            // All of them, where a trusted camera sees them: fewer may be others' that happen to fit.
            lines.iter().all(Option::is_some)
                && self
                    .estimator()
                    .estimate(shot.view, &strips, &lines, &self.estimator().trust(ARM_DEG))
                    .surprise
                    <= MAX_SURPRISE
        })
    }

    /// How the whole target is moved and turned from its place, where it is within so many frame widths: a
    /// camera whose image is moved (and turned a little) must see all four lines.
    fn displacement(
        &self,
        shot: &Shot<'_>,
        predicted: &Homography,
        within_widths: f64,
    ) -> Option<CameraShift> {
        let trust = Trust {
            shift_widths: within_widths,
            roll_deg: LOOSE_ROLL_DEG,
            ..self.estimator().trust(ARM_DEG)
        };
        let moved = |guess: CameraShift| CameraShift {
            shift_px: guess.shift_px,
            roll: guess.roll,
            ..CameraShift::default()
        };
        let found = self.elsewhere(
            shot,
            predicted,
            (within_widths, LineEdges::Together),
            (&trust, &moved),
        )?;
        Some(found.estimate.shift)
    }

    /// The four lines within so many frame widths of their predictions, where a camera within `trust` sees
    /// them. `taken` says what of a first guess is taken for where they are looked at closely.
    pub(super) fn elsewhere(
        &self,
        shot: &Shot<'_>,
        predicted: &Homography,
        (within_widths, edges): (f64, LineEdges),
        (trust, taken): (&Trust, &dyn Fn(CameraShift) -> CameraShift),
    ) -> Option<Elsewhere> {
        let (view, width) = (shot.view, shot.frame.width as f64);
        let search_px = within_widths * width + 4.0;
        let strips = self.strips(shot, predicted, search_px);
        let hough = self.hough(shot.frame, &strips, search_px, edges);
        let lines = fit_lines(&strips, &Starts::Around(hough), &self.target).lines;
        // One of them may be something else's.
        let choices = (0..=4).map(|out| {
            let mut some = lines;
            if let Some(line) = some.get_mut(out) {
                *line = None;
            }
            some
        });
        choices.rev().find_map(|some| {
            if some.iter().flatten().count() < MIN_LINES {
                return None;
            }
            let guess = taken(self.estimator().estimate(view, &strips, &some, trust).shift);
            let there = self.camera.predict(view, guess);
            let strips = self.strips(shot, &there, NEAR_WIDTHS * width + 4.0);
            let fit = fit_lines(&strips, &Starts::Predicted, &self.target);
            let estimate = self.estimator().estimate(view, &strips, &fit.lines, trust);
            let fits = fit.lines.iter().all(Option::is_some) && estimate.surprise <= MAX_SURPRISE;
            fits.then_some(Elsewhere {
                strips,
                fit,
                estimate,
            })
        })
    }
}

/// How far a turn moves the corners of the fiducial lines from where any of them is, at most.
fn moves_by_px(turn: Turn, predicted: &Homography, target: &Target, size_px: [f64; 2]) -> f64 {
    let mm = target.line_offset_mm;
    let corners = [[-mm, -mm], [mm, -mm], [mm, mm], [-mm, mm]].map(|at| predicted.apply(at));
    let to_nearest = |at: [f64; 2]| {
        let apart = corners.map(|c| (c[0] - at[0]).hypotenuse(c[1] - at[1]));
        apart.into_iter().fold(f64::INFINITY, f64::min)
    };
    let turned = corners.map(|corner| to_nearest(turn.seen_at(corner, size_px)));
    turned.into_iter().fold(0.0, f64::max)
}

/// Half the distance on the frame between two opposite fiducial lines.
fn predicted_radius_px(predicted: &Homography, target: &Target) -> f64 {
    let [a, b] = [-1.0, 1.0].map(|side| predicted.apply([side * target.line_offset_mm, 0.0]));
    0.5 * (a[0] - b[0]).hypotenuse(a[1] - b[1])
}
