//! The report of a folder that a run left behind.

use crate::figures::write_figures;
use crate::files::{DENSE, ERRORS, MEASURED, REPORT, RIG, RIVALS, SUMMARY, TRUTH};
use crate::html::write_report;
use crate::input::ReportInput;
use gonia_brdf::{Brdf, DenseBrdf, Grid};
use gonia_formats::baselines_toml::BaselineTable;
use gonia_formats::cell_mask::read_mask;
use gonia_formats::dense::read_dense;
use gonia_formats::fit_toml::FitNote;
use gonia_formats::rig_toml::read_rig;
use gonia_formats::{FileError, Summary};
use gonia_render::Tabulated;
use std::path::{Path, PathBuf};

/// Draws `report.html` from what is in a folder: `dense.exr`, and where they are there
/// `summary.toml`, `measured.npy`, `truth.exr`, `error.exr`, `rig.toml`, `rivals.toml`, fits
/// (`*.fit.toml`) and charts (`*.svg`); and the paper's figures into a second folder, if one is given.
/// Returns the paths of what it wrote, the report first.
///
/// # Errors
/// One line naming the file: no dense BRDF, a file that cannot be used, a truth of another grid, or
/// the report cannot be written.
pub fn report_folder(folder: &Path, figures: Option<&Path>) -> Result<Vec<PathBuf>, FileError> {
    let file = read_dense(&folder.join(DENSE))?;
    let summary_path = folder.join(SUMMARY);
    let summary = if summary_path.exists() {
        Summary::read(&summary_path)?
    } else {
        let name = folder.canonicalize().ok();
        let name = name
            .as_deref()
            .and_then(Path::file_name)
            .map(|name| name.to_string_lossy());
        let mut summary = Summary::new(name.unwrap_or("A BRDF".into()), file.scale);
        summary.provenance = file.provenance;
        summary
    };
    let measured_path = folder.join(MEASURED);
    let measured = match measured_path.exists() {
        true => Some(read_mask(&measured_path, file.brdf.grid())?),
        false => None,
    };
    let grid = file.brdf.grid();
    let truth = table_beside(folder, TRUTH, grid)?;
    let errors = table_beside(folder, ERRORS, grid)?;
    let rig_path = folder.join(RIG);
    let rig = match rig_path.exists() {
        true => Some(read_rig(&rig_path)?),
        false => None,
    };
    let baselines_path = folder.join(RIVALS);
    let baselines = match baselines_path.exists() {
        true => Some(BaselineTable::read(&baselines_path)?),
        false => None,
    };
    let fits = FitNote::read_all(folder)?;
    let charts = charts_of(folder);
    let truth = truth.as_ref().map(Tabulated::new);
    let report = folder.join(REPORT);
    let input = ReportInput {
        truth: truth.as_ref().map(|truth| truth as &dyn Brdf),
        measured: measured.as_ref(),
        errors: errors.as_ref(),
        rig: rig.as_ref(),
        fits: &fits,
        baselines: baselines.as_ref(),
        charts: &charts,
        ..ReportInput::new(&summary, &file.brdf)
    };
    write_report(&report, &input)?;
    let mut written = vec![report];
    if let Some(figures) = figures {
        written.extend(write_figures(figures, &input)?);
    }
    Ok(written)
}

/// A table beside the dense BRDF, of the same grid; `None` where it is not there.
fn table_beside(folder: &Path, name: &str, grid: Grid) -> Result<Option<DenseBrdf>, FileError> {
    let path = folder.join(name);
    if !path.exists() {
        return Ok(None);
    }
    let brdf = read_dense(&path)?.brdf;
    if brdf.grid() != grid {
        return Err(FileError::new(
            &path,
            format_args!("is of another grid than {DENSE}"),
            "remove it, or make it again with the same steps",
        ));
    }
    Ok(Some(brdf))
}

/// The charts of a folder, by name.
fn charts_of(folder: &Path) -> Vec<(String, String)> {
    let mut charts: Vec<(String, String)> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|e| e == "svg"))
        .filter_map(|path| {
            let name = path.file_stem()?.to_string_lossy().into_owned();
            Some((name, std::fs::read_to_string(path).ok()?))
        })
        .collect();
    charts.sort();
    charts
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_formats::cell_mask::write_mask;
    use gonia_formats::dense::write_dense;
    use gonia_rig::{CellMask, DenseFile, Scale};

    fn flat(step_deg: f64, value: f32) -> DenseFile {
        let grid = Grid::with_step_deg(step_deg).unwrap();
        let brdf = DenseBrdf::new(grid, [0, 1, 2].map(|_| vec![value; grid.n_cells()])).unwrap();
        DenseFile {
            brdf,
            scale: Scale::Absolute,
            provenance: [("seed".into(), "7".into())].into(),
        }
    }

    #[test]
    fn a_folder_with_nothing_but_a_dense_brdf_has_a_report() {
        let dir = tempfile::tempdir().unwrap();
        let error = report_folder(dir.path(), None).unwrap_err().to_string();
        assert!(
            error.contains("dense.exr") && error.ends_with("check the path"),
            "{error}"
        );

        write_dense(&dir.path().join(DENSE), flat(30.0, 0.3)).unwrap();
        let report = report_folder(dir.path(), None).unwrap();
        let text = std::fs::read_to_string(&report[0]).unwrap();
        assert!(text.contains("values in 1/sr") && text.contains("seed"));
        assert!(!text.contains("Measured against true"));
    }

    #[test]
    fn truth_mask_and_summary_are_used_where_they_are() {
        let dir = tempfile::tempdir().unwrap();
        let dense = flat(30.0, 0.3);
        let grid = dense.brdf.grid();
        write_dense(&dir.path().join(DENSE), dense).unwrap();
        write_dense(&dir.path().join(TRUTH), flat(30.0, 0.31)).unwrap();
        write_mask(&dir.path().join(MEASURED), &CellMask::from_cells(grid, [5])).unwrap();
        Summary::new("silk", Scale::Absolute)
            .write(&dir.path().join(SUMMARY))
            .unwrap();
        let text = std::fs::read_to_string(&report_folder(dir.path(), None).unwrap()[0]).unwrap();
        assert!(text.contains("<h1>silk</h1>") && text.contains("Measured against true"));
        assert!(text.contains("Measured bins"));

        write_dense(&dir.path().join(TRUTH), flat(15.0, 0.31)).unwrap();
        let error = report_folder(dir.path(), None).unwrap_err().to_string();
        assert!(error.contains("truth.exr: is of another grid"), "{error}");
    }
}
