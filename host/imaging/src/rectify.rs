//! A frame as if seen from straight above, for people who want to look. Samples are not taken from
//! it: resampling would correlate their noise.

use crate::register::Registration;
use gonia_rig::{Frame, Rig};

/// The square of the target that a rectified image shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Half its side, mm.
    pub half_mm: f64,
    /// Pixels a side.
    pub side_px: usize,
}

impl View {
    /// The target with its lines, at a resolution. The paper's is 2500 px for 700 mm.
    pub fn of_target(rig: &Rig, px_per_mm: f64) -> Self {
        let target = &rig.target;
        // As much beyond the lines as there is between them and the sample.
        let half_mm = 2.0 * target.line_offset_mm - target.material_half_mm;
        Self {
            half_mm,
            side_px: (2.0 * half_mm * px_per_mm).round().max(1.0) as usize,
        }
    }

    /// The point of the target at the middle of a pixel, mm: x to the right, y up.
    pub fn point_mm(&self, column: usize, row: usize) -> [f64; 2] {
        let place = |i: usize| ((i as f64 + 0.5) / self.side_px as f64 * 2.0 - 1.0) * self.half_mm;
        [place(column), -place(row)]
    }
}

/// The rectified image, bilinear between the frame's pixels, and zero beyond the frame.
pub fn rectify(frame: &Frame, registration: &Registration, view: &View) -> Frame {
    resample(frame, registration, view, |w| w)
}

/// Variances of the rectified image's values from those of the frame's.
pub fn rectify_variance(variance: &Frame, registration: &Registration, view: &View) -> Frame {
    resample(variance, registration, view, |w| w * w)
}

fn resample(
    frame: &Frame,
    registration: &Registration,
    view: &View,
    weight: impl Fn(f32) -> f32,
) -> Frame {
    let side = view.side_px;
    let mut rgb = Vec::with_capacity(side * side);
    for (row, column) in (0..side).flat_map(|r| (0..side).map(move |c| (r, c))) {
        let at = registration.project(view.point_mm(column, row));
        rgb.push(bilinear(frame, at.map(|c| c - 0.5), &weight));
    }
    Frame {
        width: side,
        height: side,
        rgb,
    }
}

fn bilinear(frame: &Frame, [x, y]: [f64; 2], weight: impl Fn(f32) -> f32) -> [f32; 3] {
    let last = [frame.width - 1, frame.height - 1].map(|n| n as f64);
    // Written so that a point on the horizon, which is no number, is outside.
    let inside = (0.0..=last[0]).contains(&x) && (0.0..=last[1]).contains(&y);
    if !inside {
        return [0.0; 3];
    }
    let (column, row) = (x as usize, y as usize);
    let f = [x.fract() as f32, y.fract() as f32];
    let mut value = [0.0; 3];
    for (dc, wc) in [(0, 1.0 - f[0]), (1, f[0])] {
        for (dr, wr) in [(0, 1.0 - f[1]), (1, f[1])] {
            // Nothing times a saturated pixel's infinity is nothing here.
            if wc * wr > 0.0 {
                let rgb = frame.rgb[(row + dr) * frame.width + column + dc];
                for (sum, v) in value.iter_mut().zip(rgb) {
                    *sum += weight(wc * wr) * v;
                }
            }
        }
    }
    value
}
