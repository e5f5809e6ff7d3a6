//! Every message, its kind and its body.
//!
//! Kinds below 0x80 go from host to controller, 0x80 … 0xBF answer one of those, 0xC0 and above are
//! events, which come without a request. All angles are absolute, in µdeg; all times are µs since the
//! controller's start. Kinds and layouts of `Hello`, `Identity`, `Stop` and `EStop` are frozen for
//! ever; the others are held by the golden bytes in this crate's tests.

use heapless::{String, Vec};
use serde::{Deserialize, Serialize};

use crate::fault::FaultCode;
use crate::settings::Axis;

/// Pulses of one trigger train.
pub const MAX_PULSES: usize = 8;

/// Defines [`Message`] and what depends on the list of kinds.
macro_rules! messages {
    (
        plain { $($(#[$plain_doc:meta])* $plain_kind:literal $plain:ident,)+ }
        with_body { $($(#[$full_doc:meta])* $full_kind:literal $full:ident($body:ty),)+ }
    ) => {
        /// Anything that travels.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Message {
            $($(#[$plain_doc])* $plain,)+
            $($(#[$full_doc])* $full($body),)+
        }

        impl Message {
            /// The number that stands for this message in a header.
            pub fn kind(&self) -> u8 {
                match self {
                    $(Message::$plain => $plain_kind,)+
                    $(Message::$full(_) => $full_kind,)+
                }
            }

            /// Writes the body and returns its length, or `None` when it does not fit.
            pub(crate) fn write_body(&self, out: &mut [u8]) -> Option<usize> {
                match self {
                    $(Message::$plain => Some(0),)+
                    $(Message::$full(body) => {
                        postcard::to_slice(body, out).ok().map(|written| written.len())
                    })+
                }
            }

            /// Reads a body; bytes left over are an error.
            pub(crate) fn read(kind: u8, body: &[u8]) -> Result<Self, BodyError> {
                let (message, rest) = match kind {
                    $($plain_kind => (Message::$plain, body),)+
                    $($full_kind => {
                        let (value, rest) = postcard::take_from_bytes::<$body>(body)
                            .map_err(|_| BodyError::Malformed)?;
                        (Message::$full(value), rest)
                    })+
                    _ => return Err(BodyError::UnknownKind),
                };
                if rest.is_empty() { Ok(message) } else { Err(BodyError::Malformed) }
            }
        }
    };
}

messages! {
    plain {
        /// Asks for [`Status`]. Valid in every state.
        0x02 GetStatus,
        /// Decelerate and stop. Valid in every state, answered whatever the version.
        0x03 Stop,
        /// Stop at once with a latched fault. Valid in every state, answered whatever the version.
        0x04 EStop,
        /// Restarts the host watchdog; never answered.
        0x05 Heartbeat,
        /// Leaves the fault or the emergency stop, if its cause is gone.
        0x06 ClearFault,
        /// Homes both axes.
        0x07 Home,
        /// Starts the train of pulses that was requested.
        0x0A Fire,
        /// Leaves the armed state without a pulse.
        0x0B Disarm,
        /// Writes the settings to the board's memory, whole or not at all.
        0x0F SaveSettings,
        /// Done, or begun: the request is accepted.
        0x83 Accepted,
    }
    with_body {
        /// Opens a session; answered by [`Identity`] whatever the version.
        0x01 Hello(Hello),
        /// Moves both axes.
        0x08 Move(Move),
        /// Makes ready for a trigger train.
        0x09 RequestTrigger(TriggerRequest),
        /// Asks for the [`Latch`] of a pulse of the last train.
        0x0C ReadLatch(u8),
        /// Asks for a setting.
        0x0D GetSetting(SettingName),
        /// Changes a setting until the next reset.
        0x0E SetSetting(Setting),
        /// Asks for an entry of the log, 0 being the newest.
        0x10 ReadLog(u8),

        /// Who the controller is.
        0x81 Identity(Identity),
        /// How it is.
        0x82 Status(Status),
        /// Not accepted, and why. Nothing has changed.
        0x84 Refused(RequestRefusal),
        /// The value of a setting.
        0x85 SettingIs(Setting),
        /// The latch of a pulse.
        0x86 LatchIs(Latch),
        /// An entry of the log.
        0x87 LogIs(LogEntry),

        /// Something accepted has ended.
        0xC1 Completed(Completed),
        /// A fault was latched, or a warning given.
        0xC2 Faulted(Faulted),
        /// Where the arm is, now and then.
        0xC3 Telemetry(Telemetry),
        /// A pulse was latched.
        0xC4 Pulse(Latch),
    }
}

impl Message {
    /// Whether this is an event: neither a request nor the answer to one.
    pub fn is_event(&self) -> bool {
        self.kind() >= 0xC0
    }

    /// Whether this answers a request.
    pub fn is_reply(&self) -> bool {
        (0x80..0xC0).contains(&self.kind())
    }

    /// Whether a controller answers this even when versions differ or no session is open.
    pub fn is_always_answered(kind: u8) -> bool {
        matches!(kind, 0x01 | 0x02 | 0x03 | 0x04 | 0x10)
    }
}

/// Why a body cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyError {
    /// The kind is not one of this version.
    UnknownKind,
    /// The bytes are not a body of this kind.
    Malformed,
}

/// Opens a session. Frozen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// Any number a host has not used before; a new one starts a new count of request ids.
    pub session: u32,
}

/// Identity of a controller. Frozen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// Oldest protocol version it understands.
    pub protocol_min: u8,
    /// Newest protocol version it understands.
    pub protocol_max: u8,
    /// Its [`crate::SCHEMA_KEY`].
    pub schema_key: u32,
    /// Firmware version: major, minor, patch.
    pub firmware: [u8; 3],
    /// ControllerState of the sources it was built from, such as `a1b2c3d4` or `a1b2c3d4+`.
    pub git: String<16>,
    /// Name of the board.
    pub board: String<16>,
    /// Checksum of the settings in use.
    pub config_crc: u32,
    /// Changes at every start.
    pub boot_id: u32,
    /// Why it started.
    pub reset: ResetReason,
    /// Message of the last panic, empty when there was none.
    pub last_panic: String<64>,
}

/// Why a controller started. Frozen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ResetReason {
    /// Power came on.
    PowerOn,
    /// The supply sagged.
    BrownOut,
    /// The watchdog expired.
    Watchdog,
    /// By the software, a panic included.
    Software,
    /// The reset pin.
    Pin,
    /// The board cannot tell.
    Unknown,
}

/// An absolute move of both axes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Move {
    /// θ and φ, µdeg.
    pub target_udeg: [i32; 2],
}

/// Which end of the trigger wire a controller is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum TriggerRole {
    /// It gives the pulses.
    Source,
    /// It latches its encoders when the other controller gives one.
    Follower,
}

/// A train of trigger pulses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TriggerRequest {
    /// Which end of the wire.
    pub trigger: TriggerRole,
    /// Length of each pulse, µs: the exposure times.
    pub exposures_us: Vec<u32, MAX_PULSES>,
    /// Pause between pulses, µs.
    pub gap_us: u32,
}

/// What the encoders read at the rising edge of a pulse.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Latch {
    /// Number of the event, for counting losses; 0 in an answer.
    pub seq: u32,
    /// The trigger request of the train.
    pub request: u16,
    /// Which pulse of the train.
    pub pulse: u8,
    /// When.
    pub time_us: u64,
    /// Where the encoders were.
    pub encoder_udeg: [i32; 2],
    /// Whether both axes were within the trigger window.
    pub within: bool,
}

/// Names a setting.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SettingName {
    /// Of which axis; either one for a setting of the node.
    pub axis: Axis,
    /// Number of a [`crate::settings::Key`].
    pub key: u8,
}

/// A setting and its value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// Of which axis; either one for a setting of the node.
    pub axis: Axis,
    /// Number of a [`crate::settings::Key`].
    pub key: u8,
    /// In the key's unit.
    pub value: i32,
}

/// What a controller is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ControllerState {
    /// Starting; the first readings are not in yet.
    Boot,
    /// It does not know where it is.
    Unhomed,
    /// Looking for home.
    Homing,
    /// At rest and at home.
    Idle,
    /// Under way.
    Moving,
    /// Arrived; waiting for the encoder to stay within the in-position window.
    Settling,
    /// Ready to give or to follow trigger pulses.
    Armed,
    /// A latched fault, until it is cleared.
    Fault(FaultCode),
    /// Stopped at once, until it is cleared.
    EStop,
}

/// One axis as it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AxisStatus {
    /// Where the steps have brought it, µdeg.
    pub commanded_udeg: i32,
    /// The encoder's reading, µdeg.
    pub encoder_udeg: i32,
    /// Largest |commanded − encoder| of the last move, µdeg.
    pub following_udeg: i32,
    /// Corrections made since the start.
    pub corrections: u32,
    /// Steps found missing by the encoder since the start.
    pub missed_steps: u32,
}

/// How a controller is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// Now.
    pub time_us: u64,
    /// What it is doing.
    pub state: ControllerState,
    /// Whether positions mean anything.
    pub homed: bool,
    /// θ and φ.
    pub axes: [AxisStatus; 2],
    /// The last request that ended, and how: the same as its event, which may have been lost.
    pub last: Option<(u16, RequestOutcome)>,
    /// Frames understood since the start.
    pub packets_good: u32,
    /// Frames thrown away since the start.
    pub packets_bad: u32,
    /// Checksum of the settings in use.
    pub config_crc: u32,
}

/// How something accepted has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum RequestOutcome {
    /// As requested.
    Done,
    /// `Stop` or `Disarm` came first.
    Stopped,
    /// A fault came first.
    Failed(FaultCode),
    /// An axis left the trigger window before the train was over.
    LeftWindow(Axis),
}

/// Something accepted has ended: a move, homing, a train of pulses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Completed {
    /// Number of the event, for counting losses.
    pub seq: u32,
    /// The request that began it.
    pub request: u16,
    /// How.
    pub outcome: RequestOutcome,
    /// Where the encoders were.
    pub encoder_udeg: [i32; 2],
    /// Corrections it took.
    pub corrections: [u8; 2],
}

/// A fault was latched, or a warning given ([`FaultCode::is_warning`]), which latches nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Faulted {
    /// Number of the event, for counting losses.
    pub seq: u32,
    /// Which.
    pub code: FaultCode,
    /// On which axis, if on one.
    pub axis: Option<Axis>,
}

/// Where the arm is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Telemetry {
    /// Number of the event, for counting losses.
    pub seq: u32,
    /// When.
    pub time_us: u64,
    /// What it is doing.
    pub state: ControllerState,
    /// Where the steps have brought it, µdeg.
    pub commanded_udeg: [i32; 2],
    /// The encoders' readings, µdeg.
    pub encoder_udeg: [i32; 2],
}

/// An entry of the log: a fault or a warning, and when it came.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LogEntry {
    /// When.
    pub time_us: u64,
    /// Which; `None` when the log has no such entry.
    pub fault: Option<FaultCode>,
    /// On which axis, if on one.
    pub axis: Option<Axis>,
}

/// Why a request was not accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum RequestRefusal {
    /// The packet is of a protocol version that the controller does not speak.
    Version,
    /// No session is open: say `Hello` first. After this a host knows that the controller restarted.
    NoSession,
    /// The kind or its body is not understood.
    NotUnderstood,
    /// Not in this state.
    State(ControllerState),
    /// Home first.
    NotHomed,
    /// A target beyond a soft limit.
    TargetBeyondLimit(Axis),
    /// The arm itself stands beyond a soft limit: home it.
    StartBeyondLimit(Axis),
    /// An axis is outside the trigger window, by so many µdeg from its target.
    OutsideWindow(Axis, i32),
    /// A value out of range, or a key that does not exist.
    Value,
    /// The cause of the fault is still there.
    CauseRemains(FaultCode),
    /// There is no such pulse.
    NoSuchPulse,
    /// A quadrature ring would give so many counts a second, where so many are followed.
    CountRate(u32, u32),
    /// The board has no pins for such an encoder or driver.
    NoPins,
}

impl core::fmt::Display for RequestRefusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            RequestRefusal::Version => f.write_str(
                "host and firmware speak different protocol versions; update the older one",
            ),
            RequestRefusal::NoSession => {
                f.write_str("the controller has restarted; identify and home it again")
            }
            RequestRefusal::NotUnderstood => {
                f.write_str("the controller does not know this command; update its firmware")
            }
            RequestRefusal::State(ControllerState::Fault(code)) => {
                write!(f, "not with a latched fault: {code}")
            }
            RequestRefusal::State(state) => write!(f, "not while {state:?}; stop first"),
            RequestRefusal::NotHomed => f.write_str("the arm does not know where it is; home it"),
            RequestRefusal::TargetBeyondLimit(axis) => {
                write!(f, "the target of {axis:?} is beyond its soft limit")
            }
            RequestRefusal::StartBeyondLimit(axis) => {
                write!(f, "{axis:?} stands beyond its soft limit; home the arm")
            }
            RequestRefusal::OutsideWindow(axis, error) => write!(
                f,
                "{axis:?} is {:.4}° off its target, outside the trigger window",
                f64::from(*error) * 1e-6
            ),
            RequestRefusal::Value => f.write_str("no such setting, or its value is out of range"),
            RequestRefusal::CauseRemains(code) => write!(f, "the cause is still there: {code}"),
            RequestRefusal::NoSuchPulse => f.write_str("no such pulse was captured"),
            RequestRefusal::CountRate(counts_s, most) => write!(
                f,
                "max_speed times encoder_counts_per_turn would be {counts_s} counts/s, and a quadrature ring is \
                 followed up to {most}; lower max_speed, or fit a ring of fewer lines"
            ),
            RequestRefusal::NoPins => f.write_str(
                "the board has no pins for such an encoder or driver; see its wiring page, or use another board",
            ),
        }
    }
}
