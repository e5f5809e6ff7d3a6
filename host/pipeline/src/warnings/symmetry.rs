//! What a fit of few samples takes of them, where they cannot show it or speak against it.

use super::SAMPLES;
use gonia_brdf::scattered::{Reason, ScatteredFit};
use gonia_rig::Remark;

/// What is to be said of the symmetry and the settings of a fit.
pub(crate) fn remarks(fit: &ScatteredFit) -> Vec<Remark> {
    let choice = fit.choice();
    let percent = |log_error: f64| 100.0 * log_error;
    let mut remarks = Vec::new();
    if let (Some(without), Some(with)) = (choice.contradicted_by, choice.log_error) {
        remarks.push(Remark::new(
            SAMPLES,
            format_args!(
                "contradict the symmetry that was asked for, {}: predicted with it, samples that were left out are {:.1} % off in the mean, without it {:.1} %",
                choice.settings.symmetry,
                percent(with),
                percent(without)
            ),
            "leave --symmetry out, or give none",
        ));
    }
    if choice.plane_undetermined {
        remarks.push(Remark::new(
            SAMPLES,
            format_args!(
                "lie too rarely on both sides of any plane to find the azimuth of the one that was asked for: none is taken, the symmetry is {}",
                choice.settings.symmetry
            ),
            "measure other azimuths of light and view",
        ));
    }
    if choice.log_error.is_none() {
        let (assumed, remedy) = match choice.reason {
            Reason::TooFew => (
                ", the material is assumed to be isotropic",
                "measure more directions; if it is not isotropic, give --symmetry none",
            ),
            _ => ("", "measure more directions"),
        };
        remarks.push(Remark::new(
            SAMPLES,
            format_args!(
                "lie at {} places, too few to choose settings by cross-validation: simple ones are taken{assumed}, and standard errors are a guess",
                fit.places()
            ),
            remedy,
        ));
    }
    remarks
}

/// What is to be said where isotropy is assumed, and nothing is said of the grid.
pub(crate) fn remark_on_assumed() -> Remark {
    Remark::new(
        SAMPLES,
        "have one azimuth of light or of view: the material is assumed to be isotropic, which nothing in them can show or contradict",
        "if it is not, measure other azimuths, or give --symmetry none",
    )
}
