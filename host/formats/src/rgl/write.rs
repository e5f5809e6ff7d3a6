//! Writing an RGL file.

use super::shape::{Shape, half_vector, mean};
use super::tensor_file::{Field, write_tensor_file};
use super::warp::{cell, theta_of_place};
use crate::FileError;
use crate::export::format::ExportSettings;
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
    let (side, flat) = (settings.resolution, Shape::flat());
    if side > SMALL {
        return write_with(path, file, side, &flat);
    }
    let shape = Shape::of(&file.brdf, side);
    let error = |shape: &Shape| error_between(&file.brdf, side, shape);
    let is_nearer = error(&shape) < error(&flat);
    write_with(path, file, side, if is_nearer { &shape } else { &flat })
}

/// As [`write`], with a shape that is taken out of the values.
pub(super) fn write_with(
    path: &Path,
    file: &DenseFile,
    side: usize,
    shape: &Shape,
) -> Result<(), FileError> {
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
        .map(|light| Slice::new(&file.brdf, *light, side, shape))
        .collect();
    let gather =
        |of: fn(&Slice) -> &[f32]| -> Vec<f32> { slices.iter().flat_map(of).copied().collect() };
    let (p, t) = (phi_i.len(), theta_i.len());
    let floats = |shape: &[usize], of| Field::of_floats(shape, gather(of));
    let narrow = |angles: &[f64]| {
        Field::of_floats(&[angles.len()], angles.iter().map(|a| *a as f32).collect())
    };
    write_tensor_file(
        path,
        &[
            ("description", Field::of_bytes(description(file).as_bytes())),
            ("jacobian", Field::of_bytes(&[1])),
            ("phi_i", narrow(&phi_i)),
            ("theta_i", narrow(&theta_i)),
            (
                "ndf",
                Field::of_floats(&[shape.side(); 2], shape.values().to_vec()),
            ),
            ("sigma", Field::of_floats(&[2, 2], vec![0.25; 4])),
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

/// Up to so many places along a side a shape is taken out, where that is nearer to the table. With more places it gains
/// on some materials and loses on others.
const SMALL: usize = 24;
/// Lights and places at which a shape is judged.
const TRIED: [usize; 2] = [48, 192];

/// RMS of ln of the values between the places, as a reader has them, against the table's, at some lights.
fn error_between(brdf: &DenseBrdf, side: usize, shape: &Shape) -> f64 {
    let [lights, places] = TRIED;
    let squares = |k: usize| {
        let angle = |by: f64| (k as f64 * by).fract();
        let light = direction(
            angle(0.618_034) * 75f64.to_radians(),
            angle(0.754_878) * TAU,
        );
        let light = light.to_vec3();
        let at = |place| mean(seen(brdf, light, place)) / shape.at(place);
        let mut sum = [0.0; 2];
        for j in 0..places {
            // Half of them near the normal, where highlights are.
            let u = (j as f64 * 0.569_840_3).fract() * if j % 2 == 0 { 1.0 } else { 0.4 };
            let place = [u, (j as f64 * 0.438_579_1).fract()];
            let ([x, y], [u, v]) = cell([side; 2], place);
            let node = |i: usize| i as f64 / (side - 1) as f64;
            let corner = |dx, dy| at([node(x + dx), node(y + dy)]);
            let row = |dy| corner(0, dy) + u * (corner(1, dy) - corner(0, dy));
            let read = (row(0) + v * (row(1) - row(0))) * shape.at(place);
            let wanted = mean(seen(brdf, light, place));
            if read > 0.0 && wanted > 0.0 {
                sum[0] += (read / wanted).natural_log().powi(2);
                sum[1] += 1.0;
            }
        }
        sum
    };
    let sums: Vec<[f64; 2]> = (0..lights).into_par_iter().map(squares).collect();
    let [squares, count] = sums
        .iter()
        .fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
    (squares / count.max(1.0)).sqrt()
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
    /// f·cosθv over the shape at places of the half vector.
    rgb: Vec<f32>,
    /// Over places: how often a renderer chooses them.
    chosen: Vec<f32>,
}

impl Slice {
    fn new(brdf: &DenseBrdf, light: Direction, side: usize, shape: &Shape) -> Self {
        let towards = light.to_vec3();
        let nodes = side * side;
        let mut rgb = vec![0.0; 3 * nodes];
        let mut chosen = vec![0.0; nodes];
        for k in 0..nodes {
            let place = [k % side, k / side].map(|i| i as f64 / (side - 1) as f64);
            let value = seen(brdf, towards, place);
            for c in 0..3 {
                rgb[c * nodes + k] = (value[c] / shape.at(place)) as f32;
            }
            chosen[k] = mean(value) * area_of_place(towards, place);
        }
        Self {
            rgb,
            chosen: with_floor(&chosen, LEAST_CHOSEN),
        }
    }
}

/// Values over their mean, and a floor beneath them.
fn with_floor(values: &[f64], floor: f64) -> Vec<f32> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let scale = if mean > 0.0 { 1.0 / mean } else { 0.0 };
    values.iter().map(|v| (v * scale + floor) as f32).collect()
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
