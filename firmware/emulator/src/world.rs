//! What the chip is wired to: motors and encoders, switches, the interlock's relay, the host's wire.

use std::collections::VecDeque;

use gonia_firmware::driver::tmc5160::DATAGRAM_LEN;
use gonia_sim::plant::{AxisPlant, PlantConfig};
use gonia_sim::quadrature::{Levels, levels};

use crate::one_wire::OneWire;

/// How long the relay's contact takes to follow its coil, ns.
const RELAY_NS: u64 = 8_000_000;
/// A byte at the host's 921,600 baud, ns.
const HOST_BYTE_NS: u64 = 10_851;
/// How far the chip's byte may be off the host's before the host's UART misses the stop bit.
const BYTE_TOLERANCE: f64 = 0.03;
/// Fastest clock that the ring's SSI follows, Hz; beyond it, bits are shifted before they are there.
const RING_HZ: f64 = 500_000.0;

/// Everything beside the chip.
#[derive(Debug)]
pub struct World {
    /// Virtual time, ns.
    pub now_ns: u64,
    /// The arm.
    pub axes: [Axis; 2],
    /// The wire to the host.
    pub wire: Wire,
    /// Edges of the trigger output: time in ns, and whether it rose.
    pub trigger: Vec<(u64, bool)>,
    /// The interlock's relay.
    pub relay: Relay,
    /// The chain is cut elsewhere: a pressed button, the other arm's relay.
    pub chain_is_cut: bool,
    /// Resets of the chip so far, with what asked for each.
    pub resets: Vec<(u64, String)>,
    /// Sectors of flash that were erased.
    pub erases: u32,
    /// Drivers have current, brakes have let go: each change with its time, ns.
    pub power: Vec<(u64, bool, bool)>,
}

/// An axis: what its driver has got, and where that took it.
#[derive(Debug)]
pub struct Axis {
    /// Motor, gear, encoder, switch.
    pub plant: AxisPlant,
    /// The direction pin.
    pub up: bool,
    /// When it last changed, ns.
    pub turned_ns: u64,
    /// Steps given, up minus down.
    pub given: i64,
    /// Steps given, either way.
    pub edges: u64,
    /// Time of the last one, ns.
    pub last_ns: u64,
    /// Shortest time from a change of direction to a step, ns.
    pub setup_ns: u64,
    /// Times at which the step input rose, ns.
    pub rises: Vec<u64>,
    /// Shortest time for which it was high, ns.
    pub narrowest_ns: u64,
    /// Motor and encoder are wired the other way round.
    pub is_reversed: bool,
    /// The contact of the driver's alarm output, which opens for an alarm.
    pub alarm_closed: bool,
    /// The driver has current, and the brake has let go.
    can_turn: bool,
    /// Steps that came while it was not so.
    pub unheard: u64,
    /// Clock of its encoder's SPI, Hz.
    pub ssi_hz: f64,
    /// What the encoder speaks.
    pub ring: RingKind,
    /// The encoder's shift register.
    pub ssi: Ssi,
    /// Waves and index of a quadrature ring.
    pub waves: Waves,
    /// The driver that is set by wire; `None` for one that is set by hand.
    pub driver: Option<OneWire>,
    /// The driver's select line is low, and what it has heard since.
    heard: Option<Vec<u8>>,
    /// What the driver puts on the line meanwhile.
    answer: [u8; DATAGRAM_LEN],
    /// Datagrams that it has taken.
    pub datagrams: u32,
}

/// What a ring speaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RingKind {
    /// SSI.
    Ssi,
    /// BiSS-C, with so many bits of acknowledgement; one bit of each word flips on the way, or none.
    BissC {
        /// Bits of zero before the word starts.
        acknowledgement: usize,
        /// Which bit flips, counted from the first one.
        flips: Option<u32>,
    },
    /// Two waves and an index.
    Quadrature,
}

/// A ring's shift register: latches at the first clock after its pause.
#[derive(Debug, Default)]
pub struct Ssi {
    word: u64,
    shifted: u32,
    last_ns: u64,
    /// Words begun.
    pub words: u64,
}

/// What a quadrature ring shows. Between two steps of the motor it turns by several counts, one after the other as fast as
/// its data sheet lets it be at the highest count rate that the settings allow.
#[derive(Debug, Default)]
pub struct Waves {
    /// The count that is shown; `None` until the first look.
    at: Option<u32>,
    /// The next count is due then, ns.
    due_ns: Option<u64>,
    last_ns: u64,
    /// The index's wire is cut.
    pub index_is_cut: bool,
    /// The next count comes with the one after it, at one moment.
    pub skips_one: bool,
}

/// The shortest state of the waves, ns: half of a count at 20,000 counts/s.
const STATE_NS: u64 = 25_000;

/// Counts of the ring.
const COUNTS: u32 = 1 << 18;
/// Time without a clock after which a ring latches anew, ns.
const SSI_PAUSE_NS: u64 = 16_000;

impl Axis {
    fn new(config: PlantConfig, seed: u64) -> Self {
        Self {
            plant: AxisPlant::new(config, seed),
            up: false,
            turned_ns: 0,
            given: 0,
            edges: 0,
            last_ns: 0,
            setup_ns: u64::MAX,
            rises: Vec::new(),
            narrowest_ns: u64::MAX,
            is_reversed: false,
            alarm_closed: true,
            can_turn: false,
            unheard: 0,
            ssi_hz: 0.0,
            ring: RingKind::Ssi,
            ssi: Ssi::default(),
            waves: Waves::default(),
            driver: None,
            heard: None,
            answer: [0; DATAGRAM_LEN],
            datagrams: 0,
        }
    }

    /// The driver's select line falls, or rises: then it takes what it has heard, if that is a datagram.
    pub fn select(&mut self, is_low: bool) {
        if is_low == self.heard.is_some() {
            return;
        }
        let heard = std::mem::replace(&mut self.heard, is_low.then(Vec::new));
        let Some(OneWire { chip, .. }) = &mut self.driver else {
            return;
        };
        let datagram = heard.and_then(|bytes| <[u8; DATAGRAM_LEN]>::try_from(bytes).ok());
        if let Some(datagram) = datagram {
            chip.spi_take(datagram);
            self.datagrams += 1;
        }
        self.answer = chip.spi_out();
    }

    /// The axis is built otherwise; it stands where it stood at first.
    pub fn rebuild(&mut self, change: impl FnOnce(&mut PlantConfig)) {
        let mut config = self.plant.config().clone();
        change(&mut config);
        self.plant = AxisPlant::new(config, 1);
    }

    /// The step input rises.
    pub fn step(&mut self, now_ns: u64) {
        self.setup_ns = self.setup_ns.min(now_ns - self.turned_ns);
        self.rises.push(now_ns);
        self.last_ns = now_ns;
        self.edges += 1;
        self.given += if self.up { 1 } else { -1 };
        if self.can_turn {
            self.plant.step(self.up != self.is_reversed, now_ns / 1000);
        } else {
            self.unheard += 1;
        }
    }

    /// The step input falls.
    pub fn fall(&mut self, now_ns: u64) {
        self.narrowest_ns = self.narrowest_ns.min(now_ns - self.last_ns);
    }

    /// Levels of a quadrature ring.
    pub fn levels(&mut self, now_ns: u64) -> Option<Levels> {
        if self.ring != RingKind::Quadrature {
            return None;
        }
        let stands = self.plant.encoder_counts(now_ns / 1000)?;
        let (config, waves) = (self.plant.config(), &mut self.waves);
        let turn = config.encoder_counts;
        let mut at = waves.at.unwrap_or(stands);
        if at != stands && now_ns >= waves.last_ns + STATE_NS {
            let is_up = (stands + turn - at) % turn <= turn / 2;
            let by = if core::mem::take(&mut waves.skips_one) {
                2
            } else {
                1
            };
            at = (at + if is_up { by } else { turn - by }) % turn;
            waves.last_ns = now_ns;
        }
        waves.at = Some(at);
        waves.due_ns = (at != stands).then(|| now_ns.max(waves.last_ns + STATE_NS));
        let [first, second, index] = levels(config, at);
        Some([first, second, index && !waves.index_is_cut])
    }

    /// When its wires or its ring do something by themselves next, ns.
    pub fn due_ns(&self) -> Option<u64> {
        let wire = self.driver.as_ref().and_then(OneWire::due_ns);
        wire.into_iter().chain(self.waves.due_ns).min()
    }

    /// Eight clocks of the SPI, ending now: what the data line brought.
    pub fn shift(&mut self, now_ns: u64) -> u32 {
        let byte_ns = (8e9 / self.ssi_hz.max(1.0)) as u64;
        let began_ns = now_ns.saturating_sub(byte_ns);
        if began_ns > self.ssi.last_ns + SSI_PAUSE_NS || self.ssi.words == 0 {
            let counts = self.plant.encoder_counts(began_ns / 1000);
            let turned = counts.map(|counts| (COUNTS - counts) % COUNTS);
            let counts = if self.is_reversed { turned } else { counts };
            // Rest bit, 18 bits of position, no error, no warning.
            self.ssi.word = match self.ring {
                RingKind::Ssi => counts.map_or(0, |counts| {
                    u64::from(1 << 31 | counts << 13 | 0b11 << 11) << 32
                }),
                RingKind::BissC {
                    acknowledgement,
                    flips,
                } => {
                    let word = counts.map_or(u64::MAX, |counts| biss_word(counts, acknowledgement));
                    word ^ flips.map_or(0, |bit| 1 << (63 - bit))
                }
                // Nothing on that line.
                RingKind::Quadrature => u64::MAX,
            };
            self.ssi.shifted = 0;
            self.ssi.words += 1;
        }
        self.ssi.last_ns = now_ns;
        let shifted = self.ssi.word.checked_shl(8 * self.ssi.shifted);
        let byte = (shifted.unwrap_or(0) >> 56) as u32;
        self.ssi.shifted += 1;
        if self.ring == RingKind::Ssi && self.ssi_hz > RING_HZ * 1.001 {
            // The bit on the line is the one before, here and there.
            let skew = ((self.ssi.words * 2_654_435_761) >> 7) as u32;
            return (byte ^ ((byte >> 1) & skew)) & 0xFF;
        }
        byte
    }
}

/// A word of BiSS-C, bit by bit as the line carries them, first one highest: rest, acknowledgement, start, no
/// control data, position, no error, no warning, and the remainder of their division by x⁶ + x + 1, inverted.
fn biss_word(counts: u32, acknowledgement: usize) -> u64 {
    let mut checked: Vec<bool> = (0..18).rev().map(|i| counts >> i & 1 == 1).collect();
    checked.extend([true, true]);
    let mut division = checked.clone();
    division.extend([false; 6]);
    for i in 0..checked.len() {
        if division[i] {
            for (at, term) in [1, 0, 0, 0, 0, 1, 1].into_iter().enumerate() {
                division[i + at] ^= term == 1;
            }
        }
    }
    let remainder = &division[checked.len()..];
    let mut bits = vec![true, true];
    bits.extend(vec![false; acknowledgement]);
    bits.extend([true, false]);
    bits.extend(&checked);
    bits.extend(remainder.iter().map(|bit| !bit));
    bits.resize(64, true);
    bits.iter().fold(0, |word, &bit| word << 1 | u64::from(bit))
}

/// The relay that closes this controller's part of the chain.
#[derive(Debug, Default)]
pub struct Relay {
    coil: bool,
    changed_ns: u64,
}

impl Relay {
    /// The coil gets or loses its current.
    pub fn energise(&mut self, on: bool, now_ns: u64) {
        if on != self.coil {
            // The contact had got there, or turns back on its way.
            self.coil = on;
            self.changed_ns = now_ns;
        }
    }

    /// Whether its contact is closed.
    pub fn is_closed(&self, now_ns: u64) -> bool {
        let has_moved = now_ns >= self.changed_ns + RELAY_NS || self.changed_ns == 0;
        self.coil == has_moved
    }
}

/// Both directions of the wire to the host.
#[derive(Debug, Default)]
pub struct Wire {
    to_chip: VecDeque<(u64, u8)>,
    free_ns: u64,
    from_chip: Vec<u8>,
    last_ns: u64,
    /// A byte of the chip's, ns: the shortest time between two.
    pub byte_ns: Option<u64>,
}

impl Wire {
    /// The host sends.
    pub fn send(&mut self, bytes: &[u8], now_ns: u64) {
        for &byte in bytes {
            self.free_ns = self.free_ns.max(now_ns) + HOST_BYTE_NS;
            self.to_chip.push_back((self.free_ns, byte));
        }
    }

    /// What has reached the chip by now.
    pub fn due(&mut self, now_ns: u64) -> Option<u8> {
        let (_, byte) = self.to_chip.pop_front_if(|(due_ns, _)| *due_ns <= now_ns)?;
        Some(byte)
    }

    /// The chip has sent a byte.
    pub fn arrived(&mut self, byte: u8, now_ns: u64) {
        let since = now_ns - self.last_ns;
        self.last_ns = now_ns;
        self.byte_ns = Some(self.byte_ns.map_or(since, |shortest| shortest.min(since)));
        self.from_chip.push(byte);
    }

    /// What the host's UART makes of it.
    pub fn take(&mut self) -> Vec<u8> {
        let host = HOST_BYTE_NS as f64;
        let is_readable = self.byte_ns.is_none_or(|ns| {
            (ns as f64 / host - 1.0).abs() < BYTE_TOLERANCE || ns > 4 * HOST_BYTE_NS
        });
        let bytes = core::mem::take(&mut self.from_chip);
        if is_readable {
            bytes
        } else {
            bytes.into_iter().map(|byte| byte ^ 0x55).collect()
        }
    }
}

impl World {
    /// An arm near its home switches, so that homing takes seconds, that leaves nothing to chance.
    pub fn new() -> Self {
        let axes = [(-5e6, 3e6), (-190e6, -170e6)];
        let mut seed = 0;
        Self {
            now_ns: 0,
            axes: axes.map(|(home, start)| {
                seed += 1;
                Axis::new(PlantConfig::worm_axis(home, start).quiet(), seed)
            }),
            wire: Wire::default(),
            trigger: Vec::new(),
            relay: Relay::default(),
            chain_is_cut: false,
            resets: Vec::new(),
            erases: 0,
            power: Vec::new(),
        }
    }

    /// The outputs for drivers and brakes as they are now.
    pub fn see_power(&mut self, enabled: bool, released: bool) {
        let is_known = self.power.last().map(|&(_, e, r)| (e, r)) == Some((enabled, released));
        if !is_known {
            self.power.push((self.now_ns, enabled, released));
            for axis in &mut self.axes {
                axis.can_turn = enabled && released;
            }
        }
    }

    /// A byte on the drivers' SPI, and what comes back: ones where no driver is selected.
    pub fn to_drivers(&mut self, byte: u8) -> u8 {
        let mut back = u8::MAX;
        for axis in &mut self.axes {
            let (Some(heard), true) = (&mut axis.heard, axis.driver.is_some()) else {
                continue;
            };
            back &= axis.answer.get(heard.len()).copied().unwrap_or(u8::MAX);
            heard.push(byte);
        }
        back
    }

    /// Whether the drivers have their current.
    pub fn drivers_are_on(&self) -> bool {
        self.power.last().is_some_and(|&(_, enabled, _)| enabled)
    }

    /// Whether the chain is closed.
    pub fn chain_is_closed(&self) -> bool {
        self.relay.is_closed(self.now_ns) && !self.chain_is_cut
    }

    /// Steps given on both axes, either way.
    pub fn edges(&self) -> [u64; 2] {
        [0, 1].map(|i| self.axes[i].edges)
    }

    /// The true angles, degrees.
    pub fn true_deg(&self) -> [f64; 2] {
        [0, 1].map(|i| self.axes[i].plant.true_udeg(self.now_ns / 1000) * 1e-6)
    }
}
