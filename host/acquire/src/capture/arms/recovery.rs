//! The arms after a fault, a restart or a lost cable.

use crate::capture::arms::Arms;
use crate::link::{HEARTBEAT_US, LinkError};
use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{ControllerState, RequestRefusal};

/// For so long a hello is repeated to a controller that does not answer, µs.
const RECONNECT_LIMIT_US: u64 = 60_000_000;
/// How often a recovery is tried again, and after which pause, µs.
const RECOVERIES: u32 = 4;
const PAUSE_US: u64 = 3_000_000;

/// Why the arms are not ready.
#[derive(Debug, thiserror::Error)]
pub enum HomeError {
    /// The link failed.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// A latched fault that does not go away.
    #[error("{0}: {1}")]
    Fault(String, FaultCode),
    /// A person or the interlock stopped the arm.
    #[error("{0}: stopped by hand or by the interlock; make it safe, clear the fault and resume")]
    Stopped(String),
    /// The controller came back with other settings.
    #[error(
        "{0}: came back with other settings than the session began with; restore them and resume"
    )]
    OtherSettings(String),
}

impl HomeError {
    /// Whether the next try may succeed. A person's stop, other settings and a broken switch stay; a
    /// noisy encoder looks like a shifted one while the noise lasts.
    pub(in crate::capture) fn may_pass(&self) -> bool {
        match self {
            HomeError::Fault(_, code) => matches!(
                *code,
                FaultCode::ENCODER_LOST
                    | FaultCode::ENCODER_JUMP
                    | FaultCode::FOLLOWING_ERROR
                    | FaultCode::NOT_REACHED
                    | FaultCode::HOST_WATCHDOG
                    | FaultCode::STEP_LOSS
                    | FaultCode::HOME_MISMATCH
                    | FaultCode::EDGE_LOST
                    | FaultCode::INDEX_WRONG
            ),
            HomeError::Link(LinkError::Refused { refusal, .. }) => matches!(
                refusal,
                RequestRefusal::NoSession
                    | RequestRefusal::State(ControllerState::Fault(_) | ControllerState::Boot)
            ),
            HomeError::Link(error) => matches!(
                error,
                LinkError::NoAnswer { .. } | LinkError::Endless { .. }
            ),
            HomeError::Stopped(_) | HomeError::OtherSettings(_) => false,
        }
    }
}

impl Arms {
    /// Recovers both arms after a fault, a restart or a lost cable: hello, clear, home where needed.
    /// What may pass, such as another fault on the way home, is tried again a few times.
    ///
    /// # Errors
    /// The arms cannot be recovered now.
    pub(in crate::capture) fn recover(&mut self) -> Result<(), HomeError> {
        let mut tries_left = RECOVERIES;
        loop {
            match self.recover_once() {
                Err(error) if tries_left > 0 && error.may_pass() => {
                    tries_left -= 1;
                    self.light.rest(PAUSE_US)?;
                }
                result => return result,
            }
        }
    }

    fn recover_once(&mut self) -> Result<(), HomeError> {
        let deadline_us = self.now_us() + RECONNECT_LIMIT_US;
        for controller in self.both() {
            let config = controller.identity().config_crc;
            while let Err(error) = controller.reconnect() {
                let silent = matches!(error, LinkError::NoAnswer { .. });
                if !silent || controller.now_us() > deadline_us {
                    return Err(error.into());
                }
            }
            if controller.identity().config_crc != config {
                return Err(HomeError::OtherSettings(controller.name().to_owned()));
            }
        }
        for controller in self.both() {
            // The arm may still be slowing down, or be armed, or move to the last target.
            controller.stop()?;
            loop {
                match controller.status()?.state {
                    ControllerState::EStop => {
                        return Err(HomeError::Stopped(controller.name().to_owned()));
                    }
                    ControllerState::Fault(code) => match controller.clear_fault() {
                        Err(LinkError::Refused {
                            refusal: RequestRefusal::State(_),
                            ..
                        }) => {}
                        Err(LinkError::Refused { .. }) => {
                            return Err(HomeError::Fault(controller.name().to_owned(), code));
                        }
                        other => other?,
                    },
                    ControllerState::Idle | ControllerState::Unhomed => break,
                    _ => {}
                }
                if controller.now_us() > deadline_us {
                    return Err(HomeError::Stopped(controller.name().to_owned()));
                }
                controller.rest(HEARTBEAT_US / 10)?;
            }
        }
        self.home()
    }
}
