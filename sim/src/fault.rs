//! What may go wrong, as data.

use gonia_protocol::settings::Axis;

/// Everything that goes wrong in a session. The default is nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FaultPlan {
    /// Faults of both wires, all the time.
    pub wire: WireFaults,
    /// Faults at a time.
    pub events: Vec<FaultEvent>,
}

/// What happens to bytes under way. Probabilities are per byte, and the same both ways.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WireFaults {
    /// A random bit is flipped.
    pub flip: f64,
    /// The byte is lost.
    pub drop: f64,
    /// The byte comes twice.
    pub repeat: f64,
    /// This byte and all after it come later, by up to [`Self::delay_us`].
    pub delay: f64,
    /// The longest delay, µs.
    pub delay_us: u64,
}

/// A fault at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultEvent {
    /// When, µs of virtual time.
    pub at_us: u64,
    /// Which arm.
    pub arm: Arm,
    /// What.
    pub fault: Fault,
}

/// One of the two arms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arm {
    /// The light's.
    Light,
    /// The camera's.
    Camera,
}

impl Arm {
    /// Both, in the order of every pair.
    pub const BOTH: [Arm; 2] = [Arm::Light, Arm::Camera];
}

/// What can happen to an arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// The motor falls back by magnetic cycles.
    LoseCycles {
        /// Of which axis.
        axis: Axis,
        /// How many; negative ones push it on.
        cycles: i32,
    },
    /// The motor stands still whatever steps it gets.
    Stall {
        /// Of which axis.
        axis: Axis,
        /// How long, µs.
        for_us: u64,
    },
    /// The shaft slips against the gear.
    Slip {
        /// Of which axis.
        axis: Axis,
        /// By how much.
        udeg: f64,
    },
    /// The encoder does not answer.
    EncoderLost {
        /// Of which axis.
        axis: Axis,
        /// How long, µs.
        for_us: u64,
    },
    /// The encoder is off from now on.
    EncoderJump {
        /// Of which axis.
        axis: Axis,
        /// By how much.
        udeg: f64,
    },
    /// What the home switch says stays the same wherever the axis is; `None` ends that.
    SwitchStuck {
        /// Of which axis.
        axis: Axis,
        /// Whether it says home.
        at_home: Option<bool>,
    },
    /// The cable of the home switch is cut.
    SwitchCut {
        /// Of which axis.
        axis: Axis,
    },
    /// The driver takes its motor's current away and reports an alarm, for so long.
    DriverAlarm {
        /// Of which axis.
        axis: Axis,
        /// How long, µs.
        for_us: u64,
    },
    /// The driver, set by wire, loses its supply for a moment, and with it its settings.
    DriverReset {
        /// Of which axis.
        axis: Axis,
    },
    /// The encoder's warning bit is set from now on.
    EncoderWarns {
        /// Of which axis.
        axis: Axis,
    },
    /// The waves of the quadrature ring change so often without a sample.
    EdgesLost {
        /// Of which axis.
        axis: Axis,
        /// How often.
        counts: u32,
    },
    /// The wire of the quadrature ring's index is cut.
    IndexCut {
        /// Of which axis.
        axis: Axis,
    },
    /// Readings of the encoder scatter, by so much (standard deviation).
    EncoderNoise {
        /// Of which axis.
        axis: Axis,
        /// How much.
        udeg: f64,
        /// How long, µs.
        for_us: u64,
    },
    /// The home switch chatters for so long whenever it changes.
    SwitchBounces {
        /// Of which axis.
        axis: Axis,
        /// How long each time, µs.
        bounce_us: u64,
    },
    /// The interlock of both arms opens.
    InterlockOpen {
        /// How long, µs.
        for_us: u64,
    },
    /// From now on a switch between the arms opens the interlock's chain while they are near.
    Bumper {
        /// Nearer than this, by the directions that they point in, degrees.
        deg: f64,
    },
    /// The cable is out, both ways.
    Unplugged {
        /// How long, µs.
        for_us: u64,
    },
    /// The controller restarts after a sag of its supply.
    BrownOut,
    /// The other arm does not see the next pulses.
    TriggerLost {
        /// How many pulses.
        pulses: u32,
    },
    /// The other arm sees the next pulse late.
    TriggerLate {
        /// By how much, µs.
        by_us: u64,
    },
    /// The power goes during the next saving of settings.
    TornSave {
        /// After so many bytes.
        after_bytes: usize,
    },
}
