//! A frame in memory.

/// Linear radiance, RGB, row by row from the top left. +∞ marks what was too bright for the sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width · height` pixels.
    pub rgb: Vec<[f32; 3]>,
}
