//! The rig's camera: what a pose lets one expect in the image.

use crate::{CameraGeometry, Homography};
use gonia_brdf::Direction;
use gonia_brdf::Elementary;
use nalgebra::{Matrix3, Rotation2};

/// Intrinsics and distance of the camera. *Ideal* pixels are those of a pinhole; a lens with radial
/// distortion moves them: x = x'·(1 + k1·r² + k2·r⁴), x' the ideal position from the principal
/// point in focal lengths, r its length.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraModel {
    distance_mm: f64,
    focal_px: f64,
    centre_px: [f64; 2],
    k1: f64,
    k2: f64,
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
    pub fn new(camera: &CameraGeometry) -> Self {
        Self {
            distance_mm: camera.distance_m * 1000.0,
            focal_px: camera.focal_px,
            centre_px: camera.centre_px,
            k1: camera.k1,
            k2: camera.k2,
            size_px: [camera.width_px, camera.height_px],
        }
    }

    /// Whether the lens bends straight lines.
    pub fn is_distorted(&self) -> bool {
        self.k1 != 0.0 || self.k2 != 0.0
    }

    /// The map from millimetres on the target to ideal pixels, for a camera that looks at the
    /// centre from `view`: image up is −∂d/∂θ, image right (−sin φ, cos φ, 0).
    pub fn predict(&self, view: Direction, by: CameraShift) -> Homography {
        let (st, ct) = (view.theta + by.theta).sine_cosine();
        let (sp, cp) = (view.phi + by.phi).sine_cosine();
        let turn = Rotation2::new(by.roll);
        let focal = self.focal_px * by.log_scale.exponential();
        let image = |right: f64, down: f64| turn * nalgebra::Vector2::new(right, down) * focal;
        // Columns: where a step along x, a step along y and the centre go; the last row is depth.
        let (x, y) = (image(-sp, ct * cp), image(cp, ct * sp));
        let k = Matrix3::new(
            1.0,
            0.0,
            self.centre_px[0] + by.shift_px[0],
            0.0,
            1.0,
            self.centre_px[1] + by.shift_px[1],
            0.0,
            0.0,
            1.0,
        );
        Homography::from_matrix(
            k * Matrix3::new(
                x[0],
                y[0],
                0.0,
                x[1],
                y[1],
                0.0,
                -st * cp,
                -st * sp,
                self.distance_mm,
            ),
        )
    }

    /// Where the lens puts an ideal pixel.
    pub fn distort(&self, ideal: [f64; 2]) -> [f64; 2] {
        if !self.is_distorted() {
            return ideal;
        }
        let x = [0, 1].map(|i| (ideal[i] - self.centre_px[i]) / self.focal_px);
        let r2 = x[0] * x[0] + x[1] * x[1];
        let stretch = 1.0 + r2 * (self.k1 + r2 * self.k2);
        [0, 1].map(|i| self.centre_px[i] + self.focal_px * x[i] * stretch)
    }

    /// The ideal pixel that the lens puts at `pixel`.
    pub fn undistort(&self, pixel: [f64; 2]) -> [f64; 2] {
        if !self.is_distorted() {
            return pixel;
        }
        let seen = [0, 1].map(|i| (pixel[i] - self.centre_px[i]) / self.focal_px);
        let mut x = seen;
        // Converges by a factor of about |k1|·r² a round: far below a thousandth of a pixel here.
        for _ in 0..8 {
            let r2 = x[0] * x[0] + x[1] * x[1];
            x = seen.map(|c| c / (1.0 + r2 * (self.k1 + r2 * self.k2)));
        }
        [0, 1].map(|i| self.centre_px[i] + self.focal_px * x[i])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rig;

    #[test]
    fn the_prediction_follows_the_conventions() {
        let camera = CameraModel::new(&Rig::paper(400).camera);
        let at = |t: f64, p: f64, mm| {
            camera
                .predict(Direction::from_deg(t, p), CameraShift::default())
                .apply(mm)
        };
        assert_eq!(at(0.0, 0.0, [0.0, 0.0]), [200.0, 200.0]);
        // At the pole with φ = 0, right is +y and up is −x.
        let scale = 625.0 / 1800.0;
        let right = at(0.0, 0.0, [0.0, 100.0]);
        assert!((right[0] - 200.0 - 100.0 * scale).abs() < 1e-9 && right[1] == 200.0);
        assert!(at(0.0, 0.0, [-100.0, 0.0])[1] < 200.0);
        // Obliquely, what lies towards the camera is low in the image and larger.
        let (near, far) = (at(60.0, 90.0, [0.0, 100.0]), at(60.0, 90.0, [0.0, -100.0]));
        assert!(near[1] > 200.0 && near[1] - 200.0 > 200.0 - far[1]);
        assert!(at(60.0, 90.0, [-100.0, 0.0])[0] > 200.0);
    }

    #[test]
    fn undistortion_undoes_distortion() {
        let mut rig = Rig::paper(1024);
        (rig.camera.k1, rig.camera.k2) = (-0.12, 0.05);
        let camera = CameraModel::new(&rig.camera);
        for ideal in [[512.0, 512.0], [30.0, 900.0], [1000.0, 10.0]] {
            let back = camera.undistort(camera.distort(ideal));
            assert!((back[0] - ideal[0]).hypotenuse(back[1] - ideal[1]) < 1e-4);
        }
    }
}
