//! What the demo did, in figures: for `summary.toml`, and as a table on the terminal.

use crate::demo::session::Session;
use crate::say::outln;
use crate::table;
use gonia_brdf::Grid;
use gonia_formats::{BinCounts, CellCounts, FileNote, PoseCounts, Summary};
use gonia_pipeline::process::Processed;
use gonia_report::files::{DENSE, ERRORS, MEASURED, REPORT, SUMMARY, TRUTH};
use gonia_rig::CellMask;
use std::path::Path;

/// What each file of a demo holds.
const FILES: [(&str, &str); 13] = [
    (REPORT, "the report"),
    ("sphere.png", "the material on a sphere"),
    (DENSE, "the dense BRDF"),
    (ERRORS, "its standard errors, and what they consist of"),
    (TRUTH, "the true BRDF on the same grid"),
    (
        "samples.npy",
        "samples: theta_i, phi_i, theta_v, phi_v, r, g, b, frame",
    ),
    ("samples.npy.toml", "scale and provenance of these samples"),
    (MEASURED, "one bit a cell: which ones hold a sample"),
    ("plan.csv", "the poses in travelling order"),
    ("rig.toml", "the rig, calibrated"),
    ("nominal.toml", "the rig's drawing"),
    ("frames.csv", "the frames, if kept"),
    (SUMMARY, "these figures"),
];

/// The part of the summary that is known before interpolation.
pub fn start(material: &str, session: &Session, processed: &Processed, poses: usize) -> Summary {
    let mut summary = Summary::new(
        format!("{} on the simulated rig", capitalised(material)),
        processed.scale(),
    );
    summary.poses = Some(PoseCounts {
        planned: poses as u64,
        reached: session.kept as u64,
    });
    let mut frames = processed.frame_counts();
    frames.refused.extend(session.refusals());
    summary.frames = Some(frames);
    summary.pointing = session.pointing();
    summary
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters
        .next()
        .map(|first| first.to_uppercase().chain(letters).collect())
        .unwrap_or_default()
}

/// Adds the counts of bins and cells. Measured cells are those of the bins and their mirrors; cells
/// both of whose polar angles are beyond what any bin has in its lesser one are extrapolated.
pub fn count_cells(summary: &mut Summary, binned: u64, bins: &CellMask) {
    summary.bins = Some(BinCounts::new(binned, bins));
    let grid = bins.grid();
    let reach = (0..grid.n_cells())
        .filter(|cell| bins.contains(*cell))
        .map(|cell| lesser_ring(grid, cell))
        .max()
        .unwrap_or(0);
    let mut counts = CellCounts {
        measured: 0,
        interpolated: 0,
        extrapolated: 0,
    };
    for cell in 0..grid.n_cells() {
        let (light, view) = grid.light_and_view(cell);
        if bins.contains(cell) || bins.contains(grid.cell(view, light)) {
            counts.measured += 1;
        } else if lesser_ring(grid, cell) <= reach {
            counts.interpolated += 1;
        } else {
            counts.extrapolated += 1;
        }
    }
    summary.cells = Some(counts);
}

fn lesser_ring(grid: Grid, cell: usize) -> usize {
    let (light, view) = grid.light_and_view(cell);
    (light / grid.n_phi()).min(view / grid.n_phi())
}

/// Lists the files that are there, with their sizes.
pub fn list_files(summary: &mut Summary, folder: &Path) {
    summary.files = FILES
        .iter()
        .filter_map(|(name, what)| {
            let metadata = std::fs::metadata(folder.join(name)).ok()?;
            metadata.is_file().then(|| FileNote {
                path: (*name).to_owned(),
                bytes: metadata.len(),
                what: (*what).to_owned(),
            })
        })
        .collect();
}

/// Prints the table at the demo's end.
pub fn print(summary: &Summary, session: &Session, frame_rows: &[(String, String)], seconds: f64) {
    let mut rows = Vec::new();
    let mut row = |name: &str, value: String| rows.push((name.to_owned(), value));
    if let Some(poses) = summary.poses {
        row(
            "poses",
            format!(
                "{} of the material and as many of the reference; {} reached, {} given up, {} taken again",
                table::count(poses.planned),
                table::count(poses.reached),
                table::count(session.refused.values().sum()),
                session.retakes
            ),
        );
    }
    row(
        "session",
        format!(
            "{} on the rig's own clock",
            table::duration(session.virtual_s)
        ),
    );
    if let Some(pointing) = &summary.pointing {
        let largest = session.by_shaft_deg.iter().copied().fold(0.0, f64::max);
        row(
            "pointing error",
            format!(
                "by encoder max {:.4}, p99 {:.4} degrees; by true shaft angle max {largest:.4} (limit {})",
                pointing.max_deg, pointing.p99_deg, pointing.limit_deg
            ),
        );
    }
    for (name, value) in frame_rows {
        row(name, value.clone());
    }
    if let (Some(bins), Some(cells)) = (&summary.bins, summary.cells) {
        row(
            "bins filled",
            format!(
                "{} by {} samples",
                table::count(bins.filled),
                table::count(bins.samples)
            ),
        );
        row(
            "cells",
            format!(
                "{} measured (bins and their mirrors), {} interpolated, {} extrapolated",
                table::count(cells.measured),
                table::count(cells.interpolated),
                table::count(cells.extrapolated)
            ),
        );
    }
    if let Some(settings) = summary.provenance.get("interpolation") {
        row("interpolation", settings.clone());
    }
    for stage in &summary.stages {
        row(&stage.name, format!("{:.1} s", stage.seconds));
    }
    row("all", table::duration(seconds));
    for file in &summary.files {
        row(
            &file.path,
            format!("{}, {}", table::bytes(file.bytes), file.what),
        );
    }
    table::print(&rows);
    if let Some(figures) = &summary.figures {
        outln!("\n{figures}");
    }
}
