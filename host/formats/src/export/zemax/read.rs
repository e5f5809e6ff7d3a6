//! Reading a Zemax file.

use super::about_specular;
use crate::FileError;
use crate::export::radiance::rgb_of;
use crate::format::{Content, ForeignBrdf, ForeignContent, ForeignFormat, Format, Gaps};
use crate::text_file::read_text;
use gonia_brdf::direction::Vec3;
use gonia_brdf::{Brdf, Direction};
use gonia_rig::Scale;
use std::path::Path;

/// The format, to be imported.
pub(crate) static FORMAT: Format = Format {
    name: "Zemax",
    endings: &["bsdf"],
    magic: &[],
    content: Content::Foreign(ForeignFormat {
        name: "Zemax .bsdf",
        content: ForeignContent::Brdf {
            scale: Some(Scale::Absolute),
            read,
        },
    }),
};

/// Lists of angles before the values, outermost first.
const AXES: [&str; 4] = [
    "SampleRotation",
    "AngleOfIncidence",
    "ScatterAzimuth",
    "ScatterRadial",
];
/// Blocks of values: one, or three.
const MONOCHROME: &str = "Monochrome";
const XYZ: [&str; 3] = ["TristimulusX", "TristimulusY", "TristimulusZ"];

/// A file's values.
struct Zemax {
    /// Turns, incidences, azimuths, radial angles, degrees, each rising.
    axes: [Vec<f64>; 4],
    /// Whether azimuths beyond the last one are those mirrored.
    is_mirrored: bool,
    /// One, or X, Y and Z.
    blocks: Vec<Vec<f32>>,
}

/// What is left of a file.
struct Lines<'a> {
    path: &'a Path,
    lines: Vec<(usize, &'a str)>,
    at: usize,
}

impl<'a> Lines<'a> {
    fn next(&mut self) -> Result<&'a str, FileError> {
        let line = self.lines.get(self.at);
        self.at += 1;
        line.map(|(_, text)| *text).ok_or_else(|| {
            FileError::new(
                self.path,
                "ends before its values do",
                "copy the file again",
            )
        })
    }

    /// What is wrong with the line that was read last.
    fn wrong(&self, what: String, remedy: &str) -> FileError {
        let line = self.lines.get(self.at.saturating_sub(1));
        FileError::new(self.path, what, remedy).at(format_args!(
            "line {}",
            line.map_or(0, |(number, _)| *number)
        ))
    }

    fn numbers(&self, line: &str, n: usize) -> Result<Vec<f64>, FileError> {
        let numbers: Option<Vec<f64>> = line
            .split_whitespace()
            .map(|word| word.parse().ok().filter(|v: &f64| v.is_finite()))
            .collect();
        match numbers {
            Some(numbers) if numbers.len() == n => Ok(numbers),
            Some(numbers) => Err(self.wrong(
                format!("{} numbers where {n} are due", numbers.len()),
                "copy the file again",
            )),
            None => Err(self.wrong("holds what is no number".into(), "write numbers")),
        }
    }
}

/// Reads a file.
///
/// # Errors
/// One line naming file and line: a key that is unknown, a list or a row of another length, no BRDF.
pub fn read(path: &Path) -> Result<Box<dyn ForeignBrdf>, FileError> {
    let text = read_text(path)?;
    let lines = text
        .lines()
        .enumerate()
        .map(|(k, line)| (k + 1, line.trim()));
    let is_data = |(_, line): &(usize, &str)| !line.is_empty() && !line.starts_with('#');
    let mut lines = Lines {
        path,
        lines: lines.filter(is_data).collect(),
        at: 0,
    };
    let mut axes: [Vec<f64>; 4] = Default::default();
    let mut is_mirrored = false;
    let mut wanted: Vec<&str> = vec![MONOCHROME];
    while axes.iter().any(Vec::is_empty) {
        let line = lines.next()?;
        let (key, value) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let value = value.trim();
        match (key, value.to_ascii_lowercase().as_str()) {
            ("Source", _) => {}
            ("Symmetry", "planesymmetrical") => is_mirrored = true,
            ("Symmetry", "asymmetrical" | "asymmetrical4d") => is_mirrored = false,
            ("SpectralContent", "monochrome") => wanted = vec![MONOCHROME],
            ("SpectralContent", "xyz") => wanted = XYZ.to_vec(),
            ("ScatterType", "brdf") => {}
            _ => {
                let axis = AXES.iter().position(|axis| *axis == key);
                let (Some(axis), Ok(n @ 1..=100_000)) = (axis, value.parse::<usize>()) else {
                    return Err(lines.wrong(
                        format!("\"{line}\" is none of what begins a Zemax BRDF"),
                        "give a file with Symmetry, SpectralContent, ScatterType BRDF and four lists of angles",
                    ));
                };
                let list = lines.next()?;
                axes[axis] = lines.numbers(list, n)?;
                if !axes[axis].windows(2).all(|pair| pair[0] < pair[1]) {
                    return Err(lines.wrong(format!("{key} does not rise"), "sort the angles"));
                }
            }
        }
    }
    let blocks: Result<Vec<Vec<f32>>, FileError> = wanted
        .iter()
        .map(|name| block(&mut lines, name, &axes))
        .collect();
    Ok(Box::new(Zemax {
        axes,
        is_mirrored,
        blocks: blocks?,
    }))
}

fn block(lines: &mut Lines<'_>, name: &str, axes: &[Vec<f64>; 4]) -> Result<Vec<f32>, FileError> {
    for wanted in [name, "DataBegin"] {
        let line = lines.next()?;
        if line != wanted {
            return Err(lines.wrong(
                format!("\"{line}\" where {wanted} is due"),
                "copy the file again",
            ));
        }
    }
    let mut values = Vec::new();
    for _ in 0..axes[0].len() * axes[1].len() {
        let line = lines.next()?;
        if !line.starts_with("TIS") {
            return Err(lines.wrong(
                format!("\"{line}\" where TIS is due"),
                "copy the file again",
            ));
        }
        for _ in 0..axes[2].len() {
            let line = lines.next()?;
            let row = lines.numbers(line, axes[3].len())?;
            if row.iter().any(|value| *value < 0.0) {
                return Err(lines.wrong("a value below 0".into(), "copy the file again"));
            }
            values.extend(row.iter().map(|value| *value as f32));
        }
    }
    match lines.next()? {
        "DataEnd" => Ok(values),
        line => Err(lines.wrong(
            format!("\"{line}\" where DataEnd is due"),
            "copy the file again",
        )),
    }
}

/// The nodes beside a value with their shares; the last one beyond the ends, or around the circle where the list
/// covers less than it.
fn between(nodes: &[f64], value: f64, is_circle: bool) -> [(usize, f64); 2] {
    let (n, first, last) = (nodes.len(), nodes[0], nodes[nodes.len() - 1]);
    if is_circle && last - first < 360.0 - 1e-9 && !(first..=last).contains(&value) {
        let gap = 360.0 - (last - first);
        let past = (value - last).rem_euclid(360.0) / gap;
        return [(n - 1, 1.0 - past), (0, past)];
    }
    let above = nodes.partition_point(|node| *node <= value).min(n - 1);
    let below = above.saturating_sub(1);
    if above == below {
        return [(below, 1.0), (above, 0.0)];
    }
    let share = ((value - nodes[below]) / (nodes[above] - nodes[below])).clamp(0.0, 1.0);
    [(below, 1.0 - share), (above, share)]
}

impl Brdf for Zemax {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let light = Direction::from_vec3(light);
        let [radial, azimuth] = about_specular(light, view).map(f64::to_degrees);
        let azimuth = if self.is_mirrored {
            azimuth.abs()
        } else {
            azimuth.rem_euclid(360.0)
        };
        let [turns, incidences, azimuths, radials] = &self.axes;
        let nodes = [
            between(turns, light.phi_deg(), turns.len() > 1),
            between(incidences, light.theta_deg(), false),
            between(azimuths, azimuth, !self.is_mirrored),
            between(radials, radial, false),
        ];
        let mut sums = vec![0.0; self.blocks.len()];
        for corner in 0..16 {
            let (mut at, mut share) = (0, 1.0);
            for (axis, pair) in nodes.iter().enumerate() {
                let (node, of_axis) = pair[corner >> axis & 1];
                at = at * self.axes[axis].len() + node;
                share *= of_axis;
            }
            if share > 0.0 {
                for (sum, block) in sums.iter_mut().zip(&self.blocks) {
                    *sum += share * f64::from(block[at]);
                }
            }
        }
        match sums[..] {
            [x, y, z] => rgb_of([x, y, z]),
            _ => [sums[0]; 3],
        }
    }
}

impl ForeignBrdf for Zemax {
    fn gaps(&self) -> Option<Gaps> {
        None
    }

    fn last_deg(&self) -> f64 {
        self.axes[1].last().copied().unwrap_or(90.0).min(90.0)
    }
}
