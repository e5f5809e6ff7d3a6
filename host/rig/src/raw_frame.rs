//! A raw exposure in memory.

/// Counts of one exposure, row by row from the top left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawFrame {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// 1 for a mono or Bayer sensor, 3 for RGB.
    pub channels: usize,
    /// `width · height · channels` counts, the channels of a pixel together.
    pub counts: Vec<u16>,
}
