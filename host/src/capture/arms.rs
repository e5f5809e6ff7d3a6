//! Both arms together: what a session does with them, and how it gets them back after a fault.

use gonia_brdf::Pose;
use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{
    ControllerState, MAX_PULSES, RequestOutcome, RequestRefusal, TriggerRequest, TriggerRole,
};
use gonia_protocol::settings::{Axis, Key};
use gonia_protocol::{NODE_CAMERA, NODE_LIGHT};

use super::keep_out::{self, Pair};
use super::timing::nearest_turn_deg;
use crate::link::{Controller, HEARTBEAT_US, LinkError, Ticket, Transport, is_uncalibrated};

/// Longest homing: the whole travel of φ at the default search speed, and the slow approach, µs.
const HOMING_LIMIT_US: u64 = 240_000_000;
/// Longest move: two turns of φ, with every correction, µs.
const MOVE_LIMIT_US: u64 = 120_000_000;
/// A follower latches with the pulse; its event is here soon after, µs.
const FOLLOWER_LIMIT_US: u64 = 300_000;
/// How long a controller that does not answer is asked again, µs.
const RECONNECT_LIMIT_US: u64 = 60_000_000;

/// How often bringing the arms back is tried again, and after which pause, µs.
const RECOVERIES: u32 = 4;
const PAUSE_US: u64 = 3_000_000;

/// How a session takes its shots.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Exposure times of a shot's pulses, µs: one to eight.
    pub exposures_us: Vec<u32>,
    /// Pause between pulses, µs.
    pub gap_us: u32,
    /// How often a shot outside the pointing limit, or without its latch, is taken again.
    pub max_retakes: u32,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            exposures_us: vec![10_000],
            gap_us: 5_000,
            max_retakes: 3,
        }
    }
}

/// The light arm and the camera arm.
pub struct Arms {
    pub(super) options: Options,
    light: Controller,
    camera: Controller,
    phi_limits_deg: [[f64; 2]; 2],
    /// Directions of light and view nearer to each other than this would make the arms touch.
    pub(super) keep_out_deg: f64,
    /// An arm stands beyond its limits, where only homing helps, although it knows where it is.
    pub(super) must_home: bool,
    /// The last target of each arm, µdeg: where φ is.
    at_udeg: [[i32; 2]; 2],
}

/// What both controllers latched at a pulse.
#[derive(Clone, Copy, Debug)]
pub(super) struct Latched {
    /// Of light arm and camera arm, µdeg.
    pub encoder_udeg: [[i32; 2]; 2],
    /// When, by the clock of the camera arm, which gives the pulse, µs.
    pub time_us: u64,
}

/// What came of a try.
#[derive(Debug)]
pub(super) enum Try {
    /// What was latched at each pulse.
    Latched(Vec<Latched>),
    /// Nothing usable; it may be tried again.
    Again(String),
    /// A controller has latched a fault, has restarted, or does not answer.
    Broken(String),
}

impl Arms {
    /// Says hello to both controllers and reads their limits.
    pub fn connect(
        light: Box<dyn Transport>,
        camera: Box<dyn Transport>,
    ) -> Result<Self, LinkError> {
        let mut light = Controller::connect(light, NODE_LIGHT)?;
        let mut camera = Controller::connect(camera, NODE_CAMERA)?;
        let phi_limits_deg = [phi_limits(&mut light)?, phi_limits(&mut camera)?];
        Ok(Self {
            options: Options::default(),
            light,
            camera,
            phi_limits_deg,
            keep_out_deg: 0.0,
            must_home: false,
            at_udeg: [[0; 2]; 2],
        })
    }

    /// The light arm's controller.
    pub fn light(&mut self) -> &mut Controller {
        &mut self.light
    }

    /// The camera arm's controller.
    pub fn camera(&mut self) -> &mut Controller {
        &mut self.camera
    }

    /// The axes whose encoders have no error map: their true angle is not known to the pointing limit,
    /// whatever the encoder says.
    ///
    /// # Errors
    /// The link failed.
    pub fn uncalibrated(&mut self) -> Result<Vec<(String, Axis)>, LinkError> {
        let mut found = Vec::new();
        for controller in self.both() {
            for axis in Axis::BOTH {
                if is_uncalibrated(controller, axis)? {
                    found.push((controller.name().to_owned(), axis));
                }
            }
        }
        Ok(found)
    }

    /// What a person should hear of that before a session; nothing when all is well.
    ///
    /// # Errors
    /// The link failed.
    pub fn calibration_warning(&mut self) -> Result<Option<String>, LinkError> {
        let axes: Vec<String> = self
            .uncalibrated()?
            .into_iter()
            .map(|(arm, axis)| format!("{arm} {}", format!("{axis:?}").to_lowercase()))
            .collect();
        Ok((!axes.is_empty()).then(|| {
            format!(
                "encoders never calibrated: {}; how far they are off over the turn is not known (gonia device PORT calibrate)",
                axes.join(", ")
            )
        }))
    }

    /// Now, by the arms' clock, µs: virtual on a simulated rig.
    pub fn now_us(&self) -> u64 {
        self.camera.now_us()
    }

    /// Events lost and requests repeated so far, of both arms.
    pub fn losses(&self) -> (u32, u32) {
        let (light, camera) = (self.light.losses(), self.camera.losses());
        (
            light.0.saturating_add(camera.0),
            light.1.saturating_add(camera.1),
        )
    }

    /// Changes how shots are taken.
    ///
    /// # Errors
    /// No exposure, more than [`MAX_PULSES`] of them, or one of no length.
    pub fn set_options(&mut self, options: Options) -> Result<(), BadExposures> {
        let times = &options.exposures_us;
        if !(1..=MAX_PULSES).contains(&times.len()) || times.contains(&0) {
            return Err(BadExposures(times.len()));
        }
        self.options = options;
        Ok(())
    }

    /// No pose is taken whose light and view are nearer to each other than this, degrees, and on no way
    /// from pose to pose do they come nearer, whichever arm is late: on rigs whose arms can touch. 0,
    /// the default, for arms that pass each other at different distances. Homing is not watched: before
    /// it nobody knows where the arms are.
    pub fn set_keep_out_deg(&mut self, keep_out_deg: f64) {
        self.keep_out_deg = keep_out_deg;
    }

    /// Homes those arms that do not know where they are, both at once.
    pub fn home(&mut self) -> Result<(), HomeError> {
        let mut tickets = [None; 2];
        let must_home = self.must_home;
        for (controller, ticket) in self.both().into_iter().zip(&mut tickets) {
            if must_home || !controller.status()?.homed {
                *ticket = Some(controller.home()?);
            }
        }
        let outcomes = self.wait_for(tickets, HOMING_LIMIT_US)?;
        for (i, outcome) in outcomes.into_iter().enumerate() {
            match outcome {
                None | Some(RequestOutcome::Done) => {}
                Some(RequestOutcome::Failed(code)) => {
                    return Err(HomeError::Fault(self.both()[i].name().to_owned(), code));
                }
                Some(_) => return Err(HomeError::Stopped(self.both()[i].name().to_owned())),
            }
        }
        self.must_home = false;
        for (i, at) in [0, 1].into_iter().zip(self.positions_udeg()?) {
            self.at_udeg[i] = at;
        }
        Ok(())
    }

    /// Stops both arms, gently. Tries both even when one does not answer.
    pub fn stop(&mut self) -> Result<(), LinkError> {
        let light = self.light.stop();
        self.camera.stop()?;
        light
    }

    /// The axis angles for a pose, µdeg: light and camera, θ and φ, φ the shortest way from where
    /// the arms are, or another turn of it where the other arm is in that way. `None` if φ has no turn
    /// within the limits.
    pub(super) fn targets_udeg(&self, pose: &Pose) -> Option<[[i32; 2]; 2]> {
        let mut turns = [[None; 3]; 2];
        for (i, direction) in [pose.light, pose.view].into_iter().enumerate() {
            let from_deg = f64::from(self.at_udeg[i][1]) * 1e-6;
            let limits_deg = self.phi_limits_deg[i];
            let nearest_deg = nearest_turn_deg(from_deg, direction.phi_deg(), limits_deg)?;
            turns[i] = [0.0, 360.0, -360.0].map(|turn_deg| {
                let phi_deg = nearest_deg + turn_deg;
                let is_within =
                    turn_deg == 0.0 || (limits_deg[0]..=limits_deg[1]).contains(&phi_deg);
                let target = [direction.theta_deg(), phi_deg].map(|deg| (deg * 1e6).round() as i32);
                is_within.then_some(target)
            });
        }
        let nearest = [turns[0][0]?, turns[1][0]?];
        if self.keep_out_deg <= 0.0 {
            return Some(nearest);
        }
        let ways = turns[1].iter().flatten().flat_map(|camera| {
            turns[0]
                .iter()
                .flatten()
                .map(move |light| [*light, *camera])
        });
        let mut clear = ways.filter(|targets| self.legs_udeg(*targets).is_some());
        // None: `go` will say so.
        Some(clear.next().unwrap_or(nearest))
    }

    /// The legs of a way to these targets that is clear of the keep-out angle, if there is one.
    fn legs_udeg(&self, targets_udeg: [[i32; 2]; 2]) -> Option<Vec<[[i32; 2]; 2]>> {
        if self.keep_out_deg <= 0.0 {
            return Some(vec![targets_udeg]);
        }
        let deg = |pair: [[i32; 2]; 2]| pair.map(|axes| axes.map(|udeg| f64::from(udeg) * 1e-6));
        let udeg = |pair: Pair| pair.map(|axes| axes.map(|deg| (deg * 1e6).round() as i32));
        let legs = keep_out::way(&deg(self.at_udeg), &deg(targets_udeg), self.keep_out_deg)?;
        Some(legs.into_iter().map(udeg).collect())
    }

    /// Moves both arms, clear of each other, and waits until both are at rest; what went wrong, if
    /// anything did.
    pub(super) fn go(&mut self, targets_udeg: [[i32; 2]; 2]) -> Result<Option<Try>, LinkError> {
        let Some(legs) = self.legs_udeg(targets_udeg) else {
            let angle = self.keep_out_deg;
            let reason = format!("no way there keeps the arms {angle:.1}° apart");
            return Ok(Some(Try::Again(reason)));
        };
        for leg in legs {
            if let Some(tried) = self.go_straight(leg)? {
                return Ok(Some(tried));
            }
        }
        Ok(None)
    }

    /// A single leg.
    fn go_straight(&mut self, targets_udeg: [[i32; 2]; 2]) -> Result<Option<Try>, LinkError> {
        let mut tickets = [None; 2];
        for ((controller, target), ticket) in
            self.both().into_iter().zip(targets_udeg).zip(&mut tickets)
        {
            *ticket = Some(controller.move_to(target)?);
        }
        self.at_udeg = targets_udeg;
        for outcome in self.wait_for(tickets, MOVE_LIMIT_US)?.into_iter().flatten() {
            if outcome != RequestOutcome::Done {
                return Ok(Some(ended_badly("a move", outcome)));
            }
        }
        Ok(None)
    }

    /// Triggers, and collects the latches.
    pub(super) fn trigger(&mut self) -> Result<Try, LinkError> {
        let exposures_us: heapless::Vec<u32, MAX_PULSES> =
            self.options.exposures_us.iter().copied().collect();
        let pulses = exposures_us.len() as u8;
        let arm = |trigger| TriggerRequest {
            trigger,
            exposures_us: exposures_us.clone(),
            gap_us: self.options.gap_us,
        };
        let (follower, source) = (arm(TriggerRole::Follower), arm(TriggerRole::Source));
        let following = self.light.request_trigger(follower)?;
        let length_us: u64 = self
            .options
            .exposures_us
            .iter()
            .map(|&us| u64::from(us))
            .sum();
        let limit_us = length_us + 8 * u64::from(self.options.gap_us) + 1_000_000;
        let fired = self
            .camera
            .request_trigger(source)
            .and_then(|_| self.camera.fire());
        let given = fired.and_then(|ticket| self.wait_for([None, Some(ticket)], limit_us));
        match given {
            Ok([_, Some(RequestOutcome::Done)]) => {}
            Ok([_, outcome]) => {
                self.disarm()?;
                return Ok(outcome.map_or(Try::Again("no trigger".into()), |outcome| {
                    ended_badly("the trigger", outcome)
                }));
            }
            Err(error) => {
                self.disarm()?;
                return Err(error);
            }
        }
        match self.light.wait(following, FOLLOWER_LIMIT_US) {
            Ok(completed) if completed.outcome == RequestOutcome::Done => {}
            Ok(completed) => return Ok(ended_badly("the trigger", completed.outcome)),
            Err(LinkError::Endless { .. }) => {
                self.disarm()?;
                return Ok(Try::Again("the light arm did not see the trigger".into()));
            }
            Err(error) => return Err(error),
        }
        let mut latches = Vec::new();
        for pulse in 0..pulses {
            let pair = [self.light.latch(pulse)?, self.camera.latch(pulse)?];
            if !pair.iter().all(|latch| latch.within) {
                return Ok(Try::Again(
                    "an arm was outside its window at the trigger".into(),
                ));
            }
            let time_us = pair[1].time_us;
            latches.push(Latched {
                encoder_udeg: pair.map(|latch| latch.encoder_udeg),
                time_us,
            });
        }
        Ok(Try::Latched(latches))
    }

    /// Brings both controllers back after a fault, a restart or a lost cable: hello, clear, home
    /// where needed.
    /// What may pass, such as another fault on the way home, is recovered automatically too, a few times.
    pub(super) fn recover(&mut self) -> Result<(), HomeError> {
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
            // The arm may still be slowing down, or be armed, or be under way to the last target.
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

    fn disarm(&mut self) -> Result<(), LinkError> {
        self.light.disarm()?;
        self.camera.disarm()
    }

    fn both(&mut self) -> [&mut Controller; 2] {
        [&mut self.light, &mut self.camera]
    }

    /// Where the arms are, or rather the nearest places that they may be sent to: an arm parks at its
    /// lowest angle, give or take the in-position window.
    fn positions_udeg(&mut self) -> Result<[[i32; 2]; 2], LinkError> {
        let mut at = [[0; 2]; 2];
        for (controller, at) in self.both().into_iter().zip(&mut at) {
            let axes = controller.status()?.axes;
            *at = axes.map(|axis| axis.encoder_udeg);
            for axis in Axis::BOTH {
                let low = controller.setting(axis, Key::SoftMin)?;
                let high = controller.setting(axis, Key::SoftMax)?;
                let at = &mut at[axis.index()];
                *at = (*at).max(low).min(high);
            }
        }
        Ok(at)
    }

    /// Waits for both arms, and restarts the host watchdog of the one that is not being listened to.
    fn wait_for(
        &mut self,
        tickets: [Option<Ticket>; 2],
        limit_us: u64,
    ) -> Result<[Option<RequestOutcome>; 2], LinkError> {
        let deadline_us = self.now_us() + limit_us;
        let mut outcomes = [None; 2];
        for i in 0..2 {
            let Some(ticket) = tickets[i] else { continue };
            outcomes[i] = loop {
                let [light, camera] = self.both();
                let (this, other) = if i == 0 {
                    (light, camera)
                } else {
                    (camera, light)
                };
                if let Some(completed) = this.poll(ticket, HEARTBEAT_US / 2)? {
                    break Some(completed.outcome);
                }
                other.keep_alive()?;
                if this.now_us() > deadline_us {
                    break Some(this.must_have_ended(ticket, limit_us)?.outcome);
                }
            };
        }
        Ok(outcomes)
    }
}

/// Exposure times that no trigger train can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0} exposures given; give 1 to {MAX_PULSES}, each longer than 0 µs")]
pub struct BadExposures(usize);

/// Why the arms are not ready.
#[derive(Debug, thiserror::Error)]
pub enum HomeError {
    /// The link failed.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// A fault that does not go away.
    #[error("{0}: {1}")]
    Fault(String, FaultCode),
    /// Somebody stopped the arm.
    #[error("{0}: stopped by hand or by the interlock; make it safe, clear the fault and resume")]
    Stopped(String),
    /// The controller came back with other settings.
    #[error(
        "{0}: came back with other settings than the session began with; restore them and resume"
    )]
    OtherSettings(String),
}

impl HomeError {
    /// Whether it may be gone at the next try. A person's stop, other settings and a switch that does
    /// not switch do not go away by themselves; a noisy encoder looks like a shifted one while it lasts.
    pub(super) fn may_pass(&self) -> bool {
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

fn ended_badly(what: &str, outcome: RequestOutcome) -> Try {
    match outcome {
        RequestOutcome::Failed(code) => Try::Broken(format!("{what} ended in {code}")),
        RequestOutcome::LeftWindow(axis) => {
            Try::Again(format!("{axis:?} left its window during the exposure"))
        }
        RequestOutcome::Stopped => Try::Broken(format!("{what} was stopped")),
        RequestOutcome::Done => Try::Again(format!("{what} ended early")),
    }
}

fn phi_limits(controller: &mut Controller) -> Result<[f64; 2], LinkError> {
    let mut limit = |key| {
        controller
            .setting(Axis::Phi, key)
            .map(|udeg| f64::from(udeg) * 1e-6)
    };
    Ok([limit(Key::SoftMin)?, limit(Key::SoftMax)?])
}
