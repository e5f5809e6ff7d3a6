//! A picture in linear light.

use super::VIEWER;
use crate::evaluate::color::luminance;
use gonia_brdf::Brdf;
use gonia_brdf::model::shading::{Light, TangentFrame};
use rayon::prelude::*;

/// Points that are shaded together: enough that a table's rows are read once for many of them, few
/// enough that a large picture does not fill the memory.
const POINTS_AT_ONCE: usize = 1 << 20;

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
    /// Draws `width` × `height` pixels, of which both sides run from −1 to 1, from `side`² points each.
    /// `frame_at` gives how the surface lies at a point (x right, y up), or `None` beside it.
    pub(super) fn draw(
        brdf: &dyn Brdf,
        lights: &[Light],
        (width, height): (usize, usize),
        side: usize,
        frame_at: impl Fn(f64, f64) -> Option<TangentFrame> + Sync,
    ) -> Self {
        let place = |k: usize, n: usize| 2.0 * (k as f64 + 0.5) / (n * side) as f64 - 1.0;
        let frame = |point: usize| {
            let (pixel, sub) = (point / (side * side), point % (side * side));
            let (column, row) = (pixel % width, pixel / width);
            let x = place(column * side + sub % side, width);
            let y = -place(row * side + sub / side, height);
            frame_at(x, y)
        };
        let n = width * height;
        let (mut rgb, mut cover) = (Vec::with_capacity(n), Vec::with_capacity(n));
        let band = (POINTS_AT_ONCE / (side * side)).max(1);
        for first in (0..n).step_by(band) {
            let points = first * side * side..n.min(first + band) * side * side;
            let frames: Vec<Option<TangentFrame>> = points.into_par_iter().map(frame).collect();
            let seen: Vec<TangentFrame> = frames.iter().copied().flatten().collect();
            let mut shaded = brdf.shade(&seen, lights, VIEWER).into_iter();
            for pixel in frames.chunks_exact(side * side) {
                let hits = pixel.iter().flatten().count();
                let mut sum = [0.0f32; 3];
                for radiance in shaded.by_ref().take(hits) {
                    for c in 0..3 {
                        sum[c] += radiance[c];
                    }
                }
                rgb.push(sum.map(|v| v / hits.max(1) as f32));
                cover.push(hits as f32 / (side * side) as f32);
            }
        }
        Self {
            width,
            height,
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

    /// A picture of one point a pixel with its outline smoothed: cheaper than four points everywhere.
    #[must_use]
    pub fn with_smooth_outline(&self) -> Self {
        let (w, h) = (self.width, self.height);
        let mut smooth = self.clone();
        let inside = |x: usize, y: usize| self.cover[y * w + x] > 0.0;
        for y in 1..h - 1 {
            for x in 1..w - 1 {
                let block = (0..9).map(|k| (x + k % 3 - 1, y + k / 3 - 1));
                let near: Vec<[f32; 3]> = block
                    .filter(|(x, y)| inside(*x, *y))
                    .map(|(x, y)| self.rgb[y * w + x])
                    .collect();
                if near.is_empty() || near.len() == 9 {
                    continue;
                }
                let at = y * w + x;
                smooth.cover[at] = near.len() as f32 / 9.0;
                if !inside(x, y) {
                    // The colour beyond the outline is that of the darkest point next to it.
                    let darkest = near
                        .iter()
                        .copied()
                        .min_by(|a, b| luminance(*a).total_cmp(&luminance(*b)));
                    smooth.rgb[at] = darkest.unwrap_or_default();
                }
            }
        }
        smooth
    }
}
