//! Tensor trees: means over cells of the squares of light and view, as large as values are alike.

use super::square::direction_at;
use super::tree_text::text_of;
use super::{colour, xml};
use crate::FileError;
use crate::export::ExportSettings;
use gonia_brdf::{Direction, Elementary, IsotropicMean};
use gonia_rig::{DenseFile, Remark};
use rayon::prelude::*;
use std::path::Path;

/// Places in a cell of the light's square, and those of the view's that each meets: four pairs that spread over
/// the four dimensions.
const PAIRS: [([f64; 2], [f64; 2]); 4] = [
    ([0.25, 0.25], [0.75, 0.25]),
    ([0.75, 0.25], [0.75, 0.75]),
    ([0.25, 0.75], [0.25, 0.25]),
    ([0.75, 0.75], [0.25, 0.75]),
];

/// Values within this share of their mean are one cell: luminances, chromaticities.
const ALIKE: f32 = 0.05;
const ALIKE_COLOURS: f32 = 0.01;

/// Writes a tree of rank 4.
///
/// # Errors
/// When the file cannot be written.
pub fn write_4(
    path: &Path,
    file: &DenseFile,
    settings: &ExportSettings,
) -> Result<Vec<Remark>, FileError> {
    let n = 1usize << settings.resolution;
    let table = &file.brdf;
    let of_light = |light: usize| -> Vec<[f32; 3]> {
        let cell = [light / n, light % n];
        let of_view = |view: usize| {
            mean_of_pairs(|of_light, of_view| {
                // The square holds −x and −y of the light.
                let light = direction_at(place(cell, of_light, n).map(|v| 1.0 - v));
                let view = direction_at(place([view / n, view % n], of_view, n));
                table.lookup(light, view).map(f64::from)
            })
        };
        (0..n * n).map(of_view).collect()
    };
    let cells: Vec<Vec<[f32; 3]>> = (0..n * n).into_par_iter().map(of_light).collect();
    write(path, file, settings, 4, &cells.concat())?;
    Ok(Vec::new())
}

/// Writes a tree of rank 3: the first axis is ½ − ½ sin θi, and the light lies at −x.
///
/// # Errors
/// When the file cannot be written.
pub fn write_3(
    path: &Path,
    file: &DenseFile,
    settings: &ExportSettings,
) -> Result<Vec<Remark>, FileError> {
    let n = 1usize << settings.resolution;
    let mean = IsotropicMean::of(&file.brdf);
    let of_light = |light: usize| -> Vec<[f32; 3]> {
        let of_view = |view: usize| {
            mean_of_pairs(|[of_light, _], of_view| {
                // The second half of the axis, which nobody reads, mirrors the first.
                let sine = (1.0 - 2.0 * (light as f64 + of_light) / n as f64).abs();
                let view = direction_at(place([view / n, view % n], of_view, n));
                mean.lookup(sine.arc_sine(), view.theta, view.phi - std::f64::consts::PI)
            })
        };
        (0..n * n).map(of_view).collect()
    };
    let cells: Vec<Vec<[f32; 3]>> = (0..n).into_par_iter().map(of_light).collect();
    write(path, file, settings, 3, &cells.concat())?;
    Ok(vec![of_anisotropy(path, mean.anisotropy)])
}

/// What a file of an isotropic format has lost.
pub(in crate::export) fn of_anisotropy(path: &Path, anisotropy: f64) -> Remark {
    Remark::new(
        path.display(),
        format_args!(
            "holds the mean over turns of the sample, from which the table is {anisotropy:.4} away (RMS of ln)"
        ),
        "where that is more than the material's uncertainty, give a format that holds anisotropy",
    )
}

fn place(cell: [usize; 2], within: [f64; 2], n: usize) -> [f64; 2] {
    [0, 1].map(|i| (cell[i] as f64 + within[i]) / n as f64)
}

/// X, Y, Z of a cell.
fn mean_of_pairs(at: impl Fn([f64; 2], [f64; 2]) -> [f64; 3]) -> [f32; 3] {
    let mut sum = [0.0; 3];
    for (light, view) in PAIRS {
        let value = at(light, view);
        for c in 0..3 {
            sum[c] += value[c] / PAIRS.len() as f64;
        }
    }
    colour::xyz_of(sum).map(|v| v as f32)
}

fn write(
    path: &Path,
    file: &DenseFile,
    settings: &ExportSettings,
    rank: u32,
    cells: &[[f32; 3]],
) -> Result<(), FileError> {
    let channels = if settings.is_one_value { 1 } else { 3 };
    let numbers: Vec<String> = (0..channels)
        .into_par_iter()
        .map(|place| {
            let value = |xyz: &[f32; 3]| colour::yuv_of(*xyz)[place];
            let values: Vec<f32> = cells.iter().map(value).collect();
            let alike = if place == 0 { ALIKE } else { ALIKE_COLOURS };
            text_of(&values, rank, settings.resolution as u32, alike)
        })
        .collect();
    let document = xml::Document {
        structure: if rank == 4 {
            "TensorTree4"
        } else {
            "TensorTree3"
        },
        basis: "",
        block: "<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>\n",
        wavelengths: xml::OF_TREE,
        numbers: &numbers,
    };
    xml::write(path, file, &document)
}

/// The cell of a direction in a tree of rank 3 or 4, as a place in each of its axes.
pub fn place_of(rank: u32, light: Direction, view: Direction) -> [f64; 4] {
    let [l, v] = [light, view].map(Direction::to_vec3);
    if rank == 4 {
        let i = super::square::of_disk([-l[0], -l[1]]);
        let o = super::square::of_disk([v[0], v[1]]);
        return [i[0], i[1], o[0], o[1]];
    }
    let sine = l[0].hypotenuse(l[1]);
    let turned = Direction {
        theta: view.theta,
        phi: view.phi - light.phi + std::f64::consts::PI,
    };
    let v = turned.to_vec3();
    let o = super::square::of_disk([v[0], v[1]]);
    [0.5 - 0.5 * sine, o[0], o[1], 0.0]
}
