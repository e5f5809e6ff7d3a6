//! Ranges of parameters, and the free numbers that stand for them: a bounded parameter is a smooth
//! function of an unbounded one, so that least squares need not know of bounds.

use crate::elementary::Elementary;

/// What values a parameter may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Between two bounds, even steps alike.
    Linear(f64, f64),
    /// Between two positive bounds, even ratios alike.
    Logarithmic(f64, f64),
    /// An azimuth in degrees whose half turn is the same again.
    Azimuth,
}

/// Degrees of azimuth that a step of one in the free number makes.
const AZIMUTH_STEP_DEG: f64 = 30.0;
/// Nearer to a bound than this share of the range the derivative would be lost.
const EDGE: f64 = 1e-6;

impl Range {
    /// The parameter of a free number.
    pub fn of_free(self, free: f64) -> f64 {
        match self {
            Range::Azimuth => free * AZIMUTH_STEP_DEG,
            _ => self.at_share(1.0 / (1.0 + (-free).exponential())),
        }
    }

    /// The free number of a parameter; one on a bound or beyond it is brought just inside.
    pub fn to_free(self, value: f64) -> f64 {
        match self {
            Range::Azimuth => value / AZIMUTH_STEP_DEG,
            _ => {
                let share = self.share_of(value).clamp(EDGE, 1.0 - EDGE);
                (share / (1.0 - share)).natural_log()
            }
        }
    }

    /// The parameter at a share, 0 ..= 1, of the range.
    pub fn at_share(self, share: f64) -> f64 {
        match self {
            Range::Linear(low, high) => low + share * (high - low),
            Range::Logarithmic(low, high) => low * (high / low).power(share),
            Range::Azimuth => 180.0 * share,
        }
    }

    fn share_of(self, value: f64) -> f64 {
        match self {
            Range::Linear(low, high) => (value - low) / (high - low),
            Range::Logarithmic(low, high) => {
                (value.max(low) / low).natural_log() / (high / low).natural_log()
            }
            Range::Azimuth => value / 180.0,
        }
    }

    /// Whether a value lies so near to a bound that the bound, not the data, decided on it.
    pub fn is_at_bound(self, value: f64) -> bool {
        let share = self.share_of(value);
        self != Range::Azimuth && !(1e-3..=1.0 - 1e-3).contains(&share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_numbers_and_parameters_stand_for_each_other_within_the_bounds() {
        for range in [Range::Linear(-2.0, 6.0), Range::Logarithmic(0.01, 10.0)] {
            for share in [0.01, 0.3, 0.5, 0.99] {
                let value = range.at_share(share);
                assert!((range.of_free(range.to_free(value)) / value - 1.0).abs() < 1e-9);
            }
            let (low, high) = (range.at_share(0.0), range.at_share(1.0));
            for free in [-1e3, -5.0, 0.0, 7.0, 1e3] {
                assert!((low..=high).contains(&range.of_free(free)));
            }
            assert!(range.to_free(1e9).is_finite() && range.to_free(-1e9).is_finite());
            assert!(range.is_at_bound(low) && !range.is_at_bound(range.at_share(0.5)));
        }
        assert_eq!(Range::Azimuth.of_free(Range::Azimuth.to_free(231.0)), 231.0);
    }
}
