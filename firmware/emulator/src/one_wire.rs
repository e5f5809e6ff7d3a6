//! A TMC2209 at the end of its one wire: bits by their times in, bits at their times out.

use std::collections::VecDeque;

use gonia_firmware::driver::DriverBus;
use gonia_firmware::driver::registers::SLAVECONF;
use gonia_sim::driver_chip::DriverChip;

/// A chip takes its bits from 9000 baud on, so none is longer than this, ns.
const LONGEST_BIT_NS: u64 = 111_111;
/// How far an edge may be off its bit's beginning, parts of a bit: beyond it the chip may read another bit.
const EDGE_TOLERANCE: f64 = 0.2;
/// After so many of its longest bits without an edge a request is over, whole or not: its last byte has at most nine
/// high ones at its end.
const REST_BITS: u64 = 11;
/// In the register's byte: a write, of eight bytes in place of four.
const WRITE: u8 = 0x80;
/// Bits of a byte: start, data, stop.
const FRAME: u64 = 10;

/// A wire, and the chip at its other end.
#[derive(Debug)]
pub struct OneWire {
    /// The chip.
    pub chip: DriverChip,
    /// Edges of the master since the wire rested: time in ns, and whether it rose.
    edges: Vec<(u64, bool)>,
    /// When the request may be whole, ns.
    try_ns: u64,
    /// Levels of the answer, each with the time from which on it holds, ns.
    answer: VecDeque<(u64, bool)>,
    /// The chip pulls the wire low.
    pulls: bool,
    was_high: bool,
    /// Edges further from where they should be than the chip allows, and bytes without an end.
    pub bad_edges: u32,
    /// The furthest that an edge was off, parts of a bit.
    pub worst_edge: f64,
    /// Requests that were read.
    pub requests: u32,
    /// What the master's bits last, ns.
    pub bit_ns: u64,
}

impl OneWire {
    /// A wire at rest.
    pub fn new(chip: DriverChip) -> Self {
        Self {
            chip,
            edges: Vec::new(),
            try_ns: 0,
            answer: VecDeque::new(),
            pulls: false,
            was_high: true,
            bad_edges: 0,
            worst_edge: 0.0,
            requests: 0,
            bit_ns: LONGEST_BIT_NS,
        }
    }

    /// The wire's level as the master makes it, or as it is while the chip answers.
    pub fn see(&mut self, is_high: bool, now_ns: u64) {
        if self.pulls || is_high == self.was_high || self.chip.bus() != DriverBus::OneWire {
            return;
        }
        self.was_high = is_high;
        // Speaking at the same time, both spoil it.
        if !self.answer.is_empty() {
            self.answer.clear();
            self.bad_edges += 1;
        }
        self.edges.push((now_ns, is_high));
        self.try_ns = now_ns + self.bit_ns;
    }

    /// Whether it pulls the wire low.
    pub fn pulls(&self) -> bool {
        self.pulls
    }

    /// When it does something next, ns.
    pub fn due_ns(&self) -> Option<u64> {
        let answer = self.answer.front().map(|&(at, _)| at);
        answer.or_else(|| (!self.edges.is_empty()).then_some(self.try_ns))
    }

    /// Does what is due. Returns whether it pulls the wire low.
    pub fn poll(&mut self, now_ns: u64) -> bool {
        while self.due_ns().is_some_and(|due| due <= now_ns) {
            if let Some((_, is_high)) = self.answer.pop_front() {
                self.pulls = !is_high;
            } else {
                self.try_request(now_ns);
            }
        }
        self.pulls
    }

    /// Reads what has come so far: a request, the beginning of one, or neither.
    fn try_request(&mut self, now_ns: u64) {
        let rest_ns = self.edges.last().map_or(0, |&(at, _)| at) + REST_BITS * LONGEST_BIT_NS;
        let read = self.decode();
        let whole = read.filter(|(bytes, ends_ns)| {
            let is_write = bytes.get(2).is_some_and(|register| register & WRITE != 0);
            *ends_ns <= now_ns && bytes.len() == if is_write { 8 } else { 4 }
        });
        let Some((bytes, ends_ns)) = whole else {
            if now_ns >= rest_ns {
                self.edges.clear();
                self.bad_edges += 1;
            }
            self.try_ns = now_ns + self.bit_ns / 4;
            return;
        };
        self.measure(&bytes);
        self.edges.clear();
        self.requests += 1;
        let Some(answer) = self.chip.one_wire(&bytes) else {
            return;
        };
        // SENDDELAY: 8 bits for 0 and 1, 3 · 8 for 2 and 3, and so on (data sheet, 5.1).
        let delay = self.chip.written(SLAVECONF) >> 8 & 0xF;
        let wait = 8 * u64::from(if delay < 2 { 1 } else { (delay & !1) + 1 });
        let mut at_ns = ends_ns + wait * self.bit_ns;
        for &byte in &answer {
            let bits = [false].into_iter();
            let bits = bits.chain((0..8).map(|bit| byte >> bit & 1 == 1));
            for level in bits.chain([true]) {
                self.answer.push_back((at_ns, level));
                at_ns += self.bit_ns;
            }
        }
    }

    /// The bytes of a request, and when its last stop bit ends.
    fn decode(&mut self) -> Option<(Vec<u8>, u64)> {
        let edges = &self.edges;
        // Synchronisation: 1010 after the start bit, lowest bit first, so the third fall is four bits after the first.
        let falls = edges.iter().filter(|edge| !edge.1);
        let falls: Vec<u64> = falls.map(|edge| edge.0).collect();
        let bit_ns = (falls.get(2)? - falls[0]) / 4;
        if bit_ns == 0 || bit_ns > LONGEST_BIT_NS {
            return None;
        }
        self.bit_ns = bit_ns;
        let level_at = |ns: u64| {
            let before = edges.iter().rev().find(|edge| edge.0 <= ns);
            before.is_none_or(|edge| edge.1)
        };
        let (mut bytes, mut begins) = (Vec::new(), falls[0]);
        loop {
            let middle = |bit: u64| begins + bit * bit_ns + bit_ns / 2;
            if level_at(middle(0)) || !level_at(middle(FRAME - 1)) {
                return None;
            }
            let byte = (0..8).fold(0, |byte, bit| {
                byte | u8::from(level_at(middle(bit + 1))) << bit
            });
            bytes.push(byte);
            let ends = begins + FRAME * bit_ns;
            match falls.iter().find(|&&at| at + bit_ns / 2 >= ends) {
                Some(&next) => begins = next,
                None => return Some((bytes, ends)),
            }
        }
    }

    /// How far each edge of a request is off its bit's beginning; the chip takes every byte from its own start.
    fn measure(&mut self, bytes: &[u8]) {
        let mut edges = self.edges.iter().peekable();
        for _ in bytes {
            let Some(&(start, _)) = edges.next() else {
                break;
            };
            let ends = start + FRAME * self.bit_ns;
            while let Some(&(at, _)) = edges.next_if(|edge| edge.0 + self.bit_ns / 2 < ends) {
                let bits = (at - start) as f64 / self.bit_ns as f64;
                let off = (bits - bits.round()).abs();
                self.worst_edge = self.worst_edge.max(off);
                self.bad_edges += u32::from(off > EDGE_TOLERANCE);
            }
        }
    }
}
