//! Hough transform of one strip: where the bright line is, to about a pixel.

use crate::lines::LineStrip;
use gonia_rig::Frame;

/// What makes a bright line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineEdges {
    /// A rise and a fall, strong together: one of them may be hidden or weak.
    Together,
    /// Where a gap of desk is seen between material and line, both: the material's edge is a fall as strong as both
    /// of a thin line's together.
    Both,
}

/// So much desk between material and line is seen as a gap, pixels.
const SEEN_GAP_PX: f64 = 2.0;

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
/// width further out, by a fall, as `edges` says. `resolution` is the size of a bin in half widths of the line (of at
/// least two pixels). Each station has the same say, however brightly it is lit.
pub fn strongest_line(
    frame: &Frame,
    strip: &LineStrip,
    half_width_mm: f64,
    search_px: f64,
    resolution: f64,
    edges: LineEdges,
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
    let gap_px = strip.edges.line[0][0] - strip.edges.material[0];
    let wants_both = edges == LineEdges::Both && gap_px > SEEN_GAP_PX;
    let score_of = |rise: f32, fall: f32| match wants_both {
        true => rise.min(fall),
        false => rise + fall,
    };
    let mut best: Option<(f32, StripLine)> = None;
    for i in 0..slopes {
        let row = &votes[i * bins..(i + 1) * bins];
        for b in apart..bins - apart {
            let score = score_of(row[b - apart], -row[b + apart]);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::IdealLight;
    use crate::lines::SIDES;
    use gonia_brdf::Pose;
    use gonia_rig::{CameraModel, CameraShift, Frame, Rig};

    #[test]
    fn the_edge_of_a_bright_material_is_not_taken_for_a_line() {
        // A line 0.7 pixels thick with 2.3 pixels of desk between it and the material, 8 pixels from its prediction.
        const OFF_PX: f64 = 8.0;
        let rig = Rig::paper(200);
        let (camera, target) = (CameraModel::new(&rig), &rig.target);
        let pose = Pose::from_deg([30.0, 0.0, 0.0, 0.0]);
        let seen = camera.predict(pose.view, CameraShift::default());
        let target_from_pixel = seen.inverse().unwrap();
        let brightness = |pixel: [f64; 2]| {
            let at = target_from_pixel.apply([pixel[0] - OFF_PX, pixel[1]]);
            let half_width = 0.5 * target.line_width_mm;
            let is_line = |x: f64| (x.abs() - target.line_offset_mm).abs() < half_width;
            let is_material = at.iter().all(|x| x.abs() < target.material_half_mm);
            match is_material || is_line(at[0]) || is_line(at[1]) {
                true => 0.9,
                false => 0.02,
            }
        };
        let mut frame = Frame {
            width: 200,
            height: 200,
            rgb: vec![[0.0; 3]; 200 * 200],
        };
        for (i, rgb) in frame.rgb.iter_mut().enumerate() {
            let (column, row) = ((i % 200) as f64, (i / 200) as f64);
            let parts = (0..64).map(|k| {
                let part = [k % 8, k / 8].map(|k| (f64::from(k) + 0.5) / 8.0);
                brightness([column + part[0], row + part[1]])
            });
            *rgb = [(parts.sum::<f64>() / 64.0) as f32; 3];
        }
        let light = IdealLight::new(&rig, pose.light);
        // The lines that run down the frame: the camera's right is the target's y.
        for side in [SIDES[2], SIDES[3]] {
            let strip = LineStrip::cut(&frame, &camera, &seen, target, side, &light, 30.0);
            let half_width = 0.5 * target.line_width_mm;
            let line = strongest_line(&frame, &strip, half_width, 30.0, 0.5, LineEdges::Both);
            let line = line.unwrap();
            let expected = side.sign * OFF_PX;
            assert!(
                (line.offset - expected).abs() <= 1.0 && line.slope.abs() <= 1.0,
                "{side:?}: {line:?}"
            );
        }
    }
}
