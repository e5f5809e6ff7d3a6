//! Registers of both chips, as far as they are used: TMC2209 data sheet (rev. 1.09), chapter 5; TMC5160 data sheet
//! (rev. 1.17), chapter 6.

use super::current::currents;
use super::{DriverBus, DriverSetup};

/// Global configuration.
pub const GCONF: u8 = 0x00;
/// What has happened since it was last cleared, by writing ones.
pub const GSTAT: u8 = 0x01;
/// TMC2209: how many writes have arrived; it wraps at 256.
pub const IFCNT: u8 = 0x02;
/// TMC2209: how long an answer waits.
pub const SLAVECONF: u8 = 0x03;
/// TMC2209: pins and version.
pub const IOIN_2209: u8 = 0x06;
/// TMC5160: pins and version.
pub const IOIN_5160: u8 = 0x04;
/// TMC5160: full scale of the current.
pub const GLOBAL_SCALER: u8 = 0x0B;
/// Currents at rest and under way.
pub const IHOLD_IRUN: u8 = 0x10;
/// From rest to the lower current.
pub const TPOWERDOWN: u8 = 0x11;
/// The chopper, and the microsteps.
pub const CHOPCONF: u8 = 0x6C;
/// The driver's state.
pub const DRV_STATUS: u8 = 0x6F;

/// GSTAT: it has been reset, and holds its defaults.
pub const GSTAT_RESET: u32 = 1 << 0;
/// GSTAT: it has switched its outputs off.
pub const GSTAT_DRIVER_ERROR: u32 = 1 << 1;
/// GSTAT: its charge pump has too little voltage.
pub const GSTAT_UNDERVOLTAGE: u32 = 1 << 2;
/// All of GSTAT: written, it clears them.
pub const GSTAT_ALL: u32 = 7;

/// The version in IOIN's highest byte.
pub fn version(bus: DriverBus) -> u32 {
    match bus {
        DriverBus::OneWire => 0x21,
        DriverBus::Spi => 0x30,
    }
}

/// GCONF. TMC2209: current by the internal reference and not by the module's potentiometer, SpreadCycle, the pin
/// PDN is the UART's, microsteps by register, and the step input filtered. TMC5160: nothing beyond its defaults
/// but the filter.
pub fn gconf(bus: DriverBus) -> u32 {
    match bus {
        DriverBus::OneWire => 1 << 2 | 1 << 6 | 1 << 7 | 1 << 8,
        DriverBus::Spi => 1 << 3,
    }
}

/// An answer of a TMC2209 begins 3 · 8 bits after the request: the least that is allowed where several share a
/// wire.
pub const ANSWER_DELAY: u32 = 2 << 8;
/// The current goes down 0.4 s after the last step (units of 2^18 clocks of 12 MHz).
pub const POWER_DOWN: u32 = 20;
/// And so slowly (units of 2^18 clocks a step of the current): 0.17 s from full to none.
const HOLD_DELAY: u32 = 8;

/// IHOLD_IRUN.
pub fn ihold_irun(setup: &DriverSetup) -> u32 {
    let scales = currents(setup).unwrap_or_default();
    scales.hold | scales.run << 8 | HOLD_DELAY << 16
}

/// CHOPCONF: the data sheets' starting point for SpreadCycle (off time 3, blank time 36 clocks, hysteresis 5 and
/// −2), interpolation on, and the microsteps.
pub fn chopconf(setup: &DriverSetup) -> u32 {
    const OFF_TIME: u32 = 3;
    const HYSTERESIS: u32 = 4 << 4 | 1 << 7;
    const BLANK_TIME: u32 = 2 << 15;
    const INTERPOLATE: u32 = 1 << 28;
    let resolution = 8 - setup.microsteps.clamp(1, 256).ilog2();
    let is_fine = match setup.bus {
        DriverBus::OneWire => currents(setup).unwrap_or_default().is_fine,
        DriverBus::Spi => false,
    };
    OFF_TIME | HYSTERESIS | BLANK_TIME | u32::from(is_fine) << 17 | resolution << 24 | INTERPOLATE
}

/// What a driver says of itself and its motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Condition {
    /// Above 120 °C.
    pub is_warm: bool,
    /// So hot that it has switched off.
    pub is_too_hot: bool,
    /// A coil has a short, to ground or to the supply.
    pub is_shorted: bool,
    /// A coil draws no current. It means something in slow motion only.
    pub is_open: bool,
}

/// Bits of DRV_STATUS.
struct ConditionBits {
    warm: u32,
    too_hot: u32,
    shorted: u32,
    open: u32,
}

fn bits(bus: DriverBus) -> ConditionBits {
    match bus {
        DriverBus::OneWire => ConditionBits {
            warm: 1 << 0,
            too_hot: 1 << 1,
            shorted: 0xF << 2,
            open: 3 << 6,
        },
        DriverBus::Spi => ConditionBits {
            warm: 1 << 26,
            too_hot: 1 << 25,
            shorted: 3 << 27 | 3 << 12,
            open: 3 << 29,
        },
    }
}

/// Reads DRV_STATUS.
pub fn condition(bus: DriverBus, status: u32) -> Condition {
    let bits = bits(bus);
    Condition {
        is_warm: status & bits.warm != 0,
        is_too_hot: status & bits.too_hot != 0,
        is_shorted: status & bits.shorted != 0,
        is_open: status & bits.open != 0,
    }
}

/// The DRV_STATUS of a driver in this condition: for chips that are simulated.
pub fn drv_status(bus: DriverBus, condition: Condition) -> u32 {
    let bits = bits(bus);
    let set = |is_set: bool, mask: u32| if is_set { mask } else { 0 };
    set(condition.is_warm, bits.warm)
        | set(condition.is_too_hot, bits.too_hot)
        | set(condition.is_shorted, bits.shorted)
        | set(condition.is_open, bits.open)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETUP: DriverSetup = DriverSetup {
        bus: DriverBus::OneWire,
        address: 0,
        run_ma: 800,
        hold_ma: 400,
        microsteps: 8,
        sense_mohm: 110,
    };

    #[test]
    fn the_words_are_those_of_the_data_sheets_tables() {
        // TMC2209 5.1: I_scale_analog off, en_SpreadCycle, pdn_disable, mstep_reg_select, multistep_filt.
        assert_eq!(gconf(DriverBus::OneWire), 0b1_1100_0100);
        // TMC5160's example of its chapter "Quick configuration guide": 0x000100C3, here with 8 microsteps (MRES 5)
        // and interpolation.
        let spi = DriverSetup {
            bus: DriverBus::Spi,
            ..SETUP
        };
        assert_eq!(chopconf(&spi), 0x0001_00C3 | 0x1500_0000);
        // 800 mA with 110 mΩ need the finer range of the TMC2209: vsense, bit 17.
        assert_eq!(chopconf(&SETUP), 0x0003_00C3 | 0x1500_0000);
        for (microsteps, resolution) in [(256, 0), (16, 4), (1, 8)] {
            let word = chopconf(&DriverSetup { microsteps, ..spi });
            assert_eq!(word >> 24 & 0xF, resolution, "{microsteps}");
        }
    }

    #[test]
    fn every_bit_of_a_drivers_state_is_told_from_the_others() {
        for bus in [DriverBus::OneWire, DriverBus::Spi] {
            for i in 0..16 {
                let all = Condition {
                    is_warm: i & 1 != 0,
                    is_too_hot: i & 2 != 0,
                    is_shorted: i & 4 != 0,
                    is_open: i & 8 != 0,
                };
                assert_eq!(condition(bus, drv_status(bus, all)), all);
            }
        }
        // Single bits by the data sheets: TMC2209 s2vsb, ola; TMC5160 s2ga, s2vsb, otpw, olb.
        assert!(condition(DriverBus::OneWire, 1 << 5).is_shorted);
        assert!(condition(DriverBus::OneWire, 1 << 6).is_open);
        assert!(condition(DriverBus::Spi, 1 << 27).is_shorted);
        assert!(condition(DriverBus::Spi, 1 << 13).is_shorted);
        assert!(condition(DriverBus::Spi, 1 << 26).is_warm);
        assert!(condition(DriverBus::Spi, 1 << 30).is_open);
        // Standstill and StealthChop say nothing.
        assert_eq!(condition(DriverBus::OneWire, 3 << 30), Condition::default());
        assert_eq!(
            condition(DriverBus::Spi, 1 << 31 | 1 << 14),
            Condition::default()
        );
    }
}
