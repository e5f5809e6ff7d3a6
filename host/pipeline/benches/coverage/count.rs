//! Counts of cells whose true value lies within U.

use gonia_brdf::model::Brdf;
use gonia_brdf::{Direction, Grid};
use gonia_pipeline::budget::{CellUncertainty, Effect, Effects};
use std::fmt;

/// Parts of the domain.
#[derive(Clone, Copy, PartialEq)]
pub enum Part {
    /// Every cell.
    All,
    /// Both polar angles at most 75°.
    Interior,
    /// Either above.
    Grazing,
    /// The cosine-weighted brightest hundredth of the cells as found: what the report calls so.
    Highlight,
    /// The same of the true values, which nobody knows of a real material.
    TrueHighlight,
}

/// All of them.
pub const PARTS: [Part; 5] = [
    Part::All,
    Part::Interior,
    Part::Grazing,
    Part::Highlight,
    Part::TrueHighlight,
];

/// Their names.
pub fn name(part: Part) -> &'static str {
    match part {
        Part::All => "all",
        Part::Interior => "interior",
        Part::Grazing => "grazing",
        Part::Highlight => "highlight",
        Part::TrueHighlight => "highlight by the truth",
    }
}

/// What was found.
pub struct Bar<'a> {
    /// Standard uncertainties of noise and interpolation.
    pub noise: &'a [f32],
    /// Where values come from.
    pub origin: &'a [u8],
    /// The values.
    pub plane: &'a [f32],
}

/// A cell as found, beside the truth.
pub struct Cell {
    /// To which of [`PARTS`] it belongs.
    pub is_in: [bool; PARTS.len()],
    /// The true value less the found one, as a share of the found one.
    pub off: f64,
    /// The standard uncertainty of noise and interpolation, as a share of the found value.
    pub noise: f64,
    /// What the inputs change it by.
    pub effects: Effects,
}

impl Cell {
    /// The combined standard uncertainty, as a share of the found value.
    pub fn u(&self) -> f64 {
        let shares: f64 = Effect::ALL.iter().map(|e| self.effects.square(*e)).sum();
        (self.noise * self.noise + shares).sqrt()
    }
}

/// Of one session: cells within U, those whose truth is above it, all, and the sum of (error/u)², by part.
#[derive(Clone, Copy, Default)]
pub struct Counts([[f64; 4]; PARTS.len()]);

impl Counts {
    /// Counts a cell.
    pub fn add(&mut self, cell: &Cell) {
        let off = cell.off / cell.u();
        for (is_in, counts) in cell.is_in.iter().zip(&mut self.0) {
            if *is_in {
                counts[0] += f64::from(off.abs() <= 2.0);
                counts[1] += f64::from(off > 2.0);
                counts[2] += 1.0;
                counts[3] += off * off;
            }
        }
    }
}

/// Of many sessions. The cells of a session share its errors, so that sessions count, not cells.
#[derive(Default)]
pub struct Sessions(pub Vec<Counts>);

impl Sessions {
    /// The mean over the sessions of the share of cells within U, and its standard error by the sessions' scatter.
    fn within(&self, part: usize) -> [f64; 2] {
        let shares = self.0.iter().map(|of| of.0[part]);
        let shares: Vec<f64> = shares
            .filter(|of| of[2] > 0.0)
            .map(|of| of[0] / of[2])
            .collect();
        let n = shares.len() as f64;
        let mean = shares.iter().sum::<f64>() / n;
        let squares: f64 = shares.iter().map(|share| (share - mean).powi(2)).sum();
        [mean, (squares / (n - 1.0) / n).sqrt()]
    }
}

impl fmt::Display for Sessions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut sums = [[0.0; 4]; PARTS.len()];
        for of in &self.0 {
            for (sum, of) in sums.iter_mut().zip(&of.0) {
                (0..4).for_each(|k| sum[k] += of[k]);
            }
        }
        write!(f, "{} | ", self.0.len())?;
        for part in 0..PARTS.len() {
            let [mean, error] = self.within(part).map(|share| 100.0 * share);
            write!(f, "{mean:.1} ± {error:.1} | ")?;
        }
        let rms = sums.map(|of| format!("{:.2}", (of[3] / of[2]).sqrt()));
        let above = sums.map(|of| format!("{:.0}", 100.0 * of[1] / (of[2] - of[0]).max(1.0)));
        write!(f, "{} | {}", rms.join(" "), above.join(" "))
    }
}

/// Visits a grid's cells, all but extrapolated ones: one of each pair that reciprocity makes the same.
pub fn visit(
    cells: &CellUncertainty<'_>,
    bar: &Bar<'_>,
    (grid, material): (Grid, &dyn Brdf),
    mut at: impl FnMut(&Cell),
) {
    let n = grid.n_directions();
    let mut truths = vec![0.0; grid.n_cells()];
    for light in 0..n {
        let d_light = grid.direction(light).to_vec3();
        for view in light..n {
            let truth = material.eval(d_light, grid.direction(view).to_vec3())[1];
            (truths[light * n + view], truths[view * n + light]) = (truth, truth);
        }
    }
    let bright = brightest(grid, |cell| truths[cell]);
    let bright_as_found = brightest(grid, |cell| f64::from(bar.plane[cell]));
    // Poles repeat one value.
    let repeats = |d: usize| (1..grid.n_phi()).contains(&d);
    for (cell, truth) in truths.into_iter().enumerate() {
        let (light, view) = grid.light_and_view(cell);
        if view < light || bar.origin[cell] == 3 || repeats(light) || repeats(view) {
            continue;
        }
        let (d_light, d_view) = (grid.direction(light), grid.direction(view));
        let found = f64::from(bar.plane[cell]);
        let steep = d_light.theta_deg().max(d_view.theta_deg()) > 75.0;
        let is_in = PARTS.map(|part| match part {
            Part::All => true,
            Part::Interior => !steep,
            Part::Grazing => steep,
            Part::Highlight => weighted(d_light, d_view, found) >= bright_as_found,
            Part::TrueHighlight => weighted(d_light, d_view, truth) >= bright,
        });
        at(&Cell {
            is_in,
            off: truth / found - 1.0,
            noise: f64::from(bar.noise[cell]) / found,
            effects: cells.effects(light, view),
        });
    }
}

fn weighted(light: Direction, view: Direction, value: f64) -> f64 {
    value * light.to_vec3()[2] * view.to_vec3()[2]
}

/// The value, weighted by the cosines, that one cell in a hundred exceeds.
fn brightest(grid: Grid, value: impl Fn(usize) -> f64) -> f64 {
    let mut all: Vec<f64> = (0..grid.n_cells())
        .map(|cell| {
            let (light, view) = grid.light_and_view(cell);
            weighted(grid.direction(light), grid.direction(view), value(cell))
        })
        .collect();
    let rank = all.len() - 1 - all.len() / 100;
    *all.select_nth_unstable_by(rank, f64::total_cmp).1
}
