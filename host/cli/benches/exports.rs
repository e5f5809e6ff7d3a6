//! What each format of `gonia export` loses of a table, with its size and the time it takes.
//!
//! `cargo bench -p gonia --bench exports -- DENSE.exr` prints a row for each format at its own resolution, and for
//! those whose size can be chosen one at the smallest and at twice its own. A relative table is taken as it is.

#![allow(clippy::expect_used)]

use cpu_time::ProcessTime;
use gonia_formats::dense::read_dense_channels;
use gonia_formats::export::{EXPORTS, ExportFormat};
use gonia_pipeline::export::{ExportSource, Places, export};
use gonia_rig::DenseChannels;
use std::path::{Path, PathBuf};

fn main() {
    let dense = std::env::args()
        .skip(1)
        .find(|argument| !argument.starts_with('-'));
    let dense = PathBuf::from(dense.expect("the name of a dense BRDF"));
    let table = read_dense_channels(&dense).expect("a dense BRDF");
    let folder = tempfile::tempdir().expect("a folder");
    println!("| format | resolution | compared at | median of \\|ln\\| | p99 | size, MB | CPU-s |");
    println!("|---|---|---|---|---|---|---|");
    for format in EXPORTS {
        for resolution in resolutions(format) {
            let name = format!("{}-{resolution}.{}", format.name, format.ending);
            row(
                &table,
                &dense,
                &folder.path().join(name),
                format,
                resolution,
            );
        }
    }
}

/// Its own, the least and twice its own, as far as there are such.
fn resolutions(format: &ExportFormat) -> Vec<usize> {
    format.resolution.as_ref().map_or_else(
        || vec![0],
        |of| {
            let mut all = vec![of.least, of.default, (2 * of.default).min(of.most)];
            all.dedup();
            all
        },
    )
}

fn row(table: &DenseChannels, dense: &Path, path: &Path, format: &ExportFormat, resolution: usize) {
    let source = ExportSource {
        dense: table.clone(),
        path: dense,
        errors: None,
        scale_by: Some(1.0),
        allow_coarse: true,
    };
    let start = ProcessTime::now();
    let (error, _) = export(source, path, format, resolution).expect("a file");
    let seconds = start.elapsed().as_secs_f64();
    let places = match error.places {
        Places::Anywhere => "random directions",
        Places::OfTheFile => "the file's own",
    };
    let resolution = match resolution {
        0 => "–".to_owned(),
        n => n.to_string(),
    };
    println!(
        "| `{}` | {resolution} | {places} | {:.4} | {:.3} | {:.1} | {seconds:.1} |",
        format.name,
        error.median,
        error.p99,
        size_of(path) as f64 * 1e-6,
    );
}

/// Bytes of a file, or of all files in a folder.
fn size_of(path: &Path) -> u64 {
    match std::fs::read_dir(path) {
        Ok(entries) => entries.flatten().map(|entry| size_of(&entry.path())).sum(),
        Err(_) => std::fs::metadata(path).map_or(0, |file| file.len()),
    }
}
