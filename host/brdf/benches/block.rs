//! Time of the two stages of one block: fitting (kernel matrix, factor, back substitution), and
//! evaluation at the 256 cells of a pair of 8° patches. Best of many runs, on one thread.
//!
//! `cargo bench -p gonia-brdf --bench block` prints a table, a row for each number of data.

use gonia_brdf::Elementary;
use gonia_brdf::interpolate::Matern32;
use gonia_brdf::interpolate::block::{Block, BlockSettings, KrigingBlock};
use gonia_brdf::interpolate::coordinates::Drift;
use gonia_brdf::interpolate::datum::Datum;
use std::time::Instant;

fn main() {
    let settings = BlockSettings {
        anisotropy: 1.0,
        range: 8.0,
        noise_variance: 1e-4,
        nugget_min: 1e-4,
        beyond: 0.5,
        drift: Drift::NONE,
    };
    println!("| data | fit, µs | evaluate 256 cells, µs |\n|---|---|---|");
    for n in [32, 64, 128, 256] {
        let data: Vec<Datum> = (0..n).map(|k| datum(k, 0.3)).collect();
        let places: Vec<[f32; 6]> = (0..256).map(|k| datum(k, 0.1).point).collect();
        let mut block = KrigingBlock::new(&Matern32);
        let mut out = Vec::new();
        let (mut fit_us, mut evaluate_us) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..2000 {
            let start = Instant::now();
            block.fit(&data, [0.0; 6], 0.3, &settings);
            fit_us = fit_us.min(1e6 * start.elapsed().as_secs_f64());
            out.clear();
            let start = Instant::now();
            block.evaluate(&places, &mut out);
            evaluate_us = evaluate_us.min(1e6 * start.elapsed().as_secs_f64());
        }
        println!("| {n} | {fit_us:.1} | {evaluate_us:.1} |");
    }
}

/// Data of a smooth function, evenly scattered in a cube of half width `size`.
fn datum(k: usize, size: f32) -> Datum {
    // Powers of the root of x⁷ = x + 1: a low-discrepancy sequence in six dimensions.
    let point = [0.8986, 0.8075, 0.7257, 0.6521, 0.5860, 0.5266]
        .map(|a: f64| (2.0 * (k as f64 * a).fract() - 1.0) as f32 * size);
    let value = (3.0 * point[0]).sine() + point[1] * point[2];
    Datum {
        point,
        log_value: [value, 2.0 * value, -value],
        count: 3.0,
        source: 0,
    }
}
