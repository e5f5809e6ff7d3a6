//! BiRD's JSON of BRDF measurements: parallel arrays of angles, values and standard uncertainties.
//!
//! `data` holds `theta_i`, `phi_i`, `theta_r`, `phi_r`, `BRDF` and `uBRDF`, each `{unit, values}`; bands have
//! `wavelength_i` and `wavelength_r` beside these, colours an ad hoc variable `channel` (0 red, 1 green, 2 blue). Of
//! what `metadata` must hold, gonia does not know who measured where: it writes `not stated`. Azimuths lie in 0 ..= 360
//! without 360, and no value may be negative: such a value is left out.

use super::{ExportFormat, Holds, How, Meaning, Point, Resolution};
use crate::format::{Content, ForeignContent, ForeignFormat, Format};
use crate::{FileError, checksum, write_whole_bytes};
use gonia_brdf::direction::wrap_deg;
use gonia_brdf::{Direction, Sample};
use gonia_rig::{Channels, DenseChannels, Remark, Scale};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::Path;

/// How it is exported.
pub(super) static EXPORT: ExportFormat = ExportFormat {
    name: "bird",
    title: "BiRD JSON",
    ending: "json",
    readers: "BiRD_view; `gonia import`",
    means: Meaning::Absolute,
    holds: Holds::Any,
    angles: "incidences on rings up to 75° and views every 4° or the table's step up to its last, each the nearest node; its uncertainties (`--error`)",
    provenance: Some("metadata.software.comments"),
    is_folder: false,
    resolution: Some(Resolution {
        default: 6,
        least: 1,
        most: 38,
        of: "rings of incidences",
    }),
    step_deg: |_| 0.0,
    how: How::Points { write, read },
};

/// How it is imported: one value, or colours.
pub(crate) static FORMAT: Format = Format {
    name: "BiRD",
    endings: &["json"],
    magic: &[],
    content: Content::Foreign(ForeignFormat {
        name: "BiRD JSON",
        content: ForeignContent::Samples {
            scale: Some(Scale::Absolute),
            read: read_samples,
        },
    }),
};

const SCHEMA: &str = "https://raw.githubusercontent.com/BiRD-project/BiRD_view/master/BRDF_JSON_schema/brdf_json_schema_v1.0.json";
/// Polar angle of the last ring of incidences.
const LAST_DEG: f64 = 75.0;
/// Least step of the views, degrees.
const VIEW_STEP_DEG: f64 = 4.0;
/// What stands where gonia does not know.
const UNKNOWN: &str = "not stated";

fn write(
    path: &Path,
    dense: &DenseChannels,
    errors: Option<&DenseChannels>,
    rings: usize,
) -> Result<Vec<Remark>, FileError> {
    let file = BirdFile {
        channels: &dense.channels,
        points: points(dense, errors, rings),
        has_uncertainties: errors.is_some(),
        provenance: &dense.provenance,
        checksum: checksum::of_channels(dense),
        what: "Nodes of a dense BRDF, interpolated from measured samples",
    };
    let mut remarks = file.write(path)?;
    if errors.is_none() {
        remarks.push(Remark::new(
            path.display(),
            "holds no uncertainties",
            "give --error ERR.exr, as gonia fill --error wrote it",
        ));
    }
    Ok(remarks)
}

/// What such a file holds.
pub struct BirdFile<'a> {
    /// What the points' channels are.
    pub channels: &'a Channels,
    /// The values, in 1/sr. Those that are negative are left out.
    pub points: Vec<Point>,
    /// Whether all points have a standard uncertainty.
    pub has_uncertainties: bool,
    /// Where the data came from, by name.
    pub provenance: &'a BTreeMap<String, String>,
    /// Of the data that the points are of.
    pub checksum: String,
    /// What they are, for people.
    pub what: &'a str,
}

impl BirdFile<'_> {
    /// Writes it whole; what is to be said of it comes back.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(mut self, path: &Path) -> Result<Vec<Remark>, FileError> {
        self.points
            .retain(|p| p.value >= 0.0 && p.uncertainty.is_none_or(|u| u >= 0.0));
        let text = json!({ "metadata": self.metadata(), "data": self.data() });
        write_whole_bytes(path, text.to_string().as_bytes())?;
        Ok(vec![Remark::new(
            path.display(),
            "who measured, where and when is not stated: gonia does not know it",
            "write it into metadata (provenance, timestamp, sample)",
        )])
    }
}

/// The nodes nearest to rings of incidences, and nodes of views, in every channel.
fn points(dense: &DenseChannels, errors: Option<&DenseChannels>, rings: usize) -> Vec<Point> {
    let grid = dense.grid;
    let step = grid.step_deg();
    let n = grid.n_directions();
    let mut lights: Vec<usize> = (0..rings)
        .flat_map(|ring| {
            let theta = LAST_DEG * ring as f64 / (rings.max(2) - 1) as f64;
            let azimuths = if ring == 0 { 1 } else { (6 * ring).min(24) };
            (0..azimuths).map(move |k| (theta, 360.0 * k as f64 / azimuths as f64))
        })
        .filter_map(|(theta, phi)| grid.nearest(theta, phi))
        .collect();
    lights.sort_unstable();
    lights.dedup();
    let every = (VIEW_STEP_DEG / step).ceil().max(1.0) as usize;
    let views = (0..n).filter(|view| {
        let (ring, azimuth) = (view / grid.n_phi(), view % grid.n_phi());
        // At the pole one azimuth is as good as all.
        ring % every == 0
            && if ring == 0 {
                azimuth == 0
            } else {
                azimuth % every == 0
            }
    });
    let views: Vec<usize> = views.collect();
    let mut points = Vec::new();
    for (light, view) in lights
        .iter()
        .flat_map(|l| views.iter().map(move |v| (*l, *v)))
    {
        let cell = grid.cell(light, view);
        for (channel, plane) in dense.planes.iter().enumerate() {
            points.push(Point {
                light: grid.direction(light),
                view: grid.direction(view),
                channel,
                value: f64::from(plane[cell]),
                uncertainty: errors.map(|errors| f64::from(errors.planes[channel][cell])),
            });
        }
    }
    points
}

impl BirdFile<'_> {
    fn data(&self) -> Value {
        let array = |unit: &str, of: &dyn Fn(&Point) -> f64| {
            let values: Vec<Value> = self.points.iter().map(|p| shortest(of(p))).collect();
            json!({ "unit": unit, "values": values })
        };
        let mut data = Map::new();
        let mut put = |name: &str, value: Value| data.insert(name.to_owned(), value);
        put("theta_i", array("deg", &|p| p.light.theta_deg()));
        put("phi_i", array("deg", &|p| wrap_deg(p.light.phi_deg())));
        put("theta_r", array("deg", &|p| p.view.theta_deg()));
        put("phi_r", array("deg", &|p| wrap_deg(p.view.phi_deg())));
        put("BRDF", array("1/sr", &|p| p.value));
        if self.has_uncertainties {
            let mut u = array("1/sr", &|p| p.uncertainty.unwrap_or(0.0));
            u["comments"] = json!("combined standard uncertainty (k = 1)");
            put("uBRDF", u);
        }
        match self.channels {
            Channels::Single => {}
            Channels::Bands(wavelengths) => {
                let of = |p: &Point| wavelengths.get(p.channel).copied().unwrap_or(0.0);
                put("wavelength_i", array("nm", &of));
                put("wavelength_r", array("nm", &of));
            }
            Channels::Rgb => {
                let mut channel = array("", &|p| p.channel as f64);
                channel["description"] = json!("channel of linear sRGB: 0 red, 1 green, 2 blue");
                channel["type"] = json!("number");
                put("adhoc_variables", json!({ "channel": channel }));
            }
        }
        Value::Object(data)
    }

    fn metadata(&self) -> Value {
        let said: Vec<String> = self
            .provenance
            .iter()
            .map(|(k, v)| format!("{k}: {v}"))
            .collect();
        let material = self
            .provenance
            .get("material")
            .map_or(UNKNOWN, String::as_str);
        let kind = if self.has_uncertainties {
            "with"
        } else {
            "without"
        };
        json!({
            "schema": SCHEMA,
            "id": format!("urn:gonia:{}", self.checksum),
            "type": "BRDF",
            "timestamp": "1970-01-01T00:00:00Z",
            "description": format!("{}, {kind} standard uncertainties", self.what),
            "method": "measurement",
            "instrumentation": "NA",
            "environment": "NA",
            "software": { "name": "gonia", "comments": said.join("\n") },
            "comments": "timestamp, provenance and the sample's size were not stated",
            "provenance": {
                "organization": UNKNOWN,
                "email": "not.stated@example.invalid",
                "contact_person": UNKNOWN,
                "location": {
                    "country": UNKNOWN,
                    "city": UNKNOWN,
                    "street": UNKNOWN,
                    "building_nr": UNKNOWN,
                    "postal_code": UNKNOWN,
                },
            },
            "sample": {
                "name": material,
                "type": UNKNOWN,
                "shape": "flat",
                "dimensions": {},
                "zero_azimuth_location": "the sample's x axis; azimuths are anticlockwise, seen from above",
            },
        })
    }
}

/// A number in the fewest digits that single precision keeps.
fn shortest(value: f64) -> Value {
    let text = (value as f32).to_string();
    text.parse::<f64>()
        .map_or(Value::Null, |value| json!(value))
}

/// Reads such a file: its points in their order.
///
/// # Errors
/// One line naming the file and the key: no JSON, an array that is missing, of another length, of another unit or with
/// something else than numbers; an angle that is none.
fn read(path: &Path) -> Result<Vec<Point>, FileError> {
    let bytes = std::fs::read(path).map_err(|error| FileError::reading(path, &error))?;
    let file: Value = serde_json::from_slice(&bytes).map_err(|error| {
        FileError::new(
            path,
            format_args!("is not JSON: {error}"),
            "give a file of BiRD's format",
        )
    })?;
    let data = &file["data"];
    let values = data["BRDF"]["values"].as_array().map_or(0, Vec::len);
    let wrong = |name: &str, what: String, remedy: &str| {
        FileError::new(path, what, remedy).at(format_args!("data.{name}"))
    };
    let list = |name: &str, of: &Value| -> Result<Vec<f64>, FileError> {
        let list: Option<Vec<f64>> =
            (of["values"].as_array()).and_then(|list| list.iter().map(Value::as_f64).collect());
        list.filter(|list| list.len() == values).ok_or_else(|| {
            let what = format!("holds no list of {values} numbers, as many as data.BRDF");
            wrong(name, what, "give a file of BiRD's format")
        })
    };
    let angles = |name: &str| -> Result<Vec<f64>, FileError> {
        let unit = data[name]["unit"].as_str().unwrap_or("");
        let by = match unit {
            "deg" | "°" => 1.0,
            "rad" => 1f64.to_degrees(),
            _ => {
                return Err(wrong(
                    name,
                    format!("the unit \"{unit}\""),
                    "give rad or deg",
                ));
            }
        };
        Ok(list(name, &data[name])?
            .into_iter()
            .map(|x| by * x)
            .collect())
    };
    let unit = data["BRDF"]["unit"].as_str().unwrap_or("");
    if !["1/sr", "sr^-1"].contains(&unit) {
        return Err(wrong("BRDF", format!("the unit \"{unit}\""), "give 1/sr"));
    }
    let brdf = list("BRDF", &data["BRDF"])?;
    let [theta_i, phi_i, theta_v, phi_v] = ["theta_i", "phi_i", "theta_r", "phi_r"].map(angles);
    let (theta_i, phi_i, theta_v, phi_v) = (theta_i?, phi_i?, theta_v?, phi_v?);
    for (name, theta) in [("theta_i", &theta_i), ("theta_r", &theta_v)] {
        if let Some(theta) = theta.iter().find(|theta| !(0.0..90.0).contains(*theta)) {
            let what = format!("a polar angle of {theta} degrees");
            return Err(wrong(name, what, "give angles from 0 to below 90 degrees"));
        }
    }
    let uncertainty = match &data["uBRDF"] {
        Value::Null => None,
        u => {
            let shares = u["unit"].as_str() == Some("%");
            let list = list("uBRDF", u)?.into_iter().zip(&brdf);
            Some(
                list.map(|(u, f)| if shares { u * f / 100.0 } else { u })
                    .collect::<Vec<_>>(),
            )
        }
    };
    let channel = channels(data, &list)?;
    let point = |k: usize| Point {
        light: Direction::from_deg(theta_i[k], phi_i[k]),
        view: Direction::from_deg(theta_v[k], phi_v[k]),
        channel: channel.get(k).copied().unwrap_or(0),
        value: brdf[k],
        uncertainty: uncertainty.as_ref().map(|u| u[k]),
    };
    Ok((0..values).map(point).collect())
}

/// Reads the numbers of an array by its name and value.
type ReadList<'a> = dyn Fn(&str, &Value) -> Result<Vec<f64>, FileError> + 'a;

/// The number of each value's channel or band; none where there is one value a pair.
fn channels(data: &Value, list: &ReadList<'_>) -> Result<Vec<usize>, FileError> {
    let colours = &data["adhoc_variables"]["channel"];
    if !colours.is_null() {
        let numbers = list("adhoc_variables.channel", colours)?;
        return Ok(numbers.into_iter().map(|k| k as usize).collect());
    }
    if data["wavelength_i"].is_null() {
        return Ok(Vec::new());
    }
    let wavelengths = list("wavelength_i", &data["wavelength_i"])?;
    let mut known = wavelengths.clone();
    known.sort_by(f64::total_cmp);
    known.dedup();
    let place = |w: &f64| known.iter().position(|k| k == w).unwrap_or(0);
    Ok(wavelengths.iter().map(place).collect())
}

/// The same as samples: one value a pair, or three colours that follow each other.
fn read_samples(path: &Path) -> Result<Vec<Sample>, FileError> {
    let points = read(path)?;
    let last = points.iter().map(|p| p.channel).max().unwrap_or(0);
    let sample = |p: &Point, rgb: [f64; 3]| Sample::new(p.light, p.view, rgb.map(|v| v as f32));
    let samples: Vec<Sample> = match last {
        0 => points.iter().map(|p| sample(p, [p.value; 3])).collect(),
        2 => {
            let triples = points.chunks(3).filter_map(|three| match three {
                [r, g, b] if [r, g, b].map(|p| p.channel) == [0, 1, 2] => {
                    Some(sample(r, [r.value, g.value, b.value]))
                }
                _ => None,
            });
            triples.collect()
        }
        _ => Vec::new(),
    };
    if samples.is_empty() {
        return Err(FileError::new(
            path,
            format_args!(
                "holds {} values in {} channels or bands, no colours",
                points.len(),
                last + 1
            ),
            "one value a pair of directions is imported, or red, green and blue in this order",
        ));
    }
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::lopsided::{Lopsided, file};

    fn table(channels: Channels) -> DenseChannels {
        let dense: DenseChannels = file(&Lopsided, 6.0).into();
        let n = channels.count();
        DenseChannels {
            planes: dense.planes[..n].to_vec(),
            channels,
            ..dense
        }
    }

    #[test]
    fn every_point_is_a_node_with_its_value_and_uncertainty() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        for channels in [
            Channels::Rgb,
            Channels::Single,
            Channels::Bands(vec![450.0, 650.0]),
        ] {
            let dense = table(channels);
            let mut errors = dense.clone();
            errors.planes.iter_mut().flatten().for_each(|v| *v *= 0.03);
            write(&path, &dense, Some(&errors), 4).unwrap();
            let points = read(&path).unwrap();
            // At the pole a light, 6 · ring azimuths elsewhere; views 14 rings of 60 and the pole.
            assert_eq!(
                points.len(),
                (1 + 6 + 12 + 18) * (14 * 60 + 1) * dense.planes.len()
            );
            for p in points.iter().step_by(89) {
                let node = |d: Direction| dense.grid.nearest(d.theta_deg(), d.phi_deg()).unwrap();
                let cell = dense.grid.cell(node(p.light), node(p.view));
                let wanted = f64::from(dense.planes[p.channel][cell]);
                assert!((p.value / wanted - 1.0).abs() < 1e-6, "{p:?} {wanted}");
                let u = p.uncertainty.unwrap() / wanted;
                assert!((u - 0.03).abs() < 1e-6, "{p:?}");
            }
        }
        assert!(
            read_samples(&path)
                .unwrap_err()
                .to_string()
                .contains("in 2 channels or bands")
        );
        let dense = table(Channels::Rgb);
        assert_eq!(write(&path, &dense, None, 2).unwrap().len(), 2);
        let samples = read_samples(&path).unwrap();
        assert_eq!(samples.len(), 7 * 841);
        assert!((samples[900].rgb[2] - samples[900].rgb[0]).abs() > 1e-3);
    }

    #[test]
    fn what_cannot_be_read_is_refused_in_a_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        let list = |unit: &str, x: f64| json!({ "unit": unit, "values": [x, x] });
        let good = json!({ "data": {
            "theta_i": list("rad", 0.5), "phi_i": list("°", 30.0), "theta_r": list("deg", 60.0),
            "phi_r": list("deg", 210.0), "BRDF": list("sr^-1", 0.25), "uBRDF": list("%", 2.0),
        }});
        std::fs::write(&path, good.to_string()).unwrap();
        let point = read(&path).unwrap()[1];
        assert!((point.light.theta - 0.5).abs() < 1e-12);
        assert_eq!(point.uncertainty, Some(0.005));
        assert_eq!(read_samples(&path).unwrap()[0].rgb, [0.25; 3]);
        for (key, value, said) in [
            (
                "theta_i",
                list("deg", 95.0),
                "data.theta_i: a polar angle of 95 degrees",
            ),
            (
                "theta_i",
                list("grad", 5.0),
                "data.theta_i: the unit \"grad\"",
            ),
            (
                "phi_r",
                json!({ "unit": "deg", "values": [1] }),
                "data.phi_r: holds no list of 2 numbers",
            ),
            (
                "BRDF",
                list("%", 1.0),
                "data.BRDF: the unit \"%\"; give 1/sr",
            ),
        ] {
            let mut odd = good.clone();
            odd["data"][key] = value;
            std::fs::write(&path, odd.to_string()).unwrap();
            let error = read(&path).unwrap_err().to_string();
            assert!(
                error.contains(said) && error.lines().count() == 1,
                "{error}"
            );
        }
        std::fs::write(&path, "x").unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("is not JSON"));
    }
}
