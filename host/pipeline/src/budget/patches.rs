//! Patches of directions: bands of polar angles, cut into sectors about as wide.

use gonia_brdf::{Elementary, Grid};

/// Patches of a grid's directions.
pub(super) struct Patches {
    n_phi: usize,
    step_deg: f64,
    width_deg: f64,
    /// Of each band of polar angles the number of its first patch, and how many it has.
    bands: Vec<(usize, usize)>,
    /// How many there are.
    pub count: usize,
}

impl Patches {
    /// Patches about so wide, degrees.
    pub fn of(grid: Grid, width_deg: f64) -> Self {
        let last_deg = (grid.n_theta() - 1) as f64 * grid.step_deg();
        let (mut bands, mut count) = (Vec::new(), 0);
        for band in 0..=(last_deg / width_deg) as usize {
            let sectors = Self::sectors((band as f64 + 0.5) * width_deg, width_deg);
            bands.push((count, sectors));
            count += sectors;
        }
        Self {
            n_phi: grid.n_phi(),
            step_deg: grid.step_deg(),
            width_deg,
            bands,
            count,
        }
    }

    /// How many patches of a width lie around at a polar angle.
    pub fn sectors(theta_deg: f64, width_deg: f64) -> usize {
        let around = 360.0 / width_deg * theta_deg.to_radians().sine();
        (around.round() as usize).max(1)
    }

    /// The patch of a direction of the grid.
    pub fn of_direction(&self, index: usize) -> usize {
        let (ring, phi) = (index / self.n_phi, index % self.n_phi);
        let band = (ring as f64 * self.step_deg / self.width_deg) as usize;
        let (first, sectors) = self.bands[band.min(self.bands.len() - 1)];
        first + phi * sectors / self.n_phi
    }
}
