//! How a near light changes across a fiducial line.

/// Pixels that differ by this share of the brightest are none that nothing falls on, however uneven the light is.
const DIFFERS: f64 = 0.25;

/// Light across a line: 1 + `linear`·τ + `square`·τ² of that in the line's middle, τ pixels outwards.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Growth {
    /// By which share it grows in a pixel.
    pub linear: f64,
    /// By which share over the square of pixels.
    pub square: f64,
    /// A run of pixels is a piece of a row or a column, and goes along the line too where that is oblique: by so
    /// much the light grows with each of its pixels outwards for that.
    pub aside: f64,
}

impl Growth {
    /// At τ, where a run goes straight outwards.
    pub fn at(&self, tau: f64) -> f64 {
        1.0 + tau * (self.linear + tau * self.square)
    }

    /// Whether it is the same everywhere.
    pub fn is_even(&self) -> bool {
        *self == Self::default()
    }

    /// By how much the light differs over a run, at most [`DIFFERS`].
    pub fn over(&self, [inner, outer]: [f64; 2]) -> f64 {
        let at = |tau: f64| self.at(tau) * (1.0 + self.aside * tau);
        (at(outer) - at(inner)).abs().min(DIFFERS)
    }
}
