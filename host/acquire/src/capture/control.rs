//! The control pose: taken again and again, so that a lamp that drifts or a sample that was moved is
//! noticed.

use gonia_brdf::Elementary;
use gonia_imaging::LeftOut;
use gonia_pipeline::process::{SampledFrame, SampledPoint};
use std::fmt;

/// Points that scatter more than this about their common change are not those of the same sample.
const SCATTER_LIMIT: f64 = 0.1;
/// Marks that moved more than this are not where they were, degrees.
const MOVED_LIMIT_DEG: f64 = 0.2;

/// A take of the control pose beside its first one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlComparison {
    /// Median brightness over that of the first take.
    pub ratio: f64,
    /// Robust standard deviation of the points' own ratios about it.
    pub scatter: f64,
    /// How far the marks have moved, as an angle of the camera, degrees.
    pub moved_deg: f64,
}

/// What a comparison means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judgement {
    /// All is as it was.
    Same,
    /// The lamp is brighter or darker: it may pass.
    Drifted,
    /// Something was moved: it does not pass.
    Moved,
}

impl ControlComparison {
    /// Compares two takes; `None` when they have no point in common.
    pub fn of(first: &SampledFrame, now: &SampledFrame) -> Option<Self> {
        let mut ratios: Vec<f64> = first
            .points
            .iter()
            .zip(&now.points)
            .filter_map(|(a, b)| Some(brightness(b)? / brightness(a)?))
            .filter(|ratio| ratio.is_finite())
            .collect();
        let ratio = median(&mut ratios)?;
        let mut apart: Vec<f64> = ratios.iter().map(|r| (r / ratio - 1.0).abs()).collect();
        let offset = |frame: &SampledFrame| {
            let offset = frame.report.pose_offset;
            let sin = frame.reading.view.theta.sine();
            [offset.theta_deg, offset.phi_deg * sin]
        };
        let (a, b) = (offset(first), offset(now));
        Some(Self {
            ratio,
            scatter: 1.4826 * median(&mut apart)?,
            moved_deg: (a[0] - b[0]).hypotenuse(a[1] - b[1]),
        })
    }

    /// What it means, when brightness may change by the share `drift_limit`.
    pub fn judge(&self, drift_limit: f64) -> Judgement {
        if self.scatter > SCATTER_LIMIT || self.moved_deg > MOVED_LIMIT_DEG {
            Judgement::Moved
        } else if (self.ratio - 1.0).abs() > drift_limit {
            Judgement::Drifted
        } else {
            Judgement::Same
        }
    }
}

impl fmt::Display for ControlComparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "brightness {:+.2} %, points scatter {:.2} %, marks moved {:.3} degrees",
            100.0 * (self.ratio - 1.0),
            100.0 * self.scatter,
            self.moved_deg
        )
    }
}

fn brightness(point: &Result<SampledPoint, LeftOut>) -> Option<f64> {
    let sum: f32 = point.as_ref().ok()?.rgb.iter().sum();
    (sum > 0.0).then_some(f64::from(sum))
}

fn median(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::record::tests::some_frame;
    use gonia_rig::Role;

    fn frame(value: impl Fn(usize) -> f32) -> SampledFrame {
        let mut frame = some_frame(0, Role::Material);
        frame.points = (0..101)
            .map(|i| {
                Ok(SampledPoint {
                    rgb: [value(i); 3],
                    offset_mm: [0.0; 2],
                })
            })
            .collect();
        frame
    }

    #[test]
    fn a_darker_lamp_drifts_and_another_sample_has_moved() {
        let first = frame(|i| 1.0 + i as f32);
        let same = ControlComparison::of(&first, &frame(|i| 1.001 * (1.0 + i as f32))).unwrap();
        assert_eq!(same.judge(0.02), Judgement::Same);
        let darker = ControlComparison::of(&first, &frame(|i| 0.9 * (1.0 + i as f32))).unwrap();
        assert!((darker.ratio - 0.9).abs() < 1e-6);
        assert_eq!(darker.judge(0.02), Judgement::Drifted);
        let turned = ControlComparison::of(&first, &frame(|i| 102.0 - i as f32)).unwrap();
        assert_eq!(turned.judge(0.02), Judgement::Moved);
        let mut shifted = first.clone();
        shifted.report.pose_offset.theta_deg += 0.3;
        let moved = ControlComparison::of(&first, &shifted).unwrap();
        assert_eq!(moved.judge(0.02), Judgement::Moved);
        let mut hidden = first.clone();
        hidden.points.fill(Err(LeftOut::Occlusion));
        assert_eq!(ControlComparison::of(&first, &hidden), None);
    }
}
