//! How many left-out bins, and how many true values, lie within their 95 % intervals.
//!
//! `cargo bench -p gonia-brdf --bench error_bars -- [MATERIAL …] [--sparse | --poses N [--fall]]`: the paper's plan on the
//! 2° grid, or every tenth of its frames, or about N of them, on 4° (then of all cells of the table). It prints a table: percent in the interior, and in
//! brackets where either θ is beyond 75°, and where the half vector is within 10° of the normal. With `--fall` how errors
//! fall with twice the poses; with `--cost` what uncertainties cost.

#![allow(clippy::expect_used)]

mod plan;

use gonia_brdf::Elementary;
use gonia_brdf::direction::{Vec3, normalize};
use gonia_brdf::interpolate::cross_validation::Fold;
use gonia_brdf::interpolate::patches::cover;
use gonia_brdf::interpolate::refine::Refiner;
use gonia_brdf::interpolate::{
    Calibration, Data, ErrorFall, FillSettings, Origin, fill_with_errors, origins, select,
};
use gonia_brdf::progress::silent;
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
    if arguments.iter().any(|a| a == "--cost") {
        return costs(&named(&arguments));
    }
    if let Some(poses) = few.filter(|_| arguments.iter().any(|a| a == "--fall")) {
        return falls(&named(&arguments), poses);
    }
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
        let few = few.is_some() || sparse;
        let [interpolated, measured] = if few {
            truths_of_table(&data, &settings, &calibration, &*model)
        } else {
            truths(&data, &settings, &calibration, &*model)
        };
        println!("| {name} | {left_out} | {interpolated} | {measured} | {cpu:.1} |");
    }
}

/// What uncertainties cost: CPU time of settings, calibration and fill with them, over that of settings and fill without;
/// the 925 poses of the quick demo, on its grid of 4 degrees and on 2.
fn costs(names: &[&str]) {
    println!("| material | grid | without, CPU-s | with, over without |");
    println!("|---|---|---|---|");
    for name in names {
        let samples = measure_with(&*material(name), NOISE, &Poses::quick());
        for step in [4.0, 2.0] {
            let bins = Bins::new(Grid::with_step_deg(step).expect("a grid step"), &samples);
            let start = cpu_seconds();
            let data = Data::new(&bins);
            let settings = select(&data, FillSettings::DEFAULT).settings;
            let chosen = cpu_seconds();
            drop(gonia_brdf::interpolate::fill(&data, &settings, &silent).expect("bins"));
            let without = cpu_seconds();
            let calibration = Calibration::new(&data, &settings).expect("enough frames");
            ErrorFall::measure(&data, &settings, &calibration);
            drop(fill_with_errors(&data, &settings, &calibration, &silent).expect("bins"));
            let with = cpu_seconds() - without + chosen - start;
            let without = without - start;
            println!(
                "| {name} | {step}° | {without:.1} | {:.2} |",
                with / without
            );
        }
    }
}

/// How errors fall with twice the poses: as cross-validation of the fewer predicts, and as the truths show.
fn falls(names: &[&str], poses: usize) {
    println!(
        "| material | predicted: all, interior, grazing, highlight | found at {poses} and twice as many |"
    );
    println!("|---|---|---|");
    for name in names {
        let model = material(name);
        let grid = Grid::with_step_deg(6.0).expect("a grid step");
        let [few, more] = [poses, 2 * poses].map(|poses| {
            let bins = Bins::new(grid, &measure_with(&*model, NOISE, &Poses::few(poses)));
            let data = Data::new(&bins);
            let settings = select(&data, FillSettings::DEFAULT).settings;
            let calibration = Calibration::new(&data, &settings).expect("enough frames");
            let fall = ErrorFall::measure(&data, &settings, &calibration);
            (fall, errors_of_table(&data, &settings, &*model))
        });
        let fall = few.0;
        let predicted = [fall.all, fall.interior, fall.grazing, fall.highlight];
        let text = predicted.map(|p| p.map_or("-".to_owned(), |p| format!("{p:.2}")));
        let found: Vec<String> = few
            .1
            .iter()
            .zip(more.1)
            .map(|(few, more)| {
                format!("{:.2}", (few / more).natural_log() / std::f64::consts::LN_2)
            })
            .collect();
        println!("| {name} | {} | {} |", text.join(" "), found.join(" "));
    }
}

/// What 68 % of the errors of a filled table keep within: of all cells, interior, grazing, the brightest hundredth.
fn errors_of_table(data: &Data, settings: &FillSettings, model: &dyn Brdf) -> [f64; 4] {
    let grid = data.bins().grid();
    let dense = gonia_brdf::interpolate::fill(data, settings, &silent).expect("bins");
    let origins = origins(data.bins());
    let mut errors: [Vec<f64>; 4] = Default::default();
    let mut by_brightness = Vec::new();
    for cell in 0..grid.n_cells() {
        let (light, view) = grid.light_and_view(cell);
        let repeats = |d: usize| (1..grid.n_phi()).contains(&d);
        if repeats(light) || repeats(view) || origins[cell] == Origin::Extrapolated as u8 {
            continue;
        }
        let (i, v) = (
            grid.direction(light).to_vec3(),
            grid.direction(view).to_vec3(),
        );
        let found = f64::from(dense.planes()[1][cell]);
        let error = (found / model.eval(i, v)[1]).natural_log().abs();
        let grazing = i[2].min(v[2]) < GRAZING_DEG.to_radians().cosine();
        errors[0].push(error);
        errors[1 + usize::from(grazing)].push(error);
        by_brightness.push((found * i[2] * v[2], error));
    }
    by_brightness.sort_by(|a, b| b.0.total_cmp(&a.0));
    by_brightness.truncate(by_brightness.len() / 100);
    errors[3] = by_brightness.into_iter().map(|(_, error)| error).collect();
    errors.map(|mut errors| {
        errors.sort_by(f64::total_cmp);
        errors[errors.len() * 68 / 100]
    })
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

/// True values at all cells of a filled table: interpolated ones, and measured ones with their mirrors.
fn truths_of_table(
    data: &Data,
    settings: &FillSettings,
    calibration: &Calibration,
    model: &dyn Brdf,
) -> [Shares; 2] {
    let grid = data.bins().grid();
    let (dense, bars) = fill_with_errors(data, settings, calibration, &silent).expect("bins");
    let mut shares = [(); 2].map(|()| Shares::default());
    for cell in 0..grid.n_cells() {
        let (light, view) = grid.light_and_view(cell);
        // Around the pole all cells of a ring have one value.
        let repeats = [light, view].iter().any(|d| (1..grid.n_phi()).contains(d));
        if repeats || light > view || bars.origin[cell] == Origin::Extrapolated as u8 {
            continue;
        }
        let (i, v) = (
            grid.direction(light).to_vec3(),
            grid.direction(view).to_vec3(),
        );
        let truth = model.eval(i, v);
        let measured = bars.origin[cell] <= Origin::Reciprocal as u8;
        for c in 0..3 {
            let off = (f64::from(dense.planes()[c][cell]) - truth[c]).abs();
            let is_within = off <= 1.96 * f64::from(bars.standard_error[c][cell]);
            shares[usize::from(measured)].add(i, v, 1.0, is_within);
        }
    }
    shares
}

/// True values at cells of pairs of patches without a pattern: interpolated ones, and measured ones
/// with their mirrors; by the blocks themselves, not blended.
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
