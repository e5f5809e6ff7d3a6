//! Text of a goniophotometer of pab advanced technologies (pgII): a file an incidence, of rows `theta phi BRDF`.
//!
//! Radiance's `pabopto2bsdf` takes such files. `#upphi 90` leaves azimuths as they are; all four quadrants say that
//! the material is anisotropic.

use super::folder::write_whole_folder;
use super::{ExportFormat, ExportSettings, Holds, How, Meaning, Resolution};
use crate::FileError;
use crate::format::{Content, ForeignContent, ForeignFormat, Format};
use crate::text_file::read_text;
use gonia_brdf::{Direction, Sample};
use gonia_rig::{DenseFile, Remark, Scale};
use std::fmt::Write;
use std::io;
use std::path::Path;

/// How it is exported.
pub(super) static EXPORT: ExportFormat = ExportFormat {
    name: "pab",
    title: "pab text (pgII)",
    ending: "pab",
    readers: "Radiance (`pabopto2bsdf`), Tekari; a folder of one file an incidence",
    means: Meaning::Absolute,
    holds: Holds::One,
    angles: "incidences on rings up to 75°, views every 4° or the table's step up to its last",
    provenance: Some("comments at the top of each file"),
    is_folder: true,
    resolution: Some(Resolution {
        default: 6,
        least: 3,
        most: 16,
        of: "rings of incidences",
    }),
    step_deg: |rings| LAST_DEG / (rings.max(2) - 1) as f64,
    how: How::Samples { write, read },
};

/// How it is imported: a file an incidence or a folder of them, with the ending `.pab`.
pub(crate) static FORMAT: Format = Format {
    name: "pab text",
    endings: &["pab"],
    magic: &[],
    content: Content::Foreign(ForeignFormat {
        name: "pab text (pgII)",
        content: ForeignContent::Samples {
            scale: Some(Scale::Absolute),
            read,
        },
    }),
};

/// Polar angle of the last ring of incidences.
const LAST_DEG: f64 = 75.0;
/// Least step of the views, degrees.
const VIEW_STEP_DEG: f64 = 4.0;

fn write(
    path: &Path,
    file: &DenseFile,
    settings: &ExportSettings,
) -> Result<Vec<Remark>, FileError> {
    write_whole_folder(path, |folder| {
        for light in incidences(settings.resolution) {
            let name = format!("i{:05.1}_{:05.1}.txt", light.theta_deg(), light.phi_deg());
            std::fs::write(folder.join(name), text(file, light))?;
        }
        io::Result::Ok(())
    })?;
    Ok(Vec::new())
}

/// The normal, and rings with as many azimuths as keep their distance.
fn incidences(rings: usize) -> Vec<Direction> {
    let step = LAST_DEG / (rings - 1) as f64;
    let of_ring = |ring: usize| {
        // A hexagonal pattern about the normal; not more azimuths than four a quadrant need.
        let n = if ring == 0 { 1 } else { (6 * ring).min(24) };
        (0..n).map(move |k| Direction::from_deg(step * ring as f64, 360.0 * k as f64 / n as f64))
    };
    (0..rings).flat_map(of_ring).collect()
}

fn text(file: &DenseFile, light: Direction) -> String {
    let grid = file.brdf.grid();
    let step = grid.step_deg() * (VIEW_STEP_DEG / grid.step_deg()).ceil().max(1.0);
    let last = grid.direction(grid.n_directions() - 1).theta_deg();
    let (rings, azimuths) = (
        (last / step + 1e-6).floor() as usize + 1,
        (360.0 / step).round() as usize,
    );
    let mut rows = String::new();
    let mut n = 0;
    for ring in 0..rings {
        for k in 0..if ring == 0 { 1 } else { azimuths } {
            let (theta, phi) = (ring as f64 * step, k as f64 * 360.0 / azimuths as f64);
            let [value, _, _] = file.brdf.lookup(light, Direction::from_deg(theta, phi));
            // Writing to a string cannot fail.
            let _ = writeln!(rows, "{theta:.3} {phi:.3} {value:.5e}");
            n += 1;
        }
    }
    let material = file.provenance.get("material").map_or("material", |m| m);
    let mut text = format!(
        "#sample_name \"{}\"\n",
        crate::one_line(material).replace('"', "'")
    );
    for (name, value) in &file.provenance {
        let _ = writeln!(text, "#gonia {name} = {}", crate::one_line(value));
    }
    let _ = write!(
        text,
        "#format: theta phi BRDF\n#intheta {:.3}\n#inphi {:.3}\n#upphi 90\n#colorimetry: CIE-Y\n#datapoints_in_file {n}\n{rows}",
        light.theta_deg(),
        light.phi_deg()
    );
    text
}

/// Reads a folder of such files, in the order of their names, or one of them.
///
/// # Errors
/// One line naming the file and the line: what is no number, a direction that is not above the surface, a file without
/// an incidence.
pub(crate) fn read(path: &Path) -> Result<Vec<Sample>, FileError> {
    let failed = |error: io::Error| FileError::reading(path, &error);
    if path.is_file() {
        let mut samples = read_file(path)?;
        for sample in &mut samples {
            *sample = sample.in_frame(0);
        }
        return not_empty(path, samples);
    }
    let entries: io::Result<Vec<_>> = std::fs::read_dir(path).map_err(failed)?.collect();
    let mut files: Vec<_> = entries.map_err(failed)?.iter().map(|e| e.path()).collect();
    files.sort();
    let mut samples = Vec::new();
    for (frame, file) in files.iter().enumerate() {
        let read = read_file(file)?;
        samples.extend(read.into_iter().map(|sample| sample.in_frame(frame as u32)));
    }
    not_empty(path, samples)
}

fn not_empty(path: &Path, samples: Vec<Sample>) -> Result<Vec<Sample>, FileError> {
    if samples.is_empty() {
        let problem = "holds no row of a measurement";
        return Err(FileError::new(
            path,
            problem,
            "give the text files of one sample",
        ));
    }
    Ok(samples)
}

fn read_file(path: &Path) -> Result<Vec<Sample>, FileError> {
    let text = read_text(path)?;
    let wrong = |line: usize, what: String, remedy: &str| {
        FileError::new(path, what, remedy).at(format_args!("line {}", line + 1))
    };
    let (mut theta_i, mut phi_i, mut is_dsf) = (None, None, false);
    let mut samples = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |word: Option<&&str>| -> Result<f64, FileError> {
            let parsed = word.and_then(|word| word.parse().ok());
            parsed.filter(|v: &f64| v.is_finite()).ok_or_else(|| {
                wrong(
                    k,
                    format!("\"{line}\" holds no number where one is due"),
                    "write one",
                )
            })
        };
        match words[..] {
            ["#intheta", ..] => theta_i = Some(number(words.get(1))?),
            ["#inphi", ..] => phi_i = Some(number(words.get(1))?),
            ["#upphi", up, ..] if up != "90" && up.parse() != Ok(90.0) => {
                return Err(wrong(
                    k,
                    format!("#upphi {up}"),
                    "only 90, which leaves azimuths as they are, is read",
                ));
            }
            ["#format:", "theta", "phi", "BRDF"] => is_dsf = false,
            ["#format:", "theta", "phi", "DSF"] => is_dsf = true,
            ["#format:", ..] => {
                return Err(wrong(
                    k,
                    line.to_owned(),
                    "only theta phi BRDF, and DSF in its place, are read",
                ));
            }
            [] => {}
            [word, ..] if word.starts_with('#') => {}
            _ => {
                let [theta, phi, value] = [0, 1, 2].map(|at| number(words.get(at)));
                let (theta, phi, value) = (theta?, phi?, value?);
                let (Some(theta_i), Some(phi_i)) = (theta_i, phi_i) else {
                    return Err(wrong(
                        k,
                        "a row before #intheta and #inphi".into(),
                        "name the incidence first",
                    ));
                };
                // What went through the sample is another quantity.
                if theta >= 90.0 {
                    continue;
                }
                let (light, view) = (
                    Direction::from_deg(theta_i, phi_i),
                    Direction::from_deg(theta, phi),
                );
                if !(0.0..90.0).contains(&theta_i) || theta < 0.0 {
                    return Err(wrong(
                        k,
                        format!("a polar angle of {theta_i} or {theta}"),
                        "give angles from 0 to 90 degrees",
                    ));
                }
                let by = if is_dsf { 1.0 / view.to_vec3()[2] } else { 1.0 };
                samples.push(Sample::new(light, view, [(value * by) as f32; 3]));
            }
        }
    }
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::lopsided::{Lopsided, file, settings};

    #[test]
    fn every_row_is_the_value_at_its_directions_and_dsf_is_divided_by_the_cosine() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.pab");
        let table = file(&Lopsided, 6.0);
        write(&path, &table, &settings(4, true)).unwrap();
        let samples = read(&path).unwrap();
        assert_eq!(samples.len(), (1 + 6 + 12 + 18) * (14 * 60 + 1));
        for s in samples.iter().step_by(97) {
            let at = |t: f32, p: f32| Direction::from_deg(t.into(), p.into());
            let (light, view) = (
                at(s.theta_i_deg, s.phi_i_deg),
                at(s.theta_v_deg, s.phi_v_deg),
            );
            let [wanted, _, _] = table.brdf.lookup(light, view);
            assert!((s.rgb[0] / wanted - 1.0).abs() < 1e-4, "{s:?}");
        }
        let one = path.join("i025.0_060.0.txt");
        let text = std::fs::read_to_string(&one).unwrap();
        assert!(text.contains("#datapoints_in_file 841\n"), "{text}");
        let before = read_file(&one).unwrap();
        std::fs::write(&one, text.replace("phi BRDF", "phi DSF")).unwrap();
        let after = read_file(&one).unwrap();
        for (a, b) in before.iter().zip(&after) {
            let cosine = Direction::from_deg(a.theta_v_deg.into(), 0.0).to_vec3()[2] as f32;
            assert!((b.rgb[0] * cosine / a.rgb[0] - 1.0).abs() < 1e-5);
        }
        for (from, to, said) in [
            ("#upphi 90", "#upphi 0", "line 6: #upphi 0; only 90"),
            ("#intheta 25.000\n", "", "a row before #intheta"),
            ("phi BRDF", "phi CIE-XYZ", "only theta phi BRDF"),
            ("6.000 0.000", "6.000 x", "holds no number"),
        ] {
            std::fs::write(&one, text.replace(from, to)).unwrap();
            let error = read(&path).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
    }
}
