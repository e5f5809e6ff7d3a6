//! The methods that are compared.

use crate::Error;
use crate::chart::cpu::cpu_seconds;
use crate::fill::fill_bins;
use crate::progress::silent;
use gonia_brdf::baselines::{
    BaselineFiller, BaselineSettings, Rule, UnknownBaseline, Workspace, n_interpolated,
};
use gonia_brdf::interpolate::{FillSettings, Preset};
use gonia_brdf::{Bins, Grid};
use rayon::prelude::*;
use std::fmt;
use std::str::FromStr;

/// A method with its settings.
#[derive(Clone, Debug, PartialEq)]
pub enum Method {
    /// One cell at a time.
    Cellwise(BaselineSettings),
    /// Block by block, with these settings to begin with; the material's own are chosen.
    Blocks(FillSettings),
}

/// What kind of method it is: the colours of the chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Blocks: gonia's own.
    Blocks,
    /// The paper's, and its variations.
    Linear,
    /// Other radial basis functions.
    Rbf,
    /// Moving least squares.
    LeastSquares,
    /// Nearest, inverse distance.
    Distance,
}

impl Family {
    /// All of them, in the order of a legend.
    pub const ALL: [Family; 5] = [
        Family::Blocks,
        Family::Linear,
        Family::Rbf,
        Family::LeastSquares,
        Family::Distance,
    ];

    /// Its name in legends and files.
    pub fn name(self) -> &'static str {
        match self {
            Family::Blocks => "blocks",
            Family::Linear => "linear RBF",
            Family::Rbf => "other RBF",
            Family::LeastSquares => "least squares",
            Family::Distance => "by distance",
        }
    }
}

/// Values of the cells asked for, and what they cost.
pub(super) struct Run {
    pub values: Vec<[f32; 3]>,
    /// CPU seconds of the full fill.
    pub core_s: f64,
    /// Share of the interpolations that were done.
    pub share: f64,
    /// Share of those that failed.
    pub failed: f64,
}

/// Block settings beside the presets, by name: no refinement, all of it, more and less.
const BLOCKS: [&str; 6] = [
    "blocks=16,nodes=64,tolerance=inf",
    "blocks=8,nodes=64,tolerance=inf",
    "blocks=8,nodes=128,tolerance=inf",
    "blocks=8,nodes=64,tolerance=1",
    "blocks=8,nodes=128,tolerance=4",
    "blocks=8,nodes=128,tolerance=0",
];

/// Methods that work cell by cell, by name.
const CELLWISE: [&str; 26] = [
    "paper",
    "rbf-linear,k=25",
    "rbf-linear,k=50",
    "rbf-linear,k=100",
    "rbf-linear,k=400",
    "rbf-linear,nugget=0",
    "rbf-linear,angles",
    "rbf-linear,means",
    "rbf-linear,means,mirrored",
    "rbf-linear,log,means,mirrored",
    "rbf-linear,half=0.5,log,means,mirrored",
    "rbf-linear,sum=0.5,log,means,mirrored",
    "rbf-thin-plate",
    "rbf-cubic",
    "rbf-gaussian",
    "rbf-multiquadric",
    "rbf-wendland",
    "rbf-matern,k=50,half=0.5,log,means,mirrored",
    "rbf-matern,half=0.5,log,means,mirrored",
    "nearest",
    "nearest,half=0.5,means,mirrored",
    "shepard",
    "shepard,half=0.5,log,means,mirrored",
    "mls1",
    "mls1,half=0.5,log,means,mirrored",
    "mls2,half=0.5,log,means,mirrored",
];

/// What is compared when nothing else is said: the default first, and no block smaller than a step
/// of the grid.
pub fn standard(grid: Grid) -> Vec<Method> {
    let default = Method::default_of(grid);
    let presets = Preset::ALL.map(|preset| Method::blocks(preset.settings(), grid));
    let named = BLOCKS.iter().chain(&CELLWISE);
    let named = named.filter_map(|name| name.parse::<Method>().ok());
    let others = presets.into_iter().chain(named);
    let fits = |method: &Method| match method {
        Method::Blocks(settings) => settings.block_deg >= 2.0 * grid.step_deg(),
        Method::Cellwise(_) => true,
    };
    let mut all = vec![default];
    for other in others.filter(fits) {
        if !all.contains(&other) {
            all.push(other);
        }
    }
    all
}

impl Method {
    /// What `gonia fill` does on a grid by itself.
    pub fn default_of(grid: Grid) -> Self {
        Self::blocks(FillSettings::DEFAULT, grid)
    }

    /// Blocks, of two steps of the grid at least.
    fn blocks(settings: FillSettings, grid: Grid) -> Self {
        Method::Blocks(FillSettings {
            block_deg: settings.block_deg.max(2.0 * grid.step_deg()),
            ..settings
        })
    }

    /// The paper's method.
    pub fn paper() -> Self {
        Method::Cellwise(BaselineSettings::PAPER)
    }

    /// Whether it is [`Method::default_of`].
    pub fn is_default(&self, grid: Grid) -> bool {
        *self == Self::default_of(grid)
    }

    /// Its kind.
    pub fn family(&self) -> Family {
        match self {
            Method::Blocks(_) => Family::Blocks,
            Method::Cellwise(settings) => match settings.rule {
                Rule::Nearest | Rule::Shepard { .. } => Family::Distance,
                Rule::MovingLeastSquares { .. } => Family::LeastSquares,
                Rule::Rbf { kernel, .. } if kernel.name() == "linear" => Family::Linear,
                Rule::Rbf { .. } => Family::Rbf,
            },
        }
    }

    /// Gives cells (a pair of direction indices each, poles at azimuth 0) their values.
    pub(super) fn run(&self, bins: &Bins, cells: &[(u32, u32)]) -> Result<Run, Error> {
        match self {
            Method::Cellwise(settings) => run_cellwise(bins, settings, cells),
            Method::Blocks(settings) => run_blocks(bins, settings, cells),
        }
    }
}

fn run_cellwise(
    bins: &Bins,
    settings: &BaselineSettings,
    cells: &[(u32, u32)],
) -> Result<Run, Error> {
    let start = cpu_seconds();
    let filler = BaselineFiller::new(bins, settings)?;
    let built = cpu_seconds();
    let values = cells
        .par_iter()
        // Cells differ in cost; small pieces keep all threads at work to the end.
        .with_max_len(16)
        .map_init(Workspace::default, |work, (light, view)| {
            filler.pair(*light as usize, *view as usize, work)
        })
        .collect();
    let worked = cpu_seconds() - built;
    let tally = filler.tally();
    let done = tally.interpolated.max(1) as f64;
    let all = n_interpolated(bins, settings.mirrored) as f64;
    Ok(Run {
        values,
        core_s: built - start + worked * all / done,
        share: done / all,
        failed: tally.failed as f64 / done,
    })
}

fn run_blocks(bins: &Bins, base: &FillSettings, cells: &[(u32, u32)]) -> Result<Run, Error> {
    let start = cpu_seconds();
    let dense = fill_bins(bins, *base, false, &silent)?.dense;
    let core_s = cpu_seconds() - start;
    let at = |(light, view): &(u32, u32)| dense.at(*light as usize, *view as usize);
    Ok(Run {
        values: cells.iter().map(at).collect(),
        core_s,
        share: 1.0,
        failed: 0.0,
    })
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Method::Cellwise(settings) => settings.fmt(f),
            Method::Blocks(settings) => {
                let FillSettings {
                    block_deg,
                    neighbours: nodes,
                    neighbours_most: most,
                    tolerance,
                    budget,
                    one_bin_in,
                    ..
                } = settings;
                write!(f, "blocks={block_deg},nodes={nodes},tolerance={tolerance}")?;
                if budget.is_finite() {
                    write!(f, ",budget={budget}")?;
                }
                if *one_bin_in > 1 {
                    write!(f, ",one-bin-in={one_bin_in}")?;
                }
                if most > nodes {
                    write!(f, ",nodes-at-most={most}")?;
                }
                Ok(())
            }
        }
    }
}

impl FromStr for Method {
    type Err = UnknownBaseline;

    /// `blocks=DEGREES,nodes=N,tolerance=T`, with or without `,budget=B`, `,one-bin-in=N` and
    /// `,nodes-at-most=N`, or the name of a method that works cell by cell.
    fn from_str(text: &str) -> Result<Self, UnknownBaseline> {
        let blocks = || {
            let (block, rest) = text.strip_prefix("blocks=")?.split_once(",nodes=")?;
            let (nodes, rest) = rest.split_once(",tolerance=")?;
            let (rest, most) = rest.split_once(",nodes-at-most=").unwrap_or((rest, ""));
            let (rest, one_bin_in) = rest.split_once(",one-bin-in=").unwrap_or((rest, "1"));
            let (tolerance, budget) = rest.split_once(",budget=").unwrap_or((rest, "inf"));
            let block_deg = block.parse().ok().filter(|d| (1.0..=45.0).contains(d))?;
            let nodes = nodes.parse().ok().filter(|n| (8..=1024).contains(n))?;
            let most = match most {
                "" => nodes,
                most => most.parse().ok().filter(|n| (nodes..=1024).contains(n))?,
            };
            let tolerance = tolerance.parse().ok().filter(|t: &f32| *t >= 0.0)?;
            let budget = budget.parse().ok().filter(|b: &f32| *b >= 0.0)?;
            let one_bin_in = one_bin_in.parse().ok().filter(|n| (1..=1000).contains(n))?;
            Some(Method::Blocks(FillSettings {
                block_deg,
                neighbours: nodes,
                neighbours_most: most,
                tolerance,
                budget,
                one_bin_in,
                ..FillSettings::DEFAULT
            }))
        };
        blocks().map_or_else(|| text.parse().map(Method::Cellwise), Ok)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_standard_contender_has_a_name_of_its_own_and_one_is_the_default() {
        for step in [2.0, 5.0] {
            let grid = Grid::with_step_deg(step).unwrap();
            let all = standard(grid);
            assert!(all.len() > CELLWISE.len());
            let mut names: Vec<String> = all.iter().map(|c| c.to_string()).collect();
            assert_eq!(names[names.len() - CELLWISE.len()], "paper");
            assert!(CELLWISE.iter().all(|name| names.contains(&(*name).into())));
            for (name, method) in names.iter().zip(&all) {
                assert_eq!(name.parse().as_ref(), Ok(method));
            }
            names.sort();
            names.dedup();
            assert_eq!(names.len(), all.len());
            assert_eq!(all.iter().filter(|c| c.is_default(grid)).count(), 1);
        }
    }
}
