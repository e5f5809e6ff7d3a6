//! MERL `.binary`: the isotropic mean at half and difference angles, in the layout of [`crate::merl`].

use super::radiance::of_anisotropy;
use super::{ExportFormat, ExportSettings, Holds, How, Meaning};
use crate::merl::{N_DIFF, N_HALF, N_PHI, PLANE, SCALE, read};
use crate::{FileError, write_whole};
use gonia_brdf::direction::Vec3;
use gonia_brdf::{Direction, Elementary, IsotropicMean};
use gonia_rig::{DenseFile, Remark};
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};
use std::io::Write;
use std::path::Path;

/// How it is exported.
pub(super) static EXPORT: ExportFormat = ExportFormat {
    name: "merl",
    title: "MERL .binary",
    ending: "binary",
    readers: "BRDF Explorer; `gonia import`",
    means: Meaning::Absolute,
    holds: Holds::Colours,
    angles: "isotropic: the mean over turns of the sample; 90 half, 90 difference angles, 180 azimuths",
    provenance: None,
    is_folder: false,
    resolution: None,
    step_deg: |_| 1.0,
    how: How::Brdf { write, read },
};

fn write(path: &Path, file: &DenseFile, _: &ExportSettings) -> Result<Vec<Remark>, FileError> {
    let mean = IsotropicMean::of(&file.brdf);
    let values: Vec<[f64; 3]> = (0..PLANE)
        .into_par_iter()
        .map(|at| {
            let [light, view] = directions(at);
            if light[2] <= 0.0 || view[2] <= 0.0 {
                // What is not there; 0 would be a black place.
                return [-1.0; 3];
            }
            let value = mean.at(Direction::from_vec3(light), Direction::from_vec3(view));
            [0, 1, 2].map(|c| value[c] / SCALE[c])
        })
        .collect();
    write_whole(path, |out| {
        for n in [N_HALF, N_DIFF, N_PHI] {
            out.write_all(&(n as i32).to_le_bytes())?;
        }
        for c in 0..3 {
            for value in &values {
                out.write_all(&value[c].to_le_bytes())?;
            }
        }
        Ok(())
    })?;
    Ok(vec![of_anisotropy(path, mean.anisotropy)])
}

/// Light and view at the middle of a place of the table, with the half vector above +x.
fn directions(at: usize) -> [Vec3; 2] {
    let middle = |k: usize| k as f64 + 0.5;
    let half = (middle(at / (N_DIFF * N_PHI)) / N_HALF as f64).powi(2) * FRAC_PI_2;
    let diff = middle(at / N_PHI % N_DIFF) / N_DIFF as f64 * FRAC_PI_2;
    let phi = middle(at % N_PHI) / N_PHI as f64 * PI;
    let (sin_h, cos_h) = half.sine_cosine();
    [0.0, PI].map(|turn| {
        let [x, y, z] = Direction {
            theta: diff,
            phi: phi + turn,
        }
        .to_vec3();
        [x * cos_h + z * sin_h, y, z * cos_h - x * sin_h]
    })
}

#[cfg(test)]
mod tests {
    use super::super::lopsided::{Lopsided, Skew, file, median_ln, settings};
    use super::*;

    #[test]
    fn what_is_isotropic_comes_back_and_the_rest_is_said() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.binary");
        let said = write(&path, &file(&Skew, 6.0), &settings(0, false)).unwrap();
        assert!(said[0].to_string().contains("0.0000 away"));
        let back = read(&path).unwrap();
        assert!(median_ln(back.as_ref(), &Skew, 80.0) < 0.01);
        assert_eq!(std::fs::metadata(&path).unwrap().len(), 34_992_012);
        let said = write(&path, &file(&Lopsided, 6.0), &settings(0, false)).unwrap();
        assert!(!said[0].to_string().contains("0.0000 away"));
    }
}
