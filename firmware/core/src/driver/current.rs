//! From mA to the chips' scales.
//!
//! TMC2209 (data sheet, chapter 9): I = (CS + 1)/32 · V/(R + 20 mΩ) · 1/√2 with V = 325 mV, or 180 mV where `vsense`
//! is set. TMC5160 (chapter 9): I = G/256 · (CS + 1)/32 · 325 mV/R · 1/√2. Scales are rounded down: never more
//! current than was asked for, but for the thousandth that whole mA leave of the full scale.

use super::{DriverBus, DriverSetup};

/// √2 · 10⁶.
const ROOT_2_PPM: u64 = 1_414_214;
/// Full scale, µV.
const FULL_UV: u64 = 325_000;
/// Full scale of the TMC2209's finer range, µV.
const FINE_UV: u64 = 180_000;
/// The TMC2209's own part of the sense resistors, mΩ.
const INSIDE_MOHM: u64 = 20;
/// The TMC5160's least global scale that it regulates well with.
const LEAST_GLOBAL: u64 = 128;

/// Currents as the chips' registers have them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Currents {
    /// IRUN, 0 to 31.
    pub run: u32,
    /// IHOLD, 0 to 31.
    pub hold: u32,
    /// TMC2209: the finer range.
    pub is_fine: bool,
    /// TMC5160: GLOBALSCALER, 0 for 256.
    pub global: u32,
}

/// A thousandth more.
fn with_slack(uv: u64) -> u64 {
    uv * 1001 / 1000
}

/// The scales for a driver's currents; `None` where its resistors cannot give them: too much, or less than its
/// smallest scale.
pub fn currents(setup: &DriverSetup) -> Option<Currents> {
    let resistor_mohm = u64::from(setup.sense_mohm)
        + match setup.bus {
            DriverBus::OneWire => INSIDE_MOHM,
            DriverBus::Spi => 0,
        };
    // Peak voltage at the resistor, µV.
    let peak_uv = |ma: u32| u64::from(ma) * resistor_mohm * ROOT_2_PPM / 1_000_000;
    let (run_uv, hold_uv) = (peak_uv(setup.run_ma), peak_uv(setup.hold_ma));
    let (full_uv, global) = match setup.bus {
        DriverBus::OneWire if run_uv <= FINE_UV => (FINE_UV, 256),
        DriverBus::OneWire => (FULL_UV, 256),
        DriverBus::Spi => {
            let global = (256 * run_uv).div_ceil(FULL_UV).clamp(LEAST_GLOBAL, 256);
            (FULL_UV, global)
        }
    };
    // 32 · peak / (full · global/256), less one.
    let scale = |uv: u64| {
        let parts = 32 * 256 * with_slack(uv) / (full_uv * global);
        let parts = u32::try_from(parts.min(32)).unwrap_or(0);
        parts.checked_sub(1)
    };
    if run_uv.max(hold_uv) > with_slack(full_uv) {
        return None;
    }
    Some(Currents {
        run: scale(run_uv)?,
        hold: scale(hold_uv)?,
        is_fine: full_uv == FINE_UV,
        global: if global == 256 { 0 } else { global as u32 },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn setup(bus: DriverBus, run_ma: u32, hold_ma: u32, sense_mohm: u32) -> DriverSetup {
        DriverSetup {
            bus,
            address: 0,
            run_ma,
            hold_ma,
            microsteps: 8,
            sense_mohm,
        }
    }

    /// The data sheets' formula.
    fn ma(bus: DriverBus, scales: Currents, scale: u32, sense_mohm: u32) -> f64 {
        let (full_mv, inside, global) = match bus {
            DriverBus::OneWire if scales.is_fine => (180.0, 20.0, 256),
            DriverBus::OneWire => (325.0, 20.0, 256),
            DriverBus::Spi if scales.global == 0 => (325.0, 0.0, 256),
            DriverBus::Spi => (325.0, 0.0, scales.global),
        };
        let full_ma =
            1000.0 * full_mv / (f64::from(sense_mohm) + inside) / core::f64::consts::SQRT_2;
        full_ma * f64::from(global) / 256.0 * f64::from(scale + 1) / 32.0
    }

    #[test]
    fn currents_are_what_was_asked_for_less_a_scale_at_most() {
        for (bus, sense, most) in [
            (DriverBus::OneWire, 110, 1767),
            (DriverBus::OneWire, 75, 2419),
            (DriverBus::Spi, 75, 3063),
            (DriverBus::Spi, 22, 10_000),
        ] {
            for run in (700..=most).step_by(7) {
                let scales = currents(&setup(bus, run, run / 2, sense)).unwrap();
                let (is, half) = (
                    ma(bus, scales, scales.run, sense),
                    ma(bus, scales, scales.hold, sense),
                );
                let asked = f64::from(run);
                let step = ma(bus, scales, 0, sense);
                assert!(
                    is <= 1.001 * asked && is > asked - 1.1 * step,
                    "{bus:?} {sense} {run}: {is}"
                );
                let asked = f64::from(run / 2);
                assert!(
                    half <= 1.001 * asked && half > asked - 1.1 * step,
                    "{run}: {half}"
                );
            }
        }
    }

    #[test]
    fn the_data_sheets_own_example_comes_out() {
        // TMC2209, chapter 9, table of R_sense 110 mΩ: 1.77 A RMS at full scale.
        let full = currents(&setup(DriverBus::OneWire, 1767, 1767, 110)).unwrap();
        assert_eq!((full.run, full.is_fine), (31, false));
        assert_eq!(currents(&setup(DriverBus::OneWire, 1770, 100, 110)), None);
        // TMC5160, R_sense 75 mΩ: 3.1 A RMS.
        let full = currents(&setup(DriverBus::Spi, 3063, 1000, 75)).unwrap();
        assert_eq!((full.run, full.global), (31, 0));
        assert_eq!(currents(&setup(DriverBus::Spi, 3070, 100, 75)), None);
    }

    #[test]
    fn less_than_the_smallest_scale_is_refused() {
        assert_eq!(currents(&setup(DriverBus::OneWire, 800, 25, 110)), None);
        assert!(currents(&setup(DriverBus::OneWire, 800, 31, 110)).is_some());
    }
}
