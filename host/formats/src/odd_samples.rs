//! What is said of samples that cannot stand as their file has them.

use crate::format::ChannelsRead;
use crate::{FileError, samples_csv, table};
use gonia_brdf::Sample;
use gonia_rig::{Oddity, Remark, SampleValues};
use std::path::Path;

/// Leaves out what has no direction above the sample or no value, turns negative polar angles, and
/// remarks how many there were.
///
/// # Errors
/// More than half would be left out.
pub(crate) fn sort_out(path: &Path, read: &mut ChannelsRead) -> Result<(), FileError> {
    let azimuths_are_polar = match &read.values {
        SampleValues::Rgb(samples) => are_polar(samples),
        SampleValues::Channels(samples) => are_polar(&samples.places),
    };
    let odd = read.values.keep_sound();
    let exchanged = odd.no_angle.count > 0 && azimuths_are_polar;
    let kinds = [
        (
            &odd.not_finite,
            "hold a number that is not finite",
            "remove these rows or mend their values",
        ),
        (
            &odd.below,
            "lie below the horizon, beyond 90 degrees from the normal",
            "give polar angles in degrees from the normal, from 0 to 90",
        ),
        (
            &odd.no_angle,
            "have a polar angle beyond 180 degrees, which is none",
            if exchanged {
                "the azimuths are all below 90 degrees: exchange the columns theta and phi"
            } else {
                "give polar angles in degrees from the normal, from 0 to 90"
            },
        ),
    ];
    let most = kinds.iter().max_by_key(|kind| kind.0.count);
    if let Some((oddity, what, remedy)) = most
        && 2 * odd.left_out() > odd.samples
    {
        let problem = counted(oddity, odd.samples, what);
        return Err(FileError::new(path, problem, remedy).at(place(path, oddity)));
    }
    for (oddity, what, remedy) in kinds {
        if oddity.count > 0 {
            read.remarks.push(Remark::new(
                format_args!("{}, {}", path.display(), place(path, oddity)),
                format_args!("{}; they are left out", counted(oddity, odd.samples, what)),
                remedy,
            ));
        }
    }
    if odd.signed.count > 0 {
        read.remarks.push(Remark::new(
            format_args!("{}, {}", path.display(), place(path, &odd.signed)),
            counted(&odd.signed, odd.samples, "have a negative polar angle"),
            "each is taken for the same angle at azimuth + 180 degrees: if it is no such sign, give angles from 0 to 90",
        ));
    }
    Ok(())
}

/// Whether all azimuths could be polar angles.
fn are_polar<const N: usize>(samples: &[Sample<N>]) -> bool {
    let mut samples = samples.iter();
    samples.all(|s| s.phi_i_deg <= 90.0 && s.phi_v_deg <= 90.0)
}

fn counted(oddity: &Oddity, all: usize, what: &str) -> String {
    let first = oddity.first.as_ref().map_or("", |(_, first)| first);
    format!(
        "{} of {all} samples {what}, the first with {first}",
        oddity.count
    )
}

/// Where the first stands: a line of a CSV, else a row counted from 0.
fn place(path: &Path, oddity: &Oddity) -> String {
    let number = oddity.first.as_ref().map_or(0, |(number, _)| *number);
    line_of(path, number).map_or(format!("row {number}"), |line| format!("line {line}"))
}

/// Readers keep no lines of millions of samples; the file is read again where one is wanted.
fn line_of(path: &Path, number: usize) -> Option<usize> {
    let is_binary = table::format_of_file(path)
        .ok()?
        .is_none_or(|format| !format.magic.is_empty());
    if is_binary {
        return None;
    }
    let table = samples_csv::table(path).ok()?;
    let mut rows = table.rows();
    for _ in 0..=number {
        rows.advance().ok().filter(|more| *more)?;
    }
    Some(rows.line())
}

#[cfg(test)]
mod tests {
    use crate::samples::read_samples;

    fn read(rows: &str) -> Result<crate::samples::SamplesRead, String> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.csv");
        let header = "# from the rig\ntheta_i,phi_i,theta_v,phi_v,r,g,b\n";
        std::fs::write(&path, format!("{header}{rows}")).unwrap();
        read_samples(&path).map_err(|error| error.to_string())
    }

    #[test]
    fn a_few_samples_that_cannot_be_are_left_out_and_counted_with_the_line_of_the_first() {
        let good = "10,0,20,0,1,1,1\n".repeat(5);
        let odd = "10,0,95,0,1,1,1\n10,0,-20,30,1,1,1\n10,0,20,0,nan,1,1\n10,0,999,0,1,1,1\n";
        let read = read(&format!("{good}{odd}")).unwrap();
        assert_eq!(read.samples.len(), 6);
        assert_eq!(read.samples[5].phi_v_deg, 210.0);
        let said: Vec<String> = read.remarks.iter().map(ToString::to_string).collect();
        for (remark, words) in said.iter().zip([
            "line 10: 1 of 9 samples hold a number that is not finite, the first with r NaN; they are left out",
            "line 8: 1 of 9 samples lie below the horizon",
            "line 11: 1 of 9 samples have a polar angle beyond 180 degrees",
            "line 9: 1 of 9 samples have a negative polar angle, the first with theta_v -20",
        ]) {
            assert!(remark.contains(words), "{said:?}");
        }
        assert_eq!(said.len(), 4);
    }

    #[test]
    fn most_samples_that_cannot_be_are_refused_and_exchanged_columns_named() {
        let below = "10,0,20,0,1,1,1\n10,0,120,0,1,1,1\n10,0,130,0,1,1,1\n";
        let said = read(below).unwrap_err();
        assert!(said.contains("line 4: 2 of 3 samples lie below"), "{said}");
        let exchanged = "10,0,20,0,1,1,1\n200,10,190,20,1,1,1\n300,40,10,50,1,1,1\n";
        let said = read(exchanged).unwrap_err();
        assert!(
            said.ends_with("exchange the columns theta and phi"),
            "{said}"
        );
        assert!(read("").unwrap_err().contains("has no rows"));
    }
}
