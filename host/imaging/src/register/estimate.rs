//! The camera, moved from its reading, that the lines of one frame speak for.

use super::prior::{ARM_DEG, ImagePrior};
use crate::lines::{LineStrip, SIDES};
use crate::refine::FoundLine;
use gonia_brdf::Direction;
use gonia_rig::{CameraModel, CameraShift, Target};
use nalgebra::{DMatrix, DVector};

/// What the pinhole model itself is trusted to, pixels at 1000 pixels' width, and never better than
/// this many pixels.
const MODEL_PX_PER_1000: f64 = 0.05;
pub const MODEL_PX: f64 = 0.02;
/// Floor of a line's own standard error, pixels.
const LINE_FLOOR_PX: f64 = 0.003;
/// With less than a pixel of desk between line and material each can stand in for the other: this
/// many pixels, times 1/gap⁴ − 1, come on top.
const CROWDED_PX: f64 = 0.04;
/// Nothing is believed of a frame in which fewer lines are seen.
pub const MIN_LINES: usize = 3;
/// Sum of squared standard deviations (of fourteen numbers with six unknowns; 8 is usual) above
/// which something is wrong.
pub const MAX_SURPRISE: f64 = 25.0;
/// Standard deviation of an arm that does not hold its 0.03°.
const LOOSE_ARM_DEG: f64 = 0.5;

/// What is known of a camera and its target before the lines of a frame are.
pub struct Estimator<'a> {
    pub camera: &'a CameraModel,
    pub target: &'a Target,
    pub prior: &'a ImagePrior,
}

/// A camera's moves, and the lines that follow.
pub struct Estimate {
    pub shift: CameraShift,
    /// Offset and slope of each line.
    pub lines: [f64; 8],
    pub lines_used: usize,
    /// Sum of squared deviations from the priors and the measured lines, in standard deviations.
    pub surprise: f64,
    /// RMS distance of the measured lines from the moved camera's.
    pub misfit_px: f64,
    /// The largest of roll, shift and magnification, in standard deviations of its prior.
    pub camera_deviation: f64,
}

/// How far reading and model are believed.
pub struct Trust {
    /// Standard deviation of the arm's reading, degrees.
    pub arm_deg: f64,
    /// Standard deviation of the camera's roll, degrees.
    pub roll_deg: f64,
    /// Standard deviation of the image's shift, in frame widths.
    pub shift_widths: f64,
    /// Standard deviation of ln magnification.
    pub ln_scale: f64,
    /// Standard deviation of the model's lines, pixels.
    pub model_px: f64,
}

impl Estimator<'_> {
    /// The estimate that believes most: all lines and the arm's reading; all lines and an arm that
    /// is off; all lines but one, where that one contradicts the rest because something else was
    /// taken for it; at last all lines, and a layout that is not quite what the rig says.
    pub fn best(
        &self,
        view: Direction,
        strips: &[LineStrip; 4],
        lines: &[Option<FoundLine>; 4],
    ) -> Estimate {
        let trusting = self.estimate(view, strips, lines, &self.trust(ARM_DEG));
        if trusting.surprise <= MAX_SURPRISE {
            return trusting;
        }
        let arm_off = self.estimate(view, strips, lines, &self.trust(LOOSE_ARM_DEG));
        if arm_off.surprise <= MAX_SURPRISE {
            return arm_off;
        }
        if arm_off.lines_used == MIN_LINES {
            return arm_off;
        }
        let without = (0..4).map(|i| {
            let mut rest = *lines;
            rest[i] = None;
            self.estimate(view, strips, &rest, &self.trust(ARM_DEG))
        });
        let best = without.min_by(|a, b| a.surprise.total_cmp(&b.surprise));
        if let Some(best) = best.filter(|e| e.surprise <= MAX_SURPRISE) {
            return best;
        }
        let mut trust = self.trust(LOOSE_ARM_DEG);
        trust.model_px = trust.model_px.max(arm_off.misfit_px);
        self.estimate(view, strips, lines, &trust)
    }

    /// What is trusted where the arm's reading has this standard deviation, degrees.
    pub fn trust(&self, arm_deg: f64) -> Trust {
        let width = self.camera.size_px[0] as f64;
        Trust {
            arm_deg,
            roll_deg: self.prior.roll_deg,
            shift_widths: self.prior.shift_widths,
            ln_scale: self.prior.ln_scale,
            model_px: (MODEL_PX_PER_1000 * 1e-3 * width).max(MODEL_PX),
        }
    }

    /// The camera, moved from its reading, that fits the lines best, and the lines as they follow
    /// from it and from their own measurement: offsets and slopes of the four lines are
    /// δ = δ(p) + e, with Gaussian priors on the camera's moves p and on the model's error e.
    pub fn estimate(
        &self,
        view: Direction,
        strips: &[LineStrip; 4],
        lines: &[Option<FoundLine>; 4],
        trust: &Trust,
    ) -> Estimate {
        let tau = trust.model_px;
        let found: Vec<usize> = (0..8).filter(|k| lines[k / 2].is_some()).collect();
        let n = found.len();
        let mut measured = DVector::zeros(n);
        let mut covariance = DMatrix::from_diagonal_element(n, n, tau * tau);
        for (row, pair) in found.chunks_exact(2).enumerate() {
            let Some(line) = &lines[pair[0] / 2] else {
                continue;
            };
            measured[2 * row] = line.line.offset;
            measured[2 * row + 1] = line.line.slope;
            let own = inverse_2x2(line.information);
            for r in 0..2 {
                for c in 0..2 {
                    covariance[(2 * row + r, 2 * row + c)] += own[r][c];
                }
                covariance[(2 * row + r, 2 * row + r)] += self.line_variance(&strips[pair[0] / 2]);
            }
        }
        let failed = Estimate {
            shift: CameraShift::default(),
            lines: [0.0; 8],
            lines_used: n / 2,
            surprise: f64::INFINITY,
            misfit_px: f64::NAN,
            camera_deviation: f64::NAN,
        };
        let Some(weight) = covariance.cholesky().map(|c| c.inverse()) else {
            return failed;
        };
        let scale = self.prior_scale(trust);
        let model = |p: &DVector<f64>| self.line_places(view, shift_from(p, &scale), strips);
        let mut p = DVector::zeros(6);
        let mut places = model(&p);
        for _ in 0..3 {
            let mut jacobian = DMatrix::zeros(n, 6);
            for k in 0..6 {
                let step = 1e-2;
                let mut q = p.clone();
                q[k] += step;
                let moved = model(&q);
                for (row, i) in found.iter().enumerate() {
                    jacobian[(row, k)] = (moved[*i] - places[*i]) / step;
                }
            }
            let residual = DVector::from_fn(n, |row, _| measured[row] - places[found[row]]);
            let normal = jacobian.transpose() * &weight * &jacobian + DMatrix::identity(6, 6);
            let right = jacobian.transpose() * &weight * residual - &p;
            let Some(factor) = normal.cholesky() else {
                return failed;
            };
            p += factor.solve(&right);
            places = model(&p);
        }
        let residual = DVector::from_fn(n, |row, _| measured[row] - places[found[row]]);
        let correction = &weight * &residual * (tau * tau);
        let mut lines = places;
        for (row, i) in found.iter().enumerate() {
            lines[*i] += correction[row];
        }
        Estimate {
            shift: shift_from(&p, &scale),
            lines,
            lines_used: n / 2,
            surprise: (residual.transpose() * &weight * &residual)[0] + p.norm_squared(),
            misfit_px: residual.norm() / (n as f64).sqrt(),
            camera_deviation: p.rows(2, 4).amax(),
        }
    }

    /// What a line's place is trusted to at best, px².
    pub fn line_variance(&self, strip: &LineStrip) -> f64 {
        let gap_mm = self.target.line_offset_mm
            - self.target.material_half_mm
            - 0.5 * self.target.line_width_mm;
        let gap_px = (gap_mm * strip.px_per_mm()).max(1e-3);
        let crowded = CROWDED_PX * (gap_px.powi(-4) - 1.0).max(0.0);
        LINE_FLOOR_PX.powi(2) + crowded * crowded
    }

    /// Standard deviations of the camera's six moves: θ, φ, roll (radians), shift (pixels), ln magnification.
    pub fn prior_scale(&self, trust: &Trust) -> [f64; 6] {
        let shift = trust.shift_widths * self.camera.size_px[0] as f64;
        [
            trust.arm_deg.to_radians(),
            trust.arm_deg.to_radians(),
            trust.roll_deg.to_radians(),
            shift,
            shift,
            trust.ln_scale,
        ]
    }

    /// Offsets and slopes of the four lines, in their strips, for a moved camera.
    pub fn line_places(
        &self,
        view: Direction,
        shift: CameraShift,
        strips: &[LineStrip; 4],
    ) -> [f64; 8] {
        let map = self.camera.predict(view, shift);
        let mut places = [0.0; 8];
        for (i, side) in SIDES.iter().enumerate() {
            let [(s0, t0), (s1, t1)] = side
                .ends_mm(self.target.line_offset_mm)
                .map(|end| strips[i].place(map.apply(end)));
            let slope = (t1 - t0) / (s1 - s0);
            places[2 * i] = t0 - slope * s0;
            places[2 * i + 1] = slope;
        }
        places
    }
}

fn shift_from(p: &DVector<f64>, scale: &[f64; 6]) -> CameraShift {
    CameraShift {
        theta: p[0] * scale[0],
        phi: p[1] * scale[1],
        roll: p[2] * scale[2],
        shift_px: [p[3] * scale[3], p[4] * scale[4]],
        log_scale: p[5] * scale[5],
    }
}

fn inverse_2x2(m: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
    let det = (m[0][0] * m[1][1] - m[0][1] * m[1][0]).max(f64::MIN_POSITIVE);
    [
        [m[1][1] / det, -m[0][1] / det],
        [-m[1][0] / det, m[0][0] / det],
    ]
}
