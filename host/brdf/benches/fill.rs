//! Interpolation of a whole plan's samples, against the analytic truth: time, and RMS of
//! ln(f/f_true) over cells that are neither a bin nor a bin's mirror.
//!
//! `cargo bench -p gonia-brdf --bench fill -- [MATERIAL …] [PRESET] [--step 2] [--block 8]
//! [--neighbours 128] [--tolerance 1] [--target-error 0.002] [--budget 4] [--exponent 0.1] [--kernel 0.3]
//! [--weight 1] [--noise 0.015]
//! [tenth|quick|--poses 2000|--even 2000] [--plane 23]`
//!
//! The poses are the paper's 8505, every tenth of them, about so many of them, about so many in even rings, or the 925 of the quick demo. With
//! `--plane` the samples have their images by a half-turn and by a plane of that azimuth, degrees, too.
//! Without `--exponent` the coordinates are chosen; with it, these are taken.
//!
//! It prints a table, with the details of each row above it. CPU-s: sorting, choosing and filling.
//! Interior: both θ ≤ 75°; grazing: one beyond, the other at most 78°; unmeasured: both beyond 78°.
//! Seams: second differences of ln(f/f_true) across borders of blocks, and inside of them.

#![allow(clippy::expect_used)]

mod plan;

use gonia_brdf::Elementary;
use gonia_brdf::interpolate::cross_validation::Fold;
use gonia_brdf::interpolate::patches::cover;
use gonia_brdf::interpolate::{
    Calibration, Data, FillSettings, Preset, fill, fill_with_errors, select,
};
use gonia_brdf::progress::silent;
use gonia_brdf::{Bins, Brdf, Grid, MirrorPlane, Symmetry};
use plan::{Poses, cpu_seconds, material, measure_with};
use rayon::prelude::*;
use std::time::Instant;

/// The command line.
struct Arguments(Vec<String>);

impl Arguments {
    fn has(&self, name: &str) -> bool {
        self.0.iter().any(|a| a == name)
    }

    fn number(&self, name: &str, default: f64) -> f64 {
        let place = self.0.iter().position(|a| a == name);
        place.map_or(default, |k| self.0[k + 1].parse().expect("a number"))
    }

    fn preset(&self) -> Preset {
        let preset = Preset::ALL.into_iter().find(|p| self.has(p.name()));
        preset.unwrap_or(Preset::Default)
    }

    fn settings(&self) -> FillSettings {
        let preset = self.preset().settings();
        FillSettings {
            block_deg: self.number("--block", preset.block_deg),
            tolerance: self.number("--tolerance", preset.tolerance.into()) as f32,
            target_error: self.number("--target-error", preset.target_error.into()) as f32,
            budget: self.number("--budget", preset.budget.into()) as f32,
            neighbours: self.number("--neighbours", preset.neighbours as f64) as usize,
            neighbours_most: self.number("--neighbours", preset.neighbours_most as f64) as usize,
            range: self.number("--range", preset.range.into()) as f32,
            nugget_min: self.number("--nugget", preset.nugget_min.into()) as f32,
            ..preset
        }
    }
}

fn main() {
    let arguments = Arguments(
        std::env::args()
            .skip(1)
            .filter(|a| a != "--bench")
            .collect(),
    );
    println!(
        "| material | preset | poses | CPU-s | interior | grazing | all | unmeasured | seams | inside |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for name in plan::named(&arguments.0) {
        run(name, &arguments);
    }
}

/// One material: its samples, bins, settings and fill.
fn run(name: &str, arguments: &Arguments) {
    let grid = Grid::with_step_deg(arguments.number("--step", 2.0)).expect("a grid step");
    let (poses, how_many) = match (arguments.has("tenth"), arguments.has("quick")) {
        (true, _) => (Poses::tenth(), "every tenth of 8505"),
        (_, true) => (Poses::quick(), "925"),
        _ => (Poses::paper(), "8505"),
    };
    let (poses, how_many) = match arguments.number("--poses", 0.0) as usize {
        0 => (poses, how_many.to_owned()),
        count => (Poses::few(count), format!("about {count}")),
    };
    let (poses, how_many) = match arguments.number("--even", 0.0) as usize {
        0 => (poses, how_many),
        count => (Poses::even(count), format!("{count}, even")),
    };
    let model = material(name);
    let samples = measure_with(&*model, arguments.number("--noise", plan::NOISE), &poses);
    let count = samples.len();
    let plane = arguments.number("--plane", f64::NAN);
    let samples = match plane.is_nan() {
        true => samples,
        false => Symmetry::HalfTurnBilateral(MirrorPlane::at_deg(plane)).completed(samples),
    };
    let start = Instant::now();
    let bins = Bins::new(grid, &samples);
    let bin_s = start.elapsed().as_secs_f64();
    drop(samples);
    let base = arguments.settings();
    let cpu = cpu_seconds();
    let data = Data::thinned(&bins, base.one_bin_in);
    let sort_s = cpu_seconds() - cpu;
    let cpu = cpu_seconds();
    let selection = select(&data, base);
    let select_s = cpu_seconds() - cpu;
    for candidate in &selection.candidates {
        println!(
            "  candidate {:<28} {} data, kernel w={:<4} log error {:.4}",
            candidate.settings.coordinates.to_string(),
            candidate.settings.neighbours,
            candidate.settings.kernel_weight,
            candidate.log_error
        );
    }
    let mut settings = selection.settings;
    if arguments.has("--exponent") {
        settings.coordinates.exponent = arguments.number("--exponent", 0.0);
        settings.kernel_weight = arguments.number("--kernel", 0.3);
        settings.coordinates.weight = arguments.number("--weight", settings.coordinates.weight);
    }
    let (cpu, start) = (cpu_seconds(), Instant::now());
    let dense = fill(&data, &settings, &silent).expect("enough bins");
    let (fill_cpu, fill_s) = (cpu_seconds() - cpu, start.elapsed().as_secs_f64());
    if arguments.has("--errors") {
        errors(&data, &settings, &*model);
    }
    let (across, inside) = bends(&dense, &settings, &*model);
    let mut measured = vec![false; grid.n_cells()];
    for bin in bins.bins() {
        let (i, v) = grid.light_and_view(bin.cell as usize);
        measured[grid.cell(i, v)] = true;
        measured[grid.cell(v, i)] = true;
    }
    let rms = |keep: &(dyn Fn(f64, f64) -> bool + Sync)| log_rms(&dense, &*model, &measured, keep);
    println!(
        "  {count} samples in {} bins, binned in {bin_s:.2} s; {sort_s:.1} CPU-s to sort, {select_s:.1} to choose {settings}, {fill_cpu:.1} to fill in {fill_s:.1} s",
        bins.bins().len(),
    );
    println!(
        "| {name} | {} | {how_many} | {:.1} | {:.4} | {:.4} | {:.3} | {:.3} | {across:.4} | {inside:.4} |",
        arguments.preset().name(),
        sort_s + select_s + fill_cpu,
        rms(&|i, v| i <= 75.0 && v <= 75.0),
        rms(&|i, v| i.max(v) > 75.0 && i.min(v) <= 78.0),
        rms(&|_, _| true),
        rms(&|i, v| i > 78.0 && v > 78.0),
    );
}

/// RMS of second differences of ln(f/f_true) between three neighbouring cells in a row, along the
/// view's azimuth and polar angle: where a border of two blocks lies among them, and inside of blocks.
/// More across means that seams show. Both θ ≤ 75°: beyond, one wild cell decides. Rows of cells
/// count inside as often as across: near the pole azimuths lie close, and borders are few.
fn bends(dense: &gonia_brdf::DenseBrdf, settings: &FillSettings, model: &dyn Brdf) -> (f64, f64) {
    let grid = dense.grid();
    let (n, n_phi) = (grid.n_directions(), grid.n_phi());
    let mut block = vec![0; n];
    let patches = cover(grid, &[settings.block_deg]).patches;
    for (number, patch) in patches.iter().enumerate() {
        for direction in &patch.directions {
            block[*direction as usize] = number;
        }
    }
    // Rows of one row of blocks count as one.
    let height = (settings.block_deg / grid.step_deg()).round() as usize;
    let vectors: Vec<_> = (0..n).map(|d| grid.direction(d).to_vec3()).collect();
    let interior = |d: usize| grid.direction(d).theta_deg() <= 75.0;
    let sums = (0..n)
        .into_par_iter()
        .step_by(13)
        .filter(|light| interior(*light))
        .map(|light| {
            let off: Vec<f64> = (0..n)
                .map(|view| {
                    let truth = model.eval(vectors[light], vectors[view])[1];
                    (f64::from(dense.at(light, view)[1]) / truth).natural_log()
                })
                .collect();
            // By axis and row; across borders, and inside.
            let mut sums = vec![[(0.0, 0.0); 2]; 2 * grid.n_theta()];
            // Not at the pole, where all azimuths are one value.
            for view in (n_phi..n).filter(|v| interior(*v)) {
                let around = |k: usize| view / n_phi * n_phi + (view + k) % n_phi;
                let triples = [[around(1), around(2)], [view + n_phi, view + 2 * n_phi]];
                for (axis, [b, c]) in triples.into_iter().enumerate() {
                    if c < n && interior(c) {
                        let inside = usize::from(block[view] == block[c]);
                        let row = axis * grid.n_theta() + view / n_phi / height * height;
                        sums[row][inside].0 += (off[view] - 2.0 * off[b] + off[c]).powi(2);
                        sums[row][inside].1 += 1.0;
                    }
                }
            }
            sums
        })
        .reduce(
            || vec![[(0.0, 0.0); 2]; 2 * grid.n_theta()],
            |mut a, b| {
                for (a, b) in a.iter_mut().flatten().zip(b.iter().flatten()) {
                    *a = (a.0 + b.0, a.1 + b.1);
                }
                a
            },
        );
    matched(&sums)
}

/// RMS of both kinds, the second weighted as the first is spread over the rows.
fn matched(rows: &[[(f64, f64); 2]]) -> (f64, f64) {
    let both = || rows.iter().filter(|row| row.iter().all(|r| r.1 > 0.0));
    let count: f64 = both().map(|row| row[0].1).sum();
    let across: f64 = both().map(|row| row[0].0).sum();
    let inside: f64 = both().map(|row| row[1].0 / row[1].1 * row[0].1).sum();
    ((across / count).sqrt(), (inside / count).sqrt())
}

/// Error bars: time, and how many of the truths lie within the 95 % interval of their cell.
fn errors(data: &Data, settings: &FillSettings, model: &dyn Brdf) {
    let cpu = cpu_seconds();
    let calibration = Calibration::new(data, settings).expect("enough frames");
    let calibrate_s = cpu_seconds() - cpu;
    let (dense, bars) = fill_with_errors(data, settings, &calibration, &silent).expect("bins");
    let fill_s = cpu_seconds() - cpu - calibrate_s;
    println!("  error bars: calibration {calibrate_s:.1} CPU-s, fill {fill_s:.1} CPU-s");
    let fold = Fold::new(data.bins(), 3, 24, 8000).expect("enough frames");
    let predictions = fold.predict(data, settings);
    let share = |keep: &dyn Fn(f64, f64, f64) -> bool| {
        let (mut inside, mut all) = (0, 0);
        for p in &predictions {
            let (i, v) = (p.bin.light.map(f64::from), p.bin.view.map(f64::from));
            let deg = |d: [f64; 3]| d[2].arc_cosine().to_degrees();
            if keep(deg(i), deg(v), f64::from(p.bin.median[1]) * i[2] * v[2]) {
                for covered in calibration.covers(p) {
                    inside += usize::from(covered);
                    all += 1;
                }
            }
        }
        100.0 * inside as f64 / all.max(1) as f64
    };
    let mut weighted: Vec<f64> = predictions
        .iter()
        .map(|p| f64::from(p.bin.median[1] * p.bin.light[2] * p.bin.view[2]))
        .collect();
    weighted.sort_by(f64::total_cmp);
    let bright = weighted[weighted.len() * 95 / 100];
    println!(
        "  left-out bins within 95 %: all {:.1}, interior {:.1}, grazing {:.1}, brightest 5 % {:.1}",
        share(&|_, _, _| true),
        share(&|i, v, _| i <= 75.0 && v <= 75.0),
        share(&|i, v, _| i > 75.0 || v > 75.0),
        share(&|_, _, w| w > bright),
    );
    let grid = data.bins().grid();
    let n = grid.n_directions();
    let mut count = [[0usize; 2]; 4];
    for light in (0..n).step_by(7) {
        for view in (light % 11..n).step_by(11) {
            let cell = grid.cell(light, view);
            let (i, v) = (grid.direction(light), grid.direction(view));
            let truth = model.eval(i.to_vec3(), v.to_vec3());
            let value = dense.at(light, view);
            let row = &mut count[usize::from(bars.origin[cell])];
            for c in 0..3 {
                let relative = f64::from(bars.standard_error[c][cell] / value[c]);
                let off = (f64::from(value[c]) / truth[c]).natural_log().abs();
                row[0] += usize::from(off <= 1.96 * relative);
                row[1] += 1;
            }
        }
    }
    let percent = count.map(|[inside, all]| 100.0 * inside as f64 / all.max(1) as f64);
    println!(
        "  truths within 95 %: measured {:.1}, reciprocal {:.1}, interpolated {:.1}, extrapolated {:.1}",
        percent[0], percent[1], percent[2], percent[3]
    );
}

fn log_rms(
    dense: &gonia_brdf::DenseBrdf,
    model: &dyn Brdf,
    measured: &[bool],
    keep: &(dyn Fn(f64, f64) -> bool + Sync),
) -> f64 {
    let grid = dense.grid();
    let n = grid.n_directions();
    let (sum, count) = (0..n)
        .into_par_iter()
        .map(|light| {
            let i = grid.direction(light);
            let (mut sum, mut count) = (0.0, 0usize);
            // Every seventh view: a prime step meets all azimuths.
            for view in (light % 7..n).step_by(7) {
                let v = grid.direction(view);
                if !measured[grid.cell(light, view)] && keep(i.theta_deg(), v.theta_deg()) {
                    let truth = model.eval(i.to_vec3(), v.to_vec3());
                    let value = dense.at(light, view);
                    // Cloth of a few threads sends nothing at all to some places, which has no logarithm.
                    for c in (0..3).filter(|c| truth[*c] > 0.0) {
                        sum += (f64::from(value[c]) / truth[c]).natural_log().powi(2);
                        count += 1;
                    }
                }
            }
            (sum, count)
        })
        .reduce(|| (0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    (sum / count.max(1) as f64).sqrt()
}
