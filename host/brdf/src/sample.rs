//! One measured sample.

/// A BRDF value seen at one grid point of one frame. Single-precision degrees, because ten million
/// of these are kept at once and this is their form in files.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Elevation of the light at the point, degrees.
    pub theta_i_deg: f32,
    /// Azimuth of the light at the point, degrees in [0, 360).
    pub phi_i_deg: f32,
    /// Elevation of the view at the point, degrees.
    pub theta_v_deg: f32,
    /// Azimuth of the view at the point, degrees in [0, 360).
    pub phi_v_deg: f32,
    /// Value per channel: 1/sr when the reference's reflectance is known, else relative.
    pub rgb: [f32; 3],
    /// Number of the frame it came from ([`Sample::NO_FRAME`] when unknown).
    pub frame: u32,
}

impl Sample {
    /// Frame number of samples that came without one.
    pub const NO_FRAME: u32 = u32::MAX;
}
