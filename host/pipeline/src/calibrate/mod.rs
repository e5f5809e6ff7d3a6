//! A rig's geometry from its own frames.
//!
//! 1. The four lines are found in a few frames, from far off, and one least squares makes a first camera.
//! 2. With it they are found in more frames, more closely.
//! 3. With that, in all chosen frames to hundredths of a pixel. Camera, camera arm and target follow from
//!    the lines of all frames together; values of the reference's grid points are read. Where their shading
//!    shows a beam, the lines are found once more in its light.
//! 4. The light and its arm follow from the shading on the reference. Lines say where the target is;
//!    shading takes that from them, with its uncertainty, and does not change it: a reference that is not
//!    quite what it is thought to be then spoils no camera.
//!
//! All of it is weighted least squares with priors ([`solve`]); which numbers may move, and how far, is
//! said in [`unknowns`].

mod choose;
mod error;
mod light;
mod light_off;
mod lines;
mod mirror;
pub(crate) mod numbers;
mod orientation;
mod residuals;
mod shading;
mod solve;
mod unknowns;

pub use choose::spread_poses;
pub use error::CalibrateError;
pub use light::LightState;
pub(crate) use light_off::{LightOff, light_off};
pub use mirror::MirrorFit;
pub use numbers::{Number, NumberState, Spread};
pub use residuals::{LineResidual, Residuals, ShadingResidual};
pub(crate) use shading::{ReferenceValue, ShadedFrame};

use crate::process::{FrameRow, FrameSampler, FrameSource, Hidden, Outcome, Role, load};
use crate::progress::{Cancelled, Progress, Step, step};
use choose::{chosen, spread};
use gonia_brdf::Pose;
use gonia_brdf::direction::angle_between;
use gonia_formats::checksum;
use gonia_imaging::{
    Highlight, NoHighlight, Orientation, Registrar, SamplingGrid, Search, find_highlight,
};
use gonia_rig::{Calibration, Remark, Rig};
use light::{Known, Light};
use lines::{LineFrame, Lines, misfit_px};
use mirror::{MirrorFrame, MirrorLight};
use nalgebra::DMatrix;
use numbers::{allow_for_kept, changes, direction_u, state_of};
use rayon::prelude::*;
use solve::{Problem, Solved, solve};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};
use unknowns::{CAMERA, LIGHT, Moves, Unknown, values, with_values};

/// Frames in which lines are first looked for from far off, and how many of them must show any.
const FIRST: usize = 16;
const ENOUGH_FIRST: usize = 10;
/// Frames in which they are looked for with the first camera.
const SECOND: usize = 48;
/// A calibration needs this many frames that show the target.
const FEWEST: usize = 6;
/// Views must differ by this much, degrees.
const APART_DEG: f64 = 15.0;
/// A frame whose lines are further from the found camera than this share of the frame's width, and than so
/// many pixels, is not of this rig.
const MISFIT_WIDTHS: f64 = 1e-3;
const LEAST_MISFIT_PX: f64 = 0.3;
/// Frames of the first steps, whose camera is not known well yet: this share of the width.
const FIRST_MISFIT_WIDTHS: f64 = 8e-3;
/// More than this share of frames that do not fit are another rig's.
pub(crate) const MISFITS: f64 = 0.1;
/// Where fewer of the frames than this share show the target where the found camera sees it, that is said.
const SHOWN: f64 = 0.75;

/// A calibrated rig, and what speaks for it.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// The rig with its numbers as found, and with its `calibration`, whose date is empty: the caller
    /// knows the time.
    pub rig: Rig,
    /// Every number that was looked for.
    pub numbers: Vec<Number>,
    /// Frames that were looked at, and that showed the target.
    pub frames: [usize; 2],
    /// RMS distance of fiducial lines from where the rig has them, before and after, pixels: the median
    /// frame's.
    pub lines_px: [f64; 2],
    /// What became of the light.
    pub light: LightState,
    /// What frames of a mirror say of it.
    pub mirror: Option<MirrorFit>,
    /// By how much directions of light and view changed, degrees, over the frames.
    pub changes: [Spread; 2],
    /// Their standard uncertainties now, degrees; of a light that was left as it was, what was thought possible.
    pub direction_u: [Spread; 2],
    /// Standard deviation of the camera arm's θ and φ from frame to frame, degrees.
    pub camera_arm_deg: [f64; 2],
    /// What is left of lines and shading, for a picture.
    pub residuals: Residuals,
    /// What is to be said of frames.
    pub remarks: Vec<Remark>,
}

/// Finds a rig's geometry from frames of the target at many poses, and the light's from those of the
/// reference. Priors lie about the rig's own numbers: a calibrated rig can be calibrated again.
///
/// # Errors
/// No frame can be read, too few show the target, all are of one direction, or they are of two rigs.
pub fn calibrate(
    rig: &Rig,
    source: &dyn FrameSource,
    progress: &Progress<'_>,
) -> Result<Calibrated, CalibrateError> {
    let rows = chosen(source.rows());
    if rows.len() < FEWEST {
        return Err(CalibrateError::TooFew {
            frames: rows.len(),
            needed: FEWEST,
        });
    }
    let seen = step(progress, Step::FindingLines, |tell| {
        let look = Look::new(rig, source, 2 * rows.len() + SECOND + FIRST, tell);
        let seen = find_lines(rig, &rows, &look)?;
        look_again(rig, &rows, seen, &look)
    })?;
    step(progress, Step::SolvingGeometry, |_| {
        conclude(rig, rows.len(), seen)
    })
}

/// What all chosen frames show.
#[derive(Clone)]
struct Seen {
    lines: Vec<LineFrame>,
    shaded: Vec<ShadedFrame>,
    mirrors: Vec<MirrorFrame>,
    checksum: String,
    remarks: Vec<Remark>,
}

/// Looks at frames one by one, in parallel, and says how many are done.
struct Look<'a> {
    rig: &'a Rig,
    source: &'a dyn FrameSource,
    total: usize,
    done: AtomicUsize,
    tell: &'a gonia_brdf::progress::Progress<'a>,
}

/// What became of each frame, in order; an error where it cannot be read.
type Looked<T> = Vec<Result<T, crate::process::ProcessError>>;

impl<'a> Look<'a> {
    fn new(
        rig: &'a Rig,
        source: &'a dyn FrameSource,
        total: usize,
        tell: &'a gonia_brdf::progress::Progress<'a>,
    ) -> Self {
        Self {
            rig,
            source,
            total,
            done: AtomicUsize::new(0),
            tell,
        }
    }

    fn each<T: Send>(
        &self,
        rows: &[FrameRow],
        work: impl Fn(&FrameRow, &gonia_rig::Frame) -> T + Sync,
    ) -> Result<Looked<T>, CalibrateError> {
        let one = |row: &FrameRow| {
            let done = 1 + self.done.fetch_add(1, Ordering::Relaxed);
            if (self.tell)(done as f64 / self.total as f64) == ControlFlow::Break(()) {
                return Err(Cancelled);
            }
            Ok(load(self.rig, self.source, row).map(|(frame, _)| work(row, &frame)))
        };
        let all: Vec<Result<_, Cancelled>> = rows.par_iter().map(one).collect();
        let mut looked = Vec::with_capacity(rows.len());
        for frame in all {
            match frame? {
                Err(error) if error.is_of_the_system() => {
                    return Err(CalibrateError::Frames(error));
                }
                frame => looked.push(frame),
            }
        }
        Ok(looked)
    }

    /// Lines of frames, those without any left out.
    fn lines(
        &self,
        rig: &Rig,
        rows: &[FrameRow],
        searches: &[Search],
    ) -> Result<Vec<LineFrame>, CalibrateError> {
        let registrar = Registrar::new(rig);
        let looked = self.each(rows, |row, frame| {
            let found = searches
                .iter()
                .map(|search| registrar.line_points(frame, row.pose, *search))
                .find(|points| !points.is_empty());
            found.map(|points| LineFrame {
                row: row.clone(),
                points,
            })
        })?;
        Ok(looked.into_iter().flatten().flatten().collect())
    }
}

fn find_lines(rig: &Rig, rows: &[FrameRow], look: &Look<'_>) -> Result<Seen, CalibrateError> {
    // From far off, frames from above are the plainest; where they are few, the others have to do.
    let mut order = spread(rows, FIRST);
    let rest: Vec<FrameRow> = rows
        .iter()
        .filter(|r| !order.contains(r))
        .cloned()
        .collect();
    let mut first = look.lines(rig, &order, &[Search::Far, Search::About])?;
    for some in rest.chunks(FIRST) {
        if first.len() >= ENOUGH_FIRST {
            break;
        }
        first.extend(look.lines(rig, some, &[Search::Far, Search::About])?);
        order.extend_from_slice(some);
    }
    let mut camera = rig.clone();
    if !first.is_empty() {
        camera = first_camera(rig, &mut first)?;
        let mut second = look.lines(&camera, &spread(rows, SECOND), &[Search::About])?;
        if !second.is_empty() {
            camera = first_camera(rig, &mut second)?;
        }
    }
    let registrar = Registrar::new(&camera);
    let (sampler, grid) = (FrameSampler::new(&camera), SamplingGrid::new(&camera));
    let looked = look.each(rows, |row, frame| {
        let points = registrar.line_points(frame, row.pose, Search::Near);
        let orientation = registrar.orientation(frame, row.pose.view);
        let sampled = (row.role == Role::Reference && !points.is_empty())
            .then(|| sampler.sample(frame, row, Hidden::Find))
            .filter(|sampled| sampled.report.outcome == Outcome::Locked);
        let shaded = sampled.and_then(|sampled| ShadedFrame::new(&camera, &grid, &sampled));
        let lines = LineFrame {
            row: row.clone(),
            points,
        };
        let highlight = (row.role == Role::Mirror && !lines.points.is_empty()).then(|| {
            let registration = registrar.register(frame, row.pose);
            find_highlight(frame, &registration, &camera.target)
        });
        Shows {
            lines,
            shaded,
            highlight,
            orientation,
            checksum: checksum::of_frame(frame),
        }
    })?;
    gather(looked)
}

/// Lines that lie beside a material are placed by the light that falls on both: where the light has a beam that
/// is not in the rig, they are looked at once more, with the light that the frames show.
fn look_again(
    rig: &Rig,
    rows: &[FrameRow],
    mut seen: Seen,
    look: &Look<'_>,
) -> Result<Seen, CalibrateError> {
    // Without shading there is no light to be found.
    if seen.shaded.is_empty() {
        return Ok(seen);
    }
    // What keeps these frames from a calibration is said when they are concluded from.
    let Ok(found) = conclude(rig, rows.len(), seen.clone()) else {
        return Ok(seen);
    };
    if found.rig.light.beam == rig.light.beam {
        return Ok(seen);
    }
    let had = |row: &FrameRow| seen.lines.iter().any(|line| line.row == *row);
    let rows: Vec<FrameRow> = rows.iter().filter(|row| had(row)).cloned().collect();
    seen.lines = look.lines(&found.rig, &rows, &[Search::Near])?;
    Ok(seen)
}

/// What one frame shows.
struct Shows {
    lines: LineFrame,
    shaded: Option<ShadedFrame>,
    highlight: Option<Result<Highlight, NoHighlight>>,
    orientation: Option<Orientation>,
    checksum: String,
}

fn gather(looked: Looked<Shows>) -> Result<Seen, CalibrateError> {
    let (total, mut lost, mut first_error) = (looked.len(), 0, None);
    let (mut lines, mut shaded, mut sums) = (Vec::new(), Vec::new(), String::new());
    let (mut orientations, mut mirrors, mut dark_mirrors) = (Vec::new(), Vec::new(), 0);
    for one in looked {
        match one {
            Ok(shows) => {
                sums.push_str(&shows.checksum);
                if let Some(highlight) = shows.highlight {
                    mirrors.push(mirror_frame(&shows.lines, highlight)?);
                }
                if shows.lines.points.is_empty() {
                    dark_mirrors += usize::from(shows.lines.row.role == Role::Mirror);
                } else {
                    orientations.push((shows.lines.row.frame, shows.orientation));
                    let is_turned = matches!(shows.orientation, Some(Orientation::Turned(_)));
                    if !is_turned {
                        lines.push(shows.lines);
                        shaded.extend(shows.shaded);
                    }
                }
            }
            Err(error) => {
                lost += 1;
                first_error.get_or_insert(error);
            }
        }
    }
    let mut remarks = match first_error {
        Some(error) if lost == total => return Err(CalibrateError::Frames(error)),
        Some(error) => vec![Remark::new(
            format_args!("{lost} of {total} frames"),
            format_args!("they cannot be used (the first: {error})"),
            "the calibration stands on the others",
        )],
        None => Vec::new(),
    };
    remarks.extend(orientation::judged(&orientations)?);
    if dark_mirrors > 0 {
        remarks.push(Remark::new(
            format_args!("{dark_mirrors} frames of the mirror"),
            "they do not show the fiducial lines, and are left out",
            "let the light reach the lines about the mirror too",
        ));
    }
    Ok(Seen {
        lines,
        shaded,
        mirrors,
        checksum: checksum::of_bytes(sums.as_bytes()),
        remarks,
    })
}

fn mirror_frame(
    lines: &LineFrame,
    highlight: Result<Highlight, NoHighlight>,
) -> Result<MirrorFrame, CalibrateError> {
    let row = &lines.row;
    match highlight {
        Ok(highlight) => Ok(MirrorFrame {
            lines: lines.clone(),
            highlight,
        }),
        Err(why) => Err(CalibrateError::NoHighlight {
            frame: row.frame,
            file: row.file.clone(),
            why,
        }),
    }
}

/// The camera that fits lines that were found from far off; frames that it does not fit are left out.
fn first_camera(rig: &Rig, frames: &mut Vec<LineFrame>) -> Result<Rig, CalibrateError> {
    let free = [true; CAMERA.len()];
    let solved = solve_camera(rig, frames, &free, Own::Usual, None)?;
    let camera = with_values(&CAMERA, rig, &solved.shared);
    let before = frames.len();
    frames.retain(|frame| fits(&camera, frame, FIRST_MISFIT_WIDTHS));
    if frames.len() == before || frames.is_empty() {
        return Ok(camera);
    }
    let solved = solve_camera(rig, frames, &free, Own::Usual, None)?;
    Ok(with_values(&CAMERA, rig, &solved.shared))
}

fn fits(camera: &Rig, frame: &LineFrame, widths: f64) -> bool {
    misfit_px(camera, frame) <= (widths * camera.camera.width_px as f64).max(0.5)
}

fn priors(unknowns: &[Unknown], rig: &Rig) -> Vec<f64> {
    unknowns.iter().map(|u| (u.prior)(rig)).collect()
}

/// Standard deviations of frames' own numbers.
#[derive(Clone, Copy)]
enum Own<'a> {
    /// Those of most rigs will do.
    Usual,
    /// They are to be found.
    Unknown,
    /// They were found.
    Found(&'a [f64]),
}

fn solve_camera(
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
        least_noise: lines::LEAST_NOISE,
        finds_noise: matches!(own, Own::Unknown),
    };
    let start = started(&nominal, &free, start);
    solve(&Lines { rig, frames }, &problem, &start).ok_or(CalibrateError::NoSolution)
}

/// Where to start: free numbers where an earlier solution has them.
fn started(nominal: &[f64], free: &[bool], from: Option<&Solved>) -> Vec<f64> {
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
fn covariance_of(
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
fn states(
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
fn are_free(unknowns: &[Unknown], states: &[NumberState]) -> Vec<bool> {
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

/// Leaves out frames that do not fit the camera that most fit.
fn keep_fitting(rig: &Rig, lines: &mut Vec<LineFrame>) -> Result<Solved, CalibrateError> {
    let solved = solve_camera(rig, lines, &[true; CAMERA.len()], Own::Usual, None)?;
    let camera = with_values(&CAMERA, rig, &solved.shared);
    let misfits: Vec<f64> = lines
        .iter()
        .map(|frame| misfit_px(&camera, frame))
        .collect();
    let limit = (MISFIT_WIDTHS * rig.camera.width_px as f64).max(LEAST_MISFIT_PX);
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
struct CameraSolution {
    /// Values of [`CAMERA`].
    shared: Vec<f64>,
    covariance: DMatrix<f64>,
    states: Vec<NumberState>,
    /// Standard deviations of frames' own numbers.
    own: Vec<f64>,
}

/// Frames that do not fit are left out of `lines`.
fn find_camera(
    rig: &Rig,
    looked_at: usize,
    lines: &mut Vec<LineFrame>,
) -> Result<CameraSolution, CalibrateError> {
    check_views(looked_at, lines)?;
    let first = keep_fitting(rig, lines)?;
    check_views(looked_at, lines)?;
    let every = [true; CAMERA.len()];
    let all = solve_camera(rig, lines, &every, Own::Unknown, Some(&first))?;
    let covariance = covariance_of(&all.information, &camera_priors(rig))?;
    let mut covariance = covariance
        .view((0, 0), (CAMERA.len(), CAMERA.len()))
        .into_owned();
    let (nominal, prior) = (values(&CAMERA, rig), priors(&CAMERA, rig));
    let states = states(&CAMERA, rig, &nominal, &prior, &all.shared, &covariance);
    allow_for_kept(&mut covariance, 0, &states, &nominal, &all.shared);
    let own = Own::Found(&all.own);
    let kept = solve_camera(rig, lines, &are_free(&CAMERA, &states), own, Some(&all))?;
    Ok(CameraSolution {
        shared: kept.shared[..CAMERA.len()].to_vec(),
        covariance,
        states,
        own: kept.own,
    })
}

fn conclude(rig: &Rig, looked_at: usize, seen: Seen) -> Result<Calibrated, CalibrateError> {
    let mut lines = seen.lines;
    let camera = find_camera(rig, looked_at, &mut lines)?;
    let with_camera = with_values(&CAMERA, rig, &camera.shared);
    // Frames that another camera took show nothing of this one's light.
    let is_kept = |mirror: &MirrorFrame| lines.iter().any(|line| line.row == mirror.lines.row);
    let mut mirrors = seen.mirrors;
    mirrors.retain(is_kept);
    let arm_deg = [camera.own[0], camera.own[1]];
    let mirror = MirrorLight::find(&with_camera, &mirrors, &camera.covariance, arm_deg)?;
    let known = Known {
        camera: &camera.covariance,
        mirror: mirror.as_ref(),
    };
    let light = Light::find(&with_camera, seen.shaded, &known)?;
    let mut remarks = seen.remarks;
    remarks.extend(mirror.iter().flat_map(MirrorLight::remarks));
    remarks.extend(light.remark());
    remarks.extend(few_shown(looked_at, lines.len()));
    let found = light.rig(&with_camera);

    let poses: Vec<Pose> = lines.iter().map(|frame| frame.row.pose).collect();
    let mut numbers = table(
        &CAMERA,
        &values(&CAMERA, rig),
        &camera.shared,
        &priors(&CAMERA, rig),
        &camera.covariance,
        &camera.states,
    );
    let mut unknowns = vec![&CAMERA[..]];
    let (mut shared, mut covariance) = (camera.shared, camera.covariance);
    if let Some(light) = light.solution() {
        let prior = priors(&LIGHT, rig);
        let own = light
            .covariance
            .view((CAMERA.len(), CAMERA.len()), (LIGHT.len(), LIGHT.len()));
        let own = own.into_owned();
        let nominal = values(&LIGHT, rig);
        numbers.extend(table(
            &LIGHT,
            &nominal,
            &light.shared,
            &prior,
            &own,
            &light.states,
        ));
        unknowns.push(&LIGHT[..]);
        shared.extend_from_slice(&light.shared);
        covariance = light.covariance.clone();
    }
    let direction_u = match light.solution() {
        Some(_) => direction_u(rig, &unknowns, &shared, &covariance, &poses),
        None => direction_u_of_light_as_it_was(rig, &shared, &covariance, &poses),
    };
    let median = |rig: &Rig| Spread::of(lines.iter().map(|f| misfit_px(rig, f)).collect()).p50;
    let calibration = record(&numbers, lines.len(), seen.checksum, shared, &covariance);
    Ok(Calibrated {
        frames: [looked_at, lines.len()],
        lines_px: [median(rig), median(&found)],
        changes: changes(rig, &found, &poses),
        direction_u,
        light: light.state(),
        mirror: mirror.as_ref().map(MirrorLight::fit),
        camera_arm_deg: [camera.own[0], camera.own[1]],
        remarks,
        residuals: Residuals {
            size_px: [rig.camera.width_px, rig.camera.height_px],
            lines: residuals::of_lines(rig, &found, &lines),
            shading: light.residuals().to_vec(),
        },
        numbers,
        rig: Rig {
            calibration: Some(calibration),
            ..found
        },
    })
}

/// Standard uncertainties of directions where the light stays as it was: nobody knows more of it than before.
fn direction_u_of_light_as_it_was(
    rig: &Rig,
    camera: &[f64],
    covariance: &DMatrix<f64>,
    poses: &[Pose],
) -> [Spread; 2] {
    let numbers = [camera, &values(&LIGHT, rig)].concat();
    let (n, all) = (camera.len(), numbers.len());
    let mut joined = DMatrix::zeros(all, all);
    joined.view_mut((0, 0), (n, n)).copy_from(covariance);
    for (k, prior) in priors(&LIGHT, rig).into_iter().enumerate() {
        joined[(n + k, n + k)] = prior * prior;
    }
    direction_u(rig, &[&CAMERA, &LIGHT], &numbers, &joined, poses)
}

/// That many frames do not bear the found camera out: of few frames a wrong one can fit those that do.
fn few_shown(looked_at: usize, shown: usize) -> Option<Remark> {
    ((shown as f64) < SHOWN * looked_at as f64).then(|| {
        Remark::new(
            format_args!("{} of {looked_at} frames", looked_at - shown),
            "they do not show the fiducial lines where the camera that was found sees them: it may be wrong by more than its uncertainties say",
            "look at one of them; take more frames, some from above, and calibrate again",
        )
    })
}

/// The calibration as `rig.toml` keeps it, without its date.
fn record(
    numbers: &[Number],
    frames: usize,
    checksum: String,
    values: Vec<f64>,
    covariance: &DMatrix<f64>,
) -> Calibration {
    Calibration {
        date: String::new(),
        frames,
        checksum,
        names: numbers.iter().map(|n| n.name.to_owned()).collect(),
        values,
        u: numbers.iter().map(|n| n.u).collect(),
        covariance: covariance
            .row_iter()
            .map(|r| r.iter().copied().collect())
            .collect(),
    }
}

fn table(
    unknowns: &[Unknown],
    nominal: &[f64],
    found: &[f64],
    prior: &[f64],
    covariance: &DMatrix<f64>,
    states: &[NumberState],
) -> Vec<Number> {
    (0..unknowns.len())
        .map(|k| Number {
            name: unknowns[k].name,
            nominal: nominal[k],
            found: found[k],
            u: covariance[(k, k)].sqrt(),
            prior: prior[k],
            state: states[k],
        })
        .collect()
}

/// Of at least one value.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
