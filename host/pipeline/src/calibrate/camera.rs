//! Camera, camera arm and target from the lines of all frames.

use crate::calibrate::MISFITS;
use crate::calibrate::error::CalibrateError;
use crate::calibrate::lines::{self, LineFrame, Lines, misfit_px};
use crate::calibrate::numbers::{Alternatives, NumberState, among_all, state_of};
use crate::calibrate::solve::{Problem, Solved, solve};
use crate::calibrate::unknowns::{CAMERA, Moves, Unknown, values, with_values};
use gonia_brdf::direction::angle_between;
use gonia_rig::Rig;
use nalgebra::DMatrix;

/// A calibration needs this many frames that show the target.
pub const FEWEST: usize = 6;

/// Views must differ by this much, degrees.
const APART_DEG: f64 = 15.0;

/// A frame whose lines are further from the found camera than this share of the frame's width, and than so
/// many pixels, is not of this rig.
const MISFIT_WIDTHS: f64 = 1e-3;

const LEAST_MISFIT_PX: f64 = 0.3;

/// Prior standard deviations of numbers of a rig.
pub fn priors(unknowns: &[Unknown], rig: &Rig) -> Vec<f64> {
    unknowns.iter().map(|u| (u.prior)(rig)).collect()
}

/// Standard deviations of frames' own numbers.
#[derive(Clone, Copy)]
pub enum Own<'a> {
    /// Those of most rigs will do.
    Usual,
    /// They are to be found.
    Unknown,
    /// They were found.
    Found(&'a [f64]),
}

/// Camera, camera arm and target from the lines of frames; `start` is an earlier solution.
pub fn solve_camera(
    rig: &Rig,
    frames: &[LineFrame],
    free: &[bool],
    own: Own<'_>,
    start: Option<&Solved>,
) -> Result<Solved, CalibrateError> {
    let mut nominal = values(&CAMERA, rig);
    nominal.extend([0.0; lines::BIAS.len()]);
    let mut free = free.to_vec();
    free.extend([true; lines::BIAS.len()]);
    let problem = Problem {
        nominal: &nominal,
        prior: &camera_priors(rig),
        free: &free,
        own: match own {
            Own::Found(own) => own,
            Own::Usual | Own::Unknown => &lines::OWN,
        },
        least_own: &lines::LEAST_OWN,
        most_own: &[f64::INFINITY; lines::OWN.len()],
        least_noise: lines::LEAST_NOISE,
        finds_noise: matches!(own, Own::Unknown),
    };
    let start = started(&nominal, &free, start);
    solve(&Lines { rig, frames }, &problem, &start).ok_or(CalibrateError::NoSolution)
}

/// Where to start: free numbers where an earlier solution has them.
pub fn started(nominal: &[f64], free: &[bool], from: Option<&Solved>) -> Vec<f64> {
    let Some(from) = from else {
        return nominal.to_vec();
    };
    (0..nominal.len())
        .map(|k| if free[k] { from.shared[k] } else { nominal[k] })
        .collect()
}

/// Of the camera's numbers and of what lines have in common.
fn camera_priors(rig: &Rig) -> Vec<f64> {
    let mut prior = priors(&CAMERA, rig);
    prior.extend(lines::BIAS);
    prior
}

/// The inverse of data's information and the priors', in the numbers' own units.
pub fn covariance_of(
    information: &DMatrix<f64>,
    prior: &[f64],
) -> Result<DMatrix<f64>, CalibrateError> {
    let n = prior.len();
    // In units of the priors: numbers in pixels stand beside numbers in kilometres.
    let scaled = DMatrix::from_fn(n, n, |i, j| {
        information[(i, j)] * prior[i] * prior[j] + f64::from(u8::from(i == j))
    });
    let inverse = scaled
        .cholesky()
        .ok_or(CalibrateError::NoSolution)?
        .inverse();
    Ok(DMatrix::from_fn(n, n, |i, j| {
        inverse[(i, j)] * prior[i] * prior[j]
    }))
}

/// Which numbers may move once all have, and why the others may not.
pub fn states(
    unknowns: &[Unknown],
    rig: &Rig,
    nominal: &[f64],
    prior: &[f64],
    found: &[f64],
    covariance: &DMatrix<f64>,
) -> Vec<NumberState> {
    (0..unknowns.len())
        .map(|k| {
            let u = covariance[(k, k)].sqrt();
            state_of(&unknowns[k], rig, nominal[k], prior[k], found[k], u)
        })
        .collect()
}

/// Numbers that the frames do not tell by themselves may still be told with others: held at the rig's values they
/// would spoil those. They stay about where they were, within what is thought possible. Lens and beam are held:
/// most rigs have none.
pub fn are_free(unknowns: &[Unknown], states: &[NumberState]) -> Vec<bool> {
    let is_free = |(unknown, state): (&Unknown, &NumberState)| match state {
        NumberState::Found => true,
        NumberState::Undetermined => matches!(unknown.moves, Moves::WhenDetermined),
        NumberState::NotNeeded => false,
    };
    unknowns.iter().zip(states).map(is_free).collect()
}

fn check_views(looked_at: usize, lines: &[LineFrame]) -> Result<(), CalibrateError> {
    if lines.is_empty() {
        return Err(CalibrateError::NoLines { frames: looked_at });
    }
    if lines.len() < FEWEST {
        return Err(CalibrateError::TooFew {
            frames: lines.len(),
            needed: FEWEST,
        });
    }
    let one = lines[0].row.pose.view.to_vec3();
    let furthest = lines
        .iter()
        .map(|frame| angle_between(one, frame.row.pose.view.to_vec3()).to_degrees())
        .fold(0.0, f64::max);
    if furthest < APART_DEG {
        return Err(CalibrateError::OneDirection {
            apart_deg: furthest,
            needed_deg: APART_DEG,
        });
    }
    Ok(())
}

fn most_misfit_px(rig: &Rig) -> f64 {
    (MISFIT_WIDTHS * rig.camera.width_px as f64).max(LEAST_MISFIT_PX)
}

/// Whether a frame is a rig's, by its lines.
pub fn fits(rig: &Rig, frame: &LineFrame) -> bool {
    misfit_px(rig, frame) <= most_misfit_px(rig)
}

/// Leaves out frames that do not fit the camera that most fit.
fn keep_fitting(rig: &Rig, lines: &mut Vec<LineFrame>) -> Result<Solved, CalibrateError> {
    let solved = solve_camera(rig, lines, &[true; CAMERA.len()], Own::Usual, None)?;
    let camera = with_values(&CAMERA, rig, &solved.shared);
    let misfits: Vec<f64> = lines
        .iter()
        .map(|frame| misfit_px(&camera, frame))
        .collect();
    let limit = most_misfit_px(rig);
    let total = lines.len();
    let odd = misfits
        .iter()
        .position(|m| *m > limit)
        .map(|i| (lines[i].row.frame, misfits[i]));
    let mut i = 0;
    lines.retain(|_| {
        i += 1;
        misfits[i - 1] <= limit
    });
    match odd {
        Some((frame, misfit_px)) if (total - lines.len()) as f64 > MISFITS * total as f64 => {
            Err(CalibrateError::TwoRigs {
                misfits: total - lines.len(),
                frames: total,
                frame,
                misfit_px,
            })
        }
        _ => Ok(solved),
    }
}

/// Camera, camera arm and target as found.
pub struct CameraSolution {
    /// Values of [`CAMERA`].
    pub shared: Vec<f64>,
    /// Theirs.
    pub covariance: DMatrix<f64>,
    /// What became of each.
    pub states: Vec<NumberState>,
    /// Standard deviations of frames' own numbers.
    pub own: Vec<f64>,
}

/// Frames that do not fit are left out of `lines`.
pub fn find_camera(
    rig: &Rig,
    looked_at: usize,
    lines: &mut Vec<LineFrame>,
) -> Result<CameraSolution, CalibrateError> {
    check_views(looked_at, lines)?;
    let first = keep_fitting(rig, lines)?;
    check_views(looked_at, lines)?;
    let every = [true; CAMERA.len()];
    let all = solve_camera(rig, lines, &every, Own::Unknown, Some(&first))?;
    let priors_of_all = camera_priors(rig);
    let n = CAMERA.len();
    // What lines have in common is nobody else's number.
    let covariance = |solved: &Solved, free: &[bool]| {
        let mut some: Vec<usize> = (0..n).filter(|k| free[*k]).collect();
        let of_rig = some.len();
        some.extend(n..priors_of_all.len());
        let own = solved.covariance(&priors_of_all, &some);
        let own = own.ok_or(CalibrateError::NoSolution)?;
        let own = own.view((0, 0), (of_rig, of_rig)).into_owned();
        Ok::<_, CalibrateError>(among_all(n, &some[..of_rig], &own))
    };
    let full = covariance(&all, &every)?;
    let (nominal, prior) = (values(&CAMERA, rig), priors(&CAMERA, rig));
    let states = states(&CAMERA, rig, &nominal, &prior, &all.shared, &full);
    let free = are_free(&CAMERA, &states);
    let own = Own::Found(&all.own);
    let kept = solve_camera(rig, lines, &free, own, Some(&all))?;
    let held: Vec<usize> = (0..n).filter(|k| !free[*k]).collect();
    let alternatives = Alternatives {
        held: &held,
        nominal: &nominal,
        prior: &prior,
        free: (&all.shared[..n], &full),
        kept: (&kept.shared[..n], &covariance(&kept, &free)?),
    };
    let covariance = alternatives.covariance();
    let covariance = covariance.ok_or(CalibrateError::NoSolution)?;
    Ok(CameraSolution {
        shared: kept.shared[..CAMERA.len()].to_vec(),
        covariance,
        states,
        own: kept.own,
    })
}
