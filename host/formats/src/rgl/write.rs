//! Writing an RGL file.

use super::tensor_file::{Field, write_tensor_file};
use super::warp::theta_of_place;
use crate::FileError;
use crate::export::ExportSettings;
use gonia_brdf::direction::{Vec3, dot};
use gonia_brdf::{DenseBrdf, Direction, Elementary};
use gonia_rig::DenseFile;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// Azimuths of the light from −180° to +180°, both ends; readers are wrong without the second one.
const AZIMUTHS: usize = 37;
/// Step of the light's polar angles, degrees, from 0 on; the grid's last one ends them.
const THETA_STEP_DEG: f64 = 4.0;
/// Least density of the directions that a renderer chooses, of a mean of one: it may come to any.
const LEAST_CHOSEN: f64 = 0.05;

/// Writes a dense BRDF whole, with `settings.resolution`² places of the half vector to a direction of the
/// light.
///
/// # Errors
/// When the file cannot be written.
pub fn write(path: &Path, file: &DenseFile, settings: &ExportSettings) -> Result<(), FileError> {
    let side = settings.resolution;
    let theta_i = polar_angles(&file.brdf);
    let phi_i: Vec<f64> = (0..AZIMUTHS)
        .map(|k| TAU * k as f64 / (AZIMUTHS - 1) as f64 - PI)
        .collect();
    let lights: Vec<Direction> = phi_i
        .iter()
        .flat_map(|phi| theta_i.iter().map(|theta| direction(*theta, *phi)))
        .collect();
    let slices: Vec<Slice> = lights
        .par_iter()
        .map(|light| Slice::new(&file.brdf, *light, side))
        .collect();
    let gather =
        |of: fn(&Slice) -> &[f32]| -> Vec<f32> { slices.iter().flat_map(of).copied().collect() };
    let (p, t) = (phi_i.len(), theta_i.len());
    let floats = |shape: &[usize], of| Field::of_floats(shape, gather(of));
    let narrow = |angles: &[f64]| {
        Field::of_floats(&[angles.len()], angles.iter().map(|a| *a as f32).collect())
    };
    let flat = |value: f32| Field::of_floats(&[2, 2], vec![value; 4]);
    write_tensor_file(
        path,
        &[
            ("description", Field::of_bytes(description(file).as_bytes())),
            ("jacobian", Field::of_bytes(&[1])),
            ("phi_i", narrow(&phi_i)),
            ("theta_i", narrow(&theta_i)),
            ("ndf", flat(1.0)),
            ("sigma", flat(0.25)),
            // Uniform: one by the material's brightness was tried, and is further from the table.
            (
                "vndf",
                Field::of_floats(&[p, t, 2, 2], vec![1.0; 4 * p * t]),
            ),
            (
                "luminance",
                floats(&[p, t, side, side], |slice| &slice.chosen),
            ),
            ("rgb", floats(&[p, t, 3, side, side], |slice| &slice.rgb)),
        ],
    )
}

/// Nodes of the light's polar angle, radians.
fn polar_angles(brdf: &DenseBrdf) -> Vec<f64> {
    let grid = brdf.grid();
    let last = grid.direction(grid.n_directions() - 1).theta_deg();
    let steps = (last / THETA_STEP_DEG - 1e-6).floor() as usize;
    let mut angles: Vec<f64> = (0..=steps).map(|k| THETA_STEP_DEG * k as f64).collect();
    angles.push(last);
    angles.into_iter().map(f64::to_radians).collect()
}

fn direction(theta: f64, phi: f64) -> Direction {
    Direction { theta, phi }
}

/// What the file says of itself: provenance, a fact a line.
fn description(file: &DenseFile) -> String {
    let mut text = format!("scale = {}", file.scale);
    for (name, value) in &file.provenance {
        text += &format!("\n{name} = {value}");
    }
    text
}

/// All that one direction of the light has.
struct Slice {
    /// f·cosθv over places of the half vector.
    rgb: Vec<f32>,
    /// Over places: how often a renderer chooses them.
    chosen: Vec<f32>,
}

impl Slice {
    fn new(brdf: &DenseBrdf, light: Direction, side: usize) -> Self {
        let towards = light.to_vec3();
        let nodes = side * side;
        let mut rgb = vec![0.0; 3 * nodes];
        let mut chosen = vec![0.0; nodes];
        for k in 0..nodes {
            let place = [k % side, k / side].map(|i| i as f64 / (side - 1) as f64);
            let value = seen(brdf, towards, place);
            for c in 0..3 {
                rgb[c * nodes + k] = value[c] as f32;
            }
            chosen[k] = mean(value) * area_of_place(towards, place);
        }
        Self {
            rgb,
            chosen: with_floor(&chosen, LEAST_CHOSEN),
        }
    }
}

fn mean([r, g, b]: [f64; 3]) -> f64 {
    (r + g + b) / 3.0
}

/// Values over their mean, and a floor beneath them.
fn with_floor(values: &[f64], floor: f64) -> Vec<f32> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let scale = if mean > 0.0 { 1.0 / mean } else { 0.0 };
    values.iter().map(|v| (v * scale + floor) as f32).collect()
}

/// The half vector at a place.
fn half_vector([u, v]: [f64; 2]) -> Vec3 {
    direction(theta_of_place(u), TAU * v - PI).to_vec3()
}

/// f·cosθv of the view that has its half vector at a place; zero below the horizon.
fn seen(brdf: &DenseBrdf, light: Vec3, place: [f64; 2]) -> [f64; 3] {
    let m = half_vector(place);
    let along = 2.0 * dot(light, m);
    let view = [0, 1, 2].map(|i| along * m[i] - light[i]);
    if view[2] <= 0.0 {
        return [0.0; 3];
    }
    let [from, to] = [light, view].map(Direction::from_vec3);
    brdf.lookup(from, to).map(|f| f64::from(f) * view[2])
}

/// Solid angle of views that a small square of places stands for, over the square's area.
fn area_of_place(light: Vec3, place: [f64; 2]) -> f64 {
    let m = half_vector(place);
    let sine = theta_of_place(place[0]).sine();
    2.0 * PI * PI * place[0] * sine * 4.0 * dot(light, m).max(0.0)
}
