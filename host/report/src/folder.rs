//! The report of a folder that a run left behind.

use crate::figures::write_figures;
use crate::files::{DENSE, ERRORS, MEASURED, REPORT, RIG, RIVALS, RIVALS_FIGURE, SUMMARY, TRUTH};
use crate::html::write_report;
use crate::input::ReportInput;
use crate::uncertainty::{ErrorBars, ShownBand};
use gonia_brdf::{Brdf, Grid};
use gonia_formats::baselines_toml::BaselineTable;
use gonia_formats::cell_mask::read_mask;
use gonia_formats::dense::{ERRORS_OF, read_dense_channels};
use gonia_formats::fit_toml::FitNote;
use gonia_formats::rig_toml::read_rig;
use gonia_formats::{FileError, Summary, checksum};
use gonia_pipeline::{Options, Side, Table, colours_of, compare};
use gonia_render::Tabulated;
use gonia_rig::{Channels, DenseChannels, DenseFile, Remark};
use std::path::{Path, PathBuf};

/// What became of a folder's report.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// The paths of what was written, the report first.
    pub written: Vec<PathBuf>,
    /// What is in the folder and is not shown, because it was said of another dense BRDF.
    pub remarks: Vec<Remark>,
}

/// Draws `report.html` from what is in a folder: `dense.exr`, and where they are there and of that
/// dense BRDF `summary.toml`, `measured.npy`, `truth.exr`, `error.exr`, `rig.toml`, `rivals.toml`, fits
/// (`*.fit.toml`) and charts (`*.svg`); and the paper's figures into a second folder, if one is given.
/// Bands are drawn, and compared with the truth, as colours: by the CIE 1931 standard observer under D65.
///
/// # Errors
/// One line naming the file: no dense BRDF, a file that cannot be used, a truth of another grid, or
/// the report cannot be written.
pub fn report_folder(folder: &Path, figures: Option<&Path>) -> Result<Drawn, FileError> {
    let path = folder.join(DENSE);
    let file = read_dense_channels(&path)?;
    let (grid, band) = (file.grid, ShownBand::of(&file));
    let mut owner = Owner::of(&file);
    let mut bands = said_of_bands(&file.channels, band.as_ref());
    let (file, said) = colours(file, &path)?;
    bands.extend(said.iter().map(Remark::to_string));
    let rig = optional(&folder.join(RIG), read_rig)?;
    let truth = table_beside(folder, TRUTH, grid)?;
    let errors = errors_beside(folder, grid, band.as_ref(), &mut owner)?;
    let baselines = optional(&folder.join(RIVALS), BaselineTable::read)?;
    let baselines = baselines
        .filter(|table| owner.keeps(&folder.join(RIVALS), table.dense.as_ref(), "gonia rivals"));
    let mut fits = Vec::new();
    for (path, fit) in FitNote::read_all(folder)? {
        if owner.keeps(&path, fit.dense.as_ref(), "gonia fit") {
            fits.push(fit);
        }
    }
    let mut charts = charts_of(folder);
    charts.retain(|(name, _)| name != RIVALS_FIGURE || baselines.is_some());
    let mask = optional(&folder.join(MEASURED), |path| read_mask(path, grid))?;
    let read = optional(&folder.join(SUMMARY), Summary::read)?;
    let (mut summary, is_its_own) = summary_of(folder, read, &file, &mut owner);
    let measured = mask.filter(|mask| {
        let counted = summary.bins.as_ref().map(|bins| bins.filled);
        is_its_own && counted.is_none_or(|filled| filled == mask.count() as u64)
            || owner.drops(&folder.join(MEASURED), "gonia demo")
    });
    if let (None, Some(truth)) = (&summary.figures, &truth) {
        let anew = compare(
            Table::from(&file),
            Side::Table(Table::from(truth)),
            &Options::default(),
        );
        summary.figures = anew
            .map_err(|error| owner.say(&folder.join(TRUTH), error))
            .ok();
    }
    let truth = truth.as_ref().map(|truth| Tabulated::new(&truth.brdf));
    let report = folder.join(REPORT);
    let input = ReportInput {
        bands: &bands,
        truth: truth.as_ref().map(|truth| truth as &dyn Brdf),
        measured: measured.as_ref(),
        errors: errors.as_ref(),
        rig: rig.as_ref(),
        fits: &fits,
        baselines: baselines.as_ref(),
        charts: &charts,
        remarks: &owner.remarks,
        ..ReportInput::new(&summary, &file.brdf)
    };
    write_report(&report, &input)?;
    let mut written = vec![report];
    if let Some(figures) = figures {
        written.extend(write_figures(figures, &input)?);
    }
    Ok(Drawn {
        written,
        remarks: said.into_iter().chain(owner.remarks).collect(),
    })
}

/// A dense BRDF as colours, and what is to be said of that.
fn colours(file: DenseChannels, path: &Path) -> Result<(DenseFile, Vec<Remark>), FileError> {
    colours_of(file, path)
        .ok_or_else(|| FileError::new(path, "its planes differ in size", "make it again"))
}

/// What stands for bands in the report; nothing of colours.
fn said_of_bands(channels: &Channels, band: Option<&ShownBand>) -> Vec<String> {
    let said = |band: &ShownBand| {
        format!(
            "Measured were {channels}. They are shown, and compared with the truth, as colours: those of the CIE 1931 \
             standard observer under D65, in linear sRGB. Error bars are those of the band at {}nm, the nearest to 555nm.",
            band.wavelength
        )
    };
    band.map(said).into_iter().collect()
}

/// The summary of a folder as far as it is one of its dense BRDF, and whether it is.
fn summary_of(
    folder: &Path,
    read: Option<Summary>,
    file: &DenseFile,
    owner: &mut Owner,
) -> (Summary, bool) {
    let path = folder.join(SUMMARY);
    let is_other = |summary: &Summary| {
        summary.scale != file.scale
            || summary
                .dense
                .as_ref()
                .is_some_and(|of| *of != owner.checksum)
    };
    match read {
        Some(summary) if is_other(&summary) => {
            owner.drops(&path, "gonia demo");
        }
        Some(mut summary) => {
            // An older summary does not say of which values its figures are.
            let says_nothing =
                summary.figures.is_none() && summary.bins.is_none() && summary.cells.is_none();
            if summary.dense.is_none() && !says_nothing {
                owner.keeps(&path, None, "gonia demo");
                summary.figures = None;
                summary.bins = None;
                summary.cells = None;
            }
            return (summary, true);
        }
        None => {}
    }
    let is_alone = !path.exists();
    let name = folder.canonicalize().ok();
    let name = name
        .as_deref()
        .and_then(Path::file_name)
        .map(|name| name.to_string_lossy());
    let mut summary = Summary::new(name.unwrap_or("A BRDF".into()), file.scale);
    summary.provenance.clone_from(&file.provenance);
    (summary, is_alone)
}

/// The dense BRDF that files beside it must have been made of.
struct Owner {
    checksum: String,
    remarks: Vec<Remark>,
}

impl Owner {
    fn of(file: &DenseChannels) -> Self {
        Self {
            checksum: checksum::of_channels(file),
            remarks: Vec::new(),
        }
    }

    /// Whether a file was made of this dense BRDF; if not, that is said.
    fn keeps(&mut self, path: &Path, of: Option<&String>, remedy: &str) -> bool {
        match of {
            Some(of) if *of == self.checksum => true,
            Some(_) => self.drops(path, remedy),
            None => {
                self.remarks.push(Remark::new(
                    path.display(),
                    format_args!("does not say of which {DENSE} it is, and is not shown"),
                    format_args!("make it again ({remedy})"),
                ));
                false
            }
        }
    }

    /// Says that a file is another dense BRDF's. Always `false`.
    fn drops(&mut self, path: &Path, remedy: &str) -> bool {
        self.remarks.push(Remark::new(
            path.display(),
            format_args!("was made of another {DENSE}, and is not shown"),
            format_args!("make it again ({remedy}), or restore the one that it was made of"),
        ));
        false
    }

    fn say(&mut self, path: &Path, error: impl std::fmt::Display) {
        let what = format!("cannot be compared with {DENSE} ({error})");
        self.remarks.push(Remark::new(
            path.display(),
            what,
            "check that it is the truth",
        ));
    }
}

/// What is in a file, where it is there.
fn optional<T>(
    path: &Path,
    read: impl FnOnce(&Path) -> Result<T, FileError>,
) -> Result<Option<T>, FileError> {
    path.exists().then(|| read(path)).transpose()
}

/// A table beside the dense BRDF, of the same grid; `None` where it is not there.
fn table_beside(folder: &Path, name: &str, grid: Grid) -> Result<Option<DenseFile>, FileError> {
    let path = folder.join(name);
    let Some(file) = optional(&path, read_dense_channels)? else {
        return Ok(None);
    };
    is_of_grid(&path, file.grid, grid)?;
    Ok(Some(colours(file, &path)?.0))
}

fn is_of_grid(path: &Path, found: Grid, wanted: Grid) -> Result<(), FileError> {
    if found == wanted {
        return Ok(());
    }
    Err(FileError::new(
        path,
        format_args!("is of another grid than {DENSE}"),
        "remove it, or make it again with the same steps",
    ))
}

/// The standard errors beside the dense BRDF, if they are its own.
fn errors_beside(
    folder: &Path,
    grid: Grid,
    band: Option<&ShownBand>,
    owner: &mut Owner,
) -> Result<Option<ErrorBars>, FileError> {
    let path = folder.join(ERRORS);
    let Some(bars) = optional(&path, |path| ErrorBars::read(path, band))? else {
        return Ok(None);
    };
    let Some(bars) = bars else {
        owner.drops(&path, "gonia fill --error");
        return Ok(None);
    };
    is_of_grid(&path, bars.errors.grid(), grid)?;
    Ok(Some(bars).filter(|bars| {
        let of = bars.provenance.get(ERRORS_OF);
        owner.keeps(&path, of, "gonia fill --error")
    }))
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
    use gonia_brdf::DenseBrdf;
    use gonia_formats::cell_mask::write_mask;
    use gonia_formats::dense::{write_dense, write_dense_channels};
    use gonia_rig::{CellMask, Scale};

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
        let text = std::fs::read_to_string(&report.written[0]).unwrap();
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
        let drawn = report_folder(dir.path(), None).unwrap();
        assert_eq!(drawn.remarks, []);
        let text = std::fs::read_to_string(&drawn.written[0]).unwrap();
        assert!(text.contains("<h1>silk</h1>") && text.contains("Measured against true"));
        assert!(text.contains("Measured bins"));

        write_dense(&dir.path().join(TRUTH), flat(15.0, 0.31)).unwrap();
        let error = report_folder(dir.path(), None).unwrap_err().to_string();
        assert!(error.contains("truth.exr: is of another grid"), "{error}");
    }

    /// Five bands that are brighter at longer wavelengths, `times` as bright as that.
    fn bands(times: f32, wavelengths: &[f64]) -> DenseChannels {
        let grid = Grid::with_step_deg(30.0).unwrap();
        let of = |nm: &f64| vec![times * (*nm / 1000.0) as f32; grid.n_cells()];
        DenseChannels {
            channels: Channels::bands(wavelengths).unwrap().0,
            grid,
            planes: wavelengths.iter().map(of).collect(),
            scale: Scale::Absolute,
            provenance: [("seed".into(), "7".into())].into(),
        }
    }

    #[test]
    fn bands_are_shown_as_colours_and_their_errors_at_the_most_visible() {
        const FIVE: [f64; 5] = [400.0, 475.0, 550.0, 625.0, 700.0];
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        let dense = bands(0.4, &FIVE);
        write_dense_channels(&path(DENSE), &dense).unwrap();
        write_dense_channels(&path(TRUTH), &bands(0.41, &FIVE)).unwrap();
        let mut errors = bands(0.01, &FIVE);
        let of = checksum::of_channels(&dense);
        errors.provenance.insert(ERRORS_OF.into(), of.clone());
        write_dense_channels(&path(ERRORS), &errors).unwrap();
        let drawn = report_folder(dir.path(), None).unwrap();
        assert_eq!(drawn.remarks, []);
        let text = std::fs::read_to_string(&drawn.written[0]).unwrap();
        for said in [
            "Measured were 5 bands from 400nm to 700nm",
            "the CIE 1931 standard observer under D65",
            "as a share of the value, at 550nm",
            "Measured against true",
        ] {
            assert!(text.contains(said), "{said}");
        }

        // Of other bands, as of colours, they are another's.
        let mut others = bands(0.01, &FIVE[..2]);
        others.provenance.insert(ERRORS_OF.into(), of);
        write_dense_channels(&path(ERRORS), &others).unwrap();
        let drawn = report_folder(dir.path(), None).unwrap();
        let said = drawn.remarks[0].to_string();
        assert!(said.contains("was made of another dense.exr"), "{said}");
        let text = std::fs::read_to_string(&drawn.written[0]).unwrap();
        assert!(!text.contains("as a share of the value"));
    }
}
