//! What all chosen frames show: lines, values of the reference, highlights of a mirror.

use crate::calibrate::error::CalibrateError;
use crate::calibrate::frames::{Look, Looked};
use crate::calibrate::lines::LineFrame;
use crate::calibrate::mirror::MirrorFrame;
use crate::calibrate::orientation;
use crate::calibrate::shading::ShadedFrame;
use crate::process::{FrameRow, FrameSampler, Hidden, Outcome, Role};
use gonia_formats::checksum;
use gonia_imaging::{
    Highlight, NoHighlight, Orientation, Registrar, SamplingGrid, Search, find_highlight,
};
use gonia_rig::{Remark, Rig};

/// A second look counts when it shows this share of the frames that the first did.
const MOST_AGAIN: f64 = 0.95;

/// What all chosen frames show.
#[derive(Clone)]
pub struct Seen {
    /// Lines of frames that show any.
    pub lines: Vec<LineFrame>,
    /// Values of the reference; without any, and without a mirror, of the material.
    pub shaded: Vec<ShadedFrame>,
    /// Which of the two.
    pub shaded_role: Role,
    /// Frames of a mirror.
    pub mirrors: Vec<MirrorFrame>,
    /// The frames' checksum.
    pub checksum: String,
    /// What is to be said of frames.
    pub remarks: Vec<Remark>,
}

/// Lines, values of the reference and highlights of all frames of a rig that is known to a few pixels.
pub fn look_near(rig: &Rig, rows: &[FrameRow], look: &Look<'_>) -> Result<Seen, CalibrateError> {
    let registrar = Registrar::new(rig);
    let (sampler, grid) = (FrameSampler::new(rig), SamplingGrid::new(rig));
    let shaded_role = shaded_role(rows);
    let looked = look.each(rows, |row, frame| {
        let points = registrar.line_points(frame, row.pose, Search::Near);
        let orientation = registrar.orientation(frame, row.pose.view);
        let sampled = (row.role == shaded_role && !points.is_empty())
            .then(|| sampler.sample(frame, row, Hidden::Find))
            .filter(|sampled| sampled.report.outcome == Outcome::Locked);
        let shaded = sampled.and_then(|sampled| ShadedFrame::new(rig, &grid, &sampled));
        let lines = LineFrame {
            row: row.clone(),
            points,
        };
        let highlight = (row.role == Role::Mirror && !lines.points.is_empty()).then(|| {
            let registration = registrar.register(frame, row.pose);
            find_highlight(frame, &registration, &rig.target)
        });
        Shows {
            lines,
            shaded,
            highlight,
            orientation,
            checksum: checksum::of_frame(frame),
        }
    })?;
    gather(looked, shaded_role)
}

/// Whose shading shows the light: the reference's where there is one. A mirror shows it better than a material of
/// which nothing is known.
fn shaded_role(rows: &[FrameRow]) -> Role {
    let is_of_material = |row: &FrameRow| row.role == Role::Material;
    match rows.iter().all(is_of_material) {
        true => Role::Material,
        false => Role::Reference,
    }
}

/// Lines that lie beside a material are placed by the light that falls on both, and values of the reference by the
/// camera: with both as found they are looked at once more. Where that shows far fewer lines or values, they
/// stay as they are.
pub fn look_again(
    found: &Rig,
    rows: &[FrameRow],
    seen: Seen,
    look: &Look<'_>,
) -> Result<Seen, CalibrateError> {
    let again = match look_near(found, rows, look) {
        // What a first look showed well is no worse for a second one.
        Err(CalibrateError::NoHighlight { .. } | CalibrateError::TargetTurned { .. }) => {
            return Ok(seen);
        }
        again => again?,
    };
    let is_most = |again: usize, seen: usize| again as f64 >= MOST_AGAIN * seen as f64;
    let shows_most = is_most(again.lines.len(), seen.lines.len())
        && is_most(again.shaded.len(), seen.shaded.len());
    Ok(if shows_most { again } else { seen })
}

/// What one frame shows.
struct Shows {
    lines: LineFrame,
    shaded: Option<ShadedFrame>,
    highlight: Option<Result<Highlight, NoHighlight>>,
    orientation: Option<Orientation>,
    checksum: String,
}

fn gather(looked: Looked<Shows>, shaded_role: Role) -> Result<Seen, CalibrateError> {
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
        shaded_role,
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
