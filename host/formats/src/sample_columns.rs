//! Which column of a table holds what of a sample, and the sample that a row makes.

use crate::column_name::{Quantity, column_name};
use crate::sample_rows::{BadRow, COLUMNS, sample_from_row};
use gonia_brdf::Sample;
use gonia_rig::Remark;
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

/// What is needed, as a remedy says it.
const NEEDED: &str =
    "name theta_i, phi_i, theta_v, phi_v (degrees, or _rad), and r, g, b or one value (brdf)";

/// A right angle in radians, rounded up to as few as three decimals, is one.
const RIGHT_ANGLE_ROUNDED_RAD: f64 = 1.5711;

/// The numbers of a row, by the places of their columns.
pub(super) trait NumberRow {
    /// A number in single precision.
    fn single(&mut self, column: usize) -> Result<f32, BadRow>;
    /// A number as precise as the file has it.
    fn double(&mut self, column: usize) -> Result<f64, BadRow>;
    /// The number of a frame, [`Sample::NO_FRAME`] where it is unknown.
    fn frame(&mut self, column: usize) -> Result<u32, BadRow>;
}

/// An angle's column.
#[derive(Clone, Copy, Debug, PartialEq)]
struct AngleColumn {
    place: usize,
    radians: bool,
}

/// The places of the columns in a table.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SampleColumns {
    angles: [AngleColumn; 4],
    /// One column three times where there is one channel.
    channels: [usize; 3],
    frame: Option<usize>,
    /// Columns in radians by their names.
    in_radians: Vec<String>,
}

/// Why the names of a table's columns do not say which is which.
pub(super) struct Unclear {
    pub problem: String,
    pub remedy: &'static str,
}

impl SampleColumns {
    /// By the names of the columns; others are ignored.
    pub fn by_names(names: &[impl AsRef<str>]) -> Result<Self, Unclear> {
        let text = |place: usize| names[place].as_ref().trim();
        let place = |quantity: Quantity| nearest(names, quantity);
        let mut angles = [AngleColumn {
            place: 0,
            radians: false,
        }; 4];
        let mut missing = Vec::new();
        for (k, angle) in angles.iter_mut().enumerate() {
            match place(Quantity::Angle(k))? {
                Some((place, radians)) => *angle = AngleColumn { place, radians },
                None => missing.push(COLUMNS[k]),
            }
        }
        let mut channels = [0; 3];
        let mut no_channel = Vec::new();
        for (c, channel) in channels.iter_mut().enumerate() {
            match place(Quantity::Channel(c))? {
                Some((place, _)) => *channel = place,
                None => no_channel.push(COLUMNS[4 + c]),
            }
        }
        if !no_channel.is_empty() {
            match place(Quantity::Value)? {
                Some((place, _)) => channels = [place; 3],
                None => missing.append(&mut no_channel),
            }
        }
        if !missing.is_empty() {
            return Err(Unclear {
                problem: format!(
                    "there is no column for {}; found: {}",
                    missing.join(", "),
                    listed(names)
                ),
                remedy: NEEDED,
            });
        }
        let in_radians = angles.iter().filter(|angle| angle.radians);
        Ok(Self {
            in_radians: in_radians
                .map(|angle| text(angle.place).to_owned())
                .collect(),
            frame: place(Quantity::Frame)?.map(|(place, _)| place),
            angles,
            channels,
        })
    }

    /// By the number of columns alone: four angles and a value or three, and perhaps the frame.
    pub fn by_count(columns: usize) -> Option<Self> {
        let (channels, frame) = match columns {
            5 => ([4; 3], None),
            6 => ([4; 3], Some(5)),
            7 => ([4, 5, 6], None),
            8 => ([4, 5, 6], Some(7)),
            _ => return None,
        };
        Some(Self {
            angles: [0, 1, 2, 3].map(|place| AngleColumn {
                place,
                radians: false,
            }),
            channels,
            frame,
            in_radians: Vec::new(),
        })
    }

    /// The columns in their order, for people.
    pub fn text(&self) -> String {
        let one = self.channels[0] == self.channels[1];
        let values = if one { "brdf" } else { "r, g, b" };
        let frame = if self.frame.is_some() { ", frame" } else { "" };
        format!("{}, {values}{frame}", COLUMNS[..4].join(", "))
    }

    /// The places that are read.
    pub fn places(&self) -> impl Iterator<Item = usize> {
        let angles = self.angles.iter().map(|angle| angle.place);
        angles.chain(self.channels).chain(self.frame)
    }

    /// What is to be said of the columns as a whole.
    pub fn remark(&self, path: &Path) -> Option<Remark> {
        (!self.in_radians.is_empty()).then(|| {
            Remark::new(
                path.display(),
                format_args!(
                    "by their names {} hold radians, and were converted to degrees",
                    self.in_radians.join(", ")
                ),
                "rename them if they hold degrees",
            )
        })
    }

    /// The sample of a row.
    pub fn sample(&self, row: &mut impl NumberRow) -> Result<Sample, BadRow> {
        let mut numbers = [0f32; 7];
        for (k, angle) in self.angles.iter().enumerate() {
            numbers[k] = if angle.radians {
                degrees(row.double(angle.place)?, k)?
            } else {
                row.single(angle.place)?
            };
        }
        numbers[4] = row.single(self.channels[0])?;
        for c in 1..3 {
            numbers[4 + c] = if self.channels[c] == self.channels[0] {
                numbers[4]
            } else {
                row.single(self.channels[c])?
            };
        }
        let mut sample = sample_from_row(&numbers)?;
        if let Some(frame) = self.frame {
            sample.frame = row.frame(frame)?;
        }
        Ok(sample)
    }
}

/// The column of a quantity whose name is nearest to gonia's own, and whether it is in radians.
fn nearest(
    names: &[impl AsRef<str>],
    quantity: Quantity,
) -> Result<Option<(usize, bool)>, Unclear> {
    let known = names.iter().enumerate().filter_map(|(place, name)| {
        let name = column_name(name.as_ref())?;
        (name.quantity == quantity).then_some((place, name))
    });
    let known: Vec<_> = known.collect();
    let Some(least) = known.iter().map(|(_, name)| name.distance).min() else {
        return Ok(None);
    };
    let same: Vec<_> = known
        .iter()
        .filter(|(_, name)| name.distance == least)
        .collect();
    match same[..] {
        [(place, name)] => Ok(Some((*place, name.radians))),
        _ => {
            let same: Vec<&str> = same
                .iter()
                .map(|(k, _)| names[*k].as_ref().trim())
                .collect();
            Err(Unclear {
                problem: format!("{} are columns of the same quantity", same.join(" and ")),
                remedy: "keep one of them, or rename the others",
            })
        }
    }
}

/// Names as a message lists them, the first twenty.
fn listed(names: &[impl AsRef<str>]) -> String {
    const MOST: usize = 20;
    let mut shown: Vec<&str> = names
        .iter()
        .take(MOST)
        .map(|name| name.as_ref().trim())
        .collect();
    if names.len() > MOST {
        shown.push("…");
    }
    shown.join(", ")
}

/// An angle that is in radians by its column's name, in degrees.
fn degrees(radians: f64, column: usize) -> Result<f32, BadRow> {
    let is_polar = column.is_multiple_of(2);
    // An azimuth may be the sum of two.
    let most = if is_polar {
        RIGHT_ANGLE_ROUNDED_RAD
    } else {
        4.0 * PI
    };
    if radians.is_finite() && radians.abs() > most {
        return Err(BadRow {
            problem: format!(
                "{} {radians} is too much for the radians of its column's name",
                COLUMNS[column]
            ),
            remedy: "rename the column if it holds degrees",
        });
    }
    let rounded_up = is_polar && radians > FRAC_PI_2;
    let radians = if rounded_up { FRAC_PI_2 } else { radians };
    Ok(radians.to_degrees() as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn by_names(names: &str) -> Result<SampleColumns, String> {
        let names: Vec<&str> = names.split(',').collect();
        SampleColumns::by_names(&names).map_err(|unclear| unclear.problem)
    }

    #[test]
    fn columns_are_found_in_any_order_among_others() {
        let columns = by_names("n,B,G,R,phi_out,theta_out,phi_in,theta_in,T").unwrap();
        let places: Vec<usize> = columns.places().collect();
        assert_eq!(places, [7, 6, 5, 4, 3, 2, 1]);
        let one = by_names("theta_i,phi_i,theta_v,phi_v,brdf,frame").unwrap();
        assert_eq!(one, SampleColumns::by_count(6).unwrap());
        // All three channels count more than their mean.
        let columns = by_names("theta_i,phi_i,theta_v,phi_v,brdf,r,g,b").unwrap();
        assert_eq!(columns.channels, [5, 6, 7]);
    }

    #[test]
    fn gonias_own_name_wins_and_two_others_are_refused() {
        let columns = by_names("theta_i,phi_i,theta_v,phi_v,theta_s,theta_i_rad,f").unwrap();
        assert_eq!(columns.angles[2].place, 2);
        assert!(columns.in_radians.is_empty());
        let columns = by_names("theta_i_rad,theta_i_deg,phi_i,theta_v,phi_v,f").unwrap();
        assert_eq!(columns.angles[0].place, 1);
        let error = by_names("theta_i,phi_i,theta_o,theta_r,phi_o,f").unwrap_err();
        assert_eq!(
            error,
            "theta_o and theta_r are columns of the same quantity"
        );
    }

    #[test]
    fn a_missing_column_is_named_beside_what_was_found() {
        let error = by_names("theta_i,phi_i,theta_v,R,G").unwrap_err();
        assert_eq!(
            error,
            "there is no column for phi_v, b; found: theta_i, phi_i, theta_v, R, G"
        );
    }

    // Right angles as a file of four decimals has them.
    #[allow(clippy::approx_constant)]
    #[test]
    fn radians_become_degrees_and_are_too_small_for_degrees() {
        assert_eq!(degrees(1.5708, 0).ok(), Some(90.0));
        assert_eq!(degrees(-PI, 1).ok(), Some(-180.0));
        assert!(degrees(1.58, 2).is_err());
        assert!(degrees(54.7, 0).is_err());
        assert!(degrees(337.0, 3).is_err());
        assert!(degrees(f64::NAN, 0).is_ok_and(f32::is_nan));
    }
}
