//! What a frame's camera is trusted to before its lines are seen.

use gonia_brdf::Direction;
use gonia_rig::{CameraModel, CameraShift, Rig};
use nalgebra::{DMatrix, SMatrix};

/// The arms hold their angles to this, degrees.
pub const ARM_DEG: f64 = 0.03;

/// Standard deviations of how a frame's image differs from what the rig predicts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImagePrior {
    /// Turn about the optical axis, degrees.
    pub roll_deg: f64,
    /// Shift, in frame widths.
    pub shift_widths: f64,
    /// Logarithm of the magnification.
    pub ln_scale: f64,
}

/// Of a rig that was built with care and measured with a ruler.
const CAREFUL: ImagePrior = ImagePrior {
    roll_deg: 0.1,
    shift_widths: 5e-4,
    ln_scale: 2e-3,
};
/// Of a rig that is known perfectly: what bending arms and a warm lens change from frame to frame.
const KNOWN: ImagePrior = ImagePrior {
    roll_deg: 0.03,
    shift_widths: 2e-4,
    ln_scale: 6e-4,
};
/// Views at which a calibration's uncertainty is looked at: θ and φ, degrees.
const VIEWS: [[f64; 2]; 6] = [
    [0.0, 0.0],
    [30.0, 90.0],
    [45.0, 210.0],
    [60.0, 330.0],
    [75.0, 150.0],
    [75.0, 270.0],
];

impl ImagePrior {
    /// Of a rig's camera: what its calibration leaves open, and what changes between frames; or, without a
    /// calibration, what a careful lab does.
    pub fn of(rig: &Rig) -> Self {
        let Some(left) = left_open(rig) else {
            return CAREFUL;
        };
        // A calibration that says less than care does is no reason for less trust.
        let with = |known: f64, left: f64, careful: f64| (known * known + left).sqrt().min(careful);
        let width = rig.camera.width_px as f64;
        Self {
            roll_deg: with(KNOWN.roll_deg, left[0], CAREFUL.roll_deg),
            shift_widths: with(
                KNOWN.shift_widths,
                left[1] / (width * width),
                CAREFUL.shift_widths,
            ),
            ln_scale: with(KNOWN.ln_scale, left[2], CAREFUL.ln_scale),
        }
    }
}

/// Variances of roll (degrees²), shift (pixels², the larger one) and ln magnification that the calibration's
/// covariance makes of the lines' places: many of its numbers are well known together only.
fn left_open(rig: &Rig) -> Option<[f64; 3]> {
    let calibration = rig.calibration.as_ref()?;
    let n = calibration.names.len();
    let covariance = DMatrix::from_fn(n, n, |i, j| calibration.covariance[i][j]);
    let here = CameraModel::new(rig);
    let mut sum = [0.0; 3];
    for [theta, phi] in VIEWS {
        let view = Direction::from_deg(theta, phi);
        let at = corners(rig, &here, view, CameraShift::default());
        let mut by_number = DMatrix::zeros(8, n);
        for (k, name) in calibration.names.iter().enumerate() {
            let step = calibration.u[k];
            let mut moved = rig.clone();
            match moved.number_mut(name) {
                Some(number) if step > 0.0 => *number += step,
                _ => continue,
            }
            let there = corners(
                &moved,
                &CameraModel::new(&moved),
                view,
                CameraShift::default(),
            );
            for row in 0..8 {
                by_number[(row, k)] = (there[row] - at[row]) / step;
            }
        }
        let moves = [
            CameraShift {
                roll: 1f64.to_radians(),
                ..CameraShift::default()
            },
            CameraShift {
                shift_px: [1.0, 0.0],
                ..CameraShift::default()
            },
            CameraShift {
                shift_px: [0.0, 1.0],
                ..CameraShift::default()
            },
            CameraShift {
                log_scale: 0.01,
                ..CameraShift::default()
            },
        ];
        let mut by_move = SMatrix::<f64, 8, 4>::zeros();
        for (k, by) in moves.into_iter().enumerate() {
            let there = corners(rig, &here, view, by);
            for row in 0..8 {
                by_move[(row, k)] = there[row] - at[row];
            }
        }
        let to_moves = by_move.pseudo_inverse(1e-12).ok()?;
        let spread = to_moves * &by_number;
        let of_moves = &spread * &covariance * spread.transpose();
        let variances = [0, 1, 2, 3].map(|k| of_moves[(k, k)].max(0.0));
        sum[0] += variances[0];
        sum[1] += variances[1].max(variances[2]);
        sum[2] += 1e-4 * variances[3];
    }
    let mean = sum.map(|v| v / VIEWS.len() as f64);
    mean.iter().all(|v| v.is_finite()).then_some(mean)
}

/// Pixels of the crossings of the fiducial lines.
fn corners(rig: &Rig, camera: &CameraModel, view: Direction, by: CameraShift) -> [f64; 8] {
    let a = rig.target.line_offset_mm;
    let map = camera.predict(view, by);
    let mut places = [0.0; 8];
    for (k, corner) in [[-a, -a], [a, -a], [a, a], [-a, a]].into_iter().enumerate() {
        let at = camera.distort(map.apply(corner));
        (places[2 * k], places[2 * k + 1]) = (at[0], at[1]);
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_rig::Calibration;

    /// A rig whose principal point and aim are known to 3 pixels each, and together as well as `correlation`
    /// says: aiming further right moves the target to the left.
    fn calibrated(correlation: f64) -> Rig {
        let mut rig = Rig::paper(400);
        let aim_mm = 3.0 * 1800.0 / rig.camera.focal_px;
        let both = correlation * 3.0 * aim_mm;
        rig.calibration = Some(Calibration {
            names: vec![
                "camera.centre_px[0]".into(),
                "camera.mount.aim_mm[0]".into(),
            ],
            values: vec![200.0, 0.0],
            u: vec![3.0, aim_mm],
            covariance: vec![vec![9.0, both], vec![both, aim_mm * aim_mm]],
            ..Calibration::default()
        });
        rig
    }

    #[test]
    fn what_is_known_together_only_is_known() {
        assert_eq!(ImagePrior::of(&Rig::paper(400)), CAREFUL);
        let prior = ImagePrior::of(&calibrated(1.0));
        // Aiming aside is no mere shift at oblique views: the two do not cancel to the last tenth of a pixel.
        assert!(prior.shift_widths < 2.0 * KNOWN.shift_widths, "{prior:?}");
        assert!(prior.roll_deg < 1.1 * KNOWN.roll_deg, "{prior:?}");
        assert!(prior.ln_scale < 1.1 * KNOWN.ln_scale, "{prior:?}");
    }

    #[test]
    fn a_calibration_that_knows_little_is_no_reason_for_less_trust() {
        let prior = ImagePrior::of(&calibrated(0.0));
        assert_eq!(prior.shift_widths, CAREFUL.shift_widths);
    }
}
