//! The rig's camera: what a pose lets one expect in the image.

use crate::{ArmGeometry, CameraMount, Homography, Placement, Rig, TargetPlace};
use gonia_brdf::Direction;
use gonia_brdf::Elementary;
use gonia_brdf::direction::dot;
use nalgebra::Matrix3;

/// Rounds in which the inverse of a lens is sought, and the step (in focal lengths) at which it is found.
const LEAST_ROUNDS: usize = 8;
const MOST_ROUNDS: usize = 100;
const SETTLED: f64 = 1e-9;

/// Intrinsics and distance of the camera. *Ideal* pixels are those of a pinhole; a lens moves them, with
/// x, y the ideal position from the principal point in focal lengths, and r its length, as OpenCV has
/// it: x becomes x·(1 + k1·r² + k2·r⁴ + k3·r⁶) + 2·p1·x·y + p2·(r² + 2x²), and y becomes
/// y·(1 + k1·r² + k2·r⁴ + k3·r⁶) + p1·(r² + 2y²) + 2·p2·x·y.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraModel {
    distance_mm: f64,
    arm: ArmGeometry,
    mount: CameraMount,
    target: TargetPlace,
    /// Along rows and columns.
    focal_px: [f64; 2],
    centre_px: [f64; 2],
    /// k1, k2, k3.
    radial: [f64; 3],
    /// p1, p2.
    tangential: [f64; 2],
    /// Width and height of a frame, pixels.
    pub size_px: [usize; 2],
}

/// Small deviations of the camera from where its arm says it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraShift {
    /// Of the polar angle, radians.
    pub theta: f64,
    /// Of the azimuth, radians.
    pub phi: f64,
    /// Turn about the optical axis, radians.
    pub roll: f64,
    /// Shift of the image, pixels.
    pub shift_px: [f64; 2],
    /// Logarithm of the magnification.
    pub log_scale: f64,
}

impl CameraModel {
    /// The camera of a rig.
    pub fn new(rig: &Rig) -> Self {
        let camera = &rig.camera;
        Self {
            distance_mm: camera.distance_m * 1000.0,
            arm: camera.arm,
            mount: camera.mount,
            target: rig.target.place,
            focal_px: [
                camera.focal_px,
                camera.focal_y_px.unwrap_or(camera.focal_px),
            ],
            centre_px: camera.centre_px,
            radial: [camera.k1, camera.k2, camera.k3],
            tangential: [camera.p1, camera.p2],
            size_px: [camera.width_px, camera.height_px],
        }
    }

    /// Whether the lens bends straight lines.
    pub fn is_distorted(&self) -> bool {
        self.radial != [0.0; 3] || self.tangential != [0.0; 2]
    }

    /// Where the camera stands and how its image lies, when its arm reads `reading` and is off by `by`.
    pub fn placement(&self, reading: Direction, by: CameraShift) -> Placement {
        let shaft = Direction {
            theta: reading.theta + by.theta,
            phi: reading.phi + by.phi,
        };
        let held = self.arm.placement(shaft, self.distance_mm, &self.target);
        let roll = self.mount.roll_deg.to_radians() + by.roll;
        held.aimed(self.mount.aim_mm, self.distance_mm, roll)
    }

    /// The map from millimetres on the target to ideal pixels, when the camera's arm reads `reading` and
    /// is off by `by`. For an ideal rig: image up is −∂d/∂θ, image right (−sin φ, cos φ, 0).
    pub fn predict(&self, reading: Direction, by: CameraShift) -> Homography {
        let camera = self.placement(reading, by);
        let focal = self.focal_px.map(|f| f * by.log_scale.exponential());
        let down = camera.up.map(|c| -c);
        let k = Matrix3::new(
            focal[0],
            0.0,
            self.centre_px[0] + by.shift_px[0],
            0.0,
            focal[1],
            self.centre_px[1] + by.shift_px[1],
            0.0,
            0.0,
            1.0,
        );
        // Columns: where a step along x, a step along y and the centre go; the last row is depth.
        let (right, back, at) = (camera.right, camera.back, camera.at_mm);
        Homography::from_matrix(
            k * Matrix3::new(
                right[0],
                right[1],
                -dot(at, right),
                down[0],
                down[1],
                -dot(at, down),
                -back[0],
                -back[1],
                dot(at, back),
            ),
        )
    }

    /// Where the lens puts an ideal pixel.
    pub fn distort(&self, ideal: [f64; 2]) -> [f64; 2] {
        if !self.is_distorted() {
            return ideal;
        }
        let x = self.relative_to_centre(ideal);
        let (stretch, aside) = self.lens(x);
        [0, 1].map(|i| {
            let focal = self.focal_px[i];
            self.centre_px[i] + focal * x[i] * stretch + focal * aside[i]
        })
    }

    /// The ideal pixel that the lens puts at `pixel`.
    pub fn undistort(&self, pixel: [f64; 2]) -> [f64; 2] {
        if !self.is_distorted() {
            return pixel;
        }
        let seen = self.relative_to_centre(pixel);
        let mut x = seen;
        // Converges by a factor of about |k1|·r² a round: usually far below a thousandth of a pixel
        // after the least number of rounds.
        for round in 1..=MOST_ROUNDS {
            let (stretch, aside) = self.lens(x);
            let next = [0, 1].map(|i| (seen[i] - aside[i]) / stretch);
            let moved = (next[0] - x[0]).abs().max((next[1] - x[1]).abs());
            x = next;
            if round >= LEAST_ROUNDS && moved < SETTLED {
                break;
            }
        }
        [0, 1].map(|i| self.centre_px[i] + self.focal_px[i] * x[i])
    }

    /// From the principal point, in focal lengths.
    fn relative_to_centre(&self, pixel: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|i| (pixel[i] - self.centre_px[i]) / self.focal_px[i])
    }

    /// By how much the lens stretches an ideal position, and how far it moves it aside.
    fn lens(&self, x: [f64; 2]) -> (f64, [f64; 2]) {
        let r2 = x[0] * x[0] + x[1] * x[1];
        let [k1, k2, k3] = self.radial;
        let [p1, p2] = self.tangential;
        let both = 2.0 * x[0] * x[1];
        let aside = [
            p1 * both + p2 * (r2 + 2.0 * x[0] * x[0]),
            p1 * (r2 + 2.0 * x[1] * x[1]) + p2 * both,
        ];
        (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3)), aside)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rig;

    #[test]
    fn the_prediction_follows_the_conventions() {
        let camera = CameraModel::new(&Rig::paper(400));
        let at = |t: f64, p: f64, mm| {
            camera
                .predict(Direction::from_deg(t, p), CameraShift::default())
                .apply(mm)
        };
        let centre = at(0.0, 0.0, [0.0, 0.0]);
        assert!(centre.iter().all(|c| (c - 200.0).abs() < 1e-9));
        // At the pole with φ = 0, right is +y and up is −x.
        let scale = 625.0 / 1800.0;
        let right = at(0.0, 0.0, [0.0, 100.0]);
        assert!((right[0] - 200.0 - 100.0 * scale).abs() < 1e-9 && (right[1] - 200.0).abs() < 1e-9);
        assert!(at(0.0, 0.0, [-100.0, 0.0])[1] < 200.0);
        // Obliquely, what lies towards the camera is low in the image and larger.
        let (near, far) = (at(60.0, 90.0, [0.0, 100.0]), at(60.0, 90.0, [0.0, -100.0]));
        assert!(near[1] > 200.0 && near[1] - 200.0 > 200.0 - far[1]);
        assert!(at(60.0, 90.0, [-100.0, 0.0])[0] > 200.0);
    }

    #[test]
    fn the_lens_is_that_of_opencv() {
        // cv2.projectPoints of (0.21, -0.34, 1) with fx 900, fy 880, cx 500, cy 510 and these five:
        // worked out by its documented formula, x'' = 0.21·d + 2·p1·x·y + p2·(r² + 2x²), d = 1 + ….
        let mut rig = Rig::paper(1024);
        let camera = &mut rig.camera;
        (camera.focal_px, camera.focal_y_px) = (900.0, Some(880.0));
        camera.centre_px = [500.0, 510.0];
        (camera.k1, camera.k2, camera.k3) = (-0.25, 0.11, -0.03);
        (camera.p1, camera.p2) = (0.002, -0.003);
        let model = CameraModel::new(&rig);
        let ideal = [500.0 + 900.0 * 0.21, 510.0 - 880.0 * 0.34];
        // r² = 0.1597; d = 1 − 0.039925 + 0.00280545… − 0.000122189… = 0.96275826…
        let d = 1.0 - 0.25 * 0.1597 + 0.11 * 0.1597f64.powi(2) - 0.03 * 0.1597f64.powi(3);
        let x = 0.21 * d - 2.0 * 0.002 * 0.0714 - 0.003 * (0.1597 + 0.0882);
        let y = -0.34 * d + 0.002 * (0.1597 + 0.2312) + 2.0 * 0.003 * 0.0714;
        let seen = model.distort(ideal);
        assert!((seen[0] - (500.0 + 900.0 * x)).abs() < 1e-9, "{seen:?}");
        assert!((seen[1] - (510.0 + 880.0 * y)).abs() < 1e-9, "{seen:?}");
        let back = model.undistort(seen);
        assert!((back[0] - ideal[0]).hypotenuse(back[1] - ideal[1]) < 1e-4);
        // A pixel that is less high than wide: a step down is fewer pixels than one to the right.
        let at = |mm| {
            model
                .predict(Direction::from_deg(0.0, 0.0), CameraShift::default())
                .apply(mm)
        };
        assert!((at([0.0, 90.0])[0] - 500.0 - 900.0 * 0.05).abs() < 1e-9);
        assert!((at([90.0, 0.0])[1] - 510.0 - 880.0 * 0.05).abs() < 1e-9);
    }

    #[test]
    fn undistortion_undoes_distortion() {
        let mut rig = Rig::paper(1024);
        (rig.camera.k1, rig.camera.k2) = (-0.12, 0.05);
        let camera = CameraModel::new(&rig);
        for ideal in [[512.0, 512.0], [30.0, 900.0], [1000.0, 10.0]] {
            let back = camera.undistort(camera.distort(ideal));
            assert!((back[0] - ideal[0]).hypotenuse(back[1] - ideal[1]) < 1e-4);
        }
    }
}
