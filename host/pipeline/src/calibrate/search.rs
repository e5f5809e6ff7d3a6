//! A first camera, from lines that are looked for from far off.
//!
//! What is taken for a line from far off may be something else, and of few frames a wrong camera can fit those that
//! it was made of. So a camera is borne out by frames: with one that some frames agree on, all are looked at again,
//! the more they show the better it becomes; where many still do not show the target where it sees it, other
//! starts are tried, and the camera that most frames bear out is taken.

use crate::calibrate::camera::{Own, fits, solve_camera};
use crate::calibrate::choose::spread;
use crate::calibrate::error::CalibrateError;
use crate::calibrate::frames::Look;
use crate::calibrate::lines::{LineFrame, misfit_px};
use crate::calibrate::unknowns::{CAMERA, with_values};
use gonia_imaging::Search;
use gonia_rig::{FrameRow, Rig};

/// Frames in which lines are first looked for from far off, and how many of them must show any.
const FIRST: usize = 16;
const ENOUGH_FIRST: usize = 10;
/// Frames that bear a camera out, at most.
const BEARERS: usize = 48;
/// How often a camera is made better by the frames that it shows.
const ROUNDS: usize = 5;
/// A camera that this share of the frames bears out needs no other start. Frames at grazing lights may be dark.
const BORNE_OUT: f64 = 0.9;
/// Other starts: cameras of as many frames each.
const STARTS: usize = 4;
/// Frames of a camera that others have to agree with.
const FEW: usize = 3;
/// A frame agrees with a camera that misses its lines by no more than this share of its width.
const AGREES_WIDTHS: f64 = 8e-3;
/// Looks at frames that a first camera takes, usually.
pub const LOOKS: usize = FIRST + 3 * BEARERS;

/// A camera, and the frames that bear it out.
struct Borne {
    camera: Rig,
    frames: usize,
}

/// The camera that most frames bear out; the rig's own where none shows its lines.
pub fn first_camera(rig: &Rig, rows: &[FrameRow], look: &Look<'_>) -> Result<Rig, CalibrateError> {
    let mut first = from_far_off(rig, rows, look, &[Search::Far, Search::About])?;
    if first.is_empty() {
        first = from_far_off(rig, rows, look, &[Search::Aside])?;
    }
    if first.is_empty() {
        return Ok(rig.clone());
    }
    let bearers = spread(rows, BEARERS);
    let enough = (BORNE_OUT * bearers.len() as f64).ceil() as usize;
    let borne = |start: &Rig, searches: &[Search]| {
        let camera = grown(rig, start, &bearers, (look, searches))?;
        polished(rig, camera, &bearers, look)
    };
    let mut best = borne(&agreed(rig, &first)?, &[Search::About])?;
    // What is found further off may be something else: only where it is needed, and with other starts, frame by
    // frame, so that one that shows something else spoils no other's camera.
    let further = [Search::About, Search::Aside];
    let others = first.chunks(1).take(STARTS).map(|frame| agreed(rig, frame));
    let best_so_far = best.camera.clone();
    for start in std::iter::once(Ok(best_so_far)).chain(others) {
        if best.frames >= enough {
            break;
        }
        let other = borne(&start?, &further)?;
        if other.frames > best.frames {
            best = other;
        }
    }
    Ok(best.camera)
}

/// Places lines to hundredths of a pixel where a camera sees them, and makes the camera of those, as long as more
/// frames fit it: from a pixel off, the edge of a material close by is easily taken for the line.
fn polished(
    rig: &Rig,
    camera: Rig,
    bearers: &[FrameRow],
    look: &Look<'_>,
) -> Result<Borne, CalibrateError> {
    let mut best = Borne { camera, frames: 0 };
    for _ in 0..ROUNDS {
        let seen = look.lines(&best.camera, bearers, &[Search::Near])?;
        if seen.is_empty() {
            break;
        }
        let camera = agreed(rig, &seen)?;
        let bears_out = |frame: &&LineFrame| frame.shows_size() && fits(&camera, frame);
        let frames = seen.iter().filter(bears_out).count();
        if frames <= best.frames {
            break;
        }
        best = Borne { camera, frames };
        if frames == bearers.len() {
            break;
        }
    }
    Ok(best)
}

/// Lines of frames from far off. Frames from above are the plainest; where they are few, the others have to do.
fn from_far_off(
    rig: &Rig,
    rows: &[FrameRow],
    look: &Look<'_>,
    searches: &[Search],
) -> Result<Vec<LineFrame>, CalibrateError> {
    let order = spread(rows, FIRST);
    let is_left = |row: &&FrameRow| !order.contains(row);
    let rest: Vec<FrameRow> = rows.iter().filter(is_left).cloned().collect();
    let mut first = look.lines(rig, &order, searches)?;
    for some in rest.chunks(FIRST) {
        if first.len() >= ENOUGH_FIRST {
            break;
        }
        first.extend(look.lines(rig, some, searches)?);
    }
    Ok(first)
}

/// Makes a camera better by the frames that show their lines about where it sees them, as long as they become more.
fn grown(
    rig: &Rig,
    start: &Rig,
    bearers: &[FrameRow],
    (look, searches): (&Look<'_>, &[Search]),
) -> Result<Rig, CalibrateError> {
    let mut best = Borne {
        camera: start.clone(),
        frames: 0,
    };
    for _ in 0..ROUNDS {
        let seen = look.lines(&best.camera, bearers, searches)?;
        if seen.is_empty() {
            break;
        }
        let camera = agreed(rig, &seen)?;
        let frames = agreeing(&camera, &seen).len();
        if frames <= best.frames {
            break;
        }
        best = Borne { camera, frames };
        if frames == bearers.len() {
            break;
        }
    }
    Ok(best.camera)
}

/// The camera that most frames agree with: that of all, or, where it does not fit many, that of a few of them with
/// which the most others agree.
fn agreed(rig: &Rig, frames: &[LineFrame]) -> Result<Rig, CalibrateError> {
    let mut camera = camera_of(rig, frames)?;
    let mut agree = agreeing(&camera, frames);
    if 3 * agree.len() < 2 * frames.len() && frames.len() > FEW {
        for start in 0..frames.len() {
            let step = (frames.len() / FEW).max(1);
            let few: Vec<LineFrame> = (0..FEW)
                .map(|k| frames[(start + k * step) % frames.len()].clone())
                .collect();
            let other = camera_of(rig, &few)?;
            let with_other = agreeing(&other, frames);
            if with_other.len() > agree.len() {
                (camera, agree) = (other, with_other);
            }
        }
    }
    // What does not agree is left out, and what agrees then may be more.
    for _ in 0..2 {
        if agree.is_empty() || agree.len() == frames.len() {
            break;
        }
        camera = camera_of(rig, &agree)?;
        agree = agreeing(&camera, frames);
    }
    Ok(camera)
}

fn camera_of(rig: &Rig, frames: &[LineFrame]) -> Result<Rig, CalibrateError> {
    let solved = solve_camera(rig, frames, &[true; CAMERA.len()], Own::Usual, None)?;
    Ok(with_values(&CAMERA, rig, &solved.shared))
}

fn agreeing(camera: &Rig, frames: &[LineFrame]) -> Vec<LineFrame> {
    let limit = (AGREES_WIDTHS * camera.camera.width_px as f64).max(0.5);
    let agrees = |frame: &&LineFrame| misfit_px(camera, frame) <= limit;
    frames.iter().filter(agrees).cloned().collect()
}
