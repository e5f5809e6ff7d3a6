//! The measurement equation at every cell of a dense BRDF, and at any pair of directions of what can be asked.

use crate::budget::equation::{Effects, Equation, Shape, Slant};
use crate::budget::sides::Sides;
use gonia_brdf::{Direction, Elementary, Grid};
use gonia_formats::dense::ErrorRow;
use gonia_rig::Budget;
use std::sync::Arc;

/// How far apart directions are whose values give slopes, degrees, at least.
const STEP_DEG: f64 = 2.0;
/// A frame shows views so far about its own, degrees: the target's half side from the camera's distance.
const FRAME_DEG: f64 = 8.0;
/// Views that stand for those of the same frame.
const AROUND: usize = 8;

/// The nodes about a node, as its slopes and bends need them.
struct Node {
    slant: Slant,
    /// The nodes after and before it along its meridian and across it.
    beside: [[u32; 2]; 2],
    /// One over the angle between those two, per radian …
    per_span: [f64; 2],
    /// … and one over the square of half of it; zero at the rim, where one of them is the node itself.
    per_square: [f64; 2],
    /// Nodes beside it on its ring lie nearer to the pole than the great circle across its meridian does: what that takes
    /// from the second derivative across, per slope along (cot θ for near ones).
    ring: f64,
    /// Views that the same frame shows.
    around: [u32; AROUND],
}

/// The measurement equation over the cells of a channel's plane.
pub struct CellUncertainty<'a> {
    grid: Grid,
    plane: &'a [f32],
    equation: Equation,
    nodes: Arc<[Node]>,
    sides: Arc<Sides>,
}

impl<'a> CellUncertainty<'a> {
    /// Over a plane of `grid.n_cells()` values; `None` where it is not of this size. `origins`
    /// ([`Origin`](gonia_brdf::interpolate::Origin), in the grid's order; an empty list where they are not known) say on which side
    /// of each cell its samples lie.
    pub fn new(grid: Grid, plane: &'a [f32], origins: &[u8], budget: &Budget) -> Option<Self> {
        Self::with_nodes(
            grid,
            plane,
            nodes(grid),
            Arc::new(Sides::of(grid, origins)),
            budget,
        )
    }

    fn with_nodes(
        grid: Grid,
        plane: &'a [f32],
        nodes: Arc<[Node]>,
        sides: Arc<Sides>,
        budget: &Budget,
    ) -> Option<Self> {
        (plane.len() == grid.n_cells()).then(|| Self {
            grid,
            plane,
            equation: Equation::new(budget),
            nodes,
            sides,
        })
    }

    /// The effects at a cell, by the indices of its light and view. The table is reciprocal, as every fill is.
    pub fn effects(&self, light: usize, view: usize) -> Effects {
        let shape = self.shape(light, view);
        let slants = (&self.nodes[light].slant, &self.nodes[view].slant);
        let there = self.sides.there(light, view);
        self.equation.of_reciprocal(slants, &shape, there)
    }

    /// The squares of the relative standard uncertainties of scale and direction at a cell whose value comes by a share from
    /// samples at its own light and view.
    fn squares(&self, light: usize, view: usize, there: f64) -> [f64; 2] {
        let shape = self.shape(light, view);
        let slants = (&self.nodes[light].slant, &self.nodes[view].slant);
        self.equation.squares(slants, &shape, there)
    }

    #[inline(always)]
    fn shape(&self, light: usize, view: usize) -> Shape {
        let (at_light, at_view) = (&self.nodes[light], &self.nodes[view]);
        let n = self.grid.n_directions();
        let at = |light: u32, view: u32| f64::from(self.plane[light as usize * n + view as usize]);
        let (i, v) = (light as u32, view as u32);
        let value = at(i, v);
        let mut slopes = [0.0; 4];
        let mut bends = [0.0; 2];
        for axis in 0..2 {
            let [after, before] = at_light.beside[axis].map(|i| at(i, v));
            slopes[axis] = (after - before) * at_light.per_span[axis];
            bends[0] += (after + before - 2.0 * value) * at_light.per_square[axis];
            let [after, before] = at_view.beside[axis].map(|v| at(i, v));
            slopes[2 + axis] = (after - before) * at_view.per_span[axis];
            bends[1] += (after + before - 2.0 * value) * at_view.per_square[axis];
        }
        bends[0] += slopes[0] * at_light.ring;
        bends[1] += slopes[2] * at_view.ring;
        let around: f64 = at_view.around.iter().map(|v| at(i, *v)).sum();
        Shape {
            value,
            slopes,
            bends,
            surround: around / AROUND as f64,
        }
    }
}

/// Combines the standard errors of a dense BRDF's planes, of noise and interpolation with its budget, a row of light at a time;
/// `origins` are those of its cells, as of [`CellUncertainty::new`]. `None` where a plane is not of the grid's size.
pub fn combine_errors<'a>(
    grid: Grid,
    planes: &'a [Vec<f32>],
    origins: &[u8],
    budget: &Budget,
) -> Option<impl Fn(usize, &[&[f32]]) -> ErrorRow + Sync + use<'a>> {
    let side = grid.n_directions();
    let (nodes, sides) = (nodes(grid), Arc::new(Sides::of(grid, origins)));
    let of_channel = |plane: &'a Vec<f32>| {
        CellUncertainty::with_nodes(grid, plane, nodes.clone(), sides.clone(), budget)
    };
    let channels: Vec<CellUncertainty<'a>> =
        planes.iter().map(of_channel).collect::<Option<_>>()?;
    let share = 1.0 / channels.len().max(1) as f64;
    Some(move |light: usize, noise: &[&[f32]]| {
        let mut row = ErrorRow {
            combined: vec![Vec::with_capacity(side); channels.len()],
            parts: [(); 3].map(|()| vec![0.0; side]),
        };
        for (view, there) in sides.row(light, side).into_iter().enumerate() {
            let mut parts = [0.0; 3];
            for ((cells, noise), combined) in channels.iter().zip(noise).zip(&mut row.combined) {
                let value = f64::from(cells.plane[light * side + view]);
                let Some(noise) = noise.get(view).copied().map(f64::from) else {
                    continue;
                };
                let [scale, direction] = cells.squares(light, view, there.into());
                parts[0] += if value > 0.0 { noise / value } else { 0.0 };
                parts[1] += direction.sqrt();
                parts[2] += scale.sqrt();
                let square = noise * noise + value * value * (scale + direction);
                combined.push(square.sqrt() as f32);
            }
            for (row, part) in row.parts.iter_mut().zip(parts) {
                row[view] = (share * part) as f32;
            }
        }
        row
    })
}

fn nodes(grid: Grid) -> Arc<[Node]> {
    (0..grid.n_directions()).map(|k| node(grid, k)).collect()
}

fn node(grid: Grid, index: usize) -> Node {
    let (n_theta, n_phi) = (grid.n_theta(), grid.n_phi());
    let step = grid.step_deg().to_radians();
    let (theta, phi) = (index / n_phi, index % n_phi);
    let (sine, cosine) = (theta as f64 * step).sine_cosine();
    let at = |theta: usize, phi: usize| (theta * n_phi + phi % n_phi) as u32;
    let opposite = phi + n_phi / 2;
    // Along the meridian, over the pole where it is near, and ending at the rim.
    let along = |steps: usize| {
        let after = at((theta + steps).min(n_theta - 1), phi);
        let before = match theta.checked_sub(steps) {
            Some(theta) => at(theta, phi),
            None => at(steps - theta, opposite),
        };
        let past = (theta + steps).saturating_sub(n_theta - 1);
        ([after, before], past)
    };
    // So many nodes across it span about as many degrees as `deg`, or at most a quarter of a turn; at the pole
    // those of the first ring do.
    let across = |deg: f64| {
        let quarter = n_phi / 4;
        let wide = deg.to_radians() / step;
        if theta == 0 {
            let ring = (wide.round() as usize).clamp(1, n_theta - 1);
            return (
                [at(ring, phi + quarter), at(ring, phi + n_phi - quarter)],
                ring as f64 * step,
                0.0,
            );
        }
        let steps = ((wide / sine).ceil() as usize).clamp(1, quarter);
        let turn = steps as f64 * step;
        let half = (sine * turn.sine()).max(sine * step);
        let nearer = sine * cosine * (1.0 - turn.cosine());
        (
            [at(theta, phi + steps), at(theta, phi + n_phi - steps)],
            half,
            2.0 * nearer / (half * half),
        )
    };
    let (meridian, past) = along(1);
    let (ring, half, nearer) = across(STEP_DEG.max(grid.step_deg()));
    let wide = ((FRAME_DEG.to_radians() / step).round() as usize)
        .max(1)
        .min(n_theta - 1);
    let (far, _) = along(wide);
    let (side, ..) = across(FRAME_DEG);
    let corner = |far: u32, side: u32| {
        let ring = far as usize / n_phi;
        at(ring, side as usize % n_phi)
    };
    let around = [
        far[0],
        far[1],
        side[0],
        side[1],
        corner(far[0], side[0]),
        corner(far[0], side[1]),
        corner(far[1], side[0]),
        corner(far[1], side[1]),
    ];
    let is_rim = past > 0;
    Node {
        slant: Slant::of(grid.direction(index)),
        beside: [meridian, ring],
        per_span: [1.0 / (if is_rim { 1.0 } else { 2.0 } * step), 0.5 / half],
        per_square: [
            if is_rim { 0.0 } else { 1.0 / (step * step) },
            1.0 / (half * half),
        ],
        ring: nearer,
        around,
    }
}

/// Pairs of directions whose values tell of the surroundings of one: it comes first.
pub(crate) const PLACES: usize = 9 + AROUND;

/// Those pairs.
pub(crate) fn places(light: Direction, view: Direction) -> [(Direction, Direction); PLACES] {
    let mut all = [(light, view); PLACES];
    let mut next = 1;
    let mut put = |pair| {
        if let Some(place) = all.get_mut(next) {
            *place = pair;
        }
        next += 1;
    };
    for turn in [[STEP_DEG, 0.0], [0.0, STEP_DEG]] {
        for sign in [1.0, -1.0] {
            put((moved(light, turn.map(|t| sign * t)), view));
        }
        for sign in [1.0, -1.0] {
            put((light, moved(view, turn.map(|t| sign * t))));
        }
    }
    for along in [-FRAME_DEG, 0.0, FRAME_DEG] {
        for across in [-FRAME_DEG, 0.0, FRAME_DEG] {
            if along != 0.0 || across != 0.0 {
                put((light, moved(view, [along, across])));
            }
        }
    }
    all
}

/// The shape that the values at such places have.
pub(crate) fn shape(values: &[f64; PLACES]) -> Shape {
    let half = STEP_DEG.to_radians();
    let value = values[0];
    let mut shape = Shape {
        value,
        surround: values[9..].iter().sum::<f64>() / AROUND as f64,
        ..Shape::default()
    };
    for axis in 0..2 {
        for (whose, from) in [(0, 1 + 4 * axis), (1, 3 + 4 * axis)] {
            let (after, before) = (values[from], values[from + 1]);
            shape.slopes[2 * whose + axis] = (after - before) / (2.0 * half);
            shape.bends[whose] += (after + before - 2.0 * value) / (half * half);
        }
    }
    shape
}

/// A direction moved along its meridian (away from the pole) and across it (anticlockwise), degrees; never below
/// the horizon.
fn moved(direction: Direction, [along, across]: [f64; 2]) -> Direction {
    let (sin_t, cos_t) = direction.theta_deg().to_radians().sine_cosine();
    let (sin_p, cos_p) = direction.phi_deg().to_radians().sine_cosine();
    let (a, b) = (along.to_radians().tangent(), across.to_radians().tangent());
    let to = [
        sin_t * cos_p + a * cos_t * cos_p - b * sin_p,
        sin_t * sin_p + a * cos_t * sin_p + b * cos_p,
        (cos_t - a * sin_t).max(1e-3),
    ];
    Direction::from_vec3(gonia_brdf::direction::normalize(to))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::equation::Part;
    use gonia_brdf::DenseBrdf;
    use gonia_brdf::model::{Brdf, Ggx};
    use gonia_rig::{Input, ReferenceCalibration, Rig};

    /// Rough enough for a grid of 2 degrees to show its slopes, and not isotropic.
    const BRDF: Ggx = Ggx {
        diffuse: [0.2; 3],
        specular: [0.6; 3],
        f0: 0.5,
        alpha_x: 0.5,
        alpha_y: 0.35,
        azimuth_deg: 25.0,
    };

    fn budget() -> Budget {
        let rig = Rig::paper(100);
        let known = ReferenceCalibration::KnownReference;
        let lengths = [1100.0, 1800.0, 14.0];
        let budget = Budget::new(known, 0.3, lengths, |input| rig.input(input));
        budget.with(Input::LightDiameter, 100.0)
    }

    #[test]
    fn cells_and_functions_have_the_same_effects() {
        let grid = Grid::with_step_deg(2.0).unwrap();
        // Of a grid of this size only the rows about a light are needed: the rest stays zero.
        let lights = [[40.0, 90.0], [0.0, 120.0], [62.0, 358.0]];
        for [theta, phi] in lights {
            let light = grid.n_phi() * (theta / 2.0) as usize + (phi / 2.0) as usize;
            let equation = Equation::new(&budget());
            let at = |(i, v): (Direction, Direction)| BRDF.eval(i.to_vec3(), v.to_vec3())[1];
            let n = grid.n_directions();
            let mut plane = vec![0.0f32; grid.n_cells()];
            let near = node(grid, light).beside;
            for row in near.into_iter().flatten().chain([light as u32]) {
                let row = row as usize;
                let d = grid.direction(row);
                for view in 0..n {
                    plane[row * n + view] = at((d, grid.direction(view))) as f32;
                }
            }
            let cells = CellUncertainty::new(grid, &plane, &[], &budget()).unwrap();
            for [tv, pv] in [[30.0, 200.0], [0.0, 44.0], [2.0, 10.0], [66.0, 272.0]] {
                let view = grid.n_phi() * (tv / 2.0) as usize + (pv / 2.0) as usize;
                let by_cells = cells.effects(light, view);
                let (i, v) = (grid.direction(light), grid.direction(view));
                let shape = shape(&places(i, v).map(at));
                let slants = (Slant::of(i), Slant::of(v));
                let by_function = equation.of_reciprocal((&slants.0, &slants.1), &shape, 0.5);
                for part in [Part::Scale, Part::Direction] {
                    let (a, b) = (by_cells.u(part), by_function.u(part));
                    assert!((a - b).abs() < 0.06 * b, "{theta} {tv} {part:?} {a} {b}");
                }
            }
        }
    }

    #[test]
    fn the_rim_and_the_pole_have_uncertainties_too() {
        let grid = Grid::with_step_deg(10.0).unwrap();
        let brdf = DenseBrdf::tabulate(grid, &BRDF);
        let plane = &brdf.planes()[0];
        let cells = CellUncertainty::new(grid, plane, &[], &budget()).unwrap();
        for light in [0, 5, grid.n_directions() - 1] {
            for view in 0..grid.n_directions() {
                let effects = cells.effects(light, view);
                for u in [Part::Direction, Part::Scale].map(|part| effects.u(part)) {
                    assert!(u.is_finite() && u > 0.0 && u < 1.0, "{light} {view} {u}");
                }
                let there = cells.sides.there(light, view);
                let squares = [Part::Scale, Part::Direction].map(|part| effects.u(part).powi(2));
                for (short, long) in cells.squares(light, view, there).iter().zip(squares) {
                    assert!(
                        (short - long).abs() < 1e-9 * long,
                        "{light} {view} {short} {long}"
                    );
                }
            }
        }
        assert!(CellUncertainty::new(grid, &plane[1..], &[], &budget()).is_none());
    }
}
