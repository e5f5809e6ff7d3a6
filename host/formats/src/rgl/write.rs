//! Writing an RGL file.

use super::density::Density;
use super::read::Rgl;
use super::shape::{Shape, half_vector, mean};
use super::tensor_file::{Field, write_tensor_file};
use super::warp::{Densities, theta_of_place};
use crate::FileError;
use crate::export::format::ExportSettings;
use gonia_brdf::direction::{Vec3, dot};
use gonia_brdf::{Brdf, DenseBrdf, Direction, Elementary};
use gonia_rig::DenseFile;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// Azimuths of the light from −180° to +180°, both ends; readers are wrong without the second one.
const AZIMUTHS: usize = 37;
/// Step of the light's polar angles, degrees, from 0 on; the grid's last one ends them.
const THETA_STEP_DEG: f64 = 4.0;
/// Least density of the directions that a renderer chooses, of a mean of one: it may come to any.
const LEAST_CHOSEN: f64 = 0.05;

/// Writes a dense BRDF whole, with `settings.resolution`² places of the half vector to a direction of the light. Of a
/// file with and without a shape, with places evenly and by curvature, the one is written that a reader finds
/// nearest to the table.
///
/// # Errors
/// When the file cannot be written.
pub fn write(path: &Path, file: &DenseFile, settings: &ExportSettings) -> Result<(), FileError> {
    let side = settings.resolution;
    let shapes = [Shape::flat(), Shape::of(&file.brdf, side)];
    let mut nearest: Option<(f64, Material)> = None;
    for shape in &shapes {
        for is_even in [true, false] {
            let Some(material) = Material::new(file, side, shape, is_even) else {
                continue;
            };
            let error = material.error(&file.brdf);
            if nearest.as_ref().is_none_or(|(least, _)| error < *least) {
                nearest = Some((error, material));
            }
        }
    }
    let (_, material) = nearest.ok_or_else(|| {
        let problem = "cannot be written: the BRDF has values that are no numbers";
        FileError::new(path, problem, "fill it again")
    })?;
    material.write(path)
}

/// The fields of a file.
pub(super) struct Material(BTreeMap<String, Field>);

impl Material {
    /// Of a table, with a shape that is taken out of the values, and places that lie evenly or by curvature. `None` of
    /// values that are no numbers.
    pub(super) fn new(file: &DenseFile, side: usize, shape: &Shape, is_even: bool) -> Option<Self> {
        let theta_i = polar_angles(&file.brdf);
        let phi_i: Vec<f64> = (0..AZIMUTHS)
            .map(|k| TAU * k as f64 / (AZIMUTHS - 1) as f64 - PI)
            .collect();
        let lights: Vec<Vec3> = phi_i
            .iter()
            .flat_map(|phi| theta_i.iter().map(|theta| direction(*theta, *phi)))
            .map(Direction::to_vec3)
            .collect();
        let density = if is_even {
            Density::even(lights.len())
        } else {
            Density::by_curvature(&lights, |light, place| {
                mean(seen(&file.brdf, light, place)) / shape.at(place)
            })
        }?;
        let slices: Vec<Slice> = lights
            .par_iter()
            .enumerate()
            .map(|(k, light)| Slice::new(&file.brdf, *light, side, shape, (density.map(), k)))
            .collect();
        let gather = |of: fn(&Slice) -> &[f32]| -> Vec<f32> {
            slices.iter().flat_map(of).copied().collect()
        };
        let (p, t) = (phi_i.len(), theta_i.len());
        let narrow = |angles: &[f64]| {
            Field::of_floats(&[angles.len()], angles.iter().map(|a| *a as f32).collect())
        };
        let nodes = density.side();
        let fields = [
            ("description", Field::of_bytes(description(file).as_bytes())),
            ("jacobian", Field::of_bytes(&[1])),
            ("phi_i", narrow(&phi_i)),
            ("theta_i", narrow(&theta_i)),
            (
                "ndf",
                Field::of_floats(&[shape.side(); 2], shape.values().to_vec()),
            ),
            ("sigma", Field::of_floats(&[2, 2], vec![0.25; 4])),
            (
                "vndf",
                Field::of_floats(&[p, t, nodes, nodes], density.values().to_vec()),
            ),
            (
                "luminance",
                Field::of_floats(&[p, t, side, side], gather(|slice| &slice.chosen)),
            ),
            (
                "rgb",
                Field::of_floats(&[p, t, 3, side, side], gather(|slice| &slice.rgb)),
            ),
        ];
        let fields = fields.map(|(name, field)| (name.to_owned(), field));
        Some(Self(fields.into()))
    }

    /// Writes the file whole.
    pub(super) fn write(&self, path: &Path) -> Result<(), FileError> {
        write_tensor_file(path, &self.0)
    }

    /// RMS of ln of the values as a reader has them against the table's.
    fn error(&self, brdf: &DenseBrdf) -> f64 {
        let Ok(read) = Rgl::of(Path::new(""), &self.0) else {
            return f64::INFINITY;
        };
        let of_pair = |k: usize| {
            let [light, view] = pair(k);
            let wanted = mean(brdf.lookup(light, view).map(f64::from));
            let found = mean(read.eval(light.to_vec3(), view.to_vec3()));
            (wanted > 0.0 && found > 0.0).then(|| (found / wanted).natural_log().powi(2))
        };
        let squares: Vec<f64> = (0..TRIED).into_par_iter().filter_map(of_pair).collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    }
}

/// Pairs of directions at which a file is judged.
const TRIED: usize = 10_000;
/// Their largest polar angle, degrees.
const LAST_TRIED_DEG: f64 = 75.0;
/// How far every other view is from the light's mirror direction at most, degrees.
const NEAR_DEG: f64 = 6.0;

/// A pair of directions, every other one near the mirror's direction.
fn pair(k: usize) -> [Direction; 2] {
    let part = |by: f64| (k as f64 * by).fract();
    let any = |a, b| Direction::from_deg(part(a) * LAST_TRIED_DEG, part(b) * 360.0);
    let light = any(0.618_034, 0.754_878);
    if k.is_multiple_of(2) {
        return [light, any(0.569_840_3, 0.438_579_1)];
    }
    let near = |by: f64| NEAR_DEG * (2.0 * part(by) - 1.0);
    let theta = (light.theta_deg() + near(0.802_381_7)).abs();
    let phi = light.phi_deg() + 180.0 + near(0.366_025_4);
    [light, Direction::from_deg(theta, phi)]
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
    fn new(
        brdf: &DenseBrdf,
        towards: Vec3,
        side: usize,
        shape: &Shape,
        (map, slice): (&Densities, usize),
    ) -> Self {
        let nodes = side * side;
        let mut rgb = vec![0.0; 3 * nodes];
        let mut chosen = vec![0.0; nodes];
        for k in 0..nodes {
            let node = [k % side, k / side].map(|i| i as f64 / (side - 1) as f64);
            let place = map.place_of(node, slice);
            let value = seen(brdf, towards, place);
            for c in 0..3 {
                rgb[c * nodes + k] = (value[c] / shape.at(place)) as f32;
            }
            chosen[k] =
                mean(value) * area_of_place(towards, place) / map.at(place, &[(slice, 1.0)]);
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
