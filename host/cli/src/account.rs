//! What came of the frames: rows of a command's table.

use crate::table;
use gonia_pipeline::budget::budget_of;
use gonia_pipeline::process::{Outcome, Processed, ReferenceCalibration};
use gonia_rig::{Input, KnownFrom, Rig};

/// From what the uncertainty of the samples follows beside their scatter: what nobody stated stands apart.
pub fn uncertainties(rig: &Rig, processed: &Processed) -> Vec<(String, String)> {
    let budget = budget_of(rig, processed.calibration, &processed.samples);
    let is_absolute = processed.calibration.is_absolute();
    let of = |from: KnownFrom| {
        let all = Input::ALL.into_iter();
        let counted = all.filter(|input| is_absolute || !input.key().starts_with("reference."));
        let known = counted.filter(|input| budget.known_from(*input) == from);
        let text = known.map(|input| {
            let digits = if budget.value(input) < 0.01 { 4 } else { 3 };
            let value = format!("{:.digits$}", budget.value(input));
            format!("{} {value} {}", input.key(), input.unit())
                .trim_end()
                .to_owned()
        });
        text.collect::<Vec<_>>().join(", ")
    };
    let row = |name: &str, text: String| (!text.is_empty()).then(|| (name.to_owned(), text));
    [
        row("u (k = 1), stated", of(KnownFrom::Stated)),
        row("u, by calibration", of(KnownFrom::Calibration)),
        row("u, nobody stated", of(KnownFrom::Default)),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// What came of the frames, for the table.
pub fn describe(processed: &Processed) -> Vec<(String, String)> {
    let counts = processed.frame_counts();
    let by_pose = processed
        .frames
        .iter()
        .filter(|frame| matches!(frame.outcome, Outcome::FellBack(_)))
        .count();
    let left_out = &processed.left_out;
    let mut rows = vec![
        (
            "frames".to_owned(),
            format!(
                "{} kept ({} of them by their pose, lines hidden), {} refused",
                table::count(counts.kept),
                table::count(by_pose as u64),
                table::count(counts.n_refused())
            ),
        ),
        (
            "camera by the lines".into(),
            match &processed.offsets {
                Some(offsets) => format!(
                    "theta {:+.4} ± {:.4}, phi {:+.4} ± {:.4} degrees from the arm's reading, over {} frames",
                    offsets.theta_mean_deg,
                    offsets.theta_sd_deg,
                    offsets.phi_mean_deg,
                    offsets.phi_sd_deg,
                    table::count(offsets.frames as u64)
                ),
                None => "not known: no frame shows enough lines".to_owned(),
            },
        ),
        (
            "calibration".into(),
            match processed.calibration {
                ReferenceCalibration::KnownReference => {
                    "against the known reference, absolute (1/sr)"
                }
                ReferenceCalibration::UnknownReference => {
                    "against the unknown reference, eq. (3), relative"
                }
                ReferenceCalibration::GeometricModel => {
                    "none: ideal light over the geometry, relative"
                }
            }
            .to_owned(),
        ),
        (
            "samples".into(),
            format!(
                "{}, and {} points left out ({} occluded, {} without light, {} at lines or the border, {} saturated, {} not finite)",
                table::count(processed.samples.len() as u64),
                table::count(left_out.total()),
                table::count(left_out.occlusion),
                table::count(left_out.dark_reference + left_out.below_horizon),
                table::count(left_out.mark + left_out.border),
                table::count(left_out.saturated),
                table::count(left_out.not_finite)
            ),
        ),
    ];
    if processed.mirrors > 0 {
        rows.push((
            "mirror".into(),
            format!(
                "{} frames left out: they show the light to gonia calibrate, and are no samples",
                table::count(processed.mirrors as u64)
            ),
        ));
    }
    for refused in counts.refused {
        rows.push((
            format!("refused, {}", table::count(refused.count)),
            refused.reason,
        ));
    }
    rows
}
