//! Counts of cells whose true value lies within U.

use gonia_brdf::model::Brdf;
use gonia_brdf::{Direction, Grid};
use gonia_pipeline::budget::{CellUncertainty, Effect};
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

/// Cells within U, above it and all, and the sum of (error/u)², by part.
#[derive(Clone, Copy, Default)]
pub struct Counts([[f64; 4]; PARTS.len()]);

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for [within, above, all, _] in self.0 {
            let missed = (all - within).max(1.0);
            write!(
                f,
                "{:.1} ({:.0}) | ",
                100.0 * within / all,
                100.0 * above / missed
            )?;
        }
        let rms = self.0.map(|of| format!("{:.2}", (of[3] / of[2]).sqrt()));
        write!(f, "{}", rms.join(" "))
    }
}

/// All together.
pub fn sum(all: &[Counts]) -> Counts {
    let mut sum = Counts::default();
    for counts in all {
        for (sum, of) in sum.0.iter_mut().zip(&counts.0) {
            (0..4).for_each(|k| sum[k] += of[k]);
        }
    }
    sum
}

/// Counts the cells of a grid.
pub fn count(
    cells: &CellUncertainty<'_>,
    bar: &Bar<'_>,
    grid: Grid,
    material: &dyn Brdf,
) -> Counts {
    let mut counts = Counts::default();
    let truths: Vec<f64> = (0..grid.n_cells())
        .map(|cell| {
            let (light, view) = grid.light_and_view(cell);
            let (light, view) = (grid.direction(light), grid.direction(view));
            material.eval(light.to_vec3(), view.to_vec3())[1]
        })
        .collect();
    let bright = brightest(grid, |cell| truths[cell]);
    let bright_as_found = brightest(grid, |cell| f64::from(bar.plane[cell]));
    for (cell, truth) in truths.into_iter().enumerate() {
        let (light, view) = grid.light_and_view(cell);
        let (d_light, d_view) = (grid.direction(light), grid.direction(view));
        // Poles repeat one value.
        if bar.origin[cell] == 3
            || light % grid.n_phi() > 0 && light < grid.n_phi()
            || view % grid.n_phi() > 0 && view < grid.n_phi()
        {
            continue;
        }
        let found = f64::from(bar.plane[cell]);
        let effects = cells.effects(light, view);
        let shares: f64 = Effect::ALL.iter().map(|e| effects.of(*e).powi(2)).sum();
        let u = (f64::from(bar.noise[cell]).powi(2) + found * found * shares).sqrt();
        let off = (truth - found) / u;
        let steep = d_light.theta_deg().max(d_view.theta_deg()) > 75.0;
        for (part, counts) in PARTS.iter().zip(&mut counts.0) {
            let is_in = match part {
                Part::All => true,
                Part::Interior => !steep,
                Part::Grazing => steep,
                Part::Highlight => weighted(d_light, d_view, found) >= bright_as_found,
                Part::TrueHighlight => weighted(d_light, d_view, truth) >= bright,
            };
            if is_in {
                counts[0] += f64::from(off.abs() <= 2.0);
                counts[1] += f64::from(off > 2.0);
                counts[2] += 1.0;
                counts[3] += off * off;
            }
        }
    }
    counts
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
    all.sort_by(|a, b| b.total_cmp(a));
    all[all.len() / 100]
}
