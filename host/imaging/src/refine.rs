//! Sub-pixel fit of the four lines: iteratively reweighted least squares over the stations.

use crate::hough::StripLine;
use crate::lines::{LineStrip, RunSample, Station};
use crate::profile::{LineProfile, StationFit};
use gonia_brdf::Elementary;
use gonia_rig::Target;
use nalgebra::{SMatrix, SVector};

/// Blur that the fit starts from, pixels: a square pixel behind a good lens.
const START_SIGMA_PX: f64 = 0.55;
/// The blur is the frame's, within these.
const SIGMA_RANGE_PX: [f64; 2] = [0.28, 4.0];
/// Standard deviation of ln σ that is believed before looking.
const LN_SIGMA_PRIOR: f64 = 0.5;
/// A station speaks for a line when the line explains this share of what desk and material leave.
const EXPLAINED: f64 = 0.6;
/// Noise level, in units of the median station's, at which a station's weight is halved.
const SOFT_OUTLIER: f64 = 4.0;
/// The smallest share of a line's stations, and their number, that make it found.
const MIN_SHARE: f64 = 0.3;
const MIN_STATIONS: usize = 8;

/// A line that this share of its stations shows at the start needs no other start.
const PLAINLY_THERE: f64 = 0.9;
/// With less than this between line and material the fit has minima beside the right one, pixels.
const CROWDED_PX: f64 = 2.0;
/// Lines closer than this are one, pixels.
const SAME_LINE_PX: f64 = 0.8;
/// By how much more of the stations a line far from the prediction must be supported than one close
/// to it: at grazing views the edge of a bright material resembles a line.
const CLEARLY_BETTER: f64 = 0.2;

/// Four strips with their fitted lines.
pub struct LineFit {
    /// Each line, where it was found.
    pub lines: [Option<FoundLine>; 4],
    /// Standard deviation of the blur, pixels.
    pub sigma_px: f64,
}

/// A line fitted in its strip.
#[derive(Clone, Copy, Debug)]
pub struct FoundLine {
    /// Where it is, relative to the prediction.
    pub line: StripLine,
    /// Information (inverse covariance) on offset and slope, 1/px².
    pub information: [[f64; 2]; 2],
    /// RMS distance of the stations' own placements from the line, pixels.
    pub scatter_px: f64,
}

/// Sums over a line's stations, for the normal equations in (offset, slope, ln σ).
struct LineSums {
    normal: [[f64; 3]; 3],
    right: [f64; 3],
    /// Share and number of stations that show the line.
    share: f64,
    count: usize,
    scatter_px: f64,
    /// Squared residual of the median station, per degree of freedom.
    level: f64,
}

impl LineSums {
    /// Large for lines that few stations show, or that leave much unexplained.
    fn badness(&self) -> f64 {
        if self.share > 0.0 {
            self.level / (self.share * self.share)
        } else {
            f64::INFINITY
        }
    }
}

/// Where to look for the lines.
pub enum Starts {
    /// Where they are predicted.
    Predicted,
    /// There, a pixel to either side, and where Hough found a line.
    Around([Option<StripLine>; 4]),
}

/// Fits the lines of four strips.
pub fn fit_lines(strips: &[LineStrip; 4], starts: &Starts, target: &Target) -> LineFit {
    let starts = [0, 1, 2, 3].map(|i| match starts {
        Starts::Predicted => {
            let line = StripLine::default();
            (line, sum_line(&strips[i], line, START_SIGMA_PX))
        }
        Starts::Around(hough) => best_start(&strips[i], hough[i], target),
    });
    let mut lines = starts.each_ref().map(|start| start.0);
    let mut sums = starts.map(|start| start.1);
    let mut sigma = START_SIGMA_PX;
    for _ in 0..6 {
        let found = sums.each_ref().map(is_found);
        let step = joint_step(&sums, found, sigma);
        let mut largest: f64 = 0.0;
        for i in 0..4 {
            let change = [step[2 * i], step[2 * i + 1]].map(|c| c.clamp(-1.0, 1.0));
            lines[i].offset += change[0];
            lines[i].slope += change[1];
            largest = largest.max(change[0].abs()).max(change[1].abs());
        }
        sigma = (sigma * step[8].clamp(-0.4, 0.4).exponential())
            .clamp(SIGMA_RANGE_PX[0], SIGMA_RANGE_PX[1]);
        sums = [0, 1, 2, 3].map(|i| sum_line(&strips[i], lines[i], sigma));
        if largest < 2e-3 && step[8].abs() < 1e-2 {
            break;
        }
    }
    LineFit {
        lines: [0, 1, 2, 3].map(|i| {
            let sums = &sums[i];
            is_found(sums).then(|| FoundLine {
                line: lines[i],
                information: information(sums),
                scatter_px: sums.scatter_px,
            })
        }),
        sigma_px: sigma,
    }
}

fn is_found(sums: &LineSums) -> bool {
    sums.count >= MIN_STATIONS && sums.share >= MIN_SHARE
}

/// Where to start a line: at its prediction if that shows it plainly, else wherever a few steps
/// with the blur held lead to from starts about the prediction, or from Hough's line if far more
/// speaks for that.
fn best_start(
    strip: &LineStrip,
    hough: Option<StripLine>,
    target: &Target,
) -> (StripLine, LineSums) {
    let predicted = StripLine::default();
    let sums = sum_line(strip, predicted, START_SIGMA_PX);
    let gap = target.line_offset_mm - target.material_half_mm - 0.5 * target.line_width_mm;
    let crowded = gap * strip.px_per_mm() < CROWDED_PX;
    if sums.share > PLAINLY_THERE && !crowded {
        return (predicted, sums);
    }
    let mut near = few_steps(strip, predicted, sums);
    if crowded {
        for offset in [-1.0, 1.0] {
            let start = StripLine { offset, slope: 0.0 };
            let sums = sum_line(strip, start, START_SIGMA_PX);
            let other = few_steps(strip, start, sums);
            if other.1.badness() < near.1.badness() {
                near = other;
            }
        }
    }
    match hough {
        Some(line) if line.distance(near.0) > SAME_LINE_PX => {
            let sums = sum_line(strip, line, START_SIGMA_PX);
            let far = few_steps(strip, line, sums);
            if far.1.share > near.1.share + CLEARLY_BETTER {
                far
            } else {
                near
            }
        }
        _ => near,
    }
}

fn few_steps(strip: &LineStrip, mut line: StripLine, mut sums: LineSums) -> (StripLine, LineSums) {
    for _ in 0..4 {
        let [a, b, c] = [sums.normal[0][0], sums.normal[0][1], sums.normal[1][1]];
        let det = a * c - b * b;
        if det <= 1e-12 * a * c {
            break;
        }
        let step = [
            (c * sums.right[0] - b * sums.right[1]) / det,
            (a * sums.right[1] - b * sums.right[0]) / det,
        ]
        .map(|d| d.clamp(-1.0, 1.0));
        line.offset += step[0];
        line.slope += step[1];
        sums = sum_line(strip, line, START_SIGMA_PX);
        if step[0].abs().max(step[1].abs()) < 0.05 {
            break;
        }
    }
    (line, sums)
}

/// The stations that show a line, each with its fit and its weight, and their common level: the squared
/// residual of the median station, per degree of freedom.
struct Shown<'a> {
    stations: Vec<(&'a Station, StationFit, f64)>,
    level: f64,
}

impl<'a> Shown<'a> {
    /// `None` where no station shows the line.
    fn new(strip: &'a LineStrip, line: StripLine, sigma: f64) -> Option<Self> {
        let shift = |p: &RunSample| line.offset + line.slope * f64::from(p.s);
        let shows =
            |fit: &StationFit| fit.line > 0.0 && fit.gain > EXPLAINED * (fit.gain + fit.rss);
        let mut stations: Vec<(&Station, StationFit, f64)> = strip
            .stations
            .iter()
            .filter_map(|station| {
                let profile = LineProfile {
                    edges: strip.edges,
                    s: station.s,
                    sigma,
                    light: station.light,
                };
                let fit = profile.fit(&strip.samples[station.run.clone()], shift)?;
                shows(&fit).then_some((station, fit, 0.0))
            })
            .collect();
        let mut levels: Vec<f64> = stations
            .iter()
            .map(|(_, fit, _)| fit.rss / fit.freedom)
            .collect();
        if levels.is_empty() {
            return None;
        }
        let middle = levels.len() / 2;
        // A frame without noise still has the model's own error.
        let level = (*levels.select_nth_unstable_by(middle, f64::total_cmp).1).max(1e-20);
        for (_, fit, weight) in &mut stations {
            let excess = fit.rss / fit.freedom / (SOFT_OUTLIER * level);
            *weight = 1.0 / ((1.0 + excess * excess) * level);
        }
        Some(Self { stations, level })
    }
}

fn sum_line(strip: &LineStrip, line: StripLine, sigma: f64) -> LineSums {
    let mut sums = LineSums {
        normal: [[0.0; 3]; 3],
        right: [0.0; 3],
        share: 0.0,
        count: 0,
        scatter_px: 0.0,
        level: 0.0,
    };
    let Some(shown) = Shown::new(strip, line, sigma) else {
        return sums;
    };
    sums.level = shown.level;
    let mut scatter = 0.0;
    for (station, fit, weight) in &shown.stations {
        let along = [1.0, station.s];
        for i in 0..2 {
            for j in 0..2 {
                sums.normal[i][j] += weight * along[i] * along[j] * fit.normal[0];
            }
            sums.normal[i][2] += weight * along[i] * fit.normal[1];
            sums.right[i] += weight * along[i] * fit.right[0];
        }
        sums.normal[2][2] += weight * fit.normal[2];
        sums.right[2] += weight * fit.right[1];
        sums.count += 1;
        scatter += (fit.right[0] / fit.normal[0].max(1e-300)).powi(2).min(1.0);
    }
    for i in 0..2 {
        sums.normal[2][i] = sums.normal[i][2];
    }
    sums.share = sums.count as f64 / strip.stations.len() as f64;
    sums.scatter_px = (scatter / sums.count as f64).sqrt();
    sums
}

/// Where a piece of a line is in its strip.
#[derive(Clone, Copy, Debug)]
pub struct Piece {
    /// Its middle along the line.
    pub s: f64,
    /// How far outwards of the prediction it is, pixels.
    pub t: f64,
    /// Information on t, 1/px².
    pub information: f64,
    /// Pixels outwards a millimetre.
    pub px_per_mm: f64,
}

/// A found line in at most `count` pieces, each placed by its own stations: a lens that is not the one that
/// the strip was cut for bends the line.
pub fn pieces(strip: &LineStrip, line: StripLine, sigma: f64, count: usize) -> Vec<Piece> {
    let Some(shown) = Shown::new(strip, line, sigma) else {
        return Vec::new();
    };
    #[derive(Clone, Copy, Default)]
    struct Sums {
        stations: f64,
        px_per_mm: f64,
        information: f64,
        along: f64,
        step: f64,
    }
    let mut sums = vec![Sums::default(); count];
    for (station, fit, weight) in &shown.stations {
        let place = 0.5 * (station.s + 1.0) * count as f64;
        let sum = &mut sums[(place.max(0.0) as usize).min(count - 1)];
        let information = weight * fit.normal[0];
        sum.stations += 1.0;
        sum.px_per_mm += station.px_per_mm;
        sum.information += information;
        sum.along += information * station.s;
        sum.step += weight * fit.right[0];
    }
    let some = sums.iter().filter(|sum| sum.information > 0.0);
    some.map(|sum| {
        let s = sum.along / sum.information;
        Piece {
            s,
            t: line.offset + line.slope * s + sum.step / sum.information,
            information: sum.information,
            px_per_mm: sum.px_per_mm / sum.stations,
        }
    })
    .collect()
}

/// One step of all lines and of the blur they share.
fn joint_step(sums: &[LineSums; 4], found: [bool; 4], sigma: f64) -> SVector<f64, 9> {
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    let mut right = SVector::<f64, 9>::zeros();
    let prior = LN_SIGMA_PRIOR.powi(-2);
    normal[(8, 8)] = prior;
    right[8] = -prior * (sigma / START_SIGMA_PX).natural_log();
    for (i, line) in sums.iter().enumerate() {
        let at = [2 * i, 2 * i + 1, 8];
        if !found[i] {
            normal[(at[0], at[0])] = 1.0;
            normal[(at[1], at[1])] = 1.0;
            continue;
        }
        for r in 0..3 {
            right[at[r]] += line.right[r];
            for c in 0..3 {
                normal[(at[r], at[c])] += line.normal[r][c];
            }
        }
    }
    normal
        .cholesky()
        .map_or_else(SVector::zeros, |factor| factor.solve(&right))
}

/// What is known of offset and slope when the line's own view of the blur is given up.
fn information(sums: &LineSums) -> [[f64; 2]; 2] {
    let n = &sums.normal;
    let blur = n[2][2] + LN_SIGMA_PRIOR.powi(-2);
    [0, 1].map(|r| [0, 1].map(|c| n[r][c] - n[r][2] * n[c][2] / blur))
}
