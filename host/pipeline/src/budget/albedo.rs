//! The uncertainty of a directional albedo: one error acts in all cells, so that each effect is summed with its sign.

use crate::budget::equation::{Effect, Effects};
use crate::budget::patches::Patches;
use crate::budget::summary::CellBudget;
use crate::warnings::ring_weights;

/// Errors of noise and interpolation are one within so many degrees, and independent beyond: as for fits.
const PATCH_DEG: f64 = 30.0;
/// So many azimuths of the light stand for all.
const AZIMUTHS: usize = 12;

/// The share of the light that is reflected, mean over the light's azimuths, in one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlbedoUncertainty {
    /// Polar angle of the light, degrees.
    pub theta_i_deg: f64,
    /// ∫ f cos θv dωv.
    pub albedo: f64,
    /// Its standard uncertainty (k = 1), in the unit of the albedo.
    pub u: f64,
}

/// The directional albedo of light at the node nearest to a polar angle.
pub fn albedo_uncertainty(cells: &CellBudget<'_>, theta_i_deg: f64) -> AlbedoUncertainty {
    let grid = cells.grid();
    let (n_phi, step_deg) = (grid.n_phi(), grid.step_deg());
    let weights = ring_weights(grid.n_theta(), n_phi, step_deg);
    let ring = ((theta_i_deg / step_deg).round() as usize).min(grid.n_theta() - 1);
    let (mut albedo, mut effects) = (0.0, Effects::default());
    let views = Patches::of(grid, PATCH_DEG);
    let lights = Patches::sectors(ring as f64 * step_deg, PATCH_DEG);
    let mut noise = vec![0.0; lights * views.count];
    let azimuths = AZIMUTHS.min(n_phi);
    for k in 0..azimuths {
        let phi = k * n_phi / azimuths;
        let sector = phi * lights / n_phi;
        for view in 0..grid.n_directions() {
            let cell = grid.cell(ring * n_phi + phi, view);
            let Some((at_cell, share)) = cells.effects(cell) else {
                continue;
            };
            let weight = weights[view / n_phi] * cells.value(cell) / azimuths as f64;
            albedo += weight;
            effects.add(&at_cell, weight);
            noise[sector * views.count + views.of_direction(view)] += weight * share;
        }
    }
    let square = |of: f64| of * of;
    let known: f64 = Effect::ALL.map(|e| effects.square(e)).iter().sum();
    let scatter: f64 = noise.into_iter().map(square).sum();
    AlbedoUncertainty {
        theta_i_deg: ring as f64 * step_deg,
        albedo,
        u: (known + scatter).sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::summary::Holding;
    use gonia_brdf::Grid;
    use gonia_rig::{Budget, Input, KnownFrom, ReferenceCalibration};

    const RHO: f64 = 0.6;

    /// Of a Lambertian surface whose budget is one input, and of noise.
    fn of(input: Option<(Input, f64)>, noise: f32, theta_i_deg: f64) -> AlbedoUncertainty {
        let grid = Grid::with_step_deg(5.0).unwrap();
        let f = (RHO / std::f64::consts::PI) as f32;
        let plane = vec![f; grid.n_cells()];
        let errors = vec![noise * f; grid.n_cells()];
        let known = ReferenceCalibration::KnownReference;
        let budget = Budget::new(known, 0.3, [1000.0, 1000.0, 0.0], |of| {
            let value = input.filter(|(one, _)| *one == of).map_or(0.0, |of| of.1);
            (value, KnownFrom::Stated)
        });
        let cells = CellBudget::new(grid, &plane, (&errors, Holding::Noise), &[], &budget).unwrap();
        albedo_uncertainty(&cells, theta_i_deg)
    }

    #[test]
    fn an_error_of_scale_acts_in_all_cells_alike() {
        let found = of(Some((Input::Reference, 0.02)), 0.0, 30.0);
        assert!((found.albedo - RHO).abs() < 2e-3, "{found:?}");
        assert!((found.u / found.albedo - 0.02).abs() < 1e-9, "{found:?}");
        assert_eq!(found.theta_i_deg, 30.0);
    }

    #[test]
    fn a_tilt_whose_sign_turns_with_the_azimuth_leaves_the_mean() {
        // tan 60° times a degree, towards one side and away from it.
        let found = of(Some((Input::ReferenceTilt, 1.0)), 0.0, 60.0);
        assert!(found.u < 1e-12, "{found:?}");
    }

    #[test]
    fn noise_is_less_in_the_mean_than_in_a_cell_but_not_as_little_as_of_independent_cells() {
        let found = of(None, 0.1, 45.0);
        let share = found.u / found.albedo;
        assert!((0.005..0.03).contains(&share), "{share}");
    }
}
