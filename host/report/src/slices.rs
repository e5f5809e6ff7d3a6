//! Slices φi/φv at fixed polar angles, as the paper's Fig. 9 a.

use gonia_brdf::Elementary;
use gonia_brdf::{Brdf, DenseBrdf, Grid};
use gonia_render::color::luminance;
use gonia_rig::CellMask;

/// The polar angles of the paper's figure, degrees.
const THETA_DEG: [f64; 3] = [30.0, 60.0, 74.0];

/// One slice: `n` × `n` values, φv to the right, φi upwards (the first row is the last φi).
pub struct Slice<T> {
    /// Polar angle of the light, degrees (of the nearest node).
    pub theta_i_deg: f64,
    /// Polar angle of the view, degrees.
    pub theta_v_deg: f64,
    /// Values from the top left.
    pub values: Vec<T>,
}

/// The nine pairs of polar angles, light by light, of what `value` says of a light and a view.
pub fn each<T>(grid: Grid, mut value: impl FnMut(usize, usize) -> T) -> Vec<Slice<T>> {
    let n = grid.n_phi();
    let node =
        |theta_deg: f64| ((theta_deg / grid.step_deg()).round() as usize).min(grid.n_theta() - 1);
    let mut slices = Vec::with_capacity(9);
    for i in THETA_DEG.map(node) {
        for v in THETA_DEG.map(node) {
            let mut values = Vec::with_capacity(n * n);
            for row in 0..n {
                for column in 0..n {
                    values.push(value(i * n + (n - 1 - row), v * n + column));
                }
            }
            slices.push(Slice {
                theta_i_deg: i as f64 * grid.step_deg(),
                theta_v_deg: v as f64 * grid.step_deg(),
                values,
            });
        }
    }
    slices
}

/// Slices of a table.
pub fn of_table(dense: &DenseBrdf) -> Vec<Slice<[f32; 3]>> {
    each(dense.grid(), |light, view| dense.at(light, view))
}

/// Slices of a model at the nodes of a grid.
pub fn of_model(model: &dyn Brdf, grid: Grid) -> Vec<Slice<[f32; 3]>> {
    let at = |index| grid.direction(index).to_vec3();
    each(grid, |light, view| {
        model.eval(at(light), at(view)).map(|v| v as f32)
    })
}

/// Which cells of the slices are in a mask.
pub fn of_mask(mask: &CellMask) -> Vec<Slice<bool>> {
    let grid = mask.grid();
    each(grid, |light, view| mask.contains(grid.cell(light, view)))
}

/// Standard errors as shares of their values, mean over the channels.
pub fn relative_errors(errors: &DenseBrdf, values: &DenseBrdf) -> Vec<Slice<f32>> {
    each(values.grid(), |light, view| {
        let (e, v) = (errors.at(light, view), values.at(light, view));
        [0, 1, 2].map(|c| e[c] / v[c].max(1e-9)).iter().sum::<f32>() / 3.0
    })
}

/// Mean over the channels of ln(a/b), cell by cell.
pub fn log_ratio(a: &[Slice<[f32; 3]>], b: &[Slice<[f32; 3]>]) -> Vec<Slice<f32>> {
    let ratio = |(a, b): (&[f32; 3], &[f32; 3])| {
        let logs = [0, 1, 2].map(|c| (a[c].max(1e-9) / b[c].max(1e-9)).natural_log());
        (logs[0] + logs[1] + logs[2]) / 3.0
    };
    a.iter()
        .zip(b)
        .map(|(a, b)| Slice {
            theta_i_deg: a.theta_i_deg,
            theta_v_deg: a.theta_v_deg,
            values: a.values.iter().zip(&b.values).map(ratio).collect(),
        })
        .collect()
}

/// The value that shows as white: a high percentile of the luminance of all slices, so that a few
/// peaks do not leave the rest in the dark. Shared by everything that is compared.
pub fn white(slices: &[Slice<[f32; 3]>]) -> f32 {
    let all = slices.iter().flat_map(|slice| &slice.values);
    percentile(all.map(|rgb| luminance(*rgb)), 0.985).max(1e-9)
}

/// The limit of the scale of differences: a high percentile of their size, at least 2 %.
pub fn largest_difference(slices: &[Slice<f32>]) -> f32 {
    let all = slices.iter().flat_map(|slice| &slice.values);
    percentile(all.map(|v| v.abs()), 0.98).max(0.02)
}

fn percentile(values: impl Iterator<Item = f32>, share: f64) -> f32 {
    let mut values: Vec<f32> = values.collect();
    if values.is_empty() {
        return 0.0;
    }
    let rank = ((values.len() as f64 * share) as usize).min(values.len() - 1);
    *values.select_nth_unstable_by(rank, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slice_has_view_to_the_right_and_light_upwards() {
        let grid = Grid::with_step_deg(30.0).unwrap();
        let n = grid.n_directions();
        let plane: Vec<f32> = (0..n * n).map(|c| (c / n * 1000 + c % n) as f32).collect();
        let dense = DenseBrdf::new(grid, [plane.clone(), plane.clone(), plane]).unwrap();
        let slices = of_table(&dense);
        assert_eq!(slices.len(), 9);
        // The second one: light at 30°, view at 60°; bottom left is φi = φv = 0.
        let slice = &slices[1];
        assert_eq!((slice.theta_i_deg, slice.theta_v_deg), (30.0, 60.0));
        let at = |right: usize, up: usize| slice.values[(11 - up) * 12 + right][0];
        assert_eq!(at(0, 0), (12 * 1000 + 24) as f32);
        assert_eq!(at(3, 0), (12 * 1000 + 27) as f32);
        assert_eq!(at(0, 2), (14 * 1000 + 24) as f32);
        // 74° has no node of its own at 30° steps.
        assert_eq!(slices[8].theta_v_deg, 60.0);
        let mask = CellMask::from_cells(grid, [grid.cell(14, 24)]);
        let marked = of_mask(&mask);
        assert_eq!(
            marked[1].values.iter().position(|m| *m),
            Some((11 - 2) * 12)
        );
        assert!(
            log_ratio(&slices, &slices)
                .iter()
                .all(|s| s.values.iter().all(|v| *v == 0.0))
        );
    }
}
