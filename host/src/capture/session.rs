//! Every pose of a list, one after the other.

use gonia_brdf::Pose;
use gonia_brdf::direction::{Direction, angle_between};
use gonia_protocol::message::{ControllerState, RequestRefusal};
use std::time::{Duration, Instant};

use super::arms::{Arms, HomeError, Latched, Try};
use super::timing::POINTING_LIMIT_DEG;
use crate::link::LinkError;

/// A shot that is kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    /// Its pose's place in the list.
    pub index: usize,
    /// Where the arms were by encoder at the last pulse.
    pub encoder: Pose,
    /// The largest |commanded − encoder| of all axes and pulses, degrees.
    pub pointing_error_deg: f64,
    /// How often it had to be taken again.
    pub retakes: u32,
    /// When each pulse rose, by the clock of the controller that gave it, µs.
    pub pulse_times_us: Vec<u64>,
}

/// What came of a pose.
#[derive(Clone, Debug, PartialEq)]
pub enum ShotOutcome {
    /// Within the pointing limit, by encoder.
    Kept(Shot),
    /// Given up.
    Refused {
        /// Its pose's place in the list.
        index: usize,
        /// Why, in words for people.
        reason: String,
    },
}

/// A session in figures.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SessionSummary {
    /// Shots kept.
    pub kept: usize,
    /// Poses given up.
    pub refused: usize,
    /// Shots taken again.
    pub retakes: u32,
    /// Faults, restarts and lost cables from which it recovered automatically.
    pub recoveries: u32,
    /// The largest pointing error of the kept shots, degrees.
    pub max_pointing_error_deg: f64,
    /// Time by the arms' clock, µs: virtual on a simulated rig.
    pub duration_us: u64,
    /// Events that never arrived.
    pub events_lost: u32,
    /// Requests that had to be repeated.
    pub requests_repeated: u32,
}

/// Why a session ended before its last pose.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The arms cannot be used.
    #[error("pose {index}: {source}")]
    Arms {
        /// The pose that was under way.
        index: usize,
        /// What happened.
        source: HomeError,
    },
    /// A pose beyond the limits.
    #[error("pose {index} is beyond the arms' limits: {reason}; take it out of the plan")]
    OutOfReach {
        /// Which pose.
        index: usize,
        /// Which limit.
        reason: String,
    },
    /// Whoever takes the shots has failed, or wants no more.
    #[error("pose {index}: {reason}")]
    Taker {
        /// The pose that was taken.
        index: usize,
        /// In its own words.
        reason: String,
    },
}

/// Homes, then moves both arms to every pose, triggers, and hands each outcome to `on_shot` before
/// the arms move on. Arms that fail are brought back; a pose is tried `max_retakes` times more.
///
/// # Errors
/// A pose out of reach, arms that cannot be brought back, or an error of `on_shot`. The arms are
/// stopped then.
pub fn run_session(
    arms: &mut Arms,
    poses: &[Pose],
    on_shot: &mut dyn FnMut(ShotOutcome) -> Result<(), SessionError>,
) -> Result<SessionSummary, SessionError> {
    let mut shooter = Shooter::new(arms);
    let result = shooter.home().and_then(|()| {
        for (index, pose) in poses.iter().enumerate() {
            on_shot(shooter.take(index, pose, &mut || Ok(()))?)?;
        }
        Ok(())
    });
    let summary = shooter.finish();
    if result.is_err() {
        // The error that is reported is the first one; this is only for safety's sake.
        let _ = arms.stop();
    }
    result.map(|()| summary)
}

/// Takes shots one by one, and counts what happens.
pub struct Shooter<'a> {
    arms: &'a mut Arms,
    began_us: u64,
    summary: SessionSummary,
    busy: Duration,
}

impl<'a> Shooter<'a> {
    /// With arms that are connected.
    pub fn new(arms: &'a mut Arms) -> Self {
        Self {
            began_us: arms.now_us(),
            arms,
            summary: SessionSummary::default(),
            busy: Duration::ZERO,
        }
    }

    /// The arms.
    pub fn arms(&mut self) -> &mut Arms {
        self.arms
    }

    /// Time by the host's clock in which the arms homed, moved, settled or were triggered. All other time
    /// they waited for the host.
    pub fn busy(&self) -> Duration {
        self.busy
    }

    /// The figures.
    pub fn finish(mut self) -> SessionSummary {
        self.summary.duration_us = self.arms.now_us() - self.began_us;
        (self.summary.events_lost, self.summary.requests_repeated) = self.arms.losses();
        self.summary
    }

    /// Homes the arms that need it, and gets over a fault on the way.
    ///
    /// # Errors
    /// Arms that cannot be brought back.
    pub fn home(&mut self) -> Result<(), SessionError> {
        let began = Instant::now();
        let homed = match self.arms.home() {
            Err(error) if error.may_pass() => self.recover(),
            result => result,
        };
        self.busy += began.elapsed();
        homed.map_err(|source| SessionError::Arms { index: 0, source })
    }

    /// Takes up arms that may still be under way for a host that died, or have stopped because it
    /// did: they are stopped, cleared, and homed if they lost their place.
    ///
    /// # Errors
    /// Arms that cannot be brought back.
    pub fn take_up(&mut self) -> Result<(), HomeError> {
        let began = Instant::now();
        let taken = self.arms.recover();
        self.busy += began.elapsed();
        taken
    }

    /// Brings the arms back after a fault, a restart or a lost cable.
    ///
    /// # Errors
    /// Arms that cannot be brought back now.
    pub fn recover(&mut self) -> Result<(), HomeError> {
        self.summary.recoveries += 1;
        self.arms.recover()
    }

    /// Moves both arms to a pose, to leave them there.
    ///
    /// # Errors
    /// The link failed, or a controller refuses.
    pub fn park(&mut self, pose: &Pose) -> Result<(), LinkError> {
        let began = Instant::now();
        let parked = match self.arms.targets_udeg(pose) {
            Some(targets) => self.arms.go(targets).map(drop),
            None => Ok(()),
        };
        self.busy += began.elapsed();
        parked
    }

    /// One pose, with its retakes. `at_rest` is called before each trigger, when both arms have
    /// settled.
    ///
    /// # Errors
    /// A pose out of reach, arms that cannot be brought back, or an error of `at_rest`.
    pub fn take(
        &mut self,
        index: usize,
        pose: &Pose,
        at_rest: &mut dyn FnMut() -> Result<(), SessionError>,
    ) -> Result<ShotOutcome, SessionError> {
        let outcome = self.take_one(index, pose, at_rest)?;
        match &outcome {
            ShotOutcome::Kept(shot) => {
                self.summary.kept += 1;
                self.summary.max_pointing_error_deg = self
                    .summary
                    .max_pointing_error_deg
                    .max(shot.pointing_error_deg);
            }
            ShotOutcome::Refused { .. } => self.summary.refused += 1,
        }
        Ok(outcome)
    }

    fn take_one(
        &mut self,
        index: usize,
        pose: &Pose,
        at_rest: &mut dyn FnMut() -> Result<(), SessionError>,
    ) -> Result<ShotOutcome, SessionError> {
        self.check_apart(index, pose)?;
        let mut reason = String::new();
        for retakes in 0..=self.arms.options.max_retakes {
            self.summary.retakes += u32::from(retakes > 0);
            let targets = self
                .arms
                .targets_udeg(pose)
                .ok_or_else(|| SessionError::OutOfReach {
                    index,
                    reason: "no turn of an azimuth lies within the soft limits".into(),
                })?;
            let tried = match self.shoot(targets, at_rest)? {
                Ok(tried) => tried,
                Err(error) => {
                    self.arms.must_home |= matches!(
                        &error,
                        LinkError::Refused {
                            refusal: RequestRefusal::StartBeyondLimit(_),
                            ..
                        }
                    );
                    sort_error(index, error)?
                }
            };
            match tried {
                Try::Latched(latches) => {
                    let shot = judge(index, retakes, targets, &latches);
                    if shot.pointing_error_deg <= POINTING_LIMIT_DEG {
                        return Ok(ShotOutcome::Kept(shot));
                    }
                    reason = format!("pointing error {:.4}°", shot.pointing_error_deg);
                }
                Try::Again(why) => reason = why,
                Try::Broken(why) => {
                    reason = why;
                    self.summary.recoveries += 1;
                    self.arms
                        .recover()
                        .map_err(|source| SessionError::Arms { index, source })?;
                }
            }
        }
        Ok(ShotOutcome::Refused { index, reason })
    }

    fn check_apart(&self, index: usize, pose: &Pose) -> Result<(), SessionError> {
        let apart_deg = angle_between(pose.light.to_vec3(), pose.view.to_vec3()).to_degrees();
        if apart_deg >= self.arms.keep_out_deg {
            return Ok(());
        }
        Err(SessionError::OutOfReach {
            index,
            reason: format!(
                "the arms would be {apart_deg:.1}° apart, and touch below {:.1}°",
                self.arms.keep_out_deg
            ),
        })
    }

    /// Move, rest, trigger. The outer error is that of `at_rest`.
    fn shoot(
        &mut self,
        targets: [[i32; 2]; 2],
        at_rest: &mut dyn FnMut() -> Result<(), SessionError>,
    ) -> Result<Result<Try, LinkError>, SessionError> {
        let began = Instant::now();
        let moved = self.arms.go(targets);
        self.busy += began.elapsed();
        match moved {
            Ok(None) => {}
            Ok(Some(tried)) => return Ok(Ok(tried)),
            Err(error) => return Ok(Err(error)),
        }
        at_rest()?;
        let began = Instant::now();
        let tried = self.arms.trigger();
        self.busy += began.elapsed();
        Ok(tried)
    }
}

/// Which errors of the link a session can get over.
fn sort_error(index: usize, error: LinkError) -> Result<Try, SessionError> {
    match &error {
        LinkError::Refused { refusal, .. } => match refusal {
            RequestRefusal::TargetBeyondLimit(_) => Err(SessionError::OutOfReach {
                index,
                reason: error.to_string(),
            }),
            RequestRefusal::OutsideWindow(..) => Ok(Try::Again(error.to_string())),
            RequestRefusal::NoSession
            | RequestRefusal::NotHomed
            | RequestRefusal::NoSuchPulse
            | RequestRefusal::StartBeyondLimit(_)
            | RequestRefusal::State(
                ControllerState::Fault(_) | ControllerState::EStop | ControllerState::Unhomed,
            ) => Ok(Try::Broken(error.to_string())),
            _ => Err(SessionError::Arms {
                index,
                source: error.into(),
            }),
        },
        LinkError::NoAnswer { .. } | LinkError::Endless { .. } => {
            Ok(Try::Broken(error.to_string()))
        }
        _ => Err(SessionError::Arms {
            index,
            source: error.into(),
        }),
    }
}

fn judge(index: usize, retakes: u32, targets: [[i32; 2]; 2], latches: &[Latched]) -> Shot {
    let mut worst_udeg = 0;
    for latch in latches {
        for (target, encoder) in targets
            .as_flattened()
            .iter()
            .zip(latch.encoder_udeg.as_flattened())
        {
            worst_udeg = worst_udeg.max(target.abs_diff(*encoder));
        }
    }
    let last = latches.last().map_or(targets, |latch| latch.encoder_udeg);
    let direction = |[theta, phi]: [i32; 2]| {
        Direction::from_deg(f64::from(theta) * 1e-6, f64::from(phi) * 1e-6)
    };
    Shot {
        index,
        encoder: Pose {
            light: direction(last[0]),
            view: direction(last[1]),
        },
        pointing_error_deg: f64::from(worst_udeg) * 1e-6,
        retakes,
        pulse_times_us: latches.iter().map(|latch| latch.time_us).collect(),
    }
}
