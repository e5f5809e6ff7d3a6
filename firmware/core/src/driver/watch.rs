//! One driver: its settings written and read back, then looked at every now and then.

use gonia_protocol::fault::FaultCode;
use gonia_protocol::settings::Axis;

use super::registers::{
    ANSWER_DELAY, CHOPCONF, DRV_STATUS, GCONF, GLOBAL_SCALER, GSTAT, GSTAT_ALL, GSTAT_DRIVER_ERROR,
    GSTAT_RESET, GSTAT_UNDERVOLTAGE, IFCNT, IHOLD_IRUN, IOIN_2209, IOIN_5160, POWER_DOWN,
    SLAVECONF, TPOWERDOWN, chopconf, condition, gconf, ihold_irun, version,
};
use super::{DriverBus, DriverSetup, Say, currents};
use crate::hardware::{DriverAnswer, Hardware};

/// From one look to the next, µs: at rest, and while the motor turns.
const REST_US: u64 = 1_000_000;
const TURNING_US: u64 = 250_000;
/// So often in a row a request goes without an answer, or with a garbled one, before that is a fault.
const TRIES: u8 = 3;
/// So often the settings are written before ones that are not there are a fault: interference takes one.
const ROUNDS: u8 = 2;
/// Looks in a row, each in slow motion, that make an open coil of the driver's flag.
const OPEN_LOOKS: u8 = 3;
/// Slow motion, in full steps a second: the data sheets call the flag wrong at rest and in fast motion. Below the
/// lower rate not every coil has had its turn between two looks.
const SLOW_FULL_STEPS_S: core::ops::RangeInclusive<u64> = 8..=200;

/// What is said when, and what the answer must be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Op {
    /// The chip is of the kind that the settings name.
    Version(u8),
    /// How many writes have arrived so far.
    CountBefore,
    /// A write.
    Write(u8, u32),
    /// As many writes have arrived since as were sent.
    CountAfter,
    /// The register holds this.
    Holds(u8, u32),
    /// What has happened since the last look.
    Events,
    /// How driver and motor are.
    Condition,
}

/// Writes of a setup to a TMC2209, which counts them.
const WRITES_2209: usize = 6;

/// The steps of a setup.
fn setup_op(setup: &DriverSetup, at: usize) -> Option<Op> {
    let scales = currents(setup).unwrap_or_default();
    let (config, chopper) = (gconf(setup.bus), chopconf(setup));
    let one_wire = [
        Op::Version(IOIN_2209),
        Op::CountBefore,
        Op::Write(SLAVECONF, ANSWER_DELAY),
        Op::Write(GCONF, config),
        Op::Write(IHOLD_IRUN, ihold_irun(setup)),
        Op::Write(TPOWERDOWN, POWER_DOWN),
        Op::Write(CHOPCONF, chopper),
        Op::Write(GSTAT, GSTAT_ALL),
        Op::CountAfter,
        Op::Holds(GCONF, config),
        Op::Holds(CHOPCONF, chopper),
        Op::Events,
        Op::Condition,
    ];
    let spi = [
        Op::Version(IOIN_5160),
        Op::Write(GCONF, config),
        Op::Write(GLOBAL_SCALER, scales.global),
        Op::Write(IHOLD_IRUN, ihold_irun(setup)),
        Op::Write(TPOWERDOWN, POWER_DOWN),
        Op::Write(CHOPCONF, chopper),
        Op::Write(GSTAT, GSTAT_ALL),
        Op::Holds(GCONF, config),
        Op::Holds(CHOPCONF, chopper),
        Op::Events,
        Op::Condition,
    ];
    match setup.bus {
        DriverBus::OneWire => one_wire.get(at).copied(),
        DriverBus::Spi => spi.get(at).copied(),
    }
}

/// The steps of a look. What the driver must hold comes after the events: a reset is the cause of lost settings.
fn look_op(setup: &DriverSetup, at: usize) -> Option<Op> {
    let ops = [
        Op::Events,
        Op::Condition,
        Op::Holds(CHOPCONF, chopconf(setup)),
    ];
    ops.get(at).copied()
}

/// How the axis moves, for what means something in slow motion only.
#[derive(Clone, Copy, Debug)]
pub struct DriverMotion {
    /// Steps are being given.
    pub is_moving: bool,
    /// Steps given so far, up minus down.
    pub steps: i64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    /// Its settings are being written; nothing is known yet.
    #[default]
    Unset,
    /// It holds its settings.
    Set,
    /// A fault has ended that.
    Failed,
}

/// A driver's setup and watch, step by step.
#[derive(Debug, Default)]
pub struct DriverWatch {
    phase: Phase,
    /// Which step of the setup or of the look.
    at: usize,
    /// An answer to this step is awaited.
    is_asked: bool,
    tries: u8,
    rounds: u8,
    count: u8,
    next_us: u64,
    /// It has switched its outputs off since the settings were written.
    has_failed: bool,
    is_warm: bool,
    open_looks: u8,
    /// Time, steps and whether the axis moved at the last look.
    last_look: Option<(u64, i64)>,
}

impl DriverWatch {
    /// Whether the driver holds its settings.
    pub fn is_set(&self) -> bool {
        self.phase == Phase::Set
    }

    /// Its settings are to be written, from the beginning.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// The same where a fault has ended the watch.
    pub fn restart_if_failed(&mut self) {
        if self.phase == Phase::Failed {
            self.restart();
        }
    }

    /// Does what is due. Returns a fault, or a warning.
    pub fn tick(
        &mut self,
        now_us: u64,
        axis: Axis,
        setup: &DriverSetup,
        motion: DriverMotion,
        hardware: &mut impl Hardware,
    ) -> Option<FaultCode> {
        if self.phase == Phase::Failed || now_us < self.next_us {
            return None;
        }
        if self.is_asked {
            let op = self.op(setup)?;
            let value = match hardware.driver_answer(axis, setup.bus) {
                DriverAnswer::Waiting => return None,
                DriverAnswer::Silent => None,
                DriverAnswer::Bytes(bytes) if is_dead(setup.bus, op, &bytes) => None,
                DriverAnswer::Bytes(bytes) => setup.value(say(op), &bytes).ok(),
            };
            self.is_asked = false;
            let news = match value {
                Some(value) => {
                    self.tries = 0;
                    self.at += 1;
                    self.take(now_us, op, value, setup, motion)
                }
                None => {
                    self.tries += 1;
                    (self.tries >= TRIES).then(|| self.fail(FaultCode::DRIVER_SILENT))
                }
            };
            if news.is_some() {
                return news;
            }
        }
        match self.op(setup) {
            None => self.end_round(now_us, motion),
            Some(op) => {
                let (request, wanted) = setup.request(say(op));
                // Another axis may have the wire.
                self.is_asked = hardware.ask_driver(axis, setup.bus, request, wanted);
            }
        }
        None
    }

    /// What is due, or under way; `None` at the end of a setup or a look.
    fn op(&self, setup: &DriverSetup) -> Option<Op> {
        match self.phase {
            Phase::Set => look_op(setup, self.at),
            _ => setup_op(setup, self.at),
        }
    }

    /// The setup is over, or the look.
    fn end_round(&mut self, now_us: u64, motion: DriverMotion) {
        self.phase = Phase::Set;
        self.at = 0;
        self.rounds = 0;
        self.next_us = now_us
            + if motion.is_moving {
                TURNING_US
            } else {
                REST_US
            };
    }

    /// A move begins: the next look is due as soon as it is worth something.
    pub fn look_soon(&mut self, now_us: u64) {
        if self.at == 0 {
            self.next_us = self.next_us.min(now_us + TURNING_US);
        }
    }

    fn take(
        &mut self,
        now_us: u64,
        op: Op,
        value: u32,
        setup: &DriverSetup,
        motion: DriverMotion,
    ) -> Option<FaultCode> {
        match op {
            Op::Version(_) if value >> 24 != version(setup.bus) => {
                Some(self.fail(FaultCode::DRIVER_NOT_SET))
            }
            Op::CountBefore => {
                self.count = value as u8;
                None
            }
            Op::CountAfter if value as u8 != self.count.wrapping_add(WRITES_2209 as u8) => {
                self.once_more(FaultCode::DRIVER_NOT_SET)
            }
            Op::Holds(_, expected) if value != expected => match self.phase {
                Phase::Set => Some(self.fail(FaultCode::DRIVER_RESET)),
                _ => self.once_more(FaultCode::DRIVER_NOT_SET),
            },
            Op::Events if value & GSTAT_UNDERVOLTAGE != 0 => {
                Some(self.fail(FaultCode::DRIVER_UNDERVOLTAGE))
            }
            Op::Events if value & GSTAT_RESET != 0 && self.phase == Phase::Set => {
                Some(self.fail(FaultCode::DRIVER_RESET))
            }
            // It was cleared two steps ago, and is set again: its supply comes and goes.
            Op::Events if value & GSTAT_RESET != 0 => self.once_more(FaultCode::DRIVER_RESET),
            Op::Events => {
                self.has_failed = value & GSTAT_DRIVER_ERROR != 0;
                None
            }
            Op::Condition => self.judge(now_us, value, setup, motion),
            _ => None,
        }
    }

    /// The settings are written again, unless they were already.
    fn once_more(&mut self, code: FaultCode) -> Option<FaultCode> {
        self.rounds += 1;
        self.at = 0;
        (self.rounds >= ROUNDS).then(|| self.fail(code))
    }

    fn judge(
        &mut self,
        now_us: u64,
        status: u32,
        setup: &DriverSetup,
        motion: DriverMotion,
    ) -> Option<FaultCode> {
        let is = condition(setup.bus, status);
        let is_slow = self.is_slow(now_us, setup, motion);
        self.open_looks = if is.is_open && is_slow {
            self.open_looks.saturating_add(1)
        } else {
            0
        };
        if is.is_shorted {
            return Some(self.fail(FaultCode::DRIVER_SHORT));
        }
        // Too hot, or both are over by now: it is cool again, or the short has gone with its current.
        if is.is_too_hot || self.has_failed {
            return Some(self.fail(FaultCode::DRIVER_TOO_HOT));
        }
        if self.open_looks >= OPEN_LOOKS {
            return Some(self.fail(FaultCode::MOTOR_OPEN));
        }
        let was_warm = core::mem::replace(&mut self.is_warm, is.is_warm);
        (is.is_warm && !was_warm).then_some(FaultCode::DRIVER_WARM)
    }

    /// Whether the axis has moved slowly since the last look.
    fn is_slow(&mut self, now_us: u64, setup: &DriverSetup, motion: DriverMotion) -> bool {
        let now = motion.is_moving.then_some((now_us, motion.steps));
        let last = core::mem::replace(&mut self.last_look, now);
        let (Some((last_us, last_steps)), true) = (last, motion.is_moving) else {
            return false;
        };
        let micro = motion.steps.abs_diff(last_steps) * 1_000_000;
        let per_s = micro / u64::from(setup.microsteps.max(1)) / (now_us - last_us).max(1);
        SLOW_FULL_STEPS_S.contains(&per_s)
    }

    fn fail(&mut self, code: FaultCode) -> FaultCode {
        self.phase = Phase::Failed;
        code
    }
}

/// Whether nobody has answered, though as many bytes came as were awaited: a TMC5160's data line that is low reads
/// zeros, which are an answer of most registers, but not of these, whatever was written to them and after a reset.
fn is_dead(bus: DriverBus, op: Op, answer: &[u8]) -> bool {
    let is_never_zero = matches!(op, Op::Version(_) | Op::Holds(CHOPCONF, _));
    bus == DriverBus::Spi && is_never_zero && answer.iter().all(|&byte| byte == 0)
}

fn say(op: Op) -> Say {
    match op {
        Op::Version(register) | Op::Holds(register, _) => Say::Read(register),
        Op::CountBefore | Op::CountAfter => Say::Read(IFCNT),
        Op::Write(register, value) => Say::Write(register, value),
        Op::Events => Say::Read(GSTAT),
        Op::Condition => Say::Read(DRV_STATUS),
    }
}
