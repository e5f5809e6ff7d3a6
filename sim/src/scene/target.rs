//! The painted desk: which part of a pixel is line, desk or material.

use super::SceneGeometry;
use super::noise::mix;
use gonia_brdf::Elementary;
use gonia_rig::OrientationMark;
use std::f64::consts::PI;

/// Albedo of the lines and of the orientation mark.
const LINE_ALBEDO: f64 = 0.9;
/// Albedo of the desk.
const DESK_ALBEDO: f64 = 0.03;
/// Half the side of the square that has the area of a disc of radius 1: √π/2.
const HALF_SQUARE: f64 = 0.886_226_925_452_758;
/// Beyond this many standard deviations a blurred edge is over.
const REACH: f64 = 4.0;

/// What a pixel sees of the target.
pub struct Paint {
    /// Share of the pixel covered by material, 0 ..= 1.
    pub material: f64,
    /// Albedo over π of the rest (lines and desk), by share.
    pub grey: f64,
}

/// The layout of the target.
pub struct TargetMap {
    offset: f64,
    half_width: f64,
    material_half: f64,
    mark: Option<OrientationMark>,
    desk_half: f64,
    /// Further than this from an edge nothing is blurred, mm.
    reach: f64,
}

impl TargetMap {
    /// For a camera whose blurred aperture has a standard deviation of at most `sigma_max_mm` on
    /// the desk.
    pub fn new(geometry: &SceneGeometry, sigma_max_mm: f64) -> Self {
        Self {
            reach: REACH * sigma_max_mm,
            offset: geometry.line_offset_mm,
            half_width: 0.5 * geometry.line_width_mm,
            material_half: geometry.material_half_mm,
            mark: geometry.mark,
            desk_half: geometry.desk_half_mm,
        }
    }

    /// The paint in a pixel centred at a point (mm), whose aperture, blurred by the lens, has the
    /// given standard deviations along x and y (mm; asked for only near an edge). Edges are
    /// integrated exactly along each axis. `None` off the desk.
    pub fn paint(&self, at: [f64; 2], sigma_mm: impl Fn() -> [f64; 2]) -> Option<Paint> {
        let far = at[0].abs().max(at[1].abs());
        if far < self.material_half - self.reach {
            return Some(Paint {
                material: 1.0,
                grey: 0.0,
            });
        }
        if far > self.desk_half + self.reach {
            return None;
        }
        let sigma = sigma_mm();
        let within =
            |half: f64| band(at[0], 0.0, half, sigma[0]) * band(at[1], 0.0, half, sigma[1]);
        let line = |axis: usize| band(at[axis].abs(), self.offset, self.half_width, sigma[axis]);
        let desk = within(self.desk_half);
        let material = within(self.material_half);
        let mark = self.mark.map_or(0.0, |mark| disc(mark, at, sigma));
        let lines = 1.0 - (1.0 - line(0)) * (1.0 - line(1)) * (1.0 - mark);
        let rest = (desk - material).max(0.0);
        let lines = (lines * desk).min(rest);
        Some(Paint {
            material,
            grey: (lines * LINE_ALBEDO + (rest - lines) * DESK_ALBEDO) / PI,
        })
    }
}

/// Share of a Gaussian at a point that lies within a disc (in any one unit): exact across its edge, where that is long against
/// the Gaussian, and that of a square of the same area along it.
pub fn disc(mark: OrientationMark, at: [f64; 2], sigma: [f64; 2]) -> f64 {
    let from = [at[0] - mark.at_mm[0], at[1] - mark.at_mm[1]];
    let far = from[0].hypotenuse(from[1]);
    let out = if far > 0.0 {
        from.map(|c| c / far)
    } else {
        [1.0, 0.0]
    };
    let across = (out[0] * sigma[0]).hypotenuse(out[1] * sigma[1]);
    let along = (out[1] * sigma[0]).hypotenuse(out[0] * sigma[1]);
    band(far, 0.0, mark.radius_mm, across) * band(0.0, 0.0, HALF_SQUARE * mark.radius_mm, along)
}

/// Share of a Gaussian of standard deviation `sigma` at `x` that lies within `half` of `centre`.
fn band(x: f64, centre: f64, half: f64, sigma: f64) -> f64 {
    let (low, high) = (x - centre + half, centre + half - x);
    if low > REACH * sigma && high > REACH * sigma {
        1.0
    } else if low < -REACH * sigma || high < -REACH * sigma {
        0.0
    } else {
        (normal_cdf(high / sigma) + normal_cdf(low / sigma) - 1.0).max(0.0)
    }
}

/// The normal distribution function to 1e-7 (Abramowitz & Stegun 7.1.26).
fn normal_cdf(x: f64) -> f64 {
    let z = x.abs() * std::f64::consts::FRAC_1_SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * z);
    let poly = t
        * (0.254_829_592
            + t * (-0.284_496_736
                + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    let upper = 0.5 * poly * (-z * z).exponential();
    if x >= 0.0 { 1.0 - upper } else { upper }
}

/// Slow random changes of the material over its surface: folds, uneven dye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texture {
    /// Largest relative change of the value.
    pub amplitude: f64,
    /// Distance over which it changes, mm.
    pub scale_mm: f64,
}

impl Texture {
    /// The factor at a point (mm): random at the nodes of a lattice, smooth between them.
    pub fn factor(&self, at_mm: [f64; 2], seed: u64) -> f64 {
        let p = at_mm.map(|c| c / self.scale_mm);
        let cell = p.map(f64::floor);
        let smooth = [0, 1].map(|i: usize| {
            let t = p[i] - cell[i];
            t * t * (3.0 - 2.0 * t)
        });
        let node = |dx: i64, dy: i64| {
            let (x, y) = (cell[0] as i64 + dx, cell[1] as i64 + dy);
            let bits = mix(seed ^ mix((x as u64) << 32 ^ (y as u64 & 0xffff_ffff)));
            (bits >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        let row = |dy| node(0, dy) * (1.0 - smooth[0]) + node(1, dy) * smooth[0];
        1.0 + self.amplitude * (row(0) * (1.0 - smooth[1]) + row(1) * smooth[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_follow_the_layout() {
        let map = TargetMap::new(&SceneGeometry::paper(400), 0.5);
        let at = |x, y| map.paint([x, y], || [0.5, 0.5]);
        assert_eq!(at(0.0, 0.0).unwrap().material, 1.0);
        assert!((at(320.0, 0.0).unwrap().material - 0.5).abs() < 1e-6);
        assert!((at(335.0, 0.0).unwrap().grey * PI - LINE_ALBEDO).abs() < 1e-3);
        assert!((at(0.0, -335.0).unwrap().grey * PI - LINE_ALBEDO).abs() < 1e-3);
        assert!((at(328.0, 0.0).unwrap().grey * PI - DESK_ALBEDO).abs() < 1e-6);
        // The lines go on to the edge of the desk.
        assert!((at(390.0, 335.0).unwrap().grey * PI - LINE_ALBEDO).abs() < 1e-3);
        assert!(at(410.0, 0.0).is_none());
        let geometry = SceneGeometry {
            mark: Some(OrientationMark {
                at_mm: [365.0, 120.0],
                radius_mm: 12.0,
            }),
            ..SceneGeometry::paper(400)
        };
        let map = TargetMap::new(&geometry, 0.5);
        let grey = |x, y| map.paint([x, y], || [0.5, 0.5]).unwrap().grey * PI;
        assert!((grey(365.0, 129.0) - LINE_ALBEDO).abs() < 1e-3);
        assert!((grey(365.0, 132.0) - 0.5 * (LINE_ALBEDO + DESK_ALBEDO)).abs() < 1e-3);
        assert!((grey(365.0, 135.0) - DESK_ALBEDO).abs() < 1e-3);
        assert!((grey(365.0, -120.0) - DESK_ALBEDO).abs() < 1e-6);
    }

    #[test]
    fn texture_stays_within_its_amplitude_and_varies() {
        let texture = Texture {
            amplitude: 0.05,
            scale_mm: 8.0,
        };
        let values: Vec<f64> = (0..200)
            .map(|i| texture.factor([f64::from(i) * 3.1 - 300.0, 17.0], 5))
            .collect();
        assert!(values.iter().all(|v| (v - 1.0).abs() <= 0.05));
        assert!(values.iter().any(|v| (v - 1.0).abs() > 0.02));
    }
}
