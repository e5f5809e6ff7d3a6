//! Time and memory of binning and filling, against the number of samples, threads, and the grid's step.
//!
//! `cargo bench -p gonia-brdf --bench growth` prints a table. Each row runs in a process of its own; its
//! peak of memory counts from when the samples are there. A grid that does not fit memory is filled by way of the disk:
//! `cargo xtask figures fill-fine` measures that. `-- --few` prints the table of few samples alone, at random pairs of
//! directions: time of a grid of 2°, and error and coverage of the fit at others; materials or numbers of samples after
//! it leave the other rows out, `seed=9` draws other samples, `blocks` fills by blocks what is not isotropic, and
//! `values` leaves the error bars out.

#![allow(clippy::expect_used)]

mod plan;

use gonia_brdf::interpolate::{Data, FillSettings, fill, select};
use gonia_brdf::progress::silent;
use gonia_brdf::random::Random;
use gonia_brdf::scattered::ScatteredFit;
use gonia_brdf::{Bins, Brdf, DenseBrdf, Direction, Elementary, Grid, Sample};
use plan::{cpu_seconds, material, measure};
use std::process::Command;
use std::time::Instant;

/// Samples (at most), threads, and step of the grid in degrees.
type Row = (usize, usize, f64);

const ALL: usize = usize::MAX;
const ROWS: [Row; 6] = [
    (10_000, 2, 2.0),
    (100_000, 2, 2.0),
    (1_000_000, 2, 2.0),
    (ALL, 2, 2.0),
    (ALL, 1, 2.0),
    (ALL, 2, 4.0),
];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let Some(k) = arguments.iter().position(|a| a == "--row") {
        let number = |by: usize| arguments[k + by].parse::<f64>().expect("a number");
        return measure_row(number(1) as usize, number(2));
    }
    if arguments.iter().any(|a| a == "--few") {
        return few_samples(&arguments);
    }
    println!(
        "| samples | bins | step | threads | binning, CPU-s | sorting and choosing, CPU-s | fill, CPU-s | all, CPU-s | wall, s | peak, MB |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (samples, threads, step) in ROWS {
        let program = std::env::current_exe().expect("this program");
        let status = Command::new(program)
            .args(["--row", &samples.to_string(), &step.to_string()])
            .env("RAYON_NUM_THREADS", threads.to_string())
            .status();
        assert!(status.expect("this program again").success());
    }
}

fn measure_row(samples: usize, step: f64) {
    let grid = Grid::with_step_deg(step).expect("a grid step");
    let mut all = measure(&*material("fabric"));
    // Thinned evenly: all frames, with fewer points each.
    let every = all.len().div_ceil(samples);
    let mut number = 0;
    all.retain(|_| {
        number += 1;
        number % every == 1 % every
    });
    all.shrink_to_fit();
    let count = all.len();
    // From here on the peak counts anew.
    std::fs::write("/proc/self/clear_refs", "5").expect("Linux");
    let (start, mut last) = (Instant::now(), cpu_seconds());
    let first = last;
    let mut lap = || {
        let now = cpu_seconds();
        now - std::mem::replace(&mut last, now)
    };
    let bins = Bins::new(grid, &all);
    drop(all);
    let binning = lap();
    let data = Data::new(&bins);
    let settings = FillSettings {
        block_deg: FillSettings::DEFAULT.block_deg.max(2.0 * step),
        ..FillSettings::DEFAULT
    };
    let settings = select(&data, settings).settings;
    let choosing = lap();
    drop(fill(&data, &settings, &silent).expect("enough bins"));
    let filling = lap();
    println!(
        "| {count} | {} | {step}° | {} | {binning:.1} | {choosing:.1} | {filling:.1} | {:.1} | {:.1} | {:.0} |",
        bins.bins().len(),
        rayon::current_num_threads(),
        cpu_seconds() - first,
        start.elapsed().as_secs_f64(),
        peak_mb(),
    );
}

/// The most memory that was resident, MB.
fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kib = line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok());
    kib.map_or(f64::NAN, |kib| kib * 1.024e-3)
}

/// Numbers of samples at random pairs of directions.
const FEW: [usize; 5] = [10, 100, 1000, 10_000, 100_000];
/// Their noise, relative.
const NOISE: f64 = 0.01;
/// At so many pairs the fit is compared with the truth …
const ASKED: usize = 2000;
/// … and the grid at the nodes next to so many: the few that are far off, on lobes at grazing angles, are more than one
/// or two then.
const ASKED_NODES: usize = 40_000;

/// The rows of all materials and numbers of samples, or of those among the arguments.
fn few_samples(only: &[String]) {
    println!(
        "| material | samples | symmetry found | choosing, CPU-s | fill, CPU-s | with error bars, CPU-s | RMS | at nodes | within 95 % bars | at nodes |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let others: Vec<&str> = plan::named(only);
    let is_named = |name: &&str| only.iter().any(|a| a == name);
    let mut names: Vec<&str> = others.into_iter().filter(is_named).collect();
    if names.is_empty() {
        names = vec!["satin-paint", "fabric"];
    }
    let numbers = only.iter().filter_map(|word| word.parse().ok());
    let mut counts: Vec<usize> = numbers.collect();
    if counts.is_empty() {
        counts = FEW.to_vec();
    }
    let by_blocks = only.iter().any(|a| a == "blocks");
    let values = only.iter().any(|a| a == "values");
    let mut seeds = only.iter().filter_map(|a| a.strip_prefix("seed="));
    let seed: Option<u64> = seeds.next().map(|seed| seed.parse().expect("a number"));
    for name in names {
        let material = material(name);
        for samples in &counts {
            let seed = seed.unwrap_or(*samples as u64);
            few_row(name, &*material, *samples, seed, (by_blocks, values));
        }
    }
}

fn few_row(
    name: &str,
    material: &dyn Brdf,
    count: usize,
    seed: u64,
    (by_blocks, values): (bool, bool),
) {
    let grid = Grid::with_step_deg(2.0).expect("a grid step");
    let mut random = Random::new(seed);
    let lowest = 80f64.to_radians().cosine();
    let mut direction = || {
        let theta = random.between(lowest, 1.0).arc_cosine();
        Direction::from_deg(theta.to_degrees(), random.between(0.0, 360.0))
    };
    let truth = |l: Direction, v: Direction| material.eval(l.to_vec3(), v.to_vec3());
    let known: Vec<_> = (0..count).map(|_| (direction(), direction())).collect();
    let asked: Vec<_> = (0..ASKED).map(|_| (direction(), direction())).collect();
    let nodes: Vec<_> = (0..ASKED_NODES)
        .map(|_| (direction(), direction()))
        .collect();
    let mut noise = Random::new(7);
    let samples: Vec<Sample> = known
        .iter()
        .map(|(l, v)| {
            let value = truth(*l, *v).map(|f| (f * (1.0 + NOISE * noise.normal())) as f32);
            Sample::new(*l, *v, value)
        })
        .collect();
    let mut last = cpu_seconds();
    let mut lap = || {
        let now = cpu_seconds();
        now - std::mem::replace(&mut last, now)
    };
    let fit = ScatteredFit::new(&samples, None).expect("enough samples");
    let choosing = lap();
    let symmetry = fit.choice().settings.symmetry;
    let by_blocks = by_blocks && !symmetry.is_isotropic();
    let mut at_nodes = (f64::NAN, f64::NAN);
    let times = [false, true].map(|with_errors| {
        if with_errors && (by_blocks || values) {
            return "–".to_owned();
        }
        let dense = if by_blocks {
            let bins = Bins::new(grid, &symmetry.completed(samples.clone()));
            let data = Data::new(&bins);
            let settings = select(&data, FillSettings::DEFAULT).settings;
            let dense = fill(&data, &settings, &silent).expect("enough bins");
            (dense, None)
        } else {
            fit.dense(grid, with_errors)
        };
        let time = format!("{:.2}", lap());
        at_nodes = against_truth(&dense, &truth, &nodes);
        lap();
        time
    });
    let (mut squares, mut within) = (0.0, 0.0);
    for ((value, error), (l, v)) in fit.at_all(&asked).iter().zip(&asked) {
        let truth = truth(*l, *v);
        for c in 0..3 {
            squares += (value[c] / truth[c]).natural_log().powi(2);
            within += f64::from(u8::from((value[c] - truth[c]).abs() <= 1.96 * error[c]));
        }
    }
    let all = 3.0 * ASKED as f64;
    println!(
        "| {name} | {count} | {symmetry} | {choosing:.2} | {} | {:.4} | {:.4} | {:.1} % | {} |",
        times.join(" | "),
        (squares / all).sqrt(),
        at_nodes.0,
        100.0 * within / all,
        match at_nodes.1.is_nan() {
            true => "–".to_owned(),
            false => format!("{:.1} %", at_nodes.1),
        },
    );
}

/// A dense BRDF with its errors at the nodes nearest to pairs of directions: RMS of logarithms over the truth, and the
/// share within 95 % bars, percent.
fn against_truth(
    (dense, errors): &(DenseBrdf, Option<[Vec<f32>; 3]>),
    truth: &impl Fn(Direction, Direction) -> [f64; 3],
    pairs: &[(Direction, Direction)],
) -> (f64, f64) {
    let grid = dense.grid();
    let (mut squares, mut within) = (0.0, 0.0);
    for (light, view) in pairs {
        let nearest = |d: &Direction| grid.nearest(d.theta_deg(), d.phi_deg());
        let [l, v] = [light, view].map(|d| nearest(d).expect("within the grid"));
        let truth = truth(grid.direction(l), grid.direction(v));
        for (c, (found, truth)) in dense.at(l, v).into_iter().zip(truth).enumerate() {
            let found = f64::from(found);
            squares += (found / truth).natural_log().powi(2);
            let error = |e: &[Vec<f32>; 3]| f64::from(e[c][grid.cell(l, v)]);
            let error = errors.as_ref().map_or(f64::NAN, error);
            within += match error.is_nan() {
                true => f64::NAN,
                false => f64::from(u8::from((found - truth).abs() <= 1.96 * error)),
            };
        }
    }
    let all = 3.0 * pairs.len() as f64;
    ((squares / all).sqrt(), 100.0 * within / all)
}
