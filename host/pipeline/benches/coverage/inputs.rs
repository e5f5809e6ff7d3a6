//! What each input's error does in cells, over sessions that have all of them, against what the budget says of it.

use crate::count::{Cell, PARTS, name};
use crate::session::Errors;
use gonia_pipeline::budget::Effect;
use gonia_rig::Input;

const N: usize = Effect::ALL.len();
/// One cell in so many tells of all: a prime, so that all rows and columns are met.
const ONE_IN: usize = 7;

/// Sums over cells and sessions, by part of the domain.
#[derive(Clone)]
pub struct Inputs {
    of: Vec<Sums>,
    seen: usize,
    /// The size of each effect's error in this session, in standard uncertainties, with its sign.
    sizes: [f64; N],
}

#[derive(Clone)]
struct Sums {
    cells: f64,
    /// Squares that the budget states: of each effect, and of noise and interpolation.
    stated: [f64; N],
    noise: f64,
    /// Normal equations of the changes over each effect times its size: a factor of 1 is right.
    xx: [[f64; N]; N],
    xy: [f64; N],
    yy: f64,
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
        let none = Sums {
            cells: 0.0,
            stated: [0.0; N],
            noise: 0.0,
            xx: [[0.0; N]; N],
            xy: [0.0; N],
            yy: 0.0,
        };
        Self {
            of: vec![none; PARTS.len()],
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
        // The found value less the true one, as a share of the true one: errors of scale act on that.
        let change = 1.0 / (1.0 + cell.off) - 1.0;
        let sides = Effect::ALL.map(|effect| cell.effects.of(effect));
        let x: Vec<f64> = (0..N).map(|k| sides[k] * self.sizes[k]).collect();
        for (is_in, of) in cell.is_in.iter().zip(&mut self.of) {
            if !is_in {
                continue;
            }
            of.cells += 1.0;
            of.noise += cell.noise * cell.noise;
            of.yy += change * change;
            for (k, effect) in Effect::ALL.into_iter().enumerate() {
                of.stated[k] += cell.effects.square(effect);
                of.xy[k] += x[k] * change;
                (0..N).for_each(|j| of.xx[k][j] += x[k] * x[j]);
            }
        }
    }

    /// Adds another session's.
    pub fn join(mut self, other: &Self) -> Self {
        for (sum, of) in self.of.iter_mut().zip(&other.of) {
            sum.cells += of.cells;
            sum.noise += of.noise;
            sum.yy += of.yy;
            for k in 0..N {
                sum.stated[k] += of.stated[k];
                sum.xy[k] += of.xy[k];
                (0..N).for_each(|j| sum.xx[k][j] += of.xx[k][j]);
            }
        }
        self
    }

    /// A table: of each part and input the stated standard uncertainty (root mean square over cells, %), the one that its
    /// drawn errors would have made at the stated sensitivities, and the factor by which the changes follow these.
    pub fn print(&self, material: &str) {
        for (part, of) in PARTS.iter().zip(&self.of).take(4) {
            let per_cell = |square: f64| 100.0 * (square / of.cells).max(0.0).sqrt();
            let factors = solved(of.xx, of.xy);
            let explained: f64 = (0..N).map(|k| factors[k] * of.xy[k]).sum();
            println!(
                "\n{material}, {}: all errors {:.2} %; noise and interpolation stated {:.2}, found {:.2}",
                name(*part),
                per_cell(of.yy),
                per_cell(of.noise),
                per_cell(of.yy - explained),
            );
            for (k, effect) in Effect::ALL.into_iter().enumerate() {
                println!(
                    "  {effect:?}: stated {:.3} %, as drawn {:.3}, factor {:.2}",
                    per_cell(of.stated[k]),
                    per_cell(of.xx[k][k]),
                    factors[k]
                );
            }
        }
    }
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
