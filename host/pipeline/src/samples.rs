//! Frames → samples: of a capture folder, or of any [`FrameSource`].

use crate::Error;
use crate::budget::{UNCERTAINTIES, budget_of};
use crate::process::{
    FrameSource, FrameStage, Hidden, Masks, Outcome, ProcessError, Processed, ReferenceCalibration,
    Sampled, process, process_sampled, process_shared, rig_check,
};
use crate::progress::{Progress, Step, step};
use crate::provenance::{Provenance, of_this_program};
use gonia_formats::samples::SampleNote;
use gonia_formats::{CaptureFolder, FrameCounts, Refused};
use gonia_rig::{FrameRow, Rig, Role, SampleSet, Scale};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;

/// Samples of a capture folder's frames (`rig.toml`, `frames.csv` and the frames that it names).
///
/// # Errors
/// The folder or one of its files cannot be read, or no frame gives a sample.
pub fn samples_of_folder(folder: &Path, progress: &Progress<'_>) -> Result<Processed, Error> {
    let folder = CaptureFolder::open(folder)?;
    samples_of(folder.rig(), &folder, &Masks::default(), progress)
}

/// Samples of a source's frames. `masks` are those of another session's reference, for poses at
/// which this source has no frame of the reference.
///
/// # Errors
/// A frame cannot be had, or none gives a sample.
pub fn samples_of(
    rig: &Rig,
    source: &dyn FrameSource,
    masks: &Masks,
    progress: &Progress<'_>,
) -> Result<Processed, Error> {
    watched(rig, source.rows(), progress, |tell| {
        process(rig, source, masks, tell)
    })
}

/// As [`samples_of_folder`], of a folder of which other processes have sampled most frames:
/// [`sample_share`](crate::process::sample_share) gives the shares.
///
/// # Errors
/// As [`samples_of_folder`].
pub fn samples_of_shares(
    folder: &CaptureFolder,
    shares: &[Vec<u8>],
    progress: &Progress<'_>,
) -> Result<Processed, Error> {
    watched(folder.rig(), folder.rows(), progress, |tell| {
        process_shared(folder.rig(), folder, shares, tell)
    })
}

/// Samples of frames that come sampled, as a session keeps them.
///
/// # Errors
/// As [`samples_of`].
pub fn samples_of_sampled(
    rig: &Rig,
    rows: &[FrameRow],
    sampled: &(
         dyn Fn(&FrameRow, Hidden) -> Result<crate::process::SampledFrame, ProcessError> + Sync
     ),
    progress: &Progress<'_>,
) -> Result<Processed, Error> {
    let sampled: Sampled = sampled;
    watched(rig, rows, progress, |tell| {
        process_sampled(rig, rows, sampled, &Masks::default(), tell)
    })
}

fn watched(
    rig: &Rig,
    rows: &[FrameRow],
    progress: &Progress<'_>,
    work: impl FnOnce(
        &(dyn Fn(FrameStage, usize) -> ControlFlow<()> + Sync),
    ) -> Result<Processed, ProcessError>,
) -> Result<Processed, Error> {
    let reference = rows
        .iter()
        .filter(|row| row.role == Role::Reference)
        .count();
    let total = rows.len().max(1) as f64;
    let processed = step(progress, Step::FramesToSamples, |_| {
        work(&|stage, done| {
            let before = match stage {
                FrameStage::Reference => 0,
                FrameStage::Material => reference,
            };
            let share = (before + done) as f64 / total;
            // The last frame is not the end of the step.
            progress(Step::FramesToSamples, share.min(1.0 - 1e-9))
        })
        .map_err(Error::from)
    })?;
    if processed.samples.is_empty() {
        let alike = rig_check::refused_alike(rig, &processed.frames);
        let refused = processed.frame_counts().refused.into_iter();
        let commonest = refused.max_by_key(|refused| refused.count);
        let why = match (alike, commonest) {
            (Some(alike), _) => alike.remark().to_string(),
            (None, Some(refused)) => refused.reason,
            (None, None) => "every point was left out".to_owned(),
        };
        return Err(Error::NoSamples {
            frames: rows.len(),
            why,
        });
    }
    Ok(processed)
}

impl Processed {
    /// Whether the samples are in 1/sr.
    pub fn scale(&self) -> Scale {
        if self.calibration.is_absolute() {
            Scale::Absolute
        } else {
            Scale::Relative
        }
    }

    /// What a file of the samples of a rig says of them: their scale, how they were calibrated and from what their
    /// uncertainty follows ([`budget`](crate::budget)), this program, and `facts` of the caller's.
    pub fn note(&self, rig: &Rig, facts: Provenance) -> SampleNote {
        let calibration = match self.calibration {
            ReferenceCalibration::KnownReference => "against the known reference",
            ReferenceCalibration::UnknownReference => "against the unknown reference, eq. (3)",
            ReferenceCalibration::GeometricModel => "ideal light over the geometry",
        };
        let mut provenance = of_this_program();
        provenance.insert("calibration".to_owned(), calibration.to_owned());
        let budget = budget_of(rig, self.calibration, &self.samples);
        provenance.insert(UNCERTAINTIES.to_owned(), budget.to_string());
        if let Some(reference) = rig
            .reference
            .as_ref()
            .filter(|_| self.calibration.is_absolute())
        {
            let of = &reference.certificate;
            let known = [
                ("certificate", &of.certificate),
                ("valid_until", &of.valid_until),
            ];
            for (name, text) in known {
                let named = text
                    .iter()
                    .map(|text| (format!("reference.{name}"), text.clone()));
                provenance.extend(named);
            }
        }
        provenance.extend(facts);
        SampleNote {
            scale: Some(self.scale()),
            provenance,
        }
    }

    /// The samples with their scale.
    pub fn into_sample_set(self) -> SampleSet {
        SampleSet {
            scale: self.scale(),
            samples: self.samples,
        }
    }

    /// Frames used, and frames refused by reason.
    pub fn frame_counts(&self) -> FrameCounts {
        // What is said of the first frame of each kind, and how many there are.
        let mut reasons: BTreeMap<String, (String, u64)> = BTreeMap::new();
        let mut kept = 0;
        for frame in &self.frames {
            match frame.outcome {
                Outcome::Refused(refusal) => {
                    // Numbers in a reason would make every frame a reason of its own.
                    let words = refusal.to_string();
                    let kind: String = words.chars().filter(|c| c.is_alphabetic()).collect();
                    reasons.entry(kind).or_insert((words, 0)).1 += 1;
                }
                Outcome::Locked | Outcome::FellBack(_) => kept += 1,
            }
        }
        FrameCounts {
            kept,
            refused: reasons
                .into_iter()
                .map(|(_, (reason, count))| Refused { reason, count })
                .collect(),
        }
    }
}
