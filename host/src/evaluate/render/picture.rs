//! A picture in linear light.

use crate::evaluate::color::luminance;
use rayon::prelude::*;

/// Radiance and coverage, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Mean radiance of the covered part of each pixel.
    pub rgb: Vec<[f32; 3]>,
    /// Share of each pixel that shows the surface, 0 ..= 1.
    pub cover: Vec<f32>,
}

impl Picture {
    /// Draws `px` × `px` pixels of the square −1 ..= 1, from `side`² points each. `radiance` gives
    /// the radiance at a point (x right, y up), or `None` where there is no surface.
    pub(super) fn draw(
        px: usize,
        side: usize,
        radiance: impl Fn(f64, f64) -> Option<[f64; 3]> + Sync,
    ) -> Self {
        let points = px * side;
        let place = |k: usize| 2.0 * (k as f64 + 0.5) / points as f64 - 1.0;
        let pixel = |at: usize| {
            let (column, row) = (at % px, at / px);
            let mut sum = [0.0; 3];
            let mut hits = 0usize;
            for sub in 0..side * side {
                let x = place(column * side + sub % side);
                let y = -place(row * side + sub / side);
                if let Some(rgb) = radiance(x, y) {
                    hits += 1;
                    for c in 0..3 {
                        sum[c] += rgb[c];
                    }
                }
            }
            let mean = sum.map(|v| (v / hits.max(1) as f64) as f32);
            (mean, hits as f32 / (side * side) as f32)
        };
        let (rgb, cover) = (0..px * px).into_par_iter().map(pixel).unzip();
        Self {
            width: px,
            height: px,
            rgb,
            cover,
        }
    }

    /// The factor that brings a percentile (0 ..= 1) of the covered pixels' luminance to `level`.
    pub fn exposure(&self, percentile: f64, level: f32) -> f32 {
        let covered = self
            .rgb
            .iter()
            .zip(&self.cover)
            .filter(|(_, cover)| **cover > 0.0);
        let mut values: Vec<f32> = covered.map(|(rgb, _)| luminance(*rgb)).collect();
        if values.is_empty() {
            return 1.0;
        }
        let rank = ((values.len() as f64 * percentile) as usize).min(values.len() - 1);
        let value = *values.select_nth_unstable_by(rank, f32::total_cmp).1;
        if value > 0.0 { level / value } else { 1.0 }
    }
}
