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

/// What a pixel sees of the target. Its aperture sees an edge's surface beside its own centre: light that
/// differs over the aperture is that of the place that is seen.
pub struct Paint {
    /// Share of the pixel covered by material, 0 ..= 1.
    pub material: f64,
    /// Where that material is in the mean, mm.
    pub material_at: [f64; 2],
    /// Albedo over π of the lines, by share.
    pub lines: f64,
    /// Where they are in the mean, mm.
    pub lines_at: [f64; 2],
    /// Albedo over π of the desk, by share.
    pub desk: f64,
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

    /// The paint in a pixel centred at a point (mm). `sigma_mm` says how wide its aperture, blurred by the
    /// lens, is across an edge: of which coordinate the edge is (0 for x), and where (mm). Edges are
    /// integrated exactly along each axis. `None` off the desk.
    pub fn paint(&self, at: [f64; 2], sigma_mm: impl Fn(usize, f64) -> f64) -> Option<Paint> {
        let far = at[0].abs().max(at[1].abs());
        if far < self.material_half - self.reach {
            return Some(Paint {
                material: 1.0,
                material_at: at,
                lines: 0.0,
                lines_at: at,
                desk: 0.0,
            });
        }
        if far > self.desk_half + self.reach {
            return None;
        }
        let seen = |axis: usize, ends: [f64; 2]| {
            band(at[axis], ends, ends.map(|edge| sigma_mm(axis, edge)))
        };
        let within = |half: f64| [0, 1].map(|axis| seen(axis, [-half, half]));
        let share = |[x, y]: [Band; 2]| x.share * y.share;
        let desk = share(within(self.desk_half));
        let material_bands = within(self.material_half);
        let material = share(material_bands);
        let line = |axis: usize| {
            let middle = self.offset.copysign(at[axis]);
            seen(axis, [middle - self.half_width, middle + self.half_width])
        };
        let line = [line(0), line(1)];
        let mark = self.mark.map_or(0.0, |mark| {
            disc(mark, at, [0, 1].map(|axis| sigma_mm(axis, at[axis])))
        });
        let lines = 1.0 - (1.0 - line[0].share) * (1.0 - line[1].share) * (1.0 - mark);
        let rest = (desk - material).max(0.0);
        let lines = (lines * desk).min(rest);
        // Where two lines cross, or the mark is near, each is seen by its share.
        let all = (line[0].share + line[1].share + mark).max(1e-30);
        let of = line.map(|l| l.share / all);
        let lines_at = [0, 1].map(|axis| at[axis] + of[axis] * (line[axis].mean - at[axis]));
        Some(Paint {
            material,
            material_at: material_bands.map(|band| band.mean),
            lines: lines * LINE_ALBEDO / PI,
            lines_at,
            desk: (rest - lines) * DESK_ALBEDO / PI,
        })
    }
}

/// Share of a Gaussian at a point that lies within a disc (in any one unit): exact across its edge, where that is
/// long against the Gaussian, and that of a square of the same area along it.
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
    let (radius, side) = (mark.radius_mm, HALF_SQUARE * mark.radius_mm);
    band(far, [-radius, radius], [across; 2]).share * band(0.0, [-side, side], [along; 2]).share
}

/// What a Gaussian sees of a band.
#[derive(Clone, Copy)]
struct Band {
    /// The share of the Gaussian that lies within it.
    share: f64,
    /// The mean of that share.
    mean: f64,
}

/// What a Gaussian at `x` sees of what lies between two ends, from each of which its standard deviation is
/// given.
fn band(x: f64, [low, high]: [f64; 2], sigma: [f64; 2]) -> Band {
    let (below, above) = ((x - low) / sigma[0], (high - x) / sigma[1]);
    if below > REACH && above > REACH {
        Band {
            share: 1.0,
            mean: x,
        }
    } else if below < -REACH || above < -REACH {
        Band {
            share: 0.0,
            mean: x.clamp(low, high),
        }
    } else {
        let share = (normal_cdf(above) + normal_cdf(below) - 1.0).max(0.0);
        let by = (sigma[0] * density(below) - sigma[1] * density(above)) / share.max(1e-9);
        Band {
            share,
            mean: (x + by).clamp(low, high),
        }
    }
}

/// The density of the normal distribution.
fn density(x: f64) -> f64 {
    (-0.5 * x * x).exponential() / (2.0 * PI).sqrt()
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
        let at = |x, y| map.paint([x, y], |_, _| 0.5);
        assert_eq!(at(0.0, 0.0).unwrap().material, 1.0);
        assert!((at(320.0, 0.0).unwrap().material - 0.5).abs() < 1e-6);
        assert!((at(335.0, 0.0).unwrap().lines * PI - LINE_ALBEDO).abs() < 1e-3);
        assert!((at(0.0, -335.0).unwrap().lines * PI - LINE_ALBEDO).abs() < 1e-3);
        assert!((at(328.0, 0.0).unwrap().desk * PI - DESK_ALBEDO).abs() < 1e-6);
        // The lines go on to the edge of the desk.
        assert!((at(390.0, 335.0).unwrap().lines * PI - LINE_ALBEDO).abs() < 1e-3);
        assert!(at(410.0, 0.0).is_none());
        let geometry = SceneGeometry {
            mark: Some(OrientationMark {
                at_mm: [365.0, 120.0],
                radius_mm: 12.0,
            }),
            ..SceneGeometry::paper(400)
        };
        let map = TargetMap::new(&geometry, 0.5);
        let grey = |x, y| {
            let paint = map.paint([x, y], |_, _| 0.5).unwrap();
            (paint.lines + paint.desk) * PI
        };
        assert!((grey(365.0, 129.0) - LINE_ALBEDO).abs() < 1e-3);
        assert!((grey(365.0, 132.0) - 0.5 * (LINE_ALBEDO + DESK_ALBEDO)).abs() < 1e-3);
        assert!((grey(365.0, 135.0) - DESK_ALBEDO).abs() < 1e-3);
        assert!((grey(365.0, -120.0) - DESK_ALBEDO).abs() < 1e-6);
    }

    #[test]
    fn a_pixel_beside_an_edge_sees_what_lies_behind_it() {
        let map = TargetMap::new(&SceneGeometry::paper(400), 3.0);
        let at = |x, y| map.paint([x, y], |_, _| 3.0).unwrap();
        // Half of a Gaussian has its mean at σ √(2/π).
        let half = at(-320.0, 7.0);
        let expected = -320.0 + 3.0 * (2.0 / PI).sqrt();
        assert!((half.material_at[0] - expected).abs() < 1e-4);
        assert_eq!(half.material_at[1], 7.0);
        // Five millimetres outwards of a line all that is seen of it is within it, nearer to its outer edge.
        let beside = at(20.0, -340.0).lines_at;
        assert!(beside[0] == 20.0 && beside[1] < -335.0 && beside[1] > -337.0);
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
