//! Least squares over frames: numbers that all frames share, with priors, and a few of each frame's own.
//!
//! The frame's own numbers (its arms' errors at that moment, a line's own error) are eliminated frame by
//! frame (Schur complement), so that the normal equations have the size of the shared numbers however
//! many frames there are. Their standard deviations and the noise's are found from the frames themselves
//! (evidence maximisation), so that uncertainties are those of the rig at hand. Residuals beyond a
//! few standard deviations lose their weight (Cauchy).

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A residual of so many standard deviations has half its weight.
const CAUCHY: f64 = 4.0;
/// Steps at most.
const ROUNDS: usize = 30;
/// A step of this share of a prior's standard deviation is none.
const SETTLED: f64 = 1e-5;
/// Steps before the standard deviations of noise and frames' own numbers are found too: before, they
/// would explain what the shared numbers have to.
const BEFORE_NOISE: usize = 4;
/// The largest step of a number, in standard deviations of its prior.
const LONGEST: f64 = 1.5;
/// Step of numeric derivatives, likewise.
const DERIVATIVE: f64 = 1e-4;

/// What frames show, as a function of the numbers.
pub trait Frames: Sync {
    /// What is the same for all frames once the shared numbers are chosen.
    type At: Send + Sync;

    /// Number of frames.
    fn count(&self) -> usize;

    /// Chooses the shared numbers.
    fn at(&self, shared: &[f64]) -> Self::At;

    /// Residuals of a frame, in standard deviations of their noise up to a common factor; always as many.
    fn residuals(&self, at: &Self::At, frame: usize, own: &[f64]) -> Vec<f64>;

    /// Derivatives of a frame's residuals with respect to the last of the shared numbers, a column for each, where the
    /// residuals are linear in them; of the others they are found by differences.
    fn by_last(&self, _at: &Self::At, _frame: usize, _own: &[f64]) -> Vec<Vec<f64>> {
        Vec::new()
    }

    /// Whether a frame's residuals scatter as they are known to: then nothing is learnt from how far off it is.
    fn is_known(&self, _frame: usize) -> bool {
        false
    }
}

/// A problem: where numbers start, and how far they may be from there.
pub struct Problem<'a> {
    /// The shared numbers' prior means.
    pub nominal: &'a [f64],
    /// Their prior standard deviations.
    pub prior: &'a [f64],
    /// Which of them may move.
    pub free: &'a [bool],
    /// Standard deviations of a frame's own numbers (about 0), to start from.
    pub own: &'a [f64],
    /// The least that they are taken to be: few frames seem to have none.
    pub least_own: &'a [f64],
    /// The most that they are taken to be.
    pub most_own: &'a [f64],
    /// The least that the residuals' common factor is taken to be.
    pub least_noise: f64,
    /// Whether noise and frames' own standard deviations are found too.
    pub finds_noise: bool,
}

/// What was found.
#[derive(Clone, Debug)]
pub struct Solved {
    /// The shared numbers.
    pub shared: Vec<f64>,
    /// Information (inverse covariance) of the data alone on all shared numbers, those that were held too;
    /// frames' own numbers are allowed for.
    pub information: DMatrix<f64>,
    /// Standard deviations of frames' own numbers.
    pub own: Vec<f64>,
    /// The residuals' common factor.
    pub noise: f64,
    /// What each frame pulls, and how much it knows, in units of the priors.
    pulls: Vec<Pull>,
}

/// A frame's part in a solution.
#[derive(Clone, Debug)]
struct Pull {
    normal: DMatrix<f64>,
    right: DVector<f64>,
    /// Whether its residuals are what they are known to be.
    is_known: bool,
}

impl Solved {
    /// The covariance of the numbers `among`, where the others are known: by how the solution scatters when frames
    /// are left out one by one. What is common to the residuals of a frame, modelled or not, is in it
    /// (the cluster-robust estimate CR3: Bell and McCaffrey 2002). To that comes what the priors' own
    /// uncertainty leaves. Where few frames have a say, their scatter is itself a chance: no combination of numbers
    /// is known better than by the scatter of noise and of frames' own numbers, which all frames tell. `None` where
    /// there is none.
    pub fn covariance(&self, prior: &[f64], among: &[usize]) -> Option<DMatrix<f64>> {
        let n = among.len();
        let of = |m: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, j| m[(among[i], among[j])]);
        let normals: Vec<DMatrix<f64>> = self.pulls.iter().map(|pull| of(&pull.normal)).collect();
        let mut all = DMatrix::identity(n, n);
        normals.iter().for_each(|normal| all += normal);
        let inverse = all.clone().cholesky()?.inverse();
        let mut scatter = DMatrix::zeros(n, n);
        for (pull, normal) in self.pulls.iter().zip(&normals) {
            if pull.is_known {
                scatter += &inverse * normal * &inverse;
                continue;
            }
            let right = DVector::from_fn(n, |i, _| pull.right[among[i]]);
            // Without this frame the solution would be so far from where it is.
            let step = (&all - normal).cholesky()?.solve(&right);
            scatter += &step * step.transpose();
        }
        let sum = at_least(&(scatter + &inverse * &inverse), &inverse)?;
        let scaled = |i: usize, j: usize| sum[(i, j)] * prior[among[i]] * prior[among[j]];
        Some(DMatrix::from_fn(n, n, scaled))
    }
}

/// A covariance that is no smaller than another one in any direction, and the first where that is larger.
fn at_least(covariance: &DMatrix<f64>, least: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let root = least.clone().cholesky()?.l();
    let half = root.solve_lower_triangular(covariance)?;
    let whitened = root.solve_lower_triangular(&half.transpose())?;
    let mut eigen = (0.5 * (&whitened + whitened.transpose())).symmetric_eigen();
    eigen.eigenvalues.apply(|value| *value = value.max(1.0));
    Some(&root * eigen.recompose() * root.transpose())
}

/// The normal equations of one frame, without its own numbers.
struct Reduced {
    normal: DMatrix<f64>,
    right: DVector<f64>,
    /// To find its own numbers once the shared ones have moved: own step = start − coupling · step.
    start: DVector<f64>,
    coupling: DMatrix<f64>,
    /// Of its own numbers where the shared ones are known, in units of their variances.
    variance_alone: DVector<f64>,
}

impl Reduced {
    /// The variance of one of its own numbers. The shared ones are not known either, and took some of the frames'
    /// scatter for themselves: without their part it would seem too small.
    fn own_variance(&self, j: usize, free: &[usize], covariance: &DMatrix<f64>) -> f64 {
        let follows = DVector::from_fn(free.len(), |k, _| self.coupling[(j, free[k])]);
        self.variance_alone[j] + follows.dot(&(covariance * &follows))
    }
}

/// Solves a problem from `start`. `None` when the equations have no solution (a number that is not one).
pub fn solve<F: Frames>(frames: &F, problem: &Problem, start: &[f64]) -> Option<Solved> {
    let n = start.len();
    let mut shared = start.to_vec();
    let mut own_sd = problem.own.to_vec();
    let mut own = vec![vec![0.0; own_sd.len()]; frames.count()];
    let mut noise = noise_of(frames, &shared, &own)?.max(problem.least_noise);
    let free: Vec<usize> = (0..n).filter(|k| problem.free[*k]).collect();
    for round in 0..ROUNDS {
        let reduced = linearise(frames, problem, &shared, &own, &own_sd, noise);
        let (mut normal, mut right) = sum(&reduced, n);
        for k in 0..n {
            normal[(k, k)] += 1.0;
            right[k] -= (shared[k] - problem.nominal[k]) / problem.prior[k];
        }
        let among = DMatrix::from_fn(free.len(), free.len(), |i, j| normal[(free[i], free[j])]);
        let aim = DVector::from_fn(free.len(), |i, _| right[free[i]]);
        let factor = among.cholesky()?;
        let found = factor.solve(&aim);
        let longest = found.amax();
        if !longest.is_finite() {
            return None;
        }
        let mut step = DVector::zeros(n);
        for (k, value) in free.iter().zip(found.iter()) {
            step[*k] = value * (LONGEST / longest).min(1.0);
            shared[*k] += step[*k] * problem.prior[*k];
        }
        for (own, frame) in own.iter_mut().zip(&reduced) {
            let moved = &frame.start - &frame.coupling * &step;
            for (value, (change, sd)) in own.iter_mut().zip(moved.iter().zip(&own_sd)) {
                *value += change * sd;
            }
        }
        noise = noise_of(frames, &shared, &own)?.max(problem.least_noise);
        let had = own_sd.clone();
        if problem.finds_noise && round >= BEFORE_NOISE {
            let covariance = factor.inverse();
            for (j, sd) in own_sd.iter_mut().enumerate() {
                // Of few frames that tell little the mean square of what is found would creep towards its end:
                // MacKay's fixed point (1992) divides by how much the frames tell.
                let (mut squares, mut told) = (0.0, 0.0);
                for (own, frame) in own.iter().zip(&reduced) {
                    squares += own[j] * own[j];
                    told += (1.0 - frame.own_variance(j, &free, &covariance)).max(0.0);
                }
                let variance = squares / told.max(f64::MIN_POSITIVE);
                let ratio = (variance / (had[j] * had[j])).clamp(0.25, 4.0);
                let found = ratio.sqrt() * had[j];
                *sd = found.min(problem.most_own[j]).max(problem.least_own[j]);
            }
        }
        let steady = own_sd
            .iter()
            .zip(&had)
            .all(|(a, b)| (a / b - 1.0).abs() < 0.02);
        let is_late = !problem.finds_noise || round > BEFORE_NOISE;
        if step.amax() < SETTLED && steady && is_late {
            break;
        }
    }
    let reduced = linearise(frames, problem, &shared, &own, &own_sd, noise);
    let (normal, _) = sum(&reduced, n);
    let scale = |i: usize, j: usize| problem.prior[i] * problem.prior[j];
    let information = DMatrix::from_fn(n, n, |i, j| normal[(i, j)] / scale(i, j));
    Some(Solved {
        shared,
        information,
        own: own_sd,
        noise,
        pulls: reduced
            .into_iter()
            .enumerate()
            .map(|(f, Reduced { normal, right, .. })| Pull {
                normal,
                right,
                is_known: frames.is_known(f),
            })
            .collect(),
    })
}

/// The standard deviation of the residuals, by their median.
fn noise_of<F: Frames>(frames: &F, shared: &[f64], own: &[Vec<f64>]) -> Option<f64> {
    let at = frames.at(shared);
    let mut all: Vec<f64> = (0..frames.count())
        .into_par_iter()
        .map(|f| frames.residuals(&at, f, &own[f]))
        .collect::<Vec<_>>()
        .concat();
    if all.is_empty() {
        return None;
    }
    all.iter_mut().for_each(|r| *r = r.abs());
    let middle = all.len() / 2;
    let median = *all.select_nth_unstable_by(middle, f64::total_cmp).1;
    median.is_finite().then_some(1.4826 * median)
}

/// Every frame's normal equations in units of the priors.
fn linearise<F: Frames>(
    frames: &F,
    problem: &Problem,
    shared: &[f64],
    own: &[Vec<f64>],
    own_sd: &[f64],
    noise: f64,
) -> Vec<Reduced> {
    let n = shared.len();
    let here = frames.at(shared);
    let beside: Vec<F::At> = (0..n)
        .map(|k| {
            let mut moved = shared.to_vec();
            moved[k] += DERIVATIVE * problem.prior[k];
            frames.at(&moved)
        })
        .collect();
    (0..frames.count())
        .into_par_iter()
        .map(|f| {
            let residuals = DVector::from_vec(frames.residuals(&here, f, &own[f]));
            let rows = residuals.len();
            let column =
                |moved: Vec<f64>, step: f64| (DVector::from_vec(moved) - &residuals) / step;
            let mut by_shared = DMatrix::zeros(rows, n);
            let last = frames.by_last(&here, f, &own[f]);
            for (k, at) in beside.iter().enumerate().take(n - last.len()) {
                let moved = frames.residuals(at, f, &own[f]);
                by_shared.set_column(k, &column(moved, DERIVATIVE));
            }
            for (k, of_last) in (n - last.len()..n).zip(last) {
                by_shared.set_column(k, &(problem.prior[k] * DVector::from_vec(of_last)));
            }
            let mut by_own = DMatrix::zeros(rows, own_sd.len());
            for (j, sd) in own_sd.iter().enumerate() {
                let step = DERIVATIVE * problem.own[j];
                let mut moved = own[f].clone();
                moved[j] += step;
                let moved = frames.residuals(&here, f, &moved);
                by_own.set_column(j, &column(moved, step / sd));
            }
            reduce(residuals, by_shared, by_own, &own[f], own_sd, noise)
        })
        .collect()
}

fn reduce(
    mut residuals: DVector<f64>,
    mut by_shared: DMatrix<f64>,
    mut by_own: DMatrix<f64>,
    own: &[f64],
    own_sd: &[f64],
    noise: f64,
) -> Reduced {
    for row in 0..residuals.len() {
        let far = residuals[row] / (CAUCHY * noise);
        let root_weight = 1.0 / (noise * (1.0 + far * far).sqrt());
        residuals[row] *= root_weight;
        by_shared.row_mut(row).scale_mut(root_weight);
        by_own.row_mut(row).scale_mut(root_weight);
    }
    let m = own.len();
    let inner = by_own.transpose() * &by_own + DMatrix::identity(m, m);
    let inverse = inner.try_inverse().unwrap_or_else(|| DMatrix::zeros(m, m));
    let mixed = by_own.transpose() * &by_shared;
    let standing = DVector::from_fn(m, |j, _| own[j] / own_sd[j]);
    let pull = -(by_own.transpose() * &residuals) - standing;
    let start = &inverse * &pull;
    let coupling = &inverse * &mixed;
    Reduced {
        normal: by_shared.transpose() * &by_shared - mixed.transpose() * &coupling,
        right: -(by_shared.transpose() * &residuals) - mixed.transpose() * &start,
        start,
        coupling,
        variance_alone: inverse.diagonal(),
    }
}

fn sum(reduced: &[Reduced], n: usize) -> (DMatrix<f64>, DVector<f64>) {
    let mut normal = DMatrix::zeros(n, n);
    let mut right = DVector::zeros(n);
    for frame in reduced {
        normal += &frame.normal;
        right += &frame.right;
    }
    (normal, right)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::random::Random;

    /// Lines y = a + b·t, each frame displaced by its own amount.
    struct Lines {
        seen: Vec<Vec<f64>>,
    }

    impl Frames for Lines {
        type At = [f64; 2];

        fn count(&self) -> usize {
            self.seen.len()
        }

        fn at(&self, shared: &[f64]) -> [f64; 2] {
            [shared[0], shared[1]]
        }

        fn residuals(&self, [a, b]: &[f64; 2], frame: usize, own: &[f64]) -> Vec<f64> {
            let seen = self.seen[frame].iter().enumerate();
            seen.map(|(t, y)| (a + b * t as f64 + own[0] - y) / 0.1)
                .collect()
        }
    }

    #[test]
    fn a_covariance_is_raised_where_it_is_smaller_alone() {
        let least = DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 2.0]);
        // Along (1, 1) the least has 3, along (1, −1) it has 1.
        let given = DMatrix::from_row_slice(2, 2, &[3.0, -2.0, -2.0, 3.0]);
        let raised = at_least(&given, &least).unwrap();
        let expected = DMatrix::from_row_slice(2, 2, &[4.0, -1.0, -1.0, 4.0]);
        assert!((raised - expected).amax() < 1e-12);
    }

    #[test]
    fn frames_own_errors_and_noise_are_found_and_make_true_uncertainties() {
        let mut random = Random::new(4);
        let (mut within, rounds) = ([0; 2], 60);
        for _ in 0..rounds {
            let seen = (0..40)
                .map(|_| {
                    let own = 0.5 * random.normal();
                    (0..20)
                        .map(|t| {
                            let wild = if t == 7 { 30.0 } else { 0.0 };
                            3.0 - 0.2 * f64::from(t) + own + 0.05 * random.normal() + wild
                        })
                        .collect()
                })
                .collect();
            let problem = Problem {
                nominal: &[0.0, 0.0],
                prior: &[10.0, 10.0],
                free: &[true, true],
                own: &[0.1],
                least_own: &[1e-3],
                most_own: &[f64::INFINITY],
                least_noise: 1e-6,
                finds_noise: true,
            };
            let solved = solve(&Lines { seen }, &problem, &[0.0, 0.0]).unwrap();
            assert!((solved.own[0] / 0.5 - 1.0).abs() < 0.5, "{:?}", solved.own);
            assert!((solved.noise / 0.5 - 1.0).abs() < 0.2, "{}", solved.noise);
            let covariance = solved.covariance(problem.prior, &[0, 1]).unwrap();
            for (k, truth) in [3.0, -0.2].into_iter().enumerate() {
                let u = covariance[(k, k)].sqrt();
                within[k] += usize::from((solved.shared[k] - truth).abs() < 2.0 * u);
            }
        }
        // 95 % of 60 are 57; three fewer are within chance.
        assert!(within.iter().all(|n| *n >= 53), "{within:?}");
    }
}
