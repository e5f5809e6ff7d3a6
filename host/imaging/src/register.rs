//! Registration: where the target is in a frame, and where the camera must have been.
//!
//! Sobel and Hough find each line near its prediction, a least-squares fit of the blurred profile
//! places it to hundredths of a pixel, and crossings make the homography. The rig's camera, moved a
//! little, is the prior: what a grazing or half-hidden line leaves open is filled in from it, and
//! the move is the estimate of the arms' error.

mod elsewhere;
mod estimate;
mod line_points;
mod mark;
mod prior;

use crate::IdealLight;
use crate::hough::{LineEdges, StripLine, strongest_line};
use crate::lines::{LineStrip, SIDES, rows_of_strips};
use crate::refine::{LineFit, Starts, fit_lines};
use crate::turn::Turn;
use estimate::{Estimate, Estimator, MAX_SURPRISE, MIN_LINES};
use gonia_brdf::Elementary;
use gonia_brdf::{Direction, Pose};
use gonia_rig::{CameraModel, CameraShift, Frame, Homography, Rig, Target};
use prior::{ARM_DEG, ImagePrior};
use std::ops::Range;

/// Lines that the moved camera misses by more than this share of the width are not the target's.
const MISFIT_WIDTHS: f64 = 6e-4;
/// Nor are lines that want roll, shift or magnification this many standard deviations off.
const MAX_DEVIATION: f64 = 6.0;
/// Nor are lines that want the arm this far from its reading.
const MAX_OFFSET_DEG: f64 = 1.0;
/// Size of Hough's bins: see [`Registrar::with_hough_resolution`].
const HOUGH_RESOLUTION: f64 = 0.5;
/// Half the width of the neighbourhood searched: this share of the frame's width and 4 pixels.
const SEARCH_WIDTHS: f64 = 0.02;
/// Half the width of the neighbourhood in which a trusted camera sees the lines, likewise.
const NEAR_WIDTHS: f64 = 1e-3;
/// A line further than this from its prediction is measured again from a better one.
const RELINEARIZE_PX: f64 = 1.5;

/// Finds the target of one rig in frames.
#[derive(Clone, Debug)]
pub struct Registrar {
    rig: Rig,
    camera: CameraModel,
    target: Target,
    prior: ImagePrior,
    hough_resolution: f64,
}

/// A frame, and what its arms let one expect in it.
struct Shot<'a> {
    frame: &'a Frame,
    /// The camera arm's reading.
    view: Direction,
    light: IdealLight,
}

/// Where the target is in one frame.
#[derive(Clone, Debug)]
pub struct Registration {
    /// Millimetres on the target to ideal pixels; [`Registration::project`] adds the lens.
    pub pixel_from_target: Homography,
    /// RMS distance of the lines' points from the lines, pixels; 0 when none was found.
    pub residual_px: f64,
    /// Estimated true camera direction minus the arm's reading; zero after a fall-back.
    pub pose_offset: PoseOffset,
    /// The camera's direction as estimated.
    pub view: Direction,
    /// Standard deviation of the image's blur, pixels, as the lines show it.
    pub blur_px: f64,
    /// How many of the four lines were found; when locked, how many were used.
    pub lines_found: usize,
    /// Whether the fiducial lines carry this registration.
    pub state: RegistrationState,
    /// How far the lines' crossings are from where the rig has them; `None` after a fall-back.
    pub off: Option<OffPlace>,
    camera: CameraModel,
}

/// How far the crossings of the fiducial lines are from where a rig has them at the arms' reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffPlace {
    /// RMS distance, pixels.
    pub px: f64,
    /// The largest deviation of arm, roll, image shift and magnification that shows it, in standard deviations:
    /// of what the rig's calibration leaves open, and what arms, mounts and lenses change from frame to frame.
    pub deviations: f64,
}

/// Estimated true shaft angles minus the reading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseOffset {
    /// Of the camera's polar angle, degrees.
    pub theta_deg: f64,
    /// Of the camera's azimuth, degrees.
    pub phi_deg: f64,
}

/// Whether a registration stands on the fiducial lines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RegistrationState {
    /// It does.
    Locked,
    /// It is the prediction from the arms' reading.
    FellBack(RegistrationFailure),
}

/// Why the fiducial lines could not be trusted.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RegistrationFailure {
    /// Too few lines stand out from their surroundings.
    #[error("only {found} of the 4 lines could be found near where the pose puts them")]
    LinesMissing {
        /// Lines that were found.
        found: usize,
    },
    /// The lines found are not those of the target under this camera.
    #[error(
        "the lines found are not laid out as this camera sees the target's (they miss by {misfit_px:.2} pixels, at {deviation:.0} times the camera's usual deviations)"
    )]
    WrongLayout {
        /// RMS distance from the best camera, pixels.
        misfit_px: f64,
        /// How far that camera's roll, shift or magnification is off, in standard deviations.
        deviation: f64,
    },
    /// The lines found are those of the target, but all of it is elsewhere in the frame.
    #[error(
        "the target is seen {:+.1} pixels to the right and {:+.1} down from there",
        tenths(.shift_px[0]), tenths(.shift_px[1])
    )]
    Displaced {
        /// How far right and down of its place the target is, pixels.
        shift_px: [f64; 2],
    },
    /// The lines found are those of the target, but the camera is rolled.
    #[error(
        "the target is seen turned by {:.2} degrees {} from there",
        .roll_deg.abs(), if *.roll_deg > 0.0 { "clockwise" } else { "anticlockwise" }
    )]
    Rolled {
        /// Turn about the optical axis, clockwise, degrees.
        roll_deg: f64,
    },
    /// The lines found are those of the target, but of another size.
    #[error("the target is seen {:+.2} % larger than there", 100.0 * .share)]
    Resized {
        /// By what share of its size the target is larger than it should be.
        share: f64,
    },
    /// The lines are where they should be once the frame is turned back.
    #[error("the frame is {0}")]
    Turned(Turn),
    /// The lines are where they should be, and the orientation mark is beside another of them.
    #[error("the target (or every frame) is {0}, as its orientation mark shows")]
    TargetTurned(Turn),
    /// The lines ask for a camera too far from its arm's reading.
    #[error("the lines put the camera {offset_deg:.1} degrees from its arm's reading")]
    FarFromPose {
        /// Angle between reading and estimate.
        offset_deg: f64,
    },
}

/// Rounded to what is printed, without the sign of nothing: that depends on the processor.
fn tenths(px: f64) -> f64 {
    (10.0 * px).round() / 10.0 + 0.0
}

impl Registration {
    /// The pixel that shows a point of the target (mm).
    pub fn project(&self, point_mm: [f64; 2]) -> [f64; 2] {
        self.camera.distort(self.pixel_from_target.apply(point_mm))
    }

    /// The camera of the rig.
    pub fn camera(&self) -> &CameraModel {
        &self.camera
    }
}

impl Registrar {
    /// For the frames of a rig.
    pub fn new(rig: &Rig) -> Self {
        Self {
            rig: rig.clone(),
            camera: CameraModel::new(rig),
            target: rig.target.clone(),
            prior: ImagePrior::of(rig),
            hough_resolution: HOUGH_RESOLUTION,
        }
    }

    /// With another size of Hough's bins, in half widths of a line; 0.5 is the default.
    #[must_use]
    pub fn with_hough_resolution(mut self, half_widths: f64) -> Self {
        self.hough_resolution = half_widths;
        self
    }

    /// Registers a frame taken at the given reading of the arms. Never fails: without fiducial
    /// lines it falls back to the prediction, and says so.
    pub fn register(&self, frame: &Frame, reading: Pose) -> Registration {
        let predicted = self.camera.predict(reading.view, CameraShift::default());
        let shot = self.shot(frame, reading);
        match self.locate(&shot, &predicted) {
            Ok((solution, _)) => match self.target_turned(frame, &solution.homography) {
                None => self.locked(reading, solution),
                Some(turn) => {
                    let reason = RegistrationFailure::TargetTurned(turn);
                    self.fell_back(reading, predicted, &solution.failing(reason))
                }
            },
            Err(mut failure) => {
                failure.reason = self.explain(&shot, &predicted, failure.reason);
                // Kept by its pose, a frame must not show a turned target either.
                if let RegistrationFailure::LinesMissing { .. } = failure.reason
                    && let Some(turn) = self.target_turned(frame, &predicted)
                {
                    failure.reason = RegistrationFailure::TargetTurned(turn);
                }
                self.fell_back(reading, predicted, &failure)
            }
        }
    }

    fn fell_back(&self, reading: Pose, predicted: Homography, failure: &Failure) -> Registration {
        Registration {
            pixel_from_target: predicted,
            residual_px: failure.scatter_px,
            pose_offset: PoseOffset::default(),
            view: self
                .camera
                .placement(reading.view, CameraShift::default())
                .direction(),
            blur_px: failure.blur_px,
            lines_found: failure.lines_found,
            state: RegistrationState::FellBack(failure.reason),
            off: None,
            camera: self.camera.clone(),
        }
    }

    /// Registers a frame of which only the rows `read` are there, usually [`Registrar::rows`]. None when the
    /// fiducial lines are not where the pose puts them, or the search for them left these rows: then the
    /// whole frame is needed, and [`Registrar::register`] would give the same otherwise.
    pub fn register_rows(
        &self,
        frame: &Frame,
        reading: Pose,
        read: &Range<usize>,
    ) -> Option<Registration> {
        let covers = |map: &Homography| {
            let needed = self.rows_about(map);
            read.start <= needed.start && needed.end <= read.end
        };
        let predicted = self.camera.predict(reading.view, CameraShift::default());
        if !covers(&predicted) {
            return None;
        }
        let (solution, about) = self.locate(&self.shot(frame, reading), &predicted).ok()?;
        // Lines far from their prediction were measured again about a better one.
        let is_whole = covers(&about) && covers(&solution.homography);
        let is_turned = || self.target_turned(frame, &solution.homography).is_some();
        (is_whole && !is_turned()).then(|| self.locked(reading, solution))
    }

    /// The rows of a frame taken at a view that show the target, if it is about where the pose puts it,
    /// and all that the search for its lines there looks at.
    pub fn rows(&self, view: Direction) -> Range<usize> {
        self.rows_about(&self.camera.predict(view, CameraShift::default()))
    }

    fn rows_about(&self, pixel_from_target: &Homography) -> Range<usize> {
        let search_px = SEARCH_WIDTHS * self.camera.size_px[0] as f64 + 4.0;
        let strips = rows_of_strips(&self.camera, pixel_from_target, &self.target, search_px);
        match self.rows_of_marks(pixel_from_target) {
            Some(marks) => strips.start.min(marks.start)..strips.end.max(marks.end),
            None => strips,
        }
    }

    fn locked(&self, reading: Pose, solution: Solution) -> Registration {
        Registration {
            off: Some(self.off_place(reading.view, &solution)),
            view: self
                .camera
                .placement(reading.view, solution.shift)
                .direction(),
            pose_offset: PoseOffset {
                theta_deg: solution.shift.theta.to_degrees(),
                phi_deg: solution.shift.phi.to_degrees(),
            },
            pixel_from_target: solution.homography,
            residual_px: solution.scatter_px,
            blur_px: solution.blur_px,
            lines_found: solution.lines_found,
            state: RegistrationState::Locked,
            camera: self.camera.clone(),
        }
    }

    fn off_place(&self, view: Direction, solution: &Solution) -> OffPlace {
        let predicted = self.camera.predict(view, CameraShift::default());
        let a = self.target.line_offset_mm;
        let squares = [[-a, -a], [a, -a], [a, a], [-a, a]].map(|corner| {
            let (here, there) = (predicted.apply(corner), solution.homography.apply(corner));
            (here[0] - there[0]).powi(2) + (here[1] - there[1]).powi(2)
        });
        let by = solution.shift;
        let moves = [
            by.theta,
            by.phi * view.theta.sine(),
            by.roll,
            by.shift_px[0],
            by.shift_px[1],
            by.log_scale,
        ];
        let scale = self
            .estimator()
            .prior_scale(&self.estimator().trust(ARM_DEG));
        OffPlace {
            px: (squares.iter().sum::<f64>() / 4.0).sqrt(),
            deviations: (moves.iter().zip(scale))
                .map(|(by, sd)| by.abs() / sd)
                .fold(0.0, f64::max),
        }
    }

    fn estimator(&self) -> Estimator<'_> {
        Estimator {
            camera: &self.camera,
            target: &self.target,
            prior: &self.prior,
        }
    }

    fn shot<'a>(&self, frame: &'a Frame, reading: Pose) -> Shot<'a> {
        Shot {
            frame,
            view: reading.view,
            light: IdealLight::new(&self.rig, reading.light),
        }
    }

    /// Where the lines are, and the map about which they were looked for at last.
    fn locate(
        &self,
        shot: &Shot<'_>,
        predicted: &Homography,
    ) -> Result<(Solution, Homography), Failure> {
        let solution = self.solve(shot, predicted)?;
        if solution.furthest_px > RELINEARIZE_PX {
            let about = solution.homography;
            return Ok((self.solve(shot, &about)?, about));
        }
        Ok((solution, predicted.clone()))
    }

    /// The strongest lines within `search_px` of their predictions.
    fn hough(
        &self,
        frame: &Frame,
        strips: &[LineStrip; 4],
        search_px: f64,
        edges: LineEdges,
    ) -> [Option<StripLine>; 4] {
        let half_width = 0.5 * self.target.line_width_mm;
        let bins = self.hough_resolution;
        strips
            .each_ref()
            .map(|strip| strongest_line(frame, strip, half_width, search_px, bins, edges))
    }

    fn solve(&self, shot: &Shot<'_>, predicted: &Homography) -> Result<Solution, Failure> {
        let (view, width) = (shot.view, shot.frame.width as f64);
        let strips = self.strips(shot, predicted, NEAR_WIDTHS * width + 4.0);
        let fit = fit_lines(&strips, &Starts::Predicted, &self.target);
        if fit.lines.iter().all(Option::is_some) {
            let estimate = self.estimator().estimate(
                view,
                &strips,
                &fit.lines,
                &self.estimator().trust(ARM_DEG),
            );
            // All four lines where a trusted camera sees them: no need to look elsewhere.
            if estimate.surprise <= MAX_SURPRISE {
                return self.settle(view, &strips, fit, estimate);
            }
        }
        let search_px = SEARCH_WIDTHS * width + 4.0;
        let strips = self.strips(shot, predicted, search_px);
        let hough = self.hough(shot.frame, &strips, search_px, LineEdges::Together);
        self.search(view, &strips, hough).or_else(|failure| {
            // A striped fabric may have lines of its own, stronger than the fiducial lines beside them.
            let again = self.search(view, &strips, [None; 4]);
            again.map_err(|second| match second.reason {
                // Hidden lines, and others where the pose has them: that says more.
                RegistrationFailure::LinesMissing { found } if found > 0 => second,
                _ => failure,
            })
        })
    }

    /// The neighbourhoods of the four lines, `search_px` to either side.
    fn strips(&self, shot: &Shot<'_>, predicted: &Homography, search_px: f64) -> [LineStrip; 4] {
        SIDES.map(|side| {
            LineStrip::cut(
                shot.frame,
                &self.camera,
                predicted,
                &self.target,
                side,
                &shot.light,
                search_px,
            )
        })
    }

    /// Looks for the lines about the prediction and where Hough found some.
    fn search(
        &self,
        view: Direction,
        strips: &[LineStrip; 4],
        hough: [Option<StripLine>; 4],
    ) -> Result<Solution, Failure> {
        let fit = fit_lines(strips, &Starts::Around(hough), &self.target);
        let found = fit.lines.iter().flatten().count();
        if found < MIN_LINES {
            // Even those few must be where the pose has them, or they are something else.
            let estimate = self.estimator().estimate(
                view,
                strips,
                &fit.lines,
                &self.estimator().trust(ARM_DEG),
            );
            if found > 0 && estimate.surprise > MAX_SURPRISE {
                return Err(Failure::new(wrong_layout(&estimate), &fit));
            }
            return Err(Failure::new(
                RegistrationFailure::LinesMissing { found },
                &fit,
            ));
        }
        let estimate = self.estimator().best(view, strips, &fit.lines);
        self.settle(view, strips, fit, estimate)
    }

    /// Judges four fitted lines, and makes the homography of them.
    fn settle(
        &self,
        view: Direction,
        strips: &[LineStrip; 4],
        fit: LineFit,
        estimate: Estimate,
    ) -> Result<Solution, Failure> {
        let width = self.camera.size_px[0] as f64;
        let fits = estimate.misfit_px <= (MISFIT_WIDTHS * width).max(0.2)
            && estimate.camera_deviation <= MAX_DEVIATION
            // Three lines may not overrule the rig.
            && (estimate.lines_used > MIN_LINES || estimate.surprise <= MAX_SURPRISE);
        if !fits {
            return Err(Failure::new(wrong_layout(&estimate), &fit));
        }
        let shift = estimate.shift;
        let offset_deg = shift
            .theta
            .hypotenuse(shift.phi * view.theta.sine())
            .to_degrees();
        if offset_deg > MAX_OFFSET_DEG {
            return Err(Failure::new(
                RegistrationFailure::FarFromPose { offset_deg },
                &fit,
            ));
        }
        let Some(homography) = self.homography(strips, &estimate.lines) else {
            return Err(Failure::new(wrong_layout(&estimate), &fit));
        };
        let furthest_px = estimate.lines.iter().map(|l| l.abs()).fold(0.0, f64::max);
        Ok(Solution {
            homography,
            shift,
            scatter_px: scatter(&fit),
            blur_px: fit.sigma_px,
            lines_found: estimate.lines_used,
            furthest_px,
        })
    }

    /// The homography through the crossings of four lines given by offset and slope.
    fn homography(&self, strips: &[LineStrip; 4], lines: &[f64; 8]) -> Option<Homography> {
        let line = |i: usize| {
            let end = |s: f64| strips[i].point(s, lines[2 * i] + lines[2 * i + 1] * s);
            [end(-1.0), end(1.0)]
        };
        let a = self.target.line_offset_mm;
        let corners = [[-a, -a], [a, -a], [a, a], [-a, a]];
        let mut seen = [[0.0; 2]; 4];
        for (seen, [x, y]) in seen.iter_mut().zip(corners) {
            let across = line(usize::from(x > 0.0));
            let along = line(2 + usize::from(y > 0.0));
            *seen = crossing(across, along)?;
        }
        Homography::from_corners(&corners, &seen)
    }
}

struct Solution {
    homography: Homography,
    shift: CameraShift,
    scatter_px: f64,
    blur_px: f64,
    lines_found: usize,
    furthest_px: f64,
}

impl Solution {
    /// As a failure for another reason than its lines.
    fn failing(&self, reason: RegistrationFailure) -> Failure {
        Failure {
            reason,
            scatter_px: self.scatter_px,
            blur_px: self.blur_px,
            lines_found: self.lines_found,
        }
    }
}

/// Why there is no solution, and what was seen nevertheless.
struct Failure {
    reason: RegistrationFailure,
    scatter_px: f64,
    blur_px: f64,
    lines_found: usize,
}

impl Failure {
    fn new(reason: RegistrationFailure, fit: &LineFit) -> Self {
        Self {
            reason,
            scatter_px: scatter(fit),
            blur_px: fit.sigma_px,
            lines_found: fit.lines.iter().flatten().count(),
        }
    }
}

fn wrong_layout(estimate: &Estimate) -> RegistrationFailure {
    RegistrationFailure::WrongLayout {
        misfit_px: estimate.misfit_px,
        deviation: estimate.camera_deviation,
    }
}

fn scatter(fit: &LineFit) -> f64 {
    let found: Vec<f64> = fit.lines.iter().flatten().map(|l| l.scatter_px).collect();
    let sum: f64 = found.iter().map(|s| s * s).sum();
    (sum / found.len().max(1) as f64).sqrt()
}

/// Where two lines, each through two points, cross. `None` for parallel ones.
fn crossing(a: [[f64; 2]; 2], b: [[f64; 2]; 2]) -> Option<[f64; 2]> {
    let d = [a[1][0] - a[0][0], a[1][1] - a[0][1]];
    let e = [b[1][0] - b[0][0], b[1][1] - b[0][1]];
    let det = d[0] * e[1] - d[1] * e[0];
    if det.abs() < 1e-9 {
        return None;
    }
    let g = [b[0][0] - a[0][0], b[0][1] - a[0][1]];
    let t = (g[0] * e[1] - g[1] * e[0]) / det;
    Some([a[0][0] + t * d[0], a[0][1] + t * d[1]])
}

#[cfg(test)]
mod photographs;

pub use line_points::{LinePoint, Search};
pub use mark::Orientation;
