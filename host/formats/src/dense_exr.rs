//! A dense BRDF as a square RGB float EXR: row = light direction, column = view direction, each
//! counted `n_phi·iθ + iφ` (7920 × 7920 for the paper's grid).

use crate::exr_planes::{ExrPlanes, Plane};
use crate::exr_rows::{RowReader, write_rows};
use crate::{FileError, exr_planes};
use gonia_brdf::interpolate::ByRows;
use gonia_brdf::progress::Progress;
use gonia_brdf::{DenseBrdf, Direction, Grid};
use gonia_rig::{DenseFile, Scale};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What gonia's own attributes begin with in the file.
const PREFIX: &str = "gonia.";
/// The attribute that holds the [`Scale`].
const SCALE: &str = "gonia.scale";

/// Writes a dense BRDF whole. The planes move into the writer and come back, so that the peak of
/// memory is one image.
///
/// # Errors
/// When the file cannot be written, or a name in the provenance is empty or not Latin.
pub fn write_dense(path: &Path, file: DenseFile) -> Result<DenseFile, FileError> {
    let DenseFile {
        brdf,
        scale,
        provenance,
    } = file;
    let grid = brdf.grid();
    let side = grid.n_directions();
    let attributes = attributes_of(scale, &provenance);
    let planes = brdf.into_planes().map(Plane::F32);
    let image = ExrPlanes {
        width: side,
        height: side,
        planes,
        extra: None,
        attributes,
    };
    let planes = exr_planes::write(path, image)?.map(Plane::into_f32);
    let brdf = rebuilt(path, grid, planes)?;
    Ok(DenseFile {
        brdf,
        scale,
        provenance,
    })
}

/// Writes a dense BRDF whole that does not fit memory, row by row as they are made.
///
/// # Errors
/// As [`write_dense`].
pub fn write_dense_by_rows(
    path: &Path,
    grid: Grid,
    rows: &ByRows<'_>,
    scale: Scale,
    provenance: &BTreeMap<String, String>,
    progress: &Progress<'_>,
) -> Result<(), FileError> {
    let attributes = attributes_of(scale, provenance);
    write_rows(path, grid.n_directions(), &attributes, |writer| {
        let cancelled = || std::io::Error::other("cancelled");
        rows.each_row(progress, &|light, row| writer.write(light, row), cancelled)
    })
}

/// A dense BRDF of which a few values are wanted: of a plain file only these are read.
pub enum DenseLookup {
    /// In memory.
    Whole(DenseBrdf),
    /// On the disk.
    #[doc(hidden)]
    OnDisk(OnDisk),
}

/// A plain file, open.
pub struct OnDisk {
    grid: Grid,
    reader: RowReader,
    path: PathBuf,
}

impl DenseLookup {
    /// Opens a file, or reads it.
    ///
    /// # Errors
    /// As [`read_dense`].
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let reader = RowReader::open(path)?;
        let on_disk = reader.and_then(|reader| {
            let grid = Grid::from_directions(reader.side())?;
            let path = path.to_owned();
            Some(OnDisk { grid, reader, path })
        });
        match on_disk {
            Some(on_disk) => Ok(Self::OnDisk(on_disk)),
            None => Ok(Self::Whole(read_dense(path)?.brdf)),
        }
    }

    /// The grid.
    pub fn grid(&self) -> Grid {
        match self {
            Self::Whole(brdf) => brdf.grid(),
            Self::OnDisk(file) => file.grid,
        }
    }

    /// See [`Grid::lookup`].
    ///
    /// # Errors
    /// When the file cannot be read, or a value is NaN or infinite.
    pub fn lookup(&mut self, light: Direction, view: Direction) -> Result<[f32; 3], FileError> {
        match self {
            Self::Whole(brdf) => Ok(brdf.lookup(light, view)),
            Self::OnDisk(OnDisk { grid, reader, path }) => {
                grid.lookup(light, view, |light, view| {
                    let value = reader
                        .value(light, view)
                        .map_err(|error| FileError::reading(path, &error))?;
                    for (channel, name) in ["R", "G", "B"].iter().enumerate() {
                        if !value[channel].is_finite() {
                            return Err(no_value(path, *grid, name, (light, view), value[channel]));
                        }
                    }
                    Ok(value)
                })
            }
        }
    }
}

/// The text attributes of a file of gonia's.
pub(super) fn attributes_of(
    scale: Scale,
    provenance: &BTreeMap<String, String>,
) -> BTreeMap<String, String> {
    let own = provenance
        .iter()
        .map(|(name, text)| (format!("{PREFIX}{name}"), text.clone()));
    own.chain([(SCALE.to_owned(), scale.to_string())]).collect()
}

fn rebuilt(path: &Path, grid: Grid, planes: [Vec<f32>; 3]) -> Result<DenseBrdf, FileError> {
    DenseBrdf::new(grid, planes)
        .ok_or_else(|| FileError::new(path, "its planes differ in size", "copy or make it again"))
}

/// Reads a dense BRDF, gonia's or anybody's square RGB EXR of a grid's size.
///
/// # Errors
/// One line naming the file, and the cell where there is one: not an EXR, cut short, not RGB, not
/// square or of no grid's size, or with values that are NaN or infinite.
pub fn read_dense(path: &Path) -> Result<DenseFile, FileError> {
    let (grid, planes, attributes) = match read_plain(path)? {
        Some(read) => read,
        None => read_any(path)?,
    };
    let scale = match attributes.get(SCALE).map(String::as_str) {
        Some("absolute") => Scale::Absolute,
        Some("relative") | None => Scale::Relative,
        Some(other) => {
            return Err(FileError::new(
                path,
                format_args!("\"{other}\" is no scale"),
                "write absolute or relative",
            )
            .at(format_args!("attribute {SCALE}")));
        }
    };
    let provenance = attributes
        .iter()
        .filter(|(name, _)| *name != SCALE)
        .filter_map(|(name, text)| Some((name.strip_prefix(PREFIX)?.to_owned(), text.clone())))
        .collect();
    let brdf = rebuilt(path, grid, planes)?;
    check_finite(path, &brdf)?;
    Ok(DenseFile {
        brdf,
        scale,
        provenance,
    })
}

/// The grid, the planes and the text attributes of a file.
type Content = (Grid, [Vec<f32>; 3], BTreeMap<String, String>);

/// A file as gonia writes it, by all threads; `None` when it is another kind, or damaged.
fn read_plain(path: &Path) -> Result<Option<Content>, FileError> {
    let Some(reader) = RowReader::open(path)? else {
        return Ok(None);
    };
    let Some(grid) = Grid::from_directions(reader.side()) else {
        return Ok(None);
    };
    let planes = reader
        .read_all()
        .map_err(|error| FileError::reading(path, &error))?;
    Ok(planes.map(|planes| (grid, planes, reader.attributes().clone())))
}

/// Any square RGB EXR of a grid's size.
fn read_any(path: &Path) -> Result<Content, FileError> {
    let no_grid = |width, height| {
        let size = format!("is {width} × {height} pixels, which no grid has");
        (
            size,
            "give a dense BRDF: 7920 × 7920 for steps of 2°".to_owned(),
        )
    };
    let image = exr_planes::read(path, |width, height| {
        let grid = Grid::from_directions(width).filter(|_| width == height);
        grid.map(|_| ()).ok_or_else(|| no_grid(width, height))
    })?;
    let grid = Grid::from_directions(image.width).ok_or_else(|| {
        let (problem, remedy) = no_grid(image.width, image.height);
        FileError::new(path, problem, remedy)
    })?;
    Ok((grid, image.planes.map(Plane::into_f32), image.attributes))
}

fn check_finite(path: &Path, brdf: &DenseBrdf) -> Result<(), FileError> {
    let grid = brdf.grid();
    let side = grid.n_directions();
    // A row at a time without a way out: several values are looked at at once.
    let is_whole = |row: &[f32]| row.iter().fold(true, |whole, v| whole & v.is_finite());
    for (plane, name) in brdf.planes().iter().zip(["R", "G", "B"]) {
        let rows = plane.par_chunks(side);
        let Some(light) = rows.position_first(|row| !is_whole(row)) else {
            continue;
        };
        let row = &plane[light * side..][..side];
        if let Some(view) = row.iter().position(|value| !value.is_finite()) {
            return Err(no_value(path, grid, name, (light, view), row[view]));
        }
    }
    Ok(())
}

fn no_value(
    path: &Path,
    grid: Grid,
    channel: &str,
    (light, view): (usize, usize),
    value: f32,
) -> FileError {
    let (i, v) = (grid.direction(light), grid.direction(view));
    FileError::new(
        path,
        format_args!("{value} is no BRDF value"),
        "fill the missing cells first (gonia fill)",
    )
    .at(format_args!(
        "channel {channel}, row {light}, column {view} (light {:.0}°/{:.0}°, view {:.0}°/{:.0}°)",
        i.theta_deg(),
        i.phi_deg(),
        v.theta_deg(),
        v.phi_deg()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::write_rgb_file;

    fn dense() -> DenseBrdf {
        let grid = Grid::with_step_deg(30.0).unwrap();
        let plane = |c: f32| (0..grid.n_cells()).map(|k| c + k as f32).collect();
        DenseBrdf::new(grid, [plane(0.0), plane(0.25), plane(0.5)]).unwrap()
    }

    #[test]
    fn a_dense_brdf_keeps_its_values_scale_and_provenance() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("dense.exr");
        let provenance = BTreeMap::from([("rig".into(), "simulated, seed 7".to_string())]);
        for scale in [Scale::Absolute, Scale::Relative] {
            let file = DenseFile {
                brdf: dense(),
                scale,
                provenance: provenance.clone(),
            };
            assert_eq!(write_dense(&path, file.clone()).unwrap(), file);
            assert_eq!(read_dense(&path).unwrap(), file);
        }
    }

    #[test]
    fn a_square_made_by_others_is_read_and_counts_as_relative() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("others.exr");
        let side = Grid::with_step_deg(30.0).unwrap().n_directions();
        write_rgb_file(&path, side, side, |x, y| (x as f32, y as f32, 1.0f32)).unwrap();
        let file = read_dense(&path).unwrap();
        assert_eq!((file.scale, file.provenance.len()), (Scale::Relative, 0));
        assert_eq!(file.brdf.at(3, 5), [5.0, 3.0, 1.0]);
    }

    #[test]
    fn sizes_of_no_grid_and_nan_are_refused_with_their_place() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("odd.exr");
        for (w, h) in [(36, 24), (35, 35)] {
            write_rgb_file(&path, w, h, |_, _| (1.0f32, 1.0f32, 1.0f32)).unwrap();
            let error = read_dense(&path).unwrap_err().to_string();
            assert!(
                error.contains(&format!("is {w} × {h} pixels, which no grid has")),
                "{error}"
            );
        }
        let side = Grid::with_step_deg(30.0).unwrap().n_directions();
        let value = |x, y| if (x, y) == (14, 25) { f32::NAN } else { 1.0 };
        write_rgb_file(&path, side, side, |x, y| (1.0f32, 1.0f32, value(x, y))).unwrap();
        let error = read_dense(&path).unwrap_err().to_string();
        assert!(
            error.contains("channel B, row 25, column 14 (light 60°/30°, view 30°/60°)"),
            "{error}"
        );
        assert_eq!(error.lines().count(), 1);
    }

    #[test]
    fn a_lookup_reads_only_what_it_needs_and_names_what_is_wrong_there() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("dense.exr");
        let mut planes = dense().into_planes();
        let grid = Grid::with_step_deg(30.0).unwrap();
        planes[2][grid.cell(25, 14)] = f32::NAN;
        let brdf = DenseBrdf::new(grid, planes).unwrap();
        let file = DenseFile {
            brdf: brdf.clone(),
            scale: Scale::Relative,
            provenance: BTreeMap::new(),
        };
        write_dense(&path, file).unwrap();
        let mut lookup = DenseLookup::open(&path).unwrap();
        assert_eq!(lookup.grid(), grid);
        let at = Direction::from_deg;
        for (light, view) in [
            (at(0.0, 0.0), at(30.0, 0.0)),
            (at(41.0, 250.0), at(17.0, 355.0)),
        ] {
            let looked_up = lookup.lookup(light, view).unwrap();
            assert_eq!(looked_up, brdf.lookup(light, view));
        }
        let error = lookup.lookup(at(60.0, 30.0), at(30.0, 60.0)).unwrap_err();
        assert_eq!(
            error.to_string(),
            read_dense(&path).unwrap_err().to_string()
        );
    }

    #[test]
    #[ignore = "a measurement: the paper's grid, 753 MB on disk and in memory"]
    fn the_papers_grid_is_written_and_read_in_seconds() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("dense.exr");
        let grid = Grid::PAPER;
        let planes = [1, 2, 3].map(|c| (0..grid.n_cells()).map(|k| (c * k) as f32).collect());
        let brdf = DenseBrdf::new(grid, planes).unwrap();
        let provenance = BTreeMap::new();
        let start = std::time::Instant::now();
        write_dense(
            &path,
            DenseFile {
                brdf,
                scale: Scale::Absolute,
                provenance,
            },
        )
        .unwrap();
        println!("write: {:?}", start.elapsed());
        let start = std::time::Instant::now();
        let file = read_dense(&path).unwrap();
        println!("read: {:?}", start.elapsed());
        assert_eq!(
            file.brdf.at(7919, 7919)[1],
            (2 * (grid.n_cells() - 1)) as f32
        );
    }
}
