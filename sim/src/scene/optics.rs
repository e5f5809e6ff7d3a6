//! The pinhole camera on its arm.

use super::SceneGeometry;
use gonia_brdf::direction::{Vec3, dot};
use gonia_rig::Placement;

/// A camera at a pose: maps between pixels and the target's plane.
pub struct Optics {
    right: Vec3,
    up: Vec3,
    back: Vec3,
    at_m: Vec3,
    focal_px: f64,
    centre_px: [f64; 2],
    distortion: [f64; 2],
    sigma_px: f64,
    size_px: [f64; 2],
    /// Rows of the homography (x, y, 1) mm · w from (column, row, 1) pixels.
    target_from_pixel: [Vec3; 3],
}

impl Optics {
    pub fn new(geometry: &SceneGeometry, camera: &Placement) -> Self {
        let (right, up, back) = (camera.right, camera.up, camera.back);
        let (f, c) = (geometry.focal_px, geometry.centre_px);
        // Ray of a pixel: −back + right·(px − cx)/f − up·(py − cy)/f; it meets z = 0 at
        // camera − ray·camera_z/ray_z. Each of the three numbers is linear in the pixel.
        let ray = |axis: usize| -> Vec3 {
            [
                right[axis] / f,
                -up[axis] / f,
                -back[axis] - right[axis] * c[0] / f + up[axis] * c[1] / f,
            ]
        };
        let (rx, ry, rz) = (ray(0), ray(1), ray(2));
        let at = camera.at_mm;
        let row =
            |along: Vec3, from: f64| -> Vec3 { [0, 1, 2].map(|i| from * rz[i] - at[2] * along[i]) };
        Self {
            right,
            up,
            back,
            at_m: at.map(|c| c * 1e-3),
            focal_px: f,
            centre_px: c,
            distortion: geometry.distortion,
            // The aperture of a square pixel has a variance of 1/12.
            sigma_px: (geometry.blur_px * geometry.blur_px + 1.0 / 12.0).sqrt(),
            size_px: [geometry.width_px as f64, geometry.height_px as f64],
            target_from_pixel: [row(rx, at[0]), row(ry, at[1]), rz],
        }
    }

    /// Where a pixel's ray meets the target's plane, mm; `None` at or above the horizon.
    pub fn target_point_mm(&self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let [x, y, w] = self.homogeneous(self.undistorted(pixel));
        (w < -1e-9).then(|| [x / w, y / w])
    }

    /// Standard deviation of the pixel's blurred aperture along x and along y of the target, mm.
    pub fn blur_mm(&self, pixel: [f64; 2]) -> [f64; 2] {
        let Some(at) = self.target_point_mm(pixel) else {
            return [0.0; 2];
        };
        let across = self.blur_across(pixel);
        [across(0, at[0]), across(1, at[1])]
    }

    /// Standard deviation of the pixel's blurred aperture across an edge of the target (the coordinate that is
    /// constant on it, and its value in mm), in mm: the pixel's distance from the edge in mm over it is the
    /// distance of the edge's image in pixels over the blur, at any perspective.
    pub fn blur_across(&self, pixel: [f64; 2]) -> impl Fn(usize, f64) -> f64 + use<> {
        let m = self.target_from_pixel;
        let w = self.homogeneous(self.undistorted(pixel))[2];
        let sigma_px = self.sigma_px;
        move |axis, edge_mm| {
            let du = (m[axis][0] - edge_mm * m[2][0]) / w;
            let dv = (m[axis][1] - edge_mm * m[2][1]) / w;
            sigma_px * (du * du + dv * dv).sqrt()
        }
    }

    /// The largest of [`Self::blur_mm`] within a square of the given half side, mm: it grows with
    /// distance, so that it is at one of the corners.
    pub fn largest_blur_mm(&self, half_mm: f64) -> f64 {
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .iter()
            .filter_map(|c| self.project([c[0] * half_mm * 1e-3, c[1] * half_mm * 1e-3, 0.0]))
            .flat_map(|(pixel, _)| self.blur_mm(pixel))
            .fold(0.0, f64::max)
    }

    /// Pixel and pixels per metre at a point of space in front of the camera.
    pub fn project(&self, point_m: Vec3) -> Option<([f64; 2], f64)> {
        let from = [0, 1, 2].map(|i| point_m[i] - self.at_m[i]);
        let depth = -dot(from, self.back);
        if depth <= 1e-3 {
            return None;
        }
        let (x, y) = (dot(from, self.right) / depth, -dot(from, self.up) / depth);
        let r2 = x * x + y * y;
        let stretch = 1.0 + r2 * (self.distortion[0] + r2 * self.distortion[1]);
        let pixel = [
            self.centre_px[0] + self.focal_px * x * stretch,
            self.centre_px[1] + self.focal_px * y * stretch,
        ];
        Some((pixel, self.focal_px / depth))
    }

    /// Standard deviation of a pixel's blurred aperture, pixels.
    pub fn sigma_px(&self) -> f64 {
        self.sigma_px
    }

    /// Width and height of a frame, pixels.
    pub fn size_px(&self) -> [f64; 2] {
        self.size_px
    }

    fn homogeneous(&self, p: [f64; 2]) -> Vec3 {
        self.target_from_pixel
            .map(|row| row[0] * p[0] + row[1] * p[1] + row[2])
    }

    /// The pixel where a pinhole without distortion would see what this pixel sees.
    fn undistorted(&self, pixel: [f64; 2]) -> [f64; 2] {
        let [k1, k2] = self.distortion;
        if k1 == 0.0 && k2 == 0.0 {
            return pixel;
        }
        let xd = [0, 1].map(|i| (pixel[i] - self.centre_px[i]) / self.focal_px);
        let mut x = xd;
        for _ in 0..8 {
            let r2 = x[0] * x[0] + x[1] * x[1];
            let stretch = 1.0 + r2 * (k1 + r2 * k2);
            x = xd.map(|c| c / stretch);
        }
        [0, 1].map(|i| self.centre_px[i] + self.focal_px * x[i])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::{Direction, Elementary};

    #[test]
    fn pixels_and_points_of_the_target_agree() {
        let mut geometry = SceneGeometry::paper(400);
        geometry.distortion = [-0.08, 0.02];
        for view in [(0.0, 0.0), (30.0, 200.0), (75.0, 45.0)] {
            let camera = geometry.camera_at(Direction::from_deg(view.0, view.1));
            let optics = Optics::new(&geometry, &camera);
            for point in [[0.0, 0.0], [300.0, -200.0], [-335.0, 335.0]] {
                let (pixel, _) = optics
                    .project([point[0] * 1e-3, point[1] * 1e-3, 0.0])
                    .unwrap();
                let back = optics.target_point_mm(pixel).unwrap();
                assert!((back[0] - point[0]).hypotenuse(back[1] - point[1]) < 1e-6);
            }
        }
    }

    #[test]
    fn an_edge_is_as_many_blurs_away_as_its_image() {
        let geometry = SceneGeometry::paper(240);
        let camera = geometry.camera_at(Direction::from_deg(75.0, 25.0));
        let optics = Optics::new(&geometry, &camera);
        let image = |y: f64| optics.project([0.335, y * 1e-3, 0.0]).unwrap().0;
        let ([x0, y0], [x1, y1]) = (image(-300.0), image(300.0));
        let length = (x1 - x0).hypotenuse(y1 - y0);
        for pixel in [[150.0, 140.0], [120.0, 150.0], [90.0, 160.0]] {
            let off_px = ((pixel[0] - x0) * (y1 - y0) - (pixel[1] - y0) * (x1 - x0)) / length;
            let off_mm = optics.target_point_mm(pixel).unwrap()[0] - 335.0;
            let blurs = off_mm / optics.blur_across(pixel)(0, 335.0);
            let expected = off_px / optics.sigma_px;
            assert!(
                (blurs.abs() - expected.abs()).abs() < 1e-9,
                "{blurs} {expected}"
            );
        }
    }

    #[test]
    fn the_image_is_upright_and_not_mirrored() {
        let geometry = SceneGeometry::paper(400);
        let camera = geometry.camera_at(Direction::from_deg(30.0, 90.0));
        let optics = Optics::new(&geometry, &camera);
        // From +y the camera has −x at its right and the far side, −y, up.
        let at = |x, y| optics.project([x, y, 0.0]).unwrap().0;
        assert!(at(-0.1, 0.0)[0] > 200.0);
        assert!(at(0.0, -0.1)[1] < 200.0);
    }
}
