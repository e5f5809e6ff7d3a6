//! What all cells of a fit share: the effects of the measurement equation, cell by cell.

use crate::budget::cells::CellUncertainty;
use crate::budget::equation::{Effect, Effects};
use gonia_brdf::fit::Cell;
use gonia_brdf::{DenseBrdf, Direction};
use gonia_rig::Budget;

/// Of each effect that changes anything, by which share of its value it changes each cell and channel: slopes are those
/// of the dense BRDF at the nearest nodes. Each has two rows, for the mean of what is measured there and with light and
/// view exchanged, and for the spread about it.
pub(crate) fn shared_errors(
    dense: &DenseBrdf,
    budget: &Budget,
    cells: &[Cell],
) -> Vec<Vec<[f64; 3]>> {
    let grid = dense.grid();
    let planes = dense.planes().iter();
    let channels: Vec<CellUncertainty<'_>> = planes
        .filter_map(|plane| CellUncertainty::new(grid, plane, &[], budget))
        .collect();
    let last = grid.n_directions() - 1;
    let node = |v| {
        let direction = Direction::from_vec3(v);
        // Beyond the grid's last polar angle that has the say.
        grid.nearest(direction.theta_deg(), direction.phi_deg())
            .unwrap_or(last)
    };
    let of_cell = |cell: &Cell| {
        let (light, view) = (node(cell.light), node(cell.view));
        [0, 1, 2].map(|c| {
            let of = channels.get(c).map(|of| of.effects(light, view));
            of.unwrap_or_default()
        })
    };
    let all: Vec<[Effects; 3]> = cells.iter().map(of_cell).collect();
    let of_one = |(effect, which): (Effect, usize)| -> Vec<[f64; 3]> {
        let share = |of: &Effects| of.mean_and_spread(effect)[which];
        let shares = |of: &[Effects; 3]| of.each_ref().map(share);
        all.iter().map(shares).collect()
    };
    let changes = |shares: &Vec<[f64; 3]>| shares.iter().flatten().any(|share| *share != 0.0);
    Effect::ALL
        .into_iter()
        .flat_map(|effect| [(effect, 0), (effect, 1)])
        .map(of_one)
        .filter(changes)
        .collect()
}
