//! Pairs of directions as a table, at which a BRDF is evaluated.

use crate::FileError;
use crate::named_table::NamedTable;
use std::path::Path;

/// The columns of a table of directions, degrees, as they are written.
pub const ANGLES: [&str; 4] = ["theta_i", "phi_i", "theta_v", "phi_v"];

/// Two directions, as they were given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionRow {
    /// Line of the table, counted from 1.
    pub line: usize,
    /// theta_i, phi_i, theta_v and phi_v, degrees; the polar angles in 0 ..= 90.
    pub angles_deg: [f64; 4],
}

/// Reads a table of directions, in any dialect in which samples are read; `place` says where the bytes are
/// from.
///
/// # Errors
/// One line naming the place and its line: no text, a missing column, or what is no angle.
pub fn read_directions(place: &Path, bytes: Vec<u8>) -> Result<Vec<DirectionRow>, FileError> {
    let table = NamedTable::of_bytes(place, bytes, &ANGLES, ANGLES.len())?;
    let columns = table.angles()?;
    let mut rows = table.rows();
    let mut directions = Vec::new();
    while rows.advance()? {
        let mut angles_deg = [0.0; 4];
        for (k, name) in ANGLES.into_iter().enumerate() {
            let (value, degrees) = rows.angle(columns[k])?;
            // 90 degrees in radians may be off in their last digit.
            let is_polar = (0.0..=90.0 + 1e-9).contains(&degrees);
            if k % 2 == 0 && !is_polar {
                let remedy = if (-90.0..0.0).contains(&degrees) {
                    "give its size, and the azimuth plus 180 degrees"
                } else {
                    "give degrees from the normal"
                };
                return Err(rows.wrong(
                    format_args!("{name} = {value} is not a polar angle in 0..=90 degrees"),
                    remedy,
                ));
            }
            angles_deg[k] = if k % 2 == 0 {
                degrees.min(90.0)
            } else {
                degrees
            };
        }
        directions.push(DirectionRow {
            line: rows.line(),
            angles_deg,
        });
    }
    Ok(directions)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_read_as_samples_are() {
        let read = |text: &str| read_directions(Path::new("standard input"), text.into());
        let row = DirectionRow {
            line: 3,
            angles_deg: [30.5, 0.0, 90.0, 45.0],
        };
        for text in [
            "theta_i,phi_i,theta_v,phi_v\n\n30.5,0,90,45\n",
            "# asked on Monday\ntheta_in;phi_in;theta_out;phi_out\n30,5;0;90;45\n",
            "frame,ThetaI,PhiI,ThetaV,PhiV\n\n7,30.5,0,90,45\n",
            "\ntheta_i[rad]\tphi_i\ttheta_v[rad]\tphi_v\n0.5323254218582705\t0\t1.5707963267948966\t45\n",
        ] {
            assert_eq!(read(text).unwrap(), [row], "{text}");
        }
        for (text, said) in [
            (
                "30,0,90,45\n",
                "line 1: there is no column \"theta_i_deg\"; the file has no header;",
            ),
            (
                "theta_i,phi_i,theta_v,phi_v\n91,0,0,0\n",
                "standard input, line 2: theta_i = 91 is not a polar angle in 0..=90 degrees; give degrees from the normal",
            ),
            (
                "theta_i,phi_i,theta_v,phi_v\nx,0,0,0\n",
                "line 2: theta_i \"x\" is not a number;",
            ),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
    }
}
