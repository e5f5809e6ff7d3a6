//! The neighbourhoods of the four lines: pixels along runs across each predicted line.

use crate::profile::Growth;
use crate::{IdealLight, luminance};
use gonia_brdf::Elementary;
use gonia_rig::{CameraModel, Frame, Homography, Target};
use std::f64::consts::SQRT_2;
use std::ops::Range;

/// The lines x = −a, x = +a, y = −a, y = +a, in this order everywhere.
pub const SIDES: [Side; 4] = [
    Side {
        axis: 0,
        sign: -1.0,
    },
    Side { axis: 0, sign: 1.0 },
    Side {
        axis: 1,
        sign: -1.0,
    },
    Side { axis: 1, sign: 1.0 },
];

/// More stations on a line than this cost time and bring little.
const MAX_STATIONS: f64 = 256.0;
/// Pixels kept beyond the search range and the line itself, for the fit's own window.
const WINDOW_PX: f64 = 4.0;
/// Pixels beside a pixel that its gradient needs.
const SOBEL_PX: f64 = 1.0;
/// Distance from the ends of a line (the crossings) at which stations begin, pixels.
const CLEAR_OF_CROSSING_PX: f64 = 4.0;

/// So many pixels to either side of a line the light is looked at.
const LIGHT_PX: f64 = 1.5;
/// Light that changes by a larger share a pixel is none that a parabola describes: it stays positive over the
/// pixels of a fit. Likewise over the square of pixels.
const MOST_GROWTH: f64 = 0.15;
const MOST_SQUARE: f64 = 0.02;

/// Places on a line at which its row is looked up, less one.
const PLACES_A_LINE: usize = 8;

/// Which of the four lines: the coordinate that is constant on it, and its sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    pub axis: usize,
    pub sign: f64,
}

impl Side {
    /// The line's ends, where it crosses its neighbours, mm.
    pub fn ends_mm(self, a: f64) -> [[f64; 2]; 2] {
        let mut ends = [[self.sign * a; 2]; 2];
        ends[0][1 - self.axis] = -a;
        ends[1][1 - self.axis] = a;
        ends
    }
}

/// The edges about a line as predicted: outwards of its middle, pixels, as functions offset + slope · s of the
/// place along it. Perspective makes them neither parallel nor symmetric about the middle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Edges {
    /// The line's own edges: towards the material (negative), and away from it.
    pub line: [[f64; 2]; 2],
    /// The material's edge (negative).
    pub material: [f64; 2],
}

impl Edges {
    /// The line's inner and outer edge and the material's edge at a place.
    pub fn at(&self, s: f64) -> [f64; 3] {
        [self.line[0], self.line[1], self.material].map(|[offset, slope]| offset + slope * s)
    }
}

/// One line as predicted, with the pixels around it. Positions are in ideal pixels: `s` runs from
/// −1 to 1 between the crossings, `t` outwards from the predicted line.
pub struct LineStrip {
    from: [f64; 2],
    along: [f64; 2],
    outward: [f64; 2],
    length: f64,
    /// Edges of line and material.
    pub edges: Edges,
    /// Stations in order.
    pub stations: Vec<Station>,
    /// The pixels of all stations' runs.
    pub samples: Vec<RunSample>,
}

/// A run of pixels across the line.
pub struct Station {
    /// Place along the line.
    pub s: f64,
    /// Pixels outwards a millimetre of the target.
    pub px_per_mm: f64,
    /// How the light changes outwards.
    pub light: Growth,
    /// Its samples.
    pub run: std::ops::Range<usize>,
}

/// What is across a line at one of its places.
struct Across {
    px_per_mm: f64,
    light: Growth,
}

/// One pixel of a run.
#[derive(Clone, Copy)]
pub struct RunSample {
    pub s: f32,
    pub t: f32,
    /// Luminance; NaN where the frame has none.
    pub value: f32,
    /// Its place in the frame.
    pub pixel: [u16; 2],
}

/// Runs go down the columns under a flat line (0) and along the rows beside a steep one (1).
fn main_axis(along: [f64; 2]) -> usize {
    usize::from(along[0].abs() < along[1].abs())
}

/// How the light changes outwards that is so strong [`LIGHT_PX`] inwards of a line, on it, and as far outwards.
fn growth([inner, here, outer]: [f64; 3]) -> Growth {
    if inner <= 0.0 || here <= 0.0 || outer <= 0.0 {
        return Growth::default();
    }
    let linear = (outer - inner) / (2.0 * LIGHT_PX * here);
    let square = (outer - 2.0 * here + inner) / (2.0 * LIGHT_PX * LIGHT_PX * here);
    Growth {
        linear: linear.clamp(-MOST_GROWTH, MOST_GROWTH),
        square: square.clamp(-MOST_SQUARE, MOST_SQUARE),
        aside: 0.0,
    }
}

/// How far from a line its strip reaches, when `step` is a millimetre outwards at its middle, pixels.
fn reach_px(target: &Target, step: [f64; 2], search_px: f64) -> f64 {
    // Perspective makes the near end of a line up to half as wide again as its middle.
    let half_line = 0.75 * target.line_width_mm * step[0].hypotenuse(step[1]);
    search_px + half_line + WINDOW_PX
}

/// The rows of a frame that strips `search_px` to either side of the four lines may look at: the strips
/// themselves and all between them.
pub fn rows_of_strips(
    camera: &CameraModel,
    target_to_px: &Homography,
    target: &Target,
    search_px: f64,
) -> Range<usize> {
    let (mut top, mut bottom) = (f64::INFINITY, f64::NEG_INFINITY);
    for side in SIDES {
        let [from, to] = side.ends_mm(target.line_offset_mm);
        let step = target_to_px.jacobian([0, 1].map(|i| 0.5 * (from[i] + to[i])))[side.axis];
        // Runs are cut along rows or columns, at most 45 degrees from the line's normal.
        let margin = SQRT_2 * reach_px(target, step, search_px) + SOBEL_PX + 2.0;
        for k in 0..=PLACES_A_LINE {
            // A lens bends the line between its ends.
            let share = k as f64 / PLACES_A_LINE as f64;
            let at = [0, 1].map(|i| from[i] + share * (to[i] - from[i]));
            let row = camera.distort(target_to_px.apply(at))[1];
            if !(row.is_finite() && margin.is_finite()) {
                return 0..camera.size_px[1];
            }
            top = top.min(row - margin);
            bottom = bottom.max(row + margin);
        }
    }
    let row = |y: f64| (y.max(0.0) as usize).min(camera.size_px[1]);
    row(top)..row(bottom.ceil())
}

impl LineStrip {
    /// Cuts the strip around one line out of a frame, `search_px` to either side. Empty when the
    /// line is outside the frame or seen edge-on.
    pub fn cut(
        frame: &Frame,
        camera: &CameraModel,
        target_to_px: &Homography,
        target: &Target,
        side: Side,
        light: &IdealLight,
        search_px: f64,
    ) -> Self {
        let a = target.line_offset_mm;
        let [from, to] = side.ends_mm(a).map(|end| target_to_px.apply(end));
        let length = (to[0] - from[0]).hypotenuse(to[1] - from[1]);
        let along = [(to[0] - from[0]) / length, (to[1] - from[1]) / length];
        let mut middle = [0.0; 2];
        middle[side.axis] = side.sign * a;
        let step = target_to_px.jacobian(middle)[side.axis].map(|d| d * side.sign);
        let left = [-along[1], along[0]];
        let outward = if left[0] * step[0] + left[1] * step[1] > 0.0 {
            left
        } else {
            left.map(|c| -c)
        };
        let mut strip = Self {
            from,
            along,
            outward,
            length,
            edges: Edges::default(),
            stations: Vec::new(),
            samples: Vec::new(),
        };
        let edge = |mm: f64| {
            let [(s0, t0), (s1, t1)] = side.ends_mm(a).map(|end| {
                let mut at = end;
                at[side.axis] = side.sign * mm;
                strip.place(target_to_px.apply(at))
            });
            let slope = (t1 - t0) / (s1 - s0);
            [t0 - slope * s0, slope]
        };
        let half_width = 0.5 * target.line_width_mm;
        strip.edges = Edges {
            line: [edge(a - half_width), edge(a + half_width)],
            material: edge(target.material_half_mm),
        };
        // Beside the corner of the sample there is nothing between material and desk to go by.
        let reach = (1.0 - 2.0 * CLEAR_OF_CROSSING_PX / length).min(target.material_half_mm / a);
        if let Some(target_from_px) = target_to_px.inverse()
            && length.is_finite()
            && reach > 0.0
        {
            let cross = 1 - main_axis(along);
            // By how far a run goes along the line with each pixel outwards.
            let aside = along[cross] / outward[cross];
            let across = |p: [f64; 2]| {
                let mm = target_from_px.apply(p);
                let d = target_to_px.jacobian(mm)[side.axis];
                let towards = |way: [f64; 2]| {
                    [-LIGHT_PX, 0.0, LIGHT_PX].map(|px| {
                        let at = [0, 1].map(|i| p[i] + px * way[i]);
                        light.irradiance(target_from_px.apply(at))
                    })
                };
                Across {
                    px_per_mm: (d[0] * outward[0] + d[1] * outward[1]).abs(),
                    light: Growth {
                        aside: aside * growth(towards(along)).linear,
                        ..growth(towards(outward))
                    },
                }
            };
            let reach_px = reach_px(target, step, search_px);
            strip.fill(frame, camera, reach_px, reach, across);
        }
        strip
    }

    fn fill(
        &mut self,
        frame: &Frame,
        camera: &CameraModel,
        reach_px: f64,
        reach: f64,
        across: impl Fn([f64; 2]) -> Across,
    ) {
        let main = main_axis(self.along);
        let cross = 1 - main;
        let half = (reach_px / self.outward[cross].abs()).ceil() as i64;
        let extent = self.length * self.along[main].abs() * reach;
        let count = extent.min(MAX_STATIONS).floor() as usize;
        let size = [frame.width as i64, frame.height as i64];
        for i in 0..count {
            let s = reach * ((2 * i + 1) as f64 / count as f64 - 1.0);
            let ideal = self.point(s, 0.0);
            let centre = camera.distort(ideal).map(|c| c.floor() as i64);
            if !(0..size[main]).contains(&centre[main]) {
                continue;
            }
            let start = self.samples.len();
            for k in (centre[cross] - half).max(0)..(centre[cross] + half + 1).min(size[cross]) {
                let mut pixel = centre;
                pixel[cross] = k;
                let [column, row] = pixel.map(|c| c as usize);
                let (s, t) = self.place(camera.undistort(pixel.map(|c| c as f64 + 0.5)));
                self.samples.push(RunSample {
                    s: s as f32,
                    t: t as f32,
                    value: luminance(frame.rgb[row * frame.width + column]),
                    pixel: [column as u16, row as u16],
                });
            }
            if self.samples.len() > start {
                let across = across(ideal);
                self.stations.push(Station {
                    s: self.place(ideal).0,
                    px_per_mm: across.px_per_mm,
                    light: across.light,
                    run: start..self.samples.len(),
                });
            }
        }
    }

    /// The ideal pixel at a place of the strip.
    pub fn point(&self, s: f64, t: f64) -> [f64; 2] {
        let d = 0.5 * (s + 1.0) * self.length;
        [0, 1].map(|i| self.from[i] + d * self.along[i] + t * self.outward[i])
    }

    /// The place (s, t) of an ideal pixel.
    pub fn place(&self, ideal: [f64; 2]) -> (f64, f64) {
        let d = [ideal[0] - self.from[0], ideal[1] - self.from[1]];
        let dot = |axis: [f64; 2]| d[0] * axis[0] + d[1] * axis[1];
        (2.0 * dot(self.along) / self.length - 1.0, dot(self.outward))
    }

    /// Sobel gradient outwards of a sample's pixel; 0 at the border.
    pub fn gradient(&self, frame: &Frame, sample: &RunSample) -> f32 {
        let [column, row] = sample.pixel.map(usize::from);
        let g = sobel(frame, column, row);
        g[0] * self.outward[0] as f32 + g[1] * self.outward[1] as f32
    }

    /// Mean number of pixels outwards a millimetre.
    pub fn px_per_mm(&self) -> f64 {
        let sum: f64 = self.stations.iter().map(|s| s.px_per_mm).sum();
        sum / self.stations.len().max(1) as f64
    }
}

/// The Sobel gradient of luminance per pixel (right, down); zero at the border and beside pixels
/// that are not numbers.
fn sobel(frame: &Frame, column: usize, row: usize) -> [f32; 2] {
    if column == 0 || row == 0 || column + 1 >= frame.width || row + 1 >= frame.height {
        return [0.0; 2];
    }
    let at =
        |dc: usize, dr: usize| luminance(frame.rgb[(row + dr - 1) * frame.width + column + dc - 1]);
    let (nw, ne, sw, se) = (at(0, 0), at(2, 0), at(0, 2), at(2, 2));
    let right = (ne + 2.0 * at(2, 1) + se) - (nw + 2.0 * at(0, 1) + sw);
    let down = (sw + 2.0 * at(1, 2) + se) - (nw + 2.0 * at(1, 0) + ne);
    let g = [right * 0.125, down * 0.125];
    if g[0].is_finite() && g[1].is_finite() {
        g
    } else {
        [0.0; 2]
    }
}
