//! Samples as `.npy`.

use crate::FileError;
use crate::format::{ChannelsRead, Content, Format, SampleFormat, SampleNote, SampleWriter};
use crate::npy::{self, NpyFile};
use crate::npy_samples::{RowError, SampleArray};
use crate::sample_rows::{COLUMNS, LAST_FRAME_IN_SINGLE, frame_in_file, have_frames};
use gonia_brdf::Sample;
use gonia_rig::ChannelSamples;
use std::io::Write;
use std::path::Path;

/// Rows written at a time.
const ROWS: usize = 1 << 13;

/// NumPy's array file. Written: float32, N × 7 or N × 8, in C order; other channels than colours as records, whose
/// fields have the channels' names.
pub(super) static FORMAT: Format = Format {
    name: "NumPy",
    endings: &["npy"],
    magic: b"\x93NUMPY",
    content: Content::Samples(SampleFormat {
        read,
        write: Some(SampleWriter {
            rgb: write,
            channels: write_channels,
        }),
        holds_notes: false,
    }),
};

fn read(path: &Path) -> Result<ChannelsRead, FileError> {
    let NpyFile {
        header,
        len,
        mut data,
    } = NpyFile::open(path)?;
    let array = SampleArray::new(&header).map_err(|not| not.of(path))?;
    if !header.fits(array.element_bytes(), len) {
        return Err(npy::cut_short(path, &header.shape));
    }
    let samples = array.read(&mut data, true).map_err(|error| match error {
        RowError::Bad { row, bad } => {
            FileError::new(path, bad.problem, bad.remedy).at(format_args!("row {row}"))
        }
        RowError::Io(error) => FileError::reading(path, &error),
    })?;
    Ok(ChannelsRead {
        remarks: array.remarks(path),
        ..samples.into()
    })
}

fn write(path: &Path, samples: &[Sample], _: Option<&SampleNote>) -> Result<(), FileError> {
    let columns = if have_frames(samples) { 8 } else { 7 };
    // Beyond, float32 gives neighbouring frames one number.
    let is_double = samples
        .iter()
        .any(|s| s.frame != Sample::NO_FRAME && s.frame > LAST_FRAME_IN_SINGLE);
    let (dtype, size) = if is_double { ("<f8", 8) } else { ("<f4", 4) };
    npy::write(path, dtype, &[samples.len(), columns], |out| {
        let mut buffer = Vec::with_capacity(ROWS * columns * size);
        for chunk in samples.chunks(ROWS) {
            buffer.clear();
            for s in chunk {
                let [r, g, b] = s.rgb;
                let frame = frame_in_file(s.frame);
                let row = [
                    s.theta_i_deg,
                    s.phi_i_deg,
                    s.theta_v_deg,
                    s.phi_v_deg,
                    r,
                    g,
                    b,
                    frame as f32,
                ];
                if is_double {
                    for value in &row[..7] {
                        buffer.extend_from_slice(&f64::from(*value).to_le_bytes());
                    }
                    buffer.extend_from_slice(&frame.to_le_bytes());
                } else {
                    for value in &row[..columns] {
                        buffer.extend_from_slice(&value.to_le_bytes());
                    }
                }
            }
            out.write_all(&buffer)?;
        }
        Ok(())
    })
}

/// Records of float32, the frame an int64.
fn write_channels(
    path: &Path,
    samples: &ChannelSamples,
    _: Option<&SampleNote>,
) -> Result<(), FileError> {
    let with_frames = have_frames(&samples.places);
    let names = COLUMNS[..4].iter().copied().map(str::to_owned);
    let names = names.chain(samples.channels.names());
    let mut fields: Vec<String> = names.map(|name| format!("('{name}', '<f4')")).collect();
    if with_frames {
        fields.push("('frame', '<i8')".into());
    }
    let rows = samples.places.iter();
    let values = samples.values.chunks_exact(samples.channels.count());
    npy::write_records(
        path,
        &format!("[{}]", fields.join(", ")),
        samples.places.len(),
        |out| {
            let mut buffer = Vec::new();
            for (place, values) in rows.zip(values) {
                buffer.clear();
                let angles = [
                    place.theta_i_deg,
                    place.phi_i_deg,
                    place.theta_v_deg,
                    place.phi_v_deg,
                ];
                for value in angles.iter().chain(values) {
                    buffer.extend_from_slice(&value.to_le_bytes());
                }
                if with_frames {
                    let frame = frame_in_file(place.frame) as i64;
                    buffer.extend_from_slice(&frame.to_le_bytes());
                }
                out.write_all(&buffer)?;
            }
            Ok(())
        },
    )
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::sample_rows::tests::some_samples;
    use crate::samples::{read_samples, write_samples};
    use half::f16;

    /// A file of version 1 to 3 with this dictionary and these elements.
    pub fn npy(version: u8, header: &str, elements: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY".to_vec();
        bytes.extend([version, 0]);
        let len = header.len() + 1;
        match version {
            1 => bytes.extend((len as u16).to_le_bytes()),
            _ => bytes.extend((len as u32).to_le_bytes()),
        }
        bytes.extend(header.as_bytes());
        bytes.push(b'\n');
        bytes.extend(elements);
        bytes
    }

    /// The dictionary of an array of numbers.
    pub fn header(dtype: &str, fortran: bool, shape: &str) -> String {
        let fortran = if fortran { "True" } else { "False" };
        format!("{{'descr': '{dtype}', 'fortran_order': {fortran}, 'shape': {shape}, }}")
    }

    fn read_bytes(bytes: &[u8]) -> Result<(Vec<Sample>, Vec<String>), String> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.npy");
        std::fs::write(&path, bytes).unwrap();
        match read_samples(&path) {
            Ok(read) => Ok((
                read.samples,
                read.remarks.iter().map(ToString::to_string).collect(),
            )),
            Err(error) => {
                let error = error.to_string();
                assert_eq!(error.lines().count(), 1, "{error}");
                Err(error)
            }
        }
    }

    /// Nine samples whose numbers float16 holds too.
    pub fn nine() -> Vec<Sample> {
        let sample = |k: u8| Sample {
            theta_i_deg: 10.0 + f32::from(k),
            phi_i_deg: 20.0 * f32::from(k),
            theta_v_deg: 2.0 * f32::from(k),
            phi_v_deg: 7.0 * f32::from(k),
            rgb: [3.0, f32::from(k), 5.0],
            frame: if k == 4 {
                Sample::NO_FRAME
            } else {
                u32::from(k)
            },
        };
        (0..9).map(sample).collect()
    }

    fn numbers(samples: &[Sample], columns: usize) -> Vec<Vec<f64>> {
        let row = |s: &Sample| {
            let [r, g, b] = s.rgb.map(f64::from);
            let angles = [s.theta_i_deg, s.phi_i_deg, s.theta_v_deg, s.phi_v_deg].map(f64::from);
            let values = if columns < 7 { vec![r] } else { vec![r, g, b] };
            let frame = [frame_in_file(s.frame)];
            let row = angles.into_iter().chain(values).chain(frame);
            row.take(columns).collect()
        };
        samples.iter().map(row).collect()
    }

    fn transposed(rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let column = |c: usize| rows.iter().map(|row| row[c]).collect();
        (0..rows[0].len()).map(column).collect()
    }

    fn bytes(rows: &[Vec<f64>], dtype: &str) -> Vec<u8> {
        let number = |v: f64| {
            let mut bytes = match &dtype[1..] {
                "f2" => f16::from_f64(v).to_le_bytes().to_vec(),
                "f4" => (v as f32).to_le_bytes().to_vec(),
                "f8" => v.to_le_bytes().to_vec(),
                "i2" => (v as i16).to_le_bytes().to_vec(),
                "i8" => (v as i64).to_le_bytes().to_vec(),
                _ => (v as u8).to_le_bytes().to_vec(),
            };
            if dtype.starts_with('>') {
                bytes.reverse();
            }
            bytes
        };
        rows.iter().flatten().flat_map(|v| number(*v)).collect()
    }

    #[test]
    fn arrays_of_every_type_and_order_are_the_same_samples() {
        for dtype in ["<f4", ">f4", "<f8", ">f8", "<f2", ">f2", "<i2", ">i8"] {
            for columns in [7, 8] {
                for (fortran, first) in [(false, false), (true, false), (false, true), (true, true)]
                {
                    for version in 1..=3 {
                        let rows = numbers(&nine(), columns);
                        // Memory order: by rows, or by columns.
                        let elements = if fortran == first {
                            rows.clone()
                        } else {
                            transposed(&rows)
                        };
                        let shape = if first {
                            format!("({columns}, 9)")
                        } else {
                            format!("(9, {columns})")
                        };
                        let file = npy(
                            version,
                            &header(dtype, fortran, &shape),
                            &bytes(&elements, dtype),
                        );
                        let (samples, remarks) = read_bytes(&file).unwrap();
                        let mut expected = nine();
                        if columns == 7 {
                            expected.iter_mut().for_each(|s| s.frame = Sample::NO_FRAME);
                        }
                        assert_eq!(samples, expected, "{dtype} {shape} {fortran} {version}");
                        assert_eq!(
                            remarks.len(),
                            usize::from(dtype.ends_with("f2")),
                            "{remarks:?}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn one_channel_is_repeated() {
        for (columns, fortran) in [(5, false), (6, false), (5, true), (6, true)] {
            let rows = numbers(&nine(), columns);
            let elements = if fortran { transposed(&rows) } else { rows };
            let file = npy(
                1,
                &header("<f8", fortran, &format!("(9, {columns})")),
                &bytes(&elements, "<f8"),
            );
            let (samples, remarks) = read_bytes(&file).unwrap();
            assert_eq!((samples[8].rgb, samples[3].phi_v_deg), ([3.0; 3], 21.0));
            assert_eq!(
                samples[8].frame,
                if columns == 6 { 8 } else { Sample::NO_FRAME }
            );
            assert!(remarks.is_empty());
        }
    }

    #[test]
    fn records_are_read_by_the_names_of_their_fields() {
        let descr = "[('note', '<U2'), ('Theta_in', '<f4'), ('phi_in', '>f8'), ('', '|V3'), ('theta_out', '<f2'), ('phi_out_rad', '<f8'), ('frame', '<u4'), ('rgb', '<f4', (3,))]";
        let mut elements = Vec::new();
        for k in 0..3u8 {
            elements.extend([b'x'; 8]);
            elements.extend((10.0 + f32::from(k)).to_le_bytes());
            elements.extend(350.5f64.to_be_bytes());
            elements.extend([0xff; 3]);
            elements.extend(f16::from_f32(60.0).to_le_bytes());
            elements.extend((std::f64::consts::PI / 2.0).to_le_bytes());
            elements.extend((3_000_000_000 + u32::from(k)).to_le_bytes());
            for c in [0.1f32, 0.2, 0.3] {
                elements.extend(c.to_le_bytes());
            }
        }
        for shape in ["(3,)", "(3, 1)", "(1, 3)"] {
            let dictionary =
                format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}");
            let (samples, remarks) = read_bytes(&npy(3, &dictionary, &elements)).unwrap();
            let expected = Sample {
                theta_i_deg: 12.0,
                phi_i_deg: 350.5,
                theta_v_deg: 60.0,
                phi_v_deg: 90.0,
                rgb: [0.1, 0.2, 0.3],
                frame: 3_000_000_002,
            };
            assert_eq!(samples[2], expected);
            assert!(
                remarks[0].contains("phi_out_rad hold radians"),
                "{remarks:?}"
            );
            assert!(remarks[1].contains("float16"), "{remarks:?}");
        }
    }

    #[test]
    fn arrays_that_are_no_samples_are_refused_in_one_line() {
        let array = |dtype: &str, shape: &str| npy(1, &header(dtype, false, shape), &[0; 800]);
        let records = |descr: &str| {
            let dictionary =
                format!("{{'descr': {descr}, 'fortran_order': False, 'shape': (2,), }}");
            npy(1, &dictionary, &[0; 800])
        };
        for (file, said) in [
            (array("<c8", "(9, 7)"), "holds '<c8'; save N × 7 of float32"),
            (array("|O", "(9, 7)"), "holds '|O'"),
            (array("<f16", "(2, 7)"), "holds '<f16'"),
            (array("<f4", "(20, 4)"), "has the shape 20 × 4; save"),
            (array("<f4", "(2, 9, 7)"), "has the shape 2 × 9 × 7"),
            (array("<f4", "(63,)"), "has the shape 63; save"),
            (
                array("<f4", "(7, 5)"),
                "has the shape 7 × 5: either side may be the columns",
            ),
            (
                array("<f4", "(99, 8)"),
                "cut short: its header promises 99 × 8",
            ),
            (
                array("<f4", "(8, 99)"),
                "cut short: its header promises 8 × 99",
            ),
            (array("<f4", "(999999999999999, 8)"), "cut short"),
            (array("<f4", "(8, 18446744073709551615)"), "cut short"),
            (
                records("[('theta_i', '<f4'), ('phi_i', '<f4'), ('theta_v', '<f4'), ('r', '<f4')]"),
                "there is no column for phi_v, g, b; found: theta_i, phi_i, theta_v, r; name",
            ),
            (
                records(
                    "[('theta_i', '<f4'), ('phi_i', '<c8'), ('theta_v', '<f4'), ('phi_v', '<f4'), ('f', '<f4')]",
                ),
                "phi_i is no number but <c8",
            ),
            (
                records("[('theta_i', '<f4'), ('x', '|O')]"),
                "holds (('theta_i', '<f4'), ('x', '|O')); save",
            ),
            (records("[('theta_i', '<f4')"), "is not a .npy file"),
        ] {
            let error = read_bytes(&file).unwrap_err();
            assert!(error.contains(said), "{error}");
        }
        let good = npy(1, &header("<f4", false, "(9, 7)"), &[0; 252]);
        assert_eq!(read_bytes(&good).unwrap().0.len(), 9);
        for keep in [6, 9, 60] {
            let error = read_bytes(&good[..keep]).unwrap_err();
            assert!(error.contains("is not a .npy file"), "{keep}: {error}");
        }
    }

    #[test]
    fn frame_numbers_come_back_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.npy");
        let mut samples = nine();
        (samples[0].frame, samples[1].frame) = (16_777_216, 16_777_217);
        samples[2].frame = u32::MAX - 1;
        write_samples(&path, &samples).unwrap();
        assert_eq!(read_samples(&path).unwrap().samples, samples);
        for (dtype, frame, said) in [
            (
                "<f4",
                16_777_216.0,
                "row 8: frame 16777216 cannot be told from its neighbours: numbers of this type are whole up to 16777215; save float64",
            ),
            (
                "<f4",
                4_294_967_296.0,
                "row 8: frame 4294967296 is no number of a frame",
            ),
            (
                "<f8",
                4_294_967_295.0,
                "row 8: frame 4294967295 is no number of a frame",
            ),
            (
                "<i8",
                4_294_967_295.0,
                "row 8: frame 4294967295 is no number of a frame",
            ),
            (
                "<f2",
                2048.0,
                "row 8: frame 2048 cannot be told from its neighbours: numbers of this type are whole up to 2047",
            ),
            ("<f8", 1.5, "row 8: frame 1.5 is no number of a frame"),
        ] {
            let mut rows = numbers(&nine(), 8);
            rows[8][7] = frame;
            let file = npy(1, &header(dtype, false, "(9, 8)"), &bytes(&rows, dtype));
            let error = read_bytes(&file).unwrap_err();
            assert!(error.contains(said), "{error}");
        }
    }

    #[test]
    fn a_bad_row_is_counted_from_zero() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.npy");
        let mut samples = some_samples(20_000);
        samples[17_000].rgb[2] = f32::NAN;
        write_samples(&path, &samples).unwrap();
        let read = read_samples(&path).unwrap();
        assert_eq!(read.samples.len(), 19_999);
        let said = read.remarks[0].to_string();
        assert!(
            said.contains("s.npy, row 17000: 1 of 20000 samples hold a number"),
            "{said}"
        );
    }

    #[test]
    #[ignore = "a measurement: ten million rows, 333 MB"]
    fn ten_million_rows_are_read_in_a_second_and_a_half() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.npy");
        let samples = some_samples(10_418_625);
        let start = std::time::Instant::now();
        write_samples(&path, &samples).unwrap();
        println!("write: {:?}", start.elapsed());
        drop(samples);
        let start = std::time::Instant::now();
        let back = read_samples(&path).unwrap().samples;
        println!("read: {:?} for {} rows", start.elapsed(), back.len());
        assert!(start.elapsed().as_secs_f64() < 1.5);
    }
}
