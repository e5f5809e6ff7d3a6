//! Directions on the hemisphere above the sample.

use crate::elementary::Elementary;

/// A vector in the sample's frame: x, y in its plane, z along its normal.
pub type Vec3 = [f64; 3];

/// A direction as polar angles, in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction {
    /// Angle from the normal, 0 ≤ θ ≤ π/2 above the sample.
    pub theta: f64,
    /// Azimuth, anticlockwise from x seen from above, 0 ≤ φ < 2π.
    pub phi: f64,
}

impl Direction {
    /// From degrees; φ is wrapped into [0°, 360°).
    pub fn from_deg(theta_deg: f64, phi_deg: f64) -> Self {
        Self {
            theta: theta_deg.to_radians(),
            phi: wrap_deg(phi_deg).to_radians(),
        }
    }

    /// From any non-zero vector; at the pole φ is 0.
    pub fn from_vec3(v: Vec3) -> Self {
        let in_plane = v[0].hypotenuse(v[1]);
        let phi = if in_plane < 1e-12 * v[2].abs() {
            0.0
        } else {
            v[1].arc_tangent2(v[0]).rem_euclid(std::f64::consts::TAU)
        };
        Self {
            theta: in_plane.arc_tangent2(v[2]),
            phi,
        }
    }

    /// The unit vector `(sin θ cos φ, sin θ sin φ, cos θ)`.
    pub fn to_vec3(self) -> Vec3 {
        let (st, ct) = self.theta.sine_cosine();
        let (sp, cp) = self.phi.sine_cosine();
        [st * cp, st * sp, ct]
    }

    /// θ in degrees.
    pub fn theta_deg(self) -> f64 {
        self.theta.to_degrees()
    }

    /// φ in degrees.
    pub fn phi_deg(self) -> f64 {
        self.phi.to_degrees()
    }
}

/// Where the two arms point: the light's and the camera's direction from the sample's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Towards the light.
    pub light: Direction,
    /// Towards the camera.
    pub view: Direction,
}

impl Pose {
    /// A pose from θi, φi, θv, φv in degrees.
    pub fn from_deg([theta_i, phi_i, theta_v, phi_v]: [f64; 4]) -> Self {
        Self {
            light: Direction::from_deg(theta_i, phi_i),
            view: Direction::from_deg(theta_v, phi_v),
        }
    }
}

/// The unit vector from a point of the sample (x, y in metres; z = 0) to something `distance_m`
/// from the sample's centre in direction `arm`: eqs. (1) and (2) of the paper in three dimensions.
pub fn local_direction(arm: Direction, distance_m: f64, point_m: [f64; 2]) -> Vec3 {
    let d = arm.to_vec3();
    normalize([
        d[0] * distance_m - point_m[0],
        d[1] * distance_m - point_m[1],
        d[2] * distance_m,
    ])
}

/// An angle in degrees wrapped into [0, 360).
pub fn wrap_deg(deg: f64) -> f64 {
    // The usual case, without a division.
    if (0.0..360.0).contains(&deg) {
        return deg;
    }
    let wrapped = deg.rem_euclid(360.0);
    // rem_euclid of a tiny negative number rounds to 360 itself.
    if wrapped >= 360.0 { 0.0 } else { wrapped }
}

/// Scalar product.
pub fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The vector scaled to length one.
pub fn normalize(v: Vec3) -> Vec3 {
    let s = 1.0 / dot(v, v).sqrt();
    [v[0] * s, v[1] * s, v[2] * s]
}

/// The angle between two unit vectors, in radians; exact for small angles too.
pub fn angle_between(a: Vec3, b: Vec3) -> f64 {
    let d = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    2.0 * (0.5 * dot(d, d).sqrt()).min(1.0).arc_sine()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_and_vectors_agree() {
        for (t, p) in [(0.0, 0.0), (30.0, 60.0), (85.0, 359.9), (89.0, 180.0)] {
            let d = Direction::from_deg(t, p);
            let back = Direction::from_vec3(d.to_vec3());
            assert!((back.theta - d.theta).abs() < 1e-12);
            assert!((back.phi - d.phi).abs() < 1e-12);
        }
    }

    #[test]
    fn spans_are_those_of_equation_2() {
        // FACTS of the paper's geometry: r = 277 mm, light at 1.1 m.
        for (theta, minus, plus) in [
            (0.0, -14.13, 14.13),
            (60.0, -9.15, 5.90),
            (85.0, -1.68, 1.01),
        ] {
            let arm = Direction::from_deg(theta, 0.0);
            let at = |x| Direction::from_vec3(local_direction(arm, 1.1, [x, 0.0]));
            let near = at(0.277);
            let signed = if near.phi_deg() > 90.0 {
                -near.theta_deg()
            } else {
                near.theta_deg()
            };
            assert!((signed - theta - minus).abs() < 0.01);
            assert!((at(-0.277).theta_deg() - theta - plus).abs() < 0.01);
        }
    }

    #[test]
    fn azimuths_wrap_into_one_turn() {
        assert_eq!(wrap_deg(360.0), 0.0);
        assert_eq!(wrap_deg(-1e-18), 0.0);
        assert_eq!(wrap_deg(-90.0), 270.0);
    }
}
