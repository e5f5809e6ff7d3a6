//! A row of a sample file: the names of its columns, and what a row may hold.

use gonia_brdf::{Sample, direction::wrap_deg};

/// The names of the columns; the last one is optional.
pub(super) const COLUMNS: [&str; 8] = [
    "theta_i", "phi_i", "theta_v", "phi_v", "r", "g", "b", "frame",
];

/// The largest number of a frame; the next one stands for none.
pub(super) const LAST_FRAME: u32 = Sample::NO_FRAME - 1;

/// The largest number of a frame that float32 tells from the next one.
pub(super) const LAST_FRAME_IN_SINGLE: u32 = (1 << 24) - 1;

/// Whether any sample says which frame it came from.
pub(super) fn have_frames<const N: usize>(samples: &[Sample<N>]) -> bool {
    samples
        .iter()
        .any(|sample| sample.frame != Sample::NO_FRAME)
}

/// A frame number as it stands in a file.
pub(super) fn frame_in_file(frame: u32) -> f64 {
    if frame == Sample::NO_FRAME {
        -1.0
    } else {
        f64::from(frame)
    }
}

/// The frame of a number in a file whose numbers are told apart up to `last`.
pub(super) fn frame_of_number(number: f64, last: u32) -> Result<u32, BadRow> {
    if number == -1.0 {
        return Ok(Sample::NO_FRAME);
    }
    if number.fract() != 0.0 || !(0.0..=f64::from(LAST_FRAME)).contains(&number) {
        return Err(BadRow {
            problem: format!("frame {number} is no number of a frame"),
            remedy: "give whole numbers from 0 to 4294967294, or -1 where it is unknown",
        });
    }
    if number > f64::from(last) {
        return Err(BadRow {
            problem: format!(
                "frame {number} cannot be told from its neighbours: numbers of this type are whole up to {last}"
            ),
            remedy: "save float64, or number the frames from 0",
        });
    }
    Ok(number as u32)
}

/// What is wrong with a row.
pub(super) struct BadRow {
    pub problem: String,
    pub remedy: &'static str,
}

/// A row as a sample, its azimuths wrapped. `row` has 7 or 8 columns. Directions that are none and values
/// that are not finite stay in it for [`crate::odd_samples`], which knows how many there are.
pub(super) fn sample_from_row(row: &[f32]) -> Result<Sample, BadRow> {
    check_sum(row.iter().take(7))?;
    let frame = match row.get(7) {
        None => Sample::NO_FRAME,
        Some(frame) => frame_of_number(f64::from(*frame), LAST_FRAME_IN_SINGLE)?,
    };
    Ok(Sample {
        theta_i_deg: row[0],
        phi_i_deg: wrapped(row[1]),
        theta_v_deg: row[2],
        phi_v_deg: wrapped(row[3]),
        rgb: [row[4], row[5], row[6]],
        frame,
    })
}

/// The directions of a sample, its azimuths wrapped, whose values are kept elsewhere; of no frame.
pub(super) fn place_from_row(angles: [f32; 4], values: &[f32]) -> Result<Sample<0>, BadRow> {
    check_sum(angles.iter().chain(values))?;
    Ok(Sample {
        theta_i_deg: angles[0],
        phi_i_deg: wrapped(angles[1]),
        theta_v_deg: angles[2],
        phi_v_deg: wrapped(angles[3]),
        rgb: [],
        frame: Sample::NO_FRAME,
    })
}

/// The sum of finite numbers is finite, save for ones far beyond every value of a BRDF.
fn check_sum<'a>(numbers: impl Iterator<Item = &'a f32> + Clone) -> Result<(), BadRow> {
    let sum: f32 = numbers.clone().sum();
    if !sum.is_finite() && numbers.clone().all(|v| v.is_finite()) {
        return Err(BadRow {
            problem: "its values are beyond all measure".into(),
            remedy: "check the units: degrees, and BRDF values in 1/sr",
        });
    }
    Ok(())
}

fn wrapped(phi: f32) -> f32 {
    if (0.0..360.0).contains(&phi) {
        return phi;
    }
    let phi = wrap_deg(f64::from(phi)) as f32;
    // Just below 360 rounds to 360 in single precision.
    if phi >= 360.0 { 0.0 } else { phi }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn some_samples(n: u32) -> Vec<Sample> {
        (0..n)
            .map(|k| Sample {
                theta_i_deg: (k % 90) as f32 + 0.125,
                phi_i_deg: (k % 360) as f32,
                theta_v_deg: (k % 75) as f32,
                phi_v_deg: (k % 359) as f32 + 0.5,
                rgb: [0.1 * k as f32, 1.0 / (1.0 + k as f32), -0.01],
                frame: k / 1225,
            })
            .collect()
    }

    #[test]
    fn azimuths_wrap_and_bad_rows_say_what_is_bad() {
        let row = [10.0, -90.0, 20.0, 720.0, 1.0, 1.0, 1.0, 3.0];
        let sample = sample_from_row(&row).ok().unwrap();
        assert_eq!(
            (sample.phi_i_deg, sample.phi_v_deg, sample.frame),
            (270.0, 0.0, 3)
        );
        assert_eq!(wrapped(-1e-9), 0.0);
        let mut odd = row;
        (odd[0], odd[2], odd[5]) = (-91.0, f32::NAN, f32::NAN);
        let sample = sample_from_row(&odd).ok().unwrap();
        assert!(sample.theta_i_deg == -91.0 && sample.theta_v_deg.is_nan());
        for (column, value, said) in [
            (5, f32::MAX, "its values are beyond all measure"),
            (7, 1.5, "frame 1.5 is no number of a frame"),
            (7, f32::NAN, "frame NaN is no number of a frame"),
            (
                7,
                4_294_967_296.0,
                "frame 4294967296 is no number of a frame",
            ),
            (
                7,
                16_777_216.0,
                "frame 16777216 cannot be told from its neighbours: numbers of this type are whole up to 16777215",
            ),
        ] {
            let mut bad = row;
            bad[column] = value;
            bad[4] = if column == 5 { f32::MAX } else { bad[4] };
            assert_eq!(sample_from_row(&bad).err().unwrap().problem, said);
        }
    }
}
