//! From frames to samples: registration, occlusion, sampling, calibration against the reference.
//!
//! Two passes over the frames, each parallel: first the reference's, of which only the values at
//! the grid points are kept, then the material's, of which only the samples are.

pub mod account;
mod calibration;
pub mod central;
pub mod coverage;
mod light_check;
mod linearity;
pub mod masks;
mod reference;
pub(crate) mod reflectance;
mod remarks;
pub(crate) mod rig_check;
pub mod sampled;
pub mod sampled_bytes;
mod shared;
pub mod source;

pub use account::{FrameReport, LeftOutCounts, OffsetStatistics, Outcome, Refusal};
pub use gonia_rig::ReferenceCalibration;
pub use masks::{MASKS, Masks};
pub use sampled::{FrameSampler, Hidden, SampledFrame, SampledPoint};
pub use shared::{process_shared, sample_share};
pub use source::{FrameRow, FrameSource, Role};

use crate::progress::Cancelled;
use calibration::Calibrator;
use gonia_brdf::{Direction, Sample};
use gonia_formats::FileError;
use gonia_formats::frame_exr::SpareFrame;
use gonia_imaging::{IdealLight, SamplingGrid, Turn};
use gonia_rig::{CameraModel, Frame, Remark, Rig};
use rayon::prelude::*;
use reference::{ReferenceFrame, References};
use remarks::HeardRemarks;
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What [`process`] is at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameStage {
    /// Frames of the reference.
    Reference,
    /// Frames of the material.
    Material,
}

/// All samples of a session and how they came about.
#[derive(Clone, Debug)]
pub struct Processed {
    /// The samples, in the order of the frames.
    pub samples: Vec<Sample>,
    /// How the values were calibrated, and with it what unit they have.
    pub calibration: ReferenceCalibration,
    /// Every frame, the reference's first.
    pub frames: Vec<FrameReport>,
    /// Points of used material frames that became no sample.
    pub left_out: LeftOutCounts,
    /// Estimated camera direction minus reading, over the locked frames; `None` where no frame is.
    pub offsets: Option<OffsetStatistics>,
    /// The reference.
    pub reference: ReferenceSummary,
    /// Frames of a mirror, which are no samples.
    pub mirrors: usize,
    /// What hid the target in the reference's frames.
    pub masks: Masks,
    /// What is to be said of frames: which cannot be read, and which are used although something speaks
    /// against them.
    pub remarks: Vec<Remark>,
}

/// What the reference's frames gave.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReferenceSummary {
    /// Frames that were used.
    pub frames: usize,
    /// Of them, frames in which something hid part of the material.
    pub occluded: usize,
    /// Memory of all occlusion masks, bytes.
    pub mask_bytes: usize,
    /// Poses whose central value was used for eq. (3).
    pub central: usize,
}

/// Why no samples could be made.
#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    /// There is nothing to process.
    #[error("none of the {rows} frames shows the material: give rows of role 'material'")]
    NoMaterial {
        /// Rows of the source.
        rows: usize,
    },
    /// None of the frames could be read; the first one.
    #[error("frame {frame}: {source}")]
    Load {
        /// Its number.
        frame: u32,
        /// What is wrong, and with which file.
        source: FileError,
    },
    /// No frame is of the size that the rig's camera has; the first one.
    #[error(
        "frame {frame} ({file}) has {width} x {height} pixels, but the camera of rig.toml has {rig_width} x {rig_height}: correct width_px, height_px, focal_px and centre_px, or the file"
    )]
    WrongSize {
        /// Its number.
        frame: u32,
        /// Its file.
        file: String,
        /// Its width.
        width: usize,
        /// Its height.
        height: usize,
        /// The camera's width.
        rig_width: usize,
        /// The camera's height.
        rig_height: usize,
    },
    /// There are frames of the reference, and none of them is any good.
    #[error(
        "none of the {refused} frames of the reference shows the target where its pose puts it ({why}): check rig.toml and the poses in frames.csv, or leave the reference's rows out to use an ideal light instead"
    )]
    ReferenceRefused {
        /// Frames of the reference.
        refused: usize,
        /// What was found in the first of them.
        why: String,
    },
    /// There are frames of the reference, and they agree in where they show the target instead.
    #[error(
        "rig.toml: {what}, and none of the {refused} frames of the reference can be used; run gonia calibrate DIR -o DIR/rig.toml, and process again"
    )]
    AnotherRig {
        /// Frames of the reference.
        refused: usize,
        /// What they agree in.
        what: String,
    },
    /// The orientation mark shows that the target lay turned; where it is hidden, frames do not show it.
    #[error(
        "the target (or every frame) is {turn} in {turned} of {frames} frames of the {}, as its orientation mark shows: turn it back and take them again; where it lay right, correct target.mark_mm, or turn the frames as the sensor saw them",
        role.name()
    )]
    TargetTurned {
        /// What lay on it.
        role: Role,
        /// How it lay.
        turn: Turn,
        /// Frames that show it so.
        turned: usize,
        /// All of the role.
        frames: usize,
    },
    /// Eq. (3) needs more of the reference than was measured.
    #[error(transparent)]
    Coverage(#[from] coverage::CoverageError),
    /// The caller has ended the work.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl ProcessError {
    /// Whether it would meet other frames alike: see [`FileError::is_of_the_system`].
    pub(crate) fn is_of_the_system(&self) -> bool {
        matches!(self, Self::Load { source, .. } if source.is_of_the_system())
    }
}

/// Rows of a frame that show the target, as a share of all, up to which only they are read: with more, little
/// is left out, and a frame that does not show it there is read twice.
const WORTHWHILE: f64 = 0.9;
/// Frames in work at a time; what they leave is gathered in their order.
const BATCH: usize = 256;

/// Makes samples from frames. The calibration follows from what there is: a reference of known
/// albedo, an unknown one (eq. (3)), or none. `masks` are those of another session's reference, for
/// poses at which this one has no frame of the reference; where they have none either, the
/// material's own frame tells what hid it. `progress` hears the stage and the frames done in it, from
/// any thread, and ends the work by a break.
///
/// A frame that cannot be read or is of another size is refused, with a remark that names it, and the
/// others are used.
///
/// # Errors
/// The system lacks what every frame needs (open files, memory); no frame of the material, none of a role that can be read and is of the right size, no good frame of
/// the reference, or too few of an unknown one.
pub fn process(
    rig: &Rig,
    source: &dyn FrameSource,
    masks: &Masks,
    progress: Heard<'_>,
) -> Result<Processed, ProcessError> {
    let sampling = Sampling::new(rig, source);
    let sampled = |row: &FrameRow, hidden: Hidden| sampling.sample(row, hidden);
    let processed = process_sampled(rig, source.rows(), &sampled, masks, progress);
    sampling.heard.judge(source.rows(), processed)
}

/// Samples a source's frames, and keeps what is to be said of them.
struct Sampling<'a> {
    rig: &'a Rig,
    source: &'a dyn FrameSource,
    sampler: FrameSampler,
    heard: HeardRemarks,
}

impl<'a> Sampling<'a> {
    fn new(rig: &'a Rig, source: &'a dyn FrameSource) -> Self {
        Self {
            rig,
            source,
            sampler: FrameSampler::new(rig),
            heard: HeardRemarks::default(),
        }
    }

    /// A frame that cannot be used is one that is refused, unless none could be used.
    fn sample(&self, row: &FrameRow, hidden: Hidden) -> Result<SampledFrame, ProcessError> {
        match self.sample_usable(row, hidden) {
            Ok((sampled, remarks)) => {
                self.heard.of_frame(row, remarks);
                Ok(sampled)
            }
            Err(error) if error.is_of_the_system() => Err(error),
            Err(error) => {
                self.heard.unusable(row, error);
                Ok(SampledFrame::refused(row, Refusal::Unusable))
            }
        }
    }

    /// A frame, and what is to be said of it.
    fn sample_usable(
        &self,
        row: &FrameRow,
        hidden: Hidden,
    ) -> Result<(SampledFrame, Vec<Remark>), ProcessError> {
        if let Some(sampled) = sample_rows(self.rig, self.source, &self.sampler, row, hidden) {
            return Ok((sampled, Vec::new()));
        }
        let (frame, remarks) = load(self.rig, self.source, row)?;
        Ok((self.sampler.sample(&frame, row, hidden), remarks))
    }
}

/// Hears the stage and the frames done in it.
pub type Heard<'a> = &'a (dyn Fn(FrameStage, usize) -> ControlFlow<()> + Sync);

/// How a frame is had sampled, from any thread.
pub type Sampled<'a> = &'a (dyn Fn(&FrameRow, Hidden) -> Result<SampledFrame, ProcessError> + Sync);

/// As [`process`], of frames that come sampled: a session's are kept so.
///
/// # Errors
/// As [`process`].
pub fn process_sampled(
    rig: &Rig,
    rows: &[FrameRow],
    sampled: Sampled,
    masks: &Masks,
    progress: Heard<'_>,
) -> Result<Processed, ProcessError> {
    let of_role = |role| -> Vec<&FrameRow> { rows.iter().filter(|r| r.role == role).collect() };
    let (material, reference) = (of_role(Role::Material), of_role(Role::Reference));
    if material.is_empty() {
        return Err(ProcessError::NoMaterial { rows: rows.len() });
    }
    let bench = Bench {
        rig,
        camera: CameraModel::new(rig),
        sampled,
        masks,
        grid: SamplingGrid::new(rig),
    };
    let mut frames = Vec::with_capacity(rows.len());
    let mut references = Vec::new();
    bench.each(
        FrameStage::Reference,
        &reference,
        progress,
        |row| bench.reference(row),
        |(report, found)| {
            frames.push(report);
            references.extend(found);
        },
    )?;
    rig_check::check_orientation(&frames, Role::Reference)?;
    if references.is_empty() && !reference.is_empty() {
        if let Some(alike) = rig_check::refused_alike(rig, &frames) {
            let (refused, what) = (reference.len(), alike.to_string());
            return Err(ProcessError::AnotherRig { refused, what });
        }
        let why = frames.iter().find_map(|frame| match frame.outcome {
            Outcome::Refused(Refusal::NotTheTarget(reason)) => Some(reason.to_string()),
            _ => None,
        });
        return Err(ProcessError::ReferenceRefused {
            refused: reference.len(),
            why: why.unwrap_or_else(|| "they cannot be read".to_owned()),
        });
    }
    let calibrator = Calibrator::new(
        rig,
        bench.grid.centre(),
        References::new(references),
        &material,
    )?;
    let mut samples = Vec::with_capacity(material.len() * bench.grid.points_mm().len());
    let mut left_out = LeftOutCounts::default();
    bench.each(
        FrameStage::Material,
        &material,
        progress,
        |row| bench.material(row, &calibrator),
        |(report, found, counts): (FrameReport, Vec<Sample>, LeftOutCounts)| {
            frames.push(report);
            samples.extend(found);
            left_out += counts;
        },
    )?;
    rig_check::check_orientation(&frames, Role::Material)?;
    let mut remarks = rig_check::warnings(rig, rows, &frames);
    remarks.extend(calibrator.warnings(rig, &bench.grid));
    Ok(Processed {
        offsets: OffsetStatistics::of(&frames),
        samples,
        calibration: calibrator.kind(),
        frames,
        left_out,
        reference: calibrator.summary(),
        mirrors: of_role(Role::Mirror).len(),
        remarks,
        masks: calibrator.into_masks(),
    })
}

thread_local! {
    /// Of the frame that this thread sampled last.
    static SPARE: RefCell<SpareFrame> = RefCell::default();
}

/// Samples a frame by the rows that show the target, where that is all there is to it: it is where its pose
/// puts it, and reading these rows is cheaper than reading all.
fn sample_rows(
    rig: &Rig,
    source: &dyn FrameSource,
    sampler: &FrameSampler,
    row: &FrameRow,
    hidden: Hidden,
) -> Option<SampledFrame> {
    let rows = sampler.rows(row);
    if rows.len() as f64 > WORTHWHILE * rig.camera.height_px as f64 {
        return None;
    }
    // Taken, not borrowed: a thread that waits for parts of this frame may begin another one.
    let mut spare = SPARE.take();
    let frame = source.load_rows(row, rows.clone(), &mut spare).ok()??;
    let sampled = sampler.sample_rows(&frame, row, hidden, &rows);
    spare.keep(frame, &rows);
    SPARE.set(spare);
    sampled
}

/// Loads a frame, which must be of the size that the rig's camera has.
pub(crate) fn load(
    rig: &Rig,
    source: &dyn FrameSource,
    row: &FrameRow,
) -> Result<(Frame, Vec<Remark>), ProcessError> {
    let loaded = source.load_with_remarks(row);
    let (frame, remarks) = loaded.map_err(|source| ProcessError::Load {
        frame: row.frame,
        source,
    })?;
    let camera = &rig.camera;
    if [frame.width, frame.height] != [camera.width_px, camera.height_px] {
        return Err(ProcessError::WrongSize {
            frame: row.frame,
            file: row.file.clone(),
            width: frame.width,
            height: frame.height,
            rig_width: camera.width_px,
            rig_height: camera.height_px,
        });
    }
    Ok((frame, remarks))
}

/// What every frame needs.
struct Bench<'a> {
    rig: &'a Rig,
    camera: CameraModel,
    sampled: Sampled<'a>,
    masks: &'a Masks,
    grid: SamplingGrid,
}

impl Bench<'_> {
    /// Does `work` on rows in parallel, and `gather`s what it gives in their order.
    fn each<T: Send>(
        &self,
        stage: FrameStage,
        rows: &[&FrameRow],
        progress: Heard<'_>,
        work: impl Fn(&FrameRow) -> Result<T, ProcessError> + Sync,
        mut gather: impl FnMut(T),
    ) -> Result<(), ProcessError> {
        let done = AtomicUsize::new(0);
        for batch in rows.chunks(BATCH) {
            let results = batch
                .par_iter()
                .map(|row| {
                    let result = work(row)?;
                    let done = 1 + done.fetch_add(1, Ordering::Relaxed);
                    match progress(stage, done) {
                        ControlFlow::Continue(()) => Ok(result),
                        ControlFlow::Break(()) => Err(Cancelled.into()),
                    }
                })
                .collect::<Vec<Result<T, ProcessError>>>();
            // In order: of several bad frames the first one is named, whichever thread met one first.
            for result in results {
                gather(result?);
            }
        }
        Ok(())
    }

    fn reference(
        &self,
        row: &FrameRow,
    ) -> Result<(FrameReport, Option<ReferenceFrame>), ProcessError> {
        let frame = (self.sampled)(row, Hidden::Find)?;
        let report = frame.report;
        if let Outcome::Refused(_) = report.outcome {
            return Ok((report, None));
        }
        let light = IdealLight::new(self.rig, row.pose.light);
        let irradiance = |i, value: &SampledPoint| light.irradiance(self.place(i, value));
        let direction = Direction::from_vec3(light.direction_from([0.0; 2]));
        let found = ReferenceFrame::new(frame, direction, irradiance);
        Ok((report, Some(found)))
    }

    fn material(
        &self,
        row: &FrameRow,
        calibrator: &Calibrator,
    ) -> Result<(FrameReport, Vec<Sample>, LeftOutCounts), ProcessError> {
        let reference = calibrator.reference_at(row.pose);
        // What hid the reference hid the material, and those points are left out already. Without
        // both, the material's own frame must tell.
        let hidden = match (reference, self.masks.at(row.pose)) {
            (Some(_), _) => Hidden::Known(None),
            (None, Some(known)) => Hidden::Known(known),
            (None, None) => Hidden::Find,
        };
        let frame = (self.sampled)(row, hidden)?;
        let camera = frame.camera_at(&self.camera);
        let mut report = frame.report;
        let mut counts = LeftOutCounts::default();
        if let Outcome::Refused(_) = report.outcome {
            return Ok((report, Vec::new(), counts));
        }
        if reference.is_none() && calibrator.needs_reference() {
            report.outcome = Outcome::Refused(Refusal::NoReference);
            return Ok((report, Vec::new(), counts));
        }
        let points = frame.points;
        let light = IdealLight::new(self.rig, row.pose.light);
        let mut samples = Vec::with_capacity(points.len());
        for (i, point) in points.iter().enumerate() {
            let value = match point {
                Ok(value) => value,
                Err(reason) => {
                    counts.count(*reason);
                    continue;
                }
            };
            let at = self.place(i, value);
            let irradiance = light.irradiance(at);
            if irradiance <= 0.0 {
                counts.below_horizon += 1;
                continue;
            }
            let (to_light, to_camera) = (light.direction_from(at), camera.direction_from(at));
            let relative = value.rgb.map(|v| v / irradiance as f32);
            let Some(rgb) =
                calibrator.value(relative, reference, i, (to_light, to_camera), &mut counts)
            else {
                continue;
            };
            let (i, v) = (
                Direction::from_vec3(to_light),
                Direction::from_vec3(to_camera),
            );
            samples.push(Sample::new(i, v, rgb).in_frame(row.frame));
        }
        Ok((report, samples, counts))
    }

    /// Where on the target a point's pixels were, mm.
    fn place(&self, point: usize, value: &SampledPoint) -> [f64; 2] {
        let at = self.grid.points_mm()[point];
        [0, 1].map(|i| at[i] + f64::from(value.offset_mm[i]))
    }
}
