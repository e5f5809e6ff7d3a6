//! A rig's geometry from its own frames.
//!
//! 1. The four lines are found in a few frames, from far off, and one least squares makes a first camera.
//! 2. With it they are found in more frames, more closely.
//! 3. With that, in all chosen frames to hundredths of a pixel. Camera, camera arm and target follow from
//!    the lines of all frames together; values of the reference's grid points are read. Where their shading
//!    shows a beam, the lines are found once more in its light.
//! 4. The light and its arm follow from the shading on the reference (without one, on a material together with a
//!    smooth description of it). Lines say where the target is;
//!    shading takes that from them, with its uncertainty, and does not change it: a reference that is not
//!    quite what it is thought to be then spoils no camera.
//!
//! All of it is weighted least squares with priors ([`solve`]); which numbers may move, and how far, is
//! said in [`unknowns`].

mod camera;
mod choose;
mod error;
mod frames;
mod light;
mod light_off;
mod lines;
mod look;
mod mirror;
pub(crate) mod numbers;
mod orientation;
mod record;
mod residuals;
mod search;
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
use shading::thin_for_a_start;
pub(crate) use shading::{ReferenceValue, ShadedFrame};

use crate::process::FrameSource;
use crate::progress::{Progress, Step, step};
use camera::{CameraSolution, FEWEST, find_camera, priors};
use choose::chosen;
use frames::Look;
use gonia_brdf::Pose;
use gonia_rig::{Remark, Rig};
use light::{Known, Light};
use lines::misfit_px;
use look::{Seen, look_again, look_near};
use mirror::{MirrorFrame, MirrorLight};
use numbers::{changes, direction_u, stated_poses};
use record::{direction_u_of_light_as_it_was, record, table};
use search::first_camera;
use unknowns::{CAMERA, LIGHT, values, with_values};

/// More than this share of frames that do not fit are another rig's.
pub(crate) const MISFITS: f64 = 0.1;
/// Where fewer of the frames than this share show the target where the found camera sees it, that is said.
const SHOWN: f64 = 0.85;

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
    /// Poses from straight above to the lowest of the frames, at the frames' azimuths: those of the next two.
    pub poses: Vec<Pose>,
    /// By how much directions of light and view changed, degrees.
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
        let look = Look::new(rig, source, 2 * rows.len() + search::LOOKS, tell);
        let camera = first_camera(rig, &rows, &look)?;
        let seen = look_near(&camera, &rows, &look)?;
        // Without shading there is no light to be found; what keeps these frames from a calibration is said when
        // they are concluded from.
        let mut about = seen.clone();
        thin_for_a_start(&mut about.shaded);
        if !seen.shaded.is_empty()
            && let Ok(found) = conclude(rig, rows.len(), about)
            && found.rig.light != rig.light
        {
            return look_again(&found.rig, &rows, seen, &look);
        }
        Ok::<Seen, CalibrateError>(seen)
    })?;
    step(progress, Step::SolvingGeometry, |_| {
        conclude(rig, rows.len(), seen)
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
        surface: seen.shaded_role,
    };
    let taken: Vec<Pose> = lines.iter().map(|frame| frame.row.pose).collect();
    let poses = stated_poses(&taken);
    let light = Light::find(&with_camera, seen.shaded, &known)?;
    let (light, direction_u) = told(rig, &camera, light, &poses);
    let mut remarks = seen.remarks;
    remarks.extend(mirror.iter().flat_map(MirrorLight::remarks));
    remarks.extend(light.remark());
    let shown = lines.iter().filter(|frame| frame.shows_size()).count();
    remarks.extend(few_shown(looked_at, shown));
    let found = light.rig(&with_camera);

    let mut numbers = table(
        &CAMERA,
        &values(&CAMERA, rig),
        &camera.shared,
        &priors(&CAMERA, rig),
        &camera.covariance,
        &camera.states,
    );
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
        shared.extend_from_slice(&light.shared);
        covariance = light.covariance.clone();
    }
    let median = |rig: &Rig| Spread::of(lines.iter().map(|f| misfit_px(rig, f)).collect()).p50;
    let calibration = record(&numbers, lines.len(), seen.checksum, shared, &covariance);
    Ok(Calibrated {
        frames: [looked_at, lines.len()],
        lines_px: [median(rig), median(&found)],
        changes: changes(rig, &found, &poses),
        poses,
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

/// The light, left as it was where a material hardly tells where it is, and the standard uncertainties of directions.
fn told(rig: &Rig, camera: &CameraSolution, light: Light, poses: &[Pose]) -> (Light, [Spread; 2]) {
    let as_it_was = direction_u_of_light_as_it_was(rig, &camera.shared, &camera.covariance, poses);
    let Some(found) = light.solution() else {
        return (light, as_it_was);
    };
    let numbers = [&camera.shared[..], &found.shared].concat();
    let u = direction_u(rig, &[&CAMERA, &LIGHT], &numbers, &found.covariance, poses);
    let light = light.unless_told(u[0].p95, as_it_was[0].p95);
    match light.solution() {
        Some(_) => (light, u),
        None => (light, as_it_was),
    }
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

/// Of at least one value.
fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
