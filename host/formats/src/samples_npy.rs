//! Samples as `.npy`.

use crate::format::{Content, Format, SampleFormat, SamplesRead};
use crate::sample_rows::{frame_in_file, have_frames, sample_from_row};
use crate::{FileError, npy};
use gonia_brdf::Sample;
use std::io::{Read, Write};
use std::path::Path;

const DTYPE: &str = "<f4";
/// Rows read or written at a time.
const ROWS: usize = 1 << 13;

/// NumPy's array file: float32, N × 7 or N × 8, in C order.
pub(super) static FORMAT: Format = Format {
    name: "NumPy",
    endings: &["npy"],
    magic: b"\x93NUMPY",
    content: Content::Samples(SampleFormat { read, write }),
};

fn read(path: &Path) -> Result<SamplesRead, FileError> {
    let mut array = npy::open(path, DTYPE, 4)?;
    let (n, columns) = match array.shape[..] {
        [n, columns @ (7 | 8)] => (n as usize, columns as usize),
        _ => {
            return Err(FileError::new(
                path,
                format_args!("has the shape {}", npy::shape_text(&array.shape)),
                "give N × 7 (theta_i, phi_i, theta_v, phi_v, r, g, b), or N × 8 with the frame last",
            ));
        }
    };
    let mut samples = Vec::with_capacity(n);
    let mut buffer = vec![0u8; ROWS * columns * 4];
    let mut row = [0f32; 8];
    while samples.len() < n {
        let chunk = &mut buffer[..ROWS.min(n - samples.len()) * columns * 4];
        array
            .data
            .read_exact(chunk)
            .map_err(|error| FileError::reading(path, &error))?;
        for bytes in chunk.chunks_exact(columns * 4) {
            for (value, four) in row.iter_mut().zip(bytes.as_chunks::<4>().0) {
                *value = f32::from_le_bytes(*four);
            }
            let sample = sample_from_row(&row[..columns]).map_err(|bad| {
                FileError::new(path, bad.problem, bad.remedy)
                    .at(format_args!("row {}", samples.len()))
            })?;
            samples.push(sample);
        }
    }
    Ok(samples.into())
}

fn write(path: &Path, samples: &[Sample]) -> Result<(), FileError> {
    let columns = if have_frames(samples) { 8 } else { 7 };
    npy::write(path, DTYPE, &[samples.len(), columns], |out| {
        let mut buffer = Vec::with_capacity(ROWS * columns * 4);
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
                    frame,
                ];
                for value in &row[..columns] {
                    buffer.extend_from_slice(&value.to_le_bytes());
                }
            }
            out.write_all(&buffer)?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use crate::sample_rows::tests::some_samples;
    use crate::samples::{read_samples, write_samples};

    #[test]
    fn arrays_that_are_no_samples_are_refused_in_one_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.npy");
        write_samples(&path, &some_samples(10)).unwrap();
        let good = std::fs::read(&path).unwrap();
        let damage = |from: &str, to: &str| {
            let at = good
                .windows(from.len())
                .position(|w| w == from.as_bytes())
                .unwrap();
            let mut bytes = good.clone();
            bytes[at..at + from.len()].copy_from_slice(to.as_bytes());
            std::fs::write(&path, &bytes).unwrap();
            let error = read_samples(&path).unwrap_err().to_string();
            assert_eq!(error.lines().count(), 1);
            error
        };
        assert!(damage("<f4", "<f8").contains("holds <f8, not <f4"));
        assert!(damage("<f4", ">f4").contains("holds >f4, not <f4"));
        assert!(damage("False", "True ").contains("is in Fortran order"));
        assert!(damage("(10, 8)", "(20, 4)").contains("has the shape 20 × 4"));
        assert!(damage("(10, 8)", "(99, 8)").contains("cut short: its header promises 99 × 8"));
        assert!(damage("NUMPY", "NUMPI").contains("is not a .npy file"));
        let huge = damage("(10, 8), }         ", "(999999999999999,8)");
        assert!(huge.contains("cut short"), "{huge}");
        for keep in [0, 5, 9, 60] {
            std::fs::write(&path, &good[..keep]).unwrap();
            let error = read_samples(&path).unwrap_err().to_string();
            assert!(error.contains("is not a .npy file"), "{keep}: {error}");
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
