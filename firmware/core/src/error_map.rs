//! The encoder's error over a turn, and its removal; the gear's error over a turn of the worm.
//!
//! A ring that sits off its axis by e at radius r reads wrong by e/r once a turn (2.5 µm on a 70 mm
//! ring: 0.004°; 30 µm: 0.05°), a tilted or oval one twice a turn. No reading of the encoder itself
//! shows it. So it is measured against a reference, fitted with two harmonics, and the four
//! amplitudes are settings: E(p) = c₁ cos p + s₁ sin p + c₂ cos 2p + s₂ sin 2p, p the place on the
//! ring. An angle is the reading less E(p) − E(p₀), p₀ being the place of 0°: calibrating does not
//! move the zero.

use gonia_protocol::settings::{Axis, Key};

use crate::settings::ControllerSettings;

/// Fraction bits of [`sine`].
const SINE_BITS: u32 = 30;
/// Intervals of a quarter of the sine. Straight lines between them are off by at most
/// (π/128)²/8 = 8·10⁻⁵ of the amplitude: 0.000004° of 0.05°.
const INTERVALS: usize = 64;
const QUARTER: [i32; INTERVALS + 1] = quarter_of_sine();
/// Bits of a place within a quarter of a turn, and within an interval of it.
const PLACE_BITS: u32 = 30;
const INTERVAL_BITS: u32 = PLACE_BITS - INTERVALS.ilog2();

/// Amplitudes of the error, µdeg.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ErrorMap {
    cos: [i32; 2],
    sin: [i32; 2],
}

impl ErrorMap {
    /// The map in the settings; all zeros where the encoder was never calibrated.
    pub fn new(axis: Axis, settings: &ControllerSettings) -> Self {
        let get = |key| settings.get(axis, key);
        Self {
            cos: [get(Key::EncoderCos1), get(Key::EncoderCos2)],
            sin: [get(Key::EncoderSin1), get(Key::EncoderSin2)],
        }
    }

    /// How much too high the encoder reads at this place on the ring (2³² a turn), µdeg.
    pub fn error_udeg(&self, place: u32) -> i32 {
        let harmonics = (1u32..).zip(self.cos.into_iter().zip(self.sin));
        let terms = harmonics.map(|(n, (cos, sin))| wave(cos, sin, place.wrapping_mul(n)));
        rounded(terms.sum())
    }
}

/// How far the shaft is ahead of the motor: a worm that runs out of true carries it to and fro, once
/// a turn of the worm. It is no error of pointing, as the encoder sits on the shaft; but it is the
/// greater part of what steps and encoder differ by when all is well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GearMap {
    worm_turn_udeg: i64,
    cos: i32,
    sin: i32,
}

impl GearMap {
    /// The map in the settings; nothing where the gear was never calibrated.
    pub fn new(axis: Axis, settings: &ControllerSettings) -> Self {
        let get = |key| settings.get(axis, key);
        Self {
            worm_turn_udeg: i64::from(get(Key::WormTurn)),
            cos: get(Key::GearCos),
            sin: get(Key::GearSin),
        }
    }

    /// How far it is ahead at an angle of the shaft, µdeg.
    pub fn ahead_udeg(&self, shaft_udeg: i64) -> i64 {
        let turned = shaft_udeg.rem_euclid(self.worm_turn_udeg);
        let place = ((turned << 32) / self.worm_turn_udeg) as u32;
        i64::from(rounded(wave(self.cos, self.sin, place)))
    }
}

/// `cos`·cos + `sin`·sin at a place (2³² a period), with [`SINE_BITS`] fraction bits.
fn wave(cos: i32, sin: i32, place: u32) -> i64 {
    i64::from(cos) * i64::from(sine(place.wrapping_add(1 << PLACE_BITS)))
        + i64::from(sin) * i64::from(sine(place))
}

fn rounded(value: i64) -> i32 {
    ((value + (1 << (SINE_BITS - 1))) >> SINE_BITS) as i32
}

/// Sine of 2π · `place` / 2³², with [`SINE_BITS`] fraction bits.
fn sine(place: u32) -> i32 {
    let within = place & ((1 << PLACE_BITS) - 1);
    let is_falling = place >> PLACE_BITS & 1 == 1;
    let within = if is_falling {
        (1 << PLACE_BITS) - within
    } else {
        within
    };
    let (at, rest) = (
        (within >> INTERVAL_BITS) as usize,
        i64::from(within & ((1 << INTERVAL_BITS) - 1)),
    );
    let low = QUARTER[at];
    let high = QUARTER[(at + 1).min(INTERVALS)];
    let value = low + ((i64::from(high - low) * rest) >> INTERVAL_BITS) as i32;
    if place >> 31 == 1 { -value } else { value }
}

/// By the series, when the firmware is built.
const fn quarter_of_sine() -> [i32; INTERVALS + 1] {
    let mut table = [0; INTERVALS + 1];
    let mut i = 0;
    while i <= INTERVALS {
        let x = core::f64::consts::FRAC_PI_2 * i as f64 / INTERVALS as f64;
        let (mut term, mut sum, mut n) = (x, x, 1.0);
        while n < 20.0 {
            term *= -x * x / ((n + 1.0) * (n + 2.0));
            sum += term;
            n += 2.0;
        }
        table[i] = (sum * (1u32 << SINE_BITS) as f64 + 0.5) as i32;
        i += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_map_is_its_two_harmonics_to_a_hundred_thousandth_of_a_degree() {
        let map = ErrorMap {
            cos: [50_000, -7_000],
            sin: [-31_000, 12_345],
        };
        for i in 0..10_000u32 {
            let place = i.wrapping_mul(429_497);
            let p = f64::from(place) * (core::f64::consts::TAU / 4_294_967_296.0);
            let exact = 50_000.0 * cos(p) - 31_000.0 * sin(p) - 7_000.0 * cos(2.0 * p)
                + 12_345.0 * sin(2.0 * p);
            let off = f64::from(map.error_udeg(place)) - exact;
            assert!((-10.0..10.0).contains(&off), "{i}: {off}");
        }
    }

    fn sin(x: f64) -> f64 {
        let x = x - core::f64::consts::TAU * (x / core::f64::consts::TAU) as i64 as f64;
        let (mut term, mut sum) = (x, x);
        for n in (1..60).step_by(2) {
            term *= -x * x / f64::from((n + 1) * (n + 2));
            sum += term;
        }
        sum
    }

    fn cos(x: f64) -> f64 {
        sin(x + core::f64::consts::FRAC_PI_2)
    }

    #[test]
    fn a_gears_error_comes_again_with_every_turn_of_its_worm() {
        let map = GearMap {
            worm_turn_udeg: 4_000_000,
            cos: 1_000,
            sin: -3_000,
        };
        for turn in [-40, -1, 0, 17] {
            let at = |udeg: i64| map.ahead_udeg(turn * 4_000_000 + udeg);
            assert_eq!([at(0), at(1_000_000)], [1_000, -3_000]);
            assert_eq!([at(2_000_000), at(3_000_000)], [-1_000, 3_000]);
        }
    }

    #[test]
    fn no_map_is_no_error() {
        assert_eq!(ErrorMap::default().error_udeg(123_456_789), 0);
    }
}
