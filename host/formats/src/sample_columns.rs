//! Which column of a table holds what of a sample, and the sample that a row makes.

use crate::column_name::{Quantity, column_name};
use crate::sample_rows::{BadRow, COLUMNS, place_from_row, sample_from_row};
use gonia_rig::{ChannelSamples, Channels, Remark, SampleValues};
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

/// What is needed, as a remedy says it.
const NEEDED: &str = "name theta_i, phi_i, theta_v, phi_v (degrees, or _rad), and r, g, b, one value (brdf) or bands (450nm, ...)";

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
    /// What the values are of, and their columns in the channels' order.
    channels: Channels,
    values: Vec<usize>,
    frame: Option<usize>,
    /// Columns in radians by their names.
    in_radians: Vec<String>,
    /// Columns of uncertainties by their names, which are not read.
    uncertainties: Vec<String>,
}

/// Why the names of a table's columns do not say which is which.
pub(super) struct Unclear {
    pub problem: String,
    pub remedy: &'static str,
}

/// What the name of a column of uncertainties begins with.
const UNCERTAINTY: &str = "u_";

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
        let (channels, values) = match value_columns(names)? {
            ValueColumns::Of(channels, places) => (channels, places),
            ValueColumns::Missing(colours) => {
                missing.extend(colours);
                Default::default()
            }
        };
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
            uncertainties: (0..names.len())
                .map(text)
                .filter(|name| name.starts_with(UNCERTAINTY))
                .map(str::to_owned)
                .collect(),
            frame: place(Quantity::Frame)?.map(|(place, _)| place),
            angles,
            channels,
            values,
        })
    }

    /// By the number of columns alone: four angles and a value or three, and perhaps the frame.
    pub fn by_count(columns: usize) -> Option<Self> {
        let (channels, frame) = match columns {
            5 => (Channels::Single, None),
            6 => (Channels::Single, Some(5)),
            7 => (Channels::Rgb, None),
            8 => (Channels::Rgb, Some(7)),
            _ => return None,
        };
        Some(Self {
            angles: [0, 1, 2, 3].map(|place| AngleColumn {
                place,
                radians: false,
            }),
            values: (4..4 + channels.count()).collect(),
            channels,
            frame,
            uncertainties: Vec::new(),
            in_radians: Vec::new(),
        })
    }

    /// The columns in their order, for people.
    pub fn text(&self) -> String {
        let values = match self.channels {
            Channels::Single => "brdf".to_owned(),
            _ => self.channels.column_names().join(", "),
        };
        let frame = if self.frame.is_some() { ", frame" } else { "" };
        format!("{}, {values}{frame}", COLUMNS[..4].join(", "))
    }

    /// The places that are read.
    pub fn places(&self) -> impl Iterator<Item = usize> {
        let angles = self.angles.iter().map(|angle| angle.place);
        angles.chain(self.values.iter().copied()).chain(self.frame)
    }

    /// What is to be said of the columns as a whole.
    pub fn remarks(&self, path: &Path) -> impl Iterator<Item = Remark> {
        let listed = |names: &[String]| (!names.is_empty()).then(|| names.join(", "));
        let radians = listed(&self.in_radians).map(|names| {
            Remark::new(
                path.display(),
                format_args!("by their names {names} hold radians, and were converted to degrees"),
                "rename them if they hold degrees",
            )
        });
        let uncertainties = listed(&self.uncertainties).map(|names| {
            Remark::new(
                path.display(),
                format_args!("{names} are uncertainties, which are not read"),
                "gonia fill --error finds them again from what is said above the header, and adds noise and directions",
            )
        });
        radians.into_iter().chain(uncertainties)
    }

    /// Room for samples of these columns.
    pub fn room(&self, capacity: usize) -> SampleValues {
        match &self.channels {
            Channels::Rgb => SampleValues::Rgb(Vec::with_capacity(capacity)),
            channels => SampleValues::Channels(ChannelSamples {
                channels: channels.clone(),
                places: Vec::with_capacity(capacity),
                values: Vec::with_capacity(capacity * channels.count()),
            }),
        }
    }

    /// Appends the sample of a row to what [`Self::room`] made.
    pub fn push(&self, row: &mut impl NumberRow, to: &mut SampleValues) -> Result<(), BadRow> {
        let mut angles = [0f32; 4];
        for (k, angle) in self.angles.iter().enumerate() {
            angles[k] = if angle.radians {
                degrees(row.double(angle.place)?, k)?
            } else {
                row.single(angle.place)?
            };
        }
        let frame = |row: &mut _, unknown| match self.frame {
            Some(place) => NumberRow::frame(row, place),
            None => Ok(unknown),
        };
        match to {
            SampleValues::Rgb(samples) => {
                let mut numbers = [0f32; 7];
                numbers[..4].copy_from_slice(&angles);
                for (number, place) in numbers[4..].iter_mut().zip(&self.values) {
                    *number = row.single(*place)?;
                }
                let mut sample = sample_from_row(&numbers)?;
                sample.frame = frame(row, sample.frame)?;
                samples.push(sample);
            }
            SampleValues::Channels(samples) => {
                let first = samples.values.len();
                for place in &self.values {
                    samples.values.push(row.single(*place)?);
                }
                let mut place = place_from_row(angles, &samples.values[first..])?;
                place.frame = frame(row, place.frame)?;
                samples.places.push(place);
            }
        }
        Ok(())
    }
}

/// Which columns hold values.
enum ValueColumns {
    /// The places of the channels.
    Of(Channels, Vec<usize>),
    /// There are none, and of the colours these are missing.
    Missing(Vec<&'static str>),
}

/// The columns of colours, of bands, or of one value.
fn value_columns(names: &[impl AsRef<str>]) -> Result<ValueColumns, Unclear> {
    let text = |place: usize| names[place].as_ref().trim();
    let mut colours = Vec::new();
    let mut no_channel = Vec::new();
    for c in 0..3 {
        match nearest(names, Quantity::Channel(c))? {
            Some((place, _)) => colours.push(place),
            None => no_channel.push(COLUMNS[4 + c]),
        }
    }
    let (mut bands, mut wavelengths) = (Vec::new(), Vec::new());
    for (place, name) in names.iter().enumerate() {
        if let Some(Quantity::Band(wavelength)) = column_name(name.as_ref()).map(|n| n.quantity) {
            bands.push(place);
            wavelengths.push(wavelength);
        }
    }
    let one = nearest(names, Quantity::Value)?.map(|(place, _)| place);
    let both = |first: usize, band: usize| Unclear {
        problem: format!(
            "{} and {} are columns of values of two kinds",
            text(first),
            text(band)
        ),
        remedy: "keep those of one kind: r, g, b, or bands (450nm), or one value",
    };
    if let Some(band) = bands.first() {
        if let Some(other) = colours
            .first()
            .filter(|_| no_channel.is_empty())
            .or(one.as_ref())
        {
            return Err(both(*other, *band));
        }
        let (channels, order) = Channels::bands(&wavelengths).map_err(|same| Unclear {
            problem: format!("the band of {same}"),
            remedy: "keep one of the two columns, or rename the other",
        })?;
        let places = order.iter().map(|k| bands[*k]).collect();
        return Ok(ValueColumns::Of(channels, places));
    }
    if no_channel.is_empty() {
        return Ok(ValueColumns::Of(Channels::Rgb, colours));
    }
    let Some(one) = one else {
        return Ok(ValueColumns::Missing(no_channel));
    };
    let is = |place: usize, name: &str| text(place).eq_ignore_ascii_case(name);
    let of_xyz = |place: &usize| is(*place, "x") || is(*place, "z");
    if is(one, "y")
        && let Some(other) = (0..names.len()).find(of_xyz)
    {
        return Err(Unclear {
            problem: format!("{} stands beside {}", text(one), text(other)),
            remedy: "give linear r, g, b in place of X, Y, Z, or Y alone",
        });
    }
    Ok(ValueColumns::Of(Channels::Single, vec![one]))
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
        assert_eq!(columns.values, [5, 6, 7]);
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
