//! Sessions that have one error alone, beside the same sessions without it: noise and interpolation nearly cancel in their
//! ratio, so that the size of what the error changes is seen. Whether U is true is seen beside the true values.

use crate::session::{Errors, Session, nominal, with_directions_off};
use gonia_brdf::model::{Brdf, Ggx};
use gonia_brdf::{Direction, Elementary, Grid, Sample};
use gonia_pipeline::budget::{CellUncertainty, Effect, Equation, Shape, Slant, budget_of};
use gonia_pipeline::process::{Masks, process};
use gonia_pipeline::{FillOptions, Filled, fill, silent};
use gonia_rig::{Budget, Input, Scale};
use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::Arc;

/// A session in which an input's error shows.
struct Case {
    input: Input,
    /// The error is so many times what the bench states otherwise, and its rig states so much.
    scale: f64,
    poses: usize,
    material: Ggx,
}

impl Case {
    /// In samples: nothing hides it there. Of a reference that is tilted or raised by more than stated, frames are refused.
    fn of_samples(input: Input) -> Self {
        let as_stated = [Input::ReferenceTilt, Input::ReferenceHeight].contains(&input);
        Self {
            input,
            scale: if as_stated { 1.0 } else { 4.0 },
            poses: 60,
            material: BROAD,
        }
    }

    /// In cells, beside noise and interpolation.
    fn of_cells(input: Input) -> Self {
        let (scale, poses, material) = match input {
            Input::ReferenceTilt => (2.0, 120, matte(0.6)),
            Input::ReferenceHeight => (8.0, 60, matte(0.6)),
            Input::Drift => (8.0, 60, BROAD),
            Input::StrayLight => (16.0, 60, matte(0.04)),
            Input::LightDirection | Input::ViewDirection => (8.0, 120, BROAD),
            // Cones of the same angle: a panel instead of a lamp.
            Input::LightDiameter => (8.0, 120, BROAD),
            Input::LensDiameter => (13.0, 120, BROAD),
            _ => (4.0, 60, BROAD),
        };
        Self {
            input,
            scale,
            poses,
            material,
        }
    }

    /// The errors of a session that has this one.
    fn errors(&self) -> Errors {
        Errors::one(self.input, self.scale, SIZES)
    }
}

/// Of these standard uncertainties, along and across.
const SIZES: [f64; 2] = [1.0, -1.5];
/// Coarse enough to be quick, fine enough for the slopes of the material.
const STEP_DEG: f64 = 6.0;
const SEED: u64 = 77;

/// Dark with a broad lobe: black level, stray light, the camera's curve, directions and cones all change it.
const BROAD: Ggx = Ggx {
    diffuse: [0.04; 3],
    specular: [1.0; 3],
    f0: 0.08,
    alpha_x: 0.5,
    alpha_y: 0.4,
    azimuth_deg: 65.0,
};

/// Interpolated best, so that what changes it by little shows.
fn matte(rho: f64) -> Ggx {
    Ggx {
        diffuse: [rho; 3],
        specular: [0.0; 3],
        ..BROAD
    }
}

/// The samples of a session.
fn sampled(case: &Case, errors: Errors) -> (Vec<Sample>, Budget) {
    let rig = nominal(case.scale);
    let session = Session::new(&rig, Arc::new(case.material), errors, (SEED, case.poses));
    let go = &|_, _| ControlFlow::Continue(());
    let mut done = process(&rig, &session, &Masks::default(), go).expect("frames are sound");
    with_directions_off(&mut done.samples, &session.errors);
    let budget = budget_of(&rig, done.calibration, &done.samples);
    (done.samples, budget)
}

/// Its cells, and a budget that holds the case's input alone.
fn filled(case: &Case, errors: Errors) -> (Filled, Budget) {
    let (samples, budget) = sampled(case, errors);
    let options = FillOptions {
        with_errors: true,
        ..FillOptions::with_step_deg(STEP_DEG)
    };
    let filled = fill(samples, Scale::Absolute, &options, &silent).expect("samples are enough");
    let others = Input::ALL.into_iter().filter(|other| *other != case.input);
    (filled, others.fold(budget, |of, other| of.with(other, 0.0)))
}

fn without_error() -> Errors {
    Errors::one(Input::Reference, 0.0, [0.0; 2])
}

/// What an error does.
#[derive(Clone, Copy, Debug)]
pub struct Alone {
    /// The size of the error that its changes show by least squares over the cells, over the true one.
    pub ratio: f64,
    /// Share of the changes' sum of squares that the budget's effects explain.
    pub explained: f64,
    /// Share of the cells whose true value lies within U (k = 2) of noise, interpolation and this input …
    pub within: f64,
    /// … and of noise and interpolation alone: of cells in which the budget says that the error is more than these.
    pub left_out: f64,
    /// How many cells those are.
    pub shown_by: usize,
}

/// What an error of one input does, in a session that has it beside one that has not.
pub fn with_error_of(input: Input) -> Alone {
    let case = Case::of_cells(input);
    let (sound, _) = filled(&case, without_error());
    let (found, alone) = filled(&case, case.errors());
    let grid = found.dense.grid;
    let [before, plane] = [&sound, &found].map(|of| &of.dense.planes[1]);
    let [first, errors] = [&sound, &found].map(|of| of.errors.as_ref().expect("asked for"));
    let (noise, origin) = (&errors.standard_error[1], &errors.origin);
    let cells = CellUncertainty::new(grid, plane, origin, &alone).expect("its own plane");
    // Normal equations of the changes over the input's effects, at most two.
    let (mut xx, mut xy, mut yy) = ([[0.0; 2]; 2], [0.0; 2], 0.0);
    let (mut within, mut left_out, mut shows) = (0.0f64, 0.0, 0.0f64);
    for cell in one_of_each_pair(grid).filter(|cell| origin[*cell] != 3 && first.origin[*cell] != 3)
    {
        let (light, view) = grid.light_and_view(cell);
        let value = f64::from(plane[cell]);
        let change = value / f64::from(before[cell]) - 1.0;
        let [i, v] = [light, view].map(|d| grid.direction(d).to_vec3());
        let off = (case.material.eval(i, v)[1] / value - 1.0).abs();
        let effects = cells.effects(light, view);
        let of_input = Effect::ALL.into_iter().filter(|e| e.input() == Some(input));
        let stated: Vec<f64> = of_input.clone().map(|effect| effects.of(effect)).collect();
        let scatter = (f64::from(noise[cell]) / value).powi(2);
        // Cells count by how well noise and interpolation let them be known.
        let weight = 1.0 / scatter.max(1e-8);
        let pair = [stated[0], stated.get(1).copied().unwrap_or(0.0)];
        for j in 0..2 {
            xy[j] += weight * pair[j] * change;
            (0..2).for_each(|k| xx[j][k] += weight * pair[j] * pair[k]);
        }
        yy += weight * change * change;
        let u: f64 = of_input.map(|effect| effects.square(effect)).sum();
        if u > scatter {
            shows += 1.0;
            within += f64::from(off <= 2.0 * (u + scatter).sqrt());
            left_out += f64::from(off <= 2.0 * scatter.sqrt());
        }
    }
    let sizes = solved(xx, xy);
    let size = |of: [f64; 2]| of[0].hypotenuse(of[1]);
    Alone {
        ratio: size(sizes) / size(true_sizes(input)),
        explained: (sizes[0] * xy[0] + sizes[1] * xy[1]) / yy,
        within: within / shows.max(1.0),
        left_out: left_out / shows.max(1.0),
        shown_by: shows as usize,
    }
}

/// What an error of an input of reference, lamp or camera changes the samples by: its size by least squares over the true
/// one, the share of the changes' sum of squares that the equation explains, and how many samples there are in the
/// session without and with it.
#[allow(dead_code)] // The bench counts cells alone.
pub fn samples_with_error_of(input: Input) -> (f64, f64, [usize; 2]) {
    let case = Case::of_samples(input);
    let (sound, budget) = sampled(&case, without_error());
    let (off, _) = sampled(&case, case.errors());
    let equation = Equation::new(&budget);
    let mut frames: HashMap<u32, [f64; 2]> = HashMap::new();
    for sample in &sound {
        let [sum, count] = frames.entry(sample.frame).or_default();
        *sum += f64::from(sample.rgb[1]);
        *count += 1.0;
    }
    let (mut xx, mut xy, mut yy) = ([[0.0; 2]; 2], [0.0; 2], 0.0);
    for (sample, found) in sound.iter().zip(&off) {
        let value = f64::from(sample.rgb[1]);
        let change = f64::from(found.rgb[1]) / value - 1.0;
        if !change.is_finite() || value <= 0.0 {
            continue;
        }
        let [sum, count] = frames[&sample.frame];
        let light = Direction::from_deg(sample.theta_i_deg.into(), sample.phi_i_deg.into());
        let view = Direction::from_deg(sample.theta_v_deg.into(), sample.phi_v_deg.into());
        let at = |(i, v): (Direction, Direction)| case.material.eval(i.to_vec3(), v.to_vec3())[1];
        let shape = Shape {
            value,
            surround: sum / count,
            ..shape_of(light, view, &at)
        };
        let effects = equation.at(&Slant::of(light), &Slant::of(view), &shape);
        let of_input = Effect::ALL.into_iter().filter(|e| e.input() == Some(input));
        let stated: Vec<f64> = of_input.map(|effect| effects.of(effect)).collect();
        let pair = [stated[0], stated.get(1).copied().unwrap_or(0.0)];
        for j in 0..2 {
            xy[j] += pair[j] * change;
            (0..2).for_each(|k| xx[j][k] += pair[j] * pair[k]);
        }
        yy += change * change;
    }
    let sizes = solved(xx, xy);
    let size = |of: [f64; 2]| of[0].hypotenuse(of[1]);
    let ratio = size(sizes) / size(true_sizes(input));
    let explained = (sizes[0] * xy[0] + sizes[1] * xy[1]) / yy;
    (ratio, explained, [sound.len(), off.len()])
}

/// Second derivatives of a BRDF over light and over view, in the tangent plane, per square radian.
fn shape_of(
    light: Direction,
    view: Direction,
    at: &dyn Fn((Direction, Direction)) -> f64,
) -> Shape {
    const H: f64 = 0.01;
    let about = |d: Direction| {
        let d = d.to_vec3();
        let flat = d[0].hypotenuse(d[1]).max(1e-9);
        let across = [-d[1] / flat, d[0] / flat, 0.0];
        let along = [
            -across[1] * d[2],
            across[0] * d[2],
            across[1] * d[0] - across[0] * d[1],
        ];
        [across, along].map(|axis| {
            [H, -H].map(|h| {
                let to = [0, 1, 2].map(|k| d[k] + h * axis[k]);
                Direction::from_vec3(gonia_brdf::direction::normalize(to))
            })
        })
    };
    let value = at((light, view));
    let bend = |values: Vec<f64>| (values.iter().sum::<f64>() - 4.0 * value) / (H * H);
    let lights = about(light).into_iter().flatten().map(|i| at((i, view)));
    let views = about(view).into_iter().flatten().map(|v| at((light, v)));
    Shape {
        bends: [bend(lights.collect()), bend(views.collect())],
        ..Shape::default()
    }
}

/// The standard uncertainties by which an input's effects are off. A cone is as large as it is.
fn true_sizes(input: Input) -> [f64; 2] {
    let effects = Effect::ALL.into_iter().filter(|e| e.input() == Some(input));
    match (input, effects.count()) {
        (Input::LightDiameter | Input::LensDiameter, _) => [1.0, 0.0],
        (_, 1) => [SIZES[0], 0.0],
        _ => SIZES,
    }
}

/// Solves two normal equations, or one where the second effect is none.
fn solved(m: [[f64; 2]; 2], b: [f64; 2]) -> [f64; 2] {
    let determinant = m[0][0] * m[1][1] - m[0][1] * m[1][0];
    if m[1][1] == 0.0 {
        return [b[0] / m[0][0], 0.0];
    }
    [
        (b[0] * m[1][1] - b[1] * m[0][1]) / determinant,
        (b[1] * m[0][0] - b[0] * m[1][0]) / determinant,
    ]
}

/// One cell of each pair of directions that exchange, without a pole's repeats.
fn one_of_each_pair(grid: Grid) -> impl Iterator<Item = usize> {
    (0..grid.n_cells()).filter(move |cell| {
        let (light, view) = grid.light_and_view(*cell);
        let repeats = |d: usize| (1..grid.n_phi()).contains(&d);
        light <= view && !repeats(light) && !repeats(view)
    })
}
