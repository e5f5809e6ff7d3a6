//! What the uncertainty of a dense BRDF is made of, by part of the domain.

use crate::budget::cells::CellUncertainty;
use crate::budget::contribution::{CONTRIBUTIONS, Contribution};
use crate::budget::equation::{Effect, Effects};
use gonia_brdf::interpolate::Origin;
use gonia_brdf::{Direction, Elementary, Grid};
use gonia_rig::stratum::{self, Stratum};
use gonia_rig::{Budget, Input, Scale};

/// So many cells tell of all.
const TOLD_BY: usize = 40_000;
/// The highlight: so large a share of the cells is the brightest.
const HIGHLIGHT: f64 = 0.01;

/// What standard errors hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holding {
    /// Noise and interpolation alone.
    Noise,
    /// Everything, combined.
    All,
}

/// A channel of a dense BRDF with its standard errors and its budget, cell by cell.
pub struct CellBudget<'a> {
    cells: CellUncertainty<'a>,
    grid: Grid,
    plane: &'a [f32],
    errors: &'a [f32],
    holding: Holding,
    origins: &'a [u8],
}

/// The contributions to the relative standard uncertainty of one value.
pub type Shares = [f64; CONTRIBUTIONS];

impl<'a> CellBudget<'a> {
    /// Of a plane of values, their standard errors and, where they are known, their origins
    /// ([`Origin`]; an empty list where not). `None` where their sizes are not the grid's.
    pub fn new(
        grid: Grid,
        plane: &'a [f32],
        (errors, holding): (&'a [f32], Holding),
        origins: &'a [u8],
        budget: &Budget,
    ) -> Option<Self> {
        let n = grid.n_cells();
        let fits = errors.len() == n && (origins.is_empty() || origins.len() == n);
        let cells = CellUncertainty::new(grid, plane, origins, budget).filter(|_| fits)?;
        Some(Self {
            cells,
            grid,
            plane,
            errors,
            holding,
            origins,
        })
    }

    /// The grid.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// The value of a cell.
    pub fn value(&self, cell: usize) -> f64 {
        f64::from(self.plane[cell])
    }

    /// Whether a cell's value is extrapolated, and its number not to be trusted.
    pub fn is_extrapolated(&self, cell: usize) -> bool {
        self.origins.get(cell) == Some(&(Origin::Extrapolated as u8))
    }

    /// The effects at a cell, and what noise and interpolation add, as a share; `None` of a value that is not
    /// positive.
    pub(super) fn effects(&self, cell: usize) -> Option<(Effects, f64)> {
        let value = self.value(cell);
        if value.is_nan() || value <= 0.0 {
            return None;
        }
        let (light, view) = self.grid.light_and_view(cell);
        let effects = self.cells.effects(light, view);
        let error = f64::from(self.errors[cell]) / value;
        let noise = match self.holding {
            Holding::Noise => error,
            Holding::All => {
                let known: f64 = Effect::ALL.map(|e| effects.square(e)).iter().sum();
                (error * error - known).max(0.0).sqrt()
            }
        };
        Some((effects, noise))
    }

    /// What the uncertainty of a cell consists of, in the order of [`Contribution::all`]: shares of its value (k = 1),
    /// none negative; `None` of a value that is not positive.
    pub fn shares(&self, cell: usize) -> Option<Shares> {
        let (effects, noise) = self.effects(cell)?;
        let mut squares = [0.0; CONTRIBUTIONS];
        squares[0] = noise * noise;
        for effect in Effect::ALL {
            let place = effect
                .input()
                .map_or(CONTRIBUTIONS - 1, |input| 1 + input as usize);
            squares[place] += effects.square(effect);
        }
        Some(squares.map(f64::sqrt))
    }
}

/// The combined standard uncertainty of such contributions, with one of them halved where it is named.
pub(super) fn combined(shares: &Shares, halved: Option<usize>) -> f64 {
    let square = |(place, share): (usize, &f64)| {
        let share = if Some(place) == halved {
            0.5 * share
        } else {
            *share
        };
        share * share
    };
    shares.iter().enumerate().map(square).sum::<f64>().sqrt()
}

/// The uncertainty of a part of the domain: medians over its cells, as shares of the values (k = 1), of all but those
/// that are extrapolated.
#[derive(Clone, Debug, PartialEq)]
pub struct StratumBudget {
    /// The part.
    pub stratum: Stratum,
    /// Of everything.
    pub combined: f64,
    /// Of each contribution, in the order of [`Contribution::all`].
    pub shares: Shares,
    /// What the combined one would be with a contribution half as large.
    pub halved: Shares,
}

impl StratumBudget {
    /// The contributions, the largest first.
    pub fn sorted(&self) -> Vec<(Contribution, f64)> {
        let mut all: Vec<_> = Contribution::all().into_iter().zip(self.shares).collect();
        all.sort_by(|a, b| b.1.total_cmp(&a.1));
        all
    }

    /// The share of a contribution.
    pub fn of(&self, contribution: Contribution) -> f64 {
        let place = Contribution::all().iter().position(|c| *c == contribution);
        place.map_or(0.0, |place| self.shares[place])
    }
}

/// The budget of a dense BRDF by part of the domain. Parts without cells are left out.
pub fn summary(cells: &CellBudget<'_>) -> Vec<StratumBudget> {
    let parts = by_stratum(cells).into_iter();
    let of_part = |(part, of): (Stratum, Vec<usize>)| {
        let shares: Vec<Shares> = of.iter().filter_map(|cell| cells.shares(*cell)).collect();
        of_stratum(part, &shares)
    };
    parts.map(of_part).collect()
}

/// How often the true value lies within U (k = 2) of the found one, by part of the domain: `truth` gives it for a
/// direction of light and of view. Relative values are first brought to its scale.
pub fn coverage(
    cells: &CellBudget<'_>,
    scale: Scale,
    truth: impl Fn(Direction, Direction) -> f64,
) -> Vec<(Stratum, f64)> {
    let grid = cells.grid();
    let ratio = |cell: usize| {
        let (light, view) = grid.light_and_view(cell);
        cells.value(cell) / truth(grid.direction(light), grid.direction(view))
    };
    let parts = by_stratum(cells);
    let factor = match (scale, parts.first()) {
        (Scale::Relative, Some((_, all))) => {
            let mut ratios: Vec<f64> = all.iter().map(|cell| ratio(*cell)).collect();
            ratios.sort_by(f64::total_cmp);
            ratios[ratios.len() / 2]
        }
        _ => 1.0,
    };
    let of_part = |(part, of): (Stratum, Vec<usize>)| {
        let is_within = |cell: &&usize| {
            let u = cells.shares(**cell).map(|shares| combined(&shares, None));
            // f − f_true as a share of f.
            let off = 1.0 - factor / ratio(**cell);
            u.is_some_and(|u| off.abs() <= 2.0 * u)
        };
        (
            part,
            of.iter().filter(is_within).count() as f64 / of.len() as f64,
        )
    };
    parts.into_iter().map(of_part).collect()
}

/// Cells that stand for all that are positive and not extrapolated, by part of the domain; all of them come first,
/// and parts without cells are left out.
pub(super) fn by_stratum(cells: &CellBudget<'_>) -> Vec<(Stratum, Vec<usize>)> {
    let grid = cells.grid();
    // A step that shares no factor with the number of directions meets all of them.
    let step = (grid.n_cells() / TOLD_BY).max(1) | 1;
    let mut parts = Stratum::ALL.map(|part| (part, Vec::new()));
    let mut by_brightness: Vec<(f64, usize)> = Vec::new();
    for cell in (0..grid.n_cells()).step_by(step) {
        let value = cells.value(cell);
        if cells.is_extrapolated(cell) || value.is_nan() || value <= 0.0 {
            continue;
        }
        let (light, view) = grid.light_and_view(cell);
        let (light, view) = (grid.direction(light), grid.direction(view));
        let (l, v) = (light.to_vec3(), view.to_vec3());
        let between = gonia_brdf::direction::dot(l, v);
        let bits = stratum::of_geometry(light.theta_deg(), view.theta_deg(), between);
        for (part, of) in &mut parts {
            if bits & (1 << *part as u8) != 0 {
                of.push(cell);
            }
        }
        by_brightness.push((value * l[2] * v[2], cell));
    }
    let n = (HIGHLIGHT * by_brightness.len() as f64).ceil() as usize;
    by_brightness.sort_by(|a, b| b.0.total_cmp(&a.0));
    parts[Stratum::Highlight as usize].1 = by_brightness[..n].iter().map(|of| of.1).collect();
    let filled = parts.into_iter().filter(|(_, cells)| !cells.is_empty());
    filled.collect()
}

fn of_stratum(stratum: Stratum, cells: &[Shares]) -> StratumBudget {
    let median = |of: &dyn Fn(&Shares) -> f64| median(cells.iter().map(of).collect());
    let mut budget = StratumBudget {
        stratum,
        combined: median(&|shares| combined(shares, None)),
        shares: [0.0; CONTRIBUTIONS],
        halved: [0.0; CONTRIBUTIONS],
    };
    for place in 0..CONTRIBUTIONS {
        budget.shares[place] = median(&|shares| shares[place]);
        budget.halved[place] = median(&|shares| combined(shares, Some(place)));
    }
    budget
}

/// The median of some numbers; 0 of none.
pub(super) fn median(mut all: Vec<f64>) -> f64 {
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(0.0)
}

/// What a rig states of its inputs, for a table: the value with its unit, or nothing of a contribution that is none.
pub fn stated(contribution: Contribution, budget: &Budget) -> String {
    let Contribution::Input(input) = contribution else {
        return String::new();
    };
    let value = budget.value(input);
    match input.unit() {
        "" => format!("{} %", short(100.0 * value)),
        "degrees" => format!("{}°", short(value)),
        unit => format!("{} {unit}", short(value)),
    }
}

/// A number with two digits that count.
fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = (1.0 - value.abs().decimal_log().floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{value:.digits$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// Inputs that nobody stated, whose defaults count.
pub fn not_stated(budget: &Budget) -> Vec<Contribution> {
    let is_default = |input: &Input| budget.known_from(*input) == gonia_rig::KnownFrom::Default;
    let inputs = Input::ALL.into_iter().filter(is_default);
    inputs.map(Contribution::Input).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::fixture::uncertain_of;
    use gonia_brdf::DenseBrdf;
    use gonia_brdf::model::Ggx;
    use gonia_rig::{ReferenceCalibration, Rig};

    const BRDF: Ggx = Ggx {
        diffuse: [0.2; 3],
        specular: [0.6; 3],
        f0: 0.5,
        alpha_x: 0.5,
        alpha_y: 0.35,
        azimuth_deg: 25.0,
    };

    fn budget() -> Budget {
        let rig = Rig::paper(100);
        let known = ReferenceCalibration::KnownReference;
        Budget::new(known, 0.3, [1100.0, 1800.0, 14.0], |input| rig.input(input))
    }

    #[test]
    fn combined_errors_give_their_noise_back_and_halving_all_of_it_halves_the_rest() {
        let grid = Grid::with_step_deg(10.0).unwrap();
        let brdf = DenseBrdf::tabulate(grid, &BRDF);
        let plane = &brdf.planes()[1];
        let noise: Vec<f32> = plane.iter().map(|f| 0.03 * f).collect();
        let alone = CellBudget::new(grid, plane, (&noise, Holding::Noise), &[], &budget()).unwrap();
        let total = |cell: usize| combined(&alone.shares(cell).unwrap(), None);
        let errors: Vec<f32> = (0..grid.n_cells())
            .map(|cell| (total(cell) * f64::from(plane[cell])) as f32)
            .collect();
        let both = CellBudget::new(grid, plane, (&errors, Holding::All), &[], &budget()).unwrap();
        for cell in (0..grid.n_cells()).step_by(101) {
            let [a, b] = [&alone, &both].map(|of| of.shares(cell).unwrap());
            assert!((a[0] - b[0]).abs() < 1e-4, "{} {}", a[0], b[0]);
            assert_eq!(a[1..], b[1..]);
        }
        for part in summary(&both) {
            let reference = part.of(Contribution::Input(Input::Reference));
            assert!((reference - 0.02).abs() < 1e-9);
            assert!((part.of(Contribution::Noise) - 0.03).abs() < 1e-4);
            assert!(part.sorted()[0].1 <= part.combined);
            for halved in part.halved {
                assert!(halved <= part.combined && halved >= 0.5 * part.combined);
            }
        }
        // The largest is what is worth most.
        let all = &summary(&both)[0];
        let worth = |c: Contribution| {
            let place = Contribution::all().iter().position(|of| *of == c).unwrap();
            all.combined - all.halved[place]
        };
        let sorted = all.sorted();
        assert!(worth(sorted[0].0) > worth(sorted[5].0));
    }

    #[test]
    fn extrapolated_cells_do_not_count_and_the_highlight_does() {
        let grid = Grid::with_step_deg(15.0).unwrap();
        let plane = vec![0.3f32; grid.n_cells()];
        let noise = vec![0.003f32; grid.n_cells()];
        let mut origins = vec![Origin::Extrapolated as u8; grid.n_cells()];
        let of = |origins: &[u8]| {
            let errors = (&noise[..], Holding::Noise);
            summary(&CellBudget::new(grid, &plane, errors, origins, &budget()).unwrap())
        };
        assert_eq!(of(&origins), []);
        origins.fill(Origin::Measured as u8);
        let parts: Vec<Stratum> = of(&origins).into_iter().map(|of| of.stratum).collect();
        assert!(parts.contains(&Stratum::Highlight) && parts.contains(&Stratum::Retro));
        let short = CellBudget::new(grid, &plane, (&noise, Holding::Noise), &[0], &budget());
        assert!(short.is_none());
    }

    #[test]
    fn coverage_counts_the_cells_whose_truth_lies_within_u() {
        let grid = Grid::with_step_deg(15.0).unwrap();
        let none = uncertain_of(&[]);
        // Every second direction of view is 3 u off, the others half a u.
        let off = |view: usize| if view.is_multiple_of(2) { 1.03 } else { 1.005 };
        let plane: Vec<f32> = (0..grid.n_cells())
            .map(|cell| 0.3 * off(grid.light_and_view(cell).1))
            .collect();
        let noise: Vec<f32> = plane.iter().map(|f| 0.01 * f).collect();
        let cells = CellBudget::new(grid, &plane, (&noise, Holding::Noise), &[], &none).unwrap();
        let found = coverage(&cells, Scale::Absolute, |_, _| 0.3);
        assert_eq!(found[0].0, Stratum::All);
        assert!((found[0].1 - 0.5).abs() < 0.02, "{found:?}");
        // A factor is none of a relative value's errors.
        let relative = coverage(&cells, Scale::Relative, |_, _| 3.0);
        assert!(relative[0].1 >= 0.5, "{relative:?}");
    }

    #[test]
    fn numbers_have_two_digits_that_count() {
        for (value, text) in [
            (0.4, "0.4"),
            (12.0, "12"),
            (0.0523, "0.052"),
            (10.0, "10"),
            (0.0, "0"),
        ] {
            assert_eq!(short(value), text);
        }
        let light = Contribution::Input(Input::LightDirection);
        assert_eq!(stated(light, &budget()), "0.4°");
        assert_eq!(
            stated(Contribution::Input(Input::Offset), &budget()),
            "0.05 %"
        );
        assert!(not_stated(&budget()).contains(&light));
    }
}
