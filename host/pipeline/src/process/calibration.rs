//! What a radiance must be multiplied with to be a BRDF: eq. (3) and its two simpler kin.
//!
//! Everywhere radiance comes divided by the ideal point light's irradiance E at its own place, so
//! that I/E is the BRDF times what the light departs from the ideal, the reference's I_R/E likewise,
//! and the local cos θi of eq. (3) is in E.

use crate::process::ReferenceSummary;
use crate::process::account::LeftOutCounts;
use crate::process::central::{CentralField, fit_central};
use crate::process::coverage::{CoverageError, check_central, check_matches};
use crate::process::light_check;
use crate::process::linearity;
use crate::process::masks::Masks;
use crate::process::reference::{ReferenceFrame, References};
use crate::process::reflectance::KnownReference;
use gonia_brdf::{Pose, Vec3};
use gonia_imaging::{Mask, SamplingGrid};
use gonia_rig::{FrameRow, ReferenceCalibration, Remark, Rig};

/// Compensates the samples of one session.
pub struct Calibrator {
    references: References,
    /// Number of poses in the central field.
    central: usize,
    method: Method,
}

enum Method {
    Known(KnownReference),
    Unknown(Box<CentralField>),
    Geometric,
}

impl Calibrator {
    /// Chooses the method from what there is, and prepares it. `centre` is the index of the grid's
    /// middle point.
    pub fn new(
        rig: &Rig,
        centre: usize,
        references: References,
        material: &[&FrameRow],
    ) -> Result<Self, CoverageError> {
        let mut central = 0;
        let method = match &rig.reference {
            _ if references.frames().is_empty() => Method::Geometric,
            Some(reference) => Method::Known(KnownReference::new(reference)),
            None => {
                let matched: Vec<_> = material
                    .iter()
                    .map(|row| (row.frame, references.at_pose(row.pose).is_some()))
                    .collect();
                check_matches(&matched)?;
                let values = central_values(&references, centre);
                let poses: Vec<Pose> = values.iter().map(|v| v.0).collect();
                check_central(&poses)?;
                central = values.len();
                let field = fit_central(&values).ok_or(CoverageError::TooFewPoses { poses: 0 })?;
                Method::Unknown(Box::new(field))
            }
        };
        Ok(Self {
            references,
            central,
            method,
        })
    }

    /// Which method it is.
    pub fn kind(&self) -> ReferenceCalibration {
        match self.method {
            Method::Known(_) => ReferenceCalibration::KnownReference,
            Method::Unknown(_) => ReferenceCalibration::UnknownReference,
            Method::Geometric => ReferenceCalibration::GeometricModel,
        }
    }

    /// Whether a material frame is of no use without a reference frame at its pose.
    pub fn needs_reference(&self) -> bool {
        !matches!(self.method, Method::Geometric)
    }

    /// The reference frame for a reading of the arms.
    pub fn reference_at(&self, pose: Pose) -> Option<&ReferenceFrame> {
        self.references.at_pose(pose)
    }

    /// What the reference's frames gave.
    pub fn summary(&self) -> ReferenceSummary {
        let frames = self.references.frames();
        ReferenceSummary {
            frames: frames.len(),
            occluded: frames.iter().filter(|f| f.mask.is_some()).count(),
            mask_bytes: frames
                .iter()
                .filter_map(|f| f.mask.as_ref())
                .map(Mask::bytes)
                .sum(),
            central: self.central,
        }
    }

    /// What speaks against radiance that is proportional to light, and against the light's place.
    pub fn warnings(&self, rig: &Rig, grid: &SamplingGrid) -> Vec<Remark> {
        let Method::Known(reference) = &self.method else {
            return Vec::new();
        };
        let frames = self.references.frames();
        let linearity = linearity::warning(rig, frames, reference, grid.centre());
        let light = light_check::warning(rig, frames, reference, grid.points_mm());
        linearity.into_iter().chain(light).collect()
    }

    /// What hid the target in the reference's frames.
    pub fn into_masks(self) -> Masks {
        Masks::new(self.references.into_masks())
    }

    /// The BRDF at a grid point from its radiance over the ideal irradiance; `None`, and counted,
    /// where the reference has no value.
    pub fn value(
        &self,
        relative: [f32; 3],
        reference: Option<&ReferenceFrame>,
        point: usize,
        (light, view): (Vec3, Vec3),
        counts: &mut LeftOutCounts,
    ) -> Option<[f32; 3]> {
        let factor = match &self.method {
            Method::Geometric => return Some(relative),
            Method::Known(reference) => reference.at(light, view),
            Method::Unknown(field) => field.at(light, view),
        };
        let beneath = reference?.at(point, counts)?;
        Some([0, 1, 2].map(|c| relative[c] / beneath[c] * factor[c]))
    }
}

/// I_C / cos θi: the reference's values at the centre, wherever it was seen.
fn central_values(references: &References, centre: usize) -> Vec<(Pose, [f32; 3])> {
    references
        .frames()
        .iter()
        .map(|frame| (frame.pose, frame.relative[centre]))
        .filter(|(_, value)| value.iter().all(|v| *v > 0.0))
        .collect()
}
