//! The comparison itself.
//!
//! Over the cells of the grid (of a mask, where one is given), each counted alike, a pole once and
//! not once an azimuth, all channels alike, with `a` multiplied by a fitted factor where either side is relative:
//!
//! * **log RMS**: root mean square of ln(a/b). A value that is zero or negative counts as a floor,
//!   a millionth of the mean of its side, and is counted.
//! * **cosine-weighted error**: |a − b|·cosθi·cosθv, its mean and its 99th percentile over cells
//!   and channels, both as a share of the mean of b·cosθi·cosθv over the same cells and channels.
//! * **ΔE00** of π·f seen as a reflectance in linear sRGB; mean over a regular share of cells.
//!   Where `b` is relative both are brought to a mean luminance of 0.2 in the interior first.
//! * **reciprocity residual**: root mean square of ln(f(i, v)/f(v, i)) of each side.
//! * **rendered ΔE00**: mean over the lit pixels of a sphere and a cylinder under the same
//!   lights and the same exposure, as a screen shows them (clipped at white).

use crate::accumulate::{Cell, Sums};
use gonia_brdf::Elementary;
use gonia_brdf::direction::{Vec3, dot};
use gonia_brdf::{Brdf, DenseBrdf, Grid};
use gonia_render as render;
use gonia_render::{Picture, Tabulated, color};
use gonia_rig::{DenseFile, Figures, Scale, Stratum, stratum};
use rayon::prelude::*;
use std::f32::consts::PI;

/// A table with its scale.
#[derive(Clone, Copy, Debug)]
pub struct Table<'a> {
    /// The values.
    pub brdf: &'a DenseBrdf,
    /// Whether they are 1/sr.
    pub scale: Scale,
}

impl<'a> From<&'a DenseFile> for Table<'a> {
    fn from(file: &'a DenseFile) -> Self {
        Self {
            brdf: &file.brdf,
            scale: file.scale,
        }
    }
}

/// What a table is compared with.
#[derive(Clone, Copy)]
pub enum Side<'a> {
    /// Another table, of the same grid.
    Table(Table<'a>),
    /// The truth, or a fitted model; in 1/sr.
    Model(&'a dyn Brdf),
}

/// What to compare, and how to call it.
#[derive(Clone, Copy)]
pub struct Options<'a> {
    /// Name of the table.
    pub name_a: &'a str,
    /// Name of what it is compared with.
    pub name_b: &'a str,
    /// Cells to look at, numbered as by [`Grid::cell`]; all without it.
    pub only: Option<&'a (dyn Fn(usize) -> bool + Sync)>,
    /// Most cells to compare; beyond it an evenly spread share is taken, and said.
    pub most_cells: usize,
    /// Most cells to take the colour difference of.
    pub most_colour_cells: usize,
    /// Side of the rendered pictures, pixels.
    pub render_px: usize,
}

impl Default for Options<'_> {
    /// All cells of the paper's grid, colours of 400,000 of them, pictures of 160 pixels.
    fn default() -> Self {
        Self {
            name_a: "measured",
            name_b: "true",
            only: None,
            most_cells: usize::MAX,
            most_colour_cells: 400_000,
            render_px: 160,
        }
    }
}

/// Why two BRDFs cannot be compared.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum CompareError {
    /// Two tables of different grids.
    #[error(
        "{a} has steps of {step_a}°, {b} of {step_b}°; fill both with the same step to compare them"
    )]
    Grids {
        /// Name of the first.
        a: String,
        /// Name of the second.
        b: String,
        /// Step of the first, degrees.
        step_a: f64,
        /// Step of the second, degrees.
        step_b: f64,
    },
    /// The mask leaves nothing.
    #[error("there is no cell to compare; choose a larger part of the domain")]
    NoCells,
    /// A side without a positive value.
    #[error("{name} holds no positive value; check that it is a BRDF")]
    NotPositive {
        /// Name of the side.
        name: String,
    },
}

/// Compares a table with another one or with a model.
///
/// # Errors
/// Two grids, no cell, or a side without any positive value.
pub fn compare(a: Table<'_>, b: Side<'_>, options: &Options<'_>) -> Result<Figures, CompareError> {
    let pair = Pair::new(a, b, options)?;
    let scan = pair.scan()?;
    let sums = pair.sums(&scan);
    let (cells_compared, cells_colour) = sums.counts();
    let model;
    let (b_brdf, b_is_table): (&dyn Brdf, bool) = match b {
        Side::Table(table) => {
            model = Tabulated::new(table.brdf);
            (&model, true)
        }
        Side::Model(model) => (model, false),
    };
    let a_brdf = Tabulated::scaled(a.brdf, f64::from(scan.factor));
    let px = options.render_px;
    let lights = render::studio();
    let rendered = |shape: fn(&dyn Brdf, &[render::Light], usize, usize) -> Picture| {
        let draw = |brdf: &dyn Brdf| shape(brdf, &lights, px, 1);
        picture_delta_e(&draw(&a_brdf), &draw(b_brdf))
    };
    Ok(Figures {
        a: options.name_a.to_owned(),
        b: options.name_b.to_owned(),
        cells_total: scan.cells_total,
        cells_compared,
        cells_colour,
        floored_a: sums.floored[0],
        floored_b: sums.floored[1],
        factor: pair.is_relative().then_some(f64::from(scan.factor)),
        sphere_delta_e: rendered(render::sphere),
        cylinder_delta_e: rendered(render::cylinder),
        strata: Stratum::ALL
            .into_iter()
            .filter_map(|stratum| sums.figures(stratum, b_is_table))
            .collect(),
    })
}

/// Mean ΔE00 over the pixels both pictures cover, at the exposure of the second.
pub(super) fn picture_delta_e(a: &Picture, b: &Picture) -> f64 {
    let exposure = b.exposure(0.99, 0.9);
    let shown = |rgb: [f32; 3]| rgb.map(|v| (v * exposure).clamp(0.0, 1.0));
    let mut sum = 0.0;
    let mut count = 0usize;
    for k in 0..a.rgb.len().min(b.rgb.len()) {
        if a.cover[k] > 0.0 && b.cover[k] > 0.0 {
            sum += f64::from(color::delta_e(shown(a.rgb[k]), shown(b.rgb[k])));
            count += 1;
        }
    }
    sum / count.max(1) as f64
}

/// Rows and columns that are walked together: the tiles of both sides and their mirrors fit into a
/// core's own cache, and few pages are touched a cell.
const TILE: usize = 64;
/// Cells the first look is based on.
const SCAN_CELLS: usize = 1_000_000;

struct Pair<'a> {
    a: Table<'a>,
    a_planes: [&'a [f32]; 3],
    b: Side<'a>,
    options: &'a Options<'a>,
    grid: Grid,
    directions: Vec<Vec3>,
    theta_deg: Vec<f64>,
}

/// What a first look at an even share of the cells finds.
struct Scan {
    /// a is multiplied by this.
    factor: f32,
    /// Luminance · cos · cos of b above which a cell is a highlight.
    highlight: f32,
    /// Least value of each side that a logarithm is taken of, before the factor.
    floor: [f32; 2],
    /// Both sides times this are reflectances a colour can be made of.
    level: f32,
    cells_total: u64,
}

impl<'a> Pair<'a> {
    fn new(a: Table<'a>, b: Side<'a>, options: &'a Options<'a>) -> Result<Self, CompareError> {
        let grid = a.brdf.grid();
        if let Side::Table(b) = b
            && b.brdf.grid() != grid
        {
            return Err(CompareError::Grids {
                a: options.name_a.to_owned(),
                b: options.name_b.to_owned(),
                step_a: grid.step_deg(),
                step_b: b.brdf.grid().step_deg(),
            });
        }
        let nodes = (0..grid.n_directions()).map(|index| grid.direction(index));
        let (directions, theta_deg) = nodes.map(|d| (d.to_vec3(), d.theta_deg())).unzip();
        Ok(Self {
            a,
            a_planes: planes_of(a.brdf),
            b,
            options,
            grid,
            directions,
            theta_deg,
        })
    }

    fn is_relative(&self) -> bool {
        self.a.scale == Scale::Relative || self.b_is_relative()
    }

    fn b_is_relative(&self) -> bool {
        matches!(self.b, Side::Table(table) if table.scale == Scale::Relative)
    }

    fn a_at(&self, light: usize, view: usize) -> [f32; 3] {
        value(&self.a_planes, self.grid.cell(light, view))
    }

    fn b_at(&self, light: usize, view: usize) -> [f32; 3] {
        match self.b {
            Side::Table(table) => value(&planes_of(table.brdf), self.grid.cell(light, view)),
            Side::Model(model) => model
                .eval(self.directions[light], self.directions[view])
                .map(|v| v as f32),
        }
    }

    fn cosines(&self, light: usize, view: usize) -> f32 {
        (self.directions[light][2] * self.directions[view][2]) as f32
    }

    fn in_interior(&self, light: usize, view: usize) -> bool {
        let strata = stratum::of_geometry(self.theta_deg[light], self.theta_deg[view], 0.0);
        strata >> (Stratum::Interior as u8) & 1 == 1
    }

    /// Whether a cell is to be compared: in the mask, and of a pole the first of its azimuths.
    fn wanted(&self, cell: usize) -> bool {
        let (light, view) = self.grid.light_and_view(cell);
        let repeats = |direction: usize| (1..self.grid.n_phi()).contains(&direction);
        !repeats(light) && !repeats(view) && self.options.only.is_none_or(|only| only(cell))
    }

    /// The least number that spreads over rows and columns alike and takes one cell in `one_in` or
    /// fewer.
    fn stride(&self, one_in: usize) -> usize {
        let n = self.grid.n_directions();
        (one_in.max(1)..)
            .find(|stride| gcd(*stride, n) == 1)
            .unwrap_or(1)
    }

    /// Totals, factor, floors and limits.
    fn scan(&self) -> Result<Scan, CompareError> {
        let n_cells = self.grid.n_cells();
        let distinct = self.grid.n_directions() - self.grid.n_phi() + 1;
        let cells_total = match self.options.only {
            None => (distinct * distinct) as u64,
            Some(_) => (0..n_cells)
                .into_par_iter()
                .filter(|cell| self.wanted(*cell))
                .count() as u64,
        };
        let stride = self.stride((cells_total as usize).div_ceil(SCAN_CELLS));
        let cells: Vec<usize> = (0..n_cells)
            .step_by(stride)
            .filter(|cell| self.wanted(*cell))
            .collect();
        if cells.is_empty() {
            return Err(CompareError::NoCells);
        }
        let values: Vec<([f32; 3], [f32; 3])> = cells
            .par_iter()
            .map(|cell| {
                let (light, view) = self.grid.light_and_view(*cell);
                (self.a_at(light, view), self.b_at(light, view))
            })
            .collect();

        let names = [self.options.name_a, self.options.name_b];
        let mut floor = [0.0; 2];
        for (side, floor) in floor.iter_mut().enumerate() {
            let all = values
                .iter()
                .flat_map(|pair| if side == 0 { pair.0 } else { pair.1 });
            let (sum, count) = all
                .filter(|v| *v > 0.0)
                .fold((0.0, 0u64), |(sum, count), v| {
                    (sum + f64::from(v), count + 1)
                });
            if count == 0 {
                return Err(CompareError::NotPositive {
                    name: names[side].to_owned(),
                });
            }
            *floor = (1e-6 * sum / count as f64) as f32;
        }

        let mut weighted = Vec::with_capacity(cells.len());
        let mut log_ratios = Vec::new();
        let mut interior_luminance = (0.0, 0u64);
        for (cell, (a, b)) in cells.iter().zip(&values) {
            let (light, view) = self.grid.light_and_view(*cell);
            weighted.push(color::luminance(*b) * self.cosines(light, view));
            if self.in_interior(light, view) {
                interior_luminance.0 += f64::from(color::luminance(*b));
                interior_luminance.1 += 1;
                let positive = (0..3).filter(|c| a[*c] > floor[0] && b[*c] > floor[1]);
                log_ratios.extend(positive.map(|c| (b[c] / a[c]).natural_log()));
            }
        }
        let factor = match (self.is_relative(), quantile(&mut log_ratios, 0.5)) {
            (true, Some(median)) => median.exponential(),
            _ => 1.0,
        };
        let mean = interior_luminance.0 / interior_luminance.1.max(1) as f64;
        let level = if self.b_is_relative() && mean > 0.0 {
            (0.2 / mean) as f32
        } else {
            PI
        };
        Ok(Scan {
            factor,
            highlight: quantile(&mut weighted, 0.99).unwrap_or(f32::INFINITY),
            floor,
            level,
            cells_total,
        })
    }

    fn stride_of_cells(&self) -> usize {
        self.stride(self.grid.n_cells().div_ceil(self.options.most_cells.max(1)))
    }

    /// The sums over all cells that are compared.
    fn sums(&self, scan: &Scan) -> Sums {
        let n = self.grid.n_directions();
        let stride = self.stride_of_cells();
        let colour_cells = self.options.most_colour_cells.max(1);
        let colour_stride =
            stride * self.stride((scan.cells_total as usize / stride).div_ceil(colour_cells));
        (0..n.div_ceil(TILE))
            .into_par_iter()
            .fold(Sums::default, |mut sums, block| {
                let lights = block * TILE..n.min((block + 1) * TILE);
                for first_view in (0..n).step_by(TILE) {
                    for light in lights.clone() {
                        for view in first_view..n.min(first_view + TILE) {
                            let cell = self.grid.cell(light, view);
                            if cell.is_multiple_of(stride) && self.wanted(cell) {
                                let colour = cell.is_multiple_of(colour_stride);
                                self.add(&mut sums, scan, light, view, colour);
                            }
                        }
                    }
                }
                sums
            })
            .reduce(Sums::default, Sums::merge)
    }

    fn add(&self, sums: &mut Sums, scan: &Scan, light: usize, view: usize, colour: bool) {
        let floor = [scan.floor[0] * scan.factor, scan.floor[1]];
        let a = self.a_at(light, view).map(|v| v * scan.factor);
        let b = self.b_at(light, view);
        let cosines = self.cosines(light, view);
        for c in 0..3 {
            sums.floored[0] += u64::from(a[c] <= floor[0]);
            sums.floored[1] += u64::from(b[c] <= floor[1]);
        }
        let log = [0, 1, 2].map(|c| (a[c].max(floor[0]) / b[c].max(floor[1])).natural_log());

        let a_mirror = self.a_at(view, light).map(|v| v * scan.factor);
        let reciprocity_b = match self.b {
            Side::Table(_) => log_distance(b, self.b_at(view, light), floor[1]),
            Side::Model(_) => 0.0,
        };

        let between = dot(self.directions[light], self.directions[view]);
        let mut strata = stratum::of_geometry(self.theta_deg[light], self.theta_deg[view], between);
        if color::luminance(b) * cosines >= scan.highlight {
            strata |= stratum::HIGHLIGHT;
        }
        let delta_e = colour.then(|| {
            let seen = |rgb: [f32; 3]| rgb.map(|v| v * scan.level);
            color::delta_e(seen(a), seen(b))
        });
        sums.add(
            strata,
            &Cell {
                log,
                cos_error: [0, 1, 2].map(|c| (a[c] - b[c]).abs() * cosines),
                cos_value: (b[0] + b[1] + b[2]) * cosines,
                reciprocity_a: log_distance(a, a_mirror, floor[0]),
                reciprocity_b,
                delta_e,
            },
        );
    }
}

fn planes_of(brdf: &DenseBrdf) -> [&[f32]; 3] {
    let [r, g, b] = brdf.planes();
    [r, g, b]
}

#[inline]
fn value(planes: &[&[f32]; 3], cell: usize) -> [f32; 3] {
    [planes[0][cell], planes[1][cell], planes[2][cell]]
}

/// Sum over the channels of ln(f/g)².
fn log_distance(f: [f32; 3], g: [f32; 3], floor: f32) -> f32 {
    // Most tables are exactly reciprocal; then there is no logarithm to take.
    if f == g {
        return 0.0;
    }
    (0..3)
        .map(|c| {
            let log = (f[c].max(floor) / g[c].max(floor)).natural_log();
            log * log
        })
        .sum()
}

/// The value below which a share of the values lies; `None` without values.
fn quantile(values: &mut [f32], share: f64) -> Option<f32> {
    if values.is_empty() {
        return None;
    }
    let rank = ((values.len() as f64 * share) as usize).min(values.len() - 1);
    Some(*values.select_nth_unstable_by(rank, f32::total_cmp).1)
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::model::Kurt;

    fn tabulate(step_deg: f64, value: impl Fn(Vec3, Vec3) -> [f64; 3]) -> DenseBrdf {
        let grid = Grid::with_step_deg(step_deg).unwrap();
        let n = grid.n_directions();
        let mut planes = [0, 1, 2].map(|_| Vec::with_capacity(grid.n_cells()));
        for i in 0..n {
            for v in 0..n {
                let rgb = value(grid.direction(i).to_vec3(), grid.direction(v).to_vec3());
                for (plane, value) in planes.iter_mut().zip(rgb) {
                    plane.push(value as f32);
                }
            }
        }
        DenseBrdf::new(grid, planes).unwrap()
    }

    fn absolute(brdf: &DenseBrdf) -> Table<'_> {
        Table {
            brdf,
            scale: Scale::Absolute,
        }
    }

    fn relative(brdf: &DenseBrdf) -> Table<'_> {
        Table {
            brdf,
            scale: Scale::Relative,
        }
    }

    #[test]
    fn a_table_of_the_truth_has_no_error() {
        let truth = Kurt::two_thread_fabric();
        let dense = tabulate(10.0, |i, v| truth.eval(i, v));
        let figures = compare(absolute(&dense), Side::Model(&truth), &Options::default()).unwrap();
        assert_eq!(figures.strata.len(), 6);
        for row in &figures.strata {
            assert!(row.log_rms < 1e-6 && row.cos_error_p99 < 1e-6, "{row:?}");
            assert!(
                row.delta_e.unwrap() < 1e-3 && row.reciprocity_a < 1e-6,
                "{row:?}"
            );
        }
        let all = figures.stratum(Stratum::All).unwrap();
        assert_eq!(all.cells, figures.cells_total);
        let highlight = figures.stratum(Stratum::Highlight).unwrap().cells as f64;
        assert!(
            (0.009..0.011).contains(&(highlight / all.cells as f64)),
            "{highlight}"
        );
        let parts =
            [Stratum::Interior, Stratum::Grazing].map(|s| figures.stratum(s).unwrap().cells);
        assert_eq!(parts[0] + parts[1], all.cells);
        // Sphere and cylinder see the table between its nodes.
        assert!(figures.sphere_delta_e > 0.0 && figures.sphere_delta_e < 6.0);
    }

    #[test]
    fn a_known_factor_gives_the_figures_it_must() {
        let truth = Kurt::two_thread_fabric();
        let dense = tabulate(15.0, |i, v| truth.eval(i, v).map(|f| 1.1 * f));
        let figures = compare(absolute(&dense), Side::Model(&truth), &Options::default()).unwrap();
        for row in &figures.strata {
            assert!((row.log_rms - 1.1f64.natural_log()).abs() < 1e-5);
            assert!((row.log_mean - 1.1f64.natural_log()).abs() < 1e-5);
            assert!((row.cos_error_mean - 0.1).abs() < 1e-5);
        }
        let figures = compare(relative(&dense), Side::Model(&truth), &Options::default()).unwrap();
        assert!((figures.factor.unwrap() - 1.0 / 1.1).abs() < 1e-5);
        assert!(figures.stratum(Stratum::All).unwrap().log_rms < 1e-5);
        // The rendered difference is taken after the factor too.
        let unscaled = compare(absolute(&dense), Side::Model(&truth), &Options::default()).unwrap();
        assert!(figures.sphere_delta_e < unscaled.sphere_delta_e);
    }

    #[test]
    fn a_table_that_is_not_reciprocal_is_found_out() {
        let skewed = tabulate(15.0, |i, _| [i[2].max(0.1); 3]);
        let flat = tabulate(15.0, |_, _| [0.3; 3]);
        let figures = compare(
            absolute(&flat),
            Side::Table(absolute(&skewed)),
            &Options::default(),
        )
        .unwrap();
        let all = figures.stratum(Stratum::All).unwrap();
        assert_eq!(all.reciprocity_a, 0.0);
        assert!(all.reciprocity_b.unwrap() > 0.3);
    }

    #[test]
    fn a_share_of_the_cells_gives_nearly_the_same_and_says_so() {
        let truth = Kurt::two_thread_fabric();
        let mut k = 0u32;
        let dense = tabulate(10.0, |i, v| truth.eval(i, v).map(|f| f * 1.05));
        let noisy = {
            let grid = dense.grid();
            let planes = dense.into_planes().map(|plane| {
                plane
                    .into_iter()
                    .map(|f| {
                        k = k.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                        f * (1.0 + 0.1 * (k as f32 / u32::MAX as f32 - 0.5))
                    })
                    .collect()
            });
            DenseBrdf::new(grid, planes).unwrap()
        };
        let whole = compare(absolute(&noisy), Side::Model(&truth), &Options::default()).unwrap();
        let options = Options {
            most_cells: 10_000,
            ..Options::default()
        };
        let part = compare(absolute(&noisy), Side::Model(&truth), &options).unwrap();
        assert!(part.cells_compared <= 10_000 && part.cells_compared > 5_000);
        assert!(part.basis().contains("evenly spread"), "{}", part.basis());
        assert!(whole.basis().contains("all 83521"), "{}", whole.basis());
        let rms = |f: &Figures| f.stratum(Stratum::All).unwrap().log_rms;
        assert!((rms(&part) / rms(&whole) - 1.0).abs() < 0.03);
    }

    #[test]
    fn a_mask_leaves_out_what_it_says() {
        let truth = Kurt::two_thread_fabric();
        let dense = tabulate(15.0, |i, v| truth.eval(i, v));
        let grid = dense.grid();
        let n = grid.n_directions();
        let only = |cell: usize| cell % n < n / 2;
        let options = Options {
            only: Some(&only),
            ..Options::default()
        };
        let figures = compare(absolute(&dense), Side::Model(&truth), &options).unwrap();
        let (distinct, half) = (n - grid.n_phi() + 1, n / 2 - grid.n_phi() + 1);
        assert_eq!(figures.cells_total, (distinct * half) as u64);
        assert_eq!(figures.cells_compared, figures.cells_total);
        let nothing = |_: usize| false;
        let options = Options {
            only: Some(&nothing),
            ..Options::default()
        };
        let found = compare(absolute(&dense), Side::Model(&truth), &options);
        assert_eq!(found, Err(CompareError::NoCells));
    }

    #[test]
    fn other_grids_and_dark_tables_are_refused_and_zeros_counted() {
        let (a, b) = (
            tabulate(15.0, |_, _| [0.1; 3]),
            tabulate(30.0, |_, _| [0.1; 3]),
        );
        let found = compare(absolute(&a), Side::Table(absolute(&b)), &Options::default());
        assert!(matches!(found, Err(CompareError::Grids { .. })));
        let dark = tabulate(15.0, |_, _| [0.0; 3]);
        let error = compare(
            absolute(&dark),
            Side::Table(absolute(&a)),
            &Options::default(),
        )
        .unwrap_err()
        .to_string();
        assert!(
            error.starts_with("measured holds no positive value"),
            "{error}"
        );
        let holed = tabulate(
            15.0,
            |i, v| if i == v { [-1.0, 0.1, 0.1] } else { [0.1; 3] },
        );
        let figures = compare(
            absolute(&holed),
            Side::Table(absolute(&a)),
            &Options::default(),
        )
        .unwrap();
        assert_eq!(
            (figures.floored_a, figures.floored_b),
            // Those of equal light and view, of the pole one.
            (144 - 24 + 1, 0)
        );
        assert!(
            figures
                .basis()
                .contains("values of measured are not positive")
        );
    }

    #[test]
    #[ignore = "a measurement: the paper's grid, 1.5 GB"]
    fn the_papers_grid_is_compared_in_seconds() {
        let truth = Kurt::two_thread_fabric();
        let grid = Grid::PAPER;
        let n = grid.n_directions();
        let directions: Vec<Vec3> = (0..n).map(|k| grid.direction(k).to_vec3()).collect();
        let planes = [0, 1, 2].map(|c| {
            (0..grid.n_cells())
                .into_par_iter()
                .map(|cell| truth.eval(directions[cell / n], directions[cell % n])[c] as f32 * 1.01)
                .collect()
        });
        let dense = DenseBrdf::new(grid, planes).unwrap();
        let start = std::time::Instant::now();
        let figures = compare(absolute(&dense), Side::Model(&truth), &Options::default()).unwrap();
        println!("against a model: {:?}\n{figures}", start.elapsed());
        let other = dense.clone();
        let start = std::time::Instant::now();
        let figures = compare(
            absolute(&dense),
            Side::Table(relative(&other)),
            &Options::default(),
        )
        .unwrap();
        println!("against a table: {:?}\n{figures}", start.elapsed());
    }
}
