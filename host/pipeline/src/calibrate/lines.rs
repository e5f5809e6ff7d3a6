//! What the fiducial lines show, as a function of camera, camera arm and target.

use crate::calibrate::solve::Frames;
use crate::calibrate::unknowns::{CAMERA, with_values};
use gonia_brdf::{Direction, Elementary};
use gonia_imaging::LinePoint;
use gonia_rig::{CameraModel, CameraShift, FrameRow, Rig};

/// Standard deviations of a frame's own numbers: the camera arm's θ and φ (degrees: what encoders keep) and
/// each line's own place (pixels: what the model of its brightness leaves).
pub const OWN: [f64; 6] = [0.03, 0.03, 0.05, 0.05, 0.05, 0.05];

/// The least that they are taken to be: no arm repeats better, and no line is modelled better.
pub const LEAST_OWN: [f64; 6] = [0.005, 0.005, 0.02, 0.02, 0.02, 0.02];

/// What the places of all lines may have in common, outwards: so many pixels, and so many over the square of
/// the gap between line and material in pixels (the model of their brightness is an idealised one). Standard
/// deviations of two shared numbers behind the camera's.
pub const BIAS: [f64; 2] = [0.02, 0.02];

/// A gap is taken to be no narrower than this, pixels.
const NARROWEST_GAP_PX: f64 = 0.5;

/// Steps in which an arm's offset is found: it is nearly linear.
const ARM_ROUNDS: usize = 2;

/// A residual of a point that the camera cannot see, standard deviations: as good as none.
const NOWHERE: f64 = 1e6;

/// Pieces of lines in one frame.
#[derive(Clone, Debug)]
pub struct LineFrame {
    /// The frame.
    pub row: FrameRow,
    /// What its lines show.
    pub points: Vec<LinePoint>,
}

/// Pieces of lines in frames of a rig.
pub struct Lines<'a> {
    /// The rig whose numbers are replaced.
    pub rig: &'a Rig,
    /// At least one frame.
    pub frames: &'a [LineFrame],
}

impl Frames for Lines<'_> {
    type At = (CameraModel, [f64; 2]);

    fn count(&self) -> usize {
        self.frames.len()
    }

    fn at(&self, shared: &[f64]) -> Self::At {
        let (camera, bias) = shared.split_at(CAMERA.len());
        let rig = with_values(&CAMERA, self.rig, camera);
        (CameraModel::new(&rig), [bias[0], bias[1]])
    }

    fn residuals(&self, (camera, bias): &Self::At, frame: usize, own: &[f64]) -> Vec<f64> {
        let frame = &self.frames[frame];
        let a = self.rig.target.line_offset_mm;
        let by = CameraShift {
            theta: own[0].to_radians(),
            phi: own[1].to_radians(),
            ..CameraShift::default()
        };
        let off = distances_px(camera, a, frame.row.pose.view, by, &frame.points);
        let target = &self.rig.target;
        let gap_mm = a - target.material_half_mm - 0.5 * target.line_width_mm;
        let of_point = |(point, off): (&LinePoint, f64)| {
            let line = 2 * point.axis + usize::from(point.sign > 0.0);
            let gap_px = (gap_mm * point.px_per_mm).max(NARROWEST_GAP_PX);
            let common = bias[0] + bias[1] / (gap_px * gap_px);
            let residual = (off - common - own[2 + line]) / point.u_px;
            if residual.is_finite() {
                residual.clamp(-NOWHERE, NOWHERE)
            } else {
                NOWHERE
            }
        };
        frame.points.iter().zip(off).map(of_point).collect()
    }
}

/// How far outwards of the lines of a camera's prediction the points are, pixels.
pub fn distances_px(
    camera: &CameraModel,
    line_offset_mm: f64,
    view: Direction,
    by: CameraShift,
    points: &[LinePoint],
) -> Vec<f64> {
    let target_from_pixel = camera.predict(view, by).inverse();
    points
        .iter()
        .map(|point| match &target_from_pixel {
            Some(map) => {
                let at = map.apply(camera.undistort(point.pixel))[point.axis];
                (point.sign * at - line_offset_mm) * point.px_per_mm
            }
            None => f64::NAN,
        })
        .collect()
}

/// How far a camera's arm is from its reading in a frame, as its lines show: `arm_deg` are the standard
/// deviations of θ and φ.
pub fn arm_offset(
    camera: &CameraModel,
    line_offset_mm: f64,
    frame: &LineFrame,
    arm_deg: [f64; 2],
) -> CameraShift {
    let view = frame.row.pose.view;
    let shift = |own: [f64; 2]| CameraShift {
        theta: own[0].to_radians(),
        phi: own[1].to_radians(),
        ..CameraShift::default()
    };
    let off = |own: [f64; 2]| distances_px(camera, line_offset_mm, view, shift(own), &frame.points);
    let mut own = [0.0; 2];
    for _ in 0..ARM_ROUNDS {
        let here = off(own);
        let steps = [0, 1].map(|k| 0.1 * arm_deg[k]);
        let beside = [0, 1].map(|k| {
            let mut moved = own;
            moved[k] += steps[k];
            off(moved)
        });
        // Normal equations in degrees, with the arm's own scatter as the prior.
        let mut normal =
            [0, 1].map(|k| [0, 1].map(|l| f64::from(u8::from(k == l)) / arm_deg[k].powi(2)));
        let mut right = [0, 1].map(|k| -own[k] / arm_deg[k].powi(2));
        for (i, point) in frame.points.iter().enumerate() {
            let slope = [0, 1].map(|k| (beside[k][i] - here[i]) / steps[k]);
            let u = point.u_px.hypotenuse(OWN[2]);
            if !(slope[0] + slope[1] + here[i]).is_finite() {
                continue;
            }
            for k in 0..2 {
                right[k] -= slope[k] * here[i] / (u * u);
                for l in 0..2 {
                    normal[k][l] += slope[k] * slope[l] / (u * u);
                }
            }
        }
        let det = normal[0][0] * normal[1][1] - normal[0][1] * normal[1][0];
        own[0] += (normal[1][1] * right[0] - normal[0][1] * right[1]) / det;
        own[1] += (normal[0][0] * right[1] - normal[1][0] * right[0]) / det;
    }
    shift(own)
}

/// RMS distance of a frame's lines from where a rig has them, pixels.
pub fn misfit_px(rig: &Rig, frame: &LineFrame) -> f64 {
    let camera = CameraModel::new(rig);
    let by = CameraShift::default();
    let a = rig.target.line_offset_mm;
    let off = distances_px(&camera, a, frame.row.pose.view, by, &frame.points);
    let sum: f64 = off.iter().map(|off| off * off).sum();
    (sum / off.len().max(1) as f64).sqrt()
}
