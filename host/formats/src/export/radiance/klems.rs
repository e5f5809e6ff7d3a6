//! Klems' full basis: 145 patches of the hemisphere, and the mean of the BRDF over each pair of them.

use super::{colour, xml};
use crate::FileError;
use crate::export::ExportSettings;
use gonia_brdf::{Direction, Elementary};
use gonia_rig::{DenseFile, Remark};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::path::Path;

/// Polar angles at which rings begin and end, degrees, and the patches of each ring.
const EDGES_DEG: [f64; 10] = [0.0, 5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0, 90.0];
const PATCHES: [usize; 9] = [1, 8, 16, 20, 24, 24, 24, 16, 12];
/// Patches of all rings.
pub const COUNT: usize = 145;
/// Directions along each side of a patch of which the mean is taken.
const WITHIN: usize = 4;

/// The patch of a direction.
pub fn patch_of(d: Direction) -> usize {
    let theta = d.theta_deg();
    let ring = EDGES_DEG[1..9]
        .iter()
        .take_while(|edge| theta >= **edge)
        .count();
    let n = PATCHES[ring];
    let at = (d.phi_deg() / 360.0 * n as f64).round() as i64;
    PATCHES[..ring].iter().sum::<usize>() + at.rem_euclid(n as i64) as usize
}

/// Directions spread over a patch so that each stands for the same projected solid angle.
fn directions() -> Vec<Vec<Direction>> {
    let of_ring = |ring: usize| {
        let [low, high] = [0, 1].map(|k| EDGES_DEG[ring + k].to_radians().sine().powi(2));
        (0..PATCHES[ring]).map(move |patch| {
            let within = (0..WITHIN * WITHIN).map(|k| {
                let [u, v] = [k / WITHIN, k % WITHIN].map(|k| (k as f64 + 0.5) / WITHIN as f64);
                let theta = (low + u * (high - low)).sqrt().arc_sine();
                let phi = 360.0 * (patch as f64 + v - 0.5) / PATCHES[ring] as f64;
                Direction::from_deg(theta.to_degrees(), phi)
            });
            within.collect()
        })
    };
    (0..PATCHES.len()).flat_map(of_ring).collect()
}

/// The direction with x and y negated.
pub fn opposite(d: Direction) -> Direction {
    Direction {
        phi: d.phi + PI,
        ..d
    }
}

/// Writes a matrix: a row a view's patch, a column a patch of the direction in which light travels.
///
/// # Errors
/// When the file cannot be written.
pub fn write(
    path: &Path,
    file: &DenseFile,
    settings: &ExportSettings,
) -> Result<Vec<Remark>, FileError> {
    let patches = directions();
    let n = WITHIN * WITHIN;
    let mean = |view: &[Direction], light: &[Direction]| {
        let mut sum = [0.0; 3];
        for a in view {
            for b in light {
                let light = Direction::from_deg(b.theta_deg(), b.phi_deg() + 180.0);
                let value = file.brdf.lookup(light, *a);
                for c in 0..3 {
                    sum[c] += f64::from(value[c]) / (n * n) as f64;
                }
            }
        }
        colour::xyz_of(sum)
    };
    let rows: Vec<Vec<[f64; 3]>> = patches
        .par_iter()
        .map(|view| patches.iter().map(|light| mean(view, light)).collect())
        .collect();
    let channels = if settings.is_one_value { 1 } else { 3 };
    let numbers: Vec<String> = [1, 0, 2][..channels]
        .iter()
        .map(|place| {
            let mut text = String::new();
            for row in &rows {
                let words: Vec<String> = row
                    .iter()
                    .map(|xyz| format!("{:.4e}", xyz[*place]))
                    .collect();
                text += &words.join(", ");
                text += ",\n";
            }
            text
        })
        .collect();
    let document = xml::Document {
        structure: "Columns",
        basis: BASIS,
        block: "<ColumnAngleBasis>LBNL/Klems Full</ColumnAngleBasis>\n<RowAngleBasis>LBNL/Klems Full</RowAngleBasis>\n",
        wavelengths: xml::OF_MATRIX,
        numbers: &numbers,
    };
    xml::write(path, file, &document)?;
    Ok(Vec::new())
}

/// The basis, for readers that do not know it by its name.
const BASIS: &str = include_str!("klems_basis.xml");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_direction_lies_in_its_patch_and_all_patches_fill_the_hemisphere() {
        let patches = directions();
        assert_eq!(patches.len(), COUNT);
        for (patch, within) in patches.iter().enumerate() {
            for d in within {
                assert_eq!(patch_of(*d), patch, "{d:?}");
            }
        }
        assert_eq!(patch_of(Direction::from_deg(10.0, 359.0)), 1);
        assert_eq!(patch_of(Direction::from_deg(89.9, 180.0)), 133 + 6);
        assert_eq!(BASIS.matches("<AngleBasisBlock>").count(), PATCHES.len());
    }
}
