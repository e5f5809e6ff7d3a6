//! One measured sample.

use crate::direction::Direction;

/// A BRDF value of `N` channels seen at one grid point of one frame. Single-precision degrees, because ten million
/// of these are kept at once and this is their form in files.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample<const N: usize = 3> {
    /// Polar angle of the light at the point, degrees.
    pub theta_i_deg: f32,
    /// Azimuth of the light at the point, degrees in [0, 360).
    pub phi_i_deg: f32,
    /// Polar angle of the view at the point, degrees.
    pub theta_v_deg: f32,
    /// Azimuth of the view at the point, degrees in [0, 360).
    pub phi_v_deg: f32,
    /// Value per channel, red, green and blue or what else they are: 1/sr when the reference's reflectance is known, else relative.
    pub rgb: [f32; N],
    /// Number of the frame it came from ([`Sample::NO_FRAME`] when unknown).
    pub frame: u32,
}

impl Sample {
    /// Frame number of samples that came without one, of any number of channels.
    pub const NO_FRAME: u32 = u32::MAX;
}

impl<const N: usize> Sample<N> {
    /// A value seen from `view` under a light from `light`, of no frame.
    pub fn new(light: Direction, view: Direction, rgb: [f32; N]) -> Self {
        Self {
            theta_i_deg: light.theta_deg() as f32,
            phi_i_deg: phi_deg(light),
            theta_v_deg: view.theta_deg() as f32,
            phi_v_deg: phi_deg(view),
            rgb,
            frame: Sample::NO_FRAME,
        }
    }

    /// The same place and frame with other values.
    #[must_use]
    pub fn with_values<const M: usize>(&self, values: [f32; M]) -> Sample<M> {
        Sample {
            theta_i_deg: self.theta_i_deg,
            phi_i_deg: self.phi_i_deg,
            theta_v_deg: self.theta_v_deg,
            phi_v_deg: self.phi_v_deg,
            rgb: values,
            frame: self.frame,
        }
    }

    /// The same of a frame. Cross-validation and error bars group samples by their frames.
    #[must_use]
    pub fn in_frame(self, frame: u32) -> Self {
        Self { frame, ..self }
    }
}

/// φ in [0, 360) in single precision too, where 359.99999 rounds to 360.
fn phi_deg(direction: Direction) -> f32 {
    let phi = direction.phi_deg() as f32;
    if phi >= 360.0 { 0.0 } else { phi }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_azimuth_just_below_a_turn_is_none_and_not_a_whole_one() {
        let light = Direction::from_deg(30.0, 359.999_999_9);
        let sample = Sample::new(light, light, [1.0; 3]);
        assert_eq!((sample.phi_i_deg, sample.phi_v_deg), (0.0, 0.0));
    }
}
