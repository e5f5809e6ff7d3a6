//! Dense BRDFs as files, in any format that is known: the one door for reading and writing them.
//!
//! A file is recognised by its first bytes, else by its ending; a name to write to by its ending.

pub use crate::format::SeenRow;
use crate::format::{CellReader, Content, DenseFormat, DenseWriter, Format};
use crate::{FileError, table};
use gonia_brdf::interpolate::{ByRows, ErrorBars};
use gonia_brdf::progress::Progress;
use gonia_brdf::{DenseBrdf, Direction, Grid};
use gonia_rig::{DenseFile, Scale};
use std::collections::BTreeMap;
use std::path::Path;

/// Name of the fact in the provenance of error bars that holds the checksum of the dense BRDF that they
/// belong to ([`checksum::of_brdf`](crate::checksum::of_brdf)).
pub const ERRORS_OF: &str = "dense";

/// Reads a dense BRDF, gonia's or anybody's of a grid's size.
///
/// # Errors
/// One line naming the file, and the cell where there is one: of no known format, cut short, of no
/// grid's size, or with values that are NaN or infinite.
pub fn read_dense(path: &Path) -> Result<DenseFile, FileError> {
    (format_of_file(path)?.read)(path)
}

/// Writes a dense BRDF whole, in the format of the name's ending (OpenEXR where it has none that is
/// known), and gives it back: the planes move into the writer, so that the peak of memory is one
/// image.
///
/// # Errors
/// As [`check_dense_name`]; when the file cannot be written; or when the format cannot hold a name
/// of the provenance.
pub fn write_dense(path: &Path, file: DenseFile) -> Result<DenseFile, FileError> {
    (writer_of_name(path)?.whole)(path, file)
}

/// Writes a dense BRDF whole that does not fit memory, row by row as they are made. `seen` gets each row too
/// (its number and the three channels' values), in no order and from several threads; `progress` the share
/// that is done, 0 ..= 1.
///
/// # Errors
/// As [`write_dense`].
pub fn write_dense_by_rows(
    path: &Path,
    grid: Grid,
    rows: &ByRows<'_>,
    scale: Scale,
    provenance: &BTreeMap<String, String>,
    seen: SeenRow<'_>,
    progress: &Progress<'_>,
) -> Result<(), FileError> {
    (writer_of_name(path)?.by_rows)(path, grid, rows, scale, provenance, seen, progress)
}

/// Writes the standard errors of a dense BRDF whole, in the unit of its values, with each cell's
/// origin (0 measured, 1 reciprocal, 2 interpolated, 3 extrapolated).
///
/// # Errors
/// As [`write_dense`].
pub fn write_error_bars(
    path: &Path,
    grid: Grid,
    bars: ErrorBars,
    scale: Scale,
    provenance: &BTreeMap<String, String>,
) -> Result<(), FileError> {
    (writer_of_name(path)?.error_bars)(path, grid, bars, scale, provenance)
}

/// Endings that people take for another kind of file than the one that would be written.
const OTHER_KINDS: [&str; 22] = [
    "png", "jpg", "jpeg", "tif", "tiff", "hdr", "bmp", "gif", "npz", "h5", "hdf5", "nc", "mat",
    "txt", "json", "toml", "xml", "html", "svg", "bsdf", "zip", "gz",
];

/// Whether a dense BRDF can be written under this name, before it is made.
///
/// # Errors
/// The ending is that of another kind of file.
pub fn check_dense_name(path: &Path) -> Result<(), FileError> {
    writer_of_name(path).map(|_| ())
}

/// The formats that are read, for messages: `OpenEXR (.exr)`.
pub fn dense_formats() -> String {
    let described = |format: &Format| format!("{} (.{})", format.name, format.endings.join(", ."));
    table::listed(table::formats(is_dense).map(described))
}

/// A dense BRDF of which a few values are wanted: only these are read where the file allows it.
pub struct DenseLookup {
    source: LookupSource,
}

enum LookupSource {
    InMemory(DenseBrdf),
    OnDisk(Box<dyn CellReader>),
}

impl DenseLookup {
    /// Opens a file, or reads it.
    ///
    /// # Errors
    /// As [`read_dense`].
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let format = format_of_file(path)?;
        let source = match (format.open)(path)? {
            Some(reader) => LookupSource::OnDisk(reader),
            None => LookupSource::InMemory((format.read)(path)?.brdf),
        };
        Ok(Self { source })
    }

    /// The grid.
    pub fn grid(&self) -> Grid {
        match &self.source {
            LookupSource::InMemory(brdf) => brdf.grid(),
            LookupSource::OnDisk(reader) => reader.grid(),
        }
    }

    /// The value (R, G, B) between the nodes: see [`Grid::lookup`].
    ///
    /// # Errors
    /// When the file cannot be read, or a value is NaN or infinite.
    pub fn lookup(&mut self, light: Direction, view: Direction) -> Result<[f32; 3], FileError> {
        match &self.source {
            LookupSource::InMemory(brdf) => Ok(brdf.lookup(light, view)),
            LookupSource::OnDisk(reader) => {
                let cell = |light, view| reader.cell(light, view);
                reader.grid().lookup(light, view, cell)
            }
        }
    }
}

fn is_dense(content: &Content) -> bool {
    matches!(content, Content::Dense(_))
}

fn format_of_file(path: &Path) -> Result<&'static DenseFormat, FileError> {
    let (problem, remedy) = match table::format_of_file(path)? {
        Some(format) => match &format.content {
            Content::Dense(dense) => return Ok(dense),
            Content::Samples(_) => (
                format!("holds samples ({}), not a dense BRDF", format.name),
                "make it dense first (gonia fill)".to_owned(),
            ),
            Content::Foreign(foreign) => (
                format!("is a {}, not on gonia's grid", foreign.name),
                "bring it there first (gonia import)".to_owned(),
            ),
        },
        None => (
            "is no known kind of dense BRDF".to_owned(),
            format!("give {}", dense_formats()),
        ),
    };
    Err(FileError::new(path, problem, remedy))
}

fn writer_of_name(path: &Path) -> Result<&'static DenseWriter, FileError> {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    let is_other = OTHER_KINDS.iter().any(|other| ending == *other);
    let named = table::format_of_name(path);
    let format = named.or_else(|| table::formats(is_dense).next());
    let writer = format.and_then(|format| match &format.content {
        Content::Dense(dense) if !is_other => dense.write.as_ref(),
        _ => None,
    });
    writer.ok_or_else(|| {
        FileError::new(
            path,
            "has the ending of another kind of file than a dense BRDF",
            format_args!("name it {}", table::endings(is_dense)),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::write_samples;

    #[test]
    fn files_of_another_kind_are_refused_with_what_to_do() {
        let dir = tempfile::tempdir().unwrap();
        let samples = dir.path().join("samples.npy");
        write_samples(&samples, &[]).unwrap();
        let renamed = dir.path().join("dense.exr");
        std::fs::copy(&samples, &renamed).unwrap();
        let foreign = dir.path().join("fabric.bin");
        std::fs::write(&foreign, "x").unwrap();
        let other = dir.path().join("dense.h5");
        std::fs::write(&other, "x").unwrap();
        for (path, said) in [
            (
                &samples,
                "holds samples (NumPy), not a dense BRDF; make it dense first (gonia fill)",
            ),
            (&renamed, "holds samples"),
            (
                &foreign,
                "is a UTIA .bin, not on gonia's grid; bring it there first (gonia import)",
            ),
            (
                &other,
                "is no known kind of dense BRDF; give OpenEXR (.exr)",
            ),
            (&dir.path().join("none"), "check the path"),
            (&dir.path().to_owned(), "name a file, not a folder"),
        ] {
            let error = read_dense(path).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
            assert_eq!(error.lines().count(), 1);
            assert!(DenseLookup::open(path).is_err());
        }
    }

    #[test]
    fn a_name_of_another_kind_is_refused_before_anything_is_made() {
        for name in ["dense.exr", "DENSE.EXR", "dense", "dense.out"] {
            assert_eq!(check_dense_name(Path::new(name)), Ok(()));
        }
        for name in ["a.npy", "a.PNG", "a.h5"] {
            let error = check_dense_name(Path::new(name)).unwrap_err().to_string();
            assert!(error.ends_with("name it .exr"), "{error}");
        }
    }
}
