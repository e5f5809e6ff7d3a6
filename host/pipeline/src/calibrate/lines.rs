//! What the fiducial lines show, as a function of camera, camera arm and target.

use crate::calibrate::solve::Frames;
use crate::calibrate::unknowns::{CAMERA, with_values};
use gonia_brdf::{Direction, Elementary};
use gonia_imaging::LinePoint;
use gonia_rig::{CameraModel, CameraShift, FrameRow, Rig};

/// Numbers of a frame's own: the camera arm's two, and of each line its shift and its turn.
const N_OWN: usize = 10;

/// Standard deviations of a frame's own numbers: the camera arm's θ and φ (degrees: what encoders keep); how far
/// each line is shifted, and how far its ends are turned either way (pixels: what the model of its brightness
/// leaves, in units of [`crowding`]). The pieces of a line share both: light that falls off across it moves all
/// of them, and not all alike.
pub const OWN: [f64; N_OWN] = [0.03, 0.03, 0.02, 0.02, 0.02, 0.02, 0.01, 0.01, 0.01, 0.01];

/// The least that they are taken to be: no arm repeats better, and no line is modelled better.
pub const LEAST_OWN: [f64; N_OWN] = [
    0.005, 0.005, 0.003, 0.003, 0.003, 0.003, 0.001, 0.001, 0.001, 0.001,
];

/// Pieces of lines that fit better than their own uncertainties allow do not lower these: they are what a line's
/// model is trusted to.
pub const LEAST_NOISE: f64 = 1.0;

/// What the places of all lines may have in common, outwards: so many pixels, and so many over the square of
/// the gap between line and material in pixels (the model of their brightness is an idealised one). Standard
/// deviations of two shared numbers behind the camera's.
pub const BIAS: [f64; 2] = [0.02, 0.02];

/// How much worse a line is placed than one that stands alone, with so many pixels of desk between it and the
/// material: what is not modelled of the material's edge moves the line, and the more the nearer it is. (Of
/// lines rendered without noise, in frames of 160 to 640 pixels, the errors' RMS is within a half of 0.004
/// pixels times this.)
fn crowding(gap_px: f64) -> f64 {
    1.0 + 3.0 / (gap_px * gap_px)
}

/// What a line that stands alone is placed to, about, pixels.
const WELL_PLACED_PX: f64 = 0.004;

/// A gap is taken to be no narrower than this, pixels.
const NARROWEST_GAP_PX: f64 = 0.4;

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

/// The fewest lines that show how large the target is seen: two of them are opposite.
const SHOW_SIZE: usize = 3;

impl LineFrame {
    /// How many of the four lines it shows.
    pub fn lines_shown(&self) -> usize {
        let mut shown = [false; 4];
        for point in &self.points {
            shown[2 * point.axis + usize::from(point.sign > 0.0)] = true;
        }
        shown.into_iter().filter(|shown| *shown).count()
    }

    /// Whether it shows how large the target is seen. Two lines that cross are where they should be for a camera
    /// further away too that sees a larger target about their crossing.
    pub fn shows_size(&self) -> bool {
        self.lines_shown() >= SHOW_SIZE
    }
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
        let of_point = |(point, [off, along]): (&LinePoint, [f64; 2])| {
            let line = 2 * point.axis + usize::from(point.sign > 0.0);
            let gap_px = (gap_mm * point.px_per_mm).max(NARROWEST_GAP_PX);
            let common = bias[0] + bias[1] / (gap_px * gap_px);
            let lines_own = crowding(gap_px) * (own[2 + line] + own[6 + line] * along);
            let residual = (off - common - lines_own) / point.u_px;
            if residual.is_finite() {
                residual.clamp(-NOWHERE, NOWHERE)
            } else {
                NOWHERE
            }
        };
        frame.points.iter().zip(off).map(of_point).collect()
    }
}

/// How far outwards of the lines of a camera's prediction the points are, pixels, and where along them: from
/// −1 to 1 between the crossings.
pub fn distances_px(
    camera: &CameraModel,
    line_offset_mm: f64,
    view: Direction,
    by: CameraShift,
    points: &[LinePoint],
) -> Vec<[f64; 2]> {
    let target_from_pixel = camera.predict(view, by).inverse();
    points
        .iter()
        .map(|point| match &target_from_pixel {
            Some(map) => {
                let at = map.apply(camera.undistort(point.pixel));
                let off_mm = point.sign * at[point.axis] - line_offset_mm;
                let along = at[1 - point.axis] / line_offset_mm;
                [off_mm * point.px_per_mm, along.clamp(-1.0, 1.0)]
            }
            None => [f64::NAN; 2],
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
    let off = |own: [f64; 2]| -> Vec<f64> {
        let all = distances_px(camera, line_offset_mm, view, shift(own), &frame.points);
        all.into_iter().map(|[off, _]| off).collect()
    };
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

/// RMS distance of a frame's lines from where a rig has them, pixels. Pieces count by how well they are placed:
/// what is crowded by the material may be tenths of a pixel off.
pub fn misfit_px(rig: &Rig, frame: &LineFrame) -> f64 {
    let camera = CameraModel::new(rig);
    let by = CameraShift::default();
    let target = &rig.target;
    let a = target.line_offset_mm;
    let gap_mm = a - target.material_half_mm - 0.5 * target.line_width_mm;
    let off = distances_px(&camera, a, frame.row.pose.view, by, &frame.points);
    let (mut sum, mut weights) = (0.0, 0.0);
    for (point, [off, _]) in frame.points.iter().zip(off) {
        let gap_px = (gap_mm * point.px_per_mm).max(NARROWEST_GAP_PX);
        let model_px = WELL_PLACED_PX * crowding(gap_px);
        let weight = 1.0 / (point.u_px * point.u_px + model_px * model_px);
        sum += weight * off * off;
        weights += weight;
    }
    (sum / weights.max(f64::MIN_POSITIVE)).sqrt()
}
