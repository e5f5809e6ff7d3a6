//! Pieces of the fiducial lines, for a calibration of the rig: found near where the rig has them, or from
//! far off.

use super::elsewhere::Elsewhere;
use super::estimate::{MODEL_PX, Trust};
use super::{NEAR_WIDTHS, Registrar};
use crate::hough::LineEdges;
use crate::lines::SIDES;
use crate::refine::{Starts, fit_lines, pieces};
use gonia_brdf::{Elementary, Pose};
use gonia_rig::{CameraShift, Frame};

/// Pieces of a line.
const PIECES: usize = 9;

/// A piece of a fiducial line in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinePoint {
    /// Which coordinate of the target is constant on its line: 0 for x, 1 for y.
    pub axis: usize,
    /// The sign of that coordinate.
    pub sign: f64,
    /// A pixel position on the middle of the line, as the lens shows it.
    pub pixel: [f64; 2],
    /// Pixels across the line a millimetre of the target.
    pub px_per_mm: f64,
    /// Standard uncertainty across the line, pixels: what the noise of the frame leaves.
    pub u_px: f64,
}

/// How far from where the rig has them lines are looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// A rig as it was drawn: camera rolled by 5°, lines within a seventh of the frame's width.
    Far,
    /// Nearer than that, with a camera that may be as far off: at oblique views a wide neighbourhood of a line holds
    /// the one opposite too.
    Aside,
    /// A rig that is known to a hundredth of the frame's width.
    About,
    /// A calibrated rig: a few pixels.
    Near,
}

impl Registrar {
    /// The pieces of the lines that a frame shows; none where the target cannot be recognised. With
    /// [`Search::Near`] some lines may be missing; the other searches want all four.
    pub fn line_points(&self, frame: &Frame, reading: Pose, search: Search) -> Vec<LinePoint> {
        let predicted = self.camera.predict(reading.view, CameraShift::default());
        let shot = self.shot(frame, reading);
        let width = frame.width as f64;
        let (strips, fit) = match search {
            Search::Near => {
                let strips = self.strips(&shot, &predicted, NEAR_WIDTHS * width + 4.0);
                let fit = fit_lines(&strips, &Starts::Predicted, &self.target);
                (strips, fit)
            }
            Search::Far | Search::Aside | Search::About => {
                let (windows, trust) = loose(search, width);
                let found = windows.iter().find_map(|widths| {
                    let sought = (*widths, LineEdges::Both);
                    self.elsewhere(&shot, &predicted, sought, (&trust, &|all| all))
                });
                let Some(Elsewhere { strips, fit, .. }) = found else {
                    return Vec::new();
                };
                (strips, fit)
            }
        };
        let mut points = Vec::new();
        for ((side, strip), line) in SIDES.iter().zip(&strips).zip(&fit.lines) {
            let Some(line) = line else { continue };
            let floor = self.estimator().line_variance(strip);
            for piece in pieces(strip, line.line, fit.sigma_px, PIECES) {
                points.push(LinePoint {
                    axis: side.axis,
                    sign: side.sign,
                    pixel: self.camera.distort(strip.point(piece.s, piece.t)),
                    px_per_mm: piece.px_per_mm,
                    u_px: (1.0 / piece.information + floor).sqrt(),
                });
            }
        }
        points.retain(|p| p.pixel[0].hypotenuse(p.pixel[1]).is_finite() && p.px_per_mm > 0.0);
        points
    }
}

/// How far to look, and how far a camera may be from what the rig says.
fn loose(search: Search, width: f64) -> (&'static [f64], Trust) {
    let is_far = search != Search::About;
    let pick = |far: f64, about: f64| if is_far { far } else { about };
    let trust = Trust {
        arm_deg: pick(1.2, 0.3),
        roll_deg: pick(3.0, 0.5),
        shift_widths: pick(0.04, 0.01),
        // A lens that is not in the rig yet bends the lines by so much.
        model_px: (pick(1e-3, 5e-4) * width).max(5.0 * MODEL_PX),
        ln_scale: pick(0.05, 0.01),
    };
    let windows: &[f64] = match search {
        Search::Far => &[0.15],
        Search::Aside => &[0.08, 0.045],
        Search::About | Search::Near => &[0.03],
    };
    (windows, trust)
}
