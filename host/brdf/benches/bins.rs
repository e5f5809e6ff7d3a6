//! Binning the paper's plan: 10.4 million samples into the cells of a 2° grid.
//!
//! `cargo bench -p gonia-brdf --bench bins`

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
    println!(
        "{} samples into {filled} bins: {:.2} CPU-s, {:.2} s (medians of {})",
        samples.len(),
        median(|run| run.0),
        median(|run| run.1),
        runs.len()
    );
}
