//! The light's image in a mirror that lies in the sample's place.

use crate::luminance;
use crate::register::Registration;
use gonia_brdf::Elementary;
use gonia_rig::{Frame, Homography, Target};

/// Points looked at on each fiducial line, for how bright white paint is in this light.
const ON_A_LINE: usize = 40;
/// A lamp's image is brighter than white paint, also in black glass: so many times at least.
const BRIGHTER: f64 = 2.0;
/// The image of a lamp is no larger than this share of the mirror's smaller side, as the frame shows it.
const LARGEST: f64 = 0.3;
/// Closer to the mirror's edge than this its image may be cut, pixels.
const CLEAR_PX: f64 = 2.0;
/// What counts as part of the image: this share of its peak above the mirror's darkness.
const PART: f64 = 0.5;
/// What lies so close to it belongs to it, pixels: its blur, and noise on its edge.
const HALO_PX: i64 = 3;
/// Its middle is known to this, pixels, and to this share of its size: no lamp shines evenly.
const FLOOR_PX: f64 = 0.05;
const SHARE_OF_SIZE: f64 = 0.01;

/// The light's image in a mirror.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Highlight {
    /// Its middle, by its brightness, as the lens shows it.
    pub pixel: [f64; 2],
    /// Standard uncertainty of either coordinate, pixels.
    pub u_px: f64,
}

/// Why a frame of a mirror says nothing of the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoHighlight {
    /// Nothing in the mirror is as bright as a lamp.
    #[error("nothing in the mirror is brighter than the fiducial lines")]
    Dark,
    /// It is not the image of one lamp.
    #[error("there is more than one highlight in the mirror")]
    Several,
    /// It may be cut off.
    #[error("the highlight reaches the edge of the mirror")]
    Cut,
    /// It is larger than a lamp.
    #[error("what is bright in the mirror is no lamp: it fills much of it")]
    Large,
}

/// The rows and columns of some pixels.
#[derive(Clone, Copy, Debug)]
struct Extent {
    low: [i64; 2],
    high: [i64; 2],
}

impl Extent {
    fn of(pixels: &[[i64; 2]]) -> Option<Self> {
        let first = *pixels.first()?;
        let mut extent = Self {
            low: first,
            high: first,
        };
        for pixel in pixels {
            for i in 0..2 {
                extent.low[i] = extent.low[i].min(pixel[i]);
                extent.high[i] = extent.high[i].max(pixel[i]);
            }
        }
        Some(extent)
    }

    fn size(&self) -> i64 {
        1 + (0..2)
            .map(|i| self.high[i] - self.low[i])
            .max()
            .unwrap_or(0)
    }

    /// Whether a pixel lies in it or so close to it.
    fn is_near(&self, pixel: [i64; 2], by: i64) -> bool {
        (0..2).all(|i| (self.low[i] - by..=self.high[i] + by).contains(&pixel[i]))
    }
}

/// A frame with a mirror in it.
struct Mirror<'a> {
    frame: &'a Frame,
    registration: &'a Registration,
    target_from_pixel: Homography,
    half_mm: f64,
}

/// Finds the light's image in a frame whose target shows a mirror in the sample's place. Where the sensor is
/// saturated, the middle of what is saturated counts.
///
/// # Errors
/// There is none, or it is not one lamp's.
pub fn find_highlight(
    frame: &Frame,
    registration: &Registration,
    target: &Target,
) -> Result<Highlight, NoHighlight> {
    let Some(target_from_pixel) = registration.pixel_from_target.inverse() else {
        return Err(NoHighlight::Dark);
    };
    let mirror = Mirror {
        frame,
        registration,
        target_from_pixel,
        half_mm: target.material_half_mm,
    };
    let inside = mirror.pixels();
    let peak = (inside.iter())
        .map(|pixel| mirror.value(*pixel))
        .fold(0.0, f64::max);
    let (dark, white) = (mirror.darkness(&inside), white(frame, registration, target));
    // Saturated all over there is no peak either.
    if peak <= BRIGHTER * white.max(dark) || peak <= 0.0 {
        return Err(NoHighlight::Dark);
    }
    let threshold = match peak.is_finite() {
        true => dark + PART * (peak - dark),
        false => f64::MAX,
    };
    let mut bright: Vec<[i64; 2]> = inside.clone();
    bright.retain(|pixel| mirror.value(*pixel) > threshold);
    let blob = blob(&bright);
    let Some(extent) = Extent::of(&blob) else {
        return Err(NoHighlight::Dark);
    };
    if extent.size() as f64 > LARGEST * mirror.smaller_side_px() {
        return Err(NoHighlight::Large);
    }
    if bright.iter().any(|pixel| !extent.is_near(*pixel, HALO_PX)) {
        return Err(NoHighlight::Several);
    }
    if blob.iter().any(|pixel| mirror.is_at_edge(*pixel)) {
        return Err(NoHighlight::Cut);
    }
    let weight = |pixel: [i64; 2]| match peak.is_finite() {
        true => (mirror.value(pixel).min(peak) - dark).max(0.0),
        false => f64::from(u8::from(mirror.value(pixel) > threshold)),
    };
    let near = inside
        .iter()
        .filter(|pixel| extent.is_near(**pixel, HALO_PX));
    let (mut sum, mut moment) = (0.0, [0.0; 2]);
    for pixel in near {
        let weight = weight(*pixel);
        sum += weight;
        for (moment, c) in moment.iter_mut().zip(pixel) {
            *moment += weight * (*c as f64 + 0.5);
        }
    }
    let of_size = SHARE_OF_SIZE * extent.size() as f64;
    Ok(Highlight {
        pixel: moment.map(|m| m / sum),
        u_px: FLOOR_PX.hypotenuse(of_size),
    })
}

impl Mirror<'_> {
    /// Luminance of a pixel of the frame; none where it is not a number.
    fn value(&self, [x, y]: [i64; 2]) -> f64 {
        let value = luminance(self.frame.rgb[y as usize * self.frame.width + x as usize]);
        if value.is_nan() { 0.0 } else { value.into() }
    }

    /// The pixels that show the mirror.
    fn pixels(&self) -> Vec<[i64; 2]> {
        let corners = self.corners();
        let bound = |i: usize, size: usize| {
            let all = corners.iter().map(|c| c[i]);
            let low = all.clone().fold(f64::INFINITY, f64::min).max(0.0);
            let high = all.fold(f64::NEG_INFINITY, f64::max).min(size as f64);
            low as i64..high.ceil() as i64
        };
        let columns = bound(0, self.frame.width);
        bound(1, self.frame.height)
            .flat_map(|y| columns.clone().map(move |x| [x, y]))
            .filter(|pixel| self.is_mirror(middle(*pixel)))
            .collect()
    }

    fn is_mirror(&self, pixel: [f64; 2]) -> bool {
        let ideal = self.registration.camera().undistort(pixel);
        let at = self.target_from_pixel.apply(ideal);
        at[0].abs().max(at[1].abs()) < self.half_mm
    }

    /// Whether a pixel lies at the edge of the mirror, or of the frame.
    fn is_at_edge(&self, pixel: [i64; 2]) -> bool {
        let [x, y] = middle(pixel);
        let around = [[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]];
        around.iter().any(|[dx, dy]| {
            let there = [x + CLEAR_PX * dx, y + CLEAR_PX * dy];
            let is_frame = (0.0..self.frame.width as f64).contains(&there[0])
                && (0.0..self.frame.height as f64).contains(&there[1]);
            !is_frame || !self.is_mirror(there)
        })
    }

    fn corners(&self) -> [[f64; 2]; 4] {
        let h = self.half_mm;
        [[-h, -h], [h, -h], [h, h], [-h, h]].map(|corner| self.registration.project(corner))
    }

    fn smaller_side_px(&self) -> f64 {
        let c = self.corners();
        (0..4)
            .map(|i| (c[i][0] - c[(i + 1) % 4][0]).hypotenuse(c[i][1] - c[(i + 1) % 4][1]))
            .fold(f64::INFINITY, f64::min)
    }

    /// What the mirror shows aside from the light: the median.
    fn darkness(&self, inside: &[[i64; 2]]) -> f64 {
        let mut values: Vec<f64> = inside.iter().map(|pixel| self.value(*pixel)).collect();
        let middle = values.len() / 2;
        match values.is_empty() {
            true => 0.0,
            false => *values.select_nth_unstable_by(middle, f64::total_cmp).1,
        }
    }
}

fn middle([x, y]: [i64; 2]) -> [f64; 2] {
    [x as f64 + 0.5, y as f64 + 0.5]
}

/// How bright the fiducial lines are: the brighter part of what is seen on them.
fn white(frame: &Frame, registration: &Registration, target: &Target) -> f64 {
    let a = target.line_offset_mm;
    let mut values = Vec::new();
    for k in 0..ON_A_LINE {
        let along = a * (2.0 * (k as f64 + 0.5) / ON_A_LINE as f64 - 1.0);
        for at in [[-a, along], [a, along], [along, -a], [along, a]] {
            let [x, y] = registration.project(at);
            if x >= 0.0 && y >= 0.0 && x < frame.width as f64 && y < frame.height as f64 {
                let value = luminance(frame.rgb[y as usize * frame.width + x as usize]);
                if value.is_finite() {
                    values.push(f64::from(value));
                }
            }
        }
    }
    values.sort_by(f64::total_cmp);
    values.get(values.len() * 9 / 10).copied().unwrap_or(0.0)
}

/// The largest group of pixels that touch each other.
fn blob(pixels: &[[i64; 2]]) -> Vec<[i64; 2]> {
    let mut left: std::collections::BTreeSet<[i64; 2]> = pixels.iter().copied().collect();
    let mut largest = Vec::new();
    while let Some(seed) = left.pop_first() {
        let mut group = vec![seed];
        let mut next = 0;
        while let Some([x, y]) = group.get(next).copied() {
            next += 1;
            for (dx, dy) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))) {
                if left.remove(&[x + dx, y + dy]) {
                    group.push([x + dx, y + dy]);
                }
            }
        }
        if group.len() > largest.len() {
            largest = group;
        }
    }
    largest
}
