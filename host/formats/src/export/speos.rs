//! Speos (Ansys) `.anisotropicbsdf`, text, version 8.0.
//!
//! A header line by line: name and version, `0` (text), a comment, the letters of a description and the description, the
//! anisotropy vector, `1 0` (reflection, no transmission), `1` (values are of the BSDF), the turns of the sample, the
//! incidences of each, the reference's incidence and azimuth, a comment, the spectrum. Then a block a turn and incidence:
//! `nθ nφ`, the azimuths, a row a polar angle; `End of file`. Polar angles are from the normal; azimuth 0 is the specular
//! side, anticlockwise. The program scales all values so that the block of the reference's incidence scatters the share
//! that the spectrum says: written is what the table scatters there. Which way a turn goes is not settled by the
//! description that is known: it is taken as the azimuth of the light from the anisotropy vector, which is the x axis.

use super::{ExportFormat, ExportSettings, Holds, How, Meaning, Resolution};
use crate::text_file::read_text;
use crate::{FileError, write_whole};
use gonia_brdf::{Direction, Elementary, Sample};
use gonia_rig::{DenseFile, Remark};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

/// How it is exported.
pub(super) static EXPORT: ExportFormat = ExportFormat {
    name: "speos",
    title: "Speos .anisotropicbsdf",
    ending: "anisotropicbsdf",
    readers: "Ansys Speos (not tried)",
    means: Meaning::Absolute,
    holds: Holds::One,
    angles: "turns of the sample every 15°, incidences every 5° up to 85°, views every 3° up to 87°",
    provenance: Some("the description"),
    is_folder: false,
    resolution: Some(Resolution {
        default: 72,
        least: 12,
        most: 180,
        of: "azimuths of the views",
    }),
    step_deg: |azimuths| 360.0 / azimuths as f64,
    how: How::Samples { write, read },
};

const NAME: &str = "OPTIS - Anisotropic BSDF surface file v8.0";
const END: &str = "End of file";
/// Steps and last ones, degrees.
const TURN_STEP_DEG: usize = 15;
const INCIDENCE_STEP_DEG: usize = 5;
const LAST_INCIDENCE_DEG: usize = 85;
const VIEW_STEP_DEG: usize = 3;
const LAST_VIEW_DEG: usize = 87;
/// Bands of equal projected solid angle, and azimuths, by which light is gathered.
const GATHER: [usize; 2] = [32, 64];

fn degrees(last: usize, step: usize) -> Vec<f64> {
    (0..=last).step_by(step).map(|k| k as f64).collect()
}

fn write(
    path: &Path,
    file: &DenseFile,
    settings: &ExportSettings,
) -> Result<Vec<Remark>, FileError> {
    let turns = degrees(360 - TURN_STEP_DEG, TURN_STEP_DEG);
    let incidences = degrees(LAST_INCIDENCE_DEG, INCIDENCE_STEP_DEG);
    let thetas = degrees(LAST_VIEW_DEG, VIEW_STEP_DEG);
    let n = settings.resolution;
    let phis: Vec<f64> = (0..=n).map(|k| 360.0 * k as f64 / n as f64).collect();
    let said: Vec<String> = (file.provenance.iter())
        .map(|(name, value)| crate::one_line(&format!("{name} = {value}")))
        .collect();
    let said = format!("gonia: {}", said.join(", "));
    let list = |values: &[f64]| {
        values
            .iter()
            .map(f64::to_string)
            .collect::<Vec<_>>()
            .join("\t")
    };
    let mut head = format!(
        "{NAME}\n0\nwritten by gonia\n{}\n{said}\n1\t0\t0\n1\t0\n1\n{}\n{}\n",
        said.chars().count(),
        turns.len(),
        list(&turns)
    );
    for _ in &turns {
        let _ = writeln!(head, "{}\n{}", incidences.len(), list(&incidences));
    }
    let percent = 100.0 * scattered(file, Direction::from_deg(0.0, 0.0));
    let _ = writeln!(
        head,
        "0\t0\nflat spectrum\n2\n350\t{percent}\n850\t{percent}"
    );
    let lights = turns
        .iter()
        .flat_map(|turn| incidences.iter().map(move |theta| (*theta, *turn)));
    let lights: Vec<(f64, f64)> = lights.collect();
    let block = |(theta_i, turn): &(f64, f64)| {
        let light = Direction::from_deg(*theta_i, *turn);
        let mut text = format!("{} {}\n\t{}\n", thetas.len(), phis.len(), list(&phis));
        for theta in &thetas {
            let _ = write!(text, "{theta}");
            for phi in &phis {
                let view = Direction::from_deg(*theta, turn + 180.0 + phi);
                let [value, _, _] = file.brdf.lookup(light, view);
                let _ = write!(text, "\t{value:.5e}");
            }
            text.push('\n');
        }
        text
    };
    let blocks: Vec<String> = lights.par_iter().map(block).collect();
    write_whole(path, |out| {
        out.write_all(head.as_bytes())?;
        blocks
            .iter()
            .try_for_each(|block| out.write_all(block.as_bytes()))?;
        writeln!(out, "{END}")
    })?;
    Ok(Vec::new())
}

/// The share of the light that is scattered: ∫ f cos θv dω.
fn scattered(file: &DenseFile, light: Direction) -> f64 {
    let [bands, around] = GATHER;
    let mut sum = 0.0;
    for k in 0..bands * around {
        let sine2 = ((k / around) as f64 + 0.5) / bands as f64;
        let view = Direction {
            theta: sine2.sqrt().arc_sine(),
            phi: TAU * ((k % around) as f64 + 0.5) / around as f64,
        };
        let [value, _, _] = file.brdf.lookup(light, view);
        sum += f64::from(value) * PI / (bands * around) as f64;
    }
    sum
}

/// Reads what [`write`] wrote: a sample a value.
///
/// # Errors
/// One line naming the file and the line: another version, a number that is missing, an end that is missing.
fn read(path: &Path) -> Result<Vec<Sample>, FileError> {
    let text = read_text(path)?;
    let wrong = |line: usize, what: &str| {
        FileError::new(path, what, "write it again with gonia export")
            .at(format_args!("line {}", line + 1))
    };
    let lines: Vec<&str> = text.lines().collect();
    let numbers = |line: usize| -> Result<Vec<f64>, FileError> {
        let text = lines
            .get(line)
            .ok_or_else(|| wrong(line, "the file ends too early"))?;
        let parsed: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
        parsed.map_err(|_| wrong(line, "holds something else than numbers"))
    };
    if lines.first() != Some(&NAME) {
        return Err(wrong(0, "is not the header of version 8.0"));
    }
    let turns = numbers(9)?;
    let mut incidences = Vec::new();
    for k in 0..turns.len() {
        incidences.push(numbers(11 + 2 * k)?);
    }
    // The reference, a comment, the count of the spectrum and its lines.
    let mut line = 10 + 2 * turns.len() + 2;
    let spectrum = numbers(line)?.first().map_or(0, |n| *n as usize);
    line += 1 + spectrum;
    let mut samples = Vec::new();
    for (turn, thetas_i) in turns.iter().zip(&incidences) {
        for theta_i in thetas_i {
            let size = numbers(line)?;
            let phis = numbers(line + 1)?;
            let rows = size.first().map_or(0, |n| *n as usize);
            for row in 0..rows {
                let at = line + 2 + row;
                let row = numbers(at)?;
                let (Some((theta, values)), true) =
                    (row.split_first(), row.len() == phis.len() + 1)
                else {
                    return Err(wrong(at, "has not a value an azimuth"));
                };
                let light = Direction::from_deg(*theta_i, *turn);
                samples.extend(phis.iter().zip(values).map(|(phi, value)| {
                    let view = Direction::from_deg(*theta, turn + 180.0 + phi);
                    Sample::new(light, view, [*value as f32; 3])
                }));
            }
            line += 2 + rows;
        }
    }
    if lines.get(line) != Some(&END) {
        return Err(wrong(line, "is not the end of the file"));
    }
    Ok(samples)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::lopsided::{Lopsided, file, settings};
    use gonia_brdf::Brdf;

    /// Another way through the file: every word in its order, and directions by vectors from the specular side.
    #[test]
    fn a_second_reader_finds_the_function_in_every_block() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.anisotropicbsdf");
        let table = file(&Lopsided, 3.0);
        write(&path, &table, &settings(24, true)).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let (head, rest) = text.split_once("\n1\t0\t0\n").unwrap();
        let head: Vec<&str> = head.lines().collect();
        assert_eq!(head[3].parse(), Ok(head[4].chars().count()));
        assert_eq!(rest.lines().last(), Some("End of file"));
        let rest = rest.replacen("flat spectrum\n", "", 1);
        let mut words = rest.split_whitespace().map_while(|w| w.parse::<f64>().ok());
        let mut next = move || words.next().unwrap();
        assert_eq!([next(), next(), next()], [1.0, 0.0, 1.0]);
        let n = next() as usize;
        let turns: Vec<f64> = (0..n).map(|_| next()).collect();
        let mut incidences = Vec::new();
        for _ in &turns {
            let n = next() as usize;
            incidences.push((0..n).map(|_| next()).collect::<Vec<_>>());
        }
        let _reference = [next(), next()];
        let spectrum: Vec<f64> = (0..2 * next() as usize).map(|_| next()).collect();
        // Of the light from the normal Lopsided scatters, by a finer sum, its green.
        let mut sum = 0.0;
        for (k, j) in (0..200).flat_map(|k| (0..200).map(move |j| (k, j))) {
            let theta = ((f64::from(k) + 0.5) / 200.0).sqrt().arc_sine();
            let phi = TAU * (f64::from(j) + 0.5) / 200.0;
            let view = Direction { theta, phi }.to_vec3();
            sum += PI * Lopsided.eval([0.0, 0.0, 1.0], view)[0] / 40_000.0;
        }
        assert!(
            (spectrum[1] / (100.0 * sum) - 1.0).abs() < 0.02,
            "{spectrum:?} {sum}"
        );
        let mut errors = Vec::new();
        for (turn, thetas_i) in turns.iter().zip(&incidences) {
            for theta_i in thetas_i {
                let (rows, columns) = (next() as usize, next() as usize);
                let phis: Vec<f64> = (0..columns).map(|_| next()).collect();
                let (s, c) = turn.to_radians().sine_cosine();
                let light = Direction::from_deg(*theta_i, *turn).to_vec3();
                // The specular side, and its left hand seen from above.
                let (along, left) = ([-c, -s], [s, -c]);
                for _ in 0..rows {
                    let (sine, cosine) = next().to_radians().sine_cosine();
                    for phi in &phis {
                        let (sp, cp) = phi.to_radians().sine_cosine();
                        let xy = [0, 1].map(|k| sine * (cp * along[k] + sp * left[k]));
                        let value = next();
                        if cosine > 0.1 && light[2] > 0.1 {
                            let wanted = Lopsided.eval(light, [xy[0], xy[1], cosine])[0];
                            errors.push((value / wanted).natural_log().abs());
                        }
                    }
                }
            }
        }
        errors.sort_by(f64::total_cmp);
        let p99 = errors[errors.len() * 99 / 100];
        assert!(p99 < 0.02, "{p99}");
        assert_eq!(read(&path).unwrap().len(), 24 * 18 * 30 * 25);
    }

    #[test]
    fn a_file_that_is_cut_short_is_refused_in_a_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.anisotropicbsdf");
        write(&path, &file(&Lopsided, 15.0), &settings(12, true)).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        for (text, said) in [
            (text.replace("v8.0", "v7.0"), "line 1: is not the header"),
            (text.replace("End of file", ""), "is not the end"),
            (text[..text.len() / 2].to_owned(), "line "),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = read(&path).unwrap_err().to_string();
            assert!(
                error.contains(said) && error.lines().count() == 1,
                "{error}"
            );
        }
    }
}
