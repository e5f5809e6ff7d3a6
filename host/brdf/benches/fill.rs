//! Interpolation of a whole plan's samples, against the analytic truth: time by stage, and
//! RMS of ln(f/f_true) over missing cells.
//!
//! `cargo bench -p gonia-brdf --bench fill -- [MATERIAL …] [--step 2] [--patch 4] [--nodes 128]`

#![allow(clippy::expect_used)]

use gonia_brdf::direction::local_direction;
use gonia_brdf::hemisphere::{paper_lights, paper_views};
use gonia_brdf::interpolate::{Settings, fill, select};
use gonia_brdf::model::{Kurt, KurtLobe};
use gonia_brdf::{Bins, Brdf, Direction, Grid, Sample};
use rayon::prelude::*;
use std::time::Instant;

/// Standard deviation of the noise, relative.
const NOISE: f64 = 0.015;

fn main() {
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let option = |name: &str, default: f64| {
        arguments
            .iter()
            .position(|a| a == name)
            .map_or(default, |k| arguments[k + 1].parse().expect("a number"))
    };
    let names = ["matte", "broad", "fabric", "sharp", "sharper"];
    let asked: Vec<&str> = names
        .into_iter()
        .filter(|n| arguments.iter().any(|a| a == n))
        .collect();
    let grid = Grid::with_step_deg(option("--step", 2.0)).expect("a grid step");
    println!(
        "material   samples     bins  bin s  select CPU-s  fill CPU-s  fill s  interior   all  void  settings"
    );
    for name in if asked.is_empty() {
        names.to_vec()
    } else {
        asked
    } {
        let model = material(name);
        let samples = measure(&*model);
        let start = Instant::now();
        let bins = Bins::new(grid, &samples);
        let bin_s = start.elapsed().as_secs_f64();
        let count = samples.len();
        drop(samples);
        let base = Settings {
            patch_deg: option("--patch", Settings::DEFAULT.patch_deg),
            nodes: option("--nodes", Settings::DEFAULT.nodes as f64) as usize,
            range: option("--range", Settings::DEFAULT.range.into()) as f32,
            nugget_min: option("--nugget", Settings::DEFAULT.nugget_min.into()) as f32,
            ..Settings::DEFAULT
        };
        let cpu = cpu_seconds();
        let selection = select(&bins, base);
        let select_s = cpu_seconds() - cpu;
        for trial in &selection.trials {
            println!(
                "  tried {:<28} log-RMS {:.4}",
                trial.settings.coordinates.to_string(),
                trial.log_rms
            );
        }
        let (cpu, start) = (cpu_seconds(), Instant::now());
        let dense = fill(&bins, &selection.settings, &|_| ()).expect("enough bins");
        let (fill_cpu, fill_s) = (cpu_seconds() - cpu, start.elapsed().as_secs_f64());
        let mut measured = vec![false; grid.n_cells()];
        for bin in bins.bins() {
            let (i, v) = grid.light_and_view(bin.cell as usize);
            measured[grid.cell(i, v)] = true;
            measured[grid.cell(v, i)] = true;
        }
        let rms =
            |keep: &(dyn Fn(f64, f64) -> bool + Sync)| log_rms(&dense, &*model, &measured, keep);
        println!(
            "{name:<9} {count:>9} {:>8} {bin_s:>6.2} {select_s:>13.1} {fill_cpu:>11.1} {fill_s:>7.1} {:>9.4} {:>5.3} {:>5.3}  {}",
            bins.bins().len(),
            rms(&|i, v| i <= 75.0 && v <= 75.0),
            rms(&|_, _| true),
            rms(&|i, v| i > 78.0 && v > 78.0),
            selection.settings,
        );
    }
}

fn material(name: &str) -> Box<dyn Brdf> {
    let lobe = |specular: f64, mx, my| KurtLobe {
        specular: [specular, 0.8 * specular, 0.6 * specular],
        f0: 0.05,
        mx,
        my,
        alpha: 0.3,
        azimuth_deg: 31.0,
    };
    Box::new(match name {
        "matte" => Kurt::white_reference_fabric(),
        "broad" => Kurt::new([0.2, 0.15, 0.1], &[lobe(2.0, 0.15, 0.4)]),
        "sharp" => Kurt::new([0.2, 0.15, 0.1], &[lobe(1.0, 0.05, 0.3)]),
        "sharper" => Kurt::new([0.2, 0.15, 0.1], &[lobe(1.0, 0.03, 0.12)]),
        _ => Kurt::two_thread_fabric(),
    })
}

/// The paper's plan on the paper's rig: 8505 frames of 1225 points, with noise.
fn measure(model: &dyn Brdf) -> Vec<Sample> {
    let (lights, views) = (paper_lights(), paper_views());
    let points: Vec<[f64; 2]> = (-19..=19)
        .flat_map(|x| (-19..=19).map(move |y| [0.014 * f64::from(x), 0.014 * f64::from(y)]))
        .filter(|p| p[0].hypot(p[1]) <= 0.277)
        .collect();
    (0..lights.len() * views.len())
        .into_par_iter()
        .flat_map_iter(|frame| {
            let (light, view) = (lights[frame / views.len()], views[frame % views.len()]);
            let points = &points;
            points.iter().enumerate().map(move |(k, point)| {
                let l = local_direction(light, 1.1, *point);
                let v = local_direction(view, 1.8, *point);
                let value = model.eval(l, v);
                let noise = [0, 1, 2].map(|c| 1.0 + NOISE * normal((frame * 1225 + k) * 3 + c));
                let (l, v) = (Direction::from_vec3(l), Direction::from_vec3(v));
                Sample {
                    theta_i_deg: l.theta_deg() as f32,
                    phi_i_deg: l.phi_deg() as f32,
                    theta_v_deg: v.theta_deg() as f32,
                    phi_v_deg: v.phi_deg() as f32,
                    rgb: [0, 1, 2].map(|c| (value[c] * noise[c]) as f32),
                    frame: frame as u32,
                }
            })
        })
        .collect()
}

/// A nearly normal number from a counter: the sum of four uniform ones.
fn normal(counter: usize) -> f64 {
    let mut x = (counter as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d;
    x ^= x >> 31;
    x = x.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x ^= x >> 28;
    let sum: f64 = (0..4).map(|k| f64::from((x >> (16 * k)) as u16)).sum();
    (sum / 65536.0 - 2.0) * 3f64.sqrt()
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
                    for c in 0..3 {
                        sum += (f64::from(value[c]) / truth[c]).ln().powi(2);
                        count += 1;
                    }
                }
            }
            (sum, count)
        })
        .reduce(|| (0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    (sum / count.max(1) as f64).sqrt()
}

/// CPU seconds of all threads of this process so far.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    let field = |k: usize| {
        after_name
            .split_whitespace()
            .nth(k)
            .and_then(|f| f.parse::<f64>().ok())
    };
    (field(11).unwrap_or(f64::NAN) + field(12).unwrap_or(f64::NAN)) / 100.0
}
