//! A sampled frame for the tests of a session.

use gonia_brdf::{Direction, Pose};
use gonia_imaging::{LeftOut, PoseOffset};
use gonia_pipeline::process::{FrameReport, Outcome, SampledFrame, SampledPoint};
use gonia_rig::Role;

/// A frame of three points.
pub fn some_frame(frame: u32, role: Role) -> SampledFrame {
    let direction = |theta, phi| Direction::from_deg(theta, phi);
    SampledFrame {
        report: FrameReport {
            frame,
            role,
            outcome: Outcome::Locked,
            residual_px: 0.031,
            pose_offset: PoseOffset {
                theta_deg: 0.01,
                phi_deg: -0.02,
            },
        },
        reading: Pose {
            light: direction(15.0, 60.0),
            view: direction(30.000_001, 359.9),
        },
        view: direction(30.01, 359.88),
        points: vec![
            Ok(SampledPoint {
                rgb: [0.1, f32::INFINITY, -0.0],
                offset_mm: [0.25, -1e-9],
            }),
            Err(LeftOut::Border),
            Err(LeftOut::Occlusion),
        ],
        mask: None,
    }
}
