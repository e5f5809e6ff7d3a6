//! Time and memory of binning and filling, against the number of samples, threads, and the grid's step.
//!
//! `cargo bench -p gonia-brdf --bench growth` prints a table. Each row runs in a process of its own; its
//! peak of memory counts from when the samples are there. A grid that does not fit memory is filled by way of the disk:
//! `cargo xtask figures fill-fine` measures that.

#![allow(clippy::expect_used)]

mod plan;

use gonia_brdf::interpolate::{Data, FillSettings, fill, select};
use gonia_brdf::progress::silent;
use gonia_brdf::{Bins, Grid};
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
