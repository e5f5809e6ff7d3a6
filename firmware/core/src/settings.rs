//! Values of the settings, and their form in flash.
//!
//! In flash: format version, number of keys, two `i32` a key (little endian), CRC-32C of all that.
//! Keys that a stored block does not have yet get their defaults, so that newer firmware reads what
//! older firmware wrote.

use gonia_protocol::crc32c;
use gonia_protocol::settings::{Axis, Key, MEANINGS, N_SETTINGS};

use crate::driver::{DriverBus, DriverSetup, currents};
use crate::hardware::{EncoderKind, EncoderSetup};
use crate::quadrature::MOST_COUNTS_S;

const FORMAT: u8 = 1;
const HEAD: usize = 2;

/// Length of the stored form.
pub const STORED_LEN: usize = HEAD + N_SETTINGS * 8 + 4;

/// The settings of both axes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ControllerSettings {
    values: [[i32; 2]; N_SETTINGS],
}

/// Steps a second that the step timers' interrupts and the queue in front of them keep up with, on both axes.
pub const MOST_STEPS_S: u64 = 50_000;

/// Why settings cannot be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadValue {
    /// A value out of range, or one that contradicts another or what the step timers can do.
    Value,
    /// A quadrature ring would give so many counts a second: more than [`MOST_COUNTS_S`].
    CountRate(u32),
}

/// Stored bytes that are no settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Damaged;

impl Default for ControllerSettings {
    fn default() -> Self {
        Self {
            values: MEANINGS.map(|meaning| meaning.default),
        }
    }
}

impl ControllerSettings {
    /// A value, in the key's unit.
    pub fn get(&self, axis: Axis, key: Key) -> i32 {
        self.values[key as usize][axis.index()]
    }

    /// A value that is never negative, in the key's unit.
    pub fn get_u64(&self, axis: Axis, key: Key) -> u64 {
        self.get(axis, key).max(0) as u64
    }

    /// How the encoder of an axis is read.
    pub fn encoder(&self, axis: Axis) -> EncoderSetup {
        EncoderSetup {
            kind: match self.get(axis, Key::EncoderKind) {
                0 => EncoderKind::Ssi,
                1 => EncoderKind::BissC,
                _ => EncoderKind::Quadrature,
            },
            turn: self.get_u64(axis, Key::EncoderCountsPerTurn) as u32,
        }
    }

    /// Counts a second of a quadrature ring at the highest speed; 0 of another kind, whose counts nobody has to keep up
    /// with.
    fn counts_s(&self, axis: Axis) -> u32 {
        let EncoderSetup { kind, turn } = self.encoder(axis);
        match kind {
            EncoderKind::Ssi | EncoderKind::BissC => 0,
            EncoderKind::Quadrature => {
                let counts_s =
                    (u64::from(turn) * self.get_u64(axis, Key::MaxSpeed)).div_ceil(360_000_000);
                u32::try_from(counts_s).unwrap_or(u32::MAX)
            }
        }
    }

    /// How the driver of an axis is set by wire; `None` where it is set by hand.
    pub fn driver(&self, axis: Axis) -> Option<DriverSetup> {
        let get = |key| self.get_u64(axis, key) as u32;
        let bus = match get(Key::DriverKind) {
            1 => DriverBus::OneWire,
            2 => DriverBus::Spi,
            _ => return None,
        };
        Some(DriverSetup {
            bus,
            address: get(Key::DriverAddress) as u8,
            run_ma: get(Key::RunCurrent),
            hold_ma: get(Key::HoldCurrent),
            microsteps: get(Key::Microsteps),
            sense_mohm: get(Key::SenseResistor),
        })
    }

    /// Changes a value, or nothing. A setting of the node changes for both axes.
    pub fn set(&mut self, axis: Axis, key: Key, value: i32) -> Result<(), BadValue> {
        let mut changed = self.clone();
        if key.is_of_the_node() {
            changed.values[key as usize] = [value; 2];
        } else {
            changed.values[key as usize][axis.index()] = value;
        }
        changed.check()?;
        *self = changed;
        Ok(())
    }

    /// Checksum, for comparing a controller with the record of a session.
    pub fn crc(&self) -> u32 {
        let bytes = self.to_bytes();
        crc32c(&bytes[..STORED_LEN - 4])
    }

    /// The stored form.
    pub fn to_bytes(&self) -> [u8; STORED_LEN] {
        let mut bytes = [0; STORED_LEN];
        bytes[0] = FORMAT;
        bytes[1] = N_SETTINGS as u8;
        for (chunk, value) in bytes[HEAD..]
            .chunks_exact_mut(4)
            .zip(self.values.as_flattened())
        {
            chunk.copy_from_slice(&value.to_le_bytes());
        }
        let crc = crc32c(&bytes[..STORED_LEN - 4]);
        bytes[STORED_LEN - 4..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// Reads the stored form, also a shorter one of older firmware.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Damaged> {
        let &[FORMAT, n_keys, ..] = bytes else {
            return Err(Damaged);
        };
        let end = HEAD + n_keys as usize * 8;
        let (block, crc) = bytes.split_at_checked(end).ok_or(Damaged)?;
        if n_keys as usize > N_SETTINGS || crc.get(..4) != Some(&crc32c(block).to_le_bytes()[..]) {
            return Err(Damaged);
        }
        let mut settings = Self::default();
        let values = settings.values.as_flattened_mut().iter_mut();
        for (value, chunk) in values.zip(block[HEAD..].as_chunks::<4>().0) {
            *value = i32::from_le_bytes(*chunk);
        }
        settings.check().map_err(|_| Damaged)?;
        Ok(settings)
    }

    fn check(&self) -> Result<(), BadValue> {
        for axis in Axis::BOTH {
            let get = |key| self.get(axis, key);
            let in_range = MEANINGS
                .iter()
                .all(|m| (m.min..=m.max).contains(&get(m.key)));
            let steps_s = self.get_u64(axis, Key::StepsPerTurn) * self.get_u64(axis, Key::MaxSpeed)
                / 360_000_000;
            let consistent = steps_s <= MOST_STEPS_S
                && is_turn_of(self.encoder(axis))
                && get(Key::SoftMin) < get(Key::SoftMax)
                && get(Key::HomeAngle) <= get(Key::SoftMin)
                && get(Key::EncoderZero) < get(Key::EncoderCountsPerTurn)
                && get(Key::HomeSlowSpeed) <= get(Key::HomeFastSpeed)
                && get(Key::HomeFastSpeed) <= get(Key::MaxSpeed)
                && get(Key::InPositionWindow) <= get(Key::TriggerWindow)
                && get(Key::TriggerWindow) <= get(Key::FollowingLimit)
                && self.get_u64(axis, Key::Microsteps).is_power_of_two()
                && get(Key::HoldCurrent) <= get(Key::RunCurrent)
                && self
                    .driver(axis)
                    .is_none_or(|driver| currents(&driver).is_some());
            if !in_range || !consistent {
                return Err(BadValue::Value);
            }
            let counts_s = self.counts_s(axis);
            if counts_s > MOST_COUNTS_S {
                return Err(BadValue::CountRate(counts_s));
            }
        }
        Ok(())
    }
}

/// Whether an encoder of this kind can have so many counts a turn.
fn is_turn_of(encoder: EncoderSetup) -> bool {
    match encoder.kind {
        EncoderKind::Ssi | EncoderKind::BissC => encoder.turn.is_power_of_two(),
        // Four counts are a period of the waves.
        EncoderKind::Quadrature => encoder.turn.is_multiple_of(4),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stored_settings_come_back() {
        let mut settings = ControllerSettings::default();
        settings.set(Axis::Phi, Key::MaxSpeed, 20_000_000).unwrap();
        settings.set(Axis::Phi, Key::HostWatchdog, 500_000).unwrap();
        assert_eq!(settings.get(Axis::Theta, Key::HostWatchdog), 500_000);
        assert_eq!(
            ControllerSettings::from_bytes(&settings.to_bytes()),
            Ok(settings.clone())
        );
        assert_ne!(settings.crc(), ControllerSettings::default().crc());
    }

    #[test]
    fn any_torn_or_bent_block_is_noticed() {
        let bytes = ControllerSettings::default().to_bytes();
        for length in 0..STORED_LEN {
            assert_eq!(
                ControllerSettings::from_bytes(&bytes[..length]),
                Err(Damaged)
            );
        }
        for at in 0..STORED_LEN {
            let mut bent = bytes;
            bent[at] ^= 0x10;
            assert_eq!(
                ControllerSettings::from_bytes(&bent),
                Err(Damaged),
                "byte {at}"
            );
        }
    }

    #[test]
    fn a_block_of_older_firmware_gets_defaults_for_its_missing_keys() {
        let mut settings = ControllerSettings::default();
        settings
            .set(Axis::Theta, Key::StepsPerTurn, 288_000)
            .unwrap();
        let mut older = [0; HEAD + 8 + 4];
        older[..HEAD + 8].copy_from_slice(&settings.to_bytes()[..HEAD + 8]);
        older[1] = 1;
        let crc = crc32c(&older[..HEAD + 8]);
        older[HEAD + 8..].copy_from_slice(&crc.to_le_bytes());
        assert_eq!(ControllerSettings::from_bytes(&older), Ok(settings));
    }

    #[test]
    fn values_that_make_no_sense_change_nothing() {
        let mut settings = ControllerSettings::default();
        for (key, value) in [
            (Key::MaxSpeed, 0),
            (Key::SoftMin, 91_000_000),
            (Key::HomeAngle, 0),
            (Key::TriggerWindow, 31_000),
            (Key::InPositionWindow, i32::MIN),
            // 15°/s would be 50,001 steps/s.
            (Key::StepsPerTurn, 1_200_024),
            (Key::EncoderCountsPerTurn, (1 << 18) + 1),
            (Key::MotorReversed, 2),
        ] {
            assert_eq!(settings.set(Axis::Theta, key, value), Err(BadValue::Value));
        }
        assert_eq!(settings, ControllerSettings::default());
        // What a potentiometer sets may be anything; by wire, 2 A are more than 110 mΩ give.
        let set =
            |settings: &mut ControllerSettings, key, value| settings.set(Axis::Theta, key, value);
        set(&mut settings, Key::RunCurrent, 2_000).unwrap();
        assert_eq!(set(&mut settings, Key::DriverKind, 1), Err(BadValue::Value));
        set(&mut settings, Key::SenseResistor, 75).unwrap();
        set(&mut settings, Key::DriverKind, 1).unwrap();
        for (key, value) in [
            (Key::Microsteps, 12),
            (Key::HoldCurrent, 2_001),
            (Key::SenseResistor, 110),
        ] {
            assert_eq!(set(&mut settings, key, value), Err(BadValue::Value));
        }
        settings
            .set(Axis::Theta, Key::StepsPerTurn, 1_200_000)
            .unwrap();
    }

    #[test]
    fn a_quadrature_ring_has_whole_periods_and_no_more_counts_a_second_than_are_followed() {
        let mut settings = ControllerSettings::default();
        let set =
            |settings: &mut ControllerSettings, key, value| settings.set(Axis::Phi, key, value);
        let turn = Key::EncoderCountsPerTurn;
        // 10,000 lines: no ring that is read by words has them.
        assert_eq!(set(&mut settings, turn, 40_000), Err(BadValue::Value));
        set(&mut settings, Key::EncoderKind, 2).unwrap();
        assert_eq!(set(&mut settings, turn, 40_002), Err(BadValue::Value));
        // 15°/s of 480,000 counts are the most.
        let too_fast = Err(BadValue::CountRate(20_001));
        assert_eq!(set(&mut settings, turn, 480_004), too_fast);
        set(&mut settings, turn, 480_000).unwrap();
        let too_fast = Err(BadValue::CountRate(20_002));
        assert_eq!(set(&mut settings, Key::MaxSpeed, 15_001_000), too_fast);
        set(&mut settings, turn, 40_000).unwrap();
        set(&mut settings, Key::MaxSpeed, 25_000_000).unwrap();
        assert_eq!(
            set(&mut settings, Key::EncoderKind, 1),
            Err(BadValue::Value)
        );
        // Back to SSI there is no such limit.
        set(&mut settings, turn, 1 << 18).unwrap();
        set(&mut settings, Key::EncoderKind, 0).unwrap();
        set(&mut settings, turn, 1 << 26).unwrap();
    }
}
