//! How values in the directions of a patch follow from those at its corners.
//!
//! Between the corners values are kriged with a Gaussian kernel much wider than the patch, which is as good
//! as a polynomial through as many points as there are, wherever they lie.

use crate::direction::Vec3;
use crate::elementary::Elementary;
use nalgebra::{DMatrix, DVector};

/// Range of the kernel in radii of the patch. With 2 even a linear function was off by a hundredth of its range.
const RANGE: f64 = 12.0;
/// Keeps the matrix of a kernel that wide regular, and the weights small where corners of two rows of patches
/// all but coincide: in no direction do their absolute values add up to much more than 2.
const NUGGET: f64 = 1e-7;
/// The widest vectors in use hold 16 numbers.
pub(super) const PAD: usize = 16;

/// How each direction of a patch follows from its corners.
#[derive(Clone, Debug)]
pub struct Weights {
    /// Corner by corner the weights in all directions, padded by zeros.
    pub(super) by_corner: Vec<f32>,
    /// Directions, padded.
    pub(super) width: usize,
}

impl Weights {
    /// Ordinary kriging from `corners` to `directions`. `None` where there are not more directions than
    /// corners, and nothing is to be gained.
    pub fn new(corners: &[Vec3], directions: &[Vec3], centre: Vec3) -> Option<Self> {
        if directions.len() <= corners.len() {
            return None;
        }
        let distance2 = |a: Vec3, b: Vec3| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>();
        let radius2 = corners
            .iter()
            .fold(0.0, |r: f64, c| r.max(distance2(*c, centre)));
        let kernel =
            |a: Vec3, b: Vec3| (-distance2(a, b) / (RANGE * RANGE * radius2)).exponential();
        let n = corners.len();
        let matrix = DMatrix::from_fn(n, n, |i, j| {
            kernel(corners[i], corners[j]) + if i == j { NUGGET } else { 0.0 }
        });
        let factor = matrix.cholesky()?;
        let ones = factor.solve(&DVector::from_element(n, 1.0));
        let width = directions.len().next_multiple_of(PAD);
        let mut by_corner = vec![0.0; n * width];
        for (place, direction) in directions.iter().enumerate() {
            let mut weights =
                factor.solve(&DVector::from_fn(n, |i, _| kernel(corners[i], *direction)));
            // They are to add up to 1.
            let missing = (1.0 - weights.sum()) / ones.sum();
            weights += missing * &ones;
            for (corner, weight) in weights.iter().enumerate() {
                by_corner[corner * width + place] = *weight as f32;
            }
        }
        Some(Self { by_corner, width })
    }

    /// How many corners there are.
    pub(super) fn corners(&self) -> usize {
        self.by_corner.len() / self.width
    }

    /// The weight of a corner in a direction.
    pub(super) fn at(&self, corner: usize, place: usize) -> f32 {
        self.by_corner[corner * self.width + place]
    }
}
