//! Error against number of poses on three materials: poses spread evenly by rings, poses that keep
//! the largest distance from each other, and poses chosen where the error bars are large
//! (`gonia plan --adaptive`).
//!
//! `cargo bench -p gonia --bench adaptive [-- MATERIAL...] [--out DIR]` prints a table (log RMS by
//! stratum, mean cosine-weighted error, ΔE00 of a sphere), and writes it as `adaptive.csv` and
//! `adaptive.svg`.

#![allow(clippy::expect_used)]

mod drawing;
mod measured;

use drawing::{Line, draw};
use gonia_brdf::interpolate::{ErrorBars, FillSettings};
use gonia_brdf::model::{Kurt, KurtLobe};
use gonia_brdf::{Bins, Brdf, DenseBrdf, Grid, Pose};
use gonia_pipeline::{fill_bins, silent};
use gonia_plan::adaptive::propose;
use gonia_rig::{Figures, Stratum};
use measured::{REACH, compared, even, measure};
use std::fmt::Write as _;

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
        let start = even(POSES[0]).listed();
        let mut series = Vec::new();
        for plan in ["rings", "far apart", "adaptive"] {
            let mut poses = start.clone();
            let mut points = Vec::new();
            let mut last: Option<(DenseBrdf, ErrorBars)> = None;
            for n in POSES {
                if plan == "rings" {
                    poses = even(n).listed();
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

fn filled(poses: &[Pose], model: &dyn Brdf, grid: Grid) -> (DenseBrdf, ErrorBars) {
    let bins = Bins::new(grid, &measure(model, poses));
    let filled = fill_bins(&bins, FillSettings::DEFAULT, true, &silent).expect("enough frames");
    (filled.dense, filled.errors.expect("error bars"))
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
