//! Bytes under way in one direction.

use std::collections::VecDeque;

use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::fault::WireFaults;

/// Time of a byte at 921,600 baud (ten bits), ns.
const BYTE_NS: u64 = 10_851;

/// One direction of a serial line.
#[derive(Debug)]
pub struct Wire {
    under_way: VecDeque<(u64, u8)>,
    free_ns: u64,
    faults: WireFaults,
    is_clean: bool,
    rng: Xoshiro256PlusPlus,
    unplugged_until_us: u64,
}

impl Wire {
    /// A line with these faults. The same seed gives the same faults.
    pub fn new(faults: WireFaults, seed: u64) -> Self {
        Self {
            under_way: VecDeque::new(),
            free_ns: 0,
            is_clean: faults == WireFaults::default(),
            faults,
            rng: Xoshiro256PlusPlus::seed_from_u64(seed),
            unplugged_until_us: 0,
        }
    }

    /// Puts bytes on the line.
    pub fn send(&mut self, now_us: u64, bytes: &[u8]) {
        self.free_ns = self.free_ns.max(now_us * 1000);
        for &byte in bytes {
            self.free_ns += BYTE_NS;
            if self.is_clean {
                self.put(byte);
            } else {
                self.put_with_faults(byte);
            }
        }
    }

    /// When the next byte arrives, µs.
    pub fn next_us(&self) -> u64 {
        self.under_way.front().map_or(u64::MAX, |&(at, _)| at)
    }

    /// The next byte that has arrived by now.
    pub fn take(&mut self, now_us: u64) -> Option<u8> {
        while self.next_us() <= now_us {
            let (at, byte) = self.under_way.pop_front()?;
            if at >= self.unplugged_until_us {
                return Some(byte);
            }
        }
        None
    }

    /// The cable is out: whatever arrives before then is lost.
    pub fn unplug_until(&mut self, until_us: u64) {
        self.unplugged_until_us = until_us;
    }

    /// Everything under way is lost.
    pub fn clear(&mut self) {
        self.under_way.clear();
    }

    fn put(&mut self, byte: u8) {
        self.under_way
            .push_back((self.free_ns.div_ceil(1000), byte));
    }

    fn put_with_faults(&mut self, mut byte: u8) {
        let faults = self.faults;
        if self.happens(faults.delay) {
            self.free_ns += self.rng.next_u64() % (faults.delay_us * 1000).max(1);
        }
        if self.happens(faults.flip) {
            byte ^= 1 << (self.rng.next_u32() % 8);
        }
        if self.happens(faults.drop) {
            return;
        }
        self.put(byte);
        if self.happens(faults.repeat) {
            self.free_ns += BYTE_NS;
            self.put(byte);
        }
    }

    fn happens(&mut self, probability: f64) -> bool {
        // 53 bits are what an f64 holds.
        (self.rng.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64) < probability
    }
}
