//! Drivers that are set by wire: what arrives in them, and what they report.

use gonia_firmware::controller::ArmController;
use gonia_firmware::driver::DriverBus;
use gonia_firmware::driver::registers::{CHOPCONF, GCONF, GLOBAL_SCALER, IHOLD_IRUN};
use gonia_protocol::fault::FaultCode;
use gonia_protocol::message::{ControllerState, Message, RequestOutcome};
use gonia_protocol::settings::{Axis, Key};

use super::TestBench;
use crate::driver_chip::{DriverChip, DriverTrouble};

/// Longer than a setup and three tries of every step of it.
const SETUP_US: u64 = 3_000_000;

/// An arm whose drivers are set by this wire, and so are its settings.
fn with_drivers(bus: DriverBus) -> TestBench {
    let mut bench = TestBench::near_home();
    bench.arm.fit_drivers(bus);
    let kind = match bus {
        DriverBus::OneWire => 1,
        DriverBus::Spi => 2,
    };
    for axis in Axis::BOTH {
        bench.set(axis, Key::DriverKind, kind);
    }
    bench
}

fn chip(bench: &mut TestBench, axis: Axis) -> &mut DriverChip {
    bench.arm.driver(axis).unwrap()
}

const BUSES: [DriverBus; 2] = [DriverBus::OneWire, DriverBus::Spi];

#[test]
fn settings_arrive_in_both_chips_before_the_arm_homes() {
    for bus in BUSES {
        let mut bench = with_drivers(bus);
        bench.set(Axis::Phi, Key::RunCurrent, 1_000);
        bench.set(Axis::Phi, Key::Microsteps, 16);
        assert_eq!(bench.home(), RequestOutcome::Done, "{bus:?}");
        let theta = chip(&mut bench, Axis::Theta);
        let config = match bus {
            DriverBus::OneWire => 0x1C4,
            DriverBus::Spi => 0x8,
        };
        assert_eq!(theta.written(GCONF), config);
        assert_eq!(theta.written(CHOPCONF) >> 24, 0x15);
        // 800 and 400 mA at 110 mΩ, peak: of 180 mV at 130 mΩ 26.1 and 13.1 parts in 32, of 325 mV · 128/256 24.5 and
        // 12.3.
        let scales = match bus {
            DriverBus::OneWire => 12 | 25 << 8,
            DriverBus::Spi => 11 | 23 << 8,
        };
        assert_eq!(theta.written(IHOLD_IRUN) & 0x1F1F, scales);
        let phi = chip(&mut bench, Axis::Phi);
        assert_eq!(phi.written(CHOPCONF) >> 24, 0x14);
        if bus == DriverBus::Spi {
            // 1 A · √2 · 110 mΩ of 325 mV: 122.5/256, and 128 is the least.
            assert_eq!(phi.written(GLOBAL_SCALER), 128);
        }
    }
}

#[test]
fn no_driver_gets_its_current_before_it_knows_how_much() {
    let mut bench = TestBench::near_home();
    bench.run_us(100_000);
    assert_eq!(
        bench.arm.brakes_and_drivers(),
        (true, true),
        "by hand, at once"
    );

    // The same with settings that were saved, after a reset.
    let mut bench = with_drivers(DriverBus::OneWire);
    let saved = bench.controller.settings().to_bytes();
    bench.arm.reset_outputs();
    bench.arm.fit_drivers(DriverBus::OneWire);
    bench.controller = ArmController::new(bench.now_us, Some(&saved));
    while !bench.arm.brakes_and_drivers().1 {
        let written = chip(&mut bench, Axis::Phi).written(CHOPCONF);
        bench.tick();
        assert!(bench.now_us < SETUP_US, "never; {written:#x}");
    }
    for axis in Axis::BOTH {
        assert_eq!(chip(&mut bench, axis).written(CHOPCONF), 0x1503_00C3);
    }
}

/// What is latched after this has struck an arm at rest, homed, whose drivers are set.
fn at_rest(bus: DriverBus, strike: fn(&mut DriverChip)) -> TestBench {
    let mut bench = with_drivers(bus);
    assert_eq!(bench.home(), RequestOutcome::Done);
    strike(chip(&mut bench, Axis::Phi));
    bench.run_us(SETUP_US);
    bench
}

#[test]
fn a_data_line_that_is_low_is_a_driver_that_does_not_answer() {
    let silent = FaultCode::DRIVER_SILENT;
    // From the start, and once its settings are there.
    let mut bench = with_drivers(DriverBus::Spi);
    chip(&mut bench, Axis::Phi).trouble = DriverTrouble::DataLow;
    bench.run_us(SETUP_US);
    assert_eq!(bench.state(), ControllerState::Fault(silent));
    let bench = at_rest(DriverBus::Spi, |chip| {
        chip.trouble = DriverTrouble::DataLow;
    });
    assert_eq!(bench.state(), ControllerState::Fault(silent));
}

#[test]
fn every_trouble_of_a_driver_is_a_fault_of_its_own() {
    type Spoils = fn(&mut DriverChip);
    let rows: [(Spoils, FaultCode); 5] = [
        (
            |chip| chip.trouble = DriverTrouble::Silent,
            FaultCode::DRIVER_SILENT,
        ),
        (DriverChip::reset, FaultCode::DRIVER_RESET),
        (
            |chip| chip.condition.is_too_hot = true,
            FaultCode::DRIVER_TOO_HOT,
        ),
        (
            |chip| chip.condition.is_shorted = true,
            FaultCode::DRIVER_SHORT,
        ),
        (
            |chip| chip.undervoltage = true,
            FaultCode::DRIVER_UNDERVOLTAGE,
        ),
    ];
    for bus in BUSES {
        for (strike, code) in rows {
            let mut bench = at_rest(bus, strike);
            assert_eq!(bench.state(), ControllerState::Fault(code), "{bus:?}");
            assert!(!bench.arm.brakes_and_drivers().1, "{code}: no current");
            assert!(!bench.controller.status(0).homed, "{code}");
            // Mended and cleared: the settings are written again, and the arm homes.
            let phi = chip(&mut bench, Axis::Phi);
            *phi = DriverChip::new(bus, 0);
            bench.ask(&Message::ClearFault).unwrap();
            assert_eq!(bench.home(), RequestOutcome::Done, "{code}");
        }
    }
}

#[test]
fn answers_that_are_bent_and_writes_that_do_not_arrive_are_faults() {
    for bus in BUSES {
        let mut bench = with_drivers(bus);
        chip(&mut bench, Axis::Theta).trouble = DriverTrouble::Deaf;
        bench.run_us(SETUP_US);
        let expected = ControllerState::Fault(FaultCode::DRIVER_NOT_SET);
        assert_eq!(bench.state(), expected, "{bus:?}");
    }
    // A TMC5160 has no checksum: what it holds is not what was written.
    for (bus, code) in BUSES
        .into_iter()
        .zip([FaultCode::DRIVER_SILENT, FaultCode::DRIVER_NOT_SET])
    {
        let mut bench = with_drivers(bus);
        chip(&mut bench, Axis::Theta).trouble = DriverTrouble::Bent;
        bench.run_us(SETUP_US);
        assert_eq!(bench.state(), ControllerState::Fault(code), "{bus:?}");
    }
}

#[test]
fn another_chip_than_the_settings_name_is_a_fault() {
    for bus in BUSES {
        let mut bench = with_drivers(bus);
        let other = BUSES[usize::from(bus == DriverBus::OneWire)];
        *chip(&mut bench, Axis::Theta) = DriverChip::new(other, 0);
        bench.run_us(SETUP_US);
        let expected = ControllerState::Fault(FaultCode::DRIVER_SILENT);
        assert_eq!(bench.state(), expected, "{bus:?}");
    }
}

#[test]
fn a_warm_driver_is_a_warning_and_the_arm_goes_on() {
    let mut bench = at_rest(DriverBus::OneWire, |chip| chip.condition.is_warm = true);
    assert_eq!(bench.state(), ControllerState::Idle);
    let Ok(Message::LogIs(entry)) = bench.ask(&Message::ReadLog(0)) else {
        panic!("no log");
    };
    let warm = Some(FaultCode::DRIVER_WARM);
    assert_eq!((entry.fault, entry.axis), (warm, Some(Axis::Phi)));
    let Ok(Message::LogIs(entry)) = bench.ask(&Message::ReadLog(1)) else {
        panic!("no log");
    };
    assert_eq!(entry.fault, None, "once");
}

#[test]
fn an_open_coil_counts_in_slow_motion_only() {
    for bus in BUSES {
        // At rest the flag means nothing.
        let mut bench = at_rest(bus, |chip| chip.condition.is_open = true);
        assert_eq!(bench.state(), ControllerState::Idle, "{bus:?}");
        // Nor at 15°/s, 750 full steps a second.
        let target_udeg = [60_000_000, -100_000_000];
        let to = gonia_protocol::message::Move { target_udeg };
        bench.ask(&Message::Move(to)).unwrap();
        bench.run_us(3_000_000);
        assert_eq!(bench.state(), ControllerState::Moving, "{bus:?}");
        assert_eq!(bench.outcome(), RequestOutcome::Done, "{bus:?}");
        // Homing's slow approach, 25 full steps a second.
        bench.ask(&Message::Home).unwrap();
        let expected = RequestOutcome::Failed(FaultCode::MOTOR_OPEN);
        assert_eq!(bench.outcome(), expected, "{bus:?}");
    }
}

#[test]
fn a_driver_that_loses_its_supply_in_mid_move_stops_the_arm() {
    let mut bench = with_drivers(DriverBus::OneWire);
    bench.ask(&Message::Home).unwrap();
    bench.run_us(1_500_000);
    assert_eq!(bench.state(), ControllerState::Homing);
    chip(&mut bench, Axis::Phi).reset();
    let expected = FaultCode::DRIVER_RESET;
    assert_eq!(bench.outcome(), RequestOutcome::Failed(expected));
}

#[test]
fn after_an_emergency_stop_that_took_their_supply_the_drivers_are_set_again() {
    let mut bench = with_drivers(DriverBus::OneWire);
    assert_eq!(bench.home(), RequestOutcome::Done);
    bench.ask(&Message::EStop).unwrap();
    for axis in Axis::BOTH {
        chip(&mut bench, axis).trouble = DriverTrouble::Silent;
    }
    bench.run_us(10_000_000);
    assert_eq!(bench.state(), ControllerState::EStop);
    for axis in Axis::BOTH {
        *chip(&mut bench, axis) = DriverChip::new(DriverBus::OneWire, 0);
    }
    bench.ask(&Message::ClearFault).unwrap();
    while !bench.arm.brakes_and_drivers().0 {
        bench.tick();
        assert!(bench.now_us < 60_000_000, "the brakes are never let go");
    }
    for axis in Axis::BOTH {
        assert_eq!(chip(&mut bench, axis).written(CHOPCONF), 0x1503_00C3);
    }
    assert_eq!(bench.home(), RequestOutcome::Done);
}
