//! A frame once it has been registered and sampled: all that the samples need of it, at a hundredth
//! of its size. A session keeps these as its frames arrive.

use crate::process::account::{FrameReport, Outcome, Refusal};
use gonia_brdf::{Direction, Pose};
use gonia_imaging::{
    LeftOut, Mask, PoseOffset, Registrar, Registration, SamplingGrid, find_occlusion,
};
use gonia_rig::{CameraModel, CameraShift, Frame, FrameRow, Placement, Rig};
use std::ops::Range;

/// What one grid point shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledPoint {
    /// Median radiance per channel.
    pub rgb: [f32; 3],
    /// Where the pixels were, relative to the grid point, mm.
    pub offset_mm: [f32; 2],
}

/// The grid points of a frame, and how the frame came to be used.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledFrame {
    /// Its number, role and registration.
    pub report: FrameReport,
    /// The arms' reading.
    pub reading: Pose,
    /// The camera's direction from the target's centre as its fiducial lines show it.
    pub view: Direction,
    /// In the order of the rig's grid; none when the frame was refused.
    pub points: Vec<Result<SampledPoint, LeftOut>>,
    /// What hid the target, where that was looked for in this frame.
    pub mask: Option<Mask>,
}

impl SampledFrame {
    /// A frame that is not used, whatever it shows.
    pub fn refused(row: &FrameRow, refusal: Refusal) -> Self {
        Self {
            report: FrameReport {
                frame: row.frame,
                role: row.role,
                outcome: Outcome::Refused(refusal),
                residual_px: 0.0,
                pose_offset: PoseOffset::default(),
            },
            reading: row.pose,
            view: row.pose.view,
            points: Vec::new(),
            mask: None,
        }
    }

    /// Where the camera was, as its fiducial lines show it.
    pub fn camera_at(&self, camera: &CameraModel) -> Placement {
        let offset = self.report.pose_offset;
        let by = CameraShift {
            theta: offset.theta_deg.to_radians(),
            phi: offset.phi_deg.to_radians(),
            ..CameraShift::default()
        };
        camera.placement(self.reading.view, by)
    }
}

/// How it is known what hides the target in a frame.
#[derive(Clone, Copy, Debug)]
pub enum Hidden<'a> {
    /// The frame itself must tell.
    Find,
    /// By this mask. Also none, where the reference's frame will leave its hidden points out.
    Known(Option<&'a Mask>),
}

/// Registers and samples the frames of a rig, one by one.
pub struct FrameSampler {
    rig: Rig,
    registrar: Registrar,
    grid: SamplingGrid,
}

impl FrameSampler {
    /// For frames of a rig.
    pub fn new(rig: &Rig) -> Self {
        Self {
            rig: rig.clone(),
            registrar: Registrar::new(rig),
            grid: SamplingGrid::new(rig),
        }
    }

    /// Registers a frame by its fiducial lines, and takes the value of every grid point.
    pub fn sample(&self, frame: &Frame, row: &FrameRow, hidden: Hidden) -> SampledFrame {
        self.sample_registered(frame, row, hidden).0
    }

    /// As [`FrameSampler::sample`], with the registration: where in the frame the target is.
    pub fn sample_registered(
        &self,
        frame: &Frame,
        row: &FrameRow,
        hidden: Hidden,
    ) -> (SampledFrame, Registration) {
        let registration = self.registrar.register(frame, row.pose);
        let sampled = self.sample_at(frame, row, hidden, &registration);
        (sampled, registration)
    }

    /// The rows of a frame that [`FrameSampler::sample_rows`] needs.
    pub fn rows(&self, row: &FrameRow) -> Range<usize> {
        self.registrar.rows(row.pose.view)
    }

    /// As [`FrameSampler::sample`], of a frame of which only the rows `read` are there. None when that does
    /// not show the target where its pose puts it: what it shows instead, the whole frame tells.
    pub fn sample_rows(
        &self,
        frame: &Frame,
        row: &FrameRow,
        hidden: Hidden,
        read: &Range<usize>,
    ) -> Option<SampledFrame> {
        let registration = self.registrar.register_rows(frame, row.pose, read)?;
        Some(self.sample_at(frame, row, hidden, &registration))
    }

    fn sample_at(
        &self,
        frame: &Frame,
        row: &FrameRow,
        hidden: Hidden,
        registration: &Registration,
    ) -> SampledFrame {
        let report = FrameReport {
            frame: row.frame,
            role: row.role,
            outcome: Outcome::of(registration),
            residual_px: registration.residual_px,
            pose_offset: registration.pose_offset,
        };
        let mut sampled = SampledFrame {
            report,
            reading: row.pose,
            view: registration.view,
            points: Vec::new(),
            mask: None,
        };
        if let Outcome::Refused(_) = report.outcome {
            return sampled;
        }
        let mask = match hidden {
            Hidden::Find => {
                sampled.mask = find_occlusion(frame, registration, row.pose.light, &self.rig);
                sampled.mask.as_ref()
            }
            Hidden::Known(mask) => mask,
        };
        let points = self.grid.sample(frame, registration, mask).into_iter();
        sampled.points = points
            .map(|point| {
                point.map(|value| SampledPoint {
                    rgb: value.rgb,
                    offset_mm: value.offset_mm,
                })
            })
            .collect();
        sampled
    }
}
