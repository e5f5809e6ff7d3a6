//! A UART on one wire, for pins that no UART of the chip reaches: eight bits, lowest first, one stop bit, both
//! directions on one open-drain line.
//!
//! A timer calls [`SingleWire::tick`] six times a bit; the line's level goes in, and what to drive comes out. Bytes
//! are received by the edge that begins each and by their bits' middle, so that a tick may come late by a quarter of
//! a bit: 26 µs at 9600 baud, where the interrupts before this one take 3.

use crate::hardware::DriverBytes;

/// Ticks of a bit.
pub const TICKS_A_BIT: u32 = 6;
/// Bits a second. A TMC2209 takes 9000 and more at its own clock of 12 MHz.
pub const BAUD: u32 = 9_600;
/// Ticks a second.
pub const TICK_HZ: u32 = BAUD * TICKS_A_BIT;

/// Bits of rest before anything is sent: after a bad datagram a TMC2209 listens again when the line has rested for
/// twelve (data sheet, 4.1.2).
const REST_BITS: u32 = 12;
/// Bits for which an answer is awaited: the driver lets 24 pass.
const PATIENCE_BITS: u32 = 40;
/// Bits of a byte on the line: start, data, stop.
const FRAME_BITS: u32 = 10;

/// What has come of an exchange.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Exchange {
    /// Nothing was begun, or it has not ended.
    Open,
    /// All that was awaited.
    Done(DriverBytes),
    /// Too little came, or a byte had no end.
    Silent,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Idle,
    /// Nothing is driven, for so many ticks more.
    Rest(u32),
    /// So many ticks of all bytes have been sent.
    Sending(u32),
    /// So many ticks without a byte.
    Listening(u32),
    /// So many ticks since the edge that began a byte, and its bits so far.
    Receiving(u32, u8),
    Ended {
        is_whole: bool,
    },
}

/// One exchange at a time: some bytes out, then some in.
#[derive(Debug)]
pub struct SingleWire {
    out: DriverBytes,
    answer: DriverBytes,
    wanted: usize,
    state: State,
}

impl SingleWire {
    /// A wire at rest.
    pub const fn new() -> Self {
        Self {
            out: DriverBytes::new(),
            answer: DriverBytes::new(),
            wanted: 0,
            state: State::Idle,
        }
    }

    /// Begins an exchange, whatever was under way.
    pub fn begin(&mut self, out: DriverBytes, wanted: usize) {
        self.out = out;
        self.answer.clear();
        self.wanted = wanted;
        self.state = State::Rest(REST_BITS * TICKS_A_BIT);
    }

    /// Whether ticks do anything.
    pub fn is_busy(&self) -> bool {
        !matches!(self.state, State::Idle | State::Ended { .. })
    }

    /// Whether an end is there that was not taken.
    pub fn has_ended(&self) -> bool {
        matches!(self.state, State::Ended { .. })
    }

    /// What has come of it. An end is said once.
    pub fn take(&mut self) -> Exchange {
        let State::Ended { is_whole } = self.state else {
            return Exchange::Open;
        };
        self.state = State::Idle;
        if is_whole {
            Exchange::Done(self.answer.clone())
        } else {
            Exchange::Silent
        }
    }

    /// A sixth of a bit has passed, and the line is high or low. Returns whether to leave it alone; otherwise it is
    /// to be pulled low.
    #[inline]
    pub fn tick(&mut self, is_high: bool) -> bool {
        match self.state {
            State::Idle | State::Ended { .. } => true,
            State::Rest(ticks) => {
                self.state = match ticks {
                    0 | 1 => State::Sending(0),
                    _ => State::Rest(ticks - 1),
                };
                true
            }
            State::Sending(ticks) => self.send(ticks),
            State::Listening(ticks) => {
                self.state = if !is_high {
                    State::Receiving(0, 0)
                } else if ticks >= PATIENCE_BITS * TICKS_A_BIT {
                    State::Ended { is_whole: false }
                } else {
                    State::Listening(ticks + 1)
                };
                true
            }
            State::Receiving(ticks, bits) => {
                self.receive(ticks + 1, bits, is_high);
                true
            }
        }
    }

    fn send(&mut self, ticks: u32) -> bool {
        let (bit, is_last) = (ticks / TICKS_A_BIT, ticks % TICKS_A_BIT == TICKS_A_BIT - 1);
        let Some(&byte) = self.out.get((bit / FRAME_BITS) as usize) else {
            return true;
        };
        let level = match bit % FRAME_BITS {
            0 => false,
            9 => true,
            nth => byte >> (nth - 1) & 1 == 1,
        };
        self.state = if is_last && bit + 1 == FRAME_BITS * self.out.len() as u32 {
            self.await_next()
        } else {
            State::Sending(ticks + 1)
        };
        level
    }

    fn await_next(&self) -> State {
        if self.answer.len() == self.wanted {
            State::Ended { is_whole: true }
        } else {
            State::Listening(0)
        }
    }

    /// So many ticks after the edge was seen, which was there a tick ago at most.
    fn receive(&mut self, ticks: u32, bits: u8, is_high: bool) {
        self.state = State::Receiving(ticks, bits);
        if ticks % TICKS_A_BIT != TICKS_A_BIT / 2 {
            return;
        }
        match ticks / TICKS_A_BIT {
            // Interference is no start.
            0 if is_high => self.state = State::Listening(0),
            0 => {}
            nth @ 1..=8 => {
                let bit = u8::from(is_high) << (nth - 1);
                self.state = State::Receiving(ticks, bits | bit);
            }
            _ => {
                // What does not fit was not asked for.
                let is_kept = is_high && self.answer.push(bits).is_ok();
                self.state = if is_kept {
                    self.await_next()
                } else {
                    State::Ended { is_whole: false }
                };
            }
        }
    }
}

impl Default for SingleWire {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;

    /// Levels of a line that carries bytes, so many ticks each bit, which need not be whole.
    fn line(bytes: &[u8], ticks_a_bit: f64) -> Vec<bool> {
        let mut bits = Vec::new();
        for byte in bytes {
            bits.push(false);
            bits.extend((0..8).map(|bit| byte >> bit & 1 == 1));
            bits.push(true);
        }
        let ticks = (bits.len() as f64 * ticks_a_bit) as usize;
        (0..ticks)
            .map(|tick| bits[(tick as f64 / ticks_a_bit) as usize])
            .collect()
    }

    fn bytes(of: &[u8]) -> DriverBytes {
        of.iter().copied().collect()
    }

    /// Runs an exchange: what was driven, and what came of it.
    fn run(out: &[u8], wanted: usize, answer: &[bool]) -> (Vec<bool>, Exchange) {
        let mut wire = SingleWire::new();
        wire.begin(bytes(out), wanted);
        let (mut driven, mut answer) = (Vec::new(), answer.iter());
        let sent = (REST_BITS + FRAME_BITS * out.len() as u32) * TICKS_A_BIT;
        while wire.is_busy() {
            let level = if driven.len() < sent as usize {
                true
            } else {
                answer.next().copied().unwrap_or(true)
            };
            driven.push(wire.tick(level));
            assert!(driven.len() < 10_000);
        }
        let exchange = wire.take();
        assert_eq!(wire.take(), Exchange::Open);
        (driven, exchange)
    }

    #[test]
    fn bytes_are_sent_after_a_rest_and_the_line_is_left_alone_then() {
        let (driven, exchange) = run(&[0x05, 0xA6], 0, &[]);
        let rest = (REST_BITS * TICKS_A_BIT) as usize;
        assert!(driven[..rest].iter().all(|&high| high));
        assert_eq!(driven[rest..], line(&[0x05, 0xA6], 6.0));
        assert_eq!(exchange, Exchange::Done(bytes(&[])));
    }

    #[test]
    fn an_answer_is_read_whenever_it_comes_and_if_its_baud_is_off_by_two_percent() {
        let answer = [0x05, 0xFF, 0x00, 0x80, 0x55, 0xAA, 0x01, 0x7E];
        for delay in 0..12 {
            for ticks_a_bit in [5.88, 6.0, 6.12] {
                let mut levels = std::vec![true; 24 * 6 + delay];
                levels.extend(line(&answer, ticks_a_bit));
                let (_, exchange) = run(&[0x05], 8, &levels);
                assert_eq!(exchange, Exchange::Done(bytes(&answer)), "{ticks_a_bit}");
            }
        }
    }

    #[test]
    fn no_answer_half_an_answer_and_a_line_held_low_are_silence() {
        let half = line(&[0x05, 0xFF, 0x00], 6.0);
        for levels in [&[][..], &half, &[false; 5000]] {
            let (_, exchange) = run(&[0x05], 8, levels);
            assert_eq!(exchange, Exchange::Silent);
        }
    }

    #[test]
    fn a_spike_is_no_byte() {
        let mut levels = std::vec![true; 20];
        levels.extend([false, true, true, true, true, true, true]);
        levels.extend(line(&[0x42], 6.0));
        let (_, exchange) = run(&[0x05], 1, &levels);
        assert_eq!(exchange, Exchange::Done(bytes(&[0x42])));
    }
}
