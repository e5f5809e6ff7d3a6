//! Every pose of a list, one after the other.

use crate::capture::arms::{Arms, HomeError, Latched, TryError, pose_apart_deg};
use crate::capture::shot::{ShotOutcome, shot_of};
use crate::capture::timing::POINTING_LIMIT_DEG;
use crate::link::LinkError;
use gonia_brdf::Pose;
use gonia_protocol::message::{ControllerState, RequestRefusal};
use std::time::{Duration, Instant};

/// A session in figures.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SessionSummary {
    /// Shots kept.
    pub kept: usize,
    /// Poses given up.
    pub refused: usize,
    /// Shots taken again.
    pub retakes: u32,
    /// Faults, restarts and lost cables after which the arms were recovered automatically.
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
    /// The caller, to whom each shot is given, failed or wants no more.
    #[error("pose {index}: {reason}")]
    Taker {
        /// The pose that was taken.
        index: usize,
        /// The caller's own error.
        #[source]
        reason: Box<dyn std::error::Error + Send + Sync>,
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
            let outcome = shooter.take::<SessionError>(index, pose, &mut || Ok(()))?;
            on_shot(outcome)?;
        }
        Ok(())
    });
    let summary = shooter.finish();
    if result.is_err() {
        // Only for safety: the error that is reported is the first one.
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
        self.summary.duration_us = self.arms.now_us().saturating_sub(self.began_us);
        (self.summary.events_lost, self.summary.requests_repeated) = self.arms.losses();
        self.summary
    }

    /// Homes the arms that need it. A fault on the way is recovered automatically.
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

    /// Takes over arms that may still move for a program that was killed, or have stopped because it
    /// was: they are stopped, their faults cleared, and they are homed if they lost their place.
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
        let parked = match self.arms.targets_udeg(pose).map(|to| self.arms.go(to)) {
            Some(Err(TryError::Link(error))) => Err(error),
            // Where the arms do not get there, they stay on the way.
            _ => Ok(()),
        };
        self.busy += began.elapsed();
        parked
    }

    /// One pose, with its retakes. `at_rest` is called before each trigger, when both arms have
    /// settled.
    ///
    /// # Errors
    /// A pose out of reach, arms that cannot be brought back, or whatever error `at_rest` gives: it is
    /// passed on as it is.
    pub fn take<E: From<SessionError>>(
        &mut self,
        index: usize,
        pose: &Pose,
        at_rest: &mut dyn FnMut() -> Result<(), E>,
    ) -> Result<ShotOutcome, E> {
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

    fn take_one<E: From<SessionError>>(
        &mut self,
        index: usize,
        pose: &Pose,
        at_rest: &mut dyn FnMut() -> Result<(), E>,
    ) -> Result<ShotOutcome, E> {
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
            let error = match self.shoot(targets, at_rest) {
                Ok(pulses) => {
                    let shot = shot_of(index, retakes, targets, &pulses);
                    if shot.pointing_error_deg <= POINTING_LIMIT_DEG {
                        return Ok(ShotOutcome::Kept(shot));
                    }
                    reason = format!("pointing error {:.4}°", shot.pointing_error_deg);
                    continue;
                }
                Err(Missed::AtRest(error)) => return Err(error),
                Err(Missed::ByArms(error)) => error,
            };
            match self.remedy_for(index, error)? {
                Remedy::Repeat(why) => reason = why,
                Remedy::Recover(why) => {
                    reason = why;
                    self.recover()
                        .map_err(|source| SessionError::Arms { index, source })?;
                }
            }
        }
        Ok(ShotOutcome::Refused { index, reason })
    }

    fn check_apart(&self, index: usize, pose: &Pose) -> Result<(), SessionError> {
        let apart_deg = pose_apart_deg(pose);
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

    /// Move, rest, trigger: what both arms captured at each pulse.
    fn shoot<E>(
        &mut self,
        targets_udeg: [[i32; 2]; 2],
        at_rest: &mut dyn FnMut() -> Result<(), E>,
    ) -> Result<Vec<Latched>, Missed<E>> {
        let began = Instant::now();
        let moved = self.arms.go(targets_udeg);
        self.busy += began.elapsed();
        moved.map_err(Missed::ByArms)?;
        at_rest().map_err(Missed::AtRest)?;
        let began = Instant::now();
        let triggered = self.arms.trigger();
        self.busy += began.elapsed();
        triggered.map_err(Missed::ByArms)
    }

    /// What helps after a try that gave no shot.
    ///
    /// # Errors
    /// Nothing that a session can do helps.
    fn remedy_for(&mut self, index: usize, error: TryError) -> Result<Remedy, SessionError> {
        let error = match error {
            TryError::Repeat(why) => return Ok(Remedy::Repeat(why)),
            TryError::Recover(why) => return Ok(Remedy::Recover(why)),
            TryError::Link(error) => error,
        };
        match &error {
            LinkError::Refused { refusal, .. } => match refusal {
                RequestRefusal::TargetBeyondLimit(_) => Err(SessionError::OutOfReach {
                    index,
                    reason: error.to_string(),
                }),
                RequestRefusal::OutsideWindow(..) => Ok(Remedy::Repeat(error.to_string())),
                RequestRefusal::NoSession
                | RequestRefusal::NotHomed
                | RequestRefusal::NoSuchPulse
                | RequestRefusal::StartBeyondLimit(_)
                | RequestRefusal::State(
                    ControllerState::Fault(_) | ControllerState::EStop | ControllerState::Unhomed,
                ) => {
                    self.arms.must_home |= matches!(refusal, RequestRefusal::StartBeyondLimit(_));
                    Ok(Remedy::Recover(error.to_string()))
                }
                _ => Err(SessionError::Arms {
                    index,
                    source: error.into(),
                }),
            },
            LinkError::NoAnswer { .. } | LinkError::Endless { .. } => {
                Ok(Remedy::Recover(error.to_string()))
            }
            _ => Err(SessionError::Arms {
                index,
                source: error.into(),
            }),
        }
    }
}

/// Why a try gave no shot.
enum Missed<E> {
    /// The arms, or the link to them.
    ByArms(TryError),
    /// The caller, when the arms were at rest.
    AtRest(E),
}

/// What a session does after a try that gave no shot; each with the reason.
enum Remedy {
    /// The same pose again.
    Repeat(String),
    /// The arms are recovered first.
    Recover(String),
}
