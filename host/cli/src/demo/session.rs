//! The sessions on the simulated rig: both arms through poses over a white tile, over the reference and over
//! the material.

use anyhow::Result;
use gonia_acquire::camera::SimulatedFrames;
use gonia_acquire::capture::{Arms, POINTING_LIMIT_DEG, SessionError, ShotOutcome, run_session};
use gonia_acquire::motion::calibrate_encoders;
use gonia_brdf::Pose;
use gonia_formats::{Pointing, Refused};
use gonia_rig::Role;
use gonia_sim::fault::{Arm, FaultPlan};
use gonia_sim::rig::SimRig;
use std::collections::BTreeMap;

/// What the arms did.
#[derive(Default)]
pub struct Session {
    /// Triggers whose arms were within the pointing limit by encoder.
    pub kept: usize,
    /// Poses given up, by reason.
    pub refused: BTreeMap<String, u64>,
    /// Shots taken again.
    pub retakes: u32,
    /// Largest commanded − encoder of each kept shot, degrees.
    pub by_encoder_deg: Vec<f64>,
    /// Largest commanded − true shaft angle of each kept shot, degrees: only a simulation knows it.
    pub by_shaft_deg: Vec<f64>,
    /// Time on the rig's own clock, seconds.
    pub virtual_s: f64,
}

impl Session {
    /// The distribution of the pointing errors by encoder.
    pub fn pointing(&self) -> Option<Pointing> {
        Pointing::from_errors(&self.by_encoder_deg, POINTING_LIMIT_DEG)
    }

    /// Refused poses as the summary lists them.
    pub fn refusals(&self) -> Vec<Refused> {
        self.refused
            .iter()
            .map(|(reason, count)| Refused {
                reason: reason.clone(),
                count: *count,
            })
            .collect()
    }
}

/// Two simulated controllers, and the arms that they drive.
pub struct Lab {
    rig: SimRig,
    arms: Arms,
}

impl Lab {
    /// Connects, and calibrates the arms' encoders.
    pub fn open(seed: u64) -> Result<Self> {
        let rig = SimRig::new(seed, FaultPlan::default());
        let mut arms = Arms::connect(
            Box::new(rig.port(Arm::Light)),
            Box::new(rig.port(Arm::Camera)),
        )?;
        calibrate_encoders(&rig, &mut arms)?;
        Ok(Self { rig, arms })
    }

    /// Drives the arms through poses over what lies on the target, and exposes a frame at each trigger.
    pub fn expose(
        &mut self,
        role: Role,
        poses: &[Pose],
        camera: &mut SimulatedFrames,
        session: &mut Session,
        progress: &dyn Fn(f64),
    ) -> Result<()> {
        let mut done = 0;
        let rig = &self.rig;
        let summary = run_session(&mut self.arms, poses, &mut |outcome| {
            done += 1;
            progress(done as f64 / poses.len() as f64);
            match outcome {
                ShotOutcome::Kept(shot) => {
                    let exposed_at =
                        rig.true_pose_at_last_trigger()
                            .ok_or_else(|| SessionError::Taker {
                                index: shot.index,
                                reason: "the camera saw no trigger".into(),
                            })?;
                    camera.expose(role, shot.encoder, exposed_at);
                    session.kept += 1;
                    session.by_encoder_deg.push(shot.pointing_error_deg);
                    session
                        .by_shaft_deg
                        .push(largest_difference_deg(&poses[shot.index], &exposed_at));
                }
                ShotOutcome::Refused { reason, .. } => {
                    *session.refused.entry(reason).or_default() += 1;
                }
            }
            Ok(())
        })?;
        session.retakes += summary.retakes;
        session.virtual_s += summary.duration_us as f64 * 1e-6;
        Ok(())
    }

    /// A session: once over the reference, once over the material.
    pub fn measure(
        &mut self,
        poses: &[Pose],
        camera: &mut SimulatedFrames,
        progress: &dyn Fn(f64),
    ) -> Result<Session> {
        let mut session = Session::default();
        for (half, role) in [Role::Reference, Role::Material].into_iter().enumerate() {
            let tell = |share: f64| progress(0.5 * (half as f64 + share));
            self.expose(role, poses, camera, &mut session, &tell)?;
        }
        Ok(session)
    }
}

/// The largest difference of two poses over the four axes, degrees.
fn largest_difference_deg(a: &Pose, b: &Pose) -> f64 {
    let turn = |x: f64| ((x + 180.0).rem_euclid(360.0) - 180.0).abs();
    [(a.light, b.light), (a.view, b.view)]
        .into_iter()
        .flat_map(|(p, q)| {
            [
                (p.theta_deg() - q.theta_deg()).abs(),
                turn(p.phi_deg() - q.phi_deg()),
            ]
        })
        .fold(0.0, f64::max)
}
