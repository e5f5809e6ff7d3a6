//! The orientation mark: whether the target lies as `rig.toml` has it, or turned.
//!
//! Four equal lines look the same after a quarter turn. The mark is one bright disc on the dark desk: of the
//! places that it would have on a turned or mirrored target, the one that is bright says which it is.

use super::Registrar;
use crate::luminance;
use crate::turn::Turn;
use gonia_brdf::{Direction, Elementary};
use gonia_rig::{CameraShift, Frame, Homography, OrientationMark};
use std::f64::consts::TAU;
use std::ops::Range;

/// Points looked at in a mark: rings at these shares of its radius, and how many on each.
const INSIDE: [(f64, usize); 3] = [(0.0, 1), (0.3, 6), (0.6, 10)];
/// Points looked at about it.
const AROUND: usize = 24;
/// How far beyond its edge they lie: this share of its radius, and at least so many pixels.
const BEYOND: f64 = 0.5;
const BEYOND_PX: f64 = 2.0;
/// A fiducial line, or the sample, reaches so far by its blur, pixels.
const BLUR_PX: f64 = 1.5;
/// Fewer points about it than this show nothing of the desk.
const FEWEST_AROUND: usize = 6;
/// A mark is so many times as bright as the desk about it. Lines on the desk, which registration has found by
/// then, are of the same paint.
const BRIGHTER: f64 = 2.0;
/// And stands out by so many times the scatter of the desk.
const CLEAR: f64 = 4.0;
/// Places of a mark closer than this many of its radii are one.
const SAME_RADII: f64 = 2.5;

/// A target turned as the frame shows it, and where a point of it lies then.
type Copy = (Option<Turn>, fn([f64; 2]) -> [f64; 2]);

/// As it should be; turned, as seen from above; mirrored about its four axes.
const COPIES: [Copy; 8] = [
    (None, |[x, y]| [x, y]),
    (Some(Turn::Half), |[x, y]| [-x, -y]),
    // Target and frame have the same sense of rotation: the camera is above.
    (Some(Turn::Left), |[x, y]| [-y, x]),
    (Some(Turn::Right), |[x, y]| [y, -x]),
    (Some(Turn::Mirrored), |[x, y]| [-x, y]),
    (Some(Turn::Mirrored), |[x, y]| [x, -y]),
    (Some(Turn::Mirrored), |[x, y]| [y, x]),
    (Some(Turn::Mirrored), |[x, y]| [-y, -x]),
];

/// How a target lies, as its orientation mark shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Orientation {
    /// As `rig.toml` has it.
    AsDrawn,
    /// Turned, or in a frame that is.
    Turned(Turn),
}

impl Registrar {
    /// How the target lies in a frame of a camera that is known to a pixel or so; `None` without a mark in
    /// `rig.toml`, or where it is not seen.
    pub fn orientation(&self, frame: &Frame, view: Direction) -> Option<Orientation> {
        self.orientation_at(frame, &self.camera.predict(view, CameraShift::default()))
    }

    /// How the target is turned, where its mark shows that it is.
    pub(super) fn target_turned(&self, frame: &Frame, map: &Homography) -> Option<Turn> {
        match self.orientation_at(frame, map) {
            Some(Orientation::Turned(turn)) => Some(turn),
            Some(Orientation::AsDrawn) | None => None,
        }
    }

    fn orientation_at(&self, frame: &Frame, map: &Homography) -> Option<Orientation> {
        let mark = self.target.mark()?;
        let mut seen = places(mark)
            .into_iter()
            .filter(|(_, at)| self.is_mark(frame, map, mark.radius_mm, *at));
        let first = seen.next()?;
        // Bright in two places: something else is.
        if seen.next().is_some() {
            return None;
        }
        Some(first.0.map_or(Orientation::AsDrawn, Orientation::Turned))
    }

    /// The rows that show all places of the mark; `None` without one.
    pub(super) fn rows_of_marks(&self, map: &Homography) -> Option<Range<usize>> {
        let mark = self.target.mark()?;
        let height = self.camera.size_px[1];
        let (mut top, mut bottom) = (f64::INFINITY, f64::NEG_INFINITY);
        for (_, at) in places(mark) {
            let reach = self.around_mm(map, mark.radius_mm, at);
            for corner in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
                let point = [0, 1].map(|i| at[i] + reach * corner[i]);
                let row = self.camera.distort(map.apply(point))[1];
                if !row.is_finite() {
                    return Some(0..height);
                }
                top = top.min(row - 1.0);
                bottom = bottom.max(row + 2.0);
            }
        }
        let row = |y: f64| (y.max(0.0) as usize).min(height);
        Some(row(top)..row(bottom.ceil()))
    }

    /// Distance from a mark's middle at which the desk is looked at, mm.
    fn around_mm(&self, map: &Homography, radius: f64, at: [f64; 2]) -> f64 {
        radius + (BEYOND * radius).max(BEYOND_PX / least_px_per_mm(map, at))
    }

    /// Whether a bright disc of a mark's size lies on the dark desk at a point of the target.
    fn is_mark(&self, frame: &Frame, map: &Homography, radius: f64, at: [f64; 2]) -> bool {
        let value = |point: [f64; 2]| {
            let [x, y] = self.camera.distort(map.apply(point));
            let is_inside =
                x >= 0.0 && y >= 0.0 && x < frame.width as f64 && y < frame.height as f64;
            let place = is_inside.then_some((x as usize, y as usize));
            place.map(|(x, y)| luminance(frame.rgb[y * frame.width + x]))
        };
        let ring = |distance: f64, count: usize| {
            (0..count).map(move |k| {
                let (sine, cosine) = (TAU * k as f64 / count as f64).sine_cosine();
                [at[0] + distance * cosine, at[1] + distance * sine]
            })
        };
        let inside: Option<Vec<f32>> = INSIDE
            .iter()
            .flat_map(|(share, count)| ring(share * radius, *count))
            .map(value)
            .collect();
        // All of it must be in the frame. What is saturated is bright.
        let Some(mut inside) = inside else {
            return false;
        };
        if inside.iter().any(|v| v.is_nan()) {
            return false;
        }
        let blur_mm = BLUR_PX / least_px_per_mm(map, at);
        let mut around: Vec<f32> = ring(self.around_mm(map, radius, at), AROUND)
            .filter(|point| self.is_desk(*point, blur_mm))
            .filter_map(value)
            .filter(|value| value.is_finite())
            .collect();
        if around.len() < FEWEST_AROUND {
            return false;
        }
        around.sort_by(f32::total_cmp);
        inside.sort_by(f32::total_cmp);
        // The dimmer part of the disc against the brighter part of the desk: an edge is no disc.
        let dim = f64::from(inside[inside.len() / 4]);
        let bright = f64::from(around[around.len() * 9 / 10]);
        let middle = f64::from(around[around.len() / 2]);
        dim > BRIGHTER * bright.max(0.0) && dim - middle > CLEAR * (bright - middle)
    }

    /// Whether a point lies on the bare desk, clear of lines and sample by `by_mm`.
    fn is_desk(&self, point: [f64; 2], by_mm: f64) -> bool {
        let target = &self.target;
        let furthest = point[0].abs().max(point[1].abs());
        let is_line =
            |c: f64| (c.abs() - target.line_offset_mm).abs() < 0.5 * target.line_width_mm + by_mm;
        furthest > target.material_half_mm + by_mm && !point.into_iter().any(is_line)
    }
}

/// The places that a mark has on targets that are turned and mirrored, each once.
fn places(mark: OrientationMark) -> Vec<(Option<Turn>, [f64; 2])> {
    let mut places: Vec<(Option<Turn>, [f64; 2])> = Vec::with_capacity(COPIES.len());
    for (turn, of) in COPIES {
        let at = of(mark.at_mm);
        let is_there = |(_, other): &(Option<Turn>, [f64; 2])| {
            (other[0] - at[0]).hypotenuse(other[1] - at[1]) < SAME_RADII * mark.radius_mm
        };
        if !places.iter().any(is_there) {
            places.push((turn, at));
        }
    }
    places
}

/// Pixels a millimetre in the direction in which a millimetre is the fewest.
fn least_px_per_mm(map: &Homography, at: [f64; 2]) -> f64 {
    let [[a, c], [b, d]] = map.jacobian(at);
    // The smaller singular value, by the determinant and the squared norm.
    let (det, norm) = ((a * d - b * c).abs(), a * a + b * b + c * c + d * d);
    let larger = (0.5 * (norm + (norm * norm - 4.0 * det * det).max(0.0).sqrt())).sqrt();
    (det / larger).max(1e-9)
}
