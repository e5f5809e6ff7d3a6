//! A dense BRDF as a square float EXR of R, G and B, of Y, or of bands (`380nm`): row = light direction, column = view direction, each
//! counted `n_phi·iθ + iφ` (7920 × 7920 for the paper's grid).

use crate::exr_planes::{ExrPlanes, PREFIX, Plane, SCALE};
use crate::exr_rows::{RowReader, write_rows};
use crate::format::{
    CellReader, Content, DenseFormat, DenseWriter, Format, MakeRows, RowsNote, TakeRow,
};
use crate::{FileError, error_exr, exr_planes};
use gonia_brdf::{DenseBrdf, Grid};
use gonia_rig::{Channels, DenseChannels, DenseFile, Scale};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// OpenEXR.
pub(super) static FORMAT: Format = Format {
    name: "OpenEXR",
    endings: &["exr"],
    magic: &[0x76, 0x2f, 0x31, 0x01],
    content: Content::Dense(DenseFormat {
        read,
        open,
        write: Some(DenseWriter {
            whole: write,
            channels: write_channels,
            by_rows: write_by_rows,
            error_bars: error_exr::write,
        }),
    }),
};

/// The planes move into the writer and come back. Fails too where a name in the provenance is empty
/// or not Latin.
fn write(path: &Path, file: DenseFile) -> Result<DenseFile, FileError> {
    let DenseFile {
        brdf,
        scale,
        provenance,
    } = file;
    let grid = brdf.grid();
    let side = grid.n_directions();
    let attributes = exr_planes::own_attributes(scale, &provenance);
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

/// Row by row: what is held in memory is one row beside the planes.
fn write_channels(path: &Path, file: &DenseChannels) -> Result<(), FileError> {
    let side = file.grid.n_directions();
    let channels: Vec<usize> = (0..file.channels.count()).collect();
    let mut make = |take: &TakeRow<'_>| {
        (0..side).try_for_each(|light| {
            let rows: Vec<&[f32]> = file
                .planes
                .iter()
                .filter_map(|plane| plane.get(light * side..(light + 1) * side))
                .collect();
            if rows.len() < channels.len() {
                return Err(std::io::Error::other("a plane is smaller than the grid"));
            }
            take(light, &channels, &rows)
        })
    };
    let note = RowsNote {
        channels: &file.channels,
        scale: file.scale,
        provenance: &file.provenance,
    };
    write_by_rows(path, file.grid, &note, &mut make)
}

fn write_by_rows(
    path: &Path,
    grid: Grid,
    note: &RowsNote<'_>,
    make: MakeRows<'_>,
) -> Result<(), FileError> {
    let attributes = exr_planes::own_attributes(note.scale, note.provenance);
    let (side, names) = (grid.n_directions(), note.channels.names());
    write_rows(path, side, &names, &attributes, |writer| {
        make(&|light, channels: &[usize], row: &[&[f32]]| writer.write(light, channels, row))
    })
}

/// A plain file, open.
struct OnDisk {
    grid: Grid,
    scale: Scale,
    provenance: BTreeMap<String, String>,
    reader: RowReader,
    path: PathBuf,
}

/// Of a file as gonia writes it single cells can be read.
fn open(path: &Path) -> Result<Option<Box<dyn CellReader>>, FileError> {
    let Some(reader) = RowReader::open(path)? else {
        return Ok(None);
    };
    let Some(grid) = Grid::from_directions(reader.side()) else {
        return Ok(None);
    };
    Ok(Some(Box::new(OnDisk {
        grid,
        scale: scale_of(path, reader.attributes())?,
        provenance: provenance_of(reader.attributes()),
        reader,
        path: path.to_owned(),
    })))
}

impl CellReader for OnDisk {
    fn grid(&self) -> Grid {
        self.grid
    }

    fn channels(&self) -> &Channels {
        self.reader.channels()
    }

    fn scale(&self) -> Scale {
        self.scale
    }

    fn provenance(&self) -> &BTreeMap<String, String> {
        &self.provenance
    }

    fn cell(&self, light: usize, view: usize, channel: usize) -> Result<f32, FileError> {
        let value = self
            .reader
            .value(light, view, channel)
            .map_err(|error| FileError::reading(&self.path, &error))?;
        if !value.is_finite() {
            let name = &self.channels().names()[channel];
            return Err(no_value(&self.path, self.grid, name, (light, view), value));
        }
        Ok(value)
    }
}

fn rebuilt(path: &Path, grid: Grid, planes: [Vec<f32>; 3]) -> Result<DenseBrdf, FileError> {
    DenseBrdf::new(grid, planes)
        .ok_or_else(|| FileError::new(path, "its planes differ in size", "copy or make it again"))
}

/// Reads gonia's or anybody's square EXR of a grid's size. One that does not say its scale counts as relative.
fn read(path: &Path) -> Result<DenseChannels, FileError> {
    let FileContent {
        grid,
        channels,
        planes,
        attributes,
    } = match read_plain(path)? {
        Some(read) => read,
        None => read_any(path)?,
    };
    let file = DenseChannels {
        channels,
        grid,
        planes,
        scale: scale_of(path, &attributes)?,
        provenance: provenance_of(&attributes),
    };
    check_finite(path, &file)?;
    Ok(file)
}

fn scale_of(path: &Path, attributes: &BTreeMap<String, String>) -> Result<Scale, FileError> {
    match attributes.get(SCALE).map(String::as_str) {
        Some("absolute") => Ok(Scale::Absolute),
        Some("relative") | None => Ok(Scale::Relative),
        Some(other) => Err(FileError::new(
            path,
            format_args!("\"{other}\" is no scale"),
            "write absolute or relative",
        )
        .at(format_args!("attribute {SCALE}"))),
    }
}

fn provenance_of(attributes: &BTreeMap<String, String>) -> BTreeMap<String, String> {
    attributes
        .iter()
        .filter(|(name, _)| *name != SCALE)
        .filter_map(|(name, text)| Some((name.strip_prefix(PREFIX)?.to_owned(), text.clone())))
        .collect()
}

/// What a file holds, with its text attributes.
struct FileContent {
    grid: Grid,
    channels: Channels,
    planes: Vec<Vec<f32>>,
    attributes: BTreeMap<String, String>,
}

/// A file as gonia writes it, by all threads; `None` when it is another kind, or damaged.
fn read_plain(path: &Path) -> Result<Option<FileContent>, FileError> {
    let Some(reader) = RowReader::open(path)? else {
        return Ok(None);
    };
    let Some(grid) = Grid::from_directions(reader.side()) else {
        return Ok(None);
    };
    let planes = reader
        .read_all()
        .map_err(|error| FileError::reading(path, &error))?;
    Ok(planes.map(|planes| FileContent {
        grid,
        channels: reader.channels().clone(),
        planes,
        attributes: reader.attributes().clone(),
    }))
}

/// Any square EXR of a grid's size.
fn read_any(path: &Path) -> Result<FileContent, FileError> {
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
    Ok(FileContent {
        grid,
        channels: image.channels,
        planes: image.planes.into_iter().map(Plane::into_f32).collect(),
        attributes: image.attributes,
    })
}

pub(super) fn check_finite(path: &Path, file: &DenseChannels) -> Result<(), FileError> {
    let grid = file.grid;
    let side = grid.n_directions();
    // A row at a time without a way out: several values are looked at at once.
    let is_whole = |row: &[f32]| row.iter().fold(true, |whole, v| whole & v.is_finite());
    for (plane, name) in file.planes.iter().zip(file.channels.names()) {
        let rows = plane.par_chunks(side);
        let Some(light) = rows.position_first(|row| !is_whole(row)) else {
            continue;
        };
        let row = &plane[light * side..][..side];
        if let Some(view) = row.iter().position(|value| !value.is_finite()) {
            return Err(no_value(path, grid, &name, (light, view), row[view]));
        }
    }
    Ok(())
}

/// Of a cell that has none.
pub(super) fn no_value(
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
    use crate::dense::{DenseLookup, read_dense, write_dense};
    use exr::prelude::write_rgb_file;
    use gonia_brdf::Direction;

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
    fn the_same_input_gives_the_same_bytes_and_other_readers_find_every_attribute() {
        let dir = tempfile::tempdir().unwrap();
        let [whole, by_planes] = ["a.exr", "b.exr"].map(|name| dir.path().join(name));
        let names = [
            "seed", "rig", "version", "plan", "imported", "symmetry", "fit",
        ];
        let provenance: BTreeMap<String, String> = names
            .iter()
            .map(|name| ((*name).to_owned(), format!("what {name} was")))
            .collect();
        let file = || DenseFile {
            brdf: dense(),
            scale: Scale::Absolute,
            provenance: provenance.clone(),
        };
        write_dense(&whole, file()).unwrap();
        let first = std::fs::read(&whole).unwrap();
        for _ in 0..20 {
            write_dense(&by_planes, file()).unwrap();
            assert!(std::fs::read(&by_planes).unwrap() == first);
        }
        let meta = exr::prelude::MetaData::read_from_file(&whole, true).unwrap();
        let read = exr_planes::text_attributes(&meta.headers[0]);
        assert_eq!(read["gonia.scale"], "absolute");
        assert_eq!(read.len(), names.len() + 1);
        let image = exr::prelude::read_first_rgba_layer_from_file(
            &whole,
            |size, _| vec![[0f32; 3]; size.area()],
            |pixels, at, (r, g, b, _): (f32, f32, f32, f32)| {
                let side = Grid::with_step_deg(30.0).unwrap().n_directions();
                pixels[at.y() * side + at.x()] = [r, g, b];
            },
        )
        .unwrap();
        let pixels = image.layer_data.channel_data.pixels;
        assert_eq!(
            pixels[25 * dense().grid().n_directions() + 14],
            dense().at(25, 14)
        );
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
