//! Error against number of poses on three materials: poses spread evenly by rings, poses that keep
//! the largest distance from each other, and poses chosen where the error bars are large
//! (`gonia plan --adaptive`).
//!
//! `cargo bench -p gonia --bench adaptive [-- MATERIAL...] [--out DIR]` prints a table (log RMS by
//! stratum, mean cosine-weighted error, ΔE00 of a sphere), and writes it as `adaptive.csv` and
//! `adaptive.svg`.

#![allow(clippy::expect_used)]

mod drawing;

use drawing::{Line, draw};
use gonia_brdf::Elementary;
use gonia_brdf::direction::local_direction;
use gonia_brdf::interpolate::{ErrorBars, FillSettings};
use gonia_brdf::model::{Kurt, KurtLobe};
use gonia_brdf::{Bins, Brdf, DenseBrdf, Direction, Grid, Pose, Sample};
use gonia_pipeline::{Options, Side, Table, compare, fill_bins, silent};
use gonia_plan::Rings;
use gonia_plan::adaptive::{Reach, propose};
use gonia_rig::{Figures, Scale, Stratum};
use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use std::fmt::Write as _;

/// The paper's rig.
const REACH: Reach = Reach {
    light_m: 1.1,
    camera_m: 1.8,
    radius_m: 0.277,
    theta_max_deg: [85.0, 75.0],
    keep_out_deg: 8.0,
};
/// Standard deviation of a sample, relative.
const NOISE: f64 = 0.015;
/// Numbers of poses; each plan but the first grows from the one before.
const POSES: [usize; 5] = [500, 750, 1000, 1500, 2000];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let out = arguments
        .iter()
        .position(|a| a == "--out")
        .map_or(".", |k| arguments[k + 1].as_str());
    let grid = Grid::with_step_deg(4.0).expect("a step");
    let mut csv = String::from("material,plan,poses,interior,grazing,highlight,cosine,sphere\n");
    println!("| {} |", csv.trim_end().replace(',', " | "));
    println!("|---|---|---|---|---|---|---|---|");
    let mut panels = Vec::new();
    for name in ["fabric", "sharp", "sharper"] {
        let any = ["fabric", "sharp", "sharper"].map(|n| arguments.iter().any(|a| a == n));
        if any.contains(&true) && !arguments.iter().any(|a| a == name) {
            continue;
        }
        let model = material(name);
        let start = even(POSES[0]);
        let mut series = Vec::new();
        for plan in ["rings", "far apart", "adaptive"] {
            let mut poses = start.clone();
            let mut points = Vec::new();
            let mut last: Option<(DenseBrdf, ErrorBars)> = None;
            for n in POSES {
                if plan == "rings" {
                    poses = even(n);
                } else if let Some((dense, bars)) = &last
                    && n > poses.len()
                {
                    let relative = match plan {
                        // Where all is equally unknown, only distance counts.
                        "far apart" => vec![1.0; grid.n_cells()],
                        _ => bars.relative(dense),
                    };
                    let more = n - poses.len();
                    poses.extend(propose(grid, &relative, &poses, more, &REACH).poses);
                }
                let fill = filled(&poses, &*model, grid);
                let figures = compared(&fill.0, &*model);
                let row = row(name, plan, poses.len(), &figures);
                println!("| {} |", row.trim_end().replace(',', " | "));
                csv += &row;
                let interior = figures.stratum(Stratum::Interior).expect("cells");
                points.push((poses.len() as f64, interior.log_rms));
                last = Some(fill);
            }
            series.push((plan.to_owned(), points));
        }
        panels.push((
            format!("{name}: log RMS of the interior over poses"),
            series,
        ));
    }
    let lines: Vec<Line> = panels
        .iter()
        .map(|(name, series)| Line {
            name,
            x: "poses",
            series: series.clone(),
            log: true,
        })
        .collect();
    std::fs::write(format!("{out}/adaptive.csv"), csv).expect("a folder to write to");
    std::fs::write(format!("{out}/adaptive.svg"), draw(&[], &lines)).expect("the same");
}

fn row(material: &str, plan: &str, poses: usize, figures: &Figures) -> String {
    let rms = |s| figures.stratum(s).map_or(f64::NAN, |f| f.log_rms);
    let cosine = figures
        .stratum(Stratum::All)
        .map_or(f64::NAN, |f| f.cos_error_mean);
    let mut row = String::new();
    let _ = writeln!(
        row,
        "{material},{plan},{poses},{:.4},{:.4},{:.4},{cosine:.4},{:.3}",
        rms(Stratum::Interior),
        rms(Stratum::Grazing),
        rms(Stratum::Highlight),
        figures.sphere_delta_e
    );
    row
}

fn compared(dense: &DenseBrdf, model: &dyn Brdf) -> Figures {
    let table = Table {
        brdf: dense,
        scale: Scale::Absolute,
    };
    compare(table, Side::Model(model), &Options::default()).expect("positive values")
}

fn filled(poses: &[Pose], model: &dyn Brdf, grid: Grid) -> (DenseBrdf, ErrorBars) {
    let bins = Bins::new(grid, &measure(model, poses));
    let filled = fill_bins(&bins, FillSettings::DEFAULT, true, &silent).expect("enough frames");
    (filled.dense, filled.errors.expect("error bars"))
}

/// The plan nearest to `n` poses with lights and views equally dense, in rings.
fn even(n: usize) -> Vec<Pose> {
    let ring = |theta: f64, step: f64| {
        let around = 360.0 * theta.to_radians().sine() / step;
        (theta, around.round().max(1.0) as usize)
    };
    let plan = |step: f64| {
        let rows = (75.0 / step).round().max(1.0);
        let views: Vec<_> = (0..=rows as usize)
            .map(|k| ring(75.0 * k as f64 / rows, step))
            .collect();
        let mut lights = views.clone();
        lights.push(ring(85.0, step));
        Rings { lights, views }.listed()
    };
    (0..400)
        .map(|k| plan(8.0 + 0.1 * f64::from(k)))
        .min_by_key(|poses| poses.len().abs_diff(n))
        .expect("steps to try")
}

fn measure(model: &dyn Brdf, poses: &[Pose]) -> Vec<Sample> {
    let points: Vec<[f64; 2]> = (-19..=19)
        .flat_map(|x| (-19..=19).map(move |y| [0.014 * f64::from(x), 0.014 * f64::from(y)]))
        .filter(|p| p[0].hypotenuse(p[1]) <= REACH.radius_m)
        .collect();
    let of_frame = |(frame, pose): (usize, &Pose)| -> Vec<Sample> {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(frame as u64);
        points
            .iter()
            .map(|point| {
                let l = local_direction(pose.light, REACH.light_m, *point);
                let v = local_direction(pose.view, REACH.camera_m, *point);
                let rgb = model
                    .eval(l, v)
                    .map(|value| (value * (1.0 + NOISE * normal(&mut random))) as f32);
                let (l, v) = (Direction::from_vec3(l), Direction::from_vec3(v));
                Sample::new(l, v, rgb).in_frame(frame as u32)
            })
            .collect()
    };
    poses
        .par_iter()
        .enumerate()
        .flat_map_iter(of_frame)
        .collect()
}

/// A nearly normal number: the sum of twelve uniform ones.
fn normal(random: &mut Xoshiro256PlusPlus) -> f64 {
    (0..12)
        .map(|_| f64::from(random.next_u32()) / f64::from(u32::MAX))
        .sum::<f64>()
        - 6.0
}

fn material(name: &str) -> Box<dyn Brdf> {
    let lobe = |mx, my| KurtLobe {
        specular: [1.0, 0.8, 0.6],
        f0: 0.05,
        mx,
        my,
        alpha: 0.3,
        azimuth_deg: 31.0,
    };
    let base = [0.2, 0.15, 0.1];
    Box::new(match name {
        "sharp" => Kurt::new(base, &[lobe(0.05, 0.3)]),
        "sharper" => Kurt::new(base, &[lobe(0.03, 0.12)]),
        _ => Kurt::two_thread_fabric(),
    })
}
