//! What hides the target: Otsu's threshold on the reference's frame, where it makes sense.

use crate::ideal_light::IdealLight;
use crate::luminance;
use crate::register::Registration;
use gonia_brdf::Direction;
use gonia_brdf::Elementary;
use gonia_rig::{Frame, Rig};

/// The hidden parts of a frame: a bitmap of the smallest rectangle that holds them, one bit for a
/// cell of one pixel, or of several a side in large frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    cell: usize,
    left: usize,
    top: usize,
    width: usize,
    height: usize,
    words: Vec<u64>,
}

impl Mask {
    /// Whether a pixel is hidden.
    pub fn hides(&self, column: usize, row: usize) -> bool {
        let (x, y) = (
            (column / self.cell).wrapping_sub(self.left),
            (row / self.cell).wrapping_sub(self.top),
        );
        if x >= self.width || y >= self.height {
            return false;
        }
        let bit = y * self.width + x;
        self.words[bit / 64] >> (bit % 64) & 1 == 1
    }

    /// Whether one of a row's pixels is hidden.
    pub fn hides_any(&self, columns: &std::ops::Range<usize>, row: usize) -> bool {
        let y = (row / self.cell).wrapping_sub(self.top);
        if y >= self.height || columns.is_empty() {
            return false;
        }
        let first = (columns.start / self.cell).max(self.left);
        let last = ((columns.end - 1) / self.cell).min(self.left + self.width - 1);
        (first..=last).any(|x| {
            let bit = y * self.width + x - self.left;
            self.words[bit / 64] >> (bit % 64) & 1 == 1
        })
    }

    /// The mask as bytes, for a file: cell, left, top, width, height, and the bitmap's words.
    pub fn to_bytes(&self) -> Vec<u8> {
        let numbers = [self.cell, self.left, self.top, self.width, self.height];
        let head = numbers.iter().flat_map(|n| (*n as u32).to_le_bytes());
        head.chain(self.words.iter().flat_map(|w| w.to_le_bytes()))
            .collect()
    }

    /// The mask of [`Self::to_bytes`]; `None` when the bytes are no mask.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (head, words) = bytes.split_at_checked(20)?;
        let mut numbers = [0; 5];
        for (number, bytes) in numbers.iter_mut().zip(head.as_chunks::<4>().0) {
            *number = u32::from_le_bytes(*bytes) as usize;
        }
        let [cell, left, top, width, height] = numbers;
        let (words, rest) = words.as_chunks::<8>();
        let whole = cell > 0
            && width.checked_mul(height)? > 0
            && rest.is_empty()
            && words.len() == (width * height).div_ceil(64);
        whole.then(|| Self {
            cell,
            left,
            top,
            width,
            height,
            words: words.iter().map(|w| u64::from_le_bytes(*w)).collect(),
        })
    }

    /// Number of hidden cells.
    pub fn count(&self) -> usize {
        self.words.iter().map(|w| w.count_ones() as usize).sum()
    }

    /// Memory of the bitmap, bytes.
    pub fn bytes(&self) -> usize {
        self.words.len() * 8
    }

    /// A mask of the cells within `margin` (in both axes) of the given ones; `None` without any.
    fn grown(cells: &[[u32; 2]], margin: usize, size: [usize; 2], cell: usize) -> Option<Self> {
        let low = |i: usize| cells.iter().map(|p| p[i] as usize).min();
        let high = |i: usize| cells.iter().map(|p| p[i] as usize).max();
        let (left, top) = (
            low(0)?.saturating_sub(margin),
            low(1)?.saturating_sub(margin),
        );
        let right = (high(0)? + margin + 1).min(size[0]);
        let bottom = (high(1)? + margin + 1).min(size[1]);
        let (width, height) = (right - left, bottom - top);
        let mut mask = Self {
            cell,
            left,
            top,
            width,
            height,
            words: vec![0; (width * height).div_ceil(64)],
        };
        for [x, y] in cells {
            let (x, y) = (*x as usize - left, *y as usize - top);
            let columns = x.saturating_sub(margin)..(x + margin + 1).min(width);
            for row in y.saturating_sub(margin)..(y + margin + 1).min(height) {
                for column in columns.clone() {
                    let bit = row * width + column;
                    mask.words[bit / 64] |= 1 << (bit % 64);
                }
            }
        }
        Some(mask)
    }
}

/// Mean of what is hidden over mean of what is not, at most, after dividing by an ideal light: a
/// head in front of the target is lit only by what the target scatters.
const DARKEST_RATIO: f64 = 0.2;
/// Pixels about the threshold, as a share of the smaller class, at most: an edge is narrow, while
/// shading and highlights run through all levels.
const VALLEY_SHARE: f64 = 0.5;
/// Levels about the threshold that count as the valley, relative to it.
const VALLEY: [f64; 2] = [0.6, 1.4];
/// A second threshold, relative to the median, for what is too small for Otsu to see.
const SMALL_THRESHOLD: f64 = 0.25;
/// Growth of the mask for blur and penumbra: this share of the frame's width, at least 2 pixels.
const MARGIN_WIDTHS: f64 = 0.005;
/// Frames wider than twice this are looked at in cells of several pixels.
const CELLS_A_ROW: usize = 400;
/// Distance from the material's edge at which cells are clear of it, pixels.
const EDGE_PX: f64 = 3.0;
/// Cells this far either side of an edge ...
const STEP_CELLS: usize = 3;
/// ... are on a step when one has less than this share of the other's light.
const STEP_RATIO: f32 = 0.25;
const LEVELS: usize = 256;

/// The mask of what hides the material in a frame of the reference, or `None` when nothing does.
///
/// Otsu's method always finds a threshold; it is believed only when the two classes it makes are
/// those of an occlusion: the dark one far darker than an ideal light explains, hardly a pixel
/// between them, and a step wherever they meet.
pub fn find_occlusion(
    frame: &Frame,
    registration: &Registration,
    light: Direction,
    rig: &Rig,
) -> Option<Mask> {
    let cells = Cells::of_material(frame, registration, light, rig)?;
    let mut sorted: Vec<f32> = cells.present().collect();
    if sorted.is_empty() {
        return None;
    }
    let middle = sorted.len() / 2;
    let median = f64::from(*sorted.select_nth_unstable_by(middle, f32::total_cmp).1);
    // With half of the material hidden the median says little, but the brightest still do.
    let top = sorted.len() - 1 - sorted.len() / 50;
    let bright = f64::from(*sorted.select_nth_unstable_by(top, f32::total_cmp).1);
    if bright.is_nan() || bright <= 0.0 {
        return None;
    }
    let histogram = histogram(&sorted, bright);
    let otsu = otsu_level(&histogram) as f64 * bright / LEVELS as f64;
    let threshold = [otsu, SMALL_THRESHOLD * median.max(0.3 * bright)]
        .into_iter()
        .find(|t| is_split(&sorted, *t) && cells.is_stepped(*t as f32))? as f32;
    let hidden: Vec<[u32; 2]> = cells.below(threshold).collect();
    let margin = ((MARGIN_WIDTHS * frame.width as f64 / cells.side as f64).ceil() as usize).max(2);
    let size = [frame.width, frame.height].map(|n| n.div_ceil(cells.side));
    Mask::grown(&hidden, margin, size, cells.side)
}

/// Luminance over an ideal light's, by cells of the frame, each by the pixel in its middle.
struct Cells {
    /// Side of a cell, pixels: what hides the target is far larger than a pixel of a large frame.
    side: usize,
    left: usize,
    top: usize,
    width: usize,
    height: usize,
    /// Row by row; NaN off the material.
    values: Vec<f32>,
}

impl Cells {
    /// The material's cells; `None` when none is in the frame.
    fn of_material(
        frame: &Frame,
        registration: &Registration,
        light: Direction,
        rig: &Rig,
    ) -> Option<Self> {
        let target_from_pixel = registration.pixel_from_target.inverse()?;
        // Pixels on the material's edge are part desk.
        let jacobian = registration.pixel_from_target.jacobian([0.0; 2]);
        let inset = jacobian.map(|column| {
            rig.target.material_half_mm - EDGE_PX / column[0].hypotenuse(column[1]).max(1e-6)
        });
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|c: [f64; 2]| registration.project([c[0] * inset[0], c[1] * inset[1]]));
        let side = (frame.width / CELLS_A_ROW).max(1);
        let range = |axis: usize, size: usize| {
            let low = corners
                .iter()
                .map(|c| c[axis])
                .fold(f64::INFINITY, f64::min);
            let high = corners.iter().map(|c| c[axis]).fold(0.0, f64::max);
            let whole = size / side;
            let first = (low.max(0.0) as usize / side).min(whole);
            first..(high as usize / side + 1).clamp(first, whole)
        };
        let (columns, rows) = (range(0, frame.width), range(1, frame.height));
        let ideal_light = IdealLight::new(rig, light);
        let mut values = Vec::with_capacity(columns.len() * rows.len());
        for y in rows.clone() {
            for x in columns.clone() {
                let [column, row] = [x, y].map(|i| i * side + side / 2);
                let pixel = [column as f64 + 0.5, row as f64 + 0.5];
                let at = target_from_pixel.apply(registration.camera().undistort(pixel));
                let inside = at[0].abs() <= inset[0] && at[1].abs() <= inset[1];
                values.push(if inside {
                    luminance(frame.rgb[row * frame.width + column])
                        / ideal_light.irradiance(at) as f32
                } else {
                    f32::NAN
                });
            }
        }
        (!values.is_empty()).then_some(Self {
            side,
            left: columns.start,
            top: rows.start,
            width: columns.len(),
            height: rows.len(),
            values,
        })
    }

    fn present(&self) -> impl Iterator<Item = f32> {
        self.values.iter().copied().filter(|v| v.is_finite())
    }

    /// The cells darker than a threshold, by column and row of the frame's cells.
    fn below(&self, threshold: f32) -> impl Iterator<Item = [u32; 2]> {
        let dark = move |(i, v): (usize, &f32)| (*v < threshold).then_some(i);
        self.values.iter().enumerate().filter_map(dark).map(|i| {
            [
                (self.left + i % self.width) as u32,
                (self.top + i / self.width) as u32,
            ]
        })
    }

    /// Whether dark and bright meet in a step, as at the edge of a body: a few cells either side of
    /// it differ by much. Highlights and shadows of shape are slopes.
    fn is_stepped(&self, threshold: f32) -> bool {
        let (mut steps, mut slopes) = (0u32, 0u32);
        let mut look = |a: usize, b: usize, before: usize, after: usize| {
            if (self.values[a] < threshold) == (self.values[b] < threshold) {
                return;
            }
            let (x, y) = (self.values[before], self.values[after]);
            if x.is_finite() && y.is_finite() {
                let is_step = x.min(y) < STEP_RATIO * x.max(y);
                *if is_step { &mut steps } else { &mut slopes } += 1;
            }
        };
        let n = STEP_CELLS;
        for y in 0..self.height {
            for x in 0..self.width {
                let at = y * self.width + x;
                if !self.values[at].is_finite() {
                    continue;
                }
                if x >= n && x + n + 1 < self.width && self.values[at + 1].is_finite() {
                    look(at, at + 1, at - n, at + 1 + n);
                }
                let next = at + self.width;
                if y >= n && y + n + 1 < self.height && self.values[next].is_finite() {
                    look(at, next, at - n * self.width, next + n * self.width);
                }
            }
        }
        steps > slopes
    }
}

fn histogram(values: &[f32], bright: f64) -> [u32; LEVELS] {
    let scale = (LEVELS as f64 / bright) as f32;
    let mut histogram = [0; LEVELS];
    for value in values {
        histogram[((value * scale).max(0.0) as usize).min(LEVELS - 1)] += 1;
    }
    histogram
}

/// Otsu's level: the first of the upper class, for the largest variance between the classes.
fn otsu_level(histogram: &[u32; LEVELS]) -> usize {
    let total: f64 = histogram.iter().map(|n| f64::from(*n)).sum();
    let moment: f64 = (0..LEVELS)
        .map(|i| i as f64 * f64::from(histogram[i]))
        .sum();
    let (mut below, mut below_moment) = (0.0, 0.0);
    let (mut best, mut best_level) = (0.0, 0);
    for (i, n) in histogram.iter().enumerate() {
        let above = total - below;
        if below > 0.0 && above > 0.0 {
            let apart = below_moment / below - (moment - below_moment) / above;
            let between = below * above * apart * apart;
            // Across an empty valley all levels are as good: the middle of it is wanted.
            if between > best * (1.0 + 1e-9) {
                (best, best_level) = (between, i);
            }
        }
        below += f64::from(*n);
        below_moment += i as f64 * f64::from(*n);
    }
    let empty = histogram[best_level..].iter().take_while(|n| **n == 0);
    best_level + empty.count() / 2
}

/// Whether a threshold parts two classes as an occlusion does.
fn is_split(values: &[f32], threshold: f64) -> bool {
    let (mut dark, mut bright) = ((0u32, 0.0), (0u32, 0.0));
    let mut between = 0u32;
    for value in values {
        let value = f64::from(*value);
        let class = if value < threshold {
            &mut dark
        } else {
            &mut bright
        };
        class.0 += 1;
        class.1 += value;
        let relative = value / threshold;
        between += u32::from(relative > VALLEY[0] && relative < VALLEY[1]);
    }
    dark.0 > 0
        && bright.0 > 0
        && dark.1 / f64::from(dark.0) < DARKEST_RATIO * bright.1 / f64::from(bright.0)
        && f64::from(between) <= VALLEY_SHARE * f64::from(dark.0.min(bright.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_hides_what_was_marked_and_its_margin() {
        let mask = Mask::grown(&[[5, 5], [6, 5]], 2, [20, 20], 1).unwrap();
        assert!(mask.hides(3, 3) && mask.hides(8, 7));
        assert!(!mask.hides(9, 5) && !mask.hides(5, 8) && !mask.hides(2, 5));
        assert_eq!(mask.count(), 6 * 5);
        let corner = Mask::grown(&[[0, 19]], 2, [20, 20], 1).unwrap();
        assert!(corner.hides(0, 19) && corner.hides(2, 17) && !corner.hides(0, 16));
        assert!(Mask::grown(&[], 2, [20, 20], 1).is_none());
    }

    #[test]
    fn a_mask_comes_back_from_its_bytes_and_from_no_others() {
        let mask = Mask::grown(&[[5, 5], [90, 40]], 2, [200, 100], 3).unwrap();
        let bytes = mask.to_bytes();
        assert_eq!(Mask::from_bytes(&bytes), Some(mask));
        for n in 0..bytes.len() {
            assert_eq!(Mask::from_bytes(&bytes[..n]), None);
        }
        assert_eq!(Mask::from_bytes(&[0; 28]), None);
    }

    #[test]
    fn a_row_is_hidden_where_one_of_its_pixels_is() {
        let mask = Mask::grown(&[[5, 5], [12, 9]], 1, [20, 20], 2).unwrap();
        for row in 0..40 {
            for (first, end) in [(0, 7), (3, 9), (8, 20), (14, 21), (22, 40), (30, 30)] {
                let any = (first..end).any(|column| mask.hides(column, row));
                assert_eq!(
                    mask.hides_any(&(first..end), row),
                    any,
                    "{row} {first} {end}"
                );
            }
        }
    }

    #[test]
    fn otsu_splits_two_heaps_between_them() {
        let mut histogram = [0; LEVELS];
        for i in 0..5 {
            histogram[3 + i] = 40;
            histogram[180 + i] = 300;
        }
        assert!((9..=180).contains(&otsu_level(&histogram)));
    }

    #[test]
    fn shading_through_all_levels_is_no_occlusion() {
        let ramp: Vec<f32> = (0..1000).map(|i| 0.02 + i as f32 * 1e-3).collect();
        assert!(!is_split(&ramp, 0.3));
        let step: Vec<f32> = (0..1000)
            .map(|i| if i < 100 { 0.015 } else { 1.0 })
            .collect();
        assert!(is_split(&step, 0.3));
    }

    #[test]
    fn a_slope_is_no_step() {
        let cells = |value: &dyn Fn(usize) -> f32| Cells {
            side: 1,
            left: 0,
            top: 0,
            width: 40,
            height: 40,
            values: (0..1600).map(|i| value(i % 40)).collect(),
        };
        assert!(cells(&|x| if x < 20 { 0.02 } else { 1.0 }).is_stepped(0.3));
        assert!(!cells(&|x| 0.02 + 0.03 * x as f32).is_stepped(0.3));
    }
}
