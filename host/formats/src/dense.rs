//! Dense BRDFs as files, in any format that is known: the one door for reading and writing them.
//!
//! A file is recognised by its first bytes, else by its ending; a name to write to by its ending.

use crate::format::{CellReader, Content, DenseFormat, DenseWriter, Format};
pub use crate::format::{
    ChannelErrors, CombineErrors, ERROR_PARTS, ErrorRow, MakeRows, RowsNote, TakeRow,
};
use crate::{FileError, checksum, error_exr, table};
use gonia_brdf::{Direction, Grid};
use gonia_rig::{Channels, DenseChannels, DenseFile, Scale};
use std::collections::BTreeMap;
use std::path::Path;

/// Name of the fact in the provenance of error bars that holds the checksum of the dense BRDF that they
/// belong to ([`checksum::of_brdf`](crate::checksum::of_brdf)).
pub const ERRORS_OF: &str = "dense";

/// Reads a dense BRDF of colours, gonia's or anybody's of a grid's size; one value is a grey.
///
/// # Errors
/// One line naming the file, and the cell where there is one: of no known format, cut short, of no
/// grid's size, of bands, or with values that are NaN or infinite.
pub fn read_dense(path: &Path) -> Result<DenseFile, FileError> {
    let file = read_dense_channels(path)?;
    let channels = file.channels.clone();
    file.into_rgb().ok_or_else(|| {
        FileError::new(
            path,
            format_args!("has no R, G, B but {channels}"),
            "give one of colours or of one value: bands are for gonia query, compare, report, fit, render, photo and export",
        )
    })
}

/// Reads a dense BRDF of any channels: colours, one value (Y), or bands (380nm).
///
/// # Errors
/// As [`read_dense`], but for the channels.
pub fn read_dense_channels(path: &Path) -> Result<DenseChannels, FileError> {
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

/// Writes a dense BRDF of any channels whole: see [`write_dense`].
///
/// # Errors
/// As [`write_dense`].
pub fn write_dense_channels(path: &Path, file: &DenseChannels) -> Result<(), FileError> {
    (writer_of_name(path)?.channels)(path, file)
}

/// Writes a dense BRDF whole that does not fit memory, as it is made: `make` gives rows of light to a function, in
/// no order and from several threads, all channels of a row at once or some of them. Every channel of every row is
/// to be given.
///
/// # Errors
/// As [`write_dense`], and `make`'s own.
pub fn write_dense_by_rows(
    path: &Path,
    grid: Grid,
    note: &RowsNote<'_>,
    make: MakeRows<'_>,
) -> Result<(), FileError> {
    (writer_of_name(path)?.by_rows)(path, grid, note, make)
}

/// Writes the standard errors of a dense BRDF whole, in the unit of its values, with each cell's
/// origin (0 measured, 1 reciprocal, 2 interpolated, 3 extrapolated, 4 by symmetry). Where `combine` is given, they are combined
/// with what it knows, and the parts are written too, as shares.
///
/// # Errors
/// As [`write_dense`].
pub fn write_error_bars(
    path: &Path,
    grid: Grid,
    bars: ChannelErrors,
    combine: Option<&CombineErrors<'_>>,
    scale: Scale,
    provenance: &BTreeMap<String, String>,
) -> Result<(), FileError> {
    (writer_of_name(path)?.error_bars)(path, grid, bars, combine, scale, provenance)
}

/// Whether standard errors, of which a file says this, were written with some values: they are of their grid and channels, and
/// hold their checksum.
pub fn are_errors_of(
    (grid, channels, provenance): (Grid, &Channels, &BTreeMap<String, String>),
    values: &DenseChannels,
) -> bool {
    grid == values.grid
        && *channels == values.channels
        && provenance.get(ERRORS_OF) == Some(&checksum::of_channels(values))
}

/// The cells' origins of a file of standard errors ([`write_error_bars`]), in the grid's order; `None` where it holds
/// none.
///
/// # Errors
/// A file that cannot be read.
pub fn read_origins(path: &Path) -> Result<Option<Vec<u8>>, FileError> {
    error_exr::read_origins(path)
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
    InMemory(DenseChannels),
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
            None => LookupSource::InMemory((format.read)(path)?),
        };
        Ok(Self { source })
    }

    /// The grid.
    pub fn grid(&self) -> Grid {
        match &self.source {
            LookupSource::InMemory(brdf) => brdf.grid,
            LookupSource::OnDisk(reader) => reader.grid(),
        }
    }

    /// What the channels are.
    pub fn channels(&self) -> &Channels {
        match &self.source {
            LookupSource::InMemory(brdf) => &brdf.channels,
            LookupSource::OnDisk(reader) => reader.channels(),
        }
    }

    /// Whether the values are 1/sr.
    pub fn scale(&self) -> Scale {
        match &self.source {
            LookupSource::InMemory(brdf) => brdf.scale,
            LookupSource::OnDisk(reader) => reader.scale(),
        }
    }

    /// Where the data came from, by name.
    pub fn provenance(&self) -> &BTreeMap<String, String> {
        match &self.source {
            LookupSource::InMemory(brdf) => &brdf.provenance,
            LookupSource::OnDisk(reader) => reader.provenance(),
        }
    }

    /// The value of each channel between the nodes: see [`Grid::lookup`].
    ///
    /// # Errors
    /// When the file cannot be read, or a value is NaN or infinite.
    pub fn lookup(&mut self, light: Direction, view: Direction) -> Result<Vec<f32>, FileError> {
        match &self.source {
            LookupSource::InMemory(brdf) => Ok(brdf.lookup(light, view)),
            LookupSource::OnDisk(reader) => {
                let of_channel = |channel| {
                    let cell = |light, view| Ok([reader.cell(light, view, channel)?]);
                    let [value] = reader.grid().lookup(light, view, cell)?;
                    Ok(value)
                };
                (0..reader.channels().count()).map(of_channel).collect()
            }
        }
    }
}

fn is_written(content: &Content) -> bool {
    matches!(content, Content::Dense(dense) if dense.write.is_some())
}

/// Whether a file is a dense BRDF on gonia's grid, by its first bytes, else by its ending.
///
/// # Errors
/// Neither tells its format, and it cannot be read.
pub fn is_dense_file(path: &Path) -> Result<bool, FileError> {
    let format = table::format_of_file(path)?;
    Ok(format.is_some_and(|format| is_dense(&format.content)))
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
            format_args!("name it {}", table::endings(is_written)),
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

    fn channels(channels: Channels) -> DenseChannels {
        let grid = Grid::with_step_deg(30.0).unwrap();
        let plane = |c: usize| (0..grid.n_cells()).map(move |k| (1000 * c + k) as f32);
        DenseChannels {
            planes: (0..channels.count()).map(|c| plane(c).collect()).collect(),
            channels,
            grid,
            scale: Scale::Absolute,
            provenance: [("rig".to_owned(), "a test".to_owned())].into(),
        }
    }

    #[test]
    fn every_channel_comes_back_from_a_file_as_what_it_was() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("dense.exr");
        let bands: Vec<f64> = (0..31).map(|k| 380.0 + 30.0 * f64::from(k)).collect();
        for kind in [
            Channels::Single,
            Channels::Rgb,
            Channels::Bands(vec![532.0]),
            Channels::Bands(vec![900.0, 1000.0, 10_600.0]),
            Channels::Bands(bands),
        ] {
            let file = channels(kind.clone());
            write_dense_channels(&path, &file).unwrap();
            let read = read_dense_channels(&path).unwrap();
            assert_eq!(read, file);
            let size = std::fs::metadata(&path).unwrap().len();
            let values = 4 * (kind.count() * file.grid.n_cells()) as u64;
            assert!((values..values + 30_000).contains(&size), "{size}");
            let mut lookup = DenseLookup::open(&path).unwrap();
            assert_eq!(lookup.channels(), &kind);
            assert_eq!(lookup.scale(), Scale::Absolute);
            assert_eq!(lookup.provenance(), &file.provenance);
            let (light, view) = (
                Direction::from_deg(31.0, 5.0),
                Direction::from_deg(9.0, 77.0),
            );
            assert_eq!(
                lookup.lookup(light, view).unwrap(),
                file.lookup(light, view)
            );
            let as_colours = read_dense(&path);
            if kind == Channels::Rgb {
                assert_eq!(DenseChannels::from(as_colours.unwrap()), file);
            } else if kind == Channels::Single {
                let grey = as_colours.unwrap().brdf.into_planes();
                assert_eq!(grey, [(); 3].map(|()| file.planes[0].clone()));
            } else {
                let error = as_colours.unwrap_err().to_string();
                assert!(
                    error.contains(&format!("has no R, G, B but {kind}")),
                    "{error}"
                );
                assert_eq!(error.lines().count(), 1);
            }
        }
    }

    #[test]
    fn bands_of_other_programs_are_read_compressed_and_in_half_precision() {
        use exr::prelude::*;
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("others.exr");
        let side = gonia_brdf::Grid::with_step_deg(30.0)
            .unwrap()
            .n_directions();
        let plane = |value: f32| FlatSamples::F16(vec![f16::from_f32(value); side * side]);
        let list = [
            ("1000nm", 3.0),
            ("400nm", 1.0),
            ("500nm", 2.0),
            ("alpha", 9.0),
        ];
        let list = list.map(|(name, value)| AnyChannel::new(name, plane(value)));
        let layer = Layer::new(
            (side, side),
            LayerAttributes::default(),
            Encoding {
                compression: Compression::ZIP16,
                ..Encoding::UNCOMPRESSED
            },
            AnyChannels::sort(list.into_iter().collect()),
        );
        Image::from_layer(layer).write().to_file(&path).unwrap();
        let read = read_dense_channels(&path).unwrap();
        assert_eq!(read.channels.names(), ["400nm", "500nm", "1000nm"]);
        let firsts: Vec<f32> = read.planes.iter().map(|plane| plane[5]).collect();
        assert_eq!((firsts, read.scale), (vec![1.0, 2.0, 3.0], Scale::Relative));
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
