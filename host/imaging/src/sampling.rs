//! The values at the grid points of a frame: medians over the pixels of projected patches.

use crate::occlusion::Mask;
use crate::patch::Patch;
use crate::quantiles::{Workspace, median_and_spread};
use crate::register::Registration;
use gonia_brdf::Elementary;
use gonia_rig::{Frame, Rig};

/// The points of a rig's sampling grid: multiples of the grid step inside the disc, row by row.
#[derive(Clone, Debug)]
pub struct SamplingGrid {
    points_mm: Vec<[f64; 2]>,
    patch_mm: f64,
    material_half_mm: f64,
}

/// What one grid point shows in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointValue {
    /// Median radiance per channel.
    pub rgb: [f32; 3],
    /// Centre of the pixels that were used minus the grid point, mm; 0 where the value is interpolated
    /// because the patch holds few pixels.
    pub offset_mm: [f32; 2],
    /// Number of pixels in the patch; 0 when it is too small to speak of any.
    pub pixels: u32,
    /// Robust standard deviation of the pixels about their median, per channel.
    pub spread: [f32; 3],
}

/// Why a grid point has no value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LeftOut {
    /// Its patch touches something that hides the target.
    Occlusion,
    /// Its patch reaches beyond the material.
    Mark,
    /// Its patch holds a pixel that is not a number.
    NotFinite,
    /// Its patch holds a pixel that was too bright for the sensor (+∞).
    Saturated,
    /// Its patch reaches beyond the frame.
    Border,
}

/// Patches of fewer pixels than this are interpolated at points spread over them: the pixels whose centres
/// lie in a patch do not lie evenly about its middle, at 60 of them by up to a millimetre, which is .05° of the
/// light.
const FEW_PIXELS: usize = 400;
/// Of such a patch's value no more is said than that it is interpolated where it holds fewer than this.
const FEWEST_PIXELS: usize = 4;
/// The least number of points along each side of a patch that is interpolated.
const LEAST_POINTS_A_SIDE: usize = 4;

impl SamplingGrid {
    /// The grid of a rig: the paper's has 1225 points.
    pub fn new(rig: &Rig) -> Self {
        let (step, radius) = (rig.sampling.grid_mm, rig.sampling.disc_radius_mm);
        let n = (radius / step).floor() as i64;
        let mut points_mm = Vec::new();
        for j in -n..=n {
            for i in -n..=n {
                let point = [i as f64 * step, j as f64 * step];
                if point[0].hypotenuse(point[1]) <= radius {
                    points_mm.push(point);
                }
            }
        }
        Self {
            points_mm,
            patch_mm: rig.sampling.patch_mm,
            material_half_mm: rig.target.material_half_mm,
        }
    }

    /// The points, mm.
    pub fn points_mm(&self) -> &[[f64; 2]] {
        &self.points_mm
    }

    /// Index of the point at the centre.
    pub fn centre(&self) -> usize {
        // The grid is symmetric about its middle point.
        self.points_mm.len() / 2
    }

    /// Samples all points of a frame, in the grid's order.
    pub fn sample(
        &self,
        frame: &Frame,
        registration: &Registration,
        mask: Option<&Mask>,
    ) -> Vec<Result<PointValue, LeftOut>> {
        let mut sampler = Sampler {
            frame,
            registration,
            mask,
            patch_half: 0.5 * self.patch_mm,
            limit: self.material_half_mm,
            patch: Patch::default(),
            room: Workspace::default(),
        };
        self.points_mm.iter().map(|p| sampler.point(*p)).collect()
    }
}

struct Sampler<'a> {
    frame: &'a Frame,
    registration: &'a Registration,
    mask: Option<&'a Mask>,
    patch_half: f64,
    limit: f64,
    patch: Patch,
    room: Workspace,
}

impl Sampler<'_> {
    fn point(&mut self, at: [f64; 2]) -> Result<PointValue, LeftOut> {
        let reach = at[0].abs().max(at[1].abs()) + self.patch_half;
        if reach > self.limit {
            return Err(LeftOut::Mark);
        }
        let h = self.patch_half;
        let corners = [[-h, -h], [h, -h], [h, h], [-h, h]]
            .map(|d| self.registration.project([at[0] + d[0], at[1] + d[1]]));
        let size = [self.frame.width as f64, self.frame.height as f64];
        let inside = |p: &[f64; 2]| (0..2).all(|i| p[i] >= 0.0 && p[i] <= size[i]);
        if !corners.iter().all(inside) {
            return Err(LeftOut::Border);
        }
        self.patch.clear();
        let mut sum = [0.0; 2];
        for (row, columns) in Rows::of(&corners) {
            if self.mask.is_some_and(|mask| mask.hides_any(&columns, row)) {
                return Err(LeftOut::Occlusion);
            }
            let n = columns.len() as f64;
            sum[0] += n * 0.5 * (columns.start + columns.end) as f64;
            sum[1] += n * (row as f64 + 0.5);
            let start = row * self.frame.width;
            self.patch
                .extend(&self.frame.rgb[start + columns.start..start + columns.end]);
        }
        if !self.patch.is_finite() {
            return Err(reason_of(self.patch.values()));
        }
        let pixels = self.patch.len();
        if pixels < FEW_PIXELS {
            return self.interpolated(at, pixels);
        }
        let mean = sum.map(|s| s / pixels as f64);
        let seen = self.offset(at, mean);
        Ok(self.value(seen, pixels as u32))
    }

    /// Median over points spread evenly over a patch of few pixels, each bilinear between its four pixels:
    /// centred on the grid point, so that no offset is left.
    fn interpolated(&mut self, at: [f64; 2], pixels: usize) -> Result<PointValue, LeftOut> {
        self.patch.clear();
        // About one more than there are pixels along a side.
        let side = LEAST_POINTS_A_SIDE.max(pixels.isqrt() + 2);
        let place = |i: usize| self.patch_half * ((2 * i + 1) as f64 / side as f64 - 1.0);
        let size = [self.frame.width, self.frame.height];
        for k in 0..side * side {
            let d = [place(k % side), place(k / side)];
            let p = self
                .registration
                .project([at[0] + d[0], at[1] + d[1]])
                .map(|c| c - 0.5);
            if (0..2).any(|i| p[i] < 0.0 || p[i] >= (size[i] - 1) as f64) {
                return Err(LeftOut::Border);
            }
            let (column, row) = (p[0] as usize, p[1] as usize);
            let f = [p[0].fract() as f32, p[1].fract() as f32];
            let (mut value, mut worst) = ([0.0f32; 3], [0.0f32; 3]);
            for (dc, wc) in [(0, 1.0 - f[0]), (1, f[0])] {
                for (dr, wr) in [(0, 1.0 - f[1]), (1, f[1])] {
                    let (column, row) = (column + dc, row + dr);
                    if self.mask.is_some_and(|mask| mask.hides(column, row)) {
                        return Err(LeftOut::Occlusion);
                    }
                    let rgb = self.frame.rgb[row * self.frame.width + column];
                    for c in 0..3 {
                        value[c] += wc * wr * rgb[c];
                        worst[c] = if rgb[c].is_finite() { worst[c] } else { rgb[c] };
                    }
                }
            }
            if !worst.iter().all(|v| v.is_finite()) {
                return Err(reason_of(worst.into_iter()));
            }
            self.patch.extend(&[value]);
        }
        let pixels = if pixels < FEWEST_PIXELS { 0 } else { pixels };
        Ok(self.value([0.0; 2], pixels as u32))
    }

    /// Where on the target a pixel position near a grid point is, relative to that point, mm.
    fn offset(&self, at: [f64; 2], pixel: [f64; 2]) -> [f32; 2] {
        let map = &self.registration.pixel_from_target;
        let ideal = self.registration.camera().undistort(pixel);
        let mut offset = [0.0; 2];
        // Newton on a nearly linear map: two steps leave nothing.
        for _ in 0..2 {
            let p = [at[0] + offset[0], at[1] + offset[1]];
            let [[a, b], [c, d]] = map.jacobian(p);
            let seen = map.apply(p);
            let r = [ideal[0] - seen[0], ideal[1] - seen[1]];
            let det = a * d - b * c;
            offset[0] += (d * r[0] - c * r[1]) / det;
            offset[1] += (a * r[1] - b * r[0]) / det;
        }
        offset.map(|o| o as f32)
    }

    fn value(&mut self, offset_mm: [f32; 2], pixels: u32) -> PointValue {
        let (mut rgb, mut spread) = ([0.0; 3], [0.0; 3]);
        for c in 0..3 {
            (rgb[c], spread[c]) = median_and_spread(self.patch.channel(c), &mut self.room);
        }
        PointValue {
            rgb,
            offset_mm,
            pixels,
            spread,
        }
    }
}

/// Why values, not all of them finite, are no radiance.
fn reason_of(mut values: impl Iterator<Item = f32>) -> LeftOut {
    if values.any(|v| v.is_nan() || v == f32::NEG_INFINITY) {
        LeftOut::NotFinite
    } else {
        LeftOut::Saturated
    }
}

/// The pixels whose centres lie in a convex quadrilateral, row by row.
struct Rows {
    corners: [[f64; 2]; 4],
    row: usize,
    end: usize,
}

impl Rows {
    /// The corners must lie within the frame.
    fn of(corners: &[[f64; 2]; 4]) -> Self {
        let top = corners.iter().map(|c| c[1]).fold(f64::INFINITY, f64::min);
        let bottom = corners.iter().map(|c| c[1]).fold(0.0, f64::max);
        Self {
            corners: *corners,
            row: first_centre(top),
            end: first_centre(bottom),
        }
    }
}

impl Iterator for Rows {
    type Item = (usize, std::ops::Range<usize>);

    fn next(&mut self) -> Option<Self::Item> {
        if self.row >= self.end {
            return None;
        }
        let row = self.row;
        self.row += 1;
        let y = row as f64 + 0.5;
        let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in 0..4 {
            let (a, b) = (self.corners[i], self.corners[(i + 1) % 4]);
            if (a[1] <= y) != (b[1] <= y) {
                let x = a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]);
                left = left.min(x);
                right = right.max(x);
            }
        }
        Some((row, first_centre(left)..first_centre(right)))
    }
}

/// The first pixel whose centre is at or past `x`: neighbouring patches share no pixel.
fn first_centre(x: f64) -> usize {
    (x - 0.5).ceil().max(0.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_disc_has_1225_points_and_its_middle_is_the_centre() {
        let grid = SamplingGrid::new(&Rig::paper(400));
        assert_eq!(grid.points_mm().len(), 1225);
        assert_eq!(grid.points_mm()[grid.centre()], [0.0, 0.0]);
    }

    #[test]
    fn every_pixel_centre_belongs_to_one_of_adjacent_quadrilaterals() {
        let edge = [[10.3, 2.1], [14.8, 17.9]];
        let left = [[1.2, 3.3], edge[0], edge[1], [2.6, 15.2]];
        let right = [edge[0], [25.1, 4.4], [22.7, 16.6], edge[1]];
        let mut seen = vec![0; 30 * 30];
        for quad in [left, right] {
            for (row, columns) in Rows::of(&quad) {
                for column in columns {
                    seen[row * 30 + column] += 1;
                }
            }
        }
        assert!(seen.iter().all(|n| *n <= 1));
        // Twice the area of the hexagon, by the shoelace formula.
        let outline = [left[0], edge[0], right[1], right[2], edge[1], left[3]];
        let twice: f64 = (0..6)
            .map(|i| {
                let (a, b) = (outline[i], outline[(i + 1) % 6]);
                a[0] * b[1] - b[0] * a[1]
            })
            .sum();
        let count = seen.iter().sum::<i32>() as f64;
        assert!((count - 0.5 * twice).abs() < 10.0, "{count} {twice}");
    }
}
