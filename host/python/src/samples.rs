//! Samples: a value or several at pairs of directions.

use crate::arrays::{Values, rows_of};
use crate::to_py;
use gonia_brdf::{Direction, Sample};
use gonia_formats::samples::{
    SampleNote, read_channels, write_noted_channels, write_noted_samples,
};
use gonia_rig::{ChannelSamples, Channels, SampleValues, Scale};
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Samples of one material with their scale and where they came from.
#[pyclass(frozen, module = "gonia._gonia")]
pub struct Samples {
    pub values: SampleValues,
    pub scale: Option<Scale>,
    pub provenance: BTreeMap<String, String>,
    pub remarks: Vec<String>,
}

/// Angles of a sample come first.
const ANGLES: usize = 4;

#[pymethods]
impl Samples {
    /// Of rows of theta_i, phi_i, theta_v, phi_v (degrees), a value a channel and, where `has_frame`, the frame.
    #[new]
    fn new(
        rows: &Bound<'_, PyAny>,
        channels: Vec<String>,
        has_frame: bool,
        scale: Option<&str>,
        provenance: BTreeMap<String, String>,
    ) -> PyResult<Self> {
        let (numbers, columns) = rows_of(rows)?;
        let (channels, order) = channels_of(&channels)?;
        let n = channels.count();
        let wanted = ANGLES + n + usize::from(has_frame);
        if columns != wanted {
            return Err(to_py(format!(
                "samples: {columns} columns; {wanted} are needed: four angles in degrees, {n} values ({channels}){}",
                if has_frame { ", and the frame" } else { "" }
            )));
        }
        let mut samples = ChannelSamples {
            channels,
            places: Vec::with_capacity(numbers.len() / wanted),
            values: Vec::with_capacity(numbers.len() / wanted * n),
        };
        for row in numbers.chunks_exact(wanted) {
            let mut place = Sample {
                theta_i_deg: row[0] as f32,
                phi_i_deg: row[1] as f32,
                theta_v_deg: row[2] as f32,
                phi_v_deg: row[3] as f32,
                ..Sample::new(
                    Direction::from_deg(0.0, 0.0),
                    Direction::from_deg(0.0, 0.0),
                    [],
                )
            };
            let frame = if has_frame { row[ANGLES + n] } else { -1.0 };
            if frame >= 0.0 && frame < f64::from(u32::MAX) {
                place = place.in_frame(frame as u32);
            }
            samples.places.push(place);
            samples
                .values
                .extend(order.iter().map(|k| row[ANGLES + k] as f32));
        }
        let values = match samples.channels {
            Channels::Rgb => SampleValues::Rgb(samples.of_channels([0, 1, 2])),
            _ => SampleValues::Channels(samples),
        };
        Ok(Self {
            values,
            scale: scale.map(scale_of).transpose()?,
            provenance,
            remarks: Vec::new(),
        })
    }

    /// Reads a file of samples.
    #[staticmethod]
    fn read(path: PathBuf) -> PyResult<Self> {
        let read = read_channels(&path).map_err(to_py)?;
        Ok(Self {
            values: read.values,
            scale: read.scale,
            provenance: read.provenance,
            remarks: read.remarks.iter().map(ToString::to_string).collect(),
        })
    }

    /// Writes them, with their scale and provenance.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let note = SampleNote {
            scale: self.scale,
            provenance: self.provenance.clone(),
        };
        py.detach(|| match &self.values {
            SampleValues::Rgb(samples) => write_noted_samples(&path, samples, &note),
            SampleValues::Channels(samples) => write_noted_channels(&path, samples, &note),
        })
        .map_err(to_py)
    }

    /// Rows of four angles, the values and the frame (-1 where it is unknown).
    fn rows(&self) -> Values {
        let n = self.values.channels().count();
        let width = ANGLES + n + 1;
        let all: Vec<usize> = (0..n).collect();
        let of_channel: Vec<Vec<Sample<1>>> =
            all.iter().map(|c| self.values.of_channels([*c])).collect();
        let mut rows = Vec::with_capacity(self.values.len() * width);
        for k in 0..self.values.len() {
            let s = &of_channel[0][k];
            rows.extend([s.theta_i_deg, s.phi_i_deg, s.theta_v_deg, s.phi_v_deg]);
            rows.extend(of_channel.iter().map(|samples| samples[k].rgb[0]));
            rows.push(if s.frame == Sample::<3>::NO_FRAME {
                -1.0
            } else {
                s.frame as f32
            });
        }
        Values::new(rows, vec![self.values.len(), width])
    }

    /// How many.
    fn __len__(&self) -> usize {
        self.values.len()
    }

    #[getter]
    fn channels(&self) -> Vec<String> {
        self.values.channels().names()
    }

    #[getter]
    fn scale(&self) -> Option<String> {
        self.scale.map(|scale| scale.to_string())
    }

    #[getter]
    fn provenance(&self) -> BTreeMap<String, String> {
        self.provenance.clone()
    }

    #[getter]
    fn remarks(&self) -> Vec<String> {
        self.remarks.clone()
    }
}

/// Channels by their names, and the places in the list of each.
fn channels_of(names: &[String]) -> PyResult<(Channels, Vec<usize>)> {
    let plain: Vec<&str> = names.iter().map(String::as_str).collect();
    match plain[..] {
        ["R", "G", "B"] | ["r", "g", "b"] => return Ok((Channels::Rgb, vec![0, 1, 2])),
        ["Y"] => return Ok((Channels::Single, vec![0])),
        _ => {}
    }
    let bands: Option<Vec<f64>> = plain
        .iter()
        .map(|name| Channels::wavelength_of(name))
        .collect();
    let bands = bands.filter(|bands| !bands.is_empty()).ok_or_else(|| {
        to_py(format!(
            "channels {plain:?}: give [\"R\", \"G\", \"B\"], [\"Y\"], or bands by their wavelengths ([\"400nm\", ...])"
        ))
    })?;
    Channels::bands(&bands).map_err(to_py)
}

/// A scale by its name.
pub fn scale_of(name: &str) -> PyResult<Scale> {
    match name {
        "absolute" => Ok(Scale::Absolute),
        "relative" => Ok(Scale::Relative),
        other => Err(to_py(format!(
            "scale \"{other}\": give \"absolute\" (values in 1/sr) or \"relative\""
        ))),
    }
}
