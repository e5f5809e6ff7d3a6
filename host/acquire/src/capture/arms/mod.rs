//! Both arms together: what a session does with them, and how it recovers them after a fault.

mod recovery;
mod trigger;

use crate::capture::keep_out;
use crate::capture::keep_out::ArmAngles;
use crate::capture::timing::nearest_turn_deg;
use crate::link::{HEARTBEAT_US, LinkError, RemoteController, Ticket, Transport, is_uncalibrated};
use gonia_brdf::Pose;
use gonia_brdf::direction::angle_between;
use gonia_protocol::message::{MAX_PULSES, RequestOutcome};
use gonia_protocol::settings::{Axis, Key};
use gonia_protocol::{NODE_CAMERA, NODE_LIGHT};
use gonia_rig::Remark;

pub use recovery::HomeError;

/// Longest homing: the whole travel of φ at the default search speed, and the slow approach, µs.
const HOMING_LIMIT_US: u64 = 240_000_000;
/// Longest move: two turns of φ, with every correction, µs.
const MOVE_LIMIT_US: u64 = 120_000_000;

/// How a session takes its shots.
#[derive(Clone, Debug, PartialEq)]
pub struct ShotOptions {
    /// Exposure times of a shot's pulses, µs: one to eight.
    pub exposures_us: Vec<u32>,
    /// Pause between pulses, µs.
    pub gap_us: u32,
    /// How often a shot outside the pointing limit, or without its encoders at a pulse, is taken again.
    pub max_retakes: u32,
}

impl Default for ShotOptions {
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
    pub(super) options: ShotOptions,
    light: RemoteController,
    camera: RemoteController,
    /// Each was found at the other one's port.
    is_exchanged: bool,
    phi_limits_deg: [[f64; 2]; 2],
    /// Directions of light and view nearer to each other than this would make the arms touch.
    pub(super) keep_out_deg: f64,
    /// An arm stands beyond its limits, where only homing helps, although it knows where it is.
    pub(super) must_home: bool,
    /// The last target of each arm, µdeg: where φ is.
    at_udeg: [[i32; 2]; 2],
}

/// What both controllers captured at a pulse.
#[derive(Clone, Copy, Debug)]
pub(super) struct Latched {
    /// Of light arm and camera arm, µdeg.
    pub encoder_udeg: [[i32; 2]; 2],
    /// When, by the clock of the camera arm, which gives the pulse, µs.
    pub time_us: u64,
}

/// Why a move or a trigger gave nothing.
#[derive(Debug)]
pub(super) enum TryError {
    /// Nothing is broken: it may be tried again.
    Repeat(String),
    /// A controller has a latched fault, has restarted, or does not answer.
    Recover(String),
    /// A request failed.
    Link(LinkError),
}

impl From<LinkError> for TryError {
    fn from(error: LinkError) -> Self {
        TryError::Link(error)
    }
}

impl TryError {
    /// What it means that something ended otherwise than done.
    fn of_outcome(what: &str, outcome: RequestOutcome) -> Self {
        match outcome {
            RequestOutcome::Failed(code) => TryError::Recover(format!("{what} ended in {code}")),
            RequestOutcome::LeftWindow(axis) => {
                TryError::Repeat(format!("{axis:?} left its window during the exposure"))
            }
            RequestOutcome::Stopped => TryError::Recover(format!("{what} was stopped")),
            RequestOutcome::Done => TryError::Repeat(format!("{what} ended early")),
        }
    }
}

/// The angle between the arms at a pose, degrees.
pub(super) fn pose_apart_deg(pose: &Pose) -> f64 {
    angle_between(pose.light.to_vec3(), pose.view.to_vec3()).to_degrees()
}

impl Arms {
    /// Says hello to both controllers and reads their limits. Each is the arm that it says it is: ports
    /// that were exchanged are used rightly, and [`Self::exchange_remark`] says so.
    ///
    /// # Errors
    /// A controller does not answer, or speaks another protocol; or both are the same arm.
    pub fn connect(
        light: Box<dyn Transport>,
        camera: Box<dyn Transport>,
    ) -> Result<Self, LinkError> {
        let light = RemoteController::connect_any(light, "light arm")?;
        let camera = RemoteController::connect_any(camera, "camera arm")?;
        let is_exchanged = (light.node(), camera.node()) == (NODE_CAMERA, NODE_LIGHT);
        let (mut light, mut camera) = if is_exchanged {
            (camera, light)
        } else {
            (light, camera)
        };
        if light.node() == camera.node() {
            let arm = light.name().to_owned();
            return Err(LinkError::SameArm { arm });
        }
        let phi_limits_deg = [phi_limits(&mut light)?, phi_limits(&mut camera)?];
        Ok(Self {
            options: ShotOptions::default(),
            light,
            camera,
            is_exchanged,
            phi_limits_deg,
            keep_out_deg: 0.0,
            must_home: false,
            at_udeg: [[0; 2]; 2],
        })
    }

    /// What to say where each arm's controller was found at the other one's port.
    pub fn exchange_remark(&self) -> Option<Remark> {
        self.is_exchanged.then(|| {
            Remark::new(
                "arms",
                "the light arm's controller answers at the camera arm's port, and the camera arm's at the light arm's; each is used as what it says it is",
                "exchange light and camera under [arms] in rig.toml, or --light and --camera-arm",
            )
        })
    }

    /// What both controllers have warned of since the last call.
    pub fn take_remarks(&mut self) -> Vec<Remark> {
        let mut remarks = self.light.take_remarks();
        remarks.extend(self.camera.take_remarks());
        remarks
    }

    /// The light arm's controller.
    pub fn light(&mut self) -> &mut RemoteController {
        &mut self.light
    }

    /// The camera arm's controller.
    pub fn camera(&mut self) -> &mut RemoteController {
        &mut self.camera
    }

    /// The axes whose encoders have no error map: their true angle is not known to the pointing limit.
    /// Each with its arm's name.
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

    /// The warning about such axes that a person should read before a session; `None` when there are none.
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
    pub fn set_options(&mut self, options: ShotOptions) -> Result<(), BadExposures> {
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
    ///
    /// # Errors
    /// The link failed, or homing ended in a fault or a stop.
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

    /// Decelerates and stops both arms. Tries both even when one does not answer.
    ///
    /// # Errors
    /// A controller did not answer.
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

    /// The arm that has no turn for the azimuth of a pose, and that azimuth in degrees, if there is one.
    pub(super) fn without_turn(&self, pose: &Pose) -> Option<(String, f64)> {
        let arms = [(&self.light, pose.light), (&self.camera, pose.view)];
        let limits = arms.into_iter().zip(self.phi_limits_deg);
        limits
            .into_iter()
            .find_map(|((arm, direction), limits_deg)| {
                let phi_deg = direction.phi_deg();
                // Whatever the arm comes from: a turn that is nearest from there may be out, another one in.
                let turns = [-2.0, -1.0, 0.0, 1.0, 2.0].map(|turn| phi_deg + 360.0 * turn);
                let has_turn = turns
                    .iter()
                    .any(|phi_deg| (limits_deg[0]..=limits_deg[1]).contains(phi_deg));
                (!has_turn).then(|| (arm.name().to_owned(), phi_deg))
            })
    }

    /// The legs of a way to these targets that is clear of the keep-out angle, if there is one.
    fn legs_udeg(&self, targets_udeg: [[i32; 2]; 2]) -> Option<Vec<[[i32; 2]; 2]>> {
        if self.keep_out_deg <= 0.0 {
            return Some(vec![targets_udeg]);
        }
        let deg = |pair: [[i32; 2]; 2]| pair.map(|axes| axes.map(|udeg| f64::from(udeg) * 1e-6));
        let udeg = |pair: ArmAngles| pair.map(|axes| axes.map(|deg| (deg * 1e6).round() as i32));
        let legs = keep_out::way(&deg(self.at_udeg), &deg(targets_udeg), self.keep_out_deg)?;
        Some(legs.into_iter().map(udeg).collect())
    }

    /// Moves both arms, clear of each other, and waits until both are at rest.
    pub(super) fn go(&mut self, targets_udeg: [[i32; 2]; 2]) -> Result<(), TryError> {
        let Some(legs) = self.legs_udeg(targets_udeg) else {
            let angle = self.keep_out_deg;
            let reason = format!("no way there keeps the arms {angle:.1}° apart");
            return Err(TryError::Repeat(reason));
        };
        for leg in legs {
            self.go_straight(leg)?;
        }
        Ok(())
    }

    /// A single leg.
    fn go_straight(&mut self, targets_udeg: [[i32; 2]; 2]) -> Result<(), TryError> {
        let mut tickets = [None; 2];
        for ((controller, target), ticket) in
            self.both().into_iter().zip(targets_udeg).zip(&mut tickets)
        {
            *ticket = Some(controller.move_to(target)?);
        }
        self.at_udeg = targets_udeg;
        for outcome in self.wait_for(tickets, MOVE_LIMIT_US)?.into_iter().flatten() {
            if outcome != RequestOutcome::Done {
                return Err(TryError::of_outcome("a move", outcome));
            }
        }
        Ok(())
    }

    fn both(&mut self) -> [&mut RemoteController; 2] {
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

    /// Waits for both arms, and renews the host watchdog of the one that is not being listened to.
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

fn phi_limits(controller: &mut RemoteController) -> Result<[f64; 2], LinkError> {
    let mut limit = |key| {
        controller
            .setting(Axis::Phi, key)
            .map(|udeg| f64::from(udeg) * 1e-6)
    };
    Ok([limit(Key::SoftMin)?, limit(Key::SoftMax)?])
}
