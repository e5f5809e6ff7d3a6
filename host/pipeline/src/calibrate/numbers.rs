//! What became of each number, and what all of them together mean for directions.

use crate::calibrate::unknowns::{Moves, Unknown, with_values};
use gonia_brdf::direction::{Vec3, angle_between, dot};
use gonia_brdf::{Elementary, Pose};
use gonia_rig::{CameraModel, CameraShift, Rig};
use nalgebra::{DMatrix, DVector};

/// A number whose uncertainty stays above this share of its prior's is not determined.
const DETERMINED: f64 = 0.5;
/// Step of numeric derivatives, in standard uncertainties.
const STEP: f64 = 0.05;
/// Steps of polar angle from straight above to the lowest of the frames, and azimuths at most, over which angles
/// between directions are stated.
const POLAR_STEPS: usize = 6;
const AZIMUTHS: usize = 40;

/// A number of the rig.
#[derive(Clone, Debug, PartialEq)]
pub struct Number {
    /// Its key in `rig.toml`.
    pub name: &'static str,
    /// The value before.
    pub nominal: f64,
    /// The value now.
    pub found: f64,
    /// Its standard uncertainty.
    pub u: f64,
    /// Standard deviation of what was thought possible about the value before.
    pub prior: f64,
    /// Why it has the value that it has.
    pub state: NumberState,
}

/// Why a number has its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NumberState {
    /// The frames determine it.
    Found,
    /// The frames tell hardly more of it than was known: it stays about where it was.
    Undetermined,
    /// The frames would tell, and speak for its value as it was.
    NotNeeded,
}

/// The light as found.
pub struct LightSolution {
    /// Values of the light.
    pub shared: Vec<f64>,
    /// Of camera and light together.
    pub covariance: DMatrix<f64>,
    /// What became of each number.
    pub states: Vec<NumberState>,
}

impl Number {
    /// How well it is determined: the share of the prior's uncertainty that the frames took away.
    pub fn determined(&self) -> f64 {
        (1.0 - self.u / self.prior).max(0.0)
    }
}

/// What becomes of a number that was free to move to `value` with uncertainty `u`.
pub fn state_of(
    unknown: &Unknown,
    rig: &Rig,
    nominal: f64,
    prior: f64,
    value: f64,
    u: f64,
) -> NumberState {
    if u > DETERMINED * prior {
        return NumberState::Undetermined;
    }
    // The Savage-Dickey ratio: twice the logarithm of the Bayes factor for a number that differs from
    // the rig's against one that does not.
    let speaks = ((value - nominal) / u).powi(2) - 2.0 * (prior / u).natural_log();
    match unknown.moves {
        Moves::WhenNeeded(least) if speaks < 0.0 || (value - nominal).abs() < least(rig) => {
            NumberState::NotNeeded
        }
        _ => NumberState::Found,
    }
}

/// Numbers with some of them free and with those held at the rig's values.
pub struct Alternatives<'a> {
    /// The numbers that are held in the second case.
    pub held: &'a [usize],
    /// The rig's values.
    pub nominal: &'a [f64],
    /// Prior standard deviations.
    pub prior: &'a [f64],
    /// Values where all are free, and their covariance.
    pub free: (&'a [f64], &'a DMatrix<f64>),
    /// Values where some are held, and their covariance: nothing for those.
    pub kept: (&'a [f64], &'a DMatrix<f64>),
}

impl Alternatives<'_> {
    /// The covariance about the values with some held: both cases may be true, and what is true of one is as far
    /// from the other's values as the two are apart. Their odds are those of the frames (the Savage-Dickey ratio
    /// of all held numbers together), equal before.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        let (found, full) = self.free;
        let (at, known) = self.kept;
        if self.held.is_empty() {
            return Some(full.clone());
        }
        let n = self.held.len();
        let prior = |i: usize| self.prior[self.held[i]];
        let off = DVector::from_fn(n, |i, _| {
            (found[self.held[i]] - self.nominal[self.held[i]]) / prior(i)
        });
        let own = DMatrix::from_fn(n, n, |i, j| {
            full[(self.held[i], self.held[j])] / (prior(i) * prior(j))
        });
        let factor = own.cholesky()?;
        let ln_determinant: f64 = (factor.l_dirty().diagonal().iter())
            .map(|root| 2.0 * root.natural_log())
            .sum();
        let speaks = off.dot(&factor.solve(&off)) + ln_determinant;
        let share = 1.0 / (1.0 + (-0.5 * speaks).clamp(-50.0, 50.0).exponential());
        let apart = DVector::from_fn(found.len(), |k, _| found[k] - at[k]);
        Some(known * (1.0 - share) + (full + &apart * apart.transpose()) * share)
    }
}

/// A covariance of some numbers among all, of which the others are known.
pub fn among_all(all: usize, some: &[usize], covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let mut whole = DMatrix::zeros(all, all);
    for (i, k) in some.iter().enumerate() {
        for (j, l) in some.iter().enumerate() {
            whole[(*k, *l)] = covariance[(i, j)];
        }
    }
    whole
}

/// Unit vectors towards light and camera, as an arm's reading and a rig have them.
pub fn directions(rig: &Rig, pose: Pose) -> [Vec3; 2] {
    let camera = CameraModel::new(rig).placement(pose.view, CameraShift::default());
    [
        rig.light_at(pose.light).direction_from([0.0; 2]),
        camera.direction_from([0.0; 2]),
    ]
}

/// An angle over the poses, degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spread {
    /// Median.
    pub p50: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

impl Spread {
    /// Of some angles, degrees; zero of none.
    pub fn of(mut degrees: Vec<f64>) -> Self {
        degrees.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let last = degrees.len().checked_sub(1)?;
            degrees.get((share * last as f64).round() as usize).copied()
        };
        let at = |share| at(share).unwrap_or(0.0);
        Self {
            p50: at(0.5),
            p95: at(0.95),
            max: at(1.0),
        }
    }
}

/// Poses over which angles between directions are stated: polar angles in even steps from straight above to the
/// lowest of the frames, at the frames' azimuths. Over the frames themselves uncertainties would seem too small:
/// most are low, and the fewest from above, where the light is known least.
pub fn stated_poses(frames: &[Pose]) -> Vec<Pose> {
    let lowest = |of: fn(&Pose) -> f64| frames.iter().map(of).fold(0.0, f64::max);
    let [light, view] = [
        lowest(|pose| pose.light.theta),
        lowest(|pose| pose.view.theta),
    ];
    let every = frames.len().div_ceil(AZIMUTHS).max(1);
    let at = |pose: &Pose, step: usize| {
        let share = step as f64 / POLAR_STEPS as f64;
        let mut pose = *pose;
        (pose.light.theta, pose.view.theta) = (share * light, share * view);
        pose
    };
    let azimuths = frames.iter().step_by(every);
    azimuths
        .flat_map(|pose| (0..=POLAR_STEPS).map(move |step| at(pose, step)))
        .collect()
}

/// By how much directions of light and view differ between two rigs.
pub fn changes(from: &Rig, to: &Rig, poses: &[Pose]) -> [Spread; 2] {
    [0, 1].map(|i| {
        let apart =
            |pose: &Pose| angle_between(directions(from, *pose)[i], directions(to, *pose)[i]);
        Spread::of(poses.iter().map(|pose| apart(pose).to_degrees()).collect())
    })
}

/// The squares of the standard uncertainties of the directions of light and view at a pose, both components together, square
/// radians, that follow from a covariance of numbers. `beside` are rigs in which one of the numbers is larger by a step, each
/// with its step; none where that number is known for certain.
pub fn direction_variances(
    here: &Rig,
    beside: &[Option<(f64, Rig)>],
    covariance: impl Fn(usize, usize) -> f64,
    pose: Pose,
) -> [f64; 2] {
    let at = directions(here, pose);
    let slopes: Vec<[Vec3; 2]> = beside
        .iter()
        .map(|moved| match moved {
            Some((step, rig)) => {
                let to = directions(rig, pose);
                [0, 1].map(|i| [0, 1, 2].map(|axis| (to[i][axis] - at[i][axis]) / step))
            }
            None => [[0.0; 3]; 2],
        })
        .collect();
    [0, 1].map(|i| {
        let mut sum = 0.0;
        for (j, of_j) in slopes.iter().enumerate() {
            for (k, of_k) in slopes.iter().enumerate() {
                sum += covariance(j, k) * dot(of_j[i], of_k[i]);
            }
        }
        sum.max(0.0)
    })
}

/// Standard uncertainties of directions of light and view (both components together) that follow from those
/// of the numbers.
pub fn direction_u(
    rig: &Rig,
    unknowns: &[&'static [Unknown]],
    values: &[f64],
    covariance: &DMatrix<f64>,
    poses: &[Pose],
) -> [Spread; 2] {
    let rig_with = |values: &[f64]| {
        let mut rig = rig.clone();
        let mut rest = values;
        for some in unknowns {
            let (these, after) = rest.split_at(some.len());
            rig = with_values(some, &rig, these);
            rest = after;
        }
        rig
    };
    let beside: Vec<Option<(f64, Rig)>> = (0..values.len())
        .map(|k| {
            let step = STEP * covariance[(k, k)].sqrt();
            let mut moved = values.to_vec();
            moved[k] += step;
            (step > 0.0).then(|| (step, rig_with(&moved)))
        })
        .collect();
    let here = rig_with(values);
    let u = |pose: &Pose| {
        let variances = direction_variances(&here, &beside, |j, k| covariance[(j, k)], *pose);
        variances.map(|variance| variance.sqrt().to_degrees())
    };
    let all: Vec<[f64; 2]> = poses.iter().map(u).collect();
    [0, 1].map(|i| Spread::of(all.iter().map(|u| u[i]).collect()))
}
