//! The paper's interpolation on a share of the cells: all of them take core-hours.

use gonia_brdf::baselines::{BaselineFiller, BaselineSettings, Workspace};
use gonia_brdf::interpolate::FillError;
use gonia_brdf::{Bins, DenseBrdf, Grid};
use rayon::prelude::*;

/// Steps of check cells, degrees: those below would take too long.
const CHECK_STEPS_DEG: [f64; 5] = [10.0, 12.0, 15.0, 20.0, 30.0];

/// The coarse grid whose nodes are nodes of a fine one; `None` where there is none of 10° to 30°.
pub fn check_grid(fine: Grid) -> Option<Grid> {
    CHECK_STEPS_DEG
        .into_iter()
        .filter(|step| (step / fine.step_deg()).fract() == 0.0)
        .find_map(|step| Grid::with_step_deg(step).ok())
}

/// The table at the nodes of a coarser grid.
pub fn coarse(dense: &DenseBrdf, grid: Grid) -> DenseBrdf {
    let node = |k| fine_node(grid, dense.grid(), k);
    DenseBrdf::from_fn(grid, |light, view| dense.at(node(light), node(view)))
}

/// Interpolates the nodes of a coarser grid from the bins of a fine one, cell by cell.
///
/// # Errors
/// Too few bins.
pub fn fill_check_cells(
    bins: &Bins,
    settings: &BaselineSettings,
    grid: Grid,
) -> Result<DenseBrdf, FillError> {
    let filler = BaselineFiller::new(bins, settings)?;
    let n = grid.n_directions();
    let rows: Vec<Vec<[f32; 3]>> = (0..n)
        .into_par_iter()
        .with_max_len(1)
        .map_init(Workspace::default, |work, light| {
            let light_node = fine_node(grid, bins.grid(), light);
            (light..n)
                .map(|view| filler.pair(light_node, fine_node(grid, bins.grid(), view), work))
                .collect()
        })
        .collect();
    let at = |light: usize, view: usize| {
        let (a, b) = (light.min(view), light.max(view));
        rows[a][b - a]
    };
    Ok(DenseBrdf::from_fn(grid, at))
}

/// The node of a finer grid where one of a coarser grid lies; the pole is the first.
fn fine_node(coarse: Grid, fine: Grid, node: usize) -> usize {
    let each = (coarse.step_deg() / fine.step_deg()).round() as usize;
    let (theta, phi) = (node / coarse.n_phi(), node % coarse.n_phi());
    if theta == 0 {
        return 0;
    }
    theta * each * fine.n_phi() + phi * each
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Elementary;
    use gonia_brdf::Sample;
    use gonia_brdf::model::{Brdf, Kurt};

    #[test]
    fn check_cells_are_nodes_of_the_fine_grid_and_hold_its_values() {
        let fine = Grid::with_step_deg(6.0).unwrap();
        let grid = check_grid(fine).unwrap();
        assert_eq!(grid.step_deg(), 12.0);
        let model = Kurt::white_reference_fabric();
        let dense = DenseBrdf::tabulate(fine, &model);
        assert_eq!(coarse(&dense, grid), DenseBrdf::tabulate(grid, &model));
    }

    #[test]
    fn the_papers_method_comes_near_a_matte_material() {
        let model = Kurt::white_reference_fabric();
        let fine = Grid::with_step_deg(15.0).unwrap();
        let mut samples = Vec::new();
        for i in 0..fine.n_directions() {
            for v in 0..fine.n_directions() {
                if (i * 31 + v * 17) % 5 != 0 {
                    continue;
                }
                let (l, v) = (fine.direction(i), fine.direction(v));
                samples.push(
                    Sample::new(l, v, model.eval(l.to_vec3(), v.to_vec3()).map(|f| f as f32))
                        .in_frame(0),
                );
            }
        }
        let bins = Bins::new(fine, &samples);
        let grid = Grid::with_step_deg(30.0).unwrap();
        let found = fill_check_cells(&bins, &BaselineSettings::PAPER, grid).unwrap();
        let truth = DenseBrdf::tabulate(grid, &model);
        let pairs = found.planes()[1].iter().zip(&truth.planes()[1]);
        let sum: f32 = pairs.map(|(a, b)| (a / b).natural_log().powi(2)).sum();
        let rms = (sum / grid.n_cells() as f32).sqrt();
        assert!(rms < 0.05, "{rms}");
    }
}
