//! Hough transform of one strip: where the bright line is, to about a pixel.

use crate::lines::LineStrip;
use gonia_rig::Frame;

/// A line in a strip: t = offset + slope·s, in pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StripLine {
    pub offset: f64,
    pub slope: f64,
}

impl StripLine {
    /// The larger of the differences in offset and in slope, pixels.
    pub fn distance(self, other: Self) -> f64 {
        (self.offset - other.offset)
            .abs()
            .max((self.slope - other.slope).abs())
    }
}

/// Finds the strongest bright line within `search_px` of the prediction. Every Sobel edge votes,
/// with its sign, for the lines through it; a bright line is where a rise is followed, one line's
/// width further out, by a fall. `resolution` is the size of a bin in half widths of the line (of at
/// least two pixels). Each station has the same say, however brightly it is lit.
pub fn strongest_line(
    frame: &Frame,
    strip: &LineStrip,
    half_width_mm: f64,
    search_px: f64,
    resolution: f64,
) -> Option<StripLine> {
    if strip.stations.is_empty() {
        return None;
    }
    // Sobel's own width keeps the two edges of a hair line about a pixel either side of it.
    let half_width = (half_width_mm * strip.px_per_mm()).max(1.0);
    let bin = resolution * half_width.max(2.0);
    let reach = search_px + half_width;
    let bins = (2.0 * reach / bin).ceil() as usize + 1;
    let max_slope = 0.5 * search_px;
    let slopes = 2 * (max_slope / bin).ceil() as usize + 1;
    let slope_at = |i: usize| (i as f64 - (slopes / 2) as f64) * bin;
    let mut votes = vec![0.0f32; slopes * bins];
    let mut gradients = Vec::new();
    for station in &strip.stations {
        let run = &strip.samples[station.run.clone()];
        gradients.clear();
        gradients.extend(run.iter().map(|sample| strip.gradient(frame, sample)));
        let strongest = gradients.iter().map(|g| g.abs()).fold(0.0, f32::max);
        if strongest <= 0.0 {
            continue;
        }
        for (sample, gradient) in run.iter().zip(&gradients) {
            let weight = gradient / strongest;
            if weight.abs() < 0.1 {
                continue;
            }
            for i in 0..slopes {
                let t = f64::from(sample.t) - slope_at(i) * f64::from(sample.s);
                let b = ((t + reach) / bin).round();
                if b >= 0.0 && (b as usize) < bins {
                    votes[i * bins + b as usize] += weight;
                }
            }
        }
    }
    let apart = (half_width / bin).round().max(1.0) as usize;
    let mut best: Option<(f32, StripLine)> = None;
    for i in 0..slopes {
        let row = &votes[i * bins..(i + 1) * bins];
        for b in apart..bins - apart {
            let score = row[b - apart] - row[b + apart];
            if best.is_none_or(|(s, _)| score > s) {
                let line = StripLine {
                    offset: b as f64 * bin - reach,
                    slope: slope_at(i),
                };
                best = Some((score, line));
            }
        }
    }
    best.map(|(_, line)| line)
}
