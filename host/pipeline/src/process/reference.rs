//! What the frames of the reference tell: its radiance at every grid point of every pose.

use crate::process::account::LeftOutCounts;
use crate::process::sampled::{SampledFrame, SampledPoint};
use gonia_brdf::direction::{angle_between, wrap_deg};
use gonia_brdf::{Direction, Pose};
use gonia_imaging::{LeftOut, Mask};

/// Poses closer than this are the same, degrees: the arms repeat within ±0.03°.
const SAME_POSE_DEG: f64 = 0.1;
/// At the pole directions are the same at any azimuth, but the light's beam turns with its arm.
const SAME_AZIMUTH_DEG: f64 = 1.0;

/// One reference frame: radiance over an ideal light's irradiance, per grid point. The ideal light
/// takes out most of the change within a patch, so that it matters little which of its pixels the
/// material's frame and the reference's happened to see.
#[derive(Clone, Debug)]
pub struct ReferenceFrame {
    /// The arms' reading.
    pub reading: Pose,
    /// Light and camera as they were, seen from the centre.
    pub pose: Pose,
    /// Radiance over ideal irradiance; NaN where there is none.
    pub relative: Box<[[f32; 3]]>,
    /// Why a point has no value.
    pub missing: Box<[Option<LeftOut>]>,
    /// What hid the target.
    pub mask: Option<Mask>,
}

impl ReferenceFrame {
    /// From a frame, where the light was as seen from the centre, and the ideal light's irradiance at each
    /// of its points.
    pub fn new(
        frame: SampledFrame,
        light: Direction,
        irradiance: impl Fn(usize, &SampledPoint) -> f64,
    ) -> Self {
        let relative = |(i, point): (usize, &Result<SampledPoint, LeftOut>)| match point {
            Ok(value) => {
                let scale = 1.0 / irradiance(i, value) as f32;
                value.rgb.map(|v| v * scale)
            }
            Err(_) => [f32::NAN; 3],
        };
        Self {
            reading: frame.reading,
            pose: Pose {
                light,
                view: frame.view,
            },
            relative: frame.points.iter().enumerate().map(relative).collect(),
            missing: frame.points.iter().map(|p| p.err()).collect(),
            mask: frame.mask,
        }
    }

    /// Radiance over irradiance at a point, or the count of why there is none.
    pub fn at(&self, point: usize, counts: &mut LeftOutCounts) -> Option<[f32; 3]> {
        if let Some(reason) = self.missing[point] {
            counts.count(reason);
            return None;
        }
        let value = self.relative[point];
        if value.iter().all(|v| *v > 0.0) {
            Some(value)
        } else {
            counts.dark_reference += 1;
            None
        }
    }
}

/// The reference frames of a session.
#[derive(Clone, Debug, Default)]
pub struct References {
    frames: Vec<ReferenceFrame>,
}

impl References {
    /// In the session's order.
    pub fn new(frames: Vec<ReferenceFrame>) -> Self {
        Self { frames }
    }

    /// All of them.
    pub fn frames(&self) -> &[ReferenceFrame] {
        &self.frames
    }

    /// What hid the target in each of them, by the arms' reading.
    pub fn into_masks(self) -> Vec<(Pose, Option<Mask>)> {
        let masks = self.frames.into_iter();
        masks.map(|frame| (frame.reading, frame.mask)).collect()
    }

    /// The reference frame taken at a pose (by the arms' reading): the nearest within 0.1°.
    pub fn at_pose(&self, pose: Pose) -> Option<&ReferenceFrame> {
        self.frames
            .iter()
            .filter_map(|frame| Some((frame, distance_of_same(frame.reading, pose)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(frame, _)| frame)
    }
}

/// Angle between two poses that count as one; `None` for different poses.
pub fn distance_of_same(a: Pose, b: Pose) -> Option<f64> {
    // The cheap test first: this runs for every pair of frames.
    let limit = SAME_POSE_DEG.to_radians();
    if (a.light.theta - b.light.theta).abs() > limit || (a.view.theta - b.view.theta).abs() > limit
    {
        return None;
    }
    let turned = wrap_deg(a.light.phi_deg() - b.light.phi_deg() + 180.0) - 180.0;
    if turned.abs() > SAME_AZIMUTH_DEG && a.light.theta < limit {
        return None;
    }
    let angle = |a: Direction, b: Direction| angle_between(a.to_vec3(), b.to_vec3());
    let distance = angle(a.light, b.light).max(angle(a.view, b.view));
    (distance <= limit).then_some(distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(a: [f64; 4]) -> Pose {
        Pose {
            light: Direction::from_deg(a[0], a[1]),
            view: Direction::from_deg(a[2], a[3]),
        }
    }

    #[test]
    fn a_pose_is_the_same_within_a_tenth_of_a_degree() {
        let at = pose([30.0, 359.99, 45.0, 0.01]);
        assert!(distance_of_same(at, pose([30.03, 0.02, 45.0, 359.98])).is_some());
        assert!(distance_of_same(at, pose([30.2, 0.0, 45.0, 0.0])).is_none());
        assert!(distance_of_same(at, pose([30.0, 0.0, 45.0, 1.0])).is_none());
    }

    #[test]
    fn at_the_pole_the_cameras_azimuth_is_free_and_the_lights_is_not() {
        let at = pose([0.0, 0.0, 0.0, 0.0]);
        assert!(distance_of_same(at, pose([0.0, 0.0, 0.0, 90.0])).is_some());
        assert!(distance_of_same(at, pose([0.0, 90.0, 0.0, 0.0])).is_none());
    }
}
