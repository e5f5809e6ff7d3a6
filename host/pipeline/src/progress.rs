//! What a caller hears of the work, and how it ends it early.

use std::fmt;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// A step of the pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Step {
    /// Registration, sampling and calibration of the frames.
    FramesToSamples,
    /// Samples are put into bins.
    Binning,
    /// Bins are sorted for the search of neighbourhoods.
    Sorting,
    /// Cross-validation chooses the coordinates of the interpolation.
    ChoosingSettings,
    /// Cross-validation calibrates the standard errors.
    CalibratingErrorBars,
    /// Blocks are fitted, before rows are made of them: only on grids that do not fit memory.
    FittingBlocks,
    /// Every cell gets its value.
    Interpolating,
    /// Rows are made and written: only on grids that do not fit memory.
    InterpolatingAndWriting,
    /// A model's parameters are searched.
    FittingModel,
    /// A fitted model is evaluated on the grid.
    Tabulating,
    /// Two BRDFs are compared.
    Comparing,
    /// The paper's method interpolates the check cells.
    PaperMethod,
    /// Fiducial lines are looked for in frames, for a calibration of the rig.
    FindingLines,
    /// The rig's numbers are found from them.
    SolvingGeometry,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Step::FramesToSamples => "frames to samples",
            Step::Binning => "binning",
            Step::Sorting => "sorting",
            Step::ChoosingSettings => "choosing settings",
            Step::CalibratingErrorBars => "calibrating error bars",
            Step::FittingBlocks => "fitting",
            Step::Interpolating => "interpolating",
            Step::InterpolatingAndWriting => "interpolating and writing",
            Step::FittingModel => "fitting the model",
            Step::Tabulating => "tabulating the model",
            Step::Comparing => "comparing",
            Step::PaperMethod => "the paper's method",
            Step::FindingLines => "finding lines",
            Step::SolvingGeometry => "solving the geometry",
        })
    }
}

/// Called with a step and its share done: 0 once as it begins, then shares between 0 and 1 from any
/// thread, and 1 once when it has ended well. A caller that returns [`ControlFlow::Break`] gets
/// [`Error::Cancelled`](crate::Error::Cancelled) soon after.
pub type Progress<'a> = dyn Fn(Step, f64) -> ControlFlow<()> + Sync + 'a;

/// A [`Progress`] for callers who do not want to know.
pub fn silent(_: Step, _: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// The caller has ended the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// Shares that work reports lie between those that mean begin and end.
const INSIDE: std::ops::RangeInclusive<f64> = 1e-9..=1.0 - 1e-9;

/// Runs a step. The work is given a function to call with its share done.
pub(crate) fn step<T, E: From<Cancelled>>(
    progress: &Progress<'_>,
    step: Step,
    work: impl FnOnce(&gonia_brdf::progress::Progress<'_>) -> Result<T, E>,
) -> Result<T, E> {
    if progress(step, 0.0).is_break() {
        return Err(Cancelled.into());
    }
    let is_cancelled = AtomicBool::new(false);
    let result = work(&|share: f64| {
        let heard = progress(step, share.clamp(*INSIDE.start(), *INSIDE.end()));
        if heard.is_break() {
            is_cancelled.store(true, Relaxed);
        }
        heard
    });
    // Work that was cancelled may end with any error, or come to its end all the same.
    if is_cancelled.into_inner() {
        return Err(Cancelled.into());
    }
    let value = result?;
    match progress(step, 1.0) {
        ControlFlow::Continue(()) => Ok(value),
        ControlFlow::Break(()) => Err(Cancelled.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn a_step_begins_once_and_ends_once() {
        let heard = Mutex::new(Vec::new());
        let progress = |_: Step, share: f64| {
            heard.lock().unwrap().push(share);
            ControlFlow::Continue(())
        };
        let value = step::<_, Cancelled>(&progress, Step::Binning, |tell| {
            assert!(tell(0.0).is_continue() && tell(1.0).is_continue());
            Ok(3)
        });
        assert_eq!(value, Ok(3));
        let heard = heard.into_inner().unwrap();
        assert_eq!((heard[0], heard[3], heard.len()), (0.0, 1.0, 4));
        assert!(heard[1] > 0.0 && heard[2] < 1.0);
    }

    #[test]
    fn a_break_cancels_at_the_beginning_in_the_middle_and_at_the_end() {
        for at in [0.0, 0.5, 1.0] {
            let progress = |_: Step, share: f64| match share >= at {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            };
            let result = step::<_, Cancelled>(&progress, Step::Binning, |tell| {
                let _ = tell(0.5);
                Ok(())
            });
            assert_eq!(result, Err(Cancelled));
        }
    }
}
