//! The states of a controller and their one owner.
//!
//! ```text
//! Boot → Unhomed → Homing → Idle ⇄ Moving → Settling → Idle ⇄ Armed
//! any state → Fault(code) or EStop → (ClearFault) → Idle, or Unhomed where home is lost
//! ```
//! Only [`ArmController::enter`] writes the state. Here: the states, their transitions and the control
//! tick. In the files beside it: `requests` (what the host may ask for, and when it is refused),
//! `motion` (homing, moves, settling), `drivers` (those set by wire), `pulses` (the trigger), `events` (for the host).

mod drivers;
mod events;
mod motion;
mod pulses;
mod requests;

use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{
    ControllerState, LogEntry, Message, RequestOutcome, RequestRefusal, Status,
};
use gonia_protocol::settings::{Axis, Key};
use heapless::Deque;

use crate::axis::AxisDrive;
use crate::driver::DriverWatch;
use crate::hardware::Hardware;
use crate::homing::Homing;
use crate::power::{Power, PowerDemand};
use crate::settings::ControllerSettings;
use crate::settling::SettlingMonitor;
use crate::train::TriggerTrain;

/// Control ticks while something happens, µs.
pub const BUSY_TICK_US: u64 = 2_000;
/// Control ticks at rest, µs.
pub const REST_TICK_US: u64 = 20_000;
const LOG_LEN: usize = 16;

/// Looks in a row that make an alarm of what may be interference.
const ALARM_LOOKS: u8 = 3;

/// Two axes, their states, and the request under way.
#[derive(Debug)]
pub struct ArmController {
    state: ControllerState,
    homed: bool,
    settings: ControllerSettings,
    drives: [AxisDrive; 2],
    homing: [Option<Homing>; 2],
    settling: [Option<SettlingMonitor>; 2],
    target_udeg: [i32; 2],
    corrections: [u8; 2],
    /// The request under way, which will end in a `Completed`.
    job: Option<u16>,
    stopping: bool,
    train: Option<TriggerTrain>,
    power: Power,
    /// Looks in a row at which the driver's alarm was there.
    alarms: [u8; 2],
    drivers: [DriverWatch; 2],
    last: Option<(u16, RequestOutcome)>,
    host_watchdog_until_us: u64,
    next_tick_us: u64,
    next_telemetry_us: u64,
    event_seq: u32,
    events: Deque<Message, 16>,
    log: Deque<LogEntry, LOG_LEN>,
}

/// Whether the driver of an axis reports an alarm.
fn has_alarm(axis: Axis, settings: &ControllerSettings, hardware: &mut impl Hardware) -> bool {
    match settings.get(axis, Key::DriverAlarm) {
        0 => false,
        1 => !hardware.alarm_closed(axis),
        _ => hardware.alarm_closed(axis),
    }
}

/// The answer to a request.
pub type Answer = Result<Message, RequestRefusal>;

impl ArmController {
    /// A controller that has just started, with the settings found in the board's memory.
    /// `None` means a new board; damaged bytes are a latched fault, with the defaults in use.
    pub fn new(now_us: u64, stored_settings: Option<&[u8]>) -> Self {
        let (settings, damaged) = match stored_settings.map(ControllerSettings::from_bytes) {
            None => (ControllerSettings::default(), false),
            Some(Ok(settings)) => (settings, false),
            Some(Err(_)) => (ControllerSettings::default(), true),
        };
        let mut controller = Self {
            state: ControllerState::Boot,
            homed: false,
            drives: Axis::BOTH.map(|axis| AxisDrive::new(axis, &settings)),
            settings,
            homing: [None; 2],
            settling: [None; 2],
            target_udeg: [0; 2],
            corrections: [0; 2],
            job: None,
            stopping: false,
            train: None,
            power: Power::default(),
            alarms: [0; 2],
            drivers: Default::default(),
            last: None,
            host_watchdog_until_us: 0,
            next_tick_us: now_us,
            next_telemetry_us: u64::MAX,
            event_seq: 0,
            events: Deque::new(),
            log: Deque::new(),
        };
        if damaged {
            controller.fault(now_us, FaultCode::SETTINGS_DAMAGED, None);
        }
        controller
    }

    /// What it is doing.
    pub fn state(&self) -> ControllerState {
        self.state
    }

    /// Whether steps are being given.
    pub fn is_moving(&self) -> bool {
        self.drives.iter().any(AxisDrive::is_moving)
    }

    /// The settings in use.
    pub fn settings(&self) -> &ControllerSettings {
        &self.settings
    }

    /// When [`Self::poll`] must be called next, µs.
    pub fn wake_us(&self) -> u64 {
        let train = self.train.as_ref().map_or(u64::MAX, TriggerTrain::wake_us);
        self.next_tick_us.min(train)
    }

    /// Its status; the caller fills in the counters of the wire.
    pub fn status(&self, now_us: u64) -> Status {
        Status {
            time_us: now_us,
            state: self.state,
            homed: self.homed,
            axes: [self.drives[0].status(), self.drives[1].status()],
            last: self.last,
            packets_good: 0,
            packets_bad: 0,
            config_crc: self.settings.crc(),
        }
    }

    /// A packet of the host came.
    pub fn restart_host_watchdog(&mut self, now_us: u64) {
        self.host_watchdog_until_us =
            now_us + self.settings.get_u64(Axis::Theta, Key::HostWatchdog);
    }

    /// Does whatever is due: pulses, and every tick the control of both axes; and sees to it that the
    /// step timers have something to do until the next tick.
    pub fn poll(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        for drive in &mut self.drives {
            drive.take_progress(hardware);
        }
        if self.train.is_some() {
            self.give_pulses(now_us, hardware);
        }
        if now_us >= self.next_tick_us {
            self.tick(now_us, hardware);
            let period = if self.is_busy() || self.sets_drivers() {
                BUSY_TICK_US
            } else {
                REST_TICK_US
            };
            self.next_tick_us = now_us + period;
        }
        self.feed(hardware);
    }

    fn feed(&mut self, hardware: &mut impl Hardware) {
        for drive in &mut self.drives {
            drive.feed(hardware);
        }
    }

    fn is_busy(&self) -> bool {
        !matches!(
            self.state,
            ControllerState::Idle
                | ControllerState::Unhomed
                | ControllerState::EStop
                | ControllerState::Fault(_)
        ) || self.drives.iter().any(AxisDrive::is_moving)
    }

    fn needs_host(&self) -> bool {
        matches!(
            self.state,
            ControllerState::Homing
                | ControllerState::Moving
                | ControllerState::Settling
                | ControllerState::Armed
        )
    }

    fn tick(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        if !hardware.interlock_closed() && self.state != ControllerState::EStop {
            self.emergency_stop(now_us, hardware);
        }
        if let Some(axis) = self.axis_with_alarm(hardware) {
            self.fault_unless_latched(now_us, FaultCode::DRIVER_ALARM, Some(axis), hardware);
        }
        self.tick_drivers(now_us, hardware);
        self.tick_power(now_us, hardware);
        for axis in Axis::BOTH {
            let drive = &mut self.drives[axis.index()];
            let read = drive.read(now_us, &self.settings, hardware);
            let warns = drive.take_warning();
            if let Err(code) = read {
                self.fault_unless_latched(now_us, code, Some(axis), hardware);
                return;
            }
            if warns {
                self.note_fault(now_us, FaultCode::ENCODER_WARNING, Some(axis));
            }
        }
        if self.needs_host() && now_us > self.host_watchdog_until_us {
            self.fault_unless_latched(now_us, FaultCode::HOST_WATCHDOG, None, hardware);
            return;
        }
        match self.state {
            ControllerState::Boot => self.enter(ControllerState::Unhomed, now_us),
            ControllerState::Homing => self.tick_homing(now_us, hardware),
            ControllerState::Moving | ControllerState::Settling => {
                self.tick_motion(now_us, hardware)
            }
            // Moved by hand over its index: from here on the status shows angles from there.
            ControllerState::Unhomed if !self.is_moving() => {
                let drives = self.drives.iter_mut();
                drives
                    .filter(|drive| drive.has_new_index())
                    .for_each(AxisDrive::forget_encoder);
            }
            // It may still be slowing down.
            ControllerState::Fault(_) => {
                self.check_following(now_us, hardware);
            }
            _ => {}
        }
        self.send_telemetry(now_us);
    }

    fn tick_power(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        let demand = match self.state {
            // What opens the chain may take the drivers' supply.
            ControllerState::EStop => PowerDemand::Brake,
            // Many a driver forgets its alarm when it is switched off.
            ControllerState::Fault(FaultCode::DRIVER_ALARM) => PowerDemand::Off,
            ControllerState::Fault(code) if code.is_of_driver() => PowerDemand::Off,
            _ => PowerDemand::Run,
        };
        let demand = match demand {
            // No current, and no brake let go, before the drivers know how much they give.
            PowerDemand::Run if !self.drivers_are_set() => self.power.as_it_is(),
            demand => demand,
        };
        let brake_us = self.settings.get_u64(Axis::Theta, Key::BrakeTime);
        self.power.tick(now_us, demand, brake_us, hardware);
    }

    /// The first axis whose driver has reported an alarm for a while.
    fn axis_with_alarm(&mut self, hardware: &mut impl Hardware) -> Option<Axis> {
        Axis::BOTH.into_iter().find(|&axis| {
            let looks = &mut self.alarms[axis.index()];
            *looks = if has_alarm(axis, &self.settings, hardware) {
                looks.saturating_add(1)
            } else {
                0
            };
            *looks >= ALARM_LOOKS
        })
    }

    // ---- transitions ----

    /// The one place where the state changes.
    fn enter(&mut self, state: ControllerState, now_us: u64) {
        if self.state == state {
            return;
        }
        #[cfg(feature = "defmt")]
        defmt::debug!("{} -> {}", self.state, state);
        self.state = state;
        self.next_tick_us = self.next_tick_us.min(now_us + BUSY_TICK_US);
        let telemetry = self.settings.get_u64(Axis::Theta, Key::Telemetry);
        if telemetry > 0 && self.next_telemetry_us == u64::MAX && self.needs_host() {
            self.next_telemetry_us = now_us + telemetry;
        }
    }

    fn emergency_stop(&mut self, now_us: u64, hardware: &mut impl Hardware) {
        self.halt(hardware);
        hardware.end_pulse();
        // Stopping at once may have lost steps.
        self.homed = false;
        self.note_fault(now_us, FaultCode::INTERLOCK_OPEN, None);
        self.enter(ControllerState::EStop, now_us);
        self.drop_work(RequestOutcome::Failed(FaultCode::INTERLOCK_OPEN));
    }

    fn fault_unless_latched(
        &mut self,
        now_us: u64,
        code: FaultCode,
        axis: Option<Axis>,
        hardware: &mut impl Hardware,
    ) {
        if matches!(
            self.state,
            ControllerState::Fault(_) | ControllerState::EStop
        ) && !self.is_moving()
        {
            return;
        }
        hardware.end_pulse();
        if code == FaultCode::HOST_WATCHDOG {
            self.drives.iter_mut().for_each(AxisDrive::decelerate);
        } else {
            self.halt(hardware);
        }
        self.fault(now_us, code, axis);
    }

    fn halt(&mut self, hardware: &mut impl Hardware) {
        for drive in &mut self.drives {
            drive.halt(hardware);
        }
    }

    /// Latches a fault; the caller has stopped the arm.
    fn fault(&mut self, now_us: u64, code: FaultCode, axis: Option<Axis>) {
        self.homed &= !code.loses_home();
        self.note_fault(now_us, code, axis);
        self.enter(ControllerState::Fault(code), now_us);
        self.drop_work(RequestOutcome::Failed(code));
    }

    fn drop_work(&mut self, outcome: RequestOutcome) {
        self.homing = [None; 2];
        self.settling = [None; 2];
        self.train = None;
        self.complete(outcome);
    }
}
