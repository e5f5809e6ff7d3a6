//! The encoder's error over a turn, and its removal.
//!
//! A ring that sits off its axis by e at radius r reads wrong by e/r once a turn (2.5 µm on a 70 mm
//! ring: 0.004°; 30 µm: 0.05°), a tilted or oval one twice a turn. No reading of the encoder itself
//! shows it. So it is measured against a reference, fitted with two harmonics, and the four
//! amplitudes are settings: E(p) = c₁ cos p + s₁ sin p + c₂ cos 2p + s₂ sin 2p, p the place on the
//! ring. An angle is the reading less E(p) − E(p₀), p₀ being the place of 0°: calibrating does not
//! move the zero.

use gonia_protocol::settings::{Axis, Key};

use crate::settings::Settings;

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
    pub fn new(axis: Axis, settings: &Settings) -> Self {
        let get = |key| settings.get(axis, key);
        Self {
            cos: [get(Key::EncoderCos1), get(Key::EncoderCos2)],
            sin: [get(Key::EncoderSin1), get(Key::EncoderSin2)],
        }
    }

    /// How much too high the encoder reads at this place on the ring (2³² a turn), µdeg.
    pub fn error_udeg(&self, place: u32) -> i32 {
        let mut sum = 0;
        for (harmonic, (cos, sin)) in (1u32..).zip(self.cos.into_iter().zip(self.sin)) {
            let place = place.wrapping_mul(harmonic);
            sum += i64::from(cos) * i64::from(sine(place.wrapping_add(1 << PLACE_BITS)));
            sum += i64::from(sin) * i64::from(sine(place));
        }
        ((sum + (1 << (SINE_BITS - 1))) >> SINE_BITS) as i32
    }
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
    fn no_map_is_no_error() {
        assert_eq!(ErrorMap::default().error_udeg(123_456_789), 0);
    }
}
