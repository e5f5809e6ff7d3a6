//! Random fault plans, by a seed.

use gonia_protocol::settings::Axis;
use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::fault::{Arm, Fault, FaultEvent, FaultPlan, WireFaults};

/// How many faults, and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultMix {
    /// Faults happen from here on, µs.
    pub from_us: u64,
    /// And until here, µs.
    pub until_us: u64,
    /// How many that a session recovers from automatically.
    pub recoverable: u32,
    /// How many that it does not recover from: the interlock, an encoder that stays shifted, a jammed switch.
    pub persistent: u32,
}

/// Faults of every kind, on both arms and all axes, and a wire that bends up to one byte in a
/// thousand. The same seed and mix give the same plan.
pub fn random_faults(seed: u64, mix: FaultMix) -> FaultPlan {
    let mut dice = Dice(Xoshiro256PlusPlus::seed_from_u64(seed));
    let mut rate = || dice.between(0.0, 2.5e-4);
    let wire = WireFaults {
        flip: rate(),
        drop: rate(),
        repeat: rate(),
        delay: rate(),
        delay_us: 50_000,
    };
    let mut events = Vec::new();
    for i in 0..mix.recoverable + mix.persistent {
        let fault = if i < mix.recoverable {
            dice.recoverable()
        } else {
            dice.persistent()
        };
        events.push(FaultEvent {
            at_us: dice.between(mix.from_us as f64, mix.until_us as f64) as u64,
            arm: Arm::BOTH[dice.below(2) as usize],
            fault,
        });
    }
    FaultPlan { wire, events }
}

struct Dice(Xoshiro256PlusPlus);

impl Dice {
    fn recoverable(&mut self) -> Fault {
        let axis = self.axis();
        match self.below(10) {
            0 => Fault::LoseCycles {
                axis,
                cycles: (1 + self.below(4) as i32) * self.sign() as i32,
            },
            1 => Fault::Stall {
                axis,
                for_us: self.time_us(0.5, 4.0),
            },
            2 => Fault::Slip {
                axis,
                udeg: self.sign() * self.between(20e3, 200e3),
            },
            3 => Fault::EncoderLost {
                axis,
                for_us: self.time_us(0.001, 1.0),
            },
            4 => Fault::EncoderNoise {
                axis,
                udeg: self.between(2e3, 30e3),
                for_us: self.time_us(0.5, 5.0),
            },
            5 => Fault::SwitchBounces {
                axis,
                bounce_us: self.time_us(0.0, 0.04),
            },
            6 => Fault::Unplugged {
                for_us: self.time_us(0.2, 12.0),
            },
            7 => Fault::BrownOut,
            8 => Fault::TriggerLost {
                pulses: 1 + self.below(3) as u32,
            },
            _ => Fault::TriggerLate {
                by_us: self.time_us(0.0001, 2.0),
            },
        }
    }

    fn persistent(&mut self) -> Fault {
        let axis = self.axis();
        match self.below(3) {
            0 => Fault::InterlockOpen { for_us: 1_000_000 },
            1 => Fault::EncoderJump {
                axis,
                udeg: self.sign() * self.between(40e3, 5e6),
            },
            _ => Fault::SwitchStuck {
                axis,
                at_home: Some(self.below(2) == 0),
            },
        }
    }

    fn axis(&mut self) -> Axis {
        Axis::BOTH[self.below(2) as usize]
    }

    fn sign(&mut self) -> f64 {
        if self.below(2) == 0 { 1.0 } else { -1.0 }
    }

    fn time_us(&mut self, from_s: f64, to_s: f64) -> u64 {
        (self.between(from_s, to_s) * 1e6) as u64
    }

    fn below(&mut self, n: u64) -> u64 {
        self.0.next_u64() % n
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        // 53 bits are what an f64 holds.
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_is_a_day_and_its_faults_lie_within_it() {
        let mix = FaultMix {
            from_us: 1_000,
            until_us: 2_000,
            recoverable: 200,
            persistent: 3,
        };
        let plan = random_faults(4, mix);
        assert_eq!(plan, random_faults(4, mix));
        assert_ne!(plan, random_faults(5, mix));
        assert_eq!(plan.events.len(), 203);
        let within = |e: &FaultEvent| (1_000..2_000).contains(&e.at_us);
        assert!(plan.events.iter().all(within));
    }
}
