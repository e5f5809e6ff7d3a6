//! How many left-out bins, and how many true values, lie within their 95 % intervals.
//!
//! `cargo bench -p gonia-brdf --bench error_bars -- [MATERIAL …] [--sparse | --poses N]`: the paper's plan on the
//! 2° grid, or every tenth of its frames, or about N of them, on 4°. It prints a table: percent in the interior, and in
//! brackets where either θ is beyond 75°, and where the half vector is within 10° of the normal.

#![allow(clippy::expect_used)]

mod plan;

use gonia_brdf::Elementary;
use gonia_brdf::direction::{Vec3, normalize};
use gonia_brdf::interpolate::cross_validation::Fold;
use gonia_brdf::interpolate::patches::cover;
use gonia_brdf::interpolate::refine::Refiner;
use gonia_brdf::interpolate::{Calibration, Data, FillSettings, Origin, origins, select};
use gonia_brdf::{Bins, Brdf, Grid};
use plan::{NOISE, Poses, cpu_seconds, material, measure_with, named};

/// Pairs of patches whose cells are looked at.
const PAIRS: usize = 1000;
/// Cells of each, about.
const CELLS: usize = 40;
/// Views end at this polar angle, degrees.
const GRAZING_DEG: f64 = 75.0;

/// In a highlight the half vector is within this of the normal, degrees.
const HIGHLIGHT_DEG: f64 = 10.0;

/// Shares of what lies within, in the interior, at grazing angles and in the highlight: how much of how much.
#[derive(Default)]
struct Shares([[f64; 2]; 3]);

impl Shares {
    fn add(&mut self, light: Vec3, view: Vec3, weight: f64, is_within: bool) {
        let grazing = light[2].min(view[2]) < GRAZING_DEG.to_radians().cosine();
        let half = normalize([0, 1, 2].map(|k| light[k] + view[k]));
        let is_bright = half[2] > HIGHLIGHT_DEG.to_radians().cosine();
        for (k, is_there) in [!grazing, grazing, is_bright].into_iter().enumerate() {
            if is_there {
                let [within, all] = &mut self.0[k];
                *within += weight * f64::from(u8::from(is_within));
                *all += weight;
            }
        }
    }
}

impl std::fmt::Display for Shares {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [interior, grazing, highlight] = self.0.map(|[within, all]| 100.0 * within / all);
        write!(f, "{interior:.1} ({grazing:.1}, {highlight:.1})")
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let sparse = arguments.iter().any(|a| a == "--sparse");
    let few = arguments
        .iter()
        .position(|a| a == "--poses")
        .map(|k| arguments[k + 1].parse().expect("a number"));
    println!(
        "| material | left-out bins, % | interpolated cells, % | measured cells, % | calibration, CPU-s |"
    );
    println!("|---|---|---|---|---|");
    for name in named(&arguments) {
        let model = material(name);
        let (poses, step) = match few {
            Some(poses) => (Poses::few(poses), 4.0),
            None if sparse => (Poses::tenth(), 4.0),
            None => (Poses::paper(), 2.0),
        };
        let grid = Grid::with_step_deg(step).expect("a grid step");
        let samples = measure_with(&*model, NOISE, &poses);
        let bins = Bins::new(grid, &samples);
        drop(samples);
        let data = Data::new(&bins);
        let settings = select(&data, FillSettings::DEFAULT).settings;
        let cpu = cpu_seconds();
        let calibration = Calibration::new(&data, &settings).expect("enough frames");
        let cpu = cpu_seconds() - cpu;
        let left_out = left_out(&data, &settings, &calibration);
        let [interpolated, measured] = truths(&data, &settings, &calibration, &*model);
        println!("| {name} | {left_out} | {interpolated} | {measured} | {cpu:.1} |");
    }
}

/// Bins of other frames than those that the calibration left out; of few frames, which it leaves out all, of the same.
fn left_out(data: &Data, settings: &FillSettings, calibration: &Calibration) -> Shares {
    let mut shares = Shares::default();
    for number in 0..Fold::usual_number(data.bins()) {
        let fold = Fold::new(data.bins(), number, 24, 6000).expect("enough frames");
        for p in fold.predict(data, settings) {
            let (light, view) = (p.bin.light.map(f64::from), p.bin.view.map(f64::from));
            for is_within in calibration.covers(&p) {
                shares.add(light, view, p.weight.into(), is_within);
            }
        }
    }
    shares
}

/// True values at cells of pairs of patches without a pattern: interpolated ones, and measured ones
/// with their mirrors.
fn truths(
    data: &Data,
    settings: &FillSettings,
    calibration: &Calibration,
    model: &dyn Brdf,
) -> [Shares; 2] {
    let grid = data.bins().grid();
    let origins = origins(data.bins());
    let moved = data.moved(settings.coordinates);
    let hierarchy = moved.as_ref().unwrap_or(data.hierarchy());
    let patches = cover(grid, &[settings.block_deg, 0.5 * settings.block_deg]).patches;
    let mut refiner = Refiner::new(settings);
    let mut shares = [(); 2].map(|()| Shares::default());
    for k in 0..PAIRS {
        let (p, q) = (k * 7919 % patches.len(), k * 104_729 % patches.len());
        let (p, q) = (&patches[p], &patches[q]);
        let solved = refiner.solve(hierarchy, settings, (p, q), true);
        let (rows, columns) = (p.vectors.len(), q.vectors.len());
        // Around the pole a pair has thousands of cells, with one error.
        for k in (0..rows * columns).step_by((rows * columns / CELLS).max(1)) {
            let (a, b) = (k / columns, k % columns);
            let (light, view) = (p.vectors[a], q.vectors[b]);
            let cell = grid.cell(p.directions[a] as usize, q.directions[b] as usize);
            if origins[cell] == Origin::Extrapolated as u8 {
                continue;
            }
            let log = solved.cells[k];
            let error = calibration.standard_error(light, view, log, solved.variances[k]);
            let truth = model.eval(light, view);
            let measured = origins[cell] <= Origin::Reciprocal as u8;
            for c in 0..3 {
                let off = (f64::from(log[c]) - truth[c].natural_log()).abs();
                let is_within = off <= 1.96 * f64::from(error[c]);
                shares[usize::from(measured)].add(light, view, 1.0, is_within);
            }
        }
    }
    shares
}
