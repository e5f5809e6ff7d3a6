//! Binning the paper's plan: 10.4 million samples into the cells of a 2° grid.
//!
//! `cargo bench -p gonia-brdf --bench bins` prints a table: samples, bins, and the medians over seven
//! runs of CPU and wall seconds.

mod plan;

use gonia_brdf::{Bins, Grid};
use plan::{cpu_seconds, material, measure};
use std::time::Instant;

fn main() {
    let samples = measure(&*material("fabric"));
    let mut runs: Vec<(f64, f64)> = Vec::new();
    let mut filled = 0;
    for _ in 0..7 {
        let (start, cpu) = (Instant::now(), cpu_seconds());
        filled = Bins::new(Grid::PAPER, &samples).bins().len();
        runs.push((cpu_seconds() - cpu, start.elapsed().as_secs_f64()));
    }
    let median = |of: fn(&(f64, f64)) -> f64| {
        let mut values: Vec<f64> = runs.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    println!("| samples | bins | CPU-s | wall, s |\n|---|---|---|---|");
    println!(
        "| {} | {filled} | {:.2} | {:.2} |",
        samples.len(),
        median(|run| run.0),
        median(|run| run.1)
    );
}
