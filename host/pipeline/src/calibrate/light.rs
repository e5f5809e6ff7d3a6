//! The light from the shading on the reference.

use crate::calibrate::error::CalibrateError;
use crate::calibrate::numbers::{NumberState, allow_for_kept};
use crate::calibrate::shading::{
    LEAST_OWN, LN_INTENSITY, LN_INTENSITY_PRIOR, OWN, ReferenceShape, ShadedFrame, Shading,
    ln_intensity, target_unknowns, thin,
};
use crate::calibrate::solve::{Frames, Problem, Solved, solve};
use crate::calibrate::unknowns::{CAMERA, LIGHT, TARGET, values, with_values};
use crate::calibrate::{are_free, covariance_of, priors, started, states};
use gonia_rig::Rig;
use nalgebra::DMatrix;

/// Frames of the reference that a light needs.
const FEWEST: usize = 6;
/// Standard deviation of a frame's level, or of values within a frame, beyond which a reference does not
/// scatter as it is thought to (relative).
const NOT_AS_THOUGHT: f64 = 0.02;
/// A frame's noise is seen in itself; the residuals' factor is found, and only zero makes no sense.
const LEAST_FACTOR: f64 = 1e-6;
/// Values within a frame may differ by so many times their noise, however large that is.
const NOISES: f64 = 3.0;

/// What became of the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightState {
    /// It was found.
    Found {
        /// Frames of the reference that it stands on.
        frames: usize,
        /// RMS of the reference's values about what the light makes of them, before and after, relative;
        /// the median frame's.
        shading: [f64; 2],
        /// Standard deviation of the lamp's intensity from frame to frame, relative.
        lamp: f64,
        /// Standard deviation of the light arm's θ and φ from frame to frame, degrees.
        arm_deg: [f64; 2],
    },
    /// It stays as it was: too few frames of the reference show anything.
    NoReference {
        /// Those that do.
        frames: usize,
        /// How many are needed.
        needed: usize,
    },
    /// It stays as it was: the reference does not scatter as the rig says, or without a reflectance as a
    /// smooth, reciprocal surface does.
    ReferenceUnlike {
        /// Standard deviation of a frame's level, relative.
        level: f64,
        /// Standard deviation of values within a frame, relative.
        within: f64,
    },
}

/// The light as found.
pub struct LightSolution {
    /// Values of [`LIGHT`].
    pub shared: Vec<f64>,
    /// Of [`CAMERA`] and [`LIGHT`] together.
    pub covariance: DMatrix<f64>,
    /// What became of each number.
    pub states: Vec<NumberState>,
}

/// The light, found or not.
pub struct Light {
    state: LightState,
    solution: Option<LightSolution>,
}

impl Light {
    /// Finds the light of a rig whose camera and target are known with `camera` as the covariance of
    /// [`CAMERA`]'s numbers.
    pub fn find(
        rig: &Rig,
        mut frames: Vec<ShadedFrame>,
        camera: &DMatrix<f64>,
    ) -> Result<Self, CalibrateError> {
        if frames.len() < FEWEST {
            let state = LightState::NoReference {
                frames: frames.len(),
                needed: FEWEST,
            };
            return Ok(Self::left(state));
        }
        let reference = ReferenceShape::of(rig);
        thin(&mut frames, reference);
        let shading = Shading {
            rig,
            frames: &frames,
        };
        let level = ln_intensity(rig, &frames);
        let nominal = nominal(rig, level, reference);
        let prior = with_target(rig, reference);
        let typical = median(frames.iter().map(ShadedFrame::noise).collect());
        let everything = free(&[true; LIGHT.len()], prior.len());
        let first = solve_light(&shading, &nominal, &prior, &everything, (Some(&OWN), None))?;
        let all = solve_light(
            &shading,
            &nominal,
            &prior,
            &everything,
            (None, Some(&first)),
        )?;
        if let Some(unlike) = unlike(&all, typical) {
            return Ok(Self::left(unlike));
        }
        let mut covariance = joined(camera, &all.information, &prior)?;
        let (at, light) = (CAMERA.len(), LIGHT.len());
        let own = covariance.view((at, at), (light, light)).into_owned();
        let states = states(
            &LIGHT,
            rig,
            &nominal[..light],
            &prior[..light],
            &all.shared,
            &own,
        );
        allow_for_kept(&mut covariance, at, &states, &nominal, &all.shared);
        let kept = free(&are_free(&states), prior.len());
        let solved = solve_light(
            &shading,
            &nominal,
            &prior,
            &kept,
            (Some(&all.own), Some(&all)),
        )?;
        // What the light was thought to be, with the intensity and the reference that fit it best.
        let held = free(&[false; LIGHT.len()], prior.len());
        let before = solve_light(&shading, &nominal, &prior, &held, (Some(&all.own), None))?;
        let misfit = |solved: &Solved| {
            let at = shading.at(&solved.shared);
            median(frames.iter().map(|frame| frame.misfit(&at)).collect())
        };
        let state = LightState::Found {
            frames: frames.len(),
            shading: [misfit(&before), misfit(&solved)],
            lamp: solved.own[2],
            arm_deg: [solved.own[0], solved.own[1]],
        };
        Ok(Self {
            state,
            solution: Some(LightSolution {
                shared: solved.shared[..light].to_vec(),
                covariance,
                states,
            }),
        })
    }

    fn left(state: LightState) -> Self {
        Self {
            state,
            solution: None,
        }
    }

    /// A rig with this light.
    pub fn rig(&self, rig: &Rig) -> Rig {
        match &self.solution {
            Some(solution) => with_values(&LIGHT, rig, &solution.shared),
            None => rig.clone(),
        }
    }

    /// What became of it.
    pub fn state(&self) -> LightState {
        self.state
    }

    /// Its numbers, where they were found.
    pub fn solution(&self) -> Option<&LightSolution> {
        self.solution.as_ref()
    }
}

/// What a reference shows that does not scatter as it is thought to, where its values have a `typical` noise.
fn unlike(solved: &Solved, typical: f64) -> Option<LightState> {
    let (level, within) = (solved.own[2], solved.noise * typical);
    let is_unlike = level > NOT_AS_THOUGHT || within > NOT_AS_THOUGHT.max(NOISES * typical);
    is_unlike.then_some(LightState::ReferenceUnlike { level, within })
}

/// Where the shared numbers start: the light's, the target's, the intensity's, the reference's.
fn nominal(rig: &Rig, level: f64, reference: ReferenceShape) -> Vec<f64> {
    let mut nominal = values(&LIGHT, rig);
    nominal.extend(values(target_unknowns(), rig));
    nominal.push(level);
    nominal.resize(nominal.len() + reference.priors().len(), 0.0);
    nominal
}

fn with_target(rig: &Rig, reference: ReferenceShape) -> Vec<f64> {
    let mut prior = priors(&LIGHT, rig);
    prior.extend(priors(target_unknowns(), rig));
    prior.push(LN_INTENSITY_PRIOR);
    prior.extend(reference.priors());
    prior
}

/// The target's numbers are those of the lines; intensity and reference are nobody else's.
fn free(light: &[bool], count: usize) -> Vec<bool> {
    let mut free = light.to_vec();
    free.extend([false; TARGET]);
    free.resize(count, true);
    free
}

/// `own` are the standard deviations of frames' own numbers, where they are known already; `start` is an
/// earlier solution.
fn solve_light(
    shading: &Shading<'_>,
    nominal: &[f64],
    prior: &[f64],
    free: &[bool],
    (own, start): (Option<&[f64]>, Option<&Solved>),
) -> Result<Solved, CalibrateError> {
    let problem = Problem {
        nominal,
        prior,
        free,
        own: own.unwrap_or(&OWN),
        least_own: &LEAST_OWN,
        least_noise: LEAST_FACTOR,
        finds_noise: own.is_none(),
    };
    let start = started(nominal, free, start);
    solve(shading, &problem, &start).ok_or(CalibrateError::NoSolution)
}

/// The covariance of camera, target and light together. With N the information of shading and l, t the
/// numbers of light (with intensity and reference) and target, l follows a change of t by G = −N_ll⁻¹ N_lt.
fn joined(
    camera: &DMatrix<f64>,
    information: &DMatrix<f64>,
    prior: &[f64],
) -> Result<DMatrix<f64>, CalibrateError> {
    let light: Vec<usize> = (0..LIGHT.len()).chain(LN_INTENSITY..prior.len()).collect();
    let pick = |of: &[usize]| {
        DMatrix::from_fn(light.len(), of.len(), |i, j| information[(light[i], of[j])])
    };
    let light_prior: Vec<f64> = light.iter().map(|i| prior[*i]).collect();
    let own = covariance_of(&pick(&light), &light_prior)?;
    let target: Vec<usize> = (LIGHT.len()..LIGHT.len() + TARGET).collect();
    let follows = -&own * pick(&target);
    let (n, l) = (CAMERA.len(), LIGHT.len());
    let target_rows = camera.rows(n - TARGET, TARGET).into_owned();
    let across = &follows * &target_rows;
    let target_alone = target_rows.columns(n - TARGET, TARGET).into_owned();
    let light_alone = own + &follows * target_alone * follows.transpose();
    let mut joined = DMatrix::zeros(n + l, n + l);
    joined.view_mut((0, 0), (n, n)).copy_from(camera);
    joined
        .view_mut((n, n), (l, l))
        .copy_from(&light_alone.view((0, 0), (l, l)));
    joined
        .view_mut((n, 0), (l, n))
        .copy_from(&across.rows(0, l));
    joined
        .view_mut((0, n), (n, l))
        .copy_from(&across.rows(0, l).transpose());
    Ok(joined)
}

fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
