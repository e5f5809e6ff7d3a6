//! Samples as an array in an `.npz`, numpy's archive of arrays.

use crate::FileError;
use crate::format::{ChannelsRead, Content, Format, SampleFormat};
use crate::npy::{self, NpyHeader};
use crate::npy_samples::{NotSamples, RowError, SampleArray};
use gonia_rig::{Remark, SampleValues};
use std::fs::File;
use std::io::{self, BufReader};
use std::path::Path;
use zip::ZipArchive;
use zip::result::ZipError;

/// NumPy's archive of arrays, stored or deflated.
pub(super) static FORMAT: Format = Format {
    name: "NumPy archive",
    endings: &["npz"],
    magic: b"PK\x03\x04",
    content: Content::Samples(SampleFormat {
        read,
        write: None,
        holds_notes: false,
    }),
};

/// The array that is taken where several could be: its name.
const SAMPLES: &str = "samples";

type Archive = ZipArchive<BufReader<File>>;

/// An array of the archive.
struct Member {
    name: String,
    index: usize,
    shape: String,
    array: Result<SampleArray, NotSamples>,
}

fn read(path: &Path) -> Result<ChannelsRead, FileError> {
    let file = File::open(path).map_err(|error| FileError::reading(path, &error))?;
    let mut archive = ZipArchive::new(BufReader::new(file)).map_err(|e| wrong_zip(path, e))?;
    let mut members = Vec::new();
    for index in 0..archive.len() {
        members.extend(member(path, &mut archive, index)?);
    }
    let mut remarks = Vec::new();
    let n_arrays = members.len();
    let Member {
        name, index, array, ..
    } = chosen(path, members)?;
    if n_arrays > 1 && name != SAMPLES {
        remarks.push(Remark::new(
            path.display(),
            format_args!("of its {n_arrays} arrays only {name} can be samples, and was taken"),
            format_args!("name the samples' array {SAMPLES}"),
        ));
    }
    let array = array.map_err(|not| not.of(path))?;
    remarks.extend(array.remarks(path));
    let samples = samples_of(path, &mut archive, index, &name, &array)?;
    Ok(ChannelsRead {
        remarks,
        ..samples.into()
    })
}

/// The array at a place of the archive; none where something else stands there.
fn member(path: &Path, archive: &mut Archive, index: usize) -> Result<Option<Member>, FileError> {
    let mut file = archive.by_index(index).map_err(|e| wrong_zip(path, e))?;
    let name = file.name().map_err(|e| wrong_zip(path, e))?.into_owned();
    let Some(name) = name.strip_suffix(".npy").map(str::to_owned) else {
        return Ok(None);
    };
    let header = NpyHeader::read(&mut file)
        .map_err(|error| npy::wrong_header(path, &error).at(format_args!("array {name}")))?;
    Ok(Some(Member {
        name,
        index,
        shape: npy::shape_text(&header.shape),
        array: SampleArray::new(&header),
    }))
}

/// The only array, the one named samples, or the only one that can be samples.
fn chosen(path: &Path, mut members: Vec<Member>) -> Result<Member, FileError> {
    if members.len() > 1 {
        let is_named = members.iter().any(|member| member.name == SAMPLES);
        let mut list = Vec::new();
        for member in &members {
            list.push(format!("{} ({})", member.name, member.shape));
        }
        members.retain(|member| {
            if is_named {
                member.name == SAMPLES
            } else {
                member.array.is_ok()
            }
        });
        if members.len() != 1 {
            let what = if members.is_empty() {
                "none of its arrays can be samples"
            } else {
                "several of its arrays may be the samples"
            };
            return Err(FileError::new(
                path,
                format_args!("{what}: {}", list.join(", ")),
                format_args!("name the one of N × 7 or N × 8 {SAMPLES}, or save it as .npy"),
            ));
        }
    }
    members.pop().ok_or_else(|| {
        FileError::new(
            path,
            "is a zip archive that holds no array",
            "save the samples with numpy.savez, or a spreadsheet as CSV",
        )
    })
}

fn samples_of(
    path: &Path,
    archive: &mut Archive,
    index: usize,
    name: &str,
    array: &SampleArray,
) -> Result<SampleValues, FileError> {
    let mut file = archive.by_index(index).map_err(|e| wrong_zip(path, e))?;
    let size = file.size();
    let damaged = |error: io::Error| match error.kind() {
        io::ErrorKind::UnexpectedEof
        | io::ErrorKind::InvalidData
        | io::ErrorKind::InvalidInput
        | io::ErrorKind::Other => FileError::new(
            path,
            format_args!("its array {name} is damaged ({error})"),
            "copy or make the file again",
        ),
        _ => FileError::reading(path, &error),
    };
    let header = NpyHeader::read(&mut file).map_err(damaged)?;
    if !header.fits(array.element_bytes(), size) {
        return Err(npy::cut_short(path, &header.shape).at(format_args!("array {name}")));
    }
    // The archive may claim any size: memory is asked for as the elements come.
    let mut data = BufReader::with_capacity(1 << 18, file);
    let samples = array.read(&mut data, false).map_err(|error| match error {
        RowError::Bad { row, bad } => FileError::new(path, bad.problem, bad.remedy)
            .at(format_args!("array {name}, row {row}")),
        RowError::Io(error) => damaged(error),
    })?;
    // The checksum is compared at the end.
    io::copy(&mut data, &mut io::sink()).map_err(damaged)?;
    Ok(samples)
}

fn wrong_zip(path: &Path, error: ZipError) -> FileError {
    match error {
        ZipError::Io(error) => FileError::reading(path, &error),
        other => FileError::new(
            path,
            format_args!("is no archive that can be read ({other})"),
            "save it with numpy.savez or numpy.savez_compressed",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::read_samples;
    use crate::samples_npy::tests::{header, nine, npy};
    use std::io::Write;
    use zip::write::SimpleFileOptions;
    use zip::{CompressionMethod, ZipWriter};

    fn array(shape: &str, n: usize) -> Vec<u8> {
        npy(1, &header("<f4", false, shape), &vec![0; 4 * n])
    }

    fn samples() -> Vec<u8> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.npy");
        crate::samples::write_samples(&path, &nine()).unwrap();
        std::fs::read(path).unwrap()
    }

    fn npz(members: &[(&str, &[u8])], method: CompressionMethod) -> Vec<u8> {
        let mut bytes = io::Cursor::new(Vec::new());
        let mut zip = ZipWriter::new(&mut bytes);
        for (name, content) in members {
            let options = SimpleFileOptions::default()
                .compression_method(method)
                .large_file(true);
            zip.start_file(*name, options).unwrap();
            zip.write_all(content).unwrap();
        }
        zip.finish().unwrap();
        bytes.into_inner()
    }

    fn read_bytes(bytes: &[u8]) -> Result<crate::samples::SamplesRead, String> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.npz");
        std::fs::write(&path, bytes).unwrap();
        read_samples(&path).map_err(|error| {
            let error = error.to_string();
            assert_eq!(error.lines().count(), 1, "{error}");
            error
        })
    }

    #[test]
    fn the_one_array_or_the_one_named_samples_is_read() {
        let samples = samples();
        let (other, grid) = (array("(9, 7)", 63), array("(81, 2)", 162));
        for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
            let read = read_bytes(&npz(&[("arr_0.npy", &samples)], method)).unwrap();
            assert_eq!((&read.samples, read.remarks.len()), (&nine(), 0));
            let members: [(&str, &[u8]); 3] = [
                ("a.npy", &other),
                ("samples.npy", &samples),
                ("b.txt", b"x"),
            ];
            let read = read_bytes(&npz(&members, method)).unwrap();
            assert_eq!((&read.samples, read.remarks.len()), (&nine(), 0));
            let members: [(&str, &[u8]); 2] = [("views.npy", &grid), ("data.npy", &samples)];
            let read = read_bytes(&npz(&members, method)).unwrap();
            assert_eq!(read.samples, nine());
            let said = read.remarks[0].to_string();
            assert!(
                said.contains("of its 2 arrays only data can be samples, and was taken; name"),
                "{said}"
            );
        }
    }

    #[test]
    fn what_may_be_several_or_none_is_refused_with_the_list() {
        let stored = |members: &[(&str, &[u8])]| npz(members, CompressionMethod::Stored);
        let (a, b, grid) = (samples(), array("(5, 9)", 45), array("(81, 2)", 162));
        for (file, said) in [
            (
                stored(&[("a.npy", &a), ("b.npy", &b)]),
                "several of its arrays may be the samples: a (9 × 8), b (5 × 9); name",
            ),
            (
                stored(&[("a.npy", &grid), ("c.npy", &grid)]),
                "none of its arrays can be samples: a (81 × 2), c (81 × 2); name",
            ),
            (
                stored(&[("a.npy", &grid)]),
                "has the shape 81 × 2; save N × 7",
            ),
            (
                stored(&[("xl/sheet1.xml", b"x")]),
                "is a zip archive that holds no array",
            ),
            (stored(&[("a.npy", b"x")]), "array a: is not a .npy file"),
            (
                stored(&[("a.npy", &a[..300])]),
                "array a: is cut short: its header promises 9 × 8",
            ),
            (
                stored(&[("a.npy", &array("(99999999999, 8)", 8))]),
                "array a: is cut short",
            ),
        ] {
            let error = read_bytes(&file).unwrap_err();
            assert!(error.contains(said), "{error}");
        }
    }

    #[test]
    fn a_damaged_archive_is_refused_wherever_it_is_damaged() {
        for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
            let good = npz(&[("arr_0.npy", &samples())], method);
            for keep in 4..good.len() {
                assert!(
                    read_bytes(&good[..keep]).is_err(),
                    "{keep} of {}",
                    good.len()
                );
            }
            let mut changed = 0;
            for at in 4..good.len() {
                let mut bytes = good.clone();
                bytes[at] ^= 0x10;
                // A byte that does not count may change; a number may not.
                if let Ok(read) = read_bytes(&bytes) {
                    assert_eq!(read.samples, nine(), "{at}");
                    changed += 1;
                }
            }
            assert!(changed < good.len() / 2);
        }
    }
}
