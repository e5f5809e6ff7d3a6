//! The keys of a controller's settings: number, unit, range and default.
//!
//! The defaults describe this axis: a 1.8° stepper at 8 microsteps on a 90:1 worm (1600 · 90 =
//! 144,000 steps a turn, 0.0025° a step) with an 18-bit absolute ring encoder on the output shaft
//! (0.00137° a count). 15°/s is 225 rpm of the motor, and 90°/s² on an arm of 10 kg·m² needs 15.7 N·m
//! at the shaft, 0.35 N·m at the motor through a worm of 50 % efficiency: a third of what a common
//! 1.2 N·m NEMA 23 motor holds, so that the arm and not the motor limits the ramp. Acceleration and jerk
//! time are those with the shortest settled moves over arms that swing at 6 Hz to 16 Hz (`gonia chart
//! --motion`).

use serde::{Deserialize, Serialize};

/// Number of keys.
pub const N_SETTINGS: usize = 43;

/// One of the two axes of an arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Axis {
    /// Polar angle, from the sample's normal.
    Theta,
    /// Azimuth, anticlockwise from the sample's x axis.
    Phi,
}

impl Axis {
    /// Both, in the order of every pair on the wire.
    pub const BOTH: [Axis; 2] = [Axis::Theta, Axis::Phi];

    /// Its place in every pair on the wire.
    pub fn index(self) -> usize {
        self as usize
    }
}

/// A key. Its number is on the wire and in flash and never changes its meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Key {
    /// Motor steps a turn of the shaft.
    StepsPerTurn = 0,
    /// Encoder counts a turn of the shaft: a power of two; of a quadrature ring, four times its lines.
    EncoderCountsPerTurn = 1,
    /// Encoder count at 0°; of a quadrature ring counted from its index.
    EncoderZero = 2,
    /// Lowest target, µdeg.
    SoftMin = 3,
    /// Highest target, µdeg.
    SoftMax = 4,
    /// Angle at which the home switch says so, coming from above, µdeg.
    HomeAngle = 5,
    /// How far switch and encoder may differ, µdeg: what a good switch repeats to. Where it is wider
    /// than the pointing limit, an encoder that has shifted is taken for right.
    HomeTolerance = 6,
    /// Highest speed, µdeg/s.
    MaxSpeed = 7,
    /// Acceleration and deceleration, µdeg/s².
    Acceleration = 8,
    /// Speed of homing's first search, µdeg/s.
    HomeFastSpeed = 9,
    /// Speed of homing's last approach, µdeg/s.
    HomeSlowSpeed = 10,
    /// How far homing backs off the switch, µdeg.
    HomeBackoff = 11,
    /// Every target is approached from below, over at least this way, µdeg.
    BacklashTakeup = 12,
    /// Largest error at which a target counts as reached, µdeg.
    InPositionWindow = 13,
    /// How long the encoder must stay within the in-position window, µs.
    SettlingTime = 14,
    /// How long ringing may last before a correction is made, µs. The correction is the mean over
    /// the second half, which must be at least a period of the ringing.
    SettlingTimeout = 15,
    /// Corrections allowed for one target.
    MaxCorrections = 16,
    /// Largest difference of steps and encoder while moving, µdeg.
    FollowingLimit = 17,
    /// Largest error at which a trigger pulse is given, µdeg. Well below the pointing limit: an arm that
    /// has arrived first may slip while it waits for the other one.
    TriggerWindow = 18,
    /// While moving or armed, a packet of the host must arrive this often, µs. Of the node: both axes share
    /// it.
    HostWatchdog = 19,
    /// Time between telemetry while moving, µs; 0 for none. Of the node: both axes share it.
    Telemetry = 20,
    /// How far steps and encoder, both counted from home, may differ at rest, µdeg. More means that one
    /// of both is wrong, and only the home switch shows which. Calibrating makes it narrower.
    StepLossLimit = 21,
    /// Error map of the encoder (see `gonia_firmware::error_map`): cosine, once a turn, µdeg.
    EncoderCos1 = 22,
    /// Sine, once a turn, µdeg.
    EncoderSin1 = 23,
    /// Cosine, twice a turn, µdeg.
    EncoderCos2 = 24,
    /// Sine, twice a turn, µdeg.
    EncoderSin2 = 25,
    /// How long acceleration takes to build up and to die down, µs: jerk is acceleration / jerk time. 0
    /// for a trapezoid of speed. Near the period of the arm's swing it keeps the arm from swinging.
    JerkTime = 26,
    /// The worm's turn at the shaft, µdeg: the period of the gear's error.
    WormTurn = 27,
    /// Error of the gear: how far the shaft is ahead of the steps, cosine, once a turn of the worm, µdeg.
    GearCos = 28,
    /// Sine of the same, µdeg.
    GearSin = 29,
    /// 1 where the motor, wired as it is, turns the axis down when the direction output is high.
    MotorReversed = 30,
    /// 1 where the encoder counts up when the axis turns down.
    EncoderReversed = 31,
    /// Wider than a cam that works the home switch once a turn, µdeg: an axis that can travel a turn drives so
    /// far below home to see that the switch still says so. It must turn freely there.
    HomeProbe = 32,
    /// 1 where the home switch is normally closed: its contact opens at home, so that a cut wire reads as home,
    /// which homing finds out. 0: it closes there.
    HomeNormallyClosed = 33,
    /// The driver's alarm output: 0 for none, 1 where its contact is closed while all is well (a cut wire is an
    /// alarm), 2 where it closes for an alarm.
    DriverAlarm = 34,
    /// How long a brake takes to engage or to let go, µs; 0 where none is fitted. Of the node.
    BrakeTime = 35,
    /// What the encoder speaks: 0 for SSI, 1 for BiSS-C, 2 for two square waves and an index (quadrature).
    EncoderKind = 36,
    /// How the motor's driver is set: 0 by hand (step and direction, potentiometer, jumpers), 1 a TMC2209 by its
    /// UART, 2 a TMC5160 by SPI. By wire, the next five are written to it at the start, read back, and watched.
    DriverKind = 37,
    /// Address of a TMC2209 by its pins MS1 and MS2: 0 to 3.
    DriverAddress = 38,
    /// Current while the motor turns, mA (RMS).
    RunCurrent = 39,
    /// Current at rest, mA (RMS): 0.4 s after the last step.
    HoldCurrent = 40,
    /// Microsteps of a full step, a power of two. `steps_per_turn` counts these.
    Microsteps = 41,
    /// The driver's sense resistors, mΩ: usually 110 on a TMC2209's module, 75 on a TMC5160's.
    SenseResistor = 42,
}

/// What a key means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Meaning {
    /// The key.
    pub key: Key,
    /// Its name for people.
    pub name: &'static str,
    /// Its unit for people.
    pub unit: &'static str,
    /// Lowest value.
    pub min: i32,
    /// Highest value.
    pub max: i32,
    /// Values of a new board, θ and φ.
    pub default: [i32; 2],
}

const DEG: i32 = 1_000_000;

/// Every key, in the order of its number.
pub const MEANINGS: [Meaning; N_SETTINGS] = [
    m(
        Key::StepsPerTurn,
        "steps_per_turn",
        "steps",
        (200, 10_000_000),
        [144_000; 2],
    ),
    m(
        Key::EncoderCountsPerTurn,
        "encoder_counts_per_turn",
        "counts",
        (1024, 1 << 26),
        [1 << 18; 2],
    ),
    m(
        Key::EncoderZero,
        "encoder_zero",
        "counts",
        (0, 1 << 26),
        [0; 2],
    ),
    m(
        Key::SoftMin,
        "soft_min",
        "µdeg",
        (-720 * DEG, 720 * DEG),
        [-2 * DEG, -185 * DEG],
    ),
    m(
        Key::SoftMax,
        "soft_max",
        "µdeg",
        (-720 * DEG, 720 * DEG),
        [90 * DEG, 545 * DEG],
    ),
    m(
        Key::HomeAngle,
        "home_angle",
        "µdeg",
        (-720 * DEG, 720 * DEG),
        [-5 * DEG, -190 * DEG],
    ),
    m(
        Key::HomeTolerance,
        "home_tolerance",
        "µdeg",
        (1000, 170 * DEG),
        [15_000; 2],
    ),
    m(
        Key::MaxSpeed,
        "max_speed",
        "µdeg/s",
        (10_000, 180 * DEG),
        [15 * DEG; 2],
    ),
    m(
        Key::Acceleration,
        "acceleration",
        "µdeg/s²",
        (100_000, 1000 * DEG),
        [90 * DEG; 2],
    ),
    m(
        Key::HomeFastSpeed,
        "home_fast_speed",
        "µdeg/s",
        (10_000, 90 * DEG),
        [10 * DEG; 2],
    ),
    m(
        Key::HomeSlowSpeed,
        "home_slow_speed",
        "µdeg/s",
        (10_000, 10 * DEG),
        [500_000; 2],
    ),
    m(
        Key::HomeBackoff,
        "home_backoff",
        "µdeg",
        (10_000, 10 * DEG),
        [DEG; 2],
    ),
    m(
        Key::BacklashTakeup,
        "backlash_takeup",
        "µdeg",
        (0, 5 * DEG),
        [100_000; 2],
    ),
    m(
        Key::InPositionWindow,
        "in_position_window",
        "µdeg",
        (500, 30_000),
        [6000; 2],
    ),
    m(
        Key::SettlingTime,
        "settling_time",
        "µs",
        (4000, 10_000_000),
        [120_000; 2],
    ),
    m(
        Key::SettlingTimeout,
        "settling_timeout",
        "µs",
        (20_000, 10_000_000),
        [240_000; 2],
    ),
    m(Key::MaxCorrections, "max_corrections", "", (0, 50), [6; 2]),
    m(
        Key::FollowingLimit,
        "following_limit",
        "µdeg",
        (10_000, 10 * DEG),
        [400_000; 2],
    ),
    m(
        Key::TriggerWindow,
        "trigger_window",
        "µdeg",
        (1000, 30_000),
        [12_000; 2],
    ),
    m(
        Key::HostWatchdog,
        "host_watchdog",
        "µs",
        (100_000, 60_000_000),
        [2_000_000; 2],
    ),
    m(
        Key::Telemetry,
        "telemetry",
        "µs",
        (0, 60_000_000),
        [500_000; 2],
    ),
    m(
        Key::StepLossLimit,
        "step_loss_limit",
        "µdeg",
        (5000, 10 * DEG),
        [20_000; 2],
    ),
    map(Key::EncoderCos1, "encoder_cos1"),
    map(Key::EncoderSin1, "encoder_sin1"),
    map(Key::EncoderCos2, "encoder_cos2"),
    map(Key::EncoderSin2, "encoder_sin2"),
    m(
        Key::JerkTime,
        "jerk_time",
        "µs",
        (0, 1_000_000),
        [125_000; 2],
    ),
    m(
        Key::WormTurn,
        "worm_turn",
        "µdeg",
        (10_000, 360 * DEG),
        [4 * DEG; 2],
    ),
    map(Key::GearCos, "gear_cos"),
    map(Key::GearSin, "gear_sin"),
    m(Key::MotorReversed, "motor_reversed", "", (0, 1), [0; 2]),
    m(Key::EncoderReversed, "encoder_reversed", "", (0, 1), [0; 2]),
    m(
        Key::HomeProbe,
        "home_probe",
        "µdeg",
        (500_000, 90 * DEG),
        [5 * DEG; 2],
    ),
    m(
        Key::HomeNormallyClosed,
        "home_normally_closed",
        "",
        (0, 1),
        [1; 2],
    ),
    m(Key::DriverAlarm, "driver_alarm", "", (0, 2), [0; 2]),
    m(Key::BrakeTime, "brake_time", "µs", (0, 1_000_000), [0; 2]),
    m(Key::EncoderKind, "encoder_kind", "", (0, 2), [0; 2]),
    m(Key::DriverKind, "driver_kind", "", (0, 2), [0; 2]),
    m(Key::DriverAddress, "driver_address", "", (0, 3), [0; 2]),
    m(Key::RunCurrent, "run_current", "mA", (50, 5_000), [800; 2]),
    m(
        Key::HoldCurrent,
        "hold_current",
        "mA",
        (30, 5_000),
        [400; 2],
    ),
    m(Key::Microsteps, "microsteps", "", (1, 256), [8; 2]),
    m(
        Key::SenseResistor,
        "sense_resistor",
        "mΩ",
        (10, 1_000),
        [110; 2],
    ),
];

/// An amplitude of an error.
const fn map(key: Key, name: &'static str) -> Meaning {
    m(key, name, "µdeg", (-500_000, 500_000), [0; 2])
}

const fn m(
    key: Key,
    name: &'static str,
    unit: &'static str,
    range: (i32, i32),
    default: [i32; 2],
) -> Meaning {
    Meaning {
        key,
        name,
        unit,
        min: range.0,
        max: range.1,
        default,
    }
}

impl Key {
    /// The keys of an encoder's error map. All zero: it was never calibrated.
    pub const ERROR_MAP: [Key; 4] = [
        Key::EncoderCos1,
        Key::EncoderSin1,
        Key::EncoderCos2,
        Key::EncoderSin2,
    ];

    /// The keys of a gear's error map.
    pub const GEAR_MAP: [Key; 3] = [Key::WormTurn, Key::GearCos, Key::GearSin];

    /// The key of a number, if there is one.
    pub fn from_number(number: u8) -> Option<Self> {
        MEANINGS.get(number as usize).map(|meaning| meaning.key)
    }

    /// Its number on the wire.
    pub fn number(self) -> u8 {
        self as u8
    }

    /// Name, unit, range and defaults.
    pub fn meaning(self) -> &'static Meaning {
        &MEANINGS[self as usize]
    }

    /// The keys of a driver that is set by wire.
    pub const DRIVER: [Key; 6] = [
        Key::DriverKind,
        Key::DriverAddress,
        Key::RunCurrent,
        Key::HoldCurrent,
        Key::Microsteps,
        Key::SenseResistor,
    ];

    /// Whether both axes of a node share one value.
    pub fn is_of_the_node(self) -> bool {
        matches!(self, Key::HostWatchdog | Key::Telemetry | Key::BrakeTime)
    }

    /// Its value on a new board.
    pub fn default_of(self, axis: Axis) -> i32 {
        self.meaning().default[axis.index()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_the_order_of_the_numbers() {
        for (i, meaning) in MEANINGS.iter().enumerate() {
            assert_eq!(meaning.key as usize, i);
            assert_eq!(Key::from_number(i as u8), Some(meaning.key));
            for value in meaning.default {
                assert!(
                    (meaning.min..=meaning.max).contains(&value),
                    "{}",
                    meaning.name
                );
            }
        }
        assert_eq!(Key::from_number(N_SETTINGS as u8), None);
    }
}
