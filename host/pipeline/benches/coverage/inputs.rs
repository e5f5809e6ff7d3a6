//! What each input's error does in cells, over sessions that have all of them, against what the budget says of it.

use crate::count::{Cell, PARTS, name};
use crate::session::Errors;
use gonia_pipeline::budget::Effect;
use gonia_rig::Input;
use std::fmt::Write;

const N: usize = Effect::ALL.len();
/// One cell in so many tells of all: a prime, so that all rows and columns are met.
const ONE_IN: usize = 7;

/// Sums over the cells of a session, by part of the domain.
pub struct Inputs {
    of: [Sums; PARTS.len()],
    seen: usize,
    /// The size of each effect's error in this session, in standard uncertainties, with its sign.
    sizes: [f64; N],
}

/// Each cell's squares count as shares of its combined variance: else the few cells that are known worst would be all.
#[derive(Clone, Copy)]
struct Sums {
    cells: f64,
    /// What the budget states: of each effect.
    stated: [f64; N],
    /// Normal equations of the changes over each effect times its size: a factor of 1 is right.
    xx: [[f64; N]; N],
    xy: [f64; N],
    yy: f64,
}

impl Sums {
    const NONE: Self = Self {
        cells: 0.0,
        stated: [0.0; N],
        xx: [[0.0; N]; N],
        xy: [0.0; N],
        yy: 0.0,
    };

    fn add(&mut self, of: &Self, sign: f64) {
        self.cells += sign * of.cells;
        self.yy += sign * of.yy;
        for k in 0..N {
            self.stated[k] += sign * of.stated[k];
            self.xy[k] += sign * of.xy[k];
            (0..N).for_each(|j| self.xx[k][j] += sign * of.xx[k][j]);
        }
    }
}

impl Inputs {
    /// Of a session with these errors.
    pub fn of(errors: &Errors) -> Self {
        let mut pairs = [0; N];
        let sizes = Effect::ALL.map(|effect| {
            let Some(input) = effect.input() else {
                return 1.0;
            };
            let which = pairs[input as usize];
            pairs[input as usize] += 1;
            match input {
                // A cone is as large as it is stated.
                Input::LightDiameter | Input::LensDiameter => f64::from(errors.of(input) != 0.0),
                _ => errors.pair(input)[which] / crate::session::stated(input),
            }
        });
        Self {
            of: [Sums::NONE; PARTS.len()],
            seen: 0,
            sizes,
        }
    }

    /// Adds a cell.
    pub fn add(&mut self, cell: &Cell) {
        self.seen += 1;
        if !self.seen.is_multiple_of(ONE_IN) {
            return;
        }
        let per_variance = 1.0 / cell.u().powi(2);
        // The found value less the true one, as a share of the true one: errors of scale act on that.
        let change = 1.0 / (1.0 + cell.off) - 1.0;
        let means = Effect::ALL.map(|effect| cell.effects.of(effect));
        let mut one = Sums::NONE;
        (one.cells, one.yy) = (1.0, per_variance * change * change);
        for (k, effect) in Effect::ALL.into_iter().enumerate() {
            let x = per_variance * means[k] * self.sizes[k];
            one.stated[k] = per_variance * cell.effects.square(effect);
            one.xy[k] = x * change;
            (0..N).for_each(|j| one.xx[k][j] = x * means[j] * self.sizes[j]);
        }
        for (_, of) in cell.is_in.iter().zip(&mut self.of).filter(|of| *of.0) {
            of.add(&one, 1.0);
        }
    }
}

/// A table of sessions: of each part of the domain and each effect the share of the combined variance that the budget states,
/// the share that its drawn errors would have made at the stated sensitivities, and the factor by which the changes follow
/// these, with its standard error by leaving out one session after the other.
pub fn table(material: &str, all: &[&Inputs]) -> String {
    let mut text = String::new();
    for (at, part) in PARTS.iter().enumerate().take(4) {
        let mut sum = Sums::NONE;
        all.iter().for_each(|of| sum.add(&of.of[at], 1.0));
        let factors = solved(sum.xx, sum.xy);
        let mut squares = [0.0; N];
        for of in all {
            let mut others = sum;
            others.add(&of.of[at], -1.0);
            let without = solved(others.xx, others.xy);
            (0..N).for_each(|k| squares[k] += (without[k] - factors[k]).powi(2));
        }
        let explained: f64 = (0..N).map(|k| factors[k] * sum.xy[k]).sum();
        let noise = 1.0 - sum.stated.iter().sum::<f64>() / sum.cells;
        let _ = writeln!(
            text,
            "{material}, {}: (error/u)² {:.2}; noise and interpolation stated {noise:.3}, found {:.3}",
            name(*part),
            sum.yy / sum.cells,
            (sum.yy - explained) / sum.cells,
        );
        for (k, effect) in Effect::ALL.into_iter().enumerate() {
            let _ = writeln!(
                text,
                "  {effect:?}: stated {:.4}, as drawn {:.4}, factor {:.2} ± {:.2}",
                sum.stated[k] / sum.cells,
                sum.xx[k][k] / sum.cells,
                factors[k],
                squares[k].sqrt()
            );
        }
    }
    text
}

/// Solves normal equations; what has no effect has no factor.
fn solved(mut m: [[f64; N]; N], mut b: [f64; N]) -> [f64; N] {
    let alive: Vec<usize> = (0..N).filter(|k| m[*k][*k] > 1e-12).collect();
    for (at, &k) in alive.iter().enumerate() {
        for &row in &alive[at + 1..] {
            let by = m[row][k] / m[k][k];
            for &column in &alive[at..] {
                m[row][column] -= by * m[k][column];
            }
            b[row] -= by * b[k];
        }
    }
    let mut x = [0.0; N];
    for (at, &k) in alive.iter().enumerate().rev() {
        let rest: f64 = alive[at + 1..].iter().map(|&j| m[k][j] * x[j]).sum();
        x[k] = (b[k] - rest) / m[k][k];
    }
    x
}
