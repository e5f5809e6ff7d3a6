//! Maps between the target's plane and an image without distortion.

use gonia_brdf::Elementary;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// A projective map of the plane. `pixel_from_target` takes millimetres on the target to pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Homography(Matrix3<f64>);

impl Homography {
    /// From its matrix, up to scale.
    pub fn from_matrix(matrix: Matrix3<f64>) -> Self {
        Self(matrix)
    }

    /// The map that takes four points to four others: the direct linear transform in normalised
    /// coordinates. `None` when three of the points lie on a line.
    pub fn from_corners(from: &[[f64; 2]; 4], to: &[[f64; 2]; 4]) -> Option<Self> {
        let (from, normalise) = normalised(from)?;
        let (to, normalise_to) = normalised(to)?;
        let mut a = SMatrix::<f64, 8, 8>::zeros();
        let mut b = SVector::<f64, 8>::zeros();
        for i in 0..4 {
            let ([x, y], [u, v]) = (from[i], to[i]);
            let rows = [
                [x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y],
                [0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y],
            ];
            for (r, row) in rows.iter().enumerate() {
                for (c, value) in row.iter().enumerate() {
                    a[(2 * i + r, c)] = *value;
                }
            }
            (b[2 * i], b[2 * i + 1]) = (u, v);
        }
        let h = a.full_piv_lu().solve(&b)?;
        let normal = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0);
        let matrix = normalise_to.try_inverse()? * normal * normalise;
        let regular = matrix.iter().all(|v| v.is_finite()) && matrix.determinant().abs() > 0.0;
        regular.then_some(Self(matrix))
    }

    /// The image of a point. Points on the horizon give infinities.
    pub fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let m = &self.0;
        let w = 1.0 / (m[(2, 0)] * x + m[(2, 1)] * y + m[(2, 2)]);
        [
            (m[(0, 0)] * x + m[(0, 1)] * y + m[(0, 2)]) * w,
            (m[(1, 0)] * x + m[(1, 1)] * y + m[(1, 2)]) * w,
        ]
    }

    /// The derivative at a point: columns are the images of steps along x and along y.
    pub fn jacobian(&self, [x, y]: [f64; 2]) -> [[f64; 2]; 2] {
        let m = &self.0;
        let image = m * Vector3::new(x, y, 1.0);
        let w = 1.0 / image[2];
        let column = |c: usize| [0, 1].map(|r| (m[(r, c)] - image[r] * w * m[(2, c)]) * w);
        [column(0), column(1)]
    }

    /// The inverse map. `None` for a singular matrix.
    pub fn inverse(&self) -> Option<Self> {
        self.0.try_inverse().map(Self)
    }
}

/// Points shifted to their mean and scaled to a mean distance of √2, and the map that does so.
fn normalised(points: &[[f64; 2]; 4]) -> Option<([[f64; 2]; 4], Matrix3<f64>)> {
    let mean = [0, 1].map(|i| points.iter().map(|p| p[i]).sum::<f64>() / 4.0);
    let spread = points
        .iter()
        .map(|p| (p[0] - mean[0]).hypotenuse(p[1] - mean[1]))
        .sum::<f64>()
        / 4.0;
    if !(spread > 0.0 && spread.is_finite()) {
        return None;
    }
    let s = std::f64::consts::SQRT_2 / spread;
    let moved = points.map(|p| [(p[0] - mean[0]) * s, (p[1] - mean[1]) * s]);
    let map = Matrix3::new(s, 0.0, -s * mean[0], 0.0, s, -s * mean[1], 0.0, 0.0, 1.0);
    Some((moved, map))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn four_points_go_where_they_should(
            moves in prop::array::uniform8(-30.0..30.0f64),
        ) {
            let from = [[-335.0, -335.0], [335.0, -335.0], [335.0, 335.0], [-335.0, 335.0]];
            let square = [[80.0, 80.0], [320.0, 90.0], [310.0, 300.0], [60.0, 330.0]];
            let mut to = square;
            for i in 0..4 {
                to[i][0] += moves[2 * i];
                to[i][1] += moves[2 * i + 1];
            }
            let map = Homography::from_corners(&from, &to).unwrap();
            let back = map.inverse().unwrap();
            for i in 0..4 {
                let image = map.apply(from[i]);
                prop_assert!((image[0] - to[i][0]).hypotenuse(image[1] - to[i][1]) < 1e-9);
                let again = back.apply(image);
                prop_assert!((again[0] - from[i][0]).hypotenuse(again[1] - from[i][1]) < 1e-7);
            }
        }
    }

    #[test]
    fn the_jacobian_is_the_derivative() {
        let to = [[80.0, 80.0], [320.0, 90.0], [310.0, 300.0], [60.0, 330.0]];
        let from = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let map = Homography::from_corners(&from, &to).unwrap();
        let jacobian = map.jacobian([0.3, -0.2]);
        for (axis, column) in jacobian.iter().enumerate() {
            let step = |h: f64| {
                let mut p = [0.3, -0.2];
                p[axis] += h;
                map.apply(p)
            };
            let (ahead, behind) = (step(1e-5), step(-1e-5));
            for (i, derivative) in column.iter().enumerate() {
                let numeric = (ahead[i] - behind[i]) / 2e-5;
                assert!((derivative - numeric).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn points_in_one_place_have_no_homography() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        assert!(Homography::from_corners(&square, &[[2.0, 2.0]; 4]).is_none());
    }
}
