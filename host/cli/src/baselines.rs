//! The baselines of a measurement, made and printed: what `gonia rivals` and `gonia report --rivals`
//! share.

use crate::progress::Progress;
use crate::say::outln;
use anyhow::{Context, Result};
use gonia_formats::baselines_toml::BaselineTable;
use gonia_formats::check_writable;
use gonia_pipeline::baselines::BaselineOptions;
use gonia_report::make_baselines;
use gonia_rig::{Figures, Stratum};
use std::path::Path;

/// Makes the baselines of a folder, and prints how far each is off.
pub fn make_and_print(
    folder: &Path,
    step_deg: Option<f64>,
    options: &BaselineOptions,
) -> Result<()> {
    // A folder that is not there is no place to write to, and is not made.
    if folder.is_dir() {
        check_writable(folder)?;
    }
    let progress = Progress::new();
    let comparison = make_baselines(folder, step_deg, options, &progress.watch())
        .with_context(|| folder.display().to_string())?;
    print(&comparison);
    Ok(())
}

/// The table on standard output.
fn print(comparison: &BaselineTable) {
    outln!(
        "{:<14} {:>11} {:>10}  {:<32}  {:<32}",
        "way",
        "numbers",
        "seconds",
        "against dense: int, graz, cos, ΔE",
        "against truth"
    );
    for row in &comparison.rows {
        let text = |figures: &Option<Figures>| match figures {
            None => "–".to_owned(),
            Some(figures) => {
                let log = |stratum| figures.stratum(stratum).map_or(f64::NAN, |row| row.log_rms);
                let cosine = figures.stratum(Stratum::All);
                let sphere = match row.is_partial {
                    true => "    –".to_owned(),
                    false => format!("{:>5.2}", figures.sphere_delta_e),
                };
                format!(
                    "{:.4} {:.4} {:>6.2}% {sphere}",
                    log(Stratum::Interior),
                    log(Stratum::Grazing),
                    100.0 * cosine.map_or(f64::NAN, |row| row.cos_error_mean)
                )
            }
        };
        outln!(
            "{:<14} {:>11} {:>10.1}  {:<32}  {:<32}",
            row.name,
            row.numbers,
            row.seconds,
            text(&row.against_dense),
            text(&row.against_truth)
        );
    }
}
