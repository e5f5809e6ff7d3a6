//! An arm as it was built: where what it carries really is when its encoders read θ and φ.

use gonia_brdf::Elementary;
use gonia_brdf::direction::{Direction, Vec3, dot, normalize};
use serde::{Deserialize, Serialize};

/// How an arm differs from an ideal one. The φ axis stands on the target, the θ axis lies across the arm;
/// an ideal arm's axes cross at a right angle at the target's centre, and its encoders read 0 where light
/// and camera stand on the φ axis with φ along the target's x. All zero: an ideal arm.
///
/// A light or camera that is shifted along the arm's meridian is the same as another zero of θ, and the
/// whole target turned about its normal the same as another zero of both arms' φ: neither has a number of
/// its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ArmGeometry {
    /// True polar angle minus reading, degrees.
    pub theta_zero_deg: f64,
    /// True azimuth minus reading, degrees.
    pub phi_zero_deg: f64,
    /// By how much the θ axis misses the φ axis, mm: horizontally, towards the arm's azimuth.
    pub axis_miss_mm: f64,
    /// By how much the θ axis is not square to the φ axis, degrees: positive where its right end (as the
    /// camera sees it) is higher.
    pub axis_square_deg: f64,
    /// How far the light or the camera stands beside the arm's meridian, to the right as it looks at the
    /// target, mm.
    pub right_mm: f64,
}

/// Where something stands and how it is turned, in the target's frame: right, up and back are the axes of
/// its image; it looks along −back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Its place, mm from the target's centre.
    pub at_mm: Vec3,
    /// To the right in the image.
    pub right: Vec3,
    /// Up in the image.
    pub up: Vec3,
    /// From the target towards it.
    pub back: Vec3,
}

/// The target in the frame of the φ axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TargetPlace {
    /// How far its surface lies above the crossing of the axes, mm.
    pub height_mm: f64,
    /// Its tilt about its own x and y axes, degrees.
    pub tilt_deg: [f64; 2],
    /// Where its centre lies, along the x and y of the φ axis, mm.
    pub offset_mm: [f64; 2],
}

impl ArmGeometry {
    /// The shafts' true angles when the encoders read `reading`. At the pole the azimuth is the shaft's, which
    /// the direction of what it holds does not tell.
    pub fn shaft(&self, reading: Direction) -> Direction {
        Direction {
            theta: reading.theta + self.theta_zero_deg.to_radians(),
            phi: reading.phi + self.phi_zero_deg.to_radians(),
        }
    }

    /// Where the arm holds something `distance_mm` from its θ axis when it reads `reading`, seen from the
    /// target. With all numbers zero: at d·distance, right (−sin φ, cos φ, 0), up −∂d/∂θ.
    pub fn placement(
        &self,
        reading: Direction,
        distance_mm: f64,
        target: &TargetPlace,
    ) -> Placement {
        let shaft = self.shaft(reading);
        let (sp, cp) = shaft.phi.sine_cosine();
        let (right, radial) = ([-sp, cp, 0.0], [cp, sp, 0.0]);
        let (tilt_sine, tilt_cosine) = self.axis_square_deg.to_radians().sine_cosine();
        let axis = [tilt_cosine * right[0], tilt_cosine * right[1], tilt_sine];
        let turned = Rotation::new(axis, shaft.theta);
        let arm = turned.of([
            self.right_mm * right[0],
            self.right_mm * right[1],
            distance_mm,
        ]);
        let at = [0, 1, 2].map(|i| self.axis_miss_mm * radial[i] + arm[i]);
        Placement {
            at_mm: target.point_from_axes(at),
            right: target.vector_from_axes(turned.of(right)),
            up: target.vector_from_axes(turned.of(radial.map(|c| -c))),
            back: target.vector_from_axes(turned.of([0.0, 0.0, 1.0])),
        }
    }
}

impl Placement {
    /// Turned so that it looks at what lies `aim_mm` right and down of where it looked, `distance_mm` ahead,
    /// and then about that line of sight, so that its image turns clockwise by `roll` radians.
    #[must_use]
    pub fn aimed(&self, aim_mm: [f64; 2], distance_mm: f64, roll: f64) -> Self {
        let back =
            match aim_mm {
                [0.0, 0.0] => self.back,
                [right, down] => normalize([0, 1, 2].map(|i| {
                    distance_mm * self.back[i] - right * self.right[i] + down * self.up[i]
                })),
            };
        let off = dot(self.up, back);
        let up = normalize([0, 1, 2].map(|i| self.up[i] - off * back[i]));
        let right = cross(up, back);
        let (sine, cosine) = roll.sine_cosine();
        Self {
            at_mm: self.at_mm,
            right: [0, 1, 2].map(|i| cosine * right[i] + sine * up[i]),
            up: [0, 1, 2].map(|i| cosine * up[i] - sine * right[i]),
            back,
        }
    }

    /// The unit vector from a point of the target (mm) to it: eqs. (1) and (2) of the paper, for a rig
    /// as it is.
    pub fn direction_from(&self, point_mm: [f64; 2]) -> Vec3 {
        normalize([
            self.at_mm[0] - point_mm[0],
            self.at_mm[1] - point_mm[1],
            self.at_mm[2],
        ])
    }

    /// Its direction as seen from the target's centre.
    pub fn direction(&self) -> Direction {
        Direction::from_vec3(self.direction_from([0.0; 2]))
    }
}

impl TargetPlace {
    /// A point of the axes' frame (mm) in the target's.
    fn point_from_axes(&self, at: Vec3) -> Vec3 {
        let [x, y] = self.offset_mm;
        self.vector_from_axes([at[0] - x, at[1] - y, at[2] - self.height_mm])
    }

    /// A vector of the axes' frame in the target's: undoes the tilt about y, then that about x.
    fn vector_from_axes(&self, v: Vec3) -> Vec3 {
        if self.tilt_deg == [0.0; 2] {
            return v;
        }
        let (sx, cx) = self.tilt_deg[0].to_radians().sine_cosine();
        let (sy, cy) = self.tilt_deg[1].to_radians().sine_cosine();
        // The target's axes are those of Rx·Ry; the inverse takes them one by one.
        let v = [v[0], cx * v[1] + sx * v[2], cx * v[2] - sx * v[1]];
        [cy * v[0] - sy * v[2], v[1], cy * v[2] + sy * v[0]]
    }
}

/// A rotation about a unit vector (Rodrigues' formula).
struct Rotation {
    axis: Vec3,
    sine: f64,
    cosine: f64,
}

impl Rotation {
    fn new(axis: Vec3, angle: f64) -> Self {
        let (sine, cosine) = angle.sine_cosine();
        Self { axis, sine, cosine }
    }

    fn of(&self, v: Vec3) -> Vec3 {
        let along = dot(self.axis, v) * (1.0 - self.cosine);
        let across = cross(self.axis, v);
        [0, 1, 2].map(|i| self.cosine * v[i] + self.sine * across[i] + along * self.axis[i])
    }
}

fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: Vec3, b: Vec3) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9)
    }

    fn ideal(theta: f64, phi: f64) -> Placement {
        let place = TargetPlace::default();
        ArmGeometry::default().placement(Direction::from_deg(theta, phi), 1000.0, &place)
    }

    #[test]
    fn an_ideal_arm_follows_the_conventions() {
        for (theta, phi) in [(0.0, 0.0), (30.0, 60.0), (75.0, 315.0)] {
            let d = Direction::from_deg(theta, phi);
            let at = ideal(theta, phi);
            let (st, ct) = d.theta.sine_cosine();
            let (sp, cp) = d.phi.sine_cosine();
            assert!(near(at.at_mm, d.to_vec3().map(|c| 1000.0 * c)));
            assert!(near(at.back, d.to_vec3()));
            assert!(near(at.right, [-sp, cp, 0.0]));
            assert!(near(at.up, [-ct * cp, -ct * sp, st]));
        }
    }

    #[test]
    fn each_deviation_moves_what_it_says() {
        let placed = |arm: ArmGeometry, target: TargetPlace, theta: f64, phi: f64| {
            arm.placement(Direction::from_deg(theta, phi), 1000.0, &target)
        };
        let here = TargetPlace::default();
        let zeros = ArmGeometry {
            theta_zero_deg: 2.0,
            phi_zero_deg: -5.0,
            ..Default::default()
        };
        assert!(near(
            placed(zeros, here, 30.0, 60.0).at_mm,
            ideal(32.0, 55.0).at_mm
        ));
        let miss = ArmGeometry {
            axis_miss_mm: 3.0,
            ..Default::default()
        };
        // At φ = 90° the θ axis lies 3 mm towards +y.
        assert!(near(
            placed(miss, here, 0.0, 90.0).at_mm,
            [0.0, 3.0, 1000.0]
        ));
        let right = ArmGeometry {
            right_mm: 4.0,
            ..Default::default()
        };
        // At φ = 0 right is +y, whatever θ.
        assert!(near(
            placed(right, here, 90.0, 0.0).at_mm,
            [1000.0, 4.0, 0.0]
        ));
        // A θ axis whose right end (+y at φ = 0) is high carries the arm round a cone: at θ = 180°
        // it points down and to the right.
        let tilted = ArmGeometry {
            axis_square_deg: 1.0,
            ..Default::default()
        };
        let at = placed(tilted, here, 180.0, 0.0).at_mm;
        let (sine, cosine) = 2f64.to_radians().sine_cosine();
        assert!(near(at, [0.0, 1000.0 * sine, -1000.0 * cosine]));
        let high = TargetPlace {
            height_mm: 2.0,
            offset_mm: [5.0, -7.0],
            ..Default::default()
        };
        let at = placed(ArmGeometry::default(), high, 0.0, 0.0).at_mm;
        assert!(near(at, [-5.0, 7.0, 998.0]));
        // Tilted about x by +10°, the target's +y side rises towards what stands above it.
        let tilt = TargetPlace {
            tilt_deg: [10.0, 0.0],
            ..Default::default()
        };
        let (sine, cosine) = 10f64.to_radians().sine_cosine();
        let at = placed(ArmGeometry::default(), tilt, 0.0, 0.0).at_mm;
        assert!(near(at, [0.0, 1000.0 * sine, 1000.0 * cosine]));
        let tilt = TargetPlace {
            tilt_deg: [0.0, 10.0],
            ..Default::default()
        };
        let at = placed(ArmGeometry::default(), tilt, 0.0, 0.0).at_mm;
        assert!(near(at, [-1000.0 * sine, 0.0, 1000.0 * cosine]));
    }

    #[test]
    fn aim_and_roll_turn_the_image_and_leave_the_place() {
        let at = ideal(30.0, 60.0);
        let aimed = at.aimed([10.0, 20.0], 1000.0, 0.0);
        assert_eq!(aimed.at_mm, at.at_mm);
        // What it looks at lies 10 mm right and 20 mm down of the centre.
        let ahead = |p: &Placement, i: usize| p.at_mm[i] - 1000.0 * p.back[i];
        let depth = dot(aimed.back, at.back);
        let looked =
            [0, 1, 2].map(|i| at.at_mm[i] - 1000.0 / depth * aimed.back[i] - ahead(&at, i));
        assert!((dot(looked, at.right) - 10.0).abs() < 1e-9);
        assert!((dot(looked, at.up) + 20.0).abs() < 1e-9);
        assert!(dot(aimed.right, aimed.up).abs() < 1e-12);
        // An image turned clockwise shows at its right what was up.
        let rolled = at.aimed([0.0; 2], 1000.0, 90f64.to_radians());
        assert!(near(rolled.right, at.up) && near(rolled.up, at.right.map(|c| -c)));
    }
}
