//! The cells that a model is fitted to: a few thousand say as much as sixty million.

use crate::bins::Bins;
use crate::dense::DenseBrdf;
use crate::direction::Vec3;
use crate::elementary::Elementary;
use crate::random::Random;

/// With both polar angles beyond this nothing can be measured, and nothing is fitted.
const UNMEASURED_DEG: f64 = 78.0;
/// Candidates a cell that is chosen for its brightness.
const CANDIDATES: usize = 64;

/// A value to fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Unit vector towards the light.
    pub light: Vec3,
    /// Unit vector towards the viewer.
    pub view: Vec3,
    /// The BRDF per channel.
    pub value: [f64; 3],
}

/// Draws `count` cells: half of them evenly over both hemispheres (by solid angle, so that a pole
/// counts once), half in proportion to f cos θi cos θv, so that narrow highlights are seen.
pub fn draw(dense: &DenseBrdf, count: usize, seed: u64) -> Vec<Cell> {
    let grid = dense.grid();
    let mut random = Random::new(seed);
    let theta_max = (grid.n_theta() - 1) as f64 * grid.step_deg();
    let least_cosine = theta_max.to_radians().cosine();
    let mut node = |theta_limit: f64| loop {
        let theta = random.between(least_cosine, 1.0).arc_cosine().to_degrees();
        let phi = random.between(0.0, 360.0);
        if let Some(node) = grid.nearest(theta, phi)
            && theta <= theta_limit
        {
            break node;
        }
    };
    let candidate = || {
        let light = node(90.0);
        let beyond = grid.direction(light).theta_deg() > UNMEASURED_DEG;
        let view = node(if beyond { UNMEASURED_DEG - 1.0 } else { 90.0 });
        let (i, v) = (
            grid.direction(light).to_vec3(),
            grid.direction(view).to_vec3(),
        );
        Cell {
            light: i,
            view: v,
            value: dense.at(light, view).map(f64::from),
        }
    };
    even_and_bright(count, candidate)
}

/// The same of what was measured: bins at their mean directions, half of them any, half by brightness.
/// Unlike cells between them they owe nothing to the interpolation.
pub fn draw_measured(bins: &Bins, count: usize, seed: u64) -> Vec<Cell> {
    let bins = bins.bins();
    let mut random = Random::new(seed);
    if bins.is_empty() {
        return Vec::new();
    }
    even_and_bright(count, || {
        let bin = &bins[(random.share() * bins.len() as f64) as usize];
        Cell {
            light: bin.light.map(f64::from),
            view: bin.view.map(f64::from),
            value: bin.median.map(f64::from),
        }
    })
}

/// Half of the cells as the candidates come, half in proportion to f cos θi cos θv.
fn even_and_bright(count: usize, mut candidate: impl FnMut() -> Cell) -> Vec<Cell> {
    let mut cells: Vec<Cell> = (0..count - count / 2).map(|_| candidate()).collect();
    let candidates: Vec<Cell> = (0..count / 2 * CANDIDATES).map(|_| candidate()).collect();
    let weight =
        |cell: &Cell| cell.value.iter().sum::<f64>().max(0.0) * cell.light[2] * cell.view[2];
    let step = candidates.iter().map(weight).sum::<f64>() / (count / 2).max(1) as f64;
    // Systematic resampling; a candidate brighter than a step is taken once.
    let mut passed = 0.0;
    let mut next = 0.5 * step;
    for cell in &candidates {
        passed += weight(cell);
        if passed > next {
            cells.push(*cell);
            next += step * ((passed - next) / step).floor() + step;
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Grid;
    use crate::model::{Kurt, KurtLobe};

    #[test]
    fn half_of_the_cells_lie_where_it_is_bright_and_none_in_the_unmeasured_region() {
        let lobe = KurtLobe {
            specular: [1.0; 3],
            f0: 0.5,
            mx: 0.06,
            my: 0.06,
            alpha: 0.3,
            azimuth_deg: 0.0,
        };
        let model = Kurt::new([0.02; 3], &[lobe]);
        let dense = DenseBrdf::tabulate(Grid::with_step_deg(4.0).unwrap(), &model);
        let cells = draw(&dense, 2000, 1);
        assert!((1500..=2000).contains(&cells.len()), "{}", cells.len());
        let bright = cells.iter().filter(|cell| cell.value[1] > 0.1).count();
        assert!(bright > cells.len() / 5, "{bright}");
        let least = UNMEASURED_DEG.to_radians().cosine() - 1e-9;
        assert!(cells.iter().all(|c| c.light[2].max(c.view[2]) >= least));
        assert_eq!(draw(&dense, 2000, 1), cells);
    }
}
