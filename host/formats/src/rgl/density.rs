//! How densely places of the half vector lie for each light, which the field `vndf` holds: closest where straight lines
//! between them would be furthest from the values.

use super::warp::Densities;
use gonia_brdf::Elementary;
use gonia_brdf::direction::Vec3;
use rayon::prelude::*;

/// Steps of the density along each side.
const STEPS: usize = 8;
/// Steps of the lattice on which curvature is taken, a step of the density.
const FINER: usize = 2;
/// Nodes of that lattice along each side.
const NODES: usize = FINER * STEPS + 1;
/// What is added to a density of a mean of one: half of all places are spread evenly.
const EVEN: f64 = 1.0;
/// Straight lines between places of density ρ are off by about the curvature over ρ: squared and summed, that is least
/// where ρ is as the curvature to this power.
const POWER: f64 = 2.0 / 3.0;

/// The field, and the map that it makes.
pub struct Density {
    side: usize,
    values: Vec<f32>,
    map: Densities,
}

impl Density {
    /// The same everywhere, for so many lights (at least one).
    pub fn even(lights: usize) -> Option<Self> {
        Self::new(2, vec![1.0; 4 * lights])
    }

    /// By the curvature of what `value` gives at a light and a place (zero where the view is below the horizon).
    /// `None` of values that are no numbers.
    pub fn by_curvature(
        lights: &[Vec3],
        value: impl Fn(Vec3, [f64; 2]) -> f64 + Sync,
    ) -> Option<Self> {
        let of_light = |light: &Vec3| {
            let node = |k: usize| k as f64 / (NODES - 1) as f64;
            let values: Vec<f64> = (0..NODES * NODES)
                .map(|k| value(*light, [node(k % NODES), node(k / NODES)]))
                .collect();
            of_curvature(&values)
        };
        let slices: Vec<Vec<f32>> = lights.par_iter().map(of_light).collect();
        Self::new(STEPS + 1, slices.concat())
    }

    fn new(side: usize, values: Vec<f32>) -> Option<Self> {
        let map = Densities::new([side; 2], values.clone())?;
        Some(Self { side, values, map })
    }

    /// Nodes along each side.
    pub fn side(&self) -> usize {
        self.side
    }

    /// Of all lights, the nodes of the half vector's polar angle fast.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// The map between places and the square on which they lie evenly.
    pub fn map(&self) -> &Densities {
        &self.map
    }
}

/// The density of one light, of values on the lattice.
fn of_curvature(values: &[f64]) -> Vec<f32> {
    let curvature: Vec<Option<f64>> = (0..NODES * NODES)
        .map(|k| curvature_at(values, k % NODES, k / NODES))
        .collect();
    let side = STEPS + 1;
    let density: Vec<f64> = (0..side * side)
        .map(|k| mean_about(&curvature, FINER * (k % side), FINER * (k / side)).power(POWER))
        .collect();
    let mean = density.iter().sum::<f64>() / density.len() as f64;
    let scale = if mean > 0.0 { 1.0 / mean } else { 0.0 };
    density
        .into_iter()
        .map(|v| (v * scale + EVEN) as f32)
        .collect()
}

/// Row of the lattice `by` steps from a row: azimuths go round, and the last row is the first one.
fn row_beside(y: usize, by: isize) -> usize {
    (y as isize + by).rem_euclid(NODES as isize - 1) as usize
}

/// Second differences along both sides over the value; `None` beside the horizon.
fn curvature_at(values: &[f64], x: usize, y: usize) -> Option<f64> {
    let at = |x: usize, y: usize| Some(values[y * NODES + x]).filter(|v| *v > 0.0);
    let bend = |a: f64, b: f64, c: f64| (a + c - 2.0 * b).abs() / b;
    let inside = x.clamp(1, NODES - 2);
    let along = bend(at(inside - 1, y)?, at(inside, y)?, at(inside + 1, y)?);
    let [below, above] = [-1, 1].map(|by| at(x, row_beside(y, by)));
    Some(along + bend(below?, at(x, y)?, above?))
}

/// The mean about a node, which falls to nothing at the next node of the density.
fn mean_about(curvature: &[Option<f64>], x: usize, y: usize) -> f64 {
    let reach = FINER as isize;
    let (mut sum, mut weights) = (0.0, 0.0);
    for dy in -reach..=reach {
        let row = row_beside(y, dy) * NODES;
        for dx in -reach..=reach {
            let Some(x) = x.checked_add_signed(dx).filter(|x| *x < NODES) else {
                continue;
            };
            if let Some(curvature) = curvature[row + x] {
                let weight = ((reach + 1 - dx.abs()) * (reach + 1 - dy.abs())) as f64;
                sum += weight * curvature;
                weights += weight;
            }
        }
    }
    if weights > 0.0 { sum / weights } else { 0.0 }
}
