//! Writing a Zemax file.

use super::view_at;
use crate::export::ExportSettings;
use crate::export::radiance::xyz_of;
use crate::{FileError, write_whole};
use gonia_brdf::{Direction, Elementary};
use gonia_rig::{DenseFile, Remark};
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

/// Radial angles, degrees: close about the specular direction.
const RADIALS_DEG: [f64; 28] = [
    0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 7.0, 9.0, 12.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0,
    60.0, 70.0, 80.0, 90.0, 100.0, 110.0, 120.0, 130.0, 145.0, 160.0, 175.0,
];
/// Steps of turns and incidences, degrees, and the last incidence.
const ROTATION_STEP_DEG: usize = 15;
const INCIDENCE_STEP_DEG: usize = 5;
const LAST_INCIDENCE_DEG: usize = 85;
/// Bands of equal projected solid angle, and azimuths, by which light is gathered.
const GATHER: [usize; 2] = [16, 32];

/// Writes a file whole, asymmetric in all four angles.
///
/// # Errors
/// When it cannot be written.
pub fn write(
    path: &Path,
    file: &DenseFile,
    settings: &ExportSettings,
) -> Result<Vec<Remark>, FileError> {
    let rotations: Vec<f64> = (0..=360)
        .step_by(ROTATION_STEP_DEG)
        .map(f64::from)
        .collect();
    let incidences: Vec<f64> = (0..=LAST_INCIDENCE_DEG)
        .step_by(INCIDENCE_STEP_DEG)
        .map(|k| k as f64)
        .collect();
    let n = settings.resolution;
    let azimuths: Vec<f64> = (0..=n).map(|k| 360.0 * k as f64 / n as f64).collect();
    let lights: Vec<Direction> = rotations
        .iter()
        .flat_map(|phi| {
            incidences
                .iter()
                .map(|theta| Direction::from_deg(*theta, *phi))
        })
        .collect();
    let blocks: Vec<[String; 3]> = lights
        .par_iter()
        .map(|light| of_light(file, *light, &azimuths))
        .collect();
    let mut head = format!("# scale = {}\n", file.scale);
    for (name, value) in &file.provenance {
        let _ = writeln!(head, "# {name} = {}", crate::one_line(value));
    }
    let (content, names): (_, &[(usize, &str)]) = if settings.is_one_value {
        ("Monochrome", &[(1, "Monochrome")])
    } else {
        (
            "XYZ",
            &[
                (0, "TristimulusX"),
                (1, "TristimulusY"),
                (2, "TristimulusZ"),
            ],
        )
    };
    let _ = writeln!(
        head,
        "Source  Measured\nSymmetry  Asymmetrical4D\nSpectralContent  {content}\nScatterType  BRDF"
    );
    for (name, values) in [
        ("SampleRotation", &rotations[..]),
        ("AngleOfIncidence", &incidences),
        ("ScatterAzimuth", &azimuths),
        ("ScatterRadial", &RADIALS_DEG),
    ] {
        let _ = writeln!(head, "{name}  {}", values.len());
        for value in values {
            let _ = write!(head, "{value}\t");
        }
        head.push('\n');
    }
    write_whole(path, |out| {
        out.write_all(head.as_bytes())?;
        for (place, name) in names {
            write!(out, "\n{name}\nDataBegin\n")?;
            for block in &blocks {
                out.write_all(block[*place].as_bytes())?;
            }
            out.write_all(b"DataEnd\n")?;
        }
        Ok(())
    })?;
    Ok(Vec::new())
}

/// X, Y and Z of one light: all that is scattered, then a row an azimuth.
fn of_light(file: &DenseFile, light: Direction, azimuths: &[f64]) -> [String; 3] {
    let value = |view| xyz_of(file.brdf.lookup(light, view).map(f64::from));
    let mut total = [0.0; 3];
    let [bands, around] = GATHER;
    for k in 0..bands * around {
        let sine = ((k / around) as f64 + 0.5) / bands as f64;
        let view = Direction {
            theta: sine.sqrt().arc_sine(),
            phi: TAU * ((k % around) as f64 + 0.5) / around as f64,
        };
        let xyz = value(view);
        for c in 0..3 {
            // f·cos dω: π of projected solid angle in equal parts.
            total[c] += xyz[c] * 0.5 * TAU / (bands * around) as f64;
        }
    }
    let mut text = total.map(|total| format!("TIS {total:.5e}\n"));
    for azimuth in azimuths {
        for radial in RADIALS_DEG {
            let view = view_at(light, radial.to_radians(), azimuth.to_radians());
            let xyz = if view[2] > 0.0 {
                value(Direction::from_vec3(view))
            } else {
                [0.0; 3]
            };
            for c in 0..3 {
                let _ = write!(text[c], "{:.4e}\t", xyz[c]);
            }
        }
        text.iter_mut().for_each(|text| text.push('\n'));
    }
    text
}
