//! Samples as `.csv`.

use crate::csv_table::CsvTable;
use crate::format::{Content, Format, SampleFormat, SamplesRead};
use crate::sample_rows::{COLUMNS, frame_in_file, have_frames, sample_from_row};
use crate::{FileError, write_whole};
use gonia_brdf::Sample;
use std::io::Write;
use std::path::Path;

/// CSV with the columns' names in the first line.
pub(super) static FORMAT: Format = Format {
    name: "CSV",
    endings: &["csv"],
    magic: &[],
    content: Content::Samples(SampleFormat { read, write }),
};

fn read(path: &Path) -> Result<SamplesRead, FileError> {
    let mut table = CsvTable::open(path)?;
    let mut columns = Vec::with_capacity(8);
    for name in &COLUMNS[..7] {
        columns.push(table.column(name)?);
    }
    columns.extend(table.optional_column(COLUMNS[7])?);
    let mut samples = Vec::new();
    let mut row = [0f32; 8];
    while table.next_row()? {
        for (value, column) in row.iter_mut().zip(&columns) {
            *value = table.number(*column)?;
        }
        let sample = sample_from_row(&row[..columns.len()])
            .map_err(|bad| table.wrong(bad.problem, bad.remedy))?;
        samples.push(sample);
    }
    Ok(samples.into())
}

fn write(path: &Path, samples: &[Sample]) -> Result<(), FileError> {
    let with_frames = have_frames(samples);
    let columns = if with_frames { 8 } else { 7 };
    write_whole(path, |out| {
        writeln!(out, "{}", COLUMNS[..columns].join(","))?;
        for s in samples {
            let [r, g, b] = s.rgb;
            write!(
                out,
                "{},{},{},{},{r},{g},{b}",
                s.theta_i_deg, s.phi_i_deg, s.theta_v_deg, s.phi_v_deg
            )?;
            if with_frames {
                write!(out, ",{}", frame_in_file(s.frame))?;
            }
            out.write_all(b"\n")?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use crate::samples::read_samples;

    #[test]
    fn a_bad_field_names_its_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.csv");
        let read = |rows: &str| {
            let header = "r,g,b,theta_i,phi_i,theta_v,phi_v\n";
            std::fs::write(&path, format!("{header}{rows}")).unwrap();
            read_samples(&path)
        };
        let samples = read("1,2,3,10,20,30,40\n").unwrap().samples;
        assert_eq!(
            (samples[0].theta_i_deg, samples[0].rgb),
            (10.0, [1.0, 2.0, 3.0])
        );
        let error = read("1,2,3,10,20,30,40\n1,x,3,10,20,30,40\n")
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("s.csv, line 3: g \"x\" is not a number"),
            "{error}"
        );
        let error = read("1,2,3,100,20,30,40\n").unwrap_err().to_string();
        assert!(
            error.contains("s.csv, line 2: 1 of 1 samples lie below the horizon"),
            "{error}"
        );
    }
}
