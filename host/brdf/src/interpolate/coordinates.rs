//! Where a (light, view) pair lies in the space in which distances are taken.
//!
//! Exchanging light and view only flips the sign of the second half in both systems, so a
//! reciprocal BRDF is even in it, and mirrored samples lie where they belong.

use crate::direction::Vec3;
use crate::elementary::Elementary;

/// A point of the six-dimensional embedding.
pub type Point = [f32; 6];
/// A point in double precision, for few data.
pub type Pair = [f64; 6];

/// A system of coordinates for pairs of directions: `(√2 h |½(i + v)|^p, w (i − v)/√2)` with the unit half vector h.
///
/// For p = 0 these are half vector and difference: sharp highlights depend on h alone. For p = 1 they are
/// sum and difference, and with w = 1 the plain chord distance, rotated. In between, pairs of one half vector
/// differ a little by the angle between light and view too, which pays on all but the sharpest materials
/// (docs/src/figures/accuracy.md).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coordinates {
    /// The exponent p of the sum's length, 0 ..= 1.
    pub exponent: f64,
    /// Weight w of the difference.
    pub weight: f64,
}

impl Coordinates {
    /// Half vector and difference.
    pub const fn half_difference(weight: f64) -> Self {
        Self {
            exponent: 0.0,
            weight,
        }
    }

    /// Sum and difference.
    pub const fn sum_difference(weight: f64) -> Self {
        Self {
            exponent: 1.0,
            weight,
        }
    }

    /// The point of a pair of unit vectors.
    pub fn point(&self, light: Vec3, view: Vec3) -> Point {
        self.pair(light, view).map(|x| x as f32)
    }

    /// The same in double precision.
    pub fn pair(&self, light: Vec3, view: Vec3) -> Pair {
        let sum = [light[0] + view[0], light[1] + view[1], light[2] + view[2]];
        let length = crate::direction::dot(sum, sum).sqrt().max(1e-9);
        let scale = std::f64::consts::SQRT_2 / length * self.raised(0.5 * length);
        let w = self.weight * std::f64::consts::FRAC_1_SQRT_2;
        [
            sum[0] * scale,
            sum[1] * scale,
            sum[2] * scale,
            (light[0] - view[0]) * w,
            (light[1] - view[1]) * w,
            (light[2] - view[2]) * w,
        ]
    }

    /// `x^p`, quick where it can be.
    fn raised(&self, x: f64) -> f64 {
        match self.exponent {
            0.0 => 1.0,
            0.25 => x.sqrt().sqrt(),
            1.0 => x,
            exponent => x.power(exponent),
        }
    }

    /// Where the pair of unit vectors at `point` lies in other coordinates.
    pub fn convert(&self, point: &Point, to: Coordinates) -> Point {
        let ratio = (to.weight / self.weight) as f32;
        let difference = [point[3] * ratio, point[4] * ratio, point[5] * ratio];
        let scale = if self.exponent == to.exponent {
            1.0
        } else {
            // |i + v|² + |i − v|² = 4.
            let length2: f32 = difference.iter().map(|d| d * d).sum();
            let half2 = (1.0 - 0.5 / (to.weight * to.weight) as f32 * length2).max(2.5e-7);
            half2.power(0.5 * (to.exponent - self.exponent) as f32)
        };
        let [x, y, z] = [point[0] * scale, point[1] * scale, point[2] * scale];
        [x, y, z, difference[0], difference[1], difference[2]]
    }

    /// The external drift of logarithms in these coordinates.
    pub fn drift(&self) -> Drift {
        if self.exponent < 1.0 {
            Drift {
                per_difference2: (0.5 / (self.weight * self.weight)) as f32,
            }
        } else {
            Drift::NONE
        }
    }
}

impl std::fmt::Display for Coordinates {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (exponent, weight) = (self.exponent, self.weight);
        match exponent {
            0.0 => write!(f, "half/difference w={weight}"),
            1.0 => write!(f, "sum/difference w={weight}"),
            _ => write!(f, "half/difference w={weight} p={exponent}"),
        }
    }
}

/// External drift: what the logarithm of a BRDF rises by towards grazing light and view that face each other, in
/// half/difference coordinates: `−½ ln cos θd`, θd the angle from the half vector to either. Lobes are
/// about 1 / cos θd there, bases are flat, and these coordinates see little of it: the half vector hardly moves. Interpolating what is
/// left takes about a quarter off the error of sharp materials where one polar angle is beyond 75° and the other beyond 60°
/// (docs/src/figures/accuracy.md). Coordinates with the sum of light and view, which is 2 cos θd long, need none.
#[derive(Clone, Copy, Debug, Default)]
pub struct Drift {
    /// `sin² θd` over the squared length of the second half of a point.
    per_difference2: f32,
}

/// Smallest square of a cosine that the drift tells from zero.
const COS2_MIN: f32 = 1e-4;

impl Drift {
    /// No drift.
    pub const NONE: Drift = Drift {
        per_difference2: 0.0,
    };

    /// The drift at a point.
    #[inline(always)]
    pub fn at(&self, point: &Point) -> f32 {
        if self.per_difference2 == 0.0 {
            return 0.0;
        }
        let difference2: f32 = point[3..].iter().map(|d| d * d).sum();
        -0.25
            * (1.0 - self.per_difference2 * difference2)
                .max(COS2_MIN)
                .natural_log()
    }
}

/// Squared distance of two points.
pub fn distance2(a: &Point, b: &Point) -> f32 {
    (0..6).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direction::Direction;

    #[test]
    fn exchange_of_light_and_view_flips_the_difference_only() {
        let a = Direction::from_deg(30.0, 50.0).to_vec3();
        let b = Direction::from_deg(70.0, 200.0).to_vec3();
        for coordinates in [
            Coordinates::half_difference(0.5),
            Coordinates::sum_difference(0.5),
        ] {
            let (p, q) = (coordinates.point(a, b), coordinates.point(b, a));
            for k in 0..3 {
                assert_eq!(p[k], q[k]);
                assert_eq!(p[k + 3], -q[k + 3]);
            }
        }
    }

    #[test]
    fn converted_points_are_those_of_the_directions() {
        let systems = [
            Coordinates::half_difference(0.5),
            Coordinates::half_difference(0.25),
            Coordinates::sum_difference(1.0),
            Coordinates {
                exponent: 0.25,
                weight: 1.0,
            },
            Coordinates {
                exponent: 0.1,
                weight: 1.0,
            },
        ];
        let at = |theta, phi| Direction::from_deg(theta, phi).to_vec3();
        for (i, v) in [((10.0, 20.0), (40.0, 80.0)), ((86.0, 0.0), (84.0, 179.0))] {
            let (i, v) = (at(i.0, i.1), at(v.0, v.1));
            for (from, to) in systems
                .iter()
                .flat_map(|a| systems.iter().map(move |b| (a, b)))
            {
                let (got, expected) = (from.convert(&from.point(i, v), *to), to.point(i, v));
                assert!(distance2(&got, &expected) < 1e-8, "{got:?} {expected:?}");
            }
        }
    }

    #[test]
    fn the_trend_is_that_of_the_cosine_of_half_the_angle_between_light_and_view() {
        let (i, v) = (
            Direction::from_deg(50.0, 10.0),
            Direction::from_deg(70.0, 190.0),
        );
        let point = |c: &Coordinates| c.point(i.to_vec3(), v.to_vec3());
        for weight in [0.25, 0.5] {
            let c = Coordinates::half_difference(weight);
            let expected = -0.5 * 60f64.to_radians().cosine().natural_log();
            assert!((f64::from(c.drift().at(&point(&c))) - expected).abs() < 1e-5);
        }
        let c = Coordinates::sum_difference(0.5);
        assert_eq!(c.drift().at(&point(&c)), 0.0);
    }

    #[test]
    fn sum_and_difference_of_weight_one_keep_chord_distances() {
        let d = |t, p| Direction::from_deg(t, p).to_vec3();
        let (i, v, j, w) = (d(10.0, 20.0), d(40.0, 80.0), d(15.0, 25.0), d(45.0, 70.0));
        let c = Coordinates::sum_difference(1.0);
        let chord2: f64 = (0..3)
            .map(|k| (i[k] - j[k]).powi(2) + (v[k] - w[k]).powi(2))
            .sum();
        let got = distance2(&c.point(i, v), &c.point(j, w));
        assert!((f64::from(got) - chord2).abs() < 1e-6);
    }
}
