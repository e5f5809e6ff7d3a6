//! What a calibration leaves, for a picture: how far the lines of all frames are from where the rig has them, and
//! the reference's shading from what its light makes of it, before and after.

use crate::calibrate::lines::{LineFrame, distances_px};
use gonia_rig::{CameraModel, CameraShift, Rig};

/// What a calibration leaves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Residuals {
    /// Width and height of a frame, pixels.
    pub size_px: [usize; 2],
    /// Pieces of the lines of all frames.
    pub lines: Vec<LineResidual>,
    /// Frames of the reference; none where its shading was not used.
    pub shading: Vec<ShadingResidual>,
}

/// A piece of a fiducial line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineResidual {
    /// Where it is seen.
    pub pixel: [f64; 2],
    /// The unit vector across its line, outwards.
    pub outward: [f64; 2],
    /// How far outwards of its place it is, before and after, pixels.
    pub px: [f64; 2],
}

/// A frame of the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingResidual {
    /// The light arm's polar angle, degrees.
    pub theta_i_deg: f64,
    /// RMS of its values about what the light makes of them, before and after, relative.
    pub share: [f64; 2],
}

/// Of the lines of frames.
pub fn of_lines(before: &Rig, after: &Rig, frames: &[LineFrame]) -> Vec<LineResidual> {
    let cameras = [before, after].map(CameraModel::new);
    let a = after.target.line_offset_mm;
    let of_frame = |frame: &LineFrame| {
        let view = frame.row.pose.view;
        let off = cameras
            .each_ref()
            .map(|camera| distances_px(camera, a, view, CameraShift::default(), &frame.points));
        let map = cameras[1].predict(view, CameraShift::default());
        let target_from_pixel = map.inverse();
        let mut residuals = Vec::with_capacity(frame.points.len());
        for (i, point) in frame.points.iter().enumerate() {
            let Some(back) = &target_from_pixel else {
                break;
            };
            let at = back.apply(cameras[1].undistort(point.pixel));
            let steps = map.jacobian(at);
            let (along, across) = (steps[1 - point.axis], steps[point.axis]);
            let length = (along[0] * along[0] + along[1] * along[1]).sqrt();
            let normal = [-along[1] / length, along[0] / length];
            let side = point.sign * (normal[0] * across[0] + normal[1] * across[1]);
            residuals.push(LineResidual {
                pixel: point.pixel,
                outward: normal.map(|c| c * side.signum()),
                px: [off[0][i][0], off[1][i][0]],
            });
        }
        residuals
    };
    frames.iter().flat_map(of_frame).collect()
}
